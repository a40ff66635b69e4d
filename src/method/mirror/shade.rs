//! Headlight shading: value = 0.8 |n . l| times the vertex color (conventions: "default shading").

use crate::draw::{ALBEDO, ColorBy, Style};
use crate::image::unorm8;
use crate::math::camera::{Light, View};
use crate::math::octahedral;
use glam::DVec3;

/// Tints of [`ColorBy::Primitive`].
const SPLAT_TINT: DVec3 = DVec3::new(1.0, 0.2, 0.2);
const TRIANGLE_TINT: DVec3 = DVec3::new(0.2, 0.35, 1.0);

/// What is being shaded, for [`ColorBy::Primitive`].
#[derive(Clone, Copy)]
pub(super) enum Kind {
    Triangle,
    Splat,
}

/// The constants of shading. Everything is in model space, whose axes are those of the world.
pub(super) struct Shading {
    light: Source,
    two_sided: bool,
    use_colors: bool,
    color_by: ColorBy,
}

enum Source {
    /// The light is in this point.
    Point(DVec3),
    /// The light comes from this direction (unit).
    Direction(DVec3),
}

impl Shading {
    pub(super) fn new(view: &View, style: &Style) -> Self {
        Self {
            light: match view.light {
                Light::Point if view.is_perspective => Source::Point(view.eye.as_dvec3()),
                Light::Point | Light::Directional => Source::Direction(view.backward.as_dvec3()),
            },
            two_sided: style.two_sided,
            use_colors: style.use_colors,
            color_by: style.color_by,
        }
    }

    /// The color of a surface point in the eight bits of the target; see [`Shading::value`].
    pub(super) fn color(
        &self,
        kind: Kind,
        position: DVec3,
        normal: DVec3,
        color: DVec3,
    ) -> [u8; 4] {
        let value = self.value(kind, position, normal, color);
        [unorm8(value.x), unorm8(value.y), unorm8(value.z), 255]
    }

    /// Red, green and blue of a surface point, 1 is white; `normal` is a unit vector, or zero where the surface
    /// has none and is shaded as if it faced the light. `color` holds value / 255.
    pub(super) fn value(&self, kind: Kind, position: DVec3, normal: DVec3, color: DVec3) -> DVec3 {
        let to_light = match self.light {
            Source::Point(eye) => (eye - position).normalize_or_zero(),
            Source::Direction(direction) => direction,
        };
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
        let albedo = match (self.color_by, kind) {
            (ColorBy::Primitive, Kind::Triangle) => TRIANGLE_TINT,
            (ColorBy::Primitive, Kind::Splat) => SPLAT_TINT,
            (ColorBy::Shading, _) if self.use_colors => color,
            (ColorBy::Shading | ColorBy::Classification, _) => DVec3::ONE,
        };
        // The shader's constant is single precision; so is this one.
        f64::from(ALBEDO) * cosine * albedo
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
