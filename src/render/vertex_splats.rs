//! Splats from vertices of what is drawn, made once and kept while models and rules stay.

use crate::abi::OrientedPolygon;
use crate::math::camera::View;
use crate::oriented::levels::{LevelCut, SplatLevels};
use crate::oriented::splats::{SplatRules, SplatSet, splats_of};
use crate::oriented::surface::WeldedSurface;
use crate::progress::SilentProgress;
use crate::render::model_facts::{DrawnParts, FactedModel};
use crate::render::vertex_looks::looks_of;

/// The splats of all parts, and the triangles that are drawn beside them.
#[derive(Debug, Default)]
pub(crate) struct VertexSplats {
    key: Option<(u64, SplatRules)>,
    parts: Vec<PartSplats>,
    /// Splats that the present view needs, where there are levels.
    chosen: Vec<LevelCut>,
}

/// Splats of a part.
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
fn of_model(part: FactedModel<'_>, rules: &SplatRules) -> PartSplats {
    let model = part.model;
    if let Some(choice) = &rules.samples {
        // The plan of a frame has made them, or refused them.
        let made = (part.facts).even_splats(model, choice, rules.crease(), &SilentProgress);
        return PartSplats {
            set: SplatSet {
                splats: made.map(|splats| splats.to_vec()).unwrap_or_default(),
                ..SplatSet::default()
            },
            levels: None,
        };
    }
    let positions: Vec<_> = model.vertices.iter().map(|v| v.position).collect();
    let surface = WeldedSurface::new(&positions, &model.triangles);
    let looks = looks_of(model);
    let set = splats_of(&surface, &looks, rules);
    let levels = (rules.levels).map(|_| SplatLevels::new(&surface, &looks, &set));
    PartSplats { set, levels }
}
