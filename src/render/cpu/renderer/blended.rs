//! Splats from vertices, blended in two passes, and the triangles beside them: what passes fuzzy.depth, fuzzy.blend and
//! fuzzy.normalize make of them. A band of rows is the job of one thread from beginning to end.

use crate::abi::constants::LEAST_FUZZY_WEIGHT;
use crate::math::camera::View;
use crate::pack::parallel;
use crate::render::cpu::frame_shading::{FrameShading, SPLAT_TINT, ShadedPoint, unit_or_zero};
use crate::render::cpu::opaque;
use crate::render::cpu::picture::PixelWords;
use crate::render::cpu::renderer::polygons::{
    PolygonBand, bands_of, columns_of, depth_of_distance, pixels_of,
};
use crate::render::cpu::renderer::{CpuFrame, CpuRenderer, DrawnCounts};
use crate::render::cpu::seen_polygon::{PushedSplat, seen_polygons};
use crate::render::cpu::triangles::{
    CutTriangles, FaceSurface, FrameLight, MeshVertices, NumberedFace,
};
use crate::render::{Settings, Shading, SplatKind};
use crate::tree::Model;
use glam::Vec4;

/// What both passes draw.
pub(super) struct TwoPassList<'a> {
    /// Triangles in the first pass, and in the second.
    pub(super) triangles: [&'a CutTriangles; 2],
    pub(super) meshes: MeshVertices<'a>,
    pub(super) polygons: &'a [PushedSplat<'a>],
    pub(super) shading: &'a FrameShading,
    pub(super) view: &'a View,
    pub(super) settings: &'a Settings,
    /// The first column, how many there are, and words from a row to the next.
    pub(super) columns: [usize; 3],
    /// Word of pixels where nothing is.
    pub(super) background: u32,
}

/// Sums of a pixel.
#[derive(Debug, Clone, Copy, Default)]
struct BlendSums {
    /// Reversed depth of the first pass; 0 where nothing is.
    front: f32,
    /// Color times weight, and weight.
    color: Vec4,
    /// Normal with the axes of the model, and reversed depth, times weight.
    normal: Vec4,
}

impl CpuRenderer {
    /// Sets up what both passes draw, and has `draw` draw it; `is_pushed` where the first pushes triangles away.
    pub(super) fn with_two_passes(
        &mut self,
        frame: &CpuFrame<'_>,
        light: &opaque::FrameHeadlight,
        pixels: &mut PixelWords<'_>,
        is_pushed: bool,
        draw: impl FnOnce(&TwoPassList<'_>, Vec<PolygonBand<'_>>),
    ) -> DrawnCounts {
        self.set_triangles(frame, false);
        if is_pushed {
            let ids = self.cuts.iter().map(|cut| &*cut.triangles);
            let models = frame.drawn.iter().map(|part| part.model);
            let drawn: Vec<(&Model, &[u32])> = models.zip(ids).collect();
            let light = FrameLight::of_frame(frame.constants, frame.corner_screen());
            let is_lit = (self.pushed).set_all(&drawn, Some(light.pushed(frame.constants)));
            debug_assert!(is_lit, "there is a light");
        }
        let first = match is_pushed {
            true => &self.pushed,
            false => &self.triangles,
        };
        self.cuts
            .put_polygons(frame.drawn, false, &mut self.polygons);
        let is_culled = frame.settings.draws_fronts_only(frame.plan.facts.is_closed);
        let depth_offset = frame.constants.depth_offset;
        let polygons: Vec<PushedSplat<'_>> = seen_polygons(&self.polygons, frame.view, is_culled)
            .into_iter()
            .map(|own| PushedSplat::new(own, frame.view, depth_offset))
            .collect();
        let list = TwoPassList {
            triangles: [first, &self.triangles],
            meshes: frame.meshes,
            polygons: &polygons,
            shading: &FrameShading::new(frame.constants),
            view: frame.view,
            settings: frame.settings,
            columns: columns_of(frame, pixels.pitch),
            background: light.background(),
        };
        let planes = self.planes.planes();
        let bands = bands_of(frame, pixels, &mut self.depths, planes);
        draw(&list, bands);
        let triangles = self.triangles_given;
        DrawnCounts {
            splats: self.polygons.len(),
            triangles,
            list_bytes: (size_of_val(&self.polygons[..]) + 12 * triangles) as u64,
        }
    }

    /// Splats from vertices and triangles, blended.
    pub(super) fn draw_blended(
        &mut self,
        frame: &CpuFrame<'_>,
        light: &opaque::FrameHeadlight,
        pixels: &mut PixelWords<'_>,
    ) -> DrawnCounts {
        let depth_of = depth_of_distance(frame);
        let area = pixels_of(frame.context.rect_px);
        self.with_two_passes(frame, light, pixels, false, |list, bands| {
            parallel::share(area, bands.into_iter(), |mut band| {
                let mut sums = vec![BlendSums::default(); band.depths.len()];
                list.leave_depths(&band, &mut sums, depth_of);
                list.blend(&band, &mut sums, depth_of);
                list.normalize(&mut band, &sums);
            });
        })
    }
}

