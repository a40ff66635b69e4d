//! What the host drew of a frame's opaque splats, in mapped memory.

use crate::abi::{Splat, Vertex};
use crate::gpu::bind::Slice;
use crate::gpu::buffer::Upload;
use crate::gpu::image::Image;
use crate::gpu::{Error, Gpu};
use crate::render::cpu::filtered::Triangles;
use crate::render::cpu::opaque;
use crate::render::cpu::opaque::{Look, Picture, Places};
use crate::render::cpu::picture::{DrawnArea, PixelWords};
use crate::render::vulkan::draw_lists::records;
use std::sync::Arc;
use std::time::Instant;

/// Depth and color of each pixel, see [`Picture`]. Empty until something is drawn.
#[derive(Debug)]
pub(crate) struct Drawn {
    /// Colors of the pixels of the rectangle, unless they are in the image; then their depths.
    words: Upload,
    depths_at: usize,
    places: Places,
    pixels: usize,
    image: Option<Shown>,
    name: String,
    ms: f64,
}

/// A whole picture.
#[derive(Debug)]
struct Shown {
    image: Image,
    area: DrawnArea,
}

/// Where the colors go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Onto {
    /// To the storage of a pass that draws them beside others.
    Storage,
    /// To an image of this width and height, pixels, which becomes the picture of the frame, if the device lets the host write one.
    Image(u32, u32),
}

/// Triangles that are drawn before the splats, and the vertices of their model.
pub(crate) type Under<'a> = (&'a Triangles, &'a [Vertex]);

impl Drawn {
    /// # Errors
    /// When memory runs out.
    pub(crate) fn new(gpu: &Arc<Gpu>, slot: usize) -> Result<Self, Error> {
        // Most devices never need it.
        let name = format!("splats by the host of frame {slot}");
        Ok(Self {
            words: Upload::new(gpu, &name, 8)?,
            depths_at: 0,
            places: Places::default(),
            pixels: 0,
            image: None,
            name: format!("picture by the host of frame {slot}"),
            ms: 0.0,
        })
    }

    /// Draws splats, the last of which are samples. Nothing may be reading what was there. Whether the colors are in the image.
    ///
    /// # Errors
    /// When memory runs out.
    pub(crate) fn draw(
        &mut self,
        gpu: &Arc<Gpu>,
        splats: &[Splat],
        look: (Look, usize),
        under: Option<Under<'_>>,
        (frame, onto): (opaque::Frame<'_>, Onto),
    ) -> Result<bool, Error> {
        self.draw_by(gpu, under, (frame, onto), |places, picture| {
            opaque::draw(splats, look, frame, places, picture);
        })
    }

    /// Draws the splats of a cut and the samples after them: see [`opaque::draw_cut`]. Nothing may be reading what was there.
    /// Whether the colors are in the image.
    ///
    /// # Errors
    /// When memory runs out.
    pub(crate) fn draw_cut(
        &mut self,
        gpu: &Arc<Gpu>,
        (splats, samples): (opaque::Splats<'_>, &[Splat]),
        under: Option<Under<'_>>,
        (frame, onto): (opaque::Frame<'_>, Onto),
    ) -> Result<bool, Error> {
        self.draw_by(gpu, under, (frame, onto), |places, picture| {
            opaque::draw_cut(splats, samples, frame, places, picture);
        })
    }

    fn draw_by(
        &mut self,
        gpu: &Arc<Gpu>,
        under: Option<Under<'_>>,
        ((screen, light), onto): (opaque::Frame<'_>, Onto),
        draw: impl FnOnce(&mut Places, Picture<'_>),
    ) -> Result<bool, Error> {
        let start = Instant::now();
        self.pixels = screen.pixels();
        let is_shown = match onto {
            Onto::Image(width, height) => self.make_image(gpu, width, height)?,
            Onto::Storage => false,
        };
        self.depths_at = if is_shown { 0 } else { self.pixels };
        let words = self.depths_at + self.pixels;
        let words = records::<u32>(gpu, &mut self.words, words)?;
        let (colors, depths) = words.split_at_mut(self.depths_at);
        let depths = bytemuck::cast_slice_mut(depths);
        let (colors, pitch) = match self.image.as_mut().filter(|_| is_shown) {
            Some(shown) => shown.within(screen.rect_px(), light.background()),
            None => (colors, screen.width().max(1)),
        };
        let mut picture = Picture {
            colors,
            pitch,
            depths,
            is_begun: false,
        };
        if let Some((triangles, vertices)) = under {
            let picture = Picture {
                colors: picture.colors,
                pitch,
                depths: picture.depths,
                is_begun: false,
            };
            opaque::draw_triangles(triangles, vertices, screen, light.background(), picture);
        }
        picture.is_begun = under.is_some();
        draw(&mut self.places, picture);
        self.ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(is_shown)
    }

    /// Whether there is an image of this size.
    fn make_image(&mut self, gpu: &Arc<Gpu>, width: u32, height: u32) -> Result<bool, Error> {
        let is_there = |shown: &Shown| (shown.image.width, shown.image.height) == (width, height);
        if !self.image.as_ref().is_some_and(is_there) {
            let image = Image::mapped(gpu, &self.name, width, height)?;
            self.image = image.map(|image| Shown {
                image,
                area: DrawnArea::unknown(width, height),
            });
        }
        Ok(self.image.is_some())
    }

    /// Where the splats and the colors of the rectangle lie that are not in the image, colors first.
    pub(crate) fn storage(&self) -> Slice<'_> {
        Slice::new(&self.words, 0, 8 * self.pixels as u64)
    }

    /// The buffer of it.
    pub(crate) fn buffer(&self) -> &Upload {
        &self.words
    }

    /// The picture that the colors were drawn onto last.
    pub(crate) fn image(&self) -> Option<&Image> {
        self.image.as_ref().map(|shown| &shown.image)
    }

    /// The pixels of the picture, row by row, without gaps.
    pub(crate) fn pixels(&mut self) -> Vec<[u8; 4]> {
        let Some(Shown { image, .. }) = &mut self.image else {
            return Vec::new();
        };
        let width = image.width as usize;
        let (words, pitch) = image.words_mut();
        let rows = words.chunks(pitch.max(1));
        rows.flat_map(|row| row[..width].iter().map(|word| word.to_le_bytes()))
            .collect()
    }

    /// The reversed depths, row by row of the rectangle.
    pub(crate) fn depths(&mut self) -> &[f32] {
        let (first, pixels) = (self.depths_at, self.pixels);
        bytemuck::cast_slice(&self.words.bytes_mut()[4 * first..4 * (first + pixels)])
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
        self.words
            .flush(0..4 * (self.depths_at + self.pixels) as u64);
        if let (Some(shown), 0) = (&mut self.image, self.depths_at) {
            shown.image.flush();
        }
    }
}

impl Shown {
    /// The pixels from the first of a rectangle on, and from row to row; what lies beside it becomes background.
    fn within(&mut self, rect_px: [u32; 4], background: u32) -> (&mut [u32], usize) {
        let size = [self.image.width, self.image.height];
        let (words, pitch) = self.image.words_mut();
        let mut pixels = PixelWords { words, pitch };
        self.area.begin(&mut pixels, size, rect_px, background);
        let [left, top, ..] = rect_px.map(|v| v as usize);
        let first = (top * pitch + left).min(words.len());
        (&mut words[first..], pitch)
    }
}
