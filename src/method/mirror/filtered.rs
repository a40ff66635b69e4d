//! The CPU mirror of the three passes for filtered splats ([`FilteredList`]).
//!
//! Two passes and a normalization as in QSplat's and POP's fuzzy splats (Rusinkiewicz and Levoy, "QSplat", 2000,
//! section 3.3), with box kernels whose weights sum up to the projected area of the patch, so that the sum of the
//! weights in a pixel is the fraction of it that the surface covers. Coverage, snapping and the vertex shader
//! are those of [`super::render`].

use super::shade::Kind;
use super::square::{self, Footprint};
use super::triangle::{self, Triangle};
use super::{CHUNK, Frame, Outputs, Placed, draw, gather};
use crate::abi::{FilteredSplat, Vertex};
use crate::draw::{FilteredList, Style};
use crate::image::{Image, unorm8};
use crate::math::camera::View;
use crate::math::octahedral;
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// A pixel is covered when the sum of its weights is above this.
const LEAST_WEIGHT: f32 = 1e-6;

/// The least |cosine| between normal and view direction that a triangle's depth offset is divided by: offsets
/// grow to 10 times that of a surface that faces the eye, and no farther.
const LEAST_COSINE: f32 = 0.1;

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
/// **Depth.** A splat is the square of `s = max(1, splat_size_px)` pixels around its projected center, with the
/// constant depth of its center pushed away from the eye, along the ray, by [`FilteredSplat::offset`] (parallel
/// to the view direction in an orthographic view). The vertices of triangles are pushed likewise by
/// `m s d / (2 f)` over the cosine between normal and view ray (at least 0.1; 1 without a normal), where d is the
/// distance along the view direction (0 behind the eye) and f the focal length in pixels (orthographic: `m s / (2 f)`): by m times the radius
/// of a splat at that distance. The nearest depth stays. A splat that is pushed to the far plane or behind has
/// the depth 0 and hides nothing.
///
/// **Blend.** Both kinds again, not pushed; a fragment counts unless it is farther than the depth of the first
/// pass, so that surfaces are blended up to a distance of exactly the front surface's offset, that distance
/// included. A splat adds its color with the weight `area_px / s²` in every pixel it covers, a triangle its
/// shaded color with the weight 1, in single precision, triangles first, in the order of the list.
///
/// **Normalize.** With W the sum of weights, a pixel shows the background with alpha 0 unless W > 1e-6; else the
/// mean color. Its alpha is 1, except at the rim, where a neighbor in the picture (of 8) is not covered: min(W, 1).
/// The color is blended with the background by alpha. The alpha byte of a covered pixel is at least 1.
///
/// Splats are dropped from both passes when their center, not pushed, lies nearer than the near or farther than
/// the far plane. [`Style::color_by`], [`Style::two_sided`] and [`Style::use_colors`] decide the color of
/// triangles; splats bring theirs. Degenerate input draws nothing, as in [`super::render`]. Weights and colors
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
                let place = |vertex: &Vertex| pushed_vertex(&frame, vertex);
                triangle::set_up_placed(&frame, list.vertices, *corners, place, out);
            });
            draw(&mut bands, &set_up, |band, t: &Triangle| {
                let rows = band.rows(&t.rows);
                t.for_each_pixel(rows, |x, y, depth, _| band.nearest(x, y, depth));
            });
        }
        for chunk in list.splats.chunks(CHUNK) {
            let set_up = gather(chunk, |splat, out| out.extend(patch(&frame, splat)));
            draw(&mut bands, &set_up, |band, patch: &Patch| {
                patch.for_each_pixel(band.rows(&patch.footprint.rows), |x, y| {
                    band.nearest(x, y, patch.pushed_depth);
                });
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
                patch.for_each_pixel(band.rows(&patch.footprint.rows), |x, y| {
                    band.blend(x, y, patch.footprint.depth, || patch.deposit);
                });
            });
        }
    }
    Filtered {
        image: normalize(view, style, outputs, &front, &sums),
        front,
        sums,
    }
}

/// Side of every splat, pixels.
fn side_px(style: &Style) -> f32 {
    style.splat_size_px.max(1.0)
}

/// A view-space point, pushed away from the eye by a view-space length; a point in the eye itself stays.
pub(super) fn pushed(frame: &Frame, in_view: Vec3, by: f32) -> Vec3 {
    if !frame.view.is_perspective {
        return in_view - Vec3::new(0.0, 0.0, by);
    }
    let length = in_view.length();
    if length > 0.0 {
        // The factor is exactly 1 for an offset of 0: a splat is never behind itself.
        in_view * ((length + by) / length)
    } else {
        in_view
    }
}

