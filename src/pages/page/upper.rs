//! Upper pages: the nodes above the leaf pages, in the records of the tree, and the directory of the pages below.
//!
//! The lowest of them have the first levels of the leaf pages as well ([`crate::pages::page_tops`]).

use super::{ChildPages, DecodedPage, PageFault, PageSections, finish, kind};
use crate::abi::Vertex;
use crate::pages::extract::link;
use crate::pages::format::{LARGEST_PAGE, MOST_LEAVES, MOST_LEVELS, PageEntry};
use crate::tree::{
    AlignedRecords, Leaf, Model, Node, NodeAttributes, NormalCone, SurfaceMoments, Tree, links,
};
use bytemuck::{AnyBitPattern, Pod, Zeroable};
use glam::DVec3;
use std::sync::Arc;

const LEAF_PAGES: u32 = 1;
const COLORS: u32 = 2;
/// Nodes have records of error patches, before the directory.
const PATCHES: u32 = 4;
/// Place of the number of levels that the pages below have as well.
const SHARED_SHIFT: u32 = 8;
const SHARED: u32 = 0xff << SHARED_SHIFT;

/// The beginning of an upper page.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct UpperPageHeader {
    kind: u32,
    /// [`LEAF_PAGES`], [`COLORS`], [`SHARED`].
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

/// A page below several leaves, less what follows from the one before it.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct SharingEntry {
    checksum: u64,
    bytes: u32,
    pad: u32,
}

/// What a leaf has besides its sphere where the pages below have several leaves each.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct SharedLeaf {
    axis: [i16; 2],
    sin_half_angle: u16,
    pad: u16,
    normal: [i16; 2],
    color: [u8; 4],
}

const SHARING: usize = size_of::<SharingEntry>();
const SHARED_LEAF: usize = size_of::<SharedLeaf>();
const NODE: usize = size_of::<Node>() + size_of::<NodeAttributes>() + size_of::<SurfaceMoments>();

/// Bytes of an upper page.
pub(in crate::pages) fn upper_bytes(counts: UpperCounts) -> usize {
    let UpperCounts {
        nodes,
        leaves,
        pages,
        is_shared,
        patch_bytes,
    } = counts;
    let directory = match is_shared {
        false => leaves * CHILD,
        true => leaves * SHARED_LEAF + pages * SHARING,
    };
    HEADER + nodes * (NODE + patch_bytes) + leaves * size_of::<Leaf>() + directory
}

/// Numbers of records of an upper page.
#[derive(Debug, Clone, Copy)]
pub(in crate::pages) struct UpperCounts {
    pub(in crate::pages) nodes: usize,
    pub(in crate::pages) leaves: usize,
    /// Pages below: as many as leaves unless levels are shared.
    pub(in crate::pages) pages: usize,
    pub(in crate::pages) is_shared: bool,
    /// Bytes of the record of an error patch of each node; 0 where there are none.
    pub(in crate::pages) patch_bytes: usize,
}

/// Where the pages below an upper page lie.
pub(in crate::pages) struct UpperPlace<'a> {
    pub(in crate::pages) entries: &'a [PageEntry],
    pub(in crate::pages) cones: &'a [NormalCone],
    pub(in crate::pages) are_leaf_pages: bool,
    /// Levels of nodes that the pages below have as well.
    pub(in crate::pages) shared_levels: usize,
}

