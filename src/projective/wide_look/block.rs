//! A block of pixels, and the photographs that weigh most in each of them.

use crate::projective::depth_map::PhotoVisibility;
use crate::projective::look::{
    CANDIDATES, LEAST_SHARE, LookPhoto, LookSettings, LookView, SAME_RAY,
};
use crate::projective::projected::ProjectedPhoto;
use crate::projective::surface_rays::{LONGEST_STEP, SurfaceRays};
use crate::projective::wide_look::lanes::{LaneVector, load, log2, set_bits, smooth, splat};
use crate::projective::wide_look::place::{PlacedPoint, visibility};
use crate::simd::{FloatLanes, WIDEST, WideLanes};
use fearless_simd::prelude::*;
use glam::Vec2;

/// Photographs that a block weighs at most.
pub(super) const MOST_WIDE: usize = 64;

/// Rays of a view, a ray in each lane: see [`SurfaceRays`].
struct WideRays<S: Simd> {
    start: LaneVector<S>,
    towards: LaneVector<S>,
    is_perspective: bool,
}

impl<S: Simd> WideRays<S> {
    /// Start and direction of rays that are moved by so much.
    #[inline(always)]
    fn moved(&self, by: LaneVector<S>) -> (LaneVector<S>, LaneVector<S>) {
        match self.is_perspective {
            true => (self.start, self.towards.plus(by)),
            false => (self.start.plus(by), self.towards),
        }
    }
}

/// Places of pixels beside each other, a pixel in each lane.
pub(super) struct SurfaceBlock<S: Simd> {
    position: LaneVector<S>,
    normal: LaneVector<S>,
    has_normal: S::mask32s,
    steps: [LaneVector<S>; 2],
    view_ray: LaneVector<S>,
    is_there: S::mask32s,
}

/// Column of each lane, from the first.
const COLUMNS: [f32; WIDEST] = {
    let (mut columns, mut lane) = ([0.0; WIDEST], 0);
    while lane < WIDEST {
        columns[lane] = lane as f32;
        lane += 1;
    }
    columns
};

impl<S: Simd> SurfaceBlock<S> {
    /// The surface of at most as many pixels as there are lanes, from one on to the right: see [`SurfaceRays::pixel`].
    #[inline(always)]
    pub(super) fn new(
        simd: S,
        rays: &SurfaceRays,
        [column, row]: [u32; 2],
        (distances, normals): (&[f32], &[[f32; 3]]),
        view: &LookView,
    ) -> Self {
        let mut lanes = [[0.0; WIDEST]; 4];
        for (lane, (distance, normal)) in distances.iter().zip(normals).enumerate() {
            let is_there = *distance > 0.0 && distance.is_finite();
            lanes[3][lane] = if is_there { *distance } else { 0.0 };
            (lanes[0][lane], lanes[1][lane], lanes[2][lane]) = (normal[0], normal[1], normal[2]);
        }
        let zero = splat(simd, 0.0);
        let distance = load(simd, &lanes[3]);
        let is_there = distance.gt(zero);
        let distance = WideLanes::choose(is_there, distance, splat(simd, 1.0));
        let x = load(simd, &COLUMNS) + splat(simd, column as f32 + 0.5);
        let right = LaneVector::all(simd, rays.right);
        let down = LaneVector::all(simd, rays.down);
        let moved = right.times(x);
        let moved = moved.plus(LaneVector::all(simd, rays.down * (row as f32 + 0.5)));
        let wide = WideRays {
            start: LaneVector::all(simd, rays.start),
            towards: LaneVector::all(simd, rays.towards),
            is_perspective: rays.is_perspective,
        };
        let (start, towards) = wide.moved(moved);
        let position = start.plus(towards.times(distance));
        let normal = LaneVector([
            load(simd, &lanes[0]),
            load(simd, &lanes[1]),
            load(simd, &lanes[2]),
        ]);
        let is_behind = normal.dot(towards).gt(zero);
        let sign = WideLanes::choose(is_behind, splat(simd, -1.0), splat(simd, 1.0));
        let normal = normal.times(sign);
        let view_ray = match view.parallel {
            Some(parallel) => LaneVector::all(simd, parallel),
            None => position.minus(LaneVector::all(simd, view.eye)).unit(),
        };
        let mut block = Self {
            position,
            normal,
            has_normal: normal.dot(normal).gt(zero),
            steps: [right, down],
            view_ray,
            is_there,
        };
        block.steps = [
            block.step(simd, wide.moved(moved.plus(right)), distance),
            block.step(simd, wide.moved(moved.plus(down)), distance),
        ];
        block
    }

