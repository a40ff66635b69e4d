//! Pictures: eight-bit and float, with coverage and depth; PNG, EXR, npy; comparison.
//!
//! [`Image`] is what a method draws, one sample a pixel in the eight bits of the target, and where it is to be averaged
//! as floats besides ([`Image::values`]). [`FloatImage`] is what
//! averaging and files give. Both are [`PixelSource`]s, which is all that [`compare()`] asks for.

mod accumulate;
mod channels;
mod compare;
mod file;
mod legend;
mod lines;
mod marks;
mod read;
mod rulers;
mod sheet;

pub use accumulate::{
    EVEN_SAMPLES, PictureAccumulator, evenly, evenly_by_fours, jittered, mean_difference, shifted,
    stratified,
};
pub use channels::{
    ChannelComparison, ChannelDifference, PictureChannel, PictureChannels, compare_channels,
};
pub use compare::{ColorError, PictureDifference, compare, difference_picture};
pub(crate) use file::write;
pub use lines::MarkedLines;
pub use marks::{AXIS_COLORS, BarLength, MarkChoice, MarkLine, MarkText, PictureMarks};
pub use rulers::ruler_margins;
pub use sheet::contact_sheet;

use std::path::PathBuf;

/// Why a picture could not be written, read or compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file could not be written.
    #[error("cannot write {path}: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The file could not be read.
    #[error("cannot read {path}: {cause}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        cause: String,
    },
    /// Two pictures that belong together differ in size.
    #[error(
        "the pictures differ in size: {} x {} and {} x {} pixels",
        first[0], first[1], second[0], second[1]
    )]
    Size {
        /// Width and height of the first picture.
        first: [u32; 2],
        /// Width and height of the second picture.
        second: [u32; 2],
    },
    /// The picture does not hold what is to be written or averaged.
    #[error("the picture has no {what}")]
    Missing {
        /// "depth", "normals", "pixels".
        what: &'static str,
    },
}

/// A rendered picture, row 0 on top. Color is 8-bit RGBA as the target had it: `rgb` already blended with the
/// background, alpha is the covered fraction.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Row-major pixels.
    pub color: Vec<[u8; 4]>,
    /// View-space distance along the view direction at each pixel center, infinity where nothing is; empty
    /// unless asked for.
    pub depth: Vec<f32>,
    /// World-space unit normal at each pixel (zero where nothing is); empty unless asked for.
    pub normal: Vec<[f32; 3]>,
    /// Colors before they are rounded to [`Image::color`], 0..=1; empty unless asked for, and then [`PixelSource::value`] gives them.
    pub values: Vec<[f32; 4]>,
}

/// A picture in floats, row 0 on top: an average of several [`Image`]s, or a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FloatImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Row-major red, green, blue (1 is the white of the target; already blended with the background) and
    /// covered fraction.
    pub color: Vec<[f32; 4]>,
    /// As [`Image::depth`].
    pub depth: Vec<f32>,
    /// As [`Image::normal`].
    pub normal: Vec<[f32; 3]>,
}

/// Anything with a size and RGBA values where 1 is white and fully covered.
pub trait PixelSource {
    /// Width and height in pixels.
    fn size(&self) -> [u32; 2];
    /// Red, green, blue and covered fraction of pixel `index`, row by row from the top left.
    fn value(&self, index: usize) -> [f64; 4];
}

impl PixelSource for Image {
    fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    fn value(&self, index: usize) -> [f64; 4] {
        match self.values.get(index) {
            Some(values) => values.map(f64::from),
            None => self.color[index].map(|c| f64::from(c) / 255.0),
        }
    }
}

impl PixelSource for FloatImage {
    fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    fn value(&self, index: usize) -> [f64; 4] {
        self.color[index].map(f64::from)
    }
}

/// The byte of an eight-bit UNORM target for a value: floor(255 v + 0.5), with v limited to 0..=1; 0 for NaN.
pub fn unorm8(value: f64) -> u8 {
    // The cast saturates and takes NaN to 0.
    (value * 255.0 + 0.5).floor() as u8
}

