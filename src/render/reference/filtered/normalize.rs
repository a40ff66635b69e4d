//! The third pass of filtered splats: mean colors, and the coverage of what lies at a rim.

use crate::abi::constants::{
    FILTERED_AROUND_PX, FILTERED_JUMP, FILTERED_REACH_PX, LEAST_FILTERED_COVERAGE,
};
use crate::image::Image;
use crate::math::camera::View;
use crate::pack::PrimitiveStyle;
use crate::render::PictureOutputs;
use crate::render::reference::bands::{LEAST_ALPHA, ShownPixel, picture};
use crate::render::reference::filtered::FilteredPixel;
use glam::{DVec3, DVec4, IVec2};
use std::ops::RangeInclusive;

/// A pixel is covered when the sum of its weights is above this.
const LEAST_WEIGHT: f32 = 1e-6;

/// The picture of the sums.
pub(super) fn image(
    view: &View,
    style: &PrimitiveStyle,
    outputs: PictureOutputs,
    pixels: &[FilteredPixel],
) -> Image {
    let sums = FilteredSums {
        view,
        style,
        size: IVec2::new(view.width as i32, view.height as i32),
        jump_at_1: f64::from(FILTERED_JUMP * style.splat_size_px.max(1.0))
            / f64::from(view.focal_px()),
        pixels,
    };
    picture(view, outputs, |i| {
        (sums.shown(i)).unwrap_or_else(|| ShownPixel::background(style))
    })
}

/// The attachments after the second pass.
struct FilteredSums<'a> {
    view: &'a View,
    style: &'a PrimitiveStyle,
    size: IVec2,
    /// Difference of the distances of two parts at the distance 1, view-space units.
    jump_at_1: f64,
    pixels: &'a [FilteredPixel],
}

/// What the neighbors of a pixel are that do not belong to its part.
#[derive(Default)]
struct RimNeighbors {
    /// How many are empty, or of another part.
    count: f64,
    /// Sums over another part: of coverage, and of color times coverage.
    covered: f64,
    color: DVec3,
}

