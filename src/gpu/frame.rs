//! Frames in flight, and the pass: the only place that writes labels, timestamps, barriers and scopes.

use super::access::{Access, State};
use super::buffer::{AnyBuffer, Readback, Upload, state_of};
use super::image::{Format, Image, range};
use super::pipeline::Pipeline;
use super::profile::PassTime;
#[cfg(feature = "viewer")]
use super::surface::Acquired;
use super::{Error, Gpu, Remains, lock};
use crate::abi::BindingKind;
use ash::vk;
use std::ffi::CStr;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Most passes in one frame that get timestamps.
const MAX_PASSES: u32 = 64;
/// Bytes of uniform blocks in one frame.
const UNIFORM_BYTES: u64 = 64 << 10;

/// What a pass finds in a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Load {
    /// The given value everywhere (the first component for depth).
    Clear([f32; 4]),
    /// What the pass before left.
    Keep,
}

/// One frame slot: recorded, submitted and read back before it is used again.
struct Slot {
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    queries: vk::QueryPool,
    descriptors: vk::DescriptorPool,
    uniforms: Upload,
    submitted: u64,
    names: Vec<&'static str>,
    submit_time: Option<Instant>,
}

/// The ring of frames in flight.
pub struct Frames {
    gpu: Arc<Gpu>,
    slots: Vec<Slot>,
    next: usize,
    timestamps: bool,
    barriers: Barriers,
}

impl std::fmt::Debug for Frames {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Frames")
            .field("in_flight", &self.slots.len())
            .finish_non_exhaustive()
    }
}

/// A submitted frame that can be waited for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[must_use = "a frame is finished only once it was waited for"]
pub struct Ticket {
    /// Slot of the ring that the frame used.
    pub slot: usize,
    value: u64,
}

/// What a finished frame cost.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Finished {
    /// Time of each pass on the device, in order; empty without timestamps.
    pub passes: Vec<PassTime>,
    /// From the submission until the host saw the end.
    pub host: Duration,
}

#[derive(Default)]
struct Barriers {
    buffers: Vec<vk::BufferMemoryBarrier2<'static>>,
    images: Vec<vk::ImageMemoryBarrier2<'static>>,
    /// Vertex and index buffers that the pass being described declared; kept for their memory.
    declared: [Vec<vk::Buffer>; 2],
    /// Record none: a planted fault, see [`Frames::omit_barriers`].
    omitted: bool,
}

impl Barriers {
    fn buffer(&mut self, buffer: &dyn AnyBuffer, access: Access) {
        if let Some(b) = state_of(buffer).transition(access, false, false) {
            self.buffers.push(
                vk::BufferMemoryBarrier2::default()
                    .src_stage_mask(b.src_stages)
                    .src_access_mask(b.src_access)
                    .dst_stage_mask(b.dst_stages)
                    .dst_access_mask(b.dst_access)
                    .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                    .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                    .buffer(buffer.handle())
                    .size(vk::WHOLE_SIZE),
            );
        }
    }

    fn image(&mut self, image: &Image, access: Access, discard: bool) {
        self.handle(
            image.handle,
            image.format,
            &mut lock(&image.state),
            access,
            discard,
        );
    }

    /// As [`image`](Barriers::image), for an image that another owns.
    fn handle(
        &mut self,
        image: vk::Image,
        format: Format,
        state: &mut State,
        access: Access,
        discard: bool,
    ) {
        if let Some(b) = state.transition(access, true, discard) {
            self.images.push(
                vk::ImageMemoryBarrier2::default()
                    .src_stage_mask(b.src_stages)
                    .src_access_mask(b.src_access)
                    .dst_stage_mask(b.dst_stages)
                    .dst_access_mask(b.dst_access)
                    .old_layout(b.old_layout)
                    .new_layout(b.new_layout)
                    .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                    .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                    .image(image)
                    .subresource_range(range(format)),
            );
        }
    }

