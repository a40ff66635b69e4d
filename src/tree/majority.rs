//! Colors of nodes that stand for categories: a mean of two of them would be the color of a third, or of none.

use super::Model;
use rayon::prelude::*;

/// Most colors that are told apart below a node; further ones are not counted. LAS names 19 classes, the palette has 12 colors.
const MOST_COLORS: usize = 32;

/// Nodes per parallel piece.
const PIECE: usize = 64;

impl Model {
    /// Gives each node of a cloud the color that most points below it have, of as many the one that comes first; instead of
    /// the mean. O(n log n).
    pub fn color_by_majority(&mut self) {
        if !self.triangles.is_empty() {
            return;
        }
        let vertices = &self.vertices;
        let mut attributes = std::mem::take(&mut self.tree.attributes);
        let tree = &self.tree;
        attributes
            .par_chunks_mut(PIECE)
            .enumerate()
            .for_each(|(piece, own)| {
                for (node, own) in (piece * PIECE..).zip(own) {
                    let below = tree.leaf_range(node as u32);
                    let colors = &vertices[below.start as usize..below.end as usize];
                    let color =
                        most_frequent(colors.iter().map(|v| [v.color[0], v.color[1], v.color[2]]));
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
        let mut model = build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
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
        // Ties go to the first.
        let tie = [[3; 3], [1; 3], [1; 3], [3; 3], [2; 3]];
        assert_eq!(most_frequent(tie.into_iter()), [3; 3]);
    }
}
