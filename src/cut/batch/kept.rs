//! What was found out about a group of siblings, kept from frame to frame.

use crate::cut::batch::ahead::Ahead;
use crate::cut::batch::{Batch, Counts, FRONT, Group, INSIDE, LANES, Mask, SIZE, Verdicts, four};
use crate::cut::frustum_and_size::Tester;
use crate::cut::motion::Reading;
use crate::cut::occlusion::{Hiding, Marks};
use crate::cut::siblings;
use crate::cut::slack::{FOREVER, of_lanes};
use crate::cut::{Cut, StripRun};
use crate::tree::{Leaf, Model, Node};
use fearless_simd::dispatch;
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
        let counts = Counts {
            visited: self.group.count(),
            outside: self.mask(OUTSIDE).count_ones(),
            away: self.mask(AWAY).count_ones(),
            behind: 0,
        };
        counts.add_to(cut);
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
    pub(in crate::cut) fn test_kept_nodes(
        &mut self,
        task: &Task<'_>,
        groups: &[Group],
        mut answer: impl FnMut(Record),
    ) {
        let Task { model, tester, .. } = *task;
        let nodes: &[Node] = &model.tree.nodes;
        let ahead = &mut Ahead::none();
        self.load_nodes(nodes, groups, (ahead, 0));
        let there = self.verdicts.kept;
        // What is counted here is counted again with the answers.
        dispatch!(self.level, simd => {
            self.test_nodes(simd, tester, groups, None, (ahead, 0));
        });
        let verdicts = self.verdicts;
        for (i, &group) in groups.iter().enumerate().take(SIZE) {
            let (balls, words) = (self.siblings.four_balls(i), self.siblings.four_words(i));
            let (balls, words) = (&balls, &words);
            let Answers {
                there,
                in_view,
                kept,
                small,
                rows,
            } = Answers::of(&verdicts, there, i);
            let opened = kept & !small & !rows;
            let mut place = of_lanes(tester.small_slack(balls), kept);
            if !group.inherits(INSIDE) {
                place = place.min(of_lanes(tester.volume_slack(balls), there));
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
            let eye = if !group.inherits(FRONT) && tester.may_cull(words.sine()) != 0 {
                of_lanes(tester.cones_slack(balls, words, opened), in_view)
            } else {
                FOREVER
            };
            let [by_place, by_eye] = task.expiry(group, balls.center, there, [place, eye]);
            let children = [0, 1, 2, 3].map(|lane| self.siblings.children(4 * i + lane));
            let [a, b, c, d] = children.map(|(_, count)| count.min(7));
            let mut counts = a | b << 3 | c << 6 | d << 9;
            if rows != 0 {
                for (shift, lane) in [12, 17, 22, 27].into_iter().zip(4 * i..) {
                    counts |= (self.counts[lane % LANES] & 31) << shift;
                }
            }
            answer(Record {
                group,
                children: children[0].0,
                masks: u32::from(kept) << KEPT
                    | u32::from(small) << SMALL
                    | u32::from(verdicts.inside.four(i)) << IN_SIDE
                    | u32::from(verdicts.front.four(i)) << FACES
                    | u32::from(rows) << ROWS
                    | u32::from(there & !in_view) << OUTSIDE
                    | u32::from(in_view & !kept) << AWAY,
                counts,
                by_place,
                by_eye,
            });
        }
    }

    /// The same for groups of leaves.
    pub(in crate::cut) fn test_kept_leaves(
        &mut self,
        task: &Task<'_>,
        groups: &[Group],
        mut answer: impl FnMut(Record),
    ) {
        let Task { model, tester, .. } = *task;
        self.load_leaves(&model.tree.leaves, groups, &[]);
        let there = self.verdicts.kept;
        dispatch!(self.level, simd => {
            self.test_leaves(simd, tester, groups);
        });
        self.verdicts.in_view = self.verdicts.kept;
        self.drop_away(model, tester);
        let verdicts = self.verdicts;
        for (i, &group) in groups.iter().enumerate().take(SIZE) {
            let balls = &self.siblings.four_balls(i);
            let Answers {
                there,
                in_view,
                kept,
                small,
                ..
            } = Answers::of(&verdicts, there, i);
            let mut place = of_lanes(tester.small_slack(balls), kept);
            if !group.inherits(INSIDE) {
                place = place.min(of_lanes(tester.volume_slack(balls), there));
            }
            let mut eye = FOREVER;
            if !group.inherits(FRONT) && in_view != 0 {
                let corners = [0, 1, 2, 3].map(|lane| {
                    let triangle = group.first.wrapping_add(lane) as usize;
                    model.triangles.get(triangle).copied()
                });
                // Of points nothing is known here.
                let corners = corners.map(|corners| corners.unwrap_or([u32::MAX; 3]));
                let corners = Tester::corners(&model.vertices, corners);
                eye = of_lanes(tester.sides_slack(&corners), in_view);
            }
            let [by_place, by_eye] = task.expiry(group, balls.center, there, [place, eye]);
            answer(Record {
                group,
                masks: u32::from(kept) << KEPT
                    | u32::from(small) << SMALL
                    | u32::from(there & !in_view) << OUTSIDE
                    | u32::from(in_view & !kept) << AWAY,
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
        let groups = &self.take_verdicts(records);
        let groups = groups.get(..records.len()).unwrap_or_default();
        let Verdicts { small, rows, .. } = self.verdicts;
        match task.hiding.filter(|hiding| hiding.asks_splats()) {
            Some(hiding) => {
                self.take_siblings(task, (records, ahead));
                dispatch!(self.level, simd => {
                    let ahead = &mut Ahead::none();
                    self.hide_rows(simd, (hiding, task.tester), groups, (marks, cut), ahead);
                    self.hide_nodes(simd, hiding, groups, (marks, cut), ahead);
                });
            }
            None => {
                for lane in rows.lanes() {
                    let run = StripRun::new(self.siblings.number(lane), self.counts[lane % LANES]);
                    cut.strips.push(run);
                }
            }
        }
        let drawn = self.verdicts.kept & small;
        dispatch!(self.level, simd => self.siblings.push(simd, &mut cut.nodes, drawn));
        for record in records {
            record.count_in(cut);
            let (mut mask, mut first) = (record.opened(), record.children);
            let mut inside = u32::from(record.mask(IN_SIDE));
            let mut front = u32::from(record.mask(FACES));
            let inherited = record.group.word & !0xff;
            for shift in [0, 3, 6, 9] {
                let count = record.counts >> shift & 7;
                if mask & 1 != 0 {
                    let found = (inside & 1) * INSIDE + (front & 1) * FRONT;
                    let word = count | inherited | found;
                    open.push(Group { first, word });
                }
                first = first.wrapping_add(count);
                mask >>= 1;
                inside >>= 1;
                front >>= 1;
            }
        }
    }

    /// The batch becomes what records say; their groups.
    fn take_verdicts(&mut self, records: &[Record]) -> [Group; SIZE] {
        let mut groups = [Group::default(); SIZE];
        let mut verdicts = Verdicts::default();
        for (i, (record, group)) in records.iter().zip(&mut groups).enumerate() {
            *group = record.group;
            self.siblings.put_group(i, record.group);
            let at = 4 * i;
            verdicts.kept.add(at, u32::from(record.mask(KEPT)));
            verdicts.small.add(at, u32::from(record.mask(SMALL)));
            let rows = record.mask(ROWS);
            verdicts.rows.add(at, u32::from(rows));
            if rows != 0 {
                for (count, lane) in record.row_counts().into_iter().zip(at..) {
                    self.counts[lane % LANES] = count;
                }
            }
        }
        self.verdicts = verdicts;
        groups
    }

    /// Loads the nodes that records draw, which are looked at once more.
    fn take_siblings(&mut self, task: &Task<'_>, (records, ahead): (&[Record], &[Record])) {
        let Task { model, tester, .. } = *task;
        let nodes: &[Node] = &model.tree.nodes;
        let drawn = |record: &Record| record.mask(KEPT) & (record.mask(SMALL) | record.mask(ROWS));
        let mut ahead = ahead.iter();
        for (i, record) in records.iter().enumerate().take(SIZE) {
            if let Some(next) = ahead.next()
                && drawn(next) != 0
            {
                prefetch_index(nodes, next.group.first as usize);
                prefetch_index(nodes, next.group.first as usize + 2);
            }
            if drawn(record) != 0 {
                let (four, _) = four(nodes, record.group);
                let (spheres, words) = siblings::of_nodes(&four);
                self.siblings.put_four_balls(i, &tester.balls(spheres));
                self.siblings.put_words(i, words);
            }
        }
    }

    /// Draws what records say of leaves.
    pub(in crate::cut) fn take_leaves(
        &mut self,
        task: &Task<'_>,
        (records, ahead): (&[Record], &[Record]),
        found: (&mut Cut, &mut Marks),
    ) {
        let Task { model, tester, .. } = *task;
        let leaves: &[Leaf] = &model.tree.leaves;
        let mut ahead = ahead.iter();
        let groups = &self.take_verdicts(records);
        for (i, record) in records.iter().enumerate().take(SIZE) {
            record.count_in(found.0);
            if task.hiding.is_some() {
                if let Some(next) = ahead.next()
                    && next.mask(KEPT) != 0
                {
                    prefetch_index(leaves, next.group.first as usize);
                    prefetch_index(leaves, next.group.first as usize + 3);
                }
                if record.mask(KEPT) != 0 {
                    let (four, _) = four(leaves, record.group);
                    let balls = tester.balls(siblings::of_leaves(&four));
                    self.siblings.put_four_balls(i, &balls);
                }
            }
        }
        let groups = groups.get(..records.len()).unwrap_or_default();
        dispatch!(self.level, simd => {
            self.draw_leaves(simd, model, (task.hiding, task.hiding), groups, found);
        });
    }
}

/// The answers about the siblings of one group.
struct Answers {
    there: u8,
    in_view: u8,
    kept: u8,
    small: u8,
    rows: u8,
}

impl Answers {
    fn of(verdicts: &Verdicts, there: Mask, group: usize) -> Self {
        Self {
            there: there.four(group),
            in_view: verdicts.in_view.four(group),
            kept: verdicts.kept.four(group),
            small: verdicts.small.four(group),
            rows: verdicts.rows.four(group),
        }
    }
}
