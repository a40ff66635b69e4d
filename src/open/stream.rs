//! The door to models that are read piece by piece, to build files of them that are larger than memory.

use super::{ModelSource, OpenOptions, SourceFormat};
use crate::Error;
use crate::generate::GeneratedStream;
use crate::input::{self, ReadWarning};
use crate::mesh::creases::USUAL_CREASE_DEGREES;
use crate::mesh::stream::{MeshStream, StreamError, StreamFacts, TakePiece, VertexPiece};
use crate::pages::external::ExternalOptions;
use crate::progress::Progress;
use crate::tree::PointNormals;

/// A model that is read piece by piece.
pub struct OpenedStream {
    /// Gives its pieces.
    pub stream: Box<dyn MeshStream>,
    /// What it is read as.
    pub format: SourceFormat,
    /// Size of the file, bytes; 0 without one.
    pub file_bytes: u64,
    /// What was repaired or left out, as far as is known before it is read.
    pub warnings: Vec<ReadWarning>,
}

impl std::fmt::Debug for OpenedStream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("OpenedStream")
            .field("format", &self.format)
            .finish_non_exhaustive()
    }
}

/// Opens a source to read it piece by piece; `None` where it must be read whole: see [`input::open_stream`]. Faces are not
/// repaired then, and vertices not merged.
///
/// # Errors
/// As [`super::open()`].
pub fn open_stream(
    source: &ModelSource,
    options: &OpenOptions,
    progress: &dyn Progress,
) -> Result<Option<OpenedStream>, Error> {
    let opened = match source {
        ModelSource::File(path) => {
            let streamed = input::open_stream(path, &options.input, progress)?;
            streamed.map(|model| OpenedStream {
                stream: model.stream,
                format: SourceFormat::Mesh(model.format),
                file_bytes: model.file_bytes,
                warnings: model.warnings,
            })
        }
        ModelSource::Generator(spec) => Some(OpenedStream {
            stream: Box::new(GeneratedStream::new(*spec)),
            format: SourceFormat::Generated,
            file_bytes: 0,
            warnings: Vec::new(),
        }),
        ModelSource::StandardInput | ModelSource::Scene(_) | ModelSource::Address(_) => None,
    };
    let are_left_out = |facts: StreamFacts| match facts.is_cloud() {
        true => options.tree.point_normals == PointNormals::None,
        false => options.tree.crease_degrees.is_some(),
    };
    Ok(
        opened.map(|opened| match are_left_out(opened.stream.facts()) {
            true => OpenedStream {
                stream: Box::new(WithoutNormals(opened.stream)),
                ..opened
            },
            false => opened,
        }),
    )
}

/// How a file is built of a stream that was opened by these options, with at most about `memory_bytes` of memory.
pub fn external_options(options: &OpenOptions, memory_bytes: u64) -> ExternalOptions {
    let crease = options.tree.crease_degrees.unwrap_or(USUAL_CREASE_DEGREES);
    ExternalOptions {
        crease_degrees: Some(crease),
        point_normals: options.tree.point_normals,
        table_bytes: memory_bytes / 4,
        ..ExternalOptions::default()
    }
}

/// A stream whose normals are not used.
struct WithoutNormals(Box<dyn MeshStream>);

impl MeshStream for WithoutNormals {
    fn facts(&self) -> StreamFacts {
        StreamFacts {
            has_normals: false,
            ..self.0.facts()
        }
    }

    fn vertices(&self, take: &mut TakePiece<'_, VertexPiece>) -> Result<(), StreamError> {
        self.0.vertices(&mut |piece: &VertexPiece| {
            take(&VertexPiece {
                normals: Vec::new(),
                ..piece.clone()
            })
        })
    }

    fn vertices_at(&self, numbers: &[u32]) -> Result<VertexPiece, StreamError> {
        let mut piece = self.0.vertices_at(numbers)?;
        piece.normals = Vec::new();
        Ok(piece)
    }

    fn triangles(&self, take: &mut TakePiece<'_, [[u32; 3]]>) -> Result<(), StreamError> {
        self.0.triangles(take)
    }

    fn remarks(&self) -> Vec<String> {
        self.0.remarks()
    }
}
