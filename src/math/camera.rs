//! Cameras: the file format, the standard orbit, and the [`View`] that the cut and the passes work with.
//!
//! World space is right-handed; view space looks down -z with +x right and +y up. Matrices of a camera file
//! are column-major, clip = proj * view * world, with clip depth 0 at the near and 1 at the far plane.

use crate::math::up_axis::UpAxis;
use glam::{DMat4, DVec3, DVec4, Mat4, Vec3, Vec4};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Why a camera is unusable.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// The camera file could not be read.
    #[error("cannot read the camera file {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The camera file is not the JSON that is expected.
    #[error(
        "{path}: {source}; expected {{\"width\", \"height\", \"view\": [16], \"proj\": [16], \"y_down\", \"light\"}}"
    )]
    Json {
        /// The file.
        path: PathBuf,
        /// Line, column and cause.
        source: serde_json::Error,
    },
    /// A value is outside of what a camera can be.
    #[error("unusable camera: {0}")]
    Value(String),
}

/// Where the light of the headlight shading is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HeadlightSource {
    /// A point light in the eye.
    #[default]
    Point,
    /// Parallel light along the view direction (+z of view space towards the viewer).
    Directional,
}

/// A camera as the camera file has it: picture size and double-precision matrices in world space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Width of the picture in pixels.
    pub width: u32,
    /// Height of the picture in pixels.
    pub height: u32,
    /// View matrix, view space from world space.
    #[serde(with = "matrix")]
    pub view: DMat4,
    /// Projection, clip space (depth 0 near, 1 far, y up unless `y_down`) from view space.
    #[serde(with = "matrix")]
    pub proj: DMat4,
    /// Row 1 of `proj` is already negated.
    #[serde(default)]
    pub y_down: bool,
    /// Where the headlight is.
    #[serde(default)]
    pub light: HeadlightSource,
    /// Keys this program does not know; kept when the camera is written again.
    #[serde(flatten)]
    pub other: serde_json::Map<String, serde_json::Value>,
}

mod matrix {
    use glam::DMat4;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(m: &DMat4, s: S) -> Result<S::Ok, S::Error> {
        m.to_cols_array().serialize(s)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<DMat4, D::Error> {
        Ok(DMat4::from_cols_array(&<[f64; 16]>::deserialize(d)?))
    }
}

/// Largest picture side that is accepted, pixels.
pub const MAX_SIDE: u32 = 16_384;

impl Camera {
    /// Reads a camera file.
    ///
    /// # Errors
    /// When the file cannot be read, is not JSON of the expected form, or describes no usable camera.
    pub fn read(path: &Path) -> Result<Self, CameraError> {
        let text = std::fs::read_to_string(path).map_err(|source| CameraError::Read {
            path: path.to_owned(),
            source,
        })?;
        let camera: Self = serde_json::from_str(&text).map_err(|source| CameraError::Json {
            path: path.to_owned(),
            source,
        })?;
        camera.view(DVec3::ZERO)?;
        Ok(camera)
    }

    /// A perspective camera at `eye` looking at `target`; `fov_y` in radians, `0 < near < far`.
    pub fn look_at(
        (width, height): (u32, u32),
        eye: DVec3,
        target: DVec3,
        up: DVec3,
        fov_y: f64,
        [near, far]: [f64; 2],
    ) -> Self {
        let back = (eye - target).normalize_or(DVec3::Z);
        let right = up.cross(back).normalize_or(back.any_orthonormal_vector());
        let above = back.cross(right);
        let view = DMat4::from_cols(
            DVec4::new(right.x, above.x, back.x, 0.0),
            DVec4::new(right.y, above.y, back.y, 0.0),
            DVec4::new(right.z, above.z, back.z, 0.0),
            DVec4::new(-right.dot(eye), -above.dot(eye), -back.dot(eye), 1.0),
        );
        let t = (fov_y / 2.0).tan();
        let aspect = f64::from(width) / f64::from(height);
        Self {
            width,
            height,
            view,
            proj: perspective(1.0 / (t * aspect), 1.0 / t, near, far),
            y_down: false,
            light: HeadlightSource::Point,
            other: serde_json::Map::new(),
        }
    }

