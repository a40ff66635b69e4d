//! The camera that a mouse moves: a turntable about a center of rotation. Pure logic, in double precision.
//!
//! The state is the center of rotation, the two angles of the turntable, and where the eye is as seen from the
//! center in the turning frame (right, up, back). Turning changes the angles alone, so the center stays where
//! it is on screen; a new center changes nothing that is seen.

use crate::math::camera::Camera;
use crate::math::up_axis::UpAxis;
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Vertical field of view, radians: that of the standard orbit.
pub const FOV_Y: f64 = PI / 4.0;
/// Factor of the distance for one step of the wheel towards the model.
const WHEEL_STEP: f64 = 0.85;
/// Largest distance from the model's center, in radii.
const FARTHEST: f64 = 200.0;
/// Smallest distance of what is zoomed at, in radii.
const NEAREST: f64 = 1e-5;
/// Below this cosine of the elevation, "up" is taken from the turntable, not from the world.
const POLE: f64 = 1e-6;

/// A turntable camera for a model inside of a bounding sphere; world space.
#[derive(Debug, Clone, PartialEq)]
pub struct OrbitCamera {
    model_center: DVec3,
    radius: f64,
    /// The turntable's axis.
    up: UpAxis,
    size: (u32, u32),
    home: (f64, f64, f64),
    pivot: DVec3,
    azimuth: f64,
    elevation: f64,
    /// Right, up and back part of the eye's place as seen from the pivot.
    eye: DVec3,
    /// Part of the picture that the model fills, while nothing but turning has happened since it was framed.
    framed: Option<f64>,
}

impl OrbitCamera {
    /// A camera that frames a sphere: `center` and `radius` in world space (a radius of 0 or less, or one that
    /// is no number, counts as 1), `size` of the picture in pixels; `azimuth` and `elevation` in radians and
    /// `fill` as in [`Camera::orbit`], which gives the same camera.
    pub fn new(
        center: DVec3,
        radius: f64,
        size: (u32, u32),
        (azimuth, elevation, fill): (f64, f64, f64),
    ) -> Self {
        let mut orbit = Self {
            model_center: center,
            radius: if radius > 0.0 { radius } else { 1.0 },
            up: UpAxis::Y,
            size: (size.0.max(1), size.1.max(1)),
            home: (azimuth, elevation, fill),
            pivot: center,
            azimuth,
            elevation: elevation.clamp(-FRAC_PI_2, FRAC_PI_2),
            eye: DVec3::Z,
            framed: None,
        };
        orbit.frame(fill);
        orbit
    }

    /// The same about another axis.
    #[must_use]
    pub fn about(self, up: UpAxis) -> Self {
        Self { up, ..self }
    }

    /// Turns the table about another axis from now on; the model is framed as at first.
    pub fn set_up(&mut self, up: UpAxis) {
        self.up = up;
        self.reset();
    }

    /// Turns the table about another axis from now on, which became known late: the model is framed again where the view is
    /// still the first one, else the eye and the direction stay.
    pub fn take_up(&mut self, up: UpAxis) {
        let (azimuth, elevation, fill) = self.home;
        let angles = (azimuth, elevation.clamp(-FRAC_PI_2, FRAC_PI_2));
        let is_first = self.framed == Some(fill) && (self.azimuth, self.elevation) == angles;
        let camera = self.camera();
        self.set_up(up);
        if !is_first {
            self.look_as(&camera);
        }
    }

    /// The turntable's axis.
    pub fn up(&self) -> UpAxis {
        self.up
    }

    /// Distance from which the model fills the part `fill` of the shorter side.
    fn distance_for(&self, fill: f64) -> f64 {
        let (width, height) = self.size;
        let t = (FOV_Y / 2.0).tan() * (f64::from(width) / f64::from(height)).min(1.0);
        self.radius / (fill * t).atan().sin()
    }

    fn frame(&mut self, fill: f64) {
        self.pivot = self.model_center;
        self.eye = DVec3::new(0.0, 0.0, self.distance_for(fill));
        self.framed = Some(fill);
    }

    /// The turntable camera that looks as `camera` does, for the same model: eye and direction are kept; a turn about
    /// the view direction and another field of view are not. The center of rotation is where the view passes the
    /// model's center.
    pub fn look_as(&mut self, camera: &Camera) {
        let world_from_view = camera.view.inverse();
        let eye = world_from_view.transform_point3(DVec3::ZERO);
        let back = world_from_view
            .transform_vector3(DVec3::Z)
            .normalize_or(DVec3::Z);
        let turned = self.up.from_world(back);
        self.elevation = turned.y.clamp(-1.0, 1.0).asin();
        if self.elevation.cos() > POLE {
            self.azimuth = turned.x.atan2(turned.z).rem_euclid(2.0 * PI);
        } else {
            // Straight down or up: the turn is in the direction that is up on the picture.
            let up = world_from_view.transform_vector3(DVec3::Y) * -turned.y.signum();
            let up = self.up.from_world(up);
            self.azimuth = up.x.atan2(up.z).rem_euclid(2.0 * PI);
        }
        let distance = (eye - self.model_center).dot(back);
        let distance = distance.max(0.01 * self.radius);
        let back = self.basis().2;
        self.pivot = eye - distance * back;
        self.eye = distance * DVec3::Z;
        self.framed = None;
        self.keep_near();
    }

