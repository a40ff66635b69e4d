//! A batch of sibling groups, tested in stages.
//!
//! What becomes of a node cannot be foreseen on a real surface, and the nodes of a large model are not in the
//! nearest caches. So no stage branches on a verdict: the siblings of a batch are lanes of vectors as wide as the processor
//! has them, every test answers with a bit a lane, and only what follows from all answers is done one by one. The groups
//! after the batch are prefetched meanwhile, since the processor has only so many requests on
//! their way.

mod ahead;
mod lanes;
mod occlusion;

pub(super) use lanes::{LANES, LaneMask};

use crate::cut::frustum_and_size::{NodeTester, inherit};
use crate::cut::occlusion::{DepthMarks, OcclusionTest, SplatChunk};
use crate::cut::siblings;
use crate::cut::{Cut, StripRun};
use crate::simd::WideLanes;
use crate::tree::{Leaf, Model, Node};
use ahead::PrefetchAhead;
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};
use lanes::SiblingLanes;
use prefetch_index::prefetch_index;

/// Siblings that are to be looked at: the first one, how many they are (1 to 4) and what they inherit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct SiblingGroup {
    first: u32,
    /// The count; above its 8 bits what is inherited.
    word: u32,
}

const INHERITED: u32 = 8;
const INSIDE: u32 = (inherit::INSIDE as u32) << INHERITED;
const FRONT: u32 = (inherit::FRONT as u32) << INHERITED;

/// Sibling groups that a batch looks at (at most [`SIZE`]), and those that come next.
#[derive(Clone, Copy)]
pub(super) struct BatchGroups<'a> {
    pub(super) own: &'a [SiblingGroup],
    pub(super) ahead: &'a [SiblingGroup],
}

/// Findings of batches: what is drawn, and marks of what hides.
pub(super) struct BatchFindings<'a> {
    pub(super) cut: &'a mut Cut,
    pub(super) marks: &'a mut DepthMarks,
}

impl SiblingGroup {
    pub(super) fn new(first: u32, count: u32, inherited: u8) -> Self {
        Self {
            first,
            word: count & 0xff | u32::from(inherited) << INHERITED,
        }
    }

    /// The first of the siblings.
    #[inline]
    pub(super) fn first(self) -> u32 {
        self.first
    }

    #[inline(always)]
    fn inherits(self, bit: u32) -> bool {
        self.word & bit != 0
    }

    #[inline(always)]
    pub(super) fn count(self) -> u32 {
        (self.word & 0xff).min(4)
    }
}

/// Groups in a batch.
pub(super) const SIZE: usize = 64;

/// The four records from a group's first on, and how many of them are its own. Where links of a tree are wrong, none.
#[inline(always)]
fn four<T: Copy + bytemuck::Zeroable>(records: &[T], group: SiblingGroup) -> ([T; 4], u32) {
    let rest = records.get(group.first as usize..).unwrap_or_default();
    if let Some(&four) = rest.first_chunk::<4>() {
        return (four, group.count());
    }
    match siblings::four(records, group.first) {
        Some((four, there)) => (four, group.count().min(there)),
        None => ([T::zeroed(); 4], 0),
    }
}

/// Which siblings of a batch are what, a bit a lane.
#[derive(Debug, Clone, Copy, Default)]
struct BatchVerdicts {
    /// Not dropped so far.
    kept: LaneMask,
    /// Not outside of the view volume.
    in_view: LaneMask,
    small: LaneMask,
    /// Wholly inside the view volume, by a test of this batch.
    inside: LaneMask,
    /// Facing the viewer everywhere, by a test of this batch.
    front: LaneMask,
    /// Drawn as a row of splats.
    rows: LaneMask,
    /// Not asked whether they face away, as a node above them faces the viewer everywhere.
    faces: LaneMask,
    /// The same of the view volume.
    within: LaneMask,
}

