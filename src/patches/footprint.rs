//! A small rectangle with cut corners around points of a plane.
//!
//! The points are reduced to their convex hull. Of 256 directions in a quarter turn the one is taken whose rectangle, less
//! what can be cut off its corners, has the least area: every eighth is tried, then the neighbors of the best.

use crate::abi::constants::PATCH_TURN;
use glam::Vec2;

/// Directions in a quarter turn.
pub(super) const TURNS: u16 = 256;

/// A rectangle with cut corners in the plane of the points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CutRectangle {
    /// Direction of the footprint, in 256ths of a quarter turn from the first axis of the plane.
    pub(super) turn: u8,
    /// Middle of the footprint, in the axes of the plane.
    pub(super) center: Vec2,
    /// Half sides, along the turned axes.
    pub(super) half: Vec2,
    /// As in [`super::record::NodePatch::corner_cuts`].
    pub(super) cuts: [f32; 4],
}

/// Unit vector of a turn, by steps that the device has as well; within 1.2e-7 of the exact one.
#[inline]
pub(super) fn direction(turn: u8) -> Vec2 {
    let turn = f32::from(turn);
    Vec2::new(sine(f32::from(TURNS) - turn), sine(turn))
}

/// Sine of a part of a quarter turn, 0 to 256, by the first seven terms of its series: what is left out is below 6e-10.
#[inline]
fn sine(turn: f32) -> f32 {
    let x = turn * PATCH_TURN;
    let square = x * x;
    let mut sum = 1.0;
    for quotient in [156.0, 110.0, 72.0, 42.0, 20.0, 6.0] {
        sum = 1.0 - square / quotient * sum;
    }
    x * sum
}

/// Signs of the corners, in the order of the cuts.
pub(super) const SIGNS: [Vec2; 4] = [
    Vec2::ONE,
    Vec2::new(-1.0, 1.0),
    Vec2::NEG_ONE,
    Vec2::new(1.0, -1.0),
];

/// Place of a sample of a grid of `count` by `count`, as shares of the half sides.
pub(super) fn sample([x, y]: [usize; 2], count: usize) -> Vec2 {
    Vec2::new(x as f32, y as f32) * (2.0 / count as f32) + Vec2::splat(1.0 / count as f32 - 1.0)
}

/// Tells whether a footprint contains a place, in shares of the half sides.
pub(super) fn contains(share: Vec2, corner_cuts: [f32; 4]) -> bool {
    let mut corners = SIGNS.iter().zip(corner_cuts);
    corners.all(|(sign, cut)| share.dot(*sign) <= 2.0 - cut)
}

/// Samples of a grid that lie in a footprint.
pub(super) fn samples(count: u8, corner_cuts: [f32; 4]) -> impl Iterator<Item = Vec2> {
    let side = usize::from(count);
    let all = (0..side * side).map(move |i| sample([i % side, i / side], side));
    all.filter(move |share| contains(*share, corner_cuts))
}

/// Working memory of [`around`].
#[derive(Debug, Default)]
pub(super) struct HullScratch {
    kept: Vec<Vec2>,
    hull: Vec<Vec2>,
}

/// A small rectangle with cut corners that contains all points, with room for rounding. No points, or one: a square of the
/// least size.
pub(super) fn around(points: &[Vec2], scratch: &mut HullScratch) -> CutRectangle {
    hull(points, scratch);
    let hull = &scratch.hull[..];
    let mut best = (f32::INFINITY, 0u8);
    let attempt = |turn: i32, best: &mut (f32, u8)| {
        let turn = turn.rem_euclid(i32::from(TURNS)) as u8;
        let area = fitted(hull, turn).1;
        if area < best.0 {
            *best = (area, turn);
        }
    };
    for turn in (0..i32::from(TURNS)).step_by(8) {
        attempt(turn, &mut best);
    }
    for step in [4, 2, 1] {
        let middle = i32::from(best.1);
        attempt(middle - step, &mut best);
        attempt(middle + step, &mut best);
    }
    fitted(hull, best.1).0
}

/// The rectangle of a direction around a hull, and its area.
fn fitted(hull: &[Vec2], turn: u8) -> (CutRectangle, f32) {
    let along = direction(turn);
    let across = along.perp();
    let turned = |p: Vec2| Vec2::new(p.dot(along), p.dot(across));
    let (mut min, mut max) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
    for &point in hull {
        let p = turned(point);
        (min, max) = (min.min(p), max.max(p));
    }
    if hull.is_empty() {
        (min, max) = (Vec2::ZERO, Vec2::ZERO);
    }
    let middle = 0.5 * (min + max);
    // Room for the rounding of single precision, and so that no side is zero.
    let size = (max - min).max_element();
    let room = (4e-6 * size + 1e-6 * (min.abs().max(max.abs())).max_element()).max(1e-30);
    let half = 0.5 * (max - min) + Vec2::splat(room);
    let mut reach = [f32::NEG_INFINITY; 4];
    for &point in hull {
        let q = (turned(point) - middle) / half;
        for (reach, sign) in reach.iter_mut().zip(SIGNS) {
            *reach = reach.max(q.dot(sign));
        }
    }
    // The same room, in half sides.
    let slack = 2.0 * room / half.min_element();
    let cuts = reach.map(|reach| (2.0 - reach - slack).clamp(0.0, 1.0));
    let share = 4.0 - 0.5 * cuts.iter().map(|cut| cut * cut).sum::<f32>();
    let rectangle = CutRectangle {
        turn,
        center: along * middle.x + across * middle.y,
        half,
        cuts,
    };
    (rectangle, half.x * half.y * share)
}

