//! Models that are read piece by piece, as often as needed, since they may be larger than memory.

use super::Mesh;
use glam::{DVec3, Vec3};

/// Why a stream does not give what it should: an error of whoever reads it.
pub type StreamError = Box<dyn std::error::Error + Send + Sync>;

/// What takes the pieces of a stream; its error ends the reading and is passed on.
pub type TakePiece<'a, T> = dyn FnMut(&T) -> Result<(), StreamError> + 'a;

/// Vertices or triangles of a piece, at most about this many.
pub const PIECE: usize = 1 << 19;

/// What is known of a stream before it is read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct StreamFacts {
    /// Number of vertices.
    pub vertices: u64,
    /// Number of faces as the file counts them; 0 for a cloud.
    pub faces: u64,
    /// All vertices have normals (zero where unknown), else none has.
    pub has_normals: bool,
    /// All vertices have colors, else none has.
    pub has_colors: bool,
}

impl StreamFacts {
    /// Tells whether the stream is a cloud of points.
    pub fn is_cloud(&self) -> bool {
        self.faces == 0
    }
}

/// Some vertices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VertexPiece {
    /// World positions; some may not be finite.
    pub positions: Vec<DVec3>,
    /// Unit normals, zero where unknown; empty where the stream has none.
    pub normals: Vec<Vec3>,
    /// Colors; empty where the stream has none.
    pub colors: Vec<[u8; 4]>,
}

/// A mesh or cloud that can be read again and again, with the same result.
pub trait MeshStream: Sync {
    /// What is known before it is read.
    fn facts(&self) -> StreamFacts;

    /// Gives all vertices in their order, piece by piece.
    ///
    /// # Errors
    /// The source cannot be read or is damaged; the error of `take`.
    fn vertices(&self, take: &mut TakePiece<'_, VertexPiece>) -> Result<(), StreamError>;

    /// Gives the vertices of some numbers, which ascend.
    ///
    /// # Errors
    /// As [`MeshStream::vertices`]; a number that no vertex has.
    fn vertices_at(&self, numbers: &[u32]) -> Result<VertexPiece, StreamError>;

    /// Gives all triangles in their order, piece by piece, as numbers of vertices that exist.
    ///
    /// # Errors
    /// As [`MeshStream::vertices`].
    fn triangles(&self, take: &mut TakePiece<'_, [[u32; 3]]>) -> Result<(), StreamError>;
}

impl Mesh {
    fn piece(&self, numbers: impl Iterator<Item = usize> + Clone) -> VertexPiece {
        fn pick<T: Copy>(all: &[T], numbers: impl Iterator<Item = usize>) -> Vec<T> {
            match all.is_empty() {
                true => Vec::new(),
                false => numbers.map(|index| all[index]).collect(),
            }
        }
        let positions = numbers.clone();
        VertexPiece {
            positions: positions
                .map(|index| self.origin + self.positions[index].as_dvec3())
                .collect(),
            normals: pick(&self.normals, numbers.clone()),
            colors: pick(&self.colors, numbers),
        }
    }
}

/// A mesh in memory, for formats that are read whole.
impl MeshStream for Mesh {
    fn facts(&self) -> StreamFacts {
        StreamFacts {
            vertices: self.positions.len() as u64,
            faces: self.triangles.len() as u64,
            has_normals: !self.normals.is_empty(),
            has_colors: !self.colors.is_empty(),
        }
    }

    fn vertices(&self, take: &mut TakePiece<'_, VertexPiece>) -> Result<(), StreamError> {
        let count = self.positions.len();
        for start in (0..count).step_by(PIECE) {
            take(&self.piece(start..(start + PIECE).min(count)))?;
        }
        Ok(())
    }

    fn vertices_at(&self, numbers: &[u32]) -> Result<VertexPiece, StreamError> {
        match numbers.last() {
            Some(&last) if last as usize >= self.positions.len() => {
                Err(format!("vertex {last} of {}", self.positions.len()).into())
            }
            _ => Ok(self.piece(numbers.iter().map(|&number| number as usize))),
        }
    }

    fn triangles(&self, take: &mut TakePiece<'_, [[u32; 3]]>) -> Result<(), StreamError> {
        self.triangles.chunks(PIECE).try_for_each(take)
    }
}
