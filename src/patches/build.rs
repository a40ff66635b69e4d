//! Makes the records of all nodes of a tree.
//!
//! Sums of areas and normals go up the tree; extents and residuals take one pass over the corners below each node, O(n log n)
//! in all, but for nodes that can never be patches, which are left at the first triangle that shows it. The overhang is the
//! largest distance of sample points of the footprint from the whole surface: without it a plate with holes would be closed,
//! since the thickness does not see holes. What colors other triangles have in the footprint counts as residual.

use super::edges;
use super::fit::{self, FitCorner};
use super::footprint::{self, HullScratch};
use super::nearest::{SurfaceDistance, corner_shares};
use super::packed;
use super::record::{NodePatch, NodePatches, RESIDUAL_LEVELS};
use crate::math::octahedral;
use crate::progress::Progress;
use crate::tree::{Error, Model, geometric_normal};
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// Grey levels of shading error that no tolerance allows: nodes whose residuals give more are never patches.
pub const MOST_SHADE_LEVELS: f32 = 64.0;

/// Samples of a footprint along each side, without open or sharp edges and with them.
const SAMPLES: [usize; 2] = [4, 16];

/// Samples of a footprint along each side where its colors and its place in an image are compared with what else lies in it.
pub(super) const FOREIGN_SAMPLES: u8 = 8;

/// Grey levels of a surface that faces the light: 0.8 times 255.
pub const FULL_LEVELS: f32 = 204.0;

/// Corners up to which a sample is looked for among the triangles of its own node first: those of 16.
const FEW_CORNERS: usize = 48;

/// Nodes that a thread takes at a time.
const CHUNK: usize = 64;

/// Means over what is below a node or leaf.
#[derive(Debug, Clone, Copy, Default)]
struct PatchSums {
    area: f32,
    /// Sum of area times unit normal of the faces.
    vector: Vec3,
    /// Mean of the corners' unit normals, by area.
    normal: Vec3,
    /// Mean of the corners' positions, by area.
    point: Vec3,
    flags: u8,
}

impl PatchSums {
    fn joined(parts: impl Iterator<Item = Self>) -> Self {
        let mut sums = Self::default();
        for part in parts {
            sums.area += part.area;
            sums.vector += part.vector;
            sums.normal += part.normal * part.area;
            sums.point += part.point * part.area;
            sums.flags |= part.flags;
        }
        if sums.area > 0.0 {
            sums.normal /= sums.area;
            sums.point /= sums.area;
        }
        sums
    }
}

/// A triangle of the model.
struct FaceCorners {
    positions: [Vec3; 3],
    /// Unit, zero without area.
    face_normal: DVec3,
    area: f32,
    vertices: [u32; 3],
}

/// A model, and what is known of its triangles.
struct PatchSource<'a> {
    model: &'a Model,
    leaf_flags: &'a [u8],
    surface: SurfaceDistance<'a>,
}

/// The footprint of a node as it will be drawn.
struct DrawnFootprint {
    /// With the rounded geometry.
    patch: NodePatch,
    /// Offset by which its (u, v) have to be moved to be those of the record before it was rounded.
    moved: Vec2,
    node: u32,
}

impl DrawnFootprint {
    fn new(patch: &NodePatch, drawn: NodePatch, node: u32) -> Self {
        let offset = drawn.origin - patch.origin;
        Self {
            moved: Vec2::new(offset.dot(patch.axis), offset.dot(patch.second_axis())),
            patch: drawn,
            node,
        }
    }

    /// Tells whether a place of the footprint lies above or below one of these triangles, which have three corners each.
    fn is_covered(&self, at: Vec2, corners: &[FitCorner]) -> bool {
        let at = at + self.moved;
        (corners.chunks_exact(3)).any(|t| is_in_triangle(at, [t[0].at, t[1].at, t[2].at]))
    }
}

/// Working memory of a thread: 140 bytes a triangle below the largest node that may be a patch.
#[derive(Default)]
struct PatchScratch {
    corners: Vec<FitCorner>,
    points: Vec<Vec2>,
    hull: HullScratch,
    row: Vec<f32>,
}

