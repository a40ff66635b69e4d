//! Costs of a device decide how a picture is drawn, and not what is on it.

use crate::common::{Device, generated, orbit, pictures};
use glam::DVec3;
use surfel::generate::GeneratedShape;
use surfel::image::Image;
use surfel::math::camera::{Camera, View};
use surfel::mesh::Mesh;
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::cost::model::{
    DrawCosts, MergeCosts, PRIMITIVE_SIZES_PX, PassCosts, PerRasterizer, PrimitiveCosts,
    SplatCosts, TriangleCosts,
};
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Blend, Method, Path, Settings, SplatKind};
use surfel::tree::{self, BuildOptions, Model};

/// Costs by which `path` is always the cheaper, and points up to a size.
fn costs(path: Path, largest_point_px: f32) -> DrawCosts {
    let [raster, compute] = match path {
        Path::Compute => [1000.0, 1.0],
        _ => [1.0, 1000.0],
    };
    let splats = |ns| {
        Some(SplatCosts {
            splat_ns: [ns; 3],
            passes: PassCosts::default(),
        })
    };
    let triangles = |ns| {
        Some(TriangleCosts {
            triangle_ns: ns,
            passes: PassCosts::default(),
        })
    };
    let kind = Some(PerRasterizer {
        raster: splats(raster),
        compute: splats(compute),
    });
    let merge = Some(MergeCosts {
        splat_ns: 0.0,
        passes: PassCosts::default(),
    });
    DrawCosts {
        square: kind,
        ellipse: kind,
        gauss: kind,
        filtered: kind,
        visibility: kind,
        gauss_merge: merge,
        filtered_merge: merge,
        triangle: Some(PerRasterizer {
            raster: triangles(raster),
            compute: triangles(compute),
        }),
        primitives: Some(PrimitiveCosts {
            point_ns: PRIMITIVE_SIZES_PX.map(|s| if s <= largest_point_px { 1.0 } else { 100.0 }),
            quad_ns: [10.0; 6],
        }),
        node_ns: None,
        device_node_ns: None,
    }
}

struct Drawn {
    image: Image,
    passes: Vec<&'static str>,
    splats: u64,
    triangles: u64,
}

fn engine<'m>(device: &Device, model: &'m Model, size: (u32, u32)) -> Engine<'m> {
    let backend = Backend::Vulkan(device.gpu().clone());
    Engine::new(&backend, model, size, PictureOutputs::default()).unwrap()
}

fn draw(
    engine: &mut Engine<'_>,
    view: &View,
    settings: &Settings,
    costs: Option<DrawCosts>,
) -> Drawn {
    engine.set_costs(costs);
    let times = engine.draw(view, settings).unwrap();
    Drawn {
        image: engine.read(view).unwrap(),
        passes: times.passes.iter().map(|pass| pass.name).collect(),
        splats: times.counts.splats,
        triangles: times.counts.triangles,
    }
}

/// What is drawn, and by which passes it is seen that compute draws its splats; none where it cannot.
fn cases() -> Vec<(Settings, Option<&'static str>)> {
    let of = |splat, method, threshold_px| Settings {
        splat,
        method,
        threshold_px,
        path: Path::Auto,
        ..Settings::default()
    };
    use Method::{Points, Pop, Splats};
    use SplatKind::{Disc, Ellipse, Filtered, Gauss, Square, Visibility};
    let two_pass = Settings {
        blend: Some(Blend::TwoPass),
        ..of(Disc, Pop, 3.0)
    };
    vec![
        (of(Square, Pop, 1.0), Some("compute.clear")),
        (of(Square, Pop, 3.0), Some("compute.clear")),
        (of(Square, Pop, 9.0), None),
        (of(Square, Splats, 2.0), None),
        (of(Square, Points, 2.0), None),
        (of(Ellipse, Pop, 4.0), Some("compute.clear")),
        (of(Ellipse, Pop, 10.5), None),
        (of(Ellipse, Splats, 2.0), None),
        (of(Ellipse, Points, 5.0), None),
        (of(Visibility, Pop, 5.0), Some("visibility.splats")),
        (of(Visibility, Splats, 3.0), Some("visibility.splats")),
        (of(Visibility, Points, 3.0), None),
        (two_pass, Some("fuzzy.clear")),
        (of(Gauss, Pop, 2.0), Some("fuzzy.clear")),
        (of(Gauss, Splats, 6.0), Some("fuzzy.clear")),
        (of(Gauss, Points, 3.0), None),
        (of(Filtered, Pop, 1.0), Some("filtered.clear")),
        (of(Filtered, Splats, 4.0), Some("filtered.clear")),
    ]
}

