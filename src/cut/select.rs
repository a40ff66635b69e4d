//! The cut from the root: level by level.
//!
//! Source: Benda, *Point Based Rendering*, sections 3.3 and 3.3.1: an invisible node is dropped, a small node
//! is a splat (a small leaf too: the text's order, not the pseudocode's), a large leaf is its triangle, and
//! of a large node the children are looked at. Deviations: not depth-first but level by level, in batches
//! ([`crate::cut::batch`]), so that memory is read in ascending order and many requests for it are on their way at
//! once; tests that passed for all of a node are not repeated below it; needles may be drawn as rows of splats
//! ([`crate::cut::strip`]).
//!
//! All leaves are at the same depth and siblings stand together, level after level, so every list comes out
//! in ascending order.

use crate::cut::batch;
use crate::cut::batch::{BatchFindings, BatchGroups, NodeBatch, SiblingGroup};
use crate::cut::coherent::{CoherentFront, children_of};
use crate::cut::frustum_and_size::NodeTester;
use crate::cut::occlusion::footprints::{SplatFootprints, ZeroAreaSet};
use crate::cut::occlusion::{DepthMarks, OcclusionTest, SUBPIXEL_BITS, SoftwareDepthBuffer};
use crate::cut::{Cut, CutSettings};
use crate::math::camera::View;
use crate::threads::{self, share};
use crate::tree::Model;
use fearless_simd::Level;
use std::ops::Range;

/// A large cut is divided where a level has at least this many sibling groups to look at (some 30 microseconds, as long as
/// another thread takes to wake up): far more are below them.
const LARGE: usize = 1536;

/// Parts for each thread: how much of a part is visible is not known before.
const PARTS: usize = 8;

/// Where nodes are looked for that lie behind others, at least this many parts, the nearest ones first: the smaller a part, the
/// more is drawn before it.
const PARTS_IN_ORDER: usize = 64;

/// Sibling groups of one level, and the next one's.
#[derive(Debug, Default)]
struct NodeFront {
    groups: Vec<SiblingGroup>,
    open: Vec<SiblingGroup>,
}

/// What decides about nodes.
#[derive(Debug, Clone, Copy)]
pub(super) struct NodeTests<'a> {
    pub(super) tester: &'a NodeTester,
    pub(super) hiding: Option<&'a OcclusionTest<'a>>,
    /// Others are cut before it is known what is hidden: marks are kept for then, and one thread cuts it.
    pub(super) is_part: bool,
}

impl NodeFront {
    /// Looks at a level of nodes; the groups become those of the next level.
    fn descend(
        &mut self,
        model: &Model,
        NodeTests { tester, hiding, .. }: NodeTests<'_>,
        batch: &mut NodeBatch,
        (cut, marks): (&mut Cut, &mut DepthMarks),
    ) {
        self.open.clear();
        for groups in batches(&self.groups) {
            let found = BatchFindings { cut, marks };
            batch.nodes(model, tester, groups, hiding, found, &mut self.open);
        }
        std::mem::swap(&mut self.groups, &mut self.open);
    }

    /// Adds groups of the same level at which the traversal starts.
    fn join(&mut self, starts: &[SiblingGroup]) {
        if !starts.is_empty() {
            self.groups.extend_from_slice(starts);
            self.groups.sort_by_key(|group| group.first());
        }
    }

    fn finish(
        &self,
        model: &Model,
        NodeTests { tester, hiding, .. }: NodeTests<'_>,
        batch: &mut NodeBatch,
        (cut, marks): (&mut Cut, &mut DepthMarks),
    ) {
        for groups in batches(&self.groups) {
            batch.leaves(model, tester, groups, hiding, BatchFindings { cut, marks });
        }
    }
}

