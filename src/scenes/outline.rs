//! Outlines: rims, edges, horizons, sheets from the side and from behind.

use super::shape::{
    BLUE, DISTANCE, FOCAL, GREEN, PX, RED, SIDE, SceneShape, WHITE, camera, camera_of, corners_of,
    front, hull_area_px, px,
};
use super::{BuiltScene, ExpectedFigures};
use crate::generate::{self, GeneratedShape as Generated, ShapeSpec};
use crate::mesh::Mesh;
use glam::DVec3;
use std::f64::consts::PI;

/// A generated grid. The sizes here are constants that fit.
pub(super) fn generated(shape: Generated, columns: u32, rows: u32) -> Mesh {
    match ShapeSpec::with_grid(shape, columns, rows) {
        Ok(spec) => generate::mesh(&spec),
        Err(error) => unreachable!("a grid of {columns} x {rows}: {error}"),
    }
}

/// The unit sphere at distance 3, 500 x 500 pixels, 60 degrees: radius f/sqrt(8) = 153.093 px, area f² pi/8 px². Its
/// depth at the center is 2, and the normal of every pixel follows from the ray.
pub(super) fn silhouette() -> BuiltScene {
    let focal = 250.0 * 3f64.sqrt();
    BuiltScene {
        mesh: generated(Generated::Sphere, 200, 100),
        camera: camera_of(
            500,
            focal,
            DVec3::new(0.0, 0.0, 3.0),
            DVec3::ZERO,
            [1.0, 5.0],
        ),
        threshold_px: 8.0,
        expected: ExpectedFigures {
            covered_px: Some(PI * focal * focal / 8.0),
            color: Some([204; 3]),
            ..ExpectedFigures::default()
        },
    }
}

/// The plane y = 0 from height 1, from distance 1 (below the picture) to 101, in a checkerboard of cells half a unit
/// deep. The far edge lies f/101 pixels below the middle.
pub(super) fn horizon() -> BuiltScene {
    const ROWS: u32 = 200;
    const COLUMNS: u32 = 120;
    let mut shape = SceneShape::default();
    let at = |i: u32, j: u32| {
        let z = 1.0 + 0.5 * f64::from(j);
        // Beyond the borders of the picture, which are at 0.5 z.
        let x = (f64::from(i) / f64::from(COLUMNS) - 0.5) * 1.5 * z;
        DVec3::new(x, 0.0, -z)
    };
    for j in 0..ROWS {
        for i in 0..COLUMNS {
            let level = if (i + j) % 2 == 0 { 40 } else { 230 };
            shape.quad(
                [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)],
                DVec3::Y,
                [level; 3],
            );
        }
    }
    let side = f64::from(SIDE);
    BuiltScene {
        mesh: shape.mesh,
        camera: camera(DVec3::Y, DVec3::Y - DVec3::Z, [0.5, 150.0]),
        threshold_px: 4.0,
        expected: ExpectedFigures {
            covered_px: Some(side * (side / 2.0 - FOCAL / 101.0)),
            ..ExpectedFigures::default()
        },
    }
}

/// A cube of half side 0.7 with 24 x 24 cells a face, three faces in view, one color an axis. It covers the hull of its
/// corners.
pub(super) fn cube_edge() -> BuiltScene {
    let half = DVec3::splat(0.7);
    let mut shape = SceneShape::default();
    shape.block(-half, half, [24; 3], [RED, GREEN, BLUE, BLUE]);
    let camera = camera(DVec3::new(2.4, 1.8, 2.6), DVec3::ZERO, [1.0, 8.0]);
    BuiltScene {
        mesh: shape.mesh,
        threshold_px: 8.0,
        expected: ExpectedFigures {
            covered_px: Some(hull_area_px(&camera, &corners_of(-half, half))),
            ..ExpectedFigures::default()
        },
        camera,
    }
}

