//! From a cut to filtered splats: each patch of surface by its integrals, as the eye sees them.
//!
//! A node carries, over its triangles t of area A_t, unit normal n_t and shading normal s_t, the sums A = Σ A_t,
//! c = Σ A_t p_t / A, N = Σ A_t n_t and Q = Σ A_t (n_t s_tᵀ + s_t n_tᵀ) / 2 ([`crate::tree::Moments`]). From an eye at e,
//! with w = e - c, v = w / |w|, the depth z along the view direction and the focal length f in pixels:
//!
//! * an area element dA of normal n covers f² dA (n·w) / z³ of the picture plane, so a patch that faces the eye
//!   covers exactly a = f² (N·w) / z³ (up to its depth range); orthographic f² (N·v);
//! * with light from the direction l, each element has the Lambert value |s·l| and the weight (n·v) that a pixel gives
//!   it. For light in the eye their mean is (vᵀ Q v) / (N·v); for a parallel headlight about |vᵀ Q l| / (N·v);
//! * a lamp anywhere else lights only what faces it: max(0, vᵀ Q l) / E, l taken at the centroid, with E from below. The
//!   mean where all of the patch is seen and lit (then E = N·v). What turns away from the lamp counts as negative: too
//!   dark. Backs count as lit from the side that is seen. A triangle has max(0, n·l) of its shading normal;
//! * its highlight is that of the mean normal N, wider and weaker the shorter N is (Toksvig, "Mipmapping Normal Maps",
//!   Journal of Graphics Tools 10(3), 2005): with L = |N| / A and k = L / (L + s (1 - L)) the exponent s becomes k s and
//!   the value is multiplied by (1 + k s) / (1 + s).
//!
//! **Fronts and backs.** In a patch of both, N·v counts what faces away as negative. The projection of all of it, fronts
//! and backs, is E = Σ A_t |n_t·v|, and that of the fronts F = (E + N·v) / 2. E is not among the sums; it lies between
//! vᵀ Q v (as |n·v| <= 1) and √(A vᵀ Q v) (Cauchy and Schwarz), and their mean stands for it, at least |N·v|. F takes the
//! place of N·v as area, and E as what shades are divided by. A flat patch that faces the eye has F = E = N·v. A patch without normals counts as if it faced the eye
//! and the light.
//!
//! **Kernel.** The area is spread over a rectangle as large as the patch, parallel to the picture: that of a square of the
//! patch's area in its mean plane, √(1 - x²) of its side wide, x the mean normal's component to the right, and so high
//! likewise; of a piece of a row that of a rectangle as long as the piece. Each pixel gets the part of it that lies in
//! it. Patches are no squares, and such rectangles leave gaps. So all of the square of the threshold's side around the
//! center, as wide as a node may be, gets a weight as well, too small to count where any area is ([`FILTERED_SKIRT`]).
//! A leaf larger than the threshold has a rectangle of its own diameter, tilted likewise.

mod patch;

use crate::abi::FilteredSplat;
#[cfg(doc)]
use crate::abi::constants::FILTERED_SKIRT;
use crate::abi::constants::{FULL_HIGHLIGHT, LEAST_BACK};
use crate::cut::{Cut, StripRun, strip_center};
use crate::draw::parts::{self, Sink};
use crate::draw::splats::pixels_of_unit;
use crate::draw::{ALBEDO, ColorBy, Lighting, Phong, Source, falsecolor};
use crate::math::camera::{Light, View};
use crate::math::octahedral;
use crate::tree::{Leaf, Model, Tree};
use glam::Vec3;
use patch::{Patch, in_pieces, mean_color};
use prefetch_index::prefetch_index;

