//! The cut of a frame: a list of parts, each the cut of one model.

use crate::abi::OrientedPolygon;
use crate::cut::{Cut, CutSelector, CutStats};
use crate::pack::splats;
use crate::render::cut_key::CutKey;
use crate::render::model_facts::{DrawnParts, FactedModel};
use crate::render::settings::PolygonSource;
use crate::render::vertex_splats::VertexSplats;
use bytemuck::Zeroable;

/// Cuts of the parts of a frame, in their order. Memory is kept from frame to frame.
#[derive(Debug, Default)]
pub struct PartCuts {
    cuts: Vec<Cut>,
    /// The first so many are those of the present frame.
    count: usize,
    polygons: Option<PolygonSource>,
    vertex_splats: VertexSplats,
}

impl PartCuts {
    /// Chooses the cut of each part by a key of its own, or takes that which was chosen beside the frame. What is hidden is
    /// left out within each part alone. Splats from vertices are made in the place of a cut, which holds the triangles beside
    /// them.
    pub(crate) fn select(
        &mut self,
        selector: &mut CutSelector,
        parts: DrawnParts<'_>,
        key_of: impl Fn(FactedModel<'_>) -> CutKey,
    ) {
        self.count = parts.count();
        if self.cuts.len() < self.count {
            self.cuts.resize_with(self.count, Cut::default);
        }
        self.polygons = parts
            .iter()
            .next()
            .and_then(|part| key_of(part).polygons());
        if let Some(PolygonSource::Vertices(rules)) = &self.polygons {
            self.vertex_splats.update(parts, rules);
            let beside = self.vertex_splats.triangle_ids();
            for (cut, ids) in self.cuts.iter_mut().zip(beside) {
                cut.clear();
                cut.triangles.extend_from_slice(ids);
            }
            return;
        }
        for (part, cut) in parts.iter().zip(&mut self.cuts) {
            if let Some(chosen) = part.cut {
                cut.clone_from(chosen);
                continue;
            }
            let undrawn = || part.facts.undrawn(part.model);
            key_of(part).select(selector, part.model, undrawn, cut);
        }
    }

    /// The cuts, in the order of the parts.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Cut> {
        self.cuts[..self.count].iter()
    }

    /// The same, to be changed.
    pub(crate) fn iter_mut(&mut self) -> impl ExactSizeIterator<Item = &mut Cut> {
        self.cuts[..self.count].iter_mut()
    }

    /// Sums of the counts of all cuts.
    pub fn stats(&self) -> CutStats {
        let mut sum = CutStats::default();
        self.iter().for_each(|cut| sum.add(&cut.stats));
        sum
    }

    /// Number of leaves that are drawn as triangles.
    pub fn triangle_count(&self) -> usize {
        self.iter().map(|cut| cut.triangles.len()).sum()
    }

    /// Number of oriented polygons.
    pub(crate) fn polygon_count(&self) -> usize {
        match &self.polygons {
            Some(PolygonSource::Vertices(_)) => self.vertex_splats.splats().len(),
            None => 0,
        }
    }

    /// Writes the oriented polygons of all parts, of which there are as many as `out` has room for.
    pub(crate) fn write_polygons(&self, out: &mut [OrientedPolygon]) {
        match &self.polygons {
            Some(PolygonSource::Vertices(_)) => {
                let splats = self.vertex_splats.splats();
                out[..splats.len()].copy_from_slice(splats);
            }
            None => {}
        }
    }

    /// The oriented polygons of all parts.
    pub(crate) fn polygons(&self) -> Vec<OrientedPolygon> {
        let mut polygons = vec![OrientedPolygon::zeroed(); self.polygon_count()];
        self.write_polygons(&mut polygons);
        polygons
    }

    /// Number of records that the splats need room for.
    pub fn splat_count(&self, plan: &splats::Plan) -> usize {
        self.iter().map(|cut| splats::count(cut, plan)).sum()
    }
}
