//! Unit vectors packed into two signed normalized integers on the octahedron.
//!
//! Source: Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors" (2014).
//! `shaders/common/octahedral.glsl` decodes the same words.

use glam::Vec3;

/// Largest angle in radians between a unit vector and its decoded 2 x 16 bit code, rounded up
/// (measured over 10^7 directions: 3.4e-5; see the tests).
pub const ERROR_16: f32 = 4.0e-5;

/// Packs a direction (need not be unit length). A zero or non-finite vector packs as +z.
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
    let quantize = |c: f32| (c.clamp(-1.0, 1.0) * 32767.0).round() as i16;
    [quantize(x), quantize(y)]
}

/// Unpacks to a unit vector.
pub fn decode(code: [i16; 2]) -> Vec3 {
    let component = |c: i16| (f32::from(c) / 32767.0).max(-1.0);
    let (x, y) = (component(code[0]), component(code[1]));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let v = Vec3::new(x - fold.copysign(x), y - fold.copysign(y), z);
    v / v.length()
}
