//! What splats of lists and of cuts leave in a picture, pixel by pixel.
#![allow(clippy::unwrap_used, reason = "a failing test panics")]

use super::*;
use crate::abi::{FrameConstants, SplatRadius, constants};
use crate::cut::{CutSettings, select};
use crate::generate::{self, GeneratedShape, ShapeSpec};
use crate::math::camera::Camera;
use crate::math::octahedral;
use crate::pack::Footprint;
use crate::pack::for_tests::levels;
use crate::progress::SilentProgress;
use crate::tree::{self, BuildOptions};
use bytemuck::Zeroable;
use glam::{DVec3, Mat4, Vec3};
use std::sync::atomic::Ordering;

const SIZE: [u32; 2] = [90, 110];
const RECT: [u32; 4] = [7, 0, 85, 104];

/// A camera at (0, 0, 3) that looks to where z falls, with depth 1 at a distance of 0.5.
fn screen(size_px: f32) -> SplatScreen {
    let [width, height] = SIZE.map(|v| v as f32);
    let view = Mat4::from_translation(Vec3::new(0.0, 0.1, -3.0));
    let clip = Mat4::from_cols_array_2d(&[
        [2.4, 0.0, 0.0, 0.0],
        [0.0, -2.4 * width / height, 0.0, 0.0],
        [0.0, 0.0, 0.0, -1.0],
        [0.0, 0.0, 0.5, 0.0],
    ]);
    let half = Vec3::new(0.5 * width, 0.5 * height, 1.0);
    let window = Mat4::from_translation(half.with_z(0.0)) * Mat4::from_scale(half);
    let frame = FrameConstants {
        view_from_model: view.to_cols_array_2d(),
        clip_from_view: clip.to_cols_array_2d(),
        window_from_model: (window * clip * view).to_cols_array_2d(),
        model_scale: 1.0,
        ray_scale: [2.0 / (2.4 * width), -2.0 / (2.4 * width)],
        focal_px: 1.2 * width,
        splat_size_px: size_px,
        ..FrameConstants::zeroed()
    };
    SplatScreen::new(&frame, RECT).unwrap()
}

/// The keys of a list as `shaders/compute/splats.comp` leaves them, splat by splat and pixel by pixel.
fn expected(
    splats: &[Splat],
    (look, samples): (SplatShape, usize),
    screen: &SplatScreen,
) -> Vec<u64> {
    let [left, top, right, bottom] = screen.rect_px;
    let mut keys = vec![0; screen.pixels()];
    for (number, splat) in splats.iter().enumerate() {
        let Vec3 { x, y, z } = splat.center;
        let times = |row: &[f32; 4]| x * row[0] + (y * row[1] + (z * row[2] + row[3]));
        let in_view = times(&screen.along);
        let depth = in_view * screen.depth[0] + screen.depth[1];
        let last = in_view * screen.last[0] + screen.last[1];
        if !(depth >= 0.0 && depth <= last && last > 0.0) {
            continue;
        }
        let window = screen.window.map(|row| times(&row) / last);
        let is_sample = number >= splats.len() - samples;
        let radius = splat.radius.model_units();
        let half = match radius > 0.0 && !look.has_one_size && !is_sample {
            true => radius * screen.model_scale * screen.focal_px / last,
            false => 0.5 * screen.size_px,
        };
        let side = if is_sample { 1.0 } else { 2.0 * half };
        let is_round =
            look.footprint == Footprint::Circle && !is_sample && side >= std::f32::consts::SQRT_2;
        let form = 4.0 / (side * side);
        // A pixel belongs to the square that contains its center, in steps of 1/256 pixel.
        let steps = (256.0 * side.max(1.0)).round_ties_even() as i64;
        let low = window.map(|p| (256.0 * p).round_ties_even() as i64 - steps / 2);
        let key =
            u64::from((depth / last).to_bits()) << 32 | u64::from(!(number as u32 | SPLAT_BIT));
        let pixels = (top..bottom).flat_map(|y| (left..right).map(move |x| [x, y]));
        for (place, pixel) in keys.iter_mut().zip(pixels) {
            let offset = [0, 1].map(|i| pixel[i] as f32 + 0.5 - window[i]);
            let is_in = match is_round {
                true => form * offset[0] * offset[0] + form * offset[1] * offset[1] <= 1.0,
                false => [0, 1].into_iter().all(|i| {
                    let center = 256 * i64::from(pixel[i]) + 128;
                    low[i] <= center && center < low[i] + steps
                }),
            };
            if is_in {
                *place = key.max(*place);
            }
        }
    }
    keys
}

