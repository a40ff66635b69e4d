//! What the processor's renderer draws besides eight bits in the headlight: floats, normals, lamps and data as colors. The
//! reference says what is right, and its own plain pictures what floats have to round to.

use crate::common::{generated, orbit, orthographic, pictures};
use glam::DVec3;
use surfel::generate::{GeneratedShape, ShapeSpec};
use surfel::image::{Image, unorm8};
use surfel::math::camera::View;
use surfel::pack::{ColorBy, Lamp, Phong, SurfaceLighting};
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Culling, Method, Settings, SplatKind};
use surfel::tree::{self, BuildOptions, Model};

const SIZE: (u32, u32) = (240, 200);

/// Everything but normals, which filtered splats have not.
const FLOATS: PictureOutputs = PictureOutputs {
    depth: true,
    normal: false,
    values: true,
};

const WAYS: [(Method, SplatKind, f32); 7] = [
    (Method::Triangles, SplatKind::Square, 1.0),
    (Method::Pop, SplatKind::Square, 1.0),
    (Method::Pop, SplatKind::Square, 4.5),
    (Method::Pop, SplatKind::Disc, 3.0),
    (Method::Splats, SplatKind::Square, 2.0),
    (Method::Pop, SplatKind::Filtered, 1.0),
    (Method::Pop, SplatKind::Filtered, 3.0),
];

/// A statue in colors, a coarse torus whose triangles are large, and a cloud.
fn models() -> Vec<(&'static str, Model)> {
    let built = |mesh| tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
    let mut colored =
        surfel::generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Statue, 30_000).unwrap());
    let shade = |x: f32| (x * 127.0 + 128.0) as u8;
    let colors = colored.positions.iter();
    colored.colors = colors.map(|p| [shade(p.x), 90, shade(p.z), 255]).collect();
    let mut cloud = colored.clone();
    cloud.triangles.clear();
    vec![
        ("colored", built(colored)),
        ("torus", generated(GeneratedShape::Torus, 2_000)),
        ("cloud", built(cloud)),
    ]
}

fn views(model: &Model) -> [(&'static str, View); 3] {
    let mut part = orbit(model, SIZE, 30.0, 20.0, 1.3);
    part.offset = [0.4, -0.3];
    [
        ("near", orbit(model, SIZE, 40.0, 25.0, 1.1)),
        ("part", part),
        ("orthographic", orthographic(model, SIZE)),
    ]
}

/// A way to draw that the model has.
fn settings_of(
    (method, splat, threshold_px): (Method, SplatKind, f32),
    model: &Model,
) -> Option<Settings> {
    let has_triangles = !model.triangles.is_empty();
    (method != Method::Triangles || has_triangles).then(|| Settings {
        method,
        splat,
        threshold_px,
        background: [0.1, 0.2, 0.3],
        ..Settings::default()
    })
}

fn by_cpu(model: &Model, outputs: PictureOutputs) -> Engine<'_> {
    Engine::new(&Backend::Cpu, model, SIZE, outputs).unwrap()
}

/// How many values lie between two levels of 255, and of how many.
fn between_levels(picture: &Image) -> [usize; 2] {
    let covered = picture.values.iter().filter(|value| value[3] > 0.0);
    let is_between = |value: &&[f32; 4]| {
        let steps = 255.0 * value[0];
        (steps - steps.round()).abs() > 0.01
    };
    [covered.clone().filter(is_between).count(), covered.count()]
}

/// The same frame as floats and as bytes: floats round to the bytes beside them, and those are what the plain picture has.
#[test]
fn floats_round_to_the_picture_of_eight_bits() {
    let (mut drawn, mut between) = (0, [0, 0]);
    for (name, model) in models() {
        let plain = PictureOutputs {
            values: false,
            ..FLOATS
        };
        let (mut floats, mut bytes) = (by_cpu(&model, FLOATS), by_cpu(&model, plain));
        for (view_name, view) in views(&model) {
            for way in WAYS {
                let Some(settings) = settings_of(way, &model) else {
                    continue;
                };
                let what = format!("{name}, {view_name}, {way:?}");
                let picture = floats.render(&view, &settings).unwrap();
                let wanted = bytes.render(&view, &settings).unwrap();
                assert!(wanted.values.is_empty());
                assert_eq!(picture.values.len(), picture.color.len(), "{what}");
                for (value, color) in picture.values.iter().zip(&picture.color) {
                    let rounded = value.map(|v| unorm8(f64::from(v)));
                    // What lies in the middle of two levels goes to the even one in a picture.
                    let is_off = |i: usize| {
                        rounded[i].abs_diff(color[i]) > u8::from(value[i] * 255.0 % 1.0 == 0.5)
                    };
                    assert!(!(0..4).any(is_off), "{what}: {value:?} {color:?}");
                }
                pictures::CPU_AS_DEVICE.assert_same(&wanted, &picture, &what);
                let found = between_levels(&picture);
                between = [0, 1].map(|i| between[i] + found[i]);
                drawn += 1;
            }
        }
    }
    println!(
        "{drawn} pictures, {} of {} values between levels",
        between[0], between[1]
    );
    assert_eq!(drawn, 60);
    assert!(10 * between[0] > 9 * between[1], "{between:?}");
}

