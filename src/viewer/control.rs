//! Keeps frames within a time: the threshold follows what frames cost while the camera moves, and goes back to the
//! wanted one in steps when it rests. Pure logic.
//!
//! After Rusinkiewicz and Levoy, *QSplat* (2000), sections 2.1 and 3.2, who multiply the threshold by the ratio of
//! measured and wanted time. That is late where frames overlap and the camera comes near fast. Ours foresees: the cut
//! of the coming frame is counted before it is drawn, and the frames that have finished say what a unit of work takes.
//!
//! A frame begins with the threshold that would have been right for the one before. Another cut is counted only where the
//! time is foreseen to be missed by more than counting takes; else the next frame begins with what would have been right.
//! A place that was drawn before begins as it was drawn then, stays so within a wider band, and within one wider still goes
//! only a little towards what would be right: where the time hardly changes with the threshold, or falls and rises with it,
//! several thresholds are as good, and the way back has those of the way there. A camera that stays where it is keeps its threshold so as well; noise moves nothing.
//!
//! What a frame takes is foreseen part by part (see `src/viewer/control/model.rs`). Cuts that are counted and not drawn take time as well;
//! they count as work of the frame that they are made for.
//!
//! Small splats can be drawn by compute or by the rasterizer, and neither is the cheaper one everywhere: the rasterizer
//! takes longer for a splat, compute for passes over the picture and, of large splats, for their pixels. The way is chosen
//! with the threshold, by what both were found to take, or measured to take on the device: the one that keeps the time with
//! the finer threshold. Rules that look at the counts alone go from one to the other and back between frames of nearly the
//! same time but of different thresholds.

mod model;
mod plan;

pub use model::{EyePlace, FrameWork, TimeTaken};

use crate::render::cost::model::{PerRasterizer, SplatCosts};
use model::{TimeModel, WorkNumbers};
use plan::{SeenPlace, TriedThreshold};
use std::collections::VecDeque;

/// Largest threshold that is chosen, pixels (theirs).
pub const COARSEST_PX: f32 = 50.0;
/// Frames whose median says how much longer frames take than foreseen.
const DRIFTS: usize = 9;
/// By less than this (a logarithm) that is noise, and by more than the other it is none.
const NOISE: f64 = 0.02;
const MOST_DRIFT: f64 = 0.5;
/// Factor of the threshold from step to step at rest (theirs).
const REFINE: f32 = 0.7;
/// Off by less than this the time counts as held.
const HELD: f64 = 0.15;

/// Time that frames are held to while the view moves.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum FrameGoal {
    /// Usual time of the device: 33 ms where the processor draws, 16 ms on graphics hardware.
    #[default]
    Usual,
    /// None: frames take the time that they take.
    Free,
    /// So many milliseconds.
    Held(f64),
}

impl FrameGoal {
    /// Milliseconds; none where frames are free.
    pub fn target_ms(self, is_drawn_by_processor: bool) -> Option<f64> {
        match self {
            Self::Usual if is_drawn_by_processor => Some(33.0),
            Self::Usual => Some(16.0),
            Self::Free => None,
            Self::Held(ms) => Some(ms),
        }
    }

    /// The goal that is a time, or none, on such a device.
    pub fn of_ms(target_ms: Option<f64>, is_drawn_by_processor: bool) -> Self {
        match target_ms {
            None => Self::Free,
            now if now == Self::Usual.target_ms(is_drawn_by_processor) => Self::Usual,
            Some(ms) => Self::Held(ms),
        }
    }

    /// As it is kept in files: none is the usual, 0 is free.
    pub fn stored(self) -> Option<f64> {
        match self {
            Self::Usual => None,
            Self::Free => Some(0.0),
            Self::Held(ms) => Some(ms),
        }
    }

    /// The goal that was kept so.
    pub fn of_stored(stored: Option<f64>) -> Self {
        match stored {
            None => Self::Usual,
            Some(0.0) => Self::Free,
            Some(ms) => Self::Held(ms),
        }
    }
}

/// What is known about the wanted time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BudgetReport {
    /// Too few frames so far, or on the way.
    Adapting,
    /// The last frames kept it, or were faster at the wanted threshold.
    Held,
    /// No threshold reaches it: frames at the coarsest take about this long, milliseconds.
    Unreachable(f64),
}

/// Chooses thresholds for a wanted time of a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameBudget {
    target_ms: f64,
    finest_px: f32,
    /// While the camera moves.
    moving_px: f32,
    /// What was drawn where, oldest first.
    seen: VecDeque<SeenPlace>,
    /// The last planned frame.
    last: Option<TriedThreshold>,
    /// Where it was seen from.
    place: EyePlace,
    /// Until which planned frame a finer and a coarser threshold are not tried, and how far off the time was then.
    blocked: [(u64, f64); 2],
    /// Planned frames so far.
    planned: u64,
    /// Until which of them compute is too slow, however coarse.
    past_edge: u64,
    /// Now.
    shown_px: f32,
    is_moving: bool,
    model: TimeModel,
    /// Work goes with the threshold to minus this power.
    power: f64,
    /// The way that was chosen last, where there was a choice.
    by_compute: bool,
    /// There was one.
    has_choice: bool,
    /// What the last of them took, oldest first.
    last_ms: VecDeque<f64>,
    /// Logarithms of how much longer than foreseen they took, oldest first, and the factor that follows.
    longer: VecDeque<f64>,
    drift: f64,
    /// Nodes looked at to plan the present frame, by cuts that are not drawn.
    counted: u64,
    report: BudgetReport,
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    // Of an even number the lower one: a frame that waited for something is no measure of its work.
    match values.len() {
        0 => 0.0,
        n => values[(n - 1) / 2],
    }
}

