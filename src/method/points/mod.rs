//! Every vertex as a square of constant size: what a viewer without a tree does with a scan.

use super::VERTEX;
use super::scene::Scene;
use super::targets::{Context, Targets};
use super::triangles::targets;
use crate::abi::shaders;
use crate::gpu::frame::{Frame, Uniform};
use crate::gpu::pipeline::{Depth, Description, Pipeline, Topology};
use crate::gpu::{Error, Gpu};
use std::sync::Arc;

/// The pipeline that draws vertices as points.
pub(crate) fn pipeline(gpu: &Arc<Gpu>, normals: bool) -> Result<Pipeline, Error> {
    Pipeline::new(
        gpu,
        &Description {
            name: "points.draw",
            vertex: &shaders::POINTS_DRAW_VERT,
            fragment: Some(&shaders::POINTS_DRAW_FRAG),
            constants: &[normals],
            record: VERTEX,
            topology: Topology::Points,
            colors: targets(normals),
            depth: Depth::Nearest,
            is_additive: false,
        },
    )
}

/// Pass `points.draw`: all used vertices of all pages.
pub(crate) fn record(
    frame: &mut Frame<'_>,
    pipeline: &Pipeline,
    targets: &Targets,
    scene: &Scene,
    context: &Context,
    constants: Uniform,
) {
    let mut pass = targets.attach(frame.pass("points.draw"), context);
    for page in &scene.pages {
        pass = pass.vertices(&page.vertices);
    }
    pass.draw(context.viewport(), |draw| {
        draw.cull_back_faces(false, false);
        draw.bind(pipeline, &[constants], &[]);
        for page in &scene.pages {
            draw.vertices(&page.vertices, 0);
            draw.draw(0, page.vertex_count);
        }
    });
}
