//! Lights that go with the camera, and materials, as colors of a lit sphere: what a surface shows follows from its normal as the
//! eye sees it, and nothing else.
//!
//! Source: Sloan, Martin, Gooch, Gooch, "The Lit Sphere: A Model for Capturing NPR Shading from Art", Graphics Interface 2001,
//! which takes the sphere from a painting. Ours is a formula: three lamps with wrapped diffuse light, highlights, light from a sky
//! and a ground (Hemisphere lighting), and a rim. With n the unit normal in a frame whose z axis points to the eye, and h_i the
//! direction half between lamp and eye:
//!
//! ```text
//! diffuse = mix(ground, sky, (1 + n.y) / 2) + sum color_i max(0, (n . l_i + wrap) / (1 + wrap))
//! value   = 0.8 C diffuse + sum specular_i g_i max(0, n . h_i)^shininess + rim (1 - n.z)^rim_power
//! ```
//!
//! limited to 1, with g and the sides of a surface as in [`crate::pack::SurfaceLighting`]. Each pixel or splat has a frame of its own, so
//! that a sphere anywhere in the picture is lit as one in its middle.

use crate::abi::FrameConstants;
use crate::abi::constants::{ALBEDO, FULL_HIGHLIGHT, LEAST_BACK};
use glam::{Vec3, Vec4};

/// A light with a material.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LitSphere {
    /// A key light from above left, a fill light from the right, and a rim light from behind.
    Studio,
    /// Dull reddish brown.
    Clay,
    /// White with small highlights and a bluish rim.
    Porcelain,
    /// Dark, with bright sky and large highlights.
    Metal,
}

/// What decides the colors of a lit sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphereLights {
    /// Unit vectors towards the lamps: x to the right, y up, z to the eye.
    pub directions: [Vec3; 3],
    /// Colors of the lamps on a surface that faces them.
    pub colors: [Vec3; 3],
    /// Values of their highlights at the middle.
    pub specular: [f32; 3],
    /// Light from above.
    pub sky: Vec3,
    /// Light from below.
    pub ground: Vec3,
    /// How far light reaches around, 0 to 1.
    pub wrap: f32,
    /// Exponent of the highlights.
    pub shininess: f32,
    /// Color of the rim.
    pub rim: Vec3,
    /// How narrow the rim is.
    pub rim_power: f32,
}

/// How a surface shows itself to the eye.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LitSurface {
    /// Unit, in view space; zero where there is none: it counts as facing the eye.
    pub(crate) normal: Vec3,
    /// Unit vector to the eye, in view space.
    pub(crate) to_eye: Vec3,
    /// Nothing faces away.
    pub(crate) culls_back: bool,
    /// Both sides are lit.
    pub(crate) two_sided: bool,
}

impl LitSphere {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Studio, Self::Clay, Self::Porcelain, Self::Metal];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Studio => "studio",
            Self::Clay => "clay",
            Self::Porcelain => "porcelain",
            Self::Metal => "metal",
        }
    }

    /// Lights of the sphere.
    pub fn lights(self) -> SphereLights {
        let towards = |x: f32, y: f32, z: f32| Vec3::new(x, y, z) / (x * x + y * y + z * z).sqrt();
        let gray = Vec3::splat;
        let directions = [
            towards(-0.6, 0.65, 0.6),
            towards(0.9, 0.0, 0.5),
            towards(0.5, 0.55, -0.8),
        ];
        let studio = SphereLights {
            directions,
            colors: [gray(0.84), gray(0.24), gray(0.55)],
            specular: [0.12, 0.03, 0.1],
            sky: gray(0.2),
            ground: gray(0.1),
            wrap: 0.0,
            shininess: 40.0,
            rim: gray(0.0),
            rim_power: 4.0,
        };
        match self {
            Self::Studio => studio,
            Self::Clay => {
                let clay = Vec3::new(0.86, 0.55, 0.42);
                SphereLights {
                    colors: [clay * 0.8, clay * 0.2, clay * 0.3],
                    specular: [0.04, 0.0, 0.0],
                    sky: clay * 0.28,
                    ground: clay * Vec3::new(0.16, 0.13, 0.13),
                    wrap: 0.3,
                    shininess: 8.0,
                    ..studio
                }
            }
            Self::Porcelain => SphereLights {
                colors: [gray(0.6), gray(0.2), gray(0.35)],
                specular: [0.5, 0.12, 0.3],
                sky: Vec3::new(0.44, 0.46, 0.5),
                ground: Vec3::new(0.3, 0.28, 0.26),
                wrap: 0.2,
                shininess: 120.0,
                rim: Vec3::new(0.06, 0.1, 0.16),
                rim_power: 2.0,
                ..studio
            },
            Self::Metal => SphereLights {
                colors: [gray(0.22), gray(0.1), gray(0.3)],
                specular: [0.6, 0.3, 0.4],
                sky: Vec3::new(0.6, 0.64, 0.7),
                ground: Vec3::new(0.05, 0.045, 0.04),
                wrap: 0.0,
                shininess: 14.0,
                rim: Vec3::new(0.2, 0.22, 0.25),
                rim_power: 3.0,
                ..studio
            },
        }
    }
}

