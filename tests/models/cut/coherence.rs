//! K of the design: the cut of a camera that moves is the cut from the root, whatever came before (F17).

use super::section::random_section;
use super::testing::{
    Random, Strips, chaos, cloud, cube, look, look_flat, model, sheet, sphere, torus,
};
use glam::{DQuat, DVec3};
use surfel::cut::{Cut, CutSelector, CutSettings, SizeMetric, SplatFootprints, ZeroAreaSet};
use surfel::generate::{self, GeneratedShape, ShapeSpec};
use surfel::math::camera::View;
use surfel::progress::SilentProgress;
use surfel::tree::{self, BuildOptions, Model, NormalCone};

/// A selector that starts at the root and one that starts at the front of its last cut, side by side.
struct Pair {
    coherent: CutSelector,
    selector: CutSelector,
    expected: Cut,
    cut: Cut,
    /// Nodes that each visited.
    visited: u64,
    from_root: u64,
    /// Frames in which they visited other numbers of them, so that the front was not the root.
    coherent_frames: u32,
}

impl Pair {
    fn new(threads: usize) -> Self {
        let mut coherent = CutSelector::with_threads(threads);
        coherent.set_coherent(true);
        Self {
            coherent,
            selector: CutSelector::with_threads(threads),
            expected: Cut::default(),
            cut: Cut::default(),
            visited: 0,
            from_root: 0,
            coherent_frames: 0,
        }
    }

    /// The same lists in the same order.
    fn compare(
        &mut self,
        (model, undrawn): (&Model, &ZeroAreaSet),
        view: &View,
        settings: &CutSettings,
        seen: Option<SplatFootprints>,
        what: &str,
    ) {
        let selectors = [&mut self.selector, &mut self.coherent];
        for (selector, cut) in selectors
            .into_iter()
            .zip([&mut self.expected, &mut self.cut])
        {
            match seen {
                Some(footprints) => {
                    selector.select_seen(model, view, settings, (footprints, undrawn), cut);
                }
                None => selector.select(model, view, settings, cut),
            }
        }
        let (expected, cut) = (&self.expected, &self.cut);
        assert_eq!(cut.nodes, expected.nodes, "{what}");
        assert_eq!(cut.strips, expected.strips, "{what}");
        assert_eq!(cut.leaves, expected.leaves, "{what}");
        // With splats of a pixel, which hidden triangles are left depends on the order of the work, as it does on threads.
        if !seen.is_some_and(|seen| seen.side_px <= 1.0) {
            assert_eq!(cut.triangles, expected.triangles, "{what}");
        }
        self.visited += cut.stats.visited;
        self.from_root += expected.stats.visited;
        self.coherent_frames += u32::from(cut.stats.visited != expected.stats.visited);
    }
}

/// Widens cones until each contains the cones below it, as [`tree::check`] demands; the builder of these tests makes each of its
/// own triangles.
fn nested(mut model: Model) -> Model {
    let half = |cone: &NormalCone| f64::from(cone.sin_half_angle()).min(1.0).asin();
    for id in (0..model.tree.nodes.len()).rev() {
        let node = model.tree.nodes[id];
        if node.has_leaves() {
            continue;
        }
        let (mut widest, axis) = (half(&node.cone), node.cone.axis().as_dvec3());
        for child in node.first_child..node.first_child + u32::from(node.child_count) {
            let below = model.tree.nodes[child as usize].cone;
            widest = widest.max(half(&below) + below.axis().as_dvec3().angle_between(axis));
        }
        let sine = (widest.sin() * 65535.0).ceil() + 1.0;
        model.tree.nodes[id].cone = if widest < 1.57 && sine < f64::from(NormalCone::NEVER) {
            NormalCone {
                sin_half_angle: sine as u16,
                ..node.cone
            }
        } else {
            NormalCone::ALL
        };
    }
    model
}

/// A walk of `frames` with steps of all sizes, jumps, eyes inside, changes of threshold, culling, metric, projection,
/// and of what is left out as hidden.
fn walk(name: &str, model: &Model, frames: u32, seed: u64) -> Pair {
    let mut random = Random(seed);
    let mut pair = Pair::new(1 + seed as usize % 3);
    let undrawn = ZeroAreaSet::new(model);
    let mut settings = CutSettings::default();
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
            12 => pair.coherent.forget(),
            13 => {
                settings.section = match settings.section {
                    None => Some(random_section(&mut random)),
                    Some(_) => None,
                }
            }
            14 => {}
            // Forward, around the target, turning, and all at once.
            15..30 => eye += (target - eye) * (pace * random.range(-1.0, 1.0)),
            30..40 => eye = target + DQuat::from_rotation_y(pace) * (eye - target),
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
        let seen = hides.then_some(SplatFootprints {
            side_px: settings.threshold_px.min(64.0),
            hides: true,
            are_discs: false,
            large_leaves: false,
            is_cloud: model.kind().is_points(),
        });
        let what = format!("{name}, frame {frame}");
        pair.compare((model, &undrawn), &view, &settings, seen, &what);
    }
    println!(
        "{name}: {} visits, {} from the root",
        pair.visited, pair.from_root
    );
    pair
}

