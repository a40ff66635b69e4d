//! What nearer splats hide of a batch.

use super::{Batch, Group, List, ROOM, SIZE};
use crate::cut::nearest::{CHUNK, Chunk, Hiding, Marks};
use crate::cut::quad::Balls;
use crate::cut::strip::half_rows;
use crate::cut::tester::Tester;
use crate::cut::{Cut, MAX_STRIP_COUNT, StripRun};
use glam::Vec4;

/// Room for the splats of rows in a chunk, and for a store of four at any place.
const SPLATS: usize = CHUNK + 4;
const _: () = assert!(MAX_STRIP_COUNT as usize <= CHUNK && ROOM <= SPLATS);

/// The rows of a batch and some of their splats, numbers of one kind in a list each.
#[derive(Debug)]
pub(super) struct Rows {
    /// Where a row is in the lists of middles and halves.
    places: List<u32, ROOM>,
    /// Where their middles are along the axes of the picture and the view direction, and how far their ends are from there.
    middles: [[f32; SPLATS]; 3],
    halves: [[f32; SPLATS]; 3],
    splats: [[f32; SPLATS]; 3],
}

impl Default for Rows {
    fn default() -> Self {
        Self {
            places: List::new(0),
            middles: [[0.0; SPLATS]; 3],
            halves: [[0.0; SPLATS]; 3],
            splats: [[0.0; SPLATS]; 3],
        }
    }
}

#[inline]
fn put(lists: &mut [[f32; SPLATS]; 3], at: usize, four: [Vec4; 3]) {
    for (list, v) in lists.iter_mut().zip(four) {
        if let Some(places) = list.get_mut(at..at + 4) {
            places.copy_from_slice(&v.to_array());
        }
    }
}

impl Batch {
    /// Drops small nodes that are hidden.
    pub(super) fn hide_nodes(
        &mut self,
        hiding: &Hiding<'_>,
        groups: &[Group],
        marks: &mut Marks,
        cut: &mut Cut,
    ) {
        self.listed.clear();
        let mut asked = 0;
        let is_exact = hiding.is_exact();
        let radius_of = |balls: &Balls| if is_exact { balls.radius } else { Vec4::ZERO };
        let masks = self.kept.iter().zip(&self.small);
        let lanes = masks.map(|(&kept, &small)| kept & small);
        for (((group, balls), lanes), index) in groups.iter().zip(&self.balls).zip(lanes).zip(0..) {
            if lanes == 0 {
                continue;
            }
            let [x, y] = hiding.centers.along(balls.center);
            let splats = [x, y, balls.depth, radius_of(balls)];
            let lanes_of = (lanes, hiding.undrawn_nodes(group.first));
            hiding.place(&mut self.chunk, 4 * self.listed.len, splats, lanes_of);
            self.listed.push_if(true, index);
            asked += lanes.count_ones();
        }
        let listed = self.listed.as_slice();
        if listed.is_empty() {
            return;
        }
        let seen = hiding.ask(&self.chunk, 4 * listed.len(), &mut marks.nodes);
        cut.stats.hidden += u64::from(asked.saturating_sub(count(&seen)));
        for (&index, place) in listed.iter().zip(0..) {
            let i = index as usize % SIZE;
            self.kept[i] &= four(&seen, place) | !self.small[i];
        }
    }

    /// Drops triangles between the centers of pixels, and small ones where splats are samples.
    pub(super) fn drop_between(&mut self, hiding: &Hiding<'_>, count: usize, cut: &mut Cut) {
        let (have_sizes, asks_large) = hiding.of_leaves();
        if have_sizes || asks_large {
            return;
        }
        let splats = if hiding.is_exact() { 15 } else { 0 };
        let lanes = self.balls.iter().zip(&self.small);
        for ((balls, &small), kept) in lanes.zip(&mut self.kept).take(count) {
            let asked = *kept & (!small | splats);
            if asked != 0 {
                let misses = asked & !hiding.centers.any(balls);
                cut.stats.between += u64::from((misses & !small).count_ones());
                cut.stats.hidden += u64::from((misses & small).count_ones());
                *kept &= !misses;
            }
        }
    }

    /// Drops large nodes between the centers of pixels, with all that is below them, where that would be samples: of a surface
    /// whose triangles are far smaller than pixels a level of the tree has four times the nodes of the one above, and no more
    /// of them that contain a center. What contains one center is small: all below it that is drawn would be that pixel.
    pub(super) fn ask_centers(
        &mut self,
        hiding: &Hiding<'_>,
        count: usize,
        mut prefetch: impl FnMut(),
    ) {
        self.listed.clear();
        let lanes = self.balls.iter().zip(&self.small).zip(&self.kept);
        for (((balls, &small), &kept), index) in lanes.zip(0..).take(count) {
            let asked = kept & !small & hiding.centers.may_matter(balls);
            self.listed.push_if(asked != 0, index);
        }
        for &index in self.listed.as_slice() {
            let i = index as usize % SIZE;
            prefetch();
            let (some, one) = hiding.centers.of(&self.balls[i]);
            self.kept[i] &= some | self.small[i];
            self.small[i] |= one & some;
        }
    }

