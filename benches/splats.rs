//! The figures of round and fuzzy splats: error against supersampled triangles, holes, and the cost of the three passes.
//!
//! `cargo bench --bench splats -- targets` prints every figure that splats must reach, with met or MISSED (`-- targets cost`
//! those of the parts with that word in their name). Without
//! arguments everything else runs; `-- errors`, `-- lowpass`, `-- holes`, `-- cost` are its parts. Real models are looked
//! for in `SURFEL_MODELS` (a word after the part names those to take). Times depend on the machine.

#[path = "shared/passes.rs"]
mod passes;
#[path = "splats/targets.rs"]
mod targets;

use std::path::PathBuf;
use surfel::generate::{self, GeneratedShape, ShapeSpec};
use surfel::gpu::DeviceOptions;
use surfel::image::compare;
use surfel::input;
use surfel::math::camera::View;
use surfel::measure::ValueDistribution;
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::stats::FrameTimes;
use surfel::render::{Blend, Method, Settings, SplatKind};
use surfel::tree::{self, BuildOptions, Model};

const SIZE: (u32, u32) = (400, 400);

fn generated(shape: GeneratedShape, triangles: u64) -> Model {
    let spec = ShapeSpec::with_triangles(shape, triangles).expect("a valid size");
    tree::build(
        generate::mesh(&spec),
        &BuildOptions::default(),
        &SilentProgress,
    )
    .expect("the tree builds")
}

fn real(name: &str) -> Option<Model> {
    let path = PathBuf::from(std::env::var_os("SURFEL_MODELS")?).join(name);
    let mesh = input::load(&path, &input::ReadOptions::default(), &SilentProgress)
        .ok()?
        .mesh;
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).ok()
}

/// Smooth models, each with more triangles than pixels.
fn models(only: Option<&str>) -> Vec<(&'static str, Model)> {
    let wanted = |name: &str| only.is_none_or(|only| name.contains(only));
    let shapes = [
        ("sphere", GeneratedShape::Sphere, 500_000),
        ("torus", GeneratedShape::Torus, 500_000),
        ("statue", GeneratedShape::Statue, 1_000_000),
    ];
    let mut models: Vec<_> = shapes
        .into_iter()
        .filter(|(name, ..)| wanted(name))
        .map(|(name, shape, triangles)| (name, generated(shape, triangles)))
        .collect();
    for (name, path) in [
        ("bunny", "meshes/bun_zipper.ply.gz"),
        ("horse", "thesis/horse.ply"),
        ("dragon", "thesis/dragon_vrip.ply.gz"),
    ] {
        if wanted(name) {
            match real(path) {
                Some(model) => models.push((name, model)),
                None => println!("{name} is absent"),
            }
        }
    }
    models
}

fn orbit(model: &Model, size: (u32, u32), fill: f64, k: u32, n: u32) -> View {
    model
        .orbit_step(size, fill, k, n)
        .view(model.origin)
        .expect("a camera of the orbit")
}

fn triangles() -> Settings {
    Settings {
        method: Method::Triangles,
        ..Settings::default()
    }
}

fn splats(splat: SplatKind, blend: Blend, threshold_px: f32) -> Settings {
    Settings {
        splat,
        blend: Some(blend),
        threshold_px,
        ..Settings::default()
    }
}

fn engine<'m>(backend: &Backend, model: &'m Model, size: (u32, u32)) -> Engine<'m> {
    Engine::new(backend, model, size, PictureOutputs::default()).expect("the model fits the device")
}

