//! What was found out about a group of siblings, kept from frame to frame.

use super::{Batch, FRONT, Group, INSIDE, SIZE, bits, four_leaves, four_nodes};
use crate::cut::Cut;
use crate::cut::motion::Reading;
use crate::cut::nearest::{Hiding, Marks};
use crate::cut::slack::{FOREVER, of_lanes};
use crate::cut::tester::Tester;
use crate::tree::{Leaf, Model, Node};
use glam::Vec4;
use prefetch_index::prefetch_index;

/// The answers about a group of siblings, all that follows from them, and until when they hold. Of leaves there are no
/// children and no rows.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::cut) struct Record {
    pub(in crate::cut) group: Group,
    /// The first child of the first sibling. Those of the others follow without gaps, as [`crate::tree::check`] demands.
    children: u32,
    /// Masks of four bits: [`KEPT`] and so on.
    masks: u32,
    /// How many children each has, 3 bits; above these, of how many splats each row is, 5 bits.
    counts: u32,
    /// Readings of the region's odometer and of the eye's up to which all this holds.
    by_place: f32,
    by_eye: f32,
}

const KEPT: u32 = 0;
const SMALL: u32 = 4;
const IN_SIDE: u32 = 8;
const FACES: u32 = 12;
const ROWS: u32 = 16;
const OUTSIDE: u32 = 20;
const AWAY: u32 = 24;

impl Record {
    /// Whether the answers about `group` still hold.
    #[inline]
    pub(in crate::cut) fn holds(&self, group: Group, readings: &[Reading]) -> bool {
        let Some(reading) = readings.get(group.region()) else {
            return false;
        };
        let [place, eye] = reading.now(group.inherits(INSIDE));
        // Not where any is no number.
        self.group == group && place <= self.by_place && eye <= self.by_eye
    }

    #[inline]
    fn mask(&self, which: u32) -> u8 {
        (self.masks >> which) as u8 & 15
    }

    /// Nodes that are to be opened.
    #[inline]
    fn opened(&self) -> u8 {
        self.mask(KEPT) & !self.mask(SMALL) & !self.mask(ROWS)
    }

    #[inline]
    fn row_counts(&self) -> [u32; 4] {
        [12, 17, 22, 27].map(|shift| self.counts >> shift & 31)
    }

    fn count_in(&self, cut: &mut Cut) {
        cut.stats.visited += u64::from(self.group.count());
        cut.stats.outside += u64::from(bits(self.mask(OUTSIDE)));
        cut.stats.facing_away += u64::from(bits(self.mask(AWAY)));
    }
}

/// What decides about nodes, and the odometers.
#[derive(Debug, Clone, Copy)]
pub(in crate::cut) struct Task<'a> {
    pub(in crate::cut) model: &'a Model,
    pub(in crate::cut) tester: &'a Tester,
    pub(in crate::cut) hiding: Option<&'a Hiding<'a>>,
    pub(in crate::cut) readings: &'a [Reading],
}

impl Task<'_> {
    /// Until when bounds of changes of places and of ways of the eye (tester's unit) hold. Never where a center
    /// is not in the region's ball, whose odometer then says nothing: `centers` of the siblings in `there`.
    #[inline]
    fn expiry(&self, group: Group, centers: [Vec4; 3], there: u8, bounds: [Vec4; 2]) -> [f32; 2] {
        let tester = self.tester;
        let Some(reading) = self.readings.get(group.region()) else {
            return [f32::NEG_INFINITY; 2];
        };
        let middle = (reading.center - tester.reference) * tester.unit;
        let way = [
            centers[0] - middle.x,
            centers[1] - middle.y,
            centers[2] - middle.z,
        ];
        let squared = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
        let radius = reading.radius * tester.unit;
        let is_in = squared.cmple(Vec4::splat(radius * radius * 0.999));
        if there & !(is_in.bitmask() as u8) != 0 {
            return [f32::NEG_INFINITY; 2];
        }
        let [place, eye] = bounds.map(|bounds| bounds.min_element() / tester.unit);
        let from = reading.from(group.inherits(INSIDE));
        [from[0] + place, from[1] + eye]
    }
}

