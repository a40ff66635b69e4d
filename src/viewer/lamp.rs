//! The light as the window has it: in the eye, parallel, or a lamp that keys and mouse move. Pure logic.
//!
//! Angles are handled in degrees, rounded so far that a step there and one back end where they began, and that a lamp
//! is the same to the bit as one of these angles on the command line.

use crate::math::camera::{Camera, HeadlightSource};
use crate::pack::lit_sphere::LitSphere;
use crate::pack::{Lamp, Phong, SurfaceLighting};
use crate::render::Settings;
use glam::{DMat4, DVec3};

/// What lights the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightKind {
    /// A point light in the eye.
    Eye,
    /// Parallel light along the view direction.
    Parallel,
    /// The lamp.
    Lamp,
    /// Lamps that go with the camera, and a material.
    Sphere(LitSphere),
}

/// The kinds of light.
pub const KINDS: &[super::choices::NamedChoice<LightKind>] = &[
    (
        LightKind::Eye,
        "in the eye",
        "A point light where the viewer is",
    ),
    (
        LightKind::Parallel,
        "parallel",
        "Parallel light along the view direction",
    ),
    (
        LightKind::Lamp,
        "lamp",
        "A lamp that can be moved, with highlights (Phong)",
    ),
    (
        LightKind::Sphere(LitSphere::Studio),
        "studio",
        "Three lamps that go with the viewer: key, fill and rim light",
    ),
    (
        LightKind::Sphere(LitSphere::Clay),
        "clay",
        "Dull reddish brown, in soft light",
    ),
    (
        LightKind::Sphere(LitSphere::Porcelain),
        "porcelain",
        "White with small highlights",
    ),
    (
        LightKind::Sphere(LitSphere::Metal),
        "metal",
        "Dark below a bright sky, with large highlights",
    ),
];

impl LightKind {
    /// What lights a model: the headlight of a camera, or the lamp that takes its place.
    pub fn of(headlight: HeadlightSource, lighting: &SurfaceLighting) -> Self {
        match (lighting, headlight) {
            (SurfaceLighting::Phong(_), _) => Self::Lamp,
            (SurfaceLighting::Sphere(sphere), _) => Self::Sphere(*sphere),
            (SurfaceLighting::Headlight, HeadlightSource::Point) => Self::Eye,
            (SurfaceLighting::Headlight, HeadlightSource::Directional) => Self::Parallel,
        }
    }
}

/// What keys and mouse do to the lamp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LampChange {
    /// Turn it about the viewer, or about the model's center where it stays in the world: to the right and up as the
    /// camera sees it, degrees.
    Turn(f64, f64),
    /// Multiply its distance from the model's center; one that goes with the viewer has none.
    Distance(f64),
    /// Let it go with the viewer, or stay where it is in the world.
    Anchor,
    /// Add to the strength of the highlight.
    Specular(f32),
    /// Multiply the exponent of the highlight.
    Shininess(f32),
    /// Add to the part of its light that comes from everywhere.
    Ambient(f32),
}

/// Distance of a lamp that is put into the world, in radii of the model from its center.
const DISTANCE: f64 = 3.0;
/// Coordinates of a lamp are kept below this, so that single precision holds squares of distances.
pub const FARTHEST: f64 = 1e12;
/// Exponents of the highlight that can be chosen.
pub const SHININESS: std::ops::RangeInclusive<f32> = 1.0..=1000.0;

/// Degrees, rounded to where sums of whole degrees are whole.
pub fn degrees(radians: f64) -> f64 {
    (radians.to_degrees() * 1e9).round() / 1e9
}

/// Hundredths stay hundredths.
fn hundredths(value: f32) -> f32 {
    (value * 100.0).round() / 100.0
}

