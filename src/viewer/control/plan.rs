//! Which threshold and way a frame begins with, and which others are counted for it.

use super::model::{EyePlace, FrameWork, TimeTaken, WorkNumbers, WorkRates, apart};
use super::{COARSEST_PX, FrameBudget};

/// Foreseen to miss the wanted time by less than this, a frame is drawn as the one before. Where it is more, another cut is
/// counted if that takes less.
const DEAD_BAND: f64 = 0.02;
/// At a place that was drawn before it is drawn as then, if that is foreseen to miss the time by less than this. The same way
/// there and back has the same thresholds so.
const AGAIN: f64 = 0.05;
/// Where it is more, but less than this, which is less than the 15 percent of a frame that counts as missed, it is drawn nearly
/// as then: the threshold goes by this factor at most towards the right one, however far away that is, and comes there visit
/// by visit.
const NEARLY: f64 = 0.13;
const CREEP: f32 = 1.04;
/// So it is where more is foreseen, up to this, but the frame that was drawn there took the time within [`AGAINST`].
const DOUBTED: f64 = 0.2;
const AGAINST: f64 = 0.1;
/// While the camera stays where it is, the threshold does as well if the time is foreseen to be missed by less than this:
/// noise moves nothing.
const STAYS: f64 = 0.045;
/// Places that are remembered.
const SEEN: usize = 2048;
/// Places that are nearer than this are one, radii of the model or radians.
const MOVED: f64 = 0.002;
/// Cuts that are counted for a frame at most.
pub(super) const MOST_CUTS: usize = 4;
/// Two thresholds of less than the first factor between which the time jumps over the wanted one are not looked between;
/// of less than the second they are near enough to call it a jump.
const JUMP: f32 = 1.05;
const WIDE_JUMP: f32 = 1.2;
/// The factor by which the next threshold is tried where one hardly brought the time nearer.
const LEAP: f32 = 4.0;
/// Hardly: it is still missed by more than this part of what it was.
const LITTLE: f64 = 0.8;
/// What is foreseen to miss the time by more than this does not stay, even if all else that was counted is foreseen to be
/// worse.
const MOST_OFF: f64 = 0.1;
/// Where the time jumps, it is looked beside the jump again when that has come to less than this part of the frames since, or
/// when the time is missed by so much more.
const LOOKED: f64 = 0.01;
const WORSE: f64 = 0.02;
/// Frames at most until then.
const LONGEST_BLOCK: f64 = 60.0;
/// The largest splats that compute draws may take so much longer: one size up may take far longer.
const EDGE_BAND: f64 = 0.06;
/// Where they take so many times the wanted one, what is coarser is better whatever draws it.
const FAR: f64 = 2.0;
/// So many frames long compute is not thought of again once they take longer and the rasterizer draws what is coarser.
const PAST_EDGE: u64 = 10;
/// The other way to draw is taken where its threshold is finer than this part of the present way's.
const FINER: f32 = 0.95;
/// A threshold is changed by at most this factor before it is looked at what that draws.
const LARGEST_STEP: f32 = 2.0;
/// A frame that takes too long is by this factor worse than one that is too short.
const SLOWER: f64 = 1.3;

/// Where the wanted time lies between a threshold that is too coarse and one that is too fine, on a straight line of
/// logarithms.
fn between(coarse: &TriedThreshold, fine: &TriedThreshold) -> f32 {
    let (a, b) = (coarse.share.ln(), fine.share.ln());
    let along = (-a / (b - a)).clamp(0.1, 0.9);
    let px = |tried: &TriedThreshold| f64::from(tried.px).ln();
    (px(coarse) + along * (px(fine) - px(coarse))).exp() as f32
}

/// How a place was drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SeenPlace {
    place: EyePlace,
    px: f32,
    way: bool,
    /// What that took without the cuts that were counted in vain, milliseconds; none before it has finished.
    took_ms: Option<f64>,
}

/// What a frame begins with.
#[derive(Debug, Clone, Copy)]
struct PlanBegin {
    px: f32,
    way: bool,
    /// How far off the wanted time it stays with that.
    allowed: f64,
    /// The last frame was drawn so, and the camera moves on.
    is_again: bool,
    /// What a frame so drawn took there, milliseconds.
    took_ms: Option<f64>,
}

