//! Patches in blocks of four by four pixels.
//!
//! A block may begin at any pixel, so that most small patches lie in one. Depth is compared before anything is shaded.

use super::PatchLight;
use super::set_up::{FORMS, PatchBatch};
use super::view::RasterView;
use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x16, i32x16, mask32x16, u32x4, u32x16};

/// Pixels of a side of a block.
pub(super) const SIDE: usize = 4;

/// Columns and rows of a block's pixels, their centers.
const COLUMNS: [f32; 16] = [
    0.5, 1.5, 2.5, 3.5, 0.5, 1.5, 2.5, 3.5, 0.5, 1.5, 2.5, 3.5, 0.5, 1.5, 2.5, 3.5,
];
const ROWS: [f32; 16] = [
    0.5, 0.5, 0.5, 0.5, 1.5, 1.5, 1.5, 1.5, 2.5, 2.5, 2.5, 2.5, 3.5, 3.5, 3.5, 3.5,
];

/// Coverage in a color: all.
const COVERED: i32 = 0xff << 24;

type Lanes<S> = f32x16<S>;

/// Rows of a rectangle of the picture that are drawn in, at least [`SIDE`] wide and high.
#[derive(Debug)]
pub(super) struct RasterBand<'a> {
    /// Colors, or numbers of patches; from a row to the next `pitch`.
    pub(super) words: &'a mut [u32],
    pub(super) pitch: usize,
    /// Reversed, row by row without gaps.
    pub(super) depths: &'a mut [f32],
    /// Left, top, and one past right and bottom, pixels of the picture.
    pub(super) rect_px: [usize; 4],
}

/// What pixels become.
#[derive(Debug, Clone, Copy)]
pub(super) enum BlockInk {
    /// Their color in the headlight.
    Lit(PatchLight),
    /// The number of the patch.
    Numbers,
}

/// One patch of a batch.
#[derive(Debug, Clone, Copy)]
pub(super) struct BatchLane<'a> {
    pub(super) batch: &'a PatchBatch,
    pub(super) lane: usize,
    /// Sides that it has.
    pub(super) sides: usize,
    /// Its number in the list.
    pub(super) number: u32,
}

/// Pixels of a block that a patch wins.
struct WonPixels<S: Simd> {
    mask: mask32x16<S>,
    /// From the middle of the patch, pixels.
    at: [Lanes<S>; 2],
    /// Change of the nearness from the middle, in the plane.
    change: Lanes<S>,
}

impl RasterBand<'_> {
    /// Draws a patch where it is nearest.
    #[inline(always)]
    pub(super) fn draw<S: Simd>(
        &mut self,
        simd: S,
        view: &RasterView,
        patch: BatchLane<'_>,
        ink: &BlockInk,
    ) {
        let [left, top, right, bottom] = patch.batch.pixels.each_ref().map(|row| row.0[patch.lane]);
        // What is no number is drawn nowhere.
        if !(left < right && top < bottom) {
            return;
        }
        let [left, top, right, bottom] = [left, top, right, bottom].map(|edge| edge as usize);
        let mut y = top;
        while y < bottom {
            // A block at the end begins sooner: what is outside of the patch stays what it is.
            let row = y.min(self.rect_px[3] - SIDE);
            let mut x = left;
            while x < right {
                let column = x.min(self.rect_px[2] - SIDE);
                self.block(simd, view, patch, [column, row], ink);
                x = column + SIDE;
            }
            y = row + SIDE;
        }
    }

    #[inline(always)]
    fn block<S: Simd>(
        &mut self,
        simd: S,
        view: &RasterView,
        patch: BatchLane<'_>,
        [column, row]: [usize; 2],
        ink: &BlockInk,
    ) {
        let BatchLane {
            batch,
            lane,
            sides,
            number,
        } = patch;
        let splat = |value: f32| Lanes::<S>::splat(simd, value);
        let [middle_x, middle_y] = batch.middle.each_ref().map(|row| row.0[lane]);
        let x = Lanes::<S>::from_slice(simd, &COLUMNS) + (column as f32 - middle_x);
        let y = Lanes::<S>::from_slice(simd, &ROWS) + (row as f32 - middle_y);
        let distance = |form: usize| {
            let [a, b, c] = batch.forms[form].each_ref().map(|row| row.0[lane]);
            x.mul_add(splat(a), y.mul_add(splat(b), splat(c)))
        };
        let mut inside_px = distance(FORMS - 2).min(distance(FORMS - 1));
        for side in 0..sides {
            inside_px = inside_px.min(distance(side));
        }
        let covered = inside_px.simd_ge(-batch.margin_px.0[lane]);
        if !covered.any_true() {
            return;
        }
        let own = batch.nearness.0[lane];
        let [slope_x, slope_y] = batch.slope.each_ref().map(|row| row.0[lane]);
        let [low, high] = batch.limits.each_ref().map(|row| row.0[lane]);
        let change = (x * slope_x + y * slope_y).max(low).min(high);
        let mut nearness = change + own;
        let beside = covered & inside_px.simd_lt(0.0);
        if beside.any_true() {
            let pushed = pushed_back(simd, view, batch.thickness.0[lane], nearness, inside_px);
            nearness = beside.select(pushed, nearness);
        }
        let [factor, added] = view.depth;
        // Nothing that is widened is out of the view.
        let depth = (nearness * factor + added).max(f32::MIN_POSITIVE).min(1.0);
        let [left, top, right, _] = self.rect_px;
        let width = right - left;
        let (down, aside) = (row - top, column - left);
        let at = |line: usize| (down + line) * width + aside;
        let front = four_rows(simd, |line| {
            f32x4::from_slice(simd, &self.depths[at(line)..at(line) + SIDE])
        });
        let mask = covered & depth.simd_gt(front);
        if !mask.any_true() {
            return;
        }
        let (low, high) = mask.select(depth, front).split();
        let ((a, b), (c, d)) = (low.split(), high.split());
        for (line, numbers) in [a, b, c, d].into_iter().enumerate() {
            numbers.store_slice(&mut self.depths[at(line)..at(line) + SIDE]);
        }
        let own: u32x16<S> = match ink {
            BlockInk::Lit(light) => {
                let won = WonPixels {
                    mask,
                    at: [x, y],
                    change,
                };
                lit(simd, view, light, patch, &won)
            }
            BlockInk::Numbers => u32x16::splat(simd, number),
        };
        let pitch = self.pitch;
        let at = |line: usize| (down + line) * pitch + aside;
        let words = |line: usize| u32x4::from_slice(simd, &self.words[at(line)..at(line) + SIDE]);
        let there = words(0)
            .combine(words(1))
            .combine(words(2).combine(words(3)));
        let (low, high) = mask.select(own, there).split();
        let ((a, b), (c, d)) = (low.split(), high.split());
        for (line, words) in [a, b, c, d].into_iter().enumerate() {
            words.store_slice(&mut self.words[at(line)..at(line) + SIDE]);
        }
    }
}

