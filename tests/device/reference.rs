//! The reference pictures of charts against what knows nothing of rasterizers: rays through a bounding volume hierarchy
//! of another crate, and closed forms.

use crate::common::{Device, generated, orbit, real};
use glam::{DVec3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;
use surfel::chart::run::ChartBench;
use surfel::generate::{GeneratedShape, ShapeSpec};
use surfel::image::{FloatImage, PictureAccumulator, stratified};
use surfel::math::camera::{Camera, HeadlightSource, View};
use surfel::math::octahedral;
use surfel::measure::{depth_error, normal_error};
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Method, Path, Settings, SplatKind};
use surfel::tree::{self, BuildOptions, Model};

/// What a ray meets first.
struct Hit {
    /// Along the view direction.
    distance: f32,
    /// Mean of the corners' normals by barycentric coordinates, normalized; in the model's space, which for these models
    /// is that of the world but for an origin.
    normal: Vec3,
    /// The default light: 0.8 |n . l|, the lamp in the eye.
    gray: f32,
}

struct Caster<'m> {
    model: &'m Model,
    triangles: Vec<Triangle>,
    bvh: Bvh2,
}

impl<'m> Caster<'m> {
    fn new(model: &'m Model) -> Self {
        let triangles: Vec<Triangle> = model
            .triangles
            .iter()
            .map(|t| {
                let [v0, v1, v2] = t.map(|i| Vec3A::from(model.vertices[i as usize].position));
                Triangle { v0, v1, v2 }
            })
            .collect();
        let mut time = std::time::Duration::ZERO;
        let bvh = build_bvh2_from_tris(&triangles, BvhBuildParams::medium_build(), &mut time);
        Self {
            model,
            triangles,
            bvh,
        }
    }

    /// The ray through a place of the picture; pixel centers are at halves.
    fn cast(&self, view: &View, x_px: f64, y_px: f64) -> Option<Hit> {
        let x_ndc = 2.0 * x_px / f64::from(view.width) - 1.0;
        let y_ndc = 1.0 - 2.0 * y_px / f64::from(view.height);
        let in_view = Vec3::new(
            (x_ndc / f64::from(view.scale[0])) as f32,
            (y_ndc / f64::from(view.scale[1])) as f32,
            -1.0,
        );
        let direction = view.view_from_model.inverse().transform_vector3(in_view);
        let ray = Ray::new_inf(view.eye.into(), direction.into());
        let mut hit = RayHit::none();
        let index = |i: usize| self.bvh.primitive_indices[i] as usize;
        self.bvh
            .ray_traverse(ray, &mut hit, |ray, i| {
                self.triangles[index(i)].intersect(ray)
            })
            .then(|| {
                let triangle = index(hit.primitive_id as usize);
                let corners = self.model.triangles[triangle];
                // Weights are the parts of the triangle's area across from each corner.
                let place = (view.eye + direction * hit.t).as_dvec3();
                let [p, q, r] =
                    corners.map(|i| self.model.vertices[i as usize].position.as_dvec3() - place);
                let whole = (q - p).cross(r - p);
                let weight = |a: DVec3, b: DVec3| {
                    (a.cross(b).dot(whole) / whole.length_squared()).clamp(0.0, 1.0) as f32
                };
                let [a, b, c] =
                    corners.map(|i| octahedral::decode(self.model.vertices[i as usize].normal));
                let normal = (a * weight(q, r) + b * weight(r, p) + c * weight(p, q))
                    .try_normalize()
                    .unwrap_or(Vec3::Z);
                let to_eye = (-direction).normalize();
                Hit {
                    // The direction goes one unit along the view direction.
                    distance: hit.t,
                    normal,
                    gray: 0.8 * normal.dot(to_eye).abs(),
                }
            })
    }
}

