//! Filtered splats: every splat deposits the area it covers, the sum is the covered fraction of the pixel.
//!
//! Two-pass splatting (Benda, section 2.3.3; Rusinkiewicz and Levoy, section 3.3) with weights of our own
//! ([`crate::pack::filtered`]): `filtered.depth` finds the front surface and pushes it away by a splat's depth,
//! `filtered.blend` sums (color * weight, weight) of all that is not behind it, `filtered.normalize` divides.
//! Pass `filtered.surface` leaves the depth of the nearest splat as it lies, where looks or pictures need it.
//! The sums are 32-bit floats: a pixel adds up thousands of small weights, which 16 bits lose.

#[cfg(test)]
mod tests;

use crate::abi::specialization::{HAS_LAMP, IS_PUSHED, LARGE_ONLY};
use crate::abi::{FilteredSplat, shaders};
use crate::gpu::frame::{FrameRecorder, TargetLoad, UniformBlock};
use crate::gpu::image::{DeviceImage as Target, ImageFormat};
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord, record,
};
use crate::gpu::{Error, Gpu};
use crate::render::cost::choose::ComputeShare;
use crate::render::vulkan::VERTEX;
use crate::render::vulkan::blended::compute;
use crate::render::vulkan::blended::compute::{ComputeBlending, OwnConstants};
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::{RasterList, RasterPipelines, ScreenDraw};
use crate::render::vulkan::targets::color_formats;
use crate::render::vulkan::targets::{Context, FrameTargets};
use std::sync::Arc;

/// [`FilteredSplat`] as pipelines see it.
pub(crate) const RECORD: VertexRecord = record!(FilteredSplat {
    window_px: Float2,
    pushed_depth: Float,
    side_px: Float,
    depth: Float,
    area_px: Float,
    extent_px: Float2,
    color: Float3,
});

/// Format of the sums.
const SUMS: ImageFormat = ImageFormat::Rgba32Float;

/// Pipelines and the target of the sums, for one picture size.
#[derive(Debug)]
pub(crate) struct FilteredPasses {
    depth_triangles: ShaderPipeline,
    depth_splats: ShaderPipeline,
    surface_splats: ShaderPipeline,
    blend_triangles: ShaderPipeline,
    blend_splats: ShaderPipeline,
    normalize: ShaderPipeline,
    sums: Target,
    pub(crate) variant: FilteredVariant,
    by_compute: Option<ByCompute>,
}

/// What decides the pipelines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct FilteredVariant {
    /// A lamp instead of the headlight.
    pub(crate) has_lamp: bool,
    /// Of the picture.
    pub(crate) color: ImageFormat,
    /// Small splats are drawn by compute, all of them gray (true) or not.
    pub(crate) by_compute: Option<bool>,
    /// The scene has textures.
    pub(crate) has_textures: bool,
}

/// What draws small splats, and the pipelines that draw the others only.
#[derive(Debug)]
struct ByCompute {
    twin: ComputeBlending,
    depth_splats: ShaderPipeline,
    surface_splats: ShaderPipeline,
    blend_splats: ShaderPipeline,
}

/// What a frame draws.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FilteredLists<'a> {
    /// All of it, as the rasterizer draws it.
    pub(crate) raster: RasterList<'a>,
    /// Splats and small triangles for compute, where it draws any.
    pub(crate) small: Option<compute::ComputeInput<'a>>,
}

