//! A chosen photograph as a shader sees it: plain single-precision values, relative to the zero of a model.

use crate::projective::camera::CalibratedCamera;
use crate::projective::lens::{CameraLens, LensModel};
use glam::{DVec3, Mat3, Vec2, Vec3};

/// A photograph's camera, its place in the choice and its exposure, in model space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProjectedPhoto {
    /// Index of the photograph in its scene.
    pub index: u32,
    /// Camera space from model space, without translation; z is forward, y down.
    pub rotation: Mat3,
    /// The eye in model space.
    pub center: Vec3,
    /// Focal lengths, pixels.
    pub focal: Vec2,
    /// Principal point, pixels.
    pub principal: Vec2,
    /// Width and height, pixels.
    pub size: Vec2,
    /// Formula of the lens.
    pub lens: LensModel,
    /// Coefficients of the lens.
    pub coefficients: [f32; 8],
    /// Largest tangent of the angle from the axis that the lens shows.
    pub largest_radius: f32,
    /// Unit direction in which the photograph looks at the model, through the middle of the model in it.
    pub direction: Vec3,
    /// Share of the photograph that the model fills, 0 to 1.
    pub area: f32,
    /// Factor of each channel that brings it to the exposure of the others.
    pub gain: Vec3,
    /// 0: chosen for the view. 1: for what those leave uncovered, and used only there.
    pub stage: u32,
    /// Largest distance that counts as in front of the camera's plane, in model units: 1e-6 of the scene.
    pub least_depth: f32,
}

/// A point in a photograph.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhotoPlace {
    /// Pixels from the upper left corner.
    pub pixel: Vec2,
    /// Distance along the optical axis.
    pub depth: f32,
}

impl ProjectedPhoto {
    /// A camera in the space of a model whose zero lies at `origin` of the world; direction and area are those of the optical
    /// axis and the whole photograph until a hull is known. `scene_size` is any length of the scene's order.
    pub fn new(index: u32, camera: &CalibratedCamera, origin: DVec3, scene_size: f64) -> Self {
        let pair = |v: [f64; 2]| Vec2::new(v[0] as f32, v[1] as f32);
        Self {
            index,
            rotation: camera.rotation.as_mat3(),
            center: (camera.center - origin).as_vec3(),
            focal: pair(camera.focal),
            principal: pair(camera.principal),
            size: Vec2::new(camera.width as f32, camera.height as f32),
            lens: camera.lens.model,
            coefficients: camera.lens.coefficients.map(|k| k as f32),
            largest_radius: camera.lens.largest_radius as f32,
            direction: camera.axis().as_vec3(),
            area: 1.0,
            gain: Vec3::ONE,
            stage: 0,
            least_depth: (1e-6 * scene_size) as f32,
        }
    }

    /// Where a point is in the photograph; `None` behind the camera, beyond its lens, or outside.
    pub fn place(&self, position: Vec3) -> Option<PhotoPlace> {
        let place = self.place_anywhere(position)?;
        let is_inside = place.pixel.cmpge(Vec2::ZERO).all() && place.pixel.cmplt(self.size).all();
        is_inside.then_some(place)
    }

    /// As [`place`](Self::place), also outside of the photograph.
    pub fn place_anywhere(&self, position: Vec3) -> Option<PhotoPlace> {
        let p = self.rotation * (position - self.center);
        // Behind the camera points would come out mirrored; not a number is behind.
        if p.z.is_nan() || p.z <= self.least_depth {
            return None;
        }
        let ray = p.truncate() / p.z;
        let bent = match self.lens {
            LensModel::Pinhole => ray,
            _ => self.bend(ray)?,
        };
        Some(PhotoPlace {
            pixel: bent * self.focal + self.principal,
            depth: p.z,
        })
    }

    /// The ray as the lens bends it; `None` beyond the lens.
    pub(crate) fn bend(&self, ray: Vec2) -> Option<Vec2> {
        let lens = CameraLens {
            model: self.lens,
            coefficients: self.coefficients.map(f64::from),
            largest_radius: f64::from(self.largest_radius),
        };
        let [x, y] = lens.distort([f64::from(ray.x), f64::from(ray.y)])?;
        Some(Vec2::new(x as f32, y as f32))
    }

    /// Unit direction from the eye to a point; zero in the eye.
    pub fn ray_to(&self, position: Vec3) -> Vec3 {
        (position - self.center).normalize_or_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DVec2};

    #[test]
    fn single_precision_gives_the_same_pixels() {
        let origin = DVec3::new(500_000.0, 4_000_000.0, 120.0);
        let camera = CalibratedCamera {
            width: 3000,
            height: 2000,
            focal: [2500.0, 2510.0],
            principal: [1490.0, 1010.0],
            lens: CameraLens::new(LensModel::Brown, &[-0.1, 0.01, 1e-4, 2e-4]),
            rotation: DMat3::from_rotation_x(0.4) * DMat3::from_rotation_y(1.0),
            center: origin + DVec3::new(3.0, -2.0, 1.0),
        };
        let photo = ProjectedPhoto::new(7, &camera, origin, 10.0);
        for pixel in [DVec2::new(10.0, 1990.0), DVec2::new(1500.5, 700.25)] {
            let world = camera.center + 8.0 * camera.direction(pixel).unwrap();
            let place = photo.place((world - origin).as_vec3()).unwrap();
            assert!(
                (place.pixel.as_dvec2() - pixel).length() < 0.01,
                "{place:?}"
            );
        }
        // Behind, outside, in the eye and nowhere.
        let ahead = photo.rotation.transpose() * Vec3::Z;
        assert!(photo.place(photo.center + 5.0 * ahead).is_some());
        assert_eq!(photo.place(photo.center - 5.0 * ahead), None);
        assert_eq!(
            photo.place(photo.center + 5.0 * ahead.any_orthonormal_vector()),
            None
        );
        assert_eq!(photo.place(photo.center), None);
        assert_eq!(photo.place(Vec3::NAN), None);
    }
}
