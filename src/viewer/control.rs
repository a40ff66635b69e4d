//! Keeps frames within a time: the threshold follows what frames cost while the camera moves, and goes back to the
//! wanted one in steps when it rests. Pure logic.
//!
//! After Rusinkiewicz and Levoy, *QSplat* (2000), sections 2.1 and 3.2: the area threshold is multiplied by the ratio
//! of measured and wanted time, the diameter by its root. Ours: a dead band with hysteresis, the median of what the
//! last three frames ask for (not of their times: the threshold differs from frame to frame), and a word when no
//! threshold can reach the time.

/// Largest threshold that is chosen, pixels (theirs).
pub const COARSEST_PX: f32 = 50.0;
/// Off the wanted time by less than this: the threshold stays as it is, once it has settled.
const DEAD_BAND: f64 = 0.05;
/// Off by less than this: it has settled.
const SETTLED: f64 = 0.019;
/// Factor of the threshold from step to step at rest (theirs).
const REFINE: f32 = 0.7;
/// Frames in a row that must agree that the time cannot be reached.
const AGREE: u32 = 3;

/// What is known about the wanted time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Report {
    /// Too few frames so far, or on the way.
    Adapting,
    /// The last frames kept it, or were faster at the wanted threshold.
    Held,
    /// No threshold reaches it: even without splats and triangles a frame would take about this long,
    /// milliseconds.
    Unreachable(f64),
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
    /// What the last frames ask for, pixels.
    wanted_px: Vec<f32>,
    last: Option<(f32, f64)>,
    has_settled: bool,
    hopeless: u32,
    report: Report,
}

impl Control {
    /// For frames of `target_ms` milliseconds (at least 1), and never finer than `finest_px` pixels.
    pub fn new(target_ms: f64, finest_px: f32) -> Self {
        Self {
            target_ms: target_ms.max(1.0),
            finest_px,
            moving_px: finest_px,
            shown_px: finest_px,
            wanted_px: Vec::new(),
            last: None,
            has_settled: false,
            hopeless: 0,
            report: Report::Adapting,
        }
    }

    /// The wanted time, milliseconds.
    pub fn target_ms(&self) -> f64 {
        self.target_ms
    }

    /// The user wants another threshold.
    pub fn set_finest(&mut self, px: f32) {
        if px != self.finest_px {
            *self = Self::new(self.target_ms, px);
        }
    }

