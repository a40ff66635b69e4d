//! The events of a step, and what they change.

use super::draw::{by_page, camera_of};
use super::{FileAsk, LONGEST_TICK_S, REST_S, ViewerApp};
use crate::math::camera::Camera;
use crate::mesh::creases::USUAL_CREASE_DEGREES;
use crate::open::photo_scene::is_photo_scene;
use crate::render::Method;
use crate::render::paged_model::page_reading;
use crate::viewer::ViewerError;
use crate::viewer::camera::OrbitCamera;
use crate::viewer::choices::{self, SurfaceNormals};
use crate::viewer::control::FrameBudget;
use crate::viewer::event::{KeyModifiers, KeyboardKey, ViewerEvent};
use crate::viewer::input::{self, DragAction, KeyCommand, MouseGesture};
use crate::viewer::lamp::LampChange;
use crate::viewer::loader::ModelLoader;
use crate::viewer::record::RecordEntry;
use crate::viewer::recovery::{RecoveryWay, way_after};
use glam::{DVec2, DVec3};
use std::path::{Path, PathBuf};

impl ViewerApp {
    /// Handles the events of a step.
    pub(in crate::viewer) fn handle(&mut self, entries: &[RecordEntry]) -> Result<(), ViewerError> {
        for entry in entries {
            self.time = entry.time.max(self.time);
            self.event(&entry.event)?;
        }
        self.look_at_cursor()?;
        let steps = std::mem::take(&mut self.wheel);
        if steps != 0.0 {
            match &mut self.fly {
                Some(fly) => fly.speed = (fly.speed * 1.2f64.powf(steps)).clamp(1e-4, 100.0),
                None => {
                    let at = self.mouse.position();
                    let distance = self.distance_at(at)?;
                    self.change(|orbit| orbit.zoom(OrbitCamera::wheel_factor(steps), at, distance));
                }
            }
        }
        Ok(())
    }

    fn event(&mut self, event: &ViewerEvent) -> Result<(), ViewerError> {
        let taken = self.interface.event(event, self.has_cover());
        self.is_cover_dirty |= taken.changes;
        if taken.consumed {
            if let ViewerEvent::Cursor(at) = event {
                let at = self.in_picture(*at);
                let _ = self.mouse.moved(at);
            }
            return Ok(());
        }
        match event {
            ViewerEvent::Size { width, height, .. } => {
                self.size = (*width, *height);
                self.lay_out();
                self.is_dirty = true;
            }
            ViewerEvent::Focus(has_focus) => {
                if !has_focus {
                    self.mouse.release();
                    self.release_section();
                    self.held_keys.clear();
                }
            }
            ViewerEvent::Cursor(at) => {
                let at = self.in_picture(*at);
                if let Some(fly) = &mut self.fly {
                    let by = fly.last_at.map(|last| at - last);
                    fly.last_at = Some(at);
                    let _ = self.mouse.moved(at);
                    if let Some(by) = by {
                        self.change(|orbit| orbit.look_around(by));
                    }
                } else if let Some(gesture) = self.mouse.moved(at) {
                    self.gesture(gesture)?;
                } else {
                    self.measuring.cursor_moved();
                    self.look_for_section();
                }
            }
            ViewerEvent::Button { .. } if self.fly.is_some() => {}
            ViewerEvent::Button {
                button,
                pressed,
                modifiers,
            } => {
                let gesture = self.mouse.button(*button, *pressed, *modifiers, self.time);
                if let Some(gesture) = gesture {
                    self.gesture(gesture)?;
                }
                if !pressed {
                    self.release_section();
                }
            }
            ViewerEvent::Scroll([_, steps]) => self.wheel += steps,
            ViewerEvent::Key {
                key,
                pressed,
                repeat,
                modifiers,
            } => self.key(*key, (*pressed, *repeat), *modifiers)?,
            ViewerEvent::Text('?') => self.command(KeyCommand::Help)?,
            ViewerEvent::Paste(text) => match serde_json::from_str::<Camera>(text) {
                Ok(camera) => self.set_camera(camera),
                Err(error) => self.warn(&format!(
                    "the clipboard holds no camera as Ctrl C or --save-camera writes it: {error}"
                )),
            },
            ViewerEvent::Drop(path) if is_photo_scene(path) => self.scene_dropped(path.clone()),
            ViewerEvent::Drop(path) => {
                if path
                    .extension()
                    .is_some_and(|e| e.eq_ignore_ascii_case("json"))
                {
                    match Camera::read(path) {
                        Ok(camera) => self.set_camera(camera),
                        Err(error) => self.warn(&format!("{}: {error}", path.display())),
                    }
                } else {
                    self.open(path.clone(), Vec::new());
                }
            }
            ViewerEvent::DropAll(paths) => {
                if let Some((path, more)) = paths.split_first() {
                    self.open(path.clone(), more.to_vec());
                }
            }
            ViewerEvent::Tick(seconds) => self.tick(*seconds),
            ViewerEvent::Frame {
                ms,
                threshold_px,
                drew,
                parts,
            } => {
                if let Some(control) = &mut self.control {
                    let took = parts.unwrap_or_else(|| (*ms).into());
                    control.frame(*threshold_px, drew, took);
                }
            }
            ViewerEvent::Panel(is_shown) => {
                if !self.options.panel_is_asked {
                    self.has_panel = *is_shown;
                    self.lay_out();
                }
            }
            ViewerEvent::Text(_)
            | ViewerEvent::CursorGone
            | ViewerEvent::Preview(_)
            | ViewerEvent::Loaded(_) => {}
        }
        Ok(())
    }

