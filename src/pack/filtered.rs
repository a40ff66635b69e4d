//! From a cut to filtered splats: each patch of surface by its integrals, as the eye sees them.
//!
//! A node carries, over its triangles t of area A_t, unit normal n_t and shading normal s_t, the sums A = Σ A_t,
//! c = Σ A_t p_t / A, N = Σ A_t n_t and Q = Σ A_t (n_t s_tᵀ + s_t n_tᵀ) / 2 ([`crate::tree::SurfaceMoments`]). From an eye at e,
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
//! it. Patches are no squares, and such rectangles leave gaps. The squares of the first pass, of the threshold's side around
//! the center, as wide as a node may be, leave none; so what lies in one of them and in no rectangle takes the color of
//! pixels near by of its part of the surface ([`crate::abi::constants::FILTERED_REACH_PX`]). A leaf larger than the threshold has a rectangle of its own diameter, tilted likewise.

mod device_constants;
mod eye;
mod ids;
mod patch;
mod patch_x4;
mod projection;
mod screen_groups;
mod strip_batches;
mod triangle_patches;
mod triangle_subdivision;

pub use crate::pack::filtered::device_constants::device_constants;
pub use crate::pack::filtered::ids::ids;
pub use crate::pack::filtered::projection::FilteredPatch;
pub use crate::pack::filtered::triangle_subdivision::{
    FirstLarge, drawn_counts, splat_count, take_triangles,
};

pub use crate::pack::filtered::screen_groups::ScreenGroups;

use crate::abi::FilteredSplat;
use crate::abi::constants::{LEAST_SLOPED, SLOPE_LEVELS};
use crate::cut::{Cut, StripRun, strip_steps};
use crate::math::camera::View;
use crate::math::octahedral;
use crate::pack::filtered::eye::FilteredEye;
use crate::pack::filtered::patch::{SummedPatch, in_pieces};
use crate::pack::filtered::patch_x4::{ColorSlope, FourPatches, SplatSizes, Vectors};
use crate::pack::filtered::strip_batches::{RowGroup, WaitingLeaves};
use crate::pack::filtered::triangle_patches::{Triangle, piece_color, triangle_of};
use crate::pack::filtered::triangle_subdivision::{cuts, diameter_px, pieces};
use crate::pack::parallel;
use crate::pack::parallel::RecordSink;
use crate::pack::{ColorBy, SurfaceLighting};
use crate::tree::{Leaf, Model, Node};
use glam::{Vec3, Vec4};
use prefetch_index::prefetch_index;
use std::ops::Range;

/// Largest point size that is spent on the spread of a rectangle's edges over pixels.
const MARGIN_PX: f32 = 2.0;

/// What the weights of a frame depend on besides the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilteredShade {
    /// Side of the square of a node, pixels.
    pub side_px: f32,
    /// Largest point that the device draws, pixels.
    pub max_size_px: f32,
    /// Draw every triangle as a splat.
    pub splats_only: bool,
    /// The view of the cut, where it is not the one that is drawn: nodes are as large as they are allowed to be there.
    pub cut_view: Option<View>,
    /// Factor of the depth offset, see [`crate::render::Settings::depth_offset`].
    pub depth_offset: f32,
    /// What faces away is dropped; else both sides count.
    pub cull_back: bool,
    /// Multiply by vertex colors.
    pub use_colors: bool,
    /// What decides the color.
    pub color_by: ColorBy,
    /// Distances of [`ColorBy::Depth`]: [`falsecolor::depth_range`](crate::pack::falsecolor::depth_range).
    pub depth_range: [f32; 2],
    /// How surfaces are lit; positions in model space.
    pub light: SurfaceLighting,
}

/// Splats in a list, with gaps between them.
#[derive(Debug)]
pub struct GappedSplats {
    parts: Vec<Range<usize>>,
    /// The splats by the rows that they touch, for [`crate::render::cpu::filtered::draw`].
    pub groups: ScreenGroups,
}

impl GappedSplats {
    /// Moves them together to the start of the list; how many they are.
    pub fn close_gaps(&self, out: &mut [FilteredSplat]) -> usize {
        parallel::close_gaps(&self.parts, out)
    }

    /// How many they are.
    pub fn count(&self) -> usize {
        self.parts.iter().map(|part| part.len()).sum()
    }
}

