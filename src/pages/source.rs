//! Where bytes lie: ranges of a file or of memory, by position.
//!
//! No file is mapped: one that is cut short while it is mapped would end the process. Every read is of a given range and
//! gives all of it or an error.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Bytes that are read by position, from any thread.
pub trait ByteSource: Send + Sync + std::fmt::Debug {
    /// Name for messages: the path.
    fn name(&self) -> &str;

    /// Number of bytes when it was opened.
    fn len(&self) -> u64;

    /// Tells whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of reads that are done at once where many are wanted, at least 1: more where each waits for an answer.
    fn parallel_reads(&self) -> usize {
        1
    }

    /// Fills `out` with the bytes from `offset` on.
    ///
    /// # Errors
    /// The system's; [`io::ErrorKind::UnexpectedEof`] where the range ends behind the last byte.
    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()>;

    /// Opens a file by its path from the folder of this one, with `/` between its parts.
    ///
    /// # Errors
    /// The system's; there is no folder, or the path leads out of what may be read.
    fn beside(&self, path: &str) -> io::Result<Arc<dyn ByteSource>> {
        let cause = format!("{} is in no folder in which {path} could be", self.name());
        Err(io::Error::new(io::ErrorKind::Unsupported, cause))
    }
}

/// Bytes in memory.
#[derive(Debug, Clone)]
pub struct MemorySource {
    name: String,
    bytes: Arc<[u8]>,
}

impl MemorySource {
    /// Bytes under a name for messages.
    pub fn new(name: impl Into<String>, bytes: impl Into<Arc<[u8]>>) -> Self {
        Self {
            name: name.into(),
            bytes: bytes.into(),
        }
    }
}

impl ByteSource for MemorySource {
    fn name(&self) -> &str {
        &self.name
    }

    fn len(&self) -> u64 {
        self.bytes.len() as u64
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let start = usize::try_from(offset).ok();
        let range = start.and_then(|start| Some(start..start.checked_add(out.len())?));
        match range.and_then(|range| self.bytes.get(range)) {
            Some(bytes) => {
                out.copy_from_slice(bytes);
                Ok(())
            }
            None => Err(io::ErrorKind::UnexpectedEof.into()),
        }
    }
}

/// A file, read by position: no thread moves another's place in it.
#[derive(Debug)]
pub struct FileSource {
    path: PathBuf,
    name: String,
    file: File,
    length: u64,
}

impl FileSource {
    /// Opens a file.
    ///
    /// # Errors
    /// The system's.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        Ok(Self {
            path: path.to_owned(),
            name: path.display().to_string(),
            file,
            length,
        })
    }
}

impl ByteSource for FileSource {
    fn name(&self) -> &str {
        &self.name
    }

    fn len(&self) -> u64 {
        self.length
    }

    #[cfg(unix)]
    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(&self.file, out, offset)
    }

    #[cfg(windows)]
    fn read_at(&self, mut offset: u64, mut out: &mut [u8]) -> io::Result<()> {
        while !out.is_empty() {
            match std::os::windows::fs::FileExt::seek_read(&self.file, out, offset)? {
                0 => return Err(io::ErrorKind::UnexpectedEof.into()),
                count => {
                    out = &mut out[count..];
                    offset += count as u64;
                }
            }
        }
        Ok(())
    }

    fn beside(&self, path: &str) -> io::Result<Arc<dyn ByteSource>> {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let path = folder.join(path);
        let named =
            |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", path.display()));
        Ok(Arc::new(Self::open(&path).map_err(named)?))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_given_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bytes");
        let bytes: Vec<u8> = (0..200).collect();
        std::fs::write(&path, &bytes).unwrap();
        let file = FileSource::open(&path).unwrap();
        let memory = MemorySource::new("memory", bytes.clone());
        assert!(file.name().ends_with("bytes") && memory.name() == "memory");
        for source in [&file as &dyn ByteSource, &memory] {
            assert_eq!((source.len(), source.is_empty()), (200, false));
            let mut out = [0; 20];
            source.read_at(180, &mut out).unwrap();
            assert_eq!(out, bytes[180..]);
            for offset in [181, 200, 10_000, u64::MAX - 5] {
                let error = source.read_at(offset, &mut out).unwrap_err();
                let kind = error.kind();
                // The system does not know such places at all.
                let is_end = kind == io::ErrorKind::UnexpectedEof || offset > 1 << 62;
                assert!(is_end, "{offset} {kind}");
            }
            source.read_at(200, &mut []).unwrap();
        }
        // A file that shrinks gives an error, not a signal.
        File::options()
            .write(true)
            .open(&path)
            .unwrap()
            .set_len(100)
            .unwrap();
        assert!(file.read_at(90, &mut [0; 20]).is_err());
        assert!(FileSource::open(&folder.path().join("none")).is_err());
    }
}
