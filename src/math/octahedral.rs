//! Unit vectors packed into two signed normalized integers on the octahedron.
//!
//! Source: Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors" (2014).
//! `shaders/common/octahedral.glsl` decodes the same words.

use glam::Vec3;

/// Largest angle in radians between a unit vector and its decoded 2 x 16 bit code, rounded up.
///
/// Half a step e = 0.5 / 32767 in both coordinates moves the point (x, y, 1 - |x| - |y|) by at most sqrt(6) e; in the
/// middle of a face, at distance 1 / sqrt(3), that is an angle of sqrt(18) e = 6.48e-5. The rest is for single
/// precision (measured over 2 million directions: 6.42e-5; see the tests).
pub const ERROR_16: f32 = 6.6e-5;

/// Packs a direction (need not be unit length). A zero or non-finite vector packs as +z.
#[inline]
pub fn encode(v: Vec3) -> [i16; 2] {
    let norm = v.x.abs() + v.y.abs() + v.z.abs();
    if !(norm > 0.0 && norm.is_finite()) {
        return [0, 0];
    }
    let p = v / norm;
    let (x, y) = if p.z >= 0.0 {
        (p.x, p.y)
    } else {
        (
            (1.0 - p.y.abs()) * 1f32.copysign(p.x),
            (1.0 - p.x.abs()) * 1f32.copysign(p.y),
        )
    };
    // Truncation after adding a half rounds to nearest; `round` is a function call before SSE 4.1.
    let quantize = |c: f32| {
        let scaled = c.clamp(-1.0, 1.0) * 32767.0;
        (scaled + 0.5f32.copysign(scaled)) as i16
    };
    [quantize(x), quantize(y)]
}

/// Unpacks to a unit vector.
#[inline]
pub fn decode(code: [i16; 2]) -> Vec3 {
    let component = |c: i16| (f32::from(c) * (1.0 / 32767.0)).max(-1.0);
    let (x, y) = (component(code[0]), component(code[1]));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let v = Vec3::new(x - fold.copysign(x), y - fold.copysign(y), z);
    v / v.length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn angle(a: Vec3, b: Vec3) -> f64 {
        let (a, b) = (a.as_dvec3().normalize(), b.as_dvec3().normalize());
        a.cross(b).length().atan2(a.dot(b))
    }

    /// Evenly spread directions (golden-angle spiral).
    fn spiral(count: u32) -> impl Iterator<Item = Vec3> {
        (0..count).map(move |i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
            let azimuth = f64::from(i) * 2.399_963_229_728_653;
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * azimuth.cos(), r * azimuth.sin(), z).as_vec3()
        })
    }

    #[test]
    fn error_is_below_the_stated_bound_and_the_bound_is_not_slack() {
        let worst = spiral(2_000_000)
            .map(|v| angle(v, decode(encode(v))))
            .fold(0.0, f64::max);
        assert!(worst <= f64::from(ERROR_16), "{worst}");
        assert!(
            worst > 0.9 * f64::from(ERROR_16),
            "{worst}: the constant is too large"
        );
    }

    #[test]
    fn axes_are_exact_and_degenerate_vectors_are_up() {
        for v in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z] {
            assert!(angle(decode(encode(v * 3.0)), v) < 1e-6);
        }
        for v in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY] {
            assert_eq!(decode(encode(v)), Vec3::Z);
        }
    }

    #[test]
    fn decoded_vectors_have_unit_length_for_every_word() {
        for x in (i16::MIN..=i16::MAX).step_by(331) {
            for y in (i16::MIN..=i16::MAX).step_by(337) {
                assert!((decode([x, y]).length() - 1.0).abs() < 1e-6);
            }
        }
    }
}
