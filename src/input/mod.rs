//! Reads models: OBJ, PLY, STL, OFF, TRI, also gzipped or from standard input.

/// Why a file could not be read as a model.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The user asked to stop.
    #[error("cancelled")]
    Cancelled,
}
