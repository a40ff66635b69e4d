//! The second pass: deposits where nothing hides them.

use crate::abi::constants::{
    COARSE_STEPS, FINE_STEPS, LARGEST_SMALL_BLENDED_PX, LEAST_COARSE, MOST_WEIGHT,
};
use crate::render::cpu::filtered::splat_block::{
    BLOCK, Block, LANES, ROW, SetLanes, columns, of_rows, part,
};
use crate::render::cpu::filtered::{FilteredBand, PictureArea};
use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x16, i32x16, mask32x16, u32x4, u32x16, u64x8};

/// Adds the deposits of a block of splats to the sums of the pixels that they overlap and are not hidden in.
#[inline(always)]
pub(super) fn draw<S: Simd, const GRAY: bool>(
    simd: S,
    block: &Block<'_>,
    canvas: &PictureArea,
    band: &mut FilteredBand<'_>,
) {
    let [x, y, _, side] = part(simd, block, 0);
    let [depth, area, wide, high] = part(simd, block, 4);
    let [left, _, right, _] = canvas.rect_px.map(|v| v as f32);
    let [first, end] = band.rows.map(|row| row as f32);
    let (x, y) = (in_steps(x), in_steps(y));
    let (half_wide, half_high) = (wide * 0.5, high * 0.5);
    let low_x = clamped((x - half_wide).floor(), left, right);
    let end_x = clamped((x + half_wide).ceil(), left, right);
    let low_y = clamped((y - half_high).floor(), first, end);
    let end_y = clamped((y + half_high).ceil(), first, end);
    let is_drawn = side.simd_le(LARGEST_SMALL_BLENDED_PX)
        & wide.simd_gt(0.0)
        & high.simd_gt(0.0)
        & low_x.simd_lt(end_x)
        & low_y.simd_lt(end_y);
    if !is_drawn.any_true() {
        return;
    }
    let width = canvas.width();
    let (columns, rows) = (end_x - low_x, end_y - low_y);
    let rows_whole: i32x16<S> = rows.to_int();
    let stride = i32x16::splat(simd, width as i32);
    let (from_top, from_left): (i32x16<S>, i32x16<S>) =
        ((low_y - first).to_int(), (low_x - left).to_int());
    let at = from_top * stride + from_left;
    let last = at + (rows_whole - 1) * stride;
    let is_short = columns.simd_le(ROW as f32)
        & rows.simd_le(ROW as f32)
        & last.simd_le(band.front.len() as i32 - ROW as i32);
    let across = AxisOverlaps::new(simd, low_x + 0.5 - x, wide, columns);
    let down = AxisOverlaps::new(simd, low_y + 0.5 - y, high, rows);
    let (across_four, down_four) = (across.with_four(simd), down.with_four(simd));
    let at = at.to_array();
    let depth: [u32; BLOCK] = depth.to_bits().to_array();
    let density = (area / (wide * high)).to_array();
    let row_count = rows_whole.to_array();
    for lane in SetLanes((is_drawn & is_short).to_bitmask()) {
        let splat = BlendedSplat {
            depth: depth[lane],
            density: density[lane],
            color: &block[lane].color,
        };
        let at = at[lane] as usize;
        // Rows beyond the last, where the overlap is 0, are the first once more.
        let rows = [0, 1, 2, 3].map(|row: usize| match (row as i32) < row_count[lane] {
            true => at + row * width,
            false => at,
        });
        let across = f32x4::from_slice(simd, &across_four[lane]);
        splat.in_rows::<S, GRAY>(simd, across, &down_four[lane], rows, band);
    }
    let is_long = (is_drawn & !is_short).to_bitmask();
    if is_long == 0 {
        return;
    }
    let (across, down) = (across.lines(), down.lines());
    for lane in SetLanes(is_long) {
        let splat = BlendedSplat {
            depth: depth[lane],
            density: density[lane],
            color: &block[lane].color,
        };
        let lines = (across[lane], down[lane]);
        splat.in_many::<S, GRAY>(simd, lines, at[lane] as usize, width, band);
    }
}