fn check_surface(name: &str, device: &Device, model: &Model, view: &View) {
    let outputs = PictureOutputs {
        depth: true,
        normal: true,
        values: false,
    };
    let backend = Backend::Device(device.gpu().clone());
    let size = (view.width, view.height);
    let mut engine = Engine::new(&backend, model, size, outputs).unwrap();
    let settings = Settings {
        method: Method::Triangles,
        ..Settings::default()
    };
    let image = engine.render(view, &settings).unwrap();
    let caster = Caster::new(model);
    let mut depth = vec![f32::INFINITY; image.color.len()];
    let mut normal = vec![[0.0; 3]; image.color.len()];
    for y in 0..view.height {
        for x in 0..view.width {
            let i = (y * view.width + x) as usize;
            if let Some(hit) = caster.cast(view, f64::from(x) + 0.5, f64::from(y) + 0.5) {
                (depth[i], normal[i]) = (hit.distance, hit.normal.to_array());
            }
        }
    }
    let covered = depth.iter().filter(|d| d.is_finite()).count();
    let other = depth
        .iter()
        .zip(&image.depth)
        .filter(|(a, b)| a.is_finite() != b.is_finite())
        .count();
    let depths = depth_error(&depth, &image.depth, view);
    let normals = normal_error(&normal, &image.normal);
    println!(
        "{name}: {covered} pixels, {other} in one only; depth {depths:?}; normals {normals:?}"
    );
    assert!(covered > 10_000);
    // Corners are snapped to 1/256 pixel, so about 1/128 of the pixels on an outline may change sides; outlines of these
    // models are less than a tenth of their pixels.
    assert!(other * 1000 <= covered, "{name}: {other} of {covered}");
    // The same shift of a corner moves the depth of a pixel by 1/256 of its slope: 0.004 of a footprint at 45 degrees at
    // most, with either sign. One pixel in a hundred lies on a rim, where either of two surfaces may be the nearer.
    // A graphics card interpolates over a small triangle with fewer places: an H200 has normals off by 0.008 in the mean.
    let wide = if crate::common::is_card() { 8.0 } else { 1.0 };
    assert!(
        depths.mean < 0.001 * wide && depths.p99 < 0.004 * wide,
        "{name}: {depths:?}"
    );
    // It also takes the normal from a place by as much aside: where it turns by a degree a pixel, 0.004 degrees.
    assert!(
        normals.mean < 0.002 * wide && normals.p99 < 0.01 * wide,
        "{name}: {normals:?}"
    );
}

#[test]
fn depth_and_normals_are_those_of_a_ray_caster() {
    let Some(device) = Device::open() else { return };
    let statue = generated(GeneratedShape::Statue, 100_000);
    let view = orbit(&statue, (400, 300), 30.0, 20.0, 1.0);
    check_surface("statue", &device, &statue, &view);
    if let Some(horse) = real("thesis/horse.ply") {
        let view = orbit(&horse, (300, 400), 215.0, 10.0, 1.0);
        check_surface("horse", &device, &horse, &view);
    }
}

#[test]
fn the_reference_is_what_very_many_rays_see() {
    let Some(device) = Device::open() else { return };
    let statue = generated(GeneratedShape::Statue, 100_000);
    let view = orbit(&statue, (150, 150), 30.0, 20.0, 1.0);
    let backend = Backend::Device(device.gpu().clone());
    let mut bench = ChartBench::new(&backend, &statue, (150, 150)).unwrap();
    let reference = bench.reference(&view, 8, &SilentProgress).unwrap();
    let caster = Caster::new(&statue);
    let (mut worst, mut sum, mut count) = (0.0f64, 0.0, 0u32);
    // Every 41st pixel: 549 of them.
    for i in (0..150 * 150).step_by(41) {
        let (x, y) = (f64::from(i % 150), f64::from(i / 150));
        let (mut gray, mut covered) = (0.0, 0.0);
        let side = 16;
        for k in 0..side * side {
            let at = |n: i32| (f64::from(n) + 0.5) / f64::from(side);
            if let Some(hit) = caster.cast(&view, x + at(k % side), y + at(k / side)) {
                gray += f64::from(hit.gray);
                covered += 1.0;
            }
        }
        let all = f64::from(side * side);
        let found = reference.picture.color[i as usize].map(f64::from);
        for (wanted, found) in [(gray / all, found[0]), (covered / all, found[3])] {
            let off = (wanted - found).abs();
            worst = worst.max(off);
            sum += off * off;
            count += 1;
        }
    }
    let rms = (sum / f64::from(count)).sqrt();
    println!("reference against rays: rms {rms:.5}, worst {worst:.4}");
    // 64 samples, one a cell of 8 x 8: an outline crosses at least 8 cells of its pixel, each wrong by up to 1/64 with a
    // standard deviation of at most 1/128, so the sum by 8^0.5/128 = 0.022 at most; one pixel in 70 lies on an outline,
    // which makes 0.0026 of all, and elsewhere there is less than half a level of rounding.
    assert!(rms < 0.003 && worst < 0.04, "{rms} {worst}");
    // Depth is not averaged: it is that of the pixel's center.
    let center = caster.cast(&view, 75.5, 75.5).unwrap().distance;
    let found = reference.picture.depth[75 * 150 + 75];
    assert!((center - found).abs() < 1e-3 * center, "{center} {found}");
}

