//! Frames, and the way on after one that failed.

use super::{MOST_LOSSES, ViewerApp};
use crate::gpu::{self, Gpu};
use crate::math::camera::{Camera, HeadlightSource};
use crate::render::stats::KeptWork;
use crate::render::{Method, Occlusion, Path, Settings, Shading, SplatKind};
use crate::viewer::ViewerError;
use crate::viewer::camera::OrbitCamera;
use crate::viewer::control::{EyePlace, FrameBudget, FrameWork};
use crate::viewer::event::ViewerEvent;
use crate::viewer::graph;
use crate::viewer::pace::{PaceSummary, PacedFrame};
use crate::viewer::recovery::{RecoveryWay, way_after};
use crate::viewer::screen::{FrameRequest, ShowOutcome};
use glam::DVec3;
use std::sync::Arc;
use std::time::Instant;

/// So long the view rests before its picture gets smoother, seconds: hands that turn pause for less.
const REST_S: f64 = 0.25;

/// Settings that pages of every file can be drawn with.
pub(super) fn by_page(settings: &Settings) -> Settings {
    Settings {
        method: Method::Pop,
        patches: None,
        ..*settings
    }
}

/// Settings with another threshold, pixels, and tolerances of error patches in the same proportion.
fn coarser(settings: &Settings, threshold_px: f32) -> Settings {
    let mut coarser = Settings {
        threshold_px,
        ..*settings
    };
    if let Some(rules) = &mut coarser.patches {
        let factor = threshold_px / settings.threshold_px.max(1.0);
        rules.tolerances = rules.tolerances.times(factor.clamp(1.0, 1e3));
    }
    coarser
}

impl ViewerApp {
    /// What the frames that have finished cost, as events.
    pub(in crate::viewer) fn finished(&mut self) -> Vec<ViewerEvent> {
        let mut events = Vec::new();
        // Frames overlap: on a device of its own the longer of the two decides, on a software device both need the
        // same processor.
        let overlaps = self.frames_overlap();
        for frame in self.screen.take_finished() {
            self.history.add(&frame.times);
            tracing::debug!(
                hidden = frame.times.counts.hidden,
                threshold_px = frame.threshold_px,
                cut_ms = frame.times.cut_ms,
                pack_ms = frame.times.pack_ms,
                submit_ms = frame.times.submit_ms,
                passes = ?frame.times.passes,
                "finished"
            );
            let Some(drew) = frame.work else { continue };
            let took = graph::work(&frame.times, overlaps);
            let ms = took.ms();
            if frame.is_moving {
                self.paced.push(PacedFrame {
                    ms,
                    threshold_px: frame.threshold_px,
                    is_finest: frame.threshold_px <= self.settings.threshold_px,
                });
            }
            // What a frame takes over from one before it costs nothing, and tells nothing of the next.
            if frame.times.kept != KeptWork::Nothing {
                continue;
            }
            events.push(ViewerEvent::Frame {
                ms,
                threshold_px: frame.threshold_px,
                drew,
                parts: Some(took),
            });
        }
        events
    }

    /// Tells whether the device works while the processor does.
    fn frames_overlap(&self) -> bool {
        !self.screen.gpu().info().is_cpu()
    }

    /// Tells whether frames have finished that [`finished`](ViewerApp::finished) has not told of and that matter now.
    pub(in crate::viewer) fn has_finished(&self) -> bool {
        self.control.is_some() && self.screen.has_finished()
    }

    /// What is being done besides; shown in the panel.
    pub(in crate::viewer) fn set_status(&mut self, status: String) {
        if self.status.as_ref() != Some(&status) {
            self.status = Some(status);
            self.is_cover_dirty |= self.has_panel;
        }
    }

    /// Waits for all frames.
    pub(in crate::viewer) fn finish(
        &mut self,
        window: Option<&glfw::Window>,
    ) -> Result<(), ViewerError> {
        let had_frames = self.screen.has_pending();
        match self.screen.finish() {
            Err(error) if way_after(&error) == RecoveryWay::NewDevice => {
                self.open_new_device(window, error)
            }
            other => {
                other?;
                // The figures of the last frame are known only now.
                self.is_cover_dirty |=
                    had_frames && (self.has_panel || self.has_graph) && self.shows_old_figures();
                Ok(())
            }
        }
    }

