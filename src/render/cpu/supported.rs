//! What this renderer can draw.

use crate::abi::constants::LARGEST_SMALL_BLENDED_PX;
use crate::pack::ColorBy;
use crate::render::PictureOutputs;
use crate::render::technique::Technique;
use crate::render::{CutOn, Method, Settings};

/// Longest side of a picture, pixels: beyond it corners of triangles do not fit whole steps.
pub const LARGEST_SIDE_PX: u32 = 8192;

/// Why pictures of these settings cannot be drawn here; `None` where they can.
pub fn unsupported_reason(
    settings: &Settings,
    outputs: PictureOutputs,
    size: [u32; 2],
) -> Option<&'static str> {
    if size.into_iter().any(|side| side > LARGEST_SIDE_PX) {
        Some("a side of the picture is longer than 8192 pixels")
    } else if settings.cut_on == CutOn::Device {
        Some("the cut on the device is for a device; leave --cut-on out")
    } else if settings.method == Method::Points {
        Some("it draws no vertices as points; use --method pop or splats")
    } else if settings.color_by == ColorBy::Overdraw {
        Some("it counts no overdraw; use --color-by shading")
    } else if Technique::blends_vertex_splats(settings) {
        None
    } else if settings.color_by == ColorBy::Classification {
        Some("only visibility splats have a classification, and it draws those from vertices alone")
    } else {
        match Technique::of(settings) {
            Technique::Nothing => None,
            Technique::Opaque | Technique::Polygons => None,
            Technique::Filtered if settings.threshold_px > LARGEST_SMALL_BLENDED_PX => {
                Some("filtered splats of more than 16 pixels are a device's; use a lower threshold")
            }
            Technique::Filtered if outputs.normal => Some(
                "filtered splats are sums over a pixel and have no normal; leave --normals out",
            ),
            Technique::Filtered => None,
            Technique::Fuzzy => Some(
                "it blends filtered splats only, and splats from vertices; use --splat filtered",
            ),
            Technique::Visibility => Some("it draws no visibility splats but those from vertices"),
        }
    }
}
