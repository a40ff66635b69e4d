//! What those splats of a cut that are seen look like.

use crate::cut::StripRun;
use crate::pack::parallel;
use crate::pack::splats::{NumberedSplat, PackedPart, SplatOutput, SplatWriter};
use crate::render::cpu::opaque::headlight::{BlockSurfaces, FrameHeadlight};
use crate::render::cpu::opaque::splat_bounds::{BLOCK, Row};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};
use std::sync::atomic::{AtomicU8, Ordering};

/// Splats of a cut that one thread looks at, and what writes them.
#[derive(Clone, Copy)]
pub(super) struct WrittenPart<'a> {
    pub(super) writer: &'a SplatWriter<'a>,
    pub(super) part: PackedPart<'a>,
    /// Most splats that it has.
    pub(super) count: usize,
}

fn is_marked(seen: &AtomicU8) -> bool {
    seen.load(Ordering::Relaxed) != 0
}

/// Shades splats block by block; their colors go to places of a list.
struct BlockShader<'a, P> {
    level: Level,
    light: &'a FrameHeadlight,
    places: P,
    colors: &'a mut [i32],
    len: usize,
    /// Of a block.
    own_places: [usize; BLOCK],
    centers: [Row; 3],
    surfaces: BlockSurfaces,
}

impl<P: Iterator<Item = usize>> SplatOutput for BlockShader<'_, P> {
    const HAS_THICKNESS: bool = false;

    #[inline(always)]
    fn point(&mut self, named: &NumberedSplat) {
        let splat = &named.splat;
        let Some(place) = self.places.next() else {
            return;
        };
        let at = self.len % BLOCK;
        self.own_places[at] = place;
        let [x, y, z] = &mut self.centers;
        (x[at], y[at], z[at]) = (splat.center.x, splat.center.y, splat.center.z);
        self.surfaces.put(at, splat);
        self.len += 1;
        if self.len == BLOCK {
            self.flush();
        }
    }

    #[inline(always)]
    fn quad(&mut self, named: &NumberedSplat) {
        self.point(named);
    }
}

impl<P> BlockShader<'_, P> {
    #[inline(never)]
    fn flush(&mut self) {
        let mut colors = [0; BLOCK];
        dispatch!(self.level, simd => self.shade(simd, &mut colors));
        for (&place, color) in self.own_places.iter().zip(colors).take(self.len) {
            self.colors[place] = color;
        }
        self.len = 0;
    }

    #[inline(always)]
    fn shade<S: Simd>(&self, simd: S, colors: &mut [i32; BLOCK]) {
        for at in (0..self.len).step_by(<S::f32s as SimdBase<S>>::LEN) {
            (self.surfaces).shade(simd, self.light, &self.centers, at, colors);
        }
    }
}

/// Finds the colors of the splats of all parts that are marked, each to its own place. All that are marked have an area.
pub(super) fn shade(
    level: Level,
    light: &FrameHeadlight,
    parts: Vec<WrittenPart<'_>>,
    mut seen: &[AtomicU8],
    mut colors: &mut [i32],
) {
    let all = seen.len();
    let jobs: Vec<_> = parts
        .into_iter()
        .map(
            |WrittenPart {
                 writer,
                 part,
                 count,
             }| {
                let (own, own_seen);
                (own, colors) = std::mem::take(&mut colors).split_at_mut(count);
                (own_seen, seen) = seen.split_at(count);
                ((writer, part), own_seen, own)
            },
        )
        .collect();
    parallel::share(all, jobs.into_iter(), |((writer, part), seen, colors)| {
        let places = seen.iter().enumerate();
        let places = places.filter(|(_, seen)| is_marked(seen));
        let mut shader = BlockShader {
            level,
            light,
            places: places.map(|(place, _)| place),
            colors,
            len: 0,
            own_places: [0; BLOCK],
            centers: [[0.0; BLOCK]; 3],
            surfaces: BlockSurfaces::NOTHING,
        };
        write(writer, part, seen, &mut shader);
        shader.flush();
    });
}

/// Writes those of a part that are marked.
fn write(
    writer: &SplatWriter<'_>,
    part: PackedPart<'_>,
    seen: &[AtomicU8],
    out: &mut impl SplatOutput,
) {
    let marked = |ids: &[u32]| -> Vec<u32> {
        let ids = ids.iter().zip(seen).filter(|(_, seen)| is_marked(seen));
        ids.map(|(&id, _)| id).collect()
    };
    match part {
        PackedPart::Nodes(ids) => writer.part(PackedPart::Nodes(&marked(ids)), out),
        PackedPart::Leaves(ids) => writer.part(PackedPart::Leaves(&marked(ids)), out),
        PackedPart::Large(ids) => writer.part(PackedPart::Large(&marked(ids)), out),
        PackedPart::Rows(rows) => {
            let mut seen = seen.iter();
            let of_row = |row: &StripRun| {
                let drawn = (0..row.count).filter(|&i| row.is_seen(i));
                let marked = drawn.zip(seen.by_ref()).filter(|(_, seen)| is_marked(seen));
                let seen = marked.fold(0, |mask, (i, _)| mask | 1 << i);
                StripRun { seen, ..*row }
            };
            let rows: Vec<_> = rows
                .iter()
                .map(of_row)
                .filter(|row| row.seen != 0)
                .collect();
            writer.part(PackedPart::Rows(&rows), out);
        }
    }
}
