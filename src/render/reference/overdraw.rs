//! The reference of the heat map of overdraw: how many primitives cover each pixel, whatever hides them.

use crate::abi::Vertex;
use crate::abi::constants::MOST_OVERDRAW;
use crate::image::unorm8;
use crate::math::camera::View;
use crate::pack::{DrawList, FilteredList, FuzzyList, PrimitiveStyle, falsecolor};
use crate::render::reference::bands::PixelRows;
use crate::render::reference::frame::ReferenceFrame;
use crate::render::reference::splat::splat_of_vertex;
use crate::render::reference::{filtered, fuzzy, opaque, triangle};
use rayon::prelude::*;

/// The list of a frame whose overdraw is counted.
#[derive(Debug, Clone, Copy)]
pub enum OverdrawList<'a> {
    /// What [`crate::render::reference::render`] draws, and [`crate::render::reference::render_visibility`].
    Opaque(&'a DrawList<'a>),
    /// What [`crate::render::reference::render_fuzzy`] draws.
    Fuzzy(&'a FuzzyList<'a>),
    /// What [`crate::render::reference::render_filtered`] draws.
    Filtered(&'a FilteredList<'a>),
}

/// FrameCounts, row by row from the top left, how many primitives of a list cover each pixel: without a depth test, so in any
/// order. A triangle, square, disc or ellipse covers the pixels whose centers lie in it, at least one pixel as it is drawn; a
/// fuzzy splat those in which it is blended, widened by [`PrimitiveStyle::low_pass_px`]; a filtered splat those that its rectangle
/// overlaps. What [`crate::render::reference::render`] drops or culls covers nothing. Empty for a picture without pixels.
///
/// Cost: linear in primitives plus covered pixels, on all threads of the rayon pool.
pub fn count_overdraw(view: &View, list: OverdrawList<'_>, style: &PrimitiveStyle) -> Vec<u32> {
    let frame = ReferenceFrame::new(view, style);
    let mut counts = PixelRows::cleared(view, 0);
    let (vertices, triangles): (&[Vertex], &[[u32; 3]]) = match list {
        OverdrawList::Opaque(list) => (list.vertices, list.triangles),
        OverdrawList::Fuzzy(list) => (list.vertices, list.triangles),
        OverdrawList::Filtered(list) => (list.vertices, list.triangles),
    };
    counts.draw(
        triangles,
        |corners| {
            triangle::set_up(&frame, (vertices, None), *corners, |v| {
                frame.place(v.position)
            })
        },
        count_one,
    );
    match list {
        OverdrawList::Opaque(list) => {
            let set_up = |splat: &_| opaque::set_up(&frame, splat);
            counts.draw(list.splats, set_up, count_one);
            counts.draw(list.points, |p| set_up(&splat_of_vertex(p)), count_one);
        }
        OverdrawList::Fuzzy(list) => {
            let set_up = |splat: &_| fuzzy::set_up_blended(&frame, splat);
            counts.draw(list.splats, set_up, count_one);
            counts.draw(list.points, |p| set_up(&fuzzy::weighted(p)), count_one);
        }
        OverdrawList::Filtered(list) => counts.draw(
            list.splats,
            |splat| filtered::set_up_blended(&frame, splat),
            |count, _, overlap| {
                if overlap > 0.0 {
                    *count += 1;
                }
            },
        ),
    }
    counts.into_pixels()
}

/// What a fragment does to the count of its pixel.
fn count_one<S, A>(count: &mut u32, _primitive: &S, _sample: A) {
    *count += 1;
}

/// The counts as colors, 1 at the dark end of the ramp, each doubling a sixth farther
/// ([`ColorBy::Overdraw`](crate::pack::ColorBy::Overdraw)); the background with alpha 0 where nothing is.
pub fn show_overdraw(counts: &[u32], style: &PrimitiveStyle) -> Vec<[u8; 4]> {
    let color = |&count: &u32| {
        let ([r, g, b], alpha) = if count > 0 {
            let doublings = (count as f32).log2();
            (falsecolor::ramp(doublings / MOST_OVERDRAW.log2()), 1.0)
        } else {
            (style.background, 0.0)
        };
        [r, g, b, alpha].map(|c| unorm8(f64::from(c)))
    };
    counts.par_iter().map(color).collect()
}
