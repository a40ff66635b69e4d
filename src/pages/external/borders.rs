//! Where chunks of a surface meet: the vertices that several have, the triangles around them, and the grid that their places
//! lie on, so that the surface has neither seam nor gap there.

use super::chunk::{ChunkReader, NumberedMesh, triangles_of};
use super::skeleton::TreeSkeleton;
use super::spool::ChunkSpool;
use super::{ExternalBuild, ExternalError, page_step};
use crate::tree::leaf_order;
use glam::Vec3;
use std::path::Path;

/// A vertex of several chunks, with one of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct BorderVertex {
    number: u32,
    chunk: u32,
}

/// What is known of the vertices that several chunks have.
#[derive(Debug, Default)]
pub(super) struct ChunkBorders {
    /// Ascending.
    vertices: Vec<BorderVertex>,
    /// A bit for each vertex of the stream: most are of one chunk, and need not be searched for.
    is_shared: Vec<u64>,
    /// Of each, the largest step of the pages that have it; the same for all chunks of a vertex.
    steps: Vec<f64>,
    /// Of each chunk, triangles of others at its vertices; where normals must be made.
    around: Option<ChunkSpool>,
}

/// Stands for no chunk.
const NONE: u32 = u32::MAX;

impl ChunkBorders {
    /// The places in `vertices` of a vertex.
    fn places(&self, number: u32) -> std::ops::Range<usize> {
        let word = self.is_shared.get(number as usize / 64);
        if word.is_none_or(|word| word >> (number % 64) & 1 == 0) {
            return 0..0;
        }
        let start = self.vertices.partition_point(|own| own.number < number);
        let rest = self.vertices[start..].iter();
        start..start + rest.take_while(|own| own.number == number).count()
    }

    /// The largest step of the pages that have a vertex; `None` for one of a single chunk.
    pub(super) fn step(&self, number: u32) -> Option<f64> {
        let places = self.places(number);
        (!places.is_empty()).then(|| self.steps[places.start])
    }

    /// Triangles of other chunks at vertices of a chunk.
    ///
    /// # Errors
    /// The temporary file cannot be read.
    pub(super) fn around(&mut self, chunk: usize) -> std::io::Result<Vec<[u32; 3]>> {
        match &mut self.around {
            Some(spool) => Ok(triangles_of(&spool.read(chunk)?)),
            None => Ok(Vec::new()),
        }
    }

    /// Bytes of the temporary file.
    pub(super) fn temporary_bytes(&self) -> u64 {
        self.around.as_ref().map_or(0, ChunkSpool::bytes)
    }
}

