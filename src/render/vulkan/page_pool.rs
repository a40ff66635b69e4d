//! Vertices of the pages of paged files on the device: many pages in each of a few buffers, so that what binds a buffer does
//! so a few times a frame and not once for each page.
//!
//! A buffer (chunk) is filled from its start; what was written never changes, so that frames on their way may read it. Where
//! the room ends, a chunk most of whose pages went, or that is smaller than the largest, is written anew: twice as large,
//! with the pages that are left. A chunk that was replaced is destroyed once the frames that use it have finished.

use crate::abi::Vertex;
use crate::gpu::buffer::{BufferUsage, DeviceBuffer};
use crate::gpu::{Error, Gpu};
use std::sync::Arc;

/// Vertices of the first chunk: 16 MiB of 20 bytes each, about two hundred pages.
const FIRST_VERTICES: u32 = 1 << 19;

/// Most vertices of a chunk unless the device allows less: 256 MiB.
const MOST_VERTICES: u32 = 1 << 23;

/// A buffer with the vertices of pages.
#[derive(Debug)]
pub(super) struct PoolChunk {
    pub(super) vertices: DeviceBuffer,
    capacity: u32,
    /// Vertices that were written, from the start.
    used: u32,
}

/// Where the vertices of a page lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PoolPlace {
    /// Index of the chunk.
    pub(super) chunk: usize,
    /// The first of its vertices there.
    pub(super) first: u32,
    count: u32,
}

/// Vertices of pages, by the number of each page's facts.
#[derive(Debug)]
pub(super) struct PagePool {
    chunks: Vec<PoolChunk>,
    most_vertices: u32,
}

/// A page whose vertices are in the pool, or are to be.
#[derive(Debug)]
pub(super) struct PooledPage<'a> {
    pub(super) vertices: &'a [Vertex],
    pub(super) place: Option<PoolPlace>,
}

impl PagePool {
    /// An empty pool whose chunks have at most so many vertices (at least 3).
    pub(super) fn new(most_vertices: usize) -> Self {
        Self {
            chunks: Vec::new(),
            most_vertices: MOST_VERTICES.min(u32::try_from(most_vertices).unwrap_or(u32::MAX)),
        }
    }

    /// The chunks.
    pub(super) fn chunks(&self) -> &[PoolChunk] {
        &self.chunks
    }

    /// Writes the pages that have no place yet, and gives them one. `pages` are all that are to stay: others are forgotten.
    /// Places of those that stay may change.
    ///
    /// # Errors
    /// When device memory runs out; a page larger than a chunk.
    pub(super) fn place_all(
        &mut self,
        gpu: &Arc<Gpu>,
        pages: &mut [PooledPage<'_>],
    ) -> Result<(), Error> {
        let missing: u64 = (pages.iter().filter(|page| page.place.is_none()))
            .map(|page| page.vertices.len() as u64)
            .sum();
        if missing == 0 {
            return Ok(());
        }
        let last = self.chunks.len().saturating_sub(1);
        let room = self
            .chunks
            .last()
            .map_or(0, |chunk| u64::from(chunk.capacity - chunk.used));
        if missing > room {
            // What the last chunk and those that are mostly empty still hold is written again, beside what is new.
            let mut live = vec![0u64; self.chunks.len()];
            for place in pages.iter().filter_map(|page| page.place) {
                live[place.chunk] += u64::from(place.count);
            }
            let is_kept = |index: usize, chunk: &PoolChunk| {
                let is_full_size = chunk.capacity >= self.most_vertices;
                let is_full = 2 * live[index] >= u64::from(chunk.used);
                is_full && (index != last || is_full_size)
            };
            let kept: Vec<bool> = (self.chunks.iter().enumerate())
                .map(|(index, chunk)| is_kept(index, chunk))
                .collect();
            let mut moved = vec![0; kept.len()];
            let mut count = 0;
            for (index, &is_kept) in kept.iter().enumerate() {
                moved[index] = count;
                count += usize::from(is_kept);
            }
            for page in &mut *pages {
                page.place = page.place.filter(|place| kept[place.chunk]);
                if let Some(place) = &mut page.place {
                    place.chunk = moved[place.chunk];
                }
            }
            let mut stays = kept.into_iter();
            self.chunks.retain(|_| stays.next().unwrap_or(false));
        }
        self.write_missing(gpu, pages)
    }

    /// Writes what has no place: to the last chunk as far as there is room, then to new ones.
    fn write_missing(&mut self, gpu: &Arc<Gpu>, pages: &mut [PooledPage<'_>]) -> Result<(), Error> {
        let mut missing: u64 = (pages.iter().filter(|page| page.place.is_none()))
            .map(|page| page.vertices.len() as u64)
            .sum();
        let mut bytes: Vec<u8> = Vec::new();
        let mut start = self.chunks.last().map_or(0, |chunk| chunk.used);
        for page in pages.iter_mut().filter(|page| page.place.is_none()) {
            let count = page.vertices.len() as u32;
            let fits = |chunk: &PoolChunk| chunk.capacity - chunk.used >= count;
            if !self.chunks.last().is_some_and(fits) {
                self.flush(gpu, start, &mut bytes)?;
                // Room for as much again.
                let wanted = (2 * missing).clamp(
                    u64::from(FIRST_VERTICES.min(self.most_vertices)),
                    u64::from(self.most_vertices),
                );
                let capacity = (wanted as u32).max(count);
                let name = format!("vertices of pages, chunk {}", self.chunks.len());
                let size = u64::from(capacity) * size_of::<Vertex>() as u64;
                self.chunks.push(PoolChunk {
                    vertices: DeviceBuffer::new(gpu, &name, BufferUsage::Vertex, size)?,
                    capacity,
                    used: 0,
                });
                start = 0;
            }
            let chunk = self.chunks.len() - 1;
            let own = &mut self.chunks[chunk];
            page.place = Some(PoolPlace {
                chunk,
                first: own.used,
                count,
            });
            own.used += count;
            missing -= u64::from(count);
            bytes.extend_from_slice(bytemuck::cast_slice(page.vertices));
        }
        self.flush(gpu, start, &mut bytes)
    }

    /// Writes bytes to the last chunk, from vertex `start` on.
    fn flush(&mut self, gpu: &Arc<Gpu>, start: u32, bytes: &mut Vec<u8>) -> Result<(), Error> {
        let offset = u64::from(start) * size_of::<Vertex>() as u64;
        if let (Some(chunk), false) = (self.chunks.last_mut(), bytes.is_empty()) {
            chunk.vertices.write(gpu, offset, bytes)?;
        }
        bytes.clear();
        Ok(())
    }
}
