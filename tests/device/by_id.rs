//! Draw lists that name nodes, leaves and triangles by their numbers: the same pictures as those of records, to the bit on a
//! device that rounds as the host does; fewer bytes; kept for a still camera; refused by name where they cannot be. That
//! numbers become the very records is tested beside the passes (`expand_ids`, `expand_filtered`).

use crate::common::pictures::{self, PictureOracle};
use crate::common::{Device, cloud, generated, orbit, scans, views_around};
use surfel::generate::GeneratedShape;
use surfel::gpu::Error;
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::oriented::splats::SplatRules;
use surfel::pack::lit_sphere::LitSphere;
use surfel::pack::{ColorBy, Phong, SurfaceLighting};
use surfel::patches::{ErrorTolerances, PatchRules};
use surfel::render::PictureOutputs;
use surfel::render::stats::FrameTimes;
use surfel::render::stats::KeptWork;
use surfel::render::vulkan::renderer::VulkanRenderer;
use surfel::render::vulkan::scene::DeviceScene;
use surfel::render::{Blend, Culling, ListOf, Method, Path, Settings, SplatKind};
use surfel::tree::Model;

const SIZE: (u32, u32) = (240, 200);

fn renderer(device: &Device) -> VulkanRenderer {
    let outputs = PictureOutputs {
        depth: true,
        normal: true,
        ..PictureOutputs::default()
    };
    VulkanRenderer::new(device.gpu(), SIZE.0, SIZE.1, outputs, true).unwrap()
}

