//! Questions to a tree.

use super::{Model, Tree};
use std::ops::Range;

/// Bytes of each part of a model in memory.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct MemoryBytes {
    /// Interior nodes: what the cut tests.
    pub nodes: u64,
    /// Attributes of the nodes.
    pub attributes: u64,
    /// Parents, first leaves, level starts.
    pub links: u64,
    /// Bounding spheres of the leaves.
    pub leaves: u64,
    /// Sums for filtered splats.
    pub moments: u64,
    /// Vertices.
    pub vertices: u64,
    /// Corner indices.
    pub triangles: u64,
}

impl MemoryBytes {
    /// All parts together.
    pub fn total(&self) -> u64 {
        self.nodes
            + self.attributes
            + self.links
            + self.leaves
            + self.moments
            + self.vertices
            + self.triangles
    }
}

impl MemoryBytes {
    /// The tree alone, without vertices and corner indices.
    pub fn tree(&self) -> u64 {
        self.total() - self.vertices - self.triangles
    }
}

impl Model {
    /// Bytes of each part (content, not capacity).
    pub fn memory_bytes(&self) -> MemoryBytes {
        fn bytes<T>(values: &[T]) -> u64 {
            size_of_val(values) as u64
        }
        let tree = &self.tree;
        MemoryBytes {
            nodes: bytes(&tree.nodes),
            attributes: bytes(&tree.attributes),
            links: bytes(&tree.parents) + bytes(&tree.first_leaf) + bytes(&tree.level_starts),
            leaves: bytes(&tree.leaves),
            moments: bytes(&tree.moments),
            vertices: bytes(&self.vertices),
            triangles: bytes(&self.triangles),
        }
    }
}

impl Tree {
    /// Number of leaves.
    #[inline]
    pub fn leaf_count(&self) -> u32 {
        self.leaves.len() as u32
    }

    /// Number of levels of interior nodes; 0 for fewer than two leaves.
    #[inline]
    pub fn level_count(&self) -> usize {
        self.level_starts.len().saturating_sub(1)
    }

    /// The nodes of a level; the root's level is 0. Panics if there is no such level.
    #[inline]
    pub fn level(&self, level: usize) -> Range<u32> {
        self.level_starts[level]..self.level_starts[level + 1]
    }

    /// The level of a node; the root's is 0. O(log of the number of levels).
    #[inline]
    pub fn level_of(&self, node: u32) -> usize {
        self.level_starts
            .partition_point(|&start| start <= node)
            .saturating_sub(1)
    }

    /// The children of a node: nodes, or leaves if [`super::Node::has_leaves`].
    #[inline]
    pub fn children(&self, node: u32) -> Range<u32> {
        let node = &self.nodes[node as usize];
        node.first_child..node.first_child + u32::from(node.child_count)
    }

    /// The leaves below a node.
    #[inline]
    pub fn leaf_range(&self, node: u32) -> Range<u32> {
        // The next entry is the end, except at the end of a level: the first node of the next one starts at leaf 0.
        let end = match self.first_leaf.get(node as usize + 1) {
            None | Some(0) => self.leaf_count(),
            Some(&next) => next,
        };
        self.first_leaf[node as usize]..end
    }

    /// The node of the lowest level whose child the leaf is; `None` in a tree without nodes.
    pub fn parent_of_leaf(&self, leaf: u32) -> Option<u32> {
        let level = self.level(self.level_count().checked_sub(1)?);
        let starts = &self.first_leaf[level.start as usize..level.end as usize];
        Some(level.start + starts.partition_point(|&start| start <= leaf) as u32 - 1)
    }
}