    fn record(&mut self, gpu: &Gpu, commands: vk::CommandBuffer) {
        if self.buffers.is_empty() && self.images.is_empty() {
            return;
        }
        if self.omitted {
            self.buffers.clear();
            self.images.clear();
            return;
        }
        let info = vk::DependencyInfo::default()
            .buffer_memory_barriers(&self.buffers)
            .image_memory_barriers(&self.images);
        // SAFETY: the command buffer is being recorded outside of a rendering scope; the handles are alive
        // (their owners are borrowed by the pass).
        unsafe { gpu.device.cmd_pipeline_barrier2(commands, &info) };
        self.buffers.clear();
        self.images.clear();
    }
}

impl Frames {
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
            timestamps: timestamps && gpu.info.timestamp_period_ns > 0.0,
            barriers: Barriers::default(),
        };
        for index in 0..in_flight.max(1) {
            let uniforms = Upload::new(gpu, &format!("uniforms of frame {index}"), UNIFORM_BYTES)?;
            // Pushed at once, so that Drop destroys what a later failure leaves.
            frames.slots.push(Slot {
                pool: vk::CommandPool::null(),
                commands: vk::CommandBuffer::null(),
                queries: vk::QueryPool::null(),
                descriptors: vk::DescriptorPool::null(),
                uniforms,
                submitted: 0,
                names: Vec::new(),
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
            let info = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::TIMESTAMP)
                .query_count(2 * MAX_PASSES);
            // SAFETY: the device is alive.
            slot.queries = unsafe { gpu.device.create_query_pool(&info, None) }
                .map_err(Error::vulkan("vkCreateQueryPool", name.as_str()))?;
            let sizes = [
                vk::DescriptorType::UNIFORM_BUFFER,
                vk::DescriptorType::STORAGE_BUFFER,
                vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
            ]
            .map(|kind| {
                vk::DescriptorPoolSize::default()
                    .ty(kind)
                    .descriptor_count(4 * MAX_PASSES)
            });
            let info = vk::DescriptorPoolCreateInfo::default()
                .max_sets(4 * MAX_PASSES)
                .pool_sizes(&sizes);
            // SAFETY: the device is alive.
            slot.descriptors = unsafe { gpu.device.create_descriptor_pool(&info, None) }
                .map_err(Error::vulkan("vkCreateDescriptorPool", name.as_str()))?;
        }
        Ok(frames)
    }

    /// Leaves every barrier out from now on: wrong on purpose, for the test that shows that the validation layer
    /// would find a missing one.
    #[doc(hidden)]
    pub fn omit_barriers(&mut self) {
        self.barriers.omitted = true;
    }

    /// How many frames can be in flight.
    pub fn in_flight(&self) -> usize {
        self.slots.len()
    }

    /// The slot that the next [`begin`](Frames::begin) will use.
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

    /// Starts recording the next frame, after waiting for its slot.
    ///
    /// # Errors
    /// When the device is lost or a Vulkan call fails.
    pub fn begin(&mut self) -> Result<Frame<'_>, Error> {
        self.wait_for_next()?;
        let index = self.next;
        let slot = &mut self.slots[index];
        slot.names.clear();
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
            self.gpu
                .device
                .reset_query_pool(slot.queries, 0, 2 * MAX_PASSES);
            let info = vk::CommandBufferBeginInfo::default()
                .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            self.gpu
                .device
                .begin_command_buffer(slot.commands, &info)
                .map_err(Error::vulkan("vkBeginCommandBuffer", "a frame"))?;
        }
        Ok(Frame {
            uniform_bytes: 0,
            index,
            frames: self,
        })
    }

    /// Waits for a submitted frame and tells what it cost. Only the last frame of a slot can be asked for.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn finish(&mut self, ticket: Ticket) -> Result<Finished, Error> {
        self.gpu.wait_for(ticket.value)?;
        let slot = &mut self.slots[ticket.slot];
        let mut finished = Finished::default();
        if slot.submitted != ticket.value {
            return Ok(finished);
        }
        finished.host = slot.submit_time.map(|t| t.elapsed()).unwrap_or_default();
        if self.timestamps && !slot.names.is_empty() {
            let mut ticks = [0u64; 2 * MAX_PASSES as usize];
            let ticks = &mut ticks[..2 * slot.names.len()];
            // SAFETY: the queries were written by a submission that has finished.
            unsafe {
                self.gpu.device.get_query_pool_results(
                    slot.queries,
                    0,
                    ticks,
                    vk::QueryResultFlags::TYPE_64,
                )
            }
            .map_err(Error::vulkan("vkGetQueryPoolResults", "a frame"))?;
            let period = f64::from(self.gpu.info.timestamp_period_ns);
            for (pair, &name) in ticks.chunks_exact(2).zip(&slot.names) {
                finished.passes.push(PassTime {
                    name,
                    ms: pair[1].saturating_sub(pair[0]) as f64 * period / 1e6,
                });
            }
        }
        Ok(finished)
    }
}

