//! Errors of photographs: each error names the file, the place in it, the cause and what to do.

use crate::printable::{MOST_CHARS, printable};
use std::path::{Path, PathBuf};

/// Fault of a scene or a photograph.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PhotoError {
    /// The operating system did not give the bytes.
    #[error("{}: cannot be read: {cause}; check the path and its permissions", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Message of the operating system.
        cause: String,
    },
    /// The file does not hold what its format asks for.
    #[error("{}: {place}: {cause}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// "line 7", "byte 120", "frame 3".
        place: String,
        /// The cause, and what was expected.
        cause: String,
    },
    /// Nothing at this path is a scene of photographs.
    #[error(
        "{}: no scene of photographs: {cause}; known are Bundler (bundle.out and list.txt), COLMAP (cameras, images, points3D as .txt or .bin), OpenMVS (.mvs), VisualSFM (.nvm), AliceVision (.sfm), RealityCapture (.csv, .xmp) and nerfstudio (transforms.json)",
        path.display()
    )]
    NoScene {
        /// The file or folder.
        path: PathBuf,
        /// Thing that was found instead.
        cause: String,
    },
    /// A lens is described by a model that is not known.
    #[error(
        "{}: the distortion model {} is not known; undistort the photographs with the program that wrote the file, and export again",
        path.display(),
        printable(model, 60)
    )]
    Lens {
        /// The file.
        path: PathBuf,
        /// The model as the file names it.
        model: String,
    },
    /// No camera of the scene can be used.
    #[error("{}: none of its cameras can be used: {}", path.display(), printable(cause, MOST_CHARS))]
    NoCamera {
        /// The file.
        path: PathBuf,
        /// Fault of the last one.
        cause: String,
    },
    /// A photograph could not be decoded.
    #[error("{}: the photograph cannot be decoded: {cause}; open and save it again, or leave it out", path.display())]
    Decode {
        /// The file.
        path: PathBuf,
        /// Message of the decoder.
        cause: String,
    },
    /// Photographs, cameras and mesh do not belong together, or something that was asked for is not there.
    #[error("{0}")]
    Usage(String),
    /// A picture of the surface could not be drawn.
    #[error(transparent)]
    Gpu(#[from] crate::gpu::Error),
    /// A camera cannot be used by the renderer.
    #[error(transparent)]
    Camera(#[from] crate::math::camera::CameraError),
    /// A picture could not be written.
    #[error(transparent)]
    Picture(#[from] crate::image::Error),
    /// The user asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl PhotoError {
    /// An error in a line of a text file.
    pub(crate) fn at_line(path: &Path, line: usize, cause: impl Into<String>) -> Self {
        Self::format(path, format!("line {line}"), cause)
    }

    /// An error at a place of a file.
    pub(crate) fn format(path: &Path, place: impl Into<String>, cause: impl Into<String>) -> Self {
        Self::Format {
            path: path.to_owned(),
            place: printable(&place.into(), MOST_CHARS),
            cause: printable(&cause.into(), MOST_CHARS),
        }
    }
}
