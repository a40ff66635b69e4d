//! The view volume as planes in model space.
//!
//! Sources: Benda, *Point Based Rendering*, sections 2.4 and 3.3; Rusinkiewicz and Levoy, *QSplat* (SIGGRAPH
//! 2000), section 2.1. Deviation: the side planes can be moved outward by a margin in pixels, because a
//! splat may reach further than the sphere it stands for.

use super::camera::View;
use glam::{DMat4, DVec3, DVec4, Vec3};

/// A plane in model space: points with `normal . p + offset >= 0` are inside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit vector that points into the volume.
    pub normal: DVec3,
    /// Signed distance of the model-space zero, model units.
    pub offset: f64,
}

impl Plane {
    /// Signed distance of a point in model units, positive inside.
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) + self.offset
    }

    /// The plane that `coefficients . (p, 1) >= 0` describes; a zero normal gives a plane with everything
    /// inside, so that an impossible view drops nothing.
    fn new(coefficients: DVec4) -> Self {
        let length = coefficients.truncate().length();
        if length > 0.0 && length.is_finite() {
            Self {
                normal: coefficients.truncate() / length,
                offset: coefficients.w / length,
            }
        } else {
            Self {
                normal: DVec3::ZERO,
                offset: f64::INFINITY,
            }
        }
    }
}

/// Six planes around what a view can see, model space, double precision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frustum {
    /// Left, right, bottom, top.
    pub sides: [Plane; 4],
    /// At the near distance, pointing away from the viewer.
    pub near: Plane,
    /// At the far distance, pointing to the viewer.
    pub far: Plane,
}

impl Frustum {
    /// The volume of `view`, its sides moved outward by `margin_px` pixels on the screen (0 or more; anything
    /// else counts as 0).
    ///
    /// The sides of a perspective pass through the eye that the matrix describes.
    pub fn new(view: &View, margin_px: f32) -> Self {
        let margin = f64::from(margin_px.max(0.0));
        let model_from_plane =
            DMat4::from_cols_array(&view.view_from_model.to_cols_array().map(f64::from))
                .transpose();
        let plane = |in_view: DVec4| Plane::new(model_from_plane * in_view);
        // In clip space the sides are w +- x >= 0; a margin of m pixels widens them to (1 + 2 m / W) w +- x >= 0.
        let side = |axis: usize, sign: f64, pixels: u32| {
            let reach = 1.0 + 2.0 * margin / f64::from(pixels.max(1));
            let (scale, shift) = (f64::from(view.scale[axis]), f64::from(view.offset[axis]));
            let mut coefficients = if view.is_perspective {
                DVec4::new(0.0, 0.0, sign * shift - reach, 0.0)
            } else {
                DVec4::new(0.0, 0.0, 0.0, sign * shift + reach)
            };
            coefficients[axis] = sign * scale;
            plane(coefficients)
        };
        Self {
            sides: [
                side(0, 1.0, view.width),
                side(0, -1.0, view.width),
                side(1, 1.0, view.height),
                side(1, -1.0, view.height),
            ],
            near: plane(DVec4::new(0.0, 0.0, -1.0, -f64::from(view.near))),
            far: plane(DVec4::new(0.0, 0.0, 1.0, f64::from(view.far))),
        }
    }

    /// The planes: left, right, bottom, top, near, far.
    pub fn planes(&self) -> [Plane; 6] {
        let [left, right, bottom, top] = self.sides;
        [left, right, bottom, top, self.near, self.far]
    }

    /// Tells whether a point is in the volume (its boundary counts as inside).
    pub fn contains(&self, point: Vec3) -> bool {
        self.planes()
            .iter()
            .all(|p| p.distance(point.as_dvec3()) >= 0.0)
    }

