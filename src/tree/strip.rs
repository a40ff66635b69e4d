//! Capsules around what lies below a node.

use super::{Node, NodeStrip};
use crate::math::octahedral;
use glam::{Vec3, Vec4};

/// A capsule wider than this share of the sphere's radius is not worth keeping.
const WIDEST: f32 = 0.7;

/// A capsule in which a stretch longer than this share of its half length, and longer than it is wide, stands empty
/// bridges a gap. The cut makes no shorter pieces of a capsule and no narrower splats: what is shorter is within a splat.
const WIDEST_GAP: f32 = 0.125;

/// How far below a node whose corners are not at hand gaps in its capsule are looked for: up to 256 nodes.
const GAP_LEVELS: u32 = 4;

/// Which of 64 equal parts of a capsule something lies in.
struct StripOccupancy {
    bits: u64,
    /// Half the length of the capsule with its ends; parts of a unit.
    half_length: f32,
    scale: f32,
    /// Most empty parts in a row.
    most: u32,
}

impl StripOccupancy {
    /// Of a capsule as the node has it, model units.
    fn of(node: &Node, strip: NodeStrip) -> Self {
        let unit = node.radius * (1.0 / 255.0);
        let sum = u16::from(strip.half_length) + u16::from(strip.width);
        let half_length = f32::from(sum.min(255)) * unit;
        let widest = (2.0 * f32::from(strip.width) * unit).max(WIDEST_GAP * half_length);
        let scale = 32.0 / half_length;
        Self {
            bits: 0,
            half_length,
            scale,
            most: (widest * scale) as u32,
        }
    }

    /// Something from `low` to `high` along the axis, from the middle.
    #[inline]
    fn add(&mut self, low: f32, high: f32) {
        // The casts saturate: below 0 is 0.
        let part = |along: f32| (((along + self.half_length) * self.scale) as u32).min(63);
        self.bits |= (u64::MAX << part(low)) & (u64::MAX >> (63 - part(high)));
    }

    /// Tells whether so many parts in a row are empty, also at the ends, that splats along the capsule would show what is not
    /// there.
    fn has_gap(&self) -> bool {
        let mut empty = !self.bits;
        // A step shortens every run of ones by as many, up to its length so far.
        let (mut length, mut rest) = (1, self.most);
        while rest > 0 && empty != 0 {
            let step = length.min(rest);
            empty &= empty << step;
            length += step;
            rest -= step;
        }
        empty != 0
    }
}

/// Corners of triangles as three lists of coordinates, so that four are worked on at once.
#[derive(Default)]
pub(super) struct StripCorners {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    /// Of the range at hand: distance along the direction, and squared distance from its line.
    along: Vec<f32>,
    across: Vec<f32>,
}

impl StripCorners {
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
    ) -> (NodeStrip, f32) {
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
        self.along.resize(end - first, 0.0);
        self.across.resize(end - first, 0.0);
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
            along.write_to_slice(&mut self.along[start - first..]);
            across.write_to_slice(&mut self.across[start - first..]);
            at += 4;
            if at >= end {
                break;
            }
        }
        let farthest = farthest.max_element().sqrt() * (1.0 + 1e-6);
        let radius = node.radius;
        if radius <= LEAST_RADIUS {
            // Squares of such lengths vanish.
            return (NodeStrip::SPHERE, radius);
        }
        let Some(width) = width_code(widest.max_element().sqrt(), radius) else {
            return (NodeStrip::SPHERE, farthest);
        };
        // A corner is inside when |along| - half_length <= sqrt(width^2 - across^2). Tested without the root; few
        // corners fail once the first ones have set the length.
        let room = room(width, radius);
        let mut half_length = 0f32;
        let mut at = 0;
        while at < end - first {
            let start = at.min(end - first - 4);
            let along = Vec4::from_slice(&self.along[start..]).abs();
            let across = Vec4::from_slice(&self.across[start..]);
            let beyond = (along - half_length).max(Vec4::ZERO);
            if (beyond * beyond).cmpgt(Vec4::splat(room) - across).any() {
                for (along, across) in along.to_array().into_iter().zip(across.to_array()) {
                    half_length = half_length.max(along - (room - across).max(0.0).sqrt());
                }
            }
            at += 4;
        }
        let strip = pack(code, half_length, width, radius);
        let mut occupancy = StripOccupancy::of(node, strip);
        // Neighbors follow one another: where there is no gap, every eighth of many leaves none already.
        let stride = if self.along.len() > 3 * 16 { 3 * 8 } else { 3 };
        for first in (0..stride).step_by(3) {
            for at in (first..self.along.len()).step_by(stride) {
                let [a, b, c] = [0, 1, 2].map(|corner| self.along[at + corner]);
                occupancy.add(a.min(b).min(c), a.max(b).max(c));
            }
            if !occupancy.has_gap() {
                return (strip, farthest);
            }
        }
        (NodeStrip::SPHERE, farthest)
    }
}

