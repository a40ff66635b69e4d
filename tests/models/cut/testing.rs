//! A small builder of valid models, independent of the real one, and the meshes and cameras of these tests.

use glam::{DVec3, Vec3};
use surfel::abi::Vertex;
use surfel::math::camera::{Camera, View};
use surfel::math::octahedral;
use surfel::tree::{Leaf, Model, Node, NodeAttributes, NodeStrip, NormalCone, Tree};

/// A seeded generator (PCG's multiplier; the high bits only).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    /// In 0..1.
    pub fn unit(&mut self) -> f64 {
        self.next() as f64 / (1u64 << 31) as f64
    }

    pub fn range(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.unit()
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    /// Uniform in the ball of radius 1.
    pub fn in_ball(&mut self) -> DVec3 {
        loop {
            let p = DVec3::new(
                self.range(-1.0, 1.0),
                self.range(-1.0, 1.0),
                self.range(-1.0, 1.0),
            );
            if p.length_squared() <= 1.0 && p.length_squared() > 1e-6 {
                return p;
            }
        }
    }

    pub fn direction(&mut self) -> DVec3 {
        self.in_ball().normalize()
    }
}

/// Corner positions of triangles, each with its own three vertices.
pub type Soup = Vec<[DVec3; 3]>;

/// A grid of `nu` x `nv` cells over a parametric surface, counter-clockwise seen along (du x dv).
pub fn surface(nu: usize, nv: usize, point: impl Fn(f64, f64) -> DVec3) -> Soup {
    let at = |i: usize, j: usize| {
        let p = point(i as f64 / nu as f64, j as f64 / nv as f64);
        p.as_vec3().as_dvec3()
    };
    let mut soup = Soup::new();
    for j in 0..nv {
        for i in 0..nu {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            soup.push([a, b, c]);
            soup.push([a, c, d]);
        }
    }
    soup
}

/// Radius 1, closed, with triangles without area at the poles.
pub fn sphere(nu: usize, nv: usize) -> Soup {
    use std::f64::consts::{PI, TAU};
    surface(nu, nv, |u, v| {
        let (u, w) = (u * TAU, (v - 0.5) * PI);
        DVec3::new(w.cos() * u.sin(), w.sin(), w.cos() * u.cos())
    })
}

/// Radii 1 and 0.4; many cells along and few around give needles.
pub fn torus(nu: usize, nv: usize) -> Soup {
    use std::f64::consts::{PI, TAU};
    surface(nu, nv, |u, v| {
        let (u, w) = (u * TAU, v * TAU - PI);
        let r = 1.0 + 0.4 * w.cos();
        DVec3::new(r * u.sin(), 0.4 * w.sin(), r * u.cos())
    })
}

/// The cube of side 1 around 0: flat faces, whose cones have no width, and sharp edges.
pub fn cube(n: usize) -> Soup {
    [
        DVec3::X,
        DVec3::Y,
        DVec3::Z,
        -DVec3::X,
        -DVec3::Y,
        -DVec3::Z,
    ]
    .into_iter()
    .flat_map(|normal| {
        let right = DVec3::new(normal.y, normal.z, normal.x);
        let above = normal.cross(right);
        surface(n, n, |u, v| {
            normal / 2.0 + right * (u - 0.5) + above * (v - 0.5)
        })
    })
    .collect()
}

/// An open sheet of waves.
pub fn sheet(n: usize) -> Soup {
    surface(n, n, |u, v| {
        DVec3::new(
            2.0 * u - 1.0,
            2.0 * v - 1.0,
            0.2 * (9.0 * u).sin() * (7.0 * v).cos(),
        )
    })
}

/// Random triangles of all sizes, some without area.
pub fn chaos(n: usize, seed: u64) -> Soup {
    let mut random = Random(seed);
    (0..n)
        .map(|i| {
            let size = 10f64.powf(random.range(-3.0, -0.3));
            let center = random.in_ball();
            let mut corners =
                [0, 1, 2].map(|_| (center + random.in_ball() * size).as_vec3().as_dvec3());
            if i % 17 == 0 {
                corners[2] = corners[1];
            }
            corners
        })
        .collect()
}

