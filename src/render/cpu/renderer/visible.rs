//! Visibility splats from vertices, and the triangles beside them: what passes visibility.depth, visibility.centers and the
//! reconstruction make of them. A band of rows is the job of one thread; holes are filled once all are there.

use crate::abi::OrientedPolygon;
use crate::image::unorm8;
use crate::math::camera::View;
use crate::pack::{ColorBy, parallel};
use crate::render::cpu::corner_push::CornerPush;
use crate::render::cpu::frame_shading::{SPLAT_TINT, ShadedPoint};
use crate::render::cpu::opaque;
use crate::render::cpu::picture::PixelWords;
use crate::render::cpu::renderer::blended::TwoPassList;
use crate::render::cpu::renderer::polygons::{BAND_PX, PolygonBand, depth_of_distance, pixels_of};
use crate::render::cpu::renderer::{CpuFrame, CpuRenderer, DrawnCounts};
use crate::render::cpu::seen_polygon::PushedSplat;
use crate::render::cpu::triangles::{FaceSurface, NumberedFace};
use crate::render::hole_filling::{HoleFilling, PixelClass, PyramidLevel, VisibilityPixel};
use crate::render::pack_params::largest_splat_px;
use glam::Vec3;

/// Depth of what lies on the far plane; what lies beyond it is between this and 0, in its order.
const BEFORE_FAR: f32 = 1e-30;

/// Pixel after the first two passes.
#[derive(Debug, Clone, Copy, Default)]
struct TestedPoint {
    /// Reversed depth; 0 where nothing is.
    depth: f32,
    seen: VisibilityPixel,
    normal: [f32; 3],
}

/// First two passes over the bands of a frame.
struct ClassPasses<'l, 'a, D> {
    list: &'l TwoPassList<'a>,
    push: CornerPush,
    depth_of: D,
    centers: Vec<SplatCenter<'l>>,
}

/// Center of a splat from a vertex in the pixel that has it.
struct SplatCenter<'p> {
    pixel: [usize; 2],
    depth: f32,
    uv: [f32; 2],
    /// Distance along the view direction, and depth offset.
    front: [f32; 2],
    polygon: &'p OrientedPolygon,
}

impl<'p> SplatCenter<'p> {
    /// Center that a view may see.
    fn of(one: &'p PushedSplat<'_>, view: &View, depth_of: impl Fn(f32) -> f32) -> Option<Self> {
        let polygon = one.own.polygon;
        let uv = polygon.middle();
        let (x, y, distance) = view.project(polygon.point(uv));
        // The pixel whose center is in a square of one, in steps of 1/256 pixel.
        let pixel = |at: f32| {
            let low = (f64::from(at) * 256.0).round_ties_even() as i64 - 128;
            usize::try_from((low + 127) >> 8).ok()
        };
        let is_between = distance >= view.near && distance <= view.far;
        let is_near = is_between && x.is_finite() && y.is_finite();
        let pixel = is_near.then(|| Some([pixel(x)?, pixel(y)?])).flatten()?;
        Some(Self {
            pixel,
            depth: depth_of(distance).clamp(BEFORE_FAR, 1.0),
            uv,
            front: [distance, one.offset],
            polygon,
        })
    }
}

impl CpuRenderer {
    /// Splats from vertices and triangles, of which centers are seen and the rest is reconstructed.
    pub(super) fn draw_visible(
        &mut self,
        frame: &CpuFrame<'_>,
        light: &opaque::FrameHeadlight,
        pixels: &mut PixelWords<'_>,
    ) -> DrawnCounts {
        let depth_of = depth_of_distance(frame);
        let area = pixels_of(frame.context.rect_px);
        let filling = HoleFilling {
            reconstruction: frame.settings.reconstruction,
            largest_px: largest_splat_px(&frame.plan.facts, frame.settings),
        };
        let size_px = frame.constants.splat_size_px.max(1.0);
        let push = CornerPush::of_frame(frame.constants);
        self.with_two_passes(frame, light, pixels, true, |list, mut bands| {
            let [left, width, _] = list.columns;
            let mut tested = vec![TestedPoint::default(); area];
            let passes = ClassPasses {
                list,
                push,
                depth_of,
                centers: (list.polygons.iter())
                    .filter_map(|one| SplatCenter::of(one, list.view, depth_of))
                    .collect(),
            };
            let jobs = bands.iter().zip(tested.chunks_mut(BAND_PX * width.max(1)));
            parallel::share(area, jobs, |(band, tested)| passes.draw(band, tested));
            let (columns, rows) = (list.view.width as usize, list.view.height as usize);
            let mut seen = vec![VisibilityPixel::default(); columns * rows];
            for (band, tested) in bands.iter().zip(tested.chunks(BAND_PX * width.max(1))) {
                for (row, own) in tested.chunks(width).enumerate() {
                    let first = (band.top + row) * columns + left;
                    let to = seen[first..first + width].iter_mut();
                    to.zip(own).for_each(|(to, own)| *to = own.seen);
                }
            }
            let finest = PyramidLevel {
                width: columns,
                height: rows,
                pixels: seen,
            };
            let filled = finest.filled(filling, size_px);
            let jobs = bands.iter_mut().zip(tested.chunks(BAND_PX * width.max(1)));
            parallel::share(area, jobs, |(band, tested)| {
                let first = band.top * columns + left;
                passes.show(band, tested, |here| {
                    filled[first + here / width * columns + here % width]
                });
            });
        })
    }
}

