//! The window: opens at once, loads on another thread, draws only when something has changed.
//!
//! Events of the window system become [`event`]s in `window`; `app` turns them into frames, which `screen` draws
//! onto the window. [`camera`], [`control`], [`input`], [`lamp`], [`loader`], [`measuring`], [`notice`], [`pace`], [`pick`], [`preview`], [`recent`], [`record`], [`store`] and [`text`]
//! are pure logic; [`ui`], [`panel`], [`graph`] and [`help`] know egui. None of them knows Vulkan or the window
//! system. The main thread owns window and device.

mod app;
pub mod camera;
pub mod choices;
pub mod control;
pub mod event;
mod file_watch;
pub mod graph;
pub mod help;
pub mod input;
pub mod kept_models;
pub mod lamp;
mod load_progress;
pub mod loaded_model;
pub mod loader;
pub mod measuring;
pub mod notice;
pub mod pace;
pub mod panel;
pub mod pick;
pub mod preview;
pub mod recent;
pub mod record;
mod recovery;
mod replay;
mod screen;
pub mod section_handles;
pub mod store;
pub mod text;
pub mod ui;
mod window;

use self::control::FrameGoal;
use crate::bench::calibrate;
use crate::gpu::messages::LayerMessages;
use crate::gpu::{self, Gpu};
use crate::math::camera::Camera;
use crate::math::up_axis::UpAxis;
use crate::mesh::placement::MeshPlacement;
use crate::open::OpenOptions;
use crate::render::Settings;
use crate::render::paged_model::{PagedModelOptions, page_reading};
use crate::render::window_renderer::WindowBackend;
use app::ViewerApp;
use glfw::{ClientApiHint, WindowHint};
use loaded_model::LoadError;
use loader::ModelLoader;
use pace::PaceSummary;
use record::{EventRecorder, RecordEntry};
pub use screen::InjectedFaults;
use screen::WindowScreen;
use std::path::PathBuf;
use window::ViewerWindow;

