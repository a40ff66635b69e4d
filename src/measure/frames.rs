//! Many frames together: the last of a window, or all of a run.

use super::ValueDistribution;
use crate::render::stats::{FrameStage, FrameTimes};
use std::collections::VecDeque;

/// The last frames, oldest first; what comes in above its capacity pushes the oldest out.
#[derive(Debug, Clone, Default)]
pub struct FrameWindow {
    frames: VecDeque<FrameTimes>,
    capacity: usize,
}

impl FrameWindow {
    /// An empty ring of `capacity` frames; of 0 it stays empty.
    pub fn new(capacity: usize) -> Self {
        Self {
            frames: VecDeque::with_capacity(capacity),
            capacity,
        }
    }

    /// Adds the newest frame.
    pub fn push(&mut self, times: FrameTimes) {
        while self.frames.len() >= self.capacity.max(1) {
            self.frames.pop_front();
        }
        if self.capacity > 0 {
            self.frames.push_back(times);
        }
    }

    /// Forgets all frames: after a change of model, method or size they are not comparable.
    pub fn clear(&mut self) {
        self.frames.clear();
    }

    /// The frames, oldest first.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &FrameTimes> + ExactSizeIterator + Clone {
        self.frames.iter()
    }
}

/// Times of one pass over many frames.
#[derive(Debug, Clone, PartialEq)]
pub struct PassSummary {
    /// Name of the pass.
    pub name: &'static str,
    /// Milliseconds of the frames that had it. A pass that runs several times in a frame counts with its sum.
    pub ms: ValueDistribution,
    /// Part of the time of all passes of all frames, 0 to 1.
    pub share: f64,
    /// Frames that had it.
    pub frames: usize,
}

/// Time of the frames, milliseconds.
pub fn frame_ms<'a>(frames: impl IntoIterator<Item = &'a FrameTimes>) -> ValueDistribution {
    ValueDistribution::of(&frames.into_iter().map(|t| t.frame_ms).collect::<Vec<_>>())
}

/// Time of a stage on the CPU, milliseconds.
pub fn stage_ms<'a>(
    frames: impl IntoIterator<Item = &'a FrameTimes>,
    stage: FrameStage,
) -> ValueDistribution {
    ValueDistribution::of(&frames.into_iter().map(|t| t.of(stage)).collect::<Vec<_>>())
}

/// Time of the pass `name` in one frame, milliseconds; `None` when the frame did not have it.
pub fn pass_ms(times: &FrameTimes, name: &str) -> Option<f64> {
    let mut found = times.passes.iter().filter(|p| p.name == name).peekable();
    found.peek()?;
    Some(found.map(|p| p.ms).sum())
}

/// Names of the passes of all frames, in the order in which they first ran.
pub fn pass_names<'a>(frames: impl IntoIterator<Item = &'a FrameTimes>) -> Vec<&'static str> {
    let mut names = Vec::new();
    for times in frames {
        let timed = times.passes.iter().map(|p| p.name);
        for name in timed.chain(times.counters.iter().map(|c| c.name)) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
    }
    names
}

/// Times of the passes, in the order in which they first ran.
pub fn passes<'a>(
    frames: impl IntoIterator<Item = &'a FrameTimes, IntoIter: Clone>,
) -> Vec<PassSummary> {
    let frames = frames.into_iter();
    let all: f64 = frames.clone().flat_map(|t| &t.passes).map(|p| p.ms).sum();
    pass_names(frames.clone())
        .into_iter()
        .map(|name| {
            let values: Vec<f64> = frames.clone().filter_map(|t| pass_ms(t, name)).collect();
            let sum: f64 = values.iter().sum();
            PassSummary {
                name,
                ms: ValueDistribution::of(&values),
                share: if all > 0.0 { sum / all } else { 0.0 },
                frames: values.len(),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::frame::PassTime;

    fn frame(frame_ms: f64, passes: &[(&'static str, f64)]) -> FrameTimes {
        FrameTimes {
            frame_ms,
            passes: passes
                .iter()
                .map(|&(name, ms)| PassTime { name, ms })
                .collect(),
            ..FrameTimes::default()
        }
    }

    #[test]
    fn a_ring_keeps_the_last_frames_in_order() {
        let mut ring = FrameWindow::new(3);
        for ms in 1..=5 {
            ring.push(frame(f64::from(ms), &[]));
        }
        assert!(ring.iter().map(|t| t.frame_ms).eq([3.0, 4.0, 5.0]));
        assert_eq!(frame_ms(ring.iter()).median, 4.0);
        ring.clear();
        assert_eq!(ring.iter().len(), 0);
        let mut none = FrameWindow::new(0);
        none.push(frame(1.0, &[]));
        assert_eq!(none.iter().len(), 0);
    }

    #[test]
    fn a_pass_counts_with_its_sum_and_only_where_it_ran() {
        let frames = [
            frame(9.0, &[("a", 1.0), ("b", 2.0), ("b", 3.0)]),
            frame(9.0, &[("a", 3.0)]),
            frame(9.0, &[("a", 2.0), ("c", 9.0)]),
        ];
        let rows = passes(&frames);
        let names: Vec<_> = rows.iter().map(|r| (r.name, r.frames)).collect();
        assert_eq!(names, [("a", 3), ("b", 1), ("c", 1)]);
        assert_eq!(rows[0].ms.median, 2.0);
        assert_eq!(rows[1].ms.median, 5.0);
        // 6, 5 and 9 of 20 milliseconds.
        let shares: Vec<f64> = rows.iter().map(|r| r.share).collect();
        assert_eq!(shares, [0.3, 0.25, 0.45]);
        assert_eq!(pass_ms(&frames[1], "b"), None);
    }
}
