//! Oriented polygons: each pixel intersects its ray with the plane, and is lit there.

use crate::abi::{OrientedPolygon, PatchTexture};
use crate::math::camera::View;
use crate::pack::polygons::{PolygonSample, ScreenPolygon};
use crate::render::reference::bands::{OpaquePixel, PixelCoverage, PixelRows};
use crate::render::reference::frame::{PlacedVertex, ReferenceFrame};
use crate::render::reference::shade::{SurfaceKind, SurfacePoint, color_of};
use crate::textures::{TextureImage, TextureSlope};
use glam::{DMat2, DVec2, DVec3, Vec3};
use std::ops::Range;
use std::sync::Arc;

/// Oriented polygons of a frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct PolygonList<'a> {
    /// In the order in which they are drawn.
    pub polygons: &'a [OrientedPolygon],
    /// Patches of a cut by error; else splats from vertices.
    pub are_patches: bool,
    /// Places of patches in images, one each where images are shown; else none.
    pub textures: &'a [PatchTexture],
    /// Images that they are in.
    pub images: &'a [Arc<TextureImage>],
    /// Pixels at the rims of patches show how much of them is covered.
    pub covers_rims: bool,
}

/// A polygon with the pixels that it may cover.
struct RasterPolygon {
    polygon: OrientedPolygon,
    seen: ScreenPolygon,
    columns: Range<u32>,
    rows: Range<u32>,
    /// Nowhere where no image is shown.
    texture: Option<PatchTexture>,
    /// Place in the list.
    number: u32,
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
    let items: Vec<_> = (list.polygons.iter().enumerate())
        .map(|(index, polygon)| (index as u32, polygon, list.textures.get(index)))
        .collect();
    target.draw(
        &items,
        |&(number, polygon, texture)| {
            let texture = texture.copied();
            set_up(frame, polygon).map(|raster| RasterPolygon {
                number,
                texture,
                ..raster
            })
        },
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
                let mut seen = surface(kind, &raster.polygon, sample);
                if let Some(color) = raster.texture.and_then(|texture| {
                    texture_color((&texture, list.images), &raster.polygon, sample, frame.view)
                }) {
                    seen.color = color;
                }
                *pixel = OpaquePixel {
                    depth,
                    shown: frame.shading.shown(&seen),
                    patch: list.are_patches.then_some(raster.number),
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
        texture: None,
        number: 0,
    })
}

/// Color of an image where a pixel sees a patch; `None` where it is in none.
fn texture_color(
    (texture, images): (&PatchTexture, &[Arc<TextureImage>]),
    patch: &OrientedPolygon,
    sample: PolygonSample,
    view: &View,
) -> Option<DVec3> {
    let image = images.get(texture.image as usize)?;
    let [at, along_u, along_v] =
        [texture.at, texture.along_u, texture.along_v].map(|[x, y]| DVec2::new(x.into(), y.into()));
    let steps = plane_steps(patch, sample, view).map(|step| step.x * along_u + step.y * along_v);
    let slope = TextureSlope {
        right: steps[0].as_vec2(),
        down: steps[1].as_vec2(),
    };
    let [u, v] = sample.uv.map(f64::from);
    let place = (at + u * along_u + v * along_v).as_vec2();
    Some(image.sample(place, image.level_of(slope)).as_dvec3())
}

/// Change of plane coordinates to what the next pixels on the right and below see, from the planes through the eye that are
/// seen as lines: u / w and v / w of a plane point are linear in the picture, and 1 / w is.
fn plane_steps(patch: &OrientedPolygon, sample: PolygonSample, view: &View) -> [DVec2; 2] {
    let matrix = view.view_from_model.as_dmat4();
    let at = matrix.transform_point3(patch.point(sample.uv).as_dvec3());
    let [u, v] =
        [patch.axis, patch.second_axis()].map(|axis| matrix.transform_vector3(axis.as_dvec3()));
    let [sx, sy] = view.scale.map(f64::from);
    let [width, height] = [view.width, view.height].map(f64::from);
    // Window coordinates along a way in the plane: x = f X / W.
    let focal = [0.5 * sx * width, -0.5 * sy * height];
    let change = |way: DVec3| match view.is_perspective {
        true => {
            let w = -at.z;
            DVec2::new(
                focal[0] * (way.x * w + at.x * way.z) / (w * w),
                focal[1] * (way.y * w + at.y * way.z) / (w * w),
            )
        }
        false => DVec2::new(focal[0] * way.x, focal[1] * way.y),
    };
    let back = DMat2::from_cols(change(u), change(v)).inverse();
    [back.x_axis, back.y_axis]
}

/// Radii by which planes of a flat surface are kept apart.
const LEAST_STEP: f64 = 0.01;

