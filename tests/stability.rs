//! What must stay as it is when time passes, thresholds fall, cameras tremble and scenes are scaled or moved.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::{Device, generated, orbit, real};
use glam::DVec3;
use surfel::generate::{Shape, Spec};
use surfel::image::{Image, compare};
use surfel::math::camera::{Camera, View};
use surfel::mesh::Mesh;
use surfel::method::engine::{Backend, Engine};
use surfel::method::renderer::Outputs;
use surfel::method::{Method, Reconstruction, Settings, SplatKind};
use surfel::progress::Silent;
use surfel::tree::{self, BuildOptions, Model};

const SPLATS: [SplatKind; 6] = [
    SplatKind::Square,
    SplatKind::Disc,
    SplatKind::Ellipse,
    SplatKind::Gauss,
    SplatKind::Visibility,
    SplatKind::Filtered,
];

fn settings(method: Method, splat: SplatKind, threshold_px: f32) -> Settings {
    Settings {
        method,
        splat,
        threshold_px,
        ..Settings::default()
    }
}

fn build(mesh: Mesh) -> Model {
    tree::build(mesh, &BuildOptions::default(), &Silent).unwrap()
}

fn mesh(shape: Shape, n: u64) -> Mesh {
    surfel::generate::mesh(&Spec::with_triangles(shape, n).unwrap())
}

fn cases() -> Vec<Settings> {
    let mut all = vec![settings(Method::Triangles, SplatKind::Square, 1.0)];
    for splat in SPLATS {
        for method in [Method::Points, Method::Splats, Method::Pop] {
            if method == Method::Points && splat == SplatKind::Filtered {
                continue;
            }
            for t in [1.0, 3.0] {
                all.push(settings(method, splat, t));
            }
        }
    }
    all
}

fn past(a: &Image, b: &Image) -> (f64, f64) {
    let d = compare(a, b, 1.0).unwrap();
    (
        100.0 * d.whole.past_level as f64 / d.whole.pixels as f64,
        d.whole.max_level,
    )
}

fn horse_mesh() -> Option<Mesh> {
    let path = common::models()?.join("thesis/horse.ply");
    Some(
        surfel::input::load(&path, &surfel::input::Options::default(), &Silent)
            .unwrap()
            .mesh,
    )
}

#[test]
fn explore_scale() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Device(device.gpu().clone());
    let size = (200, 200);
    for (name, base) in [
        ("statue", Some(mesh(Shape::Statue, 50_000))),
        ("sphere", Some(mesh(Shape::Sphere, 50_000))),
        ("torus", Some(mesh(Shape::Torus, 50_000))),
        ("horse", horse_mesh()),
    ] {
        let Some(base) = base else { continue };
        let model0 = build(base.clone());
        let center = model0.orbit_center.as_dvec3();
        let radius = f64::from(model0.orbit_radius);
        let cases = cases();
        let pictures = |model: &Model, camera: &Camera| -> Vec<Image> {
            let mut engine = Engine::new(&backend, model, size, Outputs::default()).unwrap();
            let view = camera.view(model.origin).unwrap();
            cases
                .iter()
                .map(|s| engine.render(&view, s).unwrap())
                .collect()
        };
        for fill in [1.0, 3.0] {
            let camera = |s: f64, o: DVec3| {
                Camera::orbit(size, (center) * s + o, radius * s, 0.5, 0.35, fill)
            };
            let reference = pictures(&model0, &camera(1.0, DVec3::ZERO));
            let report = |what: &str, model: &Model, camera: &Camera| {
                let now = pictures(model, camera);
                let mut line = format!("{name} {fill} {what} closed {}:", model.is_closed);
                let mut bad = 0;
                for (s, (a, b)) in cases.iter().zip(reference.iter().zip(&now)) {
                    let (share, max) = past(a, b);
                    if share > 0.0 {
                        bad += 1;
                        line += &format!(
                            "\n     {:?} {:?} {}: {share:.3} % max {max:.0}",
                            s.method, s.splat, s.threshold_px
                        );
                    }
                }
                println!("{line} ({bad} differ)");
            };
            for s in [1024.0, 1e-6, 1e-3, 1e3, 1e6f64] {
                let mut m = base.clone();
                for p in &mut m.positions {
                    *p = (p.as_dvec3() * s).as_vec3();
                }
                let model = build(m);
                report(&format!("scale {s:e}"), &model, &camera(s, DVec3::ZERO));
            }
            let o = DVec3::new(1e6, -1e6, 1e6);
            let mut m = base.clone();
            m.origin = o;
            report("origin", &build(m), &camera(1.0, o));
            // text, double
            let mut text = String::new();
            for p in &base.positions {
                let p = p.as_dvec3() + o;
                text += &format!("v {} {} {}\n", p.x, p.y, p.z);
            }
            for n in &base.normals {
                text += &format!("vn {} {} {}\n", n.x, n.y, n.z);
            }
            let has_n = !base.normals.is_empty();
            for t in &base.triangles {
                let [a, b, c] = t.map(|i| {
                    if has_n {
                        format!("{0}//{0}", i + 1)
                    } else {
                        format!("{}", i + 1)
                    }
                });
                text += &format!("f {a} {b} {c}\n");
            }
            let file =
                std::env::temp_dir().join(format!("moved-{name}-{}.obj", std::process::id()));
            std::fs::write(&file, text).unwrap();
            let loaded =
                surfel::input::load(&file, &surfel::input::Options::default(), &Silent).unwrap();
            std::fs::remove_file(&file).unwrap();
            println!("loader origin {:?}", loaded.mesh.origin);
            report("loader", &build(loaded.mesh), &camera(1.0, o));
            // Directly
            let k = 1000.0 / radius;
            let q = |m: &Mesh, o: DVec3| {
                let mut m = m.clone();
                for p in &mut m.positions {
                    *p = ((p.as_dvec3() * k * 16.0).round() / 16.0 + o).as_vec3();
                }
                m
            };
            let near = build(q(&base, DVec3::ZERO));
            let far = build(q(&base, o));
            let a = pictures(&near, &camera(k, DVec3::ZERO));
            let b = pictures(&far, &camera(k, o));
            for (s, (a, b)) in cases.iter().zip(a.iter().zip(&b)) {
                let (share, max) = past(a, b);
                println!(
                    "     direct {:?} {:?} {}: {share:.3} % max {max:.0}",
                    s.method, s.splat, s.threshold_px
                );
            }
        }
    }
    let _ = (
        generated(Shape::Square, 10),
        real as fn(&str) -> Option<Model>,
        orbit as fn(&Model, (u32, u32), f64, f64, f64) -> View,
        Reconstruction::PullPush,
    );
}

