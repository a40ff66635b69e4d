#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
use super::*;
use crate::math::camera::Camera;

fn camera(eye: DVec3) -> View {
    let fov = 60f64.to_radians();
    Camera::look_at(
        (200, 160),
        eye,
        DVec3::new(0.1, 0.2, 0.0),
        DVec3::Y,
        fov,
        [0.1, 50.0],
    )
    .view(DVec3::ZERO)
    .unwrap()
}

fn frame(normal: DVec3) -> PlaneFrame {
    PlaneFrame::new(DVec3::new(0.3, -0.2, 0.1), normal).unwrap()
}

/// Area, once the disc's round bound cuts its corners.
fn drawn_area(polygon: &OrientedPolygon, radius: f64) -> f64 {
    let n = 1000;
    let at = |i: i32| (f64::from(i) + 0.5) / f64::from(n) * 2.0 * radius - radius;
    let inside = (0..n * n)
        .filter(|k| polygon.contains([at(k % n) as f32, at(k / n) as f32]))
        .count();
    inside as f64 * (2.0 * radius / f64::from(n)).powi(2)
}

#[test]
fn discs_have_the_area_of_circles_and_of_their_segments() {
    let radius = 1.5;
    let frame = frame(DVec3::new(1.0, 2.0, 3.0));
    let whole = OrientedPolygon::disc(&frame, radius, &[], [255; 4]).unwrap();
    let circle = std::f64::consts::PI * radius * radius;
    assert!((drawn_area(&whole, radius) - circle).abs() < 2e-3 * circle);
    let cut = |angle: f64, limit: f64| HalfPlane {
        direction: DVec2::from_angle(angle),
        limit,
    };
    // A half, and the quarter between two cuts.
    let half = OrientedPolygon::disc(&frame, radius, &[cut(0.7, 0.0)], [255; 4]).unwrap();
    assert!((drawn_area(&half, radius) - circle / 2.0).abs() < 3e-3 * circle);
    let cuts = [cut(0.7, 0.0), cut(0.7 + std::f64::consts::FRAC_PI_2, 0.0)];
    let quarter = OrientedPolygon::disc(&frame, radius, &cuts, [255; 4]).unwrap();
    assert!((drawn_area(&quarter, radius) - circle / 4.0).abs() < 3e-3 * circle);
    // Two shallow cuts leave more corners than an octagon has room for.
    let cuts = [cut(0.4, 1.4), cut(3.0, 1.4)];
    let shallow = OrientedPolygon::disc(&frame, radius, &cuts, [255; 4]).unwrap();
    let segment = radius * radius * (1.4f64 / 1.5).acos() - 1.4 * (1.5f64 * 1.5 - 1.96).sqrt();
    let expected = circle - 2.0 * segment;
    assert!((drawn_area(&shallow, radius) - expected).abs() < 3e-3 * circle);
    assert_eq!(
        OrientedPolygon::disc(&frame, radius, &[cut(0.0, -2.0)], [255; 4]),
        None
    );
    assert_eq!(OrientedPolygon::disc(&frame, f64::NAN, &[], [255; 4]), None);
}

#[test]
fn a_pixel_sees_the_plane_where_its_ray_meets_it() {
    let frame = frame(DVec3::new(0.5, 0.4, 1.0));
    let polygon = OrientedPolygon::disc(&frame, 0.8, &[], [255; 4]).unwrap();
    let view = camera(DVec3::new(0.5, 0.4, 3.0));
    let seen = ScreenPolygon::of(&polygon, &view).unwrap();
    assert_eq!(seen.margin_px(), 0.0);
    let mut inside = 0;
    for uv in [
        [0.0, 0.0],
        [0.7, 0.1],
        [-0.3, 0.6],
        [0.1, -0.79],
        [0.7, 0.7],
    ] {
        let (x, y, distance) = view.project(polygon.point(uv));
        let sample = seen.sample(DVec2::new(x.into(), y.into()));
        if let Some(sample) = sample {
            assert!((sample.distance - f64::from(distance)).abs() < 1e-5);
            assert!((sample.uv[0] - uv[0]).abs() < 1e-4 && (sample.uv[1] - uv[1]).abs() < 1e-4);
            inside += 1;
        }
    }
    // The last lies outside of the circle.
    assert_eq!(inside, 4);
    assert!(polygon.faces(&view));
    let behind = camera(DVec3::new(0.0, 0.0, -3.0));
    assert!(!polygon.faces(&behind));
    let steep = OrientedPolygon {
        spread: 1.0,
        ..polygon
    };
    assert!(steep.faces(&behind));
}

#[test]
fn projected_area_of_a_disc_is_the_closed_form() {
    // methods 7.2: f² pi |det T| / (c_z² - u_z² - v_z²)^(3/2).
    let radius = 0.6;
    let frame = frame(DVec3::new(-0.5, 0.4, 1.0));
    let polygon = OrientedPolygon::disc(&frame, radius, &[], [255; 4]).unwrap();
    let view = camera(DVec3::new(0.5, 0.4, 2.5));
    let seen = ScreenPolygon::of(&polygon, &view).unwrap();
    let [low, high] = seen.bounds();
    let n = 600;
    let size = (high - low) / f64::from(n);
    let hits = (0..n * n)
        .filter(|k| {
            let cell = DVec2::new(f64::from(k % n) + 0.5, f64::from(k / n) + 0.5);
            seen.sample(low + cell * size).is_some()
        })
        .count();
    let to_view = view.view_from_model.as_dmat4();
    let c = to_view.transform_point3(frame.center);
    let [u, v] = [frame.axis, frame.second_axis()].map(|a| to_view.transform_vector3(a) * radius);
    let det = u.cross(v).dot(c).abs();
    let expected = f64::from(view.focal_px()).powi(2) * std::f64::consts::PI * det
        / (c.z * c.z - u.z * u.z - v.z * v.z).powf(1.5);
    let measured = hits as f64 * size.x * size.y;
    assert!(
        (measured / expected - 1.0).abs() < 2e-3,
        "{measured} {expected}"
    );
}

