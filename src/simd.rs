//! Vectors of numbers, a sibling in each lane: four of them for one group, or as many as the processor has for a batch.
//!
//! The tests are written once for both. Each lane is computed by the same operations in either, so a node is decided
//! alike wherever it is looked at.

use fearless_simd::prelude::*;
use glam::Vec4;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// Numbers of single precision.
pub(super) trait FloatLanes:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f32, Output = Self>
    + Sub<f32, Output = Self>
    + Mul<f32, Output = Self>
{
    /// A bit a lane.
    type Mask: Copy
        + BitAnd<Output = Self::Mask>
        + BitOr<Output = Self::Mask>
        + Not<Output = Self::Mask>;
    /// A word a lane.
    type Words: Copy;

    /// Vector with one number in all lanes.
    fn all(self, v: f32) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn abs(self) -> Self;
    fn sqrt(self) -> Self;
    fn ceil(self) -> Self;
    fn copysign(self, sign: Self) -> Self;
    /// Comparisons, false where a side is no number.
    fn lt(self, other: Self) -> Self::Mask;
    fn le(self, other: Self) -> Self::Mask;
    fn gt(self, other: Self) -> Self::Mask;
    fn ge(self, other: Self) -> Self::Mask;
    /// Lanes of the first where the mask is set, else of the second.
    fn choose(mask: Self::Mask, set: Self, other: Self) -> Self;
    /// A mask as bits, that of the first lane lowest.
    fn bits(mask: Self::Mask) -> u32;
    /// Bits of words as numbers: those that are left when so many are shifted out above and then so many below. `signed`:
    /// the topmost of them is a sign.
    fn from_bits_of(words: Self::Words, above: u32, below: u32, signed: bool) -> Self;
}

impl FloatLanes for Vec4 {
    type Mask = glam::BVec4A;
    type Words = [u32; 4];

    #[inline(always)]
    fn all(self, v: f32) -> Self {
        Self::splat(v)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::min(self, other)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::max(self, other)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self::abs(self)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::sqrt(self)
    }

    #[inline(always)]
    fn ceil(self) -> Self {
        Self::ceil(self)
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        Self::copysign(self, sign)
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        self.cmplt(other)
    }

    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        self.cmple(other)
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Self::Mask {
        self.cmpgt(other)
    }

    #[inline(always)]
    fn ge(self, other: Self) -> Self::Mask {
        self.cmpge(other)
    }

    #[inline(always)]
    fn choose(mask: Self::Mask, set: Self, other: Self) -> Self {
        Self::select(mask, set, other)
    }

    #[inline(always)]
    fn bits(mask: Self::Mask) -> u32 {
        mask.bitmask()
    }

    #[inline(always)]
    fn from_bits_of(words: Self::Words, above: u32, below: u32, signed: bool) -> Self {
        Self::from_array(if signed {
            words.map(|word| ((word << above) as i32 >> below) as f32)
        } else {
            words.map(|word| ((word << above) >> below) as i32 as f32)
        })
    }
}

/// Most lanes of [`WideLanes`].
pub(super) const WIDEST: usize = 16;

/// As many numbers as the vectors of a level of the processor have.
#[derive(Clone, Copy)]
pub(super) struct WideLanes<S: Simd>(pub(super) S::f32s);

impl<S: Simd> WideLanes<S> {
    pub(super) const LANES: usize = <S::f32s as SimdBase<S>>::LEN;

    #[inline(always)]
    pub(super) fn load(simd: S, numbers: &[f32]) -> Self {
        Self(S::f32s::from_slice(simd, numbers))
    }

    #[inline(always)]
    pub(super) fn load_words(simd: S, words: &[u32]) -> S::u32s {
        S::u32s::from_slice(simd, words)
    }

    #[inline(always)]
    pub(super) fn store(self, numbers: &mut [f32]) {
        self.0.store_slice(numbers);
    }

    /// Stores the words of some lanes close together, from a place on where there is room for those of all.
    #[inline(always)]
    pub(super) fn pack(words: S::u32s, lanes: S::mask32s, list: &mut [u32], at: usize) {
        if let Some(place) = list.get_mut(at..at + Self::LANES) {
            words.compress(lanes).store_slice(place);
        }
    }

    /// Stores whole numbers of at least 0.
    #[inline(always)]
    pub(super) fn store_whole(self, words: &mut [u32]) {
        self.0.to_int::<S::u32s>().store_slice(words);
    }

    /// Stores the bits of numbers.
    #[inline(always)]
    pub(super) fn store_bits(self, words: &mut [u32]) {
        self.0.bitcast::<S::u32s>().store_slice(words);
    }
}

macro_rules! operator {
    ($trait:ident, $function:ident, $operator:tt) => {
        impl<S: Simd> $trait for WideLanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(self.0 $operator other.0)
            }
        }

        impl<S: Simd> $trait<f32> for WideLanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: f32) -> Self {
                Self(self.0 $operator other)
            }
        }
    };
}

operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl<S: Simd> Neg for WideLanes<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl<S: Simd> FloatLanes for WideLanes<S> {
    type Mask = S::mask32s;
    type Words = S::u32s;

    #[inline(always)]
    fn all(self, v: f32) -> Self {
        Self(S::f32s::splat(self.0.token(), v))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(self.0.min(other.0))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // The sign's bit alone, also of what is no number.
        Self(self.0.copysign(self.all(1.0).0))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }

    #[inline(always)]
    fn ceil(self) -> Self {
        Self(self.0.ceil())
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        Self(self.0.copysign(sign.0))
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        self.0.simd_lt(other.0)
    }

    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        self.0.simd_le(other.0)
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Self::Mask {
        self.0.simd_gt(other.0)
    }

    #[inline(always)]
    fn ge(self, other: Self) -> Self::Mask {
        self.0.simd_ge(other.0)
    }

    #[inline(always)]
    fn choose(mask: Self::Mask, set: Self, other: Self) -> Self {
        Self(mask.select(set.0, other.0))
    }

    #[inline(always)]
    fn bits(mask: Self::Mask) -> u32 {
        mask.to_bitmask() as u32
    }

    #[inline(always)]
    fn from_bits_of(words: Self::Words, above: u32, below: u32, signed: bool) -> Self {
        let shifted = (words << above).bitcast::<S::i32s>();
        let number = if signed {
            shifted >> below
        } else {
            ((words << above) >> below).bitcast::<S::i32s>()
        };
        Self(number.to_float::<S::f32s>())
    }
}