/// A lamp that goes with the viewer, from angles in degrees: the azimuth is brought between -180 and 180, the elevation
/// between -90 and 90.
pub fn from_camera(azimuth: f64, elevation: f64) -> Lamp {
    // Not a whole turn where it need not be: rounding would show.
    let azimuth = if (-180.0..=180.0).contains(&azimuth) {
        azimuth
    } else {
        (azimuth + 180.0).rem_euclid(360.0) - 180.0
    };
    Lamp::FromCamera {
        azimuth: azimuth.to_radians(),
        elevation: elevation.clamp(-90.0, 90.0).to_radians(),
    }
}

/// What a lamp is moved about, in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AroundAngles {
    /// The model's center.
    pub center: DVec3,
    /// The model's radius.
    pub radius: f64,
    /// World from view space.
    pub world_from_view: DMat4,
}

impl AroundAngles {
    /// A model of this center and radius (0 counts as 1), as `camera` sees it.
    pub fn new(center: DVec3, radius: f64, camera: &Camera) -> Self {
        Self {
            center,
            radius: if radius > 0.0 { radius } else { 1.0 },
            world_from_view: camera.view.inverse(),
        }
    }

    fn in_view(&self, vector: DVec3) -> DVec3 {
        self.world_from_view.inverse().transform_vector3(vector)
    }

    fn in_world(&self, vector: DVec3) -> DVec3 {
        self.world_from_view.transform_vector3(vector)
    }

    /// The point at an offset from the center, no farther than can be drawn with.
    fn at(&self, offset: DVec3) -> Lamp {
        let limit = DVec3::splat(FARTHEST);
        Lamp::At((self.center + offset).clamp(-limit, limit))
    }

    /// The lamp after a turn to the right and up, degrees.
    fn turned(&self, lamp: Lamp, right: f64, up: f64) -> Lamp {
        match lamp {
            Lamp::FromCamera { azimuth, elevation } => {
                from_camera(degrees(azimuth) + right, degrees(elevation) + up)
            }
            Lamp::At(position) => {
                let about = glam::DQuat::from_rotation_y(right.to_radians())
                    * glam::DQuat::from_rotation_x(-up.to_radians());
                self.at(self.in_world(about * self.in_view(position - self.center)))
            }
        }
    }

    /// The lamp at `factor` times its distance; none for one without a distance.
    fn moved_away(&self, lamp: Lamp, factor: f64) -> Option<Lamp> {
        let Lamp::At(position) = lamp else {
            return None;
        };
        let offset = position - self.center;
        // One in the center goes towards the viewer.
        let offset = match offset.length() {
            length if length > 1e-6 * self.radius => offset * factor,
            _ => self.in_world(DVec3::Z).normalize_or(DVec3::Z) * self.radius,
        };
        Some(self.at(offset))
    }

    /// The lamp that shines from about where this one does, but goes with the viewer instead of staying, or stays
    /// instead of going along.
    fn anchored_otherwise(&self, lamp: Lamp) -> Lamp {
        match lamp {
            Lamp::FromCamera { azimuth, elevation } => {
                let (sin_a, cos_a) = azimuth.sin_cos();
                let (sin_e, cos_e) = elevation.sin_cos();
                let direction = DVec3::new(cos_e * sin_a, sin_e, cos_e * cos_a);
                let direction = self.in_world(direction).normalize_or(DVec3::Z);
                self.at(direction * DISTANCE * self.radius)
            }
            Lamp::At(position) => {
                let seen = self.in_view(position - self.center).normalize_or(DVec3::Z);
                let azimuth = degrees(seen.x.atan2(seen.z));
                from_camera(azimuth, degrees(seen.y.clamp(-1.0, 1.0).asin()))
            }
        }
    }

