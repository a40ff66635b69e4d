//! Blended splats by compute: the passes of [`crate::render::vulkan::blended::filtered`] and [`crate::render::vulkan::blended::fuzzy`] with atomics in the
//! place of depth test and blending.
//!
//! A rasterizer sets every point up before it draws it, which a software device does in 100 ns and more, twice. Here a
//! splat leaves its pushed depth in the pixels of its footprint by an atomic maximum (pass `depth`), and adds its deposits
//! where that does not hide it (pass `blend`). Sums are numbers of fixed point, so the order of drawing cannot show.
//! The rasterizer still draws large triangles and splats larger than
//! [`LARGEST_SMALL_BLENDED_PX`](crate::abi::constants::LARGEST_SMALL_BLENDED_PX); its depth is where the compute passes
//! begin from, and its sums are added to theirs.

use crate::abi::specialization::{HAS_LAMP, HAS_LARGE, IS_GRAY, IS_PUSHED};
use crate::abi::{
    CompiledShader, ConstantValue, FilteredSplat, FuzzySplat, OrientedPolygon, shaders,
};
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::{AnyBuffer, BufferUsage, DeviceBuffer};
use crate::gpu::frame::{FrameRecorder, PassBuilder, TargetLoad, UniformBlock};
use crate::gpu::image::{DeviceImage as Target, ImageFormat};
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord,
};
use crate::gpu::{Error, Gpu};
use crate::render::screen_bounds;
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::RecordRange;
use crate::render::vulkan::raster_pass::ScreenDraw;
use crate::render::vulkan::storage_ranges;
use crate::render::vulkan::storage_ranges::{BoundRange, TriangleRanges};
use crate::render::vulkan::targets::color_formats;
use crate::render::vulkan::targets::{Context, FrameTargets};
use std::sync::Arc;

/// Names of the passes of one kind of splats.
#[derive(Debug)]
struct PassNames {
    clear: &'static str,
    front: &'static str,
    depth: &'static str,
    merge: &'static str,
    blend: &'static str,
    normalize: &'static str,
    surface: &'static str,
}

/// The passes of one kind of splats.
#[derive(Debug)]
pub(crate) struct BlendedKind {
    passes: PassNames,
    depth: &'static CompiledShader,
    blend: &'static CompiledShader,
    normalize: &'static CompiledShader,
    /// Bytes of a splat.
    record: u64,
    /// Triangles are pushed away in the first pass, as splats are.
    pushes_triangles: bool,
    /// Depth and blending of splats ask the frame; else they come with all that is asked for.
    needs_frame: [bool; 2],
    /// Invocations that share a splat.
    sharers: u32,
}

/// Filtered splats.
pub(crate) const FILTERED: BlendedKind = BlendedKind {
    passes: PassNames {
        clear: "filtered.clear",
        front: "filtered.front",
        depth: "filtered.depth",
        merge: "filtered.merge",
        blend: "filtered.blend",
        normalize: "filtered.normalize",
        surface: "filtered.surface",
    },
    depth: &shaders::FILTERED_DEPTH_COMP,
    blend: &shaders::FILTERED_BLEND_COMP,
    normalize: &shaders::FILTERED_NORMALIZE_SMALL_FRAG,
    record: size_of::<FilteredSplat>() as u64,
    pushes_triangles: false,
    needs_frame: [false; 2],
    sharers: 1,
};

/// Passes of fuzzy splats.
const FUZZY_PASSES: PassNames = PassNames {
    clear: "fuzzy.clear",
    front: "fuzzy.front",
    depth: "fuzzy.depth",
    merge: "fuzzy.merge",
    blend: "fuzzy.blend",
    normalize: "fuzzy.normalize",
    surface: "fuzzy.surface",
};

/// Fuzzy splats.
pub(crate) const FUZZY: BlendedKind = BlendedKind {
    passes: FUZZY_PASSES,
    depth: &shaders::FUZZY_DEPTH_COMP,
    blend: &shaders::FUZZY_BLEND_COMP,
    normalize: &shaders::FUZZY_NORMALIZE_SMALL_FRAG,
    record: size_of::<FuzzySplat>() as u64,
    pushes_triangles: true,
    // How far Gaussians are widened.
    needs_frame: [false, true],
    sharers: 1,
};

/// Splats from vertices, which are blended as fuzzy ones are.
pub(crate) const POLYGONS: BlendedKind = BlendedKind {
    passes: FUZZY_PASSES,
    depth: &shaders::FUZZY_DEPTH_POLYGONS_COMP,
    blend: &shaders::FUZZY_BLEND_POLYGONS_COMP,
    normalize: &shaders::FUZZY_NORMALIZE_SMALL_FRAG,
    record: size_of::<OrientedPolygon>() as u64,
    pushes_triangles: false,
    needs_frame: [true; 2],
    sharers: 32,
};

