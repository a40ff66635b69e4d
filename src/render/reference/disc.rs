//! The footprint of an oriented disc, by intersecting the ray of each pixel with the disc's plane (methods 7.2).
//!
//! A patch of surface around c lies in a ball of radius r and between two planes of normal n at a distance of h r from
//! c. Seen under the cosine k = |n . v| that slab is k + h sqrt(1 - k²) radii wide, so the footprint is the disc
//! whose plane is tilted towards the eye until its cosine is
//!
//! k' = min(1, max(0.1, k + h sqrt(1 - k²))),
//!
//! with the minor axis where it was: n' = k' v + sqrt(1 - k'²) unit(n - (n . v) v), for n turned to the eye. Without a
//! normal the disc faces the eye. The lower bound keeps discs at a rim, where normals are unsure, from becoming
//! lines that leave holes (Rusinkiewicz and Levoy, "QSplat", 2000, section 3.3).
//!
//! The shaders have the same footprint as a quadratic form (`shaders/common/disc.glsl`); here it is computed as it is
//! defined.

use crate::render::reference::frame::ReferenceFrame;
use glam::{DVec2, DVec3, Vec3};
use std::ops::Range;

/// Least ratio of a footprint's axes.
const LEAST_RATIO: f64 = 0.1;

/// A circle of a smaller diameter, in pixels, may lie between the centers of pixels. It is the square around it instead,
/// of one pixel at least, so that no splat vanishes.
const LEAST_ROUND_PX: f64 = std::f64::consts::SQRT_2;

/// Side of the smallest disc whose pixels have the depth of its plane: in smaller ones nobody sees where planes meet, and what is
/// nearest would change with every move of the camera.
const LEAST_LEANING_PX: f64 = 3.0;

/// Height of the dome that an opaque splat is, along its normal and over its radius: its rim lies so much behind its plane, what is
/// between them by the square of the distance from the center.
const DOME_HEIGHT: f64 = 0.25;

/// A patch of surface in view space, as footprints see it.
#[derive(Debug, Clone, Copy)]
pub(super) struct SurfacePatch {
    pub(super) center: Vec3,
    /// Unit, or zero where there is none.
    pub(super) normal: DVec3,
    /// Radius of the ball around it, view-space units.
    pub(super) radius: f64,
    /// Half its thickness along the normal, in radii: 0..=1.
    pub(super) thickness: f64,
}

/// The pixels that a round splat covers.
#[derive(Debug, Clone)]
pub(super) struct DiscFootprint {
    shape: DiscShape,
    /// Projected center, pixels.
    center_px: DVec2,
    /// Area of the ellipse of the form at the center.
    area_px: f64,
    /// Side of the square around it.
    side_px: f64,
    /// Pixels have the depth of its plane; else that of its center.
    is_leaning: bool,
    /// Columns of the square around the center that contains the footprint.
    pub(super) columns: Range<u32>,
    /// Rows of that square.
    pub(super) rows: Range<u32>,
}

#[derive(Debug, Clone)]
enum DiscShape {
    /// All of the square: what is so small that it might lie between the centers of pixels.
    Square,
    /// A disc in a plane of view space.
    Plane {
        center: DVec3,
        normal: DVec3,
        radius: f64,
        /// Ray of a window position p: (p * scale + offset, -1), or that point for parallel rays.
        ray: [DVec2; 2],
        is_perspective: bool,
    },
    /// A form in pixels: rho² = offset . form (xx, xy, yy) offset / (1 + skew . offset)².
    Form { form: DVec3, skew: DVec2 },
}

/// Sample of a round splat in a pixel.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct DiscSample {
    /// Square of the distance from the center in the plane of the disc, in radii.
    pub(super) rho_squared: f64,
    /// Distance along the view direction of the dome over a disc that lies in a plane of its own.
    pub(super) distance: Option<f32>,
}

/// A footprint whose pixels are not looked for yet.
struct UnboundedDisc {
    center: DVec3,
    shape: DiscShape,
    /// Numbers of `shape` that give its bounds.
    form: DVec3,
    skew: DVec2,
}