/// How many siblings were looked at, and how many were dropped for what.
#[derive(Debug, Clone, Copy, Default)]
struct BatchCounts {
    visited: u32,
    outside: u32,
    away: u32,
    behind: u32,
}

impl BatchCounts {
    fn add_to(self, cut: &mut Cut) {
        cut.stats.visited += u64::from(self.visited);
        cut.stats.outside += u64::from(self.outside);
        cut.stats.facing_away += u64::from(self.away);
        cut.stats.behind += u64::from(self.behind);
    }
}

/// The working memory of the stages, 40 KiB.
#[derive(Debug)]
pub(super) struct NodeBatch {
    level: Level,
    siblings: SiblingLanes,
    verdicts: BatchVerdicts,
    /// Of how many splats rows are.
    counts: [u32; LANES],
    /// Leaves whose side is asked for, and the lane of each.
    faces: Vec<(u32, u32)>,
    corners: Vec<[u32; 3]>,
    split: occlusion::OcclusionRows,
    chunk: SplatChunk,
}

impl NodeBatch {
    /// For vectors of a level.
    pub(super) fn new(level: Level) -> Self {
        Self {
            level,
            siblings: SiblingLanes::default(),
            verdicts: BatchVerdicts::default(),
            counts: [0; LANES],
            faces: Vec::with_capacity(LANES),
            corners: Vec::with_capacity(LANES),
            split: occlusion::OcclusionRows::default(),
            chunk: SplatChunk::default(),
        }
    }

    /// Looks at groups of nodes of one level: appends what is drawn of them to the cut and the children of
    /// what is to be opened to `open`.
    pub(super) fn nodes(
        &mut self,
        model: &Model,
        tester: &NodeTester,
        groups: BatchGroups<'_>,
        hiding: Option<&OcclusionTest<'_>>,
        found: BatchFindings<'_>,
        open: &mut Vec<SiblingGroup>,
    ) {
        let nodes: &[Node] = &model.tree.nodes;
        dispatch!(self.level, simd => {
            self.look_at_nodes(simd, (nodes, tester), groups, hiding, found, open);
        });
    }

    #[inline(always)]
    fn look_at_nodes<S: Simd>(
        &mut self,
        simd: S,
        (nodes, tester): (&[Node], &NodeTester),
        groups: BatchGroups<'_>,
        hiding: Option<&OcclusionTest<'_>>,
        found: BatchFindings<'_>,
        open: &mut Vec<SiblingGroup>,
    ) {
        let BatchGroups { own: groups, ahead } = groups;
        let BatchFindings { cut, marks } = found;
        let ahead = &mut PrefetchAhead::new(nodes, ahead);
        let hides = hiding.filter(|hiding| hiding.asks_splats());
        let exact = hiding.filter(|hiding| hiding.is_exact());
        // What hides is half of the work.
        let (loading, testing) = if hides.is_some() { (1, 2) } else { (2, 3) };
        self.load_nodes(nodes, groups, (ahead, loading));
        let counts = self.test_nodes(simd, tester, groups, exact, (ahead, testing));
        counts.add_to(cut);
        match hides {
            Some(hiding) => {
                self.hide_rows(simd, hiding, tester, groups, (marks, cut), ahead);
                self.hide_nodes(simd, hiding, groups, (marks, cut), ahead);
                ahead.ask_rest();
            }
            None => {
                ahead.ask_rest();
                for lane in self.verdicts.rows.lanes() {
                    let run = StripRun::new(self.siblings.number(lane), self.counts[lane % LANES]);
                    cut.strips.push(run);
                }
            }
        }
        self.emit_nodes(simd, cut, open);
    }

