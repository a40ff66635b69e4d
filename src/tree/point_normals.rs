//! Estimated normals of a cloud's points, turned so that means of many do not cancel.
//!
//! A plane through the neighbors of a point ([`super::neighborhood`]) has two normals. Light falls on both sides of a cloud, so
//! either is right for a point; but a node has the mean of the normals below, which needs them on one side, and a rim that curves
//! away must not look lit from behind. Hoppe, DeRose, Duchamp, McDonald and Stuetzle, *Surface Reconstruction from Unorganized
//! Points* (1992), carry the side along a spanning tree of near points. Here the tree of the cloud is that: from the lowest nodes
//! up, whole subtrees are turned where that makes the sum of a node's normals longer. Where the surface bends so much that even
//! the longest sum is short, as in half of a ball, parts are turned away from the middle of the node. It takes time in proportion
//! to the points and all threads.

use super::shape::TreeShape;
use crate::abi::Vertex;
use crate::math::octahedral;
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// A sum shorter than this share of the sum of weights tells no side: half of a ball has a half, a roof of 90 degrees 0.71.
const LEAST_SHARE: f32 = 0.65;

/// Weighted sums over points with normals.
#[derive(Debug, Clone, Copy, Default)]
struct OrientedPoints {
    /// Sum of the weights of points that have a normal.
    weight: f32,
    /// Weighted sum of positions, model space.
    place: Vec3,
    /// Weighted sum of unit normals.
    normal: Vec3,
    /// Weighted sum of normal times position, a flux: grows where normals point away from the model's zero.
    flux: f32,
}

impl OrientedPoints {
    fn of_point(place: Vec3, normal: Vec3, weight: f32) -> Self {
        let weight = match normal == Vec3::ZERO {
            true => 0.0,
            false => weight.max(f32::MIN_POSITIVE),
        };
        Self {
            weight,
            place: place * weight,
            normal: normal * weight,
            flux: normal.dot(place) * weight,
        }
    }

    fn turned(self, turns: bool) -> Self {
        let sign = if turns { -1.0 } else { 1.0 };
        Self {
            normal: self.normal * sign,
            flux: self.flux * sign,
            ..self
        }
    }

    fn with(self, other: Self) -> Self {
        Self {
            weight: self.weight + other.weight,
            place: self.place + other.place,
            normal: self.normal + other.normal,
            flux: self.flux + other.flux,
        }
    }

    /// Tells whether the sum of the normals has a side.
    fn has_side(&self) -> bool {
        self.normal.length() >= LEAST_SHARE * self.weight
    }

    /// Flux of what is seen from a middle; below 0 where the normals point there.
    fn flux_from(&self, middle: Vec3) -> f32 {
        self.flux - self.normal.dot(middle)
    }
}

/// Turns normals (zero: none) so that those below a node lie on one side: the sum of them is as long as turning its children can
/// make it, or where that is short all point away from the node's middle. Weights are those of the points in the sums. A cloud
/// that is one side, as ground is, looks upward, along z.
pub(super) fn orient(shape: &TreeShape, points: &[Vec3], weights: &[f32], normals: &mut [Vec3]) {
    let leaf = |i: u32| {
        let i = i as usize;
        OrientedPoints::of_point(points[i], normals[i], weights[i])
    };
    let mut sums: Vec<OrientedPoints> = Vec::new();
    // Of each level from the lowest up, which children are turned.
    let mut turned: Vec<Vec<bool>> = Vec::new();
    for level in shape.levels.iter().rev() {
        let starts = &level.child_starts;
        let is_lowest = turned.is_empty();
        let below = |children: Range<u32>| {
            let mut own = [OrientedPoints::default(); 4];
            let count = children.len().min(4);
            for (own, child) in own.iter_mut().zip(children) {
                *own = match is_lowest {
                    true => leaf(child),
                    false => sums[child as usize],
                };
            }
            one_side(&own[..count])
        };
        let nodes: Vec<(OrientedPoints, [bool; 4])> = (starts.par_windows(2).with_min_len(1024))
            .map(|pair| below(pair[0]..pair[1]))
            .collect();
        let mut own = vec![false; starts.last().map_or(0, |&end| end as usize)];
        for (pair, (_, turns)) in starts.windows(2).zip(&nodes) {
            own[pair[0] as usize..pair[1] as usize]
                .copy_from_slice(&turns[..(pair[1] - pair[0]) as usize]);
        }
        turned.push(own);
        sums = nodes.into_iter().map(|(sum, _)| sum).collect();
    }
    // What turns a node turns all below it.
    let is_down = |sum: &OrientedPoints| sum.has_side() && sum.normal.z < 0.0;
    let mut above = vec![sums.first().is_some_and(is_down)];
    for (level, own) in shape.levels.iter().zip(turned.iter_mut().rev()) {
        for (pair, above) in level.child_starts.windows(2).zip(&above) {
            for child in &mut own[pair[0] as usize..pair[1] as usize] {
                *child ^= above;
            }
        }
        above.clone_from(own);
    }
    (normals.par_iter_mut().zip(&above))
        .filter(|(_, turns)| **turns)
        .for_each(|(normal, _)| *normal = -*normal);
}

