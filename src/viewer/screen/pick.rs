//! What is seen at a pixel.

use super::WindowScreen;
use crate::gpu::Error;
use crate::viewer::pick::{PickedModel, PickedPlace, pick};
use glam::DVec2;

impl WindowScreen {
    /// The point or place that the last frame shows at a place in the picture; `None` where nothing is seen.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub(in crate::viewer) fn pick(&mut self, at: DVec2) -> Result<Option<PickedPlace>, Error> {
        let Some(distance) = self.distance_at(at)? else {
            return Ok(None);
        };
        let Some(view) = self.drawn else {
            return Ok(None);
        };
        let models = self.models().into_iter().enumerate();
        let models: Vec<PickedModel<'_>> = models
            .map(|(index, model)| PickedModel {
                model,
                is_whole: self.shown.get(index) == Some(&true)
                    && !matches!(self.pages.get(index), Some(Some(_))),
            })
            .collect();
        Ok(Some(pick(&models, &view, at, distance as f32)))
    }
}