    /// The standard orbit: vertical field of view 45 degrees, looking at `center`; `azimuth` and `elevation`
    /// in radians; `fill` is the projected diameter of the bounding sphere over the shorter side (1 fills
    /// the picture). `radius` is the largest vertex distance from `center`; 0 or less counts as 1.
    pub fn orbit(
        (width, height): (u32, u32),
        center: DVec3,
        radius: f64,
        azimuth: f64,
        elevation: f64,
        fill: f64,
    ) -> Self {
        let radius = if radius > 0.0 { radius } else { 1.0 };
        let fov_y = 45f64.to_radians();
        let t = (fov_y / 2.0).tan() * (f64::from(width) / f64::from(height)).min(1.0);
        let d = radius / (fill * t).atan().sin();
        let (sin_a, cos_a) = azimuth.sin_cos();
        let (sin_e, cos_e) = elevation.sin_cos();
        let eye = center + d * DVec3::new(cos_e * sin_a, sin_e, cos_e * cos_a);
        let near = (d - 1.05 * radius).max(0.01 * radius);
        let up = if cos_e.abs() < 1e-6 {
            DVec3::Z
        } else {
            DVec3::Y
        };
        Self::look_at(
            (width, height),
            eye,
            center,
            up,
            fov_y,
            [near, d + 1.05 * radius],
        )
    }

    /// As [`Camera::orbit`], about another axis than y: the same picture of a model that lies turned, so that `up` is y of
    /// the orbit.
    pub fn orbit_about(
        up: UpAxis,
        size: (u32, u32),
        center: DVec3,
        radius: f64,
        (azimuth, elevation, fill): (f64, f64, f64),
    ) -> Self {
        let turned = Self::orbit(size, DVec3::ZERO, radius, azimuth, elevation, fill);
        if up == UpAxis::Y {
            return Self::orbit(size, center, radius, azimuth, elevation, fill);
        }
        let orbit_from_world = DMat4::from_cols(
            up.from_world(DVec3::X).extend(0.0),
            up.from_world(DVec3::Y).extend(0.0),
            up.from_world(DVec3::Z).extend(0.0),
            (-up.from_world(center)).extend(1.0),
        );
        Self {
            view: turned.view * orbit_from_world,
            ..turned
        }
    }

    /// View `k` of `n` of the standard orbit: azimuth (k + 1/2) * 360/n degrees, elevation 20 degrees.
    pub fn orbit_view(
        size: (u32, u32),
        center: DVec3,
        radius: f64,
        fill: f64,
        k: u32,
        n: u32,
    ) -> Self {
        let azimuth = (f64::from(k) + 0.5) * std::f64::consts::TAU / f64::from(n.max(1));
        Self::orbit(size, center, radius, azimuth, 20f64.to_radians(), fill)
    }

