//! Vertex normals of a mesh that has none.
//!
//! The sum of the unnormalized cross products of the incident faces weighs every face by its area (H. Gouraud,
//! "Continuous Shading of Curved Surfaces", 1971, averaged without weights). The weight by angle is that of
//! G. Thürmer and C. Wüthrich, "Computing Vertex Normals from Polygonal Facets", 1998: it does not change when a
//! face is cut in two, but lets slivers speak as loud as large faces.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::Mesh;

/// What a face counts at its corner.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum NormalWeighting {
    /// The face's area.
    #[default]
    Area,
    /// The angle between its edges at the corner.
    Angle,
}

/// Below this share of the weights, what is left of a sum is rounding: faces that cancel leave no direction.
const SMALLEST_SHARE: f64 = 1e-6;

/// Triangles whose vertex range is kept together, so that whole blocks can be skipped.
const BLOCK: usize = 1024;

/// Sets one normal per vertex, replacing any there are; a point cloud gets none (its `normals` become empty).
///
/// Normals are unit vectors that follow the right-hand rule of the triangles. A vertex that no triangle names, that
/// has only degenerate triangles, or whose faces cancel to less than 1e-6 of their weight, gets the zero vector,
/// "unknown". Bit-identical for any number of threads: every vertex adds its faces in the order of the triangles.
///
/// # Panics
/// When a triangle names a vertex that does not exist.
pub fn compute(mesh: &mut Mesh, weighting: NormalWeighting) {
    mesh.normals = if mesh.triangles.is_empty() {
        Vec::new()
    } else {
        of_vertices(mesh, weighting)
    };
}

/// Keeps the normals of the mesh that are known and computes those that are zero or missing; returns how many were
/// set to something else than zero. A point cloud stays as it is.
pub fn complete(mesh: &mut Mesh, weighting: NormalWeighting) -> usize {
    if mesh.triangles.is_empty() {
        return 0;
    }
    if mesh.normals.is_empty() {
        compute(mesh, weighting);
        return mesh
            .normals
            .iter()
            .filter(|&&normal| normal != Vec3::ZERO)
            .count();
    }
    if !mesh.normals.contains(&Vec3::ZERO) {
        return 0;
    }
    let computed = of_vertices(mesh, weighting);
    let mut set = 0;
    for (normal, new) in mesh.normals.iter_mut().zip(computed) {
        if *normal == Vec3::ZERO && new != Vec3::ZERO {
            *normal = new;
            set += 1;
        }
    }
    set
}

/// A sum of weighted normals and the sum of their weights.
#[derive(Debug, Clone, Copy, Default)]
struct NormalSum {
    normal: DVec3,
    weight: f64,
}

impl NormalSum {
    fn direction(self) -> Vec3 {
        let length = self.normal.length();
        if length > SMALLEST_SHARE * self.weight && length.is_finite() {
            (self.normal / length).as_vec3()
        } else {
            Vec3::ZERO
        }
    }
}

/// Finds the normal of each vertex from its triangles.
///
/// The vertices are cut into ranges, one task each, and every task walks all triangles in order but takes only the
/// corners in its range: no atomics, no merging, one order of addition. Blocks of triangles know the lowest and
/// highest vertex they name, so that on a mesh with any order in it a task visits little more than its share; on
/// shuffled triangles every task reads all indices, still cheaper than sorting them.
pub(super) fn of_vertices(mesh: &Mesh, weighting: NormalWeighting) -> Vec<Vec3> {
    let Mesh {
        positions,
        triangles,
        ..
    } = mesh;
    let spans: Vec<(u32, u32)> = triangles
        .par_chunks(BLOCK)
        .with_min_len(16)
        .map(|block| {
            block
                .iter()
                .flatten()
                .fold((u32::MAX, 0), |(low, high), &corner| {
                    (low.min(corner), high.max(corner))
                })
        })
        .collect();
    let highest = spans.iter().map(|span| span.1).max().unwrap_or(0);
    assert!(
        (highest as usize) < positions.len(),
        "triangle names vertex {highest} of {}",
        positions.len()
    );

    // More ranges than threads even out the load; the result does not depend on their number.
    let ranges = (rayon::current_num_threads() * 4).min(64);
    let range = positions.len().div_ceil(ranges).max(1024);
    let mut normals = vec![Vec3::ZERO; positions.len()];
    normals
        .par_chunks_mut(range)
        .enumerate()
        .for_each(|(task, out)| {
            let first = (task * range) as u32;
            let last = first + (out.len() - 1) as u32;
            let mut sums = vec![NormalSum::default(); out.len()];
            for (block, &(low, high)) in triangles.chunks(BLOCK).zip(&spans) {
                if low > last || high < first {
                    continue;
                }
                let inside = low >= first && high <= last;
                for triangle in block {
                    if inside
                        || triangle
                            .iter()
                            .any(|corner| (first..=last).contains(corner))
                    {
                        add(&mut sums, first, positions, triangle, weighting);
                    }
                }
            }
            for (normal, sum) in out.iter_mut().zip(sums) {
                *normal = sum.direction();
            }
        });
    normals
}

