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

#[cfg(doc)]
use crate::abi::constants::FILTERED_SKIRT;
use crate::abi::constants::{FULL_HIGHLIGHT, LEAST_BACK};
use crate::abi::{FilteredSplat, Vertex};
use crate::cut::{Cut, StripRun, strip_center};
use crate::draw::splats::pixels_of_unit;
use crate::draw::{ALBEDO, ColorBy, Lighting, Phong, Source, falsecolor};
use crate::math::camera::{Light, View};
use crate::math::octahedral;
use crate::tree::{Model, Moments, Tree};
use glam::{Mat3, Vec3};

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
    let pieces = |&leaf: &u32| 1 << (2 * cuts(diameter_px(model, leaf, view), shade));
    FirstLarge {
        index,
        splats: cut.leaves[index..].iter().map(pieces).sum(),
    }
}

/// Number of splats that [`splats`] writes at most.
pub fn splat_count(cut: &Cut, first_large: FirstLarge) -> usize {
    let strips: usize = cut.strips.iter().map(|s| s.count as usize).sum();
    cut.nodes.len() + strips + first_large.index + first_large.splats
}

/// A patch as the sums have it.
struct Patch {
    center: Vec3,
    area: f32,
    vector_area: Vec3,
    /// Sum of shading normals times areas.
    normals: Vec3,
    /// There is one shading normal, which may differ from that of the area.
    is_triangle: bool,
    second_moment: Mat3,
    color: [u8; 4],
    /// The node; none of a leaf.
    node: Option<u32>,
    /// Nothing is known of its normals.
    is_bare: bool,
}

/// Mean of three colors.
fn mean_color(corners: &[Vertex; 3]) -> [u8; 4] {
    let channel =
        |i: usize| ((corners.iter().map(|v| u32::from(v.color[i])).sum::<u32>() + 1) / 3) as u8;
    [channel(0), channel(1), channel(2), 255]
}

/// Corner of a triangle: position and shading normal, zero where unknown.
type Corner = (Vec3, Vec3);

fn middle(a: Corner, b: Corner) -> Corner {
    ((a.0 + b.0) * 0.5, (a.1 + b.1) * 0.5)
}

/// Calls `visit` with the pieces of a triangle whose edges are halved `cuts` times.
fn in_pieces([a, b, c]: [Corner; 3], cuts: u32, visit: &mut impl FnMut([Corner; 3])) {
    if cuts == 0 {
        return visit([a, b, c]);
    }
    let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
    for piece in [[a, d, f], [d, b, e], [f, e, c], [d, e, f]] {
        in_pieces(piece, cuts - 1, visit);
    }
}

