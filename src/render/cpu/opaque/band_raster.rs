//! A band of rows of the picture: what the nearest splat of each of its pixels shows.

use crate::render::cpu::opaque::ShownRectangle;
use crate::render::cpu::opaque::bands::{PlacedSplats, SPLAT_BIT};
use crate::render::cpu::opaque::ovals::OvalOutline;
use crate::render::cpu::opaque::pixel_lists::FoundPixels;
use crate::render::cpu::opaque::splat_bounds::{GROUP, Numbers, RoundPixels, both};
use fearless_simd::prelude::*;
use fearless_simd::{f32x4, i32x4, mask32x4};

/// Depth of the nearest of each pixel of a band, and what it shows, kept for its memory.
#[derive(Debug, Default)]
pub(super) struct BandFronts {
    depth: Vec<f32>,
    shown: Vec<i32>,
}

/// So many pixels of a row are written at a time.
const STEP: usize = 4;

/// As many at most, of wide squares. There is room for as many beyond a row's end.
const WIDE: usize = 16;

/// A band that is drawn in.
pub(super) struct DrawnBand<'a> {
    depth: &'a mut [f32],
    shown: &'a mut [i32],
    width: usize,
    /// From a row to the next.
    stride: usize,
    /// First row of the band, and one past its last.
    pub(crate) rows: [usize; 2],
}

impl BandFronts {
    /// An empty band of these rows, of so many pixels each.
    pub(super) fn band(&mut self, width: usize, rows: [usize; 2]) -> DrawnBand<'_> {
        let stride = width + WIDE;
        let words = stride * (rows[1] - rows[0]);
        self.depth.resize(words, 0.0);
        self.shown.resize(words, 0);
        self.depth.fill(0.0);
        DrawnBand {
            depth: &mut self.depth,
            shown: &mut self.shown,
            width,
            stride,
            rows,
        }
    }
}

/// Which of four lanes are the first so many.
const LANES: [[i32; 4]; 5] = [
    [0, 0, 0, 0],
    [-1, 0, 0, 0],
    [-1, -1, 0, 0],
    [-1, -1, -1, 0],
    [-1, -1, -1, -1],
];

/// Numbers of lanes.
const LANE: [f32; WIDE] = [
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
];

