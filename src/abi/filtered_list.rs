//! Constants of the pass that makes filtered splats of a draw list's numbers.

use super::generated;
use bytemuck::{Pod, Zeroable};

/// Eye of a frame, for filtered splats: the uniform block of `shaders/common/filtered_eye.glsl`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FilteredConstants {
    /// Rows of the matrix from model to view space.
    pub rows: [[f32; 4]; 3],
    /// Distance along the view direction, model units: factors of a position, and what is added.
    pub forward: [f32; 4],
    /// Eye in model space; of no meaning in an orthographic view.
    pub position: [f32; 3],
    /// Pixels of a model unit at distance 1 (perspective) or everywhere.
    pub focal_px: f32,
    /// Unit vector toward the viewer.
    pub backward: [f32; 3],
    /// Side of the square of a node, pixels.
    pub side_px: f32,
    /// Unit vector to the right in the picture.
    pub right: [f32; 3],
    /// Largest diameter, pixels.
    pub limit_px: f32,
    /// Unit vector up in the picture.
    pub up: [f32; 3],
    /// Factor of the depth offset.
    pub offset_px: f32,
    /// Lamp: a position (last component 1), or the unit vector towards it (0).
    pub lamp: [f32; 4],
    /// Factors of x and y in clip space, and shifts.
    pub scale_shift: [f32; 4],
    /// Half the picture, pixels, and factor and summand of the third component in clip space.
    pub half_depth: [f32; 4],
    /// Length in view space of a unit vector in model space.
    pub model_scale: f32,
    /// 2 f, pixels of a tangent (perspective) or of a unit of view space.
    pub twice_focal_px: f32,
}

same_layout!(
    FilteredConstants,
    filtered_constants,
    rows = ROWS,
    forward = FORWARD,
    position = POSITION,
    focal_px = FOCAL_PX,
    backward = BACKWARD,
    side_px = SIDE_PX,
    right = RIGHT,
    limit_px = LIMIT_PX,
    up = UP,
    offset_px = OFFSET_PX,
    lamp = LAMP,
    scale_shift = SCALE_SHIFT,
    half_depth = HALF_DEPTH,
    model_scale = MODEL_SCALE,
    twice_focal_px = TWICE_FOCAL_PX,
);
