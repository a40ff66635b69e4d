//! What a node knows about everything below it, as sums that add up, and the attributes made from them.

use super::{NodeAttributes, NormalCone};
use crate::math::cone::{self, DirectionCap};
use crate::math::octahedral;
use glam::{DVec3, Mat3, Vec3};

/// Stands for the area of a triangle without any, so that a node of such still has a mean normal and color.
const LEAST_WEIGHT: f32 = 1e-30;

/// A vector sum shorter than this share of the sum of lengths has no direction.
const CANCELLED: f32 = 1e-6;

/// The direction of a vector sum shorter than this share of the sum of lengths is an accident of the triangles.
const SHORT: f32 = 0.1;

/// Normals point all around where the squared eigenvalues of their second moment (its trace 1) add up to at most this: a
/// third for a ball, a half for a ring, 1 for a sheet and its back.
const ALL_AROUND: f32 = 0.6;

/// The mean normal of half a sphere is half a normal long; less for one of few triangles.
const HEMISPHERE: f32 = 0.4;

/// Mean of n . v over what is seen of a ball from v, by projected area: what lights what has normals all around.
pub(super) const OF_A_BALL: f32 = 2.0 / 3.0;

/// Sums over the leaves below a node.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SubtreeSums {
    /// Number of corners; then first and second moments (xx, yy, zz, xy, xz, yz) of their offsets from the node's center.
    corners: f32,
    first: Vec3,
    second: [f32; 6],
    /// Area, and the weight of the means: the area, a little more where it is zero.
    pub(super) area: f32,
    weight: f32,
    /// Weighted sum of the vertex normals (three a triangle), and of their lengths.
    normal: Vec3,
    normal_weight: f32,
    /// Weighted sum of the colors.
    color: Vec3,
}

impl SubtreeSums {
    /// Adds a corner at `offset` from the node's center.
    #[inline]
    pub(super) fn add_corner(&mut self, offset: Vec3) {
        let Vec3 { x, y, z } = offset;
        self.corners += 1.0;
        self.first += offset;
        let products = [x * x, y * y, z * z, x * y, x * z, y * z];
        for (sum, product) in self.second.iter_mut().zip(products) {
            *sum += product;
        }
    }

    /// Adds a leaf of an area: the sum of its vertex normals (zero vectors where unknown), the number of known ones, its
    /// mean color (0 to 255).
    #[inline]
    pub(super) fn add_leaf(&mut self, area: f32, normal: Vec3, known_normals: f32, color: Vec3) {
        let weight = area.max(LEAST_WEIGHT);
        self.area += area;
        self.weight += weight;
        self.normal += normal * weight;
        self.normal_weight += known_normals * weight;
        self.color += color * weight;
    }

    /// Adds a child's sums; `offset` is its center less the node's.
    #[inline]
    pub(super) fn add_child(&mut self, child: &SubtreeSums, offset: Vec3) {
        self.corners += child.corners;
        let moved = child.first + offset * child.corners;
        self.first += moved;
        // (p + d)(p + d)^T = p p^T + p d^T + d (p + d)^T
        let (f, d, m) = (child.first, offset, moved);
        let shift = [
            f.x * d.x + d.x * m.x,
            f.y * d.y + d.y * m.y,
            f.z * d.z + d.z * m.z,
            f.x * d.y + d.x * m.y,
            f.x * d.z + d.x * m.z,
            f.y * d.z + d.y * m.z,
        ];
        for ((sum, own), shift) in self.second.iter_mut().zip(child.second).zip(shift) {
            *sum += own + shift;
        }
        self.area += child.area;
        self.weight += child.weight;
        self.normal += child.normal;
        self.normal_weight += child.normal_weight;
        self.color += child.color;
    }

