//! Files of QSplat 1.0 (`.qs`, marked `QSplat11`): read, decoded and written.
//!
//! Big-endian. A file is a row of fragments. Each begins with 40 bytes: `QSplat11`, its length, its number of leaves,
//! options (1: colors, 2: a comment, whose text follows the options), center and radius of the root's sphere, number of
//! the root's children. The root itself is no node. Then groups of siblings, breadth-first: where some member has children,
//! 4 bytes with the distance from their own position to the group of the first member's children; then 4 bytes a node, 6
//! with colors. 13 bits sphere, 1 whether some child has children, 2 number of children less 1 or 0; 14 bits normal, 2
//! cone; 5-6-5 bits color. A fragment ends at a multiple of 4 bytes.
//!
//! Normals are not those of [`super::quantize`]: these files pack two components of a unit vector, not their ratios to the
//! largest.

mod read;
mod write;

pub use read::{is_qs_file, read};
pub use write::{of_model, to_bytes};

use super::quantize::{PageSphere, color_from_565, decode_sphere};
use crate::mesh::Mesh;
use glam::Vec3;
use std::f32::consts::FRAC_PI_4;
use std::path::PathBuf;

/// First bytes of a fragment.
pub const MAGIC: [u8; 8] = *b"QSplat11";

/// Bytes of a fragment before its groups.
const HEADER: usize = 40;
/// Bytes of a comment's fragment before its text.
const COMMENT_HEADER: usize = 20;
const COLORS: u32 = 1;
const COMMENT: u32 = 2;

/// Bit of a node: some child has children.
const HAS_GRANDCHILDREN: u16 = 4;

/// Codes of normals: those that a byte-wise table of 6 by 52 by 52 has.
const NORMAL_CODES: u16 = 16_224;

/// Why a file cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{path}, byte {offset}: {cause}", path = path.display())]
pub struct QsError {
    /// The file.
    pub path: PathBuf,
    /// Where in it.
    pub offset: u64,
    /// What is wrong there.
    pub cause: String,
}

impl From<QsError> for crate::tree::Error {
    fn from(error: QsError) -> Self {
        let QsError {
            path,
            offset,
            cause,
        } = error;
        Self::File {
            path,
            offset,
            cause,
        }
    }
}

/// The leaves of trees as a point cloud with radii, for [`crate::tree::build_with_radii`].
#[derive(Debug, Clone, Default)]
pub struct QsCloud {
    /// Centers, normals, and colors where some tree has them.
    pub mesh: Mesh,
    /// Radius of each point.
    pub radii: Vec<f32>,
}

impl QsCloud {
    /// All leaves of all trees, in their order.
    pub fn of_trees(trees: &[QsTree]) -> Self {
        let mut cloud = Self::default();
        let has_colors = trees.iter().any(|tree| tree.has_colors);
        for leaf in trees.iter().flat_map(QsTree::leaves) {
            cloud.mesh.positions.push(leaf.sphere.center);
            cloud.mesh.normals.push(leaf.normal);
            if has_colors {
                let [r, g, b] = leaf.color;
                cloud.mesh.colors.push([r, g, b, 255]);
            }
            cloud.radii.push(leaf.sphere.radius);
        }
        cloud
    }
}

/// A node as the file has it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct QsNode {
    /// Sphere in the decoded parent's, [`super::quantize::decode_sphere`].
    pub sphere: u16,
    /// Normal, [`qs_normal`].
    pub normal: u16,
    /// Cone of normals, [`super::quantize::CONE_SINES`].
    pub cone: u8,
    /// Number of children, 0 or 2 to 4.
    pub children: u8,
    /// Color in 5-6-5 bits; 0 in files without.
    pub color: u16,
}

/// A tree as a fragment has it.
#[derive(Debug, Clone, PartialEq)]
pub struct QsTree {
    /// Whether nodes have colors.
    pub has_colors: bool,
    /// The root's sphere.
    pub root: PageSphere,
    /// The root's number of children, 0 for a tree of a single leaf, which is the root.
    pub root_children: u8,
    /// All nodes below the root, breadth-first.
    pub nodes: Vec<QsNode>,
}

/// A leaf as it is decoded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QsLeaf {
    /// Center and radius.
    pub sphere: PageSphere,
    /// Unit normal; zero where there is none: in the tree of a single leaf.
    pub normal: Vec3,
    /// Red, green, blue; white in files without colors.
    pub color: [u8; 3],
}

impl QsTree {
    /// Number of leaves.
    pub fn leaf_count(&self) -> usize {
        if self.root_children == 0 {
            return 1;
        }
        self.nodes.iter().filter(|node| node.children == 0).count()
    }

    /// All leaves, in the order of the file.
    pub fn leaves(&self) -> Vec<QsLeaf> {
        if self.root_children == 0 {
            return vec![QsLeaf {
                sphere: self.root,
                normal: Vec3::ZERO,
                color: [255; 3],
            }];
        }
        // Parents that wait for the groups of their children, which come in the same order.
        let mut parents = std::collections::VecDeque::from([(self.root, self.root_children)]);
        let mut nodes = self.nodes.iter();
        let mut leaves = Vec::new();
        while let Some((parent, children)) = parents.pop_front() {
            for node in nodes.by_ref().take(usize::from(children)) {
                let sphere = decode_sphere(&parent, node.sphere);
                if node.children > 0 {
                    parents.push_back((sphere, node.children));
                } else {
                    leaves.push(QsLeaf {
                        sphere,
                        normal: qs_normal(node.normal),
                        color: if self.has_colors {
                            color_from_565(node.color)
                        } else {
                            [255; 3]
                        },
                    });
                }
            }
        }
        leaves
    }
}

/// Unpacks a normal of these files to a unit vector: the face names the largest component, the cells the next two
/// components, by their angle.
pub fn qs_normal(code: u16) -> Vec3 {
    let code = code.min(NORMAL_CODES - 1);
    let component = |cell: u16| {
        let place = (2.0 * f32::from(cell) + 1.0) / 52.0 - 1.0;
        (place * FRAC_PI_4).tan()
    };
    let (face, u, w) = (code / 2704, component(code / 52 % 52), component(code % 52));
    let axis = usize::from(face / 2);
    // In the corners of a face, which no unit vector has, the rest is nothing.
    let largest = (1.0 - u * u - w * w).max(0.0).sqrt();
    let mut direction = [0.0; 3];
    direction[axis] = if face % 2 == 1 { -largest } else { largest };
    direction[(axis + 1) % 3] = u;
    direction[(axis + 2) % 3] = w;
    let direction = Vec3::from_array(direction);
    // Never short: with all of u and w near 0 the largest is near 1.
    direction / direction.length()
}

/// Packs a direction of any length as [`qs_normal`] unpacks it; zero, and what is not finite, packs as +x.
pub fn qs_normal_code(direction: Vec3) -> u16 {
    let length = direction.length();
    let unit = if length > 0.0 && length.is_finite() {
        direction / length
    } else {
        Vec3::X
    };
    let size = unit.abs();
    let axis = match size.max_element() {
        m if m == size.x => 0,
        m if m == size.y => 1,
        _ => 2,
    };
    let components = unit.to_array();
    let cell =
        |component: f32| ((26.0 * (1.0 + component.atan() / FRAC_PI_4)).max(0.0) as u16).min(51);
    let face = 2 * axis as u16 + u16::from(components[axis] < 0.0);
    (face * 52 + cell(components[(axis + 1) % 3])) * 52 + cell(components[(axis + 2) % 3])
}

#[cfg(test)]
mod tests;
