//! What must not change a picture.

use crate::common::{Device, generated, orbit, pictures};
use surfel::generate::GeneratedShape;
use surfel::gpu::DeviceOptions;
use surfel::image::{Image, compare};
use surfel::math::camera::View;
use surfel::pack::{ColorBy, Phong, SurfaceLighting};
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::vulkan::renderer::VulkanRenderer;
use surfel::render::vulkan::scene::DeviceScene;
use surfel::render::{
    Culling, CutTraversal, ListOf, Method, Path, Reconstruction, Settings, SplatKind,
};
use surfel::tree::Model;

const ALL: PictureOutputs = PictureOutputs {
    depth: true,
    normal: true,
    values: false,
};

/// Sums have no normal.
fn outputs_of((_, splat, _): (Method, SplatKind, f32)) -> PictureOutputs {
    PictureOutputs {
        depth: true,
        normal: splat != SplatKind::Filtered,
        values: false,
    }
}

fn draw(device: &Device, model: &Model, view: &View, settings: &Settings) -> Image {
    let backend = Backend::Device(device.gpu().clone());
    let outputs = outputs_of((settings.method, settings.splat, 0.0));
    pictures::draw(&backend, model, view, settings, outputs).unwrap()
}

fn settings(method: Method, threshold_px: f32) -> Settings {
    Settings {
        method,
        threshold_px,
        ..Settings::default()
    }
}

const METHODS: [(Method, SplatKind, f32); 8] = [
    (Method::Triangles, SplatKind::Square, 1.0),
    (Method::Points, SplatKind::Square, 2.0),
    (Method::Pop, SplatKind::Square, 1.0),
    (Method::Pop, SplatKind::Square, 5.0),
    (Method::Pop, SplatKind::Filtered, 1.0),
    (Method::Pop, SplatKind::Filtered, 3.0),
    (Method::Points, SplatKind::Visibility, 2.0),
    (Method::Pop, SplatKind::Visibility, 3.0),
];

fn settings_of((method, splat, threshold_px): (Method, SplatKind, f32)) -> Settings {
    Settings {
        splat,
        // The one with the most passes and targets.
        reconstruction: Reconstruction::PullPush,
        ..settings(method, threshold_px)
    }
}

/// Whether a model without triangles can be drawn so.
fn draws_clouds((method, splat, _): (Method, SplatKind, f32)) -> bool {
    method != Method::Triangles && splat != SplatKind::Filtered
}

#[test]
fn the_same_frame_twice_is_bit_identical() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 50_000);
    let view = orbit(&model, (200, 200), 30.0, 20.0, 1.0);
    for case in METHODS {
        let backend = Backend::Device(device.gpu().clone());
        let mut engine = Engine::new(&backend, &model, (200, 200), outputs_of(case)).unwrap();
        let s = settings_of(case);
        let first = engine.render(&view, &s).unwrap();
        // Another view between them, so that slots and states turn over.
        engine
            .render(&orbit(&model, (200, 200), 90.0, -20.0, 3.0), &s)
            .unwrap();
        assert!(first == engine.render(&view, &s).unwrap(), "{case:?}");
    }
}

#[test]
fn threshold_zero_is_the_triangle_picture() {
    let Some(device) = Device::open() else { return };
    for shape in [
        GeneratedShape::Statue,
        GeneratedShape::Torus,
        GeneratedShape::Square,
    ] {
        let model = generated(shape, 20_000);
        for fill in [1.0, 4.0] {
            let view = orbit(&model, (200, 160), 30.0, 20.0, fill);
            let pop = Settings {
                path: Path::Raster,
                ..settings(Method::Pop, 0.0)
            };
            let pop = draw(&device, &model, &view, &pop);
            let triangles = draw(&device, &model, &view, &settings(Method::Triangles, 0.0));
            // The guard band changes the last bit of a window position before it is snapped, and of what is
            // interpolated: coverage stays, a grey value on the border of two levels can fall to the other.
            let what = format!("{shape:?} {fill}");
            pictures::ALMOST_EQUAL.assert_same(&triangles, &pop, &what);
        }
    }
}

#[test]
fn culling_changes_nothing_on_a_closed_surface() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 50_000);
    assert!(model.is_closed);
    for k in 0..6 {
        let view = orbit(&model, (200, 200), 60.0 * f64::from(k), 20.0, 1.2);
        for (method, threshold) in [(Method::Triangles, 1.0), (Method::Pop, 0.0)] {
            let on = Settings {
                // Which path draws is decided by how much there is to draw.
                path: Path::Raster,
                culling: Culling::On,
                ..settings(method, threshold)
            };
            let off = Settings {
                culling: Culling::Off,
                ..on
            };
            let (a, b) = (
                draw(&device, &model, &view, &on),
                draw(&device, &model, &view, &off),
            );
            // Next to the silhouette a front and a back triangle meet in an edge; where their depths round to the
            // same value, the first drawn wins.
            pictures::ALMOST_EQUAL.assert_same(&a, &b, &format!("{method:?}, view {k}"));
        }
    }
}

