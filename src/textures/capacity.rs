//! Sizes that a file of pictures cannot have: a header may say anything, and memory is asked for by it.

/// Pixels that a byte of a PNG file holds at most: deflate packs 1032 times, and a pixel has one bit at least.
pub(crate) const PNG_PIXELS_A_BYTE: u64 = 1032 * 8;

/// Pixels that a byte of a JPEG file holds at most: a block of 64 has one bit at least.
pub(crate) const JPEG_PIXELS_A_BYTE: u64 = 64 * 8;

/// Pixels that a byte of an OpenEXR file holds at most: deflate packs 1032 times, and a sample has two bytes. Its other
/// ways of packing reach less.
pub(crate) const EXR_PIXELS_A_BYTE: u64 = 1032 / 2;

/// Pixels that are never too many.
const FREE_PIXELS: u64 = 1 << 20;

/// Says whether a file of so many bytes can hold a picture of a size. Errs to yes.
pub(crate) fn can_hold([width, height]: [u64; 2], pixels_a_byte: u64, bytes: u64) -> bool {
    let most = bytes.saturating_mul(pixels_a_byte).max(FREE_PIXELS);
    width.saturating_mul(height) <= most
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]
    use super::*;

    /// Black pictures are what packs best.
    #[test]
    fn what_encoders_write_is_held() {
        use image::{DynamicImage, ImageFormat};
        for (format, pixels_a_byte) in [
            (ImageFormat::Png, PNG_PIXELS_A_BYTE),
            (ImageFormat::Jpeg, JPEG_PIXELS_A_BYTE),
        ] {
            let mut bytes = std::io::Cursor::new(Vec::new());
            let picture = DynamicImage::new_luma8(3000, 2000);
            picture.write_to(&mut bytes, format).unwrap();
            let length = bytes.get_ref().len() as u64;
            assert!(
                can_hold([3000, 2000], pixels_a_byte, length),
                "{length} bytes"
            );
            assert!(!can_hold([30_000, 20_000], pixels_a_byte, length / 50));
        }
        assert!(!can_hold([u64::MAX, 2], 1, 1));
        assert!(can_hold([1000, 1000], 1, 0));
    }
}