impl TestedPoint {
    /// Puts a point of a class there.
    fn put(&mut self, class: PixelClass, depth: f32, point: ShadedPoint, front: [f32; 2]) {
        *self = Self {
            depth,
            seen: VisibilityPixel {
                class,
                color: point.color.to_array().map(|value| unorm8(value.into())),
                front,
            },
            normal: point.normal.to_array(),
        };
    }
}

impl<D: Fn(f32) -> f32 + Copy + Sync> ClassPasses<'_, '_, D> {
    /// Draws a band: pass for depth, pass for centers.
    fn draw(&self, band: &PolygonBand<'_>, tested: &mut [TestedPoint]) {
        self.draw_triangles(PixelClass::Hole, band, tested);
        let list = self.list;
        let rows = list.rows(band);
        for one in list.polygons {
            one.own.for_each_pixel(list.ends(), rows, |pixel, sample| {
                let here = &mut tested[list.index(band, pixel)];
                let depth = (self.depth_of)(one.pushed_distance(&sample) as f32).min(1.0);
                if depth > here.depth {
                    let polygon = one.own.polygon;
                    let point = (list.shading).of_polygon(polygon, sample.uv, SPLAT_TINT);
                    let front = [sample.distance as f32, one.offset];
                    here.put(PixelClass::Hole, depth, point, front);
                }
            });
        }
        self.draw_triangles(PixelClass::Foreground, band, tested);
        let [left, right] = list.ends();
        for center in &self.centers {
            let [x, y] = center.pixel;
            if !(left..right).contains(&x) || !(rows[0]..rows[1]).contains(&y) {
                continue;
            }
            let here = &mut tested[list.index(band, center.pixel)];
            if center.depth >= here.depth {
                let point = (list.shading).of_polygon(center.polygon, center.uv, SPLAT_TINT);
                here.put(PixelClass::Foreground, center.depth, point, center.front);
            }
        }
    }

    /// Draws triangles: pushed away as holes, else as foreground, where they are not farther.
    fn draw_triangles(
        &self,
        class: PixelClass,
        band: &PolygonBand<'_>,
        tested: &mut [TestedPoint],
    ) {
        let list = self.list;
        let is_center = class == PixelClass::Foreground;
        let triangles = list.triangles[usize::from(is_center)];
        let rows = list.rows(band).map(|row| row as u32);
        for NumberedFace { part, face, .. } in triangles.near(rows) {
            let Some(light) = triangles.light() else {
                break;
            };
            let mut surface = None;
            face.for_each_pixel(rows, |pixel, weights| {
                let depth = face.depth_at(weights);
                let here = &mut tested[list.index(band, pixel.map(|at| at as usize))];
                if depth > here.depth || (is_center && depth == here.depth) {
                    let surface = surface
                        .get_or_insert_with(|| FaceSurface::of(face, part, list.meshes, light));
                    let point = light.point_at(surface, &face.place_at(pixel, depth));
                    let distance = list.view.distance_of_depth(depth);
                    let facing = list.shading.facing(pixel, point.normal);
                    let front = [distance, self.push.offset(distance, facing)];
                    here.put(class, depth, point, front);
                }
            });
        }
    }

    /// Shows a band, with the colors of the holes that are filled.
    fn show(
        &self,
        band: &mut PolygonBand<'_>,
        tested: &[TestedPoint],
        filled: impl Fn(usize) -> Option<[u8; 3]>,
    ) {
        let [_, width, pitch] = self.list.columns;
        let is_data = self.list.settings.color_by == ColorBy::Classification;
        for (here, tested) in tested.iter().enumerate() {
            let word = here / width * pitch + here % width;
            let filled = filled(here);
            let color = match (tested.seen.class, is_data) {
                (PixelClass::Background, _) => {
                    (band.depths[here], band.colors[word]) = (0.0, self.list.background);
                    continue;
                }
                (PixelClass::Foreground, true) => [255; 3],
                (PixelClass::Hole, true) if filled.is_some() => [128; 3],
                (PixelClass::Hole, true) => [255, 0, 0],
                (PixelClass::Hole, false) => filled.unwrap_or(tested.seen.color),
                (PixelClass::Foreground, false) => tested.seen.color,
            };
            band.depths[here] = (self.depth_of)(tested.seen.front[0]).clamp(BEFORE_FAR, 1.0);
            let point = ShadedPoint {
                color: Vec3::from_array(color.map(|value| f32::from(value) / 255.0)),
                normal: tested.normal.into(),
            };
            band.put([here, word], point);
        }
    }
}
