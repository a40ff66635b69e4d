//! Another zero for a model: models that are drawn together share one.

use super::{BuildOptions, Error, Model, build_ordered, framed};
use crate::math::octahedral;
use crate::mesh::Mesh;
use crate::mesh::attributes::PointAttributes;
use crate::mesh::scanners::ScannerPlaces;
use crate::progress::Progress;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

impl Model {
    /// The same model with `origin` as the world position of the model-space zero. Nothing moves in the world but for
    /// rounding: by half a unit in the last place of a model-space coordinate, so by up to 0.03 of a unit at a distance of a
    /// million from the origin. The tree is built anew, since small triangles turn by that; what the points of a cloud carry
    /// takes their new order.
    ///
    /// # Errors
    /// As [`build_ordered()`].
    pub fn moved_to(
        self,
        origin: DVec3,
        attributes: &mut PointAttributes,
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let offset = self.origin - origin;
        if offset == DVec3::ZERO {
            return Ok(self);
        }
        let (vertices, old_part) = (&self.vertices, self.framed);
        let has_normals = vertices.iter().any(|vertex| vertex.color[3] != 0);
        let mesh = Mesh {
            positions: (vertices.par_iter())
                .map(|vertex| (vertex.position.as_dvec3() + offset).as_vec3())
                .collect(),
            normals: match has_normals {
                true => (vertices.par_iter())
                    .map(|vertex| match vertex.color[3] {
                        0 => Vec3::ZERO,
                        _ => octahedral::decode(vertex.normal),
                    })
                    .collect(),
                false => Vec::new(),
            },
            colors: match self.has_colors {
                true => (vertices.par_iter())
                    .map(
                        |&crate::abi::Vertex {
                             color: [r, g, b, _],
                             ..
                         }| [r, g, b, 255],
                    )
                    .collect(),
                false => Vec::new(),
            },
            textures: (self.textures.as_ref()).map(|textures| textures.of_mesh(&self.triangles)),
            triangles: self.triangles,
            origin,
            scanners: ScannerPlaces::default(),
        };
        let options = BuildOptions {
            keeps_origin: true,
            ..BuildOptions::default()
        };
        let (mut model, order) = build_ordered(mesh, &options, progress)?;
        if model.kind().is_points() {
            attributes.reorder(&order);
            if attributes.are_colors_categories {
                model.color_by_majority();
            }
        }
        // Nothing was framed where all was asked for.
        model.framed = old_part.and_then(|part| framed::within(&model, part.reach));
        Ok(model)
    }
}
