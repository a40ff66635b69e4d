//! The CPU mirror of the three passes for filtered splats ([`FilteredList`]).
//!
//! Two passes and a normalization as in QSplat's and POP's fuzzy splats (Rusinkiewicz and Levoy, "QSplat", 2000,
//! section 3.3), with box kernels whose weights sum up to the projected area of the patch, so that the sum of the
//! weights in a pixel is the fraction of it that the surface covers. Coverage, snapping and the vertex shader
//! are those of [`crate::render::reference::render`].

use crate::abi::FilteredSplat;
use crate::abi::constants::{
    FILTERED_AROUND_PX, FILTERED_JUMP, FILTERED_REACH_PX, LEAST_FILTERED_COVERAGE,
};
use crate::image::Image;
use crate::math::camera::View;
use crate::pack::{FilteredList, Style};
use crate::render::reference::shade::Kind;
use crate::render::reference::target::{LEAST_ALPHA, in_formats};
use crate::render::reference::triangle;
use crate::render::reference::triangle::Triangle;
use crate::render::reference::{
    CHUNK, Frame, Outputs, SUBPIXELS, draw, gather, pixels_between, snap,
};
use rayon::prelude::*;
use std::ops::{Range, RangeInclusive};

/// A pixel is covered when the sum of its weights is above this.
const LEAST_WEIGHT: f32 = 1e-6;

/// A window position farther out reaches into no picture; sums with sides stay far inside an integer.
const LIMIT_PX: f32 = 1e9;

/// What [`render_filtered`] draws: the picture, and the attachments it comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct Filtered {
    /// The picture after the third pass.
    ///
    /// [`Image::depth`], where asked for, holds the view-space distance of [`Filtered::front`] at covered pixels:
    /// farther than the nearest surface by its depth offset, and infinite where that lies on or behind the far
    /// plane. [`Image::normal`] is zero everywhere: a mean over patches has no normal.
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
/// both ([`FILTERED_REACH_PX`]); where nothing lies there the nearest all around (by the larger of the distances along x and y, at
/// most [`FILTERED_AROUND_PX`]). Of its part are those whose depths differ by no more than parts do, see below. A neighbor in the
/// picture (of 8) without depth is empty; one whose depth is farther than the pixel's
/// by more than 3 pixels' (or [`Style::splat_size_px`], if that is more) width there is another part. Beside either, and
/// where the pixel has no depth, the pixel is covered by min(W, 1) only; behind it lies the mean of what these neighbors
/// show: a part its mean color over the background, with the coverage 1, but min(2 W, 1) where it has an empty neighbor
/// itself. Elsewhere the pixel is covered whole. Alpha is what is not background; the alpha byte of a pixel that shows
/// anything is at least 1. A rim pixel with W < 0.002 and no part behind it shows the background.
///
/// Splats that lie before the near or behind the far plane are not in a list. [`Style::color_by`], [`Style::two_sided`] and [`Style::use_colors`] decide the color of
/// triangles; splats bring theirs. Degenerate input draws nothing, as in [`crate::render::reference::render`]. Weights and colors
/// that are not finite are no error either; they spoil the pixels they fall on.
///
/// Cost: linear in primitives plus covered pixels, twice, on all threads of the rayon pool; the picture does not
/// depend on their number.
pub fn render_filtered(
    view: &View,
    list: &FilteredList,
    style: &Style,
    outputs: Outputs,
) -> Filtered {
    let pixels = view.width as usize * view.height as usize;
    let mut front = vec![0.0; pixels];
    let mut sums = vec![[0.0; 4]; pixels];
    if pixels > 0 {
        let frame = Frame::new(view, style);
        let mut bands = bands(view, &mut front, &mut sums);

        for chunk in list.triangles.chunks(CHUNK) {
            let set_up = gather(chunk, |corners, out| {
                triangle::set_up(&frame, list.vertices, *corners, out);
            });
            draw(&mut bands, &set_up, |band, t: &Triangle| {
                let rows = band.rows(&t.rows);
                t.for_each_pixel(rows, |x, y, depth, _| band.nearest(x, y, depth));
            });
        }
        for chunk in list.splats.chunks(CHUNK) {
            let set_up = gather(chunk, |splat, out| out.extend(patch(&frame, splat)));
            draw(&mut bands, &set_up, |band, patch: &Patch| {
                let [columns, rows] = &patch.hidden;
                for y in band.rows(rows) {
                    for x in columns.clone() {
                        band.nearest(x, y, patch.pushed_depth);
                    }
                }
            });
        }

        for chunk in list.triangles.chunks(CHUNK) {
            let set_up = gather(chunk, |corners, out| {
                triangle::set_up(&frame, list.vertices, *corners, out);
            });
            draw(&mut bands, &set_up, |band, t: &Triangle| {
                let rows = band.rows(&t.rows);
                t.for_each_pixel(rows, |x, y, depth, weights| {
                    band.blend(x, y, depth, || {
                        let surface = t.surface(weights);
                        let color = frame.shading.value(
                            Kind::Triangle,
                            surface.position,
                            surface.normal,
                            surface.color,
                        );
                        color.as_vec3().extend(1.0).to_array()
                    });
                });
            });
        }
        for chunk in list.splats.chunks(CHUNK) {
            let set_up = gather(chunk, |splat, out| out.extend(patch(&frame, splat)));
            draw(&mut bands, &set_up, |band, patch: &Patch| {
                for y in band.rows(&patch.rows) {
                    for x in patch.columns.clone() {
                        band.blend(x, y, patch.depth, || patch.deposit(x, y));
                    }
                }
            });
        }
    }
    Filtered {
        image: normalize(view, style, outputs, &front, &sums),
        front,
        sums,
    }
}