/// What a picture lies in, with some words more.
struct Planes {
    colors: Vec<u32>,
    depths: Vec<f32>,
    width: usize,
    pitch: usize,
}

/// More words than are asked for, behind each row of colors and behind all.
const MORE: usize = 5;

impl Planes {
    /// What was there is not looked at.
    fn of(screen: &SplatScreen) -> Self {
        let (width, pixels) = (screen.width(), screen.pixels());
        let pitch = width + MORE;
        Self {
            colors: vec![u32::MAX; pixels / width * pitch],
            depths: vec![-1.0; pixels + MORE],
            width,
            pitch,
        }
    }

    fn picture(&mut self) -> ShownRectangle<'_> {
        ShownRectangle {
            colors: &mut self.colors,
            pitch: self.pitch,
            depths: &mut self.depths,
            is_begun: false,
        }
    }

    /// Depths and colors in one, but for the words that nothing is written to.
    fn keys(&self) -> Vec<u64> {
        let of = |(&color, &depth): (&u32, &f32)| match depth {
            0.0 => {
                assert_eq!(color, BACKGROUND);
                0
            }
            _ => u64::from(depth.to_bits()) << 32 | u64::from(color),
        };
        let rows = self.colors.chunks(self.pitch);
        let (own, more): (Vec<_>, Vec<_>) = rows.map(|row| row.split_at(self.width)).unzip();
        let (depths, rest) = self.depths.split_at(self.depths.len() - MORE);
        assert!(more.iter().flat_map(|m| m.iter()).all(|&c| c == u32::MAX));
        assert!(rest.iter().all(|&depth| depth == -1.0));
        let own = own.iter().flat_map(|row| row.iter());
        own.zip(depths).map(of).collect()
    }
}

