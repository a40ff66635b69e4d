//! Frames of the methods that draw a cut: its draw lists are written into mapped memory, then drawn.

use crate::gpu::Error;
use crate::gpu::buffer::AnyBuffer;
use crate::gpu::frame::{FrameRecorder, FrameTicket, UniformBlock};
use crate::gpu::pipeline::ShaderPipeline;
use crate::pack::ColorBy;
use crate::render::cost::choose::{ComputeShare, FrameWorkload};
use crate::render::cost::select_passes;
use crate::render::cost::select_passes::PassSelection;
use crate::render::frame_plan::{FramePlan, PackKey};
use crate::render::model_facts::DrawnParts;
use crate::render::pack_params::largest_splat_px;
use crate::render::screen_bounds;
use crate::render::stats::{FrameStage, KeptWork};
use crate::render::technique::Technique;
use crate::render::vulkan::blended::compute as blended_compute;
use crate::render::vulkan::blended::filtered::FilteredPasses;
use crate::render::vulkan::blended::fuzzy::FuzzyPasses;
use crate::render::vulkan::blended::{filtered, fuzzy};
use crate::render::vulkan::device_cut::{ChoiceConstants, DeviceCut};
use crate::render::vulkan::device_tree::SceneTree;
use crate::render::vulkan::draw_lists::{DrawLists, PackInput, PackedFrame};
use crate::render::vulkan::expand_ids::{ExpandedKind, ExpansionFrame};
use crate::render::vulkan::opaque::compute::ComputeRasterizer;
use crate::render::vulkan::opaque::compute_variant::ComputeVariant;
use crate::render::vulkan::opaque::hardware::OpaqueSplats;
use crate::render::vulkan::opaque::polygon_variant::{PatchImages, PolygonRecords};
use crate::render::vulkan::opaque::polygons::PolygonPasses;
use crate::render::vulkan::opaque::rims::NumberedPatches;
use crate::render::vulkan::opaque::triangle_runs;
use crate::render::vulkan::overdraw;
use crate::render::vulkan::raster_pass::{
    PageRange, RasterList, RasterSplats, RasterTriangles, RecordRange, SplatRecords,
};
use crate::render::vulkan::renderer::{
    FrameEnd, FrameEnding, FrameTimes, PlannedFrame, VulkanRenderer, margin_px,
};
use crate::render::vulkan::storage_ranges::{ComputeList, TriangleRanges};
use crate::render::vulkan::targets::FrameTargets;
use crate::render::vulkan::visibility::hardware;
use crate::render::vulkan::visibility::hardware::VisibilityPasses;

impl VulkanRenderer {
    /// Chooses the cut of a frame, packs and uploads its draw lists, and records its passes.
    pub(super) fn draw_cut(
        &mut self,
        drawn: PlannedFrame<'_>,
        end: &mut FrameEnding<'_>,
    ) -> Result<(FrameTicket, FrameTimes), Error> {
        let PlannedFrame { plan, parts, .. } = drawn;
        let mut times = FrameTimes::default();
        let slot = self.frames.next_slot();
        let key = plan.pack_key();
        let cut = FrameStage::Cut.begin();
        let is_kept = self.keeps_lists && self.lists[slot].hold(&key);
        let is_new = !is_kept && self.choose_cut(plan, parts);
        let ahead = self.ahead.take().unwrap_or_default();
        times.kept = match is_new || ahead.is_new {
            _ if is_kept => KeptWork::Lists,
            true => KeptWork::Nothing,
            false => KeptWork::Cut,
        };
        cut.end(&mut times);
        times.cut_ms += ahead.ms;

        let packing = FrameStage::Pack.begin();
        if !is_kept {
            self.frames.wait_for_next()?;
            self.pack_cut(drawn, key, slot)?;
        }
        packing.end(&mut times);
        let upload = FrameStage::Upload.begin();
        if !is_kept {
            self.lists[slot].flush();
        }
        upload.end(&mut times);
        let submit = FrameStage::Submit.begin();
        let ticket = self.record_cut(drawn, ListPlace::Slot(slot), end)?;
        self.lists[slot].are_made();
        submit.end(&mut times);
        times.counts = self.lists[slot].counts();
        Ok((ticket, times))
    }