/// Depth offset of what is parallel to the picture, in half sides: its neighbors may not be.
const OFFSET_OF_NEIGHBORS: f32 = 1.0 / 7.0;
/// Depth offset of a triangle beside others of the angle that its corners have with it, in half sides over the sine.
const OFFSET_OF_BEND: f32 = 2.0;
/// Depth offset of the thickness of a patch, in half thicknesses.
const OFFSET_OF_THICKNESS: f32 = 1.5;
/// Where most triangles have at most this diameter, triangles are drawn as splats: one sample a pixel says little of the
/// area of such a triangle.
const SMALL_PX: f32 = 3.0;
/// The largest triangles that are, then. Single larger ones would leave pixels of both kinds.
const LARGEST_PX: f32 = 4.0 * PIECE_PX;
/// Pieces of triangles have at most this diameter: edges are halved until they do, which makes four of each.
const PIECE_PX: f32 = 1.5;
/// The share of a cut's triangles that must be small for that. A pixel of both kinds is less exact than one of either.
const LEAST_SMALL: f32 = 0.9;
/// The least width of a splat's rectangle.
const LEAST_EXTENT_PX: f32 = 1.0 / 16.0;
/// Largest point size that is spent on the spread of a rectangle's edges over pixels.
const MARGIN_PX: f32 = 2.0;

/// What the weights of a frame depend on besides the model.
#[derive(Debug, Clone, Copy)]
pub struct Shade {
    /// Side of the square of a node, pixels.
    pub side_px: f32,
    /// Largest point that the device draws, pixels.
    pub max_size_px: f32,
    /// Draw every triangle as a splat.
    pub splats_only: bool,
    /// The view of the cut, where it is not the one that is drawn: nodes are as large as they are allowed to be there.
    pub cut_view: Option<View>,
    /// Factor of the depth offset, see [`crate::method::Settings::depth_offset`].
    pub depth_offset: f32,
    /// What faces away is dropped; else both sides count.
    pub cull_back: bool,
    /// Multiply by vertex colors.
    pub use_colors: bool,
    /// What decides the color.
    pub color_by: ColorBy,
    /// How surfaces are lit; positions in model space.
    pub light: Lighting,
}

/// Leaves from a place of [`Cut::leaves`] on are larger than a node that is drawn whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FirstLarge {
    index: usize,
    /// Number of splats that they are.
    splats: usize,
}

/// How often a triangle is cut into four; the pieces of one that is too large are itself.
fn cuts(diameter_px: f32, shade: &Shade) -> u32 {
    if diameter_px > LARGEST_PX {
        return 0;
    }
    let piece = PIECE_PX.max(shade.side_px);
    u32::from(diameter_px > piece) + u32::from(diameter_px > 2.0 * piece)
}

/// Projected diameter of a leaf, pixels; infinite where it reaches the eye.
fn diameter_px(model: &Model, leaf: u32, view: &View) -> f32 {
    let sphere = &model.tree.leaves[leaf as usize];
    let diameter = 2.0 * view.focal_px() * sphere.radius * view.model_scale;
    if view.is_perspective {
        diameter / view.distance(sphere.center).max(0.0)
    } else {
        diameter
    }
}

/// Moves the triangles of a cut that are to be drawn as splats to its leaves: all of them where `splats_only` says so;
/// else those that are small, if nearly all are.
pub fn take_triangles(model: &Model, view: &View, shade: &Shade, cut: &mut Cut) -> FirstLarge {
    let index = cut.leaves.len();
    let at_most = |leaf: u32, limit: f32| diameter_px(model, leaf, view) <= limit;
    if shade.splats_only {
        cut.leaves.append(&mut cut.triangles);
    } else {
        let small = cut
            .triangles
            .iter()
            .filter(|&&leaf| at_most(leaf, SMALL_PX));
        if small.count() as f32 >= LEAST_SMALL * cut.triangles.len() as f32 {
            let Cut {
                leaves, triangles, ..
            } = cut;
            leaves.extend(triangles.iter().filter(|&&leaf| at_most(leaf, LARGEST_PX)));
            triangles.retain(|&leaf| !at_most(leaf, LARGEST_PX));
        }
    }
    let large = cut.leaves[index..].iter();
    FirstLarge {
        index,
        splats: large.map(|&leaf| pieces(model, leaf, view, shade)).sum(),
    }
}

