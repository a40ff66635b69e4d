//! The part of the picture that a model can be seen in: work on whole pictures is done there only.

use crate::math::camera::View;
use crate::tree::Model;
use glam::Vec3;

/// The pixels that the box of a model covers, and `margin_px` more on every side: left, top, and one past right and
/// bottom. Never empty. All of the picture where the box reaches the near plane.
pub(crate) fn rect_px(model: &Model, view: &View, margin_px: f32) -> [u32; 4] {
    let whole = [0, 0, view.width, view.height];
    let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
    for corner in 0..8 {
        let side = |axis: usize| {
            let end = if corner >> axis & 1 == 0 {
                model.min
            } else {
                model.max
            };
            end[axis]
        };
        let (x, y, distance) = view.project(Vec3::new(side(0), side(1), side(2)));
        // Also what is no number.
        if !(x.is_finite() && y.is_finite() && (distance > view.near || !view.is_perspective)) {
            return whole;
        }
        for (axis, at) in [x, y].into_iter().enumerate() {
            low[axis] = low[axis].min(at);
            high[axis] = high[axis].max(at);
        }
    }
    let part = |axis: usize, size: u32| {
        let first = (low[axis] - margin_px)
            .floor()
            .clamp(0.0, size as f32 - 1.0) as u32;
        let end = (high[axis] + margin_px).ceil().clamp(0.0, size as f32) as u32;
        (first, end.max(first + 1))
    };
    let ((left, right), (top, bottom)) = (part(0, view.width), part(1, view.height));
    [left, top, right, bottom]
}

/// How many pixels there are in one.
pub(crate) fn pixels([left, top, right, bottom]: [u32; 4]) -> u64 {
    u64::from(right - left) * u64::from(bottom - top)
}
