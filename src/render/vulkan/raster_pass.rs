//! Means that the passes of all techniques have in common: a list that the rasterizer draws, and a triangle over the picture.
//!
//! A technique says which targets a pass has, which pipelines draw its list, and what it leaves to others; how a list is
//! declared and drawn stands here once.

use crate::abi::{CompiledShader, ConstantValue, shaders};
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::{AnyBuffer, DeviceBuffer};
use crate::gpu::frame::{DrawRecorder, PassBuilder, UniformBlock};
use crate::gpu::image::{DeviceImage, ImageFormat};
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord,
};
use crate::pack::fuzzy::PlacedFuzzy;
use crate::pack::splats::PackedSplats;
use crate::render::screen_bounds;
use crate::render::vulkan::scene::{DeviceScene, ScenePage};
use crate::render::vulkan::targets::{Context, color_formats};

/// A run of indices in the draw list that belongs to one page.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PageRange {
    /// Page of the scene.
    pub(crate) page: usize,
    /// First index.
    pub(crate) first: u32,
    /// Number of indices.
    pub(crate) count: u32,
}

/// List that the rasterizer draws of a scene in a pass: triangles, then splats.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RasterList<'a> {
    pub(crate) scene: &'a DeviceScene,
    pub(crate) triangles: RasterTriangles<'a>,
    pub(crate) splats: RasterSplats<'a>,
}

/// Source of triangles.
#[derive(Debug, Clone, Copy)]
pub(crate) enum RasterTriangles<'a> {
    /// All of the scene.
    Scene,
    /// Runs of a buffer of indices; there may be none.
    Runs(&'a dyn AnyBuffer, &'a [PageRange]),
    /// Indices of the first page, as many as the device says.
    Chosen(&'a dyn AnyBuffer, ListArguments<'a>),
    Nothing,
}

/// Place in a buffer where the device wrote arguments of a draw or a dispatch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ListArguments<'a> {
    pub(crate) buffer: &'a DeviceBuffer,
    /// Bytes.
    pub(crate) offset: u64,
}

/// Records of splats, as many as the device says: points from the start of the list, quads up to its end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChosenSplats<'a> {
    pub(crate) records: &'a DeviceBuffer,
    /// Most that there can be.
    pub(crate) room: u32,
    /// A draw of the points; none where something else draws them.
    pub(crate) points: Option<ListArguments<'a>>,
    /// A draw of the quads; none where there never are any.
    pub(crate) quads: Option<ListArguments<'a>>,
    /// A dispatch over the points, of workgroups that copies of the first one fill up.
    pub(crate) groups: ListArguments<'a>,
}

impl ChosenSplats<'_> {
    /// There are surely none.
    fn is_empty(&self) -> bool {
        self.points.is_none() && self.quads.is_none()
    }

    /// The same list without its points.
    pub(crate) fn without_points(self) -> Self {
        Self {
            points: None,
            ..self
        }
    }
}

impl RasterTriangles<'_> {
    /// There are none to draw.
    pub(crate) fn is_empty(&self) -> bool {
        match self {
            Self::Scene => false,
            Self::Runs(_, runs) => runs.is_empty(),
            Self::Chosen(..) => false,
            Self::Nothing => true,
        }
    }
}

/// Source of splats.
#[derive(Debug, Clone, Copy)]
pub(crate) enum RasterSplats<'a> {
    /// Records of a draw list.
    Records(SplatRecords<'a>),
    /// Records that the device made of a cut of its own.
    Chosen(ChosenSplats<'a>),
    /// All vertices of the scene, as quads or as points.
    Vertices {
        /// Vertices may be too large for points.
        as_quads: bool,
    },
    /// So many oriented polygons.
    Polygons(&'a dyn AnyBuffer, u32),
    Nothing,
}

/// Records of a draw list, one after the other.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RecordRange {
    pub(crate) first: u32,
    pub(crate) count: u32,
}

impl RecordRange {
    fn new(first: usize, count: usize) -> Self {
        Self {
            first: first as u32,
            count: count as u32,
        }
    }
}

/// Records of a draw list, some as points and some as quads.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SplatRecords<'a> {
    pub(crate) buffer: &'a dyn AnyBuffer,
    pub(crate) points: RecordRange,
    pub(crate) quads: RecordRange,
}

