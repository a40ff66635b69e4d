//! The reference of the three passes for filtered splats ([`FilteredList`]).
//!
//! Two passes and a normalization as in QSplat's and POP's fuzzy splats (Rusinkiewicz and Levoy, "QSplat", 2000,
//! section 3.3), with box kernels whose weights sum up to the projected area of the patch, so that the sum of the
//! weights in a pixel is the fraction of it that the surface covers. Coverage, snapping and the vertex shader
//! are those of [`crate::render::reference::render`].

mod normalize;

use crate::abi::FilteredSplat;
use crate::image::Image;
use crate::math::camera::View;
use crate::pack::{FilteredList, PrimitiveStyle};
use crate::render::PictureOutputs;
use crate::render::reference::bands::{PixelCoverage, PixelRows};
use crate::render::reference::frame::ReferenceFrame;
use crate::render::reference::splat::{RasterSplat, SplatFootprint};
use crate::render::reference::square::SquareFootprint;
use crate::render::reference::triangle;
use glam::{Vec3, Vec4};
use std::ops::Range;

/// A window position farther out reaches into no picture; sums with sides stay far inside an integer.
const LIMIT_PX: f32 = 1e9;

/// What [`render_filtered`] draws: the picture, and the attachments it comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct FilteredRendering {
    /// The picture after the third pass.
    ///
    /// [`Image::depth`], where asked for, holds the view-space distance of the nearest square or triangle at covered pixels,
    /// where it lies: not pushed as [`FilteredRendering::front`] is. It is infinite where that is on or behind the far plane, or
    /// no square reaches. [`Image::normal`] is zero everywhere: a mean over patches has no normal.
    pub image: Image,
    /// Reversed depth (1 at the near, 0 at the far plane) of the nearest pushed surface at each pixel after the
    /// first pass, row by row from the top left; 0 where nothing is.
    pub front: Vec<f32>,
    /// Sums at each pixel after the second pass: red, green and blue times weight, and weight.
    pub sums: Vec<[f32; 4]>,
}

/// Draws `list` as `view` sees it, in the three passes of [`FilteredList`].
///
/// **Depth.** A splat is a square of its own side (at least 1 pixel) around its place in the picture, with the constant
/// depth [`FilteredSplat::pushed_depth`]. Triangles are where they are. The nearest depth stays; 0 hides nothing.
///
/// **Blend.** Both kinds again, not pushed; a fragment counts unless it is farther than the depth of the first
/// pass, so that surfaces are blended up to a distance of exactly the front splat's offset, that distance
/// included. A splat adds its color with the weight `area_px / (w h) · o` in every pixel, w and h the extents of its
/// rectangle around the projected center, o the area in which the pixel overlaps the rectangle; a triangle its shaded
/// color with the weight 1; in single precision, triangles first, in the order of the list.
///
/// **Normalize.** With W the sum of weights, a pixel shows the mean color where W > 1e-6. Else it shows the background with
/// alpha 0, unless it has a depth: it lies between rectangles, which are not as dense as squares. Then it shows the mean of
/// what pixels near by of its part deposited: the nearest in eight directions, at 1, 2, 3, 5, 8, 13 and 21 pixels along x, y or
/// both ([`FILTERED_REACH_PX`](crate::abi::constants::FILTERED_REACH_PX)); where nothing lies there the nearest all around (by the larger of the distances along x and y, at
/// most [`FILTERED_AROUND_PX`](crate::abi::constants::FILTERED_AROUND_PX)). Of its part are those whose depths differ by no more than parts do, see below. A neighbor in the
/// picture (of 8) without depth is empty; one whose depth is farther than the pixel's
/// by more than 3 pixels' (or [`PrimitiveStyle::splat_size_px`], if that is more) width there is another part. Beside either, and
/// where the pixel has no depth, the pixel is covered by min(W, 1) only; behind it lies the mean of what these neighbors
/// show: a part its mean color over the background, with the coverage 1, but min(2 W, 1) where it has an empty neighbor
/// itself. Elsewhere the pixel is covered whole. Alpha is what is not background; the alpha byte of a pixel that shows
/// anything is at least 1. A rim pixel with W < 0.002 and no part behind it shows the background.
///
/// Splats that lie before the near or behind the far plane are not in a list. [`PrimitiveStyle::color_by`], [`PrimitiveStyle::two_sided`] and [`PrimitiveStyle::use_colors`] decide the color of
/// triangles; splats bring theirs. Degenerate input draws nothing, as in [`crate::render::reference::render`]. Weights and colors
/// that are not finite are no error either; they spoil the pixels they fall on.
///
/// Cost: linear in primitives plus covered pixels, twice, on all threads of the rayon pool; the picture does not
/// depend on their number.
pub fn render_filtered(
    view: &View,
    list: &FilteredList,
    style: &PrimitiveStyle,
    outputs: PictureOutputs,
) -> FilteredRendering {
    let frame = ReferenceFrame::new(view, style);
    let place = |corners: &[u32; 3]| {
        triangle::set_up(&frame, (list.vertices, list.textures), *corners, |v| {
            frame.place(v.position)
        })
    };
    let mut target = PixelRows::cleared(view, FilteredPixel::default());

    // Depth.
    target.draw(list.triangles, place, |pixel, _, sample| {
        pixel.keep_nearest(sample.depth, sample.depth);
    });
    target.draw(
        list.splats,
        |splat| set_up_pushed(&frame, splat),
        |pixel, splat, _| {
            let [pushed, own] = splat.fragment;
            pixel.keep_nearest(pushed, own);
        },
    );

    // Blend.
    target.draw(list.triangles, place, |pixel, triangle, sample| {
        pixel.blend(sample.depth, || {
            let color = frame.shading.value(&triangle.surface(sample));
            color.as_vec3().extend(1.0)
        });
    });
    target.draw(
        list.splats,
        |splat| set_up_blended(&frame, splat),
        |pixel, rectangle, overlap| pixel.blend(rectangle.depth, || rectangle.deposit(overlap)),
    );

    let pixels = target.into_pixels();
    FilteredRendering {
        image: normalize::image(view, style, outputs, &pixels),
        front: pixels.iter().map(|pixel| pixel.front).collect(),
        sums: pixels.iter().map(|pixel| pixel.sum.to_array()).collect(),
    }
}

