//! Filtered splats: every splat deposits the area it covers, the sum is the covered fraction of the pixel.
//!
//! Two-pass splatting (Benda, section 2.3.3; Rusinkiewicz and Levoy, section 3.3) with weights of our own
//! ([`crate::draw::filtered`]): `filtered.depth` finds the front surface and pushes it away by a splat's depth,
//! `filtered.blend` sums (color * weight, weight) of all that is not behind it, `filtered.normalize` divides.
//! The sums are 32-bit floats: a pixel adds up thousands of small weights, which 16 bits lose.

use super::VERTEX;
use super::hybrid::Run;
use super::scene::Scene;
use super::targets::{Context, Targets};
use super::triangles::targets;
use crate::abi::{FilteredSplat, shaders};
use crate::gpu::buffer::Upload;
use crate::gpu::frame::{Frame, Load, Uniform};
use crate::gpu::image::{Format, Image as Target};
use crate::gpu::pipeline::{
    Attribute, AttributeFormat, Depth, Description, Pipeline, Record, Topology,
};
use crate::gpu::{Error, Gpu};
use std::sync::Arc;

/// [`FilteredSplat`] as pipelines see it.
const RECORD: Record = Record {
    stride: size_of::<FilteredSplat>() as u32,
    attributes: &[
        Attribute {
            name: "center",
            format: AttributeFormat::Float3,
            offset: std::mem::offset_of!(FilteredSplat, center) as u32,
        },
        Attribute {
            name: "offset",
            format: AttributeFormat::Float,
            offset: std::mem::offset_of!(FilteredSplat, offset) as u32,
        },
        Attribute {
            name: "color",
            format: AttributeFormat::Float3,
            offset: std::mem::offset_of!(FilteredSplat, color) as u32,
        },
        Attribute {
            name: "area_px",
            format: AttributeFormat::Float,
            offset: std::mem::offset_of!(FilteredSplat, area_px) as u32,
        },
        Attribute {
            name: "extent_and_side_px",
            format: AttributeFormat::Float3,
            offset: std::mem::offset_of!(FilteredSplat, extent_and_side_px) as u32,
        },
    ],
};

const NOTHING: Record = Record {
    stride: 0,
    attributes: &[],
};

/// Format of the sums.
const SUMS: Format = Format::Rgba32Float;

/// Pipelines and the target of the sums, for one picture size.
#[derive(Debug)]
pub(crate) struct Filtered {
    depth_triangles: Pipeline,
    depth_splats: Pipeline,
    blend_triangles: Pipeline,
    blend_splats: Pipeline,
    normalize: Pipeline,
    sums: Target,
    /// Made for a lamp instead of the headlight.
    pub(crate) has_lamp: bool,
}

/// What a frame draws.
#[derive(Debug, Clone, Copy)]
pub(crate) struct List<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) indices: &'a Upload,
    pub(crate) runs: &'a [Run],
    pub(crate) splats: &'a Upload,
    pub(crate) splat_count: u32,
}

impl Filtered {
    /// # Errors
    /// When the device cannot blend 32-bit floats, or memory runs out.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        (width, height): (u32, u32),
        has_lamp: bool,
    ) -> Result<Self, Error> {
        if !gpu.info().has_float_blend {
            return Err(Error::Unsupported {
                what: "filtered splats",
                why: format!("{} cannot blend into 32-bit float targets", gpu.info().name),
            });
        }
        let base = Description {
            name: "",
            vertex: &shaders::FILTERED_DEPTH_VERT,
            fragment: None,
            constants: &[],
            record: RECORD,
            topology: Topology::Points,
            colors: &[],
            depth: Depth::Nearest,
            is_additive: false,
        };
        let blend = Description {
            colors: &[SUMS],
            depth: Depth::TestOnly,
            is_additive: true,
            ..base
        };
        Ok(Self {
            depth_triangles: Pipeline::new(
                gpu,
                &Description {
                    name: "filtered.depth triangles",
                    // The blend pass has the same, so that a triangle is never behind itself.
                    vertex: &shaders::TRIANGLES_DRAW_VERT,
                    record: VERTEX,
                    topology: Topology::Triangles,
                    ..base
                },
            )?,
            depth_splats: Pipeline::new(
                gpu,
                &Description {
                    name: "filtered.depth splats",
                    ..base
                },
            )?,
            blend_triangles: Pipeline::new(
                gpu,
                &Description {
                    name: "filtered.blend triangles",
                    vertex: &shaders::TRIANGLES_DRAW_VERT,
                    fragment: Some(&shaders::FILTERED_BLEND_TRIANGLES_FRAG),
                    constants: &[has_lamp],
                    record: VERTEX,
                    topology: Topology::Triangles,
                    ..blend
                },
            )?,
            blend_splats: Pipeline::new(
                gpu,
                &Description {
                    name: "filtered.blend splats",
                    vertex: &shaders::FILTERED_BLEND_VERT,
                    fragment: Some(&shaders::FILTERED_BLEND_FRAG),
                    ..blend
                },
            )?,
            normalize: Pipeline::new(
                gpu,
                &Description {
                    name: "filtered.normalize",
                    vertex: &shaders::FILTERED_NORMALIZE_VERT,
                    fragment: Some(&shaders::FILTERED_NORMALIZE_FRAG),
                    record: NOTHING,
                    topology: Topology::Triangles,
                    colors: targets(false),
                    depth: Depth::None,
                    ..base
                },
            )?,
            sums: Target::new(gpu, "sums", SUMS, width, height)?,
            has_lamp,
        })
    }

    /// The three passes of a frame.
    pub(crate) fn record(
        &self,
        frame: &mut Frame<'_>,
        targets: &Targets,
        list: List<'_>,
        context: &Context,
        constants: Uniform,
    ) {
        for (name, triangles, splats) in [
            ("filtered.depth", &self.depth_triangles, &self.depth_splats),
            ("filtered.blend", &self.blend_triangles, &self.blend_splats),
        ] {
            let pass = frame.pass(name);
            let pass = if name == "filtered.depth" {
                pass.depth(targets.depth(), Load::Clear([0.0; 4]))
            } else {
                pass.color(&self.sums, Load::Clear([0.0; 4]))
                    .depth_test(targets.depth())
            };
            let mut pass = pass.indices(list.indices).vertices(list.splats);
            for page in &list.scene.pages {
                pass = pass.vertices(&page.vertices);
            }
            pass.draw(context.viewport(), |draw| {
                if !list.runs.is_empty() {
                    draw.cull_back_faces(context.cull_back, context.is_mirrored);
                    draw.bind(triangles, &[constants], &[]);
                    draw.indices(list.indices, 0);
                    for run in list.runs {
                        draw.vertices(&list.scene.pages[run.page].vertices, 0);
                        draw.draw_indexed(run.first, run.count, 0);
                    }
                }
                if list.splat_count > 0 {
                    draw.cull_back_faces(false, false);
                    draw.bind(splats, &[constants], &[]);
                    draw.vertices(list.splats, 0);
                    draw.draw(0, list.splat_count);
                }
            });
        }
        let [r, g, b] = context.background;
        frame
            .pass("filtered.normalize")
            .color(targets.color(), Load::Clear([r, g, b, 0.0]))
            .sampled(&self.sums)
            .sampled(targets.depth())
            .draw(
                [0.0, 0.0, context.width as f32, context.height as f32],
                |draw| {
                    draw.cull_back_faces(false, false);
                    draw.bind(
                        &self.normalize,
                        &[constants],
                        &[&self.sums, targets.depth()],
                    );
                    draw.draw(0, 3);
                },
            );
    }
}
