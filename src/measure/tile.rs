//! The place where two pictures differ most.

use crate::image::{Error, Image, PixelSource, unorm8};

/// A rectangle of a picture, and how much it differs.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct PictureTile {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Root of the mean squared difference of red, green and blue, values of 0..=1.
    pub rmse: f64,
}

/// The square of `side` pixels with the largest error, among those that begin at multiples of half a side (the last of
/// a row or column ends at the picture's border). Smaller where the picture is; the first of equals; values that are not
/// finite count as 0. A `side` of 0 counts as 1. Of pictures without pixels an empty tile.
///
/// # Errors
/// [`Error::Size`] when the pictures differ in size.
pub fn worst_tile(
    reference: &impl PixelSource,
    other: &impl PixelSource,
    side: u32,
) -> Result<PictureTile, Error> {
    let (first, second) = (reference.size(), other.size());
    if first != second {
        return Err(Error::Size { first, second });
    }
    let [width, height] = first;
    // Sums over rectangles from a table of sums from the top left (Crow, 1984).
    let stride = width as usize + 1;
    let mut table = vec![0.0f64; stride * (height as usize + 1)];
    for y in 0..height as usize {
        let mut row = 0.0;
        for x in 0..width as usize {
            let i = y * width as usize + x;
            let (a, b) = (reference.value(i), other.value(i));
            for c in 0..3 {
                let d = finite(a[c]) - finite(b[c]);
                row += d * d;
            }
            table[(y + 1) * stride + x + 1] = table[y * stride + x + 1] + row;
        }
    }
    let side = side.max(1);
    let (w, h) = (side.min(width), side.min(height));
    let mut worst = PictureTile {
        width: w,
        height: h,
        rmse: -1.0,
        ..PictureTile::default()
    };
    for y in starts(height, h) {
        for x in starts(width, w) {
            let at = |x: u32, y: u32| table[y as usize * stride + x as usize];
            let sum = at(x + w, y + h) - at(x, y + h) - at(x + w, y) + at(x, y);
            // Rounding of the table may leave a little below zero.
            let rmse = (sum.max(0.0) / (3.0 * f64::from(w) * f64::from(h))).sqrt();
            if rmse > worst.rmse {
                worst = PictureTile {
                    x,
                    y,
                    rmse,
                    ..worst
                };
            }
        }
    }
    worst.rmse = worst.rmse.max(0.0);
    Ok(worst)
}

fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

/// Where tiles of length `side` begin along a length.
fn starts(length: u32, side: u32) -> Vec<u32> {
    if side == 0 {
        return Vec::new();
    }
    let last = length - side;
    let mut starts: Vec<u32> = (0..=last).step_by((side as usize / 2).max(1)).collect();
    if starts.last() != Some(&last) {
        starts.push(last);
    }
    starts
}

/// The part of a picture under a tile, every pixel as a square of `enlarge` x `enlarge` (0 counts as 1), in eight bits.
/// What lies beyond the picture is left out.
pub fn crop(picture: &impl PixelSource, tile: &PictureTile, enlarge: u32) -> Image {
    let [width, height] = picture.size();
    let columns = tile.x.min(width)..(tile.x.saturating_add(tile.width)).min(width);
    let rows = tile.y.min(height)..(tile.y.saturating_add(tile.height)).min(height);
    let enlarge = enlarge.max(1);
    let mut image = Image::filled(
        columns.len() as u32 * enlarge,
        rows.len() as u32 * enlarge,
        [0; 4],
    );
    let out_width = image.width as usize;
    for (i, pixel) in image.color.iter_mut().enumerate() {
        let x = columns.start as usize + i % out_width / enlarge as usize;
        let y = rows.start as usize + i / out_width / enlarge as usize;
        *pixel = picture.value(y * width as usize + x).map(unorm8);
    }
    image
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    #[test]
    fn the_worst_tile_is_where_the_difference_is() {
        let reference = Image::filled(100, 70, [10, 10, 10, 255]);
        let mut other = reference.clone();
        // Half a tile of 51 levels in the last rows and columns, a lone pixel elsewhere.
        for y in 60..70 {
            for x in 92..100 {
                other.color[y * 100 + x] = [61, 61, 61, 255];
            }
        }
        other.color[5 * 100 + 5] = [255, 10, 10, 255];
        let tile = worst_tile(&reference, &other, 16).unwrap();
        assert_eq!((tile.x, tile.y, tile.width, tile.height), (84, 54, 16, 16));
        let expected = (80.0f64 / 256.0).sqrt() * 0.2;
        assert!((tile.rmse - expected).abs() < 1e-9, "{tile:?}");

        let part = crop(&other, &tile, 2);
        assert_eq!((part.width, part.height), (32, 32));
        assert_eq!(part.color[0], [10, 10, 10, 255]);
        assert_eq!(part.color[32 * 32 - 1], [61, 61, 61, 255]);
        // Column 8, row 6 of the tile is the first that differs; enlarged twice.
        assert_eq!(part.color[12 * 32 + 16], [61, 61, 61, 255]);
        assert_eq!(part.color[12 * 32 + 15], [10, 10, 10, 255]);
    }

    #[test]
    fn small_and_equal_pictures_have_a_tile() {
        let small = Image::filled(5, 3, [0; 4]);
        let tile = worst_tile(&small, &small, 32).unwrap();
        assert_eq!((tile.x, tile.y, tile.width, tile.height), (0, 0, 5, 3));
        assert_eq!(tile.rmse, 0.0);
        let nothing = Image::filled(0, 0, [0; 4]);
        assert_eq!(
            worst_tile(&nothing, &nothing, 8).unwrap(),
            PictureTile::default()
        );
        assert!(worst_tile(&small, &nothing, 8).is_err());
        assert_eq!(
            crop(
                &small,
                &PictureTile {
                    x: 4,
                    y: 9,
                    width: 9,
                    height: 9,
                    rmse: 0.0
                },
                0
            )
            .width,
            1
        );
    }
}
