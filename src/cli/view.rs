//! `surfel MODEL`

use super::cameras::{UpChoice, parse_orbit, parse_size, read_camera};
use super::look::LookArgs;
use super::mark_args::MarkArgs;
use super::photo_args::PhotoArgs;
use super::placement_args::PlacementArgs;
use super::progress::is_interrupted;
use super::render::{DeviceArgs, require_ending};
use super::source::{ColorArgs, KeepArgs, PageArgs, SurfaceArgs, ViewFraming, open_options};
use super::{CommandFailure, Outcome, print, usage};
use clap::ValueEnum;
use std::path::PathBuf;
use surfel::photos::formats::locate_scene;
use surfel::viewer::control::FrameGoal;
use surfel::viewer::{
    self, InjectedFaults, PhotographOptions, RestSmoothing, ViewerOptions, store,
};

/// Mouse and keys, for `surfel --help`.
pub(crate) use surfel::viewer::input::help;

/// What the window shows when no model is named.
const BUILT_IN: &str = "generate:statue:2000000";

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ViewSwitch {
    /// Yes
    On,
    /// No
    Off,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SmoothChoice {
    /// Sampled where that is quick enough for keys to be answered at once
    Auto,
    /// Sampled however long that takes
    On,
    /// Left as it was drawn
    Off,
}

impl SmoothChoice {
    fn setting(self) -> RestSmoothing {
        match self {
            Self::Auto => RestSmoothing::WhileQuick,
            Self::On => RestSmoothing::Always,
            Self::Off => RestSmoothing::Never,
        }
    }
}

/// Look at a model in a window.
#[derive(Debug, clap::Args)]
pub(crate) struct ViewArgs {
    /// Model to look at in a window: a file, - for standard input, or generate:SHAPE[:TRIANGLES] [default: a generated statue]
    #[arg(value_name = "MODEL", index = 1)]
    model: Option<PathBuf>,
    /// More models, shown with the first
    #[arg(value_name = "MODEL", index = 2)]
    more: Vec<PathBuf>,
    #[command(flatten)]
    placement: PlacementArgs,
    /// Merge vertices that are equal in position, normal and color
    #[arg(long)]
    weld: bool,
    /// What the first view frames: without what lies far off, or all
    #[arg(long, value_name = "WHAT", default_value = "robust")]
    frame: ViewFraming,
    #[command(flatten)]
    surface: SurfaceArgs,
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    color: ColorArgs,
    #[command(flatten)]
    pages: PageArgs,
    #[command(flatten)]
    look: LookArgs,
    #[command(flatten)]
    marks: MarkArgs,
    #[command(flatten)]
    photos: PhotoArgs,
    /// Size of the window [default: as it was left, or 1024x768]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<(u32, u32)>,
    /// First view: azimuth and elevation in degrees, and the part of the picture that the model fills [default: 30,20,1]
    #[arg(long, value_name = "AZIMUTH,ELEVATION,FILL", value_parser = parse_orbit, allow_hyphen_values = true)]
    orbit: Option<[f64; 3]>,
    /// Draw samples while the view rests, until its picture is smooth
    #[arg(long, value_enum, default_value = "auto", value_name = "WHEN")]
    smooth: SmoothChoice,
    /// Open the files again whenever another program has written them [by hand: key F5]
    #[arg(long, conflicts_with_all = ["replay", "screenshot", "turntable"])]
    watch: bool,
    /// Axis that is up [key Shift U]
    #[arg(long, value_enum, default_value_t = UpChoice::Auto, value_name = "AXIS")]
    up: UpChoice,
    /// First view: a camera file as `surfel render --save-camera` or Ctrl C in the window writes it
    #[arg(long, value_name = "FILE", conflicts_with = "orbit")]
    camera: Option<PathBuf>,
    /// While the camera moves, draw as coarsely as it takes to keep frames within this time; milliseconds, or off [default: as it
    /// was left; 33 where the processor draws, 16 on graphics hardware, off where pictures are made]
    #[arg(long, value_name = "MS", value_parser = parse_frame_goal)]
    frame_ms: Option<FrameGoal>,
    /// Whether the panel is shown [default: as it was left; off where pictures are made]
    #[arg(long, value_enum)]
    panel: Option<ViewSwitch>,
    /// Pixels for one point of the panel [default: the screen's]
    #[arg(long, value_name = "FACTOR")]
    ui_scale: Option<f32>,
    /// Whether frames wait for the screen [default: on]
    #[arg(long, value_enum)]
    vsync: Option<ViewSwitch>,
    /// Write the first whole picture to this file (.png) and close the window; with --panel on what the window shows
    #[arg(long, value_name = "FILE")]
    screenshot: Option<PathBuf>,
    /// Write pictures from all around into this folder and close the window
    #[arg(long, value_name = "FOLDER")]
    turntable: Option<PathBuf>,
    /// How many pictures a turntable has [default: 36]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    frames: Option<u32>,
    /// Write every input event to this file
    #[arg(long, value_name = "FILE", conflicts_with = "replay")]
    record: Option<PathBuf>,
    /// Take the input from a file that --record wrote, with the same options; then close. With --frame-ms it says how many frames kept that time
    #[arg(long, value_name = "FILE")]
    replay: Option<PathBuf>,
    /// Replay without a window
    #[arg(long, requires = "replay")]
    headless: bool,
    /// Write the picture of each step of a replay into this folder; with --panel on what the window shows
    #[arg(long, value_name = "FOLDER", requires = "replay")]
    pictures: Option<PathBuf>,
    /// Close after this many frames, drawn one after the other
    #[arg(long, value_name = "N", hide = true)]
    exit_after_frames: Option<u64>,
    /// For tests: treat the surface as lost every N frames
    #[arg(long, value_name = "N", hide = true, default_value_t = 0)]
    lose_surface_every: u64,
    /// For tests: treat the device as lost every N frames
    #[arg(long, value_name = "N", hide = true, default_value_t = 0)]
    lose_device_every: u64,
    /// For tests: treat device memory as exhausted every N frames
    #[arg(long, value_name = "N", hide = true, default_value_t = 0)]
    exhaust_memory_every: u64,
    /// Whether the command line says how the model looks.
    #[arg(skip)]
    has_look: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

impl ViewArgs {
    /// Notes what the command line says itself: the settings file decides the rest.
    pub(crate) fn note_given(&mut self, matches: &clap::ArgMatches) {
        let look = <LookArgs as clap::Args>::augment_args(clap::Command::new("look"));
        self.has_look = look.get_arguments().any(|arg| {
            matches.value_source(arg.get_id().as_str())
                == Some(clap::parser::ValueSource::CommandLine)
        });
    }
}

impl ViewArgs {
    /// Takes the model for a scene of photographs, which are put on a mesh, or on its own points.
    pub(crate) fn of_scene(mut self, mesh: Option<PathBuf>) -> Result<Self, CommandFailure> {
        let Some(scene) = self.model.take() else {
            return Err(usage(
                "no scene of photographs is named, and no command; see surfel photos --help",
            ));
        };
        if !self.more.is_empty() {
            return Err(usage("one scene of photographs is shown at a time"));
        }
        locate_scene(&scene)?;
        match mesh {
            Some(mesh) => {
                self.photos.photos = Some(scene);
                self.model = Some(mesh);
            }
            None => self.model = Some(scene),
        }
        Ok(self)
    }
}

impl From<viewer::ViewerError> for CommandFailure {
    fn from(error: viewer::ViewerError) -> Self {
        match error {
            viewer::ViewerError::Gpu(error) => error.into(),
            viewer::ViewerError::Image(error) => error.into(),
            viewer::ViewerError::Open(_) | viewer::ViewerError::Recording(_) => {
                Self::Input(error.into())
            }
            _ => Self::Run(error.into()),
        }
    }
}

fn parse_frame_goal(text: &str) -> Result<FrameGoal, String> {
    match text.parse() {
        _ if text == "off" => Ok(FrameGoal::Free),
        Ok(ms) if (1.0..=10_000.0).contains(&ms) => Ok(FrameGoal::Held(ms)),
        _ => Err("expected milliseconds, 1 to 10000, or off".to_owned()),
    }
}

pub(crate) fn run(mut args: ViewArgs, _quiet: bool) -> Outcome {
    args.look.default_for_people();
    args.color.by = args.look.take_point_color();
    let mut settings = args.look.settings()?;
    let gpu = args.device.options();
    let backend = args.device.window_backend()?;
    require_ending("--screenshot", args.screenshot.as_ref(), &["png"])?;
    if let Some(scale) = args.ui_scale
        && !(0.25..=8.0).contains(&scale)
    {
        return Err(usage(format!(
            "--ui-scale {scale} is no factor from 0.25 to 8"
        )));
    }
    if args.frames.is_some() && args.turntable.is_none() {
        return Err(usage("--frames goes with --turntable FOLDER"));
    }
    let camera = args.camera.as_deref().map(read_camera).transpose()?;
    if let (Some(model), true) = (&args.model, args.more.is_empty()) {
        args.photos.take_own_of(model);
    }
    settings = args.photos.shown(settings);
    // What is made for a file must not depend on how a window was left.
    let is_attended = args.screenshot.is_none()
        && args.turntable.is_none()
        && args.replay.is_none()
        && args.exit_after_frames.is_none();
    let settings_file = store::place().filter(|_| is_attended);
    let mut warning = None;
    let mut window = store::StoredWindow {
        panel: is_attended,
        ..store::StoredWindow::default()
    };
    let mut left_size = None;
    match settings_file.as_deref().map(store::load) {
        Some(Ok((stored, look))) => {
            if stored.window != store::StoredWindow::default() {
                left_size = Some((stored.window.width, stored.window.height));
            }
            window = stored.window;
            if !args.has_look {
                settings = args.photos.shown(look);
            }
        }
        Some(Err(error)) => warning = Some(error),
        None => {}
    }
    if let Some(panel) = args.panel {
        window.panel = panel == ViewSwitch::On;
    }
    let marks = args.marks.choice();
    window.scale_bar |= marks.scale_bar;
    window.axes |= marks.axes;
    let [azimuth, elevation, fill] = args.orbit.unwrap_or([30.0, 20.0, 1.0]);
    let camera_size = camera.as_ref().map(|c| (c.width, c.height));
    let size = args.size.or(camera_size).or(left_size);
    let mut opening = open_options(args.weld, args.frame, args.surface)?;
    let placements = args.placement.of_models(1 + args.more.len())?;
    opening.input.color = args.color.setting()?;
    opening.keep = args.keep.filter();
    let options = ViewerOptions {
        model_is_usual: args.model.is_none(),
        model: args.model.unwrap_or_else(|| BUILT_IN.into()),
        more: args.more,
        placements,
        opening,
        smoothing: args.smooth.setting(),
        splat_by_model: !args.look.names_splat() && settings.method == surfel::render::Method::Pop,
        watches: args.watch,
        up: args.up.named(),
        photos: PhotographOptions {
            most: args.photos.most(),
            scene: args.photos.photos,
            folder: args.photos.photo_folder,
        },
        paged: args.pages.options(),
        size: size.unwrap_or((window.width, window.height)),
        size_is_usual: size.is_none() && is_attended,
        ui_scale: args.ui_scale,
        orbit: (azimuth.to_radians(), elevation.to_radians(), fill),
        camera,
        settings,
        section: args.placement.section,
        frame_goal: match args.frame_ms {
            Some(goal) => goal,
            None if is_attended => FrameGoal::of_stored(window.frame_ms),
            None => FrameGoal::Free,
        },
        backend,
        vsync: args.vsync != Some(ViewSwitch::Off),
        gpu,
        window,
        settings_file,
        warning,
        screenshot: args.screenshot,
        with_panel: args.panel == Some(ViewSwitch::On),
        panel_is_asked: args.panel.is_some(),
        turntable: args.turntable,
        turntable_frames: args.frames,
        record: args.record,
        replay: args.replay,
        headless: args.headless,
        pictures: args.pictures,
        exit_after_frames: args.exit_after_frames,
        faults: InjectedFaults {
            surface: args.lose_surface_every,
            device: args.lose_device_every,
            memory: args.exhaust_memory_every,
        },
    };
    match viewer::run(options, &is_interrupted)?.pace {
        Some(summary) => print(&format!("{summary}\n")),
        None => Ok(()),
    }
}