    /// Turns the view about the eye by a drag of `by` pixels, as a head is turned.
    pub fn look_around(&mut self, by: DVec2) {
        self.center_ahead();
        let eye = self.eye();
        let pixel = FOV_Y / f64::from(self.size.1);
        self.azimuth = (self.azimuth - by.x * pixel).rem_euclid(2.0 * PI);
        self.elevation = (self.elevation + by.y * pixel).clamp(-FRAC_PI_2, FRAC_PI_2);
        self.pivot = eye - self.world(self.eye);
        self.framed = None;
        self.keep_near();
    }

    /// Moves the eye by `by` (right, up, back), in radii of the model.
    pub fn fly(&mut self, by: DVec3) {
        self.center_ahead();
        self.pivot += self.world(by * self.radius);
        self.framed = None;
        self.keep_near();
    }

    /// Makes a point straight ahead the center of rotation; what is seen does not change.
    fn center_ahead(&mut self) {
        if self.eye.x != 0.0 || self.eye.y != 0.0 {
            self.pivot += self.world(DVec3::new(self.eye.x, self.eye.y, 0.0));
            (self.eye.x, self.eye.y) = (0.0, 0.0);
        }
    }

    /// Turns the table by `angle` radians, without limits.
    pub fn turn_table(&mut self, angle: f64) {
        self.azimuth = (self.azimuth + angle).rem_euclid(2.0 * PI);
        self.keep_near();
    }

    /// Moves back or forth, and the center of rotation to the model's middle, so that the model fills the
    /// picture; the direction stays.
    pub fn frame_model(&mut self) {
        self.frame(1.0);
    }

    /// Back to what [`new`](OrbitCamera::new) made.
    pub fn reset(&mut self) {
        (self.azimuth, self.elevation) = (self.home.0, self.home.1.clamp(-FRAC_PI_2, FRAC_PI_2));
        self.frame(self.home.2);
    }

    /// Looks from the given side, radians, without changing the distance.
    pub fn look_from(&mut self, azimuth: f64, elevation: f64) {
        self.azimuth = azimuth;
        self.elevation = elevation.clamp(-FRAC_PI_2, FRAC_PI_2);
        self.keep_near();
    }

    /// The picture has another size. A model that was framed and only turned since is framed again.
    pub fn resize(&mut self, size: (u32, u32)) {
        self.size = (size.0.max(1), size.1.max(1));
        if let Some(fill) = self.framed {
            self.frame(fill);
        }
    }

    /// Right, up and back of view space in world space.
    fn basis(&self) -> (DVec3, DVec3, DVec3) {
        let (sin_a, cos_a) = self.azimuth.sin_cos();
        let (sin_e, cos_e) = self.elevation.sin_cos();
        let world = |v| self.up.to_world(v);
        (
            world(DVec3::new(cos_a, 0.0, -sin_a)),
            world(DVec3::new(-sin_e * sin_a, cos_e, -sin_e * cos_a)),
            world(DVec3::new(cos_e * sin_a, sin_e, cos_e * cos_a)),
        )
    }

    fn world(&self, v: DVec3) -> DVec3 {
        let (right, up, back) = self.basis();
        v.x * right + v.y * up + v.z * back
    }

    /// Place of the eye, world space.
    pub fn eye(&self) -> DVec3 {
        self.pivot + self.world(self.eye)
    }

    /// Center of rotation, world space.
    pub fn pivot(&self) -> DVec3 {
        self.pivot
    }

    /// Distance of the center of rotation along the view direction; above 0.
    pub fn pivot_distance(&self) -> f64 {
        self.eye.z
    }

    /// Half the extent of the picture at view-space distance 1.
    fn half_extent(&self) -> DVec2 {
        let t = (FOV_Y / 2.0).tan();
        DVec2::new(t * f64::from(self.size.0) / f64::from(self.size.1), t)
    }

    /// View-space point that is seen at pixel position `at` (y down) at `distance` along the view direction.
    fn seen_at(&self, at: DVec2, distance: f64) -> DVec3 {
        let size = DVec2::new(f64::from(self.size.0), f64::from(self.size.1));
        let ndc = (2.0 * at / size - 1.0) * DVec2::new(1.0, -1.0);
        (ndc * self.half_extent() * distance).extend(-distance)
    }

