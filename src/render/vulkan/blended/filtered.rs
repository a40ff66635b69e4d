//! Filtered splats: every splat deposits the area it covers, the sum is the covered fraction of the pixel.
//!
//! Two-pass splatting (Benda, section 2.3.3; Rusinkiewicz and Levoy, section 3.3) with weights of our own
//! ([`crate::pack::filtered`]): `filtered.depth` finds the front surface and pushes it away by a splat's depth,
//! `filtered.blend` sums (color * weight, weight) of all that is not behind it, `filtered.normalize` divides.
//! The sums are 32-bit floats: a pixel adds up thousands of small weights, which 16 bits lose.

#[cfg(test)]
mod tests;

use crate::abi::specialization::{HAS_LAMP, LARGE_ONLY};
use crate::abi::{FilteredSplat, shaders};
use crate::gpu::frame::{Frame, Load, Uniform};
use crate::gpu::image::{Format, Image as Target};
use crate::gpu::pipeline::{Depth, Description, Pipeline, Record, Topology, record};
use crate::gpu::{Error, Gpu};
use crate::render::cost::choose::ComputeShare;
use crate::render::vulkan::VERTEX;
use crate::render::vulkan::blended::compute;
use crate::render::vulkan::blended::compute::{OwnConstants, Twin};
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::{RasterList, RasterPipelines, ScreenDraw};
use crate::render::vulkan::targets::{Context, Targets};
use crate::render::vulkan::triangles::targets;
use std::sync::Arc;

/// [`FilteredSplat`] as pipelines see it.
pub(crate) const RECORD: Record = record!(FilteredSplat {
    window_px: Float2,
    pushed_depth: Float,
    side_px: Float,
    depth: Float,
    area_px: Float,
    extent_px: Float2,
    color: Float3,
});

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
    pub(crate) variant: Variant,
    by_compute: Option<ByCompute>,
}

/// What decides the pipelines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Variant {
    /// A lamp instead of the headlight.
    pub(crate) has_lamp: bool,
    /// Of the picture.
    pub(crate) color: Format,
    /// Small splats are drawn by compute, all of them gray (true) or not.
    pub(crate) by_compute: Option<bool>,
}

/// What draws small splats, and the pipelines that draw the others only.
#[derive(Debug)]
struct ByCompute {
    twin: Twin,
    depth_splats: Pipeline,
    blend_splats: Pipeline,
}

/// What a frame draws.
#[derive(Debug, Clone, Copy)]
pub(crate) struct List<'a> {
    /// All of it, as the rasterizer draws it.
    pub(crate) raster: RasterList<'a>,
    /// The same splats and small triangles for compute.
    pub(crate) small: compute::Small<'a>,
}

