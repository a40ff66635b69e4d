//! One lamp besides the headlight: closed forms, device against mirror, and what the options refuse.

use crate::common::{Device, generated, orbit, pictures};
use glam::{DMat4, DVec3};
use std::process::Command;
use surfel::generate::{GeneratedShape, ShapeSpec};
use surfel::image::{FloatImage, Image};
use surfel::math::camera::{Camera, View};
use surfel::mesh::Mesh;
use surfel::pack::lit_sphere::LitSphere;
use surfel::pack::{Lamp, Phong, SurfaceLighting};
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Culling, Method, Settings, Shading, SplatKind};
use surfel::tree::{self, BuildOptions, Model};

fn draw(backend: &Backend, model: &Model, view: &View, settings: &Settings) -> Image {
    pictures::draw(backend, model, view, settings, PictureOutputs::default()).unwrap()
}

fn from_camera(azimuth: f64, elevation: f64) -> Lamp {
    Lamp::FromCamera {
        azimuth: azimuth.to_radians(),
        elevation: elevation.to_radians(),
    }
}

fn with(lamp: Lamp, ambient: f32, specular: f32, shininess: f32) -> Settings {
    Settings {
        light: SurfaceLighting::Phong(Phong {
            lamp,
            ambient,
            specular,
            shininess,
        }),
        ..Settings::default()
    }
}

const SIDE: u32 = 240;
const EYE: f64 = 4.0;

/// From (0, 0, 4) along -z; field of view 45 degrees, or 2.5 units high in an orthographic view.
fn along_z(is_perspective: bool) -> View {
    let mut camera = Camera::look_at(
        (SIDE, SIDE),
        DVec3::new(0.0, 0.0, EYE),
        DVec3::ZERO,
        DVec3::Y,
        45f64.to_radians(),
        [1.0, 8.0],
    );
    if !is_perspective {
        let (near, far) = (1.0, 8.0);
        camera.proj = DMat4::from_cols_array(&[
            0.8,
            0.0,
            0.0,
            0.0,
            0.0,
            0.8,
            0.0,
            0.0, //
            0.0,
            0.0,
            1.0 / (near - far),
            0.0,
            0.0,
            0.0,
            near / (near - far),
            1.0,
        ]);
    }
    camera.view(DVec3::ZERO).unwrap()
}

/// Point and direction to the eye on the unit sphere at zero under a pixel; `None` within a hundredth of the rim.
fn on_sphere(is_perspective: bool, i: usize) -> Option<(DVec3, DVec3)> {
    let half = f64::from(SIDE) / 2.0;
    let x = ((i % SIDE as usize) as f64 + 0.5 - half) / half;
    let y = (half - (i / SIDE as usize) as f64 - 0.5) / half;
    let (origin, direction) = if is_perspective {
        let t = 22.5f64.to_radians().tan();
        (
            DVec3::new(0.0, 0.0, EYE),
            DVec3::new(x * t, y * t, -1.0).normalize(),
        )
    } else {
        (DVec3::new(x / 0.8, y / 0.8, EYE), DVec3::NEG_Z)
    };
    let b = origin.dot(direction);
    let root = b * b - origin.length_squared() + 1.0;
    let hit = origin + (-b - root.max(0.0).sqrt()) * direction;
    (root > 0.0 && hit.dot(-direction) > 0.14).then_some((hit, -direction))
}

/// The levels that the equation gives on the unit sphere.
fn closed_form(settings: &Settings, hit: DVec3, to_eye: DVec3, color: [u8; 3]) -> [f64; 3] {
    let SurfaceLighting::Phong(phong) = settings.light else {
        panic!("a lamp")
    };
    let l = match phong.lamp {
        Lamp::At(position) => (position - hit).normalize(),
        Lamp::FromCamera { azimuth, elevation } => {
            // The camera's axes are those of the world here.
            DMat4::from_rotation_y(azimuth)
                .transform_vector3(DMat4::from_rotation_x(-elevation).transform_vector3(DVec3::Z))
        }
    };
    let (cosine, ambient) = (hit.dot(l), f64::from(phong.ambient));
    let highlight = f64::from(phong.specular)
        * (10.0 * cosine).clamp(0.0, 1.0)
        * hit
            .dot((l + to_eye).normalize())
            .max(0.0)
            .powf(f64::from(phong.shininess));
    color.map(|c| {
        let albedo = 0.8 * f64::from(c) / 255.0;
        255.0 * (albedo * (ambient + (1.0 - ambient) * cosine.max(0.0)) + highlight).min(1.0)
    })
}

