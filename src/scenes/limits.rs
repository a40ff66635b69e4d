//! Limits: of devices, of the view, of numbers, and of how little a model can be.

use super::outline::generated;
use super::shape::{FOCAL, SIDE, SceneShape, WHITE, camera, front, px};
use super::{BuiltScene, ExpectedFigures};
use crate::generate::{self, GeneratedShape as Generated, ShapeSpec};
use crate::math::camera::Camera;
use crate::mesh::Mesh;
use glam::{DVec3, Vec3};

/// A thousand points in one place, the center of a pixel: no other place, so no spacing, and one square of the
/// threshold's size.
pub(super) fn coincident_points() -> BuiltScene {
    let mut shape = SceneShape::default();
    for _ in 0..1000 {
        shape.vertex(px(0.5, 0.5), DVec3::Z, WHITE);
    }
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 5.0,
        expected: ExpectedFigures {
            squares_px: Some(25.0),
            color: Some([204; 3]),
            ..ExpectedFigures::default()
        },
    }
}

/// A lattice of 41 x 41 points three pixels apart, each three times, the middle one 100 times. The square of 120 pixels
/// between them has to be whole.
pub(super) fn duplicate_points() -> BuiltScene {
    let mut shape = SceneShape::default();
    for j in -20..=20 {
        for i in -20..=20 {
            let copies = if i == 0 && j == 0 { 100 } else { 3 };
            for _ in 0..copies {
                let at = px(3.0 * f64::from(i), 3.0 * f64::from(j));
                shape.vertex(at, DVec3::Z, WHITE);
            }
        }
    }
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 1.0,
        expected: ExpectedFigures {
            color: Some([204; 3]),
            ..ExpectedFigures::default()
        },
    }
}

/// Nine points 100 pixels apart. The sixth neighbor of the middle one is at 141 pixels, so its square has a side of 283
/// pixels; those of the others are larger.
pub(super) fn near_points() -> BuiltScene {
    let mut shape = SceneShape::default();
    for j in -1..=1 {
        for i in -1..=1 {
            let color = [i, j].map(|k: i32| (155 + 100 * k) as u8);
            let color = [color[0], color[1], 128];
            let at = px(100.0 * f64::from(i), 100.0 * f64::from(j));
            shape.vertex(at, DVec3::Z, color);
        }
    }
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 1.0,
        expected: ExpectedFigures {
            squares_px: Some(f64::from(SIDE * SIDE)),
            ..ExpectedFigures::default()
        },
    }
}

/// A triangle of 6 pixels left of the picture, the center of its sphere 5 pixels from the border. Of its square of 40
/// pixels 15 columns are in the picture.
pub(super) fn beside_view() -> BuiltScene {
    let mut shape = SceneShape::default();
    shape.triangle([px(-128.0, -3.0), px(-122.0, -3.0), px(-128.0, 3.0)], WHITE);
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 40.0,
        expected: ExpectedFigures {
            covered_px: Some(0.0),
            squares_px: Some(15.0 * 40.0),
            ..ExpectedFigures::default()
        },
    }
}

/// A plane tilted by 60 degrees about the y axis through depth 1; near plane 0.8. At x pixels from the center the depth
/// is 1 / (1 + tan 60 x / f), so the surface ends at x = f (1/0.8 - 1) / tan 60.
pub(super) fn near_plane() -> BuiltScene {
    let (sin, cos) = (0.75f64.sqrt(), 0.5);
    // Toward the viewer as x grows.
    let u = DVec3::new(cos, 0.0, sin);
    let mut shape = SceneShape::default();
    shape.sheet(
        DVec3::NEG_Z - u * 9.0 - DVec3::Y * 5.0,
        u * 11.0,
        DVec3::Y * 10.0,
        [110, 100],
        WHITE,
    );
    let near = 0.8;
    let end = FOCAL * (1.0 / near - 1.0) / (sin / cos);
    let side = f64::from(SIDE);
    BuiltScene {
        mesh: shape.mesh,
        camera: camera(DVec3::ZERO, DVec3::NEG_Z, [near, 50.0]),
        threshold_px: 8.0,
        expected: ExpectedFigures {
            covered_px: Some((side / 2.0 + end) * side),
            color: Some([102; 3]),
            ..ExpectedFigures::default()
        },
    }
}

/// The eye in the unit sphere, which is closed and faces outward. Without culling it covers every pixel.
pub(super) fn inside() -> BuiltScene {
    BuiltScene {
        mesh: generated(Generated::Sphere, 160, 80),
        camera: camera(
            DVec3::new(0.2, 0.1, 0.3),
            DVec3::new(0.0, 0.0, -1.0),
            [0.05, 3.0],
        ),
        threshold_px: 6.0,
        expected: ExpectedFigures {
            covered_px: Some(f64::from(SIDE * SIDE)),
            ..ExpectedFigures::default()
        },
    }
}

/// The small statue about zero.
fn statue() -> Mesh {
    match ShapeSpec::with_triangles(Generated::Statue, 12_000) {
        Ok(spec) => generate::mesh(&spec),
        Err(error) => unreachable!("a small statue: {error}"),
    }
}

/// Looks at the statue of a size at a place.
fn statue_camera(center: DVec3, scale: f64) -> Camera {
    camera(
        center + DVec3::new(1.0, 0.8, 4.0) * scale,
        center,
        [1.5 * scale, 8.0 * scale],
    )
}

/// The statue at coordinates of a map projection. The mesh has an origin of its own, as readers give it.
pub(super) fn georeferenced() -> BuiltScene {
    let origin = DVec3::new(4_512_345.25, 1_234.5, 5_267_890.75);
    BuiltScene {
        mesh: Mesh { origin, ..statue() },
        camera: statue_camera(origin, 1.0),
        threshold_px: 3.0,
        expected: ExpectedFigures::default(),
    }
}

/// The statue a million times smaller.
pub(super) fn microscopic() -> BuiltScene {
    let mut mesh = statue();
    for p in &mut mesh.positions {
        *p *= 1e-6;
    }
    BuiltScene {
        mesh,
        camera: statue_camera(DVec3::ZERO, 1e-6),
        threshold_px: 3.0,
        expected: ExpectedFigures::default(),
    }
}

/// A right triangle with legs of 120 pixels.
pub(super) fn one_triangle() -> BuiltScene {
    let mut shape = SceneShape::default();
    shape.triangle([px(-60.0, -60.0), px(60.0, -60.0), px(-60.0, 60.0)], WHITE);
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 1.0,
        expected: ExpectedFigures {
            covered_px: Some(7200.0),
            ..ExpectedFigures::default()
        },
    }
}

/// A point in the center of a pixel.
pub(super) fn one_point() -> BuiltScene {
    BuiltScene {
        mesh: Mesh {
            positions: vec![px(0.5, 0.5).as_vec3()],
            normals: vec![Vec3::Z],
            ..Mesh::default()
        },
        camera: front(),
        threshold_px: 5.0,
        expected: ExpectedFigures {
            squares_px: Some(25.0),
            color: Some([204; 3]),
            ..ExpectedFigures::default()
        },
    }
}

/// No vertex and no triangle.
pub(super) fn empty() -> BuiltScene {
    BuiltScene {
        mesh: Mesh::default(),
        camera: front(),
        threshold_px: 1.0,
        expected: ExpectedFigures {
            covered_px: Some(0.0),
            squares_px: Some(0.0),
            ..ExpectedFigures::default()
        },
    }
}