impl Drop for Frames {
    fn drop(&mut self) {
        for slot in &self.slots {
            // Freed with the pool: the command buffer.
            self.gpu.bury(Remains::CommandPool(slot.pool));
            self.gpu.bury(Remains::QueryPool(slot.queries));
            self.gpu.bury(Remains::DescriptorPool(slot.descriptors));
        }
    }
}

/// Where a uniform block was put.
#[derive(Debug, Clone, Copy)]
pub struct Uniform {
    offset: u64,
    bytes: u64,
}

/// A frame being recorded. Passes run in the order written.
#[derive(Debug)]
pub struct Frame<'a> {
    frames: &'a mut Frames,
    index: usize,
    uniform_bytes: u64,
}

impl Frame<'_> {
    /// Slot of the ring that this frame uses.
    pub fn slot(&self) -> usize {
        self.index
    }

    /// Puts a uniform block into this frame's memory.
    ///
    /// # Errors
    /// When the frame has no room left for uniforms.
    pub fn uniform<T: bytemuck::Pod>(&mut self, value: &T) -> Result<Uniform, Error> {
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
        Ok(Uniform { offset, bytes })
    }

    /// Starts the description of a pass. `name` is its name in the profiler, in captures and in charts.
    pub fn pass<'f>(&'f mut self, name: &'static str) -> Pass<'f>
    where
        Self: 'f,
    {
        self.frames
            .barriers
            .declared
            .iter_mut()
            .for_each(Vec::clear);
        Pass {
            gpu: self.frames.gpu.clone(),
            timestamps: self.frames.timestamps,
            slot: &mut self.frames.slots[self.index],
            barriers: &mut self.frames.barriers,
            name,
            colors: [None; 4],
            color_count: 0,
            depth: None,
            extent: None,
        }
    }

    /// Copies an image into a readback buffer, tightly packed, as a pass of its own.
    ///
    /// # Panics
    /// When the buffer is smaller than the image.
    pub fn read_back(&mut self, name: &'static str, image: &Image, into: &Readback) {
        self.read_back_part(name, image, [0, 0, image.width, image.height], into);
    }

    /// As [`read_back`](Frame::read_back), for the rectangle `[x, y, width, height]` of the image.
    ///
    /// # Panics
    /// When the rectangle reaches out of the image, or the buffer is smaller than the rectangle.
    pub fn read_back_part(
        &mut self,
        name: &'static str,
        image: &Image,
        [x, y, width, height]: [u32; 4],
        into: &Readback,
    ) {
        assert!(
            x + width <= image.width && y + height <= image.height,
            "{name}: outside of the image"
        );
        let bytes = image.format.pixel_bytes() * u64::from(width) * u64::from(height);
        assert!(
            into.bytes() >= bytes,
            "{name}: the readback buffer is smaller than the image"
        );
        let mut pass = self.pass(name);
        let gpu = pass.gpu.clone();
        let commands = pass.slot.commands;
        pass.barriers.image(image, Access::CopySource, false);
        pass.barriers.buffer(into, Access::CopyTarget);
        let timing = pass.begin();
        let regions = [vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: image.format.aspect(),
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            })
            .image_offset(vk::Offset3D {
                x: x as i32,
                y: y as i32,
                z: 0,
            })
            .image_extent(vk::Extent3D {
                width,
                height,
                depth: 1,
            })];
        // SAFETY: both are alive until the frame has finished (their Drop defers), the image is in the copy
        // layout by the barrier above, and the buffer is large enough.
        unsafe {
            gpu.device.cmd_copy_image_to_buffer(
                commands,
                image.handle,
                vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                into.handle(),
                &regions,
            );
        }
        timing.end();
        self.frames.barriers.buffer(into, Access::HostRead);
        self.frames.barriers.record(&gpu, commands);
    }

    /// Puts `image` onto an image acquired from a window, scaled if the sizes differ, and hands that to the
    /// presentation engine, as the pass `present`. The frame must end with [`submit_onto`](Frame::submit_onto).
    #[cfg(feature = "viewer")]
    pub fn present(&mut self, image: &Image, onto: &Acquired) {
        let mut state = State::acquired(Acquired::FIRST_ACCESS);
        let mut pass = self.pass("present");
        let gpu = pass.gpu.clone();
        let commands = pass.slot.commands;
        pass.barriers.image(image, Access::BlitSource, false);
        pass.barriers.handle(
            onto.image,
            Format::Rgba8,
            &mut state,
            Acquired::FIRST_ACCESS,
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
                vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                onto.image,
                vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                &regions,
                vk::Filter::NEAREST,
            );
        }
        timing.end();
        let barriers = &mut self.frames.barriers;
        barriers.handle(
            onto.image,
            Format::Rgba8,
            &mut state,
            Access::Present,
            false,
        );
        barriers.record(&gpu, commands);
    }

    /// Ends the recording of a frame with a [`present`](Frame::present) pass and submits it: the pass waits
    /// until the window's image is free, and the image is shown only after the frame has finished.
    ///
    /// # Errors
    /// When the device is lost or a Vulkan call fails.
    #[cfg(feature = "viewer")]
    pub fn submit_onto(self, onto: &Acquired) -> Result<Ticket, Error> {
        let stages = Acquired::FIRST_ACCESS.scope().stages;
        self.submit_with(Some((onto.free, stages)), Some(onto.drawn))
    }

    /// Ends the recording and submits the frame.
    ///
    /// # Errors
    /// When the device is lost or a Vulkan call fails.
    pub fn submit(self) -> Result<Ticket, Error> {
        self.submit_with(None, None)
    }

    fn submit_with(
        self,
        waits: Option<(vk::Semaphore, vk::PipelineStageFlags2)>,
        signals: Option<vk::Semaphore>,
    ) -> Result<Ticket, Error> {
        let slot = &mut self.frames.slots[self.index];
        // SAFETY: recording was begun and no rendering scope is open.
        unsafe { self.frames.gpu.device.end_command_buffer(slot.commands) }
            .map_err(Error::vulkan("vkEndCommandBuffer", "a frame"))?;
        slot.submit_time = Some(Instant::now());
        slot.submitted = self.frames.gpu.submit(slot.commands, waits, signals)?;
        let ticket = Ticket {
            slot: self.index,
            value: slot.submitted,
        };
        self.frames.next = (self.index + 1) % self.frames.slots.len();
        Ok(ticket)
    }
}

