//! Joins trees that were built elsewhere: a file with a few pages above the first pages of others.
//!
//! A large area is built in tiles, by whatever runs jobs, each a paged file of its own. The forest names these files, by
//! their paths from its folder or by their addresses, and has the nodes above their roots. Nothing of a tile is copied.

use super::file::PagedFile;
use super::forest_table::{self, ForestEntry, LONGEST_PATH};
use super::format::{COLORS, FOREST, HEADER, PageEntry, PageError, PagedHeader, TRIANGLES};
use super::page::{DecodeOptions, DecodedPage};
use super::page_tops::TopSize;
use super::upper::{LeafPageFacts, LeafPages, upper_pages};
use super::upper_tree::{join_above, linked, put};
use super::write::header_of;
use crate::math::sphere::round_up;
use crate::progress::Progress;
use crate::tree::{
    self, Error, Model, Node, NodeAttributes, NodeRecords, NodeStrip, NormalCone, PartPlace,
    PartShape,
};
use bytemuck::Zeroable;
use glam::DVec3;
use rayon::prelude::*;
use std::io::Write;
use std::path::{Component, Path};

/// A file to be joined.
#[derive(Debug, Clone)]
pub struct ForestMember {
    /// Name that the forest has of it ([`path_from`]), or its address.
    pub path: String,
    /// The file, open.
    pub file: PagedFile,
}

/// What was joined.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ForestReport {
    /// Files whose trees it has.
    pub files: u64,
    /// Leaves of all of them.
    pub leaves: u64,
    /// Bytes of the forest's own file.
    pub bytes: u64,
}

