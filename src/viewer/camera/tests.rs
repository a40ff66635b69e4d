#![allow(clippy::unwrap_used, reason = "tests may panic")]

use super::*;
use proptest::prelude::*;

const CENTER: DVec3 = DVec3::new(10.0, -3.0, 7.0);
const SIZE: (u32, u32) = (640, 480);
const HOME: (f64, f64) = (0.5, 0.3);

fn orbit() -> OrbitCamera {
    OrbitCamera::new(CENTER, 2.0, SIZE, (HOME.0, HOME.1, 1.0))
}

/// Pixel position of a world-space point.
fn pixel(orbit: &OrbitCamera, point: DVec3) -> DVec2 {
    let camera = orbit.camera();
    let clip = camera.proj * camera.view * point.extend(1.0);
    let ndc = clip.truncate() / clip.w;
    DVec2::new(
        (ndc.x + 1.0) / 2.0 * f64::from(SIZE.0),
        (1.0 - ndc.y) / 2.0 * f64::from(SIZE.1),
    )
}

/// World-space point seen at a pixel position.
fn point_at(orbit: &OrbitCamera, at: DVec2, distance: f64) -> DVec3 {
    orbit.eye() + orbit.world(orbit.seen_at(at, distance))
}

#[test]
fn the_first_camera_is_that_of_the_standard_orbit_to_the_bit() {
    for (size, radius) in [((500, 500), 2.0), ((640, 480), 0.3), ((300, 801), 1234.5)] {
        for (azimuth, elevation, fill) in
            [(HOME.0, HOME.1, 1.0), (-1.0, -0.7, 0.5), (4.0, 0.0, 3.0)]
        {
            let ours = OrbitCamera::new(CENTER, radius, size, (azimuth, elevation, fill)).camera();
            let standard = Camera::orbit(size, CENTER, radius, azimuth, elevation, fill);
            assert_eq!(ours, standard);
        }
    }
}

#[test]
fn about_another_axis_it_is_the_orbit_about_that() {
    for up in [UpAxis::X, UpAxis::Z] {
        let angles = (HOME.0, HOME.1, 0.7);
        let ours = OrbitCamera::new(CENTER, 2.0, SIZE, angles).about(up);
        let standard = Camera::orbit_about(up, SIZE, CENTER, 2.0, angles);
        assert!(
            ours.camera().view.abs_diff_eq(standard.view, 1e-9),
            "{up:?}"
        );
        // Another one takes its view over.
        let mut other = OrbitCamera::new(CENTER, 2.0, SIZE, (2.0, -0.5, 1.0)).about(up);
        other.look_as(&standard);
        assert!(
            other.camera().view.abs_diff_eq(standard.view, 1e-9),
            "{up:?}"
        );
        other.set_up(UpAxis::Y);
        let level = other.camera().view.row(0).y;
        assert!(level.abs() < 1e-9, "{level}");
    }
}

#[test]
fn an_axis_that_becomes_known_late_leaves_a_view_that_was_moved() {
    let up = UpAxis::along(DVec3::new(0.2, -0.3, -0.9)).unwrap();
    let mut first = orbit();
    first.take_up(up);
    assert_eq!(first, orbit().about(up));
    let mut moved = orbit();
    moved.turn(DVec2::new(30.0, -20.0));
    let before = moved.camera().view.inverse();
    moved.take_up(up);
    let after = moved.camera().view.inverse();
    for axis in [2, 3] {
        let [a, b] = [before, after].map(|view| view.col(axis));
        assert!(a.abs_diff_eq(b, 1e-9), "{a} {b}");
    }
    // The side of the picture is level to what is up now.
    let level = after.x_axis.truncate().dot(up.direction());
    assert!(level.abs() < 1e-9, "{level}");
}

