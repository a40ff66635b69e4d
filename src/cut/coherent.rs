//! Coherent traversal: a cut that starts where the last one went, not at the root.
//!
//! Source: Benda, *Point Based Rendering*, section 3.3.2. Kept from frame to frame is the front: sibling groups such that every
//! leaf lies below exactly one of them, and above which every node was divided in the last frame. For a new frame the
//! front is first moved: a group is raised to the group of its parent where it is no longer certain that all nodes above it
//! are divided, and lowered to the groups of its children where that is certain of them. Then the traversal goes down from
//! it as it does from the root ([`crate::cut::select`]), and the lists are the same.
//!
//! Certain it is by one sibling that is *clearly* visible and *clearly* larger than the threshold: bounding spheres and normal
//! cones are nested ([`crate::tree::check`]), so all nodes above it are visible and too large. "Clearly" is by more than
//! rounding and the tolerances of the nesting: [`PLANE_MARGIN`], [`SIZE_MARGIN`] and [`CONE_MARGIN`].
//! A node may also be drawn as a row of splats ([`crate::cut::strip`]), which is not monotone; so each group of the front knows
//! how near the viewer must be for no node above it to be a row ([`RowLimit`]). And where splats are pixels, what contains no center of a
//! pixel is dropped, and what contains one alone is small; so there such a sibling is larger than that too ([`LEAST_RADIUS_PX`]).
//! What is dropped because it lies behind others would be left out in the end anyway.
//!
//! Deviations: Benda walks up from each node of the cut and tests its ancestors; his front is the cut itself. Here it
//! lies above the cut, where each group still has such a sibling, and everything below it is tested as ever. What is saved are
//! the tests of the nodes above the front, and these are few, since each level of a tree has about four times the nodes of the one above.
//! `docs/PERFORMANCE.md` has the figures; [`CutTraversal::Auto`](crate::render::CutTraversal::Auto) goes from the root.
//!
//! What it does not do: a threshold of a fifth of the focal length or more leaves nothing to save, and such cuts start at the
//! root; the front stays as it is. Of trees whose spheres and cones are not nested the lists may be others. Where splats are
//! pixels and what is hidden is left out, which hidden triangles remain depends on the order of the work, as it does on threads.
//!
//! Cost: one to four tests for each group of the front, and as many for some groups of children of an eighth of them, on one
//! thread. Memory: 20 bytes a group of the front, and 8 more in the [`Selector`](crate::cut::CutSelector).

use crate::cut::batch::SiblingGroup;
use crate::cut::frustum_and_size::{NodeTester, inherit};
use crate::cut::normal_cone::FacingTest;
use crate::cut::occlusion::OcclusionTest;
use crate::cut::select::NodeTests;
use crate::cut::siblings::SphereLanes;
use crate::cut::strip::{MAX_COUNT, MAX_WIDTH};
use crate::tree::{Model, Node, NormalCone};
use glam::DVec3;
use std::ops::Range;

/// Distance by which a clearly visible ball reaches into the view volume, in units of [`NodeTester::plane_error`], which is 1e-6 of
/// the model's reach. Spheres may stick out of those above them by 1e-5 of their radius.
const PLANE_MARGIN: f32 = 32.0;
/// Size of a node that is clearly too large, over the threshold.
const SIZE_MARGIN: f64 = 1.02;
/// Difference from the limit that the cosine of an angle between a normal and the way to the viewer must have.
const CONE_MARGIN: f64 = 1e-3;
/// Radius in pixels, where splats are pixels, of a node that clearly contains more than one center of a pixel, or so large that nobody asks.
const LEAST_RADIUS_PX: f32 = 1.02;
/// Frames between two attempts to lower a group.
const LOWER_EVERY: u8 = 8;
/// Least of twice the focal length over the threshold. Where it is more, a node is compared with the threshold far from where the
/// square roots of sizes lose digits.
const LEAST_RATIO: f32 = 10.0;

