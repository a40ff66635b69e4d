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

    /// What a splat of one pixel leaves.
    #[inline(always)]
    fn mark_of_one(&self, lane: u8) -> Mark {
        let lane = usize::from(lane);
        Mark {
            first: self.first[lane],
            asked: self.asked[lane],
            distance: self.distance[lane],
        }
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
                if mark.size() != [0, 0] {
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
        let mut candidates = [Lanes64::NONE; WORDS];
        for (word, own) in candidates.iter_mut().enumerate() {
            let ones = Lanes64::of(word, chunk.ones.words()[word]);
            *own = match self.are_pixels {
                true => self.leave::<false>(chunk, &ones),
                false => self.leave::<true>(chunk, &ones),
            };
        }
        let mut seen = Mask::default();
        for (word, own) in candidates.iter().enumerate() {
            let others = chunk.others.words()[word];
            let (bits, own) = self.not_hidden(chunk, own);
            seen.words_mut()[word] = bits | others;
            if others == 0 {
                marks.extend(own.iter().map(|&lane| chunk.mark_of_one(lane)));
            } else {
                let all = Lanes64::of(word, bits | others);
                marks.extend(all.iter().map(|&lane| match others >> (lane % 64) & 1 {
                    0 => chunk.mark_of_one(lane),
                    _ => chunk.marks[usize::from(lane)],
                }));
            }
        }
        seen
    }

    /// Leaves the depths of some splats where nothing is nearer; those that were not hidden by what was there. `AT_ONCE`: so that
    /// nothing is stored over.
    #[inline(always)]
    fn leave<const AT_ONCE: bool>(&self, chunk: &Chunk, lanes: &Lanes64) -> Lanes64 {
        let pixels = self.nearest.pixels.as_slice();
        let mut seen = Lanes64::NONE;
        for &lane in lanes.iter() {
            let at = usize::from(lane);
            let Some(pixel) = pixels.get(chunk.first[at] as usize) else {
                continue;
            };
            let (there, own) = (pixel.load(Ordering::Relaxed), chunk.distance[at]);
            // What hides it is nearer, and stays.
            if !AT_ONCE {
                pixel.store(there.min(own), Ordering::Relaxed);
            } else if own < there {
                pixel.fetch_min(own, Ordering::Relaxed);
            }
            seen.push_if(lane, there >= chunk.asked[at]);
        }
        seen
    }

    /// Which of some splats of one pixel are not hidden so far, as bits and as lanes.
    #[inline(always)]
    fn not_hidden(&self, chunk: &Chunk, lanes: &Lanes64) -> (u64, Lanes64) {
        let pixels = self.nearest.pixels.as_slice();
        let (mut bits, mut seen) = (0, Lanes64::NONE);
        for &lane in lanes.iter() {
            let at = usize::from(lane);
            let pixel = pixels.get(chunk.first[at] as usize);
            let there = pixel.map_or(0, |pixel| pixel.load(Ordering::Relaxed));
            let is_seen = there >= chunk.asked[at];
            bits |= u64::from(is_seen) << (lane % 64);
            seen.push_if(lane, is_seen);
        }
        (bits, seen)
    }
}

/// Words of a mask.
const WORDS: usize = CHUNK / 64;
const _: () = assert!(CHUNK == 1 + u8::MAX as usize);

/// Up to 64 lanes of a chunk, one after the other: none waits for the bits of those before.
#[derive(Clone, Copy)]
struct Lanes64 {
    lanes: [u8; 64],
    len: usize,
}

impl Lanes64 {
    const NONE: Self = Self {
        lanes: [0; 64],
        len: 0,
    };

    /// Those of a word of a mask.
    #[inline(always)]
    fn of(word: usize, mut bits: u64) -> Self {
        let mut lanes = Self::NONE;
        while bits != 0 {
            let lane = 64 * word as u32 + bits.trailing_zeros();
            lanes.push_if(lane as u8, true);
            bits &= bits - 1;
        }
        lanes
    }

    /// Adds a lane, or does nothing that is seen of it.
    #[inline(always)]
    fn push_if(&mut self, lane: u8, is_in: bool) {
        self.lanes[self.len % 64] = lane;
        self.len += usize::from(is_in);
    }

    #[inline(always)]
    fn iter(&self) -> std::slice::Iter<'_, u8> {
        self.lanes[..self.len.min(64)].iter()
    }
}

/// The whole number that a sum with 2^23 has in its low bits.
#[inline(always)]
pub(super) fn low_bits<S: Simd>(sum: Wide<S>) -> S::u32s {
    sum.0.bitcast::<S::u32s>() & 0x7f_ffff
}
