//! The cut of a camera that moves: only what its motion can have changed is tested again.
//!
//! Source: Benda, *Point Based Rendering*, section 3.3.2, keeps the cut of the last frame and goes up and down from there. To test
//! every node of it again saves nothing: one that did so was 1.1 to 1.6 times slower than a cut from the root, which reads
//! memory in order. Deviations: what is kept is not the cut but the answers about each group of siblings that was looked at
//! ([`crate::cut::batch::Record`]), with how far the camera may move until one of them can be another ([`crate::cut::slack`],
//! [`crate::cut::motion`]). The next frame goes down from the root, level by level; the groups of a level and the records of the
//! last frame are both in ascending order, so they are merged. A record that holds stands for the tests: neither the
//! tree's nodes are read nor anything computed of them.
//!
//! So every answer is one of this frame's tests, or what such a test would say: the lists are those from the root,
//! whatever the camera does. It needs no monotone size and no nested spheres.

use crate::cut::batch;
use crate::cut::batch::{Batch, Group, Record, Task};
use crate::cut::frustum_and_size::Tester;
use crate::cut::motion::{Motion, Reading, Regions};
use crate::cut::occlusion::Hiding;
use crate::cut::occlusion::footprints::{Footprints, Undrawn};
use crate::cut::select::{Found, PARTS, Part, Selector, Tests, batches, join};
use crate::cut::{Cut, Settings, SizeMetric};
use crate::math::camera::View;
use crate::threads::share;
use crate::tree::{Leaf, Model, Node};
use glam::Vec3;
use prefetch_index::prefetch_index;

/// What one update did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Update {
    /// Nodes and leaves that were tested.
    pub tests: u64,
    /// Nodes and leaves that were not, because the camera has hardly moved since they were.
    pub kept: u64,
}

/// Follows a moving camera. Its cuts are those of a [`Selector`], statistics included.
///
/// For small steps, such as a tenth of a degree of an orbit: an answer that is kept costs two thirds of a test, one that is found
/// for later frames three times as much (`docs/PERFORMANCE.md`). Where what is hidden is left out
/// ([`select_seen`](Self::select_seen)), the search for it needs the tree's nodes in any case, and nothing is won.
///
/// Nothing is kept of orthographic views, for the size metric [`Area`](SizeMetric::Area), for trees of less than three levels, and
/// where thresholds below a pixel leave out what is between the centers of pixels, which changes with every
/// motion. Such cuts are chosen from the root.
///
/// Memory: that of a selector; and 28 bytes for each group of siblings that the last cut looked at, twice.
#[derive(Debug, Default)]
pub struct Coherent {
    selector: Selector,
    /// The last frame, where its answers were kept.
    last: Option<Last>,
    /// Whether those of the present frame are.
    keeps: bool,
    motion: Motion,
    readings: Vec<Reading>,
    parts: Vec<KeptPart>,
    update: Update,
}

#[derive(Debug)]
struct Last {
    tester: Tester,
    place: Place,
}

/// Where a model lies in memory: another one is noticed, but for one that took the place of this one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place([(usize, usize); 3]);

impl Place {
    fn of(model: &Model) -> Self {
        let (nodes, leaves) = (model.tree.nodes.as_ptr(), model.tree.leaves.as_ptr());
        Self([
            (nodes.addr(), model.tree.nodes.len()),
            (leaves.addr(), model.tree.leaves.len()),
            (model.vertices.as_ptr().addr(), model.vertices.len()),
        ])
    }
}

/// Some regions: what is below them in this frame, and the records of the last one.
#[derive(Debug, Default)]
struct KeptPart {
    groups: Vec<Group>,
    open: Vec<Group>,
    /// Of each level, that of the leaves last: of this frame, and room for those of the next.
    levels: Vec<[Vec<Record>; 2]>,
    /// Groups that have to be tested, and where their records are.
    asked: Vec<Group>,
    places: Vec<u32>,
    found: Found,
    /// Nodes and leaves that were not tested.
    kept: u64,
}

impl Part for KeptPart {
    fn found(&self) -> &Found {
        &self.found
    }

    fn found_mut(&mut self) -> &mut Found {
        &mut self.found
    }
}