#[test]
fn a_widened_polygon_contains_every_point_within_its_thickness() {
    let square =
        [[-0.5, -0.4], [0.6, -0.4], [0.6, 0.5], [-0.5, 0.5]].map(|c: [f64; 2]| DVec2::from(c));
    let thickness = 0.05f32;
    let mut seed = 1_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 33) as f64 / (1u64 << 31) as f64
    };
    let (mut checked, mut missed_without) = (0, 0);
    for k in 0..60 {
        // Seen from above, and more and more along the plane.
        let tilt = f64::from(k) / 59.0 * std::f64::consts::FRAC_PI_2;
        let frame = frame(DVec3::new(tilt.sin(), 0.0, tilt.cos()));
        let flat = OrientedPolygon::flat(&frame, &square, [255; 4]).unwrap();
        let polygon = OrientedPolygon { thickness, ..flat };
        let view = camera(DVec3::new(0.3, -0.1, 2.0));
        let seen = ScreenPolygon::of(&polygon, &view).unwrap();
        for _ in 0..200 {
            let uv = DVec2::new(random() * 1.1 - 0.5, random() * 0.9 - 0.4);
            let off = (random() * 2.0 - 1.0) * f64::from(thickness);
            let point = frame.point(uv) + off * frame.normal;
            let (x, y, distance) = view.project(point.as_vec3());
            let at = DVec2::new(x.into(), y.into());
            let sample = seen.sample(at);
            assert!(sample.is_some(), "tilt {tilt}: {at} is missed");
            checked += 1;
            let low = seen.distances[0] - seen.thickness - 1e-4;
            let high = seen.distances[1] + seen.thickness + 1e-4;
            assert!((low..=high).contains(&f64::from(distance)));
            // What is widened is pushed back, by the thickness and as far as it is widened.
            let back = seen.thickness + seen.margin_px * seen.distances[1] / seen.focal_px;
            assert!((low..=high + back).contains(&sample.unwrap().distance));
            missed_without += usize::from(seen.outside_px(at) > 0.0);
        }
    }
    assert!(
        checked == 12_000 && missed_without > 500,
        "{missed_without}"
    );
}

#[test]
fn what_lies_before_the_near_plane_is_cut_off() {
    let frame = PlaneFrame::new(DVec3::ZERO, DVec3::Y).unwrap();
    let polygon = OrientedPolygon::disc(&frame, 10.0, &[], [255; 4]).unwrap();
    let view = Camera::look_at(
        (100, 100),
        DVec3::new(0.0, 1.0, 0.0),
        DVec3::new(0.0, 0.0, -4.0),
        DVec3::Y,
        1.0,
        [0.5, 50.0],
    )
    .view(DVec3::ZERO)
    .unwrap();
    let seen = ScreenPolygon::of(&polygon, &view).unwrap();
    let below = seen.sample(DVec2::new(50.0, 99.0)).unwrap();
    assert!(below.distance >= 0.5 && below.distance < 4.0);
    assert_eq!(seen.sample(DVec2::new(50.0, 1.0)), None);
    // Wholly behind the eye.
    let behind = PlaneFrame::new(DVec3::new(0.0, 1.0, 40.0), DVec3::Z).unwrap();
    let behind = OrientedPolygon::disc(&behind, 1.0, &[], [255; 4]).unwrap();
    assert!(ScreenPolygon::of(&behind, &view).is_none());
}

#[test]
fn normals_bend_by_the_shape_operator() {
    // A paraboloid z = (a u² + b v²) / 2 has the normal (-a u, -b v, 1) to first order.
    let frame = PlaneFrame::new(DVec3::ZERO, DVec3::Z).unwrap();
    let flat = OrientedPolygon::disc(&frame, 1.0, &[], [255; 4]).unwrap();
    let bent = OrientedPolygon {
        shape_operator: [-0.3, 0.0, 0.7],
        ..flat
    };
    let n = bent.normal_at([0.2, -0.1]);
    let expected = flat.normal - 0.06 * flat.axis - 0.07 * flat.second_axis();
    assert!((n - expected).length() < 1e-6);
    assert_eq!(flat.normal_at([0.2, -0.1]), flat.normal);
}

#[test]
fn degenerate_footprints_are_refused() {
    let frame = PlaneFrame::new(DVec3::ZERO, DVec3::Z).unwrap();
    let line = [DVec2::ZERO, DVec2::X, 2.0 * DVec2::X];
    assert_eq!(OrientedPolygon::flat(&frame, &line, [0; 4]), None);
    assert_eq!(OrientedPolygon::flat(&frame, &line[..2], [0; 4]), None);
    assert_eq!(OrientedPolygon::flat(&frame, &[], [0; 4]), None);
    assert!(PlaneFrame::new(DVec3::ZERO, DVec3::ZERO).is_none());
    assert!(PlaneFrame::new(DVec3::NAN, DVec3::Z).is_none());
}
