//! Splats blended in two passes.

use super::oracle::{draw, same};
use crate::common::pictures::{BLENDED_TRIANGLES, REFERENCE_BLENDED};
use crate::common::{Device, generated, orbit};
use glam::DVec3;
use surfel::generate::GeneratedShape;
use surfel::math::camera::Camera;
use surfel::pack::{Lamp, Phong, SurfaceLighting};
use surfel::progress::SilentProgress;
use surfel::render::engine::Backend;
use surfel::render::{Blend, Culling, Method, Settings, Shading, SplatKind, SumFormat};
use surfel::tree::{self, BuildOptions, Model};

const KINDS: [SplatKind; 4] = [
    SplatKind::Square,
    SplatKind::Disc,
    SplatKind::Ellipse,
    SplatKind::Gauss,
];

fn fuzzy(splat: SplatKind, threshold_px: f32) -> Settings {
    Settings {
        splat,
        threshold_px,
        blend: Some(Blend::TwoPass),
        background: [0.1, 0.2, 0.3],
        ..Settings::default()
    }
}

#[test]
fn device_and_mirror_blend_every_kind_alike() {
    let Some(device) = Device::open() else { return };
    for (shape, triangles) in [
        (GeneratedShape::Sphere, 8_000),
        (GeneratedShape::Statue, 30_000),
    ] {
        let model = generated(shape, triangles);
        for (fill, threshold) in [(1.0, 1.0), (0.4, 3.0), (2.5, 9.0)] {
            let view = orbit(&model, (90, 80), 40.0, 25.0, fill);
            for kind in KINDS {
                for method in [Method::Pop, Method::Splats, Method::Points] {
                    for shading in [Shading::PerSplat, Shading::Deferred] {
                        let is_gauss = kind == SplatKind::Gauss;
                        if !is_gauss && (shading == Shading::Deferred || threshold == 9.0) {
                            continue;
                        }
                        let settings = Settings {
                            method,
                            shading,
                            ..fuzzy(kind, threshold)
                        };
                        let name =
                            format!("{shape:?} {fill} {kind:?} {method:?} {threshold} {shading:?}");
                        same(&device, &model, &view, &settings, &name, REFERENCE_BLENDED);
                    }
                }
            }
        }
    }
}

/// From the side and from behind, far away and near.
const LAMPS: [Lamp; 3] = [
    Lamp::FromCamera {
        azimuth: 1.0,
        elevation: -0.5,
    },
    Lamp::FromCamera {
        azimuth: 2.5,
        elevation: 0.3,
    },
    Lamp::At(DVec3::new(-0.4, 0.9, 1.3)),
];

#[test]
fn device_and_mirror_light_means_with_a_lamp_alike() {
    let Some(device) = Device::open() else { return };
    let statue = generated(GeneratedShape::Statue, 30_000);
    let open = generated(GeneratedShape::Square, 2_000);
    for lamp in LAMPS {
        let light = SurfaceLighting::Phong(Phong {
            lamp,
            ..Phong::default()
        });
        for (name, model, azimuth) in [("statue", &statue, 40.0), ("back", &open, 150.0)] {
            let view = orbit(model, (90, 80), azimuth, 25.0, 0.8);
            for kind in [SplatKind::Disc, SplatKind::Gauss] {
                for method in [Method::Pop, Method::Points] {
                    let settings = Settings {
                        method,
                        light,
                        shading: Shading::Deferred,
                        ..fuzzy(kind, 3.0)
                    };
                    let name = format!("{name} {lamp:?} {kind:?} {method:?}");
                    same(&device, model, &view, &settings, &name, REFERENCE_BLENDED);
                }
            }
        }
    }
}

