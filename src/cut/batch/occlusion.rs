//! What nearer splats hide of a batch.

use crate::cut::batch::ahead::PrefetchAhead;
use crate::cut::batch::{LANES, LaneMask, NodeBatch, SiblingGroup};
use crate::cut::frustum_and_size::NodeTester;
use crate::cut::occlusion::{CHUNK, DepthMarks, OcclusionTest, SplatChunk};
use crate::cut::strip::half_rows;
use crate::cut::{Cut, MAX_STRIP_COUNT, StripRun};
use crate::simd::{FloatLanes, WideLanes};
use fearless_simd::prelude::*;

/// Room for the splats of rows in a chunk, and for a store of a row's at any place.
const SPLATS: usize = CHUNK + MAX_STRIP_COUNT as usize;
const _: () = assert!(MAX_STRIP_COUNT as usize <= CHUNK && LANES <= CHUNK);

/// Some of the splats of a batch's rows, numbers of one kind in a list each.
#[derive(Debug)]
pub(super) struct OcclusionRows {
    /// Where the middles of rows are along the axes of the picture and the view direction, and how far their ends are from there.
    middles: [[f32; LANES]; 3],
    halves: [[f32; LANES]; 3],
    splats: [[f32; SPLATS]; 3],
    /// Rows whose splats these are.
    runs: Vec<StripRun>,
}

impl Default for OcclusionRows {
    fn default() -> Self {
        Self {
            middles: [[0.0; LANES]; 3],
            halves: [[0.0; LANES]; 3],
            splats: [[0.0; SPLATS]; 3],
            runs: Vec::with_capacity(CHUNK),
        }
    }
}

#[inline(always)]
fn put<S: Simd>(lists: &mut [[f32; LANES]; 3], at: usize, numbers: [WideLanes<S>; 3]) {
    let lanes = at..at + WideLanes::<S>::LANES;
    let [x, y, z] = lists;
    let [a, b, c] = numbers;
    a.store(&mut x[lanes.clone()]);
    b.store(&mut y[lanes.clone()]);
    c.store(&mut z[lanes]);
}

impl NodeBatch {
    /// Drops small nodes that are hidden.
    #[inline(always)]
    pub(super) fn hide_nodes<S: Simd>(
        &mut self,
        simd: S,
        hiding: &OcclusionTest<'_>,
        groups: &[SiblingGroup],
        (marks, cut): (&mut DepthMarks, &mut Cut),
        ahead: &mut PrefetchAhead<'_>,
    ) {
        let asked = self.verdicts.kept & self.verdicts.small;
        let undrawn = of_groups(groups, hiding.has_undrawn_nodes(), |first| {
            hiding.undrawn_nodes(first)
        });
        let seen = self.ask(
            simd,
            hiding,
            (asked, undrawn, hiding.is_exact()),
            &mut marks.nodes,
            ahead,
        );
        cut.stats.hidden += u64::from(asked.count() - seen.count());
        self.verdicts.kept = self.verdicts.kept & (seen | !asked);
    }

    /// Which of the lanes that are asked for are not hidden so far; those in `undrawn` hide nothing. Each that is seen leaves a
    /// mark.
    #[inline(always)]
    fn ask<S: Simd>(
        &mut self,
        simd: S,
        hiding: &OcclusionTest<'_>,
        (asked, undrawn, have_sizes): (LaneMask, LaneMask, bool),
        marks: &mut Vec<crate::cut::occlusion::DepthMark>,
        ahead: &mut PrefetchAhead<'_>,
    ) -> LaneMask {
        if asked.is_empty() {
            return asked;
        }
        self.chunk.clear();
        let width = WideLanes::<S>::LANES;
        for at in (0..LANES).step_by(width) {
            ahead.ask_each(at, 1);
            let lanes = asked.get(at, width);
            if lanes == 0 {
                continue;
            }
            let balls = self.siblings.balls(simd, at);
            let [x, y] = hiding.centers.along(balls.center);
            let radius = if have_sizes { balls.radius } else { x.all(0.0) };
            let splats = [x, y, balls.depth, radius];
            let lanes = (lanes, undrawn.get(at, width));
            hiding.place(simd, &mut self.chunk, at, splats, lanes);
        }
        hiding.ask(simd, &mut self.chunk, marks)
    }

