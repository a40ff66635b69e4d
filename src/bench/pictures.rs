//! Pictures as `surfel render` writes them by default, beside one exact sample a pixel: mean FLIP to 64 samples of every
//! triangle, and the time.
//!
//! Where the default takes 64 samples itself, they lie where those of the reference do: what is left is then the error of
//! its splats alone.

use super::cases::{self, SIZE, views};
use super::verdict::BenchTarget;
use super::{BenchCase, BenchFigure, BenchPlace, BenchSession, Error, Plan};
use crate::chart::errors::object_flip;
use crate::progress::Progress;
use crate::render::Settings;
use crate::render::engine::smooth_threshold;
use std::time::Instant;

const PART: &str = "pictures";
const LINE: &str = "default picture";

/// Samples a pixel along one side of the reference's grid.
const REFERENCE_SIDE: u32 = 8;

/// Largest part of the error of one exact sample that the default may have.
const ERROR_PART: f64 = 1.0 / 3.0;

/// Mean FLIP of one exact sample below which a picture cannot be told from the reference by eye: a part of it says nothing.
const UNSEEN_FLIP: f64 = 1e-4;

/// Errors and times of one distance.
#[derive(Debug, Default)]
struct FoundPictures {
    smooth_flip: Vec<f64>,
    exact_flip: Vec<f64>,
    smooth_ms: Vec<f64>,
}

impl FoundPictures {
    fn figures(&self, place: &BenchPlace) -> Vec<BenchFigure> {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let [smooth, exact] = [&self.smooth_flip, &self.exact_flip].map(|values| mean(values));
        let name = "mean FLIP over that of one exact sample";
        let errors = format!("mean FLIP {smooth:.5}, of one exact sample {exact:.5}");
        let part = if exact < UNSEEN_FLIP {
            BenchFigure::absent(PART, place, LINE, name, "x", errors)
        } else {
            BenchFigure::new(PART, place, LINE, name, smooth / exact, "x")
                .note(errors)
                .target(Some(BenchTarget::AtMost(ERROR_PART)))
        };
        let time = BenchFigure::median(PART, place, LINE, "picture", &self.smooth_ms, "ms");
        vec![part, time]
    }
}

/// Measures a model from every distance.
///
/// # Errors
/// When a picture cannot be drawn, or `progress` is cancelled.
pub fn figures(
    session: &BenchSession,
    case: &BenchCase<'_>,
    plan: &Plan,
    progress: &dyn Progress,
) -> Result<Vec<BenchFigure>, Error> {
    let mut engine = session.engine(case.model, SIZE)?;
    let plain = cases::triangles().settings;
    let is_surface = case.model.kind().is_surface();
    let mut settings = Settings::default();
    settings.threshold_px =
        smooth_threshold(&settings, is_surface).unwrap_or(settings.threshold_px);
    let all = plan.fills.len() as u64 * u64::from(plan.error_views);
    progress.stage(&format!("pictures of {}", case.name), all);
    let mut figures = Vec::new();
    for &fill in &plan.fills {
        let mut found = FoundPictures::default();
        for view in &views(case.model, SIZE, fill, plan.error_views.max(1))? {
            if progress.is_cancelled() {
                return Err(Error::Cancelled);
            }
            let reference = engine.supersample(view, &plain, REFERENCE_SIDE)?;
            let exact = engine.render(view, &plain)?;
            // Shaders are compiled at the first draw.
            engine.draw(view, &settings)?;
            let start = Instant::now();
            let smooth = engine.smooth(view, &settings)?.to_image();
            found.smooth_ms.push(start.elapsed().as_secs_f64() * 1e3);
            found.smooth_flip.push(object_flip(&reference, &smooth)?[0]);
            found.exact_flip.push(object_flip(&reference, &exact)?[0]);
            progress.advance(1);
        }
        figures.extend(found.figures(&case.place(SIZE, fill)));
    }
    Ok(figures)
}

#[cfg(test)]
mod tests {
    use super::super::verdict::BenchVerdict;
    use super::*;

    #[test]
    fn a_third_of_the_error_is_kept_and_half_is_missed() {
        let verdict = |smooth: f64, exact: f64| {
            let found = FoundPictures {
                smooth_flip: vec![smooth],
                exact_flip: vec![exact],
                smooth_ms: vec![1.0],
            };
            found.figures(&BenchPlace::default())[0].verdict()
        };
        assert_eq!(verdict(0.001, 0.0031), BenchVerdict::Pass);
        assert_eq!(verdict(0.001, 0.002), BenchVerdict::Miss);
        // Equal but for what nobody sees.
        assert_eq!(verdict(0.00005, 0.00005), BenchVerdict::Absent);
    }
}