/// A pixel of the attachments of the first two passes.
#[derive(Clone, Copy, Default)]
struct FilteredPixel {
    /// Reversed depth of the nearest pushed surface; 0 where nothing is.
    front: f32,
    /// Reversed depth of the nearest surface where it lies.
    surface: f32,
    /// Color times weight, and weight.
    sum: Vec4,
}

impl FilteredPixel {
    /// The depth test of the first pass: nearer wins; a depth of 0 or NaN never does. `own` is not pushed.
    fn keep_nearest(&mut self, pushed: f32, own: f32) {
        if pushed > self.front {
            self.front = pushed;
        }
        if own > self.surface {
            self.surface = own;
        }
    }

    /// The depth test of the second pass, not farther passes, and the sum.
    fn blend(&mut self, depth: f32, deposit: impl FnOnce() -> Vec4) {
        if depth >= self.front {
            self.sum += deposit();
        }
    }
}

/// The center of a splat in steps of the frame's grid. `None` where it is no place, or a size is no size: the shader
/// takes nothing less, and what is no number draws nothing.
fn center_of(frame: &ReferenceFrame, splat: &FilteredSplat) -> Option<[i64; 2]> {
    let ([width, height], side) = (splat.extent_px, splat.side_px);
    let is_placed = splat.window_px.iter().all(|c| c.abs() < LIMIT_PX);
    (width > 0.0 && height > 0.0 && side.is_finite() && is_placed)
        .then(|| splat.window_px.map(|c| frame.grid.snap(f64::from(c))))
}

/// A splat in the first pass: a square with a pushed depth, and its own.
fn set_up_pushed(frame: &ReferenceFrame, splat: &FilteredSplat) -> Option<RasterSplat<[f32; 2]>> {
    let center = center_of(frame, splat)?;
    let side = frame.grid.snap(f64::from(splat.side_px).max(1.0));
    let square = SquareFootprint::of_steps(frame, center, side);
    Some(RasterSplat {
        footprint: SplatFootprint::Square(square),
        fragment: [splat.pushed_depth, splat.depth],
    })
}

/// A splat in the second pass: a rectangle that spreads its area. One whose square covers no pixel of the picture may still
/// reach into it.
pub(super) struct DepositRectangle {
    /// Pixels that the rectangle overlaps.
    columns: Range<u32>,
    rows: Range<u32>,
    /// Center and extents, pixels.
    center: [f64; 2],
    extent: [f64; 2],
    /// Reversed depth of the center.
    depth: f32,
    color: Vec3,
    /// Weight of a pixel that lies in the rectangle.
    density: f32,
}

/// A splat in the second pass; `None` when it is no place or size.
pub(super) fn set_up_blended(
    frame: &ReferenceFrame,
    splat: &FilteredSplat,
) -> Option<DepositRectangle> {
    // To the same fraction of a pixel as the square.
    let center = center_of(frame, splat)?.map(|c| c as f64 / frame.grid.steps as f64);
    let [width, height] = splat.extent_px;
    let extent = [f64::from(width), f64::from(height)];
    let size = [frame.view.width, frame.view.height];
    let pixels = |axis: usize| {
        let half = extent[axis] / 2.0;
        let (low, high) = (center[axis] - half, center[axis] + half);
        let clamp = |edge: f64| edge.clamp(0.0, f64::from(size[axis])) as u32;
        clamp(low.floor())..clamp(high.ceil())
    };
    Some(DepositRectangle {
        columns: pixels(0),
        rows: pixels(1),
        center,
        extent,
        depth: splat.depth,
        color: Vec3::from(splat.color),
        density: splat.area_px / (width * height),
    })
}

impl DepositRectangle {
    /// What it adds to a pixel that overlaps it by an area.
    fn deposit(&self, overlap: f64) -> Vec4 {
        let weight = self.density * overlap as f32;
        (self.color * weight).extend(weight)
    }
}

impl PixelCoverage for DepositRectangle {
    /// The area in which the pixel overlaps the rectangle; it may be 0.
    type Sample = f64;

    fn rows(&self) -> Range<u32> {
        self.rows.clone()
    }

    fn columns(&self, _y: u32) -> Range<u32> {
        self.columns.clone()
    }

    fn sample(&self, x: u32, y: u32) -> Option<f64> {
        let overlap = |axis: usize, pixel: u32| {
            let extent = self.extent[axis];
            let distance = (f64::from(pixel) + 0.5 - self.center[axis]).abs();
            (0.5 * (extent + 1.0) - distance).clamp(0.0, extent.min(1.0))
        };
        Some(overlap(0, x) * overlap(1, y))
    }
}

#[cfg(test)]
mod tests;
