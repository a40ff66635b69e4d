//! What the headlight makes of splats, a vector of them at a time: the operations of `shaders/common/headlight.glsl` and of
//! `shaders/common/octahedral.glsl`, in their order.

use crate::abi::constants::{FLAG_COLOR_BY_PRIMITIVE, FLAG_TWO_SIDED, FLAG_USE_COLORS};
use crate::abi::{FrameConstants, Splat};
use crate::pack::ALBEDO;
use crate::render::cpu::opaque::splat_bounds::{BLOCK, Row};
use fearless_simd::prelude::*;

type Numbers<S> = <S as Simd>::f32s;
type Words<S> = <S as Simd>::i32s;

/// What a splat is tinted with when coloring by primitive.
const TINT: [f32; 3] = [1.0, 0.2, 0.2];

/// The bits of coverage in a color.
const ALPHA: i32 = 0xff << 24;

/// The headlight of a frame, and what is behind everything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameHeadlight {
    /// In model space: a position (last component 1), or the unit vector towards it (0).
    place: [f32; 4],
    is_two_sided: bool,
    /// Of white; and whether splats have colors of their own.
    albedo: [f32; 3],
    has_colors: bool,
    /// Color of pixels where nothing is.
    pub(super) background: u32,
}

impl FrameHeadlight {
    /// Light of a frame which shows no data and has no lamp.
    pub fn new(frame: &FrameConstants) -> Self {
        let has = |flag: u32| frame.flags & flag != 0;
        let is_tinted = has(FLAG_COLOR_BY_PRIMITIVE);
        Self {
            place: frame.headlight,
            is_two_sided: has(FLAG_TWO_SIDED),
            albedo: match is_tinted {
                true => TINT.map(|c| ALBEDO * c),
                false => [ALBEDO; 3],
            },
            has_colors: has(FLAG_USE_COLORS) && !is_tinted,
            background: [0, 1, 2]
                .map(|i| (frame.background[i].clamp(0.0, 1.0) * 255.0).round_ties_even() as u32)
                .into_iter()
                .rev()
                .fold(0, |word, byte| word << 8 | byte),
        }
    }

    /// Color of pixels where nothing is, as [`ShownRectangle`](crate::render::cpu::opaque::ShownRectangle) has colors.
    pub fn background(&self) -> u32 {
        self.background
    }
}

/// What the surfaces of a block of splats are like: normals and colors as [`Splat`] has them.
pub(super) struct BlockSurfaces {
    normals: [i32; BLOCK],
    /// Rests of normals and colors that their codes leave out, packed as `shaders/compute/resolve_splats.frag` reads them; 0 is none.
    fine: [i32; BLOCK],
    colors: [i32; BLOCK],
}

impl BlockSurfaces {
    pub(super) const NOTHING: Self = Self {
        normals: [0; BLOCK],
        fine: [0; BLOCK],
        colors: [0; BLOCK],
    };

    #[inline(always)]
    pub(super) fn put(&mut self, at: usize, splat: &Splat) {
        self.normals[at] = bytemuck::cast(splat.normal);
        self.fine[at] = splat.radius.rest();
        self.colors[at] = i32::from_le_bytes(splat.color);
    }