/// On the sphere the mean over splats around a pixel points where the pixel's own normal does, but for the curvature
/// between their centers: up to a threshold of 3 pixels on a radius of 90, and more at the rim.
#[test]
fn mean_normals_are_those_of_the_surface() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Sphere, 200_000);
    let view = orbit(&model, (200, 200), 30.0, 20.0, 0.9);
    let reference = Settings {
        method: Method::Triangles,
        ..Settings::default()
    };
    let backend = Backend::Device(device.gpu().clone());
    let reference = draw(&backend, &model, &view, &reference);
    for kind in KINDS {
        let image = same(
            &device,
            &model,
            &view,
            &fuzzy(kind, 3.0),
            "normals",
            REFERENCE_BLENDED,
        );
        let spread = surfel::measure::normal_error(&reference.normal, &image.normal);
        println!("{kind:?}: {spread:?}");
        assert!(spread.count > 20_000, "{kind:?}: {}", spread.count);
        assert!(spread.mean < 1.0, "{kind:?}: {} degrees", spread.mean);
        assert!(spread.p99 < 8.0, "{kind:?}: {} degrees", spread.p99);
    }
}

#[test]
fn clouds_parallel_views_and_an_eye_inside_alike() {
    let Some(device) = Device::open() else { return };
    let spec = surfel::generate::ShapeSpec::with_triangles(GeneratedShape::Statue, 4_000).unwrap();
    let mut cloud = surfel::generate::mesh(&spec);
    cloud.triangles.clear();
    let cloud = tree::build(cloud, &BuildOptions::default(), &SilentProgress).unwrap();
    let statue = generated(GeneratedShape::Statue, 10_000);
    let mut camera = Camera::look_at(
        (90, 80),
        DVec3::new(1.0, 0.5, 4.0),
        DVec3::ZERO,
        DVec3::Y,
        1.0,
        [1.0, 8.0],
    );
    camera.proj = glam::DMat4::from_cols(
        glam::DVec4::new(0.55, 0.0, 0.0, 0.0),
        glam::DVec4::new(0.0, 0.65, 0.0, 0.0),
        glam::DVec4::new(0.0, 0.0, -1.0 / 7.0, 0.0),
        glam::DVec4::new(0.2, -0.1, -1.0 / 7.0, 1.0),
    );
    let parallel = camera.view(DVec3::ZERO).unwrap();
    let inside = Camera::look_at(
        (90, 80),
        DVec3::new(0.0, 0.1, 0.2),
        DVec3::new(0.3, 0.1, 1.0),
        DVec3::Y,
        1.2,
        [0.01, 5.0],
    )
    .view(DVec3::ZERO)
    .unwrap();
    let outside = orbit(&cloud, (90, 80), 40.0, 25.0, 1.0);
    for kind in KINDS {
        for shading in [Shading::PerSplat, Shading::Deferred] {
            let settings = Settings {
                shading,
                culling: Culling::Off,
                ..fuzzy(kind, 3.0)
            };
            for (name, model, view) in [
                ("cloud", &cloud, &outside),
                ("parallel", &statue, &parallel),
                ("inside", &statue, &inside),
            ] {
                let name = format!("{name} {kind:?} {shading:?}");
                same(&device, model, view, &settings, &name, REFERENCE_BLENDED);
            }
        }
    }
}

#[test]
fn half_floats_are_near_and_say_the_same() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 30_000);
    let view = orbit(&model, (200, 200), 40.0, 25.0, 1.0);
    let settings = fuzzy(SplatKind::Gauss, 3.0);
    let backend = Backend::Device(device.gpu().clone());
    let float = draw(&backend, &model, &view, &settings);
    let half = Settings {
        sums: Some(SumFormat::Half),
        ..settings
    };
    let half = draw(&backend, &model, &view, &half);
    assert_ne!(float.color, half.color, "the option does nothing");
    // methods.md 8.2: below 1000 splats of comparable weight the error is less than a level; and rounding.
    let largest = float
        .color
        .iter()
        .flatten()
        .zip(half.color.iter().flatten());
    let largest = largest.map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    println!("half floats differ by up to {largest} levels");
    assert!(largest <= 2, "{largest}");
}

