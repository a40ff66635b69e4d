//! What decides whether a node is a patch, 16 bytes a node, and the decision for four siblings at once.
//!
//! With s pixels per model unit at the nearest depth of the ball, theta the angle of the plane's normal and the direction from the
//! ball's center to the eye, alpha the half angle of the face normals, h the thickness and q the overhang, a node that is larger
//! than a pixel is a patch where all of this holds:
//!
//! 1. alpha below 60 degrees, vector area above half of the area (known without a view);
//! 2. max(h, q) s <= e_rim where theta + alpha + half the ball's angle can reach 90 degrees or an open or sharp edge lies
//!    below, else e_in;
//! 3. 204 (rho sin T + rho² / 2) + shift <= e_sh grey levels with T = min(90°, theta + alpha) and
//!    shift = 204 |S| h sin² T / cos T (1 - 0.25 / d) for d = max(h, q) s sin T above a quarter pixel, not at rims;
//! 4. it is at least as wide as the least size.
//!
//! rho is the residual of the descendants that are about a pixel wide: what is finer is averaged anyway. Of a unit normal n and a
//! fit m of length sigma with |n - m| = r, |n . l - m . l| is at most r sin T + (r² + 1 - sigma²) / 2 for the angle T of n and l.
//! With the largest residual of the corners, and T that of any shading normal and any point of the ball, that is a bound at
//! every corner (strict conditions).
//!
//! Angles are compared by their sines and cosines. Everything is rounded so that more is refused.

use super::build::FULL_LEVELS;
use super::record::{NodePatch, NodePatches, RESIDUAL_LEVELS};
use super::settings::PatchCutSettings;
use crate::abi::PatchTexture;
use crate::cut::{FourNodes, NodeTester};
use crate::math::octahedral;
use crate::textures::NO_IMAGE;
use crate::tree::{Model, Node};
use bytemuck::{Pod, Zeroable};
use glam::{BVec4A, Vec4};
use rayon::prelude::*;
use std::f32::consts::FRAC_PI_2;

/// What a view has to know of a node, 16 bytes: four siblings are a line of a cache.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct PatchCondition {
    /// The plane's, octahedral.
    normal: [i16; 2],
    /// Root of the largest of h, q and the slip in an image over the radius, units of 1/65535; the largest value is never small enough.
    error: u16,
    /// Root of a quarter of |S| h, units of 1/65535.
    shift: u16,
    /// Roots of halves of the residuals, units of 1/255.
    residuals: [u8; RESIDUAL_LEVELS],
    /// Sine, units of 1/255.
    half_angle: u8,
    /// Grey levels that are lost in any view: of colors.
    lost_levels: u8,
    /// Flags of the record.
    flags: u8,
}

/// Conditions of the nodes of a tree, in its order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PatchConditions {
    pub(super) nodes: Vec<PatchCondition>,
    /// T is that of every point of the ball.
    is_strict: bool,
}

impl PatchConditions {
    /// The conditions of the records of a model: means of residuals, or where `is_strict` their largest values, so that the
    /// shade is bounded at every corner.
    pub fn new(model: &Model, patches: &NodePatches, is_strict: bool) -> Self {
        let nodes = model.tree.nodes.par_iter().zip(&patches.records);
        let nodes = nodes
            .with_min_len(1024)
            .map(|(node, patch)| PatchCondition::new(node, (patch, None), is_strict));
        Self::of_nodes(nodes.collect(), is_strict)
    }

    /// Conditions that are made already, strict ones or not.
    pub(super) fn of_nodes(nodes: Vec<PatchCondition>, is_strict: bool) -> Self {
        Self { nodes, is_strict }
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..])
    }

    /// Tells whether a node may be drawn as its polygon at all.
    #[cfg(test)]
    pub(crate) fn may_draw(&self, id: u32) -> bool {
        self.nodes[id as usize].may_be_drawn()
    }

    /// Conditions of four nodes from `first` on, and of none where there are fewer.
    #[inline(always)]
    pub(super) fn four(&self, first: u32) -> Option<[PatchCondition; 4]> {
        let rest = self.nodes.get(first as usize..)?;
        Some(match rest.first_chunk::<4>() {
            Some(&four) => four,
            None => {
                let &spare = rest.first()?;
                [0, 1, 2, 3].map(|i| rest.get(i).copied().unwrap_or(spare))
            }
        })
    }
}

