//! Pictures that get better after they were shown first: finer by pages that come, smoother by samples.

use super::WindowScreen;
use crate::gpu::Error;
use crate::math::camera::View;
use crate::progress::SilentProgress;
use crate::render::Settings;
use crate::render::paged_model::PagedModel;
use crate::render::window_renderer::ShownModel;
use crate::tree::Model;
use crate::viewer::RestSmoothing;
use std::sync::Arc;
use std::time::Instant;

/// A picture whose samples take longer is not made smoother, milliseconds: what is pressed meanwhile would be answered late.
const SLOWEST_SAMPLE_MS: f64 = 150.0;

impl WindowScreen {
    /// Gives the pages that models stand in for, in their order, and tells whether frames wait for them.
    pub(in crate::viewer) fn set_pages(&mut self, pages: Vec<Option<PagedModel>>, waits: bool) {
        (self.pages, self.waits_for_pages) = (pages, waits);
    }

    /// Tells whether pages came that the last frame did not have.
    pub(in crate::viewer) fn has_new_pages(&self) -> bool {
        self.pages.iter().flatten().any(PagedModel::has_news)
    }

    /// Tells whether some pages cannot be drawn with these settings, which need the whole of the model.
    pub(in crate::viewer) fn needs_whole(&self, settings: &Settings) -> bool {
        let mut pages = self.pages.iter().flatten();
        pages.any(|pages| pages.refusal(settings).is_some())
    }

    /// Number of pages that would make the last frame finer.
    pub(in crate::viewer) fn wanted_pages(&self) -> usize {
        self.pages
            .iter()
            .flatten()
            .map(PagedModel::wanted_pages)
            .sum()
    }

    /// Messages of pages that could not be read, since the last call.
    pub(in crate::viewer) fn take_page_messages(&mut self) -> Vec<String> {
        let mut all = std::mem::take(&mut self.page_messages);
        let pages = self.pages.iter().flatten();
        all.extend(pages.flat_map(PagedModel::messages));
        all
    }

    /// Loads the pages that a frame needs.
    ///
    /// # Errors
    /// As [`PagedModel::load`].
    pub(super) fn load_pages(&mut self, view: &View, settings: &Settings) -> Result<(), Error> {
        for own in self.pages.iter_mut().flatten() {
            let mut messages = own.load(view, settings, &SilentProgress)?;
            self.page_messages.append(&mut messages);
        }
        Ok(())
    }

    /// Tells whether samples would make the picture of the last frame, drawn with these settings, smoother: where all of its
    /// pages are there, and samples take no longer than [`SLOWEST_SAMPLE_MS`] or may take long. A frame can take long by
    /// chance: where it took not very much longer, a sample tells.
    pub(in crate::viewer) fn can_be_smoother(
        &self,
        smoothing: RestSmoothing,
        settings: &Settings,
    ) -> bool {
        let is_finished = self.drawn.is_some() && self.picture.is_some() && self.pending.is_empty();
        let is_quick =
            smoothing == RestSmoothing::Always || self.times.frame_ms < 4.0 * SLOWEST_SAMPLE_MS;
        is_finished
            && is_quick
            && self.wanted_pages() == 0
            && self.renderer.can_be_smoother(settings)
    }

    /// Draws a sample of the last frame; tells whether it is to be shown again.
    ///
    /// # Errors
    /// As [`WindowScreen::draw`].
    pub(in crate::viewer) fn add_sample(
        &mut self,
        smoothing: RestSmoothing,
        settings: &Settings,
    ) -> Result<bool, Error> {
        let (Some(view), Some(model), Some(scene)) = (self.drawn, &self.model, &mut self.scene)
        else {
            return Ok(false);
        };
        let more = self.more.iter().map(Arc::as_ref);
        let models: Vec<&Model> = [&**model].into_iter().chain(more).collect();
        let shown = ShownModel {
            models: &models,
            scene,
            pages: &mut self.pages,
        };
        let start = Instant::now();
        let is_new = self.renderer.add_sample(shown, &view, settings)?;
        let took_ms = start.elapsed().as_secs_f64() * 1e3;
        if took_ms > SLOWEST_SAMPLE_MS && smoothing != RestSmoothing::Always {
            self.renderer.note_slow_sample();
        }
        Ok(is_new)
    }
}
