//! The shape of a point's neighborhood: what its radius has to close.
//!
//! A cloud's point is drawn as large as it takes to close a surface. Where its neighbors lie along a line (a wire, an edge) or
//! all around (leaves, dust), there is no surface, and points of that size would be boxes over boxes. Source of the
//! measure: Demantké, Mallet, David and Vallet, *Dimensionality Based Scale Selection in 3D Lidar Point Clouds* (2011): with
//! s1 >= s2 >= s3 the roots of the eigenvalues of the covariance, (s1 - s2) / s1 is how linear, s3 / s1 how scattered.

use glam::{DVec3, Vec3};

/// Radius of points without a surface, in those that would close one.
const LEAST: f32 = 1.0 / 3.0;

/// How scattered neighbors of a surface may be, and from where on they are none: noise of a scanner across, and a sample of
/// six in a volume.
const SCATTERED: [f64; 2] = [0.12, 0.3];

/// The same of how linear they are.
const LINEAR: [f64; 2] = [0.85, 0.97];

/// Limits of how much neighbors may lie to one side, from where on a point stands apart from their surface: the length of the sum of
/// the ways to them over the sum of their lengths. 0 amid a surface, 0.64 at its edge, 0.84 at the corner of a grid, 1 far away.
const ASIDE: [f64; 2] = [0.86, 0.92];

/// What the neighbors of a point lie in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NeighborPlane {
    /// Which part of the distance that closes a surface the point's radius is: 1 where its neighbors lie about in a plane, a
    /// third where they lie on a line, all around it or all to one side; between, it falls evenly. 1 for fewer than three.
    pub(super) share: f32,
    /// Neighbors lie on a line rather than all around.
    pub(super) is_line: bool,
    /// Normal of the plane through them, either way around: the direction of least variance. Zero where they make no surface.
    pub(super) normal: Vec3,
}

impl NeighborPlane {
    const UNKNOWN: Self = Self {
        share: 1.0,
        is_line: false,
        normal: Vec3::ZERO,
    };
}

/// Finds the plane of the neighbors of a point, by their differences to it.
pub(super) fn plane_of(neighbors: impl Iterator<Item = Vec3> + Clone) -> NeighborPlane {
    let count = neighbors.clone().count();
    if count < 3 {
        return NeighborPlane::UNKNOWN;
    }
    // With the point itself, which is at zero.
    let all = || neighbors.clone().map(Vec3::as_dvec3);
    let mean = all().sum::<DVec3>() / (count + 1) as f64;
    let mut sums = [0.0; 6];
    for p in all().chain([DVec3::ZERO]) {
        let d = p - mean;
        for (sum, product) in sums.iter_mut().zip([
            d.x * d.x,
            d.y * d.y,
            d.z * d.z,
            d.x * d.y,
            d.x * d.z,
            d.y * d.z,
        ]) {
            *sum += product;
        }
    }
    let values = eigenvalues(sums);
    let [s1, s2, s3] = values.map(|value| value.max(0.0).sqrt());
    if !(s1 > 0.0 && s1.is_finite()) {
        return NeighborPlane::UNKNOWN;
    }
    let past = |value: f64, [from, to]: [f64; 2]| ((value - from) / (to - from)).clamp(0.0, 1.0);
    let (scattered, linear) = (past(s3 / s1, SCATTERED), past((s1 - s2) / s1, LINEAR));
    let lengths = all().map(DVec3::length).sum::<f64>();
    let aside = past(all().sum::<DVec3>().length() / lengths, ASIDE);
    let scattered = scattered.max(aside);
    let lost = scattered.max(linear) as f32;
    NeighborPlane {
        share: 1.0 - (1.0 - LEAST) * lost,
        is_line: linear > scattered,
        normal: match lost < 1.0 {
            true => eigenvector(sums, values[2]),
            false => Vec3::ZERO,
        },
    }
}

/// Unit eigenvector of a symmetric matrix (xx, yy, zz, xy, xz, yz) for an eigenvalue: across two of the rows of what is left when
/// it is taken off, those that are the least parallel. Zero where all are.
fn eigenvector([xx, yy, zz, xy, xz, yz]: [f64; 6], value: f64) -> Vec3 {
    let [a, b, c] = [
        DVec3::new(xx - value, xy, xz),
        DVec3::new(xy, yy - value, yz),
        DVec3::new(xz, yz, zz - value),
    ];
    let crosses = [a.cross(b), b.cross(c), c.cross(a)];
    let longest = crosses.into_iter().fold(DVec3::ZERO, |best, own| {
        match own.length_squared() > best.length_squared() {
            true => own,
            false => best,
        }
    });
    longest.normalize_or_zero().as_vec3()
}

