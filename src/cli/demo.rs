//! `surfel demo`

use super::cameras::orbit_camera;
use super::costs::costs_of;
use super::render::{DeviceArgs, validated};
use super::source::{KeepArgs, ModelArgs, SurfaceArgs, ViewFraming};
use super::{CommandFailure, Outcome, count, say};
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Write;
use std::path::PathBuf;
use surfel::image::contact_sheet;
use surfel::measure::ValueDistribution;
use surfel::pack::ColorBy;
use surfel::render::PictureOutputs;
use surfel::render::engine::Engine;
use surfel::render::{Method, Settings, SplatKind};

/// Draw the built-in statue (or another model) with every method: a picture each and a contact sheet.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surfel demo\n  surfel demo --model scan.ply -o out --size 800x800"
)]
pub(crate) struct DemoArgs {
    /// Folder for the pictures; made if it is not there
    #[arg(short, long, value_name = "FOLDER", default_value = "surfel-demo")]
    output: PathBuf,
    /// Model to draw instead: a file or generate:SHAPE[:TRIANGLES]
    #[arg(long, value_name = "MODEL", default_value = "generate:statue:2000000")]
    model: PathBuf,
    /// Size of each picture in pixels
    #[arg(long, value_name = "WxH", default_value = "500x500", value_parser = super::cameras::parse_size)]
    size: (u32, u32),
    /// Frames timed for each picture
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    #[command(flatten)]
    device: DeviceArgs,
}

struct DemoShot {
    file: &'static str,
    label: &'static str,
    method: Method,
    splat: SplatKind,
    threshold_px: f32,
    color_by: ColorBy,
    fill: f64,
}

/// A whole model at threshold 1, as squares.
const BASE: DemoShot = DemoShot {
    file: "pop-1",
    label: "pop, threshold 1 px",
    method: Method::Pop,
    splat: SplatKind::Square,
    threshold_px: 1.0,
    color_by: ColorBy::Shading,
    fill: 1.0,
};

const SHOTS: [DemoShot; 10] = [
    DemoShot {
        file: "triangles",
        label: "triangles",
        method: Method::Triangles,
        ..BASE
    },
    DemoShot {
        file: "points",
        label: "points, 2 px",
        method: Method::Points,
        threshold_px: 2.0,
        ..BASE
    },
    BASE,
    DemoShot {
        file: "pop-3",
        label: "pop, threshold 3 px",
        threshold_px: 3.0,
        ..BASE
    },
    DemoShot {
        file: "pop-8",
        label: "pop, threshold 8 px",
        threshold_px: 8.0,
        ..BASE
    },
    DemoShot {
        file: "filtered-1",
        label: "filtered, threshold 1 px",
        splat: SplatKind::Filtered,
        ..BASE
    },
    DemoShot {
        file: "pop-near",
        label: "pop, threshold 3 px, near",
        threshold_px: 3.0,
        fill: 6.0,
        ..BASE
    },
    DemoShot {
        file: "pop-near-kinds",
        label: "the same: triangles blue",
        threshold_px: 3.0,
        color_by: ColorBy::Primitive,
        fill: 6.0,
        ..BASE
    },
    DemoShot {
        file: "pop-far",
        label: "pop, threshold 1 px, far",
        fill: 0.125,
        ..BASE
    },
    DemoShot {
        file: "filtered-far",
        label: "filtered, 1 px, far",
        splat: SplatKind::Filtered,
        fill: 0.125,
        ..BASE
    },
];

impl DemoShot {
    fn settings(&self) -> Settings {
        Settings {
            method: self.method,
            splat: self.splat,
            threshold_px: self.threshold_px,
            color_by: self.color_by,
            ..Settings::default()
        }
    }

    /// Tells whether this can draw a model without triangles.
    fn draws_clouds(&self) -> bool {
        self.method != Method::Triangles && self.splat == SplatKind::Square
    }
}

