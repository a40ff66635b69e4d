//! Writes `.qs` files.

use super::{COLORS, HAS_GRANDCHILDREN, HEADER, MAGIC, QsNode, QsTree, qs_normal, qs_normal_code};
use crate::math::octahedral;
use crate::pages::quantize::{
    PageSphere, color_to_565, cone_code, decode_sphere, encode_sphere, widened_sine,
};
use crate::tree::{Model, NormalCone};
use glam::Vec3;
use std::collections::VecDeque;

/// A file of one tree. Reading it gives the same tree; writing that again gives the same bytes.
///
/// `None` where it would not fit the 32-bit lengths of such files: from 2³² bytes on, some 700 million leaves.
pub fn to_bytes(tree: &QsTree) -> Option<Vec<u8>> {
    let size = if tree.has_colors { 6 } else { 4 };
    let mut out = Vec::with_capacity(HEADER + tree.nodes.len() * (size + 1));
    out.extend(MAGIC);
    out.extend([0; 4]);
    out.extend(u32::try_from(tree.leaf_count()).ok()?.to_be_bytes());
    out.extend(if tree.has_colors { COLORS } else { 0 }.to_be_bytes());
    for value in tree
        .root
        .center
        .to_array()
        .into_iter()
        .chain([tree.root.radius])
    {
        out.extend(value.to_be_bytes());
    }
    out.extend(u32::from(tree.root_children).to_be_bytes());

    // First child of each node, and whether some child has children.
    let mut next = usize::from(tree.root_children);
    let first_child: Vec<usize> = tree
        .nodes
        .iter()
        .map(|node| {
            let first = next;
            next += usize::from(node.children);
            first
        })
        .collect();
    let has_parents = |first: usize, count: usize| {
        let children = tree.nodes.get(first..first + count).unwrap_or_default();
        children.iter().any(|child| child.children > 0)
    };
    let group_bytes = |(first, count): (usize, usize)| {
        count * size + if has_parents(first, count) { 4 } else { 0 }
    };
    let root_group = (0, usize::from(tree.root_children));
    let mut groups = VecDeque::from([root_group]);
    let mut end = out.len() + group_bytes(root_group);
    while let Some((first, count)) = groups.pop_front() {
        if has_parents(first, count) {
            out.extend(u32::try_from(end - out.len()).ok()?.to_be_bytes());
        }
        let own = first..first + count;
        let nodes = tree.nodes.get(own.clone())?.iter();
        for (node, &first_child) in nodes.zip(first_child.get(own)?) {
            let children = (first_child, usize::from(node.children));
            let mut word = node.sphere << 3 | u16::from(node.children.saturating_sub(1));
            if node.children > 0 {
                if has_parents(children.0, children.1) {
                    word |= HAS_GRANDCHILDREN;
                }
                end += group_bytes(children);
                groups.push_back(children);
            }
            out.extend(word.to_be_bytes());
            out.extend((node.normal << 2 | u16::from(node.cone)).to_be_bytes());
            if tree.has_colors {
                out.extend(node.color.to_be_bytes());
            }
        }
    }
    out.resize(out.len().next_multiple_of(4), 0);
    let length = u32::try_from(out.len()).ok()?;
    out[8..12].copy_from_slice(&length.to_be_bytes());
    Some(out)
}