#[inline(always)]
fn four_rows<S: Simd>(_: S, row: impl Fn(usize) -> f32x4<S>) -> Lanes<S> {
    row(0).combine(row(1)).combine(row(2).combine(row(3)))
}

/// Nearness of what lies beside a footprint: farther by the thickness and by that, up to the far plane.
#[inline(always)]
fn pushed_back<S: Simd>(
    simd: S,
    view: &RasterView,
    thickness: f32,
    nearness: Lanes<S>,
    inside_px: Lanes<S>,
) -> Lanes<S> {
    let per_px = 1.0 / view.focal_px;
    if view.is_perspective {
        // 1 / (distance (1 + beside / f) + thickness)
        let one = Lanes::<S>::splat(simd, 1.0);
        (nearness / (one - inside_px * per_px + nearness * thickness)).max(1.0 / view.far)
    } else {
        (nearness - thickness + inside_px * per_px).max(-view.far)
    }
}

/// Colors in the headlight: red in the lowest byte, all covered.
#[inline(always)]
fn lit<S: Simd>(
    simd: S,
    view: &RasterView,
    light: &PatchLight,
    patch: BatchLane<'_>,
    won: &WonPixels<S>,
) -> u32x16<S> {
    let BatchLane { batch, lane, .. } = patch;
    let splat = |value: f32| Lanes::<S>::splat(simd, value);
    let (one, zero) = (splat(1.0), splat(0.0));
    let [x, y] = won.at;
    let over = match view.is_perspective {
        true => one / (won.change + batch.nearness.0[lane]),
        false => one,
    };
    let foot = |i: usize| {
        let [a, b, c] = batch.feet[i].each_ref().map(|row| row.0[lane]);
        let [low, high] = batch.extent[i].each_ref().map(|row| row.0[lane]);
        let along = x.mul_add(splat(a), y.mul_add(splat(b), won.change * c));
        (along * over).max(low).min(high)
    };
    let (u, v) = (foot(0), foot(1));
    let of = |rows: &[[super::set_up::LaneRow; 3]; 3], i: usize| {
        let [middle, along_u, along_v] = rows.each_ref().map(|rows| rows[i].0[lane]);
        u.mul_add(splat(along_u), v.mul_add(splat(along_v), splat(middle)))
    };
    let normal = [0, 1, 2].map(|i: usize| of(&batch.normal, i));
    let squared = normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2];
    let facing = if light.is_parallel {
        normal[2] / squared.sqrt()
    } else {
        let [ray_x, ray_y] = batch.ray.each_ref().map(|row| row.0[lane]);
        let to_x = -(x * view.ray_scale.x + ray_x);
        let to_y = -(y * view.ray_scale.y + ray_y);
        let long = to_x * to_x + (to_y * to_y + 1.0);
        (normal[0] * to_x + normal[1] * to_y + normal[2]) / (squared * long).sqrt()
    };
    let lambert = match light.is_two_sided {
        true => facing.abs(),
        false => facing.max(zero),
    };
    let share = batch.share.0[lane];
    let lambert = squared.simd_gt(0.0).select(lambert.min(one), one) * share;
    let channel = |i: usize| {
        let value = match light.has_colors {
            true => of(&batch.color, i).max(zero).min(one) * light.albedo[i],
            false => splat(light.albedo[i]),
        };
        let byte: i32x16<S> = ((value * lambert).min(1.0) * 255.0)
            .round_ties_even()
            .to_int();
        byte
    };
    let word = channel(0) | (channel(1) << 8) | (channel(2) << 16) | COVERED;
    word.bitcast()
}
