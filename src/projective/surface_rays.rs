//! Places on the surface that the pixels of a view show, from their depths and normals.

use crate::math::camera::View;
use crate::projective::look::{LookView, SurfacePixel};
use glam::{DMat4, DVec3, Vec3};

/// Steps to neighbors on the plane of a pixel are at most so many times those of a plane that faces the view.
pub const LONGEST_STEP: f32 = 8.0;

/// Rays of the pixels of a view, in model space. At the position p of the picture (pixels, x right and y down) a ray starts
/// in `start` (of a parallel view moved by p) and goes along `towards` (of a perspective moved by p), which has component 1
/// along the view direction: times a depth it ends on the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceRays {
    /// Start of the ray at position (0, 0).
    pub start: Vec3,
    /// Direction of it.
    pub towards: Vec3,
    /// Change of one of them for a pixel to the right.
    pub right: Vec3,
    /// Change of it for a pixel down.
    pub down: Vec3,
    /// All rays start in one point.
    pub is_perspective: bool,
}

impl SurfaceRays {
    /// The rays of a view.
    pub fn of(view: &View) -> Self {
        let inverse: DMat4 = view.view_from_model.as_dmat4().inverse();
        let [sx, sy] = view.scale.map(f64::from);
        let [ox, oy] = view.offset.map(f64::from);
        // Of position 0 and for each pixel, in view space: x_ndc = (s x - o) or (s x + o).
        let step = [
            2.0 / (f64::from(view.width) * sx),
            -2.0 / (f64::from(view.height) * sy),
        ];
        let sign = if view.is_perspective { 1.0 } else { -1.0 };
        let first = [(sign * ox - 1.0) / sx, (sign * oy + 1.0) / sy];
        let vector = |v: DVec3| inverse.transform_vector3(v);
        let point = |v: DVec3| inverse.transform_point3(v).as_vec3();
        let at_zero = DVec3::new(first[0], first[1], 0.0);
        let (start, towards) = match view.is_perspective {
            true => (point(DVec3::ZERO), vector(at_zero - DVec3::Z)),
            false => (point(at_zero), vector(-DVec3::Z)),
        };
        Self {
            start,
            towards: towards.as_vec3(),
            right: vector(DVec3::new(step[0], 0.0, 0.0)).as_vec3(),
            down: vector(DVec3::new(0.0, step[1], 0.0)).as_vec3(),
            is_perspective: view.is_perspective,
        }
    }

    /// Start and direction of the ray at a position.
    fn ray(&self, x: f32, y: f32) -> (Vec3, Vec3) {
        let moved = x * self.right + y * self.down;
        match self.is_perspective {
            true => (self.start, self.towards + moved),
            false => (self.start + moved, self.towards),
        }
    }

    /// Direction of the ray at a position, with component 1 along the view direction.
    pub fn direction(&self, x: f32, y: f32) -> Vec3 {
        self.ray(x, y).1
    }

    /// The place of a depth (distance along the view direction) at a position.
    pub fn point(&self, x: f32, y: f32, depth: f32) -> Vec3 {
        let (start, towards) = self.ray(x, y);
        start + depth * towards
    }

    /// The place that a pixel of this depth and normal (zero where there is none) shows.
    pub fn pixel(&self, [column, row]: [u32; 2], depth: f32, normal: Vec3) -> SurfacePixel {
        let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
        let (start, towards) = self.ray(x, y);
        let position = start + depth * towards;
        let normal = if normal.dot(towards) > 0.0 {
            -normal
        } else {
            normal
        };
        // Where the next pixels' rays meet the plane of this one.
        let step = |dx: f32, dy: f32| {
            let (start, towards) = self.ray(x + dx, y + dy);
            let flat = start + depth * towards - position;
            let facing = normal.dot(towards);
            if facing > -1e-6 {
                return flat;
            }
            let along = start + towards * (normal.dot(position - start) / facing) - position;
            along.clamp_length_max(LONGEST_STEP * flat.length())
        };
        SurfacePixel {
            position,
            normal,
            steps: [step(1.0, 0.0), step(0.0, 1.0)],
        }
    }

    /// The normal of a pixel by the depths of its neighbors (left, right, above, below; infinite or 0 where nothing is): of
    /// each two the one that is nearer in depth counts. Zero where neither of two is there.
    pub fn normal_of_depths(&self, [column, row]: [u32; 2], depth: f32, around: [f32; 4]) -> Vec3 {
        let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
        let position = self.point(x, y, depth);
        let is_there = |d: f32| d > 0.0 && d < f32::MAX;
        let side = |before: f32, after: f32, [dx, dy]: [f32; 2]| {
            let nearer_before = (before - depth).abs() < (after - depth).abs();
            if is_there(before) && (!is_there(after) || nearer_before) {
                position - self.point(x - dx, y - dy, before)
            } else if is_there(after) {
                self.point(x + dx, y + dy, after) - position
            } else {
                Vec3::ZERO
            }
        };
        let [left, right, above, below] = around;
        let across = side(left, right, [1.0, 0.0]);
        let along = side(above, below, [0.0, 1.0]);
        across.cross(along).normalize_or_zero()
    }

    /// The view for the look, for which photographs are chosen by `direction`.
    pub fn look_view(&self, direction: Vec3) -> LookView {
        LookView {
            eye: self.start,
            direction,
            parallel: (!self.is_perspective).then(|| self.towards.normalize_or_zero()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::camera::Camera;

    #[test]
    fn places_project_back_to_their_pixels() {
        let camera = Camera::orbit((64, 48), DVec3::new(100.0, -3.0, 7.0), 2.0, 0.7, 0.4, 1.0);
        let mut flat = camera.clone();
        flat.proj = DMat4::from_cols_array(&[
            0.4, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, -0.1, 0.0, 0.02, 0.03, -0.1, 1.0,
        ]);
        for camera in [camera, flat] {
            let view = camera.view(DVec3::new(99.0, -2.0, 6.0)).unwrap();
            let rays = SurfaceRays::of(&view);
            for (column, row, depth) in [(3, 40, 3.0), (60, 2, 9.0)] {
                let normal = view.backward;
                let place = rays.pixel([column, row], depth, normal);
                let (x, y, distance) = view.project(place.position);
                assert!((x - column as f32 - 0.5).abs() < 1e-3, "{x}");
                assert!((y - row as f32 - 0.5).abs() < 1e-3, "{y}");
                assert!((distance - depth).abs() < 1e-4);
                for (step, moved) in place.steps.into_iter().zip([(1.0, 0.0), (0.0, 1.0)]) {
                    let (i, j, distance) = view.project(place.position + step);
                    assert!((i - x - moved.0).abs() < 1e-3 && (j - y - moved.1).abs() < 1e-3);
                    assert!((distance - depth).abs() < 1e-4, "the plane faces the view");
                }
                // A plane that faces the view has one depth.
                let found = rays.normal_of_depths([column, row], depth, [depth; 4]);
                assert!(found.dot(normal).abs() > 0.9999, "{found}");
                let hole = [f32::INFINITY, f32::INFINITY, depth, depth];
                assert_eq!(
                    rays.normal_of_depths([column, row], depth, hole),
                    Vec3::ZERO
                );
            }
        }
    }
}
