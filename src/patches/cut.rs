//! The cut by error: a node is a patch as soon as its error on the picture is small, whatever its size.
//!
//! [`crate::patches::conditions`] has the conditions. All else is as in [`crate::cut`]; with negative tolerances it is that
//! cut itself, at its time.

use super::conditions::{ErrorTester, PatchCondition, PatchConditions};
use super::settings::{ErrorTolerances, PatchCutSettings};
use crate::cut::{Cut, CutSelector, FourNodes, NodeTester, StripRun};
use crate::math::camera::View;
use crate::threads::{self, share};
use crate::tree::{Leaf, Model, Node};
use bytemuck::Zeroable;
use prefetch_index::prefetch_index;

/// How often each condition refused a node larger than the threshold, the first that did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct PatchRefusals {
    /// Wide cone, small vector area, or a record that no view draws.
    pub never: u64,
    /// The node reaches the near plane.
    pub near: u64,
    /// Thickness or overhang at a silhouette.
    pub rim: u64,
    /// Thickness or overhang elsewhere.
    pub inside: u64,
    /// Shade.
    pub shade: u64,
    /// Least size.
    pub size: u64,
}

/// What is to be drawn, as ids in ascending order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PatchCut {
    /// Nodes drawn as a patch.
    pub patches: Vec<u32>,
    /// Nodes below the threshold drawn as their polygon.
    pub tiny: Vec<u32>,
    /// Everything else: squares, rows of squares, leaves, triangles; and the counts of the whole cut.
    pub rest: Cut,
    /// Why nodes were no patches.
    pub refused: PatchRefusals,
    /// Patches by size on screen: up to 2, 4, 8, 16 and 32 pixels, and more.
    pub sizes: [u64; 6],
}

/// Counts of patches and of nodes that are none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct PatchCounts {
    /// Patches up to 2, 4, 8, 16, 32 pixels, and larger ones.
    pub sizes: [u64; 6],
    /// Nodes larger than the threshold that are no patch, by the first condition that refused them.
    pub refused: PatchRefusals,
}

impl PatchCounts {
    /// Adds those of another model.
    pub(crate) fn add(&mut self, cut: &PatchCut) {
        self.refused.add(&cut.refused);
        let sizes = self.sizes.iter_mut().zip(cut.sizes);
        sizes.for_each(|(sum, more)| *sum += more);
    }

    /// Patches of all sizes.
    pub fn patches(&self) -> u64 {
        self.sizes.iter().sum()
    }
}

impl PatchRefusals {
    fn add(&mut self, more: &Self) {
        self.never += more.never;
        self.near += more.near;
        self.rim += more.rim;
        self.inside += more.inside;
        self.shade += more.shade;
        self.size += more.size;
    }
}

impl PatchCut {
    /// Empties it and keeps its memory.
    pub(crate) fn clear(&mut self) {
        self.patches.clear();
        self.tiny.clear();
        self.rest.clear();
        self.refused = PatchRefusals::default();
        self.sizes = [0; 6];
    }

    /// Appends another part of the same level.
    fn append(&mut self, part: &Self) {
        self.patches.extend_from_slice(&part.patches);
        self.tiny.extend_from_slice(&part.tiny);
        self.rest.nodes.extend_from_slice(&part.rest.nodes);
        self.rest.strips.extend_from_slice(&part.rest.strips);
        self.rest.leaves.extend_from_slice(&part.rest.leaves);
        self.rest.triangles.extend_from_slice(&part.rest.triangles);
        self.rest.stats.add(&part.rest.stats);
        self.refused.add(&part.refused);
        let sizes = self.sizes.iter_mut().zip(part.sizes);
        sizes.for_each(|(sum, more)| *sum += more);
    }

    /// Polygons, squares and triangles together.
    pub fn primitives(&self) -> usize {
        let rows: usize = self
            .rest
            .strips
            .iter()
            .map(|row| row.splats() as usize)
            .sum();
        self.patches.len()
            + self.tiny.len()
            + self.rest.nodes.len()
            + rows
            + self.rest.leaves.len()
            + self.rest.triangles.len()
    }
}

/// Largest sizes of all but the last of [`PatchCut::sizes`], pixels.
const LARGEST_OF_CLASS: [f32; 5] = [2.0, 4.0, 8.0, 16.0, 32.0];

/// Siblings that are to be looked at.
#[derive(Debug, Clone, Copy)]
struct OpenGroup {
    first: u32,
    count: u8,
    /// Wholly inside of the view volume.
    is_inside: bool,
    /// Every normal faces the viewer.
    faces: bool,
}

/// Levels of fewer groups are not divided among threads.
const LARGE: usize = 512;

/// Groups of a part.
const PART: usize = 256;

/// Groups that are asked of memory before they are looked at.
const AHEAD: usize = 12;