impl<'a> SplatRecords<'a> {
    /// Records of a list with room for `capacity`: points from its start, quads up to its end.
    pub(crate) fn packed(buffer: &'a dyn AnyBuffer, packed: PackedSplats, capacity: usize) -> Self {
        Self {
            buffer,
            points: RecordRange::new(0, packed.points),
            quads: RecordRange::new(capacity - packed.quads, packed.quads),
        }
    }

    /// Records that compute leaves of such a list: points before the quads, which end it.
    pub(crate) fn large(buffer: &'a dyn AnyBuffer, placed: PlacedFuzzy, capacity: usize) -> Self {
        let first_quad = capacity - placed.quads;
        Self {
            buffer,
            points: RecordRange::new(first_quad - placed.points, placed.points),
            quads: RecordRange::new(first_quad, placed.quads),
        }
    }

    /// There are none.
    pub(crate) fn is_empty(&self) -> bool {
        self.points.count == 0 && self.quads.count == 0
    }

    /// The same list without its points.
    pub(crate) fn without_points(self) -> Self {
        Self {
            points: RecordRange::default(),
            ..self
        }
    }
}

/// Pipelines that draw a list; one that the list never needs is none.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RasterPipelines<'a> {
    pub(crate) triangles: Option<&'a ShaderPipeline>,
    pub(crate) points: Option<&'a ShaderPipeline>,
    /// Without, what may be quads is drawn as points too.
    pub(crate) quads: Option<&'a ShaderPipeline>,
    /// Oriented polygons as fans; without, the one of points draws one of each.
    pub(crate) polygons: Option<&'a ShaderPipeline>,
    /// The one of triangles reads the textures of pages, which all have some.
    pub(crate) reads_textures: bool,
}

impl RasterList<'_> {
    /// There is nothing to draw.
    pub(crate) fn is_empty(&self) -> bool {
        let has_splats = match &self.splats {
            RasterSplats::Records(records) => !records.is_empty(),
            RasterSplats::Chosen(chosen) => !chosen.is_empty(),
            RasterSplats::Vertices { .. } => true,
            RasterSplats::Polygons(_, count) => *count > 0,
            RasterSplats::Nothing => false,
        };
        self.triangles.is_empty() && !has_splats
    }

    /// The same list without its splats.
    pub(crate) fn only_triangles(self) -> Self {
        Self {
            splats: RasterSplats::Nothing,
            ..self
        }
    }

    /// The same list without its triangles.
    pub(crate) fn only_splats(self) -> Self {
        Self {
            triangles: RasterTriangles::Nothing,
            ..self
        }
    }

    /// Declares what a pass reads of the list.
    fn declared<'f>(&self, mut pass: PassBuilder<'f>, reads_textures: bool) -> PassBuilder<'f> {
        let has_vertices = matches!(self.splats, RasterSplats::Vertices { .. });
        if has_vertices || !self.triangles.is_empty() {
            for page in self.scene.shown_pages() {
                pass = pass.vertices(&page.vertices);
                if let (true, Some(textures)) = (reads_textures, &page.textures) {
                    pass = pass.vertex_storage(&textures.points);
                    pass = pass.fragment_storage(&*textures.texels);
                }
                if let (RasterTriangles::Scene, Some(indices)) = (self.triangles, &page.indices) {
                    pass = pass.indices(indices);
                }
            }
        }
        match self.triangles {
            RasterTriangles::Runs(indices, _) => {
                pass = pass.indices(indices);
                for vertices in self.scene.pooled_buffers() {
                    pass = pass.vertices(vertices);
                }
            }
            RasterTriangles::Chosen(indices, arguments) => {
                pass = pass.indices(indices).arguments(arguments.buffer);
            }
            RasterTriangles::Scene | RasterTriangles::Nothing => {}
        }
        match &self.splats {
            RasterSplats::Records(records) => pass.vertices(records.buffer),
            RasterSplats::Chosen(chosen) => {
                let arguments = chosen.points.or(chosen.quads);
                let pass = pass.vertices(chosen.records);
                match arguments {
                    Some(arguments) => pass.arguments(arguments.buffer),
                    None => pass,
                }
            }
            RasterSplats::Polygons(polygons, _) => pass.vertices(*polygons),
            RasterSplats::Vertices { .. } | RasterSplats::Nothing => pass,
        }
    }
}