#[test]
fn the_cut_of_a_moving_camera_equals_the_cut_from_the_root() {
    for (i, (name, soup)) in [
        ("sphere", sphere(40, 20)),
        ("torus", torus(60, 24)),
        ("needles", torus(500, 6)),
        ("sheet", sheet(25)),
        ("cube", cube(16)),
        ("chaos", chaos(1700, 3)),
    ]
    .into_iter()
    .enumerate()
    {
        for (strips, seed) in [(Strips::Yes, i), (Strips::No, 100 + i)] {
            let pair = walk(name, &nested(model(&soup, strips)), 3000, seed as u64);
            assert!(
                pair.coherent_frames > 1000,
                "{name}: {}",
                pair.coherent_frames
            );
        }
    }
}

/// Trees of the real builder, with rows of splats, triangles without area and levels that are divided among threads.
#[test]
fn the_cut_of_a_moving_camera_of_built_trees_equals_the_cut_from_the_root() {
    for (i, shape) in [
        GeneratedShape::Torus,
        GeneratedShape::Statue,
        GeneratedShape::Sphere,
    ]
    .into_iter()
    .enumerate()
    {
        for is_cloud in [false, true] {
            let mut mesh = generate::mesh(&ShapeSpec::with_triangles(shape, 60_000).unwrap());
            if is_cloud {
                mesh.triangles.clear();
            } else {
                for triangle in mesh.triangles.iter_mut().step_by(7) {
                    triangle[2] = triangle[1];
                }
            }
            let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
            let pair = walk(&format!("{shape:?}"), &model, 400, 20 + i as u64);
            assert!(
                pair.coherent_frames > 100,
                "{shape:?}: {}",
                pair.coherent_frames
            );
        }
    }
}

#[test]
fn the_cut_of_a_moving_camera_of_tiny_models_and_clouds_equals_the_cut_from_the_root() {
    for n in [1, 2, 3, 4, 5, 7, 16, 17, 70] {
        let name = format!("{n} triangles");
        walk(
            &name,
            &nested(model(&chaos(n, 3), Strips::Yes)),
            300,
            n as u64,
        );
    }
    let mut random = Random(9);
    let points: Vec<_> = (0..2000)
        .map(|_| random.direction())
        .map(|n| (n, n))
        .collect();
    walk("cloud", &nested(cloud(&points, 0.03)), 800, 7);
    let (mut coherent, mut cut) = (CutSelector::default(), Cut::default());
    coherent.set_coherent(true);
    let view = look(DVec3::Z * 3.0, DVec3::ZERO, (0.1, 9.0));
    coherent.select(&Model::default(), &view, &CutSettings::default(), &mut cut);
    assert_eq!(cut, Cut::default());
    // Another model in between.
    for n in [40, 30, 1, 50, 50] {
        let model = model(&chaos(n, n as u64), Strips::No);
        let mut expected = Cut::default();
        CutSelector::default().select(&model, &view, &CutSettings::default(), &mut expected);
        coherent.forget();
        coherent.select(&model, &view, &CutSettings::default(), &mut cut);
        assert_eq!(cut.triangles, expected.triangles, "{n}");
    }
}

/// What is saved, and what a jump costs. (Counts, so they are the same on every machine.)
#[test]
fn a_front_saves_the_nodes_above_it() {
    let model = model(&torus(300, 100), Strips::No);
    let undrawn = ZeroAreaSet::new(&model);
    let settings = CutSettings {
        threshold_px: 3.0,
        ..CutSettings::default()
    };
    let parts = [0.0, 0.02, 0.5, 180.0].map(|degrees: f64| {
        let mut pair = Pair::new(2);
        for frame in 0..12 {
            let turn = DQuat::from_rotation_y((degrees * f64::from(frame)).to_radians());
            let view = look(turn * DVec3::new(0.0, 1.5, 4.0), DVec3::ZERO, (0.1, 9.0));
            if frame == 1 {
                (pair.visited, pair.from_root) = (0, 0);
            }
            let what = format!("{degrees} degrees, frame {frame}");
            pair.compare((&model, &undrawn), &view, &settings, None, &what);
        }
        pair.visited as f64 / pair.from_root as f64
    });
    println!("{parts:?}");
    // A node above the front is not tested, but each group of the front is asked for a sibling that vouches for it.
    assert!(
        parts.iter().all(|part| *part < 1.02 && *part != 1.0),
        "{parts:?}"
    );
}

/// Warm lists keep their memory: the same cut again allocates nothing.
#[test]
fn a_warm_cut_keeps_its_memory() {
    let model = model(&sphere(80, 40), Strips::Yes);
    let view = look(DVec3::new(0.0, 0.4, 2.0), DVec3::ZERO, (0.1, 9.0));
    let (mut selector, mut cut) = (CutSelector::default(), Cut::default());
    let mut memory = Vec::new();
    for _ in 0..4 {
        selector.select(&model, &view, &CutSettings::default(), &mut cut);
        memory.push((
            cut.nodes.as_ptr(),
            cut.leaves.as_ptr(),
            cut.triangles.as_ptr(),
        ));
    }
    assert!(!cut.triangles.is_empty());
    assert_eq!(memory[1..], [memory[0]; 3]);
}
