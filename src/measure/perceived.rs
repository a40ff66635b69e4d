//! Differences as people see them: FLIP and SSIM.
//!
//! FLIP: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild, *FLIP: A Difference Evaluator for Alternating
//! Images* (2020), by the authors' own code. SSIM: Wang, Bovik, Sheikh, Simoncelli, *Image Quality Assessment: From Error
//! Visibility to Structural Similarity* (2004), with their window: a Gaussian of 11 x 11 pixels and standard deviation
//! 1.5. It is written here because the crates at hand use another window, and a variance that is not divided by the
//! number of pixels.
//!
//! Both take the eight-bit values as they are shown: limited to 0..=1, NaN as 0, encoded as sRGB.

use crate::image::{Error, PixelSource, unorm8};
use rayon::prelude::*;
use std::ops::Range;

/// Rows that are worked on together; bounds the memory, and gives every thread something to do.
const BAND: usize = 256;

/// Bands of rows: what to keep, and that with `halo` rows more on either side, as far as there are any.
fn bands(height: usize, halo: usize) -> Vec<(Range<usize>, Range<usize>)> {
    (0..height)
        .step_by(BAND)
        .map(|start| {
            let end = (start + BAND).min(height);
            (
                start..end,
                start.saturating_sub(halo)..(end + halo).min(height),
            )
        })
        .collect()
}

fn same_size(reference: &impl PixelSource, other: &impl PixelSource) -> Result<[usize; 2], Error> {
    let (first, second) = (reference.size(), other.size());
    if first == second {
        Ok(first.map(|side| side as usize))
    } else {
        Err(Error::Size { first, second })
    }
}

/// The FLIP difference of two pictures.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FlipErrors {
    /// Mean over the picture, 0 (no visible difference) to 1; 0 of no pixels.
    pub mean: f64,
    /// The difference of each pixel, row by row from the top left, 0 to 1.
    pub map: Vec<f32>,
}

/// Pixels a degree of the viewer's eye that FLIP assumes where nobody says otherwise: 0.7 m before a screen 0.7 m and
/// 3840 pixels wide.
pub const PIXELS_PER_DEGREE: f32 = nv_flip::DEFAULT_PIXELS_PER_DEGREE;

/// Compares two pictures as a viewer would who sees `pixels_per_degree` pixels a degree and switches between them.
/// [`PIXELS_PER_DEGREE`] is usual; values outside of 1 to 1000 count as the nearest of them.
///
/// # Errors
/// [`Error::Size`] when the pictures differ in size.
pub fn flip(
    reference: &(impl PixelSource + Sync),
    other: &(impl PixelSource + Sync),
    pixels_per_degree: f32,
) -> Result<FlipErrors, Error> {
    let [width, height] = same_size(reference, other)?;
    if width == 0 || height == 0 {
        return Ok(FlipErrors::default());
    }
    let ppd = pixels_per_degree.clamp(1.0, 1000.0);
    // The filters reach 3 standard deviations of the widest Gaussian (blue to yellow), and the feature filter works on
    // what is filtered already: 0.15 and 0.13 degrees. Together less than a third of a degree.
    let halo = (ppd / 3.0).ceil() as usize + 2;
    let parts: Vec<Vec<f32>> = bands(height, halo)
        .into_par_iter()
        .map(|(keep, rows)| {
            let bytes = |picture: &dyn Fn(usize) -> [f64; 4]| -> Vec<u8> {
                (rows.start * width..rows.end * width)
                    .flat_map(|i| {
                        let [r, g, b, _] = picture(i).map(unorm8);
                        [r, g, b]
                    })
                    .collect()
            };
            let image = |bytes: Vec<u8>| {
                nv_flip::FlipImageRgb8::with_data(width as u32, rows.len() as u32, &bytes)
            };
            let (a, b) = (
                image(bytes(&|i| reference.value(i))),
                image(bytes(&|i| other.value(i))),
            );
            let map = nv_flip::flip(a, b, ppd).to_vec();
            let first = (keep.start - rows.start) * width;
            map[first..first + keep.len() * width].to_vec()
        })
        .collect();
    let map = parts.concat();
    let mean = map.iter().map(|v| f64::from(*v)).sum::<f64>() / map.len() as f64;
    Ok(FlipErrors { mean, map })
}

