//! Cones of normals: the smallest one around others, and what can be seen of them.
//!
//! Sources: Shirman and Abi-Ezzi, "The cone of normals technique for fast processing of curved patches" (1993), and
//! the merge of two cones in the bounding-sphere form. A cone of directions is a cap of the unit sphere; the smallest
//! ball around a cap with half angle alpha < 90 degrees has its center at axis cos(alpha) and radius sin(alpha), so
//! the smallest ball around several such balls points along a nearly smallest common cone (exactly the smallest one
//! where the caps are points).

use super::sphere::{self, Sphere};
use glam::{DVec3, Vec3};

/// A circular cone of directions with half angle below a quarter turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionCap {
    /// Unit axis.
    pub axis: DVec3,
    /// Sine of the half angle.
    pub sin: f64,
    /// Cosine of the half angle, above 0.
    pub cos: f64,
}

impl DirectionCap {
    /// A single direction; `axis` must have unit length.
    #[inline]
    pub fn point(axis: DVec3) -> Self {
        Self {
            axis,
            sin: 0.0,
            cos: 1.0,
        }
    }

    /// A cone from its axis and the sine of its half angle, 0 to 1.
    #[inline]
    pub fn from_sin(axis: DVec3, sin: f64) -> Self {
        Self {
            axis,
            sin,
            cos: (1.0 - sin * sin).max(0.0).sqrt(),
        }
    }
}

/// Cosine of the widest half angle that is of any use (a quarter turn less 0.001).
pub const LEAST_COS: f64 = 1e-3;

/// Axis of a nearly smallest cone around up to four cones, not normalized: its length is the cosine of the half
/// angle for points. Near zero where the cones point everywhere. No cones give zero.
#[inline]
pub fn common_axis(caps: &[DirectionCap]) -> DVec3 {
    let mut balls = [Sphere::default(); 4];
    match caps {
        [] => DVec3::ZERO,
        [one] => one.axis,
        [_, _] | [_, _, _] | [_, _, _, _] => {
            for (ball, cap) in balls.iter_mut().zip(caps) {
                *ball = Sphere {
                    center: cap.axis * cap.cos,
                    radius: cap.sin,
                };
            }
            sphere::enclosing(&balls[..caps.len()]).center
        }
        _ => caps.iter().map(|cap| cap.axis * cap.cos).sum(),
    }
}

/// Sine of the smallest half angle around the unit `axis` that contains all `caps`, or `None` when it comes within
/// 0.001 of a quarter turn. Exact up to rounding.
#[inline]
pub fn sin_around(axis: DVec3, caps: &[DirectionCap]) -> Option<f64> {
    let mut widest = 0.0f64;
    for cap in caps {
        let cos = axis.dot(cap.axis);
        // The cross product keeps small angles, which the dot product loses.
        let sin = axis.cross(cap.axis).length();
        // Beyond a quarter turn the sum of angles would wrap.
        if cos <= 0.0 || cos * cap.cos - sin * cap.sin < LEAST_COS {
            return None;
        }
        widest = widest.max(sin * cap.cos + cos * cap.sin);
    }
    Some(widest)
}

