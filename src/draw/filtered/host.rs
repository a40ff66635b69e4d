//! Small filtered splats by the host, for software devices: what passes filtered.depth and filtered.blend leave in storage.
//!
//! A software device is the host itself, in a roundabout way: it goes through the lanes of each write one by one, locks
//! what two threads might write, and reads each record twice. Here the picture is cut into bands of rows, each the job of
//! one thread from beginning to end, so nothing is locked: a band is emptied, then the nearest pushed depth of each pixel is
//! found, then deposits are added where that does not hide them. What is left is the same to the bit as what the shaders
//! leave (`shaders/filtered/depth.comp`, `shaders/filtered/blend.comp`), which have the rules: a pixel's maximum and sums
//! of whole numbers do not depend on any order, and each number is made by the same operations.

#[cfg(test)]
mod tests;

use crate::abi::FilteredSplat;
use crate::abi::constants::{
    COARSE_STEPS, FILTERED_TILE_PX, FINE_STEPS, LARGEST_SMALL_BLENDED_PX, LEAST_COARSE, MOST_WEIGHT,
};
use crate::draw::parts;
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x4, i32x4, mask32x4, u32x4};

/// Rows of a band: whole tiles.
const BAND_PX: u32 = 4 * FILTERED_TILE_PX;
/// Splats whose rows are known together. They lie near each other, in the order of the tree.
const GROUP: usize = 16;

/// The part of a picture that is drawn in, and what of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Canvas {
    /// Left, top, and one past right and bottom, pixels.
    pub rect_px: [u32; 4],
    /// Red, green and blue are the same in every splat.
    pub is_gray: bool,
}

impl Canvas {
    fn width(&self) -> usize {
        (self.rect_px[2] - self.rect_px[0]) as usize
    }

    /// How many pixels it has.
    pub fn pixels(&self) -> usize {
        self.width() * (self.rect_px[3] - self.rect_px[1]) as usize
    }

    /// Words of the sums of a pixel, see `shaders/common/fixed_sums.glsl`.
    pub fn words(&self) -> usize {
        if self.is_gray { 2 } else { 4 }
    }
}

/// One band of the picture.
struct Band<'a> {
    /// First row and one past the last.
    rows: [u32; 2],
    front: &'a mut [u32],
    sums: &'a mut [u64],
    tiles: Vec<[f32; 2]>,
}

/// Splats that lie near each other.
#[derive(Debug, Clone, Copy, Default)]
struct Group {
    /// The first, and how many they are.
    first: u32,
    count: u16,
    /// The first row that they may touch, and one past the last.
    rows: [u16; 2],
}

/// The splats of a list, a few together, as [`draw`] goes through them.
#[derive(Debug, Default)]
pub struct Groups {
    groups: Vec<Group>,
    /// Some are larger than [`LARGEST_SMALL_BLENDED_PX`].
    has_large: bool,
}

impl Groups {
    /// Those of a list without gaps.
    pub fn of(splats: &[FilteredSplat]) -> Self {
        let mut groups = Self::default();
        groups.add(0, splats);
        groups
    }

    /// Adds splats whose first lies at a place of the list.
    pub(super) fn add(&mut self, first: usize, splats: &[FilteredSplat]) {
        let groups = splats.chunks(GROUP).enumerate();
        self.groups.extend(groups.map(|(index, splats)| Group {
            first: (first + index * GROUP) as u32,
            count: splats.len() as u16,
            rows: rows_of(splats),
        }));
        let is_large = |splat: &FilteredSplat| splat.side_px > LARGEST_SMALL_BLENDED_PX;
        self.has_large |= splats.iter().any(is_large);
    }

    /// Adds those of another part of the list.
    pub(super) fn append(&mut self, mut others: Self) {
        self.groups.append(&mut others.groups);
        self.has_large |= others.has_large;
    }

    /// Whether [`draw`] draws them.
    pub fn are_small(&self) -> bool {
        !self.has_large
    }
}

