//! Oriented polygons: each pixel intersects its ray with the plane, and is lit there.

use crate::abi::OrientedPolygon;
use crate::math::camera::View;
use crate::pack::polygons::{PolygonSample, ScreenPolygon};
use crate::render::reference::bands::{OpaquePixel, PixelCoverage, PixelRows};
use crate::render::reference::frame::ReferenceFrame;
use crate::render::reference::shade::{SurfaceKind, SurfacePoint, color_of};
use glam::{DVec2, Vec3};
use std::ops::Range;

/// Oriented polygons of a frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct PolygonList<'a> {
    /// In the order in which they are drawn.
    pub polygons: &'a [OrientedPolygon],
    /// Patches of a cut by error; else splats from vertices.
    pub are_patches: bool,
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

/// Draws polygons where they are nearer than what is there. Those that face away are left out where back faces are.
pub(super) fn draw(
    frame: &ReferenceFrame<'_>,
    target: &mut PixelRows<OpaquePixel>,
    list: PolygonList<'_>,
) {
    let kind = match list.are_patches {
        true => SurfaceKind::Patch,
        false => SurfaceKind::Splat,
    };
    target.draw(
        list.polygons,
        |polygon| set_up(frame, polygon),
        |pixel, raster: &RasterPolygon, sample| {
            let distance = sample.distance as f32;
            let Some(placed) = frame.project(Vec3::new(0.0, 0.0, -distance)) else {
                return;
            };
            // What is widened is never out of the view.
            let depth = match raster.seen.margin_px() > 0.0 {
                true => placed.depth().max(f32::MIN_POSITIVE),
                false => placed.depth(),
            };
            if depth > pixel.depth {
                *pixel = OpaquePixel {
                    depth,
                    shown: frame.shading.shown(&surface(kind, &raster.polygon, sample)),
                };
            }
        },
    );
}

/// A polygon; `None` where it covers no pixel or is left out.
fn set_up(frame: &ReferenceFrame<'_>, polygon: &OrientedPolygon) -> Option<RasterPolygon> {
    let view: &View = frame.view;
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
fn surface(kind: SurfaceKind, polygon: &OrientedPolygon, sample: PolygonSample) -> SurfacePoint {
    let color = match polygon.color_slopes {
        [[0, 0, 0, _], [0, 0, 0, _]] => color_of(polygon.color),
        _ => polygon.color_at(sample.uv).as_dvec3(),
    };
    SurfacePoint {
        kind,
        position: polygon.point(sample.uv).as_dvec3(),
        normal: polygon.normal_at(sample.uv).as_dvec3().normalize_or_zero(),
        color,
        light_share: polygon.light_share().into(),
        distance: sample.distance,
    }
}
