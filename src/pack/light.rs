//! Where light comes from, and what it does to a surface.
//!
//! Besides the headlight there is one movable lamp, with the half-vector form of Phong's reflection (Phong,
//! "Illumination for Computer Generated Pictures", 1975; Blinn, "Models of Light Reflection for Computer Synthesized
//! Pictures", SIGGRAPH 1977). With n the unit normal, l and v the unit vectors to lamp and eye, h = (l + v) / |l + v|
//! and C the vertex color:
//!
//! ```text
//! value = 0.8 C (ambient + (1 - ambient) max(0, n . l)) + specular g max(0, n . h)^shininess
//! g = n . l / 0.1, limited to 0..=1
//! ```
//!
//! limited to 1. The papers have g = 1; ours lets the highlight fade in over the first 6 degrees past the terminator,
//! where a lamp from behind would end it in a hard edge. `ambient` is the part of the light that comes from everywhere, so that no choice of it makes a white
//! surface brighter than 0.8 outside of highlights; the highlight has the color of the lamp. There is no shadow and
//! no attenuation.

use crate::math::camera::View;
use crate::pack::lit_sphere::LitSphere;
use glam::{DMat4, DVec3};

/// How surfaces are lit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum SurfaceLighting {
    /// Light in the eye, see [`crate::math::camera::HeadlightSource`]: 0.8 |n . l|.
    #[default]
    Headlight,
    /// One lamp.
    Phong(Phong),
    /// Lamps that go with the camera, and a material.
    Sphere(LitSphere),
}

impl SurfaceLighting {
    /// Tells whether a gray surface is gray in it.
    pub fn is_gray(self) -> bool {
        match self {
            Self::Headlight | Self::Phong(_) => true,
            Self::Sphere(sphere) => sphere.lights().are_gray(),
        }
    }

    /// The same light for a model whose zero lies at `origin` in the world: positions relative to it.
    pub fn in_model(self, origin: DVec3) -> Self {
        match self {
            Self::Phong(
                phong @ Phong {
                    lamp: Lamp::At(position),
                    ..
                },
            ) => Self::Phong(Phong {
                lamp: Lamp::At(position - origin),
                ..phong
            }),
            other => other,
        }
    }
}

/// A lamp and what surfaces make of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phong {
    /// Where the lamp is.
    pub lamp: Lamp,
    /// Part of the light that comes from everywhere, 0..=1.
    pub ambient: f32,
    /// Value of the highlight at its middle, 0..=1.
    pub specular: f32,
    /// Exponent of the highlight, at least 1: larger is smaller.
    pub shininess: f32,
}

impl Default for Phong {
    /// Over the viewer's left shoulder; a facing white surface with the highlight on it is just white.
    fn default() -> Self {
        Self {
            lamp: Lamp::FromCamera {
                azimuth: (-30f64).to_radians(),
                elevation: 30f64.to_radians(),
            },
            ambient: 0.1,
            specular: 0.2,
            shininess: 32.0,
        }
    }
}

/// Where a lamp is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lamp {
    /// Parallel light that keeps its direction relative to the camera: from the viewer at 0, 0; from the right for
    /// a positive azimuth, from above for a positive elevation; from behind the object past 90 degrees of azimuth.
    /// Radians.
    FromCamera {
        /// Angle around the camera's up axis.
        azimuth: f64,
        /// Angle above the camera's horizontal plane.
        elevation: f64,
    },
    /// A point: of the world in [`crate::render::Settings`], of the model in [`crate::pack::PrimitiveStyle`].
    At(DVec3),
}

/// A lamp as seen from the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LampSource {
    /// Unit vector towards parallel light.
    Direction(DVec3),
    /// Position of a point light.
    Point(DVec3),
}

impl Lamp {
    /// In view space; of a lamp whose position is one of the model.
    pub fn in_view(self, view: &View) -> LampSource {
        match self {
            Self::FromCamera { azimuth, elevation } => {
                let (sin_a, cos_a) = azimuth.sin_cos();
                let (sin_e, cos_e) = elevation.sin_cos();
                LampSource::Direction(DVec3::new(cos_e * sin_a, sin_e, cos_e * cos_a))
            }
            Self::At(position) => {
                LampSource::Point(view.view_from_model.as_dmat4().transform_point3(position))
            }
        }
    }

    /// In model space; of a lamp whose position is one of the model.
    pub fn in_model(self, view: &View) -> LampSource {
        let model_from_view = || -> DMat4 { view.view_from_model.as_dmat4().inverse() };
        match self {
            Self::At(position) => LampSource::Point(position),
            Self::FromCamera { .. } => match self.in_view(view) {
                LampSource::Direction(direction) => LampSource::Direction(
                    model_from_view()
                        .transform_vector3(direction)
                        .normalize_or_zero(),
                ),
                point @ LampSource::Point(_) => point,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::camera::Camera;

    #[test]
    fn directions_are_those_of_the_picture_and_positions_those_of_the_world() {
        let camera = Camera::orbit((64, 64), DVec3::new(5.0, 6.0, 7.0), 2.0, 1.1, -0.4, 1.0);
        let origin = DVec3::new(5.0, 6.0, 7.0);
        let view = camera.view(origin).unwrap();
        for (azimuth, elevation, wanted) in [
            (0.0, 0.0, DVec3::Z),
            (90.0, 0.0, DVec3::X),
            (-90.0, 0.0, DVec3::NEG_X),
            (180.0, 0.0, DVec3::NEG_Z),
            (33.0, 90.0, DVec3::Y),
        ] {
            let lamp = Lamp::FromCamera {
                azimuth: f64::to_radians(azimuth),
                elevation: f64::to_radians(elevation),
            };
            let LampSource::Direction(got) = lamp.in_view(&view) else {
                panic!("{lamp:?} is parallel light")
            };
            assert!(got.distance(wanted) < 1e-12, "{got} is not {wanted}");
            // What comes from the camera in model space is the camera's own axis.
            let LampSource::Direction(in_model) = lamp.in_model(&view) else {
                panic!("{lamp:?} is parallel light")
            };
            let back = view.view_from_model.as_dmat4().transform_vector3(in_model);
            assert!(back.distance(wanted) < 1e-6, "{back} is not {wanted}");
        }
        // The eye itself, as a world position, is zero in view space.
        let eye = camera.view.inverse().transform_point3(DVec3::ZERO);
        let phong = Phong {
            lamp: Lamp::At(eye),
            ..Phong::default()
        };
        let SurfaceLighting::Phong(phong) = SurfaceLighting::Phong(phong).in_model(origin) else {
            panic!("still a lamp")
        };
        let LampSource::Point(in_view) = phong.lamp.in_view(&view) else {
            panic!("a position is a point light")
        };
        assert!(in_view.length() < 1e-5, "{in_view}");
    }
}
