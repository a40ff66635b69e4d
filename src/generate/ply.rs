//! Writes meshes and point clouds as binary little-endian PLY.
//!
//! Vertices have `x y z` as floats, then `nx ny nz` and `red green blue` when the mesh has them. When its
//! origin is not zero, `x y z` are doubles with the origin added back. Faces are `vertex_indices` lists of
//! three; a point cloud has no face element.

use super::{GenerateError, atomic};
use crate::{mesh::Mesh, progress::Progress};
use glam::{DVec3, Vec3};
use std::{fmt::Write as _, io::Write, path::Path};

/// Records encoded at a time.
const BLOCK: usize = 1 << 16;

/// What a file holds, and so the size of its records.
pub(super) struct PlyLayout {
    pub(super) vertices: u64,
    pub(super) triangles: u64,
    pub(super) is_cloud: bool,
    pub(super) has_normals: bool,
    pub(super) has_colors: bool,
    pub(super) has_origin: bool,
}

impl PlyLayout {
    fn of(mesh: &Mesh) -> Result<PlyLayout, GenerateError> {
        let positions = mesh.positions.len();
        for (what, found) in [
            ("normals", mesh.normals.len()),
            ("colors", mesh.colors.len()),
        ] {
            if found != 0 && found != positions {
                return Err(GenerateError::Inconsistent {
                    positions,
                    what,
                    found,
                });
            }
        }
        Ok(PlyLayout {
            vertices: positions as u64,
            triangles: mesh.triangles.len() as u64,
            is_cloud: mesh.is_cloud(),
            has_normals: !mesh.normals.is_empty(),
            has_colors: !mesh.colors.is_empty(),
            has_origin: mesh.origin != DVec3::ZERO,
        })
    }

    /// Everything up to and with the line `end_header`.
    pub(super) fn header(&self) -> String {
        let mut text = String::from("ply\nformat binary_little_endian 1.0\n");
        let coordinate = if self.has_origin { "double" } else { "float" };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "element vertex {}", self.vertices);
        for name in ["x", "y", "z"] {
            let _ = writeln!(text, "property {coordinate} {name}");
        }
        if self.has_normals {
            text.push_str("property float nx\nproperty float ny\nproperty float nz\n");
        }
        if self.has_colors {
            text.push_str("property uchar red\nproperty uchar green\nproperty uchar blue\n");
        }
        if !self.is_cloud {
            // `int` is what every reader knows; it holds indices up to 2^31 - 1.
            let index = if self.vertices <= 1 << 31 {
                "int"
            } else {
                "uint"
            };
            let _ = writeln!(text, "element face {}", self.triangles);
            let _ = writeln!(text, "property list uchar {index} vertex_indices");
        }
        text.push_str("end_header\n");
        text
    }

    /// Bytes of one vertex.
    fn vertex_size(&self) -> usize {
        let position = if self.has_origin { 24 } else { 12 };
        position + if self.has_normals { 12 } else { 0 } + if self.has_colors { 3 } else { 0 }
    }

    /// Bytes of one triangle: the count and three indices.
    const TRIANGLE_SIZE: usize = 13;

    /// Bytes after the header.
    pub(super) fn body_bytes(&self) -> u64 {
        self.vertices * self.vertex_size() as u64 + self.triangles * Self::TRIANGLE_SIZE as u64
    }

    /// The bytes of some vertices; `normals` and `colors` as long as `positions` where the layout has them.
    pub(super) fn vertex_bytes(
        &self,
        positions: &[Vec3],
        normals: &[Vec3],
        colors: &[[u8; 4]],
        origin: DVec3,
    ) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(positions.len() * self.vertex_size());
        for (i, position) in positions.iter().enumerate() {
            if self.has_origin {
                put(
                    &mut bytes,
                    (origin + position.as_dvec3())
                        .to_array()
                        .map(f64::to_le_bytes),
                );
            } else {
                put(&mut bytes, position.to_array().map(f32::to_le_bytes));
            }
            if self.has_normals {
                put(&mut bytes, normals[i].to_array().map(f32::to_le_bytes));
            }
            if self.has_colors {
                bytes.extend_from_slice(&colors[i][..3]);
            }
        }
        bytes
    }

    /// The bytes of some triangles.
    pub(super) fn triangle_bytes(&self, triangles: &[[u32; 3]]) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(triangles.len() * Self::TRIANGLE_SIZE);
        for corners in triangles {
            bytes.push(3);
            put(&mut bytes, corners.map(u32::to_le_bytes));
        }
        bytes
    }
}

/// Appends three numbers.
fn put<const N: usize>(bytes: &mut Vec<u8>, numbers: [[u8; N]; 3]) {
    bytes.extend_from_slice(numbers.as_flattened());
}

