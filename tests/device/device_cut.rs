//! Cuts that the device chooses: the same pictures and counts as those of the host, frame after frame, and refused by name
//! where it cannot. That the lists are the same node for node is tested beside the passes (`device_cut`).

use crate::common::{Device, cloud, generated, orbit, pictures, scans, views_around};
use surfel::cut::SizeMetric;
use surfel::generate::GeneratedShape;
use surfel::gpu::Error;
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::pack::lit_sphere::LitSphere;
use surfel::pack::{ColorBy, Phong, SurfaceLighting};
use surfel::render::PictureOutputs;
use surfel::render::cost::model::DrawCosts;
use surfel::render::stats::FrameTimes;
use surfel::render::stats::KeptWork;
use surfel::render::vulkan::renderer::VulkanRenderer;
use surfel::render::vulkan::scene::DeviceScene;
use surfel::render::{
    AmbientOcclusion, Blend, Culling, CutOn, EyeDome, Method, Path, Settings, Shading, SplatKind,
};
use surfel::tree::Model;

const SIZE: (u32, u32) = (240, 200);

fn renderer(device: &Device) -> VulkanRenderer {
    renderer_with(device, false)
}

/// With normals a software device makes no samples of triangles, whose depths are rounded otherwise.
fn renderer_with(device: &Device, normal: bool) -> VulkanRenderer {
    let outputs = PictureOutputs {
        depth: true,
        normal,
        ..PictureOutputs::default()
    };
    VulkanRenderer::new(device.gpu(), SIZE.0, SIZE.1, outputs, true).unwrap()
}

/// By the rasterizer, without what is hidden left out: the same primitives.
fn on(cut_on: CutOn) -> Settings {
    Settings {
        cut_on,
        path: Path::Raster,
        occlusion: surfel::render::Occlusion::Off,
        threshold_px: 2.0,
        ..Settings::default()
    }
}

fn draw(
    renderer: &mut VulkanRenderer,
    (model, scene): (&Model, &mut DeviceScene),
    view: &View,
    settings: &Settings,
) -> (Image, FrameTimes) {
    let times = renderer.draw(model, scene, view, settings).unwrap();
    (renderer.read(view).unwrap(), times)
}

fn is_on_device(times: &FrameTimes) -> bool {
    times.passes.iter().any(|pass| pass.name == "cut.tree")
}

#[test]
fn the_device_draws_what_the_host_draws() {
    let Some(device) = Device::open() else { return };
    let by_compute = device.paths().len() > 1;
    let models = [
        (GeneratedShape::Statue, 60_000),
        (GeneratedShape::Torus, 30_000),
        (GeneratedShape::Square, 2),
        (GeneratedShape::Square, 3_000),
    ];
    for (shape, triangles) in models {
        let model = generated(shape, triangles);
        let mut scene = DeviceScene::new(device.gpu(), &model).unwrap();
        let mut renderer = renderer_with(&device, true);
        let views = views_around(
            &model,
            SIZE,
            &[(20.0, 0.05), (70.0, 0.5), (130.0, 1.0), (200.0, 3.0)],
        );
        for (index, view) in views.iter().enumerate() {
            for (path, threshold_px, splat, culling) in [
                (Path::Raster, 1.0, SplatKind::Square, Culling::Auto),
                (Path::Raster, 3.0, SplatKind::Disc, Culling::Off),
                (Path::Raster, 9.0, SplatKind::Square, Culling::Off),
                (Path::Raster, 1.0, SplatKind::Ellipse, Culling::Auto),
                (Path::Raster, 3.0, SplatKind::Gauss, Culling::Off),
                (Path::Raster, 4.0, SplatKind::Visibility, Culling::Auto),
                (Path::Compute, 1.0, SplatKind::Square, Culling::Off),
                (Path::Compute, 3.0, SplatKind::Disc, Culling::Auto),
                (Path::Compute, 6.0, SplatKind::Square, Culling::Auto),
                (Path::Compute, 5.0, SplatKind::Ellipse, Culling::Off),
                (Path::Compute, 3.0, SplatKind::Visibility, Culling::Off),
            ] {
                if path == Path::Compute && !by_compute {
                    continue;
                }
                let settings = |cut_on| Settings {
                    path,
                    threshold_px,
                    splat,
                    culling,
                    ..on(cut_on)
                };
                let what = format!(
                    "{shape:?} {triangles}, view {index}, {path:?}, {splat:?} of {threshold_px} px"
                );
                let mut draw = |on| draw(&mut renderer, (&model, &mut scene), view, &settings(on));
                let (host, of_host) = draw(CutOn::Processor);
                let (chosen, of_device) = draw(CutOn::Device);
                assert!(
                    is_on_device(&of_device) && !is_on_device(&of_host),
                    "{what}"
                );
                let is_small = |times: &FrameTimes| {
                    times
                        .passes
                        .iter()
                        .any(|pass| ["compute.splats", "visibility.splats"].contains(&pass.name))
                };
                assert_eq!(is_small(&of_device), path == Path::Compute, "{what}");
                let (a, b) = (of_host.counts, of_device.counts);
                assert_eq!(a.nodes_visited, b.nodes_visited, "{what}");
                // The few that are seen edge-on.
                let most = 2 + (a.splats + a.triangles) / 1000;
                assert!(b.splats.abs_diff(a.splats) <= most, "{what}: {a:?} {b:?}");
                // At a pixel the device leaves them out as well.
                let is_plain = splat == SplatKind::Square;
                let between = if threshold_px > 1.0 || !is_plain {
                    a.between
                } else {
                    0
                };
                let between = a.triangles + between;
                assert!(b.triangles.abs_diff(between) <= most, "{what}: {a:?} {b:?}");
                assert_eq!((of_device.cut_ms, of_device.pack_ms), (0.0, 0.0));
                // Triangles seen edge-on cover what the others do not only where nothing is closed.
                pictures::DEVICE_CUT.assert_same(&host, &chosen, &what);
            }
        }
    }
}