/// Half the window of SSIM, pixels.
const HALF: usize = 5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Weights of the window along one axis; they sum to 1.
fn window() -> [f64; 2 * HALF + 1] {
    let mut weights: [f64; 2 * HALF + 1] = std::array::from_fn(|k| {
        let d = k as f64 - HALF as f64;
        (-d * d / (2.0 * 1.5 * 1.5)).exp()
    });
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= sum);
    weights
}

/// Mean structural similarity of the luma (0.2126 R + 0.7152 G + 0.0722 B) of two pictures: 1 for equal ones, below 0
/// where one is the negative of the other. At the picture's border the window is cut and its weights are made to sum
/// to 1 again. 1 for pictures without pixels.
///
/// # Errors
/// [`Error::Size`] when the pictures differ in size.
pub fn ssim(
    reference: &(impl PixelSource + Sync),
    other: &(impl PixelSource + Sync),
) -> Result<f64, Error> {
    let [width, height] = same_size(reference, other)?;
    if width == 0 || height == 0 {
        return Ok(1.0);
    }
    let weights = window();
    let luma = |[r, g, b, _]: [f64; 4]| {
        // A comparison with NaN is false, so it ends up as 0.
        let shown = |v: f64| if v > 0.0 { v.min(1.0) } else { 0.0 };
        0.2126 * shown(r) + 0.7152 * shown(g) + 0.0722 * shown(b)
    };
    let sums: Vec<f64> = bands(height, HALF)
        .into_par_iter()
        .map(|(keep, rows)| {
            // Mean of a, b, a², b², ab over the window's columns.
            let mut across = vec![[0.0f64; 5]; rows.len() * width];
            for (y, line) in rows.clone().zip(across.chunks_mut(width)) {
                let values: Vec<[f64; 2]> = (y * width..(y + 1) * width)
                    .map(|i| [luma(reference.value(i)), luma(other.value(i))])
                    .collect();
                for (x, sum) in line.iter_mut().enumerate() {
                    *sum = weighted(&weights, x, 0..width, |n| {
                        let [a, b] = values[n];
                        [a, b, a * a, b * b, a * b]
                    });
                }
            }
            let mut total = 0.0;
            for y in keep {
                for x in 0..width {
                    let [a, b, aa, bb, ab] = weighted(&weights, y, rows.clone(), |n| {
                        across[(n - rows.start) * width + x]
                    });
                    let (va, vb, covariance) = (aa - a * a, bb - b * b, ab - a * b);
                    total += (2.0 * a * b + C1) * (2.0 * covariance + C2)
                        / ((a * a + b * b + C1) * (va + vb + C2));
                }
            }
            total
        })
        .collect();
    Ok(sums.iter().sum::<f64>() / (width * height) as f64)
}

