//! The picture of a camera that rests: samples at shifted places, one after the other, whose mean gets smoother. In the end it is
//! that of `surfel render`.

use crate::gpu::image::DeviceImage as MappedImage;
use crate::gpu::{Error, Gpu};
use crate::image::{EVEN_SAMPLES, Image, PictureAccumulator, evenly_by_fours, mean_difference};
use crate::math::camera::View;
use crate::pack::ColorBy;
use crate::projective::frame_photos::FramePhotos;
use crate::render::cpu::picture::{DrawnArea, PixelWords};
use crate::render::cpu::renderer::CpuRenderer;
use crate::render::engine::{LEAST_SAMPLES, SMOOTH_DIFFERENCE, smooth_threshold};
use crate::render::frame_plan::FramePlan;
use crate::render::model_facts::DrawnParts;
use crate::render::vulkan::renderer::VulkanRenderer;
use crate::render::vulkan::scene::DeviceScene;
use crate::render::{PictureOutputs, Settings, SplatKind};
use std::sync::Arc;

/// Numbers of samples after which their mean is shown. After the third it is looked whether they are enough.
const SHOWN_AFTER: [u32; 4] = [4, 16, LEAST_SAMPLES, EVEN_SAMPLES];

/// Slow samples that do not end it.
const MOST_SLOW: u32 = 2;

/// Samples have values, so that only their mean is rounded.
const VALUES: PictureOutputs = PictureOutputs {
    depth: false,
    normal: false,
    values: true,
};

/// A picture that gets smoother.
#[derive(Debug, Default)]
pub(crate) struct RestPicture {
    /// Samples of the first and third quarter, and of the others.
    halves: [PictureAccumulator; 2],
    is_over: bool,
    /// Number of slow samples.
    slow: u32,
    /// The mean that is shown, once one is.
    shown: Option<usize>,
    images: Vec<MappedImage>,
    device: Option<Box<VulkanRenderer>>,
    cpu: Option<CpuSampler>,
}

/// Renderer that draws samples on the processor.
#[derive(Debug)]
struct CpuSampler {
    renderer: Box<CpuRenderer>,
    words: Vec<u32>,
    area: DrawnArea,
}

/// Parts that a sample is drawn of, and the renderer that draws it.
pub(crate) struct SampleRequest<'a> {
    pub(crate) parts: DrawnParts<'a>,
    pub(crate) view: &'a View,
    pub(crate) settings: &'a Settings,
    /// Photographs that the processor puts on the surface, where settings show any.
    pub(crate) photos: Option<&'a Arc<FramePhotos>>,
    /// The device's frames and models; none where the processor draws.
    pub(crate) device: Option<(&'a VulkanRenderer, &'a mut DeviceScene)>,
}

/// Tells whether frames of these settings have a mean that is nearer to the truth: not visibility splats, which are put together
/// from whole pixels, nor filtered ones, which are means already and would be blurred, nor data.
pub(crate) fn has_mean(settings: &Settings) -> bool {
    let shows_light = matches!(settings.color_by, ColorBy::Shading | ColorBy::Primitive);
    let is_filtered = settings.has_cut() && settings.splat == SplatKind::Filtered;
    shows_light && !is_filtered && !settings.draws_visibility() && !settings.holds_cut()
}

impl RestPicture {
    /// Begins anew: another frame was drawn.
    pub(crate) fn forget(&mut self) {
        self.halves = Default::default();
        (self.is_over, self.shown, self.slow) = (false, None, 0);
    }

    /// Notes a slow sample. Few can be slow by chance; after more, none is taken until another frame was drawn.
    pub(crate) fn note_slow(&mut self) {
        self.slow += 1;
        self.is_over |= self.slow > MOST_SLOW;
    }

    /// Forgets all that has a size.
    pub(crate) fn resize(&mut self) {
        *self = Self::default();
    }

    /// Tells whether more samples would make it no smoother.
    pub(crate) fn is_over(&self) -> bool {
        self.is_over
    }

    /// The mean that is shown; none yet, or no more.
    pub(crate) fn shown(&self) -> Option<&MappedImage> {
        self.images.get(self.shown?)
    }

