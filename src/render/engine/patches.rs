//! Records of nodes for patches, and even splats, made before the frames that need them.

use super::Engine;
use crate::oriented::resample::SampleError;
use crate::progress::Progress;
use crate::render::Settings;
use crate::tree;

impl Engine<'_> {
    /// Makes the records of nodes that the patches of these settings need, of all models that are shown, unless they are there.
    /// Drawing does so too, but tells no progress.
    ///
    /// # Errors
    /// [`tree::Error::Cancelled`].
    pub fn build_patches(
        &self,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<(), tree::Error> {
        if settings.drawn_patches().is_none() {
            return Ok(());
        }
        let shown = self.models.iter().filter(|own| own.is_shown);
        let mut whole = shown.filter(|own| own.pages.is_none());
        whole.try_for_each(|own| own.facts.build_patches(own.model, progress))
    }

    /// Makes the even splats that these settings need, of all models that are shown, unless they are there. Drawing does so too,
    /// but tells no progress and does not end before they are made. Returns the largest spacing that is wider than usual, so that
    /// there are not too many.
    ///
    /// # Errors
    /// Too small a spacing, and [`SampleError::Cancelled`].
    pub fn build_even_splats(
        &self,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Option<f64>, SampleError> {
        let rules = settings.drawn_vertex_splats();
        let Some((rules, choice)) = rules.and_then(|rules| Some((rules, rules.samples?))) else {
            return Ok(None);
        };
        let mut widest = None;
        for own in self
            .models
            .iter()
            .filter(|own| own.is_shown && own.pages.is_none())
        {
            own.facts
                .even_splats(own.model, &choice, rules.crease(), progress)?;
            let bounds = own.facts.sample_bounds(own.model);
            let used = bounds.rules(&choice, rules.crease())?.spacing;
            if choice.spacing.is_none()
                && used > bounds.usual_spacing()
                && bounds.usual_spacing() > 0.0
            {
                widest = Some(used.max(widest.unwrap_or(0.0)));
            }
        }
        Ok(widest)
    }
}
