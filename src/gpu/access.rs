//! From declared accesses to barriers: one table, no Vulkan calls, tested on its own.
//!
//! The validation layer of Debian 12 misses hazards between dynamic-rendering attachments, and the software
//! device runs in order and does not show them. So no barrier is written by hand: a pass declares how it
//! uses each resource, and [`ResourceState::transition`] gives the barrier that the Vulkan memory model asks for.

use ash::vk;

/// Use that a pass makes of a resource.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ResourceAccess {
    /// Sampled in a fragment shader.
    Sampled,
    /// Read as storage in a compute shader.
    StorageRead,
    /// Read and written as storage in a compute shader.
    StorageWrite,
    /// Read as storage in a fragment shader.
    FragmentStorageRead,
    /// Read as storage in a vertex shader.
    VertexStorageRead,
    /// Filled with a constant by a command.
    Fill,
    /// Written as a color target without reading what it held.
    ColorTarget,
    /// Written as a color target that is loaded or blended with.
    BlendTarget,
    /// Depth tested, not written.
    DepthTest,
    /// Depth tested and written.
    DepthWrite,
    /// Read by a copy.
    CopySource,
    /// Written by a copy.
    CopyTarget,
    /// Read by a blit (a copy that converts the format).
    BlitSource,
    /// Written by a blit.
    BlitTarget,
    /// Read by the host after the submission has finished.
    HostRead,
    /// Read as vertex attributes.
    VertexRead,
    /// Read as indices.
    IndexRead,
    /// Read as the arguments of a draw or dispatch.
    IndirectRead,
    /// Read as a uniform block by any shader.
    UniformRead,
    /// Handed to the presentation engine.
    Present,
}

/// Stages, accesses and layout of an access in Vulkan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AccessScope {
    /// Pipeline stages that do it.
    pub stages: vk::PipelineStageFlags2,
    /// Kinds of memory access.
    pub access: vk::AccessFlags2,
    /// Layout that an image must be in.
    pub layout: vk::ImageLayout,
    /// Memory is written.
    pub writes: bool,
}

impl ResourceAccess {
    /// Every access, for tests of the table.
    pub const ALL: [Self; 20] = [
        Self::Sampled,
        Self::StorageRead,
        Self::StorageWrite,
        Self::FragmentStorageRead,
        Self::VertexStorageRead,
        Self::Fill,
        Self::ColorTarget,
        Self::BlendTarget,
        Self::DepthTest,
        Self::DepthWrite,
        Self::CopySource,
        Self::CopyTarget,
        Self::BlitSource,
        Self::BlitTarget,
        Self::HostRead,
        Self::VertexRead,
        Self::IndexRead,
        Self::IndirectRead,
        Self::UniformRead,
        Self::Present,
    ];

