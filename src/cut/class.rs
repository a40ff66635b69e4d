//! What the tests decide about a node, in one byte.

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
