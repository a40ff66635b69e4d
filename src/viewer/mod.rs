//! The window: opens at once, loads on another thread, draws only when something has changed.
//!
//! [`camera`], [`input`], [`loader`] and [`text`] know nothing of Vulkan; `screen` draws frames onto the
//! window; this file ties them together. The main thread owns window and device.

pub mod camera;
pub mod input;
pub mod loader;
mod screen;
pub mod text;

use crate::draw::ColorBy;
use crate::gpu::messages::Messages;
use crate::gpu::{self, Gpu};
use crate::method::{Culling, Settings};
use crate::tree::Model;
use camera::Orbit;
use glam::DVec2;
use glfw::{Action, ClientApiHint, GlfwReceiver, PWindow, WindowEvent, WindowHint, WindowMode};
use input::{Command, Drag, Gesture, Mouse};
use loader::{Loader, Open, OpenError};
use screen::{Screen, Shown};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Why the window closed early.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no window system, or it gives no window.
    #[error("cannot open a window: {0}. Pictures without a window: surfel render")]
    Window(String),
    /// The device failed.
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    /// The model that a picture was asked of could not be opened.
    #[error("{0}")]
    Open(OpenError),
    /// The picture could not be written.
    #[error(transparent)]
    Image(#[from] crate::image::Error),
    /// The window was closed before the picture that was asked for.
    #[error("the window was closed before the picture was made")]
    Closed,
    /// The validation layer found faults.
    #[error("the validation layer found {count} fault(s); the first: {first}")]
    Validation {
        /// How many.
        count: usize,
        /// The first.
        first: String,
    },
}

/// What to show and how.
#[derive(Debug, Clone)]
pub struct Options {
    /// Model to open, or `generate:SHAPE`.
    pub model: PathBuf,
    /// Size of the window, in the window system's units.
    pub size: (u32, u32),
    /// First view: azimuth and elevation in radians, and fill.
    pub orbit: (f64, f64, f64),
    /// How the model is drawn at first.
    pub settings: Settings,
    /// Wait for the screen, so that nothing tears.
    pub vsync: bool,
    /// Which device; its surface extensions are set here.
    pub gpu: gpu::Options,
    /// Write the first whole picture of the model here and close.
    pub screenshot: Option<PathBuf>,
    /// Close after so many frames of the model, drawn one after the other.
    pub exit_after_frames: Option<u64>,
    /// For tests: treat the surface as lost every so many frames.
    #[doc(hidden)]
    pub lose_surface_every: Option<u64>,
}

/// Opens the window and returns when it is closed. `open` loads models, on another thread; `should_stop` is
/// asked now and then (Ctrl-C). Must be called on the main thread.
///
/// A model that cannot be opened is told in the title and on standard error, and the window stays open for
/// another, unless a picture of it was asked for.
///
/// # Errors
/// When there is no window or device, the device is lost, or [`Options::screenshot`] cannot be made.
pub fn run(options: Options, open: Arc<Open>, should_stop: &dyn Fn() -> bool) -> Result<(), Error> {
    let mut loader = Loader::new(open);
    let mut messages = None;
    let outcome = show(options, &mut loader, &mut messages, should_stop);
    // The window is gone by now; whatever still loads stops.
    loader.stop();
    outcome?;
    match messages
        .map(|m: Messages| m.list())
        .unwrap_or_default()
        .as_slice()
    {
        [] => Ok(()),
        all @ [first, ..] => Err(Error::Validation {
            count: all.len(),
            first: format!("{}: {}", first.id, first.text),
        }),
    }
}

/// How long the event loop sleeps at most while a model is loaded, seconds.
const LOADING_WAIT_S: f64 = 0.05;
/// How long it sleeps at most when nothing happens, seconds: Ctrl-C is noticed after that.
const IDLE_WAIT_S: f64 = 0.5;
/// Largest threshold that the keys set, pixels.
const LARGEST_THRESHOLD_PX: f32 = 4096.0;
/// Least time between two titles while frames are drawn.
const TITLE_INTERVAL: Duration = Duration::from_millis(250);

