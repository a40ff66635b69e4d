//! The profiler: what the device counts, what it measures, and how the figures hang together. Times decide nothing
//! here; what must hold on any machine are orders, sums and names.

use crate::common::Device;

#[test]
fn counters_are_believed_only_where_they_are_exact() {
    let Some(device) = Device::open() else { return };
    let report = surfel::gpu::profile::counter_test(device.gpu()).unwrap();
    println!("{report:#?}");
    let info = device.gpu().info();
    let names: Vec<&str> = report.rows.iter().map(|r| r.name).collect();
    assert_eq!(
        names,
        [
            "samples",
            "input_vertices",
            "input_primitives",
            "vertex_invocations",
            "clipping_invocations",
            "clipping_primitives",
            "fragment_invocations"
        ]
    );
    for row in &report.rows {
        let has = if row.name == "samples" {
            info.has_sample_counts
        } else {
            info.has_pipeline_statistics
        };
        assert_eq!(row.counted.is_some(), has, "{}", row.name);
        assert_eq!(report.is_exact(row.name), row.counted == Some(row.expected));
    }
    // A precise count of samples has no room for error: 64 x 64 pixels, then 256 x 256, then nothing.
    if info.has_sample_counts {
        assert_eq!(report.rows[0].counted, Some([4096, 65536, 0]));
    }
    assert!(!report.is_exact("no such counter"));
}

use surfel::generate::GeneratedShape;
use surfel::gpu::frame::FrameMeasure;
use surfel::math::camera::View;
use surfel::measure::profile::{FrameProfile, ProfileError, ProfilePlan, ProfileProof};
use surfel::measure::report::ProfileReport;
use surfel::measure::trace;
use surfel::progress::{Progress, SilentProgress};
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::stats::FrameStage;
use surfel::render::{Culling, Method, Path, Settings, SplatKind};
use surfel::tree::Model;

const SIZE: (u32, u32) = (96, 72);
const PIXELS: u64 = 96 * 72;

fn views(model: &Model, count: u32) -> Vec<View> {
    (0..count)
        .map(|k| {
            crate::common::orbit(
                model,
                SIZE,
                360.0 * f64::from(k) / f64::from(count),
                20.0,
                1.0,
            )
        })
        .collect()
}

fn profile(backend: &Backend, model: &Model, views: &[View], settings: &Settings) -> FrameProfile {
    let mut engine = Engine::new(backend, model, SIZE, PictureOutputs::default()).unwrap();
    let plan = ProfilePlan {
        views,
        settings,
        warm_up: 1,
        photos: &[],
    };
    // The other self-test has a test of its own, and takes a second.
    let proof = match backend {
        Backend::Device(gpu) | Backend::Vulkan(gpu) => ProfileProof {
            self_test: None,
            counter_test: Some(surfel::gpu::profile::counter_test(gpu).unwrap()),
        },
        _ => ProfileProof::default(),
    };
    FrameProfile::run(backend, &mut engine, &plan, proof, &SilentProgress).unwrap()
}

fn settings(method: Method, splat: SplatKind) -> Settings {
    Settings {
        method,
        splat,
        threshold_px: 2.0,
        ..Settings::default()
    }
}

/// What must hold of every profile made on a device, whatever the times are.
fn check_times(profile: &FrameProfile, passes: &[&str], is_timed: bool) {
    for sample in &profile.samples {
        let t = &sample.times;
        let stages: f64 = FrameStage::ALL.map(|s| t.of(s)).iter().sum();
        assert!(stages > 0.0 && stages <= t.frame_ms, "{t:?}");
        // Stages follow each other, inside of the frame.
        let mut last = t.starts.frame.unwrap();
        for stage in FrameStage::ALL {
            if let Some(start) = t.starts.of(stage) {
                assert!(start >= last, "{}: {t:?}", stage.name());
                last = start;
            } else {
                assert_eq!(t.of(stage), 0.0);
            }
        }
        // A device with memory of its own makes its lists of ids first.
        let is_drawn = |name: &&str| !name.starts_with("lists.");
        let counted = sample.counters.iter().map(|c| c.name).filter(is_drawn);
        assert_eq!(counted.collect::<Vec<_>>(), passes);
        if !is_timed {
            assert!(t.passes.is_empty() && sample.plain_ms.is_none());
            continue;
        }
        let timed = t.passes.iter().map(|p| p.name).filter(is_drawn);
        assert_eq!(timed.collect::<Vec<_>>(), passes);
        assert!(sample.plain_ms.unwrap() > 0.0);
        // Passes follow each other, inside of the frame on the device.
        let frame_ms = t.device.frame_ms.unwrap();
        let mut last = 0.0;
        for (pass, &start) in t.passes.iter().zip(&t.device.starts_ms) {
            // A tick's rounding.
            assert!(start >= last - 1e-6 && pass.ms >= 0.0, "{t:?}");
            last = start + pass.ms;
        }
        assert!(last <= frame_ms + 1e-6, "{t:?}");
    }
}

