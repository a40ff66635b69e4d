use super::stand::{DrawnView, EmptyFrames};
use super::*;
use crate::gpu::for_tests::{close_in_silence, device};
use crate::gpu::frame::PassTime;
use crate::render::cost::model::{PassCosts, PerRasterizer, SplatCosts, TriangleCosts};
use crate::render::stats::FrameCounts;

#[test]
fn passes_over_the_picture_are_told_from_those_over_primitives() {
    let parts = |triangles, passes: &[(&'static str, f64)]| {
        let of = split(&FrameTimes {
            passes: passes
                .iter()
                .map(|&(name, ms)| PassTime { name, ms })
                .collect(),
            counts: FrameCounts {
                triangles,
                splats: 9,
                ..FrameCounts::default()
            },
            submit_ms: 1.0,
            wait_ms: 2.0,
            ..FrameTimes::default()
        });
        [of.splats_ms, of.triangles_ms, of.pixels_ms]
    };
    let passes = [
        ("opaque.triangles", 1.0),
        ("compute.clear", 2.0),
        ("compute.triangles", 4.0),
        ("compute.splats", 8.0),
        ("compute.resolve", 16.0),
        ("compute.copy", 32.0),
    ];
    assert_eq!(parts(7, &passes), [8.0, 5.0, 50.0]);
    assert_eq!(parts(0, &passes), [8.0, 0.0, 55.0]);
    let fuzzy = [("fuzzy.depth", 1.0), ("fuzzy.normalize", 2.0)];
    assert_eq!(parts(5, &fuzzy), [1.0, 0.0, 2.0]);
    assert_eq!(parts(0, &[]), [3.0, 0.0, 0.0]);
}

/// A view of so many pixels of a box, covered pixels and primitives.
fn at(of_box: f64, covered: f64, count: f64, primitives_ns: f64, pixels_ns: f64) -> DrawnView {
    DrawnView {
        primitives_ns,
        pixels_ns,
        count,
        covered,
        of_box,
    }
}

#[test]
fn what_passes_cost_without_primitives_comes_off() {
    // Passes over primitives: 1000 ns, 1 more for a pixel of the box, 50 a primitive. Passes over the picture: 4 ns for
    // each of its 10,000 pixels, 2 more in the box, 30 more for a covered one.
    let drawn = |of_box: f64, covered: f64, count: f64| {
        let primitives = 1000.0 + of_box + 50.0 * count;
        at(
            of_box,
            covered,
            count,
            primitives,
            40_000.0 + 2.0 * of_box + 30.0 * covered,
        )
    };
    let nothing = EmptyFrames {
        far: drawn(0.0, 0.0, 0.0),
        wide: drawn(8000.0, 0.0, 0.0),
    };
    let views = [drawn(500.0, 100.0, 10.0), drawn(2000.0, 900.0, 300.0)];
    let (passes, each) = nothing.costs(&views, 10_000.0);
    let found = [
        passes.frame_ns,
        passes.picture_ns,
        passes.box_ns,
        passes.covered_ns,
    ];
    for (found, wanted) in found.into_iter().zip([1000.0, 4.0, 3.0, 30.0]) {
        assert!((found - wanted).abs() < 1e-6, "{passes:?}");
    }
    assert!(each.iter().all(|ns| (ns - 50.0).abs() < 1e-6), "{each:?}");
    // Noise makes no time negative, and what draws nothing divides by nothing.
    let less = at(9000.0, 500.0, 0.0, 500.0, 10.0);
    let nothing = EmptyFrames {
        far: drawn(0.0, 0.0, 0.0),
        wide: less,
    };
    let (passes, each) = nothing.costs(&[less], 10_000.0);
    assert_eq!((passes.box_ns, passes.covered_ns), (0.0, 0.0));
    assert_eq!(each, [0.0]);
}

#[test]
fn merging_is_what_both_cost_more_than_compute_alone() {
    let alone = [
        at(0.0, 0.0, 2.0, 100.0, 200.0),
        at(1000.0, 0.0, 2.0, 100.0, 300.0),
        at(500.0, 0.0, 50.0, 600.0, 400.0),
    ];
    // 7 more for a frame, 0.1 for each of 10,000 pixels, 3 for one of the box, 4 for a splat.
    let mut both = alone;
    for (view, splats) in both.iter_mut().zip([0.0, 0.0, 50.0]) {
        view.primitives_ns += 7.0 + 4.0 * splats;
        view.pixels_ns += 1000.0 + 3.0 * view.of_box;
    }
    let found = stand::merge(both, alone, 10_000.0);
    let passes = found.passes;
    assert_eq!(
        (passes.frame_ns, passes.picture_ns, passes.box_ns),
        (7.0, 0.1, 3.0)
    );
    assert!((found.splat_ns - 4.0).abs() < 1e-9, "{found:?}");
    // Cheaper than without is noise.
    let found = stand::merge(alone, both, 10_000.0);
    assert_eq!((found.splat_ns, found.passes), (0.0, PassCosts::default()));
}

#[test]
fn only_what_decides_is_measured() {
    let of = |splat, method| {
        CalibrationPart::of(&Settings {
            splat,
            method,
            ..Settings::default()
        })
    };
    use CalibrationPart::{Blended, Ellipses, Filtered, Opaque, Primitives, Visibility};
    assert_eq!(of(SplatKind::Square, Method::Pop), [Opaque, Primitives]);
    assert_eq!(of(SplatKind::Square, Method::Splats), [Primitives]);
    assert_eq!(
        of(SplatKind::Ellipse, Method::Pop),
        [Opaque, Ellipses, Primitives]
    );
    assert_eq!(of(SplatKind::Ellipse, Method::Splats), [Primitives]);
    assert_eq!(of(SplatKind::Gauss, Method::Splats), [Blended, Primitives]);
    assert_eq!(of(SplatKind::Gauss, Method::Points), [Primitives]);
    assert_eq!(of(SplatKind::Filtered, Method::Pop), [Filtered]);
    assert_eq!(of(SplatKind::Visibility, Method::Pop), [Visibility]);
    assert_eq!(of(SplatKind::Visibility, Method::Points), []);
    assert_eq!(of(SplatKind::Square, Method::Triangles), []);
    let two_pass = Settings {
        blend: Some(Blend::TwoPass),
        ..Settings::default()
    };
    assert_eq!(CalibrationPart::of(&two_pass), [Blended, Primitives]);
}

fn key(version: &str) -> DeviceKey {
    DeviceKey {
        version: version.into(),
        commit: String::new(),
        device: "a device / with a name".into(),
        driver: "a driver".into(),
        threads: 2,
    }
}

fn made(version: &str) -> DeviceCalibration {
    let passes = PassCosts {
        frame_ns: 3.5,
        picture_ns: 0.5,
        box_ns: 1.5,
        covered_ns: 20.25,
    };
    let splat = Some(PerRasterizer {
        raster: Some(SplatCosts {
            splat_ns: [100.0, 110.0, 130.5],
            passes,
        }),
        compute: None,
    });
    DeviceCalibration {
        key: key(version),
        parts: vec![CalibrationPart::Opaque, CalibrationPart::Nodes],
        given_up: vec![CalibrationPart::Filtered, CalibrationPart::Primitives],
        costs: DrawCosts {
            square: splat,
            triangle: Some(PerRasterizer {
                raster: Some(TriangleCosts {
                    triangle_ns: 70.0,
                    passes,
                }),
                compute: None,
            }),
            node_ns: Some(4.0),
            device_node_ns: Some(6.0),
            ..DrawCosts::default()
        },
        took_ms: 300.0,
    }
}

#[test]
fn what_takes_too_long_is_given_up_and_not_tried_again() {
    let Some(gpu) = device() else { return };
    let parts = [CalibrationPart::Filtered, CalibrationPart::Primitives];
    // No time at all, and frames that would have to be the same to the nanosecond.
    let hasty = PartLimits {
        patience: Duration::ZERO,
        ..ASKED_FOR
    };
    let strict = PartLimits {
        unsteady: 1.0,
        ..ASKED_FOR
    };
    let [_, found] = [strict, hasty].map(|limits| {
        let found = DeviceCalibration::measure_within(&gpu, &parts, limits).unwrap();
        assert_eq!(found.costs, DrawCosts::default());
        assert_eq!(
            (&found.parts[..], &found.given_up[..]),
            (&[][..], &parts[..])
        );
        found
    });
    // Once more, and then no more.
    let again = found.clone().and(Some(found));
    assert_eq!(
        (&again.parts[..], &again.given_up[..]),
        (&parts[..], &[][..])
    );
    let folder = tempfile::tempdir().unwrap();
    again.write(folder.path()).unwrap();
    let kept = DeviceCalibration::kept(&gpu, Some(folder.path()), &parts, false).unwrap();
    assert!(!kept.is_new && kept.calibration == again);
    close_in_silence(gpu);
}

#[test]
fn parts_that_were_not_measured_again_stay() {
    let old = made("1");
    let mut new = made("1");
    new.parts = vec![CalibrationPart::Filtered, CalibrationPart::Nodes];
    new.given_up = vec![CalibrationPart::Blended];
    new.costs = DrawCosts {
        filtered: old.costs.square,
        node_ns: Some(5.0),
        ..DrawCosts::default()
    };
    let both = new.clone().and(Some(old.clone()));
    assert_eq!(
        both.parts,
        [
            CalibrationPart::Filtered,
            CalibrationPart::Nodes,
            CalibrationPart::Opaque
        ]
    );
    assert_eq!(both.costs.square, old.costs.square);
    assert_eq!(both.costs.node_ns, Some(5.0));
    assert_eq!(both.took_ms, 600.0);
    // What was given up before and is measured now is no longer given up.
    assert_eq!(
        both.given_up,
        [CalibrationPart::Blended, CalibrationPart::Primitives]
    );
    assert_eq!(new.clone().and(None), new);
}

#[test]
fn a_file_that_is_damaged_or_of_another_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let calibration = made("1");
    let file = key("1").path(folder);
    assert_eq!(DeviceCalibration::read(folder, &key("1")), None);
    calibration.write(folder).unwrap();
    assert_eq!(
        DeviceCalibration::read(folder, &key("1")),
        Some(calibration.clone())
    );
    // Another version has another file, and does not believe this one in its place.
    assert_eq!(DeviceCalibration::read(folder, &key("2")), None);
    std::fs::copy(&file, key("2").path(folder)).unwrap();
    assert_eq!(DeviceCalibration::read(folder, &key("2")), None);
    let text = std::fs::read_to_string(&file).unwrap();
    for damaged in [
        text[..text.len() / 2].to_owned(),
        String::new(),
        text.replace("4.0", "-4.0"),
        text.replace("node_ns", "nodes"),
        text.replace("\"opaque\"", "\"oblique\""),
        text.replace("130.5", "1e999"),
    ] {
        assert_ne!(damaged, text);
        std::fs::write(&file, damaged).unwrap();
        assert_eq!(DeviceCalibration::read(folder, &key("1")), None);
    }
    // Nor bytes that are no text, nor a folder in its place.
    std::fs::write(&file, [0xff, 0xfe, 0x00]).unwrap();
    assert_eq!(DeviceCalibration::read(folder, &key("1")), None);
    std::fs::remove_file(&file).unwrap();
    std::fs::create_dir(&file).unwrap();
    assert_eq!(DeviceCalibration::read(folder, &key("1")), None);
}
