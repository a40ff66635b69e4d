//! Small opaque squares and discs by the host, for software devices: what passes small.clear and small.splats leave in
//! storage.
//!
//! A software device goes through the lanes of each write one by one and locks each pixel that it writes
//! (`docs/PERFORMANCE.md`, "The floor of rates by compute"). Here the pixels of all splats are found first, many at a time;
//! then the picture is cut into bands of rows, each the job of one thread, so nothing is locked. What is left is the same to
//! the bit: the greatest key of a pixel does not depend on any order, and each number is made by the operations of
//! `shaders/compute/splats.comp`, in their order.

mod band;
mod place;
mod seen;

use super::parts;
use super::splats::{self, Part, Plan};
use crate::abi::{FrameConstants, Splat};
use crate::cut::{Cut, Undrawn};
use crate::math::camera::View;
use crate::tree::Model;
use band::Fronts;
use fearless_simd::{Level, dispatch};
use place::{Finding, Found, GROUP, Group, Pixels, Round};
use std::sync::atomic::{AtomicU8, Ordering};

/// Rows of a band.
const BAND_PX: usize = 32;

/// The bit that keys of splats do not have, see `shaders/common/list.glsl`.
const SPLAT_BIT: u32 = 1 << 31;

/// Where the device draws splats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Screen {
    /// From model to view space: the row of z.
    along: [f32; 4],
    /// Factor of z in clip space and what is added: of depth and of the last component.
    depth: [f32; 2],
    last: [f32; 2],
    /// From model space to window positions times the last component: rows of x and y, pixels.
    window: [[f32; 4]; 2],
    /// From a radius in model units to one in pixels: times both, over the last component.
    model_scale: f32,
    focal_px: f32,
    /// Side or diameter of splats without a radius of their own, pixels.
    size_px: f32,
    /// The part of the picture that is drawn in: left, top, and one past right and bottom, pixels.
    rect_px: [u32; 4],
}

impl Screen {
    /// That of a frame; `None` where places do not fit their numbers.
    pub fn new(frame: &FrameConstants, rect_px: [u32; 4]) -> Option<Self> {
        let (view, clip) = (&frame.view_from_model, &frame.clip_from_view);
        let row =
            |of: &[[f32; 4]; 4], row: usize| [0, 1, 2, 3].map(|column: usize| of[column][row]);
        let [left, top, right, bottom] = rect_px;
        let fits = |low: u32, high: u32| low <= high && high - low <= u32::from(u16::MAX);
        (fits(left, right) && fits(top, bottom)).then(|| Self {
            along: row(view, 2),
            depth: [clip[2][2], clip[3][2]],
            last: [clip[2][3], clip[3][3]],
            window: [0, 1].map(|i| row(&frame.window_from_model, i)),
            model_scale: frame.model_scale,
            focal_px: frame.focal_px,
            size_px: frame.splat_size_px,
            rect_px,
        })
    }

    fn width(&self) -> usize {
        (self.rect_px[2] - self.rect_px[0]) as usize
    }

    /// How many pixels it has.
    pub fn pixels(&self) -> usize {
        self.width() * (self.rect_px[3] - self.rect_px[1]) as usize
    }
}

/// What splats look like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Look {
    /// Circles that face the viewer instead of squares.
    pub are_discs: bool,
    /// None has a radius of its own.
    pub has_one_size: bool,
}

/// Splats of a draw list, a part of it.
#[derive(Clone, Copy)]
pub(super) enum Source<'a> {
    /// Of a cut of a mesh; none has a radius of its own.
    Cut(&'a Model, &'a Undrawn, Part<'a>),
    /// Those that are written already.
    List(&'a [Splat]),
}

/// Where splats are, and which of them are seen; kept from frame to frame for its memory.
#[derive(Debug, Default)]
pub struct Places {
    pixels: Pixels,
    rounds: Vec<Round>,
    groups: Vec<Group>,
    seen: Vec<AtomicU8>,
    bands: Vec<Fronts>,
}

/// Splats of one look, and where they are.
struct Placed<'a> {
    /// Number of the first in the list.
    first: u32,
    pixels: Found<'a>,
    /// Of discs, else empty.
    rounds: &'a [Round],
    groups: &'a [Group],
    /// All are squares of a pixel.
    are_samples: bool,
}

/// Draws a list, whose last `samples` splats are squares of a pixel and whose others look like `look`. `keys` become what
/// storage of the rectangle holds after the passes by compute, whatever they held: the first so many, see
/// [`Screen::pixels`].
///
/// # Panics
/// When `keys` are fewer than that, or the list has fewer splats than `samples`.
pub fn draw(
    splats: &[Splat],
    (look, samples): (Look, usize),
    screen: &Screen,
    places: &mut Places,
    keys: &mut [u64],
) {
    let (own, sampled) = splats.split_at(splats.len() - samples);
    let own = own.chunks(parts::PART);
    let own = own.map(|part| (Source::List(part), part.len())).collect();
    draw_by(Level::new(), (own, look, sampled), screen, (places, keys));
}

