//! What a planned frame needs is made before it begins: pipelines, targets of its passes, and the tree on the device.

use crate::gpu::Error;
use crate::pack::ColorBy;
use crate::render::frame_plan::{CutPlace, FramePlan};
use crate::render::model_facts::{DrawnParts, FactedModel, ModelFacts};
use crate::render::technique::Technique;
use crate::render::vulkan::blended::filtered;
use crate::render::vulkan::blended::filtered::FilteredPasses;
use crate::render::vulkan::blended::fuzzy;
use crate::render::vulkan::blended::fuzzy::FuzzyPasses;
use crate::render::vulkan::device_cut::DeviceCut;
use crate::render::vulkan::device_tree::{DeviceTree, SceneTree};
use crate::render::vulkan::expand_ids::{ExpandedKind, IdExpansion};
use crate::render::vulkan::opaque::compute::ComputeRasterizer;
use crate::render::vulkan::opaque::compute_variant::ComputeVariant;
use crate::render::vulkan::opaque::hardware::{OpaqueSplats, SplatSource};
use crate::render::vulkan::opaque::polygon_variant::{PolygonKind, PolygonVariant};
use crate::render::vulkan::opaque::polygons::PolygonPasses;
use crate::render::vulkan::overdraw;
use crate::render::vulkan::renderer::VulkanRenderer;
use crate::render::vulkan::scene::DeviceScene;
use crate::render::vulkan::triangles;
use crate::render::vulkan::triangles::TriangleVariant;
use crate::render::vulkan::visibility::compute::VisibleKind;
use crate::render::vulkan::visibility::hardware::VisibilityPasses;
use crate::render::{CutOn, ListOf, Method};
use crate::tree::Model;

impl VulkanRenderer {
    /// Makes the pipelines and buffers that a frame needs.
    ///
    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(super) fn prepare(
        &mut self,
        plan: &FramePlan,
        parts: DrawnParts<'_>,
        scene: &mut DeviceScene,
    ) -> Result<(), Error> {
        let settings = &plan.settings;
        let method = settings.method;
        if method == Method::Triangles {
            scene.ensure_indices(parts)?;
        }
        if plan.needs_undrawn() {
            parts.iter().for_each(|part| {
                part.facts.undrawn(part.model);
            });
        }
        if settings.drawn_patches().is_some() {
            parts.iter().for_each(|part| {
                part.facts.patches(part.model);
            });
        }
        if method != Method::Points {
            self.prepare_triangles(plan, parts, scene)?;
        }
        match plan.technique {
            Technique::Nothing => {}
            Technique::Polygons => {
                self.prepare_opaque(plan)?;
                self.prepare_polygons(plan)?;
            }
            Technique::Opaque => self.prepare_opaque(plan)?,
            Technique::Visibility => self.prepare_visibility(plan)?,
            Technique::Fuzzy => self.prepare_fuzzy(plan)?,
            Technique::Filtered => self.prepare_filtered(plan, scene)?,
        }
        let photos = self.photos.as_ref();
        (self.looks).prepare(&self.gpu, &self.targets, (plan, photos))?;
        if plan.settings.color_by == ColorBy::Overdraw {
            let counter = match &mut self.overdraw {
                Some(made) => made,
                none => {
                    let size = (self.targets.color.width, self.targets.color.height);
                    let slots = self.frames.in_flight();
                    none.insert(overdraw::OverdrawCounter::new(&self.gpu, size, slots)?)
                }
            };
            let fuzzy = self.fuzzy.as_ref().map(|fuzzy| fuzzy.variant);
            let of_frame = (plan.constants.flags, fuzzy);
            counter.ensure(&plan.settings, &self.targets, of_frame)?;
        }
        Ok(())
    }

    fn prepare_triangles(
        &mut self,
        plan: &FramePlan,
        parts: DrawnParts<'_>,
        scene: &DeviceScene,
    ) -> Result<(), Error> {
        let variant = TriangleVariant {
            color: self.targets.color.format,
            normals: self.targets.normal.is_some(),
            colors: parts.has_colors(),
            lamp: !plan.settings.has_headlight(),
            textures: scene.is_textured(),
            flags: plan.constants.flags,
        };
        let spare = &mut self.spare_triangles;
        exchange(&mut self.triangles, spare, |t| t.0 == variant);
        if self.triangles.as_ref().is_none_or(|t| t.0 != variant) {
            self.triangles = Some((variant, triangles::pipeline(&self.gpu, variant)?));
        }
        Ok(())
    }

