//! Walks over a model and tests every promise that the cut and the renderer rely on:
//!
//! * counts and links agree, and every leaf lies below exactly one node of each level;
//! * each sphere contains the children's spheres, each leaf's sphere its triangle's corners;
//! * each cone contains the geometric normals below and the children's cones;
//! * each capsule contains the corners below, and no splat radius exceeds the bounding radius;
//! * no corner below is farther along a node's mean normal than its thickness;
//! * areas are sums of the children's, moments the means over what lies below; box and orbit enclose the used vertices.

use super::{Model, Node, NodeAttributes, NodeStrip, NormalCone, Tree, moments, summary};
use crate::math::octahedral;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::fmt;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// How far a child's sphere may stick out, relative to the parent's radius.
const SPHERE_TOLERANCE: f64 = 1e-5;
/// How far a corner may stick out of a capsule, relative to the sphere's radius.
const STRIP_TOLERANCE: f64 = 1e-5;
/// What roundings of numbers below the normal ones may add to any length, model units.
const SMALLEST: f64 = f32::MIN_POSITIVE as f64;
/// How far, in radians, a normal may lie outside of a cone.
const CONE_TOLERANCE: f64 = 1e-6;
/// How much farther than the stored thickness a corner may lie, relative to the splat radius, beside the promised
/// tolerance.
const THICKNESS_TOLERANCE: f64 = 1e-5;
/// Violations that are written out.
const LISTED: usize = 50;

/// What is wrong with a model; nothing if `count` is 0.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CheckReport {
    /// The first violations found (at most 50), each a sentence with the nodes' numbers, sorted.
    pub violations: Vec<String>,
    /// Number of all violations.
    pub count: u64,
}

impl CheckReport {
    /// Tells whether every promise holds.
    pub fn is_clean(&self) -> bool {
        self.count == 0
    }
}

impl fmt::Display for CheckReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_clean() {
            return write!(f, "no violations");
        }
        writeln!(f, "{} violations", self.count)?;
        for line in &self.violations {
            writeln!(f, "  {line}")?;
        }
        if self.count > self.violations.len() as u64 {
            writeln!(
                f,
                "  and {} more",
                self.count - self.violations.len() as u64
            )?;
        }
        Ok(())
    }
}

/// Collects violations from all threads.
#[derive(Default)]
struct ViolationSink {
    count: AtomicU64,
    lines: Mutex<Vec<String>>,
}

impl ViolationSink {
    fn report(&self, line: impl FnOnce() -> String) {
        if self.count.fetch_add(1, Ordering::Relaxed) < LISTED as u64
            && let Ok(mut lines) = self.lines.lock()
        {
            lines.push(line());
        }
    }

    fn finish(self) -> CheckReport {
        let mut violations = self.lines.into_inner().unwrap_or_default();
        violations.sort();
        CheckReport {
            violations,
            count: self.count.into_inner(),
        }
    }
}

/// Tests a model, in parallel, O(n log n):
///
/// * the links: counts, ranges, parents and children agree, every leaf is below exactly one node of each level;
/// * S1 to S3: a sphere contains the children's spheres, a leaf's its corners, so the root's the model;
/// * C1, C2: a cone contains the geometric normals below and the children's cones;
/// * a capsule contains the corners below; a splat's radius is at most the bounding radius;
/// * no corner below, and no disc of a point, is farther along the mean normal than the thickness says;
/// * areas are the sums of the children's, moments those of the triangles below; box and orbit enclose the used vertices.
///
/// The rest is only looked at when the links hold.
pub fn check(model: &Model) -> CheckReport {
    let sink = ViolationSink::default();
    if let Err(what) = links(model) {
        sink.report(|| what);
        return sink.finish();
    }
    let tree = &model.tree;
    for (index, vertex) in model.vertices[..model.used_vertices as usize]
        .iter()
        .enumerate()
    {
        let p = vertex.position;
        if p.cmplt(model.min).any() || p.cmpgt(model.max).any() {
            sink.report(|| format!("vertex {index} lies outside of the model's box"));
        }
        let reach = f64::from(model.orbit_radius) * (1.0 + 1e-5) + SMALLEST;
        if p.as_dvec3().distance(model.orbit_center.as_dvec3()) > reach {
            sink.report(|| format!("vertex {index} lies outside of the orbit's sphere"));
        }
    }
    (0..tree.nodes.len())
        .into_par_iter()
        .with_min_len(256)
        .for_each(|index| check_node(model, index as u32, &sink));
    // Made again, the same bits: nothing in them depends on threads.
    for (id, (own, expected)) in tree
        .moments
        .iter()
        .zip(&moments::compute(model))
        .enumerate()
    {
        if own != expected {
            sink.report(|| format!("node {id}: moments that are not those of what lies below"));
        }
    }
    (0..tree.leaves.len())
        .into_par_iter()
        .with_min_len(1024)
        .for_each(|leaf| check_leaf(model, leaf as u32, &sink));
    sink.finish()
}

