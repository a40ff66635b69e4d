//! One way to draw a model for everything that does not care how: on a Vulkan device, or by the reference on
//! the CPU where there is none.

mod cpu_pictures;
mod device_pictures;
mod patches;
mod photos;
mod picture_backend;
mod reference_pictures;
mod samples;
mod smooth;

use crate::gpu::frame::FrameMeasure;
use crate::gpu::{DeviceOptions, Error, Gpu};
use crate::image::{FloatImage, Image, PictureAccumulator, jittered};
use crate::math::camera::View;
use crate::progress::{Progress, SilentProgress};
use crate::projective::frame_photos::FramePhotos;
use crate::render::PictureOutputs;
use crate::render::Settings;
use crate::render::backend_choice::{AvailableBackends, FrameBackend, is_usual};
use crate::render::cost::model::DrawCosts;
use crate::render::cpu::supported::unsupported_reason;
use crate::render::engine::cpu_pictures::CpuPictures;
use crate::render::engine::device_pictures::DevicePictures;
use crate::render::engine::picture_backend::{PictureBackend, PictureRequest, VALUES};
use crate::render::model_facts::{DrawnParts, FactedModel, ModelFacts};
use crate::render::paged_model::{PagedModel, generation_of, prepare_all};
use crate::render::reference::renderer::ReferenceRenderer;
pub use crate::render::reference::renderer::style;
use crate::render::stats::FrameTimes;
use crate::render::supported::check;
use crate::render::vulkan::renderer::VulkanRenderer;
use crate::render::vulkan::scene::DeviceScene;
use crate::tree::Model;
pub use smooth::smooth_threshold;
// The resting picture of the window judges as a smooth picture does.
#[cfg(feature = "viewer")]
pub(crate) use smooth::{LEAST_SAMPLES, SMOOTH_DIFFERENCE};
use std::sync::Arc;
use std::time::Instant;

/// Place where pictures are made.
#[derive(Debug, Clone)]
pub enum Backend {
    /// A Vulkan device. Where that is the processor in disguise, the processor's own renderer draws what it can in its place.
    Device(Arc<Gpu>),
    /// A Vulkan device alone.
    Vulkan(Arc<Gpu>),
    /// The processor's fast renderer; needs no driver. What it cannot draw is refused.
    Cpu,
    /// Without a driver: the processor's fast renderer, and the reference for what that cannot draw.
    WithoutDevice,
    /// The reference, on the processor. Exact and slow; needs no driver.
    Reference,
}

impl Backend {
    /// The name that stands for the reference where a device is asked for.
    pub const REFERENCE: &'static str = "reference";
    /// The older name of the reference.
    const MIRROR: &'static str = "mirror";
    /// The name that stands for the processor's renderer where a device is asked for.
    pub const CPU: &'static str = "cpu";

    /// Opens what `options.device` names: `cpu`, `reference` (or `mirror`), a device's index or a part of its name, or the best device.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn open(options: &DeviceOptions) -> Result<Self, Error> {
        match options.device.as_deref() {
            Some(Self::REFERENCE | Self::MIRROR) => Ok(Self::Reference),
            Some(Self::CPU) => Ok(Self::Cpu),
            _ => Ok(Self::Device(Gpu::open(options)?)),
        }
    }

    /// Tells whether a name that a device is asked for by is that of a renderer of the processor.
    pub fn is_of_processor(name: &str) -> bool {
        matches!(name, Self::CPU | Self::REFERENCE | Self::MIRROR)
    }

    /// Name of the device.
    pub fn name(&self) -> &str {
        match self {
            Self::Device(gpu) | Self::Vulkan(gpu) => &gpu.info().name,
            Self::Cpu | Self::WithoutDevice => Self::CPU,
            Self::Reference => Self::REFERENCE,
        }
    }

    /// Tells whether the processor's renderer makes plain pictures of these settings, so that nothing of a device decides.
    pub fn draws_by_cpu(&self, settings: &Settings) -> bool {
        let can = unsupported_reason(settings, PictureOutputs::default(), [1, 1]).is_none();
        match self {
            Self::Device(gpu) => can && gpu.info().is_cpu() && is_usual(settings),
            Self::Cpu | Self::WithoutDevice => can,
            Self::Vulkan(_) | Self::Reference => false,
        }
    }

    /// The Vulkan device, if pictures are made on one.
    pub fn device(&self) -> Option<&Arc<Gpu>> {
        match self {
            Self::Device(gpu) | Self::Vulkan(gpu) => Some(gpu),
            Self::Cpu | Self::WithoutDevice | Self::Reference => None,
        }
    }
}

