//! Texels around a place of a photograph in each lane, and their means.

use crate::projective::pyramid::PhotoPixels;
use crate::projective::wide_look::lanes::{floor, load, set_bits, splat};
use crate::simd::{FloatLanes, WIDEST, WideLanes};
use fearless_simd::prelude::*;

/// Four texels in each lane, and the place between them.
pub(super) struct LaneTexels {
    texels: [[u32; WIDEST]; 4],
    across: [f32; WIDEST],
    down: [f32; WIDEST],
}

impl Default for LaneTexels {
    fn default() -> Self {
        Self {
            texels: [[0; WIDEST]; 4],
            across: [0.0; WIDEST],
            down: [0.0; WIDEST],
        }
    }
}

impl LaneTexels {
    /// Takes those around (u, v) of 0..=1 of a level, clamped at the border.
    #[inline(always)]
    pub(super) fn take(&mut self, lane: usize, level: &PhotoPixels, [u, v]: [f32; 2]) {
        let x = u * level.width as f32 - 0.5;
        let y = v * level.height as f32 - 0.5;
        let (left, top) = (x.floor(), y.floor());
        (self.across[lane], self.down[lane]) = (x - left, y - top);
        let width = level.width as usize;
        let last =
            [level.width, level.height].map(|side| i32::try_from(side).unwrap_or(i32::MAX) - 1);
        let columns = [left as i32, (left as i32).saturating_add(1)];
        let rows = [top as i32, (top as i32).saturating_add(1)];
        let [low, high] = columns.map(|x| x.clamp(0, last[0]) as usize);
        let [upper, lower] = rows.map(|y| y.clamp(0, last[1]) as usize * width);
        self.texels[0][lane] = word_of(level, upper + low);
        self.texels[1][lane] = word_of(level, upper + high);
        self.texels[2][lane] = word_of(level, lower + low);
        self.texels[3][lane] = word_of(level, lower + high);
    }

    /// Takes those of some lanes around (u, v) of 0..=1 of one level, clamped at the border.
    #[inline(always)]
    pub(super) fn take_all<S: Simd>(
        &mut self,
        simd: S,
        level: &PhotoPixels,
        [u, v]: [WideLanes<S>; 2],
        set: u32,
    ) {
        let lanes = WideLanes::<S>::LANES;
        let half = splat(simd, 0.5);
        let x = u * level.width as f32 - half;
        let y = v * level.height as f32 - half;
        let (left, top) = (floor(x), floor(y));
        (x - left).store(&mut self.across[..lanes]);
        (y - top).store(&mut self.down[..lanes]);
        let [mut low, mut high, mut upper, mut lower] = [[0_u32; WIDEST]; 4];
        let one = splat(simd, 1.0);
        clamped(simd, left, level.width).store_whole(&mut low[..lanes]);
        clamped(simd, left + one, level.width).store_whole(&mut high[..lanes]);
        clamped(simd, top, level.height).store_whole(&mut upper[..lanes]);
        clamped(simd, top + one, level.height).store_whole(&mut lower[..lanes]);
        let width = level.width as usize;
        for lane in set_bits(set) {
            let [upper, lower] = [upper[lane] as usize * width, lower[lane] as usize * width];
            let [low, high] = [low[lane] as usize, high[lane] as usize];
            self.texels[0][lane] = word_of(level, upper + low);
            self.texels[1][lane] = word_of(level, upper + high);
            self.texels[2][lane] = word_of(level, lower + low);
            self.texels[3][lane] = word_of(level, lower + high);
        }
    }

    /// Red, green and blue between the four, 0..=1.
    #[inline(always)]
    pub(super) fn mean<S: Simd>(&self, simd: S) -> [WideLanes<S>; 3] {
        let between = [load(simd, &self.across), load(simd, &self.down)];
        let words = [
            words_of(simd, &self.texels[0]),
            words_of(simd, &self.texels[1]),
            words_of(simd, &self.texels[2]),
            words_of(simd, &self.texels[3]),
        ];
        // Red is the lowest byte.
        [
            channel::<S>(words, 24, between),
            channel::<S>(words, 16, between),
            channel::<S>(words, 8, between),
        ]
    }
}

/// Red in the lowest byte, then green and blue.
#[inline(always)]
fn word_of(level: &PhotoPixels, at: usize) -> u32 {
    let [r, g, b] = level.rgb[at];
    u32::from_le_bytes([r, g, b, 0])
}

/// A place of a row or column of so many.
#[inline(always)]
fn clamped<S: Simd>(simd: S, at: WideLanes<S>, count: u32) -> WideLanes<S> {
    at.max(splat(simd, 0.0))
        .min(splat(simd, count as f32 - 1.0))
}

#[inline(always)]
fn words_of<S: Simd>(simd: S, words: &[u32; WIDEST]) -> S::u32s {
    WideLanes::<S>::load_words(simd, &words[..WideLanes::<S>::LANES])
}

/// The byte below so many bits of four words, between them.
#[inline(always)]
fn channel<S: Simd>(
    words: [S::u32s; 4],
    above: u32,
    [across, down]: [WideLanes<S>; 2],
) -> WideLanes<S> {
    let a = WideLanes::<S>::from_bits_of(words[0], above, 24, false);
    let b = WideLanes::<S>::from_bits_of(words[1], above, 24, false);
    let c = WideLanes::<S>::from_bits_of(words[2], above, 24, false);
    let d = WideLanes::<S>::from_bits_of(words[3], above, 24, false);
    let upper = a + across * (b - a);
    let lower = c + across * (d - c);
    (upper + down * (lower - upper)) * (1.0 / 255.0)
}
