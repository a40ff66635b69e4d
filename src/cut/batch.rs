//! A batch of sibling groups, tested in stages.
//!
//! What becomes of a node cannot be foreseen on a real surface, and the nodes of a large model are not in the
//! nearest caches. So no stage branches on a verdict: it does one test for all groups that need it, and those
//! that need the next one are listed by a store that is always made and a length that may grow. The groups
//! after the batch are prefetched meanwhile, a line a stage, since the processor has only so many requests on
//! their way. One group at a time and with branches, all this took about twice as long.

mod hide;
mod kept;

pub(super) use kept::{Record, Task};

use super::nearest::{Chunk, Hiding, Marks};
use super::quad::{self, Balls, Words};
use super::tester::{Tester, inherit};
use super::{Cut, StripRun};
use crate::tree::{Leaf, Model, Node};
use glam::Vec4;
use prefetch_index::prefetch_index;

/// Siblings that are to be looked at: the first one, how many they are (1 to 4) and what they inherit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Group {
    first: u32,
    /// The count; above its 8 bits what is inherited; above 16 bits the region ([`super::motion`]), where there are any.
    word: u32,
}

const INHERITED: u32 = 8;
const INSIDE: u32 = (inherit::INSIDE as u32) << INHERITED;
const FRONT: u32 = (inherit::FRONT as u32) << INHERITED;
const REGION: u32 = 16;

impl Group {
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

    /// The same in a region (of less than 2^16), which all groups below inherit.
    #[inline]
    pub(super) fn in_region(self, region: u32) -> Self {
        Self {
            word: self.word & ((1 << REGION) - 1) | region << REGION,
            ..self
        }
    }

    #[inline]
    pub(super) fn region(self) -> usize {
        (self.word >> REGION) as usize
    }

    #[inline]
    fn inherits(self, bit: u32) -> bool {
        self.word & bit != 0
    }

    #[inline]
    pub(super) fn count(self) -> u32 {
        (self.word & 0xff).min(4)
    }
}

/// Groups in a batch.
pub(super) const SIZE: usize = 64;

/// A list that never moves: pushing is a store and an addition, without a branch on `keep`.
#[derive(Debug)]
struct List<T, const N: usize> {
    items: [T; N],
    len: usize,
}

impl<T: Copy, const N: usize> List<T, N> {
    const fn new(zero: T) -> Self {
        Self {
            items: [zero; N],
            len: 0,
        }
    }

    #[inline]
    fn push_if(&mut self, keep: bool, item: T) {
        if let Some(place) = self.items.get_mut(self.len) {
            *place = item;
        }
        self.len += usize::from(keep);
    }

    #[inline]
    fn as_slice(&self) -> &[T] {
        self.items.get(..self.len).unwrap_or_default()
    }

    fn clear(&mut self) {
        self.len = 0;
    }

    /// Moves all to the end of `list`.
    fn flush(&mut self, list: &mut Vec<T>) {
        list.extend_from_slice(self.as_slice());
        self.clear();
    }
}

impl<const N: usize> List<u32, N> {
    /// Appends `first + i` for the bits i of `mask` (4 of them), lowest first.
    #[inline]
    fn push_lanes(&mut self, first: u32, mask: u8) {
        let (lanes, count) = LANES[(mask & 15) as usize];
        if let Some(place) = self.items.get_mut(self.len..self.len + 4) {
            place.copy_from_slice(&lanes.map(|lane| first.wrapping_add(lane)));
        }
        self.len += count as usize;
    }
}

impl<const N: usize> List<StripRun, N> {
    /// Appends node `first + i` with its count for the bits i of `mask` (4 of them), lowest first.
    #[inline]
    fn push_lanes(&mut self, first: u32, counts: [u32; 4], mask: u8) {
        let (lanes, count) = LANES[(mask & 15) as usize];
        if let Some(place) = self.items.get_mut(self.len..self.len + 4) {
            place.copy_from_slice(
                &lanes.map(|lane| {
                    StripRun::new(first.wrapping_add(lane), counts[(lane & 3) as usize])
                }),
            );
        }
        self.len += count as usize;
    }
}

