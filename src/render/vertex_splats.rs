//! Splats from vertices of what is drawn, made once and kept while models and rules stay.

use crate::abi::OrientedPolygon;
use crate::math::camera::View;
use crate::math::octahedral;
use crate::oriented::levels::{LevelCut, SplatLevels};
use crate::oriented::look::VertexLook;
use crate::oriented::resample::samples_of;
use crate::oriented::splats::{SplatRules, SplatSet, splats_of};
use crate::oriented::surface::WeldedSurface;
use crate::render::model_facts::{DrawnParts, FactedModel};
use crate::textures::TexturePoint;
use crate::tree::Model;
use glam::DVec3;

/// The splats of all parts, and the triangles that are drawn beside them.
#[derive(Debug, Default)]
pub(crate) struct VertexSplats {
    key: Option<(u64, SplatRules)>,
    parts: Vec<PartSplats>,
    /// What the present view needs, where there are levels.
    chosen: Vec<LevelCut>,
}

/// Those of a part.
#[derive(Debug)]
struct PartSplats {
    set: SplatSet,
    levels: Option<SplatLevels>,
}

impl VertexSplats {
    /// Makes the splats of these parts unless they are there, and chooses those of a view where they have levels.
    pub(crate) fn update(
        &mut self,
        parts: DrawnParts<'_>,
        rules: &SplatRules,
        (view, threshold_px): (&View, f32),
    ) {
        let key = Some((parts.id(), *rules));
        if self.key != key {
            self.parts = parts.iter().map(|part| of_model(part, rules)).collect();
            self.key = key;
        }
        self.chosen.resize_with(self.parts.len(), LevelCut::default);
        for (part, cut) in self.parts.iter().zip(&mut self.chosen) {
            if let Some(levels) = &part.levels {
                levels.select(&part.set, view, threshold_px, cut);
            }
        }
    }

    /// Of each part, its splats and the triangles that are drawn beside them.
    pub(crate) fn parts(&self) -> impl Iterator<Item = (&[OrientedPolygon], &[u32])> {
        let both = self.parts.iter().zip(&self.chosen);
        both.map(|(part, cut)| match part.levels {
            Some(_) => (&cut.polygons[..], &cut.triangles[..]),
            None => (&part.set.splats[..], &part.set.triangles[..]),
        })
    }

    /// Number of splats of all parts.
    pub(crate) fn count(&self) -> usize {
        self.parts().map(|(splats, _)| splats.len()).sum()
    }
}

/// Splats of a model and the triangles beside them.
///
/// # Panics
/// Where even samples are too many: the plan of a frame has refused those.
fn of_model(part: FactedModel<'_>, rules: &SplatRules) -> PartSplats {
    let model = part.model;
    let positions: Vec<_> = model.vertices.iter().map(|v| v.position).collect();
    let surface = WeldedSurface::new(&positions, &model.triangles);
    let looks = looks_of(model);
    if let Some(choice) = &rules.samples {
        let samples = (part
            .facts
            .sample_bounds(model)
            .rules(choice, rules.crease()))
        .and_then(|rules| samples_of(&surface, &looks, &rules));
        let Ok(samples) = samples else {
            unreachable!("the plan refuses samples that are too many")
        };
        return PartSplats {
            set: SplatSet {
                splats: samples,
                ..SplatSet::default()
            },
            levels: None,
        };
    }
    let set = splats_of(&surface, &looks, rules);
    let levels = (rules.levels).map(|_| SplatLevels::new(&surface, &looks, &set));
    PartSplats { set, levels }
}

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