/// Number of pieces that a triangle is drawn in; 1 for a point.
fn pieces(model: &Model, leaf: u32, view: &View, shade: &Shade) -> usize {
    1 << (2 * cuts(diameter_px(model, leaf, view), shade))
}

/// Number of splats that [`splats`] writes at most.
pub fn splat_count(cut: &Cut, first_large: FirstLarge) -> usize {
    let strips: usize = cut.strips.iter().map(|s| s.count as usize).sum();
    cut.nodes.len() + strips + first_large.index + first_large.splats
}

/// The part of the frame that every splat needs.
struct Eye<'a> {
    tree: &'a Tree,
    view: &'a View,
    shade: Shade,
    /// Pixels of a model unit at distance 1 (perspective), or everywhere.
    focal_px: f32,
    /// Depth offset in half sides.
    offset_px: f32,
    /// To the right and up in the picture, unit vectors in model space.
    right: Vec3,
    up: Vec3,
    /// [`falsecolor::depth_range`].
    depth_range: [f32; 2],
    /// What surfaces make of the lamp, and the lamp; none with the headlight.
    lamp: Option<(Phong, Source)>,
}

/// How large a splat is drawn.
#[derive(Clone, Copy)]
struct Size {
    /// Share of its patch.
    share: f32,
    /// The way from one splat of a row to the next, model space; zero for a splat alone.
    step: Vec3,
    /// Diameter in pixels; the rectangle is not larger.
    diameter_px: f32,
    /// The rectangle is as large as the diameter, tilted: for patches that are not dense.
    is_own: bool,
}

