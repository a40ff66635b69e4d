//! Capsules around what lies below a node.

use super::{Node, Strip};
use crate::math::octahedral;
use glam::{Vec3, Vec4};

/// A capsule wider than this share of the sphere's radius is not worth keeping.
const WIDEST: f32 = 0.7;

/// Corners of triangles as three lists of coordinates, so that four are worked on at once.
#[derive(Default)]
pub(super) struct Corners {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    /// Of the range at hand: distance along the direction, and squared distance from its line.
    along: Vec<Vec4>,
    across: Vec<Vec4>,
}

impl Corners {
    pub(super) fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
    }

    #[inline]
    pub(super) fn push(&mut self, corner: Vec3) {
        self.x.push(corner.x);
        self.y.push(corner.y);
        self.z.push(corner.z);
    }

    /// Calls `visit` with each corner of the range.
    #[inline]
    pub(super) fn each(&self, range: std::ops::Range<usize>, mut visit: impl FnMut(Vec3)) {
        let (x, y, z) = (
            &self.x[range.clone()],
            &self.y[range.clone()],
            &self.z[range],
        );
        for ((&x, &y), &z) in x.iter().zip(y).zip(z) {
            visit(Vec3::new(x, y, z));
        }
    }

    /// The largest distance of corners `first..end` (at least four) from the plane through `center` with the unit
    /// normal `normal`.
    pub(super) fn half_thickness(
        &self,
        first: usize,
        end: usize,
        center: Vec3,
        normal: Vec3,
    ) -> f32 {
        let (cx, cy, cz) = (
            Vec4::splat(center.x),
            Vec4::splat(center.y),
            Vec4::splat(center.z),
        );
        let (nx, ny, nz) = (
            Vec4::splat(normal.x),
            Vec4::splat(normal.y),
            Vec4::splat(normal.z),
        );
        let mut farthest = Vec4::ZERO;
        let mut at = first;
        loop {
            let start = at.min(end - 4);
            let x = Vec4::from_slice(&self.x[start..start + 4]) - cx;
            let y = Vec4::from_slice(&self.y[start..start + 4]) - cy;
            let z = Vec4::from_slice(&self.z[start..start + 4]) - cz;
            farthest = farthest.max((x * nx + y * ny + z * nz).abs());
            at += 4;
            if at >= end {
                break;
            }
        }
        farthest.max_element()
    }

    /// The capsule around corners `first..end` (at least four) along `direction`, for the sphere of `node`; and the
    /// largest distance of a corner from its center.
    pub(super) fn fit(
        &mut self,
        first: usize,
        end: usize,
        node: &Node,
        direction: Vec3,
    ) -> (Strip, f32) {
        let code = encode(direction);
        let unit = decode(code);
        let (cx, cy, cz) = (
            Vec4::splat(node.center.x),
            Vec4::splat(node.center.y),
            Vec4::splat(node.center.z),
        );
        let (ux, uy, uz) = (
            Vec4::splat(unit.x),
            Vec4::splat(unit.y),
            Vec4::splat(unit.z),
        );
        self.along.clear();
        self.across.clear();
        let (mut farthest, mut widest) = (Vec4::ZERO, Vec4::ZERO);
        let mut at = first;
        loop {
            // The last four overlap what came before: maxima do not mind.
            let start = at.min(end - 4);
            let x = Vec4::from_slice(&self.x[start..start + 4]) - cx;
            let y = Vec4::from_slice(&self.y[start..start + 4]) - cy;
            let z = Vec4::from_slice(&self.z[start..start + 4]) - cz;
            let along = x * ux + y * uy + z * uz;
            // The rejected vector itself: |p|^2 - along^2 would lose half of the digits of a thin needle.
            let (rx, ry, rz) = (x - along * ux, y - along * uy, z - along * uz);
            let across = rx * rx + ry * ry + rz * rz;
            farthest = farthest.max(x * x + y * y + z * z);
            widest = widest.max(across);
            self.along.push(along.abs());
            self.across.push(across);
            at += 4;
            if at >= end {
                break;
            }
        }
        let farthest = farthest.max_element().sqrt() * (1.0 + 1e-6);
        let radius = node.radius;
        let Some(width) = width_code(widest.max_element().sqrt(), radius) else {
            return (Strip::SPHERE, farthest);
        };
        // A corner is inside when |along| - half_length <= sqrt(width^2 - across^2). Tested without the root; few
        // corners fail once the first ones have set the length.
        let room = room(width, radius);
        let mut half_length = 0f32;
        for (along, across) in self.along.iter().zip(&self.across) {
            let beyond = (*along - half_length).max(Vec4::ZERO);
            let free = Vec4::splat(room) - *across;
            if (beyond * beyond).cmpgt(free).any() {
                for (along, across) in along.to_array().into_iter().zip(across.to_array()) {
                    half_length = half_length.max(along - (room - across).max(0.0).sqrt());
                }
            }
        }
        (pack(code, half_length, width, radius), farthest)
    }
}

