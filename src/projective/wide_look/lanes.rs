//! Numbers and vectors, one in each lane.
//!
//! Functions on them are inlined for sure: a closure may become a function of its own, without the
//! instructions of the level, and then each operation is a call.

use crate::simd::{FloatLanes, WIDEST, WideLanes};
use fearless_simd::prelude::*;
use glam::{Mat3, Vec3};

/// A vector in each lane.
#[derive(Clone, Copy)]
pub(super) struct LaneVector<S: Simd>(pub(super) [WideLanes<S>; 3]);

/// Vector with one number in all lanes.
#[inline(always)]
pub(super) fn splat<S: Simd>(simd: S, v: f32) -> WideLanes<S> {
    WideLanes(S::f32s::splat(simd, v))
}

/// The next whole number below.
#[inline(always)]
pub(super) fn floor<S: Simd>(v: WideLanes<S>) -> WideLanes<S> {
    -(-v).ceil()
}

/// The binary logarithm of positive, normal numbers, within 1e-5: exponent, and a polynomial that meets the logarithm of the
/// mantissa at six Chebyshev nodes.
#[inline(always)]
pub(super) fn log2<S: Simd>(value: WideLanes<S>) -> WideLanes<S> {
    let bits = value.0.bitcast::<S::u32s>();
    let exponent = WideLanes::<S>::from_bits_of(bits, 1, 24, false);
    let m = WideLanes::<S>::from_bits_of(bits, 9, 9, false) * (1.0 / 8_388_608.0);
    let high = m * (m * -0.033_822_05 + m.all(0.144_471_1)) + m.all(-0.301_638);
    let low = m * (m * high + m.all(0.468_658_9)) + m.all(-0.720_358_8);
    exponent - m.all(127.0) + m * (m * low + m.all(1.442_681_5))
}

/// Smoothstep from 0 at `from` to 1 at `to`.
#[inline(always)]
pub(super) fn smooth<S: Simd>(from: f32, to: f32, value: WideLanes<S>) -> WideLanes<S> {
    let t = (value - value.all(from)) * (1.0 / (to - from));
    let t = t.max(t.all(0.0)).min(t.all(1.0));
    t * t * (t * -2.0 + t.all(3.0))
}

/// The first lanes of some numbers.
#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, numbers: &[f32; WIDEST]) -> WideLanes<S> {
    WideLanes::load(simd, &numbers[..WideLanes::<S>::LANES])
}

impl<S: Simd> LaneVector<S> {
    #[inline(always)]
    pub(super) fn all(simd: S, v: Vec3) -> Self {
        Self([splat(simd, v.x), splat(simd, v.y), splat(simd, v.z)])
    }

    #[inline(always)]
    pub(super) fn plus(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([a + x, b + y, c + z])
    }

    #[inline(always)]
    pub(super) fn minus(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([a - x, b - y, c - z])
    }

    #[inline(always)]
    pub(super) fn times(self, factor: WideLanes<S>) -> Self {
        let [x, y, z] = self.0;
        Self([x * factor, y * factor, z * factor])
    }

    #[inline(always)]
    pub(super) fn dot(self, other: Self) -> WideLanes<S> {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        a * x + b * y + c * z
    }

    #[inline(always)]
    pub(super) fn unit(self) -> Self {
        let squared = self.dot(self);
        let one = squared.all(1.0);
        let is_one = squared.gt(squared.all(0.0));
        let factor = one / WideLanes::choose(is_one, squared, one).sqrt();
        self.times(WideLanes::choose(is_one, factor, squared.all(0.0)))
    }

    /// A matrix times it.
    #[inline(always)]
    pub(super) fn turned(self, by: &Mat3) -> Self {
        let [x, y, z] = self.0;
        let (a, b, c) = (by.x_axis, by.y_axis, by.z_axis);
        Self([
            x * a.x + y * b.x + z * c.x,
            x * a.y + y * b.y + z * c.y,
            x * a.z + y * b.z + z * c.z,
        ])
    }

    #[inline(always)]
    pub(super) fn choose(mask: S::mask32s, set: Self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (set.0, other.0);
        Self([
            WideLanes::choose(mask, a, x),
            WideLanes::choose(mask, b, y),
            WideLanes::choose(mask, c, z),
        ])
    }
}

/// Lanes whose bits are set.
pub(super) fn set_bits(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = (bits != 0).then(|| bits.trailing_zeros() as usize);
        bits &= bits.wrapping_sub(1);
        lane
    })
}
