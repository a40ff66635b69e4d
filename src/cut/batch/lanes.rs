//! The siblings of a batch in the lanes of vectors, four of each group.

use crate::cut::batch::{FRONT, INSIDE, SIZE, SiblingGroup};
use crate::cut::siblings::{PackedNodeLanes, SphereLanes};
use crate::simd::{WIDEST, WideLanes};
use fearless_simd::prelude::*;
use glam::Vec4;
use std::ops::{BitAnd, BitOr, Not};

/// Lanes of a batch.
pub(in crate::cut) const LANES: usize = 4 * SIZE;

/// Lanes in a word of a mask.
const WORD: usize = 64;

/// A bit for each lane of a batch.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(in crate::cut) struct LaneMask([u64; LANES / WORD]);

impl LaneMask {
    /// All lanes or none.
    #[inline(always)]
    pub(super) fn all(are_set: bool) -> Self {
        Self([if are_set { u64::MAX } else { 0 }; LANES / WORD])
    }

    /// The first lanes.
    #[inline(always)]
    pub(super) fn first(count: usize) -> Self {
        let mut mask = Self::default();
        for (word, from) in mask.0.iter_mut().zip((0..).step_by(WORD)) {
            let own = count.saturating_sub(from).min(WORD);
            *word = u64::MAX.checked_shr((WORD - own) as u32).unwrap_or(0);
        }
        mask
    }

    /// The bits of `count` lanes (a power of two, at most 32) from `lane` on, a multiple of it.
    #[inline(always)]
    pub(in crate::cut) fn get(&self, lane: usize, count: usize) -> u32 {
        let bits = self.0[lane / WORD % self.0.len()] >> (lane % WORD);
        bits as u32 & (u32::MAX >> (32 - count))
    }

    /// Sets lanes from `lane` on whose bits are set; they must be in the same word.
    #[inline(always)]
    pub(in crate::cut) fn add(&mut self, lane: usize, bits: u32) {
        let len = self.0.len();
        self.0[lane / WORD % len] |= u64::from(bits) << (lane % WORD);
    }

    /// Makes `count` lanes from `lane` on those bits, as [`get`](Self::get) gives them.
    #[inline(always)]
    pub(super) fn replace(&mut self, lane: usize, count: usize, bits: u32) {
        let len = self.0.len();
        let own = u64::from(u32::MAX >> (32 - count)) << (lane % WORD);
        let word = &mut self.0[lane / WORD % len];
        *word = *word & !own | u64::from(bits) << (lane % WORD) & own;
    }

    /// How many are set.
    #[inline(always)]
    pub(in crate::cut) fn count(&self) -> u32 {
        let [a, b, c, d] = self.0.map(u64::count_ones);
        a + b + c + d
    }

    #[inline(always)]
    pub(in crate::cut) fn is_empty(&self) -> bool {
        self.0 == [0; LANES / WORD]
    }

    /// The lanes that are set, in ascending order.
    #[inline(always)]
    pub(in crate::cut) fn lanes(self) -> MaskLanes {
        MaskLanes {
            words: self.0,
            index: 0,
        }
    }

    /// 64 lanes a word.
    #[inline(always)]
    pub(in crate::cut) fn words(&self) -> &[u64; LANES / WORD] {
        &self.0
    }

    #[inline(always)]
    pub(in crate::cut) fn words_mut(&mut self) -> &mut [u64; LANES / WORD] {
        &mut self.0
    }
}

impl BitAnd for LaneMask {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a & e, b & f, c & g, d & h])
    }
}

impl BitOr for LaneMask {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a | e, b | f, c | g, d | h])
    }
}

impl Not for LaneMask {
    type Output = Self;

    #[inline(always)]
    fn not(self) -> Self {
        let [a, b, c, d] = self.0;
        Self([!a, !b, !c, !d])
    }
}

/// Lanes of a mask.
#[derive(Debug, Clone)]
pub(in crate::cut) struct MaskLanes {
    words: [u64; LANES / WORD],
    index: usize,
}

