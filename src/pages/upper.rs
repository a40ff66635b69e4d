//! The pages above the leaf pages of a file: their nodes, and their directory.

use super::extract::{UpperNodes, UpperPart, levels_below, patches_below, upper_part, with_tops};
use super::format::{LARGEST_PAGE, PageEntry, PagedHeader};
use super::page::{
    DecodeOptions, DecodedPage, EncodedPage, UpperCounts, UpperPlace, decode, encode_upper,
    moved_sphere, upper_bytes,
};
use super::page_tops::{PageTop, TopSize, TopSource};
use super::quantize::PageSphere;
use crate::math::cone::{DirectionCap, sin_around};
use crate::math::sphere::round_up;
use crate::tree::file::hash;
use crate::tree::{
    Error, Model, Node, NodeAttributes, NodeRecords, NodeStrip, NormalCone, PatchRecords, Tree,
};
use glam::DVec3;
use std::ops::Range;

/// Levels of an upper page: at most 4⁵ pages below it.
const UPPER_LEVELS: usize = 5;

/// The same of those right above leaf pages whose first levels they have as well.
const SHARING_LEVELS: usize = 4;

/// A leaf page as those above it need it.
#[derive(Debug, Clone, Copy)]
pub(super) struct LeafPageFacts {
    bytes: usize,
    checksum: u64,
    root: PageSphere,
    /// Cone, flags and attributes of its root as they are decoded; `None` for a page of one leaf.
    first: Option<(NormalCone, u8, NodeAttributes)>,
}

impl LeafPageFacts {
    /// Facts of the first page of another file, whose root has these records in the model space of the file that is made.
    pub(super) fn of_root(entry: &PageEntry, root: &NodeRecords) -> Self {
        Self {
            bytes: entry.bytes as usize,
            checksum: entry.checksum,
            root: PageSphere {
                center: root.node.center,
                radius: root.node.radius,
            },
            first: Some((root.node.cone, root.node.flags, root.attributes)),
        }
    }

    /// Decodes a page just written, which was made of what is below a node of the model. Gives its first levels, too.
    ///
    /// # Errors
    /// The page cannot be decoded, which no page of ours does.
    pub(super) fn of(
        page: &EncodedPage,
        model: &Model,
        root: Option<u32>,
        shared: usize,
    ) -> Result<(Self, PageTop), Error> {
        let decoded = decode(&page.bytes, DVec3::ZERO, DecodeOptions::default());
        let decoded = decoded.map_err(|(offset, cause)| Error::File {
            path: "a page just written".into(),
            offset: offset as u64,
            cause,
        })?;
        let tree = &decoded.model.tree;
        let first = tree.nodes.first().zip(tree.attributes.first());
        let facts = Self {
            bytes: page.bytes.len(),
            checksum: hash(&page.bytes),
            root: page.root,
            first: first.map(|(node, own)| (node.cone, node.flags, *own)),
        };
        let top = root.map(|root| top_of(&decoded, model, root, shared));
        Ok((facts, top.unwrap_or_default()))
    }
}

/// The first levels of a decoded page, which was made of what is below a node of the model.
fn top_of(page: &DecodedPage, model: &Model, root: u32, shared: usize) -> PageTop {
    if shared == 0 {
        return PageTop::default();
    }
    let level = model.tree.level_of(root);
    let ids = levels_below(&model.tree, root, level + shared);
    let tree = &page.model.tree;
    let records = ids.into_iter().flatten().zip(tree.nodes.iter());
    let records = records.zip(tree.attributes.iter());
    let records = records.map(|((id, node), attributes)| {
        let mut node = *node;
        (node.center, node.radius) = moved_sphere(node.center, node.radius, page.base);
        NodeRecords {
            node,
            attributes: *attributes,
            moments: model.tree.moments[id as usize],
        }
    });
    PageTop(records.collect())
}