/// The set bits of a mask of four, lowest first, and how many they are.
const LANES: [([u32; 4], u32); 16] = {
    let mut table = [([0; 4], 0); 16];
    let mut mask = 0;
    while mask < 16 {
        let (mut lane, mut count) = (0, 0);
        while lane < 4 {
            if mask >> lane & 1 != 0 {
                table[mask].0[count] = lane;
                count += 1;
            }
            lane += 1;
        }
        table[mask].1 = count as u32;
        mask += 1;
    }
    table
};

#[inline]
fn bits(mask: u8) -> u32 {
    LANES[(mask & 15) as usize].1
}

/// The spheres of a group of nodes, the rest, and how many there are.
#[inline]
fn four_nodes(nodes: &[Node], group: Group) -> ([Vec4; 4], Words, u32) {
    let rest = nodes.get(group.first as usize..).unwrap_or_default();
    let count = group.count();
    if let Some(four) = rest.first_chunk::<4>() {
        let (spheres, words) = quad::of_nodes(four);
        return (spheres, words, count);
    }
    match quad::four(nodes, group.first) {
        Some((four, there)) => {
            let (spheres, words) = quad::of_nodes(&four);
            (spheres, words, count.min(there))
        }
        // Only where the tree's links are wrong.
        None => ([Vec4::ZERO; 4], Words::ZERO, 0),
    }
}

/// The same of leaves.
#[inline]
fn four_leaves(leaves: &[Leaf], group: Group) -> ([Vec4; 4], u32) {
    let rest = leaves.get(group.first as usize..).unwrap_or_default();
    let count = group.count();
    if let Some(four) = rest.first_chunk::<4>() {
        return (quad::of_leaves(four), count);
    }
    match quad::four(leaves, group.first) {
        Some((four, there)) => (quad::of_leaves(&four), count.min(there)),
        None => ([Vec4::ZERO; 4], 0),
    }
}

/// Lanes of a batch, and room for the store of a push beyond the last.
const ROOM: usize = 4 * SIZE + 4;

/// The working memory of the stages, 45 KiB. Masks have a bit a sibling.
#[derive(Debug)]
pub(super) struct Batch {
    balls: [Balls; SIZE],
    words: [Words; SIZE],
    /// Not dropped so far.
    kept: [u8; SIZE],
    small: [u8; SIZE],
    /// Wholly inside the view volume, by a test of this batch.
    inside: [u8; SIZE],
    /// Facing the viewer everywhere, by a test of this batch.
    front: [u8; SIZE],
    /// Drawn as a row of splats.
    rows: [u8; SIZE],
    /// Of how many splats.
    counts: [[u32; 4]; SIZE],
    /// Groups that go to the next stage.
    listed: List<u8, { SIZE + 1 }>,
    likely: List<u8, { SIZE + 1 }>,
    ids: List<u32, ROOM>,
    triangles: List<u32, ROOM>,
    runs: List<StripRun, ROOM>,
    /// Leaves whose side is asked for, and 4 times the group plus the lane of each.
    faces: List<u32, ROOM>,
    places: List<u32, ROOM>,
    corners: [[u32; 3]; ROOM],
    split: hide::Rows,
    chunk: Chunk,
}

impl Default for Batch {
    fn default() -> Self {
        Self {
            balls: [Balls::ZERO; SIZE],
            words: [Words::ZERO; SIZE],
            kept: [0; SIZE],
            small: [0; SIZE],
            inside: [0; SIZE],
            front: [0; SIZE],
            rows: [0; SIZE],
            counts: [[0; 4]; SIZE],
            listed: List::new(0),
            likely: List::new(0),
            ids: List::new(0),
            triangles: List::new(0),
            runs: List::new(StripRun::new(0, 0)),
            faces: List::new(0),
            places: List::new(0),
            corners: [[0; 3]; ROOM],
            split: hide::Rows::default(),
            chunk: Chunk::default(),
        }
    }
}