    /// The row of the table.
    pub fn scope(self) -> AccessScope {
        use vk::AccessFlags2 as A;
        use vk::ImageLayout as L;
        use vk::PipelineStageFlags2 as S;
        let depth_stages = S::EARLY_FRAGMENT_TESTS | S::LATE_FRAGMENT_TESTS;
        let (stages, access, layout, writes) = match self {
            Self::Sampled => (
                S::FRAGMENT_SHADER,
                A::SHADER_SAMPLED_READ,
                L::SHADER_READ_ONLY_OPTIMAL,
                false,
            ),
            Self::StorageRead => (S::COMPUTE_SHADER, A::SHADER_STORAGE_READ, L::GENERAL, false),
            Self::StorageWrite => (
                S::COMPUTE_SHADER,
                A::SHADER_STORAGE_READ | A::SHADER_STORAGE_WRITE,
                L::GENERAL,
                true,
            ),
            Self::FragmentStorageRead => (
                S::FRAGMENT_SHADER,
                A::SHADER_STORAGE_READ,
                L::GENERAL,
                false,
            ),
            Self::VertexStorageRead => {
                (S::VERTEX_SHADER, A::SHADER_STORAGE_READ, L::GENERAL, false)
            }
            // The specification calls a fill a transfer without saying which of its stages.
            Self::Fill => (
                S::ALL_TRANSFER,
                A::TRANSFER_WRITE,
                L::TRANSFER_DST_OPTIMAL,
                true,
            ),
            Self::ColorTarget => (
                S::COLOR_ATTACHMENT_OUTPUT,
                A::COLOR_ATTACHMENT_WRITE,
                L::COLOR_ATTACHMENT_OPTIMAL,
                true,
            ),
            Self::BlendTarget => (
                S::COLOR_ATTACHMENT_OUTPUT,
                A::COLOR_ATTACHMENT_READ | A::COLOR_ATTACHMENT_WRITE,
                L::COLOR_ATTACHMENT_OPTIMAL,
                true,
            ),
            Self::DepthTest => (
                depth_stages,
                A::DEPTH_STENCIL_ATTACHMENT_READ,
                L::DEPTH_READ_ONLY_OPTIMAL,
                false,
            ),
            Self::DepthWrite => (
                depth_stages,
                A::DEPTH_STENCIL_ATTACHMENT_READ | A::DEPTH_STENCIL_ATTACHMENT_WRITE,
                L::DEPTH_ATTACHMENT_OPTIMAL,
                true,
            ),
            Self::CopySource => (S::COPY, A::TRANSFER_READ, L::TRANSFER_SRC_OPTIMAL, false),
            Self::CopyTarget => (S::COPY, A::TRANSFER_WRITE, L::TRANSFER_DST_OPTIMAL, true),
            Self::BlitSource => (S::BLIT, A::TRANSFER_READ, L::TRANSFER_SRC_OPTIMAL, false),
            Self::BlitTarget => (S::BLIT, A::TRANSFER_WRITE, L::TRANSFER_DST_OPTIMAL, true),
            Self::HostRead => (S::HOST, A::HOST_READ, L::GENERAL, false),
            Self::VertexRead => (
                S::VERTEX_ATTRIBUTE_INPUT,
                A::VERTEX_ATTRIBUTE_READ,
                L::UNDEFINED,
                false,
            ),
            Self::IndexRead => (S::INDEX_INPUT, A::INDEX_READ, L::UNDEFINED, false),
            Self::IndirectRead => (
                S::DRAW_INDIRECT,
                A::INDIRECT_COMMAND_READ,
                L::UNDEFINED,
                false,
            ),
            Self::UniformRead => (
                S::VERTEX_SHADER | S::FRAGMENT_SHADER | S::COMPUTE_SHADER,
                A::UNIFORM_READ,
                L::UNDEFINED,
                false,
            ),
            Self::Present => (S::NONE, A::NONE, L::PRESENT_SRC_KHR, false),
        };
        AccessScope {
            stages,
            access,
            layout,
            writes,
        }
    }
}

/// Wait between the last uses of a resource and the next one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResourceBarrier {
    /// Stages to wait for.
    pub src_stages: vk::PipelineStageFlags2,
    /// Writes to make available.
    pub src_access: vk::AccessFlags2,
    /// Stages that wait.
    pub dst_stages: vk::PipelineStageFlags2,
    /// Accesses that see those writes.
    pub dst_access: vk::AccessFlags2,
    /// Layout before (images).
    pub old_layout: vk::ImageLayout,
    /// Layout after (images).
    pub new_layout: vk::ImageLayout,
}

/// Past uses of a resource, in submission order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResourceState {
    layout: vk::ImageLayout,
    /// The host writes the image.
    is_mapped: bool,
    /// Stages and accesses of the last write (or layout change).
    written_by: (vk::PipelineStageFlags2, vk::AccessFlags2),
    /// Who has been made to see the last write, or has read since.
    seen_by: (vk::PipelineStageFlags2, vk::AccessFlags2),
}

impl Default for ResourceState {
    fn default() -> Self {
        Self {
            layout: vk::ImageLayout::UNDEFINED,
            is_mapped: false,
            written_by: (vk::PipelineStageFlags2::NONE, vk::AccessFlags2::NONE),
            seen_by: (vk::PipelineStageFlags2::NONE, vk::AccessFlags2::NONE),
        }
    }
}

impl ResourceState {
    /// The state of an image just acquired from the presentation engine, whose semaphore the submission waits
    /// for in the stages of `first`, the first access: contents undefined, and the first barrier has to chain
    /// on that wait (its source stages are the waiting ones).
    pub fn acquired(first: ResourceAccess) -> Self {
        Self {
            written_by: (first.scope().stages, vk::AccessFlags2::NONE),
            ..Self::default()
        }
    }

    /// The state of an image in mapped memory: from its first use on it is in the one layout in which the host may write it again.
    pub fn mapped() -> Self {
        Self {
            layout: vk::ImageLayout::PREINITIALIZED,
            is_mapped: true,
            ..Self::default()
        }
    }

    /// The layout that an access needs the image in.
    pub fn layout_of(&self, access: ResourceAccess) -> vk::ImageLayout {
        match access.scope().layout {
            _ if self.is_mapped => vk::ImageLayout::GENERAL,
            layout => layout,
        }
    }

