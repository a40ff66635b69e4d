//! The third pass: sums become colors. The rule is that of `shaders/common/normalize.glsl`, which explains it; most pixels
//! lie inside of a surface, where it is one division, and those go row by row.

use crate::abi::FrameConstants;
use crate::abi::constants::{
    COARSE_STEPS, FILTERED_AROUND_PX, FILTERED_JUMP, FILTERED_REACH_PX, FINE_STEPS,
    FLAG_ORTHOGRAPHIC, LEAST_FILTERED_COVERAGE,
};
use crate::pack::parallel;
use crate::render::cpu::filtered::PictureArea;
use crate::render::cpu::float_planes::word_of;
use fearless_simd::{Level, Simd, dispatch};
use glam::{Vec3, Vec4};

/// Weights up to this are nothing.
const LEAST_WEIGHT: f32 = 1e-6;

/// Rows that one thread takes at a time.
const ROWS: usize = 16;

/// What turns depths into distances and back, and what lies behind everything.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NormalizeParams {
    background: Vec3,
    /// Of the clip space: factor of z and what is added to depth.
    p22: f32,
    p32: f32,
    is_orthographic: bool,
    /// Step of distance that parts another surface off, at distance 1 in perspective.
    jump: f32,
}

impl NormalizeParams {
    /// Parameters of a frame.
    pub(crate) fn new(frame: &FrameConstants) -> Self {
        let [red, green, blue, _] = frame.background;
        Self {
            background: Vec3::new(red, green, blue),
            p22: frame.clip_from_view[2][2],
            p32: frame.clip_from_view[3][2],
            is_orthographic: frame.flags & FLAG_ORTHOGRAPHIC != 0,
            jump: FILTERED_JUMP * frame.splat_size_px.max(1.0) / frame.focal_px,
        }
    }

    #[inline(always)]
    fn distance_of(&self, depth: f32) -> f32 {
        match self.is_orthographic {
            true => (self.p32 - depth) / self.p22,
            false => self.p32 / (depth + self.p22),
        }
    }

    #[inline(always)]
    fn depth_of(&self, distance: f32) -> f32 {
        match self.is_orthographic {
            true => self.p32 - self.p22 * distance,
            false => self.p32 / distance - self.p22,
        }
    }

    /// Step of distance to another part, from a pixel at a distance.
    #[inline(always)]
    fn jump_at(&self, distance: f32) -> f32 {
        self.jump * if self.is_orthographic { 1.0 } else { distance }
    }

    /// Least depth of the part that a pixel of depth `own`, not 0, belongs to.
    #[inline(always)]
    fn farthest_of_part(&self, own: f32) -> f32 {
        let distance = self.distance_of(own);
        self.depth_of(distance + self.jump_at(distance))
    }

    /// Largest depth of it.
    fn nearest_of_part(&self, own: f32) -> f32 {
        let distance = self.distance_of(own);
        let jump = self.jump_at(distance);
        match distance > jump {
            true => self.depth_of(distance - jump),
            false => 1.0,
        }
    }
}

/// Depths and sums that the first two passes left in a canvas.
struct PassResults<'a> {
    front: &'a [u32],
    sums: &'a [u64],
    width: usize,
    height: usize,
    is_gray: bool,
}

/// A pixel of a picture that sums become.
pub(crate) trait NormalizedPixel: Copy + Send {
    /// Pixel of a color with its coverage.
    fn of(color: Vec4) -> Self;
}

/// Red in the lowest byte, coverage in the highest.
impl NormalizedPixel for u32 {
    #[inline(always)]
    fn of(color: Vec4) -> Self {
        word_of(color)
    }
}

/// Red, green, blue and coverage, not rounded.
impl NormalizedPixel for [f32; 4] {
    #[inline(always)]
    fn of(color: Vec4) -> Self {
        color.clamp(Vec4::ZERO, Vec4::ONE).to_array()
    }
}

/// Colors and depths of the canvas, which lies in a larger picture.
pub(crate) struct NormalizedPicture<'a, P> {
    /// From the first pixel of the canvas on.
    pub(crate) colors: &'a mut [P],
    /// From a row of colors to the next, pixels.
    pub(crate) pitch: usize,
    /// Reversed; 0 where nothing is. Row by row.
    pub(crate) depths: &'a mut [f32],
}

