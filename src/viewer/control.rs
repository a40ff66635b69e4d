//! Keeps frames within a time: the threshold follows what frames cost while the camera moves, and goes back to the
//! wanted one in steps when it rests. Pure logic.
//!
//! After Rusinkiewicz and Levoy, *QSplat* (2000), sections 2.1 and 3.2, who multiply the threshold by the ratio of
//! measured and wanted time. That is late where frames overlap and the camera comes near fast. Ours foresees: the cut
//! of the coming frame is counted before it is drawn, and the last frames say what a unit of work takes. The threshold
//! stays as it is while the foreseen time is near the wanted one, so noise moves nothing.
//!
//! Small squares are drawn by compute and larger ones by the rasterizer, which takes several times as long for each, so
//! the time of a frame jumps where the threshold crosses that size. What a unit takes, and how the work goes with the
//! threshold, is kept for each of the two ways. Cuts that are counted and not drawn take time as well; they count as work
//! of the frame that they are made for.
//!
//! A frame that draws nothing takes time too, but how much cannot be told from frames that are all held at the same
//! time (tried: the estimate drifts to all of it, and thresholds swing). So all time counts as work: a correction comes
//! out too small rather than too large, and the next frames make up for it.

use crate::method::LARGEST_COMPUTE_SQUARE_PX;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Largest threshold that is chosen, pixels (theirs).
pub const COARSEST_PX: f32 = 50.0;
/// A frame foreseen to miss the wanted time by less than this share keeps the threshold of the one before.
const DEAD_BAND: f64 = 0.045;
/// The search for another threshold ends at this share.
const AIM: f64 = 0.02;
/// The largest squares that compute draws may take so much longer: one size up takes far longer.
const EDGE_BAND: f64 = 0.1;
/// Cuts that are counted for a frame at most.
const MOST_CUTS: usize = 4;
/// What a node takes that is visited for a cut which is not drawn, in splats.
const COUNTED: f64 = 0.05;
/// A frame is made shorter for such cuts by at most this part: so much less than the dead band that the next frame, which
/// has none, is still in it.
const MOST_LOST: f64 = 0.02;
/// A splat of the rasterizer over one by compute, until frames of both were seen.
const USUAL_RATIO: f64 = 1.6;
/// Factor of the threshold from step to step at rest (theirs).
const REFINE: f32 = 0.7;
/// Frames whose median says what a unit of work takes.
const RATES: usize = 9;
/// A threshold that differs by less than this factor is about the same.
const NEAR: f32 = 1.6;
/// Frames that are kept of each of the two ways.
const FRAMES: usize = 96;
/// What was drawn within so many frames tells more than what was drawn before.
const RECENT: u64 = 40;
/// Frames from which on weights are chosen by them.
const LEAST_FRAMES: usize = 10;
/// Other weights must leave less than this part of what is not explained.
const BETTER: f64 = 0.65;
/// Off by less than this the time counts as held.
const HELD: f64 = 0.15;

/// What is drawn in a frame, in numbers that are known before it is drawn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Work {
    /// Nodes that the cut looked at.
    pub visited: u64,
    /// Splats.
    pub splats: u64,
    /// Triangles.
    pub triangles: u64,
    /// Small ones are drawn by compute: a unit takes another time then.
    pub by_compute: bool,
    /// Nodes that cuts looked at which were counted for this frame and not drawn.
    pub counted: u64,
}

/// What nodes visited and triangles take, in splats.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Weights {
    visited: f64,
    triangle: f64,
}

impl Weights {
    const USUAL: Self = Self {
        visited: 0.05,
        triangle: 1.5,
    };

    /// All of the work in one number: a splat is 1.
    fn units(self, work: &Work) -> f64 {
        let visited = self.visited * work.visited as f64;
        let triangles = self.triangle * work.triangles as f64;
        let drawn = visited + work.splats as f64 + triangles;
        (drawn + COUNTED * work.counted as f64).max(1.0)
    }
}

/// What is known about the wanted time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Report {
    /// Too few frames so far, or on the way.
    Adapting,
    /// The last frames kept it, or were faster at the wanted threshold.
    Held,
    /// No threshold reaches it: frames at the coarsest take about this long, milliseconds.
    Unreachable(f64),
}

/// A frame that has finished.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Frame {
    work: Work,
    px: f32,
    ms: f64,
    number: u64,
}

/// What is known of one way to draw small splats.
#[derive(Debug, Clone, PartialEq)]
struct Way {
    /// Its last frames, oldest first.
    frames: VecDeque<Frame>,
    /// Work goes with the threshold to minus this power.
    power: f64,
}

impl Default for Way {
    fn default() -> Self {
        Self {
            frames: VecDeque::with_capacity(FRAMES),
            power: 2.0,
        }
    }
}

