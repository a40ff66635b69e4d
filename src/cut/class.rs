//! What the tests decide about a node, in one byte; and all tests of four siblings by themselves.
//!
//! The cut from the root has the same tests in stages ([`super::batch`]); the lists are compared by the tests.

use super::Stats;
use super::quad;
use super::tester::Tester;
use crate::tree::{Leaf, Model};

/// What a node inherits from its parent, as bits.
pub(super) mod inherit {
    /// Wholly inside the view volume (or nothing is dropped by it): no test below.
    pub(in crate::cut) const INSIDE: u8 = 1;
    /// Every normal faces the viewer (or nothing is dropped by facing): no test below.
    pub(in crate::cut) const FRONT: u8 = 2;
}

/// What becomes of a node, one byte: nothing, a splat, 2 to 16 splats along its strip, or a descent with what
/// the children inherit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Class(u8);

impl Class {
    pub(super) const DROP: Self = Self(0);
    pub(super) const SPLAT: Self = Self(1);
    const OPEN: u8 = 0x40;
    const STRIP: u8 = 0x80;

    #[inline]
    pub(super) fn open(inherited: u8) -> Self {
        Self(Self::OPEN | inherited)
    }

    #[inline]
    pub(super) fn strip(count: u32) -> Self {
        Self(Self::STRIP | count as u8)
    }

    /// Whether the children are to be looked at.
    #[inline]
    pub(super) fn is_open(self) -> bool {
        self.0 & Self::OPEN != 0
    }

    /// What the children of an open node inherit.
    #[inline]
    pub(super) fn inherited(self) -> u8 {
        self.0 & (inherit::INSIDE | inherit::FRONT)
    }

    /// Number of splats along the strip, if it is drawn so.
    #[inline]
    pub(super) fn strip_count(self) -> Option<u32> {
        (self.0 & Self::STRIP != 0).then_some(u32::from(self.0 & 0x1f))
    }

    #[inline]
    pub(super) fn to_bits(self) -> u8 {
        self.0
    }

    #[inline]
    pub(super) fn from_bits(bits: u8) -> Self {
        Self(bits)
    }
}

impl Tester {
    /// What becomes of the `count` (1 to 4) nodes from `first` on, which inherit `inherited`. Lanes past
    /// `count` are [`Class::DROP`].
    #[inline]
    pub(super) fn nodes(
        &self,
        model: &Model,
        first: u32,
        count: u32,
        inherited: u8,
        stats: &mut Stats,
    ) -> [Class; 4] {
        let Some((group, there)) = quad::four(&model.tree.nodes, first) else {
            return [Class::DROP; 4];
        };
        let count = count.min(there);
        let valid = (1u32 << count) - 1;
        stats.visited += u64::from(count);
        let (spheres, words) = quad::of_nodes(&group);
        let balls = self.balls(spheres);
        let mut kept = valid;
        let mut inside = 0;
        if inherited & inherit::INSIDE == 0 {
            let (outside, all_inside) = self.volume(&balls);
            stats.outside += u64::from((outside & kept).count_ones());
            kept &= !outside;
            inside = all_inside;
            if kept == 0 {
                return [Class::DROP; 4];
            }
        }
        let mut front = 0;
        if inherited & inherit::FRONT == 0 && words.has_cones() {
            let (away, all_front) = self.cones(&balls, words.axis(), words.sine());
            stats.facing_away += u64::from((away & kept).count_ones());
            kept &= !away;
            front = all_front;
            if kept == 0 {
                return [Class::DROP; 4];
            }
        }
        let small = self.small(&balls);
        let mut strips = [0; 4];
        if kept & !small != 0 {
            let most = self.most_in_row(first, &words);
            let likely = self.may_be_rows(&balls, &words, most) & kept & !small;
            if likely != 0 {
                let (counts, fits) = self.rows(&balls, &words, most);
                for lane in 0..4 {
                    if fits & likely & (1 << lane) != 0 {
                        strips[lane] = counts[lane];
                    }
                }
            }
        }
        let mut classes = [Class::DROP; 4];
        for (lane, class) in classes.iter_mut().enumerate() {
            let bit = 1 << lane;
            if kept & bit == 0 {
                continue;
            }
            *class = if small & bit != 0 {
                Class::SPLAT
            } else {
                let open = Class::open(
                    inherited
                        | (u8::from(inside & bit != 0) * inherit::INSIDE)
                        | (u8::from(front & bit != 0) * inherit::FRONT),
                );
                match strips[lane] {
                    0 => open,
                    count => Class::strip(count),
                }
            };
        }
        classes
    }

    /// Which of the `count` (1 to 4) leaves from `first` on are outside of the view volume, and which of the
    /// others are small enough for a splat.
    #[inline]
    pub(super) fn leaves(
        &self,
        leaves: &[Leaf],
        first: u32,
        count: u32,
        inherited: u8,
        stats: &mut Stats,
    ) -> (u32, u32) {
        let Some((group, there)) = quad::four(leaves, first) else {
            return (0, 0);
        };
        let count = count.min(there);
        let mut kept = (1u32 << count) - 1;
        stats.visited += u64::from(count);
        let balls = self.balls(quad::of_leaves(&group));
        if inherited & inherit::INSIDE == 0 {
            let (outside, _) = self.volume(&balls);
            stats.outside += u64::from((outside & kept).count_ones());
            kept &= !outside;
        }
        (kept, self.small(&balls) & kept)
    }
}