/// A splat ready to be drawn in both passes.
pub(super) struct Patch {
    /// Columns and rows of the square of the first pass, and its reversed depth.
    hidden: [Range<u32>; 2],
    pushed_depth: f32,
    /// Reversed depth of the center.
    depth: f32,
    /// Pixels that the rectangle overlaps.
    pub(super) columns: Range<u32>,
    pub(super) rows: Range<u32>,
    /// Center and extents of the rectangle, pixels.
    center: [f64; 2],
    extent: [f64; 2],
    color: [f32; 3],
    /// Weight of a pixel that lies in the rectangle.
    density: f32,
}

pub(super) fn patch(frame: &Frame, splat: &FilteredSplat) -> Option<Patch> {
    let ([width, height], side) = (splat.extent_px, splat.side_px);
    // The shader takes nothing less, and what is no number draws nothing.
    let is_placed = splat.window_px.iter().all(|c| c.abs() < LIMIT_PX);
    if !(width > 0.0 && height > 0.0 && side.is_finite() && is_placed) {
        return None;
    }
    // A square that covers no pixel of the picture may still spread into it: as on the device, whose guard band keeps
    // it, the rectangle is looked at for itself.
    let snapped = splat.window_px.map(|c| snap(f64::from(c)));
    // To the same fraction of a pixel as the square.
    let center = snapped.map(|c| c as f64 / SUBPIXELS as f64);
    let extent = [f64::from(width), f64::from(height)];
    let side = snap(f64::from(side).max(1.0));
    let size = [frame.view.width, frame.view.height];
    let hidden = |axis: usize| {
        let low = snapped[axis] - side / 2;
        pixels_between(low, low + side, size[axis])
    };
    let pixels = |axis: usize| {
        let half = extent[axis] / 2.0;
        let (low, high) = (center[axis] - half, center[axis] + half);
        let clamp = |edge: f64| edge.clamp(0.0, f64::from(size[axis])) as u32;
        clamp(low.floor())..clamp(high.ceil())
    };
    Some(Patch {
        hidden: [hidden(0), hidden(1)],
        pushed_depth: splat.pushed_depth,
        depth: splat.depth,
        columns: pixels(0),
        rows: pixels(1),
        center,
        extent,
        color: splat.color,
        density: splat.area_px / (width * height),
    })
}

impl Patch {
    /// The area in which a pixel overlaps the rectangle.
    pub(super) fn overlap(&self, x: u32, y: u32) -> f64 {
        let overlap = |axis: usize, pixel: u32, extent: f64| {
            let distance = (f64::from(pixel) + 0.5 - self.center[axis]).abs();
            (0.5 * (extent + 1.0) - distance).clamp(0.0, extent.min(1.0))
        };
        overlap(0, x, self.extent[0]) * overlap(1, y, self.extent[1])
    }

