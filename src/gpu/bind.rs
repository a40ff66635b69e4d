//! Descriptors of one draw or dispatch, from the slot's pool.

use super::access::ResourceAccess;
use super::buffer::AnyBuffer;

use super::image::DeviceImage;
use super::pipeline::ShaderPipeline;
use super::query::MAX_PASSES;
use super::slot::UniformBlock;
use super::{Gpu, lock};
use crate::abi::BindingKind;
use ash::vk;
use std::cell::Cell;

/// Part of a storage buffer.
#[derive(Clone, Copy)]
pub struct BufferSlice<'a> {
    buffer: &'a dyn AnyBuffer,
    offset: u64,
    bytes: u64,
}

impl std::fmt::Debug for BufferSlice<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} [{}..+{}]",
            self.buffer.name(),
            self.offset,
            self.bytes
        )
    }
}

impl<'a> BufferSlice<'a> {
    /// Offsets are multiples of this many bytes: no device asks for more (Vulkan 1.3, table of required limits,
    /// `minStorageBufferOffsetAlignment`).
    pub const ALIGNMENT: u64 = 256;

    /// The bytes `offset .. offset + bytes` of a buffer; at least 4 of them. The offset must be a multiple of
    /// [`BufferSlice::ALIGNMENT`], the length at most the device's
    /// [`max_storage_range`](super::device::DeviceInfo::max_storage_range).
    ///
    /// # Panics
    /// When the part reaches out of the buffer or the offset is not aligned.
    pub fn new(buffer: &'a dyn AnyBuffer, offset: u64, bytes: u64) -> Self {
        let bytes = bytes.max(4);
        assert!(
            offset + bytes <= buffer.bytes() && offset.is_multiple_of(Self::ALIGNMENT),
            "a part of {} reaches out of it or is not aligned",
            buffer.name()
        );
        Self {
            buffer,
            offset,
            bytes,
        }
    }

    /// The whole of a buffer.
    pub fn whole(buffer: &'a dyn AnyBuffer) -> Self {
        Self::new(buffer, 0, buffer.bytes())
    }
}

/// Pipeline, slot and command buffer for which a draw or dispatch is recorded.
pub(super) struct BindSite<'a> {
    pub(super) gpu: &'a Gpu,
    pub(super) commands: vk::CommandBuffer,
    pub(super) descriptors: vk::DescriptorPool,
    pub(super) uniforms: vk::Buffer,
    /// Storage buffers that the pass declared.
    pub(super) storage: &'a [vk::Buffer],
    pub(super) name: &'static str,
    /// A binding could not be made: nothing more is drawn in the pass, and the frame is not submitted.
    pub(super) has_failed: Cell<bool>,
}

/// Resources of the bindings of a pipeline, each kind in ascending order of its bindings.
pub(super) struct BoundResources<'a> {
    pub(super) uniforms: &'a [UniformBlock],
    pub(super) images: &'a [&'a DeviceImage],
    pub(super) storage: &'a [BufferSlice<'a>],
}

/// Binds a pipeline and a descriptor set made for it. Where memory runs out, the pass draws nothing more, and submitting the
/// frame is an error.
///
/// # Panics
/// When a binding gets nothing or something of another kind, a resource was not declared by the pass, or the frame
/// has bound too many.
pub(super) fn bind(
    site: &BindSite<'_>,
    point: vk::PipelineBindPoint,
    pipeline: &ShaderPipeline,
    bound: &BoundResources<'_>,
) {
    let device = &site.gpu.device;
    let layouts = [pipeline.parts().set_layout];
    let info = vk::DescriptorSetAllocateInfo::default()
        .descriptor_pool(site.descriptors)
        .set_layouts(&layouts);
    let (mut uniforms, mut images, mut storage) = (
        bound.uniforms.iter(),
        bound.images.iter(),
        bound.storage.iter(),
    );
    // SAFETY: the pool belongs to this frame's slot, whose last use has finished.
    let sets = match unsafe { device.allocate_descriptor_sets(&info) } {
        Ok(sets) => sets,
        Err(vk::Result::ERROR_OUT_OF_POOL_MEMORY | vk::Result::ERROR_FRAGMENTED_POOL) => panic!(
            "{}: a frame has room for {} bindings",
            site.name,
            4 * MAX_PASSES
        ),
        Err(result) => {
            site.has_failed.set(true);
            *lock(&site.gpu.binding_failure) = Some(result);
            return;
        }
    };
    for &(binding, kind) in &pipeline.parts().bindings {
        let mut buffers = [vk::DescriptorBufferInfo::default()];
        let mut infos = [vk::DescriptorImageInfo::default()];
        let write = vk::WriteDescriptorSet::default()
            .dst_set(sets[0])
            .dst_binding(binding);
        let write = match kind {
            BindingKind::UniformBuffer => {
                let Some(uniform) = uniforms.next() else {
                    panic!("{}: nothing for uniform binding {binding}", site.name)
                };
                buffers[0] = buffers[0]
                    .buffer(site.uniforms)
                    .offset(uniform.offset)
                    .range(uniform.bytes);
                write
                    .descriptor_type(vk::DescriptorType::UNIFORM_BUFFER)
                    .buffer_info(&buffers)
            }
            BindingKind::StorageBuffer => {
                let Some(slice) = storage.next() else {
                    panic!("{}: nothing for storage binding {binding}", site.name)
                };
                assert!(
                    site.storage.contains(&slice.buffer.handle()),
                    "pass {} did not declare storage buffer {}",
                    site.name,
                    slice.buffer.name()
                );
                buffers[0] = buffers[0]
                    .buffer(slice.buffer.handle())
                    .offset(slice.offset)
                    .range(slice.bytes);
                write
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .buffer_info(&buffers)
            }
            BindingKind::SampledImage => {
                let Some(image) = images.next() else {
                    panic!("{}: nothing for image binding {binding}", site.name)
                };
                let layout = image.layout_of(ResourceAccess::Sampled);
                assert!(
                    lock(&image.state).layout() == layout,
                    "pass {} did not declare image {}",
                    site.name,
                    image.name()
                );
                infos[0] = infos[0]
                    .sampler(site.gpu.sampler)
                    .image_view(image.view)
                    .image_layout(layout);
                write
                    .descriptor_type(vk::DescriptorType::COMBINED_IMAGE_SAMPLER)
                    .image_info(&infos)
            }
            BindingKind::StorageImage => {
                panic!("{}: binding {binding} is a storage image", site.name)
            }
        };
        // SAFETY: the set was just allocated and is not bound yet; what is written is alive as long as the frame.
        unsafe { device.update_descriptor_sets(&[write], &[]) };
    }
    assert!(
        uniforms.next().is_none() && images.next().is_none() && storage.next().is_none(),
        "{}: {} has fewer bindings",
        site.name,
        pipeline.name()
    );
    // SAFETY: the command buffer is being recorded; every binding of the set has been written.
    unsafe {
        device.cmd_bind_pipeline(site.commands, point, pipeline.parts().handle);
        device.cmd_bind_descriptor_sets(
            site.commands,
            point,
            pipeline.parts().layout,
            0,
            &sets,
            &[],
        );
    }
}