fn device_pictures(device: &Device, model: &Model, settings: &Settings) -> Vec<Vec<[u8; 4]>> {
    let view = orbit(model, (160, 160), 40.0, 25.0, 1.0);
    let backend = Backend::Device(device.gpu().clone());
    (0..2)
        .map(|_| draw(&backend, model, &view, settings).color)
        .collect()
}

#[test]
fn two_frames_are_the_same_to_the_bit() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 30_000);
    for kind in KINDS {
        let pictures = device_pictures(&device, &model, &fuzzy(kind, 3.0));
        assert_eq!(pictures[0], pictures[1], "{kind:?}");
    }
}

/// Every vertex of a generated mesh, without triangles and normals, of one color.
fn plain_cloud(shape: GeneratedShape, triangles: u64) -> Model {
    let spec = surfel::generate::ShapeSpec::with_triangles(shape, triangles).unwrap();
    let mut mesh = surfel::generate::mesh(&spec);
    mesh.triangles.clear();
    mesh.normals.clear();
    mesh.colors = vec![[200, 150, 100, 255]; mesh.positions.len()];
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// methods.md 15.6: a surface of one color is that color wherever anything is shown.
#[test]
fn one_color_stays_that_color() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Device(device.gpu().clone());
    // 0.8 times the color, lit from the front without a normal.
    let expected = [160, 120, 80, 255];
    for model in [
        plain_cloud(GeneratedShape::Sphere, 10_000),
        plain_cloud(GeneratedShape::Square, 10_000),
    ] {
        let view = orbit(&model, (100, 100), 30.0, 20.0, 0.8);
        for kind in KINDS {
            for (method, threshold) in [
                (Method::Pop, 1.0),
                (Method::Pop, 5.0),
                (Method::Points, 3.0),
            ] {
                for sums in [SumFormat::Float, SumFormat::Half] {
                    let settings = Settings {
                        method,
                        sums: Some(sums),
                        ..fuzzy(kind, threshold)
                    };
                    let image = draw(&backend, &model, &view, &settings);
                    let shown = image.color.iter().filter(|c| c[3] > 0);
                    assert!(shown.clone().count() > 500);
                    for color in shown {
                        // 16 bits round each sum to 1/2048 of it.
                        let most = if sums == SumFormat::Half { 3 } else { 1 };
                        let off = color.iter().zip(expected).map(|(a, b)| a.abs_diff(b)).max();
                        assert!(
                            off <= Some(most),
                            "{kind:?} {method:?} {threshold} {sums:?}: {color:?}"
                        );
                    }
                }
            }
        }
    }
}

/// A closed surface shows no background inside its outline, at any threshold, from anywhere.
#[test]
fn no_holes_in_closed_surfaces() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Device(device.gpu().clone());
    for (shape, triangles) in [
        (GeneratedShape::Sphere, 40_000),
        (GeneratedShape::Statue, 100_000),
    ] {
        let model = generated(shape, triangles);
        let size = (110, 110);
        let mut engine = surfel::render::engine::Engine::new(
            &backend,
            &model,
            size,
            surfel::render::PictureOutputs::default(),
        )
        .unwrap();
        let mut holes = [0; 2];
        for k in 0..100u32 {
            let azimuth = f64::from(k) * 137.508;
            let elevation = f64::from(k % 17) * 10.0 - 80.0;
            let view = orbit(
                &model,
                size,
                azimuth,
                elevation,
                [0.9, 0.3, 2.0][k as usize % 3],
            );
            let triangles = Settings {
                method: Method::Triangles,
                ..Settings::default()
            };
            let reference = engine.render(&view, &triangles).unwrap();
            let threshold = 1.0 + (k % 16) as f32;
            let opaque = Settings {
                blend: Some(Blend::Opaque),
                ..fuzzy(SplatKind::Ellipse, threshold)
            };
            for (count, settings) in holes
                .iter_mut()
                .zip([opaque, fuzzy(SplatKind::Gauss, threshold)])
            {
                let picture = engine.render(&view, &settings).unwrap();
                *count += surfel::image::compare(&reference, &picture, 8.0)
                    .unwrap()
                    .hole_pixels;
            }
        }
        println!("{shape:?}: holes of ellipse and gauss in 100 views: {holes:?}");
        assert_eq!(holes, [0, 0], "{shape:?}");
    }
}

