//! Small primitives by compute and by the rasterizer: the same picture.

mod ellipses;
mod large;
mod lit;
mod visibility;

use crate::common::pictures;
use crate::common::{Device, generated, orbit, scans};
use surfel::generate::{GeneratedShape, ShapeSpec};
use surfel::gpu::Error;
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::mesh::Mesh;
use surfel::pack::{ColorBy, Phong, SurfaceLighting};
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Blend, Culling, Method, Path, Settings, Shading, SplatKind, SumFormat};
use surfel::tree::Model;

/// Sums have no normal.
fn draw(device: &Device, model: &Model, view: &View, settings: &Settings) -> Result<Image, Error> {
    let backend = Backend::Device(device.gpu().clone());
    let has_normals = settings.splat != SplatKind::Filtered && settings.blend() == Blend::Opaque;
    let outputs = pictures::with_depth(has_normals);
    pictures::draw(&backend, model, view, settings, outputs)
}

/// Compute draws what the rasterizer draws.
fn assert_same(device: &Device, model: &Model, view: &View, settings: Settings, what: &str) {
    let [raster, compute] = [Path::Raster, Path::Compute]
        .map(|path| draw(device, model, view, &Settings { path, ..settings }).unwrap());
    let is_pushed = settings.blend == Some(Blend::TwoPass);
    let oracle = match is_pushed {
        true => pictures::COMPUTE_AS_RASTER_PUSHED,
        false => pictures::COMPUTE_AS_RASTER,
    };
    oracle.seen_in(view).assert_same(&raster, &compute, what);
}

/// What is blended, by compute as well as by the rasterizer.
fn blended() -> Vec<Settings> {
    let two_pass = |splat| Settings {
        splat,
        blend: Some(Blend::TwoPass),
        ..Settings::default()
    };
    let filtered = Settings {
        splat: SplatKind::Filtered,
        ..Settings::default()
    };
    vec![
        filtered,
        two_pass(SplatKind::Gauss),
        two_pass(SplatKind::Ellipse),
        two_pass(SplatKind::Disc),
        two_pass(SplatKind::Square),
    ]
}

#[test]
fn compute_and_rasterizer_draw_the_same_picture() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    for shape in [
        GeneratedShape::Statue,
        GeneratedShape::Torus,
        GeneratedShape::Square,
    ] {
        let model = generated(shape, 60_000);
        for (threshold_px, fill) in [(0.0, 1.0), (1.0, 0.3), (1.0, 1.0), (3.0, 1.0), (5.5, 2.5)] {
            for culling in [Culling::Auto, Culling::Off] {
                let settings = Settings {
                    threshold_px,
                    culling,
                    ..Settings::default()
                };
                let view = orbit(&model, (240, 200), 30.0, 20.0, fill);
                let what = format!("{shape:?}, threshold {threshold_px}, fill {fill}, {culling:?}");
                assert_same(&device, &model, &view, settings, &what);
            }
        }
    }
}

fn discs(threshold_px: f32) -> Settings {
    Settings {
        splat: SplatKind::Disc,
        threshold_px,
        ..Settings::default()
    }
}

fn built(mesh: Mesh) -> Model {
    let options = surfel::tree::BuildOptions::default();
    surfel::tree::build(mesh, &options, &surfel::progress::SilentProgress).unwrap()
}

/// A statue of 30,000 triangles, in colors.
fn colored() -> Mesh {
    let mut mesh =
        surfel::generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Statue, 30_000).unwrap());
    let shade = |x: f32| (x * 127.0 + 128.0) as u8;
    let colors = mesh.positions.iter();
    mesh.colors = colors.map(|p| [shade(p.x), 90, shade(p.z), 255]).collect();
    mesh
}

/// Its points.
fn colored_cloud() -> Model {
    let mut mesh = colored();
    mesh.triangles.clear();
    built(mesh)
}

/// The picture, its depths, the passes that drew it, and how many triangles are in it.
fn passes(
    engine: &mut Engine<'_>,
    view: &View,
    settings: &Settings,
) -> (Image, Vec<&'static str>, u64) {
    let times = engine.draw(view, settings).unwrap();
    let passes = times.passes.iter().map(|pass| pass.name).collect();
    (engine.read(view).unwrap(), passes, times.counts.triangles)
}