/// Makes the records. The result depends on the model alone, not on the number of threads.
///
/// Memory beside the result (176 bytes a node, about a third as many nodes as triangles): 44 bytes a node, 8 a vertex, 100 MB for
/// edges, and 140 bytes for each triangle below the largest node that may be a patch, a thread. Time: some 3 to 20
/// microseconds a triangle, a thread: the samples of the overhang take most of it.
///
/// # Errors
/// [`Error::Cancelled`].
pub fn build(model: &Model, progress: &dyn Progress) -> Result<NodePatches, Error> {
    if model.triangles.is_empty() || model.tree.nodes.is_empty() {
        return Ok(NodePatches::default());
    }
    let stop = || {
        if progress.is_cancelled() {
            Err(Error::Cancelled)
        } else {
            Ok(())
        }
    };
    let tree = &model.tree;
    progress.stage("finding edges", model.triangles.len() as u64);
    let leaf_flags = edges::leaf_flags(model);
    stop()?;
    let source = PatchSource {
        model,
        leaf_flags: &leaf_flags,
        surface: SurfaceDistance::new(model),
    };
    let mut sums = vec![PatchSums::default(); tree.nodes.len()];
    let mut records = vec![NodePatch::default(); tree.nodes.len()];
    progress.stage("fitting patches", tree.nodes.len() as u64);
    // Upward: the sums of children are there before they are asked for.
    for level in (0..tree.level_count()).rev() {
        let nodes = tree.level(level);
        let range = nodes.start as usize..nodes.end as usize;
        let (own, below) = sums.split_at_mut(range.end);
        let own = &mut own[range.start..];
        own.par_iter_mut()
            .enumerate()
            .with_min_len(256)
            .for_each(|(index, sums)| {
                *sums = source.sums_of(nodes.start + index as u32, |child| {
                    below[child as usize - range.end]
                });
            });
        let sums = &sums;
        records[range]
            .par_chunks_mut(CHUNK)
            .enumerate()
            .for_each_init(PatchScratch::default, |scratch, (chunk, records)| {
                if progress.is_cancelled() {
                    return;
                }
                for (index, record) in records.iter_mut().enumerate() {
                    let node = nodes.start + (chunk * CHUNK + index) as u32;
                    if let Some(patch) = source.patch(node, sums, scratch) {
                        *record = patch;
                    }
                }
                progress.advance(records.len() as u64);
            });
        stop()?;
    }
    Ok(NodePatches { records })
}

