//! The picture of `surfel render`, with what is drawn over it.

use std::path::{Path, PathBuf};
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

    /// Writes a PNG file, with alpha where `has_alpha`.
    pub(super) fn save_png(
        &self,
        path: &Path,
        has_alpha: bool,
    ) -> Result<(), surfel::image::Error> {
        match self {
            Self::Single(image) if has_alpha => image.save_transparent_png(path),
            Self::Mean(mean) if has_alpha => mean.save_transparent_png(path),
            Self::Single(image) => image.save_png(path),
            Self::Mean(mean) => mean.to_image().save_png(path),
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

/// `turn.png` of frame 7 is `turn-007.png` when there are several frames.
pub(super) fn numbered(path: &Path, frame: u32, frames: u32) -> PathBuf {
    if frames <= 1 {
        return path.to_owned();
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    // Wide enough for all of them, so that names sort like frames.
    let digits = (frames - 1).to_string().len().max(3);
    path.with_file_name(format!("{stem}-{frame:0digits$}.{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_numbered_only_when_there_are_several() {
        assert_eq!(
            numbered(Path::new("a/turn.png"), 7, 36),
            Path::new("a/turn-007.png")
        );
        assert_eq!(
            numbered(Path::new("turn.PNG"), 7, 2000),
            Path::new("turn-0007.PNG")
        );
        assert_eq!(numbered(Path::new("one.exr"), 0, 1), Path::new("one.exr"));
    }
}