impl Iterator for MaskLanes {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        while let Some(word) = self.words.get_mut(self.index) {
            if *word != 0 {
                let lane = word.trailing_zeros() as usize;
                *word &= *word - 1;
                return Some(WORD * self.index + lane);
            }
            self.index += 1;
        }
        None
    }
}

/// Room for a list of lanes, and for a whole vector from the last one on.
const ROOM: usize = LANES + WIDEST;

/// Spheres and words of the nodes of a batch, or spheres of leaves; numbers of one kind in a list each. Spheres become balls, see
/// [`SphereLanes`].
#[derive(Debug)]
pub(super) struct SiblingLanes {
    spheres: [[f32; LANES]; 4],
    depths: [f32; LANES],
    first_child: [u32; LANES],
    words: [[u32; LANES]; 3],
    /// Numbers of the nodes or leaves.
    numbers: [u32; LANES],
    /// What they inherit, as groups have it.
    inherited: [u32; LANES],
    /// Some of them, close together.
    packed: [[u32; ROOM]; 2],
}

impl Default for SiblingLanes {
    fn default() -> Self {
        Self {
            spheres: [[0.0; LANES]; 4],
            depths: [0.0; LANES],
            first_child: [0; LANES],
            words: [[0; LANES]; 3],
            numbers: [0; LANES],
            inherited: [0; LANES],
            packed: [[0; ROOM]; 2],
        }
    }
}

/// Stores a group's numbers.
#[inline(always)]
fn put<T: Copy>(list: &mut [T; LANES], group: usize, four: [T; 4]) {
    if let Some(place) = list.get_mut(4 * group..4 * group + 4) {
        place.copy_from_slice(&four);
    }
}

impl SiblingLanes {
    /// Which group it is.
    #[inline(always)]
    pub(super) fn put_group(&mut self, index: usize, group: SiblingGroup) {
        let numbers = [0, 1, 2, 3].map(|i| group.first.wrapping_add(i));
        put(&mut self.numbers, index, numbers);
        put(&mut self.inherited, index, [group.word & !0xff; 4]);
    }

    /// The node or leaf in a lane.
    #[inline(always)]
    pub(super) fn number(&self, lane: usize) -> u32 {
        self.numbers[lane % LANES]
    }

    /// Appends the nodes or leaves in the lanes of a mask.
    #[inline(always)]
    pub(super) fn push<S: Simd>(&mut self, simd: S, list: &mut Vec<u32>, mask: LaneMask) {
        if mask.is_empty() {
            return;
        }
        let ([own, _], mut len) = (&mut self.packed, 0);
        let width = WideLanes::<S>::LANES;
        for at in (0..LANES).step_by(width) {
            let lanes = mask.get(at, width);
            let numbers = WideLanes::<S>::load_words(simd, &self.numbers[at..at + width]);
            let mask = S::mask32s::from_bitmask(simd, lanes.into());
            WideLanes::<S>::pack(numbers, mask, own, len);
            len += lanes.count_ones() as usize;
        }
        list.extend_from_slice(own.get(..len).unwrap_or_default());
    }

