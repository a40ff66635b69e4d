//! Visibility splats by compute and by the rasterizer.

use super::{assert_same, assert_ways, built, colored_cloud, draw, passes, pictures, visible};
use crate::common::{self, Device, generated, orbit};
use surfel::generate::GeneratedShape;
use surfel::image::Image;
use surfel::pack::{ColorBy, Phong, SurfaceLighting};
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Culling, Method, Path, Reconstruction, Settings};

/// At every threshold and in every reconstruction: alone, beside triangles, beside splats that are too large for compute.
#[test]
fn visibility_splats_are_the_same_at_every_size() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let statue = generated(GeneratedShape::Statue, 60_000);
    let coarse = generated(GeneratedShape::Statue, 5_000);
    let cloud = colored_cloud();
    let size = (240, 200);
    let backend = Backend::Device(device.gpu().clone());
    let (mut alone, mut beside) = (0, 0);
    for reconstruction in [
        Reconstruction::Gaussian,
        Reconstruction::Density,
        Reconstruction::PullPush,
    ] {
        for (name, model, method, threshold_px, fill) in [
            ("statue", &statue, Method::Pop, 1.0, 0.3),
            ("statue", &statue, Method::Pop, 2.0, 1.0),
            ("statue", &statue, Method::Pop, 4.5, 0.7),
            ("statue, triangles too", &statue, Method::Pop, 6.0, 4.0),
            ("statue, inside", &statue, Method::Pop, 4.0, 60.0),
            ("statue, large", &statue, Method::Pop, 16.0, 1.0),
            ("leaves", &coarse, Method::Splats, 1.0, 4.0),
            ("cloud", &cloud, Method::Pop, 2.0, 1.0),
            ("cloud, near", &cloud, Method::Pop, 2.0, 12.0),
        ] {
            let settings = Settings {
                method,
                reconstruction,
                ..visible(threshold_px)
            };
            let view = orbit(model, size, 30.0, 20.0, fill);
            let what = format!("{name}, {threshold_px}, {reconstruction:?}");
            assert_same(&device, model, &view, settings, &what);
            let mut engine = Engine::new(&backend, model, size, PictureOutputs::default()).unwrap();
            let insisting = Settings {
                path: Path::Compute,
                ..settings
            };
            let (_, passes, _) = passes(&mut engine, &view, &insisting);
            println!("{what}: {passes:?}");
            let is_rastered = passes.contains(&"visibility.depth");
            assert!(passes.contains(&"visibility.resolve"), "{what}: {passes:?}");
            alone += usize::from(!is_rastered);
            beside += usize::from(is_rastered);
        }
    }
    assert!(alone >= 6 && beside >= 12, "{alone} alone, {beside} beside");
}

#[test]
fn visibility_splats_are_the_same_in_every_light_projection_and_color() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let model = generated(GeneratedShape::Statue, 60_000);
    let size = (240, 200);
    let view = orbit(&model, size, 30.0, 20.0, 0.7);
    let mut mirrored = view;
    mirrored.scale[0] = -mirrored.scale[0];
    mirrored.offset[0] = -mirrored.offset[0];
    let orthographic = common::orthographic(&model, size);
    for (name, view) in [
        ("perspective", view),
        ("mirrored", mirrored),
        ("orthographic", orthographic),
    ] {
        let plain = visible(3.0);
        let offset = |by| Settings {
            depth_offset: Some(by),
            ..plain
        };
        let by = |color_by| Settings { color_by, ..plain };
        for settings in [
            plain,
            offset(0.0),
            offset(4.0),
            by(ColorBy::Classification),
            by(ColorBy::Normal),
            by(ColorBy::Level),
            Settings {
                light: SurfaceLighting::Phong(Phong::default()),
                ..plain
            },
            Settings {
                color_by: ColorBy::Primitive,
                culling: Culling::Off,
                two_sided: false,
                ..plain
            },
        ] {
            let what = format!("{name}, {settings:?}");
            assert_same(&device, &model, &view, settings, &what);
        }
    }
}

/// A sheet that faces a parallel view: all centers are equally far, and all footprints. Of those the first drawn wins, of
/// centers the last, by either path and on the mirror.
#[test]
fn of_equally_far_visibility_splats_the_same_one_is_seen() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let side = 40;
    let grid = (0..side * side).map(|i| (i % side, i / side));
    let hash = |i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8;
    let cloud = built(surfel::mesh::Mesh {
        positions: (grid.clone())
            .map(|(x, y)| glam::Vec3::new(x as f32 / 20.0 - 0.975, y as f32 / 20.0 - 0.975, 0.0))
            .collect(),
        normals: grid.clone().map(|_| glam::Vec3::Z).collect(),
        colors: (0..side * side)
            .map(|i| [hash(i), hash(i + 7), hash(i + 99), 255])
            .collect(),
        ..surfel::mesh::Mesh::default()
    });
    let size = (203, 203);
    let camera = |scale: f64| {
        let mut camera = surfel::math::camera::Camera::look_at(
            size,
            glam::DVec3::new(0.0, 0.0, 3.0),
            glam::DVec3::ZERO,
            glam::DVec3::Y,
            0.9,
            [1.0, 8.0],
        );
        camera.proj = glam::DMat4::from_cols(
            glam::DVec4::X * scale,
            glam::DVec4::Y * scale,
            glam::DVec4::Z / -7.0,
            glam::DVec4::new(0.001, 0.002, -1.0 / 7.0, 1.0),
        );
        camera.view(cloud.origin).unwrap()
    };
    // Footprints of some pixels that no center is near enough to fill; several centers in a pixel.
    for (scale, color_by) in [
        (0.9, ColorBy::Shading),
        (0.9, ColorBy::Classification),
        (0.12, ColorBy::Shading),
    ] {
        let settings = Settings {
            color_by,
            ..visible(1.0)
        };
        let view = camera(scale);
        let of = |path| draw(&device, &cloud, &view, &Settings { path, ..settings }).unwrap();
        let (raster, compute) = (of(Path::Raster), of(Path::Compute));
        let colors = |image: &Image| {
            let mut colors = image.color.clone();
            colors.sort_unstable();
            colors.dedup();
            colors.len()
        };
        assert!(color_by != ColorBy::Shading || colors(&raster) > 100);
        let what = format!("{scale}, {color_by:?}");
        pictures::EQUALLY_FAR.assert_same(&raster, &compute, &what);
    }
}

#[test]
fn visibility_splats_go_by_compute_where_that_pays() {
    assert_ways(
        visible,
        &["visibility.splats"],
        &[
            (1.0, 2.0, Path::Auto, true),
            (1.0, 2.0, Path::Raster, false),
            (1.0, 16.5, Path::Auto, false),
            (0.01, 4.0, Path::Auto, false),
            (0.01, 4.0, Path::Compute, true),
        ],
    );
}
