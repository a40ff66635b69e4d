//! The triangle mesh or point cloud as loaded: plain arrays, in file order.

pub mod attributes;
mod center;
pub mod color_legend;
pub mod creases;
pub mod faces;
pub mod normals;
pub mod placement;
pub mod scanners;
pub mod stream;
pub mod weld;

pub use center::{origin_of, recenter, recentered_zero};

use crate::textures::MeshTextures;
use glam::{DVec3, Vec3};
use scanners::ScannerPlaces;

/// A triangle mesh, or a point cloud when `triangles` is empty.
///
/// Positions are relative to [`origin`](Mesh::origin): the position of vertex `i` in world space is
/// `origin + positions[i]`, so that georeferenced coordinates keep their small detail in single precision.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions in model space (world minus `origin`), finite.
    pub positions: Vec<Vec3>,
    /// One unit normal per vertex, or empty when the source has none. A zero vector means "unknown".
    pub normals: Vec<Vec3>,
    /// One color per vertex (red, green, blue, 255), or empty when the source has none.
    pub colors: Vec<[u8; 4]>,
    /// Corner indices, each below `positions.len()`; counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// World position of the model-space zero; zero unless coordinates are large.
    pub origin: DVec3,
    /// What triangles show besides colors, or nothing.
    pub textures: Option<MeshTextures>,
    /// Places of the scanners of a cloud, where they are known.
    pub scanners: ScannerPlaces,
}

impl Mesh {
    /// Tells whether the mesh has no triangles but has vertices: a point cloud.
    pub fn is_cloud(&self) -> bool {
        self.triangles.is_empty() && !self.positions.is_empty()
    }
}
