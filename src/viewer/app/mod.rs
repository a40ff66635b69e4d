//! What the window does, without the window: events in, frames out. Given the same events in the same steps, the
//! same pictures.

mod commands;
mod show;

use super::camera::Orbit;
use super::control::Control;
use super::event::{Event, Key, Modifiers};
use super::graph::{History, work_ms};
use super::input::{self, Command, Drag, Gesture, Mouse};
use super::loader::OpenError;
use super::notice::{Notices, Weight};
use super::panel::Facts;
use super::record::Entry;
use super::screen::{Request, Screen, Shown, Way, way_after};
use super::ui::Interface;
use super::{Error, Options, text};
use crate::gpu::messages::Messages;
use crate::gpu::{self, Gpu};
use crate::math::camera::{Camera, Light};
use crate::method::Settings;
use crate::tree::Model;
use commands::Turntable;
use glam::{DVec2, DVec3};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What the app asks of the window around it.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Ask {
    /// Load a model.
    Open(PathBuf),
    /// Put a text into the clipboard.
    Copy(String),
    /// Read the clipboard, and hand it over as [`Event::Paste`].
    Paste,
    /// Switch full screen.
    FullScreen,
    /// Keep the cursor inside, invisible, or let it go.
    HoldCursor(bool),
}

/// After how long without motion the camera rests, seconds.
const REST_S: f64 = 0.15;
/// Radii of the model flown in a second at first.
const FLY_SPEED: f64 = 0.5;
/// How often in a row the device may be lost without a frame between.
const MOST_LOSSES: u32 = 3;
/// Longest time that one step flies, seconds: after a pause nobody is thrown out of the model.
const LONGEST_TICK_S: f64 = 0.2;

/// Flying: how fast, in radii of the model a second.
#[derive(Debug, Clone, Copy)]
struct Fly {
    speed: f64,
    last_at: Option<DVec2>,
}

/// The state of the viewer.
pub(super) struct App {
    pub(super) screen: Screen,
    pub(super) options: Options,
    interface: Interface,
    orbit: Option<Orbit>,
    /// A camera as it was given, until it is moved.
    fixed: Option<Camera>,
    light: Light,
    pub(super) settings: Settings,
    /// Settings that a frame was drawn with.
    good: Option<Settings>,
    control: Option<Control>,
    mouse: Mouse,
    /// Distance of what the drag that goes on has hold of.
    drag_distance: f64,
    /// Where the drag began.
    drag_at: DVec2,
    /// Steps of the wheel since the last frame.
    wheel: f64,
    fly: Option<Fly>,
    held_keys: BTreeSet<Key>,
    is_fast: bool,
    notices: Notices,
    history: History,
    facts: Option<Facts>,
    /// What the window does besides, such as `scan.ply - building nodes 43%`.
    pub(super) status: Option<String>,
    pub(super) name: String,
    pub(super) has_panel: bool,
    has_help: bool,
    pub(super) has_graph: bool,
    pub(super) has_statistics: bool,
    /// The picture of the model is to be drawn anew.
    is_dirty: bool,
    /// What covers it is.
    is_cover_dirty: bool,
    pub(super) is_closing: bool,
    /// Seconds, of the last event or tick.
    time: f64,
    /// When egui wants to be shown again.
    again_at: Option<f64>,
    /// When the camera moved last.
    moved_at: f64,
    turntable: Option<Turntable>,
    /// How often the device was lost since the last frame.
    losses: u32,
    /// Number and time of the frame whose figures are shown.
    shown_figures: (u64, u64),
    /// What the validation layer says of each device that was opened.
    pub(super) messages: Vec<Messages>,
    pub(super) size: (u32, u32),
    /// Frames of a model so far.
    pub(super) frames: u64,
    pub(super) asks: Vec<Ask>,
}

