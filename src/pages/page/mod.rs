//! A page: a part of the tree in few bits, and decoded into a small model of its own.
//!
//! A leaf page (`points`, `triangles`) is a node with all below it. Spheres, normals and cones are in QSplat's bits
//! ([`super::quantize`]), each sphere in its decoded parent's. What lies above the leaf pages is in upper pages (`upper`),
//! one node in some thousands, in the records of the tree as they are; the leaves of an upper page are the roots of the
//! pages below it, and stand for them as points until those are there.
//!
//! A page decodes into a [`Model`] with the tree that a cut walks over, in coordinates relative to an origin in double
//! precision. What is decoded is sound: a walk over it leaves no array.

mod leaf_spheres;
mod model_space;
mod nodes;
mod points;
mod triangles;
mod upper;

pub(super) use model_space::moved_sphere;
pub(super) use upper::{UpperCounts, UpperPlace, encode_upper, upper_bytes};

use super::format::{MOST_LEAVES, MOST_LEVELS};
use super::quantize::PageSphere;
use crate::patches::ResidentPatches;
use crate::tree::{Leaf, Model, NormalCone, PatchRecords, Tree, fill_moments};
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

/// Bits of a color in a leaf.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum ColorBits {
    /// 16, off by at most 4 of 255.
    #[default]
    Few,
    /// 24, exact.
    All,
}

/// What is decoded.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DecodeOptions {
    /// Compute what filtered splats need ([`crate::tree::SurfaceMoments`]); else it is zero.
    pub moments: bool,
    /// Move the page into the coordinates of a model with this world position of its zero
    /// ([`DecodedPage::in_model_space`]); else it stays in coordinates of its own.
    pub model_origin: Option<DVec3>,
}

/// A page as it is drawn.
#[derive(Debug, Clone)]
pub struct DecodedPage {
    /// The part of the model: triangles or points, or for an upper page a point for each page below it.
    pub model: Model,
    /// The zero of its coordinates in those of the whole model.
    pub base: DVec3,
    /// The pages below its leaves; `None` for a leaf page.
    pub children: Option<ChildPages>,
}

/// The pages below an upper page.
#[derive(Debug, Clone)]
pub struct ChildPages {
    /// The pages, one below each node of the first shared level in their order; where none is shared, one below each leaf.
    pub entries: Vec<super::format::PageEntry>,
    /// Cone of the normals below each leaf.
    pub cones: Vec<NormalCone>,
    /// Whether those are leaf pages.
    pub are_leaf_pages: bool,
    /// Levels of nodes, the last of this page, that the pages below have as well.
    pub shared_levels: usize,
    /// The first node of these levels.
    pub first_shared: u32,
    /// Entry of each node of these levels, then of each leaf; empty where none is shared.
    pub(super) owners: Vec<u32>,
}

impl ChildPages {
    /// Index of the page below that has a leaf.
    pub fn page_of_leaf(&self, tree: &Tree, leaf: u32) -> usize {
        if self.shared_levels == 0 {
            return leaf as usize;
        }
        let nodes = tree.nodes.len() - self.first_shared as usize;
        let own = self.owners.get(nodes + leaf as usize).copied();
        own.unwrap_or(0) as usize
    }

    /// Index of the page below that has a node as well; `None` of nodes that this page has alone.
    pub fn page_of_node(&self, node: u32) -> Option<usize> {
        let at = node.checked_sub(self.first_shared)?;
        let own = self.owners.get(at as usize).copied();
        own.map(|own| own as usize)
    }

    /// Sphere that stands for a page below: center and radius.
    pub fn sphere(&self, tree: &Tree, index: usize) -> (Vec3, f32) {
        if self.shared_levels == 0 {
            let leaf = &tree.leaves[index];
            return (leaf.center, leaf.radius);
        }
        let node = &tree.nodes[self.first_shared as usize + index];
        (node.center, node.radius)
    }

    /// Number of nodes that no page below has.
    pub fn own_nodes(&self, tree: &Tree) -> usize {
        match self.shared_levels {
            0 => tree.nodes.len(),
            _ => self.first_shared as usize,
        }
    }
}

impl DecodedPage {
    /// Bytes in memory.
    pub fn memory_bytes(&self) -> u64 {
        let children = self
            .children
            .as_ref()
            .map_or(0, |below| below.entries.len() * 32 + below.owners.len() * 4);
        let made =
            |own: &PatchRecords| own.bytes() + own.records.len() * ResidentPatches::NODE_BYTES;
        let patches = self.model.patches.as_deref().map_or(0, made);
        self.model.memory_bytes().total() + (children + patches + size_of::<Self>()) as u64
    }
}

