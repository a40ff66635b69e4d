//! Differences between two pictures, over everything and over the object alone.
//!
//! With a and b the values (0..=1) of the n pixels looked at, and d = b - a for each of red, green and blue:
//!
//! * `rmse` = sqrt(sum of d² / 3n)
//! * `psnr_db` = -20 log10(rmse), infinite for equal pictures
//! * `mean_abs` = sum of |d| / 3n
//! * `max_level` = 255 max |d|
//! * `past_level` = pixels whose largest 255 |d| is above the level asked for
//!
//! Values that are not finite differ by 0 from the same value and infinitely from any other.

use super::{Error, Image, PixelSource, unorm8};

/// Color error over a set of pixels. Formulas are in the text of the source file.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ColorError {
    /// Pixels looked at.
    pub pixels: u64,
    /// Root of the mean squared difference, values of 0..=1; 0 when no pixel was looked at.
    pub rmse: f64,
    /// Peak signal to noise ratio in decibels; infinity for equal pictures.
    pub psnr_db: f64,
    /// Largest difference of a channel, in levels of 255.
    pub max_level: f64,
    /// Mean absolute difference, values of 0..=1.
    pub mean_abs: f64,
    /// Pixels in which a channel differs by more than [`PictureDifference::level`] levels.
    pub past_level: u64,
}

/// How a picture differs from its reference.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct PictureDifference {
    /// Color error over all pixels.
    pub whole: ColorError,
    /// Color error over object pixels: those covered at all (fraction above 0) in either picture.
    pub object: ColorError,
    /// The level that [`ColorError::past_level`] counts against.
    pub level: f64,
    /// Pixels at least half covered in the reference and less than half in the other.
    pub missing: u64,
    /// Pixels less than half covered in the reference and at least half in the other.
    pub extra: u64,
    /// Missing pixels whose eight neighbors are all at least half covered in the reference: gaps inside the
    /// silhouette, which no shift of an edge by one pixel explains. Pixels at the picture's border have fewer
    /// neighbors.
    pub hole_pixels: u64,
    /// Connected groups (eight neighbors) of hole pixels.
    pub holes: u64,
    /// Half-covered pixels in both over those in either: 1 for equal silhouettes, also when both are empty.
    pub silhouette_iou: f64,
    /// Sum of the absolute differences of the covered fractions, in pixels.
    pub coverage_abs: f64,
}

impl PictureDifference {
    /// Tells whether colors and coverage are exactly equal.
    pub fn is_zero(&self) -> bool {
        self.whole.max_level == 0.0 && self.coverage_abs == 0.0
    }
}

/// A difference of eight-bit values is a whole level up to this rounding.
const LEVEL_SLACK: f64 = 1e-4;

/// Difference of two values, see the top of the file for what is not finite.
fn difference(a: f64, b: f64) -> f64 {
    if a == b || (a.is_nan() && b.is_nan()) {
        0.0
    } else {
        let d = b - a;
        if d.is_nan() { f64::INFINITY } else { d }
    }
}

