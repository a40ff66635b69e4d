//! The CPU mirror: draws a [`DrawList`](crate::pack::DrawList) as the device does, written to be believed.
//!
//! It shares nothing with the shaders but [`crate::abi`] and [`crate::math`], and it is the device of a
//! machine that has no Vulkan. What follows the rasterization chapter of the Vulkan specification:
//!
//! * a vertex goes through the matrices in single precision, as in the vertex shader, and everything after
//!   that is double precision or integer;
//! * window positions are snapped to a grid of [`PrimitiveStyle::subpixel_bits`](crate::pack::PrimitiveStyle::subpixel_bits) binary places,
//!   coverage is decided in integers at the pixel centers, and the top-left rule gives every pixel on a shared edge to
//!   exactly one triangle;
//! * the depth test compares single-precision reversed depth (1 at the near, 0 at the far plane, "greater"
//!   passes, cleared to 0), so that what ties on the device ties here. Surfaces exactly on the far plane have
//!   depth 0 and lose against the cleared buffer, as on the device.
//!
//! What may differ from a device: the last bit of a vertex position (fused multiply-adds), hence a snapped
//! position by one step of the grid, hence single pixels on edges; and one grey level from single-precision
//! shading.
//!
//! Every technique is a sequence of passes over one loop: what is drawn is set up (`triangle`, `splat` with its
//! footprints `square` and `disc`), each pixel that it covers is visited in the order of the list (`bands`), and
//! what a fragment makes of a pixel stands with the technique: `opaque`, `fuzzy`, `filtered`, `visibility` and
//! `overdraw`.

pub(in crate::render) mod ambient_occlusion;
mod bands;
mod clip;
mod darken;
mod disc;
pub(in crate::render) mod eye_dome;
mod filtered;
mod frame;
mod fuzzy;
mod opaque;
mod overdraw;
mod polygons;
pub(in crate::render) mod renderer;
mod rims;
mod shade;
mod splat;
mod square;
mod triangle;
mod visibility;

pub use crate::render::reference::filtered::{FilteredRendering, render_filtered};
pub use crate::render::reference::fuzzy::{
    BlendPasses, FuzzyRendering, render_fuzzy, render_fuzzy_polygons,
};
pub use crate::render::reference::opaque::{render, render_with_polygons};
pub use crate::render::reference::overdraw::{OverdrawList, count_overdraw, show_overdraw};
pub use crate::render::reference::polygons::PolygonList;
pub use crate::render::reference::visibility::{
    HoleFilling, PixelClass, VisibilityPixel, VisibilityRendering, render_visibility,
    render_visibility_polygons,
};
