//! Photographs on the pictures of an engine.

use super::Engine;
use crate::gpu::{Error, lock};
use crate::projective::frame_photos::FramePhotos;
use crate::render::vulkan::photos::DevicePhotos;
use crate::render::vulkan::photos::pool::PhotoPool;
use std::sync::{Arc, Mutex};

impl Engine<'_> {
    /// Puts these photographs on the surface from the next frame on, where settings show any
    /// ([`Settings::photos`](crate::render::Settings::photos)). On a device they are copied to it once.
    ///
    /// # Errors
    /// When device memory runs out.
    pub fn set_photos(&mut self, photos: Option<Arc<FramePhotos>>) -> Result<(), Error> {
        if let Some(device) = &mut self.device {
            let renderer = &mut device.renderer;
            let of_device = match &photos {
                None => None,
                Some(frame) => {
                    let words = PhotoPool::words_of(frame);
                    let old = renderer.photos().map(|own| own.pool.clone());
                    let pool = match old.filter(|pool| lock(pool).capacity_words() >= words) {
                        Some(pool) => pool,
                        None => {
                            // The old memory first.
                            renderer.set_photos(None);
                            if let Some(samples) = &mut device.samples {
                                samples.set_photos(None);
                            }
                            let pool = PhotoPool::new(renderer.gpu(), words, None)?;
                            Arc::new(Mutex::new(pool))
                        }
                    };
                    Some(DevicePhotos {
                        frame: frame.clone(),
                        pool,
                    })
                }
            };
            renderer.set_photos(of_device);
        }
        self.photos = photos;
        Ok(())
    }
}