fn show(
    mut options: Options,
    loader: &mut Loader,
    messages: &mut Option<Messages>,
    should_stop: &dyn Fn() -> bool,
) -> Result<(), Error> {
    // GLFW tells causes through a callback only.
    let cause = std::rc::Rc::new(std::cell::RefCell::new(String::new()));
    let noted = cause.clone();
    let mut glfw = glfw::init(move |error, text| {
        tracing::debug!("glfw: {error:?}: {text}");
        *noted.borrow_mut() = text;
    })
    .map_err(|error| window_error(&error.to_string(), &cause.borrow()))?;
    glfw.window_hint(WindowHint::ClientApi(ClientApiHint::NoApi));
    let (width, height) = options.size;
    let name = text::name(&options.model);
    let (mut window, events) = glfw
        .create_window(
            width,
            height,
            &text::loading(&name, "opening"),
            WindowMode::Windowed,
        )
        .ok_or_else(|| window_error("the window system gave none", &cause.borrow()))?;
    window.set_key_polling(true);
    window.set_mouse_button_polling(true);
    window.set_cursor_pos_polling(true);
    window.set_scroll_polling(true);
    window.set_drag_and_drop_polling(true);
    window.set_framebuffer_size_polling(true);
    window.set_refresh_polling(true);
    window.set_iconify_polling(true);
    window.set_focus_polling(true);
    let start_error = loader.start(&options.model).err();
    options.gpu.surface_extensions = glfw
        .get_required_instance_extensions()
        .ok_or_else(|| window_error("Vulkan cannot draw into windows here", &cause.borrow()))?;
    let gpu = Gpu::open(&options.gpu)?;
    *messages = Some(gpu.messages().clone());
    let mut screen = Screen::new(&gpu, &window, options.vsync)?;
    screen.lose_surface_every(options.lose_surface_every);
    let mut viewer = Viewer {
        screen,
        gpu,
        orbit: None,
        settings: options.settings,
        mouse: Mouse::default(),
        drag_distance: 0.0,
        drag_at: DVec2::ZERO,
        wheel: 0.0,
        name,
        title: String::new(),
        title_time: Instant::now(),
        has_statistics: true,
        failure: None,
        is_dirty: true,
        is_iconified: false,
        is_closing: false,
        frames: 0,
        options,
        window,
        events,
    };
    if let Some(error) = start_error {
        viewer.fail(&format!("cannot start to load: {error}"));
    }
    viewer.run(&mut glfw, loader, should_stop)
}

fn window_error(what: &str, cause: &str) -> Error {
    let cause = cause.lines().next().unwrap_or_default();
    Error::Window(match cause {
        "" => what.to_owned(),
        cause => format!("{what} ({cause})"),
    })
}

/// The open window. Fields are dropped in order: what is on the device, then the window.
struct Viewer {
    screen: Screen,
    gpu: Arc<Gpu>,
    window: PWindow,
    events: GlfwReceiver<(f64, WindowEvent)>,
    options: Options,
    orbit: Option<Orbit>,
    settings: Settings,
    mouse: Mouse,
    /// Distance of what the drag that goes on has hold of.
    drag_distance: f64,
    /// Where the drag began.
    drag_at: DVec2,
    /// Steps of the wheel since the last frame.
    wheel: f64,
    name: String,
    title: String,
    title_time: Instant,
    has_statistics: bool,
    /// What the title tells instead of the model, until something is done.
    failure: Option<String>,
    is_dirty: bool,
    is_iconified: bool,
    is_closing: bool,
    /// Frames of a model so far.
    frames: u64,
}

impl Viewer {
    fn run(
        &mut self,
        glfw: &mut glfw::Glfw,
        loader: &mut Loader,
        should_stop: &dyn Fn() -> bool,
    ) -> Result<(), Error> {
        let mut has_drawn = true;
        while !(self.is_closing || self.window.should_close() || should_stop()) {
            let can_draw = self.is_dirty && !self.is_iconified && self.has_area();
            if can_draw && has_drawn {
                glfw.poll_events();
            } else {
                // Nothing to do (or the window gives no image for now): the last frames end, then it sleeps.
                self.screen.finish()?;
                self.update_title(loader);
                let is_loading = loader.path().is_some();
                glfw.wait_events_timeout(if is_loading || can_draw {
                    LOADING_WAIT_S
                } else {
                    IDLE_WAIT_S
                });
            }
            self.handle_events(loader)?;
            if let Some((path, result)) = loader.poll() {
                self.loaded(&path, result)?;
            }
            has_drawn = true;
            if self.is_dirty && !self.is_iconified && self.has_area() {
                has_drawn = self.draw()?;
            }
            if self.title_time.elapsed() >= TITLE_INTERVAL {
                self.update_title(loader);
            }
        }
        self.screen.finish()?;
        if self.options.screenshot.is_some() && self.frames == 0 {
            return Err(Error::Closed);
        }
        Ok(())
    }

    /// Size of the picture, pixels.
    fn size(&self) -> (u32, u32) {
        let (width, height) = self.window.get_framebuffer_size();
        (
            u32::try_from(width).unwrap_or(0),
            u32::try_from(height).unwrap_or(0),
        )
    }

    fn has_area(&self) -> bool {
        let (width, height) = self.size();
        width > 0 && height > 0
    }

