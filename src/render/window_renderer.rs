//! Frames for a window: drawn on the device, or by the processor into images that the device shows.

use crate::gpu::frame::FrameTicket;
use crate::gpu::image::DeviceImage as MappedImage;
use crate::gpu::overlay::WindowOverlay;
use crate::gpu::{Error, Gpu};
use crate::image::Image;
use crate::math::camera::View;
use crate::projective::frame_photos::FramePhotos;
use crate::render::backend_choice::{AvailableBackends, FrameBackend};
use crate::render::cost::model::DrawCosts;
use crate::render::cpu::picture::{DrawnArea, PixelWords};
use crate::render::cpu::renderer::CpuRenderer;
use crate::render::frame_estimate::FrameEstimate;
use crate::render::frame_plan::FramePlan;
use crate::render::model_facts::{DrawnParts, FactedModel, ModelFacts};
use crate::render::paged_model::{PagedModel, generation_of, prepare_all};
use crate::render::photo_look::given;
use crate::render::probe_area::ProbeArea;
use crate::render::rest_picture::{RestPicture, SampleRequest, has_mean};
use crate::render::stats::{FrameTimes, KeptWork};
use crate::render::vulkan::photos::DevicePhotos;
use crate::render::vulkan::renderer::present::ShownFrame;
use crate::render::vulkan::renderer::{SubmittedFrame, VulkanRenderer};
use crate::render::vulkan::scene::DeviceScene;
use crate::render::{PictureOutputs, Settings};
use crate::tree::Model;
use std::sync::Arc;
use std::time::Instant;

/// Pictures of a window have colors alone.
pub(crate) const WINDOW_OUTPUTS: PictureOutputs = PictureOutputs {
    depth: false,
    normal: false,
    values: false,
};

/// Who may draw the frames of a window. A Vulkan device shows them in any case.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum WindowBackend {
    /// The device; where that is the processor in disguise, the processor's own renderer what it can.
    #[default]
    Auto,
    /// The device alone.
    Vulkan,
    /// The processor alone. Frames that it cannot draw are refused.
    Cpu,
}

/// Models on the device and in memory.
#[derive(Debug)]
pub struct ShownModel<'a> {
    /// The models.
    pub models: &'a [&'a Model],
    /// Copies of the models on the device, with their facts.
    pub scene: &'a mut DeviceScene,
    /// Of each model that is a paged file, its pages: the model stands in for them. `None`, or nothing at the end, for one
    /// that is there as a whole.
    pub pages: &'a mut [Option<PagedModel>],
}

/// Parts of models and pages that are shown in a frame.
struct ShownParts<'a> {
    whole: Vec<(&'a Model, Arc<ModelFacts>)>,
    pages: Vec<&'a PagedModel>,
    scene: &'a mut DeviceScene,
    settings: Settings,
}

impl<'a> ShownModel<'a> {
    /// Readies pages and lists all that is shown.
    ///
    /// # Errors
    /// As [`PagedModel::prepare`]; when device memory runs out.
    fn parts(
        self,
        view: &View,
        settings: &Settings,
        draws_on_device: bool,
    ) -> Result<ShownParts<'a>, Error> {
        let ShownModel {
            models,
            scene,
            pages,
        } = self;
        let is_shown: Vec<bool> = (0..models.len())
            .map(|index| scene.is_shown(index))
            .collect();
        let paged = pages.iter_mut().zip(&is_shown);
        let paged = paged.filter_map(|(own, &is_shown)| own.as_mut().filter(|_| is_shown));
        let settings = prepare_all(paged, view, settings)?;
        let pages: &'a [Option<PagedModel>] = pages;
        let is_paged = |index: usize| pages.get(index).is_some_and(Option::is_some);
        let whole = (0..models.len()).filter(|&index| is_shown[index] && !is_paged(index));
        let whole = whole.map(|index| (models[index], scene.facts_of(index)));
        let whole = whole.collect();
        let all = pages.iter().flatten();
        let pages: Vec<&PagedModel> = (pages.iter().zip(&is_shown))
            .filter_map(|(own, &is_shown)| own.as_ref().filter(|_| is_shown))
            .collect();
        if draws_on_device {
            let drawn = pages.iter().flat_map(|own| own.parts());
            scene.hold(drawn, all.flat_map(PagedModel::resident))?;
        }
        Ok(ShownParts {
            whole,
            pages,
            scene,
            settings,
        })
    }
}

