//! Oriented polygons and triangles: one depth test, the nearest wins. Each pixel intersects its ray with the plane, and is
//! lit there.

use crate::abi::OrientedPolygon;
use crate::image::Image;
use crate::math::camera::View;
use crate::pack::polygons::{PolygonSample, ScreenPolygon};
use crate::pack::{DrawList, Style};
use crate::render::PictureOutputs;
use crate::render::reference::bands::{PixelCoverage, PixelRows, ShownPixel, picture};
use crate::render::reference::frame::ReferenceFrame;
use crate::render::reference::shade::{SurfaceKind, SurfacePoint, color_of};
use crate::render::reference::triangle;
use glam::{DVec2, Vec3};
use std::ops::Range;

/// A pixel, and what is nearest in it.
#[derive(Clone, Copy)]
struct PolygonPixel {
    /// Reversed depth.
    depth: f32,
    shown: ShownPixel,
}

/// A polygon with the pixels that it may cover.
struct RasterPolygon {
    polygon: OrientedPolygon,
    seen: ScreenPolygon,
    columns: Range<u32>,
    rows: Range<u32>,
}

impl PixelCoverage for RasterPolygon {
    type Sample = PolygonSample;

    fn rows(&self) -> Range<u32> {
        self.rows.clone()
    }

    fn columns(&self, _y: u32) -> Range<u32> {
        self.columns.clone()
    }

    fn sample(&self, x: u32, y: u32) -> Option<PolygonSample> {
        let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        self.seen.sample(at)
    }
}

/// Draws triangles of `list`, then polygons, as [`render`](crate::render::reference::render) draws triangles: nearer wins,
/// the first drawn wins ties. Polygons that face away are left out where back faces are.
pub fn render_polygons(
    view: &View,
    list: &DrawList<'_>,
    polygons: &[OrientedPolygon],
    style: &Style,
    outputs: PictureOutputs,
) -> Image {
    let frame = ReferenceFrame::new(view, style);
    let mut target = PixelRows::cleared(
        view,
        PolygonPixel {
            depth: 0.0,
            shown: ShownPixel::background(style),
        },
    );
    target.draw(
        list.triangles,
        |corners| {
            triangle::set_up(&frame, (list.vertices, list.textures), *corners, |v| {
                frame.place(v.position)
            })
        },
        |pixel, triangle, sample| {
            if sample.depth > pixel.depth {
                *pixel = PolygonPixel {
                    depth: sample.depth,
                    shown: frame.shading.shown(&triangle.surface(sample)),
                };
            }
        },
    );
    target.draw(
        polygons,
        |polygon| set_up(&frame, polygon),
        |pixel, raster: &RasterPolygon, sample| {
            let distance = sample.distance as f32;
            let Some(placed) = frame.project(Vec3::new(0.0, 0.0, -distance)) else {
                return;
            };
            if placed.depth() > pixel.depth {
                *pixel = PolygonPixel {
                    depth: placed.depth(),
                    shown: frame.shading.shown(&surface(&raster.polygon, sample)),
                };
            }
        },
    );
    let pixels = target.into_pixels();
    picture(view, outputs, |i| pixels[i].shown)
}

/// A polygon; `None` where it covers no pixel or is left out.
fn set_up(frame: &ReferenceFrame<'_>, polygon: &OrientedPolygon) -> Option<RasterPolygon> {
    let view = frame.view;
    if frame.style.cull_back_faces && !polygon.faces(view) {
        return None;
    }
    let seen = ScreenPolygon::of(polygon, view)?;
    let [low, high] = seen.bounds();
    // Casts saturate at the sides of the picture.
    let range = |low: f64, high: f64, size: u32| {
        (low.floor() as u32).min(size)..((high.ceil() + 1.0) as u32).min(size)
    };
    let columns = range(low.x, high.x, view.width);
    let rows = range(low.y, high.y, view.height);
    (!columns.is_empty() && !rows.is_empty()).then_some(RasterPolygon {
        polygon: *polygon,
        seen,
        columns,
        rows,
    })
}

/// What of a polygon a pixel shows.
fn surface(polygon: &OrientedPolygon, sample: PolygonSample) -> SurfacePoint {
    SurfacePoint {
        kind: SurfaceKind::Splat,
        position: polygon.point(sample.uv).as_dvec3(),
        normal: polygon.normal_at(sample.uv).as_dvec3().normalize_or_zero(),
        color: color_of(polygon.color),
        distance: sample.distance,
    }
}