/// Bound of which nodes above a group could be rows of splats: node a only where its radius R in pixels is at most L thresholds, L from the
/// shape of its strip. With z the depth of a node below, the depth of a is at most z + R, so a is no row if
/// z L / R + L < 2 f / t.
#[derive(Debug, Clone, Copy, Default)]
struct RowLimit {
    /// The largest L / R, per model unit.
    per_length: f32,
    /// The largest L.
    added: f32,
}

impl RowLimit {
    fn of(node: &Node) -> Self {
        let part = |x: u16| f32::from(x.min(255)) / 255.0;
        let width = u16::from(node.strip.width);
        let half = part(u16::from(node.strip.half_length) + width);
        if width >= 255 {
            return Self::default();
        }
        let limit = (MAX_WIDTH / part(width)).min(MAX_COUNT as f32 / half);
        Self {
            per_length: limit / node.radius,
            added: limit,
        }
    }

    fn or(self, other: Self) -> Self {
        Self {
            per_length: self.per_length.max(other.per_length),
            added: self.added.max(other.added),
        }
    }
}

/// A sibling group of the front.
#[derive(Debug, Clone, Copy)]
struct FrontGroup {
    first: u32,
    count: u32,
    /// Row limit of all nodes above.
    rows: RowLimit,
    /// Frames until it is tried to lower it.
    wait: u8,
}

impl FrontGroup {
    const ROOT: Self = Self {
        first: 0,
        count: 1,
        rows: RowLimit {
            per_length: 0.0,
            added: 0.0,
        },
        wait: 0,
    };

    fn range(&self) -> Range<u32> {
        self.first..self.first + self.count
    }

    /// The children of `node`, whose own group is this one.
    fn of_children(&self, node: &Node) -> Self {
        Self {
            first: node.first_child,
            count: u32::from(node.child_count),
            rows: self.rows.or(RowLimit::of(node)),
            wait: 0,
        }
    }

    /// The group that `id` belongs to.
    fn around(model: &Model, id: u32) -> Self {
        let tree = &model.tree;
        let mut rows = RowLimit::default();
        let (mut at, mut own) = (id, None);
        while at != 0
            && let Some(&parent) = tree.parents.get(at as usize)
            && let Some(node) = tree.nodes.get(parent as usize)
        {
            own.get_or_insert((node.first_child, u32::from(node.child_count)));
            rows = rows.or(RowLimit::of(node));
            at = parent;
        }
        let (first, count) = own.unwrap_or((0, 1));
        Self {
            first,
            count,
            rows,
            wait: 0,
        }
    }
}

/// Where a model lies in memory: another one is noticed, but for one that took the place of this one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct ModelPlace([(usize, usize); 2]);

impl ModelPlace {
    fn of(model: &Model) -> Self {
        let (nodes, leaves) = (&model.tree.nodes, &model.tree.leaves);
        Self([
            (nodes.as_ptr().addr(), nodes.len()),
            (leaves.as_ptr().addr(), leaves.len()),
        ])
    }
}

/// The front of the last frame.
#[derive(Debug, Default)]
pub(super) struct CoherentFront {
    place: ModelPlace,
    /// Groups on each level of nodes, in ascending order.
    levels: Vec<Vec<FrontGroup>>,
}

impl CoherentFront {
    /// Starts at the root again.
    pub(super) fn forget(&mut self) {
        self.levels.clear();
    }

    /// Moves the front to where a frame may start; its groups replace those in `starts`. Returns how many nodes were
    /// tested for it. `None`, and nothing is done, where such a frame has to start at the root.
    pub(super) fn advance(
        &mut self,
        model: &Model,
        NodeTests { tester, hiding, .. }: NodeTests<'_>,
        starts: &mut Vec<Vec<SiblingGroup>>,
    ) -> Option<u64> {
        let is_sound = !tester.is_perspective || tester.ratio >= LEAST_RATIO;
        if !is_sound || model.tree.nodes.is_empty() {
            return None;
        }
        let place = ModelPlace::of(model);
        if self.levels.is_empty() || self.place != place {
            self.place = place;
            self.levels.clear();
            self.levels
                .resize_with(model.tree.level_count(), Vec::default);
            self.levels.first_mut()?.push(FrontGroup::ROOT);
        }
        let mut judge = FrontJudge {
            model,
            tester,
            exact: hiding.filter(|hiding| hiding.is_exact()),
            tests: 0,
        };
        self.raise(&mut judge);
        self.lower(&mut judge);
        starts.resize_with(self.levels.len(), Vec::default);
        for (starts, groups) in starts.iter_mut().zip(&self.levels) {
            starts.clear();
            starts.extend(groups.iter().map(|group| {
                let inherited = tester.start() | judge.inherited(group);
                SiblingGroup::new(group.first, group.count, inherited)
            }));
        }
        Some(judge.tests)
    }

