//! Oriented polygons: how they are made, where they lie on the picture, and what a pixel sees of them.
//!
//! A polygon lies in a plane of the surface. Splats that are cut at sharp edges are round polygons whose corners were cut
//! off by half planes when they were made, so that a pixel asks only for the round bound. Patches of a cut have a thickness
//! h: the surface is at most that far from the plane, on the picture at most
//!
//! m = h f sin(t) / (z cos(p)) pixels
//!
//! for the angle t of normal and view direction, the angle p off the axis, the nearest distance z and the focal length f.
//! Widened by m *in pixels* the polygon contains every pixel in which the surface is seen, edge-on too, where widening in the
//! plane would have to be without bound.

use crate::abi::OrientedPolygon;
use crate::math::camera::View;
use glam::{DVec2, DVec3, Vec3};

/// By how much of the radius a disc reaches beyond its cuts, so that rounding leaves no gap between two that meet at an edge.
pub const CUT_SLACK: f64 = 1e-4;

/// By how much the corners around a circle lie outside, so that rounding to single precision cuts nothing off.
const CIRCLE_SLACK: f64 = 1e-6;

/// Most half planes that a disc can be cut by.
pub const MOST_CUTS: usize = 4;

/// Corners after the near plane has cut one off.
const MOST_SCREEN_CORNERS: usize = OrientedPolygon::MOST_CORNERS + 1;

/// A plane with coordinates: `center + u axis + v (normal x axis)`. Model space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneFrame {
    /// Where u = v = 0.
    pub center: DVec3,
    /// Unit.
    pub normal: DVec3,
    /// Unit, perpendicular to the normal.
    pub axis: DVec3,
}

impl PlaneFrame {
    /// The plane through `center`; `None` where that is not finite or `normal` has no direction.
    pub fn new(center: DVec3, normal: DVec3) -> Option<Self> {
        let normal = normal.try_normalize()?;
        center.is_finite().then(|| Self {
            center,
            normal,
            axis: normal.any_orthonormal_vector(),
        })
    }

    /// Direction of v.
    pub fn second_axis(&self) -> DVec3 {
        self.normal.cross(self.axis)
    }

    /// The point of the plane with these coordinates.
    pub fn point(&self, uv: DVec2) -> DVec3 {
        self.center + uv.x * self.axis + uv.y * self.second_axis()
    }

    /// Coordinates of the foot of a point.
    pub fn coordinates(&self, point: DVec3) -> DVec2 {
        let from_center = point - self.center;
        DVec2::new(
            from_center.dot(self.axis),
            from_center.dot(self.second_axis()),
        )
    }
}

/// The points (u, v) with `direction . (u, v) <= limit`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfPlane {
    /// Unit.
    pub direction: DVec2,
    /// Model units.
    pub limit: f64,
}

/// What of a convex polygon lies in a half plane; empty where nothing does. Corners stay in their order.
pub fn clipped(corners: &[DVec2], half: HalfPlane) -> Vec<DVec2> {
    let beyond = |corner: DVec2| half.direction.dot(corner) - half.limit;
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (i, &to) in corners.iter().enumerate() {
        let from = corners[(i + corners.len() - 1) % corners.len()];
        let (a, b) = (beyond(from), beyond(to));
        if (a > 0.0) != (b > 0.0) {
            kept.push(from + (to - from) * (a / (a - b)));
        }
        if b <= 0.0 {
            kept.push(to);
        }
    }
    kept.dedup_by(|a, b| a == b);
    while kept.len() > 1 && kept.first() == kept.last() {
        kept.pop();
    }
    if kept.len() < 3 { Vec::new() } else { kept }
}

/// Twice the area of a polygon, positive where it is counter-clockwise.
fn double_area(corners: &[DVec2]) -> f64 {
    let last = corners.last().copied().unwrap_or_default();
    let mut from = last;
    let mut sum = 0.0;
    for &to in corners {
        sum += (from - last).perp_dot(to - last);
        from = to;
    }
    sum
}

