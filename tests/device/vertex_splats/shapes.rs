//! Small models of few vertices.

use glam::Vec3;
use surfel::mesh::Mesh;
use surfel::progress::SilentProgress;
use surfel::tree::{self, BuildOptions, Model};

/// A closed box of 8 vertices, one color each.
pub(crate) fn cube() -> Model {
    let positions: Vec<Vec3> = (0..8)
        .map(|k| Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32))
        .collect();
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    let mesh = Mesh {
        colors: vec![[200, 150, 100, 255]; positions.len()],
        positions,
        triangles: triangles.collect(),
        ..Mesh::default()
    };
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// An open sheet with bumps.
pub(crate) fn sheet() -> Model {
    sheet_of(Vec::new())
}

/// The same sheet, each vertex of another color.
pub(crate) fn motley() -> Model {
    sheet_of(
        (0..13 * 13_u32)
            .map(|k| [k * 97, k * 61, k * 29].map(|c| c as u8))
            .map(|[r, g, b]| [r, g, b, 255])
            .collect(),
    )
}

fn sheet_of(colors: Vec<[u8; 4]>) -> Model {
    let n = 12_u32;
    let positions = (0..(n + 1) * (n + 1)).map(|k| {
        let (x, y) = ((k % (n + 1)) as f32, (k / (n + 1)) as f32);
        Vec3::new(x, y, (x * 0.8).sin() * (y * 0.6).cos())
    });
    let triangles = (0..n * n).flat_map(|k| {
        let a = k / n * (n + 1) + k % n;
        [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
    });
    let mesh = Mesh {
        positions: positions.collect(),
        colors,
        triangles: triangles.collect(),
        ..Mesh::default()
    };
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// The same box with vertices and normals of their own at each face.
pub(crate) fn flat_cube() -> Model {
    let cube = cube();
    let corner = |v: &u32| cube.vertices[*v as usize].position;
    let positions: Vec<Vec3> = cube.triangles.iter().flatten().map(corner).collect();
    let normals = positions.chunks(3).flat_map(|face| {
        let normal = (face[1] - face[0]).cross(face[2] - face[0]);
        [normal.normalize(); 3]
    });
    let mesh = Mesh {
        normals: normals.collect(),
        triangles: (0..12).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
        positions,
        ..Mesh::default()
    };
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// A shallow cone of equal facets with one normal, so that splats alone draw it: 60 at its rim and one in the middle.
pub(crate) fn fan(height: f32) -> Model {
    let rim = (0..60).map(|k| {
        let turn = k as f32 / 60.0 * std::f32::consts::TAU;
        Vec3::new(turn.cos(), turn.sin(), 0.0)
    });
    let mesh = Mesh {
        positions: rim.chain([Vec3::new(0.0, 0.0, height)]).collect(),
        normals: vec![Vec3::Z; 61],
        triangles: (0..60).map(|k| [k, (k + 1) % 60, 60]).collect(),
        ..Mesh::default()
    };
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}
