//! Rules by which pixels at the rims of patches are found and sampled, the same for all that draws them.

use crate::abi::constants::RIM_STRAIGHT_PX;
use crate::math::camera::View;
use glam::Vec2;

/// Samples of a pixel.
pub(crate) const RIM_SAMPLES: usize = 16;

/// Sixteenths of a pixel from its left and top to its samples: those of sixteen samples in the Vulkan specification.
const STEPS: [[u8; 2]; RIM_SAMPLES] = [
    [9, 9],
    [7, 5],
    [5, 10],
    [12, 7],
    [3, 6],
    [10, 13],
    [13, 11],
    [11, 3],
    [6, 14],
    [8, 1],
    [4, 2],
    [2, 12],
    [0, 8],
    [15, 4],
    [14, 15],
    [1, 0],
];

/// Columns, and rows, of samples in a pixel: moved by a half step, so that their mean is the center.
pub(crate) const RIM_PLACES: [[f32; RIM_SAMPLES]; 2] = {
    let mut places = [[0.0; RIM_SAMPLES]; 2];
    let mut i = 0;
    while i < RIM_SAMPLES {
        places[0][i] = (STEPS[i][0] as f32 + 0.5) / 16.0;
        places[1][i] = (STEPS[i][1] as f32 + 0.5) / 16.0;
        i += 1;
    }
    places
};

/// Columns and rows from a pixel to itself and its neighbors: the first that shows a patch lends its color.
pub(crate) const AROUND: [[i32; 2]; 9] = [
    [0, 0],
    [-1, 0],
    [1, 0],
    [0, -1],
    [0, 1],
    [-1, -1],
    [1, -1],
    [-1, 1],
    [1, 1],
];

/// Direction on the picture in which depths fall around a pixel; unit. `None` where they fall to several sides, by more than half.
/// `steps` are columns and rows to its neighbors, with what reversed depths are less there.
pub(crate) fn outward_direction(steps: impl Iterator<Item = (Vec2, f32)>) -> Option<Vec2> {
    let (mut sum, mut all) = (Vec2::ZERO, 0.0);
    for (step, fall) in steps.filter(|(step, _)| *step != Vec2::ZERO) {
        sum += step * (fall / step.length_squared());
        all += fall.abs() / step.length();
    }
    let is_one_way = sum.length_squared() >= 0.25 * all * all && all > 0.0;
    is_one_way.then(|| sum.normalize())
}

/// Limit of how far the reversed depth of a pixel may be from the mean of those on both sides: in a plane they go on straight.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StraightDepth {
    /// Share of the depth that counts towards the limit.
    times: f32,
    /// Part of the limit that is the same at all depths.
    plus: f32,
}

impl StraightDepth {
    pub(crate) fn new(view: &View) -> Self {
        let clip = view.clip_from_view();
        // Twice, as the sum of both sides is compared.
        let per_px = 2.0 * RIM_STRAIGHT_PX / view.focal_px();
        match view.is_perspective {
            // 1 / distance, times the width of a pixel over the distance.
            true => Self {
                times: per_px,
                plus: clip.z_axis.z * per_px,
            },
            false => Self {
                times: 0.0,
                plus: clip.z_axis.z.abs() * per_px,
            },
        }
    }

    /// Tells whether depths on both sides of one do not go on straight.
    #[inline(always)]
    pub(crate) fn is_broken(self, [before, own, after]: [f32; 3]) -> bool {
        (before + after - 2.0 * own).abs() > self.times * own + self.plus
    }
}
