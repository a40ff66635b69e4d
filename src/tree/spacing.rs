//! Distance of each point of a cloud to its neighbors, found through the tree's own order.

use super::nearest_points::{NearestPoints, NeighborSearch, boxes};
use super::neighborhood::{NeighborPlane, plane_of};
use super::shape::TreeShape;
use glam::Vec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// The radius of a point is the distance to the neighbor of this rank (QSplat, section 2.2, leaves the number open).
pub(super) const NEIGHBORS: usize = 6;

/// A point that stands apart, off the surface of a scan, is far from all others. Its radius is at most this many times the
/// median of its neighbors' radii, so that it is a dot and no box. Where a cloud is sparse its neighbors are as far apart
/// as itself, and nothing changes.
const MOST_OF_NEIGHBORS: f32 = 3.0;

/// Several points that stand apart together are each other's neighbors: of those no more counts than this many times the
/// median of those around.
const MOST_AROUND: f32 = 1.5;

/// Points without a surface (leaves, dust) are no larger than this many times the median of those with one, where these are at
/// least a tenth: a scanner puts its points as densely on both, and nothing has to be closed.
const MOST_OF_SURFACE: f32 = 1.5;

/// What is known of the points of a cloud by their neighbors, in the order of the tree.
#[derive(Debug, Default)]
pub(super) struct CloudSpacing {
    /// Radius of each.
    pub(super) radii: Vec<f32>,
    /// Normal of each, either way around; zero where there is no surface. Empty unless it was asked for.
    pub(super) normals: Vec<Vec3>,
}

/// Normals of the points of a cloud, as its spacing meets them.
#[derive(Debug, Clone, Copy)]
pub(super) enum CloudNormals<'a> {
    /// Normals from the file, one a point; zero where it has none.
    Given(&'a [Vec3]),
    /// Normals are to be found by the planes of neighbors.
    Wanted,
    /// Nobody asks for normals.
    Unwanted,
}

/// Cosine of the largest angle between normals of one surface, a sixth of a turn.
const LEAST_AGREEMENT: f32 = 0.5;

/// Part of its radius that a point of a thin rim keeps at least. Even points close at 0.58 of it; more stands out like petals.
const SHARE_OF_RIM: f32 = 0.75;

/// Spacing at a point.
#[derive(Debug, Clone, Copy, Default)]
struct PointSpacing {
    /// The radius, before it is compared with others.
    radius: f32,
    /// The neighbors make no surface, so that nothing has to be closed.
    is_scattered: bool,
}

/// Neighbors in the order of the tree among which a point must stand out before its nearest are looked for again.
const AROUND: usize = 64;

/// For each of `points`, in tree order, a radius: the distance to its sixth nearest other place; to the farthest one if there
/// are fewer places, 0 if there is none; less where a point stands apart ([`MOST_OF_NEIGHBORS`]). Where its neighbors make no
/// surface it is less too ([`plane_of`]), at most the median of those around and little more than that of all with a surface
/// ([`MOST_OF_SURFACE`]). A thin rim looks scattered, too: a given normal that agrees with those of half of its neighbors is one
/// of a surface. The normals of their planes where they are wanted.
///
/// Deterministic. About O(n log n) also for coincident points. `stop` ends it early with zeros; `done` hears of numbers of
/// finished points.
pub(super) fn measure(
    shape: &TreeShape,
    points: &[Vec3],
    cloud_normals: CloudNormals<'_>,
    (stop, done): (&AtomicBool, &(dyn Fn(u64) + Sync)),
) -> CloudSpacing {
    let boxes = boxes(shape, points);
    let search = SpacingSearch {
        nearest: NeighborSearch {
            shape,
            points,
            boxes: &boxes,
        },
        given: match cloud_normals {
            CloudNormals::Given(normals) => normals,
            CloudNormals::Wanted | CloudNormals::Unwanted => &[],
        },
    };
    let with_normals = matches!(cloud_normals, CloudNormals::Wanted);
    let mut spacings = vec![PointSpacing::default(); points.len()];
    let mut normals = vec![Vec3::ZERO; if with_normals { points.len() } else { 0 }];
    let blocks = search.nearest.blocks();
    let mut work = Vec::with_capacity(blocks.len());
    let (mut rest, mut rest_of_normals) = (&mut spacings[..], &mut normals[..]);
    for block in blocks {
        let (own, after) = rest.split_at_mut(block.points.len());
        let count = if with_normals { own.len() } else { 0 };
        let (own_normals, normals_after) = rest_of_normals.split_at_mut(count);
        work.push((block, own, own_normals));
        (rest, rest_of_normals) = (after, normals_after);
    }
    work.into_par_iter().for_each(|(block, spacings, normals)| {
        if stop.load(Ordering::Relaxed) {
            return;
        }
        let first = block.points.start;
        search.nearest.of_block(&block, &mut |index, nearest| {
            let (found, plane) = search.spacing(index, nearest);
            spacings[(index - first) as usize] = found;
            if let Some(normal) = normals.get_mut((index - first) as usize) {
                *normal = plane.normal;
            }
        });
        done(spacings.len() as u64);
    });
    let most = most_without_surface(&spacings);
    let limited: Vec<(u32, f32)> = spacings
        .par_chunks(AROUND)
        .enumerate()
        .with_min_len(64)
        .flat_map_iter(|(chunk, own)| search.limited(&spacings, (chunk * AROUND, own, most), stop))
        .collect();
    for (index, radius) in limited {
        spacings[index as usize].radius = radius;
    }
    CloudSpacing {
        radii: spacings.into_iter().map(|spacing| spacing.radius).collect(),
        normals,
    }
}

