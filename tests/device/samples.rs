//! Triangles that cover one pixel or few, handed over as samples: the pixels of the rasterizer, and its colors.

use crate::common::{Device, generated, orbit, pictures, scans};
use glam::{DVec2, DVec3, Vec3};
use surfel::cut::{
    Cut, CutSelector, NodeTester, SizeMetric, SplatFootprints, ZeroAreaSet, select, strip_center,
};
use surfel::generate::GeneratedShape;
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::mesh::Mesh;
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::stats::FrameCounts;
use surfel::render::{
    Blend, Culling, Method, Occlusion, Path, Settings, SplatKind, cut_key, frame_plan,
};
use surfel::tree::{self, BuildOptions, Model};

/// A picture with its depths, what was drawn, and whether triangles were handed over as such.
fn draw(
    device: &Device,
    model: &Model,
    view: &View,
    settings: &Settings,
) -> (Image, FrameCounts, bool) {
    let backend = Backend::Device(device.gpu().clone());
    let outputs = PictureOutputs {
        depth: true,
        normal: false,
        values: false,
    };
    let mut engine = Engine::new(&backend, model, (view.width, view.height), outputs).unwrap();
    let times = engine.draw(view, settings).unwrap();
    let has_triangles = times.passes.iter().any(|p| p.name == "compute.triangles");
    (engine.read(view).unwrap(), times.counts, has_triangles)
}

/// The same pixels as of the rasterizer, of as many triangles.
fn assert_same(device: &Device, model: &Model, view: &View, settings: Settings, what: &str) {
    let [(raster, of_raster, _), (compute, of_compute, has_triangles)] =
        [Path::Raster, Path::Compute]
            .map(|path| draw(device, model, view, &Settings { path, ..settings }));
    if crate::common::is_software(device) {
        assert!(!has_triangles, "{what}: nothing was sampled");
    }
    assert!(of_raster.triangles > 1000, "{what}: {of_raster:?}");
    assert_eq!(of_raster.triangles, of_compute.triangles, "{what}");
    if settings.threshold_px <= 2.0 {
        // Above that the rasterizer alone has hidden ones left out.
        assert_eq!(of_raster.splats, of_compute.splats, "{what}");
    }
    let oracle = pictures::SAMPLES_AS_RASTER.seen_in(view);
    oracle.assert_same(&raster, &compute, what);
}