#[test]
fn passes_stages_and_counters_hang_together() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Vulkan(device.gpu().clone());
    let info = device.gpu().info().clone();
    let is_timed = info.timestamp_period_ns > 0.0;
    let model = crate::common::generated(GeneratedShape::Torus, 20_000);
    let views = views(&model, 3);
    for (method, splat, passes) in [
        (
            Method::Triangles,
            SplatKind::Square,
            &["triangles.draw"][..],
        ),
        (Method::Points, SplatKind::Square, &["points.draw"][..]),
        (
            Method::Pop,
            SplatKind::Square,
            &["opaque.triangles", "opaque.splats"][..],
        ),
        (
            Method::Pop,
            SplatKind::Filtered,
            &["filtered.depth", "filtered.blend", "filtered.normalize"][..],
        ),
    ] {
        let settings = Settings {
            path: Path::Raster,
            ..settings(method, splat)
        };
        let profile = profile(&backend, &model, &views, &settings);
        check_times(&profile, passes, is_timed);
        let mut engine = Engine::new(&backend, &model, SIZE, PictureOutputs::default()).unwrap();
        for (sample, view) in profile.samples.iter().zip(&views) {
            let image = engine.render(view, &settings).unwrap();
            let covered = image.color.iter().filter(|c| c[3] > 0).count() as u64;
            assert_eq!(sample.covered_pixels, covered);
            assert!(covered > PIXELS / 10);
            let counts = &sample.times.counts;
            let of = |name: &str| *sample.counters.iter().find(|c| c.name == name).unwrap();
            if profile.counts("samples") {
                let all = profile.samples_of(sample, None).unwrap();
                let drawn = profile.samples_of(sample, passes.last().copied()).unwrap();
                assert!(all >= covered && drawn <= all, "{all} {drawn} {covered}");
                assert_eq!(
                    profile.overdraw_of(sample).unwrap(),
                    all as f64 / covered as f64
                );
                if splat == SplatKind::Filtered {
                    // A triangle over all of the picture that the model may be in, without a depth test.
                    let samples = of("filtered.normalize").samples.unwrap();
                    assert!(covered < samples && samples < PIXELS, "{samples}");
                }
            }
            if profile.counts("input_vertices") {
                let vertices = |name| of(name).pipeline.unwrap().input_vertices;
                match (method, splat) {
                    (Method::Triangles, _) => {
                        assert_eq!(vertices("triangles.draw"), 3 * counts.triangles)
                    }
                    (Method::Points, _) => assert_eq!(vertices("points.draw"), counts.points),
                    (_, SplatKind::Square) => {
                        assert_eq!(vertices("opaque.splats"), counts.splats);
                        assert_eq!(vertices("opaque.triangles"), 3 * counts.triangles);
                    }
                    _ => assert_eq!(
                        vertices("filtered.blend"),
                        counts.splats + 3 * counts.triangles
                    ),
                }
            }
            // Targets: 4 bytes of color, 4 of depth, 16 of sums a pixel.
            let moved = |name: &str| {
                let c = of(name);
                (c.loaded_bytes / PIXELS, c.stored_bytes / PIXELS)
            };
            match (method, splat) {
                (Method::Pop, SplatKind::Square) => {
                    assert_eq!(moved("opaque.triangles"), (0, 8));
                    assert_eq!(moved("opaque.splats"), (8, 8));
                }
                (Method::Pop, _) => {
                    assert_eq!(moved("filtered.depth"), (0, 4));
                    assert_eq!(moved("filtered.blend"), (4, 16));
                    assert_eq!(moved("filtered.normalize"), (0, 4));
                }
                _ => assert_eq!(moved(passes[0]), (0, 8)),
            }
            // Draw lists and the one uniform block.
            let frame_constants = size_of::<surfel::abi::FrameConstants>() as u64;
            let blocks = sample.times.uploaded_bytes - counts.draw_list_bytes;
            // A device with memory of its own makes its lists of ids, which takes some more.
            let most = if crate::common::is_card() { 512 } else { 0 };
            assert!((frame_constants..=frame_constants + most).contains(&blocks));
        }
    }
}