/// In steps of 1/256 pixel, as a rasterizer has it.
#[inline(always)]
fn in_steps<S: Simd>(v: f32x16<S>) -> f32x16<S> {
    (v * 256.0).round_ties_even() * (1.0 / 256.0)
}

#[inline(always)]
fn clamped<S: Simd>(v: f32x16<S>, least: f32, most: f32) -> f32x16<S> {
    let simd = v.token();
    v.max(f32x16::splat(simd, least))
        .min(f32x16::splat(simd, most))
}

/// The overlaps of splats with pixels along one axis.
#[derive(Clone, Copy)]
struct AxisOverlaps<S: Simd> {
    /// From the center to that of the first pixel.
    from: f32x16<S>,
    /// From where on there is none.
    reach: f32x16<S>,
    most: f32x16<S>,
    /// How many pixels.
    count: f32x16<S>,
}

impl<S: Simd> AxisOverlaps<S> {
    #[inline(always)]
    fn new(simd: S, from: f32x16<S>, extent: f32x16<S>, count: f32x16<S>) -> Self {
        Self {
            from,
            reach: (extent + 1.0) * 0.5,
            most: extent.min(f32x16::splat(simd, 1.0)),
            count,
        }
    }

    /// Overlaps with the first four pixels, splat by splat; 0 beyond the last pixel.
    #[inline(always)]
    fn with_four(&self, simd: S) -> [[f32; ROW]; BLOCK] {
        let mut all = [[0.0; ROW]; BLOCK];
        let of_splats = columns([
            self.with(simd, 0.0),
            self.with(simd, 1.0),
            self.with(simd, 2.0),
            self.with(simd, 3.0),
        ]);
        let out = bytemuck::cast_slice_mut::<_, f32>(&mut all).chunks_exact_mut(BLOCK);
        for (out, of_splats) in out.zip(of_splats) {
            of_splats.store_slice(out);
        }
        all
    }

    /// Overlap with one pixel.
    #[inline(always)]
    fn with(&self, simd: S, pixel: f32) -> f32x16<S> {
        let zero = f32x16::splat(simd, 0.0);
        let distance = (self.from + pixel).abs();
        let overlap = (self.reach - distance).max(zero).min(self.most);
        self.count.simd_gt(pixel).select(overlap, zero)
    }

    fn lines(&self) -> [SplatAxis; BLOCK] {
        let (from, reach) = (self.from.to_array(), self.reach.to_array());
        let (most, count) = (self.most.to_array(), self.count.to_array());
        std::array::from_fn(|lane| SplatAxis {
            from: from[lane],
            reach: reach[lane],
            most: most[lane],
            count: count[lane] as usize,
        })
    }
}

/// An [`AxisOverlaps`] of one splat.
#[derive(Clone, Copy)]
struct SplatAxis {
    from: f32,
    reach: f32,
    most: f32,
    count: usize,
}

impl SplatAxis {
    /// The overlaps with four pixels from one on; 0 beyond the last, which may be that of the canvas.
    #[inline(always)]
    fn with_four<S: Simd>(&self, simd: S, first: usize) -> f32x4<S> {
        let from = f32x4::from_slice(simd, &[0.0, 1.0, 2.0, 3.0]) + (self.from + first as f32);
        let zero = f32x4::splat(simd, 0.0);
        let overlap = (f32x4::splat(simd, self.reach) - from.abs())
            .max(zero)
            .min(f32x4::splat(simd, self.most));
        let is_in = u32x4::from_slice(simd, &LANES[(self.count - first).min(ROW)]);
        is_in.simd_gt(0).select(overlap, zero)
    }
}

