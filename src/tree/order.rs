//! Vertices in the order in which the tree's triangles use them first.

use crate::abi::Vertex;
use crate::math::octahedral;
use crate::mesh::Mesh;
use glam::Vec3;
use rayon::prelude::*;

/// Renumbers the corners of `triangles` by first use. Returns the old index of each new vertex, the unused ones at the
/// end in file order, and how many are used.
pub(super) fn by_first_use(triangles: &mut [[u32; 3]], vertex_count: usize) -> (Vec<u32>, u32) {
    const UNSEEN: u32 = u32::MAX;
    let mut new_of_old = vec![UNSEEN; vertex_count];
    // One more, so that the next free place can be written always: no branch, which would be missed once a vertex.
    let mut old_of_new = vec![0u32; vertex_count + 1];
    let mut next = 0u32;
    for triangle in triangles.iter_mut() {
        for corner in triangle {
            let old = *corner;
            let seen = new_of_old[old as usize];
            let is_new = seen == UNSEEN;
            let new = if is_new { next } else { seen };
            new_of_old[old as usize] = new;
            old_of_new[next as usize] = old;
            next += u32::from(is_new);
            *corner = new;
        }
    }
    let used = next;
    for (old, &new) in new_of_old.iter().enumerate() {
        if new == UNSEEN {
            old_of_new[next as usize] = old as u32;
            next += 1;
        }
    }
    old_of_new.truncate(vertex_count);
    (old_of_new, used)
}

/// The vertices as the device reads them, and their unpacked normals (empty if the mesh has none).
pub(super) fn vertices(mesh: &Mesh, old_of_new: &[u32]) -> (Vec<Vertex>, Vec<Vec3>) {
    let vertices = old_of_new
        .par_iter()
        .with_min_len(4096)
        .map(|&old| {
            let old = old as usize;
            let normal = mesh.normals.get(old).copied().unwrap_or(Vec3::ZERO);
            let [r, g, b, _] = mesh.colors.get(old).copied().unwrap_or([255; 4]);
            let alpha = if is_known(normal) { 255 } else { 0 };
            Vertex {
                position: mesh.positions[old],
                normal: if alpha == 0 {
                    [0, 0]
                } else {
                    octahedral::encode(normal)
                },
                color: [r, g, b, alpha],
            }
        })
        .collect();
    let normals = if mesh.normals.is_empty() {
        Vec::new()
    } else {
        let known = |&old: &u32| {
            let normal = mesh.normals[old as usize];
            if is_known(normal) { normal } else { Vec3::ZERO }
        };
        old_of_new
            .par_iter()
            .with_min_len(4096)
            .map(known)
            .collect()
    };
    (vertices, normals)
}

fn is_known(normal: Vec3) -> bool {
    normal.is_finite() && normal != Vec3::ZERO
}
