//! A photo: a picture larger and smoother than the window's, drawn beside its frames.

use super::WindowScreen;
use crate::gpu::Error;
use crate::image::Image;
use crate::math::camera::Camera;
use crate::render::engine::{Backend, Engine};
use crate::render::window_renderer::{WINDOW_OUTPUTS, WindowBackend};
use crate::render::{Method, Settings};
use crate::tree::Model;
use std::sync::Arc;

/// Samples a pixel, in each direction.
const SAMPLES_SIDE: u32 = 4;

impl WindowScreen {
    /// The model as `camera` sees it, in the size of the camera's picture: the mean of 16 regular samples a pixel. None
    /// without a model. Takes the time of 16 frames of that size, and targets of its own on the device meanwhile.
    ///
    /// # Errors
    /// As [`Engine::supersample`]: a picture larger than the device draws, or not enough memory.
    pub(in crate::viewer) fn photo(
        &mut self,
        settings: &Settings,
        camera: &Camera,
    ) -> Result<Option<Image>, Error> {
        self.finish()?;
        let models: Vec<&Model> = self
            .model
            .as_deref()
            .into_iter()
            .chain(self.more.iter().map(Arc::as_ref))
            .collect();
        let Some(model) = models.first() else {
            return Ok(None);
        };
        let Ok(view) = camera.view(model.origin) else {
            return Ok(None);
        };
        let mut settings = *settings;
        if settings.method == Method::Points {
            settings.threshold_px = settings.threshold_px.min(self.gpu.info().max_point_size_px);
        }
        let size = (view.width, view.height);
        let backend = match self.backend {
            WindowBackend::Auto => Backend::Device(self.gpu.clone()),
            WindowBackend::Vulkan => Backend::Vulkan(self.gpu.clone()),
            WindowBackend::Cpu => Backend::Cpu,
        };
        let scene = &mut self.scene;
        let mut engine = Engine::of_scene(&backend, &models, scene, size, WINDOW_OUTPUTS)?;
        for (index, &is_shown) in self.shown.iter().enumerate() {
            engine.show(index, is_shown);
        }
        for (index, own) in self.pages.iter_mut().enumerate() {
            if let Some(pages) = own.take() {
                engine.set_pages(index, pages);
            }
        }
        engine.set_photos(self.photos.clone())?;
        let picture = engine.supersample(&view, &settings, SAMPLES_SIDE);
        self.page_messages.append(&mut engine.take_page_messages());
        for (index, own) in self.pages.iter_mut().enumerate() {
            *own = engine.take_pages(index);
        }
        if let Some(scene) = engine.into_scene() {
            self.scene = Some(scene);
        }
        Ok(Some(picture?.to_image()))
    }
}
