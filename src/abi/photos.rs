//! What shaders know of photographs.

use super::{constants, generated};
use bytemuck::{Pod, Zeroable};

/// What the pass that puts photographs on the surface knows of them: the uniform block of `shaders/common/photo_record.glsl`,
/// where each field is explained.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PhotoConstants {
    /// Start of the ray of position (0, 0), model space; 1 where all rays start there.
    pub start: [f32; 4],
    /// Its direction.
    pub towards: [f32; 4],
    /// Change for a pixel to the right.
    pub right: [f32; 4],
    /// Change for a pixel down.
    pub down: [f32; 4],
    /// Direction that photographs are chosen for.
    pub direction: [f32; 4],
    /// Limit of the angle, tolerance of colors, border, and the column up to which a photograph is laid over the picture.
    pub limits: [f32; 4],
    /// Photographs, those blended, the one that is laid over, and whether some are of the second stage.
    pub counts: [u32; 4],
    /// Cameras.
    pub cameras: [[f32; 4]; PHOTO_CAMERA_VECTORS],
    /// Places of their depth maps and texels in storage.
    pub places: [[u32; 4]; PHOTO_PLACE_VECTORS],
}

const PHOTO_CAMERA_VECTORS: usize =
    (constants::PHOTO_VECTORS * constants::MOST_FRAME_PHOTOS) as usize;
const PHOTO_PLACE_VECTORS: usize = 2 * constants::MOST_FRAME_PHOTOS as usize;

same_layout!(
    PhotoConstants,
    photo_constants,
    start = START,
    towards = TOWARDS,
    right = RIGHT,
    down = DOWN,
    direction = DIRECTION,
    limits = LIMITS,
    counts = COUNTS,
    cameras = CAMERAS,
    places = PLACES,
);
