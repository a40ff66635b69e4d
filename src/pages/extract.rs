//! A part of a model as a model of its own: what a page is made from.

use super::mix_hash::MixMap;
use super::page_tops::PageTop;
use crate::abi::Vertex;
use crate::tree::{
    AlignedRecords, Leaf, Model, Node, NodeAttributes, NodeRecords, NormalCone, PatchRecords,
    SurfaceMoments, Tree,
};
use glam::Vec3;
use std::ops::Range;
use std::sync::Arc;

/// The nodes of each level below `root` down to level `last` (not included), then the children of the last one, which are
/// leaves where that is the model's last level.
pub(super) fn levels_below(tree: &Tree, root: u32, last: usize) -> Vec<Range<u32>> {
    let first = tree.level_of(root);
    let mut levels: Vec<Range<u32>> = std::iter::once(root..root + 1).collect();
    for _ in first..last {
        let own = levels[levels.len() - 1].clone();
        // Siblings stand together, and so do all children of nodes that do.
        let next = tree.children(own.start).start..tree.children(own.end - 1).end;
        levels.push(next);
    }
    levels
}

/// The records of patches of the nodes from `root` on down to level `last` (not included), in the order of a part of these.
pub(super) fn patches_below(
    patches: &PatchRecords,
    tree: &Tree,
    root: u32,
    last: usize,
) -> Arc<PatchRecords> {
    let mut levels = levels_below(tree, root, last);
    levels.pop();
    Arc::new(patches.of_nodes(levels.into_iter().flatten()))
}

/// The records of nodes of some levels, numbered anew.
fn tree_of(tree: &Tree, levels: &[Range<u32>]) -> Tree {
    let (children, interior) = match levels.split_last() {
        Some((children, interior)) => (children, interior),
        None => return Tree::default(),
    };
    let count = interior.iter().map(|level| level.len()).sum();
    let mut nodes = AlignedRecords::<Node>::of_tree(count);
    let mut attributes = AlignedRecords::<NodeAttributes>::of_tree(count);
    let mut moments = AlignedRecords::zeroed(count);
    let mut level_starts = vec![0u32];
    let mut at = 0;
    for (index, level) in interior.iter().enumerate() {
        let next = &levels[index + 1];
        let is_last = index + 1 == interior.len();
        let next_start = if is_last {
            0
        } else {
            (at + level.len()) as u32
        };
        for id in level.clone() {
            let old = &tree.nodes[id as usize];
            let mut node = *old;
            node.first_child = next_start + (old.first_child - next.start);
            node.flags &= !Node::LEAF_CHILDREN;
            if is_last {
                node.flags |= Node::LEAF_CHILDREN;
            }
            nodes[at] = node;
            attributes[at] = tree.attributes[id as usize];
            moments[at] = tree.moments[id as usize];
            at += 1;
        }
        level_starts.push(at as u32);
    }
    let mut part = Tree {
        nodes,
        attributes,
        moments,
        level_starts,
        leaves: AlignedRecords::zeroed(children.len()),
        ..Tree::default()
    };
    link(&mut part);
    part
}

/// Fills parents and first leaves from the children's counts; the nodes are breadth-first and all leaves at one depth.
pub(super) fn link(tree: &mut Tree) {
    let count = tree.nodes.len();
    tree.parents = vec![0; count];
    tree.first_leaf = vec![0; count];
    for id in (0..count).rev() {
        let node = &tree.nodes[id];
        let first = node.first_child as usize;
        if node.has_leaves() {
            tree.first_leaf[id] = node.first_child;
        } else {
            tree.first_leaf[id] = tree.first_leaf.get(first).copied().unwrap_or(0);
            let end = (first + usize::from(node.child_count)).min(count);
            if let Some(children) = tree.parents.get_mut(first..end) {
                children.fill(id as u32);
            }
        }
    }
}

/// The part below a node with all its leaves; in the coordinates of the model. A node of a model without nodes is its leaf.
pub(super) fn subtree(model: &Model, root: Option<u32>, positions: &[Vec3]) -> Model {
    let tree = &model.tree;
    let (part, leaves) = match root {
        Some(root) => {
            let levels = levels_below(tree, root, tree.level_count());
            (tree_of(tree, &levels), tree.leaf_range(root))
        }
        None => {
            let part = Tree {
                level_starts: vec![0],
                leaves: AlignedRecords::zeroed(tree.leaves.len()),
                ..Tree::default()
            };
            (part, 0..tree.leaf_count())
        }
    };
    let mut part = Model {
        tree: part,
        origin: model.origin,
        is_closed: model.is_closed,
        has_colors: model.has_colors,
        ..Model::default()
    };
    let range = leaves.start as usize..leaves.end as usize;
    part.tree
        .leaves
        .copy_from_slice(&tree.leaves[range.clone()]);
    let moved = |index: u32| Vertex {
        position: positions[index as usize],
        ..model.vertices[index as usize]
    };
    if model.triangles.is_empty() {
        part.vertices = leaves.map(moved).collect();
    } else {
        let mut known = MixMap::default();
        part.triangles = model.triangles[range]
            .iter()
            .map(|triangle| {
                triangle.map(|old| {
                    *known.entry(old).or_insert_with(|| {
                        part.vertices.push(moved(old));
                        part.vertices.len() as u32 - 1
                    })
                })
            })
            .collect();
    }
    part.used_vertices = part.vertices.len() as u32;
    part
}