/// Why the window closed early.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewerError {
    /// There is no window system, or it gives no window.
    #[error("cannot open a window: {0}. Pictures without a window: surfel render")]
    Window(String),
    /// The device failed.
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    /// The device was lost and could not be opened again.
    #[error("the device was lost and opening it again does not help: {0}")]
    DeviceGone(gpu::Error),
    /// The model that a picture was asked of could not be opened.
    #[error(transparent)]
    Open(LoadError),
    /// The picture could not be written.
    #[error(transparent)]
    Image(#[from] crate::image::Error),
    /// The recording could not be read or written.
    #[error("cannot use the recording: {0}")]
    Recording(#[from] record::RecordError),
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

/// Photographs that are put on the model.
#[derive(Debug, Clone)]
pub struct PhotographOptions {
    /// File or folder of their scene.
    pub scene: Option<PathBuf>,
    /// Folder of the photographs, where they are not beside it.
    pub folder: Option<PathBuf>,
    /// Photographs that a frame uses at most, 1 to 64.
    pub most: usize,
}

impl Default for PhotographOptions {
    fn default() -> Self {
        Self {
            scene: None,
            folder: None,
            most: 16,
        }
    }
}

/// Choice whether the picture of a view at rest gets smoother by more samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RestSmoothing {
    /// Keeps it as it was drawn.
    #[default]
    Never,
    /// Adds samples until they take so long that what is pressed meanwhile would be answered late.
    WhileQuick,
    /// Adds samples however long they take.
    Always,
}

/// What to show and how.
#[derive(Debug, Clone, Default)]
pub struct ViewerOptions {
    /// Model to open, as [`crate::open()`] names it.
    pub model: PathBuf,
    /// Models to be shown with it, in the same space.
    pub more: Vec<PathBuf>,
    /// Where these stand and what color they have, in their order.
    pub placements: Vec<MeshPlacement>,
    /// How models are opened, this one and those that are dropped onto the window.
    pub opening: OpenOptions,
    /// Who draws the frames.
    pub backend: WindowBackend,
    /// Nobody asked for that model: a replay takes the one of its recording.
    pub model_is_usual: bool,
    /// Size of the window, in the window system's units.
    pub size: (u32, u32),
    /// Nobody asked for that size: it may follow the screen.
    pub size_is_usual: bool,
    /// Pixels for one point of the panel; none takes the screen's.
    pub ui_scale: Option<f32>,
    /// First view: azimuth and elevation in radians, and fill.
    pub orbit: (f64, f64, f64),
    /// First view, instead of `orbit`.
    pub camera: Option<Camera>,
    /// How the model is drawn at first.
    pub settings: Settings,
    /// Section of the first model: opposite corners in the coordinates of its file.
    pub section: Option<[glam::DVec3; 2]>,
    /// Wanted time of a frame while the camera moves.
    pub frame_goal: FrameGoal,
    /// Wait for the screen, so that nothing tears.
    pub vsync: bool,
    /// Which device; its surface extensions are set here.
    pub gpu: gpu::DeviceOptions,
    /// What the window shows besides the model.
    pub window: store::StoredWindow,
    /// Where to keep how the window was left; none keeps nothing.
    pub settings_file: Option<PathBuf>,
    /// What to tell the user when the window opens.
    pub warning: Option<String>,
    /// Write the first whole picture of the model here and close.
    pub screenshot: Option<PathBuf>,
    /// With what covers the picture.
    pub with_panel: bool,
    /// Somebody asked for the panel, or for none: a replay does not take it from its recording.
    pub panel_is_asked: bool,
    /// Write pictures from all around into this folder and close.
    pub turntable: Option<PathBuf>,
    /// How many pictures a turntable has.
    pub turntable_frames: Option<u32>,
    /// Write the input here.
    pub record: Option<PathBuf>,
    /// Take the input from here.
    pub replay: Option<PathBuf>,
    /// Replay without a window.
    pub headless: bool,
    /// Write the picture of each step of a replay into this folder.
    pub pictures: Option<PathBuf>,
    /// Close after so many frames of the model, drawn one after the other.
    pub exit_after_frames: Option<u64>,
    /// Options by which paged files are drawn.
    pub paged: PagedModelOptions,
    /// Photographs on the model.
    pub photos: PhotographOptions,
    /// Choice whether a picture gets smoother while the view rests.
    pub smoothing: RestSmoothing,
    /// Whether splats follow from what is shown until somebody chooses: discs in the plane of the surface on points, else squares.
    pub splat_by_model: bool,
    /// Files are opened again when they have changed.
    pub watches: bool,
    /// The axis that is up; none: as each model's format and place tell.
    pub up: Option<UpAxis>,
    /// Faults of tests: what goes wrong, and how often.
    #[doc(hidden)]
    pub faults: InjectedFaults,
}

/// Frames of a run, for those who watch it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RunFigures {
    /// Frames of a model that were drawn.
    pub frames: u64,
    /// Longest time that a replay took to draw one and hand it on, milliseconds; 0 without a replay.
    pub longest_ms: f64,
    /// How many frames of a replay kept the time they were held to; `None` without one of either.
    pub pace: Option<PaceSummary>,
}

/// Opens the window and returns when it is closed. Models are opened on another thread; `should_stop` is asked now and
/// then (Ctrl-C). Must be called on the main thread.
///
/// A model that cannot be opened is told in the window and on standard error, and the window stays open for
/// another, unless a picture of it was asked for.
///
/// # Errors
/// When there is no window or device, the device is lost and cannot be opened again, or a file that was asked for
/// cannot be read or written.
pub fn run(
    options: ViewerOptions,
    should_stop: &dyn Fn() -> bool,
) -> Result<RunFigures, ViewerError> {
    let placed = [&options.model].into_iter().chain(&options.more).cloned();
    let placed = placed.zip(options.placements.iter().copied()).collect();
    let mut loader = ModelLoader::new(options.opening.clone(), options.paged, placed);
    let has_photos = options.photos.scene.is_some();
    loader.read_pages(page_reading(&options.settings, has_photos));
    let outcome = if options.headless {
        replay_headless(options, &mut loader, should_stop)
    } else {
        show(options, &mut loader, should_stop)
    };
    // The window is gone by now; whatever still loads stops.
    loader.stop();
    let (messages, figures) = outcome?;
    let all: Vec<_> = messages.iter().flat_map(LayerMessages::list).collect();
    match all.as_slice() {
        [] => Ok(figures),
        [first, ..] => Err(ViewerError::Validation {
            count: all.len(),
            first: format!("{}: {}", first.id, first.text),
        }),
    }
}

/// The recording to replay, if one is asked for.
fn replayed(options: &ViewerOptions) -> Result<Option<Vec<RecordEntry>>, ViewerError> {
    Ok(options.replay.as_deref().map(record::read).transpose()?)
}

