//! How large the splat of a point is, and what it has to cover (methods 11.2).
//!
//! Dietz takes 0.65 or 0.5 of the distance to the farthest neighbor. Half is too small for every equilateral triangle, whose
//! corners are 0.5774 sides from its middle; 0.65 is enough for planes alone.
//!
//! The rule that covers: a point answers for the part of each face around it that is nearer to it than to the other two
//! corners. Those parts fill the face, and the corners of each part lie at most the radius of the face's circle from the
//! point. A splat that contains them all covers, and of all radii that one is the least.

use crate::oriented::surface::WeldedSurface;
use glam::DVec3;

/// Radius of splats from vertices.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum RadiusRule {
    /// The least that covers what a point answers for.
    #[default]
    Cover,
    /// 0.65 of the distance to the farthest neighbor.
    Dietz,
    /// Half of that distance.
    Dietz50,
}

/// The part of a triangle that is nearer to its corner `a` than to the other two: its corners, beginning with `a`. It is
/// convex, and lies in the plane of the triangle.
pub fn own_part([a, b, c]: [DVec3; 3]) -> OwnPart {
    let (to_b, to_c) = (b - a, c - a);
    let [b_b, b_c, c_c] = [to_b.dot(to_b), to_b.dot(to_c), to_c.dot(to_c)];
    let point = |s: f64, t: f64| a + s * to_b + t * to_c;
    // The bisector of a and b is s b.b + t b.c = b.b / 2, that of a and c likewise.
    let determinant = b_b * c_c - b_c * b_c;
    let mut part = OwnPart::of(&[a, point(0.5, 0.0)]);
    let middle = (
        c_c * (b_b - b_c) / (2.0 * determinant),
        b_b * (c_c - b_c) / (2.0 * determinant),
    );
    let (s, t) = middle;
    let is_inside = s >= 0.0 && t >= 0.0 && s + t <= 1.0;
    if is_inside {
        part.push(point(s, t));
    } else if s + t > 1.0 {
        // The angle at a is obtuse: both bisectors reach the side opposite.
        for (from, to) in [(b, c), (c, b)] {
            let (side, to_near) = (to - from, from - a);
            // On the side from `from`: as far from it as from a.
            let along = to_near.length_squared() / (-2.0 * to_near.dot(side));
            part.push(from + along.clamp(0.0, 1.0) * side);
        }
    } else if t < 0.0 {
        // Obtuse at c: the bisector of a and c leaves by the side a b, before the middle of that.
        let along = c_c / (2.0 * b_c);
        part = OwnPart::of(&[a, point(along.clamp(0.0, 0.5), 0.0)]);
    } else {
        // Obtuse at b.
        let along = b_b / (2.0 * b_c);
        part.push(point(0.0, along.clamp(0.0, 0.5)));
        return part;
    }
    part.push(point(0.0, 0.5));
    part
}

/// Up to five points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OwnPart {
    corners: [DVec3; 5],
    count: usize,
}

impl OwnPart {
    fn of(points: &[DVec3]) -> Self {
        let mut part = Self {
            corners: [DVec3::ZERO; 5],
            count: 0,
        };
        points.iter().for_each(|&p| part.push(p));
        part
    }

    fn push(&mut self, point: DVec3) {
        self.corners[self.count] = point;
        self.count += 1;
    }

    /// Its corners, the triangle's first.
    pub fn corners(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }
}

/// Corners of a face, `point` first, in the face's order.
pub fn turned_to(surface: &WeldedSurface, face: u32, point: u32) -> [DVec3; 3] {
    let [a, b, c] = surface.corners(face);
    let [p, q, _] = surface.faces[face as usize];
    if p == point {
        [a, b, c]
    } else if q == point {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

/// Distance of a point from its farthest neighbor; 0 without any.
pub fn farthest_neighbor(surface: &WeldedSurface, point: u32) -> f64 {
    let own = surface.points[point as usize];
    (surface.incident(point).iter())
        .flat_map(|&face| surface.corners(face))
        .fold(0.0, |most: f64, corner| most.max(own.distance(corner)))
}

/// Radius of a splat at `point` with this normal that stands for `faces` around it; model units.
///
/// Where faces are tilted from the plane the radius of [`RadiusRule::Cover`] grows by 1 / cos of the angle, of at most 60
/// degrees: seen along a face the splat reaches as far as on it.
pub fn of_point(
    surface: &WeldedSurface,
    point: u32,
    normal: DVec3,
    faces: &[u32],
    rule: RadiusRule,
) -> f64 {
    match rule {
        RadiusRule::Dietz => 0.65 * farthest_neighbor(surface, point),
        RadiusRule::Dietz50 => 0.5 * farthest_neighbor(surface, point),
        RadiusRule::Cover => {
            let own = surface.points[point as usize];
            let mut most = 0.0_f64;
            let mut least_cosine = 1.0_f64;
            for &face in faces {
                for &corner in own_part(turned_to(surface, face, point)).corners() {
                    most = most.max(own.distance(corner));
                }
                least_cosine = least_cosine.min(normal.dot(surface.normals[face as usize]));
            }
            most / least_cosine.max(0.5)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn area(corners: &[DVec3]) -> f64 {
        (1..corners.len() - 1)
            .map(|k| {
                (corners[k] - corners[0])
                    .cross(corners[k + 1] - corners[0])
                    .length()
                    / 2.0
            })
            .sum()
    }

    #[test]
    fn own_parts_fill_the_triangle_and_are_nearest() {
        let mut seed = 7_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) as f64 / (1u64 << 31) as f64 * 2.0 - 1.0
        };
        for _ in 0..2000 {
            let mut at = || DVec3::new(random(), random(), random());
            let [a, b, c] = [at(), at(), at()];
            let whole = area(&[a, b, c]);
            let turns = [[a, b, c], [b, c, a], [c, a, b]];
            let sum: f64 = turns.iter().map(|&t| area(own_part(t).corners())).sum();
            assert!(
                (sum - whole).abs() < 1e-9 * whole.max(1e-3),
                "{sum} {whole}"
            );
            for turn in turns {
                for &x in own_part(turn).corners() {
                    let nearest = turn.map(|corner| corner.distance(x));
                    assert!(nearest[0] <= nearest[1].min(nearest[2]) + 1e-9);
                }
            }
        }
    }

    #[test]
    fn an_equilateral_triangle_needs_its_side_over_root_three() {
        let height = 3f32.sqrt() / 2.0;
        let positions = [Vec3::ZERO, Vec3::X, Vec3::new(0.5, height, 0.0)];
        let surface = WeldedSurface::new(&positions, &[[0, 1, 2]]);
        let radius = |rule| of_point(&surface, 0, DVec3::Z, &[0], rule);
        assert!((radius(RadiusRule::Cover) - 1.0 / 3f64.sqrt()).abs() < 1e-6);
        assert!((radius(RadiusRule::Dietz) - 0.65).abs() < 1e-6);
        assert!((radius(RadiusRule::Dietz50) - 0.5).abs() < 1e-6);
        // Tilted by 45 degrees, and by more than 60.
        let tilted = of_point(
            &surface,
            0,
            DVec3::new(1.0, 0.0, 1.0).normalize(),
            &[0],
            RadiusRule::Cover,
        );
        assert!((tilted - 2f64.sqrt() / 3f64.sqrt()).abs() < 1e-6);
        let across = of_point(&surface, 0, DVec3::X, &[0], RadiusRule::Cover);
        assert!((across - 2.0 / 3f64.sqrt()).abs() < 1e-6);
    }
}