/// Points of clouds, and triangles where they are splats too, have sizes of their own, some of them too large for a point.
#[test]
fn the_device_draws_clouds_and_large_splats() {
    let Some(device) = Device::open() else { return };
    let by_compute = device.paths().len() > 1;
    let models = [
        ("cloud", cloud(GeneratedShape::Statue, 40_000), Method::Pop),
        (
            "few points",
            cloud(GeneratedShape::Sphere, 300),
            Method::Splats,
        ),
        (
            "statue",
            generated(GeneratedShape::Statue, 3_000),
            Method::Splats,
        ),
        (
            "two triangles",
            generated(GeneratedShape::Square, 2),
            Method::Splats,
        ),
    ];
    let mut drawn = [0; 2];
    for (name, model, method) in models {
        let mut scene = DeviceScene::new(device.gpu(), &model).unwrap();
        let mut renderer = renderer_with(&device, true);
        let views = views_around(&model, SIZE, &[(20.0, 0.1), (130.0, 1.0), (200.0, 4.0)]);
        for (index, view) in views.iter().enumerate() {
            for (path, threshold_px, splat, culling) in [
                (Path::Raster, 1.0, SplatKind::Square, Culling::Auto),
                (Path::Raster, 3.0, SplatKind::Disc, Culling::Off),
                (Path::Raster, 2.0, SplatKind::Ellipse, Culling::Auto),
                (Path::Raster, 3.0, SplatKind::Gauss, Culling::Off),
                (Path::Raster, 4.0, SplatKind::Visibility, Culling::Auto),
                (Path::Compute, 1.0, SplatKind::Square, Culling::Off),
                (Path::Compute, 3.0, SplatKind::Disc, Culling::Auto),
                (Path::Compute, 5.0, SplatKind::Ellipse, Culling::Off),
                (Path::Compute, 3.0, SplatKind::Visibility, Culling::Off),
            ] {
                // Compute knows opaque splats of one method.
                let is_known = method == Method::Pop || splat == SplatKind::Visibility;
                if path == Path::Compute && !(by_compute && is_known) {
                    continue;
                }
                let settings = |cut_on| Settings {
                    method,
                    path,
                    threshold_px,
                    splat,
                    culling,
                    ..on(cut_on)
                };
                let what =
                    format!("{name}, view {index}, {path:?}, {splat:?} of {threshold_px} px");
                let mut draw = |on| draw(&mut renderer, (&model, &mut scene), view, &settings(on));
                let (host, of_host) = draw(CutOn::Processor);
                let (chosen, of_device) = draw(CutOn::Device);
                assert!(is_on_device(&of_device), "{what} {:?}", of_device.passes);
                let (a, b) = (of_host.counts, of_device.counts);
                assert_eq!(a.nodes_visited, b.nodes_visited, "{what}");
                // The few that are seen edge-on, and what at a pixel contains no center.
                let most = 2 + a.splats / 1000 + a.between;
                assert!(b.splats.abs_diff(a.splats) <= most, "{what}: {a:?} {b:?}");
                assert_eq!((a.triangles, b.triangles), (0, 0), "{what}");
                drawn[usize::from(path == Path::Compute)] += b.splats;
                pictures::DEVICE_SPLATS.assert_same(&host, &chosen, &what);
            }
        }
    }
    assert!(
        drawn[0] > 10_000 && (drawn[1] > 10_000 || !by_compute),
        "{drawn:?}"
    );
}

