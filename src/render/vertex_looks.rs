//! Vertices of a model as splats from them see those.

use crate::math::octahedral;
use crate::oriented::look::VertexLook;
use crate::textures::TexturePoint;
use crate::tree::Model;
use glam::DVec3;

/// Looks of the vertices of a model.
pub(crate) fn looks_of(model: &Model) -> Vec<VertexLook> {
    let in_images = model.textures.as_ref().map(|textures| &textures.points[..]);
    let has_image = |index: usize| {
        let point = in_images.and_then(|points| points.get(index));
        point.is_some_and(|point| *point != TexturePoint::NOWHERE)
    };
    (model.vertices.iter().enumerate())
        .map(|(index, vertex)| VertexLook {
            normal: match vertex.color[3] {
                0 => DVec3::ZERO,
                _ => octahedral::decode(vertex.normal).as_dvec3(),
            },
            color: vertex.color,
            has_image: has_image(index),
        })
        .collect()
}
