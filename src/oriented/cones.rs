//! Dietz's cones of normals with an anchor (methods 5.4, after L. Shirman and S. Abi-Ezzi, 1993), his faults, and what is right.
//!
//! Points lie in a frustum of a cone around the mean axis a, of half angle alpha, between a lower and an upper circle. Seen
//! from a cone of half angle pi/2 - alpha above it all faces turn to the eye, from one below it none does. Three things
//! in his text are wrong:
//!
//! * The test as printed tells who is outside of a region, and is used as if it told who is inside.
//! * The apex of the lower region follows from the lower circle. Above 45 degrees the upper one binds.
//! * The radius of a circle is half the side of a box, which does not reach the corners of that.

use crate::oriented::angle_test::{FaceWeight, normal_of};
use crate::oriented::surface::WeldedSurface;
use crate::progress::Progress;
use glam::DVec3;
use rayon::prelude::*;

/// Which of the tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConeRule {
    /// His, as printed.
    Printed,
    /// His, with the inequality turned round.
    Turned,
    /// Right.
    Corrected,
}

/// What of a group of faces an eye sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConeSide {
    /// All their fronts.
    Front,
    /// All their backs.
    Back,
    /// Some of each, or it cannot be told.
    Neutral,
}

/// The regions of eyes of a group of faces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnchoredCone {
    axis: DVec3,
    sine: f64,
    front_apex: DVec3,
    back_apex: DVec3,
    rule: ConeRule,
}

impl AnchoredCone {
    /// The regions of faces with these corners and unit normals; `None` where the normals spread over half a sphere or more,
    /// or there are none: nothing can be told.
    pub fn new(corners: &[DVec3], normals: &[DVec3], rule: ConeRule) -> Option<Self> {
        let (low, high) = box_of(normals)?;
        let axis = ((low + high) / 2.0).try_normalize()?;
        let cosine = normals.iter().map(|n| axis.dot(*n)).fold(1.0, f64::min);
        if cosine < 1e-3 {
            return None;
        }
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let tangent = sine / cosine;
        let heights = || corners.iter().map(|c| axis.dot(*c));
        let lowest = corners
            .iter()
            .min_by(|a, b| axis.dot(**a).total_cmp(&axis.dot(**b)))?;
        let height = heights().fold(f64::NEG_INFINITY, f64::max) - axis.dot(*lowest);
        // Every point goes down to the lower plane along the side of the cone; those within it to the apex.
        let mut feet = vec![*lowest];
        for corner in corners {
            let up = axis.dot(*corner - *lowest);
            let across = *corner - *lowest - up * axis;
            let length = across.length();
            let left = length - up * tangent;
            if left > 0.0 {
                feet.push(*lowest + across * (left / length));
            }
        }
        let (low, high) = box_of(&feet)?;
        // The middle of the box lies off the plane by rounding only.
        let middle = (low + high) / 2.0;
        let middle = middle - axis * axis.dot(middle - *lowest);
        let radius = match rule {
            ConeRule::Corrected => feet.iter().map(|f| f.distance(middle)).fold(0.0, f64::max),
            ConeRule::Printed | ConeRule::Turned => ((high - low) / 2.0).max_element(),
        };
        let upper = radius + height * tangent;
        let below = match rule {
            ConeRule::Corrected => (-radius * tangent).min(height - upper * tangent),
            ConeRule::Printed | ConeRule::Turned => -radius * tangent,
        };
        Some(Self {
            axis,
            sine,
            front_apex: middle + axis * (height + upper * tangent),
            back_apex: middle + axis * below,
            rule,
        })
    }

    /// What an eye sees.
    pub fn side(&self, eye: DVec3) -> ConeSide {
        // An eye in an apex has no direction, and sees no front.
        let front = self.axis.dot((eye - self.front_apex).normalize_or_zero());
        let back = -self.axis.dot((eye - self.back_apex).normalize_or_zero());
        // Rounding must not make a back of what is edge-on.
        let limit = self.sine + 1e-12;
        let [front, back] = [front > limit, back > limit];
        match self.rule {
            ConeRule::Printed if !back => ConeSide::Back,
            ConeRule::Printed if !front => ConeSide::Front,
            ConeRule::Printed => ConeSide::Neutral,
            _ if back => ConeSide::Back,
            _ if front => ConeSide::Front,
            _ => ConeSide::Neutral,
        }
    }
}

/// Eyes that [`ConeTree::count`] looks from.
pub const CULL_EYES: u32 = 1000;

