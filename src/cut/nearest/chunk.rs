//! Splats that are asked for together, in stages without branches on what is hidden or where it lies: neither can be
//! foreseen.

use super::super::batch::{LANES, Mask};
use super::super::centers::to_center;
use super::super::vector::{Vector, Wide};
use super::{Hiding, Mark, NOTHING};
use fearless_simd::prelude::*;
use glam::Vec4;
use std::sync::atomic::Ordering;

/// Most of them.
pub(in crate::cut) const CHUNK: usize = LANES;

/// What is asked of [`super::Nearest`] for some splats.
#[derive(Debug)]
pub(in crate::cut) struct Chunk {
    /// Those that cover one pixel and may cover no other: of squares of a pixel nearly all that cover any.
    ones: Mask,
    /// The others that are not hidden so far.
    others: Mask,
    /// Of those of one pixel which it is, and what [`Mark`] has.
    first: [u32; CHUNK],
    distance: [u32; CHUNK],
    asked: [u32; CHUNK],
    /// Marks of the others.
    marks: [Mark; CHUNK],
}

impl Default for Chunk {
    fn default() -> Self {
        Self {
            ones: Mask::default(),
            others: Mask::default(),
            first: [0; CHUNK],
            distance: [0; CHUNK],
            asked: [0; CHUNK],
            marks: [Mark::HIDDEN; CHUNK],
        }
    }
}

impl Chunk {
    /// Takes all splats out.
    #[inline(always)]
    pub(in crate::cut) fn clear(&mut self) {
        (self.ones, self.others) = (Mask::default(), Mask::default());
    }
}

