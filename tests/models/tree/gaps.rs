//! Capsules do not bridge gaps: along each of them something lies.

use super::shapes::{grid, torus};
use super::tree_of;
use glam::{DVec3, Quat, Vec3};
use surfel::mesh::Mesh;
use surfel::tree::{Model, Node, NodeStrip};

/// The capsule of a node along its axis: half length with its ends, within the sphere.
fn half_length(node: &Node) -> f32 {
    let sum = u16::from(node.strip.half_length) + u16::from(node.strip.width);
    f32::from(sum.min(255)) / 255.0 * node.radius
}

/// The longest stretch of a node's capsule, also at its ends, that no triangle below reaches.
fn longest_gap(model: &Model, id: u32) -> f32 {
    let node = &model.tree.nodes[id as usize];
    let (axis, half) = (node.strip.direction(), half_length(node));
    let mut covered: Vec<(f32, f32)> = model
        .tree
        .leaf_range(id)
        .map(|leaf| {
            let along = model.triangles[leaf as usize]
                .map(|corner| (model.vertices[corner as usize].position - node.center).dot(axis));
            let (low, high) = (along[0].min(along[1]), along[0].max(along[1]));
            (low.min(along[2]), high.max(along[2]))
        })
        .collect();
    covered.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut reached, mut longest) = (-half, 0f32);
    for (low, high) in covered {
        longest = longest.max(low - reached);
        reached = reached.max(high);
    }
    longest.max(half - reached)
}

/// Several meshes as one.
fn joined(parts: impl IntoIterator<Item = Mesh>) -> Mesh {
    let mut all = Mesh::default();
    for part in parts {
        let first = all.positions.len() as u32;
        all.positions.extend(part.positions);
        all.triangles.extend(
            part.triangles
                .iter()
                .map(|t| t.map(|corner| corner + first)),
        );
    }
    all
}

/// A ball of `2 n n` triangles.
fn ball(n: usize, center: Vec3, radius: f32) -> Mesh {
    let mut mesh = grid(n, n, (true, false), |s, t| {
        let (u, w) = (std::f64::consts::TAU * s, std::f64::consts::PI * (t - 0.5));
        DVec3::new(w.cos() * u.sin(), w.sin(), w.cos() * u.cos())
    });
    for p in &mut mesh.positions {
        *p = center + *p * radius;
    }
    mesh
}

/// The largest sphere three levels below a node, or of its leaves: what is known of gaps above the blocks.
fn largest_part(model: &Model, id: u32, levels: u32) -> f32 {
    let node = &model.tree.nodes[id as usize];
    if levels == 0 || node.has_leaves() {
        return 2.0 * node.radius;
    }
    (node.first_child..node.first_child + u32::from(node.child_count))
        .map(|child| largest_part(model, child, levels - 1))
        .fold(0.0, f32::max)
}

/// How many capsules there are; all without gaps.
fn check_gaps(model: &Model, name: &str) -> usize {
    let mut capsules = 0;
    for (id, node) in model.tree.nodes.iter().enumerate() {
        if node.strip == NodeStrip::SPHERE {
            continue;
        }
        capsules += 1;
        let id = id as u32;
        let half = half_length(node);
        let width = f32::from(node.strip.width) / 255.0 * node.radius;
        // An eighth of the half length, or the width; both are counted in parts of a 32nd.
        let mut most = (2.0 * width).max(half / 8.0) + 2.0 * half / 32.0;
        if model.tree.leaf_range(id).len() > 256 {
            // By spheres of parts instead of triangles: one at either side may reach into the gap.
            most += 2.0 * largest_part(model, id, 4);
        }
        let gap = longest_gap(model, id);
        assert!(
            gap <= most * 1.001,
            "{name}, node {id}: {gap} of {half} is empty, {width} wide"
        );
    }
    capsules
}

#[test]
fn separate_parts_get_no_capsule_across_the_gap() {
    let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.6);
    // Of two triangles up to blocks, and to levels above them.
    for n in [2, 3, 5, 8, 16, 40] {
        for distance in [8.0, 12.0, 20.0] {
            let balls =
                [-1.0, 1.0].map(|side| ball(n, turn * Vec3::X * (0.5 * side * distance), 1.0));
            let model = tree_of(&joined(balls));
            check_gaps(&model, "two balls");
            // The root holds both, and nothing else does.
            assert_eq!(
                model.tree.nodes[0].strip,
                NodeStrip::SPHERE,
                "{n} x {n}, {distance} apart"
            );
        }
    }
    // A row of small parts, and one part off its center.
    let row = (0..40).map(|i| ball(4, turn * Vec3::Y * (i * i) as f32, 0.5));
    check_gaps(&tree_of(&joined(row)), "row");
}

#[test]
fn needles_and_rods_keep_their_capsules() {
    let model = tree_of(&torus(8000, 40));
    let capsules = check_gaps(&model, "torus");
    assert!(
        10 * capsules > 9 * model.tree.nodes.len(),
        "{capsules} of {}",
        model.tree.nodes.len()
    );
    let rod = grid(40, 400, (true, false), |s, t| {
        let u = std::f64::consts::TAU * s;
        DVec3::new(0.1 * u.cos(), 20.0 * t, 0.1 * u.sin())
    });
    let model = tree_of(&rod);
    assert!(check_gaps(&model, "rod") > 0);
    assert_ne!(model.tree.nodes[0].strip, NodeStrip::SPHERE);
}
