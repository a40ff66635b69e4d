//! Which pixels triangles cover, a vector of them at a time.

use crate::pack::small_triangles::{CornerPositions, CornerScreen, MOST_PIXELS, MOST_STEPS};
use crate::textures::WeightSteps;
use fearless_simd::prelude::*;
use glam::Vec3;

type Numbers<S> = <S as Simd>::f32s;

/// Whole numbers, of what is below 2²²: a sum with this number has no places behind the point, and is rounded to even.
#[inline(always)]
fn rounded<S: Simd>(v: Numbers<S>) -> Numbers<S> {
    const WHOLE: f32 = 12_582_912.0;
    v + WHOLE - WHOLE
}

/// Corners of some triangles.
struct TriangleCorners<S: Simd> {
    /// Window position, steps of 1/256 pixel.
    x: Numbers<S>,
    y: Numbers<S>,
    /// By how much it is off.
    off_x: Numbers<S>,
    off_y: Numbers<S>,
    inverse_w: Numbers<S>,
    /// In the view volume, as far as depth goes.
    within: u64,
}

#[inline(always)]
fn corners<S: Simd>(
    simd: S,
    screen: &CornerScreen,
    rows: &[crate::pack::small_triangles::SampleRow; 3],
    at: usize,
) -> TriangleCorners<S> {
    let end = at + Numbers::<S>::LEN;
    let [x, y, z] = rows;
    let x = Numbers::<S>::from_slice(simd, &x[at..end]);
    let y = Numbers::<S>::from_slice(simd, &y[at..end]);
    let z = Numbers::<S>::from_slice(simd, &z[at..end]);
    // From the last column to the first, as shaders do it; without the entries that are 0 or 1 in every view.
    let [row_x, row_y, row_z] = &screen.view;
    let (x, y, z) = (
        x * row_x[0] + (y * row_x[1] + (z * row_x[2] + row_x[3])),
        x * row_y[0] + (y * row_y[1] + (z * row_y[2] + row_y[3])),
        x * row_z[0] + (y * row_z[1] + (z * row_z[2] + row_z[3])),
    );
    let [to_x, to_y, to_z, to_w] = &screen.along;
    let x = x * screen.across[0] + (z * to_x[0] + to_x[1]);
    let y = y * screen.across[1] + (z * to_y[0] + to_y[1]);
    let (z, w) = (z * to_z[0] + to_z[1], z * to_w[0] + to_w[1]);
    let in_window_x = ((x / w * 0.5 + 0.5) * screen.viewport_px[0] - screen.guard_px) * 256.0;
    let in_window_y = ((y / w * 0.5 + 0.5) * screen.viewport_px[1] - screen.guard_px) * 256.0;
    let (snapped_x, snapped_y) = (rounded::<S>(in_window_x), rounded::<S>(in_window_y));
    let within = w.simd_gt(0.0) & z.simd_ge(0.0) & z.simd_le(w);
    TriangleCorners {
        x: snapped_x,
        y: snapped_y,
        off_x: in_window_x - snapped_x,
        off_y: in_window_y - snapped_y,
        inverse_w: Numbers::<S>::splat(simd, 1.0) / w,
        within: within.to_bitmask(),
    }
}

/// From a number of steps over 256 to the next whole number, by rounding.
const UP: f32 = 0.5 - 1.0 / 512.0;

/// First and last of the pixels whose centers may be between two places, steps.
#[inline(always)]
fn pixels<S: Simd>(low: Numbers<S>, high: Numbers<S>, least: f32, most: f32) -> [Numbers<S>; 2] {
    // Pixel i has its center at 256 i + 128.
    let first = rounded::<S>((low - 128.0) * (1.0 / 256.0) + UP);
    let last = rounded::<S>((high - 128.0) * (1.0 / 256.0) - UP);
    [first.max(least), last.min(most - 1.0)]
}

/// Most triangles in a vector.
pub(super) const LANES: usize = 16;

/// What some triangles cover. Masks have a bit a triangle.
#[derive(Debug)]
pub(super) struct CoveredCenters {
    /// Triangles that are all there are to ask for; the device decides about others.
    pub(super) known: u64,
    /// Of those, the ones that cover anything.
    pub(super) some: u64,
    /// Which of their pixels, of `columns` a row, from the lowest bit.
    pub(super) pixels: [u32; LANES],
    pub(super) columns: [f32; LANES],
    /// Edge functions at the center of the first pixel, each opposite of a corner: proportional to its weight in the window. Of
    /// the corners as they are, not in steps, but for triangles as thin as a step.
    pub(super) values: [[f32; LANES]; 3],
    /// What they grow by to the next pixel of the row, and of the column.
    pub(super) to_right: [[f32; LANES]; 3],
    pub(super) down: [[f32; LANES]; 3],
    pub(super) inverse_w: [[f32; LANES]; 3],
}

impl CoveredCenters {
    pub(super) const NOTHING: Self = Self {
        known: 0,
        some: 0,
        pixels: [0; LANES],
        columns: [0.0; LANES],
        values: [[0.0; LANES]; 3],
        to_right: [[0.0; LANES]; 3],
        down: [[0.0; LANES]; 3],
        inverse_w: [[0.0; LANES]; 3],
    };

