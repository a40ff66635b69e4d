//! The CPU mirror of visibility splatting (Benda, section 3.3.4): footprints into depth, centers into pixels, and a
//! reconstruction of what lies between ([`reconstruct`]).
//!
//! Coverage, snapping and the vertex shader are those of [`crate::render::reference::render`].

mod reconstruct;

use crate::abi::Vertex;
use crate::image::{Image, unorm8};
use crate::math::camera::View;
use crate::pack::{ColorBy, DrawList, Style};
use crate::render::Reconstruction;
use crate::render::reference::disc::Disc;
use crate::render::reference::round::patch;
use crate::render::reference::shade::{Kind, color_of, normal_of};
use crate::render::reference::square;
use crate::render::reference::triangle;
use crate::render::reference::triangle::Triangle;
use crate::render::reference::{CHUNK, Frame, Outputs, Placed, draw, gather};
use glam::{DVec3, Vec3};
use std::ops::Range;

/// The least |cosine| between normal and view direction that a depth offset is divided by: offsets grow to 10 times
/// that of a surface that faces the eye, and no farther.
const LEAST_COSINE: f32 = 0.1;

/// Depth of what lies on the far plane; what is pushed past it is between this and the cleared 0, in its order.
const BEFORE_FAR: f32 = 1e-30;

/// The depth that is tested, of one that may lie past the far plane.
fn before_far(depth: f32) -> f32 {
    if depth <= 0.0 {
        BEFORE_FAR / (1.0 - depth)
    } else {
        depth.min(1.0)
    }
}

/// What a pixel is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Class {
    /// Nothing is there.
    #[default]
    Background,
    /// A footprint covers it, and no center is seen in it.
    Hole,
    /// The center of a splat, or a triangle.
    Foreground,
}

/// A pixel after the first two passes, and of the pyramid.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pixel {
    /// What it is.
    pub class: Class,
    /// Shaded color: of the nearest center or triangle, in a hole of the footprint that made it.
    pub color: [u8; 3],
    /// Distance along the view direction, without the depth offset, and that offset; view-space units.
    pub front: [f32; 2],
}

/// How holes are filled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filling {
    /// By which method.
    pub reconstruction: Reconstruction,
    /// No splat is larger than this, pixels: bounds the reach of [`Reconstruction::PullPush`]; infinite for any.
    pub largest_px: f32,
}

/// What [`render_visibility`] draws: the picture, and what it comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct Visibility {
    /// The picture after the reconstruction. [`Image::depth`] holds the distance in [`Pixel::front`],
    /// [`Image::normal`] the normal of what gave [`Pixel::color`].
    pub image: Image,
    /// Each pixel after the first two passes, row by row from the top left.
    pub pixels: Vec<Pixel>,
    /// Holes that no foreground of their surface was within reach of; they show [`Pixel::color`].
    pub unreached: u64,
}

