//! The leaves of a chunk: how they lie in the temporary file, and the mesh that they make.

use super::ModelSpace;
use super::spool::ChunkSpool;
use crate::math::octahedral;
use crate::mesh::Mesh;
use crate::mesh::stream::{MeshStream, StreamError, StreamFacts, VertexPiece};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::io;

/// The packed normal of a point without one; no direction has it.
const NO_NORMAL: [i16; 2] = [i16::MIN; 2];

/// Bytes of a point: its position, its packed normal, its color.
pub(super) fn point_bytes(facts: &StreamFacts) -> usize {
    12 + if facts.has_normals { 4 } else { 0 } + if facts.has_colors { 3 } else { 0 }
}

/// Leaves of a piece.
pub(super) enum LeafRecords<'a> {
    Points(&'a VertexPiece),
    /// Corners as numbers and as positions.
    Triangles(&'a [[u32; 3]], &'a [[DVec3; 3]]),
}

impl LeafRecords<'_> {
    /// Appends the record of a leaf: a point with its normal and color, or the numbers of a triangle's corners.
    pub(super) fn encode(&self, index: usize, space: &ModelSpace, bytes: &mut Vec<u8>) {
        match self {
            Self::Points(piece) => {
                let place = space.place(piece.positions[index]);
                bytes.extend_from_slice(bytemuck::bytes_of(&place));
                if let Some(&normal) = piece.normals.get(index) {
                    let code = match normal == Vec3::ZERO {
                        true => NO_NORMAL,
                        false => octahedral::encode(normal),
                    };
                    bytes.extend_from_slice(bytemuck::bytes_of(&code));
                }
                if let Some(color) = piece.colors.get(index) {
                    bytes.extend_from_slice(&color[..3]);
                }
            }
            Self::Triangles(triangles, _) => {
                bytes.extend_from_slice(bytemuck::bytes_of(&triangles[index]));
            }
        }
    }
}

/// Vertices picked from a stream, by their numbers.
struct PickedVertices {
    /// Ascending, each once.
    numbers: Vec<u32>,
    /// Places in `numbers` from the first number on, where those lie dense; else empty.
    table: Vec<u32>,
}

impl PickedVertices {
    fn of(triangles: &[[u32; 3]]) -> Self {
        let all = triangles.as_flattened();
        let chunks = || all.par_chunks(1 << 16);
        let least = chunks().filter_map(|c| c.iter().min()).min().copied();
        let most = chunks().filter_map(|c| c.iter().max()).max().copied();
        let (Some(least), Some(most)) = (least, most) else {
            return Self {
                numbers: Vec::new(),
                table: Vec::new(),
            };
        };
        let span = (most - least) as usize + 1;
        if span > 8 * all.len() {
            let mut numbers = all.to_vec();
            numbers.par_sort_unstable();
            numbers.dedup();
            let table = Vec::new();
            return Self { numbers, table };
        }
        // Dense: marked, then counted.
        let mut table = vec![0u32; span];
        for &number in all {
            table[(number - least) as usize] = 1;
        }
        let mut numbers = Vec::new();
        for (number, place) in (least..).zip(&mut table) {
            if *place == 1 {
                *place = numbers.len() as u32;
                numbers.push(number);
            }
        }
        Self { numbers, table }
    }

    /// The place of a number that was picked.
    fn place(&self, number: u32) -> u32 {
        match self.table.is_empty() {
            false => self.table[(number - self.numbers[0]) as usize],
            true => self.numbers.partition_point(|&own| own < number) as u32,
        }
    }
}

/// The world positions of the corners of some triangles.
pub(super) fn corner_positions(
    stream: &dyn MeshStream,
    triangles: &[[u32; 3]],
) -> Result<Vec<[DVec3; 3]>, StreamError> {
    let picked = PickedVertices::of(triangles);
    let piece = stream.vertices_at(&picked.numbers)?;
    Ok(triangles
        .par_iter()
        .with_min_len(1 << 12)
        .map(|corners| corners.map(|corner| piece.positions[picked.place(corner) as usize]))
        .collect())
}

