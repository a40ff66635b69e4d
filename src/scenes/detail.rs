//! Detail below a pixel.

use super::outline::generated;
use super::shape::{DISTANCE, PX, RandomNumbers, SceneShape, WHITE, front, px};
use super::{BuiltScene, ExpectedFigures};
use crate::generate::GeneratedShape as Generated;
use glam::DVec3;
use std::f64::consts::PI;

/// A sheet of 80 pixels in cells of half a pixel, every vertex up to half a pixel before or behind the plane. Normals
/// are computed from the facets.
pub(super) fn noise() -> BuiltScene {
    let side = 80.0 * PX;
    let mut shape = SceneShape::default();
    shape.sheet(
        px(-40.0, -40.0),
        DVec3::X * side,
        DVec3::Y * side,
        [160; 2],
        WHITE,
    );
    let mut random = RandomNumbers::new(7);
    for p in &mut shape.mesh.positions {
        p.z += (0.5 * PX * random.signed()) as f32;
    }
    shape.mesh.normals.clear();
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 1.0,
        expected: ExpectedFigures {
            covered_px: Some(6400.0),
            ..ExpectedFigures::default()
        },
    }
}

/// 5000 square leaves of three pixels in a ball of 80, in all directions, in greens.
pub(super) fn foliage() -> BuiltScene {
    let mut shape = SceneShape::default();
    let mut random = RandomNumbers::new(11);
    for _ in 0..5000 {
        let center = random.in_ball() * (80.0 * PX);
        let normal = random.in_ball().normalize_or(DVec3::Z);
        let (u, v) = normal.any_orthonormal_pair();
        let (u, v) = (u * (1.5 * PX), v * (1.5 * PX));
        let green = (170.0 + 80.0 * random.signed()) as u8;
        shape.quad(
            [
                center - u - v,
                center + u - v,
                center + u + v,
                center - u + v,
            ],
            normal,
            [green / 2, green, green / 4],
        );
    }
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 5.0,
        expected: ExpectedFigures::default(),
    }
}

/// 21 upright and 21 level ribbons of 0.4 pixels, 10.13 pixels apart, cut into pieces of half a pixel.
pub(super) fn fence() -> BuiltScene {
    const WIRES: u32 = 21;
    const WIDTH: f64 = 0.4;
    // Not a whole number, so that some wires meet pixel centers and others do not.
    const PITCH: f64 = 10.13;
    let length = f64::from(WIRES - 1) * PITCH + WIDTH;
    let mut shape = SceneShape::default();
    for k in 0..WIRES {
        let at = (f64::from(k) - f64::from(WIRES - 1) / 2.0) * PITCH;
        let low = -length / 2.0;
        let (along, across) = (length * PX, WIDTH * PX);
        shape.sheet(
            px(low, at - WIDTH / 2.0),
            DVec3::X * along,
            DVec3::Y * across,
            [400, 1],
            WHITE,
        );
        shape.sheet(
            px(at - WIDTH / 2.0, low),
            DVec3::X * across,
            DVec3::Y * along,
            [1, 400],
            WHITE,
        );
    }
    // Both directions, less what is counted twice where they cross.
    let wires = f64::from(WIRES);
    BuiltScene {
        mesh: shape.mesh,
        camera: front(),
        threshold_px: 1.0,
        expected: ExpectedFigures {
            covered_px: Some(2.0 * wires * WIDTH * length - (wires * WIDTH).powi(2)),
            ..ExpectedFigures::default()
        },
    }
}

/// A ball of radius 0.3 pixels, its center 0.4 pixels from that of the pixel: no pixel center lies in it.
pub(super) fn under_pixel() -> BuiltScene {
    let mut mesh = generated(Generated::Sphere, 20, 10);
    let center = px(0.5 + 0.35, 0.5 + 0.2).as_vec3();
    for p in &mut mesh.positions {
        *p = *p * (0.3 * PX) as f32 + center;
    }
    // The sphere's outline at its distance, and the ratio of the polygon's area to the circle's.
    let radius_px = 0.3 / (1.0 - (0.3 * PX / DISTANCE).powi(2)).sqrt();
    BuiltScene {
        mesh,
        camera: front(),
        threshold_px: 1.0,
        expected: ExpectedFigures {
            covered_px: Some(PI * radius_px * radius_px),
            squares_px: Some(1.0),
            ..ExpectedFigures::default()
        },
    }
}
