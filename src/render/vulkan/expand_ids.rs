//! Draw lists by number: the host, or the device itself ([`crate::render::vulkan::device_cut`]), writes which nodes and
//! leaves a frame draws, and the device, which has the tree, makes the records and corners that its other passes draw.
//!
//! So the host looks at no attributes, and 8 bytes a splat and 4 a triangle go to the device instead of 24 (28 with areas)
//! and 12. The records are the same to the bit, in the same places, but for roots and quotients on devices that round them
//! otherwise. Of records that depend on the view, a pass of its own makes those of filtered splats
//! ([`crate::render::vulkan::expand_filtered`]); those of fuzzy ones that compute draws come from the host.

use crate::abi::specialization::{ARE_ORIENTED, HAVE_AREAS, HAVE_TRIANGLES};
use crate::abi::{
    FilteredConstants, FilteredSplat, ListConstants, Splat, SplatId, WeightedSplat, shaders,
};
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::{AnyBuffer, DeviceBuffer, UploadBuffer};
use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::pipeline::ShaderPipeline;
use crate::gpu::{Error, Gpu};
use crate::pack::Footprint;
use crate::pack::splats::PackedSplats;
use crate::render::frame_plan::FramePlan;
use crate::render::technique::Technique;
use crate::render::vulkan::device_tree::{DeviceTree, SceneTree, page_of};
use crate::render::vulkan::draw_lists::DrawLists;
use crate::render::vulkan::expand_filtered::{FilteredExpansion, NamedFiltered};
use crate::render::vulkan::expand_patches::PatchExpansion;
use crate::render::vulkan::raster_pass::{ListArguments, PageRange};
use crate::render::vulkan::storage_ranges;
use crate::render::vulkan::targets::Context;
use std::sync::Arc;

/// Pipelines that make records and corners.
#[derive(Debug)]
pub(super) struct IdExpansion {
    /// Of splats of one size and with radii of their own, each without and with areas.
    splats: [ShaderPipeline; 4],
    /// Pipelines of quads that the device chose, in the same order.
    quads: [ShaderPipeline; 4],
    triangles: ShaderPipeline,
    has_triangles: bool,
    /// Of filtered splats, once they were drawn.
    filtered: Option<FilteredExpansion>,
    /// Of patches, once they were drawn.
    patches: Option<PatchExpansion>,
}

/// Members of the records of a list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ExpandedKind {
    /// Radii of their own.
    pub(crate) are_oriented: bool,
    /// The areas that they stand for.
    pub(crate) have_areas: bool,
    /// Sizes of their own, which may be too large for points.
    pub(crate) have_quads: bool,
    /// Filtered splats, which have no other members.
    pub(crate) are_filtered: bool,
}

/// Frame that sees splats which the device chose.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExpansionFrame<'a> {
    pub(super) context: &'a Context,
    pub(super) constants: UniformBlock,
    /// Eye that sees filtered splats.
    pub(super) eye: Option<&'a FilteredConstants>,
}

/// Numbers of splats that the device chose, and where their records go.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChosenIds<'a> {
    pub(super) ids: &'a DeviceBuffer,
    pub(super) records: &'a DeviceBuffer,
    /// Items that both have room for.
    pub(super) room: u32,
    /// A dispatch over all that are points.
    pub(super) groups: ListArguments<'a>,
    /// A dispatch over the quads, which end the list; none where there never are any.
    pub(super) quads: Option<ListArguments<'a>>,
}

impl ExpandedKind {
    /// Kind that a planned frame draws.
    pub(crate) fn of(plan: &FramePlan) -> Self {
        // They are points however large.
        let are_filtered = plan.technique == Technique::Filtered;
        Self {
            are_oriented: plan.settings.footprint() == Footprint::Oriented,
            have_areas: plan.technique == Technique::Fuzzy,
            have_quads: plan.primitives.has_large_splats && !are_filtered,
            are_filtered,
        }
    }

