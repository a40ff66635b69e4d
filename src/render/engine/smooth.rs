//! Smooth pictures: the mean of as many samples as they need.

use super::Engine;
use crate::gpu::Error;
use crate::image::{EVEN_SAMPLES, FloatImage, Image, PictureAccumulator, evenly, mean_difference};
use crate::math::camera::View;
use crate::pack::SurfaceLighting;
use crate::pack::lit_sphere::LitSphere;
use crate::render::{AmbientOcclusion, EyeDome, Method, Settings, SplatKind};
use crate::tree::Model;
use std::ops::Range;

/// Threshold of smooth pictures of surfaces by squares, pixels. Splats of a pixel would widen what their samples share;
/// of smaller ones those that contain no sample are dropped, so that they cost no more.
const SMOOTH_THRESHOLD_PX: f32 = 0.125;

/// Threshold in pixels at which [`Engine::smooth`] is closest to the triangles of a surface; `None` where the settings' own
/// serves: points, and splats that are smooth themselves.
pub fn smooth_threshold(settings: &Settings, is_surface: bool) -> Option<f32> {
    let has_squares = settings.method == Method::Pop && settings.splat == SplatKind::Square;
    (has_squares && is_surface).then_some(SMOOTH_THRESHOLD_PX)
}

impl Settings {
    /// Settings of what `surfel render` and the window show first of a model, for [`Engine::smooth`]: studio light, darkened hollows
    /// and depths between points, points as discs in the plane of the surface. The default is for measuring: the headlight, squares.
    pub fn for_people(model: &Model) -> Self {
        let is_surface = model.kind().is_surface();
        let mut settings = Self {
            light: SurfaceLighting::Sphere(LitSphere::Studio),
            ambient_occlusion: AmbientOcclusion::Auto,
            eye_dome: EyeDome::Auto,
            splat: match is_surface {
                true => SplatKind::Square,
                false => SplatKind::Ellipse,
            },
            ..Self::default()
        };
        let threshold = smooth_threshold(&settings, is_surface);
        settings.threshold_px = threshold.unwrap_or(settings.threshold_px);
        settings
    }
}

/// Samples of a pixel at least; twice as many where they are not enough.
pub(crate) const LEAST_SAMPLES: u32 = EVEN_SAMPLES / 2;

/// The same of paged files, whose samples are pixels of a larger picture: sides of grids.
const LEAST_SIDE: u32 = 4;
const MOST_SIDE: u32 = 8;

/// Mean difference of covered pixels between two halves of the samples above which more are drawn, 1 is white. Their mean is
/// off by about half of it.
pub(crate) const SMOOTH_DIFFERENCE: f64 = 1.25 / 255.0;
const SMOOTH_DIFFERENCE_OF_GRIDS: f64 = 2.0 / 255.0;

impl Engine<'_> {
    /// The mean of 32 samples a pixel, or of 64 where these are too few: where two halves of them, each even in the pixel,
    /// differ by more than a level and a quarter of 255 in the mean of all covered pixels. Each is as [`Engine::sample`] draws
    /// it.
    ///
    /// # Errors
    /// As [`Engine::render`].
    pub fn smooth(&mut self, view: &View, settings: &Settings) -> Result<FloatImage, Error> {
        if self.factor_of_samples(view, settings, LEAST_SIDE) > 1 {
            return self.smooth_of_grids(view, settings);
        }
        let quarter = LEAST_SAMPLES / 2;
        let mut all = self.even_samples(view, settings, 0..quarter)?;
        let other = self.even_samples(view, settings, quarter..LEAST_SAMPLES)?;
        let is_enough = mean_difference(&all.mean(), &other.mean()) <= SMOOTH_DIFFERENCE;
        joined(&mut all, &other);
        if !is_enough {
            let rest = self.even_samples(view, settings, LEAST_SAMPLES..EVEN_SAMPLES)?;
            joined(&mut all, &rest);
        }
        Ok(all.mean())
    }

    /// The mean of 64 even samples a pixel, as [`Engine::smooth`] draws them where it takes all: the reference of pictures.
    ///
    /// # Errors
    /// As [`Engine::render`].
    pub fn mean_of_even(&mut self, view: &View, settings: &Settings) -> Result<FloatImage, Error> {
        Ok(self.even_samples(view, settings, 0..EVEN_SAMPLES)?.mean())
    }

    /// Some of the samples that [`evenly`] places.
    fn even_samples(
        &mut self,
        view: &View,
        settings: &Settings,
        numbers: Range<u32>,
    ) -> Result<PictureAccumulator, Error> {
        let mut sum = PictureAccumulator::new();
        for i in numbers {
            add(&mut sum, &self.sample(&evenly(view, i), settings)?);
        }
        Ok(sum)
    }

    /// As [`Engine::smooth`], of 16 or 64 samples on grids: pixels of a larger picture lie on them.
    fn smooth_of_grids(&mut self, view: &View, settings: &Settings) -> Result<FloatImage, Error> {
        let mut halves = [PictureAccumulator::new(), PictureAccumulator::new()];
        self.samples(view, settings, LEAST_SIDE, |i, image| {
            add(&mut halves[((i + i / LEAST_SIDE) % 2) as usize], image);
        })?;
        let [mut all, other] = halves;
        if mean_difference(&all.mean(), &other.mean()) > SMOOTH_DIFFERENCE_OF_GRIDS {
            return self.supersample(view, settings, MOST_SIDE);
        }
        joined(&mut all, &other);
        Ok(all.mean())
    }
}

fn add(sum: &mut PictureAccumulator, image: &Image) {
    if let Err(error) = sum.add(image) {
        unreachable!("pictures of one view: {error}");
    }
}

fn joined(sum: &mut PictureAccumulator, other: &PictureAccumulator) {
    if let Err(error) = sum.join(other) {
        unreachable!("pictures of one view: {error}");
    }
}
