//! What light makes of a surface: the headlight's value = 0.8 |n . l| times the vertex color (conventions: "default
//! shading"), or one lamp ([`crate::pack::SurfaceLighting`] has the equation).

use crate::abi::Splat;
use crate::abi::constants::{FULL_HIGHLIGHT, LEAST_BACK};
use crate::math::camera::{HeadlightSource, View};
use crate::math::octahedral;
use crate::pack::lit_sphere::SphereLights;
use crate::pack::{ColorBy, LampSource, Phong, PrimitiveStyle, SurfaceLighting, falsecolor};
use crate::render::reference::bands::ShownPixel;
use glam::{DMat3, DQuat, DVec3, DVec4, Vec3};

/// Tints of [`ColorBy::Primitive`].
pub(super) const SPLAT_TINT: DVec3 = DVec3::new(1.0, 0.2, 0.2);
pub(super) const TRIANGLE_TINT: DVec3 = DVec3::new(0.2, 0.35, 1.0);
pub(super) const PATCH_TINT: DVec3 = DVec3::new(0.25, 0.9, 0.35);

/// What is being shaded, for [`ColorBy::Primitive`].
#[derive(Clone, Copy)]
pub(super) enum SurfaceKind {
    Triangle,
    Splat,
    Patch,
}

/// A point of a surface.
#[derive(Clone, Copy)]
pub(super) struct SurfacePoint {
    pub(super) kind: SurfaceKind,
    /// Model space.
    pub(super) position: DVec3,
    /// Unit, model space; zero where the surface has none and is shaded as if it faced the light.
    pub(super) normal: DVec3,
    /// Value / 255.
    pub(super) color: DVec3,
    /// Part of the light that the surface keeps, 0 to 1.
    pub(super) light_share: f64,
    /// View-space distance.
    pub(super) distance: f64,
}

impl SurfacePoint {
    /// The center of a splat at a distance.
    pub(super) fn of_splat(splat: &Splat, distance: f32) -> Self {
        Self {
            kind: SurfaceKind::Splat,
            position: splat.center.as_dvec3(),
            normal: normal_of(splat.normal, splat.color),
            color: color_of(splat.color),
            light_share: 1.0,
            distance: f64::from(distance),
        }
    }
}

/// The constants of shading. Everything is in model space, whose axes are those of the world.
pub(super) struct SurfaceShading {
    /// The headlight, or the lamp.
    light: LampSource,
    /// What surfaces make of the lamp; none with the headlight.
    phong: Option<Phong>,
    /// Lights that go with the camera.
    sphere: Option<SphereLights>,
    /// View space from model space, of directions.
    turn: DMat3,
    /// Where the eye is, or the direction to it in an orthographic view.
    eye: LampSource,
    /// What faces away is culled, so every normal counts as one that faces the eye.
    culls_back: bool,
    two_sided: bool,
    use_colors: bool,
    color_by: ColorBy,
    /// Distance along the view direction of a position.
    distance: DVec4,
    depth_range: [f32; 2],
    /// [`PrimitiveStyle::albedo`].
    albedo: f32,
}

impl SurfaceShading {
    pub(super) fn new(view: &View, style: &PrimitiveStyle) -> Self {
        let backward = LampSource::Direction(view.backward.as_dvec3());
        let eye = if view.is_perspective {
            LampSource::Point(view.eye.as_dvec3())
        } else {
            backward
        };
        Self {
            light: match (style.light, view.light) {
                (SurfaceLighting::Phong(phong), _) => phong.lamp.in_model(view),
                (_, HeadlightSource::Point) => eye,
                (_, HeadlightSource::Directional) => backward,
            },
            sphere: match style.light {
                SurfaceLighting::Sphere(sphere) => Some(sphere.lights()),
                SurfaceLighting::Headlight | SurfaceLighting::Phong(_) => None,
            },
            turn: DMat3::from_mat4(view.view_from_model.as_dmat4())
                * f64::from(view.model_scale).recip(),
            phong: match style.light {
                SurfaceLighting::Headlight | SurfaceLighting::Sphere(_) => None,
                SurfaceLighting::Phong(phong) => Some(phong),
            },
            eye,
            culls_back: style.cull_back_faces,
            two_sided: style.two_sided,
            use_colors: style.use_colors,
            color_by: style.color_by,
            distance: -view.view_from_model.row(2).as_dvec4(),
            depth_range: style.depth_range,
            albedo: style.albedo,
        }
    }