impl UnboundedDisc {
    fn of_form(center: DVec3, form: DVec3, skew: DVec2, low_pass_px: f64) -> Self {
        let form = if low_pass_px > 0.0 {
            let widened = 4.0 * low_pass_px * low_pass_px;
            inverse(inverse(form) + DVec3::new(widened, 0.0, widened))
        } else {
            form
        };
        Self {
            center,
            shape: DiscShape::Form { form, skew },
            form,
            skew,
        }
    }

    /// With `is_pixel_at_least` what is small becomes a square.
    fn bounded(self, frame: &ReferenceFrame, is_pixel_at_least: bool) -> Option<DiscFootprint> {
        let Self {
            center,
            shape,
            form,
            skew,
        } = self;
        let center_px = window(frame, center);
        let size = 2.0 * extent(form, skew).max_element();
        let is_leaning = size >= LEAST_LEANING_PX;
        if !center_px.is_finite() {
            return None;
        }
        // A radius of 0 has no form at all; `max` takes the number where the other is none.
        let (shape, size) = if size >= LEAST_ROUND_PX || !is_pixel_at_least {
            (shape, (size + 1.0 / 64.0).max(1.0))
        } else {
            (DiscShape::Square, size.max(1.0))
        };
        // Far beyond any picture, yet sums of two stay far inside an i64.
        const LIMIT_PX: f64 = (1u64 << 40) as f64;
        if center_px.abs().max_element() >= LIMIT_PX {
            return None;
        }
        let grid = frame.grid;
        let side = grid.snap(size.min(LIMIT_PX));
        let [left, top] = [center_px.x, center_px.y].map(|c| grid.snap(c) - side / 2);
        let columns = grid.pixels_between(left, left + side, frame.view.width);
        let rows = grid.pixels_between(top, top + side, frame.view.height);
        (!columns.is_empty() && !rows.is_empty()).then_some(DiscFootprint {
            shape,
            center_px,
            area_px: std::f64::consts::PI / (form.x * form.z - form.y * form.y).sqrt(),
            side_px: size,
            is_leaning,
            columns,
            rows,
        })
    }
}

/// Half the thickness of a patch over its radius, from the alpha of its color: 255 is flat, 1 as thick as wide.
pub(super) fn thickness_of([.., alpha]: [u8; 4]) -> f64 {
    f64::from(255 - alpha) / 254.0
}

impl DiscFootprint {
    /// The footprint of a patch; `None` when it covers no pixel of the picture. Where its plane
    /// reaches the near plane it is a circle of the radius that a facing disc would have in the middle of the picture.
    ///
    /// `low_pass_px` widens it by a Gaussian of that standard deviation, where rho = 1 stands for two of them.
    pub(super) fn new(
        frame: &ReferenceFrame,
        patch: &SurfacePatch,
        low_pass_px: f64,
    ) -> Option<Self> {
        Self::unbounded(frame, patch, low_pass_px)?.bounded(frame, true)
    }

    /// The footprint as it is: it may lie between the centers of pixels.
    pub(super) fn exact(frame: &ReferenceFrame, patch: &SurfacePatch) -> Option<Self> {
        Self::unbounded(frame, patch, 0.0)?.bounded(frame, false)
    }

    fn unbounded(
        frame: &ReferenceFrame,
        patch: &SurfacePatch,
        low_pass_px: f64,
    ) -> Option<UnboundedDisc> {
        let view = frame.view;
        let center = patch.center.as_dvec3();
        let distance = if view.is_perspective { -center.z } else { 1.0 };
        let near = f64::from(view.near);
        let normal = footprint_normal(patch, view.is_perspective);
        if view.is_perspective && distance - patch.radius * normal.truncate().length() <= near {
            let radius_px = patch.radius * f64::from(view.focal_px()) / distance.max(near);
            let form = DVec3::new(1.0, 0.0, 1.0) / (radius_px * radius_px);
            return Some(UnboundedDisc::of_form(
                center,
                form,
                DVec2::ZERO,
                low_pass_px,
            ));
        }
        let ray = rays(frame);
        let plane = DiscShape::Plane {
            center,
            normal,
            radius: patch.radius,
            ray,
            is_perspective: view.is_perspective,
        };
        let (form, skew) = form_of_plane(center, normal, patch.radius, ray, view.is_perspective);
        if low_pass_px > 0.0 {
            return Some(UnboundedDisc::of_form(center, form, skew, low_pass_px));
        }
        Some(UnboundedDisc {
            center,
            shape: plane,
            form,
            skew,
        })
    }

