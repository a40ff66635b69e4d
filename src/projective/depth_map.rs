//! Depth of a model as a photograph sees it, and how near each texel is to an edge of the depth.
//!
//! Princ, section 2.3.2, has no test of occlusion; methods: shadow maps of the chosen photographs alone, with a bias by slope,
//! percentage-closer filtering of 2 x 2, and weights that fade near edges (Floating Textures), where mesh and photograph seldom
//! agree to the pixel.

use glam::Vec2;

/// Test of visibility from a photograph.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PhotoVisibility {
    /// Not at all, as Princ.
    Off,
    /// By depth.
    Depth,
    /// By depth, fading near its edges.
    #[default]
    DepthSoft,
}

/// Relative step of depth between neighbors that is an edge.
const EDGE_STEP: f32 = 0.01;

/// Distance from an edge at which nothing fades any more, texels.
pub const EDGE_TEXELS: f32 = 4.0;

/// Part of the depth that a surface may lie behind the map.
pub(crate) const RELATIVE_BIAS: f32 = 0.002;

/// Part of a weight that is left at an edge: where no other photograph sees a place, it still is the best.
pub(crate) const LEAST_AT_EDGE: f32 = 0.02;

/// Depth of a model as a photograph's pinhole camera sees it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PhotoDepth {
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// Focal lengths of the map, texels.
    pub focal: Vec2,
    /// Principal point of the map, texels.
    pub principal: Vec2,
    /// Distance along the axis at each texel's center; infinite where nothing is.
    pub depth: Vec<f32>,
    /// Distance of each texel from the next edge of the depth, texels, at most [`EDGE_TEXELS`].
    pub edge: Vec<f32>,
}

/// A point as a depth map is asked for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthQuery {
    /// The point in camera space over its depth: the undistorted ray.
    pub ray: Vec2,
    /// Distance along the axis.
    pub depth: f32,
    /// Tangent of the angle between the surface's normal and the ray.
    pub slope: f32,
}

impl PhotoDepth {
    /// A map of depths, row by row, with the distances from edges.
    pub fn new(size: [u32; 2], focal: Vec2, principal: Vec2, depth: Vec<f32>) -> Self {
        let [width, height] = size;
        let mut map = Self {
            width,
            height,
            focal,
            principal,
            edge: vec![EDGE_TEXELS; depth.len()],
            depth,
        };
        map.find_edges();
        map
    }

    fn find_edges(&mut self) {
        let (w, h) = (self.width as usize, self.height as usize);
        let is_step = |a: f32, b: f32| {
            let near = a.min(b);
            // Both without a surface is no edge; one without is.
            near.is_finite() && (a - b).abs() > EDGE_STEP * near
        };
        for y in 0..h {
            for x in 0..w {
                let at = y * w + x;
                let right = (x + 1 < w).then_some(at + 1);
                let below = (y + 1 < h).then_some(at + w);
                for other in [right, below].into_iter().flatten() {
                    if is_step(self.depth[at], self.depth[other]) {
                        self.edge[at] = 0.0;
                        self.edge[other] = 0.0;
                    }
                }
            }
        }
        // Chamfer distances: forward with the neighbors above, backward with those below.
        let (straight, diagonal) = (1.0, std::f32::consts::SQRT_2);
        let steps = [
            (-1_i64, 0_i64, straight),
            (-1, -1, diagonal),
            (0, -1, straight),
            (1, -1, diagonal),
        ];
        for backward in [false, true] {
            let sign = if backward { -1 } else { 1 };
            for k in 0..w * h {
                let at = if backward { w * h - 1 - k } else { k };
                let (x, y) = ((at % w) as i64, (at / w) as i64);
                for (dx, dy, length) in steps {
                    let (i, j) = (x + sign * dx, y + sign * dy);
                    if i >= 0 && j >= 0 && i < w as i64 && j < h as i64 {
                        let through = self.edge[j as usize * w + i as usize] + length;
                        self.edge[at] = self.edge[at].min(through);
                    }
                }
            }
        }
    }

    fn texel(&self, x: i64, y: i64) -> usize {
        let x = x.clamp(0, i64::from(self.width) - 1) as usize;
        let y = y.clamp(0, i64::from(self.height) - 1) as usize;
        y * self.width as usize + x
    }

