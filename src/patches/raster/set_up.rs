//! Sixteen patches on the picture at once: a lane each.
//!
//! Positions on the picture are counted from where the plane's origin is seen, so that rounding is that of the patch and not
//! of the picture. Nearness is what is linear there: 1 / distance in a perspective, minus the distance of parallel rays.

use super::view::RasterView;
use crate::abi::OrientedPolygon;
use fearless_simd::f32x16;
use fearless_simd::prelude::*;
use glam::Vec3;

/// Patches that are set up at once.
pub(super) const LANES: usize = 16;

const MOST_CORNERS: usize = OrientedPolygon::MOST_CORNERS;

/// Linear forms of a patch: its sides, and its two ends.
pub(super) const FORMS: usize = MOST_CORNERS + 2;

/// Words of a record.
const WORDS: usize = size_of::<OrientedPolygon>() / 4;

/// Pixels by which patches are widened besides, for rounding.
const ROUNDING_PX: f32 = 1e-3;

/// A number of each patch.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct LaneRow(pub(super) [f32; LANES]);

impl LaneRow {
    const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    fn load<S: Simd>(&self, simd: S) -> f32x16<S> {
        f32x16::from_slice(simd, &self.0)
    }

    #[inline(always)]
    fn store<S: Simd>(&mut self, numbers: f32x16<S>) {
        numbers.store_slice(&mut self.0);
    }
}

/// Records, a word of each in a row.
#[derive(Debug)]
pub(super) struct RecordRows([LaneRow; WORDS]);

/// Patches on the picture.
#[derive(Debug)]
pub(super) struct PatchBatch {
    /// Where the origin of the plane lies on the picture, pixels.
    pub(super) middle: [LaneRow; 2],
    /// Signed distances in pixels, inside positive: x, y and constant of each form.
    pub(super) forms: [[LaneRow; 3]; FORMS],
    /// Nearness of the origin, and its change along x and y.
    pub(super) nearness: LaneRow,
    pub(super) slope: [LaneRow; 2],
    /// Least and greatest nearness, less that of the origin.
    pub(super) limits: [LaneRow; 2],
    pub(super) margin_px: LaneRow,
    pub(super) thickness: LaneRow,
    /// Pixels that it may cover: first column and row, and one past the last; whole numbers within the rectangle.
    pub(super) pixels: [LaneRow; 4],
    /// Coordinates in the plane are (x, y, change of nearness) times these, over the nearness in a perspective.
    pub(super) feet: [[LaneRow; 3]; 2],
    /// Least and greatest of each coordinate.
    pub(super) extent: [[LaneRow; 2]; 2],
    /// Ray through the origin at z = -1.
    pub(super) ray: [LaneRow; 2],
    /// Normal for light in view space: that of the middle, and its change along both coordinates.
    pub(super) normal: [[LaneRow; 3]; 3],
    /// Part of the light that the surface keeps.
    pub(super) share: LaneRow,
    /// Color in the middle, and its change along both coordinates; only where there are colors.
    pub(super) color: [[LaneRow; 3]; 3],
}

type Lanes<S> = f32x16<S>;
type Triple<S> = [Lanes<S>; 3];

impl RecordRows {
    pub(super) const ZERO: Self = Self([LaneRow::ZERO; WORDS]);

    /// Puts a record into a lane.
    #[inline(always)]
    pub(super) fn put(&mut self, lane: usize, polygon: &OrientedPolygon) {
        let words: &[f32; WORDS] = bytemuck::cast_ref(polygon);
        for (row, word) in self.0.iter_mut().zip(words) {
            row.0[lane] = *word;
        }
    }

    #[inline(always)]
    fn word<S: Simd>(&self, simd: S, index: usize) -> Lanes<S> {
        self.0[index].load(simd)
    }

    #[inline(always)]
    fn triple<S: Simd>(&self, simd: S, first: usize) -> Triple<S> {
        [0, 1, 2].map(|i: usize| self.word(simd, first + i))
    }
}