    /// The view of a model whose model-space zero lies at `origin` in world space.
    ///
    /// # Errors
    /// When a matrix is not finite, the view is singular, the projection is neither perspective nor
    /// orthographic in the convention above, or the size is 0 or above [`MAX_SIDE`].
    pub fn view(&self, origin: DVec3) -> Result<View, CameraError> {
        let fail = |what: String| Err(CameraError::Value(what));
        if self.width == 0 || self.height == 0 || self.width > MAX_SIDE || self.height > MAX_SIDE {
            return fail(format!(
                "the picture is {} x {} pixels; each side must be 1 to {MAX_SIDE}",
                self.width, self.height
            ));
        }
        if !self.view.is_finite() || !self.proj.is_finite() || !origin.is_finite() {
            return fail("a matrix has an element that is not finite".into());
        }
        if self.view.row(3) != DVec4::W || self.view.determinant().abs() < 1e-30 {
            return fail(
                "the view matrix is not an invertible affine transform (last row 0 0 0 1)".into(),
            );
        }
        let mut p = self.proj;
        if self.y_down {
            p.x_axis.y = -p.x_axis.y;
            p.y_axis.y = -p.y_axis.y;
            p.z_axis.y = -p.z_axis.y;
            p.w_axis.y = -p.w_axis.y;
        }
        let last = p.row(3);
        let is_perspective = last == DVec4::new(0.0, 0.0, -1.0, 0.0);
        let is_orthographic = last == DVec4::W;
        if !is_perspective && !is_orthographic {
            return fail(format!(
                "the last row of the projection is {last}; expected 0 0 -1 0 (perspective) or 0 0 0 1 (orthographic)"
            ));
        }
        if p.x_axis.y != 0.0
            || p.y_axis.x != 0.0
            || p.row(2).x != 0.0
            || p.row(2).y != 0.0
            || p.x_axis.x == 0.0
            || p.y_axis.y == 0.0
        {
            return fail("the projection is sheared or flat; rows 0 and 1 may have a scale and an offset only".into());
        }
        let (m22, m32) = (p.z_axis.z, p.w_axis.z);
        let (near, far) = if is_perspective {
            (m32 / m22, m32 / (m22 + 1.0))
        } else {
            (m32 / m22, (m32 - 1.0) / m22)
        };
        if !(near.is_finite() && far.is_finite() && near < far && (near > 0.0 || is_orthographic)) {
            return fail(format!(
                "near = {near} and far = {far} as read from the projection; expected finite near < far, and 0 < near for a perspective"
            ));
        }
        let view_from_model = self.view * DMat4::from_translation(origin);
        let model_from_view = view_from_model.inverse();
        let scale = view_from_model.x_axis.truncate().length();
        Ok(View {
            width: self.width,
            height: self.height,
            view_from_model: view_from_model.as_mat4(),
            eye: model_from_view.transform_point3(DVec3::ZERO).as_vec3(),
            backward: model_from_view
                .transform_vector3(DVec3::Z)
                .normalize()
                .as_vec3(),
            is_perspective,
            scale: [p.x_axis.x as f32, p.y_axis.y as f32],
            // clip.xy / clip.w = (scale * xy + offset * z) / -z for a perspective.
            offset: if is_perspective {
                [p.z_axis.x as f32, p.z_axis.y as f32]
            } else {
                [p.w_axis.x as f32, p.w_axis.y as f32]
            },
            near: near as f32,
            far: far as f32,
            model_scale: scale as f32,
            light: self.light,
        })
    }
}

/// Perspective projection with depth 0 at near and 1 at far; `sx`, `sy` are the cotangents of half the fields
/// of view.
fn perspective(sx: f64, sy: f64, near: f64, far: f64) -> DMat4 {
    DMat4::from_cols(
        DVec4::new(sx, 0.0, 0.0, 0.0),
        DVec4::new(0.0, sy, 0.0, 0.0),
        DVec4::new(0.0, 0.0, far / (near - far), -1.0),
        DVec4::new(0.0, 0.0, near * far / (near - far), 0.0),
    )
}

/// A camera made ready for one model: single precision, model space (world minus the model's origin).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Width of the picture in pixels.
    pub width: u32,
    /// Height of the picture in pixels.
    pub height: u32,
    /// View space from model space.
    pub view_from_model: Mat4,
    /// The eye in model space (of no meaning for an orthographic view).
    pub eye: Vec3,
    /// Unit vector from the scene towards the viewer (+z of view space) in model space.
    pub backward: Vec3,
    /// Perspective, else orthographic.
    pub is_perspective: bool,
    /// Scale of x and y in clip space: cotangents of half the fields of view for a perspective.
    pub scale: [f32; 2],
    /// Off-center shift of the projection: added times z (perspective) or as it is (orthographic).
    pub offset: [f32; 2],
    /// Distance of the near plane along the view direction.
    pub near: f32,
    /// Distance of the far plane along the view direction.
    pub far: f32,
    /// Length of a model-space unit vector in view space: 1 unless the view matrix scales.
    pub model_scale: f32,
    /// Where the headlight is.
    pub light: HeadlightSource,
}

