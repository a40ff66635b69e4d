//! Triangles that trees and splats do not like.

use super::outline::generated;
use super::shape::{GREEN, PX, RED, RandomNumbers, SceneShape, WHITE, camera, front, px};
use super::{BuiltScene, ExpectedFigures};
use crate::generate::GeneratedShape as Generated;
use crate::math::camera::Camera;
use crate::mesh::Mesh;
use glam::DVec3;

/// Looks at the torus (outer radius 1.4) from above.
fn torus_camera() -> Camera {
    camera(DVec3::new(0.0, 2.4, 3.4), DVec3::ZERO, [1.0, 8.0])
}

/// The torus of 2000 x 10 cells: each is 80 times as long as wide.
pub(super) fn needles() -> BuiltScene {
    BuiltScene {
        mesh: generated(Generated::Torus, 2000, 10),
        camera: torus_camera(),
        threshold_px: 3.0,
        expected: ExpectedFigures::default(),
    }
}

/// The torus of 240 x 80 cells, each row joined to the next with a shift of four columns: angles of about 165 degrees.
/// It is closed, since every row is shifted alike.
pub(super) fn obtuse() -> BuiltScene {
    const COLUMNS: u32 = 240;
    const ROWS: u32 = 80;
    const SHIFT: u32 = 4;
    let mut mesh: Mesh = generated(Generated::Torus, COLUMNS, ROWS);
    // The last column repeats the first.
    let at = |i: u32, j: u32| j * (COLUMNS + 1) + i % COLUMNS;
    mesh.triangles.clear();
    for j in 0..ROWS {
        for i in 0..COLUMNS {
            let (a, b) = (at(i, j), at(i + 1, j));
            let (c, d) = (at(i + 1 + SHIFT, j + 1), at(i + SHIFT, j + 1));
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    BuiltScene {
        mesh,
        camera: torus_camera(),
        threshold_px: 8.0,
        expected: ExpectedFigures::default(),
    }
}

/// A red triangle with legs of 120 pixels, and along one of them a green sheet in cells of 1.25 pixels.
pub(super) fn huge_triangle() -> BuiltScene {
    let mut shape = SceneShape::default();
    shape.triangle([px(-100.0, -60.0), px(20.0, -60.0), px(20.0, 60.0)], RED);
    shape.sheet(
        px(20.0, -60.0),
        DVec3::X * (80.0 * PX),
        DVec3::Y * (120.0 * PX),
        [64, 96],
        GREEN,
    );
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 4.0,
        expected: ExpectedFigures {
            covered_px: Some(7200.0 + 9600.0),
            ..ExpectedFigures::default()
        },
    }
}

/// The sphere of 120 x 60 cells, every other vertex of every other row moved out by 0.08: the tip of a
/// spike as wide as high.
pub(super) fn spikes() -> BuiltScene {
    const COLUMNS: usize = 120;
    const ROWS: usize = 60;
    let mut mesh = generated(Generated::Sphere, COLUMNS as u32, ROWS as u32);
    for (k, p) in mesh.positions.iter_mut().enumerate() {
        let (i, j) = (k % (COLUMNS + 1), k / (COLUMNS + 1));
        // The vertices of a pole are one point and stay one.
        if j != 0 && j != ROWS && i % 2 == 0 && j % 2 == 0 {
            *p *= 1.08;
        }
    }
    mesh.normals.clear();
    // Normals are computed from the triangles of a vertex: the seam has to share its vertices.
    for corner in mesh.triangles.iter_mut().flatten() {
        if *corner as usize % (COLUMNS + 1) == COLUMNS {
            *corner -= COLUMNS as u32;
        }
    }
    BuiltScene {
        mesh,
        camera: camera(DVec3::new(1.0, 1.5, 3.6), DVec3::ZERO, [1.0, 8.0]),
        threshold_px: 10.0,
        expected: ExpectedFigures::default(),
    }
}

/// A square of 120 pixels, all of its triangles three times; right of it 100 triangles of 50 pixels and 100 of 3 pixels
/// length whose corners lie on a line.
pub(super) fn degenerate() -> BuiltScene {
    let side = 120.0 * PX;
    let mut shape = SceneShape::default();
    shape.sheet(
        px(-100.0, -60.0),
        DVec3::X * side,
        DVec3::Y * side,
        [60; 2],
        WHITE,
    );
    let once = shape.mesh.triangles.clone();
    shape.mesh.triangles.extend_from_slice(&once);
    shape.mesh.triangles.extend_from_slice(&once);
    for k in 0..100 {
        let y = -60.0 + 1.2 * f64::from(k);
        for (x, length) in [(30.0, 50.0), (90.0, 3.0)] {
            let corners = [px(x, y), px(x + length, y), px(x + 0.5 * length, y)];
            let indices = corners.map(|corner| shape.vertex(corner, DVec3::Z, RED));
            shape.mesh.triangles.push(indices);
        }
    }
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 4.0,
        expected: ExpectedFigures {
            covered_px: Some(14_400.0),
            color: Some([204; 3]),
            ..ExpectedFigures::default()
        },
    }
}

/// A square of 120 pixels of two triangles, and 2000 triangles in and around it whose three corners are one point.
pub(super) fn coincident_vertices() -> BuiltScene {
    let mut shape = SceneShape::default();
    let half = 60.0;
    shape.quad(
        [
            px(-half, -half),
            px(half, -half),
            px(half, half),
            px(-half, half),
        ],
        DVec3::Z,
        WHITE,
    );
    let mut random = RandomNumbers::new(3);
    for _ in 0..2000 {
        let at = px(110.0 * random.signed(), 110.0 * random.signed());
        let index = shape.vertex(at, DVec3::Z, RED);
        shape.mesh.triangles.push([index; 3]);
    }
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 2.0,
        expected: ExpectedFigures {
            covered_px: Some(4.0 * half * half),
            ..ExpectedFigures::default()
        },
    }
}