/// Draws the splats of a list that are in `groups`, all of which are no larger than [`LARGEST_SMALL_BLENDED_PX`]. `front` and `sums` become what storage of the canvas holds after the passes by compute, whatever they held; the first so
/// many words, see [`Canvas::pixels`] and [`Canvas::words`]. `tiles` become the
/// centers of the squares of [`FILTERED_TILE_PX`] pixels, counted from the picture's corner, that have a depth or a deposit
/// in them.
///
/// # Panics
/// When `front` or `sums` is shorter than that, `groups` are of another list, or some splats are too large.
pub fn draw(
    (splats, groups): (&[FilteredSplat], &Groups),
    canvas: Canvas,
    front: &mut [u32],
    sums: &mut [u64],
    tiles: &mut Vec<[f32; 2]>,
) {
    draw_by(Level::new(), (splats, groups), canvas, (front, sums), tiles);
}

/// The same by vectors of a level.
fn draw_by(
    level: Level,
    (splats, groups): (&[FilteredSplat], &Groups),
    canvas: Canvas,
    (front, sums): (&mut [u32], &mut [u64]),
    tiles: &mut Vec<[f32; 2]>,
) {
    assert!(groups.are_small(), "large splats are the rasterizer's");
    let mut bands = bands(canvas, front, sums);
    parts::share(splats.len(), bands.iter_mut(), |band| {
        dispatch!(level, simd => if canvas.is_gray {
            draw_band::<_, true>(simd, splats, &groups.groups, &canvas, band)
        } else {
            draw_band::<_, false>(simd, splats, &groups.groups, &canvas, band)
        });
    });
    tiles.clear();
    tiles.extend(bands.iter().flat_map(|band| &band.tiles));
}

/// The rows that splats may touch; none where they are no numbers.
fn rows_of(splats: &[FilteredSplat]) -> [u16; 2] {
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for splat in splats {
        // Half of the larger of square and rectangle, and what rounding to steps moves.
        let reach = 0.5 * splat.side_px.max(splat.extent_px[1]).max(1.0) + 1.0 / 64.0;
        low = low.min(splat.window_px[1] - reach);
        high = high.max(splat.window_px[1] + reach);
    }
    // Saturating: what lies outside of all pictures stays outside.
    [low as u16, high.ceil() as u16]
}

/// The bands of a canvas, which begin at whole multiples of their height.
fn bands<'a>(canvas: Canvas, mut front: &'a mut [u32], mut sums: &'a mut [u64]) -> Vec<Band<'a>> {
    let [_, top, _, bottom] = canvas.rect_px;
    let mut bands = Vec::new();
    let mut first = top;
    while first < bottom {
        let end = ((first / BAND_PX + 1) * BAND_PX).min(bottom);
        let pixels = (end - first) as usize * canvas.width();
        let own;
        (own, front) = front.split_at_mut(pixels);
        let own_sums;
        (own_sums, sums) = sums.split_at_mut(pixels * canvas.words());
        bands.push(Band {
            rows: [first, end],
            front: own,
            sums: own_sums,
            tiles: Vec::new(),
        });
        first = end;
    }
    bands
}

/// Which of four lanes are the first so many.
const LANES: [[u32; 4]; 5] = {
    const ALL: u32 = u32::MAX;
    [
        [0, 0, 0, 0],
        [ALL, 0, 0, 0],
        [ALL, ALL, 0, 0],
        [ALL, ALL, ALL, 0],
        [ALL, ALL, ALL, ALL],
    ]
};

/// Four rows become four columns.
#[inline(always)]
fn columns<S: Simd>([a, b, c, d]: [f32x4<S>; 4]) -> [f32x4<S>; 4] {
    let (ac, bd) = (a.zip_low(c), b.zip_low(d));
    let (ac_high, bd_high) = (a.zip_high(c), b.zip_high(d));
    [
        ac.zip_low(bd),
        ac.zip_high(bd),
        ac_high.zip_low(bd_high),
        ac_high.zip_high(bd_high),
    ]
}

/// The words of four splats, three vectors each; what is missing of four is nothing.
#[inline(always)]
fn four(splats: &[FilteredSplat]) -> [[f32; 12]; 4] {
    let of = |i: usize| splats.get(i).map_or([0.0; 12], |s| bytemuck::cast(*s));
    [of(0), of(1), of(2), of(3)]
}

#[inline(always)]
fn part<S: Simd>(simd: S, words: &[[f32; 12]; 4], at: usize) -> [f32x4<S>; 4] {
    let of = |i: usize| f32x4::from_slice(simd, &words[i][at..at + 4]);
    columns([of(0), of(1), of(2), of(3)])
}