impl App {
    pub(super) fn new(screen: Screen, options: Options) -> Self {
        let control = options
            .frame_ms
            .map(|ms| Control::new(ms, options.settings.threshold_px));
        let messages = vec![screen.gpu().messages().clone()];
        Self {
            screen,
            interface: Interface::default(),
            orbit: None,
            fixed: options.camera.clone(),
            light: options.camera.as_ref().map_or(Light::Point, |c| c.light),
            settings: options.settings,
            good: None,
            control,
            mouse: Mouse::default(),
            drag_distance: 0.0,
            drag_at: DVec2::ZERO,
            wheel: 0.0,
            fly: None,
            held_keys: BTreeSet::new(),
            is_fast: false,
            notices: Notices::default(),
            history: History::default(),
            facts: None,
            status: None,
            name: text::name(&options.model),
            has_panel: options.window.panel,
            has_help: false,
            has_graph: options.window.graph,
            has_statistics: options.window.statistics,
            is_dirty: true,
            is_cover_dirty: true,
            is_closing: false,
            time: 0.0,
            again_at: None,
            moved_at: f64::NEG_INFINITY,
            turntable: None,
            losses: 0,
            shown_figures: (0, 0),
            messages,
            size: (1, 1),
            frames: 0,
            asks: Vec::new(),
            options,
        }
    }

    /// Whether nobody is there to read a message and go on.
    pub(super) fn is_unattended(&self) -> bool {
        self.options.screenshot.is_some()
            || self.options.exit_after_frames.is_some()
            || self.options.turntable.is_some()
    }

    /// Whether something is to be drawn.
    pub(super) fn is_dirty(&self) -> bool {
        self.is_dirty || self.is_cover_dirty
    }

    /// Draws again although nothing has changed: the window lost what it showed.
    pub(super) fn expose(&mut self) {
        self.is_cover_dirty = true;
    }

    /// Whether anything covers the picture.
    pub(super) fn has_cover(&self) -> bool {
        self.has_panel || self.has_help || self.has_graph || !self.notices.list().is_empty()
    }

    pub(super) fn warn(&mut self, message: &str) {
        // Standard error may be gone; the window is there.
        let _ = std::io::Write::write_all(
            &mut std::io::stderr(),
            format!("surfel: {message}\n").as_bytes(),
        );
        self.notices.add(message, Weight::Warning, self.time);
        self.is_cover_dirty = true;
    }

    fn inform(&mut self, message: &str) {
        let _ = std::io::Write::write_all(
            &mut std::io::stderr(),
            format!("surfel: {message}\n").as_bytes(),
        );
        self.notices.add(message, Weight::Info, self.time);
        self.is_cover_dirty = true;
    }

    /// The message that the title tells.
    pub(super) fn failure(&self) -> Option<&str> {
        let last = self.notices.list().last()?;
        (last.weight == Weight::Warning).then_some(last.text.as_str())
    }

    /// A model was loaded, or could not be. Comes with [`Event::Loaded`].
    pub(super) fn loaded(
        &mut self,
        path: &Path,
        result: Result<Model, OpenError>,
    ) -> Result<(), Error> {
        self.status = None;
        self.is_cover_dirty = true;
        let outcome = match result {
            Ok(model) => self
                .screen
                .set_model(model)
                .map_err(|e| Box::new(e) as OpenError),
            Err(error) => Err(error),
        };
        match outcome {
            Ok(()) => {
                let is_another = self.orbit.is_some();
                self.name = text::name(path);
                self.history.clear();
                let orbit = self.options.orbit;
                let Some(model) = self.screen.model() else {
                    return Ok(());
                };
                self.facts = Some(Facts {
                    name: self.name.clone(),
                    triangles: model.triangles.len() as u64,
                    vertices: model.vertices.len() as u64,
                    nodes: (model.tree.nodes.len() + model.tree.leaves.len()) as u64,
                    bytes: model.memory_bytes().total(),
                    is_closed: model.is_closed,
                });
                let center = model.origin + model.orbit_center.as_dvec3();
                let radius = f64::from(model.orbit_radius);
                self.orbit = Some(Orbit::new(center, radius, self.size, orbit));
                if is_another {
                    self.fixed = None;
                }
                if let (Some(camera), Some(orbit)) = (&self.fixed, &mut self.orbit) {
                    orbit.look_as(camera);
                }
                self.is_dirty = true;
                if let Some(folder) = self.options.turntable.clone() {
                    self.start_turntable(folder)?;
                }
                Ok(())
            }
            Err(error) if self.is_unattended() => Err(Error::Open(error)),
            Err(error) => {
                let message = error.to_string();
                let name = path.display().to_string();
                // Most errors name their file.
                self.warn(&if message.contains(&name) {
                    message
                } else {
                    format!("{name}: {message}")
                });
                Ok(())
            }
        }
    }

