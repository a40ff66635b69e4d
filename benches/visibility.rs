//! Visibility splats: what each pass takes, and how far the reconstructions are from supersampled triangles.
//!
//! `cargo bench --bench visibility` prints both; `-- quick` takes smaller models and fewer thresholds, to see that it
//! runs, and `-- times` and `-- errors` one of the two. Real models are looked for in `SURFEL_MODELS`.

#[path = "shared/passes.rs"]
mod passes;

use bytemuck::Zeroable;
use passes::{PULL_PUSH_TARGET_MS, least, settings};
use std::path::PathBuf;
use surfel::abi::Splat;
use surfel::cut::{Cut, CutSelector};
use surfel::generate::{self, GeneratedShape, ShapeSpec};
use surfel::gpu::DeviceOptions;
use surfel::image::{FloatImage, Image, compare};
use surfel::input;
use surfel::math::camera::View;
use surfel::measure::ValueDistribution;
use surfel::pack::{ColorBy, splats};
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::cut_key::cut_settings;
use surfel::render::engine::{Backend, Engine};
use surfel::render::pack_params::splat_plan;
use surfel::render::{Method, Reconstruction, Settings};
use surfel::tree::{self, BuildOptions, Model};

const RECONSTRUCTIONS: [(Reconstruction, &str); 3] = [
    (Reconstruction::Gaussian, "gaussian"),
    (Reconstruction::Density, "density"),
    (Reconstruction::PullPush, "pull-push"),
];

fn statue(triangles: u64) -> Model {
    let spec = ShapeSpec::with_triangles(GeneratedShape::Statue, triangles).expect("a valid size");
    tree::build(
        generate::mesh(&spec),
        &BuildOptions::default(),
        &SilentProgress,
    )
    .expect("the tree builds")
}

fn real(name: &str) -> Option<Model> {
    let path = PathBuf::from(std::env::var_os("SURFEL_MODELS")?).join(name);
    let loaded = input::load(&path, &input::ReadOptions::default(), &SilentProgress);
    match loaded {
        Ok(loaded) => Some(
            tree::build(loaded.mesh, &BuildOptions::default(), &SilentProgress).expect("it builds"),
        ),
        Err(error) => {
            println!("{error}");
            None
        }
    }
}

fn orbit(model: &Model, size: (u32, u32)) -> View {
    let (azimuth, elevation) = (30f64.to_radians(), 20f64.to_radians());
    model
        .orbit_camera(size, azimuth, elevation, 1.0)
        .view(model.origin)
        .expect("a valid camera")
}

/// Time of the passes whose names begin so, milliseconds, in each of a number of frames of all reconstructions in turn.
fn times(backend: &Backend, model: &Model, name: &str, frames: usize) {
    let size = (1024, 768);
    let view = orbit(model, size);
    let mut engine = Engine::new(backend, model, size, PictureOutputs::default()).expect("it fits");
    for threshold in [1.0, 3.0, 8.0] {
        let all = RECONSTRUCTIONS.map(|(how, _)| how);
        let found = passes::times(&mut engine, &view, threshold, &all, frames);
        for ((_, how), found) in RECONSTRUCTIONS.iter().zip(&found) {
            let [depth, centers, filling] =
                [0, 1, 2].map(|i| (ValueDistribution::of(&found[i]).median, least(&found[i])));
            let verdict = match *how {
                "pull-push" if filling.1 <= PULL_PUSH_TARGET_MS => "  at most 21 ms: met",
                "pull-push" => "  at most 21 ms: MISSED",
                _ => "",
            };
            println!(
                "{name}, threshold {threshold}, {how:<9}  depth {:6.1} ms, centers {:6.1} ms, reconstruction {:6.1} ms (least {:.1}){verdict}",
                depth.0, centers.0, filling.0, filling.1
            );
        }
    }
}