/// Turns sums into colors and depths.
///
/// # Panics
/// When the picture, `front` or `sums` is smaller than the canvas.
pub(crate) fn normalize<P: NormalizedPixel>(
    canvas: PictureArea,
    params: &NormalizeParams,
    front: &[u32],
    sums: &[u64],
    picture: NormalizedPicture<'_, P>,
) {
    let (width, pixels) = (canvas.width(), canvas.pixels());
    if pixels == 0 {
        return;
    }
    let results = &PassResults {
        front: &front[..pixels],
        sums: &sums[..pixels * canvas.words()],
        width,
        height: pixels / width,
        is_gray: canvas.is_gray,
    };
    let pitch = picture.pitch;
    let behind = (results.height - 1) * pitch + width;
    let colors = picture.colors[..behind].chunks_mut(ROWS * pitch);
    let bands = colors.zip(picture.depths[..pixels].chunks_mut(ROWS * width));
    let level = Level::new();
    // A pixel takes about as long as the record of a list.
    parallel::share(pixels, bands.enumerate(), |(number, (colors, depths))| {
        let rows = colors.chunks_mut(pitch).zip(depths.chunks_mut(width));
        dispatch!(level, simd => for (row, (colors, depths)) in rows.enumerate() {
            let y = number * ROWS + row;
            let colors = &mut colors[..width];
            match results.is_gray {
                true => row_of::<_, P, true>(simd, results, params, y, (colors, depths)),
                false => row_of::<_, P, false>(simd, results, params, y, (colors, depths)),
            }
        });
    });
}

/// A row. Inside of a surface it is written at once; other pixels are looked at one by one.
#[inline(always)]
fn row_of<S: Simd, P: NormalizedPixel, const GRAY: bool>(
    _: S,
    results: &PassResults<'_>,
    params: &NormalizeParams,
    y: usize,
    (colors, depths): (&mut [P], &mut [f32]),
) {
    let width = results.width;
    let row = |y: usize| &results.front[y * width..][..width];
    let (above, own, below) = (
        row(y.saturating_sub(1)),
        row(y),
        row((y + 1).min(results.height - 1)),
    );
    let words = if GRAY { 2 } else { 4 };
    let sums = &results.sums[y * width * words..][..width * words];
    let background = P::of(params.background.extend(0.0));
    // Depths are not negative, so as bits they are ordered as they are.
    let least = |x: usize| above[x].min(own[x]).min(below[x]);
    for x in 0..width {
        let around = least(x.saturating_sub(1))
            .min(least(x))
            .min(least((x + 1).min(width - 1)));
        let depth = f32::from_bits(own[x]);
        depths[x] = depth;
        let sum = sum_of::<GRAY>(&sums[words * x..][..words]);
        let is_inside = around > 0
            && sum.w > LEAST_WEIGHT
            && f32::from_bits(around) >= params.farthest_of_part(depth);
        colors[x] = if is_inside {
            P::of((sum.truncate() / sum.w).extend(1.0))
        } else if own[x] == 0 && sum.w <= LEAST_WEIGHT {
            background
        } else {
            P::of(results.at_rim::<GRAY>(params, [x as i32, y as i32], depth, sum))
        };
    }
}

/// Sums of color times weight, and of weights.
#[inline(always)]
fn sum_of<const GRAY: bool>(words: &[u64]) -> Vec4 {
    const COARSE: f32 = 1.0 / COARSE_STEPS;
    const FINE: f32 = 1.0 / FINE_STEPS;
    let low = |word: u64| (word & 0xffff_ffff) as u32 as f32;
    let high = |word: u64| (word >> 32) as u32 as f32;
    if GRAY {
        let color = low(words[0]) * COARSE + low(words[1]) * FINE;
        let weight = high(words[0]) * COARSE + high(words[1]) * FINE;
        return Vec4::new(color, color, color, weight);
    }
    Vec4::new(
        low(words[0]) * COARSE + low(words[2]) * FINE,
        high(words[0]) * COARSE + high(words[2]) * FINE,
        low(words[1]) * COARSE + low(words[3]) * FINE,
        high(words[1]) * COARSE + high(words[3]) * FINE,
    )
}