    /// Chooses the cut of a frame, unless it is there: that of the last frame, where it may be kept, or one that was
    /// predicted for this frame. Tells whether it was chosen.
    pub(super) fn choose_cut(&mut self, plan: &FramePlan, parts: DrawnParts<'_>) -> bool {
        let chosen = Some((plan.drawn, plan.cut));
        let may_stay = self.keeps_lists || self.ahead.is_some();
        if may_stay && self.chosen == chosen {
            return false;
        }
        if self.chosen.is_none_or(|(drawn, _)| drawn != plan.drawn) {
            self.selector.forget();
        }
        self.cuts
            .select(&mut self.selector, parts, |part| plan.cut_of(part));
        self.chosen = chosen;
        self.visited += self.cuts.stats().visited;
        true
    }

    /// Decides which passes draw the present cut, and writes its draw lists.
    fn pack_cut(
        &mut self,
        drawn: PlannedFrame<'_>,
        key: PackKey,
        slot: usize,
    ) -> Result<(), Error> {
        let PlannedFrame { plan, parts, scene } = drawn;
        let selection = PassSelection::of(plan, &self.workload(plan, parts));
        let max_point_px = select_passes::max_point_px(plan, &selection, self.costs.as_ref());
        let triangles = self.cuts.triangle_count();
        let input = PackInput {
            plan,
            parts,
            scene,
            key,
            records: plan.records(max_point_px),
            selection,
        };
        self.lists[slot].pack(&self.gpu, &input, &mut self.cuts)?;
        // Triangles that became filtered splats are no longer in it.
        if self.cuts.triangle_count() != triangles {
            self.chosen = None;
        }
        Ok(())
    }

    /// Share of compute in blended splats that were packed.
    fn share_of(&self, drawn: PlannedFrame<'_>, held: &PackedFrame) -> ComputeShare {
        let PlannedFrame { plan, parts, .. } = drawn;
        held.selection.share.unwrap_or_else(|| {
            let workload = FrameWorkload {
                splats: held.packed.points,
                triangles: held.triangles,
                ..self.workload(plan, parts)
            };
            let has_large = plan.primitives.has_large_splats;
            workload.blended(held.triangles + held.packed.quads, has_large)
        })
    }

    /// Parts of the picture in which compute may draw splats.
    fn compute_areas(&self, drawn: PlannedFrame<'_>) -> Vec<[u32; 4]> {
        let PlannedFrame { plan, parts, .. } = drawn;
        // A graphics card goes over a pixel sooner than it begins another draw.
        if !self.gpu.info().is_cpu() {
            return vec![plan.context.rect_px];
        }
        let margin_px = margin_px(plan.largest_px);
        screen_bounds::areas(parts, &plan.view, plan.context.rect_px, margin_px)
    }