impl View {
    /// Pixels per unit of tangent (perspective) or per view-space unit (orthographic): the focal length `f`,
    /// the larger one where pixels are not square.
    pub fn focal_px(&self) -> f32 {
        (self.scale[0].abs() * self.width as f32).max(self.scale[1].abs() * self.height as f32)
            / 2.0
    }

    /// Clip space as the device uses it: y down, depth reversed (1 at near, 0 at far).
    pub fn clip_from_view(&self) -> Mat4 {
        let (n, f) = (f64::from(self.near), f64::from(self.far));
        let [sx, sy] = self.scale;
        let [ox, oy] = self.offset;
        if self.is_perspective {
            Mat4::from_cols(
                Vec4::new(sx, 0.0, 0.0, 0.0),
                Vec4::new(0.0, -sy, 0.0, 0.0),
                Vec4::new(ox, -oy, (n / (f - n)) as f32, -1.0),
                Vec4::new(0.0, 0.0, (n * f / (f - n)) as f32, 0.0),
            )
        } else {
            Mat4::from_cols(
                Vec4::new(sx, 0.0, 0.0, 0.0),
                Vec4::new(0.0, -sy, 0.0, 0.0),
                Vec4::new(0.0, 0.0, (1.0 / (f - n)) as f32, 0.0),
                Vec4::new(ox, -oy, (f / (f - n)) as f32, 1.0),
            )
        }
    }

    /// View-space distance along the view direction of a reversed depth-buffer value; infinity at 0.
    pub fn distance_of_depth(&self, depth: f32) -> f32 {
        if depth <= 0.0 {
            return f32::INFINITY;
        }
        let (n, f, d) = (f64::from(self.near), f64::from(self.far), f64::from(depth));
        if self.is_perspective {
            (n * f / (d * (f - n) + n)) as f32
        } else {
            (f - d * (f - n)) as f32
        }
    }

    /// Distance of a model-space point along the view direction; negative behind the eye.
    pub fn distance(&self, point: Vec3) -> f32 {
        -self.view_from_model.transform_point3(point).z
    }

    /// Pixel position (x right, y down, pixel centers at halves) and distance along the view direction of a
    /// model-space point; the position means nothing when the distance is 0 or less in a perspective.
    pub fn project(&self, point: Vec3) -> (f32, f32, f32) {
        let v = self.view_from_model.transform_point3(point);
        let (x, y) = if self.is_perspective {
            (
                (self.scale[0] * v.x + self.offset[0] * v.z) / -v.z,
                (self.scale[1] * v.y + self.offset[1] * v.z) / -v.z,
            )
        } else {
            (
                self.scale[0] * v.x + self.offset[0],
                self.scale[1] * v.y + self.offset[1],
            )
        };
        (
            (x + 1.0) / 2.0 * self.width as f32,
            (1.0 - y) / 2.0 * self.height as f32,
            -v.z,
        )
    }

