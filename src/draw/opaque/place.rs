//! Which pixels splats may cover, a vector of them at a time.

use super::{Look, Screen};
use crate::abi::Splat;
use fearless_simd::prelude::*;

type Numbers<S> = <S as Simd>::f32s;

/// Splats whose rows are known together. They lie near each other, in the order of the tree.
pub(super) const GROUP: usize = 16;
/// Splats that are looked at together: a whole number of groups and of vectors.
const BLOCK: usize = 64;

/// A circle of a smaller diameter is the square around it, see `shaders/common/form.glsl`.
const LEAST_ROUND_PX: f32 = std::f32::consts::SQRT_2;

/// Pixels of a splat, counted from the corner of the rectangle; the end of its columns is not beyond their first where it has none.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pixels {
    pub(super) first: [u16; 2],
    /// One past the last.
    pub(super) end: [u16; 2],
    /// Reversed depth, as bits.
    pub(super) depth: u32,
}

/// Which of its pixels a disc covers: those at offsets o with `form` o.o of at most 1.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Round {
    /// 1 / pixels^2; 0 of what is a square.
    pub(super) form: f32,
    /// From the center to that of the first pixel, pixels.
    pub(super) to_first: [f32; 2],
}

/// Splats that lie near each other: the first row that they may touch, and one past the last.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Group {
    pub(super) rows: [u16; 2],
}

type Row = [f32; BLOCK];

/// Numbers of a block, written word by word before any are read as vectors.
struct Block {
    center: [Row; 3],
    radius: Row,
}

/// What is found of a block.
struct Found {
    first: [Row; 2],
    end: [Row; 2],
    depth: Row,
    form: Row,
    to_first: [Row; 2],
}

/// Finds the pixels of splats of one look, and of groups of them the rows.
#[inline(always)]
pub(super) fn part<S: Simd>(
    simd: S,
    screen: &Screen,
    (splats, look, is_one_pixel): (&[Splat], Look, bool),
    (pixels, rounds, groups): (&mut [Pixels], &mut [Round], &mut [Group]),
) {
    let mut block = Block {
        center: [[0.0; BLOCK]; 3],
        radius: [0.0; BLOCK],
    };
    let mut found = Found {
        first: [[0.0; BLOCK]; 2],
        end: [[0.0; BLOCK]; 2],
        depth: [0.0; BLOCK],
        form: [0.0; BLOCK],
        to_first: [[0.0; BLOCK]; 2],
    };
    for (number, splats) in splats.chunks(BLOCK).enumerate() {
        for (i, splat) in splats.iter().enumerate() {
            block.center[0][i] = splat.center.x;
            block.center[1][i] = splat.center.y;
            block.center[2][i] = splat.center.z;
            block.radius[i] = splat.radius;
        }
        for at in (0..splats.len()).step_by(Numbers::<S>::LEN) {
            if is_one_pixel {
                find::<S, true>(simd, screen, look, (&block, &mut found), at);
            } else {
                find::<S, false>(simd, screen, look, (&block, &mut found), at);
            }
        }
        let from = number * BLOCK;
        let pixels = &mut pixels[from..from + splats.len()];
        for (i, pixels) in pixels.iter_mut().enumerate() {
            *pixels = Pixels {
                first: [found.first[0][i] as u16, found.first[1][i] as u16],
                end: [found.end[0][i] as u16, found.end[1][i] as u16],
                depth: found.depth[i].to_bits(),
            };
        }
        if look.are_discs {
            let rounds = &mut rounds[from..from + splats.len()];
            for (i, round) in rounds.iter_mut().enumerate() {
                *round = Round {
                    form: found.form[i],
                    to_first: [found.to_first[0][i], found.to_first[1][i]],
                };
            }
        }
        let groups = &mut groups[from / GROUP..];
        for (group, pixels) in groups.iter_mut().zip(pixels.chunks(GROUP)) {
            let drawn = pixels.iter().filter(|own| own.end[0] > own.first[0]);
            let rows = drawn.fold([u16::MAX, 0], |[low, high], own| {
                [low.min(own.first[1]), high.max(own.end[1])]
            });
            *group = Group { rows };
        }
    }
}

