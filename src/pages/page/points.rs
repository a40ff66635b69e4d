//! Leaf pages of points: 40 bits a leaf, and its color.
//!
//! From the lowest bit: three times 7 bits place in the decoded parent's sphere, in 127 steps from -1 to 1; 5 bits radius, in
//! parts of 32 of the parent's, less 1; 14 bits normal. The place is off by at most 1/126 of the parent's radius an axis, and
//! the radius contains that.

use super::nodes::{self, ColorSums, NO_NORMAL, NodeWord, normal_of};
use super::{
    ColorBits, DecodedPage, EncodedPage, LEAF_HEADER, LeafPageHeader, PageChoices, PageFault,
    PageSections, flag, grown, in_model_space, kind,
};
use crate::abi::Vertex;
use crate::math::octahedral;
use crate::pages::quantize::{
    PageSphere, color_from_565, color_to_565, decode_normal, encode_normal, packed_normals,
};
use crate::tree::{Leaf, Model, Tree, area_of_point};
use bytemuck::Zeroable;
use glam::{DVec3, Vec3};

/// Places on each side of the parent's center.
const HALF_STEPS: f32 = 63.0;
const RADII: f32 = 32.0;
/// Bytes of a leaf without its color.
const LEAF: usize = 5;

/// Half the thickness of a node along its normal, over its radius, by code.
const THICKNESS: [f32; 8] = [
    1.0 / 16.0,
    2.0 / 16.0,
    3.0 / 16.0,
    4.0 / 16.0,
    6.0 / 16.0,
    8.0 / 16.0,
    12.0 / 16.0,
    1.0,
];

/// Bits of a leaf.
#[derive(Clone, Copy)]
struct LeafWord(u64);

impl LeafWord {
    #[inline(always)]
    fn decode(self, parent: &PageSphere) -> Leaf {
        let place = |shift: u32| (self.0 >> shift & 127) as f32 - HALF_STEPS;
        let offset = Vec3::new(place(0), place(7), place(14));
        let parts = (self.0 >> 21 & 31) as f32 + 1.0;
        Leaf {
            center: parent.center + offset * (parent.radius * (1.0 / HALF_STEPS)),
            radius: parent.radius * (parts * (1.0 / RADII)),
        }
    }

    #[inline(always)]
    fn normal(self) -> u16 {
        (self.0 >> 26) as u16
    }

    /// Tells whether every place is one.
    #[inline(always)]
    fn is_sound(self) -> bool {
        [0, 7, 14].iter().all(|shift| self.0 >> shift & 127 != 127)
            && nodes::is_normal(self.normal())
    }

    /// The leaf with the smallest radius that contains a ball in the parent's; the parent itself where none does.
    fn encode(parent: &PageSphere, center: DVec3, radius: f64, normal: u16) -> Self {
        let normal = u64::from(normal) << 26;
        let middle = HALF_STEPS as u64;
        let whole = Self(middle | middle << 7 | middle << 14 | 31 << 21 | normal);
        let scale = f64::from(parent.radius);
        if !(scale > 0.0 && scale.is_finite()) {
            return whole;
        }
        let offset = (center - parent.center.as_dvec3()) * (f64::from(HALF_STEPS) / scale);
        let place = |c: f64| (c.round().clamp(-63.0, 63.0) + 63.0) as u64;
        let places = place(offset.x) | place(offset.y) << 7 | place(offset.z) << 14;
        (0..32)
            .map(|parts| Self(places | parts << 21 | normal))
            .find(|word| {
                let own = word.decode(parent);
                let sphere = PageSphere {
                    center: own.center,
                    radius: own.radius,
                };
                sphere.contains(center, radius)
            })
            .unwrap_or(whole)
    }
}

#[inline(always)]
fn leaf_word(bytes: &[u8], leaf: usize) -> LeafWord {
    let at = leaf * LEAF;
    let mut word = [0; 8];
    if let Some(whole) = bytes.get(at..).and_then(|rest| rest.first_chunk::<8>()) {
        word = *whole;
        word[5..].fill(0);
    } else {
        for (to, from) in word
            .iter_mut()
            .zip(bytes.get(at..at + LEAF).unwrap_or_default())
        {
            *to = *from;
        }
    }
    LeafWord(u64::from_le_bytes(word))
}

