//! Interior nodes of a leaf page: 32 bits each, breadth-first.
//!
//! From the lowest bit: 13 sphere in the decoded parent's (0 for the root, whose sphere is in the page's header), 2 number
//! of children less 1, 1 special, 14 normal, 2 cone. Of points, which have no cones, special and cone are the thickness.

use super::PageFault;
use crate::pages::quantize::{
    CONE_SINES, NORMAL_CODES, PageSphere, SPHERE_CODES, decode_sphere, encode_sphere,
    packed_normals,
};
use crate::tree::{AlignedRecords, Node, NodeAttributes, NodeStrip, NormalCone, Tree};
use glam::DVec3;

/// The code of a normal that is none.
pub(super) const NO_NORMAL: u16 = (1 << 14) - 1;

/// Bits of a word where its children's count less 1 is, and where the special bit is.
const CHILDREN: u32 = 13;
const SPECIAL: u32 = 15;
const NORMAL: u32 = 16;
const CONE: u32 = 30;

/// A node in 32 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct NodeWord(pub(super) u32);

impl NodeWord {
    pub(super) fn new(
        sphere: u16,
        children: u8,
        normal: u16,
        (cone, is_special): (u8, bool),
    ) -> Self {
        Self(
            u32::from(sphere)
                | u32::from(children - 1) << CHILDREN
                | u32::from(is_special) << SPECIAL
                | u32::from(normal) << NORMAL
                | u32::from(cone) << CONE,
        )
    }

    #[inline(always)]
    fn sphere(self) -> u16 {
        (self.0 & 0x1fff) as u16
    }

    #[inline(always)]
    fn children(self) -> u32 {
        (self.0 >> CHILDREN & 3) + 1
    }

    #[inline(always)]
    pub(super) fn is_special(self) -> bool {
        self.0 >> SPECIAL & 1 != 0
    }

    #[inline(always)]
    pub(super) fn normal(self) -> u16 {
        (self.0 >> NORMAL & 0x3fff) as u16
    }

    #[inline(always)]
    pub(super) fn cone(self) -> usize {
        (self.0 >> CONE) as usize
    }
}

/// Word `id` of a section of words.
#[inline(always)]
pub(super) fn word(bytes: &[u8], id: usize) -> NodeWord {
    let word = bytes.get(id * 4..).and_then(|rest| rest.first_chunk::<4>());
    NodeWord(word.map_or(0, |word| u32::from_le_bytes(*word)))
}

/// The packed normal; `None` for the code of none.
#[inline(always)]
pub(super) fn normal_of(table: &[[i16; 2]], code: u16) -> Option<[i16; 2]> {
    table.get(usize::from(code)).copied()
}

/// Tells whether a code is that of a normal, or of none.
#[inline(always)]
pub(super) fn is_normal(code: u16) -> bool {
    usize::from(code) < NORMAL_CODES || code == NO_NORMAL
}

/// Cone codes as the records have them, without the axis: at least their sine, and a hair more, as the tree's.
fn packed_sine(code: usize) -> u16 {
    if code == 3 {
        NormalCone::NEVER
    } else {
        ((CONE_SINES[code] + 1e-6) * 65535.0) as u16 + 1
    }
}

/// The tree of a page without attributes, its nodes without cones: spheres, children, links. Leaves are zero.
pub(super) fn decode_tree(
    words: &[u8],
    root: PageSphere,
    (leaf_count, level_count): (usize, usize),
) -> Result<Tree, PageFault> {
    let count = words.len() / 4;
    let mut nodes = AlignedRecords::<Node>::of_tree(count);
    let mut level_starts = Vec::with_capacity(level_count + 1);
    level_starts.push(0);
    let mut parents = vec![0u32; count];
    let fault =
        |id: usize, cause: &str| (super::LEAF_HEADER + id * 4, format!("node {id}: {cause}"));
    if let Some(node) = nodes.first_mut() {
        node.center = root.center;
        node.radius = root.radius;
        if word(words, 0).sphere() != 0 {
            return Err(fault(0, "a root with a code"));
        }
    }
    let (mut start, mut end) = (0, count.min(1));
    for level in 0..level_count {
        let is_last = level + 1 == level_count;
        let limit = if is_last { leaf_count } else { count };
        let mut next = if is_last { 0 } else { end };
        for id in start..end {
            let own = word(words, id);
            let children = own.children();
            let first = next;
            next += children as usize;
            if children < 2 || next > limit {
                return Err(fault(id, "children that are too few or too many"));
            }
            if !is_normal(own.normal()) {
                return Err(fault(id, "a normal that is none"));
            }
            let node = &mut nodes[id];
            node.first_child = first as u32;
            node.child_count = children as u8;
            node.strip = NodeStrip::SPHERE;
            node.cone = NormalCone::ALL;
            node.flags = if is_last { Node::LEAF_CHILDREN } else { 0 };
            if is_last {
                continue;
            }
            let parent = PageSphere {
                center: node.center,
                radius: node.radius,
            };
            for child in first..next {
                let code = word(words, child).sphere();
                if usize::from(code) >= SPHERE_CODES {
                    return Err(fault(child, "a sphere that is none"));
                }
                let sphere = decode_sphere(&parent, code);
                let node = &mut nodes[child];
                node.center = sphere.center;
                node.radius = sphere.radius;
                parents[child] = id as u32;
            }
        }
        let is_complete = if is_last {
            next == leaf_count && end == count
        } else {
            next > end
        };
        if !is_complete {
            return Err(fault(
                start,
                "a level without all children of the one above",
            ));
        }
        level_starts.push(end as u32);
        if !is_last {
            (start, end) = (end, next);
        }
    }
    if count == 0 && leaf_count != 1 {
        return Err((8, "leaves without nodes".to_owned()));
    }
    let mut tree = Tree {
        nodes,
        attributes: AlignedRecords::of_tree(count),
        parents,
        level_starts,
        leaves: AlignedRecords::zeroed(leaf_count),
        moments: AlignedRecords::zeroed(count),
        first_leaf: vec![0; count],
    };
    for id in (0..count).rev() {
        let node = &tree.nodes[id];
        let first = node.first_child;
        tree.first_leaf[id] = if node.has_leaves() {
            first
        } else {
            tree.first_leaf[first as usize]
        };
    }
    Ok(tree)
}

