//! Fuzzy splats: the weighted mean of all splats of the front surface.
//!
//! Two-pass splatting (Benda, *Point Based Rendering*, section 2.3.3; Rusinkiewicz and Levoy, *QSplat*, 2000, section
//! 3.3) with a division per pixel: `fuzzy.depth` finds the front surface and pushes it away by a splat's depth,
//! `fuzzy.blend` sums (color * weight, weight) of all that is not behind it, `fuzzy.normalize` divides. With
//! deferred shading the sums are those of albedo and normals, and the last pass lights their mean.

use crate::abi::specialization::{
    HAS_COVERAGE, HAS_LAMP, IS_DEFERRED, IS_GAUSS, IS_ORIENTED, IS_QUAD, IS_SQUARE, IS_WIDENED,
};
use crate::abi::{CompiledShader, ConstantValue, FuzzySplat, WeightedSplat, shaders};
use crate::gpu::frame::{FrameRecorder, TargetLoad, UniformBlock};
use crate::gpu::image::{DeviceImage as Target, ImageFormat};
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord, record,
};
use crate::gpu::{Error, Gpu};
use crate::pack::Footprint;
use crate::render::vulkan::blended::compute;
use crate::render::vulkan::blended::compute::{ComputeBlending, OwnConstants};
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::{RasterList, RasterPipelines, ScreenDraw};
use crate::render::vulkan::targets::color_formats;
use crate::render::vulkan::targets::{Context, FrameTargets};
use crate::render::vulkan::{POLYGON, VERTEX};
use crate::render::{Method, Settings, Shading, SplatKind, SumFormat};
use std::sync::Arc;

/// [`WeightedSplat`] as pipelines see it.
pub(crate) const RECORD: VertexRecord = record!(WeightedSplat {
    center: Float3 in splat,
    radius: Float in splat,
    normal: Snorm16x2 in splat,
    color: Unorm8x4 in splat,
    area: Float,
});

/// The same where it lies in the place of a [`FuzzySplat`].
const LARGE: VertexRecord = VertexRecord {
    stride: size_of::<FuzzySplat>() as u32,
    attributes: RECORD.attributes,
};

/// What decides the pipelines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct FuzzyVariant {
    is_gauss: bool,
    /// By the frame's low pass.
    is_widened: bool,
    footprint: Footprint,
    is_deferred: bool,
    /// The mean normals are an output.
    writes_normals: bool,
    /// Weights are areas, and their sum is coverage.
    has_coverage: bool,
    /// From the vertices of the mesh instead of a draw list.
    pub(crate) from_vertices: bool,
    /// The splats are oriented polygons.
    are_polygons: bool,
    /// A lamp lights the surface instead of the headlight.
    has_lamp: bool,
    sums: ImageFormat,
    /// Of the picture.
    color: ImageFormat,
    /// Of the frame.
    flags: u32,
    /// Small splats are drawn by compute, all of them gray (true) or not.
    by_compute: Option<bool>,
}

impl FuzzyVariant {
    /// Variant of `settings` for a model with or without triangles.
    ///
    /// # Errors
    /// When 32-bit sums are asked for and the device cannot blend them.
    pub(crate) fn new(
        gpu: &Gpu,
        settings: &Settings,
        has_triangles: bool,
        targets: &FrameTargets,
        (flags, by_compute): (u32, Option<bool>),
    ) -> Result<Self, Error> {
        let sums = match settings.sums {
            Some(SumFormat::Float) if !gpu.info().has_float_blend => {
                return Err(Error::Unsupported {
                    what: "32-bit sums (--sums float)",
                    why: format!(
                        "{} cannot blend into 32-bit float targets; leave --sums out",
                        gpu.info().name
                    ),
                });
            }
            Some(SumFormat::Half) => ImageFormat::Rgba16Float,
            Some(SumFormat::Float) => ImageFormat::Rgba32Float,
            None if gpu.info().has_float_blend => ImageFormat::Rgba32Float,
            None => ImageFormat::Rgba16Float,
        };
        Ok(Self {
            is_gauss: settings.splat == SplatKind::Gauss,
            is_widened: settings.low_pass_px() > 0.0,
            footprint: settings.footprint(),
            is_deferred: settings.shading == Shading::Deferred,
            writes_normals: targets.normal().is_some(),
            has_coverage: settings.sums_coverage(has_triangles),
            from_vertices: settings.method == Method::Points,
            are_polygons: settings.drawn_vertex_splats().is_some(),
            has_lamp: !settings.has_headlight(),
            sums,
            color: targets.color().format,
            flags,
            by_compute,
        })
    }

