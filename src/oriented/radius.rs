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
    // The bisector of a and b is s b.b + t b.c = b.b / 2, that of a and c likewise.
    let determinant = b_b * c_c - b_c * b_c;
    let (s, t) = (
        c_c * (b_b - b_c) / (2.0 * determinant),
        b_b * (c_c - b_c) / (2.0 * determinant),
    );
    let mut part = OwnPart::default();
    let mut push = |s: f64, t: f64| {
        part.corners[part.count] = a + s * to_b + t * to_c;
        part.shares[part.count] = [1.0 - s - t, s, t];
        part.count += 1;
    };
    push(0.0, 0.0);
    if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
        push(0.5, 0.0);
        push(s, t);
        push(0.0, 0.5);
    } else if s + t > 1.0 {
        // The angle at a is obtuse: both bisectors reach the side opposite, where x is as far from a as from b or c.
        let side = to_c - to_b;
        let along_from_b = (b_b / (-2.0 * to_b.dot(side))).clamp(0.0, 1.0);
        let along_from_c = (c_c / (2.0 * to_c.dot(side))).clamp(0.0, 1.0);
        push(0.5, 0.0);
        push(1.0 - along_from_b, along_from_b);
        push(along_from_c, 1.0 - along_from_c);
        push(0.0, 0.5);
    } else if t < 0.0 {
        // Obtuse at c: the bisector of a and c leaves by the side a b, before the middle of that.
        push((c_c / (2.0 * b_c)).clamp(0.0, 0.5), 0.0);
        push(0.0, 0.5);
    } else {
        // Obtuse at b.
        push(0.5, 0.0);
        push(0.0, (b_b / (2.0 * b_c)).clamp(0.0, 0.5));
    }
    part
}

/// Up to five points.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OwnPart {
    corners: [DVec3; 5],
    shares: [[f64; 3]; 5],
    count: usize,
}

impl OwnPart {
    /// Corners of the polygon, the triangle's first.
    pub fn corners(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    /// Barycentric weights of the triangle, the point first, at each corner of the part.
    pub fn shares(&self) -> &[[f64; 3]] {
        &self.shares[..self.count]
    }
}

/// Number of the corner of a face that a point is: 0, 1 or 2.
pub fn corner_of(surface: &WeldedSurface, face: u32, point: u32) -> usize {
    let [p, q, _] = surface.faces[face as usize];
    if p == point {
        0
    } else if q == point {
        1
    } else {
        2
    }
}

/// The part of a face that is nearest to a point of it.
pub fn part_of_face(surface: &WeldedSurface, face: u32, point: u32) -> OwnPart {
    let mut corners = surface.corners(face);
    corners.rotate_left(corner_of(surface, face, point));
    own_part(corners)
}

/// Distance of a point from its farthest neighbor; 0 without any.
pub fn farthest_neighbor(surface: &WeldedSurface, point: u32) -> f64 {
    let own = surface.points[point as usize];
    (surface.incident(point).iter())
        .flat_map(|&face| surface.corners(face))
        .fold(0.0, |most: f64, corner| most.max(own.distance(corner)))
}

/// Radius of a splat at `point` with this normal that stands for `faces` around it and their `parts`; model units.
///
/// Where faces are tilted from the plane the radius of [`RadiusRule::Cover`] grows by 1 / cos of the angle, of at most 60
/// degrees: seen along a face the splat reaches as far as on it.
pub fn of_point(
    surface: &WeldedSurface,
    point: u32,
    normal: DVec3,
    (faces, parts): (&[u32], &[OwnPart]),
    rule: RadiusRule,
) -> f64 {
    match rule {
        RadiusRule::Dietz => 0.65 * farthest_neighbor(surface, point),
        RadiusRule::Dietz50 => 0.5 * farthest_neighbor(surface, point),
        RadiusRule::Cover => {
            let own = surface.points[point as usize];
            let corners = parts.iter().flat_map(OwnPart::corners);
            let most = corners.fold(0.0, |most: f64, x| most.max(own.distance_squared(*x)));
            let cosines = (faces.iter()).map(|&face| normal.dot(surface.normals[face as usize]));
            most.sqrt() / cosines.fold(1.0, f64::min).max(0.5)
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
                let part = own_part(turn);
                for (&x, &[i, j, k]) in part.corners().iter().zip(part.shares()) {
                    let nearest = turn.map(|corner| corner.distance(x));
                    assert!(nearest[0] <= nearest[1].min(nearest[2]) + 1e-9);
                    let mixed = i * turn[0] + j * turn[1] + k * turn[2];
                    assert!(
                        mixed.distance(x) < 1e-12 * (1.0 + x.length()),
                        "{mixed} {x}"
                    );
                }
            }
        }
    }

    #[test]
    fn an_equilateral_triangle_needs_its_side_over_root_three() {
        let height = 3f32.sqrt() / 2.0;
        let positions = [Vec3::ZERO, Vec3::X, Vec3::new(0.5, height, 0.0)];
        let surface = WeldedSurface::new(&positions, &[[0, 1, 2]]);
        let parts = [part_of_face(&surface, 0, 0)];
        let radius = |rule| of_point(&surface, 0, DVec3::Z, (&[0], &parts), rule);
        assert!((radius(RadiusRule::Cover) - 1.0 / 3f64.sqrt()).abs() < 1e-6);
        assert!((radius(RadiusRule::Dietz) - 0.65).abs() < 1e-6);
        assert!((radius(RadiusRule::Dietz50) - 0.5).abs() < 1e-6);
        // Tilted by 45 degrees, and by more than 60.
        let tilted = of_point(
            &surface,
            0,
            DVec3::new(1.0, 0.0, 1.0).normalize(),
            (&[0], &parts),
            RadiusRule::Cover,
        );
        assert!((tilted - 2f64.sqrt() / 3f64.sqrt()).abs() < 1e-6);
        let across = of_point(&surface, 0, DVec3::X, (&[0], &parts), RadiusRule::Cover);
        assert!((across - 2.0 / 3f64.sqrt()).abs() < 1e-6);
    }
}
