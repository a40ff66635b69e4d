//! Places the leaves into the shape: exact selection along the longest axis of their centers' box.
//!
//! A run of sibling nodes is halved (the first floor(k/2) of k, and the rest), its leaves are divided by rank along the
//! longest axis of the box of their centers, x before y before z where equal; equal coordinates keep their order, which
//! starts as that of the file. Each half goes on the same way until single leaves are left. So the order is a function of the
//! centers alone, whatever the number of threads.
//!
//! Deviation from Benda, section 3.2.1: he halves the leaves, groups them, and starts again with the groups' spheres at
//! each level; the counts are the same ([`super::shape`]), the groups above the first level are not.
//!
//! Speed: one stable, branch-free partition into a second buffer for each halving, which also yields the two boxes; the
//! splitting value comes from a sample (many leaves), from interpolated counting (fewer), or from ranks by comparison
//! of all pairs (few, the bulk of the work: everything stays in registers and the first cache).

use super::select::{self, SelectPivot, SelectScratch};
use super::shape::TreeShape;
use super::sort_item::SortItem;
use glam::Vec4;
use std::sync::atomic::{AtomicBool, Ordering};

/// An axis-aligned box in the first three lanes.
#[derive(Clone, Copy)]
struct LaneBounds {
    min: Vec4,
    max: Vec4,
}

impl LaneBounds {
    const EMPTY: Self = Self {
        min: Vec4::INFINITY,
        max: Vec4::NEG_INFINITY,
    };

    #[inline]
    fn of(items: &[SortItem]) -> Self {
        // Four chains, so that the latency of one does not decide.
        let mut parts = [Self::EMPTY; 4];
        let mut chunks = items.chunks_exact(4);
        for chunk in &mut chunks {
            for (part, item) in parts.iter_mut().zip(chunk) {
                part.add(item.lanes());
            }
        }
        for item in chunks.remainder() {
            parts[0].add(item.lanes());
        }
        parts[0].union(parts[1]).union(parts[2].union(parts[3]))
    }

    #[inline]
    fn add(&mut self, point: Vec4) {
        self.min = self.min.min(point);
        self.max = self.max.max(point);
    }

    #[inline]
    fn union(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// The longest axis, the first one among equals.
    #[inline]
    fn axis(&self) -> usize {
        let size = self.max - self.min;
        let axis = usize::from(size.y > size.x);
        if size.z > size[axis] { 2 } else { axis }
    }
}

/// Sets of at most this many leaves are finished in a local array.
const SMALL: usize = 32;
/// Sets of more than this many find their splitting value from a sample.
const LARGE: usize = 4096;
/// Sets of more than this many are divided among threads.
const PARALLEL: usize = 1 << 15;

/// What every step of the recursion needs.
pub(super) struct TreePartition<'a> {
    /// The shape to fill.
    pub(super) shape: &'a TreeShape,
    /// Set by another thread to stop; the order is then unfinished.
    pub(super) stop: &'a AtomicBool,
    /// Called with a number of leaves that have found their place (about once per 32768).
    pub(super) placed: &'a (dyn Fn(u64) + Sync),
}

/// A run of siblings: nodes (or leaves) `first..end` of `level`.
#[derive(Clone, Copy)]
pub(super) struct PartitionRun {
    level: usize,
    first: u32,
    end: u32,
}

impl PartitionRun {
    /// The root alone: all leaves.
    pub(super) const ROOT: Self = Self {
        level: 0,
        first: 0,
        end: 1,
    };
}