impl Eye<'_> {
    fn splat(&self, patch: &Patch, size: Size, center: Vec3) -> Option<FilteredSplat> {
        let view = self.view;
        let (w, z) = if view.is_perspective {
            // Both in model units: the scale of the view cancels in the projected area.
            (view.eye - center, view.distance(center) / view.model_scale)
        } else {
            (view.backward, 1.0)
        };
        let distance = w.length();
        if !(z > 0.0 && distance > 0.0 && patch.area > 0.0) {
            return None;
        }
        let v = w / distance;
        let light = match view.light {
            Light::Point if view.is_perspective => v,
            _ => view.backward,
        };
        let (front, (lambert, highlight), facing, unit, flat) = if patch.is_bare {
            (patch.area, (1.0, 0.0), 1.0, Vec3::ZERO, 0.0)
        } else {
            let mut toward = patch.vector_area.dot(v);
            if !self.shade.cull_back {
                toward = toward.abs();
            }
            let both = patch.projection(v).max(toward.abs());
            let front = 0.5 * (both + toward);
            // Seen edge-on or from behind: covers nothing.
            if front <= 1e-4 * patch.area {
                return None;
            }
            let lit = match &self.lamp {
                None => {
                    let lambert = v.dot(patch.second_moment * light).abs() / both;
                    (lambert.min(1.0), 0.0)
                }
                Some((phong, source)) => self.in_lamp(phong, *source, patch, center, v, both),
            };
            let length = patch.vector_area.length();
            let cosine = if length > 0.0 { toward / length } else { 0.0 };
            (
                front,
                lit,
                cosine.clamp(0.1, 1.0),
                patch.vector_area.normalize_or_zero(),
                (length / patch.area).min(1.0),
            )
        };
        let area_px = if view.is_perspective {
            self.focal_px * self.focal_px * front * distance / (z * z * z)
        } else {
            self.focal_px * self.focal_px * front
        };
        let own = || [0, 1, 2].map(|i| f32::from(patch.color[i]) / 255.0);
        let lit = |base: [f32; 3]| base.map(|c| (c * ALBEDO * lambert + highlight).min(1.0));
        let color = match self.shade.color_by {
            ColorBy::Primitive => lit([1.0, 0.2, 0.2]),
            ColorBy::Shading | ColorBy::Classification if self.shade.use_colors => lit(own()),
            ColorBy::Shading | ColorBy::Classification => lit([1.0; 3]),
            ColorBy::Level => falsecolor::of_item(self.tree, patch.node),
            ColorBy::Normal => falsecolor::of_normal(self.normal(patch)),
            ColorBy::Depth => falsecolor::of_depth(view.distance(center), self.depth_range),
        };
        let limit = (self.shade.max_size_px - MARGIN_PX).max(1.0);
        let node_px = match &self.shade.cut_view {
            Some(of_cut) => {
                let grown = pixels_of_unit(view, center) / pixels_of_unit(of_cut, center);
                self.shade.side_px * grown
            }
            None => 0.0,
        };
        let diameter = size.diameter_px.max(node_px).min(limit);
        // Area in the mean plane, and pixels of a model unit there.
        let area = size.share * patch.vector_area.length().max(front);
        let scale = self.focal_px / z;
        let extent = |axis: Vec3| {
            let across = unit.dot(axis);
            let wide = if size.is_own {
                diameter * (1.0 - across * across * flat).max(0.0).sqrt()
            } else if patch.is_bare {
                diameter.max(1.0)
            } else if size.step == Vec3::ZERO {
                scale * (area * (1.0 - across * across).max(0.0)).sqrt()
            } else {
                let length = size.step.length();
                let beside = unit.cross(size.step / length).dot(axis);
                scale * (size.step.dot(axis).abs() + area / length * beside.abs())
            };
            wide.clamp(LEAST_EXTENT_PX, diameter.max(1.0))
        };
        let side = diameter.max(self.shade.side_px);
        Some(FilteredSplat {
            center,
            offset: self.offset_px
                * Self::depth_reach(patch, side * z / (2.0 * self.focal_px), facing, size.is_own),
            color,
            area_px: size.share * area_px,
            extent_px: [extent(self.right), extent(self.up)],
            side_px: side,
            unused: 0,
        })
    }

    /// How far behind one another the middles of neighboring patches lie whose squares are `half` to either side, in the
    /// world: as far as the plane falls off over that length, a little for what is next to a patch and not parallel to
    /// it, and their thickness along the ray; at most what a sphere of that radius takes, which a triangle has that is
    /// drawn as one large splat.
    fn depth_reach(patch: &Patch, half: f32, facing: f32, is_own: bool) -> f32 {
        if is_own {
            return half / facing;
        }
        let tangent = (1.0 - facing * facing).max(0.0).sqrt() / facing;
        let neighbors = OFFSET_OF_NEIGHBORS + OFFSET_OF_BEND * patch.bend;
        let range =
            half * (tangent + neighbors) + OFFSET_OF_THICKNESS * patch.half_thickness / facing;
        range.min(half / facing)
    }

    /// The mean shading normal of a patch, zero where there is none.
    fn normal(&self, patch: &Patch) -> Vec3 {
        match patch.node {
            _ if patch.is_bare => Vec3::ZERO,
            Some(id) => octahedral::decode(self.tree.attributes[id as usize].normal),
            None => patch.normals.normalize_or_zero(),
        }
    }

    /// The factor of the albedo and the highlight of a patch whose fronts and backs cover `both` as seen along `v`.
    fn in_lamp(
        &self,
        phong: &Phong,
        source: Source,
        patch: &Patch,
        center: Vec3,
        v: Vec3,
        both: f32,
    ) -> (f32, f32) {
        let l = match source {
            Source::Point(lamp) => (lamp - center.as_dvec3()).normalize_or_zero().as_vec3(),
            Source::Direction(direction) => direction.as_vec3(),
        };
        // Two-sided as it stands: an element of either side is lit when lamp and eye are on the same side of it.
        let of_second = v.dot(patch.second_moment * l);
        let length = (patch.normals.length() / patch.area).min(1.0);
        let mean = patch.normals.normalize_or_zero();
        let mean = if !self.shade.cull_back && mean.dot(v) < -LEAST_BACK {
            -mean
        } else {
            mean
        };
        // Q and N of a triangle have different normals, and their quotient is none.
        let lambert = if patch.is_triangle {
            mean.dot(l).max(0.0)
        } else {
            (of_second / both).max(0.0)
        };
        let cosine = mean.dot((l + v).normalize_or_zero()).clamp(0.0, 1.0);
        let rise = (mean.dot(l) / FULL_HIGHLIGHT).clamp(0.0, 1.0);
        let highlight = if rise > 0.0 && cosine > 0.0 {
            let s = phong.shininess;
            let k = length / (length + s * (1.0 - length));
            rise * phong.specular * (1.0 + k * s) / (1.0 + s) * cosine.powf(k * s)
        } else {
            0.0
        };
        let ambient = phong.ambient;
        (ambient + (1.0 - ambient) * lambert.min(1.0), highlight)
    }
}

