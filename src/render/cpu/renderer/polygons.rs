//! Oriented polygons beside triangles and splats; and which triangles a frame draws.

use crate::abi::OrientedPolygon;
use crate::pack::ColorBy;
use crate::pack::parallel;
use crate::pack::polygons::ScreenPolygon;
use crate::patches::PatchRaster;
use crate::render::Method;
use crate::render::cpu::float_planes::word_of;
use crate::render::cpu::frame_shading::{FrameShading, PATCH_TINT, SPLAT_TINT, ShadedPoint};
use crate::render::cpu::opaque;
use crate::render::cpu::picture::PixelWords;
use crate::render::cpu::renderer::{CpuFrame, CpuRenderer, DrawnCounts};
use crate::render::cpu::triangles::Light;
use crate::render::model_facts::FactedModel;
use crate::render::technique::Technique;
use crate::tree::Model;
use glam::DVec2;

/// Rows that a thread takes.
const BAND_PX: usize = 16;

/// A polygon where the frame sees it.
struct SeenPolygon<'p> {
    polygon: &'p OrientedPolygon,
    seen: ScreenPolygon,
}

/// Rows of the rectangle that is drawn in.
struct PolygonBand<'a> {
    /// The first, counted from the top of the picture.
    top: usize,
    colors: &'a mut [u32],
    depths: &'a mut [f32],
    values: &'a mut [[f32; 4]],
    normals: &'a mut [[f32; 3]],
}

impl CpuRenderer {
    /// Sets the triangles up that are drawn as such.
    pub(super) fn set_triangles(&mut self, frame: &CpuFrame<'_>, samples_triangles: bool) {
        if !samples_triangles && frame.settings.method == Method::Triangles {
            let all = |part: FactedModel<'_>| (0..part.model.triangles.len() as u32).collect();
            self.triangle_ids = frame.drawn.iter().map(all).collect();
        }
        let is_cut =
            frame.settings.method == Method::Pop || frame.plan.technique == Technique::Polygons;
        let ids: Vec<&[u32]> = match is_cut {
            true if !samples_triangles => self.cuts.iter().map(|cut| &*cut.triangles).collect(),
            _ => self.triangle_ids.iter().map(|ids| &**ids).collect(),
        };
        self.triangles_given = ids.iter().map(|ids| ids.len()).sum();
        let models = frame.drawn.iter().map(|part| part.model);
        let drawn: Vec<(&Model, &[u32])> = models.zip(ids).collect();
        let light = Light::of_frame(frame.constants, frame.corner_screen());
        let is_lit = self.triangles.set_all(&drawn, Some(light));
        debug_assert!(is_lit, "there is a light");
    }

    /// Triangles and splats, then oriented polygons; all with one depth test.
    pub(super) fn draw_polygons(
        &mut self,
        frame: &CpuFrame<'_>,
        light: &opaque::Light,
        pixels: &mut PixelWords<'_>,
    ) -> DrawnCounts {
        let counts = if self.needs_surfaces(frame.settings) {
            self.draw_surfaces(frame, light, pixels)
        } else {
            self.draw_opaque(frame, light, pixels)
        };
        let is_by_level = frame.settings.color_by == ColorBy::Level;
        let polygons = &mut self.polygons;
        self.cuts.put_polygons(frame.drawn, is_by_level, polygons);
        let polygons = &*polygons;
        let are_patches = self.cuts.has_patches();
        if are_patches {
            self.patch_raster.draw(polygons, frame.view);
        }
        let [left, top, right, bottom] = frame.context.rect_px.map(|edge| edge as usize);
        let width = right.saturating_sub(left);
        if width > 0 && bottom > top {
            let pitch = pixels.pitch;
            let words = pixels.from(frame.context.rect_px);
            let length = ((bottom - top - 1) * pitch + width).min(words.len());
            let planes = self.planes.planes();
            let mut values = planes.values.chunks_mut(BAND_PX * width);
            let mut normals = planes.normals.chunks_mut(BAND_PX * width);
            let depths = self.depths[..width * (bottom - top)].chunks_mut(BAND_PX * width);
            let bands: Vec<PolygonBand<'_>> = (words[..length].chunks_mut(BAND_PX * pitch))
                .zip(depths)
                .enumerate()
                .map(|(number, (colors, depths))| PolygonBand {
                    top: top + number * BAND_PX,
                    colors,
                    depths,
                    values: values.next().unwrap_or_default(),
                    normals: normals.next().unwrap_or_default(),
                })
                .collect();
            let shading = FrameShading::new(frame.constants);
            let clip = frame.constants.clip_from_view;
            let depth_of = |distance: f32| {
                let last = clip[3][3] - clip[2][3] * distance;
                (clip[3][2] - clip[2][2] * distance) / last
            };
            let seen = match are_patches {
                true => Vec::new(),
                false => seen_polygons(polygons, frame),
            };
            let raster = &self.patch_raster;
            parallel::share(width * (bottom - top), bands.into_iter(), |mut band| {
                if are_patches {
                    let patches = (raster, &polygons[..]);
                    band.show(patches, [left, width, pitch], &shading, depth_of);
                }
                for one in &seen {
                    band.draw(one, [left, width, pitch], &shading, depth_of);
                }
            });
        }
        DrawnCounts {
            splats: counts.splats + polygons.len(),
            list_bytes: counts.list_bytes + size_of_val(&polygons[..]) as u64,
            ..counts
        }
    }
}

