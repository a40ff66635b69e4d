//! Patches in blocks of four by four pixels.
//!
//! A block may begin at any pixel, so that most small patches lie in one. Depth is compared before anything is shaded.

use super::PatchLight;
use super::set_up::{FORMS, LaneRow, PatchBatch};
use super::view::RasterView;
use crate::abi::constants::{OUTWARD_COSINE, RIM_MARGIN};
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
    /// Numbers of patches beside colors, row by row without gaps; empty where none are kept.
    pub(super) numbers: &'a mut [u32],
    /// Left, top, and one past right and bottom, pixels of the picture.
    pub(super) rect_px: [usize; 4],
}

/// Values that are written to the pixels of a patch.
#[derive(Debug, Clone, Copy)]
pub(super) enum BlockInk {
    /// Color of the pixels in the headlight.
    Lit(PatchLight),
    /// The number of the patch.
    Numbers,
}

/// One patch of a batch.
#[derive(Debug, Clone, Copy)]
pub(super) struct BatchLane<'a> {
    pub(super) batch: &'a PatchBatch,
    pub(super) lane: usize,
    /// Sides that it has, at least 3.
    pub(super) sides: usize,
    /// Number of the patch in the list.
    pub(super) number: u32,
}

/// Pixels of a block.
struct BlockPixels<S: Simd> {
    /// Column and row, counted from the middle of the patch, pixels.
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
        // Rounded once, so that no pixel depends on where its block begins.
        let x = Lanes::<S>::from_slice(simd, &COLUMNS) + column as f32;
        let y = Lanes::<S>::from_slice(simd, &ROWS) + row as f32;
        let Some(seen) = patch.seen_at(simd, view, [x, y]) else {
            return;
        };
        let SeenPlaces {
            covered,
            depth,
            pixels: won,
        } = seen;
        let [left, top, right, _] = self.rect_px;
        let width = right - left;
        let (down, aside) = (row - top, column - left);
        let at = |line: usize| (down + line) * width + aside;
        let front = (f32x4::from_slice(simd, four(self.depths, at(0))))
            .combine(f32x4::from_slice(simd, four(self.depths, at(1))))
            .combine(
                f32x4::from_slice(simd, four(self.depths, at(2)))
                    .combine(f32x4::from_slice(simd, four(self.depths, at(3)))),
            );
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
            BlockInk::Lit(light) => lit(simd, view, light, patch, &won),
            BlockInk::Numbers => u32x16::splat(simd, patch.number),
        };
        if !self.numbers.is_empty() {
            let number = u32x16::splat(simd, patch.number);
            put(simd, self.numbers, [at(0), width], (mask, number));
        }
        let first = down * self.pitch + aside;
        put(simd, self.words, [first, self.pitch], (mask, own));
    }
}

/// Writes words of a block where a mask is set: from a place on, rows so many words apart.
#[inline(always)]
fn put<S: Simd>(
    simd: S,
    words: &mut [u32],
    [first, pitch]: [usize; 2],
    (mask, own): (mask32x16<S>, u32x16<S>),
) {
    let [a, b, c, d] = [0, 1, 2, 3].map(|line| first + line * pitch);
    let there = (u32x4::from_slice(simd, four(words, a)))
        .combine(u32x4::from_slice(simd, four(words, b)))
        .combine(
            u32x4::from_slice(simd, four(words, c))
                .combine(u32x4::from_slice(simd, four(words, d))),
        );
    let (low, high) = mask.select(own, there).split();
    let (rows, below) = (low.split(), high.split());
    rows.0.store_slice(&mut words[a..a + SIDE]);
    rows.1.store_slice(&mut words[b..b + SIDE]);
    below.0.store_slice(&mut words[c..c + SIDE]);
    below.1.store_slice(&mut words[d..d + SIDE]);
}

/// Coverage and depth of a patch at sixteen places.
pub(super) struct SeenPlaces<S: Simd> {
    pub(super) covered: mask32x16<S>,
    /// Reversed.
    pub(super) depth: Lanes<S>,
    pixels: BlockPixels<S>,
}