    /// Values of the specialization constants of shaders that place footprints.
    fn of_footprints(&self, topology: PrimitiveTopology) -> [ConstantValue; 4] {
        [
            IS_GAUSS.is(self.is_gauss),
            IS_ORIENTED.is(self.footprint == Footprint::Oriented),
            IS_QUAD.is(topology == PrimitiveTopology::Quads),
            IS_SQUARE.is(self.footprint == Footprint::Square),
        ]
    }

    /// The same of those that blend them as well.
    pub(crate) fn of_blend(&self, topology: PrimitiveTopology) -> [ConstantValue; 7] {
        let [gauss, oriented, quad, square] = self.of_footprints(topology);
        let [deferred, lamp] = self.of_light();
        let widened = IS_WIDENED.is(self.is_widened);
        [gauss, oriented, quad, square, deferred, lamp, widened]
    }

    /// The same of those that light pixels.
    fn of_light(&self) -> [ConstantValue; 2] {
        [IS_DEFERRED.is(self.is_deferred), HAS_LAMP.is(self.has_lamp)]
    }

    fn sums_normals(&self) -> bool {
        self.is_deferred || self.writes_normals
    }
}

/// Points and quads of one pass.
#[derive(Debug)]
struct PrimitivePipelines {
    points: ShaderPipeline,
    quads: ShaderPipeline,
    /// Both, of what compute leaves of its list.
    large: Option<[ShaderPipeline; 2]>,
}

/// Pipelines and the targets of the sums, for one picture size.
#[derive(Debug)]
pub(crate) struct FuzzyPasses {
    pub(crate) variant: FuzzyVariant,
    depth_triangles: ShaderPipeline,
    depth_splats: PrimitivePipelines,
    blend_triangles: ShaderPipeline,
    blend_splats: PrimitivePipelines,
    /// Of oriented polygons: depth and blend.
    polygons: Option<[ShaderPipeline; 2]>,
    normalize: ShaderPipeline,
    sums: Target,
    normals: Option<Target>,
    /// Passes that draw small splats.
    twin: Option<ComputeBlending>,
}

impl PrimitivePipelines {
    /// What draws a list, or what compute leaves of it, beside triangles.
    fn with<'a>(&'a self, triangles: &'a ShaderPipeline, is_left: bool) -> RasterPipelines<'a> {
        let [points, quads] = match (&self.large, is_left) {
            (Some([points, quads]), true) => [points, quads],
            _ => [&self.points, &self.quads],
        };
        RasterPipelines {
            reads_textures: false,
            triangles: Some(triangles),
            points: Some(points),
            quads: Some(quads),
            polygons: None,
        }
    }
}

/// Lists that a frame draws.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FuzzyLists<'a> {
    /// By the rasterizer.
    pub(crate) raster: RasterList<'a>,
    /// By compute; none where it draws nothing.
    pub(crate) small: Option<compute::ComputeInput<'a>>,
}

/// Pipelines of oriented polygons: depth and blend, like these.
///
/// # Errors
/// When memory runs out.
fn polygon_pipelines(
    gpu: &Arc<Gpu>,
    variant: &FuzzyVariant,
    depth: PipelineDescription<'_>,
    blend: PipelineDescription<'_>,
) -> Result<[ShaderPipeline; 2], Error> {
    let [deferred, lamp] = variant.of_light();
    let fans = |description: PipelineDescription<'_>| {
        let description = PipelineDescription {
            record: POLYGON,
            topology: PrimitiveTopology::Fans,
            ..description
        };
        ShaderPipeline::for_flags(gpu, &description, variant.flags)
    };
    Ok([
        fans(PipelineDescription {
            name: "fuzzy.depth polygons",
            vertex: &shaders::FUZZY_DEPTH_POLYGONS_VERT,
            fragment: Some(&shaders::FUZZY_DEPTH_POLYGONS_FRAG),
            ..depth
        })?,
        fans(PipelineDescription {
            name: "fuzzy.blend polygons",
            vertex: &shaders::POLYGONS_SPLATS_VERT,
            fragment: Some(shaders::FUZZY_BLEND_POLYGONS_FRAG.of(variant.sums_normals())),
            constants: &[IS_GAUSS.is(variant.is_gauss), deferred, lamp],
            ..blend
        })?,
    ])
}

