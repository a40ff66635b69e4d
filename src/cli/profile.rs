//! `surfel profile`

use super::cameras::{CameraArgs, orbit_cameras, parse_orbit};
use super::costs::costs_of;
use super::look::LookArgs;
use super::photo_args::{PhotoArgs, StagedScene};
use super::progress::JobBar;
use super::render::{DeviceArgs, validated};
use super::source::ModelArgs;
use super::stats::{device_of, settings_of};
use super::vertex_splats::make_even_splats;
use super::{CommandFailure, Outcome, bytes, count, print, say, usage, write_text};
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use surfel::OpenedModel;
use surfel::math::camera::View;
use surfel::measure::ValueDistribution;
use surfel::measure::profile::{FrameProfile, ProfilePlan, ProfileProof};
use surfel::measure::report::{PatchReport, ProfileReport};
use surfel::progress::Progress;
use surfel::projective::frame_photos::FramePhotos;
use surfel::render::PictureOutputs;
use surfel::render::engine::Engine;

const EXAMPLES: &str = "\
Examples:
  surfel profile dragon.ply.gz
  surfel profile dragon.ply.gz --splat filtered --threshold 3 --frames 36
  surfel profile scan.ply --camera camera.json --json scan.json --csv scan.csv
  surfel profile scan.ply --trace scan.trace.json        open it in ui.perfetto.dev or chrome://tracing
  surfel profile scan.ply --json - | jq .passes

Every view is drawn three times: with timestamps, without, and once to count. docs/MEASURING.md says what each
figure means.";

/// Measure what each pass and each stage of a frame costs.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ProfileArgs {
    #[command(flatten)]
    source: ModelArgs,
    /// Views of the standard orbit to measure (azimuth (k + 1/2) 360/N degrees); with --camera as often that one
    #[arg(long, value_name = "N", default_value_t = 120)]
    frames: u32,
    /// Frames drawn before, which do not count
    #[arg(long, value_name = "N", default_value_t = 3)]
    warm_up: u32,
    /// Write all figures as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write one row a frame, comma-separated; - for standard output
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write a trace for Perfetto or chrome://tracing; - for standard output
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    #[command(flatten)]
    camera: CameraArgs,
    /// Where the orbit begins, its elevation and its fill [default: 0,20,1]
    #[arg(long, value_name = "AZIMUTH,ELEVATION,FILL", value_parser = parse_orbit, allow_hyphen_values = true)]
    orbit: Option<[f64; 3]>,
    #[command(flatten)]
    look: LookArgs,
    #[command(flatten)]
    photos: PhotoArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

impl ProfileArgs {
    fn check(&self) -> Outcome {
        if self.frames == 0 || self.frames > 10_000 {
            return Err(usage(format!(
                "--frames {}: expected 1 to 10000",
                self.frames
            )));
        }
        if self.warm_up > 1000 {
            return Err(usage(format!(
                "--warm-up {}: expected 0 to 1000",
                self.warm_up
            )));
        }
        let paths: Vec<&PathBuf> = [&self.json, &self.csv, &self.trace]
            .into_iter()
            .flatten()
            .collect();
        super::check_outputs(&paths, &self.source.model)
    }

    /// Tells whether standard output is taken by data for programs.
    fn takes_output(&self) -> bool {
        let is_output = |path: &Option<PathBuf>| path.as_deref() == Some(Path::new("-"));
        is_output(&self.json) || is_output(&self.csv) || is_output(&self.trace)
    }
}

