//! What drawing costs on a device is measured at first use, kept, and never in the way of a run.

use super::harness::{Run, command, expect, has_device, names, run_with};
use std::path::Path;

/// Renders with a cache folder of its own, in which the program calibrates.
fn render(folder: &Path, words: &str) -> Run {
    let mut command = command();
    command
        .args("render generate:statue:3000 --size 80x80 --quiet --log surfel=debug".split(' '))
        .args(words.split_whitespace())
        // Elsewhere a software device leaves much to the processor, and its costs decide nothing.
        .args(match words.contains("--device") {
            true => [].as_slice(),
            false => &["--backend", "vulkan"],
        })
        .current_dir(folder)
        .env("SURFEL_CACHE", folder.join("cache"))
        // Other tests run beside this one.
        .env("SURFEL_CALIBRATE", "always");
    run_with(command, None)
}

/// The files of costs in the cache.
fn kept(folder: &Path) -> Vec<String> {
    let cache = folder.join("cache");
    let names = if cache.is_dir() {
        names(&cache)
    } else {
        Vec::new()
    };
    names
        .into_iter()
        .filter(|name| name.starts_with("costs-"))
        .collect()
}

#[test]
fn costs_are_measured_at_first_use_of_what_they_decide() {
    if !has_device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Who insists on a path waits for no measurement, and triangles leave nothing to decide.
    for words in [
        "--path raster -o a.png",
        "--path raster --splat gauss -o a.png",
        "--method triangles -o a.png",
        "--path raster --splat visibility -o a.png",
    ] {
        let run = render(at, words);
        assert_eq!(run.code, 0, "{words}: {}", run.err);
        assert!(!run.err.contains("calibrated ["), "{words}: {}", run.err);
        assert!(kept(at).is_empty(), "{words}");
    }
    let run = render(at, "--path auto --splat filtered -o a.png --validate");
    assert_eq!(run.code, 0, "{}", run.err);
    assert!(run.err.contains("calibrated [Filtered]"), "{}", run.err);
    assert!(
        run.err.contains("blended splats: ") && run.err.contains("as measured on this device"),
        "{}",
        run.err
    );
    let files = kept(at);
    assert_eq!(files.len(), 1);
    // The second time it is there; another kind is measured and put beside it.
    let again = render(at, "--path auto --splat filtered -o b.png");
    assert!(!again.err.contains("calibrated ["), "{}", again.err);
    let file = at.join("cache").join(&files[0]);
    let text = std::fs::read_to_string(&file).unwrap();
    let other = render(at, "--path auto --method splats -o c.png");
    assert!(
        other.err.contains("calibrated [Primitives]"),
        "{}",
        other.err
    );
    assert_eq!(kept(at), files);
    let both: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    let before: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(both["parts"], serde_json::json!(["primitives", "filtered"]));
    assert_eq!(both["costs"]["filtered"], before["costs"]["filtered"]);
    // Damaged, or of another program in its place: measured again.
    for damaged in [
        "{".to_owned(),
        text.replace("\"driver\": \"", "\"driver\": \"another "),
    ] {
        assert_ne!(damaged, text);
        std::fs::write(&file, &damaged).unwrap();
        let run = render(at, "--path auto --splat filtered -o d.png");
        assert_eq!(run.code, 0, "{}", run.err);
        assert!(run.err.contains("calibrated [Filtered]"), "{}", run.err);
        assert_ne!(std::fs::read_to_string(&file).unwrap(), damaged);
    }
}

/// On software devices a chart has lines of what is left to the program, and `--method auto` chooses among them.
#[test]
fn what_is_left_to_the_program_is_charted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let listed = expect(at, 0, "devices --json").json();
    let first = &listed.as_array().unwrap().first().map(|d| &d["device"]);
    if !has_device() {
        return;
    }
    if first.is_none_or(|device| device["kind"] != "cpu") {
        println!(
            "the first device is no software device: what is left to the program is not tested"
        );
        return;
    }
    for words in [
        "chart generate:statue:3000 -o chart --quick --fills 1 --repeats 1 --size 80x80",
        "render generate:statue:3000 -o a.png --method auto --max-error 0.5 --size 80x80",
    ] {
        let mut command = command();
        command
            .args(words.split(' '))
            .args(["--quiet", "--log", "surfel=debug"])
            .current_dir(at)
            .env("SURFEL_CACHE", at.join("cache"))
            .env("SURFEL_CALIBRATE", "always");
        let run = run_with(command, None);
        assert_eq!(run.code, 0, "{words}: {}", run.err);
        if words.starts_with("chart") {
            let rows = std::fs::read_to_string(at.join("chart/rows.csv")).unwrap();
            let by_itself = rows.lines().filter(|row| row.contains(",auto,")).count();
            assert!(by_itself >= 3, "{rows}");
        }
    }
}

#[test]
fn what_cannot_be_kept_or_must_not_be_measured_is_no_failure() {
    if !has_device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Below a file no folder can be made.
    std::fs::write(at.join("cache"), "a file").unwrap();
    let run = render(at, "--path auto --splat filtered -o a.png");
    assert_eq!(run.code, 0, "{}", run.err);
    assert!(run.err.contains("is not kept"), "{}", run.err);
    std::fs::remove_file(at.join("cache")).unwrap();
    // Switched off, as the harness does for all other tests.
    let mut off = command();
    off.args(
        "render generate:statue:3000 --size 80x80 --quiet --log surfel=debug -o b.png --path auto"
            .split(' '),
    )
    .args(["--backend", "vulkan"])
    .current_dir(at)
    .env("SURFEL_CACHE", at.join("cache"));
    let run = run_with(off, None);
    assert_eq!(run.code, 0, "{}", run.err);
    assert!(
        run.err.contains("SURFEL_CALIBRATE is off") && !run.err.contains("calibrated ["),
        "{}",
        run.err
    );
    assert!(kept(at).is_empty());
    let mirror = render(at, "--device mirror -o c.png");
    assert!(mirror.code == 0 && !mirror.err.contains("calibrated ["));
}
