//! Places triangles into the shape so that nodes are flat and of one direction: what patches want ([`crate::tree::SplitRule`]).
//!
//! The halves of a run have prescribed sizes ([`super::shape`]), so only the key is free by which its triangles are divided. Of the
//! three axes of the model, the two longest principal axes of the run, and the main axis of the spread of its normals, that key is
//! taken whose halves have the least sum of
//!
//! A (lambda + 0.03 t + 0.1 (1 - |N| / A) t)
//!
//! with A the area, N the vector area, lambda the least eigenvalue and t the trace of the covariance of positions over the area.
//! Of large runs a sample decides. Ours; no paper. Equal keys keep the order of the file.

use super::partition::{PartitionRun, TreePartition};
use super::select::ordered;
use super::sort_item::SortItem;
use crate::mesh::Mesh;
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;
use std::sync::atomic::Ordering;

/// Weight of extent beside thickness.
const EXTENT: f64 = 0.03;
/// Weight of the spread of normals.
const SPREAD: f64 = 0.1;

/// Runs of more triangles than this are judged by a sample of so many.
const SAMPLE: usize = 512;
/// Runs of more than this many are divided among threads.
const PARALLEL: usize = 1 << 13;

/// Sums over triangles, places from a point nearby: area; first moments; second moments xx, yy, zz, xy, xz, yz; vector area.
type FlatSums = [f32; 13];

/// Places leaves by flatness.
pub(super) struct FlatPartition<'a> {
    /// The shape to fill, and who hears of it.
    pub(super) shape: TreePartition<'a>,
    /// The triangles, in file order.
    pub(super) mesh: &'a Mesh,
}

/// By what a run is divided.
#[derive(Clone, Copy)]
enum FlatKey {
    /// Places along a direction.
    Place(Vec3),
    /// Normals along a direction.
    Normal(Vec3),
}

/// Working memory of a task.
#[derive(Default)]
struct FlatScratch {
    /// Triangles of the sample.
    sample: Vec<u32>,
    sums: Vec<FlatSums>,
    keys: Vec<u64>,
}