/// Writes the splats of a cut, without gaps, and returns how many they are.
///
/// # Panics
/// When `out` is shorter than [`splat_count`].
pub fn splats(
    model: &Model,
    cut: &Cut,
    first_large: FirstLarge,
    view: &View,
    shade: FilteredShade,
    out: &mut [FilteredSplat],
) -> usize {
    write(model, cut, first_large, view, shade, out).close_gaps(out)
}

/// Writes the splats of a cut and returns where they are.
///
/// # Panics
/// When `out` is shorter than [`splat_count`].
pub fn write(
    model: &Model,
    cut: &Cut,
    first_large: FirstLarge,
    view: &View,
    shade: FilteredShade,
    out: &mut [FilteredSplat],
) -> GappedSplats {
    let eye = FilteredEye::new(&model.tree, view, shade);
    let parts = parts_of(model, cut, first_large, view, &shade);
    let mut groups: Vec<ScreenGroups> = parts.iter().map(|_| ScreenGroups::default()).collect();
    let mut first = 0;
    let jobs = parts.into_iter().zip(&mut groups);
    let jobs = jobs.map(|((part, size), groups)| {
        let job = (part, first, groups);
        first += size;
        (job, size)
    });
    let parts = parallel::write_apart(jobs.collect(), out, |(part, first, groups), sink| {
        match part {
            FilteredPart::Nodes(ids) => eye.nodes(model, ids, sink),
            FilteredPart::Rows(rows) => eye.rows(model, rows, sink),
            FilteredPart::Leaves(ids) => eye.leaves(model, ids, None, sink),
            FilteredPart::Large(ids) => eye.leaves(model, ids, Some(first_large.halved_px), sink),
        }
        // While they are in the cache.
        groups.add(first, sink.written());
    });
    let mut all = ScreenGroups::default();
    groups.into_iter().for_each(|groups| all.append(groups));
    GappedSplats { parts, groups: all }
}

/// Splits a cut into what threads write at a time, each part with the number of its splats at most.
fn parts_of<'a>(
    model: &Model,
    cut: &'a Cut,
    first_large: FirstLarge,
    view: &View,
    shade: &FilteredShade,
) -> Vec<(FilteredPart<'a>, usize)> {
    let of_rows = |rows: &[StripRun]| rows.iter().map(|row| row.count as usize).sum();
    let (small, large) = cut.leaves.split_at(first_large.index);
    let of_large = |leaves: &[u32]| {
        leaves
            .iter()
            .map(|&l| pieces(model, l, view, shade, first_large.halved_px))
            .sum()
    };
    (cut.nodes
        .chunks(parallel::PART)
        .map(|p| (FilteredPart::Nodes(p), p.len())))
    .chain(
        cut.strips
            .chunks(parallel::PART)
            .map(|p| (FilteredPart::Rows(p), of_rows(p))),
    )
    .chain(
        small
            .chunks(parallel::PART)
            .map(|p| (FilteredPart::Leaves(p), p.len())),
    )
    .chain(
        large
            .chunks(parallel::PART)
            .map(|p| (FilteredPart::Large(p), of_large(p))),
    )
    .collect()
}

