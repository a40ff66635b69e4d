//! Which triangles of a cut are drawn as splats, and in how many pieces.

use crate::abi::constants::{LARGEST_PIECED_PX, LEAST_SMALL_SHARE, PIECE_PX, SMALL_PIECED_PX};
use crate::cut::Cut;
use crate::math::camera::View;
use crate::pack::filtered::FilteredShade;
#[cfg(doc)]
use crate::pack::filtered::splats;
use crate::tree::Model;

/// An edge that is halved more often would be wider than any picture.
const MOST_CUTS: u32 = 15;

/// Leaves from a place of [`Cut::leaves`] on are larger than a node that is drawn whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FirstLarge {
    pub(super) index: usize,
    /// Number of splats that they are.
    pub(super) splats: usize,
    /// The largest of them that is drawn in pieces, pixels.
    pub(super) halved_px: f32,
}

/// Which triangles are drawn as splats.
#[derive(Debug, Clone, Copy, PartialEq)]
struct TakenTriangles {
    /// The largest of them, pixels.
    largest_px: f32,
    /// The largest that is drawn in pieces.
    halved_px: f32,
    /// How many splats they become.
    splats: usize,
    /// How many triangles are left.
    left: usize,
}

/// How often a triangle is cut into four, of those up to `halved_px`; the piece of a larger one is itself.
pub(super) fn cuts(diameter_px: f32, shade: &FilteredShade, halved_px: f32) -> u32 {
    if diameter_px > halved_px {
        return 0;
    }
    let mut piece = PIECE_PX.max(shade.side_px);
    let mut cuts = 0;
    while diameter_px > piece && cuts < MOST_CUTS {
        piece *= 2.0;
        cuts += 1;
    }
    cuts
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

/// Which triangles of a cut are drawn as splats, of which there are `own` without them: all of them where `splats_only` says
/// so; else those that are small, if nearly all are; and what is left as well, if that is no more splats than the others.
fn taken(
    model: &Model,
    view: &View,
    shade: &FilteredShade,
    cut: &Cut,
    own: usize,
) -> TakenTriangles {
    let count = |&leaf: &u32| {
        let px = diameter_px(model, leaf, view);
        let is_large = usize::from(px > LARGEST_PIECED_PX);
        let halved_px = if shade.splats_only {
            LARGEST_PIECED_PX
        } else {
            f32::INFINITY
        };
        let mut pieces = [0; 2];
        pieces[is_large] = 1_usize << (2 * cuts(px, shade, halved_px));
        (usize::from(px <= SMALL_PIECED_PX), is_large, pieces)
    };
    let all = cut.triangles.len();
    let counts = cut.triangles.iter().map(count);
    let (small, large, [within, beyond]) = counts.fold((0, 0, [0; 2]), |a, b| {
        (a.0 + b.0, a.1 + b.1, [a.2[0] + b.2[0], a.2[1] + b.2[1]])
    });
    if shade.splats_only {
        return TakenTriangles {
            largest_px: f32::INFINITY,
            halved_px: LARGEST_PIECED_PX,
            splats: within + beyond,
            left: 0,
        };
    }
    let some = if small as f32 >= LEAST_SMALL_SHARE * all as f32 {
        TakenTriangles {
            largest_px: LARGEST_PIECED_PX,
            halved_px: LARGEST_PIECED_PX,
            splats: within,
            left: large,
        }
    } else {
        TakenTriangles {
            largest_px: 0.0,
            halved_px: LARGEST_PIECED_PX,
            splats: 0,
            left: all,
        }
    };
    let rest = within + beyond - some.splats;
    // A few among splats are less exact than splats of their size.
    if rest <= own + some.splats {
        return TakenTriangles {
            largest_px: f32::INFINITY,
            halved_px: f32::INFINITY,
            splats: within + beyond,
            left: 0,
        };
    }
    some
}

/// Splats of a cut without its triangles, at most.
fn own_count(cut: &Cut) -> usize {
    let strips: usize = cut.strips.iter().map(|s| s.count as usize).sum();
    cut.nodes.len() + strips + cut.leaves.len()
}

/// How many splats and triangles a cut is drawn as.
pub fn drawn_counts(model: &Model, view: &View, shade: &FilteredShade, cut: &Cut) -> [usize; 2] {
    let own = own_count(cut);
    let taken = taken(model, view, shade, cut, own);
    [own + taken.splats, taken.left]
}

/// Moves the triangles of a cut that are to be drawn as splats to its leaves.
pub fn take_triangles(
    model: &Model,
    view: &View,
    shade: &FilteredShade,
    cut: &mut Cut,
) -> FirstLarge {
    let index = cut.leaves.len();
    let taken = taken(model, view, shade, cut, own_count(cut));
    let Cut {
        leaves, triangles, ..
    } = cut;
    if taken.left == 0 {
        leaves.append(triangles);
    } else if taken.splats > 0 {
        let is_taken = |leaf: u32| diameter_px(model, leaf, view) <= taken.largest_px;
        leaves.extend(triangles.iter().filter(|&&leaf| is_taken(leaf)));
        triangles.retain(|&leaf| !is_taken(leaf));
    }
    FirstLarge {
        index,
        splats: taken.splats,
        halved_px: taken.halved_px,
    }
}

/// Number of pieces that a triangle is drawn in, of those up to `halved_px`; 1 for a point.
pub(super) fn pieces(
    model: &Model,
    leaf: u32,
    view: &View,
    shade: &FilteredShade,
    halved_px: f32,
) -> usize {
    1 << (2 * cuts(diameter_px(model, leaf, view), shade, halved_px))
}

/// Number of splats that [`splats`] writes at most.
pub fn splat_count(cut: &Cut, first_large: FirstLarge) -> usize {
    let strips: usize = cut.strips.iter().map(|s| s.count as usize).sum();
    cut.nodes.len() + strips + first_large.index + first_large.splats
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::{ColorBy, SurfaceLighting};

    #[test]
    fn pieces_are_no_larger_than_the_threshold_or_a_pixel_and_a_half() {
        for side_px in [1.0, 1.5, 2.0, 7.0] {
            let shade = FilteredShade {
                side_px,
                max_size_px: 255.0,
                splats_only: false,
                depth_offset: 3.0,
                cull_back: true,
                use_colors: true,
                color_by: ColorBy::Shading,
                depth_range: [0.0, 1.0],
                light: SurfaceLighting::Headlight,
                cut_view: None,
            };
            let piece = PIECE_PX.max(side_px);
            for px in [0.1, 1.0, 1.5, 1.51, 3.0, 5.9, 6.0, 100.0, 4000.0] {
                let cuts = cuts(px, &shade, f32::INFINITY);
                let of = |cuts: u32| px / (1 << cuts) as f32;
                assert!(of(cuts) <= piece, "{px} in {cuts}");
                assert!(cuts == 0 || of(cuts - 1) > piece, "{px} in {cuts}");
            }
            assert_eq!(cuts(100.0, &shade, 99.0), 0);
            let endless = cuts(f32::INFINITY, &shade, f32::INFINITY);
            assert_eq!(endless, MOST_CUTS, "it reaches the eye");
        }
    }
}