/// Filtered splats are points of a cloud, triangles in pieces, and beside them triangles that stay such.
#[test]
fn the_device_draws_filtered_splats() {
    let Some(device) = Device::open() else { return };
    let models = [
        ("cloud", cloud(GeneratedShape::Statue, 40_000)),
        ("statue", generated(GeneratedShape::Statue, 60_000)),
        ("torus", generated(GeneratedShape::Torus, 30_000)),
        ("two triangles", generated(GeneratedShape::Square, 2)),
    ];
    // Splats, and triangles.
    let mut drawn = [0; 2];
    for (name, model) in models {
        let mut scene = DeviceScene::new(device.gpu(), &model).unwrap();
        let mut renderer = renderer(&device);
        let views = views_around(
            &model,
            SIZE,
            &[(20.0, 0.1), (70.0, 0.5), (130.0, 1.0), (200.0, 4.0)],
        );
        for (index, view) in views.iter().enumerate() {
            for (threshold_px, culling, method) in [
                (1.0, Culling::Auto, Method::Pop),
                (3.0, Culling::Off, Method::Pop),
                (1.0, Culling::Off, Method::Splats),
                (6.0, Culling::Auto, Method::Splats),
            ] {
                let settings = |cut_on| Settings {
                    method,
                    threshold_px,
                    culling,
                    splat: SplatKind::Filtered,
                    ..on(cut_on)
                };
                let what = format!("{name}, view {index}, {method:?} of {threshold_px} px");
                let mut draw = |on| draw(&mut renderer, (&model, &mut scene), view, &settings(on));
                let (host, of_host) = draw(CutOn::Processor);
                let (chosen, of_device) = draw(CutOn::Device);
                assert!(is_on_device(&of_device), "{what} {:?}", of_device.passes);
                let (a, b) = (of_host.counts, of_device.counts);
                assert_eq!(a.nodes_visited, b.nodes_visited, "{what}");
                // The few that are seen edge-on. Splats that show nothing the device counts as well.
                let most = 2 + (a.splats + a.triangles) / 1000;
                assert!(b.splats + most >= a.splats, "{what}: {a:?} {b:?}");
                assert!(
                    b.triangles.abs_diff(a.triangles) <= most,
                    "{what}: {a:?} {b:?}"
                );
                drawn[0] += b.splats;
                drawn[1] += b.triangles;
                pictures::DEVICE_FILTERED.assert_same(&host, &chosen, &what);
            }
        }
    }
    assert!(drawn[0] > 100_000 && drawn[1] > 10_000, "{drawn:?}");
}

