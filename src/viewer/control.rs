//! Keeps frames within a time: the threshold follows what frames cost while the camera moves, and goes back to the
//! wanted one in steps when it rests. Pure logic.
//!
//! After Rusinkiewicz and Levoy, *QSplat* (2000), sections 2.1 and 3.2, who multiply the threshold by the ratio of
//! measured and wanted time. That is late where frames overlap and the camera comes near fast. Ours foresees: the cut
//! of the coming frame is counted before it is drawn, and the last frames say what a unit of work takes. The threshold
//! stays as it is while the foreseen time is near the wanted one, so noise moves nothing.
//!
//! A frame that draws nothing takes time too, but how much cannot be told from frames that are all held at the same
//! time (tried: the estimate drifts to all of it, and thresholds swing). So all time counts as work: a correction comes
//! out too small rather than too large, and the next frames make up for it.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Largest threshold that is chosen, pixels (theirs).
pub const COARSEST_PX: f32 = 50.0;
/// A frame foreseen to miss the wanted time by less than this share keeps the threshold of the one before.
const DEAD_BAND: f64 = 0.045;
/// The search for another threshold ends at this share.
const AIM: f64 = 0.015;
/// Cuts that are counted for a frame at most.
const MOST_CUTS: usize = 4;
/// Factor of the threshold from step to step at rest (theirs).
const REFINE: f32 = 0.7;
/// Frames whose median says what a unit of work takes.
const RATES: usize = 9;
/// A threshold that differs by less than this factor is about the same.
const NEAR: f32 = 1.6;
/// Frames that are kept.
const FRAMES: usize = 96;
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
        (visited + work.splats as f64 + triangles).max(1.0)
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
    /// The last frames, oldest first.
    frames: VecDeque<Frame>,
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
            frames: VecDeque::with_capacity(FRAMES),
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
        self.frames.clear();
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

    /// Milliseconds of a unit of work that is drawn so with a threshold of about `px`; in any way, then with any threshold,
    /// where there was none; none before the first frame.
    fn rate(&self, px: f32, by_compute: bool) -> Option<f64> {
        let of = |is_wanted: &dyn Fn(&Frame) -> bool| {
            let frames = self.frames.iter().rev().filter(|f| is_wanted(f));
            let rates = frames
                .take(RATES)
                .map(|f| f.ms / self.weights.units(&f.work));
            let rates: Vec<f64> = rates.collect();
            (!rates.is_empty()).then(|| median(rates))
        };
        let is_alike = |f: &Frame| f.work.by_compute == by_compute;
        let is_near = |f: &Frame| (NEAR.recip()..=NEAR).contains(&(f.px / px));
        of(&|f| is_alike(f) && is_near(f))
            .or_else(|| of(&is_near))
            .or_else(|| of(&is_alike))
            .or_else(|| of(&|_| true))
    }

    /// The threshold for the next frame, pixels. `work` says what would be drawn with a threshold; it is asked only while
    /// the camera moves, and the last answer is not always that for the result.
    pub fn plan(&mut self, mut work: impl FnMut(f32) -> Work) -> f32 {
        if !self.is_moving {
            return self.shown_px;
        }
        if self.frames.is_empty() {
            return self.shown_px;
        }
        let (finest, coarsest) = (self.finest_px, COARSEST_PX.max(self.finest_px));
        // Foreseen over wanted time.
        let mut foresee = |px: f32| {
            let work = work(px);
            let rate = self.rate(px, work.by_compute).unwrap_or(0.0);
            (self.weights.units(&work) * rate / self.target_ms).max(1e-6)
        };
        let (mut px, mut share) = (self.moving_px, foresee(self.moving_px));
        // Work goes with the threshold to minus this power.
        let mut power = 2.0;
        let mut allowed = DEAD_BAND;
        for _ in 1..MOST_CUTS {
            if (share - 1.0).abs() <= allowed {
                break;
            }
            allowed = AIM;
            let next = (px * share.powf(1.0 / power) as f32).clamp(finest, coarsest);
            if next == px {
                break;
            }
            let next_share = foresee(next);
            let steps = f64::from(next / px).ln();
            if steps.abs() > 1e-3 {
                power = (-(next_share / share).ln() / steps).clamp(0.7, 4.0);
            }
            (px, share) = (next, next_share);
        }
        self.moving_px = px;
        self.shown_px = px;
        px
    }

    /// A frame of `work`, drawn with `drawn_px`, took `ms` milliseconds.
    pub fn frame(&mut self, drawn_px: f32, work: &Work, ms: f64) {
        if !(ms.is_finite() && ms > 0.0 && drawn_px > 0.0) {
            return;
        }
        if self.frames.len() == FRAMES {
            self.frames.pop_front();
        }
        self.frames.push_back(Frame {
            work: *work,
            px: drawn_px,
            ms,
        });
        self.weigh();
        tracing::debug!(ms, drawn_px, ?work, "frame");
        let coarsest = COARSEST_PX.max(self.finest_px);
        let last: Vec<f64> = self.frames.iter().rev().take(3).map(|f| f.ms).collect();
        let is_enough = last.len() == 3;
        let ratio = median(last) / self.target_ms;
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
        if self.frames.len() < LEAST_FRAMES {
            return;
        }
        // Mean square of the distance of logarithms from their mean, of the frames that are drawn alike.
        let disagreement = |weights: Weights| {
            let mut sum = 0.0;
            for by_compute in [false, true] {
                let frames = self
                    .frames
                    .iter()
                    .filter(|f| f.work.by_compute == by_compute);
                let rates = frames.map(|f| (f.ms / weights.units(&f.work)).ln());
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
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TARGET: f64 = 33.0;

    /// The oracle: splats go with the inverse square of the threshold, and a frame takes `a` and `b` for each of them.
    struct Device {
        a: f64,
        b: f64,
        splats: f64,
    }

    impl Device {
        /// One that takes the wanted time at `px`, of which `share` without any splat.
        fn reaching(px: f32, share: f64) -> Self {
            let (a, splats) = (share * TARGET, 4e6);
            let b = (TARGET - a) / (splats / f64::from(px).powi(2));
            Self { a, b, splats }
        }

        fn work(&self, px: f32) -> Work {
            Work {
                splats: (self.splats / f64::from(px).powi(2)) as u64,
                ..Work::default()
            }
        }

        fn ms(&self, px: f32) -> f64 {
            self.a + self.b * self.work(px).splats as f64
        }

        /// Draws frames of a moving camera, each told two frames later as on a window; their thresholds.
        fn drive(&self, control: &mut Control, frames: usize) -> Vec<f32> {
            let mut under_way = VecDeque::new();
            (0..frames)
                .map(|_| {
                    control.moved();
                    let px = control.plan(|px| self.work(px));
                    under_way.push_back(px);
                    if under_way.len() > 2
                        && let Some(px) = under_way.pop_front()
                    {
                        control.frame(px, &self.work(px), self.ms(px));
                    }
                    px
                })
                .collect()
        }
    }

    proptest! {
        #[test]
        fn the_time_is_reached_and_then_nothing_moves(share in 0.0..0.5f64, px in 1.2..30.0f32) {
            let device = Device::reaching(px, share);
            let mut control = Control::new(TARGET, 1.0);
            device.drive(&mut control, 40);
            let reached = device.ms(control.threshold_px());
            prop_assert!((reached / TARGET - 1.0).abs() < 0.1, "{reached} at {}", control.threshold_px());
            let rest = device.drive(&mut control, 30);
            prop_assert!(rest.windows(2).all(|w| w[0] == w[1]), "{rest:?}");
            prop_assert_eq!(control.report(), Report::Held);
        }

        #[test]
        fn noise_moves_nothing(noise in prop::collection::vec(-0.05..0.05f64, 60)) {
            let device = Device::reaching(3.0, 0.2);
            let mut control = Control::new(TARGET, 1.0);
            device.drive(&mut control, 60);
            let settled = control.threshold_px();
            for n in noise {
                control.frame(settled, &device.work(settled), device.ms(settled) * (1.0 + n));
                let px = control.plan(|px| device.work(px));
                prop_assert!((px / settled - 1.0).abs() < 0.06, "{px} after {settled}");
            }
        }

        #[test]
        fn thresholds_stay_between_the_wanted_one_and_fifty(times in prop::collection::vec(0.0..1e4f64, 1..50), finest in 0.5..60.0f32) {
            let device = Device::reaching(3.0, 0.2);
            let mut control = Control::new(TARGET, finest);
            for ms in times {
                control.moved();
                let px = control.plan(|px| device.work(px));
                prop_assert!(px >= finest && px <= COARSEST_PX.max(finest));
                control.frame(px, &device.work(px), ms);
            }
        }

        #[test]
        fn no_numbers_of_a_device_make_it_panic(frames in prop::collection::vec((any::<f32>(), any::<u32>(), any::<f64>()), 1..80)) {
            let mut control = Control::new(TARGET, 1.0);
            for (px, splats, ms) in frames {
                let work = Work { splats: u64::from(splats), ..Work::default() };
                control.frame(px, &work, ms);
                control.moved();
                let px = control.plan(|_| work);
                prop_assert!((1.0..=COARSEST_PX).contains(&px), "{px}");
            }
        }
    }

    #[test]
    fn a_sudden_view_of_other_cost_is_foreseen() {
        let near = Device::reaching(3.0, 0.1);
        let mut control = Control::new(TARGET, 1.0);
        near.drive(&mut control, 60);
        // Four times as much to draw, from one frame to the next.
        let far = Device {
            splats: 4.0 * near.splats,
            ..near
        };
        let first = far.drive(&mut control, 1)[0];
        assert!((far.ms(first) / TARGET - 1.0).abs() < 0.1, "{first}");
    }

    #[test]
    fn at_most_four_cuts_are_counted_for_a_frame_and_none_at_rest() {
        let device = Device::reaching(3.0, 0.1);
        let mut control = Control::new(TARGET, 1.0);
        device.drive(&mut control, 30);
        let asked = |control: &mut Control, splats: f64| {
            let mut count = 0;
            control.plan(|px| {
                count += 1;
                Device { splats, ..device }.work(px)
            });
            count
        };
        assert_eq!(asked(&mut control, device.splats), 1, "nothing has changed");
        for factor in [1e-6, 0.1, 10.0, 1e6] {
            assert!(asked(&mut control, factor * device.splats) <= MOST_CUTS);
        }
        control.refine();
        assert_eq!(asked(&mut control, 1e9), 0, "at rest");
    }

    #[test]
    fn a_time_that_no_threshold_reaches_is_reported_with_what_remains() {
        for a in [1.2, 1.5, 4.0] {
            let device = Device {
                a: a * TARGET,
                b: TARGET / 1e5,
                splats: 2e6,
            };
            let mut control = Control::new(TARGET, 1.0);
            device.drive(&mut control, 400);
            let Report::Unreachable(ms) = control.report() else {
                panic!("{a}: {:?}", control.report())
            };
            assert!((ms / TARGET - a).abs() < 0.02, "{a}: {ms}");
            assert_eq!(control.threshold_px(), COARSEST_PX);
            // A view that is cheaper takes the word back.
            let cheap = Device {
                a: 0.1 * TARGET,
                ..device
            };
            cheap.drive(&mut control, 400);
            assert_eq!(control.report(), Report::Held, "{a}");
        }
    }

    #[test]
    fn what_a_triangle_takes_is_learned() {
        let ms = |work: &Work| 1e-4 * work.splats as f64 + 8e-4 * work.triangles as f64;
        let mut control = Control::new(TARGET, 1.0);
        for i in 0..40 {
            let work = Work {
                splats: 200_000,
                triangles: 1000 * i,
                ..Work::default()
            };
            control.frame(3.0, &work, ms(&work));
        }
        control.moved();
        let only_triangles = |px: f32| Work {
            triangles: (4e5 / f64::from(px).powi(2)) as u64,
            ..Work::default()
        };
        let px = control.plan(only_triangles);
        let foreseen = ms(&only_triangles(px)) / TARGET;
        assert!((foreseen - 1.0).abs() < 0.25, "{foreseen} at {px}");
    }

    #[test]
    fn one_slow_frame_changes_nothing() {
        let device = Device::reaching(2.0, 0.15);
        let mut control = Control::new(TARGET, 1.0);
        device.drive(&mut control, 60);
        let settled = control.threshold_px();
        control.frame(settled, &device.work(settled), 10.0 * TARGET);
        let after = device.drive(&mut control, 20);
        assert!(after.iter().all(|px| *px == settled), "{after:?}");
    }

    #[test]
    fn at_rest_the_picture_becomes_finer_step_by_step_and_moving_ends_that_at_once() {
        let device = Device::reaching(10.0, 0.0);
        let mut control = Control::new(TARGET, 1.0);
        assert!(!control.is_coarse() && !control.refine(), "nothing to do");
        device.drive(&mut control, 40);
        let moving = control.threshold_px();
        assert!((moving - 10.0).abs() < 0.6, "{moving}");
        let mut steps = Vec::new();
        while control.refine() {
            steps.push(control.threshold_px());
        }
        assert_eq!(*steps.last().unwrap_or(&0.0), 1.0);
        assert!(
            (6..=8).contains(&steps.len()) && !control.is_coarse(),
            "{steps:?}"
        );
        assert!(
            steps[..steps.len() - 1]
                .windows(2)
                .all(|w| (w[1] / w[0] - 0.7).abs() < 1e-5)
        );
        control.moved();
        assert_eq!(control.threshold_px(), moving);
        control.refine();
        control.moved();
        assert_eq!(control.threshold_px(), moving, "from the middle as well");
        control.refine();
        control.set_finest(3.0);
        assert_eq!(control.threshold_px(), 3.0, "at rest as fine as wished");
        control.moved();
        assert_eq!(control.threshold_px(), moving, "and moving as before");
    }
}