    /// Tells whether the panel or the graph show another frame than the last.
    fn shows_old_figures(&mut self) -> bool {
        let now = (self.frames, self.screen.frame_ms().to_bits());
        std::mem::replace(&mut self.shown_figures, now) != now
    }

    /// How the next frame is drawn, a new picture of a moving camera as coarsely as the wanted time asks for; and what it
    /// will draw, where a time is wanted.
    fn effective_settings(&mut self, is_new_picture: bool) -> (Settings, Option<FrameWork>) {
        let mut settings = self.settings;
        if self.is_preview {
            // Points are all it has.
            settings.method = Method::Pop;
            settings.splat = SplatKind::Disc;
            (settings.blend, settings.shading) = (None, Shading::PerSplat);
        } else if self.screen.needs_whole(&settings) {
            // Until the whole has come.
            settings = by_page(&settings);
        }
        if settings.holds_cut() {
            settings.threshold_px = self.held_px;
            return (settings, None);
        }
        let is_planned = is_new_picture && self.is_moving();
        let camera = self.camera();
        let holds = settings.has_cut() && self.turntable.is_none();
        // What holds the time chooses the way itself, by what frames took; costs would change it from frame to frame.
        let is_held = holds && self.control.is_some() && camera.is_some();
        self.screen.decide(!is_held);
        if let (Some(control), Some(camera)) = (&mut self.control, camera)
            && holds
        {
            // Looking for what is hidden saves time, but takes one that counts of a cut do not tell.
            if settings.occlusion == Occlusion::Auto {
                settings.occlusion = Occlusion::Off;
            }
            let screen = &mut self.screen;
            let place = screen.orbit_sphere().map_or([0.0; 6], |sphere| {
                place_of(&camera, sphere.center, sphere.radius)
            });
            control.know(screen.costs_of(settings.splat));
            let px = if is_planned {
                control.plan(place, |px| screen.predict(&coarser(&settings, px), &camera))
            } else {
                control.threshold_px()
            };
            settings = coarser(&settings, px.max(settings.threshold_px));
            let mut work = is_new_picture.then(|| self.screen.predict(&settings, &camera));
            if let (true, Some(work)) = (is_planned, &mut work) {
                // Of the drawn frame only this is comparable with what is foreseen of others.
                (work.counted, work.place) = (control.counted(), place);
                if work.is_free {
                    work.by_compute = control.by_compute();
                    settings.path = if work.by_compute {
                        Path::Compute
                    } else {
                        Path::Raster
                    };
                }
            }
            return (settings, work);
        }
        (settings, None)
    }

    /// How well the frames so far kept the wanted time; none where none is wanted.
    pub(in crate::viewer) fn pace(&self) -> Option<PaceSummary> {
        let control = self.control.as_ref()?;
        Some(PaceSummary::of(&self.paced, control.target_ms()))
    }

    /// Tells whether a time of frames is wanted.
    pub(in crate::viewer) fn is_paced(&self) -> bool {
        self.control.is_some()
    }

    /// Draws and presents a frame. Returns whether the window gave an image.
    pub(in crate::viewer) fn draw(
        &mut self,
        window: Option<&glfw::Window>,
    ) -> Result<bool, ViewerError> {
        match self.try_draw(window) {
            Ok(ShowOutcome::Nothing) => Ok(false),
            Ok(ShowOutcome::Again) => {
                self.is_cover_dirty = true;
                Ok(true)
            }
            Ok(ShowOutcome::Frame) => {
                self.losses = 0;
                Ok(true)
            }
            Err(ViewerError::Gpu(error)) => {
                match way_after(&error) {
                    RecoveryWay::NewDevice => self.open_new_device(window, error)?,
                    RecoveryWay::End => return Err(error.into()),
                    // What was asked for cannot be made, and nobody is there to ask for something else.
                    _ if self.is_unattended() => return Err(error.into()),
                    RecoveryWay::OtherSettings => self.fall_back(&error.to_string()),
                    RecoveryWay::WithoutModel => self.forget_model(&error.to_string()),
                }
                Ok(true)
            }
            Err(error) => Err(error),
        }
    }

