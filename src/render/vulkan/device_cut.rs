//! The cut of `pop` on the device: the tree lies there, and so do the draw lists, which no one reads back.
//!
//! `cut.tree` goes down level by level ([`crate::cut::CutSelector`] does the same on the host): an invocation a node, a queue
//! of sibling groups a level, and each level tells how many workgroups the next one has. The number of what is small is
//! written to the list of splats at once. `cut.leaves` writes the others, and the corners of triangles: from the start of
//! their list those of a few pixels, from its end the others; last it counts. Points of a cloud, and triangles where they are
//! splats too, have sizes of their own: those that may be too large for a point are listed from the end, and are quads.
//! `lists.splats` ([`crate::render::vulkan::expand_ids`]) makes the records of a technique of the numbers, and its own passes
//! draw them, by arguments that were left beside the lists. Of filtered splats `lists.filtered` does, and pass `cut.pieces`
//! ([`pieces`]) decides about triangles before it. Related: Schütz, Kerbl and Wimmer, *Rendering Point Clouds with Compute Shaders
//! and Vertex Order Optimization* (2021), where nodes are chosen on the device too.
//!
//! It chooses what the host chooses, by the same operations in the same order; but for triangles that single precision
//! takes for edge-on, which stay. Room is for the worst case (of pieces see [`pieces`]), so that nothing is ever lost. What is
//! hidden is not looked for, and lists are in no order: of two equal depths another may win.

mod pieces;

use crate::abi::{CutConstants, CutCounters, FilteredConstants, SplatId, shaders};
use crate::cut;
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::{BufferUsage, DeviceBuffer, ReadbackBuffer};
use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::pipeline::ShaderPipeline;
use crate::gpu::{Error, Gpu};
use crate::math::camera::View;
use crate::pack::Footprint;
use crate::pack::filtered::FilteredShade;
use crate::render::compute_limits::LARGEST_TRIANGLE_PX;
use crate::render::cut_key::CutKey;
use crate::render::frame_plan::FramePlan;
use crate::render::pack_params::splat_plan;
use crate::render::technique::Technique;
use crate::render::vulkan::device_cut::pieces::{PieceLists, PiecePipelines};
use crate::render::vulkan::device_tree;
use crate::render::vulkan::device_tree::{DeviceTree, SceneTree};
use crate::render::vulkan::expand_ids::{ChosenIds, ExpandedKind};
use crate::render::vulkan::opaque::compute_variant::ComputeVariant;
use crate::render::vulkan::raster_pass::{ChosenSplats, ListArguments, PageRange, RasterTriangles};
use crate::render::vulkan::scene::{DeviceScene, ScenePage};
use crate::render::vulkan::storage_ranges::{ComputeList, ListGroups};
use crate::tree::Model;
use std::sync::Arc;

/// The lists of a cut of a scene's tree.
#[derive(Debug)]
pub(crate) struct DeviceCut {
    scene: u64,
    /// Leaves are points.
    are_points: bool,
    levels: usize,
    most_splats: u32,
    most_triangles: u32,
    subpixel_bits: u32,
    /// Sibling groups of a level and of the next one, in turn.
    queues: [DeviceBuffer; 2],
    /// Numbers of splats.
    ids: DeviceBuffer,
    /// Records of them, and of which kind.
    records: DeviceBuffer,
    kind: ExpandedKind,
    indices: DeviceBuffer,
    /// The part of `indices` that has those of triangles for compute.
    small: [PageRange; 1],
    counters: DeviceBuffer,
    pipelines: ChoicePipelines,
    /// Counts of the frame of each slot.
    read: Vec<ReadbackBuffer>,
}

/// Pipelines of the passes, in the order in which they run.
#[derive(Debug)]
struct ChoicePipelines {
    start: ShaderPipeline,
    nodes: ShaderPipeline,
    next: ShaderPipeline,
    leaves: ShaderPipeline,
    close: ShaderPipeline,
    /// Pipelines for triangles that may become filtered splats, where there are any.
    pieces: Option<PiecePipelines>,
}

