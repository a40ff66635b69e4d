//! POP: triangles where they are large on screen, splats ([`crate::render::vulkan::opaque::hardware`]) where they are small.
//!
//! Source: Benda, *Point Based Rendering*, section 3.3. Both kinds go into one color and one depth target;
//! triangles come first, so that the depth test spares the splats behind them.

pub(crate) use crate::render::vulkan::raster_pass::Run;

use crate::gpu::buffer::AnyBuffer;
use crate::gpu::frame::{Draw, Frame, Uniform};
use crate::gpu::pipeline::Pipeline;
use crate::render::vulkan::scene::Scene;
use crate::render::vulkan::targets::{Context, Targets};

/// Pass `hybrid.triangles`: the leaves that are large on screen. Clears the targets. A frame without any begins with the pass
/// after it.
pub(crate) fn record_triangles(
    frame: &mut Frame<'_>,
    pipeline: &Pipeline,
    targets: &Targets,
    scene: &Scene,
    (indices, runs): (&dyn AnyBuffer, &[Run]),
    context: &Context,
    constants: Uniform,
) {
    let mut pass = targets
        .attach(frame.pass("hybrid.triangles"), context)
        .indices(indices);
    for page in &scene.pages {
        pass = pass.vertices(&page.vertices);
    }
    pass.draw(context.viewport(), |draw| {
        draw_runs(draw, pipeline, scene, (indices, runs), context, constants);
    });
}

/// Draws triangles of a list, if there are any, in a pass that has declared it and the pages of the scene.
pub(crate) fn draw_runs(
    draw: &mut Draw<'_>,
    pipeline: &Pipeline,
    scene: &Scene,
    (indices, runs): (&dyn AnyBuffer, &[Run]),
    context: &Context,
    constants: Uniform,
) {
    if runs.is_empty() {
        return;
    }
    draw.cull_back_faces(context.cull_back, context.is_mirrored);
    draw.bind(pipeline, &[constants], &[]);
    draw.indices(indices, 0);
    for run in runs {
        draw.vertices(&scene.pages[run.page].vertices, 0);
        draw.draw_indexed(run.first, run.count, 0);
    }
}
