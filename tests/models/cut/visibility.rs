//! V1, F1, F2, K2 of the design: what culling may and may not drop.

use super::testing::{
    Random, Soup, Strips, chaos, cloud, cube, look, look_flat, model, sheet, sphere, torus,
};
use super::{assert_ascending, coverage, leaves_below};
use glam::{DVec3, Vec3};
use surfel::cut::{Cut, CutSettings, FacingTest, NodeTester, SizeMetric, select};
use surfel::math::camera::View;
use surfel::math::frustum::Frustum;
use surfel::tree::{Model, NormalCone};

fn meshes() -> Vec<(&'static str, Soup)> {
    vec![
        ("sphere", sphere(40, 20)),
        ("torus", torus(60, 24)),
        ("cube", cube(9)),
        ("needles", torus(400, 6)),
        ("open sheet", sheet(25)),
        ("chaos", chaos(1500, 5)),
        ("two", chaos(2, 8)),
        ("five", chaos(5, 9)),
    ]
}

/// Views from far, near, inside and along the surface, perspective and not.
fn views(random: &mut Random, count: usize) -> Vec<View> {
    (0..count)
        .map(|i| {
            let distance = 10f64.powf(random.range(-1.5, 1.2));
            let (eye, target) = (random.direction() * distance, random.in_ball() * 0.7);
            match i % 4 {
                3 => look_flat(
                    eye,
                    target,
                    random.range(0.1, 4.0),
                    (-3.0, random.range(0.1, 20.0)),
                    random.range(0.2, 5.0),
                ),
                _ => look(
                    eye,
                    target,
                    (
                        10f64.powf(random.range(-3.0, -0.5)),
                        random.range(1.0, 30.0),
                    ),
                ),
            }
        })
        .collect()
}

/// The cosine of the angle between a triangle's normal and the direction to the viewer (0 without area), and
/// the rounding of it.
fn facing(model: &Model, view: &View, leaf: usize) -> (f64, f64) {
    let [a, b, c] = model.triangles[leaf].map(|i| model.vertices[i as usize].position.as_dvec3());
    let to_viewer = match view.is_perspective {
        true => view.eye.as_dvec3() - a,
        false => view.backward.as_dvec3(),
    };
    let n = (b - a).cross(c - a).normalize_or_zero();
    // The orthographic direction itself is rounded to single precision.
    let rounding = if view.is_perspective { 1e-13 } else { 1e-7 };
    (n.dot(to_viewer.normalize()), rounding)
}

fn faces_viewer(model: &Model, view: &View, leaf: usize) -> bool {
    let (cos, rounding) = facing(model, view, leaf);
    cos > rounding
}

fn faces_away(model: &Model, view: &View, leaf: usize) -> bool {
    let (cos, rounding) = facing(model, view, leaf);
    cos < -rounding
}

fn is_in_view(model: &Model, frustum: &Frustum, leaf: usize) -> bool {
    model.triangles[leaf]
        .iter()
        .any(|&i| frustum.contains(model.vertices[i as usize].position))
}

