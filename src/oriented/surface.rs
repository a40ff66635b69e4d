//! The surface as points see it: distinct positions, the faces around each, and the face beyond each edge.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// What lies beyond an edge that is not shared by exactly two faces.
pub const NO_FACE: u32 = u32::MAX;

/// Faces joined at equal positions, whatever vertices they name. Faces without area are left out.
#[derive(Debug, Clone, Default)]
pub struct WeldedSurface {
    /// Distinct positions, in the order in which vertices name them first; model space.
    pub points: Vec<DVec3>,
    /// The point of each vertex.
    pub point_of_vertex: Vec<u32>,
    /// Corners of each face, indices into `points`.
    pub faces: Vec<[u32; 3]>,
    /// Vertices of the mesh at the corners of each face.
    pub vertices_of_face: Vec<[u32; 3]>,
    /// Which triangle of the mesh a face is; ascending.
    pub triangle_of_face: Vec<u32>,
    /// Unit normals of faces.
    pub normals: Vec<DVec3>,
    /// Areas of faces, above 0; model units squared.
    pub areas: Vec<f64>,
    /// The face beyond the edge from corner k to the next, or [`NO_FACE`].
    pub beyond: Vec<[u32; 3]>,
    first_incident: Vec<u32>,
    incident: Vec<u32>,
}

impl WeldedSurface {
    /// The surface of a mesh. Triangles that name no vertex are left out, and so are those with corners that are not finite.
    /// Takes time linear in the mesh, but for sorting edges.
    pub fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let (points, point_of_vertex) = weld(positions);
        let mut surface = Self {
            points,
            point_of_vertex,
            ..Self::default()
        };
        for (index, triangle) in triangles.iter().enumerate() {
            if triangle.iter().any(|&v| v as usize >= positions.len()) {
                continue;
            }
            let face = triangle.map(|v| surface.point_of_vertex[v as usize]);
            let [a, b, c] = face.map(|p| surface.points[p as usize]);
            let double = (b - a).cross(c - a);
            let length = double.length();
            // Rounding of single precision makes slivers of no area; their direction is noise.
            let longest = (b - a).length_squared().max((c - a).length_squared());
            if !length.is_finite() || length <= 1e-9 * longest || longest == 0.0 {
                continue;
            }
            surface.faces.push(face);
            surface.vertices_of_face.push(*triangle);
            surface.triangle_of_face.push(index as u32);
            surface.normals.push(double / length);
            surface.areas.push(length / 2.0);
        }
        surface.join();
        surface
    }

    /// Faces around a point.
    pub fn incident(&self, point: u32) -> &[u32] {
        let [from, to] = [point, point + 1].map(|p| self.first_incident[p as usize] as usize);
        &self.incident[from..to]
    }

    /// Corners of a face.
    pub fn corners(&self, face: u32) -> [DVec3; 3] {
        self.faces[face as usize].map(|p| self.points[p as usize])
    }

    /// Length of the diagonal of the box around all points.
    pub fn diagonal(&self) -> f64 {
        let start = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [low, high] =
            (self.points.iter()).fold(start, |[low, high], &p| [low.min(p), high.max(p)]);
        if self.points.is_empty() {
            0.0
        } else {
            (high - low).length()
        }
    }

    /// Fills `beyond` and the faces around points.
    fn join(&mut self) {
        let mut edges: Vec<([u32; 2], u32)> = (self.faces.par_iter().enumerate())
            .flat_map_iter(|(face, corners)| {
                (0..3).map(move |k| {
                    let [a, b] = [corners[k], corners[(k + 1) % 3]];
                    ([a.min(b), a.max(b)], (face * 3 + k) as u32)
                })
            })
            .collect();
        edges.par_sort_unstable();
        self.beyond = vec![[NO_FACE; 3]; self.faces.len()];
        for shared in edges.chunk_by(|a, b| a.0 == b.0) {
            if let &[(_, one), (_, other)] = shared {
                for (at, face) in [(one, other / 3), (other, one / 3)] {
                    self.beyond[at as usize / 3][at as usize % 3] = face;
                }
            }
        }
        let mut first = vec![0_u32; self.points.len() + 1];
        for &p in self.faces.iter().flatten() {
            first[p as usize + 1] += 1;
        }
        for p in 0..self.points.len() {
            first[p + 1] += first[p];
        }
        let mut next = first.clone();
        self.incident = vec![0; self.faces.len() * 3];
        for (face, corners) in self.faces.iter().enumerate() {
            for &p in corners {
                let slot = &mut next[p as usize];
                self.incident[*slot as usize] = face as u32;
                *slot += 1;
            }
        }
        self.first_incident = first;
    }
}

/// Distinct positions in order of first use, and which of them each vertex has.
fn weld(positions: &[Vec3]) -> (Vec<DVec3>, Vec<u32>) {
    // Adding 0 makes one zero of two.
    let key = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut order: Vec<([u32; 3], u32)> = (positions.par_iter().enumerate())
        .map(|(index, &p)| (key(p), index as u32))
        .collect();
    order.par_sort_unstable();
    let mut first_of = vec![0_u32; positions.len()];
    for equal in order.chunk_by(|a, b| a.0 == b.0) {
        for &(_, vertex) in equal {
            first_of[vertex as usize] = equal[0].1;
        }
    }
    let mut points = Vec::new();
    let mut point_of = vec![0_u32; positions.len()];
    for (vertex, &first) in first_of.iter().enumerate() {
        point_of[vertex] = if first as usize == vertex {
            points.push(positions[vertex].as_dvec3());
            points.len() as u32 - 1
        } else {
            point_of[first as usize]
        };
    }
    (points, point_of)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oriented::shapes::cube;

    #[test]
    fn a_cube_of_24_vertices_has_8_points_and_closed_edges() {
        let cube = cube();
        // Every face names vertices of its own.
        let positions: Vec<Vec3> = (cube.triangles.iter().flatten())
            .map(|&v| cube.positions[v as usize])
            .collect();
        let triangles: Vec<[u32; 3]> = (0..12).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let surface = WeldedSurface::new(&positions, &triangles);
        assert_eq!((surface.points.len(), surface.faces.len()), (8, 12));
        assert!(surface.beyond.iter().flatten().all(|&f| f != NO_FACE));
        let around: usize = (0..8).map(|p| surface.incident(p).len()).sum();
        assert_eq!(around, 36);
        for (face, beyond) in surface.beyond.iter().enumerate() {
            for &other in beyond {
                assert!(surface.beyond[other as usize].contains(&(face as u32)));
            }
        }
        assert!((surface.areas.iter().sum::<f64>() - 6.0).abs() < 1e-12);
        assert!((surface.diagonal() - 3f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn what_has_no_area_is_left_out() {
        let positions = [
            Vec3::ZERO,
            Vec3::X,
            2.0 * Vec3::X,
            Vec3::Y,
            Vec3::NAN,
            -Vec3::ZERO,
        ];
        let triangles = [[0, 1, 2], [0, 1, 3], [0, 1, 4], [0, 1, 9], [5, 3, 2]];
        let surface = WeldedSurface::new(&positions, &triangles);
        assert_eq!(surface.triangle_of_face, [1, 4]);
        assert_eq!(surface.point_of_vertex[5], 0, "both zeros are one");
        // They meet in one edge.
        assert_eq!(surface.beyond[0], [NO_FACE, NO_FACE, 1]);
        assert!(WeldedSurface::new(&[], &[]).points.is_empty());
    }
}
