//! Photographs from files: JPEG and PNG, whole or as a small picture first, never more than a budget of bytes.
//!
//! EXIF orientation is obeyed only where the stored size is the transpose of the calibrated one: a
//! calibration is of stored pixels, unless the program that made it turned them.

use crate::photos::error::PhotoError;
pub use crate::projective::pyramid::PhotoPixels;
use ::image::metadata::Orientation;
use ::image::{DynamicImage, ImageDecoder, ImageReader};
use std::fs::File;
use std::io::BufReader;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Largest side of a photograph, pixels.
const LARGEST_SIDE: u32 = 65_535;

/// Bytes that one photograph may take while it is decoded, where nobody says otherwise: 250 Mpx.
pub const DECODE_BYTES: u64 = 1 << 30;

/// Thumbnails of JPEG files are decoded at one part of so many along each side.
pub const THUMBNAIL_PART: u32 = 8;

/// The pixels of a decoded picture.
fn pixels_of(picture: DynamicImage) -> PhotoPixels {
    let rgb = picture.into_rgb8();
    let (texels, _) = rgb.as_raw().as_chunks::<3>();
    PhotoPixels {
        width: rgb.width(),
        height: rgb.height(),
        rgb: texels.to_vec(),
    }
}

/// Runs a decoder; where it panics the photograph is named instead of the program ended.
fn guarded<T>(path: &Path, decode: impl FnOnce() -> Result<T, String>) -> Result<T, PhotoError> {
    let failed = |cause: String| PhotoError::Decode {
        path: path.to_owned(),
        cause,
    };
    match catch_unwind(AssertUnwindSafe(decode)) {
        Ok(result) => result.map_err(failed),
        Err(panic) => {
            let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
            let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
            let text = text.unwrap_or_else(|| "no reason".to_owned());
            Err(failed(format!(
                "the decoder gave up on damaged data ({text})"
            )))
        }
    }
}

fn open(path: &Path) -> Result<ImageReader<BufReader<File>>, PhotoError> {
    let failed = |e: std::io::Error| PhotoError::Read {
        path: path.to_owned(),
        cause: e.to_string(),
    };
    ImageReader::open(path)
        .map_err(failed)?
        .with_guessed_format()
        .map_err(failed)
}

/// Decodes a photograph that was calibrated at a size of `calibrated` pixels, or at a multiple of it.
///
/// # Errors
/// [`PhotoError::Read`] or [`PhotoError::Decode`]: the file is missing, damaged, of another format, takes more than `budget`
/// bytes, or is stored turned without saying how.
pub fn decode_photo(
    path: &Path,
    calibrated: [u32; 2],
    budget: u64,
) -> Result<PhotoPixels, PhotoError> {
    let reader = open(path)?;
    guarded(path, || {
        let mut decoder = reader.into_decoder().map_err(|e| e.to_string())?;
        let (width, height) = decoder.dimensions();
        check_size([width, height], budget)?;
        let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
        let mut picture = DynamicImage::from_decoder(decoder).map_err(|e| e.to_string())?;
        turn(&mut picture, orientation, [width, height], calibrated)?;
        Ok(pixels_of(picture))
    })
}