    /// Handles the events of a step.
    pub(super) fn handle(&mut self, entries: &[Entry]) -> Result<(), Error> {
        for entry in entries {
            self.time = entry.time.max(self.time);
            self.event(&entry.event)?;
        }
        let steps = std::mem::take(&mut self.wheel);
        if steps != 0.0 {
            match &mut self.fly {
                Some(fly) => fly.speed = (fly.speed * 1.2f64.powf(steps)).clamp(1e-4, 100.0),
                None => {
                    let at = self.mouse.position();
                    let distance = self.distance_at(at)?;
                    self.change(|orbit| orbit.zoom(Orbit::wheel_factor(steps), at, distance));
                }
            }
        }
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), Error> {
        let taken = self.interface.event(event, self.has_cover());
        self.is_cover_dirty |= taken.changes;
        if taken.consumed {
            if let Event::Cursor(at) = event {
                let _ = self.mouse.moved(DVec2::from_array(*at));
            }
            return Ok(());
        }
        match event {
            Event::Size { width, height, .. } => {
                self.size = (*width, *height);
                if let Some(orbit) = &mut self.orbit {
                    orbit.resize(self.size);
                }
                self.is_dirty = true;
            }
            Event::Focus(has_focus) => {
                if !has_focus {
                    self.mouse.release();
                    self.held_keys.clear();
                }
            }
            Event::Cursor(at) => {
                let at = DVec2::from_array(*at);
                if let Some(fly) = &mut self.fly {
                    let by = fly.last_at.map(|last| at - last);
                    fly.last_at = Some(at);
                    let _ = self.mouse.moved(at);
                    if let Some(by) = by {
                        self.change(|orbit| orbit.look_around(by));
                    }
                } else if let Some(gesture) = self.mouse.moved(at) {
                    self.gesture(gesture)?;
                }
            }
            Event::Button { .. } if self.fly.is_some() => {}
            Event::Button {
                button,
                pressed,
                modifiers,
            } => {
                let gesture = self.mouse.button(*button, *pressed, *modifiers, self.time);
                if let Some(gesture) = gesture {
                    self.gesture(gesture)?;
                }
            }
            Event::Scroll([_, steps]) => self.wheel += steps,
            Event::Key {
                key,
                pressed,
                repeat,
                modifiers,
            } => self.key(*key, (*pressed, *repeat), *modifiers)?,
            Event::Text('?') => self.command(Command::Help)?,
            Event::Paste(text) => match serde_json::from_str::<Camera>(text) {
                Ok(camera) => self.set_camera(camera),
                Err(error) => self.warn(&format!(
                    "the clipboard holds no camera as Ctrl C or --save-camera writes it: {error}"
                )),
            },
            Event::Drop(path) => {
                if path
                    .extension()
                    .is_some_and(|e| e.eq_ignore_ascii_case("json"))
                {
                    match Camera::read(path) {
                        Ok(camera) => self.set_camera(camera),
                        Err(error) => self.warn(&format!("{}: {error}", path.display())),
                    }
                } else {
                    self.notices.clear();
                    self.asks.push(Ask::Open(path.clone()));
                }
            }
            Event::Tick(seconds) => self.tick(*seconds),
            Event::Frame { ms, threshold_px } => {
                if let Some(control) = &mut self.control {
                    control.frame(*threshold_px, *ms);
                }
            }
            Event::Text(_) | Event::CursorGone | Event::Loaded(_) => {}
        }
        Ok(())
    }

