//! Frames on the window, or on none: two on their way at a time, rebuilt when the window changes or the device is
//! lost.

mod models;
mod pages;
mod photo;
mod photographs;
mod pick;

use super::control::FrameWork;
use super::lamp::same_cost;
use super::ui::PaintedOverlay;
use crate::gpu::overlay::WindowOverlay;
use crate::gpu::surface::WindowSurface;
use crate::gpu::{Error, Gpu};
use crate::image::Image;
use crate::math::camera::{Camera, View};
use crate::projective::frame_photos::FramePhotos;
use crate::render::cost::model::{DrawCosts, PerRasterizer, SplatCosts};
use crate::render::paged_model::PagedModel;
use crate::render::stats::FrameTimes;
use crate::render::vulkan::photos::pool::PhotoPool;
use crate::render::vulkan::renderer::{SubmittedFrame, present::ShownFrame};
use crate::render::vulkan::scene::DeviceScene;
use crate::render::window_renderer::{ShownModel, WindowBackend, WindowRenderer};
use crate::render::{Method, Settings, SplatKind};
use crate::tree::Model;
use ash::vk::Result as R;
use glam::DVec2;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// Over how many frames the time of a frame is a median.
const FRAMES_OF_MEDIAN: usize = 15;

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ShowOutcome {
    /// The frame is on its way to the screen.
    Frame,
    /// The window changed meanwhile; it must be drawn again.
    Again,
    /// The window gave no image.
    Nothing,
}

/// Faults that tests ask for, each every so many frames; 0 is never.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct InjectedFaults {
    /// The surface is lost, or its swapchain out of date, in turn.
    pub surface: u64,
    /// The device is lost.
    pub device: u64,
    /// Device memory runs out.
    pub memory: u64,
}

/// A frame that was submitted.
#[derive(Debug)]
struct PendingFrame {
    submitted: SubmittedFrame,
    start: Instant,
    /// The threshold that it was drawn with; none for one that shows no new picture of the model.
    threshold_px: Option<f32>,
    is_moving: bool,
    work: Option<FrameWork>,
}

/// A frame of the model that has finished.
#[derive(Debug)]
pub(super) struct FinishedPicture {
    pub(super) times: FrameTimes,
    pub(super) threshold_px: f32,
    /// The camera moved.
    pub(super) is_moving: bool,
    /// What was foreseen of it; none where no time is wanted, or it drew no cut.
    pub(super) work: Option<FrameWork>,
}

/// What the next frame shows.
pub(super) struct FrameRequest<'r> {
    /// The window; none where frames are only read back.
    pub(super) window: Option<&'r glfw::Window>,
    /// Size of what is shown where there is no window, pixels.
    pub(super) size: (u32, u32),
    /// How the model is drawn.
    pub(super) settings: &'r Settings,
    /// Draw the model anew, not only what covers it.
    pub(super) is_new_picture: bool,
    /// Cover the picture with the overlay.
    pub(super) has_overlay: bool,
    /// Columns at the left of the window that belong to the overlay alone, pixels.
    pub(super) inset: u32,
    /// The camera moves.
    pub(super) is_moving: bool,
    /// What is foreseen of the frame.
    pub(super) work: Option<FrameWork>,
}

/// Changes of textures that no overlay has yet, since it could not be made.
#[derive(Debug, Default)]
struct WaitingTextures(egui::TexturesDelta);

impl Drop for WaitingTextures {
    fn drop(&mut self) {
        // With the window goes what would show them.
        self.0.clear();
    }
}

/// Draws a model onto a window. Must be dropped before the window.
#[derive(Debug)]
pub(super) struct WindowScreen {
    model: Option<Arc<Model>>,
    /// Models that are drawn with it.
    more: Vec<Arc<Model>>,
    /// Of each model that is a paged file, its pages.
    pages: Vec<Option<PagedModel>>,
    /// A frame waits until its pages are there.
    waits_for_pages: bool,
    /// Of pages that could not be read while a frame waited.
    page_messages: Vec<String>,
    /// Which models are drawn, the first included.
    shown: Vec<bool>,
    scene: Option<DeviceScene>,
    renderer: WindowRenderer,
    backend: WindowBackend,
    overlay: Option<WindowOverlay>,
    textures: WaitingTextures,
    has_overlay: bool,
    surface: Option<WindowSurface>,
    gpu: Arc<Gpu>,
    vsync: bool,
    pending: VecDeque<PendingFrame>,
    last_end: Instant,
    frame_times_ms: VecDeque<f64>,
    times: FrameTimes,
    finished: Vec<FinishedPicture>,
    /// The view that the targets hold.
    drawn: Option<View>,
    /// The targets hold a picture of this size that can be shown again.
    picture: Option<(u32, u32)>,
    /// How the last frame was drawn, and how large: times of others do not go into its median.
    look: Option<(Settings, (u32, u32))>,
    faults: InjectedFaults,
    frames: u64,
    /// What drawing costs on the device.
    costs: Option<DrawCosts>,
    /// Photographs of the next frames, and where they lie on the device.
    photos: Option<Arc<FramePhotos>>,
    photo_pool: Option<Arc<Mutex<PhotoPool>>>,
}