/// A pass being described: its targets and what it reads. [`draw`](Pass::draw) records it.
pub struct Pass<'f> {
    gpu: Arc<Gpu>,
    timestamps: bool,
    slot: &'f mut Slot,
    barriers: &'f mut Barriers,
    name: &'static str,
    colors: [Option<(vk::ImageView, Load)>; 4],
    color_count: usize,
    depth: Option<(vk::ImageView, Load)>,
    extent: Option<vk::Extent2D>,
}

impl Pass<'_> {
    fn target(&mut self, image: &Image) {
        let extent = vk::Extent2D {
            width: image.width,
            height: image.height,
        };
        assert!(
            self.extent.is_none_or(|e| e == extent),
            "pass {}: its targets differ in size",
            self.name
        );
        self.extent = Some(extent);
    }

    /// Draws into a color target; targets get locations 0, 1, ... in this order.
    #[must_use]
    pub fn color(mut self, image: &Image, load: Load) -> Self {
        self.target(image);
        let access = match load {
            Load::Clear(_) => Access::ColorTarget,
            Load::Keep => Access::BlendTarget,
        };
        self.barriers.image(image, access, load != Load::Keep);
        self.colors[self.color_count] = Some((image.view, load));
        self.color_count += 1;
        self
    }

    /// Tests and writes depth.
    #[must_use]
    pub fn depth(mut self, image: &Image, load: Load) -> Self {
        self.target(image);
        self.barriers
            .image(image, Access::DepthWrite, load != Load::Keep);
        self.depth = Some((image.view, load));
        self
    }

    /// Reads vertex records from a buffer.
    #[must_use]
    pub fn vertices(self, buffer: &dyn AnyBuffer) -> Self {
        self.barriers.buffer(buffer, Access::VertexRead);
        self.barriers.declared[0].push(buffer.handle());
        self
    }

    /// Reads indices from a buffer.
    #[must_use]
    pub fn indices(self, buffer: &dyn AnyBuffer) -> Self {
        self.barriers.buffer(buffer, Access::IndexRead);
        self.barriers.declared[1].push(buffer.handle());
        self
    }

    /// Records the pass: barriers, label, timestamps, rendering scope, and what `record` draws in it.
    /// `viewport` is x, y, width and height in pixels; it may reach beyond the targets.
    ///
    /// # Panics
    /// When the pass has no target, or `record` binds a buffer that was not declared.
    pub fn draw(mut self, viewport: [f32; 4], record: impl FnOnce(&mut Draw<'_>)) {
        let extent = self
            .extent
            .unwrap_or_else(|| panic!("pass {} has no target", self.name));
        let (colors, color_count) = (self.colors, self.color_count);
        let (depth, name) = (self.depth, self.name);
        let gpu = self.gpu.clone();
        let (commands, descriptors) = (self.slot.commands, self.slot.descriptors);
        let uniforms = self.slot.uniforms.handle();
        let declared = std::mem::take(&mut self.barriers.declared);
        let timing = self.begin();
        let attachment = |view: vk::ImageView, load: Load, is_depth: bool| {
            let (op, clear) = match load {
                Load::Keep => (vk::AttachmentLoadOp::LOAD, vk::ClearValue::default()),
                Load::Clear(value) if is_depth => (
                    vk::AttachmentLoadOp::CLEAR,
                    vk::ClearValue {
                        depth_stencil: vk::ClearDepthStencilValue {
                            depth: value[0],
                            stencil: 0,
                        },
                    },
                ),
                Load::Clear(value) => (
                    vk::AttachmentLoadOp::CLEAR,
                    vk::ClearValue {
                        color: vk::ClearColorValue { float32: value },
                    },
                ),
            };
            vk::RenderingAttachmentInfo::default()
                .image_view(view)
                .image_layout(if is_depth {
                    vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL
                } else {
                    vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL
                })
                .load_op(op)
                .store_op(vk::AttachmentStoreOp::STORE)
                .clear_value(clear)
        };
        let mut color_infos = [vk::RenderingAttachmentInfo::default(); 4];
        for (info, color) in color_infos.iter_mut().zip(colors.iter().flatten()) {
            *info = attachment(color.0, color.1, false);
        }
        let depth_info = depth.map(|(view, load)| attachment(view, load, true));
        let area = vk::Rect2D {
            offset: vk::Offset2D::default(),
            extent,
        };
        let mut rendering = vk::RenderingInfo::default()
            .render_area(area)
            .layer_count(1)
            .color_attachments(&color_infos[..color_count]);
        if let Some(info) = &depth_info {
            rendering = rendering.depth_attachment(info);
        }
        let [x, y, width, height] = viewport;
        let viewports = [vk::Viewport {
            x,
            y,
            width,
            height,
            min_depth: 0.0,
            max_depth: 1.0,
        }];
        // SAFETY: the command buffer is being recorded; targets are alive until the frame has finished and in
        // the layouts that the barriers of `begin` gave them.
        unsafe {
            gpu.device.cmd_begin_rendering(commands, &rendering);
            gpu.device.cmd_set_viewport(commands, 0, &viewports);
            gpu.device.cmd_set_scissor(commands, 0, &[area]);
        }
        let mut draw = Draw {
            gpu: &gpu,
            commands,
            descriptors,
            uniforms,
            vertex_buffers: &declared[0],
            index_buffers: &declared[1],
            name,
        };
        record(&mut draw);
        // SAFETY: ends the scope begun above.
        unsafe { gpu.device.cmd_end_rendering(commands) };
        timing.end();
        // Handed back for the next pass, which clears them.
        self.barriers.declared = declared;
    }

    fn begin(&mut self) -> Timing {
        let commands = self.slot.commands;
        self.barriers.record(&self.gpu, commands);
        if let Some(debug) = &self.gpu.debug_device {
            let mut text = [0u8; 64];
            let length = self.name.len().min(text.len() - 1);
            text[..length].copy_from_slice(&self.name.as_bytes()[..length]);
            if let Ok(label) = CStr::from_bytes_until_nul(&text) {
                let info = vk::DebugUtilsLabelEXT::default().label_name(label);
                // SAFETY: the command buffer is being recorded; ended in `Timing::end`.
                unsafe { debug.cmd_begin_debug_utils_label(commands, &info) };
            }
        }
        let query = if self.timestamps && self.slot.names.len() < MAX_PASSES as usize {
            self.slot.names.push(self.name);
            Some(2 * (self.slot.names.len() as u32 - 1))
        } else {
            None
        };
        let timing = Timing {
            gpu: self.gpu.clone(),
            commands,
            queries: self.slot.queries,
            query,
        };
        if let Some(query) = timing.query {
            timing.stamp(query);
        }
        timing
    }
}

