//! Balls and words of siblings, a lane each.

use crate::simd::FloatLanes;
use crate::tree::{Leaf, Node};
use glam::{Mat4, Vec4};

/// Balls: centers relative to the tester's reference point, in its unit.
#[derive(Debug, Clone, Copy)]
pub(super) struct SphereLanes<V = Vec4> {
    pub(super) center: [V; 3],
    pub(super) radius: V,
    /// Distance of the centers along the view direction.
    pub(super) depth: V,
}

impl<V: FloatLanes> SphereLanes<V> {
    #[inline(always)]
    pub(super) fn distance_squared(&self) -> V {
        let [x, y, z] = self.center;
        x * x + y * y + z * z
    }
}

/// What nodes have besides their spheres and first children: words of [`Node`] as they lie in memory.
#[derive(Debug, Clone, Copy)]
pub(super) struct PackedNodeLanes<V: FloatLanes = Vec4> {
    /// Both halves of the cone's axis.
    pub(super) axis: V::Words,
    /// Sine of the cone's half angle; above it the strip's direction.
    pub(super) sine: V::Words,
    /// Half length and width of the strip, number of children, flags; a byte each.
    pub(super) shape: V::Words,
}

impl<V: FloatLanes> PackedNodeLanes<V> {
    /// The coordinates of the packed axes, whole numbers.
    #[inline(always)]
    pub(super) fn axis(&self) -> (V, V) {
        (
            V::from_bits_of(self.axis, 16, 16, true),
            V::from_bits_of(self.axis, 0, 16, true),
        )
    }

    /// The packed sines, whole numbers.
    #[inline(always)]
    pub(super) fn sine(&self) -> V {
        V::from_bits_of(self.sine, 16, 16, false)
    }

    /// Half lengths and widths of the strips, whole numbers.
    #[inline(always)]
    pub(super) fn strip(&self) -> (V, V) {
        (
            V::from_bits_of(self.shape, 24, 24, false),
            V::from_bits_of(self.shape, 16, 24, false),
        )
    }

    /// The packed directions of the strips, whole numbers.
    #[inline(always)]
    pub(super) fn direction(&self) -> (V, V) {
        // -128 is no code; a damaged file may hold it.
        let x = V::from_bits_of(self.sine, 8, 24, true);
        let y = V::from_bits_of(self.sine, 0, 24, true);
        (x.max(x.all(-127.0)), y.max(y.all(-127.0)))
    }

    /// Numbers of children.
    #[inline(always)]
    pub(super) fn child_counts(&self) -> V {
        V::from_bits_of(self.shape, 8, 24, false)
    }
}

/// The four items from `first` on, and how many of them there are. Siblings are followed by others, whose
/// lanes the caller masks; where the list ends the first is repeated. `None` if there is none.
#[inline(always)]
pub(super) fn four<T: Copy>(items: &[T], first: u32) -> Option<([T; 4], u32)> {
    let items = items.get(first as usize..)?;
    if let Some(&group) = items.first_chunk::<4>() {
        return Some((group, 4));
    }
    let &spare = items.first()?;
    let group = [0, 1, 2, 3].map(|i| items.get(i).copied().unwrap_or(spare));
    Some((group, items.len() as u32))
}

/// Four rows become the columns x, y, z, w.
#[inline(always)]
pub(super) fn columns([a, b, c, d]: [Vec4; 4]) -> [Vec4; 4] {
    let lanes = Mat4::from_cols(a, b, c, d).transpose();
    [lanes.x_axis, lanes.y_axis, lanes.z_axis, lanes.w_axis]
}

/// Columns of the spheres of four nodes (centers and radii), and of the other words: first children, and what [`PackedNodeLanes`] has.
#[inline(always)]
pub(super) fn of_nodes(nodes: &[Node; 4]) -> ([Vec4; 4], [[u32; 4]; 4]) {
    // The words travel as floats, whose bits nothing changes on the way.
    let words = nodes.map(|node| {
        let [_, _, _, _, first_child, axis, sine, shape] = bytemuck::cast::<Node, [f32; 8]>(node);
        Vec4::new(first_child, axis, sine, shape)
    });
    (
        columns(nodes.map(|node| node.center.extend(node.radius))),
        columns(words).map(|v| v.to_array().map(f32::to_bits)),
    )
}

/// Columns of the spheres of four leaves.
#[inline(always)]
pub(super) fn of_leaves(leaves: &[Leaf; 4]) -> [Vec4; 4] {
    columns(leaves.map(|leaf| leaf.center.extend(leaf.radius)))
}
