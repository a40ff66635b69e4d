//! What compute draws fuzzy splats from ([`FuzzySplat`]) against the mirror, which finds places and footprints as they are
//! defined.
#![allow(clippy::unwrap_used, reason = "a failing test panics")]

use crate::abi::{FuzzySplat, Splat, SplatRadius, WeightedSplat};
use crate::cut::SizeMetric;
use crate::math::camera::Camera;
use crate::math::octahedral;
use crate::pack::fuzzy::FuzzyLook;
use crate::pack::splats::SplatPlan;
use crate::pack::{Footprint, Lamp, Phong, SurfaceLighting};
use crate::render::reference::fuzzy::set_up::LEAST_DEPOSIT;
use crate::render::reference::fuzzy::*;
use crate::render::reference::splat::SplatFootprint;
use glam::{DMat4, DVec2, DVec3, DVec4};
use std::ops::Range;

const SIZE: (u32, u32) = (200, 160);

/// A perspective, one that mirrors with its middle aside, and a parallel projection, of the unit ball.
fn views() -> [View; 3] {
    let camera = |fill| Camera::orbit(SIZE, DVec3::ZERO, 1.0, 0.5, 0.3, fill);
    let perspective = camera(1.0).view(DVec3::ZERO).unwrap();
    let mut mirrored = camera(0.6).view(DVec3::ZERO).unwrap();
    mirrored.scale[0] = -mirrored.scale[0];
    mirrored.offset = [0.2, -0.1];
    let mut parallel = camera(1.0);
    let (near, far) = (0.1, 100.0);
    parallel.proj = DMat4::from_cols(
        DVec4::X * 0.6,
        DVec4::Y * 0.72,
        DVec4::Z / (near - far),
        DVec4::new(0.1, -0.05, near / (near - far), 1.0),
    );
    let parallel = parallel.view(DVec3::ZERO).unwrap();
    assert!(!parallel.is_perspective && perspective.is_perspective);
    [perspective, mirrored, parallel]
}

fn plan(footprint: Footprint) -> SplatPlan {
    SplatPlan {
        footprint,
        threshold_px: 3.0,
        size: SizeMetric::Exact,
        draws_large_leaves: false,
        low_pass_px: 0.3,
        by_level: false,
        cut_view: None,
        max_point_px: f32::INFINITY,
    }
}

/// How a frame looks, and the same for packing.
fn looks(
    footprint: Footprint,
    light: SurfaceLighting,
    two_sided: bool,
) -> (PrimitiveStyle, FuzzyLook) {
    let style = PrimitiveStyle {
        splat_size_px: 3.0,
        footprint,
        is_gauss: footprint == Footprint::Oriented,
        low_pass_px: 0.3,
        depth_offset: 1.5,
        two_sided,
        light,
        ..PrimitiveStyle::default()
    };
    let look = FuzzyLook {
        is_gauss: style.is_gauss,
        depth_offset: style.depth_offset,
        two_sided,
        cull_back: style.cull_back_faces,
        use_colors: style.use_colors,
        color_by: style.color_by,
        light,
    };
    (style, look)
}

/// Splats in and around the unit ball: of every direction, thickness and size below the largest, some without a size or a
/// normal.
fn splats(count: usize, unit_px: f32) -> Vec<WeightedSplat> {
    let mut state = 1u64;
    let mut next = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    (0..count)
        .map(|i| {
            let vector = |n: &mut dyn FnMut() -> f32| Vec3::new(n(), n(), n()) * 2.0 - 1.0;
            let (center, normal) = (vector(&mut next), vector(&mut next));
            let radius = (0.3 + 5.0 * next()) / unit_px;
            let mut color = [0; 4].map(|_: u8| (next() * 256.0) as u8);
            color[3] = if i % 7 == 0 { 0 } else { color[3].max(1) };
            WeightedSplat {
                splat: Splat {
                    center,
                    radius: SplatRadius::own(if i % 5 == 0 { 0.0 } else { radius }),
                    normal: octahedral::encode(normal),
                    color,
                },
                area: if i % 11 == 0 {
                    -1.0
                } else {
                    radius * radius * next()
                },
            }
        })
        .collect()
}