    /// Records and submits the passes that draw lists.
    pub(super) fn record_cut(
        &mut self,
        drawn: PlannedFrame<'_>,
        place: ListPlace<'_>,
        end: &mut FrameEnding<'_>,
    ) -> Result<FrameTicket, Error> {
        let PlannedFrame { plan, scene, .. } = drawn;
        let lists = match (place, &self.device_cut) {
            (ListPlace::Slot(slot), _) => {
                let lists = &self.lists[slot];
                let Some(held) = &lists.held else {
                    unreachable!("packed now or before")
                };
                CutLists::Packed(lists, held, self.share_of(drawn, held))
            }
            (ListPlace::Device(_), Some(cut)) => CutLists::Chosen(cut, plan.draws_cut_by_compute),
            (ListPlace::Device(_), None) => unreachable!("prepare made room for the cut"),
        };
        let areas = match lists.has_splats_by_compute() {
            true => self.compute_areas(drawn),
            false => Vec::new(),
        };
        let variant = OpaqueSplats::variant_of(&plan.settings, plan.constants.flags);
        let passes = CutPasses {
            drawn,
            lists,
            areas: &areas,
            targets: &self.targets,
            triangles: self.triangles.as_ref().map(|(_, pipeline)| pipeline),
            opaque: self.splats.iter().find(|s| s.variant == variant),
            polygons: self.polygons.as_ref(),
            small: self.small.as_ref(),
            fuzzy: self.fuzzy.as_ref(),
            filtered: self.filtered.as_ref(),
            visibility: self.visibility.as_ref(),
            overdraw: self.overdraw.as_ref(),
        };
        let mut frame = self.frames.begin()?;
        let constants = frame.uniform(&plan.constants)?;
        if let (Some(by_id), Some(tree)) = (&self.by_id, &self.device_tree) {
            let (on, kind) = (SceneTree { tree, scene }, ExpandedKind::of(plan));
            match (lists, place) {
                (CutLists::Packed(lists, ..), _) => {
                    by_id.record(&mut frame, on, (lists, kind), &plan.context, constants)?;
                }
                (CutLists::Chosen(cut, _), ListPlace::Device(Some(tests))) => {
                    let of_cut = frame.uniform(&tests.cut)?;
                    cut.choose(&mut frame, on, of_cut);
                    let chosen = (cut.chosen_ids(), kind);
                    let seen = ExpansionFrame {
                        context: &plan.context,
                        constants,
                        eye: tests.eye.as_ref(),
                    };
                    by_id.record_chosen(&mut frame, on, chosen, seen)?;
                }
                (CutLists::Chosen(cut, _), _) => cut.count(&mut frame),
            }
        }
        passes.record(&mut frame, constants)?;
        let last = FrameEnd {
            targets: &self.targets,
            looks: &self.looks,
            plan,
            patches: passes.shown_patches(),
        };
        last.end(frame, constants, end)
    }
}

/// Place where the lists of a frame are.
#[derive(Debug, Clone, Copy)]
pub(super) enum ListPlace<'a> {
    /// Mapped memory of a slot.
    Slot(usize),
    /// Memory of the device, and constants that choose its cut; none where the lists of the last frame stay.
    Device(Option<&'a ChoiceConstants>),
}

/// Lists of a frame.
#[derive(Debug, Clone, Copy)]
enum CutLists<'a> {
    /// Packed by the processor; what compute draws of blended splats.
    Packed(&'a DrawLists, &'a PackedFrame, ComputeShare),
    /// Chosen by the device; compute draws what is small, or nothing.
    Chosen(&'a DeviceCut, bool),
}

impl CutLists<'_> {
    /// Tells whether compute draws splats that are not blended.
    fn has_splats_by_compute(&self) -> bool {
        match self {
            Self::Packed(_, held, _) => held.selection.has_splats_by_compute,
            Self::Chosen(_, by_compute) => *by_compute,
        }
    }

    /// Number of oriented polygons.
    fn polygons(&self) -> usize {
        match self {
            Self::Packed(_, held, _) => held.polygons,
            Self::Chosen(..) => 0,
        }
    }
}

/// Passes and pipelines that draw the lists of a frame.
struct CutPasses<'a> {
    drawn: PlannedFrame<'a>,
    lists: CutLists<'a>,
    /// Parts of the picture in which anything can be.
    areas: &'a [[u32; 4]],
    targets: &'a FrameTargets,
    triangles: Option<&'a ShaderPipeline>,
    opaque: Option<&'a OpaqueSplats>,
    polygons: Option<&'a PolygonPasses>,
    small: Option<&'a ComputeRasterizer>,
    fuzzy: Option<&'a FuzzyPasses>,
    filtered: Option<&'a FilteredPasses>,
    visibility: Option<&'a VisibilityPasses>,
    overdraw: Option<&'a overdraw::OverdrawCounter>,
}

