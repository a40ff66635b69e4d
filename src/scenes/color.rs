//! Colors and normals whose mean is not what a sample shows.

use super::shape::{DISTANCE, PX, SceneShape, WHITE, camera, front, px};
use super::{BuiltScene, ExpectedFigures};
use glam::DVec3;

/// A sheet tilted by 60 degrees whose cells have the normals n and -n in turn. Lit from both sides it has the grey
/// 0.8 cos 60 = 102; the sum of the normals of a node vanishes.
pub(super) fn opposite_normals() -> BuiltScene {
    let side = 120.0 * PX;
    let mut shape = SceneShape::default();
    shape.tiles(
        px(-60.0, -60.0),
        DVec3::X * side,
        DVec3::Y * side,
        [60; 2],
        |i, j| (WHITE, if (i + j) % 2 == 0 { 1.0 } else { -1.0 }),
    );
    let eye = DVec3::new(0.75f64.sqrt(), 0.0, 0.5) * DISTANCE;
    BuiltScene {
        mesh: shape.mesh,
        camera: camera(eye, DVec3::ZERO, [1.0, 2.0 * DISTANCE]),
        threshold_px: 6.0,
        expected: ExpectedFigures {
            color: Some([102; 3]),
            ..ExpectedFigures::default()
        },
    }
}

/// A lattice of points three pixels apart with normals that are zero: lit as if they faced the light, 204 everywhere.
pub(super) fn zero_normals() -> BuiltScene {
    let mut shape = SceneShape::default();
    for j in -20..=20 {
        for i in -20..=20 {
            let at = px(3.0 * f64::from(i), 3.0 * f64::from(j));
            shape.vertex(at, DVec3::ZERO, WHITE);
        }
    }
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 3.0,
        expected: ExpectedFigures {
            color: Some([204; 3]),
            ..ExpectedFigures::default()
        },
    }
}

/// A board of 60 pixels in 128 x 128 black and white cells, 0.47 pixels each. The mean of a pixel is the gray 102; its single sample
/// is black or white.
pub(super) fn checkerboard() -> BuiltScene {
    let side = 60.0 * PX;
    let mut shape = SceneShape::default();
    shape.tiles(
        px(-30.0, -30.0),
        DVec3::X * side,
        DVec3::Y * side,
        [128; 2],
        |i, j| (if (i + j) % 2 == 0 { [0; 3] } else { WHITE }, 1.0),
    );
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 1.0,
        expected: ExpectedFigures {
            covered_px: Some(3600.0),
            color: Some([102; 3]),
            ..ExpectedFigures::default()
        },
    }
}
