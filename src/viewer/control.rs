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
//! time (tried: the estimate drifts to all of it, and thresholds swing). What passes over the whole picture take is
//! measured, so it is kept apart: only the rest counts as work. Of that rest all counts as work: a correction comes out
//! too small rather than too large, and the next frames make up for it.
//!
//! Blended splats take time for each pixel as well. How much cannot be told from one view either: there the number of
//! splats goes with the inverse square of the threshold, so all of them together cover as many pixels at any, and what
//! they take looks like time without work. It is learned only once frames differ in both, threshold and pixels.

use crate::abi::constants::LARGEST_SMALL_BLENDED_PX;
use crate::method::LARGEST_COMPUTE_SQUARE_PX;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Largest threshold that is chosen, pixels (theirs).
pub const COARSEST_PX: f32 = 50.0;
/// A frame foreseen to miss the wanted time by less than this share keeps the threshold of the one before; by less where
/// the time changes little with the threshold.
const DEAD_BAND: f64 = 0.045;
/// The search for another threshold ends at this share; at less likewise.
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
const RATES: usize = 7;
/// A threshold that differs by less than this factor is about the same.
const NEAR: f32 = 1.6;
/// Frames that are kept of each of the two ways.
const FRAMES: usize = 96;
/// What was drawn within so many frames tells more than what was drawn before.
const RECENT: u64 = 40;
/// Frames from which on weights are chosen by them.
const LEAST_FRAMES: usize = 10;
/// Of so many frames weights are chosen at each one.
const WEIGHED: u64 = 4;
/// Thresholds and pixels of the frames must differ by this factor before what a pixel takes is learned: the ninth tenth of
/// them over the first.
const SPREAD: f64 = 1.25;
/// What passes over the picture take is at most this part of the wanted time: above it nothing would be left to draw in.
const MOST_OF_PICTURE: f64 = 0.8;
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

/// What a frame took.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Took {
    /// All of it, milliseconds.
    pub ms: f64,
    /// What passes over the whole picture took of that, whatever was drawn, milliseconds.
    pub picture_ms: f64,
}

impl From<f64> for Took {
    /// So many milliseconds, of which nothing else is known.
    fn from(ms: f64) -> Self {
        Self {
            ms,
            picture_ms: 0.0,
        }
    }
}

/// What nodes visited, triangles and pixels of splats take, in splats of no size.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Weights {
    visited: f64,
    triangle: f64,
    /// A pixel of a splat of the threshold's size.
    pixel: f64,
}

impl Weights {
    const USUAL: Self = Self {
        visited: 0.05,
        triangle: 1.5,
        pixel: 0.0,
    };

    /// All of the work, drawn with a threshold of `px`, in one number.
    fn units(self, work: &Work, px: f32) -> f64 {
        let visited = self.visited * work.visited as f64;
        let triangles = self.triangle * work.triangles as f64;
        let splat = 1.0 + self.pixel * f64::from(px).powi(2);
        let drawn = visited + splat * work.splats as f64 + triangles;
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
    took: Took,
    number: u64,
}

impl Frame {
    /// What its work took, milliseconds; above 0.
    fn work_ms(&self) -> f64 {
        let Took { ms, picture_ms } = self.took;
        (ms - picture_ms).max(0.02 * ms)
    }

    /// Pixels of its splats, if all had the threshold's size.
    fn pixels(&self) -> f64 {
        self.work.splats as f64 * f64::from(self.px).powi(2)
    }
}

/// What is foreseen of frames that are drawn in one way with about one threshold, milliseconds.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Rates {
    /// A unit of work.
    unit: f64,
    /// The passes over the picture.
    picture: f64,
}

impl Rates {
    fn of(frames: &[&Frame], weights: Weights) -> Option<Self> {
        let over = |of: &dyn Fn(&Frame) -> f64| median(frames.iter().map(|f| of(f)).collect());
        (!frames.is_empty()).then(|| Self {
            unit: over(&|f| f.work_ms() / weights.units(&f.work, f.px)),
            picture: over(&|f| f.took.picture_ms),
        })
    }
}

/// What is known of one way to draw small splats.
#[derive(Debug, Clone, PartialEq)]
struct Way {
    /// Its last frames, oldest first.
    frames: VecDeque<Frame>,
    /// Numbers go with the threshold to minus this power.
    power: f64,
}

/// The ninth tenth of some values over the first.
fn spread(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = |tenths: usize| values.get(tenths * values.len() / 10).copied();
    at(9).unwrap_or(1.0) / at(1).unwrap_or(1.0).max(1e-9)
}