impl BatchLane<'_> {
    /// Coverage and depth of the patch at places on the picture, pixels; `None` where it covers none of them.
    #[inline(always)]
    pub(super) fn seen_at<S: Simd>(
        &self,
        simd: S,
        view: &RasterView,
        [x, y]: [Lanes<S>; 2],
    ) -> Option<SeenPlaces<S>> {
        let (batch, lane, sides) = (self.batch, self.lane, self.sides);
        let [left, top, right, bottom] = &batch.bounds;
        // At sharp corners the forms alone reach beyond.
        let there = x.simd_ge(left.0[lane])
            & x.simd_le(right.0[lane])
            & y.simd_ge(top.0[lane])
            & y.simd_le(bottom.0[lane]);
        let at = [x - batch.middle[0].0[lane], y - batch.middle[1].0[lane]];
        let first_end = linear(simd, &batch.forms[FORMS - 2], lane, at);
        let inside_px = first_end.min(linear(simd, &batch.forms[FORMS - 1], lane, at));
        // The last side leads from the corner that is repeated to the first.
        let last_side = linear(simd, &batch.forms[FORMS - 3], lane, at);
        let mut inside_px = inside_px.min(last_side);
        for form in &batch.forms[..sides - 1] {
            inside_px = inside_px.min(linear(simd, form, lane, at));
        }
        let covered = there & inside_px.simd_ge(-batch.margin_px.0[lane]);
        covered
            .any_true()
            .then(|| self.seen_of(simd, view, at, (covered, inside_px)))
    }

    /// Coverage and depth of the patch if only sides that face along a direction bound it: it goes on without end the other way.
    #[inline(always)]
    pub(super) fn seen_with_outer_sides<S: Simd>(
        &self,
        simd: S,
        view: &RasterView,
        [x, y]: [Lanes<S>; 2],
        outward: [f32; 2],
    ) -> SeenPlaces<S> {
        let (batch, lane, sides) = (self.batch, self.lane, self.sides);
        let at = [x - batch.middle[0].0[lane], y - batch.middle[1].0[lane]];
        let mut inside_px = Lanes::<S>::splat(simd, f32::INFINITY);
        for index in (0..sides - 1).chain(FORMS - 3..FORMS) {
            let form = &batch.forms[index];
            let inward = form[0].0[lane] * outward[0] + form[1].0[lane] * outward[1];
            if inward < -OUTWARD_COSINE {
                inside_px = inside_px.min(linear(simd, form, lane, at));
            }
        }
        let covered = inside_px.simd_ge(-batch.margin_px.0[lane] * RIM_MARGIN);
        self.seen_of(simd, view, at, (covered, inside_px))
    }

    /// Depth at places, counted from the middle, by how far inside they are.
    #[inline(always)]
    fn seen_of<S: Simd>(
        &self,
        simd: S,
        view: &RasterView,
        [x, y]: [Lanes<S>; 2],
        (covered, inside_px): (mask32x16<S>, Lanes<S>),
    ) -> SeenPlaces<S> {
        let (batch, lane) = (self.batch, self.lane);
        let own = batch.nearness.0[lane];
        let (slope_x, slope_y) = (batch.slope[0].0[lane], batch.slope[1].0[lane]);
        let (low, high) = (batch.limits[0].0[lane], batch.limits[1].0[lane]);
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
        let pixels = BlockPixels { at: [x, y], change };
        SeenPlaces {
            covered,
            depth,
            pixels,
        }
    }
}

/// Pixels of a row of a block.
#[inline(always)]
fn four<T>(all: &[T], at: usize) -> &[T] {
    &all[at..at + SIDE]
}

// Functions, as what closures do need not be compiled for the vectors of the function that they are in.

