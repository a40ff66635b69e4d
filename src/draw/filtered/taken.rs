//! Which triangles of a cut are drawn as splats, and in how many pieces.

use super::Shade;
#[cfg(doc)]
use super::splats;
use crate::cut::Cut;
use crate::math::camera::View;
use crate::tree::Model;

/// Where most triangles have at most this diameter, triangles are drawn as splats: one sample a pixel says little of the
/// area of such a triangle.
const SMALL_PX: f32 = 3.0;
/// The largest triangles that are, then. Single larger ones would leave pixels of both kinds.
pub(super) const LARGEST_PX: f32 = 4.0 * PIECE_PX;
/// Pieces of triangles have at most this diameter: edges are halved until they do, which makes four of each.
const PIECE_PX: f32 = 1.5;
/// The share of a cut's triangles that must be small for that. A pixel of both kinds is less exact than one of either.
const LEAST_SMALL: f32 = 0.9;
/// Leaves from a place of [`Cut::leaves`] on are larger than a node that is drawn whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FirstLarge {
    pub(super) index: usize,
    /// Number of splats that they are.
    pub(super) splats: usize,
}

/// How often a triangle is cut into four; the pieces of one that is too large are itself.
pub(super) fn cuts(diameter_px: f32, shade: &Shade) -> u32 {
    if diameter_px > LARGEST_PX {
        return 0;
    }
    let piece = PIECE_PX.max(shade.side_px);
    u32::from(diameter_px > piece) + u32::from(diameter_px > 2.0 * piece)
}

/// Projected diameter of a leaf, pixels; infinite where it reaches the eye.
pub(super) fn diameter_px(model: &Model, leaf: u32, view: &View) -> f32 {
    let sphere = &model.tree.leaves[leaf as usize];
    let diameter = 2.0 * view.focal_px() * sphere.radius * view.model_scale;
    if view.is_perspective {
        diameter / view.distance(sphere.center).max(0.0)
    } else {
        diameter
    }
}

/// The largest diameter, pixels, of triangles that are drawn as splats: of all of them where `splats_only` says so; else of
/// those that are small, if nearly all are. None where none are.
fn largest_taken_px(model: &Model, view: &View, shade: &Shade, cut: &Cut) -> Option<f32> {
    if shade.splats_only {
        return Some(f32::INFINITY);
    }
    let is_small = |&&leaf: &&u32| diameter_px(model, leaf, view) <= SMALL_PX;
    let small = cut.triangles.iter().filter(is_small).count();
    (small as f32 >= LEAST_SMALL * cut.triangles.len() as f32).then_some(LARGEST_PX)
}

/// How many splats and triangles a cut is drawn as.
pub fn drawn_counts(model: &Model, view: &View, shade: &Shade, cut: &Cut) -> [usize; 2] {
    let own = splat_count(
        cut,
        FirstLarge {
            index: cut.leaves.len(),
            splats: 0,
        },
    );
    let Some(limit) = largest_taken_px(model, view, shade, cut) else {
        return [own, cut.triangles.len()];
    };
    let of = |&leaf: &u32| match diameter_px(model, leaf, view) {
        px if px <= limit => [1 << (2 * cuts(px, shade)), 0],
        _ => [0, 1],
    };
    let counts = cut.triangles.iter().map(of);
    counts.fold([own, 0], |a, b| [a[0] + b[0], a[1] + b[1]])
}

/// Moves the triangles of a cut that are to be drawn as splats to its leaves.
pub fn take_triangles(model: &Model, view: &View, shade: &Shade, cut: &mut Cut) -> FirstLarge {
    let index = cut.leaves.len();
    if let Some(limit) = largest_taken_px(model, view, shade, cut) {
        let Cut {
            leaves, triangles, ..
        } = cut;
        let is_taken = |leaf: u32| diameter_px(model, leaf, view) <= limit;
        leaves.extend(triangles.iter().filter(|&&leaf| is_taken(leaf)));
        triangles.retain(|&leaf| !is_taken(leaf));
    }
    let large = cut.leaves[index..].iter();
    FirstLarge {
        index,
        splats: large.map(|&leaf| pieces(model, leaf, view, shade)).sum(),
    }
}

/// Number of pieces that a triangle is drawn in; 1 for a point.
pub(super) fn pieces(model: &Model, leaf: u32, view: &View, shade: &Shade) -> usize {
    1 << (2 * cuts(diameter_px(model, leaf, view), shade))
}

/// Number of splats that [`splats`] writes at most.
pub fn splat_count(cut: &Cut, first_large: FirstLarge) -> usize {
    let strips: usize = cut.strips.iter().map(|s| s.count as usize).sum();
    cut.nodes.len() + strips + first_large.index + first_large.splats
}