    /// To where the ray of a neighbor meets the plane of each pixel; at grazing angles not farther than [`LONGEST_STEP`].
    #[inline(always)]
    fn step(
        &self,
        simd: S,
        (start, towards): (LaneVector<S>, LaneVector<S>),
        distance: WideLanes<S>,
    ) -> LaneVector<S> {
        let one = splat(simd, 1.0);
        let flat = start.plus(towards.times(distance)).minus(self.position);
        let facing = self.normal.dot(towards);
        let is_edge_on = facing.gt(splat(simd, -1e-6));
        let facing = WideLanes::choose(is_edge_on, splat(simd, -1.0), facing);
        let far = self.normal.dot(self.position.minus(start)) / facing;
        let along = start.plus(towards.times(far)).minus(self.position);
        let longest = flat.dot(flat) * (LONGEST_STEP * LONGEST_STEP);
        let own = along.dot(along);
        let is_long = own.gt(longest);
        let shorter = (longest / WideLanes::choose(is_long, own, one)).sqrt();
        let along = along.times(WideLanes::choose(is_long, shorter, one));
        LaneVector::choose(is_edge_on, flat, along)
    }
}

/// A photograph's weight in each lane, and what it was found with.
struct WideWeight<S: Simd> {
    weight: WideLanes<S>,
    pixel: [WideLanes<S>; 2],
    /// Square of the texels that the longer step of a pixel takes.
    longest: WideLanes<S>,
}

/// The photographs of a block: what each may weigh at most, where its pixels are in each, and those that weigh most.
pub(super) struct BlockPhotos {
    bounds: Vec<[f32; WIDEST]>,
    facings: Vec<[f32; WIDEST]>,
    /// Place of 0..=1 in each photograph, and the level whose texels are as large as pixels there, from the largest held on.
    pub(super) spots: Vec<[[f32; WIDEST]; 3]>,
    /// Weights of the best few, heaviest first; 0 beyond them.
    pub(super) weights: [[f32; WIDEST]; CANDIDATES],
    /// Places of those in the list of photographs.
    pub(super) indices: [[f32; WIDEST]; CANDIDATES],
}

impl Default for BlockPhotos {
    fn default() -> Self {
        Self {
            bounds: Vec::new(),
            facings: Vec::new(),
            spots: Vec::new(),
            weights: [[0.0; WIDEST]; CANDIDATES],
            indices: [[0.0; WIDEST]; CANDIDATES],
        }
    }
}

/// The best few so far, heaviest first, an earlier photograph before a later where they tie.
struct BestFew<S: Simd> {
    weights: [WideLanes<S>; CANDIDATES],
    indices: [WideLanes<S>; CANDIDATES],
}

impl<S: Simd> BestFew<S> {
    #[inline(always)]
    fn add(&mut self, mut weight: WideLanes<S>, index: f32) {
        let mut index = weight.all(index);
        for (own, own_index) in self.weights.iter_mut().zip(&mut self.indices) {
            let ties = weight.ge(*own) & weight.le(*own);
            let is_before = weight.gt(*own) | (ties & index.lt(*own_index));
            let (other, other_index) = (*own, *own_index);
            *own = WideLanes::choose(is_before, weight, other);
            *own_index = WideLanes::choose(is_before, index, other_index);
            weight = WideLanes::choose(is_before, other, weight);
            index = WideLanes::choose(is_before, other_index, index);
        }
    }

    /// Weight below which a photograph is not among those that count.
    #[inline(always)]
    fn least(&self) -> WideLanes<S> {
        (self.weights[0] * LEAST_SHARE).max(self.weights[CANDIDATES - 1])
    }
}

