//! Which pixels a triangle, splat or point covers.

use super::scene::*;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;
use surfel::abi::Splat;
use surfel::generate::{GeneratedShape, ShapeSpec};
use surfel::pack::{DrawList, PrimitiveStyle};
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::reference::render;
use surfel::render::{Method, Settings};
use surfel::tree::{BuildOptions, build};

#[test]
fn squares_cover_exactly_the_centers_in_their_half_open_extent() {
    for eighth in 0..16 {
        let offset = eighth as f32 / 8.0;
        for (width, height) in [(3.0, 2.0), (1.0, 1.0), (0.5, 7.25)] {
            let (left, top) = (20.0 + offset, 30.0 + offset / 2.0);
            let (right, bottom) = (left + width, top + height);
            let model = Model::from_corners(&[
                [
                    at(left, top, 3.0),
                    at(left, bottom, 3.0),
                    at(right, bottom, 3.0),
                ],
                [
                    at(left, top, 3.0),
                    at(right, bottom, 3.0),
                    at(right, top, 3.0),
                ],
            ]);
            let got = coverage(&draw_flat(&model.list(), &PrimitiveStyle::default()));
            for (i, got) in got.iter().enumerate() {
                let (x, y) = ((i % 64) as f32 + 0.5, (i / 64) as f32 + 0.5);
                let inside = (left..right).contains(&x) && (top..bottom).contains(&y);
                assert_eq!(
                    *got,
                    u32::from(inside),
                    "({x}, {y}) in {left}..{right}, {top}..{bottom}"
                );
            }
        }
    }
}

#[test]
fn triangles_around_a_point_cover_every_pixel_once() {
    // Corners on pixel centers and corners, so that many centers lie exactly on edges; every winding.
    for (center, turn) in [
        ((32.0, 32.0), 0.0),
        ((31.5, 32.5), 0.3),
        ((32.3, 30.8), 1.1),
    ] {
        let corners = 11;
        let rim: Vec<Vec3> = (0..corners)
            .map(|i| {
                let angle = f64::from(i) / f64::from(corners) * 2.0 * PI + turn;
                let snap = |v: f64| (v * 2.0).round() as f32 / 2.0;
                at(
                    snap(32.0 + 27.0 * angle.cos()),
                    snap(32.0 + 27.0 * angle.sin()),
                    2.0,
                )
            })
            .collect();
        let mut count = vec![0; 64 * 64];
        for i in 0..corners as usize {
            let (a, b) = (rim[i], rim[(i + 1) % rim.len()]);
            let hub = at(center.0, center.1, 2.0);
            let triangle = if i % 2 == 0 { [hub, a, b] } else { [b, a, hub] };
            let image = draw_flat(
                &Model::from_corners(&[triangle]).list(),
                &PrimitiveStyle::default(),
            );
            for (count, covered) in count.iter_mut().zip(coverage(&image)) {
                *count += covered;
            }
        }
        for (i, count) in count.iter().enumerate() {
            let off = ((i % 64) as f32 - 31.5).hypot((i / 64) as f32 - 31.5);
            assert!(*count <= 1, "pixel {i} is covered {count} times");
            assert!(*count == 1 || off > 25.0, "pixel {i} is lost");
            assert!(*count == 0 || off < 28.5, "pixel {i} lies outside");
        }
    }
}

#[test]
fn points_cover_the_half_open_square_of_their_size() {
    for size in [0.2f32, 1.0, 1.5, 2.0, 3.0, 4.7] {
        let side = (f64::from(size.max(1.0)) * 256.0).round() / 256.0;
        for step in 0..40 {
            let (cx, cy) = (
                30.0 + step as f32 * 13.0 / 256.0,
                33.0 + step as f32 * 32.0 / 256.0,
            );
            let points = [vertex(at(cx, cy, 5.0))];
            let splats = [splat(at(cx, cy, 5.0), 0.0)];
            let style = PrimitiveStyle {
                splat_size_px: size,
                ..PrimitiveStyle::default()
            };
            let as_point = draw_flat(
                &DrawList {
                    points: &points,
                    ..DrawList::default()
                },
                &style,
            );
            let as_splat = draw_flat(
                &DrawList {
                    splats: &splats,
                    ..DrawList::default()
                },
                &style,
            );
            assert_eq!(as_point, as_splat);
            for (i, got) in coverage(&as_point).iter().enumerate() {
                let inside = |pixel: usize, center: f32| {
                    let (p, c) = (pixel as f64 + 0.5, f64::from(center));
                    (c - side / 2.0..c + side / 2.0).contains(&p)
                };
                let expected = u32::from(inside(i % 64, cx) && inside(i / 64, cy));
                assert_eq!(*got, expected, "size {size} at {cx}, {cy}, pixel {i}");
            }
        }
    }
}