/// Word of the first component of a field.
macro_rules! word_of {
    ($field:ident) => {
        std::mem::offset_of!(OrientedPolygon, $field) / 4
    };
}

#[inline(always)]
fn rotated<S: Simd>(view: &RasterView, v: Triple<S>) -> Triple<S> {
    let [x, y, z] = [
        view.rotation.x_axis,
        view.rotation.y_axis,
        view.rotation.z_axis,
    ];
    let one = |i: usize| v[0] * x[i] + v[1] * y[i] + v[2] * z[i];
    [one(0), one(1), one(2)]
}

#[inline(always)]
fn cross<S: Simd>(a: Triple<S>, b: Triple<S>) -> Triple<S> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline(always)]
fn dot<S: Simd>(a: Triple<S>, b: Triple<S>) -> Lanes<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// What a footprint is on the picture.
struct SeenCorners<S: Simd> {
    /// From the middle, pixels.
    places: [[Lanes<S>; 2]; MOST_CORNERS],
    low: [Lanes<S>; 2],
    high: [Lanes<S>; 2],
    nearest: Lanes<S>,
    farthest: Lanes<S>,
    /// Greatest squares of the distance from the eye, and of the ray at z = -1.
    distance_squared: Lanes<S>,
    ray_squared: Lanes<S>,
}

/// Planes of the patches in view space.
struct SeenPlanes<S: Simd> {
    origin: Triple<S>,
    /// Not unit where the model is scaled: products with them are coordinates times the square of that scale.
    axes: [Triple<S>; 2],
    /// Unit.
    normal: Triple<S>,
    thickness: Lanes<S>,
    ray: [Lanes<S>; 2],
}

impl PatchBatch {
    pub(super) const ZERO: Self = Self {
        middle: [LaneRow::ZERO; 2],
        forms: [[LaneRow::ZERO; 3]; FORMS],
        nearness: LaneRow::ZERO,
        slope: [LaneRow::ZERO; 2],
        limits: [LaneRow::ZERO; 2],
        margin_px: LaneRow::ZERO,
        thickness: LaneRow::ZERO,
        pixels: [LaneRow::ZERO; 4],
        feet: [[LaneRow::ZERO; 3]; 2],
        extent: [[LaneRow::ZERO; 2]; 2],
        ray: [LaneRow::ZERO; 2],
        normal: [[LaneRow::ZERO; 3]; 3],
        share: LaneRow::ZERO,
        color: [[LaneRow::ZERO; 3]; 3],
    };

    /// Sets patches up in a rectangle: left, top, and one past right and bottom, pixels.
    #[inline(always)]
    pub(super) fn set_up<S: Simd>(
        &mut self,
        simd: S,
        view: &RasterView,
        records: &RecordRows,
        rect_px: [f32; 4],
    ) {
        let planes = SeenPlanes::new(simd, view, records);
        let corners = SeenCorners::new(simd, view, records, &planes);
        let margin_px = margin_px(simd, view, &planes, &corners);
        self.margin_px.store(margin_px);
        self.thickness.store(planes.thickness);
        self.place(simd, view, &planes, (&corners, margin_px), rect_px);
        self.set_nearness(simd, view, &planes, &corners);
        self.set_forms(simd, &corners);
        self.set_feet(simd, view, records, &planes);
        self.set_normals(simd, view, records);
    }

    /// Middle and pixels.
    #[inline(always)]
    fn place<S: Simd>(
        &mut self,
        simd: S,
        view: &RasterView,
        planes: &SeenPlanes<S>,
        (corners, margin_px): (&SeenCorners<S>, Lanes<S>),
        rect_px: [f32; 4],
    ) {
        let number = |value: f32| Lanes::<S>::splat(simd, value);
        for axis in 0..2 {
            let middle = (planes.ray[axis] - view.ray_offset[axis]) * (1.0 / view.ray_scale[axis]);
            let [low, high] = [rect_px[axis], rect_px[axis + 2]].map(number);
            let first = (middle + corners.low[axis] - margin_px - 0.5).ceil();
            let end = (middle + corners.high[axis] + margin_px + 0.5).floor();
            self.middle[axis].store(middle);
            self.ray[axis].store(planes.ray[axis]);
            self.pixels[axis].store(first.max(low).min(high));
            self.pixels[axis + 2].store(end.max(low).min(high));
        }
    }