    /// Raises groups until each has a sibling that vouches for the nodes above it. From the deepest level on, so that what is
    /// raised is asked again.
    fn raise(&mut self, judge: &mut FrontJudge<'_>) {
        let model = judge.model;
        for level in (1..self.levels.len()).rev() {
            let (above, below) = self.levels.split_at_mut(level);
            let mut raised: Vec<FrontGroup> = Vec::new();
            for group in below.first().into_iter().flatten() {
                if judge.has_voucher(group) {
                    continue;
                }
                let parent = model.tree.parents.get(group.first as usize);
                let parent = parent.copied().unwrap_or_default();
                if !raised.last().is_some_and(|g| g.range().contains(&parent)) {
                    raised.push(FrontGroup::around(model, parent));
                }
            }
            if raised.is_empty() {
                continue;
            }
            // What lies below them is reached from them.
            let mut ranges: Vec<_> = raised.iter().map(FrontGroup::range).collect();
            for (groups, above) in below.iter_mut().zip(level - 1..) {
                for range in &mut ranges {
                    *range = children_of(model, above, range);
                }
                groups.retain(|group| {
                    let next = ranges.partition_point(|range| range.end <= group.first);
                    !ranges.get(next).is_some_and(|r| r.contains(&group.first))
                });
            }
            if let Some(groups) = above.last_mut() {
                groups.append(&mut raised);
                groups.sort_by_key(|group| group.first);
            }
        }
    }

    /// Lowers groups as far as all groups of children have siblings that vouch for the nodes above.
    fn lower(&mut self, judge: &mut FrontJudge<'_>) {
        for level in 1..self.levels.len() {
            let (above, below) = self.levels.split_at_mut(level);
            let (Some(groups), Some(lower)) = (above.last_mut(), below.first_mut()) else {
                return;
            };
            let known = lower.len();
            groups.retain_mut(|group| {
                if group.wait > 0 {
                    group.wait -= 1;
                    return true;
                }
                let before = lower.len();
                for id in group.range() {
                    let node = judge.model.tree.nodes.get(id as usize);
                    let children = node.map(|node| group.of_children(node));
                    match children.filter(|children| judge.has_voucher(children)) {
                        Some(children) => lower.push(children),
                        None => {
                            lower.truncate(before);
                            group.wait = LOWER_EVERY - 1;
                            return true;
                        }
                    }
                }
                false
            });
            if lower.len() > known {
                lower.sort_by_key(|group| group.first);
            }
        }
    }
}

/// The children, themselves nodes, of some consecutive nodes of a level.
pub(super) fn children_of(model: &Model, level: usize, ids: &Range<u32>) -> Range<u32> {
    let tree = &model.tree;
    let end = |level: usize| tree.level_starts.get(level + 1).copied();
    let first_from = |id: u32| match tree.nodes.get(id as usize) {
        Some(node) if end(level).is_some_and(|end| id < end) => node.first_child,
        _ => end(level + 1).unwrap_or(u32::MAX),
    };
    first_from(ids.start)..first_from(ids.end)
}

/// Judge of where the front may be in a frame.
struct FrontJudge<'a> {
    model: &'a Model,
    tester: &'a NodeTester,
    /// Search for what covers no pixel, where splats are pixels.
    exact: Option<&'a OcclusionTest<'a>>,
    /// Nodes that were tested.
    tests: u64,
}