#[test]
fn a_square_is_drawn_over_once() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Vulkan(device.gpu().clone());
    let model = crate::common::generated(GeneratedShape::Square, 200);
    let settings = Settings {
        culling: Culling::Off,
        ..settings(Method::Triangles, SplatKind::Square)
    };
    let view = crate::common::orbit(&model, SIZE, 10.0, 20.0, 0.8);
    let profile = profile(&backend, &model, &[view], &settings);
    if profile.counts("samples") {
        // Every pixel once: edges that two triangles share are drawn by one of them.
        assert_eq!(profile.overdraw_of(&profile.samples[0]), Some(1.0));
    }
}

#[test]
fn measuring_changes_no_picture_and_makes_nothing_new() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Vulkan(device.gpu().clone());
    let model = crate::common::generated(GeneratedShape::Sphere, 20_000);
    let view = crate::common::orbit(&model, SIZE, 10.0, 20.0, 1.0);
    let has_timestamps = device.gpu().info().timestamp_period_ns > 0.0;
    for splat in [SplatKind::Square, SplatKind::Filtered] {
        let settings = settings(Method::Pop, splat);
        let mut engine = Engine::new(&backend, &model, SIZE, PictureOutputs::default()).unwrap();
        let mut pictures = Vec::new();
        let mut made = Vec::new();
        for round in 0..3 {
            for (passes, frame, counters) in [
                (false, false, false),
                (true, false, false),
                (true, true, false),
                (false, true, false),
                (false, false, true),
                (true, true, true),
            ] {
                let measure = FrameMeasure {
                    passes,
                    frame,
                    counters,
                };
                engine.measure(measure).unwrap();
                let times = engine.draw(&view, &settings).unwrap();
                assert_eq!(times.passes.is_empty(), !(passes && has_timestamps));
                assert_eq!(times.device.starts_ms.len(), times.passes.len());
                assert_eq!(times.device.frame_ms.is_some(), frame && has_timestamps);
                assert_eq!(times.counters.is_empty(), !counters);
                pictures.push(engine.read(&view).unwrap());
                if round > 0 {
                    let gpu = device.gpu();
                    made.push((gpu.compiled_pipelines(), gpu.created_resources()));
                }
            }
        }
        assert!(pictures.windows(2).all(|p| p[0].color == p[1].color));
        assert!(made.windows(2).all(|m| m[0] == m[1]), "{made:?}");
    }
}

/// A span of the trace: track, category, name, start and end in nanoseconds.
type Span = (u64, String, String, i64, i64);

/// The complete events of a trace that keeps the format's rules.
fn spans(trace: &serde_json::Value) -> Vec<Span> {
    let ns = |value: &serde_json::Value| (value.as_f64().unwrap() * 1e3).round() as i64;
    let mut spans: Vec<Span> = Vec::new();
    for event in trace["traceEvents"].as_array().unwrap() {
        for key in ["ph", "ts", "pid", "tid", "name"] {
            assert!(!event[key].is_null(), "{key}: {event}");
        }
        match event["ph"].as_str().unwrap() {
            "M" => assert!(event["args"]["name"].is_string(), "{event}"),
            "C" => assert!(event["args"]["count"].is_u64(), "{event}"),
            "X" => {
                let (start, length) = (ns(&event["ts"]), ns(&event["dur"]));
                assert!(length >= 0, "{event}");
                spans.push((
                    event["tid"].as_u64().unwrap(),
                    event["cat"].as_str().unwrap().to_owned(),
                    event["name"].as_str().unwrap().to_owned(),
                    start,
                    start + length,
                ));
            }
            other => panic!("{other}: {event}"),
        }
    }
    // On one track, two events nest or are apart.
    for (i, a) in spans.iter().enumerate() {
        for b in &spans[i + 1..] {
            let (a, b) = if a.3 <= b.3 { (a, b) } else { (b, a) };
            assert!(
                a.0 != b.0 || b.3 >= a.4 || b.4 <= a.4 || a.3 == b.3,
                "{a:?} {b:?}"
            );
        }
    }
    spans
}