impl OrientedPolygon {
    /// A flat polygon of the plane's normal with these corners (convex, counter-clockwise); `None` where they are fewer than 3,
    /// more than [`Self::MOST_CORNERS`], not finite or without area.
    pub fn flat(frame: &PlaneFrame, corners: &[DVec2], color: [u8; 4]) -> Option<Self> {
        let last = corners.last()?;
        if corners.len() < 3 || corners.len() > Self::MOST_CORNERS {
            return None;
        }
        let mut padded = [[last.x as f32, last.y as f32]; Self::MOST_CORNERS];
        for (to, from) in padded.iter_mut().zip(corners) {
            *to = [from.x as f32, from.y as f32];
        }
        let are_finite = padded.iter().flatten().all(|x| x.is_finite());
        if !are_finite || double_area(corners) <= 0.0 || !frame.center.as_vec3().is_finite() {
            return None;
        }
        Some(Self {
            center: frame.center.as_vec3(),
            round_radius: f32::INFINITY,
            normal: frame.normal.as_vec3(),
            thickness: 0.0,
            axis: frame.axis.as_vec3(),
            corner_count: corners.len() as u32,
            corners: padded,
            shading_normal: frame.normal.as_vec3(),
            color,
            shape_operator: [0.0; 3],
            spread: 0.0,
            color_slopes: [[0; 4]; 2],
        })
    }

    /// A disc around the center of the plane without what the cuts leave out; `None` where nothing is left, or where radius or
    /// cuts are not finite. At most [`MOST_CUTS`] are used: more would need more corners.
    pub fn disc(
        frame: &PlaneFrame,
        radius: f64,
        cuts: &[HalfPlane],
        color: [u8; 4],
    ) -> Option<Self> {
        let corners = [8, 6, 4].into_iter().find_map(|sides| {
            let mut corners = around_circle(radius, sides);
            for cut in cuts.iter().take(MOST_CUTS) {
                let limit = cut.limit + CUT_SLACK * radius;
                corners = clipped(&corners, HalfPlane { limit, ..*cut });
            }
            (corners.len() <= Self::MOST_CORNERS).then_some(corners)
        })?;
        Self::within_circle(frame, radius, &corners, color)
    }

    /// A flat polygon with these corners, of which no more is drawn than lies within a circle around the center of the plane;
    /// `None` as for [`Self::flat`].
    pub fn within_circle(
        frame: &PlaneFrame,
        radius: f64,
        corners: &[DVec2],
        color: [u8; 4],
    ) -> Option<Self> {
        Some(Self {
            round_radius: radius as f32,
            ..Self::flat(frame, corners, color)?
        })
    }

    /// Takes back all that was cut off a disc.
    pub fn make_whole(&mut self) {
        let corners = around_circle(self.round_radius.into(), Self::MOST_CORNERS);
        for (to, from) in self.corners.iter_mut().zip(corners) {
            *to = from.as_vec2().to_array();
        }
        self.corner_count = Self::MOST_CORNERS as u32;
    }

    /// Direction of v.
    pub fn second_axis(&self) -> Vec3 {
        self.normal.cross(self.axis)
    }

    /// The corners, plane coordinates.
    pub fn footprint(&self) -> &[[f32; 2]] {
        &self.corners[..(self.corner_count as usize).min(Self::MOST_CORNERS)]
    }

    /// The point of the plane with these coordinates, model space.
    pub fn point(&self, [u, v]: [f32; 2]) -> Vec3 {
        self.center + u * self.axis + v * self.second_axis()
    }

    /// A place within it for all of it: between the center and the mean of its corners.
    pub fn middle(&self) -> [f32; 2] {
        let sum: glam::Vec2 = self.corners.iter().map(|&c| glam::Vec2::from(c)).sum();
        let mean = sum / Self::MOST_CORNERS as f32;
        let most = self.round_radius / mean.length().max(1e-30);
        (mean * most.min(1.0)).to_array()
    }

    /// The normal for light at these coordinates, model space; as long as it is stored, not a unit vector.
    pub fn normal_at(&self, [u, v]: [f32; 2]) -> Vec3 {
        let [s0, s1, s2] = self.shape_operator;
        self.shading_normal + (s0 * u + s1 * v) * self.axis + (s1 * u + s2 * v) * self.second_axis()
    }