impl TreePartition<'_> {
    /// Orders `items` (in file order at first). `spare` has the same length; its content is lost.
    pub(super) fn run(&self, items: &mut [SortItem], spare: &mut [SortItem]) {
        assert_eq!(items.len(), spare.len(), "both buffers hold every leaf");
        if items.len() < 2 {
            return;
        }
        let bounds = LaneBounds::of(items);
        self.divide(
            PartitionRun::ROOT,
            items,
            spare,
            true,
            bounds,
            &mut SelectScratch::default(),
        );
    }

    /// Descends to a run of several items, or `None` at a single leaf.
    #[inline]
    pub(super) fn descend(&self, mut run: PartitionRun) -> Option<PartitionRun> {
        while run.end - run.first == 1 {
            let level = self.shape.levels.get(run.level)?;
            run = PartitionRun {
                level: run.level + 1,
                first: level.child_starts[run.first as usize],
                end: level.child_starts[run.first as usize + 1],
            };
        }
        Some(run)
    }

    /// Both halves of a run and the number of leaves in the first.
    #[inline]
    pub(super) fn halves(&self, run: PartitionRun) -> (PartitionRun, PartitionRun, usize) {
        let middle = run.first + (run.end - run.first) / 2;
        let count =
            self.shape.leaf_start(run.level, middle) - self.shape.leaf_start(run.level, run.first);
        (
            PartitionRun { end: middle, ..run },
            PartitionRun {
                first: middle,
                ..run
            },
            count as usize,
        )
    }

    /// Orders the leaves of `run`, which lie in `from`; the result is in `from` if `stays`, else in `to`.
    fn divide(
        &self,
        run: PartitionRun,
        from: &mut [SortItem],
        to: &mut [SortItem],
        stays: bool,
        bounds: LaneBounds,
        scratch: &mut SelectScratch,
    ) {
        let n = from.len();
        if n <= SMALL {
            if !stays {
                to.copy_from_slice(from);
            }
            self.finish(run, if stays { from } else { to });
            return;
        }
        if n > PARALLEL && self.stop.load(Ordering::Relaxed) {
            return;
        }
        let Some(run) = self.descend(run) else { return };
        let (one, two, k) = self.halves(run);
        let axis = bounds.axis();
        let pivot = if n > LARGE {
            select::pivot_by_sample(from, k, axis, scratch)
        } else {
            select::pivot_by_counting(from, k, axis, (bounds.min[axis], bounds.max[axis]), scratch)
        };
        let (bounds_one, bounds_two) = split(from, to, k, axis, pivot);
        let (from_one, from_two) = from.split_at_mut(k);
        let (to_one, to_two) = to.split_at_mut(k);
        // The leaves now lie in `to`: the roles change.
        if n <= PARALLEL {
            self.divide(one, to_one, from_one, !stays, bounds_one, scratch);
            self.divide(two, to_two, from_two, !stays, bounds_two, scratch);
            return;
        }
        *scratch = SelectScratch::default();
        let task =
            |run: PartitionRun, from: &mut [SortItem], to: &mut [SortItem], bounds: LaneBounds| {
                self.divide(run, from, to, !stays, bounds, &mut SelectScratch::default());
                if from.len() <= PARALLEL {
                    (self.placed)(from.len() as u64);
                }
            };
        rayon::join(
            || task(one, to_one, from_one, bounds_one),
            || task(two, to_two, from_two, bounds_two),
        );
    }

    /// Orders a small set where it lies.
    fn finish(&self, run: PartitionRun, items: &mut [SortItem]) {
        let Some(run) = self.descend(run) else { return };
        let (one, two, k) = self.halves(run);
        let axis = LaneBounds::of(items).axis();
        match items.len() {
            2 => {
                if items[1].key(axis) < items[0].key(axis) {
                    items.swap(0, 1);
                }
                return;
            }
            ..=4 => split_small::<4>(items, k, axis),
            5..=8 => split_small::<8>(items, k, axis),
            9..=16 => split_small::<16>(items, k, axis),
            _ => split_small::<SMALL>(items, k, axis),
        }
        let (items_one, items_two) = items.split_at_mut(k);
        if items_one.len() > 1 {
            self.finish(one, items_one);
        }
        if items_two.len() > 1 {
            self.finish(two, items_two);
        }
    }
}

/// Moves the k first of at most N items to the front, both parts in their old order.
#[inline]
fn split_small<const N: usize>(items: &mut [SortItem], k: usize, axis: usize) {
    let n = items.len();
    debug_assert!(n <= N && k <= n);
    let mut keys = [f32::INFINITY; N];
    let mut copy = [SortItem::default(); N];
    for (i, item) in items.iter().enumerate() {
        keys[i] = item.key(axis);
        copy[i] = *item;
    }
    // Rank by counting: all pairs are compared, which for so few is faster than any sort.
    let mut goes_left = [false; N];
    let mut lefts = 0;
    for i in 0..n {
        let mut rank = 0u32;
        for j in 0..N {
            rank += u32::from(keys[j] < keys[i]);
        }
        goes_left[i] = (rank as usize) < k;
        lefts += usize::from(goes_left[i]);
    }
    if lefts != k {
        // Equal coordinates at the boundary: the earlier ones go left.
        let largest = (0..n)
            .filter(|&i| goes_left[i])
            .map(|i| keys[i])
            .fold(f32::NEG_INFINITY, f32::max);
        for i in (0..n).rev() {
            if lefts > k && goes_left[i] && keys[i] == largest {
                goes_left[i] = false;
                lefts -= 1;
            }
        }
    }
    let mut left = 0;
    for i in 0..n {
        let is_left = usize::from(goes_left[i]);
        // The right part has taken i - left so far.
        let target = if is_left == 1 { left } else { k + i - left };
        items[target] = copy[i];
        left += is_left;
    }
}

