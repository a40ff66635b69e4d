//! Which centers of pixels the pictures of balls contain: all that one sample a pixel shows.
//!
//! What lies in a ball between the centers is nothing. Where splats are one pixel at most (thresholds of up to a pixel) this
//! holds for splats as well: a point of the surface that is seen at a center lies in the ball of some splat, which contains
//! that center then, and a square of a pixel around the middle of a ball covers the center that is nearest to it. So no hole
//! opens, and outlines are as wide as balls and not as wide as pixels.
//!
//! At a threshold of a pixel what surely contains one center alone is a splat too, though it be larger: all below it that
//! is drawn would be that pixel. No part of it is farther from the middle than a pixel, and of what a square of a pixel
//! covers none is farther than half a diagonal anyway.

use crate::cut::frustum_and_size::NodeTester;
use crate::cut::siblings::SphereLanes;
use crate::math::camera::View;
use crate::simd::FloatLanes;
use glam::Vec3;

/// A circle of this radius, pixels, contains the center of one wherever it lies.
const LARGEST_BETWEEN_PX: f32 = std::f32::consts::FRAC_1_SQRT_2;
/// A larger one never contains one center alone, pixels.
const LARGEST_OF_ONE_PX: f32 = 1.0;
/// How far off a coordinate of a splat may be, over the sum of the terms that it is made of, on the device and here
/// together. On either side numbers of the matrix are rounded, and their products and sums: at most ten times, or twelve
/// where a device places points in two steps, by 2^-24 each.
pub(super) const POSITION_ERROR: f32 = 24.0 / 16_777_216.0;

/// Where balls are in the picture of a frame. `shaders/common/cut.glsl` has the same operations in the same order.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PixelCenters {
    /// To the right and up in the picture, and what is added.
    axes: [[f32; 4]; 2],
    /// Pixels of a tangent (perspective) or of a unit.
    pub(crate) focal: [f32; 2],
    pub(crate) middle: [f32; 2],
    near: f32,
    is_perspective: bool,
    /// Pixels that a place may be off, times the distance (perspective) or alone.
    pub(crate) place_error: f32,
    /// Pixels by which a device may place a splat elsewhere by rounding.
    pub(crate) snap_px: f32,
    /// Whether what contains one center alone is small.
    ones_are_small: bool,
}

/// Balls in the picture, pixels.
#[derive(Clone, Copy)]
struct PixelSpots<V> {
    /// How far their middles are from the nearest center.
    aside: [V; 2],
    reach: V,
    /// By how much a coordinate may be off.
    off: V,
}

impl PixelCenters {
    /// For splats of so many pixels, on a device whose window positions have so many binary places.
    pub(crate) fn new(tester: &NodeTester, view: &View, side_px: f32, subpixel_bits: u32) -> Self {
        let scale = if view.model_scale > 0.0 {
            view.model_scale
        } else {
            1.0
        };
        let axis = |row: usize| {
            let axis: Vec3 = view.view_from_model.row(row).truncate() / scale;
            let start = view.view_from_model.transform_point3(tester.reference)[row] / scale;
            axis.extend(start * tester.unit).to_array()
        };
        let half = [view.width as f32 / 2.0, view.height as f32 / 2.0];
        let (unit, sign) = if view.is_perspective {
            (1.0, -1.0)
        } else {
            (scale / tester.unit, 1.0)
        };
        let focal = [
            view.scale[0] * half[0] * unit,
            -view.scale[1] * half[1] * unit,
        ];
        let middle = [
            half[0] * (1.0 + sign * view.offset[0]),
            half[1] * (1.0 - sign * view.offset[1]),
        ];
        // A coordinate in view space is the product of a unit vector and a position, and the place of the model's zero;
        // one in the window those of a vector as long as focal length and middle together, over a distance that is off
        // as well, or (orthographic) those of one as long as the focal length.
        let place = |i: usize| {
            if view.is_perspective {
                focal[i].hypot(middle[i]) + 2.0 * half[i]
            } else {
                focal[i].abs()
            }
        };
        Self {
            axes: [axis(0), axis(1)],
            focal,
            middle,
            near: tester.near,
            is_perspective: view.is_perspective,
            place_error: POSITION_ERROR * tester.extent * place(0).max(place(1)),
            // Half a step, and the roundings of positions in single precision.
            snap_px: 0.5_f32.powi(1 + subpixel_bits as i32)
                + 1e-6 * view.width.max(view.height) as f32,
            ones_are_small: side_px >= 1.0,
        }
    }

    /// To the right and up in the picture, and what is added.
    pub(crate) fn axes(&self) -> [[f32; 4]; 2] {
        self.axes
    }

    /// How far centers are along the axes of the picture, in the tester's unit.
    #[inline(always)]
    pub(crate) fn along<V: FloatLanes>(&self, center: [V; 3]) -> [V; 2] {
        let [[_, _, _, right], [_, _, _, up]] = self.axes;
        let [x, y] = self.way_along(center);
        [x + right, y + up]
    }