/// Draws the splats of a cut of a mesh, none of which has a radius of its own, and after them those of `out` from their
/// number on, which are squares of a pixel: the keys are as of [`draw`]. Then the records of what is seen of the cut are written to
/// `out`, each at its number in the list that [`splats::pack`] would write; other records stay what they were.
///
/// # Panics
/// When `keys` are fewer than [`Screen::pixels`], or `out` is shorter than [`splats::count`].
pub fn draw_cut(
    (model, undrawn): (&Model, &Undrawn),
    (cut, view, plan): (&Cut, &View, &Plan),
    (screen, are_discs): (&Screen, bool),
    (places, keys): (&mut Places, &mut [u64]),
    out: &mut [Splat],
) {
    let look = Look {
        are_discs,
        has_one_size: true,
    };
    let parts = splats::parts_of(cut, plan);
    let own = parts.iter();
    let own = own.map(|&(part, count)| (Source::Cut(model, undrawn, part), count));
    let (out, sampled) = out.split_at_mut(splats::count(cut, plan));
    let own = own.collect();
    draw_by(Level::new(), (own, look, sampled), screen, (places, keys));
    seen::pack(model, (view, plan), parts, &places.seen, out);
}

/// The same by vectors of a level.
fn draw_by(
    level: Level,
    (own, look, sampled): (Vec<(Source<'_>, usize)>, Look, &[Splat]),
    screen: &Screen,
    (places, keys): (&mut Places, &mut [u64]),
) {
    let own_count: usize = own.iter().map(|part| part.1).sum();
    let count = own_count + sampled.len();
    let sampled = sampled.chunks(parts::PART);
    let sampled: Vec<_> = sampled
        .map(|part| (Source::List(part), part.len()))
        .collect();
    let groups_of = |parts: &[(Source<'_>, usize)]| -> usize {
        parts.iter().map(|part| part.1.div_ceil(GROUP)).sum()
    };
    let own_groups = groups_of(&own);
    let group_count = own_groups + groups_of(&sampled);
    // What is not written below is not read either.
    let mut pixels = places.pixels.first(count);
    places
        .groups
        .resize(group_count.max(places.groups.len()), Group::default());
    if look.are_discs {
        places
            .rounds
            .resize(own_count.max(places.rounds.len()), Round::default());
    }
    places
        .seen
        .resize_with(own_count.max(places.seen.len()), AtomicU8::default);
    for seen in &mut places.seen[..own_count] {
        *seen.get_mut() = 0;
    }
    let (mut own_pixels, mut sampled_pixels) = (pixels.split(own_count), pixels);
    let (own_group, sampled_group) = places.groups[..group_count].split_at_mut(own_groups);
    let own_rounds = match look.are_discs {
        true => &mut places.rounds[..own_count],
        false => &mut [],
    };
    let is_one_pixel = !look.are_discs && look.has_one_size && screen.size_px <= 1.0;
    let of_samples = Look {
        are_discs: false,
        has_one_size: true,
    };
    place_all(
        level,
        screen,
        (own, look, is_one_pixel),
        (&mut own_pixels, own_rounds, own_group),
    );
    place_all(
        level,
        screen,
        (sampled, of_samples, true),
        (&mut sampled_pixels, &mut [], sampled_group),
    );
    let lists = [
        Placed {
            first: 0,
            pixels: own_pixels.found(),
            rounds: own_rounds,
            groups: own_group,
            are_samples: is_one_pixel,
        },
        Placed {
            first: own_count as u32,
            pixels: sampled_pixels.found(),
            rounds: &[],
            groups: sampled_group,
            are_samples: true,
        },
    ];
    let seen = &places.seen[..own_count];
    let width = screen.width();
    let keys = &mut keys[..screen.pixels()];
    if width == 0 {
        return;
    }
    let bands = keys.chunks_mut(BAND_PX * width).enumerate();
    places.bands.resize_with(bands.len(), Fronts::default);
    let bands = bands.zip(&mut places.bands);
    parts::share(count, bands, |((number, keys), fronts)| {
        let first_row = number * BAND_PX;
        let mut band = fronts.band(width, [first_row, first_row + keys.len() / width]);
        for list in &lists {
            dispatch!(level, simd => band.draw(simd, list));
        }
        band.write(keys);
        mark(keys, seen);
    });
}

/// Marks those of the first splats of a list that are the nearest somewhere.
fn mark(keys: &[u64], seen: &[AtomicU8]) {
    let mut last = u32::MAX;
    for &key in keys.iter().filter(|&&key| key != 0) {
        let number = !(key as u32) & !SPLAT_BIT;
        if number != last
            && let Some(seen) = seen.get(number as usize)
        {
            seen.store(1, Ordering::Relaxed);
        }
        last = number;
    }
}

/// Finds where splats are, part by part.
fn place_all(
    level: Level,
    screen: &Screen,
    (parts, look, is_one_pixel): (Vec<(Source<'_>, usize)>, Look, bool),
    (pixels, mut rounds, mut groups): (&mut Finding<'_>, &mut [Round], &mut [Group]),
) {
    let mut rest = pixels.again();
    let mut count = 0;
    let jobs: Vec<_> = parts
        .into_iter()
        .map(|(source, size)| {
            let (round, group);
            let rounded = if look.are_discs { size } else { 0 };
            (round, rounds) = std::mem::take(&mut rounds).split_at_mut(rounded);
            (group, groups) = std::mem::take(&mut groups).split_at_mut(size.div_ceil(GROUP));
            let first = count as u32;
            count += size;
            (source, first, (rest.split(size), round, group))
        })
        .collect();
    parts::share(count, jobs.into_iter(), |(source, first, out)| {
        dispatch!(level, simd => {
            place::part(simd, screen, (source, look, is_one_pixel), first, out);
        });
    });
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failing test panics")]

    use super::*;
    use crate::cut::{Settings, select};
    use crate::draw::Footprint;
    use crate::generate::{self, Shape, Spec};
    use crate::math::camera::Camera;
    use crate::progress::Silent;
    use crate::tree::{self, BuildOptions};
    use bytemuck::Zeroable;
    use glam::{DVec3, Mat4, Vec3};

    const SIZE: [u32; 2] = [90, 110];
    const RECT: [u32; 4] = [7, 0, 85, 104];

    /// A camera at (0, 0, 3) that looks to where z falls, with depth 1 at a distance of 0.5.
    fn screen(size_px: f32) -> Screen {
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
            focal_px: 1.2 * width,
            splat_size_px: size_px,
            ..FrameConstants::zeroed()
        };
        Screen::new(&frame, RECT).unwrap()
    }

    /// The keys of a list as `shaders/compute/splats.comp` leaves them, splat by splat and pixel by pixel.
    fn expected(splats: &[Splat], (look, samples): (Look, usize), screen: &Screen) -> Vec<u64> {
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
            let half = match splat.radius > 0.0 && !look.has_one_size && !is_sample {
                true => splat.radius * screen.model_scale * screen.focal_px / last,
                false => 0.5 * screen.size_px,
            };
            let side = if is_sample { 1.0 } else { 2.0 * half };
            let is_round = look.are_discs && !is_sample && side >= std::f32::consts::SQRT_2;
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

    /// Numbers in 0..1, the same in every run.
    fn numbers(mut state: u64) -> impl FnMut() -> f32 {
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f32 / (1u64 << 24) as f32
        }
    }

    /// A crowd around what is seen, with radii of up to `largest` pixels; one in eight is odd.
    fn crowd(count: usize, largest: f32, seed: u64) -> Vec<Splat> {
        let mut next = numbers(seed);
        (0..count)
            .map(|i| {
                let mut splat = Splat {
                    center: Vec3::new(3.0 * next() - 1.5, 3.0 * next() - 1.5, 2.0 * next() - 1.0),
                    radius: largest * next() * next() / 110.0,
                    ..Splat::zeroed()
                };
                match i % 24 {
                    0 => splat.center.x = f32::NAN,
                    3 => splat.center.z = 3.5,
                    6 => splat.center = Vec3::new(f32::INFINITY, 0.0, 0.0),
                    9 => splat.radius = -splat.radius,
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

    /// Every way that this processor has.
    fn levels() -> Vec<Level> {
        let mut levels = vec![Level::baseline(), Level::new()];
        #[cfg(target_arch = "x86_64")]
        levels.extend(Level::new().as_avx2().map(Level::Avx2));
        levels
    }

    #[test]
    fn keys_are_those_of_plain_loops_at_every_width_of_vectors() {
        let mut places = Places::default();
        let mut covered = 0;
        for (seed, (size_px, largest)) in
            [(1.0, 2.0), (1.3, 1.5), (2.0, 3.0), (3.0, 5.0), (5.7, 6.0)]
                .into_iter()
                .enumerate()
        {
            for (count, samples) in [(0, 0), (1, 0), (1, 1), (900, 0), (20_000, 7_001)] {
                let splats = crowd(count, largest, 5 + seed as u64);
                for (are_discs, has_one_size) in
                    [(false, true), (false, false), (true, true), (true, false)]
                {
                    let look = Look {
                        are_discs,
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
                        // What was there is not looked at.
                        let mut keys = vec![u64::MAX; screen.pixels() + 5];
                        let own = splats.split_at(count - samples);
                        let parts = own.0.chunks(parts::PART);
                        let parts = parts.map(|part| (Source::List(part), part.len())).collect();
                        let list = (parts, look, own.1);
                        draw_by(level, list, &screen, (&mut places, &mut keys));
                        assert!(keys[screen.pixels()..].iter().all(|&key| key == u64::MAX));
                        keys.truncate(screen.pixels());
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

    /// A cut with nodes, rows and leaves, and some that have no area: what is seen in each pixel is the same splat as where all
    /// are written first, and what is not seen is not written.
    #[test]
    fn a_cut_is_drawn_as_its_list_and_what_is_seen_is_written() {
        let mut numbers = [0; 4];
        for (shape, threshold_px) in [
            (Shape::Statue, 1.7),
            (Shape::Torus, 3.0),
            (Shape::Torus, 1.2),
        ] {
            let spec = Spec::with_triangles(shape, 40_000).unwrap();
            let mut mesh = generate::mesh(&spec);
            for corners in mesh.triangles.iter_mut().step_by(5) {
                corners[2] = corners[1];
            }
            let model = tree::build(mesh, &BuildOptions::default(), &Silent).unwrap();
            let undrawn = Undrawn::new(&model);
            let eye = DVec3::new(0.0, -0.1, 3.0);
            let size = (SIZE[0], SIZE[1]);
            let camera = Camera::look_at(size, eye, DVec3::ZERO, DVec3::Y, 0.7, (0.5, 100.0));
            let view = camera.view(model.origin).unwrap();
            let settings = Settings {
                threshold_px,
                cull_back: false,
                ..Settings::default()
            };
            let mut cut = Cut::default();
            select(&model, &view, &settings, &mut cut);
            let lists = [cut.nodes.len(), cut.strips.len(), cut.leaves.len()];
            for (sum, count) in numbers.iter_mut().zip(lists) {
                *sum += count;
            }
            for footprint in [Footprint::Square, Footprint::Circle] {
                let plan = Plan {
                    footprint,
                    threshold_px,
                    size: settings.size,
                    draws_large_leaves: false,
                    low_pass_px: 0.0,
                    by_level: false,
                    cut_view: None,
                    max_point_px: f32::INFINITY,
                };
                let are_discs = footprint == Footprint::Circle;
                let look = Look {
                    are_discs,
                    has_one_size: true,
                };
                let screen = screen(threshold_px);
                let (mut places, mut keys) = (Places::default(), vec![0; screen.pixels()]);
                let count = splats::count(&cut, &plan);
                let samples = crowd(40, 1.0, 3);
                let mut list = vec![Splat::zeroed(); count];
                let packed = splats::pack(&model, &cut, &view, &plan, &mut list);
                list.truncate(packed.points);
                numbers[3] += count - packed.points;
                list.extend(&samples);
                draw(
                    &list,
                    (look, samples.len()),
                    &screen,
                    &mut places,
                    &mut keys,
                );
                let nothing = Splat {
                    radius: -77.0,
                    ..Splat::zeroed()
                };
                let mut out = vec![nothing; count];
                out.extend(&samples);
                let mut own_keys = keys.clone();
                draw_cut(
                    (&model, &undrawn),
                    (&cut, &view, &plan),
                    (&screen, are_discs),
                    (&mut places, &mut own_keys),
                    &mut out,
                );
                let mut seen = vec![false; count];
                for (key, own) in keys.into_iter().zip(own_keys) {
                    assert_eq!(key >> 32, own >> 32);
                    if key != 0 {
                        let at = |key: u64| (!(key as u32) & !SPLAT_BIT) as usize;
                        let [wanted, is] = [&list[at(key)], &out[at(own)]];
                        assert_eq!(bytemuck::bytes_of(wanted), bytemuck::bytes_of(is));
                        if let Some(seen) = seen.get_mut(at(own)) {
                            *seen = true;
                        }
                    }
                }
                for (splat, seen) in out[..count].iter().zip(seen) {
                    assert_eq!(splat.radius != -77.0, seen);
                }
            }
        }
        assert!(numbers.iter().all(|&n| n > 100), "{numbers:?}");
    }

    #[test]
    fn what_is_too_wide_for_its_numbers_is_not_drawn() {
        let frame = FrameConstants::zeroed();
        assert!(Screen::new(&frame, [3, 0, 3, 65_535]).is_some());
        assert!(Screen::new(&frame, [0, 0, 65_536, 2]).is_none());
        assert!(Screen::new(&frame, [5, 0, 4, 2]).is_none());
    }
}
