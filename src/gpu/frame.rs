//! Frames in flight: recorded, submitted, waited for, read back.

use super::access::ResourceAccess;
use super::buffer::{AnyBuffer, ReadbackBuffer, UploadBuffer};
use super::image::DeviceImage;
use super::pass::PendingBarriers;
pub use super::pass::{DrawRecorder, PassBuilder, TargetLoad};
pub use super::query::{DeviceTimes, FrameMeasure, PassCounters, PassTime, PipelineStatistics};
use super::query::{MAX_PASSES, SlotQueries};
use super::slot::FrameSlot;
pub use super::slot::UniformBlock;
use super::{Error, Gpu, RetiredResource, copy};
#[cfg(feature = "viewer")]
use super::{access::ResourceState, image::ImageFormat, surface::AcquiredImage};
use ash::vk;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Bytes of uniform blocks in one frame.
const UNIFORM_BYTES: u64 = 64 << 10;

/// The ring of frames in flight.
pub struct FrameRing {
    gpu: Arc<Gpu>,
    slots: Vec<FrameSlot>,
    next: usize,
    measure: FrameMeasure,
    barriers: PendingBarriers,
}

impl std::fmt::Debug for FrameRing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Frames")
            .field("in_flight", &self.slots.len())
            .finish_non_exhaustive()
    }
}

/// A submitted frame that can be waited for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[must_use = "a frame is finished only once it was waited for"]
pub struct FrameTicket {
    /// Slot of the ring that the frame used.
    pub slot: usize,
    value: u64,
}

/// Cost of a finished frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FinishedFrame {
    /// Time of each pass on the device, in order; empty without timestamps.
    pub passes: Vec<PassTime>,
    /// Times of the passes on the device's clock.
    pub device: DeviceTimes,
    /// Counts of each pass that draws; empty unless [`FrameMeasure::counters`] was set.
    pub counters: Vec<PassCounters>,
    /// Bytes of uniform blocks that the host wrote for it.
    pub uniform_bytes: u64,
    /// When it was submitted.
    pub submitted: Option<Instant>,
    /// From the submission until the host saw the end.
    pub host: Duration,
}

impl FrameRing {
    /// A ring of `in_flight` frames (at least 1). With `timestamps` every pass is timed, which costs a full
    /// barrier a pass.
    ///
    /// # Errors
    /// When a Vulkan call fails.
    pub fn new(gpu: &Arc<Gpu>, in_flight: usize, timestamps: bool) -> Result<Self, Error> {
        let mut frames = Self {
            gpu: gpu.clone(),
            slots: Vec::new(),
            next: 0,
            measure: FrameMeasure::default(),
            barriers: PendingBarriers::default(),
        };
        for index in 0..in_flight.max(1) {
            let uniforms =
                UploadBuffer::new(gpu, &format!("uniforms of frame {index}"), UNIFORM_BYTES)?;
            // Pushed at once, so that Drop destroys what a later failure leaves.
            frames.slots.push(FrameSlot {
                pool: vk::CommandPool::null(),
                commands: vk::CommandBuffer::null(),
                queries: SlotQueries::default(),
                descriptors: vk::DescriptorPool::null(),
                uniforms,
                submitted: 0,
                uniform_bytes: 0,
                submit_time: None,
            });
            let slot = &mut frames.slots[index];
            let name = format!("frame {index}");
            let info = vk::CommandPoolCreateInfo::default()
                .flags(vk::CommandPoolCreateFlags::TRANSIENT)
                .queue_family_index(gpu.queue_family);
            // SAFETY: the device is alive and has this queue family.
            slot.pool = unsafe { gpu.device.create_command_pool(&info, None) }
                .map_err(Error::vulkan("vkCreateCommandPool", name.as_str()))?;
            let info = vk::CommandBufferAllocateInfo::default()
                .command_pool(slot.pool)
                .command_buffer_count(1);
            // SAFETY: the pool was just made.
            let buffers = unsafe { gpu.device.allocate_command_buffers(&info) }
                .map_err(Error::vulkan("vkAllocateCommandBuffers", name.as_str()))?;
            slot.commands = buffers[0];
            gpu.name(slot.commands, &name);
            gpu.name(slot.pool, &name);
            let sizes = [
                vk::DescriptorType::UNIFORM_BUFFER,
                vk::DescriptorType::STORAGE_BUFFER,
                vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
            ]
            .map(|kind| {
                vk::DescriptorPoolSize::default()
                    .ty(kind)
                    // A set has at most four of a kind.
                    .descriptor_count(4 * 4 * MAX_PASSES)
            });
            let info = vk::DescriptorPoolCreateInfo::default()
                .max_sets(4 * MAX_PASSES)
                .pool_sizes(&sizes);
            // SAFETY: the device is alive.
            slot.descriptors = unsafe { gpu.device.create_descriptor_pool(&info, None) }
                .map_err(Error::vulkan("vkCreateDescriptorPool", name.as_str()))?;
            gpu.name(slot.descriptors, &name);
        }
        frames.measure(FrameMeasure {
            passes: timestamps,
            ..FrameMeasure::default()
        })?;
        Ok(frames)
    }

