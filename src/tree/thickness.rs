//! How far what lies below a node reaches along its mean normal, where its corners are not at hand
//! ([`super::strip::StripCorners::half_thickness`] has them).

use super::{Leaf, Node, NodeAttributes};
use crate::abi::Vertex;
use crate::math::octahedral;
use glam::Vec3;

/// How far a slab cut out of a ball reaches along the unit vector `along`, from the ball's center: what lies within
/// `radius` of it and within `half` of the plane with the unit normal `normal`.
#[inline]
pub(super) fn reach(half: f32, radius: f32, normal: Vec3, along: Vec3) -> f32 {
    let cos = normal.dot(along).abs().min(1.0);
    if half >= radius * cos {
        // The ball's own farthest point lies in the slab.
        return radius;
    }
    // By the cross product: 1 - cos² would lose the small angles that decide here. By the share: the square of a radius
    // above 1.8e19 is infinite.
    let share = half / radius;
    half * cos + radius * (1.0 - share * share).max(0.0).sqrt() * normal.cross(along).length()
}

/// Half the thickness of `node`'s points along `normal`: each a disc across its own normal, as wide as its spacing, or a
/// ball where it has none.
pub(super) fn of_points(points: &[Vertex], leaves: &[Leaf], node: &Node, normal: Vec3) -> f32 {
    let far = |(point, leaf): (&Vertex, &Leaf)| {
        let beyond = if point.color[3] == 0 {
            leaf.radius
        } else {
            reach(0.0, leaf.radius, octahedral::decode(point.normal), normal)
        };
        (leaf.center - node.center).dot(normal).abs() + beyond
    };
    points.iter().zip(leaves).map(far).fold(0.0, f32::max)
}

/// A bound of half the thickness of `node` along `normal`, by the thickness of its children.
pub(super) fn of_children(
    nodes: &[Node],
    attributes: &[NodeAttributes],
    node: &Node,
    normal: Vec3,
) -> f32 {
    let far = |(child, own): (&Node, &NodeAttributes)| {
        let tolerance = NodeAttributes::THICKNESS_TOLERANCE * own.splat_radius;
        let half = own.half_thickness() + tolerance;
        (child.center - node.center).dot(normal).abs()
            + reach(half, own.splat_radius, own.normal(), normal)
    };
    nodes.iter().zip(attributes).map(far).fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reach_is_that_of_every_point_of_the_slab() {
        let normal = Vec3::new(0.3, -0.5, 0.8).normalize();
        let side = normal.any_orthonormal_vector();
        for half in [0.0f32, 0.1, 0.6, 1.0] {
            for step in 0..=20 {
                let angle = std::f32::consts::PI * step as f32 / 20.0;
                let along = normal * angle.cos() + side * angle.sin();
                // The farthest lies in the plane of both directions: all points of it there.
                let farthest = (0..3600)
                    .map(|i| (i as f32 * 0.1).to_radians())
                    .map(|a| normal * a.cos() + side * a.sin())
                    .filter(|p| p.dot(normal).abs() <= half + 1e-3)
                    .map(|p| p.dot(along))
                    .fold(0.0, f32::max);
                let found = reach(half, 1.0, normal, along);
                assert!(
                    (found - farthest).abs() < 3e-3,
                    "{half} {angle}: {found} {farthest}"
                );
            }
        }
    }
}
