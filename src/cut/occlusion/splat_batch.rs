//! Splats that are asked for together, in stages without branches on what is hidden or where it lies: neither can be
//! foreseen.

use crate::cut::batch::{LANES, LaneMask};
use crate::cut::occlusion::pixel_centers::to_center;
use crate::cut::occlusion::{DepthMark, NOTHING, OcclusionTest};
use crate::simd::{FloatLanes, WIDEST, WideLanes};
use fearless_simd::prelude::*;
use glam::Vec4;
use std::sync::atomic::{AtomicU32, Ordering};

/// Most of them.
pub(in crate::cut) const CHUNK: usize = LANES;

/// Room for the splats of a chunk, and for a whole vector from the last one on.
const ROOM: usize = CHUNK + WIDEST;

/// What is asked of [`crate::cut::occlusion::SoftwareDepthBuffer`] for some splats.
#[derive(Debug)]
pub(in crate::cut) struct SplatChunk {
    ones: FrontOnes,
    /// The others that are not hidden so far.
    others: LaneMask,
    /// Marks of the others.
    marks: [DepthMark; CHUNK],
}

/// Splats that cover one pixel and may cover no other: of squares of a pixel nearly all that cover any. They lie close together,
/// numbers of one kind in a list each.
#[derive(Debug)]
struct FrontOnes {
    len: usize,
    /// Lanes of the chunk, ascending.
    lane: [u32; ROOM],
    /// Which pixel it is, and what [`DepthMark`] has.
    first: [u32; ROOM],
    distance: [u32; ROOM],
    asked: [u32; ROOM],
    /// What is nearest there.
    there: [u32; ROOM],
}

impl Default for SplatChunk {
    fn default() -> Self {
        let list = [0; ROOM];
        Self {
            ones: FrontOnes {
                len: 0,
                lane: list,
                first: list,
                distance: list,
                asked: list,
                there: list,
            },
            others: LaneMask::default(),
            marks: [DepthMark::HIDDEN; CHUNK],
        }
    }
}

impl SplatChunk {
    /// Takes all splats out.
    #[inline(always)]
    pub(in crate::cut) fn clear(&mut self) {
        self.ones.len = 0;
        self.others = LaneMask::default();
    }
}

impl FrontOnes {
    /// Adds those of some lanes of a vector: lane, pixel, distance and what is asked.
    #[inline(always)]
    fn add<S: Simd>(&mut self, simd: S, lanes: u32, numbers: [S::u32s; 4]) {
        let mask = S::mask32s::from_bitmask(simd, lanes.into());
        let Self {
            len,
            lane,
            first,
            distance,
            asked,
            ..
        } = self;
        for (list, numbers) in [lane, first, distance, asked].into_iter().zip(numbers) {
            WideLanes::<S>::pack(numbers, mask, list, *len);
        }
        *len += lanes.count_ones() as usize;
    }

    /// Looks at what is nearest at each pixel; leaves those that it does not hide.
    #[inline(always)]
    fn keep_seen<S: Simd>(&mut self, simd: S, pixels: &[AtomicU32]) {
        let Self {
            len,
            lane,
            first,
            distance,
            asked,
            there,
        } = self;
        // In a loop of its own: no read waits for an answer.
        for (there, &first) in there.iter_mut().zip(first.iter()).take(*len) {
            let pixel = pixels.get(first as usize);
            *there = pixel.map_or(0, |pixel| pixel.load(Ordering::Relaxed));
        }
        let all = *len;
        *len = 0;
        let width = WideLanes::<S>::LANES;
        for at in (0..all).step_by(width) {
            let own = at..at + width;
            let load = |list: &[u32; ROOM]| {
                list.get(own.clone())
                    .map(|own| WideLanes::<S>::load_words(simd, own))
            };
            let (Some(nearest), Some(least)) = (load(there), load(asked)) else {
                break;
            };
            let there = u32::MAX >> (32 - (all - at).min(width));
            let seen = nearest.simd_ge(least).to_bitmask() as u32 & there;
            let mask = S::mask32s::from_bitmask(simd, seen.into());
            // To places that were read already.
            for list in [&mut *lane, first, distance, asked] {
                if let Some(numbers) = load(list) {
                    WideLanes::<S>::pack(numbers, mask, list, *len);
                }
            }
            *len += seen.count_ones() as usize;
        }
    }