/// Why files were not joined.
#[derive(Debug, thiserror::Error)]
pub enum ForestError {
    /// A file cannot be read.
    #[error(transparent)]
    Page(#[from] PageError),
    /// A file does not go with the others.
    #[error("{name}: {cause}")]
    Unfit {
        /// The file.
        name: String,
        /// Why, and what to do.
        cause: String,
    },
    /// The forest's own file.
    #[error(transparent)]
    Tree(#[from] Error),
}

/// The path of a file from a folder, with `/` between its parts: both are there.
///
/// # Errors
/// The system's; a path that is no text, or on another drive.
pub fn path_from(folder: &Path, file: &Path) -> std::io::Result<String> {
    let (folder, file) = (folder.canonicalize()?, file.canonicalize()?);
    let parts = |path: &Path| -> Vec<Vec<u8>> {
        let name = |part: Component<'_>| part.as_os_str().as_encoded_bytes().to_vec();
        path.components().map(name).collect()
    };
    let (from, to) = (parts(&folder), parts(&file));
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return Err(std::io::Error::other("the two are on different drives"));
    }
    let up = from[common..].iter().map(|_| b"..".to_vec());
    let path: Vec<Vec<u8>> = up.chain(to[common..].iter().cloned()).collect();
    String::from_utf8(path.join(&b'/'))
        .map_err(|_| std::io::Error::other("the name of the file is no text (UTF-8)"))
}

/// Joins files into a forest at `path`, which appears whole or not at all. Of a file the header and the first page are read.
///
/// The order of the files does not matter.
///
/// # Errors
/// [`ForestError`]: a file cannot be read, is a forest itself, has leaves of another kind; the forest cannot be written;
/// cancelled.
pub fn write(
    members: &[ForestMember],
    path: &Path,
    progress: &dyn Progress,
) -> Result<ForestReport, ForestError> {
    let bytes = to_bytes(members, progress)?;
    tree::file::write_whole(path, &|file| file.write_all(&bytes))?;
    let leaves = members.iter().map(|own| own.file.header().leaf_count);
    Ok(ForestReport {
        files: members.len() as u64,
        leaves: leaves.sum(),
        bytes: bytes.len() as u64,
    })
}

/// The forest's file, as [`write`] makes it.
pub(super) fn to_bytes(
    members: &[ForestMember],
    progress: &dyn Progress,
) -> Result<Vec<u8>, ForestError> {
    check_kinds(members)?;
    let space = ForestSpace::of(members);
    progress.stage("read first pages", members.len() as u64);
    let root_of = |own: &ForestMember| {
        if progress.is_cancelled() {
            return Err(Error::Cancelled.into());
        }
        let options = DecodeOptions {
            moments: true,
            model_origin: Some(space.origin),
        };
        let entry = own.file.root().unwrap_or_default();
        let root = root_records(&own.file.read_page(&entry, options)?);
        progress.advance(1);
        Ok(root)
    };
    let roots: Vec<NodeRecords> =
        (members.par_iter().map(root_of)).collect::<Result<_, ForestError>>()?;
    let mut order: Vec<usize> = (0..members.len()).collect();
    order.sort_by_key(|&index| {
        let key = space.order_key(&roots[index]);
        (key, members[index].path.as_str())
    });
    let members: Vec<&ForestMember> = order.iter().map(|&index| &members[index]).collect();
    let roots: Vec<NodeRecords> = order.iter().map(|&index| roots[index]).collect();
    joined(&members, &roots, &space)
}

/// Refuses files that make no forest.
fn check_kinds(members: &[ForestMember]) -> Result<(), ForestError> {
    let unfit = |own: &ForestMember, cause: String| ForestError::Unfit {
        name: own.path.clone(),
        cause,
    };
    let kind = |own: &ForestMember| own.file.header().flags & (TRIANGLES | COLORS);
    for own in members {
        let header = own.file.header();
        let first = &members[0];
        if header.flags & FOREST != 0 {
            let cause = "joins files itself: name those files";
            return Err(unfit(own, cause.to_owned()));
        }
        if header.leaf_count == 0 {
            return Err(unfit(own, "has no leaves: leave it out".to_owned()));
        }
        if own.path.len() > LONGEST_PATH {
            return Err(unfit(own, "its name is too long".to_owned()));
        }
        if kind(own) != kind(first) {
            let words = |own: &ForestMember| {
                let leaves = if own.file.is_surface() {
                    "triangles"
                } else {
                    "points"
                };
                match own.file.has_colors() {
                    true => format!("{leaves} with colors"),
                    false => format!("{leaves} without colors"),
                }
            };
            let cause = format!(
                "has {}, but {} has {}: join files of one kind, or open both at once (surfel A.surfel B.surfel)",
                words(own),
                first.path,
                words(first)
            );
            return Err(unfit(own, cause));
        }
    }
    Ok(())
}

/// The records of the root of a first page; of one without nodes those of its only leaf.
fn root_records(page: &DecodedPage) -> NodeRecords {
    let tree = &page.model.tree;
    if let (Some(node), Some(attributes)) = (tree.nodes.first(), tree.attributes.first()) {
        let moments = tree.moments.first().copied();
        return NodeRecords {
            node: *node,
            attributes: *attributes,
            moments: moments.unwrap_or_default(),
        };
    }
    let Some((leaf, vertex)) = tree.leaves.first().zip(page.model.vertices.first()) else {
        return NodeRecords::zeroed();
    };
    NodeRecords {
        node: Node {
            center: leaf.center,
            radius: leaf.radius,
            first_child: 0,
            cone: NormalCone::ALL,
            strip: NodeStrip::SPHERE,
            child_count: 1,
            flags: 0,
        },
        attributes: NodeAttributes {
            normal: vertex.normal,
            color: vertex.color,
            splat_radius: leaf.radius,
            area: leaf.radius * leaf.radius,
        },
        ..NodeRecords::zeroed()
    }
}

/// Where a forest lies.
struct ForestSpace {
    /// World position of the model-space zero: that of all files where they have one, else the middle.
    origin: DVec3,
    /// Box of all, world space.
    min: DVec3,
    max: DVec3,
    /// Middle of the box, and the farthest that anything lies from it; world space.
    center: DVec3,
    reach: f64,
    is_closed: bool,
}

impl ForestSpace {
    fn of(members: &[ForestMember]) -> Self {
        let world = |own: &ForestMember, place: [f32; 3]| {
            own.file.origin() + DVec3::from_array(place.map(f64::from))
        };
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for own in members {
            let header = own.file.header();
            min = min.min(world(own, header.min));
            max = max.max(world(own, header.max));
        }
        let center = (min + max) * 0.5;
        let first = members.first().map(|own| own.file.origin());
        let is_shared = members.iter().all(|own| Some(own.file.origin()) == first);
        let reach = members.iter().map(|own| {
            let header = own.file.header();
            world(own, header.orbit_center).distance(center) + f64::from(header.orbit_radius)
        });
        Self {
            origin: first.filter(|_| is_shared).unwrap_or(center),
            min,
            max,
            center,
            reach: reach.fold(0.0, f64::max),
            is_closed: members.iter().all(|own| own.file.is_closed()),
        }
    }

