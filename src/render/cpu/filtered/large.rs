//! Filtered splats that are larger than blocks of them hold: pixel by pixel, by the same numbers. They are few.

use crate::abi::FilteredSplat;
use crate::abi::constants::{
    COARSE_STEPS, FINE_STEPS, LARGEST_SMALL_BLENDED_PX, LEAST_COARSE, MOST_WEIGHT,
};
use crate::render::cpu::filtered::{FilteredBand, PictureArea};
use std::ops::Range;

/// Tells whether a splat is drawn here.
fn is_large(splat: &FilteredSplat) -> bool {
    splat.side_px > LARGEST_SMALL_BLENDED_PX
}

/// Leaves depths, by `of`, of the large ones of some splats in the pixels of their squares.
pub(super) fn leave_depths(
    splats: &[FilteredSplat],
    of: impl Fn(&FilteredSplat) -> f32,
    canvas: &PictureArea,
    band: &mut FilteredBand<'_>,
) {
    let [left, _, right, _] = canvas.rect_px;
    for splat in splats.iter().filter(|splat| is_large(splat)) {
        let depth = of(splat).to_bits();
        let columns = pixels_around(splat.window_px[0], splat.side_px, [left, right]);
        for y in pixels_around(splat.window_px[1], splat.side_px, band.rows) {
            for x in columns.clone() {
                let at = canvas.index(band.rows, [x, y]);
                band.front[at] = band.front[at].max(depth);
            }
        }
    }
}

/// Adds the deposits of the large ones of some splats where nothing hides them.
pub(super) fn blend(splats: &[FilteredSplat], canvas: &PictureArea, band: &mut FilteredBand<'_>) {
    let [left, _, right, _] = canvas.rect_px;
    for splat in splats.iter().filter(|splat| is_large(splat)) {
        let window = splat
            .window_px
            .map(|v| (v * 256.0).round_ties_even() / 256.0);
        let [wide, high] = splat.extent_px;
        if !(wide > 0.0 && high > 0.0) {
            continue;
        }
        let density = splat.area_px / (wide * high);
        let depth = splat.depth.to_bits();
        let columns = pixels_of(window[0], wide, [left, right]);
        for y in pixels_of(window[1], high, band.rows) {
            let down = overlap(y, window[1], high);
            for x in columns.clone() {
                let weight = overlap(x, window[0], wide) * down * density;
                let at = canvas.index(band.rows, [x, y]);
                if weight > 0.0 && band.front[at] <= depth {
                    deposit(
                        canvas,
                        &mut band.sums[canvas.words() * at..],
                        splat.color,
                        weight,
                    );
                }
            }
        }
    }
}

/// Pixels whose centers are within half a side of a position, in whole steps of 1/256 pixel, out of a range.
fn pixels_around(window: f32, side_px: f32, [least, most]: [u32; 2]) -> Range<u32> {
    let steps = (side_px.max(1.0) * 256.0).round_ties_even() as i64;
    let low = (window * 256.0).round_ties_even() as i64 - (steps >> 1) + 127;
    let first = (low >> 8).clamp(i64::from(least), i64::from(most));
    let end = ((low + steps) >> 8).clamp(first, i64::from(most));
    first as u32..end as u32
}

/// Pixels that an extent around a position reaches into, out of a range.
fn pixels_of(window: f32, extent: f32, [least, most]: [u32; 2]) -> Range<u32> {
    let within = |v: f32| v.clamp(least as f32, most as f32) as u32;
    let first = within((window - 0.5 * extent).floor());
    first..within((window + 0.5 * extent).ceil()).max(first)
}

/// Length of a pixel that an extent around a position covers.
fn overlap(pixel: u32, window: f32, extent: f32) -> f32 {
    let distance = (pixel as f32 + 0.5 - window).abs();
    (0.5 * (extent + 1.0) - distance).clamp(0.0, extent.min(1.0))
}

/// Adds a color with a weight to the sums of a pixel.
fn deposit(canvas: &PictureArea, sums: &mut [u64], color: [f32; 3], weight: f32) {
    let weight = weight.min(MOST_WEIGHT);
    let is_fine = weight < LEAST_COARSE;
    let steps = weight * if is_fine { FINE_STEPS } else { COARSE_STEPS };
    let whole = |value: f32| u64::from((value + 0.5) as u32);
    let [red, green, blue] = color.map(|channel| whole(channel * steps));
    let weight = whole(steps);
    let mut add = |word: usize, low: u64, high: u64| {
        sums[word] = sums[word].wrapping_add(low | high << 32);
    };
    match canvas.is_gray {
        true => add(usize::from(is_fine), red, weight),
        false => {
            let first = 2 * usize::from(is_fine);
            add(first, red, green);
            add(first + 1, blue, weight);
        }
    }
}
