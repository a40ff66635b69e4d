//! Records of error patches as a tree file keeps them, one a node. `src/patches/packed.rs` says what their bits mean.

use bytemuck::{Pod, Zeroable};

/// The polygon of a node in 36 bytes, without colors, relative to the ball of the node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct PackedPatch {
    /// Plane's normal, octahedral 2 x 12 bit; above it the turn of the rectangle, 256ths of a quarter turn.
    pub(crate) plane: u32,
    /// Middle of the footprint less the center of the ball along the normal, over the radius, units of 1/32767.
    pub(crate) height: i16,
    /// Middle of the footprint along the sides of the rectangle, over the radius, units of 1/32767.
    pub(crate) middle: [i16; 2],
    /// Half sides over the radius, units of 1.03/65535.
    pub(crate) half_extents: [u16; 2],
    /// Always 0.
    pub(crate) unused: u16,
    /// Cuts of the corners, units of 1/255.
    pub(crate) cuts: [u8; 4],
    /// Logarithm of the thickness over the radius.
    pub(crate) thickness: u8,
    /// Logarithm of the overhang over the radius; 255 is an infinite overhang.
    pub(crate) overhang: u8,
    /// Tangents of the shading normal in the middle, 12 bits each.
    pub(crate) tangents: [u8; 3],
    /// Length of the mean normal, units of 1/255.
    pub(crate) sigma: u8,
    /// Change of the tangents over a radius, units of 2^exponent / 127.
    pub(crate) shape: [i8; 3],
    /// Exponent of `shape`.
    pub(crate) shape_exponent: i8,
    /// Logarithm of the largest of the residuals.
    pub(crate) residual: u8,
    /// Residuals of the five levels, 4 bits each: quarters of an octave below the largest; then flags, 4 bits.
    pub(crate) residuals_and_flags: [u8; 3],
    /// Logarithm of the largest residual of a corner.
    pub(crate) largest_residual: u8,
    /// Half angle, units of 60 degrees / 254.
    pub(crate) half_angle: u8,
}

impl PackedPatch {
    /// Bit of the flags: the node never is a patch; nothing else of it means anything.
    pub(crate) const NEVER: u8 = 1;

    /// A node that never is a patch.
    pub(crate) fn never() -> Self {
        Self {
            residuals_and_flags: [0, 0, Self::NEVER << 4],
            ..Self::zeroed()
        }
    }
}

/// Colors of the polygon of a node in 12 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct PackedPatchColors {
    /// Color in the middle, units of 1/255.
    pub(crate) color: [u8; 3],
    /// Root mean square of what is left, units of 1/255.
    pub(crate) residual: u8,
    /// Change along u and v over a radius, units of 2^exponent / 127.
    pub(crate) gradient: [[i8; 3]; 2],
    /// Exponent of `gradient`.
    pub(crate) gradient_exponent: i8,
    pub(crate) unused: u8,
}

/// Records of the nodes of a tree, in its order: 36 bytes a node, with colors 48. There are about half as many nodes as
/// triangles.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PatchRecords {
    /// A record a node.
    pub(crate) records: Vec<PackedPatch>,
    /// As many where the model has colors, else none.
    pub(crate) colors: Vec<PackedPatchColors>,
}

impl PatchRecords {
    /// Bytes in memory and in a file.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.records[..]) + size_of_val(&self.colors[..])
    }

    /// Bytes of a node's record.
    pub(crate) fn node_bytes(has_colors: bool) -> usize {
        let colors = if has_colors {
            size_of::<PackedPatchColors>()
        } else {
            0
        };
        size_of::<PackedPatch>() + colors
    }

    /// Records of some nodes, in the order of their ids as given.
    pub(crate) fn of_nodes(&self, ids: impl Iterator<Item = u32> + Clone) -> Self {
        let colored = ids.clone().filter(|_| !self.colors.is_empty());
        Self {
            records: ids.map(|id| self.records[id as usize]).collect(),
            colors: colored.map(|id| self.colors[id as usize]).collect(),
        }
    }

    /// Appends the records of further nodes.
    pub(crate) fn append(&mut self, more: Self) {
        self.records.extend(more.records);
        self.colors.extend(more.colors);
    }

    /// Appends the records as bytes: first all records, then all colors.
    pub(crate) fn append_to(&self, bytes: &mut Vec<u8>) {
        bytes.extend(bytemuck::cast_slice::<_, u8>(&self.records));
        bytes.extend(bytemuck::cast_slice::<_, u8>(&self.colors));
    }

    /// Records of `count` nodes from bytes that [`PatchRecords::append_to`] wrote; with colors where there are bytes for them.
    pub(crate) fn of_bytes(bytes: &[u8], count: usize) -> Self {
        let (records, colors) = bytes.split_at((count * size_of::<PackedPatch>()).min(bytes.len()));
        Self {
            records: all_of(records),
            colors: all_of(colors),
        }
    }

    /// The same records, and behind them nodes that never are patches, so that there is one for each of `count` nodes.
    #[must_use]
    pub(crate) fn filled(mut self, count: usize) -> Self {
        if !self.colors.is_empty() {
            self.colors.resize(count, PackedPatchColors::zeroed());
        }
        self.records.resize(count, PackedPatch::never());
        self
    }
}

fn all_of<T: Pod>(bytes: &[u8]) -> Vec<T> {
    let each = bytes.chunks_exact(size_of::<T>());
    each.map(bytemuck::pod_read_unaligned).collect()
}
