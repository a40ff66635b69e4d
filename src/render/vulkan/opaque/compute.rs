//! Small primitives by compute: the picture of [`crate::render::vulkan::opaque::triangle_runs`]'s rasterized squares, discs, ellipses and triangles, at a
//! fraction of their cost where they are a few pixels large.
//!
//! A rasterizer sets every primitive up before it draws it, which on a software device takes some 65 to 150 ns whatever
//! its size. Here `compute.triangles` and `compute.splats` let each leave (depth, number) in the pixels it covers by a 64-bit
//! atomic maximum, and `compute.resolve` shades one of them a pixel. Source: Schütz, Kerbl and Wimmer, *Rendering Point
//! Clouds with Compute Shaders and Vertex Order Optimization* (Computer Graphics Forum, 2021). What is large, or reaches
//! the near plane, goes to the rasterizer.

pub(crate) use crate::render::vulkan::opaque::compute_variant::ComputeVariant;
use crate::render::vulkan::storage_ranges::{ComputeList, ListGroups};

use crate::abi::shaders;
use crate::abi::specialization::{ARE_DISCS, HAS_LAMP, LOOKS_FIRST, SIDE_PX};
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::{BufferUsage, DeviceBuffer};
use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord,
};
use crate::gpu::{Error, Gpu};
use crate::pack::Footprint;
use crate::render::compute_limits::storage_bytes;
use crate::render::screen_bounds;
use crate::render::technique::Technique;
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::storage_ranges::BoundItems;
use crate::render::vulkan::targets::{Context, FrameTargets};
use std::sync::Arc;

/// What shades what each pixel kept.
#[derive(Debug)]
struct ResolvePipelines {
    /// Flags of a frame in another light than the headlight, or that shows data; else none.
    lamp_flags: Option<u32>,
    splats: ShaderPipeline,
    triangles: ShaderPipeline,
}

/// Variants of [`ResolvePipelines`] that are kept.
const MOST_RESOLVE: usize = 8;

/// Pipelines and the buffer of the nearest, for one picture size.
#[derive(Debug)]
pub(crate) struct ComputeRasterizer {
    gpu: Arc<Gpu>,
    /// Pipelines that were asked for.
    splats: Vec<(ComputeVariant, ShaderPipeline)>,
    triangles: ShaderPipeline,
    /// Pipelines that were asked for, the last one last.
    resolve: Vec<ResolvePipelines>,
    keys: DeviceBuffer,
    max_binding: u64,
}

impl ResolvePipelines {
    /// # Errors
    /// When a Vulkan call fails.
    fn new(gpu: &Arc<Gpu>, lamp_flags: Option<u32>, targets: &FrameTargets) -> Result<Self, Error> {
        let normals = targets.normal().is_some();
        let pipeline = |name, fragment| {
            let description = PipelineDescription {
                name,
                vertex: &shaders::COMPUTE_RESOLVE_VERT,
                fragment: Some(fragment),
                constants: &[HAS_LAMP.is(lamp_flags.is_some())],
                record: VertexRecord::NOTHING,
                topology: PrimitiveTopology::Triangles,
                colors: targets.formats(),
                depth: DepthMode::Nearest,
                is_additive: false,
            };
            match lamp_flags {
                // The headlight asks few of them.
                None => ShaderPipeline::new(gpu, &description),
                Some(flags) => ShaderPipeline::for_flags(gpu, &description, flags),
            }
        };
        Ok(Self {
            lamp_flags,
            splats: pipeline(
                "compute.resolve splats",
                shaders::COMPUTE_RESOLVE_SPLATS_FRAG.of(normals),
            )?,
            triangles: pipeline(
                "compute.resolve triangles",
                shaders::COMPUTE_RESOLVE_TRIANGLES_FRAG.of(normals),
            )?,
        })
    }
}

impl ComputeRasterizer {
    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(crate) fn new(gpu: &Arc<Gpu>, targets: &FrameTargets) -> Result<Self, Error> {
        let (width, height) = (targets.color().width, targets.color().height);
        Ok(Self {
            gpu: gpu.clone(),
            splats: Vec::new(),
            triangles: ShaderPipeline::compute(
                gpu,
                "compute.triangles",
                &shaders::COMPUTE_TRIANGLES_COMP,
                &[],
            )?,
            resolve: Vec::new(),
            keys: DeviceBuffer::new(
                gpu,
                "nearest small primitives",
                BufferUsage::Storage,
                storage_bytes(Technique::Opaque, [width, height]),
            )?,
            max_binding: gpu.info().max_storage_range,
        })
    }

    /// Makes what shades pixels of frames in this light, outside of the frame; see [`ResolvePipelines`].
    ///
    /// # Errors
    /// When a Vulkan call fails.
    pub(crate) fn ensure_light(
        &mut self,
        lamp_flags: Option<u32>,
        targets: &FrameTargets,
    ) -> Result<(), Error> {
        let made = self.resolve.iter();
        let place = made.into_iter().position(|p| p.lamp_flags == lamp_flags);
        let pipelines = match place {
            Some(place) => self.resolve.remove(place),
            None => ResolvePipelines::new(&self.gpu, lamp_flags, targets)?,
        };
        if self.resolve.len() == MOST_RESOLVE {
            self.resolve.remove(0);
        }
        self.resolve.push(pipelines);
        Ok(())
    }