impl Batch {
    /// Looks at groups of nodes of one level (at most [`SIZE`]): appends what is drawn of them to `cut` and
    /// the children of what is to be opened to `open`. `ahead` are the groups that come next.
    pub(super) fn nodes(
        &mut self,
        model: &Model,
        tester: &Tester,
        (groups, ahead): (&[Group], &[Group]),
        hiding: Option<&Hiding<'_>>,
        (cut, marks): (&mut Cut, &mut Marks),
        open: &mut Vec<Group>,
    ) {
        let nodes: &[Node] = &model.tree.nodes;
        // Four nodes lie on two lines (see `tree::Records`). Only so many requests may be on their way at once, and one more
        // waits for its place; so they are made a few at a time wherever there is work between them.
        let mut lines = ahead
            .iter()
            .take(SIZE)
            .flat_map(|group| [0, 2].map(|node| group.first as usize + node));
        let mut prefetch = || {
            if let Some(node) = lines.next() {
                prefetch_index(nodes, node);
            }
        };
        self.gather_nodes(nodes, tester, groups, &mut prefetch, cut);
        self.sizes(tester, groups.len());
        self.volumes(tester, groups, cut);
        self.cones(tester, groups, &mut prefetch, cut);
        if let Some(hiding) = hiding.filter(|hiding| hiding.is_exact()) {
            self.ask_centers(hiding, groups.len(), &mut prefetch);
        }
        self.rows(tester, groups, &mut prefetch);
        match hiding.filter(|hiding| hiding.asks_splats()) {
            Some(hiding) => {
                self.hide_rows(hiding, tester, marks, cut);
                self.hide_nodes(hiding, groups, marks, cut);
            }
            None => self.runs.flush(&mut cut.strips),
        }
        self.emit_nodes(groups, &mut prefetch, cut, open);
    }

    #[inline]
    fn gather_nodes(
        &mut self,
        nodes: &[Node],
        tester: &Tester,
        groups: &[Group],
        mut prefetch: impl FnMut(),
        cut: &mut Cut,
    ) {
        let lanes = self.balls.iter_mut().zip(&mut self.words);
        let mut visited = 0;
        for ((group, (balls, words)), kept) in groups.iter().zip(lanes).zip(&mut self.kept) {
            prefetch();
            let (spheres, rest, count) = four_nodes(nodes, *group);
            *balls = tester.balls(spheres);
            *words = rest;
            *kept = (1u8 << count) - 1;
            visited += count;
        }
        cut.stats.visited += u64::from(visited);
        self.inside = [0; SIZE];
        self.front = [0; SIZE];
        self.rows = [0; SIZE];
    }

    #[inline]
    fn sizes(&mut self, tester: &Tester, count: usize) {
        for (balls, small) in self.balls.iter().zip(&mut self.small).take(count) {
            *small = tester.small(balls) as u8;
        }
    }

    #[inline]
    fn volumes(&mut self, tester: &Tester, groups: &[Group], cut: &mut Cut) {
        let lanes = self.balls.iter().zip(&mut self.inside);
        for ((group, (balls, inside)), kept) in groups.iter().zip(lanes).zip(&mut self.kept) {
            // Foreseen well: what is at the edge of the view volume lies together.
            if !group.inherits(INSIDE) {
                let (outside, wholly) = tester.volume(balls);
                cut.stats.outside += u64::from(bits(outside as u8 & *kept));
                *kept &= !outside as u8;
                *inside = wholly as u8;
            }
        }
    }

    #[inline]
    fn cones(
        &mut self,
        tester: &Tester,
        groups: &[Group],
        mut prefetch: impl FnMut(),
        cut: &mut Cut,
    ) {
        self.listed.clear();
        for (((group, words), &kept), index) in
            groups.iter().zip(&self.words).zip(&self.kept).zip(0..)
        {
            // On a rough surface most cones above the lowest levels are too wide to decide anything.
            let is_asked = !group.inherits(FRONT) & (kept != 0) & words.has_cones();
            self.listed.push_if(is_asked, index);
        }
        let mut dropped = 0;
        for &index in self.listed.as_slice() {
            let i = index as usize % SIZE;
            let words = &self.words[i];
            prefetch();
            let (away, front) = tester.cones(&self.balls[i], words.axis(), words.sine());
            dropped += bits(away as u8 & self.kept[i]);
            self.kept[i] &= !away as u8;
            self.front[i] = front as u8;
        }
        cut.stats.facing_away += u64::from(dropped);
    }

