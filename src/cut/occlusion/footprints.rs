//! What the nodes and leaves of a cut are drawn as, as far as that decides what hides what.

use crate::cut::Cut;
use crate::tree::Model;
use rayon::prelude::*;

/// What nodes and leaves are drawn as, where what is hidden is left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SplatFootprints {
    /// Side of the squares or diameter of the discs, pixels. Up to 1 they are drawn as the pixel whose center their ball
    /// contains, if there is one (with `large_leaves` below 1, by their squares); of a cloud 1 is the least.
    pub side_px: f32,
    /// What nearer splats hide is left out; else only what contains no pixel's center, of splats only such as are a
    /// pixel at most.
    pub hides: bool,
    /// Discs instead of squares.
    pub are_discs: bool,
    /// Leaves that are larger than the threshold are splats of their own size instead of triangles.
    pub large_leaves: bool,
    /// Leaves are points, of sizes of their own.
    pub is_cloud: bool,
}

/// Nodes and leaves of a mesh that have no area: they are in cuts, and nothing is drawn for them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ZeroAreaSet {
    pub(super) nodes: Vec<u64>,
    pub(super) leaves: Vec<u64>,
}

impl ZeroAreaSet {
    /// Looks at all of a model, in parallel: a few milliseconds a million triangles.
    pub fn new(model: &Model) -> Self {
        let triangles = &model.triangles;
        if triangles.is_empty() {
            return Self::default();
        }
        let has_area = |leaf: usize| {
            let corners = triangles.get(leaf)?.map(|i| model.vertices.get(i as usize));
            let [Some(a), Some(b), Some(c)] = corners else {
                return None;
            };
            let cross = (b.position - a.position).cross(c.position - a.position);
            Some(cross.length_squared() > 0.0)
        };
        let areas = &model.tree.attributes;
        Self {
            nodes: bits(areas.len(), |node| {
                areas.get(node).is_none_or(|a| a.area == 0.0)
            }),
            leaves: bits(triangles.len(), |leaf| has_area(leaf) != Some(true)),
        }
    }

    /// How many splats of a cut are of those.
    pub fn count_in(&self, cut: &Cut) -> usize {
        let mut count = 0;
        if !self.nodes.is_empty() {
            let nodes = cut.nodes.iter().filter(|&&id| self.has_node(id));
            let rows = cut.strips.iter().filter(|row| self.has_node(row.node));
            count += nodes.count() + rows.map(|row| row.splats() as usize).sum::<usize>();
        }
        if !self.leaves.is_empty() {
            count += cut.leaves.iter().filter(|&&id| self.has_leaf(id)).count();
        }
        count
    }

    /// Tells whether a node is one of them.
    #[inline]
    pub fn has_node(&self, id: u32) -> bool {
        Self::has(&self.nodes, id)
    }

    /// Tells whether a leaf is one of them.
    #[inline]
    pub fn has_leaf(&self, id: u32) -> bool {
        Self::has(&self.leaves, id)
    }

    /// Which of the four nodes or leaves from `first` on are in their list.
    #[inline]
    pub(super) fn four(list: &[u64], first: u32) -> u8 {
        if list.is_empty() {
            return 0;
        }
        (0..4).fold(0, |mask, lane| {
            mask | u8::from(Self::has(list, first.wrapping_add(lane))) << lane
        })
    }

    /// Tells whether a node or leaf is in its list.
    #[inline]
    fn has(list: &[u64], id: u32) -> bool {
        let word = list.get(id as usize / 64);
        word.is_some_and(|word| word >> (id % 64) & 1 != 0)
    }
}

/// A bit for each of `count` items; none at all where no bit is set.
fn bits(count: usize, is_set: impl Fn(usize) -> bool + Sync) -> Vec<u64> {
    let word = |index: usize| {
        let from = 64 * index;
        (from..count.min(from + 64)).fold(0, |word, i| word | u64::from(is_set(i)) << (i - from))
    };
    let words: Vec<u64> = (0..count.div_ceil(64))
        .into_par_iter()
        .with_min_len(256)
        .map(word)
        .collect();
    if words.iter().all(|&word| word == 0) {
        return Vec::new();
    }
    words
}