    /// Pixels of the picture for one unit of the cursor's coordinates.
    fn cursor_scale(&self) -> DVec2 {
        let (width, height) = self.window.get_size();
        let (pixels_x, pixels_y) = self.size();
        DVec2::new(
            f64::from(pixels_x) / f64::from(width.max(1)),
            f64::from(pixels_y) / f64::from(height.max(1)),
        )
    }

    fn fail(&mut self, message: &str) {
        eprintln!("surfel: {message}");
        self.failure = Some(message.to_owned());
    }

    /// A job of the loader has ended.
    fn loaded(&mut self, path: &Path, result: Result<Model, OpenError>) -> Result<(), Error> {
        let outcome = match result {
            Ok(model) => self
                .screen
                .set_model(model)
                .map_err(|e| Box::new(e) as OpenError),
            Err(error) => Err(error),
        };
        match outcome {
            Ok(()) => {
                self.name = text::name(path);
                self.failure = None;
                let size = self.size();
                let orbit = self.options.orbit;
                self.orbit = self.screen.model().map(|model| {
                    let center = model.origin + model.orbit_center.as_dvec3();
                    Orbit::new(center, f64::from(model.orbit_radius), size, orbit)
                });
                self.is_dirty = true;
                Ok(())
            }
            Err(error)
                if self.options.screenshot.is_some()
                    || self.options.exit_after_frames.is_some() =>
            {
                Err(Error::Open(error))
            }
            Err(error) => {
                self.fail(&error.to_string());
                Ok(())
            }
        }
    }

    fn handle_events(&mut self, loader: &mut Loader) -> Result<(), Error> {
        while let Some((time, event)) = self.events.receive() {
            match event {
                WindowEvent::FramebufferSize(..) | WindowEvent::Refresh => self.is_dirty = true,
                WindowEvent::Iconify(is_iconified) => {
                    self.is_iconified = is_iconified;
                    self.is_dirty = true;
                }
                WindowEvent::Focus(false) => self.mouse.release(),
                WindowEvent::FileDrop(paths) => {
                    if let Some(path) = paths.first() {
                        self.open(path, loader);
                    }
                }
                WindowEvent::CursorPos(x, y) => {
                    let at = DVec2::new(x, y) * self.cursor_scale();
                    if let Some(gesture) = self.mouse.moved(at) {
                        self.gesture(gesture)?;
                    }
                }
                WindowEvent::MouseButton(button, action, modifiers) => {
                    if let Some(gesture) = self.mouse.button(button, action, modifiers, time) {
                        self.gesture(gesture)?;
                    }
                }
                WindowEvent::Scroll(_, steps) => self.wheel += steps,
                WindowEvent::Key(key, scancode, Action::Press | Action::Repeat, modifiers) => {
                    let printed = glfw::get_key_name(Some(key), Some(scancode));
                    if let Some(command) = input::command(key, printed.as_deref(), modifiers) {
                        self.command(command)?;
                    }
                }
                _ => {}
            }
        }
        let steps = std::mem::take(&mut self.wheel);
        if steps != 0.0 {
            let at = self.mouse.position();
            let distance = self.distance_at(at)?;
            self.change(|orbit| orbit.zoom(Orbit::wheel_factor(steps), at, distance));
        }
        Ok(())
    }

    fn open(&mut self, path: &Path, loader: &mut Loader) {
        self.failure = None;
        if let Err(error) = loader.start(path) {
            self.fail(&format!("cannot start to load: {error}"));
        }
        self.update_title(loader);
    }

    /// Changes the camera, if there is a model.
    fn change(&mut self, change: impl FnOnce(&mut Orbit)) {
        if let Some(orbit) = &mut self.orbit {
            change(orbit);
            self.touched();
        }
    }

    /// Something that is seen has changed through the user.
    fn touched(&mut self) {
        self.failure = None;
        self.is_dirty = true;
    }

