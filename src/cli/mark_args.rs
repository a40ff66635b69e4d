//! The options that put marks over pictures.

use clap::Args as ClapArgs;
use surfel::image::MarkChoice;

/// Marks over pictures.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct MarkArgs {
    /// Show a bar of a round length (1, 2 or 5 times a power of ten) in units of the file, as long as that is at the middle of the
    /// model; in metres where the format says so (glTF, E57)
    #[arg(long)]
    scale_bar: bool,
    /// Show the directions of the axes x, y and z
    #[arg(long)]
    axes: bool,
}

impl MarkArgs {
    pub(crate) fn choice(&self) -> MarkChoice {
        MarkChoice {
            scale_bar: self.scale_bar,
            axes: self.axes,
        }
    }
}
