//! The shape of the tree: how many nodes each level has and how many leaves lie below each, before any geometry.
//!
//! Source: Benda, section 3.2.1. He halves the items of a level recursively until at most four are left, makes each
//! such group a node of the next level, and repeats with those. How many groups of which size arise depends only on
//! the number of items, so the whole shape is a function of the leaf count. Here it is worked out first, and the leaves
//! are then placed top-down into it ([`super::partition`]): one pass of O(n log n) instead of one for each level.

/// Levels of a tree, root first; the leaves are not among them.
#[derive(Debug, Default)]
pub(super) struct TreeShape {
    /// The interior levels; empty for fewer than two leaves.
    pub(super) levels: Vec<ShapeLevel>,
}

/// One level of interior nodes.
#[derive(Debug, Default)]
pub(super) struct ShapeLevel {
    /// Index, within the next level (or among the leaves), of each node's first child; then the end.
    pub(super) child_starts: Vec<u32>,
    /// Index of each node's first leaf; then the leaf count.
    pub(super) leaf_starts: Vec<u32>,
}

impl ShapeLevel {
    /// Number of nodes.
    pub(super) fn len(&self) -> usize {
        self.child_starts.len() - 1
    }
}

impl TreeShape {
    /// The shape of the tree over `leaf_count` leaves.
    pub(super) fn new(leaf_count: u32) -> Self {
        let mut levels = Vec::new();
        let mut items = leaf_count;
        while items > 1 {
            let mut child_starts = Vec::with_capacity(items as usize / 2 + 2);
            child_starts.push(0);
            push_groups(items, &mut child_starts);
            items = child_starts.len() as u32 - 1;
            levels.push(ShapeLevel {
                child_starts,
                leaf_starts: Vec::new(),
            });
        }
        // Upward from the leaves: a node starts where its first child starts.
        for level in 0..levels.len() {
            let leaf_starts = match level.checked_sub(1) {
                None => levels[0].child_starts.clone(),
                Some(below) => {
                    let below = &levels[below].leaf_starts;
                    levels[level]
                        .child_starts
                        .iter()
                        .map(|&child| below[child as usize])
                        .collect()
                }
            };
            levels[level].leaf_starts = leaf_starts;
        }
        levels.reverse();
        Self { levels }
    }

    /// Number of interior nodes.
    pub(super) fn node_count(&self) -> usize {
        self.levels.iter().map(ShapeLevel::len).sum()
    }

    /// First leaf of item `index` of `level`; a level past the last one is that of the leaves.
    #[inline]
    pub(super) fn leaf_start(&self, level: usize, index: u32) -> u32 {
        match self.levels.get(level) {
            Some(level) => level.leaf_starts[index as usize],
            None => index,
        }
    }
}

/// Appends the end of each group that halving `count` items gives, in order: groups of at most four.
fn push_groups(count: u32, ends: &mut Vec<u32>) {
    if count <= 4 {
        let start = ends.last().copied().unwrap_or(0);
        ends.push(start + count);
    } else {
        push_groups(count / 2, ends);
        push_groups(count - count / 2, ends);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn total(leaves: u32) -> usize {
        TreeShape::new(leaves).node_count() + leaves as usize
    }

    #[test]
    fn node_counts_match_table_5_6() {
        for (triangles, nodes) in [
            (96_966, 140_657),
            (654_666, 1_003_497),
            (871_414, 1_220_939),
            (1_000_000, 1_349_525),
            (4_000_000, 5_398_101),
        ] {
            assert_eq!(total(triangles), nodes);
        }
    }

    #[test]
    fn node_counts_match_the_unit_square_series() {
        let series = [
            143_691, 287_381, 447_083, 574_763, 674_763, 894_165, 1_049_525, 1_149_525, 1_249_525,
            1_349_525,
        ];
        for (index, nodes) in series.into_iter().enumerate() {
            assert_eq!(total(100_000 * (index as u32 + 1)), nodes);
        }
    }

    #[test]
    fn levels_of_a_million() {
        let shape = TreeShape::new(1_000_000);
        let sizes: Vec<usize> = shape.levels.iter().map(ShapeLevel::len).collect();
        assert_eq!(
            sizes,
            [1, 4, 16, 64, 256, 1024, 4096, 16384, 65536, 262_144]
        );
    }

    #[test]
    fn groups_have_two_to_four_members_and_cover_the_leaves() {
        assert!(TreeShape::new(0).levels.is_empty() && TreeShape::new(1).levels.is_empty());
        for leaves in 2..3000 {
            let shape = TreeShape::new(leaves);
            let mut below = leaves;
            for level in shape.levels.iter().rev() {
                assert!(
                    level
                        .child_starts
                        .windows(2)
                        .all(|w| (2..=4).contains(&(w[1] - w[0])))
                );
                assert_eq!(level.child_starts.last(), Some(&below));
                assert_eq!(level.leaf_starts.first(), Some(&0));
                assert_eq!(level.leaf_starts.last(), Some(&leaves));
                below = level.len() as u32;
            }
            assert_eq!(below, 1);
        }
    }
}
