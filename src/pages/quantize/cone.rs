//! Cones of normals in two bits.

/// Sines of the half angles of the four codes: squares of quarters (QSplat, section 3.1). A cone of the last one never
/// culls.
pub const CONE_SINES: [f64; 4] = [1.0 / 16.0, 4.0 / 16.0, 9.0 / 16.0, 1.0];

/// The narrowest code whose cone contains one of this half angle, given by its sine; the angle is counted from the axis as
/// it will be decoded. From a quarter turn on, and for what is not a number, the code that never culls.
#[inline]
pub fn cone_code(sin_half_angle: f64) -> u8 {
    CONE_SINES[..3]
        .iter()
        .zip(0u8..)
        .find(|&(&sine, _)| sin_half_angle <= sine)
        .map_or(3, |(_, code)| code)
}

/// Sine of an angle, given by its sine, `more` radians wider; 1 from a quarter turn on. Rounded up by a billionth.
pub fn widened_sine(sin: f64, more: f64) -> f64 {
    let angle = sin.clamp(0.0, 1.0).asin() + more;
    if angle >= std::f64::consts::FRAC_PI_2 {
        1.0
    } else {
        (angle.sin() + 1e-9).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_rounded_up() {
        for (code, sine) in CONE_SINES.into_iter().enumerate() {
            assert_eq!(usize::from(cone_code(sine)), code);
            assert_eq!(usize::from(cone_code(sine + 1e-12)), (code + 1).min(3));
        }
        assert_eq!(cone_code(0.0), 0);
        assert_eq!(cone_code(f64::NAN), 3);
        for step in 0..=1000 {
            let sine = f64::from(step) / 1000.0;
            assert!(CONE_SINES[usize::from(cone_code(sine))] >= sine);
        }
    }

    #[test]
    fn widening_adds_angles() {
        for degrees in [0.0f64, 10.0, 45.0, 80.0] {
            let wide = widened_sine(degrees.to_radians().sin(), 5f64.to_radians());
            let expected = (degrees + 5.0).to_radians().sin();
            assert!(wide >= expected && wide < expected + 1e-8, "{degrees}");
        }
        assert_eq!(widened_sine(0.999, 0.1), 1.0);
        assert_eq!(widened_sine(2.0, 0.0), 1.0);
    }
}