    /// Place of a root along a curve through the box (Morton's), so that neighbors stand together.
    fn order_key(&self, root: &NodeRecords) -> u64 {
        let size = (self.max - self.min).max_element().max(f64::MIN_POSITIVE);
        let place = (self.origin + root.node.center.as_dvec3() - self.min) / size;
        let place = (place.clamp(DVec3::ZERO, DVec3::ONE) * f64::from((1 << 21) - 1)).as_u64vec3();
        let bit = |axis: u64, at: u32, to: u32| (axis >> at & 1) << (3 * at + to);
        (0..21)
            .map(|at| bit(place.x, at, 0) | bit(place.y, at, 1) | bit(place.z, at, 2))
            .sum()
    }
}

/// Writes the file of members in their order, whose roots have these records.
fn joined(
    members: &[&ForestMember],
    roots: &[NodeRecords],
    space: &ForestSpace,
) -> Result<Vec<u8>, ForestError> {
    let is_surface = members.iter().all(|own| own.file.is_surface());
    let top = PartShape::usual_depth(members.len() as u32);
    let place = PartPlace {
        depth: top,
        center: space.center - space.origin,
    };
    let shape = PartShape::new(members.len(), place)?;
    let mut levels: Vec<Vec<u8>> = (0..top)
        .map(|level| shape.child_counts(level).collect())
        .collect();
    // What is below the roots is the business of their own files.
    levels.push(vec![1; members.len()]);
    let mut tree = linked(&levels);
    for (id, root) in tree.level(top).zip(roots) {
        put(&mut tree, id as usize, *root);
    }
    join_above(&mut tree, top, is_surface);
    let headers = || members.iter().map(|own| own.file.header());
    let own_nodes = tree.level(top).start;
    let local = |place: DVec3| (place - space.origin).as_vec3();
    let model = Model {
        tree,
        origin: space.origin,
        min: local(space.min),
        max: local(space.max),
        orbit_center: local(space.center),
        orbit_radius: round_up(space.reach),
        is_closed: space.is_closed,
        has_colors: members.iter().all(|own| own.file.has_colors()),
        ..Model::default()
    };
    let entries: Vec<ForestEntry> = (members.iter())
        .map(|own| ForestEntry {
            path: own.path.clone(),
            header: *own.file.header(),
        })
        .collect();
    let table = forest_table::encode(&entries);
    let first_pages: Vec<PageEntry> = headers().map(|header| header.root).collect();
    let facts: Vec<LeafPageFacts> = (first_pages.iter().zip(roots))
        .map(|(entry, root)| LeafPageFacts::of_root(entry, root))
        .collect();
    let leaves = LeafPages {
        patches: None,
        level: top,
        first_byte: HEADER as u64 + table.len() as u64,
        pages: &facts,
        sizes: &vec![TopSize::ALONE; members.len()],
        shared: 0,
        moved: 0.0,
    };
    let header = PagedHeader {
        leaf_count: headers().map(|header| header.leaf_count).sum(),
        node_count: headers().map(|header| header.node_count).sum::<u64>() + u64::from(own_nodes),
        ..header_of(&model, is_surface)
    };
    let upper = upper_pages(&model, &leaves, &mut Vec::new().into_iter(), header)?;
    let of_pages: usize = upper.pages.iter().map(Vec::len).sum();
    let mut header = PagedHeader {
        flags: upper.header.flags | FOREST,
        file_length: leaves.first_byte + of_pages as u64,
        page_count: upper.pages.len() as u64,
        ..upper.header
    };
    header.checksum = header.own_checksum();
    let mut bytes = bytemuck::bytes_of(&header).to_vec();
    bytes.extend(table);
    bytes.extend(upper.pages.into_iter().flatten());
    Ok(bytes)
}

#[cfg(test)]
mod tests;
