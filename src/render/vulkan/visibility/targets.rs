//! What the passes of visibility splats draw into.

use crate::abi::{CompiledShader, shaders};
use crate::gpu::frame::{FrameRecorder, PassBuilder, TargetLoad};
use crate::gpu::image::ImageFormat;
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord,
};
use crate::gpu::{Error, Gpu};
use crate::render::vulkan::COLOR;
use crate::render::vulkan::targets::{Context, FrameTargets, color_formats};
use std::sync::Arc;

/// Colors, with the class in alpha.
pub(crate) const PICKED: ImageFormat = ImageFormat::Rgba8;
/// Distance along the view direction and depth offset.
pub(crate) const FRONTS: ImageFormat = ImageFormat::Rg32Float;

/// A pass over the whole picture that ends it.
pub(crate) fn last_pass(
    gpu: &Arc<Gpu>,
    name: &str,
    fragment: &CompiledShader,
) -> Result<ShaderPipeline, Error> {
    ShaderPipeline::new(
        gpu,
        &PipelineDescription {
            name,
            vertex: &shaders::FILTERED_NORMALIZE_VERT,
            fragment: Some(fragment),
            constants: &[],
            record: VertexRecord::NOTHING,
            topology: PrimitiveTopology::Triangles,
            colors: color_formats(COLOR, false),
            depth: DepthMode::Nearest,
            is_additive: false,
        },
    )
}

/// The description of a pass that ends the picture: color and depth anew.
pub(crate) fn attach_last<'f>(
    frame: &'f mut FrameRecorder<'_>,
    name: &'static str,
    targets: &FrameTargets,
    context: &Context,
) -> PassBuilder<'f> {
    let [r, g, b] = context.background;
    frame
        .pass(name)
        .color(targets.color(), TargetLoad::Clear([r, g, b, 0.0]))
        .depth(targets.depth(), TargetLoad::Clear([0.0; 4]))
}