impl FilteredPasses {
    /// # Errors
    /// When the device cannot blend 32-bit floats, or memory runs out.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        (width, height): (u32, u32),
        variant: FilteredVariant,
    ) -> Result<Self, Error> {
        if !gpu.info().has_float_blend {
            return Err(Error::Unsupported {
                what: "filtered splats",
                why: format!("{} cannot blend into 32-bit float targets", gpu.info().name),
            });
        }
        let base = PipelineDescription {
            name: "",
            vertex: &shaders::FILTERED_DEPTH_VERT,
            fragment: None,
            constants: &[],
            record: RECORD,
            topology: PrimitiveTopology::Points,
            colors: &[],
            depth: DepthMode::Nearest,
            is_additive: false,
        };
        let blend = PipelineDescription {
            colors: &[SUMS],
            depth: DepthMode::TestOnly,
            is_additive: true,
            ..base
        };
        let of_depth = |name, value, is_pushed| {
            ShaderPipeline::new(
                gpu,
                &PipelineDescription {
                    name,
                    constants: &[LARGE_ONLY.is(value), IS_PUSHED.is(is_pushed)],
                    ..base
                },
            )
        };
        let depth_splats = |value| of_depth("filtered.depth splats", value, true);
        let surface_splats = |value| of_depth("filtered.surface splats", value, false);
        let blend_splats = |value| {
            ShaderPipeline::new(
                gpu,
                &PipelineDescription {
                    name: "filtered.blend splats",
                    vertex: &shaders::FILTERED_BLEND_VERT,
                    fragment: Some(&shaders::FILTERED_BLEND_FRAG),
                    constants: &[LARGE_ONLY.is(value)],
                    ..blend
                },
            )
        };
        let by_compute = match variant.by_compute {
            None => None,
            Some(is_gray) => Some(ByCompute {
                twin: ComputeBlending::new(
                    gpu,
                    &compute::FILTERED,
                    [width, height],
                    (is_gray, variant.has_lamp, variant.color),
                    OwnConstants {
                        depth: &[IS_PUSHED.is(true)],
                        surface: Some(&[IS_PUSHED.is(false)]),
                        ..OwnConstants::default()
                    },
                )?,
                depth_splats: depth_splats(true)?,
                surface_splats: surface_splats(true)?,
                blend_splats: blend_splats(true)?,
            }),
        };
        let (triangle, fragment) = match variant.has_textures {
            true => (
                &shaders::TRIANGLES_TEXTURED_VERT,
                &shaders::FILTERED_BLEND_TEXTURED_FRAG,
            ),
            false => (
                &shaders::TRIANGLES_DRAW_VERT,
                &shaders::FILTERED_BLEND_TRIANGLES_FRAG,
            ),
        };
        Ok(Self {
            depth_triangles: ShaderPipeline::new(
                gpu,
                &PipelineDescription {
                    name: "filtered.depth triangles",
                    // The blend pass has the same, so that a triangle is never behind itself.
                    vertex: &shaders::TRIANGLES_DRAW_VERT,
                    record: VERTEX,
                    topology: PrimitiveTopology::Triangles,
                    ..base
                },
            )?,
            depth_splats: depth_splats(false)?,
            surface_splats: surface_splats(false)?,
            blend_triangles: ShaderPipeline::new(
                gpu,
                &PipelineDescription {
                    name: "filtered.blend triangles",
                    vertex: triangle,
                    fragment: Some(fragment),
                    constants: &[HAS_LAMP.is(variant.has_lamp)],
                    record: VERTEX,
                    topology: PrimitiveTopology::Triangles,
                    ..blend
                },
            )?,
            blend_splats: blend_splats(false)?,
            normalize: ShaderPipeline::new(
                gpu,
                &PipelineDescription {
                    name: "filtered.normalize",
                    vertex: &shaders::FILTERED_NORMALIZE_VERT,
                    fragment: Some(&shaders::FILTERED_NORMALIZE_FRAG),
                    record: VertexRecord::NOTHING,
                    topology: PrimitiveTopology::Triangles,
                    colors: color_formats(variant.color, false),
                    depth: DepthMode::None,
                    ..base
                },
            )?,
            sums: Target::new(gpu, "sums", SUMS, width, height)?,
            variant,
            by_compute,
        })
    }

    /// The passes of a frame; compute draws its share only where the variant has it.
    ///
    /// # Errors
    /// When the frame has no room for the constants of its parts.
    pub(crate) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: FilteredLists<'_>,
        share: ComputeShare,
        context: &Context,
        constants: UniformBlock,
    ) -> Result<(), Error> {
        let all = &list.raster;
        let (Some(by_compute), Some(small), ComputeShare::Small | ComputeShare::All) =
            (&self.by_compute, list.small, share)
        else {
            self.raster_depth(frame, targets, all, &self.depth_splats, context, constants);
            self.raster_blend(frame, targets, all, &self.blend_splats, context, constants);
            self.normalize(frame, targets, context, constants);
            if context.reads_depth {
                self.raster_surface(
                    frame,
                    targets,
                    all,
                    &self.surface_splats,
                    context,
                    constants,
                );
            }
            return Ok(());
        };
        let ByCompute {
            twin,
            depth_splats,
            surface_splats,
            blend_splats,
        } = by_compute;
        let large = match share {
            ComputeShare::Small => *all,
            _ => all.only_triangles(),
        };
        let rastered = compute::RasterizedPart {
            depth: &|frame| {
                self.raster_depth(frame, targets, &large, depth_splats, context, constants);
            },
            blend: &|frame| {
                self.raster_blend(frame, targets, &large, blend_splats, context, constants);
            },
            surface: &|frame| {
                self.raster_surface(frame, targets, &large, surface_splats, context, constants);
            },
        };
        let rastered = ((!large.is_empty()).then_some(&rastered), &self.sums);
        twin.record(frame, targets, small, rastered, context, constants)
    }

    /// Pass `filtered.depth` by the rasterizer: the pushed depth of splats, that of triangles.
    fn raster_depth(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: &RasterList<'_>,
        splats: &ShaderPipeline,
        context: &Context,
        constants: UniformBlock,
    ) {
        let pass = frame
            .pass("filtered.depth")
            .depth(targets.depth(), TargetLoad::Clear([0.0; 4]));
        let pipelines = pipelines(&self.depth_triangles, splats);
        raster_pass::draw(pass, list, pipelines, context, constants);
    }

    /// Pass `filtered.surface` by the rasterizer: the depth of splats where they lie, nearer than what the passes before left.
    fn raster_surface(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: &RasterList<'_>,
        splats: &ShaderPipeline,
        context: &Context,
        constants: UniformBlock,
    ) {
        let pass = frame
            .pass("filtered.surface")
            .depth(targets.depth(), TargetLoad::Keep);
        let pipelines = pipelines(&self.depth_triangles, splats);
        raster_pass::draw(pass, &list.only_splats(), pipelines, context, constants);
    }

    /// Pass `filtered.blend` by the rasterizer: sums of what is not behind that depth.
    fn raster_blend(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: &RasterList<'_>,
        splats: &ShaderPipeline,
        context: &Context,
        constants: UniformBlock,
    ) {
        let pass = frame
            .pass("filtered.blend")
            .color(&self.sums, TargetLoad::Clear([0.0; 4]))
            .depth_test(targets.depth());
        let pipelines = RasterPipelines {
            reads_textures: self.variant.has_textures,
            ..pipelines(&self.blend_triangles, splats)
        };
        raster_pass::draw(pass, list, pipelines, context, constants);
    }

    /// Pass `filtered.normalize` of what was rastered.
    fn normalize(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        context: &Context,
        constants: UniformBlock,
    ) {
        let [r, g, b] = context.background;
        let pass = frame
            .pass("filtered.normalize")
            .color(targets.color(), TargetLoad::Clear([r, g, b, 0.0]));
        let (uniforms, images) = ([constants], [&self.sums, targets.depth()]);
        let screen = ScreenDraw::of_images(&self.normalize, &uniforms, &images);
        raster_pass::full_screen(pass, &screen, context.rect_px);
    }
}

/// What draws a list: filtered splats are points, however large.
fn pipelines<'a>(triangles: &'a ShaderPipeline, splats: &'a ShaderPipeline) -> RasterPipelines<'a> {
    RasterPipelines {
        triangles: Some(triangles),
        points: Some(splats),
        ..RasterPipelines::default()
    }
}