/// Root of the mean squared error over object pixels, in levels of 255, against 16 samples of triangles.
fn errors(backend: &Backend, only: Option<&str>) {
    let cases = [
        ("square", SplatKind::Square, Blend::Opaque),
        ("disc", SplatKind::Disc, Blend::Opaque),
        ("ellipse", SplatKind::Ellipse, Blend::Opaque),
        ("square fuzzy", SplatKind::Square, Blend::TwoPass),
        ("ellipse fuzzy", SplatKind::Ellipse, Blend::TwoPass),
        ("gauss", SplatKind::Gauss, Blend::TwoPass),
    ];
    println!(
        "RMSE over object pixels, levels of 255, mean of three views; gauss at most half of square at 2 and 3"
    );
    for (name, model) in models(only) {
        let mut engine = engine(backend, &model, SIZE);
        let views: Vec<View> = (0..3).map(|k| orbit(&model, SIZE, 0.9, k, 3)).collect();
        let references: Vec<_> = views
            .iter()
            .map(|view| {
                engine
                    .supersample(view, &triangles(), 4)
                    .expect("a reference")
            })
            .collect();
        let mut rmse = |settings: &Settings| {
            let sum: f64 = views
                .iter()
                .zip(&references)
                .map(|(view, reference)| {
                    let picture = engine.render(view, settings).expect("a frame");
                    let d = compare(reference, &picture, 8.0).expect("pictures of one size");
                    255.0 * d.object.rmse
                })
                .sum();
            sum / views.len() as f64
        };
        println!("{name}: one exact sample {:.2}", rmse(&triangles()));
        for threshold in [1.0, 2.0, 3.0, 8.0] {
            print!("  threshold {threshold}:");
            let mut square = 0.0;
            for (what, kind, blend) in cases {
                let error = rmse(&splats(kind, blend, threshold));
                if what == "square" {
                    square = error;
                }
                print!("  {what} {error:.2}");
                if what == "gauss" {
                    let verdict = if error <= square / 2.0 {
                        "met"
                    } else {
                        "MISSED"
                    };
                    print!(" ({:.2} of square: {verdict})", error / square);
                }
            }
            println!();
        }
    }
}

/// What the low-pass filter does to the error of Gaussians.
fn low_pass(backend: &Backend, only: Option<&str>) {
    println!("RMSE of gauss over object pixels, levels of 255, by --low-pass");
    for (name, model) in models(only) {
        let mut engine = engine(backend, &model, SIZE);
        let view = orbit(&model, SIZE, 0.9, 0, 3);
        let reference = engine
            .supersample(&view, &triangles(), 4)
            .expect("a reference");
        for threshold in [1.0, 2.0, 3.0, 8.0] {
            print!("{name}, threshold {threshold}:");
            for width in [0.0, 0.2, 0.3, 0.4, 0.5, 0.7] {
                let settings = Settings {
                    low_pass_px: Some(width),
                    ..splats(SplatKind::Gauss, Blend::TwoPass, threshold)
                };
                let picture = engine.render(&view, &settings).expect("a frame");
                let d = compare(&reference, &picture, 8.0).expect("pictures of one size");
                print!("  {width}: {:.2}", 255.0 * d.object.rmse);
            }
            println!();
        }
    }
}

/// Pixels that are missing inside the outline of a closed surface, in 100 views.
fn holes(backend: &Backend, only: Option<&str>) {
    println!("hole pixels in 100 views of 200 x 200, by kind, at thresholds 1 to 16");
    for (name, model) in models(only) {
        let size = (200, 200);
        let mut engine = engine(backend, &model, size);
        let mut counts = [0u64; 4];
        for k in 0..100 {
            let view = orbit(&model, size, [0.9, 0.4, 2.0][k as usize % 3], k, 100);
            let reference = engine.render(&view, &triangles()).expect("a reference");
            let threshold = 1.0 + (k % 16) as f32;
            for (count, (kind, blend)) in counts.iter_mut().zip([
                (SplatKind::Square, Blend::Opaque),
                (SplatKind::Disc, Blend::Opaque),
                (SplatKind::Ellipse, Blend::Opaque),
                (SplatKind::Gauss, Blend::TwoPass),
            ]) {
                let picture = engine
                    .render(&view, &splats(kind, blend, threshold))
                    .expect("a frame");
                *count += compare(&reference, &picture, 8.0)
                    .expect("pictures of one size")
                    .hole_pixels;
            }
        }
        let [square, disc, ellipse, gauss] = counts;
        println!("{name}: square {square}, disc {disc}, ellipse {ellipse}, gauss {gauss}");
    }
}