/// Numbers in 0..1, the same in every run.
fn random(mut state: u64) -> impl FnMut() -> f32 {
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// A crowd around what is seen, with radii of up to `largest` pixels; one in eight is odd.
fn crowd(count: usize, largest: f32, seed: u64) -> Vec<Splat> {
    let mut next = random(seed);
    (0..count)
        .map(|i| {
            let mut splat = Splat {
                center: Vec3::new(3.0 * next() - 1.5, 3.0 * next() - 1.5, 2.0 * next() - 1.0),
                radius: SplatRadius::own(largest * next() * next() / 110.0),
                ..Splat::zeroed()
            };
            match i % 24 {
                0 => splat.center.x = f32::NAN,
                3 => splat.center.z = 3.5,
                6 => splat.center = Vec3::new(f32::INFINITY, 0.0, 0.0),
                9 => splat.radius = SplatRadius::with_rest(splat.radius.model_units().to_bits()),
                12 => splat.center.z = 2.4999,
                // In one place, in one row: what ends in which row is seen at the border of bands.
                15 | 18 => splat.center = Vec3::new(0.3, -0.4, 0.5),
                21 => splat.center.y = 0.0,
                _ => {}
            }
            splat
        })
        .collect()
}

#[test]
fn keys_are_those_of_plain_loops_at_every_width_of_vectors() {
    let mut places = SplatPlaces::default();
    let light = light(true, false);
    let mut covered = 0;
    for (seed, (size_px, largest)) in [
        (1.0, 2.0),
        (1.3, 1.5),
        (2.0, 3.0),
        (3.0, 5.0),
        (5.7, 6.0),
        (24.3, 70.0),
    ]
    .into_iter()
    .enumerate()
    {
        for (count, samples) in [(0, 0), (1, 0), (1, 1), (900, 0), (20_000, 7_001)] {
            let splats = crowd(count, largest, 5 + seed as u64);
            for (footprint, has_one_size) in [
                (Footprint::Square, true),
                (Footprint::Square, false),
                (Footprint::Circle, true),
                (Footprint::Circle, false),
            ] {
                let look = SplatShape {
                    footprint,
                    has_one_size,
                };
                let screen = screen(size_px);
                // Of many, plain loops look at the first ones only: the rest is behind them.
                let wanted = match count {
                    20_000 => None,
                    _ => Some(expected(&splats, (look, samples), &screen)),
                };
                let mut first = None;
                for level in levels() {
                    let what = format!("{size_px}, {count}, {samples}, {look:?}, {level:?}");
                    let mut planes = Planes::of(&screen);
                    let own = splats.split_at(count - samples);
                    let parts = own.0.chunks(parallel::PART);
                    let parts = parts
                        .map(|part| (ListedSplats::List(part), part.len()))
                        .collect();
                    let list = OpaqueSplatList {
                        parts,
                        look,
                        samples: own.1,
                    };
                    let (frame, out) = ((&screen, &light), (&mut places, planes.picture()));
                    draw_by(level, list, frame, KnownSplats::Places, out);
                    let keys = planes.keys();
                    covered += keys.iter().filter(|&&key| key != 0).count();
                    if let Some(wanted) = &wanted {
                        assert!(keys == *wanted, "{what}");
                    }
                    let is_seen = |number: usize| {
                        let low = !(number as u32 | SPLAT_BIT);
                        keys.iter().any(|&key| key != 0 && key as u32 == low)
                    };
                    for number in (0..count - samples).step_by(211) {
                        let seen = places.seen[number].load(Ordering::Relaxed) != 0;
                        assert_eq!(seen, is_seen(number), "{what}: {number}");
                    }
                    assert!(*first.get_or_insert_with(|| keys.clone()) == keys, "{what}");
                }
            }
        }
    }
    assert!(covered > 100_000, "{covered}");
}

/// What is behind everything in that of [`light`].
const BACKGROUND: u32 = 0xff_80_33;

/// The headlight where the camera of [`screen`] is, in model space.
fn light(is_two_sided: bool, has_colors: bool) -> FrameHeadlight {
    let mut flags = 0;
    for (on, flag) in [
        (is_two_sided, constants::FLAG_TWO_SIDED),
        (has_colors, constants::FLAG_USE_COLORS),
    ] {
        flags |= if on { flag } else { 0 };
    }
    FrameHeadlight::new(&FrameConstants {
        headlight: [0.0, -0.1, 3.0, 1.0],
        background: [0.2, 0.5, 1.0, 0.0],
        flags,
        ..FrameConstants::zeroed()
    })
}

/// The color of a splat in that light, double precision: values of 255.
fn value_of(splat: &Splat, is_two_sided: bool, has_colors: bool) -> [f64; 3] {
    let to_light = DVec3::new(0.0, -0.1, 3.0) - splat.center.as_dvec3();
    let fine = splat.radius.rest();
    let left = [fine << 21 >> 21, fine << 10 >> 21].map(|v| f64::from(v) / 1024.0);
    let left_of_color = [7, 4, 1].map(|up: u32| f64::from(fine << up >> 29) / 8.0);
    let [x, y] = [0, 1].map(|i| ((f64::from(splat.normal[i]) + left[i]) / 32767.0).max(-1.0));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let normal = DVec3::new(x - fold.copysign(x), y - fold.copysign(y), z).normalize();
    let facing = normal.dot(to_light.normalize());
    let lambert = match splat.color[3] {
        0 => 1.0,
        _ if is_two_sided => facing.abs(),
        _ => facing.max(0.0),
    };
    let own = |i: usize| {
        if has_colors {
            f64::from(splat.color[i]) + left_of_color[i]
        } else {
            255.0
        }
    };
    [0, 1, 2].map(|i| own(i) * 0.8 * lambert.min(1.0))
}

/// A cut with nodes, rows and leaves, and some that have no area: each pixel has the depth of the splat that it shows where all are
/// written first, and its color, whether splats are shaded before or after it is known which are seen.
#[test]
fn a_cut_is_drawn_as_its_list() {
    let mut numbers = [0; 6];
    for (shape, threshold_px) in [
        (GeneratedShape::Statue, 1.7),
        (GeneratedShape::Torus, 3.0),
        (GeneratedShape::Torus, 1.2),
    ] {
        let spec = ShapeSpec::with_triangles(shape, 40_000).unwrap();
        let mut mesh = generate::mesh(&spec);
        for corners in mesh.triangles.iter_mut().step_by(5) {
            corners[2] = corners[1];
        }
        let colors = (0u8..=255).cycle().map(|i| [i, 255 - i, i / 3, 255]);
        mesh.colors = colors.take(mesh.positions.len()).collect();
        let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
        let undrawn = ZeroAreaSet::new(&model);
        let eye = DVec3::new(0.0, -0.1, 3.0);
        let size = (SIZE[0], SIZE[1]);
        let camera = Camera::look_at(size, eye, DVec3::ZERO, DVec3::Y, 0.7, [0.5, 100.0]);
        let view = camera.view(model.origin).unwrap();
        let settings = CutSettings {
            threshold_px,
            cull_back: false,
            ..CutSettings::default()
        };
        let mut cut = Cut::default();
        select(&model, &view, &settings, &mut cut);
        let lists = [cut.nodes.len(), cut.strips.len(), cut.leaves.len()];
        for (sum, count) in numbers.iter_mut().zip(lists) {
            *sum += count;
        }
        for (footprint, is_two_sided, has_colors) in [
            (Footprint::Square, true, true),
            (Footprint::Circle, false, true),
            (Footprint::Circle, true, false),
        ] {
            let plan = SplatPlan {
                footprint,
                threshold_px,
                size: settings.size,
                draws_large_leaves: false,
                low_pass_px: 0.0,
                by_level: false,
                cut_view: None,
                max_point_px: f32::INFINITY,
            };
            let (screen, light) = (screen(threshold_px), light(is_two_sided, has_colors));
            let (mut places, mut planes) = (SplatPlaces::default(), Planes::of(&screen));
            let count = splats::count(&cut, &plan);
            let mut samples = crowd(40, 1.0, 3);
            let mut next = random(7);
            for sample in &mut samples {
                let direction = Vec3::new(next() - 0.5, next() - 0.5, next() - 0.5);
                sample.normal = octahedral::encode(direction);
                // What the code leaves out.
                sample.radius = SplatRadius::with_rest((next() * 1e9) as u32);
                sample.color = [9, 200, 77, if next() < 0.5 { 0 } else { 255 }];
            }
            let mut list = vec![Splat::zeroed(); count];
            let packed = splats::pack(&model, &cut, &view, &plan, &mut list);
            list.truncate(packed.points);
            numbers[3] += count - packed.points;
            list.extend(&samples);
            let own = list.split_at(packed.points);
            let parts = vec![(ListedSplats::List(own.0), packed.points)];
            let look = SplatShape {
                footprint,
                has_one_size: true,
            };
            let frame = (&screen, &light);
            let found = OpaqueSplatList {
                parts,
                look,
                samples: own.1,
            };
            draw_by(
                Level::new(),
                found,
                frame,
                KnownSplats::Places,
                (&mut places, planes.picture()),
            );
            let keys = planes.keys();
            for are_seen in [false, true] {
                let splats = CutSplats {
                    meshes: &[CutMesh {
                        model: &model,
                        undrawn: &undrawn,
                        cut: &cut,
                    }],
                    view: &view,
                    plan: &plan,
                    are_seen,
                };
                let mut first = None;
                for level in levels() {
                    let mut planes = Planes::of(&screen);
                    let out = (&mut places, planes.picture());
                    draw_cut_by(level, splats, &samples, frame, out);
                    let drawn = planes.keys();
                    for (key, own) in keys.iter().zip(&drawn) {
                        assert_eq!(key >> 32, own >> 32);
                        if *key == 0 {
                            assert_eq!(*own, 0);
                            continue;
                        }
                        let splat = &list[(!(*key as u32) & !SPLAT_BIT) as usize];
                        let wanted = value_of(splat, is_two_sided, has_colors);
                        let [r, g, b, coverage] = (*own as u32).to_le_bytes();
                        assert_eq!(coverage, 255);
                        for (is, wanted) in [r, g, b].into_iter().zip(wanted) {
                            // Rounded, from single precision.
                            let off = (f64::from(is) - wanted).abs();
                            assert!(off < 0.501, "{is} {wanted}");
                            numbers[4] += usize::from(is > 0);
                        }
                        numbers[5] += usize::from(splat.color[3] == 0);
                    }
                    assert!(*first.get_or_insert_with(|| drawn.clone()) == drawn);
                }
            }
        }
    }
    assert!(numbers.iter().all(|&n| n > 100), "{numbers:?}");
}

/// Point where the ray of a pixel meets the plane of a disc: the square of the distance from its middle, in radii, and the reversed
/// depth; infinite and 0 where it does not. By its definition, in double precision; the eye is at (0, -0.1, 3).
fn seen_of_disc(splat: &Splat, [x, y]: [u32; 2], [width, height]: [f64; 2]) -> [f64; 2] {
    let center = splat.center.as_dvec3() + DVec3::new(0.0, 0.1, -3.0);
    let to_eye = -center.normalize();
    let normal = octahedral::decode(splat.normal).as_dvec3().normalize();
    let facing = normal.dot(to_eye);
    let across = (normal - facing * to_eye) * facing.signum();
    let thickness = f64::from(255 - splat.color[3]) / 254.0;
    let ratio = (facing.abs() + thickness * across.length()).clamp(0.1, 1.0);
    let tilted = ratio * to_eye + (1.0 - ratio * ratio).sqrt() * across.normalize();
    let at = [
        f64::from(x) + 0.5 - 0.5 * width,
        0.5 * height - f64::from(y) - 0.5,
    ];
    let ray = DVec3::new(at[0], at[1], -1.2 * width);
    let along = tilted.dot(center) / tilted.dot(ray);
    match along > 0.0 {
        true => {
            let met = along * ray;
            let squared =
                met.distance_squared(center) / f64::from(splat.radius.model_units()).powi(2);
            let radius = f64::from(splat.radius.model_units());
            let reach = radius * tilted.truncate().length();
            let height = (radius * (0.25 / ratio).min(1.0)).min(0.5 * (-center.z - reach));
            let dome = height * squared / -met.z;
            [squared, (0.5 / -met.z * (1.0 - dome)).min(1.0)]
        }
        false => [f64::INFINITY, 0.0],
    }
}

#[test]
fn ovals_cover_what_rays_meet() {
    let (screen, light) = (screen(1.0), light(true, true));
    let [left, top, right, bottom] = RECT;
    let size = SIZE.map(f64::from);
    let mut next = random(11);
    let (mut places, mut covered, mut cut_off) = (SplatPlaces::default(), 0, 0);
    for number in 0..600 {
        let mut splat = crowd(2, 1.0, number)[1];
        splat.normal = octahedral::encode(Vec3::new(next() - 0.5, next() - 0.5, next() - 0.5));
        let radius = 0.02 + 0.3 * next().powi(2);
        splat.radius = SplatRadius::own(radius);
        splat.color[3] = if next() < 0.5 { 255 } else { 120 };
        // What reaches the near plane is a circle; what is smaller than a pixel and a half a square.
        let distance = 3.0 - splat.center.z;
        if distance - radius <= 0.5 || radius * 0.1 * screen.focal_px < distance {
            continue;
        }
        for level in levels() {
            let mut planes = Planes::of(&screen);
            let look = SplatShape {
                footprint: Footprint::Oriented,
                has_one_size: false,
            };
            let parts = vec![(ListedSplats::List(std::slice::from_ref(&splat)), 1)];
            let out = (&mut places, planes.picture());
            draw_by(
                level,
                OpaqueSplatList {
                    parts,
                    look,
                    samples: &[],
                },
                (&screen, &light),
                KnownSplats::Colors,
                out,
            );
            let pixels = (top..bottom).flat_map(|y| (left..right).map(move |x| [x, y]));
            for (key, pixel) in planes.keys().into_iter().zip(pixels) {
                let [rho_squared, depth] = seen_of_disc(&splat, pixel, size);
                // Single precision decides at the rim.
                if (rho_squared - 1.0).abs() > 2e-3 {
                    assert_eq!(
                        key != 0,
                        rho_squared < 1.0,
                        "{splat:?} {pixel:?} {rho_squared}"
                    );
                    if key != 0 {
                        let own = f64::from(f32::from_bits((key >> 32) as u32));
                        assert!(
                            (own - depth).abs() < 1e-5,
                            "{splat:?} {pixel:?} {own} {depth}"
                        );
                    }
                    covered += usize::from(key != 0);
                    let is_at_side = pixel[0] == left || pixel[1] == top;
                    cut_off += usize::from(key != 0 && is_at_side);
                }
            }
        }
    }
    assert!(covered > 20_000 && cut_off > 100, "{covered} {cut_off}");
}

#[test]
fn what_is_too_wide_for_its_numbers_is_not_drawn() {
    let frame = FrameConstants::zeroed();
    assert!(SplatScreen::new(&frame, [3, 0, 3, 65_535]).is_some());
    assert!(SplatScreen::new(&frame, [0, 0, 65_536, 2]).is_none());
    assert!(SplatScreen::new(&frame, [5, 0, 4, 2]).is_none());
}
