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
    /// Place of the origin of the plane on the picture, pixels.
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
    /// Left, top, right and bottom, pixels of the picture.
    pub(super) bounds: [LaneRow; 4],
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
        [
            self.word(simd, first),
            self.word(simd, first + 1),
            self.word(simd, first + 2),
        ]
    }
}

/// Word of the first component of a field.
macro_rules! word_of {
    ($field:ident) => {
        std::mem::offset_of!(OrientedPolygon, $field) / 4
    };
}

// Functions and loops, as what closures do need not be compiled for the vectors of the function that they are in.

#[inline(always)]
fn splat<S: Simd>(simd: S, value: f32) -> Lanes<S> {
    Lanes::<S>::splat(simd, value)
}

#[inline(always)]
fn store_all<S: Simd>(rows: &mut [LaneRow; 3], values: Triple<S>) {
    rows[0].store(values[0]);
    rows[1].store(values[1]);
    rows[2].store(values[2]);
}

#[inline(always)]
fn component<S: Simd>(view: &RasterView, v: Triple<S>, i: usize) -> Lanes<S> {
    let turn = &view.rotation;
    v[0] * turn.x_axis[i] + v[1] * turn.y_axis[i] + v[2] * turn.z_axis[i]
}

#[inline(always)]
fn rotated<S: Simd>(view: &RasterView, v: Triple<S>) -> Triple<S> {
    [
        component(view, v, 0),
        component(view, v, 1),
        component(view, v, 2),
    ]
}

#[inline(always)]
fn scaled<S: Simd>(v: Triple<S>, factor: f32) -> Triple<S> {
    [v[0] * factor, v[1] * factor, v[2] * factor]
}

#[inline(always)]
fn sum<S: Simd>(a: Triple<S>, of_a: Lanes<S>, b: Triple<S>, of_b: Lanes<S>) -> Triple<S> {
    [
        a[0] * of_a + b[0] * of_b,
        a[1] * of_a + b[1] * of_b,
        a[2] * of_a + b[2] * of_b,
    ]
}

/// Number that is compared between patches: the larger the nearer.
#[inline(always)]
fn nearness<S: Simd>(simd: S, view: &RasterView, distance: Lanes<S>) -> Lanes<S> {
    match view.is_perspective {
        true => splat(simd, 1.0) / distance,
        false => -distance,
    }
}

