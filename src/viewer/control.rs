//! Keeps frames within a time: the threshold follows what frames cost while the camera moves, and goes back to the
//! wanted one in steps when it rests. Pure logic.
//!
//! After Rusinkiewicz and Levoy, *QSplat* (2000), sections 2.1 and 3.2, who multiply the threshold by the ratio of
//! measured and wanted time. That is late where frames overlap and the camera comes near fast. Ours foresees: the cut
//! of the coming frame is counted before it is drawn, and the frames that have finished say what a unit of work takes.
//!
//! A frame begins with the threshold that would have been right for the one before. Another cut is counted only where the
//! time is foreseen to be missed by more than counting takes; else the next frame begins with what would have been right.
//! A place that was drawn before begins as it was drawn then, and stays so within a wider band: where the time hardly
//! changes with the threshold, or falls and rises with it, several thresholds are as good, and the way back has those of the
//! way there. A camera that stays where it is keeps its threshold so as well; noise moves nothing.
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

pub use model::{Place, Took, Work};

use crate::abi::constants::LARGEST_SMALL_BLENDED_PX;
use crate::method::LARGEST_COMPUTE_SQUARE_PX;
use crate::method::costs::{SplatCosts, Ways};
use model::{Model, Numbers, Rates, apart};
use std::collections::VecDeque;

/// Largest threshold that is chosen, pixels (theirs).
pub const COARSEST_PX: f32 = 50.0;
/// Foreseen to miss the wanted time by less than this, a frame is drawn as the one before. Where it is more, another cut is
/// counted if that takes less.
const DEAD_BAND: f64 = 0.02;
/// At a place that was drawn before it is drawn as then, if that is foreseen to miss the time by less than this: so much
/// less than [`HELD`] that noise does not decide. The same way there and back has the same thresholds so.
const AGAIN: f64 = 0.08;
/// While the camera stays where it is, the threshold does as well if the time is foreseen to be missed by less than this:
/// noise moves nothing.
const STAYS: f64 = 0.045;
/// Frames whose median says how much longer frames take than foreseen.
const DRIFTS: usize = 9;
/// By less than this (a logarithm) that is noise, and by more than the other it is none.
const NOISE: f64 = 0.02;
const MOST_DRIFT: f64 = 0.5;
/// Places that are remembered.
const SEEN: usize = 2048;
/// Places that are nearer than this are one, radii of the model or radians.
const MOVED: f64 = 0.002;
/// Cuts that are counted for a frame at most.
const MOST_CUTS: usize = 4;
/// Two thresholds of less than this factor between which the time jumps over the wanted one are not looked between.
const JUMP: f32 = 1.05;
/// The factor by which the next threshold is tried where one did not bring the time nearer by half.
const LEAP: f32 = 4.0;
/// What is foreseen to miss the time by more than this does not stay, even if all else that was counted is foreseen to be
/// worse.
const MOST_OFF: f64 = 0.1;
/// Of less than this factor they are near enough for that.
const WIDE_JUMP: f32 = 1.2;
/// Where the time jumps, it is looked beside the jump again after so many frames that this takes less than this part of them.
const LOOKED: f64 = 0.01;
/// Nor until the time is missed by so much more.
const WORSE: f64 = 0.02;
/// The largest splats that compute draws may take so much longer: one size up may take far longer.
const EDGE_BAND: f64 = 0.06;
/// The other way to draw is taken where its threshold is finer than this part of the present way's.
const FINER: f32 = 0.95;
/// A threshold is changed by at most this factor before it is looked at what that draws.
const LARGEST_STEP: f32 = 2.0;
/// A frame that takes too long is by this factor worse than one that is too short.
const SLOWER: f64 = 1.3;
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

/// Where the wanted time lies between a threshold that is too coarse and one that is too fine, on a straight line of
/// logarithms.
fn between(coarse: &Tried, fine: &Tried) -> f32 {
    let (a, b) = (coarse.share.ln(), fine.share.ln());
    let along = (-a / (b - a)).clamp(0.1, 0.9);
    let px = |tried: &Tried| f64::from(tried.px).ln();
    (px(coarse) + along * (px(fine) - px(coarse))).exp() as f32
}

/// Chooses thresholds for a wanted time of a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Control {
    target_ms: f64,
    finest_px: f32,
    /// While the camera moves.
    moving_px: f32,
    /// What was drawn where, oldest first.
    seen: VecDeque<Seen>,
    /// The last planned frame.
    last: Option<Tried>,
    /// Where it was seen from.
    place: Place,
    /// Until which planned frame a finer and a coarser threshold are not tried, and how far off the time was then.
    blocked: [(u64, f64); 2],
    /// Planned frames so far.
    planned: u64,
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
    /// Logarithms of how much longer than foreseen they took, oldest first, and the factor that follows.
    longer: VecDeque<f64>,
    drift: f64,
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

