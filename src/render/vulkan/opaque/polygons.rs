//! Oriented polygons: splats cut at sharp edges as fans of their corners, patches of a cut by error as rectangles whose pixels
//! ask for the footprint. The nearest wins.

use crate::abi::{CompiledShader, OrientedPolygon, ShaderVariants, shaders};
use crate::gpu::frame::{FrameRecorder, PassBuilder, TargetLoad, UniformBlock};
use crate::gpu::image::DeviceImage as Target;
use crate::gpu::pipeline::{DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline};
use crate::gpu::{Error, Gpu};
use crate::render::vulkan::opaque::polygon_variant::{
    PolygonKind, PolygonRecords, PolygonRun, PolygonVariant,
};
use crate::render::vulkan::opaque::polygons_by_compute::PolygonCompute;
use crate::render::vulkan::targets::{Context, FrameTargets};
use crate::render::vulkan::{NUMBER, POLYGON};
use std::sync::Arc;

/// The passes of one kind of polygons.
#[derive(Debug)]
pub(crate) struct PolygonPasses {
    /// Variant that they were made for.
    pub(crate) variant: PolygonVariant,
    drawer: PolygonDrawer,
    /// Number in the list, from 1, of the polygon that each pixel shows; none of splats by the rasterizer.
    numbers: Option<Target>,
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
        let has_numbers = variant.by_compute || variant.kind == PolygonKind::Patches;
        let [width, height] = [targets.color().width, targets.color().height];
        let new = || Target::new(gpu, "numbers of polygons", NUMBER, width, height);
        Ok(Self {
            variant,
            drawer,
            numbers: has_numbers.then(new).transpose()?,
        })
    }

    /// Numbers of polygons in the pixels of the last frame that drew any: from 1 in the list, 0 where none is seen.
    pub(crate) fn numbers(&self) -> Option<&Target> {
        self.numbers.as_ref()
    }

    /// Attaches the targets as they are, and that of numbers, cleared.
    fn attached<'f>(
        &self,
        pass: PassBuilder<'f>,
        targets: &FrameTargets,
        context: &Context,
    ) -> PassBuilder<'f> {
        let pass = targets.attach_after(pass, context, false);
        match &self.numbers {
            Some(numbers) => pass.color(numbers, TargetLoad::Clear([0.0; 4])),
            None => pass,
        }
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
                if list.count == 0 {
                    return Ok(());
                }
                let parts = compute.record(frame, &list, context, constants)?;
                let pass = frame.pass("polygons.resolve");
                let pass = self.attached(pass, targets, context);
                compute.resolve(pass, &list, (&parts, context), constants);
                return Ok(());
            }
        };
        if list.count == 0 {
            return Ok(());
        }
        let (kind, polygons) = (self.variant.kind, list.polygons);
        let pass = self.attached(frame.pass(kind.pass()), targets, context);
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
        colors: match kind {
            PolygonKind::Splats => targets.formats(),
            PolygonKind::Patches => targets.numbered_formats(),
        },
        depth: DepthMode::Nearest,
        is_additive: false,
    };
    ShaderPipeline::for_flags(gpu, &description, flags)
}

/// The shaders have eight corners.
const _: () = assert!(OrientedPolygon::MOST_CORNERS == 8);