impl FlatPartition<'_> {
    /// Orders `items` (in file order at first). `spare` has the same length; its content is lost.
    pub(super) fn run(&self, items: &mut [SortItem], spare: &mut [SortItem]) {
        assert_eq!(items.len(), spare.len(), "both buffers hold every leaf");
        let mut places: Vec<u64> = (0..items.len() as u64).collect();
        self.divide(PartitionRun::ROOT, &mut places, &mut FlatScratch::default());
        let order = spare.par_iter_mut().zip(&places).with_min_len(4096);
        order.for_each(|(to, &place)| *to = items[place as u32 as usize]);
        items.copy_from_slice(spare);
    }

    /// Orders the triangles of a run, the lower halves of `places`.
    fn divide(&self, run: PartitionRun, places: &mut [u64], scratch: &mut FlatScratch) {
        let n = places.len();
        if n <= 2 || (n > PARALLEL && self.shape.stop.load(Ordering::Relaxed)) {
            return;
        }
        let Some(run) = self.shape.descend(run) else {
            return;
        };
        let (one, two, k) = self.shape.halves(run);
        let key = self.best_key(places, k, scratch);
        for place in places.iter_mut() {
            *place = self.keyed(key, *place as u32);
        }
        places.select_nth_unstable(k);
        let (first, second) = places.split_at_mut(k);
        if n <= PARALLEL {
            self.divide(one, first, scratch);
            self.divide(two, second, scratch);
            return;
        }
        let task = |run: PartitionRun, places: &mut [u64]| {
            self.divide(run, places, &mut FlatScratch::default());
            if places.len() <= PARALLEL {
                (self.shape.placed)(places.len() as u64);
            }
        };
        rayon::join(|| task(one, first), || task(two, second));
    }

    fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.mesh.triangles[triangle as usize].map(|c| self.mesh.positions[c as usize])
    }

    /// The key of a triangle, with the triangle below it.
    fn keyed(&self, key: FlatKey, triangle: u32) -> u64 {
        let [a, b, c] = self.corners(triangle);
        let value = match key {
            FlatKey::Place(direction) => (a + b + c).dot(direction),
            FlatKey::Normal(direction) => (b - a).cross(c - a).normalize_or_zero().dot(direction),
        };
        u64::from(ordered(value)) << 32 | u64::from(triangle)
    }

    fn best_key(&self, places: &[u64], k: usize, scratch: &mut FlatScratch) -> FlatKey {
        let n = places.len();
        let FlatScratch { sample, sums, keys } = scratch;
        let count = n.min(SAMPLE);
        sample.clear();
        sample.extend((0..count).map(|i| places[i * n / count] as u32));
        let origin = self.corners(sample[0])[0];
        sums.clear();
        sums.extend(
            sample
                .iter()
                .map(|&triangle| sums_of(self.corners(triangle), origin)),
        );
        let mut all = FlatSums::default();
        let mut normals = [0.0f64; 6];
        for sums in sums.iter() {
            add(&mut all, sums);
            let area = f64::from(sums[0]);
            if area > 0.0 {
                let [x, y, z] = [10, 11, 12].map(|i| f64::from(sums[i]));
                for (sum, product) in
                    normals
                        .iter_mut()
                        .zip([x * x, y * y, z * z, x * y, x * z, y * z])
                {
                    *sum += product / area;
                }
            }
        }
        let places = principal_axes(covariance(&all));
        let area = f64::from(all[0]);
        let [x, y, z] = [10, 11, 12].map(|i| f64::from(all[i]));
        let of_vector = [x * x, y * y, z * z, x * y, x * z, y * z];
        for (sum, product) in normals.iter_mut().zip(of_vector) {
            *sum = (*sum - product / area.max(f64::MIN_POSITIVE)) / area.max(f64::MIN_POSITIVE);
        }
        let spread = principal_axes(symmetric(normals));
        let keys_to_try = [
            FlatKey::Place(Vec3::X),
            FlatKey::Place(Vec3::Y),
            FlatKey::Place(Vec3::Z),
            FlatKey::Place(places[0]),
            FlatKey::Place(places[1]),
            FlatKey::Normal(spread[0]),
        ];
        // Of a sample as large a share.
        let first = (k * count / n).clamp(1, count - 1);
        let mut best = (f64::INFINITY, keys_to_try[0]);
        for key in keys_to_try {
            keys.clear();
            let values = sample.iter().zip(0u64..);
            keys.extend(values.map(|(&triangle, i)| self.keyed(key, triangle) >> 32 << 32 | i));
            keys.select_nth_unstable(first);
            let mut one = FlatSums::default();
            for &key in &keys[..first] {
                add(&mut one, &sums[key as u32 as usize]);
            }
            let mut two = all;
            two.iter_mut().zip(one).for_each(|(two, one)| *two -= one);
            let found = cost(&one) + cost(&two);
            if found < best.0 {
                best = (found, key);
            }
        }
        best.1
    }
}

fn add(sums: &mut FlatSums, more: &FlatSums) {
    sums.iter_mut()
        .zip(more)
        .for_each(|(sum, more)| *sum += more);
}

/// Sums of a triangle: the integral of x xᵀ is A / 12 (sum of v vᵀ + s sᵀ), with s the sum of its corners v.
fn sums_of(corners: [Vec3; 3], origin: Vec3) -> FlatSums {
    let [a, b, c] = corners.map(|corner| corner - origin);
    let vector = 0.5 * (b - a).cross(c - a);
    let area = vector.length();
    let sum = a + b + c;
    let first = sum * (area / 3.0);
    let mut sums = [
        area, first.x, first.y, first.z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ];
    for v in [a, b, c, sum] {
        let products = [
            v.x * v.x,
            v.y * v.y,
            v.z * v.z,
            v.x * v.y,
            v.x * v.z,
            v.y * v.z,
        ];
        for (sum, product) in sums[4..10].iter_mut().zip(products) {
            *sum += product * (area / 12.0);
        }
    }
    sums[10..].copy_from_slice(&vector.to_array());
    sums
}

