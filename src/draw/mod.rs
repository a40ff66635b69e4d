//! Draw lists: the cut as plain arrays of the records in [`crate::abi`], the same bytes for device and mirror.

pub mod filtered;
pub mod pack;

use crate::abi::{FilteredSplat, Splat, Vertex};

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
    /// Vertices drawn as points of [`Style::splat_size_px`].
    pub points: &'a [Vertex],
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
}

/// How the primitives of a frame look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Style {
    /// Side of a square splat whose radius is 0, and of points; pixels, at least 1 when drawn. A splat of
    /// radius r > 0 has the side max(1, 2 f r / z) instead.
    pub splat_size_px: f32,
    /// What a pixel shows where nothing is drawn: red, green, blue, in 0..=1.
    pub background: [f32; 3],
    /// What decides the color.
    pub color_by: ColorBy,
    /// Draw no triangle that shows its back (clockwise on the screen).
    pub cull_back_faces: bool,
    /// Light both sides: |n . l| instead of max(0, n . l).
    pub two_sided: bool,
    /// Multiply the albedo by the vertex color.
    pub use_colors: bool,
    /// Factor of the depth offset of filtered splats, see [`crate::method::Settings::depth_offset`].
    pub depth_offset: f32,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            splat_size_px: 1.0,
            background: [0.0; 3],
            color_by: ColorBy::Shading,
            cull_back_faces: false,
            two_sided: true,
            use_colors: true,
            depth_offset: 3.0,
        }
    }
}

/// Diffuse albedo of the default shading (conventions: value = 0.8 |n . l|).
pub const ALBEDO: f32 = 0.8;

/// What decides the color of a primitive.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum ColorBy {
    /// The headlight shading of the conventions.
    #[default]
    Shading,
    /// Splats and points red (value * (1, 0.2, 0.2)), triangles blue (value * (0.2, 0.35, 1)), where value is
    /// the headlight shading without vertex colors.
    Primitive,
}