/// The parts of a frame: models that are there as a whole, then pages.
fn facted_parts<'a>(
    whole: &'a [(&'a Model, Arc<ModelFacts>)],
    pages: &[&'a PagedModel],
) -> Vec<FactedModel<'a>> {
    let whole = whole.iter().map(|(model, facts)| FactedModel {
        model,
        facts,
        cut: None,
    });
    let pages = pages.iter().flat_map(|own| own.parts());
    whole.chain(pages.map(|(part, _)| part)).collect()
}

/// Draws the frames of a window of any size, by the backend that the settings of each call for.
#[derive(Debug)]
pub struct WindowRenderer {
    device: VulkanRenderer,
    gpu: Arc<Gpu>,
    backend: WindowBackend,
    cpu: Option<CpuFrames>,
    /// The last picture is one of the processor's.
    is_of_cpu: bool,
    rest: RestPicture,
    /// The last submission that reads a mean of samples.
    rest_reader: Option<FrameTicket>,
    /// Photographs of the next frames.
    photos: Option<Arc<FramePhotos>>,
}

/// Frames that the processor draws.
#[derive(Debug)]
struct CpuFrames {
    renderer: CpuRenderer,
    pictures: Vec<CpuPicture>,
    /// The one that was drawn last.
    last: usize,
}

/// A picture that the processor draws and the device shows.
#[derive(Debug)]
struct CpuPicture {
    image: MappedImage,
    area: DrawnArea,
    /// The last submission that reads it.
    reader: Option<FrameTicket>,
}

impl WindowRenderer {
    /// Readies frames of one pixel, to be resized.
    ///
    /// # Errors
    /// When memory runs out.
    pub fn new(gpu: &Arc<Gpu>, backend: WindowBackend) -> Result<Self, Error> {
        let mut device = VulkanRenderer::new(gpu, 1, 1, WINDOW_OUTPUTS, true)?;
        device.keep_lists(true);
        Ok(Self {
            device,
            gpu: gpu.clone(),
            backend,
            cpu: None,
            is_of_cpu: false,
            rest: RestPicture::default(),
            rest_reader: None,
            photos: None,
        })
    }

    /// Frames that can be on their way at once.
    pub fn in_flight(&self) -> usize {
        self.device.in_flight()
    }

    /// Waits until the next frame can be recorded: [`VulkanRenderer::wait_for_next`].
    ///
    /// # Errors
    /// When the device is lost.
    pub fn wait_for_next(&mut self) -> Result<usize, Error> {
        self.device.wait_for_next()
    }

    /// Sets the costs of drawing on the device: [`VulkanRenderer::set_costs`].
    pub fn set_costs(&mut self, costs: Option<DrawCosts>) {
        self.device.set_costs(costs);
    }

    /// Puts photographs on the surface: [`VulkanRenderer::set_photos`].
    pub fn set_photos(&mut self, photos: Option<DevicePhotos>) {
        self.photos = photos.as_ref().map(|own| own.frame.clone());
        self.device.set_photos(photos);
        self.rest.forget();
    }

    /// Makes pictures of another size from the next frame on.
    ///
    /// # Errors
    /// When a side is 0 or above the device's limit, or memory runs out.
    pub fn resize(&mut self, width: u32, height: u32) -> Result<(), Error> {
        if self.device.size() != [width, height] {
            self.rest.resize();
        }
        self.device.resize(width, height)?;
        if let Some(cpu) = &self.cpu
            && cpu.renderer.size() != [width, height]
        {
            self.cpu = None;
            self.is_of_cpu = false;
        }
        Ok(())
    }

