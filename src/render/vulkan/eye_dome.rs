//! Eye-dome lighting: a pass over the finished picture that darkens pixels whose neighbors are nearer. It works with every
//! technique, since all leave colors and depths.

use crate::abi::shaders;
use crate::gpu::frame::{FrameRecorder, TargetLoad, UniformBlock};
use crate::gpu::image::DeviceImage as Target;
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord,
};
use crate::gpu::{Error, Gpu};
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::ScreenDraw;
use crate::render::vulkan::targets::color_formats;
use crate::render::vulkan::targets::{Context, FrameTargets};
use std::sync::Arc;

/// The pipeline and the picture that it makes.
#[derive(Debug)]
pub(crate) struct EyeDomePass {
    pipeline: ShaderPipeline,
    picture: Target,
}

impl EyeDomePass {
    /// For pictures like those of `of`.
    ///
    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(crate) fn new(gpu: &Arc<Gpu>, of: &FrameTargets) -> Result<Self, Error> {
        let color = of.color();
        let description = PipelineDescription {
            name: "look.eye_dome",
            vertex: &shaders::FILTERED_NORMALIZE_VERT,
            fragment: Some(&shaders::LOOK_EYE_DOME_FRAG),
            constants: &[],
            record: VertexRecord::NOTHING,
            topology: PrimitiveTopology::Triangles,
            colors: color_formats(color.format, false),
            depth: DepthMode::None,
            is_additive: false,
        };
        Ok(Self {
            pipeline: ShaderPipeline::new(gpu, &description)?,
            picture: Target::new(
                gpu,
                "darkened color",
                color.format,
                color.width,
                color.height,
            )?,
        })
    }

    /// Records pass look.eye_dome, which reads color and depth of the targets.
    pub(crate) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        context: &Context,
        constants: UniformBlock,
    ) {
        let [r, g, b] = context.background;
        let pass = frame
            .pass("look.eye_dome")
            .color(&self.picture, TargetLoad::Clear([r, g, b, 0.0]));
        let (uniforms, images) = ([constants], [targets.color(), targets.depth()]);
        let screen = ScreenDraw::of_images(&self.pipeline, &uniforms, &images);
        raster_pass::full_screen(pass, &screen, context.rect_px);
    }

    /// The darkened picture of the last frame that was.
    pub(crate) fn picture(&self) -> &Target {
        &self.picture
    }
}
