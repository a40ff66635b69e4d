//! The heat map of overdraw: how many splats and triangles cover each pixel before they hide one another.
//!
//! The frame is drawn as ever, so depth and normals are those of the picture. Then `overdraw.count` draws the same lists
//! again without a depth test, adding one to a float for every pixel that a primitive covers, and `overdraw.show` puts the
//! counts as colors over the picture. Everything is rasterized, because counts are those of footprints and not of the way
//! in which they are drawn: small triangles stay triangles, and what the cut left out is not there.
//! [`crate::render::reference::count_overdraw`] says what a primitive covers.

use crate::abi::constants::MOST_OVERDRAW;
use crate::abi::specialization::{IS_ORIENTED, IS_QUAD, LARGE_ONLY};
use crate::abi::{CompiledShader, ConstantValue, shaders};
use crate::gpu::buffer::ReadbackBuffer;
use crate::gpu::frame::{FrameRecorder, TargetLoad, UniformBlock};
use crate::gpu::image::{DeviceImage as Target, ImageFormat};
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord,
};
use crate::gpu::{Error, Gpu};
use crate::pack::Footprint;
use crate::pack::falsecolor;
use crate::render::Settings;
use crate::render::technique::Technique;
use crate::render::vulkan::blended::filtered;
use crate::render::vulkan::blended::fuzzy;
use crate::render::vulkan::opaque::hardware::SplatSource;
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::{RasterList, RasterPipelines, ScreenDraw};
use crate::render::vulkan::targets::color_formats;
use crate::render::vulkan::targets::{Context, FrameTargets};
use crate::render::vulkan::{SPLAT, VERTEX};
use std::sync::Arc;

/// What the colors mean: counts with their color and its name, each twice the one before.
pub fn legend() -> impl Iterator<Item = (u32, [f32; 3], &'static str)> {
    const NAMES: [&str; 7] = [
        "dark violet",
        "indigo",
        "blue",
        "teal",
        "green",
        "light green",
        "yellow",
    ];
    NAMES.iter().enumerate().map(|(i, name)| {
        let count = 1 << i;
        (count, falsecolor::of_overdraw(count), *name)
    })
}

/// [`legend`] in one line.
pub fn legend_line() -> String {
    let parts: Vec<String> = legend()
        .map(|(count, _, name)| match count {
            1 => format!("1 {name}"),
            c if c as f32 >= MOST_OVERDRAW => format!("{c} and more {name}"),
            c => format!("{c} {name}"),
        })
        .collect();
    format!("splats and triangles in a pixel: {}", parts.join(", "))
}

/// Format of the counts: exact up to 16,777,216.
const COUNTS: ImageFormat = ImageFormat::R32Float;

/// What decides the pipelines.
#[derive(Debug, Clone, Copy, PartialEq)]
struct OverdrawVariant {
    kind: OverdrawKind,
    /// Of the picture.
    color: ImageFormat,
    /// Of the frame.
    flags: u32,
}

/// What is counted besides triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
enum OverdrawKind {
    Nothing,
    Opaque(Footprint, SplatSource),
    Fuzzy(fuzzy::FuzzyVariant),
    Filtered,
}

/// FrameCounts of one picture size.
#[derive(Debug)]
pub(crate) struct OverdrawCounter {
    gpu: Arc<Gpu>,
    pipelines: Option<OverdrawPipelines>,
    counts: Target,
    /// One for each slot of the ring.
    read: Vec<ReadbackBuffer>,
}

#[derive(Debug)]
struct OverdrawPipelines {
    variant: OverdrawVariant,
    triangles: ShaderPipeline,
    points: Option<ShaderPipeline>,
    quads: Option<ShaderPipeline>,
    show: ShaderPipeline,
}