/// Filtered splats have the light of the frame: they stay only as long as that does.
#[test]
fn filtered_splats_have_the_light_of_their_frame() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 30_000);
    let mut scene = DeviceScene::new(device.gpu(), &model).unwrap();
    let mut renderer = renderer(&device);
    renderer.keep_lists(true);
    let view = orbit(&model, SIZE, 130.0, 25.0, 1.0);
    let usual = Settings {
        splat: SplatKind::Filtered,
        ..on(CutOn::Device)
    };
    let lit = |light| Settings { light, ..usual };
    let by = |color_by| Settings { color_by, ..usual };
    let lamp = lit(SurfaceLighting::Phong(Phong::default()));
    for (index, (settings, is_kept)) in [
        (usual, false),
        (usual, true),
        (lamp, false),
        (lamp, true),
        (lit(SurfaceLighting::Sphere(LitSphere::Studio)), false),
        (by(ColorBy::Primitive), false),
        (by(ColorBy::Normal), false),
        (by(ColorBy::Depth), false),
        (by(ColorBy::Overdraw), false),
        (usual, false),
    ]
    .into_iter()
    .enumerate()
    {
        let of_model = (&model, &mut scene);
        let (chosen, times) = draw(&mut renderer, of_model, &view, &settings);
        assert_eq!(times.kept == KeptWork::Lists, is_kept, "{index}");
        assert_eq!(is_on_device(&times), !is_kept, "{index}");
        let of_host = Settings {
            cut_on: CutOn::Processor,
            ..settings
        };
        let (host, _) = draw(&mut renderer, (&model, &mut scene), &view, &of_host);
        pictures::DEVICE_FILTERED.assert_same(&host, &chosen, &format!("look {index}"));
    }
}

#[test]
fn the_device_cut_is_drawn_in_every_light_and_color() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 60_000);
    let mut scene = DeviceScene::new(device.gpu(), &model).unwrap();
    let mut renderer = renderer(&device);
    let view = orbit(&model, SIZE, 130.0, 25.0, 1.0);
    let lamp = |s: &mut Settings| s.light = SurfaceLighting::Phong(Phong::default());
    let changes: [&dyn Fn(&mut Settings); 12] = [
        &lamp,
        &|s| s.light = SurfaceLighting::Sphere(LitSphere::Studio),
        &|s| s.ambient_occlusion = AmbientOcclusion::On,
        &|s| s.eye_dome = EyeDome::On,
        &|s| s.background_bottom = Some([0.0, 0.2, 0.5]),
        &|s| s.color_by = ColorBy::Primitive,
        &|s| s.color_by = ColorBy::Normal,
        &|s| s.color_by = ColorBy::Depth,
        &|s| s.color_by = ColorBy::Overdraw,
        &|s| (s.blend, s.splat) = (Some(Blend::TwoPass), SplatKind::Disc),
        &|s| (s.shading, s.splat) = (Shading::Deferred, SplatKind::Gauss),
        &|s| (s.color_by, s.splat) = (ColorBy::Classification, SplatKind::Visibility),
    ];
    for (index, change) in changes.into_iter().enumerate() {
        let [host, chosen] = [CutOn::Processor, CutOn::Device].map(|cut_on| {
            let mut settings = on(cut_on);
            change(&mut settings);
            let (image, times) = draw(&mut renderer, (&model, &mut scene), &view, &settings);
            assert_eq!(is_on_device(&times), cut_on == CutOn::Device, "{index}");
            image
        });
        pictures::DEVICE_CUT.assert_same(&host, &chosen, &format!("change {index}"));
    }
}

#[test]
fn a_scan_is_cut_on_the_device() {
    let Some(device) = Device::open() else { return };
    for (name, model) in scans(&["thesis/dragon_vrip_res3.ply.gz"]) {
        let mut scene = DeviceScene::new(device.gpu(), &model).unwrap();
        let mut renderer = renderer(&device);
        for fill in [0.3, 1.0, 2.0] {
            let view = orbit(&model, SIZE, 30.0, 20.0, fill);
            let mut draw = |settings| draw(&mut renderer, (&model, &mut scene), &view, &settings);
            let (host, _) = draw(on(CutOn::Processor));
            let (chosen, of_device) = draw(on(CutOn::Device));
            assert!(is_on_device(&of_device), "{name}");
            pictures::DEVICE_CUT.assert_same(&host, &chosen, &format!("{name}, fill {fill}"));
        }
    }
}

