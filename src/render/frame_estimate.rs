//! How much a frame would draw, counted from its cut before it is drawn.

use crate::cut::{Cut, StripRun};
use crate::math::camera::View;
use crate::pack::filtered::drawn_counts;
use crate::render::pack_params::filtered_shade;
use crate::render::stats::FrameCounts;
use crate::render::technique::Technique;
use crate::render::{Method, Settings};
use crate::tree::Model;

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

/// Counts what a frame of these settings draws of a cut.
pub(crate) fn counts_of_cut(
    settings: &Settings,
    model: &Model,
    view: &View,
    cut: &Cut,
) -> FrameCounts {
    let (splats, large) = match Technique::of(settings) {
        Technique::Filtered => {
            let shade = filtered_shade(settings, model, f32::INFINITY);
            let [splats, triangles] = drawn_counts(model, view, &shade, cut);
            (splats as u64, triangles as u64)
        }
        _ => {
            let strips = StripRun::splats_of(&cut.strips);
            let splats = (cut.nodes.len() + cut.leaves.len() + strips) as u64;
            (splats, cut.triangles.len() as u64)
        }
    };
    // Splats alone: what would be a triangle is one as well.
    let is_whole = settings.method == Method::Splats;
    FrameCounts {
        nodes_visited: cut.stats.visited,
        splats: if is_whole { splats + large } else { splats },
        triangles: if is_whole { 0 } else { large },
        ..FrameCounts::default()
    }
}