/// The convex hull, counter-clockwise (Andrew's monotone chain), of what is not inside of the octagon of the extremes.
fn hull(points: &[Vec2], HullScratch { kept, hull }: &mut HullScratch) {
    kept.clear();
    hull.clear();
    if points.len() > 24 {
        let extremes = extremes(points);
        kept.extend(points.iter().copied().filter(|&point| {
            let next = extremes.iter().cycle().skip(1);
            !extremes
                .iter()
                .zip(next)
                .all(|(&a, &b)| (b - a).perp_dot(point - a) > 0.0 || a == b)
        }));
    } else {
        kept.extend_from_slice(points);
    }
    kept.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    kept.dedup();
    if kept.len() < 3 {
        hull.extend_from_slice(kept);
        return;
    }
    let mut chain = |points: &mut dyn Iterator<Item = Vec2>| {
        let start = hull.len();
        for point in points {
            while let [.., a, b] = hull[start..] {
                let turn = (b - a).as_dvec2().perp_dot((point - b).as_dvec2());
                if turn > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(point);
        }
        // The last one begins the other chain.
        hull.pop();
    };
    chain(&mut kept.iter().copied());
    chain(&mut kept.iter().rev().copied());
}

/// The farthest points in eight directions, counter-clockwise.
fn extremes(points: &[Vec2]) -> [Vec2; 8] {
    const DIAGONAL: f32 = std::f32::consts::FRAC_1_SQRT_2;
    const DIRECTIONS: [Vec2; 4] = [
        Vec2::X,
        Vec2::new(DIAGONAL, DIAGONAL),
        Vec2::Y,
        Vec2::new(-DIAGONAL, DIAGONAL),
    ];
    let mut most = [(f32::NEG_INFINITY, Vec2::ZERO); 8];
    for &point in points {
        for (i, direction) in DIRECTIONS.into_iter().enumerate() {
            let along = point.dot(direction);
            if along > most[i].0 {
                most[i] = (along, point);
            }
            if -along > most[i + 4].0 {
                most[i + 4] = (-along, point);
            }
        }
    }
    most.map(|(_, point)| point)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(state: &mut u64) -> f32 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((*state >> 40) as f32) / (1u64 << 24) as f32
    }

    fn holds(rectangle: &CutRectangle, point: Vec2) -> bool {
        let along = direction(rectangle.turn);
        let p = point - rectangle.center;
        let q = Vec2::new(p.dot(along), p.dot(along.perp())) / rectangle.half;
        q.abs().max_element() <= 1.0
            && SIGNS
                .iter()
                .zip(rectangle.cuts)
                .all(|(sign, cut)| q.dot(*sign) <= 2.0 - cut)
    }

    fn area(rectangle: &CutRectangle) -> f32 {
        let cut: f32 = rectangle.cuts.iter().map(|cut| cut * cut).sum();
        rectangle.half.x * rectangle.half.y * (4.0 - 0.5 * cut)
    }

    #[test]
    fn every_point_lies_in_the_footprint() {
        let mut state = 3;
        for round in 0..400 {
            let count = [1, 2, 3, 5, 12, 40, 300][round % 7];
            let squeeze = [1.0, 0.1, 0.0, 1e-4][round / 7 % 4];
            let turn = Vec2::from_angle(random(&mut state) * 7.0);
            let points: Vec<Vec2> = (0..count)
                .map(|_| {
                    let p = Vec2::new(random(&mut state), random(&mut state) * squeeze);
                    p.rotate(turn) + Vec2::new(0.5, -2.0)
                })
                .collect();
            let rectangle = around(&points, &mut HullScratch::default());
            assert!(
                points.iter().all(|&p| holds(&rectangle, p)),
                "round {round}"
            );
        }
    }

    #[test]
    fn a_turned_square_and_an_octagon_lose_little() {
        let turn = Vec2::from_angle(0.3);
        let square: Vec<Vec2> = SIGNS.iter().map(|sign| sign.rotate(turn)).collect();
        let rectangle = around(&square, &mut HullScratch::default());
        assert!(area(&rectangle) < 4.02, "{rectangle:?}");
        let octagon: Vec<Vec2> = (0..8)
            .map(|i| Vec2::from_angle(0.3 + i as f32 * std::f32::consts::FRAC_PI_4))
            .collect();
        let rectangle = around(&octagon, &mut HullScratch::default());
        assert!(
            area(&rectangle) < 2.0f32.sqrt() * 2.0 * 1.08,
            "{rectangle:?}"
        );
    }

    #[test]
    fn the_hull_of_many_points_is_that_of_their_extremes() {
        let mut state = 9;
        let disc: Vec<Vec2> = (0..5000)
            .map(|_| Vec2::from_angle(random(&mut state) * 7.0) * random(&mut state).sqrt())
            .collect();
        let mut scratch = HullScratch::default();
        hull(&disc, &mut scratch);
        let reduced = scratch.kept.len();
        let found = scratch.hull.clone();
        assert!(
            reduced < 1500 && found.len() > 20,
            "{reduced} {}",
            found.len()
        );
        for &point in &disc {
            let next = found.iter().cycle().skip(1);
            for (&a, &b) in found.iter().zip(next) {
                assert!((b - a).perp_dot(point - a) > -1e-6);
            }
        }
    }
}
