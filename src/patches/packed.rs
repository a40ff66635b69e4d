//! The record in 36 bytes, and colors in 12 more, relative to the ball of the node.
//!
//! The pass `lists.patches` unpacks records on the device, in the same steps: only sums, products, quotients and roots, which
//! round alike there.
//!
//! Every bound is rounded to the safe side: lengths and residuals up, what is cut off corners down; the footprint is that of the
//! full record and a little more. The plane's normal is exact, since records are made with normals of 2 x 12 bit; so is the
//! direction of the rectangle.

use super::footprint::{self, SIGNS, TURNS};
use super::record::{NodePatch, NodePatches, RESIDUAL_LEVELS};
use crate::abi::OrientedPolygon;
use crate::abi::constants::{
    LARGEST_PATCH_LENGTH, PATCH_SIDE_STEP, ROOT_2, ROOT_4, ROOT_8, ROOT_16,
};
use crate::tree::{Model, Node, PackedPatch, PackedPatchColors, PatchRecords};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Lengths are stored as logarithms, in sixteenths of an octave below this share of the radius.
const LARGEST: f32 = LARGEST_PATCH_LENGTH;

/// Units of the middle of a footprint, and of its height, in a radius.
const PLACE_UNITS: f32 = 32767.0;

/// Units of half sides in the largest of them, of which each is [`PATCH_SIDE_STEP`] radii.
const SIDE_UNITS: f32 = 65535.0;

/// By how much a footprint is wider than what it holds, in radii.
const ROUNDING_ROOM: f32 = 1.0 / 4096.0;

/// Units of cuts of corners in a half side.
const CUT_UNITS: f32 = 255.0;

/// Largest tangent of the shading normal and the plane's.
const STEEPEST: f32 = 2.0;

/// Largest value of 12 bits with a sign.
const UNIT_12: f32 = 2047.0;

/// A unit vector that 2 x 12 bits hold exactly, near another one.
pub(super) fn rounded_normal(normal: Vec3) -> Vec3 {
    decode_12(encode_12(normal))
}

fn encode_12(v: Vec3) -> u32 {
    let norm = v.x.abs() + v.y.abs() + v.z.abs();
    if !(norm > 0.0 && norm.is_finite()) {
        return 0;
    }
    let p = v / norm;
    let (x, y) = if p.z >= 0.0 {
        (p.x, p.y)
    } else {
        (
            (1.0 - p.y.abs()).copysign(p.x),
            (1.0 - p.x.abs()).copysign(p.y),
        )
    };
    bits_12(x) | bits_12(y) << 12
}

fn decode_12(code: u32) -> Vec3 {
    let (x, y) = (value_12(code), value_12(code >> 12));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let unfolded = Vec3::new(x - fold.copysign(x), y - fold.copysign(y), z);
    // What rounding leaves next to an edge of the octahedron has no sign: it would be packed beyond the edge.
    let clean = |c: f32| if c.abs() < 1e-6 { 0.0 } else { c };
    Vec3::new(clean(unfolded.x), clean(unfolded.y), clean(unfolded.z)).normalize_or(Vec3::Z)
}

/// A value of -1 to 1 in 12 bits, to the nearest.
fn bits_12(value: f32) -> u32 {
    ((value.clamp(-1.0, 1.0) * UNIT_12).round() as i32 & 0xfff) as u32
}

fn value_12(bits: u32) -> f32 {
    let signed = (bits << 20) as i32 >> 20;
    (signed as f32 / UNIT_12).max(-1.0)
}

/// Sixteenths of an octave below `largest`, rounded up; 255 for what is larger.
fn log_up(value: f32, largest: f32) -> u8 {
    // A little more, for the rounding of logarithms and powers.
    let below = -16.0 * (value * 1.000_01 / largest).log2();
    if below.is_nan() {
        255
    } else {
        (255.0 - below).ceil().clamp(0.0, 255.0) as u8
    }
}

/// The value of a logarithm.
fn power(code: u8, largest: f32) -> f32 {
    let sixteenths = i32::from(code) - 255;
    let mut value = largest * power_of_two(sixteenths >> 4);
    for (bit, root) in [(8, ROOT_2), (4, ROOT_4), (2, ROOT_8), (1, ROOT_16)] {
        if sixteenths & bit != 0 {
            value *= root;
        }
    }
    value
}