    /// Nearness of the plane.
    #[inline(always)]
    fn set_nearness<S: Simd>(
        &mut self,
        simd: S,
        view: &RasterView,
        planes: &SeenPlanes<S>,
        corners: &SeenCorners<S>,
    ) {
        let number = |value: f32| Lanes::<S>::splat(simd, value);
        let [near, far] = [number(view.near), number(view.far)];
        let distance = -planes.origin[2];
        let nearness = |distance: Lanes<S>| match view.is_perspective {
            true => number(1.0) / distance,
            false => -distance,
        };
        let own = nearness(distance);
        self.nearness.store(own);
        let limits = [
            (corners.farthest + planes.thickness).max(near).min(far),
            (corners.nearest - planes.thickness).max(near).min(far),
        ];
        for (row, limit) in self.limits.iter_mut().zip(limits) {
            row.store(nearness(limit) - own);
        }
        // In a perspective the ray is t (x, y, -1), and 1 / t = n . (x, y, -1) / n . o; else n . (x, y, z) = n . o.
        let over = match view.is_perspective {
            true => number(1.0) / dot(planes.normal, planes.origin),
            false => number(-1.0) / planes.normal[2],
        };
        for axis in 0..2 {
            let along = planes.normal[axis] * view.ray_scale[axis] * over;
            // Edge-on there is none.
            let is_finite = along.abs().simd_lt(1e30);
            self.slope[axis].store(is_finite.select(along, number(0.0)));
        }
    }

    /// Sides, and ends along the longest of them: at sharp corners sides alone would reach far beyond. Where there is no area
    /// what is across ends as well.
    #[inline(always)]
    fn set_forms<S: Simd>(&mut self, simd: S, corners: &SeenCorners<S>) {
        let number = |value: f32| Lanes::<S>::splat(simd, value);
        let places = &corners.places;
        let mut area = number(0.0);
        for i in 1..MOST_CORNERS - 1 {
            let [a, b] =
                [i, i + 1].map(|k| [0, 1].map(|axis: usize| places[k][axis] - places[0][axis]));
            area = area + (a[0] * b[1] - a[1] * b[0]);
        }
        let size = [0, 1].map(|axis: usize| corners.high[axis] - corners.low[axis]);
        let size_squared = size[0] * size[0] + size[1] * size[1];
        let has_area = area.abs().simd_gt(size_squared * 1e-6);
        let sign = number(1.0).copysign(area);
        // Rounding turns what is far shorter than the longest side.
        let least = has_area.select(size_squared * 1e-8, number(f32::INFINITY));
        let (mut longest, mut along) = (number(0.0), [number(1.0), number(0.0)]);
        for i in 0..MOST_CORNERS {
            let [from, to] = [places[i], places[(i + 1) % MOST_CORNERS]];
            let edge = [to[0] - from[0], to[1] - from[1]];
            let squared = edge[0] * edge[0] + edge[1] * edge[1];
            let inverse = number(1.0) / squared.sqrt();
            let is_longer = squared.simd_gt(longest);
            longest = longest.max(squared);
            along = [0, 1].map(|axis: usize| is_longer.select(edge[axis] * inverse, along[axis]));
            let is_side = squared.simd_gt(least);
            let factor = is_side.select(inverse * sign, number(0.0));
            let inward = [-edge[1] * factor, edge[0] * factor];
            let off = -(inward[0] * from[0] + inward[1] * from[1]);
            self.forms[i][0].store(inward[0]);
            self.forms[i][1].store(inward[1]);
            self.forms[i][2].store(is_side.select(off, number(f32::INFINITY)));
        }
        let ends = |along: [Lanes<S>; 2]| {
            let (mut first, mut last) = (number(f32::INFINITY), number(f32::NEG_INFINITY));
            for place in places {
                let at = place[0] * along[0] + place[1] * along[1];
                (first, last) = (first.min(at), last.max(at));
            }
            [[along[0], along[1], -first], [-along[0], -along[1], last]]
        };
        for (form, own) in self.forms[MOST_CORNERS..].iter_mut().zip(ends(along)) {
            for (row, value) in form.iter_mut().zip(own) {
                row.store(value);
            }
        }
        if !has_area.all_true() {
            let across = ends([-along[1], along[0]]);
            for (form, own) in self.forms[..2].iter_mut().zip(across) {
                for (row, value) in form.iter_mut().zip(own) {
                    row.store(has_area.select(row.load(simd), value));
                }
            }
        }
    }

