//! Lists of bytes on disk, one for each chunk, in one nameless temporary file: whatever ends the program leaves nothing.

use crate::pages::page_tops::{PageTop, TopSize, TopSource};
use crate::tree::NodeRecords;
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

/// First levels of the leaf pages, chunk by chunk, in the order in which they are wanted again.
#[derive(Debug)]
pub(super) struct SpooledTops {
    spool: ChunkSpool,
    chunks: usize,
    /// The chunk that is read next, and what is left of the one before.
    chunk: usize,
    bytes: Vec<u8>,
    at: usize,
}

impl SpooledTops {
    /// Makes empty lists, whose file lies in `folder`.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub(super) fn new(folder: &Path, chunks: usize) -> io::Result<Self> {
        Ok(Self {
            spool: ChunkSpool::new(folder, chunks)?,
            chunks,
            chunk: 0,
            bytes: Vec::new(),
            at: 0,
        })
    }

    /// Bytes of pages of these sizes.
    pub(super) fn bytes_of(sizes: &[TopSize]) -> u64 {
        let records = |size: &TopSize| u64::from(size.nodes + size.leaves);
        let of_one = |size: &TopSize| 4 + records(size) * size_of::<NodeRecords>() as u64;
        sizes.iter().map(of_one).sum()
    }

    /// Adds the top of the next page of a chunk.
    ///
    /// # Errors
    /// The disk is full.
    pub(super) fn append(&mut self, chunk: usize, PageTop(records): &PageTop) -> io::Result<()> {
        let count = records.len() as u32;
        self.spool.append(chunk, &count.to_le_bytes())?;
        self.spool.append(chunk, bytemuck::cast_slice(records))
    }
}

impl TopSource for SpooledTops {
    fn next_top(&mut self) -> io::Result<PageTop> {
        while self.at >= self.bytes.len() && self.chunk < self.chunks {
            self.bytes = self.spool.read(self.chunk)?;
            (self.chunk, self.at) = (self.chunk + 1, 0);
        }
        let short = || io::Error::from(io::ErrorKind::UnexpectedEof);
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let (count, rest) = rest.split_first_chunk().ok_or_else(short)?;
        let length = u32::from_le_bytes(*count) as usize * size_of::<NodeRecords>();
        let records = rest.get(..length).ok_or_else(short)?;
        self.at += 4 + length;
        let records = records.chunks_exact(size_of::<NodeRecords>());
        Ok(PageTop(records.map(bytemuck::pod_read_unaligned).collect()))
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

    #[test]
    fn tops_come_back_in_the_order_of_pages() {
        let folder = tempfile::tempdir().unwrap();
        let mut tops = SpooledTops::new(folder.path(), 4).unwrap();
        let of_length = |length: usize| {
            let record: NodeRecords = bytemuck::Zeroable::zeroed();
            PageTop(vec![record; length])
        };
        // The second chunk has none.
        let lengths = [(0, 21), (0, 5), (2, 0), (2, 300), (3, 1)];
        for (chunk, length) in lengths {
            tops.append(chunk, &of_length(length)).unwrap();
        }
        for (_, length) in lengths {
            assert_eq!(tops.next_top().unwrap().0.len(), length);
        }
        assert!(tops.next_top().is_err());
        let sizes = [
            TopSize {
                nodes: 5,
                leaves: 16,
            },
            TopSize {
                nodes: 1,
                leaves: 4,
            },
        ];
        assert_eq!(SpooledTops::bytes_of(&sizes), 8 + 26 * 72);
    }
}
