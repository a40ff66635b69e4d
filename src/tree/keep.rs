//! A part of a model, its tree made from the tree of the whole.
//!
//! Leaves are not ordered again, vertices not read again and spacings not measured again. Groups are divided where the tree
//! of the whole divides them, at its highest border within the middle half, so that nodes stay as compact as they were. Only
//! nodes are computed, and of those only the ones that are left: their spheres, cones and means are those of what is kept.

use super::grow::{TreeGrowth, VertexExtent, level_starts_of, links};
use super::part::PartShape;
use super::shape::{ShapeLevel, TreeShape};
use super::{AlignedRecords, Error, Leaf, Model, ModelTextures, Tree, framed, order};
use crate::abi::Vertex;
use crate::math::octahedral;
use crate::progress::Progress;
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

impl Model {
    /// The model of those leaves (triangles, or points) whose entry in `keep` is true, in the same space and with the radii
    /// that points have. Vertices that no kept triangle uses are left out. The result depends on model and choice alone.
    /// O(n).
    ///
    /// Where nothing is kept the result is empty.
    ///
    /// # Errors
    /// Not one entry for each leaf; cancelled.
    pub fn kept(&self, keep: &[bool], progress: &dyn Progress) -> Result<Self, Error> {
        if keep.len() != self.tree.leaves.len() {
            return Err(Error::Mismatch {
                what: "choices of leaves",
                count: keep.len(),
                vertices: self.tree.leaves.len(),
            });
        }
        let kept: Vec<u32> = (0..keep.len() as u32)
            .filter(|&leaf| keep[leaf as usize])
            .collect();
        progress.stage("keeping a part", kept.len() as u64);
        let leaves: AlignedRecords<Leaf> = kept
            .iter()
            .map(|&leaf| self.tree.leaves[leaf as usize])
            .collect();
        let mut model = self.without_tree(&kept);
        let shape = shape_of(&self.tree, &kept);
        let level_starts = level_starts_of(&shape);
        let links = links(&shape, &level_starts);
        let stop = AtomicBool::new(false);
        let done = |amount: u64| {
            progress.advance(amount);
            if progress.is_cancelled() {
                stop.store(true, Ordering::Relaxed);
            }
        };
        let growth = TreeGrowth {
            shape: &shape,
            level_starts,
            links,
            normals: normals_of(&model),
            origin: model.orbit_center.as_dvec3(),
            stop: &stop,
            done: &done,
        };
        let evidence = growth.grow(&mut model, leaves);
        if stop.into_inner() || progress.is_cancelled() {
            return Err(Error::Cancelled);
        }
        model.is_closed = !model.triangles.is_empty() && evidence.is_closed();
        Ok(model)
    }

    /// What is kept of vertices, triangles and textures.
    fn without_tree(&self, kept: &[u32]) -> Self {
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        let old_of_new = if self.triangles.is_empty() {
            kept.to_vec()
        } else {
            triangles.extend(kept.iter().map(|&leaf| self.triangles[leaf as usize]));
            let (mut old, used) = order::by_first_use(&mut triangles, self.vertices.len());
            old.truncate(used as usize);
            old
        };
        let vertices: Vec<Vertex> = old_of_new
            .par_iter()
            .with_min_len(4096)
            .map(|&old| self.vertices[old as usize])
            .collect();
        let textures = self.textures.as_ref().map(|own| {
            let points = old_of_new.iter().map(|&old| own.points[old as usize]);
            let colors = kept.iter().map(|&leaf| own.leaf_colors[leaf as usize]);
            Arc::new(ModelTextures {
                images: own.images.clone(),
                points: points.collect(),
                leaf_colors: colors.collect(),
            })
        });
        let extent = VertexExtent::of(&vertices);
        let mut model = Self {
            used_vertices: vertices.len() as u32,
            vertices,
            triangles,
            tree: Tree::default(),
            origin: self.origin,
            min: extent.min,
            max: extent.max,
            orbit_center: extent.center,
            orbit_radius: extent.radius,
            framed: None,
            is_closed: false,
            has_colors: self.has_colors,
            textures,
            patches: None,
        };
        // Nothing was framed where all was asked for.
        model.framed = (self.framed).and_then(|part| framed::within(&model, part.reach));
        model
    }
}

