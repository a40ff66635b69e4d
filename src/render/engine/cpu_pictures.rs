//! Pictures of the processor's fast renderer.

use crate::gpu::Error;
use crate::image::Image;
use crate::math::camera::View;
use crate::render::PictureOutputs;
use crate::render::cpu::picture::{DrawnArea, PixelWords};
use crate::render::cpu::renderer::CpuRenderer;
use crate::render::engine::picture_backend::{PictureBackend, PictureRequest, VALUES};
use crate::render::frame_plan::FramePlan;
use crate::render::photo_look::given;
use crate::render::stats::FrameTimes;
use std::time::Instant;

/// Pictures that the processor draws.
#[derive(Debug)]
pub(super) struct CpuPictures {
    frames: CpuTarget,
    /// Draws what is averaged, once anything was.
    samples: Option<CpuTarget>,
}

impl CpuPictures {
    /// Pictures of this size, with these outputs.
    pub(super) fn new(size: [u32; 2], outputs: PictureOutputs) -> Self {
        Self {
            frames: CpuTarget::new(size, outputs),
            samples: None,
        }
    }

    /// Width and height of pictures, pixels.
    pub(super) fn size(&self) -> [u32; 2] {
        self.frames.renderer.size()
    }
}

impl PictureBackend for CpuPictures {
    fn draw(&mut self, frame: PictureRequest<'_>) -> Result<FrameTimes, Error> {
        self.frames.draw(frame)
    }

    fn read(&mut self, view: &View) -> Result<Image, Error> {
        Ok(self.frames.read(view))
    }

    fn sample(&mut self, frame: PictureRequest<'_>, size: [u32; 2]) -> Result<Image, Error> {
        let old = self.samples.take();
        let old = old.filter(|own| own.renderer.size() == size);
        let new = || CpuTarget::new(size, VALUES);
        let samples = self.samples.insert(old.unwrap_or_else(new));
        samples.draw(frame)?;
        Ok(samples.read(frame.view))
    }

    fn keep_lists(&mut self, keep: bool) {
        self.frames.renderer.keep_frames(keep);
    }
}

/// A renderer of the processor, and the picture that it draws into.
#[derive(Debug)]
struct CpuTarget {
    renderer: Box<CpuRenderer>,
    outputs: PictureOutputs,
    words: Vec<u32>,
    area: DrawnArea,
}

impl CpuTarget {
    /// Pictures of this size, with these outputs.
    fn new([width, height]: [u32; 2], outputs: PictureOutputs) -> Self {
        let renderer = CpuRenderer::new(width, height).with_outputs(outputs);
        Self {
            renderer: Box::new(renderer),
            outputs,
            words: Vec::new(),
            area: DrawnArea::unknown(width, height),
        }
    }

    /// Draws a frame, with these photographs where its settings show any.
    ///
    /// # Errors
    /// When the view has another size, or what cannot be drawn is asked for.
    fn draw(
        &mut self,
        PictureRequest {
            parts,
            view,
            settings,
            photos,
        }: PictureRequest<'_>,
    ) -> Result<FrameTimes, Error> {
        let [width, height] = self.renderer.size();
        for (what, value, limit) in [
            ("the width of the view", view.width, width),
            ("the height of the view", view.height, height),
        ] {
            if value != limit {
                return Err(Error::Limit {
                    what: what.into(),
                    value: u64::from(value),
                    limit: u64::from(limit),
                });
            }
        }
        self.words.resize(width as usize * height as usize, 0);
        let start = Instant::now();
        let outputs = settings.outputs_of_frame(self.outputs);
        let plan = FramePlan::for_processor(settings, parts, view, outputs)?;
        if plan.settings.shows_photos() {
            given(photos)?;
        }
        self.renderer.set_photos(photos);
        let pixels = PixelWords {
            words: &mut self.words,
            pitch: width as usize,
        };
        let mut times = self.renderer.draw(parts, &plan, pixels, &mut self.area);
        times.starts.frame = Some(start);
        times.frame_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(times)
    }

    /// The picture of the last frame.
    fn read(&mut self, view: &View) -> Image {
        let [width, _] = self.renderer.size();
        let pixels = PixelWords {
            words: &mut self.words,
            pitch: width as usize,
        };
        self.renderer.read(view, &pixels, self.outputs.depth)
    }
}