impl PatchSource<'_> {
    fn face(&self, leaf: u32) -> FaceCorners {
        let vertices = self.model.triangles[leaf as usize];
        let positions = vertices.map(|corner| self.model.vertices[corner as usize].position);
        let (face_normal, area) = geometric_normal(positions);
        FaceCorners {
            positions,
            face_normal,
            area,
            vertices,
        }
    }

    /// Unit shading normal of a vertex; `None` where it has none.
    fn normal(&self, vertex: u32) -> Option<Vec3> {
        let vertex = &self.model.vertices[vertex as usize];
        (vertex.color[3] != 0).then(|| octahedral::decode(vertex.normal))
    }

    fn sums_of_leaf(&self, leaf: u32) -> PatchSums {
        let face = self.face(leaf);
        let normals = face
            .vertices
            .map(|vertex| self.normal(vertex).unwrap_or_default());
        let [a, b, c] = face.positions;
        PatchSums {
            area: face.area,
            vector: face.face_normal.as_vec3() * face.area,
            normal: (normals[0] + normals[1] + normals[2]) / 3.0,
            point: (a + b + c) / 3.0,
            flags: self.leaf_flags[leaf as usize],
        }
    }

    fn sums_of(&self, node: u32, of_node: impl Fn(u32) -> PatchSums) -> PatchSums {
        let children = self.model.tree.children(node);
        if self.model.tree.nodes[node as usize].has_leaves() {
            PatchSums::joined(children.map(|leaf| self.sums_of_leaf(leaf)))
        } else {
            PatchSums::joined(children.map(of_node))
        }
    }

    /// The record of a node; `None` where it never is a patch.
    fn patch(
        &self,
        node: u32,
        sums: &[PatchSums],
        scratch: &mut PatchScratch,
    ) -> Option<NodePatch> {
        let own = sums[node as usize];
        // No second sheet, no fold: condition 2.
        if !(own.area > 0.0 && own.vector.length() > 0.5 * own.area) {
            return None;
        }
        // Of 2 x 12 bit, so that the packed record has the same plane.
        let normal = packed::rounded_normal(own.vector.normalize_or(Vec3::Z));
        let sine = self.largest_sine(node, normal.as_dvec3())?;
        let half_angle = sine.min(1.0).asin() as f32 + 2e-4;
        if half_angle >= NodePatch::WIDEST {
            return None;
        }
        let mut patch = self.extents(node, normal, scratch)?;
        patch.half_angle = half_angle;
        patch.flags = own.flags;
        self.shading(&mut patch, node, sums, scratch)?;
        let ball = &self.model.tree.nodes[node as usize];
        let radius = ball.radius;
        // Rounding widens the footprint: what is beside the surface is looked for in what will be drawn.
        let drawn = packed::rounded(ball, &patch);
        if !drawn.may_be_drawn() {
            return None;
        }
        let least = patch.residuals.into_iter().fold(f32::INFINITY, f32::min);
        let levels = FULL_LEVELS * (least * half_angle.sin() + 0.5 * least * least);
        if patch.thickness <= radius && levels <= MOST_SHADE_LEVELS {
            let place = DrawnFootprint::new(&patch, drawn, node);
            patch.overhang = self.overhang(&place, radius, scratch);
            if self.model.has_colors && patch.overhang.is_finite() {
                let around = self.foreign_colors(&patch, &place, scratch);
                patch.color_residual = patch.color_residual.hypot(around);
            }
        }
        Some(patch)
    }

    /// Sine of the largest angle of a face normal and `normal`; `None` from 60 degrees on.
    fn largest_sine(&self, node: u32, normal: DVec3) -> Option<f64> {
        let mut largest = 0.0f64;
        for leaf in self.model.tree.leaf_range(node) {
            let face = self.face(leaf);
            if face.area > 0.0 {
                if face.face_normal.dot(normal) <= 0.5 {
                    return None;
                }
                largest = largest.max(face.face_normal.cross(normal).length_squared());
            }
        }
        Some(largest.sqrt())
    }

    /// Plane, thickness and footprint; leaves the corners in `scratch`. `None` where a corner has no normal.
    fn extents(&self, node: u32, normal: Vec3, scratch: &mut PatchScratch) -> Option<NodePatch> {
        let center = self.model.tree.nodes[node as usize].center;
        let first = normal.any_orthonormal_vector();
        let second = normal.cross(first);
        let PatchScratch {
            corners,
            points,
            hull,
            ..
        } = scratch;
        corners.clear();
        points.clear();
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        let mut reach = center.abs().max_element();
        for leaf in self.model.tree.leaf_range(node) {
            let face = self.face(leaf);
            for (position, vertex) in face.positions.into_iter().zip(face.vertices) {
                let offset = position - center;
                let height = offset.dot(normal);
                (low, high) = (low.min(height), high.max(height));
                reach = reach.max(position.abs().max_element());
                let at = Vec2::new(offset.dot(first), offset.dot(second));
                points.push(at);
                let [r, g, b, _] = self.model.vertices[vertex as usize].color;
                corners.push(FitCorner {
                    at,
                    normal: self.normal(vertex)?,
                    color: Vec3::new(f32::from(r), f32::from(g), f32::from(b)) / 255.0,
                    weight: face.area,
                });
            }
        }
        let rectangle = footprint::around(points, hull);
        let turn = footprint::direction(rectangle.turn);
        let axis = first * turn.x + second * turn.y;
        let across = normal.cross(axis);
        for corner in corners.iter_mut() {
            let offset = corner.at - rectangle.center;
            corner.at = Vec2::new(offset.dot(turn), offset.dot(turn.perp()));
            let n = corner.normal;
            corner.normal = Vec3::new(n.dot(axis), n.dot(across), n.dot(normal));
        }
        let middle = 0.5 * (low + high);
        let radius = rectangle.half.max_element();
        // Rounding of offsets, of heights, and of the middle when it is added to the center.
        let room = 3e-7 * reach + 1e-6 * radius;
        Some(NodePatch {
            origin: center
                + first * rectangle.center.x
                + second * rectangle.center.y
                + normal * middle,
            normal,
            axis,
            half_extents: rectangle.half + Vec2::splat(3e-7 * reach),
            corner_cuts: rectangle.cuts,
            thickness: 0.5 * (high - low) + room,
            ..NodePatch::default()
        })
    }

    /// Fits normals and colors to the corners in `scratch`, and measures what is left.
    fn shading(
        &self,
        patch: &mut NodePatch,
        node: u32,
        sums: &[PatchSums],
        scratch: &PatchScratch,
    ) -> Option<()> {
        let corners = &scratch.corners[..];
        let fit = fit::of_normals(corners)?;
        patch.mean_normal = fit.mean_normal;
        patch.shape = fit.shape;
        let (mut weight, mut sigma) = (0.0f64, 0.0f64);
        for corner in corners {
            let w = f64::from(corner.weight);
            weight += w;
            sigma += w * f64::from(fit.unit_at(corner.at).dot(corner.normal));
        }
        let sigma = (sigma / weight) as f32;
        if sigma.is_nan() || sigma <= 0.0 {
            return None;
        }
        let (mut squares, mut largest) = (0.0f64, 0.0f32);
        for corner in corners {
            let off = (corner.normal - fit.unit_at(corner.at) * sigma).length_squared();
            squares += f64::from(corner.weight * off);
            if corner.weight > 0.0 {
                largest = largest.max(off);
            }
        }
        patch.sigma = sigma;
        patch.largest_residual = largest.sqrt();
        let of_corners = (squares / weight).sqrt() as f32;
        patch.residuals = [of_corners; RESIDUAL_LEVELS];
        self.residuals_below(patch, node, sums);
        if self.model.has_colors {
            let (color, gradient, residual) = fit::of_colors(corners);
            patch.color = color;
            patch.color_gradient = gradient;
            patch.color_residual = residual;
        }
        Some(())
    }

    /// Residuals of the mean normals of descendants; those of levels below the leaves stay those of corners.
    fn residuals_below(&self, patch: &mut NodePatch, node: u32, sums: &[PatchSums]) {
        let tree = &self.model.tree;
        let fit = *patch;
        let across = fit.second_axis();
        let frame = |v: Vec3| Vec3::new(v.dot(fit.axis), v.dot(across), v.dot(fit.normal));
        let residual = |parts: &mut dyn Iterator<Item = PatchSums>| {
            let (mut area, mut squares) = (0.0f64, 0.0f64);
            for part in parts {
                let foot = frame(part.point - fit.origin).truncate();
                let unit = fit.fitted_normal(foot).normalize_or(Vec3::Z);
                let off = frame(part.normal) - unit * fit.sigma;
                area += f64::from(part.area);
                squares += f64::from(part.area * off.length_squared());
            }
            (squares / area.max(f64::MIN_POSITIVE)).sqrt() as f32
        };
        let mut range: Range<u32> = node..node + 1;
        for level in 1..RESIDUAL_LEVELS {
            let has_leaves = tree.nodes[range.start as usize].has_leaves();
            range = tree.children(range.start).start..tree.children(range.end - 1).end;
            patch.residuals[level] = if has_leaves {
                residual(&mut range.clone().map(|leaf| self.sums_of_leaf(leaf)))
            } else {
                residual(&mut range.clone().map(|child| sums[child as usize]))
            };
            if has_leaves {
                break;
            }
        }
    }

    /// Root mean square over the footprint, value / 255, of the differences of the record's color from what other triangles have
    /// that lie in it: a node may be scattered, as single cells of a checkered plane, and its hull lies over what is between.
    fn foreign_colors(
        &self,
        patch: &NodePatch,
        drawn: &DrawnFootprint,
        scratch: &PatchScratch,
    ) -> f32 {
        let few = match scratch.corners.len() <= FEW_CORNERS {
            true => &scratch.corners[..],
            false => &[],
        };
        let own = self.model.tree.leaf_range(drawn.node);
        let enough = drawn.patch.thickness.max(patch.overhang);
        let (mut squares, mut count) = (Vec3::ZERO, 0u8);
        for share in footprint::samples(FOREIGN_SAMPLES, drawn.patch.corner_cuts) {
            count += 1;
            let at = share * drawn.patch.half_extents;
            if drawn.is_covered(at, few) {
                continue;
            }
            let found = (self.surface).nearest(drawn.patch.point(at), drawn.node, enough);
            if found.distance.is_finite() && !own.contains(&found.leaf) {
                let color = self.color_of(found.leaf, found.place);
                let off = color - patch.color_at(at + drawn.moved);
                squares += off * off;
            }
        }
        (squares / f32::from(count.max(1))).max_element().sqrt()
    }

    /// Color of a point of a triangle, value / 255.
    fn color_of(&self, leaf: u32, point: Vec3) -> Vec3 {
        let face = self.face(leaf);
        let mut color = Vec3::ZERO;
        let shares = corner_shares(face.positions, point);
        for (vertex, share) in face.vertices.into_iter().zip(shares) {
            let [r, g, b, _] = self.model.vertices[vertex as usize].color;
            color += Vec3::new(f32::from(r), f32::from(g), f32::from(b)) * (share / 255.0);
        }
        color
    }

    /// Largest distance of sample points of the footprint from the surface, or something up to the thickness; infinite where it
    /// exceeds the radius of the node, which is more than a pixel where the node is.
    ///
    /// Distances are at most one apart for points one apart: a sample is not looked at whose neighbors say enough.
    fn overhang(&self, drawn: &DrawnFootprint, radius: f32, scratch: &mut PatchScratch) -> f32 {
        let patch = &drawn.patch;
        let count = SAMPLES[usize::from(patch.has_rim())];
        let mut most = patch.thickness;
        let PatchScratch { corners, row, .. } = scratch;
        let few = if corners.len() <= FEW_CORNERS {
            &corners[..]
        } else {
            &[]
        };
        let distance = |at: Vec2, most: &mut f32| {
            // A triangle below or above it is at most the thickness away.
            if drawn.is_covered(at, few) {
                return *most;
            }
            let found = self.surface.of(patch.point(at), drawn.node, *most);
            *most = most.max(found);
            found
        };
        row.clear();
        row.resize(count, f32::INFINITY);
        let half = patch.half_extents;
        let step = half * (2.0 / count as f32);
        for y in 0..count {
            let mut left = f32::INFINITY;
            for (x, above) in row.iter_mut().enumerate() {
                let share = footprint::sample([x, y], count);
                let is_inside = footprint::contains(share, patch.corner_cuts);
                let known = (left + step.x).min(*above + step.y);
                let found = if known <= most || !is_inside {
                    known
                } else {
                    distance(share * half, &mut most)
                };
                if most > radius {
                    return f32::INFINITY;
                }
                (left, *above) = (found, found);
            }
        }
        let (corners, sides) = patch.corners();
        let pieces = (count / 4).max(2);
        for side in 0..sides {
            let [from, to] = [corners[side], corners[(side + 1) % sides]];
            let step = from.distance(to) / pieces as f32;
            let mut last = f32::INFINITY;
            for piece in 0..pieces {
                let known = last + step;
                last = if known <= most {
                    known
                } else {
                    distance(from.lerp(to, piece as f32 / pieces as f32), &mut most)
                };
                if most > radius {
                    return f32::INFINITY;
                }
            }
        }
        most
    }
}

/// Tells whether a triangle of the plane contains a point, however it is turned.
fn is_in_triangle(at: Vec2, [a, b, c]: [Vec2; 3]) -> bool {
    let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(at - from));
    sides.iter().all(|side| *side > 0.0) || sides.iter().all(|side| *side < 0.0)
}
