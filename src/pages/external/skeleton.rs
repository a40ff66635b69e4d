//! The levels of the tree that are kept in memory while the chunks come and go: down to the roots of the leaf pages.

use crate::pages::page_tops::{TopSize, shared_levels};
use crate::pages::upper_tree::{join_above, linked, put};
use crate::tree::{Error, Model, NodeRecords, PartPlace, PartShape, Tree};
use glam::DVec3;
use rayon::prelude::*;

/// The box of world positions, and how far single precision would move one of them.
#[derive(Debug, Clone, Copy)]
pub(super) struct ModelBox {
    pub(super) min: DVec3,
    pub(super) max: DVec3,
    pub(super) rounding: f64,
}

impl Default for ModelBox {
    fn default() -> Self {
        Self {
            min: DVec3::INFINITY,
            max: DVec3::NEG_INFINITY,
            rounding: 0.0,
        }
    }
}

impl ModelBox {
    /// Widens the box to finite positions.
    pub(super) fn add(&mut self, places: &[DVec3]) {
        let of_one = |&p: &DVec3| Self {
            min: p,
            max: p,
            rounding: (p - p.as_vec3().as_dvec3()).abs().max_element(),
        };
        let join = |a: Self, b: Self| Self {
            min: a.min.min(b.min),
            max: a.max.max(b.max),
            rounding: a.rounding.max(b.rounding),
        };
        let found = (places.par_iter().with_min_len(1 << 14))
            .map(of_one)
            .reduce(Self::default, join);
        *self = join(*self, found);
    }
}

/// The upper levels of the tree. Its links are known from the start, its nodes come with the chunks, in their order.
#[derive(Debug)]
pub(super) struct TreeSkeleton {
    tree: Tree,
    /// Levels above the roots of the chunks.
    top: usize,
    place: PartPlace,
    /// Leaves of each chunk.
    counts: Vec<u64>,
    /// Where the next chunk's nodes go, on each level below the top.
    cursors: Vec<usize>,
    node_count: u64,
    /// Levels that leaf pages have in common with the pages above, and their numbers of records there.
    shared: usize,
    sizes: Vec<TopSize>,
}

impl TreeSkeleton {
    /// Plans the tree over chunks of these numbers of leaves; `page_leaves` is the most of a page.
    ///
    /// # Errors
    /// A chunk with too many or too few leaves for trees of one depth.
    pub(super) fn new(counts: &[u64], place: PartPlace, page_leaves: usize) -> Result<Self, Error> {
        let page_leaves = page_leaves.clamp(16, 16_384) as u32;
        // Highest level of each chunk whose nodes are small enough for pages.
        let planned: Vec<(usize, u64)> = (counts.par_iter())
            .map(|&count| {
                let shape = PartShape::new(count as usize, place)?;
                let fits = |level: &usize| shape.most_leaves(*level) <= page_leaves;
                let level = (0..place.depth).find(fits).unwrap_or(0);
                Ok((level, shape.node_count() as u64))
            })
            .collect::<Result<_, Error>>()?;
        let leaf_level = planned.iter().map(|plan| plan.0).max().unwrap_or(0);
        let shared = shared_levels(place.depth - leaf_level);
        let of_chunks: Vec<Vec<Vec<u8>>> = (counts.par_iter())
            .map(|&count| {
                let shape = PartShape::new(count as usize, place)?;
                let level = |level| shape.child_counts(level).collect();
                Ok((0..leaf_level + shared.max(1)).map(level).collect())
            })
            .collect::<Result<_, Error>>()?;
        let top = PartShape::usual_depth(counts.len() as u32);
        let above = PartShape::new(
            counts.len(),
            PartPlace {
                depth: top,
                ..place
            },
        )?;
        let mut levels: Vec<Vec<u8>> = (0..top)
            .map(|level| above.child_counts(level).collect())
            .collect();
        let joined = |level: usize| -> Vec<u8> {
            let own = of_chunks.iter().flat_map(|chunk| &chunk[level]);
            own.copied().collect()
        };
        levels.extend((0..=leaf_level).map(joined));
        let tops: Vec<Vec<u8>> = (leaf_level..leaf_level + shared).map(joined).collect();
        let sizes = TopSize::of_level(&tops, levels.last().map_or(0, Vec::len));
        let tree = linked(&levels);
        let cursors = tree.level_starts[top..=top + leaf_level].iter();
        Ok(Self {
            cursors: cursors.map(|&start| start as usize).collect(),
            tree,
            top,
            place,
            counts: counts.to_vec(),
            shared,
            sizes,
            node_count: planned.iter().map(|plan| plan.1).sum::<u64>() + above.node_count() as u64,
        })
    }

    /// The tree so far; its levels are those down to the roots of the leaf pages.
    pub(super) fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Gives away the tree and the sizes of the leaf pages in the pages above.
    pub(super) fn into_parts(self) -> (Tree, Vec<TopSize>) {
        (self.tree, self.sizes)
    }

    /// Level of the tree whose nodes are the roots of the leaf pages.
    pub(super) fn leaf_level(&self) -> usize {
        self.tree.level_count() - 1
    }

    /// The same level, counted from the root of a chunk.
    pub(super) fn leaf_level_of_chunks(&self) -> usize {
        self.leaf_level() - self.top
    }

    /// Number of nodes of the whole tree.
    pub(super) fn node_count(&self) -> u64 {
        self.node_count
    }

    /// Levels that leaf pages have in common with the pages above.
    pub(super) fn shared(&self) -> usize {
        self.shared
    }

    /// Sizes of the leaf pages in the pages above.
    pub(super) fn sizes(&self) -> &[TopSize] {
        &self.sizes
    }

    /// What the trees of chunks have in common.
    pub(super) fn place(&self) -> PartPlace {
        self.place
    }

    /// Number of chunks.
    pub(super) fn chunk_count(&self) -> usize {
        self.counts.len()
    }

    /// The shape of the tree of a chunk.
    ///
    /// # Errors
    /// None that [`TreeSkeleton::new`] had not.
    pub(super) fn shape(&self, chunk: usize) -> Result<PartShape, Error> {
        PartShape::new(self.counts[chunk] as usize, self.place)
    }

    /// Takes over the upper nodes of the next chunk.
    pub(super) fn take(&mut self, model: &Model) {
        for (level, cursor) in self.cursors.iter_mut().enumerate() {
            for id in model.tree.level(level) {
                let records = NodeRecords {
                    node: model.tree.nodes[id as usize],
                    attributes: model.tree.attributes[id as usize],
                    moments: model.tree.moments[id as usize],
                };
                put(&mut self.tree, *cursor, records);
                *cursor += 1;
            }
        }
    }

    /// Makes the nodes above the chunks, once all have come.
    pub(super) fn join(&mut self, is_surface: bool) {
        join_above(&mut self.tree, self.top, is_surface);
    }
}
