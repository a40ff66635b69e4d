//! The CPU mirror of fuzzy splats: two passes and a division, and the two single-pass variants of the literature.
//!
//! Sources: Benda, *Point Based Rendering*, section 2.3.3; Rusinkiewicz and Levoy, *QSplat*, 2000, section 3.3. Each
//! pixel shows Σ c w / Σ w over the splats of the front surface. Coverage of triangles, snapping and the vertex shader
//! are those of [`crate::render::reference::render`]; footprints those of [`crate::render::reference::disc`].

mod normalize;

use crate::abi::{Splat, Vertex, WeightedSplat, constants};
use crate::image::Image;
use crate::math::camera::View;
use crate::math::octahedral;
use crate::pack::{ColorBy, Footprint, FuzzyList, Lighting, Style};
use crate::render::reference::disc::{Disc, Patch};
use crate::render::reference::round::{patch, radius_px};
use crate::render::reference::shade::{Kind, color_of, normal_of};
use crate::render::reference::square;
use crate::render::reference::square::Footprint as Square;
use crate::render::reference::triangle;
use crate::render::reference::triangle::Triangle;
use crate::render::reference::visibility::pushed;
use crate::render::reference::{CHUNK, Frame, Outputs, Placed, draw, gather};
use glam::{DVec3, Vec3};
use std::ops::Range;

/// Least |cosine| by which depth offsets are divided.
const LEAST_COSINE: f64 = 0.1;
/// Least cosine under which a patch is taken to be seen, where weights are areas.
const LEAST_FACING: f64 = 0.02;

/// Least weight in the middle, where weights are areas.
const LEAST_DEPOSIT: f64 = 1e-3;

/// How splats that overlap become one surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Passes {
    /// A pass for depth, one for the sums.
    Two,
    /// One pass: nearer than the pixel's depth by more than the offset replaces, within the offset adds, else nothing.
    /// The depth is that of the fragment that came first. Depends on the order of the list.
    DepthThreshold,
    /// One pass: each splat has a range of depth; one wholly before the pixel's range replaces, one that overlaps it
    /// adds and widens it. Depends on the order of the list; ranges chain.
    DepthRange,
}

/// What [`render_fuzzy`] draws: the picture, and the attachments it comes from, row by row from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct Fuzzy {
    /// The picture. [`Image::depth`], where asked for, holds the view-space distance of [`Fuzzy::front`] at pixels that
    /// show something. [`Image::normal`], where asked for, is the mean normal.
    pub image: Image,
    /// Reversed depth after the first pass: of the nearest pushed surface; 0 where nothing is. In one pass: the depth
    /// (of a range its nearest end) that fragments are compared with.
    pub front: Vec<f32>,
    /// Farthest end of the range of [`Passes::DepthRange`], reversed depth; else as `front`.
    pub back: Vec<f32>,
    /// Sums: red, green, blue times weight, and weight.
    pub sums: Vec<[f32; 4]>,
    /// Sums of normals (view space; with deferred shading turned to the viewer where both sides are lit) and of reversed
    /// depths, times weight. Empty unless shading is deferred or normals are asked for.
    pub normals: Vec<[f32; 4]>,
}

