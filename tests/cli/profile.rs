//! `profile`: every field with values that can be true, files that programs can read, usage, cancelling.

use super::harness::{command, expect, has_device, names};
use serde_json::Value;
use std::path::Path;

/// A spread in order; its median.
fn spread(value: &Value) -> f64 {
    let [p5, median, p95] = ["p5", "median", "p95"].map(|k| value[k].as_f64().unwrap());
    assert!(p5 <= median && median <= p95 && p95 < 1e12, "{value}");
    median
}

/// A spread of what cannot be below 0.
fn size(value: &Value) -> f64 {
    assert!(value["p5"].as_f64().unwrap() >= 0.0, "{value}");
    spread(value)
}

fn keys(value: &Value) -> Vec<&str> {
    let object = value
        .as_object()
        .unwrap_or_else(|| panic!("{value} is no object"));
    let mut keys: Vec<&str> = object.keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

fn check_json(json: &Value, passes: &[&str]) {
    assert_eq!(
        keys(json),
        [
            "bytes",
            "counts",
            "cpu",
            "device",
            "frame",
            "frames",
            "memory",
            "model",
            "passes",
            "profiling",
            "settings",
            "warnings"
        ]
    );
    assert_eq!(json["frames"], 4);
    let is_mirror = json["device"]["name"] == "reference";
    let is_timed = !is_mirror && json["device"]["timestamp_period_ns"] != 0.0;
    let frame = &json["frame"];
    let wall = size(&frame["wall_ms"]);
    assert!(wall > 0.0);
    let cpu = json["cpu"].as_array().unwrap();
    let stages: Vec<&str> = cpu.iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(stages, ["cut", "pack", "upload", "submit", "wait", "look"]);
    let share: f64 = cpu.iter().map(|s| s["share"].as_f64().unwrap()).sum();
    assert!(share > 0.0 && share <= 1.0 + 1e-9, "{share}");
    for stage in cpu {
        size(&stage["ms"]);
    }

    let rows = json["passes"].as_array().unwrap();
    let found: Vec<&str> = rows.iter().map(|p| p["name"].as_str().unwrap()).collect();
    assert_eq!(found, passes);
    let counts = &json["counts"];
    let covered = size(&counts["covered_pixels"]);
    assert_eq!(counts["pixels"], 64 * 48);
    assert!(covered > 0.0 && covered <= 64.0 * 48.0);
    for name in ["nodes_visited", "splats", "triangles", "points"] {
        size(&counts[name]);
    }
    if is_timed {
        assert!(size(&frame["wall_without_timestamps_ms"]) > 0.0);
        assert!(size(&frame["device_ms"]) > 0.0);
        let share: f64 = rows.iter().map(|p| p["share"].as_f64().unwrap()).sum();
        assert!((share - 1.0).abs() < 1e-9, "{share}");
        let device = frame["device_ms"]["p95"].as_f64().unwrap();
        for pass in rows {
            let ms = &pass["gpu_ms"];
            assert!(size(ms) <= device, "{pass}");
            assert!((1..=4).contains(&pass["frames"].as_u64().unwrap()));
        }
        // Passes lie inside of their frame, so they cannot be more than all of it.
        let sum = json["profiling"]["passes_of_device"].as_f64().unwrap();
        assert!(sum > 0.0 && sum <= 1.0 + 1e-9, "{sum}");
        assert!(
            json["profiling"]["self_test"]["rows"]
                .as_array()
                .unwrap()
                .len()
                == 3
        );
        spread(&json["profiling"]["cost_ms"]);
        assert!(json["profiling"]["cost_share"].is_f64());
        assert!(json["profiling"]["clock"].is_string());
    } else {
        assert!(frame["device_ms"].is_null() && json["profiling"]["cost_ms"].is_null());
    }
    if is_mirror {
        assert_eq!(json["memory"]["device_bytes"], 0);
        assert!(counts["samples"].is_null() && counts["overdraw"].is_null());
        return;
    }
    if json["device"]["has_sample_counts"] == true {
        // At least what is seen was drawn.
        assert!(size(&counts["samples"]) >= covered);
        assert!(size(&counts["overdraw"]) >= 1.0);
        let all: f64 = rows
            .iter()
            .map(|p| p["samples"]["p95"].as_f64().unwrap())
            .sum();
        assert!(all + 1e-9 >= counts["samples"]["p95"].as_f64().unwrap());
    } else {
        assert!(counts["samples"].is_null() && counts["overdraw"].is_null());
    }
    let bytes = &json["bytes"];
    assert!(size(&bytes["uploaded"]) > size(&bytes["draw_lists"]));
    assert!(size(&bytes["stored"]) > 0.0 && size(&bytes["loaded"]) >= 0.0);
    let memory = &json["memory"];
    let resources = memory["resources"].as_array().unwrap();
    let sum: u64 = resources.iter().map(|r| r["bytes"].as_u64().unwrap()).sum();
    assert_eq!(memory["device_bytes"], sum);
    for name in ["vertices", "color", "depth"] {
        assert!(
            resources.iter().any(|r| r["name"] == name),
            "{name}: {memory}"
        );
    }
    // Reading pictures back is for the counts; the frames that were timed had no buffer for it.
    assert!(resources.iter().all(|r| r["name"] != "readback of color"));
}

fn check_csv(text: &str, json: &Value) {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    for name in [
        "frame", "wall_ms", "cut_ms", "wait_ms", "splats", "overdraw",
    ] {
        assert!(header.contains(&name), "{name}: {header:?}");
    }
    let rows: Vec<Vec<&str>> = lines.map(|l| l.split(',').collect()).collect();
    assert_eq!(rows.len(), 4);
    let column = |name: &str| -> Vec<f64> {
        let at = header.iter().position(|h| *h == name).unwrap();
        rows.iter()
            .filter(|r| !r[at].is_empty())
            .map(|r| r[at].parse().unwrap())
            .collect()
    };
    for row in &rows {
        assert_eq!(row.len(), header.len(), "{row:?}");
        assert!(row.iter().all(|c| c.is_empty() || c.parse::<f64>().is_ok()));
    }
    assert_eq!(column("frame"), [0.0, 1.0, 2.0, 3.0]);
    // The same figures as the JSON, which has their medians: of four, the mean of the middle two.
    let median = |name: &str| {
        let mut values = column(name);
        values.sort_by(f64::total_cmp);
        (values[1] + values[2]) / 2.0
    };
    assert_eq!(median("wall_ms"), spread(&json["frame"]["wall_ms"]));
    assert_eq!(median("splats"), spread(&json["counts"]["splats"]));
    assert_eq!(
        median("covered_pixels"),
        spread(&json["counts"]["covered_pixels"])
    );
    for pass in json["passes"].as_array().unwrap() {
        let name = pass["name"].as_str().unwrap();
        assert!(
            header.contains(&format!("{name}_ms").as_str()),
            "{header:?}"
        );
        if pass["frames"] == 4 && !pass["gpu_ms"].is_null() {
            assert_eq!(median(&format!("{name}_ms")), spread(&pass["gpu_ms"]));
        }
    }
}

#[test]
fn all_files_agree_and_every_field_can_be_true() {
    if !has_device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (options, passes) in [
        (
            "--threshold 2 --path raster",
            &["opaque.triangles", "opaque.splats"][..],
        ),
        (
            "--splat filtered --path raster",
            &["filtered.depth", "filtered.blend", "filtered.normalize"][..],
        ),
    ] {
        let run = expect(
            at,
            0,
            &format!(
                "profile generate:torus:20000 --frames 4 --size 64x48 {options} --validate \
                 --json p.json --csv p.csv --trace p.trace"
            ),
        );
        assert_eq!(names(at), ["p.csv", "p.json", "p.trace"]);
        let json: Value = serde_json::from_str(&read(&at.join("p.json"))).unwrap();
        check_json(&json, passes);
        check_csv(&read(&at.join("p.csv")), &json);
        let trace: Value = serde_json::from_str(&read(&at.join("p.trace"))).unwrap();
        assert_eq!(trace["otherData"]["run"]["frames"], 4);
        let events = trace["traceEvents"].as_array().unwrap();
        for pass in passes {
            assert!(events.iter().any(|e| e["name"] == *pass), "{pass}");
        }
        // The table has the same names, and every warning is on both sides.
        let table = run.text();
        for name in passes.iter().chain(&["frame", "cut", "wait", "overdraw"]) {
            assert!(table.contains(name), "{name}: {table}");
        }
        let warnings = json["warnings"].as_array().unwrap();
        for warning in warnings.iter().map(|w| w.as_str().unwrap()) {
            assert!(run.err.contains(warning) && table.contains(warning));
        }
        assert_eq!(run.err.matches("warning:").count(), warnings.len());
    }
}

#[test]
fn a_file_named_minus_is_standard_output_and_the_table_makes_room() {
    let folder = tempfile::tempdir().unwrap();
    let words =
        "profile generate:sphere:20000 --device mirror --frames 4 --size 64x48 --threshold 3";
    let run = expect(folder.path(), 0, &format!("{words} --json -"));
    check_json(&run.json(), &[]);
    let csv = expect(folder.path(), 0, &format!("{words} --csv -")).text();
    assert_eq!(csv.lines().count(), 5);
    let trace = expect(folder.path(), 0, &format!("{words} --trace -")).json();
    assert!(
        trace["otherData"]["clock"]
            .as_str()
            .unwrap()
            .contains("processor")
    );
    let table = expect(folder.path(), 0, words).text();
    assert!(table.contains("not known on this device"), "{table}");
    assert!(names(folder.path()).is_empty());
}

#[test]
fn a_camera_is_measured_as_often_as_asked() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let model = "generate:sphere:2000 --device mirror";
    expect(
        at,
        0,
        &format!("render {model} --size 64x48 --save-camera camera.json"),
    );
    let run = expect(
        at,
        0,
        &format!("profile {model} --camera camera.json --frames 4 --json -"),
    );
    let counts = &run.json()["counts"]["triangles"];
    assert!(counts["p5"] == counts["p95"] && counts["median"].as_f64().unwrap() > 0.0);
    let wrong = format!("profile {model} --camera camera.json --size 64x64 --frames 4");
    assert!(expect(at, 2, &wrong).err.contains("another shape"));
}

