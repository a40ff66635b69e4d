//! The cut of a frame: a list of parts, each the cut of one model.

use crate::cut::{Cut, CutSelector, CutStats};
use crate::pack::splats;
use crate::render::cut_key::CutKey;
use crate::render::model_facts::{DrawnParts, FactedModel};

/// Cuts of the parts of a frame, in their order. Memory is kept from frame to frame.
#[derive(Debug, Default)]
pub struct PartCuts {
    cuts: Vec<Cut>,
    /// The first so many are those of the present frame.
    count: usize,
}

impl PartCuts {
    /// Chooses the cut of each part by a key of its own, or takes that which was chosen beside the frame. What is hidden is
    /// left out within each part alone.
    pub(crate) fn select(
        &mut self,
        selector: &mut CutSelector,
        parts: DrawnParts<'_>,
        key_of: impl Fn(FactedModel<'_>) -> CutKey,
    ) {
        self.count = parts.count();
        if self.cuts.len() < self.count {
            self.cuts.resize_with(self.count, Cut::default);
        }
        for (part, cut) in parts.iter().zip(&mut self.cuts) {
            if let Some(chosen) = part.cut {
                cut.clone_from(chosen);
                continue;
            }
            let undrawn = || part.facts.undrawn(part.model);
            key_of(part).select(selector, part.model, undrawn, cut);
        }
    }

    /// The cuts, in the order of the parts.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Cut> {
        self.cuts[..self.count].iter()
    }

    /// The same, to be changed.
    pub(crate) fn iter_mut(&mut self) -> impl ExactSizeIterator<Item = &mut Cut> {
        self.cuts[..self.count].iter_mut()
    }

    /// Sums of the counts of all cuts.
    pub fn stats(&self) -> CutStats {
        let mut sum = CutStats::default();
        self.iter().for_each(|cut| sum.add(&cut.stats));
        sum
    }

    /// Number of leaves that are drawn as triangles.
    pub fn triangle_count(&self) -> usize {
        self.iter().map(|cut| cut.triangles.len()).sum()
    }

    /// Number of records that the splats need room for.
    pub fn splat_count(&self, plan: &splats::Plan) -> usize {
        self.iter().map(|cut| splats::count(cut, plan)).sum()
    }
}
