//! Makes a paged file of a model in memory.

use super::extract::{UpperNodes, subtree, upper_part};
use super::format::{
    CLOSED, COLORS, HEADER, LARGEST_PAGE, MAGIC, PageEntry, PagedHeader, TRIANGLES, VERSION,
};
use super::page::{
    ColorBits, DecodeOptions, EncodedPage, PageChoices, UpperPlace, decode, encode_leaves,
    encode_upper, upper_bytes,
};
use crate::math::cone::{DirectionCap, sin_around};
use crate::math::sphere::round_up;
use crate::tree::file::{hash, write_whole};
use crate::tree::{Error, Model, Node, NodeStrip, NormalCone};
use bytemuck::Zeroable;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::io::Write;
use std::path::Path;

/// Levels of an upper page: at most 4⁵ pages below it.
const UPPER_LEVELS: usize = 5;

/// How a paged file is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PagedOptions {
    /// Most leaves of a page, 16 to 16,384.
    pub page_leaves: usize,
    /// Bits of colors; by default few for points, where a color is a fifth of the file, and all for triangles.
    pub colors: Option<ColorBits>,
}

impl Default for PagedOptions {
    fn default() -> Self {
        Self {
            page_leaves: 4096,
            colors: None,
        }
    }
}

/// Writes a model as a paged file; the file appears whole or not at all.
///
/// # Errors
///
/// The folder cannot be written to, or the disk is full; more pages than 32 bits can number.
pub fn write(model: &Model, options: &PagedOptions, path: &Path) -> Result<(), Error> {
    let parts = encode(model, options)?;
    write_whole(path, &|file| {
        let mut out = std::io::BufWriter::new(file);
        out.write_all(bytemuck::bytes_of(&parts.header))?;
        parts
            .pages
            .iter()
            .try_for_each(|page| out.write_all(page))?;
        out.flush()
    })
}

/// The bytes of a paged file.
///
/// # Errors
///
/// More pages than 32 bits can number.
pub fn to_bytes(model: &Model, options: &PagedOptions) -> Result<Vec<u8>, Error> {
    let parts = encode(model, options)?;
    let mut bytes = bytemuck::bytes_of(&parts.header).to_vec();
    parts.pages.iter().for_each(|page| bytes.extend(page));
    Ok(bytes)
}

/// A paged file before it is written, in its order.
struct PagedParts {
    header: PagedHeader,
    pages: Vec<Vec<u8>>,
}

