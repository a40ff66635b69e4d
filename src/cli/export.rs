//! `surfel export`

use super::progress::JobBar;
use super::source::KeepArgs;
use super::{CommandFailure, Outcome, count, say, usage};
use std::path::PathBuf;
use surfel::open::export::{ExportOptions, export, format_of};

/// Write what is kept of a point cloud, with all that its points carry.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surfel export tile.laz --keep class=2 -o ground.laz\n  surfel export tile.laz --clip-box 0,0,0,100,100,50 --spacing 0.1 -o part.ply"
)]
pub(crate) struct ExportArgs {
    /// Point cloud: a file, or - for standard input
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    #[command(flatten)]
    keep: KeepArgs,
    /// Keep one point in each cell of this size, in units of the coordinates
    #[arg(long, value_name = "SIZE", value_parser = parse_spacing)]
    spacing: Option<f64>,
    /// File to write: .ply, .las or .laz
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

fn parse_spacing(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(size) if size > 0.0 && size < f64::MAX => Ok(size),
        _ => Err("expected a size above 0".to_owned()),
    }
}

pub(crate) fn run(args: ExportArgs, quiet: bool) -> Outcome {
    let Some(format) = format_of(&args.output) else {
        return Err(usage(format!(
            "--output {}: the ending must be ply, las or laz",
            args.output.display()
        )));
    };
    super::check_outputs(&[&args.output], &args.model)?;
    let options = ExportOptions {
        keep: args.keep.filter(),
        spacing: args.spacing,
        ..ExportOptions::default()
    };
    let bar = JobBar::new(quiet);
    let report = export(&args.model, &options, (format, &args.output), &bar);
    drop(bar);
    let report = report.map_err(|error| match error {
        surfel::Error::Generate(error) => CommandFailure::Run(error.into()),
        other => other.into(),
    })?;
    for warning in &report.warnings {
        say(&format!(
            "surfel: {}: warning: {warning}",
            args.model.display()
        ));
    }
    let [points, kept] = report.points;
    say(&format!(
        "{}: {} of {} points to {}",
        args.model.display(),
        count(kept),
        count(points),
        args.output.display()
    ));
    Ok(())
}