/// Tells whether all counts and indices of a model agree, so that no walk over it can leave an array. The first fault in words.
///
/// # Errors
///
/// The fault.
pub fn links(model: &Model) -> Result<(), String> {
    let tree = &model.tree;
    let (nodes, leaves, vertices) = (tree.nodes.len(), tree.leaves.len(), model.vertices.len());
    let expect = |holds: bool, what: &str| if holds { Ok(()) } else { Err(what.to_owned()) };
    for (count, what) in [(nodes, "nodes"), (leaves, "leaves"), (vertices, "vertices")] {
        expect(count < u32::MAX as usize, &format!("too many {what}"))?;
    }
    let used = model.used_vertices as usize;
    expect(used <= vertices, "more used vertices than vertices")?;
    if !model.kind().is_surface() {
        expect(
            used == leaves,
            "a cloud without one leaf for each used vertex",
        )?;
    } else {
        expect(
            model.triangles.len() == leaves,
            "not one leaf for each triangle",
        )?;
    }
    if let Some(index) = model
        .triangles
        .par_iter()
        .position_first(|t| t.iter().any(|&corner| corner as usize >= used))
    {
        return Err(format!(
            "triangle {index} names a vertex that is not among the used ones"
        ));
    }
    expect(
        tree.attributes.len() == nodes,
        "not one attribute record for each node",
    )?;
    expect(tree.parents.len() == nodes, "not one parent for each node")?;
    expect(
        tree.first_leaf.len() == nodes,
        "not one first leaf for each node",
    )?;
    expect(
        tree.moments.len() == nodes,
        "not one record of moments for each node",
    )?;
    expect(
        (nodes == 0) == (leaves < 2),
        "nodes without leaves, or leaves without nodes",
    )?;
    expect(
        tree.level_starts.first() == Some(&0),
        "level starts that do not begin with 0",
    )?;
    expect(
        tree.level_starts.last() == Some(&(nodes as u32)),
        "level starts that do not end with the node count",
    )?;
    expect(
        tree.level_starts.windows(2).all(|w| w[0] < w[1]),
        "an empty level",
    )?;
    if nodes == 0 {
        return Ok(());
    }
    expect(tree.level_starts[1] == 1, "more than one root")?;
    expect(
        tree.parents[0] == 0 && tree.first_leaf[0] == 0,
        "a root with a parent or a later first leaf",
    )?;
    for level in 0..tree.level_count() {
        let is_last = level + 1 == tree.level_count();
        // Children follow one another without a gap: each is the child of exactly one node.
        let (mut next, end) = if is_last {
            (0, leaves as u32)
        } else {
            let below = tree.level(level + 1);
            (below.start, below.end)
        };
        for id in tree.level(level) {
            let node = &tree.nodes[id as usize];
            let fault = |what: &str| Err(format!("node {id}: {what}"));
            if node.has_leaves() != is_last {
                return fault(
                    "leaves as children above the last level, or nodes as children of the last",
                );
            }
            if !(2..=4).contains(&node.child_count) {
                return fault("fewer than 2 or more than 4 children");
            }
            let first_of_child = |child: u32| {
                if is_last {
                    child
                } else {
                    tree.first_leaf[child as usize]
                }
            };
            if node.first_child != next || end - next < u32::from(node.child_count) {
                return fault("children that are not next in order");
            }
            if tree.first_leaf[id as usize] != first_of_child(next) {
                return fault("a first leaf that is not that of the first child");
            }
            next += u32::from(node.child_count);
            if !is_last
                && tree.parents[node.first_child as usize..next as usize]
                    .iter()
                    .any(|&parent| parent != id)
            {
                return fault("a child with another parent");
            }
        }
        if next != end {
            return Err(format!("level {level} leaves out some children"));
        }
        let starts =
            &tree.first_leaf[tree.level(level).start as usize..tree.level(level).end as usize];
        if starts.windows(2).any(|w| w[0] >= w[1]) {
            return Err(format!("level {level} has leaves out of order"));
        }
    }
    let is_sound = |center: Vec3, radius: f32| center.is_finite() && radius >= 0.0;
    if let Some(index) = tree
        .nodes
        .par_iter()
        .position_first(|node| !is_sound(node.center, node.radius))
    {
        return Err(format!("node {index}: a sphere that is none"));
    }
    if let Some(index) = tree
        .leaves
        .par_iter()
        .position_first(|leaf| !is_sound(leaf.center, leaf.radius))
    {
        return Err(format!("leaf {index}: a sphere that is none"));
    }
    Ok(())
}

