//! Distance of a point from a surface, by a tree of boxes.

use crate::oriented::surface::WeldedSurface;
use glam::DVec3;

/// Faces of a box that is not divided.
const FACES_A_BOX: usize = 4;

/// Boxes around the faces of a surface.
#[derive(Debug)]
pub struct FaceBoxes<'s> {
    surface: &'s WeldedSurface,
    boxes: Vec<FaceBox>,
    faces: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct FaceBox {
    low: DVec3,
    high: DVec3,
    /// Faces in the box: the first and how many.
    first: u32,
    count: u32,
    /// The first of its two halves, which follow each other; 0 for one that is not divided.
    halves: u32,
}

impl FaceBox {
    fn distance_squared(&self, point: DVec3) -> f64 {
        point.distance_squared(point.clamp(self.low, self.high))
    }
}

impl<'s> FaceBoxes<'s> {
    /// Boxes around all faces.
    pub fn new(surface: &'s WeldedSurface) -> Self {
        let mut tree = Self {
            surface,
            boxes: Vec::new(),
            faces: (0..surface.faces.len() as u32).collect(),
        };
        if !tree.faces.is_empty() {
            let whole = tree.bound(0, tree.faces.len());
            tree.boxes.push(whole);
        }
        let mut next = 0;
        while next < tree.boxes.len() {
            tree.divide(next);
            next += 1;
        }
        tree
    }

    fn bound(&self, first: usize, count: usize) -> FaceBox {
        let mut low = DVec3::INFINITY;
        let mut high = DVec3::NEG_INFINITY;
        for &face in &self.faces[first..first + count] {
            for corner in self.surface.corners(face) {
                low = low.min(corner);
                high = high.max(corner);
            }
        }
        FaceBox {
            low,
            high,
            first: first as u32,
            count: count as u32,
            halves: 0,
        }
    }

    fn divide(&mut self, at: usize) {
        let FaceBox {
            low,
            high,
            first,
            count,
            ..
        } = self.boxes[at];
        let (first, count) = (first as usize, count as usize);
        if count <= FACES_A_BOX {
            return;
        }
        let size = high - low;
        let axis = (0..3)
            .max_by(|&a, &b| size[a].total_cmp(&size[b]))
            .unwrap_or(0);
        let surface = self.surface;
        let key = |&face: &u32| surface.corners(face).iter().map(|c| c[axis]).sum::<f64>();
        let half = count / 2;
        self.faces[first..first + count]
            .select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)));
        self.boxes[at].halves = self.boxes.len() as u32;
        let halves = [
            self.bound(first, half),
            self.bound(first + half, count - half),
        ];
        self.boxes.extend(halves);
    }

    /// Distance of a point from the nearest face; infinite without faces.
    pub fn distance(&self, point: DVec3) -> f64 {
        let mut least = f64::INFINITY;
        let mut open: Vec<u32> = if self.boxes.is_empty() {
            Vec::new()
        } else {
            vec![0]
        };
        while let Some(at) = open.pop() {
            let one = &self.boxes[at as usize];
            if one.distance_squared(point) >= least {
                continue;
            }
            if one.halves == 0 {
                for &face in &self.faces[one.first as usize..][..one.count as usize] {
                    let nearest = nearest_of_triangle(point, self.surface.corners(face));
                    least = least.min(nearest.distance_squared(point));
                }
            } else {
                // The nearer half is looked at first.
                let halves = [one.halves, one.halves + 1];
                let [a, b] = halves.map(|h| self.boxes[h as usize].distance_squared(point));
                open.extend(if a < b {
                    [halves[1], halves[0]]
                } else {
                    halves
                });
            }
        }
        least.sqrt()
    }
}

/// The point of a triangle that is nearest to another (C. Ericson, *Real-Time Collision Detection*, 2005, 5.1.5).
pub fn nearest_of_triangle(point: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let from_a = point - a;
    let [d1, d2] = [ab, ac].map(|side| side.dot(from_a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let from_b = point - b;
    let [d3, d4] = [ab, ac].map(|side| side.dot(from_b));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let from_c = point - c;
    let [d5, d6] = [ab, ac].map(|side| side.dot(from_c));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    a + ab * (vb / sum) + ac * (vc / sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oriented::shapes::{cube, grid};

    #[test]
    fn distances_from_a_cube_are_those_of_a_box() {
        let mesh = cube();
        let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
        let boxes = FaceBoxes::new(&surface);
        for (x, y, z) in [
            (2.0, 0.1, 0.2),
            (1.0, 1.0, 0.0),
            (1.5, -2.0, 3.0),
            (0.1, 0.2, 0.3),
        ] {
            let point = DVec3::new(x, y, z);
            let outside = point.distance(point.clamp(DVec3::splat(-0.5), DVec3::splat(0.5)));
            let inside = 0.5 - point.abs().max_element();
            let expected = if outside > 0.0 { outside } else { inside };
            assert!((boxes.distance(point) - expected).abs() < 1e-12, "{point}");
        }
    }

    #[test]
    fn the_tree_finds_what_a_search_of_all_faces_finds() {
        let mesh = grid(17, |x, y| (x * 1.3).sin() + (y * 0.7).cos());
        let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
        let boxes = FaceBoxes::new(&surface);
        for k in 0..200 {
            let t = f64::from(k);
            let point = DVec3::new(
                (t * 7.31) % 20.0 - 1.0,
                (t * 3.77) % 19.0,
                (t * 1.93) % 5.0 - 2.0,
            );
            let all = (0..surface.faces.len() as u32)
                .map(|face| nearest_of_triangle(point, surface.corners(face)).distance(point))
                .fold(f64::INFINITY, f64::min);
            assert!((boxes.distance(point) - all).abs() < 1e-12);
        }
        let none = WeldedSurface::default();
        assert_eq!(FaceBoxes::new(&none).distance(DVec3::ZERO), f64::INFINITY);
    }
}
