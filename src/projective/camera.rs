//! Calibrated cameras in double precision: a camera looks along +z with x right and y down, a point p of the world is
//! R (p - C) in camera space, and pixel (i, j) covers [i, i + 1) x [j, j + 1), so that its center is at one half.

use crate::projective::lens::CameraLens;
use glam::{DMat3, DVec2, DVec3};

/// A calibrated camera: position, direction, focal length and lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibratedCamera {
    /// Width of the photograph that was calibrated, pixels; 0 where neither file nor photograph says it.
    pub width: u32,
    /// Height of it.
    pub height: u32,
    /// Focal lengths along x and y, pixels.
    pub focal: [f64; 2],
    /// Principal point, pixels from the top left corner (not center) of the top left pixel.
    pub principal: [f64; 2],
    /// Distortion.
    pub lens: CameraLens,
    /// Camera space from world space, without translation: a rotation.
    pub rotation: DMat3,
    /// The eye in world space.
    pub center: DVec3,
}

impl CalibratedCamera {
    /// A point of the world in camera space.
    pub fn to_camera(&self, world: DVec3) -> DVec3 {
        self.rotation * (world - self.center)
    }

    /// The pixel of a point of the world; `None` behind the camera or beyond its lens. It may lie outside of the
    /// photograph.
    pub fn project(&self, world: DVec3) -> Option<DVec2> {
        let p = self.to_camera(world);
        // Points behind would come out mirrored.
        if p.z.is_nan() || p.z <= 1e-9 * p.length() || p.z <= 0.0 {
            return None;
        }
        let [x, y] = self.lens.distort([p.x / p.z, p.y / p.z])?;
        Some(DVec2::new(
            self.focal[0] * x + self.principal[0],
            self.focal[1] * y + self.principal[1],
        ))
    }

    /// True of a pixel in the photograph.
    pub fn contains(&self, pixel: DVec2) -> bool {
        pixel.x >= 0.0
            && pixel.y >= 0.0
            && pixel.x < f64::from(self.width)
            && pixel.y < f64::from(self.height)
    }

    /// The unit direction, in world space, from the eye through a pixel; `None` where the lens has none.
    pub fn direction(&self, pixel: DVec2) -> Option<DVec3> {
        let [x, y] = self.lens.undistort([
            (pixel.x - self.principal[0]) / self.focal[0],
            (pixel.y - self.principal[1]) / self.focal[1],
        ])?;
        Some((self.rotation.transpose() * DVec3::new(x, y, 1.0)).normalize_or_zero())
    }

    /// Direction of the optical axis in world space.
    pub fn axis(&self) -> DVec3 {
        self.rotation.transpose() * DVec3::Z
    }

    /// The camera of the photograph scaled to another size.
    #[must_use]
    pub fn scaled(&self, width: u32, height: u32) -> Self {
        let x = f64::from(width) / f64::from(self.width.max(1));
        let y = f64::from(height) / f64::from(self.height.max(1));
        Self {
            width,
            height,
            focal: [self.focal[0] * x, self.focal[1] * y],
            principal: [self.principal[0] * x, self.principal[1] * y],
            ..*self
        }
    }

    /// Gives the camera without distortion.
    #[must_use]
    pub fn pinhole(&self) -> Self {
        Self {
            lens: CameraLens::default(),
            ..*self
        }
    }

    /// True where every number is finite, the focal lengths are positive and the rotation is one (to 1e-3).
    pub fn is_usable(&self) -> bool {
        let r = self.rotation;
        let is_rotation = (r * r.transpose() - DMat3::IDENTITY)
            .to_cols_array()
            .iter()
            .all(|v| v.abs() < 1e-3)
            && r.determinant() > 0.0;
        let finite = [self.focal, self.principal].concat();
        finite.iter().all(|v| v.is_finite())
            && self.lens.coefficients.iter().all(|v| v.is_finite())
            && self.focal.iter().all(|f| *f > 0.0)
            && self.center.is_finite()
            && self.center.length() < 1e12
            && is_rotation
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> CalibratedCamera {
        CalibratedCamera {
            width: 100,
            height: 80,
            focal: [90.0, 90.0],
            principal: [48.0, 41.0],
            lens: CameraLens::default(),
            rotation: DMat3::from_rotation_y(0.3) * DMat3::from_rotation_x(-0.2),
            center: DVec3::new(1.0, -2.0, 0.5),
        }
    }

    #[test]
    fn directions_and_pixels_are_inverse() {
        let camera = camera();
        for pixel in [DVec2::new(3.5, 70.25), DVec2::new(48.0, 41.0)] {
            let ray = camera.direction(pixel).unwrap();
            let back = camera.project(camera.center + 7.0 * ray).unwrap();
            assert!((back - pixel).length() < 1e-9, "{back}");
        }
        assert!(
            (camera.direction(DVec2::new(48.0, 41.0)).unwrap() - camera.axis()).length() < 1e-12
        );
    }

    #[test]
    fn what_lies_behind_is_in_no_photograph() {
        let camera = camera();
        let ahead = camera.center + 3.0 * camera.axis();
        assert!(camera.contains(camera.project(ahead).unwrap()));
        // Mirrored it would lie in the middle.
        assert_eq!(camera.project(camera.center - 3.0 * camera.axis()), None);
        assert_eq!(camera.project(camera.center), None);
    }

    #[test]
    fn scaling_keeps_rays() {
        let camera = camera();
        let half = camera.scaled(50, 40);
        let ray = camera.direction(DVec2::new(20.0, 30.0)).unwrap();
        assert!((half.direction(DVec2::new(10.0, 15.0)).unwrap() - ray).length() < 1e-12);
    }

    #[test]
    fn numbers_that_are_none_make_no_camera() {
        assert!(camera().is_usable());
        let mut flipped = camera();
        flipped.rotation = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)) * flipped.rotation;
        assert!(!flipped.is_usable());
        for broken in [f64::NAN, 0.0, -5.0, f64::INFINITY] {
            let mut camera = camera();
            camera.focal[0] = broken;
            assert!(!camera.is_usable());
        }
        let mut far = camera();
        far.center.x = f64::INFINITY;
        assert!(!far.is_usable());
    }
}