fn of(list_of: ListOf, settings: Settings) -> Settings {
    Settings {
        list_of,
        ..settings
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

fn has_pass(times: &FrameTimes, name: &str) -> bool {
    times.passes.iter().any(|pass| pass.name == name)
}

/// Whether the device makes records or corners in a frame.
fn makes(times: &FrameTimes) -> bool {
    let passes = [
        "lists.splats",
        "lists.filtered",
        "lists.patches",
        "lists.triangles",
    ];
    passes.iter().any(|name| has_pass(times, name))
}

/// The same colors, depths and normals; where roots round otherwise than the host's, nearly.
fn oracle(device: &Device) -> PictureOracle {
    match device.gpu().info().is_cpu() {
        true => pictures::SAME_BITS,
        false => pictures::IDS_ROUNDED,
    }
}

/// Surfaces of triangles and of needles, and a cloud.
fn models() -> [(&'static str, Model); 3] {
    [
        ("statue", generated(GeneratedShape::Statue, 60_000)),
        ("torus", generated(GeneratedShape::Torus, 30_000)),
        ("cloud", cloud(GeneratedShape::Sphere, 20_000)),
    ]
}

/// Every kind of splat whose records do not depend on the view, by the rasterizer and by compute if the device has it.
fn ways(device: &Device) -> Vec<(&'static str, Settings)> {
    let usual = Settings {
        path: Path::Raster,
        threshold_px: 3.0,
        ..Settings::default()
    };
    let kind = |splat| Settings { splat, ..usual };
    let fuzzy = |splat| Settings {
        blend: Some(Blend::TwoPass),
        ..kind(splat)
    };
    let whole = |settings| Settings {
        method: Method::Splats,
        threshold_px: 6.0,
        ..settings
    };
    let compute = |settings| Settings {
        path: Path::Compute,
        ..settings
    };
    let mut ways = vec![
        ("squares", kind(SplatKind::Square)),
        (
            "squares of a pixel",
            Settings {
                threshold_px: 1.0,
                ..usual
            },
        ),
        ("discs", kind(SplatKind::Disc)),
        ("ellipses", kind(SplatKind::Ellipse)),
        ("visibility", kind(SplatKind::Visibility)),
        ("fuzzy squares", fuzzy(SplatKind::Square)),
        ("Gaussians", fuzzy(SplatKind::Gauss)),
        ("large squares", whole(kind(SplatKind::Square))),
        ("large ellipses", whole(kind(SplatKind::Ellipse))),
        (
            "overdraw",
            Settings {
                color_by: ColorBy::Overdraw,
                ..usual
            },
        ),
        (
            "normals",
            Settings {
                color_by: ColorBy::Normal,
                ..usual
            },
        ),
        ("squares by compute", compute(kind(SplatKind::Square))),
        ("ellipses by compute", compute(kind(SplatKind::Ellipse))),
        (
            "visibility by compute",
            compute(kind(SplatKind::Visibility)),
        ),
    ];
    ways.retain(|(_, settings)| device.paths().contains(&settings.path));
    ways
}

#[test]
fn numbers_draw_what_records_draw() {
    let Some(device) = Device::open() else { return };
    for (name, model) in &models() {
        let mut scene = DeviceScene::new(device.gpu(), model).unwrap();
        let mut renderer = renderer(&device);
        let views = views_around(model, SIZE, &[(20.0, 0.2), (130.0, 1.0), (200.0, 3.0)]);
        for (index, view) in views.iter().enumerate() {
            for (kind, settings) in ways(&device) {
                let what = format!("{kind} of {name}, view {index}");
                let mut draw = |list_of| {
                    let settings = of(list_of, settings);
                    draw(&mut renderer, (model, &mut scene), view, &settings)
                };
                let (records, of_records) = draw(ListOf::Records);
                let (ids, of_ids) = draw(ListOf::Ids);
                oracle(&device).assert_same(&records, &ids, &what);
                let (a, b) = (of_records.counts, of_ids.counts);
                assert_eq!((a.splats, a.triangles), (b.splats, b.triangles), "{what}");
                // 8 bytes of 24 or more a splat, 4 of 12 a triangle.
                assert!(
                    3 * b.draw_list_bytes <= a.draw_list_bytes,
                    "{what}: {a:?} {b:?}"
                );
                for (pass, count) in [("lists.splats", b.splats), ("lists.triangles", b.triangles)]
                {
                    assert!(!has_pass(&of_records, pass), "{what}");
                    assert_eq!(has_pass(&of_ids, pass), count > 0, "{what}: {pass}");
                }
            }
        }
    }
}

/// Filtered splats by the rasterizer and by compute, and whether the device computes their colors without powers.
fn filtered_ways(device: &Device) -> Vec<(&'static str, Settings, bool)> {
    let usual = Settings {
        path: Path::Raster,
        splat: SplatKind::Filtered,
        threshold_px: 2.0,
        ..Settings::default()
    };
    let of_pixel = Settings {
        threshold_px: 1.0,
        ..usual
    };
    let whole = Settings {
        method: Method::Splats,
        threshold_px: 6.0,
        ..usual
    };
    let both_sides = Settings {
        culling: Culling::Off,
        ..usual
    };
    let lit = |light| Settings { light, ..usual };
    let by = |color_by| Settings { color_by, ..usual };
    let compute = |settings| Settings {
        path: Path::Compute,
        ..settings
    };
    let sphere = SurfaceLighting::Sphere(LitSphere::Clay);
    let lamp = SurfaceLighting::Phong(Phong::default());
    let mut ways = vec![
        ("filtered", usual, true),
        ("filtered of a pixel", of_pixel, true),
        ("all filtered", whole, true),
        ("filtered of both sides", both_sides, true),
        ("overdraw of filtered", by(ColorBy::Overdraw), true),
        ("depths of filtered", by(ColorBy::Depth), false),
        ("filtered in a lamp", lit(lamp), false),
        ("filtered by compute", compute(usual), true),
        ("all filtered by compute", compute(whole), true),
        ("filtered sphere by compute", compute(lit(sphere)), false),
    ];
    ways.retain(|(_, settings, _)| device.paths().contains(&settings.path));
    ways
}

#[test]
fn numbers_draw_the_filtered_splats_that_records_draw() {
    let Some(device) = Device::open() else { return };
    let outputs = pictures::with_depth(false);
    for (name, model) in &models() {
        let mut scene = DeviceScene::new(device.gpu(), model).unwrap();
        let mut renderer =
            VulkanRenderer::new(device.gpu(), SIZE.0, SIZE.1, outputs, true).unwrap();
        let views = views_around(model, SIZE, &[(20.0, 0.2), (130.0, 1.0), (200.0, 3.0)]);
        for (index, view) in views.iter().enumerate() {
            for (kind, settings, is_exact) in filtered_ways(&device) {
                let what = format!("{kind} of {name}, view {index}");
                let mut draw = |list_of| {
                    let settings = of(list_of, settings);
                    draw(&mut renderer, (model, &mut scene), view, &settings)
                };
                let (records, of_records) = draw(ListOf::Records);
                let (ids, of_ids) = draw(ListOf::Ids);
                let oracle = match is_exact {
                    true => oracle(&device),
                    false => pictures::IDS_ROUNDED,
                };
                oracle.assert_same(&records, &ids, &what);
                let (a, b) = (of_records.counts, of_ids.counts);
                // Numbers of what covers nothing are in the list.
                assert!(a.splats <= b.splats, "{what}: {a:?} {b:?}");
                assert_eq!(a.triangles, b.triangles, "{what}");
                // 8 bytes of 48 a splat, 4 of 12 a triangle.
                assert!(
                    2 * b.draw_list_bytes <= a.draw_list_bytes,
                    "{what}: {a:?} {b:?}"
                );
                assert!(!makes(&of_records), "{what}");
                assert_eq!(has_pass(&of_ids, "lists.filtered"), b.splats > 0, "{what}");
            }
        }
    }
}

/// Patches of a cut by error by the rasterizer and by compute.
fn patch_ways(device: &Device) -> Vec<(&'static str, Settings)> {
    let tolerances = ErrorTolerances {
        rim_px: 0.25,
        inside_px: 0.5,
        shade_levels: 16.0,
    };
    let rules = |tiny_polygons| PatchRules {
        tolerances,
        is_strict: false,
        tiny_polygons,
        covers_rims: true,
    };
    let usual = |tiny_polygons| Settings {
        path: Path::Raster,
        patches: Some(rules(tiny_polygons)),
        ..Settings::default()
    };
    let compute = Settings {
        path: Path::Compute,
        ..usual(false)
    };
    let normals = Settings {
        color_by: ColorBy::Normal,
        culling: Culling::Off,
        ..usual(false)
    };
    let mut ways = vec![
        ("patches", usual(false)),
        ("patches below a pixel", usual(true)),
        ("normals of patches", normals),
        ("patches by compute", compute),
    ];
    ways.retain(|(_, settings)| device.paths().contains(&settings.path));
    ways
}

#[test]
fn numbers_draw_the_patches_that_records_draw() {
    let Some(device) = Device::open() else { return };
    let models = models();
    let surfaces = models.iter().filter(|(_, model)| model.kind().is_surface());
    for (name, model) in surfaces {
        let mut scene = DeviceScene::new(device.gpu(), model).unwrap();
        let mut renderer = renderer(&device);
        let views = views_around(model, SIZE, &[(20.0, 0.2), (130.0, 1.0), (200.0, 3.0)]);
        for (index, view) in views.iter().enumerate() {
            for (kind, settings) in patch_ways(&device) {
                let what = format!("{kind} of {name}, view {index}");
                let mut draw = |list_of| {
                    let settings = of(list_of, settings);
                    draw(&mut renderer, (model, &mut scene), view, &settings)
                };
                let (records, of_records) = draw(ListOf::Records);
                let (ids, of_ids) = draw(ListOf::Ids);
                oracle(&device).assert_same(&records, &ids, &what);
                let (a, b) = (of_records.counts, of_ids.counts);
                let patches = a.patches.patches();
                assert_eq!(
                    (a.splats, a.triangles, a.patches),
                    (b.splats, b.triangles, b.patches),
                    "{what}"
                );
                assert!(patches > 100, "{what}: {a:?}");
                // 4 bytes of 152 a patch, 8 of 24 a splat, 4 of 12 a triangle.
                let most = a.draw_list_bytes / 3 - patches * (152 / 3 - 4);
                assert!(b.draw_list_bytes <= most, "{what}: {a:?} {b:?}");
                assert!(!makes(&of_records), "{what}");
                assert_eq!(has_pass(&of_ids, "lists.patches"), patches > 0, "{what}");
            }
        }
    }
}

#[test]
fn a_scan_is_drawn_by_numbers() {
    let Some(device) = Device::open() else { return };
    for (name, model) in scans(&["thesis/dragon_vrip_res3.ply.gz"]) {
        let mut scene = DeviceScene::new(device.gpu(), &model).unwrap();
        let mut renderer = renderer(&device);
        let view = orbit(&model, SIZE, 30.0, 20.0, 1.0);
        for (kind, settings) in ways(&device) {
            let mut draw = |list_of| {
                let settings = of(list_of, settings);
                draw(&mut renderer, (&model, &mut scene), &view, &settings).0
            };
            let (records, ids) = (draw(ListOf::Records), draw(ListOf::Ids));
            oracle(&device).assert_same(&records, &ids, &format!("{kind} of {name}"));
        }
    }
}

/// A camera that rests keeps what was made of numbers; one that moves, another model and lists of records do not.
#[test]
fn what_was_made_of_numbers_stays() {
    let Some(device) = Device::open() else { return };
    let models = [
        generated(GeneratedShape::Statue, 20_000),
        generated(GeneratedShape::Torus, 20_000),
    ];
    let mut scenes = [0, 1].map(|i: usize| DeviceScene::new(device.gpu(), &models[i]).unwrap());
    let mut renderer = renderer(&device);
    renderer.keep_lists(true);
    let usual = Settings {
        path: Path::Raster,
        threshold_px: 2.0,
        ..Settings::default()
    };
    let mut first = None;
    // Reading a picture back takes the other slot of the ring: all frames have the same one.
    let frames = [
        (0, 10.0, ListOf::Ids, true),
        (0, 10.0, ListOf::Ids, false),
        (0, 10.0, ListOf::Ids, false),
        (0, 40.0, ListOf::Ids, true),
        (0, 10.0, ListOf::Records, false),
        (0, 10.0, ListOf::Ids, true),
        (1, 10.0, ListOf::Ids, true),
        (1, 10.0, ListOf::Ids, false),
        (0, 10.0, ListOf::Ids, true),
    ];
    for (index, (which, azimuth, list_of, is_made)) in frames.into_iter().enumerate() {
        let view = orbit(&models[which], SIZE, azimuth, 20.0, 0.8);
        let model = (&models[which], &mut scenes[which]);
        let (image, times) = draw(&mut renderer, model, &view, &of(list_of, usual));
        assert_eq!(makes(&times), is_made, "frame {index}");
        let is_kept = list_of == ListOf::Ids && !is_made;
        assert_eq!(times.kept == KeptWork::Lists, is_kept, "frame {index}");
        if (which, azimuth) == (0, 10.0) {
            let first = first.get_or_insert_with(|| image.clone());
            oracle(&device).assert_same(first, &image, "the same view");
        }
    }
}

#[test]
fn what_numbers_cannot_say_is_refused_by_name() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 20_000);
    let mut scene = DeviceScene::new(device.gpu(), &model).unwrap();
    let mut renderer = VulkanRenderer::new(
        device.gpu(),
        SIZE.0,
        SIZE.1,
        PictureOutputs::default(),
        true,
    )
    .unwrap();
    let view = orbit(&model, SIZE, 10.0, 20.0, 0.8);
    let usual = Settings {
        path: Path::Raster,
        list_of: ListOf::Ids,
        threshold_px: 2.0,
        ..Settings::default()
    };
    let mut cases = vec![
        (
            Settings {
                method: Method::Triangles,
                ..usual
            },
            "no lists",
        ),
        (
            Settings {
                splat: SplatKind::Filtered,
                color_by: ColorBy::Level,
                ..usual
            },
            "level",
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
                color_by: ColorBy::Level,
                ..usual
            },
            "level",
        ),
        (
            Settings {
                cut_view: Some(view),
                ..usual
            },
            "held cut",
        ),
        (
            Settings {
                method: Method::Splats,
                vertex_splats: Some(SplatRules::default()),
                ..usual
            },
            "no lists",
        ),
    ];
    let has_compute = device.paths().contains(&Path::Compute);
    // Without compute that is refused before.
    cases.retain(|(settings, _)| has_compute || settings.path != Path::Compute);
    for (settings, word) in cases {
        match renderer.draw(&model, &mut scene, &view, &settings) {
            Err(Error::Unsupported { what, why }) => assert!(
                what.contains("lists of ids") && why.contains(word),
                "{word}: {why}"
            ),
            other => panic!("{word}: {other:?}"),
        }
        // Left open, it is drawn by records.
        let settings = of(ListOf::Auto, settings);
        let times = renderer.draw(&model, &mut scene, &view, &settings).unwrap();
        assert!(!makes(&times), "{word}");
    }
    // A scene in several pages has no tree on the device.
    let mut pages = DeviceScene::with_page_limits(device.gpu(), &model, 4000, 6000).unwrap();
    let refused = renderer.draw(&model, &mut pages, &view, &usual);
    assert!(
        matches!(&refused, Err(Error::Unsupported { what, .. }) if what.contains("tree")),
        "{refused:?}"
    );
    // The next frame is drawn all the same.
    let times = renderer.draw(&model, &mut scene, &view, &usual).unwrap();
    assert!(has_pass(&times, "lists.splats"));
}