/// Faces that a tree of cones culls.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CullCount {
    /// Faces that turn to the eye: wrongly culled.
    pub wrong: usize,
    /// All of them.
    pub culled: usize,
}

/// A tree over the faces of a surface with a cone in each node, or none.
#[derive(Debug)]
pub struct ConeTree<'s> {
    surface: &'s WeldedSurface,
    nodes: Vec<ConeNode>,
    /// Number of trees: the first nodes have none above them.
    roots: usize,
    /// Distance of an eye from the plane of a face, within which rounding decides on which side it is; model units.
    rounding: f64,
}

#[derive(Debug)]
struct ConeNode {
    faces: Vec<u32>,
    cone: Option<AnchoredCone>,
    /// The first of two halves, which follow each other; 0 for a leaf.
    halves: usize,
}

impl<'s> ConeTree<'s> {
    /// Halves the faces along the longest side of the box around their middles, down to single ones.
    pub fn of_faces(surface: &'s WeldedSurface, rule: ConeRule) -> Self {
        let mut groups = halved_faces(surface);
        let nodes = (groups.par_iter_mut())
            .map(|(faces, halves)| {
                let corners: Vec<DVec3> = faces.iter().flat_map(|&f| surface.corners(f)).collect();
                let normals: Vec<DVec3> = (faces.iter())
                    .map(|&f| surface.normals[f as usize])
                    .collect();
                ConeNode {
                    cone: AnchoredCone::new(&corners, &normals, rule),
                    faces: std::mem::take(faces),
                    halves: *halves,
                }
            })
            .collect();
        Self {
            rounding: 1e-9 * surface.diagonal(),
            surface,
            nodes,
            roots: 1,
        }
    }

    /// A node for each point: [`ConeTree::of_vertex`].
    pub fn of_vertices(surface: &'s WeldedSurface) -> Self {
        let points = 0..surface.points.len() as u32;
        let nodes: Vec<ConeNode> = points.map(|point| vertex_node(surface, point)).collect();
        Self {
            rounding: 1e-9 * surface.diagonal(),
            surface,
            roots: nodes.len(),
            nodes,
        }
    }

    /// A node for the faces around a point, with the cone that the thesis gives a node of one vertex: of no width, around the mean
    /// normal.
    pub fn of_vertex(surface: &'s WeldedSurface, point: u32) -> Self {
        Self {
            rounding: 1e-9 * surface.diagonal(),
            surface,
            roots: 1,
            nodes: vec![vertex_node(surface, point)],
        }
    }

    /// Faces of nodes that show their backs to an eye, from the roots down; in the order of nodes, once a node.
    pub fn culled(&self, eye: DVec3) -> Vec<u32> {
        let mut open: Vec<usize> = (0..self.roots.min(self.nodes.len())).rev().collect();
        let mut culled = Vec::new();
        while let Some(at) = open.pop() {
            let node = &self.nodes[at];
            if node
                .cone
                .is_some_and(|cone| cone.side(eye) == ConeSide::Back)
            {
                culled.extend_from_slice(&node.faces);
            } else if node.halves != 0 {
                open.extend([node.halves + 1, node.halves]);
            }
        }
        culled
    }

    /// Tells whether a face shows its front to an eye, by more than rounding.
    pub fn is_seen(&self, face: u32, eye: DVec3) -> bool {
        let from_face = eye - self.surface.corners(face)[0];
        self.surface.normals[face as usize].dot(from_face) > self.rounding
    }

    /// Counts faces from [`CULL_EYES`] eyes around and within the surface. Takes time in proportion to eyes times faces. Once
    /// `progress` is cancelled the eyes that are left count as nothing.
    pub fn count(&self, progress: &dyn Progress) -> CullCount {
        let of_eye = |k: u32| {
            if progress.is_cancelled() {
                return [0; 2];
            }
            let eye = cull_eye(self.surface, k);
            let culled = self.culled(eye);
            [
                culled.iter().filter(|&&f| self.is_seen(f, eye)).count(),
                culled.len(),
            ]
        };
        let counts: Vec<[usize; 2]> = (0..CULL_EYES).into_par_iter().map(of_eye).collect();
        CullCount {
            wrong: counts.iter().map(|count| count[0]).sum(),
            culled: counts.iter().map(|count| count[1]).sum(),
        }
    }
}

