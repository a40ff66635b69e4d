//! The distance of a point from the whole surface, through the bounding spheres of the tree.

use crate::tree::Model;
use glam::Vec3;

/// Depth of the stack: three siblings wait on each of at most 32 levels.
const STACK: usize = 100;

/// Nearest-point search in a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct SurfaceDistance<'a> {
    model: &'a Model,
}

/// A triangle near a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct NearestLeaf {
    /// Distance of the point from it; infinite where none was found.
    pub(super) distance: f32,
    /// Number of the triangle.
    pub(super) leaf: u32,
    /// Nearest point of the triangle.
    pub(super) place: Vec3,
}

impl NearestLeaf {
    const NONE: Self = Self {
        distance: f32::INFINITY,
        leaf: 0,
        place: Vec3::ZERO,
    };
}

impl<'a> SurfaceDistance<'a> {
    pub(super) fn new(model: &'a Model) -> Self {
        Self { model }
    }

    /// Distance of `point` from the surface. Ends early with any distance of at most `enough`. The search begins below `near`
    /// and goes up from there: what is near in space is near in the tree, most often.
    pub(super) fn of(&self, point: Vec3, near: u32, enough: f32) -> f32 {
        self.nearest(point, near, enough).distance
    }

    /// The triangle that is nearest to `point`, or with early ends one that is near `enough`.
    pub(super) fn nearest(&self, point: Vec3, near: u32, enough: f32) -> NearestLeaf {
        let tree = &self.model.tree;
        let mut best = self.below(near, point, NearestLeaf::NONE, enough);
        let mut node = near;
        while best.distance > enough && node != 0 {
            let parent = tree.parents[node as usize];
            for sibling in tree.children(parent) {
                let ball = &tree.nodes[sibling as usize];
                if sibling != node && may_be_nearer(point, ball.center, ball.radius, best.distance)
                {
                    best = self.below(sibling, point, best, enough);
                }
            }
            node = parent;
        }
        best
    }

    /// The nearer of `best` and what is below a node.
    fn below(&self, node: u32, point: Vec3, mut best: NearestLeaf, enough: f32) -> NearestLeaf {
        let tree = &self.model.tree;
        // Nodes that wait, each with its least distance; the nearest last.
        let mut stack = [(0.0f32, node); STACK];
        let mut height = 1;
        while height > 0 && best.distance > enough {
            height -= 1;
            let (least, node) = stack[height];
            if least >= best.distance {
                continue;
            }
            let children = tree.children(node);
            if tree.nodes[node as usize].has_leaves() {
                for leaf in children {
                    let ball = &tree.leaves[leaf as usize];
                    if may_be_nearer(point, ball.center, ball.radius, best.distance) {
                        let corners = self.model.triangles[leaf as usize]
                            .map(|corner| self.model.vertices[corner as usize].position);
                        let place = nearest_in_triangle(point, corners);
                        let distance = point.distance(place);
                        if distance < best.distance {
                            best = NearestLeaf {
                                distance,
                                leaf,
                                place,
                            };
                        }
                    }
                }
                continue;
            }
            let mut near = [(0.0f32, 0.0f32, 0u32); 4];
            let mut count = 0;
            for child in children {
                let ball = &tree.nodes[child as usize];
                let squared = point.distance_squared(ball.center);
                let reach = ball.radius * 1.000_001 + best.distance;
                if squared >= reach * reach || count == near.len() {
                    continue;
                }
                let mut at = count;
                while at > 0 && near[at - 1].0 < squared {
                    near[at] = near[at - 1];
                    at -= 1;
                }
                near[at] = (squared, ball.radius, child);
                count += 1;
            }
            for &(squared, radius, child) in &near[..count] {
                if height < STACK {
                    let least = squared.sqrt() * 0.999_999 - radius * 1.000_001;
                    stack[height] = (least, child);
                    height += 1;
                }
            }
        }
        best
    }
}

/// Tells whether something in a ball may be nearer than `best`; errs to yes.
#[inline]
fn may_be_nearer(point: Vec3, center: Vec3, radius: f32, best: f32) -> bool {
    let reach = radius * 1.000_001 + best;
    point.distance_squared(center) * 0.999_999 < reach * reach
}

/// Nearest point of a triangle (Ericson, *Real-Time Collision Detection*, section 5.1.5).
fn nearest_in_triangle(p: Vec3, [a, b, c]: [Vec3; 3]) -> Vec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    let (toward_c, toward_b) = (d4 - d3, d5 - d6);
    if va <= 0.0 && toward_c >= 0.0 && toward_b >= 0.0 {
        return b + (c - b) * (toward_c / (toward_c + toward_b));
    }
    let sum = va + vb + vc;
    if sum > 0.0 {
        a + ab * (vb / sum) + ac * (vc / sum)
    } else {
        a
    }
}

/// Parts of the corners of a triangle in a point of it; their sum is 1.
pub(super) fn corner_shares([a, b, c]: [Vec3; 3], point: Vec3) -> [f32; 3] {
    let normal = (b - a).cross(c - a);
    let part = |from: Vec3, to: Vec3| (to - from).cross(point - from).dot(normal).max(0.0);
    let weights = [part(b, c), part(c, a), part(a, b)];
    let sum: f32 = weights.iter().sum();
    weights.map(|weight| if sum > 0.0 { weight / sum } else { 1.0 / 3.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patches::tests::model_of;

    /// Distances through the tree are those from all triangles, and early ends are no nearer than the truth.
    #[test]
    fn the_distance_is_that_from_the_nearest_triangle() {
        let model = model_of("statue:2000");
        let surface = SurfaceDistance::new(&model);
        let mut state = 5u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((state >> 40) as f32) / (1u64 << 23) as f32 - 1.0
        };
        for round in 0..400u32 {
            let point = Vec3::new(random(), random(), random()) * 1.5;
            let all = model.triangles.iter().map(|triangle| {
                let corners = triangle.map(|corner| model.vertices[corner as usize].position);
                point.distance(nearest_in_triangle(point, corners))
            });
            let expected = all.fold(f32::INFINITY, f32::min);
            let near = round % model.tree.nodes.len() as u32;
            let found = surface.of(point, near, 0.0);
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
            let early = surface.of(point, near, expected * 1.5);
            assert!((expected - 1e-5..=expected * 1.5 + 1e-5).contains(&early));
        }
    }

    #[test]
    fn the_nearest_point_of_a_triangle_may_be_inside_on_an_edge_or_a_corner() {
        let triangle = [Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0];
        for (point, expected) in [
            (Vec3::new(0.5, 0.5, 3.0), Vec3::new(0.5, 0.5, 0.0)),
            (Vec3::new(1.0, -1.0, 0.0), Vec3::X),
            (Vec3::new(2.0, 2.0, 1.0), Vec3::new(1.0, 1.0, 0.0)),
            (Vec3::new(-1.0, 1.0, 0.0), Vec3::Y),
            (Vec3::new(-1.0, -1.0, 0.0), Vec3::ZERO),
            (Vec3::new(5.0, -1.0, 0.0), Vec3::X * 2.0),
            (Vec3::new(-1.0, 5.0, 0.0), Vec3::Y * 2.0),
        ] {
            assert!(nearest_in_triangle(point, triangle).distance(expected) < 1e-6);
        }
    }
}
