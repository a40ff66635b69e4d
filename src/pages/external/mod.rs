//! Builds a paged file of a model that is larger than memory.
//!
//! The input is read as a stream, several times: once to count its leaves in cells (`cells`), once to distribute them
//! to chunks of bounded size in a temporary file (`spool`), and of a surface once more for the vertices of each chunk. Each
//! chunk is then built in memory by the builder that there is, all of one depth, and its pages are written; few nodes above
//! them join the chunks (`skeleton`). Where chunks of a surface meet, normals and places of vertices are those of the whole
//! (`borders`).
//!
//! The file does not depend on threads or memory. A model of no more leaves than a chunk gives the file that
//! `super::write` makes of it.

mod borders;
mod cells;
mod chunk;
mod filled;
mod skeleton;
mod spool;
#[cfg(test)]
mod tests;

use self::borders::ChunkBorders;
use self::cells::{ChunkCells, CountGrid};
use self::chunk::{ChunkReader, LeafRecords, NumberedMesh};
use self::filled::FilledPages;
use self::skeleton::{ModelBox, TreeSkeleton};
use self::spool::{ChunkSpool, SpooledTops};
use super::format::HEADER;
use super::mix_hash::MixMap;
use super::page::EncodedPage;
use super::page_tops::PageTop;
use super::upper::{LeafPageFacts, upper_length};
use super::write::{PagedOptions, VertexGrid, color_bits, leaf_pages, page_step, place_key};
use crate::mesh::normals::{self, NormalWeighting};
use crate::mesh::stream::{MeshStream, StreamError, StreamFacts, VertexPiece};
use crate::mesh::{Mesh, creases, origin_of, recentered_zero};
use crate::progress::{Progress, SilentProgress};
use crate::tree::{self, BuildOptions, Error, PartPlace, PartShape, PointNormals, build_part};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::cell::RefCell;
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

/// How a file is built of a stream.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExternalOptions {
    /// How its pages are made.
    pub pages: PagedOptions,
    /// Most leaves of a chunk, 2,048 and more: the memory that is needed goes by it.
    pub chunk_leaves: u64,
    /// Angle beyond which edges are sharp, of a surface without normals; degrees.
    pub crease_degrees: Option<f32>,
    /// Which normals points have. Those that are estimated are by the neighbors of the same chunk.
    pub point_normals: PointNormals,
    /// Bytes of a table with a word for each vertex; where it holds not all, it takes several looks.
    pub table_bytes: u64,
}

impl Default for ExternalOptions {
    fn default() -> Self {
        Self {
            pages: PagedOptions::default(),
            chunk_leaves: 1 << 19,
            crease_degrees: None,
            point_normals: PointNormals::File,
            table_bytes: 64 << 20,
        }
    }
}

/// What was built.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ExternalReport {
    /// Leaves of the file.
    pub leaves: u64,
    /// Nodes of the file.
    pub nodes: u64,
    /// Chunks that it was built of.
    pub chunks: u64,
    /// Bytes of temporary files.
    pub temporary_bytes: u64,
    /// Leaves left out since they are not finite.
    pub dropped: u64,
}

/// Bytes that building a file takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DiskForecast {
    /// About what the file has.
    pub file_bytes: u64,
    /// What temporary files have beside it, about.
    pub temporary_bytes: u64,
}

/// Foretells the disk that is needed, by the numbers of leaves alone.
pub fn forecast(facts: &StreamFacts) -> DiskForecast {
    let leaves = leaf_total(facts);
    let (file, temporary) = match facts.is_cloud() {
        true => (
            if facts.has_colors { 9 } else { 7 },
            chunk::point_bytes(facts) as u64,
        ),
        false => (16, size_of::<[u32; 3]>() as u64),
    };
    DiskForecast {
        file_bytes: leaves * file,
        temporary_bytes: match leaves > ExternalOptions::default().chunk_leaves {
            true => leaves * temporary,
            false => 0,
        },
    }
}

/// Leaves of a stream, before any is left out.
fn leaf_total(facts: &StreamFacts) -> u64 {
    match facts.is_cloud() {
        true => facts.vertices,
        false => facts.faces,
    }
}

