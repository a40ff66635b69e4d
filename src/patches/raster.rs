//! Patches drawn fast by the processor: depth and number of the nearest patch in each pixel, then one shade a pixel.
//!
//! As [`crate::patches::draw`] in single precision, four pixels at a time. A patch is the pixels whose signed distance from every
//! side of its footprint on the picture is at least minus the margin, and that lie between its ends along its longer axis: at
//! sharp corners sides alone would reach far beyond. Depths are kept as their inverse in a perspective, which is linear on the
//! picture. The picture is divided into bands of rows, which threads draw one by one.

use crate::abi::OrientedPolygon;
#[cfg(test)]
use crate::image::{Image, unorm8};
#[cfg(test)]
use crate::math::camera::Light;
use crate::math::camera::View;
#[cfg(test)]
use crate::pack::ALBEDO;
use crate::threads::{self, share};
use glam::{Mat3, Vec2, Vec3, Vec4};

/// Linear forms of a patch: its sides, and its two ends.
const FORMS: usize = MOST_CORNERS + 2;

const MOST_CORNERS: usize = OrientedPolygon::MOST_CORNERS;

/// Rows of a band.
const BAND_ROWS: usize = 32;

/// A patch that is no number where nothing is drawn.
const NOTHING: u32 = u32::MAX;

/// Draws patches, and keeps its memory from one picture to the next: 8 bytes a pixel, 4 for each band that a patch lies in.
#[derive(Debug)]
pub struct PatchRaster {
    threads: usize,
    width: u32,
    height: u32,
    /// Pixels of a row in memory.
    stride: usize,
    bands: Vec<RowBand>,
    /// The view of the last picture.
    view: Option<RasterView>,
}

/// What of the nearest patch a pixel shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchPixel {
    /// Number of the polygon.
    pub id: u32,
    /// Distance along the view direction, view-space units.
    pub distance: f32,
    /// Coordinates of the foot in the plane.
    pub uv: [f32; 2],
}

/// Some rows of the picture.
#[derive(Debug, Default)]
struct RowBand {
    /// Patches whose balls touch it.
    ids: Vec<u32>,
    /// The larger the nearer.
    nearness: Vec<f32>,
    nearest: Vec<u32>,
}

/// A view, as patches need it.
#[derive(Debug, Clone, Copy)]
struct RasterView {
    rotation: Mat3,
    translation: Vec3,
    /// The ray of a window position p is (p * scale + offset, -1); of parallel rays that is their place.
    ray_scale: Vec2,
    ray_offset: Vec2,
    focal_px: f32,
    near: f32,
    far: f32,
    model_scale: f32,
    is_perspective: bool,
}

impl RasterView {
    fn new(view: &View) -> Self {
        let size = Vec2::new(view.width as f32, view.height as f32);
        let scale = Vec2::from_array(view.scale);
        let offset = Vec2::from_array(view.offset);
        let shift = if view.is_perspective { offset } else { -offset };
        let matrix = view.view_from_model;
        Self {
            rotation: Mat3::from_mat4(matrix),
            translation: matrix.w_axis.truncate(),
            ray_scale: Vec2::new(2.0, -2.0) / size / scale,
            ray_offset: (Vec2::new(-1.0, 1.0) + shift) / scale,
            focal_px: view.focal_px(),
            near: view.near,
            far: view.far,
            model_scale: view.model_scale,
            is_perspective: view.is_perspective,
        }
    }

    fn place(&self, point: Vec3) -> Vec3 {
        self.rotation * point + self.translation
    }

    /// Window position of a view-space point; what lies before the near plane counts as on it.
    fn window(&self, point: Vec3) -> Vec2 {
        let ray = if self.is_perspective {
            point.truncate() / (-point.z).max(self.near)
        } else {
            point.truncate()
        };
        (ray - self.ray_offset) / self.ray_scale
    }

    /// How far on the picture a view-space point is from another one, given the way to it: without the rounding of positions.
    fn window_way(&self, from: Vec3, way: Vec3) -> Vec2 {
        let ray = if self.is_perspective {
            let [depth, other] = [-from.z, (-from.z - way.z).max(self.near)];
            (way.truncate() * depth + from.truncate() * way.z) / (depth * other)
        } else {
            way.truncate()
        };
        ray / self.ray_scale
    }

    /// The view-space point of a window position at a distance.
    fn point(&self, at: Vec2, distance: f32) -> Vec3 {
        let ray = at * self.ray_scale + self.ray_offset;
        if self.is_perspective {
            (ray * distance).extend(-distance)
        } else {
            ray.extend(-distance)
        }
    }