    /// Sets what the frames recorded from now on report. What the device lacks is left out: pass times without
    /// timestamps, counters without queries for them. What is off costs nothing.
    ///
    /// # Errors
    /// When the queries cannot be made; then nothing changes.
    pub fn measure(&mut self, measure: FrameMeasure) -> Result<(), Error> {
        let has_timestamps = self.gpu.info.timestamp_period_ns > 0.0;
        let measure = FrameMeasure {
            passes: measure.passes && has_timestamps,
            frame: measure.frame && has_timestamps,
            counters: measure.counters,
        };
        for (index, slot) in self.slots.iter_mut().enumerate() {
            let name = format!("frame {index}");
            slot.queries.prepare(&self.gpu, &name, measure)?;
        }
        self.measure = measure;
        Ok(())
    }

    /// Leaves every barrier out from now on: wrong on purpose, for the test that shows that the validation layer
    /// would find a missing one.
    #[doc(hidden)]
    pub fn omit_barriers(&mut self) {
        self.barriers.omitted = true;
    }

    /// Most frames that can be in flight.
    pub fn in_flight(&self) -> usize {
        self.slots.len()
    }

    /// The slot that the next [`begin`](FrameRing::begin) will use.
    pub fn next_slot(&self) -> usize {
        self.next
    }

    /// Waits until the next slot is free, so that its upload buffers may be written.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn wait_for_next(&mut self) -> Result<(), Error> {
        self.gpu.wait_for(self.slots[self.next].submitted)?;
        self.gpu.collect();
        Ok(())
    }

    /// Waits until a submitted frame has finished.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn wait_for(&self, ticket: FrameTicket) -> Result<(), Error> {
        self.gpu.wait_for(ticket.value)
    }

    /// Starts recording the next frame, after waiting for its slot.
    ///
    /// # Errors
    /// When the device is lost or a Vulkan call fails.
    pub fn begin(&mut self) -> Result<FrameRecorder<'_>, Error> {
        self.wait_for_next()?;
        let index = self.next;
        let slot = &mut self.slots[index];
        slot.submit_time = None;
        // SAFETY: the slot's last submission has finished, so its pools are not in use.
        unsafe {
            self.gpu
                .device
                .reset_command_pool(slot.pool, vk::CommandPoolResetFlags::empty())
                .map_err(Error::vulkan("vkResetCommandPool", "a frame"))?;
            self.gpu
                .device
                .reset_descriptor_pool(slot.descriptors, vk::DescriptorPoolResetFlags::empty())
                .map_err(Error::vulkan("vkResetDescriptorPool", "a frame"))?;
            let info = vk::CommandBufferBeginInfo::default()
                .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            self.gpu
                .device
                .begin_command_buffer(slot.commands, &info)
                .map_err(Error::vulkan("vkBeginCommandBuffer", "a frame"))?;
        }
        self.gpu.begin_label(slot.commands, "frame");
        slot.queries.begin(&self.gpu, slot.commands, self.measure);
        Ok(FrameRecorder {
            uniform_bytes: 0,
            is_empty: true,
            index,
            frames: self,
        })
    }

    /// Waits for a submitted frame and tells what it cost. Only the last frame of a slot can be asked for.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn finish(&mut self, ticket: FrameTicket) -> Result<FinishedFrame, Error> {
        self.gpu.wait_for(ticket.value)?;
        let slot = &mut self.slots[ticket.slot];
        let mut finished = FinishedFrame::default();
        if slot.submitted != ticket.value {
            return Ok(finished);
        }
        finished.host = slot.submit_time.map(|t| t.elapsed()).unwrap_or_default();
        finished.submitted = slot.submit_time;
        finished.uniform_bytes = slot.uniform_bytes;
        let report = slot.queries.read(&self.gpu)?;
        for PassTime { name, ms } in &report.passes {
            tracing::debug!(pass = name, ms, "finished");
        }
        finished.passes = report.passes;
        finished.device = report.device;
        finished.counters = report.counters;
        Ok(finished)
    }
}

