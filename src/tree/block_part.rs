//! The records that belong to a range of blocks, divided where blocks are done in parallel.

use super::node::{Leaf, Node, NodeAttributes};
use super::shape::TreeShape;
use super::summary::SubtreeSums;

/// Levels of a block.
pub(super) const HEIGHT: usize = 4;

/// The nodes and leaves of a run of blocks, by height above the leaves.
pub(super) struct BlockPart<'a> {
    pub(super) nodes: [&'a mut [Node]; HEIGHT],
    pub(super) attributes: [&'a mut [NodeAttributes]; HEIGHT],
    pub(super) leaves: &'a mut [Leaf],
    pub(super) sums: &'a mut [SubtreeSums],
}

/// Divides what belongs to the blocks from `first` on before block `middle`.
pub(super) fn split<'p>(
    shape: &TreeShape,
    top: usize,
    first: u32,
    middle: u32,
    part: BlockPart<'p>,
) -> (BlockPart<'p>, BlockPart<'p>) {
    let depth = shape.levels.len();
    let mut nodes: [(&mut [Node], &mut [Node]); HEIGHT] = Default::default();
    let mut attributes: [(&mut [NodeAttributes], &mut [NodeAttributes]); HEIGHT] =
        Default::default();
    // From the blocks down: where the range begins and where it is cut, in each level.
    let (mut start, mut cut) = (first as usize, middle as usize);
    let (sums_one, sums_two) = part.sums.split_at_mut(cut - start);
    let mut parts = part
        .nodes
        .into_iter()
        .zip(part.attributes)
        .rev()
        .skip(HEIGHT - (depth - top));
    for level in top..depth {
        let height = depth - 1 - level;
        if let Some((level_nodes, level_attributes)) = parts.next() {
            nodes[height] = level_nodes.split_at_mut(cut - start);
            attributes[height] = level_attributes.split_at_mut(cut - start);
        }
        let child_starts = &shape.levels[level].child_starts;
        (start, cut) = (child_starts[start] as usize, child_starts[cut] as usize);
    }
    let (leaves_one, leaves_two) = part.leaves.split_at_mut(cut - start);
    let (mut one, mut two) = (
        BlockPart {
            nodes: Default::default(),
            attributes: Default::default(),
            leaves: leaves_one,
            sums: sums_one,
        },
        BlockPart {
            nodes: Default::default(),
            attributes: Default::default(),
            leaves: leaves_two,
            sums: sums_two,
        },
    );
    for (height, (nodes, attributes)) in nodes.into_iter().zip(attributes).enumerate() {
        (one.nodes[height], two.nodes[height]) = nodes;
        (one.attributes[height], two.attributes[height]) = attributes;
    }
    (one, two)
}