    /// What it adds to a pixel.
    fn deposit(&self, x: u32, y: u32) -> [f32; 4] {
        let weight = self.density * self.overlap(x, y) as f32;
        let [r, g, b] = self.color;
        [r * weight, g * weight, b * weight, weight]
    }
}

/// Consecutive rows of the attachments of the first two passes.
struct Band<'a> {
    width: usize,
    first_row: u32,
    end_row: u32,
    pub(crate) front: &'a mut [f32],
    pub(crate) sums: &'a mut [[f32; 4]],
}

/// Bands of whole rows, from the top; several a thread, since models are seldom spread evenly.
fn bands<'a>(view: &View, front: &'a mut [f32], sums: &'a mut [[f32; 4]]) -> Vec<Band<'a>> {
    let width = view.width as usize;
    let rows = (view.height as usize)
        .div_ceil(4 * rayon::current_num_threads())
        .max(1);
    front
        .chunks_mut(rows * width)
        .zip(sums.chunks_mut(rows * width))
        .enumerate()
        .map(|(i, (front, sums))| Band {
            width,
            first_row: (i * rows) as u32,
            end_row: (i * rows + front.len() / width) as u32,
            front,
            sums,
        })
        .collect()
}

impl Band<'_> {
    /// The part of a range of rows that lies in this band.
    fn rows(&self, rows: &Range<u32>) -> Range<u32> {
        rows.start.max(self.first_row)..rows.end.min(self.end_row)
    }

    fn index(&self, x: u32, y: u32) -> usize {
        (y - self.first_row) as usize * self.width + x as usize
    }

    /// The depth test of the first pass: nearer wins; a depth of 0 or NaN never does.
    fn nearest(&mut self, x: u32, y: u32, depth: f32) {
        let i = self.index(x, y);
        if depth > self.front[i] {
            self.front[i] = depth;
        }
    }

    /// The depth test of the second pass, not farther passes, and the sum.
    fn blend(&mut self, x: u32, y: u32, depth: f32, deposit: impl FnOnce() -> [f32; 4]) {
        let i = self.index(x, y);
        if depth >= self.front[i] {
            for (sum, term) in self.sums[i].iter_mut().zip(deposit()) {
                *sum += term;
            }
        }
    }
}

