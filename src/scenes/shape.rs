//! What scenes are put together from: sheets, blocks, single triangles, and the camera that most of them share.
//!
//! That camera makes lengths readable: at distance [`DISTANCE`] one pixel is [`PX`] long, so a scene says how many
//! pixels wide a thing is, and its area on the picture follows.

use crate::math::camera::Camera;
use crate::mesh::Mesh;
use glam::{DVec3, Vec3};

/// Side of most pictures in pixels.
pub(super) const SIDE: u32 = 240;
/// Focal length of most pictures in pixels.
pub(super) const FOCAL: f64 = 240.0;
/// Distance of the eye of [`front`] from the plane z = 0.
pub(super) const DISTANCE: f64 = 4.0;
/// Length of a pixel of [`front`] in the plane z = 0.
pub(super) const PX: f64 = DISTANCE / FOCAL;

pub(super) const WHITE: [u8; 3] = [255, 255, 255];
pub(super) const RED: [u8; 3] = [255, 0, 0];
pub(super) const GREEN: [u8; 3] = [0, 255, 0];
pub(super) const BLUE: [u8; 3] = [0, 0, 255];

/// A camera of [`SIDE`] x [`SIDE`] pixels and focal length [`FOCAL`] with +y up.
pub(super) fn camera(eye: DVec3, target: DVec3, near_far: [f64; 2]) -> Camera {
    camera_of(SIDE, FOCAL, eye, target, near_far)
}

/// As [`camera`], of `side` x `side` pixels and a focal length in pixels.
pub(super) fn camera_of(
    side: u32,
    focal_px: f64,
    eye: DVec3,
    target: DVec3,
    near_far: [f64; 2],
) -> Camera {
    let fov_y = 2.0 * (0.5 * f64::from(side) / focal_px).atan();
    Camera::look_at((side, side), eye, target, DVec3::Y, fov_y, near_far)
}

/// Looks at the plane z = 0 from the front.
pub(super) fn front() -> Camera {
    camera(
        DVec3::new(0.0, 0.0, DISTANCE),
        DVec3::ZERO,
        [1.0, 2.0 * DISTANCE],
    )
}

/// A point of the plane z = 0 in pixels of [`front`] from the picture's center, x right, y up.
pub(super) fn px(x: f64, y: f64) -> DVec3 {
    DVec3::new(x, y, 0.0) * PX
}

/// A mesh in the making.
#[derive(Debug, Default)]
pub(super) struct SceneShape {
    pub(super) mesh: Mesh,
}

impl SceneShape {
    /// Adds a vertex; `normal` need not be a unit vector, zero is none.
    pub(super) fn vertex(&mut self, position: DVec3, normal: DVec3, [r, g, b]: [u8; 3]) -> u32 {
        let index = self.mesh.positions.len() as u32;
        // Adding zero makes a negative zero positive: equal places have equal bits.
        self.mesh.positions.push(position.as_vec3() + Vec3::ZERO);
        self.mesh
            .normals
            .push(normal.normalize_or_zero().as_vec3() + Vec3::ZERO);
        self.mesh.colors.push([r, g, b, 255]);
        index
    }

    /// Adds a triangle with vertices of its own and the normal of its plane.
    pub(super) fn triangle(&mut self, corners: [DVec3; 3], color: [u8; 3]) {
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let indices = corners.map(|corner| self.vertex(corner, normal, color));
        self.mesh.triangles.push(indices);
    }

    /// Adds a parallelogram of `cells` along `u` and `v`, two triangles a cell, that faces u x v.
    pub(super) fn sheet(
        &mut self,
        corner: DVec3,
        u: DVec3,
        v: DVec3,
        [columns, rows]: [u32; 2],
        color: [u8; 3],
    ) {
        let at = |i: u32, j: u32| {
            corner + u * (f64::from(i) / f64::from(columns)) + v * (f64::from(j) / f64::from(rows))
        };
        self.surface([columns, rows], at, u.cross(v), color);
    }

    /// Adds a grid of vertices `at(i, j)`, two triangles a cell, all with one normal.
    fn surface(
        &mut self,
        [columns, rows]: [u32; 2],
        at: impl Fn(u32, u32) -> DVec3,
        normal: DVec3,
        color: [u8; 3],
    ) {
        let first = self.mesh.positions.len() as u32;
        for j in 0..=rows {
            for i in 0..=columns {
                self.vertex(at(i, j), normal, color);
            }
        }
        for j in 0..rows {
            for i in 0..columns {
                let a = first + j * (columns + 1) + i;
                let above = a + columns + 1;
                self.mesh.triangles.push([a, a + 1, above + 1]);
                self.mesh.triangles.push([a, above + 1, above]);
            }
        }
    }

    /// Adds a quadrilateral of four corners, counter-clockwise, with vertices of its own.
    pub(super) fn quad(&mut self, corners: [DVec3; 4], normal: DVec3, color: [u8; 3]) {
        let [a, b, c, d] = corners.map(|corner| self.vertex(corner, normal, color));
        self.mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }

