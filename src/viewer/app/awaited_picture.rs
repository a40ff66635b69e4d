//! A picture that was asked for and is written when the view has become smooth.

use super::ViewerApp;
use super::commands::free_path;
use crate::math::camera::Camera;
use crate::render::Settings;
use crate::viewer::control::FrameBudget;
use crate::viewer::recovery::{RecoveryWay, way_after};
use crate::viewer::{RestSmoothing, ViewerError};

/// A picture that is written later.
pub(super) enum AwaitedPicture {
    /// After the next frame: the view has changed since the last.
    Frame,
    /// After the samples of the resting view that is seen by this camera and drawn so.
    Samples(Box<(Option<Camera>, Settings)>),
}

impl ViewerApp {
    /// Writes a picture of the present view, once it is as smooth as it becomes at rest; asked twice, at once.
    pub(super) fn ask_for_screenshot(&mut self) -> Result<(), ViewerError> {
        if self.orbit.is_none() {
            return Ok(());
        }
        if self.is_dirty || self.wheel != 0.0 {
            self.awaited_picture = Some(AwaitedPicture::Frame);
            return Ok(());
        }
        if matches!(self.awaited_picture, Some(AwaitedPicture::Samples(_))) {
            return self.write_screenshot();
        }
        self.await_samples()
    }

    /// Waits for the samples of the picture that is shown, or writes it where none will come.
    fn await_samples(&mut self) -> Result<(), ViewerError> {
        if !self.becomes_smooth() {
            return self.write_screenshot();
        }
        let shown = Box::new((self.camera(), self.settings));
        self.awaited_picture = Some(AwaitedPicture::Samples(shown));
        Ok(())
    }

    /// Tells whether views of now become smooth where they rest, at their time. Somebody who watches sees the same picture in
    /// the same view; recordings and pictures that nobody watches are what the settings say.
    pub(super) fn becomes_smooth(&self) -> bool {
        self.options.smoothing != RestSmoothing::Never
            && !self.is_unattended()
            && self.options.replay.is_none()
            && !self.is_preview
            && self.turntable.is_none()
    }

    /// Writes the picture that was asked for before another view takes its place: as smooth as it is.
    pub(super) fn save_awaited_before_change(&mut self) -> Result<(), ViewerError> {
        match &self.awaited_picture {
            Some(AwaitedPicture::Samples(shown)) if **shown != (self.camera(), self.settings) => {
                self.write_screenshot()
            }
            _ => Ok(()),
        }
    }

    /// Goes on to wait for samples after a frame that was waited for.
    pub(super) fn await_samples_of_frame(&mut self) -> Result<(), ViewerError> {
        match self.awaited_picture {
            Some(AwaitedPicture::Frame) => self.await_samples(),
            _ => Ok(()),
        }
    }

    /// Writes the picture that was asked for if no frame and no sample of it is to come, or the window closes.
    pub(in crate::viewer) fn save_awaited(&mut self, closes: bool) -> Result<(), ViewerError> {
        if !matches!(self.awaited_picture, Some(AwaitedPicture::Samples(_))) {
            return Ok(());
        }
        let is_coarse = self.control.as_ref().is_some_and(FrameBudget::is_coarse);
        // Figures of a frame may still have to be painted.
        let is_done = !(self.is_dirty() || is_coarse) && self.smooths_in().is_none();
        match closes || is_done {
            true => self.write_screenshot(),
            false => Ok(()),
        }
    }

    /// Writes the first `surfel-NNN.png` that is not there yet.
    fn write_screenshot(&mut self) -> Result<(), ViewerError> {
        self.awaited_picture = None;
        match free_path("surfel-", ".png") {
            Some(path) if self.orbit.is_some() => match self.save(&path) {
                Err(ViewerError::Image(error)) => self.warn(&error.to_string()),
                // A device that was lost is noticed by the next frame.
                Err(ViewerError::Gpu(error)) if way_after(&error) != RecoveryWay::End => {
                    self.is_dirty = true;
                    self.warn(&format!("no picture: {error}"));
                }
                Err(error) => return Err(error),
                Ok(()) => self.inform(&format!("wrote {}", path.display())),
            },
            Some(_) => {}
            None => self.warn("surfel-000.png to surfel-999.png are all there; move some away"),
        }
        Ok(())
    }
}
