//! The depth offset of triangles in the first of two passes that blend: away from the eye along the viewing ray, by that of the
//! largest splat there (`shaders/common/pushed_triangle.glsl`).

use crate::abi::FrameConstants;
use crate::abi::constants::FLAG_ORTHOGRAPHIC;
use glam::Vec3;

/// Least |cosine| by which offsets are divided.
const LEAST_COSINE: f32 = 0.1;

/// Offsets of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CornerPush {
    /// Offset of what faces the eye, for each unit of its distance; without perspective the offset itself.
    slope: f32,
    is_parallel: bool,
}

impl CornerPush {
    /// Offsets of the splats of constant size.
    pub(super) fn of_frame(frame: &FrameConstants) -> Self {
        Self {
            slope: frame.depth_offset * 0.5 * frame.splat_size_px.max(1.0) / frame.focal_px,
            is_parallel: frame.flags & FLAG_ORTHOGRAPHIC != 0,
        }
    }

    /// Offset at a distance along the view direction, of a surface that faces the eye by a cosine.
    pub(super) fn offset(&self, distance: f32, facing: f32) -> f32 {
        let slope = match self.is_parallel {
            true => self.slope,
            false => self.slope * distance.max(0.0),
        };
        slope / facing.abs().max(LEAST_COSINE)
    }

    /// A position in view space, pushed; of a surface with this normal, zero where it has none.
    pub(super) fn pushed(&self, at: Vec3, normal: Vec3) -> Vec3 {
        let way = at.length();
        let to_eye = match self.is_parallel {
            true => Vec3::Z,
            false => -at / way,
        };
        let facing = match normal == Vec3::ZERO {
            true => 1.0,
            false => normal.dot(to_eye),
        };
        let by = self.offset(-at.z, facing);
        match self.is_parallel {
            true => at - by * Vec3::Z,
            false if way > 0.0 => at * ((way + by) / way),
            false => at,
        }
    }
}