#[test]
fn culling_never_drops_what_is_visible_and_nothing_is_drawn_twice() {
    let mut random = Random(1);
    for (name, soup) in meshes() {
        for strips in [Strips::No, Strips::Yes] {
            let model = model(&soup, strips);
            let (mut dropped, mut seen) = (0, 0);
            for (i, view) in views(&mut random, 120).into_iter().enumerate() {
                let settings = CutSettings {
                    threshold_px: [0.0, 1.0, 3.0, 20.0][i % 4],
                    cull_back: i % 3 != 0,
                    cull_frustum: i % 5 != 0,
                    size: SizeMetric::Exact,
                    section: None,
                };
                let frustum = Frustum::new(&view, 0.0);
                let mut cut = Cut::default();
                select(&model, &view, &settings, &mut cut);
                assert_ascending(&cut);
                // A node inside the volume spares the tests below; they would have found nothing.
                let tester = NodeTester::new(&model, &view, &settings);
                let nodes = cut.nodes.iter().map(|&id| &model.tree.nodes[id as usize]);
                let leaves = cut
                    .leaves
                    .iter()
                    .chain(&cut.triangles)
                    .map(|&id| &model.tree.leaves[id as usize]);
                for (center, radius) in nodes
                    .map(|n| (n.center, n.radius))
                    .chain(leaves.map(|l| (l.center, l.radius)))
                {
                    assert!(
                        !settings.cull_frustum || !tester.is_outside(center, radius),
                        "{name}, view {i}"
                    );
                }
                for &leaf in cut
                    .leaves
                    .iter()
                    .chain(&cut.triangles)
                    .filter(|_| settings.cull_back)
                {
                    let is_away = faces_away(&model, &view, leaf as usize);
                    assert!(
                        !is_away,
                        "{name}, view {i}: leaf {leaf} faces away and was drawn"
                    );
                }
                for (leaf, &times) in coverage(&model, &cut).iter().enumerate() {
                    assert!(times <= 1, "{name}: leaf {leaf} is drawn {times} times");
                    let may_drop = settings.cull_back && !faces_viewer(&model, &view, leaf)
                        || settings.cull_frustum && !is_in_view(&model, &frustum, leaf);
                    assert!(
                        times == 1 || may_drop,
                        "{name}, view {i}: visible leaf {leaf} was dropped"
                    );
                    dropped += u32::from(times == 0);
                    seen += times;
                }
            }
            assert!(
                dropped > 0 && seen > 0,
                "{name}: {dropped} dropped, {seen} drawn"
            );
        }
    }
}

/// [B section 4.4] has the cone test without the radius; the oracle above must find it wrong (F10).
#[test]
fn a_cone_test_of_the_center_alone_is_found_wrong() {
    let mut random = Random(2);
    let (mut wrong, mut exact_wrong, mut exact_right) = (0, 0, 0);
    for (_, soup) in meshes() {
        let model = model(&soup, Strips::No);
        for _ in 0..150 {
            let view = look(random.in_ball() * 1.5, DVec3::ZERO, (0.01, 30.0));
            let settings = CutSettings {
                cull_back: true,
                ..CutSettings::default()
            };
            let tester = NodeTester::new(&model, &view, &settings);
            for (id, node) in model.tree.nodes.iter().enumerate() {
                let v = (node.center - view.eye).normalize();
                let center_only = node.cone.sin_half_angle != NormalCone::NEVER
                    && node.cone.axis().dot(v) >= node.cone.sin_half_angle();
                let is_away =
                    tester.facing(node.center, node.radius, node.cone) == FacingTest::Away;
                if center_only || is_away {
                    let mut below = leaves_below(&model.tree, id as u32);
                    let is_visible = below.any(|leaf| faces_viewer(&model, &view, leaf as usize));
                    wrong += u32::from(center_only && is_visible);
                    exact_wrong += u32::from(is_away && is_visible);
                    exact_right += u32::from(is_away && !is_visible);
                }
            }
        }
    }
    assert_eq!(exact_wrong, 0);
    assert!(wrong > 100 && exact_right > 1000, "{wrong} {exact_right}");
}

/// 5.5: the test finds (nearly) every ball whose normals all face away, and no other.
#[test]
fn the_cone_test_is_exact_for_a_ball() {
    let mut random = Random(3);
    let (mut away, mut found, mut front, mut front_found) = (0u32, 0u32, 0u32, 0u32);
    for i in 0..60_000 {
        let eye = random.direction() * 2.0;
        let view = match i % 3 {
            0 => look_flat(eye, DVec3::ZERO, 2.0, (-3.0, 20.0), 1.0),
            _ => look(eye, DVec3::ZERO, (0.01, 30.0)),
        };
        let tester = NodeTester::new(
            &model(&chaos(1, 1), Strips::No),
            &view,
            &CutSettings::default(),
        );
        let center = (random.in_ball() * 3.0).as_vec3();
        let radius = random.range(0.0, 1.0) as f32;
        let cone = NormalCone {
            axis: [random.next() as i16, random.next() as i16].map(|c| c.max(-32767)),
            sin_half_angle: (random.unit() * 65534.0) as u16,
        };
        let (c, r) = (center.as_dvec3(), f64::from(radius));
        let (v, r) = if view.is_perspective {
            (c - view.eye.as_dvec3(), r)
        } else {
            (-view.backward.as_dvec3(), 0.0)
        };
        let theta = |sign: f64| v.angle_between(cone.axis().as_dvec3().normalize() * sign);
        let alpha = f64::from(cone.sin_half_angle()).asin();
        let margin =
            |sign: f64| v.length() * (theta(sign) + alpha).min(std::f64::consts::PI).cos() - r;
        let facing = tester.facing(center, radius, cone);
        // Within the rounding either answer may come, but never a wrong "away" or "front".
        if margin(1.0) < -1e-6 {
            assert_ne!(facing, FacingTest::Away, "{i}: margin {}", margin(1.0));
        } else if margin(1.0) > 1e-4 + 2e-3 * v.length() {
            away += 1;
            found += u32::from(facing == FacingTest::Away);
        }
        if margin(-1.0) < -1e-6 {
            assert_ne!(facing, FacingTest::Front, "{i}: margin {}", margin(-1.0));
        } else if margin(-1.0) > 1e-4 + 2e-3 * v.length() {
            front += 1;
            front_found += u32::from(facing == FacingTest::Front);
        }
    }
    assert!(away > 2000 && found == away, "{found} of {away}");
    assert!(
        front > 2000 && front_found == front,
        "{front_found} of {front}"
    );
    let view = look(DVec3::Z * 9.0, DVec3::ZERO, (0.01, 30.0));
    let tester = NodeTester::new(
        &model(&chaos(1, 1), Strips::No),
        &view,
        &CutSettings::default(),
    );
    assert_eq!(
        tester.facing(Vec3::ZERO, 0.0, NormalCone::ALL),
        FacingTest::Mixed
    );
}