/// A power of two that is a normal number; the nearest such one.
fn power_of_two(exponent: i32) -> f32 {
    f32::from_bits(((exponent.clamp(-126, 127) + 127) as u32) << 23)
}

/// The exponent from which on a value has room in seven bits.
pub(super) fn exponent_of(largest: f32) -> i8 {
    let bits = (largest.max(1e-30) * 1.001_001).to_bits();
    let rounded_up = (bits >> 23) as i32 - 127 + i32::from(bits & 0x007f_ffff != 0);
    rounded_up.clamp(-100, 100) as i8
}

pub(super) fn bits_7(value: f32, exponent: i8) -> i8 {
    (value * power_of_two(-i32::from(exponent)) * 127.0)
        .round()
        .clamp(-127.0, 127.0) as i8
}

fn value_7(bits: i8, exponent: i8) -> f32 {
    f32::from(bits) / 127.0 * power_of_two(exponent.into())
}

impl PatchRecords {
    /// Packs the records of a model.
    pub fn new(model: &Model, patches: &NodePatches) -> Self {
        let nodes = model.tree.nodes.par_iter().zip(&patches.records);
        let colored = nodes.clone().filter(|_| model.has_colors);
        Self {
            records: (nodes.with_min_len(1024))
                .map(|(node, patch)| PackedPatch::new(node, patch))
                .collect(),
            colors: colored
                .map(|(node, patch)| PackedPatchColors::new(node, patch))
                .collect(),
        }
    }

    /// The polygon of a node that [`PatchRecords::record`] finds may be drawn.
    pub(crate) fn polygon(&self, index: usize, node: &Node) -> OrientedPolygon {
        let record = self.records.get(index);
        let shown = record.map(|own| own.unpack_shown(node, self.colors.get(index)));
        shown.unwrap_or_default().polygon()
    }

    /// The record of a node; one that never is a patch where there is none, or where what was read makes no sense.
    pub fn record(&self, index: usize, node: &Node) -> NodePatch {
        let Some(record) = self.records.get(index) else {
            return NodePatch::default();
        };
        let patch = record.unpack(node, self.colors.get(index));
        match patch.is_finite() {
            true => patch,
            false => NodePatch::default(),
        }
    }
}