    /// Leaves their depths where nothing is nearer. `AT_ONCE`: so that nothing is stored over.
    #[inline(always)]
    fn leave<const AT_ONCE: bool>(&self, pixels: &[AtomicU32]) {
        for (&first, &own) in self.first.iter().zip(&self.distance).take(self.len) {
            let Some(pixel) = pixels.get(first as usize) else {
                continue;
            };
            let there = pixel.load(Ordering::Relaxed);
            if !AT_ONCE {
                pixel.store(there.min(own), Ordering::Relaxed);
            } else if own < there {
                pixel.fetch_min(own, Ordering::Relaxed);
            }
        }
    }

    /// What each leaves, with its lane.
    #[inline(always)]
    fn marks(&self) -> impl Iterator<Item = (u32, DepthMark)> {
        let numbers = self.first.iter().zip(&self.asked).zip(&self.distance);
        let numbers = self.lane.iter().zip(numbers).take(self.len);
        numbers.map(|(&lane, ((&first, &asked), &distance))| {
            let mark = DepthMark {
                first,
                asked,
                distance,
            };
            (lane, mark)
        })
    }
}

impl OcclusionTest<'_> {
    /// Finds the pixels of splats ([`crate::cut::occlusion::PixelCenters::along`], their distances and own radii), number `at` and on of a chunk.
    /// Those that are not in `lanes` count as hidden; those in `undrawn` hide nothing.
    ///
    /// Those of one pixel wait for [`ask`](Self::ask). The others are asked for at once.
    #[inline(always)]
    pub(in crate::cut) fn place<S: Simd>(
        &self,
        simd: S,
        chunk: &mut SplatChunk,
        at: usize,
        splats: [WideLanes<S>; 4],
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
            let some = lanes & !WideLanes::<S>::bits(is_nothing);
            let ones = WideLanes::<S>::bits(is_one) & some;
            others = some & !ones;
            let width = self.nearest.width;
            let (column, row) = (low_bits(sum_x), low_bits(sum_y));
            let first = row * S::u32s::splat(simd, width) + column;
            let first = first - S::u32s::splat(simd, width + 1);
            let hide_nothing = S::mask32s::from_bitmask(simd, undrawn.into());
            let nothing = S::u32s::splat(simd, NOTHING);
            let distance = hide_nothing.select(nothing, placed.distance.0.bitcast::<S::u32s>());
            let asked = placed.asked.0.bitcast::<S::u32s>();
            let lane = WideLanes::<S>::load_words(simd, &LANE[..WideLanes::<S>::LANES]);
            let lane = lane + S::u32s::splat(simd, at as u32);
            chunk.ones.add(simd, ones, [lane, first, distance, asked]);
        }
        if others != 0 {
            let mut lists = [[0.0; 16]; 4];
            let [x, y, z, radius] = splats;
            let [xs, ys, zs, radii] = &mut lists;
            let own = 0..WideLanes::<S>::LANES;
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
        chunk: &mut SplatChunk,
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
    pub(in crate::cut) fn ask<S: Simd>(
        &self,
        simd: S,
        chunk: &mut SplatChunk,
        marks: &mut Vec<DepthMark>,
    ) -> LaneMask {
        let pixels = self.nearest.pixels.as_slice();
        let SplatChunk { ones, others, .. } = chunk;
        ones.keep_seen(simd, pixels);
        match self.are_pixels {
            true => ones.leave::<false>(pixels),
            false => ones.leave::<true>(pixels),
        }
        ones.keep_seen(simd, pixels);
        let mut seen = *others;
        for &lane in ones.lane.iter().take(ones.len) {
            seen.add(lane as usize % CHUNK, 1);
        }
        if others.is_empty() {
            marks.extend(ones.marks().map(|(_, mark)| mark));
        } else {
            for (lane, mark) in ones.marks() {
                chunk.marks[lane as usize % CHUNK] = mark;
            }
            marks.extend(seen.lanes().map(|lane| chunk.marks[lane]));
        }
        seen
    }
}

/// Numbers of lanes.
const LANE: [u32; WIDEST] = {
    let mut lane = [0; WIDEST];
    let mut i = 0;
    while i < lane.len() {
        lane[i] = i as u32;
        i += 1;
    }
    lane
};

/// The whole number that a sum with 2^23 has in its low bits.
#[inline(always)]
pub(super) fn low_bits<S: Simd>(sum: WideLanes<S>) -> S::u32s {
    sum.0.bitcast::<S::u32s>() & 0x7f_ffff
}
