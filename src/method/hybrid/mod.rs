//! POP: triangles where they are large on screen, square splats where they are small.
//!
//! Source: Benda, *Point Based Rendering*, section 3.3. Both kinds go into one color and one depth target;
//! triangles come first, so that the depth test spares the splats behind them.

use super::SPLAT;
use super::scene::Scene;
use super::targets::{Context, Targets};
use super::triangles::targets;
use crate::abi::shaders;
use crate::gpu::buffer::Upload;
use crate::gpu::frame::{Frame, Load, Uniform};
use crate::gpu::pipeline::{Depth, Description, Pipeline, Topology};
use crate::gpu::{Error, Gpu};
use std::sync::Arc;

/// The pipeline that draws splat records as squares.
pub(crate) fn splat_pipeline(gpu: &Arc<Gpu>, normals: bool) -> Result<Pipeline, Error> {
    Pipeline::new(
        gpu,
        &Description {
            name: "splats.square",
            vertex: &shaders::SPLATS_SQUARE_VERT,
            fragment: Some(&shaders::POINTS_DRAW_FRAG),
            constants: &[normals],
            record: SPLAT,
            topology: Topology::Points,
            colors: targets(normals),
            depth: Depth::Nearest,
            is_additive: false,
        },
    )
}

/// A run of indices in the draw list that belongs to one page.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run {
    /// Page of the scene.
    pub(crate) page: usize,
    /// First index.
    pub(crate) first: u32,
    /// Number of indices.
    pub(crate) count: u32,
}

/// Pass `hybrid.triangles`: the leaves that are large on screen. Clears the targets.
pub(crate) fn record_triangles(
    frame: &mut Frame<'_>,
    pipeline: &Pipeline,
    targets: &Targets,
    scene: &Scene,
    (indices, runs): (&Upload, &[Run]),
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
    });
}

/// Pass `hybrid.splats`: everything else. Keeps what the triangles left.
pub(crate) fn record_splats(
    frame: &mut Frame<'_>,
    pipeline: &Pipeline,
    targets: &Targets,
    (splats, count): (&Upload, u32),
    context: &Context,
    constants: Uniform,
) {
    if count == 0 {
        return;
    }
    let pass = targets
        .attach_with(frame.pass("hybrid.splats"), context, |_| Load::Keep)
        .vertices(splats);
    pass.draw(context.viewport(), |draw| {
        draw.cull_back_faces(false, false);
        draw.bind(pipeline, &[constants], &[]);
        draw.vertices(splats, 0);
        draw.draw(0, count);
    });
}