/// How a place was drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen {
    place: Place,
    px: f32,
    way: bool,
}

/// A threshold whose cut was counted.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Tried {
    px: f32,
    way: bool,
    /// Foreseen time, as part of the wanted one.
    share: f64,
    /// Threshold and way that are foreseen to take the wanted time.
    next: (f32, bool),
}

impl Tried {
    fn off(&self) -> f64 {
        self.share.ln().abs()
    }

    /// How bad that is: of what is as far off, the faster one is better.
    fn cost(&self) -> f64 {
        self.off() * if self.share > 1.0 { SLOWER } else { 1.0 }
    }

    /// 0 where a finer threshold is asked for, 1 where a coarser one is.
    fn side(&self) -> usize {
        usize::from(self.share > 1.0)
    }
}

impl Control {
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
            shown_px: finest_px,
            is_moving: false,
            model: Model::default(),
            power: 2.0,
            by_compute: true,
            has_choice: false,
            last_ms: VecDeque::new(),
            longer: VecDeque::new(),
            drift: 1.0,
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
        self.model.forget();
        self.power = 2.0;
        (self.by_compute, self.has_choice) = (true, false);
        self.seen.clear();
        (self.last, self.blocked) = (None, [(0, 0.0); 2]);
        self.last_ms.clear();
        self.longer.clear();
        self.drift = 1.0;
        self.report = Report::Adapting;
    }

    /// What splats were measured to take on the device: by that the two ways to draw them are compared before both were
    /// tried. None: by what is usual.
    pub fn know(&mut self, costs: Option<Ways<SplatCosts>>) {
        self.model.know(costs);
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
    pub fn plan(&mut self, place: Place, mut work: impl FnMut(f32) -> Work) -> f32 {
        self.counted = 0;
        if !self.is_moving || self.model.count == 0 {
            return self.shown_px;
        }
        self.planned += 1;
        let coarsest = COARSEST_PX.max(self.finest_px);
        let (mut px, mut way, mut allowed) = self.begin(place);
        let begun = px;
        let mut work = |px: f32| Work { place, ..work(px) };
        let mut now = work(px);
        // The nearest that were found too fine and too coarse.
        let mut around: [Option<Tried>; 2] = [None; 2];
        // What counting takes, as part of the wanted time.
        let mut spent = 0.0;
        let (mut first, mut best): (Option<Tried>, Option<Tried>) = (None, None);
        for left in (0..MOST_CUTS).rev() {
            self.has_choice |= now.is_free;
            if !now.is_free {
                way = now.by_compute;
            }
            let Some(rates) = self.model.rates(px, &now, way) else {
                break;
            };
            let ms = self.drift * rates.ms(&Numbers::of(&now), px);
            let share = (ms / self.target_ms).max(1e-6);
            let ends = (
                (px / LARGEST_STEP).max(self.finest_px),
                (px * LARGEST_STEP).min(coarsest),
            );
            let next = self
                .next(self.target_ms / self.drift, (&now, px), way, ends)
                .unwrap_or((px, way));
            tracing::trace!(px, way, share, ?next, is_known = rates.is_known, "counted");
            let tried = Tried {
                px,
                way,
                share,
                next,
            };
            let is_better = best.as_ref().is_none_or(|best| {
                let first = first.unwrap_or(*best);
                // Where the time jumps or falls, it is no way out of what takes too long to draw more.
                let is_away =
                    first.way == way && (px < first.px) == (first.share > 1.0) && px != first.px;
                tried.cost() < best.cost() && !is_away
            });
            first.get_or_insert(tried);
            if is_better {
                best = Some(tried);
            }
            let cut = rates.cut_ms(now.visited) / self.target_ms;
            spent += cut;
            let is_blocked = self.is_blocked(&tried);
            if left == 0 || next == (px, way) || is_blocked || tried.off() <= allowed.max(cut) {
                break;
            }
            let (mut next_px, next_way) = next;
            if next_way == way {
                let before = around[tried.side()].replace(tried);
                let drawn = self.last.filter(|last| {
                    last.px != px && last.side() != tried.side() && last.off() < tried.off()
                });
                if let [Some(coarse), Some(fine)] = around {
                    if coarse.px < JUMP * fine.px {
                        break;
                    }
                    next_px = between(&coarse, &fine);
                } else if self.counted == 0
                    && let Some(drawn) = drawn
                {
                    // From there to here it jumped over the wanted time.
                    next_px = drawn.px;
                } else if let Some(before) = before
                    && tried.off() > 0.8 * before.off()
                {
                    // Where the threshold changes little, it takes another one.
                    let by = if share > 1.0 { LEAP } else { LEAP.recip() };
                    next_px = (px * by).clamp(self.finest_px, coarsest);
                }
            } else {
                around = [None; 2];
            }
            allowed = DEAD_BAND;
            self.counted += now.visited;
            let other = work(next_px);
            let steps = f64::from(next_px / px).ln();
            if steps.abs() > 1e-3 {
                let change = Numbers::of(&other).packed() / Numbers::of(&now).packed();
                self.power = (-change.ln() / steps).clamp(0.7, 3.0);
            }
            (px, way, now) = (next_px, next_way, other);
        }
        if let Some(mut best) = best {
            let stay = (spent / LOOKED).ceil().min(60.0) as u64;
            if best.off() > MOST_OFF && best.px == begun && !self.is_blocked(&best) {
                // What misses the time is not drawn again and again where nothing is known of its neighbors.
                let step = (best.share as f32).sqrt();
                let at = (best.px * step.clamp(LARGEST_STEP.recip(), LARGEST_STEP))
                    .clamp(self.finest_px, coarsest);
                if at != best.px {
                    self.counted += now.visited;
                    (px, now) = (at, work(at));
                    let by_compute = if now.is_free {
                        best.way
                    } else {
                        now.by_compute
                    };
                    let is_known = self
                        .model
                        .rates(px, &now, by_compute)
                        .is_some_and(|rates| rates.is_known);
                    if is_known {
                        self.blocked[best.side()] = (self.planned + stay, best.off());
                    } else {
                        best = Tried {
                            px,
                            way: by_compute,
                            share: 1.0,
                            next: (px, by_compute),
                        };
                    }
                }
            } else if best.off() > DEAD_BAND
                && let [Some(coarse), Some(fine)] = around
                && coarse.px < WIDE_JUMP * fine.px
            {
                // Between them the time jumps over the wanted one.
                self.blocked[best.side()] = (self.planned + stay, best.off());
            }
            if best.px != px {
                self.counted += now.visited;
                work(best.px);
            }
            self.decide(&best);
            px = best.px;
        }
        self.moving_px = px;
        self.shown_px = px;
        px
    }

    /// Threshold and way that a frame begins with which is seen from `place`, and how far off the wanted time it stays with
    /// them: those of a frame that was seen from there before, or what would have been right for the last one.
    fn begin(&mut self, place: Place) -> (f32, bool, f64) {
        let moved = apart(&place, &self.place);
        self.place = place;
        let (finest, coarsest) = (self.finest_px, COARSEST_PX.max(self.finest_px));
        let distances = self.seen.iter().rev();
        let nearest = distances
            .map(|seen| (apart(&place, &seen.place), seen))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        // The frame before is farther away, unless the camera stays where it is.
        if let Some((distance, seen)) = nearest
            && distance <= MOVED.max(0.5 * moved)
        {
            let allowed = if moved <= MOVED { STAYS } else { AGAIN };
            return (seen.px.clamp(finest, coarsest), seen.way, allowed);
        }
        match self.last {
            Some(last) if last.off() <= DEAD_BAND || self.is_blocked(&last) => {
                (last.px.clamp(finest, coarsest), last.way, DEAD_BAND)
            }
            Some(last) => (last.next.0.clamp(finest, coarsest), last.next.1, DEAD_BAND),
            None => (self.moving_px.max(finest), self.by_compute, DEAD_BAND),
        }
    }

    /// Whether it is known that nothing nearer the wanted time lies beside this.
    fn is_blocked(&self, tried: &Tried) -> bool {
        let (until, off) = self.blocked[tried.side()];
        self.planned < until && tried.off() < off + WORSE
    }

    /// What is to be drawn.
    fn decide(&mut self, best: &Tried) {
        self.by_compute = best.way;
        self.last = Some(*best);
        if self.seen.len() == SEEN {
            self.seen.pop_front();
        }
        self.seen.push_back(Seen {
            place: self.place,
            px: best.px,
            way: best.way,
        });
    }

    /// How splats of the planned frame are to be drawn, where they may be drawn in either way.
    pub fn by_compute(&self) -> bool {
        self.by_compute
    }

    /// Nodes that the last [`plan`](Control::plan) had looked at in vain, by cuts for other thresholds than its result.
    pub fn counted(&self) -> u64 {
        self.counted
    }

    /// The device may be slower or faster for a while, whatever is drawn: how much longer than foreseen the last frames took.
    fn note_drift(&mut self, px: f32, work: &Work, took: Took) {
        let Some(rates) = self.model.rates(px, work, work.by_compute) else {
            return;
        };
        let foreseen = rates.ms(&Numbers::of(work), px) + rates.cut_ms(work.counted);
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
    pub fn frame(&mut self, drawn_px: f32, work: &Work, took: impl Into<Took>) {
        let took = took.into();
        self.note_drift(drawn_px, work, took);
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
