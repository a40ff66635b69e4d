//! K of the design: the updated cut is the cut from the root, whatever came before (F17).

use crate::testing::{Random, Strips, chaos, cloud, look, look_flat, model, sheet, sphere, torus};
use glam::DVec3;
use surfel::cut::{Coherent, Cut, Selector, Settings, SizeMetric};
use surfel::tree::Model;

/// A walk of `frames` with jumps, eyes inside, changes of threshold, culling, metric and projection.
fn walk(name: &str, model: &Model, frames: u32, seed: u64) {
    let mut random = Random(seed);
    let (mut coherent, mut selector) = (Coherent::default(), Selector::default());
    let (mut expected, mut cut) = (Cut::default(), Cut::default());
    let mut settings = Settings::default();
    let (mut eye, mut target) = (DVec3::new(0.0, 0.5, 3.0), DVec3::ZERO);
    let (mut flat, mut unchanged, mut changed) = (None, 0, 0u64);
    for frame in 0..frames {
        // Mostly small steps; sometimes none at all, sometimes anywhere.
        match random.below(40) {
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
                flat = if flat.is_some() {
                    None
                } else {
                    Some(random.range(0.2, 4.0))
                }
            }
            7 => settings.threshold_px = 0.0,
            8 => settings.threshold_px = 1e6,
            9 | 10 => {}
            11 if frame % 7 == 0 => coherent.reset(),
            _ => {
                eye += random.in_ball() * 0.05;
                target += random.in_ball() * 0.02;
            }
        }
        let view = match flat {
            Some(height) => look_flat(eye, target, height, (-2.0, 6.0), 1.5),
            None => look(eye, target, (0.01, 20.0)),
        };
        selector.select(model, &view, &settings, &mut expected);
        coherent.update(model, &view, &settings, &mut cut);
        assert_eq!(cut.nodes, expected.nodes, "{name}, frame {frame}");
        assert_eq!(cut.strips, expected.strips, "{name}, frame {frame}");
        assert_eq!(cut.leaves, expected.leaves, "{name}, frame {frame}");
        assert_eq!(cut.triangles, expected.triangles, "{name}, frame {frame}");
        let update = coherent.last_update();
        let drawn = cut.nodes.len() + cut.strips.len() + cut.leaves.len() + cut.triangles.len();
        assert!(update.stops >= drawn as u64 && update.changed <= update.stops);
        // No node is looked at twice.
        assert!(
            update.tests <= expected.stats.visited,
            "{name}: {update:?} {:?}",
            expected.stats
        );
        unchanged += u32::from(update.changed == 0);
        changed += update.changed;
    }
    assert!(
        model.tree.nodes.is_empty() || unchanged > 0 && changed > 0,
        "{name}: {unchanged} {changed}"
    );
}

#[test]
fn updates_equal_the_cut_from_the_root() {
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
        walk(name, &model(&soup, Strips::Yes), 1500, i as u64);
        walk(name, &model(&soup, Strips::No), 400, 100 + i as u64);
    }
}

#[test]
fn updates_of_tiny_models_and_clouds_equal_the_cut_from_the_root() {
    for n in [1, 2, 3, 4, 5, 7, 16, 17] {
        walk(
            &format!("{n} triangles"),
            &model(&chaos(n, 3), Strips::Yes),
            300,
            n as u64,
        );
    }
    let mut random = Random(9);
    let points: Vec<_> = (0..2000)
        .map(|_| random.direction())
        .map(|n| (n, n))
        .collect();
    walk("cloud", &cloud(&points, 0.03), 400, 7);
    let mut coherent = Coherent::default();
    let mut cut = Cut::default();
    let view = look(DVec3::Z * 3.0, DVec3::ZERO, (0.1, 9.0));
    coherent.update(&Model::default(), &view, &Settings::default(), &mut cut);
    assert_eq!(cut, Cut::default());
    // Another model in between is noticed by its numbers.
    for n in [40, 30, 1, 50] {
        let model = model(&chaos(n, 3), Strips::No);
        let mut expected = Cut::default();
        Selector::default().select(&model, &view, &Settings::default(), &mut expected);
        coherent.update(&model, &view, &Settings::default(), &mut cut);
        assert_eq!(
            (&cut.nodes, &cut.triangles),
            (&expected.nodes, &expected.triangles)
        );
    }
}

/// Spheres that are not nested, cones that do not hold the children's: size and visibility are no longer
/// monotone, and still the update must equal the cut from the root.
#[test]
fn updates_need_no_nested_bounds() {
    let mut random = Random(11);
    let mut model = model(&torus(60, 24), Strips::Yes);
    for node in &mut model.tree.nodes {
        node.radius *= random.range(0.3, 1.0) as f32;
        node.cone.axis[0] = node.cone.axis[0].wrapping_add((random.next() % 9000) as i16);
        node.strip.half_length /= 2;
    }
    walk("not nested", &model, 1500, 12);
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

#[test]
fn a_static_view_changes_nothing() {
    let model = model(&sphere(40, 20), Strips::No);
    let view = look(DVec3::new(0.0, 0.4, 2.0), DVec3::ZERO, (0.1, 9.0));
    let settings = Settings {
        threshold_px: 12.0,
        ..Settings::default()
    };
    let mut coherent = Coherent::default();
    let mut cut = Cut::default();
    coherent.update(&model, &view, &settings, &mut cut);
    let first = coherent.last_update();
    assert_eq!(first.changed, first.stops);
    for _ in 0..3 {
        coherent.update(&model, &view, &settings, &mut cut);
        assert_eq!(
            (coherent.last_update().changed, coherent.last_update().stops),
            (0, first.stops)
        );
    }
}