/// What a part of a level gives.
#[derive(Debug, Default)]
struct LevelPart {
    cut: PatchCut,
    open: Vec<OpenGroup>,
}

/// Selects cuts by error and keeps its working memory from one to the next.
///
/// Levels of many nodes are divided among threads; the lists do not depend on their number. Memory: 8 bytes for each group of
/// siblings of a level that is opened, and the lists once more.
#[derive(Debug)]
pub struct PatchSelector {
    threads: usize,
    groups: Vec<OpenGroup>,
    parts: Vec<LevelPart>,
    /// Where no node can be a patch.
    by_size: CutSelector,
}

impl Default for PatchSelector {
    /// As many threads as the machine runs at once, at most 16.
    fn default() -> Self {
        Self::with_threads(threads::count())
    }
}

impl PatchSelector {
    /// Uses up to `threads` threads, the calling one included; 0 counts as 1.
    pub fn with_threads(threads: usize) -> Self {
        Self {
            threads: threads.max(1),
            groups: Vec::new(),
            parts: Vec::new(),
            by_size: CutSelector::with_threads(threads),
        }
    }

    /// Selects the cut by error from the root, level by level. `conditions` are those of the model; where they are none (a
    /// cloud), no node is a patch.
    pub fn select(
        &mut self,
        model: &Model,
        conditions: &PatchConditions,
        view: &View,
        settings: &PatchCutSettings,
        cut: &mut PatchCut,
    ) {
        cut.clear();
        let ErrorTolerances {
            rim_px,
            inside_px,
            shade_levels,
        } = settings.tolerances;
        if !settings.tiny_polygons && rim_px.max(inside_px).min(shade_levels) < 0.0 {
            return (self.by_size).select(model, view, &settings.cut, &mut cut.rest);
        }
        let tester = NodeTester::new(model, view, &settings.cut);
        let frame = PatchFrame {
            model,
            conditions,
            tester: &tester,
            errors: ErrorTester::new(&tester, settings, conditions),
        };
        let tree = &model.tree;
        self.groups.clear();
        if !tree.leaves.is_empty() {
            self.groups.push(OpenGroup {
                first: 0,
                count: 1,
                is_inside: !settings.cut.cull_frustum && settings.cut.section.is_none(),
                faces: !settings.cut.cull_back,
            });
        }
        let levels = if tree.nodes.is_empty() {
            0
        } else {
            tree.level_count()
        };
        for _ in 0..levels {
            self.level(cut, |groups, part| frame.look_at_nodes(groups, part));
        }
        self.level(cut, |groups, part| frame.look_at_leaves(groups, part));
    }

    /// Looks at a level; the groups become those of the next one.
    fn level(&mut self, cut: &mut PatchCut, look: impl Fn(&[OpenGroup], &mut LevelPart) + Sync) {
        let threads = if self.groups.len() < LARGE {
            1
        } else {
            self.threads
        };
        let each = if threads == 1 { usize::MAX } else { PART };
        let count = self.groups.len().div_ceil(each);
        if self.parts.len() < count {
            self.parts.resize_with(count, LevelPart::default);
        }
        let parts = self.parts.iter_mut().zip(self.groups.chunks(each));
        share(&mut vec![(); threads], parts, |(), (part, groups)| {
            part.cut.clear();
            part.open.clear();
            look(groups, part);
        });
        self.groups.clear();
        for part in self.parts.iter().take(count) {
            cut.append(&part.cut);
            self.groups.extend_from_slice(&part.open);
        }
    }
}

/// Selects a cut by error with memory of its own: [`PatchSelector::select`].
pub fn select(
    model: &Model,
    conditions: &PatchConditions,
    view: &View,
    settings: &PatchCutSettings,
    cut: &mut PatchCut,
) {
    PatchSelector::default().select(model, conditions, view, settings, cut);
}

/// Everything that decides about nodes of one frame.
#[derive(Clone, Copy)]
struct PatchFrame<'a> {
    model: &'a Model,
    conditions: &'a PatchConditions,
    tester: &'a NodeTester,
    errors: ErrorTester<'a>,
}

/// Four records from `first` on; those past the end are zeros.
#[inline(always)]
fn four<T: Copy + Zeroable>(records: &[T], first: u32) -> [T; 4] {
    let rest = records.get(first as usize..).unwrap_or_default();
    match rest.first_chunk::<4>() {
        Some(&four) => four,
        None => [0, 1, 2, 3].map(|i| rest.get(i).copied().unwrap_or_else(T::zeroed)),
    }
}

/// The lanes of a mask, ascending.
#[inline(always)]
fn lanes(mut mask: u32) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros();
        mask &= mask.wrapping_sub(1);
        (lane < 32).then_some(lane)
    })
}