    /// Coordinates in the plane.
    #[inline(always)]
    fn set_feet<S: Simd>(
        &mut self,
        simd: S,
        view: &RasterView,
        records: &RecordRows,
        planes: &SeenPlanes<S>,
    ) {
        let inverse = 1.0 / (view.model_scale * view.model_scale);
        for i in 0..2 {
            let axis = planes.axes[i].map(|part| part * inverse);
            let along = match view.is_perspective {
                true => -dot(planes.origin, axis),
                false => axis[2],
            };
            self.feet[i][0].store(axis[0] * view.ray_scale.x);
            self.feet[i][1].store(axis[1] * view.ray_scale.y);
            self.feet[i][2].store(along);
            let corner = |k: usize| records.word(simd, word_of!(corners) + 2 * k + i);
            let (mut low, mut high) = (corner(0), corner(0));
            for k in 1..MOST_CORNERS {
                (low, high) = (low.min(corner(k)), high.max(corner(k)));
            }
            self.extent[i][0].store(low);
            self.extent[i][1].store(high);
        }
    }

    /// Normals for light.
    #[inline(always)]
    fn set_normals<S: Simd>(&mut self, simd: S, view: &RasterView, records: &RecordRows) {
        let number = |value: f32| Lanes::<S>::splat(simd, value);
        let middle = records.triple(simd, word_of!(shading_normal));
        let share = dot(middle, middle).sqrt();
        self.share
            .store(share.simd_gt(0.0).select(share, number(1.0)));
        let first = records.triple(simd, word_of!(axis));
        let second = cross(records.triple(simd, word_of!(normal)), first);
        let [s0, s1, s2] = records.triple(simd, word_of!(shape_operator));
        let along = |a: Lanes<S>, b: Lanes<S>| {
            let one = |i: usize| first[i] * a + second[i] * b;
            [one(0), one(1), one(2)]
        };
        for (rows, vector) in self
            .normal
            .iter_mut()
            .zip([middle, along(s0, s1), along(s1, s2)])
        {
            for (row, value) in rows.iter_mut().zip(rotated(view, vector)) {
                row.store(value);
            }
        }
    }

    /// Color of a lane.
    pub(super) fn set_color(&mut self, lane: usize, polygon: &OrientedPolygon) {
        let [along_u, along_v] = polygon.color_slopes;
        let factor = f32::from(along_u[3]).exp2() / 127.0;
        let [red, green, blue, _] = polygon.color.map(|value| f32::from(value) / 255.0);
        let slope = |[r, g, b, _]: [i8; 4]| Vec3::new(r.into(), g.into(), b.into()) * factor;
        let own = [Vec3::new(red, green, blue), slope(along_u), slope(along_v)];
        for (rows, value) in self.color.iter_mut().zip(own) {
            for (row, value) in rows.iter_mut().zip(value.to_array()) {
                row.0[lane] = value;
            }
        }
    }
}