#[test]
fn memory_that_is_not_coherent_gives_the_same_picture() {
    let Some(device) = Device::open() else { return };
    let Some(pretending) = Device::open_with(DeviceOptions {
        pretend_noncoherent: true,
        ..DeviceOptions::default()
    }) else {
        return;
    };
    let model = generated(GeneratedShape::Statue, 50_000);
    let view = orbit(&model, (200, 200), 30.0, 20.0, 1.0);
    for case in METHODS {
        let s = settings_of(case);
        assert!(
            draw(&device, &model, &view, &s) == draw(&pretending, &model, &view, &s),
            "{case:?}: something is not flushed"
        );
    }
}

/// A camera that goes around, jumps and comes nearer; one engine starts its cuts at the root, the other at the last front.
#[test]
fn where_the_traversal_starts_does_not_show() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 60_000);
    let backend = Backend::Device(device.gpu().clone());
    let path = [0.0, 0.1, 0.3, 0.8, 2.0, 150.0, 151.0];
    let views = path.map(|azimuth| orbit(&model, (160, 160), azimuth, 20.0, 1.0 + azimuth / 50.0));
    for (splat, threshold_px) in [
        (SplatKind::Square, 1.0),
        (SplatKind::Square, 2.0),
        (SplatKind::Gauss, 1.5),
        (SplatKind::Filtered, 2.0),
    ] {
        let mut visited = [0; 2];
        let engine =
            || Engine::new(&backend, &model, (160, 160), PictureOutputs::default()).unwrap();
        let mut engines = [engine(), engine()];
        for view in &views {
            let both = [CutTraversal::Root, CutTraversal::Coherent].into_iter();
            let each = both.zip(&mut engines).zip(&mut visited);
            let pictures: Vec<_> = each
                .map(|((traversal, engine), visited)| {
                    let settings = Settings {
                        splat,
                        threshold_px,
                        traversal,
                        ..Settings::default()
                    };
                    *visited += engine.draw(view, &settings).unwrap().counts.nodes_visited;
                    engine.render(view, &settings).unwrap()
                })
                .collect();
            let drawn = pictures[0].color.iter().filter(|c| c[0] > 0).count();
            assert!(drawn > 1000, "{splat:?}: {drawn} pixels");
            assert!(pictures[0] == pictures[1], "{splat:?}, {threshold_px} px");
        }
        assert_ne!(
            visited[0], visited[1],
            "{splat:?}: never started at a front"
        );
    }
}

#[test]
fn pages_do_not_show() {
    let Some(device) = Device::open() else { return };
    let statue = generated(GeneratedShape::Statue, 20_000);
    let mut mesh = surfel::generate::mesh(
        &surfel::generate::ShapeSpec::with_triangles(GeneratedShape::Sphere, 3_000).unwrap(),
    );
    mesh.triangles.clear();
    let cloud = surfel::tree::build(
        mesh,
        &surfel::tree::BuildOptions::default(),
        &surfel::progress::SilentProgress,
    )
    .unwrap();
    for model in [&statue, &cloud] {
        let view = orbit(model, (200, 200), 30.0, 20.0, 1.5);
        for case in METHODS {
            if !model.kind().is_surface() && !draws_clouds(case) {
                continue;
            }
            // Compute takes triangles where all are in one buffer, and the device expands lists of ids there.
            let s = Settings {
                path: Path::Raster,
                list_of: ListOf::Records,
                ..settings_of(case)
            };
            let drawn = |scene: &mut DeviceScene| {
                let outputs = outputs_of(case);
                let mut renderer =
                    VulkanRenderer::new(device.gpu(), 200, 200, outputs, false).unwrap();
                renderer.draw(model, scene, &view, &s).unwrap();
                renderer.read(&view).unwrap()
            };
            let whole = drawn(&mut DeviceScene::new(device.gpu(), model).unwrap());
            for (vertices, triangles) in [(1000, usize::MAX), (usize::MAX, 777), (3, 1_000)] {
                if (vertices, model.triangles.len() > 10_000) == (3, true) {
                    continue; // A page a triangle: 20,000 buffers prove nothing more.
                }
                let mut scene =
                    DeviceScene::with_page_limits(device.gpu(), model, vertices, triangles)
                        .unwrap();
                assert!(scene.pages.len() > 1 || model.triangles.is_empty());
                let paged = drawn(&mut scene);
                assert!(whole == paged, "{case:?}: {} pages show", scene.pages.len());
            }
        }
    }
}

