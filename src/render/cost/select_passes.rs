//! Which passes draw a planned frame, once its cut is there.

use crate::render::Path;
use crate::render::compute_limits::LARGEST_VISIBLE_PX;
use crate::render::cost::choose::{ComputeShare, FrameWorkload, largest_point_px};
use crate::render::cost::model::DrawCosts;
use crate::render::frame_plan::FramePlan;
use crate::render::technique::Technique;

/// What draws the primitives of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PassSelection {
    /// Triangles that are small on screen have a list of their own, for compute.
    pub(crate) takes_triangles: bool,
    /// Compute draws opaque and visibility splats.
    pub(crate) has_splats_by_compute: bool,
    /// What compute draws of blended ones; none: it is known once they are packed.
    pub(crate) share: Option<ComputeShare>,
}

impl PassSelection {
    /// The rasterizer draws everything.
    const RASTERIZER: Self = Self {
        takes_triangles: false,
        has_splats_by_compute: false,
        share: Some(ComputeShare::Nothing),
    };

    /// Selects the passes of a planned frame, as far as they are known before its splats are packed.
    pub(crate) fn of(plan: &FramePlan, workload: &FrameWorkload<'_>) -> Self {
        let binds_vertices = plan.primitives.binds_vertices;
        if !plan.may_use_compute {
            return Self::RASTERIZER;
        }
        match plan.technique {
            Technique::Nothing | Technique::Polygons => Self::RASTERIZER,
            Technique::Opaque => {
                let paths = workload.opaque();
                let takes_triangles = binds_vertices && paths.triangles == Path::Compute;
                Self {
                    takes_triangles,
                    has_splats_by_compute: takes_triangles || paths.splats == Path::Compute,
                    ..Self::RASTERIZER
                }
            }
            Technique::Visibility => Self {
                has_splats_by_compute: workload.visible() == Path::Compute,
                ..Self::RASTERIZER
            },
            Technique::Fuzzy | Technique::Filtered => {
                let has_large = plan.primitives.has_large_splats;
                let all = match binds_vertices && workload.triangles > 0 {
                    true => workload.all_blended(has_large),
                    false => ComputeShare::Nothing,
                };
                let is_filtered = plan.technique == Technique::Filtered;
                let share = match all {
                    // Filtered splats are known once they are packed.
                    ComputeShare::Nothing if is_filtered => None,
                    ComputeShare::Nothing => Some(workload.blended(workload.triangles, has_large)),
                    all => Some(all),
                };
                Self {
                    takes_triangles: all != ComputeShare::Nothing,
                    share,
                    ..Self::RASTERIZER
                }
            }
        }
    }

    /// Tells whether the rasterizer may draw all splats.
    pub(crate) fn is_rastered(&self) -> bool {
        let nothing = ComputeShare::Nothing;
        !self.has_splats_by_compute && self.share.is_none_or(|share| share == nothing)
    }

    /// Tells whether compute draws blended splats, as far as is known.
    pub(crate) fn has_blended_by_compute(&self) -> bool {
        self.share
            .is_some_and(|share| share != ComputeShare::Nothing)
    }
}

/// The largest point of a planned frame, pixels, once it is known what draws it: where the rasterizer does, what is cheaper as
/// a quad is one. Of visibility splats it draws quads alone beside compute.
pub(crate) fn max_point_px(
    plan: &FramePlan,
    selection: &PassSelection,
    costs: Option<&DrawCosts>,
) -> f32 {
    match costs {
        _ if selection.has_splats_by_compute && plan.technique == Technique::Visibility => {
            LARGEST_VISIBLE_PX.min(plan.max_point_px)
        }
        Some(costs) if selection.is_rastered() => {
            largest_point_px(costs, &plan.settings, plan.max_point_px)
        }
        _ => plan.max_point_px,
    }
}