    /// Distance of what is seen at a pixel, or of the center of rotation where nothing is.
    fn distance_at(&mut self, at: DVec2) -> Result<f64, Error> {
        let Some(orbit) = &self.orbit else {
            return Ok(1.0);
        };
        let away = orbit.pivot_distance();
        Ok(self.screen.distance_at(at)?.unwrap_or(away))
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
                if let Some(distance) = self.screen.distance_at(at)? {
                    self.change(|orbit| orbit.set_pivot(at, distance));
                }
            }
        }
        Ok(())
    }

    fn command(&mut self, command: Command) -> Result<(), Error> {
        let is_closed = self.screen.model().is_some_and(|model| model.is_closed);
        match command {
            Command::Quit => self.is_closing = true,
            Command::Method(method) => self.settings.method = method,
            Command::Threshold(px) => self.settings.threshold_px = px,
            Command::ThresholdBy(px) => {
                let changed = self.settings.threshold_px + px;
                self.settings.threshold_px = changed.clamp(0.0, LARGEST_THRESHOLD_PX);
            }
            Command::Culling => {
                self.settings.culling = if self.settings.culls_back(is_closed) {
                    Culling::Off
                } else {
                    Culling::On
                };
            }
            Command::Primitive => {
                self.settings.color_by = match self.settings.color_by {
                    ColorBy::Shading => ColorBy::Primitive,
                    ColorBy::Primitive | ColorBy::Classification => ColorBy::Shading,
                };
            }
            Command::Statistics => self.has_statistics = !self.has_statistics,
            Command::Print => self.print_statistics()?,
            Command::Screenshot => {
                if let Err(error) = self.numbered_screenshot() {
                    self.fail(&error.to_string());
                    return Ok(());
                }
            }
            Command::Frame => self.change(Orbit::frame_model),
            Command::Reset => self.change(Orbit::reset),
            Command::LookFrom(azimuth, elevation) => {
                self.change(|orbit| orbit.look_from(azimuth, elevation))
            }
        }
        if !matches!(
            command,
            Command::Quit | Command::Print | Command::Screenshot | Command::Statistics
        ) {
            self.touched();
        }
        Ok(())
    }

    /// Draws and presents a frame. Returns whether the window gave an image.
    fn draw(&mut self) -> Result<bool, Error> {
        let orbit = &mut self.orbit;
        let camera = |size| {
            let orbit = orbit.as_mut()?;
            orbit.resize(size);
            Some(orbit.camera())
        };
        match self.screen.draw(&self.window, camera, &self.settings) {
            Ok(Shown::Nothing) => Ok(false),
            Ok(Shown::Again) => Ok(true),
            Ok(Shown::Frame) => {
                self.is_dirty = false;
                if self.screen.model().is_some() {
                    self.frames += 1;
                    self.after_frame()?;
                }
                Ok(true)
            }
            Err(error) if screen::is_survivable(&error) => {
                // Without the model there is room again, and the window still opens others.
                self.screen.drop_model();
                self.orbit = None;
                if self.options.screenshot.is_some() || self.options.exit_after_frames.is_some() {
                    return Err(error.into());
                }
                self.fail(&error.to_string());
                self.is_dirty = true;
                Ok(true)
            }
            Err(error) => Err(error.into()),
        }
    }

    /// What the options ask for after a frame of the model.
    fn after_frame(&mut self) -> Result<(), Error> {
        if let Some(path) = self.options.screenshot.clone() {
            self.save(&path)?;
            self.is_closing = true;
        }
        if let Some(frames) = self.options.exit_after_frames {
            self.is_closing |= self.frames >= frames;
            self.is_dirty = true;
        }
        Ok(())
    }

    /// Writes what the window shows.
    fn save(&mut self, path: &Path) -> Result<(), Error> {
        if let Some(image) = self.screen.read()? {
            image.save_png(path)?;
        }
        Ok(())
    }

    /// Writes the first `surfel-NNN.png` that is not there yet.
    fn numbered_screenshot(&mut self) -> Result<(), Error> {
        let free = (0..1000)
            .map(|n| PathBuf::from(format!("surfel-{n:03}.png")))
            .find(|path| !path.exists());
        match free {
            Some(path) => {
                self.save(&path)?;
                eprintln!("surfel: wrote {}", path.display());
            }
            None => self.fail("surfel-000.png to surfel-999.png are all there; move some away"),
        }
        Ok(())
    }

    fn print_statistics(&mut self) -> Result<(), Error> {
        self.screen.finish()?;
        let (Some(model), Some(orbit)) = (self.screen.model(), &self.orbit) else {
            return Ok(());
        };
        let facts = text::Facts {
            name: &self.name,
            model,
            settings: &self.settings,
            device: &self.gpu.info().name,
            present_mode: self.screen.present_mode(),
            size: self.size(),
        };
        let mut out = text::statistics(&facts, self.screen.frame_ms(), self.screen.times());
        if let Ok(camera) = serde_json::to_string(&orbit.camera()) {
            out += &format!("  camera {camera}\n");
        }
        // Nobody may be reading; the window goes on.
        let _ = std::io::stdout().write_all(out.as_bytes());
        Ok(())
    }

    fn update_title(&mut self, loader: &Loader) {
        self.title_time = Instant::now();
        let title = if let (Some(path), Some(status)) = (loader.path(), loader.status()) {
            text::loading(&text::name(path), &status)
        } else if let Some(message) = &self.failure {
            text::failed(message)
        } else if self.screen.model().is_none() {
            "drop a model here - surfel".to_owned()
        } else {
            let frame = (self.screen.frame_ms(), &self.screen.times().counts);
            text::title(
                &self.name,
                &self.settings,
                self.has_statistics.then_some(frame),
            )
        };
        if title != self.title {
            self.window.set_title(&title);
            self.title = title;
        }
    }
}