#[test]
fn bad_usage_is_told_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("model.ply"), "no model").unwrap();
    for (words, code, says) in [
        ("profile", 2, "<MODEL>"),
        ("profile model.ply --frames 0", 2, "1 to 10000"),
        ("profile model.ply --frames 10001", 2, "1 to 10000"),
        ("profile model.ply --warm-up 1001", 2, "0 to 1000"),
        ("profile model.ply --json - --csv -", 2, "another output"),
        ("profile model.ply --json model.ply", 2, "is its model"),
        ("profile model.ply --threshold=-1", 2, "--threshold"),
        (
            "profile model.ply --orbit 1,2 --camera c.json",
            2,
            "cannot be used with",
        ),
        ("profile model.ply --camera none.json", 2, "none.json"),
        ("profile model.ply --trace none/t.json", 1, "does not exist"),
        ("profile model.ply", 2, "model.ply"),
        (
            "profile generate:sphere:2000 --device nothing-of-that-name",
            2,
            "nothing-of-that-name",
        ),
    ] {
        // Without any driver there is no list of devices to look a name up in.
        if words.contains("nothing-of-that-name") && !has_device() {
            continue;
        }
        let run = expect(at, code, words);
        assert!(run.err.contains(says), "surfel {words}: {}", run.err);
        assert!(run.out.is_empty());
    }
    assert_eq!(names(at), ["model.ply"]);
}