impl OverdrawCounter {
    /// For frames in a ring of `in_flight` slots.
    ///
    /// # Errors
    /// When the device cannot blend 32-bit floats, or memory runs out.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        (width, height): (u32, u32),
        in_flight: usize,
    ) -> Result<Self, Error> {
        if !gpu.info().has_float_blend {
            return Err(Error::Unsupported {
                what: "color by overdraw",
                why: format!(
                    "{} cannot blend into 32-bit float targets; use --backend reference",
                    gpu.info().name
                ),
            });
        }
        let counts = Target::new(gpu, "counts of overdraw", COUNTS, width, height)?;
        let bytes = counts.bytes();
        Ok(Self {
            gpu: gpu.clone(),
            pipelines: None,
            counts,
            read: (0..in_flight)
                .map(|slot| ReadbackBuffer::new(gpu, &format!("overdraw of frame {slot}"), bytes))
                .collect::<Result<_, _>>()?,
        })
    }

    /// Makes the pipelines that frames of `settings` and these flags need; `fuzzy` is the variant of fuzzy splats.
    ///
    /// # Errors
    /// When a Vulkan call fails.
    pub(crate) fn ensure(
        &mut self,
        settings: &Settings,
        targets: &FrameTargets,
        (flags, fuzzy): (u32, Option<fuzzy::FuzzyVariant>),
    ) -> Result<(), Error> {
        let source = if settings.has_cut() {
            SplatSource::List
        } else {
            SplatSource::Vertices
        };
        let kind = match (Technique::of(settings), fuzzy) {
            (Technique::Nothing, _) => OverdrawKind::Nothing,
            (Technique::Fuzzy, Some(variant)) => OverdrawKind::Fuzzy(variant),
            (Technique::Filtered, _) => OverdrawKind::Filtered,
            _ => OverdrawKind::Opaque(settings.footprint(), source),
        };
        let variant = OverdrawVariant {
            kind,
            color: targets.color().format,
            flags,
        };
        if self.pipelines.as_ref().is_none_or(|p| p.variant != variant) {
            self.pipelines = Some(OverdrawPipelines::new(&self.gpu, variant)?);
        }
        Ok(())
    }

    /// FrameCounts what a frame drew, shows it in place of its picture, and has the counts read back.
    pub(crate) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        list: &RasterList<'_>,
        context: &Context,
        constants: UniformBlock,
    ) {
        let Some(pipelines) = &self.pipelines else {
            unreachable!("prepare made the pipelines")
        };
        let pass = frame
            .pass("overdraw.count")
            .color(&self.counts, TargetLoad::Clear([0.0; 4]));
        let counting = RasterPipelines {
            polygons: None,
            reads_textures: false,
            triangles: Some(&pipelines.triangles),
            points: pipelines.points.as_ref(),
            quads: pipelines.quads.as_ref(),
        };
        raster_pass::draw(pass, list, counting, context, constants);
        let [r, g, b] = context.background;
        let pass = frame
            .pass("overdraw.show")
            .color(targets.color(), TargetLoad::Clear([r, g, b, 0.0]));
        let (uniforms, images) = ([constants], [&self.counts]);
        let screen = ScreenDraw::of_images(&pipelines.show, &uniforms, &images);
        raster_pass::full_screen(pass, &screen, context.whole_px());
        let into = &self.read[frame.slot()];
        frame.read_back("overdraw.read", &self.counts, into);
    }

    /// The counts of the last frame in a slot of the ring, which was waited for; row by row from the top left.
    pub(crate) fn of_slot(&mut self, slot: usize) -> impl Iterator<Item = u32> {
        let bytes = ReadbackBuffer::bytes(&mut self.read[slot]);
        // The buffer may be longer than the picture.
        let pixels = self.counts.width as usize * self.counts.height as usize;
        bytes
            .chunks_exact(size_of::<f32>())
            .take(pixels)
            .map(|value| bytemuck::pod_read_unaligned::<f32>(value) as u32)
    }
}