    /// The threshold to draw with, pixels: between the wanted one and [`COARSEST_PX`].
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
    }

    /// The camera rests: one step finer. Returns whether the threshold changed.
    pub fn refine(&mut self) -> bool {
        let next = (self.shown_px * REFINE).max(self.finest_px);
        std::mem::replace(&mut self.shown_px, next) != next
    }

    /// A frame of a moving camera, drawn with `drawn_px`, took `ms` milliseconds of work.
    pub fn frame(&mut self, drawn_px: f32, ms: f64) {
        if !(ms.is_finite() && ms > 0.0 && drawn_px > 0.0) {
            return;
        }
        let ratio = ms / self.target_ms;
        self.notice_hopeless(drawn_px, ms);
        let coarsest = COARSEST_PX.max(self.finest_px);
        let wanted = (drawn_px * ratio.sqrt() as f32).clamp(self.finest_px, coarsest);
        if self.wanted_px.len() == 3 {
            self.wanted_px.remove(0);
        }
        self.wanted_px.push(wanted);
        let mut sorted = self.wanted_px.clone();
        sorted.sort_by(f32::total_cmp);
        let median = match sorted.as_slice() {
            [_, middle, _] => *middle,
            // Until there are three the newest counts: the first frame may have been far off.
            _ => wanted,
        };
        if self.has_settled {
            // One slow frame does not end the rest.
            let error = f64::from(median / self.moving_px).powi(2) - 1.0;
            self.has_settled = error.abs() <= DEAD_BAND;
        } else {
            let is_at_limit =
                median == self.moving_px && (median == self.finest_px || median == coarsest);
            self.has_settled = (ratio - 1.0).abs() <= SETTLED || is_at_limit;
        }
        if !self.has_settled {
            self.moving_px = median;
            self.shown_px = median;
        }
        let is_fast_enough = ratio <= 1.0 + DEAD_BAND;
        self.report = if self.hopeless >= AGREE {
            self.report
        } else if is_fast_enough && (self.has_settled || self.moving_px <= self.finest_px) {
            Report::Held
        } else if self.has_settled && self.moving_px >= coarsest {
            Report::Unreachable(ms)
        } else {
            Report::Adapting
        };
    }

    /// Two frames with different thresholds tell what a frame costs that draws nothing: T = a + b / threshold^2.
    fn notice_hopeless(&mut self, px: f32, ms: f64) {
        let Some((before_px, before_ms)) = self.last else {
            self.last = Some((px, ms));
            return;
        };
        let inverse = |px: f32| 1.0 / f64::from(px).powi(2);
        let step = inverse(before_px) - inverse(px);
        // Frames that are alike tell nothing; the older one stays.
        if (px / before_px).ln().abs() < 0.01 && self.hopeless < AGREE {
            return;
        }
        self.last = Some((px, ms));
        if step == 0.0 {
            if ms <= self.target_ms {
                self.hopeless = 0;
            }
            return;
        }
        let b = ((before_ms - ms) / step).max(0.0);
        let a = ms - b * inverse(px);
        if a >= self.target_ms {
            self.hopeless += 1;
            if self.hopeless >= AGREE {
                self.report = Report::Unreachable(a);
            }
        } else {
            self.hopeless = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TARGET: f64 = 33.0;

    /// The oracle: a frame with nothing to draw takes `a`, the rest goes with the inverse square.
    fn time(a: f64, b: f64, px: f32) -> f64 {
        a + b / f64::from(px).powi(2)
    }

    fn drive(control: &mut Control, a: f64, b: f64, frames: usize) -> Vec<f32> {
        (0..frames)
            .map(|_| {
                let px = control.threshold_px();
                control.frame(px, time(a, b, px));
                px
            })
            .collect()
    }

    proptest! {
        #[test]
        fn ten_frames_are_enough_where_half_of_the_time_is_there(a in 0.0..0.5f64, px in 1.05..49.0f32) {
            let a = a * TARGET;
            let b = (TARGET - a) * f64::from(px).powi(2);
            let mut control = Control::new(TARGET, 1.0);
            drive(&mut control, a, b, 10);
            let reached = time(a, b, control.threshold_px());
            prop_assert!((reached / TARGET - 1.0).abs() < 0.02, "{reached} at {}", control.threshold_px());
            // And at rest nothing moves any more.
            let rest = drive(&mut control, a, b, 20);
            prop_assert!(rest.windows(2).all(|w| w[0] == w[1]), "{rest:?}");
            prop_assert_eq!(control.report(), Report::Held);
        }

        #[test]
        fn noise_within_the_dead_band_moves_nothing_at_rest(noise in prop::collection::vec(-0.045..0.045f64, 60)) {
            let (a, b) = (0.2 * TARGET, 0.8 * TARGET * 9.0);
            let mut control = Control::new(TARGET, 1.0);
            drive(&mut control, a, b, 30);
            let settled = control.threshold_px();
            for n in noise {
                control.frame(settled, TARGET * (1.0 + n));
                prop_assert_eq!(control.threshold_px(), settled);
            }
        }

        #[test]
        fn thresholds_stay_between_the_wanted_one_and_fifty(times in prop::collection::vec(0.0..1e4f64, 1..50), finest in 0.5..60.0f32) {
            let mut control = Control::new(TARGET, finest);
            for ms in times {
                control.frame(control.threshold_px(), ms);
                let px = control.threshold_px();
                prop_assert!(px >= finest && px <= COARSEST_PX.max(finest));
            }
        }
    }

    #[test]
    fn the_way_back_has_the_thresholds_of_the_way_there() {
        let a = 0.3 * TARGET;
        // Nearer and nearer: four times the work within 150 frames.
        let work: Vec<f64> = (0..150)
            .map(|i| 0.7 * TARGET * 4.0 * 4f64.powf(f64::from(i) / 149.0))
            .collect();
        let mut control = Control::new(TARGET, 1.0);
        drive(&mut control, a, work[0], 20);
        let mut walk = |b: &f64| drive(&mut control, a, *b, 1)[0];
        let there: Vec<f32> = work.iter().map(&mut walk).collect();
        let mut back: Vec<f32> = work.iter().rev().map(&mut walk).collect();
        back.reverse();
        for (i, (there, back)) in there.iter().zip(&back).enumerate() {
            assert!(
                (there / back - 1.0).abs() < 0.1,
                "frame {i}: {there} there, {back} back"
            );
        }
        assert!(there[149] > 1.5 * there[0], "the path changes the work");
    }

    #[test]
    fn a_time_that_no_threshold_reaches_is_reported_with_what_remains() {
        for a in [1.1, 1.5, 4.0] {
            let mut control = Control::new(TARGET, 1.0);
            drive(&mut control, a * TARGET, 20.0 * TARGET, 10);
            let Report::Unreachable(ms) = control.report() else {
                panic!("{a}: {:?}", control.report())
            };
            assert!((ms / TARGET - a).abs() < 0.01, "{a}: {ms}");
            // A view that is cheaper again takes the word back.
            drive(&mut control, 0.1 * TARGET, TARGET, 20);
            assert_eq!(control.report(), Report::Held, "{a}");
        }
        // Half of the time is no reason to give up.
        let mut control = Control::new(TARGET, 1.0);
        drive(&mut control, 0.45 * TARGET, 40.0 * TARGET, 12);
        assert_eq!(control.report(), Report::Held);
    }

    #[test]
    fn one_slow_frame_changes_nothing() {
        let (a, b) = (5.0, 28.0 * 4.0);
        let mut control = Control::new(TARGET, 1.0);
        drive(&mut control, a, b, 20);
        let settled = control.threshold_px();
        control.frame(settled, 10.0 * TARGET);
        assert_eq!(control.threshold_px(), settled);
        drive(&mut control, a, b, 5);
        assert_eq!(control.threshold_px(), settled);
    }

    #[test]
    fn at_rest_the_picture_becomes_finer_step_by_step_and_moving_ends_that_at_once() {
        let mut control = Control::new(TARGET, 1.0);
        drive(&mut control, 0.0, TARGET * 100.0, 10);
        let moving = control.threshold_px();
        assert!((moving - 10.0).abs() < 0.2);
        let mut steps = Vec::new();
        while control.refine() {
            steps.push(control.threshold_px());
        }
        assert_eq!(*steps.last().unwrap_or(&0.0), 1.0);
        assert!(steps.len() == 7 && !control.is_coarse(), "{steps:?}");
        assert!(
            steps[..6]
                .windows(2)
                .all(|w| (w[1] / w[0] - 0.7).abs() < 1e-5)
        );
        control.moved();
        assert_eq!(control.threshold_px(), moving);
        control.refine();
        control.moved();
        assert_eq!(control.threshold_px(), moving, "from the middle as well");
        control.set_finest(3.0);
        assert_eq!(control.threshold_px(), 3.0, "another wish starts anew");
    }
}
