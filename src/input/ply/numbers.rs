//! Numbers and colors in the bytes of a PLY body.

use super::super::color::color_from_unit;
use super::header::ScalarType;

/// The number at the start of `bytes`; zero when they are too few, which callers have excluded.
#[inline]
pub(super) fn decode<const BIG: bool>(bytes: &[u8], kind: ScalarType) -> f64 {
    macro_rules! number {
        ($type:ty) => {
            match bytes.first_chunk() {
                Some(&chunk) if BIG => <$type>::from_be_bytes(chunk) as f64,
                Some(&chunk) => <$type>::from_le_bytes(chunk) as f64,
                None => 0.0,
            }
        };
    }
    match kind {
        ScalarType::I8 => number!(i8),
        ScalarType::U8 => number!(u8),
        ScalarType::I16 => number!(i16),
        ScalarType::U16 => number!(u16),
        ScalarType::I32 => number!(i32),
        ScalarType::U32 => number!(u32),
        ScalarType::I64 => number!(i64),
        ScalarType::U64 => number!(u64),
        ScalarType::F32 => number!(f32),
        ScalarType::F64 => number!(f64),
    }
}

/// The bits of a packed color of four bytes at the start of `bytes`. A float may hold the bits or their number.
#[inline]
pub(super) fn packed_bits<const BIG: bool>(bytes: &[u8], kind: ScalarType) -> u32 {
    let bits = match bytes.first_chunk() {
        Some(&chunk) if BIG => u32::from_be_bytes(chunk),
        Some(&chunk) => u32::from_le_bytes(chunk),
        None => 0,
    };
    let value = f32::from_bits(bits);
    let is_number = (1.0..=16_777_215.0).contains(&value) && value.fract() == 0.0;
    if kind.is_float() && is_number {
        value as u32
    } else {
        bits
    }
}

/// The color in the bits of a number.
#[inline]
pub(super) fn unpacked(bits: u32) -> [u8; 4] {
    let [blue, green, red, _] = bits.to_le_bytes();
    [red, green, blue, 255]
}

/// The color of the constant part of spherical harmonics: 0.5 and Y00 = 1 / (2 sqrt(pi)) of it.
#[inline]
pub(super) fn of_harmonics(values: [f64; 3]) -> [u8; 4] {
    const Y00: f64 = 0.282_094_791_773_878_14;
    let [red, green, blue] = values.map(|value| color_from_unit(0.5 + Y00 * value));
    [red, green, blue, 255]
}

/// Tells whether an alpha means opaque in any of the ranges.
#[inline]
pub(super) fn is_opaque(alpha: f64) -> bool {
    matches!(alpha, -1.0 | 1.0 | 255.0 | 65535.0)
}
