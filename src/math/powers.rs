//! Logarithms and powers of 2 without calls, which vectors of them can be made of.

/// The binary logarithm of a positive, normal number; off by less than 2e-7 of 1 and of its size.
#[inline(always)]
pub(crate) fn log2(value: f32) -> f32 {
    // To a mantissa between the roots of a half and of 2.
    const ROOT_OF_HALF: u32 = 0x3f35_04f3;
    let bits = value.to_bits().wrapping_sub(ROOT_OF_HALF);
    let exponent = (bits as i32) >> 23;
    let mantissa = f32::from_bits((bits & 0x007f_ffff) + ROOT_OF_HALF);
    // 2 artanh(t) / ln 2 with t = (m - 1) / (m + 1), of which |t| < 0.172.
    let t = (mantissa - 1.0) / (mantissa + 1.0);
    let square = t * t;
    let series = 1.0 + square * (1.0 / 3.0 + square * (1.0 / 5.0 + square * (1.0 / 7.0)));
    exponent as f32 + std::f32::consts::LOG2_E * 2.0 * t * series
}

/// 2 to a power that is not above 0; off by less than 1e-6.
#[inline(always)]
pub(crate) fn exp2(power: f32) -> f32 {
    let power = power.max(-126.0);
    let whole = power.floor();
    let x = (power - whole) * std::f32::consts::LN_2;
    // The series of the exponential up to the seventh power.
    let series = 1.0
        + x * (1.0
            + x * (1.0 / 2.0
                + x * (1.0 / 6.0
                    + x * (1.0 / 24.0 + x * (1.0 / 120.0 + x * (1.0 / 720.0 + x / 5040.0))))));
    series * f32::from_bits(((whole as i32 + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm_and_power_are_those_of_the_library() {
        for i in 1..200_000u32 {
            let value = 1e-6 * f32::powi(1.000_2, i as i32);
            let wanted = f64::from(value).log2();
            let off = (f64::from(log2(value)) - wanted).abs();
            assert!(off < 2e-7 * (1.0 + wanted.abs()), "{value}: {off}");
            let power = -1e-4 * i as f32;
            let off = f64::from(exp2(power)) - f64::from(power).exp2();
            assert!(off.abs() < 1e-6, "{power}: {off}");
        }
        assert_eq!((log2(1.0), exp2(0.0)), (0.0, 1.0));
        assert!(exp2(-1e30) < 1e-30);
    }
}
