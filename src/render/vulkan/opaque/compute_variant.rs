//! What decides the pipeline by which compute draws opaque splats.

use crate::abi::constants;
use crate::pack::Footprint;
use crate::render::compute_limits::LARGEST_SQUARE_PX;
use crate::render::frame_plan::FramePlan;
use crate::render::pack_params::splat_plan;

/// What decides the pipeline of splats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ComputeVariant {
    pub(super) footprint: Footprint,
    /// Where none has a size of its own that of all, rounded up to pixels; else 0.
    pub(super) side_px: u32,
    /// Flags of the frame that a footprint in the plane of the surface asks for.
    pub(super) flags: u32,
}

impl ComputeVariant {
    /// Squares of a pixel.
    pub(crate) const SAMPLES: Self = Self {
        footprint: Footprint::Square,
        side_px: 1,
        flags: 0,
    };

    /// The splats of a planned frame: of one size, at most [`LARGEST_SQUARE_PX`], or of sizes of their own.
    pub(crate) fn of(plan: &FramePlan) -> Self {
        let footprint = plan.settings.footprint();
        let sizes = splat_plan(&plan.settings, f32::INFINITY);
        let one_size_px = sizes
            .has_one_size(plan.facts.kind)
            .then_some(sizes.threshold_px);
        Self {
            footprint,
            side_px: one_size_px.map_or(0, |px| px.clamp(1.0, LARGEST_SQUARE_PX).ceil() as u32),
            flags: match footprint {
                Footprint::Oriented => plan.constants.flags & constants::FLAG_ORTHOGRAPHIC,
                _ => 0,
            },
        }
    }
}
