//! The cut by error: a node is a patch as soon as its error on the picture is small, whatever its size.
//!
//! With s pixels per model unit at the nearest depth of the ball, theta the angle of the plane's normal and the direction to the
//! eye, alpha the half angle of the face normals, h the thickness and q the overhang, a node that is larger than a pixel is a patch
//! where all of this holds:
//!
//! 1. alpha below 60 degrees, vector area above half of the area (known without a view);
//! 2. max(h, q) s <= e_rim where theta + alpha + half the ball's angle can reach 90 degrees or an open or sharp edge lies
//!    below, else e_in;
//! 3. 204 (rho sin T + rho² / 2) + shift <= e_sh grey levels with T = min(90°, theta + alpha) and
//!    shift = 204 |S| h sin² T / cos T (1 - 0.25 / d) for d = h s sin T above a quarter pixel, not at rims;
//! 4. it is at least as wide as the least size.
//!
//! rho is the residual of the descendants that are about a pixel wide: what is finer is averaged anyway. Of a unit normal n and a
//! fit m of length sigma with |n - m| = r, |n . l - m . l| is at most r sin T + (r² + 1 - sigma²) / 2 for the angle T of n and l.
//! With the largest residual of the corners, and T that of any shading normal and any point of the ball, that is a bound at
//! every corner ([`PatchCutSettings::is_strict`]).
//!
//! All else is as in [`crate::cut`]; with negative tolerances the lists are the same.

use super::build::{FULL_LEVELS, NodePatches};
use super::record::{NodePatch, RESIDUAL_LEVELS};
use crate::cut::{Cut, CutSettings, FacingTest, NodeTester, StripRun};
use crate::math::camera::View;
use crate::tree::{Model, Node};
use glam::Vec3;
use std::f32::consts::FRAC_PI_2;

/// How wrong a patch may be on the picture. A negative number draws no patches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorTolerances {
    /// Thickness and overhang at silhouettes, pixels. They grow by at most twice as much.
    pub rim_px: f32,
    /// Thickness and overhang elsewhere, pixels.
    pub inside_px: f32,
    /// Error of the shade, grey levels of 255.
    pub shade_levels: f32,
}

impl Default for ErrorTolerances {
    fn default() -> Self {
        Self {
            rim_px: 0.15,
            inside_px: 0.25,
            shade_levels: 24.0,
        }
    }
}

impl ErrorTolerances {
    /// Draws no patches.
    pub const NONE: Self = Self {
        rim_px: -1.0,
        inside_px: -1.0,
        shade_levels: -1.0,
    };
}

/// What the cut by error may choose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchCutSettings {
    /// Threshold of splats, culling and size metric, as for a cut by size.
    pub cut: CutSettings,
    /// How wrong a patch may be.
    pub tolerances: ErrorTolerances,
    /// Projected diameter from which on a node may be a patch, pixels.
    pub least_px: f32,
    /// Take the largest residual of the corners instead of means: the shade is bounded at every corner.
    pub is_strict: bool,
    /// Draw nodes below the threshold as their polygon instead of a square, where no second sheet is below them.
    pub tiny_polygons: bool,
}

impl Default for PatchCutSettings {
    fn default() -> Self {
        Self {
            cut: CutSettings::default(),
            tolerances: ErrorTolerances::default(),
            least_px: 1.0,
            is_strict: false,
            tiny_polygons: false,
        }
    }
}

/// How often each condition refused a node larger than the threshold, the first that did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct PatchRefusals {
    /// Wide cone, small vector area, or a record that no view draws.
    pub never: u64,
    /// It reaches the near plane.
    pub near: u64,
    /// Thickness or overhang at a silhouette.
    pub rim: u64,
    /// Thickness or overhang elsewhere.
    pub inside: u64,
    /// Shade.
    pub shade: u64,
    /// Least size.
    pub size: u64,
}

/// What is to be drawn, as ids in ascending order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PatchCut {
    /// Nodes drawn as a patch.
    pub patches: Vec<u32>,
    /// Nodes below the threshold drawn as their polygon.
    pub tiny: Vec<u32>,
    /// Everything else: squares, rows of squares, leaves, triangles; and the counts of the whole cut.
    pub rest: Cut,
    /// Why nodes were no patches.
    pub refused: PatchRefusals,
}

impl PatchCut {
    fn clear(&mut self) {
        self.patches.clear();
        self.tiny.clear();
        self.rest.clear();
        self.refused = PatchRefusals::default();
    }

    /// Polygons, squares and triangles together.
    pub fn primitives(&self) -> usize {
        let rows: usize = self
            .rest
            .strips
            .iter()
            .map(|row| row.splats() as usize)
            .sum();
        self.patches.len()
            + self.tiny.len()
            + self.rest.nodes.len()
            + rows
            + self.rest.leaves.len()
            + self.rest.triangles.len()
    }
}

