//! The figures of a profile, all views together, as `surfel profile --json` writes them.

use super::profile::{FrameProfile, ProfileSample};
use super::{ValueDistribution, frames};
use crate::gpu::frame::{PassCounters, PipelineStatistics};
use crate::gpu::profile::{CounterTest, SelfTest};
use crate::patches::PatchCounts;
use crate::render::stats::{FrameStage, FrameTimes};
use serde::Serialize;

/// Largest share by which the passes may miss the frame's time on the device.
pub const SUM_TOLERANCE: f64 = 0.05;
/// Largest share of a frame that measuring may cost without a warning.
pub const COST_TOLERANCE: f64 = 0.05;

/// Time of the whole frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameReport {
    /// From setting the camera to the finished picture, milliseconds, with timestamps.
    pub wall_ms: ValueDistribution,
    /// The same without timestamps; `None` where there are none.
    pub wall_without_timestamps_ms: Option<ValueDistribution>,
    /// From the first command on the device to the end of the last; `None` without timestamps.
    pub device_ms: Option<ValueDistribution>,
}

/// One pass.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PassReport {
    /// Name of the pass.
    pub name: &'static str,
    /// Time on the device in the frames that had the pass, milliseconds; `None` without timestamps.
    pub gpu_ms: Option<ValueDistribution>,
    /// Part of the time of all passes, 0 to 1.
    pub share: f64,
    /// Frames that had it.
    pub frames: usize,
    /// Samples that passed the depth test; `None` where the device does not count them exactly.
    pub samples: Option<ValueDistribution>,
    /// The same a covered pixel of the picture.
    pub overdraw: Option<ValueDistribution>,
    /// Bytes of targets loaded, from the description of the pass.
    pub loaded_bytes: ValueDistribution,
    /// Bytes of targets stored, from the description of the pass.
    pub stored_bytes: ValueDistribution,
    /// The counters of the pipeline that the device counts exactly.
    pub pipeline: Vec<CounterReport>,
}

/// One counter of the pipeline in one pass.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CounterReport {
    /// Name of the counter, one of [`PipelineStatistics::named`].
    pub name: &'static str,
    /// What it counted.
    pub count: ValueDistribution,
}

/// One stage on the CPU.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageReport {
    /// Name of the stage.
    pub name: &'static str,
    /// Time of the stage, milliseconds.
    pub ms: ValueDistribution,
    /// Part of the time of all frames, 0 to 1.
    pub share: f64,
}

/// What was drawn.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CountReport {
    /// Nodes and leaves looked at.
    pub nodes_visited: ValueDistribution,
    /// Splats drawn.
    pub splats: ValueDistribution,
    /// Triangles drawn.
    pub triangles: ValueDistribution,
    /// Vertices drawn as points.
    pub points: ValueDistribution,
    /// Pixels of the picture.
    pub pixels: u64,
    /// Pixels that something was drawn to.
    pub covered_pixels: ValueDistribution,
    /// Samples that passed the depth test, in all passes; `None` where the device does not count them exactly.
    pub samples: Option<ValueDistribution>,
    /// Samples a covered pixel.
    pub overdraw: Option<ValueDistribution>,
    /// Error patches; `None` where no frame has any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub patches: Option<PatchReport>,
}

/// Error patches, and nodes that are none.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PatchReport {
    /// Patches up to 2, 4, 8, 16, 32 pixels, and larger ones.
    pub sizes: [ValueDistribution; 6],
    /// Nodes refused for their cone, the near plane, their error at a silhouette, elsewhere, their shade, their size.
    pub refused: [ValueDistribution; 6],
}

/// What was moved.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ByteReport {
    /// Draw lists.
    pub draw_lists: ValueDistribution,
    /// Draw lists and uniform blocks: all that the processor writes for a frame.
    pub uploaded: ValueDistribution,
    /// Targets that passes load, from their descriptions.
    pub loaded: ValueDistribution,
    /// Targets that passes store, from their descriptions.
    pub stored: ValueDistribution,
}

/// Whether all this can be believed, and what it cost.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProofReport {
    /// Passes in one submission against passes alone; `None` without timestamps.
    pub self_test: Option<SelfTest>,
    /// Which counters are exact; `None` for the mirror.
    pub counter_test: Option<CounterTest>,
    /// Sum of the passes over the frame's time on the device, median of the frames; `None` without timestamps.
    pub passes_of_device: Option<f64>,
    /// Time of a frame on the device over what the processor saw of it, median; at most 1 if both clocks run alike.
    pub device_of_host: Option<f64>,
    /// What timestamps cost a frame, milliseconds: the frame with them less the same without, median and spread
    /// over the views. Below 0 it is noise.
    pub cost_ms: Option<ValueDistribution>,
    /// Between which bounds its median lies, with a probability of 95 percent.
    pub cost_bounds_ms: Option<[f64; 2]>,
    /// The median of that over the median frame without timestamps.
    pub cost_share: Option<f64>,
    /// How times of the device are put on the processor's clock, in a sentence.
    pub clock: &'static str,
    /// Largest error of the two clocks against each other, milliseconds; `None` where frames are anchored by
    /// their submission.
    pub clock_error_ms: Option<f64>,
}

