//! What is decided of a frame before it is drawn.

use crate::math::camera::View;
use crate::render::cut_key::{LARGEST_HIDDEN_PX, knows_footprints};
use crate::render::technique::Technique;
use crate::render::{Culling, Method, Occlusion, Settings};
use crate::tree::Model;

/// Opaque squares and discs of a mesh at thresholds above a pixel, and up to this, are drawn as at a pixel. There the cut asks
/// which centers of pixels a ball contains, so that next to nothing is drawn twice: up to twice as fast as squares of 1.25 pixels
/// that lie over each other, and nearer to the truth (docs/PERFORMANCE.md).
const AS_A_PIXEL_PX: f32 = 1.5;

/// The settings of one frame: with [`Culling::Auto`] nothing is culled where a closed surface surrounds the eye, since
/// what is seen from there is what faces away; and thresholds of little more than a pixel are a pixel, where that is better and faster.
pub fn resolve_settings(settings: &Settings, model: &Model, view: &View) -> Settings {
    let of_cut = settings.view_of_cut(view);
    let is_inside = settings.culling == Culling::Auto
        && model.is_closed
        && of_cut.is_perspective
        && model.surrounds(of_cut.eye);
    let as_a_pixel = settings.method == Method::Pop
        && knows_footprints(settings)
        && model.kind().is_surface()
        && settings.threshold_px > 1.0
        && settings.threshold_px <= AS_A_PIXEL_PX;
    Settings {
        culling: if is_inside {
            Culling::Off
        } else {
            settings.culling
        },
        threshold_px: if as_a_pixel {
            1.0
        } else {
            settings.threshold_px
        },
        ..*settings
    }
}

/// The settings of one frame that the processor draws, see [`resolve_settings`]. Splats of more than a pixel take it less time than to look
/// for hidden ones.
pub(crate) fn cpu_settings(settings: &Settings, model: &Model, view: &View) -> Settings {
    let mut settings = resolve_settings(settings, model, view);
    if settings.occlusion == Occlusion::Auto
        && settings.threshold_px > LARGEST_HIDDEN_PX[2]
        && Technique::of(&settings) == Technique::Opaque
    {
        settings.occlusion = Occlusion::Off;
    }
    settings
}
