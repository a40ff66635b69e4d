//! What the settings mean for one frame: for the cut, the draw lists and the uniform block, and what they ask for
//! in vain.

use super::mirror::Outputs;
use super::targets::Context;
use super::{Blend, Method, Settings, Shading, SplatKind};
use crate::abi::{FrameConstants, constants};
use crate::cut;
use crate::draw::{self, ColorBy};
use crate::gpu::Error;
use crate::math::camera::{Light, View};
use crate::tree::Model;
use glam::{Mat4, Vec3, Vec4};

/// The cut settings of a frame.
pub fn cut_settings(settings: &Settings, model: &Model) -> cut::Settings {
    cut::Settings {
        threshold_px: settings.threshold_px,
        cull_back: settings.culls_back(model.is_closed) && !model.triangles.is_empty(),
        cull_frustum: true,
        size: settings.size,
    }
}

/// What the packing of filtered splats needs of the settings.
pub fn filtered_shade(
    settings: &Settings,
    model: &Model,
    max_size_px: f32,
) -> draw::filtered::Shade {
    let cull_back = cut_settings(settings, model).cull_back;
    draw::filtered::Shade {
        side_px: settings.threshold_px.max(1.0),
        max_size_px,
        splats_only: settings.method == Method::Splats,
        // Both sides of a part are near the front at its rim: a smaller offset keeps the far one out.
        depth_offset: settings
            .depth_offset
            .unwrap_or(if cull_back { 3.0 } else { 2.0 }),
        cull_back,
        use_colors: settings.use_colors,
        color_by: settings.color_by,
    }
}

/// Refuses by name what `settings` ask for in vain: with this model, these outputs, and points of at most
/// `max_size_px` (infinite on the mirror).
///
/// # Errors
/// [`Error::Unsupported`] with the reason and what to do, or [`Error::Limit`] for a threshold that is too large.
pub fn check(
    _model: &Model,
    settings: &Settings,
    outputs: Outputs,
    max_size_px: f32,
) -> Result<(), Error> {
    if settings.method == Method::Points && settings.threshold_px > max_size_px {
        return Err(Error::Limit {
            what: "the size of points (--threshold, pixels)".into(),
            value: settings.threshold_px.ceil() as u64,
            limit: max_size_px as u64,
        });
    }
    if !matches!(settings.splat, SplatKind::Square | SplatKind::Filtered)
        || (settings.method == Method::Splats && settings.splat != SplatKind::Filtered)
        || settings.blend() != Blend::Opaque
        || settings.shading != Shading::PerSplat
    {
        return Err(Error::Unsupported {
            what: "these splats",
            why: "they are not drawn yet".into(),
        });
    }
    if settings.draws_filtered() {
        check_filtered(settings, outputs, max_size_px)?;
    }
    Ok(())
}

/// Refuses by name what filtered splats cannot draw.
///
/// # Errors
/// For points without a tree, normals as output, one-sided light, and thresholds above
/// `max_size_px`.
fn check_filtered(settings: &Settings, outputs: Outputs, max_size_px: f32) -> Result<(), Error> {
    let why = if settings.method == Method::Points {
        "points have no areas without a tree; use --method pop or splats"
    } else if outputs.normal {
        "they are sums over a pixel and have no normal; leave --normals out"
    } else if !settings.two_sided {
        "their sums do not tell the sides of a surface apart; leave --one-sided out"
    } else if settings.threshold_px > max_size_px {
        return Err(Error::Limit {
            what: "the size of filtered splats (--threshold, pixels)".into(),
            value: settings.threshold_px.ceil() as u64,
            limit: max_size_px as u64,
        });
    } else {
        return Ok(());
    };
    Err(Error::Unsupported {
        what: "filtered splats",
        why: why.into(),
    })
}

/// The uniform block of a frame.
pub(super) fn frame_constants(
    view: &View,
    settings: &Settings,
    context: &Context,
) -> FrameConstants {
    let [_, _, width, height] = context.viewport();
    // Maps the picture's clip space into the middle of the wider viewport.
    let shrink = Mat4::from_scale(Vec3::new(
        view.width as f32 / width,
        view.height as f32 / height,
        1.0,
    ));
    let clip = shrink * view.clip_from_view();
    // x_ndc = 2 px / W - 1 and x_ndc = (sx x + ox z) / -z with z = -1: x = (x_ndc + ox) / sx.
    let [sx, sy] = view.scale;
    let [ox, oy] = view.offset;
    let mut flags = 0;
    for (on, flag) in [
        (settings.use_colors, constants::FLAG_USE_COLORS),
        (settings.two_sided, constants::FLAG_TWO_SIDED),
        (
            settings.color_by == ColorBy::Primitive,
            constants::FLAG_COLOR_BY_PRIMITIVE,
        ),
        (
            view.light == Light::Directional || !view.is_perspective,
            constants::FLAG_PARALLEL_LIGHT,
        ),
        (!view.is_perspective, constants::FLAG_ORTHOGRAPHIC),
    ] {
        if on {
            flags |= flag;
        }
    }
    let columns = |m: Mat4| -> [[f32; 4]; 4] {
        [m.x_axis, m.y_axis, m.z_axis, m.w_axis].map(|c: Vec4| c.to_array())
    };
    FrameConstants {
        view_from_model: columns(view.view_from_model),
        clip_from_view: columns(clip),
        ray_scale: [
            2.0 / (view.width as f32 * sx),
            -2.0 / (view.height as f32 * sy),
        ],
        ray_offset: [(ox - 1.0) / sx, (oy + 1.0) / sy],
        focal_px: view.focal_px(),
        splat_size_px: settings.threshold_px.max(1.0),
        model_scale: view.model_scale,
        flags,
        background: {
            let [r, g, b] = settings.background;
            [r, g, b, settings.depth_offset()]
        },
    }
}