fn check_node(model: &Model, id: u32, sink: &ViolationSink) {
    let tree = &model.tree;
    let node = &tree.nodes[id as usize];
    let attributes = &tree.attributes[id as usize];
    let mut area = 0.0;
    for child in tree.children(id) {
        let (center, radius) = if node.has_leaves() {
            let leaf = &tree.leaves[child as usize];
            (leaf.center, leaf.radius)
        } else {
            let below = &tree.nodes[child as usize];
            area += f64::from(tree.attributes[child as usize].area);
            if !contains_cone(&node.cone, &below.cone) {
                sink.report(|| {
                    format!("node {id}: the cone does not contain that of child {child}")
                });
            }
            (below.center, below.radius)
        };
        if !contains_ball(node, center, radius) {
            sink.report(|| format!("node {id}: the sphere does not contain that of child {child}"));
        }
    }
    let own = f64::from(attributes.area);
    if !node.has_leaves() && (own - area).abs() > 1e-5 * own.max(area) {
        sink.report(|| format!("node {id}: the area is not the sum of the children's"));
    }
    if !(attributes.splat_radius >= 0.0 && attributes.splat_radius <= node.radius) {
        sink.report(|| format!("node {id}: a splat radius outside of 0 to the bounding radius"));
    }
}

fn check_leaf(model: &Model, leaf: u32, sink: &ViolationSink) {
    let tree = &model.tree;
    let sphere = &tree.leaves[leaf as usize];
    let Some(triangle) = model.triangles.get(leaf as usize) else {
        if model.vertices[leaf as usize].position != sphere.center {
            sink.report(|| format!("leaf {leaf}: its sphere is not around its point"));
        }
        let vertex = &model.vertices[leaf as usize];
        let disc = (vertex.color[3] != 0).then(|| octahedral::decode(vertex.normal).as_dvec3());
        each_ancestor(tree, leaf, |id| {
            let reach = |normal: DVec3| match disc {
                Some(own) => own.cross(normal).length() * f64::from(sphere.radius),
                None => f64::from(sphere.radius),
            };
            if !is_within_thickness(tree, id, &[sphere.center], reach) {
                sink.report(|| format!("node {id}: leaf {leaf} is thicker"));
            }
        });
        return;
    };
    let corners = triangle.map(|corner| model.vertices[corner as usize].position);
    let radius = f64::from(sphere.radius);
    if corners.iter().any(|p| {
        p.as_dvec3().distance(sphere.center.as_dvec3()) > radius * (1.0 + 1e-12) + SMALLEST
    }) {
        sink.report(|| format!("leaf {leaf}: the sphere does not contain the triangle"));
    }
    let (normal, _) = summary::geometric_normal(corners);
    each_ancestor(tree, leaf, |id| {
        let node = &tree.nodes[id as usize];
        if normal != DVec3::ZERO && !contains_normal(&node.cone, normal) {
            sink.report(|| {
                format!("node {id}: the cone does not contain the normal of leaf {leaf}")
            });
        }
        if corners.iter().any(|&corner| !contains_point(node, corner)) {
            sink.report(|| format!("node {id}: the capsule does not contain leaf {leaf}"));
        }
        if !is_within_thickness(tree, id, &corners, |_| 0.0) {
            sink.report(|| format!("node {id}: leaf {leaf} is thicker"));
        }
    });
}

