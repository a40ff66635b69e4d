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

    /// Says what the last reading has left out or repaired, a sentence each.
    fn remarks(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Several streams of one kind as one, in their order. Colors of those without are white, normals unknown.
pub struct JoinedStream {
    streams: Vec<Box<dyn MeshStream>>,
    /// First vertex of each, then their number.
    starts: Vec<u64>,
    facts: StreamFacts,
}

impl std::fmt::Debug for JoinedStream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("JoinedStream").field(&self.facts).finish()
    }
}

impl JoinedStream {
    /// Joins streams.
    ///
    /// # Errors
    /// Clouds and surfaces together, or more vertices than 32 bits can number.
    pub fn new(streams: Vec<Box<dyn MeshStream>>) -> Result<Self, StreamError> {
        let mut facts = StreamFacts::default();
        let mut starts = vec![0];
        for stream in &streams {
            let own = stream.facts();
            facts.vertices += own.vertices;
            facts.faces += own.faces;
            facts.has_normals |= own.has_normals;
            facts.has_colors |= own.has_colors;
            starts.push(facts.vertices);
        }
        let clouds = streams.iter().filter(|stream| stream.facts().is_cloud());
        let clouds = clouds.count();
        if clouds != 0 && clouds != streams.len() {
            return Err("clouds and surfaces cannot be joined".into());
        }
        if clouds == 0
            && streams
                .iter()
                .any(|s| s.facts().has_normals != facts.has_normals)
        {
            // Normals are made of all or of none.
            facts.has_normals = false;
        }
        if facts.vertices > u64::from(u32::MAX) {
            return Err(format!(
                "{} vertices; at most 4294967295 can be joined",
                facts.vertices
            )
            .into());
        }
        Ok(Self {
            streams,
            starts,
            facts,
        })
    }

    /// Gives a piece what the others have.
    fn completed(&self, piece: &VertexPiece) -> VertexPiece {
        let mut piece = piece.clone();
        let count = piece.positions.len();
        match self.facts.has_normals {
            true => piece.normals.resize(count, Vec3::ZERO),
            false => piece.normals.clear(),
        }
        if self.facts.has_colors {
            piece.colors.resize(count, [255; 4]);
        }
        piece
    }
}

impl MeshStream for JoinedStream {
    fn facts(&self) -> StreamFacts {
        self.facts
    }

    fn vertices(&self, take: &mut TakePiece<'_, VertexPiece>) -> Result<(), StreamError> {
        let own = |piece: &VertexPiece| take(&self.completed(piece));
        let mut own = own;
        self.streams
            .iter()
            .try_for_each(|stream| stream.vertices(&mut own))
    }

    fn vertices_at(&self, numbers: &[u32]) -> Result<VertexPiece, StreamError> {
        let mut all = VertexPiece::default();
        for (stream, range) in self.streams.iter().zip(self.starts.windows(2)) {
            let place = |start: u64| numbers.partition_point(|&n| u64::from(n) < start);
            let own = &numbers[place(range[0])..place(range[1])];
            if own.is_empty() {
                continue;
            }
            let own: Vec<u32> = own.iter().map(|&n| n - range[0] as u32).collect();
            let piece = self.completed(&stream.vertices_at(&own)?);
            all.positions.extend(piece.positions);
            all.normals.extend(piece.normals);
            all.colors.extend(piece.colors);
        }
        match all.positions.len() == numbers.len() {
            true => Ok(all),
            false => Err("a vertex that no stream has".into()),
        }
    }

    fn triangles(&self, take: &mut TakePiece<'_, [[u32; 3]]>) -> Result<(), StreamError> {
        for (stream, &start) in self.streams.iter().zip(&self.starts) {
            let start = start as u32;
            stream.triangles(&mut |triangles: &[[u32; 3]]| {
                let moved: Vec<[u32; 3]> = (triangles.iter())
                    .map(|corners| corners.map(|corner| corner + start))
                    .collect();
                take(&moved)
            })?;
        }
        Ok(())
    }

    fn remarks(&self) -> Vec<String> {
        let all = self.streams.iter().flat_map(|stream| stream.remarks());
        all.collect()
    }
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
