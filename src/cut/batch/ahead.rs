//! Nodes that are looked at next, asked of memory meanwhile.

use crate::cut::batch::{SIZE, SiblingGroup};
use crate::tree::Node;
use prefetch_index::prefetch_index;

/// The groups of the next batch. Only so many requests may be on their way at once, and one more waits for its place; so they
/// are made a few at a time wherever there is work between them.
pub(super) struct PrefetchAhead<'a> {
    nodes: &'a [Node],
    groups: std::slice::Iter<'a, SiblingGroup>,
}

impl<'a> PrefetchAhead<'a> {
    /// Of the groups that come next.
    #[inline(always)]
    pub(super) fn new(nodes: &'a [Node], groups: &'a [SiblingGroup]) -> Self {
        let groups = groups.get(..SIZE).unwrap_or(groups).iter();
        Self { nodes, groups }
    }

    /// Nothing comes next.
    #[inline(always)]
    pub(super) fn none() -> Self {
        Self::new(&[], &[])
    }

    /// Asks for some groups. Four nodes lie on two lines (see `tree::AlignedRecords`).
    #[inline(always)]
    pub(super) fn ask(&mut self, count: usize) {
        for next in self.groups.by_ref().take(count) {
            prefetch_index(self.nodes, next.first as usize);
            prefetch_index(self.nodes, next.first as usize + 2);
        }
    }

    /// Asks for so many before each 16 lanes, where lane `at` comes now.
    #[inline(always)]
    pub(super) fn ask_each(&mut self, at: usize, count: usize) {
        if at.is_multiple_of(16) {
            self.ask(count);
        }
    }

    /// Asks for all that are left.
    #[inline(always)]
    pub(super) fn ask_rest(&mut self) {
        self.ask(SIZE);
    }
}