/// Polygons that the frame sees, in their order.
fn seen_polygons<'p>(splats: &'p [OrientedPolygon], frame: &CpuFrame<'_>) -> Vec<SeenPolygon<'p>> {
    let is_culled = frame.settings.draws_fronts_only(frame.plan.facts.is_closed);
    (splats.iter())
        .filter(|polygon| !is_culled || polygon.faces(frame.view))
        .filter_map(|polygon| {
            Some(SeenPolygon {
                polygon,
                seen: ScreenPolygon::of(polygon, frame.view)?,
            })
        })
        .collect()
}

impl PolygonBand<'_> {
    /// Draws a polygon where it is nearest. The columns are the first, how many, and words from a row to the next.
    fn draw(
        &mut self,
        one: &SeenPolygon<'_>,
        [left, width, pitch]: [usize; 3],
        shading: &FrameShading,
        depth_of: impl Fn(f32) -> f32,
    ) {
        let rows = self.depths.len() / width;
        let [low, high] = one.seen.bounds();
        // Pixels whose centers lie between; casts saturate at 0.
        let first_row = ((low.y - 0.5).ceil() as usize).clamp(self.top, self.top + rows);
        let end_row = ((high.y - 0.5).floor() + 1.0) as usize;
        for y in first_row..end_row.min(self.top + rows) {
            let at_y = y as f64 + 0.5;
            let [from, to] = one.seen.span(at_y);
            if from > to {
                continue;
            }
            let first = ((from - 0.5).ceil() as usize).max(left);
            let end = (((to - 0.5).floor() + 1.0) as usize).min(left + width);
            for x in first..end {
                let at = DVec2::new(x as f64 + 0.5, at_y);
                let is_widened = one.seen.margin_px() > 0.0;
                let sample = match is_widened {
                    true => one.seen.sample(at),
                    false => one.seen.sample_inside(at),
                };
                let Some(sample) = sample else {
                    continue;
                };
                let depth = depth_of(sample.distance as f32).clamp(0.0, 1.0);
                let (row, column) = (y - self.top, x - left);
                if self.wins(row * width + column, depth) {
                    let point = shading.of_polygon(one.polygon, sample.uv, SPLAT_TINT);
                    self.put([row * width, row * pitch].map(|from| from + column), point);
                }
            }
        }
    }

    /// Shows the patches of a picture where they are nearest.
    fn show(
        &mut self,
        (raster, patches): (&PatchRaster, &[OrientedPolygon]),
        [left, width, pitch]: [usize; 3],
        shading: &FrameShading,
        depth_of: impl Fn(f32) -> f32,
    ) {
        for row in 0..self.depths.len() / width {
            let found = raster.row(patches, (self.top + row) as u32, left as u32);
            for (column, pixel) in found.take(width).enumerate() {
                let Some(pixel) = pixel else { continue };
                // Nothing that is widened is out of the view.
                let depth = depth_of(pixel.distance).clamp(f32::MIN_POSITIVE, 1.0);
                if self.wins(row * width + column, depth) {
                    let patch = &patches[pixel.id as usize];
                    let point = shading.of_polygon(patch, pixel.uv, PATCH_TINT);
                    self.put([row * width, row * pitch].map(|from| from + column), point);
                }
            }
        }
    }

    /// Whether a depth is nearer than what is there; it stays then.
    fn wins(&mut self, here: usize, depth: f32) -> bool {
        let is_nearer = depth > self.depths[here];
        if is_nearer {
            self.depths[here] = depth;
        }
        is_nearer
    }

    /// Writes a point, at a place among depths and one among words.
    fn put(&mut self, [here, word]: [usize; 2], point: ShadedPoint) {
        let value = point.color.extend(1.0);
        self.colors[word] = word_of(value);
        if let Some(own) = self.values.get_mut(here) {
            *own = value.to_array();
        }
        if let Some(own) = self.normals.get_mut(here) {
            *own = point.normal.to_array();
        }
    }
}
