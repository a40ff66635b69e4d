//! Samples of pixels that are the pixels of a larger picture, so that one cut serves many of them.

use super::Engine;
use super::picture_backend::VALUES;
use crate::gpu::Error;
use crate::image::{Image, jittered};
use crate::math::camera::View;
use crate::render::backend_choice::FrameBackend;
use crate::render::cut_key::knows_footprints;
use crate::render::frame_plan::resolved;
use crate::render::model_facts::DrawnFacts;
use crate::render::{AmbientOcclusion, EyeDome, Settings};

/// Most pixels of a larger picture, which takes 24 bytes for each.
const MOST_PIXELS: u64 = 1 << 22;

/// Tells whether a picture that is larger by some factor shows at its pixels what samples of the smaller one show: of opaque
/// squares and discs of a pixel at most in either, which are drawn where their balls contain a pixel's center, and with no look
/// that depends on distances in pixels.
fn is_of_samples(settings: &Settings, facts: &DrawnFacts, view: &View, factor: u32) -> bool {
    let settings = resolved(settings, facts, view, |_| false);
    knows_footprints(&settings)
        && facts.kind.is_surface()
        && settings.drawn_polygons().is_none()
        && !settings.holds_cut()
        && !settings.shows_photos()
        && settings.eye_dome == EyeDome::Off
        && settings.ambient_occlusion == AmbientOcclusion::Off
        && settings.threshold_px * factor as f32 <= 1.0
}

/// The pixels of a larger picture that are one sample of each pixel: from column and row `first` on, every `factor`-th.
fn sample_of(larger: &Image, first: [u32; 2], factor: u32) -> Image {
    let (width, height) = (larger.width / factor, larger.height / factor);
    let [left, top] = first.map(|place| place as usize);
    let rows = (0..height as usize).map(|y| top + y * factor as usize);
    let places = rows.flat_map(|y| {
        let start = y * larger.width as usize + left;
        (0..width as usize).map(move |x| start + x * factor as usize)
    });
    let places: Vec<usize> = places.collect();
    Image {
        width,
        height,
        color: places.iter().map(|&at| larger.color[at]).collect(),
        values: match larger.values.is_empty() {
            true => Vec::new(),
            false => places.iter().map(|&at| larger.values[at]).collect(),
        },
        ..Image::default()
    }
}

impl Engine<'_> {
    /// Draws the samples of a regular `k` x `k` grid in each pixel, as [`Engine::sample`] draws those of [`jittered`] views, and
    /// gives each with its number, in any order.
    ///
    /// Several samples of a paged file are drawn by the processor as one larger picture: a cut over pages costs as much for one
    /// sample of a pixel as for several.
    ///
    /// # Errors
    /// As [`Engine::sample`].
    pub(super) fn samples(
        &mut self,
        view: &View,
        settings: &Settings,
        k: u32,
        mut take: impl FnMut(u32, &Image),
    ) -> Result<(), Error> {
        let factor = self.factor_of_samples(view, settings, k);
        if factor <= 1 {
            for number in 0..k * k {
                take(number, &self.sample(&jittered(view, number, k), settings)?);
            }
            return Ok(());
        }
        let larger = View {
            width: view.width * factor,
            height: view.height * factor,
            ..*view
        };
        let settings = Settings {
            threshold_px: settings.threshold_px * factor as f32,
            ..*settings
        };
        // Column a of the grid is pixel a / steps of the larger picture that is shifted by a mod steps.
        let steps = k / factor;
        for shift in 0..steps * steps {
            let view = jittered(&larger, shift, steps);
            let image = self.sample_at(&view, &settings, [view.width, view.height])?;
            for own in 0..factor * factor {
                let (x, y) = (own % factor, own / factor);
                let column = x * steps + shift % steps;
                let row = y * steps + shift / steps;
                take(row * k + column, &sample_of(&image, [x, y], factor));
            }
        }
        Ok(())
    }

    /// Factor by which pictures may be larger, so that their pixels are samples: a divisor of `k`.
    pub(super) fn factor_of_samples(&self, view: &View, settings: &Settings, k: u32) -> u32 {
        let shown = || self.models.iter().filter(|own| own.is_shown);
        if shown().all(|own| own.pages.is_none()) {
            return 1;
        }
        let is_by_processor = |factor: u32| {
            let size = [view.width * factor, view.height * factor];
            let chosen = self.available().choose(settings, VALUES, size);
            chosen.is_ok_and(|backend| backend == FrameBackend::Cpu)
        };
        let fits = |factor: u32| {
            let pixels = u64::from(view.width) * u64::from(view.height);
            pixels * u64::from(factor * factor) <= MOST_PIXELS
        };
        let may_be = |factor: u32| {
            let facts = shown().map(|own| match &own.pages {
                Some(pages) => pages.drawn_facts(),
                None => own.facts.drawn(),
            });
            let mut facts = facts;
            facts.all(|facts| is_of_samples(settings, &facts, view, factor))
        };
        let divisors = (1..=k).rev().filter(|factor| k.is_multiple_of(*factor));
        let mut possible =
            divisors.filter(|&factor| fits(factor) && is_by_processor(factor) && may_be(factor));
        possible.next().unwrap_or(1)
    }
}