pub(crate) fn run(args: ProfileArgs, quiet: bool) -> Outcome {
    args.check()?;
    let settings = args.photos.shown(args.look.settings()?);
    let of_photos = args.photos.read()?;
    let camera = args.camera.read()?;
    let ready = args.source.open(quiet)?;
    let cameras = match camera {
        Some(camera) => vec![camera; args.frames as usize],
        None => orbit_cameras(
            ready.model.orbit_sphere(),
            args.camera.size(),
            args.orbit,
            args.frames,
        ),
    };
    let size = (cameras[0].width, cameras[0].height);
    let views = cameras
        .iter()
        .map(|c| c.view(ready.model.origin))
        .collect::<Result<Vec<_>, _>>()?;
    let backend = args.device.open()?;
    let mut engine = Engine::new(&backend, &ready.model, size, PictureOutputs::default())?;
    engine.build_patches(&settings, &JobBar::new(quiet))?;
    make_even_splats(&engine, &settings, quiet)?;
    engine.set_costs(costs_of(&backend, &[settings]));
    let most = args.photos.most();
    let staged = of_photos.map(|scene| StagedScene::new(scene, &ready, &backend, most, quiet));
    let (photos, choice_ms) = chosen_photos(staged.transpose()?, &views);
    let plan = ProfilePlan {
        views: &views,
        settings: &settings,
        photos: &photos,
        warm_up: args.warm_up,
    };
    let bar = JobBar::new(quiet);
    bar.stage("self-test", 0);
    let proof = ProfileProof::of(&backend)?;
    let profile = FrameProfile::run(&backend, &mut engine, &plan, proof, &bar)?;
    drop(bar);
    let mut report = ProfileReport::of(&profile);
    report.photo_choice_ms = (!choice_ms.is_empty()).then(|| ValueDistribution::of(&choice_ms));
    for warning in &report.warnings {
        say(&format!("surfel: warning: {warning}"));
    }
    let about = json!({
        "model": ready.name,
        "settings": settings_of(&ready, &settings, size),
        "frames": views.len(),
    });
    if let Some(path) = &args.json {
        let mut all = json!({
            "model": super::info::facts(&ready),
            "device": device_of(&backend),
            "settings": settings_of(&ready, &settings, size),
        });
        let figures = serde_json::to_value(&report).map_err(|e| CommandFailure::Run(e.into()))?;
        if let (Some(all), serde_json::Value::Object(figures)) = (all.as_object_mut(), figures) {
            all.extend(figures);
            all.insert("memory".into(), memory(&ready, &profile));
        }
        let text = serde_json::to_string_pretty(&all).map_err(|e| CommandFailure::Run(e.into()))?;
        write_text(path, &(text + "\n"))?;
    }
    if let Some(path) = &args.csv {
        write_text(path, &profile.csv())?;
    }
    if let Some(path) = &args.trace {
        let trace = profile.trace(about);
        let text = serde_json::to_string(&trace).map_err(|e| CommandFailure::Run(e.into()))?;
        write_text(path, &(text + "\n"))?;
    }
    if !args.takes_output() {
        let head = format!(
            "{}: {} triangles, {} vertices; {}, splats {}, threshold {} px, traversal {}, {} x {} px\n",
            ready.name,
            count(ready.model.triangles.len() as u64),
            count(ready.model.vertices.len() as u64),
            word(&settings.method),
            word(&settings.splat),
            settings.threshold_px,
            word(&settings.traversal),
            size.0,
            size.1,
        );
        print(&(head + &table(&ready, &profile, &report)))?;
    }
    validated(&backend)
}

/// Photographs of each view and how long choosing them took, milliseconds; nothing without a scene.
fn chosen_photos(staged: Option<StagedScene>, views: &[View]) -> (Vec<Arc<FramePhotos>>, Vec<f64>) {
    let chosen = staged.map(|mut staged| {
        let of_view = |view| staged.timed_frame(view);
        views.iter().map(of_view).unzip()
    });
    chosen.unwrap_or_default()
}

/// The name that a setting has in JSON.
fn word(value: &impl serde::Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(word)) => word,
        _ => String::new(),
    }
}

/// What the model and the device's allocations take, bytes.
fn memory(ready: &OpenedModel, profile: &FrameProfile) -> serde_json::Value {
    let resources: Vec<_> = profile
        .memory
        .iter()
        .map(|(name, bytes)| json!({ "name": name, "bytes": bytes }))
        .collect();
    json!({
        "device_bytes": profile.memory.iter().map(|m| m.1).sum::<u64>(),
        "resources": resources,
        "model_bytes": ready.model.memory_bytes(),
    })
}

