//! Nodes over leaves that have their places: the last part of every build.

use super::blocks::{self, LeafSource};
use super::closed::ClosedEvidence;
use super::shape::TreeShape;
use super::{AlignedRecords, Leaf, Model, Node, NodeAttributes, NormalCone, Tree, moments};
use crate::abi::Vertex;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Box of vertices, its middle, and the largest distance of one of them from that.
#[derive(Debug, Clone, Copy)]
pub(super) struct VertexExtent {
    pub(super) min: Vec3,
    pub(super) max: Vec3,
    pub(super) center: Vec3,
    pub(super) radius: f32,
}

impl VertexExtent {
    /// All zero where there are no vertices.
    pub(super) fn of(vertices: &[Vertex]) -> Self {
        let (min, max) = vertices
            .par_iter()
            .with_min_len(4096)
            .map(|vertex| (vertex.position, vertex.position))
            .reduce(
                || (Vec3::INFINITY, Vec3::NEG_INFINITY),
                |a, b| (a.0.min(b.0), a.1.max(b.1)),
            );
        let (min, max) = if vertices.is_empty() {
            (Vec3::ZERO, Vec3::ZERO)
        } else {
            (min, max)
        };
        let center = ((min.as_dvec3() + max.as_dvec3()) * 0.5).as_vec3();
        // Distances go from the rounded center: far from the origin of the model it lies a large step away.
        let from = center.as_dvec3();
        // The bits of a number that is not negative sort like the number.
        let farthest = AtomicU64::new(0);
        vertices.par_chunks(4096).for_each(|chunk| {
            let square = chunk
                .iter()
                .map(|v| from.distance_squared(v.position.as_dvec3()))
                .fold(0.0, f64::max);
            farthest.fetch_max(square.to_bits(), Ordering::Relaxed);
        });
        Self {
            min,
            max,
            center,
            radius: f64::from_bits(farthest.into_inner()).sqrt() as f32,
        }
    }
}

/// Index of the first node of each level, then the number of nodes.
pub(super) fn level_starts_of(shape: &TreeShape) -> Vec<u32> {
    let mut starts = Vec::with_capacity(shape.levels.len() + 1);
    starts.push(0u32);
    for level in &shape.levels {
        starts.push(starts[starts.len() - 1] + level.len() as u32);
    }
    starts
}

/// What the nodes of a model are made from.
pub(super) struct TreeGrowth<'a> {
    pub(super) shape: &'a TreeShape,
    /// [`level_starts_of`] the shape.
    pub(super) level_starts: Vec<u32>,
    /// [`links`] of the shape.
    pub(super) links: (Vec<u32>, Vec<u32>),
    /// Unpacked normal of each vertex, or empty where there are none.
    pub(super) normals: Vec<Vec3>,
    /// A point near the model.
    pub(super) origin: DVec3,
    pub(super) stop: &'a AtomicBool,
    /// Called with a number of leaves that are done.
    pub(super) done: &'a (dyn Fn(u64) + Sync),
}

impl TreeGrowth<'_> {
    /// Gives a model its tree. The vertices and triangles are in the order of the leaves, which have their centers, those of
    /// points their radii as well. Without use where `stop` was set meanwhile.
    pub(super) fn grow(
        self,
        model: &mut Model,
        mut leaves: AlignedRecords<Leaf>,
    ) -> ClosedEvidence {
        let (parents, first_leaf) = self.links;
        let node_count = self.shape.node_count();
        let mut nodes = AlignedRecords::<Node>::of_tree(node_count);
        let mut attributes = AlignedRecords::<NodeAttributes>::of_tree(node_count);
        let source = LeafSource {
            shape: self.shape,
            level_starts: &self.level_starts,
            vertices: &model.vertices,
            normals: &self.normals,
            triangles: &model.triangles,
            leaf_colors: (model.textures.as_deref()).map_or(&[], |textures| &textures.leaf_colors),
            origin: self.origin,
            stop: self.stop,
            done: self.done,
        };
        let findings = blocks::fill(&source, &mut leaves, &mut nodes, &mut attributes);
        if self.stop.load(Ordering::Relaxed) {
            return findings.evidence;
        }
        if findings.any_flat {
            // Children of a node come after it: what is inherited is already final.
            for index in 0..nodes.len() {
                if nodes[index].flags & Node::FLAT != 0 {
                    nodes[index].cone = if index == 0 {
                        NormalCone::ALL
                    } else {
                        nodes[parents[index] as usize].cone
                    };
                }
            }
        }
        drop(self.normals);
        model.tree = Tree {
            nodes,
            attributes,
            parents,
            first_leaf,
            level_starts: self.level_starts,
            leaves,
            moments: AlignedRecords::default(),
        };
        model.tree.moments = moments::compute(model);
        findings.evidence
    }
}

/// Parents and first leaves of all nodes.
pub(super) fn links(shape: &TreeShape, level_starts: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let mut parents = Vec::with_capacity(shape.node_count());
    let mut first_leaf = Vec::with_capacity(shape.node_count());
    if !shape.levels.is_empty() {
        parents.push(0);
    }
    for (level, &start) in shape.levels.iter().zip(level_starts) {
        first_leaf.extend_from_slice(&level.leaf_starts[..level.len()]);
        // The last level's children are leaves, which have no entry.
        if parents.len() < shape.node_count() {
            for (index, pair) in level.child_starts.windows(2).enumerate() {
                parents.extend(std::iter::repeat_n(
                    start + index as u32,
                    (pair[1] - pair[0]) as usize,
                ));
            }
        }
    }
    (parents, first_leaf)
}
