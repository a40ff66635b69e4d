//! Whether a surface is closed: the boundary of a chain of triangles, hashed.
//!
//! Each directed edge (a, b) between different positions adds a 64-bit hash of the pair, its reverse subtracts the same.
//! The sum is zero for every surface whose directed edges cancel: closed and consistently oriented, also where vertices
//! are doubled along seams, as positions are hashed and not indices. For any other surface it is zero with a probability
//! of 2^-64. Together with a positive enclosed volume (outward orientation as a whole) this allows what faces away to
//! be dropped. Parts that lie outside one another are not told apart: one turned inside out among larger ones that are not
//! goes unnoticed.

use glam::{DVec3, Vec3};

/// Sums over triangles; add them up in any order ([`ClosedEvidence::volume`] in a fixed one).
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ClosedEvidence {
    /// Signed sum of edge hashes.
    pub(super) boundary: u64,
    /// Six times the enclosed volume.
    pub(super) volume: f64,
}

impl ClosedEvidence {
    pub(crate) fn is_closed(&self) -> bool {
        self.boundary == 0 && self.volume > 0.0
    }

    pub(crate) fn join(self, other: Self) -> Self {
        Self {
            boundary: self.boundary.wrapping_add(other.boundary),
            volume: self.volume + other.volume,
        }
    }

    /// Adds a triangle; `origin` is the same for all, near the model.
    #[inline]
    pub(super) fn add(&mut self, corners: [Vec3; 3], origin: DVec3) {
        let hash = corners.map(hash_position);
        let edges = edge(hash[0], hash[1])
            .wrapping_add(edge(hash[1], hash[2]))
            .wrapping_add(edge(hash[2], hash[0]));
        self.boundary = self.boundary.wrapping_add(edges);
        let [a, b, c] = corners.map(|p| p.as_dvec3() - origin);
        self.volume += a.dot(b.cross(c));
    }
}

/// Multiplication to 128 bits, folded: mixes well in two instructions (wyhash, public domain).
#[inline]
fn mix(a: u64, b: u64) -> u64 {
    let product = u128::from(a) * u128::from(b);
    (product as u64) ^ ((product >> 64) as u64)
}

#[inline]
fn hash_position(p: Vec3) -> u64 {
    // Adding zero turns -0 into +0.
    let [x, y, z] = p.to_array().map(|c| u64::from((c + 0.0).to_bits()));
    mix(
        mix(x | (y << 32), 0x9e37_79b9_7f4a_7c15) ^ z,
        0xd6e8_feb8_6659_fd93,
    )
}

/// The hash of a directed edge: that of its reverse, negated; zero between equal positions.
#[inline]
fn edge(a: u64, b: u64) -> u64 {
    let (low, high) = (a.min(b), a.max(b));
    let hash = mix(low ^ 0xa076_1d64_78bd_642f, high ^ 0xe703_7ed1_a0b4_28db)
        .wrapping_mul(0x8ebc_6af0_9c88_c6e3);
    let sign = u64::from(a < b).wrapping_sub(u64::from(b < a));
    hash.wrapping_mul(sign)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reversed_edges_cancel_and_others_do_not() {
        let points: Vec<u64> = (0..50u8)
            .map(|i| hash_position(Vec3::new(f32::from(i), 0.5, -1.0)))
            .collect();
        for &a in &points {
            assert_eq!(edge(a, a), 0);
            for &b in points.iter().filter(|&&b| b != a) {
                assert_eq!(edge(a, b).wrapping_add(edge(b, a)), 0);
                assert_ne!(edge(a, b), 0);
            }
        }
        // Places that differ only in the order of coordinates, or in the last bit, are different.
        let places = [
            Vec3::new(1.0, 2.0, 3.0),
            Vec3::new(2.0, 1.0, 3.0),
            Vec3::new(3.0, 2.0, 1.0),
            Vec3::new(1.0, 2.0, 3.0f32.next_up()),
        ];
        let hashes = places.map(hash_position);
        for (index, hash) in hashes.iter().enumerate() {
            assert!(!hashes[..index].contains(hash));
        }
        assert_eq!(hash_position(Vec3::ZERO), hash_position(-Vec3::ZERO));
    }
}
