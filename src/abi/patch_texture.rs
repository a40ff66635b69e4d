//! Places of patches of a cut in images.

use bytemuck::{Pod, Zeroable};

/// Place of a patch in an image, 32 bytes: at the point `u axis + v (normal x axis)` of its plane the texture coordinate is
/// `at + u along_u + v along_v`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PatchTexture {
    /// Texture coordinate at u = v = 0; (0, 0) is the upper left corner of the image, (1, 1) the lower right one.
    pub at: [f32; 2],
    /// Change of the coordinate along u, 1 / model units.
    pub along_u: [f32; 2],
    /// Change of the coordinate along v, 1 / model units.
    pub along_v: [f32; 2],
    /// Number of the image among those of the model, or [`NO_IMAGE`](crate::textures::NO_IMAGE): then the polygon has colors.
    pub image: u32,
    /// Largest distance in the plane from where a point of the surface is to where the patch shows it, model units. Infinite
    /// where no patch may stand for what is below.
    pub slip: f32,
}
