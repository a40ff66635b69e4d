//! Where splats are is found part by part; then the picture is drawn band by band.

use crate::abi::Splat;
use crate::pack::Footprint;
use crate::pack::parallel;
use crate::render::cpu::opaque::band_raster::BandFronts;
use crate::render::cpu::opaque::ovals::OvalOutline;
use crate::render::cpu::opaque::pixel_lists::{FoundPixels, PixelSearch, SplatPixels};
use crate::render::cpu::opaque::splat_bounds;
use crate::render::cpu::opaque::splat_bounds::{GROUP, NearSplats, RoundPixels};
use crate::render::cpu::opaque::{Frame, ListedSplats, ShownRectangle, SplatShape};
use fearless_simd::{Level, dispatch};
use std::sync::atomic::{AtomicU8, Ordering};

/// Rows of a band.
pub(super) const BAND_PX: usize = 32;

/// The bit that keys of splats do not have, see `shaders/common/list.glsl`.
pub(super) const SPLAT_BIT: u32 = 1 << 31;

/// Where splats are, and which of them are seen; kept from frame to frame for its memory.
#[derive(Debug, Default)]
pub struct SplatPlaces {
    pub(super) pixels: SplatPixels,
    rounds: Vec<RoundPixels>,
    ovals: Vec<OvalOutline>,
    groups: Vec<NearSplats>,
    pub(super) seen: Vec<AtomicU8>,
    bands: Vec<BandFronts>,
}

/// Splats of one look, and where they are.
pub(super) struct PlacedSplats<'a> {
    /// Number of the first in the list.
    pub(super) first: u32,
    pub(super) pixels: FoundPixels<'a>,
    /// Outlines of discs that face the viewer; empty for other splats.
    pub(super) rounds: &'a [RoundPixels],
    /// Outlines of discs in the plane of the surface; empty for other splats.
    pub(super) ovals: &'a [OvalOutline],
    pub(super) groups: &'a [NearSplats],
    /// All are squares of a pixel.
    pub(super) are_samples: bool,
}

/// Splats of a picture.
pub(super) struct OpaqueSplatList<'a> {
    /// Parts of them, each with its number of splats.
    pub(super) parts: Vec<(ListedSplats<'a>, usize)>,
    /// Look of all of these.
    pub(super) look: SplatShape,
    /// Squares of a pixel that come after them.
    pub(super) samples: &'a [Splat],
}

/// Splats of one look.
struct AlikeSplats<'a> {
    parts: Vec<(ListedSplats<'a>, usize)>,
    look: SplatShape,
    is_one_pixel: bool,
}

/// What is known before anything is drawn.
#[derive(Clone, Copy)]
pub(super) enum KnownSplats {
    /// Where splats are. Instead of a color pixels get what compute has in its keys, of the number in the list, and which
    /// splats are seen is marked.
    Places,
    /// The same, but nothing is marked.
    Numbers,
    /// What they look like as well.
    Colors,
}