/// Pixels of a unit of length in the middle of the ball.
fn unit_px(view: &View) -> f32 {
    let distance = if view.is_perspective {
        view.distance(Vec3::ZERO)
    } else {
        1.0
    };
    view.focal_px() * view.model_scale / distance
}

/// rho² of a record at the center of a pixel, widened by a Gaussian of that many pixels.
fn rho_squared(record: &FuzzySplat, x: u32, y: u32, low_pass_px: f64) -> f64 {
    let [xx, xy, yy] = record.inverse_px.map(f64::from);
    let wide = 4.0 * low_pass_px * low_pass_px;
    let (xx, yy) = (xx + wide, yy + wide);
    let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
    let d = at - DVec2::from(record.window_px.map(f64::from));
    let w = 1.0 + d.dot(DVec2::from(record.skew.map(f64::from)));
    (d.x * d.x * yy - 2.0 * d.x * d.y * xy + d.y * d.y * xx) / (xx * yy - xy * xy) / (w * w)
}

fn color(record: &FuzzySplat, has_lamp: bool) -> Vec3 {
    let [first, second] = record.color;
    if has_lamp {
        Vec3::from([first & 0xffff, first >> 16, second].map(|c| c as f32)) / 65535.0
    } else {
        let bytes = [0, 8, 16].map(|at| (first >> at & 0xff) as f32);
        Vec3::from(bytes) / 255.0 * f32::from_bits(second)
    }
}

#[test]
fn records_for_compute_have_the_place_the_footprint_and_the_color_of_the_mirror() {
    let at = |position| {
        SurfaceLighting::Phong(Phong {
            lamp: Lamp::At(position),
            ..Phong::default()
        })
    };
    let lights = [
        SurfaceLighting::Headlight,
        SurfaceLighting::Phong(Phong::default()),
        at(DVec3::new(0.2, 1.4, -0.3)),
    ];
    let mut compared = [0; 3];
    for view in views() {
        for (kind, footprint) in [Footprint::Oriented, Footprint::Circle, Footprint::Square]
            .into_iter()
            .enumerate()
        {
            for (light, two_sided) in lights.into_iter().zip([true, true, false]) {
                let (style, look) = looks(footprint, light, two_sided);
                let frame = ReferenceFrame::new(&view, &style);
                let unit = unit_px(&view);
                for (i, splat) in splats(700, unit).iter().enumerate() {
                    let what = format!("{footprint:?}, {light:?}, splat {i}");
                    let record = FuzzySplat::new(*splat, &view, &plan(footprint), &look);
                    let record = record.unwrap_or_else(|| panic!("{what}: not small"));
                    let low_pass = f64::from(style.low_pass_px);
                    let (Some(first), Some(second)) =
                        (set_up_pushed(&frame, splat), set_up_blended(&frame, splat))
                    else {
                        continue;
                    };
                    compared[kind] += 1;
                    let off = (record.depth - second.fragment.depth.own).abs();
                    assert!(off <= 2e-6, "{what}: depth off by {off}");
                    let off = (record.pushed_depth - first.fragment).abs();
                    assert!(off <= 2e-6, "{what}: pushed depth off by {off}");
                    let off = (color(&record, light != SurfaceLighting::Headlight)
                        - second.fragment.share.color)
                        .abs()
                        .max_element();
                    assert!(off <= 1e-4, "{what}: color off by {off}");
                    match (&first.footprint, &second.footprint) {
                        (SplatFootprint::Disc(own), SplatFootprint::Disc(wide)) => {
                            for (disc, low_pass) in [(own, 0.0), (wide, low_pass)] {
                                // What is small is a square in the shader too.
                                if wide.gaussian_px() < 2.0
                                    || (footprint == Footprint::Circle && low_pass > 0.0)
                                {
                                    continue;
                                }
                                for y in disc.rows.clone() {
                                    for x in disc.columns.clone() {
                                        let wanted = disc.met(x, y).rho_squared;
                                        let got = rho_squared(&record, x, y, low_pass);
                                        assert!(
                                            wanted > 1.5 || (got - wanted).abs() <= 2e-3,
                                            "{what}: rho² {got}, not {wanted}"
                                        );
                                    }
                                }
                            }
                            if look.is_gauss && splat.area >= 0.0 {
                                let covered = second.fragment.weight * wide.gaussian_px();
                                let off = (f64::from(record.area_px) / covered - 1.0).abs();
                                let is_least = second.fragment.weight <= LEAST_DEPOSIT;
                                assert!(is_least || off <= 1e-3, "{what}: area off by {off}");
                            } else {
                                assert!(record.area_px < 0.0, "{what}");
                            }
                        }
                        (SplatFootprint::Square(square), SplatFootprint::Square(_)) => {
                            let side = f64::from(record.inverse_px[0]);
                            let [x, y] = record.window_px.map(f64::from);
                            let middle =
                                |range: &Range<u32>| f64::from(range.start + range.end) / 2.0;
                            let is_whole = square.columns.start > 0
                                && square.rows.start > 0
                                && square.columns.end < SIZE.0
                                && square.rows.end < SIZE.1;
                            if is_whole {
                                let columns = f64::from(square.columns.end - square.columns.start);
                                assert!((columns - side).abs() <= 1.01, "{what}: {side} wide");
                                let off = DVec2::new(
                                    middle(&square.columns) - x,
                                    middle(&square.rows) - y,
                                );
                                assert!(off.abs().max_element() <= 0.51, "{what}: {off} aside");
                            }
                        }
                        _ => panic!("{what}: of two kinds"),
                    }
                }
            }
        }
    }
    assert!(compared.iter().all(|&n| n > 2000), "{compared:?}");
}