pub(super) fn encode(part: &Model, choices: PageChoices) -> EncodedPage {
    let (tree, base) = (&part.tree, choices.base);
    let real: Vec<Leaf> = tree
        .leaves
        .iter()
        .map(|leaf| Leaf {
            center: (leaf.center.as_dvec3() - base).as_vec3(),
            radius: leaf.radius,
        })
        .collect();
    let (spheres, root) = grown(tree, &real, base);
    let (codes, decoded) = nodes::encode_spheres(tree, &spheres, root);
    let normals: Vec<u16> = part
        .vertices
        .iter()
        .map(|vertex| match vertex.color[3] {
            0 => NO_NORMAL,
            _ => encode_normal(octahedral::decode(vertex.normal)),
        })
        .collect();
    let mut words = Vec::with_capacity(real.len());
    let mut leaves = Vec::with_capacity(real.len());
    let mut push = |parent: &PageSphere, leaf: usize| {
        let own = &real[leaf];
        let word = LeafWord::encode(
            parent,
            own.center.as_dvec3(),
            f64::from(own.radius),
            normals[leaf],
        );
        words.push(word);
        leaves.push(word.decode(parent));
    };
    if tree.nodes.is_empty() {
        (0..real.len()).for_each(|leaf| push(&root, leaf));
    }
    for (id, node) in tree
        .nodes
        .iter()
        .enumerate()
        .filter(|(_, node)| node.has_leaves())
    {
        let first = node.first_child as usize;
        (first..first + usize::from(node.child_count)).for_each(|leaf| push(&decoded[id], leaf));
    }

    let flags = match (part.has_colors, choices.colors) {
        (false, _) => 0,
        (true, ColorBits::Few) => flag::FEW_COLORS,
        (true, ColorBits::All) => flag::ALL_COLORS,
    };
    let header = LeafPageHeader {
        kind: kind::POINTS,
        flags,
        leaf_count: real.len() as u32,
        vertex_count: real.len() as u32,
        node_count: tree.nodes.len() as u32,
        level_count: tree.level_count() as u32,
        sphere: root,
        base: base.to_array(),
        step: 0.0,
    };
    let mut bytes = bytemuck::bytes_of(&header).to_vec();
    for (id, node) in tree.nodes.iter().enumerate() {
        let normal = nodes::normal_code(&tree.attributes[id]);
        let range = tree.leaf_range(id as u32);
        let range = range.start as usize..range.end as usize;
        let thickness = match normal {
            NO_NORMAL => 7,
            _ => thickness_code(
                &decoded[id],
                normal,
                &leaves[range.clone()],
                &normals[range],
            ),
        };
        let packed = ((thickness & 3) as u8, thickness >> 2 != 0);
        let word = NodeWord::new(codes[id], node.child_count, normal, packed);
        bytes.extend(word.0.to_le_bytes());
    }
    for word in &words {
        bytes.extend(&word.0.to_le_bytes()[..LEAF]);
    }
    for vertex in part.vertices.iter().filter(|_| part.has_colors) {
        let [r, g, b, _] = vertex.color;
        match choices.colors {
            ColorBits::Few => bytes.extend(color_to_565([r, g, b]).to_le_bytes()),
            ColorBits::All => bytes.extend([r, g, b]),
        }
    }
    EncodedPage {
        bytes,
        root: in_model_space(root, base),
    }
}

/// The least thickness that holds the discs of the leaves below a node, or their balls where they have no normal.
fn thickness_code(sphere: &PageSphere, normal: u16, leaves: &[Leaf], normals: &[u16]) -> usize {
    let along = decode_normal(normal);
    let reach = |(leaf, &own): (&Leaf, &u16)| {
        let beyond = match own {
            NO_NORMAL => leaf.radius,
            _ => leaf.radius * along.cross(decode_normal(own)).length(),
        };
        (leaf.center - sphere.center).dot(along).abs() + beyond
    };
    let most = leaves.iter().zip(normals).map(reach).fold(0.0, f32::max);
    THICKNESS
        .iter()
        .position(|&share| most <= share * sphere.radius)
        .unwrap_or(7)
}