/// Writes the splats of a cut and returns how many they are.
///
/// # Panics
/// When `out` is shorter than [`splat_count`].
pub fn splats(
    model: &Model,
    cut: &Cut,
    first_large: FirstLarge,
    view: &View,
    shade: Shade,
    out: &mut [FilteredSplat],
) -> usize {
    let axis = |row: usize| view.view_from_model.row(row).truncate() / view.model_scale;
    let eye = Eye {
        tree: &model.tree,
        view,
        shade,
        focal_px: if view.is_perspective {
            view.focal_px()
        } else {
            view.focal_px() * view.model_scale
        },
        offset_px: shade.depth_offset,
        right: axis(0),
        up: axis(1),
        depth_range: falsecolor::depth_range(model, view),
        lamp: match shade.light {
            Lighting::Headlight => None,
            Lighting::Phong(phong) => Some((phong, phong.lamp.in_model(view))),
        },
    };
    let of_rows = |rows: &[StripRun]| rows.iter().map(|row| row.count as usize).sum();
    let (small, large) = cut.leaves.split_at(first_large.index);
    let of_large = |leaves: &[u32]| leaves.iter().map(|&l| pieces(model, l, view, &shade)).sum();
    let parts = (cut
        .nodes
        .chunks(parts::PART)
        .map(|p| (Part::Nodes(p), p.len())))
    .chain(
        cut.strips
            .chunks(parts::PART)
            .map(|p| (Part::Rows(p), of_rows(p))),
    )
    .chain(
        small
            .chunks(parts::PART)
            .map(|p| (Part::Leaves(p), p.len())),
    )
    .chain(
        large
            .chunks(parts::PART)
            .map(|p| (Part::Large(p), of_large(p))),
    );
    let packed = parts::write(parts.collect(), out, |part, sink| match part {
        Part::Nodes(ids) => eye.nodes(model, ids, sink),
        Part::Rows(rows) => eye.rows(model, rows, sink),
        Part::Leaves(ids) => eye.leaves(model, ids, false, sink),
        Part::Large(ids) => eye.leaves(model, ids, true, sink),
    });
    packed.points
}