    /// What is compared between patches: the larger the nearer.
    fn nearness(&self, distance: f32) -> f32 {
        if self.is_perspective {
            1.0 / distance
        } else {
            -distance
        }
    }

    fn distance(&self, nearness: f32) -> f32 {
        if self.is_perspective {
            1.0 / nearness
        } else {
            -nearness
        }
    }
}

/// A patch on the picture. Positions are counted from its middle.
struct RasterPatch {
    /// Where the origin of the plane lies on the picture.
    middle: Vec2,
    /// Signed distances in pixels: x, y and constant of each form.
    forms: [Vec3; FORMS],
    /// Change of the nearness along x and y, and that of the middle.
    slope: Vec3,
    /// Least and greatest nearness.
    limits: [f32; 2],
    margin_px: f32,
    thickness: f32,
    low: Vec2,
    high: Vec2,
}

impl RasterPatch {
    /// `None` where it covers nothing.
    fn new(view: &RasterView, patch: &OrientedPolygon) -> Option<Self> {
        let origin = view.place(patch.center);
        let [u, v] = [patch.axis, patch.second_axis()].map(|axis| view.rotation * axis);
        let normal = u.cross(v) / (view.model_scale * view.model_scale);
        let thickness = patch.thickness * view.model_scale;
        let corners = patch.footprint();
        let count = corners.len();
        let mut places = [Vec2::ZERO; MOST_CORNERS];
        let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        let (mut nearest, mut farthest) = (f32::INFINITY, f32::NEG_INFINITY);
        let (mut sine_squared, mut least_cosine) = (0.0f32, 1.0f32);
        let off = normal.dot(origin);
        for (place, &[along_u, along_v]) in places.iter_mut().zip(corners) {
            let way = u * along_u + v * along_v;
            let point = origin + way;
            *place = view.window_way(origin, way);
            (low, high) = (low.min(*place), high.max(*place));
            (nearest, farthest) = (nearest.min(-point.z), farthest.max(-point.z));
            let squared = point.length_squared();
            sine_squared = sine_squared.max(1.0 - off * off / squared);
            least_cosine = least_cosine.min(-point.z / squared.sqrt());
        }
        let margin_px = if view.is_perspective {
            let scale = view.focal_px / (nearest - thickness).max(view.near);
            thickness * scale * sine_squared.max(0.0).sqrt() / least_cosine.max(0.1)
        } else {
            thickness * view.focal_px * (1.0 - normal.z * normal.z).max(0.0).sqrt()
        };
        // A little for rounding.
        let margin_px = margin_px + 1e-3;
        let mut forms = [Vec3::new(0.0, 0.0, f32::INFINITY); FORMS];
        let mut area = 0.0;
        for i in 1..count - 1 {
            area += (places[i] - places[0]).perp_dot(places[i + 1] - places[0]);
        }
        let size_squared = (high - low).length_squared();
        let (mut longest, mut direction) = (0.0, Vec2::X);
        for i in 0..count {
            let [from, to] = [places[i], places[(i + 1) % count]];
            let edge = to - from;
            let squared = edge.length_squared();
            if squared > longest {
                (longest, direction) = (squared, edge);
            }
            // Rounding turns what is far shorter than the longest side.
            if squared > 1e-8 * size_squared && area.abs() > 1e-6 * size_squared {
                let inward = edge.perp() * (area.signum() / squared.sqrt());
                forms[i] = inward.extend(-inward.dot(from));
            }
        }
        // Ends along the longest side, and where there is no area along what is across as well.
        let along = direction.normalize_or(Vec2::X);
        let ends = |along: Vec2| {
            let reach = places[..count].iter().map(|place| place.dot(along));
            reach.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], at| {
                [low.min(at), high.max(at)]
            })
        };
        let [first, last] = ends(along);
        forms[MOST_CORNERS] = along.extend(-first);
        forms[MOST_CORNERS + 1] = (-along).extend(last);
        if area.abs() <= 1e-6 * size_squared {
            let across = along.perp();
            let [first, last] = ends(across);
            forms[0] = across.extend(-first);
            forms[1] = (-across).extend(last);
        }
        let limits = [farthest + thickness, (nearest - thickness).max(view.near)];
        let limits = limits.map(|distance| view.nearness(distance.clamp(view.near, view.far)));
        let middle = view.window(origin);
        Some(Self {
            middle,
            forms,
            slope: Self::slope(view, normal, origin),
            limits,
            margin_px,
            thickness,
            low: middle + low - margin_px,
            high: middle + high + margin_px,
        })
        .filter(|patch| patch.low.is_finite() && patch.high.is_finite())
    }

    /// Change of the nearness of the plane along x and y, none edge-on, and that of its origin.
    fn slope(view: &RasterView, normal: Vec3, origin: Vec3) -> Vec3 {
        let along = if view.is_perspective {
            // The ray is t (x, y, -1), and t the distance: 1 / t = n . (x, y, -1) / n . o
            normal.truncate() * view.ray_scale / normal.dot(origin)
        } else {
            // n . (x, y, z) = n . o, and the nearness is z.
            -normal.truncate() * view.ray_scale / normal.z
        };
        let along = if along.is_finite() { along } else { Vec2::ZERO };
        along.extend(view.nearness(-origin.z))
    }
}