impl Drop for FrameRing {
    fn drop(&mut self) {
        for slot in &self.slots {
            // Freed with the pool: the command buffer.
            self.gpu.bury(RetiredResource::CommandPool(slot.pool));
            slot.queries.bury(&self.gpu);
            self.gpu
                .bury(RetiredResource::DescriptorPool(slot.descriptors));
        }
    }
}

/// A frame being recorded. Passes run in the order written.
#[derive(Debug)]
pub struct FrameRecorder<'a> {
    frames: &'a mut FrameRing,
    index: usize,
    uniform_bytes: u64,
    /// Nothing was recorded.
    is_empty: bool,
}

impl FrameRecorder<'_> {
    /// Slot of the ring that this frame uses.
    pub fn slot(&self) -> usize {
        self.index
    }

    /// Puts a uniform block into this frame's memory.
    ///
    /// # Errors
    /// When the frame has no room left for uniforms.
    pub fn uniform<T: bytemuck::Pod>(&mut self, value: &T) -> Result<UniformBlock, Error> {
        let bytes = size_of::<T>() as u64;
        let offset = self
            .uniform_bytes
            .next_multiple_of(self.frames.gpu.info.uniform_alignment);
        if offset + bytes > UNIFORM_BYTES {
            return Err(Error::Limit {
                what: "the size of a frame's uniform blocks".into(),
                value: offset + bytes,
                limit: UNIFORM_BYTES,
            });
        }
        let memory = &mut self.frames.slots[self.index].uniforms;
        memory.bytes_mut()[offset as usize..(offset + bytes) as usize]
            .copy_from_slice(bytemuck::bytes_of(value));
        memory.flush(offset..offset + bytes);
        self.uniform_bytes = offset + bytes;
        Ok(UniformBlock { offset, bytes })
    }

    /// Starts the description of a pass. `name` is its name in the profiler, in captures and in charts.
    pub fn pass<'f>(&'f mut self, name: &'static str) -> PassBuilder<'f>
    where
        Self: 'f,
    {
        self.is_empty = false;
        PassBuilder::new(
            &self.frames.gpu,
            &mut self.frames.slots[self.index],
            &mut self.frames.barriers,
            name,
        )
    }

    /// Copies an image into a readback buffer, tightly packed, as a pass of its own.
    ///
    /// # Panics
    /// When the buffer is smaller than the image.
    pub fn read_back(&mut self, name: &'static str, image: &DeviceImage, into: &ReadbackBuffer) {
        self.read_back_part(name, image, [0, 0, image.width, image.height], into);
    }

    /// Reads back the rectangle `[x, y, width, height]` of the image, as [`read_back`](FrameRecorder::read_back) does the whole.
    ///
    /// # Panics
    /// When the rectangle reaches out of the image, or the buffer is smaller than the rectangle.
    pub fn read_back_part(
        &mut self,
        name: &'static str,
        image: &DeviceImage,
        rectangle: [u32; 4],
        into: &ReadbackBuffer,
    ) {
        self.copy_part(name, image, rectangle, into);
        let gpu = self.frames.gpu.clone();
        self.frames.barriers.buffer(into, ResourceAccess::HostRead);
        self.frames
            .barriers
            .record(&gpu, self.frames.slots[self.index].commands);
    }

    /// Copies the rectangle `[x, y, width, height]` of an image to the beginning of a buffer, tightly packed, as a pass of
    /// its own.
    ///
    /// # Panics
    /// When the rectangle reaches out of the image, or the buffer is smaller than the rectangle.
    pub fn copy_part(
        &mut self,
        name: &'static str,
        image: &DeviceImage,
        rectangle: [u32; 4],
        into: &dyn AnyBuffer,
    ) {
        let [x, y, width, height] = rectangle;
        assert!(
            x + width <= image.width && y + height <= image.height,
            "{name}: outside of the image"
        );
        let bytes = image.format.pixel_bytes() * u64::from(width) * u64::from(height);
        assert!(
            into.bytes() >= bytes,
            "{name}: the buffer is smaller than the rectangle"
        );
        let mut pass = self.pass(name);
        let gpu = pass.gpu.clone();
        let commands = pass.slot.commands;
        pass.barriers
            .image(image, ResourceAccess::CopySource, false);
        pass.barriers.buffer(into, ResourceAccess::CopyTarget);
        let timing = pass.begin();
        let regions = [copy::region(image, 0, rectangle)];
        // SAFETY: both are alive until the frame has finished (their Drop defers), the image is in the copy
        // layout by the barrier above, and the buffer is large enough.
        unsafe {
            gpu.device.cmd_copy_image_to_buffer(
                commands,
                image.handle,
                image.layout_of(ResourceAccess::CopySource),
                into.handle(),
                &regions,
            );
        }
        timing.end(&pass.slot.queries);
    }

    /// Copies the first bytes of a buffer into a readback buffer, as many as that has, as a pass of its own.
    ///
    /// # Panics
    /// When the buffer is smaller.
    pub fn read_back_buffer(
        &mut self,
        name: &'static str,
        from: &dyn AnyBuffer,
        into: &ReadbackBuffer,
    ) {
        assert!(
            from.bytes() >= into.bytes(),
            "{name}: the buffer is smaller than what is read back of it"
        );
        let mut pass = self.pass(name);
        let (gpu, commands) = (pass.gpu.clone(), pass.slot.commands);
        pass.barriers.buffer(from, ResourceAccess::CopySource);
        pass.barriers.buffer(into, ResourceAccess::CopyTarget);
        let timing = pass.begin();
        let regions = [vk::BufferCopy {
            src_offset: 0,
            dst_offset: 0,
            size: into.bytes(),
        }];
        // SAFETY: both are alive until the frame has finished (their Drop defers) and large enough.
        unsafe {
            gpu.device
                .cmd_copy_buffer(commands, from.handle(), into.handle(), &regions);
        }
        timing.end(&pass.slot.queries);
        self.frames.barriers.buffer(into, ResourceAccess::HostRead);
        self.frames
            .barriers
            .record(&gpu, self.frames.slots[self.index].commands);
    }

    /// Puts `image` onto an image acquired from a window, scaled if the sizes differ, and hands that to the
    /// presentation engine, as the pass `present`. The frame must end with [`submit_onto`](FrameRecorder::submit_onto).
    #[cfg(feature = "viewer")]
    pub fn present(&mut self, image: &DeviceImage, onto: &AcquiredImage) {
        let mut state = ResourceState::acquired(AcquiredImage::FIRST_ACCESS);
        let mut pass = self.pass("present");
        let gpu = pass.gpu.clone();
        let commands = pass.slot.commands;
        pass.barriers
            .image(image, ResourceAccess::BlitSource, false);
        pass.barriers.handle(
            onto.image,
            ImageFormat::Rgba8,
            &mut state,
            AcquiredImage::FIRST_ACCESS,
            true,
        );
        let timing = pass.begin();
        let layers = vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: 0,
            base_array_layer: 0,
            layer_count: 1,
        };
        let corners = |width: u32, height: u32| {
            let far = vk::Offset3D {
                x: width as i32,
                y: height as i32,
                z: 1,
            };
            [vk::Offset3D::default(), far]
        };
        let regions = [vk::ImageBlit::default()
            .src_subresource(layers)
            .src_offsets(corners(image.width, image.height))
            .dst_subresource(layers)
            .dst_offsets(corners(onto.width, onto.height))];
        // SAFETY: the image is alive until the frame has finished, the acquired one until its swapchain is
        // rebuilt, which waits for the device; both are in these layouts by the barriers above.
        unsafe {
            gpu.device.cmd_blit_image(
                commands,
                image.handle,
                image.layout_of(ResourceAccess::BlitSource),
                onto.image,
                vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                &regions,
                vk::Filter::NEAREST,
            );
        }
        timing.end(&pass.slot.queries);
        let barriers = &mut self.frames.barriers;
        barriers.handle(
            onto.image,
            ImageFormat::Rgba8,
            &mut state,
            ResourceAccess::Present,
            false,
        );
        barriers.record(&gpu, commands);
    }

    /// Ends the recording of a frame with a [`present`](FrameRecorder::present) pass and submits it: the pass waits
    /// until the window's image is free, and the image is shown only after the frame has finished.
    ///
    /// # Errors
    /// When the device is lost or a Vulkan call fails.
    #[cfg(feature = "viewer")]
    pub fn submit_onto(self, onto: &AcquiredImage) -> Result<FrameTicket, Error> {
        let stages = AcquiredImage::FIRST_ACCESS.scope().stages;
        self.submit_with(Some((onto.free, stages)), Some(onto.drawn))
    }

    /// Ends the recording and submits the frame. Without a pass there is nothing to submit: such a frame has finished at once.
    ///
    /// # Errors
    /// When the device is lost or a Vulkan call fails.
    pub fn submit(self) -> Result<FrameTicket, Error> {
        self.submit_with(None, None)
    }

    fn submit_with(
        self,
        waits: Option<(vk::Semaphore, vk::PipelineStageFlags2)>,
        signals: Option<vk::Semaphore>,
    ) -> Result<FrameTicket, Error> {
        let slot = &mut self.frames.slots[self.index];
        slot.uniform_bytes = self.uniform_bytes;
        let is_idle = self.is_empty && waits.is_none() && signals.is_none();
        if is_idle {
            slot.queries.forget();
        }
        slot.queries.end(&self.frames.gpu, slot.commands);
        self.frames.gpu.end_label(slot.commands);
        // SAFETY: recording was begun and no rendering scope is open.
        unsafe { self.frames.gpu.device.end_command_buffer(slot.commands) }
            .map_err(Error::vulkan("vkEndCommandBuffer", "a frame"))?;
        if let Some(result) = super::lock(&self.frames.gpu.binding_failure).take() {
            return Err(Error::vulkan("vkAllocateDescriptorSets", "a frame")(result));
        }
        if !is_idle {
            slot.submit_time = Some(Instant::now());
            slot.submitted = self.frames.gpu.submit(slot.commands, waits, signals)?;
        }
        let ticket = FrameTicket {
            slot: self.index,
            value: slot.submitted,
        };
        self.frames.next = (self.index + 1) % self.frames.slots.len();
        Ok(ticket)
    }
}

/// Copies the first `bytes` of `from` to `offset` in `to`, and waits. Not for the frame loop.
pub(super) fn copy_once(
    gpu: &Arc<Gpu>,
    from: &UploadBuffer,
    to: &dyn AnyBuffer,
    offset: u64,
    bytes: u64,
) -> Result<(), Error> {
    let mut frames = FrameRing::new(gpu, 1, false)?;
    let mut frame = frames.begin()?;
    frame.is_empty = false;
    let commands = frame.frames.slots[frame.index].commands;
    frame
        .frames
        .barriers
        .buffer(from, ResourceAccess::CopySource);
    frame.frames.barriers.buffer(to, ResourceAccess::CopyTarget);
    frame.frames.barriers.record(gpu, commands);
    let regions = [vk::BufferCopy {
        src_offset: 0,
        dst_offset: offset,
        size: bytes,
    }];
    // SAFETY: both buffers are alive until the wait below; the ranges lie inside of them; recording is open
    // outside of a rendering scope.
    unsafe {
        gpu.device
            .cmd_copy_buffer(commands, from.handle(), to.handle(), &regions)
    };
    let ticket = frame.submit()?;
    frames.finish(ticket)?;
    Ok(())
}