#[inline(always)]
fn draw_band<S: Simd, const GRAY: bool>(
    simd: S,
    splats: &[FilteredSplat],
    groups: &[Group],
    canvas: &Canvas,
    band: &mut Band<'_>,
) {
    band.front.fill(0);
    band.sums.fill(0);
    let [first, end] = band.rows;
    let is_near =
        |group: &&Group| u32::from(group.rows[0]) < end && u32::from(group.rows[1]) > first;
    let near: Vec<&[FilteredSplat]> = (groups.iter().filter(is_near))
        .map(|group| &splats[group.first as usize..][..usize::from(group.count)])
        .collect();
    for splats in &near {
        for splats in splats.chunks(4) {
            depth(simd, &four(splats), canvas, band);
        }
    }
    for splats in &near {
        for splats in splats.chunks(4) {
            blend::<S, GRAY>(simd, &four(splats), canvas, band);
        }
    }
    find_tiles::<GRAY>(canvas, band);
}

/// Leaves the pushed depths of four splats in the pixels of their squares, see `shaders/common/square.glsl`.
#[inline(always)]
fn depth<S: Simd>(simd: S, words: &[[f32; 12]; 4], canvas: &Canvas, band: &mut Band<'_>) {
    let [x, y, pushed, own_side] = part(simd, words, 0);
    let [left, top, right, bottom] = canvas.rect_px;
    let float = |v: u32| f32x4::splat(simd, v as f32);
    let int = |v: u32| i32x4::splat(simd, v as i32);
    let side = own_side.max(f32x4::splat(simd, 1.0));
    let is_drawn = pushed.simd_gt(0.0)
        & own_side.simd_le(LARGEST_SMALL_BLENDED_PX)
        & x.simd_gt(float(left) - side)
        & x.simd_lt(float(right) + side)
        & y.simd_gt(float(top) - side)
        & y.simd_lt(float(bottom) + side);
    let steps = (side * 256.0).round_ties_even().to_int::<i32x4<S>>();
    let (first_x, end_x) = pixels_around(x, steps, [int(left), int(right)]);
    let (first_y, end_y) = pixels_around(y, steps, band.rows.map(int));
    let is_drawn = is_drawn & first_x.simd_lt(end_x) & first_y.simd_lt(end_y);
    let width = canvas.width();
    let at = (first_y - int(band.rows[0])) * int(width as u32) + (first_x - int(left));
    let (at, rows, columns) = (
        at.to_array(),
        (end_y - first_y).to_array(),
        (end_x - first_x).to_array(),
    );
    let pushed: [u32; 4] = pushed.to_bits().to_array();
    let mut lanes = is_drawn.to_bitmask();
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize & 3;
        lanes &= lanes - 1;
        let depth = u32x4::splat(simd, pushed[lane]);
        let (mut at, mut left) = (at[lane] as usize, columns[lane] as usize);
        while left > 0 {
            let depth = depth & u32x4::from_slice(simd, &LANES[left.min(4)]);
            let mut row = at;
            for _ in 0..rows[lane] {
                with_four(band.front, row, |four| {
                    u32x4::from_slice(simd, four).max(depth).store_slice(four);
                });
                row += width;
            }
            at += 4;
            left = left.saturating_sub(4);
        }
    }
}

/// The first pixel whose center is within half of `steps` steps of 1/256 pixel around a position, and one past the last.
#[inline(always)]
fn pixels_around<S: Simd>(
    window: f32x4<S>,
    steps: i32x4<S>,
    [least, most]: [i32x4<S>; 2],
) -> (i32x4<S>, i32x4<S>) {
    let low = (window * 256.0).round_ties_even().to_int::<i32x4<S>>() - (steps >> 1) + 127;
    ((low >> 8).max(least), ((low + steps) >> 8).min(most))
}

/// Lets `change` have four words from a place on, or what there is of them.
#[inline(always)]
fn with_four(words: &mut [u32], at: usize, change: impl Fn(&mut [u32; 4])) {
    let rest = &mut words[at..];
    if let Some(four) = rest.first_chunk_mut() {
        return change(four);
    }
    let mut four = [0; 4];
    four[..rest.len()].copy_from_slice(rest);
    change(&mut four);
    rest.copy_from_slice(&four[..rest.len()]);
}

