//! Levels of detail of splats from vertices (Dietz, section 3.4): a tree over the points, halved at the median along the longest
//! side of their box. What of it is small on the picture is one disc that faces the eye; a leaf is the splats of its points
//! and the triangles that they own.
//!
//! His spheres reach to the corners of boxes around points, so that leaves have none and discs stick out. Ours contain all
//! that is drawn below them: where a node takes the place of that, no pixel is bare that was covered.

use crate::abi::OrientedPolygon;
use crate::math::camera::View;
use crate::math::frustum::Frustum;
use crate::oriented::look::VertexLook;
use crate::oriented::splats::SplatSet;
use crate::oriented::surface::WeldedSurface;
use crate::pack::polygons::PlaneFrame;
use glam::{DVec3, Vec3};

/// Points nearer to each other than this part of the model's diagonal are one leaf.
const LEAST_EXTENT: f64 = 1e-6;

/// By how much spheres are larger than they have to be, for rounding.
const SPHERE_MARGIN: f64 = 1e-5;

/// A tree over the points of a surface.
#[derive(Debug, Default)]
pub struct SplatLevels {
    nodes: Vec<LevelNode>,
    /// Points as leaves have them.
    order: Vec<u32>,
    /// Triangles beside splats, by the point that owns each, and where those of each point begin.
    triangles: Vec<u32>,
    first_triangle: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct LevelNode {
    center: DVec3,
    radius: f64,
    /// Mean of unit normals: the shorter, the rougher.
    normal: Vec3,
    color: [u8; 4],
    first: u32,
    count: u32,
    /// The first of two halves that follow each other; 0 for a leaf.
    halves: u32,
}

/// A point with what it draws.
#[derive(Debug, Clone, Copy, Default)]
struct LevelPoint {
    at: DVec3,
    /// Radius of the sphere around it that contains that.
    reach: f64,
    area: f64,
    normal: DVec3,
    color: DVec3,
}

/// Splats and triangles that a view needs of the tree.
#[derive(Debug, Default)]
pub struct LevelCut {
    /// Splats of points, and discs of nodes.
    pub polygons: Vec<OrientedPolygon>,
    /// Triangles beside them, ascending.
    pub triangles: Vec<u32>,
    /// Number of polygons that are discs of nodes.
    pub node_count: usize,
    open: Vec<u32>,
}

impl SplatLevels {
    /// The tree of the points that draw anything. Takes time n log n.
    pub fn new(surface: &WeldedSurface, looks: &[VertexLook], set: &SplatSet) -> Self {
        let mut points = points_of(surface, looks, set);
        let (triangles, first_triangle) = owned_triangles(surface, set, &mut points);
        let order = (0..points.len() as u32).filter(|&p| points[p as usize].reach > 0.0);
        let mut levels = Self {
            nodes: Vec::new(),
            order: order.collect(),
            triangles,
            first_triangle,
        };
        if levels.order.is_empty() {
            return levels;
        }
        let least = LEAST_EXTENT * surface.diagonal();
        levels.push_node(&points, 0, levels.order.len());
        let mut next = 0;
        while next < levels.nodes.len() {
            levels.divide(next, &points, least);
            next += 1;
        }
        levels
    }

