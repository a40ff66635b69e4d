//! Pictures of the processor with photographs on them.

use crate::gpu::Error;
use crate::image::Image;
use crate::projective::frame_photos::FramePhotos;
use crate::render::PictureOutputs;

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
