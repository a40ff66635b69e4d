//! Passes over the finished picture: those that darken pixels by the depths around them (eye-dome lighting and ambient occlusion),
//! and the background that changes from top to bottom. They work with every technique, since all leave colors and depths.

use crate::abi::{CompiledShader, shaders};
use crate::gpu::frame::{FrameRecorder, TargetLoad, UniformBlock};
use crate::gpu::image::DeviceImage as Target;
use crate::gpu::pipeline::ShaderPipeline;
use crate::gpu::{Error, Gpu};
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::{ScreenDraw, screen_description};
use crate::render::vulkan::targets::{Context, FrameTargets};
use std::sync::Arc;

/// What such a pass changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LookRule {
    /// Pixels that lie behind their neighbors are darkened.
    EyeDome,
    /// Pixels whose sky is hidden by what is around them are darkened.
    AmbientOcclusion,
    /// The background changes from top to bottom.
    Background,
}

/// The pipeline and the picture that it makes.
#[derive(Debug)]
pub(crate) struct LookPass {
    rule: LookRule,
    pipeline: ShaderPipeline,
    picture: Target,
}

impl LookRule {
    fn name(self) -> &'static str {
        match self {
            Self::EyeDome => "look.eye_dome",
            Self::AmbientOcclusion => "look.ambient_occlusion",
            Self::Background => "look.background",
        }
    }

    fn shader(self) -> &'static CompiledShader {
        match self {
            Self::EyeDome => &shaders::LOOK_EYE_DOME_FRAG,
            Self::AmbientOcclusion => &shaders::LOOK_AMBIENT_OCCLUSION_FRAG,
            Self::Background => &shaders::LOOK_BACKGROUND_FRAG,
        }
    }
}

impl LookPass {
    /// For pictures like those of `of`.
    ///
    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(crate) fn new(rule: LookRule, gpu: &Arc<Gpu>, of: &FrameTargets) -> Result<Self, Error> {
        let color = of.color();
        let description = screen_description((rule.name(), rule.shader()), &[], color.format);
        Ok(Self {
            rule,
            pipeline: ShaderPipeline::new(gpu, &description)?,
            picture: Target::new(gpu, "looked color", color.format, color.width, color.height)?,
        })
    }

    /// Records the pass, which reads a picture, and to darken it the depth of the targets.
    pub(crate) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        (picture, targets): (&Target, &FrameTargets),
        context: &Context,
        constants: UniformBlock,
    ) {
        let [r, g, b] = context.background;
        let pass = frame
            .pass(self.rule.name())
            .color(&self.picture, TargetLoad::Clear([r, g, b, 0.0]));
        let (uniforms, images) = ([constants], [picture, targets.depth()]);
        let (images, rect_px) = match self.rule {
            LookRule::Background => (&images[..1], context.whole_px()),
            LookRule::EyeDome | LookRule::AmbientOcclusion => (&images[..], context.rect_px),
        };
        let screen = ScreenDraw::of_images(&self.pipeline, &uniforms, images);
        raster_pass::full_screen(pass, &screen, rect_px);
    }

    /// The picture of the last frame that had this pass.
    pub(crate) fn picture(&self) -> &Target {
        &self.picture
    }
}