/// Eigenvalues of a symmetric matrix (xx, yy, zz, xy, xz, yz), the largest first, by their angles (Smith, 1961).
fn eigenvalues([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> [f64; 3] {
    let off = xy * xy + xz * xz + yz * yz;
    let mean = (xx + yy + zz) / 3.0;
    let [a, b, c] = [xx - mean, yy - mean, zz - mean];
    let spread = ((a * a + b * b + c * c + 2.0 * off) / 6.0).sqrt();
    if spread <= 0.0 {
        return [mean; 3];
    }
    let determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
    let angle = (determinant / (2.0 * spread.powi(3)))
        .clamp(-1.0, 1.0)
        .acos()
        / 3.0;
    let first = mean + 2.0 * spread * angle.cos();
    let last = mean + 2.0 * spread * (angle + 2.0 * std::f64::consts::FRAC_PI_3).cos();
    [first, 3.0 * mean - first - last, last]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_closed_and_lines_and_volumes_are_not() {
        let share =
            |points: &[[f32; 3]]| plane_of(points.iter().map(|&p| Vec3::from_array(p))).share;
        let around = |k: f32| [k.cos(), k.sin()];
        let ring = |height: f32| -> Vec<[f32; 3]> {
            (0..6)
                .map(|k| {
                    let [x, y] = around(k as f32 * std::f32::consts::FRAC_PI_3);
                    [x, y, if k % 2 == 0 { height } else { -height }]
                })
                .collect()
        };
        assert_eq!(share(&ring(0.0)), 1.0);
        // Noise of a twentieth of the distance to the neighbors is still a surface.
        assert_eq!(share(&ring(0.05)), 1.0);
        let corners = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let others = [[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
        assert!((share(&[corners, others].concat()) - LEAST).abs() < 1e-6);
        let line: Vec<[f32; 3]> = [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0]
            .iter()
            .map(|&x| [x, 0.01 * x * x, 0.0])
            .collect();
        assert!((share(&line) - LEAST).abs() < 1e-6);
        // A strip twice as long as wide, turned in space, is a surface.
        let strip: Vec<[f32; 3]> = ring(0.0).iter().map(|&[x, y, _]| [2.0 * x, y, y]).collect();
        assert_eq!(share(&strip), 1.0);
        assert_eq!(share(&corners[..2]), 1.0);
        // Edge and corner of a grid, and a point before its middle.
        let grid = |points: &[[i32; 2]], height: f32| -> Vec<[f32; 3]> {
            let place = |&[x, y]: &[i32; 2]| [x as f32, y as f32, height];
            points.iter().map(place).collect()
        };
        let near: Vec<[i32; 2]> = (-1..=1)
            .flat_map(|x| (-1..=1).map(move |y| [x, y]))
            .collect();
        let edge: Vec<[i32; 2]> = near.iter().map(|[x, y]| [*x, y + 1]).collect();
        assert_eq!(share(&grid(&edge, 0.0)), 1.0);
        let corner = share(&grid(
            &[[0, 1], [1, 0], [1, 1], [2, 0], [0, 2], [1, 2]],
            0.0,
        ));
        assert_eq!(corner, 1.0);
        assert!((share(&grid(&near, 9.0)) - LEAST).abs() < 1e-6);
        assert_eq!(share(&[[0.0; 3]; 6]), 1.0);
    }

    #[test]
    fn normals_are_those_of_the_plane_and_none_where_there_is_no_surface() {
        let turn = glam::Quat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0);
        // A lattice of 12 around the point, with noise of a twentieth across.
        let lattice = || {
            let at = |i: i32| [i % 4 - 1, i / 4 - 1].map(|v| v as f32);
            (0..12).map(move |i| {
                let [x, y] = at(i);
                turn * Vec3::new(x, y, if i % 3 == 0 { 0.05 } else { -0.05 })
            })
        };
        let found = plane_of(lattice());
        let cos = found.normal.dot(turn * Vec3::Z).abs();
        assert!(found.share == 1.0 && cos > 0.999, "{found:?} {cos}");
        assert!((found.normal.length() - 1.0).abs() < 1e-6);
        let corners =
            (0..8).map(|i| Vec3::new((i & 1) as f32, ((i / 2) & 1) as f32, (i / 4) as f32) - 0.5);
        assert_eq!(plane_of(corners).normal, Vec3::ZERO);
        let line = (1..12).map(|i| turn * Vec3::X * i as f32);
        assert_eq!(plane_of(line).normal, Vec3::ZERO);
        assert_eq!(
            plane_of([Vec3::X, Vec3::Y].into_iter()),
            NeighborPlane::UNKNOWN
        );
    }

    #[test]
    fn eigenvalues_are_those_of_a_turned_diagonal() {
        let turn = glam::DMat3::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0);
        for wanted in [[5.0, 2.0, 1.0], [4.0, 4.0, 0.0], [3.0, 0.0, 0.0], [1.0; 3]] {
            let m = turn * glam::DMat3::from_diagonal(DVec3::from_array(wanted)) * turn.transpose();
            let found = eigenvalues([
                m.x_axis.x, m.y_axis.y, m.z_axis.z, m.x_axis.y, m.x_axis.z, m.y_axis.z,
            ]);
            for (found, wanted) in found.iter().zip(wanted) {
                assert!((found - wanted).abs() < 1e-7, "{found} {wanted}");
            }
        }
    }
}