/// Records a pass whose targets are attached: the triangles of a list, then its splats.
///
/// # Panics
/// When something is in the list that no pipeline draws.
pub(crate) fn draw(
    pass: PassBuilder<'_>,
    list: &RasterList<'_>,
    pipelines: RasterPipelines<'_>,
    context: &Context,
    constants: UniformBlock,
) {
    let reads_textures = pipelines.reads_textures;
    let pass = list.declared(pass, reads_textures);
    pass.draw(context.viewport(), |draw| {
        if !list.triangles.is_empty() {
            draw.cull_back_faces(context.cull_back, context.is_mirrored);
            let pipeline = needed(pipelines.triangles);
            if !reads_textures {
                draw.bind(pipeline, &[constants], &[]);
            }
            let bind = |draw: &mut DrawRecorder<'_>, page: &ScenePage| {
                if let (true, Some(textures)) = (reads_textures, &page.textures) {
                    let points = BufferSlice::whole(&textures.points);
                    let texels = BufferSlice::whole(&*textures.texels);
                    draw.bind_storage(pipeline, &[constants], &[], &[points, texels]);
                }
            };
            draw_triangles(draw, list, bind);
        }
        draw.cull_back_faces(false, false);
        draw_splats(draw, list, pipelines, constants);
    });
}

fn needed(pipeline: Option<&ShaderPipeline>) -> &ShaderPipeline {
    let Some(pipeline) = pipeline else {
        unreachable!("a pass has the pipelines that its list needs")
    };
    pipeline
}

