//! `surfel motion`

use super::cameras::{CameraArgs, orbit_cameras, parse_orbit};
use super::look::LookArgs;
use super::progress::JobBar;
use super::render::{DeviceArgs, validated};
use super::source::ModelArgs;
use super::stats::{device_of, settings_of};
use super::{CommandFailure, Outcome, print, usage, write_text};
use clap::ValueEnum;
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use surfel::measure::motion::{self, MotionPlan, MotionSteps, MotionSubject, MotionTarget};
use surfel::measure::temporal::{PictureSequence, TILE, TemporalRules};
use surfel::render::PictureOutputs;
use surfel::render::engine::Engine;
use surfel::render::{Method, Settings};

const EXAMPLES: &str = "\
Examples:
  surfel motion dragon.ply.gz --threshold 3
  surfel motion dragon.ply.gz --threshold 3 --with \"--splat gauss\" --with \"--splat filtered --threshold 1\" -o motion
  surfel motion scan.ply --along dolly --steps 60 --csv scan.csv
  surfel motion scan.ply --along refine --coarsest 16 --json - | jq '.subjects[].figures'

Each frame is compared with the last, less what changes in the reference: triangles (of a cloud: every point) in
--samples samples a pixel. One exact sample of it is measured beside the others. docs/MEASURING.md says what each figure
means.";

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum MotionPathName {
    /// The camera turns about the model
    Orbit,
    /// The camera goes straight ahead
    Dolly,
    /// The camera rests and the threshold falls, as when the viewer is idle
    Refine,
}

impl From<MotionPathName> for motion::CameraPath {
    fn from(name: MotionPathName) -> Self {
        match name {
            MotionPathName::Orbit => Self::Orbit,
            MotionPathName::Dolly => Self::Dolly,
            MotionPathName::Refine => Self::Refine,
        }
    }
}

/// Measure flicker, popping and churn of the cut along a path.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct MotionArgs {
    #[command(flatten)]
    source: ModelArgs,
    /// What moves
    #[arg(long, value_enum, default_value = "orbit")]
    along: MotionPathName,
    /// Steps from frame to frame; there is one frame more
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    steps: u32,
    /// How far the camera moves in a step: the angle of an orbit; a dolly goes as far straight ahead
    #[arg(long, value_name = "DEGREES", default_value_t = 0.25)]
    degrees_per_step: f64,
    /// Refine: the first threshold over the last
    #[arg(long, value_name = "FACTOR", default_value_t = 8.0)]
    coarsest: f32,
    /// Measure another look too: options as below, in quotes, instead of those given without; repeatable
    #[arg(long, value_name = "OPTIONS", allow_hyphen_values = true)]
    with: Vec<String>,
    /// Samples per pixel of the reference: 1, 4, 9, 16, 25, 36, 49 or 64
    #[arg(long, value_name = "N", default_value_t = 16)]
    samples: u32,
    /// Frames a second, for popping
    #[arg(long, value_name = "RATE", default_value_t = TemporalRules::default().frames_per_second)]
    fps: f64,
    /// A tile of 8 x 8 pixels pops when it changes by more than this besides the reference, levels of 255
    #[arg(long, value_name = "LEVELS", default_value_t = TemporalRules::default().pop_level)]
    pop_level: f64,
    /// Folder to write a picture of each look's worst step to; made if it is not there
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Write all figures as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write one row a step, comma-separated; - for standard output
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    #[command(flatten)]
    camera: CameraArgs,
    /// Where the path begins [default: 30,20,1]
    #[arg(long, value_name = "AZIMUTH,ELEVATION,FILL", value_parser = parse_orbit, allow_hyphen_values = true)]
    orbit: Option<[f64; 3]>,
    #[command(flatten)]
    look: LookArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