/// The unit sphere in one color.
fn sphere(triangles: u64, [r, g, b]: [u8; 3]) -> Model {
    let mut mesh = surfel::generate::mesh(
        &ShapeSpec::with_triangles(GeneratedShape::Sphere, triangles).unwrap(),
    );
    mesh.colors = vec![[r, g, b, 255]; mesh.positions.len()];
    build(mesh)
}

fn build(mesh: Mesh) -> Model {
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

const LAMPS: [Lamp; 4] = [
    Lamp::FromCamera {
        azimuth: 1.4,
        elevation: 0.2,
    },
    Lamp::FromCamera {
        azimuth: -0.6,
        elevation: -0.7,
    },
    // From behind: a crescent.
    Lamp::FromCamera {
        azimuth: 2.6,
        elevation: 0.3,
    },
    Lamp::At(DVec3::new(-1.5, 0.8, 1.2)),
];

#[test]
fn a_sphere_has_the_closed_form_shade_highlight_and_terminator() {
    let color = [255, 128, 30];
    let model = sphere(180_000, color);
    for is_perspective in [true, false] {
        let view = along_z(is_perspective);
        for lamp in LAMPS {
            let settings = Settings {
                method: Method::Triangles,
                ..with(lamp, 0.15, 0.3, 20.0)
            };
            let image = draw(&Backend::Reference, &model, &view, &settings);
            let (mut checked, mut dark, mut bright) = (0, 0, 0);
            for (i, got) in image.color.iter().enumerate() {
                let Some((hit, to_eye)) = on_sphere(is_perspective, i) else {
                    continue;
                };
                let wanted = closed_form(&settings, hit, to_eye, color);
                // Half a level of rounding; the rest is for chords, snapped corners and 16-bit normals.
                for c in 0..3 {
                    assert!(
                        (f64::from(got[c]) - wanted[c]).abs() < 0.9,
                        "{lamp:?}, pixel {i}: {got:?}, not {wanted:?}"
                    );
                }
                checked += 1;
                dark += usize::from(wanted[0] < 0.8 * 0.15 * 255.0 + 0.01);
                bright += usize::from(wanted[2] > 50.0);
            }
            println!(
                "{lamp:?}: {checked} pixels, {dark} beyond the terminator, {bright} in the highlight"
            );
            assert!(checked > 15_000);
        }
    }
}

/// The frame of the eye by hand: its z axis points to the eye, its x axis lies in the plane of that and of the picture's x axis
/// where the shortest turn leaves it.
#[test]
fn a_sphere_anywhere_has_the_closed_form_of_lights_that_go_with_the_camera() {
    let color = [255, 128, 30];
    let model = sphere(180_000, color);
    for sphere in LitSphere::ALL {
        let lights = sphere.lights();
        for is_perspective in [true, false] {
            let view = along_z(is_perspective);
            let settings = Settings {
                method: Method::Triangles,
                light: SurfaceLighting::Sphere(sphere),
                ..Settings::default()
            };
            let image = draw(&Backend::Reference, &model, &view, &settings);
            let mut checked = 0;
            for (i, got) in image.color.iter().enumerate() {
                let Some((hit, to_eye)) = on_sphere(is_perspective, i) else {
                    continue;
                };
                let axis = to_eye.cross(DVec3::Z);
                let turn = DMat4::from_axis_angle(
                    axis.try_normalize().unwrap_or(DVec3::X),
                    to_eye.z.clamp(-1.0, 1.0).acos(),
                );
                let n = turn.transform_vector3(hit);
                let mut diffuse = lights.ground.as_dvec3() * (0.5 - 0.5 * n.y)
                    + lights.sky.as_dvec3() * (0.5 + 0.5 * n.y);
                let mut gloss = 0.0;
                for k in 0..3 {
                    let l = lights.directions[k].as_dvec3();
                    let wrap = f64::from(lights.wrap);
                    let reached = ((n.dot(l) + wrap) / (1.0 + wrap)).max(0.0);
                    diffuse += lights.colors[k].as_dvec3() * reached;
                    let half = (l + DVec3::Z).normalize();
                    gloss += f64::from(lights.specular[k])
                        * (10.0 * n.dot(l)).clamp(0.0, 1.0)
                        * n.dot(half).max(0.0).powf(f64::from(lights.shininess));
                }
                let rim = lights.rim.as_dvec3() * (1.0 - n.z).powf(f64::from(lights.rim_power));
                for c in 0..3 {
                    let albedo = 0.8 * f64::from(color[c]) / 255.0;
                    let wanted = 255.0 * (albedo * diffuse[c] + gloss + rim[c]).min(1.0);
                    // As above; small highlights change by more from a chord to the next.
                    let off = (f64::from(got[c]) - wanted).abs();
                    assert!(off < 1.6, "{sphere:?}, pixel {i}: {got:?}, not {wanted}");
                }
                checked += 1;
            }
            assert!(checked > 15_000, "{checked}");
        }
    }
}

#[test]
fn the_highlight_lies_where_the_normal_halves_light_and_eye() {
    let model = sphere(180_000, [255; 3]);
    let view = along_z(false);
    // All light from everywhere: only the highlight is left to vary, from 0.8 to 1.
    let settings = Settings {
        method: Method::Triangles,
        ..with(from_camera(60.0, 20.0), 1.0, 0.2, 200.0)
    };
    let image = draw(&Backend::Reference, &model, &view, &settings);
    let at_least = |level: u8| {
        let (mut n, mut x, mut y) = (0.0, 0.0, 0.0);
        for (i, c) in image.color.iter().enumerate() {
            if c[3] > 0 && c[0] >= level {
                n += 1.0;
                x += (i % SIDE as usize) as f64 + 0.5;
                y += (i / SIDE as usize) as f64 + 0.5;
            }
        }
        (n, x / n, y / n)
    };
    assert_eq!(image.color.iter().map(|c| c[0]).max(), Some(255));
    let (n, x, y) = at_least(250);
    let (sin_a, cos_a) = 60f64.to_radians().sin_cos();
    let (sin_e, cos_e) = 20f64.to_radians().sin_cos();
    let h = (DVec3::new(cos_e * sin_a, sin_e, cos_e * cos_a) + DVec3::Z).normalize();
    let radius = 0.8 * 120.0;
    assert!((x - (120.0 + radius * h.x)).abs() < 0.5, "{x}");
    assert!((y - (120.0 - radius * h.y)).abs() < 0.5, "{y}");
    // 0.8 + 0.2 cos^200 d = 249.5 / 255: a cap of angle d, seen at the angle of h.
    let cap = ((249.5f64 / 255.0 - 0.8) / 0.2).powf(1.0 / 200.0);
    let area = std::f64::consts::PI * radius * radius * (1.0 - cap * cap) * h.z * cap;
    assert!((n - area).abs() < 0.15 * area, "{n} pixels, not {area}");
}

#[test]
fn a_lamp_in_the_eye_without_ambience_and_gloss_is_the_headlight() {
    let model = generated(GeneratedShape::Statue, 30_000);
    let camera = Camera::orbit((160, 160), DVec3::ZERO, 1.6, 0.7, 0.3, 1.0);
    let view = camera.view(DVec3::ZERO).unwrap();
    let eye = camera.view.inverse().transform_point3(DVec3::ZERO);
    for (method, splat, threshold_px) in METHODS {
        // Another mean of a triangle whose shading normal is not its own.
        if splat == SplatKind::Filtered {
            continue;
        }
        let headlight = Settings {
            method,
            splat,
            threshold_px,
            ..Settings::default()
        };
        let lamp = Settings {
            light: with(Lamp::At(eye), 0.0, 0.0, 1.0).light,
            ..headlight
        };
        let a = draw(&Backend::Reference, &model, &view, &headlight);
        let b = draw(&Backend::Reference, &model, &view, &lamp);
        let far = a
            .color
            .iter()
            .zip(&b.color)
            // Where an interpolated normal turns away the headlight has |n . l| and a lamp has nothing.
            .filter(|(a, b)| (0..4).any(|c| a[c].abs_diff(b[c]) > 1) && b[0] > 0)
            .count();
        println!("{method:?} {splat:?} {threshold_px}: {far} differ");
        assert_eq!(far, 0, "{method:?} {splat:?} {threshold_px}");
    }
}

#[test]
fn the_back_is_lit_from_its_own_side_or_not_at_all() {
    let model = generated(GeneratedShape::Square, 800);
    let view = orbit(&model, (60, 60), 180.0, 0.0, 1.0);
    for (method, threshold_px) in [
        (Method::Triangles, 1.0),
        (Method::Points, 9.0),
        (Method::Pop, 9.0),
    ] {
        for (two_sided, culling, wanted) in [
            // 255 * (0.8 + 0.2), and 255 * 0.8 * 0.1.
            (true, Culling::Off, 255),
            (false, Culling::Off, 20),
        ] {
            let settings = Settings {
                method,
                threshold_px,
                two_sided,
                culling,
                ..with(from_camera(0.0, 0.0), 0.1, 0.2, 8.0)
            };
            let image = draw(&Backend::Reference, &model, &view, &settings);
            let got = image.color[30 * 60 + 30];
            assert_eq!(got, [wanted, wanted, wanted, 255], "{method:?} {two_sided}");
        }
    }
    // What has no normal has no highlight and no dark side.
    let mut mesh =
        surfel::generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Sphere, 2000).unwrap());
    mesh.normals.clear();
    mesh.triangles.clear();
    let cloud = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
    let settings = Settings {
        method: Method::Points,
        threshold_px: 5.0,
        ..with(from_camera(70.0, 0.0), 0.1, 0.2, 8.0)
    };
    let image = draw(&Backend::Reference, &cloud, &along_z(true), &settings);
    let covered: Vec<_> = image.color.iter().filter(|c| c[3] > 0).collect();
    assert!(covered.len() > 1000);
    assert!(covered.iter().all(|c| **c == [204, 204, 204, 255]));
}