    /// Drops leaves that are hidden; those in `always` are splats in any case.
    pub(super) fn hide_leaves(
        &mut self,
        hiding: &Hiding<'_>,
        groups: &[Group],
        always: u8,
        marks: &mut Marks,
        cut: &mut Cut,
    ) {
        if !hiding.asks_splats() {
            return;
        }
        let (have_sizes, asks_large) = hiding.of_leaves();
        let is_exact = hiding.is_exact();
        // A small triangle has the constant size, a point of a cloud and a large triangle their own.
        let kinds = [
            (0, have_sizes, true, &mut marks.leaves),
            (15, true, asks_large, &mut marks.triangles),
        ];
        for (flip, has_size, is_asked, marks) in kinds {
            if !is_asked {
                continue;
            }
            self.listed.clear();
            let mut asked = 0;
            let masks = self.kept.iter().zip(&self.small);
            let lanes = masks.map(|(&kept, &small)| kept & ((small | always) ^ flip));
            for (((group, balls), lanes), index) in
                groups.iter().zip(&self.balls).zip(lanes).zip(0..)
            {
                if lanes == 0 {
                    continue;
                }
                let [x, y] = hiding.centers.along(balls.center);
                let radius = if has_size || is_exact {
                    balls.radius
                } else {
                    Vec4::ZERO
                };
                let splats = [x, y, balls.depth, radius];
                let lanes_of = (lanes, hiding.undrawn_leaves(group.first));
                hiding.place(&mut self.chunk, 4 * self.listed.len, splats, lanes_of);
                self.listed.push_if(true, index);
                asked += lanes.count_ones();
            }
            let listed = self.listed.as_slice();
            if listed.is_empty() {
                continue;
            }
            let seen = hiding.ask(&self.chunk, 4 * listed.len(), marks);
            cut.stats.hidden += u64::from(asked.saturating_sub(count(&seen)));
            for (&index, place) in listed.iter().zip(0..) {
                let i = index as usize % SIZE;
                self.kept[i] &= four(&seen, place) | !((self.small[i] | always) ^ flip);
            }
        }
    }

    /// Appends the rows of the batch to the cut, less what is hidden of them.
    pub(super) fn hide_rows(
        &mut self,
        hiding: &Hiding<'_>,
        tester: &Tester,
        marks: &mut Marks,
        cut: &mut Cut,
    ) {
        let Rows {
            places,
            middles,
            halves,
            splats,
        } = &mut self.split;
        places.clear();
        // Needles may be far thinner than a pixel: where splats are samples, their squares are asked, lest they vanish.
        let radius = Vec4::splat(match hiding.is_exact() {
            true => f32::INFINITY,
            false => 0.0,
        });
        for (&index, at) in self.likely.as_slice().iter().zip((0..).step_by(4)) {
            let i = index as usize % SIZE;
            let balls = &self.balls[i];
            let half = half_rows(balls, &self.words[i]);
            let ([x, y], [way_x, way_y]) = (
                hiding.centers.along(balls.center),
                hiding.centers.way_along(half),
            );
            put(middles, at as usize, [x, y, balls.depth]);
            put(
                halves,
                at as usize,
                [way_x, way_y, tester.way_forward(half)],
            );
            places.push_lanes(at, self.rows[i]);
        }
        // Where any node has no area, rows cover nothing: that is rare.
        let undrawn = if hiding.has_undrawn_nodes() { 15 } else { 0 };
        let (mut runs, mut places) = (self.runs.as_slice(), places.as_slice());
        while !runs.is_empty() {
            let (mut many, mut count) = (0, 0);
            for (run, &place) in runs.iter().zip(places) {
                if count + MAX_STRIP_COUNT as usize > CHUNK {
                    break;
                }
                let at = place as usize % ROOM;
                let middle = middles.each_ref().map(|list| list[at]);
                let half = halves.each_ref().map(|list| list[at]);
                let step = 2.0 / run.count as f32;
                let mut along = Vec4::new(0.5, 1.5, 2.5, 3.5) * step - 1.0;
                for at in (0..run.count).step_by(4) {
                    let four = [0, 1, 2].map(|i| middle[i] + half[i] * along);
                    put(splats, count + at as usize, four);
                    along += 4.0 * step;
                }
                count += run.count as usize;
                many += 1;
            }
            let lists = splats.each_ref().map(|list| list.as_chunks::<4>().0);
            let [x, y, z] = lists.map(|fours| fours.iter().map(|&four| Vec4::from_array(four)));
            for (((x, y), z), at) in x.zip(y).zip(z).zip((0..count).step_by(4)) {
                let lanes = 15 >> (4 - (count - at).min(4));
                let splats = [x, y, z, radius];
                hiding.place(&mut self.chunk, at, splats, (lanes, undrawn));
            }
            let (own, rest) = runs.split_at(many);
            keep_runs(hiding, &self.chunk, own, count, marks, cut);
            (runs, places) = (rest, places.get(many..).unwrap_or_default());
        }
        self.runs.clear();
    }
}

/// Appends what is seen of rows whose splats are in the chunk.
#[inline]
fn keep_runs(
    hiding: &Hiding<'_>,
    chunk: &Chunk,
    runs: &[StripRun],
    splats: usize,
    marks: &mut Marks,
    cut: &mut Cut,
) {
    let seen = hiding.ask(chunk, splats, &mut marks.strips);
    cut.stats.hidden += (splats as u64).saturating_sub(u64::from(count(&seen)));
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

/// How many bits are set.
#[inline]
fn count(words: &[u64]) -> u32 {
    words.iter().map(|word| word.count_ones()).sum()
}

/// Bits `4 * place` and on.
#[inline]
fn four(words: &[u64], place: usize) -> u8 {
    let word = words.get(place / 16).copied().unwrap_or(0);
    (word >> (place % 16 * 4)) as u8 & 15
}