/// The vertex shader of the first pass. `None` when the result is not finite.
pub(super) fn pushed_vertex(frame: &Frame, vertex: &Vertex) -> Option<Placed> {
    let view = frame.view;
    let in_view = view.view_from_model.transform_point3(vertex.position);
    let cosine = if vertex.color[3] == 0 {
        1.0
    } else {
        let normal = view
            .view_from_model
            .transform_vector3(octahedral::decode(vertex.normal))
            .normalize_or_zero();
        let to_eye = if view.is_perspective {
            (-in_view).normalize_or_zero()
        } else {
            Vec3::Z
        };
        normal.dot(to_eye).abs()
    };
    let distance = if view.is_perspective {
        // What lies behind the eye stays: large splats would pull it through the eye.
        (-in_view.z).max(0.0)
    } else {
        1.0
    };
    let radius =
        frame.style.depth_offset * side_px(frame.style) * distance / (2.0 * view.focal_px());
    frame.project(pushed(frame, in_view, radius / cosine.max(LEAST_COSINE)))
}

/// A splat ready to be drawn in both passes.
struct Patch {
    footprint: Footprint,
    /// Reversed depth in the first pass.
    pushed_depth: f32,
    /// What it adds to a pixel: red, green and blue times weight, and weight.
    deposit: [f32; 4],
}

fn patch(frame: &Frame, splat: &FilteredSplat) -> Option<Patch> {
    let side_px = side_px(frame.style);
    let footprint = square::footprint(frame, splat.center, |_| side_px)?;
    let in_view = frame.view.view_from_model.transform_point3(splat.center);
    let offset = splat.offset * frame.view.model_scale;
    // What cannot be pushed (an infinite offset) hides nothing; it is drawn still.
    let pushed_depth = frame
        .project(pushed(frame, in_view, offset))
        .map_or(0.0, |placed| {
            (placed.clip.z / placed.clip.w).clamp(0.0, 1.0)
        });
    let weight = splat.area_px / (side_px * side_px);
    let [r, g, b] = splat.color;
    Some(Patch {
        footprint,
        pushed_depth,
        deposit: [r * weight, g * weight, b * weight, weight],
    })
}

impl Patch {
    fn for_each_pixel(&self, rows: Range<u32>, mut visit: impl FnMut(u32, u32)) {
        for y in rows {
            for x in self.footprint.columns.clone() {
                visit(x, y);
            }
        }
    }
}

/// Consecutive rows of the attachments of the first two passes.
struct Band<'a> {
    width: usize,
    first_row: u32,
    end_row: u32,
    front: &'a mut [f32],
    sums: &'a mut [[f32; 4]],
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
    let is_rim = |x: usize, y: usize| {
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        let mut rows = y.saturating_sub(1)..(y + 2).min(height);
        // The pixel itself is covered, so it does not matter that it is among them.
        rows.any(|y| columns.clone().any(|x| !is_covered(y * width + x)))
    };
    let background = style.background.map(f64::from);
    let color_at = |i: usize| {
        if !is_covered(i) {
            let [r, g, b] = background.map(unorm8);
            return [r, g, b, 0];
        }
        let [r, g, b, weight] = sums[i].map(f64::from);
        let alpha = if is_rim(i % width, i / width) {
            weight.min(1.0)
        } else {
            1.0
        };
        let shown = |sum: f64, behind: f64| unorm8(sum / weight * alpha + behind * (1.0 - alpha));
        [
            shown(r, background[0]),
            shown(g, background[1]),
            shown(b, background[2]),
            unorm8(alpha).max(1),
        ]
    };
    let distance_at = |i: usize| {
        if is_covered(i) {
            view.distance_of_depth(front[i])
        } else {
            f32::INFINITY
        }
    };
    let pixels = sums.len();
    Image {
        width: view.width,
        height: view.height,
        color: (0..pixels).into_par_iter().map(color_at).collect(),
        depth: if outputs.depth {
            (0..pixels).into_par_iter().map(distance_at).collect()
        } else {
            Vec::new()
        },
        normal: vec![[0.0; 3]; if outputs.normal { pixels } else { 0 }],
    }
}

#[cfg(test)]
mod tests;
