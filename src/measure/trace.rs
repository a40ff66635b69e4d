//! The trace of a profile: the Trace Event Format of Chrome, which Perfetto and chrome://tracing show.
//!
//! CPU and GPU are two tracks on the processor's clock. Where the device has calibrated timestamps its clock was read beside
//! the processor's after each frame; elsewhere the first timestamp of a frame is put at its submission, the earliest
//! moment at which it can have been taken, and the trace says so.

use super::profile::{FrameProfile, ProfileSample};
use crate::render::stats::FrameStage;
use serde_json::{Value, json};
use std::time::Instant;

const PROCESS: u32 = 1;
const CPU: u32 = 1;
const GPU: u32 = 2;

/// How the trace puts the device on the processor's clock.
pub const CALIBRATED: &str =
    "calibrated timestamps: the device's clock was read beside the processor's after each frame";
/// As [`CALIBRATED`], without them.
pub const ANCHORED: &str = "anchored by the processor's clock at submission: the device has no calibrated timestamps, its track begins too early by what a submission waits";
/// As [`CALIBRATED`], without timestamps.
pub const NO_CLOCK: &str = "the processor's clock only: no timestamps";

/// Nanoseconds, whole: what nests in time then nests in the trace.
fn ns(ms: f64) -> i64 {
    (ms * 1e6).round() as i64
}

fn complete(
    track: u32,
    category: &str,
    name: &str,
    (start, end): (i64, i64),
    args: Value,
) -> Value {
    json!({
        "ph": "X",
        "cat": category,
        "name": name,
        "pid": PROCESS,
        "tid": track,
        "ts": start as f64 / 1e3,
        "dur": (end - start).max(0) as f64 / 1e3,
        "args": args,
    })
}

fn named(what: &str, track: u32, name: &str) -> Value {
    json!({
        "ph": "M",
        "name": what,
        "pid": PROCESS,
        "tid": track,
        "ts": 0,
        "args": { "name": name },
    })
}

impl FrameProfile {
    /// How [`trace`](FrameProfile::trace) puts the device on the processor's clock, in a sentence.
    pub fn clock(&self) -> &'static str {
        let is_timed = |s: &ProfileSample| s.times.device.frame_ms.is_some();
        if !self.samples.iter().any(is_timed) {
            NO_CLOCK
        } else if self
            .samples
            .iter()
            .filter(|s| is_timed(s))
            .all(|s| s.anchor.is_some())
        {
            CALIBRATED
        } else {
            ANCHORED
        }
    }

    /// The trace as JSON; times are microseconds since the first frame. `about` goes into its metadata.
    pub fn trace(&self, about: Value) -> Value {
        let starts = self.frames().filter_map(|t| t.starts.frame);
        let Some(origin) = starts.min() else {
            return json!({ "traceEvents": [], "otherData": about });
        };
        let since = |moment: Instant| -> i64 {
            match moment.checked_duration_since(origin) {
                Some(after) => after.as_nanos() as i64,
                None => -((origin - moment).as_nanos() as i64),
            }
        };
        let device = self
            .device
            .as_ref()
            .map_or("reference", |d| d.name.as_str());
        let mut events = vec![
            named("process_name", CPU, "surfel"),
            named("thread_name", CPU, "CPU"),
        ];
        if self.clock() != NO_CLOCK {
            events.push(named("thread_name", GPU, &format!("GPU: {device}")));
        }
        for (index, sample) in self.samples.iter().enumerate() {
            let times = &sample.times;
            let Some(start) = times.starts.frame.map(since) else {
                continue;
            };
            let counts = json!(times.counts);
            let name = format!("frame {index}");
            let span = (start, start + ns(times.frame_ms));
            events.push(complete(CPU, "frame", &name, span, counts));
            for stage in FrameStage::ALL {
                if let Some(begin) = times.starts.of(stage).map(since) {
                    let span = (begin, begin + ns(times.of(stage)));
                    events.push(complete(CPU, "stage", stage.name(), span, json!({})));
                }
            }
            for (counter, value) in [
                ("nodes visited", times.counts.nodes_visited),
                ("splats", times.counts.splats),
                ("triangles", times.counts.triangles),
            ] {
                events.push(json!({
                    "ph": "C",
                    "name": counter,
                    "pid": PROCESS,
                    "tid": CPU,
                    "ts": start as f64 / 1e3,
                    "args": { "count": value },
                }));
            }
            self.trace_device(sample, &name, &since, &mut events);
        }
        json!({
            "traceEvents": events,
            "displayTimeUnit": "ms",
            "otherData": {
                "program": concat!("surfel ", env!("CARGO_PKG_VERSION")),
                "clock": self.clock(),
                "clock_error_ms": self.clock_error_ms(),
                "gaps": "between two frames the same view is drawn without timestamps",
                "device": device,
                "run": about,
            },
        })
    }

    fn trace_device(
        &self,
        sample: &ProfileSample,
        name: &str,
        since: &dyn Fn(Instant) -> i64,
        events: &mut Vec<Value>,
    ) {
        let device = &sample.times.device;
        let (Some(frame_ms), Some(info)) = (device.frame_ms, &self.device) else {
            return;
        };
        let first = match &sample.anchor {
            // The processor drew it all.
            _ if sample.times.starts.submission.is_none() => None,
            Some(anchor) => anchor.instant_of(device.first_tick, info),
            None => sample.times.starts.submission,
        };
        let Some(begin) = first.map(since) else {
            return;
        };
        let end = begin + ns(frame_ms);
        events.push(complete(GPU, "frame", name, (begin, end), json!({})));
        // Ticks are no whole nanoseconds, so rounding could make neighbors overlap by one.
        let mut last = begin;
        for (pass, &offset_ms) in sample.times.passes.iter().zip(&device.starts_ms) {
            let start = (begin + ns(offset_ms)).clamp(last, end);
            last = (begin + ns(offset_ms + pass.ms)).clamp(start, end);
            events.push(complete(GPU, "pass", pass.name, (start, last), json!({})));
        }
    }
}