impl KeptPart {
    fn run(&mut self, task: &Task<'_>, batch: &mut Batch, levels: usize) {
        self.found.clear();
        self.kept = 0;
        self.levels.resize_with(levels + 1, Default::default);
        for level in 0..levels {
            self.answer(task, batch, level, false);
            self.open.clear();
            let records = self.levels.get(level).map_or(&[][..], |[now, _]| now);
            for pair in batches(records) {
                let found = (&mut self.found.cut, &mut self.found.marks);
                batch.take_nodes(task, pair, found, &mut self.open);
            }
            std::mem::swap(&mut self.groups, &mut self.open);
            self.found.end_level();
        }
        self.answer(task, batch, levels, true);
        let records = self.levels.get(levels).map_or(&[][..], |[now, _]| now);
        for pair in batches(records) {
            batch.take_leaves(task, pair, (&mut self.found.cut, &mut self.found.marks));
        }
    }

    /// Makes the records of a level those of its groups in this frame: the ones that still hold, and those of tests.
    fn answer(&mut self, task: &Task<'_>, batch: &mut Batch, level: usize, are_leaves: bool) {
        let Some([last, records]) = self.levels.get_mut(level) else {
            return;
        };
        let tree = &task.model.tree;
        let (nodes, leaves): (&[Node], &[Leaf]) = (&tree.nodes, &tree.leaves);
        records.clear();
        self.asked.clear();
        self.places.clear();
        let (mut groups, mut rest) = (self.groups.as_slice(), last.as_slice());
        while let [group, later @ ..] = groups {
            // Most records hold, and those of neighbors follow one another: they are copied together.
            let pairs = rest.iter().zip(groups);
            let many = pairs
                .take_while(|(record, group)| record.holds(**group, task.readings))
                .count();
            if many > 0 {
                let (held, others) = rest.split_at(many);
                records.extend_from_slice(held);
                (groups, rest) = (groups.split_at(many).1, others);
                continue;
            }
            match rest {
                [record, others @ ..] if record.group.first() < group.first() => rest = others,
                _ => {
                    // Those that are asked lie apart, and processors foresee only what is in a row.
                    let first = group.first() as usize;
                    if are_leaves {
                        prefetch_index(leaves, first);
                        prefetch_index(leaves, first + 3);
                    } else {
                        prefetch_index(nodes, first);
                        prefetch_index(nodes, first + 2);
                    }
                    self.asked.push(*group);
                    self.places.push(records.len() as u32);
                    records.push(Record::default());
                    groups = later;
                }
            }
        }
        let mut places = self.places.iter();
        for groups in self.asked.chunks(batch::SIZE) {
            let answer = |record| {
                let place = places.next().copied().unwrap_or(u32::MAX);
                if let Some(place) = records.get_mut(place as usize) {
                    *place = record;
                }
            };
            if are_leaves {
                batch.test_kept_leaves(task, groups, answer);
            } else {
                batch.test_kept_nodes(task, groups, answer);
            }
        }
        let siblings = |groups: &[Group]| groups.iter().map(|g| u64::from(g.count())).sum::<u64>();
        self.kept += siblings(&self.groups) - siblings(&self.asked);
        std::mem::swap(last, records);
    }
}

impl Coherent {
    /// Uses up to `threads` threads, as [`Selector::with_threads`].
    pub fn with_threads(threads: usize) -> Self {
        Self {
            selector: Selector::with_threads(threads),
            ..Self::default()
        }
    }

    /// As [`Selector::with_subpixel_bits`].
    #[must_use]
    pub fn with_subpixel_bits(mut self, bits: u32) -> Self {
        self.selector = self.selector.with_subpixel_bits(bits);
        self
    }

    /// Forgets the last frame.
    ///
    /// Needed when the model changes, or is another one; one that lies elsewhere in memory is noticed.
    pub fn reset(&mut self) {
        self.last = None;
    }

    /// What the last update did. All was tested where nothing was kept.
    pub fn last_update(&self) -> Update {
        self.update
    }

    /// Replaces `cut` by what `view` needs of `model`, as [`Selector::select`] does; the model is that of the calls before, as it
    /// was, or [`reset`](Self::reset) was called.
    pub fn select(&mut self, model: &Model, view: &View, settings: &Settings, cut: &mut Cut) {
        let tester = Tester::new(model, view, settings);
        self.run(model, &tester, None, cut);
        self.remember(model, tester);
    }