/// Writes an upper page; its leaves are the roots of the pages below.
pub(in crate::pages) fn encode_upper(part: &Model, place: &UpperPlace<'_>) -> Vec<u8> {
    let tree = &part.tree;
    let first = place.entries.first().copied().unwrap_or_default();
    let header = UpperPageHeader {
        kind: kind::UPPER,
        flags: if place.are_leaf_pages { LEAF_PAGES } else { 0 }
            | if part.has_colors { COLORS } else { 0 }
            | if part.patches.is_some() { PATCHES } else { 0 }
            | (place.shared_levels as u32) << SHARED_SHIFT & SHARED,
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
    if let Some(patches) = &part.patches {
        patches.append_to(&mut bytes);
    }
    if place.shared_levels > 0 {
        for (cone, vertex) in place.cones.iter().zip(&part.vertices) {
            bytes.extend(bytemuck::bytes_of(&SharedLeaf {
                axis: cone.axis,
                sin_half_angle: cone.sin_half_angle,
                pad: 0,
                normal: vertex.normal,
                color: vertex.color,
            }));
        }
        for entry in place.entries {
            bytes.extend(bytemuck::bytes_of(&SharingEntry {
                checksum: entry.checksum,
                bytes: entry.bytes,
                pad: 0,
            }));
        }
        return bytes;
    }
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
    if header.flags & !(LEAF_PAGES | COLORS | PATCHES | SHARED) != 0 {
        return Err(wrong(4, "unknown flags"));
    }
    let (node_count, leaf_count) = (header.node_count as usize, header.leaf_count as usize);
    let level_count = header.level_count as usize;
    let shared = ((header.flags & SHARED) >> SHARED_SHIFT) as usize;
    if node_count > MOST_LEAVES
        || leaf_count > MOST_LEAVES
        || level_count > MOST_LEVELS
        || node_count == 0
        || shared >= level_count.max(1)
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
    let moments =
        records(sections.take(node_count * size_of::<SurfaceMoments>(), "moments")?).collect();
    let leaves: AlignedRecords<Leaf> =
        records(sections.take(leaf_count * size_of::<Leaf>(), "leaves")?).collect();
    let has_colors = header.flags & COLORS != 0;
    let patches = match header.flags & PATCHES {
        0 => None,
        _ => Some(Arc::new(sections.patches(node_count, has_colors)?)),
    };
    let directory_at = sections.at;
    let directory = &bytes[directory_at..];
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
    let mut page = DecodedPage {
        model: Model {
            tree,
            has_colors,
            patches,
            ..Model::default()
        },
        base: DVec3::ZERO,
        children: None,
    };
    finish(&mut page, origin);
    let mut sections = PageSections {
        bytes: directory,
        at: 0,
    };
    let at_directory = |(at, cause): PageFault| (directory_at + at, cause);
    let looks = leaf_looks(&mut sections, leaf_count, shared).map_err(at_directory)?;
    let vertex = |(look, leaf): (&SharedLeaf, &Leaf)| Vertex {
        position: leaf.center,
        normal: look.normal,
        color: look.color,
    };
    page.model.vertices = looks
        .iter()
        .zip(page.model.tree.leaves.iter())
        .map(vertex)
        .collect();
    page.model.used_vertices = page.model.vertices.len() as u32;
    links(&page.model).map_err(|cause| (HEADER, cause))?;
    let tree = &page.model.tree;
    let first_shared = tree.level_starts[level_count - shared];
    let page_count = match shared {
        0 => leaf_count,
        _ => tree.level(level_count - shared).len(),
    };
    let entries = page_entries(&mut sections, &header, page_count, shared).map_err(at_directory)?;
    let cones = looks.iter().map(|look| NormalCone {
        axis: look.axis,
        sin_half_angle: look.sin_half_angle,
    });
    page.children = Some(ChildPages {
        entries,
        cones: cones.collect(),
        are_leaf_pages: header.flags & LEAF_PAGES != 0,
        shared_levels: shared,
        owners: match shared {
            0 => Vec::new(),
            _ => owners(tree, first_shared),
        },
        first_shared,
    });
    Ok(page)
}

/// What the leaves of an upper page have besides spheres.
fn leaf_looks(
    sections: &mut PageSections<'_>,
    count: usize,
    shared: usize,
) -> Result<Vec<SharedLeaf>, PageFault> {
    if shared > 0 {
        let looks: Vec<SharedLeaf> =
            records(sections.take(count * SHARED_LEAF, "looks of leaves")?).collect();
        let is_padded = looks.iter().all(|look| look.pad == 0);
        return match is_padded {
            true => Ok(looks),
            false => Err((0, "bytes that mean nothing are not zero".to_owned())),
        };
    }
    // The directory has them.
    let directory = sections.take(count * CHILD, "directory")?;
    sections.at = 0;
    let look = |child: ChildEntry| SharedLeaf {
        axis: child.axis,
        sin_half_angle: child.sin_half_angle,
        pad: 0,
        normal: child.normal,
        color: child.color,
    };
    Ok(records::<ChildEntry>(directory).map(look).collect())
}

/// The entries of the pages below, to the end of the page.
fn page_entries(
    sections: &mut PageSections<'_>,
    header: &UpperPageHeader,
    count: usize,
    shared: usize,
) -> Result<Vec<PageEntry>, PageFault> {
    let start = sections.at;
    let size = if shared == 0 { CHILD } else { SHARING };
    let directory = sections.take(count * size, "directory")?;
    sections.end()?;
    let mut entries = Vec::with_capacity(count);
    let mut offset = header.first_offset;
    for index in 0..count {
        let at = start + index * size;
        let bytes = &directory[index * size..(index + 1) * size];
        let (checksum, bytes, is_padded) = if shared == 0 {
            let child: ChildEntry = bytemuck::pod_read_unaligned(bytes);
            (child.checksum, child.bytes, child.pad == [0; 3])
        } else {
            let own: SharingEntry = bytemuck::pod_read_unaligned(bytes);
            (own.checksum, own.bytes, own.pad == 0)
        };
        let wrong = |cause: &str| (at, cause.to_owned());
        if !is_padded || bytes == 0 || bytes > LARGEST_PAGE {
            return Err(wrong("a page without bytes, or with too many"));
        }
        let id = header.first_id.checked_add(index as u32);
        entries.push(PageEntry {
            id: id.ok_or_else(|| wrong("a page number that is none"))?,
            bytes,
            offset,
            checksum,
        });
        offset = offset
            .checked_add(u64::from(bytes))
            .ok_or_else(|| wrong("a page past any file"))?;
    }
    Ok(entries)
}

/// The page below that has each node from `first` on, then that of each leaf: indices of entries.
fn owners(tree: &Tree, first: u32) -> Vec<u32> {
    let nodes = tree.nodes.len();
    let mut owners = vec![0u32; nodes - first as usize + tree.leaves.len()];
    let roots = tree.level(tree.level_of(first));
    for id in first..nodes as u32 {
        if roots.contains(&id) {
            owners[(id - first) as usize] = id - first;
        }
        let own = owners[(id - first) as usize];
        let node = &tree.nodes[id as usize];
        let start = match node.has_leaves() {
            true => nodes - first as usize,
            false => 0,
        };
        let shift = if node.has_leaves() { 0 } else { first };
        for child in tree.children(id) {
            owners[start + (child - shift) as usize] = own;
        }
    }
    owners
}

fn fill<T: Pod>(to: &mut [T], bytes: &[u8]) {
    for (to, from) in to.iter_mut().zip(records(bytes)) {
        *to = from;
    }
}