impl MotionArgs {
    fn check(&self) -> Outcome {
        if !(self.degrees_per_step > 0.0 && self.degrees_per_step <= 45.0) {
            return Err(usage(format!(
                "--degrees-per-step {} is no angle above 0, up to 45",
                self.degrees_per_step
            )));
        }
        if !(1.0..=4096.0).contains(&self.coarsest) {
            return Err(usage(format!(
                "--coarsest {} is no factor from 1 to 4096",
                self.coarsest
            )));
        }
        let root = self.side();
        if self.samples == 0 || root * root != self.samples || self.samples > 64 {
            return Err(usage(format!(
                "--samples {}: expected a square from 1 to 64",
                self.samples
            )));
        }
        if !(self.fps > 0.0 && self.fps <= 10_000.0) {
            return Err(usage(format!(
                "--fps {} is no rate above 0, up to 10000",
                self.fps
            )));
        }
        if !(0.0..=510.0).contains(&self.pop_level) {
            return Err(usage(format!(
                "--pop-level {} is no change from 0 to 510",
                self.pop_level
            )));
        }
        let paths: Vec<&PathBuf> = [&self.json, &self.csv].into_iter().flatten().collect();
        super::check_outputs(&paths, &self.source.model)?;
        if let Some(folder) = &self.output {
            // Now, and not after minutes of work.
            std::fs::create_dir_all(folder).map_err(|e| {
                let what = format!("cannot make the folder {}", folder.display());
                CommandFailure::Run(anyhow::Error::new(e).context(what))
            })?;
        }
        Ok(())
    }

    /// Samples along a side of a pixel.
    fn side(&self) -> u32 {
        f64::from(self.samples).sqrt().round() as u32
    }

    /// The yardstick, the look of the command line, and those beside it.
    fn subjects(&self) -> Result<Vec<MotionSubject>, CommandFailure> {
        let base = self.look.settings()?;
        let mut subjects = vec![MotionSubject {
            label: "one exact sample".into(),
            settings: Settings {
                method: Method::Triangles,
                ..base
            },
        }];
        if base.method != Method::Triangles {
            subjects.push(MotionSubject {
                label: name(&base),
                settings: base,
            });
        }
        for text in &self.with {
            let look = self.look.varied(text)?;
            subjects.push(MotionSubject {
                label: text.split_whitespace().collect::<Vec<_>>().join(" "),
                settings: look.settings()?,
            });
        }
        Ok(subjects)
    }

    /// Tells whether standard output is taken by data for programs.
    fn takes_output(&self) -> bool {
        [&self.json, &self.csv]
            .into_iter()
            .any(|path| path.as_deref() == Some(Path::new("-")))
    }
}

/// A look in a few words.
fn name(settings: &Settings) -> String {
    let word = |value: serde_json::Result<serde_json::Value>| match value {
        Ok(serde_json::Value::String(word)) => word,
        _ => String::new(),
    };
    let method = word(serde_json::to_value(settings.method));
    let splat = word(serde_json::to_value(settings.splat));
    format!("{method}, {splat}, {} px", settings.threshold_px)
}

pub(crate) fn run(args: MotionArgs, quiet: bool) -> Outcome {
    args.check()?;
    let mut subjects = args.subjects()?;
    let camera = args.camera.read()?;
    let ready = args.source.open(quiet)?;
    let model = &ready.model;
    if !model.kind().is_surface() {
        // Of a cloud every point is drawn, as the reference does.
        subjects[0].settings = motion::reference_settings(model, &subjects[0].settings);
    }
    let fits_planes = camera.is_none();
    let start = match camera {
        Some(camera) => camera,
        None => orbit_cameras(
            ready.model.orbit_sphere(),
            args.camera.size(),
            args.orbit,
            1,
        )
        .remove(0),
    };
    let steps = MotionSteps {
        path: args.along.into(),
        count: args.steps,
        angle: args.degrees_per_step.to_radians(),
        coarsest: args.coarsest,
    };
    let frames = motion::frames(&start, &MotionTarget::of(model), &steps, fits_planes)?;
    let size = (start.width, start.height);
    let backend = args.device.open()?;
    let mut engine = Engine::new(&backend, model, size, PictureOutputs::default())?;
    let plan = MotionPlan {
        frames: &frames,
        subjects: &subjects,
        samples_side: args.side(),
        rules: TemporalRules {
            pop_level: args.pop_level,
            frames_per_second: args.fps,
        },
    };
    let bar = JobBar::new(quiet);
    let found = motion::measure(&mut engine, model, &plan, &bar)?;
    drop(bar);
    if let Some(folder) = &args.output {
        write_pictures(folder, &found)?;
    }
    if let Some(path) = &args.json {
        let about = |(subject, sequence): (&MotionSubject, &PictureSequence)| {
            json!({
                "label": subject.label,
                "settings": settings_of(&ready, &subject.settings, size),
                "figures": sequence.figures(),
                "steps": sequence.steps(),
            })
        };
        let all = json!({
            "model": super::info::facts(&ready),
            "device": device_of(&backend),
            "path": steps.path,
            "steps": args.steps,
            "degrees_per_step": args.degrees_per_step,
            "coarsest": args.coarsest,
            "samples": args.samples,
            "rules": plan.rules,
            "subjects": subjects.iter().zip(&found).map(about).collect::<Vec<_>>(),
        });
        let text = serde_json::to_string_pretty(&all).map_err(|e| CommandFailure::Run(e.into()))?;
        write_text(path, &(text + "\n"))?;
    }
    if let Some(path) = &args.csv {
        write_text(path, &rows(&subjects, &found))?;
    }
    if !args.takes_output() {
        let moves = match args.along {
            MotionPathName::Orbit => format!("orbit, {} degrees a step", args.degrees_per_step),
            MotionPathName::Dolly => {
                format!("dolly, {:.2} % of the distance a step", 100.0 * steps.angle)
            }
            MotionPathName::Refine => format!("refine, from {} times the threshold", args.coarsest),
        };
        let head = format!(
            "{}: {moves}, {} steps at {} a second, {} x {} px, {} samples in the reference\n\n",
            ready.name, args.steps, args.fps, size.0, size.1, args.samples
        );
        print(&(head + &table(&subjects, &found, &plan.rules)))?;
    }
    validated(&backend)
}

