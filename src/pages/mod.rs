//! Trees in few bytes, in pages that are read when they are needed.
//!
//! Source: Rusinkiewicz and Levoy, *QSplat: A Multiresolution Point Rendering System for Large Meshes* (SIGGRAPH 2000).
//! [`quantize`] has its node in few bits, [`qs`] its files. A file of our own ([`mod@format`]) is divided into pages
//! ([`page`]), each of which decodes into a small model that today's cut walks over. [`source`] is where its bytes lie,
//! [`mod@file`] reads its pages, [`write`](mod@write) makes it, [`check`] proves it, [`join`] makes a whole model of it,
//! [`forest`] one file of many.
//!
//! While one looks, [`cut`] goes over the pages that are in memory and names those that are wanted, [`loader`] reads them,
//! the most wanted first, and [`cache`] keeps what was needed last.

mod bits;
pub mod cache;
pub mod check;
pub mod cut;
pub mod external;
mod extract;
pub mod file;
pub mod forest;
mod forest_table;
pub mod format;
#[cfg(feature = "remote")]
pub mod http;
pub mod join;
pub mod loader;
mod mix_hash;
pub mod page;
mod page_tops;
pub mod qs;
pub mod quantize;
pub mod reading;
#[cfg(feature = "remote")]
pub mod serve;
pub mod source;
mod upper;
mod upper_tree;
pub mod write;

#[cfg(test)]
mod tests;