/// Compares `other` with `reference`; `level` is in levels of 255 ([`ColorError::past_level`]).
///
/// # Errors
/// [`Error::Size`] when the pictures differ in size.
pub fn compare(
    reference: &impl PixelSource,
    other: &impl PixelSource,
    level: f64,
) -> Result<PictureDifference, Error> {
    let [width, height] = same_size(reference, other)?;
    let pixels = width as usize * height as usize;
    let mut whole = PixelSums::default();
    let mut object = PixelSums::default();
    let (mut missing, mut extra, mut both) = (0, 0, 0);
    let mut coverage_abs = 0.0;
    let mut is_inside = vec![false; pixels];
    let mut is_missing = vec![false; pixels];
    for i in 0..pixels {
        let (a, b) = (reference.value(i), other.value(i));
        let d = [0, 1, 2].map(|c| difference(a[c], b[c]));
        whole.add(d, level);
        if a[3] > 0.0 || b[3] > 0.0 {
            object.add(d, level);
        }
        coverage_abs += difference(a[3], b[3]).abs();
        let (in_reference, in_other) = (a[3] >= 0.5, b[3] >= 0.5);
        missing += u64::from(in_reference && !in_other);
        extra += u64::from(!in_reference && in_other);
        both += u64::from(in_reference && in_other);
        is_inside[i] = in_reference;
        is_missing[i] = in_reference && !in_other;
    }
    let grid = TileGrid { width, height };
    let mut is_hole: Vec<bool> = (0..pixels)
        .map(|i| is_missing[i] && grid.neighbors(i).all(|n| is_inside[n]))
        .collect();
    let hole_pixels = is_hole.iter().filter(|h| **h).count() as u64;
    let either = both + missing + extra;
    Ok(PictureDifference {
        whole: whole.figures(),
        object: object.figures(),
        level,
        missing,
        extra,
        hole_pixels,
        holes: grid.count_groups(&mut is_hole),
        silhouette_iou: if either == 0 {
            1.0
        } else {
            both as f64 / either as f64
        },
        coverage_abs,
    })
}

/// The absolute difference of red, green and blue times `gain`, as a picture; covered where either is.
///
/// # Errors
/// [`Error::Size`] when the pictures differ in size.
pub fn difference_picture(
    reference: &impl PixelSource,
    other: &impl PixelSource,
    gain: f64,
) -> Result<Image, Error> {
    let [width, height] = same_size(reference, other)?;
    let mut image = Image::filled(width, height, [0; 4]);
    for (i, pixel) in image.color.iter_mut().enumerate() {
        let (a, b) = (reference.value(i), other.value(i));
        let [r, g, b_] = [0, 1, 2].map(|c| unorm8(gain * difference(a[c], b[c]).abs()));
        *pixel = [r, g, b_, unorm8(a[3].max(b[3]))];
    }
    Ok(image)
}

fn same_size(first: &impl PixelSource, second: &impl PixelSource) -> Result<[u32; 2], Error> {
    let (first, second) = (first.size(), second.size());
    if first == second {
        Ok(first)
    } else {
        Err(Error::Size { first, second })
    }
}

#[derive(Default)]
struct PixelSums {
    pixels: u64,
    squares: f64,
    absolute: f64,
    largest: f64,
    past_level: u64,
}

impl PixelSums {
    fn add(&mut self, d: [f64; 3], level: f64) {
        self.pixels += 1;
        let mut largest: f64 = 0.0;
        for d in d {
            self.squares += d * d;
            self.absolute += d.abs();
            largest = largest.max(d.abs());
        }
        self.largest = self.largest.max(largest);
        self.past_level += u64::from(255.0 * largest > level + LEVEL_SLACK);
    }

    fn figures(&self) -> ColorError {
        let n = 3.0 * self.pixels.max(1) as f64;
        let rmse = (self.squares / n).sqrt();
        ColorError {
            pixels: self.pixels,
            rmse,
            psnr_db: -20.0 * rmse.log10(),
            max_level: 255.0 * self.largest,
            mean_abs: self.absolute / n,
            past_level: self.past_level,
        }
    }
}

struct TileGrid {
    width: u32,
    height: u32,
}

impl TileGrid {
    /// The up to eight pixels around pixel `i`.
    fn neighbors(&self, i: usize) -> impl Iterator<Item = usize> + use<> {
        let (w, h) = (self.width as usize, self.height as usize);
        let (x, y) = (i % w, i / w);
        (y.saturating_sub(1)..(y + 2).min(h))
            .flat_map(move |ny| (x.saturating_sub(1)..(x + 2).min(w)).map(move |nx| ny * w + nx))
            .filter(move |n| *n != i)
    }

