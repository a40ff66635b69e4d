//! Sines that are the same on every machine.
//!
//! The standard library's `sin` is the platform's, and platforms differ in the last bit; a generated model
//! should not. This one uses only additions, multiplications and comparisons, whose results IEEE 754 fixes,
//! and it is free of branches, so that loops over it become vector code.

use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, PI};

/// The leading 33 bits of pi: `k * PI_HIGH` is exact for |k| up to 2^20.
const PI_HIGH: f64 = f64::from_bits(PI.to_bits() & !0xF_FFFF);
/// The next 20 bits of pi: `PI_HIGH + PI_MIDDLE` is the double nearest to pi, exactly.
const PI_MIDDLE: f64 = PI - PI_HIGH;
/// What the double nearest to pi lacks.
const PI_LOW: f64 = 1.224_646_799_147_353_2e-16;
/// Adding 1.5 * 2^52 pushes the fraction out of the significand: the sum is rounded to an integer.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// 1/n! with alternating signs for n = 21, 19, ..., 3. At pi/2 the first omitted term is 1.2e-18.
const TAYLOR: [f64; 10] = {
    let mut table = [0.0; 10];
    let mut factorial = 1.0;
    let mut n = 1;
    while n < 11 {
        factorial *= (2 * n) as f64 * (2 * n + 1) as f64;
        table[10 - n] = if n % 2 == 1 { -1.0 } else { 1.0 } / factorial;
        n += 1;
    }
    table
};

/// The sine of `x` radians, for |x| up to 10^6; absolute error below 4e-16. Outside that range the error
/// grows with |x|; infinities and NaN give NaN.
#[inline]
pub(super) fn sin(x: f64) -> f64 {
    // x = k pi + r with |r| <= pi/2, and sin x = (-1)^k sin r.
    let shifted = x * FRAC_1_PI + ROUND;
    let k = shifted - ROUND;
    let r = ((x - k * PI_HIGH) - k * PI_MIDDLE) - k * PI_LOW;
    let square = r * r;
    let mut series = 0.0;
    for coefficient in TAYLOR {
        series = series * square + coefficient;
    }
    let value = r + r * square * series;
    // The parity of k is the lowest bit of the shifted significand.
    f64::from_bits(value.to_bits() ^ (shifted.to_bits() << 63))
}

/// Sine and cosine of `k / n` of a full turn, `k < n`, reduced in integers: exact at the four quarter turns,
/// and bit-identical up to sign and exchange for angles that mirror each other.
pub(super) fn turn(k: u64, n: u64) -> (f64, f64) {
    let quadrant = 4 * k / n;
    let rest = 4 * k % n;
    let mirrored = 2 * rest > n;
    let rest = if mirrored { n - rest } else { rest };
    let angle = FRAC_PI_2 * (rest as f64 / n as f64);
    let half = sin(0.5 * angle);
    let direct = (sin(angle), 1.0 - 2.0 * half * half);
    let (s, c) = if mirrored {
        (direct.1, direct.0)
    } else {
        direct
    };
    match quadrant {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sin_agrees_with_the_standard_library() {
        let mut worst: f64 = 0.0;
        for i in -200_000..200_000 {
            let x = f64::from(i) * 0.001_713;
            worst = worst.max((sin(x) - x.sin()).abs());
        }
        assert!(worst < 4e-16, "error {worst:e}");
        assert!((sin(1e6) - 1e6_f64.sin()).abs() < 4e-16);
        assert_eq!(sin(0.0), 0.0);
        assert!(sin(f64::INFINITY).is_nan() && sin(f64::NAN).is_nan());
    }

    #[test]
    fn turn_is_exact_at_quarters_and_symmetric() {
        for n in [4, 12, 100, 1000] {
            let quarter = n / 4;
            assert_eq!(turn(0, n), (0.0, 1.0));
            assert_eq!(turn(quarter, n), (1.0, 0.0));
            assert_eq!(turn(2 * quarter, n), (0.0, -1.0));
            assert_eq!(turn(3 * quarter, n), (-1.0, 0.0));
        }
        for n in [3, 7, 1000, 20_000] {
            for k in 0..n {
                let (s, c) = turn(k, n);
                let angle = 2.0 * PI * k as f64 / n as f64;
                assert!((s - angle.sin()).abs() < 2e-15 && (c - angle.cos()).abs() < 2e-15);
                if k > 0 {
                    assert_eq!(turn(n - k, n), (-s, c), "mirror of {k}/{n}");
                }
            }
        }
    }
}