/// The figures of a profile.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProfileReport {
    /// Views measured.
    pub frames: usize,
    /// The whole frame.
    pub frame: FrameReport,
    /// Each pass, in the order in which they first ran.
    pub passes: Vec<PassReport>,
    /// Each stage on the CPU, in order.
    pub cpu: Vec<StageReport>,
    /// Choosing the photographs of a view, milliseconds, which is no part of a frame; `None` without photographs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub photo_choice_ms: Option<ValueDistribution>,
    /// What was drawn.
    pub counts: CountReport,
    /// What was moved.
    pub bytes: ByteReport,
    /// Whether it can be believed.
    pub profiling: ProofReport,
    /// What cannot be believed, in sentences.
    pub warnings: Vec<String>,
}

impl ProofReport {
    /// Tells whether timestamps cost more time than noise explains.
    pub fn costs_time(&self) -> bool {
        self.cost_bounds_ms.is_some_and(|[low, _]| low > 0.0)
    }
}

fn over<T>(items: &[T], of: impl Fn(&T) -> f64) -> ValueDistribution {
    ValueDistribution::of(&items.iter().map(of).collect::<Vec<_>>())
}

/// Of the items that have it; `None` when none has.
fn known<T>(items: &[T], of: impl Fn(&T) -> Option<f64>) -> Option<ValueDistribution> {
    let values: Vec<f64> = items.iter().filter_map(of).collect();
    (!values.is_empty()).then(|| ValueDistribution::of(&values))
}

/// From the submission until the processor saw the end, milliseconds.
fn host_ms(times: &FrameTimes) -> Option<f64> {
    let before = times.starts.submission? - times.starts.frame?;
    Some(times.frame_ms - before.as_secs_f64() * 1e3)
}

/// Error patches of all views, if there are any.
fn patches(samples: &[ProfileSample]) -> Option<PatchReport> {
    let counts = |s: &ProfileSample| s.times.counts.patches;
    if samples.iter().all(|s| counts(s) == PatchCounts::default()) {
        return None;
    }
    let refused = |s: &ProfileSample| {
        let of = counts(s).refused;
        [of.never, of.near, of.rim, of.inside, of.shade, of.size]
    };
    Some(PatchReport {
        sizes: std::array::from_fn(|i| over(samples, |s| counts(s).sizes[i] as f64)),
        refused: std::array::from_fn(|i| over(samples, |s| refused(s)[i] as f64)),
    })
}

impl ProfileReport {
    /// Sums up all views of a profile.
    pub fn of(profile: &FrameProfile) -> Self {
        let samples = &profile.samples;
        let wall: f64 = profile.frames().map(|t| t.frame_ms).sum();
        let cpu = FrameStage::ALL
            .into_iter()
            .map(|stage| {
                let sum: f64 = profile.frames().map(|t| t.of(stage)).sum();
                StageReport {
                    name: stage.name(),
                    ms: frames::stage_ms(profile.frames(), stage),
                    share: if wall > 0.0 { sum / wall } else { 0.0 },
                }
            })
            .collect();
        let count = |of: fn(&FrameTimes) -> u64| over(samples, |s| of(&s.times) as f64);
        let moved = |of: fn(&PassCounters) -> u64| {
            over(samples, |s| s.counters.iter().map(of).sum::<u64>() as f64)
        };
        let mut report = Self {
            frames: samples.len(),
            frame: FrameReport {
                wall_ms: frames::frame_ms(profile.frames()),
                wall_without_timestamps_ms: known(samples, |s| s.plain_ms),
                device_ms: known(samples, |s| s.times.device.frame_ms),
            },
            passes: passes(profile),
            cpu,
            photo_choice_ms: None,
            counts: CountReport {
                nodes_visited: count(|t| t.counts.nodes_visited),
                splats: count(|t| t.counts.splats),
                triangles: count(|t| t.counts.triangles),
                points: count(|t| t.counts.points),
                pixels: profile.picture_pixels,
                covered_pixels: over(samples, |s| s.covered_pixels as f64),
                samples: known(samples, |s| Some(profile.samples_of(s, None)? as f64)),
                overdraw: known(samples, |s| profile.overdraw_of(s)),
                patches: patches(samples),
            },
            bytes: ByteReport {
                draw_lists: count(|t| t.counts.draw_list_bytes),
                uploaded: count(|t| t.uploaded_bytes),
                loaded: moved(|c| c.loaded_bytes),
                stored: moved(|c| c.stored_bytes),
            },
            profiling: proof(profile),
            warnings: Vec::new(),
        };
        report.warnings = report.doubts();
        report
    }

