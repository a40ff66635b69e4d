//! Lists of bytes on disk, one for each chunk, in one nameless temporary file: whatever ends the program leaves nothing.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Bytes that a list gets at once; each list holds as much in memory.
const BLOCK: usize = 16 << 10;

/// The same, of many lists.
const SMALL_BLOCK: usize = 4 << 10;

/// Lists from which on blocks are small.
const MANY: usize = 4096;

/// A list: its blocks in the file, and the bytes after them.
#[derive(Debug, Default)]
struct SpoolList {
    blocks: Vec<u64>,
    pending: Vec<u8>,
}

/// The lists.
#[derive(Debug)]
pub(super) struct ChunkSpool {
    file: File,
    block: usize,
    lists: Vec<SpoolList>,
    end: u64,
}

impl ChunkSpool {
    /// Makes empty lists, whose file lies in `folder`.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub(super) fn new(folder: &Path, count: usize) -> io::Result<Self> {
        Ok(Self {
            file: tempfile::tempfile_in(folder)?,
            block: if count >= MANY { SMALL_BLOCK } else { BLOCK },
            lists: (0..count).map(|_| SpoolList::default()).collect(),
            end: 0,
        })
    }

    /// Adds bytes to a list.
    ///
    /// # Errors
    /// The disk is full.
    pub(super) fn append(&mut self, list: usize, bytes: &[u8]) -> io::Result<()> {
        let own = &mut self.lists[list];
        own.pending.extend_from_slice(bytes);
        while own.pending.len() >= self.block {
            self.file.seek(SeekFrom::Start(self.end))?;
            self.file.write_all(&own.pending[..self.block])?;
            own.pending.drain(..self.block);
            own.blocks.push(self.end);
            self.end += self.block as u64;
        }
        Ok(())
    }

    /// The bytes of a list.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(super) fn read(&mut self, list: usize) -> io::Result<Vec<u8>> {
        let own = &self.lists[list];
        let mut bytes = vec![0; own.blocks.len() * self.block];
        for (piece, &offset) in bytes.chunks_exact_mut(self.block).zip(&own.blocks) {
            self.file.seek(SeekFrom::Start(offset))?;
            self.file.read_exact(piece)?;
        }
        bytes.extend_from_slice(&own.pending);
        Ok(bytes)
    }

    /// Bytes on disk.
    pub(super) fn bytes(&self) -> u64 {
        self.end
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn lists_come_back_whole() {
        let folder = tempfile::tempdir().unwrap();
        let mut spool = ChunkSpool::new(folder.path(), 3).unwrap();
        let mut expected = vec![Vec::new(); 3];
        for step in 0..5000usize {
            let bytes: Vec<u8> = (0..step % 37).map(|i| (i * step) as u8).collect();
            spool.append(step % 2, &bytes).unwrap();
            expected[step % 2].extend(bytes);
        }
        for (list, expected) in expected.iter().enumerate() {
            assert_eq!(&spool.read(list).unwrap(), expected);
        }
        assert!(spool.bytes() >= 3 * BLOCK as u64);
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 0, "the file has no name");
    }
}