    fn key(
        &mut self,
        key: KeyboardKey,
        (pressed, repeat): (bool, bool),
        modifiers: KeyModifiers,
    ) -> Result<(), ViewerError> {
        self.is_fast = modifiers.shift;
        if self.fly.is_some() && matches!(key, KeyboardKey::Char('w' | 'a' | 's' | 'd' | 'e' | 'q'))
        {
            if pressed {
                self.held_keys.insert(key);
            } else {
                self.held_keys.remove(&key);
            }
            return Ok(());
        }
        if !pressed {
            return Ok(());
        }
        let command = input::command(key, modifiers);
        // Held keys step thresholds and go through kinds; they switch nothing to and fro.
        let steps = matches!(
            command,
            Some(
                KeyCommand::ThresholdBy(_)
                    | KeyCommand::DepthOffsetBy(_)
                    | KeyCommand::Splat(_)
                    | KeyCommand::Lamp(
                        LampChange::Turn(..)
                            | LampChange::Distance(_)
                            | LampChange::Specular(_)
                            | LampChange::Shininess(_)
                            | LampChange::Ambient(_)
                    )
            )
        );
        match command {
            Some(command) if !repeat || steps => self.command(command),
            _ => Ok(()),
        }
    }

    /// Time has passed.
    fn tick(&mut self, seconds: f64) {
        self.is_cover_dirty |= self.notices.expire(self.time);
        if self.again_at.is_some_and(|at| at <= self.time) {
            self.again_at = None;
            self.is_cover_dirty = true;
        }
        if let Some(fly) = self.fly
            && !self.held_keys.is_empty()
        {
            let mut by = DVec3::ZERO;
            for key in &self.held_keys {
                by += match key {
                    KeyboardKey::Char('w') => DVec3::NEG_Z,
                    KeyboardKey::Char('s') => DVec3::Z,
                    KeyboardKey::Char('a') => DVec3::NEG_X,
                    KeyboardKey::Char('d') => DVec3::X,
                    KeyboardKey::Char('e') => DVec3::Y,
                    _ => DVec3::NEG_Y,
                };
            }
            let speed = fly.speed * if self.is_fast { 4.0 } else { 1.0 };
            let way = by.normalize_or_zero() * speed * seconds.clamp(0.0, LONGEST_TICK_S);
            self.change(|orbit| orbit.fly(way));
        }
        if !self.is_moving()
            && let Some(control) = &mut self.control
            && control.refine()
        {
            self.is_dirty = true;
        }
    }

