//! A band of rows of the picture: the nearest splat of each of its pixels.

use super::Picture;
use super::bands::{Placed, SPLAT_BIT};
use super::place::{Found, Round, both};
use fearless_simd::prelude::*;
use fearless_simd::{f32x4, i32x4, mask32x4};

/// Depth and number of the nearest of each pixel of a band, kept for its memory.
#[derive(Debug, Default)]
pub(super) struct Fronts {
    depth: Vec<f32>,
    number: Vec<i32>,
}

/// So many pixels of a row are written at a time; there is room for as many beyond its end.
const STEP: usize = 4;

/// A band that is drawn in.
pub(super) struct Band<'a> {
    depth: &'a mut [f32],
    number: &'a mut [i32],
    width: usize,
    /// From a row to the next.
    stride: usize,
    /// Its first row, and one past its last.
    rows: [usize; 2],
}

impl Fronts {
    /// An empty band of these rows, of so many pixels each.
    pub(super) fn band(&mut self, width: usize, rows: [usize; 2]) -> Band<'_> {
        let stride = width + STEP;
        let words = stride * (rows[1] - rows[0]);
        self.depth.resize(words, 0.0);
        self.number.resize(words, 0);
        self.depth.fill(0.0);
        Band {
            depth: &mut self.depth,
            number: &mut self.number,
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

impl Band<'_> {
    /// Draws what of a list is in the band. Lists come in the order of their numbers, so of equal depths the first stays.
    #[inline(always)]
    pub(super) fn draw<S: Simd>(&mut self, simd: S, list: &Placed<'_>) {
        let [first_row, end_row] = self.rows;
        for group in list.groups {
            let [first, end] = group.rows.map(usize::from);
            if first >= end_row || end <= first_row {
                continue;
            }
            let range = group.first as usize..group.first as usize + usize::from(group.count);
            let number = list.first + group.first;
            let pixels = Found {
                first: &list.pixels.first[range.clone()],
                end: &list.pixels.end[range.clone()],
                depth: &list.pixels.depth[range.clone()],
                colors: &list.pixels.colors[range.clone()],
            };
            if list.are_samples {
                self.samples(pixels, number);
            } else if list.rounds.is_empty() {
                self.squares(simd, pixels, number);
            } else {
                self.discs(simd, pixels, &list.rounds[range], number);
            }
        }
    }

    /// Squares of a pixel.
    #[inline(always)]
    fn samples(&mut self, pixels: Found<'_>, number: u32) {
        let [first_row, end_row] = self.rows;
        for ((&first, &depth), number) in pixels.first.iter().zip(pixels.depth).zip(number..) {
            let [x, y] = both(first);
            if (first_row..end_row).contains(&y) {
                let at = (y - first_row) * self.stride + x;
                let (front, nearest) = (&mut self.depth[at], &mut self.number[at]);
                let is_nearer = depth > *front;
                *nearest = if is_nearer { number as i32 } else { *nearest };
                *front = if is_nearer { depth } else { *front };
            }
        }
    }

    #[inline(always)]
    fn squares<S: Simd>(&mut self, simd: S, pixels: Found<'_>, number: u32) {
        let [first_row, end_row] = self.rows;
        let own = pixels.first.iter().zip(pixels.end).zip(pixels.depth);
        for (((&first, &end), &depth), number) in own.zip(number..) {
            let ([left, top], [right, bottom]) = (both(first), both(end));
            let depth = f32x4::splat(simd, depth);
            let number = i32x4::splat(simd, number as i32);
            for y in top.max(first_row)..bottom.min(end_row) {
                let mut at = (y - first_row) * self.stride + left;
                let mut rest = right - left;
                while rest > 0 {
                    let is_in = i32x4::from_slice(simd, &LANES[rest.min(STEP)]).simd_lt(0);
                    self.leave(simd, at, is_in, depth, number);
                    at += STEP;
                    rest = rest.saturating_sub(STEP);
                }
            }
        }
    }

    #[inline(always)]
    fn discs<S: Simd>(&mut self, simd: S, pixels: Found<'_>, rounds: &[Round], number: u32) {
        let [first_row, end_row] = self.rows;
        let own = pixels.first.iter().zip(pixels.end).zip(pixels.depth);
        for ((((&first, &end), &depth), round), number) in own.zip(rounds).zip(number..) {
            let ([left, top], [right, bottom]) = (both(first), both(end));
            let depth = f32x4::splat(simd, depth);
            let number = i32x4::splat(simd, number as i32);
            let Round { form, to_first } = *round;
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
                    self.leave(simd, at, is_in & is_round, depth, number);
                    at += STEP;
                    x += STEP as f32;
                    rest = rest.saturating_sub(STEP);
                }
            }
        }
    }

    /// Leaves depth and number in those of four pixels where nothing is as near.
    #[inline(always)]
    fn leave<S: Simd>(
        &mut self,
        simd: S,
        at: usize,
        is_in: mask32x4<S>,
        depth: f32x4<S>,
        number: i32x4<S>,
    ) {
        let fronts = &mut self.depth[at..at + STEP];
        let numbers = &mut self.number[at..at + STEP];
        let (front, nearest) = (
            f32x4::from_slice(simd, fronts),
            i32x4::from_slice(simd, numbers),
        );
        let is_nearer = is_in & depth.simd_gt(front);
        is_nearer.select(depth, front).store_slice(fronts);
        is_nearer.select(number, nearest).store_slice(numbers);
    }

    /// What the pixels show, row by row: the numbers of splats, or the colors that those of both lists have, and `background` where
    /// nothing is.
    pub(super) fn write(
        &self,
        (colors, background): (Option<[&[i32]; 2]>, u32),
        picture: &mut Picture<'_>,
    ) {
        let own = self.depth.chunks(self.stride);
        let own = own.zip(self.number.chunks(self.stride));
        for ((shown, depths), (own_depths, numbers)) in picture.rows(self.width).zip(own) {
            depths.copy_from_slice(&own_depths[..self.width]);
            for (shown, (&depth, &number)) in shown.iter_mut().zip(own_depths.iter().zip(numbers)) {
                if depth == 0.0 {
                    *shown = background;
                    continue;
                }
                *shown = match colors {
                    None => !(number as u32 | SPLAT_BIT),
                    Some([first, second]) => {
                        let number = number as usize;
                        let rest = || second[number - first.len()];
                        first.get(number).copied().unwrap_or_else(rest) as u32
                    }
                };
            }
        }
    }
}
