//! Models that are read piece by piece from a file: binary PLY, LAS and LAZ. Their rows have a fixed size, or an index tells
//! where they are, so that no more than a piece is in memory.

use super::job::ReadJob;
use super::{Error, Format, ReadOptions, ReadWarning, source};
use crate::mesh::stream::{MeshStream, StreamError};
use crate::progress::{Progress, SilentProgress};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// A model that is read piece by piece.
pub struct StreamedModel {
    /// Gives its pieces.
    pub stream: Box<dyn MeshStream>,
    /// The format that was recognized.
    pub format: Format,
    /// Size of the file in bytes.
    pub file_bytes: u64,
    /// What was repaired or left out, as far as the beginning of the file tells.
    pub warnings: Vec<ReadWarning>,
}

impl std::fmt::Debug for StreamedModel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("StreamedModel")
            .field("format", &self.format)
            .field("file_bytes", &self.file_bytes)
            .finish_non_exhaustive()
    }
}

/// Bytes of the beginning of a file that are looked at.
const HEAD: u64 = 1 << 20;

/// Opens a model to read it piece by piece; `None` where its file must be read whole: other formats, standard input, gzip,
/// and what these formats have beyond vertices with normals and colors, and faces. Attributes of points are left out.
///
/// # Errors
/// The file cannot be opened, or its header is damaged.
pub fn open_stream(
    path: &Path,
    options: &ReadOptions,
    progress: &dyn Progress,
) -> Result<Option<StreamedModel>, Error> {
    if path == Path::new("-") {
        return Ok(None);
    }
    let (file, length) = source::open_file(path)?;
    let rows = RowFile::new(path, file, length);
    let head = rows.read(0, length.min(HEAD))?;
    let mut job = ReadJob::new(path, None, options, &SilentProgress);
    if head.starts_with(b"ply") {
        super::ply::open_stream(&mut job, rows, &head)
    } else if head.starts_with(b"LASF") && options.color.is_none() {
        super::points::las::open_stream(&mut job, rows, progress)
    } else {
        Ok(None)
    }
}

/// Reads ranges of a file, from any thread.
#[derive(Debug)]
pub(super) struct RowFile {
    pub(super) path: PathBuf,
    pub(super) length: u64,
    file: Mutex<File>,
}

impl RowFile {
    fn new(path: &Path, file: File, length: u64) -> Self {
        Self {
            path: path.to_owned(),
            length,
            file: Mutex::new(file),
        }
    }

    /// The bytes of a range.
    ///
    /// # Errors
    /// The file does not have them, or cannot be read.
    pub(super) fn read(&self, offset: u64, length: u64) -> Result<Vec<u8>, Error> {
        let failed = |source| Error::Open {
            path: self.path.clone(),
            source,
        };
        if offset
            .checked_add(length)
            .is_none_or(|end| end > self.length)
        {
            return Err(failed(io::ErrorKind::UnexpectedEof.into()));
        }
        let mut bytes = vec![0; length as usize];
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(offset)).map_err(failed)?;
        file.read_exact(&mut bytes).map_err(failed)?;
        Ok(bytes)
    }
}

/// An error of a reader on its way through a stream.
pub(super) fn boxed(error: Error) -> StreamError {
    Box::new(error)
}