/// Tells whether everything in a ball faces away from the eye, for every normal in a cone: exact for the ball and the cone.
///
/// `axis` is unit, `sin_half_angle` 0 to 1 (1 never culls). Errs to the safe side: `true` is never wrong by more than
/// rounding; `false` when the eye is in the ball. Monotone: nested balls with nested cones keep `true`.
#[inline]
pub fn faces_away(axis: Vec3, sin_half_angle: f32, center: Vec3, radius: f32, eye: Vec3) -> bool {
    let to_eye = eye - center;
    let distance = to_eye.length();
    if sin_half_angle >= 1.0 || distance <= radius {
        return false;
    }
    // s: sine of the angle by which the eye lies behind the plane through the center.
    let s = -axis.dot(to_eye) / distance;
    let cos_half_angle = (1.0 - sin_half_angle * sin_half_angle).sqrt();
    let c = (1.0 - s * s).max(0.0).sqrt();
    s >= sin_half_angle && distance * (s * cos_half_angle - c * sin_half_angle) >= radius
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    /// Directions in a cap of half angle `beta` about `axis`, rim included.
    fn cap_directions(axis: DVec3, beta: f64) -> Vec<DVec3> {
        let side = axis.any_orthonormal_vector();
        let other = axis.cross(side);
        let mut directions = Vec::new();
        for ring in 0..=20 {
            let angle = beta * f64::from(ring) / 20.0;
            for step in 0..64 {
                let azimuth = f64::from(step) * std::f64::consts::TAU / 64.0;
                directions.push(
                    axis * angle.cos()
                        + (side * azimuth.cos() + other * azimuth.sin()) * angle.sin(),
                );
            }
        }
        directions
    }

    #[test]
    fn cap_of_the_unit_sphere_has_its_own_half_angle() {
        for beta_degrees in [1.0f64, 10.0, 44.0, 60.0, 85.0] {
            let beta = beta_degrees.to_radians();
            let axis = DVec3::new(0.3, -0.5, 0.8).normalize();
            let caps: Vec<DirectionCap> = cap_directions(axis, beta)
                .into_iter()
                .map(DirectionCap::point)
                .collect();
            let sin = sin_around(axis, &caps).unwrap();
            assert!((sin - beta.sin()).abs() < 1e-12);
        }
        let wide: Vec<DirectionCap> = cap_directions(DVec3::Z, 89.99f64.to_radians())
            .into_iter()
            .map(DirectionCap::point)
            .collect();
        assert_eq!(sin_around(DVec3::Z, &wide), None);
        assert_eq!(
            sin_around(DVec3::Z, &[DirectionCap::point(-DVec3::Z)]),
            None
        );
    }

    #[test]
    fn culling_a_cap_is_never_wrong() {
        // Points of the cap are their own normals; truly back-facing iff |e| cos(max(0, psi - beta)) <= 1.
        let mut culled = 0;
        let mut cullable = 0;
        for beta_degrees in [5.0f64, 30.0, 50.0, 80.0] {
            let beta = beta_degrees.to_radians();
            let center = (DVec3::Z * beta.cos()).as_vec3();
            for distance in [1.05f64, 1.5, 3.0, 10.0] {
                for step in 0..=180 {
                    let psi = f64::from(step).to_radians();
                    let eye = DVec3::new(psi.sin(), 0.0, psi.cos()) * distance;
                    let is_hidden = distance * (psi - beta).max(0.0).cos() <= 1.0;
                    let is_culled = faces_away(
                        Vec3::Z,
                        beta.sin() as f32,
                        center,
                        beta.sin() as f32,
                        eye.as_vec3(),
                    );
                    assert!(
                        !is_culled || is_hidden,
                        "beta {beta_degrees} psi {step} distance {distance}"
                    );
                    culled += u32::from(is_culled);
                    cullable += u32::from(is_hidden);
                }
            }
        }
        assert!(
            culled > 0 && f64::from(culled) > 0.5 * f64::from(cullable),
            "{culled} of {cullable}"
        );
    }

    #[test]
    fn common_axis_of_points_is_the_smallest_cone() {
        let points = [
            DVec3::new(0.6, 0.0, 0.8),
            DVec3::new(-0.6, 0.0, 0.8),
            DVec3::new(0.0, 0.1, 1.0).normalize(),
        ];
        let axis = common_axis(&points.map(DirectionCap::point)).normalize();
        assert!(axis.distance(DVec3::Z) < 1e-9);
        assert!((sin_around(axis, &points.map(DirectionCap::point)).unwrap() - 0.6).abs() < 1e-9);
    }

    #[test]
    fn merged_caps_are_contained() {
        let narrow = DirectionCap::from_sin(DVec3::new(0.5, 0.0, 1.0).normalize(), 0.1);
        let wide = DirectionCap::from_sin(DVec3::new(-0.3, 0.4, 1.0).normalize(), 0.4);
        let caps = [narrow, wide, DirectionCap::point(DVec3::Z)];
        let axis = common_axis(&caps).normalize();
        let half_angle = sin_around(axis, &caps).unwrap().asin();
        for cap in caps {
            for direction in cap_directions(cap.axis, cap.sin.asin()) {
                assert!(direction.dot(axis).clamp(-1.0, 1.0).acos() <= half_angle + 1e-7);
            }
        }
        // Two caps: the smallest cone spans them exactly.
        let span = (narrow.axis.dot(wide.axis).acos() + narrow.sin.asin() + wide.sin.asin()) / 2.0;
        let pair = [narrow, wide];
        let found = sin_around(common_axis(&pair).normalize(), &pair)
            .unwrap()
            .asin();
        assert!(
            found >= span - 1e-9 && found < span * 1.05,
            "{found} {span}"
        );
    }
}