/// The nodes on the way down from a node.
#[derive(Clone, Copy)]
pub(super) struct StripDescent<'a> {
    /// The levels below the node.
    pub(super) nodes: &'a [Node],
    /// Number of the first of them.
    pub(super) base: usize,
}

impl StripDescent<'_> {
    /// Visits the nodes `levels` below `nodes`, or the last above the leaves.
    fn visit(self, nodes: &[Node], levels: u32, visit: &mut impl FnMut(&Node)) {
        for node in nodes {
            if levels == 0 || node.has_leaves() {
                visit(node);
            } else {
                let first = node.first_child as usize - self.base;
                let end = first + usize::from(node.child_count);
                self.visit(&self.nodes[first..end], levels - 1, visit);
            }
        }
    }
}

/// The capsule along `direction` around nodes, for the sphere of their parent `node`.
pub(super) fn around(
    children: &[Node],
    descent: StripDescent,
    node: &Node,
    direction: Vec3,
) -> NodeStrip {
    let code = encode(direction);
    let unit = decode(code);
    let split = |center: Vec3| {
        let offset = center - node.center;
        let along = offset.dot(unit);
        (along, (offset - unit * along).length())
    };
    let balls = || children.iter().flat_map(ends);
    let widest = balls()
        .map(|(center, radius)| split(center).1 + radius)
        .fold(0.0, f32::max);
    let Some(width) = width_code(widest, node.radius) else {
        return NodeStrip::SPHERE;
    };
    let wide = room(width, node.radius).max(0.0).sqrt();
    let mut half_length = 0f32;
    for (center, radius) in balls() {
        let (along, across) = split(center);
        let free = wide - radius;
        half_length =
            half_length.max(along.abs() - (free * free - across * across).max(0.0).sqrt());
    }
    let strip = pack(code, half_length, width, node.radius);
    let mut occupancy = StripOccupancy::of(node, strip);
    descent.visit(children, GAP_LEVELS - 1, &mut |part| {
        let [one, two] = ends(part).map(|(center, radius)| {
            let along = split(center).0;
            (along - radius, along + radius)
        });
        occupancy.add(one.0.min(two.0), one.1.max(two.1));
    });
    if occupancy.has_gap() {
        NodeStrip::SPHERE
    } else {
        strip
    }
}

/// The two balls at the ends of a node's capsule, whose hull it is; or its sphere.
pub(super) fn ends(node: &Node) -> [(Vec3, f32); 2] {
    if node.strip == NodeStrip::SPHERE {
        return [(node.center, node.radius); 2];
    }
    let unit = node.radius * (1.0 / 255.0);
    let half = node.strip.direction() * (f32::from(node.strip.half_length) * unit);
    let width = f32::from(node.strip.width) * unit;
    [(node.center - half, width), (node.center + half, width)]
}

/// Rounded-up code of a width, or `None` where the capsule is no gain.
/// Least radius of a node with a capsule: the square of a 255th of it is above the smallest normal number.
const LEAST_RADIUS: f32 = 1e-16;

#[inline]
fn width_code(width: f32, radius: f32) -> Option<u8> {
    // Not: radius so small that its square is no number of full precision, infinite, or too wide.
    if radius > LEAST_RADIUS && width <= WIDEST * radius {
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
fn pack(direction: [i8; 2], half_length: f32, width: u8, radius: f32) -> NodeStrip {
    let length = half_length / radius * 255.0 + 3e-4;
    NodeStrip {
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
    NodeStrip {
        direction,
        ..NodeStrip::SPHERE
    }
    .direction()
}
