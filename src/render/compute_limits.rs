//! Sizes up to which compute draws what a rasterizer draws too: above them the rasterizer is cheaper. No device is asked.

use crate::abi::constants::LARGEST_SMALL_BLENDED_PX;
use crate::gpu::Error;
use crate::pack::splats::SLACK_PX;
use crate::pack::{ColorBy, Footprint};
use crate::render::capabilities::RendererCapabilities;
use crate::render::outputs::PictureOutputs;
use crate::render::settings::{Method, Path, Settings, Shading, SplatKind};
use crate::render::technique::Technique;

/// Largest side of a square and diameter of a disc that is drawn this way, pixels: above it a rasterizer fills faster than
/// atomics do.
pub const LARGEST_SQUARE_PX: f32 = 6.0;
/// Largest threshold at which ellipses are drawn this way, pixels: above it a rasterizer fills faster (docs/PERFORMANCE.md).
pub const LARGEST_ELLIPSE_PX: f32 = 10.0;
/// Largest footprint of a visibility splat that is drawn this way, as draw lists count it: in the plane of the surface a
/// footprint may reach a diameter beyond its center to each side.
pub(crate) const LARGEST_VISIBLE_PX: f32 = 2.0 * LARGEST_SMALL_BLENDED_PX + SLACK_PX;
/// Largest bounding circle of a triangle that is drawn this way, pixels.
pub(crate) const LARGEST_TRIANGLE_PX: f32 = 8.0;

/// The largest threshold with which splats are drawn by compute, pixels; 0 where there are none.
pub(crate) fn largest_threshold_px(settings: &Settings) -> f32 {
    match Technique::of(settings) {
        Technique::Nothing | Technique::Polygons => 0.0,
        Technique::Opaque if settings.splat == SplatKind::Ellipse => LARGEST_ELLIPSE_PX,
        Technique::Opaque => LARGEST_SQUARE_PX,
        Technique::Visibility | Technique::Fuzzy | Technique::Filtered => LARGEST_SMALL_BLENDED_PX,
    }
}

/// Largest footprint of an opaque splat that is drawn this way, as draw lists count it: round ones with their slack, and
/// in the plane of the surface a diameter beyond the center to each side.
pub(crate) fn largest_point_px(settings: &Settings) -> f32 {
    match settings.footprint() {
        Footprint::Square => LARGEST_SQUARE_PX,
        Footprint::Circle => LARGEST_SQUARE_PX + SLACK_PX,
        Footprint::Oriented => 2.0 * LARGEST_ELLIPSE_PX + SLACK_PX,
    }
}

/// Bytes of the largest storage that compute needs of a picture of this width and height, pixels.
pub(crate) fn storage_bytes(technique: Technique, [width, height]: [u32; 2]) -> u64 {
    let pixel = match technique {
        Technique::Nothing => 0,
        // Depth and number of what is nearest.
        Technique::Opaque | Technique::Visibility | Technique::Polygons => 8,
        // Sums of colors and weights.
        Technique::Fuzzy | Technique::Filtered => 32,
    };
    pixel * u64::from(width) * u64::from(height)
}

