//! Normals in 14 bits: the cells of a warped grid on the faces of a cube.

use crate::math::octahedral;
use glam::{DVec3, Vec3};
use std::f64::consts::FRAC_PI_4;
use std::sync::LazyLock;

/// Cells along a side of a face.
const SIDE: usize = 52;

/// Number of codes: six faces of 52 by 52 cells. The codes from here to 2¹⁴ are free.
pub const NORMAL_CODES: usize = 6 * SIDE * SIDE;

/// Largest angle between a direction and its decoded code, radians (1.404 degrees): the corner of the cell that is
/// farthest from its middle, and the rounding of the records' octahedral code.
pub const NORMAL_ERROR: f64 = 0.0245;

/// Packs a direction of any length: the face by the largest component and its sign; in the face the ratios of the other two
/// to it, by their angle. Zero, and what is not finite, packs as +x.
#[inline]
pub fn encode_normal(direction: Vec3) -> u16 {
    let size = direction.abs();
    let largest = size.max_element();
    if !(largest > 0.0 && largest.is_finite()) {
        return ((SIDE / 2) * SIDE + SIDE / 2) as u16;
    }
    let axis = [size.x, size.y, size.z]
        .iter()
        .position(|&c| c == largest)
        .unwrap_or(0);
    let components = direction.to_array();
    let face = 2 * axis + usize::from(components[axis] < 0.0);
    let cell = |component: f32| {
        let ratio = f64::from(component) / f64::from(largest);
        let place = SIDE as f64 / 2.0 * (1.0 + ratio.atan() / FRAC_PI_4);
        (place.max(0.0) as usize).min(SIDE - 1)
    };
    let (u, w) = (
        cell(components[(axis + 1) % 3]),
        cell(components[(axis + 2) % 3]),
    );
    ((face * SIDE + u) * SIDE + w) as u16
}

/// The direction in the middle of a cell, by its definition; `code` is below [`NORMAL_CODES`].
fn middle(code: usize) -> DVec3 {
    let tangent = |cell: usize| {
        let place = (2.0 * cell as f64 + 1.0) / SIDE as f64 - 1.0;
        (place * FRAC_PI_4).tan()
    };
    let (face, u, w) = (code / (SIDE * SIDE), code / SIDE % SIDE, code % SIDE);
    let axis = face / 2;
    let mut direction = [0.0; 3];
    direction[axis] = if face % 2 == 1 { -1.0 } else { 1.0 };
    direction[(axis + 1) % 3] = tangent(u);
    direction[(axis + 2) % 3] = tangent(w);
    DVec3::from_array(direction).normalize()
}

static PACKED: LazyLock<Vec<[i16; 2]>> = LazyLock::new(|| {
    (0..NORMAL_CODES)
        .map(|code| octahedral::encode(middle(code).as_vec3()))
        .collect()
});

/// All directions in the octahedral code of the records, by code: [`NORMAL_CODES`] of them.
pub fn packed_normals() -> &'static [[i16; 2]] {
    &PACKED
}

/// Unpacks to a unit vector: what the records unpack to, so that bounds measured around it hold for them. Codes that are
/// none unpack as the last.
#[inline]
pub fn decode_normal(code: u16) -> Vec3 {
    octahedral::decode(PACKED[usize::from(code).min(NORMAL_CODES - 1)])
}

#[cfg(test)]
mod tests {
    use super::super::random::TestNumbers;
    use super::*;

    fn angle(a: DVec3, b: DVec3) -> f64 {
        a.cross(b).length().atan2(a.dot(b))
    }

    #[test]
    fn every_code_is_that_of_its_own_direction() {
        for code in 0..NORMAL_CODES as u16 {
            let direction = decode_normal(code);
            assert!((direction.length() - 1.0).abs() < 1e-6);
            assert_eq!(encode_normal(direction), code);
            assert_eq!(encode_normal(direction * 1e-20), code);
        }
    }

    #[test]
    fn the_error_is_below_its_bound_and_the_bound_is_not_slack() {
        let mut numbers = TestNumbers(3);
        let (mut sum, mut worst) = (0.0, 0.0f64);
        const COUNT: usize = 300_000;
        for _ in 0..COUNT {
            let direction = numbers.direction();
            let decoded = decode_normal(encode_normal(direction.as_vec3())).as_dvec3();
            let off = angle(direction, decoded);
            sum += off;
            worst = worst.max(off);
        }
        // Corners of cells are the farthest from their middles.
        let tangent = |place: usize| ((place as f64 / 52.0 - 1.0) * FRAC_PI_4).tan();
        for (u, w) in (0..SIDE).flat_map(|u| (0..SIDE).map(move |w| (u, w))) {
            let center = decode_normal((u * SIDE + w) as u16).as_dvec3();
            for (du, dw) in [(0, 0), (0, 2), (2, 0), (2, 2)] {
                let corner = DVec3::new(1.0, tangent(2 * u + du), tangent(2 * w + dw));
                worst = worst.max(angle(corner, center));
            }
        }
        let mean = (sum / COUNT as f64).to_degrees();
        assert!((mean - 0.62).abs() < 0.02, "{mean}");
        assert!(worst <= NORMAL_ERROR, "{worst}");
        assert!(worst > 0.98 * NORMAL_ERROR, "{worst}");
    }

    #[test]
    fn faces_are_where_they_are_said_to_be() {
        let middle = (SIDE / 2 * SIDE + SIDE / 2) as u16;
        for (face, direction) in [
            Vec3::X,
            Vec3::NEG_X,
            Vec3::Y,
            Vec3::NEG_Y,
            Vec3::Z,
            Vec3::NEG_Z,
        ]
        .into_iter()
        .enumerate()
        {
            let code = encode_normal(direction);
            assert_eq!(code, face as u16 * (SIDE * SIDE) as u16 + middle);
        }
        assert_eq!(encode_normal(Vec3::ZERO), middle);
        assert_eq!(encode_normal(Vec3::NAN), middle);
        assert_eq!(encode_normal(Vec3::new(1.0, 1.0, 0.999)) / 2704, 0);
        // Codes that are none do not leave the table.
        assert_eq!(decode_normal(u16::MAX), decode_normal(16_223));
    }
}
