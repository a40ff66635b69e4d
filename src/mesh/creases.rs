//! Sharp edges of a mesh without normals: vertices on them are split, so that each side has a normal of its own.
//!
//! An edge is sharp where the normals of its two triangles differ by more than the crease angle. Around a vertex the
//! triangles are grouped over edges that are not sharp, and each group beyond the first gets a copy of the vertex. A
//! single sharp edge that ends at a vertex splits nothing there, since its sides meet around the other way: so the noise
//! of a scan, which has many edges but few closed ones, stays smooth.

use super::Mesh;
use super::normals::{self, NormalWeighting};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Corners that one task looks at.
const PIECE: usize = 1 << 14;

/// Crease angle of files that have no normals, degrees: a cube, and a cylinder of less than nine sides, have sharp edges.
pub const USUAL_CREASE_DEGREES: f32 = 40.0;

/// A corner of a triangle at a vertex that may lie on a sharp edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct VertexCorner {
    vertex: u32,
    triangle: u32,
}

/// Splits the vertices of sharp edges and returns how many were added; a mesh with normals, or without triangles, stays as
/// it is. `crease_degrees` of 180 and more splits nothing, 0 splits all that is not plane. Copies are appended, and have
/// the color of their vertex. Does not depend on the number of threads.
///
/// # Panics
/// When a triangle names a vertex that does not exist.
pub fn split(mesh: &mut Mesh, crease_degrees: f32) -> usize {
    let is_smooth = crease_degrees.is_nan() || crease_degrees >= 180.0;
    if !mesh.normals.is_empty() || mesh.triangles.is_empty() || is_smooth {
        return 0;
    }
    let crease = f64::from(crease_degrees.max(0.0)).to_radians();
    let mut corners = suspects(mesh, crease);
    corners.par_sort_unstable();
    let groups: Vec<&[VertexCorner]> = corners.chunk_by(|a, b| a.vertex == b.vertex).collect();
    let splits: Vec<Vec<u32>> = groups
        .par_iter()
        .with_min_len(64)
        .map(|group| sides(mesh, group, crease.cos()))
        .collect();
    let mut added = 0;
    for (group, sides) in groups.iter().zip(&splits) {
        let count = sides.iter().copied().max().unwrap_or(0);
        let old = group[0].vertex;
        // 32-bit indices name no more.
        if mesh.positions.len() + count as usize > u32::MAX as usize {
            break;
        }
        let first = mesh.positions.len() as u32 - 1;
        for (corner, &side) in group.iter().zip(sides) {
            if side > 0 {
                let triangle = &mut mesh.triangles[corner.triangle as usize];
                for index in triangle.iter_mut().filter(|index| **index == old) {
                    *index = first + side;
                }
            }
        }
        for _ in 0..count {
            mesh.positions.push(mesh.positions[old as usize]);
            if let Some(&color) = mesh.colors.get(old as usize) {
                mesh.colors.push(color);
            }
        }
        added += count as usize;
    }
    added
}

/// Unit normal of a triangle; zero for one without area.
fn face_normal(mesh: &Mesh, triangle: [u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize].as_dvec3());
    (b - a).cross(c - a).normalize_or_zero()
}