#[test]
fn a_trace_has_both_tracks_on_one_clock() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Vulkan(device.gpu().clone());
    let model = crate::common::generated(GeneratedShape::Sphere, 20_000);
    let views = views(&model, 4);
    // Compute has passes of its own, where it pays.
    let settings = Settings {
        path: Path::Raster,
        ..settings(Method::Pop, SplatKind::Filtered)
    };
    let profile = profile(&backend, &model, &views, &settings);
    let trace = profile.trace(serde_json::json!({ "model": "sphere" }));
    assert_eq!(trace["otherData"]["run"]["model"], "sphere");
    assert_eq!(trace["otherData"]["clock"], profile.clock());
    let info = device.gpu().info();
    assert_eq!(
        profile.clock(),
        match (
            info.timestamp_period_ns > 0.0,
            info.has_calibrated_timestamps
        ) {
            (false, _) => trace::NO_CLOCK,
            (true, true) => trace::CALIBRATED,
            (true, false) => trace::ANCHORED,
        }
    );
    let spans = spans(&trace);
    let error_ns = profile.clock_error_ms().map_or(0, |ms| (ms * 1e6) as i64);
    let find = |track: u64, category: &str| -> Vec<&Span> {
        spans
            .iter()
            .filter(|s| s.0 == track && s.1 == category)
            .collect()
    };
    let frames = find(1, "frame");
    let names: Vec<&str> = frames.iter().map(|s| s.2.as_str()).collect();
    assert_eq!(names, ["frame 0", "frame 1", "frame 2", "frame 3"]);
    let stages: Vec<&str> = find(1, "stage").iter().map(|s| s.2.as_str()).collect();
    assert_eq!(
        stages,
        ["cut", "pack", "upload", "submit", "wait"].repeat(4)
    );
    if info.timestamp_period_ns == 0.0 {
        assert!(find(2, "pass").is_empty());
        return;
    }
    let passes: Vec<&str> = find(2, "pass").iter().map(|s| s.2.as_str()).collect();
    let expected = ["filtered.depth", "filtered.blend", "filtered.normalize"];
    assert_eq!(passes, expected.repeat(4));
    // What the device did lies within its frame on the host, up to what the clocks differ; a device whose clock
    // runs at another speed than it says would break this, and be warned of.
    for (cpu, gpu) in frames.iter().zip(find(2, "frame")) {
        assert!(gpu.3 >= cpu.3 - error_ns, "{cpu:?} {gpu:?}");
        assert!(gpu.4 <= cpu.4 + error_ns, "{cpu:?} {gpu:?}");
        for pass in find(2, "pass") {
            let apart = pass.4 <= gpu.3 || pass.3 >= gpu.4;
            assert!(apart || (pass.3 >= gpu.3 && pass.4 <= gpu.4));
        }
    }
}

#[test]
fn the_mirror_has_stages_and_counts() {
    let model = crate::common::generated(GeneratedShape::Sphere, 20_000);
    let views = views(&model, 2);
    let settings = settings(Method::Pop, SplatKind::Square);
    let profile = profile(&Backend::Reference, &model, &views, &settings);
    let report = ProfileReport::of(&profile);
    assert!(report.passes.is_empty() && report.frame.device_ms.is_none());
    assert!(report.counts.overdraw.is_none() && report.counts.splats.median > 0.0);
    assert!(report.counts.covered_pixels.p5 > 0.0);
    assert_eq!(report.warnings, Vec::<String>::new());
    assert_eq!(profile.clock(), trace::NO_CLOCK);
    let spans = spans(&profile.trace(serde_json::Value::Null));
    let names: Vec<&str> = spans.iter().map(|s| s.2.as_str()).collect();
    assert_eq!(names, ["frame 0", "cut", "pack", "frame 1", "cut", "pack"]);
    // No view, no figures.
    let mut engine =
        Engine::new(&Backend::Reference, &model, SIZE, PictureOutputs::default()).unwrap();
    let plan = ProfilePlan {
        views: &[],
        settings: &settings,
        photos: &[],
        warm_up: 1,
    };
    let empty = FrameProfile::run(
        &Backend::Reference,
        &mut engine,
        &plan,
        ProfileProof::default(),
        &SilentProgress,
    )
    .unwrap();
    assert_eq!(ProfileReport::of(&empty).frames, 0);
    assert_eq!(empty.csv().lines().count(), 1);
    assert_eq!(
        empty.trace(serde_json::Value::Null)["traceEvents"],
        serde_json::json!([])
    );
}

