//! One way to draw a model for everything that does not care how: on a Vulkan device, or by the reference on
//! the CPU where there is none.

mod cpu_pictures;
mod looked;
mod patches;
mod photos;
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
use crate::render::frame_plan::resolve_of_parts;
use crate::render::model_facts::{DrawnParts, FactedModel, ModelFacts};
use crate::render::paged_model::{PagedModel, generation_of, prepare_all};
use crate::render::reference::engine::MirrorEngine;
pub use crate::render::reference::engine::style;
use crate::render::stats::FrameTimes;
use crate::render::supported::{check, check_patches_of};
use crate::render::vulkan::renderer::VulkanRenderer;
use crate::render::vulkan::scene::DeviceScene;
use crate::tree::Model;
pub use smooth::smooth_threshold;
// The resting picture of the window judges as a smooth picture does.
#[cfg(feature = "viewer")]
pub(crate) use smooth::{LEAST_SAMPLES, SMOOTH_DIFFERENCE};
use std::sync::Arc;

/// Outputs of samples: values, so that only their mean is rounded.
const VALUES: PictureOutputs = PictureOutputs {
    depth: false,
    normal: false,
    values: true,
};

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
    Mirror,
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
            Some(Self::REFERENCE | Self::MIRROR) => Ok(Self::Mirror),
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
            Self::Mirror => Self::REFERENCE,
        }
    }

    /// Tells whether the processor's renderer makes plain pictures of these settings, so that nothing of a device decides.
    pub fn draws_by_cpu(&self, settings: &Settings) -> bool {
        let can = unsupported_reason(settings, PictureOutputs::default(), [1, 1]).is_none();
        match self {
            Self::Device(gpu) => can && gpu.info().is_cpu() && is_usual(settings),
            Self::Cpu | Self::WithoutDevice => can,
            Self::Vulkan(_) | Self::Mirror => false,
        }
    }

    /// The Vulkan device, if pictures are made on one.
    pub fn device(&self) -> Option<&Arc<Gpu>> {
        match self {
            Self::Device(gpu) | Self::Vulkan(gpu) => Some(gpu),
            Self::Cpu | Self::WithoutDevice | Self::Mirror => None,
        }
    }
}

/// Draws one model, or several in one space, in one picture size.
#[derive(Debug)]
pub struct Engine<'m> {
    models: Vec<EngineModel<'m>>,
    outputs: PictureOutputs,
    device: Option<DeviceEngine>,
    cpu: Option<CpuEngine>,
    reference: Option<Box<MirrorEngine>>,
    /// Of pages that could not be read.
    page_messages: Vec<String>,
    /// Backend that drew the last frame.
    last: FrameBackend,
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

/// The part of an engine that draws on a device.
#[derive(Debug)]
struct DeviceEngine {
    renderer: Box<VulkanRenderer>,
    /// Draws what is averaged, once anything was.
    samples: Option<Box<VulkanRenderer>>,
    scene: DeviceScene,
}

