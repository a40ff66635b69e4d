//! What light makes of a surface, one point at a time: the operations of `shaders/common/headlight.glsl` and of
//! `shaders/common/falsecolor.glsl`, in their order. Pictures of eight bits in the headlight have vectors of their own
//! ([`crate::render::cpu::opaque`]); this serves all others.

use crate::abi::constants::{
    FLAG_COLOR_BY_DEPTH, FLAG_COLOR_BY_LEVEL, FLAG_COLOR_BY_NORMAL, FLAG_COLOR_BY_PRIMITIVE,
    FLAG_CULLS_BACK, FLAG_LIT_SPHERE, FLAG_ORTHOGRAPHIC, FLAG_PARALLEL_LIGHT, FLAG_PHONG,
    FLAG_TWO_SIDED, FLAG_USE_COLORS, FULL_HIGHLIGHT, LEAST_BACK,
};
use crate::abi::{FrameConstants, OrientedPolygon, PatchTexture, Splat};
use crate::pack::lit_sphere::{LitSurface, SphereLights};
use crate::pack::{ALBEDO, falsecolor};
use crate::patches::{PatchLight, PixelRays};
use crate::textures::TextureImage;
use glam::{Mat3, Mat4, Vec2, Vec3, Vec4};
use std::sync::Arc;

/// What splats are tinted with when coloring by primitive.
pub(super) const SPLAT_TINT: Vec3 = Vec3::new(1.0, 0.2, 0.2);
/// What triangles are tinted with then.
pub(super) const TRIANGLE_TINT: Vec3 = Vec3::new(0.2, 0.35, 1.0);

/// What patches of a cut by error are tinted with.
pub(super) const PATCH_TINT: Vec3 = Vec3::new(0.25, 0.9, 0.35);

/// Frames with any of these show more than the headlight.
const OTHERS: u32 =
    FLAG_PHONG | FLAG_LIT_SPHERE | FLAG_COLOR_BY_LEVEL | FLAG_COLOR_BY_NORMAL | FLAG_COLOR_BY_DEPTH;

/// The part of a frame that decides what surfaces look like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FrameShading {
    flags: u32,
    view_from_model: Mat4,
    /// Of directions: `model_scale` times a rotation.
    turn: Mat3,
    model_scale: f32,
    /// As [`FrameConstants::ray_scale`] and `ray_offset`.
    ray_scale: Vec2,
    ray_offset: Vec2,
    /// Of the clip space: factor of z, and what is added to depth.
    depth_from_z: [f32; 2],
    /// In model space: a position (last component 1), or the unit vector towards it (0).
    headlight: Vec4,
    /// The same in view space.
    lamp: Vec4,
    ambient: f32,
    specular: f32,
    shininess: f32,
    /// Distances along the view direction.
    depth_range: [f32; 2],
    /// Of frames with such a light.
    sphere: SphereLights,
}

/// A point of a surface, shaded.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct ShadedPoint {
    /// Red, green and blue; 1 is white.
    pub(super) color: Vec3,
    /// Unit, with the axes of model and world; zero where the surface has none.
    pub(super) normal: Vec3,
}

/// A point of a triangle at the center of a pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct TrianglePoint {
    /// Unit, view space; zero where there is none.
    pub(super) normal: Vec3,
    /// The color of its vertices.
    pub(super) color: Vec3,
    pub(super) pixel: [u32; 2],
    /// Reversed depth.
    pub(super) depth: f32,
    /// 1 over the last component of clip space.
    pub(super) inverse_w: f32,
}

impl FrameShading {
    /// Shading of a frame.
    pub(crate) fn new(frame: &FrameConstants) -> Self {
        let view_from_model = Mat4::from_cols_array_2d(&frame.view_from_model);
        Self {
            flags: frame.flags,
            view_from_model,
            turn: Mat3::from_mat4(view_from_model),
            model_scale: frame.model_scale,
            ray_scale: frame.ray_scale.into(),
            ray_offset: frame.ray_offset.into(),
            depth_from_z: [frame.clip_from_view[2][2], frame.clip_from_view[3][2]],
            headlight: frame.headlight.into(),
            lamp: frame.lamp.into(),
            ambient: frame.ambient,
            specular: frame.specular,
            shininess: frame.shininess,
            depth_range: frame.depth_range,
            sphere: SphereLights::of_frame(frame),
        }
    }

    fn has(&self, flag: u32) -> bool {
        self.flags & flag != 0
    }