/// What is wrong with a page, in words, with the byte in the page.
pub(super) type PageFault = (usize, String);

/// Kinds of pages, the first word of each.
mod kind {
    pub(super) const UPPER: u32 = 0;
    pub(super) const POINTS: u32 = 1;
    pub(super) const TRIANGLES: u32 = 2;
}

/// Bits of a leaf page's flags.
mod flag {
    /// Leaves (or vertices) have colors of 16 bits.
    pub(super) const FEW_COLORS: u32 = 1;
    /// Of 24 bits.
    pub(super) const ALL_COLORS: u32 = 2;
    /// Some nodes have capsules thinner than their sphere.
    pub(super) const STRIPS: u32 = 4;
    /// Nodes have records of error patches, the last section.
    pub(super) const PATCHES: u32 = 8;
}

/// The beginning of a leaf page.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct LeafPageHeader {
    kind: u32,
    flags: u32,
    leaf_count: u32,
    vertex_count: u32,
    node_count: u32,
    level_count: u32,
    /// The root's, exact.
    sphere: PageSphere,
    /// The page's zero in model space.
    base: [f64; 3],
    /// Distance between places of vertices, a power of two; 0 for points.
    step: f64,
}

const LEAF_HEADER: usize = size_of::<LeafPageHeader>();

impl LeafPageHeader {
    fn read(bytes: &[u8]) -> Result<Self, PageFault> {
        let start = bytes.get(..LEAF_HEADER);
        let start = start.ok_or_else(|| (bytes.len(), "ends within its header".to_owned()))?;
        let header: Self = bytemuck::pod_read_unaligned(start);
        let wrong = |at: usize, cause: &str| Err((at, cause.to_owned()));
        let known = flag::FEW_COLORS | flag::ALL_COLORS | flag::STRIPS | flag::PATCHES;
        let both = flag::FEW_COLORS | flag::ALL_COLORS;
        if header.flags & !known != 0 || header.flags & both == both {
            return wrong(4, "unknown flags");
        }
        for (at, count) in [
            (8, header.leaf_count),
            (12, header.vertex_count),
            (16, header.node_count),
        ] {
            if count as usize > MOST_LEAVES {
                return wrong(at, "more leaves, vertices or nodes than a page may have");
            }
        }
        if header.leaf_count == 0
            || header.level_count as usize > MOST_LEVELS
            || (header.node_count == 0) != (header.level_count == 0)
        {
            return wrong(8, "no leaves, or levels without nodes");
        }
        let sphere = header.sphere;
        let is_sound = sphere.center.is_finite()
            && (0.0..=f32::MAX / 4.0).contains(&sphere.radius)
            && sphere.center.abs().max_element() <= f32::MAX / 4.0;
        if !is_sound {
            return wrong(24, "a sphere that is none");
        }
        if !(header.base.iter().all(|v| v.is_finite())
            && (0.0..=f64::from(f32::MAX)).contains(&header.step))
        {
            return wrong(40, "an origin or a step that is none");
        }
        Ok(header)
    }

    fn has_colors(&self) -> bool {
        self.flags & (flag::FEW_COLORS | flag::ALL_COLORS) != 0
    }

    fn color_bytes(&self) -> usize {
        match self.flags & (flag::FEW_COLORS | flag::ALL_COLORS) {
            0 => 0,
            flag::FEW_COLORS => 2,
            _ => 3,
        }
    }
}

/// Sections of a page, one after the other.
struct PageSections<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> PageSections<'a> {
    fn take(&mut self, count: usize, what: &str) -> Result<&'a [u8], PageFault> {
        let end = self.at.saturating_add(count);
        let section = self.bytes.get(self.at..end);
        let section = section.ok_or_else(|| (self.at, format!("ends within its {what}")))?;
        self.at = end;
        Ok(section)
    }

    /// Records of the patches of so many nodes.
    fn patches(&mut self, nodes: usize, has_colors: bool) -> Result<PatchRecords, PageFault> {
        let count = nodes * PatchRecords::node_bytes(has_colors);
        let bytes = self.take(count, "records of patches")?;
        Ok(PatchRecords::of_bytes(bytes, nodes))
    }

    fn end(&self) -> Result<(), PageFault> {
        if self.at == self.bytes.len() {
            Ok(())
        } else {
            Err((self.at, "bytes after its last section".to_owned()))
        }
    }
}