impl ExternalBuild<'_> {
    /// Finds the borders of the chunks of a surface.
    pub(super) fn borders(
        &self,
        reader: &mut ChunkReader<'_>,
        skeleton: &TreeSkeleton,
        folder: &Path,
    ) -> Result<ChunkBorders, ExternalError> {
        let mut borders = ChunkBorders {
            vertices: self.shared_vertices(reader, skeleton.chunk_count())?,
            ..ChunkBorders::default()
        };
        borders.steps = vec![0.0; borders.vertices.len()];
        borders.is_shared = vec![0; (self.facts.vertices as usize).div_ceil(64)];
        for vertex in &borders.vertices {
            borders.is_shared[vertex.number as usize / 64] |= 1 << (vertex.number % 64);
        }
        if !self.facts.has_normals {
            self.find_around(reader, skeleton.chunk_count(), folder, &mut borders)?;
        }
        self.find_steps(reader, skeleton, &mut borders)?;
        Ok(borders)
    }

    /// The vertices that several chunks have. A table has a word for each vertex of a run; all chunks are read for each run.
    fn shared_vertices(
        &self,
        reader: &mut ChunkReader<'_>,
        chunks: usize,
    ) -> Result<Vec<BorderVertex>, ExternalError> {
        let run = (self.options.table_bytes / 4).clamp(1024, 1 << 32);
        let runs = self.facts.vertices.div_ceil(run).max(1);
        self.progress.stage("finding borders", runs * chunks as u64);
        let mut shared = Vec::new();
        for start in (0..runs).map(|index| index * run) {
            let end = (start + run).min(self.facts.vertices);
            // The last chunk that had the vertex.
            let mut last = vec![NONE; (end - start) as usize];
            for chunk in 0..chunks {
                self.stop()?;
                let triangles = reader.triangles(chunk).map_err(|e| self.io(e))?;
                let chunk = chunk as u32;
                for &number in triangles.as_flattened() {
                    if !(start..end).contains(&u64::from(number)) {
                        continue;
                    }
                    let last = &mut last[(u64::from(number) - start) as usize];
                    if *last == chunk {
                        continue;
                    }
                    if *last != NONE {
                        let other = *last;
                        shared.push(BorderVertex {
                            number,
                            chunk: other,
                        });
                        shared.push(BorderVertex { number, chunk });
                    }
                    *last = chunk;
                }
                self.progress.advance(1);
            }
        }
        shared.sort_unstable();
        shared.dedup();
        Ok(shared)
    }

    /// Gives each chunk the triangles of others at its vertices.
    fn find_around(
        &self,
        reader: &mut ChunkReader<'_>,
        chunks: usize,
        folder: &Path,
        borders: &mut ChunkBorders,
    ) -> Result<(), ExternalError> {
        let mut spool = ChunkSpool::new(folder, chunks).map_err(|e| self.io(e))?;
        let mut others: Vec<u32> = Vec::new();
        for chunk in 0..chunks {
            self.stop()?;
            let triangles = reader.triangles(chunk).map_err(|e| self.io(e))?;
            for triangle in triangles {
                others.clear();
                for number in triangle {
                    let places = borders.places(number);
                    let own = borders.vertices[places].iter().map(|vertex| vertex.chunk);
                    others.extend(own.filter(|&other| other as usize != chunk));
                }
                others.sort_unstable();
                others.dedup();
                for &other in &others {
                    let bytes = bytemuck::bytes_of(&triangle);
                    let added = spool.append(other as usize, bytes);
                    added.map_err(|e| self.io(e))?;
                }
            }
        }
        borders.around = Some(spool);
        Ok(())
    }

    /// Finds the steps of all pages, and so those of shared vertices.
    fn find_steps(
        &self,
        reader: &mut ChunkReader<'_>,
        skeleton: &TreeSkeleton,
        borders: &mut ChunkBorders,
    ) -> Result<(), ExternalError> {
        let chunks = skeleton.chunk_count();
        self.progress.stage("placing vertices", chunks as u64);
        for chunk in 0..chunks {
            self.stop()?;
            let triangles = reader.triangles(chunk).map_err(|e| self.io(e))?;
            let NumberedMesh { mesh, numbers } = reader.mesh(&triangles)?;
            let shape = skeleton.shape(chunk)?;
            let order = leaf_order(&mesh, &shape)?;
            let (min, max) = box_of(&mesh.positions);
            let largest = min.abs().max(max.abs()).max_element();
            let starts = shape.leaf_starts(skeleton.leaf_level_of_chunks());
            for page in starts.windows(2) {
                let leaves = &order[page[0] as usize..page[1] as usize];
                let corners = || {
                    let own = leaves.iter().map(|&leaf| mesh.triangles[leaf as usize]);
                    own.flatten().map(|corner| corner as usize)
                };
                let places: Vec<Vec3> = corners().map(|corner| mesh.positions[corner]).collect();
                let (min, max) = box_of(&places);
                let step = page_step(min, max, largest);
                for corner in corners() {
                    for place in borders.places(numbers[corner]) {
                        borders.steps[place] = borders.steps[place].max(step);
                    }
                }
            }
            self.progress.advance(1);
        }
        Ok(())
    }
}

/// The box around positions.
fn box_of(places: &[Vec3]) -> (Vec3, Vec3) {
    let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    (places.iter()).fold(empty, |(min, max), &p| (min.min(p), max.max(p)))
}
