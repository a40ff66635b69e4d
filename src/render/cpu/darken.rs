//! What looks share that darken a drawn picture: its pixels, and light that takes nothing from the background.

/// The picture of a rectangle, drawn.
pub(crate) struct DrawnRectangle<'a> {
    /// From the first pixel of the rectangle on: red in the lowest byte, coverage in the highest.
    pub(crate) colors: &'a mut [u32],
    /// From a row of colors to the next, pixels.
    pub(crate) pitch: usize,
    /// Reversed depths, row by row; 0 where nothing is.
    pub(crate) depths: &'a [f32],
    /// Width, pixels.
    pub(crate) width: usize,
}

impl DrawnRectangle<'_> {
    /// The same once more, for a look of several.
    pub(crate) fn again(&mut self) -> DrawnRectangle<'_> {
        DrawnRectangle {
            colors: &mut *self.colors,
            ..*self
        }
    }
}

/// A pixel with less light: red in the lowest byte, coverage in the highest. The background (0 to 255) shows through what is not
/// covered and keeps its light. Where nothing is drawn nothing changes.
#[inline(always)]
pub(super) fn darkened_word(word: u32, light: f32, background: [f32; 3], is_drawn: bool) -> u32 {
    let alpha = word >> 24;
    let open = 1.0 - alpha as f32 * (1.0 / 255.0);
    let byte = |shift: u32, background: f32| {
        let value = (word >> shift & 255) as f32;
        let behind = background * open;
        let darkened = behind + (value - behind) * light;
        (darkened.clamp(0.0, 255.0) + 0.5) as u32
    };
    let [red, green, blue] = background;
    let darkened = byte(0, red) | byte(8, green) << 8 | byte(16, blue) << 16 | alpha << 24;
    if is_drawn && alpha > 0 {
        darkened
    } else {
        word
    }
}

/// A pixel of floats with less light: see [`darkened_word`]; the background is 0 to 1.
pub(super) fn darken_value(value: &mut [f32; 4], light: f32, background: [f32; 3]) {
    let alpha = value[3];
    for (color, background) in value.iter_mut().zip(background) {
        let behind = background * (1.0 - alpha);
        *color = behind + (*color - behind) * light;
    }
}

/// The binary logarithm of a positive, normal number; off by less than 2e-7 of 1 and of its size.
#[inline(always)]
pub(super) fn log2(value: f32) -> f32 {
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
pub(super) fn exp2(power: f32) -> f32 {
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
