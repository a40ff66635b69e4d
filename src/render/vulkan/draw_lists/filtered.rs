//! Filtered splats in draw lists, as records or as numbers.

use crate::abi::{FilteredSplat, SplatId};
use crate::math::camera::View;
use crate::pack::filtered;
use crate::pack::filtered::{FilteredShade, FirstLarge};
use crate::render::frame_plan::RecordFormat;
use crate::render::model_facts::DrawnParts;
use crate::render::part_cuts::PartCuts;

/// Moves triangles of cuts that are to be drawn as filtered splats to their leaves; where those begin in each cut. Nothing
/// where other splats are drawn.
pub(super) fn take_triangles(
    records: &RecordFormat,
    view: &View,
    parts: DrawnParts<'_>,
    cuts: &mut PartCuts,
) -> Vec<FirstLarge> {
    let RecordFormat::Filtered(shade) = records else {
        return Vec::new();
    };
    let drawn = parts.iter().zip(cuts.iter_mut());
    drawn
        .map(|(part, cut)| filtered::take_triangles(part.model, view, shade, cut))
        .collect()
}

/// Number of the splats of cuts at most.
pub(super) fn most_splats(cuts: &PartCuts, large: &[FirstLarge]) -> usize {
    let of_each = cuts.iter().zip(large);
    of_each
        .map(|(cut, large)| filtered::splat_count(cut, *large))
        .sum()
}

/// Cuts whose triangles were taken, as a view has them.
#[derive(Clone, Copy)]
pub(super) struct TakenCuts<'a> {
    pub(super) parts: DrawnParts<'a>,
    pub(super) cuts: &'a PartCuts,
    pub(super) large: &'a [FirstLarge],
    pub(super) view: &'a View,
    pub(super) shade: &'a FilteredShade,
}

impl TakenCuts<'_> {
    /// Writes records, those of one part after the other; how many they are.
    pub(super) fn write(&self, out: &mut [FilteredSplat]) -> usize {
        let mut end = 0;
        let drawn = self.parts.iter().zip(self.cuts.iter());
        for ((part, cut), &large) in drawn.zip(self.large) {
            let out = &mut out[end..];
            let found = filtered::write(part.model, cut, large, self.view, *self.shade, out);
            end += found.close_gaps(out);
        }
        end
    }

    /// Writes the numbers of one part alone; how many they are.
    pub(super) fn write_ids(&self, out: &mut [SplatId]) -> usize {
        let drawn = self.parts.single().zip(self.cuts.iter().next());
        match (drawn, self.large.first()) {
            (Some((part, cut)), Some(&large)) => {
                filtered::ids(part.model, cut, large, self.view, self.shade, out)
            }
            _ => 0,
        }
    }
}