    /// Counts connected groups of set pixels, and clears them.
    fn count_groups(&self, set: &mut [bool]) -> u64 {
        let mut groups = 0;
        let mut stack = Vec::new();
        for start in 0..set.len() {
            if !set[start] {
                continue;
            }
            groups += 1;
            set[start] = false;
            stack.push(start);
            while let Some(i) = stack.pop() {
                for n in self.neighbors(i) {
                    if std::mem::take(&mut set[n]) {
                        stack.push(n);
                    }
                }
            }
        }
        groups
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::image::FloatImage;

    /// A covered 6 x 5 block in a 10 x 8 picture.
    fn block() -> Image {
        let mut image = Image::filled(10, 8, [0, 0, 0, 0]);
        for y in 1..6 {
            for x in 2..8 {
                image.color[y * 10 + x] = [100, 100, 100, 255];
            }
        }
        image
    }

    #[test]
    fn equal_pictures_differ_by_nothing() {
        let d = compare(&block(), &block().to_float(), 0.0).unwrap();
        // f32 holds n/255 to 6e-8.
        assert!(d.whole.max_level < 1e-4 && d.whole.past_level == 0, "{d:?}");
        let d = compare(&block(), &block(), 0.0).unwrap();
        assert!(d.is_zero());
        assert_eq!((d.whole.pixels, d.object.pixels), (80, 30));
        assert_eq!(d.whole.psnr_db, f64::INFINITY);
        assert_eq!(
            (d.missing, d.extra, d.holes, d.silhouette_iou),
            (0, 0, 0, 1.0)
        );
    }

    #[test]
    fn one_changed_pixel_is_seen_in_every_figure() {
        let mut other = block();
        other.color[3 * 10 + 4] = [151, 100, 49, 255];
        let d = compare(&block(), &other, 50.0).unwrap();
        assert!(!d.is_zero());
        assert!((d.whole.max_level - 51.0).abs() < 1e-9);
        assert_eq!(d.whole.past_level, 1);
        assert_eq!(compare(&block(), &other, 51.0).unwrap().whole.past_level, 0);
        let squares = 2.0 * (51.0f64 / 255.0).powi(2);
        assert!((d.whole.rmse - (squares / 240.0).sqrt()).abs() < 1e-12);
        assert!((d.object.rmse - (squares / 90.0).sqrt()).abs() < 1e-12);
        assert!((d.object.mean_abs - 0.4 / 90.0).abs() < 1e-12);
        assert!((d.whole.psnr_db - 10.0 * (240.0 / squares).log10()).abs() < 1e-9);
    }

    #[test]
    fn coverage_differences_tell_edges_from_holes() {
        let mut other = block();
        // Two touching holes inside, one further away, one missing pixel on the edge, one extra outside.
        for i in [2 * 10 + 3, 3 * 10 + 4, 4 * 10 + 6, 10 + 2] {
            other.color[i] = [0; 4];
        }
        other.color[79] = [9, 9, 9, 255];
        let d = compare(&block(), &other, 0.0).unwrap();
        assert_eq!((d.missing, d.extra, d.hole_pixels, d.holes), (4, 1, 3, 2));
        assert_eq!(d.object.pixels, 31);
        assert_eq!(d.coverage_abs, 5.0);
        assert!((d.silhouette_iou - 26.0 / 31.0).abs() < 1e-12);
        let picture = difference_picture(&block(), &other, 2.0).unwrap();
        assert_eq!(picture.color[23], [200, 200, 200, 255]);
        assert_eq!(picture.color[24], [0, 0, 0, 255]);
    }

    #[test]
    fn sizes_must_agree_and_nan_is_never_equal_to_a_number() {
        assert!(matches!(
            compare(&block(), &Image::filled(8, 10, [0; 4]), 0.0),
            Err(Error::Size {
                first: [10, 8],
                second: [8, 10]
            })
        ));
        let good = FloatImage {
            width: 1,
            height: 1,
            color: vec![[0.5, 0.5, 0.5, 1.0]],
            ..FloatImage::default()
        };
        let mut bad = good.clone();
        bad.color[0][1] = f32::NAN;
        let d = compare(&good, &bad, 1.0).unwrap();
        assert_eq!((d.whole.max_level, d.whole.past_level), (f64::INFINITY, 1));
        assert!(compare(&bad, &bad, 1.0).unwrap().is_zero());
    }
}
