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
        Self::grouped(leaf_count, |items| groups(items, 4))
    }

    /// The shape of a tree of `depth` levels of nodes, each with two to four children: that of [`TreeShape::new`] where it
    /// has this depth by itself. `None` where there is no such tree: outside of 2^depth to 4^depth leaves.
    pub(super) fn with_depth(leaf_count: u32, depth: usize) -> Option<Self> {
        let bits = u32::try_from(depth).ok()?;
        let least = 1u64.checked_shl(bits)?;
        let most = 1u128.checked_shl(2 * bits)?;
        if u64::from(leaf_count) < least || u128::from(leaf_count) > most {
            return None;
        }
        let mut left = bits;
        Some(Self::grouped(leaf_count, |items| {
            left = left.saturating_sub(1);
            // Groups of two or three where those of up to four would leave too few for the levels above.
            let of_four = groups(items, 4);
            let count = of_four.len() as u64 - 1;
            if count >= 1u64 << left {
                of_four
            } else {
                groups(items, 3)
            }
        }))
    }

    /// The shape by how the items of a level are grouped, from the leaves up.
    fn grouped(leaf_count: u32, mut group: impl FnMut(u32) -> Vec<u32>) -> Self {
        let mut levels = Vec::new();
        let mut items = leaf_count;
        while items > 1 {
            let child_starts = group(items);
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

/// Starts of the groups that halving `count` items until at most `most` are left gives, in order; then the end.
fn groups(count: u32, most: u32) -> Vec<u32> {
    let mut starts = Vec::with_capacity(count as usize / 2 + 2);
    starts.push(0);
    push_groups(count, most, &mut starts);
    starts
}

/// Appends the end of each group.
fn push_groups(count: u32, most: u32, ends: &mut Vec<u32>) {
    if count <= most {
        let start = ends.last().copied().unwrap_or(0);
        ends.push(start + count);
    } else {
        push_groups(count / 2, most, ends);
        push_groups(count - count / 2, most, ends);
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
            sound(&TreeShape::new(leaves), leaves);
        }
    }

    #[test]
    fn every_depth_that_two_to_four_children_allow_is_there() {
        for leaves in (1..700).chain([8191, 8192, 8193, 65_535, 262_144, 262_145, 524_288]) {
            let natural = TreeShape::new(leaves).levels.len();
            for depth in 0..20 {
                let is_possible =
                    u64::from(leaves) >= 1 << depth && u128::from(leaves) <= 1u128 << (2 * depth);
                let shape = TreeShape::with_depth(leaves, depth);
                assert_eq!(shape.is_some(), is_possible, "{leaves} {depth}");
                if let Some(shape) = shape {
                    assert_eq!(shape.levels.len(), depth, "{leaves}");
                    if leaves > 1 {
                        sound(&shape, leaves);
                    }
                    if depth == natural {
                        let starts = |shape: TreeShape| -> Vec<Vec<u32>> {
                            let levels = shape.levels.into_iter();
                            levels.map(|level| level.child_starts).collect()
                        };
                        assert_eq!(starts(shape), starts(TreeShape::new(leaves)));
                    }
                }
            }
        }
    }

    /// Holds a shape to its promises.
    fn sound(shape: &TreeShape, leaves: u32) {
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