impl PatchFrame<'_> {
    fn look_at_nodes(&self, groups: &[OpenGroup], part: &mut LevelPart) {
        let nodes: &[Node] = &self.model.tree.nodes;
        for (index, group) in groups.iter().enumerate() {
            if let Some(next) = groups.get(index + AHEAD) {
                prefetch_index(nodes, next.first as usize);
                prefetch_index(nodes, next.first as usize + 2);
                prefetch_index(&self.conditions.nodes[..], next.first as usize);
            }
            self.look_at_group(*group, &four(nodes, group.first), part);
        }
    }

    #[inline(always)]
    fn look_at_group(&self, group: OpenGroup, nodes: &[Node; 4], part: &mut LevelPart) {
        let LevelPart { cut, open } = part;
        let stats = &mut cut.rest.stats;
        let there = (1u32 << group.count.min(4)) - 1;
        let mut kept = there;
        stats.visited += u64::from(there.count_ones());
        let siblings = self.tester.four_nodes(nodes);
        let mut inside = there;
        if !group.is_inside {
            let (outside, wholly) = self.tester.four_in_volume(siblings.balls());
            stats.outside += u64::from((outside & kept).count_ones());
            kept &= !outside;
            inside = wholly;
        }
        let mut faces = there;
        if !group.faces {
            let (away, front) = self.tester.four_facing(&siblings);
            stats.facing_away += u64::from((away & kept).count_ones());
            kept &= !away;
            faces = front;
        }
        let small = self.tester.four_small(siblings.balls()) & kept;
        let conditions = self.conditions.four(group.first);
        if small != 0 {
            let tiny = self.errors.settings.tiny_polygons;
            for lane in lanes(small) {
                let is_polygon = |four: &[PatchCondition; 4]| four[lane as usize].may_be_drawn();
                if tiny && conditions.as_ref().is_some_and(is_polygon) {
                    cut.tiny.push(group.first + lane);
                } else {
                    cut.rest.nodes.push(group.first + lane);
                }
            }
        }
        let mut large = kept & !small;
        if large == 0 {
            return;
        }
        if let Some(conditions) = &conditions {
            large &= !self.patches(group.first, large, (&siblings, conditions), cut);
        }
        let (counts, rows) = self.tester.four_rows(group.first, &siblings);
        for lane in lanes(large) {
            let node = &nodes[lane as usize];
            if rows >> lane & 1 != 0 {
                let run = StripRun::new(group.first + lane, counts[lane as usize]);
                cut.rest.strips.push(run);
            } else {
                open.push(OpenGroup {
                    first: node.first_child,
                    count: node.child_count,
                    is_inside: inside >> lane & 1 != 0,
                    faces: faces >> lane & 1 != 0,
                });
            }
        }
    }

    /// Which of the large nodes are patches; counts why the others are none.
    #[inline(always)]
    fn patches(
        &self,
        first: u32,
        large: u32,
        (siblings, conditions): (&FourNodes, &[PatchCondition; 4]),
        cut: &mut PatchCut,
    ) -> u32 {
        let found = self.errors.verdicts(siblings, conditions);
        let count = |mask: u32| u64::from((mask & large).count_ones());
        cut.refused.add(&PatchRefusals {
            never: count(found.never),
            near: count(found.near),
            rim: count(found.rim),
            inside: count(found.inside),
            shade: count(found.shade),
            size: count(found.size),
        });
        for lane in lanes(found.patch & large) {
            cut.patches.push(first + lane);
            let size_px = found.size_px[lane as usize];
            let class = LARGEST_OF_CLASS.partition_point(|most_px| *most_px < size_px);
            cut.sizes[class] += 1;
        }
        found.patch
    }

    fn look_at_leaves(&self, groups: &[OpenGroup], part: &mut LevelPart) {
        let is_cloud = self.model.kind().is_points();
        let leaves: &[Leaf] = &self.model.tree.leaves;
        let rest = &mut part.cut.rest;
        for (index, group) in groups.iter().enumerate() {
            if let Some(next) = groups.get(index + AHEAD) {
                prefetch_index(leaves, next.first as usize);
            }
            let mut kept = (1u32 << group.count.min(4)) - 1;
            rest.stats.visited += u64::from(kept.count_ones());
            let balls = self.tester.four_leaves(&four(leaves, group.first));
            if !group.is_inside {
                let outside = self.tester.four_in_volume(&balls).0 & kept;
                rest.stats.outside += u64::from(outside.count_ones());
                kept &= !outside;
            }
            let small = self.tester.four_small(&balls);
            for lane in lanes(kept) {
                let leaf = group.first + lane;
                if !group.faces && self.tester.leaf_faces_away(self.model, leaf) {
                    rest.stats.facing_away += 1;
                } else if is_cloud || small >> lane & 1 != 0 {
                    rest.leaves.push(leaf);
                } else {
                    rest.triangles.push(leaf);
                }
            }
        }
    }
}