    /// Tells whether the processor draws frames of these settings, and readies its pictures then.
    ///
    /// # Errors
    /// [`Error::Unsupported`] where it is insisted on and cannot; when memory runs out.
    fn is_by_cpu(&mut self, settings: &Settings) -> Result<bool, Error> {
        let size = self.device.size();
        let available = AvailableBackends {
            has_device: self.backend != WindowBackend::Cpu,
            has_cpu: match self.backend {
                WindowBackend::Auto => self.gpu.info().is_cpu(),
                WindowBackend::Vulkan => false,
                WindowBackend::Cpu => true,
            },
            has_reference: false,
        };
        if available.choose(settings, WINDOW_OUTPUTS, size)? != FrameBackend::Cpu {
            return Ok(false);
        }
        if self.cpu.is_none() {
            self.cpu = CpuFrames::new(&self.gpu, size, self.device.in_flight())?;
        }
        match (&self.cpu, self.backend) {
            (Some(_), _) => Ok(true),
            (None, WindowBackend::Cpu) => Err(Error::Unsupported {
                what: "this picture by the processor's renderer",
                why: "the device shows no pictures of this size in mapped memory; use --backend vulkan".into(),
            }),
            (None, _) => Ok(false),
        }
    }

    /// Counts what a frame of these settings would draw, without drawing it: [`VulkanRenderer::predict`].
    pub fn predict(
        &mut self,
        shown: ShownModel<'_>,
        view: &View,
        settings: &Settings,
    ) -> FrameEstimate {
        let is_by_cpu = self.is_by_cpu(settings).is_ok_and(|by_cpu| by_cpu);
        // Where anything fails the frame will say why.
        let Ok(shown) = shown.parts(view, settings, !is_by_cpu) else {
            return FrameEstimate::default();
        };
        let ShownParts {
            whole,
            pages,
            scene,
            settings,
        } = shown;
        let facted = facted_parts(&whole, &pages);
        let generation = generation_of(pages.iter().copied());
        let parts = DrawnParts::new(&facted).with_generation(generation);
        let settings = &settings;
        match &mut self.cpu {
            Some(cpu) if is_by_cpu => {
                let outputs = settings.outputs_of_frame(WINDOW_OUTPUTS);
                match FramePlan::for_processor(settings, parts, view, outputs) {
                    Ok(plan) => cpu.renderer.predict(parts, &plan),
                    Err(_) => FrameEstimate::default(),
                }
            }
            _ => (self.device).predict_parts(parts, scene, view, settings),
        }
    }

    /// Forgets the cut that was chosen for a frame that is not drawn; to be called when the model changes.
    pub fn forget_prediction(&mut self) {
        self.device.forget_prediction();
        if let Some(cpu) = &mut self.cpu {
            cpu.renderer.forget_prediction();
        }
    }

    /// Submits one frame of a model that is drawn, covered by the overlay (if any) and put where `show` says, and does
    /// not wait for it.
    ///
    /// # Errors
    /// As [`VulkanRenderer::draw`]; an acquired image must be abandoned then.
    pub fn submit(
        &mut self,
        shown: ShownModel<'_>,
        view: &View,
        settings: &Settings,
        show: ShownFrame<'_>,
    ) -> Result<SubmittedFrame, Error> {
        self.rest.forget();
        self.is_of_cpu = self.is_by_cpu(settings)?;
        let start = Instant::now();
        let shown = shown.parts(view, settings, !self.is_of_cpu)?;
        let ShownParts {
            whole,
            pages,
            scene,
            settings,
        } = shown;
        let facted = facted_parts(&whole, &pages);
        let generation = generation_of(pages.iter().copied());
        let parts = DrawnParts::new(&facted).with_generation(generation);
        match &mut self.cpu {
            Some(cpu) if self.is_of_cpu => {
                if settings.shows_photos() {
                    given(self.photos.as_ref())?;
                }
                cpu.renderer.set_photos(self.photos.as_ref());
                let times = cpu.draw(&self.device, parts, view, &settings)?;
                submit_picture(&mut self.device, cpu, times, start, show)
            }
            _ => (self.device).submit_shown(parts, scene, view, &settings, show),
        }
    }

