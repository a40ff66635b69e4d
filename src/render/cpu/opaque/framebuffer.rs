//! What is drawn: color and depth of each pixel.

use crate::render::cpu::opaque::bands::BAND_PX;
use crate::render::cpu::opaque::viewport::SplatScreen;

/// What is shown in the rectangle of a screen.
#[derive(Debug)]
pub struct ShownRectangle<'a> {
    /// Red in the lowest byte, coverage in the highest: all or nothing. From the first pixel of the rectangle on, perhaps in a
    /// larger picture.
    pub colors: &'a mut [u32],
    /// From a row of colors to the next, pixels.
    pub pitch: usize,
    /// Reversed; 0 where nothing is. Row by row.
    pub depths: &'a mut [f32],
    /// What is there stays where nothing nearer is drawn; else it is replaced.
    pub is_begun: bool,
}

impl ShownRectangle<'_> {
    /// The same, to be handed on.
    pub(super) fn again(&mut self) -> ShownRectangle<'_> {
        ShownRectangle {
            colors: self.colors,
            pitch: self.pitch,
            depths: self.depths,
            is_begun: self.is_begun,
        }
    }

    /// Bands of rows.
    pub(super) fn bands(self, screen: &SplatScreen) -> impl ExactSizeIterator<Item = Self> {
        let (pixels, width, pitch) = (screen.pixels(), screen.width(), self.pitch);
        let is_begun = self.is_begun;
        let behind = match pixels {
            0 => 0,
            _ => pixels / width * pitch - (pitch - width),
        };
        let chunk = |row: usize| (BAND_PX * row).max(1);
        let colors = self.colors[..behind].chunks_mut(chunk(pitch));
        let bands = colors.zip(self.depths[..pixels].chunks_mut(chunk(width)));
        bands.map(move |(colors, depths)| ShownRectangle {
            colors,
            pitch,
            depths,
            is_begun,
        })
    }

    /// Colors and depths of the rows of `width` pixels, at least one.
    pub(super) fn rows(&mut self, width: usize) -> impl Iterator<Item = (&mut [u32], &mut [f32])> {
        let colors = self.colors.chunks_mut(self.pitch);
        let colors = colors.map(move |row| &mut row[..width]);
        colors.zip(self.depths.chunks_mut(width))
    }

    /// What the pixels show that show anything.
    pub(super) fn shown(&self, width: usize) -> impl Iterator<Item = &u32> {
        let rows = self.colors.chunks(self.pitch);
        let rows = rows.zip(self.depths.chunks(width));
        let all = rows.flat_map(|(colors, depths)| colors.iter().zip(depths));
        all.filter(|(_, depth)| **depth != 0.0)
            .map(|(color, _)| color)
    }
}
