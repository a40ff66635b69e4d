//! Splats that are asked for together, in stages without branches on what is hidden or where it lies: neither can be
//! foreseen.

use super::super::centers::to_center;
use super::{Hiding, Mark, NOTHING};
use glam::Vec4;
use std::sync::atomic::Ordering;

/// Most of them.
pub(in crate::cut) const CHUNK: usize = 256;
/// With room for a store of four at any place.
const ROOM: usize = CHUNK + 4;
/// Where this is asked for, it is hidden.
const ALWAYS: u32 = u32::MAX;

/// What is asked of [`super::Nearest`] for some splats.
#[derive(Debug)]
pub(in crate::cut) struct Chunk {
    /// The pixel; what comes after the last one where it is none or may be more than one.
    first: [u32; ROOM],
    /// As [`Mark`] has them.
    distance: [u32; ROOM],
    asked: [u32; ROOM],
    /// Marks of those that may be more than one pixel.
    others: [Mark; ROOM],
}

impl Default for Chunk {
    fn default() -> Self {
        Self {
            first: [0; ROOM],
            distance: [0; ROOM],
            asked: [0; ROOM],
            others: [Mark::HIDDEN; ROOM],
        }
    }
}

impl Chunk {
    /// Pixels and distances of four splats.
    #[inline]
    fn put(&mut self, at: usize, fours: [[u32; 4]; 3]) {
        let lists = [&mut self.first, &mut self.distance, &mut self.asked];
        for (list, four) in lists.into_iter().zip(fours) {
            if let Some(places) = list.get_mut(at..at + 4) {
                places.copy_from_slice(&four);
            }
        }
    }
}

/// 1 in the lanes whose bit is set.
const LANES: [Vec4; 16] = {
    let mut table = [Vec4::ZERO; 16];
    let mut mask = 0;
    while mask < 16 {
        let [x, y, z, w] = [mask & 1, mask >> 1 & 1, mask >> 2 & 1, mask >> 3];
        table[mask] = Vec4::new(x as f32, y as f32, z as f32, w as f32);
        mask += 1;
    }
    table
};

