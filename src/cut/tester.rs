//! The tests of the cut: view volume, facing, projected size; four siblings at a time.
//!
//! Sources: Benda, *Point Based Rendering*, sections 3.2 and 3.3; Rusinkiewicz and Levoy, *QSplat*
//! (SIGGRAPH 2000), section 2.1; the normal cone goes back to Shirman and Abi-Ezzi, *The Cone of Normals
//! Technique* (Eurographics 1993). Deviations: sizes are compared as squares, without root or division where
//! the metric allows it; the cone test is exact for a ball instead of for its center; the four children of a
//! node are tested in the four lanes of one vector, so that a node costs no branch that cannot be foreseen.
//!
//! Every comparison errs to the safe side by the rounding of single precision, and is written so that a
//! NaN keeps the node and descends.

use super::class::{Class, inherit};
use super::strip;
use super::{Settings, SizeMetric, Stats};
use crate::abi::Vertex;
use crate::math::camera::View;
use crate::math::frustum::{Frustum, Plane};
use crate::math::octahedral;
use crate::tree::{Cone, Leaf, Model, Node, Strip};
use glam::{BVec4A, DVec3, Mat4, Vec3, Vec4};

/// Which way the normals below a node face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Facing {
    /// Every normal faces the viewer from every point of the ball.
    Front,
    /// Some may face the viewer and some may not.
    Mixed,
    /// Every normal faces away at every point of the ball (or is seen edge-on).
    Away,
}

/// A plane ready for four balls: coefficients repeated in every lane.
#[derive(Debug, Clone, Copy)]
struct Plane4 {
    x: Vec4,
    y: Vec4,
    z: Vec4,
    offset: Vec4,
}

impl Plane4 {
    #[inline]
    fn distance(&self, [x, y, z]: [Vec4; 3]) -> Vec4 {
        self.x * x + self.y * y + self.z * z + self.offset
    }
}

/// Four balls: centers relative to the reference point, in the tester's unit.
#[derive(Debug, Clone, Copy)]
struct Balls {
    center: [Vec4; 3],
    radius: Vec4,
    /// Distance of the centers along the view direction.
    depth: Vec4,
}

impl Balls {
    #[inline]
    fn distance_squared(&self) -> Vec4 {
        let [x, y, z] = self.center;
        x * x + y * y + z * z
    }
}

/// The tests of one frame, prepared from a view and settings.
///
/// Lengths are measured in a unit of its own, a power of two of model units in which the model reaches about
/// 2¹⁰ from the eye: the squares and fourth powers below then neither overflow nor vanish, whatever unit the
/// model is in, and powers of two scale without rounding.
#[derive(Debug, Clone)]
pub struct Tester {
    /// Where lengths start: the eye, or for an orthographic view the center of the root.
    reference: Vec3,
    /// Tester units in a model unit.
    unit: f32,
    /// From the scene to the viewer (orthographic: everywhere the same).
    backward: Vec3,
    is_perspective: bool,
    sides: [Plane4; 4],
    forward: Plane4,
    near: f32,
    far: f32,
    /// Absolute error of a distance to a plane.
    plane_error: f32,
    size: SizeMetric,
    /// 2 f / threshold, and its square: what a size is compared with.
    ratio: f32,
    ratio_squared: f32,
    /// 2 f (perspective, pixels) or 2 pixels per tester unit (orthographic).
    twice_focal_px: f32,
    threshold_px: f32,
    start: u8,
    /// First node whose children are the lowest nodes, and how many leaves are below such a node on average.
    low_nodes: u32,
    low_leaves: u32,
}

