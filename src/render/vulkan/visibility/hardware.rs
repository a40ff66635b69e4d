//! Visibility splatting: one pixel for every splat whose center is seen, the rest is reconstructed on the picture.
//!
//! Sources: Benda, *Point Based Rendering*, section 3.3.4; Pfister et al., *Surfels* (SIGGRAPH 2000), section 7; Grossman
//! and Dally, *Point Sample Rendering* (1998). `visibility.depth` draws the whole footprints, pushed away from the eye by
//! a depth offset, and so finds which pixels are covered, and by what; `visibility.centers` draws each center as one
//! pixel where no footprint hides it. Triangles are drawn in both and count as centers. Then one of the
//! [`Reconstruction`]s fills the covered pixels without a center.
//!
//! Ours: both passes leave color, class, distance and offset in every pixel, so that no reconstruction takes color across
//! a step in depth, and a hole that nothing fills shows the footprint that made it.

use crate::abi::specialization::{IS_CENTER, IS_QUAD};
use crate::abi::{CompiledShader, shaders};
use crate::gpu::frame::{FrameRecorder, TargetLoad, UniformBlock};
use crate::gpu::image::DeviceImage as Target;
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord,
};
use crate::gpu::{Error, Gpu};
use crate::render::Reconstruction;
use crate::render::vulkan::opaque::hardware::SplatSource;
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::{RasterList, RasterPipelines, RasterSplats, ScreenDraw};
use crate::render::vulkan::targets::{Context, FrameTargets};
use crate::render::vulkan::visibility::compute::{
    ComputeVisibility, VisibilityTargets, VisibleKind, VisibleList,
};
use crate::render::vulkan::visibility::pull_push::ColorPyramid;
use crate::render::vulkan::visibility::targets::{FRONTS, PICKED, attach_last, last_pass};
use crate::render::vulkan::{NORMAL, POLYGON, SPLAT, VERTEX};
use std::sync::Arc;

/// What a frame draws.
#[derive(Debug, Clone, Copy)]
pub(crate) struct VisibilityLists<'a> {
    pub(crate) raster: RasterList<'a>,
    /// Compute draws splats from vertices, and those of the list that are points; parts of the picture in which they can be.
    pub(crate) by_compute: Option<&'a [[u32; 4]]>,
    /// No splat is larger, pixels.
    pub(crate) largest_px: f32,
}

/// The pipelines of splats from one source.
#[derive(Debug)]
struct SplatPipelines {
    /// Footprints as points.
    points: ShaderPipeline,
    /// Footprints as quads.
    quads: ShaderPipeline,
    /// One pixel each.
    centers: ShaderPipeline,
}

/// Pipelines and targets, for one picture size.
#[derive(Debug)]
pub(crate) struct VisibilityPasses {
    gpu: Arc<Gpu>,
    normals: bool,
    /// Of the first and of the second pass, and of which flags of a frame they are, as those of splats.
    triangles: Option<(u32, [ShaderPipeline; 2])>,
    from_list: Option<SplatPipelines>,
    from_vertices: Option<SplatPipelines>,
    /// Of oriented polygons: footprints as fans, and centers.
    polygons: Option<[ShaderPipeline; 2]>,
    /// For frames that compute may draw.
    twin: Option<ComputeVisibility>,
    picked: Target,
    fronts: Target,
    gaussian: Option<ShaderPipeline>,
    density: Option<ShaderPipeline>,
    pyramid: Option<ColorPyramid>,
}

/// A pipeline of one of the first two passes.
fn first_pass(
    gpu: &Arc<Gpu>,
    (normals, flags): (bool, u32),
    is_center: bool,
    vertex: &CompiledShader,
    record: VertexRecord,
    topology: PrimitiveTopology,
) -> Result<ShaderPipeline, Error> {
    let formats = [PICKED, FRONTS, NORMAL];
    let pass = if is_center { "centers" } else { "depth" };
    let constants = [
        IS_CENTER.is(is_center),
        IS_QUAD.is(topology == PrimitiveTopology::Quads),
    ];
    ShaderPipeline::for_flags(
        gpu,
        &PipelineDescription {
            name: &format!("visibility.{pass} {topology:?}"),
            vertex,
            fragment: Some(match topology {
                PrimitiveTopology::Triangles => shaders::VISIBILITY_TRIANGLES_FRAG.of(normals),
                PrimitiveTopology::Fans => shaders::VISIBILITY_POLYGONS_FRAG.of(normals),
                PrimitiveTopology::Points | PrimitiveTopology::Quads => {
                    shaders::VISIBILITY_SPLATS_FRAG.of(normals)
                }
            }),
            constants: match topology {
                PrimitiveTopology::Fans => &[],
                // Centers of polygons are no quads.
                PrimitiveTopology::Points if record.stride == POLYGON.stride => &constants[..1],
                PrimitiveTopology::Triangles => &constants[..1],
                PrimitiveTopology::Points | PrimitiveTopology::Quads => &constants,
            },
            record,
            topology,
            colors: &formats[..if normals { 3 } else { 2 }],
            // A center may lie exactly in its own footprint, where the offset is 0.
            depth: if is_center {
                DepthMode::NotFarther
            } else {
                DepthMode::Nearest
            },
            is_additive: false,
        },
        flags,
    )
}