    /// Drops triangles between the centers of pixels, and small ones where splats are samples.
    #[inline(always)]
    pub(super) fn drop_between<S: Simd>(
        &mut self,
        simd: S,
        hiding: &OcclusionTest<'_>,
        count: usize,
        cut: &mut Cut,
    ) {
        let (have_sizes, asks_large) = hiding.of_leaves();
        if have_sizes || asks_large {
            return;
        }
        let splats = LaneMask::all(hiding.is_exact());
        let asked = self.verdicts.kept & (!self.verdicts.small | splats);
        let mut misses = LaneMask::default();
        let width = WideLanes::<S>::LANES;
        for at in (0..4 * count).step_by(width) {
            let lanes = asked.get(at, width);
            if lanes != 0 {
                let balls = self.siblings.balls(simd, at);
                misses.add(at, lanes & hiding.centers.none(&balls));
            }
        }
        let small = (misses & self.verdicts.small).count();
        cut.stats.between += u64::from(misses.count() - small);
        cut.stats.hidden += u64::from(small);
        self.verdicts.kept = self.verdicts.kept & !misses;
    }

    /// Drops leaves that are hidden; those in `always` are splats in any case.
    #[inline(always)]
    pub(super) fn hide_leaves<S: Simd>(
        &mut self,
        simd: S,
        hiding: &OcclusionTest<'_>,
        groups: &[SiblingGroup],
        always: LaneMask,
        (cut, marks): (&mut Cut, &mut DepthMarks),
    ) {
        if !hiding.asks_splats() {
            return;
        }
        let (have_sizes, asks_large) = hiding.of_leaves();
        let undrawn = of_groups(groups, hiding.has_undrawn_leaves(), |first| {
            hiding.undrawn_leaves(first)
        });
        // A small triangle has the constant size, a point of a cloud and a large triangle their own.
        let splats = self.verdicts.small | always;
        let kinds = [
            (
                splats,
                have_sizes || hiding.is_exact(),
                true,
                &mut marks.leaves,
            ),
            (!splats, true, asks_large, &mut marks.triangles),
        ];
        for (kind, have_sizes, is_asked, marks) in kinds {
            if is_asked {
                let asked = self.verdicts.kept & kind;
                let ahead = &mut PrefetchAhead::none();
                let seen = self.ask(simd, hiding, (asked, undrawn, have_sizes), marks, ahead);
                cut.stats.hidden += u64::from(asked.count() - seen.count());
                self.verdicts.kept = self.verdicts.kept & (seen | !asked);
            }
        }
    }

    /// Appends the rows of the batch to the cut, less what is hidden of them.
    #[inline(always)]
    pub(super) fn hide_rows<S: Simd>(
        &mut self,
        simd: S,
        hiding: &OcclusionTest<'_>,
        tester: &NodeTester,
        groups: &[SiblingGroup],
        (marks, cut): (&mut DepthMarks, &mut Cut),
        ahead: &mut PrefetchAhead<'_>,
    ) {
        let rows = self.verdicts.rows;
        let width = WideLanes::<S>::LANES;
        for at in (0..4 * groups.len()).step_by(width) {
            ahead.ask_each(at, 1);
            if rows.get(at, width) == 0 {
                continue;
            }
            let balls = self.siblings.balls(simd, at);
            let half = half_rows(&balls, &self.siblings.words(simd, at));
            let ([x, y], [way_x, way_y]) = (
                hiding.centers.along(balls.center),
                hiding.centers.way_along(half),
            );
            put(&mut self.split.middles, at, [x, y, balls.depth]);
            let way_forward = tester.way_forward(half);
            put(&mut self.split.halves, at, [way_x, way_y, way_forward]);
        }
        let mut count = 0;
        for lane in rows.lanes() {
            let run = StripRun::new(self.siblings.number(lane), self.counts[lane % LANES]);
            if count + MAX_STRIP_COUNT as usize > CHUNK {
                self.keep_rows(simd, hiding, count, marks, cut);
                count = 0;
            }
            self.split.add(simd, lane % LANES, run, count);
            count += run.count as usize;
        }
        if count > 0 {
            self.keep_rows(simd, hiding, count, marks, cut);
        }
    }

