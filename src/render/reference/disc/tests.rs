use crate::math::camera::{Camera, View};
use crate::pack::PrimitiveStyle;
use crate::render::reference::disc::*;
use crate::render::reference::frame::ReferenceFrame;
use glam::{DMat4, DVec4};
use proptest::prelude::*;

fn perspective(size: u32) -> View {
    Camera::look_at(
        (size, size),
        DVec3::ZERO,
        DVec3::NEG_Z,
        DVec3::Y,
        60f64.to_radians(),
        [0.1, 100.0],
    )
    .view(DVec3::ZERO)
    .unwrap()
}

/// One unit is one pixel, off center by 8 and 4 pixels.
fn parallel() -> View {
    let camera = Camera {
        width: 256,
        height: 256,
        view: DMat4::IDENTITY,
        proj: DMat4::from_cols(
            DVec4::new(2.0 / 256.0, 0.0, 0.0, 0.0),
            DVec4::new(0.0, 2.0 / 256.0, 0.0, 0.0),
            DVec4::new(0.0, 0.0, -1.0 / 100.0, 0.0),
            DVec4::new(16.0 / 256.0, 8.0 / 256.0, 0.0, 1.0),
        ),
        y_down: false,
        light: crate::math::camera::HeadlightSource::Point,
        other: serde_json::Map::new(),
    };
    camera.view(DVec3::ZERO).unwrap()
}

fn area(disc: &DiscFootprint) -> f64 {
    let mut count = 0u32;
    for y in disc.rows.clone() {
        let covered = disc
            .columns
            .clone()
            .filter(|&x| disc.met(x, y).rho_squared <= 1.0);
        count += covered.count() as u32;
    }
    f64::from(count)
}

fn patch(center: Vec3, normal: DVec3, radius: f64, thickness: f64) -> SurfacePatch {
    SurfacePatch {
        center,
        normal: normal.normalize_or_zero(),
        radius,
        thickness,
    }
}

/// methods.md 7.2: f² π |det T| / (c_z² - u_z² - v_z²)^(3/2), T = [u v c].
#[test]
fn the_area_is_the_closed_form_of_a_disc_in_perspective() {
    let view = perspective(800);
    let style = PrimitiveStyle::default();
    let frame = ReferenceFrame::new(&view, &style);
    let f = f64::from(view.focal_px());
    for (center, normal, radius) in [
        (Vec3::new(0.0, 0.0, -3.0), DVec3::Z, 0.5),
        (Vec3::new(0.5, -0.3, -3.0), DVec3::new(0.3, 0.9, 0.4), 0.5),
        (Vec3::new(-0.4, 0.2, -2.0), DVec3::new(1.0, 0.1, 0.9), 0.6),
    ] {
        let disc = DiscFootprint::new(&frame, &patch(center, normal, radius, 0.0), 0.0).unwrap();
        let n = normal.normalize();
        let (u, v) = n.any_orthonormal_pair();
        let (u, v, c) = (u * radius, v * radius, center.as_dvec3());
        let det = u.cross(v).dot(c).abs();
        let expected =
            f * f * std::f64::consts::PI * det / (c.z * c.z - u.z * u.z - v.z * v.z).powf(1.5);
        let perimeter = 2.0 * (std::f64::consts::PI * expected).sqrt() * 2.0;
        let got = area(&disc);
        assert!((got - expected).abs() < 0.1 * perimeter, "{got} {expected}");
    }
}

#[test]
fn an_orthographic_disc_is_an_ellipse_with_the_cosine_as_ratio() {
    let view = parallel();
    let style = PrimitiveStyle::default();
    let frame = ReferenceFrame::new(&view, &style);
    for cosine in [1.0f64, 0.6, 0.3, 0.02] {
        let normal = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        let center = Vec3::new(10.0, -5.0, -50.0);
        let disc = DiscFootprint::new(&frame, &patch(center, normal, 60.0, 0.0), 0.0).unwrap();
        let expected = std::f64::consts::PI * 3600.0 * cosine.max(0.1);
        let got = area(&disc);
        assert!(
            (got - expected).abs() < 0.02 * expected + 4.0,
            "{cosine}: {got} {expected}"
        );
        // 128 + 8 + 10 from the left, 128 - 4 + 5 from the top.
        // Half a pixel to either side is a 12th of the shorter axis at most.
        assert!(disc.met(145, 128).rho_squared <= 0.01);
    }
}

#[test]
fn what_is_thick_or_has_no_normal_is_wider_in_the_right_direction() {
    let view = parallel();
    let style = PrimitiveStyle::default();
    let frame = ReferenceFrame::new(&view, &style);
    let at = |normal, thickness| {
        let disc = DiscFootprint::new(
            &frame,
            &patch(Vec3::new(0.0, 0.0, -50.0), normal, 50.0, thickness),
            0.0,
        );
        area(&disc.unwrap()) / (std::f64::consts::PI * 2500.0)
    };
    let side = DVec3::X;
    assert!((at(side, 0.0) - 0.1).abs() < 0.01);
    assert!((at(side, 0.5) - 0.5).abs() < 0.01);
    assert!((at(side, 1.0) - 1.0).abs() < 0.01);
    assert!((at(DVec3::ZERO, 0.0) - 1.0).abs() < 0.01);
    let tilted = DVec3::new(0.8, 0.0, 0.6);
    assert!((at(tilted, 0.25) - (0.6 + 0.25 * 0.8)).abs() < 0.01);
    // A normal that points away is the same disc.
    assert_eq!(at(tilted, 0.25), at(-tilted, 0.25));
}