    fn prepare_opaque(&mut self, plan: &FramePlan) -> Result<(), Error> {
        if plan.may_use_compute && plan.technique == Technique::Opaque {
            let small = match &mut self.small {
                Some(made) => made,
                none => none.insert(ComputeRasterizer::new(&self.gpu, &self.targets)?),
            };
            small.ensure(ComputeVariant::of(plan))?;
            small.ensure(ComputeVariant::SAMPLES)?;
            let has_lamp = !plan.settings.has_headlight();
            let lamp_flags = has_lamp.then_some(plan.constants.flags);
            small.ensure_light(lamp_flags, &self.targets)?;
        }
        let variant = OpaqueSplats::variant_of(&plan.settings, plan.constants.flags);
        if self.splats.iter().all(|s| s.variant != variant) {
            if self.splats.len() == MOST_SPLATS {
                self.splats.remove(0);
            }
            let made = OpaqueSplats::new(&self.gpu, variant, &self.targets)?;
            self.splats.push(made);
        }
        Ok(())
    }

    fn prepare_polygons(&mut self, plan: &FramePlan) -> Result<(), Error> {
        let Some(kind) = plan.settings.drawn_polygons().map(PolygonKind::of) else {
            return Ok(());
        };
        let variant = PolygonVariant {
            kind,
            flags: plan.constants.flags,
            by_compute: plan.may_use_compute,
            has_textures: plan.primitives.textures_patches,
        };
        let spare = &mut self.spare_polygons;
        exchange(&mut self.polygons, spare, |made| made.variant == variant);
        if self.polygons.is_none() {
            self.polygons = Some(PolygonPasses::new(&self.gpu, variant, &self.targets)?);
        }
        Ok(())
    }

    fn prepare_visibility(&mut self, plan: &FramePlan) -> Result<(), Error> {
        let visibility = match &mut self.visibility {
            Some(made) => made,
            none => {
                let (width, height) = (self.targets.color.width, self.targets.color.height);
                let normals = self.targets.normal.is_some();
                none.insert(VisibilityPasses::new(&self.gpu, width, height, normals)?)
            }
        };
        let source = match plan.settings.method {
            Method::Points => SplatSource::Vertices,
            _ => SplatSource::List,
        };
        let flags = plan.constants.flags;
        let are_polygons = plan.settings.drawn_vertex_splats().is_some();
        let kind = match are_polygons {
            true => VisibleKind::Polygons,
            false => VisibleKind::Splats,
        };
        let by_compute = plan.may_use_compute.then_some(kind);
        visibility.ensure(source, plan.settings.reconstruction, (flags, by_compute))?;
        match are_polygons {
            true => visibility.ensure_polygons(flags),
            false => Ok(()),
        }
    }

    fn prepare_fuzzy(&mut self, plan: &FramePlan) -> Result<(), Error> {
        let is_gray = plan.primitives.is_gray;
        let by_compute = plan.may_use_compute.then_some(is_gray);
        let variant = fuzzy::FuzzyVariant::new(
            &self.gpu,
            &plan.settings,
            plan.facts.kind.is_surface(),
            &self.targets,
            (plan.constants.flags, by_compute),
        )?;
        let spare = &mut self.spare_fuzzy;
        exchange(&mut self.fuzzy, spare, |f| f.variant == variant);
        if self.fuzzy.as_ref().is_none_or(|f| f.variant != variant) {
            let (width, height) = (self.targets.color.width, self.targets.color.height);
            self.fuzzy = Some(FuzzyPasses::new(&self.gpu, variant, width, height)?);
        }
        Ok(())
    }

    fn prepare_filtered(&mut self, plan: &FramePlan, scene: &DeviceScene) -> Result<(), Error> {
        let variant = filtered::FilteredVariant {
            has_lamp: !plan.settings.has_headlight(),
            color: self.targets.color.format,
            by_compute: plan.may_use_compute.then_some(plan.primitives.is_gray),
            has_textures: scene.is_textured(),
        };
        let spare = &mut self.spare_filtered;
        exchange(&mut self.filtered, spare, |f| f.variant == variant);
        if self.filtered.as_ref().is_none_or(|f| f.variant != variant) {
            let size = (self.targets.color.width, self.targets.color.height);
            self.filtered = Some(FilteredPasses::new(&self.gpu, size, variant)?);
        }
        Ok(())
    }