impl Patch {
    fn of_node(model: &Model, id: u32) -> Self {
        let node = &model.tree.nodes[id as usize];
        let attributes = &model.tree.attributes[id as usize];
        let moments = &model.tree.moments[id as usize];
        let unit = |code: i16| f32::from(code) * (1.0 / Moments::UNIT);
        let area = attributes.area;
        let [xx, yy, zz, xy, xz, yz] = moments.second_moment.map(|code| unit(code) * area);
        Self {
            center: node.center + Vec3::from(moments.centroid.map(unit)) * node.radius,
            area,
            vector_area: Vec3::from(moments.vector_area.map(unit)) * area,
            normals: Vec3::from(moments.vector_area.map(unit)) * area,
            is_triangle: false,
            second_moment: Mat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]),
            color: attributes.color,
            node: Some(id),
            is_bare: !attributes.has_normal(),
        }
    }

    /// A triangle. Its shading normal is the mean of its corners', as a picture of triangles interpolates it.
    fn of_triangle(corners: [Corner; 3], color: [u8; 4]) -> Self {
        let [a, b, c] = corners.map(|corner| corner.0);
        let vector_area = 0.5 * (b - a).cross(c - a);
        let shading: Vec3 = corners.iter().map(|c| c.1.normalize_or_zero()).sum();
        let s = shading.normalize_or(vector_area.normalize_or_zero());
        Self {
            center: (a + b + c) / 3.0,
            area: vector_area.length(),
            vector_area,
            normals: s * vector_area.length(),
            is_triangle: true,
            second_moment: Mat3::from_cols(vector_area * s.x, vector_area * s.y, vector_area * s.z),
            color,
            node: None,
            is_bare: false,
        }
    }

    /// The projected area of its fronts and backs together, as its sums bound it.
    fn projection(&self, v: Vec3) -> f32 {
        if self.is_triangle {
            return 0.0;
        }
        let least = v.dot(self.second_moment * v).max(0.0);
        0.5 * (least + (least * self.area).sqrt())
    }

    /// A point of a cloud with the distance to its neighbors.
    fn of_point(point: &Vertex, spacing: f32) -> Self {
        let area = crate::tree::area_of_point(spacing);
        let is_bare = point.color[3] == 0;
        let n = if is_bare {
            Vec3::ZERO
        } else {
            octahedral::decode(point.normal)
        };
        Self {
            center: point.position,
            area,
            vector_area: n * area,
            normals: n * area,
            is_triangle: true,
            second_moment: Mat3::from_cols(n * n.x, n * n.y, n * n.z) * area,
            color: point.color,
            node: None,
            is_bare,
        }
    }
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
            offset: self.offset_px * side * z / (2.0 * self.focal_px) / facing,
            color,
            area_px: size.share * area_px,
            extent_and_side_px: [extent(self.right), extent(self.up), side],
        })
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
    let tree = &model.tree;
    let axis = |row: usize| view.view_from_model.row(row).truncate() / view.model_scale;
    let eye = Eye {
        tree,
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
    let mut len = 0;
    let mut write = |splat: Option<FilteredSplat>| {
        if let Some(splat) = splat {
            out[len] = splat;
            len += 1;
        }
    };
    let dense = Size {
        share: 1.0,
        step: Vec3::ZERO,
        diameter_px: shade.side_px,
        is_own: false,
    };
    for &id in &cut.nodes {
        let patch = Patch::of_node(model, id);
        write(eye.splat(&patch, dense, patch.center));
    }
    for &StripRun { node: id, count } in &cut.strips {
        let patch = Patch::of_node(model, id);
        let node = &tree.nodes[id as usize];
        let size = Size {
            share: 1.0 / count as f32,
            step: strip_center(node, count, 1) - strip_center(node, count, 0),
            ..dense
        };
        for i in 0..count {
            write(eye.splat(&patch, size, strip_center(node, count, i)));
        }
    }
    for (index, &leaf) in cut.leaves.iter().enumerate() {
        let Some(triangle) = model.triangles.get(leaf as usize) else {
            let patch = Patch::of_point(
                &model.vertices[leaf as usize],
                tree.leaves[leaf as usize].radius,
            );
            let diameter_px = diameter_px(model, leaf, view);
            let is_own = diameter_px > shade.side_px;
            let size = Size {
                diameter_px: diameter_px.max(shade.side_px),
                is_own,
                ..dense
            };
            write(eye.splat(&patch, size, patch.center));
            continue;
        };
        let corners = triangle.map(|i| &model.vertices[i as usize]);
        let color = mean_color(&corners.map(|v| *v));
        let [a, b, c] = corners.map(|v| {
            let is_known = v.color[3] != 0;
            (
                v.position,
                if is_known {
                    octahedral::decode(v.normal)
                } else {
                    Vec3::ZERO
                },
            )
        });
        let diameter_px = if index < first_large.index {
            shade.side_px
        } else {
            diameter_px(model, leaf, view)
        };
        let is_own = diameter_px > LARGEST_PX.max(shade.side_px);
        let cuts = cuts(diameter_px, &shade);
        let size = Size {
            diameter_px: diameter_px / (1 << cuts) as f32,
            is_own,
            ..dense
        };
        in_pieces([a, b, c], cuts, &mut |piece| {
            let patch = Patch::of_triangle(piece, color);
            write(eye.splat(&patch, size, patch.center));
        });
    }
    len
}