impl DrawnBand<'_> {
    /// Draws what of a list is in the band. Lists come in the order of their numbers, so of equal depths the first stays. Shown are
    /// the colors of splats, or where these are not known what compute has in its keys, of the number in the list.
    #[inline(always)]
    pub(super) fn draw<S: Simd>(&mut self, simd: S, list: &PlacedSplats<'_>, has_colors: bool) {
        let [first_row, end_row] = self.rows;
        for group in list.groups {
            let [first, end] = group.rows.map(usize::from);
            if first >= end_row || end <= first_row {
                continue;
            }
            let range = group.first as usize..group.first as usize + usize::from(group.count);
            let number = list.first + group.first;
            let numbers: [i32; GROUP];
            let pixels = FoundPixels {
                first: &list.pixels.first[range.clone()],
                end: &list.pixels.end[range.clone()],
                depth: &list.pixels.depth[range.clone()],
                shown: match has_colors {
                    true => &list.pixels.shown[range.clone()],
                    false => {
                        numbers = keys_from(number);
                        &numbers[..range.len()]
                    }
                },
            };
            if list.are_samples {
                self.samples(pixels);
            } else if !list.ovals.is_empty() {
                self.ovals(simd, pixels, &list.ovals[range]);
            } else if list.rounds.is_empty() {
                self.squares(simd, pixels);
            } else {
                self.discs(simd, pixels, &list.rounds[range]);
            }
        }
    }

    /// Squares of a pixel.
    #[inline(always)]
    fn samples(&mut self, pixels: FoundPixels<'_>) {
        let [first_row, end_row] = self.rows;
        let own = pixels.first.iter().zip(pixels.depth);
        for ((&first, &depth), &shown) in own.zip(pixels.shown) {
            let [x, y] = both(first);
            if (first_row..end_row).contains(&y) {
                let at = (y - first_row) * self.stride + x;
                let (front, nearest) = (&mut self.depth[at], &mut self.shown[at]);
                let is_nearer = depth > *front;
                *nearest = if is_nearer { shown } else { *nearest };
                *front = if is_nearer { depth } else { *front };
            }
        }
    }

    #[inline(always)]
    fn squares<S: Simd>(&mut self, simd: S, pixels: FoundPixels<'_>) {
        let [first_row, end_row] = self.rows;
        let own = pixels.first.iter().zip(pixels.end).zip(pixels.depth);
        for (((&first, &end), &depth), &shown) in own.zip(pixels.shown) {
            let ([left, top], [right, bottom]) = (both(first), both(end));
            if right > left + STEP {
                let corners = [[left, top], [right, bottom]];
                self.wide(simd, corners, None, (depth, shown));
                continue;
            }
            let depth = f32x4::splat(simd, depth);
            let shown = i32x4::splat(simd, shown);
            for y in top.max(first_row)..bottom.min(end_row) {
                let mut at = (y - first_row) * self.stride + left;
                let mut rest = right - left;
                while rest > 0 {
                    let is_in = i32x4::from_slice(simd, &LANES[rest.min(STEP)]).simd_lt(0);
                    self.leave(simd, at, is_in, depth, shown);
                    at += STEP;
                    rest = rest.saturating_sub(STEP);
                }
            }
        }
    }

    /// A square, or what is round of it, of more than a few columns, by vectors as wide as there are.
    #[inline(always)]
    fn wide<S: Simd>(
        &mut self,
        simd: S,
        [[left, top], [right, bottom]]: [[usize; 2]; 2],
        round: Option<&RoundPixels>,
        (depth, shown): (f32, i32),
    ) {
        let [first_row, end_row] = self.rows;
        let step = Numbers::<S>::LEN;
        let depth = Numbers::<S>::splat(simd, depth);
        let shown = S::i32s::splat(simd, shown);
        let end = Numbers::<S>::splat(simd, (right - left) as f32);
        let lanes = Numbers::<S>::from_slice(simd, &LANE[..step]);
        for y in top.max(first_row)..bottom.min(end_row) {
            let mut at = (y - first_row) * self.stride + left;
            let mut x = lanes;
            for _ in (left..right).step_by(step) {
                let mut is_in = x.simd_lt(end);
                if let Some(&RoundPixels { form, to_first }) = round {
                    let from_y = to_first[1] + (y - top) as f32;
                    let from_x = x + to_first[0];
                    let squared = from_x * form * from_x + form * from_y * from_y;
                    is_in &= squared.simd_le(1.0);
                }
                self.leave_wide(simd, at, is_in, depth, shown);
                at += step;
                x += step as f32;
            }
        }
    }

    #[inline(always)]
    fn discs<S: Simd>(&mut self, simd: S, pixels: FoundPixels<'_>, rounds: &[RoundPixels]) {
        let [first_row, end_row] = self.rows;
        let own = pixels.first.iter().zip(pixels.end).zip(pixels.depth);
        for ((((&first, &end), &depth), round), &shown) in own.zip(rounds).zip(pixels.shown) {
            let ([left, top], [right, bottom]) = (both(first), both(end));
            if right > left + STEP {
                let corners = [[left, top], [right, bottom]];
                self.wide(simd, corners, Some(round), (depth, shown));
                continue;
            }
            let depth = f32x4::splat(simd, depth);
            let shown = i32x4::splat(simd, shown);
            let RoundPixels { form, to_first } = *round;
            for y in top.max(first_row)..bottom.min(end_row) {
                let from_y = to_first[1] + (y - top) as f32;
                let of_y = form * from_y * from_y;
                let mut at = (y - first_row) * self.stride + left;
                let mut rest = right - left;
                let mut x = f32x4::from_slice(simd, &[0.0, 1.0, 2.0, 3.0]);
                while rest > 0 {
                    let from_x = x + to_first[0];
                    let is_round = (from_x * form * from_x + of_y).simd_le(1.0);
                    let is_in = i32x4::from_slice(simd, &LANES[rest.min(STEP)]).simd_lt(0);
                    self.leave(simd, at, is_in & is_round, depth, shown);
                    at += STEP;
                    x += STEP as f32;
                    rest = rest.saturating_sub(STEP);
                }
            }
        }
    }

    /// Discs in the plane of the surface.
    #[inline(always)]
    fn ovals<S: Simd>(&mut self, simd: S, pixels: FoundPixels<'_>, ovals: &[OvalOutline]) {
        let [first_row, end_row] = self.rows;
        let step = Numbers::<S>::LEN;
        let lanes = Numbers::<S>::from_slice(simd, &LANE[..step]);
        let own = pixels.first.iter().zip(pixels.end).zip(pixels.depth);
        for ((((&first, &end), &depth), oval), &shown) in own.zip(ovals).zip(pixels.shown) {
            let ([left, top], [right, bottom]) = (both(first), both(end));
            let depth = Numbers::<S>::splat(simd, depth);
            let shown = S::i32s::splat(simd, shown);
            let OvalOutline {
                form: [xx, xy, yy],
                skew,
                lean,
                dome,
                to_first,
            } = *oval;
            let width = Numbers::<S>::splat(simd, (right.max(left) - left) as f32);
            for y in top.max(first_row)..bottom.min(end_row) {
                let from_y = to_first[1] + (y - top) as f32;
                let (of_y, along_y) = (yy * from_y * from_y, 1.0 + skew[1] * from_y);
                let (xy, depth) = (xy * from_y, depth + lean[1] * from_y);
                let mut at = (y - first_row) * self.stride + left;
                let mut x = lanes;
                for _ in (left..right).step_by(step) {
                    let from_x = x + to_first[0];
                    let squared = (from_x * xx + xy) * from_x + of_y;
                    let along = from_x * skew[0] + along_y;
                    let is_in = squared.simd_le(along * along) & along.simd_gt(0.0);
                    // Nothing is nearer than the near plane.
                    let depth = (from_x * lean[0] + depth - squared * dome).min(1.0);
                    self.leave_wide(simd, at, is_in & x.simd_lt(width), depth, shown);
                    at += step;
                    x += step as f32;
                }
            }
        }
    }

    /// Leaves depth and what is shown as [`DrawnBand::leave`] does, in as many pixels as the widest vector has.
    #[inline(always)]
    fn leave_wide<S: Simd>(
        &mut self,
        simd: S,
        at: usize,
        is_in: S::mask32s,
        depth: Numbers<S>,
        shown: S::i32s,
    ) {
        let step = Numbers::<S>::LEN;
        let fronts = &mut self.depth[at..at + step];
        let all_shown = &mut self.shown[at..at + step];
        let front = Numbers::<S>::from_slice(simd, fronts);
        let nearest = S::i32s::from_slice(simd, all_shown);
        let is_nearer = is_in & depth.simd_gt(front);
        is_nearer.select(depth, front).store_slice(fronts);
        is_nearer.select(shown, nearest).store_slice(all_shown);
    }

    /// Leaves depth and what is shown in those of four pixels where nothing is as near.
    #[inline(always)]
    fn leave<S: Simd>(
        &mut self,
        simd: S,
        at: usize,
        is_in: mask32x4<S>,
        depth: f32x4<S>,
        shown: i32x4<S>,
    ) {
        let fronts = &mut self.depth[at..at + STEP];
        let all_shown = &mut self.shown[at..at + STEP];
        let (front, nearest) = (
            f32x4::from_slice(simd, fronts),
            i32x4::from_slice(simd, all_shown),
        );
        let is_nearer = is_in & depth.simd_gt(front);
        is_nearer.select(depth, front).store_slice(fronts);
        is_nearer.select(shown, nearest).store_slice(all_shown);
    }

    /// Begins with what a picture of the band shows.
    pub(super) fn read(&mut self, picture: &mut ShownRectangle<'_>) {
        let own = self.depth.chunks_mut(self.stride);
        let own = own.zip(self.shown.chunks_mut(self.stride));
        for ((shown, depths), (own_depths, own_shown)) in picture.rows(self.width).zip(own) {
            own_depths[..self.width].copy_from_slice(depths);
            own_shown[..self.width].copy_from_slice(bytemuck::cast_slice(shown));
        }
    }

    /// What the pixels show, row by row, and `background` where nothing is.
    #[inline(always)]
    pub(super) fn write<S: Simd>(&self, _: S, background: u32, picture: &mut ShownRectangle<'_>) {
        let own = self.depth.chunks(self.stride);
        let own = own.zip(self.shown.chunks(self.stride));
        for ((shown, depths), (own_depths, own_shown)) in picture.rows(self.width).zip(own) {
            depths.copy_from_slice(&own_depths[..self.width]);
            for (shown, (&depth, &own)) in shown.iter_mut().zip(own_depths.iter().zip(own_shown)) {
                *shown = if depth == 0.0 { background } else { own as u32 };
            }
        }
    }
}

/// What compute has in its keys, of a number and those after it.
#[inline(always)]
fn keys_from(number: u32) -> [i32; GROUP] {
    let mut keys = [0; GROUP];
    for (key, number) in keys.iter_mut().zip(number..) {
        *key = !(number | SPLAT_BIT) as i32;
    }
    keys
}
