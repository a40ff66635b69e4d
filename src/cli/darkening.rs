//! The options that say which pixels are darkened by the depths around them.

use super::{CommandFailure, usage};
use clap::{Args as ClapArgs, ValueEnum};
use surfel::render::{AmbientOcclusion, EyeDome};

#[derive(Debug, Clone, Copy, ValueEnum)]
enum EyeDomeName {
    /// On points without normals
    Auto,
    /// On everything
    On,
    /// Nothing is darkened
    Off,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum AmbientOcclusionName {
    /// Models with normals, but not Gaussians above a pixel beside triangles
    Auto,
    /// On everything
    On,
    /// Nothing is darkened
    Off,
}

/// Which pixels are darkened.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct DarkeningArgs {
    /// Whether pixels are darkened that lie behind their neighbors (eye-dome lighting), so that depth shows without normals; of
    /// shaded colors [default: auto in surfel render and the window, else off]
    #[arg(long, value_enum)]
    eye_dome: Option<EyeDomeName>,
    /// How strong eye-dome lighting is
    #[arg(long, value_name = "FACTOR", default_value = "1")]
    pub(crate) eye_dome_strength: f32,
    /// Whether pixels are darkened whose sky is hidden by what is around them (ambient occlusion in screen space), so that shape
    /// shows in even light; of shaded colors [default: auto in surfel render and the window, else off]
    #[arg(long, value_enum, value_name = "SWITCH")]
    ambient_occlusion: Option<AmbientOcclusionName>,
    /// How strong ambient occlusion is, 0 to 10
    #[arg(long, value_name = "FACTOR", default_value = "1")]
    pub(crate) ambient_occlusion_strength: f32,
    /// How far around a pixel ambient occlusion looks, 1 to 256 pixels [default: 4 % of the picture's shorter side]
    #[arg(long, value_name = "PIXELS")]
    pub(crate) ambient_occlusion_radius_px: Option<f32>,
}

impl DarkeningArgs {
    /// Takes eye-dome lighting of points without normals, and ambient occlusion of the rest, for what a person looks at, where
    /// nothing is said of it.
    pub(crate) fn default_for_people(&mut self) {
        self.default_eye_dome();
        (self.ambient_occlusion).get_or_insert(AmbientOcclusionName::Auto);
    }

    /// Takes eye-dome lighting alone.
    pub(crate) fn default_eye_dome(&mut self) {
        self.eye_dome.get_or_insert(EyeDomeName::Auto);
    }

    /// Refuses numbers that are out of range.
    pub(crate) fn check(&self) -> Result<(), CommandFailure> {
        for (option, factor) in [
            ("--eye-dome-strength", self.eye_dome_strength),
            (
                "--ambient-occlusion-strength",
                self.ambient_occlusion_strength,
            ),
        ] {
            if !(0.0..=10.0).contains(&factor) {
                return Err(usage(format!(
                    "{option} {factor} is no factor from 0 to 10"
                )));
            }
        }
        match self.ambient_occlusion_radius_px {
            Some(pixels) if !(1.0..=256.0).contains(&pixels) => Err(usage(format!(
                "--ambient-occlusion-radius-px {pixels} is no radius in pixels from 1 to 256"
            ))),
            _ => Ok(()),
        }
    }

    pub(crate) fn eye_dome(&self) -> EyeDome {
        match self.eye_dome {
            Some(EyeDomeName::Auto) => EyeDome::Auto,
            Some(EyeDomeName::On) => EyeDome::On,
            Some(EyeDomeName::Off) | None => EyeDome::Off,
        }
    }

    pub(crate) fn ambient_occlusion(&self) -> AmbientOcclusion {
        match self.ambient_occlusion {
            Some(AmbientOcclusionName::Auto) => AmbientOcclusion::Auto,
            Some(AmbientOcclusionName::On) => AmbientOcclusion::On,
            Some(AmbientOcclusionName::Off) | None => AmbientOcclusion::Off,
        }
    }
}