    /// Tells whether kinds of primitives decide colors.
    pub(super) fn is_tinted(&self) -> bool {
        self.has(FLAG_COLOR_BY_PRIMITIVE)
    }

    /// Tells whether the headlight decides alone: the frame has no lamp and shows no data.
    pub(super) fn has_headlight(&self) -> bool {
        !self.has(OTHERS)
    }

    /// The headlight alone, for patches.
    pub(super) fn patch_light(&self) -> PatchLight {
        PatchLight {
            is_parallel: self.has(FLAG_PARALLEL_LIGHT),
            is_two_sided: self.has(FLAG_TWO_SIDED),
            has_colors: self.has(FLAG_USE_COLORS) && !self.has(FLAG_COLOR_BY_PRIMITIVE),
            albedo: self.albedo(Vec3::ONE, PATCH_TINT).to_array(),
        }
    }

    /// A splat, which has one color.
    pub(super) fn of_splat(&self, splat: &Splat) -> ShadedPoint {
        let color = color_of(splat);
        let has_normal = splat.color[3] > 0;
        let long = match has_normal {
            true => decoded(splat),
            false => Vec3::ZERO,
        };
        let normal = match has_normal {
            true => long / long.length(),
            false => Vec3::ZERO,
        };
        let color = if self.has_headlight() {
            let to_light = self.headlight.truncate() - splat.center * self.headlight.w;
            let lambert = self.lambert(long, to_light);
            self.albedo(color, SPLAT_TINT) * lambert
        } else {
            let at = self.view_from_model.transform_point3(splat.center);
            let in_view = self.turn * normal / self.model_scale;
            self.other(at, in_view, color, SPLAT_TINT)
        };
        ShadedPoint { color, normal }
    }

    /// A point of an oriented polygon, in the plane of which it has these coordinates.
    pub(super) fn of_polygon(
        &self,
        polygon: &OrientedPolygon,
        uv: [f32; 2],
        tint: Vec3,
    ) -> ShadedPoint {
        self.of_colored(polygon, uv, (polygon.color_at(uv), tint))
    }

    /// A point of a patch that shows an image where it is in one.
    pub(super) fn of_textured(
        &self,
        patch: &OrientedPolygon,
        uv: [f32; 2],
        (texture, images): (&PatchTexture, &[Arc<TextureImage>]),
    ) -> ShadedPoint {
        let rays = PixelRays {
            turn: self.turn,
            model_scale: self.model_scale,
            step: self.ray_scale,
            is_parallel: self.has(FLAG_ORTHOGRAPHIC),
        };
        let place = self.view_from_model.transform_point3(patch.point(uv));
        let seen = texture.color(images, patch, (uv.into(), place), &rays);
        let color = seen.unwrap_or_else(|| patch.color_at(uv));
        self.of_colored(patch, uv, (color, PATCH_TINT))
    }

    /// A point of an oriented polygon that has this color there.
    fn of_colored(
        &self,
        polygon: &OrientedPolygon,
        uv: [f32; 2],
        (color, tint): (Vec3, Vec3),
    ) -> ShadedPoint {
        let (position, normal) = (polygon.point(uv), polygon.normal_at(uv));
        let share = polygon.light_share();
        let unit = unit_or_zero(normal);
        let color = if self.has_headlight() {
            let to_light = self.headlight.truncate() - position * self.headlight.w;
            self.albedo(color, tint) * self.lambert(normal, to_light) * share
        } else {
            let at = self.view_from_model.transform_point3(position);
            let shown = self.other(at, self.turn * unit / self.model_scale, color, tint);
            // What comes from everywhere falls on a rough surface too.
            let everywhere = match (self.has(FLAG_PHONG), self.has(FLAG_LIT_SPHERE)) {
                (true, _) => Some(self.albedo(color, tint) * self.ambient),
                (_, true) => Some(
                    self.sphere
                        .everywhere_light(self.albedo(color, tint) / ALBEDO),
                ),
                _ => None,
            };
            everywhere.map_or(shown, |everywhere| everywhere.lerp(shown, share))
        };
        ShadedPoint {
            color,
            normal: unit,
        }
    }

    /// A point of a splat from a vertex before light falls on it.
    pub(super) fn base_of_polygon(&self, polygon: &OrientedPolygon, uv: [f32; 2]) -> ShadedPoint {
        ShadedPoint {
            color: match self.is_tinted() {
                true => SPLAT_TINT,
                false => polygon.color_at(uv),
            },
            normal: unit_or_zero(polygon.normal_at(uv)),
        }
    }

