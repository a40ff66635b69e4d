//! How well frames kept the wanted time: what a replay with `--frame-ms` prints. Pure logic.

use std::fmt;

/// Off the wanted time by at most this share a frame has kept it.
pub const KEPT: f64 = 0.15;
/// Frames of so long after the start do not count, milliseconds: nothing is known of the device then.
const START_MS: f64 = 1000.0;

/// A frame of a moving camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PacedFrame {
    /// Work of the frame, milliseconds.
    pub ms: f64,
    /// The threshold that it was drawn with, pixels.
    pub threshold_px: f32,
    /// The threshold is the wanted one: nothing finer was asked for.
    pub is_finest: bool,
}

/// The figures of many frames.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PaceSummary {
    /// The wanted time, milliseconds.
    pub target_ms: f64,
    /// Frames after the first second.
    pub frames: usize,
    /// Of those, within [`KEPT`] of the wanted time.
    pub near: usize,
    /// Of the others, faster, with the wanted threshold: there was no more to draw.
    pub finer: usize,
    /// Median time, milliseconds.
    pub median_ms: f64,
    /// Longest time, milliseconds.
    pub longest_ms: f64,
    /// Smallest and largest threshold, pixels.
    pub thresholds_px: (f32, f32),
}

impl PaceSummary {
    /// The figures of `frames`, in the order in which they were drawn.
    pub fn of(frames: &[PacedFrame], target_ms: f64) -> Self {
        let mut since_start = 0.0;
        let late: Vec<&PacedFrame> = frames
            .iter()
            .skip_while(|frame| {
                since_start += frame.ms;
                since_start < START_MS
            })
            .collect();
        let is_near = |f: &PacedFrame| (f.ms / target_ms - 1.0).abs() <= KEPT;
        let thresholds = late.iter().map(|f| f.threshold_px);
        Self {
            target_ms,
            frames: late.len(),
            near: late.iter().filter(|f| is_near(f)).count(),
            finer: late
                .iter()
                .filter(|f| !is_near(f) && f.is_finest && f.ms < target_ms)
                .count(),
            median_ms: super::text::median(late.iter().map(|f| f.ms)),
            longest_ms: late.iter().map(|f| f.ms).fold(0.0, f64::max),
            thresholds_px: (
                thresholds.clone().min_by(f32::total_cmp).unwrap_or(0.0),
                thresholds.max_by(f32::total_cmp).unwrap_or(0.0),
            ),
        }
    }

    /// Part of the frames that kept the time, or had no more to draw; 1 of none.
    pub fn kept(&self) -> f64 {
        match self.frames {
            0 => 1.0,
            n => (self.near + self.finer) as f64 / n as f64,
        }
    }
}

impl fmt::Display for PaceSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (least, most) = self.thresholds_px;
        write!(
            f,
            "{:.1} % of {} frames kept {} ms: {} within 15 %, {} faster at the wanted threshold (after the first second); \
             median {:.1} ms, longest {:.1} ms, threshold {least:.2} to {most:.2} px",
            100.0 * self.kept(),
            self.frames,
            self.target_ms,
            self.near,
            self.finer,
            self.median_ms,
            self.longest_ms,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_count_after_a_second_and_by_what_was_wanted() {
        let frame = |ms: f64, threshold_px: f32| PacedFrame {
            ms,
            threshold_px,
            is_finest: threshold_px <= 1.0,
        };
        let mut frames = vec![frame(400.0, 40.0), frame(500.0, 50.0)];
        // This one ends the first second and counts.
        frames.push(frame(114.9, 4.0));
        frames.extend([frame(85.1, 2.0), frame(115.1, 2.0), frame(84.9, 2.0)]);
        frames.extend([frame(10.0, 1.0), frame(130.0, 1.0)]);
        let summary = PaceSummary::of(&frames, 100.0);
        assert_eq!((summary.frames, summary.near, summary.finer), (6, 2, 1));
        assert_eq!(summary.kept(), 0.5);
        assert_eq!(summary.thresholds_px, (1.0, 4.0));
        assert_eq!(summary.longest_ms, 130.0);
        let text = summary.to_string();
        assert!(text.starts_with("50.0 % of 6 frames kept 100 ms"), "{text}");
        assert_eq!(PaceSummary::of(&frames[..2], 100.0).kept(), 1.0, "of none");
    }
}
