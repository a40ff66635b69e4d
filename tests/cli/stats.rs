//! `--stats`, `info --json`: every field, with values that can be true.

use super::harness::{expect, has_device};
use serde_json::Value;

/// The keys of an object, sorted.
fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value
        .as_object()
        .unwrap_or_else(|| panic!("{value} is no object"))
        .keys()
        .map(String::as_str)
        .collect();
    keys.sort_unstable();
    keys
}

/// A positive spread, in order.
fn spread(value: &Value) -> f64 {
    assert_eq!(keys(value), ["median", "p5", "p95"], "{value}");
    let [p5, median, p95] = ["p5", "median", "p95"].map(|k| value[k].as_f64().unwrap());
    assert!(
        0.0 <= p5 && p5 <= median && median <= p95 && p95 < 1e12,
        "{value}"
    );
    median
}

/// A count that is the same in every frame.
fn count(stats: &Value, name: &str) -> u64 {
    let value = &stats["counts"][name];
    let median = spread(value);
    assert_eq!(
        (value["p5"].as_f64(), value["p95"].as_f64()),
        (Some(median), Some(median)),
        "{name}"
    );
    median as u64
}

/// methods.md 3.1: the thesis's Table 5.6 counts 1,349,525 nodes for 1,000,000 triangles.
const NODES: u64 = 1_349_525;

fn check_stats(stats: &Value, method: &str, is_device: bool) {
    assert_eq!(
        keys(stats),
        [
            "counts", "cpu", "device", "frame_ms", "frames", "memory", "model", "passes",
            "settings"
        ]
    );
    assert_eq!(stats["frames"], 1);
    assert!(spread(&stats["frame_ms"]) > 0.0);
    let cpu: Vec<(&str, f64)> = stats["cpu"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| (c["name"].as_str().unwrap(), spread(&c["ms"])))
        .collect();
    assert_eq!(
        cpu.iter().map(|c| c.0).collect::<Vec<_>>(),
        ["cut", "pack", "upload", "submit", "wait", "look"]
    );
    let parts: f64 = cpu.iter().map(|c| c.1).sum();
    // One frame: the parts are of the same frame as the whole, which has more in it.
    assert!(parts <= spread(&stats["frame_ms"]) * 1.001, "{stats}");
    assert_eq!(
        keys(&stats["settings"]),
        [
            "blend",
            "culls_back",
            "depth_offset",
            "height",
            "light",
            "method",
            "path",
            "reconstruction",
            "shading",
            "size_metric",
            "splat",
            "threshold_px",
            "traversal",
            "width",
        ]
    );
    assert_eq!(stats["settings"]["method"], method);
    assert_eq!(
        (
            stats["settings"]["width"].as_u64(),
            stats["settings"]["height"].as_u64()
        ),
        (Some(120), Some(90))
    );
    assert_eq!(stats["settings"]["culls_back"], true);

    assert_eq!(
        keys(&stats["counts"]),
        [
            "between",
            "draw_list_bytes",
            "hidden",
            "nodes_in_tree",
            "nodes_visited",
            "points",
            "splats",
            "triangles"
        ]
    );
    assert_eq!(stats["counts"]["nodes_in_tree"], NODES);
    let [visited, splats, triangles, points, bytes] = [
        "nodes_visited",
        "splats",
        "triangles",
        "points",
        "draw_list_bytes",
    ]
    .map(|n| count(stats, n));
    let is_by_host = match method {
        "triangles" => {
            assert_eq!((visited, splats, triangles, points), (0, 0, 1_000_000, 0));
            false
        }
        "points" => {
            assert_eq!((visited, splats, triangles, points), (0, 0, 0, 501_501));
            false
        }
        _ => {
            // Far fewer than there are, and not none: a sphere of about 90 pixels.
            assert!((500..100_000).contains(&splats), "{splats}");
            // A node drawn as a strip is one visit and several splats.
            assert!(visited > splats / 8 && visited < NODES / 2, "{visited}");
            assert_eq!(points, 0);
            // A record a splat; or on a software device, where the host draws them, color and depth of each pixel of the box around
            // them, and records of samples of triangles alone.
            let own = bytes - 12 * triangles;
            let by_host = own.is_multiple_of(8) && own <= 24 * triangles + 8 * 120 * 90;
            assert!(
                own == 24 * splats || (is_device && by_host && own > 0),
                "bytes of the draw lists: {own}"
            );
            by_host && own != 24 * splats
        }
    };
    if is_device {
        let passes = stats["passes"].as_array().unwrap();
        let has_clock = stats["device"]["timestamp_period_ns"] != 0.0;
        assert!(!passes.is_empty() || is_by_host || !has_clock);
        for pass in passes {
            assert!(pass["name"].as_str().unwrap().contains('.'), "{pass}");
            spread(&pass["gpu_ms"]);
        }
        let memory = stats["memory"].as_array().unwrap();
        let bytes: u64 = memory.iter().map(|m| m["bytes"].as_u64().unwrap()).sum();
        // At the least the vertices of 20 bytes.
        assert!(bytes >= 501_501 * 20, "{memory:?}");
        assert!(
            memory
                .iter()
                .all(|m| !m["name"].as_str().unwrap().is_empty())
        );
    } else {
        assert_eq!(stats["device"]["name"], "reference");
        assert_eq!(
            (
                stats["passes"].as_array().map(Vec::len),
                stats["memory"].as_array().map(Vec::len)
            ),
            (Some(0), Some(0))
        );
    }
}