impl ChoicePipelines {
    /// Makes the pipelines; `pixels`: those of the picture, where triangles may become filtered splats.
    ///
    /// # Errors
    /// When a Vulkan call fails.
    fn new(gpu: &Arc<Gpu>, pixels: Option<u64>) -> Result<Self, Error> {
        let pipeline = |name, shader| ShaderPipeline::compute(gpu, name, shader, &[]);
        Ok(Self {
            start: pipeline("cut.start", &shaders::CUT_START_COMP)?,
            nodes: pipeline("cut.nodes", &shaders::CUT_NODES_COMP)?,
            next: pipeline("cut.next", &shaders::CUT_NEXT_COMP)?,
            leaves: pipeline("cut.leaves", &shaders::CUT_LEAVES_COMP)?,
            close: pipeline("cut.close", &shaders::CUT_CLOSE_COMP)?,
            pieces: pixels
                .map(|pixels| PiecePipelines::new(gpu, pixels))
                .transpose()?,
        })
    }
}

/// Room of the lists for copies that fill up the workgroups of a dispatch: 64 invocations each, and one workgroup less than there
/// are rows of them, which 2^31 records have 512 of.
const SPARE_RECORDS: u64 = 512 * 64;

/// Bytes that a list must be smaller than the largest binding, so that it is bound in one part: two alignments of records, of 6 KiB
/// at most.
const ALIGNMENT_ROOM: u64 = 1 << 14;

/// Rules of a cut besides its tester and view.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChoiceRules {
    /// Largest splat, pixels.
    pub(crate) threshold_px: f32,
    /// Compute draws triangles of a few pixels.
    pub(crate) by_compute: bool,
    /// Balls without the center of a pixel are left out, where splats are a pixel.
    pub(crate) are_samples: bool,
    /// Large triangles are splats.
    pub(crate) draws_large_leaves: bool,
    /// Splats have radii of their own.
    pub(crate) are_oriented: bool,
    /// Largest side of a leaf that is drawn as a point, pixels, without what it is widened by.
    pub(crate) largest_px: f32,
    /// Large triangles become filtered splats.
    pub(crate) are_pieces: bool,
}

/// Constants of the passes that make the lists of a frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChoiceConstants {
    pub(crate) cut: CutConstants,
    /// Eye that sees filtered splats, where those are drawn.
    pub(crate) eye: Option<FilteredConstants>,
}

/// Side that no leaf has, pixels: filtered splats are points, whatever their size. Times a distance it is a number still.
const ANY_SIDE_PX: f32 = 1e24;

impl ChoiceRules {
    /// Rules of a planned frame.
    pub(crate) fn of(plan: &FramePlan) -> Self {
        let settings = &plan.settings;
        let splats = splat_plan(settings, plan.max_point_px);
        let are_filtered = plan.technique == Technique::Filtered;
        Self {
            threshold_px: settings.threshold_px,
            // Compute draws no triangles beside visibility splats.
            by_compute: plan.draws_cut_by_compute && plan.technique == Technique::Opaque,
            // Points of a cloud are no surface that others would close, and where leaves have sizes of their own the processor
            // asks no centers either.
            are_samples: plan.cut.needs_undrawn() && !plan.primitives.has_large_splats,
            draws_large_leaves: splats.draws_large_leaves && !are_filtered,
            are_oriented: splats.footprint == Footprint::Oriented,
            largest_px: match are_filtered {
                true => ANY_SIDE_PX,
                false => splats.largest_side_px(),
            },
            are_pieces: splats.draws_large_leaves && are_filtered,
        }
    }
}

/// Byte of the counters at which the workgroups of a level are.
const LEVEL_GROUPS: u64 = std::mem::offset_of!(CutCounters, workgroups) as u64;

/// Inputs that decide the lists of a cut on the device: equal ones give the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ChosenKey {
    /// [`crate::render::model_facts::DrawnParts::id`].
    drawn: u64,
    cut: CutKey,
    kind: ExpandedKind,
    by_compute: bool,
    /// Values that records of filtered splats depend on besides.
    shade: Option<FilteredShade>,
}