    /// Changes of the weights of a triangle from pixel to pixel.
    #[inline(always)]
    pub(super) fn weight_steps(&self, lane: usize) -> WeightSteps {
        let [a, b, c] = &self.inverse_w;
        let inverse_w = Vec3::new(a[lane], b[lane], c[lane]);
        let [a, b, c] = &self.to_right;
        let right = Vec3::new(a[lane], b[lane], c[lane]) * inverse_w;
        let [a, b, c] = &self.down;
        let down = Vec3::new(a[lane], b[lane], c[lane]) * inverse_w;
        WeightSteps { right, down }
    }

    /// Looks at the triangles number `at` and on, as many as a vector has. All but masks stays as it was where nothing is
    /// covered.
    #[inline(always)]
    pub(super) fn ask<S: Simd>(
        &mut self,
        simd: S,
        screen: &CornerScreen,
        positions: &CornerPositions,
        at: usize,
    ) {
        let a = corners(simd, screen, &positions.0[0], at);
        let b = corners(simd, screen, &positions.0[1], at);
        let c = corners(simd, screen, &positions.0[2], at);
        // From the first corner of each.
        let (bx, by) = (b.x - a.x, b.y - a.y);
        let (cx, cy) = (c.x - a.x, c.y - a.y);
        // Twice the area, with its sign.
        let area = bx * cy - by * cx;
        let zero = Numbers::<S>::splat(simd, 0.0);
        let one = Numbers::<S>::splat(simd, 1.0);
        let [left, top, right, bottom] = screen.rect_px;
        let low_x = bx.min(cx).min(zero) + a.x;
        let high_x = bx.max(cx).max(zero) + a.x;
        let low_y = by.min(cy).min(zero) + a.y;
        let high_y = by.max(cy).max(zero) + a.y;
        let [first_x, last_x] = pixels::<S>(low_x, high_x, left, right);
        let [first_y, last_y] = pixels::<S>(low_y, high_y, top, bottom);
        let reach = bx.abs().max(by.abs()).max(cx.abs().max(cy.abs()));
        let columns = last_x - first_x + 1.0;
        let count = columns * (last_y - first_y + 1.0);
        let is_kept = (area * screen.dropped_sign).simd_le(0.0);
        let some = last_x.simd_ge(first_x) & last_y.simd_ge(first_y) & area.simd_ne(0.0) & is_kept;
        let some_bits = some.to_bitmask();
        self.known = a.within
            & b.within
            & c.within
            & reach.simd_le(MOST_STEPS).to_bitmask()
            & (!some_bits | count.simd_le(MOST_PIXELS).to_bitmask());
        self.some = 0;
        let asked = some_bits & self.known;
        if asked == 0 {
            return;
        }
        // Edge functions. The sign turns those that are not clockwise.
        let sign = one.copysign(area);
        let at_x = first_x * 256.0 + 128.0 - a.x;
        let at_y = first_y * 256.0 + 128.0 - a.y;
        let (dx_a, dy_a) = ((cx - bx) * sign, (cy - by) * sign);
        let (dx_b, dy_b) = ((zero - cx) * sign, (zero - cy) * sign);
        let (dx_c, dy_c) = (bx * sign, by * sign);
        let value_a = dx_a * (at_y - by) - dy_a * (at_x - bx);
        let value_b = dx_b * (at_y - cy) - dy_b * (at_x - cx);
        let value_c = dx_c * at_y - dy_c * at_x;
        let (least_a, least_b, least_c) = (
            least(simd, dx_a, dy_a),
            least(simd, dx_b, dy_b),
            least(simd, dx_c, dy_c),
        );
        // Pixel by pixel of all of them, row by row of each. All are whole numbers of less than 24 bits.
        let (right_a, right_b, right_c) = (dy_a * -256.0, dy_b * -256.0, dy_c * -256.0);
        let (down_a, down_b, down_c) = (dx_a * 256.0, dx_b * 256.0, dx_c * 256.0);
        let back = columns - 1.0;
        let (next_a, next_b, next_c) = (
            down_a - back * right_a,
            down_b - back * right_b,
            down_c - back * right_c,
        );
        let count = <S::mask32s as SimdMask<S>>::from_bitmask(simd, asked).select(count, zero);
        let (mut a_is, mut b_is, mut c_is) =
            (value_a - least_a, value_b - least_b, value_c - least_c);
        let mut column = zero;
        let nothing = S::u32s::splat(simd, 0);
        let mut covered = nothing;
        let (mut number, mut bit) = (0.0, 1);
        loop {
            let is_inside = a_is.min(b_is).min(c_is).simd_ge(0.0) & count.simd_gt(number);
            covered |= is_inside.select(S::u32s::splat(simd, bit), nothing);
            number += 1.0;
            if count.simd_gt(number).to_bitmask() == 0 {
                break;
            }
            bit <<= 1;
            let is_end = column.simd_ge(back);
            a_is += is_end.select(next_a, right_a);
            b_is += is_end.select(next_b, right_b);
            c_is += is_end.select(next_c, right_c);
            column = is_end.select(zero, column + 1.0);
        }
        self.some = covered.simd_gt(nothing).to_bitmask();
        if self.some == 0 {
            return;
        }
        // What is covered goes by steps, as it does on the device. What is seen there need not: a triangle of 50 steps would be
        // shaded as one that is a fiftieth of its size elsewhere. Of one as thin as a step that is not known any better.
        let exact = |corner: &TriangleCorners<S>| {
            (corner.x - a.x + corner.off_x, corner.y - a.y + corner.off_y)
        };
        let ((ax, ay), (ex, ey), (fx, fy)) = (exact(&a), exact(&b), exact(&c));
        let exact_area = (ex - ax) * (fy - ay) - (ey - ay) * (fx - ax);
        let is_thick = (exact_area * sign).simd_gt(area * sign * 0.5);
        let either = |exact: Numbers<S>, snapped: Numbers<S>| is_thick.select(exact, snapped);
        let (ax, ay) = (either(ax, zero), either(ay, zero));
        let (bx, by) = (either(ex, bx), either(ey, by));
        let (cx, cy) = (either(fx, cx), either(fy, cy));
        let (at, a_to, b_to, c_to) = ([at_x, at_y], [ax, ay], [bx, by], [cx, cy]);
        let [value_a, right_a, down_a] = edge::<S>(b_to, c_to, at, sign);
        let [value_b, right_b, down_b] = edge::<S>(c_to, a_to, at, sign);
        let [value_c, right_c, down_c] = edge::<S>(a_to, b_to, at, sign);
        let lanes = ..Numbers::<S>::LEN;
        covered.store_slice(&mut self.pixels[lanes]);
        columns.store_slice(&mut self.columns[lanes]);
        for (rows, vectors) in [
            (&mut self.values, [value_a, value_b, value_c]),
            (&mut self.to_right, [right_a, right_b, right_c]),
            (&mut self.down, [down_a, down_b, down_c]),
            (&mut self.inverse_w, [a.inverse_w, b.inverse_w, c.inverse_w]),
        ] {
            vectors[0].store_slice(&mut rows[0][lanes]);
            vectors[1].store_slice(&mut rows[1][lanes]);
            vectors[2].store_slice(&mut rows[2][lanes]);
        }
    }
}