#[test]
fn the_reference_of_a_sphere_covers_a_circle() {
    let Some(device) = Device::open() else { return };
    let sphere = generated(GeneratedShape::Sphere, 200_000);
    let view = orbit(&sphere, (200, 200), 0.0, 0.0, 1.0);
    let backend = Backend::Device(device.gpu().clone());
    let mut bench = ChartBench::new(&backend, &sphere, (200, 200)).unwrap();
    let reference = bench.reference(&view, 8, &SilentProgress).unwrap();
    let area: f64 = reference
        .picture
        .color
        .iter()
        .map(|c| f64::from(c[3]))
        .sum();
    // Fill 1: the outline is a circle as wide as the picture. A pixel on it is off by 0.022 (above), which over 628 pixels
    // sums to about 0.6; 4 is six times that, and the polygon is smaller by a part in 10^5.
    let circle = std::f64::consts::PI * 100.0 * 100.0;
    assert!((area - circle).abs() < 4.0, "{area} {circle}");
    // In the middle the surface faces the lamp, except for the pixel's own width.
    let middle = reference.picture.color[100 * 200 + 100][0];
    assert!((middle - 0.8).abs() < 0.003, "{middle}");
}

/// Every method and kind of splat whose samples are averaged as floats, by either path.
fn averaged(is_device: bool) -> Vec<Settings> {
    let paths: &[Path] = if is_device {
        &[Path::Raster, Path::Compute]
    } else {
        &[Path::Auto]
    };
    let mut all = Vec::new();
    for &path in paths {
        for (method, splat) in [
            (Method::Triangles, SplatKind::Square),
            (Method::Points, SplatKind::Square),
            (Method::Points, SplatKind::Gauss),
            (Method::Pop, SplatKind::Square),
            (Method::Pop, SplatKind::Disc),
            (Method::Pop, SplatKind::Gauss),
            (Method::Pop, SplatKind::Filtered),
            (Method::Splats, SplatKind::Square),
            (Method::Splats, SplatKind::Ellipse),
            (Method::Splats, SplatKind::Gauss),
            (Method::Splats, SplatKind::Filtered),
        ] {
            let has_compute = match splat {
                SplatKind::Ellipse => false,
                SplatKind::Square | SplatKind::Disc => method == Method::Pop,
                _ => method != Method::Points,
            };
            if path != Path::Compute || has_compute {
                all.push(Settings {
                    method,
                    splat,
                    path,
                    threshold_px: 3.0,
                    ..Settings::default()
                });
            }
        }
    }
    all
}

