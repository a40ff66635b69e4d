//! The device against the CPU mirror: every method, on scenes that reach every rule of it.

use crate::common::pictures::{self, PictureOracle};
use crate::common::{Device, generated, orbit, scans};
use glam::{DVec3, Vec3};
use surfel::generate::GeneratedShape;
use surfel::math::camera::{Camera, HeadlightSource, View};
use surfel::mesh::Mesh;
use surfel::pack::ColorBy;
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Culling, Method, Settings, SplatKind};
use surfel::tree::{self, BuildOptions, Model};

const OUTPUTS: PictureOutputs = PictureOutputs {
    depth: true,
    normal: true,
    values: false,
};

const METHODS: [(Method, f32); 5] = [
    (Method::Triangles, 1.0),
    (Method::Points, 1.0),
    (Method::Points, 3.0),
    (Method::Pop, 1.0),
    (Method::Pop, 4.5),
];

fn both(
    device: &Device,
    model: &Model,
    view: &View,
    settings: &Settings,
    name: &str,
    oracle: PictureOracle,
) {
    let backend = Backend::Device(device.gpu().clone());
    let draw = |backend| pictures::draw(backend, model, view, settings, OUTPUTS).unwrap();
    oracle.assert_same(&draw(&Backend::Reference), &draw(&backend), name);
}

fn every_method(device: &Device, model: &Model, view: &View, name: &str, oracle: PictureOracle) {
    for (method, threshold_px) in METHODS {
        if !model.kind().is_surface() && method == Method::Triangles {
            continue;
        }
        let settings = Settings {
            method,
            threshold_px,
            ..Settings::default()
        };
        let name = format!("{name}, {method:?} {threshold_px}");
        both(device, model, view, &settings, &name, oracle);
    }
}

#[test]
fn smooth_and_rough_surfaces_from_outside() {
    let Some(device) = Device::open() else { return };
    for (shape, triangles) in [
        (GeneratedShape::Sphere, 20_000),
        (GeneratedShape::Statue, 60_000),
        (GeneratedShape::Square, 800),
    ] {
        let model = generated(shape, triangles);
        for (azimuth, elevation, fill) in [(30.0, 20.0, 1.0), (200.0, -35.0, 0.4)] {
            let view = orbit(&model, (240, 200), azimuth, elevation, fill);
            every_method(
                &device,
                &model,
                &view,
                &format!("{shape:?} {azimuth} {fill}"),
                pictures::REFERENCE_SURFACE,
            );
        }
    }
}

/// Filtered splats: sums of floats, so a grey level may differ by one where the order of the sums does not.
#[test]
fn filtered_splats() {
    let Some(device) = Device::open() else {
        return;
    };
    let mut cases = Vec::new();
    for (shape, triangles) in [
        (GeneratedShape::Sphere, 20_000),
        (GeneratedShape::Statue, 60_000),
        (GeneratedShape::Torus, 40_000),
    ] {
        let spec = surfel::generate::ShapeSpec::with_triangles(shape, triangles).unwrap();
        cases.push((format!("{shape:?}"), surfel::generate::mesh(&spec)));
    }
    let mut colored = cases[0].1.clone();
    colored.colors = colored
        .positions
        .iter()
        .map(|p| {
            [
                (p.x * 127.0 + 128.0) as u8,
                90,
                (p.z * 127.0 + 128.0) as u8,
                255,
            ]
        })
        .collect();
    let mut cloud = colored.clone();
    cloud.triangles.clear();
    let mut bare = cloud.clone();
    bare.normals.clear();
    cases.push(("colors".into(), colored));
    cases.push(("cloud".into(), cloud));
    cases.push(("bare cloud".into(), bare));
    cases.push(("splats only".into(), cases[1].1.clone()));
    for (name, mesh) in cases {
        let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
        let method = if name == "splats only" {
            Method::Splats
        } else {
            Method::Pop
        };
        for (fill, threshold_px) in [(1.0, 1.0), (0.3, 1.0), (0.3, 2.5), (3.0, 4.0)] {
            for culling in [Culling::Auto, Culling::Off] {
                let view = orbit(&model, (160, 140), 40.0, 25.0, fill);
                let settings = Settings {
                    method,
                    splat: SplatKind::Filtered,
                    threshold_px,
                    culling,
                    background: [0.1, 0.2, 0.3],
                    ..Settings::default()
                };
                let outputs = pictures::with_depth(false);
                let draw = |backend: &Backend| {
                    pictures::draw(backend, &model, &view, &settings, outputs).unwrap()
                };
                let picture = draw(&Backend::Device(device.gpu().clone()));
                let what = format!("{name} {fill} {threshold_px} {culling:?}");
                pictures::REFERENCE_FILTERED.assert_same(
                    &draw(&Backend::Reference),
                    &picture,
                    &what,
                );
            }
        }
    }
}