/// Cancels after so many views.
struct Impatient(std::sync::atomic::AtomicU64, u64);

impl Progress for Impatient {
    fn stage(&self, _: &str, _: u64) {}
    fn advance(&self, amount: u64) {
        self.0
            .fetch_add(amount, std::sync::atomic::Ordering::Relaxed);
    }
    fn is_cancelled(&self) -> bool {
        self.0.load(std::sync::atomic::Ordering::Relaxed) >= self.1
    }
}

#[test]
fn cancelling_ends_at_the_next_frame() {
    let model = crate::common::generated(GeneratedShape::Sphere, 2_000);
    let views = views(&model, 4);
    let settings = settings(Method::Pop, SplatKind::Square);
    let mut engine =
        Engine::new(&Backend::Reference, &model, SIZE, PictureOutputs::default()).unwrap();
    let plan = ProfilePlan {
        views: &views,
        settings: &settings,
        photos: &[],
        warm_up: 1,
    };
    // While timing, then while counting.
    for (after, frames) in [(0, 0), (2, 2), (5, 1)] {
        let progress = Impatient(0.into(), after);
        match FrameProfile::run(
            &Backend::Reference,
            &mut engine,
            &plan,
            ProfileProof::default(),
            &progress,
        ) {
            Err(ProfileError::Cancelled(n)) => assert_eq!(n, frames),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn what_a_device_costs_is_measured_once_and_again_where_the_file_is_none() {
    use surfel::bench::calibrate::{CalibrationPart, DeviceCalibration, DeviceKey};
    let Some(device) = Device::open() else { return };
    let folder = tempfile::tempdir().unwrap();
    let kept = |parts: &[CalibrationPart], again| {
        DeviceCalibration::kept(device.gpu(), Some(folder.path()), parts, again).unwrap()
    };
    let first = kept(&CalibrationPart::ALL, false);
    let file = DeviceKey::of(device.gpu()).path(folder.path());
    assert!(first.is_new && first.not_kept.is_none());
    assert_eq!(first.file.as_ref(), Some(&file));
    let costs = &first.calibration.costs;
    println!("{costs:#?} in {:.0} ms", first.calibration.took_ms);
    assert!(costs.is_whole() && costs.node_ns.unwrap() > 0.0);
    let info = device.gpu().info();
    let (square, triangle) = (costs.square.unwrap(), costs.triangle.unwrap());
    assert!(square.raster.is_some() && triangle.raster.is_some());
    assert_eq!(square.compute.is_some(), info.has_int64_atomics);
    assert_eq!(triangle.compute.is_some(), info.has_int64_atomics);
    assert_eq!(costs.gauss_merge.is_some(), info.has_int64_atomics);
    assert_eq!(
        costs.filtered_merge.is_some(),
        info.has_int64_atomics && info.has_float_blend
    );
    let visibility = costs.visibility.unwrap();
    assert!(visibility.raster.is_some());
    assert_eq!(visibility.compute.is_some(), info.has_int64_atomics);
    assert!(costs.primitives.is_some() && costs.gauss.is_some());
    let second = kept(&CalibrationPart::ALL, false);
    assert!(!second.is_new);
    assert_eq!(second.calibration, first.calibration);
    // Damaged, or of another program: measured again, and kept in its place.
    let text = std::fs::read_to_string(&file).unwrap();
    let version = format!("\"version\": \"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(text.contains(&version), "{text}");
    for damaged in [
        text[..text.len() - 9].to_owned(),
        text.replace(&version, "\"version\": \"0.0.1\""),
    ] {
        std::fs::write(&file, damaged).unwrap();
        let found = kept(&[CalibrationPart::Nodes], false);
        assert!(found.is_new);
        assert_eq!(
            kept(&[CalibrationPart::Nodes], false).calibration,
            found.calibration
        );
    }
    assert!(kept(&[CalibrationPart::Nodes], true).is_new);
    // Nowhere to keep it is no failure.
    let found =
        DeviceCalibration::kept(device.gpu(), Some(&file), &[CalibrationPart::Nodes], false)
            .unwrap();
    assert!(found.is_new && found.not_kept.is_some());
}
