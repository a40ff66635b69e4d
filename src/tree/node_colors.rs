//! Colors of nodes by those of the points or triangles below. Of categories the most frequent counts: a mean of two colors would be
//! that of a third category, or of none.

use super::Model;
use crate::abi::Vertex;
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// Most colors that are told apart below a node; further ones are not counted. LAS names 19 classes, the palette has 12 colors.
const MOST_COLORS: usize = 32;

/// Nodes per parallel piece.
const PIECE: usize = 64;

impl Model {
    /// Gives vertices other colors, one each, and nodes the means of them, or of categories that of most points below. Images of a
    /// surface go. O(n log n).
    pub(crate) fn recolor(&mut self, colors: &[[u8; 4]], are_categories: bool) {
        let vertices = self.vertices.par_iter_mut().zip(colors);
        vertices.for_each(|(vertex, color)| vertex.color[..3].copy_from_slice(&color[..3]));
        (self.has_colors, self.textures) = (true, None);
        match are_categories {
            true => self.color_by_majority(),
            false => self.color_by_means(),
        }
    }

    /// Gives each node of a cloud the color that most points below it have, of as many the one that comes first; instead of
    /// the mean. O(n log n).
    pub fn color_by_majority(&mut self) {
        if self.kind().is_surface() {
            return;
        }
        self.color_nodes(|model, below| {
            let points = &model.vertices[below.start as usize..below.end as usize];
            most_frequent(points.iter().map(|v| [v.color[0], v.color[1], v.color[2]]))
        });
    }

    /// Gives each node the mean of the points or triangles below it, weighted by their area.
    fn color_by_means(&mut self) {
        self.color_nodes(|model, below| {
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
            for leaf in below {
                let (color, area) = model.leaf_color(leaf as usize);
                let weight = area.max(f32::MIN_POSITIVE);
                sum += weight * color;
                weights += weight;
            }
            (sum / weights + 0.5)
                .to_array()
                .map(|channel| channel as u8)
        });
    }

    /// Mean color of the corners of a leaf, 0 to 255, and a number in proportion to its area.
    fn leaf_color(&self, leaf: usize) -> (Vec3, f32) {
        let color = |vertex: &Vertex| {
            let [red, green, blue, _] = vertex.color.map(f32::from);
            Vec3::new(red, green, blue)
        };
        let Some(corners) = self.triangles.get(leaf) else {
            let radius = self.tree.leaves[leaf].radius;
            return (color(&self.vertices[leaf]), radius * radius);
        };
        let [a, b, c] = corners.map(|corner| &self.vertices[corner as usize]);
        let across = (b.position - a.position).cross(c.position - a.position);
        ((color(a) + color(b) + color(c)) / 3.0, across.length())
    }

    /// Gives each node the color that a rule makes of the leaves below.
    fn color_nodes(&mut self, color_of: impl Fn(&Self, Range<u32>) -> [u8; 3] + Sync) {
        let mut attributes = std::mem::take(&mut self.tree.attributes);
        let model = &*self;
        attributes
            .par_chunks_mut(PIECE)
            .enumerate()
            .for_each(|(piece, own)| {
                for (node, own) in (piece * PIECE..).zip(own) {
                    let color = color_of(model, model.tree.leaf_range(node as u32));
                    own.color[..3].copy_from_slice(&color);
                }
            });
        self.tree.attributes = attributes;
    }
}

/// The color that is there most often, of as many the one that comes first.
fn most_frequent(colors: impl Iterator<Item = [u8; 3]>) -> [u8; 3] {
    let mut counts: Vec<([u8; 3], u32)> = Vec::with_capacity(MOST_COLORS);
    for color in colors {
        match counts.iter().position(|(known, _)| *known == color) {
            Some(at) => counts[at].1 += 1,
            None if counts.len() < MOST_COLORS => counts.push((color, 1)),
            None => {}
        }
    }
    let most = counts.iter().rev().max_by_key(|(_, count)| *count);
    most.map_or([0; 3], |(color, _)| *color)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::mesh::Mesh;
    use crate::progress::SilentProgress;
    use crate::tree::{BuildOptions, build};
    use glam::Vec3;
    use std::collections::BTreeMap;

    #[test]
    fn nodes_have_the_color_of_most_points() {
        const COLORS: [[u8; 4]; 3] = [[200, 0, 0, 255], [0, 200, 0, 255], [0, 0, 200, 255]];
        let at = |i: usize| Vec3::new((i % 40) as f32, (i / 40) as f32, 0.0);
        // Green on the left, then a mixture in which red is the most.
        let color = |i: usize| match (i % 40 < 20, i % 5) {
            (true, _) => COLORS[1],
            (_, 0 | 2 | 3) => COLORS[0],
            (_, 1) => COLORS[1],
            _ => COLORS[2],
        };
        let mesh = Mesh {
            positions: (0..1600).map(at).collect(),
            colors: (0..1600).map(color).collect(),
            ..Mesh::default()
        };
        let mut model = build(mesh.clone(), &BuildOptions::default(), &SilentProgress).unwrap();
        let alphas: Vec<u8> = model
            .tree
            .attributes
            .iter()
            .map(|own| own.color[3])
            .collect();
        model.color_by_majority();
        for (node, own) in model.tree.attributes.iter().enumerate() {
            let mut counts = BTreeMap::new();
            for leaf in model.tree.leaf_range(node as u32) {
                let [red, green, blue, _] = model.vertices[leaf as usize].color;
                *counts.entry([red, green, blue]).or_insert(0) += 1;
            }
            let [red, green, blue, alpha] = own.color;
            let most = counts.values().max().unwrap();
            assert_eq!(counts.get(&[red, green, blue]), Some(most), "node {node}");
            assert_eq!(alpha, alphas[node]);
        }
        // Means are those that a tree has that is built of the same colors, but for rounding.
        let colors: Vec<[u8; 4]> = model.vertices.iter().map(|own| own.color).collect();
        let own = |model: &Model| {
            let nodes = model.tree.attributes.iter();
            nodes.map(|own| own.color).collect::<Vec<_>>()
        };
        let built = build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
        model.recolor(&colors, false);
        for (mean, wanted) in own(&model).iter().zip(own(&built)) {
            assert!((0..4).all(|c| mean[c].abs_diff(wanted[c]) <= 1), "{mean:?}");
        }
        let white = vec![[255; 4]; colors.len()];
        model.recolor(&white, true);
        assert!(own(&model).iter().all(|color| color[..3] == [255; 3]));
        // Ties go to the first.
        let tie = [[3; 3], [1; 3], [1; 3], [3; 3], [2; 3]];
        assert_eq!(most_frequent(tie.into_iter()), [3; 3]);
    }
}