/// The leaf pages of a file.
pub(super) struct LeafPages<'a> {
    /// The level of the tree whose nodes are their roots.
    pub(super) level: usize,
    /// Byte of the file at which the first page lies.
    pub(super) first_byte: u64,
    /// One for each node of the level.
    pub(super) pages: &'a [LeafPageFacts],
    /// Sizes of the leaf pages in the pages above.
    pub(super) sizes: &'a [TopSize],
    /// Levels that the pages above have as well.
    pub(super) shared: usize,
    /// The farthest that a vertex was moved.
    pub(super) moved: f64,
    /// Records of the patches of all nodes of the model.
    pub(super) patches: Option<&'a PatchRecords>,
}

/// The rest of a file.
pub(super) struct UpperPages {
    pub(super) header: PagedHeader,
    /// The pages above the leaf pages, as they lie in the file.
    pub(super) pages: Vec<Vec<u8>>,
}

/// Levels of the tree at which pages begin, from the top; the last is that of the leaf pages.
fn bands(leaf_level: usize, shared: usize) -> Vec<usize> {
    let mut bands = vec![leaf_level];
    if shared > 0 && leaf_level > 0 {
        bands.insert(0, leaf_level.saturating_sub(SHARING_LEVELS));
    }
    while let Some(&top) = bands.first()
        && top > 0
    {
        bands.insert(0, top.saturating_sub(UPPER_LEVELS));
    }
    bands
}

/// Number of nodes of a level; a tree without nodes has one page.
fn level_len(tree: &Tree, level: usize) -> usize {
    match tree.nodes.is_empty() {
        true => 1,
        false => tree.level(level).len(),
    }
}

/// Number of nodes from `root` on in as many levels, and the nodes below the last of them.
fn counts(tree: &Tree, root: u32, levels: Range<usize>) -> (usize, Range<u32>) {
    let (mut own, mut nodes) = (root..root + 1, 0);
    for _ in levels {
        nodes += own.len();
        own = tree.children(own.start).start..tree.children(own.end - 1).end;
    }
    (nodes, own)
}

/// Numbers of records of the page from `root` in level `levels.start` on, and the roots of the pages below it. `sizes` are
/// those of the leaf pages where these are below it.
fn upper_counts(
    tree: &Tree,
    root: u32,
    levels: Range<usize>,
    sizes: Option<&[TopSize]>,
) -> (UpperCounts, Range<u32>) {
    let first = tree.level(levels.end).start;
    let (nodes, roots) = counts(tree, root, levels);
    let mut counts = UpperCounts {
        nodes,
        leaves: roots.len(),
        pages: roots.len(),
        is_shared: false,
        patch_bytes: 0,
    };
    let own =
        sizes.and_then(|all| all.get((roots.start - first) as usize..(roots.end - first) as usize));
    if let Some(sizes) = own
        && sizes.iter().any(|size| *size != TopSize::ALONE)
    {
        counts.nodes += sizes.iter().map(|size| size.nodes as usize).sum::<usize>();
        counts.leaves = sizes.iter().map(|size| size.leaves as usize).sum();
        counts.is_shared = true;
    }
    (counts, roots)
}

/// Bytes of all pages above the leaf pages, by the links of the tree alone.
pub(super) fn upper_length(
    tree: &Tree,
    leaf_level: usize,
    sizes: &[TopSize],
    shared: usize,
) -> u64 {
    let bands = bands(leaf_level, shared);
    let of_band = |pair: &[usize]| -> u64 {
        let sizes = (pair[1] == leaf_level).then_some(sizes);
        let pages = tree.level(pair[0]).map(|root| {
            let (counts, _) = upper_counts(tree, root, pair[0]..pair[1], sizes);
            upper_bytes(counts) as u64
        });
        pages.sum()
    };
    bands.windows(2).map(of_band).sum()
}

