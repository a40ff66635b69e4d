use super::model::WorkNumbers;
use super::plan::MOST_CUTS;
use super::*;
use proptest::prelude::*;

const TARGET: f64 = 33.0;
/// Nothing is seen from elsewhere.
const HERE: EyePlace = [0.0; 6];

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

    fn work(&self, px: f32) -> FrameWork {
        FrameWork {
            splats: (self.splats / f64::from(px).powi(2)) as u64,
            ..FrameWork::default()
        }
    }

    fn ms(&self, px: f32) -> f64 {
        self.took(px).ms()
    }

    /// Passes are timed: what is drawn for each splat is told from what is done for every picture.
    fn took(&self, px: f32) -> TimeTaken {
        TimeTaken {
            picture_ms: self.a,
            draw_ms: self.b * self.work(px).splats as f64,
            ..TimeTaken::default()
        }
    }

    /// Draws frames of a moving camera, each told two frames later as on a window; their thresholds.
    fn drive(&self, control: &mut FrameBudget, frames: usize) -> Vec<f32> {
        let mut under_way = VecDeque::new();
        (0..frames)
            .map(|_| {
                control.moved();
                let px = control.plan(HERE, |px| self.work(px));
                under_way.push_back(px);
                if under_way.len() > 2
                    && let Some(px) = under_way.pop_front()
                {
                    control.frame(px, &self.work(px), self.took(px));
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
        let mut control = FrameBudget::new(TARGET, 1.0);
        device.drive(&mut control, 40);
        let reached = device.ms(control.threshold_px());
        prop_assert!((reached / TARGET - 1.0).abs() < 0.1, "{reached} at {}", control.threshold_px());
        let rest = device.drive(&mut control, 30);
        prop_assert!(rest.windows(2).all(|w| w[0] == w[1]), "{rest:?}");
        prop_assert_eq!(control.report(), BudgetReport::Held);
    }

    #[test]
    fn noise_moves_nothing(noise in prop::collection::vec(-0.05..0.05f64, 60)) {
        let device = Device::reaching(3.0, 0.2);
        let mut control = FrameBudget::new(TARGET, 1.0);
        device.drive(&mut control, 60);
        let settled = control.threshold_px();
        for n in noise {
            let exact = device.took(settled);
            let took = TimeTaken {
                picture_ms: exact.picture_ms * (1.0 + n),
                draw_ms: exact.draw_ms * (1.0 + n),
                ..exact
            };
            control.frame(settled, &device.work(settled), took);
            let px = control.plan(HERE, |px| device.work(px));
            prop_assert!((px / settled - 1.0).abs() < 0.06, "{px} after {settled}");
        }
    }

    #[test]
    fn thresholds_stay_between_the_wanted_one_and_fifty(times in prop::collection::vec(0.0..1e4f64, 1..50), finest in 0.5..60.0f32) {
        let device = Device::reaching(3.0, 0.2);
        let mut control = FrameBudget::new(TARGET, finest);
        for ms in times {
            control.moved();
            let px = control.plan(HERE, |px| device.work(px));
            prop_assert!(px >= finest && px <= COARSEST_PX.max(finest));
            control.frame(px, &device.work(px), ms);
        }
    }

    #[test]
    fn no_numbers_of_a_device_make_it_panic(frames in prop::collection::vec((any::<f32>(), any::<u32>(), any::<f64>()), 1..80)) {
        let mut control = FrameBudget::new(TARGET, 1.0);
        for (px, splats, ms) in frames {
            let work = FrameWork { splats: u64::from(splats), ..FrameWork::default() };
            control.frame(px, &work, ms);
            control.moved();
            let px = control.plan(HERE, |_| work);
            prop_assert!((1.0..=COARSEST_PX).contains(&px), "{px}");
        }
    }
}

#[test]
fn a_sudden_view_of_other_cost_is_foreseen() {
    let near = Device::reaching(3.0, 0.1);
    let mut control = FrameBudget::new(TARGET, 1.0);
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
    let mut control = FrameBudget::new(TARGET, 1.0);
    device.drive(&mut control, 30);
    let asked = |control: &mut FrameBudget, splats: f64| {
        let mut count = 0;
        control.plan(HERE, |px| {
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
        let mut control = FrameBudget::new(TARGET, 1.0);
        device.drive(&mut control, 400);
        let BudgetReport::Unreachable(ms) = control.report() else {
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
        assert_eq!(control.report(), BudgetReport::Held, "{a}");
    }
}

#[test]
fn what_a_triangle_takes_is_learned() {
    let ms = |work: &FrameWork| 1e-4 * work.splats as f64 + 8e-4 * work.triangles as f64;
    let mut control = FrameBudget::new(TARGET, 1.0);
    for i in 0..40 {
        let work = FrameWork {
            splats: 200_000,
            triangles: 1000 * i,
            ..FrameWork::default()
        };
        control.frame(3.0, &work, ms(&work));
    }
    control.moved();
    let only_triangles = |px: f32| FrameWork {
        triangles: (4e5 / f64::from(px).powi(2)) as u64,
        ..FrameWork::default()
    };
    let px = control.plan(HERE, only_triangles);
    let foreseen = ms(&only_triangles(px)) / TARGET;
    assert!((foreseen - 1.0).abs() < 0.25, "{foreseen} at {px}");
}

#[test]
fn one_slow_frame_changes_nothing() {
    let device = Device::reaching(2.0, 0.15);
    let mut control = FrameBudget::new(TARGET, 1.0);
    device.drive(&mut control, 60);
    let settled = control.threshold_px();
    control.frame(settled, &device.work(settled), 10.0 * TARGET);
    let after = device.drive(&mut control, 20);
    assert!(after.iter().all(|px| *px == settled), "{after:?}");
}

#[test]
fn at_rest_the_picture_becomes_finer_step_by_step_and_moving_ends_that_at_once() {
    let device = Device::reaching(10.0, 0.0);
    let mut control = FrameBudget::new(TARGET, 1.0);
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

/// Filtered splats up to 16 pixels are drawn by the processor, while it packs; larger ones by the device. The frames most like
/// the wanted one by their numbers are those of the other.
#[test]
fn frames_of_the_processor_are_told_from_those_of_the_device() {
    let work = |splats| FrameWork {
        splats,
        pixels: 100_000,
        is_blended: true,
        by_compute: true,
        ..FrameWork::default()
    };
    let (fine, coarse) = (15.0, 17.0);
    let took = |px: f32, work: &FrameWork| {
        let splats = work.splats as f64;
        let is_of_processor = px == fine;
        TimeTaken {
            pack_ms: splats * if is_of_processor { 5e-5 } else { 2e-5 },
            picture_ms: if is_of_processor { 2.0 } else { 4.0 },
            draw_ms: splats * if is_of_processor { 0.0 } else { 9e-5 },
            ..TimeTaken::default()
        }
    };
    let (few, many) = (200_000, 260_000);
    let mut control = FrameBudget::new(TARGET, 1.0);
    for i in 0..60 {
        let (px, work) = if i % 2 == 0 {
            (fine, work(few))
        } else {
            (coarse, work(many))
        };
        control.frame(px, &work, took(px, &work));
    }
    for (px, work) in [(fine, work(many)), (coarse, work(few))] {
        let rates = control.model.rates(px, &work, true);
        let ms = rates.map(|rates| rates.ms(&WorkNumbers::of(&work), px));
        let off = ms.map(|ms| ms / took(px, &work).ms() - 1.0);
        assert!(off.is_some_and(|off| off.abs() < 0.05), "{px}: {off:?}");
    }
}

#[test]
fn the_usual_time_is_that_of_the_device_and_what_is_kept_comes_back() {
    for slow in [true, false] {
        let usual = FrameGoal::Usual.target_ms(slow);
        assert_eq!(usual, Some(if slow { 33.0 } else { 16.0 }));
        assert_eq!(FrameGoal::of_ms(usual, slow), FrameGoal::Usual);
        for goal in [FrameGoal::Usual, FrameGoal::Free, FrameGoal::Held(50.0)] {
            assert_eq!(FrameGoal::of_ms(goal.target_ms(slow), slow), goal);
            assert_eq!(FrameGoal::of_stored(goal.stored()), goal);
        }
    }
    // Kept by one device, it is a time on another.
    assert_eq!(FrameGoal::of_ms(Some(16.0), true), FrameGoal::Held(16.0));
}
