//! Speed against accuracy: every choice of method, splat, path and threshold is a point with a time and an error.
//!
//! [`run::block`] measures the choices of a [`ChartPlan`] from one view: errors against a supersampled reference, times in
//! turn with each other. Each gives a [`ChartRow`]; [`summary::summarize`] makes points of the rows of all views and finds
//! the [`frontier()`]; [`plot::svg`] draws it and [`page::html`] shows it with its pictures. [`agree::agreement`] says
//! whether two charts say the same.
//! `docs/MEASURING.md` says what every column means.

pub mod agree;
pub mod auto;
pub mod choice;
pub mod errors;
mod frontier;
pub mod page;
pub mod plot;
pub mod published;
mod row;
pub mod run;
pub mod summary;

pub use choice::{AvailablePaths, DrawConfiguration, RecordSource};
pub use frontier::frontier;
pub use row::{ChartRow, read_rows, write_rows};
pub use run::ChartPlan;

use std::path::PathBuf;

/// Why a chart could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChartError {
    /// The device could not do what was asked.
    #[error(transparent)]
    Gpu(#[from] crate::gpu::Error),
    /// A picture could not be compared or written.
    #[error(transparent)]
    Image(#[from] crate::image::Error),
    /// The model has no camera that shows it.
    #[error(transparent)]
    Camera(#[from] crate::math::camera::CameraError),
    /// A model could not be put into pages.
    #[error(transparent)]
    Tree(#[from] crate::tree::Error),
    /// A file of rows is not one, or is damaged.
    #[error("{path}, line {line}: {cause}")]
    Rows {
        /// The file.
        path: PathBuf,
        /// Line of the file, from 1; 0 when the file could not be read at all.
        line: u64,
        /// The cause.
        cause: String,
    },
    /// The chart could not be turned into pixels.
    #[error("cannot draw the chart: {0}")]
    Draw(String),
    /// The user asked for the end.
    #[error("cancelled")]
    Cancelled,
}