/// F2 and its converse: below "inside" nothing is outside, below "outside" nothing else is.
#[test]
fn the_volume_test_holds_for_nested_balls() {
    let mut random = Random(4);
    let (mut outside, mut total) = (0, 0);
    for view in views(&mut random, 60) {
        let tester = NodeTester::new(
            &model(&chaos(1, 1), Strips::No),
            &view,
            &CutSettings::default(),
        );
        let wide = Frustum::new(&view, 1.0);
        for _ in 0..500 {
            let (c, r) = (random.in_ball() * 3.0, random.range(0.0, 1.0));
            let (c, r) = (c.as_vec3(), r as f32);
            let small = r * random.range(0.0, 0.999) as f32;
            let inner = c + random.in_ball().as_vec3() * (r - small) * 0.9999;
            total += 1;
            if tester.is_outside(c, r) {
                outside += 1;
                assert!(tester.is_outside(inner, small));
                assert!(wide.is_outside(c, r * 0.9999 - 1e-5));
            }
        }
    }
    assert!(
        outside > total / 10 && outside < total * 9 / 10,
        "{outside} of {total}"
    );
}

/// 15.1: of a sphere seen from d the fraction (1 - 1/d) / 2 faces the eye; leaf tests are exact, so as many
/// triangles are left.
#[test]
fn a_sphere_keeps_the_fraction_that_faces_the_eye() {
    let soup = sphere(200, 100);
    let model = model(&soup, Strips::No);
    let area = |leaf: u32| {
        let [a, b, c] =
            model.triangles[leaf as usize].map(|i| model.vertices[i as usize].position.as_dvec3());
        (b - a).cross(c - a).length() / 2.0
    };
    let all: f64 = (0..soup.len() as u32).map(area).sum();
    for d in [2.0, 3.0, 5.0, 8.0] {
        let view = look(DVec3::new(0.6, 0.48, 0.64) * d, DVec3::ZERO, (0.1, 20.0));
        let settings = CutSettings {
            threshold_px: 0.0,
            cull_back: true,
            ..CutSettings::default()
        };
        let mut cut = Cut::default();
        select(&model, &view, &settings, &mut cut);
        assert!(cut.nodes.is_empty() && cut.leaves.is_empty());
        let kept = cut.triangles.iter().map(|&t| area(t)).sum::<f64>() / all;
        let expected = (1.0 - 1.0 / d) / 2.0;
        assert!(
            (kept - expected).abs() < 0.003,
            "d = {d}: {kept} instead of {expected}"
        );
    }
}