    /// The same, to be read.
    pub(crate) fn shown_mut(&mut self) -> Option<&mut MappedImage> {
        self.images.get_mut(self.shown?)
    }

    /// Number of samples so far.
    fn count(&self) -> u32 {
        self.halves.iter().map(PictureAccumulator::count).sum()
    }

    /// Draws one more sample. Tells whether there is a new mean to be shown. No submission may read the means.
    ///
    /// # Errors
    /// As frames of these settings; when memory runs out.
    pub(crate) fn add_sample(
        &mut self,
        gpu: &Arc<Gpu>,
        request: SampleRequest<'_>,
    ) -> Result<bool, Error> {
        let (width, height) = (request.view.width, request.view.height);
        if self.images.is_empty() {
            for index in 0..2 {
                let name = format!("mean {index} of samples");
                match MappedImage::mapped(gpu, &name, width, height)? {
                    Some(image) => self.images.push(image),
                    None => {
                        self.is_over = true;
                        return Ok(false);
                    }
                }
            }
        }
        let count = self.count();
        let image = self.sample(request, count)?;
        let half = &mut self.halves[(count / 16 % 2) as usize];
        if half.add(&image).is_err() {
            self.resize();
            return Ok(false);
        }
        let count = count + 1;
        if !SHOWN_AFTER.contains(&count) {
            return Ok(false);
        }
        let [one, other] = &self.halves;
        let is_enough = || mean_difference(&one.mean(), &other.mean()) <= SMOOTH_DIFFERENCE;
        self.is_over = count >= EVEN_SAMPLES || count == LEAST_SAMPLES && is_enough();
        let mut all = one.clone();
        if all.join(other).is_err() {
            unreachable!("halves have one size");
        }
        self.put(&all.mean().to_image());
        Ok(true)
    }

    /// Draws the sample of this number.
    fn sample(&mut self, request: SampleRequest<'_>, number: u32) -> Result<Image, Error> {
        let SampleRequest {
            parts,
            view,
            settings,
            photos,
            device,
        } = request;
        let view = &evenly_by_fours(view, number);
        // A threshold that somebody chose stays.
        let smooth = smooth_threshold(settings, parts.facts().kind.is_surface());
        let settings = &Settings {
            threshold_px: match smooth {
                Some(threshold) if settings.threshold_px == 1.0 => threshold,
                _ => settings.threshold_px,
            },
            ..*settings
        };
        match device {
            Some((frames, scene)) => {
                let own = match &mut self.device {
                    Some(made) => made,
                    none => none.insert(Box::new(frames.of_values()?)),
                };
                if own.costs() != frames.costs() {
                    own.set_costs(frames.costs());
                }
                own.set_photos(frames.photos().cloned());
                own.draw_parts(parts, scene, view, settings)?;
                own.read(view)
            }
            None => {
                let (width, height) = (view.width, view.height);
                let own = self.cpu.get_or_insert_with(|| CpuSampler {
                    renderer: Box::new(CpuRenderer::new(width, height).with_outputs(VALUES)),
                    words: vec![0; width as usize * height as usize],
                    area: DrawnArea::unknown(width, height),
                });
                own.renderer.set_photos(photos);
                let outputs = settings.outputs_of_frame(VALUES);
                let plan = FramePlan::for_processor(settings, parts, view, outputs)?;
                let pixels = PixelWords {
                    words: &mut own.words,
                    pitch: width as usize,
                };
                own.renderer.draw(parts, &plan, pixels, &mut own.area);
                let pixels = PixelWords {
                    words: &mut own.words,
                    pitch: width as usize,
                };
                Ok(own.renderer.read(view, &pixels, false))
            }
        }
    }

    /// Shows a mean from now on.
    fn put(&mut self, mean: &Image) {
        let next = self.shown.map_or(0, |last| 1 - last);
        let image = &mut self.images[next];
        let (words, pitch) = image.words_mut();
        let rows = mean.color.chunks(mean.width as usize);
        for (to, from) in words.chunks_mut(pitch).zip(rows) {
            for (to, from) in to.iter_mut().zip(from) {
                *to = u32::from_le_bytes(*from);
            }
        }
        image.flush();
        self.shown = Some(next);
    }
}
