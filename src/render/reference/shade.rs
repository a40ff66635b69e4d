//! What light makes of a surface: the headlight's value = 0.8 |n . l| times the vertex color (conventions: "default
//! shading"), or one lamp ([`crate::pack::Lighting`] has the equation).

use crate::abi::Splat;
use crate::abi::constants::{FULL_HIGHLIGHT, LEAST_BACK};
use crate::math::camera::{Light, View};
use crate::math::octahedral;
use crate::pack::{ALBEDO, ColorBy, Lighting, Phong, Source, Style, falsecolor};
use crate::render::reference::bands::ShownPixel;
use glam::{DVec3, DVec4, Vec3};

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
    light: Source,
    /// What surfaces make of the lamp; none with the headlight.
    phong: Option<Phong>,
    /// Where the eye is, or the direction to it in an orthographic view.
    eye: Source,
    /// What faces away is culled, so every normal counts as one that faces the eye.
    culls_back: bool,
    two_sided: bool,
    use_colors: bool,
    color_by: ColorBy,
    /// Distance along the view direction of a position.
    distance: DVec4,
    depth_range: [f32; 2],
}

impl SurfaceShading {
    pub(super) fn new(view: &View, style: &Style) -> Self {
        let backward = Source::Direction(view.backward.as_dvec3());
        let eye = if view.is_perspective {
            Source::Point(view.eye.as_dvec3())
        } else {
            backward
        };
        Self {
            light: match (style.light, view.light) {
                (Lighting::Phong(phong), _) => phong.lamp.in_model(view),
                (Lighting::Headlight, Light::Point) => eye,
                (Lighting::Headlight, Light::Directional) => backward,
            },
            phong: match style.light {
                Lighting::Headlight => None,
                Lighting::Phong(phong) => Some(phong),
            },
            eye,
            culls_back: style.cull_back_faces,
            two_sided: style.two_sided,
            use_colors: style.use_colors,
            color_by: style.color_by,
            distance: -view.view_from_model.row(2).as_dvec4(),
            depth_range: style.depth_range,
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
        let albedo = f64::from(ALBEDO);
        if let Some(phong) = &self.phong {
            let to_eye = toward(self.eye, position);
            let lit = self.in_lamp(phong, to_eye, to_light, normal, albedo * color);
            let from_everywhere = albedo * color * f64::from(phong.ambient);
            return from_everywhere * (1.0 - light_share) + lit * light_share;
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
fn toward(source: Source, position: DVec3) -> DVec3 {
    match source {
        Source::Point(point) => (point - position).normalize_or_zero(),
        Source::Direction(direction) => direction,
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
