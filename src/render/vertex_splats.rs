//! Splats from vertices of what is drawn, made once and kept while models and rules stay.

use crate::abi::OrientedPolygon;
use crate::math::octahedral;
use crate::oriented::look::VertexLook;
use crate::oriented::splats::{SplatRules, splats_of};
use crate::oriented::surface::WeldedSurface;
use crate::render::model_facts::DrawnParts;
use crate::tree::Model;
use glam::DVec3;

/// The splats of all parts, and the triangles that are drawn beside them.
#[derive(Debug, Default)]
pub(crate) struct VertexSplats {
    key: Option<(u64, SplatRules)>,
    splats: Vec<OrientedPolygon>,
    triangle_ids: Vec<Vec<u32>>,
}

impl VertexSplats {
    /// Makes the splats of these parts unless they are there.
    pub(crate) fn update(&mut self, parts: DrawnParts<'_>, rules: &SplatRules) {
        let key = Some((parts.id(), *rules));
        if self.key == key {
            return;
        }
        self.splats.clear();
        self.triangle_ids.clear();
        for part in parts.iter() {
            let (mut splats, triangles) = of_model(part.model, rules);
            self.splats.append(&mut splats);
            self.triangle_ids.push(triangles);
        }
        self.key = key;
    }

    /// Splats of all parts.
    pub(crate) fn splats(&self) -> &[OrientedPolygon] {
        &self.splats
    }

    /// Of each part, the triangles that are drawn beside them.
    pub(crate) fn triangle_ids(&self) -> &[Vec<u32>] {
        &self.triangle_ids
    }
}

/// Splats of a model and the triangles beside them.
fn of_model(model: &Model, rules: &SplatRules) -> (Vec<OrientedPolygon>, Vec<u32>) {
    let positions: Vec<_> = model.vertices.iter().map(|v| v.position).collect();
    let surface = WeldedSurface::new(&positions, &model.triangles);
    let looks: Vec<VertexLook> = (model.vertices.iter())
        .map(|vertex| VertexLook {
            normal: match vertex.color[3] {
                0 => DVec3::ZERO,
                _ => octahedral::decode(vertex.normal).as_dvec3(),
            },
            color: vertex.color,
        })
        .collect();
    let set = splats_of(&surface, &looks, rules);
    (set.splats, set.triangles)
}
