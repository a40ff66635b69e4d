//! Opaque splats of every footprint, from a draw list or from the vertices of the mesh: the nearest wins.
//!
//! A footprint up to the device's largest point is a point sprite; a larger one is a quad with the same shaders.

use crate::abi::specialization::{IS_ORIENTED, IS_QUAD};
use crate::abi::{CompiledShader, shaders};
use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord,
};
use crate::gpu::{Error, Gpu};
use crate::pack::Footprint;
use crate::render::Settings;
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::{
    RasterList, RasterPipelines, RasterSplats, RasterTriangles,
};
use crate::render::vulkan::scene::DeviceScene;
use crate::render::vulkan::targets::{Context, FrameTargets};
use crate::render::vulkan::{SPLAT, VERTEX};
use std::sync::Arc;

/// Where splats come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SplatSource {
    /// The draw list.
    List,
    /// The vertices of the mesh, all of one size.
    Vertices,
}

/// What decides the pipelines; the last are the flags of the frame.
pub(crate) type OpaqueVariant = (Footprint, SplatSource, u32);

/// Pipelines of one kind of opaque splat.
#[derive(Debug)]
pub(crate) struct OpaqueSplats {
    /// What the pipelines were made for.
    pub(crate) variant: OpaqueVariant,
    points: ShaderPipeline,
    quads: ShaderPipeline,
}

impl OpaqueSplats {
    /// What `settings` need in frames of these flags.
    pub(crate) fn variant_of(settings: &Settings, flags: u32) -> OpaqueVariant {
        let source = if settings.has_lists() {
            SplatSource::List
        } else {
            SplatSource::Vertices
        };
        (settings.footprint(), source, flags)
    }

    /// # Errors
    /// When a Vulkan call fails.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        variant @ (footprint, source, flags): OpaqueVariant,
        targets: &FrameTargets,
    ) -> Result<Self, Error> {
        let is_square = footprint == Footprint::Square;
        let (vertex, record): (&CompiledShader, VertexRecord) = match (source, is_square) {
            (SplatSource::List, true) => (&shaders::SPLATS_SQUARE_VERT, SPLAT),
            (SplatSource::List, false) => (&shaders::SPLATS_ROUND_VERT, SPLAT),
            (SplatSource::Vertices, true) => (&shaders::POINTS_DRAW_VERT, VERTEX),
            (SplatSource::Vertices, false) => (&shaders::POINTS_ROUND_VERT, VERTEX),
        };
        let fragment = match footprint {
            Footprint::Square => shaders::POINTS_DRAW_FRAG,
            Footprint::Circle => shaders::SPLATS_ROUND_FRAG,
            Footprint::Oriented => shaders::SPLATS_ELLIPSE_FRAG,
        };
        let fragment = fragment.of(targets.normal().is_some());
        let is_oriented = footprint == Footprint::Oriented;
        let pipeline = |name, topology| {
            // A square has no plane.
            let constants = [
                IS_QUAD.is(topology == PrimitiveTopology::Quads),
                IS_ORIENTED.is(is_oriented),
            ];
            ShaderPipeline::for_flags(
                gpu,
                &PipelineDescription {
                    name,
                    vertex,
                    fragment: Some(fragment),
                    constants: &constants[..1 + usize::from(!is_square)],
                    record,
                    topology,
                    colors: targets.formats(),
                    depth: DepthMode::Nearest,
                    is_additive: false,
                },
                flags,
            )
        };
        Ok(Self {
            variant,
            points: pipeline("splats as points", PrimitiveTopology::Points)?,
            quads: pipeline("splats as quads", PrimitiveTopology::Quads)?,
        })
    }

    fn pipelines(&self) -> RasterPipelines<'_> {
        RasterPipelines {
            points: Some(&self.points),
            quads: Some(&self.quads),
            ..RasterPipelines::default()
        }
    }

    /// Pass `opaque.splats`: the splats of a list, if there are any. Keeps what the triangles left, unless it is the first pass
    /// of the frame.
    pub(crate) fn record_list(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: &RasterList<'_>,
        (context, is_first): (&Context, bool),
        constants: UniformBlock,
    ) {
        let list = list.only_splats();
        if list.is_empty() {
            return;
        }
        let pass = targets.attach_after(frame.pass("opaque.splats"), context, is_first);
        raster_pass::draw(pass, &list, self.pipelines(), context, constants);
    }

    /// Pass `points.draw`: all used vertices of all pages. Clears the targets.
    pub(crate) fn record_vertices(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        scene: &DeviceScene,
        as_quads: bool,
        context: &Context,
        constants: UniformBlock,
    ) {
        let list = RasterList {
            scene,
            triangles: RasterTriangles::Nothing,
            splats: RasterSplats::Vertices { as_quads },
        };
        let pass = targets.attach(frame.pass("points.draw"), context);
        raster_pass::draw(pass, &list, self.pipelines(), context, constants);
    }
}
