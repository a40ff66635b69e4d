//! Upper pages: the nodes above the leaf pages, in the records of the tree, and the directory of the pages below.

use super::{ChildPages, DecodedPage, PageFault, PageSections, finish, kind};
use crate::abi::Vertex;
use crate::pages::extract::link;
use crate::pages::format::{LARGEST_PAGE, MOST_LEAVES, MOST_LEVELS, PageEntry};
use crate::tree::{
    AlignedRecords, Leaf, Model, Moments, Node, NodeAttributes, NormalCone, Tree, links,
};
use bytemuck::{AnyBitPattern, Pod, Zeroable};
use glam::DVec3;

const LEAF_PAGES: u32 = 1;
const COLORS: u32 = 2;

/// The beginning of an upper page.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct UpperPageHeader {
    kind: u32,
    /// [`LEAF_PAGES`], [`COLORS`].
    flags: u32,
    leaf_count: u32,
    node_count: u32,
    level_count: u32,
    /// Number of the first page below; the others follow it.
    first_id: u32,
    /// Where it lies; the others follow it without a gap.
    first_offset: u64,
}

const HEADER: usize = size_of::<UpperPageHeader>();

/// A page below, less what follows from the one before it.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct ChildEntry {
    checksum: u64,
    bytes: u32,
    /// Cone of its root.
    axis: [i16; 2],
    sin_half_angle: u16,
    pad: [u16; 3],
    /// Normal and color of its root.
    normal: [i16; 2],
    color: [u8; 4],
}

const CHILD: usize = size_of::<ChildEntry>();
const NODE: usize = size_of::<Node>() + size_of::<NodeAttributes>() + size_of::<Moments>();

/// Bytes of an upper page.
pub(in crate::pages) fn upper_bytes(node_count: usize, leaf_count: usize) -> usize {
    HEADER + node_count * NODE + leaf_count * (size_of::<Leaf>() + CHILD)
}

/// Where the pages below an upper page lie.
pub(in crate::pages) struct UpperPlace<'a> {
    pub(in crate::pages) entries: &'a [PageEntry],
    pub(in crate::pages) cones: &'a [NormalCone],
    pub(in crate::pages) are_leaf_pages: bool,
}

/// Writes an upper page; its leaves are the roots of the pages below.
pub(in crate::pages) fn encode_upper(part: &Model, place: &UpperPlace<'_>) -> Vec<u8> {
    let tree = &part.tree;
    let first = place.entries.first().copied().unwrap_or_default();
    let header = UpperPageHeader {
        kind: kind::UPPER,
        flags: if place.are_leaf_pages { LEAF_PAGES } else { 0 }
            | if part.has_colors { COLORS } else { 0 },
        leaf_count: tree.leaves.len() as u32,
        node_count: tree.nodes.len() as u32,
        level_count: tree.level_count() as u32,
        first_id: first.id,
        first_offset: first.offset,
    };
    let mut bytes = bytemuck::bytes_of(&header).to_vec();
    bytes.extend(bytemuck::cast_slice::<_, u8>(&tree.nodes));
    bytes.extend(bytemuck::cast_slice::<_, u8>(&tree.attributes));
    bytes.extend(bytemuck::cast_slice::<_, u8>(&tree.moments));
    bytes.extend(bytemuck::cast_slice::<_, u8>(&tree.leaves));
    for ((entry, cone), vertex) in place.entries.iter().zip(place.cones).zip(&part.vertices) {
        bytes.extend(bytemuck::bytes_of(&ChildEntry {
            checksum: entry.checksum,
            bytes: entry.bytes,
            axis: cone.axis,
            sin_half_angle: cone.sin_half_angle,
            pad: [0; 3],
            normal: vertex.normal,
            color: vertex.color,
        }));
    }
    bytes
}

fn records<T: AnyBitPattern>(bytes: &[u8]) -> impl Iterator<Item = T> {
    bytes
        .chunks_exact(size_of::<T>())
        .map(bytemuck::pod_read_unaligned)
}