/// Batches, each with what comes after it.
fn batches(groups: &[SiblingGroup]) -> impl Iterator<Item = BatchGroups<'_>> {
    let ahead = (batch::SIZE..).step_by(batch::SIZE);
    let ahead = ahead.map(|at| groups.get(at..).unwrap_or_default());
    let own = groups.chunks(batch::SIZE).zip(ahead);
    own.map(|(own, ahead)| BatchGroups { own, ahead })
}

/// What was found below some consecutive groups of a level: a cut of its own, and where each level ends in its lists.
#[derive(Debug, Default)]
struct FoundNodes {
    cut: Cut,
    marks: DepthMarks,
    ends: Vec<(usize, usize)>,
}

impl FoundNodes {
    fn clear(&mut self) {
        self.cut.clear();
        self.marks.clear();
        self.ends.clear();
    }

    /// Ends a level of nodes.
    fn end_level(&mut self) {
        self.ends
            .push((self.cut.nodes.len(), self.cut.strips.len()));
    }

    /// Where the nodes and strips of a level are in the lists.
    fn level(&self, level: usize) -> [std::ops::Range<usize>; 2] {
        let end = |level: usize| self.ends.get(level).copied().unwrap_or_default();
        let (from, to) = (
            level.checked_sub(1).map(end).unwrap_or_default(),
            end(level),
        );
        [from.0..to.0, from.1..to.1]
    }
}

/// Joins what was found in parts to what was found above them, level by level, less what is hidden: `levels` of nodes.
fn join(
    parts: &mut [ChildrenBelow],
    batches: &mut [NodeBatch],
    hiding: Option<&OcclusionTest<'_>>,
    levels: usize,
    (cut, marks): (&mut Cut, &DepthMarks),
) {
    if let Some(hiding) = hiding {
        hiding.repair(marks);
        share(batches, parts.iter_mut(), |_, part| {
            hiding.repair(&part.found.marks);
        });
        hiding.finish(cut, marks, &mut []);
        share(batches, parts.iter_mut(), |_, part| {
            let FoundNodes { cut, marks, ends } = &mut part.found;
            hiding.finish(cut, marks, ends);
        });
    }
    for level in 0..levels {
        for found in parts.iter().map(|part| &part.found) {
            let [nodes, strips] = found.level(level);
            let (nodes, strips) = (found.cut.nodes.get(nodes), found.cut.strips.get(strips));
            cut.nodes.extend_from_slice(nodes.unwrap_or_default());
            cut.strips.extend_from_slice(strips.unwrap_or_default());
        }
    }
    for found in parts.iter().map(|part| &part.found) {
        cut.leaves.extend_from_slice(&found.cut.leaves);
        cut.triangles.extend_from_slice(&found.cut.triangles);
        cut.stats.add(&found.cut.stats);
    }
}

/// What is below some consecutive groups of a level.
#[derive(Debug, Default)]
struct ChildrenBelow {
    front: NodeFront,
    found: FoundNodes,
}

impl ChildrenBelow {
    /// Goes down through `levels` of nodes from its groups, which are among the nodes `ids`, and from the groups in `starts` below
    /// these nodes, a list for each level from the second one on.
    fn run(
        &mut self,
        model: &Model,
        tests: NodeTests<'_>,
        batch: &mut NodeBatch,
        levels: Range<usize>,
        (mut ids, starts): (Range<u32>, &[Vec<SiblingGroup>]),
    ) {
        self.found.clear();
        let mut starts = starts.iter();
        for level in levels {
            let found = (&mut self.found.cut, &mut self.found.marks);
            self.front.descend(model, tests, batch, found);
            self.found.end_level();
            if let Some(starts) = starts.next() {
                ids = children_of(model, level, &ids);
                let at = |id: u32| starts.partition_point(|group| group.first() < id);
                let own = starts.get(at(ids.start)..at(ids.end));
                self.front.join(own.unwrap_or_default());
            }
        }
        let found = (&mut self.found.cut, &mut self.found.marks);
        self.front.finish(model, tests, batch, found);
    }
}