    /// The lamp after a change; none where that changes nothing.
    pub fn changed(&self, old: Phong, change: LampChange) -> Option<Phong> {
        let mut new = old;
        match change {
            LampChange::Turn(right, up) => new.lamp = self.turned(old.lamp, right, up),
            LampChange::Distance(factor) => new.lamp = self.moved_away(old.lamp, factor)?,
            LampChange::Anchor => new.lamp = self.anchored_otherwise(old.lamp),
            LampChange::Specular(by) => {
                new.specular = hundredths(old.specular + by).clamp(0.0, 1.0)
            }
            LampChange::Ambient(by) => new.ambient = hundredths(old.ambient + by).clamp(0.0, 1.0),
            LampChange::Shininess(factor) => {
                new.shininess =
                    hundredths(old.shininess * factor).clamp(*SHININESS.start(), *SHININESS.end());
            }
        }
        (new != old).then_some(new)
    }
}

/// Settings under which a frame takes as long: where the lamp is and how it shines does not matter.
pub fn same_cost(settings: &Settings) -> Settings {
    Settings {
        light: match settings.light {
            SurfaceLighting::Headlight => SurfaceLighting::Headlight,
            SurfaceLighting::Phong(_) => SurfaceLighting::Phong(Phong::default()),
            SurfaceLighting::Sphere(_) => SurfaceLighting::Sphere(LitSphere::Studio),
        },
        ..*settings
    }
}