impl BlendedKind {
    /// Blocks that its depth (0) or blending (1) of splats binds, of those of the frame and of the list.
    fn uniforms<'b>(&self, both: &'b [UniformBlock; 2], pass: usize) -> &'b [UniformBlock] {
        &both[usize::from(!self.needs_frame[pass])..]
    }
}

/// A list that fits one binding has room for the invocations that share its items.
const _: () = assert!(u32::MAX as u64 / POLYGONS.sharers as u64 > (1 << 32) / POLYGONS.record);

/// Values of the specialization constants that the shaders of one kind have and others have not.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct OwnConstants<'a> {
    /// Of [`BlendedKind::depth`].
    pub(crate) depth: &'a [ConstantValue],
    /// Values with which it leaves depths that are not pushed; `None` where it cannot.
    pub(crate) surface: Option<&'a [ConstantValue]>,
    /// Of [`BlendedKind::blend`].
    pub(crate) blend: &'a [ConstantValue],
    /// Of [`BlendedKind::normalize`].
    pub(crate) normalize: &'a [ConstantValue],
    /// Flags of the frames, where the shaders of splats depend on them.
    pub(crate) flags: Option<u32>,
}

/// Pipelines and the sums, for one picture size.
#[derive(Debug)]
pub(crate) struct ComputeBlending {
    kind: &'static BlendedKind,
    depth: ShaderPipeline,
    /// Depths that are not pushed.
    surface: Option<ShaderPipeline>,
    depth_triangles: ShaderPipeline,
    blend: ShaderPipeline,
    blend_triangles: ShaderPipeline,
    merge: ShaderPipeline,
    normalize: ShaderPipeline,
    /// As `normalize`, where the rasterizer drew as well.
    normalize_all: ShaderPipeline,
    front: DeviceBuffer,
    sums: DeviceBuffer,
    max_binding: u64,
    /// Red, green and blue are the same in all that is drawn.
    is_gray: bool,
}

/// Part of a frame that compute draws.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ComputeInput<'a> {
    pub(crate) splats: &'a dyn AnyBuffer,
    /// How many of the list are looked at; what is too large is left to the rasterizer.
    pub(crate) splat_count: u32,
    pub(crate) triangles: TriangleRanges<'a>,
}

/// Part of a frame that the rasterizer draws: its passes depth, blend and surface.
pub(crate) struct RasterizedPart<'a> {
    pub(crate) depth: &'a dyn Fn(&mut FrameRecorder<'_>),
    pub(crate) blend: &'a dyn Fn(&mut FrameRecorder<'_>),
    /// Depths that are not pushed.
    pub(crate) surface: &'a dyn Fn(&mut FrameRecorder<'_>),
}

/// Lists, bound.
struct BoundLists<'a> {
    list: ComputeInput<'a>,
    splats: Vec<BoundRange<'a>>,
    triangles: Vec<(BoundRange<'a>, BufferSlice<'a>)>,
}

impl BoundLists<'_> {
    /// Declares what a pass reads of them.
    fn declared<'f>(&self, pass: PassBuilder<'f>) -> PassBuilder<'f> {
        let mut pass = pass.storage_read(self.list.splats);
        if !self.triangles.is_empty() {
            pass = pass.storage_read(self.list.triangles.corners);
            for vertices in self.list.triangles.scene.vertex_buffers() {
                pass = pass.storage_read(vertices);
            }
        }
        pass
    }
}

/// Bytes of the sums of a pixel.
const fn sum_bytes(is_gray: bool) -> u64 {
    if is_gray { 16 } else { 32 }
}