impl PatchCondition {
    /// The condition of a patch; with its place in images where it has one.
    pub(super) fn new(
        node: &Node,
        (patch, texture): (&NodePatch, Option<&PatchTexture>),
        is_strict: bool,
    ) -> Self {
        if !patch.may_be_drawn() {
            return Self {
                flags: NodePatch::NEVER,
                ..Self::zeroed()
            };
        }
        // Casts saturate, and take what is no number to 0; what is infinite is refused.
        let root_16 = |value: f32| (value.max(0.0).sqrt() * 65535.0 * 1.000_01).ceil() as u16;
        let root_8 = |rho: f32| ((rho.max(0.0) * 0.5).sqrt() * 255.0 * 1.000_01).ceil() as u8;
        let slip = texture.map_or(0.0, |texture| texture.slip);
        let error = patch.thickness.max(patch.overhang).max(slip) / node.radius;
        // In an image each pixel has its own color.
        let mut lost = match texture {
            Some(texture) if texture.image != NO_IMAGE => 0.0,
            _ => 255.0 * patch.color_residual,
        };
        let mut residuals = patch.residuals;
        let mut angle = patch.half_angle;
        if is_strict {
            residuals = [patch.largest_residual; RESIDUAL_LEVELS];
            lost += 0.5 * FULL_LEVELS * (1.0 - patch.sigma * patch.sigma).max(0.0);
            angle = angle.max(shading_angle(patch));
        }
        Self {
            normal: octahedral::encode(patch.normal),
            error: root_16(error),
            shift: root_16(0.25 * patch.curvature() * patch.thickness),
            residuals: residuals.map(root_8),
            half_angle: (angle.min(FRAC_PI_2).sin() * 255.0 * 1.000_01).ceil() as u8,
            lost_levels: lost.ceil() as u8,
            flags: patch.flags,
        }
    }

    /// Tells whether the node may be drawn as its polygon at all.
    #[inline(always)]
    pub(super) fn may_be_drawn(&self) -> bool {
        self.flags & NodePatch::NEVER == 0
    }
}

/// Largest angle of a corner's shading normal and the plane's normal: that of the fit anywhere in the footprint, and what the
/// largest residual adds. Errs to too much.
fn shading_angle(patch: &NodePatch) -> f32 {
    let m = patch.mean_normal;
    if m.z <= 0.0 {
        return FRAC_PI_2;
    }
    let tangent = (m.truncate().length() + patch.curvature() * patch.half_extents.length()) / m.z;
    // The chord is that of a unit normal and a fit of length sigma.
    let share = patch.largest_residual / patch.sigma.max(1e-3);
    tangent.atan() + share.min(1.0).asin()
}

/// What four nodes are by their errors, a bit each: in exactly one of these.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct FourVerdicts {
    pub(super) patch: u32,
    pub(super) never: u32,
    pub(super) near: u32,
    pub(super) rim: u32,
    pub(super) inside: u32,
    pub(super) shade: u32,
    pub(super) size: u32,
    /// Projected diameters of the balls, pixels; of lanes of `patch`.
    pub(super) size_px: [f32; 4],
}

/// The conditions of one view.
#[derive(Debug, Clone, Copy)]
pub(super) struct ErrorTester<'a> {
    pub(super) tester: &'a NodeTester,
    pub(super) settings: &'a PatchCutSettings,
    pub(super) is_strict: bool,
}

impl<'a> ErrorTester<'a> {
    pub(super) fn new(
        tester: &'a NodeTester,
        settings: &'a PatchCutSettings,
        conditions: &PatchConditions,
    ) -> Self {
        Self {
            tester,
            settings,
            is_strict: conditions.is_strict,
        }
    }