impl SplatPipelines {
    fn new(gpu: &Arc<Gpu>, how: (bool, u32), source: SplatSource) -> Result<Self, Error> {
        let (vertex, record) = match source {
            SplatSource::List => (&shaders::VISIBILITY_SPLATS_VERT, SPLAT),
            SplatSource::Vertices => (&shaders::VISIBILITY_POINTS_VERT, VERTEX),
        };
        Ok(Self {
            points: first_pass(gpu, how, false, vertex, record, PrimitiveTopology::Points)?,
            quads: first_pass(gpu, how, false, vertex, record, PrimitiveTopology::Quads)?,
            centers: first_pass(gpu, how, true, vertex, record, PrimitiveTopology::Points)?,
        })
    }
}

impl VisibilityPasses {
    /// Targets; [`VisibilityPasses::ensure`] makes the pipelines.
    ///
    /// # Errors
    /// When memory runs out.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        width: u32,
        height: u32,
        normals: bool,
    ) -> Result<Self, Error> {
        Ok(Self {
            gpu: gpu.clone(),
            normals,
            triangles: None,
            from_list: None,
            from_vertices: None,
            polygons: None,
            twin: None,
            picked: Target::new(gpu, "picked", PICKED, width, height)?,
            fronts: Target::new(gpu, "fronts", FRONTS, width, height)?,
            gaussian: None,
            density: None,
            pyramid: None,
        })
    }

    /// Makes what oriented polygons need in frames of these flags, once [`VisibilityPasses::ensure`] was called for them.
    ///
    /// # Errors
    /// When memory runs out.
    pub(crate) fn ensure_polygons(&mut self, flags: u32) -> Result<(), Error> {
        if self.polygons.is_none() {
            let make = |is_center, vertex, topology| {
                let how = (self.normals, flags);
                first_pass(&self.gpu, how, is_center, vertex, POLYGON, topology)
            };
            self.polygons = Some([
                make(
                    false,
                    &shaders::VISIBILITY_POLYGONS_VERT,
                    PrimitiveTopology::Fans,
                )?,
                make(
                    true,
                    &shaders::VISIBILITY_POLYGON_CENTERS_VERT,
                    PrimitiveTopology::Points,
                )?,
            ]);
        }
        Ok(())
    }

    /// Makes what splats from `source` and `reconstruction` need in frames of these flags, outside of the frame, and the kind
    /// that compute may draw.
    ///
    /// # Errors
    /// When memory runs out.
    pub(crate) fn ensure(
        &mut self,
        source: SplatSource,
        reconstruction: Reconstruction,
        (flags, by_compute): (u32, Option<VisibleKind>),
    ) -> Result<(), Error> {
        let how = (self.normals, flags);
        if self.triangles.as_ref().is_none_or(|made| made.0 != flags) {
            let make = |is_center| {
                first_pass(
                    &self.gpu,
                    how,
                    is_center,
                    &shaders::VISIBILITY_TRIANGLES_VERT,
                    VERTEX,
                    PrimitiveTopology::Triangles,
                )
            };
            self.triangles = Some((flags, [make(false)?, make(true)?]));
            (self.from_list, self.from_vertices, self.polygons) = (None, None, None);
            self.twin = None;
        }
        if let Some(kind) = by_compute
            && self.twin.as_ref().is_none_or(|twin| twin.kind != kind)
        {
            let size = [self.picked.width, self.picked.height];
            self.twin = Some(ComputeVisibility::new(&self.gpu, kind, how, size)?);
        }
        let pipelines = match source {
            SplatSource::List => &mut self.from_list,
            SplatSource::Vertices => &mut self.from_vertices,
        };
        if pipelines.is_none() {
            *pipelines = Some(SplatPipelines::new(&self.gpu, how, source)?);
        }
        let gpu = &self.gpu;
        match reconstruction {
            Reconstruction::Gaussian if self.gaussian.is_none() => {
                let shader = &shaders::VISIBILITY_GAUSSIAN_FRAG;
                self.gaussian = Some(last_pass(gpu, "visibility.gaussian", shader)?);
            }
            Reconstruction::Density if self.density.is_none() => {
                let shader = &shaders::VISIBILITY_DENSITY_FRAG;
                self.density = Some(last_pass(gpu, "visibility.density", shader)?);
            }
            Reconstruction::PullPush if self.pyramid.is_none() => {
                let size = (self.picked.width, self.picked.height);
                self.pyramid = Some(ColorPyramid::new(gpu, size)?);
            }
            _ => {}
        }
        Ok(())
    }

    /// The passes of a frame.
    ///
    /// # Errors
    /// When the frame has no room for the constants of so many parts.
    ///
    /// # Panics
    /// When [`VisibilityPasses::ensure`] was not called for this reconstruction.
    pub(crate) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: VisibilityLists<'_>,
        reconstruction: Reconstruction,
        context: &Context,
        constants: UniformBlock,
    ) -> Result<(), Error> {
        self.record_first(frame, targets, list, context, constants)?;
        // Only quads may be larger than the margin that the rectangle has.
        let has_quads = match list.raster.splats {
            RasterSplats::Records(records) => records.quads.count > 0,
            RasterSplats::Vertices { as_quads } => as_quads,
            RasterSplats::Polygons(..) => true,
            RasterSplats::Chosen(chosen) => chosen.quads.is_some(),
            RasterSplats::Nothing => false,
        };
        let rect_px = if has_quads {
            context.whole_px()
        } else {
            context.rect_px
        };
        let pipeline = match (reconstruction, &self.gaussian, &self.density, &self.pyramid) {
            (Reconstruction::Gaussian, Some(pipeline), _, _)
            | (Reconstruction::Density, _, Some(pipeline), _) => pipeline,
            (Reconstruction::PullPush, _, _, Some(pyramid)) => {
                let finest = [&self.picked, &self.fronts];
                let largest = list.largest_px;
                let how = (context, rect_px);
                pyramid.record(frame, targets, finest, largest, how, constants);
                return Ok(());
            }
            _ => unreachable!("ensure made what the reconstruction needs"),
        };
        let name = match reconstruction {
            Reconstruction::Density => "visibility.density",
            _ => "visibility.gaussian",
        };
        let (uniforms, images) = ([constants], [&self.picked, &self.fronts]);
        let screen = ScreenDraw::of_images(pipeline, &uniforms, &images);
        let pass = attach_last(frame, name, targets, context);
        raster_pass::full_screen(pass, &screen, rect_px);
        Ok(())
    }

    /// What finds the class of each pixel: by the rasterizer, and by compute what it draws.
    fn record_first(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: VisibilityLists<'_>,
        context: &Context,
        constants: UniformBlock,
    ) -> Result<(), Error> {
        let all = &list.raster;
        let small = match all.splats {
            RasterSplats::Records(records) if records.points.count > 0 => {
                let rest = RasterSplats::Records(records.without_points());
                let list = VisibleList::of(records.buffer, records.points.count);
                Some((rest, list))
            }
            RasterSplats::Polygons(polygons, count) => {
                Some((RasterSplats::Nothing, VisibleList::of(polygons, count)))
            }
            RasterSplats::Chosen(chosen) => {
                let rest = RasterSplats::Chosen(chosen.without_points());
                Some((rest, VisibleList::chosen(&chosen)))
            }
            _ => None,
        };
        let (Some((splats, small)), Some(areas), Some(twin)) = (small, list.by_compute, &self.twin)
        else {
            self.record_splats(frame, targets, all, context, constants);
            return Ok(());
        };
        let rest = RasterList { splats, ..*all };
        let is_first = rest.is_empty();
        if !is_first {
            self.record_splats(frame, targets, &rest, context, constants);
        }
        let onto = VisibilityTargets {
            targets,
            picked: &self.picked,
            fronts: &self.fronts,
        };
        twin.record(frame, onto, small, (areas, is_first), context, constants)
    }

    /// `visibility.depth` and `visibility.centers`.
    fn record_splats(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: &RasterList<'_>,
        context: &Context,
        constants: UniformBlock,
    ) {
        let splats = match list.splats {
            RasterSplats::Vertices { .. } => &self.from_vertices,
            RasterSplats::Records(_)
            | RasterSplats::Chosen(_)
            | RasterSplats::Polygons(..)
            | RasterSplats::Nothing => &self.from_list,
        };
        let polygons = match (list.splats, &self.polygons) {
            (RasterSplats::Polygons(..), Some([footprints, centers])) => {
                Some([footprints, centers])
            }
            _ => None,
        };
        let (Some(splats), Some((_, triangles))) = (splats, &self.triangles) else {
            unreachable!("ensure made the pipelines")
        };
        for (name, triangles, is_center) in [
            ("visibility.depth", &triangles[0], false),
            ("visibility.centers", &triangles[1], true),
        ] {
            let load = |clear| match is_center {
                false => TargetLoad::Clear(clear),
                true => TargetLoad::Keep,
            };
            let mut pass = frame
                .pass(name)
                .color(&self.picked, load([0.0; 4]))
                .color(&self.fronts, load([0.0; 4]));
            if let Some(normal) = targets.normal() {
                pass = pass.color(normal, load([0.0; 4]));
            }
            let pass = pass.depth(targets.depth(), load([0.0; 4]));
            let pipelines = RasterPipelines {
                reads_textures: false,
                triangles: Some(triangles),
                points: Some(match (is_center, polygons) {
                    (true, Some([_, centers])) => centers,
                    (true, None) => &splats.centers,
                    (false, _) => &splats.points,
                }),
                polygons: polygons
                    .map(|[footprints, _]| footprints)
                    .filter(|_| !is_center),
                // A center is a pixel, however large its footprint.
                quads: (!is_center).then_some(&splats.quads),
            };
            raster_pass::draw(pass, list, pipelines, context, constants);
        }
    }
}
