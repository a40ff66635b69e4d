//! `surfel join`

use super::progress::JobBar;
use super::{CommandFailure, Outcome, bytes, count, say, usage};
use anyhow::Context;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use surfel::open::ModelSource;
use surfel::pages::file::{PagedFile, open_address};
use surfel::pages::forest::{self, ForestError, ForestMember};
use surfel::pages::source::{ByteSource, FileSource};
use surfel::tree;

/// Join paged trees into one model that refers to their files.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  surfel join tiles/*.surfel -o town.surfel && surfel town.surfel
  surfel join https://example.org/a.surfel https://example.org/b.surfel -o both.surfel

Tiles can be built at once, on one machine or many, and joined when all are there (docs/METHODS.md):
  for tile in tiles/*.laz; do echo $tile; done | xargs -P 4 -I F surfel build F --memory 1GiB

Nothing is copied: the files must stay where they are, seen from the joined one. Made anew they are joined anew.")]
pub(crate) struct JoinArgs {
    /// Paged trees (surfel build --paged or --memory), all of triangles or all of points; files or addresses
    #[arg(value_name = "TREE", required = true)]
    trees: Vec<PathBuf>,
    /// File to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Opens a tree, and names it as the file in `folder` names it.
fn open(tree: &Path, folder: &Path) -> anyhow::Result<ForestMember> {
    let (source, path): (Arc<dyn ByteSource>, String) = match ModelSource::parse(tree) {
        Ok(ModelSource::Address(url)) => (open_address(&url)?, url),
        Ok(ModelSource::File(path)) => {
            let source = FileSource::open(&path)?;
            let name = forest::path_from(folder, &path)?;
            (Arc::new(source), name)
        }
        _ => anyhow::bail!("name a file, or the address of one"),
    };
    let file = PagedFile::open(source)?;
    Ok(ForestMember { path, file })
}

pub(crate) fn run(args: &JoinArgs, quiet: bool) -> Outcome {
    super::require_folder(&args.output)?;
    let folder = match args.output.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut members: Vec<ForestMember> = Vec::new();
    for tree in &args.trees {
        let name = tree.display();
        let opened = open(tree, folder);
        let own = opened
            .with_context(|| {
                format!("{name} cannot be joined; trees to be joined are paged (surfel build)")
            })
            .map_err(CommandFailure::Input)?;
        if let Some(other) = members.iter().find(|other| other.path == own.path) {
            return Err(usage(format!("{} is named twice", other.path)));
        }
        let is_same = |path: &Path| path.canonicalize().ok();
        let output = is_same(&args.output);
        if output.is_some() && output == is_same(tree) {
            return Err(usage(format!("{name} would be written over itself")));
        }
        members.push(own);
    }
    let bar = JobBar::new(quiet);
    let joined = forest::write(&members, &args.output, &bar);
    drop(bar);
    let report = joined.map_err(|error| match error {
        ForestError::Tree(tree::Error::Cancelled) => {
            surfel::Error::from(tree::Error::Cancelled).into()
        }
        ForestError::Tree(error @ tree::Error::Io { .. }) => {
            let context = format!("cannot write {}", args.output.display());
            CommandFailure::Run(anyhow::Error::new(error).context(context))
        }
        other => CommandFailure::Input(other.into()),
    })?;
    if !quiet {
        say(&format!(
            "{}: {} files with {} leaves, in {}",
            args.output.display(),
            count(report.files),
            count(report.leaves),
            bytes(report.bytes)
        ));
    }
    Ok(())
}
