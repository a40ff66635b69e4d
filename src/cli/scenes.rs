//! `surfel scenes`

use super::{CommandFailure, Outcome, print};
use serde_json::json;
use std::fmt::Write;
use surfel::scenes::{self, SceneEntry};

/// List the built-in scenes that methods fail at.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surfel scenes\n  surfel scenes --json\n  surfel render --scene sheets-1 -o sheets.png --splat filtered\n  surfel info scene:needles\n\nThe threshold is that of the picture; --threshold of render overrides it."
)]
pub(crate) struct ScenesArgs {
    /// Print JSON, with sizes and closed forms
    #[arg(long)]
    json: bool,
}

/// The list for people.
pub(crate) fn print_list() -> Outcome {
    let mut text = String::new();
    for SceneEntry {
        name, shows, fails, ..
    } in scenes::ALL
    {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{name:<20} {shows}\n{:<20} fails: {fails}", "");
    }
    print(&text)
}

fn facts(entry: &SceneEntry) -> serde_json::Value {
    let scene = entry.make();
    json!({
        "name": entry.name,
        "shows": entry.shows,
        "fails": entry.fails,
        "triangles": scene.mesh.triangles.len(),
        "vertices": scene.mesh.positions.len(),
        "width": scene.camera.width,
        "height": scene.camera.height,
        "threshold_px": scene.threshold_px,
        "expected": scene.expected,
    })
}

pub(crate) fn run(args: ScenesArgs) -> Outcome {
    if !args.json {
        return print_list();
    }
    let all: Vec<_> = scenes::ALL.iter().map(facts).collect();
    let text = serde_json::to_string_pretty(&all).map_err(|e| CommandFailure::Run(e.into()))?;
    print(&(text + "\n"))
}