    /// Direction in which the corners are spread most; +z when they coincide.
    pub(super) fn principal_direction(&self) -> Vec3 {
        if self.corners <= 0.0 {
            return Vec3::Z;
        }
        let mean = self.first / self.corners;
        let products = [
            mean.x * mean.x,
            mean.y * mean.y,
            mean.z * mean.z,
            mean.x * mean.y,
            mean.x * mean.z,
            mean.y * mean.z,
        ];
        let mut m = [0f32; 6];
        for ((m, second), product) in m.iter_mut().zip(self.second).zip(products) {
            *m = second / self.corners - product;
        }
        // Squaring four times leaves the sixteenth power, in which the largest eigenvalue rules; every column then
        // points along its vector.
        for _ in 0..4 {
            let trace = m[0] + m[1] + m[2];
            if !(trace > 0.0 && trace.is_finite()) {
                return Vec3::Z;
            }
            let [xx, yy, zz, xy, xz, yz] = m.map(|v| v / trace);
            m = [
                xx * xx + xy * xy + xz * xz,
                xy * xy + yy * yy + yz * yz,
                xz * xz + yz * yz + zz * zz,
                xx * xy + xy * yy + xz * yz,
                xx * xz + xy * yz + xz * zz,
                xy * xz + yy * yz + yz * zz,
            ];
        }
        let [xx, yy, zz, xy, xz, yz] = m;
        if xx >= yy && xx >= zz {
            Vec3::new(xx, xy, xz)
        } else if yy >= zz {
            Vec3::new(xy, yy, yz)
        } else {
            Vec3::new(xz, yz, zz)
        }
    }

    /// Tells whether there are normals but their sum has no direction.
    #[inline]
    pub(super) fn normals_cancel(&self) -> bool {
        self.normal_weight > 0.0 && self.normal.length() <= CANCELLED * self.normal_weight
    }

    /// Tells whether the mean normal says nothing: it is short, and the normals below point all around instead of to and fro.
    /// `parts` are sums of parts and the normals that those have, zero for none.
    #[inline]
    pub(super) fn is_all_around(&self, parts: impl Iterator<Item = (SubtreeSums, Vec3)>) -> bool {
        // What has no area has no sides. Weights are taken relative, since squares of small areas vanish.
        if !(self.area > 0.0 && self.normal_weight > 0.0)
            || (self.normal / self.normal_weight).length() > SHORT
        {
            return false;
        }
        let mut moment = Mat3::ZERO;
        for (sums, normal) in parts {
            // The normals of a cap around its axis have a mean of (1 + c) / 2, c the cosine of its half angle, and a second
            // moment of (1 + c + c^2) / 3 along the axis. Less than half a sphere: they point to and fro.
            let length = (sums.normal / sums.normal_weight.max(f32::MIN_POSITIVE)).length();
            let along = if normal == Vec3::ZERO {
                1.0 / 3.0
            } else if length < HEMISPHERE {
                1.0
            } else {
                let c = (2.0 * length - 1.0).clamp(0.0, 1.0);
                (1.0 + c + c * c) / 3.0
            };
            let across = 0.5 * (1.0 - along);
            let axis = Mat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
            moment +=
                (axis * (along - across) + Mat3::IDENTITY * across) * (sums.weight / self.weight);
        }
        let trace = moment.x_axis.x + moment.y_axis.y + moment.z_axis.z;
        let squares: f32 = moment.to_cols_array().iter().map(|v| v * v).sum();
        trace > 0.0 && squares <= ALL_AROUND * trace * trace
    }

    /// The attributes, as flat as they can be; `substitute` gives the normal where the known ones cancel.
    #[inline]
    pub(super) fn attributes(
        &self,
        splat_radius: f32,
        substitute: impl FnOnce() -> [i16; 2],
    ) -> NodeAttributes {
        let normal = if self.normals_cancel() {
            substitute()
        } else {
            octahedral::encode(self.normal)
        };
        let mean = self.color / self.weight;
        let channel = |c: f32| (c + 0.5) as u8;
        NodeAttributes {
            normal,
            color: [
                channel(mean.x),
                channel(mean.y),
                channel(mean.z),
                if self.normal_weight > 0.0 { 255 } else { 0 },
            ],
            splat_radius,
            area: self.area,
        }
    }
}