/// Fills the cones of a page of triangles, and the flags that go with them.
pub(super) fn decode_cones(words: &[u8], tree: &mut Tree) {
    let table = packed_normals();
    let sines = [0, 1, 2, 3].map(packed_sine);
    for id in 0..tree.nodes.len() {
        let own = word(words, id);
        let mut cone = NormalCone::ALL;
        if own.cone() < 3
            && let Some(axis) = normal_of(table, own.normal())
        {
            cone = NormalCone {
                axis,
                sin_half_angle: sines[own.cone()],
            };
        }
        let mut flags = 0;
        if own.is_special() && own.cone() == 3 {
            flags = Node::UNCULLED;
        } else if own.is_special() {
            // Without any normal: it goes where its parent goes.
            flags = Node::FLAT;
            cone = match id {
                0 => NormalCone::ALL,
                _ => tree.nodes[tree.parents[id] as usize].cone,
            };
        }
        let node = &mut tree.nodes[id];
        node.cone = cone;
        node.flags |= flags;
    }
}

/// Codes of the spheres of all nodes, and the spheres as they will be decoded.
pub(super) fn encode_spheres(
    tree: &Tree,
    spheres: &[(DVec3, f64)],
    root: PageSphere,
) -> (Vec<u16>, Vec<PageSphere>) {
    let mut codes = vec![0; tree.nodes.len()];
    let mut decoded = vec![root; tree.nodes.len()];
    for id in 0..tree.nodes.len() {
        if tree.nodes[id].has_leaves() {
            break;
        }
        for child in tree.children(id as u32) {
            let child = child as usize;
            let (center, radius) = spheres[child];
            codes[child] = encode_sphere(&decoded[id], center, radius);
            decoded[child] = decode_sphere(&decoded[id], codes[child]);
        }
    }
    (codes, decoded)
}

/// The code of a node's normal.
pub(super) fn normal_code(attributes: &NodeAttributes) -> u16 {
    if attributes.has_normal() {
        crate::pages::quantize::encode_normal(attributes.normal())
    } else {
        NO_NORMAL
    }
}

/// Area and color sums of nodes from those of the lowest level up, then their means.
pub(super) struct ColorSums {
    /// Weighted red, green and blue, and the weight, by node.
    pub(super) sums: Vec<[f32; 4]>,
    /// Whether some leaf has a normal.
    pub(super) any_normal: bool,
}

impl ColorSums {
    /// Fills areas and colors, and normals by their codes; alpha is 255 where there is one. The areas of the lowest level
    /// are there.
    pub(super) fn fill(&mut self, words: &[u8], tree: &mut Tree, has_colors: bool) {
        let table = packed_normals();
        let lowest = match *tree.level_starts.as_slice() {
            [.., lowest, _] => lowest as usize,
            _ => return,
        };
        for id in (0..lowest).rev() {
            let children = tree.children(id as u32);
            let children = children.start as usize..children.end as usize;
            tree.attributes[id].area = tree.attributes[children.clone()]
                .iter()
                .map(|a| a.area)
                .sum();
            if has_colors {
                let mut sum = [0.0; 4];
                for child in &self.sums[children] {
                    for (sum, value) in sum.iter_mut().zip(child) {
                        *sum += value;
                    }
                }
                self.sums[id] = sum;
            }
        }
        for id in 0..tree.nodes.len() {
            let normal = normal_of(table, word(words, id).normal());
            let mut color = [255; 3];
            if has_colors {
                let [r, g, b, weight] = self.sums[id];
                color = [r, g, b].map(|c| (c / weight + 0.5) as u8);
            }
            // Normals that point all around: lit as a ball is on average.
            if normal.is_none() && self.any_normal {
                color = color.map(|c| (f32::from(c) * (2.0 / 3.0) + 0.5) as u8);
            }
            let [r, g, b] = color;
            let own = &mut tree.attributes[id];
            own.normal = normal.unwrap_or_default();
            own.color = [r, g, b, if normal.is_some() { 255 } else { 0 }];
            own.splat_radius = tree.nodes[id].radius;
        }
    }
}
