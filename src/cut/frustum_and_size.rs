//! The tests of the cut: view volume and projected size, of siblings in the lanes of vectors. What faces away is in
//! [`crate::cut::normal_cone`].
//!
//! Sources: Benda, *Point Based Rendering*, sections 3.2 and 3.3; Rusinkiewicz and Levoy, *QSplat*
//! (SIGGRAPH 2000), section 2.1; the normal cone goes back to Shirman and Abi-Ezzi, *The Cone of Normals
//! Technique* (Eurographics 1993). Deviations: sizes are compared as squares, without root or division where
//! the metric allows it; the cone test is exact for a ball instead of for its center; many nodes
//! are tested in the lanes of one vector, so that a node costs no branch that cannot be foreseen.
//!
//! Every comparison errs to the safe side by the rounding of single precision, and is written so that a
//! NaN keeps the node and descends.

use crate::cut::normal_cone::is_rough;
use crate::cut::siblings;
use crate::cut::siblings::SphereLanes;
use crate::cut::whole_sphere::WholeSphere;
use crate::cut::{CutSettings, SizeMetric};
use crate::math::camera::View;
use crate::math::frustum::{Frustum, Plane};
use crate::simd::FloatLanes;
use crate::tree::{Model, Tree};
use glam::Vec3;

/// What a node inherits from its parent, as bits.
pub(super) mod inherit {
    /// Wholly inside the view volume (or nothing is dropped by it): no test below.
    pub(in crate::cut) const INSIDE: u8 = 1;
    /// Every normal faces the viewer (or nothing is dropped by facing): no test below.
    pub(in crate::cut) const FRONT: u8 = 2;
}

/// Error of a distance to a plane, over how far the model reaches from the eye.
const PLANE_ERROR: f64 = 1e-6;

/// A plane: its inward unit normal, and what is added.
#[derive(Debug, Clone, Copy)]
struct PlaneDistances([f32; 4]);

impl PlaneDistances {
    #[inline(always)]
    fn of<V: FloatLanes>(&self, [x, y, z]: [V; 3]) -> V {
        let Self([a, b, c, offset]) = *self;
        x * a + y * b + z * c + offset
    }
}

/// The tests of one frame, prepared from a view and settings.
///
/// Lengths are measured in a unit of its own, a power of two of model units in which the model reaches about
/// 2¹⁰ from the eye: the squares and fourth powers below then neither overflow nor vanish, whatever unit the
/// model is in, and powers of two scale without rounding.
#[derive(Debug, Clone)]
pub struct NodeTester {
    /// Where lengths start: the eye, or for an orthographic view the center of the root.
    pub(super) reference: Vec3,
    /// Tester units in a model unit.
    pub(super) unit: f32,
    /// From the scene to the viewer (orthographic: everywhere the same).
    pub(super) backward: Vec3,
    pub(super) is_perspective: bool,
    sides: [PlaneDistances; 4],
    /// Least and greatest coordinates of the section, from the reference, tester units.
    section: Option<[[f32; 3]; 2]>,
    forward: PlaneDistances,
    pub(super) near: f32,
    pub(super) far: f32,
    /// Absolute error of a distance to a plane.
    pub(super) plane_error: f32,
    /// The most that the terms of a coordinate in view space add up to: how far the model reaches from its zero, and how
    /// far that is from the zero of view space.
    pub(super) extent: f32,
    pub(super) size: SizeMetric,
    /// 2 f / threshold, and its square: what a size is compared with.
    pub(super) ratio: f32,
    pub(super) ratio_squared: f32,
    /// 2 f (perspective, pixels) or 2 pixels per tester unit (orthographic).
    pub(super) twice_focal_px: f32,
    pub(super) threshold_px: f32,
    start: u8,
    /// First node of the lowest level, first one of the level above it, and how many leaves are below one of
    /// the latter on average.
    pub(super) lowest_nodes: u32,
    pub(super) low_nodes: u32,
    pub(super) low_leaves: u32,
    /// Whether normal cones drop little of what is behind others: nothing where rears are drawn too, and on rough surfaces.
    pub(super) keeps_rears: bool,
}

/// First node of the level above the lowest one, first one of the lowest, and how many leaves are below one of the former on
/// average.
pub(super) fn low_levels(tree: &Tree) -> [u32; 3] {
    // Level starts end with the number of nodes.
    let (low, lowest) = match *tree.level_starts.as_slice() {
        [.., low, lowest, _] => (low, lowest),
        _ => (0, 0),
    };
    let leaves = tree.leaves.len() as u32 / lowest.saturating_sub(low).max(1);
    [low, lowest, leaves]
}