impl Image {
    /// A picture of one color, covered nowhere unless `color[3]` says so; without depth and normals.
    pub fn filled(width: u32, height: u32, color: [u8; 4]) -> Self {
        Self {
            width,
            height,
            color: vec![color; width as usize * height as usize],
            ..Self::default()
        }
    }

    /// The same picture in floats: [`Image::values`], or where it has none 0..=1 for bytes.
    pub fn to_float(&self) -> FloatImage {
        let of_bytes = || {
            let value = |c: &[u8; 4]| c.map(|v| f32::from(v) / 255.0);
            self.color.iter().map(value).collect()
        };
        FloatImage {
            width: self.width,
            height: self.height,
            color: if self.values.is_empty() {
                of_bytes()
            } else {
                self.values.clone()
            },
            depth: self.depth.clone(),
            normal: self.normal.clone(),
        }
    }

    /// Number of pixels that are covered at all (alpha above 0).
    pub fn covered_pixels(&self) -> u64 {
        self.color.iter().filter(|c| c[3] > 0).count() as u64
    }

    /// The picture made smaller by a box filter: every pixel is the mean of `factor` x `factor` pixels (fewer
    /// at the right and bottom edge), color and coverage alike. Depth and normals are dropped, since their
    /// means belong to no surface. A factor of 0 counts as 1.
    pub fn downscaled(&self, factor: u32) -> Self {
        let factor = factor.max(1);
        let (width, height) = (self.width.div_ceil(factor), self.height.div_ceil(factor));
        let mut small = Self::filled(width, height, [0; 4]);
        for y in 0..height {
            for x in 0..width {
                let mut sum = [0u64; 4];
                let mut count = 0;
                for row in y * factor..((y + 1) * factor).min(self.height) {
                    for column in x * factor..((x + 1) * factor).min(self.width) {
                        let pixel =
                            self.color[row as usize * self.width as usize + column as usize];
                        for (s, v) in sum.iter_mut().zip(pixel) {
                            *s += u64::from(v);
                        }
                        count += 1;
                    }
                }
                small.color[y as usize * width as usize + x as usize] =
                    sum.map(|s| ((s + count / 2) / count) as u8);
            }
        }
        small
    }
}

impl FloatImage {
    /// The same picture in eight bits ([`unorm8`]).
    pub fn to_image(&self) -> Image {
        Image {
            width: self.width,
            height: self.height,
            color: self
                .color
                .iter()
                .map(|c| c.map(|v| unorm8(f64::from(v))))
                .collect(),
            depth: self.depth.clone(),
            normal: self.normal.clone(),
            values: Vec::new(),
        }
    }

    /// Derives coverage for a picture that was stored without: 0 where the color is exactly `background`, 1
    /// elsewhere. A surface of exactly that color is taken for background.
    pub fn cover_where_not(&mut self, background: [f32; 3]) {
        for [r, g, b, a] in &mut self.color {
            *a = if [*r, *g, *b] == background { 0.0 } else { 1.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_round_to_nearest_and_saturate() {
        assert_eq!(unorm8(0.8), 204);
        assert_eq!(unorm8(0.5), 128);
        assert_eq!(unorm8(1.0 / 510.0), 1);
        assert_eq!(unorm8(-3.0), 0);
        assert_eq!(unorm8(7.0), 255);
        assert_eq!(unorm8(f64::NAN), 0);
        for byte in 0..=255u8 {
            assert_eq!(unorm8(f64::from(byte) / 255.0), byte);
        }
    }

    #[test]
    fn downscaling_averages_boxes_and_keeps_partial_ones() {
        let mut image = Image::filled(3, 2, [10, 20, 30, 255]);
        image.color[0] = [30, 20, 30, 0];
        image.color[5] = [0, 0, 0, 255];
        let small = image.downscaled(2);
        assert_eq!((small.width, small.height), (2, 1));
        assert_eq!(small.color, vec![[15, 20, 30, 191], [5, 10, 15, 255]]);
        assert_eq!(image.downscaled(0).color, image.color);
    }
}
