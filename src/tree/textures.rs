//! The textures of a model: what its triangles show where they are large, and the mean of each where they are small.

use super::Model;
use super::sort_item::SortItem;
use crate::abi::Vertex;
use crate::mesh::Mesh;
use crate::textures::{MeshTextures, NO_IMAGE, TextureImage, TexturePoint};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// Images of a model and where its vertices are in them. The corners of a triangle are in the same image, or in none.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelTextures {
    /// The images.
    pub images: Vec<Arc<TextureImage>>,
    /// Where each vertex is; as many as the model's vertices.
    pub points: Vec<TexturePoint>,
    /// The mean of each triangle's texels: red, green, blue, and 255, or 0 where it has no image.
    pub leaf_colors: Vec<[u8; 4]>,
}

impl ModelTextures {
    /// The mean of a triangle's texels; `None` where it has no image.
    #[inline]
    pub fn leaf_color(&self, leaf: usize) -> Option<[u8; 3]> {
        match self.leaf_colors.get(leaf) {
            Some(&[red, green, blue, 255]) => Some([red, green, blue]),
            _ => None,
        }
    }

    /// The image of a triangle with these corners, and where these are in it; `None` where it has none.
    #[inline]
    pub fn of_triangle(&self, corners: [u32; 3]) -> Option<(&TextureImage, [glam::Vec2; 3])> {
        // No closures: what calls this is compiled for wide vectors, closures are not, and calls of them take longer than they do.
        let [a, b, c] = corners;
        let a = self.points.get(a as usize)?;
        let (b, c) = (self.points.get(b as usize)?, self.points.get(c as usize)?);
        let image = self.images.get(a.image as usize)?;
        Some((image, [a.at, b.at, c.at]))
    }

    /// The same of a mesh with these triangles, which are those of the model.
    pub(super) fn of_mesh(&self, triangles: &[[u32; 3]]) -> MeshTextures {
        let point = |corner: u32| self.points[corner as usize];
        MeshTextures {
            images: self.images.clone(),
            corners: (triangles.par_iter())
                .map(|corners| corners.map(|corner| point(corner).at))
                .collect(),
            image_of: (triangles.par_iter())
                .map(|corners| point(corners[0]).image)
                .collect(),
        }
    }

    /// Bytes that they take.
    pub fn bytes(&self) -> u64 {
        let images = self.images.iter().map(|image| image.bytes());
        let lists = size_of_val(&self.points[..]) + size_of_val(&self.leaf_colors[..]);
        images.sum::<u64>() + lists as u64
    }
}

impl Model {
    /// Images on its surface; none where it has no textures.
    pub(crate) fn images(&self) -> &[Arc<TextureImage>] {
        self.textures.as_ref().map_or(&[], |own| &own.images)
    }
}

/// Gives each vertex one place in an image: those whose triangles are in several places are split. Copies are appended.
/// Returns the places of all vertices.
pub(super) fn split(mesh: &mut Mesh, textures: &MeshTextures, limit: usize) -> Vec<TexturePoint> {
    let mut of_vertex: Vec<Option<TexturePoint>> = vec![None; mesh.positions.len()];
    let mut further: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
    for (index, triangle) in mesh.triangles.iter_mut().enumerate() {
        for (number, corner) in triangle.iter_mut().enumerate() {
            let point = textures.point(index, number);
            let first = *of_vertex[*corner as usize].get_or_insert(point);
            if first.bits() == point.bits() {
                continue;
            }
            let next = of_vertex.len();
            let key = (*corner, point.bits());
            if next >= limit && !further.contains_key(&key) {
                continue;
            }
            let vertex = *further.entry(key).or_insert(next as u32);
            if vertex as usize == next {
                of_vertex.push(Some(point));
                let old = *corner as usize;
                mesh.positions.push(mesh.positions[old]);
                if let Some(&normal) = mesh.normals.get(old) {
                    mesh.normals.push(normal);
                }
                if let Some(&color) = mesh.colors.get(old) {
                    mesh.colors.push(color);
                }
            }
            *corner = vertex;
        }
    }
    let or_nowhere = |point: Option<TexturePoint>| point.unwrap_or(TexturePoint::NOWHERE);
    of_vertex.into_iter().map(or_nowhere).collect()
}

/// The mean of the texels of each leaf, in the order of the leaves, which say which triangle of `textures` they are.
pub(super) fn leaf_means(textures: &MeshTextures, leaves: &[SortItem]) -> Vec<[u8; 4]> {
    let mean = |leaf: &SortItem| {
        let triangle = leaf.index as usize;
        let image = textures.point(triangle, 0).image;
        if image == NO_IMAGE {
            return [0; 4];
        }
        let mean = textures.images[image as usize].mean(textures.corners[triangle]);
        let [red, green, blue] = mean.to_array().map(|value| (value * 255.0).round() as u8);
        [red, green, blue, 255]
    };
    leaves.par_iter().with_min_len(256).map(mean).collect()
}

/// Gives vertices in images the mean color of their triangles, weighted by area: what is drawn without images has that.
pub(super) fn color_vertices(
    vertices: &mut [Vertex],
    triangles: &[[u32; 3]],
    (points, leaf_colors): (&[TexturePoint], &[[u8; 4]]),
) {
    let mut sums = vec![[0.0_f32; 4]; vertices.len()];
    for (triangle, &[red, green, blue, _]) in triangles.iter().zip(leaf_colors) {
        let [a, b, c] = triangle.map(|corner| vertices[corner as usize].position);
        // A triangle without area has a color, too.
        let area = (b - a).cross(c - a).length().max(f32::MIN_POSITIVE);
        for &corner in triangle {
            let sum = &mut sums[corner as usize];
            for (sum, value) in sum.iter_mut().zip([red, green, blue, 1]) {
                *sum += area * f32::from(value);
            }
        }
    }
    for ((vertex, sum), point) in vertices.iter_mut().zip(sums).zip(points) {
        let [red, green, blue, area] = sum;
        if point.image == NO_IMAGE || area <= 0.0 {
            continue;
        }
        let mean = Vec3::new(red, green, blue) / area;
        let [red, green, blue] = mean.to_array().map(|value| value.round() as u8);
        vertex.color = [red, green, blue, vertex.color[3]];
    }
}
