//! The models that a window shows.

use super::WindowScreen;
use crate::gpu::Error;
use crate::render::stats::FrameTimes;
use crate::render::vulkan::scene::DeviceScene;
use crate::render::window_renderer::WindowBackend;
use crate::tree::{Model, OrbitSphere};
use std::sync::Arc;

impl WindowScreen {
    /// Shows another model from the next frame on, whose `scene` may be there already. When it does not fit the device
    /// the old one stays.
    pub(in crate::viewer) fn set_model(
        &mut self,
        model: Arc<Model>,
        more: Vec<Arc<Model>>,
        scene: Option<DeviceScene>,
    ) -> Result<(), Error> {
        let scene = match scene {
            Some(scene) if scene.is_on(&self.gpu) => scene,
            // The device was lost meanwhile, or not yet open.
            _ => {
                let models = [&model].into_iter().chain(&more);
                let models: Vec<&Model> = models.map(Arc::as_ref).collect();
                DeviceScene::of_models(&self.gpu, &models)?
            }
        };
        self.finish()?;
        self.drop_model();
        self.shown = vec![true; 1 + more.len()];
        self.model = Some(model);
        self.more = more;
        self.scene = Some(scene);
        Ok(())
    }

    pub(in crate::viewer) fn drop_model(&mut self) {
        (self.model, self.scene) = (None, None);
        (self.more, self.shown) = (Vec::new(), Vec::new());
        self.pages = Vec::new();
        self.renderer.forget_prediction();
        (self.drawn, self.picture) = (None, None);
        self.frame_times_ms.clear();
        self.times = FrameTimes::default();
    }

    pub(in crate::viewer) fn model(&self) -> Option<&Model> {
        self.model.as_deref()
    }

    /// The first model, to be read by other threads.
    pub(in crate::viewer) fn shared_model(&self) -> Option<Arc<Model>> {
        self.model.clone()
    }

    /// Tells whether the first model stands in for a paged file.
    pub(in crate::viewer) fn is_paged(&self) -> bool {
        matches!(self.pages.first(), Some(Some(_)))
    }

    /// Tells whether the processor draws: by itself, or as a software device.
    pub(in crate::viewer) fn is_drawn_by_processor(&self) -> bool {
        self.gpu.info().is_cpu() || self.backend == WindowBackend::Cpu
    }

    /// Tells whether the leaves of the first model are points.
    pub(in crate::viewer) fn has_points(&self) -> bool {
        match self.pages.first() {
            Some(Some(pages)) => !pages.file().is_surface(),
            _ => (self.model()).is_some_and(|model| model.kind().is_points()),
        }
    }

    /// All models, the first one first.
    pub(in crate::viewer) fn models(&self) -> Vec<&Model> {
        self.model
            .as_deref()
            .into_iter()
            .chain(self.more.iter().map(Arc::as_ref))
            .collect()
    }

    /// Tells whether each model is drawn.
    pub(in crate::viewer) fn shown(&self) -> &[bool] {
        &self.shown
    }

    /// Draws a model from the next frame on, or leaves it out; nothing where there is no model of this index.
    pub(in crate::viewer) fn show(&mut self, index: usize, is_shown: bool) {
        if let (Some(shown), Some(scene)) = (self.shown.get_mut(index), &mut self.scene) {
            *shown = is_shown;
            scene.show(index, is_shown);
            self.renderer.forget_prediction();
            (self.picture, self.drawn) = (None, None);
        }
    }

    /// The smallest sphere around all models; none without any.
    pub(in crate::viewer) fn orbit_sphere(&self) -> Option<OrbitSphere> {
        let all = self.models().into_iter().map(Model::orbit_sphere);
        all.reduce(OrbitSphere::joined)
    }
}
