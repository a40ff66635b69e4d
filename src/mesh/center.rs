//! Keeps positions near the model-space zero.

use super::Mesh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Positions that reach further from zero than this many times the longest side of their box are moved. Three bits of
/// single precision are lost there; at 500 times, bounding spheres and cameras are rounded by so much that three pixels
/// in a hundred show another splat.
const FARTHEST: f64 = 8.0;

/// Moves the model-space zero to positions that lie far from it, in each axis in which they reach further than 8 times the
/// longest side of their box: spheres and cameras are relative to it in single precision.
///
/// World positions stay exactly: the new zero is a multiple of a power of two below that side, and seven sides away the
/// steps of single precision are so large that every difference to it has at most 24 bits. Positions that are near, all
/// the same or not all finite are left alone.
pub fn recenter(mesh: &mut Mesh) {
    let (min, max, is_finite) = mesh
        .positions
        .par_iter()
        .with_min_len(1 << 16)
        .map(|&p| (p, p, p.is_finite()))
        .reduce(
            || (Vec3::INFINITY, Vec3::NEG_INFINITY, true),
            |a, b| (a.0.min(b.0), a.1.max(b.1), a.2 && b.2),
        );
    if !is_finite {
        return;
    }
    let zero = recentered_zero(min, max);
    if zero == DVec3::ZERO {
        return;
    }
    mesh.origin += zero;
    mesh.positions
        .par_iter_mut()
        .with_min_len(1 << 16)
        .for_each(|p| *p = (p.as_dvec3() - zero).as_vec3());
}

/// Where [`recenter`] moves the zero of positions in a box.
pub fn recentered_zero(min: Vec3, max: Vec3) -> DVec3 {
    let (min, max) = (min.as_dvec3(), max.as_dvec3());
    let side = (max - min).max_element();
    if !(side > 0.0 && side.is_finite()) {
        return DVec3::ZERO;
    }
    let is_far = min
        .abs()
        .max(max.abs())
        .cmpgt(DVec3::splat(FARTHEST * side));
    let step = side.log2().floor().exp2();
    let middle = ((min + max) * (0.5 / step)).round() * step;
    DVec3::select(is_far, middle, DVec3::ZERO)
}

/// Where the zero of single-precision positions lies for coordinates in a box, `rounding` the farthest that single precision
/// moves one of them. Zero unless single precision would lose detail: some coordinate is over 1000 times the extent (a
/// single step is then over 6e-5 of the extent), or rounding moves some point by more than a millionth of the extent. The
/// origin is the middle of the box on a whole unit, or on a power of two below the extent when the model is smaller than a
/// unit: coordinates then stay readable, and differences to the origin of values that came from single precision are exact.
pub fn origin_of(min: DVec3, max: DVec3, rounding: f64) -> DVec3 {
    let extent = (max - min).max_element();
    let largest = min.abs().max(max.abs()).max_element();
    if !(extent > 0.0 && largest.is_finite()) {
        return DVec3::ZERO;
    }
    if largest <= 1000.0 * extent && rounding <= 1e-6 * extent {
        return DVec3::ZERO;
    }
    let step = if extent >= 1.0 {
        1.0
    } else {
        extent.log2().floor().exp2()
    };
    let middle = 0.5 * (min + max);
    let origin = (middle / step).round() * step;
    if origin.is_finite() {
        origin
    } else {
        DVec3::ZERO
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: DVec3 = DVec3::new(0.5, 0.25, 0.125);

    fn moved(positions: &[Vec3]) -> Mesh {
        let mut mesh = Mesh {
            positions: positions.to_vec(),
            origin: START,
            ..Mesh::default()
        };
        recenter(&mut mesh);
        mesh
    }

    #[test]
    fn far_positions_come_near_and_stay_in_the_world() {
        // A step of single precision is 1/16 up there; z is near, with a value that is not a multiple of anything.
        let parts = [
            Vec3::new(0.0, 0.0, 0.1),
            Vec3::new(70.0, 3.125, -1e-9),
            Vec3::new(-20.5, 0.0625, 9.3),
        ];
        let given = parts.map(|p| Vec3::new(1e6, -2e6, 0.0) + p);
        let mesh = moved(&given);
        let by = mesh.origin - START;
        assert!(by.x > 9e5 && by.y < -1.9e6 && by.z == 0.0, "{by}");
        for (p, given) in mesh.positions.iter().zip(given) {
            assert!(p.abs().max_element() < 100.0, "{p}");
            let world = by + p.as_dvec3();
            assert_eq!(world, given.as_dvec3());
        }
    }

    #[test]
    fn a_step_from_zero_is_far_for_what_is_small() {
        // Thirty steps of single precision wide.
        let step = f32::EPSILON;
        let given = [0.0, 7.0, 11.0, 30.0].map(|i| Vec3::new(1.0 + i * step, 0.0, i * 1e-9));
        let mesh = moved(&given);
        for (p, given) in mesh.positions.iter().zip(given) {
            assert!(p.x.abs() <= 31.0 * step && p.z == given.z, "{p}");
        }
        assert_eq!(mesh.positions[2].x - mesh.positions[0].x, 11.0 * step);
    }

    #[test]
    fn near_equal_and_broken_positions_stay() {
        for positions in [
            vec![Vec3::splat(7.0), Vec3::splat(8.0)],
            vec![Vec3::splat(1e6); 3],
            vec![Vec3::splat(1e6), Vec3::splat(1e6 + 1.0), Vec3::NAN],
            vec![Vec3::NAN, Vec3::splat(1e6), Vec3::splat(1e6 + 1.0)],
            vec![Vec3::splat(1e6), Vec3::splat(1e6 + 1.0), Vec3::INFINITY],
            vec![Vec3::splat(f32::MAX), Vec3::splat(f32::MIN)],
            vec![],
        ] {
            let mesh = moved(&positions);
            assert_eq!(mesh.origin, START, "{positions:?}");
            assert!(format!("{:?}", mesh.positions) == format!("{positions:?}"));
        }
    }
}
