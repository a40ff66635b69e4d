//! A whole model of a paged file: all pages in one tree in memory, for whatever needs that.

use super::extract::link;
use super::file::PagedFile;
use super::format::{PageEntry, PageError};
use super::page::{DecodeOptions, DecodedPage, moved_sphere};
use crate::progress::Progress;
use crate::tree::{
    AlignedRecords, Error, Leaf, Model, Node, NodeAttributes, PatchRecords, Tree, fill_moments,
    links,
};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;

/// Reads all pages and joins their records. Vertices of several pages come once for each.
///
/// # Errors
/// A forest, whose trees are not of one depth; a page that cannot be read; pages that do not make one tree; cancelled.
pub fn whole_model(file: &PagedFile, progress: &dyn Progress) -> Result<Model, Error> {
    let files = file.member_names().len();
    if files > 0 {
        return Err(Error::Forest {
            name: file.name().to_owned(),
            files,
        });
    }
    progress.stage("read pages", file.header().page_count);
    let mut bands: Vec<Vec<DecodedPage>> = Vec::new();
    let mut wanted: Vec<PageEntry> = file.root().into_iter().collect();
    while !wanted.is_empty() {
        let read = |entry: &PageEntry| {
            if progress.is_cancelled() {
                return Err(Error::Cancelled);
            }
            let page = file.read_page(entry, DecodeOptions::default())?;
            progress.advance(1);
            Ok(page)
        };
        let pages: Vec<DecodedPage> = wanted.par_iter().map(read).collect::<Result<_, Error>>()?;
        wanted = Vec::new();
        for page in &pages {
            wanted.extend(page.children.iter().flat_map(|below| &below.entries));
        }
        bands.push(pages);
    }
    let fault = |cause: &str| {
        Error::from(PageError::Damaged {
            name: file.name().to_owned(),
            page: None,
            offset: 0,
            cause: cause.to_owned(),
        })
    };
    let mut model = join(file, &bands).ok_or_else(|| fault("pages that make no tree"))?;
    links(&model).map_err(|cause| fault(&cause))?;
    let header = file.header();
    let counts = (
        model.tree.leaves.len() as u64,
        model.tree.nodes.len() as u64,
    );
    if counts != (header.leaf_count, header.node_count) {
        return Err(fault(
            "other numbers of leaves and nodes than the header says",
        ));
    }
    fill_moments(&mut model);
    Ok(model)
}

/// Levels of nodes of a page that no page below has.
fn own_levels(page: &DecodedPage) -> usize {
    let shared = page
        .children
        .as_ref()
        .map_or(0, |below| below.shared_levels);
    page.model.tree.level_count() - shared
}

fn join(file: &PagedFile, bands: &[Vec<DecodedPage>]) -> Option<Model> {
    let header = file.header();
    let mut model = Model {
        origin: file.origin(),
        min: Vec3::from_array(header.min),
        max: Vec3::from_array(header.max),
        orbit_center: Vec3::from_array(header.orbit_center),
        orbit_radius: header.orbit_radius,
        is_closed: file.is_closed(),
        has_colors: file.has_colors(),
        ..Model::default()
    };
    let all = || bands.iter().flatten();
    let own_nodes = |page: &DecodedPage| match &page.children {
        Some(below) => below.own_nodes(&page.model.tree),
        None => page.model.tree.nodes.len(),
    };
    let count: usize = all().map(own_nodes).sum();
    let mut nodes = AlignedRecords::<Node>::of_tree(count);
    let mut attributes = AlignedRecords::<NodeAttributes>::of_tree(count);
    let mut level_starts = vec![0u32];
    let mut patches = file.has_patches().then(PatchRecords::default);
    let mut at = 0;
    for (index, band) in bands.iter().enumerate() {
        let is_lowest = index + 1 == bands.len();
        let levels = own_levels(band.first()?);
        let is_alike =
            |page: &DecodedPage| own_levels(page) == levels && page.children.is_none() == is_lowest;
        if !band.iter().all(is_alike) {
            return None;
        }
        for level in 0..levels {
            for page in band {
                let tree = &page.model.tree;
                if let (Some(all), Some(own)) = (&mut patches, &page.model.patches) {
                    all.append(own.of_nodes(tree.level(level)));
                }
                for id in tree.level(level) {
                    let mut node = tree.nodes[id as usize];
                    (node.center, node.radius) = moved_sphere(node.center, node.radius, page.base);
                    nodes[at] = node;
                    attributes[at] = tree.attributes[id as usize];
                    at += 1;
                }
            }
            level_starts.push(at as u32);
        }
    }
    // Children follow one another from level to level.
    for (level, ends) in level_starts.windows(2).enumerate() {
        let is_last = level + 2 == level_starts.len();
        let mut child = if is_last { 0 } else { ends[1] };
        for node in &mut nodes[ends[0] as usize..ends[1] as usize] {
            node.first_child = child;
            child += u32::from(node.child_count);
            node.flags &= !Node::LEAF_CHILDREN;
            node.flags |= if is_last { Node::LEAF_CHILDREN } else { 0 };
        }
    }
    let mut leaves: Vec<Leaf> = Vec::new();
    for page in bands.last().into_iter().flatten() {
        let first = model.vertices.len() as u32;
        for leaf in page.model.tree.leaves.iter() {
            let (center, radius) = moved_sphere(leaf.center, leaf.radius, page.base);
            leaves.push(Leaf { center, radius });
        }
        for vertex in &page.model.vertices {
            let mut vertex = *vertex;
            vertex.position = (page.base + vertex.position.as_dvec3()).as_vec3();
            model.vertices.push(vertex);
        }
        let corners = page.model.triangles.iter();
        model
            .triangles
            .extend(corners.map(|triangle| triangle.map(|index| index + first)));
    }
    model.used_vertices = u32::try_from(model.vertices.len()).ok()?;
    model.tree = Tree {
        moments: AlignedRecords::zeroed(nodes.len()),
        nodes,
        attributes,
        level_starts,
        leaves: AlignedRecords::from(leaves.as_slice()),
        ..Tree::default()
    };
    link(&mut model.tree);
    model.patches = patches.map(Arc::new);
    // Decoded places are off by a rounding of theirs: the box holds them all.
    for vertex in &model.vertices {
        model.min = model.min.min(vertex.position);
        model.max = model.max.max(vertex.position);
        let reach = vertex
            .position
            .as_dvec3()
            .distance(model.orbit_center.as_dvec3());
        model.orbit_radius = model.orbit_radius.max(reach as f32);
    }
    Some(model)
}