fn check_facts(facts: &Value, file_bytes: u64) {
    assert_eq!(
        keys(facts),
        [
            "build_ms",
            "center",
            "file",
            "file_bytes",
            "format",
            "has_colors",
            "has_estimated_normals",
            "is_closed",
            "is_cloud",
            "load_ms",
            "max",
            "memory_bytes",
            "min",
            "origin",
            "parts",
            "patch_bytes",
            "radius",
            "remarks",
            "tree",
            "triangles",
            "used_vertices",
            "vertices",
            "with_normals"
        ]
    );
    assert_eq!(facts["file_bytes"], file_bytes);
    assert_eq!(
        (facts["vertices"].as_u64(), facts["triangles"].as_u64()),
        (Some(501_501), Some(1_000_000))
    );
    assert_eq!(
        (facts["is_cloud"].as_bool(), facts["is_closed"].as_bool()),
        (Some(false), Some(true))
    );
    assert_eq!(
        keys(&facts["tree"]),
        ["bytes", "interior_nodes", "leaves", "levels", "nodes"]
    );
    assert_eq!(facts["tree"]["nodes"], NODES);
    assert_eq!(facts["tree"]["leaves"], 1_000_000);
    assert_eq!(facts["tree"]["interior_nodes"], 349_525);
    let triangles = 12 * facts["triangles"].as_u64().unwrap();
    assert_eq!(facts["memory_bytes"]["triangles"], triangles);
    assert_eq!(facts["memory_bytes"]["vertices"], 20 * 501_501);
    for axis in 0..3 {
        assert_eq!(facts["center"][axis].as_f64(), Some(0.0));
        assert_eq!(
            (facts["min"][axis].as_f64(), facts["max"][axis].as_f64()),
            (Some(-1.0), Some(1.0))
        );
    }
    assert!((facts["radius"].as_f64().unwrap() - 1.0).abs() < 1e-6);
    for time in ["load_ms", "build_ms"] {
        assert!(facts[time].as_f64().unwrap() >= 0.0);
    }
}

#[test]
fn statistics_have_every_field_with_a_value_that_can_be_true() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    expect(at, 0, "generate sphere --triangles 1000000 -o sphere.ply");
    let build = expect(at, 0, "build sphere.ply --exact");
    assert!(build.err.contains("1,349,525 nodes"), "{}", build.err);
    let length = |name: &str| at.join(name).metadata().unwrap().len();
    check_facts(
        &expect(at, 0, "info --json sphere.ply").json(),
        length("sphere.ply"),
    );
    let tree = expect(at, 0, "info --json sphere.surfel").json();
    check_facts(&tree, length("sphere.surfel"));
    assert_eq!(tree["build_ms"], 0.0);
    for text in ["501,501", "1,000,000", "1,349,525", "closed", "no colors"] {
        assert!(
            expect(at, 0, "info sphere.surfel").text().contains(text),
            "{text}"
        );
    }
    let mut devices = vec![("--device mirror", false)];
    if has_device() {
        devices.push(("--validate", true));
    }
    let mut found = Vec::new();
    for (device, is_device) in devices {
        for method in ["triangles", "points", "pop"] {
            // What is hidden a device may find out in another way.
            let occlusion = if method == "pop" {
                "--occlusion on"
            } else {
                ""
            };
            let words = format!(
                "render sphere.surfel --size 120x90 --light headlight --ambient-occlusion off --method {method} --threshold 1.5 {occlusion} {device}"
            );
            let stats = expect(at, 0, &format!("{words} --stats -")).json();
            check_stats(&stats, method, is_device);
            check_facts(&stats["model"], length("sphere.surfel"));
            found.push((method, stats["counts"].clone()));
        }
    }
    // The mirror draws the device's lists.
    if let [mirror, device] = &found.chunks(3).collect::<Vec<_>>()[..] {
        for ((method, a), (_, b)) in mirror.iter().zip(*device) {
            for name in ["nodes_visited", "splats", "triangles", "points"] {
                assert_eq!(a[name], b[name], "{method}: {name}");
            }
        }
    }
}

#[test]
fn the_frames_of_a_turn_are_in_the_spread() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let stats = expect(
        at,
        0,
        "render generate:statue:30000 --device mirror --size 64x64 --frames 20 --stats turn.json",
    );
    assert!(stats.out.is_empty());
    let stats: Value =
        serde_json::from_slice(&std::fs::read(at.join("turn.json")).unwrap()).unwrap();
    assert_eq!(stats["frames"], 20);
    spread(&stats["frame_ms"]);
    let visited = &stats["counts"]["nodes_visited"];
    spread(visited);
    assert!(
        visited["p5"].as_f64() < visited["p95"].as_f64(),
        "the views are all the same: {visited}"
    );
}
