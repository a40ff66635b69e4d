//! Opaque ellipses by compute, by the rasterizer and on the mirror.

use super::{assert_same, assert_ways, built, colored_cloud, draw, passes, pictures};
use crate::common::{self, Device, generated, orbit};
use surfel::generate::GeneratedShape;
use surfel::pack::ColorBy;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Culling, Path, Settings, SplatKind};

fn ellipses(threshold_px: f32) -> Settings {
    Settings {
        splat: SplatKind::Ellipse,
        threshold_px,
        background: [0.2, 0.4, 0.6],
        ..Settings::default()
    }
}

/// At every threshold: alone, beside triangles, beside ellipses that are too large for compute, through the near plane.
#[test]
fn ellipses_are_the_same_by_compute_by_the_rasterizer_and_on_the_mirror() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let statue = generated(GeneratedShape::Statue, 60_000);
    let torus = generated(GeneratedShape::Torus, 60_000);
    let cloud = colored_cloud();
    let size = (400, 320);
    let outputs = PictureOutputs {
        depth: true,
        normal: false,
        values: false,
    };
    let (mut alone, mut beside) = (0, 0);
    for (name, model, threshold_px, fill) in [
        ("statue", &statue, 1.0, 0.3),
        ("statue", &statue, 2.0, 0.7),
        ("torus", &torus, 3.0, 0.7),
        ("torus", &torus, 4.5, 0.5),
        ("statue", &statue, 6.0, 1.5),
        ("statue", &statue, 8.0, 1.0),
        ("statue, triangles too", &statue, 6.0, 4.0),
        ("statue, inside", &statue, 4.0, 60.0),
        ("cloud", &cloud, 2.0, 1.0),
        ("cloud, near", &cloud, 2.0, 12.0),
        ("cloud, inside", &cloud, 2.0, 60.0),
    ] {
        let settings = ellipses(threshold_px);
        let view = orbit(model, size, 30.0, 20.0, fill);
        let what = format!("{name}, {threshold_px}, fill {fill}");
        assert_same(&device, model, &view, settings, &what);
        let insisting = Settings {
            path: Path::Compute,
            ..settings
        };
        let backend = Backend::Device(device.gpu().clone());
        let mut engine = Engine::new(&backend, model, size, outputs).unwrap();
        let (picture, passes, _) = passes(&mut engine, &view, &insisting);
        let mirror = Engine::new(&Backend::Reference, model, size, outputs)
            .unwrap()
            .with_subpixel_bits(device.gpu().info().subpixel_bits)
            .render(&view, &settings)
            .unwrap();
        pictures::REFERENCE_OUTLINES.assert_same(&mirror, &picture, &what);
        assert!(passes.contains(&"compute.resolve"), "{what}: {passes:?}");
        let has = |name| passes.contains(&name);
        alone += usize::from(has("compute.splats") && !has("opaque.splats"));
        beside += usize::from(has("compute.splats") && has("opaque.splats"));
    }
    assert!(alone >= 6 && beside >= 2, "{alone} alone, {beside} beside");
}

#[test]
fn ellipses_are_the_same_in_every_projection_and_color() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let statue = generated(GeneratedShape::Statue, 60_000);
    let cloud = colored_cloud();
    let size = (240, 200);
    for (name, model) in [("statue", &statue), ("colored cloud", &cloud)] {
        let view = orbit(model, size, 30.0, 20.0, 0.7);
        let mut mirrored = view;
        mirrored.scale[0] = -mirrored.scale[0];
        mirrored.offset[0] = -mirrored.offset[0];
        let orthographic = common::orthographic(model, size);
        for (view_name, view) in [
            ("perspective", view),
            ("mirrored", mirrored),
            ("orthographic", orthographic),
        ] {
            for threshold_px in [2.0, 3.5] {
                let plain = ellipses(threshold_px);
                let one_sided = Settings {
                    culling: Culling::Off,
                    two_sided: false,
                    ..plain
                };
                let by_kind = Settings {
                    color_by: ColorBy::Primitive,
                    ..one_sided
                };
                for settings in [plain, one_sided, by_kind] {
                    let what = format!("{name}, {view_name}, {settings:?}");
                    assert_same(&device, model, &view, settings, &what);
                }
            }
        }
    }
}

/// Sheets that face a parallel view, one exactly in the other: all centers are equally far. The first of the list is seen.
#[test]
fn of_equally_far_ellipses_the_first_is_seen() {
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
        normals: grid.map(|_| glam::Vec3::Z).collect(),
        colors: (0..side * side)
            .map(|i| [hash(i), hash(i + 7), hash(i + 99), 255])
            .collect(),
        ..surfel::mesh::Mesh::default()
    });
    let size = (203, 203);
    let mut view = common::orthographic(&cloud, size);
    view.offset = [0.001, 0.002];
    let settings = ellipses(1.0);
    let of = |path| draw(&device, &cloud, &view, &Settings { path, ..settings }).unwrap();
    let (raster, compute) = (of(Path::Raster), of(Path::Compute));
    let mut colors = raster.color.clone();
    colors.sort_unstable();
    colors.dedup();
    assert!(colors.len() > 100, "{} colors", colors.len());
    pictures::EQUALLY_FAR.assert_same(&raster, &compute, "equally far");
}

/// A view full of small ellipses is drawn by compute unless it is asked not to, and one of a few pixels is not.
#[test]
fn ellipses_go_by_compute_where_that_pays() {
    assert_ways(
        ellipses,
        &["compute.splats"],
        &[
            (1.0, 2.0, Path::Auto, true),
            (1.0, 2.0, Path::Raster, false),
            (1.0, 10.5, Path::Auto, false),
            (0.01, 2.0, Path::Auto, false),
            (0.01, 2.0, Path::Compute, true),
        ],
    );
}
