//! Draw lists that the device makes of numbers.

use crate::gpu::buffer::{AnyBuffer as _, BufferUsage, DeviceBuffer};
use crate::gpu::{Error, Gpu};
use crate::render::vulkan::device_tree::fits_bindings;
use std::sync::Arc;

/// What the device makes of the lists of one slot.
#[derive(Debug)]
pub(super) struct ExpandedLists {
    /// Records of splats.
    pub(super) splats: DeviceBuffer,
    /// Corners of triangles.
    pub(super) indices: DeviceBuffer,
    /// And of those that are small on screen.
    pub(super) small: DeviceBuffer,
    /// Records of patches.
    pub(super) polygons: DeviceBuffer,
    /// Places of patches in images.
    pub(super) places: DeviceBuffer,
}

/// First size of each, bytes; it grows by half when a frame needs more.
const FIRST_BYTES: u64 = 1 << 16;

/// Bytes of lists.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct ExpandedBytes {
    pub(super) splats: u64,
    pub(super) triangles: u64,
    pub(super) polygons: u64,
    /// Places of patches in images; 0 where none are shown.
    pub(super) places: u64,
}

impl ExpandedBytes {
    /// Tells whether each can be bound as storage.
    pub(super) fn fit(self, gpu: &Gpu) -> bool {
        fits_bindings(
            gpu,
            [self.splats, self.triangles, self.polygons, self.places],
        )
        .is_ok()
    }
}

impl ExpandedLists {
    /// Makes room for lists of so many bytes, where nothing reads what was there.
    ///
    /// # Errors
    /// When memory runs out.
    pub(super) fn reserve(
        gpu: &Arc<Gpu>,
        place: &mut Option<Self>,
        bytes: ExpandedBytes,
    ) -> Result<(), Error> {
        let made = |name, bytes| DeviceBuffer::new(gpu, name, BufferUsage::List, bytes);
        let names = [
            "splats by number",
            "triangles by number",
            "small triangles by number",
            "patches by number",
            "places of patches by number",
        ];
        let whole = match place {
            Some(whole) => whole,
            none => none.insert(Self {
                splats: made(names[0], FIRST_BYTES)?,
                indices: made(names[1], FIRST_BYTES)?,
                small: made(names[2], FIRST_BYTES)?,
                polygons: made(names[3], FIRST_BYTES)?,
                places: made(names[4], FIRST_BYTES)?,
            }),
        };
        let all = [
            (&mut whole.splats, bytes.splats),
            (&mut whole.indices, bytes.triangles),
            (&mut whole.small, bytes.triangles),
            (&mut whole.polygons, bytes.polygons),
            (&mut whole.places, bytes.places),
        ];
        for ((buffer, bytes), name) in all.into_iter().zip(names) {
            if bytes > buffer.bytes() {
                let grown = (buffer.bytes() * 3 / 2).min(gpu.info().max_buffer);
                *buffer = made(name, bytes.max(grown))?;
            }
        }
        Ok(())
    }
}