/// Decodes a small picture of a photograph: of a JPEG an eighth along each side, straight from its cosine transform, of other
/// files the whole, made smaller.
///
/// # Errors
/// As [`decode_photo`].
pub fn decode_thumbnail(
    path: &Path,
    calibrated: [u32; 2],
    budget: u64,
) -> Result<PhotoPixels, PhotoError> {
    let reader = open(path)?;
    if reader.format() != Some(::image::ImageFormat::Jpeg) {
        let mut pixels = decode_photo(path, calibrated, budget)?;
        for _ in 0..THUMBNAIL_PART.ilog2() {
            pixels = pixels.halved();
        }
        return Ok(pixels);
    }
    let small = guarded(path, || {
        let mut decoder = reader.into_decoder().map_err(|e| e.to_string())?;
        let (width, height) = decoder.dimensions();
        check_size([width, height], budget)?;
        let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
        let file = File::open(path).map_err(|e| e.to_string())?;
        let mut decoder = jpeg_decoder::Decoder::new(BufReader::new(file));
        let part = |side: u32| u16::try_from(side.div_ceil(THUMBNAIL_PART)).unwrap_or(u16::MAX);
        decoder
            .scale(part(width), part(height))
            .map_err(|e| e.to_string())?;
        let bytes = decoder.decode().map_err(|e| e.to_string())?;
        let info = decoder.info().ok_or("it has no header")?;
        let rgb: Vec<u8> = match info.pixel_format {
            jpeg_decoder::PixelFormat::RGB24 => bytes,
            jpeg_decoder::PixelFormat::L8 => bytes.iter().flat_map(|v| [*v; 3]).collect(),
            // Other colors are rare: the whole decoder knows them.
            _ => return Ok(None),
        };
        let size = [u32::from(info.width), u32::from(info.height)];
        let picture =
            ::image::RgbImage::from_raw(size[0], size[1], rgb).ok_or("it has too few pixels")?;
        let mut picture = DynamicImage::from(picture);
        turn(&mut picture, orientation, [width, height], calibrated)?;
        Ok(Some(pixels_of(picture)))
    })?;
    match small {
        Some(pixels) => Ok(pixels),
        None => {
            let mut pixels = decode_photo(path, calibrated, budget)?;
            for _ in 0..THUMBNAIL_PART.ilog2() {
                pixels = pixels.halved();
            }
            Ok(pixels)
        }
    }
}

fn check_size([width, height]: [u32; 2], budget: u64) -> Result<(), String> {
    // Four bytes a pixel while it is decoded and copied.
    let bytes = 4 * u64::from(width) * u64::from(height);
    if width == 0 || height == 0 || width > LARGEST_SIDE || height > LARGEST_SIDE {
        Err(format!("it has {width} x {height} pixels"))
    } else if bytes > budget {
        Err(format!(
            "its {width} x {height} pixels take {bytes} bytes, more than the {budget} that are allowed"
        ))
    } else {
        Ok(())
    }
}

