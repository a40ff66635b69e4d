//! `surfel generate`

use super::progress::JobBar;
use super::{Outcome, count, say, usage};
use std::path::PathBuf;
use surfel::generate::{self, GeneratedShape, ShapeSpec};

/// Write a generated model as binary PLY.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surfel generate sphere --triangles 1000000 -o sphere.ply\n  surfel generate torus --grid 2000x1000 -o torus.ply\n  surfel generate statue --triangles 64000000 -o statue.ply\n\nThe file is streamed: any size needs little memory."
)]
pub(crate) struct GenerateArgs {
    /// square, sphere, torus or statue
    shape: GeneratedShape,
    /// Number of triangles wanted; the nearest grid is taken
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1_000_000,
        conflicts_with = "grid"
    )]
    triangles: u64,
    /// Cells of the grid instead, such as 2000x1000 (statue: cells along a cube edge, such as 408)
    #[arg(long, value_name = "AxB")]
    grid: Option<String>,
    /// PLY file to write; - for standard output
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

pub(crate) fn run(args: GenerateArgs, quiet: bool) -> Outcome {
    let spec = match &args.grid {
        None => ShapeSpec::with_triangles(args.shape, args.triangles)?,
        Some(text) => {
            let (a, b) = text.split_once('x').unwrap_or((text, text));
            let cells = |t: &str| {
                t.parse::<u32>().map_err(|_| {
                    usage(format!(
                        "--grid {text:?}: expected two numbers of cells such as 2000x1000"
                    ))
                })
            };
            ShapeSpec::with_grid(args.shape, cells(a)?, cells(b)?)?
        }
    };
    super::require_folder(&args.output)?;
    let bar = JobBar::new(quiet);
    if args.output == std::path::Path::new("-") {
        let mut out = std::io::BufWriter::with_capacity(1 << 20, std::io::stdout().lock());
        let written = generate::write_ply(&spec, &mut out, &bar)
            .and_then(|()| Ok(std::io::Write::flush(&mut out)?));
        match written {
            // A reader that went away is no failure.
            Err(generate::GenerateError::Stream(e))
                if e.kind() == std::io::ErrorKind::BrokenPipe =>
            {
                // What is left in the buffer has nowhere to go.
                let _ = out.into_parts();
                return Ok(());
            }
            other => other?,
        }
    } else {
        generate::write_ply_file(&spec, &args.output, &bar)?;
    }
    drop(bar);
    let (vertices, triangles) = spec.counts();
    say(&format!(
        "{}: {} vertices, {} triangles",
        args.output.display(),
        count(vertices),
        count(triangles)
    ));
    Ok(())
}
