//! The records of those splats of a cut that are seen.

use super::super::parts;
use super::super::splats::{Out, Part, Plan, Writer};
use crate::abi::Splat;
use crate::cut::StripRun;
use crate::math::camera::View;
use crate::tree::Model;
use std::sync::atomic::{AtomicU8, Ordering};

/// Records go to the places that are marked, one after the other.
struct Sink<'a> {
    places: std::slice::IterMut<'a, Splat>,
    seen: std::slice::Iter<'a, AtomicU8>,
}

fn is_marked(seen: &AtomicU8) -> bool {
    seen.load(Ordering::Relaxed) != 0
}

impl Out for Sink<'_> {
    #[inline]
    fn point(&mut self, splat: Splat, _area: f32) {
        for (place, seen) in self.places.by_ref().zip(self.seen.by_ref()) {
            if is_marked(seen) {
                *place = splat;
                return;
            }
        }
    }

    fn quad(&mut self, splat: Splat, area: f32) {
        self.point(splat, area);
    }
}

/// Writes the records of the splats of all parts that are marked, each to its own place. All that are marked have an area.
pub(super) fn pack(
    model: &Model,
    (view, plan): (&View, &Plan),
    parts: Vec<(Part<'_>, usize)>,
    mut seen: &[AtomicU8],
    mut out: &mut [Splat],
) {
    let writer = Writer::new(model, view, plan);
    let all = out.len();
    let jobs: Vec<_> = parts
        .into_iter()
        .map(|(part, count)| {
            let (own, own_seen);
            (own, out) = std::mem::take(&mut out).split_at_mut(count);
            (own_seen, seen) = seen.split_at(count);
            (part, own_seen, own)
        })
        .collect();
    parts::share(all, jobs.into_iter(), |(part, seen, out)| {
        let mut sink = Sink {
            places: out.iter_mut(),
            seen: seen.iter(),
        };
        let marked = |ids: &[u32]| -> Vec<u32> {
            let ids = ids.iter().zip(seen).filter(|(_, seen)| is_marked(seen));
            ids.map(|(&id, _)| id).collect()
        };
        match part {
            Part::Nodes(ids) => writer.part(Part::Nodes(&marked(ids)), &mut sink),
            Part::Leaves(ids) => writer.part(Part::Leaves(&marked(ids)), &mut sink),
            Part::Large(ids) => writer.part(Part::Large(&marked(ids)), &mut sink),
            Part::Rows(rows) => {
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
                writer.part(Part::Rows(&rows), &mut sink);
            }
        }
    });
}
