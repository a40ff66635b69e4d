//! Errors of depth and normal, over the pixels that both pictures cover.

use super::SampleSpread;
use crate::math::camera::View;
use glam::DVec3;

/// Depth error in units of the pixel's footprint: the length that a pixel covers at that depth, z / f (orthographic:
/// 1 / f), with z and f from `view`. An error of 1 is what a step aside by one pixel costs on a surface tilted by 45
/// degrees.
///
/// `reference` and `other` are [`crate::image::Image::depth`] of one size; pixels that are not finite in both do not
/// count. Surplus values of the longer one are left out.
pub fn depth_error(reference: &[f32], other: &[f32], view: &View) -> SampleSpread {
    let focal = f64::from(view.focal_px());
    let errors = reference.iter().zip(other).filter_map(|(r, o)| {
        if !(r.is_finite() && o.is_finite()) {
            return None;
        }
        let z = f64::from(*r);
        let footprint = if view.is_perspective { z } else { 1.0 } / focal;
        Some((f64::from(*o) - z).abs() / footprint)
    });
    SampleSpread::of(errors.collect())
}

/// Angle between normals in degrees, 0 to 180, where both pictures have one (zero is none).
///
/// `reference` and `other` are [`crate::image::Image::normal`] of one size; lengths do not matter.
pub fn normal_error(reference: &[[f32; 3]], other: &[[f32; 3]]) -> SampleSpread {
    let errors = reference.iter().zip(other).filter_map(|(r, o)| {
        let [r, o] = [r, o].map(|n| DVec3::from(n.map(f64::from)).try_normalize());
        let (r, o) = (r?, o?);
        // Exact for small angles too, where the arc cosine is not.
        Some(r.cross(o).length().atan2(r.dot(o)).to_degrees())
    });
    SampleSpread::of(errors.collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::math::camera::Camera;

    #[test]
    fn depth_is_measured_in_footprints() {
        let fov_y = 2.0 * 0.25f64.atan();
        // Focal length 200 / (2 tan) = 400 pixels.
        let camera = Camera::look_at(
            (300, 200),
            DVec3::Z * 4.0,
            DVec3::ZERO,
            DVec3::Y,
            fov_y,
            [1.0, 9.0],
        );
        let mut view = camera.view(DVec3::ZERO).unwrap();
        let inf = f32::INFINITY;
        let reference = [4.0, 2.0, inf, 4.0];
        let other = [4.02, 1.99, 4.0, inf];
        let d = depth_error(&reference, &other, &view);
        // A pixel is 0.01 long at distance 4, 0.005 at distance 2.
        assert_eq!(d.count, 2);
        assert!(
            (d.mean - 2.0).abs() < 1e-4 && (d.max - 2.0).abs() < 1e-4,
            "{d:?}"
        );
        view.is_perspective = false;
        // And 1/400 everywhere without perspective.
        assert!((depth_error(&reference, &other, &view).max - 8.0).abs() < 1e-3);
        assert_eq!(depth_error(&[inf], &[1.0], &view), SampleSpread::default());
    }

    #[test]
    fn normals_are_compared_by_angle() {
        let (s, c) = 30f32.to_radians().sin_cos();
        let reference = [[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [1.0, 0.0, 0.0], [0.0; 3]];
        let other = [
            [0.0, s, c],
            [0.0, 0.0, 1.0],
            [-3.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
        ];
        let d = normal_error(&reference, &other);
        assert_eq!(d.count, 3);
        assert!((d.mean - 70.0).abs() < 1e-5, "{d:?}");
        assert_eq!(d.max, 180.0);
        assert!((normal_error(&reference[..1], &other[..1]).max - 30.0).abs() < 1e-5);
    }
}