    /// When a [`ViewerEvent::Tick`] is due, seconds; none while nothing moves by itself.
    pub(in crate::viewer) fn next_tick(&self) -> Option<f64> {
        let is_flying = self.fly.is_some() && !self.held_keys.is_empty();
        let refines = self.control.as_ref().is_some_and(FrameBudget::is_coarse)
            && self.orbit.is_some()
            && self.turntable.is_none();
        let notice = self.notices.next_expiry(self.time);
        [
            is_flying.then_some(self.time),
            refines.then_some(self.moved_at + REST_S),
            self.again_at,
            notice.map(|s| self.time + s),
        ]
        .into_iter()
        .flatten()
        .min_by(f64::total_cmp)
    }

    pub(super) fn is_moving(&self) -> bool {
        self.time - self.moved_at < REST_S
    }

    /// Asks for a model, and for more that are shown with it.
    pub(super) fn open(&mut self, path: PathBuf, more: Vec<PathBuf>) {
        self.notices.clear();
        (self.is_reloading, self.reads_whole) = (false, false);
        self.options.model.clone_from(&path);
        self.options.more.clone_from(&more);
        self.options.model_is_usual = false;
        if more.is_empty() {
            self.take_own_photographs(&path);
        }
        self.asks.push(FileAsk::Open { path, more });
    }

    /// Asks for the models again; they are seen as before. Returns whether that can be.
    pub(super) fn reload(&mut self) -> bool {
        let (path, more) = (self.options.model.clone(), self.options.more.clone());
        if self.shown_files().any(|path| path == Path::new("-")) {
            self.warn("what came from standard input cannot be read again");
            return false;
        }
        self.notices.clear();
        self.is_reloading = true;
        self.keep_photographs();
        self.asks.push(FileAsk::Open { path, more });
        true
    }

    /// Says where models are to be copied to while they are loaded, which normals they are to have, and how much of paged files
    /// is read.
    pub(in crate::viewer) fn tell_device(&self, loader: &mut ModelLoader) {
        let takes_all = self.reads_whole || self.options.photos.scene.is_some();
        loader.read_pages(page_reading(&self.settings, takes_all));
        loader.set_crease(self.crease_degrees());
        loader.copy_to(self.screen.gpu(), self.settings.method == Method::Triangles);
    }

    /// Opens the models again, with all pages of paged files at once: `what` needs them. Returns whether that can be.
    pub(super) fn reload_whole(&mut self, what: &str) -> bool {
        // The scene that is wanted may be another than that which is shown.
        let scene = self.options.photos.scene.take();
        if !self.reload() {
            return false;
        }
        self.reads_whole = true;
        self.options.photos.scene = scene.or(self.options.photos.scene.take());
        self.inform(&format!("{what}: all of the file is read"));
        true
    }

    /// Leaves what needs the whole of paged files, which could not be had.
    pub(super) fn stay_with_pages(&mut self) {
        self.reads_whole = false;
        if self.screen.is_paged() {
            self.options.photos.scene = None;
        }
        if self.screen.needs_whole(&self.settings) {
            self.settings = by_page(&self.settings);
        }
    }

    /// Gives surfaces other normals: the models are opened again, and those that come later have them too.
    pub(super) fn set_normals(&mut self, normals: SurfaceNormals) {
        if normals == self.normals || !self.reload() {
            return;
        }
        self.normals = normals;
        let name = choices::name_of(choices::NORMALS, normals);
        self.inform(&format!("normals of surfaces: {name}; opening again"));
    }

    /// The crease angle that models are opened with: none keeps the normals of their files.
    pub(super) fn crease_degrees(&self) -> Option<f32> {
        let given = self.options.opening.tree.crease_degrees;
        match self.normals {
            SurfaceNormals::File => None,
            SurfaceNormals::Flat => Some(0.0),
            SurfaceNormals::Smooth => Some(
                given
                    .filter(|degrees| *degrees > 0.0)
                    .unwrap_or(USUAL_CREASE_DEGREES),
            ),
        }
    }