/// Draws one model, or several in one space, in one picture size.
#[derive(Debug)]
pub struct Engine<'m> {
    models: Vec<EngineModel<'m>>,
    outputs: PictureOutputs,
    device: Option<DevicePictures>,
    cpu: Option<CpuPictures>,
    reference: Option<Box<ReferenceRenderer>>,
    /// Of pages that could not be read.
    page_messages: Vec<String>,
    /// Backend that drew the last frame, once one did.
    last: Option<FrameBackend>,
    /// Photographs that frames show.
    photos: Option<Arc<FramePhotos>>,
}

/// A model of an engine.
#[derive(Debug)]
struct EngineModel<'m> {
    model: &'m Model,
    facts: Arc<ModelFacts>,
    is_shown: bool,
    /// Pages that the model stands in for.
    pages: Option<PagedModel>,
}

impl<'m> Engine<'m> {
    /// Readies a model for pictures of `width` x `height` pixels.
    ///
    /// # Errors
    /// When the device has not enough memory or a side is above its limit.
    pub fn new(
        backend: &Backend,
        model: &'m Model,
        size: (u32, u32),
        outputs: PictureOutputs,
    ) -> Result<Self, Error> {
        Self::of_scene(backend, &[model], &mut None, size, outputs)
    }

    /// Readies models that share one space ([`Model::origin`]), to be drawn together.
    ///
    /// # Errors
    /// As [`Engine::new`].
    pub fn of_models(
        backend: &Backend,
        models: &[&'m Model],
        size: (u32, u32),
        outputs: PictureOutputs,
    ) -> Result<Self, Error> {
        Self::of_scene(backend, models, &mut None, size, outputs)
    }

    /// Readies models whose copies may be on the backend's device already: `scene` is taken unless this fails, and given
    /// back by [`Engine::into_scene`].
    ///
    /// # Errors
    /// As [`Engine::new`].
    pub(crate) fn of_scene(
        backend: &Backend,
        models: &[&'m Model],
        scene: &mut Option<DeviceScene>,
        (width, height): (u32, u32),
        outputs: PictureOutputs,
    ) -> Result<Self, Error> {
        let cpu = || CpuPictures::new([width, height], outputs);
        let mut engine = Self {
            models: Vec::new(),
            outputs,
            device: None,
            cpu: None,
            reference: None,
            page_messages: Vec::new(),
            last: None,
            photos: None,
        };
        match backend {
            Backend::Device(gpu) | Backend::Vulkan(gpu) => {
                let renderer = VulkanRenderer::new(gpu, width, height, outputs, true)?;
                engine.device = Some(DevicePictures {
                    renderer: Box::new(renderer),
                    samples: None,
                    scene: match scene.take() {
                        Some(scene) => scene,
                        None => DeviceScene::of_models(gpu, models)?,
                    },
                });
                let is_alone = matches!(backend, Backend::Vulkan(_));
                engine.cpu = (gpu.info().is_cpu() && !is_alone).then(cpu);
            }
            Backend::Cpu | Backend::WithoutDevice => {
                engine.cpu = Some(cpu());
            }
            Backend::Reference => {}
        }
        if matches!(backend, Backend::Reference | Backend::WithoutDevice) {
            engine.reference = Some(Box::new(ReferenceRenderer::new(outputs)));
        }
        let scene = engine.device.as_ref().map(|device| &device.scene);
        let facts_of = |index: usize, model: &Model| match scene {
            Some(scene) => scene.facts_of(index),
            None => Arc::new(ModelFacts::of(model)),
        };
        let all = models.iter().enumerate();
        engine.models = all
            .map(|(index, &model)| EngineModel {
                model,
                facts: facts_of(index, model),
                is_shown: true,
                pages: None,
            })
            .collect();
        Ok(engine)
    }

    /// Lets the model of this index stand in for the pages of a paged file ([`PagedModel::stand_in`]), which are drawn in its
    /// place; nothing where there is no model of this index.
    pub fn set_pages(&mut self, index: usize, pages: PagedModel) {
        if let Some(model) = self.models.get_mut(index) {
            model.pages = Some(pages);
        }
    }

    /// Takes the pages of the model of this index back, where it stands in for any.
    #[cfg(feature = "viewer")]
    pub(crate) fn take_pages(&mut self, index: usize) -> Option<PagedModel> {
        self.models.get_mut(index)?.pages.take()
    }

    /// Loads the pages that the picture of a view needs, as [`PagedModel::load`], of all models that are shown. Drawing does
    /// so too, but tells no progress.
    ///
    /// # Errors
    /// As there.
    pub fn load_pages(
        &mut self,
        view: &View,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Vec<String>, Error> {
        let mut messages = Vec::new();
        for model in self.models.iter_mut().filter(|model| model.is_shown) {
            if let Some(pages) = &mut model.pages {
                messages.append(&mut pages.load(view, settings, progress)?);
            }
        }
        Ok(messages)
    }

    /// Takes the messages of pages that could not be read since the last call, one for each.
    pub fn take_page_messages(&mut self) -> Vec<String> {
        std::mem::take(&mut self.page_messages)
    }

    /// Loads and readies the pages of a frame, and gives the settings that it is drawn with.
    ///
    /// # Errors
    /// As [`PagedModel::prepare`]; when device memory runs out.
    fn prepare_pages(&mut self, view: &View, settings: &Settings) -> Result<Settings, Error> {
        let mut messages = self.load_pages(view, settings, &SilentProgress)?;
        self.page_messages.append(&mut messages);
        let shown = self.models.iter_mut().filter(|model| model.is_shown);
        let pages = shown.filter_map(|model| model.pages.as_mut());
        let settings = prepare_all(pages, view, settings)?;
        if let Some(device) = &mut self.device {
            let shown = self.models.iter().filter(|model| model.is_shown);
            let pages = shown.filter_map(|model| model.pages.as_ref());
            let all = self.models.iter().filter_map(|model| model.pages.as_ref());
            let resident = all.flat_map(PagedModel::resident);
            (device.scene).hold(pages.flat_map(PagedModel::parts), resident)?;
        }
        Ok(settings)
    }

    /// Draws a model from the next frame on, or leaves it out; nothing where there is no model of this index.
    pub fn show(&mut self, index: usize, is_shown: bool) {
        if let Some(model) = self.models.get_mut(index) {
            model.is_shown = is_shown;
        }
        if let Some(device) = &mut self.device {
            device.scene.show(index, is_shown);
        }
    }

    /// The copy of the model on the device, if there is one.
    #[cfg(feature = "viewer")]
    pub(crate) fn into_scene(self) -> Option<DeviceScene> {
        self.device.map(|device| device.scene)
    }

    /// Lets the reference snap positions to so many binary places of a pixel, 4..=8, in pictures that are compared with those
    /// of a device ([`Gpu::info`] has its number); 8 at first. A device has its own.
    #[must_use]
    pub fn with_subpixel_bits(mut self, bits: u32) -> Self {
        if let Some(reference) = &mut self.reference {
            reference.set_subpixel_bits(bits);
        }
        self
    }

    /// Gives the reference another albedo than every renderer has, so that tests see their comparisons fail.
    #[doc(hidden)]
    #[must_use]
    pub fn with_wrong_albedo(mut self, albedo: f32) -> Self {
        if let Some(reference) = &mut self.reference {
            reference.set_albedo(albedo);
        }
        self
    }

    /// The backends that it has.
    fn available(&self) -> AvailableBackends {
        AvailableBackends {
            has_device: self.device.is_some(),
            has_cpu: self.cpu.is_some(),
            has_reference: self.reference.is_some(),
        }
    }

    /// Draws a frame and waits until it is finished. The cut over pages, and the wait for those that are missing, count as cut.
    ///
    /// # Errors
    /// Errors of [`VulkanRenderer::draw`].
    pub fn draw(&mut self, view: &View, settings: &Settings) -> Result<FrameTimes, Error> {
        // What no backend can draw is refused before one is looked for.
        if self.device.is_none() {
            check(settings, self.outputs, f32::INFINITY)?;
        }
        let backend = self
            .available()
            .choose(settings, self.outputs, [view.width, view.height])?;
        self.last = Some(backend);
        let start = Instant::now();
        let settings = &self.prepare_pages(view, settings)?;
        let prepared_ms = start.elapsed().as_secs_f64() * 1e3;
        let mut times = self.with_frame(backend, view, settings, |pictures, frame| {
            pictures.draw(frame)
        })?;
        if self.models.iter().any(|model| model.pages.is_some()) {
            times.cut_ms += prepared_ms;
            times.frame_ms += prepared_ms;
        }
        Ok(times)
    }

    /// The backend of a kind. The choice is among those that are there ([`Engine::available`]).
    fn backend(&mut self, backend: FrameBackend) -> &mut dyn PictureBackend {
        match (
            backend,
            &mut self.device,
            &mut self.cpu,
            &mut self.reference,
        ) {
            (FrameBackend::Device, Some(device), ..) => device,
            (FrameBackend::Cpu, _, Some(cpu), _) => cpu,
            (FrameBackend::Reference, .., Some(reference)) => &mut **reference,
            _ => unreachable!("a backend that is there was chosen"),
        }
    }

    /// Hands a backend all that is shown.
    fn with_frame<T>(
        &mut self,
        backend: FrameBackend,
        view: &View,
        settings: &Settings,
        work: impl FnOnce(&mut dyn PictureBackend, PictureRequest<'_>) -> T,
    ) -> T {
        let models = std::mem::take(&mut self.models);
        let photos = self.photos.clone();
        let (parts, generation) = drawn(&models);
        let frame = PictureRequest {
            parts: DrawnParts::new(&parts).with_generation(generation),
            view,
            settings,
            photos: photos.as_ref(),
        };
        let done = work(self.backend(backend), frame);
        drop(parts);
        self.models = models;
        done
    }

    /// Keeps draw lists as [`VulkanRenderer::keep_lists`] does; off at first. The reference never does.
    pub fn keep_lists(&mut self, keep: bool) {
        if let Some(device) = &mut self.device {
            device.keep_lists(keep);
        }
        if let Some(cpu) = &mut self.cpu {
            cpu.keep_lists(keep);
        }
    }

    /// Sets what drawing costs on the device: [`VulkanRenderer::set_costs`]. Other backends have one way to draw.
    pub fn set_costs(&mut self, costs: Option<DrawCosts>) {
        if let Some(device) = &mut self.device {
            device.renderer.set_costs(costs);
        }
    }

    /// Sets what the frames from now on report: [`VulkanRenderer::measure`]. Other backends have stages and counts only.
    ///
    /// # Errors
    /// As [`VulkanRenderer::measure`].
    pub fn measure(&mut self, measure: FrameMeasure) -> Result<(), Error> {
        match &mut self.device {
            Some(device) => device.renderer.measure(measure),
            None => Ok(()),
        }
    }

    /// The picture of the last frame.
    ///
    /// # Errors
    /// As [`VulkanRenderer::read`].
    pub fn read(&mut self, view: &View) -> Result<Image, Error> {
        match self.last {
            Some(last) => self.backend(last).read(view),
            None => Ok(Image::default()),
        }
    }

    /// Gives the counts of pixels as [`VulkanRenderer::overdraw`] does.
    pub fn overdraw(&mut self) -> Option<Vec<u32>> {
        let last = self.last?;
        self.backend(last).overdraw()
    }

    /// Draws and reads one picture.
    ///
    /// # Errors
    /// As [`Engine::draw`] and [`Engine::read`].
    pub fn render(&mut self, view: &View, settings: &Settings) -> Result<Image, Error> {
        self.draw(view, settings)?;
        self.read(view)
    }

    /// Draws and reads one picture to be averaged with others: with [`Image::values`], so that only the mean is rounded,
    /// and without depth and normals. (Visibility splats are put together from pixels of eight bits, and have none.) On a
    /// device and by the processor it goes to targets of its own, which stay.
    ///
    /// # Errors
    /// As [`Engine::draw`] and [`Engine::read`].
    pub fn sample(&mut self, view: &View, settings: &Settings) -> Result<Image, Error> {
        if settings.draws_visibility() {
            return self.render(view, settings);
        }
        let size = match &self.cpu {
            Some(cpu) => cpu.size(),
            None => [view.width, view.height],
        };
        self.sample_at(view, settings, size)
    }

    /// Draws a sample as [`Engine::sample`] does, where the processor draws pictures of another size.
    fn sample_at(
        &mut self,
        view: &View,
        settings: &Settings,
        size: [u32; 2],
    ) -> Result<Image, Error> {
        let values = VALUES;
        if self.device.is_none() {
            check(settings, values, f32::INFINITY)?;
        }
        let backend = self
            .available()
            .choose(settings, values, [view.width, view.height])?;
        let settings = &self.prepare_pages(view, &settings.of_sample())?;
        if backend == FrameBackend::Reference {
            self.last = Some(backend);
        }
        self.with_frame(backend, view, settings, |pictures, frame| {
            pictures.sample(frame, size)
        })
    }

    /// The box-filtered mean of `k` x `k` pictures, each shifted by a part of a pixel: `k * k` regular samples a
    /// pixel, each as [`Engine::sample`] draws it; of one it is the picture that [`Engine::render`] draws. Color and
    /// coverage only: a mean of depths or normals is neither.
    ///
    /// # Errors
    /// As [`Engine::render`].
    pub fn supersample(
        &mut self,
        view: &View,
        settings: &Settings,
        k: u32,
    ) -> Result<FloatImage, Error> {
        let mut mean = PictureAccumulator::new();
        // Every picture has the size of the view, which is all that can go wrong.
        let mut add = |image: &Image| {
            if let Err(error) = mean.add(image) {
                unreachable!("pictures of one view: {error}");
            }
        };
        match k {
            0 | 1 => add(&self.render(&jittered(view, 0, k), settings)?),
            _ => self.samples(view, settings, k, |_, image| add(image))?,
        }
        Ok(mean.mean())
    }
}

/// The parts that are drawn, models that are there as a whole first, and a number that stands for the cuts of pages.
fn drawn<'a>(models: &'a [EngineModel<'_>]) -> (Vec<FactedModel<'a>>, u64) {
    let shown = || models.iter().filter(|model| model.is_shown);
    let whole = shown().filter(|own| own.pages.is_none());
    let whole = whole.map(|own| FactedModel {
        model: own.model,
        facts: &own.facts,
        cut: None,
    });
    let pages = || shown().filter_map(|own| own.pages.as_ref());
    let parts = pages().flat_map(PagedModel::parts).map(|(part, _)| part);
    (whole.chain(parts).collect(), generation_of(pages()))
}
