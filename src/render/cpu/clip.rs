//! Triangles clipped to what whole steps of a picture can hold: between the near and the far plane, and not too far beside the
//! picture. Sutherland and Hodgman, *Reentrant Polygon Clipping* (Communications of the ACM, 1974), in double precision.

use glam::{DVec4, Vec3, Vec4};

/// Clipped corners lie at most this far from the middle of the viewport, pixels: less than the reach of whole steps, so that
/// rounding does not lead beyond it.
const REACH_PX: f64 = 16_000.0;

/// A corner of what is left of a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct ClippedCorner {
    /// Position in the clip space of the viewport.
    pub(super) clip: Vec4,
    /// Weights of the triangle's corners there, in clip space, so that attributes are sums with them.
    pub(super) weights: Vec3,
}

/// The planes: a point is kept where the product with one is not negative.
fn planes([width, height]: [f32; 2]) -> [DVec4; 6] {
    let beside = |size: f32| 2.0 * REACH_PX / f64::from(size);
    let (x, y) = (beside(width), beside(height));
    [
        // Reversed depth: 1 at the near and 0 at the far plane.
        DVec4::new(0.0, 0.0, -1.0, 1.0),
        DVec4::new(0.0, 0.0, 1.0, 0.0),
        DVec4::new(1.0, 0.0, 0.0, x),
        DVec4::new(-1.0, 0.0, 0.0, x),
        DVec4::new(0.0, 1.0, 0.0, y),
        DVec4::new(0.0, -1.0, 0.0, y),
    ]
}

/// What is left of a triangle whose corners have these positions in the clip space of a viewport of this width and height,
/// pixels, at most 32,000: a convex polygon in its order, or nothing. A corner that is no number leaves nothing.
pub(super) fn clipped(corners: [Vec4; 3], viewport_px: [f32; 2]) -> Vec<ClippedCorner> {
    if corners.iter().any(|corner| !corner.is_finite()) {
        return Vec::new();
    }
    let whole = [Vec3::X, Vec3::Y, Vec3::Z];
    let mut polygon: Vec<(DVec4, Vec3)> = (corners.iter().zip(whole))
        .map(|(corner, weights)| (corner.as_dvec4(), weights))
        .collect();
    for plane in planes(viewport_px) {
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (index, &(to, to_weights)) in polygon.iter().enumerate() {
            let (from, from_weights) = polygon[(index + polygon.len() - 1) % polygon.len()];
            let (before, after) = (plane.dot(from), plane.dot(to));
            if (before < 0.0) != (after < 0.0) {
                // Always from the side that is kept, so that triangles on both sides of an edge get the same corner.
                let (inside, outside, own) = match before < 0.0 {
                    true => ((to, to_weights), (from, from_weights), after),
                    false => ((from, from_weights), (to, to_weights), before),
                };
                let at = own / (own - plane.dot(outside.0));
                kept.push((
                    inside.0.lerp(outside.0, at),
                    inside.1.lerp(outside.1, at as f32),
                ));
            }
            if after >= 0.0 {
                kept.push((to, to_weights));
            }
        }
        polygon = kept;
        if polygon.len() < 3 {
            return Vec::new();
        }
    }
    polygon
        .into_iter()
        .map(|(clip, weights)| ClippedCorner {
            clip: on_the_near_side(clip.as_vec4()),
            weights,
        })
        .collect()
}

/// A corner on the near plane may round beyond it.
fn on_the_near_side(clip: Vec4) -> Vec4 {
    let z = clip.z.clamp(0.0, clip.w.max(0.0));
    Vec4::new(clip.x, clip.y, z, clip.w)
}

#[cfg(test)]
mod tests {
    use super::*;

    const VIEWPORT: [f32; 2] = [500.0, 400.0];

    #[test]
    fn what_is_inside_stays_as_it_is() {
        let corners = [
            Vec4::new(0.1, 0.2, 0.5, 1.0),
            Vec4::new(-0.4, 0.1, 0.2, 2.0),
            Vec4::new(0.3, -0.2, 0.9, 1.5),
        ];
        let found = clipped(corners, VIEWPORT);
        let own: Vec<Vec4> = found.iter().map(|corner| corner.clip).collect();
        assert_eq!(own, corners);
        let weights: Vec<Vec3> = found.iter().map(|corner| corner.weights).collect();
        assert_eq!(weights, [Vec3::X, Vec3::Y, Vec3::Z]);
    }

    #[test]
    fn a_corner_before_the_near_plane_is_cut_off_where_the_plane_is() {
        // z - w is 1, -1 and -1: the plane cuts both of the first corner's edges in their middle.
        let corners = [
            Vec4::new(0.0, 0.0, 1.5, 0.5),
            Vec4::new(1.0, 0.0, 0.5, 1.5),
            Vec4::new(0.0, 1.0, 0.5, 1.5),
        ];
        let found = clipped(corners, VIEWPORT);
        assert_eq!(found.len(), 4);
        let on_plane: Vec<&ClippedCorner> = (found.iter())
            .filter(|corner| (corner.clip.w - corner.clip.z).abs() < 1e-6)
            .collect();
        assert_eq!(on_plane.len(), 2);
        for corner in found {
            let weights = corner.weights.to_array();
            let sum: Vec4 = weights.iter().zip(corners).map(|(w, c)| *w * c).sum();
            assert!((sum - corner.clip).length() < 1e-6, "{corner:?}");
            assert!((corner.weights.element_sum() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn neighbors_get_the_same_corner_on_their_edge() {
        let [a, b] = [
            Vec4::new(0.3, 0.1, 1.7, 0.9),
            Vec4::new(-0.2, 0.7, 0.1, 3.3),
        ];
        let on_edge = |corners: [Vec4; 3], other: usize| -> Vec<Vec4> {
            let found = clipped(corners, VIEWPORT);
            let cut = found.iter().filter(|corner| {
                corner.weights[other] == 0.0 && corner.weights.max_element() < 1.0
            });
            cut.map(|corner| corner.clip).collect()
        };
        let left = on_edge([a, b, Vec4::new(1.0, 1.0, 0.5, 1.0)], 2);
        let right = on_edge([Vec4::new(-1.0, -1.0, 0.5, 1.0), b, a], 0);
        assert_eq!(left.len(), 1);
        assert_eq!(left, right);
    }

    #[test]
    fn what_is_behind_the_eye_or_no_number_leaves_nothing() {
        let behind = Vec4::new(0.0, 0.0, 0.5, -1.0);
        assert!(clipped([behind; 3], VIEWPORT).is_empty());
        let mut corners = [Vec4::new(0.1, 0.2, 0.5, 1.0); 3];
        corners[1].x = f32::NAN;
        assert!(clipped(corners, VIEWPORT).is_empty());
    }

    #[test]
    fn what_reaches_far_beside_the_picture_ends_within_reach() {
        let corners = [
            Vec4::new(-1e9, -3.0, 0.5, 1.0),
            Vec4::new(1e9, -2.0, 0.5, 1.0),
            Vec4::new(0.0, 1e12, 0.5, 1.0),
        ];
        let found = clipped(corners, VIEWPORT);
        assert!(found.len() >= 3);
        for corner in found {
            let px = 0.5 * VIEWPORT[0] * corner.clip.x / corner.clip.w;
            assert!(f64::from(px.abs()) < REACH_PX + 1.0, "{px}");
        }
    }
}