impl Default for PatchRaster {
    /// As many threads as the machine runs at once, at most 16.
    fn default() -> Self {
        Self::with_threads(threads::count())
    }
}

impl PatchRaster {
    /// Uses up to `threads` threads, the calling one included; 0 counts as 1.
    pub fn with_threads(threads: usize) -> Self {
        Self {
            threads: threads.max(1),
            width: 0,
            height: 0,
            stride: 0,
            bands: Vec::new(),
            view: None,
        }
    }

    /// Draws patches into an empty picture.
    pub fn draw(&mut self, patches: &[OrientedPolygon], view: &View) {
        let raster = RasterView::new(view);
        self.view = Some(raster);
        (self.width, self.height) = (view.width, view.height);
        self.stride = view.width as usize + 4;
        let count = (view.height as usize).div_ceil(BAND_ROWS);
        self.bands.resize_with(count, RowBand::default);
        for band in &mut self.bands {
            band.ids.clear();
        }
        for (id, patch) in patches.iter().enumerate() {
            let [first, last] = rows_of(&raster, patch);
            let last = (last / BAND_ROWS as f32).min(count as f32 - 1.0);
            // Casts saturate, and take what is no number to 0.
            let (first, last) = ((first / BAND_ROWS as f32).max(0.0) as usize, last as isize);
            for band in first..(last + 1).max(0) as usize {
                self.bands[band].ids.push(id as u32);
            }
        }
        let (stride, width) = (self.stride, self.width as usize);
        let bands = self.bands.iter_mut().enumerate();
        share(&mut vec![(); self.threads], bands, |(), (index, band)| {
            let top = index * BAND_ROWS;
            let rows = BAND_ROWS.min(view.height as usize - top);
            band.clear(rows * stride);
            for at in 0..band.ids.len() {
                let id = band.ids[at];
                if let Some(patch) = RasterPatch::new(&raster, &patches[id as usize]) {
                    band.fill(&raster, &patch, id, [top, rows, width, stride]);
                }
            }
        });
    }

    /// The nearest patch in each pixel of columns `from..` of a row of the last picture; `None` where there is none. `patches`
    /// are those that were drawn.
    pub fn row<'r>(
        &'r self,
        patches: &'r [OrientedPolygon],
        y: u32,
        from: u32,
    ) -> impl Iterator<Item = Option<PatchPixel>> + 'r {
        let (band, row) = (y as usize / BAND_ROWS, y as usize % BAND_ROWS);
        let band = self.bands.get(band).zip(self.view);
        let start = row * self.stride;
        (from..self.width).map(move |x| {
            let (band, view) = band?;
            let at = start + x as usize;
            let &id = band.nearest.get(at).filter(|id| **id != NOTHING)?;
            let patch = patches.get(id as usize)?;
            let distance = view.distance(*band.nearness.get(at)?);
            let place = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let point = view.point(place, distance);
            Some(PatchPixel {
                id,
                distance,
                uv: foot_of(&view, patch, point).to_array(),
            })
        })
    }

    /// The picture of the patches last drawn: `patches` and `view` are those of that time.
    #[cfg(test)]
    fn picture(&self, patches: &[OrientedPolygon], view: &View, background: [f32; 3]) -> Image {
        let raster = RasterView::new(view);
        let [r, g, b] = background;
        let pixels = self.width as usize * self.height as usize;
        let mut values = vec![[r, g, b, 0.0]; pixels];
        let mut depth = vec![f32::INFINITY; pixels];
        let row_pixels = (self.width as usize).max(1) * BAND_ROWS;
        let rows = values
            .chunks_mut(row_pixels)
            .zip(depth.chunks_mut(row_pixels));
        let work = self.bands.iter().zip(rows).enumerate();
        share(
            &mut vec![(); self.threads],
            work,
            |(), (index, (band, (values, depth)))| {
                for at in 0..values.len() {
                    let (x, y) = (at % self.width as usize, at / self.width as usize);
                    let from = y * self.stride + x;
                    let id = band.nearest[from];
                    if id == NOTHING {
                        continue;
                    }
                    let place = Vec2::new(x as f32 + 0.5, (y + index * BAND_ROWS) as f32 + 0.5);
                    let distance = raster.distance(band.nearness[from]);
                    depth[at] = distance;
                    let patch = &patches[id as usize];
                    values[at] = shade(&raster, view.light, patch, raster.point(place, distance));
                }
            },
        );
        let bytes = |value: &[f32; 4]| value.map(|v| unorm8(f64::from(v)));
        Image {
            width: self.width,
            height: self.height,
            color: values.iter().map(bytes).collect(),
            depth,
            normal: Vec::new(),
            values,
        }
    }
}

