//! A view as the raster of patches needs it, and what needs no vectors.

use crate::abi::OrientedPolygon;
use crate::math::camera::View;
use crate::patches::rim_rules::StraightDepth;
use glam::{Mat3, Vec2, Vec3};

/// A view, as patches need it.
#[derive(Debug, Clone, Copy)]
pub(super) struct RasterView {
    pub(super) rotation: Mat3,
    pub(super) translation: Vec3,
    /// The ray of a window position p is (p * scale + offset, -1); of parallel rays that is their place.
    pub(super) ray_scale: Vec2,
    pub(super) ray_offset: Vec2,
    pub(super) focal_px: f32,
    pub(super) near: f32,
    pub(super) far: f32,
    pub(super) model_scale: f32,
    /// Reversed depth of a nearness: its factor, and what is added.
    pub(super) depth: [f32; 2],
    pub(super) is_perspective: bool,
    pub(super) straight: StraightDepth,
}

impl RasterView {
    pub(super) fn new(view: &View) -> Self {
        let size = Vec2::new(view.width as f32, view.height as f32);
        let scale = Vec2::from_array(view.scale);
        let offset = Vec2::from_array(view.offset);
        let shift = if view.is_perspective { offset } else { -offset };
        let matrix = view.view_from_model;
        let clip = view.clip_from_view();
        Self {
            rotation: Mat3::from_mat4(matrix),
            translation: matrix.w_axis.truncate(),
            ray_scale: Vec2::new(2.0, -2.0) / size / scale,
            ray_offset: (Vec2::new(-1.0, 1.0) + shift) / scale,
            focal_px: view.focal_px(),
            near: view.near,
            far: view.far,
            model_scale: view.model_scale,
            depth: match view.is_perspective {
                true => [clip.w_axis.z, -clip.z_axis.z],
                false => [clip.z_axis.z, clip.w_axis.z],
            },
            is_perspective: view.is_perspective,
            straight: StraightDepth::new(view),
        }
    }

    pub(super) fn place(&self, point: Vec3) -> Vec3 {
        self.rotation * point + self.translation
    }

    /// Window position of a view-space point; what lies before the near plane counts as on it.
    fn window(&self, point: Vec3) -> Vec2 {
        let ray = if self.is_perspective {
            point.truncate() / (-point.z).max(self.near)
        } else {
            point.truncate()
        };
        (ray - self.ray_offset) / self.ray_scale
    }

    /// The view-space point of a window position at a distance.
    fn point(&self, at: Vec2, distance: f32) -> Vec3 {
        let ray = at * self.ray_scale + self.ray_offset;
        if self.is_perspective {
            (ray * distance).extend(-distance)
        } else {
            ray.extend(-distance)
        }
    }

    /// The distance of a reversed depth.
    pub(super) fn distance(&self, depth: f32) -> f32 {
        let [factor, added] = self.depth;
        let nearness = (depth - added) / factor;
        if self.is_perspective {
            1.0 / nearness
        } else {
            -nearness
        }
    }

    /// First and last row that a patch may touch, pixels.
    pub(super) fn rows_of(&self, patch: &OrientedPolygon) -> [f32; 2] {
        let origin = self.place(patch.center);
        let footprint = if patch.round_radius < f32::INFINITY {
            patch.round_radius
        } else {
            let corners = patch.footprint().iter();
            let squared = corners.map(|[u, v]| u * u + v * v).fold(0.0, f32::max);
            squared.sqrt()
        };
        // Twice the thickness: once for itself, once for the margin.
        let reach = (footprint + 2.0 * patch.thickness) * self.model_scale;
        let row = self.window(origin).y;
        let nearest = -origin.z - reach;
        let px = if !self.is_perspective {
            reach * self.focal_px
        } else if nearest > self.near {
            // Off the axis a ball is longer.
            let aside = origin.truncate().length() / -origin.z;
            reach * self.focal_px / nearest * (1.0 + aside)
        } else {
            f32::INFINITY
        };
        [row - px - 1.0, row + px + 1.0]
    }

    /// Coordinates of what a patch shows at a window position and a distance, within the rectangle around the footprint.
    pub(super) fn foot_of(&self, patch: &OrientedPolygon, at: Vec2, distance: f32) -> Vec2 {
        let [u, v] =
            [patch.axis, patch.second_axis()].map(|axis| self.rotation * axis / self.model_scale);
        let offset = (self.point(at, distance) - self.place(patch.center)) / self.model_scale;
        let corners = patch.footprint().iter().copied().map(Vec2::from_array);
        let (low, high) = corners.fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), at| {
            (low.min(at), high.max(at))
        });
        Vec2::new(offset.dot(u), offset.dot(v)).clamp(low, high)
    }
}