    /// Bytes of one.
    pub(super) fn bytes(self) -> usize {
        match (self.are_filtered, self.have_areas) {
            (true, _) => size_of::<FilteredSplat>(),
            (false, true) => size_of::<WeightedSplat>(),
            (false, false) => size_of::<Splat>(),
        }
    }

    fn index(self) -> usize {
        2 * usize::from(self.are_oriented) + usize::from(self.have_areas)
    }
}

impl IdExpansion {
    /// Of trees whose leaves are triangles or, without, points.
    ///
    /// # Errors
    /// When a Vulkan call fails.
    pub(super) fn new(gpu: &Arc<Gpu>, has_triangles: bool) -> Result<Self, Error> {
        let splats = |shader, are_oriented, have_areas| {
            let constants = [
                ARE_ORIENTED.is(are_oriented),
                HAVE_AREAS.is(have_areas),
                HAVE_TRIANGLES.is(has_triangles),
            ];
            ShaderPipeline::compute(gpu, "lists.splats", shader, &constants)
        };
        let of_each = |shader| {
            Ok::<_, Error>([
                splats(shader, false, false)?,
                splats(shader, false, true)?,
                splats(shader, true, false)?,
                splats(shader, true, true)?,
            ])
        };
        let triangles = &shaders::LISTS_TRIANGLES_COMP;
        Ok(Self {
            splats: of_each(&shaders::LISTS_SPLATS_COMP)?,
            quads: of_each(&shaders::LISTS_QUADS_COMP)?,
            triangles: ShaderPipeline::compute(gpu, "lists.triangles", triangles, &[])?,
            has_triangles,
            filtered: None,
            patches: None,
        })
    }

    /// Makes the pipeline for filtered splats of frames with such flags, unless it is there.
    ///
    /// # Errors
    /// When a Vulkan call fails.
    pub(super) fn ensure_filtered(&mut self, gpu: &Arc<Gpu>, flags: u32) -> Result<(), Error> {
        let has_triangles = self.has_triangles;
        let is_of = |made: &FilteredExpansion| made.is_of(flags, has_triangles);
        if !self.filtered.as_ref().is_some_and(is_of) {
            self.filtered = Some(FilteredExpansion::new(gpu, flags, has_triangles)?);
        }
        Ok(())
    }

    /// Makes the pipelines for patches, unless they are there.
    ///
    /// # Errors
    /// When a Vulkan call fails.
    pub(super) fn ensure_patches(&mut self, gpu: &Arc<Gpu>) -> Result<(), Error> {
        if self.patches.is_none() {
            self.patches = Some(PatchExpansion::new(gpu)?);
        }
        Ok(())
    }

    /// Tells whether it is of such trees.
    pub(super) fn is_of(&self, has_triangles: bool) -> bool {
        self.has_triangles == has_triangles
    }