/// Selects cuts from the root and keeps its working memory from one to the next.
///
/// A large cut (some ten thousand nodes) is divided among threads. Every list has the same ids in the same
/// order whatever their number.
///
/// Memory: about 8 bytes for each node that is opened on a level and 40 KiB a thread; with several threads the
/// lists of the cut once more.
#[derive(Debug)]
pub struct CutSelector {
    threads: usize,
    /// Of the processor's vectors.
    level: Level,
    /// Groups from which on a cut is divided.
    large: usize,
    front: NodeFront,
    batches: Vec<NodeBatch>,
    parts: Vec<ChildrenBelow>,
    pub(super) marks: DepthMarks,
    nearest: SoftwareDepthBuffer,
    pub(super) subpixel_bits: u32,
    /// The front of the last cut, where cuts start at it.
    coherent: Option<CoherentFront>,
    /// Groups at which a cut starts, a list for each level.
    starts: Vec<Vec<SiblingGroup>>,
}

impl Default for CutSelector {
    /// As many threads as the machine runs at once, at most 16.
    fn default() -> Self {
        Self::with_threads(threads::count())
    }
}

impl CutSelector {
    /// Uses up to `threads` threads, the calling one included; 0 counts as 1.
    pub fn with_threads(threads: usize) -> Self {
        Self {
            threads: threads.max(1),
            level: Level::new(),
            large: LARGE,
            front: NodeFront::default(),
            batches: Vec::new(),
            parts: Vec::new(),
            marks: DepthMarks::default(),
            nearest: SoftwareDepthBuffer::default(),
            subpixel_bits: *SUBPIXEL_BITS.start(),
            coherent: None,
            starts: Vec::new(),
        }
    }

    /// Binary places that window positions have on the device that draws: the more, the surer it is which pixels a splat
    /// covers, and the more is found to be hidden. 4 at first, which every device has; more than 8 count as 8, to which
    /// splats are rounded where compute draws them.
    #[must_use]
    pub fn with_subpixel_bits(mut self, bits: u32) -> Self {
        self.subpixel_bits = bits.clamp(*SUBPIXEL_BITS.start(), *SUBPIXEL_BITS.end());
        self
    }

    /// Starts cuts at the front of the last one where that is known to give the same lists (`src/cut/coherent.rs`), or at the root, as
    /// at first. [`CutStats`](crate::cut::CutStats) may differ.
    pub fn set_coherent(&mut self, is_coherent: bool) {
        if is_coherent != self.coherent.is_some() {
            self.coherent = is_coherent.then(CoherentFront::default);
        }
    }

    /// Forgets the front of the last cut. Needed where cuts start at it and the model changes, or another one takes its place in
    /// memory; one that lies elsewhere is noticed.
    pub fn forget(&mut self) {
        if let Some(front) = &mut self.coherent {
            front.forget();
        }
    }

    /// As [`select`], without allocating once `cut` and `self` have grown (but for dividing work).
    pub fn select(&mut self, model: &Model, view: &View, settings: &CutSettings, cut: &mut Cut) {
        let tester = &NodeTester::new(model, view, settings);
        let tests = NodeTests {
            tester,
            hiding: None,
            is_part: false,
        };
        self.run(model, tests, cut);
    }