/// Weighted mean of `at` over the window around `center`, cut to `allowed`.
fn weighted(
    weights: &[f64; 2 * HALF + 1],
    center: usize,
    allowed: Range<usize>,
    at: impl Fn(usize) -> [f64; 5],
) -> [f64; 5] {
    let first = center.saturating_sub(HALF).max(allowed.start);
    let last = (center + HALF + 1).min(allowed.end);
    let mut sum = [0.0; 5];
    let mut total = 0.0;
    for n in first..last {
        let weight = weights[n + HALF - center];
        total += weight;
        for (s, v) in sum.iter_mut().zip(at(n)) {
            *s += weight * v;
        }
    }
    sum.map(|s| s / total)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::image::{FloatImage, Image};

    fn gray(width: u32, height: u32, level: u8) -> Image {
        Image::filled(width, height, [level, level, level, 255])
    }

    fn pattern(height: u32) -> Image {
        let mut image = gray(40, height, 0);
        for (i, pixel) in image.color.iter_mut().enumerate() {
            let level = (i * i * 31 % 256) as u8;
            *pixel = [level, level / 2, 255 - level, 255];
        }
        image
    }

    #[test]
    fn equal_pictures_do_not_differ() {
        let image = pattern(30);
        assert!((ssim(&image, &image).unwrap() - 1.0).abs() < 1e-12);
        let d = flip(&image, &image, PIXELS_PER_DEGREE).unwrap();
        assert_eq!((d.mean, d.map.len()), (0.0, 1200));
        let nothing = gray(0, 0, 0);
        assert_eq!(ssim(&nothing, &nothing).unwrap(), 1.0);
        assert_eq!(flip(&nothing, &nothing, 67.0).unwrap().mean, 0.0);
        assert!(ssim(&image, &gray(30, 40, 0)).is_err());
        assert!(flip(&image, &gray(30, 40, 0), 67.0).is_err());
    }

    #[test]
    fn ssim_of_constants_and_of_a_negative_has_a_closed_form() {
        // Without variance only the means count.
        let (a, b) = (51.0 / 255.0, 204.0 / 255.0);
        let expected = (2.0 * a * b + 1e-4) / (a * a + b * b + 1e-4);
        let found = ssim(&gray(20, 300, 51), &gray(20, 300, 204)).unwrap();
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        // A checkerboard of single pixels against its negative: means of one half (up to the window's imbalance), variance
        // one quarter, covariance minus one quarter.
        let mut board = gray(64, 64, 0);
        for (i, pixel) in board.color.iter_mut().enumerate() {
            if (i + i / 64) % 2 == 0 {
                *pixel = [255; 4];
            }
        }
        let mut negative = board.clone();
        for pixel in &mut negative.color {
            *pixel = [255 - pixel[0], 255 - pixel[1], 255 - pixel[2], 255];
        }
        let found = ssim(&board, &negative).unwrap();
        let expected = (9e-4 - 0.5) / (9e-4 + 0.5);
        assert!((found - expected).abs() < 2e-2, "{found} {expected}");
        // What is not a number is black.
        let float = |value: f32| FloatImage {
            width: 1,
            height: 1,
            color: vec![[value, value, value, 1.0]],
            ..FloatImage::default()
        };
        assert_eq!(ssim(&float(f32::NAN), &float(0.0)).unwrap(), 1.0);
        assert!((ssim(&float(f32::INFINITY), &float(1.0)).unwrap() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn flip_tells_black_from_white_and_little_from_much() {
        let black_white = flip(&gray(32, 32, 0), &gray(32, 32, 255), PIXELS_PER_DEGREE).unwrap();
        // The definition makes the largest color difference close to 1.
        assert!(black_white.mean > 0.9, "{}", black_white.mean);
        let [little, much] = [101, 160].map(|level| {
            flip(&gray(32, 32, 100), &gray(32, 32, level), PIXELS_PER_DEGREE)
                .unwrap()
                .mean
        });
        assert!(0.0 < little && little < 0.05 && 0.2 < much && much < black_white.mean);
    }

    #[test]
    fn bands_leave_no_seam() {
        // Taller than two bands; the same picture in one piece by the crate itself.
        let (a, mut b) = (pattern(600), pattern(600));
        for pixel in b.color.iter_mut().skip(40 * 200).step_by(3) {
            pixel[0] = pixel[0].wrapping_add(90);
        }
        let whole = {
            let image = |i: &Image| {
                let bytes: Vec<u8> = i.color.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
                nv_flip::FlipImageRgb8::with_data(i.width, i.height, &bytes)
            };
            nv_flip::flip(image(&a), image(&b), PIXELS_PER_DEGREE).to_vec()
        };
        let banded = flip(&a, &b, PIXELS_PER_DEGREE).unwrap().map;
        let worst = whole
            .iter()
            .zip(&banded)
            .map(|(w, b)| (w - b).abs())
            .fold(0.0, f32::max);
        assert!(worst < 1e-6, "{worst}");
        assert!(banded.iter().any(|v| *v > 0.05));
    }
}