/// What one thread writes at a time.
enum Part<'a> {
    Nodes(&'a [u32]),
    Rows(&'a [StripRun]),
    Leaves(&'a [u32]),
    /// Leaves above the threshold.
    Large(&'a [u32]),
}

impl Eye<'_> {
    /// The size of a splat that stands for all of a patch no larger than the threshold.
    fn dense(&self) -> Size {
        Size {
            share: 1.0,
            step: Vec3::ZERO,
            diameter_px: self.shade.side_px,
            is_own: false,
        }
    }

    /// The side of a square of the threshold's size at a place, model units.
    fn side_at(&self, center: Vec3) -> f32 {
        let z = if self.view.is_perspective {
            self.view.distance(center).max(0.0) / self.view.model_scale
        } else {
            1.0
        };
        self.shade.side_px * z / self.focal_px
    }

    fn write(&self, patch: &Patch, size: Size, center: Vec3, sink: &mut Sink<'_, FilteredSplat>) {
        if let Some(splat) = self.splat(patch, size, center) {
            sink.point(splat);
        }
    }

    fn nodes(&self, model: &Model, ids: &[u32], sink: &mut Sink<'_, FilteredSplat>) {
        let dense = self.dense();
        for (index, &id) in ids.iter().enumerate() {
            if let Some(&next) = ids.get(index + parts::AHEAD) {
                ask_for(model, next);
            }
            let mut patch = Patch::of_node(model, id);
            if patch.area == 0.0 && model.is_cloud() {
                let (node, a) = (
                    &model.tree.nodes[id as usize],
                    &model.tree.attributes[id as usize],
                );
                let normal = a.has_normal().then(|| a.normal());
                patch = Patch::alone(node.center, normal, a.color, self.side_at(node.center));
            }
            self.write(&patch, dense, patch.center, sink);
        }
    }

    fn rows(&self, model: &Model, rows: &[StripRun], sink: &mut Sink<'_, FilteredSplat>) {
        for (index, &StripRun { node: id, count }) in rows.iter().enumerate() {
            if let Some(next) = rows.get(index + parts::AHEAD) {
                ask_for(model, next.node);
            }
            let patch = Patch::of_node(model, id);
            let node = &model.tree.nodes[id as usize];
            let size = Size {
                share: 1.0 / count as f32,
                step: strip_center(node, count, 1) - strip_center(node, count, 0),
                ..self.dense()
            };
            for i in 0..count {
                self.write(&patch, size, strip_center(node, count, i), sink);
            }
        }
    }

    /// Leaves; those that are not large are drawn with the threshold's size.
    fn leaves(
        &self,
        model: &Model,
        ids: &[u32],
        is_large: bool,
        sink: &mut Sink<'_, FilteredSplat>,
    ) {
        let (view, shade, dense) = (self.view, &self.shade, self.dense());
        let leaves: &[Leaf] = &model.tree.leaves;
        for (index, &leaf) in ids.iter().enumerate() {
            if let Some(&next) = ids.get(index + parts::AHEAD) {
                // Which corners it has was asked for when it was twice as far.
                for &corner in model.triangles.get(next as usize).into_iter().flatten() {
                    prefetch_index(&model.vertices, corner as usize);
                }
            }
            if let Some(&next) = ids.get(index + 2 * parts::AHEAD) {
                prefetch_index(&model.triangles, next as usize);
            }
            let Some(triangle) = model.triangles.get(leaf as usize) else {
                let point = &model.vertices[leaf as usize];
                let patch = match leaves[leaf as usize].radius {
                    radius if radius > 0.0 => Patch::of_point(point, radius),
                    _ => {
                        let normal =
                            (point.color[3] != 0).then(|| octahedral::decode(point.normal));
                        let side = self.side_at(point.position);
                        Patch::alone(point.position, normal, point.color, side)
                    }
                };
                let diameter_px = diameter_px(model, leaf, view);
                let is_own = diameter_px > shade.side_px;
                let size = Size {
                    diameter_px: diameter_px.max(shade.side_px),
                    is_own,
                    ..dense
                };
                self.write(&patch, size, patch.center, sink);
                continue;
            };
            let corners = triangle.map(|i| &model.vertices[i as usize]);
            let color = mean_color(&corners.map(|v| *v));
            let [a, b, c] = corners.map(|v| {
                let is_known = v.color[3] != 0;
                let normal = is_known.then(|| octahedral::decode(v.normal));
                (v.position, normal.unwrap_or(Vec3::ZERO))
            });
            let diameter_px = if is_large {
                diameter_px(model, leaf, view)
            } else {
                shade.side_px
            };
            let is_own = diameter_px > LARGEST_PX.max(shade.side_px);
            let cuts = cuts(diameter_px, shade);
            let size = Size {
                diameter_px: diameter_px / (1 << cuts) as f32,
                is_own,
                ..dense
            };
            in_pieces([a, b, c], cuts, &mut |piece| {
                let patch = Patch::of_triangle(piece, color);
                self.write(&patch, size, patch.center, sink);
            });
        }
    }
}

/// Asks for the memory of a node that is written a little later.
fn ask_for(model: &Model, node: u32) {
    let (tree, id) = (&model.tree, node as usize);
    prefetch_index(&*tree.nodes, id);
    prefetch_index(&*tree.attributes, id);
    prefetch_index(&*tree.moments, id);
}