/// The corners of vertices of which some triangle differs from the mean normal by more than half the crease angle. No
/// other vertex has a sharp edge: of two normals that differ by more than an angle, one differs from any third by more
/// than half of it.
fn suspects(mesh: &Mesh, crease: f64) -> Vec<VertexCorner> {
    let means = normals::of_vertices(mesh, NormalWeighting::Area);
    // Means are rounded to single precision.
    let least = (0.5 * crease).cos() + 1e-6;
    let differs = |corner: u32, normal: DVec3| {
        let mean = means[corner as usize];
        normal != DVec3::ZERO && (mean == Vec3::ZERO || mean.as_dvec3().dot(normal) < least)
    };
    let is_suspect: Vec<AtomicBool> = mesh.positions.iter().map(|_| false.into()).collect();
    let triangles = mesh.triangles.par_iter().with_min_len(PIECE);
    triangles.for_each(|&triangle| {
        let normal = face_normal(mesh, triangle);
        for corner in triangle
            .into_iter()
            .filter(|&corner| differs(corner, normal))
        {
            is_suspect[corner as usize].store(true, Ordering::Relaxed);
        }
    });
    let corners = mesh.triangles.par_iter().with_min_len(PIECE).enumerate();
    corners
        .flat_map_iter(|(index, &triangle)| {
            let [a, b, c] = triangle;
            // A corner that a triangle names twice counts once.
            let distinct = [
                Some(a),
                (b != a).then_some(b),
                (c != a && c != b).then_some(c),
            ];
            let distinct = distinct.into_iter().flatten();
            let suspects =
                distinct.filter(|&vertex| is_suspect[vertex as usize].load(Ordering::Relaxed));
            suspects.map(move |vertex| VertexCorner {
                vertex,
                triangle: index as u32,
            })
        })
        .collect()
}

/// The group of each triangle around a vertex: 0 for what hangs together with the first.
fn sides(mesh: &Mesh, group: &[VertexCorner], least: f64) -> Vec<u32> {
    let vertex = group[0].vertex;
    let triangles: Vec<[u32; 3]> = group
        .iter()
        .map(|corner| mesh.triangles[corner.triangle as usize])
        .collect();
    let faces: Vec<DVec3> = triangles.iter().map(|&t| face_normal(mesh, t)).collect();
    // Edges at the vertex, by their other end.
    let mut edges: Vec<(u32, usize)> = Vec::with_capacity(2 * group.len());
    for (index, triangle) in triangles.iter().enumerate() {
        let ends = triangle.iter().filter(|&&end| end != vertex);
        edges.extend(ends.map(|&end| (end, index)));
    }
    edges.sort_unstable();
    let mut roots: Vec<usize> = (0..group.len()).collect();
    for edge in edges.chunk_by(|a, b| a.0 == b.0) {
        for (at, &(_, one)) in edge.iter().enumerate() {
            for &(_, other) in &edge[at + 1..] {
                // What has no area belongs to neither side, and joins none.
                let has_area = faces[one] != DVec3::ZERO && faces[other] != DVec3::ZERO;
                if has_area && faces[one].dot(faces[other]) >= least {
                    let (a, b) = (root(&mut roots, one), root(&mut roots, other));
                    roots[a.max(b)] = a.min(b);
                }
            }
        }
    }
    // Numbered in the order of the triangles; what has no area stays with the first.
    let mut numbers = vec![u32::MAX; group.len()];
    let mut next = 0;
    (0..group.len())
        .map(|index| {
            if faces[index] == DVec3::ZERO {
                return 0;
            }
            let root = root(&mut roots, index);
            if numbers[root] == u32::MAX {
                numbers[root] = next;
                next += 1;
            }
            numbers[root]
        })
        .collect()
}