    /// The colors of splats number `at` and on, as many as a vector has: red in the lowest byte, coverage in the highest.
    #[inline(always)]
    pub(super) fn shade<S: Simd>(
        &self,
        simd: S,
        light: &FrameHeadlight,
        center: &[Row; 3],
        at: usize,
        out: &mut [i32; BLOCK],
    ) {
        let lanes = at..at + Numbers::<S>::LEN;
        let words = |list: &[i32; BLOCK]| Words::<S>::from_slice(simd, &list[lanes.clone()]);
        let colors = words(&self.colors);
        let number = |v: f32| Numbers::<S>::splat(simd, v);
        let zero = number(0.0);
        let (code, fine) = (words(&self.normals), words(&self.fine));
        let [x, y, z] = direction_of(simd, code, fine);
        let own = |axis: usize| Numbers::<S>::from_slice(simd, &center[axis][lanes.clone()]);
        let [light_x, light_y, light_z, last] = light.place;
        let to_x = number(light_x) - own(0) * last;
        let to_y = number(light_y) - own(1) * last;
        let to_z = number(light_z) - own(2) * last;
        // Both unit vectors at once: lengths are far from the ends of what numbers hold.
        let long = (x * x + y * y + z * z) * (to_x * to_x + to_y * to_y + to_z * to_z);
        let facing = (x * to_x + y * to_y + z * to_z) / long.sqrt();
        let lambert = match light.is_two_sided {
            true => facing.abs(),
            false => facing.max(zero),
        };
        let has_none = (colors & ALPHA).simd_eq(0);
        let lambert = has_none.select(number(1.0), lambert.min(number(1.0)));
        let [of_red, of_green, of_blue] = light.albedo;
        let (red, green, blue) = if light.has_colors {
            (
                byte::<S>(channel::<S>(colors, fine << 7) * of_red * lambert),
                byte::<S>(channel::<S>(colors >> 8, fine << 4) * of_green * lambert),
                byte::<S>(channel::<S>(colors >> 16, fine << 1) * of_blue * lambert),
            )
        } else {
            (
                byte::<S>(lambert * of_red),
                byte::<S>(lambert * of_green),
                byte::<S>(lambert * of_blue),
            )
        };
        let word = red | (green << 8) | (blue << 16) | ALPHA;
        word.store_slice(&mut out[lanes]);
    }
}

impl BlockSurfaces {
    /// Decodes normals of splats number `at` and on, as many as a vector has, and half the thickness of their patches of surface over
    /// their radius. Normals have any length, 0 where there is none.
    #[inline(always)]
    pub(super) fn patches<S: Simd>(&self, simd: S, at: usize) -> ([Numbers<S>; 3], Numbers<S>) {
        let lanes = at..at + Numbers::<S>::LEN;
        let code = Words::<S>::from_slice(simd, &self.normals[lanes.clone()]);
        let colors = Words::<S>::from_slice(simd, &self.colors[lanes]);
        let zero = Numbers::<S>::splat(simd, 0.0);
        let none = Words::<S>::splat(simd, 0);
        let [x, y, z] = direction_of(simd, code, none);
        let has_none = (colors & ALPHA).simd_eq(0);
        let alpha: Numbers<S> = ((colors >> 24) & 0xff).to_float();
        let normal = [
            has_none.select(zero, x),
            has_none.select(zero, y),
            has_none.select(zero, z),
        ];
        (normal, (Numbers::<S>::splat(simd, 255.0) - alpha) / 254.0)
    }
}

/// Directions of octahedral codes, of any length, with what the codes leave out.
#[inline(always)]
fn direction_of<S: Simd>(simd: S, code: Words<S>, fine: Words<S>) -> [Numbers<S>; 3] {
    let zero = Numbers::<S>::splat(simd, 0.0);
    let x = coordinate::<S>((code << 16) >> 16, (fine << 21) >> 21);
    let y = coordinate::<S>(code >> 16, (fine << 10) >> 21);
    let z = Numbers::<S>::splat(simd, 1.0) - x.abs() - y.abs();
    let fold = (-z).max(zero);
    let x = x - x.simd_ge(zero).select(fold, -fold);
    let y = y - y.simd_ge(zero).select(fold, -fold);
    [x, y, z]
}

// Functions, as what closures do need not be compiled for the vectors of the function that they are in.

/// A coordinate of an octahedral code, with what the code leaves out.
#[inline(always)]
fn coordinate<S: Simd>(code: Words<S>, left: Words<S>) -> Numbers<S> {
    let (code, left): (Numbers<S>, Numbers<S>) = (code.to_float(), left.to_float());
    ((code + left / 1024.0) / 32767.0).max(-1.0)
}

/// The lowest byte as a value, with what it leaves out in the highest bits of another word.
#[inline(always)]
fn channel<S: Simd>(color: Words<S>, left: Words<S>) -> Numbers<S> {
    let own: Numbers<S> = (((color & 0xff) << 3) + (left >> 29)).to_float();
    own / (8.0 * 255.0)
}

/// A value as a byte.
#[inline(always)]
fn byte<S: Simd>(value: Numbers<S>) -> Words<S> {
    (value * 255.0).round_ties_even().to_int::<Words<S>>()
}