/// Adds the deposits of four splats to the sums of the pixels that they overlap and are not hidden in.
#[inline(always)]
fn blend<S: Simd, const GRAY: bool>(
    simd: S,
    words: &[[f32; 12]; 4],
    canvas: &Canvas,
    band: &mut Band<'_>,
) {
    let [x, y, _, side] = part(simd, words, 0);
    let [depth, area, wide, high] = part(simd, words, 4);
    let [left, top, right, bottom] = canvas.rect_px.map(|v| v as f32);
    // In steps of 1/256 pixel, as a rasterizer has it.
    let step = |v: f32x4<S>| (v * 256.0).round_ties_even() * (1.0 / 256.0);
    let (x, y) = (step(x), step(y));
    let clamped = |v: f32x4<S>, least: f32, most: f32| {
        v.max(f32x4::splat(simd, least))
            .min(f32x4::splat(simd, most))
    };
    let (half_wide, half_high) = (wide * 0.5, high * 0.5);
    let low_x = clamped((x - half_wide).floor(), left, right);
    let end_x = clamped((x + half_wide).ceil(), left, right);
    let [first, end] = band.rows;
    let low_y = clamped((y - half_high).floor(), top, bottom).max(f32x4::splat(simd, first as f32));
    let end_y = clamped((y + half_high).ceil(), top, bottom).min(f32x4::splat(simd, end as f32));
    let is_drawn = side.simd_le(LARGEST_SMALL_BLENDED_PX)
        & wide.simd_gt(0.0)
        & high.simd_gt(0.0)
        & low_x.simd_lt(end_x)
        & low_y.simd_lt(end_y);
    let mut lanes = is_drawn.to_bitmask();
    if lanes == 0 {
        return;
    }
    let density = (area / (wide * high)).to_array();
    // The most of an overlap, and where it begins to fall off.
    let one = f32x4::splat(simd, 1.0);
    let (most_x, most_y) = (wide.min(one).to_array(), high.min(one).to_array());
    let (reach_x, reach_y) = (
        ((wide + 1.0) * 0.5).to_array(),
        ((high + 1.0) * 0.5).to_array(),
    );
    let zero = f32x4::splat(simd, 0.0);
    let from_x = (low_x + 0.5 - x).to_array();
    let from_y = (low_y + 0.5 - y).to_array();
    let depth: [u32; 4] = depth.to_bits().to_array();
    let width = canvas.width();
    let columns = (end_x - low_x).to_array();
    let rows = (end_y - low_y).to_array();
    let at = (low_y - first as f32).to_int::<i32x4<S>>() * i32x4::splat(simd, width as i32)
        + (low_x - left).to_int::<i32x4<S>>();
    let at = at.to_array();
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize & 3;
        lanes &= lanes - 1;
        let color = &words[lane][8..11];
        let depth = u32x4::splat(simd, depth[lane]);
        let (mut at, mut left) = (at[lane] as usize, columns[lane] as usize);
        let mut from_x = f32x4::from_slice(simd, &[0.0, 1.0, 2.0, 3.0]) + from_x[lane];
        while left > 0 {
            let is_in = u32x4::from_slice(simd, &LANES[left.min(4)]);
            let own_x = (f32x4::splat(simd, reach_x[lane]) - from_x.abs())
                .max(zero)
                .min(f32x4::splat(simd, most_x[lane]));
            // Nothing beyond the last column, which may be that of the canvas.
            let own_x = is_in.simd_gt(0).select(own_x, zero);
            let mut row = at;
            let mut from_y = from_y[lane];
            for _ in 0..rows[lane] as u32 {
                let own_y = (reach_y[lane] - from_y.abs()).max(0.0).min(most_y[lane]);
                let weight = own_x * own_y * density[lane];
                deposit::<S, GRAY>(simd, band, row, weight, depth, color);
                row += width;
                from_y += 1.0;
            }
            from_x += 4.0;
            at += 4;
            left = left.saturating_sub(4);
        }
    }
}