/// Rows of figures in columns.
#[derive(Default)]
struct TextTable(String);

impl TextTable {
    fn line(&mut self, cells: [&str; 5]) {
        let [name, median, p5, p95, share] = cells;
        let line = format!("{name:<28}{median:>13}{p5:>13}{p95:>13}{share:>9}");
        self.0 += line.trim_end();
        self.0.push('\n');
    }

    fn row(
        &mut self,
        name: &str,
        d: &ValueDistribution,
        show: &dyn Fn(f64) -> String,
        share: Option<f64>,
    ) {
        let share = share.map(|s| format!("{:.1} %", 100.0 * s));
        let [median, p5, p95] = [d.median, d.p5, d.p95].map(show);
        self.line([
            name,
            &median,
            &p5,
            &p95,
            share.as_deref().unwrap_or_default(),
        ]);
    }

    fn ms(&mut self, name: &str, d: &ValueDistribution, share: Option<f64>) {
        self.row(name, d, &|v| format!("{v:.3}"), share);
    }

    fn count(&mut self, name: &str, d: &ValueDistribution) {
        self.row(name, d, &|v| count(v.round() as u64), None);
    }

    fn bytes(&mut self, name: &str, d: &ValueDistribution) {
        self.row(name, d, &|v| bytes(v.round() as u64), None);
    }

    /// A figure that is the same in every frame.
    fn one(&mut self, name: &str, value: &str) {
        self.line([name, value, "", "", ""]);
    }

    fn text(&mut self, text: &str) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.0, "{text}");
    }
}

const UNKNOWN: &str = "not known on this device";

fn table(ready: &OpenedModel, profile: &FrameProfile, report: &ProfileReport) -> String {
    let mut t = TextTable::default();
    match &profile.device {
        Some(info) if info.is_cpu() => t.text(&format!(
            "{}, software: it ranks passes and predicts no graphics card",
            info.name
        )),
        Some(info) => t.text(&info.name),
        None => t.text("reference: the processor draws, without Vulkan"),
    }
    t.text(&format!(
        "{} frames, times in milliseconds\n",
        report.frames
    ));

    t.line(["", "median", "p5", "p95", "share"]);
    t.ms("frame", &report.frame.wall_ms, Some(1.0));
    if let Some(plain) = &report.frame.wall_without_timestamps_ms {
        t.ms("  without timestamps", plain, None);
    }
    t.text("CPU, share of the frame");
    for stage in &report.cpu {
        t.ms(&format!("  {}", stage.name), &stage.ms, Some(stage.share));
    }
    if let Some(choice) = &report.photo_choice_ms {
        t.ms("choice of photographs, before the frame", choice, None);
    }
    match &report.frame.device_ms {
        Some(device) => {
            t.text("device, share of the passes");
            for pass in &report.passes {
                let name = format!("  {}", pass.name);
                match &pass.gpu_ms {
                    Some(ms) => t.ms(&name, ms, Some(pass.share)),
                    None => t.one(&name, "not timed"),
                }
            }
            t.ms("  first to last command", device, None);
        }
        None => t.text(&format!(
            "device: pass times are {UNKNOWN}, it has no timestamps"
        )),
    }

    t.text("\ncounts");
    t.one(
        "  nodes in the tree",
        &count((ready.model.tree.nodes.len() + ready.model.tree.leaves.len()) as u64),
    );
    let c = &report.counts;
    t.count("  nodes visited", &c.nodes_visited);
    t.count("  splats", &c.splats);
    t.count("  triangles", &c.triangles);
    t.count("  points", &c.points);
    t.one("  pixels", &count(c.pixels));
    t.count("  covered pixels", &c.covered_pixels);
    match (&c.samples, &c.overdraw) {
        (Some(samples), Some(overdraw)) => {
            t.count("  samples drawn", samples);
            t.row("  overdraw", overdraw, &|v| format!("{v:.2}"), None);
        }
        (Some(samples), None) => t.count("  samples drawn", samples),
        _ => t.text(&format!("  samples drawn, overdraw: {UNKNOWN}")),
    }
    if let Some(patches) = &c.patches {
        patch_rows(&mut t, patches);
    }
    t.text("\nbytes");
    t.bytes("  draw lists", &report.bytes.draw_lists);
    t.bytes("  uploaded", &report.bytes.uploaded);
    t.bytes("  targets loaded", &report.bytes.loaded);
    t.bytes("  targets stored", &report.bytes.stored);
    for pass in &report.passes {
        if pass.samples.is_none() && pass.pipeline.is_empty() {
            continue;
        }
        t.text(&format!("\ncounters of {}", pass.name));
        if let Some(samples) = &pass.samples {
            t.count("  samples drawn", samples);
        }
        if let Some(overdraw) = &pass.overdraw {
            t.row("  overdraw", overdraw, &|v| format!("{v:.2}"), None);
        }
        for counter in &pass.pipeline {
            t.count(
                &format!("  {}", counter.name.replace('_', " ")),
                &counter.count,
            );
        }
    }
    if let Some(test) = &report.profiling.counter_test {
        let unknown: Vec<String> = test
            .rows
            .iter()
            .filter(|r| !r.is_exact())
            .map(|r| r.name.replace('_', " "))
            .collect();
        if !unknown.is_empty() {
            t.text(&format!(
                "\n{UNKNOWN}, counted wrong or not at all: {}",
                unknown.join(", ")
            ));
        }
    }
    if !profile.memory.is_empty() {
        t.text("\ndevice memory");
        let all: u64 = profile.memory.iter().map(|m| m.1).sum();
        t.one("  all", &bytes(all));
        for (name, size) in &profile.memory {
            t.one(&format!("  {name}"), &bytes(*size));
        }
    }
    proof(&mut t, report);
    t.0
}

