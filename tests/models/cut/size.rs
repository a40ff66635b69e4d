//! The projected size against closed forms and against sampled outlines (methods 4 and 15.1).

use super::testing::{Random, Strips, chaos, look, look_flat, model, sphere};
use glam::{DVec3, Vec3};
use surfel::cut::{Cut, CutSettings, NodeTester, SizeMetric, select};
use surfel::math::camera::View;

const METRICS: [SizeMetric; 5] = [
    SizeMetric::Exact,
    SizeMetric::Center,
    SizeMetric::Nearest,
    SizeMetric::Angle,
    SizeMetric::Area,
];

fn tester(view: &View, threshold_px: f32, size: SizeMetric) -> NodeTester {
    let settings = CutSettings {
        threshold_px,
        size,
        ..CutSettings::default()
    };
    NodeTester::new(&model(&chaos(1, 1), Strips::No), view, &settings)
}

/// C = (2, 0, 3), R = 1, f = 1: A = 0.433013, B = 0.353553, ellipse centered at x = 0.75.
#[test]
fn the_worked_example_of_the_ellipse_comes_out() {
    let view = look(DVec3::ZERO, -DVec3::Z, (0.01, 30.0));
    let f = f64::from(view.focal_px());
    let size = |metric| tester(&view, 1.0, metric).size_px(Vec3::new(2.0, 0.0, -3.0), 1.0) / f;
    assert!((size(SizeMetric::Exact) - 2.0 * 0.433_012_7).abs() < 1e-6);
    let area = 2.0 * (0.433_012_7f64 * 0.353_553_4).sqrt();
    assert!((size(SizeMetric::Area) - area).abs() < 1e-6);
    assert!((size(SizeMetric::Center) - 2.0 / 3.0).abs() < 1e-6);
    assert!((size(SizeMetric::Nearest) - 1.0).abs() < 1e-6);
    assert!((size(SizeMetric::Angle) - 2.0 / 12f64.sqrt()).abs() < 1e-6);
    // The outline by brute force: points of the sphere, projected.
    let (mut low, mut high, mut side) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64);
    let mut random = Random(1);
    for _ in 0..400_000 {
        let p = DVec3::new(2.0, 0.0, -3.0) + random.direction();
        let (x, y) = (p.x / -p.z, p.y / -p.z);
        (low, high, side) = (low.min(x), high.max(x), side.max(y.abs()));
    }
    assert!(
        ((low + high) / 2.0 - 0.75).abs() < 1e-3 && ((high - low) / 2.0 - 0.433_012_7).abs() < 1e-3
    );
    assert!((side - 0.353_553_4).abs() < 1e-3);
}

#[test]
fn a_centered_sphere_has_the_published_outline() {
    for (d, radius_px) in [(2.0, 250.0), (3.0, 153.093), (5.0, 88.388), (8.0, 54.554)] {
        let camera = surfel::math::camera::Camera::look_at(
            (500, 500),
            DVec3::Z * d,
            DVec3::ZERO,
            DVec3::Y,
            60f64.to_radians(),
            [0.01, 30.0],
        );
        let view = camera.view(DVec3::ZERO).unwrap();
        for metric in [SizeMetric::Exact, SizeMetric::Angle, SizeMetric::Area] {
            let size = tester(&view, 1.0, metric).size_px(Vec3::ZERO, 1.0);
            assert!(
                (size / 2.0 - radius_px).abs() < 1e-3,
                "{metric:?} at {d}: {size}"
            );
        }
    }
}

/// Property M, in the test itself and in the size: a ball inside another is never larger. The factor covers
/// single precision; without the near rule this fails at once.
#[test]
fn size_is_monotone_over_nested_balls() {
    let mut random = Random(2);
    for metric in METRICS {
        let (mut finite, mut infinite) = (0, 0);
        for i in 0..100_000 {
            let view = if i % 8 == 0 {
                look_flat(DVec3::Z * 2.0, DVec3::ZERO, 2.0, (0.1, 9.0), 3.0)
            } else {
                look(DVec3::new(0.3, 0.1, 2.0), DVec3::ZERO, (0.05, 30.0))
            };
            // One view would do; a tester is what costs.
            let threshold = 10f64.powf(random.range(-1.0, 3.0)) as f32;
            let tester = tester(&view, threshold, metric);
            let (c, r) = (random.in_ball() * 3.0, 10f64.powf(random.range(-3.0, 0.5)));
            let inner_r = r * random.unit();
            let inner = c + random.in_ball() * (r - inner_r) * 0.999_999;
            let (c, inner) = (c.as_vec3(), inner.as_vec3());
            let (r, inner_r) = ((r * 1.000_001) as f32, inner_r as f32);
            let (outer_px, inner_px) = (tester.size_px(c, r), tester.size_px(inner, inner_r));
            assert!(
                inner_px <= outer_px * 1.000_1,
                "{metric:?}: {inner_px} in {outer_px}"
            );
            *(if outer_px.is_finite() {
                &mut finite
            } else {
                &mut infinite
            }) += 1;
            // The test without root and division says what the size says.
            let close = (outer_px / f64::from(threshold) - 1.0).abs() < 1e-4;
            assert!(
                close || tester.is_small(c, r) == (outer_px <= f64::from(threshold)),
                "{metric:?} {outer_px} {threshold}"
            );
            assert!(close || !tester.is_small(c, r) || tester.is_small(inner, inner_r));
        }
        assert!(finite > 10_000 && infinite > 10_000, "{finite} {infinite}");
    }
}

