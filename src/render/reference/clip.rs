//! Clipping of triangles in clip space (Sutherland and Hodgman, "Reentrant Polygon Clipping", 1974).
//!
//! Near and far planes clip as in Vulkan. The sides of the picture do not: pixels outside are simply never
//! visited. Only a guard band far outside bounds the integers of the rasterizer.

use crate::render::reference::frame::ReferenceFrame;
use glam::{DVec2, DVec3, DVec4};

/// A corner of a clipped triangle.
#[derive(Clone, Copy)]
pub(super) struct ClipCorner {
    /// Clip space.
    pub(super) clip: DVec4,
    /// Distance along the view direction.
    pub(super) distance: f64,
    /// Model space.
    pub(super) position: DVec3,
    /// Sum of unit normals of the vertices by their weights; zero when none has one.
    pub(super) normal: DVec3,
    /// Value / 255.
    pub(super) color: DVec3,
    /// Texture coordinate.
    pub(super) place: DVec2,
}

impl ClipCorner {
    /// The point at `t` from `self` to `other`; clip space is linear in the surface, so everything is.
    fn towards(&self, other: &Self, t: f64) -> Self {
        Self {
            clip: self.clip.lerp(other.clip, t),
            distance: self.distance + (other.distance - self.distance) * t,
            position: self.position.lerp(other.position, t),
            normal: self.normal.lerp(other.normal, t),
            color: self.color.lerp(other.color, t),
            place: self.place.lerp(other.place, t),
        }
    }
}

/// Window coordinates past this many pixels from the middle of the picture are clipped: 64 times the largest
/// picture, and small enough that the edge functions of the rasterizer stay below 2^62.
const GUARD_BAND_PX: f64 = (1u64 << 20) as f64;

/// Clips a triangle to a convex polygon, at most one more corner for each of the six planes; `None` when
/// nothing is left. Every corner has w > 0 and a window position inside the guard band.
pub(super) fn clip(frame: &ReferenceFrame, corners: [ClipCorner; 3]) -> Option<Vec<ClipCorner>> {
    let limit_x = 2.0 * GUARD_BAND_PX / f64::from(frame.view.width);
    let limit_y = 2.0 * GUARD_BAND_PX / f64::from(frame.view.height);
    let (near, far) = (f64::from(frame.view.near), f64::from(frame.view.far));
    // Each is linear in the surface and not negative inside. Near comes first: it makes w positive.
    let planes: [&dyn Fn(&ClipCorner) -> f64; 6] = [
        &|c| c.distance - near,
        &|c| far - c.distance,
        &|c| limit_x * c.clip.w - c.clip.x,
        &|c| limit_x * c.clip.w + c.clip.x,
        &|c| limit_y * c.clip.w - c.clip.y,
        &|c| limit_y * c.clip.w + c.clip.y,
    ];
    let mut polygon = corners.to_vec();
    for inside in planes {
        if polygon.iter().all(|c| inside(c) >= 0.0) {
            continue;
        }
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (i, a) in polygon.iter().enumerate() {
            let b = &polygon[(i + 1) % polygon.len()];
            let (da, db) = (inside(a), inside(b));
            if da >= 0.0 {
                kept.push(*a);
            }
            // Always from the inside to the outside, so that the neighbor across this edge, which runs the
            // other way, finds the same point to the last bit.
            if da >= 0.0 && db < 0.0 {
                kept.push(a.towards(b, da / (da - db)));
            } else if da < 0.0 && db >= 0.0 {
                kept.push(b.towards(a, db / (db - da)));
            }
        }
        polygon = kept;
        if polygon.len() < 3 {
            return None;
        }
    }
    // A perspective has 0 < near, so this can fail for a view made by hand only.
    polygon.iter().all(|c| c.clip.w > 0.0).then_some(polygon)
}