    /// Nodes become lanes; so many of those ahead are asked for before each eight groups.
    #[inline(always)]
    fn load_nodes(
        &mut self,
        nodes: &[Node],
        groups: &[SiblingGroup],
        (ahead, each): (&mut PrefetchAhead<'_>, usize),
    ) {
        let siblings = &mut self.siblings;
        self.verdicts = BatchVerdicts::begin(groups, |index, group| {
            if index % 8 == 0 {
                ahead.ask(each);
            }
            let (four, count) = four(nodes, group);
            let (spheres, words) = siblings::of_nodes(&four);
            siblings.put_spheres(index, spheres);
            siblings.put_words(index, words);
            siblings.put_group(index, group);
            count
        });
    }

    /// All tests of the nodes that were loaded; where splats are samples, also whether they contain the center of a pixel: of
    /// a surface whose triangles are far smaller than pixels a level of the tree has four times the nodes of the one above,
    /// and no more of them that contain a center. So large nodes between centers are dropped, with all that is below
    /// them. What contains one center is small: all below it that is drawn would be that pixel. And what lies behind
    /// splats that were found before is dropped with all below it.
    #[inline(always)]
    fn test_nodes<S: Simd>(
        &mut self,
        simd: S,
        tester: &NodeTester,
        groups: &[SiblingGroup],
        exact: Option<&OcclusionTest<'_>>,
        (ahead, each): (&mut PrefetchAhead<'_>, usize),
    ) -> BatchCounts {
        let mut verdicts = self.verdicts;
        let mut counts = BatchCounts {
            visited: verdicts.kept.count(),
            ..BatchCounts::default()
        };
        let width = WideLanes::<S>::LANES;
        for at in (0..4 * groups.len().min(SIZE)).step_by(width) {
            ahead.ask_each(at, each);
            let balls = tester.balls(self.siblings.spheres(simd, at));
            self.siblings.put_balls(at, &balls);
            let mut kept = verdicts.kept.get(at, width);
            let edge = kept & !verdicts.within.get(at, width);
            // Foreseen well: what is at the edge of the view volume lies together.
            if edge != 0 {
                let (outside, wholly) = tester.volume(&balls);
                counts.outside += (outside & edge).count_ones();
                kept &= !(outside & edge);
                verdicts.inside.add(at, wholly & edge);
            }
            let in_view = kept;
            let words = self.siblings.words(simd, at);
            let asked = kept & !verdicts.faces.get(at, width);
            if asked != 0 {
                // On a rough surface most cones above the lowest levels are too wide to decide anything.
                let sines = words.sine();
                if tester.may_cull(sines) & asked != 0 {
                    let (away, front) = tester.cones(&balls, words.axis(), sines);
                    counts.away += (away & asked).count_ones();
                    kept &= !(away & asked);
                    verdicts.front.add(at, front & asked);
                }
            }
            let mut small = tester.small(&balls);
            if let Some(hiding) = exact {
                let asked = kept & !small & hiding.centers.may_matter(&balls);
                if asked != 0 {
                    let (none, one) = hiding.centers.of(&balls);
                    kept &= !(none & asked);
                    small |= one & asked;
                }
                if hiding.drops_nodes() {
                    let behind = hiding.are_behind(&balls, kept & !small);
                    counts.behind += behind.count_ones();
                    kept &= !behind;
                }
            }
            let large = kept & !small;
            if large != 0 {
                let first = groups.get(at / 4).map_or(0, |group| group.first);
                let most = tester.most_in_row(first, &words);
                let likely = large & tester.may_be_rows(&balls, &words, most);
                if likely != 0 {
                    let (splats, fits) = tester.rows(&balls, &words, most);
                    if let Some(counts) = self.counts.get_mut(at..at + width) {
                        splats.store_whole(counts);
                    }
                    verdicts.rows.add(at, likely & fits);
                }
            }
            verdicts.small.add(at, small);
            verdicts.in_view.add(at, in_view);
            verdicts.kept.replace(at, width, kept);
        }
        self.verdicts = verdicts;
        counts
    }

    #[inline(always)]
    fn emit_nodes<S: Simd>(&mut self, simd: S, cut: &mut Cut, open: &mut Vec<SiblingGroup>) {
        let BatchVerdicts {
            kept,
            small,
            inside,
            front,
            rows,
            ..
        } = self.verdicts;
        let siblings = &mut self.siblings;
        siblings.push(simd, &mut cut.nodes, kept & small);
        siblings.push_children(simd, open, kept & !small & !rows, (inside, front));
    }

    /// The same for groups of leaves, all of which are drawn or dropped.
    pub(super) fn leaves(
        &mut self,
        model: &Model,
        tester: &NodeTester,
        groups: BatchGroups<'_>,
        hiding: Option<&OcclusionTest<'_>>,
        found: BatchFindings<'_>,
    ) {
        dispatch!(self.level, simd => {
            self.look_at_leaves(simd, model, tester, groups, hiding, found);
        });
    }

    #[inline(always)]
    fn look_at_leaves<S: Simd>(
        &mut self,
        simd: S,
        model: &Model,
        tester: &NodeTester,
        groups: BatchGroups<'_>,
        hiding: Option<&OcclusionTest<'_>>,
        found: BatchFindings<'_>,
    ) {
        let BatchGroups { own: groups, ahead } = groups;
        let BatchFindings { cut, marks } = found;
        self.load_leaves(&model.tree.leaves, groups, ahead);
        self.test_leaves(simd, tester, groups).add_to(cut);
        // Sides take vertices, so they are asked for last where most leaves are far smaller than a pixel.
        let (before, after) = match hiding {
            Some(hiding) if hiding.is_exact() => (Some(hiding), None),
            _ => (None, hiding),
        };
        if let Some(hiding) = before {
            self.drop_between(simd, hiding, groups.len(), cut);
        }
        self.drop_away(model, tester).add_to(cut);
        self.draw_leaves(simd, model, after, hiding, groups, (cut, marks));
    }

    /// Draws the leaves that are kept, less what is hidden.
    #[inline(always)]
    fn draw_leaves<S: Simd>(
        &mut self,
        simd: S,
        model: &Model,
        between: Option<&OcclusionTest<'_>>,
        hiding: Option<&OcclusionTest<'_>>,
        groups: &[SiblingGroup],
        (cut, marks): (&mut Cut, &mut DepthMarks),
    ) {
        if let Some(hiding) = between {
            self.drop_between(simd, hiding, groups.len(), cut);
        }
        // A point has no triangle: large or small, it is a splat.
        let always = LaneMask::all(model.kind().is_points());
        if let Some(hiding) = hiding {
            self.hide_leaves(simd, hiding, groups, always, (cut, marks));
        }
        let BatchVerdicts { kept, small, .. } = self.verdicts;
        let (splats, triangles) = (kept & (small | always), kept & !(small | always));
        self.siblings.push(simd, &mut cut.leaves, splats);
        self.siblings.push(simd, &mut cut.triangles, triangles);
    }

    /// Leaves become lanes; those of `ahead` are asked for.
    #[inline(always)]
    fn load_leaves(&mut self, leaves: &[Leaf], groups: &[SiblingGroup], ahead: &[SiblingGroup]) {
        let mut ahead = ahead.iter();
        let siblings = &mut self.siblings;
        self.verdicts = BatchVerdicts::begin(groups, |index, group| {
            if let Some(group) = ahead.next() {
                prefetch_index(leaves, group.first as usize);
                prefetch_index(leaves, group.first as usize + 3);
            }
            let (four, count) = four(leaves, group);
            siblings.put_spheres(index, siblings::of_leaves(&four));
            siblings.put_group(index, group);
            count
        });
    }

    /// The tests of the leaves that were loaded that need no more of them.
    #[inline(always)]
    fn test_leaves<S: Simd>(
        &mut self,
        simd: S,
        tester: &NodeTester,
        groups: &[SiblingGroup],
    ) -> BatchCounts {
        let mut verdicts = self.verdicts;
        let mut counts = BatchCounts {
            visited: verdicts.kept.count(),
            ..BatchCounts::default()
        };
        let width = WideLanes::<S>::LANES;
        for at in (0..4 * groups.len().min(SIZE)).step_by(width) {
            let balls = tester.balls(self.siblings.spheres(simd, at));
            self.siblings.put_balls(at, &balls);
            verdicts.small.add(at, tester.small(&balls));
            let kept = verdicts.kept.get(at, width);
            let edge = kept & !verdicts.within.get(at, width);
            if edge != 0 {
                let outside = tester.volume(&balls).0 & edge;
                counts.outside += outside.count_ones();
                verdicts.kept.replace(at, width, kept & !outside);
            }
        }
        self.verdicts = verdicts;
        counts
    }

    /// Drops the leaves that face away.
    #[inline(always)]
    fn drop_away(&mut self, model: &Model, tester: &NodeTester) -> BatchCounts {
        let asked = self.verdicts.kept & !self.verdicts.faces;
        self.faces.clear();
        for lane in asked.lanes() {
            self.faces.push((self.siblings.number(lane), lane as u32));
        }
        let mut away = LaneMask::default();
        if model.kind().is_points() {
            for &(leaf, lane) in &self.faces {
                let is_away = tester.leaf_faces_away(model, leaf);
                away.add(lane as usize, u32::from(is_away));
            }
        } else {
            // All corners are asked for before the first is used. What does not exist is not a number, which
            // single precision cannot tell from edge-on.
            self.corners.clear();
            for &(leaf, _) in &self.faces {
                let corners = match model.triangles.get(leaf as usize) {
                    Some(&triangle) => triangle,
                    None => [u32::MAX; 3],
                };
                self.corners.push(corners);
                for vertex in corners {
                    prefetch_index(model.vertices.as_slice(), vertex as usize);
                }
            }
            let rest = self.corners.len().next_multiple_of(4);
            self.corners.resize(rest, [u32::MAX; 3]);
            let fours = self.faces.chunks(4).zip(self.corners.as_chunks::<4>().0);
            for (leaves, &corners) in fours {
                let corners = NodeTester::corners(&model.vertices, corners);
                let (is_away, unsure) = tester.triangles_face_away(&corners);
                for (&(leaf, lane), bit) in leaves.iter().zip(0..) {
                    let is_away = match unsure >> bit & 1 {
                        0 => is_away >> bit & 1 != 0,
                        _ => tester.leaf_faces_away(model, leaf),
                    };
                    away.add(lane as usize, u32::from(is_away));
                }
            }
        }
        self.verdicts.kept = self.verdicts.kept & !away;
        BatchCounts {
            away: away.count(),
            ..BatchCounts::default()
        }
    }
}

impl BatchVerdicts {
    /// The siblings of groups are there, as many as `load` says of each, and have what they inherit.
    #[inline(always)]
    fn begin(groups: &[SiblingGroup], mut load: impl FnMut(usize, SiblingGroup) -> u32) -> Self {
        let mut verdicts = Self::default();
        let chunks = groups.chunks(GROUPS_OF_WORD).take(SIZE / GROUPS_OF_WORD);
        for (chunk, word) in chunks.zip(0..) {
            let (mut kept, mut within, mut faces) = (0, 0, 0);
            for (&group, index) in chunk.iter().zip(GROUPS_OF_WORD * word..) {
                let count = load(index, group);
                let at = 4 * index % 64;
                let all = |is_set: bool| if is_set { 15 << at } else { 0 };
                kept |= ((1 << count) - 1) << at;
                within |= all(group.inherits(INSIDE));
                faces |= all(group.inherits(FRONT));
            }
            verdicts.kept.words_mut()[word] = kept;
            verdicts.within.words_mut()[word] = within;
            verdicts.faces.words_mut()[word] = faces;
        }
        verdicts
    }
}

/// Whose lanes are a word of a mask.
const GROUPS_OF_WORD: usize = 16;