    /// Red, green and blue at these coordinates, 1 is full.
    pub fn color_at(&self, [u, v]: [f32; 2]) -> Vec3 {
        let [r, g, b, _] = self.color.map(|value| f32::from(value) / 255.0);
        let [along_u, along_v] = self.color_slopes;
        let factor = f32::from(along_u[3]).exp2() / 127.0;
        let slope = |[r, g, b, _]: [i8; 4]| Vec3::new(r.into(), g.into(), b.into()) * factor;
        (Vec3::new(r, g, b) + u * slope(along_u) + v * slope(along_v)).clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// Part of the light that the surface keeps: the length of its shading normal in the middle, 1 without one.
    pub fn light_share(&self) -> f32 {
        match self.shading_normal.length() {
            share if share > 0.0 => share,
            _ => 1.0,
        }
    }

    /// The viewer is on the normal's side of the plane, or may be on that of a face that the polygon stands for.
    pub fn faces(&self, view: &View) -> bool {
        let towards = if view.is_perspective {
            view.eye - self.center
        } else {
            view.backward
        };
        self.normal.dot(towards) > -self.spread * towards.length()
    }

    /// Tells whether the footprint contains these coordinates, the round bound included.
    pub fn contains(&self, [u, v]: [f32; 2]) -> bool {
        let corners = self.footprint();
        let is_inside = |i: usize| {
            let [from, to] =
                [i, (i + 1) % corners.len()].map(|k| DVec2::from(corners[k].map(f64::from)));
            (to - from).perp_dot(DVec2::new(u.into(), v.into()) - from) >= 0.0
        };
        u * u + v * v <= self.round_radius * self.round_radius && (0..corners.len()).all(is_inside)
    }
}

/// Corners of the regular polygon around a circle, counter-clockwise.
fn around_circle(radius: f64, sides: usize) -> Vec<DVec2> {
    let step = std::f64::consts::TAU / sides as f64;
    let outer = radius / (step / 2.0).cos() * (1.0 + CIRCLE_SLACK);
    let corner = |i: usize| outer * DVec2::from_angle((i as f64 + 0.5) * step);
    (0..sides).map(corner).collect()
}

/// A polygon where a view sees it.
#[derive(Debug, Clone, Copy)]
pub struct ScreenPolygon {
    corners: [DVec2; MOST_SCREEN_CORNERS],
    count: usize,
    /// Pixels by which it is widened.
    margin_px: f64,
    /// Least and greatest distance of the corners along the view direction.
    distances: [f64; 2],
    /// Of the surface from the plane, view-space units.
    thickness: f64,
    /// The plane in view space; axes divided by the square of the model's scale, so that products are coordinates.
    center: DVec3,
    normal: DVec3,
    axes: [DVec3; 2],
    /// Least and greatest (u, v).
    extent: [DVec2; 2],
    round_squared: f64,
    /// Distances of the near and far plane.
    clip: [f64; 2],
    /// Pixels of a tangent (perspective) or of a view-space unit.
    focal_px: f64,
    /// Ray of a window position p: (p * scale + offset, -1), or that point for parallel rays.
    ray_scale: DVec2,
    ray_offset: DVec2,
    is_perspective: bool,
}

/// What a pixel sees of a polygon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PolygonSample {
    /// Distance along the view direction, view-space units.
    pub distance: f64,
    /// Plane coordinates, model units; for [`OrientedPolygon::normal_at`].
    pub uv: [f32; 2],
}

