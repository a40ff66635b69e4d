//! Several models in one picture: every backend draws parts as the reference does, mixed ones too, and leaves out what is
//! hidden.

use crate::common::pictures::{self, PictureOracle};
use crate::common::{Device, orbit, orthographic};
use glam::{DVec3, Vec3};
use surfel::generate::{GeneratedShape, ShapeSpec};
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::mesh::Mesh;
use surfel::mesh::attributes::{
    AttributeColumn, AttributeKind, AttributeValues, NumberType, PointAttributes,
};
use surfel::pack::ColorBy;
use surfel::progress::SilentProgress;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{ListOf, Method, Path, PictureOutputs, Settings, SplatKind};
use surfel::tree::{self, BuildOptions, Model};

const SIZE: (u32, u32) = (240, 200);

fn built(mesh: Mesh) -> Model {
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

fn mesh(shape: GeneratedShape, triangles: u64) -> Mesh {
    surfel::generate::mesh(&ShapeSpec::with_triangles(shape, triangles).unwrap())
}

/// The triangles of a mesh whose first corner is on one side of x = 0.
fn half(mesh: &Mesh, is_left: bool) -> Mesh {
    let mut half = mesh.clone();
    let of = |corner: u32| mesh.positions[corner as usize].x < 0.0;
    half.triangles.retain(|triangle| of(triangle[0]) == is_left);
    half
}

/// The halves of a statue, of which one has colors, and a cloud around its foot.
fn models() -> Vec<Model> {
    let statue = mesh(GeneratedShape::Statue, 30_000);
    let mut left = half(&statue, true);
    let shade = |x: f32| (x * 127.0 + 128.0) as u8;
    let colors = left.positions.iter();
    left.colors = colors.map(|p| [shade(p.x), 90, shade(p.z), 255]).collect();
    let mut cloud = mesh(GeneratedShape::Torus, 6_000);
    cloud.triangles.clear();
    for position in &mut cloud.positions {
        *position += Vec3::new(0.3, -0.4, 0.5);
    }
    vec![built(left), built(half(&statue, false)), built(cloud)]
}

fn views(model: &Model) -> [(&'static str, View); 3] {
    let mut part = orbit(model, SIZE, 30.0, 20.0, 1.3);
    part.offset = [0.4, -0.3];
    [
        ("near", orbit(model, SIZE, 40.0, 25.0, 0.6)),
        ("part", part),
        ("orthographic", orthographic(model, SIZE)),
    ]
}

fn settings_of(method: Method, splat: SplatKind, threshold_px: f32) -> Settings {
    Settings {
        method,
        splat,
        threshold_px,
        background: [0.1, 0.2, 0.3],
        ..Settings::default()
    }
}

/// Every technique, with what it is held to.
fn ways() -> Vec<(Settings, PictureOracle)> {
    use SplatKind::{Disc, Ellipse, Filtered, Gauss, Square, Visibility};
    let surface = pictures::REFERENCE_LAYERS;
    let splats = pictures::REFERENCE_SNAPPED_SPLATS;
    let mut ways = vec![
        (settings_of(Method::Triangles, Square, 1.0), surface),
        (settings_of(Method::Points, Square, 2.0), surface),
        (settings_of(Method::Pop, Square, 1.0), surface),
        (settings_of(Method::Pop, Square, 4.5), splats),
        (settings_of(Method::Pop, Disc, 3.0), splats),
        (settings_of(Method::Splats, Square, 2.0), splats),
        (settings_of(Method::Pop, Ellipse, 4.0), splats),
        (
            settings_of(Method::Pop, Gauss, 4.0),
            pictures::REFERENCE_BLENDED,
        ),
        (
            settings_of(Method::Pop, Filtered, 2.0),
            pictures::REFERENCE_FILTERED,
        ),
        (
            settings_of(Method::Splats, Filtered, 3.0),
            pictures::REFERENCE_FILTERED,
        ),
        (
            settings_of(Method::Pop, Visibility, 3.0),
            pictures::REFERENCE_RECONSTRUCTION,
        ),
    ];
    for color_by in [ColorBy::Depth, ColorBy::Level] {
        let by_data = Settings {
            color_by,
            ..settings_of(Method::Pop, Square, 3.0)
        };
        ways.push((by_data, pictures::REFERENCE_DATA));
    }
    ways
}

fn outputs() -> PictureOutputs {
    pictures::with_depth(false)
}

fn picture(
    backend: &Backend,
    models: &[&Model],
    view: &View,
    settings: &Settings,
) -> Option<Image> {
    let engine = Engine::of_models(backend, models, SIZE, outputs()).unwrap();
    let mut engine = match backend {
        Backend::Reference => engine.with_subpixel_bits(crate::common::subpixel_bits()),
        _ => engine,
    };
    engine.render(view, settings).ok()
}

/// Draws every way by a backend and holds it to the reference; how many pictures it refused.
fn hold_to_reference(backend: &Backend, models: &[&Model], path: Path) -> usize {
    let mut refused = 0;
    for (name, view) in views(models[0]) {
        for (settings, oracle) in ways() {
            let settings = Settings { path, ..settings };
            let what = format!("{name}, {settings:?}");
            let Some(drawn) = picture(backend, models, &view, &settings) else {
                refused += 1;
                continue;
            };
            let plain = Settings {
                path: Path::Auto,
                ..settings
            };
            let wanted = picture(&Backend::Reference, models, &view, &plain).unwrap();
            oracle.assert_same(&wanted, &drawn, &what);
        }
    }
    refused
}

#[test]
fn the_processor_draws_parts_as_the_reference_does() {
    let models = models();
    let all: Vec<&Model> = models.iter().collect();
    // It has no points, fuzzy and visibility splats.
    assert_eq!(hold_to_reference(&Backend::Cpu, &all, Path::Auto), 3 * 3);
    // Of surfaces alone splats have one size, and are drawn from the cuts themselves.
    assert_eq!(
        hold_to_reference(&Backend::Cpu, &all[..2], Path::Auto),
        3 * 3
    );
}

#[test]
fn a_device_draws_parts_as_the_reference_does() {
    let Some(device) = Device::open() else { return };
    let models = models();
    let all: Vec<&Model> = models.iter().collect();
    let backend = Backend::Vulkan(device.gpu().clone());
    for &path in device.paths() {
        for models in [&all[..], &all[..2]] {
            let refused = hold_to_reference(&backend, models, path);
            // Whole models and splats alone have no compute.
            let expected = if path == Path::Compute { 3 * 4 } else { 0 };
            assert_eq!(refused, expected, "{path:?}");
        }
    }
}

#[test]
fn two_halves_are_the_whole() {
    let statue = mesh(GeneratedShape::Statue, 30_000);
    let whole = built(statue.clone());
    let halves = [true, false].map(|is_left| built(half(&statue, is_left)));
    let halves: Vec<&Model> = halves.iter().collect();
    assert!(halves.iter().all(|half| half.triangles.len() > 5_000));
    let device = Device::open();
    let mut backends = vec![Backend::Cpu, Backend::Reference];
    backends.extend(
        device
            .as_ref()
            .map(|device| Backend::Vulkan(device.gpu().clone())),
    );
    // A half is open, and so nothing that faces away is left out.
    let settings = Settings {
        culling: surfel::render::Culling::Off,
        ..settings_of(Method::Triangles, SplatKind::Square, 1.0)
    };
    for backend in &backends {
        for (name, view) in views(&whole) {
            let wanted = picture(backend, &[&whole], &view, &settings).unwrap();
            let drawn = picture(backend, &halves, &view, &settings).unwrap();
            pictures::REFERENCE_SURFACE.assert_same(&wanted, &drawn, name);
        }
    }
}

#[test]
fn hidden_parts_are_left_out_and_come_back() {
    let models = models();
    let all: Vec<&Model> = models.iter().collect();
    let device = Device::open();
    let mut backends = vec![Backend::Cpu, Backend::Reference];
    backends.extend(
        device
            .as_ref()
            .map(|device| Backend::Vulkan(device.gpu().clone())),
    );
    let [(_, view), ..] = views(&models[0]);
    for backend in &backends {
        for (settings, _) in ways() {
            // A device with memory of its own expands lists of one model alone.
            let settings = Settings {
                list_of: ListOf::Records,
                ..settings
            };
            let mut engine = Engine::of_models(backend, &all, SIZE, outputs()).unwrap();
            engine.keep_lists(true);
            let Ok(whole) = engine.render(&view, &settings) else {
                continue;
            };
            engine.show(1, false);
            engine.show(2, false);
            let first = engine.render(&view, &settings).unwrap();
            let alone = picture(backend, &all[..1], &view, &settings).unwrap();
            pictures::SAME_BITS.assert_same(&alone, &first, &format!("{settings:?}"));
            engine.show(0, false);
            let none = engine.render(&view, &settings).unwrap();
            assert!(none.color.iter().all(|c| c[3] == 0), "{settings:?}");
            for part in 0..3 {
                engine.show(part, true);
            }
            let again = engine.render(&view, &settings).unwrap();
            pictures::SAME_BITS.assert_same(&whole, &again, &format!("{settings:?}"));
        }
    }
}

#[test]
fn a_model_moves_to_the_space_of_another() {
    let plain = built(mesh(GeneratedShape::Statue, 3_000));
    let origin = DVec3::new(-3.7, 100.3, 5.1);
    let mut nothing = PointAttributes::default();
    let moved = (plain.clone())
        .moved_to(origin, &mut nothing, &SilentProgress)
        .unwrap();
    assert_eq!(moved.origin, origin);
    let report = tree::check(&moved);
    assert!(report.is_clean(), "{report}");
    let at = |model: &Model, i: usize| model.origin + model.vertices[i].position.as_dvec3();
    for i in 0..plain.vertices.len() {
        assert!(at(&moved, i).distance(at(&plain, i)) < 1e-5);
    }
    let (a, b) = (plain.orbit_sphere(), moved.orbit_sphere());
    assert!(a.center.distance(b.center) < 1e-5 && (a.radius - b.radius).abs() < 1e-4);
}

/// Points of a cloud that is moved far away are ordered anew where they round to other places; their values go with them.
#[test]
fn what_points_carry_moves_with_them() {
    let mut state = 9u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let positions: Vec<Vec3> = (0..3000)
        .map(|_| 20.0 * Vec3::new(random(), random(), random()))
        .collect();
    let cloud = Mesh {
        positions,
        ..Mesh::default()
    };
    let model = built(cloud);
    let width = |model: &Model, i: usize| model.origin.x + f64::from(model.vertices[i].position.x);
    let values: Vec<f32> = (0..3000).map(|i| width(&model, i) as f32).collect();
    let mut attributes = PointAttributes {
        columns: vec![AttributeColumn {
            values: AttributeValues::of(values),
            ..AttributeColumn::new("x", AttributeKind::Quantity, NumberType::F32)
        }],
        are_colors_categories: true,
        ..PointAttributes::default()
    };
    let before = attributes.columns[0].values.clone();
    let origin = DVec3::new(2e6, -3e6, 10.0);
    let moved = model.moved_to(origin, &mut attributes, &SilentProgress);
    let moved = moved.unwrap();
    assert_ne!(
        attributes.columns[0].values, before,
        "nothing was ordered anew"
    );
    for i in 0..3000 {
        let off = attributes.columns[0].value(i).unwrap() - width(&moved, i);
        assert!(off.abs() < 0.2, "{i}: {off}");
    }
}