impl ComputeBlending {
    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        kind: &'static BlendedKind,
        size: [u32; 2],
        (is_gray, has_lamp, color): (bool, bool, ImageFormat),
        constants: OwnConstants<'_>,
    ) -> Result<Self, Error> {
        let [width, height] = size;
        let gray = IS_GRAY.is(is_gray);
        let of_normalize = |has_large| {
            let of_all = [gray, HAS_LARGE.is(has_large)];
            [constants.normalize, &of_all].concat()
        };
        let base = PipelineDescription {
            name: "merge of small splats",
            vertex: &shaders::FILTERED_NORMALIZE_VERT,
            fragment: Some(&shaders::FILTERED_MERGE_FRAG),
            constants: &[],
            record: VertexRecord::NOTHING,
            topology: PrimitiveTopology::Triangles,
            colors: &[],
            depth: DepthMode::Nearest,
            is_additive: false,
        };
        let last = PipelineDescription {
            fragment: Some(kind.normalize),
            colors: color_formats(color, false),
            // Also where there is no depth: kernels may reach beyond what hides.
            depth: DepthMode::NotFarther,
            ..base
        };
        let normalize = |name, has_large| {
            ShaderPipeline::new(
                gpu,
                &PipelineDescription {
                    name,
                    constants: &of_normalize(has_large),
                    ..last
                },
            )
        };
        let pixels = u64::from(width) * u64::from(height);
        let compute = |name, shader, constants: &[ConstantValue]| {
            ShaderPipeline::compute(gpu, name, shader, constants)
        };
        let of_splats = |name, shader, values: &[ConstantValue]| match constants.flags {
            Some(flags) => ShaderPipeline::compute_for_flags(gpu, name, shader, values, flags),
            None => ShaderPipeline::compute(gpu, name, shader, values),
        };
        let storage = |name, bytes| DeviceBuffer::new(gpu, name, BufferUsage::Storage, bytes);
        Ok(Self {
            kind,
            depth: of_splats("depth of small splats", kind.depth, constants.depth)?,
            surface: (constants.surface)
                .map(|values| of_splats("surface of small splats", kind.depth, values))
                .transpose()?,
            depth_triangles: compute(
                "depth of small triangles",
                &shaders::COMPUTE_DEPTH_TRIANGLES_COMP,
                &[IS_PUSHED.is(kind.pushes_triangles)],
            )?,
            blend: of_splats(
                "blend of small splats",
                kind.blend,
                &[constants.blend, &[gray]].concat(),
            )?,
            blend_triangles: compute(
                "blend of small triangles",
                &shaders::COMPUTE_BLEND_TRIANGLES_COMP,
                &[HAS_LAMP.is(has_lamp), gray],
            )?,
            merge: ShaderPipeline::new(gpu, &base)?,
            normalize: normalize("normalize of small splats", false)?,
            normalize_all: normalize("normalize of all splats", true)?,
            front: storage("front of small splats", 4 * pixels)?,
            sums: storage("sums of small splats", sum_bytes(is_gray) * pixels)?,
            max_binding: gpu.info().max_storage_range,
            is_gray,
        })
    }

    /// The passes of a frame, and between them those of the rasterizer, which leaves its sums in `sums`.
    ///
    /// # Errors
    /// When the frame has no room for the constants of so many parts.
    pub(crate) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: ComputeInput<'_>,
        (rastered, sums): (Option<&RasterizedPart<'_>>, &Target),
        context: &Context,
        constants: UniformBlock,
    ) -> Result<(), Error> {
        let records = (list.splats as _, self.kind.record);
        let range = RecordRange {
            first: 0,
            count: list.splat_count,
        };
        let ready = BoundLists {
            list,
            splats: storage_ranges::bound(frame, context, self.max_binding, records, range)?,
            triangles: list.triangles.bound(frame, context, self.max_binding)?,
        };
        if let Some(rastered) = rastered {
            (rastered.depth)(frame);
        }
        self.clear(frame, rastered.map(|_| targets.depth()), context);
        self.depth(frame, &ready, constants);
        if let Some(rastered) = rastered {
            self.merge(frame, self.kind.passes.merge, targets.depth(), context)?;
            (rastered.blend)(frame);
        }
        self.blend(frame, &ready, constants);
        let of_raster = rastered.map(|_| sums);
        self.normalize(frame, targets, (of_raster, sums), context, constants)?;
        match &self.surface {
            Some(surface) if context.reads_depth => {
                if let Some(rastered) = rastered {
                    (rastered.surface)(frame);
                }
                self.surface(frame, &ready, surface, constants);
                self.merge(frame, self.kind.passes.surface, targets.depth(), context)
            }
            _ => Ok(()),
        }
    }

    /// Pass `clear`: empties the sums, and begins with the depth that the rasterizer left, if it drew.
    fn clear(&self, frame: &mut FrameRecorder<'_>, rastered: Option<&Target>, context: &Context) {
        let pixels = screen_bounds::pixels(context.rect_px);
        let sums = (&self.sums as _, sum_bytes(self.is_gray) * pixels);
        match rastered {
            None => frame
                .pass(self.kind.passes.clear)
                .fill(&[sums, (&self.front, 4 * pixels)], 0),
            Some(depth) => {
                frame.pass(self.kind.passes.clear).fill(&[sums], 0);
                let part = screen_bounds::area(context.rect_px);
                frame.copy_part(self.kind.passes.front, depth, part, &self.front);
            }
        }
    }

    /// Pass `depth`: the nearest pushed depth of each pixel.
    fn depth(&self, frame: &mut FrameRecorder<'_>, list: &BoundLists<'_>, constants: UniformBlock) {
        let front = BufferSlice::whole(&self.front);
        list.declared(frame.pass(self.kind.passes.depth))
            .storage(&self.front)
            .compute(|compute| {
                for &((part, uniform, count), vertices) in &list.triangles {
                    let storage = [part, vertices, front];
                    compute.bind(&self.depth_triangles, &[constants, uniform], &storage);
                    compute.items(count);
                }
                for &(part, uniform, count) in &list.splats {
                    let both = [constants, uniform];
                    let uniforms = self.kind.uniforms(&both, 0);
                    compute.bind(&self.depth, uniforms, &[part, front]);
                    compute.items(count * self.kind.sharers);
                }
            });
    }

    /// Pass `surface`: the nearest depth of each pixel that is not pushed, in the place of the others.
    fn surface(
        &self,
        frame: &mut FrameRecorder<'_>,
        list: &BoundLists<'_>,
        pipeline: &ShaderPipeline,
        constants: UniformBlock,
    ) {
        let front = BufferSlice::whole(&self.front);
        let pass = frame.pass(self.kind.passes.surface);
        let pass = pass.storage_read(list.list.splats).storage(&self.front);
        pass.compute(|compute| {
            for &(part, uniform, count) in &list.splats {
                let both = [constants, uniform];
                let uniforms = self.kind.uniforms(&both, 0);
                compute.bind(pipeline, uniforms, &[part, front]);
                compute.items(count * self.kind.sharers);
            }
        });
    }

    /// Pass `merge` or another: brings the front to the depth target, where the nearer stays.
    ///
    /// # Errors
    /// When the frame has no room for constants.
    fn merge(
        &self,
        frame: &mut FrameRecorder<'_>,
        name: &'static str,
        depth: &Target,
        context: &Context,
    ) -> Result<(), Error> {
        let picture = frame.uniform(&storage_ranges::constants(context))?;
        let pass = frame
            .pass(name)
            .depth(depth, TargetLoad::Keep)
            .fragment_storage(&self.front);
        let screen = ScreenDraw {
            pipeline: &self.merge,
            uniforms: &[picture],
            images: &[],
            storage: &[BufferSlice::whole(&self.front)],
        };
        raster_pass::full_screen(pass, &screen, context.rect_px);
        Ok(())
    }

    /// Pass `blend`, once the depth of all is known.
    fn blend(&self, frame: &mut FrameRecorder<'_>, list: &BoundLists<'_>, constants: UniformBlock) {
        let (front, sums) = (
            BufferSlice::whole(&self.front),
            BufferSlice::whole(&self.sums),
        );
        list.declared(frame.pass(self.kind.passes.blend))
            .storage_read(&self.front)
            .storage(&self.sums)
            .compute(|compute| {
                for &((part, uniform, count), vertices) in &list.triangles {
                    let storage = [part, vertices, front, sums];
                    compute.bind(&self.blend_triangles, &[constants, uniform], &storage);
                    compute.items(count);
                }
                for &(part, uniform, count) in &list.splats {
                    let both = [constants, uniform];
                    let uniforms = self.kind.uniforms(&both, 1);
                    compute.bind(&self.blend, uniforms, &[part, front, sums]);
                    compute.items(count * self.kind.sharers);
                }
            });
    }

    /// Pass `normalize`: color and depth of the picture, with the sums of what was rastered, if anything was.
    ///
    /// # Errors
    /// When the frame has no room for constants.
    fn normalize(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        (rastered, none): (Option<&Target>, &Target),
        context: &Context,
        constants: UniformBlock,
    ) -> Result<(), Error> {
        let picture = frame.uniform(&storage_ranges::constants(context))?;
        let (front, sums) = (
            BufferSlice::whole(&self.front),
            BufferSlice::whole(&self.sums),
        );
        // Every binding must be written; without rastered sums this one is not looked at.
        let large = rastered.unwrap_or(none);
        let pipeline = if rastered.is_some() {
            &self.normalize_all
        } else {
            &self.normalize
        };
        let pass = targets
            .attach(frame.pass(self.kind.passes.normalize), context)
            .fragment_storage(&self.front)
            .fragment_storage(&self.sums);
        let screen = ScreenDraw {
            pipeline,
            uniforms: &[constants, picture],
            images: &[large],
            storage: &[front, sums],
        };
        raster_pass::full_screen(pass, &screen, context.rect_px);
        Ok(())
    }
}