    /// Lists the nodes that are rows.
    #[inline]
    fn rows(&mut self, tester: &Tester, groups: &[Group], mut prefetch: impl FnMut()) {
        self.listed.clear();
        let masks = self.kept.iter().zip(&self.small);
        for ((&kept, &small), index) in masks.zip(0..).take(groups.len()) {
            self.listed.push_if(kept & !small != 0, index);
        }
        self.likely.clear();
        for &index in self.listed.as_slice() {
            let i = index as usize % SIZE;
            let (Some(group), balls, words) = (groups.get(i), &self.balls[i], &self.words[i])
            else {
                continue;
            };
            prefetch();
            let most = tester.most_in_row(group.first, words);
            let likely = tester.may_be_rows(balls, words, most) as u8;
            self.rows[i] = likely & self.kept[i] & !self.small[i];
            self.likely.push_if(self.rows[i] != 0, index);
        }
        for &index in self.likely.as_slice() {
            let i = index as usize % SIZE;
            let (Some(group), balls, words) = (groups.get(i), &self.balls[i], &self.words[i])
            else {
                continue;
            };
            prefetch();
            let most = tester.most_in_row(group.first, words);
            let (counts, fits) = tester.rows(balls, words, most);
            self.rows[i] &= fits as u8;
            self.counts[i] = counts;
            self.runs.push_lanes(group.first, counts, self.rows[i]);
        }
    }

    #[inline]
    fn emit_nodes(
        &mut self,
        groups: &[Group],
        mut prefetch: impl FnMut(),
        cut: &mut Cut,
        open: &mut Vec<Group>,
    ) {
        self.listed.clear();
        let masks = self.kept.iter().zip(&self.small).zip(&self.rows);
        for ((group, ((&kept, &small), &rows)), index) in groups.iter().zip(masks).zip(0..) {
            prefetch();
            self.ids.push_lanes(group.first, kept & small);
            self.listed.push_if(kept & !small & !rows != 0, index);
        }
        self.ids.flush(&mut cut.nodes);
        let mut end = open.len();
        open.resize(end + 4 * self.listed.len, Group::default());
        for &index in self.listed.as_slice() {
            let i = index as usize % SIZE;
            let Some(group) = groups.get(i) else { continue };
            prefetch();
            let mut mask = self.kept[i] & !self.small[i] & !self.rows[i];
            let (mut inside, mut front) = (u32::from(self.inside[i]), u32::from(self.front[i]));
            let inherited = group.word & !0xff;
            let words = &self.words[i];
            for (first, count) in words.first_child.into_iter().zip(words.child_counts()) {
                let found = (inside & 1) * INSIDE + (front & 1) * FRONT;
                let word = count | inherited | found;
                if let Some(place) = open.get_mut(end) {
                    *place = Group { first, word };
                }
                end += usize::from(mask & 1);
                mask >>= 1;
                inside >>= 1;
                front >>= 1;
            }
        }
        open.truncate(end);
    }

    /// The same for groups of leaves, all of which are drawn or dropped.
    pub(super) fn leaves(
        &mut self,
        model: &Model,
        tester: &Tester,
        (groups, ahead): (&[Group], &[Group]),
        hiding: Option<&Hiding<'_>>,
        (cut, marks): (&mut Cut, &mut Marks),
    ) {
        self.gather_leaves(&model.tree.leaves, tester, (groups, ahead), cut);
        self.volumes(tester, groups, cut);
        // Sides take vertices, so they are asked for last where most leaves are far smaller than a pixel.
        let (before, after) = match hiding {
            Some(hiding) if hiding.is_exact() => (Some(hiding), None),
            _ => (None, hiding),
        };
        if let Some(hiding) = before {
            self.drop_between(hiding, groups.len(), cut);
        }
        self.faces(model, tester, groups, cut);
        self.draw_leaves(model, after, hiding, groups, (cut, marks));
    }

