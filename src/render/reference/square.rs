//! Square splats and points: axis-aligned squares of constant depth (methods 7, kernel "square").
//!
//! A pixel belongs to the square when its center lies in [c - s/2, c + s/2) on both axes, which is what
//! Vulkan's point rasterization ("the fragment's center is within the square") gives with the top-left rule
//! of polygons. Center and side are snapped to 1/256 pixel, so a square of side 1 covers exactly one pixel.

use crate::abi::{Splat, Vertex};
use crate::render::reference::shade::{Kind, color_of, normal_of};
use crate::render::reference::target::{Band, Fragment};
use crate::render::reference::{Frame, pixels_between, snap};
use glam::Vec3;
use std::ops::Range;

/// A splat or point ready to be drawn.
pub(super) struct Square {
    pub(super) footprint: Footprint,
    fragment: Fragment,
}

/// Where a square lies.
pub(super) struct Footprint {
    pub(super) columns: Range<u32>,
    pub(super) rows: Range<u32>,
    /// Reversed depth of the center.
    pub(super) depth: f32,
    /// View-space distance of the center.
    pub(super) distance: f32,
}

/// A splat: the side is that of the frame for radius 0, else the projected diameter; at least 1 pixel.
pub(super) fn of_splat(frame: &Frame, splat: &Splat) -> Option<Square> {
    set_up(frame, splat.center, splat.normal, splat.color, |distance| {
        if splat.radius > 0.0 {
            let side = 2.0 * frame.pixels_per_unit * splat.radius;
            if frame.view.is_perspective {
                side / distance
            } else {
                side
            }
        } else if splat.radius.is_nan() {
            f32::NAN
        } else {
            frame.style.splat_size_px
        }
    })
}

/// A point: the side is that of the frame, at least 1 pixel.
pub(super) fn of_point(frame: &Frame, point: &Vertex) -> Option<Square> {
    set_up(frame, point.position, point.normal, point.color, |_| {
        frame.style.splat_size_px
    })
}

/// `side_px` gives the side at a distance, before the lower bound of 1 pixel; NaN drops the square.
fn set_up(
    frame: &Frame,
    center: Vec3,
    normal: [i16; 2],
    color: [u8; 4],
    side_px: impl FnOnce(f32) -> f32,
) -> Option<Square> {
    let footprint = footprint(frame, center, side_px)?;
    let normal = normal_of(normal, color);
    Some(Square {
        fragment: Fragment {
            color: frame
                .shading
                .color(Kind::Splat, center.as_dvec3(), normal, color_of(color)),
            normal: normal.as_vec3().to_array(),
            distance: footprint.distance,
        },
        footprint,
    })
}

/// The pixels and the depth of a square; `None` when its center lies before the near or behind the far plane,
/// or it covers no pixel center. `side_px` as in [`set_up`].
pub(super) fn footprint(
    frame: &Frame,
    center: Vec3,
    side_px: impl FnOnce(f32) -> f32,
) -> Option<Footprint> {
    let placed = frame.place(center)?;
    let distance = placed.distance;
    if !(distance >= frame.view.near && distance <= frame.view.far) {
        return None;
    }
    let side_px = side_px(distance);
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
    let side = snap(f64::from(side_px).clamp(1.0, LIMIT_PX));
    let (left, top) = (snap(x) - side / 2, snap(y) - side / 2);
    let columns = pixels_between(left, left + side, frame.view.width);
    let rows = pixels_between(top, top + side, frame.view.height);
    if columns.is_empty() || rows.is_empty() {
        return None;
    }
    Some(Footprint {
        columns,
        rows,
        depth: (placed.clip.z / placed.clip.w).clamp(0.0, 1.0),
        distance,
    })
}

/// Draws the rows of a square that lie in the band.
pub(super) fn rasterize(square: &Square, band: &mut Band) {
    let Footprint {
        columns,
        rows,
        depth,
        ..
    } = &square.footprint;
    for y in band.rows(rows) {
        for x in columns.clone() {
            band.put(x, y, *depth, || square.fragment);
        }
    }
}
