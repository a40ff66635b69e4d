//! Spheres and areas of the triangles of a page: a triangle in each lane.

use crate::abi::Vertex;
use crate::math::sphere;
use crate::tree::Leaf;
use bytemuck::Zeroable;
use fearless_simd::{Level, dispatch};
use glam::Vec3;

/// Triangles whose corners are gathered before they are computed.
const BATCH: usize = 64;

/// The sphere of a triangle's corners, as the tree's builder has it.
#[inline(always)]
pub(super) fn leaf_of(corners: [Vec3; 3]) -> Leaf {
    let corners = corners.map(|p| p.as_dvec3());
    let center = sphere::triangle_center(corners).as_vec3();
    let around = center.as_dvec3();
    let square = corners
        .iter()
        .map(|&p| around.distance_squared(p))
        .fold(0.0, f64::max);
    Leaf {
        center,
        radius: sphere::round_up(square.sqrt() * (1.0 + 1e-15)),
    }
}

/// Fills spheres and areas of triangles, whose corners are vertices that there are.
pub(super) fn fill(
    vertices: &[Vertex],
    triangles: &[[u32; 3]],
    leaves: &mut [Leaf],
    areas: &mut [f32],
) {
    let level = Level::new();
    let found = leaves.chunks_mut(BATCH).zip(areas.chunks_mut(BATCH));
    dispatch!(level, _simd => for (triangles, found) in triangles.chunks(BATCH).zip(found) {
        fill_batch(vertices, triangles, found);
    });
}

#[inline(always)]
fn fill_batch(
    vertices: &[Vertex],
    triangles: &[[u32; 3]],
    (leaves, areas): (&mut [Leaf], &mut [f32]),
) {
    let mut corners = [[[0f32; BATCH]; 3]; 3];
    for (at, triangle) in triangles.iter().enumerate().take(BATCH) {
        for (own, &index) in corners.iter_mut().zip(triangle) {
            let place = vertices[index as usize].position.to_array();
            for (own, place) in own.iter_mut().zip(place) {
                own[at] = place;
            }
        }
    }
    let (mut spheres, mut all_areas) = ([Leaf::zeroed(); BATCH], [0f32; BATCH]);
    for at in 0..BATCH {
        let [a, b, c] = corners
            .each_ref()
            .map(|[x, y, z]| Vec3::new(x[at], y[at], z[at]));
        spheres[at] = leaf_of([a, b, c]);
        all_areas[at] = 0.5 * (b - a).cross(c - a).length();
    }
    leaves.copy_from_slice(&spheres[..leaves.len()]);
    areas.copy_from_slice(&all_areas[..areas.len()]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pages::quantize::TestNumbers;

    /// Triangles have all shapes, and fill whole batches and a part of one.
    #[test]
    fn each_is_that_of_its_triangle_alone() {
        let mut numbers = TestNumbers(5);
        let mut place = |size: f64| (numbers.in_ball() * size).as_vec3();
        let mut corners = Vec::new();
        for k in 0..3 * BATCH + 7 {
            let (a, b, c) = (place(9.0), place(1.0), place(1.0));
            corners.push(match k % 5 {
                0 => [a, a + b, a + c],
                1 => [a, a + b, a + b * 1.001],
                2 => [a, a + b, a],
                3 => [a; 3],
                _ => [c * 1e-20, b * 1e-20, a * 1e-20],
            });
        }
        let vertices: Vec<Vertex> = (corners.as_flattened().iter())
            .map(|&position| Vertex {
                position,
                ..Vertex::zeroed()
            })
            .collect();
        let triangles: Vec<[u32; 3]> = (0..corners.len() as u32)
            .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
            .collect();
        let mut leaves = vec![Leaf::zeroed(); corners.len()];
        let mut areas = vec![0.0; corners.len()];
        fill(&vertices, &triangles, &mut leaves, &mut areas);
        for ((own, leaf), area) in corners.iter().zip(&leaves).zip(&areas) {
            assert_eq!(*leaf, leaf_of(*own), "{own:?}");
            let [a, b, c] = *own;
            assert_eq!(*area, 0.5 * (b - a).cross(c - a).length(), "{own:?}");
        }
        assert!(areas.iter().filter(|&&area| area > 0.01).count() > BATCH / 2);
    }
}
