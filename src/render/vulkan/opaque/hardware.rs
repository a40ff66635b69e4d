//! Opaque splats of every footprint, from a draw list or from the vertices of the mesh: the nearest wins.
//!
//! A footprint up to the device's largest point is a point sprite; a larger one is a quad with the same shaders.

use crate::abi::specialization::{IS_ORIENTED, IS_QUAD};
use crate::abi::{Shader, shaders};
use crate::gpu::buffer::Buffer;
use crate::gpu::frame::{Frame, Load, Uniform};
use crate::gpu::pipeline::{Depth, Description, Pipeline, Record, Topology};
use crate::gpu::{Error, Gpu};
use crate::pack::Footprint;
use crate::render::Settings;
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::{
    RasterList, RasterPipelines, RasterSplats, RasterTriangles,
};
use crate::render::vulkan::scene::Scene;
use crate::render::vulkan::targets::{Context, Targets};
use crate::render::vulkan::{SPLAT, VERTEX};
use std::sync::Arc;

/// Where splats come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Source {
    /// The draw list.
    List,
    /// The vertices of the mesh, all of one size.
    Vertices,
}

/// What decides the pipelines; the last are the flags of the frame.
pub(crate) type Variant = (Footprint, Source, u32);

/// Pipelines of one kind of opaque splat.
#[derive(Debug)]
pub(crate) struct Splats {
    /// What the pipelines were made for.
    pub(crate) variant: Variant,
    points: Pipeline,
    quads: Pipeline,
}

impl Splats {
    /// What `settings` need in frames of these flags.
    pub(crate) fn variant_of(settings: &Settings, flags: u32) -> Variant {
        let source = if settings.has_cut() {
            Source::List
        } else {
            Source::Vertices
        };
        (settings.footprint(), source, flags)
    }

    /// # Errors
    /// When a Vulkan call fails.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        variant @ (footprint, source, flags): Variant,
        targets: &Targets,
    ) -> Result<Self, Error> {
        let is_square = footprint == Footprint::Square;
        let (vertex, record): (&Shader, Record) = match (source, is_square) {
            (Source::List, true) => (&shaders::SPLATS_SQUARE_VERT, SPLAT),
            (Source::List, false) => (&shaders::SPLATS_ROUND_VERT, SPLAT),
            (Source::Vertices, true) => (&shaders::POINTS_DRAW_VERT, VERTEX),
            (Source::Vertices, false) => (&shaders::POINTS_ROUND_VERT, VERTEX),
        };
        let fragment = if is_square {
            shaders::POINTS_DRAW_FRAG
        } else {
            shaders::SPLATS_ROUND_FRAG
        };
        let fragment = fragment.of(targets.normal().is_some());
        let is_oriented = footprint == Footprint::Oriented;
        let pipeline = |name, topology| {
            // A square has no plane.
            let constants = [
                IS_QUAD.is(topology == Topology::Quads),
                IS_ORIENTED.is(is_oriented),
            ];
            Pipeline::for_flags(
                gpu,
                &Description {
                    name,
                    vertex,
                    fragment: Some(fragment),
                    constants: &constants[..1 + usize::from(!is_square)],
                    record,
                    topology,
                    colors: targets.formats(),
                    depth: Depth::Nearest,
                    is_additive: false,
                },
                flags,
            )
        };
        Ok(Self {
            variant,
            points: pipeline("splats as points", Topology::Points)?,
            quads: pipeline("splats as quads", Topology::Quads)?,
        })
    }

    fn pipelines(&self) -> RasterPipelines<'_> {
        RasterPipelines {
            points: Some(&self.points),
            quads: Some(&self.quads),
            ..RasterPipelines::default()
        }
    }

    /// Pass `hybrid.splats`: the splats of a list, if there are any. Keeps what the triangles left, unless it is the first pass
    /// of the frame.
    pub(crate) fn record_list(
        &self,
        frame: &mut Frame<'_>,
        targets: &Targets,
        list: &RasterList<'_>,
        (context, is_first): (&Context, bool),
        constants: Uniform,
    ) {
        let list = list.only_splats();
        if list.is_empty() {
            return;
        }
        let pass = targets.attach_after(frame.pass("hybrid.splats"), context, is_first);
        raster_pass::draw(pass, &list, self.pipelines(), context, constants);
    }

    /// Pass `hybrid.splats`: the points of a list by the arguments at an offset of a buffer. Keeps what the triangles left.
    pub(crate) fn record_from(
        &self,
        frame: &mut Frame<'_>,
        targets: &Targets,
        (list, (arguments, offset)): (&Buffer, (&Buffer, u64)),
        context: &Context,
        constants: Uniform,
    ) {
        let pass = targets
            .attach_with(frame.pass("hybrid.splats"), context, |_| Load::Keep)
            .vertices(list)
            .arguments(arguments);
        pass.draw(context.viewport(), |draw| {
            draw.cull_back_faces(false, false);
            draw.bind(&self.points, &[constants], &[]);
            draw.vertices(list, 0);
            draw.draw_from(arguments, offset);
        });
    }

    /// Pass `points.draw`: all used vertices of all pages. Clears the targets.
    pub(crate) fn record_vertices(
        &self,
        frame: &mut Frame<'_>,
        targets: &Targets,
        scene: &Scene,
        as_quads: bool,
        context: &Context,
        constants: Uniform,
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