/// The open end of a pass: writes the second timestamp and closes the label.
struct Timing {
    gpu: Arc<Gpu>,
    commands: vk::CommandBuffer,
    queries: vk::QueryPool,
    query: Option<u32>,
}

impl Timing {
    /// A timestamp after all work so far, and a full barrier behind it: without the barrier a device may let
    /// later work start first (or record the stamp late), and its time is booked to the wrong pass.
    fn stamp(&self, query: u32) {
        let all = vk::PipelineStageFlags2::ALL_COMMANDS;
        let barriers = [vk::MemoryBarrier2::default()
            .src_stage_mask(all)
            .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(all)
            .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)];
        let info = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: the command buffer is being recorded outside of a rendering scope; the query was reset when
        // the frame began and is written once.
        unsafe {
            self.gpu
                .device
                .cmd_write_timestamp2(self.commands, all, self.queries, query);
            self.gpu.device.cmd_pipeline_barrier2(self.commands, &info);
        }
    }

    fn end(self) {
        if let Some(query) = self.query {
            self.stamp(query + 1);
        }
        if let Some(debug) = &self.gpu.debug_device {
            // SAFETY: closes the label that `Pass::begin` opened.
            unsafe { debug.cmd_end_debug_utils_label(self.commands) };
        }
    }
}

