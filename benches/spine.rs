//! The figures of the spine: reading, tree build, cut, and the hybrid against plain triangles.
//!
//! `cargo bench --bench spine` (or `make bench`) runs all; `-- read`, `-- build`, `-- cut`, `-- draw`, `-- filter` (and
//! any of them together) a part; `-- quick` takes models of a tenth of the size, to see that it runs. Every figure is a median; compared candidates run in turn in one process. Absolute times depend
//! on the machine, ratios less so. Targets are for two CPU cores and a software device.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use surfel::cut::{self, Cut, CutSelector, SplatFootprints, StripRun, ZeroAreaSet};
use surfel::generate::{self, GeneratedShape, ShapeSpec};
use surfel::gpu::{DeviceOptions, Gpu};
use surfel::image::compare;
use surfel::input;
use surfel::math::camera::View;
use surfel::measure::ValueDistribution;
use surfel::mesh::Mesh;
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::vulkan::renderer::VulkanRenderer;
use surfel::render::vulkan::scene::DeviceScene;
use surfel::render::{Method, Settings, SplatKind};
use surfel::tree::{self, BuildOptions, Model};

const SIZE: (u32, u32) = (500, 500);

fn ms(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64() * 1e3
}

fn row(name: &str, value: f64, unit: &str, target: Option<(bool, f64)>) {
    let target = target.filter(|_| HAS_TARGETS.load(Ordering::Relaxed));
    let verdict = match target {
        None => String::new(),
        Some((at_most, limit)) => {
            let met = if at_most {
                value <= limit
            } else {
                value >= limit
            };
            format!(
                "  {} {limit} {unit}: {}",
                if at_most { "at most" } else { "at least" },
                if met { "met" } else { "MISSED" }
            )
        }
    };
    println!("{name:<58} {value:>10.3} {unit:<8}{verdict}");
}

fn mesh(shape: GeneratedShape, triangles: u64) -> Mesh {
    generate::mesh(&ShapeSpec::with_triangles(shape, triangles).expect("a valid size"))
}

fn build(mesh: Mesh) -> Model {
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).expect("the tree builds")
}

/// The most memory that was resident in this process so far, bytes. Linux only.
fn highest_resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
}

/// The argument with which this program starts itself to build one tree in a fresh process.
const PEAK: &str = "peak";

/// Builds the torus in this process and prints the highest resident memory and the sizes of mesh and tree.
fn peak_child(scale: u64) {
    let source = mesh(GeneratedShape::Torus, 4_000_000 / scale);
    let mesh_bytes = 12 * (source.positions.len() + source.normals.len() + source.triangles.len());
    let model = build(source);
    if let Some(highest) = highest_resident() {
        println!("{highest} {mesh_bytes} {}", model.memory_bytes().tree());
    }
}

/// Peak memory of a build, measured in a process of its own because freed memory stays with a process.
fn peak(scale: u64) {
    let Ok(program) = std::env::current_exe() else {
        return;
    };
    let mut command = std::process::Command::new(program);
    command.arg(PEAK);
    if scale > 1 {
        command.arg("quick");
    }
    let Ok(output) = command.output() else { return };
    let text = String::from_utf8_lossy(&output.stdout);
    let numbers: Vec<f64> = text
        .split_whitespace()
        .filter_map(|n| n.parse().ok())
        .collect();
    if let [highest, mesh, tree] = numbers[..] {
        row(
            "peak memory less the mesh, over the tree, torus",
            (highest - mesh) / tree,
            "x",
            Some((true, 3.0)),
        );
    }
}

fn reading(scale: u64) {
    let spec =
        ShapeSpec::with_triangles(GeneratedShape::Torus, 4_000_000 / scale).expect("a valid size");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("torus.ply");
    generate::write_ply_file(&spec, &path, &SilentProgress).expect("the torus is written");
    let load = || {
        let loaded = input::load(
            Path::new(&path),
            &input::ReadOptions::default(),
            &SilentProgress,
        )
        .expect("the torus loads");
        assert_eq!(loaded.mesh.triangles.len() as u64, spec.counts().1);
    };
    load();
    let times: Vec<f64> = (0..5).map(|_| ms(load)).collect();
    row(
        "read binary PLY, torus 4 M",
        ValueDistribution::of(&times).median / 1e3,
        "s",
        Some((true, 0.6)),
    );
}