impl Way {
    /// Whether what a pixel takes can be told from its frames.
    fn tells_pixels(&self) -> bool {
        self.frames.len() >= 2 * LEAST_FRAMES
            && spread(self.frames.iter().map(|f| f64::from(f.px)).collect()) > SPREAD
            && spread(self.frames.iter().map(Frame::pixels).collect()) > SPREAD
    }
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
    /// Splats are blended: each of their pixels takes time.
    is_blended: bool,
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
            is_blended: false,
            report: Report::Adapting,
        }
    }

    /// Whether the splats of the coming frames are blended: they are drawn by compute up to another size then, and each of
    /// their pixels takes time.
    pub fn set_blended(&mut self, is_blended: bool) {
        self.is_blended = is_blended;
    }

    /// Largest threshold that may be drawn by compute, pixels.
    fn edge_px(&self) -> f32 {
        if self.is_blended {
            LARGEST_SMALL_BLENDED_PX
        } else {
            LARGEST_COMPUTE_SQUARE_PX
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

    /// What frames take that are drawn so with a threshold of about `px`: of late, else ever; else with any threshold; else
    /// what the other way takes and is usually different by. None before the first frame.
    fn rates(&self, px: f32, by_compute: bool) -> Option<Rates> {
        let of = |by_compute: bool, is_wanted: &dyn Fn(&Frame) -> bool| {
            let frames = &self.ways[usize::from(by_compute)].frames;
            let wanted = frames.iter().rev().filter(|f| is_wanted(f)).take(RATES);
            Rates::of(&wanted.collect::<Vec<_>>(), self.weights)
        };
        let is_near = |f: &Frame| (NEAR.recip()..=NEAR).contains(&(f.px / px));
        let is_recent = |f: &Frame| f.number + RECENT > self.count;
        let ratio = if by_compute {
            1.0 / USUAL_RATIO
        } else {
            USUAL_RATIO
        };
        let as_other = |rates: Rates| Rates {
            unit: ratio * rates.unit,
            ..rates
        };
        of(by_compute, &|f| is_near(f) && is_recent(f))
            .or_else(|| of(by_compute, &is_near))
            .or_else(|| of(by_compute, &|_| true))
            .or_else(|| of(!by_compute, &is_near).map(as_other))
            .or_else(|| of(!by_compute, &|_| true).map(as_other))
    }

    /// What `work`, which is that of `px`, becomes with another threshold, if numbers go with the threshold to minus
    /// `power`. Pixels of splats never grow where those become fewer: where they do, because splats are of single leaves,
    /// that is found by looking, and a step is too small rather than too large.
    fn units_at(&self, at: f64, (work, px): (&Work, f32), power: f64) -> f64 {
        let numbers = Weights {
            pixel: 0.0,
            ..self.weights
        };
        let numbers = numbers.units(work, px);
        let pixels = self.weights.units(work, px) - numbers;
        let coarser = at / f64::from(px);
        numbers * coarser.powf(-power) + pixels * coarser.powf(2.0 - power.max(2.0))
    }

    /// How much the time of a frame changes with its threshold, over what it would if all of it went with the numbers: where
    /// it changes little, a small error of the time is a large one of the threshold. 0.6 to 1.
    fn steepness(&self, rates: Rates, (work, px): (&Work, f32), power: f64) -> f64 {
        const STEP: f64 = 1.05;
        let ms = |at: f64| rates.picture + rates.unit * self.units_at(at, (work, px), power);
        let change = ms(STEP * f64::from(px)) / ms(f64::from(px));
        (-change.ln() / (power * STEP.ln())).clamp(0.6, 1.0)
    }

    /// The threshold with which `work`, which is that of `px`, becomes `units`; the nearer end where none between `ends`
    /// does.
    fn threshold_for(
        &self,
        units: f64,
        (work, px): (&Work, f32),
        power: f64,
        (finest, coarsest): (f32, f32),
    ) -> f32 {
        let is_too_much = |at: f64| self.units_at(at, (work, px), power) > units;
        if self.weights.pixel == 0.0 {
            let less = self.weights.units(work, px) / units.max(1e-12);
            return (px * less.powf(1.0 / power) as f32).clamp(finest, coarsest);
        }
        if is_too_much(f64::from(coarsest)) {
            return coarsest;
        }
        if !is_too_much(f64::from(finest)) {
            return finest;
        }
        let (mut low, mut high) = (f64::from(finest), f64::from(coarsest));
        for _ in 0..24 {
            let middle = (low * high).sqrt();
            if is_too_much(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        high as f32
    }

    /// The threshold for the next frame, pixels. `work` says what would be drawn with a threshold; it is asked only while
    /// the camera moves, and the last answer is that for the result. [`counted`](Control::counted) says what asking took.
    pub fn plan(&mut self, mut work: impl FnMut(f32) -> Work) -> f32 {
        self.counted = 0;
        if !self.is_moving || self.count == 0 {
            return self.shown_px;
        }
        let (finest, coarsest) = (self.finest_px, COARSEST_PX.max(self.finest_px));
        let edge = self.edge_px();
        // Thresholds found too fine and too coarse: what is tried next lies between.
        let (mut too_fine, mut too_coarse) = (0.0f32, f32::INFINITY);
        let mut px = self.moving_px;
        let mut now = work(px);
        let (mut aim, mut allowed) = (1.0, DEAD_BAND);
        for _ in 1..MOST_CUTS {
            let rates = |by_compute: bool| {
                let none = Rates {
                    unit: 0.0,
                    picture: 0.0,
                };
                let Rates { unit, picture } = self.rates(px, by_compute).unwrap_or(none);
                Rates {
                    unit: unit.max(1e-12),
                    picture: picture.min(MOST_OF_PICTURE * self.target_ms),
                }
            };
            let units = self.weights.units(&now, px);
            let foreseen = |rates: Rates| rates.picture + rates.unit * units;
            let share = (foreseen(rates(now.by_compute)) / self.target_ms).max(1e-6);
            let is_largest = now.by_compute && px == edge && share > 1.0;
            let power = self.ways[usize::from(now.by_compute)].power;
            let steepness = self.steepness(rates(now.by_compute), (&now, px), power);
            let is_held = (share - aim).abs() <= allowed * steepness;
            if is_held || is_largest && share <= 1.0 + EDGE_BAND {
                break;
            }
            // What is coarser than the largest is drawn in the other way.
            let by_compute = now.by_compute && !is_largest;
            let rates = rates(by_compute);
            // This cut will have been counted for nothing. All of that would make the frames after this one too short.
            let lost = COUNTED * (self.counted + now.visited) as f64 * rates.unit / self.target_ms;
            (aim, allowed) = (1.0 - lost.min(MOST_LOST), AIM);
            let power = self.ways[usize::from(by_compute)].power;
            let wanted = (aim * self.target_ms - rates.picture) / rates.unit;
            let mut next = self.threshold_for(wanted, (&now, px), power, (finest, coarsest));
            if share > aim {
                too_fine = too_fine.max(px);
            } else {
                too_coarse = too_coarse.min(px);
            }
            if too_fine < too_coarse && (next <= too_fine || next >= too_coarse) && next != px {
                // Known already: the two ways take different times.
                let (low, high) = (too_fine.max(finest), too_coarse.min(coarsest));
                next = (low * high).sqrt();
            }
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
                let numbers = Weights {
                    pixel: 0.0,
                    ..self.weights
                };
                let change = numbers.units(&other, next) / numbers.units(&now, px);
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

    /// A frame of `work`, drawn with `drawn_px`, took so long.
    pub fn frame(&mut self, drawn_px: f32, work: &Work, took: impl Into<Took>) {
        let Took { ms, picture_ms } = took.into();
        if !(ms.is_finite() && ms > 0.0 && drawn_px > 0.0) {
            return;
        }
        let picture_ms = if picture_ms.is_finite() {
            picture_ms.clamp(0.0, ms)
        } else {
            0.0
        };
        let frames = &mut self.ways[usize::from(work.by_compute)].frames;
        if frames.len() == FRAMES {
            frames.pop_front();
        }
        self.count += 1;
        frames.push_back(Frame {
            work: *work,
            px: drawn_px,
            took: Took { ms, picture_ms },
            number: self.count,
        });
        if self.count.is_multiple_of(WEIGHED) {
            self.weigh();
        }
        tracing::debug!(ms, picture_ms, drawn_px, ?work, weights = ?self.weights, "frame");
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
        let tells_pixels = self.is_blended && self.ways.iter().any(Way::tells_pixels);
        let pixels: &[f64] = if tells_pixels {
            &[0.0, 0.003, 0.01, 0.03, 0.1]
        } else {
            self.weights.pixel = 0.0;
            &[0.0]
        };
        // Mean square of the distance of logarithms from their mean, of the frames that are drawn alike.
        let disagreement = |weights: Weights| {
            let mut sum = 0.0;
            for way in &self.ways {
                let rates = way
                    .frames
                    .iter()
                    .map(|f| (f.work_ms() / weights.units(&f.work, f.px)).ln());
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
                for &pixel in pixels {
                    let weights = Weights {
                        visited,
                        triangle,
                        pixel,
                    };
                    let value = disagreement(weights);
                    if value < least {
                        (best, least) = (weights, value);
                    }
                }
            }
        }
        self.weights = best;
    }
}

#[cfg(test)]
mod tests;
