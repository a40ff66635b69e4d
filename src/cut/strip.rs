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

use crate::cut::SizeMetric;
use crate::cut::frustum_and_size::NodeTester;
use crate::cut::siblings;
use crate::cut::siblings::PackedNodeLanes;
use crate::simd::FloatLanes;
use crate::tree::Node;
use glam::Vec3;

/// Most splats in a row; beyond, the children are looked at.
pub const MAX_COUNT: u32 = 16;

/// Widest strip over the ball that a splat stands for. Beyond, pieces are so short that a row is hardly
/// cheaper than the children.
pub(super) const MAX_WIDTH: f32 = 0.95;

/// The limits of counts are a little low, so that rounding there and in the size test cannot disagree.
pub(super) const LOW: f32 = 0.999_8;

/// What the count needs to know of the frame; lengths in the tester's unit.
struct StripFrame {
    is_perspective: bool,
    is_nearest: bool,
    twice_focal_px: f32,
    threshold_px: f32,
    near: f32,
}

/// Half length of the row (the strip with its round ends, within the ball) and width, over the node's radius.
#[inline]
fn relative_size(node: &Node) -> (f32, f32) {
    let (half, width) = (
        u16::from(node.strip.half_length),
        u16::from(node.strip.width),
    );
    let in_radii = |x: u16| f32::from(x) * (1.0 / 255.0);
    (in_radii((half + width).min(255)), in_radii(width))
}

/// The same of nodes, from the bytes of half length and width.
#[inline(always)]
pub(super) fn relative_sizes<V: FloatLanes>((half, width): (V, V)) -> (V, V) {
    (
        (half + width).min(half.all(255.0)) * (1.0 / 255.0),
        width * (1.0 / 255.0),
    )
}

/// How many splats cover the strips of nodes, and for which of them that is at most [`MAX_COUNT`] and
/// the strip thin enough (other lanes mean nothing).
///
/// In a perspective G is bounded once more, to spare a division: a <= κ' = t / 2f because no depth exceeds its
/// distance, so G >= κ' Z² (1 - κ'²) / S with Z the least depth and S the greatest distance, and
/// n² = H² S² / (K Z⁴ - ω² S²), K = (κ' (1 - κ'²))².
#[inline(always)]
fn counts<V: FloatLanes>(
    half: V,
    width: V,
    balls: &siblings::SphereLanes<V>,
    frame: &StripFrame,
) -> (V, V::Mask) {
    let (half, width) = (half * balls.radius, width * balls.radius);
    let nearest = balls.depth - half;
    let (t, f) = (frame.threshold_px, frame.twice_focal_px);
    let kappa = t / f;
    // `ball`: how deep a ball reaches in front of its center at most. The square of the count is
    // half² far² / (limit - width² far²).
    let (ball, limit, far_squared) = if !frame.is_perspective {
        (
            half.all(kappa),
            half.all(kappa * kappa * LOW),
            half.all(1.0),
        )
    } else if frame.is_nearest {
        let ball = nearest * (t / (f + t));
        (ball, ball * ball * LOW, half.all(1.0))
    } else {
        let far = balls.distance_squared().sqrt() + half;
        let low = kappa * (1.0 - kappa * kappa).max(0.0);
        let z_squared = nearest * nearest;
        (
            nearest * kappa,
            z_squared * z_squared * (low * low * LOW),
            far * far,
        )
    };
    let thick = width * width * far_squared;
    let squared = half * half * far_squared / (limit - thick);
    let fits = (nearest - ball).gt(half.all(frame.near))
        & nearest.gt(half.all(0.0))
        & thick.le(limit * (MAX_WIDTH * MAX_WIDTH))
        & squared.le(half.all((MAX_COUNT * MAX_COUNT) as f32));
    (squared.sqrt().ceil().max(half.all(2.0)), fits)
}

/// The ways from the centers of nodes to the ends of their rows, in the tester's unit.
#[inline(always)]
pub(super) fn half_rows<V: FloatLanes>(
    balls: &siblings::SphereLanes<V>,
    words: &PackedNodeLanes<V>,
) -> [V; 3] {
    let (half, _) = relative_sizes(words.strip());
    // As `octahedral::decode` unpacks what `NodeStrip::direction` gives it.
    let (x, y) = words.direction();
    let (x, y) = (x * (258.0 / 32767.0), y * (258.0 / 32767.0));
    let z = x.all(1.0) - x.abs() - y.abs();
    let fold = (-z).max(x.all(0.0));
    let (x, y) = (x - fold.copysign(x), y - fold.copysign(y));
    let scale = half * balls.radius / (x * x + y * y + z * z).sqrt();
    [x * scale, y * scale, z * scale]
}

impl NodeTester {
    /// Most splats in a row for each of the nodes from `first` on: fewer than there are leaves below, else
    /// the leaves are the better picture.
    ///
    /// Known without a look at them: the levels are complete and split evenly, so two levels up a node has
    /// about the average number of leaves, and three levels up at least as many as a row has splats.
    #[inline(always)]
    pub(super) fn most_in_row<V: FloatLanes>(&self, first: u32, words: &PackedNodeLanes<V>) -> V {
        let counts = words.child_counts();
        if first >= self.lowest_nodes {
            counts - 1.0
        } else if first >= self.low_nodes {
            counts.all(self.low_leaves.saturating_sub(1).min(MAX_COUNT) as f32)
        } else {
            counts.all(MAX_COUNT as f32)
        }
    }