/// First and last row that a patch may touch.
fn rows_of(view: &RasterView, patch: &OrientedPolygon) -> [f32; 2] {
    let origin = view.place(patch.center);
    let corners = patch.footprint().iter();
    let squared = corners.map(|[u, v]| u * u + v * v).fold(0.0, f32::max);
    let reach = (squared + patch.thickness * patch.thickness).sqrt() * view.model_scale;
    let row = view.window(origin).y;
    let nearest = -origin.z - reach;
    let px = if !view.is_perspective {
        reach * view.focal_px
    } else if nearest > view.near {
        // Off the axis a ball is longer; twice the thickness for the margin.
        let aside = origin.truncate().length() / -origin.z;
        (reach + 2.0 * patch.thickness * view.model_scale) * view.focal_px / nearest * (1.0 + aside)
    } else {
        f32::INFINITY
    };
    [row - px - 1.0, row + px + 1.0]
}

/// Coordinates of the foot of a view-space point, within the rectangle around the footprint.
fn foot_of(view: &RasterView, patch: &OrientedPolygon, point: Vec3) -> Vec2 {
    let [u, v] =
        [patch.axis, patch.second_axis()].map(|axis| view.rotation * axis / view.model_scale);
    let offset = (point - view.place(patch.center)) / view.model_scale;
    let corners = patch.footprint().iter().copied().map(Vec2::from_array);
    let (low, high) = corners.fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), at| {
        (low.min(at), high.max(at))
    });
    Vec2::new(offset.dot(u), offset.dot(v)).clamp(low, high)
}

/// Color of a patch at a view-space point.
#[cfg(test)]
fn shade(view: &RasterView, light: Light, patch: &OrientedPolygon, point: Vec3) -> [f32; 4] {
    let foot = foot_of(view, patch, point).to_array();
    let to_light = match light {
        Light::Point if view.is_perspective => -point,
        _ => Vec3::Z,
    };
    let normal = view.rotation * patch.normal_at(foot);
    let length = (normal.length_squared() * to_light.length_squared()).sqrt();
    let facing = normal.dot(to_light).abs() / length.max(f32::MIN_POSITIVE);
    let lit = ALBEDO * patch.light_share() * facing;
    let [r, g, b] = (patch.color_at(foot) * lit).to_array();
    [r, g, b, 1.0]
}

impl RowBand {
    fn clear(&mut self, pixels: usize) {
        self.nearness.clear();
        self.nearness.resize(pixels, f32::NEG_INFINITY);
        self.nearest.clear();
        self.nearest.resize(pixels, NOTHING);
    }

