//! Photographs on the pictures of an engine.

use super::Engine;
use crate::gpu::{Error, lock};
use crate::image::Image;
use crate::math::camera::View;
use crate::projective::frame_photos::FramePhotos;
use crate::render::model_facts::DrawnParts;
use crate::render::photo_look::color_picture;
use crate::render::reference::engine::MirrorEngine;
use crate::render::stats::FrameTimes;
use crate::render::vulkan::photos::DevicePhotos;
use crate::render::vulkan::photos::pool::PhotoPool;
use crate::render::{PictureOutputs, Settings};
use std::sync::{Arc, Mutex};

/// The photographs of a frame whose settings show some.
///
/// # Errors
/// [`Error::Unsupported`] where none are given.
pub(super) fn given(photos: Option<&FramePhotos>) -> Result<&FramePhotos, Error> {
    photos.ok_or_else(|| Error::Unsupported {
        what: "photographs",
        why: "none are given; name a scene of photographs with --photos".into(),
    })
}

/// A picture without what was only needed to draw it.
pub(super) fn only(mut image: Image, outputs: PictureOutputs) -> Image {
    if !outputs.depth {
        image.depth = Vec::new();
    }
    if !outputs.normal {
        image.normal = Vec::new();
    }
    image
}

/// Draws a frame by the reference, with photographs where its settings show any.
///
/// # Errors
/// [`Error::Unsupported`] where none are given.
pub(super) fn draw_reference(
    reference: &mut MirrorEngine,
    parts: DrawnParts<'_>,
    (view, settings): (&View, &Settings),
    photos: Option<&FramePhotos>,
) -> Result<FrameTimes, Error> {
    if !settings.shows_photos() {
        return Ok(reference.draw(parts, view, settings));
    }
    let photos = given(photos)?;
    let outputs = reference.outputs;
    reference.outputs = settings.outputs_of_frame(outputs);
    let times = reference.draw(parts, view, settings);
    reference.outputs = outputs;
    let mut image = std::mem::take(&mut reference.image);
    color_picture(&mut image, view, photos, settings);
    reference.image = only(image, outputs);
    Ok(times)
}

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