/// Lit once a pixel: the mean normal of splats around a pixel lies nearer to the surface's than one splat's does.
#[test]
fn means_of_normals_have_the_closed_form_in_a_lamp() {
    let color = [255, 128, 30];
    let round = sphere(180_000, color);
    for is_perspective in [true, false] {
        let view = along_z(is_perspective);
        for lamp in LAMPS {
            let settings = Settings {
                splat: SplatKind::Gauss,
                shading: Shading::Deferred,
                threshold_px: 2.0,
                ..with(lamp, 0.15, 0.3, 20.0)
            };
            let image = draw(&Backend::Reference, &round, &view, &settings);
            let (mut worst, mut sum, mut count) = (0f64, 0.0, 0);
            for (i, got) in image.color.iter().enumerate() {
                if let Some((hit, to_eye)) = on_sphere(is_perspective, i)
                    && hit.dot(to_eye) > 0.4
                {
                    let wanted = closed_form(&settings, hit, to_eye, color);
                    for c in 0..3 {
                        let off = (f64::from(got[c]) - wanted[c]).abs();
                        worst = worst.max(off);
                        sum += off;
                        count += 1;
                    }
                }
            }
            let mean = sum / f64::from(count);
            println!("{lamp:?}: off by {mean:.2} levels, up to {worst:.1}");
            assert!(mean < 0.6 && worst < 5.0, "{lamp:?}: {mean}, {worst}");
        }
    }
}

