//! `surfel MODEL`

use super::look::LookArgs;
use super::progress::is_interrupted;
use super::render::{DeviceArgs, parse_orbit, parse_size, require_ending};
use super::source::Source;
use super::{Failure, Outcome, usage};
use clap::ValueEnum;
use std::path::PathBuf;
use std::sync::Arc;
use surfel::method::engine::Backend;
use surfel::progress::Progress;
use surfel::viewer::loader::Open;
use surfel::viewer::{self, Options};

/// Mouse and keys, for `surfel --help`.
pub(crate) use surfel::viewer::input::HELP;

/// What the window shows when no model is named.
const BUILT_IN: &str = "generate:statue:2000000";

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Switch {
    /// Frames wait for the screen; nothing tears
    On,
    /// Frames are shown as soon as they are drawn
    Off,
}

/// Look at a model in a window.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Model to look at in a window: a file, - for standard input, or generate:SHAPE[:TRIANGLES] [default: a generated statue]
    #[arg(value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Merge vertices that are equal in position, normal and color
    #[arg(long)]
    weld: bool,
    #[command(flatten)]
    look: LookArgs,
    /// Size of the window
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "1024x768")]
    size: (u32, u32),
    /// First view: azimuth and elevation in degrees, and the part of the picture that the model fills [default: 30,20,1]
    #[arg(long, value_name = "AZIMUTH,ELEVATION,FILL", value_parser = parse_orbit, allow_hyphen_values = true)]
    orbit: Option<[f64; 3]>,
    /// Whether frames wait for the screen
    #[arg(long, value_enum, default_value = "on")]
    vsync: Switch,
    /// Write the first whole picture to this file (.png) and close the window
    #[arg(long, value_name = "FILE")]
    screenshot: Option<PathBuf>,
    /// Close after this many frames, drawn one after the other
    #[arg(long, value_name = "N", hide = true)]
    exit_after_frames: Option<u64>,
    /// For tests: treat the surface as lost every N frames
    #[arg(long, value_name = "N", hide = true)]
    lose_surface_every: Option<u64>,
    #[command(flatten)]
    device: DeviceArgs,
}

impl From<viewer::Error> for Failure {
    fn from(error: viewer::Error) -> Self {
        match error {
            viewer::Error::Gpu(error) => error.into(),
            viewer::Error::Image(error) => error.into(),
            viewer::Error::Open(_) => Self::Input(error.into()),
            _ => Self::Run(error.into()),
        }
    }
}

pub(crate) fn run(args: Args, _quiet: bool) -> Outcome {
    let settings = args.look.settings()?;
    let gpu = args.device.options();
    if gpu.device.as_deref() == Some(Backend::MIRROR) {
        return Err(usage(
            "--device mirror draws pictures only; use it with surfel render",
        ));
    }
    require_ending("--screenshot", args.screenshot.as_ref(), &["png"])?;
    let [azimuth, elevation, fill] = args.orbit.unwrap_or([30.0, 20.0, 1.0]);
    let weld = args.weld;
    let open: Arc<Open> = Arc::new(move |path, progress: &dyn Progress| {
        let source = Source {
            model: path.to_owned(),
            weld,
        };
        match source.ready_with(progress) {
            Ok(ready) => Ok(ready.model),
            Err(Failure::Input(error) | Failure::Run(error)) => Err(format!("{error}").into()),
        }
    });
    let options = Options {
        model: args.model.unwrap_or_else(|| BUILT_IN.into()),
        size: args.size,
        orbit: (azimuth.to_radians(), elevation.to_radians(), fill),
        settings,
        vsync: args.vsync == Switch::On,
        gpu,
        screenshot: args.screenshot,
        exit_after_frames: args.exit_after_frames,
        lose_surface_every: args.lose_surface_every,
    };
    Ok(viewer::run(options, open, &is_interrupted)?)
}