fn replay_headless(
    options: ViewerOptions,
    loader: &mut ModelLoader,
    should_stop: &dyn Fn() -> bool,
) -> Result<(Vec<LayerMessages>, RunFigures), ViewerError> {
    let entries = replayed(&options)?.unwrap_or_default();
    let gpu = Gpu::open(&options.gpu)?;
    let mut screen = WindowScreen::new(&gpu, None, options.vsync, options.backend)?;
    screen.set_costs(calibrate::for_use(&gpu, &[options.settings]));
    screen.inject(options.faults);
    // The screen holds the device from here on.
    drop(gpu);
    let size = replay::first_size(&entries, &options);
    let mut app = ViewerApp::new(screen, options);
    app.size = size;
    app.lay_out();
    replay::run(&mut app, &entries, loader, None, should_stop)?;
    Ok((app.messages.clone(), app.figures()))
}

fn show(
    mut options: ViewerOptions,
    loader: &mut ModelLoader,
    should_stop: &dyn Fn() -> bool,
) -> Result<(Vec<LayerMessages>, RunFigures), ViewerError> {
    let entries = replayed(&options)?;
    if let Some(entries) = &entries {
        options.size = replay::first_size(entries, &options);
        options.size_is_usual = false;
    }
    let mut recorder = options
        .record
        .as_deref()
        .map(EventRecorder::create)
        .transpose()?;
    // GLFW tells causes through a callback only.
    let cause = std::rc::Rc::new(std::cell::RefCell::new(String::new()));
    let noted = cause.clone();
    let mut glfw = glfw::init(move |error, text| {
        tracing::debug!("glfw: {error:?}: {text}");
        *noted.borrow_mut() = text;
    })
    .map_err(|error| window_error(&error.to_string(), &cause.borrow()))?;
    glfw.window_hint(WindowHint::ClientApi(ClientApiHint::NoApi));
    let title = text::loading(&text::name(&options.model), "opening");
    let mut window = ViewerWindow::open(&mut glfw, &options, &title)
        .ok_or_else(|| window_error("the window system gave none", &cause.borrow()))?;
    let start_error = match entries {
        // A recording says itself when its models are there.
        Some(_) => None,
        None => loader.start_all(&options.model, &options.more).err(),
    };
    options.gpu.surface_extensions = glfw
        .get_required_instance_extensions()
        .ok_or_else(|| window_error("Vulkan cannot draw into windows here", &cause.borrow()))?;
    let gpu = Gpu::open(&options.gpu)?;
    let (vsync, backend) = (options.vsync, options.backend);
    let mut screen = WindowScreen::new(&gpu, Some(&window.window), vsync, backend)?;
    screen.set_costs(calibrate::for_use(&gpu, &[options.settings]));
    drop(gpu);
    screen.inject(options.faults);
    let warning = options.warning.take();
    // Dropped before the window.
    let mut app = ViewerApp::new(screen, options);
    app.size = window.size();
    app.lay_out();
    if let Some(warning) = warning {
        app.warn(&warning);
    }
    if let Some(error) = start_error {
        app.warn(&format!("cannot start to load: {error}"));
    }
    match &entries {
        Some(entries) => {
            let window = Some((&mut window, &mut glfw));
            replay::run(&mut app, entries, loader, window, should_stop)?;
        }
        None => {
            window.run(&mut app, &mut glfw, loader, recorder.as_mut(), should_stop)?;
            if let Some(recorder) = &mut recorder {
                recorder.finish()?;
            }
            if app.is_unattended() && app.frames == 0 {
                return Err(ViewerError::Closed);
            }
        }
    }
    keep(&app, &window);
    Ok((app.messages.clone(), app.figures()))
}

/// Writes how the window was left.
fn keep(app: &ViewerApp, window: &ViewerWindow) {
    let Some(path) = &app.options.settings_file else {
        return;
    };
    let (width, height) = window.windowed_size();
    let stored = store::StoredSettings {
        window: store::StoredWindow {
            width,
            height,
            panel: app.has_panel,
            graph: app.has_graph,
            statistics: app.has_statistics,
            scale_bar: app.marks.scale_bar,
            axes: app.marks.axes,
            parallel_light: app.has_parallel_light(),
            frame_ms: app.frame_goal().stored(),
            recent: app.recent.files().to_vec(),
        },
        look: store::StoredLook::of(&app.settings),
    };
    if let Err(error) = store::save(path, &stored) {
        tracing::warn!("{error}");
    }
}

fn window_error(what: &str, cause: &str) -> ViewerError {
    let cause = cause.lines().next().unwrap_or_default();
    ViewerError::Window(match cause {
        "" => what.to_owned(),
        cause => format!("{what} ({cause})"),
    })
}