fn root(roots: &mut [usize], mut at: usize) -> usize {
    while roots[at] != at {
        roots[at] = roots[roots[at]];
        at = roots[at];
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box whose triangles share their eight vertices.
    fn cube() -> Mesh {
        let positions = (0..8)
            .map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32))
            .collect();
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let triangles = quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect();
        Mesh {
            positions,
            triangles,
            ..Mesh::default()
        }
    }

    fn largest_difference(mesh: &Mesh) -> f64 {
        let of = |&triangle: &[u32; 3]| {
            let normal = face_normal(mesh, triangle);
            let corner = |c: u32| mesh.normals[c as usize].as_dvec3().angle_between(normal);
            triangle.into_iter().map(corner).fold(0.0, f64::max)
        };
        mesh.triangles.iter().map(of).fold(0.0, f64::max)
    }

    #[test]
    fn a_cube_has_six_even_faces() {
        let mut mesh = cube();
        mesh.colors = (0..8).map(|i| [i, 0, 0, 255]).collect();
        assert_eq!(split(&mut mesh, USUAL_CREASE_DEGREES), 16);
        assert_eq!((mesh.positions.len(), mesh.colors.len()), (24, 24));
        normals::compute(&mut mesh, NormalWeighting::Area);
        assert!(largest_difference(&mesh) < 1e-6);
        // Copies are where their vertex is, and look like it.
        for (position, color) in mesh.positions.iter().zip(&mesh.colors) {
            let index = position.x as u8 + 2 * position.y as u8 + 4 * position.z as u8;
            assert_eq!(color[0], index);
        }
    }

    #[test]
    fn edges_below_the_angle_are_smooth() {
        for degrees in [90.5, 180.0, f32::NAN] {
            assert_eq!(split(&mut cube(), degrees), 0, "{degrees}");
        }
        assert_eq!(split(&mut cube(), 89.5), 16);
        // What has normals keeps them.
        let mut mesh = cube();
        mesh.normals = vec![Vec3::X; 8];
        assert_eq!(split(&mut mesh, 0.0), 0);
    }

    /// Two triangles that share an edge of a fan around a vertex, folded there by an angle: the fold ends at the vertex,
    /// and its sides meet around the back.
    #[test]
    fn a_fold_that_ends_splits_nothing_and_one_that_goes_through_does() {
        let ring = |i: u32, z: f32| {
            let angle = i as f32 * std::f32::consts::FRAC_PI_4;
            Vec3::new(angle.cos(), angle.sin(), z)
        };
        let fan = |heights: [f32; 8]| {
            let mut positions = vec![Vec3::ZERO];
            positions.extend((0..8).map(|i| ring(i, heights[i as usize])));
            Mesh {
                positions,
                triangles: (0..8).map(|i| [0, 1 + i, 1 + (i + 1) % 8]).collect(),
                ..Mesh::default()
            }
        };
        // A roof along x: sharp at both ends of the ridge.
        let roof = fan([0.0, -0.7, -1.0, -0.7, 0.0, -0.7, -1.0, -0.7]);
        let mut halves = roof.clone();
        // The vertex in the middle, and both ends of the ridge, where the fan is open.
        assert_eq!(split(&mut halves, 40.0), 3);
        let above = |t: &[u32; 3]| t.contains(&2) || t.contains(&3) || t.contains(&4);
        let names: Vec<bool> = halves.triangles.iter().map(|t| t.contains(&9)).collect();
        let upper: Vec<bool> = halves.triangles.iter().map(above).collect();
        assert!(names == upper || names.iter().zip(&upper).all(|(a, b)| a != b));
        // A ridge that dies away on the other side.
        let mut ridge = fan([0.0, -0.7, -0.7, -0.5, -0.5, -0.5, -0.7, -0.7]);
        let sharp = {
            let at = |i: usize| face_normal(&ridge, ridge.triangles[i]);
            at(7).dot(at(0)).acos().to_degrees()
        };
        assert!(sharp > 40.0, "{sharp}");
        assert_eq!(split(&mut ridge, 40.0), 1);
        assert!(ridge.triangles.iter().all(|triangle| triangle[0] == 0));
    }

    #[test]
    fn sheets_back_to_back_and_triangles_without_area_are_no_trouble() {
        let mut sheet = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2], [0, 2, 1], [0, 1, 1], [0, 0, 0]],
            ..Mesh::default()
        };
        assert_eq!(split(&mut sheet, 40.0), 3);
        normals::compute(&mut sheet, NormalWeighting::Area);
        assert!(sheet.normals.iter().all(|n| n.z.abs() == 1.0), "{sheet:?}");
        assert_eq!(split(&mut Mesh::default(), 40.0), 0);
    }
}