/// What a splat leaves where it is seen.
struct BlendedSplat<'a> {
    /// Bits of its depth.
    depth: u32,
    /// Area over that of the rectangle.
    density: f32,
    color: &'a [f32; 3],
}

impl BlendedSplat<'_> {
    /// In four pixels of each of four rows, which begin at these places and all lie in the band.
    #[inline(always)]
    fn in_rows<S: Simd, const GRAY: bool>(
        &self,
        simd: S,
        across: f32x4<S>,
        down: &[f32; ROW],
        rows: [usize; ROW],
        band: &mut FilteredBand<'_>,
    ) {
        let down = of_rows([
            f32x4::splat(simd, down[0]),
            f32x4::splat(simd, down[1]),
            f32x4::splat(simd, down[2]),
            f32x4::splat(simd, down[3]),
        ]);
        let weight = f32x16::block_splat(across) * down * self.density;
        let front = band
            .front_of(simd, rows[0])
            .combine(band.front_of(simd, rows[1]))
            .combine(
                band.front_of(simd, rows[2])
                    .combine(band.front_of(simd, rows[3])),
            );
        let is_seen = front.simd_le(u32x16::splat(simd, self.depth)) & weight.simd_gt(0.0);
        if !is_seen.any_true() {
            return;
        }
        let [coarse, fine] = deposits::<S, GRAY>(simd, weight, is_seen, self.color);
        if GRAY {
            let all = match cfg!(target_endian = "big") {
                false => [coarse[0], coarse[3], fine[0], fine[3]],
                true => [coarse[3], coarse[0], fine[3], fine[0]],
            };
            let own = columns(all);
            for (at, own) in rows.into_iter().zip(own) {
                add(simd, &mut band.sums[2 * at..], own.bitcast());
            }
            return;
        }
        let (rg, bw) = (pairs(coarse[0], coarse[1]), pairs(coarse[2], coarse[3]));
        let (fine_rg, fine_bw) = (pairs(fine[0], fine[1]), pairs(fine[2], fine[3]));
        for (half, rows) in rows.chunks_exact(2).enumerate() {
            let own = columns([rg[half], bw[half], fine_rg[half], fine_bw[half]]);
            for (at, own) in rows.iter().zip(own.chunks_exact(2)) {
                let sums = &mut band.sums[4 * at..];
                add(simd, sums, own[0]);
                add(simd, &mut sums[8..], own[1]);
            }
        }
    }

    /// In as many rows and columns as it has, from a place on.
    #[inline(always)]
    fn in_many<S: Simd, const GRAY: bool>(
        &self,
        simd: S,
        (across, down): (SplatAxis, SplatAxis),
        at: usize,
        width: usize,
        band: &mut FilteredBand<'_>,
    ) {
        for first in (0..across.count).step_by(ROW) {
            let weights = across.with_four(simd, first);
            for first_row in (0..down.count).step_by(ROW) {
                let at = at + first + first_row * width;
                let overlaps = down.with_four(simd, first_row).to_array();
                let count = (down.count - first_row).min(ROW);
                if at + (count - 1) * width + ROW <= band.front.len() {
                    let row = |row: usize| at + if row < count { row * width } else { 0 };
                    let rows = [row(0), row(1), row(2), row(3)];
                    self.in_rows::<S, GRAY>(simd, weights, &overlaps, rows, band);
                } else {
                    for (row, overlap) in overlaps[..count].iter().enumerate() {
                        let weights = (weights * *overlap).to_array();
                        self.at_end::<S, GRAY>(simd, &weights, at + row * width, band);
                    }
                }
            }
        }
    }

    /// In some pixels at the end of the band, of which only the first may be there.
    #[inline(always)]
    fn at_end<S: Simd, const GRAY: bool>(
        &self,
        simd: S,
        overlaps: &[f32; ROW],
        at: usize,
        band: &mut FilteredBand<'_>,
    ) {
        let words = if GRAY { 2 } else { 4 };
        let front = band.front[at..].iter();
        let sums = band.sums[words * at..].chunks_exact_mut(words);
        for ((overlap, front), sums) in overlaps.iter().zip(front).zip(sums) {
            let weight = overlap * self.density;
            let is_seen = *front <= self.depth && weight > 0.0;
            let is_seen = mask32x16::splat(simd, is_seen);
            let weight = f32x16::splat(simd, weight);
            let [coarse, fine] = deposits::<S, GRAY>(simd, weight, is_seen, self.color)
                .map(|numbers| numbers.map(|number| u64::from(number[0].cast_unsigned())));
            let own = [coarse, fine].map(|[r, g, b, w]| match GRAY {
                true => [r | w << 32, 0],
                false => [r | g << 32, b | w << 32],
            });
            let own = own.iter().flat_map(|own| &own[..words / 2]);
            for (sum, own) in sums.iter_mut().zip(own) {
                *sum = sum.wrapping_add(*own);
            }
        }
    }
}