#[test]
fn what_filtered_splats_cannot_draw_is_refused_by_name() {
    let Some(device) = Device::open() else {
        return;
    };
    let statue = tree::build(
        surfel::generate::mesh(
            &surfel::generate::ShapeSpec::with_triangles(GeneratedShape::Statue, 5_000).unwrap(),
        ),
        &BuildOptions::default(),
        &SilentProgress,
    )
    .unwrap();
    let view = orbit(&statue, (64, 64), 0.0, 0.0, 1.0);
    let settings = Settings {
        splat: SplatKind::Filtered,
        ..Settings::default()
    };
    for backend in [Backend::Device(device.gpu().clone()), Backend::Reference] {
        let refusal = |model: &Model, outputs: PictureOutputs, settings: &Settings| {
            Engine::new(&backend, model, (64, 64), outputs)
                .unwrap()
                .render(&view, settings)
                .unwrap_err()
                .to_string()
        };
        assert!(refusal(&statue, OUTPUTS, &settings).contains("--normals"));
        let one_sided = Settings {
            two_sided: false,
            ..settings
        };
        assert!(refusal(&statue, PictureOutputs::default(), &one_sided).contains("--one-sided"));
        let points = Settings {
            method: Method::Points,
            ..settings
        };
        assert!(refusal(&statue, PictureOutputs::default(), &points).contains("--method pop"));
    }
}

#[test]
fn needles_near_and_far() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Torus, 40_000);
    for fill in [0.2, 1.0, 5.0] {
        let view = orbit(&model, (200, 200), 75.0, 40.0, fill);
        // Needles are all edge.
        every_method(
            &device,
            &model,
            &view,
            &format!("torus {fill}"),
            pictures::REFERENCE_NEEDLES,
        );
    }
}

#[test]
fn the_camera_inside_and_at_the_surface() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 30_000);
    for (eye, target) in [
        (DVec3::ZERO, DVec3::new(0.3, 0.1, 1.0)),
        (DVec3::new(0.0, 0.0, 0.66), DVec3::new(0.4, 0.2, 0.0)),
    ] {
        let camera = Camera::look_at((200, 160), eye, target, DVec3::Y, 1.0, [0.01, 5.0]);
        let view = camera.view(DVec3::ZERO).unwrap();
        for culling in [Culling::Off, Culling::On] {
            for (method, threshold_px) in METHODS {
                let settings = Settings {
                    method,
                    threshold_px,
                    culling,
                    ..Settings::default()
                };
                let name = format!("inside at {eye}, {culling:?}, {method:?} {threshold_px}");
                if culling == Culling::On && eye == DVec3::ZERO {
                    continue; // All faces turn away: nothing to see, which another test asserts.
                }
                both(
                    &device,
                    &model,
                    &view,
                    &settings,
                    &name,
                    pictures::REFERENCE_SURFACE,
                );
            }
        }
    }
}

