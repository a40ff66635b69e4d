//! Means for filtered splats.

use super::{AlignedRecords, Model, Node, SurfaceMoments, summary};
use crate::math::octahedral;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// The area that a point of a cloud stands for, by the distance to its sixth nearest neighbor: in a disc of that radius
/// on an evenly sampled surface there are six points beside it, or rather on its edge as much as inside.
pub fn area_of_point(spacing: f32) -> f32 {
    std::f32::consts::PI / super::spacing::NEIGHBORS as f32 * spacing * spacing
}

/// In double precision while adding up.
#[derive(Clone, Copy, Default)]
struct ExactMoments([f64; 13]);

impl ExactMoments {
    fn add(&mut self, other: &Self) {
        for (sum, value) in self.0.iter_mut().zip(other.0) {
            *sum += value;
        }
    }

    /// Of a leaf; `normals` are those of the model's vertices, zero where unknown.
    fn of_leaf(model: &Model, normals: &[Vec3], leaf: usize) -> Self {
        match model.triangles.get(leaf) {
            Some(triangle) => {
                let corners = triangle.map(|index| model.vertices[index as usize].position);
                let (normal, area) = summary::geometric_normal(corners);
                let centroid = corners.map(|p| p.as_dvec3()).into_iter().sum::<DVec3>() / 3.0;
                // As a picture of triangles interpolates it.
                let shading: DVec3 = triangle
                    .iter()
                    .map(|&index| normals[index as usize].as_dvec3())
                    .sum();
                Self::new(
                    f64::from(area),
                    centroid,
                    normal,
                    shading.normalize_or(normal),
                )
            }
            None => {
                let vertex = &model.vertices[leaf];
                let radius = f64::from(model.tree.leaves[leaf].radius);
                let area = f64::from(super::area_of_point(radius as f32));
                let normal = normals[leaf].as_dvec3();
                Self::new(area, vertex.position.as_dvec3(), normal, normal)
            }
        }
    }

    fn new(area: f64, centroid: DVec3, normal: DVec3, shading: DVec3) -> Self {
        let (c, v, s) = (centroid * area, normal * area, shading);
        Self([
            area,
            c.x,
            c.y,
            c.z,
            v.x,
            v.y,
            v.z,
            v.x * s.x,
            v.y * s.y,
            v.z * s.z,
            0.5 * (v.x * s.y + v.y * s.x),
            0.5 * (v.x * s.z + v.z * s.x),
            0.5 * (v.y * s.z + v.z * s.y),
        ])
    }

    fn pack(&self, node: &Node) -> SurfaceMoments {
        let [area, cx, cy, cz, rest @ ..] = self.0;
        if !(area > 0.0 && area.is_finite()) {
            return SurfaceMoments::default();
        }
        // Out of range by rounding at most; the cast saturates. `round` is a function call before SSE 4.1.
        let unit = |value: f64| {
            let scaled = value * f64::from(SurfaceMoments::UNIT);
            (scaled + 0.5f64.copysign(scaled)) as i16
        };
        let center = node.center.as_dvec3().to_array();
        let per_area = area.recip();
        let per_radius = if node.radius > 0.0 {
            f64::from(node.radius).recip()
        } else {
            0.0
        };
        let offset = |sum: f64, center: f64| unit((sum * per_area - center) * per_radius);
        let [vx, vy, vz, second @ ..] = rest.map(|sum| unit(sum * per_area));
        SurfaceMoments {
            centroid: [
                offset(cx, center[0]),
                offset(cy, center[1]),
                offset(cz, center[2]),
            ],
            vector_area: [vx, vy, vz],
            second_moment: second,
        }
    }
}

/// Computes the means of all nodes of a model whose other records are there: what filtered splats need.
pub fn fill_moments(model: &mut Model) {
    model.tree.moments = compute(model);
}

/// Means of all nodes, level by level upward; the sums are kept in full for one level at a time.
pub(super) fn compute(model: &Model) -> AlignedRecords<SurfaceMoments> {
    let tree = &model.tree;
    let mut moments = AlignedRecords::<SurfaceMoments>::zeroed(tree.nodes.len());
    // Six triangles share a vertex.
    let normals: Vec<Vec3> = model
        .vertices
        .par_iter()
        .with_min_len(4096)
        .map(|vertex| match vertex.color[3] {
            0 => Vec3::ZERO,
            _ => octahedral::decode(vertex.normal),
        })
        .collect();
    let mut below: Vec<ExactMoments> = Vec::new();
    for level in tree.level_starts.windows(2).rev() {
        let (start, end) = (level[0] as usize, level[1] as usize);
        let of_node = |(moments, node): (&mut SurfaceMoments, &Node)| {
            let mut sum = ExactMoments::default();
            let first = node.first_child as usize;
            for child in first..first + usize::from(node.child_count) {
                if node.has_leaves() {
                    sum.add(&ExactMoments::of_leaf(model, &normals, child));
                } else {
                    sum.add(&below[child - end]);
                }
            }
            *moments = sum.pack(node);
            sum
        };
        below = moments[start..end]
            .par_iter_mut()
            .zip(&tree.nodes[start..end])
            .with_min_len(256)
            .map(of_node)
            .collect();
    }
    moments
}
