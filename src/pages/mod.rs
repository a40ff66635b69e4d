//! Trees in few bytes, in pages that are read when they are needed.
//!
//! Source: Rusinkiewicz and Levoy, *QSplat: A Multiresolution Point Rendering System for Large Meshes* (SIGGRAPH 2000).
//! [`quantize`] has its node in few bits, [`qs`] its files.

pub mod qs;
pub mod quantize;
