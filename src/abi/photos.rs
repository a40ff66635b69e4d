//! Records of photographs for shaders.

use super::{constants, generated};
use bytemuck::{Pod, Zeroable};

/// Uniform block of a frame for the passes that put photographs on the surface: `shaders/common/photo_header.glsl` explains
/// each field.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PhotoHeader {
    /// Start of the ray of position (0, 0), model space; 1 where all rays start there.
    pub start: [f32; 4],
    /// Direction of that ray.
    pub towards: [f32; 4],
    /// Change for a pixel to the right.
    pub right: [f32; 4],
    /// Change for a pixel down.
    pub down: [f32; 4],
    /// Direction that photographs are chosen for.
    pub direction: [f32; 4],
    /// Limit of the angle, tolerance of colors, border, and the column up to which a photograph is laid over the picture.
    pub limits: [f32; 4],
    /// Photographs, those blended, the one that is laid over, and groups side by side in the image of weights.
    pub counts: [u32; 4],
    /// Width and height of the picture.
    pub size: [u32; 4],
}

const GROUP: usize = constants::PHOTO_GROUP as usize;
const VECTORS: usize = constants::PHOTO_VECTORS as usize;
const MOST: usize = constants::MOST_FRAME_PHOTOS as usize;

/// Photographs that are weighed together: the uniform block of `shaders/look/photo_weights.frag`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PhotoGroup {
    /// Cameras.
    pub cameras: [[f32; 4]; VECTORS * GROUP],
    /// Places of their depth maps and texels in storage.
    pub places: [[u32; 4]; 2 * GROUP],
    /// Where the group lies in the image of weights, pixels, and how many photographs it has.
    pub spot: [u32; 4],
}

/// All photographs of a frame: the uniform block of `shaders/look/photos.frag`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PhotoTable {
    /// Cameras.
    pub cameras: [[f32; 4]; VECTORS * MOST],
    /// Places of their depth maps and texels in storage.
    pub places: [[u32; 4]; 2 * MOST],
}

same_layout!(
    PhotoHeader,
    photo_header,
    start = START,
    towards = TOWARDS,
    right = RIGHT,
    down = DOWN,
    direction = DIRECTION,
    limits = LIMITS,
    counts = COUNTS,
    size = SIZE,
);
same_layout!(
    PhotoGroup,
    photo_group,
    cameras = CAMERAS,
    places = PLACES,
    spot = SPOT,
);
same_layout!(PhotoTable, photo_table, cameras = CAMERAS, places = PLACES,);