    /// Appends the children of the nodes in the lanes of a mask, which inherit what was found of these: that they are wholly inside the
    /// view volume, and face the viewer.
    #[inline(always)]
    pub(super) fn push_children<S: Simd>(
        &mut self,
        simd: S,
        open: &mut Vec<SiblingGroup>,
        mask: LaneMask,
        (inside, front): (LaneMask, LaneMask),
    ) {
        let Self {
            first_child,
            words,
            inherited,
            packed,
            ..
        } = self;
        let ([first, found_words], mut len) = (packed, 0);
        let width = WideLanes::<S>::LANES;
        for at in (0..LANES).step_by(width) {
            let lanes = mask.get(at, width);
            if lanes == 0 {
                continue;
            }
            let own = at..at + width;
            let load = |list: &[u32; LANES]| WideLanes::<S>::load_words(simd, &list[own.clone()]);
            let lanes_of = |bits: u32| S::mask32s::from_bitmask(simd, bits.into());
            let word_if = |mask: &LaneMask, word: u32| {
                let word = S::u32s::splat(simd, word);
                lanes_of(mask.get(at, width)).select(word, S::u32s::splat(simd, 0))
            };
            let count = load(&words[2]) >> 16 & S::u32s::splat(simd, 0xff);
            let found = word_if(&inside, INSIDE) | word_if(&front, FRONT);
            let word = count | load(inherited) | found;
            let opened = lanes_of(lanes);
            WideLanes::<S>::pack(load(first_child), opened, first, len);
            WideLanes::<S>::pack(word, opened, found_words, len);
            len += lanes.count_ones() as usize;
        }
        let groups = first.iter().zip(found_words.iter()).take(len);
        open.extend(groups.map(|(&first, &word)| SiblingGroup { first, word }));
    }

    #[inline(always)]
    pub(super) fn put_spheres(&mut self, group: usize, [x, y, z, radius]: [Vec4; 4]) {
        let [xs, ys, zs, radii] = &mut self.spheres;
        put(xs, group, x.to_array());
        put(ys, group, y.to_array());
        put(zs, group, z.to_array());
        put(radii, group, radius.to_array());
    }

    #[inline(always)]
    pub(super) fn put_words(&mut self, group: usize, words: [[u32; 4]; 4]) {
        let [first_child, axis, sine, shape] = words;
        put(&mut self.first_child, group, first_child);
        let [axes, sines, shapes] = &mut self.words;
        put(axes, group, axis);
        put(sines, group, sine);
        put(shapes, group, shape);
    }

    #[inline(always)]
    pub(super) fn put_balls<S: Simd>(&mut self, at: usize, balls: &SphereLanes<WideLanes<S>>) {
        let lanes = at..at + WideLanes::<S>::LANES;
        let [x, y, z] = balls.center;
        let [xs, ys, zs, radii] = &mut self.spheres;
        x.store(&mut xs[lanes.clone()]);
        y.store(&mut ys[lanes.clone()]);
        z.store(&mut zs[lanes.clone()]);
        balls.radius.store(&mut radii[lanes.clone()]);
        balls.depth.store(&mut self.depths[lanes]);
    }

    /// The spheres of a vector from lane `at` on, or what they became.
    #[inline(always)]
    pub(super) fn spheres<S: Simd>(&self, simd: S, at: usize) -> [WideLanes<S>; 4] {
        let lanes = at..at + WideLanes::<S>::LANES;
        let [x, y, z, radius] = &self.spheres;
        [
            WideLanes::load(simd, &x[lanes.clone()]),
            WideLanes::load(simd, &y[lanes.clone()]),
            WideLanes::load(simd, &z[lanes.clone()]),
            WideLanes::load(simd, &radius[lanes]),
        ]
    }

    #[inline(always)]
    pub(super) fn balls<S: Simd>(&self, simd: S, at: usize) -> SphereLanes<WideLanes<S>> {
        let [x, y, z, radius] = self.spheres(simd, at);
        SphereLanes {
            center: [x, y, z],
            radius,
            depth: WideLanes::load(simd, &self.depths[at..at + WideLanes::<S>::LANES]),
        }
    }

    #[inline(always)]
    pub(super) fn words<S: Simd>(&self, simd: S, at: usize) -> PackedNodeLanes<WideLanes<S>> {
        let lanes = at..at + WideLanes::<S>::LANES;
        let [axis, sine, shape] = &self.words;
        PackedNodeLanes {
            axis: WideLanes::<S>::load_words(simd, &axis[lanes.clone()]),
            sine: WideLanes::<S>::load_words(simd, &sine[lanes.clone()]),
            shape: WideLanes::<S>::load_words(simd, &shape[lanes]),
        }
    }
}