    fn push_node(&mut self, points: &[LevelPoint], first: usize, count: usize) {
        let own = || {
            self.order[first..first + count]
                .iter()
                .map(|&p| &points[p as usize])
        };
        let (low, high) = own().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
            (low.min(p.at - p.reach), high.max(p.at + p.reach))
        });
        let center = (low + high) / 2.0;
        let radius = own()
            .map(|p| center.distance(p.at) + p.reach)
            .fold(0.0, f64::max);
        let area: f64 = own().map(|p| p.area).sum();
        let mean = |sum: DVec3| sum / area.max(f64::MIN_POSITIVE);
        let normal = mean(own().map(|p| p.normal * p.area).sum());
        let [r, g, b] = mean(own().map(|p| p.color * p.area).sum())
            .round()
            .as_u8vec3()
            .to_array();
        self.nodes.push(LevelNode {
            center,
            radius: radius * (1.0 + SPHERE_MARGIN),
            normal: normal.as_vec3(),
            color: [r, g, b, 255],
            first: first as u32,
            count: count as u32,
            halves: 0,
        });
    }

    fn divide(&mut self, at: usize, points: &[LevelPoint], least: f64) {
        let LevelNode { first, count, .. } = self.nodes[at];
        let (first, count) = (first as usize, count as usize);
        let own = &mut self.order[first..first + count];
        let (low, high) = (own.iter().map(|&p| points[p as usize].at))
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
                (low.min(p), high.max(p))
            });
        let size = high - low;
        let axis = (0..3)
            .max_by(|&a, &b| size[a].total_cmp(&size[b]))
            .unwrap_or(0);
        if count < 2 || size[axis] <= least {
            return;
        }
        let key = |p: &u32| points[*p as usize].at[axis];
        let half = count / 2;
        own.select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
        self.nodes[at].halves = self.nodes.len() as u32;
        self.push_node(points, first, half);
        self.push_node(points, first + half, count - half);
    }

    /// Selects what a view needs: nodes of at most `threshold_px` projected diameter as one disc each, and what is drawn of the leaves
    /// above that, without what lies beside the picture.
    pub fn select(&self, set: &SplatSet, view: &View, threshold_px: f32, cut: &mut LevelCut) {
        cut.polygons.clear();
        cut.triangles.clear();
        cut.open.clear();
        cut.node_count = 0;
        if !self.nodes.is_empty() {
            cut.open.push(0);
        }
        let frustum = Frustum::new(view, 1.0);
        while let Some(at) = cut.open.pop() {
            let node = &self.nodes[at as usize];
            if frustum.is_outside(node.center.as_vec3(), node.radius as f32) {
                continue;
            }
            if diameter_px(node, view) <= f64::from(threshold_px) {
                if let Some(disc) = disc_of(node, view) {
                    cut.polygons.push(disc);
                    cut.node_count += 1;
                }
                continue;
            }
            if node.halves != 0 {
                cut.open.extend([node.halves + 1, node.halves]);
                continue;
            }
            for &point in &self.order[node.first as usize..][..node.count as usize] {
                cut.polygons.extend_from_slice(set.splats_of_point(point));
                let [from, to] =
                    [point, point + 1].map(|p| self.first_triangle[p as usize] as usize);
                cut.triangles.extend_from_slice(&self.triangles[from..to]);
            }
        }
        cut.triangles.sort_unstable();
    }
}

/// Points with the splats of each and without triangles.
fn points_of(surface: &WeldedSurface, looks: &[VertexLook], set: &SplatSet) -> Vec<LevelPoint> {
    let mut points: Vec<LevelPoint> = (surface.points.iter().enumerate())
        .map(|(point, &at)| {
            let reach = |splat: &OrientedPolygon| {
                let far = (splat.footprint().iter())
                    .map(|&[u, v]| f64::from(u).hypot(v.into()))
                    .fold(0.0, f64::max);
                far.min(splat.round_radius.into()) + splat.center.as_dvec3().distance(at)
            };
            let splats = set.splats_of_point(point as u32);
            LevelPoint {
                at,
                reach: splats.iter().map(reach).fold(0.0, f64::max),
                ..LevelPoint::default()
            }
        })
        .collect();
    for (face, corners) in surface.faces.iter().enumerate() {
        let area = surface.areas[face];
        for (k, &corner) in corners.iter().enumerate() {
            let vertex = surface.vertices_of_face[face][k] as usize;
            let look = looks.get(vertex).copied().unwrap_or_default();
            let [r, g, b, _] = look.color;
            let point = &mut points[corner as usize];
            point.area += area;
            point.color += DVec3::new(r.into(), g.into(), b.into()) * area;
            point.normal += area
                * match look.normal {
                    DVec3::ZERO => surface.normals[face],
                    normal => normal,
                };
        }
    }
    for point in points.iter_mut().filter(|point| point.area > 0.0) {
        point.color /= point.area;
        point.normal = point.normal.normalize_or_zero();
    }
    points
}

/// Triangles beside splats in the order of the points that own them, each once: the first of its corners. Grows the reach of
/// those.
fn owned_triangles(
    surface: &WeldedSurface,
    set: &SplatSet,
    points: &mut [LevelPoint],
) -> (Vec<u32>, Vec<u32>) {
    let mut owned: Vec<(u32, u32)> = Vec::with_capacity(set.triangles.len());
    for (face, &triangle) in surface.triangle_of_face.iter().enumerate() {
        if set.triangles.binary_search(&triangle).is_ok() {
            let owner = surface.faces[face][0];
            owned.push((owner, triangle));
            let point = &mut points[owner as usize];
            for corner in surface.corners(face as u32) {
                point.reach = point.reach.max(point.at.distance(corner));
            }
        }
    }
    owned.sort_unstable();
    let first = (0..=points.len() as u32)
        .map(|point| owned.partition_point(|&(owner, _)| owner < point) as u32)
        .collect();
    let triangles = owned.into_iter().map(|(_, triangle)| triangle).collect();
    (triangles, first)
}