/// Draws splats, by vectors of a level.
pub(super) fn draw_by(
    level: Level,
    drawn: OpaqueSplatList<'_>,
    frame: Frame<'_>,
    known: KnownSplats,
    (places, picture): (&mut SplatPlaces, ShownRectangle<'_>),
) {
    let OpaqueSplatList {
        parts: own,
        look,
        samples: sampled,
    } = drawn;
    let (screen, light) = frame;
    let own_count: usize = own.iter().map(|part| part.1).sum();
    let count = own_count + sampled.len();
    let sampled = sampled.chunks(parallel::PART);
    let sampled: Vec<_> = sampled
        .map(|part| match known {
            KnownSplats::Numbers => (ListedSplats::Places(part), part.len()),
            _ => (ListedSplats::List(part), part.len()),
        })
        .collect();
    let groups_of = |parts: &[(ListedSplats<'_>, usize)]| -> usize {
        parts.iter().map(|part| part.1.div_ceil(GROUP)).sum()
    };
    let own_groups = groups_of(&own);
    let group_count = own_groups + groups_of(&sampled);
    // What is not written below is not read either.
    let mut pixels = places.pixels.first(count);
    places
        .groups
        .resize(group_count.max(places.groups.len()), NearSplats::default());
    let [round_count, oval_count] =
        [Footprint::Circle, Footprint::Oriented].map(|own| match look.footprint == own {
            true => own_count,
            false => 0,
        });
    places
        .rounds
        .resize(round_count.max(places.rounds.len()), RoundPixels::default());
    places
        .ovals
        .resize(oval_count.max(places.ovals.len()), OvalOutline::default());
    places
        .seen
        .resize_with(own_count.max(places.seen.len()), AtomicU8::default);
    for seen in &mut places.seen[..own_count] {
        *seen.get_mut() = 0;
    }
    let (mut own_pixels, mut sampled_pixels) = (pixels.split(own_count), pixels);
    let (own_group, sampled_group) = places.groups[..group_count].split_at_mut(own_groups);
    let own_rounds = &mut places.rounds[..round_count];
    let own_ovals = &mut places.ovals[..oval_count];
    let is_one_pixel =
        look.footprint == Footprint::Square && look.has_one_size && screen.size_px <= 1.0;
    let of_samples = SplatShape {
        footprint: Footprint::Square,
        has_one_size: true,
    };
    place_all(
        level,
        (screen, light),
        AlikeSplats {
            parts: own,
            look,
            is_one_pixel,
        },
        (&mut own_pixels, (own_rounds, own_ovals), own_group),
    );
    place_all(
        level,
        (screen, light),
        AlikeSplats {
            parts: sampled,
            look: of_samples,
            is_one_pixel: true,
        },
        (&mut sampled_pixels, (&mut [], &mut []), sampled_group),
    );
    let lists = [
        PlacedSplats {
            first: 0,
            pixels: own_pixels.found(),
            rounds: own_rounds,
            ovals: own_ovals,
            groups: own_group,
            are_samples: is_one_pixel,
        },
        PlacedSplats {
            first: own_count as u32,
            pixels: sampled_pixels.found(),
            rounds: &[],
            ovals: &[],
            groups: sampled_group,
            are_samples: true,
        },
    ];
    let seen = &places.seen[..own_count];
    let width = screen.width();
    if width == 0 {
        return;
    }
    let bands = picture.bands(screen);
    places.bands.resize_with(bands.len(), BandFronts::default);
    let bands = bands.enumerate().zip(&mut places.bands);
    let has_colors = matches!(known, KnownSplats::Colors);
    parallel::share(count, bands, |((number, mut picture), fronts)| {
        let first_row = number * BAND_PX;
        let rows = picture.depths.len() / width;
        let mut band = fronts.band(width, [first_row, first_row + rows]);
        if picture.is_begun {
            band.read(&mut picture);
        }
        dispatch!(level, simd => {
            for list in &lists {
                band.draw(simd, list, has_colors);
            }
            band.write(simd, light.background, &mut picture);
        });
        if matches!(known, KnownSplats::Places) {
            mark(&picture, width, seen);
        }
    });
}

/// Marks those of the first splats of a list that are the nearest somewhere.
fn mark(picture: &ShownRectangle<'_>, width: usize, seen: &[AtomicU8]) {
    let mut last = u32::MAX;
    // Colors are covered, so they have the bit that keys have not.
    for &color in picture
        .shown(width)
        .filter(|&&color| color & SPLAT_BIT == 0)
    {
        let number = !color & !SPLAT_BIT;
        if number != last
            && let Some(seen) = seen.get(number as usize)
        {
            seen.store(1, Ordering::Relaxed);
        }
        last = number;
    }
}

/// Outlines of splats: those of discs that face the viewer, and those of discs in the plane of the surface. Each is empty for
/// other splats.
pub(super) type Outlines<'a> = (&'a mut [RoundPixels], &'a mut [OvalOutline]);

/// Splits the first `count` items off a list.
fn first_of<'a, T>(count: usize, list: &mut &'a mut [T]) -> (&'a mut [T], &'a mut [T]) {
    std::mem::take(list).split_at_mut(count)
}

/// Finds where splats are, part by part.
fn place_all(
    level: Level,
    frame: Frame<'_>,
    splats: AlikeSplats<'_>,
    (pixels, (mut rounds, mut ovals), mut groups): (
        &mut PixelSearch<'_>,
        Outlines<'_>,
        &mut [NearSplats],
    ),
) {
    let (screen, light) = frame;
    let AlikeSplats {
        parts,
        look,
        is_one_pixel,
    } = splats;
    let mut rest = pixels.again();
    let mut count = 0;
    let jobs: Vec<_> = parts
        .into_iter()
        .map(|(source, size)| {
            let (round, oval, group);
            (round, rounds) = first_of(rounds.len().min(size), &mut rounds);
            (oval, ovals) = first_of(ovals.len().min(size), &mut ovals);
            (group, groups) = std::mem::take(&mut groups).split_at_mut(size.div_ceil(GROUP));
            let first = count as u32;
            count += size;
            (source, first, (rest.split(size), (round, oval), group))
        })
        .collect();
    parallel::share(count, jobs.into_iter(), |(source, first, out)| {
        splat_bounds::part(
            level,
            screen,
            light,
            (source, look, is_one_pixel),
            first,
            out,
        );
    });
}
