//! Dietz's angle test (methods 11.3): points whose faces turn too far from their normal draw triangles instead of a splat.
//!
//! He does not say how a point's normal is found. Of the rules here the mean over faces comes nearest to his table.

use crate::oriented::surface::WeldedSurface;
use glam::DVec3;
use rayon::prelude::*;

/// What a face counts in the normal of its corners.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum FaceWeight {
    /// One.
    #[default]
    Equal,
    /// The face's area.
    Area,
    /// The face's angle at the corner.
    Angle,
}

/// Unit normal of a point; zero where its faces cancel, or it has none.
pub fn normal_of(surface: &WeldedSurface, point: u32, weight: FaceWeight) -> DVec3 {
    let own = surface.points[point as usize];
    let sum: DVec3 = (surface.incident(point).iter())
        .map(|&face| {
            let normal = surface.normals[face as usize];
            match weight {
                FaceWeight::Equal => normal,
                FaceWeight::Area => normal * surface.areas[face as usize],
                FaceWeight::Angle => {
                    let others = surface.corners(face).into_iter().filter(|&c| c != own);
                    let mut sides = others.map(|c| c - own);
                    let side = [sides.next(), sides.next()].map(Option::unwrap_or_default);
                    normal * side[0].angle_between(side[1])
                }
            }
        })
        .sum();
    sum.normalize_or_zero()
}

/// Cosine of the largest angle between a normal and the faces around a point; 1 without faces.
pub fn least_cosine(surface: &WeldedSurface, point: u32, normal: DVec3) -> f64 {
    (surface.incident(point).iter())
        .map(|&face| normal.dot(surface.normals[face as usize]))
        .fold(1.0, f64::min)
}

/// Tells whether each point draws its triangles: where a face lies more than `threshold` (radians) from its normal.
pub fn flagged(surface: &WeldedSurface, threshold: f64, weight: FaceWeight) -> Vec<bool> {
    let least = threshold.cos();
    (0..surface.points.len() as u32)
        .into_par_iter()
        .map(|point| least_cosine(surface, point, normal_of(surface, point, weight)) < least)
        .collect()
}

/// The faces around flagged points, each once; ascending.
pub fn faces_of(surface: &WeldedSurface, flagged: &[bool]) -> Vec<u32> {
    (0..surface.faces.len() as u32)
        .filter(|&face| {
            let corners = surface.faces[face as usize];
            corners.iter().any(|&point| flagged[point as usize])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oriented::shapes::{cube, grid};

    #[test]
    fn a_cube_is_flagged_below_the_angle_of_its_corners() {
        let mesh = cube();
        let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
        // By area or angle a corner has the normal (1, 1, 1): 54.7 degrees from its faces.
        for (degrees, expected) in [(54.0_f64, 8), (55.0, 0)] {
            let flagged = flagged(&surface, degrees.to_radians(), FaceWeight::Angle);
            assert_eq!(flagged.iter().filter(|&&f| f).count(), expected);
            let faces = faces_of(&surface, &flagged);
            assert_eq!(faces.len(), if expected == 0 { 0 } else { 12 });
        }
        let normal = normal_of(&surface, 7, FaceWeight::Angle).abs();
        assert!((normal - DVec3::splat(1.0 / 3f64.sqrt())).length() < 1e-12);
    }

    #[test]
    fn a_ridge_flags_its_own_points_alone() {
        // Two planes that meet at x = 2 under 90 degrees, 45 from the mean.
        let mesh = grid(4, |x, _| -(x - 2.0).abs());
        let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
        let flagged = flagged(&surface, 40f64.to_radians(), FaceWeight::Equal);
        let points = (0..25).filter(|&p| flagged[p]).collect::<Vec<_>>();
        assert_eq!(points, [2, 7, 12, 17, 22]);
        assert_eq!(faces_of(&surface, &flagged).len(), 16);
    }
}
