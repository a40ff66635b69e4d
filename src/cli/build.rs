//! `surfel build`

use super::progress::JobBar;
use super::source::{ModelArgs, parse_bytes};
use super::{CommandFailure, Outcome, bytes, count, say};
use std::path::{Path, PathBuf};
use std::time::Instant;
use surfel::mesh::stream::JoinedStream;
use surfel::open::OpenedModel;
use surfel::open::memory_need::MemoryNeed;
use surfel::open::{ModelSource, external_options, open_stream};
use surfel::pages::cache::usual_budget;
use surfel::pages::external::{self, ExternalError, ExternalOptions};
use surfel::pages::write::{self, PagedOptions};
use surfel::tree;

/// Build the tree of a model and write it to a file that opens at once.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surfel build scan.ply -o scan.surfel && surfel render scan.surfel -o scan.png\n  surfel build tiles/a.laz tiles/b.laz --memory 1GiB -o town.surfel\n  surfel build part.ply --exact                               keeps every bit of positions"
)]
pub(crate) struct BuildArgs {
    #[command(flatten)]
    source: ModelArgs,
    /// Further models, built into the same file
    #[arg(value_name = "MORE", index = 2)]
    more: Vec<PathBuf>,
    /// Tree file to write; the model's name with .surfel if not given
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Keep positions and normals to the last bit, in five times the bytes and more, in a file that is read whole
    #[arg(long, conflicts_with_all = ["memory", "paged", "page_leaves"])]
    exact: bool,
    /// Paged kind, which is written unless --exact is given; earlier versions asked for it
    #[arg(long, hide = true)]
    paged: bool,
    /// Keep what --error needs beside the tree, so that no start computes it: 3 to 8 bytes a triangle, with --exact 16, with
    /// colors 21, and some seconds a million triangles
    #[arg(long, conflicts_with = "memory")]
    patches: bool,
    /// Leaves of a page at most, 16 to 16384: small pages bring less that is not needed, large ones take fewer bytes
    #[arg(long, value_name = "N", default_value_t = PagedOptions::default().page_leaves, value_parser = parse_page_leaves)]
    page_leaves: usize,
    /// Read and build the model piece by piece with about this much memory, such as 1GiB [default: half of
    /// what is free, at most 4GiB, where the model as a whole takes more memory than there is, or there are several]
    #[arg(long, value_name = "SIZE", value_parser = parse_memory)]
    memory: Option<u64>,
}

/// Least memory that a model is built with.
const LEAST_MEMORY: u64 = 256 << 20;

fn parse_memory(text: &str) -> Result<u64, String> {
    match parse_bytes(text)? {
        bytes if bytes >= LEAST_MEMORY => Ok(bytes),
        _ => Err("at least 256MiB are needed".to_owned()),
    }
}

fn parse_page_leaves(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(count) if (16..=16_384).contains(&count) => Ok(count),
        _ => Err("expected a number from 16 to 16384".to_owned()),
    }
}

impl BuildArgs {
    fn pages(&self) -> PagedOptions {
        PagedOptions {
            page_leaves: self.page_leaves,
            ..PagedOptions::default()
        }
    }
}

/// Memory to build with piece by piece; `None` where the model is built as a whole.
fn memory_of_pieces(args: &BuildArgs, need: Option<&MemoryNeed>, quiet: bool) -> Option<u64> {
    let usual = || usual_budget().max(LEAST_MEMORY);
    if args.memory.is_some() {
        return args.memory;
    }
    if !args.more.is_empty() {
        return Some(usual());
    }
    if args.exact {
        return None;
    }
    let need = need.filter(|need| need.is_streamed && !args.patches)?;
    if !quiet {
        say(&format!(
            "surfel: {}: about {} of memory are needed for {}, and {} are free: built piece by piece, as --memory does",
            args.source.model.display(),
            bytes(need.needed),
            need.what,
            bytes(need.free)
        ));
    }
    Some(usual())
}

