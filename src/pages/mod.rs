//! Trees in few bytes, in pages that are read when they are needed.
//!
//! Source: Rusinkiewicz and Levoy, *QSplat: A Multiresolution Point Rendering System for Large Meshes* (SIGGRAPH 2000).
//! [`quantize`] has its node in few bits, [`qs`] its files. A file of our own ([`mod@format`]) is divided into pages
//! ([`page`]), each of which decodes into a small model that today's cut walks over. [`source`] is where its bytes lie,
//! [`file`] reads its pages, [`write`](mod@write) makes it, [`check`] proves it, [`join`] makes a whole model of it.

mod bits;
pub mod check;
mod extract;
pub mod file;
pub mod format;
pub mod join;
pub mod page;
pub mod qs;
pub mod quantize;
pub mod source;
pub mod write;

#[cfg(test)]
mod tests;