impl NodeTester {
    /// Prepares the tests of `model` seen in `view`.
    ///
    /// The view matrix must be a similarity (rotation, translation, uniform scale), else sizes are those of
    /// the scale of its first axis. A threshold below 0 or NaN counts as 0. Side planes are moved outward by half a splat, so that
    /// culling does not cut splats off at the edge of the picture.
    pub fn new(model: &Model, view: &View, settings: &CutSettings) -> Self {
        Self::of_part(model, WholeSphere::of(model), view, settings)
    }

    /// Prepares the tests of a part of something larger that lies within a sphere: lengths of all parts have one unit.
    pub(super) fn of_part(
        model: &Model,
        whole: WholeSphere,
        view: &View,
        settings: &CutSettings,
    ) -> Self {
        let threshold_px = settings.threshold_px.max(0.0);
        let frustum = Frustum::new(view, threshold_px.clamp(1.0, 16_384.0) / 2.0 + 0.5);
        let (root_center, root_radius) = (whole.center, whole.radius);
        let reference = if view.is_perspective {
            view.eye
        } else {
            root_center
        };
        let scale = if view.model_scale > 0.0 {
            f64::from(view.model_scale)
        } else {
            1.0
        };
        let reach = (reference.distance(root_center) + root_radius)
            .max(view.near.abs() / scale as f32)
            .max(f32::MIN_POSITIVE);
        let unit = (10.0 - f64::from(reach).log2().ceil())
            .clamp(-120.0, 120.0)
            .exp2();
        let distances = |plane: &Plane, more: f64| {
            let offset = (plane.distance(reference.as_dvec3()) + more) * unit;
            PlaneDistances(plane.normal.as_vec3().extend(offset as f32).to_array())
        };
        let near = f64::from(view.near) / scale;
        let twice_focal = 2.0
            * f64::from(view.focal_px())
            * if view.is_perspective {
                1.0
            } else {
                scale / unit
            };
        let ratio = twice_focal / f64::from(threshold_px);
        let cull = |on: bool, bit: u8| if on { 0 } else { bit };
        let [low_nodes, lowest_nodes, low_leaves] = low_levels(&model.tree);
        Self {
            reference,
            unit: unit as f32,
            backward: (-frustum.near.normal).as_vec3(),
            is_perspective: view.is_perspective,
            sides: [0, 1, 2, 3].map(|i| distances(&frustum.sides[i], 0.0)),
            section: (settings.section).map(|own| {
                let from_reference = |end: Vec3| end.as_dvec3() - reference.as_dvec3();
                [own.low, own.high].map(|end| (from_reference(end) * unit).as_vec3().to_array())
            }),
            forward: distances(&frustum.near, near),
            near: (near * unit) as f32,
            far: (f64::from(view.far) / scale * unit) as f32,
            // Normals, products and sums each round by 2^-24; centers are at most 2^10 (the model's reach)
            // away. The view matrix itself was rounded the same way.
            plane_error: (f64::from(reach) * unit * PLANE_ERROR) as f32,
            extent: (root_center.length()
                + root_radius
                + view.view_from_model.w_axis.truncate().length() / scale as f32)
                * unit as f32,
            size: settings.size,
            ratio: ratio as f32,
            ratio_squared: (ratio * ratio) as f32,
            twice_focal_px: twice_focal as f32,
            threshold_px,
            low_nodes,
            lowest_nodes,
            low_leaves,
            keeps_rears: !settings.cull_back || is_rough(&model.tree),
            start: cull(
                settings.cull_frustum || settings.section.is_some(),
                inherit::INSIDE,
            ) | cull(settings.cull_back, inherit::FRONT),
        }
    }

    /// The sides of the view volume: inward unit normals, and what is added.
    pub(super) fn side_planes(&self) -> [[f32; 4]; 4] {
        self.sides.map(|plane| plane.0)
    }

    /// The view direction, and what is added.
    pub(super) fn forward_plane(&self) -> [f32; 4] {
        self.forward.0
    }

    /// What the root inherits.
    #[inline]
    pub(super) fn start(&self) -> u8 {
        self.start
    }

    /// Spheres (columns of centers and radii, model units) become balls.
    #[inline(always)]
    pub(super) fn balls<V: FloatLanes>(&self, [x, y, z, radius]: [V; 4]) -> SphereLanes<V> {
        let center = [
            (x - self.reference.x) * self.unit,
            (y - self.reference.y) * self.unit,
            (z - self.reference.z) * self.unit,
        ];
        SphereLanes {
            center,
            radius: radius * self.unit,
            depth: self.forward.of(center),
        }
    }

    /// How far ways go along the view direction.
    #[inline(always)]
    pub(super) fn way_forward<V: FloatLanes>(&self, [x, y, z]: [V; 3]) -> V {
        let PlaneDistances([a, b, c, _]) = self.forward;
        x * a + y * b + z * c
    }