/// What a node is drawn as by its error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PatchVerdict {
    /// As a patch.
    Patch,
    /// Refused, by which condition.
    Never,
    /// It may reach the near plane.
    Near,
    /// Thickness or overhang at a silhouette.
    Rim,
    /// Thickness or overhang elsewhere.
    Inside,
    /// The shade.
    Shade,
    /// The least size.
    Size,
}

/// Conditions of one frame.
#[derive(Debug, Clone)]
pub struct PatchTester {
    view: View,
    settings: PatchCutSettings,
    /// Pixels per unit of tangent, or per model unit for parallel rays.
    px_per_unit: f32,
}

impl PatchTester {
    /// Prepares the conditions of a view.
    pub fn new(view: &View, settings: &PatchCutSettings) -> Self {
        let scale = if view.is_perspective {
            1.0
        } else {
            view.model_scale
        };
        Self {
            view: *view,
            settings: *settings,
            px_per_unit: view.focal_px() * scale,
        }
    }

    /// Whether a node is a patch, whatever its visibility. `size_px` is the projected diameter of its ball.
    pub fn verdict(&self, node: &Node, patch: &NodePatch, size_px: f32) -> PatchVerdict {
        if !patch.may_be_drawn() {
            return PatchVerdict::Never;
        }
        let ErrorTolerances {
            rim_px,
            inside_px,
            shade_levels,
        } = self.settings.tolerances;
        let Some((scale, to_eye, ball_angle)) = self.placed(node, patch) else {
            return PatchVerdict::Near;
        };
        // Both sides of a sheet may be seen.
        let theta = patch.normal.dot(to_eye).abs().min(1.0).acos();
        let widest = theta + patch.half_angle;
        let is_rim = patch.has_rim() || widest + ball_angle >= FRAC_PI_2;
        let error_px = patch.thickness.max(patch.overhang) * scale;
        // Not: what is no number is refused.
        if !(error_px <= if is_rim { rim_px } else { inside_px }) {
            return if is_rim {
                PatchVerdict::Rim
            } else {
                PatchVerdict::Inside
            };
        }
        let mut levels = 255.0 * patch.color_residual;
        let sine = widest.min(FRAC_PI_2).sin();
        if self.settings.is_strict {
            // The light of the surface is that of the eye anywhere in the ball; shading normals may leave the cone of the faces.
            let rho = patch.largest_residual;
            let angle = theta + ball_angle + patch.half_angle.max(shading_angle(patch));
            let uneven = 1.0 - patch.sigma * patch.sigma;
            levels += FULL_LEVELS
                * (rho * angle.min(FRAC_PI_2).sin() + 0.5 * (rho * rho + uneven.max(0.0)));
        } else {
            let rho = self.residual(patch, size_px);
            levels += FULL_LEVELS * (rho * sine + 0.5 * rho * rho);
        }
        let shift_px = patch.thickness * scale * sine;
        if !is_rim && shift_px > 0.25 {
            let cosine = widest.min(FRAC_PI_2).cos().max(1e-6);
            levels += FULL_LEVELS * patch.curvature() * patch.thickness * sine * sine / cosine
                * (1.0 - 0.25 / shift_px);
        }
        if !(levels <= shade_levels) {
            return PatchVerdict::Shade;
        }
        if size_px < self.settings.least_px {
            return PatchVerdict::Size;
        }
        PatchVerdict::Patch
    }

    /// Pixels per model unit at the nearest depth of the ball, unit direction to the eye, half the angle under which the ball is
    /// seen; `None` where ball or polygon reach the near plane.
    fn placed(&self, node: &Node, patch: &NodePatch) -> Option<(f32, Vec3, f32)> {
        let view = &self.view;
        let reach = (node.radius).max(patch.reach()) * view.model_scale;
        let depth = view.distance(node.center).min(view.distance(patch.origin));
        if !(depth - reach > view.near) {
            return None;
        }
        if !view.is_perspective {
            return Some((self.px_per_unit, view.backward, 0.0));
        }
        let nearest = view.distance(node.center) - node.radius * view.model_scale;
        let scale = self.px_per_unit * view.model_scale / nearest;
        let to_eye = view.eye - patch.origin;
        let ball_angle = (node.radius / view.eye.distance(node.center))
            .min(1.0)
            .asin();
        Some((scale, to_eye.normalize_or(patch.normal), ball_angle))
    }

