//! The cut from the root: depth-first, front to back in tree order.
//!
//! Source: Benda, *Point Based Rendering*, sections 3.3 and 3.3.1: an invisible node is dropped, a small node
//! is a splat (a small leaf too: the text's order, not the pseudocode's), a large leaf is its triangle, and
//! of a large node the children are looked at. Deviations: children are tested together, tests that passed
//! for all of a node are not repeated below it, and needles may be drawn as rows of splats ([`super::strip`]).

use super::class::{Class, inherit};
use super::tester::Tester;
use super::{Cut, Settings, StripRun};
use crate::math::camera::View;
use crate::tree::{Model, Node};

/// Stopping siblings: the children `first .. first + count` of `parent` are where a traversal stopped, drawn
/// or not. Nodes, or leaves if the parent has leaves; `parent` is [`Run::ROOT`] for what has no parent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Run {
    pub(super) parent: u32,
    pub(super) first: u32,
    pub(super) count: u32,
}

impl Run {
    /// No parent: the run is the root node, or the only leaf of a tree without nodes.
    pub(super) const ROOT: u32 = u32::MAX;
}

/// Keeps where a traversal stopped, in tree order.
pub(super) trait Record {
    /// Whether [`Record::stop`] does anything, so that a traversal need not bring it invisible nodes.
    const ACTIVE: bool;
    /// The traversal stopped at these siblings.
    fn stop(&mut self, parent: u32, first: u32, count: u32);
}

/// Keeps nothing.
pub(super) struct Forget;

impl Record for Forget {
    const ACTIVE: bool = false;
    #[inline]
    fn stop(&mut self, _parent: u32, _first: u32, _count: u32) {}
}

impl Record for &mut Vec<Run> {
    const ACTIVE: bool = true;
    #[inline]
    fn stop(&mut self, parent: u32, first: u32, count: u32) {
        match self.last_mut() {
            Some(run) if run.parent == parent && run.first + run.count == first => {
                run.count += count
            }
            _ => self.push(Run {
                parent,
                first,
                count,
            }),
        }
    }
}

/// Appends `first + i` for the bits i of `mask` (4 of them), lowest first.
///
/// Writes all four and takes back what is too much: which lanes are set cannot be foreseen on a real surface,
/// and a wrong guess of the processor costs more than the store.
#[inline]
fn append(list: &mut Vec<u32>, first: u32, mask: u32) {
    const LANES: [[u32; 4]; 16] = {
        let mut table = [[0; 4]; 16];
        let mut mask = 0;
        while mask < 16 {
            let (mut lane, mut count) = (0, 0);
            while lane < 4 {
                if mask >> lane & 1 != 0 {
                    table[mask][count] = lane;
                    count += 1;
                }
                lane += 1;
            }
            mask += 1;
        }
        table
    };
    let end = list.len() + (mask & 15).count_ones() as usize;
    list.extend_from_slice(&LANES[(mask & 15) as usize].map(|lane| first.wrapping_add(lane)));
    list.truncate(end);
}

/// A node whose turn has not come.
#[derive(Debug, Clone, Copy)]
pub(super) struct Item {
    id: u32,
    class: Class,
}

/// One traversal: what it reads, and what it appends to.
pub(super) struct Walk<'a, R> {
    pub(super) model: &'a Model,
    pub(super) tester: &'a Tester,
    pub(super) cut: &'a mut Cut,
    pub(super) stack: &'a mut Vec<Item>,
    pub(super) record: R,
}