impl FilteredBand<'_> {
    /// The nearest depths of four pixels from a place on, all of which are there.
    #[inline(always)]
    fn front_of<S: Simd>(&self, simd: S, at: usize) -> u32x4<S> {
        let four = self.front[at..].first_chunk::<ROW>();
        u32x4::from_slice(simd, four.unwrap_or(&[u32::MAX; ROW]))
    }
}

/// Red, green, blue and weight in whole steps: coarse ones and fine ones, 0 where these are not meant or nothing is seen.
/// Of gray ones red stands for all.
#[inline(always)]
fn deposits<S: Simd, const GRAY: bool>(
    simd: S,
    weight: f32x16<S>,
    is_seen: mask32x16<S>,
    color: &[f32; 3],
) -> [[i32x16<S>; 4]; 2] {
    let weight = weight.min(f32x16::splat(simd, MOST_WEIGHT));
    let is_fine = weight.simd_lt(LEAST_COARSE);
    let scale = is_fine.select(
        f32x16::splat(simd, FINE_STEPS),
        f32x16::splat(simd, COARSE_STEPS),
    );
    let steps = weight * scale;
    let zero = i32x16::splat(simd, 0);
    let red = whole(is_seen, steps * color[0]);
    let (green, blue) = match GRAY {
        true => (zero, zero),
        false => (
            whole(is_seen, steps * color[1]),
            whole(is_seen, steps * color[2]),
        ),
    };
    let weight = whole(is_seen, steps);
    [
        [
            is_fine.select(zero, red),
            is_fine.select(zero, green),
            is_fine.select(zero, blue),
            is_fine.select(zero, weight),
        ],
        [
            is_fine.select(red, zero),
            is_fine.select(green, zero),
            is_fine.select(blue, zero),
            is_fine.select(weight, zero),
        ],
    ]
}

/// The nearest whole numbers, upward from the middle; 0 in other lanes.
#[inline(always)]
fn whole<S: Simd>(lanes: mask32x16<S>, v: f32x16<S>) -> i32x16<S> {
    let zero = f32x16::splat(v.token(), 0.0);
    lanes.select(v + 0.5, zero).to_int()
}

/// Words of two whole numbers, the first in the low half.
#[inline(always)]
fn pairs<S: Simd>(low: i32x16<S>, high: i32x16<S>) -> [u64x8<S>; 2] {
    // In memory the first is the low half only where the least byte comes first.
    let (low, high) = match cfg!(target_endian = "big") {
        false => (low, high),
        true => (high, low),
    };
    [low.zip_low(high).bitcast(), low.zip_high(high).bitcast()]
}

/// Adds to the first eight words.
#[inline(always)]
fn add<S: Simd>(simd: S, words: &mut [u64], own: u64x8<S>) {
    if let Some(words) = words.first_chunk_mut::<8>() {
        (u64x8::from_slice(simd, words) + own).store_slice(words);
    }
}