    /// A circle of `radius_px` on the picture, around a view-space center.
    pub(super) fn circle(frame: &ReferenceFrame, center: Vec3, radius_px: f64) -> Option<Self> {
        let form = DVec3::new(1.0, 0.0, 1.0) / (radius_px * radius_px);
        UnboundedDisc::of_form(center.as_dvec3(), form, DVec2::ZERO, 0.0).bounded(frame, true)
    }

    /// Sample of pixel (x, y); `None` outside.
    pub(super) fn sample(&self, x: u32, y: u32) -> Option<DiscSample> {
        Some(self.met(x, y)).filter(|sample| sample.rho_squared <= 1.0)
    }

    /// Point where the ray of pixel (x, y) meets the plane, inside or outside; infinitely far where that is behind the eye.
    pub(super) fn met(&self, x: u32, y: u32) -> DiscSample {
        let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let mut distance = None;
        let rho_squared = match &self.shape {
            DiscShape::Square => 0.0,
            DiscShape::Form { form, skew } => {
                let offset = at - self.center_px;
                let w = 1.0 + skew.dot(offset);
                if w > 0.0 {
                    let squared = form.x * offset.x * offset.x
                        + 2.0 * form.y * offset.x * offset.y
                        + form.z * offset.y * offset.y;
                    squared / (w * w)
                } else {
                    f64::INFINITY
                }
            }
            DiscShape::Plane {
                center,
                normal,
                radius,
                ray: [scale, offset],
                is_perspective,
            } => {
                let through = at * *scale + *offset;
                let from_center = if *is_perspective {
                    let d = through.extend(-1.0);
                    let t = normal.dot(*center) / normal.dot(d);
                    if t > 0.0 {
                        t * d - *center
                    } else {
                        return DiscSample {
                            rho_squared: f64::INFINITY,
                            distance: None,
                        };
                    }
                } else {
                    let across = through - center.truncate();
                    across.extend(-normal.truncate().dot(across) / normal.z)
                };
                let rho_squared = from_center.length_squared() / (radius * radius);
                let of_plane = -center.z - from_center.z;
                // Along the ray of the center it is higher, at most a radius.
                let facing = normal.dot(if *is_perspective {
                    -center.normalize()
                } else {
                    DVec3::Z
                });
                let height = radius * (DOME_HEIGHT / facing).min(1.0);
                // In perspective it is 1 / distance that sinks, to half of the least of the plane at most, lest it ends behind everything.
                let nearest = -center.z - radius * normal.truncate().length();
                let of_dome = match *is_perspective {
                    true => of_plane / (1.0 - height.min(0.5 * nearest) * rho_squared / of_plane),
                    false => of_plane + height * rho_squared,
                };
                distance = self.is_leaning.then_some(of_dome as f32);
                rho_squared
            }
        };
        DiscSample {
            rho_squared,
            distance,
        }
    }

    /// Integral of exp(-2 rho²) over the footprint, pixels, but for the perspective across it: the ellipse's area
    /// times (1 - exp(-2)) / 2. Of a square its area.
    pub(super) fn gaussian_px(&self) -> f64 {
        let ellipse = self.area_px * (1.0 - (-2.0f64).exp()) / 2.0;
        if matches!(self.shape, DiscShape::Square) {
            self.side_px * self.side_px
        } else {
            ellipse
        }
    }
}