/// Tells whether settings that [`resolve_settings`](crate::render::frame_plan::resolve_settings) gave may have small
/// primitives drawn by compute, in a picture of this size, pixels.
///
/// # Errors
/// [`Error::Unsupported`] when they insist on it and it cannot be, with the reason.
pub(crate) fn may_use_compute(
    settings: &Settings,
    outputs: PictureOutputs,
    size: [u32; 2],
    capabilities: &RendererCapabilities,
) -> Result<bool, Error> {
    let technique = Technique::of(settings);
    let reason = match technique {
        _ if settings.path == Path::Raster => return Ok(false),
        // No graphics card has measured them: whoever wants them says so.
        _ if settings.path == Path::Auto && settings.drawn_polygons().is_some() => {
            return Ok(false);
        }
        Technique::Opaque if settings.method == Method::Pop => not_as_opaque(settings),
        Technique::Polygons => None,
        Technique::Filtered | Technique::Fuzzy if settings.has_lists() => {
            not_as_blended(settings, outputs)
        }
        Technique::Visibility if settings.has_lists() => not_as_visible(settings),
        _ => Some(
            "it draws blended, filtered and visibility splats of a tree or from vertices, and what pop does not blend",
        ),
    };
    let reason = match reason {
        None if !capabilities.has_int64_atomics => {
            Some("the device has no 64-bit atomics on storage buffers")
        }
        None if storage_bytes(technique, size) > capabilities.max_storage_range => {
            Some("the picture does not fit one storage binding of the device")
        }
        reason => reason,
    };
    match reason {
        None => Ok(true),
        Some(why) if settings.path == Path::Compute => Err(Error::Unsupported {
            what: "drawing by compute",
            why: why.into(),
        }),
        Some(_) => Ok(false),
    }
}

/// Why opaque splats are not drawn by compute.
fn not_as_opaque(settings: &Settings) -> Option<&'static str> {
    if settings.color_by == ColorBy::Overdraw {
        Some("footprints are counted by the rasterizer; leave --path compute out")
    } else if settings.threshold_px <= largest_threshold_px(settings) {
        None
    } else if settings.splat == SplatKind::Ellipse {
        Some("ellipses of this size are cheaper to rasterize; use a threshold of at most 10 pixels")
    } else {
        Some(
            "squares and discs of this size are cheaper to rasterize; use a threshold of at most 6 pixels",
        )
    }
}

/// Tells whether splats of the threshold's size are too large; those from vertices have no such size.
fn are_too_large(settings: &Settings) -> bool {
    settings.drawn_vertex_splats().is_none()
        && settings.threshold_px > largest_threshold_px(settings)
}

/// Why filtered and fuzzy splats are not drawn by compute.
fn not_as_blended(settings: &Settings, outputs: PictureOutputs) -> Option<&'static str> {
    if are_too_large(settings) {
        Some("splats of this size are cheaper to rasterize; use a threshold of at most 16 pixels")
    } else if settings.shading == Shading::Deferred {
        Some("it sums colors, not normals; leave --splat-shading out")
    } else if outputs.normal {
        Some("it sums colors, not normals; leave --normals out")
    } else if settings.color_by.is_data() {
        Some("it knows no colors by level, normal or depth")
    } else if settings.sums.is_some() {
        Some("its sums are numbers of fixed point; leave --sums out")
    } else {
        None
    }
}

/// Why visibility splats are not drawn by compute.
fn not_as_visible(settings: &Settings) -> Option<&'static str> {
    are_too_large(settings).then_some(
        "splats of this size are cheaper to rasterize; use a threshold of at most 16 pixels",
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Blend;

    #[test]
    fn compute_ends_where_its_splats_are_cheaper_to_rasterize() {
        let of = |splat, blend| Settings {
            splat,
            blend: Some(blend),
            ..Settings::default()
        };
        for (settings, largest) in [
            (of(SplatKind::Square, Blend::Opaque), 6.0),
            (of(SplatKind::Disc, Blend::Opaque), 6.0),
            (of(SplatKind::Ellipse, Blend::Opaque), 10.0),
            (of(SplatKind::Square, Blend::TwoPass), 16.0),
            (of(SplatKind::Filtered, Blend::Opaque), 16.0),
            (of(SplatKind::Visibility, Blend::Opaque), 16.0),
        ] {
            assert_eq!(largest_threshold_px(&settings), largest, "{settings:?}");
        }
        let pixels = |threshold_px, splat| Settings {
            threshold_px,
            ..of(splat, Blend::Opaque)
        };
        for (splat, largest) in [(SplatKind::Square, 6.0), (SplatKind::Ellipse, 10.0)] {
            assert_eq!(not_as_opaque(&pixels(largest, splat)), None);
            assert!(not_as_opaque(&pixels(largest + 0.01, splat)).is_some());
        }
    }
}