/// Draws `list` as `view` sees it.
///
/// **Depth.** The footprint of every splat and point as a disc in the plane of the surface, at least a pixel, with the
/// depth of its center pushed away from the eye along the ray (orthographic: parallel to the view direction) by m r
/// over the cosine between normal and view ray (at least 0.1; 1 without a normal): r is its radius, at least that of
/// half a pixel, and m [`Style::depth_offset`]. The corners of triangles are pushed likewise, by the r of
/// [`Style::splat_size_px`]. Nearer wins, the first drawn wins ties. Covered pixels are holes.
///
/// **Centers.** The pixel that contains the center of each splat, and triangles, in their place: foreground where
/// they are not farther than what the pixel holds; the last drawn wins ties.
///
/// **Reconstruction.** See [`Reconstruction`]. Two pixels belong to one surface when their distances differ by at most
/// twice the smaller of their offsets; no color goes to a pixel of another surface.
///
/// Splats and points are dropped when their center lies nearer than the near or farther than the far plane. Degenerate
/// input draws nothing, as in [`crate::render::reference::render`].
///
/// Cost: linear in primitives plus covered pixels, twice, plus the reconstruction; on all threads of the rayon pool.
/// The picture does not depend on their number.
pub fn render_visibility(
    view: &View,
    list: &DrawList,
    style: &Style,
    filling: Filling,
    outputs: Outputs,
) -> Visibility {
    let count = view.width as usize * view.height as usize;
    let mut pixels = vec![Pixel::default(); count];
    let mut normals = vec![[0.0; 3]; if outputs.normal { count } else { 0 }];
    if count > 0 {
        let mut depth = vec![0.0; count];
        let frame = Frame::new(view, style);
        let mut bands = bands(view, &mut depth, &mut pixels, &mut normals);
        for pass in [Pass::Depth, Pass::Centers] {
            draw_pass(&frame, list, pass, &mut bands);
        }
    }
    let filled = reconstruct::fill(
        (view.width as usize, view.height as usize),
        &pixels,
        filling,
        size_px(style),
    );
    let unreached = (pixels.iter().zip(&filled))
        .filter(|(pixel, filled)| pixel.class == Class::Hole && filled.is_none())
        .count() as u64;
    let [r, g, b] = style.background.map(|c| unorm8(f64::from(c)));
    let color = |(pixel, filled): (&Pixel, &Option<[u8; 3]>)| {
        let shown = match (pixel.class, style.color_by) {
            (Class::Background, _) => return [r, g, b, 0],
            (Class::Foreground, ColorBy::Classification) => [255; 3],
            (Class::Hole, ColorBy::Classification) if filled.is_some() => [128; 3],
            (Class::Hole, ColorBy::Classification) => [255, 0, 0],
            (Class::Hole, _) => filled.unwrap_or(pixel.color),
            (Class::Foreground, _) => pixel.color,
        };
        [shown[0], shown[1], shown[2], 255]
    };
    Visibility {
        image: Image {
            width: view.width,
            height: view.height,
            color: pixels.iter().zip(&filled).map(color).collect(),
            depth: if outputs.depth {
                (pixels.iter())
                    .map(|pixel| match pixel.class {
                        Class::Background => f32::INFINITY,
                        _ => pixel.front[0],
                    })
                    .collect()
            } else {
                Vec::new()
            },
            normal: normals,
            values: Vec::new(),
        },
        pixels,
        unreached,
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Pass {
    Depth,
    Centers,
}

fn draw_pass(frame: &Frame, list: &DrawList, pass: Pass, bands: &mut [Band]) {
    for chunk in list.triangles.chunks(CHUNK) {
        let set_up = gather(chunk, |corners, out| {
            let place = |vertex: &Vertex| match pass {
                Pass::Depth => pushed_corner(frame, vertex),
                Pass::Centers => frame.place(vertex.position),
            };
            triangle::set_up_placed(frame, list.vertices, *corners, place, out);
        });
        draw(bands, &set_up, |band, t: &Triangle| {
            t.for_each_pixel(band.rows(&t.rows), |x, y, depth, weights| {
                band.put(pass, [x, y], depth, || {
                    let surface = t.surface(weights);
                    let color = frame.shading.color(
                        Kind::Triangle,
                        surface.position,
                        surface.normal,
                        surface.color,
                    );
                    let facing = facing(frame, surface.position, surface.normal);
                    let distance = surface.distance as f32;
                    Fragment {
                        color,
                        normal: surface.normal.as_vec3().to_array(),
                        front: [distance, offset_at(frame, distance, facing)],
                    }
                });
            });
        });
    }
    let splats = |bands: &mut [Band], set_up: Vec<Vec<Splat>>| {
        draw(bands, &set_up, |band, splat: &Splat| match &splat.shape {
            Shape::Footprint(disc) => {
                disc.for_each_pixel(band.rows(&disc.rows), |x, y, _| {
                    band.put(pass, [x, y], splat.depth, || splat.fragment);
                });
            }
            Shape::Center([x, y]) => {
                for y in band.rows(&(*y..y + 1)) {
                    band.put(pass, [*x, y], splat.depth, || splat.fragment);
                }
            }
        });
    };
    for chunk in list.splats.chunks(CHUNK) {
        let set_up = gather(chunk, |s, out| {
            out.extend(splat(frame, pass, s.center, s.radius, s.normal, s.color));
        });
        splats(bands, set_up);
    }
    for chunk in list.points.chunks(CHUNK) {
        let set_up = gather(chunk, |p, out| {
            out.extend(splat(frame, pass, p.position, 0.0, p.normal, p.color));
        });
        splats(bands, set_up);
    }
}

/// Side of splats without a radius of their own, pixels.
fn size_px(style: &Style) -> f32 {
    style.splat_size_px.max(1.0)
}

/// Half the side of a pixel at a distance, view-space units.
fn pixel_radius(frame: &Frame, distance: f32) -> f32 {
    let depth = if frame.view.is_perspective {
        distance.max(0.0)
    } else {
        1.0
    };
    0.5 * depth / frame.view.focal_px()
}

/// The depth offset of a patch of surface that faces the eye by a cosine.
fn offset(frame: &Frame, radius: f32, facing: f32) -> f32 {
    frame.style.depth_offset * radius / facing.abs().max(LEAST_COSINE)
}

/// The depth offset of a triangle: that of the largest splat there.
fn offset_at(frame: &Frame, distance: f32, facing: f32) -> f32 {
    let radius = size_px(frame.style) * pixel_radius(frame, distance);
    offset(frame, radius, facing)
}

/// The cosine between a normal and the direction to the viewer, in model space; 1 without a normal.
fn facing(frame: &Frame, position: DVec3, normal: DVec3) -> f32 {
    if normal == DVec3::ZERO {
        return 1.0;
    }
    let view = frame.view;
    let to_viewer = if view.is_perspective {
        (view.eye.as_dvec3() - position).normalize_or_zero()
    } else {
        view.backward.as_dvec3()
    };
    normal.dot(to_viewer) as f32
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

/// The corner of a triangle in the first pass. `None` when the result is not finite.
fn pushed_corner(frame: &Frame, vertex: &Vertex) -> Option<Placed> {
    let in_view = (frame.view.view_from_model).transform_point3(vertex.position);
    let normal = normal_of(vertex.normal, vertex.color);
    let facing = facing(frame, vertex.position.as_dvec3(), normal);
    let by = offset_at(frame, -in_view.z, facing);
    frame.project(pushed(frame, in_view, by))
}

/// A splat ready to be drawn in one of the passes.
struct Splat {
    shape: Shape,
    /// Reversed depth in this pass.
    depth: f32,
    fragment: Fragment,
}

enum Shape {
    Footprint(Disc),
    /// The pixel of the center.
    Center([u32; 2]),
}

fn splat(
    frame: &Frame,
    pass: Pass,
    center: Vec3,
    radius: f32,
    normal: [i16; 2],
    color: [u8; 4],
) -> Option<Splat> {
    let (patch, placed) = patch(frame, center, radius, normal, color)?;
    let distance = placed.distance;
    let normal = normal_of(normal, color);
    let facing = facing(frame, center.as_dvec3(), normal);
    let by = offset(
        frame,
        (patch.radius as f32).max(pixel_radius(frame, distance)),
        facing,
    );
    let (shape, depth) = match pass {
        Pass::Depth => {
            let disc = Disc::new(frame, &patch, 0.0)?;
            // What cannot be pushed (an infinite offset) lies as far as can be.
            let depth = frame.project(pushed(frame, patch.center, by));
            let depth = depth.map_or(f32::NEG_INFINITY, |p| p.clip.z / p.clip.w);
            (Shape::Footprint(disc), depth)
        }
        Pass::Centers => {
            // Snapped to the grid, a side of 1 covers exactly the pixel that contains the center.
            let pixel = square::footprint(frame, center, |_| 1.0)?;
            let at = [pixel.columns.start, pixel.rows.start];
            (Shape::Center(at), pixel.depth)
        }
    };
    Some(Splat {
        shape,
        depth: before_far(depth),
        fragment: Fragment {
            color: frame
                .shading
                .color(Kind::Splat, center.as_dvec3(), normal, color_of(color)),
            normal: normal.as_vec3().to_array(),
            front: [distance, by],
        },
    })
}

/// What a primitive leaves in a pixel.
#[derive(Clone, Copy)]
struct Fragment {
    color: [f64; 4],
    normal: [f32; 3],
    front: [f32; 2],
}

/// Consecutive rows of the attachments of the first two passes.
struct Band<'a> {
    width: usize,
    first_row: u32,
    end_row: u32,
    depth: &'a mut [f32],
    pixels: &'a mut [Pixel],
    normals: Option<&'a mut [[f32; 3]]>,
}

/// Bands of whole rows, from the top; several a thread, since models are seldom spread evenly.
fn bands<'a>(
    view: &View,
    depth: &'a mut [f32],
    pixels: &'a mut [Pixel],
    normals: &'a mut [[f32; 3]],
) -> Vec<Band<'a>> {
    let width = view.width as usize;
    let rows = (view.height as usize)
        .div_ceil(4 * rayon::current_num_threads())
        .max(1);
    let mut normals = normals.chunks_mut(rows * width);
    depth
        .chunks_mut(rows * width)
        .zip(pixels.chunks_mut(rows * width))
        .enumerate()
        .map(|(i, (depth, pixels))| Band {
            width,
            first_row: (i * rows) as u32,
            end_row: (i * rows + pixels.len() / width) as u32,
            depth,
            pixels,
            normals: normals.next(),
        })
        .collect()
}

impl Band<'_> {
    /// The part of a range of rows that lies in this band.
    fn rows(&self, rows: &Range<u32>) -> Range<u32> {
        rows.start.max(self.first_row)..rows.end.min(self.end_row)
    }

    /// The depth test and, where it passes, the fragment. A NaN never passes.
    fn put(
        &mut self,
        pass: Pass,
        [x, y]: [u32; 2],
        depth: f32,
        fragment: impl FnOnce() -> Fragment,
    ) {
        let i = (y - self.first_row) as usize * self.width + x as usize;
        let (passes, class) = match pass {
            Pass::Depth => (depth > self.depth[i], Class::Hole),
            Pass::Centers => (depth >= self.depth[i], Class::Foreground),
        };
        if passes {
            let Fragment {
                color: [r, g, b, _],
                normal,
                front,
            } = fragment();
            self.depth[i] = depth;
            self.pixels[i] = Pixel {
                class,
                color: [r, g, b].map(unorm8),
                front,
            };
            if let Some(normals) = &mut self.normals {
                normals[i] = normal;
            }
        }
    }
}

#[cfg(test)]
mod tests;