    /// As [`select`](Self::select), less what covers no pixel: triangles between the centers of pixels; of splats of a pixel
    /// at most, those whose ball contains no center, with all that is below such nodes; and, where [`SplatFootprints::hides`] says so,
    /// splats of which each pixel is covered by a nearer one of the same cut. Of triangles and of splats of more than a
    /// pixel, what is dropped would show in no pixel, however the device rounds. With splats of exactly a pixel a larger node
    /// whose ball surely contains one center alone is one splat as well: its radius is less than a pixel. Which splats
    /// are left does not depend on threads; with splats of a pixel, which hidden triangles are and [`CutStats`](crate::cut::CutStats) may.
    ///
    /// For opaque squares and discs and one sample a pixel, with the threshold as their size, where the size metric is
    /// [`Exact`](crate::cut::SizeMetric::Exact); `undrawn` is that of the model. In a picture of 65,536 pixels or more to a side nothing is dropped.
    ///
    /// Cost: some nanoseconds a splat; where splats hide others 4 bytes of memory a pixel, which are cleared.
    pub fn select_seen(
        &mut self,
        model: &Model,
        view: &View,
        settings: &CutSettings,
        (footprints, undrawn): (SplatFootprints, &ZeroAreaSet),
        cut: &mut Cut,
    ) {
        let tester = &NodeTester::new(model, view, settings);
        let mut nearest = std::mem::take(&mut self.nearest);
        let is_ready = match footprints.hides {
            true => nearest.clear(view.width, view.height),
            false => nearest.clear_unasked(view.width, view.height),
        };
        if !is_ready {
            return self.select(model, view, settings, cut);
        }
        let hiding = &OcclusionTest::new(
            &nearest,
            tester,
            view,
            (footprints, undrawn),
            self.subpixel_bits,
        );
        let tests = NodeTests {
            tester,
            hiding: Some(hiding),
            is_part: false,
        };
        self.run(model, tests, cut);
        self.nearest = nearest;
    }

    pub(super) fn run(&mut self, model: &Model, tests: NodeTests<'_>, cut: &mut Cut) {
        let tree = &model.tree;
        cut.clear();
        self.marks.clear();
        let level = self.level;
        self.batches
            .resize_with(self.threads, || NodeBatch::new(level));
        let mut starts = std::mem::take(&mut self.starts);
        let front = self.coherent.as_mut();
        match front.and_then(|front| front.advance(model, tests, &mut starts)) {
            Some(tested) => cut.stats.visited += tested,
            None => {
                // A tree over one leaf has no interior node, and one over nothing no leaf: then nothing is found.
                starts.resize_with(1, Vec::new);
                starts.iter_mut().for_each(Vec::clear);
                let root = SiblingGroup::new(0, 1, tests.tester.start());
                starts.iter_mut().for_each(|starts| starts.push(root));
            }
        }
        let levels = if tree.nodes.is_empty() {
            0
        } else {
            tree.level_count()
        };
        self.descend(model, tests, (&starts, levels), cut);
        self.starts = starts;
    }

    /// Goes down from the groups in `starts`, through `levels` of nodes, to the leaves.
    fn descend(
        &mut self,
        model: &Model,
        tests: NodeTests<'_>,
        (starts, levels): (&[Vec<SiblingGroup>], usize),
        cut: &mut Cut,
    ) {
        let Some(batch) = self.batches.first_mut() else {
            return;
        };
        let starts_of = |level: usize| starts.get(level).map_or(&[][..], Vec::as_slice);
        self.front.groups.clear();
        self.front.join(starts_of(0));
        let mut level = 0;
        let is_ordered = tests.hiding.is_some_and(OcclusionTest::drops_nodes);
        let is_divided = (self.threads > 1 || is_ordered) && !tests.is_part;
        while level < levels && !(is_divided && self.front.groups.len() >= self.large) {
            let found = (&mut *cut, &mut self.marks);
            self.front.descend(model, tests, batch, found);
            level += 1;
            self.front.join(starts_of(level));
        }
        if is_divided && self.front.groups.len() >= self.large {
            let starts = starts.get(level + 1..).unwrap_or_default();
            self.divide(model, tests, (starts, level..levels), cut);
            return;
        }
        let found = (&mut *cut, &mut self.marks);
        self.front.finish(model, tests, batch, found);
        if let Some(hiding) = tests.hiding.filter(|_| !tests.is_part) {
            hiding.finish(cut, &self.marks, &mut []);
        }
    }