    /// The barrier needed before `next`, if any, and the state after it. `discard` says that the contents of
    /// an image need not survive (it is cleared or overwritten whole).
    pub fn transition(
        &mut self,
        next: ResourceAccess,
        is_image: bool,
        discard: bool,
    ) -> Option<ResourceBarrier> {
        let (scope, layout) = (next.scope(), self.layout_of(next));
        let changes_layout = is_image && layout != self.layout;
        let untouched = self.written_by.0.is_empty() && self.seen_by.0.is_empty();
        if untouched && !changes_layout {
            self.note(scope, false);
            return None;
        }
        let already_seen =
            self.seen_by.0.contains(scope.stages) && self.seen_by.1.contains(scope.access);
        // A resource that no one ever wrote (uploaded by the host before the submission) needs no barrier to
        // be read by one more stage.
        let never_written = self.written_by.0.is_empty();
        if !scope.writes && !changes_layout && (already_seen || never_written) {
            self.note(scope, false);
            return None;
        }
        let barrier = ResourceBarrier {
            src_stages: self.written_by.0 | self.seen_by.0,
            src_access: self.written_by.1,
            dst_stages: scope.stages,
            dst_access: scope.access,
            old_layout: if discard {
                vk::ImageLayout::UNDEFINED
            } else {
                self.layout
            },
            new_layout: if is_image { layout } else { self.layout },
        };
        if is_image {
            self.layout = layout;
        }
        self.note(scope, changes_layout);
        Some(barrier)
    }

    fn note(&mut self, scope: AccessScope, changed_layout: bool) {
        if scope.writes {
            self.written_by = (scope.stages, scope.access & WRITES);
            self.seen_by = (vk::PipelineStageFlags2::NONE, vk::AccessFlags2::NONE);
        } else {
            if changed_layout {
                // The transition is a write that happens before the stages of this access; a later reader in
                // another stage chains on them.
                self.written_by = (scope.stages, vk::AccessFlags2::NONE);
                self.seen_by = (vk::PipelineStageFlags2::NONE, vk::AccessFlags2::NONE);
            }
            self.seen_by.0 |= scope.stages;
            self.seen_by.1 |= scope.access;
        }
    }

    /// The layout an image is in after everything recorded so far.
    pub fn layout(&self) -> vk::ImageLayout {
        self.layout
    }
}

/// Accesses that write: only these are made available by a barrier.
const WRITES: vk::AccessFlags2 = vk::AccessFlags2::from_raw(
    vk::AccessFlags2::SHADER_STORAGE_WRITE.as_raw()
        | vk::AccessFlags2::COLOR_ATTACHMENT_WRITE.as_raw()
        | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE.as_raw()
        | vk::AccessFlags2::TRANSFER_WRITE.as_raw(),
);

#[cfg(test)]
mod tests {
    use super::*;
    use vk::AccessFlags2 as A;
    use vk::ImageLayout as L;
    use vk::PipelineStageFlags2 as S;

    fn buffers() -> impl Iterator<Item = ResourceAccess> {
        [
            ResourceAccess::StorageRead,
            ResourceAccess::StorageWrite,
            ResourceAccess::FragmentStorageRead,
            ResourceAccess::VertexStorageRead,
            ResourceAccess::Fill,
            ResourceAccess::CopySource,
            ResourceAccess::CopyTarget,
            ResourceAccess::HostRead,
            ResourceAccess::VertexRead,
            ResourceAccess::IndexRead,
            ResourceAccess::UniformRead,
        ]
        .into_iter()
    }

    #[test]
    fn every_write_is_followed_by_a_barrier_before_any_use() {
        for first in ResourceAccess::ALL.into_iter().filter(|a| a.scope().writes) {
            for second in ResourceAccess::ALL {
                for is_image in [false, true] {
                    if second == ResourceAccess::Present && !is_image {
                        // Only images are presented.
                        continue;
                    }
                    let mut state = ResourceState::default();
                    let _ = state.transition(first, is_image, true);
                    let barrier = state
                        .transition(second, is_image, false)
                        .unwrap_or_else(|| panic!("{first:?} -> {second:?} has no barrier"));
                    assert!(barrier.src_stages.contains(first.scope().stages));
                    assert!(barrier.src_access.contains(first.scope().access & WRITES));
                    assert!(!barrier.src_access.is_empty());
                    assert!(barrier.dst_stages.contains(second.scope().stages));
                    assert!(barrier.dst_access.contains(second.scope().access));
                    if is_image {
                        assert_eq!(barrier.old_layout, first.scope().layout);
                        assert_eq!(barrier.new_layout, second.scope().layout);
                    }
                }
            }
        }
    }

    #[test]
    fn every_write_waits_for_the_reads_before_it() {
        for first in buffers().filter(|a| !a.scope().writes) {
            for second in buffers().filter(|a| a.scope().writes) {
                let mut state = ResourceState::default();
                assert_eq!(
                    state.transition(first, false, false),
                    None,
                    "host-written data is visible"
                );
                let barrier = state
                    .transition(second, false, false)
                    .expect("write after read");
                assert!(barrier.src_stages.contains(first.scope().stages));
            }
        }
    }