/// With 4 binary places a pixel is covered as with 8 where corners and centers are rounded to 1/16 before.
#[test]
fn a_coarse_grid_is_a_fine_one_with_rounded_places() {
    let places = |bits| PrimitiveStyle {
        splat_size_px: 1.0 + 3.0 / 16.0,
        subpixel_bits: bits,
        ..PrimitiveStyle::default()
    };
    let rounded = |p: [f32; 2]| p.map(|c| (c * 16.0).round() / 16.0);
    let mut state = 1u32;
    let mut place = || {
        [(); 2].map(|()| {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            2.0 + 60.0 * (state >> 8) as f32 / (1 << 24) as f32
        })
    };
    let mut differ = 0;
    for _ in 0..200 {
        let corners = [place(), place(), place()];
        let draw = |corners: [[f32; 2]; 3], bits| {
            let [a, b, c] = corners.map(|[x, y]| at(x, y, 3.0));
            let points = [vertex(a), vertex(b), vertex(c)];
            let model = Model::from_corners(&[[a, b, c]]);
            let points = DrawList {
                points: &points,
                ..DrawList::default()
            };
            [model.list(), points].map(|list| coverage(&draw_flat(&list, &places(bits))))
        };
        let coarse = draw(corners, 4);
        assert_eq!(coarse, draw(corners.map(rounded), 8), "{corners:?}");
        let fine = draw(corners, 8);
        differ += usize::from(coarse[0] != fine[0]) + usize::from(coarse[1] != fine[1]);
    }
    assert!(
        differ > 100,
        "only {differ} of 400 pictures tell the grids apart"
    );
}

/// An engine takes the grid of a device it is compared with: pixels at edges change sides, about 1/16 of them, and no other.
#[test]
fn an_engine_snaps_to_the_grid_it_is_told() {
    let spec = ShapeSpec::with_triangles(GeneratedShape::Sphere, 2000).unwrap();
    let mesh = surfel::generate::mesh(&spec);
    let model = build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
    let view = sphere_view(3.0, 128);
    for method in [Method::Triangles, Method::Pop] {
        let settings = Settings {
            method,
            ..Settings::default()
        };
        let draw = |bits: Option<u32>| {
            let engine = Engine::new(
                &Backend::Reference,
                &model,
                (128, 128),
                PictureOutputs::default(),
            );
            let engine = engine.unwrap();
            let mut engine = match bits {
                Some(bits) => engine.with_subpixel_bits(bits),
                None => engine,
            };
            engine.render(&view, &settings).unwrap()
        };
        let [coarse, fine] = [4, 8].map(|bits| draw(Some(bits)));
        assert_eq!(draw(None), fine, "{method:?}");
        let apart = fine.color.iter().zip(&coarse.color).filter(|(a, b)| a != b);
        let (apart, covered) = (apart.count(), fine.covered_pixels() as usize);
        assert!(covered > 4000, "{method:?}: {covered} pixels");
        assert!(
            apart > 10 && apart < covered / 2,
            "{method:?}: {apart} of {covered} differ"
        );
    }
}

#[test]
fn a_splat_with_a_radius_has_its_projected_diameter_and_the_depth_of_its_center() {
    let view = from_origin((400, 400), 60.0, (1.0, 50.0));
    let f = view.focal_px();
    for (z, radius) in [(2.0f32, 0.1f32), (5.0, 0.5), (20.0, 0.03)] {
        let splats = [splat(Vec3::new(0.01, 0.02, -z), radius)];
        let list = DrawList {
            splats: &splats,
            ..DrawList::default()
        };
        let image = render(&view, &list, &PrimitiveStyle::default(), BOTH);
        let side = (2.0 * f * radius / z).max(1.0);
        let covered = (image.covered_pixels() as f32).sqrt();
        assert!((covered - side).abs() <= 1.0, "{covered} of {side} px");
        assert!(image.depth.iter().all(|d| *d == f32::INFINITY || *d == z));
    }
    // The center beside the picture: the part inside is drawn.
    let splats = [splat(Vec3::new(-6.0, 0.0, -5.0), 4.0)];
    let list = DrawList {
        splats: &splats,
        ..DrawList::default()
    };
    let image = render(&view, &list, &PrimitiveStyle::default(), BOTH);
    let right = 200.0 - f64::from(f) * 2.0 / 5.0;
    assert_eq!(image.covered_pixels() as f64, (right - 0.5).ceil() * 400.0);
}