/// Projected diameter of a node's sphere in the middle of the picture; infinite where it reaches the eye.
fn diameter_px(node: &LevelNode, view: &View) -> f64 {
    let radius = node.radius * f64::from(view.model_scale);
    let focal = f64::from(view.focal_px());
    if !view.is_perspective {
        return 2.0 * focal * radius;
    }
    let distance = f64::from(view.distance(node.center.as_vec3()));
    match distance * distance - radius * radius {
        square if distance > 0.0 && square > 0.0 => 2.0 * focal * radius / square.sqrt(),
        _ => f64::INFINITY,
    }
}

/// The disc that stands for a node: it faces the eye, and hides what the sphere does.
fn disc_of(node: &LevelNode, view: &View) -> Option<OrientedPolygon> {
    let towards = if view.is_perspective {
        view.eye.as_dvec3() - node.center
    } else {
        view.backward.as_dvec3()
    };
    let frame = PlaneFrame::new(node.center, towards)?;
    let mut disc = OrientedPolygon::disc(&frame, node.radius, &[], node.color)?;
    // Where normals cancel the surface is as dark as it is rough, but not black.
    disc.shading_normal = match node.normal.length() {
        length if length > 1e-3 => node.normal,
        _ => 1e-3 * frame.normal.as_vec3(),
    };
    Some(disc)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;
    use crate::math::camera::Camera;
    use crate::oriented::shapes::{cube, grid};
    use crate::oriented::splats::{SplatRules, splats_of};

    fn view(distance: f64) -> View {
        let eye = DVec3::new(0.3, 0.2, 1.0).normalize() * distance;
        let camera = Camera::look_at(
            (200, 200),
            eye,
            DVec3::ZERO,
            DVec3::Y,
            1.0,
            [0.01 * distance, 4.0 * distance],
        );
        camera.view(DVec3::ZERO).unwrap()
    }

    #[test]
    fn spheres_contain_all_that_is_drawn_below_them() {
        let bumps = grid(16, |x, y| (x * 0.9).sin() * (y * 0.7).cos() * 2.0);
        for mesh in [cube(), bumps] {
            let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
            for degrees in [3.0_f64, 20.0] {
                let rules = SplatRules {
                    clip: Some(degrees.to_radians()),
                    ..SplatRules::default()
                };
                let set = splats_of(&surface, &[], &rules);
                let levels = SplatLevels::new(&surface, &[], &set);
                for node in &levels.nodes {
                    for &point in &levels.order[node.first as usize..][..node.count as usize] {
                        for splat in set.splats_of_point(point) {
                            for &[u, v] in splat.footprint() {
                                let uv = glam::Vec2::new(u, v);
                                let uv = uv.clamp_length_max(splat.round_radius).to_array();
                                let far = splat.point(uv).as_dvec3().distance(node.center);
                                assert!(far <= node.radius, "{far} {}", node.radius);
                            }
                        }
                    }
                }
                let owned: usize = levels.triangles.len();
                assert_eq!(owned, set.triangles.len());
            }
        }
    }

    #[test]
    fn near_all_is_drawn_and_from_far_one_disc() {
        let mesh = cube();
        let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
        let rules = SplatRules {
            clip: Some(0.1),
            ..SplatRules::default()
        };
        let set = splats_of(&surface, &[], &rules);
        let levels = SplatLevels::new(&surface, &[], &set);
        let mut cut = LevelCut::default();
        levels.select(&set, &view(3.0), 1.0, &mut cut);
        assert_eq!((cut.polygons.len(), cut.node_count), (set.splats.len(), 0));
        assert_eq!(cut.triangles, set.triangles);
        levels.select(&set, &view(3000.0), 1.0, &mut cut);
        assert_eq!((cut.polygons.len(), cut.node_count), (1, 1));
        let disc = &cut.polygons[0];
        assert!(disc.round_radius >= 3f32.sqrt() / 2.0);
        assert!(cut.triangles.is_empty());
        // Behind the eye nothing is.
        let mut behind = view(3.0);
        behind.view_from_model.z_axis.z *= -1.0;
        behind.view_from_model.w_axis.z *= -1.0;
        levels.select(&set, &behind, 1.0, &mut cut);
        assert!(cut.polygons.is_empty());
    }

    #[test]
    fn a_surface_without_splats_has_no_levels() {
        let surface = WeldedSurface::default();
        let set = splats_of(&surface, &[], &SplatRules::default());
        let levels = SplatLevels::new(&surface, &[], &set);
        let mut cut = LevelCut::default();
        levels.select(&set, &view(1.0), 1.0, &mut cut);
        assert!(cut.polygons.is_empty() && cut.triangles.is_empty());
    }
}
