//! What faces away: the normal cones of nodes, the normals of leaves.

use crate::abi::Vertex;
use crate::cut::frustum_and_size::NodeTester;
use crate::cut::siblings;
use crate::cut::siblings::SphereLanes;
use crate::math::octahedral;
use crate::simd::FloatLanes;
use crate::tree::{Model, NormalCone, Tree};
use glam::{DVec3, Vec3, Vec4};

/// Which way the normals below a node face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FacingTest {
    /// Every normal faces the viewer from every point of the ball.
    Front,
    /// Some may face the viewer and some may not.
    Mixed,
    /// Every normal faces away at every point of the ball (or is seen edge-on).
    Away,
}

/// Nodes of a tree that are asked whether it is rough.
const ASKED: usize = 32;
/// Mean sine of the half angles of their normal cones from which on it is. Of a torus of 4 million triangles it is 0.04, of a
/// statue of 8 million with bumps of the size of triangles 0.59.
const LEAST_ROUGH: f32 = 0.4;

/// Tells whether the normals below nodes of some 64 leaves point to many sides: some of those nodes are asked. They are dropped
/// for facing away only where they face away by far, so that of a closed surface much of the rear is looked at too.
pub(super) fn is_rough(tree: &Tree) -> bool {
    let most = tree.leaves.len() / 64;
    let levels = tree.level_starts.windows(2);
    let mut levels = levels.map(|ends| ends[0] as usize..ends[1] as usize);
    let Some(level) = levels.rfind(|level| level.len() <= most) else {
        return false;
    };
    let nodes = tree.nodes.get(level).unwrap_or_default();
    let asked = nodes.iter().step_by(nodes.len().div_ceil(ASKED).max(1));
    let (count, sines) = asked.fold((0, 0.0), |(count, sum), node| {
        (count + 1, sum + node.cone.sin_half_angle())
    });
    sines > LEAST_ROUGH * count as f32
}