#[test]
fn a_disc_smaller_than_a_pixel_is_the_pixel_of_its_center() {
    let view = parallel();
    let style = PrimitiveStyle::default();
    let frame = ReferenceFrame::new(&view, &style);
    for radius in [0.0, 1e-30, 0.1, 0.49] {
        // Center at window (138.1, 128.9).
        let center = Vec3::new(2.1, -4.9, -50.0);
        let disc = DiscFootprint::new(&frame, &patch(center, DVec3::X, radius, 0.0), 0.0).unwrap();
        assert_eq!(area(&disc), 1.0, "radius {radius}");
        assert_eq!((disc.columns, disc.rows), (138..139, 128..129));
    }
}

/// Near the eye a plane may have no picture; the circle takes its place, with the same size at the border. A disc that faces the
/// viewer may be as near as it likes.
#[test]
fn a_disc_at_the_near_plane_faces_the_viewer() {
    let view = perspective(200);
    let style = PrimitiveStyle::default();
    let frame = ReferenceFrame::new(&view, &style);
    let disc = |normal: DVec3| {
        let own = patch(Vec3::new(0.0, 0.0, -0.12), normal, 0.05, 0.0);
        DiscFootprint::new(&frame, &own, 0.0).unwrap()
    };
    let radius_px = f64::from(view.focal_px()) * 0.05 / 0.12;
    let expected = std::f64::consts::PI * radius_px * radius_px;
    for normal in [DVec3::X, DVec3::new(0.5, 0.0, 0.8)] {
        let own = disc(normal);
        assert!(matches!(own.shape, DiscShape::Form { .. }));
        let area = area(&own);
        assert!(
            (area - expected).abs() < 0.03 * expected,
            "{area} {expected}"
        );
    }
    assert!(matches!(
        disc(DVec3::new(0.3, 0.0, 0.9)).shape,
        DiscShape::Plane { .. }
    ));
}

/// Two discs that touch a ball show each its middle and meet about half way.
#[test]
fn discs_of_a_ball_meet_about_half_way() {
    let view = perspective(2000);
    let style = PrimitiveStyle::default();
    let frame = ReferenceFrame::new(&view, &style);
    let middle = DVec3::new(0.0, 0.0, -6.0);
    let column_of = |degrees: f64| {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let normal = DVec3::new(sine, 0.0, cosine);
        let at = middle + normal;
        let own = patch(at.as_vec3(), normal, 0.3, 0.0);
        let disc = DiscFootprint::new(&frame, &own, 0.0).unwrap();
        (disc, window(&frame, at).x)
    };
    for degrees in [0.0, 20.0, 40.0, 50.0] {
        let ((left, from), (right, to)) = (column_of(degrees), column_of(degrees + 10.0));
        let nearer = |x: &u32| {
            let [left, right] = [&left, &right].map(|disc| disc.met(*x, 1000).distance.unwrap());
            right < left
        };
        let [from, to] = [from, to].map(|x| x as u32);
        let meeting = (from..to).find(nearer).unwrap();
        assert!((from..meeting).all(|x| !nearer(&x)) && (meeting..to).all(|x| nearer(&x)));
        let share = f64::from(meeting - from) / f64::from(to - from);
        assert!((0.25..0.75).contains(&share), "{degrees} degrees: {share}");
    }
}

proptest! {
    /// Nothing of the footprint lies outside of the square that is looked at, and the form that shaders use is
    /// the intersection of ray and plane.
    #[test]
    fn the_square_contains_the_footprint_and_the_form_is_the_plane(
        center in prop::array::uniform3(-1.0f32..1.0),
        normal in prop::array::uniform3(-1.0f64..1.0),
        size in 0.01f64..0.88,
        thickness in 0.0f64..1.0,
        is_parallel: bool,
    ) {
        let normal = DVec3::from(normal);
        prop_assume!(normal.length() > 1e-3);
        let (view, center, size) = if is_parallel {
            (parallel(), Vec3::new(center[0] * 100.0, center[1] * 100.0, -50.0), size * 60.0)
        } else {
            let z = 1.0 + 3.0 * (center[2] + 1.0);
            (perspective(256), Vec3::new(center[0] * z * 0.5, center[1] * z * 0.5, -z), size * f64::from(z))
        };
        let style = PrimitiveStyle::default();
        let frame = ReferenceFrame::new(&view, &style);
        let patch = patch(center, normal, size, thickness);
        prop_assume!(is_parallel || f64::from(-center.z) - size > 0.1);
        let disc = DiscFootprint::new(&frame, &patch, 0.0).unwrap();
        let n = footprint_normal(&patch, view.is_perspective);
        let (form, skew) = form_of_plane(center.as_dvec3(), n, size, rays(&frame), view.is_perspective);
        let as_form = DiscFootprint { shape: DiscShape::Form { form, skew }, ..disc.clone() };
        for y in (0..256).step_by(3) {
            for x in (0..256).step_by(3) {
                let rho = disc.met(x, y).rho_squared;
                let inside = disc.columns.contains(&x) && disc.rows.contains(&y);
                prop_assert!(inside || rho > 1.0 || matches!(disc.shape, DiscShape::Square), "pixel {x} {y}: {rho}");
                let other = as_form.met(x, y).rho_squared;
                if rho < 4.0 && !matches!(disc.shape, DiscShape::Square) {
                    prop_assert!((rho - other).abs() < 1e-6, "pixel {x} {y}: {rho} {other}");
                }
            }
        }
    }
}