#[test]
fn costs_decide_the_path_and_the_picture_stays() {
    let Some(device) = Device::open() else { return };
    if !device.gpu().info().has_int64_atomics {
        eprintln!("no 64-bit atomics: one path");
        return;
    }
    let model = generated(GeneratedShape::Statue, 20_000);
    let mut engine = engine(&device, &model, (200, 160));
    let mut seen = 0;
    // Few splats beside many triangles, and splats alone: rules of thumb would choose differently.
    for fill in [0.7, 2.5] {
        let view = orbit(&model, (200, 160), 30.0, 20.0, fill);
        for (settings, mark) in cases() {
            let what = format!("{settings:?}, fill {fill}");
            let plain = draw(&mut engine, &view, &settings, None);
            for path in [Path::Raster, Path::Compute] {
                let costs = costs(path, f32::INFINITY);
                let drawn = draw(&mut engine, &view, &settings, Some(costs));
                pictures::ANY_COSTS.assert_same(&plain.image, &drawn.image, &what);
                // Triangles go the way of squares.
                let count = match mark {
                    Some("compute.clear") => drawn.splats + drawn.triangles,
                    _ => drawn.splats,
                };
                let wanted = mark.is_some() && path == Path::Compute && count > 0;
                let is_seen = mark.is_some_and(|mark| drawn.passes.contains(&mark));
                assert_eq!(is_seen, wanted, "{what}, {path:?}: {:?}", drawn.passes);
                seen += usize::from(is_seen);
                // Who insists on a path gets it whatever it costs.
                let insisting = Settings {
                    path: Path::Raster,
                    ..settings
                };
                let drawn = draw(&mut engine, &view, &insisting, Some(costs));
                assert!(
                    mark.is_none_or(|mark| !drawn.passes.contains(&mark)),
                    "{what}: {:?}",
                    drawn.passes
                );
            }
        }
    }
    assert!(seen >= 8, "{seen} pictures by compute");
}

#[test]
fn quads_and_points_draw_the_same() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 20_000);
    let mut engine = engine(&device, &model, (200, 160));
    for fill in [0.7, 2.5] {
        let view = orbit(&model, (200, 160), 30.0, 20.0, fill);
        for (settings, _) in cases() {
            let settings = Settings {
                path: Path::Raster,
                ..settings
            };
            let what = format!("{settings:?}, fill {fill}");
            let plain = draw(&mut engine, &view, &settings, None);
            // Quads alone; and where splats differ in size, quads among points.
            for largest in [0.0, 3.0] {
                let costs = costs(Path::Raster, largest);
                let drawn = draw(&mut engine, &view, &settings, Some(costs));
                pictures::QUADS_AS_POINTS.assert_same(&plain.image, &drawn.image, &what);
            }
        }
    }
}

/// A point of a cloud, or a tiny triangle around it, so many pixels from the left and the upper border of a picture of 100 x
/// 100 in which a unit is a pixel at the distance of 100.
fn dot(from_left: f64, from_top: f64, is_cloud: bool) -> (Model, View) {
    let at = |x: f64, y: f64| (DVec3::new(x - 50.0, 50.0 - y, -100.0)).as_vec3();
    let (x, y) = (from_left, from_top);
    let mesh = if is_cloud {
        Mesh {
            positions: vec![at(x, y)],
            ..Mesh::default()
        }
    } else {
        Mesh {
            positions: vec![
                at(x - 0.01, y - 0.01),
                at(x - 0.01, y + 0.01),
                at(x + 0.01, y),
            ],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        }
    };
    let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
    // Half the field of view has the tangent 1 / 2.
    let angle = 2.0 * 0.5f64.atan();
    let camera = Camera::look_at(
        (100, 100),
        DVec3::ZERO,
        DVec3::NEG_Z,
        DVec3::Y,
        angle,
        [1.0, 1000.0],
    );
    let view = camera.view(model.origin).unwrap();
    (model, view)
}

#[test]
fn a_splat_whose_center_is_beside_the_view_is_drawn_as_point_and_as_quad() {
    let Some(device) = Device::open() else { return };
    // Center, and columns and rows of a square of 24 pixels that are in the picture.
    let places = [
        ((50.0, 50.0), (24, 24)),
        ((-5.0, 50.0), (7, 24)),
        ((105.0, 50.0), (7, 24)),
        ((50.0, -11.0), (24, 1)),
        ((108.0, 103.0), (4, 9)),
        ((-13.0, 50.0), (0, 0)),
    ];
    for ((x, y), (columns, rows)) in places {
        for (is_cloud, method) in [
            (false, Method::Pop),
            (true, Method::Splats),
            (true, Method::Points),
        ] {
            let (model, view) = dot(x, y, is_cloud);
            let mut engine = engine(&device, &model, (100, 100));
            for splat in [SplatKind::Square, SplatKind::Disc, SplatKind::Gauss] {
                let settings = Settings {
                    method,
                    splat,
                    threshold_px: 24.0,
                    path: Path::Raster,
                    ..Settings::default()
                };
                let what = format!("{x}, {y}, {method:?}, {splat:?}");
                let [points, quads] = [f32::INFINITY, 0.0].map(|largest| {
                    let costs = costs(Path::Raster, largest);
                    draw(&mut engine, &view, &settings, Some(costs)).image
                });
                let covered = points.covered_pixels();
                assert_eq!(covered, quads.covered_pixels(), "{what}");
                let square = columns * rows;
                match splat {
                    SplatKind::Square => assert_eq!(covered, square, "{what}"),
                    // Of a disc nothing may reach over the border where its square does by a corner.
                    _ => assert!(covered <= square, "{what}: {covered}"),
                }
                if columns.min(rows) >= 7 && splat == SplatKind::Disc {
                    // The segment of a circle of radius 12 that is left of it.
                    let wanted = segment(12.0, f64::from(columns as u32));
                    let found = covered as f64;
                    assert!(
                        (found - wanted).abs() <= 0.1 * wanted,
                        "{what}: {found}, {wanted}"
                    );
                }
            }
        }
    }
}

/// Area of what of a circle lies within `width` of its border.
fn segment(radius: f64, width: f64) -> f64 {
    let from_center = radius - width;
    radius * radius * (from_center / radius).acos()
        - from_center * (radius * radius - from_center * from_center).sqrt()
}