/// The mean over a patch is what it claims to be: nearer to many samples than one sample is.
#[test]
fn filtered_splats_are_the_mean_in_a_lamp_too() {
    let round = sphere(180_000, [255; 3]);
    let view = along_z(true);
    for lamp in LAMPS {
        let settings = Settings {
            splat: SplatKind::Filtered,
            ..with(lamp, 0.1, 0.2, 32.0)
        };
        let image = draw(&Backend::Reference, &round, &view, &settings);
        let mut worst = 0f64;
        for (i, got) in image.color.iter().enumerate() {
            if let Some((hit, to_eye)) = on_sphere(true, i)
                && hit.dot(to_eye) > 0.4
            {
                let wanted = closed_form(&settings, hit, to_eye, [255; 3]);
                worst = worst.max((f64::from(got[0]) - wanted[0]).abs());
            }
        }
        println!("{lamp:?}: off by {worst:.1} levels");
        // The light changes by up to 2 levels a pixel here, and a pixel sums splats from around it.
        assert!(worst < 4.0, "{lamp:?}: {worst} levels");
    }
    let rough = generated(GeneratedShape::Statue, 200_000);
    let view = orbit(&rough, (120, 120), 20.0, 20.0, 0.4);
    let with_splat = |method, splat| Settings {
        method,
        splat,
        ..with(from_camera(70.0, 20.0), 0.1, 0.2, 32.0)
    };
    let reference = Engine::new(
        &Backend::Reference,
        &rough,
        (120, 120),
        PictureOutputs::default(),
    )
    .unwrap()
    .supersample(&view, &with_splat(Method::Triangles, SplatKind::Square), 4)
    .unwrap();
    let [squares, filtered] = [SplatKind::Square, SplatKind::Filtered].map(|splat| {
        let image = draw(
            &Backend::Reference,
            &rough,
            &view,
            &with_splat(Method::Pop, splat),
        );
        error(&image, &reference)
    });
    println!("statue from the side: squares off by {squares:.4}, filtered by {filtered:.4}");
    assert!(filtered < 0.6 * squares, "{filtered} and {squares}");
}