/// Builds the model piece by piece; `false` where it must be read whole.
fn build_in_pieces(
    args: &BuildArgs,
    memory: u64,
    output: &Path,
    quiet: bool,
) -> Result<bool, CommandFailure> {
    let bar = JobBar::new(quiet);
    let options = args.source.options()?;
    if args.exact {
        let cause = "--exact needs the whole model in memory: build one model with it";
        return Err(super::usage(cause));
    }
    if args.patches {
        let cause = "--patches needs the whole model in memory: build one model with it";
        return Err(super::usage(cause));
    }
    if args.source.weld {
        let cause = "--weld needs the whole model in memory, and this one is built piece by piece: leave --weld out";
        return Err(super::usage(cause));
    }
    if !options.keep.is_empty() {
        let cause = "--keep and --clip-box need the whole model in memory, and this one is built piece by piece: leave them out";
        return Err(super::usage(cause));
    }
    let name = args.source.model.display();
    let mut streams = Vec::new();
    for input in std::iter::once(&args.source.model).chain(&args.more) {
        let (source, name) = (ModelSource::parse(input)?, input.display());
        let Some(opened) = open_stream(&source, &options, &bar)? else {
            let cause =
                "cannot be read piece by piece (binary PLY, LAS, LAZ and generated models can)";
            if args.more.is_empty() {
                say(&format!("surfel: {name}: warning: it {cause}; read whole"));
                return Ok(false);
            }
            return Err(super::usage(format!("{name} {cause}; build it by itself")));
        };
        for warning in &opened.warnings {
            say(&format!("surfel: {name}: warning: {warning}"));
        }
        streams.push(opened.stream);
    }
    let stream = match streams.len() {
        1 => streams.remove(0),
        _ => Box::new(JoinedStream::new(streams).map_err(|e| super::usage(e.to_string()))?),
    };
    let facts = stream.facts();
    let forecast = external::forecast(&facts);
    if !quiet {
        say(&format!(
            "{name}: {} {}; about {} for the file and {} beside it while it is built",
            count(if facts.is_cloud() {
                facts.vertices
            } else {
                facts.faces
            }),
            if facts.is_cloud() { "points" } else { "faces" },
            bytes(forecast.file_bytes),
            bytes(forecast.temporary_bytes),
        ));
    }
    let start = Instant::now();
    let options = ExternalOptions {
        pages: args.pages(),
        ..external_options(&options, memory)
    };
    let built = external::build(stream.as_ref(), &options, output, &bar);
    drop(bar);
    let report = built.map_err(|error| match error {
        ExternalError::Tree(tree::Error::Cancelled) => {
            surfel::Error::from(tree::Error::Cancelled).into()
        }
        ExternalError::Tree(error @ tree::Error::Io { .. }) => {
            let context = format!("cannot write {}", output.display());
            CommandFailure::Run(anyhow::Error::new(error).context(context))
        }
        other => super::usage(format!("{name}: {other}")),
    })?;
    for remark in stream.remarks() {
        say(&format!("surfel: {name}: warning: {remark}"));
    }
    if report.dropped > 0 {
        say(&format!(
            "surfel: {name}: warning: {} points or triangles left out, whose coordinates are not finite",
            count(report.dropped)
        ));
    }
    let seconds = start.elapsed().as_secs_f64();
    let size = std::fs::metadata(output).map(|m| m.len()).unwrap_or(0);
    say(&format!(
        "{name}: {} leaves, {} nodes, {} chunks; built in {seconds:.1} s ({:.2} million leaves a second), {} temporary; {} to {}",
        count(report.leaves),
        count(report.nodes),
        count(report.chunks),
        report.leaves as f64 / seconds.max(1e-9) * 1e-6,
        bytes(report.temporary_bytes),
        bytes(size),
        output.display()
    ));
    Ok(true)
}

/// Refuses error patches of what has none.
fn check_patches(ready: &OpenedModel) -> Outcome {
    if ready.model.kind().is_surface() {
        return Ok(());
    }
    let cause = "only surfaces of triangles have error patches; leave --patches out";
    Err(super::usage(format!("{}: {cause}", ready.name)))
}