#[test]
fn without_culling_every_leaf_is_drawn_once() {
    let mut random = Random(6);
    for (name, soup) in meshes() {
        let model = model(&soup, Strips::Yes);
        for view in views(&mut random, 40) {
            let settings = CutSettings {
                threshold_px: random.range(0.0, 30.0) as f32,
                cull_frustum: false,
                ..CutSettings::default()
            };
            let mut cut = Cut::default();
            select(&model, &view, &settings, &mut cut);
            assert!(
                coverage(&model, &cut).iter().all(|&times| times == 1),
                "{name}"
            );
            assert_eq!((cut.stats.outside, cut.stats.facing_away), (0, 0));
        }
    }
}

/// F1 for splats: their squares reach beyond their balls, so the picture's edge must not cut them off.
#[test]
fn culling_keeps_every_splat_that_reaches_into_the_picture() {
    let mut random = Random(8);
    let (mut kept, mut dropped) = (0, 0);
    let model = model(&sphere(60, 30), Strips::No);
    for view in views(&mut random, 60) {
        for threshold_px in [1.0, 6.0, 40.0] {
            let all = CutSettings {
                threshold_px,
                cull_frustum: false,
                ..CutSettings::default()
            };
            let (mut unculled, mut culled) = (Cut::default(), Cut::default());
            select(&model, &view, &all, &mut unculled);
            select(
                &model,
                &view,
                &CutSettings {
                    cull_frustum: true,
                    ..all
                },
                &mut culled,
            );
            let drawn = coverage(&model, &culled);
            for &id in &unculled.nodes {
                let (x, y, z) = view.project(model.tree.nodes[id as usize].center);
                let half = threshold_px / 2.0;
                let reaches = x > -half
                    && y > -half
                    && x < view.width as f32 + half
                    && y < view.height as f32 + half
                    && z > view.near
                    && z < view.far;
                let is_drawn = leaves_below(&model.tree, id).all(|leaf| drawn[leaf as usize] == 1);
                assert!(
                    is_drawn || !reaches,
                    "the splat at {x}, {y}, {z} was dropped"
                );
                *(if is_drawn { &mut kept } else { &mut dropped }) += 1;
            }
        }
    }
    assert!(kept > 100 && dropped > 100, "{kept} {dropped}");
}

/// F9: a corner of the unit cube seen so that only its face +x shows; the cones hold face normals, so the face
/// stays although the corner's averaged normal points away.
#[test]
fn a_visible_face_of_a_cube_stays() {
    let model = model(&cube(8), Strips::No);
    let view = look(DVec3::new(3.0, -2.9, -2.9), DVec3::ZERO, (0.1, 20.0));
    let settings = CutSettings {
        threshold_px: 0.0,
        cull_back: true,
        ..CutSettings::default()
    };
    let mut cut = Cut::default();
    select(&model, &view, &settings, &mut cut);
    // Faces +x, -y, -z, 128 triangles each, and nothing else.
    assert_eq!(cut.triangles.len(), 3 * 128);
    assert!(
        cut.triangles
            .iter()
            .all(|&t| faces_viewer(&model, &view, t as usize))
    );
}

#[test]
fn degenerate_models_have_a_cut() {
    let view = look(DVec3::Z * 3.0, DVec3::ZERO, (0.1, 9.0));
    let mut cut = Cut::default();
    cut.nodes.push(7);
    select(&Model::default(), &view, &CutSettings::default(), &mut cut);
    assert_eq!(cut, Cut::default());
    // One triangle: no interior node. Seen from the front, from behind, and small.
    let corner = |x, y| DVec3::new(x, y, 0.0);
    let one = model(
        &vec![[corner(0.0, 0.0), corner(0.5, 0.0), corner(0.0, 0.5)]],
        Strips::No,
    );
    assert!(one.tree.nodes.is_empty());
    let culled = CutSettings {
        cull_back: true,
        ..CutSettings::default()
    };
    select(&one, &view, &culled, &mut cut);
    assert_eq!(
        (cut.triangles.as_slice(), cut.stats.visited),
        ([0].as_slice(), 1)
    );
    select(
        &one,
        &look(DVec3::Z * -3.0, DVec3::ZERO, (0.1, 9.0)),
        &culled,
        &mut cut,
    );
    assert_eq!((cut.triangles.len(), cut.stats.facing_away), (0, 1));
    select(
        &one,
        &view,
        &CutSettings {
            threshold_px: 1000.0,
            ..culled
        },
        &mut cut,
    );
    assert_eq!(
        (cut.leaves.as_slice(), cut.triangles.len()),
        ([0].as_slice(), 0)
    );
    // All corners equal: drawn (covering nothing) unless what faces away is dropped. At threshold 0 even a
    // ball of radius 0 is no splat.
    let points = model(&vec![[DVec3::ZERO; 3]; 9], Strips::Yes);
    select(
        &points,
        &view,
        &CutSettings {
            threshold_px: 0.0,
            ..CutSettings::default()
        },
        &mut cut,
    );
    assert_eq!(cut.triangles.len(), 9);
    select(&points, &view, &CutSettings::default(), &mut cut);
    assert_eq!(cut.nodes, [0]);
    // Not a number anywhere: kept, and no panic.
    let mut broken = model(&sphere(20, 10), Strips::Yes);
    for node in &mut broken.tree.nodes {
        node.center.x = f32::NAN;
    }
    select(
        &broken,
        &view,
        &CutSettings {
            threshold_px: f32::NAN,
            cull_back: true,
            ..CutSettings::default()
        },
        &mut cut,
    );
    assert!(!cut.triangles.is_empty());
}