impl<'a> CutPasses<'a> {
    /// Records the passes of the frame's technique.
    ///
    /// # Errors
    /// When the frame has no room for the constants of its parts.
    fn record(&self, frame: &mut FrameRecorder<'_>, constants: UniformBlock) -> Result<(), Error> {
        let plan = self.drawn.plan;
        let (targets, context) = (self.targets, &plan.context);
        let raster = self.raster();
        match (plan.technique, self.fuzzy, self.filtered, self.visibility) {
            (Technique::Opaque | Technique::Polygons, ..) => {
                self.record_opaque(frame, constants)?
            }
            (Technique::Fuzzy, Some(fuzzy), ..) => {
                let list = self.fuzzy_lists();
                fuzzy.record(frame, targets, list, context, constants)?;
            }
            (Technique::Filtered, _, Some(filtered), _) => {
                let (small, share) = match self.lists {
                    CutLists::Packed(lists, held, share) => {
                        let small = self.blended_by_compute(lists, held.packed.points);
                        (Some(small), share)
                    }
                    CutLists::Chosen(..) => (None, ComputeShare::Nothing),
                };
                let list = filtered::FilteredLists { raster, small };
                filtered.record(frame, targets, list, share, context, constants)?;
            }
            (Technique::Visibility, .., Some(visibility)) => {
                let by_compute = self.lists.has_splats_by_compute();
                let list = hardware::VisibilityLists {
                    raster,
                    by_compute: by_compute.then_some(self.areas),
                    largest_px: largest_splat_px(&plan.facts, &plan.settings),
                };
                let how = plan.settings.reconstruction;
                visibility.record(frame, targets, list, how, context, constants)?;
            }
            _ => unreachable!("prepare made the pipelines"),
        }
        if let (ColorBy::Overdraw, Some(counter)) = (plan.settings.color_by, self.overdraw) {
            counter.record(frame, targets, &raster, context, constants);
        }
        Ok(())
    }

