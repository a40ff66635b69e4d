//! What is drawn: color and depth of each pixel.

use super::bands::BAND_PX;
use super::screen::Screen;

/// What is shown, row by row of the rectangle.
#[derive(Debug)]
pub struct Picture<'a> {
    /// Red in the lowest byte, coverage in the highest: all or nothing.
    pub colors: &'a mut [u32],
    /// Reversed; 0 where nothing is.
    pub depths: &'a mut [f32],
}

impl Picture<'_> {
    /// The same, to be handed on.
    pub(super) fn again(&mut self) -> Picture<'_> {
        Picture {
            colors: self.colors,
            depths: self.depths,
        }
    }

    /// Bands of rows.
    pub(super) fn bands(self, screen: &Screen) -> impl ExactSizeIterator<Item = Self> {
        let pixels = screen.pixels();
        let band = (BAND_PX * screen.width()).max(1);
        let colors = self.colors[..pixels].chunks_mut(band);
        let bands = colors.zip(self.depths[..pixels].chunks_mut(band));
        bands.map(|(colors, depths)| Picture { colors, depths })
    }

    /// What the pixels show that show anything.
    pub(super) fn shown(&self) -> impl Iterator<Item = &u32> {
        let all = self.colors.iter().zip(&*self.depths);
        all.filter(|(_, depth)| **depth != 0.0)
            .map(|(color, _)| color)
    }
}
