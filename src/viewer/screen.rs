//! Frames on the window: two on their way at a time, rebuilt when the window changes.

use crate::gpu::surface::Surface;
use crate::gpu::{Error, Gpu};
use crate::image::Image;
use crate::math::camera::{Camera, View};
use crate::method::renderer::{FrameTimes, Outputs, Renderer, Submitted};
use crate::method::scene::Scene;
use crate::method::{Method, Settings};
use crate::tree::Model;
use glam::DVec2;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

/// Over how many frames the time of a frame is a median.
const FRAMES_OF_MEDIAN: usize = 15;

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shown {
    /// It is on its way to the screen.
    Frame,
    /// The window changed meanwhile; it must be drawn again.
    Again,
    /// The window gave no image.
    Nothing,
}

/// Whether the window can go on without its model after this error: only memory or a limit was exceeded.
pub(super) fn is_survivable(error: &Error) -> bool {
    use ash::vk::Result as R;
    match error {
        Error::Memory { .. } | Error::Limit { .. } => true,
        Error::Vulkan { result, .. } => {
            matches!(
                *result,
                R::ERROR_OUT_OF_DEVICE_MEMORY | R::ERROR_OUT_OF_HOST_MEMORY
            )
        }
        _ => false,
    }
}

/// A frame that was submitted.
#[derive(Debug)]
struct Pending {
    submitted: Submitted,
    start: Instant,
    of_model: bool,
}

/// Draws a model onto a window. Must be dropped before the window.
#[derive(Debug)]
pub(super) struct Screen {
    stage: Option<(Model, Scene)>,
    renderer: Renderer,
    surface: Surface,
    gpu: Arc<Gpu>,
    pending: VecDeque<Pending>,
    last_end: Instant,
    frame_times_ms: VecDeque<f64>,
    times: FrameTimes,
    /// The view that the targets hold.
    drawn: Option<View>,
    /// How the last frame was drawn, and how large: times of others do not go into its median.
    look: Option<(Settings, (u32, u32))>,
    lose_surface_every: Option<u64>,
    acquired: u64,
}

impl Screen {
    pub(super) fn new(gpu: &Arc<Gpu>, window: &glfw::Window, vsync: bool) -> Result<Self, Error> {
        let outputs = Outputs {
            depth: false,
            normal: false,
        };
        // The size is that of the first acquired image.
        let renderer = Renderer::new(gpu, 1, 1, outputs, true)?;
        let surface = Surface::new(gpu, window, renderer.in_flight(), vsync)?;
        Ok(Self {
            stage: None,
            renderer,
            surface,
            gpu: gpu.clone(),
            pending: VecDeque::new(),
            last_end: Instant::now(),
            frame_times_ms: VecDeque::new(),
            times: FrameTimes::default(),
            drawn: None,
            look: None,
            lose_surface_every: None,
            acquired: 0,
        })
    }

    /// For tests: every so many frames the surface counts as lost, or its swapchain as out of date, in turn.
    pub(super) fn lose_surface_every(&mut self, frames: Option<u64>) {
        self.lose_surface_every = frames.filter(|&n| n > 0);
    }

    fn inject_fault(&mut self) {
        self.acquired += 1;
        let Some(every) = self.lose_surface_every else {
            return;
        };
        if self.acquired.is_multiple_of(every) {
            self.surface
                .inject(if !(self.acquired / every).is_multiple_of(2) {
                    ash::vk::Result::ERROR_SURFACE_LOST_KHR
                } else {
                    ash::vk::Result::ERROR_OUT_OF_DATE_KHR
                });
        }
    }

    /// Shows another model from the next frame on. When it does not fit the device the old one stays.
    pub(super) fn set_model(&mut self, model: Model) -> Result<(), Error> {
        let scene = Scene::new(&self.gpu, &model)?;
        self.finish()?;
        self.drop_model();
        self.stage = Some((model, scene));
        Ok(())
    }

    pub(super) fn drop_model(&mut self) {
        self.stage = None;
        self.drawn = None;
        self.frame_times_ms.clear();
        self.times = FrameTimes::default();
    }

    pub(super) fn model(&self) -> Option<&Model> {
        self.stage.as_ref().map(|(model, _)| model)
    }

