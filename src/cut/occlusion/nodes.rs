//! Nodes behind what is found so far: dropped with all that is below them.
//!
//! Source: Greene, Kass and Miller, *Hierarchical Z-Buffer Visibility* (SIGGRAPH 1993), whose tree is tested against depths
//! while it is drawn from front to back. Deviations: parts of the cut are done in the order of their distance
//! ([`crate::cut::select`]), and not nodes; there is no pyramid, as nodes are tested when they are a few pixels large, and
//! most of those that are seen are found to be by the first pixel that is looked at.
//!
//! What is dropped here would be left out at the end anyway ([`super`]), as all of it lies within the node's ball, and depths
//! only come nearer until then. So the lists are the same whatever is dropped here, and when.

use crate::cut::occlusion::OcclusionTest;
use crate::cut::occlusion::splat_batch::low_bits;
use crate::cut::siblings::SphereLanes;
use crate::simd::{FloatLanes, WideLanes};
use fearless_simd::prelude::*;
use glam::Vec4;
use std::sync::atomic::{AtomicU32, Ordering};

/// Smaller nodes are not looked at, radius in pixels: they have few splats, and to look takes as long as to visit two nodes.
const LEAST_PX: f32 = 1.5;
/// Larger ones neither: nearly none is hidden as a whole.
const MOST_PX: f32 = 10.0;
/// By how much the pixels of a node and its nearest distance are widened, so that those of all that is in it lie within
/// though either is rounded: parts of its reach and distance, and pixels.
const WIDER: f32 = 1.001;
const NEARER: f32 = 0.999_999;
const WIDER_PX: f32 = 0.002;

/// The pixels that all within balls may have, and how near it may be.
struct NodePixels<S: Simd> {
    /// First and end of columns, and of rows.
    ends: [S::u32s; 4],
    /// From the near plane, less the error of both sides.
    asked: WideLanes<S>,
    /// Lanes where none of this is unknown.
    known: u32,
}