impl FilteredSums<'_> {
    /// What a pixel shows; `None` for the background.
    fn shown(&self, i: usize) -> Option<ShownPixel> {
        let pixel = &self.pixels[i];
        let (has_front, is_covered) = (!self.is_empty(i), self.is_covered(i));
        if !is_covered && !has_front {
            return None;
        }
        let part = if has_front {
            self.part_of(i)
        } else {
            0.0..=f64::INFINITY
        };
        let beside = self.rim_neighbors(i, *part.end());
        let is_rim = beside.count > 0.0 || !has_front;
        // Not even where the sum is no number.
        let is_something = pixel.sum.w >= LEAST_FILTERED_COVERAGE;
        if is_rim && !is_something && beside.covered == 0.0 {
            return None;
        }
        let (own, covered) = match (is_covered, is_rim) {
            (true, true) => (self.mean(i), f64::from(pixel.sum.w).min(1.0)),
            (true, false) => (self.mean(i), 1.0),
            // Between rectangles a rim has nothing of its own, else there is what is around.
            (false, true) => (DVec3::ZERO, 0.0),
            (false, false) => (self.mean_near(i, &part)?, 1.0),
        };
        // Behind a rim lies the mean of what is beside it.
        let background = DVec3::from(self.style.background.map(f64::from));
        let count = f64::max(beside.count, 1.0);
        let filled = beside.covered / count;
        let behind = beside.color / count + (1.0 - filled) * background;
        let alpha = covered + (1.0 - covered) * filled;
        let [r, g, b] = (own * covered + behind * (1.0 - covered)).to_array();
        Some(ShownPixel {
            color: [r, g, b, alpha.max(LEAST_ALPHA)],
            distance: self.view.distance_of_depth(pixel.surface),
            normal: [0.0; 3],
        })
    }

    fn is_covered(&self, i: usize) -> bool {
        self.pixels[i].sum.w > LEAST_WEIGHT
    }

    /// Without depth.
    fn is_empty(&self, i: usize) -> bool {
        let front = self.pixels[i].front;
        front <= 0.0 || front.is_nan()
    }

    /// The mean color of a covered pixel.
    fn mean(&self, i: usize) -> DVec3 {
        let sum = self.pixels[i].sum.as_dvec4();
        sum.truncate() / sum.w
    }

    fn distance(&self, i: usize) -> f64 {
        f64::from(self.view.distance_of_depth(self.pixels[i].front))
    }

    /// Distances of what belongs to the part of a pixel.
    fn part_of(&self, i: usize) -> RangeInclusive<f64> {
        let distance = self.distance(i);
        let jump = self.jump_at_1
            * if self.view.is_perspective {
                distance
            } else {
                1.0
            };
        distance - jump..=distance + jump
    }

    /// The pixel so many steps away; `None` beside the picture.
    fn at(&self, i: usize, steps: IVec2) -> Option<usize> {
        let width = self.size.x as usize;
        let at = IVec2::new((i % width) as i32, (i / width) as i32) + steps;
        let is_inside = at.cmpge(IVec2::ZERO).all() && at.cmplt(self.size).all();
        is_inside.then(|| at.y as usize * width + at.x as usize)
    }

    /// The neighbors of a pixel in the picture, of 8.
    fn neighbors(&self, i: usize) -> impl Iterator<Item = usize> {
        ring(1).filter_map(move |step| self.at(i, step))
    }

    /// Neighbors that are empty, or farther than the part of a pixel ends.
    fn rim_neighbors(&self, i: usize, end_of_part: f64) -> RimNeighbors {
        let mut rim = RimNeighbors::default();
        for j in self.neighbors(i) {
            if self.is_empty(j) {
                rim.count += 1.0;
            } else if self.distance(j) > end_of_part {
                rim.count += 1.0;
                if self.is_covered(j) {
                    // Whole, but where the part behind ends too.
                    let covered = if self.neighbors(j).any(|k| self.is_empty(k)) {
                        (2.0 * f64::from(self.pixels[j].sum.w)).min(1.0)
                    } else {
                        1.0
                    };
                    rim.covered += covered;
                    rim.color += covered * self.mean(j);
                }
            }
        }
        rim
    }

    /// The mean color of what the nearest pixels of a part deposited: in eight directions at growing distances, or else
    /// all around.
    fn mean_near(&self, i: usize, part: &RangeInclusive<f64>) -> Option<DVec3> {
        let along = fibonacci().take_while(|&reach| reach <= FILTERED_REACH_PX as i32);
        along
            .map(|reach| self.mean_over(i, part, ring(1).map(|step| reach * step)))
            .chain(
                (2..=FILTERED_AROUND_PX as i32).map(|reach| self.mean_over(i, part, ring(reach))),
            )
            .find_map(|mean| mean)
    }

    /// The mean color of those of some pixels that belong to a part; `None` where they deposited nothing.
    fn mean_over(
        &self,
        i: usize,
        part: &RangeInclusive<f64>,
        steps: impl Iterator<Item = IVec2>,
    ) -> Option<DVec3> {
        let mut sum = DVec4::ZERO;
        for j in steps.filter_map(|step| self.at(i, step)) {
            if !self.is_empty(j) && part.contains(&self.distance(j)) {
                sum += self.pixels[j].sum.as_dvec4();
            }
        }
        (sum.w > f64::from(LEAST_WEIGHT)).then(|| sum.truncate() / sum.w)
    }
}

/// Steps to the pixels whose distance along x or y, the larger of them, is `reach`: row by row.
fn ring(reach: i32) -> impl Iterator<Item = IVec2> {
    let rows = -reach..=reach;
    rows.flat_map(move |y| (-reach..=reach).map(move |x| IVec2::new(x, y)))
        .filter(move |step| step.abs().max_element() == reach)
}

/// 1, 2, 3, 5, 8, 13 and so on.
fn fibonacci() -> impl Iterator<Item = i32> {
    let pairs = std::iter::successors(Some([1, 1]), |&[reach, before]| {
        Some([reach + before, reach])
    });
    pairs.map(|[reach, _]| reach)
}