/// The processor's renderer, which needs no device, and what a device draws by compute or where that cannot by the
/// rasterizer. It says what it cannot draw.
#[test]
fn the_processor_draws_what_the_device_does() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let colored = colored();
    let mut cloud = colored.clone();
    cloud.triangles.clear();
    let models = [
        ("statue", generated(GeneratedShape::Statue, 60_000)),
        ("torus", generated(GeneratedShape::Torus, 60_000)),
        ("few", generated(GeneratedShape::Sphere, 500)),
        ("colored", built(colored)),
        ("cloud", built(cloud)),
    ];
    let size = (240, 200);
    let outputs = pictures::with_depth(false);
    let on_device = Backend::Vulkan(device.gpu().clone());
    let (mut drawn, mut with_triangles, mut tinted, mut strict) = (0, 0, 0, 0);
    for (name, model) in &models {
        let engine = |backend| Engine::new(backend, model, size, outputs).unwrap();
        let (mut theirs, mut ours) = (engine(&on_device), engine(&Backend::Cpu));
        let mut part = orbit(model, size, 30.0, 20.0, 1.3);
        part.offset = [0.9, -0.7];
        for (view_name, view) in [
            ("near", orbit(model, size, 30.0, 20.0, 1.0)),
            ("inside", orbit(model, size, 30.0, 20.0, 5.0)),
            ("far", orbit(model, size, 80.0, -10.0, 0.2)),
            ("part", part),
            ("orthographic", crate::common::orthographic(model, size)),
        ] {
            // Points before the eye are quads to a device, whose corners are rounded, not their centers.
            if (*name, view_name) == ("cloud", "inside") {
                continue;
            }
            for ((threshold_px, culling, color_by), splat) in [
                (1.0, Culling::Auto, ColorBy::Shading),
                (2.5, Culling::Auto, ColorBy::Primitive),
                (4.0, Culling::Off, ColorBy::Shading),
                (0.6, Culling::Auto, ColorBy::Shading),
            ]
            .into_iter()
            .flat_map(|how| {
                let kinds = [SplatKind::Filtered, SplatKind::Square, SplatKind::Disc];
                kinds.map(|kind| (how, kind))
            }) {
                let settings = Settings {
                    splat,
                    threshold_px,
                    culling,
                    color_by,
                    background: [0.1, 0.2, 0.3],
                    path: Path::Compute,
                    ..Settings::default()
                };
                let (mut wanted, others, _) = passes(&mut theirs, &view, &settings);
                if splat != SplatKind::Filtered && others.contains(&"opaque.splats") {
                    // What compute leaves as too large are quads, whose corners are rounded, not their centers.
                    let by_raster = Settings {
                        path: Path::Raster,
                        ..settings
                    };
                    wanted = passes(&mut theirs, &view, &by_raster).0;
                }
                let (picture, own, triangles) = passes(&mut ours, &view, &settings);
                let what = format!("{name}, {view_name}, {splat:?}, {threshold_px}, {color_by:?}");
                assert!(own.is_empty(), "{what}: {own:?}");
                assert!(wanted.color.iter().any(|c| c[3] > 0), "{what}: empty");
                let are_splats_by_compute = splat != SplatKind::Filtered
                    && triangles == 0
                    && !others.iter().any(|pass| pass.starts_with("opaque."));
                strict += usize::from(are_splats_by_compute);
                let oracle = match are_splats_by_compute && !crate::common::is_card() {
                    true => pictures::CPU_AS_COMPUTE,
                    false => pictures::CPU_AS_DEVICE,
                };
                oracle.assert_same(&wanted, &picture, &what);
                drawn += 1;
                with_triangles += usize::from(triangles > 0);
                tinted += usize::from(color_by == ColorBy::Primitive && triangles > 0);
            }
        }
        let view = orbit(model, size, 30.0, 20.0, 1.0);
        lit::assert_same(&mut theirs, &mut ours, &view, name);
    }
    println!("{drawn} pictures, {with_triangles} with triangles, {tinted} of these tinted");
    println!("{strict} of splats alone by compute");
    assert!(strict >= 20, "{strict}");
    assert!(drawn == 288 && with_triangles >= 120 && tinted >= 20);
}

#[test]
fn opaque_discs_are_the_same_by_compute_by_the_rasterizer_and_on_the_mirror() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let mut mesh =
        surfel::generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Statue, 30_000).unwrap());
    mesh.triangles.clear();
    let cloud = built(mesh);
    let statue = generated(GeneratedShape::Statue, 60_000);
    let torus = generated(GeneratedShape::Torus, 60_000);
    let size = (400, 320);
    // Below a diameter of sqrt(2) a disc is a square. Triangles among the discs; beside the picture; points of sizes of
    // their own; from inside.
    for (model, threshold_px, fill) in [
        (&statue, 1.0, 0.3),
        (&statue, 1.4, 0.3),
        (&statue, 1.42, 0.3),
        (&statue, 3.0, 0.7),
        (&statue, 3.0, 2.5),
        (&torus, 4.5, 1.0),
        (&statue, 6.0, 1.5),
        (&cloud, 2.0, 1.0),
        (&cloud, 3.0, 4.0),
        (&statue, 4.0, 60.0),
    ] {
        let settings = discs(threshold_px);
        let view = orbit(model, size, 30.0, 20.0, fill);
        let what = format!("threshold {threshold_px}, fill {fill}");
        assert_same(&device, model, &view, settings, &what);
        let compute = Settings {
            path: Path::Compute,
            ..settings
        };
        let picture = draw(&device, model, &view, &compute).unwrap();
        let mirror = Engine::new(
            &Backend::Reference,
            model,
            size,
            PictureOutputs {
                depth: true,
                normal: false,
                values: false,
            },
        )
        .unwrap()
        .with_subpixel_bits(device.gpu().info().subpixel_bits)
        .render(&view, &settings)
        .unwrap();
        let picture = Image {
            normal: Vec::new(),
            ..picture
        };
        pictures::REFERENCE_OUTLINES.assert_same(&mirror, &picture, &what);
    }
}

