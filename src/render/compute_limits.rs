//! Sizes up to which compute draws what a rasterizer draws too: above them the rasterizer is cheaper. No device is asked.

use crate::abi::constants::LARGEST_SMALL_BLENDED_PX;
use crate::pack::Footprint;
use crate::pack::splats::SLACK_PX;
use crate::render::technique::Technique;
use crate::render::{Settings, SplatKind};

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
        Technique::Nothing => 0.0,
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