/// A splat from a vertex where it is blended or hides centers: pulled towards the eye or pushed away from it by scaling
/// around it, so that it stays flat and covers the same pixels.
pub(super) struct PushedPolygon {
    raster: RasterPolygon,
    /// Sine of the greatest angle of its faces with its plane.
    spread: f64,
    /// Depth offset of its radius, view-space units.
    pub(super) offset: f64,
    /// Depth offset over the distance of its center from the eye; 0 without perspective.
    slope: f64,
    /// Depth offset without perspective, view-space units; else 0.
    lift: f64,
    is_gauss: bool,
}

/// What a pixel sees of one.
#[derive(Debug, Clone, Copy)]
pub(super) struct PushedSample {
    /// Reversed depth in its place.
    pub(super) own: f32,
    /// Reversed depth, pushed away from the eye by what keeps planes of a flat surface apart.
    pub(super) least_pushed: f32,
    /// Reversed depth, pushed away by that and by twice what a face that it stands for may lie from its plane.
    pub(super) pushed: f32,
    /// Reversed depth, pulled towards the eye by twice what a face may lie from its plane.
    pub(super) pulled: f32,
    /// Part of a blend.
    pub(super) weight: f32,
    seen: PolygonSample,
}

impl PushedPolygon {
    /// A polygon; `None` where it covers no pixel or is left out.
    pub(super) fn new(frame: &ReferenceFrame<'_>, polygon: &OrientedPolygon) -> Option<Self> {
        let raster = set_up(frame, polygon)?;
        let view = frame.view;
        let center = view
            .view_from_model
            .transform_point3(polygon.center)
            .as_dvec3();
        let scale = f64::from(view.model_scale);
        let normal = view
            .view_from_model
            .transform_vector3(polygon.normal)
            .as_dvec3()
            / scale;
        let facing = match frame.to_eye(center) {
            DVec3::ZERO => 1.0,
            to_eye => normal.dot(to_eye).abs().max(0.1),
        };
        let radius = f64::from(frame.style.depth_offset) * f64::from(polygon.round_radius) * scale;
        let offset = radius / facing;
        let way = center.length();
        let (slope, lift) = match (view.is_perspective, way > 0.0) {
            (true, true) => (offset / way, 0.0),
            (true, false) => (0.0, 0.0),
            (false, _) => (0.0, offset),
        };
        Some(Self {
            raster,
            spread: polygon.spread.into(),
            offset,
            slope,
            lift,
            is_gauss: frame.style.is_gauss,
        })
    }

    /// A distance, pushed away by a number of depth offsets.
    fn pushed(&self, distance: f64, offsets: f64) -> f64 {
        distance * (1.0 + offsets * self.slope) + offsets * self.lift
    }

    /// What light makes of it at a pixel.
    pub(super) fn surface(&self, sample: PushedSample) -> SurfacePoint {
        surface(SurfaceKind::Splat, &self.raster.polygon, sample.seen)
    }
}

/// Places of a polygon on the picture with the frame that they are of.
pub(super) struct FramedPolygon<'a> {
    pub(super) pushed: PushedPolygon,
    pub(super) frame: &'a ReferenceFrame<'a>,
}

impl PixelCoverage for FramedPolygon<'_> {
    type Sample = PushedSample;

    fn rows(&self) -> Range<u32> {
        self.pushed.raster.rows()
    }

    fn columns(&self, y: u32) -> Range<u32> {
        self.pushed.raster.columns(y)
    }

    fn sample(&self, x: u32, y: u32) -> Option<PushedSample> {
        let own = &self.pushed;
        let seen = own.raster.sample(x, y)?;
        let depth = |distance: f64| {
            let placed = self.frame.project(Vec3::new(0.0, 0.0, -distance as f32))?;
            Some(placed.clip.z / placed.clip.w)
        };
        let [u, v] = seen.uv;
        let radius = own.raster.polygon.round_radius;
        let kernel = match own.is_gauss {
            true => (-2.0 * (u * u + v * v) / (radius * radius)).exp(),
            false => 1.0,
        };
        let apart = 2.0 * own.spread;
        Some(PushedSample {
            own: depth(seen.distance)?,
            least_pushed: depth(own.pushed(seen.distance, LEAST_STEP))?,
            pushed: depth(own.pushed(seen.distance, apart + LEAST_STEP))?,
            pulled: depth((seen.distance - apart * own.lift) / (1.0 + apart * own.slope))?,
            weight: kernel,
            seen,
        })
    }
}

/// What of a splat from a vertex is its middle for visibility splatting, and how far from the eye that is.
pub(super) fn middle_of(
    frame: &ReferenceFrame<'_>,
    polygon: &OrientedPolygon,
) -> Option<(PlacedVertex, SurfacePoint)> {
    let uv = polygon.middle();
    let placed = frame.place(polygon.point(uv))?;
    let seen = PolygonSample {
        distance: placed.distance.into(),
        uv,
    };
    Some((placed, surface(SurfaceKind::Splat, polygon, seen)))
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