/// `worst-0.png` is of the first row of the table.
fn write_pictures(folder: &Path, found: &[PictureSequence]) -> Outcome {
    for (i, sequence) in found.iter().enumerate() {
        if let Some(picture) = sequence.worst_picture(2.0) {
            picture.save_png(&folder.join(format!("worst-{i}.png")))?;
        }
    }
    Ok(())
}

/// Figures in columns, one row a look.
fn table(subjects: &[MotionSubject], found: &[PictureSequence], rules: &TemporalRules) -> String {
    let width = subjects.iter().map(|s| s.label.chars().count()).max();
    let width = width.unwrap_or(0).max(16);
    let mut text = format!(
        "{:width$}  {:>26}  {:>11}  {:>15}\n{:width$}  {:>8}{:>9}{:>9}  {:>11}  {:>7}{:>8}\n",
        "",
        "flicker, levels",
        "pops",
        "churn of cut",
        "",
        "mean",
        "p99",
        "max",
        "a second",
        "mean",
        "max"
    );
    let share = |churn: Option<f64>| churn.map_or("-".into(), |c| format!("{:.1} %", 100.0 * c));
    for (subject, sequence) in subjects.iter().zip(found) {
        let f = sequence.figures();
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{:width$}  {:>8.2}{:>9.1}{:>9.1}  {:>11.0}  {:>7}{:>8}",
            subject.label,
            f.mean_level,
            f.p99_level,
            f.max_level,
            f.pops_per_second,
            share(f.mean_churn),
            share(f.max_churn)
        );
    }
    let change = found.first().map_or(0.0, |s| s.figures().reference_level);
    text + &format!(
        "\nThe reference itself changes by {change:.2} levels a step. A pop is a tile of {TILE} x {TILE} pixels that \
         changes by more\nthan {} levels besides it (root of the mean square).\n",
        rules.pop_level
    )
}

/// One row a look and step.
fn rows(subjects: &[MotionSubject], found: &[PictureSequence]) -> String {
    let mut text = String::from(
        "label,frame,object_pixels,mean_level,max_level,max_x,max_y,reference_level,pops,worst_tile_x,worst_tile_y,worst_tile_level,churn\n",
    );
    for (subject, sequence) in subjects.iter().zip(found) {
        let label = subject.label.replace('"', "\"\"");
        for step in sequence.steps() {
            let tile = &step.worst_tile;
            let [x, y] = step.max_at;
            let _ = writeln!(
                text,
                "\"{label}\",{},{},{},{},{x},{y},{},{},{},{},{},{}",
                step.frame,
                step.object_pixels,
                step.mean_level,
                step.max_level,
                step.reference_level,
                step.pops,
                tile.x,
                tile.y,
                255.0 * tile.rmse,
                step.churn.map_or(String::new(), |c| c.to_string())
            );
        }
    }
    text
}
