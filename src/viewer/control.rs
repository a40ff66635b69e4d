//! Keeps frames within a time: the threshold follows what frames cost while the camera moves, and goes back to the
//! wanted one in steps when it rests. Pure logic.
//!
//! After Rusinkiewicz and Levoy, *QSplat* (2000), sections 2.1 and 3.2, who multiply the threshold by the ratio of
//! measured and wanted time. That is late where frames overlap and the camera comes near fast. Ours foresees: the cut
//! of the coming frame is counted before it is drawn, and the last frames say what a unit of work takes. The threshold
//! stays as it is while the foreseen time is near the wanted one, so noise moves nothing.
//!
//! What a frame takes is foreseen part by part (see `src/viewer/control/model.rs`). Cuts that are counted and not drawn take time as well;
//! they count as work of the frame that they are made for.
//!
//! Small splats can be drawn by compute or by the rasterizer, and neither is the cheaper one everywhere: the rasterizer
//! takes longer for a splat, compute for passes over the picture and, of large splats, for their pixels. The way is chosen
//! with the threshold, by what both were found to take: the one that keeps the time with the finer threshold, and only
//! when the threshold has to change anyway. Rules that look at the counts alone go from one to the other and back between
//! frames of nearly the same time but of different thresholds.

mod model;

pub use model::{Took, Work};

use crate::abi::constants::LARGEST_SMALL_BLENDED_PX;
use crate::method::LARGEST_COMPUTE_SQUARE_PX;
use model::{Model, Numbers, Rates};
use std::collections::VecDeque;

/// Largest threshold that is chosen, pixels (theirs).
pub const COARSEST_PX: f32 = 50.0;
/// A frame foreseen to miss the wanted time by less than this share keeps the threshold of the one before.
const DEAD_BAND: f64 = 0.045;
/// The search for another threshold ends at this share.
const AIM: f64 = 0.02;
/// The largest splats that compute draws may take so much longer: one size up may take far longer.
const EDGE_BAND: f64 = 0.06;
/// Cuts that are counted for a frame at most.
const MOST_CUTS: usize = 4;
/// A frame is made shorter for cuts that are counted and not drawn by at most this part: so much less than the dead band
/// that the next frame, which has none, is still in it.
const MOST_LOST: f64 = 0.02;
/// Cuts may be counted for a frame until they take this part of the wanted time; more only where what was found is further
/// off than [`WORTH`]. Each is as long as the cut that is drawn, and where what is drawn jumps with the threshold no search
/// comes to an end.
const MOST_SPENT: f64 = 0.1;
const WORTH: f64 = 0.4;
/// The other way to draw is taken where its threshold is finer than this part of the present way's.
const FINER: f32 = 0.95;
/// A threshold is changed by at most this factor before it is looked at what that draws.
const LARGEST_STEP: f32 = 2.0;
/// What is foreseen to miss the time by more than this does not stay, even if all else is foreseen to be worse.
const MOST_OFF: f64 = 0.1;
/// The factor by which the threshold changes then, at most.
const TRIED: f32 = 2.0;
/// Factor of the threshold from step to step at rest (theirs).
const REFINE: f32 = 0.7;
/// Off by less than this the time counts as held.
const HELD: f64 = 0.15;

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

