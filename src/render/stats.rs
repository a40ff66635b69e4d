//! Cost of one frame: the stages on the CPU with their clocks and their spans in the log, the passes on the device.

use crate::gpu::frame::PassTime;
use crate::gpu::frame::{DeviceTimes, PassCounters};
use crate::patches::PatchCounts;
use std::time::Instant;

/// FrameCounts of one frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct FrameCounts {
    /// Nodes and leaves that the cut looked at, when it was chosen.
    pub nodes_visited: u64,
    /// Splats of the cut that are left out because nearer ones hide them, or because they are smaller than a pixel and contain
    /// no center.
    pub hidden: u64,
    /// Triangles of the cut that are left out because they lie between the centers of pixels.
    pub between: u64,
    /// Splats drawn.
    pub splats: u64,
    /// Triangles drawn.
    pub triangles: u64,
    /// Vertices drawn as points.
    pub points: u64,
    /// Bytes of the draw lists.
    pub draw_list_bytes: u64,
    /// Error patches, which are among the splats.
    pub patches: PatchCounts,
}

/// Numbers of primitives that cover the pixels of a picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct OverdrawSummary {
    /// Pixels that one covers at least.
    pub covered: u64,
    /// Sum over all pixels.
    pub primitives: u64,
    /// The largest count of a pixel.
    pub most: u32,
}

impl OverdrawSummary {
    /// Summary of counts of pixels.
    pub fn of(counts: impl IntoIterator<Item = u32>) -> Self {
        counts.into_iter().fold(Self::default(), |sum, count| Self {
            covered: sum.covered + u64::from(count > 0),
            primitives: sum.primitives + u64::from(count),
            most: sum.most.max(count),
        })
    }

    /// Summary of this picture and another together.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self {
            covered: self.covered + other.covered,
            primitives: self.primitives + other.primitives,
            most: self.most.max(other.most),
        }
    }

    /// Mean over the pixels that are covered; 0 of none.
    pub fn mean(&self) -> f64 {
        if self.covered > 0 {
            self.primitives as f64 / self.covered as f64
        } else {
            0.0
        }
    }
}

impl std::fmt::Display for OverdrawSummary {
    /// In words, without an end of line.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "overdraw: mean {:.2} in {} covered pixels, most {}",
            self.mean(),
            self.covered,
            self.most
        )
    }
}

/// Time of the processor's own drawing.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct HostWork {
    /// Drawing splats in the place of a software device, milliseconds; a part of the time of packing.
    pub drawing_ms: f64,
    /// Looks over a picture that the processor drew, such as photographs, milliseconds.
    pub look_ms: f64,
}

/// Cost of one frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FrameTimes {
    /// From setting the camera to the finished image on the device, milliseconds.
    pub frame_ms: f64,
    /// Choosing the cut, milliseconds.
    pub cut_ms: f64,
    /// Writing the draw lists, milliseconds.
    pub pack_ms: f64,
    /// Work that the processor does in the place of a device.
    pub host: HostWork,
    /// Making the draw lists visible to the device, milliseconds.
    pub upload_ms: f64,
    /// Recording and submitting, milliseconds.
    pub submit_ms: f64,
    /// Waiting for the device, milliseconds.
    pub wait_ms: f64,
    /// When they began.
    pub starts: StageStarts,
    /// Each pass on the device.
    pub passes: Vec<PassTime>,
    /// Times of the passes on the device's clock.
    pub device: DeviceTimes,
    /// Counts of each pass; empty unless [`Engine::measure`](crate::render::engine::Engine::measure) asked for it.
    pub counters: Vec<PassCounters>,
    /// Counts of what was drawn.
    pub counts: FrameCounts,
    /// Overdraw, where that is shown ([`ColorBy::Overdraw`](crate::pack::ColorBy::Overdraw)).
    pub overdraw: Option<OverdrawSummary>,
    /// Work that was not done again; the counts are those of what is drawn all the same.
    pub kept: KeptWork,
    /// Bytes that the host wrote for the device: draw lists, unless they were kept, and uniform blocks.
    pub uploaded_bytes: u64,
}

