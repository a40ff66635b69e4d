//! Square footprints: axis-aligned squares of constant depth (methods 7, kernel "square").
//!
//! A pixel belongs to the square when its center lies in [c - s/2, c + s/2) on both axes, which is what
//! Vulkan's point rasterization ("the fragment's center is within the square") gives with the top-left rule
//! of polygons. Center and side are snapped to the grid of the frame, so a square of side 1 covers exactly one pixel.

use crate::render::reference::frame::{PlacedVertex, ReferenceFrame};
use std::ops::Range;

/// The pixels of a square.
pub(super) struct SquareFootprint {
    pub(super) columns: Range<u32>,
    pub(super) rows: Range<u32>,
}

impl SquareFootprint {
    /// The square of a side, at least 1 pixel, around a center; `None` when it covers no pixel center, or the side is
    /// no number.
    pub(super) fn around(
        frame: &ReferenceFrame,
        placed: &PlacedVertex,
        side_px: f32,
    ) -> Option<Self> {
        if side_px.is_nan() {
            return None;
        }
        let w = f64::from(placed.clip.w);
        let [x, y] = frame.window(f64::from(placed.clip.x) / w, f64::from(placed.clip.y) / w);
        // Far beyond any picture and side, yet sums of two stay far inside an i64.
        const LIMIT_PX: f64 = (1u64 << 40) as f64;
        if !(x.abs() < LIMIT_PX && y.abs() < LIMIT_PX) {
            return None;
        }
        let grid = frame.grid;
        let side = grid.snap(f64::from(side_px).clamp(1.0, LIMIT_PX));
        let footprint = Self::of_steps(frame, [grid.snap(x), grid.snap(y)], side);
        (!footprint.columns.is_empty() && !footprint.rows.is_empty()).then_some(footprint)
    }

    /// The square of a center and a side in steps of the frame's grid; it may cover nothing.
    pub(super) fn of_steps(frame: &ReferenceFrame, center: [i64; 2], side: i64) -> Self {
        let [left, top] = center.map(|c| c - side / 2);
        let grid = frame.grid;
        Self {
            columns: grid.pixels_between(left, left + side, frame.view.width),
            rows: grid.pixels_between(top, top + side, frame.view.height),
        }
    }
}
