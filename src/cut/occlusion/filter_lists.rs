//! What is left of the lists of a cut.

use crate::cut::Cut;
use crate::cut::occlusion::{DepthMark, DepthMarks, OcclusionTest};
use std::ops::Range;
use std::sync::atomic::Ordering;

impl OcclusionTest<'_> {
    /// Stores depths once more over which other threads may have stored farther ones. To be done with all marks before any
    /// is asked for the last time.
    pub(in crate::cut) fn repair(&self, marks: &DepthMarks) {
        if !self.are_pixels {
            return;
        }
        let DepthMarks {
            nodes,
            strips,
            leaves,
            triangles,
        } = marks;
        for mark in [nodes, strips, leaves, triangles].into_iter().flatten() {
            if let Some(pixel) = self.nearest.pixels.get(mark.first as usize)
                && mark.distance < pixel.load(Ordering::Relaxed)
            {
                pixel.fetch_min(mark.distance, Ordering::Relaxed);
            }
        }
    }

    /// Drops what is hidden now that all is found. `ends` are places in the lists of nodes and of rows, in ascending
    /// order, and are moved along.
    pub(in crate::cut) fn finish(
        &self,
        cut: &mut Cut,
        marks: &DepthMarks,
        ends: &mut [(usize, usize)],
    ) {
        let Cut {
            nodes,
            strips,
            leaves,
            triangles,
            stats,
        } = cut;
        let is_seen = |list: &[DepthMark], index: usize| {
            list.get(index).is_none_or(|&mark| !self.is_hidden(mark))
        };
        let nodes_before = nodes.len();
        retain(
            nodes,
            |index, _| is_seen(&marks.nodes, index),
            ends.iter_mut().map(|end| &mut end.0),
        );
        let mut next_mark = 0;
        let mut hidden_in_rows = 0;
        retain(
            strips,
            |_, run| {
                // One mark for each that was seen so far.
                let mut left = run.seen;
                while left != 0 {
                    let lowest = left & left.wrapping_neg();
                    left ^= lowest;
                    if !is_seen(&marks.strips, next_mark) {
                        run.seen ^= lowest;
                        hidden_in_rows += 1;
                    }
                    next_mark += 1;
                }
                run.seen != 0
            },
            ends.iter_mut().map(|end| &mut end.1),
        );
        let (leaves_before, triangles_before) = (leaves.len(), triangles.len());
        retain(
            leaves,
            |index, _| is_seen(&marks.leaves, index),
            [].into_iter(),
        );
        retain(
            triangles,
            |index, _| is_seen(&marks.triangles, index),
            [].into_iter(),
        );
        let before = nodes_before + leaves_before + triangles_before;
        let after = nodes.len() + leaves.len() + triangles.len();
        stats.hidden += hidden_in_rows + (before - after) as u64;
    }
}

/// Keeps the items for which `is_kept` (of their number and themselves) says so; `ends` (ascending) move along.
pub(super) fn retain<'e, T: Copy>(
    list: &mut Vec<T>,
    mut is_kept: impl FnMut(usize, &mut T) -> bool,
    ends: impl Iterator<Item = &'e mut usize>,
) {
    let mut kept = 0;
    // Which are kept cannot be foreseen: each is stored, and what is not kept is stored over.
    let mut take = |list: &mut [T], range: Range<usize>| {
        for index in range {
            let Some(&(mut item)) = list.get(index) else {
                break;
            };
            let is_kept = is_kept(index, &mut item);
            if let Some(place) = list.get_mut(kept) {
                *place = item;
            }
            kept += usize::from(is_kept);
        }
        kept
    };
    let (mut start, len) = (0, list.len());
    for end in ends {
        let own = start..(*end).min(len);
        start = own.end;
        *end = take(list, own);
    }
    let kept = take(list, start..len);
    list.truncate(kept);
}