/// Calls `visit` with every node above a leaf, the lowest first.
fn each_ancestor(tree: &Tree, leaf: u32, mut visit: impl FnMut(u32)) {
    let Some(mut id) = tree.parent_of_leaf(leaf) else {
        return;
    };
    loop {
        visit(id);
        if id == 0 {
            break;
        }
        id = tree.parents[id as usize];
    }
}

/// Tells whether points, with what reaches beyond them along the node's normal, lie within its thickness.
fn is_within_thickness(
    tree: &Tree,
    id: u32,
    points: &[Vec3],
    reach: impl Fn(DVec3) -> f64,
) -> bool {
    let (node, attributes) = (&tree.nodes[id as usize], &tree.attributes[id as usize]);
    if !attributes.has_normal() {
        return true;
    }
    let normal = attributes.normal().as_dvec3();
    let half = f64::from(attributes.half_thickness());
    let tolerance = f64::from(NodeAttributes::THICKNESS_TOLERANCE) + THICKNESS_TOLERANCE;
    let most = half + tolerance * f64::from(attributes.splat_radius) + SMALLEST;
    let beyond = reach(normal);
    points.iter().all(|point| {
        let offset = point.as_dvec3() - node.center.as_dvec3();
        offset.dot(normal).abs() + beyond <= most
    })
}

fn contains_ball(node: &Node, center: Vec3, radius: f32) -> bool {
    let distance = node.center.as_dvec3().distance(center.as_dvec3());
    distance + f64::from(radius) <= f64::from(node.radius) * (1.0 + SPHERE_TOLERANCE) + SMALLEST
}

/// Half angle and unit axis.
fn angles(cone: &NormalCone) -> (DVec3, f64) {
    let sin = f64::from(cone.sin_half_angle) / 65535.0;
    (cone.axis().as_dvec3().normalize_or_zero(), sin.asin())
}

fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

fn contains_cone(outer: &NormalCone, inner: &NormalCone) -> bool {
    if outer.sin_half_angle == NormalCone::NEVER {
        return true;
    }
    if inner.sin_half_angle == NormalCone::NEVER {
        return false;
    }
    let ((outer_axis, outer_half), (inner_axis, inner_half)) = (angles(outer), angles(inner));
    outer == inner || angle(outer_axis, inner_axis) + inner_half <= outer_half + CONE_TOLERANCE
}

fn contains_normal(cone: &NormalCone, normal: DVec3) -> bool {
    if cone.sin_half_angle == NormalCone::NEVER {
        return true;
    }
    // Below a quarter turn the sine orders angles, and the cross product keeps small ones.
    let axis = cone.axis().as_dvec3();
    axis.dot(normal) > 0.0
        && axis.cross(normal).length() <= f64::from(cone.sin_half_angle) / 65535.0 + CONE_TOLERANCE
}

fn contains_point(node: &Node, point: Vec3) -> bool {
    if node.strip == NodeStrip::SPHERE {
        // The sphere is tested by itself.
        return true;
    }
    let radius = f64::from(node.radius);
    let offset = point.as_dvec3() - node.center.as_dvec3();
    let direction = node.strip.direction().as_dvec3();
    let half = radius * f64::from(node.strip.half_length) / 255.0;
    let nearest = direction * offset.dot(direction).clamp(-half, half);
    let width = f64::from(node.strip.width) / 255.0 + STRIP_TOLERANCE;
    offset.distance(nearest) <= radius * width + SMALLEST
}