impl Filtered {
    /// # Errors
    /// When the device cannot blend 32-bit floats, or memory runs out.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        (width, height): (u32, u32),
        variant: Variant,
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
        let depth_splats = |value| {
            Pipeline::new(
                gpu,
                &Description {
                    name: "filtered.depth splats",
                    constants: &[LARGE_ONLY.is(value)],
                    ..base
                },
            )
        };
        let blend_splats = |value| {
            Pipeline::new(
                gpu,
                &Description {
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
                twin: Twin::new(
                    gpu,
                    &compute::FILTERED,
                    (width, height),
                    (is_gray, variant.has_lamp, variant.color),
                    OwnConstants::default(),
                )?,
                depth_splats: depth_splats(true)?,
                blend_splats: blend_splats(true)?,
            }),
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
            depth_splats: depth_splats(false)?,
            blend_triangles: Pipeline::new(
                gpu,
                &Description {
                    name: "filtered.blend triangles",
                    vertex: &shaders::TRIANGLES_DRAW_VERT,
                    fragment: Some(&shaders::FILTERED_BLEND_TRIANGLES_FRAG),
                    constants: &[HAS_LAMP.is(variant.has_lamp)],
                    record: VERTEX,
                    topology: Topology::Triangles,
                    ..blend
                },
            )?,
            blend_splats: blend_splats(false)?,
            normalize: Pipeline::new(
                gpu,
                &Description {
                    name: "filtered.normalize",
                    vertex: &shaders::FILTERED_NORMALIZE_VERT,
                    fragment: Some(&shaders::FILTERED_NORMALIZE_FRAG),
                    record: Record::NOTHING,
                    topology: Topology::Triangles,
                    colors: targets(variant.color, false),
                    depth: Depth::None,
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
        frame: &mut Frame<'_>,
        targets: &Targets,
        list: List<'_>,
        share: ComputeShare,
        context: &Context,
        constants: Uniform,
    ) -> Result<(), Error> {
        let all = &list.raster;
        let (Some(by_compute), ComputeShare::Small | ComputeShare::All) = (&self.by_compute, share)
        else {
            self.raster_depth(frame, targets, all, &self.depth_splats, context, constants);
            self.raster_blend(frame, targets, all, &self.blend_splats, context, constants);
            self.normalize(frame, targets, context, constants);
            return Ok(());
        };
        let ByCompute {
            twin,
            depth_splats,
            blend_splats,
        } = by_compute;
        let large = match share {
            ComputeShare::Small => *all,
            _ => all.only_triangles(),
        };
        let rastered = compute::Rastered {
            depth: &|frame| {
                self.raster_depth(frame, targets, &large, depth_splats, context, constants);
            },
            blend: &|frame| {
                self.raster_blend(frame, targets, &large, blend_splats, context, constants);
            },
        };
        let rastered = ((!large.is_empty()).then_some(&rastered), &self.sums);
        twin.record(frame, targets, list.small, rastered, context, constants)
    }

    /// Pass `filtered.depth` by the rasterizer: the pushed depth of splats, that of triangles.
    fn raster_depth(
        &self,
        frame: &mut Frame<'_>,
        targets: &Targets,
        list: &RasterList<'_>,
        splats: &Pipeline,
        context: &Context,
        constants: Uniform,
    ) {
        let pass = frame
            .pass("filtered.depth")
            .depth(targets.depth(), Load::Clear([0.0; 4]));
        let pipelines = pipelines(&self.depth_triangles, splats);
        raster_pass::draw(pass, list, pipelines, context, constants);
    }

    /// Pass `filtered.blend` by the rasterizer: sums of what is not behind that depth.
    fn raster_blend(
        &self,
        frame: &mut Frame<'_>,
        targets: &Targets,
        list: &RasterList<'_>,
        splats: &Pipeline,
        context: &Context,
        constants: Uniform,
    ) {
        let pass = frame
            .pass("filtered.blend")
            .color(&self.sums, Load::Clear([0.0; 4]))
            .depth_test(targets.depth());
        let pipelines = pipelines(&self.blend_triangles, splats);
        raster_pass::draw(pass, list, pipelines, context, constants);
    }

    /// Pass `filtered.normalize` of what was rastered.
    fn normalize(
        &self,
        frame: &mut Frame<'_>,
        targets: &Targets,
        context: &Context,
        constants: Uniform,
    ) {
        let [r, g, b] = context.background;
        let pass = frame
            .pass("filtered.normalize")
            .color(targets.color(), Load::Clear([r, g, b, 0.0]));
        let (uniforms, images) = ([constants], [&self.sums, targets.depth()]);
        let screen = ScreenDraw::of_images(&self.normalize, &uniforms, &images);
        raster_pass::full_screen(pass, &screen, context.rect_px);
    }
}

/// What draws a list: filtered splats are points, however large.
fn pipelines<'a>(triangles: &'a Pipeline, splats: &'a Pipeline) -> RasterPipelines<'a> {
    RasterPipelines {
        triangles: Some(triangles),
        points: Some(splats),
        quads: None,
    }
}
