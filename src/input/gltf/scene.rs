//! The nodes of a scene: which meshes are where.

use glam::{DMat4, DQuat, DVec3};

use super::super::job::ReadJob;
use super::super::{Error, FilePlace, ReadWarning};
use super::document::{GltfDocument, GltfNode};

/// A mesh at a place of the world.
#[derive(Debug, Clone)]
pub(super) struct MeshPlace {
    pub(super) mesh: usize,
    pub(super) to_world: DMat4,
    pub(super) is_skinned: bool,
}

/// The meshes of the scene, in the order of its nodes. A node counts once: a node of two parents, or of itself, is no tree.
pub(super) fn places(
    job: &mut ReadJob<'_>,
    document: &GltfDocument,
) -> Result<Vec<MeshPlace>, Error> {
    let roots: Vec<usize> = match document.scenes.get(document.scene.unwrap_or(0)) {
        Some(scene) => scene.nodes.clone(),
        None => roots_of(document),
    };
    let mut is_seen = vec![false; document.nodes.len()];
    let mut again = 0;
    let mut out = Vec::new();
    let mut stack: Vec<(usize, DMat4)> = roots
        .iter()
        .rev()
        .map(|&root| (root, DMat4::IDENTITY))
        .collect();
    while let Some((index, to_world)) = stack.pop() {
        let Some(node) = document.nodes.get(index) else {
            let reason = format!("node {index} of {} does not exist", document.nodes.len());
            return Err(job.syntax(FilePlace::Byte(0), reason));
        };
        if std::mem::replace(&mut is_seen[index], true) {
            again += 1;
            continue;
        }
        let to_world = to_world * matrix_of(node);
        if let Some(mesh) = node.mesh {
            if mesh >= document.meshes.len() {
                let reason = format!(
                    "node {index} names mesh {mesh} of {}",
                    document.meshes.len()
                );
                return Err(job.syntax(FilePlace::Byte(0), reason));
            }
            out.push(MeshPlace {
                mesh,
                to_world,
                is_skinned: node.skin.is_some(),
            });
        }
        if node.extensions.get("EXT_mesh_gpu_instancing").is_some() {
            job.inventory
                .leave_out(format!("the instances of node {index}"));
        }
        stack.extend(node.children.iter().rev().map(|&child| (child, to_world)));
    }
    job.warn_count(again, |count| ReadWarning::PartsIgnored {
        what: "nodes that are named twice",
        count,
    });
    Ok(out)
}

/// The nodes that are no children.
fn roots_of(document: &GltfDocument) -> Vec<usize> {
    let mut is_child = vec![false; document.nodes.len()];
    for &child in document.nodes.iter().flat_map(|node| &node.children) {
        if let Some(is_child) = is_child.get_mut(child) {
            *is_child = true;
        }
    }
    (0..document.nodes.len())
        .filter(|&index| !is_child[index])
        .collect()
}

fn matrix_of(node: &GltfNode) -> DMat4 {
    if let Some(matrix) = &node.matrix {
        return DMat4::from_cols_array(matrix);
    }
    let rotation = node.rotation.map_or(DQuat::IDENTITY, DQuat::from_array);
    let length = rotation.length();
    let rotation = if length > 0.0 {
        rotation / length
    } else {
        DQuat::IDENTITY
    };
    DMat4::from_scale_rotation_translation(
        node.scale.map_or(DVec3::ONE, DVec3::from_array),
        rotation,
        node.translation.map_or(DVec3::ZERO, DVec3::from_array),
    )
}