/// Chooses thresholds for a wanted time of a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Control {
    target_ms: f64,
    finest_px: f32,
    /// While the camera moves.
    moving_px: f32,
    /// Now.
    shown_px: f32,
    is_moving: bool,
    /// By the rasterizer, and by compute.
    ways: [Way; 2],
    /// Frames so far.
    count: u64,
    /// What the last of them took, oldest first.
    last_ms: VecDeque<f64>,
    /// Nodes looked at to plan the present frame, by cuts that are not drawn.
    counted: u64,
    weights: Weights,
    report: Report,
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    // Of an even number the lower one: a frame that waited for something is no measure of its work.
    match values.len() {
        0 => 0.0,
        n => values[(n - 1) / 2],
    }
}

impl Control {
    /// For frames of `target_ms` milliseconds (at least 1), and never finer than `finest_px` pixels.
    pub fn new(target_ms: f64, finest_px: f32) -> Self {
        Self {
            target_ms: target_ms.max(1.0),
            finest_px,
            moving_px: finest_px,
            shown_px: finest_px,
            is_moving: false,
            ways: [Way::default(), Way::default()],
            count: 0,
            last_ms: VecDeque::new(),
            counted: 0,
            weights: Weights::USUAL,
            report: Report::Adapting,
        }
    }

    /// The wanted time, milliseconds.
    pub fn target_ms(&self) -> f64 {
        self.target_ms
    }

    /// The user wants another threshold: what is finer than it is not drawn any more.
    pub fn set_finest(&mut self, px: f32) {
        self.finest_px = px;
        self.moving_px = self.moving_px.clamp(px, COARSEST_PX.max(px));
        self.shown_px = if self.is_moving { self.moving_px } else { px };
    }

    /// Other things are drawn, or in another way: what frames cost before tells nothing any more.
    pub fn forget(&mut self) {
        self.ways = [Way::default(), Way::default()];
        self.last_ms.clear();
        self.count = 0;
        self.weights = Weights::USUAL;
        self.report = Report::Adapting;
    }

    /// The threshold of the last frame, pixels: between the wanted one and [`COARSEST_PX`].
    pub fn threshold_px(&self) -> f32 {
        self.shown_px
    }

    /// What is known.
    pub fn report(&self) -> Report {
        self.report
    }

    /// Whether the picture is coarser than wanted, so that [`refine`](Control::refine) would change it.
    pub fn is_coarse(&self) -> bool {
        self.shown_px > self.finest_px
    }

    /// The camera moves: back to the threshold of moving, at once.
    pub fn moved(&mut self) {
        self.shown_px = self.moving_px;
        self.is_moving = true;
    }

    /// The camera rests: one step finer. Returns whether the threshold changed.
    pub fn refine(&mut self) -> bool {
        self.is_moving = false;
        let next = (self.shown_px * REFINE).max(self.finest_px);
        std::mem::replace(&mut self.shown_px, next) != next
    }

    /// Milliseconds of a unit of work that is drawn so with a threshold of about `px`: of late, else ever; else with any
    /// threshold; else what the other way takes and is usually different by. None before the first frame.
    fn rate(&self, px: f32, by_compute: bool) -> Option<f64> {
        let of = |by_compute: bool, is_wanted: &dyn Fn(&Frame) -> bool| {
            let frames = &self.ways[usize::from(by_compute)].frames;
            let rates = frames.iter().rev().filter(|f| is_wanted(f)).take(RATES);
            let rates: Vec<f64> = rates.map(|f| f.ms / self.weights.units(&f.work)).collect();
            (!rates.is_empty()).then(|| median(rates))
        };
        let is_near = |f: &Frame| (NEAR.recip()..=NEAR).contains(&(f.px / px));
        let is_recent = |f: &Frame| f.number + RECENT > self.count;
        let ratio = if by_compute {
            1.0 / USUAL_RATIO
        } else {
            USUAL_RATIO
        };
        of(by_compute, &|f| is_near(f) && is_recent(f))
            .or_else(|| of(by_compute, &is_near))
            .or_else(|| of(by_compute, &|_| true))
            .or_else(|| of(!by_compute, &is_near).map(|rate| ratio * rate))
            .or_else(|| of(!by_compute, &|_| true).map(|rate| ratio * rate))
    }

