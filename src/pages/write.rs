//! Makes a paged file of a model in memory.

use super::extract::{patches_below, subtree};
use super::file::PagedFile;
use super::format::{CLOSED, COLORS, HEADER, MAGIC, PATCHES, PagedHeader, TRIANGLES, VERSION};
use super::join::whole_model;
use super::mix_hash::MixMap;
use super::page::{ColorBits, EncodedPage, PageChoices, encode_leaves};
use super::page_tops::{PageTop, TopSize, shared_levels};
use super::source::MemorySource;
use super::upper::{LeafPageFacts, LeafPages, upper_pages};
use crate::patches;
use crate::progress::Progress;
use crate::tree::file::write_whole;
use crate::tree::{Error, Model, PatchRecords};
use bytemuck::Zeroable;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

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

/// Writes a model as a paged file; the file appears whole or not at all. Records of patches that the model has are left
/// out: they bound what is not rounded.
///
/// # Errors
///
/// The folder cannot be written to, or the disk is full; more pages than 32 bits can number.
pub fn write(model: &Model, options: &PagedOptions, path: &Path) -> Result<(), Error> {
    encode(model, options, None)?.write(path)
}

/// Writes a surface as a paged file with records of the error patches of all nodes. They are made of the model as it is
/// decoded, so they bound what is drawn. Memory: the model a second time, and what making the records takes.
///
/// # Errors
///
/// Errors of [`write()`]; also cancelled.
pub fn write_with_patches(
    model: &Model,
    options: &PagedOptions,
    path: &Path,
    progress: &dyn Progress,
) -> Result<(), Error> {
    encode_with_patches(model, options, progress)?.write(path)
}

/// The bytes of a paged file.
///
/// # Errors
///
/// More pages than 32 bits can number.
pub fn to_bytes(model: &Model, options: &PagedOptions) -> Result<Vec<u8>, Error> {
    Ok(encode(model, options, None)?.bytes())
}

/// The bytes of a paged file with records of error patches, as [`write_with_patches`] writes it.
///
/// # Errors
///
/// More pages than 32 bits can number; cancelled.
pub fn to_bytes_with_patches(
    model: &Model,
    options: &PagedOptions,
    progress: &dyn Progress,
) -> Result<Vec<u8>, Error> {
    Ok(encode_with_patches(model, options, progress)?.bytes())
}

fn encode_with_patches(
    model: &Model,
    options: &PagedOptions,
    progress: &dyn Progress,
) -> Result<PagedParts, Error> {
    let bytes = encode(model, options, None)?.bytes();
    let source = MemorySource::new("the file before it is written", bytes);
    let mut decoded = whole_model(&PagedFile::open(Arc::new(source))?, progress)?;
    patches::add_records(&mut decoded, progress)?;
    encode(model, options, decoded.patches.as_deref())
}

/// A paged file before it is written, in its order.
struct PagedParts {
    header: PagedHeader,
    pages: Vec<Vec<u8>>,
}

impl PagedParts {
    fn bytes(&self) -> Vec<u8> {
        let mut bytes = bytemuck::bytes_of(&self.header).to_vec();
        self.pages.iter().for_each(|page| bytes.extend(page));
        bytes
    }

    fn write(&self, path: &Path) -> Result<(), Error> {
        write_whole(path, &|file| {
            let mut out = std::io::BufWriter::new(file);
            out.write_all(bytemuck::bytes_of(&self.header))?;
            self.pages.iter().try_for_each(|page| out.write_all(page))?;
            out.flush()
        })
    }
}

/// Makes the pages; with records of patches where those of the decoded model are given.
fn encode(
    model: &Model,
    options: &PagedOptions,
    patches: Option<&PatchRecords>,
) -> Result<PagedParts, Error> {
    let tree = &model.tree;
    let is_surface = !model.triangles.is_empty();
    let mut header = header_of(model, is_surface);
    if patches.is_some() {
        header.flags |= PATCHES;
    }
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
    let grid = VertexGrid::new(model, &roots, MixMap::default());
    let colors = color_bits(options, is_surface);
    let leaf_pages = leaf_pages(model, &roots, &grid, (colors, patches));
    let shared = shared_levels(tree.level_count() - leaf_level);
    let found: Vec<(LeafPageFacts, PageTop)> = (leaf_pages.par_iter().zip(&roots))
        .map(|(page, &root)| LeafPageFacts::of(page, model, root, shared))
        .collect::<Result<_, Error>>()?;
    let (facts, tops): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    let sizes = match tree.nodes.is_empty() {
        true => vec![TopSize::ALONE],
        false => TopSize::of_tree(tree, leaf_level, shared),
    };
    let moved = grid.largest_error();
    let upper = upper_pages(
        model,
        &LeafPages {
            level: leaf_level,
            first_byte: HEADER as u64,
            pages: &facts,
            sizes: &sizes,
            shared,
            moved,
            patches,
        },
        &mut tops.into_iter(),
        header,
    )?;
    parts.header = upper.header;
    parts.pages = upper.pages;
    parts
        .pages
        .extend(leaf_pages.into_iter().map(|page| page.bytes));
    Ok(parts)
}