    fn try_draw(&mut self, window: Option<&glfw::Window>) -> Result<ShowOutcome, ViewerError> {
        // Where nothing covers the picture there is nothing to paint anew, only to show once more.
        let was_dirty = self.is_cover_dirty;
        self.leave_pose();
        if self.has_cover() {
            self.paint_cover()?;
        } else {
            self.is_cover_dirty = false;
        }
        let is_new_picture = self.is_dirty || !self.screen.has_picture();
        if is_new_picture {
            self.save_awaited_before_change()?;
        }
        if !self.is_reloading
            && self.screen.needs_whole(&self.settings)
            && !self.reload_whole("this way to draw needs the whole model")
        {
            self.settings = by_page(&self.settings);
        }
        let (settings, work) = self.effective_settings(is_new_picture);
        let settings = self.choose_photographs(settings)?;
        let is_moving = self.is_moving();
        let is_held = is_moving && work.is_some();
        let orbit_is_there = self.orbit.is_some();
        let request = FrameRequest {
            window,
            size: self.size,
            settings: &settings,
            is_new_picture,
            has_overlay: self.has_cover(),
            inset: self.inset(),
            is_moving,
            work,
        };
        // The window may have another size already than its events say. That is no input, so the turntable must not
        // learn of it.
        let (screen, orbit) = (&mut self.screen, &self.orbit);
        let (fixed, light) = (&self.fixed, self.light);
        let shown = screen.draw(&request, |size| {
            Some(camera_of(orbit.as_ref()?, fixed.as_ref(), light, size))
        })?;
        if shown == ShowOutcome::Nothing {
            self.is_cover_dirty |= was_dirty;
            return Ok(shown);
        }
        if is_held && !self.frames_overlap() {
            // The device works with the processor: a cut that is chosen meanwhile takes longer by what it
            // waits for the device, which is no work of its frame, and the frame is not done sooner.
            self.screen.finish()?;
        }
        if is_new_picture {
            self.drawn_with = Some((settings, Instant::now()));
            self.is_dirty = shown == ShowOutcome::Again;
            self.sharpen_photographs();
            if orbit_is_there && shown == ShowOutcome::Frame {
                self.frames += 1;
                self.await_samples_of_frame()?;
                if !self.is_preview {
                    self.good = Some(self.settings);
                    self.after_frame()?;
                }
            }
        }
        Ok(shown)
    }

    /// How long until the resting picture may get smoother, seconds; none where it may not.
    pub(in crate::viewer) fn smooths_in(&self) -> Option<f64> {
        let (settings, at) = self.drawn_with.as_ref()?;
        let smoothing = self.options.smoothing;
        // A coarse frame is followed by a fine one. Else the time since the last frame tells rest: without events the time of
        // the last event, by which a camera moves, stands still.
        let is_coarse = self.control.as_ref().is_some_and(FrameBudget::is_coarse);
        let may = self.becomes_smooth()
            && !(self.is_dirty() || is_coarse)
            && self.screen.can_be_smoother(smoothing, settings);
        let rest = REST_S - at.elapsed().as_secs_f64();
        may.then_some(rest.max(0.0))
    }

    /// Draws a sample of the resting picture.
    pub(in crate::viewer) fn smooth(
        &mut self,
        window: Option<&glfw::Window>,
    ) -> Result<(), ViewerError> {
        let Some((settings, _)) = self.drawn_with else {
            return Ok(());
        };
        match self.screen.add_sample(self.options.smoothing, &settings) {
            // Shown again, nothing else.
            Ok(true) => {
                self.is_cover_dirty = true;
                Ok(())
            }
            Ok(false) => Ok(()),
            Err(error) if way_after(&error) == RecoveryWay::NewDevice => {
                self.open_new_device(window, error)
            }
            // The frame as it is stays.
            Err(_) => {
                self.drawn_with = None;
                Ok(())
            }
        }
    }