/// methods.md 8.3: where all is triangles, the three passes give the picture of triangles, but where a second layer
/// lies within the offset of the first.
#[test]
fn triangles_alone_are_the_picture_of_triangles() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Device(device.gpu().clone());
    let model = generated(GeneratedShape::Sphere, 2_000);
    let view = orbit(&model, (160, 160), 30.0, 20.0, 1.0);
    let triangles = Settings {
        method: Method::Triangles,
        background: [0.1, 0.2, 0.3],
        ..Settings::default()
    };
    let reference = draw(&backend, &model, &view, &triangles);
    for shading in [Shading::PerSplat, Shading::Deferred] {
        let settings = Settings {
            shading,
            ..fuzzy(SplatKind::Gauss, 0.0)
        };
        let picture = draw(&backend, &model, &view, &settings);
        BLENDED_TRIANGLES.assert_same(&reference, &picture, &format!("{shading:?}"));
    }
}

/// methods.md 8.2: 20,000 splats in one pixel. 32-bit sums are exact to a level; 16-bit sums stall at 2048 and may be off
/// by what the method page says, but are never black.
#[test]
fn sums_of_thousands() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Device(device.gpu().clone());
    let mut mesh = surfel::mesh::Mesh {
        positions: vec![glam::Vec3::ZERO; 20_000],
        colors: vec![[230, 100, 10, 255]; 20_000],
        ..surfel::mesh::Mesh::default()
    };
    mesh.positions.push(glam::Vec3::X);
    mesh.colors.push([230, 100, 10, 255]);
    let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
    let view = orbit(&model, (60, 60), 0.0, 0.0, 0.7);
    for (sums, most) in [(SumFormat::Float, 1), (SumFormat::Half, 80)] {
        for kind in [SplatKind::Disc, SplatKind::Gauss] {
            let settings = Settings {
                method: Method::Points,
                sums: Some(sums),
                ..fuzzy(kind, 5.0)
            };
            let image = draw(&backend, &model, &view, &settings);
            let shown = image.color.iter().filter(|c| c[3] > 0);
            let off = shown.map(|c| {
                c.iter()
                    .zip([184, 80, 8, 255])
                    .map(|(a, b)| a.abs_diff(b))
                    .max()
                    .unwrap()
            });
            let off = off.max().unwrap();
            println!("{sums:?} {kind:?}: off by up to {off} levels");
            assert!(off <= most, "{sums:?} {kind:?}: {off}");
        }
    }
}

#[test]
fn what_cannot_be_blended_is_refused_by_name() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Device(device.gpu().clone());
    let model = generated(GeneratedShape::Sphere, 500);
    let view = orbit(&model, (40, 40), 0.0, 0.0, 1.0);
    let refusal = |settings: Settings| {
        let outputs = surfel::render::PictureOutputs::default();
        surfel::render::engine::Engine::new(&backend, &model, (40, 40), outputs)
            .unwrap()
            .render(&view, &settings)
            .unwrap_err()
            .to_string()
    };
    let base = fuzzy(SplatKind::Gauss, 2.0);
    for blend in [Blend::DepthThreshold, Blend::DepthRange] {
        let settings = Settings {
            blend: Some(blend),
            ..base
        };
        assert!(refusal(settings).contains("--backend reference"));
    }
    let opaque = Settings {
        blend: Some(Blend::Opaque),
        shading: Shading::Deferred,
        ..base
    };
    assert!(refusal(opaque).contains("--blend two-pass"));
}
