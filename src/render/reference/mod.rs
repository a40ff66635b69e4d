//! The CPU mirror: draws a [`DrawList`] as the device does, written to be believed.
//!
//! It shares nothing with the shaders but [`crate::abi`] and [`crate::math`], and it is the device of a
//! machine that has no Vulkan. What follows the rasterization chapter of the Vulkan specification:
//!
//! * a vertex goes through the matrices in single precision, as in the vertex shader, and everything after
//!   that is double precision or integer;
//! * window positions are snapped to [`SUBPIXEL_BITS`] binary places, coverage is decided in integers at the
//!   pixel centers, and the top-left rule gives every pixel on a shared edge to exactly one triangle;
//! * the depth test compares single-precision reversed depth (1 at the near, 0 at the far plane, "greater"
//!   passes, cleared to 0), so that what ties on the device ties here. Surfaces exactly on the far plane have
//!   depth 0 and lose against the cleared buffer, as on the device.
//!
//! What may differ from a device: the last bit of a vertex position (fused multiply-adds), hence a snapped
//! position by one step of 1/256 pixel, hence single pixels on edges; and one grey level from single-precision
//! shading.

mod clip;
mod disc;
mod filtered;
mod fuzzy;
mod overdraw;
mod round;
mod shade;
mod square;
mod target;
mod triangle;
mod visibility;

pub use crate::render::reference::filtered::{Filtered, render_filtered};
pub use crate::render::reference::fuzzy::{Fuzzy, Passes, render_fuzzy};
pub use crate::render::reference::overdraw::{Drawn, count_overdraw, show_overdraw};
pub use crate::render::reference::visibility::{
    Class, Filling, Pixel, Visibility, render_visibility,
};

use crate::image::Image;
use crate::math::camera::View;
use crate::pack::{DrawList, Footprint, Style};
use crate::render::reference::shade::Shading;
use crate::render::reference::target::Target;
use glam::{Mat4, Vec3, Vec4};
use rayon::prelude::*;

/// Binary places of a window position after snapping: positions are multiples of 1/256 pixel. Vulkan asks for
/// at least 4 (`subPixelPrecisionBits`); 8 is what lavapipe and the common GPUs report.
pub const SUBPIXEL_BITS: u32 = 8;

/// Steps of a snapped position in one pixel.
const SUBPIXELS: i64 = 1 << SUBPIXEL_BITS;

/// Primitives that are set up before any is rasterized: bounds the memory of the set-up, and is large enough
/// that starting the workers costs nothing.
const CHUNK: usize = 1 << 16;

/// What a picture holds besides color.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Outputs {
    /// Fill [`Image::depth`]: view-space distance at each pixel center (of a splat or point: of its center).
    pub depth: bool,
    /// Fill [`Image::normal`]: the world-space unit normal that was shaded; zero where the surface has none.
    pub normal: bool,
    /// Fill [`Image::values`]: the colors before they are rounded to eight bits. On a device the color target is one of
    /// 32-bit floats then. Visibility splats have none: they are put together from pixels of eight bits.
    pub values: bool,
}

/// Draws `list` as `view` sees it: triangles, then splats, then points, with one depth test (nearer wins,
/// first drawn wins ties).
///
/// A covered pixel has alpha 255; the others show the background with alpha 0. Degenerate input draws
/// nothing and is no error: positions that are not finite, triangles without area once snapped, splats whose
/// radius is NaN, and triangles with an index past the vertices. Splats and points are dropped when their
/// center is nearer than the near or farther than the far plane, but not when it lies beside the picture.
///
/// The light of [`Light::Point`](crate::math::camera::Light::Point) needs an eye; an orthographic view is lit
/// along the view direction instead.
///
/// Cost: linear in primitives plus covered pixels, on all threads of the rayon pool; the picture does not
/// depend on their number.
pub fn render(view: &View, list: &DrawList, style: &Style, outputs: Outputs) -> Image {
    let mut target = Target::new(view, style, outputs);
    if view.width > 0 && view.height > 0 {
        let frame = Frame::new(view, style);
        let mut bands = target.bands();
        for chunk in list.triangles.chunks(CHUNK) {
            let set_up = gather(chunk, |corners, out| {
                triangle::set_up(&frame, list.vertices, *corners, out)
            });
            draw(&mut bands, &set_up, |band, t| {
                triangle::rasterize(&frame, t, band)
            });
        }
        let is_square = style.footprint == Footprint::Square;
        for chunk in list.splats.chunks(CHUNK) {
            if is_square {
                let set_up = gather(chunk, |splat, out| {
                    out.extend(square::of_splat(&frame, splat))
                });
                draw(&mut bands, &set_up, |band, s| square::rasterize(s, band));
            } else {
                let set_up = gather(chunk, |splat, out| {
                    out.extend(round::of_splat(&frame, splat))
                });
                draw(&mut bands, &set_up, |band, s| round::rasterize(s, band));
            }
        }
        for chunk in list.points.chunks(CHUNK) {
            if is_square {
                let set_up = gather(chunk, |point, out| {
                    out.extend(square::of_point(&frame, point))
                });
                draw(&mut bands, &set_up, |band, s| square::rasterize(s, band));
            } else {
                let set_up = gather(chunk, |point, out| {
                    out.extend(round::of_point(&frame, point))
                });
                draw(&mut bands, &set_up, |band, s| round::rasterize(s, band));
            }
        }
    }
    target.into_image()
}