#[test]
fn orthographic_off_center_and_parallel_light() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 30_000);
    let mut camera = Camera::orbit((180, 220), DVec3::ZERO, 1.6, 0.7, 0.3, 1.0);
    camera.light = HeadlightSource::Directional;
    every_method(
        &device,
        &model,
        &camera.view(DVec3::ZERO).unwrap(),
        "parallel light",
        pictures::REFERENCE_SURFACE,
    );
    camera.proj.z_axis.x = 0.21;
    camera.proj.z_axis.y = -0.13;
    every_method(
        &device,
        &model,
        &camera.view(DVec3::ZERO).unwrap(),
        "off center",
        pictures::REFERENCE_SURFACE,
    );
    let (near, far) = (1.0, 8.0);
    camera.proj = glam::DMat4::from_cols_array(&[
        0.6,
        0.0,
        0.0,
        0.0,
        0.0,
        0.5,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0 / (near - far),
        0.0,
        0.1,
        -0.05,
        near / (near - far),
        1.0,
    ]);
    every_method(
        &device,
        &model,
        &camera.view(DVec3::ZERO).unwrap(),
        "orthographic",
        pictures::REFERENCE_SURFACE,
    );
    // A mirrored picture turns the fronts; a scaled view changes lengths.
    camera.proj.x_axis.x = -0.6;
    camera.view = glam::DMat4::from_scale(DVec3::splat(0.8)) * camera.view;
    every_method(
        &device,
        &model,
        &camera.view(DVec3::ZERO).unwrap(),
        "mirrored and scaled",
        pictures::REFERENCE_SURFACE,
    );
}

#[test]
fn colors_missing_normals_and_clouds() {
    let Some(device) = Device::open() else { return };
    let mut mesh = surfel::generate::mesh(
        &surfel::generate::ShapeSpec::with_triangles(GeneratedShape::Sphere, 5_000).unwrap(),
    );
    mesh.colors = mesh
        .positions
        .iter()
        .map(|p| {
            [
                (p.x * 127.0 + 128.0) as u8,
                (p.y * 127.0 + 128.0) as u8,
                200,
                255,
            ]
        })
        .collect();
    let build = |mesh: Mesh| tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
    let colored = build(mesh.clone());
    let view = orbit(&colored, (200, 200), 10.0, 5.0, 0.9);
    every_method(
        &device,
        &colored,
        &view,
        "colors",
        pictures::REFERENCE_SURFACE,
    );
    for (color_by, use_colors, two_sided) in [
        (ColorBy::Primitive, true, true),
        (ColorBy::Shading, false, true),
        (ColorBy::Shading, true, false),
    ] {
        let settings = Settings {
            color_by,
            use_colors,
            two_sided,
            threshold_px: 6.0,
            background: [0.2, 0.4, 0.6],
            ..Settings::default()
        };
        let name = format!("{color_by:?} {use_colors} {two_sided}");
        both(
            &device,
            &colored,
            &view,
            &settings,
            &name,
            pictures::REFERENCE_SURFACE,
        );
    }
    let mut cloud = mesh.clone();
    cloud.triangles.clear();
    every_method(
        &device,
        &build(cloud.clone()),
        &view,
        "cloud",
        pictures::REFERENCE_SURFACE,
    );
    cloud.normals.clear();
    let near = orbit(&build(cloud.clone()), (200, 200), 10.0, 5.0, 4.0);
    every_method(
        &device,
        &build(cloud),
        &near,
        "cloud without normals, near",
        pictures::REFERENCE_SURFACE,
    );
    // Some vertices without a normal.
    for normal in mesh.normals.iter_mut().step_by(3) {
        *normal = Vec3::ZERO;
    }
    every_method(
        &device,
        &build(mesh),
        &view,
        "some normals missing",
        pictures::REFERENCE_SURFACE,
    );
}

#[test]
fn scans_and_real_models() {
    let Some(device) = Device::open() else { return };
    let mut models = scans(&[
        "thesis/horse.ply",
        "thesis/porsche.obj",
        "meshes/ankylosaurus_mesh.ply.gz",
        "photos/sceaux/Sparse.ply",
    ]);
    let mut points = crate::common::load(&crate::common::models::scan_file());
    points.triangles.clear();
    let points = tree::build(points, &BuildOptions::default(), &SilentProgress).unwrap();
    models.push(("points of the scan".into(), points));
    for (name, model) in models {
        let view = orbit(&model, (300, 300), 40.0, 25.0, 1.0);
        // Sharp, layered models have more edges and more ties.
        every_method(&device, &model, &view, &name, pictures::REFERENCE_LAYERS);
    }
}