#[test]
fn unit_of_the_model_does_not_matter() {
    let soup = torus(400, 12);
    let plain = model(&soup, Strips::Yes);
    let eye = DVec3::new(1.2, 0.7, 1.9);
    let settings = CutSettings {
        threshold_px: 40.0,
        cull_back: true,
        ..CutSettings::default()
    };
    let mut expected = Cut::default();
    select(
        &plain,
        &look(eye, DVec3::ZERO, (0.125, 16.0)),
        &settings,
        &mut expected,
    );
    assert!(
        !expected.nodes.is_empty() && !expected.strips.is_empty() && expected.stats.facing_away > 0
    );
    // Powers of two, so that every figure is the same but for its exponent.
    for size in [SizeMetric::Exact, SizeMetric::Area] {
        let settings = CutSettings { size, ..settings };
        select(
            &plain,
            &look(eye, DVec3::ZERO, (0.125, 16.0)),
            &settings,
            &mut expected,
        );
        for power in [-60, -20, 30, 60] {
            let scale = 2f64.powi(power);
            let mut scaled = plain.clone();
            let s = scale as f32;
            scaled.vertices.iter_mut().for_each(|v| v.position *= s);
            scaled
                .tree
                .nodes
                .iter_mut()
                .for_each(|n| (n.center, n.radius) = (n.center * s, n.radius * s));
            scaled
                .tree
                .leaves
                .iter_mut()
                .for_each(|l| (l.center, l.radius) = (l.center * s, l.radius * s));
            let mut cut = Cut::default();
            select(
                &scaled,
                &look(eye * scale, DVec3::ZERO, (0.125 * scale, 16.0 * scale)),
                &settings,
                &mut cut,
            );
            assert_eq!(cut, expected, "scale 2^{power}");
        }
    }
}

#[test]
fn points_of_a_cloud_are_always_splats_and_face_by_their_normals() {
    let mut random = Random(7);
    let points: Vec<_> = (0..3000)
        .map(|_| random.direction())
        .map(|n| (n, n))
        .collect();
    let model = cloud(&points, 0.02);
    let view = look(DVec3::new(0.3, 0.8, 3.0), DVec3::ZERO, (0.1, 9.0));
    for cull_back in [false, true] {
        let settings = CutSettings {
            threshold_px: 0.0,
            cull_back,
            ..CutSettings::default()
        };
        let mut cut = Cut::default();
        select(&model, &view, &settings, &mut cut);
        assert!(cut.triangles.is_empty() && cut.nodes.is_empty());
        let drawn = coverage(&model, &cut);
        let mut dropped = 0;
        for (vertex, &times) in model.vertices.iter().zip(&drawn) {
            let n = surfel::math::octahedral::decode(vertex.normal);
            let is_facing = n.dot(view.eye - vertex.position) > 0.0;
            assert!(times == 1 || cull_back && !is_facing);
            dropped += u32::from(times == 0);
            // A node's cone holds the normals of all its points; only by itself is one without kept.
            assert!(
                times == 0
                    || is_facing
                    || !cull_back
                    || vertex.color[3] == 0
                    || n.dot((view.eye - vertex.position).normalize()) > -1e-3
            );
        }
        assert_eq!(cull_back, dropped > 1000, "{dropped}");
    }
}