    /// Goes down the remaining levels in parts, and joins them level by level. `starts` are those of the levels after the
    /// first of them.
    fn divide(
        &mut self,
        model: &Model,
        tests: NodeTests<'_>,
        (starts, levels): (&[Vec<SiblingGroup>], Range<usize>),
        cut: &mut Cut,
    ) {
        let groups = &self.front.groups;
        let is_ordered = tests.hiding.is_some_and(OcclusionTest::drops_nodes);
        let least = if is_ordered { PARTS_IN_ORDER } else { 0 };
        let each = groups.len().div_ceil((PARTS * self.threads).max(least));
        let count = groups.len().div_ceil(each);
        if self.parts.len() < count {
            self.parts.resize_with(count, ChildrenBelow::default);
        }
        let Some(parts) = self.parts.get_mut(..count) else {
            return;
        };
        // A part has all nodes of the level up to the first one of the next part.
        let bound = |level: usize| model.tree.level_starts.get(level).copied();
        let end = bound(levels.start + 1).unwrap_or(u32::MAX);
        let chunks = groups.chunks(each);
        let next = groups.iter().step_by(each).skip(1).map(|g| g.first());
        let mut first = bound(levels.start).unwrap_or_default();
        let ranges = next
            .chain([end])
            .map(|next| std::mem::replace(&mut first, next)..next);
        let mut work: Vec<_> = parts.iter_mut().zip(chunks.zip(ranges)).collect();
        if is_ordered && !levels.is_empty() {
            work.sort_by_cached_key(|(_, (groups, _))| nearest(model, tests.tester, groups));
        }
        share(
            &mut self.batches,
            work.into_iter(),
            |batch, (part, (groups, ids))| {
                part.front.groups.clear();
                part.front.groups.extend_from_slice(groups);
                part.run(model, tests, batch, levels.clone(), (ids, starts));
            },
        );
        let found = (cut, &self.marks);
        join(parts, &mut self.batches, tests.hiding, levels.len(), found);
    }
}

/// How near some groups of nodes are, as bits, which order like distances: by every fourth, as they lie together.
fn nearest(model: &Model, tester: &NodeTester, groups: &[SiblingGroup]) -> u32 {
    let firsts = groups.iter().step_by(4).map(|group| group.first());
    let nodes = firsts.filter_map(|first| model.tree.nodes.get(first as usize));
    let distances = nodes.map(|node| tester.ball(node.center, node.radius).depth.x);
    distances.fold(f32::INFINITY, f32::min).max(0.0).to_bits()
}