#[test]
fn opaque_discs_are_the_same_in_every_projection_and_light() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let model = generated(GeneratedShape::Statue, 60_000);
    let size = (240, 200);
    let view = orbit(&model, size, 30.0, 20.0, 0.7);
    let mut mirrored = view;
    mirrored.scale[0] = -mirrored.scale[0];
    mirrored.offset[0] = -mirrored.offset[0];
    let orthographic = crate::common::orthographic(&model, size);
    for (name, view) in [
        ("perspective", view),
        ("mirrored", mirrored),
        ("orthographic", orthographic),
    ] {
        for threshold_px in [2.0, 3.5] {
            let plain = discs(threshold_px);
            assert_same(&device, &model, &view, plain, name);
            let colored = Settings {
                color_by: ColorBy::Primitive,
                culling: Culling::Off,
                two_sided: false,
                background: [1.0, 0.5, 0.0],
                ..plain
            };
            assert_same(&device, &model, &view, colored, &format!("{name}, by kind"));
        }
    }
}

/// Asserts of the statue, for each fill, threshold and path, whether a frame of these settings has any of these passes.
fn assert_ways(
    settings: impl Fn(f32) -> Settings,
    any: &[&str],
    wanted: &[(f64, f32, Path, bool)],
) {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let model = generated(GeneratedShape::Statue, 60_000);
    let backend = Backend::Vulkan(device.gpu().clone());
    for &(fill, threshold_px, path, is_wanted) in wanted {
        let view = orbit(&model, (200, 200), 30.0, 20.0, fill);
        let mut engine =
            Engine::new(&backend, &model, (200, 200), PictureOutputs::default()).unwrap();
        let settings = Settings {
            path,
            ..settings(threshold_px)
        };
        let (_, passes, _) = passes(&mut engine, &view, &settings);
        let what = format!("{fill}, {threshold_px}, {path:?}: {passes:?}");
        let is_there = passes.iter().any(|pass| any.contains(pass));
        assert_eq!(is_there, is_wanted, "{what}");
    }
}

/// A view full of small discs is drawn by compute unless it is asked not to, and one of a few pixels is not, nor are large
/// discs.
#[test]
fn discs_go_by_compute_where_that_pays() {
    assert_ways(
        discs,
        &["compute.resolve"],
        &[
            (1.0, 2.0, Path::Auto, true),
            (1.0, 2.0, Path::Raster, false),
            (1.0, 6.5, Path::Auto, false),
            (1.0, 6.5, Path::Raster, false),
            (0.01, 2.0, Path::Auto, false),
            (0.01, 2.0, Path::Compute, true),
        ],
    );
}

#[test]
fn blended_splats_are_the_same_at_every_threshold() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let model = generated(GeneratedShape::Statue, 60_000);
    // Above the largest that compute draws the path is the same; the last view has triangles among the splats.
    for (threshold_px, fill) in [
        (1.0, 0.1),
        (2.0, 1.0),
        (3.0, 0.7),
        (4.5, 1.0),
        (6.0, 1.5),
        (1.0, 3.0),
    ] {
        for settings in blended() {
            let settings = Settings {
                threshold_px,
                ..settings
            };
            let view = orbit(&model, (240, 200), 30.0, 20.0, fill);
            let what = format!(
                "{:?}, threshold {threshold_px}, fill {fill}",
                settings.splat
            );
            assert_same(&device, &model, &view, settings, &what);
        }
    }
}

