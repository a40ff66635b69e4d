//! The first pass: the nearest pushed depth of each pixel, see `shaders/common/square.glsl`. The last: the nearest that is not
//! pushed.

use crate::abi::constants::LARGEST_SMALL_BLENDED_PX;
use crate::render::cpu::filtered::splat_block::{BLOCK, Block, LANES, ROW, SetLanes, part};
use crate::render::cpu::filtered::{FilteredBand, PictureArea};
use fearless_simd::prelude::*;
use fearless_simd::{f32x16, i32x16, u32x4};

/// Leaves the depths of a block of splats, pushed or not, in the pixels of their squares.
#[inline(always)]
pub(super) fn draw<S: Simd, const PUSHED: bool>(
    simd: S,
    block: &Block<'_>,
    canvas: &PictureArea,
    band: &mut FilteredBand<'_>,
) {
    let [x, y, pushed, own_side] = part(simd, block, 0);
    let shown = match PUSHED {
        true => pushed,
        false => part(simd, block, 4)[0],
    };
    let [left, top, right, bottom] = canvas.rect_px;
    let side = own_side.max(f32x16::splat(simd, 1.0));
    let is_drawn = shown.simd_gt(0.0)
        & own_side.simd_le(LARGEST_SMALL_BLENDED_PX)
        & (x + side).simd_gt(left as f32)
        & (x - side).simd_lt(right as f32)
        & (y + side).simd_gt(top as f32)
        & (y - side).simd_lt(bottom as f32);
    let steps = (side * 256.0).round_ties_even().to_int::<i32x16<S>>();
    let (first_x, end_x) = pixels_around(x, steps, [left, right]);
    let (first_y, end_y) = pixels_around(y, steps, band.rows);
    let is_drawn = is_drawn & first_x.simd_lt(end_x) & first_y.simd_lt(end_y);
    let stride = i32x16::splat(simd, canvas.width() as i32);
    let zero = i32x16::splat(simd, 0);
    let (rows, columns) = (end_y - first_y, end_x - first_x);
    let at = (first_y - band.rows[0] as i32) * stride + (first_x - left as i32);
    // Of up to three rows the second and the third are known ahead; where there are fewer, the last once more.
    let middle = at + rows.simd_gt(1).select(stride, zero);
    let last = middle + rows.simd_gt(2).select(stride, zero);
    let whole = band.front.len() as i32 - ROW as i32;
    let is_short = rows.simd_le(3) & columns.simd_le(ROW as i32) & last.simd_le(whole);
    let depths: [u32; BLOCK] = shown.to_bits().to_array();
    let (at, middle, last) = (at.to_array(), middle.to_array(), last.to_array());
    let columns = columns.to_array();
    for lane in SetLanes((is_drawn & is_short).to_bitmask()) {
        let is_in = u32x4::from_slice(simd, &LANES[columns[lane] as usize & 7]);
        let depth = u32x4::splat(simd, depths[lane]) & is_in;
        for at in [at[lane], middle[lane], last[lane]] {
            if let Some(four) = band.front[at as usize..].first_chunk_mut::<ROW>() {
                u32x4::from_slice(simd, four).max(depth).store_slice(four);
            }
        }
    }
    let rows = rows.to_array();
    let width = canvas.width();
    for lane in SetLanes((is_drawn & !is_short).to_bitmask()) {
        let depth = u32x4::splat(simd, depths[lane]);
        let (mut at, mut left) = (at[lane] as usize, columns[lane] as usize);
        while left > 0 {
            let depth = depth & u32x4::from_slice(simd, &LANES[left.min(ROW)]);
            let mut row = at;
            for _ in 0..rows[lane] {
                let rest = &mut band.front[row..];
                if let Some(four) = rest.first_chunk_mut::<ROW>() {
                    u32x4::from_slice(simd, four).max(depth).store_slice(four);
                } else {
                    // The end of the band.
                    let count = rest.len();
                    let mut four = [0; ROW];
                    four[..count].copy_from_slice(rest);
                    let nearest = u32x4::from_slice(simd, &four).max(depth).to_array();
                    rest.copy_from_slice(&nearest[..count]);
                }
                row += width;
            }
            at += ROW;
            left = left.saturating_sub(ROW);
        }
    }
}

/// The first pixel whose center is within half of `steps` steps of 1/256 pixel around a position, and one past the last.
#[inline(always)]
fn pixels_around<S: Simd>(
    window: f32x16<S>,
    steps: i32x16<S>,
    [least, most]: [u32; 2],
) -> (i32x16<S>, i32x16<S>) {
    let low = (window * 256.0).round_ties_even().to_int::<i32x16<S>>() - (steps >> 1) + 127;
    let simd = steps.token();
    (
        (low >> 8).max(i32x16::splat(simd, least as i32)),
        ((low + steps) >> 8).min(i32x16::splat(simd, most as i32)),
    )
}