/// The packed cone around others, or [`NormalCone::ALL`]. Contains all of them, packed axis and rounding included.
#[inline]
pub(super) fn pack_cone(caps: &[DirectionCap]) -> NormalCone {
    let axis = cone::common_axis(caps);
    // For points the length is the cosine of the half angle; for caps at least a bound of it. Nothing near zero is of use.
    if axis.length_squared() < 1e-8 {
        return NormalCone::ALL;
    }
    let code = octahedral::encode(axis.as_vec3());
    // Measured around the axis as it will be unpacked, so the packing's error is in it.
    let unpacked = octahedral::decode(code).as_dvec3();
    let Some(sin) = cone::sin_around(unpacked, caps) else {
        return NormalCone::ALL;
    };
    // A millionth for the rounding of whoever unpacks it; then up to the next unit.
    let sin_half_angle = ((sin + 1e-6) * 65535.0) as u32 + 1;
    if sin_half_angle >= u32::from(NormalCone::NEVER) {
        return NormalCone::ALL;
    }
    NormalCone {
        axis: code,
        sin_half_angle: sin_half_angle as u16,
    }
}

/// A packed cone for merging; `None` for one that never culls.
#[inline]
pub(super) fn unpack_cone(cone: &NormalCone) -> Option<DirectionCap> {
    if cone.sin_half_angle == NormalCone::NEVER {
        return None;
    }
    let axis: DVec3 = cone.axis().as_dvec3();
    Some(DirectionCap::from_sin(
        axis,
        f64::from(cone.sin_half_angle) / 65535.0,
    ))
}