/// The unit cube around zero with eight vertices, whose normals point along the diagonals, from (3, -2.9, -2.9). The
/// normal of vertex (1/2, 1/2, 1/2) faces away from that eye, and the face +x with that vertex is in full view.
pub(super) fn cube_corner() -> BuiltScene {
    let half = DVec3::splat(0.5);
    let corners = corners_of(-half, half);
    let mut shape = SceneShape::default();
    for corner in corners {
        shape.vertex(corner, corner, WHITE);
    }
    for [a, b, c, d] in [
        [1, 3, 7, 5],
        [0, 4, 6, 2],
        [2, 6, 7, 3],
        [0, 1, 5, 4],
        [4, 5, 7, 6],
        [0, 2, 3, 1],
    ] {
        shape.mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    let camera = camera(DVec3::new(3.0, -2.9, -2.9), DVec3::ZERO, [1.0, 10.0]);
    BuiltScene {
        mesh: shape.mesh,
        threshold_px: 4.0,
        expected: ExpectedFigures {
            covered_px: Some(hull_area_px(&camera, &corners)),
            ..ExpectedFigures::default()
        },
        camera,
    }
}

/// A red cube of 12 triangles on a green pedestal of 70 x 70 cells. Where they meet, triangles and splats of the same
/// depth lie side by side.
pub(super) fn pedestal() -> BuiltScene {
    let mut shape = SceneShape::default();
    shape.block(
        DVec3::new(-1.0, -0.3, -1.0),
        DVec3::new(1.0, 0.0, 1.0),
        [70, 4, 70],
        [GREEN; 4],
    );
    shape.block(
        DVec3::new(-0.4, 0.0, -0.4),
        DVec3::new(0.4, 0.8, 0.4),
        [1; 3],
        [RED; 4],
    );
    BuiltScene {
        mesh: shape.mesh,
        camera: camera(
            DVec3::new(1.8, 1.6, 3.2),
            DVec3::new(0.0, 0.15, 0.0),
            [1.0, 8.0],
        ),
        threshold_px: 6.0,
        expected: ExpectedFigures::default(),
    }
}

/// A statue of 18,252 triangles on a plinth of 12: where the few points of the plinth are as large as the statue.
pub(super) fn statue_on_plinth() -> BuiltScene {
    let statue = generated(Generated::Statue, 39, 39);
    let mut shape = SceneShape::default();
    shape.block(
        DVec3::new(-0.7, -1.9, -0.7),
        DVec3::new(0.7, -1.3, 0.7),
        [1; 3],
        [WHITE; 4],
    );
    let first = shape.mesh.positions.len() as u32;
    shape.mesh.colors.resize(
        shape.mesh.positions.len() + statue.positions.len(),
        [255; 4],
    );
    shape.mesh.positions.extend(statue.positions);
    shape.mesh.normals.extend(statue.normals);
    let moved = |corners: [u32; 3]| corners.map(|corner| first + corner);
    shape
        .mesh
        .triangles
        .extend(statue.triangles.into_iter().map(moved));
    BuiltScene {
        mesh: shape.mesh,
        camera: camera(
            DVec3::new(2.6, 0.9, 5.4),
            DVec3::new(0.0, -0.2, 0.0),
            [2.0, 10.0],
        ),
        threshold_px: 3.0,
        expected: ExpectedFigures::default(),
    }
}

/// A square sheet of 120 pixels that faces away from the camera.
pub(super) fn open_behind() -> BuiltScene {
    let side = 120.0 * PX;
    let mut shape = SceneShape::default();
    shape.sheet(
        px(60.0, -60.0),
        DVec3::NEG_X * side,
        DVec3::Y * side,
        [60; 2],
        WHITE,
    );
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 3.0,
        expected: ExpectedFigures {
            covered_px: Some(14_400.0),
            color: Some([204; 3]),
            ..ExpectedFigures::default()
        },
    }
}

/// A square in the plane y = 0, in which the eye lies.
pub(super) fn edge_on() -> BuiltScene {
    let side = 120.0 * PX;
    let mut shape = SceneShape::default();
    shape.sheet(
        DVec3::new(-side / 2.0, 0.0, side / 2.0),
        DVec3::X * side,
        DVec3::NEG_Z * side,
        [60; 2],
        WHITE,
    );
    let eye = DVec3::new(0.0, 0.0, DISTANCE);
    BuiltScene {
        mesh: shape.mesh,
        camera: camera(eye, DVec3::ZERO, [1.0, 8.0]),
        threshold_px: 6.0,
        expected: ExpectedFigures {
            covered_px: Some(0.0),
            ..ExpectedFigures::default()
        },
    }
}