fn building(scale: u64) {
    let mut per_triangle = Vec::new();
    for (shape, triangles, target) in [
        (GeneratedShape::Torus, 4_000_000, Some(1.2)),
        (GeneratedShape::Statue, 1_000_000, None),
        (GeneratedShape::Statue, 4_000_000, None),
        (GeneratedShape::Statue, 8_000_000, None),
    ] {
        let source = mesh(shape, triangles / scale);
        let count = source.triangles.len();
        let mut times = Vec::new();
        let mut model = None;
        for _ in 0..3 {
            let copy = source.clone();
            drop(model.take());
            times.push(ms(|| model = Some(build(copy))) / 1e3);
        }
        let Some(model) = model else {
            unreachable!("built above")
        };
        let seconds = ValueDistribution::of(&times).median;
        row(
            &format!(
                "build the tree, {} {:.1} M",
                shape.name(),
                count as f64 / 1e6
            ),
            seconds,
            "s",
            target.map(|t| (true, t)),
        );
        if shape == GeneratedShape::Statue {
            per_triangle.push(seconds / count as f64 * 1e9);
            row("   a triangle", seconds / count as f64 * 1e9, "ns", None);
        }
        let tree_bytes = model.memory_bytes().tree();
        row(
            "   tree, bytes a triangle",
            tree_bytes as f64 / count as f64,
            "B",
            None,
        );
    }
    peak(scale);
    if let (Some(first), Some(last)) = (per_triangle.first(), per_triangle.last()) {
        row(
            "   time a triangle, 8 M over 1 M",
            last / first,
            "x",
            Some((true, 1.5)),
        );
    }
}

fn orbit(model: &Model, fill: f64, k: u32, n: u32) -> View {
    model
        .orbit_step(SIZE, fill, k, n)
        .view(model.origin)
        .expect("a valid camera")
}

/// Time of cuts of the standard orbit, on one thread and on two in turn.
fn cutting(model: &Model, name: &str) {
    for threshold_px in [1.0, 3.0] {
        let settings = cut::CutSettings {
            threshold_px,
            cull_back: model.is_closed,
            ..cut::CutSettings::default()
        };
        let mut selectors = [1, 2].map(CutSelector::with_threads);
        let mut cut = Cut::default();
        let mut times = [vec![], vec![]];
        let mut visits = Vec::new();
        for repeat in 0..3 {
            for k in 0..12 {
                let view = orbit(model, 1.0, k, 12);
                for (selector, times) in selectors.iter_mut().zip(&mut times) {
                    let time = ms(|| selector.select(model, &view, &settings, &mut cut));
                    if repeat > 0 {
                        times.push(time / cut.stats.visited.max(1) as f64);
                    }
                }
                visits.push(cut.stats.visited as f64);
            }
        }
        let visited = ValueDistribution::of(&visits).median;
        let [one, two] = times.map(|times| ValueDistribution::of(&times).median);
        row(
            &format!("cut, {name}, threshold {threshold_px}, a visited node ({visited})"),
            one * 1e6,
            "ns",
            Some((true, 8.0)),
        );
        row("   a cut, one thread", one * visited, "ms", None);
        row("   a cut, two threads", two * visited, "ms", None);
        row(
            "   visited nodes a second, two threads",
            1e-3 / two,
            "million",
            Some((false, 150.0)),
        );
    }
}

