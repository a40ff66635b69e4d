//! Eye of a frame, and light that is not the headlight.

use crate::abi::constants::{FULL_HIGHLIGHT, LEAST_BACK};
use crate::math::camera::View;
use crate::math::octahedral;
use crate::pack::filtered::FilteredShade;
use crate::pack::filtered::patch::SummedPatch;
use crate::pack::filtered::projection::PictureProjection;
use crate::pack::lit_sphere::{LitSurface, SphereLights};
use crate::pack::{LampSource, Phong, SurfaceLighting};
use crate::tree::Tree;
use glam::{Vec3, Vec4};

/// The part of the frame that every splat needs.
pub(super) struct FilteredEye<'a> {
    pub(super) tree: &'a Tree,
    pub(super) view: &'a View,
    pub(super) shade: FilteredShade,
    /// Pixels of a model unit at distance 1 (perspective), or everywhere.
    pub(super) focal_px: f32,
    /// Distance along the view direction of a point in model units: of its coordinates, and alone.
    pub(super) forward: Vec4,
    pub(super) projection: PictureProjection,
    /// Depth offset in half sides.
    pub(super) offset_px: f32,
    /// To the right and up in the picture, unit vectors in model space.
    pub(super) right: Vec3,
    pub(super) up: Vec3,
    /// Material and place of the lamp; `None` where there is no lamp.
    pub(super) lamp: Option<(Phong, LampSource)>,
    /// Lights that go with the camera.
    pub(super) sphere: Option<SphereLights>,
}

impl<'a> FilteredEye<'a> {
    /// Eye of a view.
    pub(super) fn new(tree: &'a Tree, view: &'a View, shade: FilteredShade) -> Self {
        let axis = |row: usize| view.view_from_model.row(row).truncate() / view.model_scale;
        Self {
            tree,
            view,
            shade,
            focal_px: if view.is_perspective {
                view.focal_px()
            } else {
                view.focal_px() * view.model_scale
            },
            forward: -view.view_from_model.row(2) / view.model_scale,
            projection: PictureProjection::new(view),
            offset_px: shade.depth_offset,
            right: axis(0),
            up: axis(1),
            lamp: match shade.light {
                SurfaceLighting::Headlight | SurfaceLighting::Sphere(_) => None,
                SurfaceLighting::Phong(phong) => Some((phong, phong.lamp.in_model(view))),
            },
            sphere: match shade.light {
                SurfaceLighting::Headlight | SurfaceLighting::Phong(_) => None,
                SurfaceLighting::Sphere(sphere) => Some(sphere.lights()),
            },
        }
    }

    /// The mean shading normal of a patch, zero where there is none.
    pub(super) fn normal(&self, patch: &SummedPatch) -> Vec3 {
        match patch.node {
            _ if patch.is_bare => Vec3::ZERO,
            Some(id) => octahedral::decode(self.tree.attributes[id as usize].normal),
            None => patch.normals.normalize_or_zero(),
        }
    }

    /// The color of a patch of this color, as seen along `v`, under lights that go with the camera: that of its mean normal.
    pub(super) fn on_sphere(
        &self,
        sphere: &SphereLights,
        patch: &SummedPatch,
        v: Vec3,
        color: [f32; 3],
    ) -> [f32; 3] {
        let back = -self.forward.truncate();
        let in_view = |direction: Vec3| {
            let axes = [self.right, self.up, back];
            Vec3::from(axes.map(|axis| axis.dot(direction)))
        };
        let surface = LitSurface {
            normal: in_view(self.normal(patch)),
            to_eye: in_view(v),
            culls_back: self.shade.cull_back,
            two_sided: true,
        };
        sphere.value(&surface, color.into()).into()
    }

    /// The factor of the albedo and the highlight of a patch whose fronts and backs cover `both` as seen along `v`.
    pub(super) fn in_lamp(
        &self,
        phong: &Phong,
        source: LampSource,
        patch: &SummedPatch,
        center: Vec3,
        v: Vec3,
        both: f32,
    ) -> (f32, f32) {
        let l = match source {
            LampSource::Point(lamp) => (lamp - center.as_dvec3()).normalize_or_zero().as_vec3(),
            LampSource::Direction(direction) => direction.as_vec3(),
        };
        // Two-sided as it stands: an element of either side is lit when lamp and eye are on the same side of it.
        let of_second = v.dot(patch.second_moment * l);
        let length = (patch.normals.length() / patch.area).min(1.0);
        let mean = patch.normals.normalize_or_zero();
        let mean = if !self.shade.cull_back && mean.dot(v) < -LEAST_BACK {
            -mean
        } else {
            mean
        };
        // Q and N of a triangle have different normals, and their quotient is none.
        let lambert = if patch.is_triangle {
            mean.dot(l).max(0.0)
        } else {
            (of_second / both).max(0.0)
        };
        let cosine = mean.dot((l + v).normalize_or_zero()).clamp(0.0, 1.0);
        let rise = (mean.dot(l) / FULL_HIGHLIGHT).clamp(0.0, 1.0);
        let highlight = if rise > 0.0 && cosine > 0.0 {
            let s = phong.shininess;
            let k = length / (length + s * (1.0 - length));
            rise * phong.specular * (1.0 + k * s) / (1.0 + s) * cosine.powf(k * s)
        } else {
            0.0
        };
        let ambient = phong.ambient;
        (ambient + (1.0 - ambient) * lambert.min(1.0), highlight)
    }
}
