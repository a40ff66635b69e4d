//! Generated models: square, sphere, torus and statue, to any size.
//!
//! The same surface for everybody: positions follow one definition (the project's conventions), and use only
//! arithmetic whose result is fixed to the bit, so a model is the same on every machine and for any number of
//! threads.
//!
//! * A model is made in blocks that need nothing from each other. [`mesh`] fills one mesh with all of them in
//!   parallel; [`write_ply`] makes a few at a time and writes them, so that the size of the model does not
//!   matter; the bytes are those of [`ply::write_to`] for the mesh.
//! * Sphere and torus have doubled seams whose positions are equal to the bit, and the rows of a pole of the
//!   sphere are one point: with vertices welded by position both are closed. The first and last row of the
//!   sphere hold one triangle without area per cell, `2 columns` in all; they belong to the counts.
//! * The statue shares all its vertices.
//!
//! ```
//! use surfel::generate::{self, GeneratedShape, ShapeSpec};
//! let mesh = generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Statue, 50_000)?);
//! assert_eq!(mesh.triangles.len(), 12 * 65 * 65);
//! # Ok::<(), generate::GenerateError>(())
//! ```

mod atomic;
pub(crate) use atomic::write as write_atomically;
mod grid;
pub mod ply;
mod spec;
mod statue;
mod stream;
mod trig;

pub use spec::{GeneratedShape, ShapeSpec};
pub use stream::GeneratedStream;

use crate::{mesh::Mesh, progress::Progress};
use glam::Vec3;
use rayon::prelude::*;
use std::{io::Write, ops::Range, path::Path, path::PathBuf};

/// Why a model could not be generated or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GenerateError {
    /// No shape of that name.
    #[error("unknown shape '{0}'; there are square, sphere, torus and statue")]
    UnknownShape(String),
    /// What should be a number of triangles is none.
    #[error("generate: {0:?} is no number of triangles")]
    BadCount(String),
    /// A model without triangles was asked for.
    #[error("a model needs at least one triangle")]
    TooFewTriangles,
    /// The grid does not close a surface of this shape.
    #[error("a {shape} cannot have a grid of {columns}x{rows} cells; it needs {wanted}")]
    BadGrid {
        /// The shape.
        shape: GeneratedShape,
        /// Cells in the first direction.
        columns: u32,
        /// Cells in the second direction.
        rows: u32,
        /// What is allowed.
        wanted: &'static str,
    },
    /// More vertices than 32-bit indices can name.
    #[error("this {shape} would have more than {limit} vertices (32-bit indices)")]
    TooLarge {
        /// The shape.
        shape: GeneratedShape,
        /// How many vertices there may be.
        limit: u64,
    },
    /// A mesh to be written has arrays of different lengths.
    #[error("the mesh has {positions} positions but {found} {what}")]
    Inconsistent {
        /// How many vertices there are.
        positions: usize,
        /// The array that does not match.
        what: &'static str,
        /// Length of that array.
        found: usize,
    },
    /// The file could not be written.
    #[error("cannot write {path}: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The stream could not be written.
    #[error("cannot write the model: {0}")]
    Stream(#[from] std::io::Error),
    /// The user asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// A surface made of independent blocks of vertices and of triangles.
trait ShapeSurface: Sync {
    /// Consecutive ranges of vertex indices, from 0 to the vertex count.
    fn vertex_blocks(&self) -> Vec<Range<usize>>;
    /// Fills positions and normals of one of [`vertex_blocks`](ShapeSurface::vertex_blocks).
    fn vertices(&self, block: Range<usize>, positions: &mut [Vec3], normals: &mut [Vec3]);
    /// Consecutive ranges of triangle indices, from 0 to the triangle count.
    fn triangle_blocks(&self) -> Vec<Range<usize>>;
    /// Fills one of [`triangle_blocks`](ShapeSurface::triangle_blocks).
    fn triangles(&self, block: Range<usize>, triangles: &mut [[u32; 3]]);
}

/// The surface of a specification.
fn surface(spec: &ShapeSpec) -> Box<dyn ShapeSurface> {
    match spec.shape() {
        GeneratedShape::Statue => Box::new(statue::StatueShape::new(spec.grid().0)),
        _ => Box::new(grid::ShapeGrid::new(spec)),
    }
}

/// `0..total` cut into ranges of `size` and a shorter last one.
fn blocks(total: usize, size: usize) -> Vec<Range<usize>> {
    (0..total)
        .step_by(size)
        .map(|start| start..total.min(start + size))
        .collect()
}

/// Cuts `all` into one slice per block.
fn split<'a, T>(mut all: &'a mut [T], blocks: &[Range<usize>]) -> Vec<&'a mut [T]> {
    let mut slices = Vec::with_capacity(blocks.len());
    for block in blocks {
        let (slice, rest) = all.split_at_mut(block.len());
        slices.push(slice);
        all = rest;
    }
    slices
}