impl ScreenPolygon {
    /// The polygon as `view` sees it; `None` where it is behind the near plane, not finite, or a line that is not widened.
    pub fn of(polygon: &OrientedPolygon, view: &View) -> Option<Self> {
        let to_view = view.view_from_model.as_dmat4();
        let near = f64::from(view.near);
        let scale = f64::from(view.model_scale);
        let footprint = polygon.footprint();
        if footprint.len() < 3 {
            return None;
        }
        let center = to_view.transform_point3(polygon.center.as_dvec3());
        let axes = [polygon.axis, polygon.second_axis()]
            .map(|axis| to_view.transform_vector3(axis.as_dvec3()));
        let normal = axes[0].cross(axes[1]).try_normalize()?;
        let uv = |i: usize| DVec2::from(footprint[i].map(f64::from));
        let place = |uv: DVec2| center + uv.x * axes[0] + uv.y * axes[1];

        // What lies beyond the near plane.
        let mut seen = [DVec3::ZERO; MOST_SCREEN_CORNERS];
        let mut count = 0;
        let mut push = |point: DVec3| {
            if let Some(slot) = seen.get_mut(count) {
                *slot = point;
                count += 1;
            }
        };
        let mut from = place(uv(footprint.len() - 1));
        for i in 0..footprint.len() {
            let to = place(uv(i));
            let (a, b) = (-from.z - near, -to.z - near);
            if (a < 0.0) != (b < 0.0) {
                push(from + (to - from) * (a / (a - b)));
            }
            if b >= 0.0 {
                push(to);
            }
            from = to;
        }
        if count < 3 {
            return None;
        }
        let seen = &seen[..count];
        let mut corners = [DVec2::ZERO; MOST_SCREEN_CORNERS];
        for (corner, &point) in corners.iter_mut().zip(seen) {
            *corner = window_of(view, point);
        }
        let distances = (seen.iter()).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], p| {
            [low.min(-p.z), high.max(-p.z)]
        });
        if !corners[..count].iter().all(|c| c.is_finite()) || !normal.is_finite() {
            return None;
        }
        let area = double_area(&corners[..count]);
        if area < 0.0 {
            corners[..count].reverse();
        }
        let thickness = f64::from(polygon.thickness) * scale;
        let margin_px = margin_px(view, seen, normal, thickness);
        if margin_px <= 0.0 && area.abs() < 1e-12 {
            return None;
        }
        let (ray_scale, ray_offset) = rays(view);
        let extent = (0..footprint.len())
            .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], i| {
                [low.min(uv(i)), high.max(uv(i))]
            });
        Some(Self {
            corners,
            count,
            margin_px,
            distances,
            thickness,
            center,
            normal,
            axes: axes.map(|axis| axis / (scale * scale)),
            extent,
            round_squared: f64::from(polygon.round_radius) * f64::from(polygon.round_radius),
            clip: [near, view.far.into()],
            focal_px: view.focal_px().into(),
            ray_scale,
            ray_offset,
            is_perspective: view.is_perspective,
        })
    }

    /// Corners on the picture, x right and y down from the top left corner, pixels, before the polygon is widened.
    pub fn corners(&self) -> &[DVec2] {
        &self.corners[..self.count]
    }

    /// Pixels by which it is widened.
    pub fn margin_px(&self) -> f64 {
        self.margin_px
    }

    /// Left top and right bottom of what it covers, widened; pixels.
    pub fn bounds(&self) -> [DVec2; 2] {
        let [low, high] = self
            .corners()
            .iter()
            .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], &c| {
                [low.min(c), high.max(c)]
            });
        [low - self.margin_px, high + self.margin_px]
    }

    /// How far a window position lies outside of the polygon before it is widened; 0 inside and on its outline. Pixels.
    pub fn outside_px(&self, at: DVec2) -> f64 {
        let corners = self.corners();
        let mut from = corners[corners.len() - 1];
        let mut is_inside = true;
        let mut least = f64::INFINITY;
        for &to in corners {
            let edge = to - from;
            is_inside &= edge.perp_dot(at - from) >= 0.0;
            let along = edge.dot(at - from) / edge.length_squared();
            let nearest = from + edge * if along > 0.0 { along.min(1.0) } else { 0.0 };
            least = least.min(at.distance_squared(nearest));
            from = to;
        }
        if is_inside { 0.0 } else { least.sqrt() }
    }

    /// What is seen at a window position; `None` outside. In the widened part, and edge-on, coordinates are those of the
    /// nearest that the polygon has. There it is pushed back by the thickness and the distance from the footprint, so that a
    /// neighbor's own area wins, but not out of the view: it may be all that covers the pixel.
    pub fn sample(&self, at: DVec2) -> Option<PolygonSample> {
        let outside_px = self.outside_px(at);
        if outside_px > self.margin_px {
            return None;
        }
        self.pushed_back(at, outside_px)
    }

    /// Sample at a window position so far outside of the footprint.
    fn pushed_back(&self, at: DVec2, outside_px: f64) -> Option<PolygonSample> {
        let mut sample = self.sample_inside(at)?;
        if self.margin_px > 0.0 {
            if outside_px > 0.0 {
                let depth = if self.is_perspective {
                    sample.distance
                } else {
                    1.0
                };
                sample.distance += self.thickness + outside_px * depth / self.focal_px;
            }
            let [near, far] = self.clip;
            sample.distance = sample.distance.clamp(near, far);
        }
        Some(sample)
    }

    /// Sample at a window position if only sides that face along a direction bound the polygon, by at least this cosine,
    /// and only a part of the margin widens it: it goes on without end the other way. Depths are those of
    /// [`ScreenPolygon::sample`].
    pub(crate) fn sample_with_outer_sides(
        &self,
        at: DVec2,
        (outward, cosine): (DVec2, f64),
        margin: f64,
    ) -> Option<PolygonSample> {
        let corners = self.corners();
        let mut from = corners[corners.len() - 1];
        let mut outside_px = f64::NEG_INFINITY;
        for &to in corners {
            let edge = (to - from).normalize_or_zero();
            // Inside is left of an edge.
            if edge.perp().dot(outward) < -cosine {
                outside_px = outside_px.max(-edge.perp_dot(at - from));
            }
            from = to;
        }
        if outside_px > margin * self.margin_px {
            return None;
        }
        self.pushed_back(at, outside_px.max(0.0))
    }

    /// Left and right end, pixels, of what [`ScreenPolygon::sample`] may cover in a row of window y; empty where left is right
    /// of right. Exact but where the polygon is widened.
    pub fn span(&self, y: f64) -> [f64; 2] {
        let [low, high] = self.bounds();
        if self.margin_px > 0.0 {
            return [low.x, high.x];
        }
        let corners = self.corners();
        let mut from = corners[corners.len() - 1];
        let mut span = [low.x, high.x];
        for &to in corners {
            let edge = to - from;
            // Inside is where edge x (at - from) is not negative.
            let across = from.x + edge.x * (y - from.y) / edge.y;
            if edge.y > 0.0 {
                span[1] = span[1].min(across);
            } else if edge.y < 0.0 {
                span[0] = span[0].max(across);
            } else if edge.x * (y - from.y) < 0.0 {
                return [f64::INFINITY, f64::NEG_INFINITY];
            }
            from = to;
        }
        span
    }

    /// What is seen at a window position that the widened polygon covers; `None` outside of the round bound.
    pub fn sample_inside(&self, at: DVec2) -> Option<PolygonSample> {
        let through = at * self.ray_scale + self.ray_offset;
        let [low, high] = self.distances;
        let distance = if self.is_perspective {
            // The ray is t (through, -1), and t the distance.
            self.normal.dot(self.center) / self.normal.dot(through.extend(-1.0))
        } else {
            let across = through - self.center.truncate();
            self.normal.truncate().dot(across) / self.normal.z - self.center.z
        };
        // Rays along the plane meet it nowhere, or behind the eye.
        let distance = if distance.is_finite() && (distance > 0.0 || !self.is_perspective) {
            distance.clamp(low - self.thickness, high + self.thickness)
        } else {
            (low + high) / 2.0
        };
        let point = if self.is_perspective {
            distance * through.extend(-1.0)
        } else {
            through.extend(-distance)
        };
        let from_center = point - self.center;
        let uv = DVec2::new(from_center.dot(self.axes[0]), from_center.dot(self.axes[1]))
            .clamp(self.extent[0], self.extent[1]);
        if uv.length_squared() > self.round_squared {
            return None;
        }
        Some(PolygonSample {
            distance,
            uv: [uv.x as f32, uv.y as f32],
        })
    }
}