    /// Draws the leaves that are kept, less what is hidden.
    fn draw_leaves(
        &mut self,
        model: &Model,
        between: Option<&Hiding<'_>>,
        hiding: Option<&Hiding<'_>>,
        groups: &[Group],
        (cut, marks): (&mut Cut, &mut Marks),
    ) {
        if let Some(hiding) = between {
            self.drop_between(hiding, groups.len(), cut);
        }
        // A point has no triangle: large or small, it is a splat.
        let always = if model.triangles.is_empty() { 15 } else { 0 };
        if let Some(hiding) = hiding {
            self.hide_leaves(hiding, groups, always, marks, cut);
        }
        for ((group, &kept), &small) in groups.iter().zip(&self.kept).zip(&self.small) {
            let splats = kept & (small | always);
            self.ids.push_lanes(group.first, splats);
            self.triangles.push_lanes(group.first, kept & !splats);
        }
        self.ids.flush(&mut cut.leaves);
        self.triangles.flush(&mut cut.triangles);
    }

    #[inline]
    fn gather_leaves(
        &mut self,
        leaves: &[Leaf],
        tester: &Tester,
        (groups, ahead): (&[Group], &[Group]),
        cut: &mut Cut,
    ) {
        let mut ahead = ahead.iter();
        let mut visited = 0;
        let lanes = self.balls.iter_mut().zip(&mut self.small);
        for ((group, (balls, small)), kept) in groups.iter().zip(lanes).zip(&mut self.kept) {
            if let Some(group) = ahead.next() {
                prefetch_index(leaves, group.first as usize);
                prefetch_index(leaves, group.first as usize + 3);
            }
            let (spheres, count) = four_leaves(leaves, *group);
            *balls = tester.balls(spheres);
            *small = tester.small(balls) as u8;
            *kept = (1u8 << count) - 1;
            visited += count;
        }
        cut.stats.visited += u64::from(visited);
    }

    /// Drops the leaves that face away.
    #[inline]
    fn faces(&mut self, model: &Model, tester: &Tester, groups: &[Group], cut: &mut Cut) {
        self.faces.clear();
        self.places.clear();
        for ((group, &kept), place) in groups.iter().zip(&self.kept).zip((0..).step_by(4)) {
            if !group.inherits(FRONT) {
                self.faces.push_lanes(group.first, kept);
                self.places.push_lanes(place, kept);
            }
        }
        let (leaves, places) = (self.faces.as_slice(), self.places.as_slice());
        let kept = &mut self.kept;
        let mut drop = |place: u32, is_away: bool| {
            kept[place as usize / 4 % SIZE] &= !(u8::from(is_away) << (place % 4));
            cut.stats.facing_away += u64::from(is_away);
        };
        if model.triangles.is_empty() {
            for (&leaf, &place) in leaves.iter().zip(places) {
                drop(place, tester.leaf_faces_away(model, leaf));
            }
            return;
        }
        // All corners are asked for before the first is used. What does not exist is not a number, which
        // single precision cannot tell from edge-on.
        for (&leaf, corners) in leaves.iter().zip(&mut self.corners) {
            *corners = match model.triangles.get(leaf as usize) {
                Some(&triangle) => triangle,
                None => [u32::MAX; 3],
            };
            for &vertex in &*corners {
                prefetch_index(model.vertices.as_slice(), vertex as usize);
            }
        }
        let fours = leaves.chunks(4).zip(places.chunks(4));
        for ((leaves, places), &corners) in fours.zip(self.corners.as_chunks::<4>().0) {
            let (away, unsure) =
                tester.triangles_face_away(&Tester::corners(&model.vertices, corners));
            for ((&leaf, &place), lane) in leaves.iter().zip(places).zip(0..) {
                if unsure >> lane & 1 != 0 {
                    drop(place, tester.leaf_faces_away(model, leaf));
                } else {
                    drop(place, away >> lane & 1 != 0);
                }
            }
        }
    }
}