/// A mesh of some triangles of a stream, in model space, and the numbers that its vertices have in the stream.
fn picked_mesh(
    stream: &dyn MeshStream,
    space: &ModelSpace,
    triangles: &[[u32; 3]],
) -> Result<NumberedMesh, StreamError> {
    let picked = PickedVertices::of(triangles);
    let VertexPiece {
        positions,
        normals,
        colors,
    } = stream.vertices_at(&picked.numbers)?;
    let mesh = Mesh {
        positions: positions.par_iter().map(|&p| space.place(p)).collect(),
        normals,
        colors,
        triangles: triangles
            .par_iter()
            .with_min_len(1 << 12)
            .map(|corners| corners.map(|corner| picked.place(corner)))
            .collect(),
        origin: space.origin(),
        textures: None,
        scanners: crate::mesh::scanners::ScannerPlaces::default(),
    };
    let numbers = picked.numbers;
    Ok(NumberedMesh { mesh, numbers })
}

/// A mesh and the numbers that its vertices have in the stream, ascending.
pub(super) struct NumberedMesh {
    pub(super) mesh: Mesh,
    pub(super) numbers: Vec<u32>,
}

/// The whole stream as a mesh; leaves that are not finite are left out.
pub(super) fn whole_mesh(stream: &dyn MeshStream, space: &ModelSpace) -> Result<Mesh, StreamError> {
    let facts = stream.facts();
    let mut mesh = Mesh {
        origin: space.origin(),
        ..Mesh::default()
    };
    if facts.is_cloud() {
        stream.vertices(&mut |piece: &VertexPiece| {
            let finite = |index: &usize| piece.positions[*index].is_finite();
            for index in (0..piece.positions.len()).filter(finite) {
                mesh.positions.push(space.place(piece.positions[index]));
                mesh.normals.extend(piece.normals.get(index));
                mesh.colors.extend(piece.colors.get(index));
            }
            Ok(())
        })?;
        return Ok(mesh);
    }
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    stream.triangles(&mut |piece: &[[u32; 3]]| {
        let corners = corner_positions(stream, piece)?;
        let is_finite = |corners: &[DVec3; 3]| corners.iter().all(|p| p.is_finite());
        let kept = piece
            .iter()
            .zip(&corners)
            .filter(|(_, corners)| is_finite(corners));
        triangles.extend(kept.map(|(triangle, _)| *triangle));
        Ok(())
    })?;
    Ok(picked_mesh(stream, space, &triangles)?.mesh)
}

/// Reads chunks.
pub(super) struct ChunkReader<'a> {
    pub(super) stream: &'a dyn MeshStream,
    pub(super) facts: StreamFacts,
    pub(super) space: ModelSpace,
    pub(super) spool: ChunkSpool,
}

impl ChunkReader<'_> {
    /// The points of a chunk.
    ///
    /// # Errors
    /// The temporary file cannot be read.
    pub(super) fn points(&mut self, chunk: usize) -> io::Result<Mesh> {
        let bytes = self.spool.read(chunk)?;
        let normal = self.facts.has_normals;
        let length = point_bytes(&self.facts);
        let mut mesh = Mesh {
            origin: self.space.origin(),
            ..Mesh::default()
        };
        for record in bytes.chunks_exact(length) {
            let (place, rest) = record.split_at(12);
            mesh.positions.push(bytemuck::pod_read_unaligned(place));
            let (code, rest) = rest.split_at(if normal { 4 } else { 0 });
            if normal {
                let code: [i16; 2] = bytemuck::pod_read_unaligned(code);
                mesh.normals.push(match code == NO_NORMAL {
                    true => Vec3::ZERO,
                    false => octahedral::decode(code),
                });
            }
            if let &[r, g, b] = rest {
                mesh.colors.push([r, g, b, 255]);
            }
        }
        Ok(mesh)
    }

    /// The triangles of a chunk, corners as numbers of the stream.
    ///
    /// # Errors
    /// The temporary file cannot be read.
    pub(super) fn triangles(&mut self, chunk: usize) -> io::Result<Vec<[u32; 3]>> {
        Ok(triangles_of(&self.spool.read(chunk)?))
    }

    /// The mesh of some triangles.
    ///
    /// # Errors
    /// The stream fails.
    pub(super) fn mesh(&self, triangles: &[[u32; 3]]) -> Result<NumberedMesh, StreamError> {
        picked_mesh(self.stream, &self.space, triangles)
    }
}

/// Records of triangles.
pub(super) fn triangles_of(bytes: &[u8]) -> Vec<[u32; 3]> {
    let records = bytes.chunks_exact(size_of::<[u32; 3]>());
    records.map(bytemuck::pod_read_unaligned).collect()
}