/// Root of the mean squared difference over what either picture covers, 1 is white.
fn error(image: &Image, reference: &FloatImage) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for (a, b) in image.color.iter().zip(&reference.color) {
        if a[3] > 0 || b[3] > 0.0 {
            sum += (f64::from(a[0]) / 255.0 - f64::from(b[0])).powi(2);
            n += 1.0;
        }
    }
    assert!(n > 500.0, "{n} pixels");
    f64::sqrt(sum / n)
}

const METHODS: [(Method, SplatKind, f32); 6] = [
    (Method::Triangles, SplatKind::Square, 1.0),
    (Method::Points, SplatKind::Square, 3.0),
    (Method::Pop, SplatKind::Square, 1.0),
    (Method::Pop, SplatKind::Square, 4.5),
    (Method::Pop, SplatKind::Filtered, 1.0),
    (Method::Pop, SplatKind::Filtered, 3.0),
];

#[test]
fn the_device_draws_what_the_mirror_draws() {
    let Some(device) = Device::open() else { return };
    let device_backend = Backend::Device(device.gpu().clone());
    let mut mesh =
        surfel::generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Statue, 30_000).unwrap());
    mesh.colors = mesh
        .positions
        .iter()
        .map(|p| {
            [
                (p.x * 90.0 + 128.0) as u8,
                200,
                (p.z * 90.0 + 128.0) as u8,
                255,
            ]
        })
        .collect();
    let model = build(mesh);
    let camera = Camera::orbit((160, 140), DVec3::ZERO, 1.6, 0.7, 0.3, 1.0);
    let mut flat = camera.clone();
    flat.proj = DMat4::from_cols_array(&[
        0.6,
        0.0,
        0.0,
        0.0,
        0.0,
        0.5,
        0.0,
        0.0, //
        0.0,
        0.0,
        1.0 / (1.0 - 8.0),
        0.0,
        0.1,
        -0.05,
        1.0 / (1.0 - 8.0),
        1.0,
    ]);
    // A scaled view changes lengths, and the lamp with them.
    flat.view = DMat4::from_scale(DVec3::splat(0.8)) * flat.view;
    for (name, camera) in [("perspective", camera), ("orthographic", flat)] {
        let view = camera.view(DVec3::ZERO).unwrap();
        let at_a_point = Lamp::At(DVec3::new(-1.2, 0.6, 0.9));
        let lamp = |lamp, shininess| with(lamp, 0.1, 0.5, shininess).light;
        for (light, culling, two_sided) in [
            (lamp(from_camera(75.0, 15.0), 32.0), Culling::Auto, true),
            (lamp(at_a_point, 300.0), Culling::Off, true),
            (lamp(from_camera(-40.0, 40.0), 1.0), Culling::Off, false),
            (
                SurfaceLighting::Sphere(LitSphere::Studio),
                Culling::Off,
                false,
            ),
            (
                SurfaceLighting::Sphere(LitSphere::Porcelain),
                Culling::Auto,
                true,
            ),
        ] {
            for (method, splat, threshold_px) in METHODS {
                if splat == SplatKind::Filtered && !two_sided {
                    continue;
                }
                let settings = Settings {
                    method,
                    splat,
                    threshold_px,
                    culling,
                    two_sided,
                    light,
                    ..Settings::default()
                };
                let name = format!("{name} {light:?} {method:?} {splat:?} {threshold_px}");
                let a = draw(&device_backend, &model, &view, &settings);
                let b = draw(&Backend::Reference, &model, &view, &settings);
                pictures::REFERENCE_LAMP.assert_same(&b, &a, &name);
            }
        }
    }
    // The same renderer goes from one light to the other and back.
    let view = orbit(&model, (100, 100), 30.0, 20.0, 1.0);
    for (method, splat, threshold_px) in METHODS {
        let headlight = Settings {
            method,
            splat,
            threshold_px,
            ..Settings::default()
        };
        let lit = |light| Settings { light, ..headlight };
        let lamp = lit(SurfaceLighting::Phong(Phong::default()));
        let metal = lit(SurfaceLighting::Sphere(LitSphere::Metal));
        let mut engine = Engine::new(
            &device_backend,
            &model,
            (100, 100),
            PictureOutputs::default(),
        )
        .unwrap();
        let all = [&headlight, &lamp, &metal, &headlight];
        let [a, b, c, again] = all.map(|s| engine.render(&view, s).unwrap());
        assert!(a == again && a != b && b != c, "{method:?} {splat:?}");
    }
}