fn encode(model: &Model, options: &PagedOptions) -> Result<PagedParts, Error> {
    let tree = &model.tree;
    let is_surface = !model.triangles.is_empty();
    let flag = |is_on: bool, bit: u32| if is_on { bit } else { 0 };
    let mut header = PagedHeader {
        magic: MAGIC,
        version: VERSION,
        flags: flag(model.is_closed, CLOSED)
            | flag(model.has_colors, COLORS)
            | flag(is_surface, TRIANGLES),
        file_length: HEADER as u64,
        leaf_count: tree.leaves.len() as u64,
        node_count: tree.nodes.len() as u64,
        origin: model.origin.to_array(),
        min: model.min.to_array(),
        max: model.max.to_array(),
        orbit_center: model.orbit_center.to_array(),
        orbit_radius: model.orbit_radius,
        ..PagedHeader::zeroed()
    };
    let mut parts = PagedParts {
        header,
        pages: Vec::new(),
    };
    if tree.leaves.is_empty() {
        parts.header.checksum = header.own_checksum();
        return Ok(parts);
    }
    let most = options.page_leaves.clamp(16, 16_384);
    // The highest level whose nodes are all small enough.
    let fits = |level: &usize| {
        tree.level(*level)
            .all(|id| tree.leaf_range(id).len() <= most)
    };
    let leaf_level = (0..tree.level_count()).find(fits).unwrap_or(0);
    let roots: Vec<Option<u32>> = match tree.nodes.is_empty() {
        true => vec![None],
        false => tree.level(leaf_level).map(Some).collect(),
    };
    let colors = options.colors.unwrap_or(if is_surface {
        ColorBits::All
    } else {
        ColorBits::Few
    });
    let grid = VertexGrid::new(model, &roots);
    let leaf_pages: Vec<EncodedPage> = (0..roots.len())
        .into_par_iter()
        .map(|index| {
            let part = subtree(model, roots[index], &grid.positions);
            let (base, step) = if is_surface {
                (grid.base(&part, grid.steps[index]), grid.steps[index])
            } else {
                (base_of_points(model, roots[index]), 0.0)
            };
            encode_leaves(&part, PageChoices { colors, base, step })
        })
        .collect();
    let upper = UpperLevels::new(model, leaf_level, &leaf_pages, grid.largest_error())?;

    // Levels at which pages begin, from the top.
    let mut bands = vec![leaf_level];
    while let Some(&top) = bands.first()
        && top > 0
    {
        bands.insert(0, top.saturating_sub(UPPER_LEVELS));
    }
    let level_len = |level: usize| {
        if tree.nodes.is_empty() {
            1
        } else {
            tree.level(level).len()
        }
    };
    let page_count: usize = bands.iter().map(|&level| level_len(level)).sum();
    if page_count > u32::MAX as usize {
        return Err(Error::TooLarge {
            what: "pages",
            count: page_count,
            limit: u32::MAX as usize,
        });
    }

    // Lengths of upper pages follow from their numbers, so all places are known before anything is written.
    let counts = |root: u32, levels: std::ops::Range<usize>| {
        let (mut own, mut nodes) = (root..root + 1, 0);
        for _ in levels {
            nodes += own.len();
            own = tree.children(own.start).start..tree.children(own.end - 1).end;
        }
        (nodes, own)
    };
    let mut entries: Vec<Vec<PageEntry>> = Vec::new();
    let (mut offset, mut id) = (HEADER as u64, 0u32);
    for (band, &level) in bands.iter().enumerate() {
        let mut own = Vec::new();
        for index in 0..level_len(level) {
            let bytes = match bands.get(band + 1) {
                None => leaf_pages.get(index).map_or(0, |page| page.bytes.len()),
                Some(&next) => {
                    let (nodes, leaves) =
                        counts(tree.level(level).start + index as u32, level..next);
                    upper_bytes(nodes, leaves.len())
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

    // From the lowest up, so that checksums of what is below are known.
    let mut pages: Vec<Vec<Vec<u8>>> =
        vec![leaf_pages.into_iter().map(|page| page.bytes).collect()];
    for band in (0..bands.len()).rev() {
        if let Some(&next) = bands.get(band + 1) {
            let below = &entries[band + 1];
            let own = tree.level(bands[band]).map(|root| {
                let (_, leaves) = counts(root, bands[band]..next);
                let first = tree.level(next).start;
                let range = (leaves.start - first) as usize..(leaves.end - first) as usize;
                let cones: Vec<NormalCone> = leaves
                    .map(|leaf| upper.nodes.nodes[leaf as usize].cone)
                    .collect();
                let place = UpperPlace {
                    entries: &below[range],
                    cones: &cones,
                    are_leaf_pages: band + 2 == bands.len(),
                };
                encode_upper(&upper_part(model, &upper.nodes, root, next), &place)
            });
            pages.push(own.collect());
        }
        let own = &pages[pages.len() - 1];
        for (entry, page) in entries[band].iter_mut().zip(own) {
            entry.checksum = hash(page);
        }
    }
    header.file_length = offset;
    header.page_count = page_count as u64;
    header.root = entries[0][0];
    header.checksum = header.own_checksum();
    parts.header = header;
    parts.pages = pages.into_iter().rev().flatten().collect();
    Ok(parts)
}

/// A place near a page of points such that its coordinates are small.
fn base_of_points(model: &Model, root: Option<u32>) -> DVec3 {
    let tree = &model.tree;
    let (center, radius) = match root {
        Some(root) => {
            let node = &tree.nodes[root as usize];
            (node.center, node.radius)
        }
        None => (tree.leaves[0].center, tree.leaves[0].radius),
    };
    // Few bits, so that sums with it are exact for almost all.
    let step = f64::from(radius).max(f64::from(center.abs().max_element()) * 1e-7);
    if step > 0.0 {
        let step = step.log2().ceil().exp2();
        (center.as_dvec3() / step).round() * step
    } else {
        center.as_dvec3()
    }
}

/// Places of the vertices of a surface: multiples of a power of two for each page, of a vertex of several the largest.
struct VertexGrid {
    /// Step of each page.
    steps: Vec<f64>,
    /// Vertices moved to their places, model space.
    positions: Vec<Vec3>,
}

/// Places of a page along an axis, less some room for vertices that move to a neighbor's coarser places.
const PLACES: f64 = 60_000.0;

/// A position as a key: equal where the numbers are.
fn key(p: Vec3) -> [u32; 3] {
    p.to_array().map(|c| (c + 0.0).to_bits())
}

impl VertexGrid {
    fn new(model: &Model, roots: &[Option<u32>]) -> Self {
        let mut positions: Vec<Vec3> = model.vertices.iter().map(|v| v.position).collect();
        if model.triangles.is_empty() {
            return Self {
                steps: Vec::new(),
                positions,
            };
        }
        let corners = |root: &Option<u32>| {
            let leaves = root.map_or(0..model.tree.leaf_count(), |id| model.tree.leaf_range(id));
            model.triangles[leaves.start as usize..leaves.end as usize]
                .iter()
                .flatten()
                .map(|&index| index as usize)
        };
        let largest = model.min.abs().max(model.max.abs()).max_element();
        // Single precision has no finer places there.
        let finest = (f64::from(largest).max(1e-30).log2().floor() - 23.0).exp2();
        let steps: Vec<f64> = roots
            .iter()
            .map(|root| {
                let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
                for corner in corners(root) {
                    min = min.min(positions[corner]);
                    max = max.max(positions[corner]);
                }
                let extent = f64::from((max - min).max_element()) / PLACES;
                let step = if extent > 0.0 {
                    extent.log2().ceil().exp2()
                } else {
                    0.0
                };
                step.max(finest)
            })
            .collect();
        // By place, not by number: where a surface is sewn of several vertices it stays closed.
        let mut coarsest: HashMap<[u32; 3], f64> = HashMap::new();
        for (root, &step) in roots.iter().zip(&steps) {
            for corner in corners(root) {
                let own = coarsest.entry(key(positions[corner])).or_insert(step);
                *own = own.max(step);
            }
        }
        for position in &mut positions {
            if let Some(&step) = coarsest.get(&key(*position)) {
                *position = ((position.as_dvec3() / step).round() * step).as_vec3();
            }
        }
        Self { steps, positions }
    }

    /// The zero of a page: at most all of its vertices, and a place itself.
    fn base(&self, part: &Model, step: f64) -> DVec3 {
        let least = part
            .vertices
            .iter()
            .map(|vertex| vertex.position)
            .fold(Vec3::INFINITY, Vec3::min);
        (least.as_dvec3() / step).floor() * step
    }

    /// The farthest that a vertex is moved.
    fn largest_error(&self) -> f64 {
        let largest = self.steps.iter().copied().fold(0.0, f64::max);
        largest * 3f64.sqrt() / 2.0
    }
}

/// The nodes above the leaf pages, and the roots of those as they are decoded.
struct UpperLevels {
    nodes: UpperNodes,
}

impl UpperLevels {
    /// Spheres and cones are grown until they hold what is decoded below, radii by `moved`.
    fn new(
        model: &Model,
        leaf_level: usize,
        pages: &[EncodedPage],
        moved: f64,
    ) -> Result<Self, Error> {
        let tree = &model.tree;
        if tree.nodes.is_empty() {
            return Ok(Self {
                nodes: UpperNodes {
                    nodes: Vec::new(),
                    attributes: Vec::new(),
                },
            });
        }
        let roots = tree.level(leaf_level);
        let end = roots.end as usize;
        let mut nodes = tree.nodes[..end].to_vec();
        let mut attributes = tree.attributes[..end].to_vec();
        for (id, page) in roots.zip(pages) {
            let decoded = decode(&page.bytes, DVec3::ZERO, DecodeOptions::default());
            let decoded = decoded.map_err(|(offset, cause)| Error::File {
                path: "a page just written".into(),
                offset: offset as u64,
                cause,
            })?;
            let id = id as usize;
            let node = &mut nodes[id];
            (node.center, node.radius) = (page.root.center, page.root.radius);
            if let Some(root) = decoded.model.tree.nodes.first() {
                node.cone = root.cone;
                node.flags = root.flags;
                attributes[id] = decoded.model.tree.attributes[0];
            }
        }
        for id in (0..tree.level(leaf_level).start).rev() {
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
            own.splat_radius = round_up(f64::from(own.splat_radius) + moved).min(node.radius);
            if own.has_normal() {
                own.color[3] = own.color[3].saturating_sub(1).max(1);
            }
        }
        Ok(Self {
            nodes: UpperNodes { nodes, attributes },
        })
    }
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
