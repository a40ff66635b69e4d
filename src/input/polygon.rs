//! Faces of more than three corners as triangles.
//!
//! Readers write every face as the fan about its first corner, at once: a face may come before its vertices. When all is
//! read, [`PolygonRuns::cut`] looks at the fans: one that turns back on itself is no triangulation of its face. A quad
//! then takes its other diagonal, anything longer is cut by ear clipping (the earcut crate) in the plane of its vector
//! area. A face of n corners has n - 2 triangles either way, so nothing moves.

use earcut::Earcut;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::job::ReadJob;
use super::{Error, ReadWarning};

/// A face of more corners than this stays a fan: clipping ears takes the square of their number.
const MOST_CORNERS: usize = 1 << 14;

/// Triangles per parallel piece.
const PIECE: usize = 1 << 13;

/// Faces of one number of corners, one after the other.
#[derive(Debug, Clone, Copy)]
struct FaceRun {
    /// First triangle of the run.
    first: usize,
    corners: usize,
    count: usize,
}

/// Where the fans of more than one triangle are.
#[derive(Debug, Clone, Default)]
pub(super) struct PolygonRuns {
    runs: Vec<FaceRun>,
}

impl PolygonRuns {
    /// Notes a face whose fan begins at triangle `first`, which never falls.
    #[inline]
    pub(super) fn push(&mut self, first: usize, corners: usize) {
        if corners <= 3 {
            return;
        }
        if let Some(last) = self.runs.last_mut()
            && last.corners == corners
            && last.first + last.count * (corners - 2) == first
        {
            last.count += 1;
            return;
        }
        self.runs.push(FaceRun {
            first,
            corners,
            count: 1,
        });
    }

    /// The first triangle of each face, and how many it has.
    pub(super) fn faces(&self) -> impl Iterator<Item = (usize, usize)> {
        self.runs.iter().flat_map(|run| {
            let fan = run.corners - 2;
            (0..run.count).map(move |face| (run.first + face * fan, fan))
        })
    }

    /// Replaces the fans that turn back on themselves. `point` gives the position of a corner. Linear in the number of
    /// corners but for concave faces of over four. What has no area, crosses itself or is not finite stays as it is.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub(super) fn cut(
        &self,
        job: &mut ReadJob<'_>,
        triangles: &mut [[u32; 3]],
        point: impl Fn(u32) -> DVec3 + Sync,
    ) -> Result<(), Error> {
        self.turn_alike(triangles);
        let mut pieces = Vec::new();
        let (mut rest, mut at) = (&mut *triangles, 0);
        for run in &self.runs {
            let fan = run.corners - 2;
            let (_, tail) = rest.split_at_mut(run.first - at);
            let (body, tail) = tail.split_at_mut(run.count * fan);
            pieces.extend(
                body.chunks_mut(PIECE.div_ceil(fan) * fan)
                    .map(|piece| (fan, piece)),
            );
            (rest, at) = (tail, run.first + run.count * fan);
        }
        let progress = job.progress;
        pieces.into_par_iter().with_min_len(64).try_for_each_init(
            FaceClipper::default,
            |clipper, (fan, piece)| {
                if progress.is_cancelled() {
                    return Err(Error::Cancelled);
                }
                for face in piece.chunks_exact_mut(fan) {
                    if let [first, second] = face {
                        cut_quad(first, second, &point);
                    } else if fan + 2 <= MOST_CORNERS {
                        clipper.cut(face, &point);
                    }
                }
                Ok(())
            },
        )?;
        let too_long = self.runs.iter().filter(|run| run.corners > MOST_CORNERS);
        let too_long = too_long.map(|run| run.count as u64).sum();
        job.warn_count(too_long, |count| ReadWarning::PolygonsTooLong {
            count,
            most: MOST_CORNERS as u64,
        });
        Ok(())
    }
}

/// Up to this many faces all are looked at for others with the same corners, of more as many as are sampled.
const SAMPLED_FACES: usize = 1 << 16;

