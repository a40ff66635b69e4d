//! Smooth pictures: the mean of as many samples as they need.

use super::Engine;
use crate::gpu::Error;
use crate::image::{Accumulator, EVEN_SAMPLES, FloatImage, evenly, mean_difference};
use crate::math::camera::View;
use crate::render::{Method, Settings, SplatKind};

/// Threshold of smooth pictures of surfaces by squares, pixels. Splats of a pixel would widen what their samples share;
/// of smaller ones those that contain no sample are dropped, so that they cost no more.
const SMOOTH_THRESHOLD_PX: f32 = 0.125;

/// Threshold in pixels at which [`Engine::smooth`] is closest to the triangles of a surface; `None` where the settings' own
/// serves: points, and splats that are smooth themselves.
pub fn smooth_threshold(settings: &Settings, is_surface: bool) -> Option<f32> {
    let has_squares = settings.method == Method::Pop && settings.splat == SplatKind::Square;
    (has_squares && is_surface).then_some(SMOOTH_THRESHOLD_PX)
}

/// Side of the grid of samples in each pixel that [`Engine::smooth`] draws where few are not enough.
const MOST_SIDE: u32 = 8;

/// Mean difference of covered pixels between two halves of the samples above which more are drawn, 1 is white. Their mean is
/// off by about half of it.
const SMOOTH_DIFFERENCE: f64 = 2.0 / 255.0;

impl Engine<'_> {
    /// The mean of 16 samples a pixel, or of 64 where 16 are too few: where two halves of them, each even in the pixel,
    /// differ by more than two levels of 255 in the mean of all covered pixels. Each is as [`Engine::sample`] draws it.
    ///
    /// # Errors
    /// As [`Engine::render`].
    pub fn smooth(&mut self, view: &View, settings: &Settings) -> Result<FloatImage, Error> {
        let mut halves = [Accumulator::new(), Accumulator::new()];
        for i in 0..EVEN_SAMPLES {
            let image = self.sample(&evenly(view, i), settings)?;
            let half = &mut halves[(i.count_ones() % 2) as usize];
            if let Err(error) = half.add(&image) {
                unreachable!("pictures of one view: {error}");
            }
        }
        let [mut all, other] = halves;
        if mean_difference(&all.mean(), &other.mean()) > SMOOTH_DIFFERENCE {
            return self.supersample(view, settings, MOST_SIDE);
        }
        if let Err(error) = all.join(&other) {
            unreachable!("pictures of one view: {error}");
        }
        Ok(all.mean())
    }
}