    /// Part of a point that the photograph sees, 0 to 1. Errs towards seen by up to two texels' slope and 0.2 % of the depth.
    /// 1 without a map.
    pub fn visibility(&self, query: DepthQuery, mode: PhotoVisibility) -> f32 {
        if mode == PhotoVisibility::Off || self.depth.is_empty() {
            return 1.0;
        }
        let at = query.ray * self.focal + self.principal;
        if !at.is_finite() {
            return 0.0;
        }
        let texel_size = query.depth / self.focal.min_element().max(1e-6);
        let slope = query.slope.clamp(0.0, 10.0);
        // In front of the map by less than this, a surface still counts as the one in it.
        let nearest = query.depth - (RELATIVE_BIAS * query.depth + 2.0 * texel_size * slope);
        let corner = at - Vec2::splat(0.5);
        let (left, top) = (corner.x.floor(), corner.y.floor());
        let part = corner - Vec2::new(left, top);
        let (i, j) = (left as i64, top as i64);
        let (mut seen, mut edge) = (0.0, 0.0);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let x = if dx == 1 { part.x } else { 1.0 - part.x };
            let y = if dy == 1 { part.y } else { 1.0 - part.y };
            let texel = self.texel(i + dx, j + dy);
            if self.depth[texel] >= nearest {
                seen += x * y;
            }
            edge += x * y * self.edge[texel];
        }
        match mode {
            PhotoVisibility::Off | PhotoVisibility::Depth => seen,
            PhotoVisibility::DepthSoft => {
                let t = (edge / EDGE_TEXELS).clamp(0.0, 1.0);
                seen * (LEAST_AT_EDGE + (1.0 - LEAST_AT_EDGE) * t * t * (3.0 - 2.0 * t))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall at 10, and a box at 5 before its left half.
    fn map() -> PhotoDepth {
        let depth = (0..32 * 32)
            .map(|i| if i % 32 < 16 { 5.0 } else { 10.0 })
            .collect();
        PhotoDepth::new([32, 32], Vec2::splat(32.0), Vec2::splat(16.0), depth)
    }

    fn at(x: f32, depth: f32, mode: PhotoVisibility) -> f32 {
        let query = DepthQuery {
            ray: Vec2::new((x - 16.0) / 32.0, 0.0),
            depth,
            slope: 0.0,
        };
        map().visibility(query, mode)
    }

    #[test]
    fn what_lies_behind_is_not_seen() {
        for mode in [PhotoVisibility::Depth, PhotoVisibility::DepthSoft] {
            assert_eq!(at(8.0, 10.0, mode), 0.0);
            assert_eq!(at(8.0, 5.0, mode), 1.0);
            assert_eq!(at(24.0, 10.0, mode), 1.0);
            // Nothing hides what is nearer than the map.
            assert_eq!(at(24.0, 9.0, mode), 1.0);
        }
        assert_eq!(at(8.0, 10.0, PhotoVisibility::Off), 1.0);
        // A thousandth is within the bias, a hundredth is not.
        assert_eq!(at(24.0, 10.01, PhotoVisibility::Depth), 1.0);
        assert_eq!(at(24.0, 10.1, PhotoVisibility::Depth), 0.0);
    }

    #[test]
    fn weights_fade_near_edges_on_both_sides() {
        let soft = |x: f32, depth: f32| at(x, depth, PhotoVisibility::DepthSoft);
        assert!(soft(17.0, 10.0) > 0.0 && soft(17.0, 10.0) < 0.2);
        assert!(soft(14.5, 5.0) < soft(12.5, 5.0));
        assert_eq!(soft(11.0, 5.0), 1.0);
        // Half of the four texels lie on the other side.
        assert_eq!(at(16.0, 10.0, PhotoVisibility::Depth), 0.5);
    }

    #[test]
    fn distances_from_edges_are_those_of_texels() {
        let map = map();
        let row: Vec<f32> = map.edge[10 * 32 + 10..10 * 32 + 22].to_vec();
        assert_eq!(
            row,
            [4.0, 4.0, 3.0, 2.0, 1.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 4.0]
        );
        let empty = PhotoDepth::new([4, 4], Vec2::ONE, Vec2::ONE, vec![f32::INFINITY; 16]);
        assert!(empty.edge.iter().all(|e| *e == EDGE_TEXELS));
    }

    #[test]
    fn a_grazing_surface_does_not_hide_itself() {
        // Depth 10 (1 + 3 x) over the ray x: a wall seen at a grazing angle, sampled at centers of texels.
        let depth_at = |x: f32| 10.0 / (1.0 - 3.0 * (x - 16.0) / 32.0);
        let depth = (0..32 * 32)
            .map(|i| depth_at((i % 32) as f32 + 0.5))
            .map(|d| if d > 0.0 { d } else { f32::INFINITY });
        let map = PhotoDepth::new(
            [32, 32],
            Vec2::splat(32.0),
            Vec2::splat(16.0),
            depth.collect(),
        );
        for step in 0..80 {
            let x = 6.0 + 0.1 * step as f32;
            let depth = depth_at(x);
            let ray = (x - 16.0) / 32.0;
            // The normal of z = 10 + 3 x z is (-3, 0, 1); the ray is (ray, 0, 1).
            let cos = (1.0 - 3.0 * ray) / (10.0_f32.sqrt() * (1.0 + ray * ray).sqrt());
            let slope = (1.0 - cos * cos).sqrt() / cos;
            let query = DepthQuery {
                ray: Vec2::new(ray, 0.0),
                depth,
                slope,
            };
            assert_eq!(map.visibility(query, PhotoVisibility::Depth), 1.0, "{x}");
        }
    }
}