/// The largest radius of a point without a surface ([`MOST_OF_SURFACE`]).
fn most_without_surface(spacings: &[PointSpacing]) -> f32 {
    // Some thousands say as much as all.
    const SAMPLES: usize = 1 << 14;
    let step = spacings.len().div_ceil(SAMPLES).max(1);
    let samples = spacings.iter().step_by(step);
    let count = samples.clone().count();
    let with_surface = samples.filter(|own| !own.is_scattered && own.radius > 0.0);
    let mut radii: Vec<f32> = with_surface.map(|own| own.radius).collect();
    match radii.len() * 10 >= count {
        true if !radii.is_empty() => MOST_OF_SURFACE * median(&mut radii),
        _ => f32::INFINITY,
    }
}

/// The upper median; 0 of nothing.
fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

struct SpacingSearch<'a> {
    nearest: NeighborSearch<'a>,
    /// Normals from the file, or none.
    given: &'a [Vec3],
}

impl SpacingSearch<'_> {
    /// The points among `own`, the spacings from point `first` on, that stand apart, with the radius that is left to them.
    fn limited(
        &self,
        spacings: &[PointSpacing],
        (first, own, most_without_surface): (usize, &[PointSpacing], f32),
        stop: &AtomicBool,
    ) -> Vec<(u32, f32)> {
        if stop.load(Ordering::Relaxed) {
            return Vec::new();
        }
        let around = median(&mut own.iter().map(|spacing| spacing.radius).collect::<Vec<_>>());
        (first as u32..)
            .zip(own)
            .filter_map(
                |(
                    index,
                    &PointSpacing {
                        radius,
                        is_scattered,
                    },
                )| {
                    if is_scattered {
                        let most = around.min(most_without_surface);
                        return (radius > most).then_some((index, most));
                    }
                    if radius <= MOST_OF_NEIGHBORS * around {
                        return None;
                    }
                    let nearest = self.nearest.of_point(index);
                    let mut theirs: Vec<f32> = (nearest.indices().take(NEIGHBORS))
                        .map(|neighbor| spacings[neighbor as usize].radius)
                        .collect();
                    let most = MOST_OF_NEIGHBORS * median(&mut theirs).min(MOST_AROUND * around);
                    (radius > most).then_some((index, most))
                },
            )
            .collect()
    }

    fn spacing(&self, index: u32, nearest: &NearestPoints) -> (PointSpacing, NeighborPlane) {
        let points = self.nearest.points;
        let around = nearest.indices().map(|own| points[own as usize]);
        let mut plane = plane_of(around.map(|p| p - nearest.at));
        let is_rim = plane.share < 1.0 && !plane.is_line && self.agrees_with(nearest, index);
        if is_rim {
            plane.share = plane.share.max(SHARE_OF_RIM);
        }
        let farthest = nearest.distances_squared().take(NEIGHBORS).last();
        let spacing = PointSpacing {
            radius: farthest.unwrap_or(0.0).sqrt() * plane.share,
            is_scattered: plane.share < 1.0 && !is_rim,
        };
        (spacing, plane)
    }

    /// Tells whether the given normal of a point agrees with those of half of its neighbors.
    fn agrees_with(&self, nearest: &NearestPoints, index: u32) -> bool {
        let Some(own) = self.given.get(index as usize) else {
            return false;
        };
        let agree =
            (nearest.indices()).filter(|&i| self.given[i as usize].dot(*own) > LEAST_AGREEMENT);
        agree.count() * 2 >= nearest.count()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::super::nearest_points::LOOKED_AT;
    use super::*;

    fn measured(count: u32, points: &[Vec3]) -> Vec<f32> {
        let shape = TreeShape::new(count);
        measure(
            &shape,
            points,
            CloudNormals::Unwanted,
            (&AtomicBool::new(false), &|_| {}),
        )
        .radii
    }

    /// Distance to the sixth nearest other place, or to the farthest.
    fn sixth(points: &[Vec3], index: usize) -> f32 {
        let own = points[index];
        let mut places: Vec<Vec3> = points.iter().copied().filter(|p| *p != own).collect();
        places.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).unwrap());
        places.dedup();
        let mut far: Vec<f32> = places.iter().map(|p| p.distance_squared(own)).collect();
        far.sort_by(f32::total_cmp);
        far.truncate(NEIGHBORS);
        far.last().map_or(0.0, |far| far.sqrt())
    }

    fn brute_force(points: &[Vec3], index: usize) -> PointSpacing {
        let mut places: Vec<Vec3> = points
            .iter()
            .copied()
            .filter(|p| *p != points[index])
            .collect();
        places.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).unwrap());
        places.dedup();
        let own = points[index];
        places.sort_by(|a, b| a.distance_squared(own).total_cmp(&b.distance_squared(own)));
        places.truncate(LOOKED_AT);
        let share = plane_of(places.iter().map(|&p| p - own)).share;
        PointSpacing {
            radius: sixth(points, index) * share,
            is_scattered: share < 1.0,
        }
    }

    /// The radius that is left to a point: `raw` of all, and the nearest by brute force.
    fn limited(points: &[Vec3], raw: &[PointSpacing], index: usize) -> f32 {
        let chunk = index / AROUND * AROUND;
        let of = |own: &[PointSpacing]| own.iter().map(|own| own.radius).collect::<Vec<_>>();
        let around = median(&mut of(&raw[chunk..raw.len().min(chunk + AROUND)]));
        let own = raw[index];
        if own.is_scattered {
            return own.radius.min(around).min(most_without_surface(raw));
        }
        let mut order: Vec<usize> = (0..points.len())
            .filter(|&i| points[i] != points[index])
            .collect();
        order.sort_by(|&a, &b| {
            let distance = |i: usize| points[i].distance_squared(points[index]);
            distance(a).total_cmp(&distance(b))
        });
        order.dedup_by_key(|i| points[*i].to_array().map(f32::to_bits));
        order.truncate(NEIGHBORS);
        let theirs = median(&mut order.iter().map(|&i| raw[i].radius).collect::<Vec<_>>());
        let most = MOST_OF_NEIGHBORS * theirs.min(MOST_AROUND * around);
        if own.radius > MOST_OF_NEIGHBORS * around {
            own.radius.min(most)
        } else {
            own.radius
        }
    }

    /// The neighbors of a point beside a row lie in one plane with it, and yet it is no part of a surface.
    #[test]
    fn points_beside_what_is_measured_stay_dots() {
        let wall = (0..400).map(|i| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0));
        let row = (0..60).map(|i| Vec3::new(100.0 + i as f32, 0.0, 0.0));
        let apart = [[130.0, 0.0, 10.0], [115.0, 12.0, 0.0], [142.0, -9.0, 4.0]];
        let points: Vec<Vec3> = (wall.chain(row))
            .chain(apart.map(Vec3::from_array))
            .collect();
        let radii = measured(463, &points);
        let of_wall = median(&mut radii[..400].to_vec());
        for radius in &radii[460..] {
            assert!(*radius <= MOST_OF_SURFACE * of_wall, "{radius} {of_wall}");
        }
        // Corners close as the rest does.
        assert!(radii[0] >= of_wall && radii[399] >= of_wall, "{of_wall}");
    }

    #[test]
    fn given_normals_tell_a_thin_rod_from_dust() {
        // Seven around, as far apart along: twelve neighbors reach around more than half of it.
        let at = |i: usize| {
            let turn = (i % 7) as f32 * std::f32::consts::TAU / 7.0;
            Vec3::new(turn.cos(), turn.sin(), (i / 7) as f32 * 0.868)
        };
        let points: Vec<Vec3> = (0..322).map(at).collect();
        let outward: Vec<Vec3> = points.iter().map(|p| p.with_z(0.0).normalize()).collect();
        let shape = TreeShape::new(322);
        let radii = |cloud_normals| {
            measure(
                &shape,
                &points,
                cloud_normals,
                (&AtomicBool::new(false), &|_| {}),
            )
            .radii
        };
        let given = radii(CloudNormals::Given(&outward));
        for (index, radius) in given.iter().enumerate().take(304).skip(16) {
            assert_eq!(
                *radius,
                SHARE_OF_RIM * sixth(&points, index),
                "point {index}"
            );
        }
        // Normals that do not agree are no sign of a surface.
        let torn: Vec<Vec3> = (0..322)
            .map(|i| [Vec3::X, Vec3::Y, Vec3::Z][i % 3])
            .collect();
        for radii in [
            radii(CloudNormals::Unwanted),
            radii(CloudNormals::Given(&torn)),
        ] {
            let shares = radii.iter().zip(&given).map(|(own, given)| own / given);
            let least = shares.clone().fold(1.0, f32::min);
            assert!(shares.filter(|share| *share < 0.9).count() > 100, "{least}");
        }
    }

    #[test]
    fn a_point_that_stands_apart_is_no_larger_than_three_of_its_neighbors() {
        // A dense sheet, a sparse one far from it, and single points and pairs off the first.
        let mut points: Vec<(Vec3, f32)> = (0..4096)
            .map(|i| (Vec3::new((i % 64) as f32, (i / 64) as f32, 0.0), 1.0))
            .collect();
        points.extend((0..256).map(|i| {
            let at = Vec3::new(300.0 + 20.0 * (i % 16) as f32, 20.0 * (i / 16) as f32, 0.0);
            (at, 20.0)
        }));
        for (k, (x, y)) in [(10.0, 10.0), (32.0, 50.0), (60.0, 5.0)]
            .into_iter()
            .enumerate()
        {
            for (j, z) in [30.0, -25.0, -25.5].into_iter().enumerate() {
                points.insert(400 * k + 50 * j, (Vec3::new(x, y, z), 1.0));
            }
        }
        let (points, least): (Vec<Vec3>, Vec<f32>) = points.into_iter().unzip();
        let found = measured(points.len() as u32, &points);
        for (index, (radius, least)) in found.into_iter().zip(least).enumerate() {
            // In a corner of a lattice the sixth neighbor is two diagonals away.
            assert!(
                (least..=least * 8f32.sqrt()).contains(&radius),
                "{index}: {radius}"
            );
        }
    }

    #[test]
    fn radii_match_a_search_of_all_pairs() {
        let mut state = 9u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        for n in [1usize, 2, 5, 6, 7, 20, 300] {
            for cells in [2.0, 7.0, 1e6] {
                // The order only decides how fast it is.
                let points: Vec<Vec3> = (0..n)
                    .map(|_| (Vec3::new(random(), random(), random()) * cells).floor())
                    .collect();
                let radii = measured(n as u32, &points);
                let raw: Vec<PointSpacing> =
                    (0..n).map(|index| brute_force(&points, index)).collect();
                for (index, radius) in radii.into_iter().enumerate() {
                    // Of equally far neighbors any may be the last, and the plane is that of those that are found.
                    if cells < 100.0 {
                        assert!(radius <= sixth(&points, index), "{n} points, {cells} cells");
                        continue;
                    }
                    assert_eq!(
                        radius,
                        limited(&points, &raw, index),
                        "{n} points, {cells} cells"
                    );
                }
            }
        }
    }

    #[test]
    fn coincident_points_do_not_take_quadratic_time() {
        let n = 200_000;
        let points: Vec<Vec3> = (0..n).map(|i| Vec3::splat((i * 3 / n) as f32)).collect();
        let radii = measured(n as u32, &points);
        assert_eq!(radii[0], 12f32.sqrt());
        assert_eq!(radii[n / 2], 3f32.sqrt());
    }
}