fn up(x: f64) -> f32 {
    ((x * (1.0 + 2e-7)) as f32).next_up()
}

fn sphere_of(children: &[(DVec3, f64)]) -> (Vec3, f32) {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &(c, r) in children {
        low = low.min(c - r);
        high = high.max(c + r);
    }
    let center = ((low + high) / 2.0).as_vec3();
    let radius = children
        .iter()
        .map(|&(c, r)| c.distance(center.as_dvec3()) + r)
        .fold(0.0, f64::max);
    (center, if radius > 0.0 { up(radius) } else { 0.0 })
}

/// Orders triangles by halving along the longest side of the box of their centers.
fn order(ids: &mut [u32], centers: &[DVec3]) {
    if ids.len() <= 2 {
        return;
    }
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &i in ids.iter() {
        low = low.min(centers[i as usize]);
        high = high.max(centers[i as usize]);
    }
    let axis = (high - low).max_position();
    // Halves of a power of four leaves, so that groups of four stay together.
    let middle = (ids.len() / 2).next_multiple_of(4).min(ids.len() - 1);
    ids.select_nth_unstable_by(middle, |&a, &b| {
        centers[a as usize][axis]
            .total_cmp(&centers[b as usize][axis])
            .then(a.cmp(&b))
    });
    let (a, b) = ids.split_at_mut(middle);
    order(a, centers);
    order(b, centers);
}

fn normal_of([a, b, c]: [DVec3; 3]) -> Option<DVec3> {
    (b - a).cross(c - a).try_normalize()
}

fn cone_of(normals: impl Iterator<Item = DVec3> + Clone) -> NormalCone {
    let sum: DVec3 = normals.clone().sum();
    if sum.length() < 1e-6 {
        return NormalCone::ALL;
    }
    let axis = octahedral::encode(sum.as_vec3());
    let unpacked = octahedral::decode(axis).as_dvec3().normalize();
    let cos = normals.map(|n| n.dot(unpacked)).fold(1.0, f64::min);
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    if cos < 1e-3 || sin > 0.9999 {
        return NormalCone::ALL;
    }
    NormalCone {
        axis,
        sin_half_angle: ((sin + 1e-7) * 65535.0).ceil() as u16,
    }
}

fn strip_of(center: Vec3, radius: f32, corners: impl Iterator<Item = DVec3> + Clone) -> NodeStrip {
    let c = center.as_dvec3();
    let far = |from: DVec3| {
        let longest = |a: DVec3, b: DVec3| {
            if b.distance(from) > a.distance(from) {
                b
            } else {
                a
            }
        };
        corners.clone().fold(from, longest)
    };
    let one = far(c);
    let axis = octahedral::encode((far(one) - one).as_vec3());
    let direction = axis.map(|x| (f64::from(x) / 258.0).round() as i8);
    let mut strip = NodeStrip {
        direction,
        half_length: 0,
        width: 0,
    };
    let u = strip.direction().as_dvec3().normalize();
    let along = |p: DVec3| (p - c).dot(u);
    let across = |p: DVec3| (p - c - u * along(p)).length();
    let width = corners.clone().map(across).fold(0.0, f64::max);
    // The shortest segment: the round ends of the capsule hold what lies beyond it.
    let beyond =
        |p: DVec3| along(p).abs() - (width * width - across(p) * across(p)).max(0.0).sqrt();
    let half = corners.clone().map(beyond).fold(0.0, f64::max);
    let in_255 = |x: f64| (x / f64::from(radius) * 255.0 + 1e-3).ceil();
    if !(radius > 0.0 && in_255(half) <= 255.0 && in_255(width) < 180.0) {
        return NodeStrip::SPHERE;
    }
    (strip.half_length, strip.width) = (in_255(half) as u8, in_255(width) as u8);
    strip
}

