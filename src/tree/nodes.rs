//! Nodes in memory, arranged so that four siblings lie on two cache lines.

use super::Node;
use bytemuck::{Pod, Zeroable};
use std::fmt;
use std::ops::{Deref, DerefMut};

/// Four nodes: two lines of 64 bytes.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, align(128))]
struct Lines([Node; 4]);

/// The nodes of a tree; a slice of [`Node`] in every respect but where it begins.
///
/// Below the root's children a tree has only groups of four siblings, and the lowest level, three quarters of all, is a
/// power of two. It begins at a multiple of 128 bytes, and so do all groups: a group is two lines to wait for instead of
/// three, which is what a large cut waits for most.
#[derive(Clone, Default)]
pub struct Nodes {
    lines: Vec<Lines>,
    /// Nodes before the first, so that the lowest level is in its place.
    skip: usize,
    len: usize,
}

impl Nodes {
    /// As many nodes, all zero.
    pub fn zeroed(len: usize) -> Self {
        // Of the lowest level; an empty tree has none.
        let lowest = len.checked_ilog2().map_or(0, |log| len - (1 << log));
        let skip = (4 - lowest % 4) % 4;
        Self {
            lines: vec![Lines::zeroed(); (skip + len).div_ceil(4)],
            skip,
            len,
        }
    }
}

impl From<&[Node]> for Nodes {
    fn from(nodes: &[Node]) -> Self {
        let mut copy = Self::zeroed(nodes.len());
        copy.copy_from_slice(nodes);
        copy
    }
}

impl Deref for Nodes {
    type Target = [Node];

    #[inline]
    fn deref(&self) -> &[Node] {
        let all: &[Node] = bytemuck::cast_slice(&self.lines);
        &all[self.skip..self.skip + self.len]
    }
}

impl DerefMut for Nodes {
    #[inline]
    fn deref_mut(&mut self) -> &mut [Node] {
        let all: &mut [Node] = bytemuck::cast_slice_mut(&mut self.lines);
        &mut all[self.skip..self.skip + self.len]
    }
}

impl<'a> IntoIterator for &'a Nodes {
    type Item = &'a Node;
    type IntoIter = std::slice::Iter<'a, Node>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<'a> IntoIterator for &'a mut Nodes {
    type Item = &'a mut Node;
    type IntoIter = std::slice::IterMut<'a, Node>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

impl fmt::Debug for Nodes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::shape::Shape;

    /// In every tree the groups of four below the root's children begin on a line, and none is on a third.
    #[test]
    fn siblings_lie_on_two_lines() {
        assert!(Nodes::zeroed(0).is_empty());
        for leaves in [2, 4, 5, 9, 33, 100, 1000, 96_966, 871_414] {
            let shape = Shape::new(leaves);
            let nodes = Nodes::zeroed(shape.node_count());
            assert_eq!(nodes.len(), shape.node_count());
            let mut start = 1;
            let depth = shape.levels.len();
            for level in &shape.levels[..depth - 1] {
                for group in level.child_starts.windows(2) {
                    let siblings = &nodes[start + group[0] as usize..start + group[1] as usize];
                    if siblings.len() < 4 {
                        assert_eq!(
                            start, 1,
                            "{leaves} leaves: only the root has fewer than four"
                        );
                        continue;
                    }
                    let address = siblings.as_ptr().addr();
                    assert!(start == 1 || address % 128 == 0, "{leaves} leaves");
                }
                start += level.child_starts.last().map_or(0, |&end| end as usize);
            }
        }
    }
}
