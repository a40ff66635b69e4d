//! Pictures: eight-bit and float, with coverage and depth; PNG, EXR, npy; comparison.

use std::path::PathBuf;

/// Why a picture could not be written or read.
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
}
