//! `surfel check`

use super::source::{Framing, Source, SurfaceArgs};
use super::{Failure, Outcome, chain, count, print};
use serde_json::json;
use std::fmt::Write;
use std::path::PathBuf;
use surfel::tree;

/// Check model files and every invariant of their trees.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surfel check scan.ply\n  surfel check models/*.obj\n\nExit code 2 when a file cannot be read, 1 when an invariant of a tree does not hold."
)]
pub(crate) struct Args {
    /// Model files, - for standard input, or generate:SHAPE[:TRIANGLES]
    #[arg(value_name = "MODEL", required = true)]
    models: Vec<PathBuf>,
    /// Merge vertices that are equal in position, normal and color
    #[arg(long)]
    weld: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: Args, quiet: bool) -> Outcome {
    let mut rows = Vec::new();
    let mut text = String::new();
    let count_of_models = args.models.len();
    let mut unreadable = Vec::new();
    let mut broken = 0;
    for path in args.models {
        let source = Source {
            model: path.clone(),
            weld: args.weld,
            frame: Framing::Robust,
            surface: SurfaceArgs::default(),
        };
        let ready = match source.open(quiet) {
            Ok(ready) => ready,
            Err(Failure::Input(error)) => {
                rows.push(json!({ "file": path.display().to_string(), "error": chain(&error) }));
                // A single model's error is said once, at the end.
                if count_of_models > 1 {
                    let _ = writeln!(text, "{}", chain(&error));
                }
                unreadable.push(error);
                continue;
            }
            Err(failure) => return Err(failure),
        };
        let report = tree::check(&ready.model);
        let is_clean = report.is_clean();
        broken += usize::from(!is_clean);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{}: {} ({}; {} triangles, {} vertices, {} nodes)",
            ready.name,
            if is_clean { "clean" } else { "BROKEN" },
            ready.format,
            count(ready.model.triangles.len() as u64),
            count(ready.model.vertices.len() as u64),
            count((ready.model.tree.nodes.len() + ready.model.tree.leaves.len()) as u64)
        );
        for violation in &report.violations {
            let _ = writeln!(text, "  {violation}");
        }
        let mut facts = super::info::facts(&ready);
        facts["clean"] = is_clean.into();
        facts["violations"] = report.violations.clone().into();
        rows.push(facts);
    }
    if args.json {
        let json = serde_json::to_string_pretty(&rows).map_err(|e| Failure::Run(e.into()))?;
        print(&(json + "\n"))?;
    } else {
        print(&text)?;
    }
    if broken > 0 {
        return Err(Failure::Run(anyhow::anyhow!(
            "{broken} tree(s) break an invariant"
        )));
    }
    match (unreadable.pop(), unreadable.len()) {
        (None, _) => Ok(()),
        (Some(error), _) if count_of_models == 1 => Err(Failure::Input(error)),
        (Some(_), others) => Err(Failure::Input(anyhow::anyhow!(
            "{} of {count_of_models} models cannot be read",
            others + 1
        ))),
    }
}