#[test]
fn turning_stops_at_the_poles_and_never_flips() {
    let mut o = orbit();
    for _ in 0..50 {
        o.turn(DVec2::new(3.0, 40.0));
        let camera = o.camera();
        assert!(camera.view.is_finite());
        // Row 1 of the view is "up" in world space: it never points down.
        assert!(camera.view.row(1).y >= -1e-9, "upside down");
        // And "right" stays level.
        assert!(camera.view.row(0).y.abs() < 1e-9);
    }
    assert_eq!(o.elevation, FRAC_PI_2);
    let top = o.camera().view;
    assert!((top.row(2).y - 1.0).abs() < 1e-9, "looks straight down");
    for _ in 0..100 {
        o.turn(DVec2::new(0.0, -40.0));
    }
    assert_eq!(o.elevation, -FRAC_PI_2);
    // Just before the pole the picture is the same as at the pole.
    let mut before = o.clone();
    before.elevation += 1e-5;
    let difference = (before.camera().view - o.camera().view).to_cols_array();
    assert!(
        difference.into_iter().all(|d| d.abs() < 1e-3),
        "{difference:?}"
    );
}

#[test]
fn framing_and_reset_bring_the_model_back() {
    let first = orbit();
    let mut o = orbit();
    o.turn(DVec2::new(100.0, -30.0));
    o.pan(DVec2::new(-50.0, 20.0), 3.0);
    o.zoom(0.1, DVec2::new(30.0, 400.0), 4.0);
    assert!(pixel(&o, CENTER).distance(DVec2::new(320.0, 240.0)) > 10.0);
    o.frame_model();
    assert!(pixel(&o, CENTER).distance(DVec2::new(320.0, 240.0)) < 1e-9);
    assert_eq!(o.eye.z, first.eye.z);
    assert_ne!(o.azimuth, first.azimuth);
    o.reset();
    assert_eq!(o, first);
}

#[test]
fn a_framed_model_is_framed_again_when_the_window_changes_and_only_then() {
    let mut o = orbit();
    o.turn(DVec2::new(30.0, 5.0));
    o.resize((200, 800));
    assert_eq!(o.eye.z, o.distance_for(1.0));
    o.zoom(0.5, DVec2::new(100.0, 400.0), o.pivot_distance());
    let zoomed = o.eye;
    o.resize((900, 300));
    assert_eq!(o.eye, zoomed);
    o.resize((0, 0));
    assert!(
        o.camera().view(DVec3::ZERO).is_ok(),
        "an empty window is no failure"
    );
}

#[test]
fn a_camera_that_was_copied_comes_back() {
    let mut o = orbit();
    o.turn(DVec2::new(200.0, -70.0));
    o.pan(DVec2::new(-50.0, 20.0), 3.0);
    o.zoom(0.3, DVec2::new(30.0, 400.0), 4.0);
    for elevation in [None, Some(FRAC_PI_2), Some(-FRAC_PI_2)] {
        if let Some(elevation) = elevation {
            o.look_from(2.0, elevation);
        }
        let mut copy = orbit();
        copy.look_as(&o.camera());
        let difference = (copy.camera().view - o.camera().view).to_cols_array();
        assert!(
            difference.into_iter().all(|d| d.abs() < 1e-6),
            "{elevation:?}: {difference:?}"
        );
    }
    // One that looks away from the model still gives a usable turntable.
    let away = Camera::look_at(
        SIZE,
        CENTER + 5.0 * DVec3::X,
        CENTER + 9.0 * DVec3::X,
        DVec3::Y,
        1.0,
        [0.1, 9.0],
    );
    o.look_as(&away);
    assert!(o.eye().distance(CENTER + 5.0 * DVec3::X) < 1e-9 && o.pivot_distance() > 0.0);
}

#[test]
fn looking_around_keeps_the_eye_and_flying_the_direction() {
    let mut o = orbit();
    o.pan(DVec2::new(30.0, -12.0), 3.0);
    let (eye, seen) = (o.eye(), o.camera().view);
    o.look_around(DVec2::ZERO);
    let difference = (o.camera().view - seen).to_cols_array();
    assert!(difference.into_iter().all(|d| d.abs() < 1e-9));
    o.look_around(DVec2::new(100.0, 40.0));
    assert!(o.eye().distance(eye) < 1e-9);
    assert_ne!(o.azimuth, HOME.0);
    let direction = o.basis().2;
    o.fly(DVec3::new(0.0, 0.0, -0.25));
    assert!(o.basis().2.distance(direction) < 1e-12);
    assert!(o.eye().distance(eye - 0.5 * direction) < 1e-9, "forward");
    o.turn_table(7.0);
    assert!(o.azimuth >= 0.0 && o.azimuth < 2.0 * PI);
}