/// What the search for hidden squares costs, in turn with the same cut without it.
fn hiding(model: &Model, name: &str) {
    let settings = cut::CutSettings {
        threshold_px: 1.0,
        cull_back: model.is_closed,
        ..cut::CutSettings::default()
    };
    let footprints = SplatFootprints {
        side_px: 1.0,
        hides: true,
        are_discs: false,
        large_leaves: false,
        is_cloud: model.kind().is_points(),
    };
    let undrawn = ZeroAreaSet::new(model);
    let splats = |cut: &Cut| {
        let rows: u32 = cut.strips.iter().map(StripRun::splats).sum();
        (cut.nodes.len() + cut.leaves.len()) as f64 + f64::from(rows)
    };
    for threads in [1, 2] {
        let mut selector = CutSelector::with_threads(threads).with_subpixel_bits(8);
        let mut cut = Cut::default();
        let (mut plain, mut seen, mut found, mut left) = (vec![], vec![], vec![], vec![]);
        for repeat in 0..3 {
            for k in 0..12 {
                let view = orbit(model, 1.0, k, 12);
                let without = ms(|| selector.select(model, &view, &settings, &mut cut));
                found.push(splats(&cut));
                let what = (footprints, &undrawn);
                let with = ms(|| selector.select_seen(model, &view, &settings, what, &mut cut));
                left.push(splats(&cut));
                if repeat > 0 {
                    plain.push(without);
                    seen.push(with);
                }
            }
        }
        let [plain, seen, found, left] =
            [plain, seen, found, left].map(|values| ValueDistribution::of(&values).median);
        println!("{name}, {threads} threads: {left} squares left of {found}");
        row("   a cut without what is hidden", seen, "ms", None);
        let each = (seen - plain) * threads as f64 / found.max(1.0);
        row("   the search, a splat and thread", each * 1e6, "ns", None);
    }
}

fn drawing(gpu: &Arc<Gpu>, model: &Model, name: &str, target: Option<f64>) {
    let mut scene = DeviceScene::new(gpu, model).expect("the model fits the device");
    let mut renderer = VulkanRenderer::new(gpu, SIZE.0, SIZE.1, PictureOutputs::default(), true)
        .expect("a renderer");
    let candidates = [
        (Method::Triangles, 1.0),
        (Method::Pop, 1.0),
        (Method::Pop, 3.0),
    ];
    for fill in [1.0, 0.5, 0.125] {
        let mut times = vec![Vec::new(); candidates.len()];
        let mut counts = vec![(0, 0); candidates.len()];
        let views: Vec<View> = (0..9).map(|k| orbit(model, fill, k, 9)).collect();
        let mut made = (0, 0);
        for (round, view) in std::iter::once(&views[0])
            .chain(&views)
            .chain(&views)
            .enumerate()
        {
            if round == 1 + views.len() {
                made = (gpu.compiled_pipelines(), gpu.created_resources());
            }
            for (index, &(method, threshold_px)) in candidates.iter().enumerate() {
                if method == Method::Triangles && round > 4 {
                    continue;
                }
                let settings = Settings {
                    method,
                    threshold_px,
                    ..Settings::default()
                };
                let t = renderer
                    .draw(model, &mut scene, view, &settings)
                    .expect("a frame");
                if round > 0 {
                    times[index].push(t.frame_ms);
                    counts[index] = (t.counts.triangles, t.counts.splats);
                }
            }
        }
        let made = (
            gpu.compiled_pipelines() - made.0,
            gpu.created_resources() - made.1,
        );
        let median: Vec<f64> = times
            .iter()
            .map(|t| ValueDistribution::of(t).median)
            .collect();
        for (index, &(method, threshold_px)) in candidates.iter().enumerate() {
            let (triangles, splats) = counts[index];
            row(
                &format!(
                    "{name}, fill {fill}, {method:?} {threshold_px} ({triangles} tri, {splats} splats)"
                ),
                median[index],
                "ms",
                None,
            );
        }
        row(
            "   pop 1 faster than triangles",
            median[0] / median[1],
            "x",
            None,
        );
        row(
            "   pop 3 faster than triangles",
            median[0] / median[2],
            "x",
            target.filter(|_| fill == 1.0).map(|t| (false, t)),
        );
        row(
            "   pipelines and buffers made in the second round",
            (made.0 + made.1) as f64,
            "",
            Some((true, 0.0)),
        );
    }
}