    /// What cannot be believed, in sentences.
    fn doubts(&self) -> Vec<String> {
        let mut out = Vec::new();
        let proof = &self.profiling;
        if let Some(test) = proof.self_test.as_ref().filter(|t| !t.agrees) {
            let rows: Vec<String> = test
                .rows
                .iter()
                .map(|r| {
                    format!(
                        "{} {:.2} ms among others, {:.2} ms alone",
                        r.name, r.together_ms, r.alone_ms
                    )
                })
                .collect();
            out.push(format!(
                "pass times do not agree with the processor's clock in the self-test ({}): compare frames, not passes",
                rows.join("; ")
            ));
        }
        if let (Some(sum), Some(device)) = (proof.passes_of_device, self.frame.device_ms)
            && (sum - 1.0).abs() > SUM_TOLERANCE
        {
            out.push(format!(
                "the passes are {:.1} % of the frame's {:.3} ms on the device: the rest lies outside of them",
                100.0 * sum,
                device.median
            ));
        }
        if let Some(ratio) = proof.device_of_host
            && ratio > 1.0 + SUM_TOLERANCE
        {
            out.push(format!(
                "by its timestamps the device took {ratio:.2} times as long as the processor waited: its clock runs at another speed than it says"
            ));
        }
        if let (Some(share), Some(cost)) = (proof.cost_share, proof.cost_ms)
            && share > COST_TOLERANCE
            && proof.costs_time()
        {
            out.push(format!(
                "timestamps cost {:.1} % of a frame ({:.3} ms): the frame without them is the true one",
                100.0 * share,
                cost.median
            ));
        }
        out
    }
}

fn passes(profile: &FrameProfile) -> Vec<PassReport> {
    let mut rows: Vec<PassReport> = frames::passes(profile.frames())
        .into_iter()
        .map(|p| row(p.name, Some(p.ms), p.share, p.frames))
        .collect();
    // Without timestamps the counters know the names.
    for sample in &profile.samples {
        for counters in &sample.counters {
            if rows.iter().all(|r| r.name != counters.name) {
                let had = |s: &&ProfileSample| s.counters.iter().any(|c| c.name == counters.name);
                let frames = profile.samples.iter().filter(had).count();
                rows.push(row(counters.name, None, 0.0, frames));
            }
        }
    }
    for row in &mut rows {
        let name = row.name;
        let of = |sample: &ProfileSample, value: &dyn Fn(&PassCounters) -> Option<u64>| {
            let mut passes = sample.counters.iter().filter(|c| c.name == name).peekable();
            passes.peek()?;
            passes.map(value).sum::<Option<u64>>().map(|v| v as f64)
        };
        let all = |value: &dyn Fn(&PassCounters) -> Option<u64>| {
            known(&profile.samples, |s| of(s, value))
        };
        if profile.counts("samples") {
            row.samples = all(&|c| c.samples);
            row.overdraw = known(&profile.samples, |s| {
                let covered = s.covered_pixels;
                (covered > 0).then_some(of(s, &|c| c.samples)? / covered as f64)
            });
        }
        row.loaded_bytes = all(&|c| Some(c.loaded_bytes)).unwrap_or_default();
        row.stored_bytes = all(&|c| Some(c.stored_bytes)).unwrap_or_default();
        let names = PipelineStatistics::default().named();
        for (index, (counter, _)) in names.into_iter().enumerate() {
            if profile.counts(counter)
                && let Some(count) = all(&|c| Some(c.pipeline?.named()[index].1))
            {
                row.pipeline.push(CounterReport {
                    name: counter,
                    count,
                });
            }
        }
    }
    rows
}

fn row(
    name: &'static str,
    gpu_ms: Option<ValueDistribution>,
    share: f64,
    frames: usize,
) -> PassReport {
    PassReport {
        name,
        gpu_ms,
        share,
        frames,
        samples: None,
        overdraw: None,
        loaded_bytes: ValueDistribution::default(),
        stored_bytes: ValueDistribution::default(),
        pipeline: Vec::new(),
    }
}

fn proof(profile: &FrameProfile) -> ProofReport {
    let samples = &profile.samples;
    let cost = |s: &ProfileSample| Some(s.times.frame_ms - s.plain_ms?);
    let costs: Vec<f64> = samples.iter().filter_map(cost).collect();
    let cost_ms = known(samples, cost);
    let plain = known(samples, |s| s.plain_ms);
    let ratio = |part: &dyn Fn(&FrameTimes) -> Option<f64>,
                 whole: &dyn Fn(&FrameTimes) -> Option<f64>| {
        known(samples, |s| {
            let whole = whole(&s.times)?;
            (whole > 0.0).then_some(part(&s.times)? / whole)
        })
        .map(|d| d.median)
    };
    ProofReport {
        self_test: profile.proof.self_test.clone(),
        counter_test: profile.proof.counter_test.clone(),
        passes_of_device: ratio(&|t| Some(t.passes.iter().map(|p| p.ms).sum()), &|t| {
            t.device.frame_ms
        }),
        device_of_host: ratio(&|t| t.device.frame_ms, &host_ms),
        cost_ms,
        cost_bounds_ms: super::median_bounds(&costs),
        cost_share: match (cost_ms, plain) {
            (Some(cost), Some(plain)) if plain.median > 0.0 => Some(cost.median / plain.median),
            _ => None,
        },
        clock: profile.clock(),
        clock_error_ms: profile.clock_error_ms(),
    }
}
