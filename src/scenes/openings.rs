//! Openings and thin parts: what a coarse polygon in place of many triangles would close, thicken or mix.

use super::shape::{
    FOCAL, GREEN, PX, RED, SIDE, SceneShape, WHITE, camera, camera_of, front, hull_area_px, px,
};
use super::{BuiltScene, ExpectedFigures};
use glam::DVec3;
use std::f64::consts::PI;

/// A sheet of 160 pixels in cells of a pixel, without 256 squares of 4 pixels, 10 pixels apart: all of it lies in one plane,
/// so that its thickness says nothing of the holes.
pub(super) fn pierced_sheet() -> BuiltScene {
    const PITCH: u32 = 10;
    const HOLE: u32 = 4;
    const HOLES: u32 = 16;
    let mut shape = SceneShape::default();
    let half = f64::from(PITCH * HOLES) / 2.0;
    let mut sheet = |x: u32, y: u32, [width, height]: [u32; 2]| {
        shape.sheet(
            px(f64::from(x) - half, f64::from(y) - half),
            DVec3::X * f64::from(width) * PX,
            DVec3::Y * f64::from(height) * PX,
            [width, height],
            WHITE,
        );
    };
    for j in 0..HOLES {
        // Below the holes of a row, then the bars between them.
        sheet(0, j * PITCH, [PITCH * HOLES, PITCH - HOLE]);
        for i in 0..HOLES {
            sheet(i * PITCH, (j + 1) * PITCH - HOLE, [PITCH - HOLE, HOLE]);
        }
    }
    let holes = f64::from(HOLES * HOLES * HOLE * HOLE);
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 4.0,
        expected: ExpectedFigures {
            covered_px: Some(4.0 * half * half - holes),
            ..ExpectedFigures::default()
        },
    }
}

/// 40 strips of 2.3 pixels with gaps of 1.7 pixels in one plane, in cells of a pixel.
pub(super) fn strips() -> BuiltScene {
    const STRIPS: u32 = 40;
    const WIDTH: f64 = 2.3;
    const PITCH: f64 = 4.0;
    const LENGTH: u32 = 160;
    let mut shape = SceneShape::default();
    let low = -f64::from(LENGTH) / 2.0;
    for k in 0..STRIPS {
        shape.sheet(
            px(low, low + f64::from(k) * PITCH),
            DVec3::X * f64::from(LENGTH) * PX,
            DVec3::Y * WIDTH * PX,
            [LENGTH, 2],
            WHITE,
        );
    }
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 3.0,
        expected: ExpectedFigures {
            covered_px: Some(f64::from(STRIPS * LENGTH) * WIDTH),
            ..ExpectedFigures::default()
        },
    }
}

/// 18 closed pillars of 4 pixels with gaps of 4 pixels, 144 pixels high and 4 deep; seen from the front each hides its own
/// depth but for the perspective of its sides.
pub(super) fn pillars() -> BuiltScene {
    const PILLARS: u32 = 18;
    const WIDTH: f64 = 4.0;
    let mut shape = SceneShape::default();
    let half = f64::from(PILLARS) * WIDTH;
    for k in 0..PILLARS {
        let left = 2.0 * WIDTH * f64::from(k) - half + WIDTH / 2.0;
        let back = DVec3::Z * WIDTH * PX;
        shape.block(
            px(left, -half) - back,
            px(left + WIDTH, half),
            [4, 144, 1],
            [WHITE; 4],
        );
    }
    // From far away, so that the sides of the outer ones show a tenth of a pixel at most.
    const FARTHER: f64 = 16.0;
    let distance = FARTHER * super::shape::DISTANCE;
    BuiltScene {
        mesh: shape.mesh,
        camera: camera_of(
            SIDE,
            FARTHER * FOCAL,
            DVec3::Z * distance,
            DVec3::ZERO,
            [distance - 4.0, distance + 4.0],
        ),
        threshold_px: 1.0,
        expected: ExpectedFigures {
            covered_px: Some(f64::from(PILLARS) * WIDTH * 2.0 * half),
            ..ExpectedFigures::default()
        },
    }
}

/// A closed plate of 160 pixels and a third of a pixel thick, red in front and green behind: the back is never seen.
pub(super) fn thin_foil() -> BuiltScene {
    let half = px(80.0, 80.0);
    let low = -half - DVec3::Z * PX / 3.0;
    let mut shape = SceneShape::default();
    shape.block(low, half, [80, 80, 1], [WHITE, WHITE, RED, GREEN]);
    let camera = camera(DVec3::new(2.0, 1.0, 3.0), DVec3::ZERO, [1.0, 8.0]);
    BuiltScene {
        mesh: shape.mesh,
        threshold_px: 1.0,
        expected: ExpectedFigures {
            covered_px: Some(hull_area_px(&camera, &super::shape::corners_of(low, half))),
            ..ExpectedFigures::default()
        },
        camera,
    }
}

/// A red and a green sheet that cross along the middle column of the picture, each turned by 30 degrees from facing it: left
/// of it red is in front, right of it green.
pub(super) fn crossing() -> BuiltScene {
    const CELLS: u32 = 80;
    let mut shape = SceneShape::default();
    let (sin, cos) = (PI / 6.0).sin_cos();
    let up = DVec3::Y * 160.0 * PX;
    for (turn, color) in [(-sin, RED), (sin, GREEN)] {
        let across = DVec3::new(cos, 0.0, turn) * 160.0 * PX;
        shape.sheet(-(across + up) / 2.0, across, up, [CELLS; 2], color);
    }
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 3.0,
        expected: ExpectedFigures::default(),
    }
}

/// A sheet with waves of an eightieth of its side, seen from 2 degrees above itself: every wave hides a part of the next.
pub(super) fn waves() -> BuiltScene {
    const CELLS: u32 = 160;
    const WAVES: f64 = 8.0;
    let mut shape = SceneShape::default();
    let side = 160.0 * PX;
    let height = |x: f64, z: f64| {
        let turn = 2.0 * PI * WAVES;
        side / 80.0 * (turn * x).sin() * (turn * z).cos()
    };
    let at = |i: u32, j: u32| {
        let (x, z) = (
            f64::from(i) / f64::from(CELLS),
            f64::from(j) / f64::from(CELLS),
        );
        DVec3::new((x - 0.5) * side, height(x, z), (0.5 - z) * side)
    };
    for j in 0..CELLS {
        for i in 0..CELLS {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            shape.quad([a, b, c, d], (c - a).cross(d - b), WHITE);
        }
    }
    let (sin, cos) = 2f64.to_radians().sin_cos();
    BuiltScene {
        mesh: shape.mesh,
        camera: camera(DVec3::new(0.0, sin, cos) * 4.0, DVec3::ZERO, [1.0, 8.0]),
        threshold_px: 1.0,
        expected: ExpectedFigures::default(),
    }
}
