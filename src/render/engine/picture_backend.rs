//! Backends as an engine sees them: each draws a frame of its own and gives its picture, and none knows another.

use crate::gpu::Error;
use crate::image::Image;
use crate::math::camera::View;
use crate::projective::frame_photos::FramePhotos;
use crate::render::model_facts::DrawnParts;
use crate::render::stats::FrameTimes;
use crate::render::{PictureOutputs, Settings};
use std::sync::Arc;

/// Outputs of samples: values, so that only their mean is rounded.
pub(super) const VALUES: PictureOutputs = PictureOutputs {
    depth: false,
    normal: false,
    values: true,
};

/// A frame that a backend is asked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct PictureRequest<'a> {
    /// Models and pages that are drawn.
    pub(super) parts: DrawnParts<'a>,
    /// View of the picture.
    pub(super) view: &'a View,
    /// Settings of the frame.
    pub(super) settings: &'a Settings,
    /// Photographs, where there are any.
    pub(super) photos: Option<&'a Arc<FramePhotos>>,
}

/// A maker of pictures.
pub(super) trait PictureBackend {
    /// Draws a frame and waits until it is finished.
    ///
    /// # Errors
    /// When it cannot draw what is asked for, or memory runs out.
    fn draw(&mut self, frame: PictureRequest<'_>) -> Result<FrameTimes, Error>;

    /// Reads the picture of the last frame, which had this view.
    ///
    /// # Errors
    /// When memory runs out or a device is lost.
    fn read(&mut self, view: &View) -> Result<Image, Error>;

    /// Draws and reads a picture to be averaged with others ([`VALUES`]), of a size in pixels. The picture of the last frame stays
    /// where the backend has targets of its own for samples.
    ///
    /// # Errors
    /// When it cannot draw what is asked for, memory runs out, or a device is lost.
    fn sample(&mut self, frame: PictureRequest<'_>, size: [u32; 2]) -> Result<Image, Error>;

    /// Counts of what covers each pixel, of the last frame, where its settings show them.
    fn overdraw(&mut self) -> Option<Vec<u32>> {
        None
    }

    /// Keeps draw lists of a frame for the next one, where the backend can.
    fn keep_lists(&mut self, _keep: bool) {}
}