fn draw_triangles(
    draw: &mut DrawRecorder<'_>,
    list: &RasterList<'_>,
    bind: impl Fn(&mut DrawRecorder<'_>, &ScenePage),
) {
    match list.triangles {
        RasterTriangles::Scene => {
            for page in list.scene.shown_pages() {
                let Some(indices) = &page.indices else {
                    continue;
                };
                bind(draw, page);
                draw.vertices(&page.vertices, 0);
                draw.indices(indices, 0);
                draw.draw_indexed(0, 3 * (page.triangles.end - page.triangles.start), 0);
            }
        }
        RasterTriangles::Runs(indices, runs) => {
            draw.indices(indices, 0);
            for run in runs {
                // Pages of paged files have no textures.
                if let Some(page) = list.scene.pages.get(run.page) {
                    bind(draw, page);
                }
                draw.vertices(list.scene.vertices_of(run.page), 0);
                draw.draw_indexed(run.first, run.count, 0);
            }
        }
        RasterTriangles::Chosen(indices, arguments) => {
            if let Some(page) = list.scene.pages.first() {
                bind(draw, page);
                draw.indices(indices, 0);
                draw.vertices(&page.vertices, 0);
                draw.draw_indexed_from(arguments.buffer, arguments.offset);
            }
        }
        RasterTriangles::Nothing => {}
    }
}

fn draw_splats(
    draw: &mut DrawRecorder<'_>,
    list: &RasterList<'_>,
    pipelines: RasterPipelines<'_>,
    constants: UniformBlock,
) {
    match list.splats {
        RasterSplats::Records(records) => {
            for (range, may_be_quads) in [(records.points, false), (records.quads, true)] {
                if range.count > 0 {
                    let are_quads = bind_splats(draw, pipelines, may_be_quads, constants);
                    draw.vertices(records.buffer, 0);
                    draw_range(draw, range, are_quads);
                }
            }
        }
        RasterSplats::Chosen(chosen) => {
            for (arguments, may_be_quads) in [(chosen.points, false), (chosen.quads, true)] {
                if let Some(arguments) = arguments {
                    bind_splats(draw, pipelines, may_be_quads, constants);
                    draw.vertices(chosen.records, 0);
                    draw.draw_from(arguments.buffer, arguments.offset);
                }
            }
        }
        RasterSplats::Vertices { as_quads } => {
            let are_quads = bind_splats(draw, pipelines, as_quads, constants);
            for page in list.scene.shown_pages() {
                draw.vertices(&page.vertices, 0);
                draw_range(
                    draw,
                    RecordRange::new(0, page.vertex_count as usize),
                    are_quads,
                );
            }
        }
        RasterSplats::Polygons(polygons, count) => {
            let fans = pipelines.polygons;
            draw.bind(
                fans.unwrap_or_else(|| needed(pipelines.points)),
                &[constants],
                &[],
            );
            draw.vertices(polygons, 0);
            match fans {
                Some(_) => draw.draw_fans(0, count),
                None => draw.draw(0, count),
            }
        }
        RasterSplats::Nothing => {}
    }
}

/// Binds what draws splats that may be quads or not. Whether they are.
fn bind_splats(
    draw: &mut DrawRecorder<'_>,
    pipelines: RasterPipelines<'_>,
    may_be_quads: bool,
    constants: UniformBlock,
) -> bool {
    let quads = pipelines.quads.filter(|_| may_be_quads);
    let pipeline = quads.unwrap_or_else(|| needed(pipelines.points));
    draw.bind(pipeline, &[constants], &[]);
    quads.is_some()
}

fn draw_range(draw: &mut DrawRecorder<'_>, range: RecordRange, are_quads: bool) {
    if are_quads {
        draw.draw_quads(range.first, range.count);
    } else {
        draw.draw(range.first, range.count);
    }
}

/// Description of the pipeline of a triangle over the picture, which writes one color and tests no depth.
pub(crate) fn screen_description<'a>(
    (name, fragment): (&'static str, &'static CompiledShader),
    constants: &'a [ConstantValue],
    color: ImageFormat,
) -> PipelineDescription<'a> {
    PipelineDescription {
        name,
        vertex: &shaders::FILTERED_NORMALIZE_VERT,
        fragment: Some(fragment),
        constants,
        record: VertexRecord::NOTHING,
        topology: PrimitiveTopology::Triangles,
        colors: color_formats(color, false),
        depth: DepthMode::None,
        is_additive: false,
    }
}

/// Pipeline and inputs of a triangle over the picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ScreenDraw<'a> {
    pub(crate) pipeline: &'a ShaderPipeline,
    pub(crate) uniforms: &'a [UniformBlock],
    /// Images that it samples.
    pub(crate) images: &'a [&'a DeviceImage],
    /// Storage that it reads, which the pass has declared.
    pub(crate) storage: &'a [BufferSlice<'a>],
}

impl<'a> ScreenDraw<'a> {
    /// One that reads images and no storage.
    pub(crate) fn of_images(
        pipeline: &'a ShaderPipeline,
        uniforms: &'a [UniformBlock],
        images: &'a [&'a DeviceImage],
    ) -> Self {
        Self {
            pipeline,
            uniforms,
            images,
            storage: &[],
        }
    }
}

/// Records a pass whose targets are attached: a triangle over them, which shows within `rect_px` only (left, top, and one past
/// right and bottom).
pub(crate) fn full_screen(pass: PassBuilder<'_>, screen: &ScreenDraw<'_>, rect_px: [u32; 4]) {
    let pass = screen
        .images
        .iter()
        .fold(pass, |pass, image| pass.sampled(image));
    pass.draw_whole(|draw| {
        draw.bind_storage(
            screen.pipeline,
            screen.uniforms,
            screen.images,
            screen.storage,
        );
        cover(draw, &[rect_px]);
    });
}

/// Draws a triangle over each of some parts of the picture, with the pipeline that is bound in a pass over the whole of it.
pub(crate) fn cover(draw: &mut DrawRecorder<'_>, areas: &[[u32; 4]]) {
    draw.cull_back_faces(false, false);
    for &area in areas {
        draw.scissor(screen_bounds::area(area));
        draw.draw(0, 3);
    }
}
