//! The options that say where light comes from.

use super::{CommandFailure, usage};
use clap::{Args as ClapArgs, ValueEnum};
use glam::DVec3;
use surfel::pack::lit_sphere::LitSphere;
use surfel::pack::{Lamp, Phong, SurfaceLighting};

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum LightName {
    /// In the eye: 0.8 |n . l|, no highlight
    Headlight,
    /// One lamp: ambient, diffuse and specular
    Phong,
    /// Three lamps that go with the camera: key, fill and rim light
    Studio,
    /// A material in lights that go with the camera: dull reddish brown
    Clay,
    /// A material: white with small highlights
    Porcelain,
    /// A material: dark below a bright sky, with large highlights
    Metal,
}

impl LightName {
    fn sphere(self) -> Option<LitSphere> {
        match self {
            Self::Headlight | Self::Phong => None,
            Self::Studio => Some(LitSphere::Studio),
            Self::Clay => Some(LitSphere::Clay),
            Self::Porcelain => Some(LitSphere::Porcelain),
            Self::Metal => Some(LitSphere::Metal),
        }
    }
}

/// Where light comes from.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct LightArgs {
    /// Where light comes from [default: studio in surfel render and the window, else headlight]
    #[arg(long, value_enum)]
    light: Option<LightName>,
    /// Direction of the lamp as the camera sees it, in degrees: 0,0 comes from the viewer, 90,0 from the right, 0,90 from above [default: -30,30]
    #[arg(long, value_name = "AZIMUTH,ELEVATION", value_parser = parse_direction, allow_hyphen_values = true)]
    light_at: Option<[f64; 2]>,
    /// Position of the lamp in the world, instead of a direction; it stays there when the camera moves
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_position, allow_hyphen_values = true, conflicts_with = "light_at")]
    light_position: Option<[f64; 3]>,
    /// Part of the lamp's light that comes from everywhere, 0 to 1 [default: 0.1]
    #[arg(long, value_name = "PART", allow_hyphen_values = true)]
    ambient: Option<f32>,
    /// Strength of the highlight, 0 to 1 [default: 0.2]
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true)]
    specular: Option<f32>,
    /// Exponent of the highlight, 1 to 1000: larger is smaller [default: 32]
    #[arg(long, value_name = "EXPONENT", allow_hyphen_values = true)]
    shininess: Option<f32>,
}

impl LightArgs {
    /// Takes the light that shows shape best for what a person looks at, where nothing is said of it.
    pub(crate) fn default_for_people(&mut self) {
        self.light.get_or_insert(LightName::Studio);
    }

    pub(crate) fn lighting(&self) -> Result<SurfaceLighting, CommandFailure> {
        let light = self.light.unwrap_or(LightName::Headlight);
        if light != LightName::Phong {
            let sphere = light.sphere();
            let given = [
                ("--light-at", self.light_at.is_some()),
                ("--light-position", self.light_position.is_some()),
                ("--ambient", self.ambient.is_some()),
                ("--specular", self.specular.is_some()),
                ("--shininess", self.shininess.is_some()),
            ];
            return match given.iter().find(|(_, is_given)| *is_given) {
                Some((option, _)) => Err(usage(format!(
                    "{option} is of the lamp, and {} is on; {} --light phong",
                    sphere.map_or("the headlight", LitSphere::name),
                    if sphere.is_some() { "use" } else { "add" },
                ))),
                None => Ok(sphere.map_or(SurfaceLighting::Headlight, SurfaceLighting::Sphere)),
            };
        }
        let usual = Phong::default();
        let within = |option: &str, given: Option<f32>, usual: f32, low: f32, high: f32| {
            let value = given.unwrap_or(usual);
            if (low..=high).contains(&value) {
                Ok(value)
            } else {
                Err(usage(format!(
                    "{option} {value} is no number from {low} to {high}"
                )))
            }
        };
        Ok(SurfaceLighting::Phong(Phong {
            lamp: match (self.light_at, self.light_position) {
                (_, Some(position)) => Lamp::At(DVec3::from(position)),
                (Some([azimuth, elevation]), None) => Lamp::FromCamera {
                    azimuth: azimuth.to_radians(),
                    elevation: elevation.to_radians(),
                },
                (None, None) => usual.lamp,
            },
            ambient: within("--ambient", self.ambient, usual.ambient, 0.0, 1.0)?,
            specular: within("--specular", self.specular, usual.specular, 0.0, 1.0)?,
            shininess: within("--shininess", self.shininess, usual.shininess, 1.0, 1000.0)?,
        }))
    }
}

/// The light as `--stats` writes it: angles in degrees, positions in world units.
pub(crate) fn facts(light: &SurfaceLighting) -> serde_json::Value {
    let phong = match light {
        SurfaceLighting::Headlight => return serde_json::json!({ "kind": "headlight" }),
        SurfaceLighting::Sphere(sphere) => return serde_json::json!({ "kind": sphere.name() }),
        SurfaceLighting::Phong(phong) => phong,
    };
    let mut facts = serde_json::json!({
        "kind": "phong",
        "ambient": phong.ambient,
        "specular": phong.specular,
        "shininess": phong.shininess,
    });
    match phong.lamp {
        Lamp::FromCamera { azimuth, elevation } => {
            facts["from_camera_deg"] = [azimuth.to_degrees(), elevation.to_degrees()].into();
        }
        Lamp::At(position) => facts["position"] = position.to_array().into(),
    }
    facts
}

fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|p| p.trim().parse().ok()).collect();
    numbers?.try_into().ok()
}

fn parse_direction(text: &str) -> Result<[f64; 2], String> {
    let [azimuth, elevation] = numbers(text).ok_or("expected AZIMUTH,ELEVATION in degrees")?;
    if (-360.0..=360.0).contains(&azimuth) && (-90.0..=90.0).contains(&elevation) {
        Ok([azimuth, elevation])
    } else {
        Err("the azimuth must be -360 to 360 and the elevation -90 to 90 degrees".into())
    }
}

fn parse_position(text: &str) -> Result<[f64; 3], String> {
    // Single precision holds squares of distances up to here.
    const LIMIT: f64 = 1e12;
    let position: [f64; 3] = numbers(text).ok_or("expected X,Y,Z in the units of the model")?;
    if position.iter().all(|x| x.abs() <= LIMIT) {
        Ok(position)
    } else {
        Err("each coordinate must be -1e12 to 1e12".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_and_positions_are_read_as_documented() {
        assert_eq!(parse_direction("-30, 45.5"), Ok([-30.0, 45.5]));
        assert_eq!(parse_position("1e3,-2,0"), Ok([1000.0, -2.0, 0.0]));
        for wrong in ["", "1", "1,2,3", "1,91", "361,0", "nan,0", "0,inf", "a,b"] {
            assert!(parse_direction(wrong).is_err(), "{wrong}");
        }
        for wrong in ["", "1,2", "1,2,3,4", "1,2,nan", "1e13,0,0", "x,y,z"] {
            assert!(parse_position(wrong).is_err(), "{wrong}");
        }
    }
}
