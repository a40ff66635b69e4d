//! Trees of parts of a model that is never in memory as a whole. All parts have one depth, so that they stand side by side in
//! one tree, and share the model-space zero.

use super::build::{
    BuildOptions, BuildParts, PartPlace, PointNormals, build_around, leaf_centers, shape_of,
};
use super::closed::ClosedEvidence;
use super::partition::TreePartition;
use super::shape::TreeShape;
use super::sort_item::SortItem;
use super::{
    AlignedRecords, Error, Model, Node, NodeAttributes, NodeStrip, NormalCone, SurfaceMoments,
};
use super::{summary, thickness};
use crate::math::octahedral;
use crate::math::sphere::{self, Sphere};
use crate::mesh::Mesh;
use crate::progress::Progress;
use glam::{DVec3, Vec3};
use std::sync::atomic::AtomicBool;

/// The shape of a part's tree.
#[derive(Debug)]
pub(crate) struct PartShape(TreeShape);

impl PartShape {
    /// Levels of nodes of the tree over as many leaves, if nothing else decides.
    pub(crate) fn usual_depth(leaf_count: u32) -> usize {
        let mut depth = 0;
        while 1u64 << (2 * depth) < u64::from(leaf_count) {
            depth += 1;
        }
        depth
    }

    /// The shape with this depth.
    ///
    /// # Errors
    /// No tree of that depth has so many leaves.
    pub(crate) fn new(leaf_count: usize, part: PartPlace) -> Result<Self, Error> {
        Ok(Self(shape_of(leaf_count, Some(part))?))
    }

    /// Number of nodes.
    pub(crate) fn node_count(&self) -> usize {
        self.0.node_count()
    }

    /// Most leaves below a node of a level.
    pub(crate) fn most_leaves(&self, level: usize) -> u32 {
        let starts = self.leaf_starts(level).windows(2);
        starts.map(|pair| pair[1] - pair[0]).max().unwrap_or(0)
    }

    /// Number of children of each node of a level.
    pub(crate) fn child_counts(&self, level: usize) -> impl Iterator<Item = u8> {
        let starts = &self.0.levels[level].child_starts;
        starts.windows(2).map(|pair| (pair[1] - pair[0]) as u8)
    }

    /// First leaf of each node of a level, then the number of leaves.
    pub(crate) fn leaf_starts(&self, level: usize) -> &[u32] {
        &self.0.levels[level].leaf_starts
    }
}

/// The numbers of a mesh's triangles (or points) in the order of the tree that [`build_part`] makes of them.
///
/// # Errors
/// A corner that names no vertex, or a position that is not finite.
pub(crate) fn leaf_order(mesh: &Mesh, shape: &PartShape) -> Result<Vec<u32>, Error> {
    let count = match mesh.is_cloud() {
        true => mesh.positions.len(),
        false => mesh.triangles.len(),
    };
    let mut items = AlignedRecords::<SortItem>::zeroed(count);
    leaf_centers(mesh, &mut items)?;
    let mut spare = AlignedRecords::<SortItem>::zeroed(count);
    TreePartition {
        shape: &shape.0,
        stop: &AtomicBool::new(false),
        placed: &|_| (),
    }
    .run(&mut items, &mut spare);
    Ok(items.iter().map(|item| item.index).collect())
}

/// Builds the tree of a part; its model-space zero stays. Also returns what was found of its surface: the whole is closed
/// where the evidence of all parts together says so.
///
/// # Errors
/// As [`super::build`]; no tree of the depth has so many leaves.
pub(crate) fn build_part(
    mesh: Mesh,
    (part, point_normals): (PartPlace, PointNormals),
    progress: &dyn Progress,
) -> Result<(Model, ClosedEvidence), Error> {
    let options = BuildOptions {
        keeps_origin: true,
        point_normals,
        ..BuildOptions::default()
    };
    let parts = BuildParts {
        radii: None,
        part: Some(part),
        keeps_order: false,
    };
    let grown = build_around(mesh, &options, parts, progress)?;
    Ok((grown.model, grown.evidence))
}

/// The records of a node.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct NodeRecords {
    pub(crate) node: Node,
    pub(crate) attributes: NodeAttributes,
    pub(crate) moments: SurfaceMoments,
}