/// Every projection; small and large triangles, needles, and both at thresholds where most leaves are triangles.
#[test]
fn samples_are_the_pixels_of_the_rasterizer() {
    let Some(device) = Device::open() else { return };
    let size = (240, 200);
    for (shape, triangles) in [
        (GeneratedShape::Statue, 100_000),
        (GeneratedShape::Torus, 60_000),
    ] {
        let model = generated(shape, triangles);
        let view = orbit(&model, size, 30.0, 20.0, 0.9);
        let mut mirrored = view;
        mirrored.scale[0] = -mirrored.scale[0];
        mirrored.offset = [0.07, -0.03];
        let orthographic = crate::common::orthographic(&model, size);
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

/// Many centers lie beside the needle that covers them, by less than its corners are moved by.
#[test]
fn samples_of_needles_leave_no_holes() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Torus, 1_000_000);
    for (azimuth, fill) in [(20.0, 1.0), (80.0, 0.6)] {
        let view = orbit(&model, (300, 300), azimuth, 20.0, fill);
        let settings = Settings {
            threshold_px: 0.0,
            ..Settings::default()
        };
        let what = format!("{azimuth}, {fill}");
        assert_same(&device, &model, &view, settings, &what);
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
    let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
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
    for (name, model) in scans(&["meshes/bun_zipper.ply.gz"]) {
        // Above a pixel too, beside splats that are larger.
        for (fill, threshold_px) in [(0.3, 0.25), (1.0, 0.25), (1.0, 1.6), (2.0, 3.0)] {
            for splat in [SplatKind::Square, SplatKind::Disc] {
                let view = orbit(&model, (300, 300), 30.0, 20.0, fill);
                let settings = Settings {
                    splat,
                    threshold_px,
                    ..Settings::default()
                };
                let what = format!("{name}, fill {fill}, threshold {threshold_px}, {splat:?}");
                assert_same(&device, &model, &view, settings, &what);
            }
        }
    }
}

/// Where splats of a pixel are samples, thresholds of up to a pixel and a half are a pixel: the same picture of the same splats, on a
/// device and by its mirror. Larger ones are not, nor is any where splats stay squares.
#[test]
fn thresholds_of_little_more_than_a_pixel_are_a_pixel() {
    let model = generated(GeneratedShape::Statue, 300_000);
    let cloud = {
        let points = Mesh {
            positions: model.vertices.iter().map(|v| v.position).collect(),
            ..Mesh::default()
        };
        tree::build(points, &BuildOptions::default(), &SilentProgress).unwrap()
    };
    let view = orbit(&model, (120, 90), 30.0, 20.0, 1.0);
    let at = |threshold_px| Settings {
        threshold_px,
        ..Settings::default()
    };
    let device = Device::open();
    let device = device.iter().map(|d| Backend::Device(d.gpu().clone()));
    for backend in device.chain([Backend::Reference]) {
        let size = (view.width, view.height);
        let mut engine = Engine::new(&backend, &model, size, PictureOutputs::default()).unwrap();
        for splat in [SplatKind::Square, SplatKind::Disc] {
            for occlusion in [Occlusion::Auto, Occlusion::Off] {
                let mut draw = |threshold_px| {
                    let settings = Settings {
                        splat,
                        occlusion,
                        ..at(threshold_px)
                    };
                    let counts = engine.draw(&view, &settings).unwrap().counts;
                    (engine.read(&view).unwrap().color, counts.splats)
                };
                let one = draw(1.0);
                assert!(one.1 > 1000, "{splat:?}: {} splats", one.1);
                assert!(draw(1.2) == one && draw(1.5) == one, "{splat:?}");
                let larger = draw(1.51);
                assert!(larger.0 != one.0, "{splat:?}");
            }
        }
    }
    let drawn = |settings: &Settings, model| {
        frame_plan::resolve_settings(settings, model, &view).threshold_px
    };
    assert_eq!(drawn(&at(1.2), &model), 1.0);
    assert_eq!(drawn(&at(0.7), &model), 0.7);
    assert_eq!(drawn(&at(1.2), &cloud), 1.2);
    let (usual, splat) = (at(1.2), SplatKind::Ellipse);
    for others in [
        Settings { splat, ..usual },
        Settings {
            blend: Some(Blend::TwoPass),
            ..usual
        },
        Settings {
            size: SizeMetric::Center,
            ..usual
        },
        Settings {
            method: Method::Splats,
            ..usual
        },
        Settings {
            method: Method::Points,
            ..usual
        },
    ] {
        assert_eq!(drawn(&others, &model), 1.2, "{others:?}");
    }
}

/// Where a point is seen, pixels, in double precision.
fn seen_at(view: &View, position: Vec3) -> DVec2 {
    let position: DVec3 = position.as_dvec3();
    let v = view.view_from_model.as_dmat4().transform_point3(position);
    let window = |i: usize, at: f64, size: u32, sign: f64| {
        let (scale, offset) = (f64::from(view.scale[i]), f64::from(view.offset[i]));
        let x = if view.is_perspective {
            (scale * at + offset * v.z) / -v.z
        } else {
            scale * at + offset
        };
        (1.0 + sign * x) / 2.0 * f64::from(size)
    };
    DVec2::new(
        window(0, v.x, view.width, 1.0),
        window(1, v.y, view.height, -1.0),
    )
}

/// The pixels whose centers a triangle contains, by its corners in double precision.
fn centers_in(model: &Model, view: &View, leaf: u32) -> Vec<[i64; 2]> {
    let corner = |corner: u32| seen_at(view, model.vertices[corner as usize].position);
    let [a, b, c] = model.triangles[leaf as usize].map(corner);
    let mut pixels = Vec::new();
    let low = a.min(b).min(c).floor();
    let high = a.max(b).max(c).ceil();
    let in_picture = |x: f64, size: u32| x >= 0.0 && x < f64::from(size);
    for y in low.y as i64..high.y as i64 {
        for x in low.x as i64..high.x as i64 {
            let center = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let side = |p: DVec2, q: DVec2| (q - p).perp_dot(center - p);
            let sides = [side(a, b), side(b, c), side(c, a)];
            if (sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0))
                && in_picture(center.x, view.width)
                && in_picture(center.y, view.height)
            {
                pixels.push([x, y]);
            }
        }
    }
    pixels
}