/// The places of all pages, band by band; checksums are not known yet.
fn page_places(
    tree: &Tree,
    bands: &[usize],
    leaves: &LeafPages<'_>,
) -> Result<Vec<Vec<PageEntry>>, Error> {
    let page_count: usize = bands.iter().map(|&level| level_len(tree, level)).sum();
    if page_count > u32::MAX as usize {
        return Err(Error::TooLarge {
            what: "pages",
            count: page_count,
            limit: u32::MAX as usize,
        });
    }
    let mut entries: Vec<Vec<PageEntry>> = Vec::new();
    let (mut offset, mut id) = (leaves.first_byte, 0u32);
    for (band, &level) in bands.iter().enumerate() {
        let mut own = Vec::new();
        for index in 0..level_len(tree, level) {
            let bytes = match bands.get(band + 1) {
                None => leaves.pages.get(index).map_or(0, |page| page.bytes),
                Some(&next) => {
                    let root = tree.level(level).start + index as u32;
                    let sizes = (next == leaves.level).then_some(leaves.sizes);
                    let (counts, _) = upper_counts(tree, root, level..next, sizes);
                    let each =
                        |own: &PatchRecords| PatchRecords::node_bytes(!own.colors.is_empty());
                    upper_bytes(UpperCounts {
                        patch_bytes: leaves.patches.map_or(0, each),
                        ..counts
                    })
                }
            };
            if bytes > LARGEST_PAGE as usize {
                return Err(Error::TooLarge {
                    what: "bytes of a page",
                    count: bytes,
                    limit: LARGEST_PAGE as usize,
                });
            }
            own.push(PageEntry {
                id,
                bytes: bytes as u32,
                offset,
                checksum: 0,
            });
            offset += bytes as u64;
            id += 1;
        }
        entries.push(own);
    }
    Ok(entries)
}

/// Makes the pages above the leaf pages and completes the header. Of the model's tree only the levels down to that of the
/// leaf pages are looked at.
///
/// # Errors
/// More pages than 32 bits can number, or too large ones.
pub(super) fn upper_pages(
    model: &Model,
    leaves: &LeafPages<'_>,
    tops: &mut dyn TopSource,
    mut header: PagedHeader,
) -> Result<UpperPages, Error> {
    let tree = &model.tree;
    let bands = bands(leaves.level, leaves.shared);
    let upper = grown_nodes(model, leaves);
    // Lengths of upper pages follow from their numbers, so all places are known before anything is written.
    let mut entries = page_places(tree, &bands, leaves)?;
    if let Some(own) = entries.last_mut() {
        for (entry, page) in own.iter_mut().zip(leaves.pages) {
            entry.checksum = page.checksum;
        }
    }
    // From the lowest up, so that checksums of what is below are known.
    let mut pages: Vec<Vec<Vec<u8>>> = Vec::new();
    for band in (0..bands.len().saturating_sub(1)).rev() {
        let next = bands[band + 1];
        let below = &entries[band + 1];
        let are_leaf_pages = band + 2 == bands.len();
        let shared = if are_leaf_pages { leaves.shared } else { 0 };
        let mut own: Vec<Vec<u8>> = Vec::new();
        for root in tree.level(bands[band]) {
            let (_, roots) = counts(tree, root, bands[band]..next);
            let first = tree.level(next).start;
            let range = (roots.start - first) as usize..(roots.end - first) as usize;
            let mut below_tops = Vec::new();
            for _ in range.clone().filter(|_| shared > 0) {
                below_tops.push(tops.next_top().map_err(|source| Error::Io {
                    path: "the temporary file".into(),
                    source,
                })?);
            }
            let part = upper_part(model, &upper, root, next);
            let UpperPart { mut part, cones } = with_tops(part, &below_tops, shared);
            part.patches =
                (leaves.patches).map(|own| patches_below(own, tree, root, next + shared));
            let place = UpperPlace {
                entries: &below[range],
                cones: &cones,
                are_leaf_pages,
                shared_levels: shared,
            };
            own.push(encode_upper(&part, &place));
        }
        for (entry, page) in entries[band].iter_mut().zip(&own) {
            entry.checksum = hash(page);
        }
        pages.push(own);
    }
    let all = || entries.iter().flatten();
    header.file_length = all().last().map_or(leaves.first_byte, PageEntry::end);
    header.page_count = all().count() as u64;
    header.root = all().next().copied().unwrap_or_default();
    header.checksum = header.own_checksum();
    Ok(UpperPages {
        header,
        pages: pages.into_iter().rev().flatten().collect(),
    })
}

