//! What is left of the lists of a cut.

use super::{Hiding, Mark, Marks};
use crate::cut::strip::strip_steps;
use crate::cut::tester::Tester;
use crate::cut::{Cut, MAX_STRIP_COUNT, StripRun};
use crate::tree::{Model, Node};
use glam::Vec4;
use std::ops::Range;

/// Splats of rows that are asked for together: at least [`MAX_STRIP_COUNT`].
const ROWS: usize = 64;
const _: () = assert!(ROWS >= MAX_STRIP_COUNT as usize && ROWS.is_multiple_of(4));

impl Hiding<'_> {
    /// Drops what is hidden of the rows of splats from number `first` on. Returns how many splats they are.
    pub(in crate::cut) fn keep_rows(
        &self,
        model: &Model,
        tester: &Tester,
        strips: &mut Vec<StripRun>,
        first: usize,
        marks: &mut Vec<Mark>,
    ) -> u64 {
        let nodes: &[Node] = &model.tree.nodes;
        let undrawn = &self.undrawn.nodes;
        let (mut kept, mut hidden) = (first, 0);
        let mut next = first;
        // Splats of many rows together, so that no lane is idle; x, y and z each for themselves.
        let mut centers = [[0.0; ROWS]; 3];
        let mut found = [Mark::HIDDEN; ROWS];
        while next < strips.len() {
            let (start, mut count, mut end) = (next, 0, next);
            for run in strips.get(start..).unwrap_or_default() {
                let many = run.count as usize;
                let Some(node) = nodes
                    .get(run.node as usize)
                    .filter(|_| count + many <= ROWS)
                else {
                    break;
                };
                let (center, step) = strip_steps(node, run.count);
                for i in 0..many {
                    let center = center + step * i as f32;
                    for (list, v) in centers.iter_mut().zip(center.to_array()) {
                        list[(count + i) % ROWS] = v;
                    }
                }
                count += many;
                end += 1;
            }
            if end == start {
                // Only where the tree's links are wrong.
                return hidden;
            }
            next = end;
            let fours = centers.each_ref().map(|list| list.as_chunks::<4>().0);
            let [x, y, z] = fours.map(|fours| fours.iter().map(|&four| Vec4::from_array(four)));
            let places = x.zip(y).zip(z).zip((0..count).step_by(4));
            for ((((x, y), z), at), found) in places.zip(found.as_chunks_mut::<4>().0) {
                // Where any node has no area, rows cover nothing: that is rare.
                let balls = tester.balls([x, y, z, Vec4::ZERO]);
                let lanes = 15 >> (4 - (count - at).min(4));
                *found = self.ask(&balls, lanes, |_| !undrawn.is_empty());
            }
            // The marks of those that are seen move together, in place.
            let (mut at, mut seen_marks) = (0, 0);
            for index in start..end {
                let Some(&run) = strips.get(index) else { break };
                let (mut seen, before) = (0, seen_marks);
                for i in 0..run.count {
                    let mark = found[at % ROWS];
                    found[seen_marks % ROWS] = mark;
                    at += 1;
                    let is_seen = mark.rows != 0;
                    seen_marks += usize::from(is_seen);
                    seen |= u32::from(is_seen) << (i & 31);
                }
                hidden += u64::from(run.count) - (seen_marks - before) as u64;
                if let Some(place) = strips.get_mut(kept) {
                    *place = StripRun { seen, ..run };
                }
                kept += usize::from(seen != 0);
            }
            marks.extend_from_slice(found.get(..seen_marks).unwrap_or_default());
        }
        strips.truncate(kept);
        hidden
    }

    /// Drops what is hidden now that all is found. `ends` are places in the lists of nodes and of rows, in ascending
    /// order, and are moved along.
    pub(in crate::cut) fn finish(&self, cut: &mut Cut, marks: &Marks, ends: &mut [(usize, usize)]) {
        let Cut {
            nodes,
            strips,
            leaves,
            triangles,
            stats,
        } = cut;
        let is_seen =
            |list: &[Mark], index: usize| list.get(index).is_none_or(|&mark| !self.is_hidden(mark));
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