    /// The threshold for the next frame, pixels. `work` says what would be drawn with a threshold; it is asked only while
    /// the camera moves, and the last answer is that for the result. [`counted`](Control::counted) says what asking took.
    pub fn plan(&mut self, mut work: impl FnMut(f32) -> Work) -> f32 {
        self.counted = 0;
        if !self.is_moving || self.count == 0 {
            return self.shown_px;
        }
        let (finest, coarsest) = (self.finest_px, COARSEST_PX.max(self.finest_px));
        let edge = LARGEST_COMPUTE_SQUARE_PX;
        let mut px = self.moving_px;
        let mut now = work(px);
        let (mut aim, mut allowed) = (1.0, DEAD_BAND);
        for _ in 1..MOST_CUTS {
            // Units of work that take the wanted time, drawn in either way.
            let wanted = |by_compute: bool| {
                let rate = self.rate(px, by_compute).unwrap_or(0.0);
                self.target_ms / rate.max(1e-12)
            };
            let units = self.weights.units(&now);
            let share = (units / wanted(now.by_compute)).max(1e-6);
            let is_largest = now.by_compute && px == edge && share > 1.0;
            let is_held = (share - aim).abs() <= allowed;
            if is_held || is_largest && share <= 1.0 + EDGE_BAND {
                break;
            }
            // What is coarser than the largest is drawn in the other way.
            let by_compute = now.by_compute && !is_largest;
            let wanted = wanted(by_compute);
            // This cut will have been counted for nothing. All of that would make the frames after this one too short.
            let lost = COUNTED * (self.counted + now.visited) as f64 / wanted;
            (aim, allowed) = (1.0 - lost.min(MOST_LOST), AIM);
            let power = self.ways[usize::from(by_compute)].power;
            let less = units / (aim * wanted);
            let mut next = (px * less.powf(1.0 / power) as f32).clamp(finest, coarsest);
            if now.by_compute && px < edge && next > edge {
                next = edge.clamp(finest, coarsest);
            }
            if next == px {
                break;
            }
            self.counted += now.visited;
            let other = work(next);
            let steps = f64::from(next / px).ln();
            if steps.abs() > 1e-3 && other.by_compute == now.by_compute {
                let change = self.weights.units(&other) / units;
                self.ways[usize::from(now.by_compute)].power =
                    (-change.ln() / steps).clamp(0.7, 4.0);
            }
            (px, now) = (next, other);
        }
        self.moving_px = px;
        self.shown_px = px;
        px
    }

    /// Nodes that the last [`plan`](Control::plan) had looked at in vain, by cuts for other thresholds than its result.
    pub fn counted(&self) -> u64 {
        self.counted
    }

    /// A frame of `work`, drawn with `drawn_px`, took `ms` milliseconds.
    pub fn frame(&mut self, drawn_px: f32, work: &Work, ms: f64) {
        if !(ms.is_finite() && ms > 0.0 && drawn_px > 0.0) {
            return;
        }
        let frames = &mut self.ways[usize::from(work.by_compute)].frames;
        if frames.len() == FRAMES {
            frames.pop_front();
        }
        self.count += 1;
        frames.push_back(Frame {
            work: *work,
            px: drawn_px,
            ms,
            number: self.count,
        });
        self.weigh();
        tracing::debug!(ms, drawn_px, ?work, "frame");
        let coarsest = COARSEST_PX.max(self.finest_px);
        if self.last_ms.len() == 3 {
            self.last_ms.pop_front();
        }
        self.last_ms.push_back(ms);
        let is_enough = self.last_ms.len() == 3;
        let ratio = median(self.last_ms.iter().copied().collect()) / self.target_ms;
        self.report = if !is_enough {
            Report::Adapting
        } else if ratio > 1.0 + HELD && drawn_px >= coarsest {
            Report::Unreachable(ratio * self.target_ms)
        } else if ratio <= 1.0 + HELD && (drawn_px <= self.finest_px || ratio >= 1.0 - HELD) {
            Report::Held
        } else {
            Report::Adapting
        };
    }

    /// Chooses the weights by which the frames agree best on what a unit takes.
    fn weigh(&mut self) {
        if self.ways.iter().map(|way| way.frames.len()).sum::<usize>() < LEAST_FRAMES {
            return;
        }
        // Mean square of the distance of logarithms from their mean, of the frames that are drawn alike.
        let disagreement = |weights: Weights| {
            let mut sum = 0.0;
            for way in &self.ways {
                let rates = way
                    .frames
                    .iter()
                    .map(|f| (f.ms / weights.units(&f.work)).ln());
                let (count, mean) = rates.clone().fold((0.0, 0.0), |(n, m), r| (n + 1.0, m + r));
                let mean = mean / f64::max(count, 1.0);
                // A frame that waited for something must not decide.
                sum += rates.map(|r| (r - mean).powi(2).min(0.04)).sum::<f64>();
            }
            sum
        };
        let now = disagreement(self.weights);
        let (mut best, mut least) = (self.weights, BETTER * now);
        for triangle in [0.4, 0.75, 1.5, 3.0, 6.0, 12.0] {
            for visited in [0.0, 0.05, 0.2] {
                let weights = Weights { visited, triangle };
                let value = disagreement(weights);
                if value < least {
                    (best, least) = (weights, value);
                }
            }
        }
        self.weights = best;
    }
}

#[cfg(test)]
mod tests;
