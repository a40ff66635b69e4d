//! What the host drew of a frame's filtered splats, in mapped memory.

use crate::gpu::bind::Slice;
use crate::gpu::buffer::Upload;
use crate::gpu::{Error, Gpu};
use crate::render::cpu::filtered;
use crate::render::cpu::filtered::Canvas;
use crate::render::vulkan::draw_lists::records;
use std::sync::Arc;
use std::time::Instant;

/// The front and the sums, as compute leaves them, and which tiles have anything in them. Empty until something is drawn.
#[derive(Debug)]
pub(crate) struct Drawn {
    front: Upload,
    sums: Upload,
    /// Centers of tiles, two floats each.
    pub(crate) tiles: Upload,
    found: Vec<[f32; 2]>,
    bytes: [u64; 3],
    ms: f64,
}

impl Drawn {
    /// # Errors
    /// When memory runs out.
    pub(crate) fn new(gpu: &Arc<Gpu>, slot: usize) -> Result<Self, Error> {
        // Most devices never need them.
        let list = |name: &str| Upload::new(gpu, &format!("{name} of frame {slot}"), 4);
        Ok(Self {
            front: list("front")?,
            sums: list("sums")?,
            tiles: list("tiles")?,
            found: Vec::new(),
            bytes: [0; 3],
            ms: 0.0,
        })
    }

    /// Draws a list, whose splats are all small. Nothing may be reading what was there.
    ///
    /// # Errors
    /// When memory runs out.
    pub(crate) fn draw(
        &mut self,
        gpu: &Arc<Gpu>,
        list: filtered::List<'_>,
        canvas: Canvas,
    ) -> Result<(), Error> {
        let start = Instant::now();
        let (pixels, words) = (canvas.pixels(), canvas.pixels() * canvas.words());
        let front = records::<u32>(gpu, &mut self.front, pixels)?;
        let sums = records::<u64>(gpu, &mut self.sums, words)?;
        filtered::draw(list, canvas, front, sums, &mut self.found);
        let tiles = records::<[f32; 2]>(gpu, &mut self.tiles, self.found.len())?;
        tiles[..self.found.len()].copy_from_slice(&self.found);
        self.ms = start.elapsed().as_secs_f64() * 1e3;
        self.bytes = [4 * pixels, 8 * words, 8 * self.found.len()].map(|bytes| bytes as u64);
        Ok(())
    }

    /// Front and sums, as far as they were drawn.
    pub(crate) fn storage(&self) -> [Slice<'_>; 2] {
        [
            Slice::new(&self.front, 0, self.bytes[0]),
            Slice::new(&self.sums, 0, self.bytes[1]),
        ]
    }

    /// The buffers that they lie in.
    pub(crate) fn buffers(&self) -> [&Upload; 2] {
        [&self.front, &self.sums]
    }

    /// How many tiles there are.
    pub(crate) fn tile_count(&self) -> u32 {
        self.found.len() as u32
    }

    /// How long it took, milliseconds.
    pub(crate) fn ms(&self) -> f64 {
        self.ms
    }

    /// Bytes of all that was drawn.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes.iter().sum()
    }

    /// Makes it visible to the device.
    pub(crate) fn flush(&mut self) {
        let lists = [&mut self.front, &mut self.sums, &mut self.tiles];
        for (list, bytes) in lists.into_iter().zip(self.bytes) {
            list.flush(0..bytes);
        }
    }
}