/// Unpacked normals of all vertices; none for a cloud without any.
fn normals_of(model: &Model) -> Vec<Vec3> {
    let vertices = &model.vertices;
    if model.triangles.is_empty() && vertices.par_iter().all(|vertex| vertex.color[3] == 0) {
        return Vec::new();
    }
    let normal = |vertex: &Vertex| match vertex.color[3] {
        0 => Vec3::ZERO,
        _ => octahedral::decode(vertex.normal),
    };
    vertices.par_iter().with_min_len(4096).map(normal).collect()
}

/// The shape over the kept leaves, in ascending order.
fn shape_of(tree: &Tree, kept: &[u32]) -> TreeShape {
    let count = kept.len() as u32;
    let depth = PartShape::usual_depth(count);
    let borders = border_levels(tree, kept);
    let mut levels = Vec::with_capacity(depth);
    // The first leaf of each node of a level, then the number of leaves.
    let mut starts = vec![0, count];
    for level in 0..depth {
        let division = GroupDivision::of(&borders, depth - 1 - level);
        let mut child_starts = vec![0];
        let mut below = vec![0];
        for node in starts.windows(2) {
            division.children(node[0]..node[1], &mut below);
            child_starts.push(below.len() as u32 - 1);
        }
        levels.push(ShapeLevel {
            child_starts,
            leaf_starts: std::mem::replace(&mut starts, below),
        });
    }
    TreeShape { levels }
}

/// The highest level at which the tree divides each kept leaf from the one before it; the number of levels where they are
/// children of one node.
fn border_levels(tree: &Tree, kept: &[u32]) -> Vec<u8> {
    // At most 32 levels: indices have 32 bits.
    let mut of_leaf = vec![tree.level_count() as u8; tree.leaves.len()];
    for level in (0..tree.level_count()).rev() {
        for node in tree.level(level) {
            of_leaf[tree.first_leaf[node as usize] as usize] = level as u8;
        }
    }
    let mut next = 0;
    let border = |&leaf: &u32| {
        let own = &of_leaf[next..=leaf as usize];
        next = leaf as usize + 1;
        own.iter().copied().min().unwrap_or(0)
    };
    kept.iter().map(border).collect()
}

/// How the leaves of a node are divided among its two to four children, which are trees of one depth.
struct GroupDivision<'a> {
    borders: &'a [u8],
    /// Fewest and most leaves that a child can have.
    least: u64,
    most: u64,
}

impl<'a> GroupDivision<'a> {
    /// For children of so many levels of nodes.
    fn of(borders: &'a [u8], child_depth: usize) -> Self {
        Self {
            borders,
            least: 1 << child_depth,
            most: 1 << (2 * child_depth),
        }
    }

    /// Appends the end of each child of a node over these leaves.
    fn children(&self, leaves: Range<u32>, ends: &mut Vec<u32>) {
        let middle = self.split(&leaves, 2 * self.most);
        for half in [leaves.start..middle, middle..leaves.end] {
            if u64::from(half.end - half.start) > self.most {
                ends.push(self.split(&half, self.most));
            }
            ends.push(half.end);
        }
    }