impl PolygonRuns {
    /// Gives faces with the same corners the same first one. The back of a sheet made two-sided then has the triangles of
    /// its front turned round, whatever corner the file begins with.
    fn turn_alike(&self, triangles: &mut [[u32; 3]]) {
        let faces: usize = self.runs.iter().map(|run| run.count).sum();
        let sampled = |mask: u64| {
            let mut keys = self.keys(triangles, mask);
            keys.par_sort_unstable();
            keys
        };
        let are_alike = |a: &FaceKey, b: &FaceKey| (a.hash, a.fan) == (b.hash, b.fan);
        if faces > SAMPLED_FACES {
            let mask = (faces / SAMPLED_FACES).next_power_of_two() as u64 - 1;
            let keys = sampled(mask);
            let pairs = keys.windows(2).filter(|two| are_alike(&two[0], &two[1]));
            if pairs.count() * 100 <= keys.len() {
                return;
            }
        }
        let mut corners = Vec::new();
        for set in sampled(0).chunk_by(are_alike) {
            let first = triangles[set[0].first][0];
            for key in &set[1..] {
                let face = &mut triangles[key.first..key.first + key.fan];
                corners_of(face, &mut corners);
                // None when only the hashes are equal.
                if let Some(at) = corners.iter().position(|&corner| corner == first) {
                    corners.rotate_left(at);
                    for (index, triangle) in face.iter_mut().enumerate() {
                        *triangle = [corners[0], corners[index + 1], corners[index + 2]];
                    }
                }
            }
        }
    }

    /// The keys of the faces whose hash has none of the bits of `mask`; their fans are whole.
    fn keys(&self, triangles: &[[u32; 3]], mask: u64) -> Vec<FaceKey> {
        self.runs
            .par_iter()
            .flat_map(|run| {
                let fan = run.corners - 2;
                (0..run.count)
                    .into_par_iter()
                    .with_min_len(4096)
                    .map(move |face| FaceKey::of(triangles, run.first + face * fan, fan))
            })
            .filter(|key| key.hash & mask == 0)
            .collect()
    }
}

/// A face, to find others with the same corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct FaceKey {
    /// The sum of the hashes of its corners, in whatever order.
    hash: u64,
    /// Number of triangles.
    fan: usize,
    /// The first of them.
    first: usize,
}

impl FaceKey {
    fn of(triangles: &[[u32; 3]], first: usize, fan: usize) -> Self {
        let mix = |corner: u32| {
            let spread = (u64::from(corner) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let product = u128::from(spread) * 0xd6e8_feb8_6659_fd93;
            (product >> 64) as u64 ^ product as u64
        };
        let [a, b, _] = triangles[first];
        let others = triangles[first..first + fan].iter();
        let hash = others
            .map(|triangle| mix(triangle[2]))
            .fold(mix(a).wrapping_add(mix(b)), u64::wrapping_add);
        Self { hash, fan, first }
    }
}

/// The corners of a face that is a fan.
fn corners_of(face: &[[u32; 3]], corners: &mut Vec<u32>) {
    corners.clear();
    corners.extend(&face[0][..2]);
    corners.extend(face.iter().map(|triangle| triangle[2]));
}

/// The faces of a file while it is read.
#[derive(Debug, Clone, Default)]
pub(super) struct FaceList {
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) polygons: PolygonRuns,
    /// Faces so far, those that are left out too.
    pub(super) faces: u64,
    /// Faces of fewer than three corners.
    pub(super) small: u64,
    /// Faces that name their first corner again at their end.
    pub(super) closed: u64,
}

impl FaceList {
    /// Adds a face as a fan, without a first corner that is named again at its end.
    #[inline]
    pub(super) fn push(&mut self, corners: &[u32]) {
        self.faces += 1;
        if let [first, second, third] = *corners {
            self.triangles.push([first, second, third]);
            return;
        }
        let length = without_repeated(corners, |&corner| corner);
        self.closed += u64::from(length < corners.len());
        let Some((&first, fan)) = corners[..length].split_first().filter(|_| length >= 3) else {
            self.small += 1;
            return;
        };
        self.polygons.push(self.triangles.len(), length);
        self.triangles
            .extend(fan.windows(2).map(|pair| [first, pair[0], pair[1]]));
    }