    /// What a pixel shows that a surface point covers.
    pub(super) fn shown(&self, point: &SurfacePoint) -> ShownPixel {
        let [r, g, b] = self.value(point).to_array();
        ShownPixel {
            color: [r, g, b, 1.0],
            distance: point.distance as f32,
            normal: point.normal.as_vec3().to_array(),
        }
    }

    /// Red, green and blue of a surface point, 1 is white.
    pub(super) fn value(&self, point: &SurfacePoint) -> DVec3 {
        if let Some(color) = self.data(point) {
            return color;
        }
        let &SurfacePoint {
            kind,
            position,
            normal,
            color,
            light_share,
            ..
        } = point;
        let to_light = toward(self.light, position);
        let color = self.color_of_surface(kind, color);
        // The shader's constant is single precision; so is this one.
        let albedo = f64::from(self.albedo);
        if let Some(phong) = &self.phong {
            let to_eye = toward(self.eye, position);
            let lit = self.in_lamp(phong, to_eye, to_light, normal, albedo * color);
            let from_everywhere = albedo * color * f64::from(phong.ambient);
            return from_everywhere * (1.0 - light_share) + lit * light_share;
        }
        if let Some(sphere) = &self.sphere {
            let to_eye = toward(self.eye, position);
            let lit = self.on_sphere(sphere, to_eye, normal, albedo * color);
            let everywhere = albedo * color * 0.5 * (sphere.sky + sphere.ground).as_dvec3();
            return everywhere * (1.0 - light_share) + lit * light_share;
        }
        let cosine = if normal == DVec3::ZERO {
            1.0
        } else {
            let cosine = normal.dot(to_light);
            if self.two_sided {
                cosine.abs()
            } else {
                cosine.max(0.0)
            }
        };
        albedo * cosine * color * light_share
    }

    /// What is shown without light.
    fn data(&self, point: &SurfacePoint) -> Option<DVec3> {
        let shown = match (self.color_by, point.kind) {
            (
                ColorBy::Shading | ColorBy::Primitive | ColorBy::Classification | ColorBy::Overdraw,
                _,
            ) => return None,
            (ColorBy::Level, SurfaceKind::Splat | SurfaceKind::Patch) => return Some(point.color),
            (ColorBy::Level, SurfaceKind::Triangle) => falsecolor::ramp(falsecolor::LEAF),
            // (n + 1) / 2, in single precision.
            (ColorBy::Normal, _) => (point.normal.as_vec3() * 0.5 + Vec3::splat(0.5)).to_array(),
            // The near end is bright, the far one dark.
            (ColorBy::Depth, _) => {
                let distance = self.distance.dot(point.position.extend(1.0)) as f32;
                let [near, far] = self.depth_range;
                falsecolor::ramp(1.0 - (distance - near) / (far - near))
            }
        };
        Some(Vec3::from(shown).as_dvec3())
    }

    fn color_of_surface(&self, kind: SurfaceKind, color: DVec3) -> DVec3 {
        match (self.color_by, kind) {
            (ColorBy::Primitive, SurfaceKind::Triangle) => TRIANGLE_TINT,
            (ColorBy::Primitive, SurfaceKind::Splat) => SPLAT_TINT,
            (ColorBy::Primitive, SurfaceKind::Patch) => PATCH_TINT,
            (ColorBy::Shading, _) if self.use_colors => color,
            _ => DVec3::ONE,
        }
    }

