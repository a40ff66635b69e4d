//! Oriented polygons: splats cut at sharp edges as fans of their corners, patches of a cut by error as rectangles whose pixels
//! ask for the footprint. The nearest wins.

use crate::abi::{CompiledShader, OrientedPolygon, ShaderVariants, shaders};
use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::pipeline::{DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline};
use crate::gpu::{Error, Gpu};
use crate::render::vulkan::POLYGON;
use crate::render::vulkan::opaque::polygon_variant::{
    PolygonKind, PolygonRecords, PolygonRun, PolygonVariant,
};
use crate::render::vulkan::opaque::polygons_by_compute::PolygonCompute;
use crate::render::vulkan::targets::{Context, FrameTargets};
use std::sync::Arc;

/// The passes of one kind of polygons.
#[derive(Debug)]
pub(crate) struct PolygonPasses {
    /// Variant that they were made for.
    pub(crate) variant: PolygonVariant,
    drawer: PolygonDrawer,
}

/// Drawer of polygons.
#[derive(Debug)]
enum PolygonDrawer {
    Rasterizer(ShaderPipeline),
    Compute(Box<PolygonCompute>),
}

impl PolygonPasses {
    /// # Errors
    /// When a Vulkan call fails.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        variant: PolygonVariant,
        targets: &FrameTargets,
    ) -> Result<Self, Error> {
        let drawer = match variant.by_compute {
            true => PolygonDrawer::Compute(Box::new(PolygonCompute::new(gpu, variant, targets)?)),
            false => PolygonDrawer::Rasterizer(pipeline(gpu, variant, targets)?),
        };
        Ok(Self { variant, drawer })
    }

    /// Pass `polygons.splats` or `polygons.patches`, or those by compute: so many polygons of a list. Keeps what the triangles
    /// left.
    ///
    /// # Errors
    /// When the frame has no room for the constants of so many polygons.
    pub(crate) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: PolygonRecords<'_>,
        context: &Context,
        constants: UniformBlock,
    ) -> Result<(), Error> {
        let pipeline = match &self.drawer {
            PolygonDrawer::Rasterizer(pipeline) => pipeline,
            PolygonDrawer::Compute(compute) => {
                return compute.record(frame, targets, &list, context, constants);
            }
        };
        if list.count == 0 {
            return Ok(());
        }
        let (kind, polygons) = (self.variant.kind, list.polygons);
        let pass = targets.attach_after(frame.pass(kind.pass()), context, false);
        let pass = list.declared(pass);
        pass.vertices(polygons).draw(context.viewport(), |draw| {
            draw.cull_back_faces(false, false);
            for PolygonRun { range, images } in list.runs() {
                match images {
                    Some(images) => draw.bind_storage(pipeline, &[constants], &[], &images),
                    None => draw.bind(pipeline, &[constants], &[]),
                }
                draw.vertices(polygons, 0);
                match kind {
                    PolygonKind::Splats => draw.draw_fans(range.first, range.count),
                    PolygonKind::Patches => draw.draw_quads(range.first, range.count),
                }
            }
        });
        Ok(())
    }
}

/// The pipeline of the rasterizer.
///
/// # Errors
/// When a Vulkan call fails.
fn pipeline(
    gpu: &Arc<Gpu>,
    variant: PolygonVariant,
    targets: &FrameTargets,
) -> Result<ShaderPipeline, Error> {
    let PolygonVariant { kind, flags, .. } = variant;
    let (vertex, fragment, topology): (&CompiledShader, ShaderVariants, PrimitiveTopology) =
        match kind {
            PolygonKind::Splats => (
                &shaders::POLYGONS_SPLATS_VERT,
                shaders::POLYGONS_SPLATS_FRAG,
                PrimitiveTopology::Fans,
            ),
            PolygonKind::Patches => (
                &shaders::POLYGONS_PATCHES_VERT,
                match variant.has_textures {
                    true => shaders::POLYGONS_PATCHES_TEXTURED_FRAG,
                    false => shaders::POLYGONS_PATCHES_FRAG,
                },
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
    ShaderPipeline::for_flags(gpu, &description, flags)
}

/// The shaders have eight corners.
const _: () = assert!(OrientedPolygon::MOST_CORNERS == 8);
