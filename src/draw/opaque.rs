//! Small opaque squares and discs by the host, for software devices: what passes small.clear and small.splats leave in
//! storage.
//!
//! A software device goes through the lanes of each write one by one and locks each pixel that it writes
//! (`docs/PERFORMANCE.md`, "The floor of rates by compute"). Here the pixels of all splats are found first, many at a time;
//! then the picture is cut into bands of rows, each the job of one thread, so nothing is locked. What is left is the same to
//! the bit: the greatest key of a pixel does not depend on any order, and each number is made by the operations of
//! `shaders/compute/splats.comp`, in their order.

mod place;

use crate::abi::{FrameConstants, Splat};
use crate::draw::parts;
use fearless_simd::{Level, dispatch};
use place::{GROUP, Group, Pixels, Round};

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
        let row = |of: &[[f32; 4]; 4], row: usize| [0, 1, 2, 3].map(|column: usize| of[column][row]);
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

/// Where splats are, kept from frame to frame for its memory.
#[derive(Debug, Default)]
pub struct Places {
    pixels: Vec<Pixels>,
    rounds: Vec<Round>,
    groups: Vec<Group>,
}

/// Splats of one look, and where they are.
struct Placed<'a> {
    /// Number of the first in the list.
    first: u32,
    pixels: &'a [Pixels],
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
    draw_by(Level::new(), splats, (look, samples), screen, (places, keys));
}

/// The same by vectors of a level.
fn draw_by(
    level: Level,
    splats: &[Splat],
    (look, samples): (Look, usize),
    screen: &Screen,
    (places, keys): (&mut Places, &mut [u64]),
) {
    let (own, sampled) = splats.split_at(splats.len() - samples);
    let is_one_pixel = |look: Look| !look.are_discs && look.has_one_size && screen.size_px <= 1.0;
    let all_samples = Look {
        are_discs: false,
        has_one_size: true,
    };
    let Places {
        pixels,
        rounds,
        groups,
    } = places;
    // What is not written below is not read either.
    pixels.resize(splats.len().max(pixels.len()), Pixels::default());
    let own_groups = own.len().div_ceil(GROUP);
    let count = own_groups + sampled.len().div_ceil(GROUP);
    groups.resize(count.max(groups.len()), Group::default());
    if look.are_discs {
        rounds.resize(own.len().max(rounds.len()), Round::default());
    }
    let (own_pixels, sampled_pixels) = pixels[..splats.len()].split_at_mut(own.len());
    let (own_group, sampled_group) = groups[..count].split_at_mut(own_groups);
    let own_rounds = match look.are_discs {
        true => &mut rounds[..own.len()],
        false => &mut [],
    };
    let one_pixel = [is_one_pixel(look), true];
    place_all(
        level,
        screen,
        (own, look, one_pixel[0]),
        (own_pixels, own_rounds, own_group),
    );
    place_all(
        level,
        screen,
        (sampled, all_samples, true),
        (sampled_pixels, &mut [], sampled_group),
    );
    let lists = [
        Placed {
            first: 0,
            pixels: own_pixels,
            rounds: own_rounds,
            groups: own_group,
            are_samples: one_pixel[0],
        },
        Placed {
            first: own.len() as u32,
            pixels: sampled_pixels,
            rounds: &[],
            groups: sampled_group,
            are_samples: true,
        },
    ];
    let width = screen.width();
    let keys = &mut keys[..screen.pixels()];
    if width == 0 {
        return;
    }
    let bands = keys.chunks_mut(BAND_PX * width).enumerate();
    parts::share(splats.len(), bands, |(number, keys)| {
        keys.fill(0);
        for list in &lists {
            dispatch!(level, _simd => list.draw(number * BAND_PX, width, keys));
        }
    });
}

