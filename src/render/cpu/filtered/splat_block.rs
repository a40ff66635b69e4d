//! Sixteen splats at a time, from places far apart.

use crate::abi::FilteredSplat;
use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x16};
use prefetch_index::prefetch_index;

/// Splats that are set up together.
pub(super) const BLOCK: usize = 16;

/// Pixels of a row that are drawn together.
pub(super) const ROW: usize = 4;

/// Covers nothing.
static NOTHING: FilteredSplat = FilteredSplat {
    window_px: [0.0; 2],
    pushed_depth: 0.0,
    side_px: 0.0,
    depth: 0.0,
    area_px: 0.0,
    extent_px: [0.0; 2],
    color: [0.0; 3],
    unused: 0,
};

/// Splats that are set up together.
pub(super) type Block<'a> = [&'a FilteredSplat; BLOCK];

/// The splats of some groups in blocks, each of a block from another group.
///
/// Splats of one group overlap. Drawn one after the other, each would read pixels of which some were just stored by
/// one store and some by another, and the processor waits until both have left for the cache. So neighbors of a block are
/// as far from one another as groups go.
pub(super) struct SplatBlocks<'a> {
    groups: &'a [&'a [FilteredSplat]],
    /// How many groups lie from one to the next of a block.
    apart: usize,
    /// Which of so many comes next, the groups of a block and of the one after, and which of their splats.
    next: usize,
    own: [&'a [FilteredSplat]; BLOCK],
    ahead: [&'a [FilteredSplat]; BLOCK],
    index: usize,
    longest: usize,
}

impl<'a> SplatBlocks<'a> {
    #[inline(always)]
    pub(super) fn of(groups: &'a [&'a [FilteredSplat]]) -> Self {
        let mut blocks = Self {
            groups,
            apart: groups.len().div_ceil(BLOCK),
            next: 0,
            own: [&[]; BLOCK],
            ahead: [&[]; BLOCK],
            index: 0,
            longest: 0,
        };
        blocks.go_on();
        blocks
    }

    /// To the next groups.
    #[inline(always)]
    fn go_on(&mut self) {
        self.own = self.ahead;
        self.ahead = [&[]; BLOCK];
        if self.next < self.apart {
            for (lane, group) in self.ahead.iter_mut().enumerate() {
                if let Some(splats) = self.groups.get(self.next + lane * self.apart) {
                    *group = splats;
                }
            }
        }
        self.next += 1;
        self.index = 0;
        self.longest = 0;
        for group in self.own {
            self.longest = self.longest.max(group.len());
        }
    }

    /// The next block; none after the last.
    #[inline(always)]
    pub(super) fn next(&mut self) -> Option<Block<'a>> {
        if self.index == self.longest {
            self.go_on();
            // Before the first groups there are none.
            if self.longest == 0 {
                return None;
            }
        }
        let index = self.index;
        self.index += 1;
        let mut block = [&NOTHING; BLOCK];
        for (lane, splat) in block.iter_mut().enumerate() {
            // What is drawn after this is asked for meanwhile.
            prefetch_index(self.ahead[lane], index);
            if let Some(own) = self.own[lane].get(index) {
                *splat = own;
            }
        }
        Some(block)
    }
}

/// Four rows become four columns: the first four numbers of all make the first vector.
#[inline(always)]
pub(super) fn columns<S: Simd, V: SimdBase<S>>([a, b, c, d]: [V; 4]) -> [V; 4] {
    let (ac, bd) = (a.zip_low(c), b.zip_low(d));
    let (ac_high, bd_high) = (a.zip_high(c), b.zip_high(d));
    [
        ac.zip_low(bd),
        ac.zip_high(bd),
        ac_high.zip_low(bd_high),
        ac_high.zip_high(bd_high),
    ]
}

/// One of the three parts that a record has, four numbers each, of a block: a vector of each number.
///
/// Like all that is done with vectors here without closures: these are no part of the function that is compiled for the
/// processor, unless they are small.
#[inline(always)]
pub(super) fn part<S: Simd>(simd: S, block: &Block<'_>, at: usize) -> [f32x16<S>; 4] {
    let a = four(simd, [block[0], block[1], block[2], block[3]], at);
    let b = four(simd, [block[4], block[5], block[6], block[7]], at);
    let c = four(simd, [block[8], block[9], block[10], block[11]], at);
    let d = four(simd, [block[12], block[13], block[14], block[15]], at);
    [
        of_rows([a[0], b[0], c[0], d[0]]),
        of_rows([a[1], b[1], c[1], d[1]]),
        of_rows([a[2], b[2], c[2], d[2]]),
        of_rows([a[3], b[3], c[3], d[3]]),
    ]
}

#[inline(always)]
fn four<S: Simd>(simd: S, [a, b, c, d]: [&FilteredSplat; 4], at: usize) -> [f32x4<S>; 4] {
    columns([
        row(simd, a, at),
        row(simd, b, at),
        row(simd, c, at),
        row(simd, d, at),
    ])
}

#[inline(always)]
fn row<S: Simd>(simd: S, splat: &FilteredSplat, at: usize) -> f32x4<S> {
    let words: &[f32; 12] = bytemuck::cast_ref(splat);
    f32x4::from_slice(simd, &words[at..at + 4])
}

/// Four times four lanes in a vector.
#[inline(always)]
pub(super) fn of_rows<S: Simd>([a, b, c, d]: [f32x4<S>; ROW]) -> f32x16<S> {
    a.combine(b).combine(c.combine(d))
}

/// Which of four lanes are the first so many.
pub(super) const LANES: [[u32; 4]; 5] = {
    const ALL: u32 = u32::MAX;
    [
        [0, 0, 0, 0],
        [ALL, 0, 0, 0],
        [ALL, ALL, 0, 0],
        [ALL, ALL, ALL, 0],
        [ALL, ALL, ALL, ALL],
    ]
};

/// The lanes of a mask, one after the other.
pub(super) struct SetLanes(pub(super) u64);

impl Iterator for SetLanes {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let lane = self.0.trailing_zeros() as usize;
        self.0 &= self.0.wrapping_sub(1);
        (lane < BLOCK).then_some(lane)
    }
}
