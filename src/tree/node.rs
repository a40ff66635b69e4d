//! The records of the tree.

use crate::math::octahedral;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// An interior node, 32 bytes: everything that decides whether it is visible and small enough.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Node {
    /// Center of the bounding sphere, model space.
    pub center: Vec3,
    /// Radius of the bounding sphere; it contains the children's spheres and every triangle below. As spheres are
    /// nested they widen upward: by about 5 percent in the lowest levels, up to twice at the root of a closed shape.
    pub radius: f32,
    /// Index of the first child: a node, or a leaf if [`Node::has_leaves`].
    pub first_child: u32,
    /// Cone of the geometric normals below.
    pub cone: NormalCone,
    /// A capsule around everything below, much thinner than the sphere where triangles are needles.
    pub strip: NodeStrip,
    /// Number of children, 2 to 4 (1 only in a tree of a single leaf, which has no nodes).
    pub child_count: u8,
    /// [`Node::LEAF_CHILDREN`], [`Node::UNCULLED`], [`Node::FLAT`].
    pub flags: u8,
}

impl Node {
    /// Bit of `flags`: the children are leaves.
    pub const LEAF_CHILDREN: u8 = 1;
    /// Bit of `flags`: draw without culling by normal; the normals below cancel. The cone is [`NormalCone::ALL`].
    pub const UNCULLED: u8 = 2;
    /// Bit of `flags`: every triangle below is degenerate and has no normal. Nothing below can be seen as a triangle;
    /// the cone is that of the parent, so that such a node goes where its parent goes.
    pub const FLAT: u8 = 4;

    /// Tells whether the children are leaves rather than nodes.
    #[inline]
    pub fn has_leaves(&self) -> bool {
        self.flags & Self::LEAF_CHILDREN != 0
    }
}

/// A cone that contains every geometric normal below a node, 6 bytes.
///
/// Errs to the safe side: `sin_half_angle` is rounded up and includes the error of the packed axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct NormalCone {
    /// Axis, [`octahedral`] 2 x 16 bit.
    pub axis: [i16; 2],
    /// Sine of the half angle in units of 1/65535, rounded up; [`NormalCone::NEVER`] when the half angle reaches a
    /// quarter turn or there is no normal: such a node is never culled by its normals.
    pub sin_half_angle: u16,
}

impl NormalCone {
    /// `sin_half_angle` of a cone that never culls.
    pub const NEVER: u16 = u16::MAX;

    /// The cone that never culls.
    pub const ALL: Self = Self {
        axis: [0, 0],
        sin_half_angle: Self::NEVER,
    };

    /// Unit axis.
    #[inline]
    pub fn axis(&self) -> Vec3 {
        octahedral::decode(self.axis)
    }

    /// Sine of the half angle, at least the true one.
    #[inline]
    pub fn sin_half_angle(&self) -> f32 {
        f32::from(self.sin_half_angle) * (1.0 / 65535.0)
    }
}

/// A capsule around everything below a node, in units of its bounding sphere, 4 bytes: a segment through the
/// sphere's center along `direction`, thickened by `width`.
///
/// A needle's sphere is as wide as the needle is long; the capsule lets the cut draw a few splats along the
/// long axis instead of descending to every needle. Errs to the safe side: both lengths are rounded up and
/// include the error of the packed direction. Where the capsule gains nothing it is [`NodeStrip::SPHERE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct NodeStrip {
    /// Direction of the segment, octahedral 2 x 8 bit (units of 1/127).
    pub direction: [i8; 2],
    /// Half length of the segment over the sphere's radius, units of 1/255, rounded up.
    pub half_length: u8,
    /// Radius of the capsule over the sphere's radius, units of 1/255, rounded up.
    pub width: u8,
}

impl NodeStrip {
    /// No gain over the sphere.
    pub const SPHERE: Self = Self {
        direction: [0, 0],
        half_length: 0,
        width: 255,
    };

    /// Unit direction.
    #[inline]
    pub fn direction(&self) -> Vec3 {
        // -128 is no code; a damaged file may hold it.
        octahedral::decode(self.direction.map(|c| i16::from(c.max(-127)) * 258))
    }
}

/// What a drawn interior node needs besides its sphere, 16 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct NodeAttributes {
    /// Area-weighted mean normal for shading, octahedral 2 x 16 bit.
    pub normal: [i16; 2],
    /// Area-weighted mean color. Alpha is 0 where there is no mean normal, else 255 less the thickness along the normal, see
    /// [`NodeAttributes::half_thickness`]. Where there is none because normals point all around, as in a whole ball, it
    /// is two thirds of the mean color: without a normal it is lit as if it faced the light, and a ball has that much
    /// of it on average.
    pub color: [u8; 4],
    /// Radius of the splat that stands for the node: the largest distance of a corner below from the sphere's center
    /// (above 256 leaves a bound of it), at most the bounding radius. For points the bounding radius.
    pub splat_radius: f32,
    /// Sum of the triangle areas below, model units squared.
    pub area: f32,
}

impl NodeAttributes {
    /// How much thinner than true [`NodeAttributes::half_thickness`] may be, in splat radii. The packed normal is off by
    /// about half of this, and a plane should be thin.
    pub const THICKNESS_TOLERANCE: f32 = 1e-4;

    /// Tells whether `normal` is one.
    #[inline]
    pub fn has_normal(&self) -> bool {
        self.color[3] != 0
    }

    /// The mean normal, a unit vector; without meaning unless [`NodeAttributes::has_normal`].
    #[inline]
    pub fn normal(&self) -> Vec3 {
        octahedral::decode(self.normal)
    }

    /// The mean normal; zero where there is none.
    #[inline]
    pub(super) fn normal_or_zero(&self) -> Vec3 {
        if self.has_normal() {
            self.normal()
        } else {
            Vec3::ZERO
        }
    }

    /// Half the thickness of what lies below, model units: no corner below (no disc of a point, as wide as its spacing) is
    /// farther along the normal from the sphere's center, up or down. Errs to too much, in steps of 1/254 of the splat
    /// radius, but for [`NodeAttributes::THICKNESS_TOLERANCE`]; at most the splat radius, which it is without a normal.
    #[inline]
    pub fn half_thickness(&self) -> f32 {
        if self.has_normal() {
            self.splat_radius * (f32::from(255 - self.color[3]) * (1.0 / 254.0))
        } else {
            self.splat_radius
        }
    }

    /// Takes the normal for none, and lights the color as `share` of facing.
    #[inline]
    pub(super) fn forget_normal(&mut self, share: f32) {
        let [r, g, b, _] = self.color;
        let [r, g, b] = [r, g, b].map(|c| (f32::from(c) * share + 0.5) as u8);
        self.color = [r, g, b, 0];
    }

    /// Stores a half thickness, where there is a normal.
    #[inline]
    pub(super) fn set_half_thickness(&mut self, half: f32) {
        if self.has_normal() {
            let share = half / self.splat_radius;
            // Not: nothing, or nothing of a splat without extent. Two millionths for the rounding on the way.
            let code = if share > 0.0 {
                ((share.min(1.0) - Self::THICKNESS_TOLERANCE + 2e-6) * 254.0).ceil() as u8
            } else {
                0
            };
            self.color[3] = 255 - code.min(254);
        }
    }
}

/// The bounding sphere of a triangle, or of a point with its spacing: 16 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Leaf {
    /// Center, model space.
    pub center: Vec3,
    /// Radius; contains the triangle's corners.
    pub radius: f32,
}