impl PassResults<'_> {
    fn is_known(&self, [x, y]: [i32; 2]) -> bool {
        (0..self.width as i32).contains(&x) && (0..self.height as i32).contains(&y)
    }

    fn index(&self, [x, y]: [i32; 2]) -> usize {
        y as usize * self.width + x as usize
    }

    fn front_at(&self, pixel: [i32; 2]) -> f32 {
        f32::from_bits(self.front[self.index(pixel)])
    }

    fn sum_at<const GRAY: bool>(&self, pixel: [i32; 2]) -> Vec4 {
        let words = if GRAY { 2 } else { 4 };
        sum_of::<GRAY>(&self.sums[words * self.index(pixel)..][..words])
    }

    /// Covered fraction of a pixel that another part lies before: whole, but where that part ends too.
    fn coverage_of_part(&self, pixel: [i32; 2], sum: f32) -> f32 {
        let mut around = (-1..=1).flat_map(|y| (-1..=1).map(move |x| [x, y]));
        let is_empty = |[x, y]: [i32; 2]| {
            let neighbor = [pixel[0] + x, pixel[1] + y];
            self.is_known(neighbor) && self.front_at(neighbor) <= 0.0
        };
        match around.any(is_empty) {
            true => (2.0 * sum).min(1.0),
            false => 1.0,
        }
    }

    /// Sum of what pixels near by of the same part deposited, whose depths lie in a range: in eight directions first, then in
    /// squares all around.
    fn sum_near<const GRAY: bool>(&self, pixel: [i32; 2], part: [f32; 2]) -> Vec4 {
        let mut sum = Vec4::ZERO;
        let mut add = |at: [i32; 2]| {
            let neighbor = [pixel[0] + at[0], pixel[1] + at[1]];
            if self.is_known(neighbor) {
                let depth = self.front_at(neighbor);
                if depth >= part[0] && depth <= part[1] {
                    sum += self.sum_at::<GRAY>(neighbor);
                }
            }
            sum.w > LEAST_WEIGHT
        };
        let (mut reach, mut before) = (1, 1);
        while reach <= FILTERED_REACH_PX as i32 {
            let mut is_found = false;
            for at in square(reach, reach) {
                is_found = add(at);
            }
            if is_found {
                return sum;
            }
            (reach, before) = (reach + before, reach);
        }
        for reach in 2..=FILTERED_AROUND_PX as i32 {
            let mut is_found = false;
            for at in square(reach, 1) {
                is_found = add(at);
            }
            if is_found {
                return sum;
            }
        }
        sum
    }

    /// The color of a pixel that is not simply inside of a surface.
    #[cold]
    #[inline(never)]
    fn at_rim<const GRAY: bool>(
        &self,
        params: &NormalizeParams,
        pixel: [i32; 2],
        own: f32,
        mut sum: Vec4,
    ) -> Vec4 {
        let nothing = params.background.extend(0.0);
        let is_between = sum.w <= LEAST_WEIGHT;
        if is_between && own <= 0.0 {
            return nothing;
        }
        // Where the pixel has no depth nothing is another part.
        let part = match own > 0.0 {
            true => [params.farthest_of_part(own), params.nearest_of_part(own)],
            false => [0.0, 1.0],
        };
        let (mut around, mut behind) = (0.0, Vec4::ZERO);
        for at in square(1, 1) {
            let neighbor = [pixel[0] + at[0], pixel[1] + at[1]];
            if !self.is_known(neighbor) {
                continue;
            }
            let depth = self.front_at(neighbor);
            let is_part = depth > 0.0 && depth < part[0];
            if is_part || depth <= 0.0 {
                around += 1.0;
            }
            if is_part {
                let there = self.sum_at::<GRAY>(neighbor);
                if there.w > LEAST_WEIGHT {
                    let coverage = self.coverage_of_part(neighbor, there.w);
                    behind += (there.truncate() / there.w).extend(1.0) * coverage;
                }
            }
        }
        let is_rim = own <= 0.0 || around > 0.0;
        if is_rim && sum.w < LEAST_FILTERED_COVERAGE && behind.w == 0.0 {
            return nothing;
        }
        if is_between {
            // At a rim nothing, else what is around.
            sum = match is_rim {
                true => Vec4::ZERO,
                false => self.sum_near::<GRAY>(pixel, part),
            };
            if !is_rim && sum.w <= LEAST_WEIGHT {
                return nothing;
            }
        }
        let covered = if is_rim { sum.w.min(1.0) } else { 1.0 };
        let mut beyond = behind / f32::max(around, 1.0);
        beyond += ((1.0 - beyond.w) * params.background).extend(0.0);
        let alpha = covered + (1.0 - covered) * beyond.w;
        let color = match sum.w > 0.0 {
            true => sum.truncate() / sum.w,
            false => Vec3::ZERO,
        };
        let mixed = beyond.truncate() * (1.0 - covered) + color * covered;
        // At least one level of coverage where anything is.
        mixed.extend(alpha.max(1.0 / 255.0))
    }
}

/// Places around a square of side 2 `reach`, `step` apart, from its first corner to the right and around, as the shader goes.
fn square(reach: i32, step: i32) -> impl Iterator<Item = [i32; 2]> {
    let count = 8 * reach / step;
    let mut at = [-reach, -reach];
    let mut along = [step, 0];
    (0..count).map(move |_| {
        let here = at;
        at = [at[0] + along[0], at[1] + along[1]];
        if at[0].abs() == at[1].abs() {
            along = [-along[1], along[0]];
        }
        here
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_is_gone_around_once() {
        for (reach, step) in [(1, 1), (3, 3), (3, 1), (2, 1)] {
            let places: Vec<[i32; 2]> = square(reach, step).collect();
            assert_eq!(places.len(), (8 * reach / step) as usize);
            let own: std::collections::BTreeSet<_> = places.iter().collect();
            assert_eq!(own.len(), places.len(), "{reach} {step}");
            assert!(places.iter().all(|[x, y]| x.abs().max(y.abs()) == reach));
        }
    }
}
