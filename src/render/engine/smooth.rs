//! Smooth pictures: the mean of as many samples as they need.

use super::Engine;
use crate::gpu::Error;
use crate::image::{Accumulator, FloatImage, mean_difference};
use crate::math::camera::View;
use crate::render::Settings;

/// Sides of the grids of samples in each pixel that [`Engine::smooth`] draws.
const SMOOTH_SIDES: [u32; 2] = [4, 8];

/// Mean difference of covered pixels between two halves of the samples above which more are drawn, 1 is white. Their mean is
/// off by about half of it.
const SMOOTH_DIFFERENCE: f64 = 2.0 / 255.0;

impl Engine<'_> {
    /// The mean of 16 samples a pixel, or of 64 where 16 are too few: where two halves of them, which alternate in each pixel,
    /// differ by more than two levels of 255 in the mean of all covered pixels. Each is as [`Engine::sample`] draws it.
    ///
    /// # Errors
    /// As [`Engine::render`].
    pub fn smooth(&mut self, view: &View, settings: &Settings) -> Result<FloatImage, Error> {
        let [k, most] = SMOOTH_SIDES;
        let mut halves = [Accumulator::new(), Accumulator::new()];
        self.samples(view, settings, k, |i, image| {
            let half = &mut halves[((i + i / k) % 2) as usize];
            if let Err(error) = half.add(image) {
                unreachable!("pictures of one view: {error}");
            }
        })?;
        let [mut all, other] = halves;
        if mean_difference(&all.mean(), &other.mean()) > SMOOTH_DIFFERENCE {
            return self.supersample(view, settings, most);
        }
        if let Err(error) = all.join(&other) {
            unreachable!("pictures of one view: {error}");
        }
        Ok(all.mean())
    }
}