/// Draws inside a pass.
pub struct Draw<'a> {
    gpu: &'a Gpu,
    commands: vk::CommandBuffer,
    descriptors: vk::DescriptorPool,
    uniforms: vk::Buffer,
    vertex_buffers: &'a [vk::Buffer],
    index_buffers: &'a [vk::Buffer],
    name: &'static str,
}

impl std::fmt::Debug for Draw<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Draw")
            .field("pass", &self.name)
            .finish_non_exhaustive()
    }
}

impl Draw<'_> {
    /// Binds a pipeline with its uniform blocks, one for each of its bindings in ascending order.
    ///
    /// # Panics
    /// When a binding gets no block or is not a uniform block, or the frame has bound too many.
    pub fn bind(&mut self, pipeline: &Pipeline, uniforms: &[Uniform]) {
        assert!(
            uniforms.len() == pipeline.bindings.len(),
            "{}: {} wants {} bindings",
            self.name,
            pipeline.name(),
            pipeline.bindings.len()
        );
        let layouts = [pipeline.set_layout];
        let info = vk::DescriptorSetAllocateInfo::default()
            .descriptor_pool(self.descriptors)
            .set_layouts(&layouts);
        // SAFETY: the pool belongs to this frame's slot, whose last use has finished; the buffers written are
        // alive as long as the frame; every binding of the set is written before it is bound.
        unsafe {
            let sets = match self.gpu.device.allocate_descriptor_sets(&info) {
                Ok(sets) => sets,
                Err(result) => panic!(
                    "{}: a frame has room for {} bindings: {result}",
                    self.name,
                    4 * MAX_PASSES
                ),
            };
            for (&(binding, kind), uniform) in pipeline.bindings.iter().zip(uniforms) {
                assert!(
                    kind == BindingKind::UniformBuffer,
                    "{}: binding {binding} is not uniform",
                    self.name
                );
                let buffers = [vk::DescriptorBufferInfo::default()
                    .buffer(self.uniforms)
                    .offset(uniform.offset)
                    .range(uniform.bytes)];
                let write = vk::WriteDescriptorSet::default()
                    .dst_set(sets[0])
                    .dst_binding(binding)
                    .descriptor_type(vk::DescriptorType::UNIFORM_BUFFER)
                    .buffer_info(&buffers);
                self.gpu.device.update_descriptor_sets(&[write], &[]);
            }
            let point = vk::PipelineBindPoint::GRAPHICS;
            self.gpu
                .device
                .cmd_bind_pipeline(self.commands, point, pipeline.handle);
            self.gpu.device.cmd_bind_descriptor_sets(
                self.commands,
                point,
                pipeline.layout,
                0,
                &sets,
                &[],
            );
        }
    }

    /// Which triangles are dropped: those that show their back, where the front is counter-clockwise on the
    /// picture (`mirrored`: clockwise).
    pub fn cull_back_faces(&mut self, cull: bool, mirrored: bool) {
        let mode = if cull {
            vk::CullModeFlags::BACK
        } else {
            vk::CullModeFlags::NONE
        };
        let front = if mirrored {
            vk::FrontFace::CLOCKWISE
        } else {
            vk::FrontFace::COUNTER_CLOCKWISE
        };
        // SAFETY: the command buffer is being recorded; both states are core in Vulkan 1.3.
        unsafe {
            self.gpu.device.cmd_set_cull_mode(self.commands, mode);
            self.gpu.device.cmd_set_front_face(self.commands, front);
        }
    }

    /// Binds vertex records that start `offset` bytes into a declared buffer.
    ///
    /// # Panics
    /// When the pass did not declare the buffer.
    pub fn vertices(&mut self, buffer: &dyn AnyBuffer, offset: u64) {
        assert!(
            self.vertex_buffers.contains(&buffer.handle()),
            "pass {} did not declare vertex buffer {}",
            self.name,
            buffer.name()
        );
        // SAFETY: declared, so alive until the frame has finished and visible to vertex input.
        unsafe {
            self.gpu.device.cmd_bind_vertex_buffers(
                self.commands,
                0,
                &[buffer.handle()],
                &[offset],
            );
        }
    }

    /// Binds 32-bit indices that start `offset` bytes into a declared buffer.
    ///
    /// # Panics
    /// When the pass did not declare the buffer.
    pub fn indices(&mut self, buffer: &dyn AnyBuffer, offset: u64) {
        assert!(
            self.index_buffers.contains(&buffer.handle()),
            "pass {} did not declare index buffer {}",
            self.name,
            buffer.name()
        );
        // SAFETY: declared, so alive until the frame has finished and visible to index input.
        unsafe {
            self.gpu.device.cmd_bind_index_buffer(
                self.commands,
                buffer.handle(),
                offset,
                vk::IndexType::UINT32,
            );
        }
    }

    /// Draws `count` vertices from `first` on.
    pub fn draw(&mut self, first: u32, count: u32) {
        // SAFETY: pipeline, state and vertices are bound; the range lies in the bound buffer (callers draw
        // what they have written).
        unsafe { self.gpu.device.cmd_draw(self.commands, count, 1, first, 0) };
    }

    /// Draws `count` indices from `first` on; `vertex_offset` is added to each.
    pub fn draw_indexed(&mut self, first: u32, count: u32, vertex_offset: i32) {
        // SAFETY: as in `draw`, and every index plus offset names a vertex of the bound buffer.
        unsafe {
            self.gpu
                .device
                .cmd_draw_indexed(self.commands, count, 1, first, vertex_offset, 0);
        }
    }
}

/// Copies the first `bytes` of `from` to `offset` in `to`, and waits. Not for the frame loop.
pub(super) fn copy_once(
    gpu: &Arc<Gpu>,
    from: &Upload,
    to: &dyn AnyBuffer,
    offset: u64,
    bytes: u64,
) -> Result<(), Error> {
    let mut frames = Frames::new(gpu, 1, false)?;
    let frame = frames.begin()?;
    let commands = frame.frames.slots[frame.index].commands;
    frame.frames.barriers.buffer(from, Access::CopySource);
    frame.frames.barriers.buffer(to, Access::CopyTarget);
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