    /// Submits a frame that shows the picture of the last frame again, under a new overlay.
    ///
    /// # Errors
    /// When memory runs out or the device is lost; an acquired image must be abandoned then.
    pub fn submit_again(&mut self, show: ShownFrame<'_>) -> Result<SubmittedFrame, Error> {
        let (times, start) = (FrameTimes::default(), Instant::now());
        if let Some(mean) = self.rest.shown() {
            let submitted = self.device.submit_picture(mean, times, start, show)?;
            self.rest_reader = Some(submitted.ticket());
            return Ok(submitted);
        }
        match &mut self.cpu {
            Some(cpu) if self.is_of_cpu => {
                submit_picture(&mut self.device, cpu, times, start, show)
            }
            _ => self.device.submit_again(show),
        }
    }

    /// Tells whether samples would make the picture of the last frame, drawn with these settings, smoother.
    pub fn can_be_smoother(&self, settings: &Settings) -> bool {
        has_mean(settings) && !self.rest.is_over()
    }

    /// Notes that a sample took longer than somebody who waits for an answer would like. After the third the picture stays as it
    /// is, until another frame is drawn.
    pub fn note_slow_sample(&mut self) {
        self.rest.note_slow();
    }

    /// Draws a sample of the last frame, which had this view and these settings; tells whether [`WindowRenderer::submit_again`]
    /// has something smoother to show. Waits for frames on their way.
    ///
    /// # Errors
    /// As [`WindowRenderer::submit`].
    pub fn add_sample(
        &mut self,
        shown: ShownModel<'_>,
        view: &View,
        settings: &Settings,
    ) -> Result<bool, Error> {
        if let Some(reader) = self.rest_reader.take() {
            self.device.wait_for(reader)?;
        }
        let is_of_cpu = self.is_of_cpu;
        let ShownParts {
            whole,
            pages,
            scene,
            settings,
        } = shown.parts(view, settings, !is_of_cpu)?;
        let facted = facted_parts(&whole, &pages);
        let generation = generation_of(pages.iter().copied());
        let request = SampleRequest {
            parts: DrawnParts::new(&facted).with_generation(generation),
            view,
            settings: &settings,
            photos: self.photos.as_ref(),
            device: (!is_of_cpu).then_some((&self.device, scene)),
        };
        self.rest.add_sample(&self.gpu, request)
    }

    /// Submits a frame that shows the background alone: [`VulkanRenderer::submit_background`].
    ///
    /// # Errors
    /// As there.
    pub fn submit_background(
        &mut self,
        background: [f32; 3],
        show: ShownFrame<'_>,
    ) -> Result<SubmittedFrame, Error> {
        self.is_of_cpu = false;
        self.rest.forget();
        self.device.submit_background(background, show)
    }

