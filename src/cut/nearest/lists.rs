//! What is left of the lists of a cut.

use super::{Hiding, Mark, Marks};
use crate::cut::quad;
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
        // Splats of many rows together, so that no lane is idle.
        let mut centers = [Vec4::ZERO; ROWS];
        let mut found = [Mark::HIDDEN; ROWS];
        while next < strips.len() {
            let (start, mut count, mut end) = (next, 0, next);
            for run in strips.get(start..).unwrap_or_default() {
                let many = run.count as usize;
                let (Some(node), Some(own)) = (
                    nodes.get(run.node as usize),
                    centers.get_mut(count..count + many),
                ) else {
                    break;
                };
                let (center, step) = strip_steps(node, run.count);
                for (place, i) in own.iter_mut().zip(0u16..) {
                    *place = (center + step * f32::from(i)).extend(0.0);
                }
                count += many;
                end += 1;
            }
            if end == start {
                // Only where the tree's links are wrong.
                return hidden;
            }
            next = end;
            let fours = centers.as_chunks::<4>().0.iter();
            for ((four, found), at) in fours
                .zip(found.as_chunks_mut::<4>().0)
                .zip((0..count).step_by(4))
            {
                // Where any node has no area, rows cover nothing: that is rare.
                let balls = tester.balls(quad::columns(*four));
                let lanes = 15 >> (4 - (count - at).min(4));
                *found = self.ask(&balls, lanes, |_| !undrawn.is_empty());
            }
            let mut at = 0;
            for index in start..end {
                let Some(&run) = strips.get(index) else { break };
                let own = at..at + run.count as usize;
                at = own.end;
                let own = found.get(own).unwrap_or_default();
                let run = run.seen_of(own.iter().map(|mark| mark.rows != 0));
                hidden += u64::from(run.count - run.splats());
                if run.seen == 0 {
                    continue;
                }
                marks.extend(own.iter().filter(|mark| mark.rows != 0));
                if let Some(place) = strips.get_mut(kept) {
                    *place = run;
                }
                kept += 1;
            }
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
        let mut first_mark = 0;
        let mut hidden_in_rows = 0;
        retain(
            strips,
            |_, run| {
                let own = first_mark..first_mark + run.splats() as usize;
                first_mark = own.end;
                let mut own = marks.strips.get(own).unwrap_or_default().iter();
                let before = *run;
                // One mark for each that was seen so far.
                *run = run.seen_of((0..run.count).map(|i| {
                    before.is_seen(i) && own.next().is_none_or(|&mark| !self.is_hidden(mark))
                }));
                hidden_in_rows += u64::from(before.splats() - run.splats());
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