/// The part of an engine that draws on the processor.
#[derive(Debug)]
struct CpuEngine {
    pictures: CpuPictures,
    /// Draws what is averaged, once anything was.
    samples: Option<CpuPictures>,
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
        let cpu = || CpuEngine {
            pictures: CpuPictures::new([width, height], outputs),
            samples: None,
        };
        let mut engine = Self {
            models: Vec::new(),
            outputs,
            device: None,
            cpu: None,
            reference: None,
            page_messages: Vec::new(),
            last: FrameBackend::Reference,
            photos: None,
        };
        match backend {
            Backend::Device(gpu) | Backend::Vulkan(gpu) => {
                let renderer = VulkanRenderer::new(gpu, width, height, outputs, true)?;
                engine.device = Some(DeviceEngine {
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
            Backend::Mirror => {}
        }
        if matches!(backend, Backend::Mirror | Backend::WithoutDevice) {
            engine.reference = Some(Box::new(MirrorEngine::new(outputs)));
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

    /// Draws a frame and waits until it is finished.
    ///
    /// # Errors
    /// As [`VulkanRenderer::draw`].
    pub fn draw(&mut self, view: &View, settings: &Settings) -> Result<FrameTimes, Error> {
        // What no backend can draw is refused before one is looked for.
        if self.device.is_none() {
            check(settings, self.outputs, f32::INFINITY)?;
        }
        self.last = self
            .available()
            .choose(settings, self.outputs, [view.width, view.height])?;
        let settings = &self.prepare_pages(view, settings)?;
        let (parts, generation) = drawn(&self.models);
        let parts = DrawnParts::new(&parts).with_generation(generation);
        match (
            self.last,
            &mut self.cpu,
            &mut self.device,
            &mut self.reference,
        ) {
            (FrameBackend::Cpu, Some(cpu), ..) => {
                (cpu.pictures).draw(parts, view, settings, self.photos.as_ref())
            }
            (FrameBackend::Device, _, Some(device), _) => {
                let DeviceEngine {
                    renderer, scene, ..
                } = device;
                renderer.draw_parts(parts, scene, view, settings)
            }
            (FrameBackend::Reference, .., Some(reference)) => {
                check_patches_of(settings, parts)?;
                let settings = resolve_of_parts(settings, parts, view);
                let photos = self.photos.as_deref();
                looked::draw_reference(reference, parts, (view, &settings), photos)
            }
            _ => unreachable!("a backend that is there was chosen"),
        }
    }

    /// Keeps draw lists as [`VulkanRenderer::keep_lists`] does; off at first. The reference never does.
    pub fn keep_lists(&mut self, keep: bool) {
        if let Some(device) = &mut self.device {
            device.renderer.keep_lists(keep);
        }
        if let Some(cpu) = &mut self.cpu {
            cpu.pictures.renderer.keep_frames(keep);
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
        match (self.last, &mut self.cpu, &mut self.device, &self.reference) {
            (FrameBackend::Cpu, Some(cpu), ..) => Ok(cpu.pictures.read(view)),
            (FrameBackend::Device, _, Some(device), _) => device.renderer.read(view),
            (.., Some(reference)) => Ok(reference.image.clone()),
            // Nothing was drawn yet.
            (_, _, Some(device), None) => device.renderer.read(view),
            _ => Ok(Image::default()),
        }
    }

    /// Gives the counts of pixels as [`VulkanRenderer::overdraw`] does.
    pub fn overdraw(&mut self) -> Option<Vec<u32>> {
        match (self.last, &mut self.device, &self.reference) {
            (FrameBackend::Device, Some(device), _) => device.renderer.overdraw(),
            (FrameBackend::Reference, _, Some(reference)) => reference.counts.clone(),
            _ => None,
        }
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
            Some(cpu) => cpu.pictures.renderer.size(),
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
        let settings = &self.prepare_pages(view, settings)?;
        let (parts, generation) = drawn(&self.models);
        let parts = DrawnParts::new(&parts).with_generation(generation);
        match (
            backend,
            &mut self.cpu,
            &mut self.device,
            &mut self.reference,
        ) {
            (FrameBackend::Cpu, Some(cpu), ..) => {
                let old = cpu.samples.take();
                let old = old.filter(|own| own.renderer.size() == size);
                let samples = cpu
                    .samples
                    .insert(old.unwrap_or_else(|| CpuPictures::new(size, values)));
                samples.draw(parts, view, settings, self.photos.as_ref())?;
                Ok(samples.read(view))
            }
            (FrameBackend::Device, _, Some(device), _) => device.sample(parts, view, settings),
            (FrameBackend::Reference, .., Some(reference)) => {
                let outputs = std::mem::replace(&mut reference.outputs, values);
                let settings = resolve_of_parts(settings, parts, view);
                let photos = self.photos.as_deref();
                looked::draw_reference(reference, parts, (view, &settings), photos)?;
                reference.outputs = outputs;
                self.last = FrameBackend::Reference;
                Ok(reference.image.clone())
            }
            _ => unreachable!("a backend that is there was chosen"),
        }
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

impl DeviceEngine {
    /// Draws a sample as [`Engine::sample`] does.
    fn sample(
        &mut self,
        parts: DrawnParts<'_>,
        view: &View,
        settings: &Settings,
    ) -> Result<Image, Error> {
        let Self {
            renderer,
            samples,
            scene,
        } = self;
        let samples = match samples {
            Some(made) => made,
            none => none.insert(Box::new(renderer.of_values()?)),
        };
        if samples.costs() != renderer.costs() {
            samples.set_costs(renderer.costs());
        }
        samples.set_photos(renderer.photos().cloned());
        samples.draw_parts(parts, scene, view, settings)?;
        samples.read(view)
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
