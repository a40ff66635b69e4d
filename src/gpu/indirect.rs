//! Draws and dispatches whose arguments the device wrote.

use super::access::ResourceAccess;
use super::buffer::AnyBuffer;
use super::compute::ComputeRecorder;
use super::pass::{DrawRecorder, PassBuilder};
use ash::vk;
use std::ops::Range;

/// # Panics
/// When a buffer was not declared, or has no such bytes that arguments may lie in.
fn check(pass: &str, declared: &[vk::Buffer], buffer: &dyn AnyBuffer, bytes: Range<u64>) {
    assert!(
        declared.contains(&buffer.handle()),
        "pass {pass} did not declare arguments {}",
        buffer.name()
    );
    assert!(
        bytes.start.is_multiple_of(4) && bytes.end <= buffer.bytes(),
        "pass {pass}: arguments outside of {}",
        buffer.name()
    );
}

impl PassBuilder<'_> {
    /// Reads the arguments of draws from a buffer.
    #[must_use]
    pub fn arguments(self, buffer: &dyn AnyBuffer) -> Self {
        self.barriers.buffer(buffer, ResourceAccess::IndirectRead);
        self.barriers.declared[3].push(buffer.handle());
        self
    }
}

impl PassBuilder<'_> {
    /// Reads the arguments of dispatches from a buffer that an earlier pass wrote.
    #[must_use]
    pub fn group_arguments(self, buffer: &dyn AnyBuffer) -> Self {
        self.barriers.buffer(buffer, ResourceAccess::IndirectRead);
        self.barriers.declared[2].push(buffer.handle());
        self
    }
}

impl DrawRecorder<'_> {
    /// Draws what the four words at `offset` of a declared buffer say: number of vertices and instances, first vertex and
    /// instance.
    ///
    /// # Panics
    /// When the pass did not declare the buffer, or the words lie outside of it.
    pub fn draw_from(&mut self, buffer: &dyn AnyBuffer, offset: u64) {
        if self.site.has_failed.get() {
            return;
        }
        check(
            self.site.name,
            self.argument_buffers,
            buffer,
            offset..offset + 16,
        );
        // SAFETY: as in `draw`; the arguments were written by a pass before, whose writes this one was made to see.
        unsafe {
            self.site.gpu.device.cmd_draw_indirect(
                self.site.commands,
                buffer.handle(),
                offset,
                1,
                16,
            );
        }
    }

    /// Draws what the five words at `offset` of a declared buffer say: number of indices and instances, first index, what is
    /// added to each, first instance.
    ///
    /// # Panics
    /// As [`draw_from`](DrawRecorder::draw_from).
    pub fn draw_indexed_from(&mut self, buffer: &dyn AnyBuffer, offset: u64) {
        if self.site.has_failed.get() {
            return;
        }
        check(
            self.site.name,
            self.argument_buffers,
            buffer,
            offset..offset + 20,
        );
        // SAFETY: as in `draw_from`; every index names a vertex of the bound buffer.
        unsafe {
            self.site.gpu.device.cmd_draw_indexed_indirect(
                self.site.commands,
                buffer.handle(),
                offset,
                1,
                20,
            );
        }
    }
}

impl ComputeRecorder<'_> {
    /// Runs as many workgroups as the three words at `offset` (a multiple of 4) of a buffer say. An earlier pass wrote them
    /// ([`group_arguments`](PassBuilder::group_arguments)), or a dispatch before it in this pass, and
    /// [`after`](ComputeRecorder::after) it. Each must be below what every device takes.
    ///
    /// # Panics
    /// When the words lie outside of the buffer, or the pass did not declare it.
    pub fn groups_from(&mut self, buffer: &dyn AnyBuffer, offset: u64) {
        if self.site.has_failed.get() {
            return;
        }
        check(
            self.site.name,
            self.site.storage,
            buffer,
            offset..offset + 12,
        );
        // SAFETY: a compute pipeline and its descriptors are bound; the buffer is alive until the frame has finished, has
        // the usage of arguments, and the words lie in it.
        unsafe {
            self.site
                .gpu
                .device
                .cmd_dispatch_indirect(self.site.commands, buffer.handle(), offset);
        }
    }

    /// Dispatches from here on see what those before wrote, as storage and as arguments, and write after these have read.
    pub fn after(&mut self) {
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(
                vk::PipelineStageFlags2::COMPUTE_SHADER | vk::PipelineStageFlags2::DRAW_INDIRECT,
            )
            .src_access_mask(vk::AccessFlags2::SHADER_STORAGE_WRITE)
            .dst_stage_mask(
                vk::PipelineStageFlags2::COMPUTE_SHADER | vk::PipelineStageFlags2::DRAW_INDIRECT,
            )
            .dst_access_mask(
                vk::AccessFlags2::SHADER_STORAGE_READ
                    | vk::AccessFlags2::SHADER_STORAGE_WRITE
                    | vk::AccessFlags2::INDIRECT_COMMAND_READ,
            )];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the command buffer is being recorded outside of a rendering scope.
        unsafe {
            self.site
                .gpu
                .device
                .cmd_pipeline_barrier2(self.site.commands, &info);
        }
    }
}
