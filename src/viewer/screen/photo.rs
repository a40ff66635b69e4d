//! A photo: a picture larger and smoother than the window's, drawn beside its frames.

use super::{OUTPUTS, Screen};
use crate::gpu::Error;
use crate::image::{Accumulator, Image, jittered};
use crate::math::camera::Camera;
use crate::render::PictureOutputs;
use crate::render::vulkan::renderer::Renderer;
use crate::render::{Method, Settings};

/// Samples a pixel, in each direction.
const SAMPLES_SIDE: u32 = 4;

impl Screen {
    /// The model as `camera` sees it, in the size of the camera's picture: the mean of 16 regular samples a pixel. None
    /// without a model. Takes the time of 16 frames of that size, and targets of its own on the device meanwhile.
    ///
    /// # Errors
    /// As [`Renderer::new`] and [`Renderer::draw`]: a picture larger than the device draws, or not enough memory.
    pub(in crate::viewer) fn photo(
        &mut self,
        settings: &Settings,
        camera: &Camera,
    ) -> Result<Option<Image>, Error> {
        self.finish()?;
        let (Some(model), Some(scene)) = (&self.model, &mut self.scene) else {
            return Ok(None);
        };
        let Ok(view) = camera.view(model.origin) else {
            return Ok(None);
        };
        let mut settings = *settings;
        if settings.method == Method::Points {
            settings.threshold_px = settings.threshold_px.min(self.gpu.info().max_point_size_px);
        }
        let outputs = PictureOutputs {
            values: !settings.draws_visibility(),
            ..OUTPUTS
        };
        let mut renderer = Renderer::new(&self.gpu, view.width, view.height, outputs, false)?;
        let mut mean = Accumulator::new();
        for sample in 0..SAMPLES_SIDE * SAMPLES_SIDE {
            let view = jittered(&view, sample, SAMPLES_SIDE);
            renderer.draw(model, scene, &view, &settings)?;
            // Every picture has the size of the view, which is all that can go wrong.
            if let Err(error) = mean.add(&renderer.read(&view)?) {
                unreachable!("pictures of one view: {error}");
            }
        }
        Ok(Some(mean.mean().to_image()))
    }
}
