//! The options that put marks over pictures.

use super::{Outcome, usage};
use clap::Args as ClapArgs;
use glam::Vec3;
use surfel::image::{MarkChoice, PictureMarks};
use surfel::input::{ReadWarning, legend_of};
use surfel::math::camera::View;

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
    /// Show what colors mean, with --color-by height or an attribute of the points; the window always does
    #[arg(long)]
    legend: bool,
}

impl MarkArgs {
    pub(crate) fn choice(&self) -> MarkChoice {
        MarkChoice {
            scale_bar: self.scale_bar,
            axes: self.axes,
        }
    }

    /// Refuses a legend of colors that stand for nothing.
    pub(crate) fn check(&self, has_legend: bool) -> Outcome {
        match self.legend && !has_legend {
            true => Err(usage(
                "--legend goes with --color-by height or an attribute of the points",
            )),
            false => Ok(()),
        }
    }

    /// Marks of a view, the bar as long as at `center`, for a model that was read with these remarks.
    pub(crate) fn of_view(
        &self,
        view: &View,
        center: Vec3,
        unit: Option<&str>,
        remarks: &[ReadWarning],
    ) -> PictureMarks {
        let mut marks = PictureMarks::new(view, self.choice(), center, unit);
        if let Some(legend) = legend_of(remarks).filter(|_| self.legend) {
            marks.add_legend(legend, 0.0);
        }
        marks
    }
}