    /// Appends the rows whose splats are in the chunk, so many of them, less what is hidden.
    #[inline(always)]
    fn keep_rows<S: Simd>(
        &mut self,
        simd: S,
        hiding: &OcclusionTest<'_>,
        count: usize,
        marks: &mut DepthMarks,
        cut: &mut Cut,
    ) {
        // Where any node has no area, rows cover nothing: that is rare.
        let undrawn = if hiding.has_undrawn_nodes() {
            u32::MAX
        } else {
            0
        };
        // Needles may be far thinner than a pixel: where splats are samples, their squares are asked, lest they vanish.
        let radius = match hiding.is_exact() {
            true => f32::INFINITY,
            false => 0.0,
        };
        let all = LaneMask::first(count);
        let width = WideLanes::<S>::LANES;
        self.chunk.clear();
        for at in (0..count).step_by(width) {
            let lanes = at..at + width;
            let [x, y, z] = &self.split.splats;
            let x = WideLanes::load(simd, &x[lanes.clone()]);
            let splats = [
                x,
                WideLanes::load(simd, &y[lanes.clone()]),
                WideLanes::load(simd, &z[lanes]),
                x.all(radius),
            ];
            let lanes = (all.get(at, width), undrawn);
            hiding.place(simd, &mut self.chunk, at, splats, lanes);
        }
        keep_runs(
            simd,
            hiding,
            &mut self.chunk,
            &self.split.runs,
            count,
            marks,
            cut,
        );
        self.split.runs.clear();
    }
}

impl OcclusionRows {
    /// Adds the splats of the row in a lane, of which the first has this number.
    #[inline(always)]
    fn add<S: Simd>(&mut self, simd: S, lane: usize, run: StripRun, first: usize) {
        let step = 2.0 / run.count as f32;
        let (own, along) = (first..first + MAX_STRIP_COUNT as usize, &ALONG);
        for ((splats, middles), halves) in
            self.splats.iter_mut().zip(&self.middles).zip(&self.halves)
        {
            let (middle, half) = (middles[lane], halves[lane]);
            let own = &mut splats[own.clone()];
            for at in (0..run.count as usize).step_by(WideLanes::<S>::LANES) {
                let lanes = at..at + WideLanes::<S>::LANES;
                let along = WideLanes::load(simd, &along[lanes.clone()]) * step - 1.0;
                (along * half + middle).store(&mut own[lanes]);
            }
        }
        self.runs.push(run);
    }
}

/// Where the splats of a row are, in halves of the way between two.
const ALONG: [f32; MAX_STRIP_COUNT as usize] = {
    let mut along = [0.5; MAX_STRIP_COUNT as usize];
    let mut i = 1;
    while i < along.len() {
        along[i] = along[i - 1] + 1.0;
        i += 1;
    }
    along
};

/// What is so of the siblings of groups, where it may be of any.
#[inline(always)]
fn of_groups(groups: &[SiblingGroup], may_be: bool, of: impl Fn(u32) -> u8) -> LaneMask {
    let mut mask = LaneMask::default();
    if may_be {
        for (index, group) in groups.iter().enumerate() {
            mask.add(4 * index, u32::from(of(group.first)));
        }
    }
    mask
}

/// Appends what is seen of rows whose splats are in the chunk.
#[inline(always)]
fn keep_runs<S: Simd>(
    simd: S,
    hiding: &OcclusionTest<'_>,
    chunk: &mut SplatChunk,
    runs: &[StripRun],
    splats: usize,
    marks: &mut DepthMarks,
    cut: &mut Cut,
) {
    let seen = hiding.ask(simd, chunk, &mut marks.strips);
    cut.stats.hidden += splats as u64 - u64::from(seen.count());
    let seen = seen.words();
    let (mut at, mut end) = (0, cut.strips.len());
    cut.strips.resize(end + runs.len(), StripRun::new(0, 0));
    for run in runs {
        let word = |i: usize| u128::from(seen.get(i).copied().unwrap_or(0));
        let two = word(at / 64 + 1) << 64 | word(at / 64);
        let seen = (two >> (at % 64)) as u32 & run.seen;
        at += run.count as usize;
        if let Some(place) = cut.strips.get_mut(end) {
            *place = StripRun { seen, ..*run };
        }
        end += usize::from(seen != 0);
    }
    cut.strips.truncate(end);
}