    /// A normal with the axes of the model that a pixel sees, turned around where deferred shading sums it so.
    pub(super) fn turned(&self, pixel: [u32; 2], normal: Vec3) -> Vec3 {
        let facing = self.facing(pixel, normal);
        let is_back = match self.has(FLAG_PHONG | FLAG_LIT_SPHERE) {
            true => !self.has(FLAG_CULLS_BACK) && facing < -LEAST_BACK,
            false => facing < 0.0,
        };
        match self.has(FLAG_TWO_SIDED) && is_back {
            true => -normal,
            false => normal,
        }
    }

    /// Cosine between a normal with the axes of the model and the direction from a pixel to the eye; 1 without a normal.
    pub(super) fn facing(&self, pixel: [u32; 2], normal: Vec3) -> f32 {
        let to_eye = self.eye_direction(self.ray(pixel).extend(-1.0));
        match normal == Vec3::ZERO {
            true => 1.0,
            false => (self.turn * normal / self.model_scale).dot(to_eye),
        }
    }

    /// Means of deferred shading, lit: of a color before light falls on it, of a normal with the axes of the model, and of
    /// reversed depths.
    pub(super) fn of_means(&self, pixel: [u32; 2], base: ShadedPoint, depth: f32) -> Vec3 {
        let normal = self.turn * base.normal / self.model_scale;
        let albedo = self.albedo(base.color, base.color);
        let ray = self.ray(pixel);
        if self.has(FLAG_PHONG | FLAG_LIT_SPHERE) {
            let [factor, added] = self.depth_from_z;
            let at = match self.has(FLAG_ORTHOGRAPHIC) {
                true => ray.extend((depth - added) / factor),
                false => ray.extend(-1.0) * (added / (depth + factor)),
            };
            return self.in_lamps(at, normal, albedo);
        }
        let to_light = match self.has(FLAG_PARALLEL_LIGHT) {
            true => Vec3::Z,
            false => -ray.extend(-1.0),
        };
        albedo * self.lambert(normal, to_light)
    }

    /// A triangle that covers few pixels, as a splat of one; not in colors by primitive.
    pub(super) fn of_sample(&self, sample: &Splat) -> ShadedPoint {
        let point = self.of_splat(sample);
        match self.has(FLAG_COLOR_BY_LEVEL) {
            true => ShadedPoint {
                color: falsecolor::ramp(falsecolor::LEAF).into(),
                ..point
            },
            false => point,
        }
    }

    /// A point of a triangle in a frame that has a lamp or shows data.
    pub(super) fn of_triangle(&self, point: &TrianglePoint) -> Vec3 {
        let at = self.ray(point.pixel);
        let at = match self.has(FLAG_ORTHOGRAPHIC) {
            true => {
                let [factor, added] = self.depth_from_z;
                at.extend((point.depth - added) / factor)
            }
            false => at.extend(-1.0) / point.inverse_w,
        };
        if self.has(FLAG_COLOR_BY_LEVEL) {
            return falsecolor::ramp(falsecolor::LEAF).into();
        }
        self.other(at, point.normal, point.color, TRIANGLE_TINT)
    }

    /// A direction of view space in model space.
    pub(super) fn in_model(&self, direction: Vec3) -> Vec3 {
        self.turn.transpose() * direction / self.model_scale
    }

    /// The direction through the center of a pixel, at z = -1; of an orthographic view its position.
    pub(super) fn ray(&self, [x, y]: [u32; 2]) -> Vec2 {
        (Vec2::new(x as f32, y as f32) + 0.5) * self.ray_scale + self.ray_offset
    }

    /// Of a normal and a direction of any length; without a normal it faces the light.
    pub(super) fn lambert(&self, normal: Vec3, to_light: Vec3) -> f32 {
        let squared = normal.length_squared();
        let lambert = if squared > 0.0 {
            let facing = normal.dot(to_light) / (squared * to_light.length_squared()).sqrt();
            match self.has(FLAG_TWO_SIDED) {
                true => facing.abs(),
                false => facing.max(0.0),
            }
        } else {
            1.0
        };
        lambert.min(1.0)
    }