    /// Waits until a frame is finished on the device and tells what it cost.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn finish(&mut self, submitted: SubmittedFrame) -> Result<FrameTimes, Error> {
        self.device.finish(submitted)
    }

    /// Reads the picture of the last frame, without what covers it.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn read(&mut self, view: &View) -> Result<Image, Error> {
        let [width, height] = self.device.size();
        if let Some(mean) = self.rest.shown_mut() {
            let (words, pitch) = mean.words_mut();
            let rows = words.chunks(pitch).take(height as usize);
            let row = |row: &[u32]| -> Vec<[u8; 4]> {
                row[..width as usize]
                    .iter()
                    .map(|word| word.to_le_bytes())
                    .collect()
            };
            return Ok(Image {
                width,
                height,
                color: rows.flat_map(row).collect(),
                ..Image::default()
            });
        }
        match &mut self.cpu {
            Some(cpu) if self.is_of_cpu => {
                let (words, pitch) = cpu.pictures[cpu.last].image.words_mut();
                let pixels = PixelWords { words, pitch };
                Ok(cpu.renderer.read(view, &pixels, WINDOW_OUTPUTS.depth))
            }
            _ => self.device.read(view),
        }
    }

    /// Reads what the last frame showed, overlay and all. Waits for the device; not for every frame.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn read_shown(&mut self, overlay: Option<&WindowOverlay>) -> Result<Image, Error> {
        let cpu = self.cpu.as_ref().filter(|_| self.is_of_cpu);
        let picture = cpu.map(|cpu| &cpu.pictures[cpu.last].image);
        let picture = self.rest.shown().or(picture);
        self.device.read_shown(overlay, picture)
    }

    /// Finds the view-space distance, along the view direction, of what the last frame, drawn with `view`, shows at pixel
    /// `[x, y]`, or at the nearest covered pixel within 6 pixels; `None` where there is nothing, and outside of the
    /// picture. May wait for the device; not for every frame.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn distance_near(&mut self, view: &View, [x, y]: [u32; 2]) -> Result<Option<f32>, Error> {
        let size = self.device.size();
        if x >= size[0] || y >= size[1] {
            return Ok(None);
        }
        let area = ProbeArea::around([x, y], size);
        let depths = match &self.cpu {
            Some(cpu) if self.is_of_cpu => cpu.renderer.depths_of(area.part()),
            _ => self.device.read_depths(area.part())?,
        };
        let found = area.nearest_covered(&depths);
        Ok(found.map(|depth| view.distance_of_depth(depth)))
    }
}

/// Submits a frame that shows the picture that the processor drew last.
fn submit_picture(
    device: &mut VulkanRenderer,
    cpu: &mut CpuFrames,
    times: FrameTimes,
    start: Instant,
    show: ShownFrame<'_>,
) -> Result<SubmittedFrame, Error> {
    let picture = &mut cpu.pictures[cpu.last];
    let submitted = device.submit_picture(&picture.image, times, start, show)?;
    picture.reader = Some(submitted.ticket());
    Ok(submitted)
}

impl CpuFrames {
    /// Makes so many pictures of a size; none where the device shows no mapped ones of it.
    ///
    /// # Errors
    /// When memory runs out.
    fn new(gpu: &Arc<Gpu>, [width, height]: [u32; 2], count: usize) -> Result<Option<Self>, Error> {
        let mut pictures = Vec::with_capacity(count);
        for index in 0..count {
            let name = format!("picture {index} by the processor");
            let Some(image) = MappedImage::mapped(gpu, &name, width, height)? else {
                return Ok(None);
            };
            pictures.push(CpuPicture {
                image,
                area: DrawnArea::unknown(width, height),
                reader: None,
            });
        }
        let mut renderer = CpuRenderer::new(width, height);
        renderer.keep_frames(true);
        Ok(Some(Self {
            renderer,
            pictures,
            last: 0,
        }))
    }

    /// Draws a frame into the next picture, once no submission reads that.
    ///
    /// # Errors
    /// As [`FramePlan::new`]; when the device is lost.
    fn draw(
        &mut self,
        device: &VulkanRenderer,
        parts: DrawnParts<'_>,
        view: &View,
        settings: &Settings,
    ) -> Result<FrameTimes, Error> {
        let next = (self.last + 1) % self.pictures.len();
        let picture = &mut self.pictures[next];
        if let Some(reader) = picture.reader.take() {
            device.wait_for(reader)?;
        }
        let outputs = settings.outputs_of_frame(WINDOW_OUTPUTS);
        let plan = FramePlan::for_processor(settings, parts, view, outputs)?;
        let (words, pitch) = picture.image.words_mut();
        let pixels = PixelWords { words, pitch };
        let times = (self.renderer).draw(parts, &plan, pixels, &mut picture.area);
        // Else the last picture is the same.
        if times.kept != KeptWork::Lists {
            picture.image.flush();
            self.last = next;
        }
        Ok(times)
    }
}