/// The tree of a model: its nodes, and a leaf for each triangle (its sphere and mean normal) or point. Decoded spheres
/// contain the true ones, cones the model's. `None` without leaves.
///
/// World positions are relative to the model's origin in single precision, as the file has no other.
pub fn of_model(model: &Model) -> Option<QsTree> {
    let tree = &model.tree;
    let origin = model.origin;
    let placed = |center: Vec3, radius: f32| PageSphere {
        center: (origin + center.as_dvec3()).as_vec3(),
        radius,
    };
    let root = match tree.nodes.first() {
        Some(root) => placed(root.center, root.radius),
        None => {
            let leaf = tree.leaves.first()?;
            placed(leaf.center, leaf.radius)
        }
    };
    // A hair more, for the move to the origin.
    let reach = origin.length() + f64::from(root.center.length());
    let shift = (reach * 1.2e-7) as f32;
    let root = PageSphere {
        radius: (root.radius + 2.0 * shift) * (1.0 + 1e-6),
        ..root
    };
    let mut out = QsTree {
        has_colors: model.has_colors,
        root,
        root_children: tree.nodes.first().map_or(0, |node| node.child_count),
        nodes: Vec::new(),
    };
    let mut parents = VecDeque::new();
    if !tree.nodes.is_empty() {
        parents.push_back((0u32, root));
    }
    while let Some((id, sphere)) = parents.pop_front() {
        let node = &tree.nodes[id as usize];
        for child in tree.children(id) {
            let (own, children) = if node.has_leaves() {
                (of_leaf(model, child), 0)
            } else {
                of_node(model, child)
            };
            let ball = placed(own.sphere.center, own.sphere.radius);
            let code = encode_sphere(
                &sphere,
                ball.center.as_dvec3(),
                f64::from(ball.radius + shift),
            );
            out.nodes.push(QsNode {
                sphere: code,
                children,
                ..own.node
            });
            if children > 0 {
                parents.push_back((child, decode_sphere(&sphere, code)));
            }
        }
    }
    Some(out)
}

/// A node's sphere in the model, and what else is coded.
struct OwnSphere {
    sphere: PageSphere,
    node: QsNode,
}

fn of_leaf(model: &Model, leaf: u32) -> OwnSphere {
    let own = model.tree.leaves[leaf as usize];
    let corners: &[u32] = match model.triangles.get(leaf as usize) {
        Some(corners) => corners,
        None => &[leaf],
    };
    let (mut normal, mut color) = (Vec3::ZERO, [0u32; 3]);
    for &corner in corners {
        let vertex = &model.vertices[corner as usize];
        if vertex.color[3] != 0 {
            normal += octahedral::decode(vertex.normal);
        }
        for (sum, &channel) in color.iter_mut().zip(&vertex.color) {
            *sum += u32::from(channel);
        }
    }
    let count = corners.len() as u32;
    OwnSphere {
        sphere: PageSphere {
            center: own.center,
            radius: own.radius,
        },
        node: QsNode {
            normal: qs_normal_code(normal),
            // Drawn from everywhere where nothing is known.
            cone: if normal == Vec3::ZERO { 3 } else { 0 },
            color: color_of(model, color.map(|sum| (sum / count) as u8)),
            ..QsNode::default()
        },
    }
}

fn of_node(model: &Model, id: u32) -> (OwnSphere, u8) {
    let node = &model.tree.nodes[id as usize];
    let attributes = &model.tree.attributes[id as usize];
    let normal = if attributes.has_normal() {
        attributes.normal()
    } else {
        Vec3::ZERO
    };
    let code = qs_normal_code(normal);
    let axis = qs_normal(code);
    let is_open = node.cone.sin_half_angle == NormalCone::NEVER || normal == Vec3::ZERO;
    let sine = if is_open {
        1.0
    } else {
        let off = axis
            .cross(node.cone.axis())
            .length()
            .atan2(axis.dot(node.cone.axis()));
        widened_sine(f64::from(node.cone.sin_half_angle()), f64::from(off) + 1e-6)
    };
    let [r, g, b, _] = attributes.color;
    let own = OwnSphere {
        sphere: PageSphere {
            center: node.center,
            radius: node.radius,
        },
        node: QsNode {
            normal: code,
            cone: cone_code(sine),
            color: color_of(model, [r, g, b]),
            ..QsNode::default()
        },
    };
    (own, node.child_count)
}

fn color_of(model: &Model, color: [u8; 3]) -> u16 {
    if model.has_colors {
        color_to_565(color)
    } else {
        0
    }
}