/// The sum of up to four parts, each as it is or turned, and which are turned: what makes the longest sum of normals, or where that
/// tells no side what makes each point away from their middle.
fn one_side(parts: &[OrientedPoints]) -> (OrientedPoints, [bool; 4]) {
    let sum = |turns: &[bool; 4]| {
        let own = parts.iter().zip(turns);
        own.fold(OrientedPoints::default(), |sum, (part, turns)| {
            sum.with(part.turned(*turns))
        })
    };
    let mut best = (sum(&[false; 4]), [false; 4]);
    for choice in 1..1u32 << (parts.len().clamp(1, 4) - 1) {
        let turns = [false, choice & 1 != 0, choice & 2 != 0, choice & 4 != 0];
        let own = sum(&turns);
        if own.normal.length_squared() > best.0.normal.length_squared() {
            best = (own, turns);
        }
    }
    if best.0.has_side() || best.0.weight == 0.0 {
        return best;
    }
    let middle = best.0.place / best.0.weight;
    let mut turns = [false; 4];
    for (part, turns) in parts.iter().zip(&mut turns) {
        *turns = part.flux_from(middle) < 0.0;
    }
    (sum(&turns), turns)
}

/// Turns the normals of points toward the scanner that measured each, where that is known; both in model space.
pub(super) fn turn_to_scanners(
    points: &[Vec3],
    normals: &mut [Vec3],
    scanner_of: impl Fn(usize) -> Option<Vec3> + Sync,
) {
    let pairs = normals.par_iter_mut().zip(points).enumerate();
    pairs
        .with_min_len(1 << 12)
        .for_each(|(index, (normal, point))| {
            if let Some(scanner) = scanner_of(index)
                && normal.dot(scanner - point) < 0.0
            {
                *normal = -*normal;
            }
        });
}