impl Batch {
    /// Tests groups of nodes (at most [`SIZE`]); `answer` takes their records one after the other. Their nodes should be on
    /// their way.
    pub(in crate::cut) fn test_nodes(
        &mut self,
        task: &Task<'_>,
        groups: &[Group],
        mut answer: impl FnMut(Record),
    ) {
        let Task { model, tester, .. } = *task;
        let nodes: &[Node] = &model.tree.nodes;
        // What is counted here is counted again with the answers.
        let cut = &mut Cut::default();
        self.gather_nodes(nodes, tester, groups, || (), cut);
        let there = self.kept;
        self.sizes(tester, groups.len());
        self.volumes(tester, groups, cut);
        let in_view = self.kept;
        self.cones(tester, groups, || (), cut);
        self.rows(tester, groups, || ());
        self.runs.clear();
        for (i, &group) in groups.iter().enumerate().take(SIZE) {
            let (balls, words) = (&self.balls[i], &self.words[i]);
            let (kept, small, rows) = (self.kept[i], self.small[i], self.rows[i]);
            let opened = kept & !small & !rows;
            let mut place = of_lanes(tester.small_slack(balls), kept);
            if !group.inherits(INSIDE) {
                place = place.min(of_lanes(tester.volume_slack(balls), there[i]));
            }
            if kept & !small != 0 {
                let most = tester.most_in_row(group.first, words);
                let (bounds, may) = tester.may_be_rows_slack(balls, words, most);
                place = place.min(of_lanes(bounds, kept & !small));
                let may = may & kept & !small | rows;
                if may != 0 {
                    let bounds = tester.rows_slack(balls, words, most, rows);
                    place = place.min(of_lanes(bounds, may));
                }
            }
            let eye = if !group.inherits(FRONT) && words.has_cones() {
                of_lanes(tester.cones_slack(balls, words, opened), in_view[i])
            } else {
                FOREVER
            };
            let [by_place, by_eye] = task.expiry(group, balls.center, there[i], [place, eye]);
            let child_counts = words.child_counts().map(|count| count.min(7));
            let [a, b, c, d] = child_counts;
            let mut counts = a | b << 3 | c << 6 | d << 9;
            if rows != 0 {
                for (count, shift) in self.counts[i].iter().zip([12, 17, 22, 27]) {
                    counts |= (count & 31) << shift;
                }
            }
            answer(Record {
                group,
                children: words.first_child[0],
                masks: u32::from(kept) << KEPT
                    | u32::from(small) << SMALL
                    | u32::from(self.inside[i] & 15) << IN_SIDE
                    | u32::from(self.front[i] & 15) << FACES
                    | u32::from(rows) << ROWS
                    | u32::from(there[i] & !in_view[i]) << OUTSIDE
                    | u32::from(in_view[i] & !kept) << AWAY,
                counts,
                by_place,
                by_eye,
            });
        }
    }

    /// The same for groups of leaves.
    pub(in crate::cut) fn test_leaves(
        &mut self,
        task: &Task<'_>,
        groups: &[Group],
        mut answer: impl FnMut(Record),
    ) {
        let Task { model, tester, .. } = *task;
        let cut = &mut Cut::default();
        self.gather_leaves(&model.tree.leaves, tester, (groups, &[]), cut);
        let there = self.kept;
        self.volumes(tester, groups, cut);
        let in_view = self.kept;
        self.faces(model, tester, groups, cut);
        for (i, &group) in groups.iter().enumerate().take(SIZE) {
            let balls = &self.balls[i];
            let (kept, small) = (self.kept[i], self.small[i]);
            let mut place = of_lanes(tester.small_slack(balls), kept);
            if !group.inherits(INSIDE) {
                place = place.min(of_lanes(tester.volume_slack(balls), there[i]));
            }
            let mut eye = FOREVER;
            if !group.inherits(FRONT) && in_view[i] != 0 {
                let corners = [0, 1, 2, 3].map(|lane| {
                    let triangle = group.first.wrapping_add(lane) as usize;
                    model.triangles.get(triangle).copied()
                });
                // Of points nothing is known here.
                let corners = corners.map(|corners| corners.unwrap_or([u32::MAX; 3]));
                let corners = Tester::corners(&model.vertices, corners);
                eye = of_lanes(tester.sides_slack(&corners), in_view[i]);
            }
            let [by_place, by_eye] = task.expiry(group, balls.center, there[i], [place, eye]);
            answer(Record {
                group,
                masks: u32::from(kept) << KEPT
                    | u32::from(small) << SMALL
                    | u32::from(there[i] & !in_view[i]) << OUTSIDE
                    | u32::from(in_view[i] & !kept) << AWAY,
                by_place,
                by_eye,
                ..Record::default()
            });
        }
    }