/// How to build.
#[derive(Clone, Copy, PartialEq)]
pub enum Strips {
    No,
    Yes,
}

/// A valid model of the triangles.
pub fn model(soup: &Soup, strips: Strips) -> Model {
    let centers: Vec<DVec3> = soup.iter().map(|t| (t[0] + t[1] + t[2]) / 3.0).collect();
    let mut ids: Vec<u32> = (0..soup.len() as u32).collect();
    order(&mut ids, &centers);
    let soup: Soup = ids.iter().map(|&i| soup[i as usize]).collect();
    let leaves: Vec<(Vec3, f32)> = soup
        .iter()
        .map(|t| sphere_of(&t.map(|p| (p, 0.0))))
        .collect();
    let packed: Vec<Option<DVec3>> = soup.iter().map(|&t| normal_of(t)).collect();
    let tree = tree(&leaves, |range| {
        let normals = packed[range.clone()].iter().copied().flatten();
        let corners = soup[range].iter().flatten().copied();
        (cone_of(normals), corners, strips)
    });
    let vertex = |p: &DVec3, n: Option<DVec3>| Vertex {
        position: p.as_vec3(),
        normal: octahedral::encode(n.unwrap_or(DVec3::Z).as_vec3()),
        color: [255; 4],
    };
    let vertices: Vec<Vertex> = soup
        .iter()
        .zip(&packed)
        .flat_map(|(t, &n)| t.each_ref().map(|p| vertex(p, n)))
        .collect();
    finish(
        vertices,
        (0..soup.len() as u32)
            .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
            .collect(),
        tree,
    )
}

/// A cloud of points with spacing and normals (every fifth has none).
pub fn cloud(points: &[(DVec3, DVec3)], spacing: f32) -> Model {
    let positions: Vec<DVec3> = points.iter().map(|p| p.0).collect();
    let mut ids: Vec<u32> = (0..points.len() as u32).collect();
    order(&mut ids, &positions);
    let leaves: Vec<(Vec3, f32)> = ids
        .iter()
        .map(|&i| (positions[i as usize].as_vec3(), spacing))
        .collect();
    let normals: Vec<DVec3> = ids.iter().map(|&i| points[i as usize].1).collect();
    let tree = tree(&leaves, |range| {
        (
            cone_of(normals[range].iter().copied()),
            std::iter::empty(),
            Strips::No,
        )
    });
    let vertices = leaves
        .iter()
        .zip(&normals)
        .enumerate()
        .map(|(i, (leaf, n))| Vertex {
            position: leaf.0,
            normal: octahedral::encode(n.as_vec3()),
            color: [255, 255, 255, if i % 5 == 0 { 0 } else { 255 }],
        });
    finish(vertices.collect(), Vec::new(), tree)
}

fn finish(vertices: Vec<Vertex>, triangles: Vec<[u32; 3]>, tree: Tree) -> Model {
    Model {
        used_vertices: vertices.len() as u32,
        vertices,
        triangles,
        tree,
        ..Model::default()
    }
}

