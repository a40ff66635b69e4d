//! `surfel build`

use super::source::Source;
use super::{Failure, Outcome, bytes, count, say};
use std::path::PathBuf;
use std::time::Instant;
use surfel::open::ModelSource;
use surfel::pages::{self, write::PagedOptions};
use surfel::tree;

/// Build the tree of a model and write it to a file that opens at once.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  surfel build scan.ply -o scan.surfel && surfel render scan.surfel -o scan.png"
)]
pub(crate) struct Args {
    #[command(flatten)]
    source: Source,
    /// Tree file to write; the model's name with .surfel if not given
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write the paged kind: a fifth of the bytes, positions and normals rounded
    #[arg(long)]
    paged: bool,
}

pub(crate) fn run(args: Args, quiet: bool) -> Outcome {
    let output = match args.output {
        Some(path) => path,
        None => match ModelSource::parse(&args.source.model)? {
            ModelSource::File(path) => path.with_extension("surfel"),
            _ => {
                return Err(super::usage(
                    "-o FILE is needed for a model without a file name",
                ));
            }
        },
    };
    if output == args.source.model {
        return Err(super::usage(format!(
            "{} would be written over itself",
            output.display()
        )));
    }
    super::require_folder(&output)?;
    let ready = args.source.open(quiet)?;
    let start = Instant::now();
    // The model was good; only the file can fail here, and that is no bad input.
    let written = if args.paged {
        pages::write::write(&ready.model, &PagedOptions::default(), &output)
    } else {
        tree::file::write(&ready.model, &output)
    };
    written.map_err(|e| {
        Failure::Run(anyhow::Error::new(e).context(format!("cannot write {}", output.display())))
    })?;
    let size = std::fs::metadata(&output).map(|m| m.len()).unwrap_or(0);
    say(&format!(
        "{}: {} triangles, {} nodes; read {:.0} ms, built {:.0} ms, written {:.0} ms; {} to {}",
        ready.name,
        count(ready.model.triangles.len() as u64),
        count((ready.model.tree.nodes.len() + ready.model.tree.leaves.len()) as u64),
        ready.load_ms,
        ready.build_ms,
        start.elapsed().as_secs_f64() * 1e3,
        bytes(size),
        output.display()
    ));
    Ok(())
}