    fn key(
        &mut self,
        key: Key,
        (pressed, repeat): (bool, bool),
        modifiers: Modifiers,
    ) -> Result<(), Error> {
        self.is_fast = modifiers.shift;
        if self.fly.is_some() && matches!(key, Key::Char('w' | 'a' | 's' | 'd' | 'e' | 'q')) {
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
            Some(Command::ThresholdBy(_) | Command::DepthOffsetBy(_) | Command::Splat(_))
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
                    Key::Char('w') => DVec3::NEG_Z,
                    Key::Char('s') => DVec3::Z,
                    Key::Char('a') => DVec3::NEG_X,
                    Key::Char('d') => DVec3::X,
                    Key::Char('e') => DVec3::Y,
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

    /// When a [`Event::Tick`] is due, seconds; none while nothing moves by itself.
    pub(super) fn next_tick(&self) -> Option<f64> {
        let is_flying = self.fly.is_some() && !self.held_keys.is_empty();
        let refines = self.control.as_ref().is_some_and(Control::is_coarse)
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

    fn is_moving(&self) -> bool {
        self.time - self.moved_at < REST_S
    }

    /// Changes the camera, if there is a model.
    fn change(&mut self, change: impl FnOnce(&mut Orbit)) {
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
    fn set_camera(&mut self, camera: Camera) {
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

    /// The camera for a picture of the size that the window has.
    fn camera(&self) -> Option<Camera> {
        let orbit = self.orbit.as_ref()?;
        Some(camera_of(orbit, self.fixed.as_ref(), self.light, self.size))
    }

    /// Distance of what is seen at a pixel, or of the center of rotation where nothing is.
    fn distance_at(&mut self, at: DVec2) -> Result<f64, Error> {
        let Some(orbit) = &self.orbit else {
            return Ok(1.0);
        };
        let away = orbit.pivot_distance();
        Ok(self.probe(at)?.unwrap_or(away))
    }

    /// As [`Screen::distance_at`]; a device that was lost knows nothing, and is noticed by the next frame.
    fn probe(&mut self, at: DVec2) -> Result<Option<f64>, Error> {
        match self.screen.distance_at(at) {
            Err(error) if way_after(&error) != Way::End => Ok(None),
            other => Ok(other?),
        }
    }

    fn gesture(&mut self, gesture: Gesture) -> Result<(), Error> {
        match gesture {
            Gesture::Begin(Drag::Turn, _) => {}
            Gesture::Begin(Drag::Pan | Drag::Zoom, at) => {
                self.drag_distance = self.distance_at(at)?;
                self.drag_at = at;
            }
            Gesture::Move(Drag::Turn, by) => self.change(|orbit| orbit.turn(by)),
            Gesture::Move(Drag::Pan, by) => {
                let distance = self.drag_distance;
                self.change(|orbit| orbit.pan(by, distance));
            }
            Gesture::Move(Drag::Zoom, by) => {
                let (at, distance) = (self.drag_at, self.drag_distance);
                let mut factor = 1.0;
                self.change(|orbit| {
                    factor = orbit.drag_factor(by.y);
                    orbit.zoom(factor, at, distance);
                });
                self.drag_distance *= factor;
            }
            Gesture::DoubleClick(at) => {
                if let Some(distance) = self.probe(at)? {
                    self.change(|orbit| orbit.set_pivot(at, distance));
                }
            }
        }
        Ok(())
    }

    /// What the frames that have finished cost, as events.
    pub(super) fn finished(&mut self) -> Vec<Event> {
        let mut events = Vec::new();
        for frame in self.screen.take_finished() {
            self.history.add(&frame.times);
            if self.control.is_some() && frame.is_moving {
                events.push(Event::Frame {
                    ms: work_ms(&frame.times),
                    threshold_px: frame.threshold_px,
                });
            }
        }
        events
    }

    /// Whether frames have finished that [`finished`](App::finished) has not told of and that matter now.
    pub(super) fn has_finished(&self) -> bool {
        self.control.is_some() && self.screen.has_finished()
    }

    /// What is being done besides; shown in the panel.
    pub(super) fn set_status(&mut self, status: String) {
        if self.status.as_ref() != Some(&status) {
            self.status = Some(status);
            self.is_cover_dirty |= self.has_panel;
        }
    }

    /// Waits for all frames.
    pub(super) fn finish(&mut self, window: Option<&glfw::Window>) -> Result<(), Error> {
        let had_frames = self.screen.has_pending();
        match self.screen.finish() {
            Err(error) if way_after(&error) == Way::NewDevice => {
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

    /// Whether the panel or the graph show another frame than the last.
    fn shows_old_figures(&mut self) -> bool {
        let now = (self.frames, self.screen.frame_ms().to_bits());
        std::mem::replace(&mut self.shown_figures, now) != now
    }

    /// How the next frame is drawn.
    fn effective_settings(&self) -> Settings {
        let mut settings = self.settings;
        if let Some(control) = &self.control
            && settings.has_cut()
            && self.turntable.is_none()
        {
            settings.threshold_px = control.threshold_px().max(settings.threshold_px);
        }
        settings
    }

    /// Draws and presents a frame. Returns whether the window gave an image.
    pub(super) fn draw(&mut self, window: Option<&glfw::Window>) -> Result<bool, Error> {
        match self.try_draw(window) {
            Ok(Shown::Nothing) => Ok(false),
            Ok(Shown::Again) => {
                self.is_cover_dirty = true;
                Ok(true)
            }
            Ok(Shown::Frame) => {
                self.losses = 0;
                Ok(true)
            }
            Err(Error::Gpu(error)) => {
                match way_after(&error) {
                    Way::NewDevice => self.open_new_device(window, error)?,
                    Way::End => return Err(error.into()),
                    // What was asked for cannot be made, and nobody is there to ask for something else.
                    _ if self.is_unattended() => return Err(error.into()),
                    Way::OtherSettings => self.fall_back(&error.to_string()),
                    Way::WithoutModel => self.forget_model(&error.to_string()),
                }
                Ok(true)
            }
            Err(error) => Err(error),
        }
    }

    fn try_draw(&mut self, window: Option<&glfw::Window>) -> Result<Shown, Error> {
        let has_cover = self.has_cover();
        if has_cover {
            self.paint_cover()?;
        }
        let is_new_picture = self.is_dirty || !self.screen.has_picture();
        let settings = self.effective_settings();
        let is_moving = self.is_moving();
        let orbit_is_there = self.orbit.is_some();
        let request = Request {
            window,
            size: self.size,
            settings: &settings,
            is_new_picture,
            has_overlay: self.has_cover(),
            is_moving,
        };
        // The window may have another size already than its events say. That is no input, so the turntable must not
        // learn of it.
        let (screen, orbit) = (&mut self.screen, &self.orbit);
        let (fixed, light) = (&self.fixed, self.light);
        let shown = screen.draw(&request, |size| {
            Some(camera_of(orbit.as_ref()?, fixed.as_ref(), light, size))
        })?;
        if shown == Shown::Nothing {
            return Ok(shown);
        }
        if is_new_picture {
            self.is_dirty = shown == Shown::Again;
            if orbit_is_there && shown == Shown::Frame {
                self.good = Some(self.settings);
                self.frames += 1;
                self.after_frame()?;
            }
        }
        Ok(shown)
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
        self.orbit = None;
        self.facts = None;
        self.is_dirty = true;
        self.warn(message);
    }

    /// The device was lost: opens it again, and puts everything back.
    fn open_new_device(
        &mut self,
        window: Option<&glfw::Window>,
        error: gpu::Error,
    ) -> Result<(), Error> {
        self.losses += 1;
        if self.losses > MOST_LOSSES {
            return Err(Error::DeviceGone(error));
        }
        let gpu: Arc<Gpu> = Gpu::open(&self.options.gpu).map_err(Error::DeviceGone)?;
        self.messages.push(gpu.messages().clone());
        self.screen
            .reopen(&gpu, window)
            .map_err(Error::DeviceGone)?;
        self.is_dirty = true;
        self.warn("the device was lost; it was opened again");
        Ok(())
    }
}

/// The camera for a picture of `size` pixels.
fn camera_of(orbit: &Orbit, fixed: Option<&Camera>, light: Light, size: (u32, u32)) -> Camera {
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
}
