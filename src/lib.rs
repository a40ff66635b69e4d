//! `surfel` draws enormous meshes and scans with points, triangles or both.
//!
//! The folders follow the data: [`input`] reads a file into a [`mesh::Mesh`], [`tree`] orders it into a
//! bounding-sphere tree, [`cut`] chooses the nodes that a view needs, [`draw`] packs them into lists of
//! plain records, [`method`] turns the lists into a picture on the device (or, as its mirror, on the CPU),
//! [`image`] keeps and compares pictures, [`measure`] keeps times and counts.

pub mod abi;
pub mod cut;
pub mod draw;
pub mod error;
pub mod generate;
pub mod gpu;
pub mod image;
pub mod input;
pub mod math;
pub mod measure;
pub mod mesh;
pub mod method;
pub mod progress;
pub mod tree;
#[cfg(feature = "viewer")]
pub mod viewer;

pub use error::Error;