    /// As [`SceneShape::sheet`], but every cell has four vertices of its own, with what `look(i, j)` gives: the color, and
    /// the factor of the normal (1, -1 or 0).
    pub(super) fn tiles(
        &mut self,
        corner: DVec3,
        u: DVec3,
        v: DVec3,
        [columns, rows]: [u32; 2],
        look: impl Fn(u32, u32) -> ([u8; 3], f64),
    ) {
        let at = |i: u32, j: u32| {
            corner + u * (f64::from(i) / f64::from(columns)) + v * (f64::from(j) / f64::from(rows))
        };
        for j in 0..rows {
            for i in 0..columns {
                let (color, sign) = look(i, j);
                self.quad(
                    [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)],
                    u.cross(v) * sign,
                    color,
                );
            }
        }
    }

    /// Adds a closed box; `colors` of the sides x, y, z (both sides of an axis alike, but `[2]` is the front, +z, and
    /// `[3]` the back).
    pub(super) fn block(&mut self, min: DVec3, max: DVec3, cells: [u32; 3], colors: [[u8; 3]; 4]) {
        // One formula for every axis, so that the faces meet to the bit.
        let at = |axis: usize, k: u32| {
            min[axis] + (max[axis] - min[axis]) * (f64::from(k) / f64::from(cells[axis]))
        };
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for is_far in [false, true] {
                // u x v is the positive axis; the near face is seen from the other side.
                let (u, v) = if is_far { (u, v) } else { (v, u) };
                let place = |i: u32, j: u32| {
                    let mut point = DVec3::ZERO;
                    point[axis] = at(axis, if is_far { cells[axis] } else { 0 });
                    point[u] = at(u, i);
                    point[v] = at(v, j);
                    point
                };
                let mut normal = DVec3::ZERO;
                normal[axis] = if is_far { 1.0 } else { -1.0 };
                let color = colors[axis + usize::from(axis == 2 && !is_far)];
                self.surface([cells[u], cells[v]], place, normal, color);
            }
        }
    }
}

/// Area in pixels of the convex hull of the projections of `points`, all in front of the eye (Andrew's monotone
/// chain).
pub(super) fn hull_area_px(camera: &Camera, points: &[DVec3]) -> f64 {
    let [sx, sy] = [camera.proj.x_axis.x, camera.proj.y_axis.y];
    let mut projected: Vec<[f64; 2]> = points
        .iter()
        .map(|p| {
            let v = camera.view.transform_point3(*p);
            [
                sx * v.x / -v.z * f64::from(camera.width) / 2.0,
                sy * v.y / -v.z * f64::from(camera.height) / 2.0,
            ]
        })
        .collect();
    projected.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let turn = |o: [f64; 2], a: [f64; 2], b: [f64; 2]| {
        (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])
    };
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while let [.., o, a] = chain[..]
                && turn(o, a, p) <= 0.0
            {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut projected.iter().copied());
    hull.extend(half(&mut projected.iter().rev().copied()));
    let twice: f64 = (0..hull.len())
        .map(|i| {
            let (a, b) = (hull[i], hull[(i + 1) % hull.len()]);
            a[0] * b[1] - a[1] * b[0]
        })
        .sum();
    twice.abs() / 2.0
}

/// The eight corners of a box.
pub(super) fn corners_of(min: DVec3, max: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|k| {
        let pick = |axis: usize| {
            if k >> axis & 1 == 0 {
                min[axis]
            } else {
                max[axis]
            }
        };
        DVec3::new(pick(0), pick(1), pick(2))
    })
}

/// Numbers that look random and are the same everywhere (SplitMix64; Steele, Lea and Flood, 2014).
pub(super) struct RandomNumbers(u64);

impl RandomNumbers {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in -1..1.
    pub(super) fn signed(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Uniform in the unit ball; never the zero vector.
    pub(super) fn in_ball(&mut self) -> DVec3 {
        loop {
            let p = DVec3::new(self.signed(), self.signed(), self.signed());
            if (1e-6..=1.0).contains(&p.length_squared()) {
                return p;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_is_a_pixel() {
        let view = front().view(DVec3::ZERO).unwrap();
        assert!((view.focal_px() - 240.0).abs() < 1e-3);
        let (x, y, z) = view.project(px(10.0, 20.0).as_vec3());
        assert!((x - 130.0).abs() < 1e-3 && (y - 100.0).abs() < 1e-3 && (z - 4.0).abs() < 1e-5);
    }

    #[test]
    fn the_hull_of_a_facing_square_is_the_square() {
        let mut points: Vec<DVec3> = [(-30.0, -20.0), (30.0, -20.0), (30.0, 20.0), (-30.0, 20.0)]
            .map(|(x, y)| px(x, y))
            .to_vec();
        points.extend([px(0.0, 0.0), px(30.0, 0.0), px(-30.0, -20.0)]);
        assert!((hull_area_px(&front(), &points) - 2400.0).abs() < 1e-9);
    }

    #[test]
    fn blocks_face_outward() {
        let mut shape = SceneShape::default();
        shape.block(
            DVec3::ZERO,
            DVec3::new(1.0, 2.0, 3.0),
            [1, 2, 3],
            [WHITE; 4],
        );
        assert_eq!(shape.mesh.triangles.len(), 2 * 2 * (2 + 6 + 3));
        let volume: f64 = shape
            .mesh
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| shape.mesh.positions[i as usize].as_dvec3());
                a.dot(b.cross(c)) / 6.0
            })
            .sum();
        assert!((volume - 6.0).abs() < 1e-9, "{volume}");
        for t in &shape.mesh.triangles {
            let [a, b, c] = t.map(|i| shape.mesh.positions[i as usize]);
            let normal = shape.mesh.normals[t[0] as usize];
            assert!((b - a).cross(c - a).normalize().distance(normal) < 1e-6);
        }
    }
}