    /// Tells whether a ball lies wholly outside of one plane. Errs to "no": a ball near a corner of the volume may
    /// be kept although it is outside; one that touches the volume is never dropped.
    pub fn is_outside(&self, center: Vec3, radius: f32) -> bool {
        self.planes()
            .iter()
            .any(|p| p.distance(center.as_dvec3()) < -f64::from(radius))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests stop at the first surprise")]
mod tests {
    use super::*;
    use crate::math::camera::Camera;
    use glam::Vec4;

    fn views() -> Vec<View> {
        let eye = DVec3::new(1.0, 2.0, 5.0);
        let mut camera = Camera::look_at((300, 200), eye, DVec3::ZERO, DVec3::Y, 0.9, [0.5, 9.0]);
        let plain = camera.view(DVec3::new(0.1, -0.2, 0.3)).unwrap();
        camera.proj.z_axis.x = 0.3;
        camera.proj.z_axis.y = -0.2;
        let shifted = camera.view(DVec3::ZERO).unwrap();
        camera.view = glam::DMat4::from_scale(DVec3::splat(2.5)) * camera.view;
        let scaled = camera.view(DVec3::ZERO).unwrap();
        let (n, f) = (-2.0, 11.0);
        camera.proj = DMat4::from_cols(
            DVec4::new(0.2, 0.0, 0.0, 0.0),
            DVec4::new(0.0, 0.3, 0.0, 0.0),
            DVec4::new(0.0, 0.0, 1.0 / (n - f), 0.0),
            DVec4::new(0.1, -0.1, n / (n - f), 1.0),
        );
        vec![plain, shifted, scaled, camera.view(DVec3::ZERO).unwrap()]
    }

    #[test]
    fn the_volume_is_what_clip_space_says() {
        let mut state = 1u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f32 / (1u64 << 24) as f32 * 12.0 - 6.0
        };
        for view in views() {
            let frustum = Frustum::new(&view, 0.0);
            let (mut inside, mut outside) = (0, 0);
            for _ in 0..20_000 {
                let p = Vec3::new(next(), next(), next());
                let clip = view.clip_from_view() * (view.view_from_model * p.extend(1.0));
                let slack = |v: Vec4| {
                    let all = [v.w + v.x, v.w - v.x, v.w + v.y, v.w - v.y, v.w - v.z, v.z];
                    all.into_iter().fold(f32::INFINITY, f32::min)
                };
                let s = slack(clip);
                if s.abs() > 1e-4 {
                    assert_eq!(frustum.contains(p), s > 0.0, "{p} in {view:?}");
                    *(if s > 0.0 { &mut inside } else { &mut outside }) += 1;
                }
            }
            assert!(inside > 50 && outside > 50, "{inside} {outside}");
        }
    }

    #[test]
    fn a_margin_moves_the_sides_by_pixels() {
        for view in views() {
            for margin in [0.0f32, 1.5, 20.0] {
                let frustum = Frustum::new(&view, margin);
                let model_from_view = view.view_from_model.inverse();
                let depth = (view.near + view.far) / 2.0;
                // The pixel position that lies m + d pixels left of the picture, half way up.
                for (d, expected) in [(-0.01f32, true), (0.01, false)] {
                    let x_ndc = -1.0 - 2.0 * (margin + d) / view.width as f32;
                    let z = -depth;
                    let x = if view.is_perspective {
                        (x_ndc * -z - view.offset[0] * z) / view.scale[0]
                    } else {
                        (x_ndc - view.offset[0]) / view.scale[0]
                    };
                    let y = if view.is_perspective {
                        -view.offset[1] * z / view.scale[1]
                    } else {
                        -view.offset[1] / view.scale[1]
                    };
                    let p = model_from_view.transform_point3(Vec3::new(x, y, z));
                    assert_eq!(frustum.contains(p), expected, "{margin} {d} {view:?}");
                }
            }
        }
    }

    #[test]
    fn a_ball_that_touches_the_volume_is_kept() {
        let view = views()[0];
        let frustum = Frustum::new(&view, 0.0);
        for plane in frustum.planes() {
            let middle = frustum.near.normal * -frustum.near.offset + frustum.near.normal * 3.0;
            let foot = middle - plane.normal * plane.distance(middle);
            let center = |s: f64| (foot + plane.normal * s).as_vec3();
            assert!(!frustum.is_outside(center(-0.999), 1.0));
            assert!(frustum.is_outside(center(-1.001), 1.0));
        }
    }
}