fn vertex_node(surface: &WeldedSurface, point: u32) -> ConeNode {
    ConeNode {
        faces: surface.incident(point).to_vec(),
        cone: AnchoredCone::new(
            &[surface.points[point as usize]],
            &[normal_of(surface, point, FaceWeight::Equal)],
            ConeRule::Corrected,
        ),
        halves: 0,
    }
}

/// One of [`CULL_EYES`] eyes: in even directions, from within the sphere around a surface to three times its radius.
pub fn cull_eye(surface: &WeldedSurface, k: u32) -> DVec3 {
    let radius = surface.diagonal() / 2.0;
    let center = surface.points.iter().sum::<DVec3>() / surface.points.len().max(1) as f64;
    let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(CULL_EYES);
    let turn = f64::from(k) * 2.399_963_229_728_653;
    let across = (1.0 - z * z).sqrt();
    let distance = radius * (0.3 + 2.7 * (f64::from(k) * 0.618_034 % 1.0));
    center + distance * DVec3::new(across * turn.cos(), across * turn.sin(), z)
}

/// Faces of every node of a tree that halves them along the longest side, down to single ones, and where its halves are.
fn halved_faces(surface: &WeldedSurface) -> Vec<(Vec<u32>, usize)> {
    let mut nodes = vec![((0..surface.faces.len() as u32).collect::<Vec<u32>>(), 0)];
    let mut next = 0;
    while next < nodes.len() {
        let mut faces = nodes[next].0.clone();
        next += 1;
        if faces.len() < 2 {
            continue;
        }
        let middle = |face: u32| surface.corners(face).iter().sum::<DVec3>();
        let middles: Vec<DVec3> = faces.iter().map(|&f| middle(f)).collect();
        let Some((low, high)) = box_of(&middles) else {
            continue;
        };
        let size = high - low;
        let axis = (0..3)
            .max_by(|&a, &b| size[a].total_cmp(&size[b]))
            .unwrap_or(0);
        faces.sort_by(|&a, &b| middle(a)[axis].total_cmp(&middle(b)[axis]));
        let rest = faces.split_off(faces.len() / 2);
        nodes[next - 1].1 = nodes.len();
        nodes.extend([(faces, 0), (rest, 0)]);
    }
    nodes
}