/// The upper nodes of a model, down to the roots of its leaf pages, such that they hold what is decoded.
pub(super) struct UpperNodes {
    pub(super) nodes: Vec<Node>,
    pub(super) attributes: Vec<NodeAttributes>,
}

/// The part from a node down to level `last`, whose nodes are its leaves: points with the nodes' spheres, normals, colors.
/// Nodes and attributes are those given, by the numbers of the model.
pub(super) fn upper_part(model: &Model, upper: &UpperNodes, root: u32, last: usize) -> UpperPart {
    let tree = &model.tree;
    let levels = levels_below(tree, root, last);
    let mut part = Model {
        tree: tree_of(tree, &levels),
        origin: model.origin,
        has_colors: model.has_colors,
        ..Model::default()
    };
    let interior = levels[..levels.len() - 1].iter().cloned().flatten();
    for (at, id) in interior.enumerate() {
        let (node, own) = (&mut part.tree.nodes[at], &upper.nodes[id as usize]);
        (node.center, node.radius) = (own.center, own.radius);
        (node.cone, node.strip) = (own.cone, own.strip);
        part.tree.attributes[at] = upper.attributes[id as usize];
    }
    let roots = levels[levels.len() - 1].clone();
    let records = roots.map(|id| NodeRecords {
        node: upper.nodes[id as usize],
        attributes: upper.attributes[id as usize],
        moments: SurfaceMoments::default(),
    });
    let cones = set_leaves(&mut part, &records.collect::<Vec<_>>());
    UpperPart { part, cones }
}

/// Records of nodes, laid out as those of trees are.
fn of_tree<T: bytemuck::Pod>(records: &[T]) -> AlignedRecords<T> {
    let mut copy = AlignedRecords::of_tree(records.len());
    copy.copy_from_slice(records);
    copy
}

/// A part of the nodes above the leaf pages.
pub(super) struct UpperPart {
    pub(super) part: Model,
    /// Cone of each leaf.
    pub(super) cones: Vec<NormalCone>,
}

/// Makes nodes the leaves of a part: points with their spheres, normals and colors. Returns their cones.
fn set_leaves(part: &mut Model, records: &[NodeRecords]) -> Vec<NormalCone> {
    let leaves: Vec<Leaf> = (records.iter())
        .map(|own| Leaf {
            center: own.node.center,
            radius: own.node.radius,
        })
        .collect();
    part.tree.leaves = AlignedRecords::from(leaves.as_slice());
    part.vertices = (records.iter())
        .map(|own| {
            let [r, g, b, _] = own.attributes.color;
            let alpha = if own.attributes.has_normal() { 255 } else { 0 };
            Vertex {
                position: own.node.center,
                normal: own.attributes.normal,
                color: [r, g, b, alpha],
            }
        })
        .collect();
    part.used_vertices = part.vertices.len() as u32;
    records.iter().map(|own| own.node.cone).collect()
}

/// A part whose leaves are the roots of leaf pages, with the first levels of these below it: `tops` in the order of the leaves,
/// `shared` levels of nodes and one that become the leaves.
pub(super) fn with_tops(upper: UpperPart, tops: &[PageTop], shared: usize) -> UpperPart {
    if shared == 0 {
        return upper;
    }
    let mut part = upper.part;
    let old = &part.tree;
    let mut records: Vec<NodeRecords> = (0..old.nodes.len())
        .map(|id| NodeRecords {
            node: old.nodes[id],
            attributes: old.attributes[id],
            moments: old.moments[id],
        })
        .collect();
    let mut level_starts = old.level_starts.clone();
    let mut own: Vec<Range<usize>> = vec![0..1; tops.len()];
    for _ in 0..shared {
        for (PageTop(top), own) in tops.iter().zip(&mut own) {
            let level = &top[own.clone()];
            records.extend_from_slice(level);
            let below: usize = level.iter().map(|r| usize::from(r.node.child_count)).sum();
            *own = own.end..own.end + below;
        }
        level_starts.push(records.len() as u32);
    }
    let leaves: Vec<NodeRecords> = (tops.iter().zip(own))
        .flat_map(|(PageTop(top), own)| top[own].iter().copied())
        .collect();
    // Children follow one another from level to level.
    for (level, ends) in level_starts.windows(2).enumerate() {
        let is_last = level + 2 == level_starts.len();
        let mut child = if is_last { 0 } else { ends[1] };
        for NodeRecords { node, .. } in &mut records[ends[0] as usize..ends[1] as usize] {
            node.first_child = child;
            child += u32::from(node.child_count);
            node.flags &= !Node::LEAF_CHILDREN;
            node.flags |= if is_last { Node::LEAF_CHILDREN } else { 0 };
        }
    }
    let nodes: Vec<Node> = records.iter().map(|own| own.node).collect();
    let attributes: Vec<NodeAttributes> = records.iter().map(|own| own.attributes).collect();
    let moments: Vec<SurfaceMoments> = records.iter().map(|own| own.moments).collect();
    part.tree = Tree {
        nodes: of_tree(&nodes),
        attributes: of_tree(&attributes),
        moments: AlignedRecords::from(moments.as_slice()),
        level_starts,
        ..Tree::default()
    };
    let cones = set_leaves(&mut part, &leaves);
    link(&mut part.tree);
    UpperPart { part, cones }
}
