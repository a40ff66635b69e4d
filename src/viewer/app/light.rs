//! The light, and the time that frames are held to: what keys, mouse and panel change of them.

use super::ViewerApp;
use crate::math::camera::HeadlightSource;
use crate::pack::SurfaceLighting;
use crate::render::Settings;
use crate::viewer::choices::{FRAME_TIMES, others};
use crate::viewer::control::FrameBudget;
use crate::viewer::lamp::{AroundAngles, KINDS, LampChange, LightKind};
use glam::DVec2;

/// Degrees that a drag of one pixel moves the lamp.
const DRAG_DEGREES: f64 = 0.5;

impl ViewerApp {
    /// What lights the model.
    pub(super) fn light_kind(&self) -> LightKind {
        LightKind::of(self.light, &self.settings.light)
    }

    /// Lights the model in another way; the lamp is where it was left.
    pub(super) fn set_light(&mut self, kind: LightKind) {
        let light = match kind {
            LightKind::Eye | LightKind::Parallel => {
                self.light = match kind {
                    LightKind::Parallel => HeadlightSource::Directional,
                    _ => HeadlightSource::Point,
                };
                SurfaceLighting::Headlight
            }
            LightKind::Lamp => SurfaceLighting::Phong(self.lamp),
            LightKind::Sphere(sphere) => SurfaceLighting::Sphere(sphere),
        };
        self.wish(Settings {
            light,
            ..self.settings
        });
        self.is_dirty = true;
    }

    /// The light after the present one.
    pub(super) fn next_light(&mut self) {
        if let Some(kind) = others(KINDS, self.light_kind(), false).first() {
            self.set_light(*kind);
        }
    }

    /// Changes the lamp, and turns it on.
    pub(super) fn change_lamp(&mut self, change: LampChange) {
        let Some((around, _)) = self.around() else {
            return;
        };
        match around.changed(self.lamp, change) {
            Some(lamp) => self.lamp = lamp,
            None if matches!(change, LampChange::Distance(_)) => self.inform(
                "the lamp goes with the viewer and has no distance; Shift L lets it stay in the world",
            ),
            None => {}
        }
        self.set_light(LightKind::Lamp);
    }

    /// Moves the lamp by a drag of `by` pixels.
    pub(super) fn drag_lamp(&mut self, by: DVec2) {
        self.change_lamp(LampChange::Turn(DRAG_DEGREES * by.x, -DRAG_DEGREES * by.y));
        // As coarse as a moving camera's: the picture follows the hand.
        self.moved_at = self.time;
        if let Some(control) = &mut self.control {
            control.moved();
        }
    }

    /// What the lamp is moved about, and the model's radius; none without a model.
    pub(super) fn around(&self) -> Option<(AroundAngles, f64)> {
        let sphere = self.screen.orbit_sphere()?;
        let around = AroundAngles::new(sphere.center, sphere.radius, &self.camera()?);
        Some((around, sphere.radius))
    }

    /// Holds frames to another time from now on, milliseconds, or to none.
    pub(super) fn set_frame_time(&mut self, target_ms: Option<f64>) {
        if self.control.as_ref().map(FrameBudget::target_ms) == target_ms {
            return;
        }
        let threshold_px = self.settings.threshold_px;
        self.control = target_ms.map(|ms| FrameBudget::new(ms, threshold_px));
        self.paced.clear();
        self.history.clear();
        // What was coarse for the old time's sake is not any more.
        self.is_dirty = true;
        self.is_cover_dirty = true;
    }

    /// The next time that frames are held to, or the one before.
    pub(super) fn next_frame_time(&mut self, step: i32) {
        let now = self.control.as_ref().map(FrameBudget::target_ms);
        if let Some(next) = others(FRAME_TIMES, now, step < 0).first() {
            self.set_frame_time(*next);
            self.inform(&match next {
                Some(ms) => format!("frames are held to {ms} ms while the view moves"),
                None => "frames take the time that they take".to_owned(),
            });
        }
    }
}