/// Sets up primitives in parallel, in order.
fn gather<T: Sync, S: Send>(chunk: &[T], set_up: impl Fn(&T, &mut Vec<S>) + Sync) -> Vec<Vec<S>> {
    chunk
        .par_chunks(1024)
        .map(|part| {
            let mut out = Vec::new();
            for primitive in part {
                set_up(primitive, &mut out);
            }
            out
        })
        .collect()
}

/// Every band of rows draws all primitives in their order, so no pixel depends on the timing of threads.
fn draw<B: Send, S: Sync>(
    bands: &mut [B],
    set_up: &[Vec<S>],
    rasterize: impl Fn(&mut B, &S) + Sync,
) {
    bands.par_iter_mut().for_each(|band| {
        for primitive in set_up.iter().flatten() {
            rasterize(band, primitive);
        }
    });
}

/// The constants of a frame.
struct Frame<'a> {
    view: &'a View,
    style: &'a Style,
    clip_from_view: Mat4,
    shading: Shading,
    /// Pixels per tangent or view-space unit, times the scale of the view matrix: a splat of radius r has the
    /// side 2 r times this, over the distance in a perspective.
    pixels_per_unit: f32,
    /// The view mirrors: what is counter-clockwise in the world is clockwise in the picture.
    is_mirrored: bool,
}

/// A vertex after the vertex shader.
#[derive(Clone, Copy)]
struct Placed {
    /// Clip space of the device: y down, reversed depth.
    clip: Vec4,
    /// Distance along the view direction.
    distance: f32,
}

impl<'a> Frame<'a> {
    fn new(view: &'a View, style: &'a Style) -> Self {
        let [sx, sy] = view.scale;
        Self {
            view,
            style,
            clip_from_view: view.clip_from_view(),
            shading: Shading::new(view, style),
            pixels_per_unit: view.focal_px() * view.model_scale,
            is_mirrored: view.view_from_model.determinant() * sx * sy < 0.0,
        }
    }

    /// The vertex shader: single precision, matrix by matrix. `None` when the result is not finite.
    fn place(&self, position: Vec3) -> Option<Placed> {
        self.project(self.view.view_from_model.transform_point3(position))
    }

    /// The second half of the vertex shader. `None` when the result is not finite.
    fn project(&self, in_view: Vec3) -> Option<Placed> {
        let clip = self.clip_from_view * in_view.extend(1.0);
        clip.is_finite().then_some(Placed {
            clip,
            distance: -in_view.z,
        })
    }

    /// The viewport transform: pixels, x right, y down, pixel centers at halves.
    fn window(&self, x_ndc: f64, y_ndc: f64) -> [f64; 2] {
        [
            (x_ndc + 1.0) / 2.0 * f64::from(self.view.width),
            (y_ndc + 1.0) / 2.0 * f64::from(self.view.height),
        ]
    }
}

/// Snaps a window coordinate; the cast saturates far outside of every picture.
fn snap(coordinate_px: f64) -> i64 {
    (coordinate_px * SUBPIXELS as f64).round() as i64
}

/// The pixels whose centers lie in `low..high` (snapped units), within `0..size`.
fn pixels_between(low: i64, high: i64, size: u32) -> std::ops::Range<u32> {
    // Center of pixel i: i * SUBPIXELS + SUBPIXELS / 2 >= low  <=>  i >= ceil((low - SUBPIXELS / 2) / SUBPIXELS).
    let first_at = |edge: i64| (edge - SUBPIXELS / 2 + SUBPIXELS - 1).div_euclid(SUBPIXELS);
    let clamp = |i: i64| i.clamp(0, i64::from(size)) as u32;
    clamp(first_at(low))..clamp(first_at(high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_those_whose_centers_lie_in_the_half_open_range() {
        for low in -700..700 {
            for width in [0, 1, 128, 255, 256, 257, 600] {
                let expected: Vec<u32> = (0..3)
                    .filter(|&i| (low..low + width).contains(&(i64::from(i) * 256 + 128)))
                    .collect();
                let got: Vec<u32> = pixels_between(low, low + width, 3).collect();
                assert_eq!(got, expected, "{low} {width}");
            }
        }
    }
}
