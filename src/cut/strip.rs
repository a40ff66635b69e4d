//! Needles: a node that is too large as one splat but thin may be drawn as a row of splats along its strip.
//!
//! Ours; no paper. Everything below a node lies in its bounding ball (center c, radius R) and in its capsule
//! (points within ω of the segment c ± h u). Both lie in the cylinder around u of radius ω and half length
//! H = min(h + ω, R). Cut it into n equal pieces; the middle of piece i is
//!
//! p_i = c + u H ((2 i + 1) / n - 1), i = 0 .. n - 1,
//!
//! and every point of the piece is within g = sqrt((H / n)² + ω²) of p_i. So the n balls (p_i, g) contain all
//! that the node contains, in space and hence in every projection. A splat of the threshold's size stands for
//! a ball whose projected diameter is at most the threshold: the row is as good as the single splat if that
//! holds for all n balls. With G a radius for which it holds wherever on the strip the ball is centered,
//! n = ceil(H / sqrt(G² - ω²)).
//!
//! G for a perspective: every center is at least z deep (z the node's depth less H) and at most D from the
//! eye (the node's distance plus H). Its projected major axis 2 f g sqrt(D_i² - g²) / (z_i² - g²) is then at most
//! 2 f g D / (z² - g²), which is at most the threshold t if g <= κ (z² - g²), κ = t / (2 f D). With a = κ z,
//! g = z a / (1 + a²) satisfies it: g + κ g² = z a (1 + 2 a²) / (1 + a²)² <= z a. The major axis bounds the
//! metrics center, angle and area; for `Nearest`, 2 f g / (z - g) <= t is g <= t z / (2 f + t).

use crate::tree::Node;
use glam::Vec3;

/// Most splats in a row; beyond, the children are looked at.
pub const MAX_COUNT: u32 = 16;

/// Widest strip over the ball that a splat stands for. Beyond, pieces are so short that a row is hardly
/// cheaper than the children.
pub(super) const MAX_WIDTH: f32 = 0.75;

/// What the count needs to know of the frame; lengths in the tester's unit.
pub(super) struct Frame {
    pub(super) is_perspective: bool,
    pub(super) is_nearest: bool,
    pub(super) twice_focal_px: f32,
    pub(super) threshold_px: f32,
    pub(super) near: f32,
}

/// Half length of the row (the strip with its round ends, within the ball) and width, over the node's radius.
#[inline]
pub(super) fn relative_size(node: &Node) -> (f32, f32) {
    let (half, width) = (
        u16::from(node.strip.half_length),
        u16::from(node.strip.width),
    );
    let in_radii = |x: u16| f32::from(x) * (1.0 / 255.0);
    (in_radii((half + width).min(255)), in_radii(width))
}

/// How many splats cover the strip of `node`, 2 to [`MAX_COUNT`]; 0 when a row does not fit. `radius`, `depth`
/// and `distance` are those of the node's ball, the depth along the view direction.
pub(super) fn count(node: &Node, radius: f32, depth: f32, distance: f32, frame: &Frame) -> u32 {
    let (half, width) = relative_size(node);
    let (half, width) = (half * radius, width * radius);
    let nearest = depth - half;
    let ball = if !frame.is_perspective {
        frame.threshold_px / frame.twice_focal_px
    } else if frame.is_nearest {
        frame.threshold_px * nearest / (frame.twice_focal_px + frame.threshold_px)
    } else {
        // z a / (1 + a²) with a = p / q
        let (p, q) = (
            frame.threshold_px * nearest,
            frame.twice_focal_px * (distance + half),
        );
        nearest * p * q / (q * q + p * p)
    };
    // A little below the limit, so that rounding here and in the size test cannot disagree.
    let ball = ball * 0.999_9;
    if !(nearest - ball > frame.near && ball > 0.0 && width <= MAX_WIDTH * ball) {
        return 0;
    }
    let count = (half * half / (ball * ball - width * width))
        .sqrt()
        .ceil()
        .max(2.0);
    if count <= MAX_COUNT as f32 {
        count as u32
    } else {
        0
    }
}

/// Center of splat `index` (0 to `count` - 1) of a strip drawn as `count` splats, model space.
///
/// The balls around these centers of radius [`strip_ball_radius`] contain everything below the node. A count
/// of 0 counts as 1.
#[inline]
pub fn strip_center(node: &Node, count: u32, index: u32) -> Vec3 {
    let along = (2 * index + 1) as f32 / count.max(1) as f32 - 1.0;
    node.center + node.strip.direction() * (relative_size(node).0 * node.radius * along)
}

/// Centers of the splats of a strip, in order along it.
pub fn strip_centers(node: &Node, count: u32) -> impl Iterator<Item = Vec3> {
    let node = *node;
    (0..count).map(move |i| strip_center(&node, count, i))
}

/// Radius in model units of the equal balls around the [`strip_center`]s that together contain everything
/// below the node.
pub fn strip_ball_radius(node: &Node, count: u32) -> f32 {
    let (half, width) = relative_size(node);
    let piece = half / count.max(1) as f32;
    (piece * piece + width * width).sqrt() * node.radius
}
