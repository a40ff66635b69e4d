//! The reference of visibility splatting (Benda, section 3.3.4): footprints into depth, centers into pixels, and a
//! reconstruction of what lies between ([`crate::render::hole_filling`]).
//!
//! Coverage, snapping and the vertex shader are those of [`crate::render::reference::render`].

use crate::abi::{OrientedPolygon, Splat, Vertex};
use crate::image::{Image, unorm8};
use crate::math::camera::View;
use crate::pack::{ColorBy, DrawList, PrimitiveStyle};
use crate::render::PictureOutputs;
#[cfg(doc)]
use crate::render::Reconstruction;
use crate::render::hole_filling::PyramidLevel;
pub use crate::render::hole_filling::{HoleFilling, PixelClass, VisibilityPixel};
use crate::render::reference::bands::{PixelRows, plane};
use crate::render::reference::disc::DiscFootprint;
use crate::render::reference::frame::{PlacedVertex, ReferenceFrame};
use crate::render::reference::polygons::{FramedPolygon, PushedPolygon, middle_of};
use crate::render::reference::shade::{SurfacePoint, normal_of};
use crate::render::reference::splat::{PlacedSplat, RasterSplat, SplatFootprint, splat_of_vertex};
use crate::render::reference::square::SquareFootprint;
use crate::render::reference::triangle;
use glam::DVec3;

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

/// What [`render_visibility`] draws: the picture, and what it comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct VisibilityRendering {
    /// The picture after the reconstruction. [`Image::depth`] holds the distance in [`VisibilityPixel::front`],
    /// [`Image::normal`] the normal of what gave [`VisibilityPixel::color`].
    pub image: Image,
    /// Each pixel after the first two passes, row by row from the top left.
    pub pixels: Vec<VisibilityPixel>,
    /// Holes that no foreground of their surface was within reach of; they show [`VisibilityPixel::color`].
    pub unreached: u64,
}

/// Draws `list` as `view` sees it.
///
/// **Depth.** The footprint of every splat and point as a disc in the plane of the surface, at least a pixel, with the
/// depth of its center pushed away from the eye along the ray (orthographic: parallel to the view direction) by m r
/// over the cosine between normal and view ray (at least 0.1; 1 without a normal): r is its radius, at least that of
/// half a pixel, and m [`PrimitiveStyle::depth_offset`]. The corners of triangles are pushed likewise, by the r of
/// [`PrimitiveStyle::splat_size_px`]. Nearer wins, the first drawn wins ties. Covered pixels are holes.
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
    style: &PrimitiveStyle,
    filling: HoleFilling,
    outputs: PictureOutputs,
) -> VisibilityRendering {
    render_visibility_polygons(view, list, &[], style, filling, outputs)
}

/// Draws a list as [`render_visibility`] does, and splats from vertices between its triangles and its splats. Their footprints
/// are lit in each pixel and pushed away by what two of one surface may lie apart; their centers are where all of the splat is
/// around.
pub fn render_visibility_polygons(
    view: &View,
    list: &DrawList,
    polygons: &[OrientedPolygon],
    style: &PrimitiveStyle,
    filling: HoleFilling,
    outputs: PictureOutputs,
) -> VisibilityRendering {
    let frame = ReferenceFrame::new(view, style);
    let mut target = PixelRows::cleared(view, TestedPixel::default());
    for pass in [VisibilityPass::Depth, VisibilityPass::Centers] {
        draw_pass(&frame, list, polygons, pass, &mut target);
    }
    let seen = target.into_pixels();
    let finest = PyramidLevel {
        width: view.width as usize,
        height: view.height as usize,
        pixels: plane(true, &seen, |seen| seen.pixel),
    };
    let normal = plane(outputs.normal, &seen, |seen| seen.normal);
    let filled = finest.clone().filled(filling, size_px(style));
    let pixels = finest.pixels;
    let is_unreached = |(pixel, filled): &(&VisibilityPixel, &Option<[u8; 3]>)| {
        pixel.class == PixelClass::Hole && filled.is_none()
    };
    VisibilityRendering {
        image: Image {
            width: view.width,
            height: view.height,
            color: (pixels.iter().zip(&filled))
                .map(|(pixel, filled)| shown(style, pixel, *filled))
                .collect(),
            depth: plane(outputs.depth, &pixels, |pixel| match pixel.class {
                PixelClass::Background => f32::INFINITY,
                _ => pixel.front[0],
            }),
            normal,
            values: Vec::new(),
        },
        unreached: pixels.iter().zip(&filled).filter(is_unreached).count() as u64,
        pixels,
    }
}

