//! `render --method auto`: it says what it chose and why, and measures once.

use super::harness::{command, expect, has_device, names, run_with};
use std::path::Path;

/// Runs with a cache folder of its own.
fn render(folder: &Path, words: &str) -> super::harness::Run {
    let mut command = command();
    command
        .args(words.split_whitespace())
        .current_dir(folder)
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .env("HOME", folder)
        .env("LOCALAPPDATA", folder.join("cache"));
    run_with(command, None)
}

#[test]
fn auto_calibrates_once_and_keeps_its_bound() {
    if !has_device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let words = "render generate:statue:3000 --size 80x80 --method auto --quiet --stats -";
    let strict = render(
        folder.path(),
        &format!("{words} --max-error 0.9 --validate"),
    );
    assert_eq!(strict.code, 0, "{}", strict.err);
    assert!(strict.err.contains("measuring once"), "{}", strict.err);
    assert!(
        strict.err.contains("fastest that keeps the bounds")
            && strict.err.contains("(bound 0.9)")
            && strict.err.contains("above the bound in 0 of 2 views"),
        "{}",
        strict.err
    );
    // What it says is what it draws.
    let settings = &strict.json()["settings"];
    let method = settings["method"].as_str().unwrap();
    assert!(
        strict.err.contains(&format!("auto: {method}")),
        "{}",
        strict.err
    );

    // Kept: the second time nothing is measured. No bound can be kept by nothing.
    let again = render(folder.path(), &format!("{words} --max-error 0.000001"));
    assert_eq!(again.code, 0, "{}", again.err);
    assert!(!again.err.contains("measuring once"), "{}", again.err);
    assert!(
        again.err.contains("nothing keeps the bounds"),
        "{}",
        again.err
    );

    // Chosen in the headlight, drawn in any light and color.
    for more in ["--color-by depth", "--color-by overdraw", "--light phong"] {
        let other = render(folder.path(), &format!("{words} --max-error 0.9 {more}"));
        assert_eq!(other.code, 0, "{more}: {}", other.err);
    }

    // A damaged file is made again.
    let cache = walk(folder.path());
    assert_eq!(cache.len(), 1, "{cache:?}");
    std::fs::write(&cache[0], "{").unwrap();
    let words = words.replace("--stats -", "-o a.png");
    let again = render(folder.path(), &format!("{words} --frame-ms 100000"));
    assert_eq!(again.code, 0, "{}", again.err);
    assert!(again.err.contains("measuring once"), "{}", again.err);
    assert!(again.err.contains("most accurate that is fast enough"));
    assert!(names(folder.path()).contains(&"a.png".to_owned()));
}

/// Files of calibrations below a folder.
fn walk(folder: &Path) -> Vec<std::path::PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(walk(&path));
        } else if path.to_string_lossy().contains("calibration-") {
            found.push(path);
        }
    }
    found
}

#[test]
fn bounds_and_what_they_choose_do_not_go_with_everything() {
    let folder = tempfile::tempdir().unwrap();
    for (words, says) in [
        ("--method auto", "--max-error"),
        ("--max-error 0.01", "--method auto"),
        ("--method auto --max-error 0", "--max-error 0"),
        ("--method auto --max-error nan", "--max-error"),
        ("--method auto --frame-ms=-1", "--frame-ms"),
        (
            "--method auto --frame-ms 9 --threshold 2",
            "leave these options out",
        ),
        (
            "--method auto --frame-ms 9 --splat disc",
            "leave these options out",
        ),
    ] {
        let words = format!("render generate:square:8 -o a.png {words}");
        let run = expect(folder.path(), 2, &words);
        assert!(run.err.contains(says), "{words}: {}", run.err);
    }
    let run = expect(folder.path(), 2, "profile generate:square:8 --method auto");
    assert!(run.err.contains("surfel render"), "{}", run.err);
    assert!(names(folder.path()).is_empty());
}