    /// How far ways go along the axes of the picture.
    #[inline(always)]
    pub(crate) fn way_along<V: FloatLanes>(&self, [x, y, z]: [V; 3]) -> [V; 2] {
        let [[a, b, c, _], [d, e, f, _]] = self.axes;
        [x * a + y * b + z * c, x * d + y * e + z * f]
    }

    /// Pixels of a length at a distance of 1, at most.
    #[inline]
    pub(crate) fn focal_px(&self) -> f32 {
        self.focal[0].abs().max(self.focal[1].abs())
    }

    /// How far balls reach in the picture from where their middles are seen, pixels; `off`: by how much a coordinate of
    /// theirs may be off. Places and radii are those at a distance of 1.
    ///
    /// A ball of radius r there, seen at the tangent a from the middle, reaches r sqrt(1 + a²) / (1 - r²) to the side, from
    /// a middle that is a r² / (1 - r²) farther off; infinitely far where r is not small.
    #[inline(always)]
    pub(super) fn reach<V: FloatLanes>(&self, [x, y]: [V; 2], radius: V, off: V) -> V {
        // Corners are moved by rounding in both directions.
        let off = off * std::f32::consts::SQRT_2;
        let in_pixels = radius * self.focal_px();
        if !self.is_perspective {
            return in_pixels * 1.001 + off;
        }
        // sqrt(1 + a²) <= 1 + a² / 2, and a r < 0.01 a <= 0.005 (1 + a²).
        let stretch = (x * x + y * y) * 0.506 + 1.006;
        let is_small = radius.lt(x.all(0.01));
        V::choose(is_small, in_pixels * stretch + off, x.all(f32::INFINITY))
    }

    #[inline(always)]
    fn spots<V: FloatLanes>(&self, balls: &SphereLanes<V>) -> PixelSpots<V> {
        let [x, y] = self.along(balls.center);
        let ([x, y], radius, off) = if self.is_perspective {
            let inverse = x.all(1.0) / balls.depth;
            let at = [x * inverse, y * inverse];
            (at, balls.radius * inverse, inverse * self.place_error)
        } else {
            ([x, y], balls.radius, x.all(self.place_error))
        };
        let off = off + self.snap_px;
        let [focal_x, focal_y] = self.focal;
        let [middle_x, middle_y] = self.middle;
        PixelSpots {
            aside: [
                to_center(x * focal_x + middle_x).0.abs(),
                to_center(y * focal_y + middle_y).0.abs(),
            ],
            reach: self.reach([x, y], radius, off),
            off,
        }
    }

    /// Which balls have at most this radius, pixels.
    #[inline(always)]
    pub(in crate::cut) fn are_within<V: FloatLanes>(&self, balls: &SphereLanes<V>, px: f32) -> u32 {
        let most = px / self.focal_px();
        let most = if self.is_perspective {
            balls.depth * most
        } else {
            balls.depth.all(most)
        };
        V::bits(balls.radius.le(most))
    }

    /// Which balls may be so small that it matters which centers they contain.
    #[inline(always)]
    pub(crate) fn may_matter<V: FloatLanes>(&self, balls: &SphereLanes<V>) -> u32 {
        let largest = if self.ones_are_small {
            LARGEST_OF_ONE_PX
        } else {
            LARGEST_BETWEEN_PX
        };
        self.are_within(balls, largest)
    }

    /// Which balls contain no center of a pixel, and which of them surely one and no more, that of the pixel
    /// that their own middle is in, and are splats for it. Of triangles between centers no device draws anything.
    #[inline(always)]
    pub(crate) fn of<V: FloatLanes>(&self, balls: &SphereLanes<V>) -> (u32, u32) {
        let PixelSpots {
            aside: [x, y],
            reach,
            off,
        } = self.spots(balls);
        let (nearest, reach) = (x * x + y * y, reach * reach);
        let near = x.all(self.near);
        let misses = nearest.gt(reach) & balls.depth.gt(near);
        // The next center is across the nearest side of the pixel.
        let farther = x.max(y);
        let next = nearest - farther * 2.0 + 1.0;
        let is_one =
            next.gt(reach) & farther.lt(x.all(0.5) - off) & (balls.depth - balls.radius).gt(near);
        let one = if self.ones_are_small {
            V::bits(is_one & !misses)
        } else {
            0
        };
        (V::bits(misses), one)
    }

    /// Which balls contain no center of a pixel.
    #[inline(always)]
    pub(crate) fn none<V: FloatLanes>(&self, balls: &SphereLanes<V>) -> u32 {
        if self.are_within(balls, LARGEST_BETWEEN_PX) == 0 {
            return 0;
        }
        self.of(balls).0
    }
}

/// How far coordinates in the picture are from the nearest center of a pixel, and sums whose low bits are 1 more than the
/// pixel's number: a sum with 2^23 is rounded to whole numbers. Beside the picture both mean nothing: what is a pixel large
/// there covers no center that matters.
#[inline(always)]
pub(super) fn to_center<V: FloatLanes>(window: V) -> (V, V) {
    let shifted = window + 0.5;
    let sum = shifted + 8_388_608.0;
    (shifted - (sum - 8_388_608.0), sum)
}