/// The color of a pixel with what a hole is filled with.
fn shown(style: &PrimitiveStyle, pixel: &VisibilityPixel, filled: Option<[u8; 3]>) -> [u8; 4] {
    let [r, g, b] = match (pixel.class, style.color_by) {
        (PixelClass::Background, _) => {
            let [r, g, b] = style.background.map(|c| unorm8(f64::from(c)));
            return [r, g, b, 0];
        }
        (PixelClass::Foreground, ColorBy::Classification) => [255; 3],
        (PixelClass::Hole, ColorBy::Classification) if filled.is_some() => [128; 3],
        (PixelClass::Hole, ColorBy::Classification) => [255, 0, 0],
        (PixelClass::Hole, _) => filled.unwrap_or(pixel.color),
        (PixelClass::Foreground, _) => pixel.color,
    };
    [r, g, b, 255]
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum VisibilityPass {
    Depth,
    Centers,
}

/// A pixel of the attachments of the first two passes, and what a primitive leaves in one.
#[derive(Clone, Copy, Default)]
struct TestedPixel {
    /// Reversed depth in the pass; 0 where nothing is.
    depth: f32,
    pixel: VisibilityPixel,
    normal: [f32; 3],
}

fn draw_pass(
    frame: &ReferenceFrame,
    list: &DrawList,
    polygons: &[OrientedPolygon],
    pass: VisibilityPass,
    target: &mut PixelRows<TestedPixel>,
) {
    let place = |vertex: &Vertex| match pass {
        VisibilityPass::Depth => place_pushed(frame, vertex),
        VisibilityPass::Centers => frame.place(vertex.position),
    };
    target.draw(
        list.triangles,
        |corners| triangle::set_up(frame, (list.vertices, list.textures), *corners, place),
        |pixel, triangle, sample| {
            pixel.put(pass, sample.depth, || {
                let point = triangle.surface(sample);
                let facing = facing(frame, point.position, point.normal);
                let offset = offset_at(frame, point.distance as f32, facing);
                TestedPixel::new(frame, pass, sample.depth, &point, offset)
            });
        },
    );
    let put = |pixel: &mut TestedPixel, splat: &RasterSplat<TestedPixel>, _| {
        pixel.put(pass, splat.fragment.depth, || splat.fragment);
    };
    match pass {
        VisibilityPass::Depth => target.draw(
            polygons,
            |polygon| {
                let pushed = PushedPolygon::new(frame, polygon)?;
                Some(FramedPolygon { pushed, frame })
            },
            |pixel, polygon: &FramedPolygon<'_>, sample| {
                let depth = sample.pushed.min(1.0);
                pixel.put(pass, depth, || {
                    let (point, offset) = (polygon.pushed.surface(sample), polygon.pushed.offset);
                    TestedPixel::new(frame, pass, depth, &point, offset as f32)
                });
            },
        ),
        VisibilityPass::Centers => target.draw(polygons, |p| center_of(frame, p), put),
    }
    target.draw(list.splats, |s| set_up(frame, pass, s), put);
    target.draw(
        list.points,
        |p| set_up(frame, pass, &splat_of_vertex(p)),
        put,
    );
}

/// The center of a splat from a vertex; `None` when it covers no pixel.
fn center_of(
    frame: &ReferenceFrame,
    polygon: &OrientedPolygon,
) -> Option<RasterSplat<TestedPixel>> {
    let offset = PushedPolygon::new(frame, polygon)?.offset as f32;
    let (placed, point) = middle_of(frame, polygon)?;
    let distance = placed.distance;
    if !(distance >= frame.view.near && distance <= frame.view.far) {
        return None;
    }
    let depth = before_far(placed.depth());
    let pass = VisibilityPass::Centers;
    Some(RasterSplat {
        footprint: SplatFootprint::Square(SquareFootprint::around(frame, &placed, 1.0)?),
        fragment: TestedPixel::new(frame, pass, depth, &point, offset),
    })
}

