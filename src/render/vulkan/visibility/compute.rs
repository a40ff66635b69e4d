//! The first two passes by compute: atomics in the place of the depth tests.
//!
//! `visibility.splats` leaves (pushed depth, number) of each footprint in the pixels that it covers, and (depth, number) of
//! each center in its own; `visibility.resolve` shades one splat a pixel. A rasterizer sets every splat up twice, which a
//! software device does in some 130 ns each, and shades all that pass. Triangles, and splats that are too large, are left
//! to the passes of the rasterizer. Splats from vertices are left by `visibility.polygons` as their footprints and middles.

use crate::abi::specialization::LOOKS_FIRST;
use crate::abi::{OrientedPolygon, Splat, shaders};
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::{AnyBuffer, BufferUsage, DeviceBuffer};
use crate::gpu::frame::{FrameRecorder, TargetLoad, UniformBlock};
use crate::gpu::image::DeviceImage as Target;
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord,
};
use crate::gpu::{Error, Gpu};
use crate::render::compute_limits::storage_bytes;
use crate::render::screen_bounds;
use crate::render::technique::Technique;
use crate::render::vulkan::NORMAL;
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::{ChosenSplats, ListArguments, RecordRange};
use crate::render::vulkan::storage_ranges;
use crate::render::vulkan::targets::{Context, FrameTargets};
use crate::render::vulkan::visibility::targets::{FRONTS, PICKED};
use std::sync::Arc;

/// Kind of the splats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum VisibleKind {
    /// Of a tree.
    Splats,
    /// From vertices.
    Polygons,
}

impl VisibleKind {
    /// Name of the pass that leaves them.
    fn pass(self) -> &'static str {
        match self {
            Self::Splats => "visibility.splats",
            Self::Polygons => "visibility.polygons",
        }
    }

    /// Bytes of a record, and invocations that share one.
    const fn record(self) -> (u64, u32) {
        match self {
            Self::Splats => (size_of::<Splat>() as u64, 1),
            Self::Polygons => (size_of::<OrientedPolygon>() as u64, 32),
        }
    }
}

/// A list that fits one binding has room for the invocations that share its items.
const _: () = {
    let (bytes, sharers) = VisibleKind::Polygons.record();
    assert!(u32::MAX as u64 / sharers as u64 > (1 << 32) / bytes);
};

/// Targets of the first two passes.
#[derive(Debug, Clone, Copy)]
pub(super) struct VisibilityTargets<'a> {
    pub(super) targets: &'a FrameTargets,
    pub(super) picked: &'a Target,
    pub(super) fronts: &'a Target,
}

/// Records of a list that compute draws.
#[derive(Debug, Clone, Copy)]
pub(super) struct VisibleList<'a> {
    records: &'a dyn AnyBuffer,
    /// Number of them; where the device says how many workgroups draw them, of those that there is room for.
    count: u32,
    /// Arguments of the dispatch over records that the device chose.
    groups: Option<ListArguments<'a>>,
}

impl<'a> VisibleList<'a> {
    /// The first `count` records of a list.
    pub(super) fn of(records: &'a dyn AnyBuffer, count: u32) -> Self {
        Self {
            records,
            count,
            groups: None,
        }
    }

    /// Records that the device chose.
    pub(super) fn chosen(chosen: &ChosenSplats<'a>) -> Self {
        Self {
            records: chosen.records,
            count: chosen.room,
            groups: Some(chosen.groups),
        }
    }
}

/// Pipelines of one kind, and what is kept of each pixel.
#[derive(Debug)]
pub(super) struct ComputeVisibility {
    pub(super) kind: VisibleKind,
    splats: ShaderPipeline,
    resolve: ShaderPipeline,
    footprints: DeviceBuffer,
    centers: DeviceBuffer,
    max_binding: u64,
}

