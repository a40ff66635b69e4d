//! Spheres and planes whose picture is known at every pixel (methods 15.1, 15.2).

use super::scene::*;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;
use std::sync::LazyLock;
use surfel::pack::PrimitiveStyle;
use surfel::render::reference::render;

/// A million triangles, as in the conventions; the chords lie at most 1e-5 below the sphere.
static FINE_SPHERE: LazyLock<Model> = LazyLock::new(|| sphere(DVec3::ZERO, 1000, 500));

/// Ray and unit sphere at zero, from `eye` along -z: hit point of the pixel at offset (u, v) up from the
/// center in units of f.
fn ray_sphere(eye: f64, u: f64, v: f64) -> Option<DVec3> {
    let d = DVec3::new(u, v, -1.0);
    // |(0, 0, eye) + t d| = 1, the smaller t.
    let (a, b, c) = (d.length_squared(), -eye, eye * eye - 1.0);
    let root = b * b - a * c;
    (root >= 0.0).then(|| DVec3::new(0.0, 0.0, eye) + (-b - root.sqrt()) / a * d)
}

#[test]
fn a_sphere_has_the_closed_form_silhouette_shading_depth_and_normal() {
    for (d, area) in [
        (2.0, 196_349.5),
        (3.0, 73_631.1),
        (5.0, 24_543.7),
        (8.0, 9_350.0),
    ] {
        let view = sphere_view(d, 500);
        let image = render(&view, &FINE_SPHERE.list(), &PrimitiveStyle::default(), BOTH);
        let f = 250.0 / (PI / 6.0).tan();
        let radius = f / (d * d - 1.0f64).sqrt();
        // 15.1 allows half the perimeter; the lattice of a centered circle does far better.
        let perimeter = 2.0 * PI * radius;
        let covered = image.covered_pixels() as f64;
        assert!(
            (covered - area).abs() < 0.1 * perimeter,
            "d = {d}: {covered} px, not {area}"
        );
        let mut checked = 0;
        for (i, color) in image.color.iter().enumerate() {
            let (x, y) = (
                (i % 500) as f64 + 0.5 - 250.0,
                250.0 - (i / 500) as f64 - 0.5,
            );
            let off = x.hypot(y);
            // The chords of 1000 cells lie a little inside.
            if (off - radius).abs() < 0.01 {
                continue;
            }
            assert_eq!(color[3] == 255, off < radius, "d = {d}, pixel {i}");
            if off > 0.98 * radius {
                continue;
            }
            let hit = ray_sphere(d, x / f, y / f).unwrap();
            let cosine = hit.dot((DVec3::new(0.0, 0.0, d) - hit).normalize());
            let tangent = (1.0 - cosine * cosine).sqrt() / cosine;
            // Snapping moves a corner by at most half of 1/256 pixel on each axis. 0.01 levels are the octahedral
            // normal.
            let level_per_px = 204.0 * tangent / radius;
            let (level, got) = (204.0 * cosine, f64::from(color[0]));
            assert!(
                (got - level).abs() < 0.51 + level_per_px / 256.0,
                "d = {d}, pixel {i}: {got}, not {level}"
            );
            let depth_per_px = (d - hit.z) / f * tangent;
            let depth = f64::from(image.depth[i]);
            assert!(
                (depth - (d - hit.z)).abs() < 2e-5 + depth_per_px / 256.0,
                "d = {d}, pixel {i}: {depth}"
            );
            let normal = Vec3::from(image.normal[i]).as_dvec3();
            assert!(
                normal.distance(hit) < 2e-3,
                "d = {d}, pixel {i}: {normal}, not {hit}"
            );
            checked += 1;
        }
        assert!(f64::from(checked) > 0.95 * area);
    }
}

#[test]
fn depth_at_the_center_of_a_sphere_is_the_distance_less_the_radius() {
    for d in [1.5, 3.0, 20.0] {
        let image = render(
            &sphere_view(d, 501),
            &FINE_SPHERE.list(),
            &PrimitiveStyle::default(),
            BOTH,
        );
        let center = 250 * 501 + 250;
        assert!((f64::from(image.depth[center]) - (d - 1.0)).abs() < 1e-5 * d);
        assert_eq!(image.color[center], [204, 204, 204, 255]);
        if d > 2.0 {
            assert_eq!(image.depth[0], f32::INFINITY);
            assert_eq!(image.normal[0], [0.0; 3]);
        }
    }
}

