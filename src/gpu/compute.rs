//! Compute pipelines and the passes that dispatch them.

use super::access::ResourceAccess;
use super::bind::{self, BindSite, BoundResources, BufferSlice};
use super::buffer::AnyBuffer;
use super::frame::UniformBlock;
use super::pass::PassBuilder;
use super::pipeline::ShaderPipeline;
use ash::vk;
use std::cell::Cell;

/// Dispatches inside a pass.
pub struct ComputeRecorder<'a> {
    pub(super) site: BindSite<'a>,
    /// Invocations of a workgroup of the bound pipeline.
    group: u32,
}

impl std::fmt::Debug for ComputeRecorder<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Compute")
            .field("pass", &self.site.name)
            .finish_non_exhaustive()
    }
}

impl PassBuilder<'_> {
    /// Reads a storage buffer in the compute shader.
    #[must_use]
    pub fn storage_read(self, buffer: &dyn AnyBuffer) -> Self {
        self.barriers.buffer(buffer, ResourceAccess::StorageRead);
        self.barriers.declared[2].push(buffer.handle());
        self
    }

    /// Reads and writes a storage buffer in the compute shader.
    #[must_use]
    pub fn storage(self, buffer: &dyn AnyBuffer) -> Self {
        self.barriers.buffer(buffer, ResourceAccess::StorageWrite);
        self.barriers.declared[2].push(buffer.handle());
        self
    }

    /// Records a pass that fills the first bytes of buffers, each so many (a multiple of 4), with `word`.
    ///
    /// # Panics
    /// When a buffer has fewer.
    pub fn fill(mut self, buffers: &[(&dyn AnyBuffer, u64)], word: u32) {
        for (buffer, _) in buffers {
            self.barriers.buffer(*buffer, ResourceAccess::Fill);
        }
        let timing = self.begin();
        for (buffer, bytes) in buffers {
            self.fill_one(*buffer, *bytes, word);
        }
        timing.end(&self.slot.queries);
    }

    fn fill_one(&self, buffer: &dyn AnyBuffer, bytes: u64, word: u32) {
        assert!(
            bytes <= buffer.bytes() && bytes.is_multiple_of(4),
            "pass {} fills {bytes} bytes of {}",
            self.name,
            buffer.name()
        );
        if bytes == 0 {
            return;
        }
        // SAFETY: the command buffer is being recorded outside of a rendering scope; the buffer is alive until the
        // frame has finished, has the usage of a copy's target, and its first `bytes` bytes, a multiple of 4.
        unsafe {
            self.gpu
                .device
                .cmd_fill_buffer(self.slot.commands, buffer.handle(), 0, bytes, word);
        }
    }

    /// Records a compute pass: barriers, label, timestamps, and what `record` dispatches.
    ///
    /// # Panics
    /// When `record` binds a buffer that was not declared.
    pub fn compute(mut self, record: impl FnOnce(&mut ComputeRecorder<'_>)) {
        let declared = std::mem::take(&mut self.barriers.declared);
        let timing = self.begin();
        let gpu = self.gpu.clone();
        let mut compute = ComputeRecorder {
            site: BindSite {
                gpu: &gpu,
                commands: self.slot.commands,
                descriptors: self.slot.descriptors,
                uniforms: self.slot.uniforms.handle(),
                storage: &declared[2],
                name: self.name,
                has_failed: Cell::default(),
            },
            group: 1,
        };
        record(&mut compute);
        timing.end(&self.slot.queries);
        // Handed back for the next pass, which clears them.
        self.barriers.declared = declared;
    }
}

impl ComputeRecorder<'_> {
    /// Binds a pipeline with its uniform blocks and storage buffers, each in ascending order of their
    /// bindings.
    ///
    /// # Panics
    /// When a binding gets nothing, or a resource was not declared by the pass.
    pub fn bind(
        &mut self,
        pipeline: &ShaderPipeline,
        uniforms: &[UniformBlock],
        storage: &[BufferSlice<'_>],
    ) {
        let bound = BoundResources {
            uniforms,
            images: &[],
            storage,
        };
        bind::bind(&self.site, vk::PipelineBindPoint::COMPUTE, pipeline, &bound);
        self.group = pipeline.parts().group;
    }

    /// Runs at least `items` invocations, as rows of workgroups that the device's limit allows: a shader finds its
    /// item as `gl_WorkGroupID.y * gl_NumWorkGroups.x * group + gl_GlobalInvocationID.x`, and must leave alone
    /// what is not below its count.
    pub fn items(&mut self, items: u32) {
        let groups = items.div_ceil(self.group);
        if groups == 0 || self.site.has_failed.get() {
            return;
        }
        let rows = groups.div_ceil(MAX_GROUPS);
        // SAFETY: a compute pipeline and its descriptors are bound; both counts are at most 65,535, which every device
        // takes: 2^32 items of workgroups of at least 1 are at most 65,537 rows, and no list has that many.
        unsafe {
            self.site
                .gpu
                .device
                .cmd_dispatch(self.site.commands, groups.div_ceil(rows), rows, 1);
        }
    }
}

/// Workgroups in one dimension that every device takes (Vulkan 1.3, table of required limits).
const MAX_GROUPS: u32 = 65_535;