/// Why a file was not built.
#[derive(Debug, thiserror::Error)]
pub enum ExternalError {
    /// The input.
    #[error(transparent)]
    Stream(StreamError),
    /// The tree or its file.
    #[error(transparent)]
    Tree(#[from] Error),
}

/// Marks an error of ours on its way through a stream.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
struct OwnError(Error);

impl From<StreamError> for ExternalError {
    fn from(error: StreamError) -> Self {
        match error.downcast::<OwnError>() {
            Ok(own) => Self::Tree(own.0),
            Err(error) => Self::Stream(error),
        }
    }
}

fn own(error: Error) -> StreamError {
    Box::new(OwnError(error))
}

/// What takes leaves, with the place of each in the grid.
type TakeLeaves<'a> = dyn FnMut(&LeafRecords, &[DVec3]) -> Result<(), StreamError> + 'a;

/// Everything that the steps have in common.
struct ExternalBuild<'a> {
    stream: &'a dyn MeshStream,
    facts: StreamFacts,
    options: ExternalOptions,
    path: &'a Path,
    progress: &'a dyn Progress,
}

/// What a first look has found.
struct LeafCount {
    grid: CountGrid,
    bounds: ModelBox,
    leaves: u64,
    dropped: u64,
}

/// Where the model-space zero lies, and the box of the model.
#[derive(Debug, Clone, Copy)]
struct ModelSpace {
    /// World position that coordinates are first relative to, in single precision.
    first: DVec3,
    /// What they are moved by then.
    second: DVec3,
    min: Vec3,
    max: Vec3,
}

impl ModelSpace {
    fn of(bounds: &ModelBox) -> Self {
        let first = origin_of(bounds.min, bounds.max, bounds.rounding);
        let [min, max] = [bounds.min, bounds.max].map(|corner| (corner - first).as_vec3());
        let second = recentered_zero(min, max);
        let space = Self {
            first,
            second,
            min,
            max,
        };
        let [min, max] = [bounds.min, bounds.max].map(|corner| space.place(corner));
        Self { min, max, ..space }
    }

    fn place(&self, world: DVec3) -> Vec3 {
        ((world - self.first).as_vec3().as_dvec3() - self.second).as_vec3()
    }

    fn origin(&self) -> DVec3 {
        self.first + self.second
    }

    fn center(&self) -> Vec3 {
        ((self.min.as_dvec3() + self.max.as_dvec3()) * 0.5).as_vec3()
    }
}

/// Builds a paged file of a stream; the file appears whole or not at all.
///
/// # Errors
/// The stream fails; no leaf is finite; coordinates span more than single precision; the folder cannot be written to or the
/// disk is full; cancelled.
pub fn build(
    stream: &dyn MeshStream,
    options: &ExternalOptions,
    path: &Path,
    progress: &dyn Progress,
) -> Result<ExternalReport, ExternalError> {
    let build = ExternalBuild {
        stream,
        facts: stream.facts(),
        options: ExternalOptions {
            chunk_leaves: options.chunk_leaves.max(2048),
            ..*options
        },
        path,
        progress,
    };
    let count = build.count()?;
    if count.leaves <= build.options.chunk_leaves {
        return build.whole(&count);
    }
    build.in_chunks(count)
}

