//! Frames that are counted before they are drawn.

use crate::render::cpu::renderer::{CpuRenderer, elapsed_ms};
use crate::render::frame_estimate::{FrameEstimate, counts_of_cuts};
use crate::render::frame_plan::{CutPlace, FramePlan};
use crate::render::model_facts::DrawnParts;
use crate::render::screen_bounds;
use crate::render::technique::Technique;
use std::time::Instant;

impl CpuRenderer {
    /// Counts what a planned frame would draw, without drawing it: its cut is chosen, and used by the next frame
    /// if that has the same view and settings. The time is booked as that frame's. Nothing without a cut.
    pub(crate) fn predict(&mut self, drawn: DrawnParts<'_>, plan: &FramePlan) -> FrameEstimate {
        if plan.cut_place == CutPlace::Nowhere {
            return FrameEstimate::default();
        }
        let start = Instant::now();
        let is_new = self.choose_cut(drawn, plan);
        let counts = counts_of_cuts(plan, drawn, &self.cuts);
        let ahead = self.ahead.get_or_insert_default();
        ahead.ms += elapsed_ms(start);
        ahead.is_new |= is_new;
        FrameEstimate {
            counts,
            pixels: screen_bounds::pixels(plan.context.rect_px),
            is_blended: plan.technique == Technique::Filtered,
            by_compute: true,
            is_free: false,
            largest_by_compute_px: f32::INFINITY,
        }
    }

    /// Forgets the cut that was chosen for a frame that is not drawn; to be called when the model changes.
    pub(crate) fn forget_prediction(&mut self) {
        self.ahead = None;
    }
}