impl BlockPhotos {
    /// Finds the photographs that weigh most in each lane, of those that weigh [`LEAST_SHARE`] of the best.
    #[inline(always)]
    pub(super) fn weigh<S: Simd>(
        &mut self,
        simd: S,
        surface: &SurfaceBlock<S>,
        photos: &[LookPhoto<'_>],
        settings: &LookSettings,
    ) {
        let lanes = WideLanes::<S>::LANES;
        self.bounds.resize(photos.len(), [0.0; WIDEST]);
        self.facings.resize(photos.len(), [0.0; WIDEST]);
        self.spots.resize(photos.len(), [[0.0; WIDEST]; 3]);
        let mut order: [(f32, u32); MOST_WIDE] = [(0.0, 0); MOST_WIDE];
        let mut count = 0;
        for (index, of) in photos.iter().enumerate() {
            let (bound, facing) = most_weight(simd, surface, of.photo, settings);
            bound.store(&mut self.bounds[index][..lanes]);
            facing.store(&mut self.facings[index][..lanes]);
            let mut most = 0.0;
            for bound in &self.bounds[index][..lanes] {
                most = if *bound > most { *bound } else { most };
            }
            if most <= 0.0 {
                continue;
            }
            let mut at = count;
            while at > 0 && order[at - 1].0 < most {
                order[at] = order[at - 1];
                at -= 1;
            }
            order[at] = (most, index as u32);
            count += 1;
        }
        let zero = splat(simd, 0.0);
        let mut best = BestFew {
            weights: [zero; CANDIDATES],
            indices: [zero; CANDIDATES],
        };
        for (_, index) in &order[..count] {
            let index = *index as usize;
            let bound = load(simd, &self.bounds[index]);
            let facing = load(simd, &self.facings[index]);
            let is_wanted = bound.gt(zero) & bound.ge(best.least());
            if WideLanes::<S>::bits(is_wanted) == 0 {
                continue;
            }
            let bound = WideLanes::choose(is_wanted, bound, zero);
            let found = weight_of(
                simd,
                surface,
                &photos[index],
                settings,
                (bound, facing),
                best.least(),
            );
            if WideLanes::<S>::bits(found.weight.gt(zero)) == 0 {
                continue;
            }
            let size = photos[index].photo.size;
            let held = (photos[index].pixels.size()[0] as f32 / size.x.max(1.0)).max(1e-6);
            let longest = found.longest * (held * held);
            let [u, v, level] = &mut self.spots[index];
            (found.pixel[0] * (1.0 / size.x)).store(&mut u[..lanes]);
            (found.pixel[1] * (1.0 / size.y)).store(&mut v[..lanes]);
            (log2(longest.max(splat(simd, 1e-12))) * 0.5).store(&mut level[..lanes]);
            best.add(found.weight, index as f32);
        }
        let least = best.weights[0] * LEAST_SHARE;
        for (k, (weight, index)) in best.weights.iter().zip(&best.indices).enumerate() {
            let weight = WideLanes::choose(weight.ge(least), *weight, zero);
            weight.store(&mut self.weights[k][..lanes]);
            index.store(&mut self.indices[k][..lanes]);
        }
    }
}

/// Most that a photograph may weigh by directions alone, and the cosine of the angle between its ray and the normal.
#[inline(always)]
fn most_weight<S: Simd>(
    simd: S,
    surface: &SurfaceBlock<S>,
    photo: &ProjectedPhoto,
    settings: &LookSettings,
) -> (WideLanes<S>, WideLanes<S>) {
    let zero = splat(simd, 0.0);
    let ray = surface
        .position
        .minus(LaneVector::all(simd, photo.center))
        .unit();
    let between = surface.view_ray.minus(ray);
    let apart = between.dot(between) * 0.5;
    let same = splat(simd, SAME_RAY) / (apart + splat(simd, SAME_RAY));
    let facing = -surface.normal.dot(ray);
    let faces = smooth(settings.limit_cos, 0.6, facing);
    let faces = WideLanes::choose(surface.has_normal, faces, splat(simd, 1.0));
    let bound = WideLanes::choose(surface.is_there, lessened(same, faces), zero);
    (bound, facing)
}

/// Weight whose odds are a part of those of another: see [`look::lessened`](crate::projective::look::lessened).
#[inline(always)]
fn lessened<S: Simd>(weight: WideLanes<S>, part: WideLanes<S>) -> WideLanes<S> {
    let (zero, one) = (weight.all(0.0), weight.all(1.0));
    let lessened = weight * part;
    let is_any = lessened.gt(zero);
    let all = lessened + (one - weight).max(zero);
    WideLanes::choose(is_any, lessened / WideLanes::choose(is_any, all, one), zero)
}

/// Weight of a photograph: 0 where its bound is 0, it does not show the point, or it weighs less than `least`.
#[inline(always)]
fn weight_of<S: Simd>(
    simd: S,
    surface: &SurfaceBlock<S>,
    of: &LookPhoto<'_>,
    settings: &LookSettings,
    (bound, facing): (WideLanes<S>, WideLanes<S>),
    least: WideLanes<S>,
) -> WideWeight<S> {
    let photo = of.photo;
    let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
    let from_eye = surface.position.minus(LaneVector::all(simd, photo.center));
    let own = from_eye.turned(&photo.rotation);
    let place = PlacedPoint::new(simd, photo, own);
    let size = photo.size;
    let (x, y) = (place.pixel[0], place.pixel[1]);
    let is_inside = place.is_shown
        & x.ge(zero)
        & y.ge(zero)
        & x.lt(splat(simd, size.x))
        & y.lt(splat(simd, size.y));
    let across = texels_of(
        simd,
        photo,
        own.plus(surface.steps[0].turned(&photo.rotation)),
        &place,
    );
    let down = texels_of(
        simd,
        photo,
        own.plus(surface.steps[1].turned(&photo.rotation)),
        &place,
    );
    let texels = across.min(down).sqrt().max(splat(simd, 0.05)).min(one);
    let inside = x
        .min(splat(simd, size.x) - x)
        .min(y.min(splat(simd, size.y) - y));
    let width = settings.border * size.min_element();
    let border = match width > 0.0 {
        true => (inside * (1.0 / width)).max(splat(simd, 0.02)).min(one),
        false => one,
    };
    let mut part = texels * border;
    let weight = WideLanes::choose(is_inside, lessened(bound, part), zero);
    // The photograph cannot be among the best few, whatever it sees.
    let is_wanted = weight.ge(least) & weight.gt(zero);
    let lanes = WideLanes::<S>::bits(is_wanted);
    if lanes != 0 && settings.visibility != PhotoVisibility::Off {
        let is_soft = settings.visibility == PhotoVisibility::DepthSoft;
        part = part * visibility(simd, of.depth, &place, facing, (lanes, is_soft));
    }
    if let (Some(mask), true) = (of.mask, lanes != 0) {
        let mut kept = [0.0; WIDEST];
        let [mut columns, mut rows] = [[0.0; WIDEST]; 2];
        x.store(&mut columns[..WideLanes::<S>::LANES]);
        y.store(&mut rows[..WideLanes::<S>::LANES]);
        for lane in set_bits(lanes) {
            let at = Vec2::new(columns[lane], rows[lane]) / size;
            kept[lane] = mask.sample(at.to_array(), 0.0)[1];
        }
        part = part * WideLanes::load(simd, &kept[..WideLanes::<S>::LANES]);
    }
    WideWeight {
        weight: WideLanes::choose(is_wanted, lessened(bound, part), zero),
        pixel: place.pixel,
        longest: across.max(down),
    }
}

/// Square of the texels from a place to that of another point in camera space; 1 where that is not shown.
#[inline(always)]
fn texels_of<S: Simd>(
    simd: S,
    photo: &ProjectedPhoto,
    own: LaneVector<S>,
    from: &PlacedPoint<S>,
) -> WideLanes<S> {
    let next = PlacedPoint::new(simd, photo, own);
    let (dx, dy) = (next.pixel[0] - from.pixel[0], next.pixel[1] - from.pixel[1]);
    WideLanes::choose(next.is_shown, dx * dx + dy * dy, splat(simd, 1.0))
}
