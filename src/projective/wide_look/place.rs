//! Places of points in a photograph, and whether it sees them, a point in each lane.

use crate::projective::depth_map::{EDGE_TEXELS, LEAST_AT_EDGE, PhotoDepth, RELATIVE_BIAS};
use crate::projective::lens::LensModel;
use crate::projective::projected::ProjectedPhoto;
use crate::projective::wide_look::lanes::{LaneVector, floor, load, set_bits, smooth, splat};
use crate::simd::{FloatLanes, WIDEST, WideLanes};
use fearless_simd::prelude::*;
use glam::Vec2;

/// Points in a photograph: see [`ProjectedPhoto::place_anywhere`].
pub(super) struct PlacedPoint<S: Simd> {
    ray: [WideLanes<S>; 2],
    depth: WideLanes<S>,
    pub(super) pixel: [WideLanes<S>; 2],
    pub(super) is_shown: S::mask32s,
}

impl<S: Simd> PlacedPoint<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, photo: &ProjectedPhoto, own: LaneVector<S>) -> Self {
        let [x, y, depth] = own.0;
        let is_ahead = depth.gt(splat(simd, photo.least_depth));
        let depth = WideLanes::choose(is_ahead, depth, splat(simd, 1.0));
        let near = splat(simd, 1.0) / depth;
        let ray = [x * near, y * near];
        let (bent, is_bent) = match photo.lens {
            LensModel::Pinhole => (ray, is_ahead),
            LensModel::Brown | LensModel::Rational => bent_by_polynomials(simd, photo, ray),
            LensModel::Fisheye | LensModel::MeasuredRadial => bent_one_by_one(simd, photo, ray),
        };
        let pixel = [
            bent[0] * photo.focal.x + splat(simd, photo.principal.x),
            bent[1] * photo.focal.y + splat(simd, photo.principal.y),
        ];
        Self {
            ray,
            depth,
            pixel,
            is_shown: is_ahead & is_bent,
        }
    }
}

/// A polynomial of the third degree with 1 at 0.
#[inline(always)]
fn cubic<S: Simd>(at: WideLanes<S>, k: [f32; 3]) -> WideLanes<S> {
    at * (at * (at * k[2] + at.all(k[1])) + at.all(k[0])) + at.all(1.0)
}

/// Rays as a lens of polynomials bends them, and where it does.
#[inline(always)]
fn bent_by_polynomials<S: Simd>(
    simd: S,
    photo: &ProjectedPhoto,
    [x, y]: [WideLanes<S>; 2],
) -> ([WideLanes<S>; 2], S::mask32s) {
    let [k1, k2, p1, p2, k3, k4, k5, k6] = photo.coefficients;
    let r2 = x * x + y * y;
    let factor = match photo.lens {
        LensModel::Brown => {
            let r4 = r2 * r2;
            cubic(r2, [k1, k2, k3]) + r4 * r4 * k4
        }
        _ => cubic(r2, [k1, k2, k3]) / cubic(r2, [k4, k5, k6]),
    };
    let xy = x * y * 2.0;
    let bent = [
        x * factor + xy * p1 + (r2 + x * x * 2.0) * p2,
        y * factor + xy * p2 + (r2 + y * y * 2.0) * p1,
    ];
    let largest = photo.largest_radius * photo.largest_radius;
    (bent, r2.le(splat(simd, largest)))
}

/// Rays as any lens bends them, one lane after the other.
fn bent_one_by_one<S: Simd>(
    simd: S,
    photo: &ProjectedPhoto,
    [x, y]: [WideLanes<S>; 2],
) -> ([WideLanes<S>; 2], S::mask32s) {
    let lanes = WideLanes::<S>::LANES;
    let [mut columns, mut rows, mut is_bent] = [[0.0; WIDEST]; 3];
    x.store(&mut columns[..lanes]);
    y.store(&mut rows[..lanes]);
    for lane in 0..lanes {
        let bent = photo.bend(Vec2::new(columns[lane], rows[lane]));
        is_bent[lane] = f32::from(u8::from(bent.is_some()));
        (columns[lane], rows[lane]) = bent.unwrap_or(Vec2::ZERO).into();
    }
    let is_bent = load(simd, &is_bent).gt(splat(simd, 0.0));
    ([load(simd, &columns), load(simd, &rows)], is_bent)
}

/// Part of points that a photograph sees: see [`PhotoDepth::visibility`].
#[inline(always)]
pub(super) fn visibility<S: Simd>(
    simd: S,
    map: &PhotoDepth,
    place: &PlacedPoint<S>,
    facing: WideLanes<S>,
    (set, is_soft): (u32, bool),
) -> WideLanes<S> {
    let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
    if map.depth.is_empty() {
        return one;
    }
    let lanes = WideLanes::<S>::LANES;
    let at = [
        place.ray[0] * map.focal.x + splat(simd, map.principal.x - 0.5),
        place.ray[1] * map.focal.y + splat(simd, map.principal.y - 0.5),
    ];
    let texel = 1.0 / map.focal.min_element().max(1e-6);
    let slope = (one - facing * facing).max(zero).sqrt() / facing.abs().max(splat(simd, 0.05));
    let slope = slope.min(splat(simd, 10.0));
    let nearest = place.depth * (one - splat(simd, RELATIVE_BIAS) - slope * (2.0 * texel));
    let corner = [floor(at[0]), floor(at[1])];
    let part = [at[0] - corner[0], at[1] - corner[1]];
    let [mut columns, mut rows] = [[0.0; WIDEST]; 2];
    corner[0].store(&mut columns[..lanes]);
    corner[1].store(&mut rows[..lanes]);
    let mut depths = [[0.0; WIDEST]; 4];
    let mut edges = [[0.0; WIDEST]; 4];
    let width = map.width as usize;
    let last = [map.width, map.height].map(|side| i32::try_from(side).unwrap_or(i32::MAX) - 1);
    for lane in set_bits(set) {
        // Conversions saturate.
        let [left, top] = [columns[lane] as i32, rows[lane] as i32];
        let [left, right] = [left, left.saturating_add(1)].map(|x| x.clamp(0, last[0]) as usize);
        let [top, bottom] = [top, top.saturating_add(1)].map(|y| y.clamp(0, last[1]) as usize);
        let [upper, lower] = [top * width, bottom * width];
        let four = [upper + left, upper + right, lower + left, lower + right];
        for (k, texel) in four.into_iter().enumerate() {
            depths[k][lane] = map.depth[texel];
            edges[k][lane] = map.edge[texel];
        }
    }
    let rest = [one - part[0], one - part[1]];
    let shares = [
        rest[0] * rest[1],
        part[0] * rest[1],
        rest[0] * part[1],
        part[0] * part[1],
    ];
    let (mut seen, mut edge) = (zero, zero);
    for k in 0..4 {
        let share = shares[k];
        let depth = load(simd, &depths[k]);
        seen = seen + WideLanes::choose(depth.ge(nearest), share, zero);
        edge = edge + share * load(simd, &edges[k]);
    }
    match is_soft {
        true => {
            let t = smooth(0.0, EDGE_TEXELS, edge);
            seen * (t * (1.0 - LEAST_AT_EDGE) + splat(simd, LEAST_AT_EDGE))
        }
        false => seen,
    }
}