    /// Says what was left out.
    pub(super) fn warn(&self, job: &mut ReadJob<'_>) {
        job.warn_count(self.small, |count| ReadWarning::FacesTooSmall { count });
        job.warn_count(self.closed, |count| ReadWarning::FirstCornerRepeated {
            count,
        });
    }
}

/// The number of corners without those at the end that are the first again.
#[inline]
pub(super) fn without_repeated<T>(corners: &[T], vertex: impl Fn(&T) -> u32) -> usize {
    let mut length = corners.len();
    while length > 3 && vertex(&corners[length - 1]) == vertex(&corners[0]) {
        length -= 1;
    }
    length
}

/// Gives a quad the diagonal inside of it, where the first is outside.
#[inline]
fn cut_quad(first: &mut [u32; 3], second: &mut [u32; 3], point: &impl Fn(u32) -> DVec3) {
    let corners = [first[0], first[1], first[2], second[2]];
    let [a, b, c, d] = corners.map(point);
    let (one, other) = ((b - a).cross(c - a), (c - a).cross(d - a));
    let normal = one + other;
    // False for what is not finite.
    if !(one.dot(normal) < 0.0 || other.dot(normal) < 0.0) {
        return;
    }
    let (one, other) = ((c - b).cross(d - b), (d - b).cross(a - b));
    if one.dot(normal) >= 0.0 && other.dot(normal) >= 0.0 {
        let [a, b, c, d] = corners;
        (*first, *second) = ([b, c, d], [b, d, a]);
    }
}

/// Cuts faces of any number of corners; keeps its memory from one to the next.
struct FaceClipper {
    earcut: Earcut<f64>,
    corners: Vec<u32>,
    /// Corners from the first one, in space and in the face's plane.
    offsets: Vec<DVec3>,
    flat: Vec<[f64; 2]>,
    indices: Vec<u32>,
    is_used: Vec<bool>,
}

impl Default for FaceClipper {
    fn default() -> Self {
        Self {
            earcut: Earcut::new(),
            corners: Vec::new(),
            offsets: Vec::new(),
            flat: Vec::new(),
            indices: Vec::new(),
            is_used: Vec::new(),
        }
    }
}

impl FaceClipper {
    fn cut(&mut self, face: &mut [[u32; 3]], point: &impl Fn(u32) -> DVec3) {
        corners_of(face, &mut self.corners);
        let origin = point(self.corners[0]);
        self.offsets.clear();
        self.offsets
            .extend(self.corners.iter().map(|&corner| point(corner) - origin));
        let normals = || {
            self.offsets[1..]
                .windows(2)
                .map(|pair| pair[0].cross(pair[1]))
        };
        let normal: DVec3 = normals().sum();
        // False for what is not finite.
        if !normals().any(|one| one.dot(normal) < 0.0) {
            return;
        }
        let Some(normal) = normal.try_normalize() else {
            return;
        };
        let (u, v) = normal.any_orthonormal_pair();
        self.flat.clear();
        self.flat.extend(
            self.offsets
                .iter()
                .map(|offset| DVec2::new(offset.dot(u), offset.dot(v)).to_array()),
        );
        self.earcut
            .earcut(self.flat.iter().copied(), &[], &mut self.indices);
        self.write(face);
    }