/// Weights of the corners of a triangle at a pixel that it covers by steps, of which its center lies beside the triangle as it is: by
/// steps none is negative, so that what they give lies as near to the center as corners are moved. Cut off at 0, weights of a
/// needle would be those of a place that is a part of its length away. The pixel: column and row from the first of the triangle.
#[cold]
#[inline(never)]
pub(super) fn in_steps(screen: &CornerScreen, corners: [Vec3; 3], pixel: [f32; 2]) -> [f32; 3] {
    let [Some(a), Some(b), Some(c)] = corners.map(|corner| screen.place(corner)) else {
        // What is asked for lies within the view volume.
        return [1.0; 3];
    };
    let steps = [a, b, c].map(|corner| corner.steps.map(f32::round_ties_even));
    let [left, top, ..] = screen.rect_px;
    let center = |axis: usize, least: f32| {
        let low = steps.iter().map(|at| at[axis]).fold(f32::MAX, f32::min);
        let first = ((low - 128.0) / 256.0).ceil().max(least);
        (first + pixel[axis]) * 256.0 + 128.0
    };
    let at = [center(0, left), center(1, top)];
    let [a_to, b_to, c_to] = steps;
    let edge = |from: [f32; 2], to: [f32; 2]| {
        (to[0] - from[0]) * (at[1] - from[1]) - (to[1] - from[1]) * (at[0] - from[0])
    };
    [
        edge(b_to, c_to).abs() * a.inverse_w,
        edge(c_to, a_to).abs() * b.inverse_w,
        edge(a_to, b_to).abs() * c.inverse_w,
    ]
}

/// The function of an edge at a place, and what it grows by to the right and down. Not a closure: what that does need not be
/// compiled for the vectors of the function that it is in.
#[inline(always)]
fn edge<S: Simd>(
    from: [Numbers<S>; 2],
    to: [Numbers<S>; 2],
    at: [Numbers<S>; 2],
    sign: Numbers<S>,
) -> [Numbers<S>; 3] {
    let (dx, dy) = ((to[0] - from[0]) * sign, (to[1] - from[1]) * sign);
    let value = dx * (at[1] - from[1]) - dy * (at[0] - from[0]);
    [value, dy * -256.0, dx * 256.0]
}

/// The least values inside of an edge: 1 where a center exactly on it belongs to the neighbor.
#[inline(always)]
fn least<S: Simd>(simd: S, dx: Numbers<S>, dy: Numbers<S>) -> Numbers<S> {
    let is_top_left = dy.simd_lt(0.0) | (dy.simd_eq(0.0) & dx.simd_gt(0.0));
    is_top_left.select(
        Numbers::<S>::splat(simd, 0.0),
        Numbers::<S>::splat(simd, 1.0),
    )
}
