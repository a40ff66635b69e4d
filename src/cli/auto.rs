//! `--method auto`: how a model is drawn follows from a bound.

use super::costs::costs_of;
use super::progress::JobBar;
use super::{CommandFailure, Outcome, say, usage};
use surfel::OpenedModel;
use surfel::chart::auto::{
    CalibrationKey, ChartCalibration, ChoiceBounds, ChosenConfiguration, fill_of,
};
use surfel::chart::{ChartPlan, DrawConfiguration};
use surfel::math::camera::View;
use surfel::render::engine::Backend;
use surfel::render::{Path, Settings};

/// Settings drawn in the way of a choice. It was made of shaded pictures; where data decide the color, compute cannot
/// draw all that it was chosen for, and draws what it can.
fn with(choice: &Settings, settings: Settings) -> Settings {
    Settings {
        method: choice.method,
        splat: choice.splat,
        path: match choice.path {
            Path::Compute if settings.color_by.is_data() => Path::Auto,
            path => path,
        },
        threshold_px: choice.threshold_px,
        patches: choice.patches,
        ..settings
    }
}

/// What `--method auto` has to keep.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(crate) struct AutoArgs {
    /// With --method auto: the cheapest choice whose mean FLIP against the supersampled picture is at most this
    #[arg(long, value_name = "FLIP")]
    max_error: Option<f64>,
    /// With --method auto: a choice whose frame takes at most this long; without --max-error the most accurate of them
    #[arg(long, value_name = "MILLISECONDS")]
    frame_ms: Option<f64>,
}

impl AutoArgs {
    pub(crate) fn check(&self, is_auto: bool) -> Outcome {
        let is_bounded = self.max_error.is_some() || self.frame_ms.is_some();
        if is_bounded != is_auto {
            return Err(usage(if is_auto {
                "--method auto chooses by a bound: give --max-error, --frame-ms or both"
            } else {
                "--max-error and --frame-ms choose how to draw: add --method auto"
            }));
        }
        if let Some(e) = self.max_error
            && !(e > 0.0 && e <= 1.0)
        {
            return Err(usage(format!(
                "--max-error {e}: a mean FLIP is above 0 and at most 1"
            )));
        }
        if let Some(ms) = self.frame_ms
            && !(ms > 0.0 && ms.is_finite())
        {
            return Err(usage(format!("--frame-ms {ms} is no time above 0")));
        }
        Ok(())
    }

    /// Completes settings by the choice, after a calibration where none is kept, and says what was chosen and why.
    pub(crate) fn choose(
        &self,
        settings: Settings,
        backend: &Backend,
        ready: &OpenedModel,
        view: &View,
        quiet: bool,
    ) -> Result<Settings, CommandFailure> {
        let model = &ready.model;
        let size = (view.width, view.height);
        let key = CalibrationKey::of(backend, model, size);
        let folder = surfel::measure::store::folder();
        let kept = folder
            .as_ref()
            .and_then(|f| ChartCalibration::read(f, &key));
        let calibration = match kept {
            Some(kept) => kept,
            None => {
                say(&format!(
                    "surfel: auto: measuring once what {} makes of models like this one",
                    backend.name()
                ));
                let tried = ChartPlan::quick().choices(model, backend);
                let tried: Vec<_> = tried.iter().map(DrawConfiguration::settings).collect();
                let how = (size, costs_of(backend, &tried));
                let bar = JobBar::new(quiet);
                let made = ChartCalibration::measure(backend, model, &ready.name, how, &bar)?;
                drop(bar);
                if let Some(folder) = &folder
                    && let Err(error) = made.write(folder)
                {
                    say(&format!(
                        "surfel: warning: it will be measured again: {error}"
                    ));
                }
                made
            }
        };
        let bounds = ChoiceBounds {
            max_error: self.max_error,
            frame_ms: self.frame_ms,
        };
        let Some(chosen) = calibration.choose(&bounds, fill_of(model, view)) else {
            return Err(CommandFailure::Run(anyhow::anyhow!(
                "--method auto: {} draws this model by no method",
                backend.name()
            )));
        };
        say(&self.reason(&chosen, calibration.model()));
        Ok(with(&chosen.choice.settings(), settings))
    }

    /// Which and why, in a line.
    fn reason(&self, chosen: &ChosenConfiguration, model: &str) -> String {
        let fills: Vec<String> = chosen.fills.iter().map(f64::to_string).collect();
        let mut text = format!("surfel: auto: {}: ", chosen.choice.name());
        if !chosen.is_met {
            text += "nothing keeps the bounds, this comes nearest; ";
        } else if self.max_error.is_some() {
            text += "the fastest that keeps the bounds; ";
        } else {
            text += "the most accurate that is fast enough; ";
        }
        text += &format!(
            "{model} at fill {}: mean FLIP at most {:.5}",
            fills.join(" and "),
            chosen.flip
        );
        if let Some(bound) = self.max_error {
            text += &format!(" (bound {bound})");
        }
        text += &format!(", {:.2} ms a frame", chosen.frame_ms);
        if let Some(bound) = self.frame_ms {
            text += &format!(" (bound {bound})");
        }
        if let Some([misses, all]) = chosen.misses {
            text += &format!("; above the bound in {misses} of {all} views that did not choose");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use surfel::pack::{ColorBy, Phong, SurfaceLighting};

    #[test]
    fn compute_is_insisted_on_where_it_can_draw() {
        let choice = |path| Settings {
            path,
            threshold_px: 2.0,
            ..Settings::default()
        };
        let lamp = Settings {
            light: SurfaceLighting::Phong(Phong::default()),
            ..Settings::default()
        };
        let depth = Settings {
            color_by: ColorBy::Depth,
            ..Settings::default()
        };
        for (settings, path, expected) in [
            (Settings::default(), Path::Compute, Path::Compute),
            (Settings::default(), Path::Raster, Path::Raster),
            (lamp, Path::Compute, Path::Compute),
            (depth, Path::Compute, Path::Auto),
            (depth, Path::Raster, Path::Raster),
        ] {
            let drawn = with(&choice(path), settings);
            assert_eq!((drawn.path, drawn.threshold_px), (expected, 2.0));
            assert_eq!(drawn.color_by, settings.color_by);
        }
    }
}