/// Percent of the centers that are truly to be seen, by the depth of the triangles, whose pixel shows no center.
fn lost(model: &Model, view: &View, settings: &Settings, depth: &[f32], class: &Image) -> f64 {
    let (mut selector, mut cut) = (CutSelector::default(), Cut::default());
    selector.select(model, view, &cut_settings(settings, model), &mut cut);
    let plan = splat_plan(settings, f32::INFINITY);
    let mut list = vec![Splat::zeroed(); splats::count(&cut, &plan)];
    let packed = splats::pack(model, &cut, view, &plan, &mut list);
    list.truncate(packed.points);
    let (mut seen, mut missing) = (0u64, 0u64);
    for splat in &list {
        let (x, y, distance) = view.project(splat.center);
        let (x, y) = (x.floor(), y.floor());
        if x < 0.0 || y < 0.0 || x >= view.width as f32 || y >= view.height as f32 {
            continue;
        }
        let i = y as usize * view.width as usize + x as usize;
        // The center of a node lies off the surface by less than its size.
        if distance <= depth[i] + settings.threshold_px * distance / view.focal_px() {
            seen += 1;
            missing += u64::from(class.color[i] != [255; 4]);
        }
    }
    100.0 * missing as f64 / seen.max(1) as f64
}

/// Methods 9.4: errors against 16 samples of triangles a pixel, beside opaque squares of the same threshold.
fn errors(backend: &Backend, model: &Model, name: &str, thresholds: &[f32]) {
    let size = (500, 500);
    let view = orbit(model, size);
    let outputs = PictureOutputs {
        depth: true,
        normal: false,
        values: false,
    };
    let mut engine = Engine::new(backend, model, size, outputs).expect("it fits");
    let triangles = Settings {
        method: Method::Triangles,
        ..Settings::default()
    };
    let depth = engine.render(&view, &triangles).expect("it draws").depth;
    let reference = engine.supersample(&view, &triangles, 4).expect("it draws");
    println!("{name}: RMSE over object pixels, largest level off, pixels too many, too few");
    for &threshold in thresholds {
        let squares = Settings {
            threshold_px: threshold,
            ..Settings::default()
        };
        let image = engine.render(&view, &squares).expect("it draws");
        println!(
            "  {threshold}  squares    {}",
            error_text(&reference, &image)
        );
        for (how, name) in RECONSTRUCTIONS {
            let settings = settings(threshold, how);
            let image = engine.render(&view, &settings).expect("it draws");
            let by_class = Settings {
                color_by: ColorBy::Classification,
                ..settings
            };
            let class = engine.render(&view, &by_class).expect("it draws");
            let count = |color: [u8; 4]| class.color.iter().filter(|c| **c == color).count();
            let filled = count([128, 128, 128, 255]);
            let unreached = count([255, 0, 0, 255]);
            println!(
                "  {threshold}  {name:<9}  {}; {filled} holes filled, {unreached} by their footprint, {} left; {:.1} % of centers lost",
                error_text(&reference, &image),
                // All that is covered and neither of the three.
                class.covered_pixels() as usize - filled - unreached - count([255; 4]),
                lost(model, &view, &settings, &depth, &class)
            );
        }
    }
}

fn error_text(reference: &FloatImage, image: &Image) -> String {
    let d = compare(reference, image, 0.0).expect("pictures of one view");
    format!(
        "{:.4} {:5.0} {:6} {:5}",
        d.object.rmse, d.object.max_level, d.extra, d.missing
    )
}

fn main() {
    let has = |word: &str| std::env::args().any(|a| a == word);
    let backend = match Backend::open(&DeviceOptions::default()) {
        Ok(backend) => backend,
        Err(error) => return println!("no device, nothing measured: {error}"),
    };
    println!("{}", backend.name());
    let is_quick = has("quick");
    let model = statue(if is_quick { 200_000 } else { 2_000_000 });
    let name = if is_quick {
        "statue 200 k"
    } else {
        "statue 2 M"
    };
    if !has("errors") {
        times(&backend, &model, name, if is_quick { 3 } else { 15 });
    }
    if has("times") {
        return;
    }
    let thresholds: &[f32] = if is_quick {
        &[1.0, 4.0]
    } else {
        &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]
    };
    errors(&backend, &model, name, thresholds);
    if !is_quick {
        for name in ["thesis/dragon_vrip.ply.gz", "meshes/bun_zipper.ply.gz"] {
            if let Some(model) = real(name) {
                errors(&backend, &model, name, thresholds);
            }
        }
    }
}
