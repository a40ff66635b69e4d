//! Draw lists: the cut as plain arrays of the records in [`crate::abi`], the same bytes for device and mirror.

pub mod falsecolor;
pub mod filtered;
#[cfg(test)]
pub(crate) mod for_tests;
pub mod fuzzy;
pub mod ids;
mod light;
pub mod lit_sphere;
pub(crate) mod parallel;
pub mod polygons;
pub mod small_triangles;
pub mod splats;
pub mod triangles;

use crate::abi::{FilteredSplat, Splat, Vertex, WeightedSplat};
pub use crate::pack::light::{Lamp, LampSource, Phong, SurfaceLighting};
use crate::textures::{TextureImage, TexturePoint};
use std::sync::Arc;

/// What triangles of a list show in the place of the colors of their vertices.
#[derive(Debug, Clone, Copy)]
pub struct ListTextures<'a> {
    /// Where each of the list's vertices is in an image.
    pub points: &'a [TexturePoint],
    /// The images.
    pub images: &'a [Arc<TextureImage>],
}

/// Everything one frame draws. Triangles are drawn first, then splats, then points; all with the same depth
/// test (nearer wins, first drawn wins ties).
#[derive(Debug, Clone, Copy, Default)]
pub struct DrawList<'a> {
    /// The model's vertices.
    pub vertices: &'a [Vertex],
    /// Corner indices into `vertices`.
    pub triangles: &'a [[u32; 3]],
    /// Square splats, facing the viewer, of the center's depth.
    pub splats: &'a [Splat],
    /// Vertices drawn as points of [`PrimitiveStyle::splat_size_px`].
    pub points: &'a [Vertex],
    /// Textures of the triangles.
    pub textures: Option<ListTextures<'a>>,
}

/// Everything one frame with filtered splats draws, in three passes:
///
/// 1. `filtered.depth`: triangles and splats into depth only, splats pushed away from the eye by their offset.
/// 2. `filtered.blend`: both again, unpushed, tested against that depth (not farther passes) without writing it,
///    summed into (color * weight, weight). A splat spreads its area evenly over its rectangle: a pixel gets the part
///    that lies in it. A triangle has the weight 1.
/// 3. `filtered.normalize`: sum of color * weight over sum of weight; the weight itself is the covered fraction
///    where the surface ends (before nothing, or before a farther part), and 1 elsewhere.
#[derive(Debug, Clone, Copy, Default)]
pub struct FilteredList<'a> {
    /// The model's vertices.
    pub vertices: &'a [Vertex],
    /// Corner indices into `vertices`.
    pub triangles: &'a [[u32; 3]],
    /// Patches of surface, of the center's depth.
    pub splats: &'a [FilteredSplat],
    /// Textures of the triangles.
    pub textures: Option<ListTextures<'a>>,
}

/// Everything one frame with fuzzy splats draws: triangles, splats, then points, see
/// [`crate::render::reference::render_fuzzy`].
#[derive(Debug, Clone, Copy, Default)]
pub struct FuzzyList<'a> {
    /// The model's vertices.
    pub vertices: &'a [Vertex],
    /// Corner indices into `vertices`.
    pub triangles: &'a [[u32; 3]],
    /// Splats.
    pub splats: &'a [WeightedSplat],
    /// Vertices drawn as splats of [`PrimitiveStyle::splat_size_px`].
    pub points: &'a [Vertex],
    /// Sums of weights are coverage.
    pub has_coverage: bool,
    /// Textures of the triangles.
    pub textures: Option<ListTextures<'a>>,
}

/// How the primitives of a frame look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrimitiveStyle {
    /// Side of a square splat whose radius is 0, and of points; pixels, at least 1 when drawn. A splat of
    /// radius r > 0 has the side max(1, 2 f r / z) instead.
    pub splat_size_px: f32,
    /// What splats and points look like.
    pub footprint: Footprint,
    /// Fuzzy splats: weights fall off as a Gaussian of half the radius.
    pub is_gauss: bool,
    /// Fuzzy splats: standard deviation of the Gaussian that footprints are widened by, pixels.
    pub low_pass_px: f32,
    /// Fuzzy splats: light once a pixel.
    pub is_deferred: bool,
    /// What a pixel shows where nothing is drawn: red, green, blue, in 0..=1.
    pub background: [f32; 3],
    /// What decides the color.
    pub color_by: ColorBy,
    /// [`falsecolor::depth_range`] of [`ColorBy::Depth`].
    pub depth_range: [f32; 2],
    /// Draw no triangle that shows its back (clockwise on the screen).
    pub cull_back_faces: bool,
    /// How surfaces are lit; positions in model space.
    pub light: SurfaceLighting,
    /// Light both sides: |n . l| instead of max(0, n . l).
    pub two_sided: bool,
    /// Multiply the albedo by the vertex color.
    pub use_colors: bool,
    /// Factor of the depth offset of splats that are blended, see [`crate::render::Settings::depth_offset`].
    pub depth_offset: f32,
    /// Binary places of window positions after snapping, 4..=8: those of the device that the picture is compared with
    /// (`subPixelPrecisionBits`). 8 is what lavapipe and the common GPUs report.
    pub subpixel_bits: u32,
    /// Share of the light that white surfaces give back: [`ALBEDO`], but where a test of pictures needs wrong ones.
    pub albedo: f32,
}

impl Default for PrimitiveStyle {
    fn default() -> Self {
        Self {
            splat_size_px: 1.0,
            footprint: Footprint::Square,
            is_gauss: false,
            low_pass_px: 0.0,
            is_deferred: false,
            background: [0.0; 3],
            color_by: ColorBy::Shading,
            depth_range: [0.0, 1.0],
            cull_back_faces: false,
            light: SurfaceLighting::Headlight,
            two_sided: true,
            use_colors: true,
            depth_offset: 3.0,
            subpixel_bits: 8,
            albedo: ALBEDO,
        }
    }
}

/// What pixels a splat covers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Footprint {
    /// A square around the projected center.
    #[default]
    Square,
    /// A circle around the projected center.
    Circle,
    /// A disc in the plane of the surface, seen in perspective.
    Oriented,
}

/// Diffuse albedo of the default shading (conventions: value = 0.8 |n . l|).
pub const ALBEDO: f32 = 0.8;

/// What decides the color of a primitive.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum ColorBy {
    /// The light of the frame ([`SurfaceLighting`]) and the vertex colors.
    #[default]
    Shading,
    /// Splats and points red (value * (1, 0.2, 0.2)), triangles blue (value * (0.2, 0.35, 1)), where value is
    /// the shading without vertex colors.
    Primitive,
    /// What visibility splatting made of each pixel: foreground (the center of a splat, or a triangle) white; holes
    /// gray, red where no foreground was within reach; background as it is. No other splats have these classes.
    Classification,
    /// The level of a node in the tree, from the root (dark) to the leaves and triangles (bright), without light
    /// ([`falsecolor`]). Only what has a cut has levels.
    Level,
    /// The normal in model space, (n + 1) / 2, without light; gray where there is none.
    Normal,
    /// The distance along the view direction, from the near side of the model's bounding sphere (bright) to the far one
    /// (dark), without light. A splat has that of its center.
    Depth,
    /// How many splats and triangles cover each pixel before they hide one another, without light
    /// ([`crate::render::vulkan::overdraw`]).
    Overdraw,
}

impl ColorBy {
    /// Tells whether the color is data that no light changes.
    pub fn is_data(self) -> bool {
        matches!(
            self,
            Self::Level | Self::Normal | Self::Depth | Self::Overdraw
        )
    }
}
