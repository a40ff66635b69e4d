//! Pages in frames.