impl OcclusionTest<'_> {
    /// Which balls lie behind splats that cover all their pixels, of those in `lanes`. Only where
    /// [`drops_nodes`](Self::drops_nodes) says so.
    #[inline(always)]
    pub(in crate::cut) fn are_behind<S: Simd>(
        &self,
        balls: &SphereLanes<WideLanes<S>>,
        lanes: u32,
    ) -> u32 {
        let lanes = lanes & !self.centers.are_within(balls, LEAST_PX);
        if lanes == 0 {
            return 0;
        }
        let lanes = lanes & self.centers.are_within(balls, MOST_PX);
        if lanes == 0 {
            return 0;
        }
        let bounds = self.bounds(balls);
        let own = 0..WideLanes::<S>::LANES;
        let mut ends = [[0; 16]; 4];
        for (list, end) in ends.iter_mut().zip(bounds.ends) {
            end.store_slice(&mut list[own.clone()]);
        }
        let mut asked = [0; 16];
        bounds.asked.store_bits(&mut asked[own]);
        let mut left = lanes & bounds.known;
        let mut behind = 0;
        while left != 0 {
            let lane = left.trailing_zeros() as usize % 16;
            left &= left - 1;
            let own = [0, 1, 2, 3].map(|i: usize| ends[i][lane]);
            behind |= u32::from(self.are_nearer(own, asked[lane])) << lane;
        }
        behind
    }

    /// Tells whether some pixels all have something nearer; not where there are none.
    #[inline(always)]
    fn are_nearer(&self, [left, right, top, bottom]: [u32; 4], asked: u32) -> bool {
        let (pixels, width) = (self.nearest.pixels.as_slice(), self.nearest.width);
        let is_nearer = |pixel: &AtomicU32| pixel.load(Ordering::Relaxed) < asked;
        // Of what is seen the middle mostly tells.
        let middle = (top + bottom) / 2 * width + (left + right) / 2;
        if left >= right || top >= bottom || !pixels.get(middle as usize).is_some_and(is_nearer) {
            return false;
        }
        (top..bottom).all(|row| {
            let own = (row * width + left) as usize..(row * width + right) as usize;
            pixels.get(own).is_some_and(|own| own.iter().all(is_nearer))
        })
    }

    /// Tells whether everything that is drawn of a ball's contents is hidden. The ball may have any size. A ball of radius r,
    /// seen at a distance of 1 at the tangent a from the middle, reaches r sqrt(1 + a²) / (1 - r²) to each side, from a middle that is a / (1 - r²) off.
    pub(in crate::cut) fn is_ball_hidden(&self, ball: &SphereLanes<Vec4>) -> bool {
        let [x, y] = self.centers.along(ball.center).map(|place| place.x);
        let (depth, radius) = (ball.depth.x, ball.radius.x);
        let nearest = (depth - radius) * NEARER;
        let (inverse, error) = if self.is_perspective {
            let error = nearest * nearest * self.depth_error + self.distance_error;
            (1.0 / depth, error)
        } else {
            (1.0, self.depth_error + self.distance_error)
        };
        let asked = nearest - self.near - error * WIDER;
        let off = inverse * self.centers.place_error + self.centers.snap_px;
        let ends = [x, y].map(|place| {
            let (place, r) = (place * inverse, radius * inverse);
            if !self.is_perspective {
                return [place - r, place + r];
            }
            let farther = 1.0 / (1.0 - r * r);
            let reach = r * (1.0 + place * place).sqrt() * farther * WIDER;
            [place * farther - reach, place * farther + reach]
        });
        let is_known = asked > 0.0 && (radius * inverse < 0.5 || !self.is_perspective);
        if !is_known || !self.footprints.hides {
            return false;
        }
        // Splats are around what is in it, and may be rounded up to whole pixels.
        let beside = off + self.outer_px + 1.0 + WIDER_PX;
        let pixels = |axis: usize| {
            let own =
                ends[axis].map(|end| end * self.centers.focal[axis] + self.centers.middle[axis]);
            let (low, high) = (own[0].min(own[1]) - beside, own[0].max(own[1]) + beside);
            let most = self.size[axis];
            [
                low.floor().clamp(0.0, most) as u32,
                high.ceil().clamp(0.0, most) as u32,
            ]
        };
        let ([left, right], [top, bottom]) = (pixels(0), pixels(1));
        self.are_nearer([left, right, top, bottom], asked.to_bits())
    }

    /// Where all is that lies in balls, and a splat of a pixel around any point of them, or a triangle of such points.
    #[inline(always)]
    fn bounds<S: Simd>(&self, balls: &SphereLanes<WideLanes<S>>) -> NodePixels<S> {
        let [x, y] = self.centers.along(balls.center);
        let nearest = (balls.depth - balls.radius) * NEARER;
        let ([x, y], radius, off, error) = if self.is_perspective {
            let inverse = x.all(1.0) / balls.depth;
            (
                [x * inverse, y * inverse],
                balls.radius * inverse,
                inverse * self.centers.place_error,
                nearest * nearest * self.depth_error + self.distance_error,
            )
        } else {
            (
                [x, y],
                balls.radius,
                x.all(self.centers.place_error),
                x.all(self.depth_error + self.distance_error),
            )
        };
        let off = off + self.centers.snap_px;
        let reach = self.centers.reach([x, y], radius, off) + off + self.outer_px;
        let reach = reach * WIDER + WIDER_PX;
        let asked = nearest - self.near - error * WIDER;
        let [width, height] = self.size;
        let x = x * self.centers.focal[0] + self.centers.middle[0];
        let y = y * self.centers.focal[1] + self.centers.middle[1];
        NodePixels {
            ends: [
                rounded(x - reach, width),
                rounded(x + reach, width),
                rounded(y - reach, height),
                rounded(y + reach, height),
            ],
            known: WideLanes::<S>::bits(asked.gt(x.all(0.0)) & reach.lt(x.all(width.max(height)))),
            asked,
        }
    }
}

/// Ends of intervals within the picture, as whole numbers of pixels: pixel i has its center at i + 1/2, so those of an interval
/// begin and end at its rounded ends.
#[inline(always)]
fn rounded<S: Simd>(end: WideLanes<S>, most: f32) -> S::u32s {
    low_bits(end.max(end.all(0.0)).min(end.all(most)) + 8_388_608.0)
}