impl TestedPixel {
    /// A shaded point of a surface with a depth offset.
    fn new(
        frame: &ReferenceFrame,
        pass: VisibilityPass,
        depth: f32,
        point: &SurfacePoint,
        offset: f32,
    ) -> Self {
        Self {
            depth,
            pixel: VisibilityPixel {
                class: match pass {
                    VisibilityPass::Depth => PixelClass::Hole,
                    VisibilityPass::Centers => PixelClass::Foreground,
                },
                color: frame.shading.value(point).to_array().map(unorm8),
                front: [point.distance as f32, offset],
            },
            normal: point.normal.as_vec3().to_array(),
        }
    }

    /// The depth test and, where it passes, the fragment. A NaN never passes.
    fn put(&mut self, pass: VisibilityPass, depth: f32, fragment: impl FnOnce() -> Self) {
        let passes = match pass {
            VisibilityPass::Depth => depth > self.depth,
            VisibilityPass::Centers => depth >= self.depth,
        };
        if passes {
            *self = fragment();
        }
    }
}

/// A splat in one of the passes; `None` when it covers no pixel.
fn set_up(
    frame: &ReferenceFrame,
    pass: VisibilityPass,
    splat: &Splat,
) -> Option<RasterSplat<TestedPixel>> {
    let seen = PlacedSplat::new(frame, splat)?;
    let radius = (seen.patch.radius as f32).max(pixel_radius(frame, seen.placed.distance));
    let facing = facing(frame, seen.point.position, seen.point.normal);
    let by = offset(frame, radius, facing);
    let (footprint, depth) = match pass {
        VisibilityPass::Depth => {
            let disc = DiscFootprint::new(frame, &seen.patch, 0.0)?;
            // What cannot be pushed (an infinite offset) lies as far as can be.
            let pushed = frame.project(frame.pushed(seen.patch.center, by));
            let depth = pushed.map_or(f32::NEG_INFINITY, |p| p.clip.z / p.clip.w);
            (SplatFootprint::Disc(disc), depth)
        }
        VisibilityPass::Centers => {
            // Snapped to the grid, a side of 1 covers exactly the pixel that contains the center.
            let pixel = SquareFootprint::around(frame, &seen.placed, 1.0)?;
            (SplatFootprint::Square(pixel), seen.placed.depth())
        }
    };
    let depth = before_far(depth);
    Some(RasterSplat {
        footprint,
        fragment: TestedPixel::new(frame, pass, depth, &seen.point, by),
    })
}

/// Side of splats without a radius of their own, pixels.
fn size_px(style: &PrimitiveStyle) -> f32 {
    style.splat_size_px.max(1.0)
}

/// Half the side of a pixel at a distance, view-space units.
fn pixel_radius(frame: &ReferenceFrame, distance: f32) -> f32 {
    let depth = if frame.view.is_perspective {
        distance.max(0.0)
    } else {
        1.0
    };
    0.5 * depth / frame.view.focal_px()
}

/// The depth offset of a patch of surface that faces the eye by a cosine.
fn offset(frame: &ReferenceFrame, radius: f32, facing: f32) -> f32 {
    frame.style.depth_offset * radius / facing.abs().max(LEAST_COSINE)
}

/// The depth offset of a triangle: that of the largest splat there.
fn offset_at(frame: &ReferenceFrame, distance: f32, facing: f32) -> f32 {
    let radius = size_px(frame.style) * pixel_radius(frame, distance);
    offset(frame, radius, facing)
}

/// The cosine between a normal and the direction to the viewer, in model space; 1 without a normal.
fn facing(frame: &ReferenceFrame, position: DVec3, normal: DVec3) -> f32 {
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

/// The corner of a triangle in the first pass. `None` when the result is not finite.
fn place_pushed(frame: &ReferenceFrame, vertex: &Vertex) -> Option<PlacedVertex> {
    let in_view = (frame.view.view_from_model).transform_point3(vertex.position);
    let normal = normal_of(vertex.normal, vertex.color);
    let facing = facing(frame, vertex.position.as_dvec3(), normal);
    let by = offset_at(frame, -in_view.z, facing);
    frame.project(frame.pushed(in_view, by))
}

#[cfg(test)]
mod tests;
