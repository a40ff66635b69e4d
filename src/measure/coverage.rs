//! Which pixels a picture covers, and where it has holes.

use crate::image::{Error, PixelSource};

/// The covered pixels of a picture: those of which at least half is covered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CoverageMask {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Row by row from the top left.
    pub is_covered: Vec<bool>,
}

impl CoverageMask {
    /// Of a picture's alpha.
    pub fn of(picture: &impl PixelSource) -> Self {
        let [width, height] = picture.size().map(|side| side as usize);
        Self {
            width,
            height,
            is_covered: (0..width * height)
                .map(|i| picture.value(i)[3] >= 0.5)
                .collect(),
        }
    }

    /// Number of covered pixels.
    pub fn count(&self) -> u64 {
        self.is_covered.iter().filter(|c| **c).count() as u64
    }

    /// The pixels left, right, above and below pixel `i`, as far as they are in the picture.
    pub(super) fn neighbors(&self, i: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, n) = (self.width, self.is_covered.len());
        let x = i % width.max(1);
        [
            (x > 0).then(|| i - 1),
            (x + 1 < width).then(|| i + 1),
            i.checked_sub(width),
            (i + width < n).then_some(i + width),
        ]
        .into_iter()
        .flatten()
    }
}

/// Two masks of one size.
///
/// # Errors
/// [`Error::Size`] when the pictures differ in size.
pub(super) fn masks(
    reference: &impl PixelSource,
    other: &impl PixelSource,
) -> Result<(CoverageMask, CoverageMask), Error> {
    let (first, second) = (reference.size(), other.size());
    if first != second {
        return Err(Error::Size { first, second });
    }
    Ok((CoverageMask::of(reference), CoverageMask::of(other)))
}

/// How the covered pixels of a picture differ from those of its reference.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct CoverageErrors {
    /// Covered pixels of the reference.
    pub covered: u64,
    /// Pixels covered in the reference only.
    pub missing: u64,
    /// Pixels covered in the other picture only.
    pub extra: u64,
    /// Holes: regions of missing pixels (connected by their sides) inside of the silhouette, that is without a pixel at
    /// whose side the reference has background. What lies beyond the picture is taken for covered. Stricter and wider
    /// than [`crate::image::PictureDifference::holes`], which looks at single pixels and also sees the inside of a missing
    /// edge.
    pub holes: u64,
    /// Pixels in holes.
    pub hole_pixels: u64,
    /// Pixels of the largest hole.
    pub largest_hole: u64,
}

/// Compares the covered pixels of `other` with those of `reference`. Linear in pixels.
///
/// # Errors
/// [`Error::Size`] when the pictures differ in size.
pub fn coverage(
    reference: &impl PixelSource,
    other: &impl PixelSource,
) -> Result<CoverageErrors, Error> {
    let (reference, other) = masks(reference, other)?;
    Ok(of_masks(&reference, &other))
}

fn of_masks(reference: &CoverageMask, other: &CoverageMask) -> CoverageErrors {
    let mut found = CoverageErrors {
        covered: reference.count(),
        ..CoverageErrors::default()
    };
    let mut is_missing: Vec<bool> = Vec::with_capacity(reference.is_covered.len());
    for (r, o) in reference.is_covered.iter().zip(&other.is_covered) {
        is_missing.push(*r && !*o);
        found.missing += u64::from(*r && !*o);
        found.extra += u64::from(!*r && *o);
    }
    let mut stack = Vec::new();
    for start in 0..is_missing.len() {
        if !std::mem::take(&mut is_missing[start]) {
            continue;
        }
        stack.push(start);
        let (mut pixels, mut is_inside) = (0, true);
        while let Some(i) = stack.pop() {
            pixels += 1;
            for n in reference.neighbors(i) {
                is_inside &= reference.is_covered[n];
                if std::mem::take(&mut is_missing[n]) {
                    stack.push(n);
                }
            }
        }
        if is_inside {
            found.holes += 1;
            found.hole_pixels += pixels;
            found.largest_hole = found.largest_hole.max(pixels);
        }
    }
    found
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::image::Image;

    /// A picture whose pixels are covered where `rows` have a `#`.
    pub(crate) fn drawn(rows: &[&str]) -> Image {
        let mut image = Image::filled(rows[0].len() as u32, rows.len() as u32, [0; 4]);
        for (pixel, mark) in image.color.iter_mut().zip(rows.concat().bytes()) {
            if mark == b'#' {
                *pixel = [9, 9, 9, 255];
            }
        }
        image
    }

    #[test]
    fn holes_are_regions_inside_of_the_silhouette() {
        let reference = drawn(&[
            "..........",
            ".########.",
            ".########.",
            ".########.",
            ".########.",
            "..........",
        ]);
        // A hole of two pixels, another that touches it at a corner only, and a notch from the outside.
        let other = drawn(&[
            "#.........",
            ".######.#.",
            ".#..###.#.",
            ".###.####.",
            ".########.",
            "..........",
        ]);
        assert_eq!(
            coverage(&reference, &other).unwrap(),
            CoverageErrors {
                covered: 32,
                missing: 5,
                extra: 1,
                holes: 2,
                hole_pixels: 3,
                largest_hole: 2,
            }
        );
        let same = coverage(&other, &other).unwrap();
        assert_eq!((same.missing, same.extra, same.holes), (0, 0, 0));
    }

    #[test]
    fn a_full_picture_has_holes_at_its_border_too() {
        let full = drawn(&["###", "###"]);
        let other = drawn(&[".##", "##."]);
        let found = coverage(&full, &other).unwrap();
        assert_eq!((found.holes, found.hole_pixels), (2, 2));
        let nothing = drawn(&["...", "..."]);
        let found = coverage(&full, &nothing).unwrap();
        assert_eq!((found.holes, found.largest_hole), (1, 6));
        assert!(matches!(
            coverage(&full, &drawn(&["##", "##", "##"])),
            Err(Error::Size { .. })
        ));
    }

    #[test]
    fn half_a_pixel_counts_as_covered() {
        let mut image = Image::filled(2, 1, [0, 0, 0, 127]);
        image.color[1][3] = 128;
        assert_eq!(CoverageMask::of(&image).is_covered, [false, true]);
    }
}
