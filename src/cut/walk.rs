//! The cut below one open node, depth-first in tree order, and where it stopped: for cuts that follow a camera
//! ([`super::coherent`]). The same tests as from the root ([`super::select`]), one sibling group at a time.

use super::class::{Class, inherit};
use super::tester::Tester;
use super::{Cut, StripRun};
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

/// A node whose turn has not come.
#[derive(Debug, Clone, Copy)]
pub(super) struct Item {
    id: u32,
    class: Class,
}

/// One traversal: what it reads, and what it appends to.
pub(super) struct Walk<'a> {
    pub(super) model: &'a Model,
    pub(super) tester: &'a Tester,
    pub(super) cut: &'a mut Cut,
    pub(super) stack: &'a mut Vec<Item>,
    /// Where the traversal stopped, in tree order.
    pub(super) runs: &'a mut Vec<Run>,
}

impl Walk<'_> {
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
                let parents = &self.model.tree.parents;
                let parent = parents.get(id as usize).copied().unwrap_or(0);
                self.stop(parent, id, class);
            }
        }
    }

    /// Looks at the children of one node: emits those that come before the first one to be opened, and
    /// leaves the others on the stack, so that the runs stay in tree order.
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
        let count = count.min(4);
        let mut lane = 0;
        while lane < count && !classes[lane as usize].is_open() {
            self.stop(id, first + lane, classes[lane as usize]);
            lane += 1;
        }
        for later in (lane..count).rev() {
            self.stack.push(Item {
                id: first + later,
                class: classes[later as usize],
            });
        }
    }

    /// The traversal ends at node `id`: draws what its class says.
    #[inline]
    pub(super) fn stop(&mut self, parent: u32, id: u32, class: Class) {
        if class == Class::SPLAT {
            self.cut.nodes.push(id);
        } else if let Some(count) = class.strip_count() {
            self.cut.strips.push(StripRun::new(id, count));
        }
        self.record(parent, id, 1);
    }

    fn record(&mut self, parent: u32, first: u32, count: u32) {
        match self.runs.last_mut() {
            Some(run) if run.parent == parent && run.first + run.count == first => {
                run.count += count
            }
            _ => self.runs.push(Run {
                parent,
                first,
                count,
            }),
        }
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
        for leaf in (0..4).filter(|lane| kept & (1 << lane) != 0) {
            let list = match small & (1 << leaf) {
                0 => &mut self.cut.triangles,
                _ => &mut self.cut.leaves,
            };
            list.push(first + leaf);
        }
        if count > 0 {
            self.record(parent, first, count);
        }
    }
}
