//! How far one picture is from the reference: every measure at once.

use crate::image::{Error, FloatImage, Image, PixelSource, compare};
use crate::math::camera::View;
use crate::measure::{
    CoverageErrors, PIXELS_PER_DEGREE, PictureTile, SampleSpread, coverage, depth_error, flip,
    normal_error, silhouette, ssim, worst_tile,
};

/// Side of the worst tile, pixels.
pub const TILE_PX: u32 = 32;

/// What a picture is compared with.
#[derive(Debug, Clone, Default)]
pub struct ReferencePicture {
    /// The supersampled color, and the depth at the pixel centers.
    pub picture: FloatImage,
    /// Normals at the pixel centers; empty where there are none.
    pub normal: Vec<[f32; 3]>,
}

/// The errors of one picture. Coverage and silhouette count a pixel as covered from one half.
#[derive(Debug, Clone, PartialEq)]
pub struct PictureErrors {
    /// Mean FLIP over the picture.
    pub flip: f64,
    /// Mean FLIP over object pixels: covered at all in either picture. 0 where there are none.
    pub flip_object: f64,
    /// PSNR over the picture, decibels.
    pub psnr_db: f64,
    /// PSNR over object pixels, decibels.
    pub psnr_object_db: f64,
    /// Structural similarity.
    pub ssim: f64,
    /// How many object pixels there are.
    pub object_pixels: u64,
    /// Missing and extra pixels, holes.
    pub coverage: CoverageErrors,
    /// Distance between the outlines, pixels.
    pub silhouette: SampleSpread,
    /// Depth error in footprints of a pixel.
    pub depth: SampleSpread,
    /// Angle between normals, degrees.
    pub normal: Option<SampleSpread>,
    /// Where the picture is worst.
    pub worst: PictureTile,
}

/// Columns and rows that hold every pixel that is covered in either picture, `margin` pixels wider on each side, within
/// the picture; `None` when nothing is covered.
pub fn object_box(a: &impl PixelSource, b: &impl PixelSource, margin: u32) -> Option<PictureTile> {
    let [width, height] = a.size();
    let (mut left, mut right, mut top, mut bottom) = (u32::MAX, 0, u32::MAX, 0);
    for y in 0..height {
        for x in 0..width {
            let i = y as usize * width as usize + x as usize;
            if a.value(i)[3] > 0.0 || b.value(i)[3] > 0.0 {
                (left, right) = (left.min(x), right.max(x));
                (top, bottom) = (top.min(y), bottom.max(y));
            }
        }
    }
    if left > right {
        return None;
    }
    let (x, y) = (left.saturating_sub(margin), top.saturating_sub(margin));
    Some(PictureTile {
        x,
        y,
        width: (right + 1).saturating_add(margin).min(width) - x,
        height: (bottom + 1).saturating_add(margin).min(height) - y,
        rmse: 0.0,
    })
}

/// The part of a picture under a tile, in floats.
fn part(picture: &impl PixelSource, tile: &PictureTile) -> FloatImage {
    let width = picture.size()[0] as usize;
    let mut color = Vec::with_capacity(tile.width as usize * tile.height as usize);
    for y in tile.y..tile.y + tile.height {
        for x in tile.x..tile.x + tile.width {
            color.push(
                picture
                    .value(y as usize * width + x as usize)
                    .map(|v| v as f32),
            );
        }
    }
    FloatImage {
        width: tile.width,
        height: tile.height,
        color,
        ..FloatImage::default()
    }
}

/// Mean FLIP over the picture and over object pixels. The background is the same in both, so only what lies around the
/// object is looked at: farther out than its filters reach, FLIP is 0.
pub(crate) fn object_flip(
    reference: &(impl PixelSource + Sync),
    picture: &(impl PixelSource + Sync),
) -> Result<[f64; 2], Error> {
    // As in `measure::flip`: its filters reach less than a third of a degree, and two pixels for their rounding.
    let margin = (PIXELS_PER_DEGREE / 3.0).ceil() as u32 + 2;
    let Some(tile) = object_box(reference, picture, margin) else {
        return Ok([0.0; 2]);
    };
    let (a, b) = (part(reference, &tile), part(picture, &tile));
    let map = flip(&a, &b, PIXELS_PER_DEGREE)?.map;
    let (mut all, mut object, mut pixels) = (0.0, 0.0, 0u64);
    for (i, value) in map.iter().enumerate() {
        all += f64::from(*value);
        if a.color[i][3] > 0.0 || b.color[i][3] > 0.0 {
            object += f64::from(*value);
            pixels += 1;
        }
    }
    let [width, height] = reference.size().map(f64::from);
    Ok([all / (width * height), object / pixels.max(1) as f64])
}