/// Draws `list` as `view` sees it.
///
/// **Depth.** A splat's footprint is that of [`Style::footprint`], with the depth of its center pushed away from the eye
/// along the ray by `m r / max(|n . v|, 0.1)`: m is [`Style::depth_offset`], r its radius in view space. Triangles are
/// pushed as in [`crate::render::reference::render_filtered`]. The nearest stays.
///
/// **Blend.** Both again, not pushed; a fragment that is not farther than that depth adds (color * w, w). A
/// triangle has w = 1, a splat w = 1 inside its footprint. With [`Style::is_gauss`] a splat has w = a exp(-2 rho²), cut
/// at rho = 1, over a footprint that is widened by [`Style::low_pass_px`]; where its area is known a is such that the
/// weights add up to the pixels that its patch covers, else 1.
///
/// **Normalize.** A pixel whose sum of weights is less than 1e-4 shows the background with alpha 0, any other the mean.
/// With [`FuzzyList::has_coverage`] alpha is the sum of weights, at most 1, where one of 8 neighbors has less than that.
///
/// Degenerate input draws nothing, as in [`crate::render::reference::render`].
pub fn render_fuzzy(
    view: &View,
    list: &FuzzyList,
    style: &Style,
    passes: Passes,
    outputs: Outputs,
) -> Fuzzy {
    let pixels = view.width as usize * view.height as usize;
    let mut front = vec![0.0; pixels];
    let mut back = vec![0.0; pixels];
    let mut sums = vec![[0.0; 4]; pixels];
    let sums_normals = style.is_deferred || outputs.normal;
    let mut normals = vec![[0.0; 4]; if sums_normals { pixels } else { 0 }];
    let frame = Frame::new(view, style);
    if pixels > 0 {
        let mut bands = bands(view, &mut front, &mut back, &mut sums, &mut normals);
        let two = passes == Passes::Two;
        if two {
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
            let mut depth_pass = |set_up: Vec<Vec<Ready>>| {
                draw(&mut bands, &set_up, |band, ready: &Ready| {
                    ready.for_each_pixel(band.rows(ready.rows()), |x, y, _| {
                        band.nearest(x, y, ready.pushed_depth);
                    });
                });
            };
            for chunk in list.splats.chunks(CHUNK) {
                depth_pass(gather(chunk, |splat, out| {
                    out.extend(ready(&frame, splat, None))
                }));
            }
            for chunk in list.points.chunks(CHUNK) {
                depth_pass(gather(chunk, |vertex, out| {
                    out.extend(ready(&frame, &vertex_splat(vertex), None));
                }));
            }
        }

        for chunk in list.triangles.chunks(CHUNK) {
            let set_up = gather(chunk, |corners, out| {
                triangle::set_up(&frame, list.vertices, *corners, out);
            });
            draw(&mut bands, &set_up, |band, t: &Triangle| {
                let rows = band.rows(&t.rows);
                t.for_each_pixel(rows, |x, y, depth, weights| {
                    let add = || {
                        let s = t.surface(weights);
                        share(&frame, Kind::Triangle, s.position, s.normal, s.color)
                    };
                    // A triangle has no extent in depth.
                    let range = [depth; 2];
                    band.blend(passes, x, y, depth, depth, range, 1.0, add);
                });
            });
        }
        let low_pass = Some(f64::from(style.low_pass_px));
        let mut blend_pass = |set_up: Vec<Vec<Ready>>| {
            draw(&mut bands, &set_up, |band, ready: &Ready| {
                ready.for_each_pixel(band.rows(ready.rows()), |x, y, kernel| {
                    band.blend(
                        passes,
                        x,
                        y,
                        ready.depth,
                        ready.pushed_depth,
                        ready.range,
                        (ready.weight * kernel) as f32,
                        || ready.share,
                    );
                });
            });
        };
        for chunk in list.splats.chunks(CHUNK) {
            blend_pass(gather(chunk, |splat, out| {
                out.extend(ready(&frame, splat, low_pass));
            }));
        }
        for chunk in list.points.chunks(CHUNK) {
            blend_pass(gather(chunk, |vertex, out| {
                out.extend(ready(&frame, &vertex_splat(vertex), low_pass));
            }));
        }
    }
    Fuzzy {
        image: normalize::image(&frame, list.has_coverage, outputs, &front, &sums, &normals),
        front,
        back,
        sums,
        normals,
    }
}

/// What a fragment adds per unit of weight: a color, and a normal in view space.
#[derive(Debug, Clone, Copy)]
struct Share {
    color: Vec3,
    normal: Vec3,
}

/// Shaded, or with deferred shading what is to be shaded: the base color, and the normal turned to the viewer where both
/// sides are lit, so that they do not cancel. In the light of a lamp only what is certainly seen from behind is turned.
fn share(frame: &Frame, kind: Kind, position: DVec3, normal: DVec3, color: DVec3) -> Share {
    let view = frame.view.view_from_model.as_dmat4();
    let in_view = view.transform_vector3(normal) / f64::from(frame.view.model_scale);
    if !frame.style.is_deferred {
        return Share {
            color: frame.shading.value(kind, position, normal, color).as_vec3(),
            normal: in_view.as_vec3(),
        };
    }
    let color = match (frame.style.color_by, kind) {
        (ColorBy::Primitive, Kind::Triangle) => DVec3::new(0.2, 0.35, 1.0),
        (ColorBy::Primitive, Kind::Splat) => DVec3::new(1.0, 0.2, 0.2),
        _ => color,
    };
    let to_eye = if frame.view.is_perspective {
        (-view.transform_point3(position)).normalize_or_zero()
    } else {
        DVec3::Z
    };
    let is_back = match frame.style.light {
        Lighting::Headlight => in_view.dot(to_eye) < 0.0,
        Lighting::Phong(_) => {
            let is_certain = in_view.dot(to_eye) < -f64::from(constants::LEAST_BACK);
            is_certain && !frame.style.cull_back_faces
        }
    };
    let is_turned = frame.style.two_sided && is_back;
    Share {
        color: color.as_vec3(),
        normal: if is_turned { -in_view } else { in_view }.as_vec3(),
    }
}