/// Splats number `at` of a block and on, as many as a vector has. `ONE`: they are squares of a pixel.
#[inline(always)]
fn find<S: Simd, const ONE: bool>(
    simd: S,
    screen: &Screen,
    look: Look,
    (block, found): (&Block, &mut Found),
    at: usize,
) {
    let lanes = at..at + Numbers::<S>::LEN;
    let number = |v: f32| Numbers::<S>::splat(simd, v);
    let [x, y, z] = &block.center;
    let x = Numbers::<S>::from_slice(simd, &x[lanes.clone()]);
    let y = Numbers::<S>::from_slice(simd, &y[lanes.clone()]);
    let z = Numbers::<S>::from_slice(simd, &z[lanes.clone()]);
    // From the last column to the first, as shaders do it.
    let times = |row: &[f32; 4]| x * row[0] + (y * row[1] + (z * row[2] + row[3]));
    let in_view = times(&screen.along);
    let depth = in_view * screen.depth[0] + screen.depth[1];
    let last = in_view * screen.last[0] + screen.last[1];
    let window = [
        times(&screen.window[0]) / last,
        times(&screen.window[1]) / last,
    ];
    let zero = number(0.0);
    let is_drawn = depth.simd_ge(zero) & depth.simd_le(last) & last.simd_gt(zero);
    (depth / last).store_slice(&mut found.depth[lanes.clone()]);
    let [left, top, right, bottom] = screen.rect_px.map(|v| v as f32);
    let sides = [[left, right], [top, bottom]];
    if ONE {
        let of = |window: Numbers<S>, [low, high]: [f32; 2]| {
            let place = (window - 1.0 / 512.0).ceil() - 1.0 - low;
            (place, place.simd_ge(0.0) & place.simd_lt(high - low))
        };
        let (column, is_in_x) = of(window[0], sides[0]);
        let (row, is_in_y) = of(window[1], sides[1]);
        let is_in = is_drawn & is_in_x & is_in_y;
        for (i, place) in [column, row].into_iter().enumerate() {
            let first = is_in.select(place, zero);
            first.store_slice(&mut found.first[i][lanes.clone()]);
            let end = is_in.select(place + 1.0, zero);
            end.store_slice(&mut found.end[i][lanes.clone()]);
        }
        return;
    }
    let one_size = number(0.5 * screen.size_px);
    let half = if look.has_one_size {
        one_size
    } else {
        let radius = Numbers::<S>::from_slice(simd, &block.radius[lanes.clone()]);
        let own = radius * screen.model_scale * screen.focal_px / last;
        radius.simd_gt(zero).select(own, one_size)
    };
    let side = half * 2.0;
    let square = side.max(number(1.0)).min(number(65536.0));
    let steps = (square * 256.0).round_ties_even().to_int::<S::i32s>();
    let round_side = side.simd_ge(LEAST_ROUND_PX);
    let form = number(4.0) / (side * side);
    let mut ends = [[zero; 2]; 2];
    let mut is_in = is_drawn;
    for (i, [low, high]) in sides.into_iter().enumerate() {
        let window = window[i];
        is_in &= window.simd_gt(number(low) - square) & window.simd_lt(number(high) + square);
        let whole = |v: f32| S::i32s::splat(simd, v as i32);
        let low_step = (window * 256.0).round_ties_even().to_int::<S::i32s>() - (steps >> 1) + 127;
        let first = (low_step >> 8).max(whole(low)).to_float::<Numbers<S>>();
        let end = ((low_step + steps) >> 8).min(whole(high)).to_float::<Numbers<S>>();
        ends[i] = [first, end];
        if look.are_discs {
            let clamped = |v: Numbers<S>| v.max(number(low)).min(number(high));
            let reach = side * 0.5;
            let first_round = clamped((window - reach - 0.5).ceil());
            let end_round = clamped((window + reach + 0.5).floor());
            ends[i] = [
                round_side.select(first_round, first),
                round_side.select(end_round, end),
            ];
            let to_first = ends[i][0] + 0.5 - window;
            to_first.store_slice(&mut found.to_first[i][lanes.clone()]);
        }
    }
    if look.are_discs {
        let form = round_side.select(form, zero);
        form.store_slice(&mut found.form[lanes.clone()]);
    }
    let [[first_x, end_x], [first_y, end_y]] = ends;
    is_in &= first_x.simd_lt(end_x) & first_y.simd_lt(end_y);
    for (i, ([first, end], [low, _])) in ends.into_iter().zip(sides).enumerate() {
        let first = is_in.select(first - low, zero);
        first.store_slice(&mut found.first[i][lanes.clone()]);
        let end = is_in.select(end - low, zero);
        end.store_slice(&mut found.end[i][lanes.clone()]);
    }
}