impl PictureErrors {
    /// Of `picture` against the reference. `normal` are those of the picture, where it has any.
    ///
    /// # Errors
    /// When the pictures differ in size.
    pub fn of(
        reference: &ReferencePicture,
        picture: &Image,
        normal: Option<&[[f32; 3]]>,
        view: &View,
    ) -> Result<Self, Error> {
        let right = &reference.picture;
        let difference = compare(right, picture, 1.0)?;
        let [flip, flip_object] = object_flip(right, picture)?;
        Ok(Self {
            flip,
            flip_object,
            psnr_db: difference.whole.psnr_db,
            psnr_object_db: difference.object.psnr_db,
            ssim: ssim(right, picture)?,
            object_pixels: difference.object.pixels,
            coverage: coverage(right, picture)?,
            silhouette: silhouette(right, picture)?,
            depth: depth_error(&right.depth, &picture.depth, view),
            normal: normal
                .filter(|_| !reference.normal.is_empty())
                .map(|n| normal_error(&reference.normal, n)),
            worst: worst_tile(right, picture, TILE_PX)?,
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    /// Two discs on black that differ in shade and place.
    fn pictures() -> [Image; 2] {
        [(100.0, 180), (103.0, 150)].map(|(center, level)| {
            let mut image = Image::filled(240, 200, [0; 4]);
            for (i, pixel) in image.color.iter_mut().enumerate() {
                let (x, y) = ((i % 240) as f64, (i / 240) as f64);
                if (x - center).hypot(y - 90.0) < 30.0 {
                    *pixel = [level, level / 2, 200, 255];
                }
            }
            image
        })
    }

    #[test]
    fn flip_around_the_object_is_flip_of_the_picture() {
        let [a, b] = pictures();
        let whole = flip(&a, &b, PIXELS_PER_DEGREE).unwrap();
        let [found, object] = object_flip(&a, &b).unwrap();
        assert!(whole.mean > 1e-3);
        // Sums of single precision in another order.
        assert!((found - whole.mean).abs() < 1e-7, "{found} {}", whole.mean);
        let (mut sum, mut n) = (0.0, 0.0);
        for (i, v) in whole.map.iter().enumerate() {
            if a.color[i][3] > 0 || b.color[i][3] > 0 {
                sum += f64::from(*v);
                n += 1.0;
            }
        }
        assert!((object - sum / n).abs() < 1e-6, "{object} {}", sum / n);
        assert_eq!(object_flip(&a, &a).unwrap(), [0.0; 2]);
        let nothing = Image::filled(5, 4, [0; 4]);
        assert_eq!(object_flip(&nothing, &nothing).unwrap(), [0.0; 2]);
    }

    #[test]
    fn the_box_holds_the_object_and_ends_at_the_border() {
        let mut a = Image::filled(20, 10, [0; 4]);
        assert!(object_box(&a, &a, 3).is_none());
        a.color[2 * 20 + 5] = [0, 0, 0, 1];
        let mut b = Image::filled(20, 10, [9, 9, 9, 0]);
        b.color[8 * 20 + 19] = [0, 0, 0, 255];
        let tile = object_box(&a, &b, 3).unwrap();
        assert_eq!((tile.x, tile.y, tile.width, tile.height), (2, 0, 18, 10));
        let tile = object_box(&a, &a, 0).unwrap();
        assert_eq!((tile.x, tile.y, tile.width, tile.height), (5, 2, 1, 1));
        assert_eq!(part(&a, &tile).color, vec![[0.0, 0.0, 0.0, 1.0f32 / 255.0]]);
    }
}