/// A vertex as a splat of the frame's constant size: what it stands for is unknown.
pub(super) fn vertex_splat(vertex: &Vertex) -> WeightedSplat {
    WeightedSplat {
        splat: Splat {
            center: vertex.position,
            radius: 0.0,
            normal: vertex.normal,
            color: vertex.color,
        },
        area: -1.0,
    }
}

/// A splat ready to be drawn.
pub(super) struct Ready {
    shape: Shape,
    depth: f32,
    pushed_depth: f32,
    /// Reversed depth of the nearest and the farthest point of its patch.
    range: [f32; 2],
    /// Weight in the middle.
    weight: f64,
    is_gauss: bool,
    share: Share,
}

enum Shape {
    Square(Square),
    Disc(Disc),
}

impl Ready {
    pub(super) fn rows(&self) -> &Range<u32> {
        match &self.shape {
            Shape::Square(square) => &square.rows,
            Shape::Disc(disc) => &disc.rows,
        }
    }

    /// Calls `visit(x, y, kernel)` for every pixel of `rows` in the footprint.
    pub(super) fn for_each_pixel(&self, rows: Range<u32>, mut visit: impl FnMut(u32, u32, f64)) {
        match &self.shape {
            Shape::Square(square) => {
                for y in rows {
                    for x in square.columns.clone() {
                        visit(x, y, 1.0);
                    }
                }
            }
            Shape::Disc(disc) => disc.for_each_pixel(rows, |x, y, squared| {
                let kernel = if self.is_gauss {
                    (-2.0 * squared).exp()
                } else {
                    1.0
                };
                visit(x, y, kernel);
            }),
        }
    }
}

/// `low_pass_px` is that of the blend pass; `None` for the first.
pub(super) fn ready(
    frame: &Frame,
    weighted: &WeightedSplat,
    low_pass_px: Option<f64>,
) -> Option<Ready> {
    let WeightedSplat { splat, area } = *weighted;
    let style = frame.style;
    let (patch, placed) = patch(frame, splat.center, splat.radius, splat.normal, splat.color)?;
    let radius_px = radius_px(frame, &patch, placed.distance);
    let shape = match style.footprint {
        Footprint::Square => Shape::Square(square::footprint(frame, splat.center, |_| {
            (2.0 * radius_px) as f32
        })?),
        Footprint::Circle => Shape::Disc(Disc::circle(frame, patch.center, radius_px)?),
        Footprint::Oriented => Shape::Disc(match low_pass_px {
            // A Gaussian hides what is behind its own footprint only: there its kernel is never 0.
            None if style.is_gauss => Disc::exact(frame, &patch)?,
            low_pass => Disc::new(frame, &patch, low_pass.unwrap_or(0.0))?,
        }),
    };
    let to_eye = if frame.view.is_perspective {
        (-patch.center.as_dvec3()).normalize_or_zero()
    } else {
        DVec3::Z
    };
    let facing = if patch.normal == DVec3::ZERO {
        1.0
    } else {
        patch.normal.dot(to_eye).abs()
    };
    let offset = f64::from(style.depth_offset) * patch.radius / facing.max(LEAST_COSINE);
    let depth_of = |in_view: Vec3| {
        frame
            .project(in_view)
            .map_or(0.0, |p| (p.clip.z / p.clip.w).clamp(0.0, 1.0))
    };
    // The extent of a disc along the view axis (methods 8.4).
    let half = (patch.radius * (1.0 - patch.normal.z * patch.normal.z).max(0.0).sqrt()) as f32;
    let moved = |by: f32| {
        let near = frame.view.near;
        let z = (placed.distance + by).max(near);
        depth_of(Vec3::new(patch.center.x, patch.center.y, -z))
    };
    let weight = if style.is_gauss && area >= 0.0 {
        let disc = match &shape {
            Shape::Disc(disc) => disc,
            Shape::Square(_) => return None,
        };
        (area_px(frame, &patch, f64::from(area), facing) / disc.gaussian_px()).max(LEAST_DEPOSIT)
    } else {
        1.0
    };
    let normal = normal_of(splat.normal, splat.color);
    Some(Ready {
        shape,
        depth: (placed.clip.z / placed.clip.w).clamp(0.0, 1.0),
        pushed_depth: depth_of(pushed(frame, patch.center, offset as f32)),
        range: [moved(-half), moved(half)],
        weight,
        is_gauss: style.is_gauss,
        share: share(
            frame,
            Kind::Splat,
            splat.center.as_dvec3(),
            normal,
            color_of(splat.color),
        ),
    })
}