#[test]
fn the_options_say_what_they_refuse_and_the_statistics_which_light_it_was() {
    let run = |options: &str| {
        let scene = "render generate:sphere:500 --size 32x32 --device mirror --stats -";
        let out = Command::new(env!("CARGO_BIN_EXE_surfel"))
            .env("SURFEL_CALIBRATE", "off")
            .args(scene.split(' ').chain(options.split_whitespace()))
            .output()
            .unwrap();
        (
            out.status.code(),
            out.stdout,
            String::from_utf8(out.stderr).unwrap(),
        )
    };
    for (options, reason) in [
        ("--light sun", "headlight"),
        ("--light-at 10,20", "--light phong"),
        ("--light-position 1,2,3", "--light phong"),
        ("--ambient 0.2", "--light phong"),
        ("--specular 0.2", "--light phong"),
        ("--shininess 9", "--light phong"),
        ("--light phong --light-at 10", "AZIMUTH,ELEVATION"),
        ("--light phong --light-at 10,91", "-90 to 90"),
        ("--light phong --light-at nan,0", "-360 to 360"),
        ("--light phong --light-position 1,2", "X,Y,Z"),
        ("--light phong --light-position 1,2,inf", "1e12"),
        (
            "--light phong --light-at 1,2 --light-position 1,2,3",
            "--light-position",
        ),
        ("--light phong --ambient 1.5", "--ambient 1.5"),
        ("--light phong --ambient -1", "--ambient -1"),
        ("--light phong --specular nan", "--specular"),
        ("--light phong --shininess 0", "--shininess 0"),
        ("--light phong --shininess 1001", "1000"),
    ] {
        let (code, out, err) = run(options);
        assert_eq!(code, Some(2), "{options}: {err}");
        assert!(err.contains(reason), "{options}: {err}");
        assert_eq!(out, b"", "{options}");
    }
    for (options, wanted) in [
        ("", serde_json::json!({ "kind": "studio" })),
        (
            "--light headlight",
            serde_json::json!({ "kind": "headlight" }),
        ),
        (
            "--light phong --light-position 1,-2,3 --ambient 0.25 --specular 0 --shininess 8",
            serde_json::json!({ "kind": "phong", "position": [1.0, -2.0, 3.0], "ambient": 0.25, "specular": 0.0, "shininess": 8.0 }),
        ),
    ] {
        let (code, out, err) = run(options);
        assert_eq!(code, Some(0), "{err}");
        let stats: serde_json::Value = serde_json::from_slice(&out).unwrap();
        assert_eq!(stats["settings"]["light"], wanted);
    }
    let (_, out, _) = run("--light phong --light-at=-90,45");
    let stats: serde_json::Value = serde_json::from_slice(&out).unwrap();
    let angles = &stats["settings"]["light"]["from_camera_deg"];
    assert!(
        (angles[0].as_f64().unwrap() + 90.0).abs() < 1e-9,
        "{angles}"
    );
    assert!(
        (angles[1].as_f64().unwrap() - 45.0).abs() < 1e-9,
        "{angles}"
    );
}