impl Hiding<'_> {
    /// Finds the pixels of splats ([`super::Centers::along`], their distances and own radii), number `at` and on of a chunk.
    /// Those that are not in `lanes` count as hidden; those in `undrawn` hide nothing.
    ///
    /// Those of one pixel wait for [`ask`](Self::ask). The others are asked for at once.
    #[inline(always)]
    pub(in crate::cut) fn place<S: Simd>(
        &self,
        simd: S,
        chunk: &mut Chunk,
        at: usize,
        splats: [Wide<S>; 4],
        (lanes, undrawn): (u32, u32),
    ) {
        let mut others = lanes;
        if self.outer_px <= 0.5 {
            let placed = self.placed(splats);
            let ((x, sum_x), (y, sum_y)) = (to_center(placed.x), to_center(placed.y));
            let is_between =
                (x * x + y * y).gt(placed.reach * placed.reach) & splats[2].gt(x.all(self.near));
            // The pixel's own center is that far away, the next one 1 less that.
            let farther = x.abs().max(y.abs());
            // What contains no center counts as hidden.
            let is_nothing = (farther.gt(placed.outer) & placed.known) | is_between;
            let [width, height] = self.size;
            let is_one = farther.lt((x.all(1.0) - placed.outer).min(placed.inner))
                & placed.known
                & placed.x.min(placed.y).gt(x.all(0.0))
                & placed.x.lt(x.all(width))
                & placed.y.lt(x.all(height));
            let some = lanes & !Wide::<S>::bits(is_nothing);
            let ones = Wide::<S>::bits(is_one) & some;
            others = some & !ones;
            let own = at..at + Wide::<S>::LANES;
            let width = self.nearest.width;
            let (column, row) = (low_bits(sum_x), low_bits(sum_y));
            let first = row * S::u32s::splat(simd, width) + column;
            let first = first - S::u32s::splat(simd, width + 1);
            first.store_slice(&mut chunk.first[own.clone()]);
            placed.distance.store_bits(&mut chunk.distance[own.clone()]);
            placed.asked.store_bits(&mut chunk.asked[own]);
            chunk.ones.add(at, ones);
            let mut hide_nothing = ones & undrawn;
            while hide_nothing != 0 {
                let lane = at + hide_nothing.trailing_zeros() as usize;
                chunk.distance[lane % CHUNK] = NOTHING;
                hide_nothing &= hide_nothing - 1;
            }
        }
        if others != 0 {
            let mut lists = [[0.0; 16]; 4];
            let [x, y, z, radius] = splats;
            let [xs, ys, zs, radii] = &mut lists;
            let own = 0..Wide::<S>::LANES;
            x.store(&mut xs[own.clone()]);
            y.store(&mut ys[own.clone()]);
            z.store(&mut zs[own.clone()]);
            radius.store(&mut radii[own]);
            self.place_others(chunk, at, &lists, (others, undrawn));
        }
    }

    /// Up to 16 of them that may have any number of pixels.
    #[inline(never)]
    fn place_others(
        &self,
        chunk: &mut Chunk,
        at: usize,
        splats: &[[f32; 16]; 4],
        (lanes, undrawn): (u32, u32),
    ) {
        // Among pixels that are stored without waiting for one another (see `ask`), none covers anything surely.
        let undrawn = if self.are_pixels { u32::MAX } else { undrawn };
        for first in (0..16).step_by(4) {
            let own = |bits: u32| (bits >> first) as u8 & 15;
            if own(lanes) == 0 {
                continue;
            }
            let four = |list: &[f32; 16]| {
                Vec4::new(
                    list[first],
                    list[first + 1],
                    list[first + 2],
                    list[first + 3],
                )
            };
            let placed = self.placed(splats.each_ref().map(four));
            let marks = self.ask_squares(&placed, own(lanes), own(undrawn));
            for (mark, lane) in marks.into_iter().zip(at + first..) {
                if mark.rows != 0 {
                    chunk.marks[lane % CHUNK] = mark;
                    chunk.others.add(lane, 1);
                }
            }
        }
    }

    /// Which splats of a chunk are not hidden so far. Each of them leaves a mark. All
    /// leave their depth before any is asked for, but for those that are hidden by then.
    ///
    /// Where splats are pixels, depths are read, compared and stored, which is three times faster than at once, but one may
    /// be stored over by another thread. Then less is hidden than could be, until [`repair`](Self::repair).
    #[inline(always)]
    pub(in crate::cut) fn ask(&self, chunk: &Chunk, marks: &mut Vec<Mark>) -> Mask {
        let pixels = self.nearest.pixels.as_slice();
        let candidates = self.not_hidden(chunk, chunk.ones);
        for lane in candidates.lanes() {
            let (first, distance) = (chunk.first[lane % CHUNK], chunk.distance[lane % CHUNK]);
            let Some(pixel) = pixels.get(first as usize) else {
                continue;
            };
            let there = pixel.load(Ordering::Relaxed);
            if self.are_pixels {
                pixel.store(there.min(distance), Ordering::Relaxed);
            } else if distance < there {
                pixel.fetch_min(distance, Ordering::Relaxed);
            }
        }
        let seen = self.not_hidden(chunk, candidates) | chunk.others;
        marks.reserve(seen.count() as usize);
        for lane in seen.lanes() {
            marks.push(if chunk.others.get(lane, 1) != 0 {
                chunk.marks[lane % CHUNK]
            } else {
                Mark {
                    first: chunk.first[lane % CHUNK],
                    columns: 1,
                    rows: 1,
                    asked: chunk.asked[lane % CHUNK],
                    distance: chunk.distance[lane % CHUNK],
                }
            });
        }
        seen
    }

    /// Which of some splats of one pixel are not hidden so far.
    #[inline(always)]
    fn not_hidden(&self, chunk: &Chunk, lanes: Mask) -> Mask {
        let pixels = self.nearest.pixels.as_slice();
        let mut seen = Mask::default();
        for (word, from) in (0..).zip((0..CHUNK).step_by(64)) {
            let (mut rest, mut own) = (lanes.words()[word], 0);
            while rest != 0 {
                let lane = (from + rest.trailing_zeros() as usize) % CHUNK;
                let pixel = pixels.get(chunk.first[lane] as usize);
                let there = pixel.map_or(0, |pixel| pixel.load(Ordering::Relaxed));
                let lowest = rest & rest.wrapping_neg();
                own |= if there >= chunk.asked[lane] {
                    lowest
                } else {
                    0
                };
                rest ^= lowest;
            }
            seen.words_mut()[word] = own;
        }
        seen
    }
}

/// The whole number that a sum with 2^23 has in its low bits.
#[inline(always)]
fn low_bits<S: Simd>(sum: Wide<S>) -> S::u32s {
    sum.0.bitcast::<S::u32s>() & 0x7f_ffff
}