    /// Color of the surface itself.
    fn albedo(&self, color: Vec3, tint: Vec3) -> Vec3 {
        if self.has(FLAG_COLOR_BY_PRIMITIVE) {
            ALBEDO * tint
        } else if self.has(FLAG_USE_COLORS) {
            ALBEDO * color
        } else {
            Vec3::splat(ALBEDO)
        }
    }

    /// In the light of the lamp, or as data. `at` and the normal, unit or zero, are in view space.
    fn other(&self, at: Vec3, normal: Vec3, color: Vec3, tint: Vec3) -> Vec3 {
        if self.has(FLAG_COLOR_BY_LEVEL) {
            color
        } else if self.has(FLAG_COLOR_BY_NORMAL) {
            0.5 + 0.5 * self.in_model(normal)
        } else if self.has(FLAG_COLOR_BY_DEPTH) {
            let [near, far] = self.depth_range;
            falsecolor::ramp((far + at.z) / (far - near)).into()
        } else {
            self.in_lamps(at, normal, self.albedo(color, tint))
        }
    }

    /// A surface of an albedo in light that is not the headlight.
    fn in_lamps(&self, at: Vec3, normal: Vec3, albedo: Vec3) -> Vec3 {
        if !self.has(FLAG_LIT_SPHERE) {
            return self.in_lamp(at, normal, albedo);
        }
        let surface = LitSurface {
            normal,
            to_eye: self.eye_direction(at),
            culls_back: self.has(FLAG_CULLS_BACK),
            two_sided: self.has(FLAG_TWO_SIDED),
        };
        self.sphere.value(&surface, albedo / ALBEDO)
    }

    /// Unit vector from a point of view space to the eye.
    fn eye_direction(&self, at: Vec3) -> Vec3 {
        match self.has(FLAG_ORTHOGRAPHIC) {
            true => Vec3::Z,
            false => -unit_or_zero(at),
        }
    }

    fn in_lamp(&self, at: Vec3, normal: Vec3, albedo: Vec3) -> Vec3 {
        if normal == Vec3::ZERO {
            return albedo;
        }
        let to_eye = self.eye_direction(at);
        let to_lamp = unit_or_zero(self.lamp.truncate() - self.lamp.w * at);
        let is_back = !self.has(FLAG_CULLS_BACK) && normal.dot(to_eye) < -LEAST_BACK;
        // The side that is seen is the other one; lit from the front only, it has no light of the lamp.
        let side = match (is_back, self.has(FLAG_TWO_SIDED)) {
            (false, _) => 1.0,
            (true, true) => -1.0,
            (true, false) => 0.0,
        };
        let cosine = side * normal.dot(to_lamp);
        let half_cosine = side * normal.dot(unit_or_zero(to_lamp + to_eye));
        let highlight = match half_cosine > 0.0 {
            true => half_cosine.min(1.0).powf(self.shininess),
            false => 0.0,
        };
        let highlight = highlight * (cosine / FULL_HIGHLIGHT).clamp(0.0, 1.0);
        let lambert = cosine.clamp(0.0, 1.0);
        let value = albedo * (self.ambient + (1.0 - self.ambient) * lambert)
            + Vec3::splat(self.specular * highlight);
        value.min(Vec3::ONE)
    }
}

pub(super) fn unit_or_zero(v: Vec3) -> Vec3 {
    let squared = v.length_squared();
    match squared > 0.0 {
        true => v / squared.sqrt(),
        false => Vec3::ZERO,
    }
}

/// The color of a splat (1 is white), with what its bytes leave out.
fn color_of(splat: &Splat) -> Vec3 {
    let fine = splat.radius.rest();
    let channel = |byte: u8, left: i32| (f32::from(byte) + (left >> 29) as f32 / 8.0) / 255.0;
    let [red, green, blue, _] = splat.color;
    Vec3::new(
        channel(red, fine << 7),
        channel(green, fine << 4),
        channel(blue, fine << 1),
    )
}

/// The normal of a splat, of any length, with what its code leaves out.
fn decoded(splat: &Splat) -> Vec3 {
    let fine = splat.radius.rest();
    let coordinate = |code: i16, left: i32| {
        ((f32::from(code) + (left >> 21) as f32 / 1024.0) / 32767.0).max(-1.0)
    };
    let x = coordinate(splat.normal[0], fine << 21);
    let y = coordinate(splat.normal[1], fine << 10);
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let folded = |v: f32| v - if v >= 0.0 { fold } else { -fold };
    Vec3::new(folded(x), folded(y), z)
}