/// Partition of `from` into `to`, the first `k` before the pivot; returns the boxes of both parts.
fn split(
    from: &[SortItem],
    to: &mut [SortItem],
    k: usize,
    axis: usize,
    pivot: SelectPivot,
) -> (LaneBounds, LaneBounds) {
    /// The boxes are taken from each piece while it is in the first cache.
    const PIECE: usize = 512;
    let (mut one, mut two) = (LaneBounds::EMPTY, LaneBounds::EMPTY);
    let mut left = 0usize;
    let mut start = 0usize;
    for piece in from.chunks(PIECE) {
        let left_before = left;
        for (offset, item) in piece.iter().enumerate() {
            let i = start + offset;
            let key = item.key(axis);
            let goes_left =
                (key < pivot.key) | ((key == pivot.key) & ((i as u32) < pivot.position));
            let right = k + i - left;
            // Selected by mask, not by branch: half of the branches would be mispredicted.
            let mask = usize::from(goes_left).wrapping_neg();
            to[(left & mask) | (right & !mask)] = *item;
            left += usize::from(goes_left);
        }
        one = one.union(LaneBounds::of(&to[left_before..left]));
        two = two.union(LaneBounds::of(
            &to[k + start - left_before..k + start + piece.len() - left],
        ));
        start += piece.len();
    }
    (one, two)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use glam::Vec3;

    fn random(state: &mut u64) -> f32 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((*state >> 40) as f32) / (1u64 << 24) as f32
    }

    /// The definition, by sorting: box, longest axis, stable order, halves of the run.
    fn reference(shape: &TreeShape, run: PartitionRun, items: &mut [SortItem]) {
        let mut run = run;
        while run.end - run.first == 1 {
            let Some(level) = shape.levels.get(run.level) else {
                return;
            };
            let range = &level.child_starts[run.first as usize..];
            run = PartitionRun {
                level: run.level + 1,
                first: range[0],
                end: range[1],
            };
        }
        let mut size = [0f32; 3];
        for (axis, size) in size.iter_mut().enumerate() {
            let keys = || items.iter().map(|item| item.center[axis]);
            *size = keys().fold(f32::NEG_INFINITY, f32::max) - keys().fold(f32::INFINITY, f32::min);
        }
        let largest = size[0].max(size[1]).max(size[2]);
        let axis = size.iter().position(|&s| s == largest).unwrap();
        let middle = run.first + (run.end - run.first) / 2;
        let k =
            (shape.leaf_start(run.level, middle) - shape.leaf_start(run.level, run.first)) as usize;
        let mut sorted: Vec<(f32, usize)> = items
            .iter()
            .enumerate()
            .map(|(i, item)| (item.center[axis] + 0.0, i))
            .collect();
        sorted.sort_by(|a, b| a.partial_cmp(b).unwrap());
        let mut sides: [Vec<usize>; 2] = [Vec::new(), Vec::new()];
        for (rank, &(_, i)) in sorted.iter().enumerate() {
            sides[usize::from(rank >= k)].push(i);
        }
        for side in &mut sides {
            side.sort_unstable();
        }
        let copy = items.to_vec();
        for (item, &i) in items.iter_mut().zip(sides.iter().flatten()) {
            *item = copy[i];
        }
        let (one, two) = items.split_at_mut(k);
        reference(shape, PartitionRun { end: middle, ..run }, one);
        reference(
            shape,
            PartitionRun {
                first: middle,
                ..run
            },
            two,
        );
    }

    fn place(items: &[SortItem]) -> Vec<SortItem> {
        let shape = TreeShape::new(items.len() as u32);
        let mut items = items.to_vec();
        let mut spare = vec![SortItem::default(); items.len()];
        TreePartition {
            shape: &shape,
            stop: &AtomicBool::new(false),
            placed: &|_| {},
        }
        .run(&mut items, &mut spare);
        items
    }

    #[test]
    fn order_is_the_one_defined() {
        let mut state = 5;
        for n in [
            0, 1, 2, 3, 4, 5, 7, 16, 17, 31, 32, 33, 63, 64, 65, 130, 1000, 4096, 4097, 9000,
            40_000,
        ] {
            for kind in 0..6 {
                let items: Vec<SortItem> = (0..n)
                    .map(|i| {
                        let mut r = || random(&mut state);
                        let center = match kind {
                            0 => Vec3::new(r(), r(), r()),
                            // Many equal coordinates, with both zeros.
                            1 => Vec3::new(
                                (r() * 5.0).floor() - 2.0,
                                (r() * 3.0).floor() * -0.0,
                                (r() * 4.0).floor(),
                            ),
                            2 => Vec3::ONE,
                            // Very uneven.
                            3 => Vec3::new(r().powi(40), r() * 1e-3, 0.0),
                            // Sorted, and along one line.
                            4 => Vec3::splat(i as f32),
                            // Two clusters far apart.
                            _ => Vec3::new(r() + if i % 3 == 0 { 1e6 } else { -1e6 }, r(), r()),
                        };
                        SortItem {
                            center,
                            index: i as u32,
                        }
                    })
                    .collect();
                let mut expected = items.clone();
                let run = PartitionRun {
                    level: 0,
                    first: 0,
                    end: 1,
                };
                if n > 1 {
                    reference(&TreeShape::new(n as u32), run, &mut expected);
                }
                assert!(place(&items) == expected, "{n} items of kind {kind}");
            }
        }
    }

    #[test]
    fn extreme_coordinates_do_not_hang() {
        let items: Vec<SortItem> = (0..5000u32)
            .map(|i| SortItem {
                center: Vec3::new(
                    [f32::MAX, f32::MIN, 1e-45, -0.0][i as usize % 4],
                    0.0,
                    i as f32,
                ),
                index: i,
            })
            .collect();
        let mut seen: Vec<u32> = place(&items).iter().map(|item| item.index).collect();
        seen.sort_unstable();
        assert!(seen.iter().copied().eq(0..5000));
    }
}