    /// Writes the clipped ears over the fan.
    fn write(&mut self, face: &mut [[u32; 3]]) {
        let Self {
            corners,
            indices,
            is_used,
            ..
        } = self;
        if indices.is_empty() {
            return;
        }
        is_used.clear();
        is_used.resize(corners.len(), false);
        // What is not filled has no area.
        face.fill([corners[0]; 3]);
        let mut slots = face.iter_mut();
        for triangle in indices.chunks_exact(3) {
            let mut triangle = [triangle[0], triangle[1], triangle[2]];
            // In the order of the face they have its orientation.
            triangle.sort_unstable();
            if let Some(slot) = slots.next() {
                *slot = triangle.map(|index| corners[index as usize]);
            }
            triangle
                .iter()
                .for_each(|&index| is_used[index as usize] = true);
        }
        // Corners on a straight line were left out. Neighbors may name them, so each gets a triangle of no area between
        // the corners that stayed: the surface keeps its edges.
        let Some(first) = is_used.iter().position(|&used| used) else {
            return;
        };
        let (mut stayed, mut previous) = (first, first);
        for step in 1..=corners.len() {
            let index = (first + step) % corners.len();
            if previous != stayed
                && let Some(slot) = slots.next()
            {
                *slot = [stayed, previous, index].map(|index| corners[index]);
            }
            if is_used[index] {
                stayed = index;
            }
            previous = index;
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;
    use crate::input::ReadOptions;
    use crate::progress::SilentProgress;
    use std::path::Path;

    /// The triangles of faces over points in a plane.
    fn cut(points: &[[f64; 2]], faces: &[&[u32]]) -> Vec<[u32; 3]> {
        let mut list = FaceList::default();
        faces.iter().for_each(|face| list.push(face));
        let (options, mut triangles) = (ReadOptions::default(), list.triangles.clone());
        let mut job = ReadJob::new(Path::new("a"), None, &options, &SilentProgress);
        // A plane on the slant.
        let point = |index: u32| {
            let [x, y] = points[index as usize];
            DVec3::new(x, y, 3.0 - 0.5 * x + 2.0 * y)
        };
        list.polygons.cut(&mut job, &mut triangles, point).unwrap();
        assert_eq!(triangles.len(), list.triangles.len());
        triangles
    }

    fn area(points: &[[f64; 2]], triangle: [u32; 3]) -> f64 {
        let [a, b, c] = triangle.map(|corner| DVec2::from_array(points[corner as usize]));
        0.5 * (b - a).perp_dot(c - a)
    }

    /// Directed edges that no other cancels.
    fn rim(triangles: &[[u32; 3]]) -> Vec<(u32, u32)> {
        let edges: Vec<(u32, u32)> = triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
            .collect();
        let mut rim: Vec<_> = edges
            .iter()
            .copied()
            .filter(|&(a, b)| !edges.contains(&(b, a)))
            .collect();
        rim.sort_unstable();
        rim
    }

    #[test]
    fn convex_faces_stay_fans() {
        let points = [
            [0.0, 0.0],
            [2.0, 0.0],
            [3.0, 1.0],
            [2.0, 2.0],
            [0.0, 2.0],
            [0.0, 1.0],
        ];
        assert_eq!(
            cut(&points, &[&[0, 1, 2, 3, 4, 5], &[0, 1, 2], &[0, 1, 3, 4]]),
            [
                [0, 1, 2],
                [0, 2, 3],
                [0, 3, 4],
                [0, 4, 5],
                [0, 1, 2],
                [0, 1, 3],
                [0, 3, 4]
            ]
        );
    }

    #[test]
    fn a_quad_takes_the_diagonal_inside_whatever_corner_is_first() {
        let dart = [[0.0, 0.0], [2.0, 2.0], [0.0, 0.5], [-2.0, 2.0]];
        for first in 0..4 {
            let face: Vec<u32> = (0..4).map(|i| (i + first) % 4).collect();
            let triangles = cut(&dart, &[&face]);
            assert!(triangles.iter().all(|t| t.contains(&0) && t.contains(&2)));
            assert!(triangles.iter().all(|&t| area(&dart, t) > 0.4));
        }
    }

    #[test]
    fn a_concave_face_is_covered_once_and_keeps_its_rim() {
        // A comb with points on its straight sides.
        let mut points = Vec::new();
        for tooth in 0..40 {
            let x = f64::from(tooth);
            points.extend([[x, 0.0], [x + 0.5, 0.0]]);
        }
        for tooth in (0..40).rev() {
            let x = f64::from(tooth);
            points.extend([
                [x + 0.7, 1.0],
                [x + 0.6, 5.0],
                [x + 0.4, 5.0],
                [x + 0.3, 1.0],
            ]);
        }
        let face: Vec<u32> = (0..points.len() as u32).collect();
        let triangles = cut(&points, &[&face]);
        let areas: Vec<f64> = triangles.iter().map(|&t| area(&points, t)).collect();
        let all = face.iter().zip(face.iter().cycle().skip(1));
        let wanted: f64 = all
            .clone()
            .map(|(&a, &b)| {
                let [a, b] = [a, b].map(|i| DVec2::from_array(points[i as usize]));
                0.5 * a.perp_dot(b)
            })
            .sum();
        assert!(areas.iter().all(|&area| area > -1e-9), "{areas:?}");
        assert!((areas.iter().sum::<f64>() - wanted).abs() < 1e-9);
        let mut sides: Vec<_> = all.map(|(&a, &b)| (a, b)).collect();
        sides.sort_unstable();
        assert_eq!(rim(&triangles), sides);
    }

    #[test]
    fn what_has_no_inside_stays_a_fan() {
        let bow_tie = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        assert_eq!(cut(&bow_tie, &[&[0, 1, 2, 3]]), [[0, 1, 2], [0, 2, 3]]);
        let line = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0], [2.0, 0.0], [0.5, 0.0]];
        assert_eq!(cut(&line, &[&[0, 1, 2, 3, 4]]).len(), 3);
        let broken = [
            [0.0, 0.0],
            [1.0, f64::NAN],
            [1.0, 1.0],
            [0.2, 0.3],
            [0.0, 1.0],
        ];
        assert_eq!(cut(&broken, &[&[0, 1, 2, 3, 4]])[0], [0, 1, 2]);
    }