    /// Turns by a drag of `by` pixels: the picture's shorter side is half a turn. Stops at the poles.
    pub fn turn(&mut self, by: DVec2) {
        let side = f64::from(self.size.0.min(self.size.1));
        self.azimuth = (self.azimuth - by.x * PI / side).rem_euclid(2.0 * PI);
        self.elevation = (self.elevation + by.y * PI / side).clamp(-FRAC_PI_2, FRAC_PI_2);
        self.keep_near();
    }

    /// Moves sideways by a drag of `by` pixels, so that what is at `distance` along the view direction follows
    /// the cursor. The center of rotation stays with the model.
    pub fn pan(&mut self, by: DVec2, distance: f64) {
        let size = DVec2::new(f64::from(self.size.0), f64::from(self.size.1));
        let shift = 2.0 * by / size * self.half_extent() * distance;
        self.eye += DVec3::new(-shift.x, shift.y, 0.0);
        self.keep_near();
        self.framed = None;
    }

    /// Multiplies the distance from the point seen at pixel position `at` at `distance` along the view
    /// direction by `factor`; that point stays where it is on screen.
    ///
    /// Where this would leave the center of rotation behind the eye, the point becomes the center.
    pub fn zoom(&mut self, factor: f64, at: DVec2, distance: f64) {
        let distance = distance.max(NEAREST * self.radius);
        let least = (NEAREST * self.radius / distance).min(1.0);
        let factor = if factor.is_finite() {
            factor.max(least)
        } else {
            1.0
        };
        let point = self.seen_at(at, distance);
        let eye = self.eye + (1.0 - factor) * point;
        if eye.z <= NEAREST * self.radius {
            self.pivot += self.world(self.eye + point);
            self.eye = -point * factor;
        } else {
            self.eye = eye;
        }
        self.keep_near();
        self.framed = None;
    }

    /// Factor of `steps` of the wheel, towards the model above 0.
    pub fn wheel_factor(steps: f64) -> f64 {
        WHEEL_STEP.powf(steps.clamp(-20.0, 20.0))
    }

    /// Factor of a drag by `pixels` downward, away from the model.
    pub fn drag_factor(&self, pixels: f64) -> f64 {
        (4.0 * pixels / f64::from(self.size.1))
            .clamp(-8.0, 8.0)
            .exp()
    }

    /// Makes the point seen at pixel position `at` at `distance` along the view direction the center of
    /// rotation; what is seen does not change.
    pub fn set_pivot(&mut self, at: DVec2, distance: f64) {
        if !(distance.is_finite() && distance > 0.0) {
            return;
        }
        let point = self.seen_at(at, distance);
        self.pivot += self.world(self.eye + point);
        self.eye = -point;
        self.framed = None;
    }

    /// Keeps the eye within reach of the model.
    fn keep_near(&mut self) {
        let from_center = self.eye() - self.model_center;
        let limit = FARTHEST * self.radius;
        if from_center.length() > limit {
            let excess = from_center - from_center.normalize_or_zero() * limit;
            let (right, up, back) = self.basis();
            self.eye -= DVec3::new(excess.dot(right), excess.dot(up), excess.dot(back));
            if self.eye.z <= NEAREST * self.radius {
                // The center of rotation came to lie behind the eye: it moves in front.
                self.pivot += self.world(self.eye) - self.radius * back;
                self.eye = self.radius * DVec3::Z;
            }
        }
    }

    /// Near and far plane: the model's sphere lies between them with 5% to spare, except for what is closer
    /// than a hundredth of its radius, or a quarter of the distance to the center of rotation if that is less.
    pub fn near_far(&self) -> (f64, f64) {
        let back = self.basis().2;
        // Written as a difference to the pivot's distance, so that it is exactly that for the model's center.
        let distance = self.eye.z + (self.pivot - self.model_center).dot(back);
        let reach = 1.05 * self.radius;
        let least = (0.01 * self.radius).min(0.25 * self.eye.z);
        let near = (distance - reach).max(least);
        // The second bound serves a model that lies behind the eye.
        (near, (distance + reach).max(near + 0.01 * self.radius))
    }

    /// The camera for a picture of the present size.
    pub fn camera(&self) -> Camera {
        let (right, up, back) = self.basis();
        let target = self.pivot + self.eye.x * right + self.eye.y * up;
        let eye = target + self.eye.z * back;
        let world_up = if self.elevation.cos() < POLE {
            up
        } else {
            self.up.direction()
        };
        Camera::look_at(
            self.size,
            eye,
            target,
            world_up,
            FOV_Y,
            self.near_far().into(),
        )
    }
}

#[cfg(test)]
mod tests;