impl NodeTester {
    /// Which balls face away everywhere, and which face the viewer everywhere, by packed cones: the coordinates
    /// of the axes and the sines, as `Words::axis` and `Words::sine` have them.
    ///
    /// With v from the eye to the center, D = |v|, R the radius, a the axis and α the half angle, every
    /// normal faces away at every point of the ball exactly if D cos(θ + α) >= R, θ the angle between a and
    /// v, which is a·v cos α - R >= sqrt(D² - (a·v)²) sin α. Squared, and with the unpacked axis d left at
    /// its length |d|: t = d·v cos α - R |d| >= 0 and t² >= (D² |d|² - (d·v)²) sin² α. Exchanging the sign of
    /// d·v gives "faces the viewer". The factors below cover the rounding: with k = D² |d|², d·v is off by at
    /// most 4 · 2⁻²⁴ √k and the difference k - (d·v)² by 1e-6 k, which loses culling only within 1e-4 rad of
    /// the limit.
    #[inline(always)]
    pub(super) fn cones<V: FloatLanes>(
        &self,
        balls: &SphereLanes<V>,
        axes: (V, V),
        packed_sin: V,
    ) -> (u32, u32) {
        let [x, y, z] = Self::cone_axes(axes);
        let (zero, one) = (x.all(0.0), x.all(1.0));
        let may_cull = packed_sin.lt(x.all(f32::from(NormalCone::NEVER)));
        let sin = packed_sin * (1.0 / 65535.0);
        let sin_squared = sin * sin;
        let cos = (one - sin_squared).max(zero).sqrt();
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
            (x * v.x + y * v.y + z * v.z, one, zero)
        };
        let k = distance_squared * length_squared;
        let t = along.abs() * cos * 0.999_999 - radius * length_squared.sqrt() * 1.000_001;
        let across = (k * 1.000_001 - along * along).max(zero);
        let limit = across * sin_squared * 1.000_1 + k * 4e-9;
        let decided = may_cull & t.gt(zero) & (t * t).ge(limit);
        let positive = along.gt(zero);
        (V::bits(decided & positive), V::bits(decided & !positive))
    }

    /// Which nodes have cones that can decide anything, by their packed sines.
    #[inline(always)]
    pub(super) fn may_cull<V: FloatLanes>(&self, packed_sin: V) -> u32 {
        V::bits(packed_sin.lt(packed_sin.all(f32::from(NormalCone::NEVER))))
    }

    /// Directions of the packed axes of cones: the octahedral code unpacked by its definition, times 32767.
    #[inline(always)]
    pub(super) fn cone_axes<V: FloatLanes>((x, y): (V, V)) -> [V; 3] {
        let least = x.all(-32767.0);
        let (x, y) = (x.max(least), y.max(least));
        let z = x.all(32767.0) - x.abs() - y.abs();
        let fold = (-z).max(x.all(0.0));
        [x - fold.copysign(x), y - fold.copysign(y), z]
    }

    /// Tells whether leaf `leaf` is seen from behind or edge-on, by its own geometric normal (a cloud's: by the
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
        if model.kind().is_points() {
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

    /// Which of four triangles, given by the columns of their corners (model space), face away by
    /// [`NodeTester::leaf_faces_away`], and which of them are so close to edge-on (or so small, or no numbers) that
    /// single precision cannot tell.
    ///
    /// With u = 2⁻²⁴ each coordinate of an edge e or of the way w to the viewer is off by u of itself, so each
    /// component of e₁ × e₂ by at most 4 u |e₁| |e₂|, and its product with w by at most 11 u |e₁| |e₂| |w| =
    /// 6.6e-7 |e₁| |e₂| |w|. The sign holds where the product exceeds three times that.
    #[inline]
    pub(super) fn triangles_face_away(&self, corners: &[[Vec4; 3]; 3]) -> (u32, u32) {
        let [a, b, c] = corners;
        let edge = |to: &[Vec4; 3]| [0, 1, 2].map(|i| (to[i] - a[i]) * self.unit);
        let squared = |v: [Vec4; 3]| v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        let (e, g) = (edge(b), edge(c));
        let w = if self.is_perspective {
            let eye = self.reference.to_array();
            [0, 1, 2].map(|i| (Vec4::splat(eye[i]) - a[i]) * self.unit)
        } else {
            self.backward.to_array().map(Vec4::splat)
        };
        let along = (e[1] * g[2] - e[2] * g[1]) * w[0]
            + (e[2] * g[0] - e[0] * g[2]) * w[1]
            + (e[0] * g[1] - e[1] * g[0]) * w[2];
        let scale = squared(e) * squared(g) * squared(w);
        // Below 1e-20 the squares themselves may have lost digits.
        let is_sure = (along * along).cmpgt(scale * 4e-12) & scale.cmpgt(Vec4::splat(1e-20));
        (
            (is_sure & along.cmplt(Vec4::ZERO)).bitmask(),
            !is_sure.bitmask() & 15,
        )
    }

    /// The triangles of four leaves as columns of their corners. A corner that names no vertex is not a
    /// number.
    #[inline]
    pub(super) fn corners(vertices: &[Vertex], triangles: [[u32; 3]; 4]) -> [[Vec4; 3]; 3] {
        [0, 1, 2].map(|corner| {
            let [x, y, z, _] = siblings::columns(triangles.map(|triangle| {
                match vertices.get(triangle[corner] as usize) {
                    Some(vertex) => vertex.position.extend(0.0),
                    None => Vec4::NAN,
                }
            }));
            [x, y, z]
        })
    }

    /// Which way everything in a ball (model space) faces whose normals lie in `cone`. Errs to
    /// [`FacingTest::Mixed`].
    pub fn facing(&self, center: Vec3, radius: f32, cone: NormalCone) -> FacingTest {
        let axis = cone.axis.map(|c| Vec4::splat(f32::from(c)));
        let sine = Vec4::splat(f32::from(cone.sin_half_angle));
        match self.cones(&self.ball(center, radius), (axis[0], axis[1]), sine) {
            (away, _) if away & 1 != 0 => FacingTest::Away,
            (_, front) if front & 1 != 0 => FacingTest::Front,
            _ => FacingTest::Mixed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cut::CutSettings;
    use crate::generate::{self, GeneratedShape, ShapeSpec};
    use crate::math::camera::Camera;
    use crate::progress::SilentProgress;
    use crate::tree::{self, BuildOptions};
    use glam::DVec3;

    /// A statue has bumps of the size of its triangles, whatever that is; a sphere and a torus have none.
    #[test]
    fn bumps_are_rough_and_needles_are_not() {
        for (shape, triangles, expected) in [
            (GeneratedShape::Statue, 30_000, true),
            (GeneratedShape::Statue, 400_000, true),
            (GeneratedShape::Torus, 400_000, false),
            (GeneratedShape::Sphere, 30_000, false),
        ] {
            let spec = ShapeSpec::with_triangles(shape, triangles).expect("a valid size");
            let mesh = generate::mesh(&spec);
            let model =
                tree::build(mesh, &BuildOptions::default(), &SilentProgress).expect("a tree");
            assert_eq!(is_rough(&model.tree), expected, "{shape:?}, {triangles}");
        }
        assert!(!is_rough(&Model::default().tree));
    }

    /// Where single precision says that it is sure, it says what double precision says.
    #[test]
    fn four_triangles_face_as_one_does() {
        let mut state = 1u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
        };
        let eye = DVec3::new(0.3, 0.2, 3.0);
        let camera = Camera::look_at((400, 300), eye, DVec3::ZERO, DVec3::Y, 0.8, [0.1, 20.0]);
        let view = camera.view(DVec3::ZERO).expect("a usable camera");
        let (mut away, mut front, mut unsure) = (0, 0, 0);
        for round in 0..20_000 {
            // Ordinary triangles, tiny ones, needles, and ones that are seen all but edge-on.
            let size = [1.0, 1e-4, 1e-2, 1.0][round % 4];
            let model = Model {
                vertices: (0..12)
                    .map(|i| {
                        let mut p = Vec3::new(random(), random(), random()) * size;
                        if round % 4 == 2 {
                            p *= Vec3::new(100.0, 1.0, 1e-3);
                        }
                        if round % 4 == 3 && i % 3 == 2 {
                            let lift = p * 1e-6;
                            p = eye.as_vec3() * (1.0 + random()) + lift;
                        }
                        Vertex {
                            position: p,
                            normal: [0; 2],
                            color: [255; 4],
                        }
                    })
                    .collect(),
                triangles: vec![
                    [0, 1, 2],
                    [3, 4, 5],
                    [6, 7, 8],
                    [9, 10, 11 + (round as u32 & 1)],
                ],
                ..Model::default()
            };
            let tester = NodeTester::new(&model, &view, &CutSettings::default());
            let four = [0, 1, 2, 3].map(|i| model.triangles[i]);
            let (is_away, is_unsure) =
                tester.triangles_face_away(&NodeTester::corners(&model.vertices, four));
            // A corner that does not exist is never decided here.
            assert_eq!(round & 1 != 0, is_unsure & 8 != 0 && four[3][2] == 12);
            for lane in 0..4 {
                if is_unsure >> lane & 1 != 0 {
                    unsure += 1;
                    continue;
                }
                let expected = tester.leaf_faces_away(&model, lane);
                assert_eq!(is_away >> lane & 1 != 0, expected, "round {round}");
                *(if expected { &mut away } else { &mut front }) += 1;
            }
        }
        assert!(away > 20_000 && front > 20_000, "{away} {front} {unsure}");
    }
}