/// The header of a model's file, without what is known of its pages.
pub(super) fn header_of(model: &Model, is_surface: bool) -> PagedHeader {
    let flag = |is_on: bool, bit: u32| if is_on { bit } else { 0 };
    PagedHeader {
        magic: MAGIC,
        version: VERSION,
        flags: flag(model.is_closed, CLOSED)
            | flag(model.has_colors, COLORS)
            | flag(is_surface, TRIANGLES),
        file_length: HEADER as u64,
        leaf_count: model.tree.leaves.len() as u64,
        node_count: model.tree.nodes.len() as u64,
        origin: model.origin.to_array(),
        min: model.min.to_array(),
        max: model.max.to_array(),
        orbit_center: model.orbit_center.to_array(),
        orbit_radius: model.orbit_radius,
        ..PagedHeader::zeroed()
    }
}

/// The leaf pages below nodes `roots`, with vertices on `grid`, and with the records of patches of all nodes where there are
/// some.
pub(super) fn leaf_pages(
    model: &Model,
    roots: &[Option<u32>],
    grid: &VertexGrid,
    (colors, patches): (ColorBits, Option<&PatchRecords>),
) -> Vec<EncodedPage> {
    let is_surface = !model.triangles.is_empty();
    (0..roots.len())
        .into_par_iter()
        .map(|index| {
            let mut part = subtree(model, roots[index], &grid.positions);
            let own = |all| match roots[index] {
                Some(root) => patches_below(all, &model.tree, root, model.tree.level_count()),
                None => Arc::default(),
            };
            part.patches = patches.map(own);
            let (base, step) = if is_surface {
                (grid.base(&part, grid.steps[index]), grid.steps[index])
            } else {
                (base_of_points(model, roots[index]), 0.0)
            };
            encode_leaves(&part, PageChoices { colors, base, step })
        })
        .collect()
}

/// Bits of colors where the caller has no wish.
pub(super) fn color_bits(options: &PagedOptions, is_surface: bool) -> ColorBits {
    options.colors.unwrap_or(if is_surface {
        ColorBits::All
    } else {
        ColorBits::Few
    })
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
pub(super) struct VertexGrid {
    /// Step of each page.
    steps: Vec<f64>,
    /// Vertices moved to their places, model space.
    positions: Vec<Vec3>,
}

/// Places of a page along an axis, less some room for vertices that move to a neighbor's coarser places.
const PLACES: f64 = 60_000.0;

/// A position as a key: equal where the numbers are.
pub(super) fn place_key(p: Vec3) -> [u32; 3] {
    p.to_array().map(|c| (c + 0.0).to_bits())
}

/// The step of a page whose vertices lie in a box, of coordinates up to `largest`: 65,536 places must do along each axis, and
/// single precision has no finer ones than its own.
pub(super) fn page_step(min: Vec3, max: Vec3, largest: f32) -> f64 {
    let finest = (f64::from(largest).max(1e-30).log2().floor() - 23.0).exp2();
    let extent = f64::from((max - min).max_element()) / PLACES;
    let step = if extent > 0.0 {
        extent.log2().ceil().exp2()
    } else {
        0.0
    };
    step.max(finest)
}

impl VertexGrid {
    /// Moves all vertices to places; those at the positions of `coarsest` to places of these steps at least.
    pub(super) fn new(
        model: &Model,
        roots: &[Option<u32>],
        mut coarsest: MixMap<[u32; 3], f64>,
    ) -> Self {
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
        let steps: Vec<f64> = roots
            .iter()
            .map(|root| {
                let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
                for corner in corners(root) {
                    min = min.min(positions[corner]);
                    max = max.max(positions[corner]);
                }
                page_step(min, max, largest)
            })
            .collect();
        let mut own = vec![0.0f64; positions.len()];
        for (root, &step) in roots.iter().zip(&steps) {
            for corner in corners(root) {
                own[corner] = own[corner].max(step);
            }
        }
        // By place, not by number: where a surface is sewn of several vertices it stays closed.
        let are_alike = coarsest.is_empty() && steps.windows(2).all(|pair| pair[0] == pair[1]);
        if !are_alike {
            let used = || positions.iter().zip(&own).filter(|(_, step)| **step > 0.0);
            for (&position, &step) in used() {
                let known = coarsest.entry(place_key(position)).or_insert(step);
                *known = known.max(step);
            }
        }
        let places = positions.par_iter_mut().zip(&own).with_min_len(4096);
        places.for_each(|(position, &own)| {
            let step = match are_alike {
                true => own,
                false => coarsest.get(&place_key(*position)).copied().unwrap_or(0.0),
            };
            if step > 0.0 {
                *position = ((position.as_dvec3() / step).round() * step).as_vec3();
            }
        });
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
    pub(super) fn largest_error(&self) -> f64 {
        let largest = self.steps.iter().copied().fold(0.0, f64::max);
        largest * 3f64.sqrt() / 2.0
    }
}
