//! Photographs on the models of a window.

use super::WindowScreen;
use crate::gpu::{Error, lock};
use crate::projective::frame_photos::FramePhotos;
use crate::render::vulkan::photos::DevicePhotos;
use crate::render::vulkan::photos::pool::PhotoPool;
use std::sync::{Arc, Mutex};

/// Bytes of photographs that a frame copies to the device at most: some milliseconds.
const FRAME_BYTES: u64 = 12 << 20;

impl WindowScreen {
    /// Puts these photographs on the surface from the next frame on. The memory for them has `words` words, or as many as the
    /// device binds at once. A frame that waits for its pages waits for its photographs, too.
    ///
    /// # Errors
    /// When device memory runs out.
    pub(in crate::viewer) fn set_photos(
        &mut self,
        photos: Option<Arc<FramePhotos>>,
        words: u64,
    ) -> Result<(), Error> {
        let Some(frame) = photos else {
            if self.photos.is_some() {
                self.finish()?;
            }
            (self.photos, self.photo_pool) = (None, None);
            self.renderer.set_photos(None);
            return Ok(());
        };
        let is_same = |old: &Arc<FramePhotos>| Arc::ptr_eq(old, &frame);
        if self.photos.as_ref().is_some_and(is_same) && self.photo_pool.is_some() {
            return Ok(());
        }
        if self.waits_for_pages {
            // Memory is used again at once.
            self.finish()?;
        }
        let pool = self.photo_pool.take();
        let pool = match pool.filter(|pool| lock(pool).capacity_words() >= words) {
            Some(pool) => pool,
            None => {
                self.finish()?;
                self.renderer.set_photos(None);
                let budget = (!self.waits_for_pages).then_some(FRAME_BYTES);
                Arc::new(Mutex::new(PhotoPool::new(&self.gpu, words, budget)?))
            }
        };
        self.photo_pool = Some(pool.clone());
        self.photos = Some(frame.clone());
        self.renderer.set_photos(Some(DevicePhotos { frame, pool }));
        Ok(())
    }

    /// Tells whether the next frame would be sharper than the last, since more of its photographs would be on the device.
    pub(in crate::viewer) fn are_photos_behind(&self) -> bool {
        (self.photo_pool.as_ref()).is_some_and(|pool| lock(pool).is_behind())
    }
}
