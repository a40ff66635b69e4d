//! Keeps positions near the model-space zero.

use super::Mesh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Positions that reach further from zero than this many times the longest side of their box are moved. Three bits of
/// single precision are lost there; at 500 times, bounding spheres and cameras are rounded by so much that three pixels
/// in a hundred show another splat.
const FARTHEST: f64 = 8.0;

/// Moves the model-space zero to the middle of positions that lie far from it (8 times the longest side of their box):
/// spheres and cameras are relative to it in single precision. World positions stay, up to 2⁻²³ of that side; they stay
/// exactly where all coordinates of an axis are far from zero, because the new zero lies on a power of two below the side.
///
/// Others are left alone, as are positions that are all the same or not all finite.
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
    let (min, max) = (min.as_dvec3(), max.as_dvec3());
    let side = (max - min).max_element();
    let farthest = min.abs().max(max.abs()).max_element();
    if !(is_finite && side > 0.0 && farthest > FARTHEST * side) {
        return;
    }
    let step = side.log2().floor().exp2();
    let zero: DVec3 = ((min + max) * (0.5 / step)).round() * step;
    mesh.origin += zero;
    mesh.positions
        .par_iter_mut()
        .with_min_len(1 << 16)
        .for_each(|p| *p = (p.as_dvec3() - zero).as_vec3());
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(positions: &[Vec3]) -> Mesh {
        let mut mesh = Mesh {
            positions: positions.to_vec(),
            origin: DVec3::new(0.1, 0.2, 0.3),
            ..Mesh::default()
        };
        recenter(&mut mesh);
        mesh
    }

    #[test]
    fn far_positions_come_near_and_stay_in_the_world() {
        // A step of single precision is 1/16 up here.
        let far = Vec3::new(1e6, -1e6, 2e6);
        let parts = [
            Vec3::ZERO,
            Vec3::new(70.0, 3.125, -0.5),
            Vec3::new(-20.5, 0.0625, 9.0),
        ];
        let given = parts.map(|p| far + p);
        let mesh = moved(&given);
        for (p, given) in mesh.positions.iter().zip(given) {
            assert!(p.abs().max_element() < 100.0, "{p}");
            let world = mesh.origin - DVec3::new(0.1, 0.2, 0.3) + p.as_dvec3();
            assert!((world - given.as_dvec3()).abs().max_element() < 1e-8);
        }
        assert_eq!(
            mesh.positions[1] - mesh.positions[0],
            parts[1],
            "differences are exact"
        );
    }

    #[test]
    fn near_equal_and_broken_positions_stay() {
        for positions in [
            vec![Vec3::splat(7.0), Vec3::splat(8.0)],
            vec![Vec3::splat(1e6); 3],
            vec![Vec3::splat(1e6), Vec3::splat(1e6 + 1.0), Vec3::NAN],
            vec![Vec3::splat(1e6), Vec3::splat(1e6 + 1.0), Vec3::INFINITY],
            vec![Vec3::splat(f32::MAX), Vec3::splat(f32::MIN)],
            vec![],
        ] {
            let mesh = moved(&positions);
            assert_eq!(mesh.origin, DVec3::new(0.1, 0.2, 0.3), "{positions:?}");
            assert!(format!("{:?}", mesh.positions) == format!("{positions:?}"));
        }
    }
}