/// The light in words.
pub fn words(headlight: HeadlightSource, lighting: &SurfaceLighting) -> String {
    let kind = LightKind::of(headlight, lighting);
    let SurfaceLighting::Phong(phong) = lighting else {
        return super::choices::name_of(KINDS, kind).to_owned();
    };
    let place = match phong.lamp {
        Lamp::FromCamera { azimuth, elevation } => {
            format!("at {},{} degrees", degrees(azimuth), degrees(elevation))
        }
        Lamp::At(at) => format!("in the world at {},{},{}", at.x, at.y, at.z),
    };
    format!(
        "lamp {place}, ambient {}, specular {}, shininess {}",
        phong.ambient, phong.specular, phong.shininess
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use crate::pack::LampSource;

    fn around() -> (AroundAngles, Camera) {
        let center = DVec3::new(4.0, -2.0, 1.0);
        let camera = Camera::orbit((64, 48), center, 2.0, 0.7, 0.3, 1.0);
        (AroundAngles::new(center, 2.0, &camera), camera)
    }

    fn lamp_of(azimuth: f64, elevation: f64) -> Phong {
        Phong {
            lamp: from_camera(azimuth, elevation),
            ..Phong::default()
        }
    }

    #[test]
    fn steps_end_on_the_angles_of_the_command_line() {
        let (around, _) = around();
        let mut phong = Phong::default();
        for _ in 0..7 {
            phong = around.changed(phong, LampChange::Turn(5.0, 0.0)).unwrap();
        }
        phong = around.changed(phong, LampChange::Turn(0.0, -5.0)).unwrap();
        assert_eq!(phong, lamp_of(5.0, 25.0));
        // Around the back, and no farther than straight up.
        let back = around.changed(lamp_of(178.0, 88.0), LampChange::Turn(5.0, 5.0));
        assert_eq!(back.unwrap(), lamp_of(-177.0, 90.0));
        assert_eq!(
            around.changed(lamp_of(0.0, 90.0), LampChange::Turn(0.0, 5.0)),
            None
        );
        assert_eq!(degrees((-30f64).to_radians()), -30.0);
    }

    #[test]
    fn a_lamp_put_into_the_world_shines_from_where_it_did_and_turns_the_same_way() {
        let (around, camera) = around();
        let view = camera.view(around.center).unwrap();
        // From the model's center, as the camera sees it.
        let seen = |phong: Phong| {
            let SurfaceLighting::Phong(phong) =
                SurfaceLighting::Phong(phong).in_model(around.center)
            else {
                unreachable!("still a lamp")
            };
            match phong.lamp.in_view(&view) {
                LampSource::Direction(direction) => direction,
                LampSource::Point(point) => {
                    let center = view.view_from_model.as_dmat4().w_axis.truncate();
                    (point - center).normalize()
                }
            }
        };
        for (azimuth, elevation) in [(0.0, 0.0), (-30.0, 30.0), (70.0, -20.0), (170.0, 5.0)] {
            let with_viewer = lamp_of(azimuth, elevation);
            let in_world = around.changed(with_viewer, LampChange::Anchor).unwrap();
            let Lamp::At(position) = in_world.lamp else {
                panic!("{in_world:?} goes with the viewer")
            };
            assert!((position.distance(around.center) - 6.0).abs() < 1e-9);
            assert!(seen(in_world).distance(seen(with_viewer)) < 1e-5);
            let again = around.changed(in_world, LampChange::Anchor).unwrap();
            assert!(seen(again).distance(seen(with_viewer)) < 1e-6);
        }
        // Right is right and up is up for both, seen from the front.
        for lamp in [
            lamp_of(0.0, 0.0),
            around
                .changed(lamp_of(0.0, 0.0), LampChange::Anchor)
                .unwrap(),
        ] {
            let right = seen(around.changed(lamp, LampChange::Turn(10.0, 0.0)).unwrap());
            let up = seen(around.changed(lamp, LampChange::Turn(0.0, 10.0)).unwrap());
            let (sin, cos) = 10f64.to_radians().sin_cos();
            assert!(right.distance(DVec3::new(sin, 0.0, cos)) < 1e-5, "{right}");
            assert!(up.distance(DVec3::new(0.0, sin, cos)) < 1e-5, "{up}");
        }
    }

    #[test]
    fn only_a_lamp_in_the_world_has_a_distance_and_nothing_leaves_its_bounds() {
        let (around, _) = around();
        let far = LampChange::Distance(2.0);
        assert_eq!(around.changed(Phong::default(), far), None);
        let mut phong = around
            .changed(Phong::default(), LampChange::Anchor)
            .unwrap();
        for _ in 0..100 {
            phong = around.changed(phong, far).unwrap_or(phong);
        }
        let Lamp::At(position) = phong.lamp else {
            panic!("in the world")
        };
        assert!(position.is_finite() && position.abs().max_element() <= FARTHEST);
        let in_center = Phong {
            lamp: Lamp::At(around.center),
            ..phong
        };
        let out = around.changed(in_center, far).unwrap();
        assert!(matches!(out.lamp, Lamp::At(p) if (p.distance(around.center) - 2.0).abs() < 1e-9));
        for (change, value) in [
            (LampChange::Specular(0.3), 1.0),
            (LampChange::Ambient(-0.3), 0.0),
            (LampChange::Shininess(3.0), 1000.0),
        ] {
            let mut phong = Phong::default();
            for _ in 0..20 {
                phong = around.changed(phong, change).unwrap_or(phong);
            }
            let got = match change {
                LampChange::Specular(_) => phong.specular,
                LampChange::Ambient(_) => phong.ambient,
                _ => phong.shininess,
            };
            assert_eq!(got, value, "{change:?}");
        }
    }

    #[test]
    fn the_kind_of_light_and_its_words() {
        let lamp = SurfaceLighting::Phong(lamp_of(-20.0, 35.0));
        assert_eq!(
            LightKind::of(HeadlightSource::Directional, &lamp),
            LightKind::Lamp
        );
        assert_eq!(
            LightKind::of(HeadlightSource::Directional, &SurfaceLighting::Headlight),
            LightKind::Parallel
        );
        assert_eq!(
            words(HeadlightSource::Point, &SurfaceLighting::Headlight),
            "in the eye"
        );
        assert_eq!(
            words(HeadlightSource::Point, &lamp),
            "lamp at -20,35 degrees, ambient 0.1, specular 0.2, shininess 32"
        );
        let other = Settings {
            light: lamp,
            ..Settings::default()
        };
        assert!(same_cost(&other) != same_cost(&Settings::default()));
        assert_eq!(
            same_cost(&other).light,
            SurfaceLighting::Phong(Phong::default()),
            "wherever it is"
        );
    }
}