    /// Makes the pipeline of splats of a variant, outside of the frame.
    ///
    /// # Errors
    /// When a Vulkan call fails.
    pub(crate) fn ensure(&mut self, variant: ComputeVariant) -> Result<(), Error> {
        if self.splats.iter().any(|made| made.0 == variant) {
            return Ok(());
        }
        let gpu = &self.gpu;
        let looks_first = !gpu.info().is_cpu();
        let of_one_size = |name, are_discs| {
            let constants = [
                ARE_DISCS.is(are_discs),
                LOOKS_FIRST.is(looks_first),
                SIDE_PX.is(variant.side_px),
            ];
            ShaderPipeline::compute(gpu, name, &shaders::COMPUTE_SPLATS_COMP, &constants)
        };
        let pipeline = match variant.footprint {
            Footprint::Square => of_one_size("small squares", false)?,
            Footprint::Circle => of_one_size("small discs", true)?,
            Footprint::Oriented => ShaderPipeline::compute_for_flags(
                gpu,
                "small ellipses",
                &shaders::COMPUTE_ELLIPSES_COMP,
                &[LOOKS_FIRST.is(looks_first)],
                variant.flags,
            )?,
        };
        self.splats.push((variant, pipeline));
        Ok(())
    }

    /// Passes compute.clear, compute.triangles, compute.splats and compute.resolve.
    /// Keeps what the targets hold where it is nearer; where these passes are the first of the frame, that is nothing.
    ///
    /// # Errors
    /// When the frame has no room for the constants of so many parts.
    pub(crate) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: ComputeList<'_>,
        (context, is_first): (&Context, bool),
        constants: UniformBlock,
    ) -> Result<(), Error> {
        if list.is_empty() {
            return Ok(());
        }
        let items = list.bound(frame, context, self.max_binding)?;
        let BoundItems {
            splats, triangles, ..
        } = &items;
        let is_whole = splats.len() <= 1 && triangles.len() <= 1;
        assert!(
            list.groups.is_none() || is_whole,
            "chosen lists are bound whole"
        );
        let keys = BufferSlice::whole(&self.keys);
        frame.pass("compute.clear").fill(
            &[(&self.keys, 8 * screen_bounds::pixels(context.rect_px))],
            0,
        );
        if !triangles.is_empty() {
            let mut pass = frame
                .pass("compute.triangles")
                .storage_read(list.corners)
                .storage(&self.keys);
            for vertices in list.scene.vertex_buffers() {
                pass = pass.storage_read(vertices);
            }
            if let Some(groups) = list.groups {
                pass = pass.group_arguments(groups.triangles.buffer);
            }
            pass.compute(|compute| {
                for &((part, uniform, count), vertices) in triangles {
                    compute.bind(
                        &self.triangles,
                        &[constants, uniform],
                        &[part, vertices, keys],
                    );
                    match list.groups {
                        Some(ListGroups { triangles, .. }) => {
                            compute.groups_from(triangles.buffer, triangles.offset);
                        }
                        None => compute.items(count),
                    }
                }
            });
        }
        if !splats.is_empty() {
            let pipeline = |variant: ComputeVariant| {
                let made = self.splats.iter().find(|made| made.0 == variant);
                let Some((_, pipeline)) = made else {
                    unreachable!("ensure made the pipeline")
                };
                pipeline
            };
            let mut pass = frame
                .pass("compute.splats")
                .storage_read(list.splats)
                .storage(&self.keys);
            if let Some(groups) = list.groups {
                pass = pass.group_arguments(groups.splats.buffer);
            }
            pass.compute(|compute| {
                for &(variant, (part, uniform, count)) in splats {
                    compute.bind(pipeline(variant), &[constants, uniform], &[part, keys]);
                    match list.groups {
                        Some(ListGroups { splats, .. }) => {
                            compute.groups_from(splats.buffer, splats.offset);
                        }
                        None => compute.items(count),
                    }
                }
            });
        }
        self.resolve(
            frame,
            targets,
            &list,
            &items,
            (context, is_first),
            constants,
        );
        Ok(())
    }

    /// Pass compute.resolve: shades what each pixel kept.
    fn resolve(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: &ComputeList<'_>,
        items: &BoundItems<'_>,
        (context, is_first): (&Context, bool),
        constants: UniformBlock,
    ) {
        let keys = BufferSlice::whole(&self.keys);
        let Some(resolve) = self.resolve.last() else {
            unreachable!("ensure_light made the pipelines")
        };
        let mut pass = targets
            .attach_after(frame.pass("compute.resolve"), context, is_first)
            .fragment_storage(list.splats)
            .fragment_storage(list.corners)
            .fragment_storage(&self.keys);
        for vertices in list.scene.vertex_buffers() {
            pass = pass.fragment_storage(vertices);
        }
        pass.draw_whole(|draw| {
            for &((part, uniform, _), vertices) in &items.triangles {
                draw.bind_storage(
                    &resolve.triangles,
                    &[constants, uniform],
                    &[],
                    &[part, vertices, keys],
                );
                raster_pass::cover(draw, list.areas);
            }
            for &(part, uniform, _) in &items.all {
                draw.bind_storage(&resolve.splats, &[constants, uniform], &[], &[part, keys]);
                raster_pass::cover(draw, list.areas);
            }
        });
    }
}