/// The times of nine frames, after two more.
fn frames(engine: &mut Engine<'_>, view: &View, settings: &Settings) -> Vec<FrameTimes> {
    for _ in 0..2 {
        engine.draw(view, settings).expect("a frame");
    }
    (0..9)
        .map(|_| engine.draw(view, settings).expect("a frame"))
        .collect()
}

/// Vertices in footprints of `threshold_px` pixels, without a low pass.
fn vertices(kind: SplatKind, blend: Blend, threshold_px: f32) -> Settings {
    Settings {
        method: Method::Points,
        low_pass_px: (kind == SplatKind::Gauss).then_some(0.0),
        ..splats(kind, blend, threshold_px)
    }
}

/// Most that a fuzzy splat of four pixels may take in all three passes, nanoseconds, on two cores and a software device.
const FUZZY_TARGET_NS: f64 = 420.0;

/// Nanoseconds a splat: 500,000 vertices in a few pixels each.
fn cost(backend: &Backend) {
    // One vertex for two triangles.
    let model = generated(GeneratedShape::Statue, 1_000_000);
    let size = (1024, 768);
    let mut engine = engine(backend, &model, size);
    let view = orbit(&model, size, 1.0, 0, 3);
    for (name, kind, blend, threshold, target) in [
        ("square", SplatKind::Square, Blend::Opaque, 2.0, None),
        ("disc", SplatKind::Disc, Blend::Opaque, 2.26, None),
        ("ellipse", SplatKind::Ellipse, Blend::Opaque, 2.26, None),
        ("square fuzzy", SplatKind::Square, Blend::TwoPass, 2.0, None),
        ("disc fuzzy", SplatKind::Disc, Blend::TwoPass, 2.26, None),
        (
            "ellipse fuzzy",
            SplatKind::Ellipse,
            Blend::TwoPass,
            2.26,
            None,
        ),
        (
            "gauss",
            SplatKind::Gauss,
            Blend::TwoPass,
            2.26,
            Some(FUZZY_TARGET_NS),
        ),
        (
            "gauss, 4 pixels wide",
            SplatKind::Gauss,
            Blend::TwoPass,
            4.0,
            None,
        ),
    ] {
        let settings = vertices(kind, blend, threshold);
        let runs = frames(&mut engine, &view, &settings);
        let of = |ms: &dyn Fn(usize) -> f64| {
            let times: Vec<f64> = (0..runs.len()).map(ms).collect();
            (
                times.iter().copied().fold(f64::INFINITY, f64::min),
                ValueDistribution::of(&times).median,
            )
        };
        let count = runs[0].counts.points as f64;
        let (least, median) = of(&|i| runs[i].passes.iter().map(|p| p.ms).sum());
        let ns = |ms: f64| ms * 1e6 / count;
        print!(
            "{name}, {threshold} px: {:.0} ns a splat (median {:.0})",
            ns(least),
            ns(median)
        );
        for (i, pass) in runs[0].passes.iter().enumerate() {
            print!(
                "  {} {:.0}",
                pass.name,
                ns(of(&|run| runs[run].passes[i].ms).0)
            );
        }
        match target {
            Some(target) => println!(
                "  at most {target}: {}",
                if ns(least) <= target { "met" } else { "MISSED" }
            ),
            None => println!(),
        }
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1).filter(|a| !a.starts_with('-'));
    let (part, only) = (arguments.next(), arguments.next());
    let runs = |name: &str| part.as_deref().is_none_or(|part| part == name);
    let backend = match Backend::open(&DeviceOptions::default()) {
        Ok(backend) => backend,
        Err(error) => {
            println!("no device, nothing measured: {error}");
            return;
        }
    };
    println!("on {}", backend.name());
    if part.as_deref() == Some("targets") {
        targets::all(&backend, only.as_deref());
        return;
    }
    if runs("errors") {
        errors(&backend, only.as_deref());
    }
    if runs("lowpass") {
        low_pass(&backend, only.as_deref());
    }
    if runs("holes") {
        holes(&backend, only.as_deref());
    }
    if runs("cost") {
        cost(&backend);
    }
}