pub(super) fn decode(bytes: &[u8]) -> Result<DecodedPage, PageFault> {
    let header = LeafPageHeader::read(bytes)?;
    let leaf_count = header.leaf_count as usize;
    if header.vertex_count != header.leaf_count
        || header.step != 0.0
        || header.flags & (flag::STRIPS | flag::PATCHES) != 0
    {
        return Err((12, "points that are no leaves".to_owned()));
    }
    let mut sections = PageSections {
        bytes,
        at: LEAF_HEADER,
    };
    let words = sections.take(header.node_count as usize * 4, "nodes")?;
    let first_leaf = sections.at;
    let leaves = sections.take(leaf_count * LEAF, "leaves")?;
    let colors = sections.take(leaf_count * header.color_bytes(), "colors")?;
    sections.end()?;
    let counts = (leaf_count, header.level_count as usize);
    let mut tree = nodes::decode_tree(words, header.sphere, counts)?;
    let mut vertices = vec![Vertex::zeroed(); leaf_count];
    let wrong_leaf = |leaf: usize| {
        (
            first_leaf + leaf * LEAF,
            format!("leaf {leaf}: a code that is none"),
        )
    };
    let mut any_normal = false;
    let lowest = match *tree.level_starts.as_slice() {
        [.., lowest, end] => lowest as usize..end as usize,
        _ => 0..0,
    };
    if lowest.is_empty() {
        // A page of one leaf.
        let own = LeafPoints {
            leaves,
            colors,
            header: &header,
        };
        any_normal = own
            .fill(0..1, &header.sphere, &mut tree, &mut vertices)
            .ok_or_else(|| wrong_leaf(0))?;
    }
    for id in lowest {
        let node = &tree.nodes[id];
        let parent = PageSphere {
            center: node.center,
            radius: node.radius,
        };
        let first = node.first_child as usize;
        let range = first..first + usize::from(node.child_count);
        let own = LeafPoints {
            leaves,
            colors,
            header: &header,
        };
        any_normal |= own
            .fill(range.clone(), &parent, &mut tree, &mut vertices)
            .ok_or_else(|| wrong_leaf(first))?;
        // The same for all: the sum of squares decides.
        tree.attributes[id].area = tree.leaves[range]
            .iter()
            .map(|leaf| area_of_point(leaf.radius))
            .sum();
    }
    fill_attributes(
        words,
        &mut tree,
        &vertices,
        (header.has_colors(), any_normal),
    );
    Ok(DecodedPage {
        model: Model {
            vertices,
            tree,
            has_colors: header.has_colors(),
            ..Model::default()
        },
        base: DVec3::from_array(header.base),
        children: None,
    })
}

/// The bits of the leaves.
struct LeafPoints<'a> {
    leaves: &'a [u8],
    colors: &'a [u8],
    header: &'a LeafPageHeader,
}

impl LeafPoints<'_> {
    /// Decodes some leaves of one parent; `None` for a code that is none, else whether one has a normal.
    #[inline(always)]
    fn fill(
        &self,
        range: std::ops::Range<usize>,
        parent: &PageSphere,
        tree: &mut Tree,
        vertices: &mut [Vertex],
    ) -> Option<bool> {
        let table = packed_normals();
        let mut any_normal = false;
        for leaf in range {
            let word = leaf_word(self.leaves, leaf);
            if !word.is_sound() {
                return None;
            }
            let own = word.decode(parent);
            let normal = normal_of(table, word.normal());
            any_normal |= normal.is_some();
            let [r, g, b] = match self.header.color_bytes() {
                0 => [255; 3],
                2 => match self
                    .colors
                    .get(leaf * 2..)
                    .and_then(|rest| rest.first_chunk::<2>())
                {
                    Some(code) => color_from_565(u16::from_le_bytes(*code)),
                    None => [255; 3],
                },
                _ => *self
                    .colors
                    .get(leaf * 3..)
                    .and_then(|rest| rest.first_chunk::<3>())?,
            };
            *tree.leaves.get_mut(leaf)? = own;
            *vertices.get_mut(leaf)? = Vertex {
                position: own.center,
                normal: normal.unwrap_or_default(),
                color: [r, g, b, if normal.is_some() { 255 } else { 0 }],
            };
        }
        Some(any_normal)
    }
}

fn fill_attributes(
    words: &[u8],
    tree: &mut Tree,
    vertices: &[Vertex],
    (has_colors, any_normal): (bool, bool),
) {
    let mut sums = ColorSums {
        sums: Vec::new(),
        any_normal,
    };
    if has_colors {
        sums.sums = vec![[0.0; 4]; tree.nodes.len()];
        for (sum, node) in sums.sums.iter_mut().zip(tree.nodes.iter()) {
            if !node.has_leaves() {
                continue;
            }
            let first = node.first_child as usize;
            let own = first..first + usize::from(node.child_count);
            for (leaf, vertex) in tree.leaves[own.clone()].iter().zip(&vertices[own]) {
                let weight = area_of_point(leaf.radius).max(1e-30);
                let [r, g, b, _] = vertex.color;
                for (sum, value) in sum.iter_mut().zip([r, g, b].map(f32::from)) {
                    *sum += value * weight;
                }
                sum[3] += weight;
            }
        }
    }
    sums.fill(words, tree, has_colors);
    // 254ths, rounded up.
    let codes = THICKNESS.map(|share| (share * 254.0).ceil() as u8);
    for id in 0..tree.nodes.len() {
        let word = nodes::word(words, id);
        let thickness = word.cone() | usize::from(word.is_special()) << 2;
        let own = &mut tree.attributes[id];
        if own.has_normal() {
            own.color[3] = 255 - codes[thickness];
        }
    }
}