    /// What four nodes are, whatever their visibility.
    #[inline(always)]
    pub(super) fn verdicts(
        &self,
        nodes: &FourNodes,
        conditions: &[PatchCondition; 4],
    ) -> FourVerdicts {
        let tolerances = &self.settings.tolerances;
        let words = columns(conditions);
        let flags = words[3].map(|word| word >> 24);
        let flagged = |bit: u8| lanes(flags.map(|flags| flags & u32::from(bit))).cmpgt(Vec4::ZERO);
        let angles = self.angles(nodes, &words);
        let is_rim = angles.is_rim | flagged(NodePatch::OPEN_EDGE | NodePatch::SHARP_EDGE);
        let radius_px = nodes.balls().radius() * angles.scale;
        let error = lanes(words[1].map(|word| word & 0xffff)) * (1.0 / 65535.0);
        let error_px = error * error * radius_px;
        let [rim_px, inside_px] = [tolerances.rim_px, tolerances.inside_px].map(Vec4::splat);
        let is_exact =
            error_px.cmple(Vec4::select(is_rim, rim_px, inside_px)) & error.cmplt(Vec4::ONE);
        // All, less what each condition refuses.
        let never = flagged(NodePatch::NEVER).bitmask();
        let mut left = 15 & !never;
        let near = left & !angles.is_in_front.bitmask();
        left &= !near;
        let wrong = left & !is_exact.bitmask();
        left &= !wrong;
        let mut found = FourVerdicts {
            never,
            near,
            ..FourVerdicts::default()
        };
        found.rim = wrong & is_rim.bitmask();
        found.inside = wrong & !is_rim.bitmask();
        if left == 0 {
            return found;
        }
        // T, and in strict conditions T of any point of the ball.
        let mut t = angles.widest;
        if self.is_strict {
            t = (t + angles.ball).within_quarter(t);
        }
        let size_px = radius_px * 2.0;
        let levels = self.shade(&words, (t, size_px, error_px), is_rim);
        let is_shaded = levels.cmple(Vec4::splat(tolerances.shade_levels));
        found.shade = left & !is_shaded.bitmask();
        left &= !found.shade;
        let is_large = size_px.cmpge(Vec4::splat(self.settings.least_px));
        found.size = left & !is_large.bitmask();
        left &= !found.size;
        found.patch = left;
        found.size_px = size_px.to_array();
        found
    }

    /// Angles under which the nodes are seen.
    #[inline(always)]
    fn angles(&self, nodes: &FourNodes, words: &[[u32; 4]; 4]) -> SeenAngles {
        let one = Vec4::ONE;
        let balls = nodes.balls();
        let (radius, depth) = (balls.radius(), balls.depth());
        let signed = |bits: u32| (bits << 16) as i32 >> 16;
        let axes = words[0].map(|word| [signed(word), signed(word >> 16)]);
        let [nx, ny, nz] = NodeTester::four_directions(axes.map(|axis| axis.map(|c| c as i16)));
        let length_squared = nx * nx + ny * ny + nz * nz;
        let (focal, is_perspective) = self.tester.px_per_unit();
        // The polygon's corners reach at most the diagonal of the square around the ball.
        let is_in_front = (depth - radius * 1.5).cmpgt(Vec4::splat(self.tester.near()));
        let (cosine, ball_sine, scale) = if is_perspective {
            let [x, y, z] = balls.center();
            let distance_squared = x * x + y * y + z * z;
            let along = (nx * x + ny * y + nz * z).abs();
            (
                along / sqrt(distance_squared * length_squared),
                (radius / sqrt(distance_squared)).min(one),
                Vec4::splat(focal) / (depth - radius),
            )
        } else {
            let v = self.tester.backward();
            let along = (nx * v.x + ny * v.y + nz * v.z).abs();
            (along / sqrt(length_squared), Vec4::ZERO, Vec4::splat(focal))
        };
        let theta = FourAngles::of_cosine(cosine.min(one));
        let ball = FourAngles::of_sine(ball_sine);
        let cone = FourAngles::of_sine(lanes(words[3].map(|word| word >> 8 & 255)) * (1.0 / 255.0));
        let margin = cone + ball;
        // theta + alpha + beta >= 90 degrees: cos theta <= sin(alpha + beta), or alpha + beta themselves reach that.
        let is_rim = margin.cosine.cmple(Vec4::ZERO) | theta.cosine.cmple(margin.sine);
        SeenAngles {
            widest: (theta + cone).within_quarter(theta),
            ball,
            is_rim,
            is_in_front,
            scale,
        }
    }