    /// Makes what a slot's lists name, unless that is there; `of_frame` is the block of the frame.
    ///
    /// # Errors
    /// When the scene lies in several pages, or the frame has no room for constants.
    pub(super) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        on: SceneTree<'_>,
        (lists, kind): (&DrawLists, ExpandedKind),
        context: &Context,
        of_frame: UniformBlock,
    ) -> Result<(), Error> {
        let Some(([splats, large, small, patches], whole, held)) = lists.named() else {
            return Ok(());
        };
        let list = (splats, held.packed, held.capacity);
        let constants = storage_ranges::constants(context);
        match (&lists.eye, &self.filtered) {
            (Some(eye), Some(filtered)) => {
                let named = NamedFiltered {
                    ids: splats,
                    count: held.packed.points,
                    groups: None,
                    records: &whole.splats,
                    eye,
                };
                filtered.record(frame, on, named, (of_frame, constants))?;
            }
            _ => self.splats(frame, on, (list, &whole.splats, kind), constants)?,
        }
        if let Some(expansion) = &self.patches {
            let list = (patches, held.polygons, &whole.polygons);
            expansion.record(frame, on.tree, list, constants)?;
            if !lists.patch_runs.is_empty() {
                let list = (patches, held.polygons, &whole.places);
                expansion.record_places(frame, on.tree, list, constants)?;
            }
        }
        let count = |runs: &[PageRange]| runs.iter().map(|run| run.count as usize / 3).sum();
        let triangles = [
            (large, &whole.indices, count(&lists.runs)),
            (small, &whole.small, count(&lists.small_runs)),
        ];
        self.triangles(frame, on.tree, triangles, constants)
    }

    /// Pass `lists.splats` or `lists.filtered`: writes the records of numbers that the device chose.
    ///
    /// # Errors
    /// When the scene lies in several pages, or the frame has no room for constants.
    pub(super) fn record_chosen(
        &self,
        frame: &mut FrameRecorder<'_>,
        on: SceneTree<'_>,
        (chosen, kind): (ChosenIds<'_>, ExpandedKind),
        seen: ExpansionFrame<'_>,
    ) -> Result<(), Error> {
        let constants = storage_ranges::constants(seen.context);
        if let (Some(eye), Some(filtered)) = (seen.eye, &self.filtered) {
            let named = NamedFiltered {
                ids: chosen.ids,
                count: chosen.room as usize,
                groups: Some(chosen.groups),
                records: chosen.records,
                eye,
            };
            return filtered.record(frame, on, named, (seen.constants, constants));
        }
        let ChosenIds {
            ids,
            records,
            room,
            groups,
            quads,
        } = chosen;
        let (constants, _) = part(frame, constants, 0, room as usize)?;
        let in_tree = on.tree.buffers_of_splats(page_of(on.scene)?);
        let mut pass = frame.pass("lists.splats").storage_read(ids);
        for buffer in in_tree {
            pass = pass.storage_read(buffer);
        }
        let [nodes, attributes, leaves, corners, vertices] = in_tree.map(BufferSlice::whole);
        let (ids, out) = (BufferSlice::whole(ids), BufferSlice::whole(records));
        let counts = BufferSlice::whole(groups.buffer);
        pass = pass.storage(records).group_arguments(groups.buffer);
        if quads.is_some() {
            pass = pass.storage_read(groups.buffer);
        }
        pass.compute(|compute| {
            let bound = [ids, leaves, corners, vertices, out, nodes, attributes];
            compute.bind(&self.splats[kind.index()], &[constants], &bound);
            compute.groups_from(groups.buffer, groups.offset);
            if let Some(quads) = quads {
                let bound = [ids, leaves, corners, vertices, out, counts];
                compute.bind(&self.quads[kind.index()], &[constants], &bound);
                compute.groups_from(quads.buffer, quads.offset);
            }
        });
        Ok(())
    }

    /// Pass `lists.splats`: writes the records of a list of numbers with so much room.
    fn splats(
        &self,
        frame: &mut FrameRecorder<'_>,
        on: SceneTree<'_>,
        ((ids, packed, capacity), out, kind): (
            (&UploadBuffer, PackedSplats, usize),
            &DeviceBuffer,
            ExpandedKind,
        ),
        constants: ListConstants,
    ) -> Result<(), Error> {
        let PackedSplats { points, quads } = packed;
        let mut parts = Vec::new();
        for (first, count) in [(0, points), (capacity - quads, quads)] {
            if count > 0 {
                parts.push(part(frame, constants, first, count)?);
            }
        }
        if parts.is_empty() {
            return Ok(());
        }
        let in_tree = on.tree.buffers_of_splats(page_of(on.scene)?);
        let mut pass = frame.pass("lists.splats").storage_read(ids);
        for buffer in in_tree {
            pass = pass.storage_read(buffer);
        }
        let [nodes, attributes, leaves, corners, vertices] = in_tree.map(BufferSlice::whole);
        let bound = [
            first_bytes(ids, capacity * size_of::<SplatId>()),
            leaves,
            corners,
            vertices,
            first_bytes(out, capacity * kind.bytes()),
            nodes,
            attributes,
        ];
        pass.storage(out).compute(|compute| {
            for (constants, count) in parts {
                compute.bind(&self.splats[kind.index()], &[constants], &bound);
                compute.items(count);
            }
        });
        Ok(())
    }

    /// Pass `lists.triangles`: writes the corners of the triangles of lists, each of so many.
    fn triangles(
        &self,
        frame: &mut FrameRecorder<'_>,
        tree: &DeviceTree,
        lists: [(&UploadBuffer, &DeviceBuffer, usize); 2],
        constants: ListConstants,
    ) -> Result<(), Error> {
        let mut all = Vec::new();
        for (ids, out, count) in lists {
            if count > 0 {
                all.push((ids, out, part(frame, constants, 0, count)?));
            }
        }
        if all.is_empty() {
            return Ok(());
        }
        let mut pass = frame.pass("lists.triangles").storage_read(&tree.corners);
        for (ids, out, _) in &all {
            pass = pass.storage_read(*ids).storage(*out);
        }
        pass.compute(|compute| {
            for (ids, out, (constants, count)) in all {
                let bound = [
                    first_bytes(ids, 4 * count as usize),
                    BufferSlice::whole(&tree.corners),
                    first_bytes(out, 12 * count as usize),
                ];
                compute.bind(&self.triangles, &[constants], &bound);
                compute.items(count);
            }
        });
        Ok(())
    }
}

