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
#[cfg(test)]
mod tests;

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
