//! The cut of a frame: a list of parts, each the cut of one model.

use crate::abi::{OrientedPolygon, PatchTexture};
use crate::cut::{Cut, CutSelector, CutStats};
use crate::pack::{falsecolor, splats};
use crate::patches::{PatchCounts, PatchCut, PatchList, PatchRules, PatchSelector};
use crate::render::cut_key::CutKey;
use crate::render::model_facts::{DrawnParts, FactedModel};
use crate::render::settings::PolygonSource;
use crate::render::stats::FrameCounts;
use crate::render::vertex_splats::VertexSplats;
use crate::textures::TextureImage;
use bytemuck::Zeroable;
use rayon::prelude::*;
use std::sync::Arc;

/// Cuts of the parts of a frame, in their order. Memory is kept from frame to frame.
#[derive(Debug, Default)]
pub struct PartCuts {
    cuts: Vec<Cut>,
    /// The first so many are those of the present frame.
    count: usize,
    polygons: Option<PolygonSource>,
    vertex_splats: VertexSplats,
    patch_selector: PatchSelector,
    /// Patches of each part; the rest of its cut is where that is.
    patches: Vec<PatchCut>,
}

/// Places of patches in images, one each, and the images.
#[derive(Debug, Default)]
pub(crate) struct PatchPlaces {
    pub(crate) places: Vec<PatchTexture>,
    pub(crate) images: Vec<Arc<TextureImage>>,
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
        self.polygons = parts.iter().next().and_then(|part| key_of(part).polygons());
        if let Some(PolygonSource::Vertices(rules)) = &self.polygons {
            if let Some(part) = parts.iter().next() {
                let key = key_of(part);
                let seen = (key.view(), key.threshold_px());
                self.vertex_splats.update(parts, rules, seen);
            }
            for (cut, (_, ids)) in self.cuts.iter_mut().zip(self.vertex_splats.parts()) {
                cut.clear();
                cut.triangles.extend_from_slice(ids);
            }
            return;
        }
        if let Some(PolygonSource::Patches(rules)) = self.polygons {
            self.select_by_error(parts, &rules, key_of);
            return;
        }
        for (part, cut) in parts.iter().zip(&mut self.cuts) {
            if let Some(chosen) = part.cut {
                cut.clone_from(&chosen.rest);
                continue;
            }
            let undrawn = || part.facts.undrawn(part.model);
            key_of(part).select(selector, part.model, undrawn, cut);
        }
    }

    /// Chooses cuts by error, or takes those that were chosen beside the frame.
    fn select_by_error(
        &mut self,
        parts: DrawnParts<'_>,
        rules: &PatchRules,
        key_of: impl Fn(FactedModel<'_>) -> CutKey,
    ) {
        self.patches.resize_with(self.count, PatchCut::default);
        let own = self.cuts.iter_mut().zip(&mut self.patches);
        for (part, (cut, patches)) in parts.iter().zip(own) {
            if let Some(chosen) = part.cut {
                patches.clone_from(chosen);
            } else {
                let key = key_of(part);
                let patches_of = part.facts.patches(part.model);
                let conditions = patches_of.conditions(part.model, rules.is_strict);
                let settings = key.by_error(rules);
                let selector = &mut self.patch_selector;
                selector.select(part.model, conditions, key.view(), &settings, patches);
            }
            // Below the threshold a polygon is drawn as any other.
            patches.patches.append(&mut patches.tiny);
            std::mem::swap(cut, &mut patches.rest);
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

    /// Counts of the cuts, without those of what is drawn of them.
    pub(crate) fn frame_counts(&self) -> FrameCounts {
        let stats = self.stats();
        let mut patches = PatchCounts::default();
        if self.has_patches() {
            self.patches.iter().for_each(|cut| patches.add(cut));
        }
        FrameCounts {
            nodes_visited: stats.visited,
            hidden: stats.hidden,
            between: stats.between,
            patches,
            ..FrameCounts::default()
        }
    }

    /// Number of leaves that are drawn as triangles.
    pub fn triangle_count(&self) -> usize {
        self.iter().map(|cut| cut.triangles.len()).sum()
    }

    /// Number of oriented polygons.
    pub(crate) fn polygon_count(&self) -> usize {
        match &self.polygons {
            Some(PolygonSource::Vertices(_)) => self.vertex_splats.count(),
            Some(PolygonSource::Patches(_)) => {
                self.patches.iter().map(|cut| cut.patches.len()).sum()
            }
            None => 0,
        }
    }

    /// Tells whether these are patches.
    pub(crate) fn has_patches(&self) -> bool {
        matches!(self.polygons, Some(PolygonSource::Patches(_)))
    }

    /// The patches of all parts, where their records are kept; none where there are no patches.
    pub(crate) fn patch_lists<'a>(&'a self, parts: DrawnParts<'a>) -> Vec<PatchList<'a>> {
        let own = parts.iter().zip(&self.patches);
        own.filter(|_| self.has_patches())
            .map(|(part, cut)| PatchList {
                polygons: part.facts.patches(part.model).polygons(part.model),
                ids: &cut.patches,
            })
            .collect()
    }

    /// Writes the oriented polygons of all parts, of which there are as many as `out` has room for; in the colors of their
    /// levels where `is_by_level`.
    pub(crate) fn write_polygons(
        &self,
        parts: DrawnParts<'_>,
        is_by_level: bool,
        mut out: &mut [OrientedPolygon],
    ) {
        match &self.polygons {
            Some(PolygonSource::Vertices(_)) => {
                for (splats, _) in self.vertex_splats.parts() {
                    let (own, rest) = out.split_at_mut(splats.len());
                    own.copy_from_slice(splats);
                    out = rest;
                }
            }
            Some(PolygonSource::Patches(_)) => {
                for (part, cut) in parts.iter().zip(&self.patches) {
                    let (own, rest) = out.split_at_mut(cut.patches.len());
                    out = rest;
                    let tree = &part.model.tree;
                    let records = part.facts.patches(part.model).records();
                    let ids = cut.patches.par_iter().zip(own).with_min_len(2048);
                    ids.for_each(|(&id, out)| {
                        *out = records.polygon(id as usize, &tree.nodes[id as usize]);
                        if is_by_level {
                            out.color = falsecolor::of_record(tree, Some(id), out.color);
                            out.color_slopes = [[0; 4]; 2];
                        }
                    });
                }
            }
            None => {}
        }
    }

    /// Places in images of the patches of all parts, in their order, each in those of its own model; those of a model without
    /// images are in none.
    pub(crate) fn patch_textures(&self, parts: DrawnParts<'_>) -> Vec<PatchTexture> {
        self.textures_of_parts(parts).flatten().collect()
    }

    /// Places in images of the patches of all parts, in their order, and the images that these are in: those of one model after
    /// the other.
    pub(crate) fn joined_patch_textures(&self, parts: DrawnParts<'_>) -> PatchPlaces {
        let mut joined = PatchPlaces::default();
        for (part, own) in parts.iter().zip(self.textures_of_parts(parts)) {
            let first = joined.images.len() as u32;
            // Where there is no image the number stays the largest.
            joined.places.extend(own.map(|place| PatchTexture {
                image: place.image.saturating_add(first),
                ..place
            }));
            joined.images.extend_from_slice(part.model.images());
        }
        joined
    }

    fn textures_of_parts<'a>(
        &'a self,
        parts: DrawnParts<'a>,
    ) -> impl Iterator<Item = impl Iterator<Item = PatchTexture>> {
        let own = parts.iter().zip(&self.patches);
        own.filter(|_| self.has_patches()).map(|(part, cut)| {
            let of_nodes = match part.model.textures {
                Some(_) => part.facts.patches(part.model).textures(),
                None => &[],
            };
            let of = |&id: &u32| of_nodes.get(id as usize).copied();
            (cut.patches.iter()).map(move |id| of(id).unwrap_or_else(PatchTexture::none))
        })
    }

    /// Number of patches of each part; nothing where there are no patches.
    pub(crate) fn patch_counts_of_parts(&self) -> impl Iterator<Item = usize> {
        let own = self.patches.iter().filter(|_| self.has_patches());
        own.map(|cut| cut.patches.len())
    }

    /// Ids of the patches of a frame of one part; none where it draws no patches.
    pub(crate) fn patch_ids(&self) -> &[u32] {
        match self.patches.first() {
            Some(cut) if self.has_patches() => &cut.patches,
            _ => &[],
        }
    }

    /// Puts the oriented polygons of all parts into a list, in the place of what was there.
    pub(crate) fn put_polygons(
        &self,
        parts: DrawnParts<'_>,
        is_by_level: bool,
        list: &mut Vec<OrientedPolygon>,
    ) {
        list.resize(self.polygon_count(), OrientedPolygon::zeroed());
        self.write_polygons(parts, is_by_level, list);
    }

    /// The oriented polygons of all parts.
    pub(crate) fn polygons(
        &self,
        parts: DrawnParts<'_>,
        is_by_level: bool,
    ) -> Vec<OrientedPolygon> {
        let mut polygons = Vec::new();
        self.put_polygons(parts, is_by_level, &mut polygons);
        polygons
    }

    /// Number of records that the splats need room for.
    pub fn splat_count(&self, plan: &splats::SplatPlan) -> usize {
        self.iter().map(|cut| splats::count(cut, plan)).sum()
    }
}