/// Replaces `cut` by what `view` needs of `model`: every list in ascending order.
///
/// Every leaf is drawn exactly once, by itself or by one node above it, unless it or a node above it was
/// dropped; what is dropped is never visible (with `cull_back`: on a closed surface). A small leaf is a splat, a large leaf a
/// triangle; a point of a cloud is always a splat. A triangle without area counts as any other (drawn, it
/// covers nothing) but faces away when `cull_back` is on. An empty model gives an empty cut.
///
/// Cost: proportional to the nodes visited, that is to what is drawn, not to the size of the model.
pub fn select(model: &Model, view: &View, settings: &CutSettings, cut: &mut Cut) {
    CutSelector::default().select(model, view, settings, cut);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{self, GeneratedShape, ShapeSpec};
    use crate::pack::for_tests::levels;
    use crate::progress::SilentProgress;
    use crate::tree::{self, BuildOptions};

    /// However many threads there are, and wherever a cut is divided: the same lists.
    #[test]
    fn the_cut_does_not_depend_on_threads() {
        let mut lists = [0; 4];
        for shape in [GeneratedShape::Torus, GeneratedShape::Statue] {
            let spec = ShapeSpec::with_triangles(shape, 30_000).expect("a valid size");
            let mesh = generate::mesh(&spec);
            let model =
                tree::build(mesh, &BuildOptions::default(), &SilentProgress).expect("a tree");
            for (k, fill) in [(0, 0.1), (1, 0.5), (2, 2.0)] {
                let camera = model.orbit_step((300, 300), fill, k, 3);
                let view = camera.view(model.origin).expect("a usable camera");
                for threshold_px in [0.0, 3.0, 12.0] {
                    let settings = CutSettings {
                        threshold_px,
                        cull_back: model.is_closed,
                        ..CutSettings::default()
                    };
                    let (mut expected, mut cut) = (Cut::default(), Cut::default());
                    CutSelector::with_threads(1).select(&model, &view, &settings, &mut expected);
                    for (list, len) in lists.iter_mut().zip([
                        expected.nodes.len(),
                        expected.strips.len(),
                        expected.leaves.len(),
                        expected.triangles.len(),
                    ]) {
                        *list += len;
                    }
                    for (threads, large) in [(2, 1), (3, 20), (5, 300), (2, 3000)] {
                        let mut selector = CutSelector::with_threads(threads);
                        selector.large = large;
                        for _ in 0..2 {
                            selector.select(&model, &view, &settings, &mut cut);
                            assert_eq!(cut, expected, "{shape:?}, {threads} threads, {large}");
                        }
                    }
                }
            }
        }
        assert!(lists.iter().all(|&len| len > 100), "{lists:?}");
    }

    /// Vectors of any width choose the same, with what is hidden and without, of triangles, points and nodes without area.
    #[test]
    fn the_cut_does_not_depend_on_the_width_of_vectors() {
        let models = [
            (GeneratedShape::Torus, false),
            (GeneratedShape::Statue, false),
            (GeneratedShape::Statue, true),
        ];
        let models = models.map(|(shape, is_cloud)| {
            let spec = ShapeSpec::with_triangles(shape, 30_000).expect("a valid size");
            let mut mesh = generate::mesh(&spec);
            if is_cloud {
                mesh.triangles.clear();
            } else {
                // Every eighth triangle of the first part, so that whole nodes have no area.
                let many = mesh.triangles.len() / 8;
                for triangle in &mut mesh.triangles[..many] {
                    triangle[2] = triangle[1];
                }
            }
            tree::build(mesh, &BuildOptions::default(), &SilentProgress).expect("a tree")
        });
        let mut counts = [0; 6];
        for model in &models {
            let undrawn = ZeroAreaSet::new(model);
            let is_cloud = model.kind().is_points();
            for (fill, threshold_px) in [(0.3, 1.0), (1.0, 0.5), (1.0, 1.0), (2.0, 2.0), (1.0, 6.0)]
            {
                let camera = model.orbit_step((300, 200), fill, 1, 3);
                let view = camera.view(model.origin).expect("a usable camera");
                let settings = CutSettings {
                    threshold_px,
                    cull_back: model.is_closed,
                    ..CutSettings::default()
                };
                let footprints = SplatFootprints {
                    side_px: threshold_px,
                    hides: true,
                    are_discs: false,
                    large_leaves: false,
                    is_cloud,
                };
                let chosen = |level: Level, hides: bool| {
                    let mut selector = CutSelector::with_threads(1).with_subpixel_bits(8);
                    selector.level = level;
                    let mut cut = Cut::default();
                    if hides {
                        let seen = (footprints, &undrawn);
                        selector.select_seen(model, &view, &settings, seen, &mut cut);
                    } else {
                        selector.select(model, &view, &settings, &mut cut);
                    }
                    cut
                };
                for hides in [true, false] {
                    let expected = chosen(Level::baseline(), hides);
                    for (count, more) in counts.iter_mut().zip([
                        expected.nodes.len() as u64,
                        expected.strips.len() as u64,
                        expected.leaves.len() as u64,
                        expected.triangles.len() as u64,
                        expected.stats.hidden,
                        expected.stats.outside,
                    ]) {
                        *count += more;
                    }
                    for level in levels() {
                        assert_eq!(chosen(level, hides), expected, "{level:?}, {threshold_px}");
                    }
                }
            }
        }
        assert!(counts.iter().all(|&count| count > 1000), "{counts:?}");
    }
}