impl PackedPatch {
    /// Packs the record of a node. The plane's normal must be of the builder.
    pub fn new(node: &Node, patch: &NodePatch) -> Self {
        let m = patch.mean_normal;
        let tangents = m.truncate() / m.z;
        let radius = node.radius;
        let is_usable = patch.may_be_drawn() && radius > 0.0 && m.z > 0.0;
        if !is_usable
            || tangents.is_nan()
            || tangents.abs().max_element() > STEEPEST
            || patch.thickness > radius * LARGEST
        {
            return Self::never();
        }
        let code = encode_12(patch.normal);
        let first = decode_12(code).any_orthonormal_vector();
        let second = decode_12(code).cross(first);
        let angle = patch.axis.dot(second).atan2(patch.axis.dot(first));
        let steps = angle * (f32::from(TURNS) / std::f32::consts::FRAC_PI_2);
        let turn = (steps.round() as i32).clamp(0, i32::from(TURNS) - 1) as u32;
        let plane = code | turn << 24;
        let (normal, axis) = axes(plane);
        let across = normal.cross(axis);
        let offset = patch.origin - node.center;
        let along = |direction: Vec3| offset.dot(direction) / radius;
        let whole = |value: f32, unit: f32| (value.clamp(-1.0, 1.0) * unit).round();
        let height = whole(along(normal), PLACE_UNITS);
        let middle = [axis, across].map(|side| whole(along(side), PLACE_UNITS));
        // What the middle was moved by comes on top, and room for the rounding of pictures: two patches of a plane share
        // their side.
        let moved = Vec2::new(
            along(axis) - middle[0] / PLACE_UNITS,
            along(across) - middle[1] / PLACE_UNITS,
        );
        let sides = patch.half_extents / radius + moved.abs() + Vec2::splat(ROUNDING_ROOM);
        let half_extents = [sides.x, sides.y].map(|side| {
            let units = (side / PATCH_SIDE_STEP).ceil();
            units.clamp(1.0, SIDE_UNITS) as u16
        });
        let half = half_extents.map(|side| f32::from(side) * PATCH_SIDE_STEP);
        let cuts = packed_cuts(patch, radius, moved, Vec2::from_array(half));
        let raised = (along(normal) - height / PLACE_UNITS).abs() * radius;
        let tangents = [tangents.x, tangents.y].map(|t| bits_12(t / STEEPEST));
        let tangents = tangents[0] | tangents[1] << 12;
        let shape = patch.shape.map(|s| s * radius / m.z);
        let shape_exponent = exponent_of(shape.into_iter().fold(0.0, |a, b| a.max(b.abs())));
        let largest = patch.residuals.into_iter().fold(0.0, f32::max);
        let residual = log_up(largest, 2.0);
        let mut word = u32::from(patch.flags & 15) << 20;
        for (level, value) in patch.residuals.into_iter().enumerate() {
            let below = 4.0 * (power(residual, 2.0) / value.max(1e-9)).log2() - 1e-4;
            word |= (below.floor().clamp(0.0, 15.0) as u32) << (4 * level);
        }
        let [a, b, c, _] = word.to_le_bytes();
        let [t0, t1, t2, _] = tangents.to_le_bytes();
        let room = radius * 1e-6;
        Self {
            plane,
            height: height as i16,
            middle: middle.map(|m| m as i16),
            half_extents,
            unused: 0,
            cuts,
            thickness: log_up((patch.thickness + raised + room) / radius, LARGEST),
            overhang: log_up((patch.overhang + raised + room) / radius, LARGEST),
            tangents: [t0, t1, t2],
            sigma: (patch.sigma * 255.0).round().clamp(0.0, 255.0) as u8,
            shape: shape.map(|s| bits_7(s, shape_exponent)),
            shape_exponent,
            residual,
            residuals_and_flags: [a, b, c],
            largest_residual: log_up(patch.largest_residual, 2.0),
            half_angle: (patch.half_angle * (254.0 / NodePatch::WIDEST))
                .ceil()
                .clamp(0.0, 255.0) as u8,
        }
    }

    /// The record, with colors where there are any.
    pub fn unpack(&self, node: &Node, colors: Option<&PackedPatchColors>) -> NodePatch {
        let [a, b, c] = self.residuals_and_flags;
        let word = u32::from_le_bytes([a, b, c, 0]);
        let flags = (word >> 20) as u8;
        if flags & Self::NEVER != 0 {
            return NodePatch::default();
        }
        let mut residuals = [power(self.residual, 2.0); RESIDUAL_LEVELS];
        for (level, residual) in residuals.iter_mut().enumerate() {
            let below = word >> (4 * level) & 15;
            *residual *= (-0.25 * below as f32).exp2();
        }
        NodePatch {
            overhang: if self.overhang == 255 {
                f32::INFINITY
            } else {
                power(self.overhang, LARGEST) * node.radius
            },
            residuals,
            largest_residual: power(self.largest_residual, 2.0),
            half_angle: f32::from(self.half_angle) * (NodePatch::WIDEST / 254.0),
            flags,
            ..self.unpack_shown(node, colors)
        }
    }

    /// The part of the record that is drawn: all but overhang, residuals, half angle and flags.
    fn unpack_shown(&self, node: &Node, colors: Option<&PackedPatchColors>) -> NodePatch {
        let radius = node.radius;
        let (normal, axis) = axes(self.plane);
        let across = normal.cross(axis);
        let [u, v] = self.middle.map(|m| f32::from(m) / PLACE_UNITS);
        let origin = node.center
            + (axis * u + across * v + normal * (f32::from(self.height) / PLACE_UNITS)) * radius;
        let [t0, t1, t2] = self.tangents;
        let tangents = u32::from_le_bytes([t0, t1, t2, 0]);
        let mut patch = NodePatch {
            origin,
            normal,
            axis,
            half_extents: Vec2::from_array(self.half_extents.map(f32::from))
                * PATCH_SIDE_STEP
                * radius,
            corner_cuts: self.cuts.map(|cut| f32::from(cut) / CUT_UNITS),
            thickness: power(self.thickness, LARGEST) * radius,
            mean_normal: Vec3::new(
                value_12(tangents) * STEEPEST,
                value_12(tangents >> 12) * STEEPEST,
                1.0,
            ),
            shape: self.shape.map(|s| value_7(s, self.shape_exponent) / radius),
            sigma: f32::from(self.sigma) / 255.0,
            ..NodePatch::default()
        };
        if let Some(colors) = colors {
            colors.unpack(node, &mut patch);
        }
        patch
    }
}