    /// Which nodes may be rows of splats, before any root or division. Most are not: no ball that the
    /// threshold allows is wider than t z / 2 f, so the strip must be thinner than that, and short enough
    /// for a row of such balls.
    #[inline(always)]
    pub(super) fn may_be_rows<V: FloatLanes>(
        &self,
        balls: &siblings::SphereLanes<V>,
        words: &PackedNodeLanes<V>,
        most: V,
    ) -> u32 {
        let one = most.all(1.0);
        let depth = if self.is_perspective {
            balls.depth
        } else {
            one
        };
        let in_balls = balls.radius * self.ratio;
        let (half, width) = relative_sizes(words.strip());
        V::bits(
            width.lt(one)
                & (width * in_balls).le(depth * MAX_WIDTH)
                & (half * in_balls).le(depth * most),
        )
    }

    /// How many splats along their strips stand for the nodes, whole numbers, and for which nodes such a row will do (the
    /// numbers of others mean nothing).
    #[inline(always)]
    pub(super) fn rows<V: FloatLanes>(
        &self,
        balls: &siblings::SphereLanes<V>,
        words: &PackedNodeLanes<V>,
        most: V,
    ) -> (V, u32) {
        let frame = StripFrame {
            is_perspective: self.is_perspective,
            is_nearest: self.size == SizeMetric::Nearest,
            twice_focal_px: self.twice_focal_px,
            threshold_px: self.threshold_px,
            near: self.near,
        };
        let (half, width) = relative_sizes(words.strip());
        let (counts, fits) = counts(half, width, balls, &frame);
        (counts, V::bits(fits & counts.le(most)))
    }
}

/// Center of splat `index` (0 to `count` - 1) of a strip drawn as `count` splats, model space.
///
/// The balls around these centers of radius [`strip_ball_radius`] contain everything below the node. A count
/// of 0 counts as 1.
#[inline]
pub fn strip_center(node: &Node, count: u32, index: u32) -> Vec3 {
    strip_center_of(node, count)(index)
}

/// The same of all splats of a strip, to the bit.
#[inline]
pub fn strip_center_of(node: &Node, count: u32) -> impl Fn(u32) -> Vec3 + use<> {
    let (center, direction) = (node.center, node.strip.direction());
    let half = relative_size(node).0 * node.radius;
    let count = count.max(1) as f32;
    move |index| center + direction * (half * ((2 * index + 1) as f32 / count - 1.0))
}

/// The first of these centers, and the way from one to the next.
#[inline]
pub fn strip_steps(node: &Node, count: u32) -> (Vec3, Vec3) {
    let half = node.strip.direction() * (relative_size(node).0 * node.radius);
    let step = 2.0 / count.max(1) as f32;
    (node.center + half * (0.5 * step - 1.0), half * step)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cut::{CutSettings, StripRun};
    use crate::math::camera::Camera;
    use crate::tree::{Model, NodeStrip, NormalCone};
    use glam::DVec3;

    /// However the processor counts bits.
    #[test]
    fn splats_of_rows_are_those_of_each() {
        let mut rows: Vec<_> = (2..=MAX_COUNT).map(|n| StripRun::new(n, n)).collect();
        for (i, row) in rows.iter_mut().enumerate() {
            row.seen &= 0xa5c3_96f1u32.rotate_left(i as u32);
        }
        for end in 0..=rows.len() {
            let each = rows[..end].iter().map(|row| row.splats() as usize);
            assert_eq!(StripRun::splats_of(&rows[..end]), each.sum::<usize>());
        }
        assert!(StripRun::splats_of(&rows) > rows.len());
    }

    /// Four rows at once end where each ends by itself, whatever their directions.
    #[test]
    fn four_rows_are_as_long_as_each_is() {
        let model = Model::default();
        let camera = Camera::orbit((40, 30), DVec3::ZERO, 1.0, 0.7, 0.3, 1.0);
        let view = camera.view(DVec3::ZERO).expect("a usable camera");
        let tester = NodeTester::new(&model, &view, &CutSettings::default());
        for code in (-128i8..=127).step_by(3) {
            let nodes = [-128i8, -40, 3, 127].map(|other| Node {
                center: Vec3::new(0.3, -0.2, 0.1),
                radius: 0.01 * f32::from(code.unsigned_abs()),
                first_child: 0,
                cone: NormalCone::ALL,
                strip: NodeStrip {
                    direction: [code, other],
                    half_length: code as u8,
                    width: other as u8,
                },
                child_count: 2,
                flags: 0,
            });
            let (spheres, [_, axis, sine, shape]) = siblings::of_nodes(&nodes);
            let words = PackedNodeLanes { axis, sine, shape };
            let [x, y, z] = half_rows(&tester.balls(spheres), &words).map(|v| v.to_array());
            for (lane, node) in nodes.iter().enumerate() {
                let (first, step) = strip_steps(node, 2);
                let expected = (first + step * 1.5 - node.center) * tester.unit;
                let found = Vec3::new(x[lane], y[lane], z[lane]);
                let error = found.distance(expected);
                // Roundings of single precision, of the center as well.
                assert!(error <= 1e-6 * tester.unit, "{node:?}: {found} {expected}");
            }
        }
    }
}