    /// Where to divide leaves so that either part has at most so many: at the highest border within the middle half, of
    /// several the one next to the middle.
    fn split(&self, leaves: &Range<u32>, most: u64) -> u32 {
        let count = u64::from(leaves.end - leaves.start);
        let first = self.least.max(count.saturating_sub(most)).max(count / 4);
        let last = most.min(count - self.least).min(count - count / 4);
        let middle = count / 2;
        let offsets = first..=last;
        let best = offsets.min_by_key(|&offset| {
            let border = self.borders[leaves.start as usize + offset as usize];
            (border, offset.abs_diff(middle))
        });
        leaves.start + best.unwrap_or(middle) as u32
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may panic")]
    use super::*;
    use crate::generate::{self, ShapeSpec};
    use crate::mesh::Mesh;
    use crate::progress::SilentProgress;
    use crate::tree::{BuildOptions, build, build_with_radii, check};

    fn cloud(count: u32) -> Model {
        let position = |i: u32| {
            let t = i as f32;
            Vec3::new((t * 0.7).sin() * 9.0, (t * 1.3).cos() * 5.0, t * 0.001)
        };
        let mesh = Mesh {
            positions: (0..count).map(position).collect(),
            colors: (0..count).map(|i| [i as u8, 7, 200, 255]).collect(),
            ..Mesh::default()
        };
        build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
    }

    fn surface() -> Model {
        let spec: ShapeSpec = "torus:4000".parse().unwrap();
        build(
            generate::mesh(&spec),
            &BuildOptions::default(),
            &SilentProgress,
        )
        .unwrap()
    }

    /// Every promise of a tree holds for parts of every kind: none, one, a few, runs, every other leaf, all.
    #[test]
    fn parts_are_sound_trees_of_what_is_kept() {
        for model in [cloud(3000), surface(), cloud(1)] {
            let count = model.tree.leaves.len();
            let choices: [&dyn Fn(usize) -> bool; 8] = [
                &|_| false,
                &|i| i == count / 2,
                &|i| i % 997 == 3,
                &|i| i < count / 3,
                &|i| i % 2 == 0,
                &|i| (i / 37) % 5 == 1 || i + 9 > count,
                &|i| i * i % 11 < 4,
                &|_| true,
            ];
            for (number, choice) in choices.iter().enumerate() {
                let keep: Vec<bool> = (0..count).map(choice).collect();
                let part = model.kept(&keep, &SilentProgress).unwrap();
                let report = check(&part);
                assert!(report.is_clean(), "choice {number} of {count}: {report}");
                let wanted = keep.iter().filter(|&&is_kept| is_kept).count();
                assert_eq!(part.tree.leaves.len(), wanted);
                if wanted == count && count > 1 {
                    assert_eq!(part.tree.nodes.len(), model.tree.nodes.len());
                    assert_eq!(part.is_closed, model.is_closed);
                }
            }
            assert!(model.kept(&[true; 2], &SilentProgress).is_err());
        }
    }

    /// Points keep place, color and radius; triangles their corners.
    #[test]
    fn what_is_kept_is_unchanged() {
        let model = cloud(500);
        let keep: Vec<bool> = (0..500).map(|i| i % 3 != 0).collect();
        let part = model.kept(&keep, &SilentProgress).unwrap();
        let mut old = (0..500).filter(|&i| keep[i]);
        for (leaf, vertex) in part.tree.leaves.iter().zip(&part.vertices) {
            let from = old.next().unwrap();
            assert_eq!(*leaf, model.tree.leaves[from]);
            assert_eq!(*vertex, model.vertices[from]);
        }
        let model = surface();
        let keep: Vec<bool> = (0..model.triangles.len()).map(|i| i % 7 == 2).collect();
        let part = model.kept(&keep, &SilentProgress).unwrap();
        let corners = |model: &Model, t: usize| {
            model.triangles[t].map(|corner| model.vertices[corner as usize])
        };
        let old = (0..keep.len()).filter(|&i| keep[i]);
        for (new, old) in old.enumerate() {
            assert_eq!(corners(&part, new), corners(&model, old));
        }
        assert!(!part.is_closed && part.origin == model.origin);
    }

    /// Nodes stay compact: what is left of half of a cloud, in patches, has nodes hardly larger than those of a tree that is
    /// built anew over the same points.
    #[test]
    fn nodes_of_a_part_are_compact() {
        let model = cloud(20_000);
        let keep: Vec<bool> = (0..20_000)
            .map(|i| (i / 61) % 2 == 0 || i % 5 == 0)
            .collect();
        let part = model.kept(&keep, &SilentProgress).unwrap();
        let mesh = Mesh {
            positions: part.vertices.iter().map(|vertex| vertex.position).collect(),
            ..Mesh::default()
        };
        // Points as large as there: only the order differs.
        let radii: Vec<f32> = part.tree.leaves.iter().map(|leaf| leaf.radius).collect();
        let anew = build_with_radii(mesh, &radii, &SilentProgress).unwrap();
        let mean = |model: &Model| {
            let lowest = model.tree.level(model.tree.level_count() - 1);
            let radii = lowest.map(|id| f64::from(model.tree.nodes[id as usize].radius));
            let radii: Vec<f64> = radii.collect();
            radii.iter().sum::<f64>() / radii.len() as f64
        };
        // 1.10; divided in the middle, whatever the borders, 1.19.
        assert!(
            mean(&part) < 1.14 * mean(&anew),
            "{} {}",
            mean(&part),
            mean(&anew)
        );
    }
}
