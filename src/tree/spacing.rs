//! Distance of each point of a cloud to its neighbors, found through the tree's own order.

use super::shape::Shape;
use glam::Vec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// The radius of a point is the distance to the neighbor of this rank (QSplat, section 2.2, leaves the number open).
pub(super) const NEIGHBORS: usize = 6;

/// An axis-aligned box.
#[derive(Clone, Copy)]
struct Bounds {
    min: Vec3,
    max: Vec3,
}

impl Bounds {
    fn distance_squared(&self, p: Vec3) -> f32 {
        (self.min - p)
            .max(p - self.max)
            .max(Vec3::ZERO)
            .length_squared()
    }

    fn is_point(&self) -> bool {
        self.min == self.max
    }
}

/// The nearest neighbors found so far, at different places: coincident points count once, and the point itself never.
struct Nearest {
    at: Vec3,
    found: [(f32, Vec3); NEIGHBORS],
    count: usize,
}

impl Nearest {
    fn worst(&self) -> f32 {
        if self.count < NEIGHBORS {
            f32::INFINITY
        } else {
            self.found[NEIGHBORS - 1].0
        }
    }

    #[inline]
    fn offer(&mut self, p: Vec3) {
        let distance = p.distance_squared(self.at);
        if distance < self.worst() {
            self.insert(distance, p);
        }
    }

    fn insert(&mut self, distance: f32, p: Vec3) {
        if p == self.at || self.found[..self.count].iter().any(|&(_, q)| q == p) {
            return;
        }
        let mut place = self.count.min(NEIGHBORS - 1);
        self.count = (self.count + 1).min(NEIGHBORS);
        while place > 0 && self.found[place - 1].0 > distance {
            self.found[place] = self.found[place - 1];
            place -= 1;
        }
        self.found[place] = (distance, p);
    }
}

/// For each of `points`, in tree order, the distance to its sixth nearest other place; to the farthest one if there are
/// fewer places, 0 if there is none. Deterministic. About O(n log n) also for coincident points. `stop` ends it early with
/// zeros; `done` hears of numbers of finished points.
pub(super) fn radii(
    shape: &Shape,
    points: &[Vec3],
    stop: &AtomicBool,
    done: &(dyn Fn(u64) + Sync),
) -> Vec<f32> {
    let boxes = boxes(shape, points);
    let search = Search {
        shape,
        points,
        boxes: &boxes,
    };
    let mut radii = vec![0.0; points.len()];
    let chunk = (points.len() / 2048).max(4096);
    radii
        .par_chunks_mut(chunk)
        .enumerate()
        .for_each(|(index, radii)| {
            if stop.load(Ordering::Relaxed) {
                return;
            }
            for (offset, radius) in radii.iter_mut().enumerate() {
                *radius = search.radius((index * chunk + offset) as u32);
            }
            done(radii.len() as u64);
        });
    radii
}

/// Boxes of all nodes, by level.
fn boxes(shape: &Shape, points: &[Vec3]) -> Vec<Vec<Bounds>> {
    let mut levels: Vec<Vec<Bounds>> = Vec::new();
    for level in shape.levels.iter().rev() {
        let below = levels.last();
        let of_children = |pair: &[u32]| {
            let range = pair[0] as usize..pair[1] as usize;
            let mut bounds = Bounds {
                min: Vec3::INFINITY,
                max: Vec3::NEG_INFINITY,
            };
            for child in range {
                let (min, max) = match below {
                    Some(below) => (below[child].min, below[child].max),
                    None => (points[child], points[child]),
                };
                bounds.min = bounds.min.min(min);
                bounds.max = bounds.max.max(max);
            }
            bounds
        };
        levels.push(
            level
                .child_starts
                .par_windows(2)
                .with_min_len(1024)
                .map(of_children)
                .collect(),
        );
    }
    levels.reverse();
    levels
}

struct Search<'a> {
    shape: &'a Shape,
    points: &'a [Vec3],
    boxes: &'a [Vec<Bounds>],
}

impl Search<'_> {
    fn radius(&self, index: u32) -> f32 {
        let at = self.points[index as usize];
        let mut nearest = Nearest {
            at,
            found: [(0.0, Vec3::ZERO); NEIGHBORS],
            count: 0,
        };
        // Upward from the point: at each ancestor, whatever lies beside the path. The first few find close neighbors, and
        // almost all that comes later is dropped by its box.
        let mut child = index;
        for level in (0..self.shape.levels.len()).rev() {
            let starts = &self.shape.levels[level].child_starts;
            let parent = starts.partition_point(|&start| start <= child) - 1;
            for sibling in starts[parent]..starts[parent + 1] {
                if sibling != child {
                    self.visit(level + 1, sibling, &mut nearest);
                }
            }
            child = parent as u32;
        }
        match nearest.count {
            0 => 0.0,
            count => nearest.found[count - 1].0.sqrt(),
        }
    }

    fn visit(&self, level: usize, index: u32, nearest: &mut Nearest) {
        let Some(boxes) = self.boxes.get(level) else {
            nearest.offer(self.points[index as usize]);
            return;
        };
        let bounds = &boxes[index as usize];
        if bounds.is_point() {
            // However many points: one place.
            nearest.offer(bounds.min);
            return;
        }
        if bounds.distance_squared(nearest.at) >= nearest.worst() {
            return;
        }
        let starts = &self.shape.levels[level].child_starts;
        for child in starts[index as usize]..starts[index as usize + 1] {
            self.visit(level + 1, child, nearest);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn brute_force(points: &[Vec3], index: usize) -> f32 {
        let mut places: Vec<Vec3> = points
            .iter()
            .copied()
            .filter(|p| *p != points[index])
            .collect();
        places.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).unwrap());
        places.dedup();
        let mut distances: Vec<f32> = places
            .iter()
            .map(|p| p.distance_squared(points[index]))
            .collect();
        distances.sort_by(f32::total_cmp);
        distances.truncate(NEIGHBORS);
        distances.last().map_or(0.0, |d| d.sqrt())
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
                let radii = radii(
                    &Shape::new(n as u32),
                    &points,
                    &AtomicBool::new(false),
                    &|_| {},
                );
                for (index, radius) in radii.into_iter().enumerate() {
                    assert_eq!(
                        radius,
                        brute_force(&points, index),
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
        let radii = radii(
            &Shape::new(n as u32),
            &points,
            &AtomicBool::new(false),
            &|_| {},
        );
        assert_eq!(radii[0], 12f32.sqrt());
        assert_eq!(radii[n / 2], 3f32.sqrt());
    }
}
