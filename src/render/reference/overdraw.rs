//! The CPU mirror of the heat map of overdraw: how many primitives cover each pixel, whatever hides them.

use crate::abi::Vertex;
use crate::image::unorm8;
use crate::math::camera::View;
use crate::pack::{DrawList, FilteredList, Footprint, FuzzyList, Style, falsecolor};
use crate::render::reference::filtered;
use crate::render::reference::filtered::Patch;
use crate::render::reference::fuzzy;
use crate::render::reference::fuzzy::Ready;
use crate::render::reference::triangle;
use crate::render::reference::triangle::Triangle;
use crate::render::reference::{CHUNK, Frame, draw, gather, round, square};
use rayon::prelude::*;
use std::ops::Range;

/// The list of a frame.
#[derive(Debug, Clone, Copy)]
pub enum Drawn<'a> {
    /// What [`crate::render::reference::render`] draws, and [`crate::render::reference::render_visibility`].
    Opaque(&'a DrawList<'a>),
    /// What [`crate::render::reference::render_fuzzy`] draws.
    Fuzzy(&'a FuzzyList<'a>),
    /// What [`crate::render::reference::render_filtered`] draws.
    Filtered(&'a FilteredList<'a>),
}

/// Counts, row by row from the top left, how many primitives of a list cover each pixel: without a depth test, so in any
/// order. A triangle, square, disc or ellipse covers the pixels whose centers lie in it, at least one pixel as it is drawn; a
/// fuzzy splat those in which it is blended, widened by [`Style::low_pass_px`]; a filtered splat those that its rectangle
/// overlaps. What [`crate::render::reference::render`] drops or culls covers nothing. Empty for a picture without pixels.
///
/// Cost: linear in primitives plus covered pixels, on all threads of the rayon pool.
pub fn count_overdraw(view: &View, drawn: Drawn<'_>, style: &Style) -> Vec<u32> {
    let mut counts = vec![0; view.width as usize * view.height as usize];
    if counts.is_empty() {
        return counts;
    }
    let frame = Frame::new(view, style);
    let mut bands = bands(view, &mut counts);
    let (vertices, triangles): (&[Vertex], &[[u32; 3]]) = match drawn {
        Drawn::Opaque(list) => (list.vertices, list.triangles),
        Drawn::Fuzzy(list) => (list.vertices, list.triangles),
        Drawn::Filtered(list) => (list.vertices, list.triangles),
    };
    let mut count = Counter {
        bands: &mut bands,
        frame: &frame,
    };
    count.all(
        triangles,
        |frame, corners, out| triangle::set_up(frame, vertices, *corners, out),
        |band, t: &Triangle| {
            let rows = band.rows(&t.rows);
            t.for_each_pixel(rows, |x, y, _, _| band.add(x, y));
        },
    );
    match drawn {
        Drawn::Opaque(list) if style.footprint == Footprint::Square => {
            let cover = |band: &mut Band<'_>, s: &square::Square| {
                band.add_all(&s.footprint.columns, &s.footprint.rows);
            };
            count.all(
                list.splats,
                |f, s, out| out.extend(square::of_splat(f, s)),
                cover,
            );
            count.all(
                list.points,
                |f, p, out| out.extend(square::of_point(f, p)),
                cover,
            );
        }
        Drawn::Opaque(list) => {
            let cover = |band: &mut Band<'_>, s: &round::Round| {
                let rows = band.rows(&s.disc.rows);
                s.disc.for_each_pixel(rows, |x, y, _| band.add(x, y));
            };
            count.all(
                list.splats,
                |f, s, out| out.extend(round::of_splat(f, s)),
                cover,
            );
            count.all(
                list.points,
                |f, p, out| out.extend(round::of_point(f, p)),
                cover,
            );
        }
        Drawn::Fuzzy(list) => {
            let low_pass = Some(f64::from(style.low_pass_px));
            let cover = |band: &mut Band<'_>, s: &Ready| {
                let rows = band.rows(s.rows());
                s.for_each_pixel(rows, |x, y, _| band.add(x, y));
            };
            count.all(
                list.splats,
                |f, s, out| out.extend(fuzzy::ready(f, s, low_pass)),
                cover,
            );
            count.all(
                list.points,
                |f, p, out| out.extend(fuzzy::ready(f, &fuzzy::vertex_splat(p), low_pass)),
                cover,
            );
        }
        Drawn::Filtered(list) => count.all(
            list.splats,
            |f, s, out| out.extend(filtered::patch(f, s)),
            |band, patch: &Patch| {
                for y in band.rows(&patch.rows) {
                    for x in patch.columns.clone() {
                        if patch.overlap(x, y) > 0.0 {
                            band.add(x, y);
                        }
                    }
                }
            },
        ),
    }
    counts
}

/// The counts as colors: those of [`falsecolor::of_overdraw`], and the background with alpha 0 where nothing is.
pub fn show_overdraw(counts: &[u32], style: &Style) -> Vec<[u8; 4]> {
    let [r, g, b] = style.background;
    let background = [r, g, b, 0.0];
    let color = |&count: &u32| match falsecolor::of_overdraw(count) {
        [r, g, b] if count > 0 => [r, g, b, 1.0],
        _ => background,
    };
    let rounded = |count| color(count).map(|c| unorm8(f64::from(c)));
    counts.par_iter().map(rounded).collect()
}

/// Sets up primitives and counts what they cover.
struct Counter<'c, 'b, 'f> {
    bands: &'c mut [Band<'b>],
    frame: &'c Frame<'f>,
}

impl<'b, 'f> Counter<'_, 'b, 'f> {
    fn all<T: Sync, S: Send + Sync>(
        &mut self,
        primitives: &[T],
        set_up: impl Fn(&Frame<'f>, &T, &mut Vec<S>) + Sync,
        cover: impl Fn(&mut Band<'b>, &S) + Sync,
    ) {
        for chunk in primitives.chunks(CHUNK) {
            let ready = gather(chunk, |primitive, out| set_up(self.frame, primitive, out));
            draw(self.bands, &ready, &cover);
        }
    }
}

/// Consecutive rows of the counts.
struct Band<'a> {
    width: usize,
    first_row: u32,
    end_row: u32,
    counts: &'a mut [u32],
}

/// Bands of whole rows, from the top; several a thread, since models are seldom spread evenly.
fn bands<'a>(view: &View, counts: &'a mut [u32]) -> Vec<Band<'a>> {
    let width = view.width as usize;
    let rows = (view.height as usize)
        .div_ceil(4 * rayon::current_num_threads())
        .max(1);
    counts
        .chunks_mut(rows * width)
        .enumerate()
        .map(|(i, counts)| Band {
            width,
            first_row: (i * rows) as u32,
            end_row: (i * rows + counts.len() / width) as u32,
            counts,
        })
        .collect()
}

impl Band<'_> {
    /// The part of a range of rows that lies in this band.
    fn rows(&self, rows: &Range<u32>) -> Range<u32> {
        rows.start.max(self.first_row)..rows.end.min(self.end_row)
    }

    fn add(&mut self, x: u32, y: u32) {
        self.counts[(y - self.first_row) as usize * self.width + x as usize] += 1;
    }

    /// Every pixel of a rectangle.
    fn add_all(&mut self, columns: &Range<u32>, rows: &Range<u32>) {
        for y in self.rows(rows) {
            for x in columns.clone() {
                self.add(x, y);
            }
        }
    }
}