#[test]
fn the_frame_loop_makes_nothing_new() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 50_000);
    let mut scene = DeviceScene::new(device.gpu(), &model).unwrap();
    let mut renderer =
        VulkanRenderer::new(device.gpu(), 200, 200, PictureOutputs::default(), true).unwrap();
    let views: Vec<View> = (0..8)
        .map(|k| orbit(&model, (200, 200), 45.0 * f64::from(k), 10.0, 2.0))
        .collect();
    let mut round = |renderer: &mut VulkanRenderer| {
        for view in &views {
            for case in METHODS {
                renderer
                    .draw(&model, &mut scene, view, &settings_of(case))
                    .unwrap();
            }
        }
    };
    // Both slots of the ring see every view.
    round(&mut renderer);
    round(&mut renderer);
    let before = (
        device.gpu().compiled_pipelines(),
        device.gpu().created_resources(),
    );
    round(&mut renderer);
    assert_eq!(
        before,
        (
            device.gpu().compiled_pipelines(),
            device.gpu().created_resources()
        )
    );
}

/// Pipelines are made for the kind of projection, light and color of their frames: each frame has those of its own.
#[test]
fn one_renderer_draws_frames_of_every_kind_as_a_new_one_does() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 20_000);
    let size = (120, 100);
    let perspective = orbit(&model, size, 30.0, 20.0, 1.0);
    let parallel = crate::common::orthographic(&model, size);
    let outputs = PictureOutputs {
        depth: true,
        ..PictureOutputs::default()
    };
    let backend = Backend::Device(device.gpu().clone());
    for (method, splat, path) in [
        (Method::Triangles, SplatKind::Square, Path::Raster),
        (Method::Points, SplatKind::Square, Path::Raster),
        (Method::Pop, SplatKind::Square, Path::Raster),
        (Method::Pop, SplatKind::Disc, Path::Auto),
        (Method::Pop, SplatKind::Gauss, Path::Raster),
        (Method::Pop, SplatKind::Gauss, Path::Auto),
        (Method::Pop, SplatKind::Visibility, Path::Raster),
        (Method::Pop, SplatKind::Visibility, Path::Compute),
    ] {
        let plain = Settings {
            method,
            splat,
            path,
            threshold_px: 2.0,
            ..Settings::default()
        };
        let kinds = [
            (perspective, plain),
            (parallel, plain),
            (
                perspective,
                Settings {
                    light: SurfaceLighting::Phong(Phong::default()),
                    ..plain
                },
            ),
            (
                perspective,
                Settings {
                    color_by: ColorBy::Normal,
                    ..plain
                },
            ),
            (
                perspective,
                Settings {
                    color_by: ColorBy::Primitive,
                    culling: Culling::Off,
                    two_sided: false,
                    threshold_px: 3.0,
                    ..plain
                },
            ),
        ];
        let mut one = Engine::new(&backend, &model, size, outputs).unwrap();
        for round in 0..2 {
            for (kind, (view, settings)) in kinds.iter().enumerate() {
                let picture = one.render(view, settings).unwrap();
                let mut new = Engine::new(&backend, &model, size, outputs).unwrap();
                let wanted = new.render(view, settings).unwrap();
                let what = format!("{method:?}, {splat:?}, {path:?}, kind {kind}, round {round}");
                assert_eq!(picture, wanted, "{what}");
            }
        }
    }
}

#[test]
fn splats_above_the_devices_point_limit_are_drawn_whole() {
    let Some(device) = Device::open() else { return };
    // Two points seen so near that their squares fill the picture.
    let mesh = surfel::mesh::Mesh {
        positions: vec![
            glam::Vec3::new(-1.0, 0.0, 0.0),
            glam::Vec3::new(1.0, 0.0, 0.0),
        ],
        ..surfel::mesh::Mesh::default()
    };
    let model = surfel::tree::build(
        mesh,
        &surfel::tree::BuildOptions::default(),
        &surfel::progress::SilentProgress,
    )
    .unwrap();
    let limit = device.gpu().info().max_point_size_px;
    let view = orbit(&model, (600, 400), 20.0, 0.0, 1.0);
    let largest = model.tree.leaves[0].radius * 2.0 * view.focal_px()
        / view.distance(model.tree.leaves[0].center);
    if crate::common::is_card() && largest <= limit {
        println!("no square of this picture is larger than points of this device: {limit} px");
        return;
    }
    assert!(
        largest > limit,
        "the scene must ask for more than {limit} px, not {largest}"
    );
    let picture = draw(&device, &model, &view, &settings(Method::Pop, 1.0));
    let mirror = Engine::new(&Backend::Reference, &model, (600, 400), ALL)
        .unwrap()
        .with_subpixel_bits(device.gpu().info().subpixel_bits)
        .render(&view, &settings(Method::Pop, 1.0))
        .unwrap();
    let d = compare(&mirror, &picture, 1.0).unwrap();
    // Quads and squares of the mirror are snapped to 1/256 pixel otherwise: a border can move by one pixel row.
    assert!(d.missing + d.extra <= 2 * 400, "{d:?}");
    assert_eq!(d.holes, 0, "quads leave gaps: {d:?}");
}