    pub(super) fn present_mode(&self) -> &'static str {
        self.surface.present_mode()
    }

    /// Median of the last frames, milliseconds: from setting the camera to the finished picture, or from the
    /// end of the frame before where frames overlap.
    pub(super) fn frame_ms(&self) -> f64 {
        super::text::median(self.frame_times_ms.iter().copied())
    }

    /// What the last finished frame cost.
    pub(super) fn times(&self) -> &FrameTimes {
        &self.times
    }

    /// Waits for the oldest frame.
    fn finish_one(&mut self) -> Result<(), Error> {
        let Some(pending) = self.pending.pop_front() else {
            return Ok(());
        };
        let times = self.renderer.finish(pending.submitted)?;
        let end = Instant::now();
        if pending.of_model {
            if self.frame_times_ms.len() == FRAMES_OF_MEDIAN {
                self.frame_times_ms.pop_front();
            }
            let begin = pending.start.max(self.last_end);
            self.frame_times_ms
                .push_back((end - begin).as_secs_f64() * 1e3);
            self.times = times;
        }
        self.last_end = end;
        Ok(())
    }

    /// Waits for all frames.
    pub(super) fn finish(&mut self) -> Result<(), Error> {
        while !self.pending.is_empty() {
            self.finish_one()?;
        }
        Ok(())
    }

    /// Draws the model as the camera sees it that `camera` gives for the size of the window's image, or the
    /// background without one, and presents it.
    pub(super) fn draw(
        &mut self,
        window: &glfw::Window,
        camera: impl FnOnce((u32, u32)) -> Option<Camera>,
        settings: &Settings,
    ) -> Result<Shown, Error> {
        while self.pending.len() >= self.renderer.in_flight() {
            self.finish_one()?;
        }
        let slot = self.renderer.wait_for_next()?;
        let start = Instant::now();
        self.inject_fault();
        let Some(onto) = self.surface.acquire(window, slot)? else {
            return Ok(Shown::Nothing);
        };
        let size = (onto.width, onto.height);
        let mut settings = *settings;
        if settings.method == Method::Points {
            settings.threshold_px = settings.threshold_px.min(self.gpu.info().max_point_size_px);
        }
        if self.look != Some((settings, size)) {
            self.finish()?;
            self.frame_times_ms.clear();
            self.look = Some((settings, size));
        }
        self.drawn = None;
        let outcome = self.renderer.resize(size.0, size.1).and_then(|()| {
            let view = match (camera(size), &self.stage) {
                // A camera of the turntable is always usable.
                (Some(camera), Some((model, _))) => camera.view(model.origin).ok(),
                _ => None,
            };
            match (view, &mut self.stage) {
                (Some(view), Some((model, scene))) => {
                    self.drawn = Some(view);
                    self.renderer
                        .submit_onto(model, scene, &view, &settings, &onto)
                }
                _ => self.renderer.submit_background(settings.background, &onto),
            }
        });
        match outcome {
            Ok(submitted) => {
                let of_model = self.drawn.is_some();
                self.pending.push_back(Pending {
                    submitted,
                    start,
                    of_model,
                });
                let is_shown = self.surface.present(onto)?;
                Ok(if is_shown { Shown::Frame } else { Shown::Again })
            }
            Err(error) => {
                self.drawn = None;
                self.surface.abandon(onto);
                Err(error)
            }
        }
    }

    /// View-space distance of what the last frame shows near a pixel.
    pub(super) fn distance_at(&mut self, at: DVec2) -> Result<Option<f64>, Error> {
        let Some(view) = self.drawn else {
            return Ok(None);
        };
        if !(at.x >= 0.0 && at.y >= 0.0) {
            return Ok(None);
        }
        self.finish()?;
        let distance = self
            .renderer
            .distance_near(&view, at.x as u32, at.y as u32)?;
        Ok(distance.map(f64::from))
    }

    /// The picture of the last frame.
    pub(super) fn read(&mut self) -> Result<Option<Image>, Error> {
        let Some(view) = self.drawn else {
            return Ok(None);
        };
        self.finish()?;
        self.renderer.read(&view).map(Some)
    }
}