/// Samples are floats, of which a mean is made; the picture of the last frame stays what it was.
#[test]
fn samples_are_floats_and_leave_the_picture_alone() {
    for (name, model) in models() {
        let mut engine = by_cpu(&model, PictureOutputs::default());
        let mut reference =
            Engine::new(&Backend::Reference, &model, SIZE, PictureOutputs::default()).unwrap();
        let [(_, view), (_, other), _] = views(&model);
        for way in WAYS {
            let Some(settings) = settings_of(way, &model) else {
                continue;
            };
            let drawn = engine.render(&view, &settings).unwrap();
            let sample = engine.sample(&other, &settings).unwrap();
            let [between, all] = between_levels(&sample);
            assert!(
                10 * between > 9 * all && all > 1000,
                "{name}, {way:?}: {between} of {all}"
            );
            assert_eq!(engine.read(&view).unwrap(), drawn, "{name}, {way:?}");
            let wanted = reference.sample(&other, &settings).unwrap();
            // Triangles of few pixels have colors of eight bits, which light makes darker: 0.8 of half a level.
            let most = if name == "colored" { 1.7e-3 } else { 1e-3 };
            let pairs = || sample.values.iter().zip(&wanted.values);
            let is_off =
                |(a, b): &(&[f32; 4], &[f32; 4])| (0..4).any(|i| (a[i] - b[i]).abs() > most);
            let off = pairs().filter(is_off).count();
            println!("{name}, {way:?}: {off} of {all} are off");
            // As REFERENCE_NEEDLES: outlines, of snapped positions.
            assert!(100 * off < all, "{name}, {way:?}: {off} of {all}");
        }
    }
}

fn lit(settings: Settings, lamp: Lamp) -> Settings {
    let phong = Phong {
        lamp,
        specular: 0.4,
        ..Phong::default()
    };
    Settings {
        light: SurfaceLighting::Phong(phong),
        ..settings
    }
}

/// The lights and data of a way to draw.
fn shown(settings: Settings) -> Vec<Settings> {
    let from_camera = Lamp::FromCamera {
        azimuth: 1.2,
        elevation: 0.3,
    };
    let at = Lamp::At(DVec3::new(-1.2, 0.6, 0.9));
    let data = [ColorBy::Level, ColorBy::Normal, ColorBy::Depth];
    let data = data.map(|color_by| Settings {
        color_by,
        ..settings
    });
    let mut all = vec![
        lit(settings, from_camera),
        Settings {
            culling: Culling::Off,
            ..lit(settings, at)
        },
        Settings {
            color_by: ColorBy::Primitive,
            ..lit(settings, at)
        },
    ];
    if settings.splat != SplatKind::Filtered {
        all.push(Settings {
            culling: Culling::Off,
            two_sided: false,
            ..lit(settings, from_camera)
        });
    }
    all.extend(
        data.into_iter()
            .filter(|data| data.color_by != ColorBy::Level || data.has_cut()),
    );
    all
}

#[test]
fn lamps_and_data_are_those_of_the_reference() {
    let mut drawn = 0;
    for (name, model) in models() {
        let mut engine = by_cpu(&model, PictureOutputs::default());
        let mut reference =
            Engine::new(&Backend::Reference, &model, SIZE, PictureOutputs::default()).unwrap();
        for (view_name, view) in views(&model) {
            for settings in WAYS
                .iter()
                .filter_map(|&way| settings_of(way, &model))
                .flat_map(shown)
            {
                let picture = engine.render(&view, &settings).unwrap();
                let wanted = reference.render(&view, &settings).unwrap();
                let oracle = match settings.color_by.is_data() {
                    true => pictures::REFERENCE_DATA,
                    false => pictures::REFERENCE_LAMP,
                };
                let what = format!(
                    "{name}, {view_name}, {:?} {:?} {}, {:?}, {:?}",
                    settings.method,
                    settings.splat,
                    settings.threshold_px,
                    settings.color_by,
                    settings.light
                );
                oracle.assert_same(&wanted, &picture, &what);
                drawn += 1;
            }
        }
    }
    println!("{drawn} pictures");
    assert!(drawn > 300, "{drawn}");
}

#[test]
fn normals_are_those_of_the_reference() {
    let outputs = pictures::with_depth(true);
    for (name, model) in models() {
        let mut engine = by_cpu(&model, outputs);
        let mut reference = Engine::new(&Backend::Reference, &model, SIZE, outputs).unwrap();
        for (view_name, view) in views(&model) {
            for way in WAYS {
                let Some(settings) = settings_of(way, &model) else {
                    continue;
                };
                if settings.splat == SplatKind::Filtered {
                    let error = engine.draw(&view, &settings).unwrap_err().to_string();
                    assert!(error.contains("leave --normals out"), "{error}");
                    continue;
                }
                let picture = engine.render(&view, &settings).unwrap();
                let wanted = reference.render(&view, &settings).unwrap();
                let what = format!("{name}, {view_name}, {way:?}");
                assert_eq!(picture.normal.len(), picture.color.len());
                pictures::REFERENCE_NEEDLES.assert_same(&wanted, &picture, &what);
            }
        }
    }
}
