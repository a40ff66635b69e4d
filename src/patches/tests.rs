//! Models for the tests of this folder.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use crate::mesh::Mesh;
use crate::progress::Silent;
use crate::tree::{self, BuildOptions, Model};
use glam::Vec3;

/// A generated model, such as `sphere:1000`.
pub(super) fn model_of(spec: &str) -> Model {
    of_mesh(crate::generate::mesh(&spec.parse().unwrap()))
}

/// The tree of a mesh.
pub(super) fn of_mesh(mesh: Mesh) -> Model {
    tree::build(mesh, &BuildOptions::default(), &Silent).unwrap()
}

/// A sheet of `columns` times `rows` cells over (x, y) from 0 to 1, two triangles each; without those that `is_hole` names.
pub(super) fn sheet(
    [columns, rows]: [u32; 2],
    place: impl Fn(f32, f32) -> Vec3,
    is_hole: impl Fn(u32, u32) -> bool,
) -> Mesh {
    let mut mesh = Mesh::default();
    for y in 0..=rows {
        for x in 0..=columns {
            mesh.positions
                .push(place(x as f32 / columns as f32, y as f32 / rows as f32));
        }
    }
    for y in 0..rows {
        for x in 0..columns {
            if !is_hole(x, y) {
                let a = y * (columns + 1) + x;
                let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    mesh
}
