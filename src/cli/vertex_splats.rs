//! The options of splats that are made from vertices.

use super::progress::JobBar;
use super::{CommandFailure, Outcome, say, usage};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args as ClapArgs, ValueEnum};
use surfel::oriented::choices::{self, LevelChoice, WordedChoice};
use surfel::oriented::radius::RadiusRule;
use surfel::oriented::resample::{MOST_SAMPLES, SampleChoice, SampleError, SamplePattern};
use surfel::oriented::splats::SplatRules;
use surfel::render::engine::Engine;
use surfel::render::{Method, Settings};

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SplatOriginName {
    /// Nodes and leaves of the tree, by their size on screen
    Tree,
    /// Vertices of the mesh, each with a disc in the plane of its faces, cut at sharp edges: for models of few triangles
    Vertices,
}

/// The value of a word in a list of choices.
fn word_of<T: Clone + Send + Sync>(
    all: &'static [WordedChoice<T>],
) -> impl TypedValueParser<Value = T> {
    let capital = |tip: &str| {
        let mut letters = tip.chars();
        letters.next().map_or_else(String::new, |first| {
            first.to_uppercase().collect::<String>() + letters.as_str()
        })
    };
    let words = (all.iter()).map(|one| PossibleValue::new(one.option).help(capital(one.tip)));
    PossibleValuesParser::new(words).try_map(move |word| {
        let found = all.iter().find(|one| one.option == word);
        found.map(|one| one.value.clone()).ok_or("no such choice")
    })
}

/// An angle in degrees, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
struct AngleChoice(Option<f64>);

impl std::str::FromStr for AngleChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            _ if text == "off" => Ok(Self(None)),
            Ok(degrees) if (0.0..=180.0).contains(&degrees) => Ok(Self(Some(degrees))),
            _ => Err("expected off, or an angle of 0 to 180 degrees".into()),
        }
    }
}

impl AngleChoice {
    fn radians(self) -> Option<f64> {
        self.0.map(f64::to_radians)
    }
}

/// How splats are made from vertices.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct VertexSplatArgs {
    /// Of --method splats: what splats are made from
    #[arg(long, value_enum, default_value = "tree")]
    from: SplatOriginName,
    /// Radius of splats from vertices
    #[arg(long, default_value = "cover", value_parser = word_of(&choices::RADII))]
    radius: RadiusRule,
    /// Faces within this angle of their mean share a splat, which is cut where others begin; off for whole discs; degrees
    #[arg(long, value_name = "DEGREES", default_value = "5")]
    clip: AngleChoice,
    /// Vertices with a face this far from their normal are drawn as their triangles; degrees, or off
    #[arg(long, value_name = "DEGREES", default_value = "off")]
    angle_test: AngleChoice,
    /// Splats from vertices lie evenly on the surface instead, for models with a few large faces
    #[arg(long, value_name = "PATTERN", value_parser = word_of(&choices::PATTERNS))]
    resample: Option<SamplePattern>,
    /// Distance of even splats, in units of the model [default: the median of the longest sides of triangles, or what makes at
    /// most 200,000 splats]
    #[arg(long, value_name = "LENGTH")]
    spacing: Option<f64>,
    /// Levels of detail of splats from vertices, by --threshold
    #[arg(long, value_name = "LEAVES", default_value = "off", value_parser = word_of(&choices::LEVELS))]
    levels: LevelChoice,
}

impl VertexSplatArgs {
    /// The rules of splats from vertices; `None` where splats come from the tree.
    pub(crate) fn rules(&self, method: Method) -> Result<Option<SplatRules>, CommandFailure> {
        if self.spacing.is_some() && self.resample.is_none() {
            return Err(usage(
                "--spacing is that of even splats; use it with --resample",
            ));
        }
        if let Some(spacing) = self.spacing
            && !(spacing.is_finite() && spacing > 0.0)
        {
            return Err(usage(format!(
                "--spacing {spacing} is no length; it must be above 0"
            )));
        }
        if self.from == SplatOriginName::Tree {
            if self.resample.is_some() {
                return Err(usage(
                    "--resample places splats on the mesh; use it with --from vertices",
                ));
            }
            if self.levels.is_some() {
                return Err(usage(
                    "splats of the tree have levels; --levels is for --from vertices",
                ));
            }
            return Ok(None);
        }
        if method != Method::Splats {
            return Err(usage(
                "--from vertices makes splats; use it with --method splats",
            ));
        }
        if self.resample.is_some() && self.angle_test != AngleChoice(None) {
            return Err(usage(
                "--angle-test is asked of vertices, and --resample takes none; leave one of them out",
            ));
        }
        if self.resample.is_some() && self.levels.is_some() {
            return Err(usage(
                "even splats have no levels of detail; leave --levels or --resample out",
            ));
        }
        let samples = self.resample.map(|pattern| SampleChoice {
            pattern,
            spacing: self.spacing,
        });
        Ok(Some(SplatRules {
            samples,
            levels: self.levels,
            radius: self.radius,
            clip: self.clip.radians(),
            angle_test: self.angle_test.radians(),
            ..SplatRules::default()
        }))
    }
}

/// Makes the even splats of these settings with a bar, and says where they are wider apart than usual.
pub(crate) fn make_even_splats(engine: &Engine<'_>, settings: &Settings, quiet: bool) -> Outcome {
    let bar = JobBar::new(quiet);
    let widest = engine.build_even_splats(settings, &bar);
    drop(bar);
    match widest {
        Ok(Some(spacing)) if !quiet => say(&format!(
            "surfel: even splats are {spacing:.2e} apart: as dense as vertices there would be more than {MOST_SAMPLES}"
        )),
        Ok(_) => {}
        Err(SampleError::Cancelled) => return Err(surfel::tree::Error::Cancelled.into()),
        Err(error) => return Err(usage(format!("--resample: {error}"))),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_degrees_or_off() {
        assert_eq!("off".parse(), Ok(AngleChoice(None)));
        assert_eq!("20".parse(), Ok(AngleChoice(Some(20.0))));
        for wrong in ["", "-1", "181", "nan", "inf", "on"] {
            assert!(wrong.parse::<AngleChoice>().is_err(), "{wrong}");
        }
    }
}