/// What stops is no larger than it says: every point of the ball projects into the disc of the threshold's
/// diameter around the middle of the ball's outline.
#[test]
fn a_small_ball_projects_into_the_disc_of_the_threshold() {
    let mut random = Random(3);
    let mut stopped = 0;
    for _ in 0..4000 {
        let view = look(
            random.direction() * 2.0,
            random.in_ball() * 0.2,
            (0.01, 30.0),
        );
        let threshold = 10f64.powf(random.range(0.0, 2.5)) as f32;
        let exact = tester(&view, threshold, SizeMetric::Exact);
        let (c, r) = (random.in_ball() * 2.0, 10f64.powf(random.range(-2.5, 0.0)));
        if !exact.is_small(c.as_vec3(), r as f32) {
            continue;
        }
        stopped += 1;
        // The ellipse's middle: f ρ z / (z² - R²) from the principal point, along (x, y).
        let v = view
            .view_from_model
            .as_dmat4()
            .transform_point3(c.as_vec3().as_dvec3());
        let f = f64::from(view.focal_px());
        let depths = v.z * v.z - r * r;
        let middle = v.truncate() * (f * -v.z / depths);
        for _ in 0..60 {
            let p = v + random.direction() * f64::from(r as f32);
            let at = p.truncate() * (f / -p.z);
            let distance = at.distance(middle);
            assert!(
                distance <= f64::from(threshold) / 2.0 * 1.000_1 + 1e-3,
                "{distance} of {threshold}"
            );
        }
    }
    assert!(stopped > 300, "{stopped}");
}

/// A view matrix that scales shows a smaller or larger world, and the sizes must follow.
#[test]
fn sizes_respect_the_scale_of_the_view() {
    for scale in [0.2, 1.0, 7.0] {
        let flat = look_flat(DVec3::Z * 2.0, DVec3::ZERO, 4.0, (0.1, 9.0), scale);
        let size = tester(&flat, 1.0, SizeMetric::Exact).size_px(Vec3::new(0.3, 0.2, 0.1), 0.25);
        // 400 pixels show 4 units.
        assert!((size - 50.0).abs() < 1e-2, "{size} at {scale}");
        let mut camera =
            surfel::math::camera::Camera::orbit((500, 400), DVec3::ZERO, 1.0, 0.1, 0.2, 0.5);
        let plain = camera.view(DVec3::ZERO).unwrap();
        let expected = tester(&plain, 1.0, SizeMetric::Exact).size_px(Vec3::X * 0.3, 0.25);
        camera.view = glam::DMat4::from_scale(DVec3::splat(scale)) * camera.view;
        // Near and far are view-space lengths; here they only must stay clear of the ball.
        let scaled = camera.view(DVec3::ZERO).unwrap();
        let got = tester(
            &View {
                near: plain.near * scale as f32,
                ..scaled
            },
            1.0,
            SizeMetric::Exact,
        )
        .size_px(Vec3::X * 0.3, 0.25);
        assert!(
            (got / expected - 1.0).abs() < 1e-4,
            "{got} {expected} at {scale}"
        );
    }
}

/// F18: an eye that moves through the surface never yields a size that is not positive, and what reaches the
/// near plane is never a splat.
#[test]
fn an_eye_inside_gets_triangles_nearby() {
    let model = model(&sphere(60, 30), Strips::Yes);
    for k in 0..200 {
        let eye = DVec3::new(0.1, 0.2, -1.5 + 3.0 * f64::from(k) / 199.0);
        let view = look(eye, eye + DVec3::new(0.2, 0.1, -1.0), (0.02, 9.0));
        for metric in METRICS {
            let settings = CutSettings {
                threshold_px: 40.0,
                size: metric,
                ..CutSettings::default()
            };
            let tester = NodeTester::new(&model, &view, &settings);
            for node in &model.tree.nodes {
                assert!(tester.size_px(node.center, node.radius) > 0.0);
            }
            let mut cut = Cut::default();
            select(&model, &view, &settings, &mut cut);
            for &id in &cut.nodes {
                let node = model.tree.nodes[id as usize];
                assert!(view.distance(node.center) - node.radius > view.near * 0.999);
            }
            for &id in &cut.leaves {
                let leaf = model.tree.leaves[id as usize];
                assert!(view.distance(leaf.center) - leaf.radius > view.near * 0.999);
            }
        }
    }
}