#[test]
fn a_sphere_off_the_axis_is_the_ellipse_of_the_closed_form() {
    // 15.1: C = (2, 0, 3), R = 1, f = 1: semi-axes 0.433013 and 0.353553, center x = 0.75.
    let model = sphere(DVec3::new(2.0, 0.0, -3.0), 400, 200);
    let image = render(
        &from_origin((600, 600), 120.0, (1.0, 5.0)),
        &model.list(),
        &PrimitiveStyle::default(),
        BOTH,
    );
    let f = 300.0 / (PI / 3.0).tan();
    let (a, b) = (0.433_013 * f, 0.353_553 * f);
    let perimeter = PI * (a + b);
    let covered = image.covered_pixels() as f64;
    assert!(
        (covered - PI * a * b).abs() < 0.1 * perimeter,
        "{covered} px"
    );
    let mean_x = coverage(&image)
        .iter()
        .enumerate()
        .map(|(i, c)| f64::from(*c) * ((i % 600) as f64 + 0.5 - 300.0))
        .sum::<f64>()
        / covered;
    assert!(
        (mean_x - 0.75 * f).abs() < 0.05,
        "{mean_x} px, not {}",
        0.75 * f
    );
}

#[test]
fn a_tilted_plane_has_the_closed_form_depth_and_perspective_correct_color() {
    let (z0, tilt) = (4.0, 40f64.to_radians().tan());
    let view = from_origin((500, 400), 60.0, (0.5, 100.0));
    let f = f64::from(view.focal_px());
    let point = |x: f64, y: f64| Vec3::new(x as f32, y as f32, -(z0 + tilt * x) as f32);
    let mut model = Model::from_corners(&[
        [point(-1.5, -1.5), point(2.0, -1.5), point(2.0, 1.5)],
        [point(-1.5, -1.5), point(2.0, 1.5), point(-1.5, 1.5)],
    ]);
    for v in &mut model.vertices {
        v.color = [if v.position.x > 0.0 { 255 } else { 0 }, 255, 255, 0];
    }
    let image = render(&view, &model.list(), &PrimitiveStyle::default(), BOTH);
    let mut checked = 0;
    for (i, depth) in image
        .depth
        .iter()
        .enumerate()
        .filter(|(_, z)| z.is_finite())
    {
        let x = (i % 500) as f64 + 0.5 - 250.0;
        let z = z0 / (1.0 - tilt * x / f);
        assert!(
            (f64::from(*depth) / z - 1.0).abs() < 2e-5,
            "{depth}, not {z}"
        );
        let red = (z * x / f + 1.5) / 3.5;
        assert!((f64::from(image.color[i][0]) - 255.0 * 0.8 * red).abs() < 0.6);
        assert_eq!(image.color[i][1], 204);
        checked += 1;
    }
    assert!(checked > 40_000, "{checked}");
}

#[test]
fn a_floor_from_behind_the_eye_is_clipped_at_the_near_and_far_plane() {
    let view = from_origin((300, 200), 70.0, (2.0, 30.0));
    let f = f64::from(view.focal_px());
    let corner = |x: f32, z: f32| Vec3::new(x, -1.0, z);
    let model = Model::from_corners(&[
        [
            corner(-900.0, 50.0),
            corner(900.0, 50.0),
            corner(900.0, -2000.0),
        ],
        [
            corner(-900.0, 50.0),
            corner(900.0, -2000.0),
            corner(-900.0, -2000.0),
        ],
    ]);
    let image = render(&view, &model.list(), &PrimitiveStyle::default(), BOTH);
    let mut covered = 0;
    for (i, depth) in image.depth.iter().enumerate() {
        let down = ((i / 300) as f64 + 0.5 - 100.0) / f;
        // The floor lies at distance z = 1 / down.
        let z = 1.0 / down;
        if down <= 0.0 || !(2.0 * 0.99..=30.0 * 1.01).contains(&z) {
            assert_eq!(*depth, f32::INFINITY, "row {}", i / 300);
        } else if (2.0 * 1.01..30.0 * 0.99).contains(&z) {
            assert!(
                (f64::from(*depth) / z - 1.0).abs() < 1e-3,
                "{depth}, not {z}"
            );
            covered += 1;
        }
    }
    assert!(covered > 10_000, "{covered}");
}