/// The third pass.
fn normalize(
    view: &View,
    style: &Style,
    outputs: Outputs,
    front: &[f32],
    sums: &[[f32; 4]],
) -> Image {
    let (width, height) = (view.width as usize, view.height as usize);
    let is_covered = |i: usize| sums[i][3] > LEAST_WEIGHT;
    let mean = |i: usize| {
        let [r, g, b, weight] = sums[i].map(f64::from);
        [r / weight, g / weight, b / weight]
    };
    let is_empty = |i: usize| front[i] <= 0.0 || front[i].is_nan();
    // The pixel and its neighbors in the picture.
    let near = |i: usize| {
        let (x, y) = (i % width, i / width);
        (y.saturating_sub(1)..(y + 2).min(height)).flat_map(move |y| {
            (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x)
        })
    };
    let background = style.background.map(f64::from);
    let pixel_at_1 =
        f64::from(FILTERED_JUMP * style.splat_size_px.max(1.0)) / f64::from(view.focal_px());
    // Distances of what belongs to the part of a pixel.
    let part_of = |i: usize| {
        let distance = f64::from(view.distance_of_depth(front[i]));
        let jump = pixel_at_1 * if view.is_perspective { distance } else { 1.0 };
        distance - jump..=distance + jump
    };
    let nothing = || {
        let [r, g, b] = background;
        [r, g, b, 0.0]
    };
    // The mean color of pixels near by of a part.
    let mean_at =
        |i: usize, part: &RangeInclusive<f64>, steps: &mut dyn Iterator<Item = [i32; 2]>| {
            let (x, y) = ((i % width) as i32, (i / width) as i32);
            let mut sum = [0.0; 4];
            for [dx, dy] in steps {
                let (x, y) = (x + dx, y + dy);
                if x < 0 || y < 0 || x >= width as i32 || y >= height as i32 {
                    continue;
                }
                let j = y as usize * width + x as usize;
                if !is_empty(j) && part.contains(&f64::from(view.distance_of_depth(front[j]))) {
                    sum = [0, 1, 2, 3].map(|c| sum[c] + f64::from(sums[j][c]));
                }
            }
            let [r, g, b, weight] = sum;
            (weight > f64::from(LEAST_WEIGHT)).then(|| [r / weight, g / weight, b / weight])
        };
    let near_in = |i: usize, part: &RangeInclusive<f64>| {
        let square = |reach: i32| {
            let row = move |dy: i32| (-reach..=reach).map(move |dx| [dx, dy]);
            (-reach..=reach).flat_map(row)
        };
        let is_far = |[dx, dy]: &[i32; 2]| dx.abs().max(dy.abs());
        let reaches = std::iter::successors(Some((1, 1)), |&(reach, before)| {
            Some((reach + before, reach))
        });
        let mut along = reaches
            .map(|(reach, _)| reach)
            .take_while(|&reach| reach <= FILTERED_REACH_PX as i32)
            .map(|reach| {
                let steps = square(1).filter(|step| is_far(step) == 1);
                mean_at(i, part, &mut steps.map(|step| step.map(|d| reach * d)))
            });
        let mut around = (2..=FILTERED_AROUND_PX as i32).map(|reach| {
            mean_at(
                i,
                part,
                &mut square(reach).filter(|step| is_far(step) == reach),
            )
        });
        along
            .find_map(|found| found)
            .or_else(|| around.find_map(|found| found))
    };
    let color_at = |i: usize| {
        let has_front = front[i] > 0.0;
        if !is_covered(i) && !has_front {
            return nothing();
        }
        let part = if has_front {
            part_of(i)
        } else {
            0.0..=f64::INFINITY
        };
        let (mut around, mut filled, mut behind) = (0.0, 0.0, [0.0; 3]);
        for j in near(i) {
            // The pixel itself: not farther, and empty only where that is said already.
            if j == i {
            } else if is_empty(j) {
                around += 1.0;
            } else if f64::from(view.distance_of_depth(front[j])) > *part.end() {
                around += 1.0;
                if is_covered(j) {
                    // Whole, but where the part behind ends too.
                    let share = if near(j).any(is_empty) {
                        (2.0 * f64::from(sums[j][3])).min(1.0)
                    } else {
                        1.0
                    };
                    let color = mean(j);
                    filled += share;
                    behind = [0, 1, 2].map(|c| behind[c] + share * color[c]);
                }
            }
        }
        let is_rim = around > 0.0 || !has_front;
        // Not even where the sum is no number.
        let is_something = sums[i][3] >= LEAST_FILTERED_COVERAGE;
        if is_rim && !is_something && filled == 0.0 {
            return nothing();
        }
        // Between rectangles a rim has nothing of its own, else there is what is around.
        let own = match (is_covered(i), is_rim) {
            (true, _) => mean(i),
            (false, true) => [0.0; 3],
            (false, false) => match near_in(i, &part) {
                Some(color) => color,
                None => return nothing(),
            },
        };
        let covered = match (is_rim, is_covered(i)) {
            (true, true) => f64::from(sums[i][3]).min(1.0),
            (true, false) => 0.0,
            (false, _) => 1.0,
        };
        let around = f64::max(around, 1.0);
        let filled = filled / around;
        let beyond = [0, 1, 2].map(|c| behind[c] / around + (1.0 - filled) * background[c]);
        let alpha = covered + (1.0 - covered) * filled;
        let [r, g, b] = [0, 1, 2].map(|c| own[c] * covered + beyond[c] * (1.0 - covered));
        [r, g, b, alpha.max(LEAST_ALPHA)]
    };
    let pixels = sums.len();
    let (color, values) = in_formats(pixels, outputs, color_at);
    let distance_at = |i: usize| {
        if color[i][3] > 0 {
            view.distance_of_depth(front[i])
        } else {
            f32::INFINITY
        }
    };
    let depth = if outputs.depth {
        (0..pixels).into_par_iter().map(distance_at).collect()
    } else {
        Vec::new()
    };
    Image {
        width: view.width,
        height: view.height,
        color,
        depth,
        normal: vec![[0.0; 3]; if outputs.normal { pixels } else { 0 }],
        values,
    }
}

#[cfg(test)]
mod tests;