fn models() -> Vec<(&'static str, Model)> {
    let mut all = vec![
        ("sphere", generated(Shape::Sphere, 50_000)),
        ("statue", generated(Shape::Statue, 50_000)),
    ];
    if let Some(h) = real("thesis/horse.ply") {
        all.push(("horse", h));
    }
    all
}

#[test]
fn explore_sweep() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Device(device.gpu().clone());
    let size = (200, 200);
    for (name, model) in models() {
        let mut engine = Engine::new(&backend, &model, size, Outputs::default()).unwrap();
        let view = orbit(&model, size, 30.0, 20.0, 1.0);
        let reference = engine
            .supersample(
                &view,
                &settings(Method::Triangles, SplatKind::Square, 0.0),
                4,
            )
            .unwrap();
        for method in [Method::Pop, Method::Splats] {
            for splat in SPLATS {
                for reconstruction in [
                    Reconstruction::Gaussian,
                    Reconstruction::Density,
                    Reconstruction::PullPush,
                ] {
                    if splat != SplatKind::Visibility && reconstruction != Reconstruction::Gaussian
                    {
                        continue;
                    }
                    let mut line = format!("{name} {method:?} {splat:?} {reconstruction:?}\n");
                    for t in [
                        32.0, 16.0, 8.0, 4.0, 3.0, 2.0, 1.5, 1.0, 0.7, 0.5, 0.25, 0.0f32,
                    ] {
                        let s = Settings {
                            reconstruction,
                            ..settings(method, splat, t)
                        };
                        let times = engine.draw(&view, &s).unwrap();
                        let image = engine.read(&view).unwrap();
                        let d = compare(&reference, &image, 8.0).unwrap();
                        let c = times.counts;
                        line += &format!(
                            "    {t:5}: rmse {:7.3} mean {:6.3} holes {} missing {} extra {}; visited {} splats {} tri {} sum {}\n",
                            255.0 * d.object.rmse,
                            255.0 * d.object.mean_abs,
                            d.holes,
                            d.missing,
                            d.extra,
                            c.nodes_visited,
                            c.splats,
                            c.triangles,
                            c.splats + c.triangles
                        );
                    }
                    println!("{line}");
                }
            }
        }
    }
}

#[test]
fn explore_jitter() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Device(device.gpu().clone());
    let size = (200, 200);
    for (name, model) in models() {
        let mut engine = Engine::new(&backend, &model, size, Outputs::default()).unwrap();
        for s in cases() {
            let mut line = format!("{name} {:?} {:?} {}:", s.method, s.splat, s.threshold_px);
            for fill in [1.0, 3.0] {
                let c = model.origin + model.orbit_center.as_dvec3();
                let camera = Camera::orbit(size, c, f64::from(model.orbit_radius), 0.5, 0.35, fill);
                let base = engine
                    .render(&camera.view(model.origin).unwrap(), &s)
                    .unwrap();
                let inv = camera.view.inverse();
                let d = inv.transform_point3(DVec3::ZERO).distance(c);
                for dir in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE.normalize()] {
                    let mut moved = camera.clone();
                    moved.view = glam::DMat4::from_translation(-dir * 1e-4 * d) * moved.view;
                    let b = engine
                        .render(&moved.view(model.origin).unwrap(), &s)
                        .unwrap();
                    let diff = compare(&base, &b, 16.0).unwrap();
                    line += &format!(
                        " [{:.3} m {:.0} x {:.2}%]",
                        255.0 * diff.object.mean_abs,
                        diff.object.max_level,
                        100.0 * diff.object.past_level as f64 / diff.object.pixels as f64
                    );
                }
            }
            println!("{line}");
        }
    }
}