/// The whole model in memory: 24 bytes a vertex, 12 bytes a triangle, no colors, origin zero.
///
/// Runs on the current rayon pool; the result does not depend on its size. Takes time and memory in
/// proportion to [`ShapeSpec::counts`]; for more than fits memory use [`write_ply`].
pub fn mesh(spec: &ShapeSpec) -> Mesh {
    let surface = surface(spec);
    let (vertices, triangles) = spec.counts();
    let mut mesh = Mesh {
        positions: vec![Vec3::ZERO; vertices as usize],
        normals: vec![Vec3::ZERO; vertices as usize],
        triangles: vec![[0; 3]; triangles as usize],
        ..Mesh::default()
    };

    let blocks = surface.vertex_blocks();
    let positions = split(&mut mesh.positions, &blocks);
    let normals = split(&mut mesh.normals, &blocks);
    blocks
        .par_iter()
        .zip(positions)
        .zip(normals)
        .for_each(|((block, positions), normals)| {
            surface.vertices(block.clone(), positions, normals);
        });

    let blocks = surface.triangle_blocks();
    let slices = split(&mut mesh.triangles, &blocks);
    blocks
        .par_iter()
        .zip(slices)
        .for_each(|(block, slice)| surface.triangles(block.clone(), slice));
    mesh
}

/// Blocks held in memory at a time: enough for many threads, about 1.5 MiB of bytes each.
const MOST_BLOCKS: usize = 16;

/// Writes the model as a binary PLY file without ever holding it: the same bytes as
/// [`ply::write_to`] of [`mesh`], in a few tens of MiB whatever its size (for the statue, whose blocks are
/// whole rows, plus a small multiple of one row).
///
/// `progress` gets one stage, in bytes of the file.
///
/// # Errors
///
/// [`GenerateError::Stream`] when `out` fails, [`GenerateError::Cancelled`] when `progress` says so; `out` then holds a part.
pub fn write_ply(
    spec: &ShapeSpec,
    out: &mut (impl Write + ?Sized),
    progress: &dyn Progress,
) -> Result<(), GenerateError> {
    let surface = surface(spec);
    let (vertices, triangles) = spec.counts();
    let layout = ply::PlyLayout {
        vertices,
        triangles,
        is_cloud: false,
        has_normals: true,
        has_colors: false,
        has_origin: false,
    };
    let header = layout.header();
    progress.stage("write", header.len() as u64 + layout.body_bytes());
    out.write_all(header.as_bytes())?;
    progress.advance(header.len() as u64);

    in_order(&surface.vertex_blocks(), out, progress, |block| {
        let mut positions = vec![Vec3::ZERO; block.len()];
        let mut normals = vec![Vec3::ZERO; block.len()];
        surface.vertices(block.clone(), &mut positions, &mut normals);
        layout.vertex_bytes(&positions, &normals, &[], glam::DVec3::ZERO)
    })?;
    in_order(&surface.triangle_blocks(), out, progress, |block| {
        let mut triangles = vec![[0; 3]; block.len()];
        surface.triangles(block.clone(), &mut triangles);
        layout.triangle_bytes(&triangles)
    })
}

/// Makes the bytes of some blocks in parallel, writes them in order, and so on to the end.
fn in_order(
    blocks: &[Range<usize>],
    out: &mut (impl Write + ?Sized),
    progress: &dyn Progress,
    encode: impl Fn(&Range<usize>) -> Vec<u8> + Sync,
) -> Result<(), GenerateError> {
    for some in blocks.chunks(rayon::current_num_threads().min(MOST_BLOCKS)) {
        if progress.is_cancelled() {
            return Err(GenerateError::Cancelled);
        }
        let encoded: Vec<Vec<u8>> = some.par_iter().map(&encode).collect();
        for bytes in encoded {
            out.write_all(&bytes)?;
            progress.advance(bytes.len() as u64);
        }
    }
    Ok(())
}

/// [`write_ply`] into a file that appears only when it is complete (see [`ply::write`]).
///
/// # Errors
///
/// [`GenerateError::Write`] when the file cannot be written, [`GenerateError::Cancelled`] when `progress` says so.
pub fn write_ply_file(
    spec: &ShapeSpec,
    path: &Path,
    progress: &dyn Progress,
) -> Result<(), GenerateError> {
    atomic::write(path, |out| write_ply(spec, out, progress))
}