/// One deposit in each of four pixels of a row, where the weight is above 0 and nothing hides it.
#[inline(always)]
fn deposit<S: Simd, const GRAY: bool>(
    simd: S,
    band: &mut Band<'_>,
    at: usize,
    weight: f32x4<S>,
    depth: u32x4<S>,
    color: &[f32],
) {
    let front = &band.front[at..];
    let mut own = [0; 4];
    let front = match front.first_chunk::<4>() {
        Some(front) => front,
        None => {
            own[..front.len()].copy_from_slice(front);
            &own
        }
    };
    let is_seen = u32x4::from_slice(simd, front).simd_le(depth) & weight.simd_gt(0.0);
    if !is_seen.any_true() {
        return;
    }
    let weight = weight.min(f32x4::splat(simd, MOST_WEIGHT));
    let is_fine = weight.simd_lt(LEAST_COARSE);
    let steps = weight
        * is_fine.select(
            f32x4::splat(simd, FINE_STEPS),
            f32x4::splat(simd, COARSE_STEPS),
        );
    // Without what is not seen: 0.
    let weights = whole(simd, is_seen, steps);
    let reds = whole(simd, is_seen, steps * color[0]);
    let fine: [u32; 4] = is_fine
        .select(u32x4::splat(simd, 1), u32x4::splat(simd, 0))
        .to_array();
    if GRAY {
        let pairs = pairs(reds, weights);
        let sums = &mut band.sums[2 * at..];
        if let Some(sums) = sums.first_chunk_mut::<8>() {
            for lane in 0..4 {
                let sum = &mut sums[2 * lane + (fine[lane] & 1) as usize];
                *sum = sum.wrapping_add(pairs[lane]);
            }
        } else {
            for lane in 0..4 {
                if let Some(sum) = sums.get_mut(2 * lane + fine[lane] as usize) {
                    *sum = sum.wrapping_add(pairs[lane]);
                }
            }
        }
        return;
    }
    let sums = &mut band.sums[4 * at..];
    let (greens, blues) = (
        whole(simd, is_seen, steps * color[1]),
        whole(simd, is_seen, steps * color[2]),
    );
    let (firsts, seconds) = (pairs(reds, greens), pairs(blues, weights));
    for lane in 0..4 {
        let word = 4 * lane + 2 * fine[lane] as usize;
        if let Some([first, second]) = sums.get_mut(word..word + 2) {
            *first = first.wrapping_add(firsts[lane]);
            *second = second.wrapping_add(seconds[lane]);
        }
    }
}

/// The nearest whole numbers, upward from the middle; 0 in other lanes.
#[inline(always)]
fn whole<S: Simd>(simd: S, lanes: mask32x4<S>, v: f32x4<S>) -> i32x4<S> {
    lanes.select(v + 0.5, f32x4::splat(simd, 0.0)).to_int()
}

/// Words of two whole numbers, the first in the low half.
#[inline(always)]
fn pairs<S: Simd>(low: i32x4<S>, high: i32x4<S>) -> [u64; 4] {
    let both = [low.zip_low(high).to_array(), low.zip_high(high).to_array()];
    let words: [u64; 4] = bytemuck::cast(both);
    // In memory the first is the low half only where the least byte comes first.
    match cfg!(target_endian = "big") {
        true => words.map(|word| word.rotate_left(32)),
        false => words,
    }
}

/// The tiles of a band that have anything in them.
#[inline(always)]
fn find_tiles<const GRAY: bool>(canvas: &Canvas, band: &mut Band<'_>) {
    let words = if GRAY { 2 } else { 4 };
    let (width, tile) = (canvas.width(), FILTERED_TILE_PX as usize);
    let [left, _, right, _] = canvas.rect_px;
    let first_tile = left / FILTERED_TILE_PX;
    let tiles = right.div_ceil(FILTERED_TILE_PX) - first_tile;
    let (mut row, end) = (band.rows[0], band.rows[1]);
    while row < end {
        let below = ((row / FILTERED_TILE_PX + 1) * FILTERED_TILE_PX).min(end);
        for column in first_tile..first_tile + tiles {
            let x = (column * FILTERED_TILE_PX).max(left) - left;
            let end_x = ((column + 1) * FILTERED_TILE_PX).min(right) - left;
            let has_any = (row..below).any(|y| {
                let at = (y - band.rows[0]) as usize * width;
                let (first, last) = (at + x as usize, at + end_x as usize);
                let front = band.front[first..last].iter().fold(0, |a, b| a | b);
                let sums = &band.sums[words * first..words * last];
                front != 0 || sums.iter().fold(0, |a, b| a | b) != 0
            });
            if has_any {
                let center = |i: u32| (i * FILTERED_TILE_PX) as f32 + 0.5 * tile as f32;
                band.tiles
                    .push([center(column), center(row / FILTERED_TILE_PX)]);
            }
        }
        row = below;
    }
}
