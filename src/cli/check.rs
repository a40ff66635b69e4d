//! `surfel check`

use super::source::{KeepArgs, ModelArgs, SurfaceArgs, ViewFraming};
use super::{CommandFailure, Outcome, chain, count, print};
use serde_json::{Value, json};
use std::fmt::Write;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use surfel::open::SourceFormat;
use surfel::pages::check::PagedReport;
use surfel::pages::format::{MAGIC, is_paged_file};
use surfel::pages::{self, file::PagedFile, source::FileSource};
use surfel::patches::check_records;
use surfel::progress::SilentProgress;
use surfel::tree;

/// Check model files and every invariant of their trees.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surfel check scan.ply\n  surfel check models/*.obj\n\nExit code 2 when a file cannot be read, 1 when an invariant of a tree does not hold."
)]
pub(crate) struct CheckArgs {
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

/// Tells by its first bytes whether a file is a paged tree; one that cannot be read is none.
fn is_paged(path: &Path) -> bool {
    let mut start = [0; MAGIC.len()];
    let read = std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok() && is_paged_file(&start)
}

/// Every checksum and every bound of a paged file, a page at a time.
fn check_pages(path: &Path) -> Result<PagedReport, tree::Error> {
    let source = FileSource::open(path).map_err(|source| tree::Error::Io {
        path: path.to_owned(),
        source,
    })?;
    let file = PagedFile::open(Arc::new(source))?;
    Ok(pages::check::check(&file, &SilentProgress))
}

/// Findings about a paged file, as text and as a row.
fn add_pages(path: &Path, report: &PagedReport, text: &mut String, rows: &mut Vec<Value>) {
    let name = path.display().to_string();
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{name}: {} ({}; {} leaves, {} nodes, {} pages)",
        if report.is_clean() { "clean" } else { "BROKEN" },
        SourceFormat::PagedTree,
        count(report.leaves),
        count(report.nodes + report.leaves),
        count(report.pages)
    );
    for violation in &report.violations {
        let _ = writeln!(text, "  {violation}");
    }
    rows.push(json!({
        "file": name,
        "format": SourceFormat::PagedTree.name(),
        "leaves": report.leaves,
        "nodes": report.nodes,
        "pages": report.pages,
        "clean": report.is_clean(),
        "violations": report.violations,
    }));
}

pub(crate) fn run(args: CheckArgs, quiet: bool) -> Outcome {
    let mut rows = Vec::new();
    let mut text = String::new();
    let count_of_models = args.models.len();
    let mut unreadable = Vec::new();
    let mut broken = 0;
    for path in args.models {
        if is_paged(&path) {
            match check_pages(&path) {
                Ok(report) => {
                    broken += usize::from(!report.is_clean());
                    add_pages(&path, &report, &mut text, &mut rows);
                }
                Err(error) => {
                    let error = anyhow::Error::new(error);
                    rows.push(
                        json!({ "file": path.display().to_string(), "error": chain(&error) }),
                    );
                    if count_of_models > 1 {
                        let _ = writeln!(text, "{}", chain(&error));
                    }
                    unreadable.push(error);
                }
            }
            continue;
        }
        let source = ModelArgs {
            model: path.clone(),
            weld: args.weld,
            frame: ViewFraming::Robust,
            surface: SurfaceArgs::default(),
            keep: KeepArgs::default(),
        };
        let ready = match source.open(quiet) {
            Ok(ready) => ready,
            Err(CommandFailure::Input(error)) => {
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
        let mut report = tree::check(&ready.model);
        let of_patches = check_records(&ready.model);
        let is_clean = report.is_clean() && of_patches.is_empty();
        report.violations.extend(of_patches);
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
        let json =
            serde_json::to_string_pretty(&rows).map_err(|e| CommandFailure::Run(e.into()))?;
        print(&(json + "\n"))?;
    } else {
        print(&text)?;
    }
    if broken > 0 {
        return Err(CommandFailure::Run(anyhow::anyhow!(
            "{broken} tree(s) break an invariant"
        )));
    }
    match (unreadable.pop(), unreadable.len()) {
        (None, _) => Ok(()),
        (Some(error), _) if count_of_models == 1 => Err(CommandFailure::Input(error)),
        (Some(_), others) => Err(CommandFailure::Input(anyhow::anyhow!(
            "{} of {count_of_models} models cannot be read",
            others + 1
        ))),
    }
}