/// What one thread writes at a time.
enum FilteredPart<'a> {
    Nodes(&'a [u32]),
    Rows(&'a [StripRun]),
    Leaves(&'a [u32]),
    /// Leaves above the threshold.
    Large(&'a [u32]),
}

impl FilteredEye<'_> {
    /// The size of a splat that stands for all of a patch no larger than the threshold.
    fn dense(&self) -> SplatSizes {
        SplatSizes {
            share: Vec4::ONE,
            is_row: false,
            step: [Vec4::ZERO; 3],
            diameter_px: Vec4::splat(self.shade.side_px),
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

    fn nodes(&self, model: &Model, ids: &[u32], sink: &mut RecordSink<'_, FilteredSplat>) {
        let size = self.dense();
        let is_cloud = model.kind().is_points();
        for (index, group) in ids.chunks(4).enumerate() {
            for &next in ids.iter().skip(4 * index + parallel::AHEAD).take(4) {
                ask_for(model, next);
            }
            let four = FourPatches::of_nodes(model, filled(group));
            if is_cloud && four.has_nothing() {
                self.points(model, group, sink);
                continue;
            }
            let seen = self.seen(&four);
            let colors = self.lit(&four, &seen);
            let patch = |lane: usize| SummedPatch::of_node(model, group[lane]);
            let group = (&four, &seen, group.len());
            self.splats(group, &size, &colors, patch, |splat| sink.point(splat));
        }
    }

    /// Nodes of a cloud, some of which are points in one place.
    fn points(&self, model: &Model, ids: &[u32], sink: &mut RecordSink<'_, FilteredSplat>) {
        let size = self.dense();
        for &id in ids {
            let (node, attributes) = (
                &model.tree.nodes[id as usize],
                &model.tree.attributes[id as usize],
            );
            let four = if attributes.area > 0.0 {
                FourPatches::of_nodes(model, [id; 4])
            } else {
                let normal = attributes.has_normal().then(|| attributes.normal());
                let side = self.side_at(node.center);
                let patch = SummedPatch::alone(node.center, normal, attributes.color, side);
                FourPatches::of_points([&patch; 4])
            };
            let seen = self.seen(&four);
            let colors = self.lit(&four, &seen);
            let patch = |_| SummedPatch::of_node(model, id);
            self.splats((&four, &seen, 1), &size, &colors, patch, |splat| {
                sink.point(splat)
            });
        }
    }

    fn rows(&self, model: &Model, rows: &[StripRun], sink: &mut RecordSink<'_, FilteredSplat>) {
        let nodes: &[Node] = &model.tree.nodes;
        // Splats of several rows together, so that no lane is idle.
        let mut group = RowGroup::default();
        for (
            index,
            &StripRun {
                node: id, count, ..
            },
        ) in rows.iter().enumerate()
        {
            if let Some(next) = rows.get(index + 2 * parallel::AHEAD) {
                ask_for(model, next.node);
            }
            if let Some(next) = rows.get(index + parallel::AHEAD)
                && next.count >= LEAST_SLOPED
            {
                let node = &nodes[next.node as usize];
                if !node.has_leaves() {
                    ask_for(model, node.first_child);
                }
            }
            let node = &nodes[id as usize];
            let (start, step) = strip_steps(node, count);
            let slope = (count >= LEAST_SLOPED && self.is_plain())
                .then(|| self.slope(model, node))
                .flatten();
            if let Some(slope) = &slope {
                self.row_group(model, &mut group, None, sink);
                let of_row = FourPatches::of_nodes(model, [id; 4]);
                let mean = self.lit(&of_row, &self.seen(&of_row));
                let slope = (slope, &mean, of_row.center);
                for i in 0..count {
                    if group.add(id, start + step * i as f32, step, count) {
                        self.row_group(model, &mut group, Some(slope), sink);
                    }
                }
                self.row_group(model, &mut group, Some(slope), sink);
            } else {
                for i in 0..count {
                    if group.add(id, start + step * i as f32, step, count) {
                        self.row_group(model, &mut group, None, sink);
                    }
                }
            }
        }
        self.row_group(model, &mut group, None, sink);
    }

    /// Writes what is in the group, and empties it. A slope is that of all of it.
    fn row_group(
        &self,
        model: &Model,
        group: &mut RowGroup,
        slope: Option<(&ColorSlope, &Vectors, Vectors)>,
        sink: &mut RecordSink<'_, FilteredSplat>,
    ) {
        let Some(ids) = group.ids.get(..group.count).filter(|ids| !ids.is_empty()) else {
            return;
        };
        let four = FourPatches::of_nodes(model, filled(ids)).at(group.centers);
        let seen = self.seen(&four);
        let colors = match slope {
            Some((slope, mean, middle)) => slope.from(mean, middle, &four),
            None => self.lit(&four, &seen),
        };
        let size = SplatSizes {
            share: Vec4::from_array(group.shares),
            is_row: true,
            step: patch_x4::vectors(group.steps),
            ..self.dense()
        };
        let patch = |lane: usize| SummedPatch::of_node(model, ids[lane]);
        let splats = (&four, &seen, ids.len());
        self.splats(splats, &size, &colors, patch, |splat| sink.point(splat));
        group.count = 0;
    }

    /// How the color changes along the row of a node: as it does between its children, or where these lie side by side
    /// (needles do), between theirs.
    fn slope(&self, model: &Model, node: &Node) -> Option<ColorSlope> {
        let mut parent = *node;
        for _ in 0..SLOPE_LEVELS {
            let (first, count) = (
                parent.first_child,
                u32::from(parent.child_count).clamp(1, 4),
            );
            let ids = [0, 1, 2, 3].map(|i: u32| first + i.min(count - 1));
            let four = if !parent.has_leaves() {
                FourPatches::of_nodes(model, ids)
            } else if model.kind().is_surface() {
                let triangles = ids.map(|leaf| triangle_of(model, leaf as usize));
                FourPatches::of_triangles(triangles.each_ref())
            } else {
                return None;
            };
            let seen = self.seen(&four);
            let colors = self.lit(&four, &seen);
            let lanes = seen.lanes & ((1 << count) - 1);
            let slope = ColorSlope::new((&four, lanes), seen.front, &colors, node);
            if slope.is_some() || parent.has_leaves() || lanes == 0 {
                return slope;
            }
            parent = model.tree.nodes[(first + lanes.trailing_zeros()) as usize];
        }
        None
    }

    /// Leaves of triangles. Those that are large are drawn in pieces, if they have at most so many pixels; the others with the
    /// threshold's size.
    fn leaves(
        &self,
        model: &Model,
        ids: &[u32],
        halved_px: Option<f32>,
        sink: &mut RecordSink<'_, FilteredSplat>,
    ) {
        let (view, shade) = (self.view, &self.shade);
        let Some(&first) = ids.first() else {
            return;
        };
        if !model.kind().is_surface() {
            return self.leaf_points(model, ids, sink);
        }
        let textures = model.textures.as_deref();
        let mut group = WaitingLeaves::new(self, triangle_of(model, first as usize));
        for (index, &leaf) in ids.iter().enumerate() {
            if let Some(&next) = ids.get(index + parallel::AHEAD) {
                // Which corners it has was asked for when it was twice as far.
                for &corner in model.triangles.get(next as usize).into_iter().flatten() {
                    prefetch_index(&model.vertices, corner as usize);
                }
            }
            if let Some(&next) = ids.get(index + 2 * parallel::AHEAD) {
                prefetch_index(&model.triangles, next as usize);
            }
            let triangle = triangle_of(model, leaf as usize);
            let Some(halved_px) = halved_px else {
                group.add(triangle, shade.side_px, false, sink);
                continue;
            };
            let diameter_px = diameter_px(model, leaf, view);
            let is_own = diameter_px > halved_px.max(shade.side_px);
            let cuts = cuts(diameter_px, shade, halved_px);
            let diameter_px = diameter_px / (1 << cuts) as f32;
            in_pieces(triangle.corners, cuts, &mut |corners| {
                let piece = Triangle {
                    corners,
                    color: match (cuts, textures) {
                        (1.., Some(textures)) => piece_color(model, textures, leaf, &corners),
                        _ => None,
                    }
                    .unwrap_or(triangle.color),
                };
                group.add(piece, diameter_px, is_own, sink);
            });
        }
        group.flush(sink);
    }

    /// Leaves of a cloud.
    fn leaf_points(&self, model: &Model, ids: &[u32], sink: &mut RecordSink<'_, FilteredSplat>) {
        let (view, shade) = (self.view, &self.shade);
        let leaves: &[Leaf] = &model.tree.leaves;
        let patch_of = |leaf: u32| {
            let point = &model.vertices[leaf as usize];
            match leaves[leaf as usize].radius {
                radius if radius > 0.0 => SummedPatch::of_point(point, radius),
                _ => {
                    let normal = (point.color[3] != 0).then(|| octahedral::decode(point.normal));
                    let side = self.side_at(point.position);
                    SummedPatch::alone(point.position, normal, point.color, side)
                }
            }
        };
        let mut group = WaitingLeaves::new(self, patch_of(ids[0]));
        for &leaf in ids {
            let diameter_px = diameter_px(model, leaf, view);
            let is_own = diameter_px > shade.side_px;
            group.add(patch_of(leaf), diameter_px.max(shade.side_px), is_own, sink);
        }
        group.flush(sink);
    }
}

/// Up to four items, the last of them repeated.
#[inline]
fn filled(items: &[u32]) -> [u32; 4] {
    [0, 1, 2, 3].map(|i: usize| items[i.min(items.len() - 1)])
}

/// Asks for the memory of a node that is written a little later.
fn ask_for(model: &Model, node: u32) {
    let (tree, id) = (&model.tree, node as usize);
    prefetch_index(&*tree.nodes, id);
    prefetch_index(&*tree.attributes, id);
    prefetch_index(&*tree.moments, id);
}
