//! Trees of the upper levels alone: their links are known before their nodes.

use crate::tree::{AlignedRecords, Node, NodeAttributes, NodeRecords, Tree, node_above};

/// Puts a node into its place, whose links stay.
pub(super) fn put(tree: &mut Tree, at: usize, records: NodeRecords) {
    let NodeRecords {
        node,
        attributes,
        moments,
    } = records;
    let own = &mut tree.nodes[at];
    *own = Node {
        first_child: own.first_child,
        child_count: own.child_count,
        flags: node.flags & !Node::LEAF_CHILDREN,
        ..node
    };
    tree.attributes[at] = attributes;
    tree.moments[at] = moments;
}

/// A tree of levels with these numbers of children; those of the last level are not in it.
pub(super) fn linked(levels: &[Vec<u8>]) -> Tree {
    let count = levels.iter().map(Vec::len).sum();
    let mut nodes = AlignedRecords::<Node>::of_tree(count);
    let mut level_starts = vec![0u32];
    let mut at = 0;
    let mut child = 1;
    for level in levels {
        for &own in level {
            nodes[at].child_count = own;
            nodes[at].first_child = child;
            child += u32::from(own);
            at += 1;
        }
        level_starts.push(at as u32);
    }
    Tree {
        nodes,
        attributes: AlignedRecords::<NodeAttributes>::of_tree(count),
        moments: AlignedRecords::zeroed(count),
        level_starts,
        ..Tree::default()
    }
}

/// Makes the nodes above those of level `top` from their records.
pub(super) fn join_above(tree: &mut Tree, top: usize, is_surface: bool) {
    for id in (0..tree.level(top).start).rev() {
        let children: Vec<NodeRecords> = (tree.children(id))
            .map(|child| NodeRecords {
                node: tree.nodes[child as usize],
                attributes: tree.attributes[child as usize],
                moments: tree.moments[child as usize],
            })
            .collect();
        put(tree, id as usize, node_above(&children, is_surface));
    }
}
