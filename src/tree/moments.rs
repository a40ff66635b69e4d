//! Sums for filtered splats.

use super::{Model, Moments, Node, summary};
use glam::DVec3;
use rayon::prelude::*;

/// The area that a point of a cloud stands for, by the distance to its sixth nearest neighbor: in a disc of that radius
/// on an evenly sampled surface there are six points beside it, or rather on its edge as much as inside.
pub fn area_of_point(spacing: f32) -> f32 {
    std::f32::consts::PI / super::spacing::NEIGHBORS as f32 * spacing * spacing
}

/// In double precision while adding up.
#[derive(Clone, Copy, Default)]
struct Exact([f64; 13]);

impl Exact {
    fn add(&mut self, other: &Self) {
        for (sum, value) in self.0.iter_mut().zip(other.0) {
            *sum += value;
        }
    }

    fn of_leaf(model: &Model, leaf: usize) -> Self {
        match model.triangles.get(leaf) {
            Some(triangle) => {
                let corners = triangle.map(|index| model.vertices[index as usize].position);
                let (normal, area) = summary::geometric_normal(corners);
                let centroid = corners.map(|p| p.as_dvec3()).into_iter().sum::<DVec3>() / 3.0;
                // As a picture of triangles interpolates it.
                let shading: DVec3 = triangle
                    .iter()
                    .map(|&index| &model.vertices[index as usize])
                    .filter(|vertex| vertex.color[3] != 0)
                    .map(|vertex| crate::math::octahedral::decode(vertex.normal).as_dvec3())
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
                let is_known = vertex.color[3] != 0;
                let normal = crate::math::octahedral::decode(vertex.normal).as_dvec3();
                let normal = if is_known { normal } else { DVec3::ZERO };
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

    fn from_moments(moments: &Moments) -> Self {
        let mut values = [0.0; 13];
        let words: &[f32; 13] = bytemuck::cast_ref(moments);
        for (value, &word) in values.iter_mut().zip(words) {
            *value = f64::from(word);
        }
        Self(values)
    }

    fn to_moments(self) -> Moments {
        bytemuck::cast(self.0.map(|value| value as f32))
    }
}

/// The sums of `node`, from its leaves or from its children's sums; `children` is the array from `first` on.
pub(super) fn of_node(model: &Model, node: &Node, children: &[Moments], first: usize) -> Moments {
    let mut sum = Exact::default();
    let range =
        node.first_child as usize..node.first_child as usize + usize::from(node.child_count);
    for child in range {
        if node.has_leaves() {
            sum.add(&Exact::of_leaf(model, child));
        } else {
            sum.add(&Exact::from_moments(&children[child - first]));
        }
    }
    sum.to_moments()
}

/// Sums of all nodes, level by level upward.
pub(super) fn compute(model: &Model) -> Vec<Moments> {
    let tree = &model.tree;
    let mut moments = vec![Moments::default(); tree.nodes.len()];
    for level in tree.level_starts.windows(2).rev() {
        let (start, end) = (level[0] as usize, level[1] as usize);
        let (own, below) = moments[start..].split_at_mut(end - start);
        own.par_iter_mut()
            .zip(&tree.nodes[start..end])
            .with_min_len(256)
            .for_each(|(moments, node)| *moments = of_node(model, node, below, end));
    }
    moments
}
