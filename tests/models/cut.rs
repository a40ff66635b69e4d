//! Whole cuts against brute force: nothing visible is dropped, nothing is drawn twice, and a cut does not
//! depend on the cuts before it.

mod coherence;
mod section;
mod size;
mod strips;
mod testing;
mod visibility;

use std::ops::Range;
use surfel::cut::Cut;
use surfel::tree::{Model, Tree};

/// The leaves below a node, by walking down; nothing of the library is asked.
fn leaves_below(tree: &Tree, id: u32) -> Range<u32> {
    let edge = |last: bool| {
        let mut at = id;
        loop {
            let node = &tree.nodes[at as usize];
            let child = node.first_child
                + if last {
                    u32::from(node.child_count) - 1
                } else {
                    0
                };
            if node.has_leaves() {
                return child;
            }
            at = child;
        }
    };
    edge(false)..edge(true) + 1
}

/// How often each leaf is drawn, by itself or by a node above it.
fn coverage(model: &Model, cut: &Cut) -> Vec<u32> {
    let mut drawn = vec![0; model.tree.leaves.len()];
    for id in cut
        .nodes
        .iter()
        .copied()
        .chain(cut.strips.iter().map(|s| s.node))
    {
        for leaf in leaves_below(&model.tree, id) {
            drawn[leaf as usize] += 1;
        }
    }
    for &leaf in cut.leaves.iter().chain(&cut.triangles) {
        drawn[leaf as usize] += 1;
    }
    drawn
}

/// Panics unless every list is in ascending order.
fn assert_ascending(cut: &Cut) {
    let strips: Vec<u32> = cut.strips.iter().map(|s| s.node).collect();
    for list in [&cut.nodes, &strips, &cut.leaves, &cut.triangles] {
        assert!(list.windows(2).all(|w| w[0] < w[1]), "not ascending");
    }
}