    /// Draws what records (at most [`SIZE`]) say of nodes; appends the children of what is to be opened to `open`.
    pub(in crate::cut) fn take_nodes(
        &mut self,
        task: &Task<'_>,
        (records, ahead): (&[Record], &[Record]),
        (cut, marks): (&mut Cut, &mut Marks),
        open: &mut Vec<Group>,
    ) {
        let hiding = task.hiding.filter(|hiding| hiding.asks_splats());
        if let Some(hiding) = hiding {
            self.take_seen_nodes(task, hiding, (records, ahead), (&mut *cut, marks));
        }
        self.listed.clear();
        for (record, index) in records.iter().zip(0..) {
            record.count_in(cut);
            self.listed.push_if(record.opened() != 0, index);
            if hiding.is_none() {
                let (first, rows) = (record.group.first, record.mask(ROWS));
                self.ids
                    .push_lanes(first, record.mask(KEPT) & record.mask(SMALL));
                if rows != 0 {
                    self.runs.push_lanes(first, record.row_counts(), rows);
                }
            }
        }
        if hiding.is_none() {
            self.runs.flush(&mut cut.strips);
        }
        self.ids.flush(&mut cut.nodes);
        let mut end = open.len();
        open.resize(end + 4 * self.listed.len, Group::default());
        for &index in self.listed.as_slice() {
            let Some(record) = records.get(usize::from(index)) else {
                continue;
            };
            let (mut mask, mut first) = (record.opened(), record.children);
            let mut inside = u32::from(record.mask(IN_SIDE));
            let mut front = u32::from(record.mask(FACES));
            let inherited = record.group.word & !0xff;
            for shift in [0, 3, 6, 9] {
                let count = record.counts >> shift & 7;
                let found = (inside & 1) * INSIDE + (front & 1) * FRONT;
                if let Some(place) = open.get_mut(end) {
                    let word = count | inherited | found;
                    *place = Group { first, word };
                }
                first = first.wrapping_add(count);
                end += usize::from(mask & 1);
                mask >>= 1;
                inside >>= 1;
                front >>= 1;
            }
        }
        open.truncate(end);
    }

    /// Lists what records say is drawn, less what is hidden: rows in the cut, of nodes the ids.
    fn take_seen_nodes(
        &mut self,
        task: &Task<'_>,
        hiding: &Hiding<'_>,
        (records, ahead): (&[Record], &[Record]),
        (cut, marks): (&mut Cut, &mut Marks),
    ) {
        let Task { model, tester, .. } = *task;
        let nodes: &[Node] = &model.tree.nodes;
        let drawn = |record: &Record| record.mask(KEPT) & (record.mask(SMALL) | record.mask(ROWS));
        let mut ahead = ahead.iter();
        let mut groups = [Group::default(); SIZE];
        self.likely.clear();
        self.runs.clear();
        for (i, record) in records.iter().enumerate().take(SIZE) {
            if let Some(next) = ahead.next()
                && drawn(next) != 0
            {
                prefetch_index(nodes, next.group.first as usize);
                prefetch_index(nodes, next.group.first as usize + 2);
            }
            groups[i] = record.group;
            let rows = record.mask(ROWS);
            (self.kept[i], self.small[i], self.rows[i]) =
                (record.mask(KEPT), record.mask(SMALL), rows);
            if drawn(record) != 0 {
                let (spheres, words, _) = four_nodes(nodes, record.group);
                self.balls[i] = tester.balls(spheres);
                self.words[i] = words;
                self.likely.push_if(rows != 0, i as u8);
                if rows != 0 {
                    self.runs
                        .push_lanes(record.group.first, record.row_counts(), rows);
                }
            }
        }
        let groups = groups.get(..records.len()).unwrap_or_default();
        self.hide_rows(hiding, tester, marks, cut);
        self.hide_nodes(hiding, groups, marks, cut);
        let masks = self.kept.iter().zip(&self.small);
        for (group, (&kept, &small)) in groups.iter().zip(masks) {
            self.ids.push_lanes(group.first, kept & small);
        }
    }

    /// Draws what records say of leaves.
    pub(in crate::cut) fn take_leaves(
        &mut self,
        task: &Task<'_>,
        (records, ahead): (&[Record], &[Record]),
        (cut, marks): (&mut Cut, &mut Marks),
    ) {
        let Task { model, tester, .. } = *task;
        let leaves: &[Leaf] = &model.tree.leaves;
        let mut ahead = ahead.iter();
        let mut groups = [Group::default(); SIZE];
        for (i, record) in records.iter().enumerate().take(SIZE) {
            record.count_in(cut);
            groups[i] = record.group;
            (self.kept[i], self.small[i]) = (record.mask(KEPT), record.mask(SMALL));
            if task.hiding.is_some() {
                if let Some(next) = ahead.next()
                    && next.mask(KEPT) != 0
                {
                    prefetch_index(leaves, next.group.first as usize);
                    prefetch_index(leaves, next.group.first as usize + 3);
                }
                if self.kept[i] != 0 {
                    self.balls[i] = tester.balls(four_leaves(leaves, record.group).0);
                }
            }
        }
        let groups = groups.get(..records.len()).unwrap_or_default();
        self.draw_leaves(model, task.hiding, task.hiding, groups, (cut, marks));
    }
}