    /// One ball in all lanes.
    #[inline]
    pub(super) fn ball(&self, center: Vec3, radius: f32) -> SphereLanes {
        self.balls(siblings::columns([center.extend(radius); 4]))
    }

    /// Which balls lie outside of the view volume or the section, and which wholly inside of both.
    ///
    /// Both err to "no" by the rounding, so a ball is never inside whose sub-ball is found outside.
    #[inline(always)]
    pub(super) fn volume<V: FloatLanes>(&self, balls: &SphereLanes<V>) -> (u32, u32) {
        let r = balls.radius;
        let nearest = self.nearest_plane(balls);
        // The smallest of six distances tells both: outside if it is below -r, inside if at least r.
        (
            V::bits(nearest.lt(-r - self.plane_error)),
            V::bits(nearest.ge(r + self.plane_error)),
        )
    }

    /// The least distance of the centers from the six planes of the view, and from those of the section.
    #[inline(always)]
    pub(super) fn nearest_plane<V: FloatLanes>(&self, balls: &SphereLanes<V>) -> V {
        let depth = balls.depth;
        let mut nearest = (depth - self.near).min(depth.all(self.far) - depth);
        for side in &self.sides {
            nearest = nearest.min(side.of(balls.center));
        }
        if let Some([low, high]) = &self.section {
            for (axis, center) in balls.center.into_iter().enumerate() {
                let above = center - low[axis];
                nearest = nearest.min(above).min(center.all(high[axis]) - center);
            }
        }
        nearest
    }

    /// Which balls are at most the threshold wide on the screen and in front of the near plane.
    #[inline(always)]
    pub(super) fn small<V: FloatLanes>(&self, balls: &SphereLanes<V>) -> u32 {
        let (r, z) = (balls.radius, balls.depth);
        let one = z.all(1.0);
        let is_in_front = (z - r).gt(z.all(self.near));
        if !self.is_perspective {
            // 2 R p <= t
            return V::bits(is_in_front & (r * self.ratio).le(one));
        }
        let rr = r * r;
        let is_small = match self.size {
            // 2 f R sqrt(D² - R²) / (z² - R²) <= t, squared; both sides are positive where z > R.
            SizeMetric::Exact => {
                let tangent = balls.distance_squared() - rr;
                let depths = z * z - rr;
                (rr * self.ratio_squared * tangent).le(depths * depths)
            }
            SizeMetric::Center => (r * self.ratio).le(z),
            SizeMetric::Nearest => (r * self.ratio).le(z - r),
            // tan(asin(R / D)) = R / sqrt(D² - R²)
            SizeMetric::Angle => (rr * self.ratio_squared).le(balls.distance_squared() - rr),
            // (4 A B)² = (2 f R)⁴ (D² - R²) / (z² - R²)³ <= t⁴; the division keeps the sixth power in range.
            SizeMetric::Area => {
                let inverse = one / (z * z - rr);
                let q = rr * self.ratio_squared * inverse;
                (q * q * ((balls.distance_squared() - rr) * inverse)).le(one)
            }
        };
        V::bits(is_in_front & is_small)
    }

    /// Tells whether a ball (model space) is drawn as a splat when it is visible: its projected diameter is at most
    /// the threshold. Never for a ball that reaches the near plane, and never at threshold 0.
    pub fn is_small(&self, center: Vec3, radius: f32) -> bool {
        self.small(&self.ball(center, radius)) & 1 != 0
    }

    /// Tells whether a ball (model space) is wholly outside of the view volume, whose sides are moved outward by
    /// half a splat. Errs to "no".
    pub fn is_outside(&self, center: Vec3, radius: f32) -> bool {
        self.volume(&self.ball(center, radius)).0 & 1 != 0
    }

    /// The projected diameter of a ball (model space) in pixels as [`SizeMetric`] defines it; infinite when
    /// the ball reaches the near plane. Orthographic: 2 R times pixels per unit, whatever the metric.
    pub fn size_px(&self, center: Vec3, radius: f32) -> f64 {
        let ball = self.ball(center, radius);
        let (r, z) = (f64::from(ball.radius.x), f64::from(ball.depth.x));
        if z - r <= f64::from(self.near) {
            return f64::INFINITY;
        }
        let d = ball.center.map(|c| f64::from(c.x));
        let tangent = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - r * r;
        let depths = z * z - r * r;
        let diameter = f64::from(self.twice_focal_px) * r;
        if !self.is_perspective {
            return diameter;
        }
        match self.size {
            SizeMetric::Exact => diameter * tangent.sqrt() / depths,
            SizeMetric::Center => diameter / z,
            SizeMetric::Nearest => diameter / (z - r),
            SizeMetric::Angle => diameter / tangent.sqrt(),
            SizeMetric::Area => diameter * (tangent / depths).sqrt().sqrt() / depths.sqrt(),
        }
    }
}