#[test]
fn what_lies_nowhere_covers_nothing_and_what_is_large_is_left() {
    for view in views() {
        let (_, look) = looks(Footprint::Oriented, SurfaceLighting::Headlight, true);
        let plan = plan(Footprint::Oriented);
        let to_model = view.view_from_model.inverse();
        let splat = |distance: f32, radius_px: f32, area: f32| {
            let center = to_model.transform_point3(Vec3::new(0.0, 0.0, -distance));
            let scale = if view.is_perspective { distance } else { 1.0 };
            let radius = radius_px * scale / (view.focal_px() * view.model_scale);
            WeightedSplat {
                splat: Splat {
                    center,
                    radius: SplatRadius::own(radius),
                    normal: octahedral::encode(to_model.transform_vector3(Vec3::Z)),
                    color: [255; 4],
                },
                area,
            }
        };
        let of = |splat| FuzzySplat::new(splat, &view, &plan, &look);
        let middle = 0.5 * (view.near + view.far.min(view.near + 4.0));
        // The side of its square is 16 pixels at most.
        assert!(of(splat(middle, 7.99, 1.0)).is_some());
        assert_eq!(of(splat(middle, 8.01, 1.0)), None);
        for distance in [0.9 * view.near, 1.1 * view.far] {
            let record = of(splat(distance, 2.0, 1.0)).unwrap();
            assert!(!record.window_px[0].is_finite(), "{distance}: {record:?}");
        }
        for bad in [f32::NAN, f32::INFINITY] {
            let mut lost = splat(middle, 2.0, 1.0);
            lost.splat.center.x = bad;
            // Neither drawn by compute nor handed to the rasterizer.
            let record = of(lost).unwrap();
            assert!(!record.window_px[0].is_finite(), "{bad}: {record:?}");
        }
        // With an offset of 0 a splat is not behind itself.
        let look = FuzzyLook {
            depth_offset: 0.0,
            ..look
        };
        for k in 0..200 {
            let at = splat(middle * (0.9 + 0.001 * k as f32), 2.0, 1.0);
            let record = FuzzySplat::new(at, &view, &plan, &look).unwrap();
            assert_eq!(record.depth, record.pushed_depth);
        }
    }
}
