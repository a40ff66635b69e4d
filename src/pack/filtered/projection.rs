//! Where patches lie in the picture, four at a time: their window position, and the depths of both passes.

use crate::abi::FilteredSplat;
use crate::abi::constants::FARTHEST_PX;
use crate::math::camera::View;
use crate::pack::filtered::patch_x4::{Vectors, dot, splat, vectors};
use glam::{Vec3, Vec4};

/// A filtered splat before it is placed in the picture of a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilteredPatch {
    /// Centroid of the patch in model space.
    pub center: Vec3,
    /// Depth offset of the first pass in model units, away from the viewer.
    pub offset: f32,
    /// See [`FilteredSplat::side_px`].
    pub side_px: f32,
    /// See [`FilteredSplat::area_px`].
    pub area_px: f32,
    /// See [`FilteredSplat::extent_px`].
    pub extent_px: [f32; 2],
    /// See [`FilteredSplat::color`].
    pub color: [f32; 3],
}

impl FilteredPatch {
    /// The splat as `view` has it; none where its center lies before the near or behind the far plane, or is no number.
    pub fn place(&self, view: &View) -> Option<FilteredSplat> {
        let centers = vectors([self.center; 4]);
        let places = PictureProjection::new(view).places(&centers, Vec4::splat(self.offset));
        (places.lanes & 1 != 0).then(|| FilteredSplat {
            window_px: [places.window_px[0].x, places.window_px[1].x],
            pushed_depth: places.pushed_depth.x,
            side_px: self.side_px,
            depth: places.depth.x,
            area_px: self.area_px,
            extent_px: self.extent_px,
            color: self.color,
            unused: 0,
        })
    }
}

/// From model space to the picture.
pub(super) struct PictureProjection {
    is_perspective: bool,
    /// Rows of the matrix to view space: factors, and what is added.
    rows: [(Vectors, Vec4); 3],
    /// Factors of x and y, and shifts, in clip space (y down).
    scale: [Vec4; 2],
    shift: [Vec4; 2],
    /// Half the picture, pixels.
    half_px: [Vec4; 2],
    /// The third component in clip space is the first times z plus the second.
    depth: [Vec4; 2],
    model_scale: Vec4,
}

/// Four centers in the picture.
pub(super) struct FourPlaces {
    pub(super) window_px: [Vec4; 2],
    /// Reversed depth, 0..=1.
    pub(super) depth: Vec4,
    /// Depth of the first pass; 0 where it lies at or behind the far plane.
    pub(super) pushed_depth: Vec4,
    /// Centers between the near and the far plane.
    pub(super) lanes: u32,
}

impl PictureProjection {
    pub(super) fn new(view: &View) -> Self {
        let clip = view.clip_from_view();
        let column = if view.is_perspective {
            clip.z_axis
        } else {
            clip.w_axis
        };
        Self {
            is_perspective: view.is_perspective,
            rows: [0, 1, 2].map(|i| {
                let row = view.view_from_model.row(i);
                (splat(row.truncate()), Vec4::splat(row.w))
            }),
            scale: [clip.x_axis.x, clip.y_axis.y].map(Vec4::splat),
            shift: [column.x, column.y].map(Vec4::splat),
            half_px: [view.width, view.height].map(|n| Vec4::splat(0.5 * n as f32)),
            depth: [clip.z_axis.z, clip.w_axis.z].map(Vec4::splat),
            model_scale: Vec4::splat(view.model_scale),
        }
    }

    /// Of centers in model space that the first pass pushes away by `offset`, model units.
    #[inline]
    pub(super) fn places(&self, centers: &Vectors, offset: Vec4) -> FourPlaces {
        let [x, y, z] = self
            .rows
            .each_ref()
            .map(|(row, add)| dot(row, centers) + *add);
        let offset = offset * self.model_scale;
        let clip_z = self.depth[0] * z + self.depth[1];
        let (w, shift, pushed) = if self.is_perspective {
            // Along the ray, so that the window position stays. With an offset of 0 the factor is exactly 1: a splat is
            // never behind itself.
            let length = (x * x + y * y + z * z).sqrt();
            (-z, z, z * ((length + offset) / length))
        } else {
            (Vec4::ONE, Vec4::ONE, z - offset)
        };
        let pushed_w = if self.is_perspective {
            -pushed
        } else {
            Vec4::ONE
        };
        let window = |i: usize, c: Vec4| {
            let ndc = (self.scale[i] * c + self.shift[i] * shift) / w;
            ndc * self.half_px[i] + self.half_px[i]
        };
        let window_px = [window(0, x), window(1, y)];
        let pushed_depth = (self.depth[0] * pushed + self.depth[1]) / pushed_w;
        // Farther than this nothing reaches into a picture.
        let limit = Vec4::splat(FARTHEST_PX);
        let is_near = window_px[0].abs().cmplt(limit) & window_px[1].abs().cmplt(limit);
        let is_between = clip_z.cmpge(Vec4::ZERO) & clip_z.cmple(w) & w.cmpgt(Vec4::ZERO);
        // What cannot be pushed (an infinite offset) hides nothing; it is drawn still.
        let hides = pushed_depth.cmpgt(Vec4::ZERO);
        FourPlaces {
            window_px,
            depth: clip_z / w,
            pushed_depth: Vec4::select(hides, pushed_depth.min(Vec4::ONE), Vec4::ZERO),
            lanes: (is_between & is_near).bitmask(),
        }
    }
}
