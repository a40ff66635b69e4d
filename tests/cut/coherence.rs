//! K of the design: the cut of a camera that moves is the cut from the root, whatever came before (F17).

use crate::testing::{Random, Strips, chaos, cloud, look, look_flat, model, sheet, sphere, torus};
use glam::DVec3;
use surfel::cut::{Coherent, Cut, Footprints, Selector, Settings, SizeMetric, Undrawn};
use surfel::math::camera::View;
use surfel::tree::Model;

/// A selector and a camera's follower, side by side.
struct Pair {
    coherent: Coherent,
    selector: Selector,
    expected: Cut,
    cut: Cut,
    tests: u64,
    kept: u64,
}

impl Pair {
    fn new(threads: usize) -> Self {
        Self {
            coherent: Coherent::with_threads(threads),
            selector: Selector::with_threads(threads),
            expected: Cut::default(),
            cut: Cut::default(),
            tests: 0,
            kept: 0,
        }
    }

    /// The same lists in the same order, and the same statistics.
    fn compare(
        &mut self,
        (model, undrawn): (&Model, &Undrawn),
        view: &View,
        settings: &Settings,
        seen: Option<Footprints>,
        what: &str,
    ) {
        let (expected, cut) = (&mut self.expected, &mut self.cut);
        match seen {
            Some(footprints) => {
                let seen = (footprints, undrawn);
                self.selector
                    .select_seen(model, view, settings, seen, expected);
                self.coherent.select_seen(model, view, settings, seen, cut);
            }
            None => {
                self.selector.select(model, view, settings, expected);
                self.coherent.select(model, view, settings, cut);
            }
        }
        assert_eq!(cut.nodes, expected.nodes, "{what}");
        assert_eq!(cut.strips, expected.strips, "{what}");
        assert_eq!(cut.leaves, expected.leaves, "{what}");
        assert_eq!(cut.triangles, expected.triangles, "{what}");
        // How many nodes are found to be behind others depends on how threads get on.
        if (cut.stats.behind, expected.stats.behind) == (0, 0) {
            assert_eq!(cut.stats, expected.stats, "{what}");
        }
        let update = self.coherent.last_update();
        // Each is tested or kept.
        assert_eq!(update.tests + update.kept, cut.stats.visited, "{what}");
        self.tests += update.tests;
        self.kept += update.kept;
    }
}

/// A walk of `frames` with steps of all sizes, jumps, eyes inside, changes of threshold, culling, metric, projection,
/// and of what is left out as hidden.
fn walk(name: &str, model: &Model, frames: u32, seed: u64) -> Pair {
    let mut random = Random(seed);
    let mut pair = Pair::new(1 + seed as usize % 3);
    let undrawn = Undrawn::new(model);
    let mut settings = Settings::default();
    let (mut eye, mut target) = (DVec3::new(0.0, 0.5, 3.0), DVec3::ZERO);
    let (mut flat, mut hides, mut pace, mut near) = (None, false, 0.05, 0.01);
    for frame in 0..frames {
        // Mostly steps; sometimes none at all, sometimes anywhere.
        match random.below(60) {
            0 => eye = random.direction() * 10f64.powf(random.range(-1.5, 1.2)),
            1 => target = random.in_ball() * 2.0,
            2 => settings.threshold_px = 10f64.powf(random.range(-1.0, 2.0)) as f32,
            3 => settings.cull_back = !settings.cull_back,
            4 => settings.cull_frustum = !settings.cull_frustum,
            5 => {
                settings.size = [
                    SizeMetric::Exact,
                    SizeMetric::Center,
                    SizeMetric::Nearest,
                    SizeMetric::Angle,
                    SizeMetric::Area,
                ][random.below(5)]
            }
            6 => {
                flat = match flat {
                    Some(_) => None,
                    None if random.below(3) == 0 => Some(random.range(0.2, 4.0)),
                    None => None,
                }
            }
            7 => settings.threshold_px = 0.0,
            8 => settings.threshold_px = 1e6,
            9 => pace = 10f64.powf(random.range(-5.0, -0.5)),
            10 => hides = !hides,
            11 => near = 10f64.powf(random.range(-3.0, 0.0)),
            12 => pair.coherent.reset(),
            13 | 14 => {}
            // Forward, around the target, turning, and all at once.
            15..30 => eye += (target - eye) * (pace * random.range(-1.0, 1.0)),
            30..40 => eye = target + glam::DQuat::from_rotation_y(pace) * (eye - target),
            40..50 => target += random.in_ball() * pace,
            _ => {
                eye += random.in_ball() * pace;
                target += random.in_ball() * (0.4 * pace);
                near *= 1.0 + 0.3 * pace;
            }
        }
        let view = match flat {
            Some(height) => look_flat(eye, target, height, (-2.0, 6.0), 1.5),
            None => look(eye, target, (near, 20.0)),
        };
        // The search is made for the exact size.
        let hides = hides && settings.size == SizeMetric::Exact && settings.threshold_px > 0.3;
        let seen = hides.then_some(Footprints {
            side_px: settings.threshold_px.min(64.0),
            hides: true,
            are_discs: false,
            large_leaves: false,
            is_cloud: model.triangles.is_empty(),
        });
        let what = format!("{name}, frame {frame}");
        pair.compare((model, &undrawn), &view, &settings, seen, &what);
    }
    println!("{name}: {} tests, {} kept", pair.tests, pair.kept);
    pair
}

