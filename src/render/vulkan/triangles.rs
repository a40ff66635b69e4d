//! Every triangle of the mesh: the reference that the other methods are compared with.

use crate::abi::shaders;
use crate::abi::specialization::{HAS_COLORS, HAS_LAMP};
use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::image::ImageFormat;
use crate::gpu::pipeline::{DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline};
use crate::gpu::{Error, Gpu};
use crate::render::vulkan::VERTEX;
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::{
    RasterList, RasterPipelines, RasterSplats, RasterTriangles,
};
use crate::render::vulkan::scene::DeviceScene;
use crate::render::vulkan::targets::{Context, FrameTargets, color_formats};
use std::sync::Arc;

/// Variant of the triangle pipeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TriangleVariant {
    pub(crate) color: ImageFormat,
    pub(crate) normals: bool,
    pub(crate) colors: bool,
    /// A lamp instead of the headlight.
    pub(crate) lamp: bool,
    /// The scene has textures.
    pub(crate) textures: bool,
    /// Flags of the frame.
    pub(crate) flags: u32,
}

/// The pipeline that draws indexed mesh triangles.
pub(crate) fn pipeline(gpu: &Arc<Gpu>, variant: TriangleVariant) -> Result<ShaderPipeline, Error> {
    let (vertex, fragment) = match variant.textures {
        true => (
            &shaders::TRIANGLES_TEXTURED_VERT,
            shaders::TRIANGLES_TEXTURED_FRAG,
        ),
        false => (&shaders::TRIANGLES_DRAW_VERT, shaders::TRIANGLES_DRAW_FRAG),
    };
    ShaderPipeline::for_flags(
        gpu,
        &PipelineDescription {
            name: "triangles.draw",
            vertex,
            fragment: Some(fragment.of(variant.normals)),
            constants: &[HAS_COLORS.is(variant.colors), HAS_LAMP.is(variant.lamp)],
            record: VERTEX,
            topology: PrimitiveTopology::Triangles,
            colors: color_formats(variant.color, variant.normals),
            depth: DepthMode::Nearest,
            is_additive: false,
        },
        variant.flags,
    )
}

/// Pass `triangles.draw`: all triangles of all pages.
pub(crate) fn record(
    frame: &mut FrameRecorder<'_>,
    pipeline: &ShaderPipeline,
    targets: &FrameTargets,
    scene: &DeviceScene,
    context: &Context,
    constants: UniformBlock,
) {
    let list = RasterList {
        scene,
        triangles: RasterTriangles::Scene,
        splats: RasterSplats::Nothing,
    };
    let pipelines = RasterPipelines {
        triangles: Some(pipeline),
        reads_textures: scene.is_textured(),
        ..RasterPipelines::default()
    };
    let pass = targets.attach(frame.pass("triangles.draw"), context);
    raster_pass::draw(pass, &list, pipelines, context, constants);
}
