//! Oriented polygons by compute: the picture of [`PolygonPasses`](crate::render::vulkan::opaque::polygons::PolygonPasses), with
//! a 64-bit atomic maximum of depth and number in the place of the rasterizer.
//!
//! `polygons.nearest` goes over the pixels around each polygon, a workgroup a polygon, and asks each whether its ray meets it.
//! `polygons.resolve` shades the one that a pixel kept, once.

use crate::abi::specialization::{ARE_PATCHES, LOOKS_FIRST};
use crate::abi::{OrientedPolygon, shaders};
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::{BufferUsage, DeviceBuffer};
use crate::gpu::frame::{FrameRecorder, PassBuilder, UniformBlock};
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord,
};
use crate::gpu::{Error, Gpu};
use crate::render::compute_limits::storage_bytes;
use crate::render::screen_bounds;
use crate::render::technique::Technique;
use crate::render::vulkan::opaque::polygon_variant::{
    PolygonKind, PolygonRecords, PolygonRun, PolygonVariant,
};
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::storage_ranges;
use crate::render::vulkan::storage_ranges::BoundRange;
use crate::render::vulkan::targets::{Context, FrameTargets};
use std::sync::Arc;

/// Invocations that share a polygon: the workgroup of the shader.
const SHARERS: u32 = 32;

/// A part of a list that is bound, and images that its patches show.
type BoundRun<'a> = (BoundRange<'a>, Option<[BufferSlice<'a>; 2]>);

/// Pipelines of one kind of polygons, and the buffer of the nearest, for one picture size.
#[derive(Debug)]
pub(crate) struct PolygonCompute {
    nearest: ShaderPipeline,
    resolve: ShaderPipeline,
    keys: DeviceBuffer,
    max_binding: u64,
}

impl PolygonCompute {
    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        variant: PolygonVariant,
        targets: &FrameTargets,
    ) -> Result<Self, Error> {
        let PolygonVariant { kind, flags, .. } = variant;
        let resolve = match variant.has_textures {
            true => shaders::POLYGONS_RESOLVE_TEXTURED_FRAG,
            false => shaders::POLYGONS_RESOLVE_FRAG,
        };
        let are_patches = ARE_PATCHES.is(kind == PolygonKind::Patches);
        let looks_first = LOOKS_FIRST.is(!gpu.info().is_cpu());
        let description = PipelineDescription {
            name: "polygons.resolve",
            vertex: &shaders::COMPUTE_RESOLVE_VERT,
            fragment: Some(resolve.of(targets.normal().is_some())),
            constants: &[are_patches],
            record: VertexRecord::NOTHING,
            topology: PrimitiveTopology::Triangles,
            colors: targets.numbered_formats(),
            depth: DepthMode::Nearest,
            is_additive: false,
        };
        let size = [targets.color().width, targets.color().height];
        Ok(Self {
            nearest: ShaderPipeline::compute_for_flags(
                gpu,
                "polygons.nearest",
                &shaders::POLYGONS_NEAREST_COMP,
                &[are_patches, looks_first],
                flags,
            )?,
            resolve: ShaderPipeline::for_flags(gpu, &description, flags)?,
            keys: DeviceBuffer::new(
                gpu,
                "nearest polygons",
                BufferUsage::Storage,
                storage_bytes(Technique::Polygons, size),
            )?,
            max_binding: gpu.info().max_storage_range,
        })
    }

    /// Passes polygons.clear and polygons.nearest: so many polygons of a list, at least one. Gives the parts of the list that the
    /// next pass binds.
    ///
    /// # Errors
    /// When the frame has no room for the constants of so many parts.
    pub(crate) fn record<'a>(
        &self,
        frame: &mut FrameRecorder<'_>,
        list: &PolygonRecords<'a>,
        context: &Context,
        constants: UniformBlock,
    ) -> Result<Vec<BoundRun<'a>>, Error> {
        let polygons = list.polygons;
        let records = (polygons, size_of::<OrientedPolygon>() as u64);
        let mut parts = Vec::new();
        for PolygonRun { range, images } in list.runs() {
            let own = storage_ranges::bound(frame, context, self.max_binding, records, range)?;
            parts.extend(own.into_iter().map(|part| (part, images)));
        }
        let keys = BufferSlice::whole(&self.keys);
        let bytes = 8 * screen_bounds::pixels(context.rect_px);
        frame.pass("polygons.clear").fill(&[(&self.keys, bytes)], 0);
        let pass = frame
            .pass("polygons.nearest")
            .storage_read(polygons)
            .storage(&self.keys);
        pass.compute(|compute| {
            for &((part, uniform, count), _) in &parts {
                compute.bind(&self.nearest, &[constants, uniform], &[part, keys]);
                compute.items(count * SHARERS);
            }
        });
        Ok(parts)
    }

    /// Pass polygons.resolve, whose targets are attached. Keeps what they hold where it is nearer.
    pub(crate) fn resolve(
        &self,
        pass: PassBuilder<'_>,
        list: &PolygonRecords<'_>,
        (parts, context): (&[BoundRun<'_>], &Context),
        constants: UniformBlock,
    ) {
        let keys = BufferSlice::whole(&self.keys);
        let pass = pass
            .fragment_storage(list.polygons)
            .fragment_storage(&self.keys);
        list.declared(pass).draw_whole(|draw| {
            for &((part, uniform, _), images) in parts {
                let uniforms = [constants, uniform];
                let mut storage = vec![part, keys];
                storage.extend(images.into_iter().flatten());
                draw.bind_storage(&self.resolve, &uniforms, &[], &storage);
                raster_pass::cover(draw, &[context.rect_px]);
            }
        });
    }
}

/// A list that fits one binding has room for its shared items.
const _: () =
    assert!(u32::MAX as usize / SHARERS as usize > (1 << 32) / size_of::<OrientedPolygon>());