    /// Paths of the models that were asked for last.
    pub(in crate::viewer) fn shown_files(&self) -> impl Iterator<Item = &PathBuf> {
        [&self.options.model].into_iter().chain(&self.options.more)
    }

    /// Changes the camera, if there is a model.
    pub(super) fn change(&mut self, change: impl FnOnce(&mut OrbitCamera)) {
        if self.turntable.is_some() {
            return;
        }
        if let Some(orbit) = &mut self.orbit {
            change(orbit);
            self.fixed = None;
            self.moved_at = self.time;
            if let Some(control) = &mut self.control {
                control.moved();
            }
            self.is_dirty = true;
            self.is_cover_dirty = true;
        }
    }

    /// Looks as a camera does that was given.
    pub(super) fn set_camera(&mut self, camera: Camera) {
        if let Err(error) = camera.view(DVec3::ZERO) {
            self.warn(&error.to_string());
            return;
        }
        let light = camera.light;
        self.change(|orbit| orbit.look_as(&camera));
        self.light = light;
        self.fixed = Some(camera);
        self.is_dirty = true;
    }

    /// The camera for the picture that the window shows.
    pub(super) fn camera(&self) -> Option<Camera> {
        let orbit = self.orbit.as_ref()?;
        let size = self.picture_size();
        Some(camera_of(orbit, self.fixed.as_ref(), self.light, size))
    }

    /// Distance of what is seen at a pixel, or of the center of rotation where nothing is.
    fn distance_at(&mut self, at: DVec2) -> Result<f64, ViewerError> {
        let Some(orbit) = &self.orbit else {
            return Ok(1.0);
        };
        let away = orbit.pivot_distance();
        Ok(self.probe(at)?.unwrap_or(away))
    }

    /// As [`WindowScreen::distance_at`](crate::viewer::screen::WindowScreen::distance_at); a device that was lost knows nothing, and is noticed by the next frame.
    fn probe(&mut self, at: DVec2) -> Result<Option<f64>, ViewerError> {
        match self.screen.distance_at(at) {
            Err(error) if way_after(&error) != RecoveryWay::End => Ok(None),
            other => Ok(other?),
        }
    }

    fn gesture(&mut self, gesture: MouseGesture) -> Result<(), ViewerError> {
        match gesture {
            MouseGesture::Begin(DragAction::Turn, at) => {
                self.is_cover_dirty |= self.grab_section(at);
            }
            MouseGesture::Begin(DragAction::Lamp, _) => {}
            MouseGesture::Begin(DragAction::Pan | DragAction::Zoom, at) => {
                self.drag_distance = self.distance_at(at)?;
                self.drag_at = at;
            }
            MouseGesture::Move(DragAction::Turn, _) if self.holds_section() => self.drag_section(),
            MouseGesture::Move(DragAction::Turn, by) => self.change(|orbit| orbit.turn(by)),
            MouseGesture::Move(DragAction::Lamp, by) => self.drag_lamp(by),
            MouseGesture::Move(DragAction::Pan, by) => {
                let distance = self.drag_distance;
                self.change(|orbit| orbit.pan(by, distance));
            }
            MouseGesture::Move(DragAction::Zoom, by) => {
                let (at, distance) = (self.drag_at, self.drag_distance);
                let mut factor = 1.0;
                self.change(|orbit| {
                    factor = orbit.drag_factor(by.y);
                    orbit.zoom(factor, at, distance);
                });
                self.drag_distance *= factor;
            }
            MouseGesture::Measure(at) => self.measure_at(at)?,
            MouseGesture::Click(_) if self.holds_section() => {}
            MouseGesture::Click(at) => self.click_pose(at),
            MouseGesture::DoubleClick(at) => {
                if let Some(distance) = self.probe(at)? {
                    self.change(|orbit| orbit.set_pivot(at, distance));
                }
            }
        }
        Ok(())
    }
}