    /// Patches that the picture shows; none of other frames.
    fn shown_patches(&self) -> Option<NumberedPatches<'a>> {
        let CutLists::Packed(lists, held, _) = self.lists else {
            return None;
        };
        Some(NumberedPatches {
            polygons: lists.polygons(),
            count: held.polygons,
            numbers: self.polygons?.numbers()?,
        })
    }

    /// Images that patches show, and where they are in them; all pages of a model have its images.
    fn patch_images(&self, lists: &'a DrawLists) -> Option<PatchImages<'a>> {
        let of = |run: &PageRange| {
            let page = &self.drawn.scene.pages[run.page];
            let texels: &dyn AnyBuffer = &*page.textures.as_ref()?.texels;
            let PageRange { first, count, .. } = *run;
            Some((texels, RecordRange { first, count }))
        };
        if !self.drawn.plan.primitives.textures_patches {
            return None;
        }
        let texels: Option<Vec<_>> = lists.patch_runs.iter().map(of).collect();
        Some(PatchImages {
            texels: texels?,
            places: lists.patch_places(),
        })
    }

    /// Records triangles, what compute draws, splats by the rasterizer, and polygons, each where there are any. The first pass
    /// clears. Polygons are the last, as those that stay in the picture are known by their numbers.
    ///
    /// # Errors
    /// When the frame has no room for the constants of its parts.
    fn record_opaque(
        &self,
        frame: &mut FrameRecorder<'_>,
        constants: UniformBlock,
    ) -> Result<(), Error> {
        let (Some(pipeline), Some(splats)) = (self.triangles, self.opaque) else {
            unreachable!("prepare made the pipelines")
        };
        let plan = self.drawn.plan;
        let small = (self.small).filter(|_| self.lists.has_splats_by_compute());
        let list = self.opaque_list(small.is_some());
        let small = small.map(|small| (small, self.small_list(ComputeVariant::of(plan))));
        let (targets, context) = (self.targets, &plan.context);
        let has_small = small.is_some_and(|(_, list)| !list.is_empty());
        let has_splats = !list.only_splats().is_empty();
        let has_polygons = self.lists.polygons() > 0;
        // Polygons clear nothing.
        let has_triangles = !list.triangles.is_empty() || !(has_small || has_splats);
        if has_triangles {
            triangle_runs::record_triangles(frame, pipeline, targets, &list, context, constants);
        }
        if let Some((small, list)) = small {
            let context = (context, !has_triangles);
            small.record(frame, targets, list, context, constants)?;
        }
        let is_first = !has_triangles && !has_small;
        splats.record_list(frame, targets, &list, (context, is_first), constants);
        if let (Some(polygons), CutLists::Packed(lists, held, _), true) =
            (self.polygons, self.lists, has_polygons)
        {
            let list = PolygonRecords {
                polygons: lists.polygons(),
                count: held.polygons,
                textures: self.patch_images(lists),
            };
            polygons.record(frame, targets, list, context, constants)?;
        }
        Ok(())
    }

    /// The lists as the rasterizer draws opaque splats, without what compute draws.
    fn opaque_list(&self, by_compute: bool) -> RasterList<'a> {
        let raster = self.raster();
        let splats = match (self.lists, by_compute) {
            (CutLists::Packed(lists, held, _), _) => {
                let records = packed_records(lists, held);
                RasterSplats::Records(match by_compute {
                    true => records.without_points(),
                    false => records,
                })
            }
            (CutLists::Chosen(cut, _), true) => RasterSplats::Chosen(cut.splats().without_points()),
            (CutLists::Chosen(..), false) => raster.splats,
        };
        RasterList { splats, ..raster }
    }

    /// The lists as compute draws opaque splats and triangles of a few pixels.
    fn small_list(&self, variant: ComputeVariant) -> ComputeList<'a> {
        let (scene, areas) = (self.drawn.scene, self.areas);
        match self.lists {
            CutLists::Packed(lists, held, _) => ComputeList {
                scene,
                corners: lists.small(),
                runs: &lists.small_runs,
                splats: lists.splats(),
                splat_count: held.packed.points as u32,
                sample_count: held.samples as u32,
                variant,
                areas,
                groups: None,
            },
            CutLists::Chosen(cut, _) => cut.compute_list(scene, (variant, areas)),
        }
    }

    /// All of the lists, as the rasterizer draws it.
    fn raster(&self) -> RasterList<'a> {
        let scene = self.drawn.scene;
        match self.lists {
            CutLists::Packed(lists, held, _) => RasterList {
                scene,
                triangles: RasterTriangles::Runs(lists.indices(), &lists.runs),
                splats: match (held.polygons, self.drawn.plan.technique) {
                    (1.., Technique::Fuzzy | Technique::Visibility) => {
                        RasterSplats::Polygons(lists.polygons(), held.polygons as u32)
                    }
                    _ => RasterSplats::Records(packed_records(lists, held)),
                },
            },
            CutLists::Chosen(cut, _) => RasterList {
                scene,
                triangles: match self.drawn.plan.chooses_triangles() {
                    true => cut.triangles(),
                    false => RasterTriangles::Nothing,
                },
                splats: RasterSplats::Chosen(cut.splats()),
            },
        }
    }

    /// The lists as fuzzy splats are drawn: by compute, and what that leaves to the rasterizer.
    fn fuzzy_lists(&self) -> fuzzy::FuzzyLists<'a> {
        let raster = self.raster();
        let CutLists::Packed(lists, held, _) = self.lists else {
            return fuzzy::FuzzyLists {
                raster,
                small: None,
            };
        };
        let by_compute = held.selection.has_blended_by_compute();
        if let (RasterSplats::Polygons(polygons, count), true) = (raster.splats, by_compute) {
            return fuzzy::FuzzyLists {
                raster: raster.only_triangles(),
                small: Some(blended_compute::ComputeInput {
                    splats: polygons,
                    ..self.blended_by_compute(lists, count as usize)
                }),
            };
        }
        let placed = held.placed;
        let records = |placed| SplatRecords::large(lists.splats(), placed, held.capacity);
        fuzzy::FuzzyLists {
            raster: match placed {
                Some(placed) => RasterList {
                    splats: RasterSplats::Records(records(placed)),
                    ..raster
                },
                None => raster,
            },
            small: placed.map(|placed| self.blended_by_compute(lists, placed.small)),
        }
    }

    /// Part of blended splats that compute draws, of a list with so many splats.
    fn blended_by_compute(
        &self,
        lists: &'a DrawLists,
        splats: usize,
    ) -> blended_compute::ComputeInput<'a> {
        blended_compute::ComputeInput {
            splats: lists.splats(),
            splat_count: splats as u32,
            triangles: TriangleRanges {
                scene: self.drawn.scene,
                corners: lists.small(),
                runs: &lists.small_runs,
            },
        }
    }
}

/// The splats of packed lists.
fn packed_records<'a>(lists: &'a DrawLists, held: &PackedFrame) -> SplatRecords<'a> {
    SplatRecords::packed(lists.splats(), held.packed, held.capacity)
}