/// The choices of a page's writer.
#[derive(Debug, Clone, Copy)]
pub(super) struct PageChoices {
    pub(super) colors: ColorBits,
    /// The page's zero, model space.
    pub(super) base: DVec3,
    /// Distance of places of vertices; every vertex is at a multiple of it.
    pub(super) step: f64,
}

/// A leaf page in bytes, and its root's sphere in model space, which contains all that is decoded.
pub(super) struct EncodedPage {
    pub(super) bytes: Vec<u8>,
    pub(super) root: PageSphere,
}

/// Writes a part of a model, all of whose leaves are in the page.
pub(super) fn encode_leaves(part: &Model, choices: PageChoices) -> EncodedPage {
    if part.triangles.is_empty() {
        points::encode(part, choices)
    } else {
        triangles::encode(part, choices)
    }
}

/// Decodes a page of a model with this origin.
///
/// # Errors
/// The first fault.
pub(super) fn decode(
    bytes: &[u8],
    origin: DVec3,
    options: DecodeOptions,
) -> Result<DecodedPage, PageFault> {
    let first = bytes
        .first_chunk::<4>()
        .map(|word| u32::from_le_bytes(*word));
    let mut page = match first {
        Some(kind::UPPER) => return upper::decode(bytes, origin),
        Some(kind::POINTS) => points::decode(bytes)?,
        Some(kind::TRIANGLES) => triangles::decode(bytes)?,
        _ => return Err((0, "an unknown kind of page".to_owned())),
    };
    finish(&mut page, origin);
    if options.moments {
        fill_moments(&mut page.model);
    }
    Ok(page)
}

/// What a model knows as a whole.
fn finish(page: &mut DecodedPage, origin: DVec3) {
    let model = &mut page.model;
    let (center, radius) = match (model.tree.nodes.first(), model.tree.leaves.first()) {
        (Some(root), _) => (root.center, root.radius),
        (None, Some(leaf)) => (leaf.center, leaf.radius),
        (None, None) => (Vec3::ZERO, 0.0),
    };
    model.origin = origin + page.base;
    model.used_vertices = model.vertices.len() as u32;
    (model.min, model.max) = (center - radius, center + radius);
    (model.orbit_center, model.orbit_radius) = (center, radius);
}

/// Spheres of a part's nodes in page coordinates, each grown until it holds those of its children, in double precision;
/// `leaves` are the leaves' as they are decoded. The root's last: with its center as it is stored.
fn grown(tree: &Tree, leaves: &[Leaf], base: DVec3) -> (Vec<(DVec3, f64)>, PageSphere) {
    let mut spheres = vec![(DVec3::ZERO, 0.0); tree.nodes.len()];
    let leaf_ball = |leaf: u32| {
        let leaf = &leaves[leaf as usize];
        (leaf.center.as_dvec3(), f64::from(leaf.radius))
    };
    for id in (0..tree.nodes.len()).rev() {
        let node = &tree.nodes[id];
        let mut center = node.center.as_dvec3() - base;
        if id == 0 {
            center = center.as_vec3().as_dvec3();
        }
        let mut radius = f64::from(node.radius);
        for child in tree.children(id as u32) {
            let (own, reach) = if node.has_leaves() {
                leaf_ball(child)
            } else {
                spheres[child as usize]
            };
            radius = radius.max(center.distance(own) + reach);
        }
        // Room for the roundings of sums on the way down.
        spheres[id] = (center, radius * (1.0 + 1e-12));
    }
    let root = match spheres.first() {
        Some(&(center, radius)) => (center, radius),
        None => leaf_ball(0),
    };
    let root = PageSphere {
        center: root.0.as_vec3(),
        radius: crate::math::sphere::round_up(root.1 * (1.0 + 1e-9)),
    };
    (spheres, root)
}

/// A sphere of page coordinates in model space: grown by what the rounding moves its center.
fn in_model_space(sphere: PageSphere, base: DVec3) -> PageSphere {
    let exact = base + sphere.center.as_dvec3();
    let center = exact.as_vec3();
    let moved = center.as_dvec3().distance(exact);
    PageSphere {
        center,
        radius: crate::math::sphere::round_up(f64::from(sphere.radius) + moved),
    }
}
