//! `surfel MODEL`

use super::Outcome;

/// .
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Model to look at
    model: Option<std::path::PathBuf>,
}

pub(crate) fn run(args: Args, _quiet: bool) -> Outcome {
    let _ = args.model;
    Err(super::usage("the window is not part of this build"))
}