    /// The equation of [`crate::pack::lit_sphere`]. The frame of the eye has its z axis there, and the axes of the picture turned
    /// with it about the axis across both.
    fn on_sphere(
        &self,
        lights: &SphereLights,
        to_eye: DVec3,
        normal: DVec3,
        albedo: DVec3,
    ) -> DVec3 {
        let (normal, to_eye) = (self.turn * normal, self.turn * to_eye);
        let shows_back = !self.culls_back && normal.dot(to_eye) < -f64::from(LEAST_BACK);
        let turned = DQuat::from_rotation_arc(to_eye.normalize_or_zero(), DVec3::Z) * normal;
        let (n, is_lit) = match (normal == DVec3::ZERO, shows_back, self.two_sided) {
            (true, ..) => (DVec3::Z, 1.0),
            (_, false, _) => (turned, 1.0),
            (_, true, true) => (-turned, 1.0),
            (_, true, false) => (DVec3::ZERO, 0.0),
        };
        let (sky, ground) = (lights.sky.as_dvec3(), lights.ground.as_dvec3());
        let mut value = albedo * ground.lerp(sky, (1.0 + n.y) / 2.0);
        for i in 0..3 {
            let direction = lights.directions[i].as_dvec3();
            let wrap = f64::from(lights.wrap);
            let diffuse = ((n.dot(direction) + wrap) / (1.0 + wrap)).max(0.0);
            value += albedo * lights.colors[i].as_dvec3() * diffuse * is_lit;
            let half = (direction + DVec3::Z).normalize_or_zero();
            let rise = (n.dot(direction) / f64::from(FULL_HIGHLIGHT)).clamp(0.0, 1.0);
            let highlight = n.dot(half).max(0.0).powf(f64::from(lights.shininess));
            value += f64::from(lights.specular[i]) * rise * highlight;
        }
        let rim = (1.0 - n.z.clamp(0.0, 1.0)).powf(f64::from(lights.rim_power));
        value += lights.rim.as_dvec3() * rim * is_lit;
        value.min(DVec3::ONE)
    }

    /// Ambient and diffuse light on the albedo, and the highlight (Blinn, 1977).
    fn in_lamp(
        &self,
        phong: &Phong,
        to_eye: DVec3,
        to_lamp: DVec3,
        normal: DVec3,
        albedo: DVec3,
    ) -> DVec3 {
        if normal == DVec3::ZERO {
            return albedo;
        }
        // The side that is seen is the one of -n; lit from the front only, it has no light of the lamp.
        let shows_back = !self.culls_back && normal.dot(to_eye) < -f64::from(LEAST_BACK);
        let normal = match (shows_back, self.two_sided) {
            (false, _) => normal,
            (true, true) => -normal,
            (true, false) => DVec3::ZERO,
        };
        let lambert = normal.dot(to_lamp).max(0.0);
        let half = (to_lamp + to_eye).normalize_or_zero();
        let rise = (lambert / f64::from(FULL_HIGHLIGHT)).min(1.0);
        let highlight = rise * normal.dot(half).max(0.0).powf(f64::from(phong.shininess));
        let ambient = f64::from(phong.ambient);
        let value = albedo * (ambient + (1.0 - ambient) * lambert)
            + DVec3::splat(f64::from(phong.specular) * highlight);
        value.min(DVec3::ONE)
    }
}

/// Unit vector from a position to a source; zero in the source itself.
fn toward(source: LampSource, position: DVec3) -> DVec3 {
    match source {
        LampSource::Point(point) => (point - position).normalize_or_zero(),
        LampSource::Direction(direction) => direction,
    }
}

/// The unit normal of a vertex or splat; zero when its color says that it has none (alpha 0).
pub(super) fn normal_of(code: [i16; 2], color: [u8; 4]) -> DVec3 {
    if color[3] == 0 {
        DVec3::ZERO
    } else {
        octahedral::decode(code).as_dvec3()
    }
}

/// Red, green and blue as value / 255.
pub(super) fn color_of([r, g, b, _]: [u8; 4]) -> DVec3 {
    DVec3::new(f64::from(r), f64::from(g), f64::from(b)) / 255.0
}
