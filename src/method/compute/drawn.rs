//! What the host drew of a frame's opaque splats, in mapped memory.

use crate::abi::Splat;
use crate::cut::{Cut, Undrawn};
use crate::draw::opaque::{self, Look, Places, Screen};
use crate::draw::splats::Plan;
use crate::gpu::bind::Slice;
use crate::gpu::buffer::Upload;
use crate::gpu::{Error, Gpu};
use crate::math::camera::View;
use crate::method::lists::records;
use crate::tree::Model;
use std::sync::Arc;
use std::time::Instant;

/// The nearest of each pixel, as compute leaves it. Empty until something is drawn.
#[derive(Debug)]
pub(crate) struct Drawn {
    keys: Upload,
    places: Places,
    bytes: u64,
    ms: f64,
}

impl Drawn {
    /// # Errors
    /// When memory runs out.
    pub(crate) fn new(gpu: &Arc<Gpu>, slot: usize) -> Result<Self, Error> {
        // Most devices never need it.
        let name = format!("nearest small splats of frame {slot}");
        Ok(Self {
            keys: Upload::new(gpu, &name, 8)?,
            places: Places::default(),
            bytes: 0,
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
        screen: &Screen,
    ) -> Result<(), Error> {
        let start = Instant::now();
        let pixels = screen.pixels();
        let keys = records::<u64>(gpu, &mut self.keys, pixels)?;
        opaque::draw(splats, look, screen, &mut self.places, keys);
        self.bytes = 8 * pixels as u64;
        self.ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }

    /// Draws the splats of a cut and the samples after them, and writes the records of what is seen: see
    /// [`opaque::draw_cut`]. Nothing may be reading what was there.
    ///
    /// # Errors
    /// When memory runs out.
    pub(crate) fn draw_cut(
        &mut self,
        gpu: &Arc<Gpu>,
        (model, undrawn): (&Model, &Undrawn),
        (cut, view, plan): (&Cut, &View, &Plan),
        (screen, are_discs): (&Screen, bool),
        out: &mut [Splat],
    ) -> Result<(), Error> {
        let start = Instant::now();
        let pixels = screen.pixels();
        let keys = records::<u64>(gpu, &mut self.keys, pixels)?;
        opaque::draw_cut(
            (model, undrawn),
            (cut, view, plan),
            (screen, are_discs),
            (&mut self.places, keys),
            out,
        );
        self.bytes = 8 * pixels as u64;
        self.ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }

    /// The nearest of each pixel of the rectangle.
    pub(crate) fn storage(&self) -> Slice<'_> {
        Slice::new(&self.keys, 0, self.bytes)
    }

    /// The buffer that it lies in.
    pub(crate) fn buffer(&self) -> &Upload {
        &self.keys
    }

    /// How long it took, milliseconds.
    pub(crate) fn ms(&self) -> f64 {
        self.ms
    }

    /// Bytes of all that was drawn.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Makes it visible to the device.
    pub(crate) fn flush(&mut self) {
        self.keys.flush(0..self.bytes);
    }
}