/// The pixels that a patch of surface covers: f² A (n . v) |c| / z³, with the cosine of a patch of some thickness.
fn area_px(frame: &Frame, patch: &Patch, area: f64, facing: f64) -> f64 {
    let facing = facing.hypot(patch.thickness).clamp(LEAST_FACING, 1.0);
    let scale = f64::from(frame.view.focal_px()) * f64::from(frame.view.model_scale);
    if frame.view.is_perspective {
        let center = patch.center.as_dvec3();
        let z = -center.z;
        area * facing * (scale / z).powi(2) * center.length() / z
    } else {
        area * facing * scale * scale
    }
}

/// Consecutive rows of the attachments.
struct Band<'a> {
    width: usize,
    first_row: u32,
    end_row: u32,
    pub(crate) front: &'a mut [f32],
    back: &'a mut [f32],
    pub(crate) sums: &'a mut [[f32; 4]],
    normals: &'a mut [[f32; 4]],
}

/// Bands of whole rows, from the top; several a thread, since models are seldom spread evenly.
fn bands<'a>(
    view: &View,
    front: &'a mut [f32],
    back: &'a mut [f32],
    sums: &'a mut [[f32; 4]],
    mut normals: &'a mut [[f32; 4]],
) -> Vec<Band<'a>> {
    let width = view.width as usize;
    let rows = (view.height as usize)
        .div_ceil(4 * rayon::current_num_threads())
        .max(1);
    let size = rows * width;
    front
        .chunks_mut(size)
        .zip(back.chunks_mut(size))
        .zip(sums.chunks_mut(size))
        .enumerate()
        .map(|(i, ((front, back), sums))| {
            let (own, rest) = std::mem::take(&mut normals)
                .split_at_mut_checked(front.len())
                .unwrap_or_default();
            normals = rest;
            Band {
                width,
                first_row: (i * rows) as u32,
                end_row: (i * rows + front.len() / width) as u32,
                front,
                back,
                sums,
                normals: own,
            }
        })
        .collect()
}

impl Band<'_> {
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

    /// Adds a fragment, or replaces what is there, or does nothing, as the kind of passes has it.
    #[allow(clippy::too_many_arguments, reason = "what a fragment has, once")]
    fn blend(
        &mut self,
        passes: Passes,
        x: u32,
        y: u32,
        depth: f32,
        pushed: f32,
        [near, far]: [f32; 2],
        weight: f32,
        share: impl FnOnce() -> Share,
    ) {
        let i = self.index(x, y);
        let is_empty = self.front[i] == 0.0;
        let (adds, replaces) = match passes {
            Passes::Two => (depth >= self.front[i], false),
            // Reversed depth: nearer is greater. `pushed` is the fragment's own depth, farther by its offset.
            Passes::DepthThreshold => {
                let step = depth - pushed;
                let is_before = is_empty || depth > self.front[i] + step;
                (is_before || depth > self.front[i] - step, is_before)
            }
            Passes::DepthRange => {
                let is_before = is_empty || far > self.front[i];
                (is_before || near >= self.back[i], is_before)
            }
        };
        if !adds {
            return;
        }
        if replaces {
            self.sums[i] = [0.0; 4];
            if let Some(normal) = self.normals.get_mut(i) {
                *normal = [0.0; 4];
            }
        }
        match (passes, replaces) {
            (Passes::Two, _) | (Passes::DepthThreshold, false) => {}
            (Passes::DepthThreshold, true) => self.front[i] = depth,
            (Passes::DepthRange, true) => (self.front[i], self.back[i]) = (near, far),
            (Passes::DepthRange, false) => {
                self.front[i] = self.front[i].max(near);
                self.back[i] = self.back[i].min(far);
            }
        }
        let share = share();
        for (sum, term) in self.sums[i]
            .iter_mut()
            .zip((share.color * weight).extend(weight).to_array())
        {
            *sum += term;
        }
        if let Some(normal) = self.normals.get_mut(i) {
            for (sum, term) in normal
                .iter_mut()
                .zip((share.normal.extend(depth) * weight).to_array())
            {
                *sum += term;
            }
        }
    }
}

/// The vertex shader of the first pass. `None` when the result is not finite.
fn pushed_vertex(frame: &Frame, vertex: &Vertex) -> Option<Placed> {
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
    let radius = frame.style.depth_offset * frame.style.splat_size_px.max(1.0) * distance
        / (2.0 * view.focal_px());
    frame.project(pushed(
        frame,
        in_view,
        radius / cosine.max(LEAST_COSINE as f32),
    ))
}

#[cfg(test)]
mod tests;