impl WindowScreen {
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        window: Option<&glfw::Window>,
        vsync: bool,
        backend: WindowBackend,
    ) -> Result<Self, Error> {
        // The size is that of the first acquired image.
        let renderer = WindowRenderer::new(gpu, backend)?;
        let surface = window
            .map(|window| WindowSurface::new(gpu, window, renderer.in_flight(), vsync))
            .transpose()?;
        Ok(Self {
            model: None,
            more: Vec::new(),
            pages: Vec::new(),
            waits_for_pages: false,
            page_messages: Vec::new(),
            shown: Vec::new(),
            scene: None,
            renderer,
            backend,
            overlay: None,
            textures: WaitingTextures::default(),
            has_overlay: false,
            surface,
            gpu: gpu.clone(),
            vsync,
            pending: VecDeque::new(),
            last_end: Instant::now(),
            frame_times_ms: VecDeque::new(),
            times: FrameTimes::default(),
            finished: Vec::new(),
            drawn: None,
            picture: None,
            look: None,
            faults: InjectedFaults::default(),
            frames: 0,
            costs: None,
            photos: None,
            photo_pool: None,
        })
    }

    /// Goes on with a device that was opened anew: everything on it is made again. What was on its way is gone.
    pub(super) fn reopen(
        &mut self,
        gpu: &Arc<Gpu>,
        window: Option<&glfw::Window>,
    ) -> Result<(), Error> {
        self.pending.clear();
        // A window takes one surface at a time.
        self.surface = None;
        self.scene = None;
        let mut new = Self::new(gpu, window, self.vsync, self.backend)?;
        new.set_costs(self.costs);
        if self.overlay.is_some() {
            new.overlay = Some(WindowOverlay::new(gpu, new.renderer.in_flight())?);
        }
        let models = self.models();
        if !models.is_empty() {
            new.scene = Some(DeviceScene::of_models(gpu, &models)?);
        }
        // Nothing fails from here on, and nothing is lost.
        let overlays = new.overlay.take().zip(self.overlay.take());
        new.overlay = overlays.map(|(made, old)| made.with_textures_of(old));
        std::mem::swap(&mut new.textures, &mut self.textures);
        new.model = self.model.take();
        new.more = std::mem::take(&mut self.more);
        new.pages = std::mem::take(&mut self.pages);
        new.waits_for_pages = self.waits_for_pages;
        new.shown = vec![true; self.shown.len()];
        (self.shown.iter().enumerate()).for_each(|(i, &is_shown)| new.show(i, is_shown));
        new.faults = self.faults;
        new.frames = self.frames;
        *self = new;
        Ok(())
    }

    /// What drawing costs on the device: see [`WindowRenderer::set_costs`].
    pub(super) fn set_costs(&mut self, costs: Option<DrawCosts>) {
        self.costs = costs;
        self.renderer.set_costs(costs);
    }

    /// What splats of a kind were measured to cost.
    pub(super) fn costs_of(&self, kind: SplatKind) -> Option<PerRasterizer<SplatCosts>> {
        self.costs.as_ref()?.of(kind).copied()
    }

    /// Lets those costs decide how frames are drawn on the device, or else rules of thumb.
    pub(super) fn decide(&mut self, by_costs: bool) {
        self.renderer.set_costs(self.costs.filter(|_| by_costs));
    }

    /// For tests: what goes wrong, and how often.
    pub(super) fn inject(&mut self, faults: InjectedFaults) {
        self.faults = faults;
    }

    /// Makes the faults of the frame that is about to be drawn.
    fn make_faults(&mut self) -> Result<(), Error> {
        self.frames += 1;
        let is_due = |every: u64| every > 0 && self.frames.is_multiple_of(every);
        if is_due(self.faults.surface)
            && let Some(surface) = &mut self.surface
        {
            let turn = self.frames / self.faults.surface;
            surface.inject(if turn.is_multiple_of(2) {
                R::ERROR_OUT_OF_DATE_KHR
            } else {
                R::ERROR_SURFACE_LOST_KHR
            });
        }
        for (every, result) in [
            (self.faults.device, R::ERROR_DEVICE_LOST),
            (self.faults.memory, R::ERROR_OUT_OF_DEVICE_MEMORY),
        ] {
            if is_due(every) {
                return Err(Error::Vulkan {
                    call: "vkQueueSubmit2",
                    object: "a frame".into(),
                    result,
                });
            }
        }
        Ok(())
    }

    pub(super) fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    pub(super) fn present_mode(&self) -> &'static str {
        self.surface
            .as_ref()
            .map_or("none", WindowSurface::present_mode)
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

    /// The frames of the model that have finished since the last call.
    pub(super) fn take_finished(&mut self) -> Vec<FinishedPicture> {
        std::mem::take(&mut self.finished)
    }

    /// Tells whether [`take_finished`](WindowScreen::take_finished) would give any.
    pub(super) fn has_finished(&self) -> bool {
        !self.finished.is_empty()
    }

    /// Tells whether frames are on their way.
    pub(super) fn has_pending(&self) -> bool {
        !self.pending.is_empty()
    }

    /// Tells whether the picture of the last frame can be shown again.
    pub(super) fn has_picture(&self) -> bool {
        self.picture.is_some()
    }

    /// What would be drawn with these settings.
    pub(super) fn predict(&mut self, settings: &Settings, camera: &Camera) -> FrameWork {
        let (Some(model), Some(scene)) = (&self.model, &mut self.scene) else {
            return FrameWork::default();
        };
        let Ok(view) = camera.view(model.origin) else {
            return FrameWork::default();
        };
        let more = self.more.iter().map(Arc::as_ref);
        let models: Vec<&Model> = [&**model].into_iter().chain(more).collect();
        let shown = ShownModel {
            models: &models,
            scene,
            pages: &mut self.pages,
        };
        let foreseen = self.renderer.predict(shown, &view, settings);
        FrameWork {
            visited: foreseen.counts.nodes_visited,
            splats: foreseen.counts.splats,
            triangles: foreseen.counts.triangles,
            pixels: foreseen.pixels,
            is_blended: foreseen.is_blended,
            by_compute: foreseen.by_compute,
            is_free: foreseen.is_free,
            largest_by_compute_px: foreseen.largest_by_compute_px,
            ..FrameWork::default()
        }
    }

    /// What covers the picture from the next frame on.
    pub(super) fn cover(&mut self, painted: PaintedOverlay) -> Result<(), Error> {
        self.textures.0.append(painted.textures);
        let overlay = match &mut self.overlay {
            Some(made) => made,
            none => none.insert(WindowOverlay::new(&self.gpu, self.renderer.in_flight())?),
        };
        let textures = std::mem::take(&mut self.textures.0);
        overlay.set(painted.primitives, textures, painted.pixels_per_point);
        Ok(())
    }

    /// Waits for the oldest frame.
    fn finish_one(&mut self) -> Result<(), Error> {
        let Some(pending) = self.pending.pop_front() else {
            return Ok(());
        };
        let times = self.renderer.finish(pending.submitted)?;
        let end = Instant::now();
        if let Some(threshold_px) = pending.threshold_px {
            if self.frame_times_ms.len() == FRAMES_OF_MEDIAN {
                self.frame_times_ms.pop_front();
            }
            let begin = pending.start.max(self.last_end);
            self.frame_times_ms
                .push_back((end - begin).as_secs_f64() * 1e3);
            self.times = times.clone();
            self.finished.push(FinishedPicture {
                times,
                threshold_px,
                is_moving: pending.is_moving,
                work: pending.work,
            });
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
    /// background without one, and presents it. The picture of the last frame is shown again where no new one is
    /// asked for and the size is the same.
    pub(super) fn draw(
        &mut self,
        request: &FrameRequest<'_>,
        camera: impl FnOnce((u32, u32)) -> Option<Camera>,
    ) -> Result<ShowOutcome, Error> {
        while self.pending.len() >= self.renderer.in_flight() {
            self.finish_one()?;
        }
        let slot = self.renderer.wait_for_next()?;
        let start = Instant::now();
        self.make_faults()?;
        let onto = match (&mut self.surface, request.window) {
            (Some(surface), Some(window)) => match surface.acquire(window, slot)? {
                Some(onto) => Some(onto),
                None => return Ok(ShowOutcome::Nothing),
            },
            _ => None,
        };
        let (width, height) = onto.as_ref().map_or(request.size, |o| (o.width, o.height));
        // The window may have become narrower than its events say.
        let has_inset = request.has_overlay && request.inset < width;
        let inset = u32::from(has_inset) * request.inset;
        let size = (width - inset, height);
        let mut settings = *request.settings;
        if settings.method == Method::Points {
            settings.threshold_px = settings.threshold_px.min(self.gpu.info().max_point_size_px);
        }
        let is_again = !request.is_new_picture && self.picture == Some(size);
        self.has_overlay = request.has_overlay;
        let outcome = if is_again {
            let shown = ShownFrame {
                onto: onto.as_ref(),
                overlay: self.overlay.as_mut().filter(|_| request.has_overlay),
                inset,
            };
            self.renderer.submit_again(shown).map(|s| (s, None))
        } else {
            self.look_as(request, &settings, size).and_then(|()| {
                let overlay = (request.has_overlay, inset);
                self.draw_picture(&settings, size, overlay, onto.as_ref(), camera)
            })
        };
        match outcome {
            Ok((submitted, threshold_px)) => {
                self.pending.push_back(PendingFrame {
                    submitted,
                    start,
                    threshold_px,
                    is_moving: request.is_moving,
                    work: request.work,
                });
                let is_shown = match (&mut self.surface, onto) {
                    (Some(surface), Some(onto)) => surface.present(onto)?,
                    _ => true,
                };
                Ok(if is_shown {
                    ShowOutcome::Frame
                } else {
                    ShowOutcome::Again
                })
            }
            Err(error) => {
                if let (Some(surface), Some(onto)) = (&mut self.surface, onto) {
                    surface.abandon(onto);
                }
                if let Some(overlay) = &mut self.overlay {
                    overlay.invalidate();
                }
                Err(error)
            }
        }
    }

    /// Begins a median of times where the next frame looks other than the last: waits for those on their way. While the
    /// camera moves in a wanted time, every few frames have another threshold; waiting would make each of them late.
    fn look_as(
        &mut self,
        request: &FrameRequest<'_>,
        settings: &Settings,
        size: (u32, u32),
    ) -> Result<(), Error> {
        let mut look = same_cost(settings);
        if request.is_moving && request.work.is_some() {
            look.threshold_px = 0.0;
        }
        if self.look != Some((look, size)) {
            self.finish()?;
            self.frame_times_ms.clear();
            self.look = Some((look, size));
        }
        Ok(())
    }

    fn draw_picture(
        &mut self,
        settings: &Settings,
        size: (u32, u32),
        (has_overlay, inset): (bool, u32),
        onto: Option<&crate::gpu::surface::AcquiredImage>,
        camera: impl FnOnce((u32, u32)) -> Option<Camera>,
    ) -> Result<(SubmittedFrame, Option<f32>), Error> {
        let view = match (camera(size), &self.model) {
            // A camera of the turntable is always usable.
            (Some(camera), Some(model)) => camera.view(model.origin).ok(),
            _ => None,
        };
        if self.picture != Some(size) {
            (self.picture, self.drawn) = (None, None);
        }
        self.renderer.resize(size.0, size.1)?;
        if let (Some(view), true) = (&view, self.waits_for_pages) {
            self.load_pages(view, settings)?;
        }
        let shown = ShownFrame {
            onto,
            overlay: self.overlay.as_mut().filter(|_| has_overlay),
            inset,
        };
        let submitted = match (view, &self.model, &mut self.scene) {
            (Some(view), Some(model), Some(scene)) => {
                let more = self.more.iter().map(Arc::as_ref);
                let models: Vec<&Model> = [&**model].into_iter().chain(more).collect();
                let drawn = ShownModel {
                    models: &models,
                    scene,
                    pages: &mut self.pages,
                };
                let submitted = (self.renderer).submit(drawn, &view, settings, shown)?;
                self.drawn = Some(view);
                (submitted, Some(settings.threshold_px))
            }
            _ => {
                let submitted = self
                    .renderer
                    .submit_background(settings.background, shown)?;
                self.drawn = None;
                (submitted, None)
            }
        };
        self.picture = Some(size);
        Ok(submitted)
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
        let pixel = [at.x as u32, at.y as u32];
        let distance = self.renderer.distance_near(&view, pixel)?;
        Ok(distance.map(f64::from))
    }

    /// The picture of the last frame, without what covers it.
    pub(super) fn read(&mut self) -> Result<Option<Image>, Error> {
        let Some(view) = self.drawn else {
            return Ok(None);
        };
        self.finish()?;
        self.renderer.read(&view).map(Some)
    }

    /// What the last frame showed, with what covers it.
    pub(super) fn read_shown(&mut self) -> Result<Option<Image>, Error> {
        if self.picture.is_none() {
            return Ok(None);
        }
        self.finish()?;
        let overlay = self.overlay.as_ref().filter(|_| self.has_overlay);
        self.renderer.read_shown(overlay).map(Some)
    }
}
