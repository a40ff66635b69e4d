//! Oriented polygons: splats cut at sharp edges as fans of their corners, patches of a cut by error as rectangles whose pixels
//! ask for the footprint. The nearest wins.

use crate::abi::{CompiledShader, OrientedPolygon, ShaderVariants, shaders};
use crate::gpu::buffer::AnyBuffer;
use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::pipeline::{DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline};
use crate::gpu::{Error, Gpu};
use crate::render::settings::PolygonSource;
use crate::render::vulkan::POLYGON;
use crate::render::vulkan::targets::{Context, FrameTargets};
use std::sync::Arc;

/// What decides the pipeline; the last are the flags of the frame.
pub(crate) type PolygonVariant = (PolygonKind, u32);

/// What the polygons of a frame are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PolygonKind {
    /// Splats from vertices: they may reach behind the eye, and have no thickness.
    Splats,
    /// Patches of a cut: in front of the near plane, and widened by what their thickness shows.
    Patches,
}

/// The pipeline of one kind of polygons.
#[derive(Debug)]
pub(crate) struct PolygonPasses {
    /// What it was made for.
    pub(crate) variant: PolygonVariant,
    pipeline: ShaderPipeline,
}

impl PolygonPasses {
    /// # Errors
    /// When a Vulkan call fails.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        variant @ (kind, flags): PolygonVariant,
        targets: &FrameTargets,
    ) -> Result<Self, Error> {
        let (vertex, fragment, topology): (&CompiledShader, ShaderVariants, PrimitiveTopology) =
            match kind {
                PolygonKind::Splats => (
                    &shaders::POLYGONS_SPLATS_VERT,
                    shaders::POLYGONS_SPLATS_FRAG,
                    PrimitiveTopology::Fans,
                ),
                PolygonKind::Patches => (
                    &shaders::POLYGONS_PATCHES_VERT,
                    shaders::POLYGONS_PATCHES_FRAG,
                    PrimitiveTopology::Quads,
                ),
            };
        let description = PipelineDescription {
            name: kind.pass(),
            vertex,
            fragment: Some(fragment.of(targets.normal().is_some())),
            constants: &[],
            record: POLYGON,
            topology,
            colors: targets.formats(),
            depth: DepthMode::Nearest,
            is_additive: false,
        };
        Ok(Self {
            variant,
            pipeline: ShaderPipeline::for_flags(gpu, &description, flags)?,
        })
    }

    /// Pass `polygons.splats` or `polygons.patches`: so many polygons of a list. Keeps what the triangles left.
    pub(crate) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        (polygons, count): (&dyn AnyBuffer, usize),
        context: &Context,
        constants: UniformBlock,
    ) {
        if count == 0 {
            return;
        }
        let kind = self.variant.0;
        let pass = targets.attach_after(frame.pass(kind.pass()), context, false);
        pass.vertices(polygons).draw(context.viewport(), |draw| {
            draw.cull_back_faces(false, false);
            draw.bind(&self.pipeline, &[constants], &[]);
            draw.vertices(polygons, 0);
            match kind {
                PolygonKind::Splats => draw.draw_fans(0, count as u32),
                PolygonKind::Patches => draw.draw_quads(0, count as u32),
            }
        });
    }
}

impl PolygonKind {
    /// Kind of a source.
    pub(crate) fn of(source: PolygonSource) -> Self {
        match source {
            PolygonSource::Vertices(_) => Self::Splats,
            PolygonSource::Patches(_) => Self::Patches,
        }
    }

    /// Name of the pass.
    fn pass(self) -> &'static str {
        match self {
            Self::Splats => "polygons.splats",
            Self::Patches => "polygons.patches",
        }
    }
}

/// The shaders have eight corners.
const _: () = assert!(OrientedPolygon::MOST_CORNERS == 8);