/// Unit normal of a triangle by its corners and its area; zero where it has none: its height is below a trillionth of
/// its longest side.
#[inline]
pub fn geometric_normal(corners: [Vec3; 3]) -> (DVec3, f32) {
    // Differences and products of single-precision numbers are all but exact in double precision, so needles keep
    // their normal.
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let (e1, e2, e3) = (b - a, c - a, c - b);
    let cross = e1.cross(e2);
    let square = cross.length_squared();
    let longest = e1
        .length_squared()
        .max(e2.length_squared())
        .max(e3.length_squared());
    if square > 1e-24 * longest * longest && square > f64::MIN_POSITIVE {
        let length = square.sqrt();
        (cross / length, (0.5 * length) as f32)
    } else {
        (DVec3::ZERO, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn childrens_sums_moved_are_the_sums_of_all() {
        let corners: Vec<Vec3> = (0..60)
            .map(|i| {
                let t = i as f32;
                Vec3::new(
                    (t * 1.7).sin() * 4.0,
                    (t * 0.3).cos(),
                    (t * 2.9).sin() * 0.2 + 3.0,
                )
            })
            .collect();
        let around = |center: Vec3, corners: &[Vec3]| {
            let mut sums = SubtreeSums::default();
            corners
                .iter()
                .for_each(|&corner| sums.add_corner(corner - center));
            sums
        };
        let center = Vec3::new(0.3, -0.2, 2.0);
        let mut merged = SubtreeSums::default();
        for (part, own) in corners
            .chunks(17)
            .zip([Vec3::ZERO, Vec3::ONE, Vec3::X * 5.0, -Vec3::Z])
        {
            merged.add_child(&around(own, part), own - center);
        }
        let direct = around(center, &corners);
        assert_eq!(merged.corners, 60.0);
        assert!((merged.first - direct.first).abs().max_element() < 1e-3);
        for (a, b) in merged.second.iter().zip(direct.second) {
            assert!((a - b).abs() < 1e-4 * direct.second[0], "{a} {b}");
        }
    }

    #[test]
    fn principal_direction_is_that_of_the_spread() {
        for axis in [
            Vec3::X,
            Vec3::new(1.0, -2.0, 0.5).normalize(),
            Vec3::new(0.0, 1.0, 1.0).normalize(),
            -Vec3::Z,
        ] {
            let side = axis.any_orthonormal_vector();
            let mut sums = SubtreeSums::default();
            for i in -10..=10 {
                for j in -10..=10 {
                    sums.add_corner(Vec3::splat(7.0) + axis * (i as f32) + side * (j as f32 * 0.5));
                }
            }
            let found = sums.principal_direction().normalize();
            assert!(found.dot(axis).abs() > 0.9999, "{axis} {found}");
        }
        let mut same = SubtreeSums::default();
        (0..9).for_each(|_| same.add_corner(Vec3::ZERO));
        assert_eq!(same.principal_direction(), Vec3::Z);
        assert_eq!(SubtreeSums::default().principal_direction(), Vec3::Z);
    }

    #[test]
    fn normals_that_cancel_take_the_substitute() {
        let mut sums = SubtreeSums::default();
        sums.add_leaf(2.0, Vec3::Z * 3.0, 3.0, Vec3::splat(10.0));
        sums.add_leaf(2.0, Vec3::Z * -3.0, 3.0, Vec3::splat(20.0));
        assert!(sums.normals_cancel());
        let attributes = sums.attributes(1.0, || [7, 8]);
        assert_eq!(
            (attributes.normal, attributes.color, attributes.area),
            ([7, 8], [15, 15, 15, 255], 4.0)
        );
        // A little more on one side decides.
        sums.add_leaf(0.01, Vec3::Z * 3.0, 3.0, Vec3::ZERO);
        assert!(!sums.normals_cancel());
        assert_eq!(
            sums.attributes(1.0, || [7, 8]).normal,
            octahedral::encode(Vec3::Z)
        );
        // Without area every leaf counts the same.
        let mut flat = SubtreeSums::default();
        flat.add_leaf(0.0, Vec3::X * 3.0, 3.0, Vec3::splat(100.0));
        flat.add_leaf(0.0, Vec3::X * 3.0, 3.0, Vec3::splat(50.0));
        let attributes = flat.attributes(0.0, || [0, 0]);
        assert_eq!(
            (attributes.color, attributes.area),
            ([75, 75, 75, 255], 0.0)
        );
    }

    #[test]
    fn normals_all_around_are_none_and_those_to_and_fro_are_one() {
        let facing = |normals: &[Vec3]| {
            let mut sums = SubtreeSums::default();
            for &n in normals {
                sums.add_leaf(2.0, n * 3.0, 3.0, Vec3::splat(90.0));
            }
            sums
        };
        let is_all_around = |parts: &[(SubtreeSums, Vec3)]| {
            let mut whole = SubtreeSums::default();
            for (part, _) in parts {
                whole.add_child(part, Vec3::ZERO);
            }
            whole.is_all_around(parts.iter().copied())
        };
        let leaf = |n: Vec3| (facing(&[n]), n);
        let [x, y, z] = Vec3::AXES;
        let all = [x, -x, y, -y, z, -z];
        assert!(is_all_around(&all.map(leaf)));
        // The four sides of a tube are; a sheet and its back are not, however uneven.
        assert!(is_all_around(&[x, -x, y, -y].map(leaf)));
        assert!(!is_all_around(&[x, -x].map(leaf)));
        assert!(!is_all_around(&[x, -x, x, -x, x, -x, y, -y].map(leaf)));
        // Two halves of a box: their means say to and fro, but are half a normal long.
        let half = |n: Vec3| (facing(&[n, n, n, x, -x, z, -z]), n);
        assert!((half(y).0.normal.length() / half(y).0.normal_weight - 3.0 / 7.0).abs() < 1e-6);
        assert!(is_all_around(&[half(y), half(-y)]));
        // Parts that are a sheet and its back each.
        let plate = (facing(&[z, -z]), z);
        assert!(!is_all_around(&[(plate.0, z), (plate.0, -z)]));
        // With a direction, however spread.
        assert!(!is_all_around(&[x, y, -y, z, -z].map(leaf)));
        // Nothing known.
        assert!(!is_all_around(&[]));
        let mut attributes = facing(&[x]).attributes(1.0, || [0, 0]);
        attributes.forget_normal(OF_A_BALL);
        assert_eq!(attributes.color, [60, 60, 60, 0]);
    }

    #[test]
    fn needles_keep_their_normal_and_slivers_without_height_have_none() {
        let needle = [Vec3::ZERO, Vec3::X, Vec3::new(0.5, 1e-9, 0.0)];
        let (normal, area) = geometric_normal(needle);
        assert_eq!(normal, DVec3::Z);
        assert!((area - 5e-10).abs() < 1e-15);
        for flat in [
            [Vec3::ONE; 3],
            [Vec3::ZERO, Vec3::ZERO, Vec3::X],
            [Vec3::ZERO, Vec3::X, Vec3::X * 0.25],
            [Vec3::ZERO, Vec3::X, Vec3::new(0.5, 1e-13, 0.0)],
        ] {
            assert_eq!(geometric_normal(flat), (DVec3::ZERO, 0.0));
        }
    }
}