/// Gives points their normals, where they have some.
pub(super) fn give(vertices: &mut [Vertex], normals: &[Vec3]) {
    let pairs = vertices.par_iter_mut().zip(normals);
    pairs
        .filter(|(_, normal)| **normal != Vec3::ZERO)
        .for_each(|(vertex, normal)| {
            vertex.normal = octahedral::encode(*normal);
            vertex.color[3] = 255;
        });
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use crate::math::octahedral;
    use crate::mesh::Mesh;
    use crate::progress::SilentProgress;
    use crate::tree::{BuildOptions, Model, PointNormals, build};
    use glam::Vec3;

    fn estimated(positions: Vec<Vec3>) -> Model {
        let mesh = Mesh {
            positions,
            ..Mesh::default()
        };
        let options = BuildOptions {
            point_normals: PointNormals::Estimate,
            ..BuildOptions::default()
        };
        build(mesh, &options, &SilentProgress).unwrap()
    }

    /// One of Fibonacci's points on a ball's surface: even, and no two neighborhoods alike.
    fn on_sphere(i: i32, count: i32) -> Vec3 {
        let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
        let turn = f64::from(i) * std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let r = (1.0 - z * z).sqrt();
        glam::DVec3::new(r * turn.cos(), r * turn.sin(), z).as_vec3()
    }

    #[test]
    fn normals_of_a_sphere_are_its_own_and_nodes_keep_them() {
        let count = 20_000;
        let at = |i: i32| on_sphere(i, count);
        let model = estimated((0..count).map(at).collect());
        let mut largest = 0f32;
        for vertex in &model.vertices {
            assert_eq!(vertex.color[3], 255);
            let place = vertex.position + model.origin.as_vec3();
            let own = octahedral::decode(vertex.normal);
            largest = largest.max(own.dot(place.normalize()).abs().min(1.0).acos());
        }
        // The neighbors reach 3 degrees far, not quite evenly.
        assert!(largest.to_degrees() < 0.7, "{}", largest.to_degrees());
        // All look outward.
        let outward = model.vertices.iter().filter(|vertex| {
            let place = vertex.position + model.origin.as_vec3();
            octahedral::decode(vertex.normal).dot(place) > 0.0
        });
        assert_eq!(outward.count(), count as usize);
        // Below nodes of some sixteen points all normals are on one side.
        let tree = &model.tree;
        let level = tree.level(tree.level_count() - 2);
        let count = level.len();
        let torn = level.filter(|&id| {
            let below = tree.leaf_range(id).map(|leaf| leaf as usize);
            let normals = below.map(|leaf| octahedral::decode(model.vertices[leaf].normal));
            let own = tree.attributes[id as usize];
            !own.has_normal() || normals.into_iter().any(|n| n.dot(own.normal()) < 0.0)
        });
        assert!(torn.count() * 100 <= count, "of {count}");
    }

    /// Two halves of a ball's surface far from zero, one seen from within and one from above: each looks toward its scanner,
    /// which outward is for one of them only. A point of a third scanner, of which nothing is known, has a side as well.
    #[test]
    fn normals_turn_to_the_scanner_that_saw_the_point() {
        let count = 8000;
        let at = |i: i32| on_sphere(i, count);
        let middle = glam::DVec3::new(500_000.0, -20.0, 3.0);
        let mut scanners = crate::mesh::scanners::ScannerPlaces::default();
        scanners.push(3999, Some(middle + glam::DVec3::Z * 0.25));
        scanners.push(1, None);
        scanners.push(4000, Some(middle - glam::DVec3::Z * 900.0));
        let mesh = Mesh {
            positions: (0..count).map(at).collect(),
            origin: middle,
            scanners,
            ..Mesh::default()
        };
        let options = BuildOptions {
            point_normals: PointNormals::Estimate,
            ..BuildOptions::default()
        };
        let model = build(mesh, &options, &SilentProgress).unwrap();
        let (mut inward, mut outward) = (0, 0);
        for vertex in &model.vertices {
            let place = (model.origin - middle).as_vec3() + vertex.position;
            let side = octahedral::decode(vertex.normal).dot(place);
            if place.z > 0.002 {
                inward += usize::from(side < 0.0);
            } else if place.z < -0.02 {
                // Lower than the tangent from far below, with two degrees for the estimate.
                outward += usize::from(side > 0.0);
            }
        }
        let upper = (0..count).filter(|&i| at(i).z > 0.002).count();
        let lower = (0..count).filter(|&i| at(i).z < -0.02).count();
        assert_eq!((inward, outward), (upper, lower));
    }

    #[test]
    fn what_is_no_surface_has_none_and_ground_looks_up() {
        let mut state = 7u64;
        let mut random = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        // Ground of 80 x 80 with noise, a quarter apart, and leaves over a part of it.
        let mut places: Vec<Vec3> = (0..6400)
            .map(|i| Vec3::new((i % 80) as f32, (i / 80) as f32, 0.05 * random()) * 0.25)
            .collect();
        places.extend(
            (0..2000).map(|_| Vec3::new(20.0 * random(), 20.0 * random(), 10.0 + 20.0 * random())),
        );
        let model = estimated(places);
        let (mut ground, mut up, mut leaves, mut lit) = (0, 0, 0, 0);
        for vertex in &model.vertices {
            let has_normal = vertex.color[3] != 0;
            if vertex.position.z + (model.origin.z as f32) < 5.0 {
                ground += 1;
                up += usize::from(has_normal && octahedral::decode(vertex.normal).z > 0.95);
            } else {
                leaves += 1;
                lit += usize::from(has_normal);
            }
        }
        assert!(up * 100 >= ground * 99, "{up} of {ground}");
        assert!(lit * 4 < leaves, "{lit} of {leaves}");
        // Leaves are drawn no larger than one and a half times the ground's points, whose sixth neighbor is a diagonal away.
        let radius = |index: usize| model.tree.leaves[index].radius;
        let largest = (0..model.vertices.len())
            .filter(|&i| model.vertices[i].color[3] == 0)
            .map(radius);
        let largest = largest.fold(0.0, f32::max);
        assert!(largest < 1.5 * 0.25 * 2f32.sqrt() * 1.03, "{largest}");
        // Normals that are there are never computed.
        let plane = (0..400).map(|i| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0));
        let mesh = Mesh {
            positions: plane.collect(),
            normals: vec![Vec3::X; 400],
            ..Mesh::default()
        };
        let options = BuildOptions {
            point_normals: PointNormals::Estimate,
            ..BuildOptions::default()
        };
        let kept = build(mesh.clone(), &options, &SilentProgress).unwrap();
        let all = kept
            .vertices
            .iter()
            .map(|own| octahedral::decode(own.normal));
        assert!(all.into_iter().all(|n| n.dot(Vec3::X) > 0.999));
        let without = BuildOptions {
            point_normals: PointNormals::None,
            ..BuildOptions::default()
        };
        assert!(
            build(mesh, &without, &SilentProgress)
                .unwrap()
                .lacks_normals()
        );
    }
}
