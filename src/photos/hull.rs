//! The part of a photograph that a model fills: convex hull, its middle and area (Princ, section 2.3.3 and equation 3.1).
//!
//! He takes the mean of the hull's points; the centroid of its area does not depend on where the hull has many points, and is
//! the default here. Andrew's monotone chain, both halves.

use crate::photos::scene::CalibratedCamera;
use glam::{DVec2, DVec3};

/// Middle of a hull.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum HullMiddle {
    /// Centroid of its area.
    #[default]
    Area,
    /// Mean of its corners, as Princ.
    Corners,
}

/// The direction of a photograph towards a model, and how much of the photograph that fills.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HullDirection {
    /// Unit direction in world space.
    pub direction: DVec3,
    /// Share of the photograph, 0 to 1; 0 where the model is not in it.
    pub area: f64,
}

/// Corners of the convex hull of points, counter-clockwise for y up; fewer than three where they lie on a line.
pub fn convex_hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.retain(|p| p.is_finite());
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let chain = |points: &mut dyn Iterator<Item = &DVec2>| {
        let mut hull: Vec<DVec2> = Vec::new();
        for p in points {
            while let [.., a, b] = hull.as_slice() {
                if (*b - *a).perp_dot(*p - *a) > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(*p);
        }
        // Its last point is the first of the other half.
        hull.pop();
        hull
    };
    let mut hull = chain(&mut points.iter());
    hull.extend(chain(&mut points.iter().rev()));
    hull
}

/// Area (equation 3.1) and centroid of a polygon; no area of fewer than three corners.
fn area_and_centroid(hull: &[DVec2]) -> (f64, DVec2) {
    let origin = hull.first().copied().unwrap_or(DVec2::ZERO);
    let (mut twice, mut sum) = (0.0, DVec2::ZERO);
    for (i, a) in hull.iter().enumerate() {
        let (a, b) = (*a - origin, hull[(i + 1) % hull.len()] - origin);
        let cross = a.perp_dot(b);
        twice += cross;
        sum += cross * (a + b);
    }
    if twice.abs() < 1e-12 {
        return (0.0, origin);
    }
    (twice / 2.0, origin + sum / (3.0 * twice))
}

/// The direction of a photograph through the middle of the hull of a model's points in it; along the optical axis, with no
/// area, where fewer than three of them are.
pub fn hull_direction(
    camera: &CalibratedCamera,
    points: impl Iterator<Item = DVec3>,
    middle: HullMiddle,
) -> HullDirection {
    let seen = points.filter_map(|p| camera.project(p).filter(|pixel| camera.contains(*pixel)));
    let hull = convex_hull(seen.collect());
    let (area, centroid) = area_and_centroid(&hull);
    let middle = match middle {
        HullMiddle::Area => centroid,
        HullMiddle::Corners => hull.iter().sum::<DVec2>() / hull.len().max(1) as f64,
    };
    let whole = f64::from(camera.width) * f64::from(camera.height);
    match camera.direction(middle).filter(|_| area > 0.0) {
        Some(direction) => HullDirection {
            direction,
            area: (area / whole.max(1.0)).min(1.0),
        },
        None => HullDirection {
            direction: camera.axis(),
            area: 0.0,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photos::lens::CameraLens;
    use glam::DMat3;

    fn camera() -> CalibratedCamera {
        CalibratedCamera {
            width: 200,
            height: 100,
            focal: [100.0; 2],
            principal: [100.0, 50.0],
            lens: CameraLens::default(),
            rotation: DMat3::IDENTITY,
            center: DVec3::ZERO,
        }
    }

    #[test]
    fn a_model_that_fills_a_quarter() {
        // Corners of the central half, many points on one side, and one behind that would be mirrored.
        let corners = [(-0.5, -0.25), (0.5, -0.25), (0.5, 0.25), (-0.5, 0.25)];
        let mut points: Vec<DVec3> = corners
            .iter()
            .map(|(x, y)| DVec3::new(*x, *y, 1.0))
            .collect();
        points.extend((0..50).map(|i| DVec3::new(-0.5, -0.25 + 0.01 * f64::from(i), 1.0)));
        points.push(DVec3::new(9.0, 9.0, -1.0));
        let found = hull_direction(&camera(), points.iter().copied(), HullMiddle::Area);
        assert!((found.area - 0.25).abs() < 1e-12, "{found:?}");
        assert!((found.direction - DVec3::Z).length() < 1e-12, "{found:?}");
    }

    #[test]
    fn the_middle_of_the_area_is_not_where_corners_are_many() {
        // A half disc with many corners on its round side.
        let mut points = vec![DVec3::new(-0.4, -0.4, 1.0), DVec3::new(-0.4, 0.4, 1.0)];
        points.extend((1..40).map(|i| {
            let a = (f64::from(i) / 40.0 - 0.5) * std::f64::consts::PI;
            DVec3::new(-0.4 + 0.4 * a.cos(), 0.4 * a.sin(), 1.0)
        }));
        let area = hull_direction(&camera(), points.iter().copied(), HullMiddle::Area).direction;
        let corners =
            hull_direction(&camera(), points.iter().copied(), HullMiddle::Corners).direction;
        // The centroid of a half disc is 4 r / 3 pi from its side; the mean of the corners about 2 r / pi.
        assert!(
            (area.x / area.z - (-0.4 + 0.4 * 0.4244)).abs() < 2e-3,
            "{area}"
        );
        assert!(
            (corners.x / corners.z - (-0.4 + 0.4 * std::f64::consts::FRAC_2_PI)).abs() < 0.02,
            "{corners}"
        );
    }

    #[test]
    fn a_model_in_the_corner_turns_the_direction() {
        let points = [(0.7, 0.3), (0.9, 0.3), (0.9, 0.45), (0.7, 0.45)];
        let points = points.iter().map(|(x, y)| DVec3::new(*x, *y, 1.0));
        let found = hull_direction(&camera(), points, HullMiddle::Area);
        let wanted = DVec3::new(0.8, 0.375, 1.0).normalize();
        assert!((found.direction - wanted).length() < 1e-9);
    }

    #[test]
    fn a_line_a_point_and_nothing_fall_back_to_the_axis() {
        for points in [
            vec![],
            vec![DVec3::Z],
            vec![DVec3::Z; 5],
            vec![
                DVec3::Z,
                DVec3::new(0.1, 0.1, 1.0),
                DVec3::new(0.2, 0.2, 1.0),
            ],
        ] {
            let found = hull_direction(&camera(), points.into_iter(), HullMiddle::Area);
            assert_eq!((found.direction, found.area), (DVec3::Z, 0.0));
        }
    }
}