/// The node above two to four roots of parts, from their records alone: a sphere around theirs, a cone around theirs, means
/// weighted by area. Its capsule is the sphere. The links are left to the caller.
pub(crate) fn node_above(children: &[NodeRecords], is_surface: bool) -> NodeRecords {
    let nodes: Vec<Node> = children.iter().map(|child| child.node).collect();
    let balls: Vec<Sphere> = (nodes.iter())
        .map(|node| Sphere {
            center: node.center.as_dvec3(),
            radius: f64::from(node.radius),
        })
        .collect();
    let center = sphere::enclosing(&balls).center.as_vec3();
    let radius = sphere::radius_around(center.as_dvec3(), &balls);
    let radius = sphere::round_up(radius * (1.0 + 1e-15));
    let mut node = Node {
        center,
        radius,
        first_child: 0,
        cone: NormalCone::ALL,
        strip: NodeStrip::SPHERE,
        child_count: nodes.len() as u8,
        flags: 0,
    };
    if is_surface {
        let with_normal = || nodes.iter().filter(|child| child.flags & Node::FLAT == 0);
        let caps: Option<Vec<_>> = with_normal()
            .map(|child| summary::unpack_cone(&child.cone))
            .collect();
        match caps {
            Some(caps) if caps.is_empty() => node.flags |= Node::FLAT,
            Some(caps) => node.cone = summary::pack_cone(&caps),
            None => {}
        }
    }
    let own: Vec<NodeAttributes> = children.iter().map(|child| child.attributes).collect();
    let mut attributes = mean_attributes(&own, radius);
    if attributes.has_normal() {
        let half = thickness::of_children(&nodes, &own, &node, attributes.normal());
        attributes.set_half_thickness(half);
    }
    NodeRecords {
        node,
        attributes,
        moments: mean_moments(children, &node),
    }
}

/// Means weighted by area.
fn mean_attributes(children: &[NodeAttributes], splat_radius: f32) -> NodeAttributes {
    let (mut normal, mut color, mut weights, mut area) = (Vec3::ZERO, Vec3::ZERO, 0.0, 0.0);
    for child in children {
        let weight = child.area.max(f32::MIN_POSITIVE);
        let [r, g, b, _] = child.color.map(f32::from);
        normal += child.normal_or_zero() * weight;
        color += Vec3::new(r, g, b) * weight;
        (weights, area) = (weights + weight, area + child.area);
    }
    let channel = |sum: f32| (sum / weights + 0.5) as u8;
    let has_normal = normal.length() > 0.1 * weights;
    NodeAttributes {
        normal: octahedral::encode(normal),
        color: [
            channel(color.x),
            channel(color.y),
            channel(color.z),
            if has_normal { 255 } else { 0 },
        ],
        splat_radius,
        area,
    }
}

/// The moments of a node by those of its children: sums weighted by area, around the node's center.
fn mean_moments(children: &[NodeRecords], node: &Node) -> SurfaceMoments {
    let unit = f64::from(SurfaceMoments::UNIT);
    let mut sums = [0.0f64; 12];
    let mut area = 0.0;
    for NodeRecords {
        node: child,
        attributes,
        moments,
    } in children
    {
        let weight = f64::from(attributes.area);
        let offset = DVec3::from_array(moments.centroid.map(|c| f64::from(c) / unit));
        let centroid = child.center.as_dvec3() + offset * f64::from(child.radius);
        let rest = (moments.vector_area.iter()).chain(&moments.second_moment);
        let values = (centroid - node.center.as_dvec3()).to_array().into_iter();
        let values = values.chain(rest.map(|&v| f64::from(v) / unit));
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum += weight * value;
        }
        area += weight;
    }
    if !(area > 0.0 && area.is_finite()) {
        return SurfaceMoments::default();
    }
    let radius = f64::from(node.radius).max(f64::MIN_POSITIVE);
    let code = |value: f64| (value / area * unit).round() as i16;
    let [x, y, z, a, b, c, second @ ..] = sums;
    SurfaceMoments {
        centroid: [x, y, z].map(|sum| code(sum / radius)),
        vector_area: [a, b, c].map(code),
        second_moment: second.map(code),
    }
}