impl FrontJudge<'_> {
    /// Tests whether one sibling shows that all nodes above a group are divided. Errs to "no". The root has none above it.
    fn has_voucher(&mut self, group: &FrontGroup) -> bool {
        let nodes = &self.model.tree.nodes;
        group.first == 0
            || group.range().any(|id| {
                self.tests += 1;
                let node = nodes.get(id as usize);
                node.is_some_and(|node| self.vouches(node, group.rows))
            })
    }

    /// Tests whether a node is clearly visible and too large, and far too near for the nodes above it to be rows.
    fn vouches(&self, node: &Node, rows: RowLimit) -> bool {
        let tester = self.tester;
        let ball = tester.ball(node.center, node.radius);
        let (radius, depth) = (ball.radius.x, ball.depth.x);
        let margin = PLANE_MARGIN * tester.plane_error;
        // Written so that a NaN does not vouch.
        let skips = |what: u8| tester.start() & what != 0;
        let is_inside = skips(inherit::INSIDE) || tester.nearest_plane(&ball).x >= margin - radius;
        let is_turned = || self.clearances(&ball, node.cone)[0] < -CONE_MARGIN;
        let nearest = if tester.is_perspective {
            depth / tester.unit * rows.per_length + rows.added
        } else {
            rows.per_length / tester.unit
        };
        let is_no_row = nearest < 0.99 * tester.ratio;
        let within = |hiding: &OcclusionTest<'_>| hiding.centers.are_within(&ball, LEAST_RADIUS_PX);
        let is_wide = || self.exact.is_none_or(|exact| within(exact) & 1 == 0);
        if !(is_inside && is_no_row && is_wide() && (skips(inherit::FRONT) || is_turned())) {
            return false;
        }
        // What reaches the near plane is divided in any case.
        let from_near = depth - radius - tester.near;
        let is_large = || {
            let size_px = tester.size_px(node.center, node.radius);
            size_px > SIZE_MARGIN * f64::from(tester.threshold_px)
        };
        from_near <= -margin || (from_near > margin && is_large())
    }

    /// Excess of the cosine of the largest angle between a normal of a cone and the way from the viewer over what lets
    /// all of a ball face away, and the same for facing the viewer. At least 0: it does.
    fn clearances(&self, ball: &SphereLanes, cone: NormalCone) -> [f64; 2] {
        if cone.sin_half_angle == NormalCone::NEVER {
            return [f64::NEG_INFINITY; 2];
        }
        let (way, radius) = if self.tester.is_perspective {
            let way = ball.center.map(|v| f64::from(v.x));
            (DVec3::from_array(way), f64::from(ball.radius.x))
        } else {
            (-self.tester.backward.as_dvec3(), 0.0)
        };
        let distance = way.length();
        let sine = f64::from(cone.sin_half_angle());
        let along = cone.axis().as_dvec3().dot(way) / distance;
        let across = (1.0 - along * along).max(0.0).sqrt();
        let least = across * sine + radius / distance;
        let cosine = (1.0 - sine * sine).max(0.0).sqrt();
        [along, -along].map(|along| along * cosine - least)
    }

    /// Bits that a group inherits of nodes above it. That they are inside of the view volume changes no list and is left out; that
    /// they face the viewer keeps triangles without area.
    fn inherited(&mut self, group: &FrontGroup) -> u8 {
        let tree = &self.model.tree;
        let is_known = self.tester.start() & inherit::FRONT != 0;
        let mut at = group.first;
        while at != 0
            && !is_known
            && let Some(&parent) = tree.parents.get(at as usize)
            && let Some(node) = tree.nodes.get(parent as usize)
        {
            self.tests += 1;
            let ball = self.tester.ball(node.center, node.radius);
            if self.tester.facing(node.center, node.radius, node.cone) == FacingTest::Front {
                return inherit::FRONT;
            }
            // Nor do those above it.
            if self.clearances(&ball, node.cone)[1] < -CONE_MARGIN {
                return 0;
            }
            at = parent;
        }
        0
    }
}