    /// The same, less what covers no pixel: as [`Selector::select_seen`].
    pub fn select_seen(
        &mut self,
        model: &Model,
        view: &View,
        settings: &Settings,
        seen: (Footprints, &Undrawn),
        cut: &mut Cut,
    ) {
        let mut nearest = std::mem::take(&mut self.selector.nearest);
        if !nearest.clear(view.width, view.height) {
            return self.select(model, view, settings, cut);
        }
        let tester = Tester::new(model, view, settings);
        let bits = self.selector.subpixel_bits;
        let hiding = Hiding::new(&nearest, &tester, view, seen, bits);
        self.run(model, &tester, Some(&hiding), cut);
        self.selector.nearest = nearest;
        self.remember(model, tester);
    }

    fn remember(&mut self, model: &Model, tester: Tester) {
        let place = Place::of(model);
        self.last = self.keeps.then_some(Last { tester, place });
    }

    fn run(&mut self, model: &Model, tester: &Tester, hiding: Option<&Hiding<'_>>, cut: &mut Cut) {
        let tests = Tests { tester, hiding };
        let is_exact = hiding.is_some_and(Hiding::is_exact);
        let can_keep = tester.is_perspective && tester.size != SizeMetric::Area && !is_exact;
        let regions = Regions::of(&model.tree.level_starts).filter(|_| can_keep);
        self.keeps = regions.is_some();
        let Some(regions) = regions else {
            self.selector.run(model, tests, cut);
            self.update = Update {
                tests: cut.stats.visited,
                ..Update::default()
            };
            return;
        };
        // All centers below a node lie in its ball, but for rounding; else records say so.
        let ball = |index: u32| {
            let node = model.tree.nodes.get((regions.first + index) as usize);
            node.map_or((Vec3::ZERO, 0.0), |n| (n.center, n.radius * 1.001))
        };
        let place = Place::of(model);
        let last = self.last.take();
        let last = last.filter(|last| last.place == place && last.tester.is_like(tester));
        let holds = last.is_some_and(|last| self.motion.advance((&last.tester, tester), ball));
        if !holds {
            self.motion.restart(regions.count);
            for part in &mut self.parts {
                part.levels.clear();
            }
        }
        self.motion.readings(tester, ball, &mut self.readings);
        let readings = &self.readings;
        let task = Task {
            model,
            tester,
            hiding,
            readings,
        };
        descend(&mut self.selector, &mut self.parts, (&task, regions), cut);
        let kept = self.parts.iter().map(|part| part.kept).sum();
        self.update = Update {
            tests: cut.stats.visited - kept,
            kept,
        };
    }
}

/// Goes down to the regions, then below them in parts.
fn descend(
    selector: &mut Selector,
    parts: &mut Vec<KeptPart>,
    (task, regions): (&Task<'_>, Regions),
    cut: &mut Cut,
) {
    let Selector {
        threads,
        level,
        front,
        batches,
        marks,
        ..
    } = selector;
    let Task {
        model,
        tester,
        hiding,
        ..
    } = *task;
    let (tree, tests) = (&model.tree, Tests { tester, hiding });
    cut.clear();
    marks.clear();
    batches.resize_with(*threads, || Batch::new(*level));
    let Some(batch) = batches.first_mut() else {
        return;
    };
    front.groups.clear();
    front.groups.push(Group::new(0, 1, tester.start()));
    for _ in 0..=regions.level {
        front.descend(model, tests, batch, (cut, marks));
    }
    let width = regions.count.div_ceil((PARTS * *threads) as u32).max(1);
    parts.resize_with(regions.count.div_ceil(width) as usize, KeptPart::default);
    for part in &mut *parts {
        part.groups.clear();
    }
    for &group in &front.groups {
        let parent = tree.parents.get(group.first() as usize);
        let region = parent.map_or(0, |parent| parent.saturating_sub(regions.first));
        let region = region.min(regions.count - 1);
        if let Some(part) = parts.get_mut((region / width) as usize) {
            part.groups.push(group.in_region(region));
        }
    }
    let levels = tree.level_count() - regions.level - 1;
    share(batches, parts.iter_mut(), |batch, part| {
        part.run(task, batch, levels);
    });
    join(parts, batches, hiding, levels, (cut, marks));
}
