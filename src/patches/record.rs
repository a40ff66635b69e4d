//! The record of a node as one oriented polygon: plane, footprint, errors, shading.
//!
//! The plane lies in the middle of the thickness. Every corner below the node has its foot in the footprint and lies at most
//! the thickness from the plane; so does every point of a triangle between, since both are convex. What a view makes of these
//! bounds stands in [`crate::patches::cut`] and [`crate::patches::draw`].

use crate::tree::PackedPatch;
use glam::{Vec2, Vec3};

/// Most corners of a footprint.
pub const MOST_CORNERS: usize = 8;

/// Levels of descendants that residuals are kept of, and the corners (level 0).
pub const RESIDUAL_LEVELS: usize = 5;

/// A node as one oriented polygon, in full precision: 172 bytes. Lengths are model units, directions in model space unless said
/// otherwise. In-plane coordinates (u, v) start at `origin`, along `axis` and `normal x axis`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodePatch {
    /// Middle of the footprint's rectangle, in the plane in the middle of the thickness.
    pub origin: Vec3,
    /// Unit normal of the plane: the direction of the vector area.
    pub normal: Vec3,
    /// Unit vector in the plane along the first side of the rectangle.
    pub axis: Vec3,
    /// Half sides of the rectangle along u and v.
    pub half_extents: Vec2,
    /// What is cut off each corner of the rectangle, as a share of both half sides, 0 to 1; in the order (+,+), (-,+), (-,-), (+,-).
    pub corner_cuts: [f32; 4],
    /// Largest distance of a corner from the plane. Errs to too much.
    pub thickness: f32,
    /// Largest distance of a sample of the footprint from the whole surface, where that exceeds the thickness; else at most the
    /// thickness. Infinite where it was not looked for: no view draws the node as a patch of more than a pixel.
    pub overhang: f32,
    /// Mean shading normal in the middle of the footprint, in the frame (u, v, normal), not unit.
    pub mean_normal: Vec3,
    /// Change of the shading normal's (u, v) in the plane: uu, uv, vv, per model unit. Symmetric: the shape operator.
    pub shape: [f32; 3],
    /// Mean of the fitted unit normal times the corners' normals: 1 where smooth, less where roughness is averaged.
    pub sigma: f32,
    /// Root mean squares of differences from the fit: of corners, then of the mean normals of descendants 1 to 4 levels below.
    pub residuals: [f32; RESIDUAL_LEVELS],
    /// Largest difference of a corner's normal from the fit.
    pub largest_residual: f32,
    /// Largest angle of a face normal below and `normal`, radians. Errs to too much.
    pub half_angle: f32,
    /// Mean color in the middle of the footprint, value / 255.
    pub color: Vec3,
    /// Change of the color along u and v, per model unit.
    pub color_gradient: [Vec3; 2],
    /// Root mean square of differences of corners' colors from the fit, value / 255, the largest of the channels.
    pub color_residual: f32,
    /// [`NodePatch::NEVER`], [`NodePatch::OPEN_EDGE`], [`NodePatch::SHARP_EDGE`].
    pub flags: u8,
}

/// Records of the nodes of a tree, in its order. Empty for a cloud and for a tree without nodes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NodePatches {
    /// A record a node.
    pub records: Vec<NodePatch>,
}

impl Default for NodePatch {
    /// A node that never is a patch.
    fn default() -> Self {
        Self {
            origin: Vec3::ZERO,
            normal: Vec3::Z,
            axis: Vec3::X,
            half_extents: Vec2::ZERO,
            corner_cuts: [0.0; 4],
            thickness: f32::INFINITY,
            overhang: f32::INFINITY,
            mean_normal: Vec3::Z,
            shape: [0.0; 3],
            sigma: 1.0,
            residuals: [2.0; RESIDUAL_LEVELS],
            largest_residual: 2.0,
            half_angle: std::f32::consts::PI,
            color: Vec3::ONE,
            color_gradient: [Vec3::ZERO; 2],
            color_residual: 0.0,
            flags: Self::NEVER,
        }
    }
}

impl NodePatch {
    /// Bit of `flags`: no view draws this node as a patch; its other values mean nothing.
    pub const NEVER: u8 = PackedPatch::NEVER;
    /// Bit of `flags`: an edge of a triangle below has no second triangle, or more than two.
    pub const OPEN_EDGE: u8 = 2;
    /// Bit of `flags`: an edge of a triangle below is sharper than 30 degrees.
    pub const SHARP_EDGE: u8 = 4;

    /// Half angles from here on are refused: more may hide a second sheet or a fold.
    pub const WIDEST: f32 = 60.0 * (std::f32::consts::PI / 180.0);

    /// Tells whether a view may draw this node as a patch.
    #[inline]
    pub fn may_be_drawn(&self) -> bool {
        self.flags & Self::NEVER == 0
    }

    /// Tells whether all lengths and directions are finite, but for the overhang; what is never drawn is.
    pub(super) fn is_finite(&self) -> bool {
        let [du, dv] = self.color_gradient;
        !self.may_be_drawn()
            || [self.origin, self.mean_normal, self.color, du, dv]
                .iter()
                .all(|v| v.is_finite())
                && Vec3::from_array(self.shape).is_finite()
                && self.half_extents.is_finite()
                && self.thickness.is_finite()
    }