    /// The settings cannot be drawn with: back to the last that could.
    fn fall_back(&mut self, message: &str) {
        let plain = Settings {
            threshold_px: self.settings.threshold_px.min(64.0),
            background: self.settings.background,
            ..Settings::default()
        };
        let next = match self.good {
            Some(good) if good != self.settings => good,
            _ => plain,
        };
        if next == self.settings {
            self.forget_model(message);
            return;
        }
        self.settings = next;
        self.good = None;
        self.is_dirty = true;
        self.warn(message);
    }

    /// Without the model there is room again, and the window still opens others.
    fn forget_model(&mut self, message: &str) {
        self.screen.drop_model();
        self.photographs = Default::default();
        self.orbit = None;
        self.is_preview = false;
        self.facts = None;
        self.is_dirty = true;
        self.warn(message);
    }

    /// The device was lost: opens it again, and puts everything back.
    fn open_new_device(
        &mut self,
        window: Option<&glfw::Window>,
        error: gpu::Error,
    ) -> Result<(), ViewerError> {
        self.losses += 1;
        if self.losses > MOST_LOSSES {
            return Err(ViewerError::DeviceGone(error));
        }
        let gpu: Arc<Gpu> = Gpu::open(&self.options.gpu).map_err(ViewerError::DeviceGone)?;
        self.messages.push(gpu.messages().clone());
        self.screen
            .reopen(&gpu, window)
            .map_err(ViewerError::DeviceGone)?;
        self.photographs_lost_device();
        self.is_dirty = true;
        self.warn("the device was lost; it was opened again");
        Ok(())
    }
}

/// The camera for a picture of `size` pixels.
pub(super) fn camera_of(
    orbit: &OrbitCamera,
    fixed: Option<&Camera>,
    light: HeadlightSource,
    size: (u32, u32),
) -> Camera {
    let mut camera = match fixed {
        Some(camera) => fit(camera, size),
        None => {
            let mut orbit = orbit.clone();
            orbit.resize(size);
            orbit.camera()
        }
    };
    camera.light = light;
    camera
}

/// From where a camera sees a model.
fn place_of(camera: &Camera, center: DVec3, radius: f64) -> EyePlace {
    let world = camera.view.inverse();
    let eye = (world.w_axis.truncate() - center) / radius.max(f64::MIN_POSITIVE);
    let toward = -world.z_axis.truncate().normalize_or_zero();
    [eye.x, eye.y, eye.z, toward.x, toward.y, toward.z]
}

/// `camera` for a picture of `size` pixels: the same height is seen, and pixels stay as square as they were.
fn fit(camera: &Camera, (width, height): (u32, u32)) -> Camera {
    let mut fitted = camera.clone();
    let aspect = |w: u32, h: u32| f64::from(w) / f64::from(h);
    if u64::from(width) * u64::from(camera.height) != u64::from(height) * u64::from(camera.width) {
        fitted.proj.x_axis.x *= aspect(camera.width, camera.height) / aspect(width, height);
    }
    (fitted.width, fitted.height) = (width, height);
    fitted
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patches::{ErrorTolerances, PatchRules};

    #[test]
    fn a_camera_that_is_fitted_keeps_its_height_and_square_pixels() {
        let camera = Camera::orbit((400, 300), DVec3::ZERO, 1.0, 0.3, 0.2, 1.0);
        assert_eq!(fit(&camera, (400, 300)), camera);
        let double = fit(&camera, (800, 600));
        assert_eq!((double.proj, double.width), (camera.proj, 800));
        let wide = fit(&camera, (900, 300));
        assert_eq!(wide.proj.y_axis, camera.proj.y_axis);
        let square = wide.proj.x_axis.x * 900.0 / (wide.proj.y_axis.y * 300.0);
        assert!((square - 1.0).abs() < 1e-12);
    }

    #[test]
    fn coarser_frames_have_coarser_patches_too() {
        let settings = Settings {
            threshold_px: 2.0,
            patches: Some(PatchRules::default()),
            ..Settings::default()
        };
        let tolerances = |px| coarser(&settings, px).patches.map(|rules| rules.tolerances);
        assert_eq!(tolerances(2.0), Some(ErrorTolerances::default()));
        assert_eq!(tolerances(8.0), Some(ErrorTolerances::within(1.0)));
        assert_eq!(coarser(&settings, 8.0).threshold_px, 8.0);
    }
}