/// The largest threshold with which compute draws, pixels.
fn largest_by_compute(work: &Work) -> f32 {
    if work.is_blended {
        LARGEST_SMALL_BLENDED_PX
    } else {
        LARGEST_COMPUTE_SQUARE_PX
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
    model: Model,
    /// Work goes with the threshold to minus this power.
    power: f64,
    /// The way that was chosen last, where there was a choice.
    by_compute: bool,
    /// There was one.
    has_choice: bool,
    /// What the last of them took, oldest first.
    last_ms: VecDeque<f64>,
    /// Nodes looked at to plan the present frame, by cuts that are not drawn.
    counted: u64,
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
            model: Model::default(),
            power: 2.0,
            by_compute: true,
            has_choice: false,
            last_ms: VecDeque::new(),
            counted: 0,
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
        self.model = Model::default();
        self.power = 2.0;
        (self.by_compute, self.has_choice) = (true, false);
        self.last_ms.clear();
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

    /// The threshold between `ends` with which what is drawn with `px` takes `ms`, foreseen by `rates`; the nearer end
    /// where none does.
    fn threshold_for(
        &self,
        ms: f64,
        (work, px): (&Work, f32),
        rates: Rates,
        (mut low, mut high): (f32, f32),
    ) -> f32 {
        let numbers = Numbers::of(work);
        let is_too_much = |at: f32| self.foreseen(rates, numbers, (px, at)) > ms;
        if is_too_much(high) {
            return high;
        }
        if !is_too_much(low) {
            return low;
        }
        for _ in 0..24 {
            let middle = (low * high).sqrt();
            if is_too_much(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }

    /// Milliseconds of a frame with the threshold `at`, of which it is known what it draws with `px`.
    fn foreseen(&self, rates: Rates, numbers: Numbers, (px, at): (f32, f32)) -> f64 {
        let fewer = f64::from(at / px).powf(-self.power);
        rates.ms(&numbers.times(fewer), at)
    }

    /// The threshold to be tried after `px`, for frames of `ms`, and the way, of which it is now `by_compute`; between
    /// `ends`. None before the first frame.
    fn next(
        &self,
        ms: f64,
        (work, px): (&Work, f32),
        by_compute: bool,
        ends: (f32, f32),
    ) -> Option<(f32, bool)> {
        let of = |by_compute: bool| {
            let rates = self.model.rates(px, work, by_compute)?;
            let (mut low, mut high) = ends;
            if by_compute && self.has_choice {
                high = high.min(largest_by_compute(work));
                low = low.min(high);
            }
            let next = self.threshold_for(ms, (work, px), rates, (low, high));
            let misses = self.foreseen(rates, Numbers::of(work), (px, next)) / ms - 1.0;
            Some((next, misses))
        };
        let now = of(by_compute)?;
        if !self.has_choice {
            return Some((now.0, by_compute));
        }
        let other = of(!by_compute)?;
        // Compute cannot go further than its largest size.
        let keeps = |(_, misses): (f32, f64)| misses <= EDGE_BAND;
        let is_other = match (keeps(now), keeps(other)) {
            (true, true) => other.0 < FINER * now.0,
            (false, false) => other.1 < now.1,
            (_, is_other) => is_other,
        };
        Some(if is_other {
            (other.0, !by_compute)
        } else {
            (now.0, by_compute)
        })
    }

    /// The threshold for the next frame, pixels. `work` says what would be drawn with a threshold; it is asked only while
    /// the camera moves, and the last answer is that for the result. [`counted`](Control::counted) says what asking took,
    /// [`by_compute`](Control::by_compute) how it is to be drawn.
    pub fn plan(&mut self, mut work: impl FnMut(f32) -> Work) -> f32 {
        self.counted = 0;
        if !self.is_moving || self.model.count == 0 {
            return self.shown_px;
        }
        let (finest, coarsest) = (self.finest_px, COARSEST_PX.max(self.finest_px));
        let mut px = self.moving_px;
        let mut now = work(px);
        let mut wanted_way = self.by_compute;
        let (mut aim, mut allowed) = (1.0, DEAD_BAND);
        // Thresholds found too fine and too coarse: what is tried next lies between, if it is drawn in the same way.
        let (mut too_fine, mut too_coarse) = (0.0f32, f32::INFINITY);
        // What came nearest: how near, threshold and way.
        let mut best: Option<(f64, f32, bool)> = None;
        // How the threshold of the frame before is foreseen.
        let (before_px, mut before_share) = (px, None);
        for left in (0..MOST_CUTS).rev() {
            self.has_choice |= now.is_free;
            let by_compute = if now.is_free {
                wanted_way
            } else {
                now.by_compute
            };
            let Some(rates) = self.model.rates(px, &now, by_compute) else {
                break;
            };
            let ms = rates.ms(&Numbers::of(&now), px);
            let share = (ms / self.target_ms).max(1e-6);
            let off = (share / aim).ln().abs();
            if best.is_none_or(|(least, ..)| off < least) {
                best = Some((off, px, by_compute));
            }
            before_share.get_or_insert(share);
            let is_held = (share - aim).abs() <= allowed;
            if left == 0 || is_held {
                break;
            }
            if share > aim {
                too_fine = too_fine.max(px);
            } else {
                too_coarse = too_coarse.min(px);
            }
            let spent = rates.cut_ms(self.counted + now.visited) / self.target_ms;
            if spent > MOST_SPENT && off < WORTH {
                break;
            }
            // This cut will have been counted for nothing. All of that would make the frames after this one too short.
            let lost = rates.cut_ms(self.counted + now.visited) / self.target_ms;
            (aim, allowed) = (1.0 - lost.min(MOST_LOST), AIM);
            let high = (px * LARGEST_STEP).min(coarsest);
            let ends = ((px / LARGEST_STEP).max(finest).min(high), high);
            let wanted = aim * self.target_ms;
            let Some((mut next, way)) = self.next(wanted, (&now, px), by_compute, ends) else {
                break;
            };
            if way != by_compute {
                (too_fine, too_coarse) = (0.0, f32::INFINITY);
            } else if too_fine < too_coarse && (next <= too_fine || next >= too_coarse) {
                next = (too_fine.max(finest) * too_coarse.min(coarsest)).sqrt();
            }
            wanted_way = way;
            if next == px && way == by_compute {
                break;
            }
            self.counted += now.visited;
            let other = work(next);
            let steps = f64::from(next / px).ln();
            if steps.abs() > 1e-3 {
                let change = Numbers::of(&other).packed() / Numbers::of(&now).packed();
                self.power = (-change.ln() / steps).clamp(0.7, 4.0);
            }
            (px, now) = (next, other);
        }
        if let Some((off, mut best_px, way)) = best {
            // Whatever is foreseen: what misses the time is not drawn again and again, or nothing else is ever learned.
            if let Some(share) = before_share
                && best_px == before_px
                && off > MOST_OFF
            {
                let step = (share as f32).sqrt().clamp(TRIED.recip(), TRIED);
                best_px = (best_px * step).clamp(finest, coarsest);
            }
            if best_px != px {
                self.counted += now.visited;
                work(best_px);
            }
            (px, self.by_compute) = (best_px, way);
        }
        self.moving_px = px;
        self.shown_px = px;
        px
    }

    /// How splats of the planned frame are to be drawn, where they may be drawn in either way.
    pub fn by_compute(&self) -> bool {
        self.by_compute
    }

    /// Nodes that the last [`plan`](Control::plan) had looked at in vain, by cuts for other thresholds than its result.
    pub fn counted(&self) -> u64 {
        self.counted
    }

    /// A frame of `work`, drawn with `drawn_px`, took so long.
    pub fn frame(&mut self, drawn_px: f32, work: &Work, took: impl Into<Took>) {
        let took = took.into();
        if !self.model.learn(drawn_px, work, took) {
            return;
        }
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
            Report::Adapting
        } else if ratio > 1.0 + HELD && drawn_px >= coarsest {
            Report::Unreachable(ratio * self.target_ms)
        } else if ratio <= 1.0 + HELD && (drawn_px <= self.finest_px || ratio >= 1.0 - HELD) {
            Report::Held
        } else {
            Report::Adapting
        };
    }
}

#[cfg(test)]
mod tests;