impl BlendSums {
    fn add(&mut self, point: ShadedPoint, depth: f32, weight: f32) {
        self.color += (point.color * weight).extend(weight);
        self.normal += point.normal.extend(depth) * weight;
    }
}

impl TwoPassList<'_> {
    /// First row of a band and one past its last.
    pub(super) fn rows(&self, band: &PolygonBand<'_>) -> [usize; 2] {
        let [_, width, _] = self.columns;
        [band.top, band.top + band.depths.len() / width]
    }

    /// First column and one past the last.
    pub(super) fn ends(&self) -> [usize; 2] {
        let [left, width, _] = self.columns;
        [left, left + width]
    }

    /// Place of a pixel among those of a band.
    pub(super) fn index(&self, band: &PolygonBand<'_>, [x, y]: [usize; 2]) -> usize {
        let [left, width, _] = self.columns;
        (y - band.top) * width + x - left
    }

    /// Pass for depth: the nearest, splats pushed away a little.
    fn leave_depths(
        &self,
        band: &PolygonBand<'_>,
        sums: &mut [BlendSums],
        depth_of: impl Fn(f32) -> f32,
    ) {
        let rows = self.rows(band);
        for NumberedFace { face, .. } in self.triangles[0].near(rows.map(|row| row as u32)) {
            face.for_each_pixel(rows.map(|row| row as u32), |pixel, weights| {
                let front = &mut sums[self.index(band, pixel.map(|at| at as usize))].front;
                *front = front.max(face.depth_at(weights));
            });
        }
        for one in self.polygons {
            one.own.for_each_pixel(self.ends(), rows, |pixel, sample| {
                let front = &mut sums[self.index(band, pixel)].front;
                let depth = depth_of(one.least_pushed_distance(&sample) as f32);
                *front = front.max(depth.min(1.0));
            });
        }
    }

    /// Pass for sums: what the first pass does not hide.
    fn blend(&self, band: &PolygonBand<'_>, sums: &mut [BlendSums], depth_of: impl Fn(f32) -> f32) {
        let is_deferred = self.settings.shading == Shading::Deferred;
        let is_gauss = self.settings.splat == SplatKind::Gauss;
        let rows = self.rows(band);
        let triangles = self.triangles[1];
        for NumberedFace { part, face, .. } in triangles.near(rows.map(|row| row as u32)) {
            let Some(light) = triangles.light() else {
                break;
            };
            let mut surface = None;
            face.for_each_pixel(rows.map(|row| row as u32), |pixel, weights| {
                let depth = face.depth_at(weights);
                let sums = &mut sums[self.index(band, pixel.map(|at| at as usize))];
                if depth < sums.front {
                    return;
                }
                let surface =
                    surface.get_or_insert_with(|| FaceSurface::of(face, part, self.meshes, light));
                let place = face.place_at(pixel, depth);
                let point = match is_deferred {
                    true => self.turned(pixel, light.base_at(surface, &place)),
                    false => light.point_at(surface, &place),
                };
                sums.add(point, depth, 1.0);
            });
        }
        for one in self.polygons {
            let polygon = one.own.polygon;
            let squared = polygon.round_radius * polygon.round_radius;
            one.own.for_each_pixel(self.ends(), rows, |pixel, sample| {
                let depth = depth_of(sample.distance as f32).clamp(0.0, 1.0);
                let sums = &mut sums[self.index(band, pixel)];
                let pulled = depth_of(one.pulled_distance(&sample) as f32);
                if pulled.max(depth).min(1.0) < sums.front {
                    return;
                }
                let point = match is_deferred {
                    true => {
                        let base = self.shading.base_of_polygon(polygon, sample.uv);
                        self.turned(pixel.map(|at| at as u32), base)
                    }
                    false => self.shading.of_polygon(polygon, sample.uv, SPLAT_TINT),
                };
                let [u, v] = sample.uv;
                let weight = match is_gauss {
                    true => (-2.0 * (u * u + v * v) / squared).exp(),
                    false => 1.0,
                };
                sums.add(point, depth, weight);
            });
        }
    }

    /// A point as deferred shading sums it.
    fn turned(&self, pixel: [u32; 2], base: ShadedPoint) -> ShadedPoint {
        ShadedPoint {
            normal: self.shading.turned(pixel, base.normal),
            ..base
        }
    }

    /// Pass for the picture: the weighted means.
    fn normalize(&self, band: &mut PolygonBand<'_>, sums: &[BlendSums]) {
        let [left, width, pitch] = self.columns;
        for (here, sums) in sums.iter().enumerate() {
            let (row, column) = (here / width, here % width);
            let word = row * pitch + column;
            let weight = sums.color.w;
            let is_shown = weight >= LEAST_FUZZY_WEIGHT;
            band.depths[here] = if is_shown { sums.front } else { 0.0 };
            if !is_shown {
                band.colors[word] = self.background;
                continue;
            }
            let mut point = ShadedPoint {
                color: sums.color.truncate() / weight,
                normal: unit_or_zero(sums.normal.truncate()),
            };
            if self.settings.shading == Shading::Deferred {
                let pixel = [left + column, band.top + row].map(|at| at as u32);
                let depth = sums.normal.w / weight;
                point.color = self.shading.of_means(pixel, point, depth);
            }
            band.put([here, word], point);
        }
    }
}
