//! The memory of large arrays: on few pages, and of nodes such that four siblings lie on two cache lines.

use bytemuck::{Pod, Zeroable};
use memmap2::MmapMut;
use std::fmt;
use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};

/// Two cache lines of 64 bytes.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(128))]
struct CacheLines([u8; 128]);

enum RecordMemory {
    Heap(Vec<CacheLines>),
    /// Zeroed memory of the system, page by page at first use.
    Pages(MmapMut),
}

impl RecordMemory {
    /// Bytes from which on large pages are asked for.
    const MANY: usize = 4 << 20;

    /// At least as many zero bytes.
    fn zeroed(bytes: usize) -> Self {
        let pages = (bytes >= Self::MANY).then(|| large_pages(bytes)).flatten();
        pages.map_or_else(
            || {
                Self::Heap(vec![
                    CacheLines::zeroed();
                    bytes.div_ceil(size_of::<CacheLines>())
                ])
            },
            Self::Pages,
        )
    }
}

/// Zeroed memory in large pages where there are such; `None` where the system gives none at all.
fn large_pages(bytes: usize) -> Option<MmapMut> {
    let pages = MmapMut::map_anon(bytes).ok()?;
    // Advice: without it all is as well, only slower.
    #[cfg(target_os = "linux")]
    let _ = pages.advise(memmap2::Advice::HugePage);
    Some(pages)
}

/// An array that is a slice in every respect but where it lies.
///
/// Many records are in pages of 2 MiB where the system has them (Linux), which spares most of the searching for
/// addresses: a cut of a million nodes takes a sixth less time.
pub struct AlignedRecords<T> {
    memory: RecordMemory,
    /// Bytes before the first record.
    skip: usize,
    len: usize,
    records: PhantomData<T>,
}

impl<T: Pod> AlignedRecords<T> {
    /// As many records, all zero.
    pub fn zeroed(len: usize) -> Self {
        Self::after(0, len)
    }

    /// The same, with room for `skip` records before the first, which begin at a multiple of 128 bytes.
    fn after(skip: usize, len: usize) -> Self {
        let size = size_of::<T>();
        Self {
            memory: RecordMemory::zeroed((skip + len).saturating_mul(size)),
            skip: skip * size,
            len,
            records: PhantomData,
        }
    }

    fn bytes(&self) -> std::ops::Range<usize> {
        self.skip..self.skip + self.len * size_of::<T>()
    }

    /// As many records of nodes, all zero.
    ///
    /// Over most leaf counts (all but those 4 to 5 times a power of two) a tree has only groups of four siblings below the
    /// root's children, and the lowest level, three quarters of all, is a power of two. It begins at a multiple of 128
    /// bytes, and so do all groups: a group of nodes of 32 bytes is two lines to wait for instead of three, and of
    /// attributes of 16 bytes one instead of two.
    pub fn of_tree(len: usize) -> Self {
        // Of the lowest level; an empty tree has none.
        let lowest = len.checked_ilog2().map_or(0, |log| len - (1 << log));
        Self::after((4 - lowest % 4) % 4, len)
    }
}

impl<T: Pod> Default for AlignedRecords<T> {
    fn default() -> Self {
        Self::zeroed(0)
    }
}

impl<T: Pod> Clone for AlignedRecords<T> {
    fn clone(&self) -> Self {
        let mut copy = Self::after(self.skip / size_of::<T>(), self.len);
        copy.copy_from_slice(self);
        copy
    }
}

impl<T: Pod> From<&[T]> for AlignedRecords<T> {
    fn from(records: &[T]) -> Self {
        let mut copy = Self::zeroed(records.len());
        copy.copy_from_slice(records);
        copy
    }
}

impl<T: Pod> FromIterator<T> for AlignedRecords<T> {
    fn from_iter<I: IntoIterator<Item = T>>(records: I) -> Self {
        Self::from(records.into_iter().collect::<Vec<_>>().as_slice())
    }
}

impl<T: Pod> Deref for AlignedRecords<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        let all: &[u8] = match &self.memory {
            RecordMemory::Heap(lines) => bytemuck::cast_slice(lines),
            RecordMemory::Pages(pages) => pages,
        };
        bytemuck::cast_slice(&all[self.bytes()])
    }
}

impl<T: Pod> DerefMut for AlignedRecords<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        let range = self.bytes();
        let all: &mut [u8] = match &mut self.memory {
            RecordMemory::Heap(lines) => bytemuck::cast_slice_mut(lines),
            RecordMemory::Pages(pages) => pages,
        };
        bytemuck::cast_slice_mut(&mut all[range])
    }
}

impl<'a, T: Pod> IntoIterator for &'a AlignedRecords<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<'a, T: Pod> IntoIterator for &'a mut AlignedRecords<T> {
    type Item = &'a mut T;
    type IntoIter = std::slice::IterMut<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

impl<T: Pod + fmt::Debug> fmt::Debug for AlignedRecords<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::shape::TreeShape;
    use crate::tree::{Node, NodeAttributes};

    /// Where levels are powers of two the groups below the root's children begin on a line, and none is on one more than it
    /// has to be.
    #[test]
    fn siblings_lie_on_few_lines() {
        lie_on_lines::<Node>();
        lie_on_lines::<NodeAttributes>();
    }

    fn lie_on_lines<T: Pod + PartialEq>() {
        assert!(AlignedRecords::<T>::of_tree(0).is_empty());
        for leaves in [2, 4, 6, 12, 100, 1000, 96_966, 871_414] {
            let shape = TreeShape::new(leaves);
            let nodes = AlignedRecords::<T>::of_tree(shape.node_count());
            assert_eq!(nodes.len(), shape.node_count());
            assert!(nodes.iter().all(|node| *node == T::zeroed()));
            assert_eq!(
                matches!(nodes.memory, RecordMemory::Pages(_)),
                size_of_val(&*nodes) >= RecordMemory::MANY
            );
            let copy = nodes.clone();
            let mut start = 1;
            let depth = shape.levels.len();
            for level in &shape.levels[..depth - 1] {
                for group in level.child_starts.windows(2) {
                    for nodes in [&nodes, &copy] {
                        let siblings = &nodes[start + group[0] as usize..start + group[1] as usize];
                        if siblings.len() < 4 {
                            assert_eq!(start, 1, "{leaves}: only the root has fewer than four");
                            continue;
                        }
                        let (address, bytes) = (siblings.as_ptr().addr(), 4 * size_of::<T>());
                        assert!(start == 1 || address % bytes == 0, "{leaves} leaves");
                    }
                }
                start += level.child_starts.last().map_or(0, |&end| end as usize);
            }
        }
    }

    /// Small or large, what is stored is found again.
    #[test]
    fn records_are_kept() {
        for len in [0, 1, 5, 1_000_000] {
            let mut numbers = AlignedRecords::<[u32; 3]>::zeroed(len);
            for (number, i) in numbers.iter_mut().zip(0..) {
                *number = [i, !i, 7];
            }
            let copies = [
                numbers.clone(),
                (*numbers).into(),
                numbers.iter().copied().collect(),
            ];
            for copy in copies {
                assert_eq!(copy.len(), len);
                assert!(copy.iter().zip(0..).all(|(&n, i)| n == [i, !i, 7]));
            }
        }
    }
}