#[test]
fn pixels_without_a_surface_show_the_background() {
    let style = PrimitiveStyle {
        background: [1.0, 0.5, 0.1],
        ..PrimitiveStyle::default()
    };
    let image = draw_flat(&DrawList::default(), &style);
    assert!(image.color.iter().all(|c| *c == [255, 128, 26, 0]));
    assert!(image.depth.iter().all(|z| *z == f32::INFINITY));
    let bare = render(
        &flat_view(),
        &DrawList::default(),
        &style,
        PictureOutputs::default(),
    );
    assert!(bare.depth.is_empty() && bare.normal.is_empty());
}

#[test]
fn degenerate_input_changes_nothing() {
    let sound = Model::from_corners(&[[at(3.0, 3.0, 5.0), at(3.0, 50.0, 5.0), at(50.0, 3.0, 5.0)]]);
    let splats = [splat(at(60.0, 60.0, 5.0), 2.0)];
    let expected = draw_flat(
        &DrawList {
            splats: &splats,
            ..sound.list()
        },
        &PrimitiveStyle::default(),
    );
    let mut model = sound.clone();
    let base = model.vertices.len() as u32;
    for bad in [f32::NAN, f32::INFINITY, 3e38, -3e38] {
        model.vertices.push(vertex(Vec3::new(bad, 1.0, -2.0)));
    }
    model.vertices.push(vertex(at(9.0, 9.0, 1.0)));
    for t in [
        [0, 1, base],
        [base + 1, 0, 1],
        [base + 4, base + 4, base + 4],
        [0, 1, 1],
        [0, 1, u32::MAX],
        [base + 2, base + 3, base + 2],
    ] {
        model.triangles.push(t);
        model.triangles.insert(0, t);
    }
    let splats = [
        splat(Vec3::new(f32::NAN, 1.0, -1.0), 1.0),
        splat(at(20.0, 20.0, f32::NEG_INFINITY), 1.0),
        splat(at(20.0, 20.0, 1.0), f32::NAN),
        splat(Vec3::new(3e38, 3e38, -1.0), 1.0),
        splats[0],
        splat(at(20.0, 20.0, -1.0), 1e30),
    ];
    let list = DrawList {
        splats: &splats,
        ..model.list()
    };
    assert_eq!(draw_flat(&list, &PrimitiveStyle::default()), expected);
    // A huge splat in front hides all, a huge triangle too.
    let huge = [splat(at(32.0, 32.0, 1.0), 1e30)];
    let list = DrawList {
        splats: &huge,
        ..model.list()
    };
    assert_eq!(
        draw_flat(&list, &PrimitiveStyle::default()).covered_pixels(),
        64 * 64
    );
    let e = 1e12;
    let huge =
        Model::from_corners(&[[at(-e, -e, 1.0), at(-e, 3.0 * e, 1.0), at(3.0 * e, -e, 1.0)]]);
    assert_eq!(
        draw_flat(&huge.list(), &PrimitiveStyle::default()).covered_pixels(),
        64 * 64
    );
}

#[test]
fn the_picture_does_not_depend_on_the_number_of_threads() {
    let model = sphere(DVec3::ZERO, 80, 40);
    let splats: Vec<Splat> = model
        .vertices
        .iter()
        .map(|v| splat(v.position * 1.001, 0.01))
        .collect();
    let list = DrawList {
        splats: &splats,
        points: &model.vertices,
        ..model.list()
    };
    let view = sphere_view(2.5, 157);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| render(&view, &list, &PrimitiveStyle::default(), BOTH))
    };
    let one = with(1);
    assert!(one.covered_pixels() > 1000);
    for threads in [2, 3, 8, 64] {
        assert_eq!(with(threads), one, "{threads} threads");
    }
}