impl FrameBudget {
    /// For frames of `target_ms` milliseconds (at least 1), and never finer than `finest_px` pixels.
    pub fn new(target_ms: f64, finest_px: f32) -> Self {
        Self {
            target_ms: target_ms.max(1.0),
            finest_px,
            moving_px: finest_px,
            seen: VecDeque::new(),
            last: None,
            place: [0.0; 6],
            blocked: [(0, 0.0); 2],
            planned: 0,
            past_edge: 0,
            shown_px: finest_px,
            is_moving: false,
            model: TimeModel::default(),
            power: 2.0,
            by_compute: true,
            has_choice: false,
            last_ms: VecDeque::new(),
            longer: VecDeque::new(),
            drift: 1.0,
            counted: 0,
            report: BudgetReport::Adapting,
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
        self.model.forget();
        self.power = 2.0;
        (self.by_compute, self.has_choice) = (true, false);
        self.seen.clear();
        (self.last, self.blocked) = (None, [(0, 0.0); 2]);
        self.past_edge = 0;
        self.last_ms.clear();
        self.longer.clear();
        self.drift = 1.0;
        self.report = BudgetReport::Adapting;
    }

    /// What splats were measured to take on the device: by that the two ways to draw them are compared before both were
    /// tried. None: by what is usual.
    pub fn know(&mut self, costs: Option<PerRasterizer<SplatCosts>>) {
        self.model.know(costs);
    }

    /// The threshold of the last frame, pixels: between the wanted one and [`COARSEST_PX`].
    pub fn threshold_px(&self) -> f32 {
        self.shown_px
    }

    /// What is known.
    pub fn report(&self) -> BudgetReport {
        self.report
    }

    /// Tells whether the picture is coarser than wanted, so that [`refine`](FrameBudget::refine) would change it.
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

    /// How splats of the planned frame are to be drawn, where they may be drawn in either way.
    pub fn by_compute(&self) -> bool {
        self.by_compute
    }

    /// Nodes that the last [`plan`](FrameBudget::plan) had looked at in vain, by cuts for other thresholds than its result.
    pub fn counted(&self) -> u64 {
        self.counted
    }

    /// The device may be slower or faster for a while, whatever is drawn: how much longer than foreseen the last frames took.
    fn note_drift(&mut self, px: f32, work: &FrameWork, took: TimeTaken) {
        let Some(rates) = self.model.rates(px, work, work.by_compute) else {
            return;
        };
        let foreseen = rates.ms(&WorkNumbers::of(work), px) + rates.cut_ms(work.counted);
        let longer = (took.ms() / foreseen).ln();
        if !(longer.is_finite() && rates.is_known) {
            return;
        }
        if self.longer.len() == DRIFTS {
            self.longer.pop_front();
        }
        self.longer.push_back(longer);
        let middle = median(self.longer.iter().copied().collect());
        let beyond_noise = (middle.abs() - NOISE).clamp(0.0, MOST_DRIFT);
        self.drift = beyond_noise.copysign(middle).exp();
    }

    /// A frame of `work`, drawn with `drawn_px`, took so long.
    pub fn frame(&mut self, drawn_px: f32, work: &FrameWork, took: impl Into<TimeTaken>) {
        let took = took.into();
        self.note_drift(drawn_px, work, took);
        if !self.model.learn(drawn_px, work, took) {
            return;
        }
        self.note_seen(drawn_px, work, took);
        let ms = took.ms();
        tracing::debug!(ms, drawn_px, ?work, ?took, learned = ?self.model.learned(), "frame");
        let coarsest = COARSEST_PX.max(self.finest_px);
        if self.last_ms.len() == 3 {
            self.last_ms.pop_front();
        }
        self.last_ms.push_back(ms);
        let is_enough = self.last_ms.len() == 3;
        let ratio = median(self.last_ms.iter().copied().collect()) / self.target_ms;
        self.report = if !is_enough {
            BudgetReport::Adapting
        } else if ratio > 1.0 + HELD && drawn_px >= coarsest {
            BudgetReport::Unreachable(ratio * self.target_ms)
        } else if ratio <= 1.0 + HELD && (drawn_px <= self.finest_px || ratio >= 1.0 - HELD) {
            BudgetReport::Held
        } else {
            BudgetReport::Adapting
        };
    }
}

#[cfg(test)]
mod tests;
