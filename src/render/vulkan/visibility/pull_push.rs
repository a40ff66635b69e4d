//! Pull-push: a pyramid of half sizes, filled upward from the foreground and downward into the holes.
//!
//! Sources: Grossman and Dally, *Point Sample Rendering* (1998); Gortler et al., *The Lumigraph* (SIGGRAPH 1996), section
//! 3.4.2. Level 0 is the picture; each next level has half its sides, rounded up, down to one pixel.

use crate::abi::shaders;
use crate::gpu::frame::{FrameRecorder, TargetLoad, UniformBlock};
use crate::gpu::image::DeviceImage as Target;
use crate::gpu::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord,
};
use crate::gpu::{Error, Gpu};
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::raster_pass::ScreenDraw;
use crate::render::vulkan::targets::{Context, FrameTargets};
use crate::render::vulkan::visibility::targets::{FRONTS, PICKED, attach_last, last_pass};
use std::sync::Arc;

/// Names of the passes by level: the profiler adds up nothing.
const NAMES: [[&str; 2]; 16] = [
    ["visibility.pull 1", "visibility.push 1"],
    ["visibility.pull 2", "visibility.push 2"],
    ["visibility.pull 3", "visibility.push 3"],
    ["visibility.pull 4", "visibility.push 4"],
    ["visibility.pull 5", "visibility.push 5"],
    ["visibility.pull 6", "visibility.push 6"],
    ["visibility.pull 7", "visibility.push 7"],
    ["visibility.pull 8", "visibility.push 8"],
    ["visibility.pull 9", "visibility.push 9"],
    ["visibility.pull 10", "visibility.push 10"],
    ["visibility.pull 11", "visibility.push 11"],
    ["visibility.pull 12", "visibility.push 12"],
    ["visibility.pull 13", "visibility.push 13"],
    ["visibility.pull 14", "visibility.push 14"],
    ["visibility.pull 15", "visibility.push 15"],
    ["visibility.pull 16", "visibility.push 16"],
];

/// One level above the picture.
#[derive(Debug)]
struct PullPushLevel {
    /// What was pulled: colors and holes.
    pulled: Target,
    fronts: Target,
    /// The same with holes filled from the next level; none for the last, which has none.
    pushed: Option<Target>,
}

/// How many levels fill the holes of splats of `largest_px` pixels: the pixels of the last have twice their side, so
/// that the four around a hole include the center. More would bring in color from afar.
fn level_count(largest_px: f32) -> usize {
    (1..NAMES.len())
        .find(|&count| (1u32 << count) as f32 >= 2.0 * largest_px)
        .unwrap_or(NAMES.len())
}

/// The pixels of a level that have part of a rectangle of the picture below them.
fn halved([left, top, right, bottom]: [u32; 4], level: usize) -> [u32; 4] {
    let up = |end: u32| end.div_ceil(1 << level);
    [left >> level, top >> level, up(right), up(bottom)]
}

/// Pipelines and levels.
#[derive(Debug)]
pub(super) struct ColorPyramid {
    pull: ShaderPipeline,
    push: ShaderPipeline,
    fill: ShaderPipeline,
    levels: Vec<PullPushLevel>,
}

impl ColorPyramid {
    /// Levels for pictures of `width` x `height` pixels: at least one.
    ///
    /// # Errors
    /// When memory runs out.
    pub(super) fn new(gpu: &Arc<Gpu>, (width, height): (u32, u32)) -> Result<Self, Error> {
        let mut levels = Vec::new();
        let (mut width, mut height) = (width, height);
        loop {
            (width, height) = (width.div_ceil(2), height.div_ceil(2));
            let is_top = width == 1 && height == 1;
            let number = levels.len() + 1;
            let make = |what: &str, format| {
                Target::new(
                    gpu,
                    &format!("{what}, level {number}"),
                    format,
                    width,
                    height,
                )
            };
            levels.push(PullPushLevel {
                pulled: make("pulled", PICKED)?,
                fronts: make("fronts", FRONTS)?,
                pushed: (!is_top).then(|| make("pushed", PICKED)).transpose()?,
            });
            if is_top {
                break;
            }
        }
        let base = PipelineDescription {
            name: "visibility.pull",
            vertex: &shaders::FILTERED_NORMALIZE_VERT,
            fragment: Some(&shaders::VISIBILITY_PULL_FRAG),
            constants: &[],
            record: VertexRecord::NOTHING,
            topology: PrimitiveTopology::Triangles,
            colors: &[PICKED, FRONTS],
            depth: DepthMode::None,
            is_additive: false,
        };
        Ok(Self {
            pull: ShaderPipeline::new(gpu, &base)?,
            push: ShaderPipeline::new(
                gpu,
                &PipelineDescription {
                    name: "visibility.push",
                    fragment: Some(&shaders::VISIBILITY_PUSH_FRAG),
                    colors: &[PICKED],
                    ..base
                },
            )?,
            fill: last_pass(gpu, "visibility.fill", &shaders::VISIBILITY_FILL_FRAG)?,
            levels,
        })
    }

    /// All passes over the pyramid, within what `rect_px` covers of each level: beside it there is nothing. `finest` are
    /// colors and fronts of the picture. No splat is larger than `largest_px`.
    pub(super) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        finest: [&Target; 2],
        largest_px: f32,
        (context, rect_px): (&Context, [u32; 4]),
        constants: UniformBlock,
    ) {
        let levels = &self.levels[..level_count(largest_px).min(self.levels.len())];
        let Some(top) = levels.len().checked_sub(1) else {
            unreachable!("there is a level at least")
        };
        let filled = |at: usize| match &levels[at].pushed {
            Some(pushed) if at < top => pushed,
            _ => &levels[at].pulled,
        };
        let uniforms = [constants];
        let mut from = finest;
        for (at, (level, [name, _])) in levels.iter().zip(NAMES).enumerate() {
            let pass = frame
                .pass(name)
                .color(&level.pulled, TargetLoad::Clear([0.0; 4]))
                .color(&level.fronts, TargetLoad::Clear([0.0; 4]));
            let screen = ScreenDraw::of_images(&self.pull, &uniforms, &from);
            raster_pass::full_screen(pass, &screen, halved(rect_px, at + 1));
            from = [&level.pulled, &level.fronts];
        }
        for (at, [_, name]) in (0..top).zip(NAMES).rev() {
            let (level, pushed) = (&levels[at], filled(at));
            let images = [
                &level.pulled,
                &level.fronts,
                filled(at + 1),
                &levels[at + 1].fronts,
            ];
            let pass = frame.pass(name).color(pushed, TargetLoad::Clear([0.0; 4]));
            let screen = ScreenDraw::of_images(&self.push, &uniforms, &images);
            raster_pass::full_screen(pass, &screen, halved(rect_px, at + 1));
        }
        let images = [finest[0], finest[1], filled(0), &levels[0].fronts];
        let pass = attach_last(frame, "visibility.fill", targets, context);
        let screen = ScreenDraw::of_images(&self.fill, &uniforms, &images);
        raster_pass::full_screen(pass, &screen, rect_px);
    }
}