/// Work that a frame has from one before it, see
/// [`Renderer::keep_lists`](crate::render::vulkan::renderer::VulkanRenderer::keep_lists).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum KeptWork {
    /// Nothing, or it has no lists.
    #[default]
    Nothing,
    /// The cut; the lists were written.
    Cut,
    /// The draw lists.
    Lists,
}

/// The time of cuts that were chosen ahead of their frame.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct CutAhead {
    /// Milliseconds of all of them.
    pub(crate) ms: f64,
    /// At least one was chosen and not kept from before.
    pub(crate) is_new: bool,
}

/// A stage of a frame on the CPU. Stages follow each other in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameStage {
    /// Choosing the nodes.
    Cut,
    /// Writing the draw lists.
    Pack,
    /// Making what was written visible to the device.
    Upload,
    /// Recording and submitting.
    Submit,
    /// Waiting for the device.
    Wait,
    /// Looking over a picture that the processor drew.
    Look,
}

impl FrameStage {
    /// All of them, in order.
    pub const ALL: [Self; 6] = [
        Self::Cut,
        Self::Pack,
        Self::Upload,
        Self::Submit,
        Self::Wait,
        Self::Look,
    ];

    /// Name in tables, files and the log.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cut => "cut",
            Self::Pack => "pack",
            Self::Upload => "upload",
            Self::Submit => "submit",
            Self::Wait => "wait",
            Self::Look => "look",
        }
    }

    /// Starts its clock and its span.
    pub(super) fn begin(self) -> RunningStage {
        let span = match self {
            Self::Cut => tracing::debug_span!("cut"),
            Self::Pack => tracing::debug_span!("pack"),
            Self::Upload => tracing::debug_span!("upload"),
            Self::Submit => tracing::debug_span!("submit"),
            Self::Wait => tracing::debug_span!("wait"),
            Self::Look => tracing::debug_span!("look"),
        };
        RunningStage {
            stage: self,
            span: span.entered(),
            start: Instant::now(),
        }
    }
}

/// A stage that runs; dropped without an end it leaves no time.
pub(super) struct RunningStage {
    stage: FrameStage,
    span: tracing::span::EnteredSpan,
    start: Instant,
}

impl RunningStage {
    /// Stops clock and span, and books the time.
    pub(super) fn end(self, times: &mut FrameTimes) {
        let ms = self.start.elapsed().as_secs_f64() * 1e3;
        drop(self.span);
        *times.of_mut(self.stage) = ms;
        times.starts.stages[self.stage as usize] = Some(self.start);
    }
}

/// When the parts of a frame began, on the processor's clock; `None` for what the frame did not do.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct StageStarts {
    /// The frame.
    pub frame: Option<Instant>,
    /// Submission to the device.
    pub submission: Option<Instant>,
    stages: [Option<Instant>; FrameStage::ALL.len()],
}

impl StageStarts {
    /// The beginning of a stage.
    pub fn of(&self, stage: FrameStage) -> Option<Instant> {
        self.stages[stage as usize]
    }
}

impl FrameTimes {
    /// Time of a stage, milliseconds; 0 when the frame did not have it.
    pub fn of(&self, stage: FrameStage) -> f64 {
        match stage {
            FrameStage::Cut => self.cut_ms,
            FrameStage::Pack => self.pack_ms,
            FrameStage::Upload => self.upload_ms,
            FrameStage::Submit => self.submit_ms,
            FrameStage::Wait => self.wait_ms,
            FrameStage::Look => self.host.look_ms,
        }
    }

    fn of_mut(&mut self, stage: FrameStage) -> &mut f64 {
        match stage {
            FrameStage::Cut => &mut self.cut_ms,
            FrameStage::Pack => &mut self.pack_ms,
            FrameStage::Upload => &mut self.upload_ms,
            FrameStage::Submit => &mut self.submit_ms,
            FrameStage::Wait => &mut self.wait_ms,
            FrameStage::Look => &mut self.host.look_ms,
        }
    }
}
