//! What a model is made of, and the camera that sees all of it.

use super::Model;
use crate::math::camera::Camera;
use glam::DVec3;

/// What the leaves of a model are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ModelKind {
    /// Triangles.
    Surface,
    /// Points: a point cloud.
    Points,
    /// Nothing: the model has neither triangles nor points.
    Empty,
}

impl ModelKind {
    /// Tells whether the leaves are triangles.
    #[inline]
    pub fn is_surface(self) -> bool {
        self == Self::Surface
    }

    /// Tells whether the leaves are points.
    #[inline]
    pub fn is_points(self) -> bool {
        self == Self::Points
    }
}

/// The sphere that the standard orbit frames, world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrbitSphere {
    /// Middle of the box of what is framed.
    pub center: DVec3,
    /// Largest distance of a used vertex from the center; 0 for a single point.
    pub radius: f64,
}

impl OrbitSphere {
    /// The smallest sphere around both.
    #[must_use]
    pub fn joined(self, other: Self) -> Self {
        let between = other.center - self.center;
        let distance = between.length();
        if distance + other.radius <= self.radius {
            return self;
        }
        if distance + self.radius <= other.radius {
            return other;
        }
        let radius = 0.5 * (distance + self.radius + other.radius);
        Self {
            center: self.center + between * ((radius - self.radius) / distance),
            radius,
        }
    }
}

impl Model {
    /// What the leaves are.
    #[inline]
    pub fn kind(&self) -> ModelKind {
        if !self.triangles.is_empty() {
            ModelKind::Surface
        } else if self.tree.leaves.is_empty() {
            ModelKind::Empty
        } else {
            ModelKind::Points
        }
    }

    /// Tells whether these are points without normals: none of 256 of them, evenly taken, has one.
    pub fn lacks_normals(&self) -> bool {
        const SAMPLES: usize = 256;
        let step = self.vertices.len().div_ceil(SAMPLES).max(1);
        let mut samples = self.vertices.iter().step_by(step);
        self.kind().is_points() && samples.all(|vertex| vertex.color[3] == 0)
    }

    /// The sphere that the standard orbit frames: without what lies far off ([`Model::framed`]).
    pub fn orbit_sphere(&self) -> OrbitSphere {
        let (center, radius) = match self.framed {
            Some(part) => (part.center, part.radius),
            None => (self.orbit_center, self.orbit_radius),
        };
        OrbitSphere {
            center: self.origin + center.as_dvec3(),
            radius: f64::from(radius),
        }
    }

    /// The camera of the standard orbit ([`Camera::orbit`]) for a picture of `size` pixels: `azimuth` and `elevation` in
    /// radians; `fill` is the projected diameter of the bounding sphere over the shorter side (1 fills the picture).
    pub fn orbit_camera(
        &self,
        size: (u32, u32),
        azimuth: f64,
        elevation: f64,
        fill: f64,
    ) -> Camera {
        let sphere = self.orbit_sphere();
        Camera::orbit(size, sphere.center, sphere.radius, azimuth, elevation, fill)
    }

    /// View `step` of `steps` around the model ([`Camera::orbit_view`]).
    pub fn orbit_step(&self, size: (u32, u32), fill: f64, step: u32, steps: u32) -> Camera {
        let sphere = self.orbit_sphere();
        Camera::orbit_view(size, sphere.center, sphere.radius, fill, step, steps)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use crate::mesh::Mesh;
    use crate::progress::SilentProgress;
    use crate::tree::{BuildOptions, build};
    use glam::Vec3;

    fn corner() -> Mesh {
        Mesh {
            positions: vec![Vec3::ZERO, Vec3::X * 6.0, Vec3::Y * 8.0],
            triangles: vec![[0, 1, 2]],
            origin: DVec3::new(1e6, 0.0, -1e6),
            ..Mesh::default()
        }
    }

    #[test]
    fn a_model_is_a_surface_points_or_empty() {
        let kind = |mesh| {
            build(mesh, &BuildOptions::default(), &SilentProgress)
                .unwrap()
                .kind()
        };
        assert_eq!(kind(corner()), ModelKind::Surface);
        let points = Mesh {
            triangles: Vec::new(),
            ..corner()
        };
        assert_eq!(kind(points), ModelKind::Points);
        assert_eq!(kind(Mesh::default()), ModelKind::Empty);
        assert!(ModelKind::Surface.is_surface() && !ModelKind::Surface.is_points());
        assert!(ModelKind::Points.is_points() && !ModelKind::Points.is_surface());
        assert!(!ModelKind::Empty.is_surface() && !ModelKind::Empty.is_points());
    }

    #[test]
    fn a_joined_sphere_touches_both_or_is_the_larger() {
        let sphere = |x: f64, radius| OrbitSphere {
            center: DVec3::X * x,
            radius,
        };
        let both = sphere(-2.0, 1.0).joined(sphere(4.0, 2.0));
        assert_eq!((both.center.x, both.radius), (1.5, 4.5));
        assert_eq!(sphere(0.0, 5.0).joined(sphere(1.0, 2.0)), sphere(0.0, 5.0));
        assert_eq!(sphere(1.0, 2.0).joined(sphere(0.0, 5.0)), sphere(0.0, 5.0));
        assert_eq!(sphere(1.0, 0.0).joined(sphere(1.0, 0.0)), sphere(1.0, 0.0));
    }

    #[test]
    fn the_orbit_looks_at_the_middle_of_the_model_in_the_world() {
        let model = build(corner(), &BuildOptions::default(), &SilentProgress).unwrap();
        let sphere = model.orbit_sphere();
        assert_eq!(sphere.center, DVec3::new(1e6 + 3.0, 4.0, -1e6));
        assert!((sphere.radius - 5.0).abs() < 1e-6);
        let camera = model.orbit_camera((200, 100), 0.5, 0.25, 1.0);
        assert_eq!(
            camera,
            Camera::orbit((200, 100), sphere.center, sphere.radius, 0.5, 0.25, 1.0)
        );
        assert_eq!(
            model.orbit_step((200, 100), 0.5, 1, 4),
            Camera::orbit_view((200, 100), sphere.center, sphere.radius, 0.5, 1, 4)
        );
    }
}