impl<R: Record> Walk<'_, R> {
    /// The cut of the whole tree.
    pub(super) fn root(&mut self) {
        let start = self.tester.start();
        if self.model.tree.nodes.is_empty() {
            // A tree over one leaf (or over nothing) has no interior node.
            let count = u32::from(!self.model.tree.leaves.is_empty());
            self.leaves(Run::ROOT, 0, count, start);
            return;
        }
        let [class, ..] = self
            .tester
            .nodes(self.model, 0, 1, start, &mut self.cut.stats);
        if class.is_open() {
            self.descend(0, class.inherited());
        } else {
            self.stop(Run::ROOT, 0, class);
        }
    }

    /// The cut below the open node `id`.
    pub(super) fn descend(&mut self, id: u32, inherited: u8) {
        self.stack.clear();
        self.open(id, inherited);
        while let Some(Item { id, class }) = self.stack.pop() {
            if class.is_open() {
                self.open(id, class.inherited());
            } else {
                let parent = if R::ACTIVE { self.parent(id) } else { 0 };
                self.stop(parent, id, class);
            }
        }
    }

    #[inline]
    fn parent(&self, id: u32) -> u32 {
        self.model
            .tree
            .parents
            .get(id as usize)
            .copied()
            .unwrap_or(0)
    }

    /// Looks at the children of one node: emits those that come before the first one to be opened, and
    /// leaves the others on the stack, so that the lists stay in tree order.
    #[inline]
    fn open(&mut self, id: u32, inherited: u8) {
        let Some(&Node {
            first_child: first,
            child_count,
            flags,
            ..
        }) = self.model.tree.nodes.get(id as usize)
        else {
            return;
        };
        let count = u32::from(child_count);
        if flags & Node::LEAF_CHILDREN != 0 {
            self.leaves(id, first, count, inherited);
            return;
        }
        let classes = self
            .tester
            .nodes(self.model, first, count, inherited, &mut self.cut.stats);
        if classes == [Class::SPLAT; 4] {
            self.cut
                .nodes
                .extend_from_slice(&[first, first + 1, first + 2, first + 3]);
            self.record.stop(id, first, 4);
            return;
        }
        let count = count.min(4);
        let mut lane = 0;
        while lane < count && !classes[lane as usize].is_open() {
            self.stop(id, first + lane, classes[lane as usize]);
            lane += 1;
        }
        for later in (lane..count).rev() {
            let class = classes[later as usize];
            if R::ACTIVE || class != Class::DROP {
                self.stack.push(Item {
                    id: first + later,
                    class,
                });
            }
        }
    }

    /// The traversal ends at node `id`: draws what its class says.
    #[inline]
    pub(super) fn stop(&mut self, parent: u32, id: u32, class: Class) {
        if class == Class::SPLAT {
            self.cut.nodes.push(id);
        } else if let Some(count) = class.strip_count() {
            self.cut.strips.push(StripRun { node: id, count });
        }
        self.record.stop(parent, id, 1);
    }

    /// Draws the leaves of one parent.
    #[inline]
    pub(super) fn leaves(&mut self, parent: u32, first: u32, count: u32, inherited: u8) {
        let model = self.model;
        let (mut kept, mut small) = self.tester.leaves(
            &model.tree.leaves,
            first,
            count,
            inherited,
            &mut self.cut.stats,
        );
        if inherited & inherit::FRONT == 0 {
            for lane in 0..4 {
                if kept & (1 << lane) != 0 && self.tester.leaf_faces_away(model, first + lane) {
                    kept &= !(1 << lane);
                    self.cut.stats.facing_away += 1;
                }
            }
            small &= kept;
        }
        // A point has no triangle: large or small, it is a splat.
        if model.triangles.is_empty() {
            small = kept;
        }
        append(&mut self.cut.leaves, first, small);
        append(&mut self.cut.triangles, first, kept & !small);
        if count > 0 {
            self.record.stop(parent, first, count);
        }
    }
}

/// Selects cuts from the root and keeps its working memory from one to the next.
#[derive(Debug, Default)]
pub struct Selector {
    stack: Vec<Item>,
}

impl Selector {
    /// As [`select`], without allocating once `cut` and `self` have grown.
    pub fn select(&mut self, model: &Model, view: &View, settings: &Settings, cut: &mut Cut) {
        cut.clear();
        Walk {
            model,
            tester: &Tester::new(model, view, settings),
            cut,
            stack: &mut self.stack,
            record: Forget,
        }
        .root();
    }
}

/// Replaces `cut` by what `view` needs of `model`: every list in tree order.
///
/// Every leaf is drawn exactly once, by itself or by one node above it, unless it or a node above it was
/// dropped; what is dropped is never visible (with `cull_back`: on a closed surface). A small leaf is a splat, a large leaf a
/// triangle; a point of a cloud is always a splat. A triangle without area counts as any other (drawn, it
/// covers nothing) but faces away when `cull_back` is on. An empty model gives an empty cut.
///
/// Cost: proportional to the nodes visited, that is to what is drawn, not to the size of the model.
pub fn select(model: &Model, view: &View, settings: &Settings, cut: &mut Cut) {
    Selector::default().select(model, view, settings, cut);
}