#[test]
fn a_shade_between_two_levels_stays_between_them() {
    let Some(device) = Device::open() else { return };
    // 0.8 of these is 80.8, 41.6 and 5.6 levels; the third is the farthest from what eight bits hold.
    let color = [101, 52, 7, 255];
    let wanted = [80.8, 41.6, 5.6, 255.0];
    let mut mesh =
        surfel::generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Square, 20_000).unwrap());
    mesh.colors = vec![color; mesh.positions.len()];
    let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
    // The unit square is larger than the picture, whose pixels are 0.0085 of it: leaves of 1.7 pixels.
    let camera = Camera {
        light: HeadlightSource::Directional,
        ..Camera::look_at(
            (80, 60),
            DVec3::new(0.0, 0.0, 0.6),
            DVec3::ZERO,
            DVec3::Y,
            0.8,
            [0.1, 9.0],
        )
    };
    let view = camera.view(model.origin).unwrap();
    for (backend, is_device) in [
        (Backend::Device(device.gpu().clone()), true),
        (Backend::Reference, false),
        (Backend::Cpu, false),
    ] {
        let mut engine =
            Engine::new(&backend, &model, (80, 60), PictureOutputs::default()).unwrap();
        let is_drawn = |settings: &Settings| {
            !matches!(backend, Backend::Cpu) || backend.draws_by_cpu(settings)
        };
        for settings in averaged(is_device).into_iter().filter(is_drawn) {
            let name = format!(
                "{} {:?} {:?} {:?}",
                backend.name(),
                settings.method,
                settings.splat,
                settings.path
            );
            let mean = engine.supersample(&view, &settings, 4).unwrap();
            let mut worst = 0.0f64;
            for found in &mean.color {
                for (found, wanted) in found.iter().zip(wanted) {
                    worst = worst.max((f64::from(*found) * 255.0 - wanted).abs());
                }
            }
            println!("{name}: {worst:.5} levels");
            // Sums in single precision, of a few terms; by compute in units of some 2^-13. Eight bits are off by 0.4.
            assert!(worst < 0.02, "{name}: {worst} levels");
            // The file with eight bits is rounded once.
            assert_eq!(mean.to_image().color[0], [81, 42, 6, 255], "{name}");
            // A single picture is what it was: what a target of eight bits holds.
            let single = engine.render(&view, &settings).unwrap();
            assert_eq!(single.color[40 * 80 + 40], [81, 42, 6, 255], "{name}");
            assert!(single.values.is_empty());
        }
    }
}

/// Root of the mean square and largest difference from 64 rays a pixel, levels, of a picture of `sphere`; inside of
/// seven tenths of its radius, where shades change by at most two levels a pixel.
fn off_inside(picture: &FloatImage, caster: &Caster, view: &View) -> (f64, f64) {
    let (mut worst, mut sum, mut count) = (0.0f64, 0.0, 0u32);
    for i in (0..200 * 200).step_by(29) {
        let (x, y) = (f64::from(i % 200), f64::from(i / 200));
        if (x - 99.5).hypot(y - 99.5) > 70.0 {
            continue;
        }
        let rays = (0..64).map(|k| {
            let at = |n: i32| (f64::from(n) + 0.5) / 8.0;
            let hit = caster.cast(view, x + at(k % 8), y + at(k / 8)).unwrap();
            f64::from(hit.gray)
        });
        let wanted = rays.sum::<f64>() / 64.0;
        let off = (f64::from(picture.color[i as usize][0]) - wanted).abs() * 255.0;
        worst = worst.max(off);
        sum += off * off;
        count += 1;
    }
    assert!(count > 400);
    ((sum / f64::from(count)).sqrt(), worst)
}

#[test]
fn inside_of_a_surface_the_reference_is_exact_to_a_fraction_of_a_level() {
    let Some(device) = Device::open() else { return };
    let sphere = generated(GeneratedShape::Sphere, 200_000);
    let view = orbit(&sphere, (200, 200), 0.0, 20.0, 1.0);
    let caster = Caster::new(&sphere);
    for backend in [Backend::Device(device.gpu().clone()), Backend::Reference] {
        let mut bench = ChartBench::new(&backend, &sphere, (200, 200)).unwrap();
        let reference = bench.reference(&view, 8, &SilentProgress).unwrap();
        let (rms, worst) = off_inside(&reference.picture, &caster, &view);
        println!("{}: rms {rms:.4}, worst {worst:.4} levels", backend.name());
        // 64 places, each anywhere in its cell of an eighth of a pixel: two levels a pixel make 2/8/12^0.5/8 = 0.009, the
        // snapping of corners by up to 1/512 pixel less.
        assert!(rms < 0.01 && worst < 0.05, "{rms} {worst}");
    }
    // The same mean of what a target of eight bits held is not.
    let backend = Backend::Device(device.gpu().clone());
    let mut engine = Engine::new(&backend, &sphere, (200, 200), PictureOutputs::default()).unwrap();
    let settings = Settings {
        method: Method::Triangles,
        ..Settings::default()
    };
    let mut rounded = PictureAccumulator::new();
    for i in 0..64 {
        let image = engine.render(&stratified(&view, i, 8), &settings).unwrap();
        rounded.add(&image).unwrap();
    }
    let (rms, worst) = off_inside(&rounded.mean(), &caster, &view);
    println!("of eight bits: rms {rms:.4}, worst {worst:.4} levels");
    assert!(rms > 0.03 && worst > 0.1, "{rms} {worst}");
}