/// Writes a model, with the records of error patches where they are asked for or were read.
fn write_model(
    ready: &mut OpenedModel,
    pages: Option<&PagedOptions>,
    with_patches: bool,
    output: &Path,
    bar: &JobBar,
) -> Result<(), tree::Error> {
    let model = &mut ready.model;
    match (pages, with_patches || model.patches.is_some()) {
        (None, false) => tree::file::write(model, output),
        (None, true) => {
            surfel::patches::add_records(model, bar)?;
            tree::file::write(model, output)
        }
        (Some(pages), false) => write::write(model, pages, output),
        (Some(pages), true) => write::write_with_patches(model, pages, output, bar),
    }
}

pub(crate) fn run(args: BuildArgs, quiet: bool) -> Outcome {
    let output = match &args.output {
        Some(path) => path.clone(),
        None => match ModelSource::parse(&args.source.model)? {
            ModelSource::File(path) => path.with_extension("surfel"),
            _ => {
                return Err(super::usage(
                    "-o FILE is needed for a model without a file name",
                ));
            }
        },
    };
    let mut inputs = std::iter::once(&args.source.model).chain(&args.more);
    if inputs.any(|input| *input == output) {
        return Err(super::usage(format!(
            "{} would be written over itself",
            output.display()
        )));
    }
    super::require_folder(&output)?;
    let source = ModelSource::parse(&args.source.model)?;
    let need = MemoryNeed::of(&source, &args.source.options()?);
    let memory = memory_of_pieces(&args, need.as_ref(), quiet);
    if let Some(memory) = memory
        && build_in_pieces(&args, memory, &output, quiet)?
    {
        return Ok(());
    }
    let pages = args.pages();
    let mut ready = args.source.open(quiet)?;
    if args.patches {
        check_patches(&ready)?;
    }
    if let Some(textures) = &ready.model.textures {
        say(&format!(
            "surfel: {}: warning: tree files keep no images: of {} each triangle keeps its mean color; near views of the model's own file show more",
            ready.name,
            count(textures.images.len() as u64)
        ));
    }
    let start = Instant::now();
    let bar = JobBar::new(quiet);
    let written = write_model(
        &mut ready,
        (!args.exact).then_some(&pages),
        args.patches,
        &output,
        &bar,
    );
    drop(bar);
    // The model was good; only the file can fail here, and that is no bad input.
    written.map_err(|error| match error {
        tree::Error::Cancelled => surfel::Error::from(error).into(),
        _ => {
            let context = format!("cannot write {}", output.display());
            CommandFailure::Run(anyhow::Error::new(error).context(context))
        }
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failing test panics")]

    use super::*;
    use clap::Parser;

    #[derive(clap::Parser)]
    struct ParsedBuild {
        #[command(flatten)]
        args: BuildArgs,
    }

    /// Memory of pieces by these arguments, of a model that needs more than there is (`Some`: whether it is read in pieces).
    fn memory(arguments: &[&str], is_streamed: Option<bool>) -> Option<u64> {
        let all = std::iter::once(&"build").chain(arguments);
        let parsed = ParsedBuild::try_parse_from(all).unwrap();
        let need = is_streamed.map(|is_streamed| MemoryNeed {
            what: "its 9 points".to_owned(),
            needed: 990,
            free: 100,
            is_streamed,
        });
        memory_of_pieces(&parsed.args, need.as_ref(), true)
    }

    #[test]
    fn pieces_are_built_where_they_are_asked_for_or_needed() {
        assert_eq!(memory(&["a.ply"], None), None);
        assert_eq!(memory(&["a.ply", "--memory", "1GiB"], None), Some(1 << 30));
        assert!(memory(&["a.las", "b.las"], None) >= Some(LEAST_MEMORY));
        assert!(memory(&["a.ply"], Some(true)) >= Some(LEAST_MEMORY));
        assert_eq!(memory(&["a.obj"], Some(false)), None);
        assert_eq!(memory(&["a.ply", "--exact"], Some(true)), None);
        // Records of patches take the whole model, which its reader refuses.
        assert_eq!(memory(&["a.ply", "--patches"], Some(true)), None);
    }
}