#[test]
fn degenerate_models_get_a_usable_camera() {
    for radius in [0.0, -1.0, f64::NAN] {
        let mut o = OrbitCamera::new(CENTER, radius, (1, 1), (0.0, 9.0, 1.0));
        o.turn(DVec2::splat(1.0));
        o.zoom(f64::NAN, DVec2::ZERO, 0.0);
        assert!(o.camera().view(DVec3::ZERO).is_ok());
    }
}

fn step() -> impl Strategy<Value = (u8, f64, f64, f64, f64)> {
    (
        0u8..5,
        -300.0..300.0f64,
        -300.0..300.0f64,
        0.05..20.0f64,
        1e-3..10.0f64,
    )
}

proptest! {
    #[test]
    fn turning_keeps_the_distance_and_the_place_of_the_pivot(x in -900.0..900.0f64, y in -900.0..900.0f64) {
        let mut o = orbit();
        o.pan(DVec2::new(31.0, -12.0), 4.0);
        o.set_pivot(DVec2::new(200.0, 100.0), 4.0);
        let (distance, place) = (o.eye().distance(o.pivot()), pixel(&o, o.pivot()));
        o.turn(DVec2::new(x, y));
        prop_assert!((o.eye().distance(o.pivot()) - distance).abs() < 1e-9);
        prop_assert!(pixel(&o, o.pivot()).distance(place) < 1e-6);
    }

    #[test]
    fn zooming_keeps_what_is_under_the_cursor(
        x in 0.0..640.0f64, y in 0.0..480.0f64, factor in 0.02..5.0f64, distance in 0.5..9.0f64
    ) {
        let mut o = orbit();
        let at = DVec2::new(x, y);
        let point = point_at(&o, at, distance);
        let before = o.eye().distance(point);
        o.zoom(factor, at, distance);
        prop_assert!(pixel(&o, point).distance(at) < 1e-5);
        prop_assert!((o.eye().distance(point) / before - factor).abs() < 1e-6);
        prop_assert!(o.pivot_distance() > 0.0);
    }

    #[test]
    fn panning_moves_what_was_grabbed_with_the_cursor(
        x in -300.0..300.0f64, y in -300.0..300.0f64, distance in 0.5..9.0f64
    ) {
        let mut o = orbit();
        let from = DVec2::new(300.0, 200.0);
        let grabbed = point_at(&o, from, distance);
        o.pan(DVec2::new(x, y), distance);
        prop_assert!(pixel(&o, grabbed).distance(from + DVec2::new(x, y)) < 1e-6);
    }

    #[test]
    fn a_new_pivot_changes_nothing_that_is_seen(
        x in 0.0..640.0f64, y in 0.0..480.0f64, distance in 0.5..9.0f64
    ) {
        let mut o = orbit();
        let before = o.camera().view;
        let point = point_at(&o, DVec2::new(x, y), distance);
        o.set_pivot(DVec2::new(x, y), distance);
        prop_assert!(o.pivot().distance(point) < 1e-9);
        let difference = (o.camera().view - before).to_cols_array();
        prop_assert!(difference.into_iter().all(|d| d.abs() < 1e-9));
    }

    #[test]
    fn after_any_walk_the_model_is_between_near_and_far(steps in prop::collection::vec(step(), 1..40)) {
        let mut o = orbit();
        for (kind, x, y, factor, distance) in steps {
            match kind {
                0 => o.turn(DVec2::new(x, y)),
                1 => o.pan(DVec2::new(x, y), distance),
                2 => o.zoom(factor, DVec2::new(320.0 + x, 240.0 + y), distance),
                3 => o.set_pivot(DVec2::new(320.0 + x, 240.0 + y), distance),
                _ => o.look_from(x, y),
            }
            let (near, far) = o.near_far();
            prop_assert!(near > 0.0 && far > near && far.is_finite());
            let camera = o.camera();
            prop_assert!(camera.view(CENTER).is_ok());
            let center_distance = -(camera.view * CENTER.extend(1.0)).z;
            prop_assert!(far >= center_distance + 2.0 - 1e-6);
            prop_assert!(near <= (center_distance - 2.0).max(0.02) + 1e-6);
            prop_assert!(o.eye().distance(CENTER) <= FARTHEST * 2.0 * 1.01);
            prop_assert!(o.pivot_distance() > 0.0);
        }
    }
}
