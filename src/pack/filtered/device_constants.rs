//! Constants of the pass that makes filtered splats on the device.

use crate::abi::FilteredConstants;
use crate::math::camera::View;
use crate::pack::LampSource;
use crate::pack::filtered::eye::FilteredEye;
use crate::pack::filtered::{FilteredShade, MARGIN_PX};
use crate::tree::Tree;
use glam::Vec4;

/// Eye of a view as the device has it.
pub fn device_constants(view: &View, shade: FilteredShade) -> FilteredConstants {
    let tree = Tree::default();
    let eye = FilteredEye::new(&tree, view, shade);
    let clip = view.clip_from_view();
    let shift = match view.is_perspective {
        true => clip.z_axis,
        false => clip.w_axis,
    };
    let half_px = [view.width, view.height].map(|n| 0.5 * n as f32);
    let lamp = match eye.lamp {
        Some((_, LampSource::Point(position))) => position.as_vec3().extend(1.0),
        Some((_, LampSource::Direction(direction))) => direction.as_vec3().extend(0.0),
        None => Vec4::ZERO,
    };
    FilteredConstants {
        rows: [0, 1, 2].map(|row| view.view_from_model.row(row).to_array()),
        forward: eye.forward.to_array(),
        position: view.eye.to_array(),
        focal_px: eye.focal_px,
        backward: view.backward.to_array(),
        side_px: shade.side_px,
        right: eye.right.to_array(),
        limit_px: (shade.max_size_px - MARGIN_PX).max(1.0),
        up: eye.up.to_array(),
        offset_px: eye.offset_px,
        lamp: lamp.to_array(),
        scale_shift: [clip.x_axis.x, clip.y_axis.y, shift.x, shift.y],
        half_depth: [half_px[0], half_px[1], clip.z_axis.z, clip.w_axis.z],
        model_scale: view.model_scale,
        twice_focal_px: 2.0 * view.focal_px(),
    }
}