    /// Grey levels by which shades may be wrong: for the angle T, the size and the error in pixels.
    #[inline(always)]
    fn shade(
        &self,
        words: &[[u32; 4]; 4],
        (t, size_px, error_px): (FourAngles, Vec4, Vec4),
        is_rim: BVec4A,
    ) -> Vec4 {
        let [_, ones, twos, threes] = words;
        let byte = |words: &[u32; 4], shift: u32| lanes(words.map(|word| word >> shift & 255));
        // Above 16 pixels there is no level that fine: corners.
        let mut root = byte(twos, 0);
        for (level, most_px) in [
            (byte(threes, 0), 16.0),
            (byte(twos, 24), 8.0),
            (byte(twos, 16), 4.0),
            (byte(twos, 8), 2.0),
        ] {
            root = Vec4::select(size_px.cmple(Vec4::splat(most_px)), level, root);
        }
        let root = root * (1.0 / 255.0);
        let residual = root * root * 2.0;
        let mut levels =
            (residual * t.sine + residual * residual * 0.5) * FULL_LEVELS + byte(threes, 16);
        let shift_px = error_px * t.sine;
        let shifts = !is_rim & shift_px.cmpgt(Vec4::splat(0.25));
        if shifts.any() {
            let root = lanes(ones.map(|word| word >> 16)) * (2.0 / 65535.0);
            let slope = t.sine * t.sine / t.cosine.max(Vec4::splat(1e-6));
            let shift =
                root * root * slope * (Vec4::ONE - Vec4::splat(0.25) / shift_px) * FULL_LEVELS;
            levels += Vec4::select(shifts, shift, Vec4::ZERO);
        }
        levels
    }
}

/// Angles of four nodes: T, half the angle of the ball, and what follows from them.
#[derive(Clone, Copy)]
struct SeenAngles {
    widest: FourAngles,
    ball: FourAngles,
    is_rim: BVec4A,
    is_in_front: BVec4A,
    /// Pixels per tester unit at the nearest depth of the ball.
    scale: Vec4,
}

/// Four angles from 0 to less than 180 degrees.
#[derive(Clone, Copy)]
struct FourAngles {
    cosine: Vec4,
    sine: Vec4,
}

impl FourAngles {
    #[inline(always)]
    fn of_cosine(cosine: Vec4) -> Self {
        let sine = sqrt((Vec4::ONE - cosine * cosine).max(Vec4::ZERO));
        Self { cosine, sine }
    }

    #[inline(always)]
    fn of_sine(sine: Vec4) -> Self {
        let cosine = sqrt((Vec4::ONE - sine * sine).max(Vec4::ZERO));
        Self { cosine, sine }
    }

    /// Limits the angle, which adds up from `part` and another one below 90 degrees, to 90 degrees.
    #[inline(always)]
    fn within_quarter(self, part: Self) -> Self {
        let is_less = self.cosine.cmpgt(Vec4::ZERO) & part.cosine.cmpgt(Vec4::ZERO);
        Self {
            cosine: Vec4::select(is_less, self.cosine, Vec4::ZERO),
            sine: Vec4::select(is_less, self.sine, Vec4::ONE),
        }
    }
}

impl std::ops::Add for FourAngles {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            cosine: self.cosine * other.cosine - self.sine * other.sine,
            sine: self.sine * other.cosine + self.cosine * other.sine,
        }
    }
}

/// The words of four conditions, a lane each.
#[inline(always)]
fn columns(conditions: &[PatchCondition; 4]) -> [[u32; 4]; 4] {
    // The words travel as floats, whose bits nothing changes on the way.
    let rows = conditions.map(|condition| Vec4::from_array(bytemuck::cast(condition)));
    let [a, b, c, d] = rows;
    let lanes = glam::Mat4::from_cols(a, b, c, d).transpose();
    [lanes.x_axis, lanes.y_axis, lanes.z_axis, lanes.w_axis].map(|v| v.to_array().map(f32::to_bits))
}

/// Small whole numbers as lanes.
#[inline(always)]
fn lanes(words: [u32; 4]) -> Vec4 {
    Vec4::from_array(words.map(|word| word as i32 as f32))
}

#[inline(always)]
fn sqrt(value: Vec4) -> Vec4 {
    crate::simd::FloatLanes::sqrt(value)
}