/// Adds a triangle to those of its corners that lie in the range.
#[inline]
fn add(
    sums: &mut [NormalSum],
    first: u32,
    positions: &[Vec3],
    triangle: &[u32; 3],
    weighting: NormalWeighting,
) {
    // Double precision: the product of two tiny edges underflows in single, and slivers lose their direction.
    let [a, b, c] = triangle.map(|corner| positions[corner as usize].as_dvec3());
    let cross = (b - a).cross(c - a);
    let double_area = cross.length();
    match weighting {
        NormalWeighting::Area => {
            for &corner in triangle {
                if let Some(sum) = sums.get_mut(corner.wrapping_sub(first) as usize) {
                    sum.normal += cross;
                    sum.weight += double_area;
                }
            }
        }
        NormalWeighting::Angle => {
            if double_area == 0.0 {
                return;
            }
            let corners = [(a, b, c), (b, c, a), (c, a, b)];
            for (&corner, (here, next, previous)) in triangle.iter().zip(corners) {
                if let Some(sum) = sums.get_mut(corner.wrapping_sub(first) as usize) {
                    let angle = double_area.atan2((next - here).dot(previous - here));
                    sum.normal += cross * (angle / double_area);
                    sum.weight += angle;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    /// A grid of `n` by `n` cells over a wavy surface, with its triangles in a stride that scatters them.
    fn waves(n: u32, scatter: bool) -> Mesh {
        let height = |x: f32, y: f32| (x * 3.0).sin() * (y * 2.0).cos();
        let at = |i: u32| i as f32 / n as f32;
        let positions = (0..=n)
            .flat_map(|y| (0..=n).map(move |x| Vec3::new(at(x), at(y), height(at(x), at(y)))))
            .collect();
        let corner = |x: u32, y: u32| y * (n + 1) + x;
        let cells = n * n;
        let triangles = (0..cells)
            .map(|i| {
                if scatter {
                    (u64::from(i) * 7_919 % u64::from(cells)) as u32
                } else {
                    i
                }
            })
            .flat_map(|i| {
                let (x, y) = (i % n, i / n);
                let [a, b, c, d] = [
                    corner(x, y),
                    corner(x + 1, y),
                    corner(x + 1, y + 1),
                    corner(x, y + 1),
                ];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        Mesh {
            positions,
            triangles,
            ..Mesh::default()
        }
    }

    #[test]
    fn a_flat_square_points_up() {
        for weighting in [NormalWeighting::Area, NormalWeighting::Angle] {
            let mut mesh = Mesh {
                positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                ..Mesh::default()
            };
            compute(&mut mesh, weighting);
            assert_eq!(mesh.normals, [Vec3::Z; 4]);
        }
    }

    #[test]
    fn weights_are_area_and_angle() {
        // At the origin a face of area 3 in the xy-plane (a right angle) and one of area 0.5 in the yz-plane (45
        // degrees).
        let mut mesh = Mesh {
            positions: vec![
                Vec3::ZERO,
                Vec3::X * 2.0,
                Vec3::Y * 3.0,
                Vec3::Y,
                Vec3::new(0.0, 1.0, 1.0),
            ],
            triangles: vec![[0, 1, 2], [0, 3, 4]],
            ..Mesh::default()
        };
        compute(&mut mesh, NormalWeighting::Area);
        assert!(mesh.normals[0].distance(Vec3::new(1.0, 0.0, 6.0).normalize()) < 1e-6);
        compute(&mut mesh, NormalWeighting::Angle);
        assert!(mesh.normals[0].distance(Vec3::new(1.0, 0.0, 2.0).normalize()) < 1e-6);
    }

    #[test]
    fn no_direction_is_zero() {
        let mut mesh = Mesh {
            // A needle of no area, two faces back to back (0 1 2 and 2 1 0), and a vertex alone.
            positions: vec![
                Vec3::ZERO,
                Vec3::X,
                Vec3::Y,
                Vec3::Z,
                Vec3::Z * 2.0,
                Vec3::Z * 3.0,
                Vec3::ONE,
            ],
            triangles: vec![[0, 1, 2], [2, 1, 0], [3, 4, 5], [4, 4, 5]],
            ..Mesh::default()
        };
        for weighting in [NormalWeighting::Area, NormalWeighting::Angle] {
            compute(&mut mesh, weighting);
            assert_eq!(mesh.normals, [Vec3::ZERO; 7]);
        }
        let mut cloud = Mesh {
            positions: vec![Vec3::X],
            normals: vec![Vec3::X],
            ..Mesh::default()
        };
        compute(&mut cloud, NormalWeighting::Area);
        assert_eq!(cloud.normals, []);
    }

    #[test]
    fn what_rounding_leaves_of_a_sum_is_no_direction() {
        // Two faces back to back that begin at different corners: their cross products differ in the last bits.
        let corners = [(0.1, 0.7, 0.3), (1.3, 0.2, 0.9), (0.4, 1.1, 0.6)];
        let mut mesh = Mesh {
            positions: corners.map(|(x, y, z)| Vec3::new(x, y, z)).to_vec(),
            triangles: vec![
                [0, 1, 2],
                [1, 0, 2],
                [0, 1, 2],
                [2, 1, 0],
                [0, 1, 2],
                [0, 2, 1],
            ],
            ..Mesh::default()
        };
        for weighting in [NormalWeighting::Area, NormalWeighting::Angle] {
            compute(&mut mesh, weighting);
            assert_eq!(mesh.normals, [Vec3::ZERO; 3]);
        }
    }

    #[test]
    fn triangles_across_two_ranges_reach_both() {
        // The smallest range is 1024 vertices; this block ends on the first vertex of the second.
        for last in [1023, 1024, 1025] {
            let mut mesh = Mesh {
                positions: vec![Vec3::ZERO; 3000],
                ..Mesh::default()
            };
            mesh.positions[last - 1] = Vec3::X;
            mesh.positions[last] = Vec3::Y;
            mesh.triangles = vec![[last as u32 - 2, last as u32 - 1, last as u32]];
            compute(&mut mesh, NormalWeighting::Area);
            assert_eq!(mesh.normals[last - 2..=last], [Vec3::Z; 3]);
            assert_eq!(
                mesh.normals
                    .iter()
                    .filter(|&&normal| normal != Vec3::ZERO)
                    .count(),
                3
            );
        }
    }

    #[test]
    fn tiny_and_huge_triangles_have_normals() {
        for scale in [1e-30_f32, 1e30] {
            let mut mesh = Mesh {
                positions: vec![Vec3::ZERO, Vec3::X * scale, Vec3::Y * scale],
                triangles: vec![[0, 1, 2]],
                ..Mesh::default()
            };
            compute(&mut mesh, NormalWeighting::Area);
            assert_eq!(mesh.normals, [Vec3::Z; 3], "scale {scale}");
        }
    }

    #[test]
    fn threads_change_nothing() {
        for scatter in [false, true] {
            let mesh = waves(150, scatter);
            for weighting in [NormalWeighting::Area, NormalWeighting::Angle] {
                let on = |threads| {
                    let mut mesh = mesh.clone();
                    let pool = rayon::ThreadPoolBuilder::new()
                        .num_threads(threads)
                        .build()
                        .unwrap();
                    pool.install(|| compute(&mut mesh, weighting));
                    mesh.normals
                };
                let one = on(1);
                assert!(one.iter().all(|normal| normal.z > 0.1));
                assert_eq!(one, on(2));
                assert_eq!(one, on(7));
                // The plain definition, in one loop.
                let mut sums = vec![NormalSum::default(); mesh.positions.len()];
                for triangle in &mesh.triangles {
                    add(&mut sums, 0, &mesh.positions, triangle, weighting);
                }
                assert_eq!(
                    one,
                    sums.into_iter()
                        .map(NormalSum::direction)
                        .collect::<Vec<_>>()
                );
            }
        }
    }

    #[test]
    fn known_normals_are_kept() {
        let mut mesh = waves(4, false);
        assert_eq!(complete(&mut mesh, NormalWeighting::Area), 25);
        let computed = mesh.normals.clone();
        mesh.normals = vec![Vec3::X; 25];
        mesh.normals[7] = Vec3::ZERO;
        assert_eq!(complete(&mut mesh, NormalWeighting::Area), 1);
        assert_eq!(mesh.normals[7], computed[7]);
        assert_eq!(mesh.normals[8], Vec3::X);
        assert_eq!(complete(&mut mesh, NormalWeighting::Area), 0);
    }
}
