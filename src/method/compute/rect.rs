//! The part of the picture that a model can be seen in: work on whole pictures is done there only.

use crate::math::camera::View;
use crate::tree::Model;
use glam::Vec3;

/// The pixels that the box of a model covers, and `margin_px` more on every side: left, top, and one past right and
/// bottom. Never empty. All of the picture where a corner of the box is beside or behind the eye.
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
        // Also what is no number. The near plane does not matter: the picture of the box is the hull of those of its
        // corners, wherever they are before the eye.
        if !(x.is_finite() && y.is_finite() && (distance > 0.0 || !view.is_perspective)) {
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

/// One as x, y, width and height.
pub(crate) fn area([left, top, right, bottom]: [u32; 4]) -> [u32; 4] {
    [left, top, right - left, bottom - top]
}

/// How many pixels there are in one.
pub(crate) fn pixels([left, top, right, bottom]: [u32; 4]) -> u64 {
    u64::from(right - left) * u64::from(bottom - top)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use crate::math::camera::Camera;
    use glam::DVec3;

    fn of_box(min: Vec3, max: Vec3, view: &View, margin: f32) -> [u32; 4] {
        let model = Model {
            min,
            max,
            ..Model::default()
        };
        rect_px(&model, view, margin)
    }

    #[test]
    fn a_rectangle_holds_the_box_and_is_as_small_as_it_may_be() {
        // Half a field of view of 45 degrees: 100 pixels a unit of tangent.
        let size = (400, 200);
        let angle = std::f64::consts::FRAC_PI_2;
        let look = |near| {
            Camera::look_at(
                size,
                DVec3::ZERO,
                DVec3::NEG_Z,
                DVec3::Y,
                angle,
                (near, 100.0),
            )
            .view(DVec3::ZERO)
            .unwrap()
        };
        // The nearer face decides: at distance 4 one unit is 25 pixels. That holds if the near plane cuts the box too.
        let (min, max) = (Vec3::new(-1.0, 0.0, -6.0), Vec3::new(2.0, 1.0, -4.0));
        for near in [1.0, 5.0] {
            assert_eq!(of_box(min, max, &look(near), 0.25), [174, 74, 251, 101]);
            assert_eq!(of_box(min, max, &look(near), 3.25), [171, 71, 254, 104]);
        }
        let view = look(1.0);
        // Partly and wholly beside the picture.
        assert_eq!(
            of_box(min - Vec3::X * 8.0, max - Vec3::X * 8.0, &view, 0.25),
            [0, 74, 101, 101]
        );
        let [left, _, right, _] = of_box(min + Vec3::X * 90.0, max + Vec3::X * 90.0, &view, 0.25);
        assert_eq!((left, right), (399, 400));
        // Around the eye, and what has no size.
        assert_eq!(of_box(-Vec3::ONE, Vec3::ONE, &view, 0.25), [0, 0, 400, 200]);
        let nothing = (Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY));
        assert_eq!(of_box(nothing.0, nothing.1, &view, 0.25), [0, 0, 400, 200]);
        assert_eq!(pixels([3, 4, 10, 6]), 14);
        assert_eq!(area([3, 4, 10, 6]), [3, 4, 7, 2]);
    }
}