    /// A line of model space in the picture, pixels, without what lies before the near plane; `None` where all of it does.
    pub fn visible_line(&self, [a, b]: [Vec3; 2]) -> Option<[[f32; 2]; 2]> {
        let near = self.near.max(1e-6);
        let [from, to] = [self.distance(a), self.distance(b)];
        let cut = |inside: Vec3, outside: Vec3, d: [f32; 2]| {
            inside.lerp(outside, (d[0] - near) / (d[0] - d[1]))
        };
        let (a, b) = match (from > near, to > near) {
            (false, false) => return None,
            (true, true) => (a, b),
            (true, false) => (a, cut(a, b, [from, to])),
            (false, true) => (cut(b, a, [to, from]), b),
        };
        let place = |p: Vec3| {
            let (x, y, _) = self.project(p);
            [x, y]
        };
        let line = [place(a), place(b)];
        line.iter().flatten().all(|v| v.is_finite()).then_some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A model that was turned is seen as it was before, from an orbit about the axis that y became.
    #[test]
    fn an_orbit_about_another_axis_sees_a_turned_model_as_it_was() {
        let (center, point) = (DVec3::new(10.0, -3.0, 7.0), DVec3::new(0.3, 1.1, -0.7));
        for up in [UpAxis::X, UpAxis::Y, UpAxis::Z] {
            for angles in [
                (0.5, 0.3, 1.0),
                (-2.0, -1.2, 0.25),
                (1.0, std::f64::consts::FRAC_PI_2, 2.0),
            ] {
                let (azimuth, elevation, fill) = angles;
                let plain = Camera::orbit((300, 200), center, 2.0, azimuth, elevation, fill);
                let turned = Camera::orbit_about(up, (300, 200), center, 2.0, angles);
                let seen = plain.view.transform_point3(center + point);
                let own = turned.view.transform_point3(center + up.to_world(point));
                assert!(seen.distance(own) < 1e-9, "{up:?} {angles:?}");
                assert_eq!(plain.proj, turned.proj);
            }
        }
    }

    #[test]
    fn near_and_far_come_back_out_of_the_projection() {
        let camera = Camera::look_at(
            (500, 400),
            DVec3::new(0.0, 0.0, 3.0),
            DVec3::ZERO,
            DVec3::Y,
            1.0,
            [0.5, 9.0],
        );
        let view = camera.view(DVec3::ZERO).unwrap();
        assert!((view.near - 0.5).abs() < 1e-6 && (view.far - 9.0).abs() < 1e-5);
        assert!((view.focal_px() - 200.0 / 0.5f32.tan()).abs() < 1e-3);
        for z in [0.5f32, 1.0, 4.0, 9.0] {
            let clip = view.clip_from_view() * Vec4::new(0.0, 0.0, -z, 1.0);
            let depth = clip.z / clip.w;
            assert!((0.0..=1.000_001).contains(&depth));
            if z < 8.9 {
                assert!((view.distance_of_depth(depth) - z).abs() < 1e-5 * z);
            }
        }
    }

    #[test]
    fn points_project_to_the_pixels_of_the_convention() {
        let camera = Camera::look_at(
            (500, 500),
            DVec3::new(0.0, 0.0, 3.0),
            DVec3::ZERO,
            DVec3::Y,
            60f64.to_radians(),
            [0.1, 10.0],
        );
        let view = camera.view(DVec3::ZERO).unwrap();
        let (x, y, z) = view.project(Vec3::new(1.0, 0.5, 0.0));
        let f = 250.0 / 30f32.to_radians().tan();
        assert!((x - (250.0 + f / 3.0)).abs() < 1e-3, "{x}");
        assert!((y - (250.0 - f * 0.5 / 3.0)).abs() < 1e-3, "{y}");
        assert!((z - 3.0).abs() < 1e-6);
    }

    #[test]
    fn a_camera_file_keeps_unknown_keys_and_flips_y() {
        let camera = Camera::orbit((64, 32), DVec3::ZERO, 2.0, 0.3, 0.2, 0.5);
        let mut json = serde_json::to_value(&camera).unwrap();
        json["note"] = "kept".into();
        let again: Camera = serde_json::from_value(json).unwrap();
        assert_eq!(again.other["note"], "kept");
        assert_eq!(again.view, camera.view);
        let mut flipped = camera.clone();
        flipped.y_down = true;
        flipped.proj.y_axis.y = -flipped.proj.y_axis.y;
        assert_eq!(
            flipped.view(DVec3::ZERO).unwrap(),
            camera.view(DVec3::ZERO).unwrap()
        );
    }

    #[test]
    fn unusable_cameras_are_refused() {
        let good = Camera::orbit((64, 32), DVec3::ZERO, 2.0, 0.3, 0.2, 0.5);
        let mut c = good.clone();
        c.width = 0;
        assert!(c.view(DVec3::ZERO).is_err());
        let mut c = good.clone();
        c.proj.x_axis.x = f64::NAN;
        assert!(c.view(DVec3::ZERO).is_err());
        let mut c = good.clone();
        c.proj.z_axis.w = 1.0;
        assert!(c.view(DVec3::ZERO).is_err());
        let mut c = good;
        c.view = DMat4::ZERO;
        assert!(c.view(DVec3::ZERO).is_err());
    }
}