/// A linear form at places counted from the middle of a patch.
#[inline(always)]
fn linear<S: Simd>(simd: S, form: &[LaneRow; 3], lane: usize, [x, y]: [Lanes<S>; 2]) -> Lanes<S> {
    let splat = Lanes::<S>::splat(simd, form[1].0[lane]);
    let rest = y.mul_add(splat, Lanes::<S>::splat(simd, form[2].0[lane]));
    x.mul_add(Lanes::<S>::splat(simd, form[0].0[lane]), rest)
}

/// Sum of two coordinates of a plane, each times its change.
#[inline(always)]
fn along<S: Simd>(
    simd: S,
    rows: &[[LaneRow; 3]; 3],
    (part, lane): (usize, usize),
    [u, v]: [Lanes<S>; 2],
) -> Lanes<S> {
    let middle = Lanes::<S>::splat(simd, rows[0][part].0[lane]);
    let along_v = v.mul_add(Lanes::<S>::splat(simd, rows[2][part].0[lane]), middle);
    u.mul_add(Lanes::<S>::splat(simd, rows[1][part].0[lane]), along_v)
}

/// A coordinate in the plane.
#[inline(always)]
fn foot<S: Simd>(
    simd: S,
    batch: &PatchBatch,
    (axis, lane): (usize, usize),
    pixels: &BlockPixels<S>,
    over: Lanes<S>,
) -> Lanes<S> {
    let [a, b, c] = &batch.feet[axis];
    let [x, y] = pixels.at;
    let rest = y.mul_add(
        Lanes::<S>::splat(simd, b.0[lane]),
        pixels.change * c.0[lane],
    );
    let along = x.mul_add(Lanes::<S>::splat(simd, a.0[lane]), rest) * over;
    let [low, high] = &batch.extent[axis];
    along.max(low.0[lane]).min(high.0[lane])
}

/// A channel as a byte.
#[inline(always)]
fn byte<S: Simd>(
    simd: S,
    light: &PatchLight,
    patch: BatchLane<'_>,
    part: usize,
    (at, lambert): ([Lanes<S>; 2], Lanes<S>),
) -> i32x16<S> {
    let mut value = lambert * light.albedo[part];
    if light.has_colors {
        let own = along(simd, &patch.batch.color, (part, patch.lane), at);
        value *= own.max(0.0).min(1.0);
    }
    (value.min(1.0) * 255.0).round_ties_even().to_int()
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
    won: &BlockPixels<S>,
) -> u32x16<S> {
    let BatchLane { batch, lane, .. } = patch;
    let one = Lanes::<S>::splat(simd, 1.0);
    let [x, y] = won.at;
    let over = match view.is_perspective {
        true => one / (won.change + batch.nearness.0[lane]),
        false => one,
    };
    let at = [
        foot(simd, batch, (0, lane), won, over),
        foot(simd, batch, (1, lane), won, over),
    ];
    let normal = [
        along(simd, &batch.normal, (0, lane), at),
        along(simd, &batch.normal, (1, lane), at),
        along(simd, &batch.normal, (2, lane), at),
    ];
    let squared = normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2];
    let facing = if light.is_parallel {
        normal[2] / squared.sqrt()
    } else {
        let (ray_x, ray_y) = (batch.ray[0].0[lane], batch.ray[1].0[lane]);
        let to_x = -(x * view.ray_scale.x + ray_x);
        let to_y = -(y * view.ray_scale.y + ray_y);
        let long = to_x * to_x + (to_y * to_y + 1.0);
        (normal[0] * to_x + normal[1] * to_y + normal[2]) / (squared * long).sqrt()
    };
    let lambert = match light.is_two_sided {
        true => facing.abs(),
        false => facing.max(0.0),
    };
    let share = batch.share.0[lane];
    let lambert = squared.simd_gt(0.0).select(lambert.min(one), one) * share;
    let what = (at, lambert);
    let red = byte(simd, light, patch, 0, what);
    let green = byte(simd, light, patch, 1, what);
    let blue = byte(simd, light, patch, 2, what);
    (red | (green << 8) | (blue << 16) | COVERED).bitcast()
}
