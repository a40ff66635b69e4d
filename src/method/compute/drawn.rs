//! What the host drew of a frame's opaque splats, in mapped memory.

use crate::abi::Splat;
use crate::draw::opaque::{self, Look, Picture, Places, Screen};
use crate::gpu::bind::Slice;
use crate::gpu::buffer::Upload;
use crate::gpu::{Error, Gpu};
use crate::method::lists::records;
use std::sync::Arc;
use std::time::Instant;

/// Depth and color of each pixel, see [`Picture`]. Empty until something is drawn.
#[derive(Debug)]
pub(crate) struct Drawn {
    words: Upload,
    places: Places,
    pixels: usize,
    ms: f64,
}

impl Drawn {
    /// # Errors
    /// When memory runs out.
    pub(crate) fn new(gpu: &Arc<Gpu>, slot: usize) -> Result<Self, Error> {
        // Most devices never need it.
        let name = format!("splats by the host of frame {slot}");
        Ok(Self {
            words: Upload::new(gpu, &name, 8)?,
            places: Places::default(),
            pixels: 0,
            ms: 0.0,
        })
    }

    /// Draws splats, the last of which are samples. Nothing may be reading what was there.
    ///
    /// # Errors
    /// When memory runs out.
    pub(crate) fn draw(
        &mut self,
        gpu: &Arc<Gpu>,
        splats: &[Splat],
        look: (Look, usize),
        frame: opaque::Frame<'_>,
    ) -> Result<(), Error> {
        self.draw_by(gpu, frame.0, |places, picture| {
            opaque::draw(splats, look, frame, places, picture);
        })
    }

    /// Draws the splats of a cut and the samples after them: see [`opaque::draw_cut`]. Nothing may be reading what was there.
    ///
    /// # Errors
    /// When memory runs out.
    pub(crate) fn draw_cut(
        &mut self,
        gpu: &Arc<Gpu>,
        (splats, samples): (opaque::Splats<'_>, &[Splat]),
        frame: opaque::Frame<'_>,
    ) -> Result<(), Error> {
        self.draw_by(gpu, frame.0, |places, picture| {
            opaque::draw_cut(splats, samples, frame, places, picture);
        })
    }

    fn draw_by(
        &mut self,
        gpu: &Arc<Gpu>,
        screen: &Screen,
        draw: impl FnOnce(&mut Places, Picture<'_>),
    ) -> Result<(), Error> {
        let start = Instant::now();
        self.pixels = screen.pixels();
        let words = records::<u32>(gpu, &mut self.words, 2 * self.pixels)?;
        let (colors, depths) = words.split_at_mut(self.pixels);
        let depths = bytemuck::cast_slice_mut(depths);
        draw(&mut self.places, Picture { colors, depths });
        self.ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }

    /// Colors of the pixels of the rectangle, then their depths.
    pub(crate) fn storage(&self) -> Slice<'_> {
        Slice::new(&self.words, 0, self.bytes())
    }

    /// The buffer that they lie in, and where the depths begin, bytes.
    pub(crate) fn buffer(&self) -> (&Upload, u64) {
        (&self.words, self.bytes() / 2)
    }

    /// The reversed depths, row by row of the rectangle.
    #[cfg(feature = "viewer")]
    pub(crate) fn depths(&mut self) -> &[f32] {
        let bytes = self.bytes() as usize;
        bytemuck::cast_slice(&self.words.bytes_mut()[bytes / 2..bytes])
    }

    /// How long it took, milliseconds.
    pub(crate) fn ms(&self) -> f64 {
        self.ms
    }

    /// Bytes of all that was drawn.
    pub(crate) fn bytes(&self) -> u64 {
        8 * self.pixels as u64
    }

    /// Makes it visible to the device.
    pub(crate) fn flush(&mut self) {
        self.words.flush(0..self.bytes());
    }
}
