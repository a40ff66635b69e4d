//! `motion`: a table, files that programs can read, pictures of the worst steps, usage.

use super::harness::{Run, names, surfel_in};
use serde_json::Value;
use std::path::Path;

const MODEL: [&str; 6] = [
    "motion",
    "generate:statue:5000",
    "--device",
    "mirror",
    "--size",
    "64x48",
];

/// Options may have blanks in them.
fn motion(folder: &Path, code: i32, more: &[&str]) -> Run {
    let run = surfel_in(folder, MODEL.iter().chain(more));
    assert_eq!(run.code, code, "{more:?}: {}", run.err);
    run
}

#[test]
fn the_table_has_a_row_for_each_look() {
    let more = [
        "--steps",
        "1",
        "--threshold",
        "3",
        "--with",
        "--splat filtered",
    ];
    let run = motion(tempfile::tempdir().unwrap().path(), 0, &more);
    let text = run.text();
    for row in ["one exact sample", "pop, square, 3 px", "--splat filtered"] {
        assert!(text.contains(row), "{row} is not in {text}");
    }
    assert!(text.contains("The reference itself changes by"), "{text}");
}

#[test]
fn files_have_every_look_and_step() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let more = [
        "--steps",
        "3",
        "--samples",
        "4",
        "--along",
        "refine",
        "--with",
        "--method splats --threshold 2",
        "--json",
        "all.json",
        "--csv",
        "all.csv",
        "-o",
        "pictures",
    ];
    motion(folder.path(), 0, &more);
    let all: Value = serde_json::from_str(&read("all.json")).unwrap();
    assert!(all["path"] == "refine" && all["steps"] == 3);
    let subjects = all["subjects"].as_array().unwrap();
    assert_eq!(subjects.len(), 3);
    assert_eq!(subjects[2]["settings"]["method"], "splats");
    for subject in subjects {
        let figures = &subject["figures"];
        // A camera at rest: the reference stays as it is, and so does one sample of it.
        assert_eq!(figures["reference_level"], 0.0);
        let is_exact = subject["label"] == "one exact sample";
        assert_eq!(figures["mean_level"] == 0.0, is_exact, "{figures}");
        assert_eq!(figures["mean_churn"].is_null(), is_exact, "{figures}");
        assert_eq!(subject["steps"].as_array().unwrap().len(), 3);
    }
    let rows = read("all.csv");
    assert_eq!(rows.lines().count(), 1 + 3 * 3);
    for row in rows.lines() {
        // Names have commas, and quotes around them.
        let (_, figures) = row
            .rsplit_once('"')
            .unwrap_or(("", row.trim_start_matches("label")));
        assert_eq!(figures.split(',').count(), 13, "{row}");
    }
    assert_eq!(
        names(&folder.path().join("pictures")),
        ["worst-0.png", "worst-1.png", "worst-2.png"]
    );
}

#[test]
fn what_cannot_be_meant_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (more, told) in [
        (&["--samples", "5"][..], "square"),
        (&["--degrees-per-step", "0"], "angle"),
        (&["--fps", "0"], "rate"),
        (&["--pop-level", "nan"], "change"),
        (&["--coarsest", "0.5"], "factor"),
        (&["--steps", "0"], "--steps"),
        (&["--along", "spiral"], "spiral"),
        (&["--with", "--splat rhombus"], "rhombus"),
        (&["--with", "--steps 3"], "--steps"),
        (&["--with", "--threshold -1"], "-1"),
        (&["--json", "-", "--csv", "-"], "one file"),
    ] {
        let run = motion(folder.path(), 2, more);
        assert!(run.err.contains(told), "{more:?}: {}", run.err);
    }
}