/// Forms of both ends of a footprint along a direction.
#[inline(always)]
fn ends<S: Simd>(
    simd: S,
    places: &[[Lanes<S>; 2]; MOST_CORNERS],
    along: [Lanes<S>; 2],
) -> [Triple<S>; 2] {
    let (mut first, mut last) = (splat(simd, f32::INFINITY), splat(simd, f32::NEG_INFINITY));
    for place in places {
        let at = place[0] * along[0] + place[1] * along[1];
        first = first.min(at);
        last = last.max(at);
    }
    [[along[0], along[1], -first], [-along[0], -along[1], last]]
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

/// Corners of a footprint on the picture, and their bounds.
struct SeenCorners<S: Simd> {
    /// Columns and rows, counted from the middle, pixels.
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
        bounds: [LaneRow::ZERO; 4],
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
        for axis in 0..2 {
            let middle = (planes.ray[axis] - view.ray_offset[axis]) * (1.0 / view.ray_scale[axis]);
            let (low, high) = (rect_px[axis], rect_px[axis + 2]);
            let least = middle + corners.low[axis] - margin_px;
            let most = middle + corners.high[axis] + margin_px;
            let (first, end) = ((least - 0.5).ceil(), (most + 0.5).floor());
            self.bounds[axis].store(least);
            self.bounds[axis + 2].store(most);
            self.middle[axis].store(middle);
            self.ray[axis].store(planes.ray[axis]);
            self.pixels[axis].store(first.max(splat(simd, low)).min(splat(simd, high)));
            self.pixels[axis + 2].store(end.max(splat(simd, low)).min(splat(simd, high)));
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
        let (near, far) = (splat(simd, view.near), splat(simd, view.far));
        let own = nearness(simd, view, -planes.origin[2]);
        self.nearness.store(own);
        let farthest = (corners.farthest + planes.thickness).max(near).min(far);
        let nearest = (corners.nearest - planes.thickness).max(near).min(far);
        self.limits[0].store(nearness(simd, view, farthest) - own);
        self.limits[1].store(nearness(simd, view, nearest) - own);
        // In a perspective the ray is t (x, y, -1), and 1 / t = n . (x, y, -1) / n . o; else n . (x, y, z) = n . o.
        let over = match view.is_perspective {
            true => splat(simd, 1.0) / dot(planes.normal, planes.origin),
            false => splat(simd, -1.0) / planes.normal[2],
        };
        for axis in 0..2 {
            let along = planes.normal[axis] * view.ray_scale[axis] * over;
            // Edge-on there is none.
            let is_finite = along.abs().simd_lt(1e30);
            self.slope[axis].store(is_finite.select(along, splat(simd, 0.0)));
        }
    }

    /// Sides, and ends along the longest of them: at sharp corners sides alone would reach far beyond. Where there is no area
    /// what is across ends as well.
    #[inline(always)]
    fn set_forms<S: Simd>(&mut self, simd: S, corners: &SeenCorners<S>) {
        let places = &corners.places;
        let mut area = splat(simd, 0.0);
        for i in 1..MOST_CORNERS - 1 {
            let (ax, ay) = (places[i][0] - places[0][0], places[i][1] - places[0][1]);
            let (bx, by) = (
                places[i + 1][0] - places[0][0],
                places[i + 1][1] - places[0][1],
            );
            area += ax * by - ay * bx;
        }
        let (width, height) = (
            corners.high[0] - corners.low[0],
            corners.high[1] - corners.low[1],
        );
        let size_squared = width * width + height * height;
        let has_area = area.abs().simd_gt(size_squared * 1e-6);
        let sign = splat(simd, 1.0).copysign(area);
        // Rounding turns what is far shorter than the longest side.
        let least = has_area.select(size_squared * 1e-8, splat(simd, f32::INFINITY));
        let mut longest = splat(simd, 0.0);
        let mut along = [splat(simd, 1.0), splat(simd, 0.0)];
        for i in 0..MOST_CORNERS {
            let (from, to) = (places[i], places[(i + 1) % MOST_CORNERS]);
            let (x, y) = (to[0] - from[0], to[1] - from[1]);
            let squared = x * x + y * y;
            let inverse = splat(simd, 1.0) / squared.sqrt();
            let is_longer = squared.simd_gt(longest);
            longest = longest.max(squared);
            along[0] = is_longer.select(x * inverse, along[0]);
            along[1] = is_longer.select(y * inverse, along[1]);
            let is_side = squared.simd_gt(least);
            let factor = is_side.select(inverse * sign, splat(simd, 0.0));
            let (inward_x, inward_y) = (-y * factor, x * factor);
            let off = -(inward_x * from[0] + inward_y * from[1]);
            let off = is_side.select(off, splat(simd, f32::INFINITY));
            store_all(&mut self.forms[i], [inward_x, inward_y, off]);
        }
        let [first, last] = ends(simd, places, along);
        store_all(&mut self.forms[MOST_CORNERS], first);
        store_all(&mut self.forms[MOST_CORNERS + 1], last);
        if !has_area.all_true() {
            let across = ends(simd, places, [-along[1], along[0]]);
            for (form, across) in self.forms.iter_mut().zip(across) {
                for (row, value) in form.iter_mut().zip(across) {
                    let own = row.load(simd);
                    row.store(has_area.select(own, value));
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
            let axis = scaled(planes.axes[i], inverse);
            let along = match view.is_perspective {
                true => -dot(planes.origin, axis),
                false => axis[2],
            };
            let along_x = axis[0] * view.ray_scale.x;
            store_all(
                &mut self.feet[i],
                [along_x, axis[1] * view.ray_scale.y, along],
            );
            let first = records.word(simd, word_of!(corners) + i);
            let (mut low, mut high) = (first, first);
            for k in 1..MOST_CORNERS {
                let corner = records.word(simd, word_of!(corners) + 2 * k + i);
                low = low.min(corner);
                high = high.max(corner);
            }
            self.extent[i][0].store(low);
            self.extent[i][1].store(high);
        }
    }

    /// Normals for light.
    #[inline(always)]
    fn set_normals<S: Simd>(&mut self, simd: S, view: &RasterView, records: &RecordRows) {
        let middle = records.triple(simd, word_of!(shading_normal));
        let share = dot(middle, middle).sqrt();
        let has_direction = share.simd_gt(0.0);
        self.share
            .store(has_direction.select(share, splat(simd, 1.0)));
        let first = records.triple(simd, word_of!(axis));
        let second = cross(records.triple(simd, word_of!(normal)), first);
        let [s0, s1, s2] = records.triple(simd, word_of!(shape_operator));
        store_all(&mut self.normal[0], rotated(view, middle));
        store_all(
            &mut self.normal[1],
            rotated(view, sum(first, s0, second, s1)),
        );
        store_all(
            &mut self.normal[2],
            rotated(view, sum(first, s1, second, s2)),
        );
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
        let origin = [
            center[0] + view.translation.x,
            center[1] + view.translation.y,
            center[2] + view.translation.z,
        ];
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
            normal: scaled(cross(axes[0], axes[1]), inverse),
            axes,
            thickness: records.word(simd, word_of!(thickness)) * view.model_scale,
            ray,
        }
    }
}

impl<S: Simd> SeenCorners<S> {
    #[inline(always)]
    fn new(simd: S, view: &RasterView, records: &RecordRows, planes: &SeenPlanes<S>) -> Self {
        let per_ray = [1.0 / view.ray_scale.x, 1.0 / view.ray_scale.y];
        let (origin, ray) = (planes.origin, planes.ray);
        let zero = splat(simd, 0.0);
        let (far, behind) = (splat(simd, f32::INFINITY), splat(simd, f32::NEG_INFINITY));
        let mut seen = Self {
            places: [[zero; 2]; MOST_CORNERS],
            low: [far; 2],
            high: [behind; 2],
            nearest: far,
            farthest: behind,
            distance_squared: zero,
            ray_squared: zero,
        };
        for k in 0..MOST_CORNERS {
            let u = records.word(simd, word_of!(corners) + 2 * k);
            let v = records.word(simd, word_of!(corners) + 2 * k + 1);
            let way = sum(planes.axes[0], u, planes.axes[1], v);
            let distance = -(origin[2] + way[2]);
            seen.nearest = seen.nearest.min(distance);
            seen.farthest = seen.farthest.max(distance);
            // On the picture from the middle, without the rounding of positions.
            let mut moved = [way[0], way[1]];
            if view.is_perspective {
                let over = splat(simd, 1.0) / distance.max(splat(simd, view.near));
                moved = [
                    (way[0] + ray[0] * way[2]) * over,
                    (way[1] + ray[1] * way[2]) * over,
                ];
                let (x, y) = (ray[0] + moved[0], ray[1] + moved[1]);
                let squared = x * x + y * y;
                seen.ray_squared = seen.ray_squared.max(squared);
                let distance_squared = distance * distance * (squared + 1.0);
                seen.distance_squared = seen.distance_squared.max(distance_squared);
            }
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
    let (zero, one, thickness) = (splat(simd, 0.0), splat(simd, 1.0), planes.thickness);
    let margin_px = if view.is_perspective {
        let off = dot(planes.normal, planes.origin);
        let sine_squared = one - off * off / corners.distance_squared;
        let longer = (corners.ray_squared + 1.0).min(splat(simd, 100.0));
        let nearest = (corners.nearest - thickness).max(splat(simd, view.near));
        thickness * view.focal_px * (sine_squared.max(zero) * longer).sqrt() / nearest
    } else {
        let along = planes.normal[2];
        thickness * view.focal_px * (one - along * along).max(zero).sqrt()
    };
    margin_px + ROUNDING_PX
}
