//! Pictures of the reference with photographs on them.

use crate::gpu::Error;
use crate::image::Image;
use crate::math::camera::View;
use crate::projective::frame_photos::FramePhotos;
use crate::render::model_facts::DrawnParts;
use crate::render::photo_look::{color_picture, given};
use crate::render::reference::engine::MirrorEngine;
use crate::render::stats::FrameTimes;
use crate::render::{PictureOutputs, Settings};

/// A picture without what was only needed to draw it.
fn only(mut image: Image, outputs: PictureOutputs) -> Image {
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
