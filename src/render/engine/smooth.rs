//! Smooth pictures: the mean of as many samples as they need.

use super::Engine;
use crate::gpu::Error;
use crate::image::{Accumulator, EVEN_SAMPLES, FloatImage, Image, evenly, mean_difference};
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

/// Sides of the grids of samples in each pixel: of 16 samples of paged files, and where 16 are not enough.
const LEAST_SIDE: u32 = 4;
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
        let mut add = |half: u32, image: &Image| {
            if let Err(error) = halves[(half % 2) as usize].add(image) {
                unreachable!("pictures of one view: {error}");
            }
        };
        // Pixels of a larger picture lie on a grid.
        if self.factor_of_samples(view, settings, LEAST_SIDE) > 1 {
            let row = |i: u32| i / LEAST_SIDE;
            self.samples(view, settings, LEAST_SIDE, |i, image| {
                add(i + row(i), image)
            })?;
        } else {
            for i in 0..EVEN_SAMPLES {
                add(i.count_ones(), &self.sample(&evenly(view, i), settings)?);
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