/// The error of filtered splats against 16 samples of triangles a pixel, beside one exact sample and squares.
fn filtering(gpu: &Arc<Gpu>, model: &Model, name: &str) {
    let backend = Backend::Device(gpu.clone());
    let mut engine = Engine::new(&backend, model, SIZE, PictureOutputs::default())
        .expect("the model fits the device");
    let pop = |splat| Settings {
        splat,
        threshold_px: 1.0,
        ..Settings::default()
    };
    let triangles = Settings {
        method: Method::Triangles,
        ..Settings::default()
    };
    for (fill, target) in [(1.0, 30.0), (0.5, 29.0), (0.125, 28.0)] {
        let view = orbit(model, fill, 0, 9);
        let reference = engine
            .supersample(&view, &triangles, 4)
            .expect("a reference");
        let cases = [
            ("one exact sample", triangles, None),
            ("pop 1, squares", pop(SplatKind::Square), None),
            (
                "pop 1, filtered",
                pop(SplatKind::Filtered),
                Some((false, target)),
            ),
        ];
        for (what, settings, target) in cases {
            let picture = engine.render(&view, &settings).expect("a frame");
            let difference = compare(&reference, &picture, 8.0).expect("pictures of one size");
            row(
                &format!("{name}, fill {fill}, {what}: PSNR over object pixels"),
                difference.object.psnr_db,
                "dB",
                target,
            );
            let times: Vec<f64> = (0..5)
                .map(|_| engine.draw(&view, &settings).expect("a frame").frame_ms)
                .collect();
            row("   frame", ValueDistribution::of(&times).median, "ms", None);
        }
    }
}

/// What the factor of the depth offset does to filtered splats.
fn offsets(gpu: &Arc<Gpu>, model: &Model, name: &str) {
    let backend = Backend::Device(gpu.clone());
    let mut engine = Engine::new(&backend, model, SIZE, PictureOutputs::default())
        .expect("the model fits the device");
    let triangles = Settings {
        method: Method::Triangles,
        ..Settings::default()
    };
    for fill in [1.0, 0.5, 0.125] {
        let view = orbit(model, fill, 0, 9);
        let reference = engine
            .supersample(&view, &triangles, 4)
            .expect("a reference");
        for depth_offset in [1.0, 2.0, 3.0, 4.0, 6.0] {
            let settings = Settings {
                splat: SplatKind::Filtered,
                depth_offset: Some(depth_offset),
                ..Settings::default()
            };
            let picture = engine.render(&view, &settings).expect("a frame");
            let difference = compare(&reference, &picture, 8.0).expect("pictures of one size");
            row(
                &format!("{name}, fill {fill}, filtered, depth offset {depth_offset}"),
                difference.object.psnr_db,
                "dB",
                None,
            );
        }
    }
}

/// Targets hold for the full size only.
static HAS_TARGETS: AtomicBool = AtomicBool::new(true);

fn main() {
    let scale = if std::env::args().any(|a| a == "quick") {
        10
    } else {
        1
    };
    HAS_TARGETS.store(scale == 1, Ordering::Relaxed);
    if std::env::args().any(|a| a == PEAK) {
        peak_child(scale);
        return;
    }
    println!(
        "{} threads; {}x{} pixels; medians",
        rayon::current_num_threads(),
        SIZE.0,
        SIZE.1
    );
    let asked: Vec<String> = std::env::args().skip(1).collect();
    let parts = ["read", "build", "cut", "draw", "filter"];
    let is_all = !asked.iter().any(|word| parts.contains(&word.as_str()));
    let wants = |part: &str| is_all || asked.iter().any(|word| word == part);
    if wants("read") {
        reading(scale);
    }
    if wants("build") {
        building(scale);
    }
    if !(wants("cut") || wants("draw") || wants("filter")) {
        return;
    }
    let gpu = match Gpu::open(&DeviceOptions::default()) {
        Ok(gpu) => gpu,
        Err(error) => {
            eprintln!("no device, drawing is not measured: {error}");
            return;
        }
    };
    if wants("cut") {
        cutting(
            &build(mesh(GeneratedShape::Sphere, 1_000_000 / scale)),
            GeneratedShape::Sphere.name(),
        );
    }
    println!("drawing on {}", gpu.info().name);
    for (shape, triangles, target) in [
        (GeneratedShape::Statue, 8_000_000, 8.0),
        (GeneratedShape::Torus, 4_000_000, 4.0),
    ] {
        let model = build(mesh(shape, triangles / scale));
        if wants("cut") {
            cutting(&model, shape.name());
            hiding(&model, shape.name());
        }
        if wants("draw") {
            drawing(&gpu, &model, shape.name(), Some(target));
        }
        if wants("filter") {
            filtering(&gpu, &model, shape.name());
            offsets(&gpu, &model, shape.name());
        }
    }
}
