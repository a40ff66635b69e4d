//! Estimate of what a frame would draw, counted from its cut before it is drawn.

use crate::cut::StripRun;
use crate::pack::filtered::drawn_counts;
use crate::render::Method;
use crate::render::frame_plan::FramePlan;
use crate::render::model_facts::DrawnParts;
use crate::render::pack_params::filtered_shade;
use crate::render::part_cuts::PartCuts;
use crate::render::stats::FrameCounts;
use crate::render::technique::Technique;

/// The work of a frame that is not drawn yet.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FrameEstimate {
    /// Nodes, splats and triangles.
    pub counts: FrameCounts,
    /// Pixels of the box around the model in the picture.
    pub pixels: u64,
    /// Splats are blended.
    pub is_blended: bool,
    /// Small splats are drawn by compute, or by the processor.
    pub by_compute: bool,
    /// Either rasterizer can draw them, and nobody insists on one.
    pub is_free: bool,
    /// The largest threshold with which compute can, pixels.
    pub largest_by_compute_px: f32,
}

/// Counts what a planned frame draws of the cuts of its parts.
pub(crate) fn counts_of_cuts(
    plan: &FramePlan,
    parts: DrawnParts<'_>,
    cuts: &PartCuts,
) -> FrameCounts {
    let settings = &plan.settings;
    let (mut splats, mut large) = (0, 0);
    let shade = filtered_shade(
        settings,
        &plan.facts,
        plan.context.depth_range,
        f32::INFINITY,
    );
    for (part, cut) in parts.iter().zip(cuts.iter()) {
        match plan.technique {
            Technique::Filtered => {
                let drawn = drawn_counts(part.model, &plan.view, &shade, cut);
                splats += drawn[0] as u64;
                large += drawn[1] as u64;
            }
            _ => {
                let strips = StripRun::splats_of(&cut.strips);
                splats += (cut.nodes.len() + cut.leaves.len() + strips) as u64;
                large += cut.triangles.len() as u64;
            }
        }
    }
    splats += cuts.polygon_count() as u64;
    // Splats alone: what would be a triangle is one as well.
    let is_whole = settings.method == Method::Splats;
    FrameCounts {
        nodes_visited: cuts.stats().visited,
        splats: if is_whole { splats + large } else { splats },
        triangles: if is_whole { 0 } else { large },
        ..FrameCounts::default()
    }
}