/// Smallest and largest coordinates; `None` of no points.
fn box_of(points: &[DVec3]) -> Option<(DVec3, DVec3)> {
    let first = points.first()?;
    Some((points.iter()).fold((*first, *first), |(low, high), &p| {
        (low.min(p), high.max(p))
    }))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;
    use crate::mesh::Mesh;
    use crate::oriented::shapes::{cube, grid, l_shape};
    use crate::progress::SilentProgress;
    use glam::Vec3;

    fn torus() -> Mesh {
        let n = 24;
        let mut mesh = grid(n, |_, _| 0.0);
        for p in &mut mesh.positions {
            let (u, v) = (
                p.x / n as f32 * std::f32::consts::TAU,
                p.y / n as f32 * std::f32::consts::TAU,
            );
            let across = 1.0 + 0.4 * v.cos();
            *p = Vec3::new(across * u.cos(), across * u.sin(), 0.4 * v.sin());
        }
        mesh
    }

    fn culls(mesh: &Mesh, rule: ConeRule) -> [usize; 2] {
        let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
        let CullCount { wrong, culled } = ConeTree::of_faces(&surface, rule).count(&SilentProgress);
        [wrong, culled]
    }

    #[test]
    fn his_tests_cull_what_is_seen_and_ours_does_not() {
        let bumps = grid(20, |x, y| (x * 0.9).sin() * (y * 0.7).cos() * 2.0);
        for (mesh, name) in [
            (cube(), "cube"),
            (torus(), "torus"),
            (l_shape(), "L"),
            (bumps, "bumps"),
        ] {
            let [wrong, culled] = culls(&mesh, ConeRule::Corrected);
            assert!(wrong == 0 && culled > 1000, "{name}: {wrong} of {culled}");
            let [printed, _] = culls(&mesh, ConeRule::Printed);
            assert!(printed > 1000, "{name}: {printed}");
        }
        // With the inequality turned round the wide cones stay wrong.
        let steep = grid(20, |x, y| (x * 0.9).sin() * (y * 0.7).cos() * 6.0);
        assert!(culls(&steep, ConeRule::Turned)[0] > 0);
        assert_eq!(culls(&steep, ConeRule::Corrected)[0], 0);
    }

    #[test]
    fn a_vertex_normal_culls_a_face_that_is_seen() {
        // F9: the corner of a cube by its mean normal, seen along a face.
        let corner = DVec3::splat(0.5);
        let eye = DVec3::new(3.0, -2.9, -2.9);
        let mean = [DVec3::ONE.normalize()];
        let by_vertex = AnchoredCone::new(&[corner], &mean, ConeRule::Corrected).unwrap();
        assert_eq!(by_vertex.side(eye), ConeSide::Back);
        let corners = [
            corner,
            DVec3::new(0.5, -0.5, 0.5),
            DVec3::new(-0.5, 0.5, 0.5),
            DVec3::new(0.5, 0.5, -0.5),
        ];
        let faces = [DVec3::X, DVec3::Y, DVec3::Z];
        let mesh = cube();
        let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
        let tree = ConeTree::of_vertices(&surface);
        assert!(tree.culled(eye).iter().any(|&face| tree.is_seen(face, eye)));
        let tree = ConeTree::of_faces(&surface, ConeRule::Corrected);
        assert!(!tree.culled(eye).iter().any(|&face| tree.is_seen(face, eye)));
        let by_faces = AnchoredCone::new(&corners, &faces, ConeRule::Corrected).unwrap();
        assert_eq!(by_faces.side(eye), ConeSide::Neutral);
        assert_eq!(by_faces.side(DVec3::splat(9.0)), ConeSide::Front);
        assert_eq!(by_faces.side(DVec3::splat(-9.0)), ConeSide::Back);
    }

    #[test]
    fn no_node_shows_its_back_where_a_face_is_seen() {
        // Nodes below one that is culled count too.
        let steep = grid(8, |x, y| (x * 0.9).sin() * (y * 0.7).cos() * 6.0);
        for mesh in [cube(), l_shape(), steep] {
            let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
            let tree = ConeTree::of_faces(&surface, ConeRule::Corrected);
            let mut backs = 0;
            for eye in (0..CULL_EYES).step_by(4).map(|k| cull_eye(&surface, k)) {
                for node in &tree.nodes {
                    if node
                        .cone
                        .is_some_and(|cone| cone.side(eye) == ConeSide::Back)
                    {
                        backs += 1;
                        assert!(!node.faces.iter().any(|&face| tree.is_seen(face, eye)));
                    }
                }
            }
            assert!(backs > 1000, "{backs}");
        }
    }

    #[test]
    fn a_tree_halves_all_faces_and_culls_what_lies_below() {
        let mesh = torus();
        let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
        let count = surface.faces.len();
        let tree = ConeTree::of_faces(&surface, ConeRule::Corrected);
        assert_eq!(tree.nodes.len(), 2 * count - 1);
        for node in tree.nodes.iter().filter(|node| node.halves != 0) {
            let halves = [node.halves, node.halves + 1].map(|half| &tree.nodes[half].faces);
            let mut both = [&halves[0][..], &halves[1][..]].concat();
            let mut own = node.faces.clone();
            both.sort_unstable();
            own.sort_unstable();
            assert_eq!(both, own);
        }
        // From afar above, the lower half shows its back: each face at most once.
        let mut culled = tree.culled(DVec3::Z * 1e6);
        let all = culled.len();
        culled.sort_unstable();
        culled.dedup();
        assert_eq!(culled.len(), all);
        assert!(
            (count * 2 / 5..=count / 2).contains(&all),
            "{all} of {count}"
        );
        let none = WeldedSurface::default();
        let tree = ConeTree::of_faces(&none, ConeRule::Corrected);
        assert_eq!(tree.count(&SilentProgress), CullCount::default());
        assert_eq!(
            ConeTree::of_vertices(&none).count(&SilentProgress),
            CullCount::default()
        );
    }

    #[test]
    fn what_turns_everywhere_has_no_cone() {
        let cone =
            |normals: &[DVec3]| AnchoredCone::new(&[DVec3::ZERO], normals, ConeRule::Corrected);
        assert!(cone(&[DVec3::X, -DVec3::X]).is_none());
        assert!(cone(&[]).is_none());
        // Around a circle, and more than a quarter turn from the mean although that has a direction.
        let turned = |degrees: f64| {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            DVec3::new(cosine, sine, 0.0)
        };
        assert!(cone(&[120.0, 0.0, -120.0].map(turned)).is_none());
        assert!(cone(&[90.0, 0.0, -90.0].map(turned)).is_none());
        assert!(cone(&[85.0, 0.0, -85.0].map(turned)).is_some());
        assert!(AnchoredCone::new(&[], &[DVec3::X], ConeRule::Corrected).is_none());
    }
}