/// A threshold whose cut was counted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TriedThreshold {
    px: f32,
    way: bool,
    /// Foreseen time, as part of the wanted one.
    share: f64,
    /// Threshold and way that are foreseen to take the wanted time.
    next: (f32, bool),
    /// What counting it took, as part of the wanted time.
    cut: f64,
    /// Frames nearly like it were drawn.
    is_known: bool,
    /// The frame takes too long, and compute draws nothing coarser.
    is_at_edge: bool,
}

/// What was counted for a frame.
#[derive(Debug, Default)]
struct ThresholdSearch {
    first: Option<TriedThreshold>,
    best: Option<TriedThreshold>,
    /// The last that were too coarse and too fine.
    around: [Option<TriedThreshold>; 2],
    count: usize,
    /// What counting took, as part of the wanted time.
    spent: f64,
    /// The largest splats of compute were counted, and take too long.
    has_edge: bool,
}

impl ThresholdSearch {
    fn add(&mut self, tried: TriedThreshold) {
        let first = *self.first.get_or_insert(tried);
        // Where the time falls and rises with the threshold, it is no way out of what takes too long to draw more.
        let is_away = first.way == tried.way
            && tried.px != first.px
            && (tried.px < first.px) == (first.share > 1.0);
        let is_better = self.best.is_none_or(|best| tried.cost() < best.cost());
        if is_better && !is_away {
            self.best = Some(tried);
        }
        self.count += 1;
        self.spent += tried.cut;
        self.has_edge |= tried.is_at_edge && tried.share > 1.0 + EDGE_BAND;
    }

    /// Tells whether the time jumps over the wanted one beside `best`.
    fn has_jump(&self, best: &TriedThreshold) -> bool {
        best.off() > DEAD_BAND
            && matches!(&self.around, [Some(coarse), Some(fine)] if coarse.px < WIDE_JUMP * fine.px)
    }
}

