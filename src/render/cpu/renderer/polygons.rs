//! Oriented polygons beside triangles and splats; and which triangles a frame draws.

use crate::abi::OrientedPolygon;
use crate::pack::ColorBy;
use crate::pack::parallel;
use crate::patches::{PatchRaster, PatchTarget, RimPicture};
use crate::render::Method;
use crate::render::cpu::float_planes::word_of;
use crate::render::cpu::frame_shading::{FrameShading, PATCH_TINT, SPLAT_TINT, ShadedPoint};
use crate::render::cpu::opaque;
use crate::render::cpu::picture::PixelWords;
use crate::render::cpu::renderer::{CpuFrame, CpuRenderer, DrawnCounts};
use crate::render::cpu::seen_polygon::{SeenPolygon, seen_polygons};
use crate::render::cpu::triangles::FrameLight;
use crate::render::model_facts::FactedModel;
use crate::render::part_cuts::PatchPlaces;
use crate::tree::Model;

/// Rows that a thread takes.
pub(super) const BAND_PX: usize = 16;

/// Rows of the rectangle that is drawn in.
pub(super) struct PolygonBand<'a> {
    /// The first, counted from the top of the picture.
    pub(super) top: usize,
    pub(super) colors: &'a mut [u32],
    pub(super) depths: &'a mut [f32],
    pub(super) values: &'a mut [[f32; 4]],
    pub(super) normals: &'a mut [[f32; 3]],
}

/// Patches whose nearest are known.
struct ShownPatches<'a> {
    raster: &'a PatchRaster,
    polygons: &'a [OrientedPolygon],
    /// One each where images are shown, else none.
    textures: &'a PatchPlaces,
}

impl CpuRenderer {
    /// Sets the triangles up that are drawn as such.
    pub(super) fn set_triangles(&mut self, frame: &CpuFrame<'_>, samples_triangles: bool) {
        if !samples_triangles && frame.settings.method == Method::Triangles {
            let all = |part: FactedModel<'_>| (0..part.model.triangles.len() as u32).collect();
            self.triangle_ids = frame.drawn.iter().map(all).collect();
        }
        let is_cut =
            frame.settings.method == Method::Pop || frame.settings.drawn_polygons().is_some();
        let ids: Vec<&[u32]> = match is_cut {
            true if !samples_triangles => self.cuts.iter().map(|cut| &*cut.triangles).collect(),
            _ => self.triangle_ids.iter().map(|ids| &**ids).collect(),
        };
        self.triangles_given = ids.iter().map(|ids| ids.len()).sum();
        let models = frame.drawn.iter().map(|part| part.model);
        let drawn: Vec<(&Model, &[u32])> = models.zip(ids).collect();
        let light = FrameLight::of_frame(frame.constants, frame.corner_screen());
        let is_lit = self.triangles.set_all(&drawn, Some(light));
        debug_assert!(is_lit, "there is a light");
    }

    /// Triangles and splats, then oriented polygons; all with one depth test.
    pub(super) fn draw_polygons(
        &mut self,
        frame: &CpuFrame<'_>,
        light: &opaque::FrameHeadlight,
        pixels: &mut PixelWords<'_>,
    ) -> DrawnCounts {
        let counts = if self.needs_surfaces(frame.settings) {
            self.draw_surfaces(frame, light, pixels)
        } else {
            self.draw_opaque(frame, light, pixels)
        };
        if self.cuts.has_patches() {
            return self.draw_patches(frame, counts, pixels);
        }
        let polygons = &mut self.polygons;
        self.cuts.put_polygons(frame.drawn, false, polygons);
        let polygons = &*polygons;
        let columns = columns_of(frame, pixels.pitch);
        let planes = self.planes.planes();
        let bands = bands_of(frame, pixels, &mut self.depths, planes);
        let shading = FrameShading::new(frame.constants);
        let depth_of = depth_of_distance(frame);
        let is_culled = frame.settings.draws_fronts_only(frame.plan.facts.is_closed);
        let seen = seen_polygons(polygons, frame.view, is_culled);
        let area = pixels_of(frame.context.rect_px);
        parallel::share(area, bands.into_iter(), |mut band| {
            for one in &seen {
                band.draw(one, columns, &shading, depth_of);
            }
        });
        DrawnCounts {
            splats: counts.splats + polygons.len(),
            list_bytes: counts.list_bytes + size_of_val(&polygons[..]) as u64,
            ..counts
        }
    }
}