impl ExternalBuild<'_> {
    fn stop(&self) -> Result<(), StreamError> {
        match self.progress.is_cancelled() {
            true => Err(own(Error::Cancelled)),
            false => Ok(()),
        }
    }

    /// Gives each piece of leaves with the place of each in the grid: the point, or the middle of the corners. Corners come
    /// along, three for each triangle. Leaves that are not finite have such a place.
    fn places(&self, take: &mut TakeLeaves<'_>) -> Result<(), StreamError> {
        if self.facts.is_cloud() {
            return self.stream.vertices(&mut |piece: &VertexPiece| {
                self.stop()?;
                take(&LeafRecords::Points(piece), &piece.positions)?;
                self.progress.advance(piece.positions.len() as u64);
                Ok(())
            });
        }
        self.stream.triangles(&mut |triangles: &[[u32; 3]]| {
            self.stop()?;
            let corners = chunk::corner_positions(self.stream, triangles)?;
            let middles: Vec<DVec3> = corners
                .par_iter()
                .map(|[a, b, c]| (*a + *b + *c) / 3.0)
                .collect();
            take(&LeafRecords::Triangles(triangles, &corners), &middles)?;
            self.progress.advance(triangles.len() as u64);
            Ok(())
        })
    }

    /// Counts the leaves in cells.
    fn count(&self) -> Result<LeafCount, ExternalError> {
        self.progress.stage("counting", leaf_total(&self.facts));
        let mut count = LeafCount {
            grid: CountGrid::default(),
            bounds: ModelBox::default(),
            leaves: 0,
            dropped: 0,
        };
        self.places(&mut |records, places| {
            let finite: Vec<DVec3> = places.iter().copied().filter(|p| p.is_finite()).collect();
            match records {
                LeafRecords::Points(_) => count.bounds.add(&finite),
                LeafRecords::Triangles(_, corners) => {
                    let flat: Vec<DVec3> = (corners.iter())
                        .filter(|corners| corners.iter().all(|p| p.is_finite()))
                        .flatten()
                        .copied()
                        .collect();
                    count.bounds.add(&flat);
                }
            }
            count.leaves += finite.len() as u64;
            count.dropped += (places.len() - finite.len()) as u64;
            count.grid.add(&finite);
            Ok(())
        })?;
        let extent = (count.bounds.max - count.bounds.min).max_element();
        if count.leaves == 0 {
            let cause = "no point or triangle of the model is finite";
            return Err(ExternalError::Stream(cause.into()));
        }
        if !(extent == 0.0 || (1e-17..=1e17).contains(&extent)) {
            let cause = format!(
                "the model spans {extent:e} units: open it without --memory, which scales it or leaves out what lies far off"
            );
            return Err(ExternalError::Stream(cause.into()));
        }
        Ok(count)
    }

    /// Builds a model of few leaves in memory, as every other.
    fn whole(&self, count: &LeafCount) -> Result<ExternalReport, ExternalError> {
        let space = ModelSpace::of(&count.bounds);
        let mesh = chunk::whole_mesh(self.stream, &space)?;
        let options = BuildOptions {
            crease_degrees: self.options.crease_degrees,
            keeps_origin: true,
            point_normals: self.options.point_normals,
            ..BuildOptions::default()
        };
        let model = tree::build(mesh, &options, self.progress)?;
        super::write::write(&model, &self.options.pages, self.path)?;
        Ok(ExternalReport {
            leaves: model.tree.leaves.len() as u64,
            nodes: model.tree.nodes.len() as u64,
            chunks: 1,
            temporary_bytes: 0,
            dropped: count.dropped,
        })
    }

    /// Divides the leaves among chunks; returns the cells that say which, and the leaves of each chunk.
    fn divide(&self, grid: CountGrid) -> Result<(ChunkCells, Vec<u64>), ExternalError> {
        let most = self.options.chunk_leaves;
        let mut cells = ChunkCells::new(grid);
        let mut round = 0;
        loop {
            let first_new = cells.divided();
            if !cells.divide(most, round) {
                break;
            }
            self.progress
                .stage("counting crowded cells", leaf_total(&self.facts));
            self.places(&mut |_, places| {
                let finite: Vec<DVec3> = places.iter().copied().filter(|p| p.is_finite()).collect();
                cells.count(&finite, first_new);
                Ok(())
            })?;
            round += 1;
        }
        let counts = cells.join(most);
        Ok((cells, counts))
    }

    /// Writes the records of all leaves to the lists of their chunks.
    fn distribute(
        &self,
        cells: &ChunkCells,
        space: &ModelSpace,
        spool: &mut ChunkSpool,
    ) -> Result<(), ExternalError> {
        self.progress.stage("distributing", leaf_total(&self.facts));
        let io = |source| {
            own(Error::Io {
                path: self.path.to_owned(),
                source,
            })
        };
        self.places(&mut |records, places| {
            let chunks: Vec<Option<u32>> = places
                .par_iter()
                .with_min_len(1 << 12)
                .map(|&place| place.is_finite().then(|| cells.chunk(place)).flatten())
                .collect();
            let mut bytes = Vec::new();
            for (index, chunk) in chunks.into_iter().enumerate() {
                let Some(chunk) = chunk else { continue };
                bytes.clear();
                records.encode(index, space, &mut bytes);
                spool.append(chunk as usize, &bytes).map_err(io)?;
            }
            Ok(())
        })?;
        Ok(())
    }

    fn io(&self, source: std::io::Error) -> ExternalError {
        ExternalError::Tree(Error::Io {
            path: self.path.to_owned(),
            source,
        })
    }

    /// The folder of the file that is built: temporary ones lie there, too.
    fn folder(&self) -> &Path {
        match self.path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        }
    }

    /// Builds a model of many leaves.
    fn in_chunks(&self, count: LeafCount) -> Result<ExternalReport, ExternalError> {
        let LeafCount {
            grid,
            bounds,
            leaves,
            dropped,
        } = count;
        let space = ModelSpace::of(&bounds);
        let (cells, counts) = self.divide(grid)?;
        let folder = self.folder();
        let mut spool = ChunkSpool::new(folder, counts.len()).map_err(|e| self.io(e))?;
        self.distribute(&cells, &space, &mut spool)?;
        drop(cells);
        let largest = counts.iter().copied().max().unwrap_or(0);
        let place = PartPlace {
            depth: PartShape::usual_depth(u32::try_from(largest).unwrap_or(u32::MAX)),
            center: space.center().as_dvec3(),
        };
        let skeleton = TreeSkeleton::new(&counts, place, self.options.pages.page_leaves)?;
        let mut reader = ChunkReader {
            stream: self.stream,
            facts: self.facts,
            space,
            spool,
        };
        let borders = match self.facts.is_cloud() {
            true => ChunkBorders::default(),
            false => self.borders(&mut reader, &skeleton, folder)?,
        };
        let report = ExternalReport {
            leaves,
            nodes: skeleton.node_count(),
            chunks: counts.len() as u64,
            temporary_bytes: reader.spool.bytes()
                + borders.temporary_bytes()
                + SpooledTops::bytes_of(skeleton.sizes()),
            dropped,
        };
        self.progress.stage("building", leaves);
        let mut work = Some(ChunkWork {
            skeleton,
            reader,
            borders,
        });
        let mut failure = None;
        let cell = RefCell::new((&mut work, &mut failure));
        let written = tree::file::write_whole(self.path, &|file| {
            let (work, failure) = &mut *cell.borrow_mut();
            let result = match work.take() {
                Some(work) => self.write(work, &report, file),
                None => Ok(()),
            };
            result.map_err(|found| {
                **failure = Some(found);
                std::io::Error::other("not built")
            })
        });
        match failure {
            Some(found) => Err(found),
            None => {
                written?;
                Ok(report)
            }
        }
    }

    /// Builds the chunks one after the other and writes the file.
    fn write(
        &self,
        mut work: ChunkWork<'_>,
        report: &ExternalReport,
        file: &mut std::fs::File,
    ) -> Result<(), ExternalError> {
        let leaf_level = work.skeleton.leaf_level();
        let start = HEADER as u64
            + upper_length(
                work.skeleton.tree(),
                leaf_level,
                work.skeleton.sizes(),
                work.skeleton.shared(),
            );
        let mut out = std::io::BufWriter::with_capacity(1 << 20, file);
        out.seek(SeekFrom::Start(start)).map_err(|e| self.io(e))?;
        let filled = self.fill(&mut work, &mut out)?;
        let space = work.reader.space;
        let upper = filled.upper(work.skeleton, space, (&self.facts, report))?;
        let pages = upper.pages.iter().map(Vec::as_slice);
        let parts = std::iter::once(bytemuck::bytes_of(&upper.header)).chain(pages);
        out.seek(SeekFrom::Start(0)).map_err(|e| self.io(e))?;
        for part in parts {
            out.write_all(part).map_err(|e| self.io(e))?;
        }
        out.flush().map_err(|e| self.io(e))
    }

    /// Writes the leaf pages of all chunks.
    fn fill(
        &self,
        work: &mut ChunkWork<'_>,
        out: &mut dyn Write,
    ) -> Result<FilledPages, ExternalError> {
        let shared = work.skeleton.shared();
        let mut filled = FilledPages::default();
        let mut tops =
            SpooledTops::new(self.folder(), work.skeleton.chunk_count()).map_err(|e| self.io(e))?;
        let level = work.skeleton.leaf_level_of_chunks();
        let colors = color_bits(&self.options.pages, !self.facts.is_cloud());
        let center = work.reader.space.center().as_dvec3();
        for chunk in 0..work.skeleton.chunk_count() {
            self.stop()?;
            let (mesh, steps) = self.chunk_mesh(work, chunk)?;
            let place = (work.skeleton.place(), self.options.point_normals);
            let (model, evidence) = build_part(mesh, place, &SilentProgress)?;
            let roots: Vec<Option<u32>> = model.tree.level(level).map(Some).collect();
            let grid = VertexGrid::new(&model, &roots, steps);
            let pages: Vec<EncodedPage> = leaf_pages(&model, &roots, &grid, (colors, None));
            let found: Vec<(LeafPageFacts, PageTop)> = (pages.par_iter().zip(&roots))
                .map(|(page, &root)| LeafPageFacts::of(page, &model, root, shared))
                .collect::<Result<_, Error>>()?;
            for (own, top) in found {
                filled.pages.push(own);
                if shared > 0 {
                    tops.append(chunk, &top).map_err(|e| self.io(e))?;
                }
            }
            for page in &pages {
                out.write_all(&page.bytes).map_err(|e| self.io(e))?;
            }
            filled.moved = filled.moved.max(grid.largest_error());
            filled.evidence = filled.evidence.join(evidence);
            let used = &model.vertices[..model.used_vertices as usize];
            let reach = used
                .iter()
                .map(|vertex| center.distance_squared(vertex.position.as_dvec3()))
                .fold(0.0, f64::max);
            filled.reach = filled.reach.max(reach.sqrt());
            work.skeleton.take(&model);
            self.progress.advance(model.tree.leaves.len() as u64);
        }
        filled.tops = Some(tops);
        Ok(filled)
    }

    /// The mesh of a chunk with its normals, and the steps of positions that other chunks have, too.
    fn chunk_mesh(
        &self,
        work: &mut ChunkWork<'_>,
        chunk: usize,
    ) -> Result<(Mesh, MixMap<[u32; 3], f64>), ExternalError> {
        let reader = &mut work.reader;
        if self.facts.is_cloud() {
            let mesh = reader.points(chunk).map_err(|e| self.io(e))?;
            return Ok((mesh, MixMap::default()));
        }
        let mut triangles = reader.triangles(chunk).map_err(|e| self.io(e))?;
        let own = triangles.len();
        triangles.extend(work.borders.around(chunk).map_err(|e| self.io(e))?);
        let NumberedMesh { mut mesh, numbers } = reader.mesh(&triangles)?;
        let shared = (numbers.iter().zip(&mesh.positions)).filter_map(|(&number, &place)| {
            let step = work.borders.step(number)?;
            (step > 0.0).then(|| (place_key(place), step))
        });
        let mut steps = MixMap::default();
        for (key, step) in shared {
            let known = steps.entry(key).or_insert(step);
            *known = step.max(*known);
        }
        if let Some(degrees) = self.options.crease_degrees {
            creases::split(&mut mesh, degrees);
        }
        normals::complete(&mut mesh, NormalWeighting::Area);
        mesh.triangles.truncate(own);
        Ok((mesh, steps))
    }
}

/// What the building of chunks needs.
struct ChunkWork<'a> {
    skeleton: TreeSkeleton,
    reader: ChunkReader<'a>,
    borders: ChunkBorders,
}