impl PackedPatchColors {
    /// Packs the colors of a record.
    pub fn new(node: &Node, patch: &NodePatch) -> Self {
        let gradient = patch.color_gradient.map(|g| g * node.radius);
        let largest = gradient[0].abs().max(gradient[1].abs()).max_element();
        let exponent = exponent_of(largest);
        let byte = |value: f32| (value * 255.0).round().clamp(0.0, 255.0) as u8;
        Self {
            color: patch.color.to_array().map(byte),
            residual: (patch.color_residual * 255.0).ceil().clamp(0.0, 255.0) as u8,
            gradient: gradient.map(|g| g.to_array().map(|value| bits_7(value, exponent))),
            gradient_exponent: exponent,
            unused: 0,
        }
    }

    fn unpack(&self, node: &Node, patch: &mut NodePatch) {
        patch.color = Vec3::from_array(self.color.map(|c| f32::from(c) / 255.0));
        patch.color_residual = f32::from(self.residual) / 255.0;
        let exponent = self.gradient_exponent;
        patch.color_gradient = (self.gradient)
            .map(|g| Vec3::from_array(g.map(|value| value_7(value, exponent))) / node.radius);
    }
}

/// Geometry of a record as it is once it is packed. The overhang is measured on this: it is what is drawn.
pub(super) fn rounded(node: &Node, patch: &NodePatch) -> NodePatch {
    PackedPatch::new(node, patch).unpack(node, None)
}

/// Normal and axis of a plane.
fn axes(plane: u32) -> (Vec3, Vec3) {
    let normal = decode_12(plane);
    let first = normal.any_orthonormal_vector();
    let turn = footprint::direction((plane >> 24) as u8);
    (normal, first * turn.x + normal.cross(first) * turn.y)
}

/// What can be cut off the corners of a moved and widened rectangle, in radii, so that the old footprint stays inside.
fn packed_cuts(patch: &NodePatch, radius: f32, moved: Vec2, half: Vec2) -> [u8; 4] {
    let (corners, count) = patch.corners();
    let mut reach = [f32::NEG_INFINITY; 4];
    for &corner in &corners[..count] {
        let at = (corner / radius + moved) / half;
        for (reach, sign) in reach.iter_mut().zip(SIGNS) {
            *reach = reach.max(at.dot(sign));
        }
    }
    reach.map(|reach| {
        let units = (2.0 - reach - 2.0 * ROUNDING_ROOM) * CUT_UNITS;
        units.floor().clamp(0.0, CUT_UNITS) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_have_the_sizes_that_are_stated() {
        assert_eq!(size_of::<PackedPatch>(), 36);
        assert_eq!(size_of::<PackedPatchColors>(), 12);
    }

    #[test]
    fn rounded_normals_stay_as_they_are() {
        let mut state = 1u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((state >> 40) as f32) / (1u64 << 23) as f32 - 1.0
        };
        for _ in 0..100_000 {
            let v = Vec3::new(random(), random(), random()).normalize_or(Vec3::X);
            let once = rounded_normal(v);
            assert!(once.dot(v) > 1.0 - 1e-6, "{v}");
            assert_eq!(rounded_normal(once), once, "{v}");
        }
        for v in [Vec3::Z, -Vec3::Z, Vec3::X, -Vec3::Y] {
            assert!(rounded_normal(v).distance(v) < 1e-6);
        }
    }

    #[test]
    fn logarithms_err_upward_by_a_sixteenth_of_an_octave() {
        for i in 0..2000 {
            let value = 2.0 * (-0.0075 * i as f32).exp2();
            let found = power(log_up(value, 2.0), 2.0);
            assert!(found >= value && found <= value * 1.045, "{value} {found}");
        }
        assert_eq!(log_up(0.0, 2.0), 0);
        assert_eq!(log_up(f32::INFINITY, 2.0), 255);
        assert_eq!(log_up(f32::NAN, 2.0), 255);
    }
}
