//! POP: triangles where they are large on screen, splats ([`crate::render::vulkan::opaque::hardware`]) where they are small.
//!
//! Source: Benda, *Point Based Rendering*, section 3.3. Both kinds go into one color and one depth target;
//! triangles come first, so that the depth test spares the splats behind them.

pub(crate) use crate::render::vulkan::raster_pass::PageRange;

use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::pipeline::ShaderPipeline;
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::{RasterList, RasterPipelines};
use crate::render::vulkan::targets::{Context, FrameTargets};

/// Pass `opaque.triangles`: the leaves that are large on screen. Clears the targets. A frame without any begins with the pass
/// after it.
pub(crate) fn record_triangles(
    frame: &mut FrameRecorder<'_>,
    pipeline: &ShaderPipeline,
    targets: &FrameTargets,
    list: &RasterList<'_>,
    context: &Context,
    constants: UniformBlock,
) {
    let pipelines = RasterPipelines {
        triangles: Some(pipeline),
        reads_textures: list.scene.is_textured(),
        ..RasterPipelines::default()
    };
    let pass = targets.attach(frame.pass("opaque.triangles"), context);
    raster_pass::draw(pass, &list.only_triangles(), pipelines, context, constants);
}
