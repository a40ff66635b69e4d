//! One frame of the ring, as far as passes and bindings know it.

use super::buffer::UploadBuffer;
use super::query::SlotQueries;
use ash::vk;
use std::time::Instant;

/// One frame slot: recorded, submitted and read back before it is used again.
pub(super) struct FrameSlot {
    pub(super) pool: vk::CommandPool,
    pub(super) commands: vk::CommandBuffer,
    pub(super) queries: SlotQueries,
    pub(super) descriptors: vk::DescriptorPool,
    pub(super) uniforms: UploadBuffer,
    pub(super) submitted: u64,
    pub(super) uniform_bytes: u64,
    pub(super) submit_time: Option<Instant>,
}

/// Place that a uniform block was put at.
#[derive(Debug, Clone, Copy)]
pub struct UniformBlock {
    pub(super) offset: u64,
    pub(super) bytes: u64,
}