/// Turns a picture as EXIF says, where only that makes it fit its calibration.
fn turn(
    picture: &mut DynamicImage,
    orientation: Orientation,
    stored: [u32; 2],
    calibrated: [u32; 2],
) -> Result<(), String> {
    let [w, h] = stored;
    if w == h || [h, w] != calibrated {
        return Ok(());
    }
    let transposes = matches!(
        orientation,
        Orientation::Rotate90
            | Orientation::Rotate270
            | Orientation::Rotate90FlipH
            | Orientation::Rotate270FlipH
    );
    if !transposes {
        return Err(format!(
            "it is stored as {w} x {h} pixels but calibrated as {h} x {w}, and no EXIF says how it was turned"
        ));
    }
    picture.apply_orientation(orientation);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::image::codecs::jpeg::JpegEncoder;

    /// A picture, red in its upper left quarter.
    fn picture(width: u32, height: u32) -> ::image::RgbImage {
        ::image::RgbImage::from_fn(width, height, |x, y| {
            ::image::Rgb(if x < width / 2 && y < height / 2 {
                [220, 20, 20]
            } else {
                [20, 60, 180]
            })
        })
    }

    /// A JPEG with an EXIF orientation, 1 to 8; 0 writes none.
    fn jpeg(width: u32, height: u32, orientation: u8) -> Vec<u8> {
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, 95)
            .encode_image(&picture(width, height))
            .unwrap();
        if orientation == 0 {
            return bytes;
        }
        let mut exif =
            b"\xff\xe1\x00\x22Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".to_vec();
        exif.extend([orientation, 0, 0, 0, 0, 0, 0]);
        bytes.splice(2..2, exif);
        bytes
    }

    fn is_red([r, _, b]: [u8; 3]) -> bool {
        r > 150 && b < 100
    }

    /// Corners that are red, from the upper left by rows.
    fn red_corners(p: &PhotoPixels) -> [bool; 4] {
        let (w, h) = (i64::from(p.width), i64::from(p.height));
        [(0, 0), (w, 0), (0, h), (w, h)].map(|(x, y)| is_red(p.at(x, y)))
    }

    #[test]
    fn a_calibrated_photograph_is_not_turned_unless_it_must_be() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.jpg");
        for orientation in 0..=8 {
            std::fs::write(&path, jpeg(64, 32, orientation)).unwrap();
            let stays = decode_photo(&path, [64, 32], DECODE_BYTES).unwrap();
            assert_eq!((stays.width, stays.height), (64, 32));
            assert_eq!(
                red_corners(&stays),
                [true, false, false, false],
                "{orientation}"
            );
            let small = decode_thumbnail(&path, [64, 32], DECODE_BYTES).unwrap();
            assert_eq!((small.width, small.height), (8, 4));
            assert_eq!(red_corners(&small), [true, false, false, false]);

            // Calibrated as 32 x 64: only an orientation that transposes explains that.
            let turned = [decode_photo, decode_thumbnail]
                .map(|decode| decode(&path, [32, 64], DECODE_BYTES));
            let place = match orientation {
                5 => 0,
                6 => 1,
                7 => 3,
                8 => 2,
                _ => {
                    for result in turned {
                        let message = result.unwrap_err().to_string();
                        assert!(message.contains("no EXIF says"), "{message}");
                    }
                    continue;
                }
            };
            for pixels in turned {
                let pixels = pixels.unwrap();
                assert!(pixels.width < pixels.height);
                let corners = red_corners(&pixels);
                assert!(
                    corners[place] && corners.iter().filter(|red| **red).count() == 1,
                    "{orientation} {corners:?}"
                );
            }
        }
    }

    #[test]
    fn damaged_photographs_are_named_and_end_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hurt.jpg");
        let whole = jpeg(64, 48, 6);
        let mut state = 12345_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as usize
        };
        for round in 0..300 {
            let mut bytes = whole.clone();
            for _ in 0..8 {
                let at = random() % bytes.len();
                bytes[at] = random() as u8;
            }
            bytes.truncate(bytes.len() - random() % (bytes.len() / 2));
            std::fs::write(&path, bytes).unwrap();
            for result in [
                decode_photo(&path, [64, 48], 1 << 22),
                decode_thumbnail(&path, [64, 48], 1 << 22),
            ] {
                if let Err(error) = result {
                    assert!(error.to_string().contains("hurt.jpg"), "{round}: {error}");
                }
            }
        }
        std::fs::write(&path, &whole[..20]).unwrap();
        assert!(decode_photo(&path, [64, 48], 1 << 22).is_err());
        let missing = decode_photo(&folder.path().join("none.jpg"), [1, 1], 1).unwrap_err();
        assert!(matches!(missing, PhotoError::Read { .. }));
    }

    #[test]
    fn a_decoder_that_panics_is_an_error() {
        let message =
            guarded::<()>(Path::new("x.jpg"), || panic!("index out of bounds")).unwrap_err();
        let message = message.to_string();
        assert!(
            message.contains("x.jpg") && message.contains("index out of bounds"),
            "{message}"
        );
    }

    #[test]
    fn a_photograph_above_the_budget_is_refused_before_it_is_decoded() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.png", "a.jpg"] {
            let path = folder.path().join(name);
            picture(64, 32).save(&path).unwrap();
            let message = decode_photo(&path, [64, 32], 8000).unwrap_err().to_string();
            assert!(message.contains("more than the 8000"), "{message}");
            assert!(decode_photo(&path, [64, 32], 8192).is_ok());
            assert_eq!(decode_thumbnail(&path, [64, 32], 8192).unwrap().width, 8);
        }
    }

    #[test]
    fn halving_keeps_the_mean() {
        let mut pixels = PhotoPixels::filled(3, 2, [10, 0, 200]);
        pixels.rgb[0] = [50, 0, 200];
        let half = pixels.halved();
        assert_eq!((half.width, half.height), (2, 1));
        assert_eq!(half.rgb, [[20, 0, 200], [10, 0, 200]]);
        assert_eq!(PhotoPixels::filled(1, 1, [7; 3]).halved().rgb, [[7; 3]]);
    }
}