/// The capsule along `direction` around balls (center, radius), for the sphere of `node`.
pub(super) fn around_balls(balls: &[(Vec3, f32)], node: &Node, direction: Vec3) -> Strip {
    let code = encode(direction);
    let unit = decode(code);
    let split = |center: Vec3| {
        let offset = center - node.center;
        let along = offset.dot(unit);
        (along.abs(), (offset - unit * along).length())
    };
    let widest = balls
        .iter()
        .map(|&(center, radius)| split(center).1 + radius)
        .fold(0.0, f32::max);
    let Some(width) = width_code(widest, node.radius) else {
        return Strip::SPHERE;
    };
    let wide = room(width, node.radius).max(0.0).sqrt();
    let mut half_length = 0f32;
    for &(center, radius) in balls {
        let (along, across) = split(center);
        let free = wide - radius;
        half_length = half_length.max(along - (free * free - across * across).max(0.0).sqrt());
    }
    pack(code, half_length, width, node.radius)
}

/// The two balls at the ends of a node's capsule, whose hull it is; or its sphere.
pub(super) fn ends(node: &Node) -> [(Vec3, f32); 2] {
    if node.strip == Strip::SPHERE {
        return [(node.center, node.radius); 2];
    }
    let unit = node.radius * (1.0 / 255.0);
    let half = node.strip.direction() * (f32::from(node.strip.half_length) * unit);
    let width = f32::from(node.strip.width) * unit;
    [(node.center - half, width), (node.center + half, width)]
}

/// Rounded-up code of a width, or `None` where the capsule is no gain.
#[inline]
fn width_code(width: f32, radius: f32) -> Option<u8> {
    // Not: radius zero, infinite, or too wide.
    if radius > 0.0 && width <= WIDEST * radius {
        // One part in a million for the rounding on the way; at least one unit.
        Some((width / radius * 255.0 + 3e-4) as u8 + 1)
    } else {
        None
    }
}

/// Square of the coded width, less what rounding may have added.
#[inline]
fn room(width: u8, radius: f32) -> f32 {
    let width = f32::from(width) * (1.0 / 255.0);
    (width * width - 4e-7) * radius * radius
}

#[inline]
fn pack(direction: [i8; 2], half_length: f32, width: u8, radius: f32) -> Strip {
    let length = half_length / radius * 255.0 + 3e-4;
    Strip {
        direction,
        // Nothing lies beyond the sphere.
        half_length: ((length as u32) + 1).min(255) as u8,
        width,
    }
}

#[inline]
fn encode(direction: Vec3) -> [i8; 2] {
    octahedral::encode(direction).map(|c| {
        let scaled = f32::from(c) * (1.0 / 258.0);
        (scaled + 0.5f32.copysign(scaled)) as i8
    })
}

#[inline]
fn decode(direction: [i8; 2]) -> Vec3 {
    Strip {
        direction,
        ..Strip::SPHERE
    }
    .direction()
}