impl TriedThreshold {
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

impl FrameBudget {
    /// The threshold between `ends` with which what is drawn with `px` takes `ms`, foreseen by `rates`; the nearer end
    /// where none does.
    fn threshold_for(
        &self,
        ms: f64,
        (work, px): (&FrameWork, f32),
        rates: WorkRates,
        [mut low, mut high]: [f32; 2],
    ) -> f32 {
        let numbers = WorkNumbers::of(work);
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
    fn foreseen(&self, rates: WorkRates, numbers: WorkNumbers, (px, at): (f32, f32)) -> f64 {
        let fewer = f64::from(at / px).powf(-self.power);
        rates.ms(&numbers.times(fewer), at)
    }

    /// The threshold to be tried after `px`, for frames of `ms`, and the way, of which it is now `by_compute`; between
    /// `ends`. None before the first frame.
    fn next(
        &self,
        ms: f64,
        (work, px): (&FrameWork, f32),
        by_compute: bool,
        ends: [f32; 2],
    ) -> Option<(f32, bool)> {
        let of = |by_compute: bool| {
            let rates = self.model.rates(px, work, by_compute)?;
            let [mut low, mut high] = ends;
            if by_compute && self.has_choice {
                high = high.min(work.largest_by_compute_px);
                low = low.min(high);
            }
            let next = self.threshold_for(ms, (work, px), rates, [low, high]);
            let misses = self.foreseen(rates, WorkNumbers::of(work), (px, next)) / ms - 1.0;
            Some((next, misses))
        };
        let now = of(by_compute)?;
        let is_past_edge = !by_compute && self.planned < self.past_edge;
        if !self.has_choice || is_past_edge {
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

    /// The threshold for the next frame, pixels, which is seen from `place`. `work` says what would be drawn with a threshold;
    /// it is asked only while the camera moves, and the last answer is that for the result.
    /// [`counted`](FrameBudget::counted) says what asking took, [`by_compute`](FrameBudget::by_compute) how it is to be drawn.
    pub fn plan(&mut self, place: EyePlace, mut work: impl FnMut(f32) -> FrameWork) -> f32 {
        self.counted = 0;
        if !self.is_moving || self.model.count == 0 {
            return self.shown_px;
        }
        self.planned += 1;
        let begin = self.begin(place);
        let (mut px, mut way, mut allowed) = (begin.px, begin.way, begin.allowed);
        let mut work = |px: f32| FrameWork { place, ..work(px) };
        let mut now = work(px);
        let mut search = ThresholdSearch::default();
        let mut creeps = false;
        for left in (0..MOST_CUTS).rev() {
            let Some(tried) = self.foresee(px, way, &now) else {
                break;
            };
            way = tried.way;
            search.add(tried);
            let is_near = tried.off() <= allowed.max(tried.cut);
            if left == 0 || is_near || creeps || self.is_blocked(&tried) {
                break;
            }
            creeps = search.count == 1 && self.is_kept(&begin, &tried);
            let next = if creeps {
                let step = (tried.next.0 / px).clamp(CREEP.recip(), CREEP);
                (tried.next.0 != px).then_some((step * px, way))
            } else if tried.next == (px, way) {
                self.beyond(&tried)
            } else {
                self.after(&mut search, &tried)
            };
            let Some((next_px, next_way)) = next else {
                break;
            };
            allowed = DEAD_BAND;
            self.counted += now.visited;
            let other = work(next_px);
            let steps = f64::from(next_px / px).ln();
            if steps.abs() > 1e-3 {
                let change = WorkNumbers::of(&other).packed() / WorkNumbers::of(&now).packed();
                self.power = (-change.ln() / steps).clamp(0.7, 3.0);
            }
            (px, way, now) = (next_px, next_way, other);
        }
        let Some(mut best) = search.best else {
            return self.shown_px;
        };
        if creeps {
        } else if let Some(unknown) = self.unknown_beside(&search, &best) {
            self.counted += now.visited;
            (px, now) = (unknown, work(unknown));
            match self.foresee(px, best.way, &now) {
                // Known to be no better.
                Some(tried) if tried.is_known => self.block(&best, search.spent),
                Some(tried) => {
                    best = TriedThreshold {
                        share: 1.0,
                        ..tried
                    }
                }
                None => {}
            }
        } else if search.has_jump(&best) {
            self.block(&best, search.spent);
        }
        if best.px != px {
            self.counted += now.visited;
            work(best.px);
        }
        self.decide(&best, &search);
        best.px
    }

    /// What is foreseen of a frame with the threshold `px`, drawn in one way if it can be. None before the first frame.
    fn foresee(&mut self, px: f32, way: bool, work: &FrameWork) -> Option<TriedThreshold> {
        self.has_choice |= work.is_free;
        let way = if work.is_free { way } else { work.by_compute };
        let rates = self.model.rates(px, work, way)?;
        let ms = self.drift * rates.ms(&WorkNumbers::of(work), px);
        let share = (ms / self.target_ms).max(1e-6);
        let ends = [
            (px / LARGEST_STEP).max(self.finest_px),
            (px * LARGEST_STEP).min(self.coarsest()),
        ];
        let wanted = self.target_ms / self.drift;
        let next = self.next(wanted, (work, px), way, ends)?;
        tracing::trace!(px, way, share, ?next, rates.is_known, "counted");
        Some(TriedThreshold {
            px,
            way,
            share,
            next,
            cut: rates.cut_ms(work.visited) / self.target_ms,
            is_known: rates.is_known,
            is_at_edge: way
                && work.is_free
                && (1.0..FAR).contains(&share)
                && px >= 0.99 * work.largest_by_compute_px,
        })
    }

    /// Tells whether a frame is to be drawn nearly as it was before at this place.
    fn is_kept(&self, begin: &PlanBegin, tried: &TriedThreshold) -> bool {
        let kept = |ms: f64| (ms / self.target_ms).ln().abs() <= AGAINST;
        let is_doubted = || tried.off() <= DOUBTED && begin.took_ms.is_some_and(kept);
        begin.is_again && tried.way == begin.way && (tried.off() <= NEARLY || is_doubted())
    }

    /// Where compute ends and takes too long: the rasterizer takes longer a little above, and far beyond it may not.
    fn beyond(&self, tried: &TriedThreshold) -> Option<(f32, bool)> {
        let px = (tried.px * LARGEST_STEP).min(self.coarsest());
        (tried.is_at_edge && px > tried.px).then_some((px, false))
    }

    /// Threshold and way that are counted after `tried`; none where it is no use.
    fn after(&self, search: &mut ThresholdSearch, tried: &TriedThreshold) -> Option<(f32, bool)> {
        let (next_px, way) = tried.next;
        if way != tried.way {
            search.around = [None; 2];
            return Some(tried.next);
        }
        let before = search.around[tried.side()].replace(*tried);
        if let [Some(coarse), Some(fine)] = &search.around {
            return (coarse.px >= JUMP * fine.px).then(|| (between(coarse, fine), way));
        }
        let jumped_over = |last: &TriedThreshold| {
            last.px != tried.px && last.side() != tried.side() && last.off() < tried.off()
        };
        let px = match (&self.last, before) {
            // From there to here it jumped over the wanted time.
            (Some(last), _) if search.count == 1 && jumped_over(last) => last.px,
            (_, Some(before)) if tried.off() > LITTLE * before.off() => {
                let leap = if tried.share > 1.0 {
                    LEAP
                } else {
                    LEAP.recip()
                };
                (tried.px * leap).clamp(self.finest_px, self.coarsest())
            }
            _ => next_px,
        };
        Some((px, way))
    }

    /// A threshold to be drawn because nothing is known of it, where what was found is far off the wanted time and would be
    /// drawn again and again.
    fn unknown_beside(&self, search: &ThresholdSearch, best: &TriedThreshold) -> Option<f32> {
        let is_stuck = search.first.is_some_and(|first| first.px == best.px);
        if best.off() <= MOST_OFF || !is_stuck || self.is_blocked(best) {
            return None;
        }
        let step = match best.is_at_edge {
            true => LARGEST_STEP,
            false => (best.share as f32).sqrt(),
        };
        let px = best.px * step.clamp(LARGEST_STEP.recip(), LARGEST_STEP);
        let px = px.clamp(self.finest_px, self.coarsest());
        (px != best.px).then_some(px)
    }

    fn coarsest(&self) -> f32 {
        COARSEST_PX.max(self.finest_px)
    }

    /// Threshold and way that a frame begins with which is seen from `place`, and how far off the wanted time it stays with
    /// them: those of a frame that was seen from there before, or what would have been right for the last one.
    fn begin(&mut self, place: EyePlace) -> PlanBegin {
        let moved = apart(&place, &self.place);
        self.place = place;
        let (finest, coarsest) = (self.finest_px, self.coarsest());
        let distances = self.seen.iter().rev();
        let nearest = distances
            .map(|seen| (apart(&place, &seen.place), seen))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        // The frame before is farther away, unless the camera stays where it is.
        if let Some((distance, seen)) = nearest
            && distance <= MOVED.max(0.5 * moved)
        {
            let is_still = moved <= MOVED;
            return PlanBegin {
                px: seen.px.clamp(finest, coarsest),
                way: seen.way,
                allowed: if is_still { STAYS } else { AGAIN },
                is_again: !is_still,
                took_ms: seen.took_ms,
            };
        }
        let (px, way) = match self.last {
            Some(last) if last.off() <= DEAD_BAND || self.is_blocked(&last) => (last.px, last.way),
            Some(last) => last.next,
            None => (self.moving_px, self.by_compute),
        };
        PlanBegin {
            px: px.clamp(finest, coarsest),
            way,
            allowed: DEAD_BAND,
            is_again: false,
            took_ms: None,
        }
    }

    /// Tells whether it is known that nothing nearer the wanted time lies beside this.
    fn is_blocked(&self, tried: &TriedThreshold) -> bool {
        let (until, off) = self.blocked[tried.side()];
        self.planned < until && tried.off() < off + WORSE
    }

    /// Notes that something nearer the wanted time was looked for, for so much of a frame, and there was nothing.
    fn block(&mut self, best: &TriedThreshold, spent: f64) {
        let frames = (spent / LOOKED).ceil().min(LONGEST_BLOCK) as u64;
        self.blocked[best.side()] = (self.planned + frames, best.off());
    }

    /// What is to be drawn.
    fn decide(&mut self, best: &TriedThreshold, search: &ThresholdSearch) {
        // Compute was counted as coarse as it goes and found too slow: from here, that is only guessed.
        if !best.way && search.has_edge {
            self.past_edge = self.planned + PAST_EDGE;
        }
        self.by_compute = best.way;
        (self.moving_px, self.shown_px) = (best.px, best.px);
        self.last = Some(*best);
        if self.seen.len() == SEEN {
            self.seen.pop_front();
        }
        self.seen.push_back(SeenPlace {
            place: self.place,
            px: best.px,
            way: best.way,
            took_ms: None,
        });
    }

    /// A frame has finished: the place that it was seen from remembers what it took.
    pub(super) fn note_seen(&mut self, px: f32, work: &FrameWork, took: TimeTaken) {
        let is_it = |seen: &&mut SeenPlace| seen.place == work.place && seen.px == px;
        if let Some(seen) = self.seen.iter_mut().rev().find(is_it) {
            let looked = (work.visited + work.counted).max(1);
            let in_vain = took.cut_ms * work.counted as f64 / looked as f64;
            seen.took_ms = Some(took.ms() - in_vain);
        }
    }
}