impl ChosenKey {
    /// Key of a planned frame.
    pub(crate) fn of(plan: &FramePlan) -> Self {
        Self {
            drawn: plan.drawn,
            cut: plan.cut,
            kind: ExpandedKind::of(plan),
            by_compute: plan.draws_cut_by_compute,
            shade: plan.filtered_shade(),
        }
    }
}

/// Number of bytes of so many records, of one at least.
fn bytes_of<T>(count: usize) -> u64 {
    (count.max(1) * size_of::<T>()) as u64
}

impl DeviceCut {
    /// Tells whether its lists have room for cuts of the scene, as records of a kind in a picture of so many pixels.
    pub(crate) fn is_of(&self, scene: &DeviceScene, (kind, pixels): (ExpandedKind, u64)) -> bool {
        let members = |kind: ExpandedKind| (kind.have_areas, kind.have_quads, kind.are_filtered);
        self.scene == scene.id()
            && members(self.kind) == members(kind)
            && (self.pipelines.pieces.as_ref()).is_none_or(|pieces| pieces.has_room_for(pixels))
    }

    /// Makes room for the largest cut there is of a tree, as records of a kind, and of filtered splats for pieces of triangles in
    /// a picture of so many pixels. `slots`: frames in flight.
    ///
    /// # Errors
    /// When it does not fit, or a Vulkan call fails.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        on: SceneTree<'_>,
        model: &Model,
        (kind, pixels, slots): (ExpandedKind, u64, usize),
    ) -> Result<Self, Error> {
        let tree = &model.tree;
        let most_triangles = model.triangles.len();
        let has_pieces = kind.are_filtered && model.kind().is_surface();
        let mut most_splats = cut::most_splats(model);
        if has_pieces {
            let records =
                device_tree::most_bound(gpu).saturating_sub(ALIGNMENT_ROOM) / kind.bytes() as u64;
            let room = (pixels, records.saturating_sub(SPARE_RECORDS));
            most_splats += pieces::most_pieces(most_splats, most_triangles as u64, room);
        }
        let groups = (0..tree.level_count()).map(|level| tree.level(level).len());
        let queue = bytes_of::<[u32; 2]>(groups.max().unwrap_or(0));
        let ids = (most_splats + SPARE_RECORDS) * size_of::<SplatId>() as u64;
        let records = (most_splats + SPARE_RECORDS) * kind.bytes() as u64;
        let indices = bytes_of::<[u32; 3]>(most_triangles + SPARE_RECORDS as usize);
        // Compute binds a list as a whole, and leaves room for alignment.
        let with_room = |bytes| bytes + ALIGNMENT_ROOM;
        device_tree::fits_bindings(gpu, [queue, ids, with_room(records), with_room(indices)])?;
        let lists = ids + records + indices;
        device_tree::fits_memory(gpu, on.tree.bytes() + 2 * queue + lists)?;
        let counters = bytes_of::<CutCounters>(1);
        let list = |name, bytes| DeviceBuffer::new(gpu, name, BufferUsage::List, bytes);
        Ok(Self {
            scene: on.scene.id(),
            are_points: !model.kind().is_surface(),
            levels: if tree.nodes.is_empty() {
                0
            } else {
                tree.level_count()
            },
            most_splats: most_splats as u32,
            most_triangles: most_triangles as u32,
            subpixel_bits: gpu.info().subpixel_bits,
            queues: [
                DeviceBuffer::new(gpu, "groups of even levels", BufferUsage::Storage, queue)?,
                DeviceBuffer::new(gpu, "groups of odd levels", BufferUsage::Storage, queue)?,
            ],
            ids: list("numbers of the device's cut", ids)?,
            records: list("splats of the device's cut", records)?,
            kind,
            indices: list("triangles of the device's cut", indices)?,
            small: [PageRange {
                page: 0,
                first: 0,
                count: 3 * (most_triangles as u32 + SPARE_RECORDS as u32),
            }],
            counters: list("counts of the device's cut", counters)?,
            pipelines: ChoicePipelines::new(gpu, has_pieces.then_some(pixels))?,
            read: (0..slots)
                .map(|slot| {
                    let name = format!("counts of the cut of frame {slot}");
                    ReadbackBuffer::new(gpu, &name, counters)
                })
                .collect::<Result<_, Error>>()?,
        })
    }

    /// Constants of the passes, of a frame's tester and view.
    pub(crate) fn constants(
        &self,
        tester: &cut::NodeTester,
        view: &View,
        rules: ChoiceRules,
    ) -> CutConstants {
        let precision = (view, self.subpixel_bits);
        let usual = tester.constants(precision, self.most_splats, self.most_triangles);
        let compute_ratio = match rules.by_compute {
            true => usual.ratio * rules.threshold_px / LARGEST_TRIANGLE_PX,
            false => 0.0,
        };
        CutConstants {
            compute_ratio,
            are_samples: usual.are_samples * u32::from(rules.are_samples),
            are_points: u32::from(self.are_points),
            draws_large_leaves: u32::from(rules.draws_large_leaves),
            are_oriented: u32::from(rules.are_oriented),
            room: self.room(),
            largest_px: rules.largest_px,
            names_triangles: u32::from(self.pipelines.pieces.is_some()),
            are_pieces: u32::from(rules.are_pieces),
            ..usual
        }
    }

    /// Passes `cut.tree`, `cut.leaves` and, where triangles may become filtered splats, `cut.pieces`: replaces the lists.
    pub(crate) fn choose(
        &self,
        frame: &mut FrameRecorder<'_>,
        on: SceneTree<'_>,
        constants: UniformBlock,
    ) {
        self.choose_nodes(frame, on.tree, constants);
        if let [page] = on.scene.pages.as_slice() {
            self.choose_leaves(frame, on.tree, page, constants);
            if let Some(pieces) = &self.pipelines.pieces {
                let lists = PieceLists {
                    counters: &self.counters,
                    ids: &self.ids,
                    indices: &self.indices,
                    close: &self.pipelines.close,
                };
                pieces.record(frame, on.tree, lists, constants);
            }
            self.count(frame);
        }
    }

    fn choose_nodes(
        &self,
        frame: &mut FrameRecorder<'_>,
        tree: &DeviceTree,
        constants: UniformBlock,
    ) {
        let whole = |buffer| BufferSlice::whole(buffer);
        let counters = whole(&self.counters);
        frame
            .pass("cut.tree")
            .storage_read(&tree.nodes)
            .storage_read(&tree.attributes)
            .storage(&self.queues[0])
            .storage(&self.queues[1])
            .storage(&self.ids)
            .storage(&self.counters)
            .compute(|compute| {
                compute.bind(
                    &self.pipelines.start,
                    &[constants],
                    &[counters, whole(&self.queues[0])],
                );
                compute.items(1);
                for level in 0..self.levels {
                    let (from, to) = (&self.queues[level % 2], &self.queues[(level + 1) % 2]);
                    compute.after();
                    compute.bind(
                        &self.pipelines.nodes,
                        &[constants],
                        &[
                            counters,
                            whole(from),
                            whole(&self.ids),
                            whole(&tree.nodes),
                            whole(&tree.attributes),
                            whole(to),
                        ],
                    );
                    compute.groups_from(&self.counters, LEVEL_GROUPS);
                    compute.after();
                    compute.bind(&self.pipelines.next, &[constants], &[counters]);
                    compute.items(1);
                }
            });
    }

    fn choose_leaves(
        &self,
        frame: &mut FrameRecorder<'_>,
        tree: &DeviceTree,
        page: &ScenePage,
        constants: UniformBlock,
    ) {
        let whole = |buffer| BufferSlice::whole(buffer);
        let counters = whole(&self.counters);
        let queue = &self.queues[self.levels % 2];
        frame
            .pass("cut.leaves")
            .storage_read(&tree.leaves)
            .storage_read(&tree.corners)
            .storage_read(&page.vertices)
            .storage_read(queue)
            .storage(&self.ids)
            .storage(&self.indices)
            .storage(&self.counters)
            .compute(|compute| {
                compute.after();
                compute.bind(
                    &self.pipelines.leaves,
                    &[constants],
                    &[
                        counters,
                        whole(queue),
                        whole(&self.ids),
                        whole(&tree.leaves),
                        whole(&tree.corners),
                        whole(&page.vertices),
                        whole(&self.indices),
                    ],
                );
                compute.groups_from(&self.counters, LEVEL_GROUPS);
                compute.after();
                let lists = [counters, whole(&self.ids), whole(&self.indices)];
                compute.bind(&self.pipelines.close, &[constants], &lists);
                compute.items(1);
            });
    }

    /// Pass `cut.counts`: reads back, for the time when the frame has finished, what the lists have.
    pub(crate) fn count(&self, frame: &mut FrameRecorder<'_>) {
        if let Some(read) = self.read.get(frame.slot()) {
            frame.read_back_buffer("cut.counts", &self.counters, read);
        }
    }

    /// Arguments of the dispatches over its splats and small triangles.
    fn groups(&self) -> ListGroups<'_> {
        let at = |offset: usize| ListArguments {
            buffer: &self.counters,
            offset: offset as u64,
        };
        ListGroups {
            splats: at(std::mem::offset_of!(CutCounters, splat_groups)),
            triangles: at(std::mem::offset_of!(CutCounters, small_groups)),
        }
    }

    /// The lists as compute draws opaque splats and triangles of a few pixels, within parts of the picture.
    pub(crate) fn compute_list<'a>(
        &'a self,
        scene: &'a DeviceScene,
        (variant, areas): (ComputeVariant, &'a [[u32; 4]]),
    ) -> ComputeList<'a> {
        ComputeList {
            scene,
            corners: &self.indices,
            runs: &self.small,
            splats: &self.records,
            splat_count: self.room(),
            sample_count: 0,
            variant,
            areas,
            groups: Some(self.groups()),
        }
    }

    /// Number of splats that its lists have room for.
    fn room(&self) -> u32 {
        self.most_splats + SPARE_RECORDS as u32
    }

    /// The numbers of its splats, and where their records go.
    pub(super) fn chosen_ids(&self) -> ChosenIds<'_> {
        ChosenIds {
            ids: &self.ids,
            records: &self.records,
            room: self.room(),
            groups: self.groups().splats,
            quads: self.kind.have_quads.then(|| self.quad_groups()),
        }
    }

    /// Arguments of a dispatch over its quads.
    fn quad_groups(&self) -> ListArguments<'_> {
        ListArguments {
            buffer: &self.counters,
            offset: std::mem::offset_of!(CutCounters, quad_groups) as u64,
        }
    }

    /// The triangles that compute does not draw.
    pub(crate) fn triangles(&self) -> RasterTriangles<'_> {
        let offset = std::mem::offset_of!(CutCounters, triangles) as u64;
        let arguments = ListArguments {
            buffer: &self.counters,
            offset,
        };
        RasterTriangles::Chosen(&self.indices, arguments)
    }

    /// The splats, as the rasterizer draws them.
    pub(crate) fn splats(&self) -> ChosenSplats<'_> {
        let at = |offset: usize| ListArguments {
            buffer: &self.counters,
            offset: offset as u64,
        };
        let quads = at(std::mem::offset_of!(CutCounters, quads));
        ChosenSplats {
            records: &self.records,
            room: self.room(),
            points: Some(at(std::mem::offset_of!(CutCounters, splats))),
            quads: self.kind.have_quads.then_some(quads),
            groups: self.groups().splats,
        }
    }

    /// Counts of the frame of a slot, which has finished.
    pub(crate) fn counts(&mut self, slot: usize) -> CutCounters {
        let read = self.read.get_mut(slot);
        read.map_or_else(CutCounters::default, |read| {
            bytemuck::pod_read_unaligned(&read.bytes()[..size_of::<CutCounters>()])
        })
    }
}

#[cfg(test)]
mod tests;