/// A camera that rests keeps the device's lists, one that moves or another model does not.
#[test]
fn lists_stay_on_the_device() {
    let Some(device) = Device::open() else { return };
    let models = [
        generated(GeneratedShape::Statue, 20_000),
        generated(GeneratedShape::Torus, 20_000),
    ];
    let mut scenes = [0, 1].map(|i: usize| DeviceScene::new(device.gpu(), &models[i]).unwrap());
    let mut renderer = renderer(&device);
    renderer.keep_lists(true);
    let settings = on(CutOn::Device);
    let mut first = None;
    for (which, azimuth, is_kept) in [
        (0, 10.0, false),
        (0, 10.0, true),
        (0, 10.0, true),
        (0, 40.0, false),
        (1, 40.0, false),
        (1, 40.0, true),
        (0, 10.0, false),
    ] {
        let view = orbit(&models[which], SIZE, azimuth, 20.0, 0.8);
        let model = (&models[which], &mut scenes[which]);
        let (image, times) = draw(&mut renderer, model, &view, &settings);
        assert_eq!(times.kept == KeptWork::Lists, is_kept);
        assert_eq!(is_on_device(&times), !is_kept);
        assert!(times.counts.splats + times.counts.triangles > 0);
        assert!(times.counts.nodes_visited > 0);
        if (which, azimuth) == (0, 10.0) {
            let first = first.get_or_insert_with(|| image.clone());
            pictures::DEVICE_CUT.assert_same(first, &image, "the same view");
        }
    }
}

/// Costs decide where it is left open, and only of what the device knows.
#[test]
fn costs_decide_what_chooses() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 20_000);
    let mut scene = DeviceScene::new(device.gpu(), &model).unwrap();
    let mut renderer = renderer(&device);
    let view = orbit(&model, SIZE, 10.0, 20.0, 0.8);
    let costs = |host, on_device| {
        Some(DrawCosts {
            node_ns: Some(host),
            device_node_ns: on_device,
            ..DrawCosts::default()
        })
    };
    for (costs, threshold_px, expected) in [
        (None, 2.0, false),
        (costs(4.0, None), 2.0, false),
        (costs(4.0, Some(5.0)), 2.0, false),
        (costs(4.0, Some(1.0)), 2.0, true),
        (costs(4.0, Some(1.0)), 0.5, false),
    ] {
        renderer.set_costs(costs);
        let settings = Settings {
            threshold_px,
            ..on(CutOn::Auto)
        };
        let times = renderer.draw(&model, &mut scene, &view, &settings).unwrap();
        assert_eq!(is_on_device(&times), expected, "{costs:?}, {threshold_px}");
    }
}

#[test]
fn what_the_device_cannot_choose_is_refused_by_name() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 2_000);
    let mut scene = DeviceScene::new(device.gpu(), &model).unwrap();
    let mut renderer = renderer(&device);
    let view = orbit(&model, SIZE, 10.0, 20.0, 0.8);
    let usual = on(CutOn::Device);
    let cases = [
        (
            Settings {
                method: Method::Triangles,
                ..usual
            },
            "--method pop or splats",
        ),
        (
            Settings {
                splat: SplatKind::Gauss,
                path: Path::Compute,
                ..usual
            },
            "--path raster",
        ),
        (
            Settings {
                splat: SplatKind::Filtered,
                path: Path::Compute,
                ..usual
            },
            "--path raster",
        ),
        (
            Settings {
                size: SizeMetric::Nearest,
                ..usual
            },
            "--metric exact",
        ),
        (
            Settings {
                threshold_px: 0.5,
                ..usual
            },
            "at least 1",
        ),
        (
            Settings {
                cut_view: Some(view),
                ..usual
            },
            "held",
        ),
        (
            Settings {
                color_by: ColorBy::Level,
                ..usual
            },
            "levels",
        ),
        (
            Settings {
                threshold_px: 9000.0,
                ..usual
            },
            "points of this size",
        ),
    ];
    let has_compute = device.paths().contains(&Path::Compute);
    for (settings, word) in cases {
        // Without compute that is refused before.
        if settings.path == Path::Compute && !has_compute {
            continue;
        }
        match renderer.draw(&model, &mut scene, &view, &settings) {
            Err(Error::Unsupported { what, why }) => {
                assert!(
                    what.contains("cut on the device") && why.contains(word),
                    "{word}: {why}"
                );
            }
            other => panic!("{word}: {other:?}"),
        }
    }
    // The next frame is drawn all the same.
    let times = renderer.draw(&model, &mut scene, &view, &usual).unwrap();
    assert!(is_on_device(&times));
}
