//! Records of nodes for patches, made before the frames that need them.

use super::Engine;
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
}
