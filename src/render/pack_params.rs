//! Parameters of packing splats, from the settings of a frame.

use crate::pack;
use crate::pack::ColorBy;
use crate::render::model_facts::DrawnFacts;
use crate::render::{Method, Settings, SplatKind};

/// No splat is larger than this, pixels: infinite where splats have sizes of their own.
pub(crate) fn largest_splat_px(facts: &DrawnFacts, settings: &Settings) -> f32 {
    let have_own = settings.method == Method::Splats || settings.holds_cut();
    if have_own || (settings.has_cut() && !facts.kind.is_surface()) {
        f32::INFINITY
    } else {
        settings.threshold_px.max(1.0)
    }
}

/// Parameters of packing splats, from the settings.
pub fn splat_plan(settings: &Settings, max_point_px: f32) -> pack::splats::SplatPlan {
    pack::splats::SplatPlan {
        footprint: settings.footprint(),
        threshold_px: settings.threshold_px.max(1.0),
        size: settings.size,
        // Triangles beside splats from vertices stay triangles.
        draws_large_leaves: settings.method == Method::Splats && settings.has_cut(),
        low_pass_px: settings.low_pass_px(),
        by_level: settings.color_by == ColorBy::Level,
        cut_view: settings.cut_view,
        max_point_px,
    }
}

/// Parameters of packing fuzzy splats for compute, besides [`splat_plan`].
pub fn fuzzy_look(settings: &Settings, facts: &DrawnFacts) -> pack::fuzzy::FuzzyLook {
    pack::fuzzy::FuzzyLook {
        is_gauss: settings.splat == SplatKind::Gauss,
        depth_offset: settings.depth_offset(),
        two_sided: settings.two_sided,
        cull_back: settings.draws_fronts_only(facts.is_closed),
        use_colors: settings.use_colors,
        color_by: settings.color_by,
        light: settings.light.in_model(facts.origin),
    }
}

/// Parameters of packing filtered splats; `depth_range` is that of
/// [`falsecolor::depth_range`](pack::falsecolor::depth_range).
pub fn filtered_shade(
    settings: &Settings,
    facts: &DrawnFacts,
    depth_range: [f32; 2],
    max_size_px: f32,
) -> pack::filtered::FilteredShade {
    let cull_back = settings.draws_fronts_only(facts.is_closed) && facts.kind.is_surface();
    pack::filtered::FilteredShade {
        side_px: settings.threshold_px.max(1.0),
        max_size_px,
        splats_only: settings.method == Method::Splats,
        cut_view: settings.cut_view,
        // Both sides of a part are near the front at its rim: a smaller offset keeps the far one out.
        depth_offset: settings
            .depth_offset
            .unwrap_or(if cull_back { 3.0 } else { 2.0 }),
        cull_back,
        use_colors: settings.use_colors,
        color_by: settings.color_by,
        depth_range,
        light: settings.light.in_model(facts.origin),
    }
}
