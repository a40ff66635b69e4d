//! Triangles that cover one pixel or few, handed over as samples: the pixels of the rasterizer, and its colors.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::{Device, generated, orbit, real};
use surfel::generate::Shape;
use surfel::gpu::device::Kind;
use surfel::image::{Image, compare};
use surfel::math::camera::View;
use surfel::mesh::Mesh;
use surfel::method::engine::{Backend, Engine};
use surfel::method::renderer::{Counts, Outputs};
use surfel::method::{Culling, Path, Settings, SplatKind};
use surfel::progress::Silent;
use surfel::tree::{self, BuildOptions, Model};

/// A picture with its depths, what was drawn, and whether triangles were handed over as such.
fn draw(device: &Device, model: &Model, view: &View, settings: &Settings) -> (Image, Counts, bool) {
    let backend = Backend::Device(device.gpu().clone());
    let outputs = Outputs {
        depth: true,
        normal: false,
        values: false,
    };
    let mut engine = Engine::new(&backend, model, (view.width, view.height), outputs).unwrap();
    let times = engine.draw(view, settings).unwrap();
    let has_triangles = times.passes.iter().any(|p| p.name == "small.triangles");
    (engine.read(view).unwrap(), times.counts, has_triangles)
}

/// The same pixels as of the rasterizer, colors within one level and depths within a twentieth of a footprint but where two
/// surfaces tie or an edge runs through a pixel center (0.01 percent of the pixels, and one; of depths ten times that, since
/// a rasterizer interpolates that of a tiny triangle from where the picture begins).
fn assert_same(device: &Device, model: &Model, view: &View, settings: Settings, what: &str) {
    let [(raster, of_raster, _), (compute, of_compute, has_triangles)] =
        [Path::Raster, Path::Compute]
            .map(|path| draw(device, model, view, &Settings { path, ..settings }));
    if device.gpu().info().kind == Kind::Cpu {
        assert!(!has_triangles, "{what}: nothing was sampled");
    }
    assert!(of_raster.triangles > 1000, "{what}: {of_raster:?}");
    assert_eq!(of_raster.triangles, of_compute.triangles, "{what}");
    if settings.threshold_px <= 2.0 {
        // Above that the rasterizer alone has hidden ones left out.
        assert_eq!(of_raster.splats, of_compute.splats, "{what}");
    }
    let d = compare(&raster, &compute, 1.5).unwrap();
    let pixels = f64::from(view.width * view.height);
    assert!(d.object.pixels > 500, "{what}: an empty picture");
    assert!(
        d.whole.past_level as f64 <= 1.0 + pixels * 1e-4,
        "{what}: {d:?}"
    );
    let tolerance = 0.05 * view.far / view.focal_px();
    let [mut coverage, mut depths] = [0, 0];
    for (a, b) in raster.depth.iter().zip(&compute.depth) {
        coverage += usize::from(a.is_finite() != b.is_finite());
        depths += usize::from(a.is_finite() && b.is_finite() && (a - b).abs() > tolerance);
    }
    assert!(
        coverage <= 1,
        "{what}: {coverage} pixels are covered by one only"
    );
    assert!(
        depths as f64 <= 1.0 + pixels * 1e-3,
        "{what}: {depths} depths"
    );
}

/// Every projection; small and large triangles, needles, and both at thresholds where most leaves are triangles.
#[test]
fn samples_are_the_pixels_of_the_rasterizer() {
    let Some(device) = Device::open() else { return };
    let size = (240, 200);
    for (shape, triangles) in [(Shape::Statue, 100_000), (Shape::Torus, 60_000)] {
        let model = generated(shape, triangles);
        let view = orbit(&model, size, 30.0, 20.0, 0.9);
        let mut mirrored = view;
        mirrored.scale[0] = -mirrored.scale[0];
        mirrored.offset = [0.07, -0.03];
        let orthographic = common::orthographic(&model, size);
        for (name, view) in [
            ("perspective", view),
            ("mirrored", mirrored),
            ("orthographic", orthographic),
        ] {
            for (threshold_px, culling) in [
                (0.0, Culling::Auto),
                (0.3, Culling::Off),
                (0.6, Culling::Auto),
            ] {
                for splat in [SplatKind::Square, SplatKind::Disc] {
                    let settings = Settings {
                        splat,
                        threshold_px,
                        culling,
                        ..Settings::default()
                    };
                    let what = format!("{shape:?}, {name}, {threshold_px}, {culling:?}, {splat:?}");
                    assert_same(&device, &model, &view, settings, &what);
                }
            }
        }
    }
}

/// Colors between corners, corners without a normal, and one-sided light.
#[test]
fn samples_have_the_colors_of_the_rasterizer() {
    let Some(device) = Device::open() else { return };
    let cells = 150u32;
    let at = |i: u32| f64::from(i) / f64::from(cells) * 2.0 - 1.0;
    let mut mesh = Mesh::default();
    for j in 0..=cells {
        for i in 0..=cells {
            let (x, y) = (at(i), at(j));
            let z = 0.2 * (7.0 * x).sin() * (5.0 * y).cos();
            mesh.positions.push(glam::DVec3::new(x, y, z).as_vec3());
            mesh.colors.push([
                (i * 37 % 256) as u8,
                (j * 91 % 256) as u8,
                ((i + j) % 256) as u8,
                255,
            ]);
        }
    }
    let row = cells + 1;
    for j in 0..cells {
        for i in 0..cells {
            let a = j * row + i;
            mesh.triangles.push([a, a + 1, a + row]);
            mesh.triangles.push([a + 1, a + row + 1, a + row]);
        }
    }
    let model = tree::build(mesh, &BuildOptions::default(), &Silent).unwrap();
    let view = orbit(&model, (160, 160), 10.0, 30.0, 0.8);
    for (use_colors, two_sided) in [(true, true), (false, true), (true, false)] {
        let settings = Settings {
            use_colors,
            two_sided,
            threshold_px: 0.4,
            background: [0.2, 0.4, 0.6],
            ..Settings::default()
        };
        let what = format!("colors {use_colors}, two-sided {two_sided}");
        assert_same(&device, &model, &view, settings, &what);
    }
}

#[test]
fn samples_of_a_scan_are_the_pixels_of_the_rasterizer() {
    let Some(device) = Device::open() else { return };
    let Some(model) = real("meshes/bun_zipper.ply.gz") else {
        return;
    };
    // Above a pixel too, beside splats that are larger.
    for (fill, threshold_px) in [(0.3, 0.25), (1.0, 0.25), (1.0, 1.5), (2.0, 3.0)] {
        for splat in [SplatKind::Square, SplatKind::Disc] {
            let view = orbit(&model, (300, 300), 30.0, 20.0, fill);
            let settings = Settings {
                splat,
                threshold_px,
                ..Settings::default()
            };
            let what = format!("fill {fill}, threshold {threshold_px}, {splat:?}");
            assert_same(&device, &model, &view, settings, &what);
        }
    }
}