impl Hiding<'_> {
    /// Finds the pixels of four splats ([`Hiding::along`], their distances and own radii), number `at` and on of a chunk.
    /// Those that are not in `lanes` count as hidden; those in `undrawn` hide nothing.
    ///
    /// Those that cover one pixel of the picture and may cover no other wait for [`ask`](Self::ask): of squares of a pixel
    /// nearly all. The others are asked for at once.
    #[inline]
    pub(in crate::cut) fn place(
        &self,
        chunk: &mut Chunk,
        at: usize,
        splats: [Vec4; 4],
        (lanes, undrawn): (u8, u8),
    ) {
        if self.outer_px > 0.5 {
            let beyond = self.nearest.pixels.len().saturating_sub(1) as u32;
            chunk.put(at, [[beyond; 4], [NOTHING; 4], [ALWAYS; 4]]);
            return self.place_others(chunk, at, splats, (lanes, undrawn));
        }
        let placed = self.placed(splats);
        let [(x, sum_x), (y, sum_y)] = [placed.x, placed.y].map(to_center);
        let is_between = (x * x + y * y).cmpgt(placed.reach * placed.reach)
            & splats[2].cmpgt(Vec4::splat(self.near));
        let [x, y] = [x.abs(), y.abs()];
        // The pixel's own center is that far away, the next one 1 less that.
        let [width, height] = self.size.map(Vec4::splat);
        let farther = x.max(y);
        // What contains no center counts as hidden.
        let is_nothing = (farther.cmpgt(placed.outer) & placed.known) | is_between;
        let some = lanes & !is_nothing.bitmask() as u8;
        let is_one = farther.cmplt((1.0 - placed.outer).min(placed.inner))
            & placed.known
            & placed.x.min(placed.y).cmpgt(Vec4::ZERO)
            & placed.x.cmplt(width)
            & placed.y.cmplt(height);
        let ones = is_one.bitmask() as u8 & some;
        let is_one = LANES[(ones & 15) as usize].cmpgt(Vec4::ZERO);
        let bits =
            |v: Vec4, other: Vec4| Vec4::select(is_one, v, other).to_array().map(f32::to_bits);
        // Below the last row there is one pixel more.
        let column = bits(sum_x, Vec4::splat(8_388_609.0));
        let row = bits(sum_y, height + 8_388_609.0);
        let distance = bits(placed.distance, Vec4::splat(f32::from_bits(NOTHING)));
        let asked = bits(placed.asked, Vec4::splat(f32::from_bits(ALWAYS)));
        let width = self.nearest.width;
        let first = [0, 1, 2, 3].map(|i: usize| {
            let row = (row[i] & 0x7f_ffff).wrapping_mul(width);
            row.wrapping_add(column[i] & 0x7f_ffff)
                .wrapping_sub(width + 1)
        });
        chunk.put(at, [first, distance, asked]);
        if undrawn & ones != 0 {
            for lane in (0..4).filter(|lane| undrawn >> lane & 1 != 0) {
                if let Some(distance) = chunk.distance.get_mut(at + lane) {
                    *distance = NOTHING;
                }
            }
        }
        if some & !ones != 0 {
            self.place_others(chunk, at, splats, (some & !ones, undrawn));
        }
    }

    #[inline(never)]
    fn place_others(
        &self,
        chunk: &mut Chunk,
        at: usize,
        splats: [Vec4; 4],
        (lanes, undrawn): (u8, u8),
    ) {
        // Among pixels that are stored without waiting for one another (see `ask`), none covers anything surely.
        let undrawn = if self.are_pixels { 15 } else { undrawn };
        let marks = self.ask_squares(&self.placed(splats), lanes, undrawn);
        for (lane, mark) in marks.into_iter().enumerate() {
            if lanes >> lane & 1 == 0 {
                continue;
            }
            if let Some(place) = chunk.others.get_mut(at + lane) {
                *place = mark;
            }
            if let Some(asked) = chunk.asked.get_mut(at + lane) {
                *asked = if mark.rows == 0 { ALWAYS } else { 0 };
            }
        }
    }

    /// Which splats of a chunk, of the first `count`, are not hidden so far, 64 a word. Each of them leaves a mark. All
    /// leave their depth before any is asked for.
    ///
    /// Where splats are pixels, depths are read, compared and stored, which is three times faster than at once, but one may
    /// be stored over by another thread. Then less is hidden than could be, until [`repair`](Self::repair).
    #[inline]
    pub(in crate::cut) fn ask(
        &self,
        chunk: &Chunk,
        count: usize,
        marks: &mut Vec<Mark>,
    ) -> [u64; CHUNK / 64] {
        let pixels = self.nearest.pixels.as_slice();
        let own = chunk.first.get(..count.min(CHUNK)).unwrap_or_default();
        for (&first, &distance) in own.iter().zip(&chunk.distance) {
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
        let mut seen = [0; CHUNK / 64];
        let words = own.chunks(64).zip(chunk.asked.chunks(64));
        for ((own, asked), seen) in words.zip(&mut seen) {
            for (&first, &asked) in own.iter().zip(asked).rev() {
                let pixel = pixels.get(first as usize);
                let there = pixel.map_or(0, |pixel| pixel.load(Ordering::Relaxed));
                *seen = *seen << 1 | u64::from(there >= asked);
            }
        }
        let beyond = pixels.len().saturating_sub(1) as u32;
        for (&seen, from) in seen.iter().zip((0..).step_by(64)) {
            let mut rest = seen;
            while rest != 0 {
                let at = (from + rest.trailing_zeros() as usize) % CHUNK;
                rest &= rest - 1;
                let first = chunk.first[at];
                marks.push(if first == beyond {
                    chunk.others[at]
                } else {
                    Mark {
                        first,
                        columns: 1,
                        rows: 1,
                        asked: chunk.asked[at],
                        distance: chunk.distance[at],
                    }
                });
            }
        }
        seen
    }
}