impl SphereLights {
    /// Lights of a frame.
    pub(crate) fn of_frame(frame: &FrameConstants) -> Self {
        let (lamps, colors) = (frame.sphere_lamps.map(Vec4::from), frame.sphere_colors);
        let colors = colors.map(|[red, green, blue, _]| Vec3::new(red, green, blue));
        let [key, fill, back, sky] = lamps.map(Vec4::truncate);
        let [red, green, blue, rim_power] = frame.sphere_rim;
        Self {
            directions: [key, fill, back],
            colors: [colors[0], colors[1], colors[2]],
            specular: [lamps[0].w, lamps[1].w, lamps[2].w],
            sky,
            ground: colors[3],
            wrap: lamps[3].w,
            shininess: frame.shininess,
            rim: Vec3::new(red, green, blue),
            rim_power,
        }
    }

    /// Red, green and blue of a surface of this color, 1 is white.
    pub(crate) fn value(&self, surface: &LitSurface, color: Vec3) -> Vec3 {
        let LitSurface { normal, to_eye, .. } = *surface;
        let is_back = !surface.culls_back && normal.dot(to_eye) < -LEAST_BACK;
        // The side that is seen is the other one; lit from the front only, it has no light of the lamps.
        let side = match (is_back, surface.two_sided) {
            (false, _) => 1.0,
            (true, true) => -1.0,
            (true, false) => 0.0,
        };
        let n = match normal == Vec3::ZERO {
            true => Vec3::Z,
            false => side * towards_eye(normal, to_eye),
        };
        let is_lit = side * side;
        let mut diffuse = self.ground + (self.sky - self.ground) * (0.5 + 0.5 * n.y);
        let mut gloss = 0.0;
        for i in 0..3 {
            let direction = self.directions[i];
            let cosine = n.dot(direction);
            let wrapped = ((cosine + self.wrap) / (1.0 + self.wrap)).max(0.0);
            diffuse += self.colors[i] * (is_lit * wrapped);
            let half = direction + Vec3::Z;
            let half_cosine = (n.dot(half) / half.length()).clamp(0.0, 1.0);
            let rise = (cosine / FULL_HIGHLIGHT).clamp(0.0, 1.0);
            gloss += self.specular[i] * rise * half_cosine.powf(self.shininess);
        }
        let rim = self.rim * (is_lit * (1.0 - n.z.clamp(0.0, 1.0)).powf(self.rim_power));
        (ALBEDO * color * diffuse + Vec3::splat(gloss) + rim).min(Vec3::ONE)
    }

    /// Tells whether all of them are gray.
    pub fn are_gray(&self) -> bool {
        let [key, fill, back] = self.colors;
        let all = [key, fill, back, self.sky, self.ground, self.rim];
        all.iter()
            .all(|color| color.x == color.y && color.y == color.z)
    }

    /// The part of the light that comes from everywhere, on a surface of this color.
    pub(crate) fn everywhere_light(&self, color: Vec3) -> Vec3 {
        ALBEDO * color * 0.5 * (self.sky + self.ground)
    }
}

/// A direction turned by the shortest way that takes the direction to the eye to the z axis.
fn towards_eye(v: Vec3, to_eye: Vec3) -> Vec3 {
    let both = to_eye + Vec3::Z;
    v - both * (v.dot(both) / (1.0 + to_eye.z)) + Vec3::Z * (2.0 * v.dot(to_eye))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(normal: Vec3, to_eye: Vec3) -> LitSurface {
        LitSurface {
            normal,
            to_eye,
            culls_back: false,
            two_sided: true,
        }
    }

    #[test]
    fn the_frame_of_the_eye_is_a_rotation() {
        for to_eye in [
            Vec3::Z,
            Vec3::new(0.3, -0.2, 0.93),
            Vec3::new(-0.6, 0.5, 0.62),
        ] {
            let to_eye = to_eye / to_eye.length();
            assert!(towards_eye(to_eye, to_eye).distance(Vec3::Z) < 1e-6);
            let axes = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| towards_eye(axis, to_eye));
            assert!(axes[0].cross(axes[1]).distance(axes[2]) < 1e-6);
            assert!(axes.iter().all(|axis| (axis.length() - 1.0).abs() < 1e-6));
        }
    }

    /// Values by hand: a surface that faces the eye.
    #[test]
    fn a_facing_surface_has_the_value_of_the_formula() {
        let lights = LitSphere::Studio.lights();
        let cosines = lights.directions.map(|direction| direction.z);
        let mut gloss = 0.0;
        for (i, cosine) in cosines.iter().enumerate().take(2) {
            // The cosine to the half vector is that of half the angle.
            let half = (0.5 + 0.5 * cosine).sqrt();
            gloss += lights.specular[i] * half.powf(lights.shininess);
        }
        let diffuse = 0.15 + 0.84 * cosines[0] + 0.24 * cosines[1];
        let found = lights.value(&seen(Vec3::Z, Vec3::Z), Vec3::ONE);
        let wanted = 0.8 * diffuse + gloss;
        assert!(
            (found - Vec3::splat(wanted)).length() < 1e-5,
            "{found}, {wanted}"
        );
        // Without a normal and from behind it is the same.
        assert_eq!(found, lights.value(&seen(Vec3::ZERO, Vec3::Z), Vec3::ONE));
        assert_eq!(found, lights.value(&seen(-Vec3::Z, Vec3::Z), Vec3::ONE));
        let one_sided = LitSurface {
            two_sided: false,
            ..seen(-Vec3::Z, Vec3::Z)
        };
        let everywhere = lights.everywhere_light(Vec3::ONE);
        assert!(lights.value(&one_sided, Vec3::ONE).distance(everywhere) < 1e-6);
        assert!(everywhere.distance(Vec3::splat(0.8 * 0.15)) < 1e-6);
    }
}
