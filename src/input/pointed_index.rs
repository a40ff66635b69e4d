//! Indices of OBJ that may be wrong: of normals and texture coordinates.

use super::text::parse_i64;

/// Index of a corner that names no normal, or no texture coordinate.
pub(super) const NO_INDEX: u32 = u32::MAX;

/// An attribute that corners name and no shape depends on: its indices may be wrong.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PointedIndex {
    /// The largest index, from 0, that a corner named before it appeared.
    pub(super) largest: u32,
    /// How many such corners, and where the first stands.
    pub(super) count: u64,
    pub(super) first: usize,
}

impl PointedIndex {
    /// The index from 0 that `part` writes from 1, or backwards from -1; `None` when it can be none. One beyond `count`
    /// is noted: it may still come.
    #[inline]
    pub(super) fn index(&mut self, part: &[u8], count: usize, at: usize) -> Option<u32> {
        let index = parse_i64(part)?;
        let from_one = if index < 0 {
            index.saturating_add(count as i64 + 1)
        } else {
            index
        };
        if from_one <= 0 || from_one >= i64::from(NO_INDEX) {
            return None;
        }
        let index = (from_one - 1) as u32;
        if from_one as u64 > count as u64 {
            if self.count == 0 {
                self.first = at;
            }
            self.count += 1;
            self.largest = self.largest.max(index);
        }
        Some(index)
    }

    /// Tells whether corners name something that never came; `count` is how much did.
    pub(super) fn is_beyond(&self, count: u64) -> bool {
        self.count > 0 && u64::from(self.largest) >= count
    }
}