/// Scale and offset of [`ScreenPolygon`]'s rays.
fn rays(view: &View) -> (DVec2, DVec2) {
    let scale = DVec2::from(view.scale.map(f64::from));
    let offset = DVec2::from(view.offset.map(f64::from));
    let size = DVec2::new(view.width.into(), view.height.into());
    // Clip x is 2 px / width - 1, y the other way up. (scale xy + offset z) / -z = clip, at z = -1.
    let per_px = DVec2::new(2.0, -2.0) / size / scale;
    let start = DVec2::new(-1.0, 1.0);
    let shift = if view.is_perspective { offset } else { -offset };
    (per_px, (start + shift) / scale)
}

/// Window position of a view-space point.
fn window_of(view: &View, point: DVec3) -> DVec2 {
    let scale = DVec2::from(view.scale.map(f64::from));
    let offset = DVec2::from(view.offset.map(f64::from));
    let size = DVec2::new(view.width.into(), view.height.into());
    let clip = if view.is_perspective {
        (scale * point.truncate() + offset * point.z) / -point.z
    } else {
        scale * point.truncate() + offset
    };
    (clip * DVec2::new(1.0, -1.0) + 1.0) / 2.0 * size
}

/// Pixels by which a surface that is `thickness` from its plane can be seen beside its foot.
fn margin_px(view: &View, corners: &[DVec3], normal: DVec3, thickness: f64) -> f64 {
    if thickness.is_nan() || thickness <= 0.0 {
        return 0.0;
    }
    let focal = f64::from(view.focal_px());
    if !view.is_perspective {
        return thickness * focal * (1.0 - normal.z * normal.z).max(0.0).sqrt();
    }
    let nearest = corners.iter().fold(f64::INFINITY, |low, c| low.min(-c.z)) - thickness;
    let nearest = nearest.max(f64::from(view.near));
    // The greatest over a convex polygon lies at a corner, near enough: the sine of the angle to the normal does.
    let (mut sine, mut least_cosine) = (0.0_f64, 1.0_f64);
    for corner in corners {
        let direction = corner.normalize_or(DVec3::NEG_Z);
        let facing = normal.dot(direction);
        sine = sine.max((1.0 - facing * facing).max(0.0).sqrt());
        least_cosine = least_cosine.min(-direction.z);
    }
    thickness * focal * sine / (nearest * least_cosine.max(0.1))
}

#[cfg(test)]
mod tests;