/// Finds where splats are, part by part.
fn place_all(
    level: Level,
    screen: &Screen,
    (splats, look, is_one_pixel): (&[Splat], Look, bool),
    (pixels, rounds, groups): (&mut [Pixels], &mut [Round], &mut [Group]),
) {
    const PART: usize = parts::PART;
    let mut rounds = rounds.chunks_mut(PART);
    let jobs = (splats.chunks(PART))
        .zip(pixels.chunks_mut(PART))
        .zip(groups.chunks_mut(PART / GROUP))
        .map(|((splats, pixels), groups)| {
            let rounds = rounds.next().unwrap_or_default();
            (splats, pixels, rounds, groups)
        });
    parts::share(splats.len(), jobs, |(splats, pixels, rounds, groups)| {
        dispatch!(level, simd => {
            place::part(simd, screen, (splats, look, is_one_pixel), (pixels, rounds, groups));
        });
    });
}

impl Placed<'_> {
    /// Leaves the keys of what is in a band of rows, whose first is number `first_row` of the rectangle.
    #[inline(always)]
    fn draw(&self, first_row: usize, width: usize, keys: &mut [u64]) {
        let end_row = first_row + keys.len() / width;
        for (index, group) in self.groups.iter().enumerate() {
            let [first, end] = group.rows.map(usize::from);
            if first >= end_row || end <= first_row {
                continue;
            }
            let from = index * GROUP;
            let range = from..(from + GROUP).min(self.pixels.len());
            let number = self.first + from as u32;
            let pixels = &self.pixels[range.clone()];
            if self.are_samples {
                samples(pixels, number, (first_row, end_row, width), keys);
            } else if self.rounds.is_empty() {
                squares(pixels, number, (first_row, end_row, width), keys);
            } else {
                let discs = pixels.iter().zip(&self.rounds[range]);
                let discs = discs.zip(number..);
                for ((pixels, round), number) in discs {
                    disc(pixels, round, number, (first_row, end_row, width), keys);
                }
            }
        }
    }
}

/// The key of a splat.
#[inline(always)]
fn key(depth: u32, number: u32) -> u64 {
    u64::from(depth) << 32 | u64::from(!(number | SPLAT_BIT))
}

/// Squares of a pixel.
#[inline(always)]
fn samples(
    pixels: &[Pixels],
    number: u32,
    (first_row, end_row, width): (usize, usize, usize),
    keys: &mut [u64],
) {
    for (own, number) in pixels.iter().zip(number..) {
        let [x, y] = own.first.map(usize::from);
        if own.end[0] > own.first[0] && (first_row..end_row).contains(&y) {
            let place = &mut keys[(y - first_row) * width + x];
            *place = (*place).max(key(own.depth, number));
        }
    }
}

#[inline(always)]
fn squares(
    pixels: &[Pixels],
    number: u32,
    (first_row, end_row, width): (usize, usize, usize),
    keys: &mut [u64],
) {
    for (own, number) in pixels.iter().zip(number..) {
        let [left, top] = own.first.map(usize::from);
        let [right, bottom] = own.end.map(usize::from);
        let key = key(own.depth, number);
        for y in top.max(first_row)..bottom.min(end_row) {
            let row = (y - first_row) * width;
            for place in &mut keys[row + left..row + right] {
                *place = (*place).max(key);
            }
        }
    }
}

#[inline(always)]
fn disc(
    own: &Pixels,
    round: &Round,
    number: u32,
    (first_row, end_row, width): (usize, usize, usize),
    keys: &mut [u64],
) {
    let [left, top] = own.first.map(usize::from);
    let [right, bottom] = own.end.map(usize::from);
    let key = key(own.depth, number);
    let Round { form, to_first } = *round;
    for y in top.max(first_row)..bottom.min(end_row) {
        let from_y = to_first[1] + (y - top) as f32;
        let of_y = form * from_y * from_y;
        let row = (y - first_row) * width;
        let mut x = 0.0;
        for place in &mut keys[row + left..row + right] {
            let from_x = to_first[0] + x;
            let is_in = form * from_x * from_x + of_y <= 1.0;
            let own = if is_in { key } else { 0 };
            *place = (*place).max(own);
            x += 1.0;
        }
    }
}