fn symmetric([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> DMat3 {
    DMat3::from_cols(
        DVec3::new(xx, xy, xz),
        DVec3::new(xy, yy, yz),
        DVec3::new(xz, yz, zz),
    )
}

/// Covariance of positions over the area; zeros without area.
fn covariance(sums: &FlatSums) -> DMat3 {
    let area = f64::from(sums[0]);
    if area <= 0.0 {
        return DMat3::ZERO;
    }
    let [x, y, z] = [1, 2, 3].map(|i| f64::from(sums[i]) / area);
    let second = [4, 5, 6, 7, 8, 9].map(|i| f64::from(sums[i]) / area);
    let products = [x * x, y * y, z * z, x * y, x * z, y * z];
    let mut centered = second;
    centered.iter_mut().zip(products).for_each(|(c, p)| *c -= p);
    symmetric(centered)
}

fn cost(sums: &FlatSums) -> f64 {
    let area = f64::from(sums[0]);
    if area <= 0.0 {
        return 0.0;
    }
    let matrix = covariance(sums);
    let trace = (matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z).max(0.0);
    let vector = Vec3::new(sums[10], sums[11], sums[12]).as_dvec3().length();
    let least = least_eigenvalue(&matrix, trace).max(0.0);
    area * (least + trace * (EXTENT + SPREAD * (1.0 - vector / area).max(0.0)))
}

/// Least eigenvalue of a symmetric matrix (Smith, *Eigenvalues of a Symmetric 3 x 3 Matrix*, 1961).
fn least_eigenvalue(m: &DMat3, trace: f64) -> f64 {
    let mean = trace / 3.0;
    let shifted = *m - DMat3::from_diagonal(DVec3::splat(mean));
    let squares: f64 = shifted.to_cols_array().iter().map(|v| v * v).sum();
    let p = (squares / 6.0).sqrt();
    if p <= trace * 1e-12 {
        return mean;
    }
    let half = (shifted * (1.0 / p)).determinant() * 0.5;
    let angle = half.clamp(-1.0, 1.0).acos() / 3.0;
    mean + 2.0 * p * (angle + std::f64::consts::TAU / 3.0).cos()
}

/// Unit eigenvectors of a symmetric matrix by rotations of Jacobi, that of the largest eigenvalue first.
fn principal_axes(mut m: DMat3) -> [Vec3; 3] {
    let mut axes = DMat3::IDENTITY;
    for _ in 0..6 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = m.col(p)[q];
            if off == 0.0 || !off.is_finite() {
                continue;
            }
            let theta = (m.col(q)[q] - m.col(p)[p]) / (2.0 * off);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            let mut rotation = DMat3::IDENTITY;
            rotation.col_mut(p)[p] = c;
            rotation.col_mut(q)[q] = c;
            rotation.col_mut(q)[p] = s;
            rotation.col_mut(p)[q] = -s;
            m = rotation.transpose() * m * rotation;
            axes *= rotation;
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| m.col(b)[b].total_cmp(&m.col(a)[a]));
    order.map(|i| axes.col(i).as_vec3())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvalues_and_axes_are_those_of_the_matrix() {
        let turn = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(-1.1);
        for values in [
            [5.0, 2.0, 1.0],
            [3.0, 3.0, 0.5],
            [1.0, 1.0, 1.0],
            [2.0, 0.0, 0.0],
        ] {
            let values = DVec3::from_array(values);
            let m = turn * DMat3::from_diagonal(values) * turn.transpose();
            let least = least_eigenvalue(&m, values.element_sum());
            assert!((least - values.z).abs() < 1e-6, "{values}: {least}");
            let axes = principal_axes(m).map(Vec3::as_dvec3);
            for (axis, value) in axes.into_iter().zip(values.to_array()) {
                assert!((m * axis - axis * value).length() < 1e-6, "{values}");
            }
        }
    }

    #[test]
    fn sums_of_a_triangle_are_its_integrals() {
        let corners = [Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 3.0];
        let sums = sums_of(corners, Vec3::ZERO);
        // x² over the triangle is 2³ 3 / 12, xy is 2² 3² / 24.
        for (i, expected) in [
            (0, 3.0),
            (1, 2.0),
            (2, 3.0),
            (4, 2.0),
            (5, 4.5),
            (7, 1.5),
            (12, 3.0),
        ] {
            assert!((sums[i] - expected).abs() < 1e-5, "{i}: {sums:?}");
        }
    }
}