pub(super) fn decode(bytes: &[u8], origin: DVec3) -> Result<DecodedPage, PageFault> {
    let mut sections = PageSections { bytes, at: 0 };
    let header: UpperPageHeader = bytemuck::pod_read_unaligned(sections.take(HEADER, "header")?);
    let wrong = |at: usize, cause: &str| (at, cause.to_owned());
    if header.flags & !(LEAF_PAGES | COLORS) != 0 {
        return Err(wrong(4, "unknown flags"));
    }
    let (node_count, leaf_count) = (header.node_count as usize, header.leaf_count as usize);
    let level_count = header.level_count as usize;
    if node_count > MOST_LEAVES
        || leaf_count > MOST_LEAVES
        || level_count > MOST_LEVELS
        || node_count == 0
    {
        return Err(wrong(8, "no nodes, or more than a page may have"));
    }
    let mut nodes = AlignedRecords::<Node>::of_tree(node_count);
    let mut attributes = AlignedRecords::<NodeAttributes>::of_tree(node_count);
    fill(
        &mut nodes,
        sections.take(node_count * size_of::<Node>(), "nodes")?,
    );
    fill(
        &mut attributes,
        sections.take(node_count * size_of::<NodeAttributes>(), "attributes")?,
    );
    let moments = records(sections.take(node_count * size_of::<Moments>(), "moments")?).collect();
    let leaves: AlignedRecords<Leaf> =
        records(sections.take(leaf_count * size_of::<Leaf>(), "leaves")?).collect();
    let children_at = sections.at;
    let children = sections.take(leaf_count * CHILD, "directory")?;
    sections.end()?;

    // Levels follow from the nodes: each is as long as the children of the one above.
    let mut level_starts = vec![0u32];
    let (mut start, mut end) = (0usize, 1usize);
    for level in 0..level_count {
        level_starts.push(end as u32);
        if level + 1 < level_count {
            let next: usize = nodes[start..end]
                .iter()
                .map(|n| usize::from(n.child_count))
                .sum();
            (start, end) = (end, end + next);
            if end > node_count {
                return Err(wrong(HEADER, "more nodes on a level than in the page"));
            }
        }
    }
    let mut tree = Tree {
        nodes,
        attributes,
        moments,
        level_starts,
        leaves,
        ..Tree::default()
    };
    let is_number = |v: f32| (0.0..=f32::MAX / 4.0).contains(&v);
    let is_sound = |a: &NodeAttributes| is_number(a.splat_radius) && is_number(a.area);
    if !tree.attributes.iter().all(is_sound)
        || !tree.nodes.iter().all(|n| is_number(n.radius))
        || !tree.leaves.iter().all(|l| is_number(l.radius))
    {
        return Err(wrong(HEADER, "a radius or an area that is none"));
    }
    link(&mut tree);
    let mut below = ChildPages {
        entries: Vec::with_capacity(leaf_count),
        cones: Vec::with_capacity(leaf_count),
        are_leaf_pages: header.flags & LEAF_PAGES != 0,
    };
    let mut vertices = Vec::with_capacity(leaf_count);
    let mut offset = header.first_offset;
    for (index, (child, leaf)) in records::<ChildEntry>(children)
        .zip(tree.leaves.iter())
        .enumerate()
    {
        let at = children_at + index * CHILD;
        if child.pad != [0; 3] || child.bytes == 0 || child.bytes > LARGEST_PAGE {
            return Err(wrong(at, "a page without bytes, or with too many"));
        }
        let id = header.first_id.checked_add(index as u32);
        let entry = PageEntry {
            id: id.ok_or_else(|| wrong(at, "a page number that is none"))?,
            bytes: child.bytes,
            offset,
            checksum: child.checksum,
        };
        offset = offset
            .checked_add(u64::from(child.bytes))
            .ok_or_else(|| wrong(at, "a page past any file"))?;
        below.entries.push(entry);
        below.cones.push(NormalCone {
            axis: child.axis,
            sin_half_angle: child.sin_half_angle,
        });
        vertices.push(Vertex {
            position: leaf.center,
            normal: child.normal,
            color: child.color,
        });
    }
    let mut page = DecodedPage {
        model: Model {
            vertices,
            tree,
            has_colors: header.flags & COLORS != 0,
            ..Model::default()
        },
        base: DVec3::ZERO,
        children: Some(below),
    };
    finish(&mut page, origin);
    links(&page.model).map_err(|cause| (HEADER, cause))?;
    Ok(page)
}

fn fill<T: Pod>(to: &mut [T], bytes: &[u8]) {
    for (to, from) in to.iter_mut().zip(records(bytes)) {
        *to = from;
    }
}