/// Passes of what compute draws, all of it gray or not.
///
/// # Errors
/// When memory runs out.
fn twin(
    gpu: &Arc<Gpu>,
    variant: &FuzzyVariant,
    is_gray: bool,
    size: (u32, u32),
) -> Result<ComputeBlending, Error> {
    let [gauss, _, _, square] = variant.of_footprints(PrimitiveTopology::Points);
    let [_, lamp] = variant.of_light();
    let coverage = HAS_COVERAGE.is(variant.has_coverage);
    let look = (is_gray, variant.has_lamp, variant.color);
    let (kind, depth, blend): (_, &[ConstantValue], &[ConstantValue]) = match variant.are_polygons {
        true => (&compute::POLYGONS, &[], &[gauss]),
        false => (&compute::FUZZY, &[gauss, square], &[gauss, square, lamp]),
    };
    let constants = OwnConstants {
        depth,
        surface: None,
        blend,
        normalize: &[coverage],
        flags: variant.are_polygons.then_some(variant.flags),
    };
    ComputeBlending::new(gpu, kind, size.into(), look, constants)
}

impl FuzzyPasses {
    /// # Errors
    /// When memory runs out.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        variant: FuzzyVariant,
        width: u32,
        height: u32,
    ) -> Result<Self, Error> {
        let pipeline =
            |d: &PipelineDescription<'_>| ShaderPipeline::for_flags(gpu, d, variant.flags);
        let colors: &[ImageFormat] = match (variant.sums, variant.sums_normals()) {
            (sums, true) => &[sums; 2],
            (sums, false) => &[sums],
        };
        let base = PipelineDescription {
            name: "",
            vertex: &shaders::FUZZY_DEPTH_VERT,
            fragment: None,
            constants: &[],
            record: VERTEX,
            topology: PrimitiveTopology::Triangles,
            colors: &[],
            depth: DepthMode::Nearest,
            is_additive: false,
        };
        let blend = PipelineDescription {
            colors,
            depth: DepthMode::TestOnly,
            is_additive: true,
            ..base
        };
        // A square needs no outline.
        let outline =
            (variant.footprint != Footprint::Square).then_some(&shaders::FUZZY_DEPTH_FRAG);
        let (depth_vertex, blend_vertex, record): (&CompiledShader, &CompiledShader, VertexRecord) =
            if variant.from_vertices {
                (
                    &shaders::FUZZY_DEPTH_POINTS_VERT,
                    &shaders::FUZZY_BLEND_POINTS_VERT,
                    VERTEX,
                )
            } else {
                (
                    &shaders::FUZZY_DEPTH_VERT,
                    &shaders::FUZZY_BLEND_VERT,
                    RECORD,
                )
            };
        let pair = |name,
                    description: PipelineDescription<'_>,
                    is_blend: bool|
         -> Result<PrimitivePipelines, Error> {
            let make = |topology, record| {
                let constants = variant.of_blend(topology);
                let footprints = variant.of_footprints(topology);
                pipeline(&PipelineDescription {
                    name,
                    topology,
                    record,
                    constants: if is_blend { &constants } else { &footprints },
                    ..description
                })
            };
            Ok(PrimitivePipelines {
                points: make(PrimitiveTopology::Points, record)?,
                quads: make(PrimitiveTopology::Quads, record)?,
                large: match variant.by_compute {
                    Some(_) => Some([
                        make(PrimitiveTopology::Points, LARGE)?,
                        make(PrimitiveTopology::Quads, LARGE)?,
                    ]),
                    None => None,
                },
            })
        };
        let depth_splats = PipelineDescription {
            vertex: depth_vertex,
            fragment: outline,
            ..base
        };
        let blend_splats = PipelineDescription {
            vertex: blend_vertex,
            fragment: Some(shaders::FUZZY_BLEND_FRAG.of(variant.sums_normals())),
            ..blend
        };
        let [deferred, lamp] = variant.of_light();
        let coverage = HAS_COVERAGE.is(variant.has_coverage);
        Ok(Self {
            variant,
            depth_triangles: pipeline(&PipelineDescription {
                name: "fuzzy.depth triangles",
                vertex: match variant.are_polygons {
                    true => &shaders::TRIANGLES_DRAW_VERT,
                    false => &shaders::FUZZY_DEPTH_TRIANGLES_VERT,
                },
                ..base
            })?,
            depth_splats: pair("fuzzy.depth splats", depth_splats, false)?,
            blend_triangles: pipeline(&PipelineDescription {
                name: "fuzzy.blend triangles",
                vertex: &shaders::TRIANGLES_DRAW_VERT,
                fragment: Some(shaders::FUZZY_BLEND_TRIANGLES_FRAG.of(variant.sums_normals())),
                constants: &variant.of_light(),
                ..blend
            })?,
            blend_splats: pair("fuzzy.blend splats", blend_splats, true)?,
            polygons: (variant.are_polygons)
                .then(|| polygon_pipelines(gpu, &variant, base, blend))
                .transpose()?,
            normalize: pipeline(&PipelineDescription {
                name: "fuzzy.normalize",
                vertex: &shaders::FILTERED_NORMALIZE_VERT,
                fragment: Some(shaders::FUZZY_NORMALIZE_FRAG.of(variant.writes_normals)),
                constants: &[deferred, lamp, coverage],
                record: VertexRecord::NOTHING,
                colors: color_formats(variant.color, variant.writes_normals),
                depth: DepthMode::None,
                ..base
            })?,
            twin: match variant.by_compute {
                None => None,
                Some(is_gray) => Some(twin(gpu, &variant, is_gray, (width, height))?),
            },
            sums: Target::new(gpu, "sums", variant.sums, width, height)?,
            normals: variant
                .sums_normals()
                .then(|| Target::new(gpu, "sums of normals", variant.sums, width, height))
                .transpose()?,
        })
    }

    /// The passes of a frame.
    ///
    /// # Errors
    /// When the frame has no room for the constants of its parts.
    pub(crate) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: FuzzyLists<'_>,
        context: &Context,
        constants: UniformBlock,
    ) -> Result<(), Error> {
        let (Some(twin), Some(small)) = (&self.twin, list.small) else {
            self.raster_depth(frame, targets, list, context, constants);
            self.raster_blend(frame, targets, list, context, constants);
            self.normalize(frame, targets, context, constants);
            return Ok(());
        };
        let rastered = compute::RasterizedPart {
            depth: &|frame| self.raster_depth(frame, targets, list, context, constants),
            blend: &|frame| self.raster_blend(frame, targets, list, context, constants),
            surface: &|_| {},
        };
        let is_rastered = !list.raster.is_empty();
        let rastered = (is_rastered.then_some(&rastered), &self.sums);
        twin.record(frame, targets, small, rastered, context, constants)
    }

    /// Pass `fuzzy.depth` by the rasterizer.
    fn raster_depth(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: FuzzyLists<'_>,
        context: &Context,
        constants: UniformBlock,
    ) {
        let pass = frame
            .pass("fuzzy.depth")
            .depth(targets.depth(), TargetLoad::Clear([0.0; 4]));
        let triangles = &self.depth_triangles;
        let pipelines = RasterPipelines {
            polygons: self.polygons.as_ref().map(|[depth, _]| depth),
            ..self.depth_splats.with(triangles, list.small.is_some())
        };
        raster_pass::draw(pass, &list.raster, pipelines, context, constants);
    }

    /// Pass `fuzzy.blend` by the rasterizer.
    fn raster_blend(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: FuzzyLists<'_>,
        context: &Context,
        constants: UniformBlock,
    ) {
        let mut pass = frame
            .pass("fuzzy.blend")
            .color(&self.sums, TargetLoad::Clear([0.0; 4]));
        if let Some(normals) = &self.normals {
            pass = pass.color(normals, TargetLoad::Clear([0.0; 4]));
        }
        let pass = pass.depth_test(targets.depth());
        let triangles = &self.blend_triangles;
        let pipelines = RasterPipelines {
            polygons: self.polygons.as_ref().map(|[_, blend]| blend),
            ..self.blend_splats.with(triangles, list.small.is_some())
        };
        raster_pass::draw(pass, &list.raster, pipelines, context, constants);
    }

    /// Pass `fuzzy.normalize` of what was rastered.
    fn normalize(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        context: &Context,
        constants: UniformBlock,
    ) {
        let [r, g, b] = context.background;
        // Every binding must be written; without normals the second is not looked at.
        let normals = self.normals.as_ref().unwrap_or(&self.sums);
        let mut pass = frame
            .pass("fuzzy.normalize")
            .color(targets.color(), TargetLoad::Clear([r, g, b, 0.0]));
        if let (true, Some(target)) = (self.variant.writes_normals, targets.normal()) {
            pass = pass.color(target, TargetLoad::Clear([0.0; 4]));
        }
        let (uniforms, images) = ([constants], [&self.sums, normals]);
        let screen = ScreenDraw::of_images(&self.normalize, &uniforms, &images);
        raster_pass::full_screen(pass, &screen, context.whole_px());
    }
}