    /// The residual of what is about a pixel wide below a node of a size.
    fn residual(&self, patch: &NodePatch, size_px: f32) -> f32 {
        let level = size_px.max(1.0).log2().ceil() as usize;
        // Above 16 pixels there is no level that fine: corners.
        let index = if level < RESIDUAL_LEVELS {
            level.max(1)
        } else {
            0
        };
        if size_px <= 1.0 {
            patch.residuals[1]
        } else {
            patch.residuals[index]
        }
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
    tangent.atan()
        + (patch.largest_residual / patch.sigma.max(1e-3))
            .min(1.0)
            .asin()
}

/// A group of siblings that is to be looked at.
#[derive(Debug, Clone, Copy)]
struct OpenGroup {
    first: u32,
    count: u32,
    /// Every normal faces the viewer.
    faces: bool,
}

/// Selects the cut by error from the root, level by level. `patches` are those of the model; where they are none (a cloud), no
/// node is a patch.
///
/// One thread; some 20 nanoseconds a visited node. Allocates 12 bytes for each group of a level that is opened.
pub fn select(
    model: &Model,
    patches: &NodePatches,
    view: &View,
    settings: &PatchCutSettings,
    cut: &mut PatchCut,
) {
    cut.clear();
    let tester = NodeTester::new(model, view, &settings.cut);
    let frame = PatchFrame {
        model,
        patches,
        tester: &tester,
        errors: PatchTester::new(view, settings),
    };
    let root = OpenGroup {
        first: 0,
        count: 1,
        faces: !settings.cut.cull_back,
    };
    let tree = &model.tree;
    let mut groups = Vec::new();
    if !tree.leaves.is_empty() {
        groups.push(root);
    }
    let levels = if tree.nodes.is_empty() {
        0
    } else {
        tree.level_count()
    };
    let mut open = Vec::new();
    for _ in 0..levels {
        for group in groups.drain(..) {
            frame.look_at_nodes(group, cut, &mut open);
        }
        std::mem::swap(&mut groups, &mut open);
    }
    for group in groups {
        frame.look_at_leaves(group, cut);
    }
}

/// Everything that decides about nodes of one frame.
struct PatchFrame<'a> {
    model: &'a Model,
    patches: &'a NodePatches,
    tester: &'a NodeTester,
    errors: PatchTester,
}

impl PatchFrame<'_> {
    fn look_at_nodes(&self, group: OpenGroup, cut: &mut PatchCut, open: &mut Vec<OpenGroup>) {
        let settings = &self.errors.settings;
        for index in group.first..group.first + group.count {
            let Some(node) = self.model.tree.nodes.get(index as usize) else {
                return;
            };
            cut.rest.stats.visited += 1;
            if settings.cut.cull_frustum && self.tester.is_outside(node.center, node.radius) {
                cut.rest.stats.outside += 1;
                continue;
            }
            let mut faces = group.faces;
            if !faces {
                match self.tester.facing(node.center, node.radius, node.cone) {
                    FacingTest::Away => {
                        cut.rest.stats.facing_away += 1;
                        continue;
                    }
                    FacingTest::Front => faces = true,
                    FacingTest::Mixed => {}
                }
            }
            let patch = self.patches.records.get(index as usize);
            if self.tester.is_small(node.center, node.radius) {
                match patch {
                    Some(patch) if settings.tiny_polygons && patch.may_be_drawn() => {
                        cut.tiny.push(index);
                    }
                    _ => cut.rest.nodes.push(index),
                }
                continue;
            }
            if let Some(patch) = patch {
                let size_px = self.tester.size_px(node.center, node.radius) as f32;
                let refused = &mut cut.refused;
                match self.errors.verdict(node, patch, size_px) {
                    PatchVerdict::Patch => {
                        cut.patches.push(index);
                        continue;
                    }
                    PatchVerdict::Never => refused.never += 1,
                    PatchVerdict::Near => refused.near += 1,
                    PatchVerdict::Rim => refused.rim += 1,
                    PatchVerdict::Inside => refused.inside += 1,
                    PatchVerdict::Shade => refused.shade += 1,
                    PatchVerdict::Size => refused.size += 1,
                }
            }
            if let Some(count) = self.tester.splats_in_row(index, node) {
                cut.rest.strips.push(StripRun::new(index, count));
                continue;
            }
            open.push(OpenGroup {
                first: node.first_child,
                count: u32::from(node.child_count),
                faces,
            });
        }
    }

    fn look_at_leaves(&self, group: OpenGroup, cut: &mut PatchCut) {
        let is_cloud = self.model.kind().is_points();
        for leaf in group.first..group.first + group.count {
            let Some(ball) = self.model.tree.leaves.get(leaf as usize) else {
                return;
            };
            let rest = &mut cut.rest;
            rest.stats.visited += 1;
            let is_culled = self.errors.settings.cut.cull_frustum;
            if is_culled && self.tester.is_outside(ball.center, ball.radius) {
                rest.stats.outside += 1;
            } else if !group.faces && self.tester.leaf_faces_away(self.model, leaf) {
                rest.stats.facing_away += 1;
            } else if is_cloud || self.tester.is_small(ball.center, ball.radius) {
                rest.leaves.push(leaf);
            } else {
                rest.triangles.push(leaf);
            }
        }
    }
}
