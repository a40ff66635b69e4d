//! The POP bounding-sphere tree over the triangles of a mesh (or the points of a cloud).
//!
//! Source: Benda, *Point Based Rendering* (diploma thesis), section 3.2; Rusinkiewicz and Levoy, *QSplat*
//! (SIGGRAPH 2000), section 2. Differences are listed in `docs/ARCHITECTURE.md`.

mod access;
mod block_part;
mod blocks;
mod build;
mod check;
mod closed;
pub mod file;
mod flat_partition;
mod framed;
mod grow;
mod inside;
mod keep;
mod kind;
mod moments;
mod moved;
mod nearest_points;
mod neighborhood;
mod node;
mod node_colors;
mod order;
mod part;
mod partition;
mod patch_records;
mod point_normals;
mod records;
mod select;
mod shape;
mod sort_item;
mod spacing;
mod strip;
mod summary;
mod textures;
mod thickness;

pub use access::MemoryBytes;
pub(crate) use build::PartPlace;
pub use build::{BuildOptions, PointNormals, SplitRule, build, build_ordered, build_with_radii};
pub use check::{CheckReport, check, links};
pub(crate) use closed::ClosedEvidence;
pub(crate) use framed::FAR_OF_SPARSE;
pub use framed::FramedPart;
pub use kind::{ModelKind, OrbitSphere};
pub use moments::{area_of_point, fill_moments};
pub use node::{Leaf, Node, NodeAttributes, NodeStrip, NormalCone};
pub(crate) use part::{NodeRecords, PartShape, build_part, leaf_order, node_above};
pub use patch_records::{PackedPatch, PackedPatchColors, PatchRecords};
pub use records::AlignedRecords;
pub use summary::geometric_normal;
pub use textures::ModelTextures;

use crate::abi::Vertex;
use glam::{DVec3, Vec3};
use std::path::PathBuf;
use std::sync::Arc;

/// A model ready to be drawn: vertices and triangles in tree order, and the tree over them.
///
/// * Triangle `t` (or point `t` of a cloud) is leaf `t`; its bounding sphere is `tree.leaves[t]`.
/// * The triangles below a node are contiguous ([`Tree::leaf_range`]).
/// * Vertices are ordered by their first use in `triangles`; unused vertices are at the end.
#[derive(Debug, Clone, Default)]
pub struct Model {
    /// Vertices in order of first use.
    pub vertices: Vec<Vertex>,
    /// Corner indices in tree order; empty for a point cloud, whose leaf `t` is vertex `t`.
    pub triangles: Vec<[u32; 3]>,
    /// How many of `vertices` belong to a triangle (all of them for a cloud); the rest are at the end.
    pub used_vertices: u32,
    /// The hierarchy.
    pub tree: Tree,
    /// World position of the model-space zero.
    pub origin: DVec3,
    /// Smallest corner of the axis-aligned box of the used vertices, model space.
    pub min: Vec3,
    /// Largest corner of that box.
    pub max: Vec3,
    /// Center of the box and largest distance of a used vertex from it (the orbit's R), model space.
    pub orbit_center: Vec3,
    /// See `orbit_center`.
    pub orbit_radius: f32,
    /// What a first view frames where something lies far off; `None` frames all.
    pub framed: Option<FramedPart>,
    /// The surface is closed and consistently oriented outward, so what faces away is never seen.
    pub is_closed: bool,
    /// The file had vertex colors, or textures.
    pub has_colors: bool,
    /// What triangles show where they are large; colors of vertices and nodes are means of it already.
    pub textures: Option<Arc<ModelTextures>>,
    /// Records of error patches, where the tree file has them.
    pub patches: Option<Arc<PatchRecords>>,
}

/// The hierarchy: interior nodes breadth-first (the root is node 0), and one leaf per triangle or point.
///
/// Every level is complete: all leaves are at the same depth. Siblings are contiguous, and so are the
/// leaves below a node. A tree over one leaf has no interior node: [`Tree::nodes`] is empty then.
#[derive(Debug, Clone, Default)]
pub struct Tree {
    /// What the cut tests, 32 bytes a node.
    pub nodes: AlignedRecords<Node>,
    /// What only drawn nodes need; same order as `nodes`.
    pub attributes: AlignedRecords<NodeAttributes>,
    /// Parent of each node; the root is its own parent.
    pub parents: Vec<u32>,
    /// First leaf below each node, followed by nothing: the end is the start of the next node of the same
    /// level, or the leaf count for the last one. Use [`Tree::leaf_range`].
    pub first_leaf: Vec<u32>,
    /// Index of the first node of each level, root level first, then `nodes.len()`.
    pub level_starts: Vec<u32>,
    /// Bounding spheres of the leaves.
    pub leaves: AlignedRecords<Leaf>,
    /// Means for filtered splats; same order as `nodes`.
    pub moments: AlignedRecords<SurfaceMoments>,
}

/// Means over the triangles (or points) below a node, for splats that are filtered rather than sampled, 24 bytes. With A_t
/// the area of triangle t, n_t its unit normal, s_t its shading normal (the mean of its corners'), p_t its centroid and A
/// the sum of areas ([`NodeAttributes::area`]), in units of 1/32767, rounded to the nearest; zeros where A is 0.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct SurfaceMoments {
    /// Sum of A_t p_t over A, less the center of the bounding sphere, over its radius.
    pub centroid: [i16; 3],
    /// Sum of A_t n_t over A: the vector area. 0 for what has no normal.
    pub vector_area: [i16; 3],
    /// Sum of A_t (n_t s_tᵀ + s_t n_tᵀ) / 2 over A: xx, yy, zz, xy, xz, yz.
    pub second_moment: [i16; 6],
}

impl SurfaceMoments {
    /// Values of 1 are stored as this.
    pub const UNIT: f32 = 32767.0;
}

/// Why a tree could not be built or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// More leaves than 32-bit indices can name.
    #[error("the model has {count} {what}; at most {limit} fit a tree (32-bit indices)")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} has corner {corner}, but there are {vertices} vertices")]
    BadCorner {
        /// The triangle, in file order.
        triangle: usize,
        /// Corner of the triangle.
        corner: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// A position is infinite or not a number.
    #[error("vertex {vertex} has a position that is not finite")]
    NotFinite {
        /// The vertex, in file order.
        vertex: usize,
    },
    /// An attribute array is neither empty nor as long as the positions.
    #[error("the mesh has {count} {what} for {vertices} vertices")]
    Mismatch {
        /// Which array.
        what: &'static str,
        /// Length of the array.
        count: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// A tree file cannot be opened, read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file is not a tree file, or a damaged one.
    #[error("{path}, byte {offset}: {cause}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
        /// What is wrong.
        cause: String,
    },
    /// A file that joins others is asked for as one tree.
    #[error(
        "{name} joins the trees of {files} files, which are drawn page by page (surfel, surfel render); for anything else name one of those files"
    )]
    Forest {
        /// The file.
        name: String,
        /// Number of files that it joins.
        files: usize,
    },
    /// The user asked to stop.
    #[error("cancelled")]
    Cancelled,
}
