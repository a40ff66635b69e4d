//! The model of a command: arguments become options of [`surfel::open`].

use super::Failure;
use super::progress::Bar;
use clap::Args;
use std::path::PathBuf;
use surfel::input;
use surfel::progress::Progress;
use surfel::{OpenOptions, OpenedModel};

/// The model of a command.
#[derive(Debug, Clone, Args)]
pub(crate) struct Source {
    /// Model file, - for standard input, generate:SHAPE[:TRIANGLES], or scene:NAME
    #[arg(value_name = "MODEL")]
    pub(crate) model: PathBuf,
    /// Merge vertices that are equal in position, normal and color
    #[arg(long)]
    pub(crate) weld: bool,
}

/// The options of opening that the arguments ask for.
pub(crate) fn open_options(weld: bool) -> OpenOptions {
    OpenOptions {
        input: input::Options {
            weld,
            ..input::Options::default()
        },
        ..OpenOptions::default()
    }
}

impl Source {
    /// Opens the model, with a progress bar from about a second on.
    pub(crate) fn open(&self, quiet: bool) -> Result<OpenedModel, Failure> {
        self.open_with(&Bar::new(quiet))
    }

    /// Opens the model, and says what was repaired or left out.
    pub(crate) fn open_with(&self, progress: &dyn Progress) -> Result<OpenedModel, Failure> {
        let opened = surfel::open(&self.model, &open_options(self.weld), progress)?;
        for warning in &opened.warnings {
            super::say(&format!("surfel: {}: warning: {warning}", opened.name));
        }
        Ok(opened)
    }
}