    /// Copies the tree to the device for a frame that needs it there, and makes what chooses cuts or expands numbers. False
    /// where that does not fit and nobody insists: the frame is to be planned without.
    ///
    /// # Errors
    /// When memory runs out.
    pub(super) fn prepare_tree(
        &mut self,
        plan: &FramePlan,
        parts: DrawnParts<'_>,
        scene: &DeviceScene,
    ) -> Result<bool, Error> {
        let settings = &plan.settings;
        // Of several models none is planned so.
        let Some(FactedModel { model, facts, .. }) = parts.single() else {
            return Ok(true);
        };
        if plan.cut_place == CutPlace::Device
            && let Err(error) = self.make_device_cut(ExpandedKind::of(plan), (model, scene))
        {
            if settings.cut_on == CutOn::Device {
                return Err(error);
            }
            tracing::info!(%error, "the processor chooses cuts");
            let too_large = match plan.technique {
                Technique::Filtered => &mut self.too_large.filtered_cut,
                _ => &mut self.too_large.cut,
            };
            *too_large = Some(scene.id());
            return Ok(false);
        }
        if plan.uploads_ids
            && let Err(error) = self.prepare_tree_of_ids(plan, (model, facts), scene)
        {
            if settings.list_of == ListOf::Ids {
                return Err(error);
            }
            tracing::info!(%error, "draw lists hold records");
            self.too_large.tree = Some(scene.id());
            return Ok(false);
        }
        let has_ids = plan.cut_place == CutPlace::Device || plan.uploads_ids;
        if has_ids {
            let has_triangles = model.kind().is_surface();
            let is_of = |made: &IdExpansion| made.is_of(has_triangles);
            if !self.by_id.as_ref().is_some_and(is_of) {
                self.by_id = Some(IdExpansion::new(&self.gpu, has_triangles)?);
            }
        }
        if has_ids && let Some(by_id) = &mut self.by_id {
            match plan.technique {
                Technique::Filtered => by_id.ensure_filtered(&self.gpu, plan.constants.flags)?,
                Technique::Polygons => by_id.ensure_patches(&self.gpu)?,
                _ => {}
            }
        }
        Ok(true)
    }

    /// Copies to the device what it expands the numbers of a frame's lists from.
    fn prepare_tree_of_ids(
        &mut self,
        plan: &FramePlan,
        (model, facts): (&Model, &ModelFacts),
        scene: &DeviceScene,
    ) -> Result<(), Error> {
        let gpu = self.gpu.clone();
        let tree = self.tree_on_device(model, scene)?;
        match plan.technique {
            Technique::Filtered => tree.add_moments(&gpu, model),
            Technique::Polygons => {
                let patches = facts.patches(model);
                tree.add_patches(&gpu, (patches.records(), patches.textures()))
            }
            _ => Ok(()),
        }
    }

    fn make_device_cut(
        &mut self,
        kind: ExpandedKind,
        (model, scene): (&Model, &DeviceScene),
    ) -> Result<(), Error> {
        let color = &self.targets.color;
        let pixels = u64::from(color.width) * u64::from(color.height);
        let is_of = |cut: &DeviceCut| cut.is_of(scene, (kind, pixels));
        if self.device_cut.as_ref().is_some_and(is_of) {
            return Ok(());
        }
        // Its memory first.
        (self.device_cut, self.held_on_device) = (None, None);
        let room = (kind, pixels, self.frames.in_flight());
        let gpu = self.gpu.clone();
        let tree = self.tree_on_device(model, scene)?;
        if kind.are_filtered {
            tree.add_moments(&gpu, model)?;
        }
        let cut = DeviceCut::new(&gpu, SceneTree { tree, scene }, model, room)?;
        self.device_cut = Some(cut);
        Ok(())
    }

    /// The tree of a scene on the device, copied at the first call.
    fn tree_on_device(
        &mut self,
        model: &Model,
        scene: &DeviceScene,
    ) -> Result<&mut DeviceTree, Error> {
        let tree = self.device_tree.take().filter(|tree| tree.is_of(scene));
        let tree = match tree {
            Some(tree) => tree,
            None => {
                // Of another tree.
                (self.device_cut, self.held_on_device) = (None, None);
                DeviceTree::new(&self.gpu, model, scene)?
            }
        };
        Ok(self.device_tree.insert(tree))
    }
}

/// Variants of opaque splats that are kept; pipelines alone take little.
const MOST_SPLATS: usize = 16;

/// Variants that are kept besides the present one.
const MOST_SPARE: usize = 2;

/// Puts the one that `is_it` into `place`, if it is there or among the spare ones, and else none; what was there is spare
/// then. Variants that are drawn in turn, as charts do, are so made once.
fn exchange<T>(place: &mut Option<T>, spare: &mut Vec<T>, is_it: impl Fn(&T) -> bool) {
    if place.as_ref().is_some_and(&is_it) {
        return;
    }
    let found = spare.iter().position(is_it).map(|i| spare.remove(i));
    spare.extend(std::mem::replace(place, found));
    if spare.len() > MOST_SPARE {
        // The one that was last drawn longest ago.
        spare.remove(0);
    }
}