/// The normal of the disc, turned to the eye; see the top of this file.
fn footprint_normal(patch: &SurfacePatch, is_perspective: bool) -> DVec3 {
    let v = if is_perspective {
        (-patch.center.as_dvec3()).normalize_or(DVec3::Z)
    } else {
        DVec3::Z
    };
    let facing = patch.normal.dot(v);
    let across = patch.normal - facing * v;
    let sine = across.length();
    if sine < 1e-6 {
        return v;
    }
    let ratio = (facing.abs() + patch.thickness * sine).clamp(LEAST_RATIO, 1.0);
    let side = if facing < 0.0 { -across } else { across };
    ratio * v + (1.0 - ratio * ratio).sqrt() * (side / sine)
}

/// A view-space point that pixel (x, y) shows: at distance 1, or for parallel rays on the plane through the eye.
pub(super) fn through(frame: &ReferenceFrame, x: u32, y: u32) -> DVec3 {
    let [scale, offset] = rays(frame);
    let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
    let depth = if frame.view.is_perspective { -1.0 } else { 0.0 };
    (at * scale + offset).extend(depth)
}

/// Scale and offset of the rays, see [`DiscShape::Plane`].
fn rays(frame: &ReferenceFrame) -> [DVec2; 2] {
    let view = frame.view;
    let scale = DVec2::from(view.scale.map(f64::from));
    let shift = DVec2::from(view.offset.map(f64::from));
    // Perspective: ndc = scale x - shift at z = -1; orthographic: ndc = scale x + shift. y down in the window.
    let shift = if view.is_perspective { shift } else { -shift };
    let size = DVec2::new(f64::from(view.width), f64::from(view.height));
    [
        DVec2::new(2.0, -2.0) / (size * scale),
        (shift + DVec2::new(-1.0, 1.0)) / scale,
    ]
}

/// Pixel position of a view-space point in front of the eye.
fn window(frame: &ReferenceFrame, center: DVec3) -> DVec2 {
    let [scale, offset] = rays(frame);
    let at = if frame.view.is_perspective {
        center.truncate() / -center.z
    } else {
        center.truncate()
    };
    (at - offset) / scale
}

/// The footprint of a disc as a form (xx, xy, yy) and a skew in pixels.
fn form_of_plane(
    center: DVec3,
    normal: DVec3,
    radius: f64,
    [scale, _]: [DVec2; 2],
    is_perspective: bool,
) -> (DVec3, DVec2) {
    let (x, y, skew, distance) = if is_perspective {
        let distance = -center.z;
        let along = center / distance;
        let slope = normal.truncate() / normal.dot(along);
        (
            DVec3::X - along * slope.x,
            DVec3::Y - along * slope.y,
            slope * scale,
            distance,
        )
    } else {
        (
            DVec3::new(1.0, 0.0, -normal.x / normal.z),
            DVec3::new(0.0, 1.0, -normal.y / normal.z),
            DVec2::ZERO,
            1.0,
        )
    };
    let (x, y) = (
        x * (scale.x * distance / radius),
        y * (scale.y * distance / radius),
    );
    (DVec3::new(x.dot(x), x.dot(y), y.dot(y)), skew)
}

fn inverse(form: DVec3) -> DVec3 {
    DVec3::new(form.z, -form.y, form.x) / (form.x * form.z - form.y * form.y)
}

/// How far rho = 1 reaches from the projected center along x and y, pixels.
///
/// With P = form - skew skewᵀ the outline is x P x - 2 skew . x = 1: an ellipse around P⁻¹ skew of half extents
/// sqrt((1 + skew P⁻¹ skew) P⁻¹_xx); P⁻¹ by Sherman and Morrison.
fn extent(form: DVec3, skew: DVec2) -> DVec2 {
    let inverse = inverse(form);
    let shift = DVec2::new(
        inverse.x * skew.x + inverse.y * skew.y,
        inverse.y * skew.x + inverse.z * skew.y,
    );
    let rest = 1.0 - skew.dot(shift);
    let half =
        |shift: f64, inverse: f64| (shift.abs() + (inverse * rest + shift * shift).sqrt()) / rest;
    DVec2::new(half(shift.x, inverse.x), half(shift.y, inverse.z))
}

#[cfg(test)]
mod tests;
