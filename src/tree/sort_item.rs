//! Leaves as they are sorted into the tree.

use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec4};

/// A leaf on its way: the size of a [`super::Leaf`], in whose memory it travels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct SortItem {
    /// Center of the leaf, finite.
    pub(super) center: Vec3,
    /// Index of the triangle or point in the file.
    pub(super) index: u32,
}

impl SortItem {
    /// All four words as one vector; the last lane is meaningless.
    #[inline]
    pub(super) fn lanes(&self) -> Vec4 {
        bytemuck::cast(*self)
    }

    #[inline]
    pub(super) fn key(&self, axis: usize) -> f32 {
        self.center[axis]
    }
}
