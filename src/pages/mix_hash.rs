//! Hash tables of positions and numbers, as fast as a multiplication. A file that was made for it could slow them down: they
//! are for building, which can be cancelled, not for opening.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// A table by [`MixHasher`].
pub(super) type MixMap<K, V> = HashMap<K, V, BuildHasherDefault<MixHasher>>;

/// Folds each word into the product of the ones before it (wyhash, public domain).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MixHasher(u64);

impl MixHasher {
    #[inline]
    fn mix(&mut self, word: u64) {
        let product = u128::from(self.0 ^ word ^ 0x9e37_79b9_7f4a_7c15) * 0xd6e8_feb8_6659_fd93;
        self.0 = product as u64 ^ (product >> 64) as u64;
    }
}

impl Hasher for MixHasher {
    #[inline]
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.mix(u64::from_le_bytes(word));
        }
    }

    #[inline]
    fn write_u32(&mut self, word: u32) {
        self.mix(word.into());
    }

    #[inline]
    fn write_u64(&mut self, word: u64) {
        self.mix(word);
    }

    #[inline]
    fn write_usize(&mut self, word: usize) {
        self.mix(word as u64);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::hash::BuildHasher;

    #[test]
    fn neighbors_are_far_apart() {
        let build = BuildHasherDefault::<MixHasher>::default();
        let keys =
            (0..30u32).flat_map(|x| (0..30).flat_map(move |y| (0..30).map(move |z| [x, y, z])));
        let hashes: Vec<u64> = keys.map(|key| build.hash_one(key)).collect();
        let all: HashSet<u64> = hashes.iter().copied().collect();
        assert_eq!(all.len(), 27_000);
        // The lowest bits choose the bucket, the highest seven the tag.
        for shift in [0, 57] {
            let low: HashSet<u64> = hashes.iter().map(|hash| (hash >> shift) & 0x7f).collect();
            assert_eq!(low.len(), 128);
        }
    }
}