impl Tester {
    /// Prepares the tests of `model` seen in `view`.
    ///
    /// The view matrix must be a similarity (rotation, translation, uniform scale), else sizes are those of
    /// the scale of its first axis. A threshold below 0 or NaN counts as 0. Side planes are moved outward by half a splat, so that
    /// culling does not cut splats off at the edge of the picture.
    pub fn new(model: &Model, view: &View, settings: &Settings) -> Self {
        let threshold_px = settings.threshold_px.max(0.0);
        let frustum = Frustum::new(view, threshold_px.clamp(1.0, 16_384.0) / 2.0 + 0.5);
        let (root_center, root_radius) = match (model.tree.nodes.first(), model.tree.leaves.first())
        {
            (Some(node), _) => (node.center, node.radius),
            (None, Some(leaf)) => (leaf.center, leaf.radius),
            (None, None) => (Vec3::ZERO, 1.0),
        };
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
        let plane4 = |plane: &Plane, more: f64| Plane4 {
            x: Vec4::splat(plane.normal.x as f32),
            y: Vec4::splat(plane.normal.y as f32),
            z: Vec4::splat(plane.normal.z as f32),
            offset: Vec4::splat(((plane.distance(reference.as_dvec3()) + more) * unit) as f32),
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
        // Level starts end with the number of nodes: lowest level, and the one above it.
        let tree = &model.tree;
        let (low_nodes, low_end) = match tree.level_starts.as_slice() {
            [.., low, end, _] => (*low, *end),
            _ => (0, 0),
        };
        let low_leaves = tree.leaves.len() as u32 / low_end.saturating_sub(low_nodes).max(1);
        Self {
            reference,
            unit: unit as f32,
            backward: (-frustum.near.normal).as_vec3(),
            is_perspective: view.is_perspective,
            sides: [0, 1, 2, 3].map(|i| plane4(&frustum.sides[i], 0.0)),
            forward: plane4(&frustum.near, near),
            near: (near * unit) as f32,
            far: (f64::from(view.far) / scale * unit) as f32,
            // Normals, products and sums each round by 2^-24; centers are at most 2^10 (the model's reach)
            // away. The view matrix itself was rounded the same way.
            plane_error: (f64::from(reach) * unit * 1e-6) as f32,
            size: settings.size,
            ratio: ratio as f32,
            ratio_squared: (ratio * ratio) as f32,
            twice_focal_px: twice_focal as f32,
            threshold_px,
            low_nodes,
            low_leaves,
            start: cull(settings.cull_frustum, inherit::INSIDE)
                | cull(settings.cull_back, inherit::FRONT),
        }
    }

    /// What the root inherits.
    #[inline]
    pub(super) fn start(&self) -> u8 {
        self.start
    }

    /// Four (center, radius) in model units become four balls.
    #[inline]
    fn balls(&self, spheres: [Vec4; 4]) -> Balls {
        let [a, b, c, d] = spheres;
        let lanes = Mat4::from_cols(a, b, c, d).transpose();
        let center = [
            (lanes.x_axis - self.reference.x) * self.unit,
            (lanes.y_axis - self.reference.y) * self.unit,
            (lanes.z_axis - self.reference.z) * self.unit,
        ];
        Balls {
            center,
            radius: lanes.w_axis * self.unit,
            depth: self.forward.distance(center),
        }
    }

    #[inline]
    fn ball(&self, center: Vec3, radius: f32) -> Balls {
        self.balls([center.extend(radius); 4])
    }

    /// Which balls lie outside of the view volume, and which wholly inside.
    ///
    /// Both err to "no" by the rounding, so a ball is never inside whose sub-ball is found outside.
    #[inline]
    fn volume(&self, balls: &Balls) -> (u32, u32) {
        let (r, error) = (balls.radius, Vec4::splat(self.plane_error));
        let depth = balls.depth;
        let mut nearest = (depth - self.near).min(self.far - depth);
        for side in &self.sides {
            nearest = nearest.min(side.distance(balls.center));
        }
        // The smallest of six distances tells both: outside if it is below -r, inside if at least r.
        (
            nearest.cmplt(-r - error).bitmask(),
            nearest.cmpge(r + error).bitmask(),
        )
    }

    /// Which balls are at most the threshold wide on the screen and in front of the near plane.
    #[inline]
    fn small(&self, balls: &Balls) -> u32 {
        let (r, z) = (balls.radius, balls.depth);
        let is_in_front = (z - r).cmpgt(Vec4::splat(self.near));
        if !self.is_perspective {
            // 2 R p <= t
            return (is_in_front & (r * self.ratio).cmple(Vec4::ONE)).bitmask();
        }
        let rr = r * r;
        let is_small: BVec4A = match self.size {
            // 2 f R sqrt(D² - R²) / (z² - R²) <= t, squared; both sides are positive where z > R.
            SizeMetric::Exact => {
                let tangent = balls.distance_squared() - rr;
                let depths = z * z - rr;
                (rr * self.ratio_squared * tangent).cmple(depths * depths)
            }
            SizeMetric::Center => (r * self.ratio).cmple(z),
            SizeMetric::Nearest => (r * self.ratio).cmple(z - r),
            // tan(asin(R / D)) = R / sqrt(D² - R²)
            SizeMetric::Angle => (rr * self.ratio_squared).cmple(balls.distance_squared() - rr),
            // (4 A B)² = (2 f R)⁴ (D² - R²) / (z² - R²)³ <= t⁴; the division keeps the sixth power in range.
            SizeMetric::Area => {
                let inverse = 1.0 / (z * z - rr);
                let q = rr * self.ratio_squared * inverse;
                (q * q * ((balls.distance_squared() - rr) * inverse)).cmple(Vec4::ONE)
            }
        };
        (is_in_front & is_small).bitmask()
    }

    /// Which balls face away everywhere, and which face the viewer everywhere, by the cones of `nodes`.
    ///
    /// With v from the eye to the center, D = |v|, R the radius, a the axis and α the half angle, every
    /// normal faces away at every point of the ball exactly if D cos(θ + α) >= R, θ the angle between a and
    /// v, which is a·v cos α - R >= sqrt(D² - (a·v)²) sin α. Squared, and with the unpacked axis d left at
    /// its length |d|: t = d·v cos α - R |d| >= 0 and t² >= (D² |d|² - (d·v)²) sin² α. Exchanging the sign of
    /// d·v gives "faces the viewer". The factors below cover the rounding: with k = D² |d|², d·v is off by at
    /// most 4 · 2⁻²⁴ √k and the difference k - (d·v)² by 1e-6 k, which loses culling only within 1e-4 rad of
    /// the limit.
    #[inline]
    fn cones(&self, balls: &Balls, cones: [Cone; 4]) -> (u32, u32) {
        // On a rough surface most cones above the lowest levels are too wide to decide anything.
        if cones.iter().all(|c| c.sin_half_angle == Cone::NEVER) {
            return (0, 0);
        }
        let of =
            |f: fn(&Cone) -> f32| Vec4::new(f(&cones[0]), f(&cones[1]), f(&cones[2]), f(&cones[3]));
        // The octahedral code unpacked by its definition, times 32767.
        let mut x = of(|c| f32::from(c.axis[0])).max(Vec4::splat(-32767.0));
        let mut y = of(|c| f32::from(c.axis[1])).max(Vec4::splat(-32767.0));
        let z = 32767.0 - x.abs() - y.abs();
        let fold = (-z).max(Vec4::ZERO);
        x -= fold.copysign(x);
        y -= fold.copysign(y);
        let packed_sin = of(|c| f32::from(c.sin_half_angle));
        let may_cull = packed_sin.cmplt(Vec4::splat(f32::from(Cone::NEVER)));
        let sin = packed_sin * (1.0 / 65535.0);
        let sin_squared = sin * sin;
        let cos = (1.0 - sin_squared).max(Vec4::ZERO).sqrt();
        let length_squared = x * x + y * y + z * z;
        let (along, distance_squared, radius) = if self.is_perspective {
            let [vx, vy, vz] = balls.center;
            (
                x * vx + y * vy + z * vz,
                balls.distance_squared(),
                balls.radius,
            )
        } else {
            // Seen from infinitely far: v is the view direction and the ball has no extent.
            let v = -self.backward;
            (x * v.x + y * v.y + z * v.z, Vec4::ONE, Vec4::ZERO)
        };
        let k = distance_squared * length_squared;
        let t = along.abs() * cos * 0.999_999 - radius * length_squared.sqrt() * 1.000_001;
        let across = (k * 1.000_001 - along * along).max(Vec4::ZERO);
        let limit = across * sin_squared * 1.000_1 + k * 4e-9;
        let decided = may_cull & t.cmpgt(Vec4::ZERO) & (t * t).cmpge(limit);
        let positive = along.cmpgt(Vec4::ZERO);
        (
            (decided & positive).bitmask(),
            (decided & !positive).bitmask(),
        )
    }

    /// What becomes of the `count` (1 to 4) nodes from `first` on, which inherit `inherited`. Lanes past
    /// `count` are [`Class::DROP`].
    #[inline]
    pub(super) fn nodes(
        &self,
        model: &Model,
        first: u32,
        count: u32,
        inherited: u8,
        stats: &mut Stats,
    ) -> [Class; 4] {
        let Some(nodes) = model.tree.nodes.get(first as usize..) else {
            return [Class::DROP; 4];
        };
        // Siblings are followed by other nodes, whose lanes are masked; only the last of all need padding.
        let padded;
        let group: &[Node; 4] = match nodes.first_chunk::<4>() {
            Some(group) => group,
            None => match nodes.first() {
                Some(node) => {
                    padded = [0, 1, 2, 3].map(|i| *nodes.get(i).unwrap_or(node));
                    &padded
                }
                None => return [Class::DROP; 4],
            },
        };
        let valid = (1u32 << count.min(4)) - 1;
        stats.visited += u64::from(count.min(4));
        let [a, b, c, d] = group;
        let balls = self.balls([
            a.center.extend(a.radius),
            b.center.extend(b.radius),
            c.center.extend(c.radius),
            d.center.extend(d.radius),
        ]);
        let mut kept = valid;
        let mut inside = 0;
        if inherited & inherit::INSIDE == 0 {
            let (outside, all_inside) = self.volume(&balls);
            stats.outside += u64::from((outside & kept).count_ones());
            kept &= !outside;
            inside = all_inside;
            if kept == 0 {
                return [Class::DROP; 4];
            }
        }
        let mut front = 0;
        if inherited & inherit::FRONT == 0 {
            let (away, all_front) = self.cones(&balls, [a.cone, b.cone, c.cone, d.cone]);
            stats.facing_away += u64::from((away & kept).count_ones());
            kept &= !away;
            front = all_front;
            if kept == 0 {
                return [Class::DROP; 4];
            }
        }
        let small = self.small(&balls);
        let mut strips = [0; 4];
        if kept & !small != 0 {
            strips = self.strips(first, group, &balls, kept & !small);
        }
        let mut classes = [Class::DROP; 4];
        for (lane, class) in classes.iter_mut().enumerate() {
            let bit = 1 << lane;
            if kept & bit == 0 {
                continue;
            }
            *class = if small & bit != 0 {
                Class::SPLAT
            } else {
                let open = Class::open(
                    inherited
                        | (u8::from(inside & bit != 0) * inherit::INSIDE)
                        | (u8::from(front & bit != 0) * inherit::FRONT),
                );
                match strips[lane] {
                    0 => open,
                    count => Class::strip(count),
                }
            };
        }
        classes
    }

    /// How many splats along their strips can stand for the nodes of `lanes`; 0 where none can.
    #[inline]
    fn strips(&self, first: u32, group: &[Node; 4], balls: &Balls, lanes: u32) -> [u32; 4] {
        let mut lanes = lanes;
        for (lane, node) in group.iter().enumerate() {
            lanes &= !(u32::from(node.strip == Strip::SPHERE) << lane);
        }
        if lanes == 0 {
            return [0; 4];
        }
        // Most fail here, before any root or division: no ball that the threshold allows is wider than
        // t z / 2 f, so the strip must be thinner than that, and short enough for a row of such balls.
        let depth = if self.is_perspective {
            balls.depth
        } else {
            Vec4::ONE
        };
        let in_balls = balls.radius * self.ratio;
        let (half, width) = strip::relative_sizes(group);
        let is_likely = (width * in_balls).cmple(depth * strip::MAX_WIDTH)
            & (half * in_balls).cmple(depth * strip::MAX_COUNT as f32);
        lanes &= is_likely.bitmask();
        if lanes == 0 {
            return [0; 4];
        }
        self.strip_counts(first, group, balls, half, width, lanes)
    }

    #[inline(never)]
    fn strip_counts(
        &self,
        first: u32,
        group: &[Node; 4],
        balls: &Balls,
        half: Vec4,
        width: Vec4,
        lanes: u32,
    ) -> [u32; 4] {
        let frame = strip::Frame {
            is_perspective: self.is_perspective,
            is_nearest: self.size == SizeMetric::Nearest,
            twice_focal_px: self.twice_focal_px,
            threshold_px: self.threshold_px,
            near: self.near,
        };
        let distances = strip::Balls {
            radius: balls.radius,
            depth: balls.depth,
            distance: balls.distance_squared().sqrt(),
        };
        let (counts, fits) = strip::counts(half, width, &distances, &frame);
        let counts = counts.to_array();
        let mut fitting = [0; 4];
        for (lane, fitting) in fitting.iter_mut().enumerate() {
            if fits & lanes & (1 << lane) == 0 {
                continue;
            }
            // Fewer splats than leaves below, else the leaves are the better picture. Known without a look at
            // them: the levels are complete and split evenly, so two levels up a node has about the average
            // number of leaves, and three levels up at least as many as a row has splats.
            let (node, count) = (&group[lane], counts[lane] as u32);
            let is_fewer = if node.has_leaves() {
                count < u32::from(node.child_count)
            } else {
                first + (lane as u32) < self.low_nodes || count < self.low_leaves
            };
            *fitting = if is_fewer { count } else { 0 };
        }
        fitting
    }

    /// Which of the `count` (1 to 4) leaves from `first` on are outside of the view volume, and which of the
    /// others are small enough for a splat.
    #[inline]
    pub(super) fn leaves(
        &self,
        leaves: &[Leaf],
        first: u32,
        count: u32,
        inherited: u8,
        stats: &mut Stats,
    ) -> (u32, u32) {
        let Some(leaves) = leaves.get(first as usize..) else {
            return (0, 0);
        };
        let padded;
        let group: &[Leaf; 4] = match leaves.first_chunk::<4>() {
            Some(group) => group,
            None => match leaves.first() {
                Some(leaf) => {
                    padded = [0, 1, 2, 3].map(|i| *leaves.get(i).unwrap_or(leaf));
                    &padded
                }
                None => return (0, 0),
            },
        };
        let count = count
            .min(4)
            .min(u32::try_from(leaves.len()).unwrap_or(u32::MAX));
        let mut kept = (1u32 << count) - 1;
        stats.visited += u64::from(count);
        let [a, b, c, d] = group;
        let balls = self.balls([
            a.center.extend(a.radius),
            b.center.extend(b.radius),
            c.center.extend(c.radius),
            d.center.extend(d.radius),
        ]);
        if inherited & inherit::INSIDE == 0 {
            let (outside, _) = self.volume(&balls);
            stats.outside += u64::from((outside & kept).count_ones());
            kept &= !outside;
        }
        (kept, self.small(&balls) & kept)
    }

    /// Whether leaf `leaf` is seen from behind or edge-on, by its own geometric normal (a cloud's: by the
    /// point's normal, if it has one).
    ///
    /// Exact but for the rounding of double precision: a plane is seen from behind from all of its points or
    /// from none. A triangle without area is seen edge-on from everywhere. A point's packed normal counts as
    /// facing the viewer within its error. Indices that name no vertex face the viewer.
    #[inline]
    pub fn leaf_faces_away(&self, model: &Model, leaf: u32) -> bool {
        let to_viewer = |p: Vec3| {
            if self.is_perspective {
                self.reference.as_dvec3() - p.as_dvec3()
            } else {
                self.backward.as_dvec3()
            }
        };
        let position = |i: u32| model.vertices.get(i as usize).map(|v| v.position);
        if model.triangles.is_empty() {
            let Some(&Vertex {
                position,
                normal,
                color,
            }) = model.vertices.get(leaf as usize)
            else {
                return false;
            };
            let w = to_viewer(position);
            let along = octahedral::decode(normal).as_dvec3().dot(w);
            let error = f64::from(octahedral::ERROR_16);
            return color[3] != 0
                && along < 0.0
                && along * along >= error * error * w.length_squared();
        }
        let Some(&[a, b, c]) = model.triangles.get(leaf as usize) else {
            return false;
        };
        let (Some(a), Some(b), Some(c)) = (position(a), position(b), position(c)) else {
            return false;
        };
        let origin = a.as_dvec3();
        let normal: DVec3 = (b.as_dvec3() - origin).cross(c.as_dvec3() - origin);
        normal.dot(to_viewer(a)) <= 0.0
    }

    /// Whether a ball (model space) is drawn as a splat when it is visible: its projected diameter is at most
    /// the threshold. Never for a ball that reaches the near plane, and never at threshold 0.
    pub fn is_small(&self, center: Vec3, radius: f32) -> bool {
        self.small(&self.ball(center, radius)) & 1 != 0
    }

    /// Whether a ball (model space) is wholly outside of the view volume, whose sides are moved outward by
    /// half a splat. Errs to "no".
    pub fn is_outside(&self, center: Vec3, radius: f32) -> bool {
        self.volume(&self.ball(center, radius)).0 & 1 != 0
    }

    /// Which way everything in a ball (model space) faces whose normals lie in `cone`. Errs to
    /// [`Facing::Mixed`].
    pub fn facing(&self, center: Vec3, radius: f32, cone: Cone) -> Facing {
        match self.cones(&self.ball(center, radius), [cone; 4]) {
            (away, _) if away & 1 != 0 => Facing::Away,
            (_, front) if front & 1 != 0 => Facing::Front,
            _ => Facing::Mixed,
        }
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