impl OverdrawPipelines {
    fn new(gpu: &Arc<Gpu>, variant: OverdrawVariant) -> Result<Self, Error> {
        let pipeline =
            |d: &PipelineDescription<'_>| ShaderPipeline::for_flags(gpu, d, variant.flags);
        let base = PipelineDescription {
            name: "overdraw.count triangles",
            vertex: &shaders::TRIANGLES_DRAW_VERT,
            fragment: Some(&shaders::OVERDRAW_COUNT_FRAG),
            constants: &[],
            record: VERTEX,
            topology: PrimitiveTopology::Triangles,
            colors: &[COUNTS],
            depth: DepthMode::None,
            is_additive: true,
        };
        let (vertex, fragment, record): (&CompiledShader, &CompiledShader, VertexRecord) =
            match variant.kind {
                OverdrawKind::Nothing => (base.vertex, &shaders::OVERDRAW_COUNT_FRAG, VERTEX),
                OverdrawKind::Opaque(Footprint::Square, SplatSource::List) => (
                    &shaders::SPLATS_SQUARE_VERT,
                    &shaders::OVERDRAW_COUNT_FRAG,
                    SPLAT,
                ),
                OverdrawKind::Opaque(Footprint::Square, SplatSource::Vertices) => (
                    &shaders::POINTS_DRAW_VERT,
                    &shaders::OVERDRAW_COUNT_FRAG,
                    VERTEX,
                ),
                OverdrawKind::Opaque(_, SplatSource::List) => (
                    &shaders::SPLATS_ROUND_VERT,
                    &shaders::OVERDRAW_ROUND_FRAG,
                    SPLAT,
                ),
                OverdrawKind::Opaque(_, SplatSource::Vertices) => (
                    &shaders::POINTS_ROUND_VERT,
                    &shaders::OVERDRAW_ROUND_FRAG,
                    VERTEX,
                ),
                OverdrawKind::Fuzzy(fuzzy) if fuzzy.from_vertices => (
                    &shaders::FUZZY_BLEND_POINTS_VERT,
                    &shaders::OVERDRAW_FUZZY_FRAG,
                    VERTEX,
                ),
                OverdrawKind::Fuzzy(_) => (
                    &shaders::FUZZY_BLEND_VERT,
                    &shaders::OVERDRAW_FUZZY_FRAG,
                    fuzzy::RECORD,
                ),
                OverdrawKind::Filtered => (
                    &shaders::FILTERED_BLEND_VERT,
                    &shaders::OVERDRAW_FILTERED_FRAG,
                    filtered::RECORD,
                ),
            };
        let splats = |topology: PrimitiveTopology| {
            let is_oriented = matches!(variant.kind, OverdrawKind::Opaque(footprint, _) if footprint == Footprint::Oriented);
            let opaque = [
                IS_QUAD.is(topology == PrimitiveTopology::Quads),
                IS_ORIENTED.is(is_oriented),
            ];
            let fuzzy;
            let constants: &[ConstantValue] = match variant.kind {
                OverdrawKind::Nothing => &[],
                OverdrawKind::Fuzzy(variant) => {
                    fuzzy = variant.of_blend(topology);
                    &fuzzy
                }
                OverdrawKind::Filtered => &[LARGE_ONLY.is(false)],
                OverdrawKind::Opaque(Footprint::Square, _) => &opaque[..1],
                OverdrawKind::Opaque(..) => &opaque,
            };
            pipeline(&PipelineDescription {
                name: "overdraw.count splats",
                vertex,
                fragment: Some(fragment),
                constants,
                record,
                topology,
                ..base
            })
        };
        Ok(Self {
            variant,
            triangles: pipeline(&base)?,
            points: match variant.kind {
                OverdrawKind::Nothing => None,
                _ => Some(splats(PrimitiveTopology::Points)?),
            },
            quads: match variant.kind {
                // Filtered splats are points, however large.
                OverdrawKind::Nothing | OverdrawKind::Filtered => None,
                _ => Some(splats(PrimitiveTopology::Quads)?),
            },
            show: pipeline(&PipelineDescription {
                name: "overdraw.show",
                vertex: &shaders::FILTERED_NORMALIZE_VERT,
                fragment: Some(&shaders::OVERDRAW_SHOW_FRAG),
                record: VertexRecord::NOTHING,
                colors: color_formats(variant.color, false),
                is_additive: false,
                ..base
            })?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::stats::OverdrawSummary;

    #[test]
    fn figures_are_those_of_the_pixels() {
        let found = OverdrawSummary::of([0, 3, 1, 0, 8]);
        let expected = OverdrawSummary {
            covered: 3,
            primitives: 12,
            most: 8,
        };
        assert_eq!(found, expected);
        assert!((found.mean() - 4.0).abs() < 1e-12);
        assert_eq!(OverdrawSummary::of([0; 5]).mean(), 0.0);
        let both = found.with(OverdrawSummary::of([1, 1, 2]));
        assert_eq!((both.covered, both.primitives, both.most), (6, 16, 8));
    }

    #[test]
    fn the_legend_goes_by_twos_to_the_end_of_the_ramp() {
        let shown: Vec<(u32, [f32; 3], &str)> = legend().collect();
        assert!(shown.windows(2).all(|w| w[1].0 == 2 * w[0].0));
        let (last, color, _) = shown[shown.len() - 1];
        assert_eq!(last as f32, MOST_OVERDRAW);
        assert_eq!(color, falsecolor::ramp(1.0));
        assert_eq!(color, falsecolor::of_overdraw(last + 1));
        assert_ne!(color, falsecolor::of_overdraw(last - 1));
        assert_eq!((shown[0].0, shown[0].1), (1, falsecolor::ramp(0.0)));
        let line = legend_line();
        assert!(line.contains("1 dark violet, 2 indigo") && line.ends_with("64 and more yellow"));
    }
}