#[test]
fn the_cut_of_a_moving_camera_equals_the_cut_from_the_root() {
    for (i, (name, soup)) in [
        ("sphere", sphere(40, 20)),
        ("torus", torus(60, 24)),
        ("needles", torus(500, 6)),
        ("sheet", sheet(25)),
        ("chaos", chaos(1700, 3)),
    ]
    .into_iter()
    .enumerate()
    {
        let pair = walk(name, &model(&soup, Strips::Yes), 3000, i as u64);
        assert!(
            pair.kept > pair.tests / 4,
            "{name}: {} {}",
            pair.kept,
            pair.tests
        );
        walk(name, &model(&soup, Strips::No), 800, 100 + i as u64);
    }
}

#[test]
fn the_cut_of_a_moving_camera_of_tiny_models_and_clouds_equals_the_cut_from_the_root() {
    for n in [1, 2, 3, 4, 5, 7, 16, 17, 70] {
        let name = format!("{n} triangles");
        walk(&name, &model(&chaos(n, 3), Strips::Yes), 300, n as u64);
    }
    let mut random = Random(9);
    let points: Vec<_> = (0..2000)
        .map(|_| random.direction())
        .map(|n| (n, n))
        .collect();
    walk("cloud", &cloud(&points, 0.03), 800, 7);
    let (mut coherent, mut cut) = (Coherent::default(), Cut::default());
    let view = look(DVec3::Z * 3.0, DVec3::ZERO, (0.1, 9.0));
    coherent.select(&Model::default(), &view, &Settings::default(), &mut cut);
    assert_eq!(cut, Cut::default());
    // Another model in between.
    for n in [40, 30, 1, 50, 50] {
        let model = model(&chaos(n, n as u64), Strips::No);
        let mut expected = Cut::default();
        Selector::default().select(&model, &view, &Settings::default(), &mut expected);
        coherent.reset();
        coherent.select(&model, &view, &Settings::default(), &mut cut);
        assert_eq!(cut, expected, "{n}");
    }
}

/// Spheres that are not nested, cones that do not hold the children's: size and visibility are no longer
/// monotone, centers lie outside of the balls above them, and still the cut must equal the one from the root.
#[test]
fn answers_are_kept_without_nested_bounds() {
    let mut random = Random(11);
    let mut model = model(&torus(60, 24), Strips::Yes);
    for node in &mut model.tree.nodes {
        node.radius *= random.range(0.3, 1.0) as f32;
        node.cone.axis[0] = node.cone.axis[0].wrapping_add((random.next() % 9000) as i16);
        node.strip.half_length /= 2;
    }
    walk("not nested", &model, 3000, 12);
}

/// A camera that goes around a model, `degrees` a frame: how much of its cut is tested again, in parts of one.
fn tested(degrees: f64, frames: usize) -> f64 {
    let model = model(&torus(300, 100), Strips::Yes);
    let undrawn = Undrawn::new(&model);
    let settings = Settings {
        threshold_px: 3.0,
        cull_back: true,
        ..Settings::default()
    };
    let mut pair = Pair::new(2);
    for frame in 0..frames {
        let turn = glam::DQuat::from_rotation_y((degrees * frame as f64).to_radians());
        let view = look(turn * DVec3::new(0.0, 1.5, 4.0), DVec3::ZERO, (0.1, 9.0));
        let what = format!("{degrees} degrees, frame {frame}");
        if frame == 1 {
            (pair.tests, pair.kept) = (0, 0);
        }
        pair.compare((&model, &undrawn), &view, &settings, None, &what);
    }
    pair.tests as f64 / (pair.tests + pair.kept) as f64
}

/// The work follows the motion. (Counts, so they are the same on every machine.)
#[test]
fn small_steps_test_little_again() {
    let parts = [0.0, 0.01, 0.1, 0.5, 180.0].map(|degrees| tested(degrees, 12));
    println!("{parts:?}");
    assert!(parts.is_sorted(), "{parts:?}");
    // Above the regions all is tested always; that is most of what a camera that rests needs.
    let [still, tiny, small, medium, far] = parts;
    assert!(
        still < 0.06 && tiny < 0.07 && small < 0.12 && medium < 0.25 && far > 0.99,
        "{parts:?}"
    );
}

/// Warm lists keep their memory: the same cut again allocates nothing.
#[test]
fn a_warm_cut_keeps_its_memory() {
    let model = model(&sphere(80, 40), Strips::Yes);
    let view = look(DVec3::new(0.0, 0.4, 2.0), DVec3::ZERO, (0.1, 9.0));
    let (mut selector, mut cut) = (Selector::default(), Cut::default());
    let mut memory = Vec::new();
    for _ in 0..4 {
        selector.select(&model, &view, &Settings::default(), &mut cut);
        memory.push((
            cut.nodes.as_ptr(),
            cut.leaves.as_ptr(),
            cut.triangles.as_ptr(),
        ));
    }
    assert!(!cut.triangles.is_empty());
    assert_eq!(memory[1..], [memory[0]; 3]);
}