/// Up to a pixel whole branches of the tree are left out: no triangle of them contains a pixel's center, and many nodes
/// are never looked at. A splat stands for triangles that contain no center but that of its own pixel; the splats of a row
/// that are left have the pixels of all centers that the triangles below it contain.
#[test]
fn branches_that_are_left_out_cover_nothing() {
    for (shape, triangles) in [
        (GeneratedShape::Statue, 300_000),
        (GeneratedShape::Sphere, 300_000),
    ] {
        let model = generated(shape, triangles);
        let undrawn = ZeroAreaSet::new(&model);
        let view = orbit(&model, (80, 64), 30.0, 20.0, 0.9);
        let orthographic = crate::common::orthographic(&model, (80, 64));
        for (view, side_px) in [
            (view, 0.0),
            (view, 0.2),
            (view, 1.0),
            (orthographic, 0.0),
            (orthographic, 1.0),
        ] {
            let what = format!("{shape:?}, {side_px}, {}", view.is_perspective);
            let settings = Settings {
                threshold_px: side_px,
                culling: Culling::Off,
                ..Settings::default()
            };
            let with = cut_key::cut_settings(&settings, &model);
            let footprints = SplatFootprints {
                side_px,
                hides: false,
                are_discs: false,
                large_leaves: false,
                is_cloud: false,
            };
            let (mut cut, mut all) = (Cut::default(), Cut::default());
            let seen = (footprints, &undrawn);
            CutSelector::default().select_seen(&model, &view, &with, seen, &mut cut);
            select(&model, &view, &with, &mut all);
            assert!(
                20 * cut.stats.visited < (if side_px < 1.0 { 16 } else { 19 }) * all.stats.visited,
                "{what}: {} of {} visited",
                cut.stats.visited,
                all.stats.visited
            );
            let mut is_drawn = vec![false; model.triangles.len()];
            let rows = cut.strips.iter().map(|row| row.node);
            for node in cut.nodes.iter().copied().chain(rows) {
                for leaf in model.tree.leaf_range(node) {
                    is_drawn[leaf as usize] = true;
                }
            }
            for &leaf in cut.leaves.iter().chain(&cut.triangles) {
                is_drawn[leaf as usize] = true;
            }
            let left_out = (0..model.triangles.len() as u32).filter(|&t| !is_drawn[t as usize]);
            let mut count = 0;
            for leaf in left_out {
                count += 1;
                let centers = centers_in(&model, &view, leaf);
                assert!(centers.is_empty(), "{what}: {leaf} at {centers:?}");
            }
            let least = if side_px < 1.0 { 3 } else { 10 };
            assert!(least * count > model.triangles.len(), "{what}: {count}");
            let pixel = |at: Vec3| {
                let at = seen_at(&view, at).floor();
                [at.x as i64, at.y as i64]
            };
            let mut larger = 0;
            for &id in &cut.nodes {
                let node = &model.tree.nodes[id as usize];
                let tester = NodeTester::new(&model, &view, &with);
                larger += usize::from(!tester.is_small(node.center, node.radius));
                let own = pixel(node.center);
                for leaf in model.tree.leaf_range(id) {
                    let centers = centers_in(&model, &view, leaf);
                    assert!(
                        centers.iter().all(|&center| center == own),
                        "{what}: {id} at {own:?} stands for {centers:?}"
                    );
                }
            }
            assert!(side_px < 1.0 || larger > 1000, "{what}: {larger}");
            for run in &cut.strips {
                let node = &model.tree.nodes[run.node as usize];
                let own: Vec<[i64; 2]> = (0..run.count)
                    .filter(|i| run.seen >> i & 1 != 0)
                    .map(|i| pixel(strip_center(node, run.count, i)))
                    .collect();
                for leaf in model.tree.leaf_range(run.node) {
                    let centers = centers_in(&model, &view, leaf);
                    assert!(
                        centers.iter().all(|center| own.contains(center)),
                        "{what}: row {} at {own:?} stands for {centers:?}",
                        run.node
                    );
                }
            }
        }
    }
}