/// Writes a mesh or point cloud to a stream; memory beyond the mesh is a few MiB.
///
/// `progress` gets one stage, in bytes of the file.
///
/// # Errors
///
/// [`GenerateError::Inconsistent`] when normals or colors are neither absent nor one per vertex,
/// [`GenerateError::Stream`] when `out` fails, [`GenerateError::Cancelled`] when `progress` says so; `out` then holds a part.
pub fn write_to(
    mesh: &Mesh,
    out: &mut (impl Write + ?Sized),
    progress: &dyn Progress,
) -> Result<(), GenerateError> {
    let layout = PlyLayout::of(mesh)?;
    let header = layout.header();
    progress.stage("write", header.len() as u64 + layout.body_bytes());
    out.write_all(header.as_bytes())?;
    progress.advance(header.len() as u64);

    let mut write = |bytes: Vec<u8>| {
        if progress.is_cancelled() {
            return Err(GenerateError::Cancelled);
        }
        out.write_all(&bytes)?;
        progress.advance(bytes.len() as u64);
        Ok(())
    };
    for block in super::blocks(mesh.positions.len(), BLOCK) {
        // An absent array has an empty range.
        let normals = mesh.normals.get(block.clone()).unwrap_or_default();
        let colors = mesh.colors.get(block.clone()).unwrap_or_default();
        write(layout.vertex_bytes(&mesh.positions[block], normals, colors, mesh.origin))?;
    }
    for some in mesh.triangles.chunks(BLOCK) {
        write(layout.triangle_bytes(some))?;
    }
    Ok(())
}

/// Writes a mesh or point cloud as a file that appears only when it is complete: the bytes go to a file
/// beside `path`, which is renamed at the end. On an error `path` is as it was before. A link is followed;
/// what is no plain file (a pipe, a device) is written directly.
///
/// # Errors
///
/// [`GenerateError::Inconsistent`] as for [`write_to`], [`GenerateError::Write`] when the file cannot be written,
/// [`GenerateError::Cancelled`] when `progress` says so.
pub fn write(mesh: &Mesh, path: &Path, progress: &dyn Progress) -> Result<(), GenerateError> {
    atomic::write(path, |out| write_to(mesh, out, progress))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::SilentProgress;

    fn text_and_body(mesh: &Mesh) -> (String, Vec<u8>) {
        let mut bytes = Vec::new();
        write_to(mesh, &mut bytes, &SilentProgress).expect("a vector takes everything");
        let end = b"end_header\n";
        let split = bytes
            .windows(end.len())
            .position(|some| some == end)
            .expect("a header")
            + end.len();
        let text = String::from_utf8(bytes[..split].to_vec()).expect("ASCII");
        (text, bytes[split..].to_vec())
    }

    #[test]
    fn a_triangle_with_everything() {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(0.0, 2.5, 0.0)],
            normals: vec![Vec3::Z; 3],
            colors: vec![[1, 2, 3, 255], [4, 5, 6, 255], [7, 8, 9, 255]],
            triangles: vec![[0, 1, 2]],
            origin: DVec3::new(4e6, 0.25, -1e7),
            textures: None,
            scanners: crate::mesh::scanners::ScannerPlaces::default(),
        };
        let (text, body) = text_and_body(&mesh);
        assert_eq!(
            text,
            "ply\nformat binary_little_endian 1.0\nelement vertex 3\n\
             property double x\nproperty double y\nproperty double z\n\
             property float nx\nproperty float ny\nproperty float nz\n\
             property uchar red\nproperty uchar green\nproperty uchar blue\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        );
        let mut wanted = Vec::new();
        for (p, color) in [
            ([4e6, 0.25, -1e7], [1, 2, 3]),
            ([4_000_001.0, 0.25, -1e7], [4, 5, 6]),
            ([4e6, 2.75, -1e7], [7_u8, 8, 9]),
        ] {
            for c in p {
                wanted.extend_from_slice(&f64::to_le_bytes(c));
            }
            for c in [0.0, 0.0, 1.0] {
                wanted.extend_from_slice(&f32::to_le_bytes(c));
            }
            wanted.extend_from_slice(&color);
        }
        wanted.extend_from_slice(&[3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
        assert_eq!(body, wanted);
    }

    #[test]
    fn a_cloud_has_no_faces_and_an_empty_mesh_has_none_either() {
        let cloud = Mesh {
            positions: vec![Vec3::ONE],
            ..Mesh::default()
        };
        let (text, body) = text_and_body(&cloud);
        assert!(!text.contains("face") && !text.contains("nx") && !text.contains("red"));
        assert_eq!(body.len(), 12);
        let (text, body) = text_and_body(&Mesh::default());
        assert!(text.contains("element vertex 0\n") && text.contains("element face 0\n"));
        assert!(body.is_empty());
    }

    #[test]
    fn arrays_of_different_lengths_are_refused() {
        let mesh = Mesh {
            positions: vec![Vec3::ONE; 3],
            normals: vec![Vec3::Z; 2],
            ..Mesh::default()
        };
        assert!(matches!(
            write_to(&mesh, &mut Vec::new(), &SilentProgress),
            Err(GenerateError::Inconsistent {
                positions: 3,
                what: "normals",
                found: 2
            })
        ));
    }

    #[test]
    fn indices_are_unsigned_only_where_they_must_be() {
        let mut layout = PlyLayout {
            vertices: 1 << 31,
            triangles: 1,
            is_cloud: false,
            has_normals: false,
            has_colors: false,
            has_origin: false,
        };
        assert!(layout.header().contains("uchar int "));
        layout.vertices += 1;
        assert!(layout.header().contains("uchar uint "));
    }
}
