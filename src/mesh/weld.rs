//! Merges vertices that are equal, bit by bit.

use std::hash::{BuildHasher, RandomState};

use glam::Vec3;
use rayon::prelude::*;

use super::Mesh;

/// Merges vertices of equal position, normal and color (bit by bit, but the two zeros are equal); the first of each
/// set stays, in order, unused vertices too. Triangles keep their number and order; some may become degenerate.
///
/// Returns how many vertices went. Expected linear time; the result does not depend on threads or hashing.
pub fn weld(mesh: &mut Mesh) -> usize {
    let Mesh {
        positions,
        normals,
        colors,
        ..
    } = &*mesh;
    let before = positions.len();
    let key = |index: u32| {
        let index = index as usize;
        let position = bits(positions[index]);
        let normal = normals.get(index).map_or([0; 3], |&normal| bits(normal));
        let color = colors
            .get(index)
            .map_or(0, |&color| u32::from_le_bytes(color));
        [
            position[0],
            position[1],
            position[2],
            normal[0],
            normal[1],
            normal[2],
            color,
        ]
    };
    let UnifiedVertices { class_of, first } = unify(before as u32, key);
    if first.len() == before {
        return 0;
    }
    fn gather<T: Copy + Send + Sync>(items: &mut Vec<T>, first: &[u32]) {
        if !items.is_empty() {
            *items = first
                .par_iter()
                .with_min_len(4096)
                .map(|&index| items[index as usize])
                .collect();
        }
    }
    gather(&mut mesh.positions, &first);
    gather(&mut mesh.normals, &first);
    gather(&mut mesh.colors, &first);
    mesh.triangles
        .par_iter_mut()
        .with_min_len(4096)
        .for_each(|triangle| *triangle = triangle.map(|corner| class_of[corner as usize]));
    before - mesh.positions.len()
}

/// The bits of a vector, with minus zero made plus zero.
fn bits(vector: Vec3) -> [u32; 3] {
    (vector + Vec3::ZERO).to_array().map(f32::to_bits)
}

struct UnifiedVertices {
    /// Number of the set of every item; sets are numbered by first appearance.
    class_of: Vec<u32>,
    /// First item of every set.
    first: Vec<u32>,
}

/// Numbers the sets of items with equal keys, by open addressing with linear probing. The table grows with the
/// number of sets, not of items: corners of an STL file are six times as many as its vertices, and a small table
/// stays in the cache.
fn unify<const N: usize>(count: u32, key: impl Fn(u32) -> [u32; N]) -> UnifiedVertices {
    const FREE: u32 = u32::MAX;
    // Seeded anew each time, so that no file can be made whose keys all collide; classes do not depend on it.
    let seed = RandomState::new().hash_one(0x5eed_u64);
    let hash = |key: &[u32; N]| {
        key.iter().fold(seed, |state, &word| {
            // Both halves of a wide product, so that every bit of the word reaches the low bits.
            let product = u128::from(state ^ u64::from(word)) * 0x9e37_79b9_7f4a_7c15_u128;
            (((product >> 64) ^ product) as u64).wrapping_add(seed)
        })
    };
    let mut class_of = Vec::with_capacity(count as usize);
    let mut first: Vec<u32> = Vec::new();
    let mut slots = vec![FREE; 1 << 10];
    for item in 0..count {
        if first.len() * 2 >= slots.len() {
            slots = vec![FREE; slots.len() * 4];
            for (class, &member) in first.iter().enumerate() {
                let mut slot = hash(&key(member)) as usize & (slots.len() - 1);
                while slots[slot] != FREE {
                    slot = (slot + 1) & (slots.len() - 1);
                }
                slots[slot] = class as u32;
            }
        }
        let wanted = key(item);
        let mut slot = hash(&wanted) as usize & (slots.len() - 1);
        let class = loop {
            let class = slots[slot];
            if class == FREE {
                slots[slot] = first.len() as u32;
                first.push(item);
                break slots[slot];
            }
            if key(first[class as usize]) == wanted {
                break class;
            }
            slot = (slot + 1) & (slots.len() - 1);
        };
        class_of.push(class);
    }
    UnifiedVertices { class_of, first }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_vertices_merge_and_the_first_stays() {
        let mut mesh = Mesh {
            positions: vec![Vec3::X, Vec3::ZERO, Vec3::X, Vec3::Y, -Vec3::ZERO],
            triangles: vec![[0, 1, 3], [2, 4, 3]],
            ..Mesh::default()
        };
        assert_eq!(weld(&mut mesh), 2);
        assert_eq!(mesh.positions, [Vec3::X, Vec3::ZERO, Vec3::Y]);
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 1, 2]]);
        assert_eq!(weld(&mut mesh), 0);
    }

    #[test]
    fn different_normals_or_colors_stay_apart() {
        let mut mesh = Mesh {
            positions: vec![Vec3::X; 4],
            normals: vec![Vec3::X, Vec3::Y, Vec3::X, Vec3::X],
            colors: vec![[1; 4], [1; 4], [2; 4], [1; 4]],
            ..Mesh::default()
        };
        assert_eq!(weld(&mut mesh), 1);
        assert_eq!(mesh.normals, [Vec3::X, Vec3::Y, Vec3::X]);
        assert_eq!(mesh.colors, [[1; 4], [1; 4], [2; 4]]);
    }

    #[test]
    fn many_vertices_agree_with_a_plain_search() {
        let positions: Vec<Vec3> = (0..20_000_u32)
            .map(|i| {
                let value = i.wrapping_mul(2_654_435_761) >> 20;
                Vec3::new(
                    (value % 17) as f32,
                    (value / 17 % 13) as f32,
                    (value / 221) as f32,
                )
            })
            .collect();
        let mut seen = std::collections::BTreeSet::new();
        let mut wanted = positions.clone();
        wanted.retain(|p| seen.insert(p.to_array().map(f32::to_bits)));
        assert!(
            wanted.len() > 2000,
            "the table has to grow for this test to mean something: {}",
            wanted.len()
        );
        let mut mesh = Mesh {
            positions,
            ..Mesh::default()
        };
        weld(&mut mesh);
        assert_eq!(mesh.positions, wanted);
    }

    #[test]
    fn an_empty_mesh_stays_empty() {
        assert_eq!(weld(&mut Mesh::default()), 0);
    }
}