pub(crate) fn run(args: DemoArgs, quiet: bool) -> Outcome {
    let source = ModelArgs {
        model: args.model.clone(),
        weld: false,
        frame: ViewFraming::Robust,
        surface: SurfaceArgs::default(),
        keep: KeepArgs::default(),
    };
    let ready = source.open(quiet)?;
    let model = &ready.model;
    say(&format!(
        "{}: {} triangles, {} vertices; ready in {:.1} s (tree {:.1} s)",
        ready.name,
        count(model.triangles.len() as u64),
        count(model.vertices.len() as u64),
        (ready.load_ms + ready.build_ms) / 1e3,
        ready.build_ms / 1e3
    ));
    let backend = args.device.open()?;
    say(&format!("drawing on {}", backend.name()));
    let mut engine = Engine::new(&backend, model, args.size, PictureOutputs::default())?;
    let settings: Vec<Settings> = SHOTS.iter().map(DemoShot::settings).collect();
    engine.set_costs(costs_of(&backend, &settings));
    // Only now, so that a model or device that is not there leaves no folder behind.
    std::fs::create_dir_all(&args.output).map_err(|e| {
        CommandFailure::Run(
            anyhow::Error::new(e)
                .context(format!("cannot make the folder {}", args.output.display())),
        )
    })?;
    let bar = if quiet {
        ProgressBar::hidden()
    } else {
        ProgressBar::new(SHOTS.len() as u64)
    };
    if let Ok(style) = ProgressStyle::with_template("{msg:>26} {wide_bar} {pos}/{len}") {
        bar.set_style(style);
    }
    let mut pictures = Vec::new();
    let mut table = String::new();
    let mut reference_ms = f64::NAN;
    for shot in &SHOTS {
        if super::progress::is_interrupted() {
            return Err(CommandFailure::Run(anyhow::anyhow!("cancelled")));
        }
        if model.kind().is_points() && !shot.draws_clouds() {
            bar.inc(1);
            continue;
        }
        bar.set_message(shot.label);
        let view = orbit_camera(&ready, args.size, [30.0, 20.0, shot.fill]).view(model.origin)?;
        let settings = shot.settings();
        // The first frame compiles shaders and grows buffers.
        engine.draw(&view, &settings)?;
        let mut frames = Vec::new();
        let mut counts = surfel::render::stats::FrameCounts::default();
        for _ in 0..args.repeats {
            let times = engine.draw(&view, &settings)?;
            frames.push(times.frame_ms);
            counts = times.counts;
        }
        let image = engine.read(&view)?;
        let path = args.output.join(format!("{}.png", shot.file));
        image.save_png(&path)?;
        let ms = ValueDistribution::of(&frames).median;
        if shot.method == Method::Triangles {
            reference_ms = ms;
        }
        let drawn = counts.splats + counts.points;
        // Writing to a string cannot fail.
        let _ = writeln!(
            table,
            "{:<26} {:>9.2} ms {:>8} {:>12} {:>12}  {}",
            shot.label,
            ms,
            if shot.fill == 1.0 && reference_ms.is_finite() {
                format!("{:.1}x", reference_ms / ms)
            } else {
                "-".into()
            },
            count(counts.triangles),
            count(drawn),
            path.display()
        );
        pictures.push((format!("{}  {ms:.1} ms", shot.label), image));
        bar.inc(1);
    }
    bar.finish_and_clear();
    let sheet = args.output.join("contact-sheet.png");
    contact_sheet(&pictures, 5).save_png(&sheet)?;
    let mut out = format!(
        "{:<26} {:>12} {:>8} {:>12} {:>12}  picture\n",
        "", "frame", "speed", "triangles", "splats"
    );
    out.push_str(&table);
    let _ = writeln!(
        out,
        "frame: median of {} frames of {}x{} on {}; speed: against triangles at the same distance\nall of them: {}",
        args.repeats,
        args.size.0,
        args.size.1,
        backend.name(),
        sheet.display()
    );
    super::print(&out)?;
    validated(&backend)
}