/// Error patches by size, and nodes by what refused them.
fn patch_rows(t: &mut TextTable, patches: &PatchReport) {
    let sizes = ["up to 2 px", "4 px", "8 px", "16 px", "32 px", "larger"];
    for (name, count) in sizes.iter().zip(&patches.sizes) {
        t.count(&format!("  patches {name}"), count);
    }
    let reasons = ["cone", "near plane", "silhouette", "error", "shade", "size"];
    for (name, count) in reasons.iter().zip(&patches.refused) {
        t.count(&format!("  refused, {name}"), count);
    }
}

/// Tells whether it can be believed.
fn proof(t: &mut TextTable, report: &ProfileReport) {
    let proof = &report.profiling;
    t.text("\ncan it be believed?");
    if let Some(test) = &proof.self_test {
        t.text(&format!(
            "  self-test: passes among others and alone {}",
            if test.agrees { "agree" } else { "DO NOT AGREE" }
        ));
    }
    if let Some(sum) = proof.passes_of_device {
        t.text(&format!(
            "  the passes are {:.1} % of the frame on the device",
            100.0 * sum
        ));
    }
    if let Some(ratio) = proof.device_of_host {
        t.text(&format!(
            "  the device's time is {:.1} % of what the processor saw from submission to end",
            100.0 * ratio
        ));
    }
    if let (Some(cost), Some([low, high]), Some(share)) =
        (&proof.cost_ms, proof.cost_bounds_ms, proof.cost_share)
    {
        t.text(&format!(
            "  timestamps cost {:.3} ms a frame, {:.1} % (median; between {low:.3} and {high:.3} ms{})",
            cost.median,
            100.0 * share,
            if low <= 0.0 && high >= 0.0 {
                ": not told apart from noise"
            } else {
                ""
            }
        ));
    }
    for warning in &report.warnings {
        t.text(&format!("  WARNING: {warning}"));
    }
    if proof.self_test.is_none() {
        t.text("  nothing was timed on a device");
    }
}