    #[test]
    fn the_back_of_a_face_has_its_triangles_turned_round() {
        let points = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 3.0], [0.0, 2.0]];
        let sets = |triangles: &[[u32; 3]]| {
            let mut sets: Vec<[u32; 3]> = triangles.to_vec();
            sets.iter_mut()
                .for_each(|triangle| triangle.sort_unstable());
            sets.sort_unstable();
            sets
        };
        for start in 0..5 {
            let back: Vec<u32> = (0..5).map(|i| (10 + start - i) % 5).collect();
            let triangles = cut(&points, &[&[0, 1, 2, 3, 4], &[0, 1, 2], &back]);
            let (front, back) = (&triangles[..3], &triangles[4..]);
            assert_eq!(sets(front), sets(back), "{back:?}");
            assert!(back.iter().all(|&t| area(&points, t) < 0.0));
        }
    }

    #[test]
    fn a_first_corner_at_the_end_is_no_corner() {
        let mut list = FaceList::default();
        list.push(&[0, 1, 2, 3, 0]);
        list.push(&[0, 1, 2, 0]);
        list.push(&[0, 1, 0, 0]);
        list.push(&[0, 1]);
        assert_eq!(list.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 1, 0]]);
        assert_eq!((list.faces, list.small, list.closed), (4, 1, 3));
    }

    #[test]
    fn the_worst_faces_end() {
        // Corners that jump to and fro: every ear holds others.
        let mut state = 1_u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f64
        };
        let points: Vec<[f64; 2]> = (0..MOST_CORNERS).map(|_| [next(), next()]).collect();
        let face: Vec<u32> = (0..points.len() as u32).collect();
        let start = std::time::Instant::now();
        cut(&points, &[&face]);
        let seconds = start.elapsed().as_secs_f64();
        // Below one in an optimized build.
        assert!(seconds < 40.0, "{seconds} s");
    }
}