#[test]
#[cfg(unix)]
fn interrupting_a_profile_leaves_no_file() {
    use std::io::{BufRead, BufReader, Read};
    let folder = tempfile::tempdir().unwrap();
    let mut command = command();
    command
        .args(
            "profile generate:statue:3000 --device mirror --size 64x64 --frames 10000 --json a.json \
             --csv a.csv --trace a.trace --log surfel=info"
                .split_whitespace(),
        )
        .current_dir(folder.path())
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut err = BufReader::new(child.stderr.take().unwrap());
    // It says on its log when it begins to draw.
    let mut line = String::new();
    while !line.contains("progress: time") {
        line.clear();
        assert!(err.read_line(&mut line).unwrap() > 0, "over before it drew");
    }
    let killed = std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(killed.success());
    let mut rest = String::new();
    err.read_to_string(&mut rest).unwrap();
    assert_eq!(super::harness::wait(&mut child), Some(1), "{rest}");
    assert!(rest.contains("cancelled after"), "{rest}");
    assert_eq!(names(folder.path()), Vec::<String>::new());
}

#[test]
fn the_log_has_spans_of_stages_and_passes() {
    if !has_device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let words =
        "render generate:torus:20000 --size 64x48 -o a.png --log surfel=debug --backend vulkan";
    let err = expect(folder.path(), 0, words).err;
    for span in [
        "cut: ",
        "pack: ",
        "upload: ",
        "submit: ",
        "wait: ",
        "submit:pass{name=\"opaque.triangles\"}: ",
    ] {
        let is_there = err
            .lines()
            .any(|l| l.contains(span) && l.contains("time.busy="));
        assert!(is_there, "{span}: {err}");
    }
    // Nothing unless asked for.
    let words = "render generate:torus:20000 --size 64x48 -o a.png";
    assert_eq!(expect(folder.path(), 0, words).err, "");
}