    /// Draws a patch into rows `top..top + rows` of a picture.
    fn fill(
        &mut self,
        view: &RasterView,
        patch: &RasterPatch,
        id: u32,
        [top, rows, width, stride]: [usize; 4],
    ) {
        let range = |low: f32, high: f32, first: usize, count: usize| {
            let from = ((low - 0.5).ceil().max(first as f32) as usize).min(first + count);
            let to = (high + 0.5)
                .floor()
                .clamp(first as f32, (first + count) as f32) as usize;
            from..to.max(from)
        };
        let columns = range(patch.low.x, patch.high.x, 0, width);
        let lanes = Vec4::new(0.5, 1.5, 2.5, 3.5);
        for y in range(patch.low.y, patch.high.y, top, rows) {
            let row = y as f32 + 0.5 - patch.middle.y;
            let at_row = patch.forms.map(|form| form.y * row + form.z);
            let near_row = patch.slope.y * row + patch.slope.z;
            let start = (y - top) * stride;
            for x in columns.clone().step_by(4) {
                let xs = lanes + (x as f32 - patch.middle.x);
                let mut least = Vec4::INFINITY;
                for (form, at_row) in patch.forms.iter().zip(at_row) {
                    least = least.min(xs * form.x + at_row);
                }
                let there = xs.cmplt(Vec4::splat(columns.end as f32 - patch.middle.x));
                let inside = least.cmpge(Vec4::splat(-patch.margin_px)) & there;
                if !inside.any() {
                    continue;
                }
                let [low, high] = patch.limits.map(Vec4::splat);
                let mut nearness = (xs * patch.slope.x + near_row).max(low).min(high);
                let beside = least.cmplt(Vec4::ZERO);
                if (beside & inside).any() {
                    let pushed = pushed_back(view, patch, nearness, -least);
                    nearness = Vec4::select(beside, pushed, nearness);
                }
                let place = start + x;
                let (Some(depths), Some(ids)) = (
                    self.nearness.get_mut(place..place + 4),
                    self.nearest.get_mut(place..place + 4),
                ) else {
                    continue;
                };
                let known = Vec4::from_slice(depths);
                let wins = nearness.cmpgt(known) & inside;
                Vec4::select(wins, nearness, known).write_to_slice(depths);
                for (lane, to) in ids.iter_mut().enumerate() {
                    if wins.test(lane) {
                        *to = id;
                    }
                }
            }
        }
    }
}

/// Nearness of what lies so many pixels beside a footprint: farther by the thickness and that, up to the far plane.
#[inline(always)]
fn pushed_back(view: &RasterView, patch: &RasterPatch, nearness: Vec4, beside_px: Vec4) -> Vec4 {
    if view.is_perspective {
        let distance = Vec4::ONE / nearness;
        let farther = distance * (Vec4::ONE + beside_px / view.focal_px) + patch.thickness;
        Vec4::ONE / farther.min(Vec4::splat(view.far))
    } else {
        let farther = -nearness + patch.thickness + beside_px / view.focal_px;
        -farther.min(Vec4::splat(view.far))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patches::tests::{
        PatchedModel, model_of, settings_of, tolerances, uncovered, view_from_anywhere,
    };
    use crate::patches::{PatchStyle, draw};

    /// The fast picture is the exact one but for single pixels at edges, misses none, and does not depend on threads.
    #[test]
    fn the_fast_picture_is_the_exact_one() {
        let mut state = 51;
        let (mut differing, mut covered) = (0, 0);
        for spec in ["sphere:8000", "torus:8000", "statue:8000"] {
            let patched = PatchedModel::new(model_of(spec));
            let mut rasters = [1, 3].map(PatchRaster::with_threads);
            for round in 0..60 {
                let view = view_from_anywhere(&patched.model, 97, &mut state);
                let e = [0.15, 0.5, 1.0][round % 3];
                let settings = settings_of(&patched.model, tolerances(e, e, 60.0));
                let mut cut = patched.cut(&view, &settings);
                cut.rest.clear();
                let style = PatchStyle::default();
                let exact = draw(&patched.model, &patched.patches, &cut, &view, &style).image;
                let polygon = |&id: &u32| patched.patches.records[id as usize].polygon();
                let polygons: Vec<_> = cut.patches.iter().map(polygon).collect();
                let [one, three] = [0, 1].map(|i: usize| {
                    rasters[i].draw(&polygons, &view);
                    rasters[i].picture(&polygons, &view, style.background)
                });
                assert_eq!(one, three);
                let missed = uncovered(&exact, &one);
                assert!(missed.is_empty(), "{spec}, round {round}: {missed:?}");
                covered += exact.covered_pixels();
                let both = exact.values.iter().zip(&one.values);
                let is_off = |(a, b): &(&[f32; 4], &[f32; 4])| {
                    a[3] != b[3] || (a[0] - b[0]).abs() > 2.0 / 255.0
                };
                differing += both.filter(is_off).count() as u64;
            }
        }
        // Mostly in margins of up to a pixel, which end square here.
        assert!(differing * 25 < covered, "{differing} of {covered}");
    }
}