/// The first bytes of a list.
fn first_bytes(buffer: &dyn AnyBuffer, bytes: usize) -> BufferSlice<'_> {
    BufferSlice::new(buffer, 0, bytes as u64)
}

/// `count` items of a list, from the `first` on.
fn part(
    frame: &mut FrameRecorder<'_>,
    constants: ListConstants,
    first: usize,
    count: usize,
) -> Result<(UniformBlock, u32), Error> {
    let count = count as u32;
    let constants = frame.uniform(&ListConstants {
        begin: first as u32,
        count,
        ..constants
    })?;
    Ok((constants, count))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failing test panics")]

    use super::*;
    use crate::cut::{Cut, CutSelector, SizeMetric, ZeroAreaSet};
    use crate::generate::{self, GeneratedShape, ShapeSpec};
    use crate::gpu::buffer::{BufferUsage, ReadbackBuffer};
    use crate::gpu::device::DeviceKind as Device;
    use crate::gpu::for_tests::{close_in_silence, device};
    use crate::gpu::frame::FrameRing;
    use crate::math::camera::View;
    use crate::pack::splats;
    use crate::pack::splats::SplatPlan;
    use crate::pack::{Footprint, ids};
    use crate::progress::SilentProgress;
    use crate::render::Settings;
    use crate::render::cut_key::cut_settings;
    use crate::render::vulkan::scene::DeviceScene;
    use crate::tree::{self, BuildOptions, Model};

    fn model_of(shape: GeneratedShape, triangles: u64, is_cloud: bool) -> Model {
        let mut mesh = generate::mesh(&ShapeSpec::with_triangles(shape, triangles).unwrap());
        if is_cloud {
            mesh.triangles.clear();
        } else if let Some(&first) = mesh.triangles.first() {
            // Patches without area, alone below a node and beside others.
            mesh.triangles.extend([[first[0]; 3]; 40]);
        }
        tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
    }

    fn orbit(model: &Model, fill: f64, step: u32) -> View {
        let camera = model.orbit_step((320, 200), fill, step, 5);
        camera.view(model.origin).unwrap()
    }

    /// Words of the records that the device makes of numbers: the points, then the quads.
    fn made(
        gpu: &Arc<Gpu>,
        (model, scene): (&Model, &DeviceScene),
        (named, packed): (&[SplatId], PackedSplats),
        kind: ExpandedKind,
    ) -> Vec<u32> {
        let tree = DeviceTree::new(gpu, model, scene).unwrap();
        let by_id = IdExpansion::new(gpu, model.kind().is_surface()).unwrap();
        let bytes: &[u8] = bytemuck::cast_slice(named);
        let mut list = UploadBuffer::new(gpu, "numbers", bytes.len() as u64).unwrap();
        list.bytes_mut()[..bytes.len()].copy_from_slice(bytes);
        list.flush(0..bytes.len() as u64);
        let size = (named.len() * kind.bytes()) as u64;
        let out = DeviceBuffer::new(gpu, "records", BufferUsage::List, size).unwrap();
        let mut read = ReadbackBuffer::new(gpu, "read", size).unwrap();
        let mut frames = FrameRing::new(gpu, 1, false).unwrap();
        let mut frame = frames.begin().unwrap();
        let list = (&list, packed, named.len());
        let constants = bytemuck::Zeroable::zeroed();
        by_id
            .splats(
                &mut frame,
                SceneTree { tree: &tree, scene },
                (list, &out, kind),
                constants,
            )
            .unwrap();
        frame.read_back_buffer("read", &out, &read);
        let ticket = frame.submit().unwrap();
        frames.finish(ticket).unwrap();
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(ReadbackBuffer::bytes(&mut read));
        let of_one = kind.bytes() / 4;
        let end = named.len() * of_one;
        [
            &words[..packed.points * of_one],
            &words[end - packed.quads * of_one..end],
        ]
        .concat()
    }

    /// The words that the host writes, likewise.
    fn written<R: splats::SplatRecord + bytemuck::Pod + Send>(
        (model, cut): (&Model, &Cut),
        (view, plan): (&View, &SplatPlan),
    ) -> (Vec<u32>, PackedSplats) {
        let mut records = vec![R::zeroed(); splats::count(cut, plan)];
        let packed = splats::pack(model, cut, view, plan, &mut records);
        let (points, rest) = records.split_at(packed.points);
        let drawn = [points, &rest[rest.len() - packed.quads..]].concat();
        (bytemuck::cast_slice(&drawn).to_vec(), packed)
    }

    /// Of every kind of splat of a cut, whatever decides its size, the device makes the very record that the host writes.
    #[test]
    fn numbers_become_the_records_that_the_host_writes() {
        let Some(gpu) = device() else { return };
        // Elsewhere roots and quotients may differ in the last place.
        let is_exact = gpu.info().kind == Device::Cpu;
        // Nodes, rows, leaves, leaves of their own size, leaves in their plane, quads.
        let mut kinds = [0; 6];
        for (shape, triangles, is_cloud) in [
            (GeneratedShape::Statue, 40_000, false),
            (GeneratedShape::Torus, 30_000, false),
            (GeneratedShape::Statue, 20_000, true),
            (GeneratedShape::Square, 2, false),
        ] {
            let model = model_of(shape, triangles, is_cloud);
            let scene = DeviceScene::new(&gpu, &model).unwrap();
            let undrawn = ZeroAreaSet::new(&model);
            for (step, fill) in [(0, 0.1), (1, 0.8), (2, 3.0)] {
                let view = orbit(&model, fill, step);
                for (threshold_px, footprint, size, draws_large_leaves, max_point_px) in [
                    (1.0, Footprint::Square, SizeMetric::Exact, false, 255.0),
                    (3.0, Footprint::Circle, SizeMetric::Nearest, false, 255.0),
                    (4.0, Footprint::Oriented, SizeMetric::Exact, false, 255.0),
                    (5.0, Footprint::Square, SizeMetric::Exact, true, 8.0),
                    (5.0, Footprint::Oriented, SizeMetric::Exact, true, 9.0),
                ] {
                    let plan = SplatPlan {
                        footprint,
                        threshold_px,
                        size,
                        draws_large_leaves,
                        low_pass_px: 0.0,
                        by_level: false,
                        cut_view: None,
                        max_point_px,
                    };
                    let settings = Settings {
                        threshold_px,
                        size,
                        ..Settings::default()
                    };
                    let mut cut = Cut::default();
                    let of_cut = cut_settings(&settings, &model);
                    CutSelector::default().select(&model, &view, &of_cut, &mut cut);
                    let mut named = vec![SplatId::node(0); splats::count(&cut, &plan)];
                    let packed = ids::pack(&model, &undrawn, (&cut, &view, &plan), &mut named);
                    let what = format!(
                        "{shape:?}, cloud {is_cloud}, fill {fill}, {threshold_px} px {footprint:?}"
                    );
                    if named.is_empty() {
                        continue;
                    }
                    for id in named[..packed.points]
                        .iter()
                        .chain(&named[named.len() - packed.quads..])
                    {
                        let has = |bit: u32| usize::from(id.part & bit != 0);
                        let is_row = usize::from(id.part >> 16 != 0) - has(SplatId::LEAF);
                        kinds[0] += usize::from(id.part == 0);
                        kinds[1] += is_row;
                        kinds[2] += has(SplatId::LEAF);
                        kinds[3] += has(SplatId::OF_OWN_SIZE);
                        kinds[4] += has(SplatId::IN_PLANE);
                    }
                    kinds[5] += packed.quads;
                    for have_areas in [false, true] {
                        let kind = ExpandedKind {
                            are_oriented: footprint == Footprint::Oriented,
                            have_areas,
                            have_quads: false,
                            are_filtered: false,
                        };
                        let list = (&named[..], packed);
                        let device = made(&gpu, (&model, &scene), list, kind);
                        let (host, of_host) = match have_areas {
                            true => written::<WeightedSplat>((&model, &cut), (&view, &plan)),
                            false => written::<Splat>((&model, &cut), (&view, &plan)),
                        };
                        assert_eq!(packed, of_host, "{what}");
                        assert!(!is_exact || device == host, "{what}, areas {have_areas}");
                    }
                }
            }
        }
        assert!(kinds.iter().all(|&n| n > 100), "{kinds:?}");
        close_in_silence(gpu);
    }

    /// Corners of triangles, of both lists.
    #[test]
    fn numbers_become_the_corners_of_triangles() {
        let Some(gpu) = device() else { return };
        let model = model_of(GeneratedShape::Torus, 5_000, false);
        let scene = DeviceScene::new(&gpu, &model).unwrap();
        let tree = DeviceTree::new(&gpu, &model, &scene).unwrap();
        let by_id = IdExpansion::new(&gpu, true).unwrap();
        let mut frames = FrameRing::new(&gpu, 1, false).unwrap();
        let lists: [Vec<u32>; 2] = [(0..777).map(|i| 3 * i).collect(), vec![4, 2, 999]];
        let made = lists.each_ref().map(|ids| {
            let bytes: &[u8] = bytemuck::cast_slice(ids);
            let mut list = UploadBuffer::new(&gpu, "numbers", bytes.len() as u64).unwrap();
            list.bytes_mut()[..bytes.len()].copy_from_slice(bytes);
            list.flush(0..bytes.len() as u64);
            let size = 12 * ids.len() as u64;
            let out = DeviceBuffer::new(&gpu, "corners", BufferUsage::List, size).unwrap();
            (list, out, ReadbackBuffer::new(&gpu, "read", size).unwrap())
        });
        let mut frame = frames.begin().unwrap();
        let of = |i: usize| (&made[i].0, &made[i].1, lists[i].len());
        let constants = bytemuck::Zeroable::zeroed();
        by_id
            .triangles(&mut frame, &tree, [of(0), of(1)], constants)
            .unwrap();
        for (_, out, read) in &made {
            frame.read_back_buffer("read", out, read);
        }
        let ticket = frame.submit().unwrap();
        frames.finish(ticket).unwrap();
        for (ids, (_, _, mut read)) in lists.iter().zip(made) {
            let corners: Vec<[u32; 3]> =
                bytemuck::pod_collect_to_vec(ReadbackBuffer::bytes(&mut read));
            let host: Vec<[u32; 3]> = ids.iter().map(|&id| model.triangles[id as usize]).collect();
            assert_eq!(corners[..ids.len()], host);
        }
        drop((frames, by_id, tree, scene));
        close_in_silence(gpu);
    }
}