impl<S: Simd> SeenPlanes<S> {
    #[inline(always)]
    fn new(simd: S, view: &RasterView, records: &RecordRows) -> Self {
        let center = rotated(view, records.triple(simd, word_of!(center)));
        let origin = [0, 1, 2].map(|i: usize| center[i] + view.translation[i]);
        let first = records.triple(simd, word_of!(axis));
        let second = cross(records.triple(simd, word_of!(normal)), first);
        let axes = [rotated(view, first), rotated(view, second)];
        let inverse = 1.0 / (view.model_scale * view.model_scale);
        let ray = match view.is_perspective {
            true => {
                let near = Lanes::<S>::splat(simd, view.near);
                let over = Lanes::<S>::splat(simd, 1.0) / (-origin[2]).max(near);
                [origin[0] * over, origin[1] * over]
            }
            false => [origin[0], origin[1]],
        };
        Self {
            origin,
            normal: cross(axes[0], axes[1]).map(|part| part * inverse),
            axes,
            thickness: records.word(simd, word_of!(thickness)) * view.model_scale,
            ray,
        }
    }
}

impl<S: Simd> SeenCorners<S> {
    #[inline(always)]
    fn new(simd: S, view: &RasterView, records: &RecordRows, planes: &SeenPlanes<S>) -> Self {
        let number = |value: f32| Lanes::<S>::splat(simd, value);
        let per_ray = [1.0 / view.ray_scale.x, 1.0 / view.ray_scale.y];
        let [origin, ray] = [planes.origin, [planes.ray[0], planes.ray[1], number(0.0)]];
        let mut seen = Self {
            places: [[number(0.0); 2]; MOST_CORNERS],
            low: [number(f32::INFINITY); 2],
            high: [number(f32::NEG_INFINITY); 2],
            nearest: number(f32::INFINITY),
            farthest: number(f32::NEG_INFINITY),
            distance_squared: number(0.0),
            ray_squared: number(0.0),
        };
        for k in 0..MOST_CORNERS {
            let [u, v] = [0, 1].map(|i: usize| records.word(simd, word_of!(corners) + 2 * k + i));
            let way = [0, 1, 2].map(|i: usize| planes.axes[0][i] * u + planes.axes[1][i] * v);
            let distance = -(origin[2] + way[2]);
            seen.nearest = seen.nearest.min(distance);
            seen.farthest = seen.farthest.max(distance);
            // On the picture from the middle, without the rounding of positions.
            let moved = if view.is_perspective {
                let over = number(1.0) / distance.max(number(view.near));
                let moved = [0, 1].map(|i: usize| (way[i] + ray[i] * way[2]) * over);
                let [x, y] = [0, 1].map(|i: usize| ray[i] + moved[i]);
                let squared = x * x + y * y;
                seen.ray_squared = seen.ray_squared.max(squared);
                let distance_squared = distance * distance * (squared + 1.0);
                seen.distance_squared = seen.distance_squared.max(distance_squared);
                moved
            } else {
                [way[0], way[1]]
            };
            for axis in 0..2 {
                let place = moved[axis] * per_ray[axis];
                seen.places[k][axis] = place;
                seen.low[axis] = seen.low[axis].min(place);
                seen.high[axis] = seen.high[axis].max(place);
            }
        }
        seen
    }
}

/// Pixels by which patches are widened.
#[inline(always)]
fn margin_px<S: Simd>(
    simd: S,
    view: &RasterView,
    planes: &SeenPlanes<S>,
    corners: &SeenCorners<S>,
) -> Lanes<S> {
    let number = |value: f32| Lanes::<S>::splat(simd, value);
    let (zero, thickness) = (number(0.0), planes.thickness);
    let margin_px = if view.is_perspective {
        let off = dot(planes.normal, planes.origin);
        let sine_squared = number(1.0) - off * off / corners.distance_squared;
        let longer = (corners.ray_squared + 1.0).min(number(100.0));
        let nearest = (corners.nearest - thickness).max(number(view.near));
        thickness * view.focal_px * (sine_squared.max(zero) * longer).sqrt() / nearest
    } else {
        let along = planes.normal[2];
        thickness * view.focal_px * (number(1.0) - along * along).max(zero).sqrt()
    };
    margin_px + ROUNDING_PX
}
