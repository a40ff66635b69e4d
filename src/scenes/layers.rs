//! Surfaces that lie close behind one another, and many things in one pixel.

use super::shape::{
    DISTANCE, FOCAL, GREEN, PX, RED, RandomNumbers, SIDE, SceneShape, WHITE, camera_of, front,
    hull_area_px, px,
};
use super::{BuiltScene, ExpectedFigures, depth_offset};
use crate::math::camera::Camera;
use glam::DVec3;

/// Threshold of the scenes of sheets, pixels.
const THRESHOLD: f64 = 6.0;
/// Cells along a sheet, and their side in pixels. A triangle's sphere is 5.94 pixels wide: a splat at [`THRESHOLD`]. A
/// sphere around triangles of two sheets 1.5 pixels or more apart is wider than the threshold, so no node mixes them.
const CELLS: u32 = 30;
const CELL_PX: f64 = 4.2;
const SHEET_PX: f64 = CELLS as f64 * CELL_PX;
/// How much farther away than usual the eye is, with a lens as much longer: pixels keep their length, and a sphere has
/// nearly the same size everywhere in the picture.
const FARTHER: f64 = 4.0;

/// Looks at z = 0 from a direction.
fn long_lens(direction: DVec3) -> Camera {
    let distance = FARTHER * DISTANCE;
    camera_of(
        SIDE,
        FARTHER * FOCAL,
        direction * distance,
        DVec3::ZERO,
        [distance - 4.0, distance + 4.0],
    )
}

/// The depth offset of a facing splat in the plane z = 0.
fn offset() -> f64 {
    depth_offset(THRESHOLD, FARTHER * DISTANCE, FARTHER * FOCAL, 1.0, 1.0)
}

fn sheet(shape: &mut SceneShape, depth: f64, color: [u8; 3], cells: u32) {
    let side = SHEET_PX * PX;
    shape.sheet(
        px(-SHEET_PX / 2.0, -SHEET_PX / 2.0) - DVec3::Z * depth,
        DVec3::X * side,
        DVec3::Y * side,
        [cells; 2],
        color,
    );
}

/// The two sheets of a scene and what is known of them.
fn facing(shape: SceneShape, gap: f64) -> BuiltScene {
    BuiltScene {
        mesh: shape.mesh,
        camera: long_lens(DVec3::Z),
        threshold_px: THRESHOLD as f32,
        expected: ExpectedFigures {
            covered_px: Some(SHEET_PX * SHEET_PX),
            gap: Some(gap),
            color: Some([204, 0, 0]),
            ..ExpectedFigures::default()
        },
    }
}

/// A closed plate that faces the camera, red in front, green behind, white at the sides, one depth offset thick. The
/// back is hidden: it is never right to see green.
pub(super) fn thin_plate() -> BuiltScene {
    let mut shape = SceneShape::default();
    let half = px(SHEET_PX / 2.0, SHEET_PX / 2.0);
    shape.block(
        -half - DVec3::Z * offset(),
        half,
        [CELLS, CELLS, 1],
        [WHITE, WHITE, RED, GREEN],
    );
    facing(shape, 1.0)
}

/// A red sheet and a green one of the same size `gap` depth offsets behind it, both facing the camera. With splats of
/// one size and factor m, green appears if and only if the gap is below m.
fn sheets(gap: f64) -> BuiltScene {
    let mut shape = SceneShape::default();
    sheet(&mut shape, 0.0, RED, CELLS);
    sheet(&mut shape, gap * offset(), GREEN, CELLS);
    facing(shape, gap)
}

/// [`sheets`] half a depth offset apart in cells of a quarter of the size: small nodes hold parts of both.
pub(super) fn sheets_fine() -> BuiltScene {
    let mut shape = SceneShape::default();
    sheet(&mut shape, 0.0, RED, 4 * CELLS);
    sheet(&mut shape, 0.5 * offset(), GREEN, 4 * CELLS);
    facing(shape, 0.5)
}

/// [`sheets`] half a depth offset apart.
pub(super) fn sheets_half() -> BuiltScene {
    sheets(0.5)
}

/// [`sheets`] one depth offset apart.
pub(super) fn sheets_one() -> BuiltScene {
    sheets(1.0)
}

/// [`sheets`] two depth offsets apart.
pub(super) fn sheets_two() -> BuiltScene {
    sheets(2.0)
}

/// [`sheets`] four depth offsets apart.
pub(super) fn sheets_four() -> BuiltScene {
    sheets(4.0)
}

/// Two sheets two (facing) depth offsets apart, seen under 60 degrees. The distance along the ray and the offset grow by
/// the same cosine, so the tilt decides nothing.
pub(super) fn sheets_tilted() -> BuiltScene {
    let BuiltScene { mesh, .. } = sheets(2.0);
    // cos 60 = 1/2.
    let camera = long_lens(DVec3::new(0.75f64.sqrt(), 0.0, 0.5));
    let half = SHEET_PX / 2.0;
    let corners = [(-half, -half), (half, -half), (half, half), (-half, half)];
    let front = hull_area_px(&camera, &corners.map(|(x, y)| px(x, y)));
    // Both sheets span the same heights at the same x, and the shift along z moves the far sheet to one side: what it
    // adds is the parallelogram between the two edges of that side.
    let behind: [DVec3; 2] = [-half, half].map(|y| px(half, y) - DVec3::Z * (2.0 * offset()));
    let ahead: [DVec3; 2] = [-half, half].map(|y| px(half, y));
    let strip = hull_area_px(&camera, &[behind, ahead].concat());
    BuiltScene {
        mesh,
        threshold_px: THRESHOLD as f32,
        expected: ExpectedFigures {
            covered_px: Some(front + strip),
            gap: Some(2.0),
            color: Some([102, 0, 0]),
            ..ExpectedFigures::default()
        },
        camera,
    }
}

/// A red sheet and then a green copy in the same place: of equal depths the first drawn wins. The tree may order the
/// copies otherwise than the file, and a node holds parts of both.
pub(super) fn overlap() -> BuiltScene {
    let mut shape = SceneShape::default();
    sheet(&mut shape, 0.0, RED, CELLS);
    sheet(&mut shape, 0.0, GREEN, CELLS);
    let mut scene = facing(shape, 0.0);
    scene.expected.color = None;
    scene
}

/// 500 triangles of 0.008 pixels in the middle of one pixel, all of one color and facing the camera, in a depth of a
/// quarter of the offset of a splat of one pixel. At the threshold of 0.01 pixels each is a splat of its own.
pub(super) fn stack() -> BuiltScene {
    let mut shape = SceneShape::default();
    let mut random = RandomNumbers::new(500);
    let depth = 0.25 * depth_offset(1.0, DISTANCE, FOCAL, 1.0, 1.0);
    for k in 0..500 {
        let at = px(0.5 + 0.2 * random.signed(), 0.5 + 0.2 * random.signed())
            - DVec3::Z * depth * (f64::from(k) / 500.0);
        shape.triangle(
            [at, at + px(0.006, 0.0), at + px(0.0, 0.006)],
            [230, 230, 230],
        );
    }
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 0.01,
        expected: ExpectedFigures {
            squares_px: Some(1.0),
            // 0.8 * 230.
            color: Some([184; 3]),
            ..ExpectedFigures::default()
        },
    }
}