#[test]
fn blended_splats_of_every_size_light_and_projection_are_the_same() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let model = generated(GeneratedShape::Statue, 5_000);
    let view = orbit(&model, (240, 200), 30.0, 20.0, 2.0);
    let far = orbit(&model, (240, 200), 30.0, 20.0, 0.5);
    let mut mirrored = far;
    mirrored.scale[0] = -mirrored.scale[0];
    mirrored.offset[0] = -mirrored.offset[0];
    for settings in blended() {
        let kind = settings.splat;
        // Every leaf is a splat of its own size: from a pixel to more than compute draws.
        let whole = Settings {
            method: Method::Splats,
            ..settings
        };
        assert_same(&device, &model, &view, whole, &format!("{kind:?}, leaves"));
        let lit = Settings {
            light: SurfaceLighting::Phong(Phong::default()),
            background: [1.0, 0.5, 0.0],
            ..settings
        };
        assert_same(&device, &model, &far, lit, &format!("{kind:?}, lamp"));
        let colored = Settings {
            color_by: ColorBy::Primitive,
            threshold_px: 2.0,
            culling: Culling::Off,
            ..settings
        };
        assert_same(
            &device,
            &model,
            &mirrored,
            colored,
            &format!("{kind:?}, by kind"),
        );
    }
}

fn visible(threshold_px: f32) -> Settings {
    Settings {
        splat: SplatKind::Visibility,
        threshold_px,
        background: [0.2, 0.4, 0.6],
        ..Settings::default()
    }
}

#[test]
fn a_frame_by_compute_is_the_same_again() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let model = generated(GeneratedShape::Statue, 200_000);
    let view = orbit(&model, (300, 300), 30.0, 20.0, 1.0);
    for settings in blended().into_iter().chain([visible(2.0)]) {
        let settings = Settings {
            path: Path::Compute,
            ..settings
        };
        let first = draw(&device, &model, &view, &settings).unwrap();
        for _ in 0..3 {
            let again = draw(&device, &model, &view, &settings).unwrap();
            assert_eq!(first, again, "{:?}", settings.splat);
        }
    }
}

#[test]
fn a_mirrored_camera_and_a_camera_inside_the_model_draw_the_same_too() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let model = generated(GeneratedShape::Statue, 60_000);
    let mut view = orbit(&model, (240, 200), 30.0, 20.0, 1.0);
    view.scale[0] = -view.scale[0];
    view.offset[0] = -view.offset[0];
    // Triangles that reach the near plane go to the rasterizer on either path.
    let inside = orbit(&model, (240, 200), 30.0, 20.0, 60.0);
    assert_same(&device, &model, &view, Settings::default(), "mirrored");
    assert_same(&device, &model, &inside, Settings::default(), "inside");
}

#[test]
fn scans_and_real_models_with_colors_draw_the_same() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    for (name, model) in scans(&[
        "thesis/horse.ply",
        "meshes/ankylosaurus_mesh.ply.gz",
        "meshes/bun_zipper.ply.gz",
    ]) {
        let view = orbit(&model, (300, 300), 200.0, -10.0, 1.0);
        assert_same(&device, &model, &view, Settings::default(), &name);
        assert_same(&device, &model, &view, discs(2.0), &name);
        assert_same(&device, &model, &view, visible(2.0), &name);
        for settings in blended() {
            let what = format!("{name}, {:?}", settings.splat);
            assert_same(&device, &model, &view, settings, &what);
        }
    }
}

#[test]
fn what_compute_cannot_draw_is_refused_by_name_only_where_it_is_insisted_on() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 5_000);
    let view = orbit(&model, (64, 64), 30.0, 20.0, 1.0);
    for settings in [
        Settings {
            threshold_px: 7.0,
            ..Settings::default()
        },
        discs(6.5),
        Settings {
            method: Method::Splats,
            ..discs(3.0)
        },
        Settings {
            splat: SplatKind::Ellipse,
            threshold_px: 10.5,
            ..Settings::default()
        },
        Settings {
            splat: SplatKind::Ellipse,
            method: Method::Splats,
            ..Settings::default()
        },
        Settings {
            method: Method::Points,
            ..Settings::default()
        },
        Settings {
            method: Method::Triangles,
            splat: SplatKind::Square,
            ..Settings::default()
        },
        Settings {
            splat: SplatKind::Filtered,
            threshold_px: 17.0,
            ..Settings::default()
        },
        Settings {
            splat: SplatKind::Gauss,
            method: Method::Points,
            ..Settings::default()
        },
        Settings {
            splat: SplatKind::Gauss,
            shading: Shading::Deferred,
            ..Settings::default()
        },
        Settings {
            splat: SplatKind::Gauss,
            sums: Some(SumFormat::Half),
            ..Settings::default()
        },
        Settings {
            splat: SplatKind::Visibility,
            method: Method::Points,
            ..Settings::default()
        },
        Settings {
            splat: SplatKind::Visibility,
            threshold_px: 17.0,
            ..Settings::default()
        },
    ] {
        assert!(draw(&device, &model, &view, &settings).is_ok());
        let insisting = Settings {
            path: Path::Compute,
            ..settings
        };
        let error = draw(&device, &model, &view, &insisting).unwrap_err();
        assert!(
            matches!(&error, Error::Unsupported { what, .. } if *what == "drawing by compute"),
            "{error}"
        );
    }
}