impl CpuRenderer {
    /// Patches, in a picture that holds all else: by vectors in the headlight, else pixel by pixel once it is known which is
    /// seen.
    fn draw_patches(
        &mut self,
        frame: &CpuFrame<'_>,
        counts: DrawnCounts,
        pixels: &mut PixelWords<'_>,
    ) -> DrawnCounts {
        let lists = self.cuts.patch_lists(frame.drawn);
        let count: usize = lists.iter().map(|list| list.ids.len()).sum();
        let rect_px = frame.context.rect_px;
        let depths = &mut self.depths[..pixels_of(rect_px)];
        let shading = FrameShading::new(frame.constants);
        let outputs = self.planes.outputs();
        let textures = match frame.plan.primitives.textures_patches {
            true => self.cuts.joined_patch_textures(frame.drawn),
            false => PatchPlaces::default(),
        };
        let mut list_bytes = size_of::<u32>() * count + size_of_val(&textures.places[..]);
        let covers_rims = frame.plan.primitives.covers_rims;
        let has_values = outputs.values || outputs.normal;
        if shading.has_headlight() && !has_values && textures.places.is_empty() {
            let target = PatchTarget {
                pitch: pixels.pitch,
                colors: pixels.from(rect_px),
                depths,
                rect_px,
                keeps_numbers: covers_rims,
            };
            let light = shading.patch_light();
            self.patch_raster.draw(&lists, frame.view, &light, target);
        } else {
            let raster = &mut self.patch_raster;
            raster.draw_numbers(&lists, frame.view, depths, rect_px);
            let is_by_level = frame.settings.color_by == ColorBy::Level;
            let polygons = &mut self.polygons;
            self.cuts.put_polygons(frame.drawn, is_by_level, polygons);
            list_bytes += size_of_val(&polygons[..]);
            let shown = ShownPatches {
                raster,
                polygons,
                textures: &textures,
            };
            let columns = columns_of(frame, pixels.pitch);
            let planes = self.planes.planes();
            let bands = bands_of(frame, pixels, depths, planes);
            parallel::share(pixels_of(rect_px), bands.into_iter(), |mut band| {
                band.show(&shown, columns, &shading);
            });
        }
        if covers_rims {
            let picture = RimPicture {
                pitch: pixels.pitch,
                colors: pixels.from(rect_px),
                depths: &self.depths[..pixels_of(rect_px)],
                values: self.planes.planes().values,
            };
            let lists = self.cuts.patch_lists(frame.drawn);
            self.patch_raster.cover_rims(&lists, picture);
        }
        DrawnCounts {
            splats: counts.splats + count,
            list_bytes: counts.list_bytes + list_bytes as u64,
            ..counts
        }
    }
}

/// Reversed depth of a distance along the view direction, of a frame; unbounded.
pub(super) fn depth_of_distance(frame: &CpuFrame<'_>) -> impl Fn(f32) -> f32 + Copy + Sync + use<> {
    let clip = frame.constants.clip_from_view;
    move |distance| {
        let last = clip[3][3] - clip[2][3] * distance;
        (clip[3][2] - clip[2][2] * distance) / last
    }
}

pub(super) fn pixels_of([left, top, right, bottom]: [u32; 4]) -> usize {
    right.saturating_sub(left) as usize * bottom.saturating_sub(top) as usize
}

/// The first column, how many there are, and words from a row to the next.
pub(super) fn columns_of(frame: &CpuFrame<'_>, pitch: usize) -> [usize; 3] {
    let [left, _, right, _] = frame.context.rect_px.map(|edge| edge as usize);
    [left, right.saturating_sub(left), pitch]
}

/// Bands of the rectangle that is drawn in.
pub(super) fn bands_of<'a>(
    frame: &CpuFrame<'_>,
    pixels: &'a mut PixelWords<'_>,
    depths: &'a mut [f32],
    planes: opaque::SurfacePlanes<'a>,
) -> Vec<PolygonBand<'a>> {
    let rect_px = frame.context.rect_px;
    let [left, top, right, bottom] = rect_px.map(|edge| edge as usize);
    if right <= left || bottom <= top {
        return Vec::new();
    }
    let (width, pitch) = (right - left, pixels.pitch);
    let words = pixels.from(rect_px);
    let length = ((bottom - top - 1) * pitch + width).min(words.len());
    let mut values = planes.values.chunks_mut(BAND_PX * width);
    let mut normals = planes.normals.chunks_mut(BAND_PX * width);
    let depths = depths[..width * (bottom - top)].chunks_mut(BAND_PX * width);
    (words[..length].chunks_mut(BAND_PX * pitch))
        .zip(depths)
        .enumerate()
        .map(|(number, (colors, depths))| PolygonBand {
            top: top + number * BAND_PX,
            colors,
            depths,
            values: values.next().unwrap_or_default(),
            normals: normals.next().unwrap_or_default(),
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
        let rows = [self.top, self.top + self.depths.len() / width];
        let top = self.top;
        one.for_each_pixel([left, left + width], rows, |[x, y], sample| {
            let depth = depth_of(sample.distance as f32).clamp(0.0, 1.0);
            let (row, column) = (y - top, x - left);
            if self.wins(row * width + column, depth) {
                let point = shading.of_polygon(one.polygon, sample.uv, SPLAT_TINT);
                self.put([row * width, row * pitch].map(|from| from + column), point);
            }
        });
    }

    /// Shows the patches that are nearest, whose depths are there.
    fn show(
        &mut self,
        patches: &ShownPatches<'_>,
        [left, width, pitch]: [usize; 3],
        shading: &FrameShading,
    ) {
        for here in 0..self.depths.len() {
            let (row, column) = (here / width, here % width);
            let pixel = [left + column, self.top + row].map(|at| at as u32);
            let depth = self.depths[here];
            if let Some(found) = patches.raster.pixel(patches.polygons, pixel, depth) {
                let number = found.number as usize;
                let patch = &patches.polygons[number];
                let PatchPlaces { places, images } = patches.textures;
                let point = match places.get(number) {
                    Some(texture) => shading.of_textured(patch, found.uv, (texture, images)),
                    None => shading.of_polygon(patch, found.uv, PATCH_TINT),
                };
                self.put([here, row * pitch + column], point);
            }
        }
    }

    /// Tells whether a depth is nearer than what is there; it stays then.
    fn wins(&mut self, here: usize, depth: f32) -> bool {
        let is_nearer = depth > self.depths[here];
        if is_nearer {
            self.depths[here] = depth;
        }
        is_nearer
    }

    /// Writes a point, at a place among depths and one among words.
    pub(super) fn put(&mut self, [here, word]: [usize; 2], point: ShadedPoint) {
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