    #[test]
    fn reads_that_see_the_write_need_nothing_more() {
        let mut state = ResourceState::default();
        state.transition(ResourceAccess::CopyTarget, false, false);
        assert!(
            state
                .transition(ResourceAccess::VertexRead, false, false)
                .is_some()
        );
        assert_eq!(
            state.transition(ResourceAccess::VertexRead, false, false),
            None
        );
        let second = state
            .transition(ResourceAccess::IndexRead, false, false)
            .expect("another stage");
        assert_eq!(second.src_access, A::TRANSFER_WRITE);
        assert!(second.src_stages.contains(S::COPY));
        let write = state
            .transition(ResourceAccess::CopyTarget, false, false)
            .expect("write after reads");
        assert!(
            write
                .src_stages
                .contains(S::VERTEX_ATTRIBUTE_INPUT | S::INDEX_INPUT)
        );
    }

    #[test]
    fn an_image_that_the_host_writes_stays_where_it_may() {
        let mut state = ResourceState::mapped();
        let first = state
            .transition(ResourceAccess::BlitSource, true, false)
            .expect("layout");
        assert_eq!(
            (first.old_layout, first.new_layout),
            (L::PREINITIALIZED, L::GENERAL)
        );
        for access in [
            ResourceAccess::Sampled,
            ResourceAccess::CopySource,
            ResourceAccess::BlitSource,
        ] {
            if let Some(barrier) = state.transition(access, true, false) {
                assert_eq!(
                    (barrier.old_layout, barrier.new_layout),
                    (L::GENERAL, L::GENERAL)
                );
                assert!(barrier.src_access.is_empty(), "nothing on the device wrote");
            }
            assert_eq!(state.layout(), L::GENERAL);
        }
    }

    #[test]
    fn the_target_of_one_frame_is_the_target_of_the_next() {
        let mut state = ResourceState::default();
        let first = state
            .transition(ResourceAccess::ColorTarget, true, true)
            .expect("layout");
        assert_eq!(
            (first.old_layout, first.src_stages),
            (L::UNDEFINED, S::NONE)
        );
        state
            .transition(ResourceAccess::CopySource, true, false)
            .expect("copy");
        let again = state
            .transition(ResourceAccess::ColorTarget, true, true)
            .expect("next frame");
        assert!(again.src_stages.contains(S::COPY));
        assert_eq!(
            (again.old_layout, again.new_layout),
            (L::UNDEFINED, L::COLOR_ATTACHMENT_OPTIMAL)
        );
        let blend = state
            .transition(ResourceAccess::BlendTarget, true, false)
            .expect("store before load");
        assert_eq!(blend.src_access, A::COLOR_ATTACHMENT_WRITE);
        assert!(blend.dst_access.contains(A::COLOR_ATTACHMENT_READ));
    }

    #[test]
    fn an_acquired_image_waits_for_its_semaphore_and_is_handed_on_after_the_write() {
        let mut state = ResourceState::acquired(ResourceAccess::BlitTarget);
        let first = state
            .transition(ResourceAccess::BlitTarget, true, true)
            .expect("layout");
        assert_eq!(
            (first.old_layout, first.new_layout),
            (L::UNDEFINED, L::TRANSFER_DST_OPTIMAL)
        );
        assert_eq!(first.src_stages, S::BLIT, "chains on the semaphore wait");
        let last = state
            .transition(ResourceAccess::Present, true, false)
            .expect("layout");
        assert_eq!(
            (last.src_stages, last.src_access),
            (S::BLIT, A::TRANSFER_WRITE)
        );
        assert_eq!(
            (last.old_layout, last.new_layout),
            (L::TRANSFER_DST_OPTIMAL, L::PRESENT_SRC_KHR)
        );
    }

    #[test]
    fn a_layout_change_by_a_reader_orders_later_readers_and_writers() {
        let mut state = ResourceState::default();
        state.transition(ResourceAccess::DepthWrite, true, true);
        state
            .transition(ResourceAccess::DepthTest, true, false)
            .expect("layout");
        assert_eq!(
            state.transition(ResourceAccess::DepthTest, true, false),
            None
        );
        let sampled = state
            .transition(ResourceAccess::Sampled, true, false)
            .expect("layout");
        assert!(sampled.src_stages.contains(S::LATE_FRAGMENT_TESTS));
        let write = state
            .transition(ResourceAccess::DepthWrite, true, false)
            .expect("write");
        assert!(write.src_stages.contains(S::FRAGMENT_SHADER));
    }
}
