//! Four siblings in the four lanes of vectors.

use crate::tree::{Leaf, Node};
use glam::{Mat4, Vec4};

/// Four balls: centers relative to the tester's reference point, in its unit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Balls {
    pub(super) center: [Vec4; 3],
    pub(super) radius: Vec4,
    /// Distance of the centers along the view direction.
    pub(super) depth: Vec4,
}

impl Balls {
    pub(super) const ZERO: Self = Self {
        center: [Vec4::ZERO; 3],
        radius: Vec4::ZERO,
        depth: Vec4::ZERO,
    };

    #[inline]
    pub(super) fn distance_squared(&self) -> Vec4 {
        let [x, y, z] = self.center;
        x * x + y * y + z * z
    }
}

/// What four nodes have besides their spheres, a lane each: the words of [`Node`] as they lie in memory.
#[derive(Debug, Clone, Copy)]
pub(super) struct Words {
    pub(super) first_child: [u32; 4],
    /// Both halves of the cone's axis.
    axis: [u32; 4],
    /// Sine of the cone's half angle; above it the strip's direction.
    sine: [u32; 4],
    /// Half length and width of the strip, number of children, flags; a byte each.
    shape: [u32; 4],
}

impl Words {
    pub(super) const ZERO: Self = Self {
        first_child: [0; 4],
        axis: [0; 4],
        sine: [0; 4],
        shape: [0; 4],
    };

    /// The coordinates of the packed axes, whole numbers.
    #[inline]
    pub(super) fn axis(&self) -> (Vec4, Vec4) {
        let x = self.axis.map(|w| ((w << 16) as i32 >> 16) as f32);
        let y = self.axis.map(|w| (w as i32 >> 16) as f32);
        (Vec4::from_array(x), Vec4::from_array(y))
    }

    /// The packed sines, whole numbers.
    #[inline]
    pub(super) fn sine(&self) -> Vec4 {
        Vec4::from_array(self.sine.map(|w| (w & 0xffff) as i32 as f32))
    }

    /// Whether a cone of the four can decide anything.
    #[inline]
    pub(super) fn has_cones(&self) -> bool {
        self.sine.iter().fold(u32::MAX, |all, w| all & w) & 0xffff != 0xffff
    }

    /// Half lengths and widths of the strips, whole numbers.
    #[inline]
    pub(super) fn strip(&self) -> (Vec4, Vec4) {
        let half = self.shape.map(|w| (w & 0xff) as i32 as f32);
        let width = self.shape.map(|w| (w >> 8 & 0xff) as i32 as f32);
        (Vec4::from_array(half), Vec4::from_array(width))
    }

    /// The packed directions of the strips, whole numbers.
    #[inline]
    pub(super) fn direction(&self) -> (Vec4, Vec4) {
        // -128 is no code; a damaged file may hold it.
        let x = self.sine.map(|w| ((w << 8) as i32 >> 24).max(-127) as f32);
        let y = self.sine.map(|w| (w as i32 >> 24).max(-127) as f32);
        (Vec4::from_array(x), Vec4::from_array(y))
    }

    /// Numbers of children.
    #[inline]
    pub(super) fn child_counts(&self) -> [u32; 4] {
        self.shape.map(|w| w >> 16 & 0xff)
    }
}

/// The four items from `first` on, and how many of them there are. Siblings are followed by others, whose
/// lanes the caller masks; where the list ends the first is repeated. `None` if there is none.
#[inline]
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
#[inline]
pub(super) fn columns([a, b, c, d]: [Vec4; 4]) -> [Vec4; 4] {
    let lanes = Mat4::from_cols(a, b, c, d).transpose();
    [lanes.x_axis, lanes.y_axis, lanes.z_axis, lanes.w_axis]
}

/// Columns of the spheres of four nodes (centers and radii), and the rest.
#[inline]
pub(super) fn of_nodes(nodes: &[Node; 4]) -> ([Vec4; 4], Words) {
    // The words travel as floats, whose bits nothing changes on the way.
    let words = nodes.map(|node| {
        let [_, _, _, _, first_child, axis, sine, shape] = bytemuck::cast::<Node, [f32; 8]>(node);
        Vec4::new(first_child, axis, sine, shape)
    });
    let [first_child, axis, sine, shape] = columns(words).map(|v| v.to_array().map(f32::to_bits));
    (
        columns(nodes.map(|node| node.center.extend(node.radius))),
        Words {
            first_child,
            axis,
            sine,
            shape,
        },
    )
}

/// Columns of the spheres of four leaves.
#[inline]
pub(super) fn of_leaves(leaves: &[Leaf; 4]) -> [Vec4; 4] {
    columns(leaves.map(|leaf| leaf.center.extend(leaf.radius)))
}
