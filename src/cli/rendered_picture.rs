//! The picture of `surfel render`, with what is drawn over it.

use surfel::image::{FloatImage, Image, MarkedLines, PictureMarks};

/// A picture that is written: of one sample a pixel, or the mean of several.
pub(super) enum RenderedPicture {
    Single(Image),
    Mean(FloatImage),
}

impl RenderedPicture {
    /// The bytes of a PNG file, with alpha where `has_alpha`.
    pub(super) fn png(&self, has_alpha: bool) -> Result<Vec<u8>, surfel::image::Error> {
        match self {
            Self::Single(image) if has_alpha => image.to_float().transparent_png(),
            Self::Mean(mean) if has_alpha => mean.transparent_png(),
            Self::Single(image) => image.png(),
            Self::Mean(mean) => mean.to_image().png(),
        }
    }

    /// Draws measured lines over it. Depth, normals and coverage stay as they are.
    pub(super) fn mark_lines(&mut self, marks: &MarkedLines) {
        match self {
            Self::Single(image) => image.mark(marks),
            Self::Mean(mean) => mean.mark(marks),
        }
    }

    /// Draws a scale bar and axes over it. Depth, normals and coverage stay as they are.
    pub(super) fn mark(&mut self, marks: &PictureMarks) {
        match self {
            Self::Single(image) => marks.draw_over_bytes(image),
            Self::Mean(mean) => marks.draw_over(mean),
        }
    }
}