    /// Tells whether an edge below ends the surface or bends it sharply, so that it makes a silhouette.
    #[inline]
    pub fn has_rim(&self) -> bool {
        self.flags & (Self::OPEN_EDGE | Self::SHARP_EDGE) != 0
    }

    /// Unit vector in the plane across `axis`.
    #[inline]
    pub fn second_axis(&self) -> Vec3 {
        self.normal.cross(self.axis)
    }

    /// Largest distance of a point of the surface below from `origin`.
    #[inline]
    pub fn reach(&self) -> f32 {
        (self.half_extents.length_squared() + self.thickness * self.thickness).sqrt()
    }

    /// Corners of the footprint in (u, v), counter-clockwise, and how many there are: 4 to 8.
    pub fn corners(&self) -> ([Vec2; MOST_CORNERS], usize) {
        footprint_corners(self.half_extents, self.corner_cuts)
    }

    /// Point of the plane, model space.
    #[inline]
    pub fn point(&self, at: Vec2) -> Vec3 {
        self.origin + self.axis * at.x + self.second_axis() * at.y
    }

    /// Nearest point of the rectangle, (u, v).
    #[inline]
    pub fn clamped(&self, at: Vec2) -> Vec2 {
        at.clamp(-self.half_extents, self.half_extents)
    }

    /// Fitted shading normal at a point of the plane, in the frame (u, v, normal), not unit.
    #[inline]
    pub fn fitted_normal(&self, at: Vec2) -> Vec3 {
        let [uu, uv, vv] = self.shape;
        self.mean_normal + Vec3::new(uu * at.x + uv * at.y, uv * at.x + vv * at.y, 0.0)
    }

    /// The same as a unit vector in model space; the plane's normal where the fit vanishes.
    #[inline]
    pub fn shading_normal(&self, at: Vec2) -> Vec3 {
        let Vec3 { x, y, z } = self.fitted_normal(at);
        (self.axis * x + self.second_axis() * y + self.normal * z).normalize_or(self.normal)
    }

    /// Color at a point of the plane, value / 255.
    #[inline]
    pub fn color_at(&self, at: Vec2) -> Vec3 {
        let [along_u, along_v] = self.color_gradient;
        (self.color + along_u * at.x + along_v * at.y).clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// Largest curvature of the fitted shading normals: the spectral norm of the shape operator, per model unit.
    #[inline]
    pub fn curvature(&self) -> f32 {
        let [uu, uv, vv] = self.shape;
        let mean = 0.5 * (uu + vv);
        mean.abs() + (0.25 * (uu - vv) * (uu - vv) + uv * uv).sqrt()
    }
}

/// Corners of a rectangle whose corners are cut, counter-clockwise, and their number.
pub(super) fn footprint_corners(half: Vec2, cuts: [f32; 4]) -> ([Vec2; MOST_CORNERS], usize) {
    let mut corners = [Vec2::ZERO; MOST_CORNERS];
    let mut count = 0;
    let signs = [
        Vec2::ONE,
        Vec2::new(-1.0, 1.0),
        Vec2::NEG_ONE,
        Vec2::new(1.0, -1.0),
    ];
    for (index, (sign, cut)) in signs.into_iter().zip(cuts).enumerate() {
        let corner = half * sign;
        let mut push = |at: Vec2| {
            corners[count] = at;
            count += 1;
        };
        if cut <= 0.0 {
            push(corner);
            continue;
        }
        // Counter-clockwise the first and third corner come from the side along v, the others from that along u.
        let on_v = Vec2::new(corner.x, corner.y * (1.0 - cut));
        let on_u = Vec2::new(corner.x * (1.0 - cut), corner.y);
        let [first, second] = if index % 2 == 0 {
            [on_v, on_u]
        } else {
            [on_u, on_v]
        };
        push(first);
        push(second);
    }
    (corners, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[Vec2]) -> f32 {
        let next = corners.iter().cycle().skip(1);
        0.5 * corners
            .iter()
            .zip(next)
            .map(|(a, b)| a.perp_dot(*b))
            .sum::<f32>()
    }

    #[test]
    fn cut_corners_are_convex_and_counter_clockwise() {
        for (cuts, expected) in [
            ([0.0; 4], 24.0),
            ([1.0; 4], 12.0),
            ([0.5, 0.0, 0.0, 0.0], 24.0 - 0.25 * 3.0),
            (
                [0.25, 1.0, 0.75, 0.5],
                24.0 - 3.0 * (0.0625 + 1.0 + 0.5625 + 0.25),
            ),
        ] {
            let (corners, count) = footprint_corners(Vec2::new(3.0, 2.0), cuts);
            let corners = &corners[..count];
            assert!((area(corners) - expected).abs() < 1e-5, "{cuts:?}");
            for i in 0..count {
                let [a, b, c] = [0, 1, 2].map(|k| corners[(i + k) % count]);
                assert!((b - a).perp_dot(c - b) >= 0.0, "{cuts:?} at {i}");
            }
        }
    }

    #[test]
    fn curvature_is_the_largest_eigenvalue() {
        let patch = NodePatch {
            shape: [3.0, 0.0, -5.0],
            ..NodePatch::default()
        };
        assert!((patch.curvature() - 5.0).abs() < 1e-6);
        let patch = NodePatch {
            shape: [1.0, 2.0, 1.0],
            ..NodePatch::default()
        };
        assert!((patch.curvature() - 3.0).abs() < 1e-6);
    }
}