fn tree<C: Iterator<Item = DVec3> + Clone>(
    leaves: &[(Vec3, f32)],
    below: impl Fn(std::ops::Range<usize>) -> (NormalCone, C, Strips),
) -> Tree {
    // Levels from the leaves up, as (sphere, first leaf); the groups are as even as can be.
    let mut levels: Vec<Vec<(Vec3, f32, u32)>> = vec![
        leaves
            .iter()
            .zip(0..)
            .map(|(&(c, r), i)| (c, r, i))
            .collect(),
    ];
    let mut groups: Vec<Vec<(usize, usize)>> = vec![];
    while levels.last().unwrap().len() > 1 {
        let last = levels.last().unwrap();
        let count = last.len().div_ceil(4);
        let bounds: Vec<(usize, usize)> = (0..count)
            .map(|g| (g * last.len() / count, (g + 1) * last.len() / count))
            .collect();
        let level = bounds.iter().map(|&(a, b)| {
            let spheres: Vec<_> = last[a..b]
                .iter()
                .map(|s| (s.0.as_dvec3(), f64::from(s.1)))
                .collect();
            let (c, r) = sphere_of(&spheres);
            (c, r, last[a].2)
        });
        let level = level.collect();
        levels.push(level);
        groups.push(bounds);
    }
    let mut tree = Tree {
        leaves: leaves
            .iter()
            .map(|&(center, radius)| Leaf { center, radius })
            .collect(),
        ..Tree::default()
    };
    let depth = levels.len() - 1;
    let (mut nodes, mut attributes) = (vec![], vec![]);
    let mut start = 0;
    for level in (1..=depth).rev() {
        tree.level_starts.push(start);
        let next_start = start + levels[level].len() as u32;
        for (i, &(center, radius, first_leaf)) in levels[level].iter().enumerate() {
            let (a, b) = groups[level - 1][i];
            let end = levels[level]
                .get(i + 1)
                .map_or(leaves.len(), |n| n.2 as usize);
            let (cone, corners, strips) = below(first_leaf as usize..end);
            nodes.push(Node {
                center,
                radius,
                first_child: a as u32 + if level > 1 { next_start } else { 0 },
                cone,
                strip: match strips {
                    Strips::Yes => strip_of(center, radius, corners),
                    Strips::No => NodeStrip::SPHERE,
                },
                child_count: (b - a) as u8,
                flags: if level == 1 { Node::LEAF_CHILDREN } else { 0 },
            });
            tree.first_leaf.push(first_leaf);
            attributes.push(NodeAttributes {
                normal: cone.axis,
                color: [255; 4],
                splat_radius: radius,
                area: 0.0,
            });
        }
        start = next_start;
    }
    tree.level_starts.push(start);
    tree.nodes = nodes.as_slice().into();
    tree.attributes = attributes.as_slice().into();
    tree.parents = vec![0; tree.nodes.len()];
    for (id, node) in tree
        .nodes
        .iter()
        .enumerate()
        .filter(|(_, n)| !n.has_leaves())
    {
        for child in node.first_child..node.first_child + u32::from(node.child_count) {
            tree.parents[child as usize] = id as u32;
        }
    }
    tree
}

/// A perspective view from `eye` to `target`, 60 degrees high.
pub fn look(eye: DVec3, target: DVec3, (near, far): (f64, f64)) -> View {
    let up = if (target - eye).normalize().y.abs() > 0.99 {
        DVec3::X
    } else {
        DVec3::Y
    };
    let camera = Camera::look_at((500, 400), eye, target, up, 60f64.to_radians(), [near, far]);
    camera.view(DVec3::ZERO).unwrap()
}

/// An orthographic view along `eye` to `target`, `height` model units high, of depth `near` to `far`; the view
/// matrix scales by `scale`.
pub fn look_flat(
    eye: DVec3,
    target: DVec3,
    height: f64,
    (near, far): (f64, f64),
    scale: f64,
) -> View {
    use glam::{DMat4, DVec4};
    let up = if (target - eye).normalize().y.abs() > 0.99 {
        DVec3::X
    } else {
        DVec3::Y
    };
    let mut camera = Camera::look_at((500, 400), eye, target, up, 1.0, [1.0, 2.0]);
    camera.view = DMat4::from_scale(DVec3::splat(scale)) * camera.view;
    let (near, far, s) = (near * scale, far * scale, 2.0 / (height * scale));
    camera.proj = DMat4::from_cols(
        DVec4::new(s * 0.8, 0.0, 0.0, 0.0),
        DVec4::new(0.0, s, 0.0, 0.0),
        DVec4::new(0.0, 0.0, 1.0 / (near - far), 0.0),
        DVec4::new(0.0, 0.0, near / (near - far), 1.0),
    );
    camera.view(DVec3::ZERO).unwrap()
}