/// The nodes down to the roots of the leaf pages. Spheres and cones are grown until they hold what is decoded below, radii by
/// what vertices were moved.
fn grown_nodes(model: &Model, leaves: &LeafPages<'_>) -> UpperNodes {
    let tree = &model.tree;
    if tree.nodes.is_empty() {
        return UpperNodes {
            nodes: Vec::new(),
            attributes: Vec::new(),
        };
    }
    let roots = tree.level(leaves.level);
    let end = roots.end as usize;
    let mut nodes = tree.nodes[..end].to_vec();
    let mut attributes = tree.attributes[..end].to_vec();
    for (id, page) in roots.zip(leaves.pages) {
        let id = id as usize;
        let node = &mut nodes[id];
        (node.center, node.radius) = (page.root.center, page.root.radius);
        if let Some((cone, flags, own)) = page.first {
            (node.cone, node.flags, attributes[id]) = (cone, flags, own);
        }
    }
    for id in (0..tree.level(leaves.level).start).rev() {
        let children = tree.children(id);
        let children = children.start as usize..children.end as usize;
        let center = nodes[id as usize].center.as_dvec3();
        let reach = nodes[children.clone()]
            .iter()
            .map(|child| center.distance(child.center.as_dvec3()) + f64::from(child.radius))
            .fold(f64::from(nodes[id as usize].radius), f64::max);
        let cone = grown_cone(&nodes[id as usize].cone, &nodes[children]);
        let (node, own) = (&mut nodes[id as usize], &mut attributes[id as usize]);
        node.radius = round_up(reach * (1.0 + 1e-15));
        if node.flags & Node::FLAT == 0 {
            node.cone = cone;
        }
        // A step of their code is far more than vertices move.
        if node.strip != NodeStrip::SPHERE {
            node.strip.half_length = node.strip.half_length.saturating_add(1);
            node.strip.width = node.strip.width.saturating_add(1);
            if node.strip.width == u8::MAX {
                node.strip = NodeStrip::SPHERE;
            }
        }
        own.splat_radius = round_up(f64::from(own.splat_radius) + leaves.moved).min(node.radius);
        if own.has_normal() {
            own.color[3] = own.color[3].saturating_sub(1).max(1);
        }
    }
    UpperNodes { nodes, attributes }
}

/// A cone of the same axis that holds those of the children.
fn grown_cone(cone: &NormalCone, children: &[Node]) -> NormalCone {
    let axis = cone.axis().as_dvec3();
    let mut caps = Vec::new();
    for child in children
        .iter()
        .filter(|child| child.flags & Node::FLAT == 0)
    {
        if child.cone.sin_half_angle == NormalCone::NEVER {
            return NormalCone::ALL;
        }
        let sine = f64::from(child.cone.sin_half_angle) / 65535.0;
        caps.push(DirectionCap::from_sin(child.cone.axis().as_dvec3(), sine));
    }
    if cone.sin_half_angle == NormalCone::NEVER || caps.is_empty() {
        return NormalCone::ALL;
    }
    match sin_around(axis, &caps) {
        Some(sine) if sine < 0.999 => NormalCone {
            sin_half_angle: cone
                .sin_half_angle
                .max(((sine + 1e-6) * 65535.0) as u16 + 1),
            ..*cone
        },
        _ => NormalCone::ALL,
    }
}
