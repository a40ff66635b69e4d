//! Whether a closed surface surrounds a point: how often a ray from there leaves it less how often it enters.

use super::Model;
use glam::{DVec3, Vec3};

/// Directions that no axis, diagonal or grid has. A ray that meets an edge may count it twice or not at all; of three
/// rays at most one is so unlucky.
const RAYS: [DVec3; 3] = [
    DVec3::new(0.541_196, 0.304_871, 0.783_712),
    DVec3::new(-0.717_433, 0.642_879, 0.268_351),
    DVec3::new(0.226_137, -0.853_311, 0.469_817),
];

/// Nodes that wait: of each level at most three siblings, and a level more than a tree of 2^32 leaves has.
const MOST_WAITING: usize = 3 * 33 + 1;

impl Model {
    /// Tells whether the surface of a closed model ([`Model::is_closed`]) surrounds `point` (model space): rays from there
    /// leave it more often than they enter it. Of no meaning for open surfaces; false in empty models, clouds, and for what is
    /// not finite. Costs a few comparisons outside of the root's sphere, else microseconds; allocates nothing.
    pub fn surrounds(&self, point: Vec3) -> bool {
        let is_outside = self.tree.nodes.first().is_none_or(|root| {
            let distance = point.distance(root.center);
            distance.is_nan() || distance > root.radius
        });
        if is_outside || !self.kind().is_surface() {
            return false;
        }
        let eye = point.as_dvec3();
        let votes = RAYS.iter().filter(|ray| self.winding(eye, **ray) > 0);
        votes.count() >= 2
    }

    /// How often a ray leaves the surface less how often it enters it.
    fn winding(&self, eye: DVec3, ray: DVec3) -> i64 {
        let mut waiting = [0u32; MOST_WAITING];
        let mut count = 1;
        let mut crossings = 0;
        while count > 0 {
            count -= 1;
            let id = waiting[count];
            let node = &self.tree.nodes[id as usize];
            if !meets(eye, ray, node.center.as_dvec3(), f64::from(node.radius)) {
                continue;
            }
            for child in self.tree.children(id) {
                if node.has_leaves() {
                    let corners = self.triangles[child as usize]
                        .map(|i| self.vertices[i as usize].position.as_dvec3() - eye);
                    crossings += crossing(ray, corners);
                } else {
                    waiting[count] = child;
                    count += 1;
                }
            }
        }
        crossings
    }
}

/// Tells whether a ray may meet a ball.
fn meets(eye: DVec3, ray: DVec3, center: DVec3, radius: f64) -> bool {
    let to = center - eye;
    let along = to.dot(ray) / ray.length_squared();
    let nearest = if along > 0.0 { to - ray * along } else { to };
    // Rounded to meeting.
    nearest.length() <= radius * (1.0 + 1e-9)
}

/// 1 where a ray from zero leaves through a triangle, -1 where it enters, 0 where it misses.
fn crossing(ray: DVec3, [a, b, c]: [DVec3; 3]) -> i64 {
    // Volumes of ray and edges: of one sign inside.
    let sides = [
        ray.dot(a.cross(b)),
        ray.dot(b.cross(c)),
        ray.dot(c.cross(a)),
    ];
    let is_front = sides.iter().all(|s| *s > 0.0);
    let is_back = sides.iter().all(|s| *s < 0.0);
    // The plane lies before or behind zero along the ray.
    let volume = a.dot(b.cross(c));
    match (is_front && volume > 0.0, is_back && volume < 0.0) {
        (true, _) => 1,
        (_, true) => -1,
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failing test panics")]

    use super::*;
    use crate::generate::{self, GeneratedShape, ShapeSpec};
    use crate::progress::SilentProgress;
    use crate::tree::{BuildOptions, build};

    fn model(shape: GeneratedShape, triangles: u64) -> Model {
        let spec = ShapeSpec::with_triangles(shape, triangles).unwrap();
        build(
            generate::mesh(&spec),
            &BuildOptions::default(),
            &SilentProgress,
        )
        .unwrap()
    }

    /// Points of a lattice in the box [-1.6, 1.6] cubed, off the axes.
    fn lattice() -> impl Iterator<Item = Vec3> {
        (0..13 * 13 * 13).map(|k| {
            let at = |k: i32| (k % 13 - 6) as f32 * 0.25 + 0.0131;
            Vec3::new(at(k), at(k / 13), at(k / 169))
        })
    }

    #[test]
    fn inside_of_a_sphere_is_nearer_than_its_radius() {
        // Between the polyhedron and the sphere there is no point of the lattice.
        let sphere = model(GeneratedShape::Sphere, 20_000);
        let mut seen = [0; 2];
        for p in lattice() {
            let is_inside = p.length() < 1.0;
            assert_eq!(sphere.surrounds(p), is_inside, "{p}");
            seen[usize::from(is_inside)] += 1;
        }
        assert!(seen[0] > 1000 && seen[1] > 100, "{seen:?}");
        // On the axis every ray of a lattice meets edges.
        assert!(sphere.surrounds(Vec3::ZERO));
        assert!(!sphere.surrounds(Vec3::splat(f32::NAN)));
        assert!(!sphere.surrounds(Vec3::splat(f32::INFINITY)));
    }

    #[test]
    fn the_hole_of_a_torus_is_outside() {
        let torus = model(GeneratedShape::Torus, 20_000);
        let mut seen = [0; 2];
        for p in lattice() {
            // The generator's torus: around the axis of the rows, radii 1 and 0.4.
            let from_ring = (p.x.hypot(p.z) - 1.0).hypot(p.y);
            // The polyhedron is a little thinner than the torus.
            if (0.35..0.41).contains(&from_ring) {
                continue;
            }
            let is_inside = from_ring < 0.4;
            assert_eq!(torus.surrounds(p), is_inside, "{p}");
            seen[usize::from(is_inside)] += 1;
        }
        assert!(seen[0] > 1000 && seen[1] > 100, "{seen:?}");
        assert!(!torus.surrounds(Vec3::ZERO));
    }

    #[test]
    fn nothing_surrounds_where_there_is_no_surface() {
        let mut cloud =
            generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Sphere, 2000).unwrap());
        cloud.triangles.clear();
        let cloud = build(cloud, &BuildOptions::default(), &SilentProgress).unwrap();
        assert!(!cloud.surrounds(Vec3::ZERO));
        assert!(!Model::default().surrounds(Vec3::ZERO));
    }
}