impl ComputeVisibility {
    /// For frames of these flags.
    ///
    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        kind: VisibleKind,
        (normals, flags): (bool, u32),
        size: [u32; 2],
    ) -> Result<Self, Error> {
        let (leaves, shades) = match kind {
            VisibleKind::Splats => (
                &shaders::VISIBILITY_SPLATS_COMP,
                shaders::VISIBILITY_RESOLVE_FRAG,
            ),
            VisibleKind::Polygons => (
                &shaders::VISIBILITY_POLYGONS_COMP,
                shaders::VISIBILITY_RESOLVE_POLYGONS_FRAG,
            ),
        };
        let looks_first = !gpu.info().is_cpu();
        let formats = [PICKED, FRONTS, NORMAL];
        let bytes = storage_bytes(Technique::Visibility, size);
        let storage = |name| DeviceBuffer::new(gpu, name, BufferUsage::Storage, bytes);
        Ok(Self {
            kind,
            splats: ShaderPipeline::compute_for_flags(
                gpu,
                kind.pass(),
                leaves,
                &[LOOKS_FIRST.is(looks_first)],
                flags,
            )?,
            resolve: ShaderPipeline::for_flags(
                gpu,
                &PipelineDescription {
                    name: "visibility.resolve",
                    vertex: &shaders::COMPUTE_RESOLVE_VERT,
                    fragment: Some(shades.of(normals)),
                    constants: &[],
                    record: VertexRecord::NOTHING,
                    topology: PrimitiveTopology::Triangles,
                    colors: &formats[..if normals { 3 } else { 2 }],
                    depth: DepthMode::NotFarther,
                    is_additive: false,
                },
                flags,
            )?,
            footprints: storage("nearest footprints")?,
            centers: storage("nearest centers")?,
            max_binding: gpu.info().max_storage_range,
        })
    }

    /// Passes visibility.clear, the one of its kind and visibility.resolve. Keeps what
    /// the targets hold where it is nearer, if the rasterizer drew before (`is_first`: it did not).
    ///
    /// # Errors
    /// When the frame has no room for the constants of so many parts.
    pub(super) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        onto: VisibilityTargets<'_>,
        drawn: VisibleList<'_>,
        (areas, is_first): (&[[u32; 4]], bool),
        context: &Context,
        constants: UniformBlock,
    ) -> Result<(), Error> {
        let VisibilityTargets {
            targets,
            picked,
            fronts,
        } = onto;
        let VisibleList {
            records,
            count,
            groups,
        } = drawn;
        let (bytes, sharers) = self.kind.record();
        let list = (records, bytes);
        let range = RecordRange { first: 0, count };
        let parts = storage_ranges::bound(frame, context, self.max_binding, list, range)?;
        assert!(
            groups.is_none() || (parts.len() <= 1 && sharers == 1),
            "chosen lists are bound whole"
        );
        let kept = [&self.footprints, &self.centers].map(|buffer| BufferSlice::whole(buffer));
        let bytes = 8 * screen_bounds::pixels(context.rect_px);
        frame
            .pass("visibility.clear")
            .fill(&[(&self.footprints, bytes), (&self.centers, bytes)], 0);
        let mut pass = frame
            .pass(self.kind.pass())
            .storage_read(records)
            .storage(&self.footprints)
            .storage(&self.centers);
        if let Some(groups) = groups {
            pass = pass.group_arguments(groups.buffer);
        }
        pass.compute(|compute| {
            for &(part, uniform, count) in &parts {
                let storage = [part, kept[0], kept[1]];
                compute.bind(&self.splats, &[constants, uniform], &storage);
                match groups {
                    Some(groups) => compute.groups_from(groups.buffer, groups.offset),
                    None => compute.items(count * sharers),
                }
            }
        });
        let load = || match is_first {
            true => TargetLoad::Clear([0.0; 4]),
            false => TargetLoad::Keep,
        };
        let mut pass = frame
            .pass("visibility.resolve")
            .color(picked, load())
            .color(fronts, load());
        if let Some(normal) = targets.normal() {
            pass = pass.color(normal, load());
        }
        pass.depth(targets.depth(), load())
            .fragment_storage(records)
            .fragment_storage(&self.footprints)
            .fragment_storage(&self.centers)
            .draw_whole(|draw| {
                for &(part, uniform, _) in &parts {
                    let storage = [part, kept[0], kept[1]];
                    draw.bind_storage(&self.resolve, &[constants, uniform], &[], &storage);
                    raster_pass::cover(draw, areas);
                }
            });
        Ok(())
    }
}
