//! The pass: the only place that writes labels, timestamps, barriers and scopes.

use super::access::{ResourceAccess, ResourceState};
use super::bind::{self, BindSite, BoundResources, BufferSlice};
use super::buffer::{AnyBuffer, state_of};
use super::image::{DeviceImage, ImageFormat, range};
use super::pipeline::ShaderPipeline;
use super::query::SlotQueries;
use super::slot::{FrameSlot, UniformBlock};
use super::{Gpu, lock};
use ash::vk;
use std::cell::Cell;
use std::sync::Arc;

/// Contents that a pass finds in a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TargetLoad {
    /// The given value everywhere (the first component for depth).
    Clear([f32; 4]),
    /// Contents that the pass before left.
    Keep,
}

/// The barriers before the next command, gathered from declared uses.
#[derive(Default)]
pub(super) struct PendingBarriers {
    buffers: Vec<vk::BufferMemoryBarrier2<'static>>,
    images: Vec<vk::ImageMemoryBarrier2<'static>>,
    /// Vertex, index, storage and argument buffers that the pass being described declared; kept for their memory.
    pub(super) declared: [Vec<vk::Buffer>; 4],
    /// Record none: a planted fault, see [`omit_barriers`](super::frame::FrameRing::omit_barriers).
    pub(super) omitted: bool,
}

impl PendingBarriers {
    /// The next use of a buffer.
    pub(super) fn buffer(&mut self, buffer: &dyn AnyBuffer, access: ResourceAccess) {
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

    /// The next use of an image; with `discard` what it held is not needed.
    pub(super) fn image(&mut self, image: &DeviceImage, access: ResourceAccess, discard: bool) {
        self.handle(
            image.handle,
            image.format,
            &mut lock(&image.state),
            access,
            discard,
        );
    }

    /// Adds an image that another owns, as [`image`](PendingBarriers::image) does an own one.
    pub(super) fn handle(
        &mut self,
        image: vk::Image,
        format: ImageFormat,
        state: &mut ResourceState,
        access: ResourceAccess,
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

    /// Writes what was gathered, outside of a rendering scope.
    pub(super) fn record(&mut self, gpu: &Gpu, commands: vk::CommandBuffer) {
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

/// A pass being described: its targets and what it reads. [`draw`](PassBuilder::draw) records it.
pub struct PassBuilder<'f> {
    pub(super) gpu: Arc<Gpu>,
    pub(super) slot: &'f mut FrameSlot,
    pub(super) barriers: &'f mut PendingBarriers,
    pub(super) name: &'static str,
    colors: [Option<(vk::ImageView, TargetLoad)>; 4],
    color_count: usize,
    depth: Option<(vk::ImageView, TargetLoad)>,
    depth_is_read_only: bool,
    extent: Option<vk::Extent2D>,
    /// Bytes of targets loaded and stored.
    moved_bytes: (u64, u64),
}

impl<'f> PassBuilder<'f> {
    /// A pass without targets, to be recorded into `slot`.
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        slot: &'f mut FrameSlot,
        barriers: &'f mut PendingBarriers,
        name: &'static str,
    ) -> Self {
        barriers.declared.iter_mut().for_each(Vec::clear);
        Self {
            gpu: gpu.clone(),
            slot,
            barriers,
            name,
            colors: [None; 4],
            color_count: 0,
            depth: None,
            depth_is_read_only: false,
            extent: None,
            moved_bytes: (0, 0),
        }
    }

    fn target(&mut self, image: &DeviceImage, is_loaded: bool, is_stored: bool) {
        self.moved_bytes.0 += if is_loaded { image.bytes() } else { 0 };
        self.moved_bytes.1 += if is_stored { image.bytes() } else { 0 };
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
    pub fn color(mut self, image: &DeviceImage, load: TargetLoad) -> Self {
        self.target(image, load == TargetLoad::Keep, true);
        let access = match load {
            TargetLoad::Clear(_) => ResourceAccess::ColorTarget,
            TargetLoad::Keep => ResourceAccess::BlendTarget,
        };
        self.barriers.image(image, access, load != TargetLoad::Keep);
        self.colors[self.color_count] = Some((image.view, load));
        self.color_count += 1;
        self
    }

    /// Tests and writes depth.
    #[must_use]
    pub fn depth(mut self, image: &DeviceImage, load: TargetLoad) -> Self {
        self.target(image, load == TargetLoad::Keep, true);
        self.barriers
            .image(image, ResourceAccess::DepthWrite, load != TargetLoad::Keep);
        self.depth = Some((image.view, load));
        self
    }

    /// Tests against depth that an earlier pass wrote, and leaves it as it is.
    #[must_use]
    pub fn depth_test(mut self, image: &DeviceImage) -> Self {
        self.target(image, true, false);
        self.barriers.image(image, ResourceAccess::DepthTest, false);
        self.depth = Some((image.view, TargetLoad::Keep));
        self.depth_is_read_only = true;
        self
    }

    /// Samples an image in the fragment shader.
    #[must_use]
    pub fn sampled(self, image: &DeviceImage) -> Self {
        self.barriers.image(image, ResourceAccess::Sampled, false);
        self
    }

    /// Reads vertex records from a buffer.
    #[must_use]
    pub fn vertices(self, buffer: &dyn AnyBuffer) -> Self {
        self.barriers.buffer(buffer, ResourceAccess::VertexRead);
        self.barriers.declared[0].push(buffer.handle());
        self
    }

    /// Reads indices from a buffer.
    #[must_use]
    pub fn indices(self, buffer: &dyn AnyBuffer) -> Self {
        self.barriers.buffer(buffer, ResourceAccess::IndexRead);
        self.barriers.declared[1].push(buffer.handle());
        self
    }

    /// Reads a storage buffer in the fragment shader.
    #[must_use]
    pub fn fragment_storage(self, buffer: &dyn AnyBuffer) -> Self {
        self.barriers
            .buffer(buffer, ResourceAccess::FragmentStorageRead);
        self.barriers.declared[2].push(buffer.handle());
        self
    }

    /// Reads a storage buffer in the vertex shader.
    #[must_use]
    pub fn vertex_storage(self, buffer: &dyn AnyBuffer) -> Self {
        self.barriers
            .buffer(buffer, ResourceAccess::VertexStorageRead);
        self.barriers.declared[2].push(buffer.handle());
        self
    }

    /// Records the pass: barriers, label, timestamps, rendering scope, and what `record` draws in it.
    /// `viewport` is x, y, width and height in pixels; it may reach beyond the targets.
    ///
    /// # Panics
    /// When the pass has no target, or `record` binds a buffer that was not declared.
    pub fn draw(mut self, viewport: [f32; 4], record: impl FnOnce(&mut DrawRecorder<'_>)) {
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
        let attachment = |view: vk::ImageView, load: TargetLoad, is_depth: bool| {
            let (op, clear) = match load {
                TargetLoad::Keep => (vk::AttachmentLoadOp::LOAD, vk::ClearValue::default()),
                TargetLoad::Clear(value) if is_depth => (
                    vk::AttachmentLoadOp::CLEAR,
                    vk::ClearValue {
                        depth_stencil: vk::ClearDepthStencilValue {
                            depth: value[0],
                            stencil: 0,
                        },
                    },
                ),
                TargetLoad::Clear(value) => (
                    vk::AttachmentLoadOp::CLEAR,
                    vk::ClearValue {
                        color: vk::ClearColorValue { float32: value },
                    },
                ),
            };
            vk::RenderingAttachmentInfo::default()
                .image_view(view)
                .image_layout(if is_depth {
                    ResourceAccess::DepthWrite.scope().layout
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
        let mut depth_info = depth.map(|(view, load)| attachment(view, load, true));
        if let (Some(info), true) = (&mut depth_info, self.depth_is_read_only) {
            *info = info
                .image_layout(ResourceAccess::DepthTest.scope().layout)
                .store_op(vk::AttachmentStoreOp::NONE);
        }
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
        let queries = &mut self.slot.queries;
        let counting = queries.begin_counters(&gpu, commands, name, self.moved_bytes);
        let mut draw = DrawRecorder {
            site: BindSite {
                gpu: &gpu,
                commands,
                descriptors,
                uniforms,
                storage: &declared[2],
                name,
                has_failed: Cell::default(),
            },
            vertex_buffers: &declared[0],
            index_buffers: &declared[1],
            argument_buffers: &declared[3],
        };
        record(&mut draw);
        if let Some(counting) = counting {
            counting.end(&gpu, commands);
        }
        // SAFETY: ends the scope begun above.
        unsafe { gpu.device.cmd_end_rendering(commands) };
        timing.end(&self.slot.queries);
        // Handed back for the next pass, which clears them.
        self.barriers.declared = declared;
    }

    /// Draws as [`draw`](PassBuilder::draw) does, with a viewport that is the whole of the targets.
    ///
    /// # Panics
    /// As there.
    pub fn draw_whole(self, record: impl FnOnce(&mut DrawRecorder<'_>)) {
        let extent = self.extent.unwrap_or_default();
        let viewport = [0.0, 0.0, extent.width as f32, extent.height as f32];
        self.draw(viewport, record);
    }

    /// Opens the label and the span, writes the first timestamp and the barriers, which are the pass's own cost.
    pub(super) fn begin(&mut self) -> PassTiming {
        let commands = self.slot.commands;
        self.gpu.begin_label(commands, self.name);
        let timing = PassTiming {
            gpu: self.gpu.clone(),
            commands,
            timestamp: self.slot.queries.next_timed(self.name),
            _span: tracing::debug_span!("pass", name = self.name).entered(),
        };
        if let Some(query) = timing.timestamp {
            self.slot.queries.stamp(&self.gpu, commands, query);
        }
        self.barriers.record(&self.gpu, commands);
        timing
    }
}

/// The open end of a pass: writes the second timestamp and closes label and span.
pub(super) struct PassTiming {
    gpu: Arc<Gpu>,
    commands: vk::CommandBuffer,
    timestamp: Option<u32>,
    _span: tracing::span::EnteredSpan,
}

impl PassTiming {
    /// Writes the second timestamp and closes the label.
    pub(super) fn end(self, queries: &SlotQueries) {
        if let Some(query) = self.timestamp {
            queries.stamp(&self.gpu, self.commands, query + 1);
        }
        self.gpu.end_label(self.commands);
    }
}

/// Draws inside a pass.
pub struct DrawRecorder<'a> {
    pub(super) site: BindSite<'a>,
    vertex_buffers: &'a [vk::Buffer],
    index_buffers: &'a [vk::Buffer],
    pub(super) argument_buffers: &'a [vk::Buffer],
}

impl std::fmt::Debug for DrawRecorder<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Draw")
            .field("pass", &self.site.name)
            .finish_non_exhaustive()
    }
}

impl DrawRecorder<'_> {
    /// Binds a pipeline with its uniform blocks and its images, each in ascending order of their bindings.
    ///
    /// # Panics
    /// When a binding gets nothing or something of another kind, an image was not declared by the pass, or the
    /// frame has bound too many.
    pub fn bind(
        &mut self,
        pipeline: &ShaderPipeline,
        uniforms: &[UniformBlock],
        images: &[&DeviceImage],
    ) {
        self.bind_storage(pipeline, uniforms, images, &[]);
    }

    /// Binds the storage buffers that the shaders read, as [`bind`](DrawRecorder::bind) does everything.
    ///
    /// # Panics
    /// As there.
    pub fn bind_storage(
        &mut self,
        pipeline: &ShaderPipeline,
        uniforms: &[UniformBlock],
        images: &[&DeviceImage],
        storage: &[BufferSlice<'_>],
    ) {
        let bound = BoundResources {
            uniforms,
            images,
            storage,
        };
        bind::bind(
            &self.site,
            vk::PipelineBindPoint::GRAPHICS,
            pipeline,
            &bound,
        );
    }

    /// Drops triangles that show their back, where the front is counter-clockwise on the
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
            self.site
                .gpu
                .device
                .cmd_set_cull_mode(self.site.commands, mode);
            self.site
                .gpu
                .device
                .cmd_set_front_face(self.site.commands, front);
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
            self.site.name,
            buffer.name()
        );
        // SAFETY: declared, so alive until the frame has finished and visible to vertex input.
        unsafe {
            self.site.gpu.device.cmd_bind_vertex_buffers(
                self.site.commands,
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
            self.site.name,
            buffer.name()
        );
        // SAFETY: declared, so alive until the frame has finished and visible to index input.
        unsafe {
            self.site.gpu.device.cmd_bind_index_buffer(
                self.site.commands,
                buffer.handle(),
                offset,
                vk::IndexType::UINT32,
            );
        }
    }

    /// Limits what is drawn from here on to the inside of `x`, `y`, `width`, `height` in pixels of the target.
    pub fn scissor(&mut self, [x, y, width, height]: [u32; 4]) {
        let area = [vk::Rect2D {
            offset: vk::Offset2D {
                x: x as i32,
                y: y as i32,
            },
            extent: vk::Extent2D { width, height },
        }];
        // SAFETY: the command buffer is being recorded; the rectangle lies inside of the target, whose sides are
        // far below the range of the offsets.
        unsafe {
            self.site
                .gpu
                .device
                .cmd_set_scissor(self.site.commands, 0, &area)
        };
    }

    /// Draws `count` vertices from `first` on.
    pub fn draw(&mut self, first: u32, count: u32) {
        if self.site.has_failed.get() {
            return;
        }
        // SAFETY: pipeline, state and vertices are bound; the range lies in the bound buffer (callers draw
        // what they have written).
        unsafe {
            self.site
                .gpu
                .device
                .cmd_draw(self.site.commands, count, 1, first, 0)
        };
    }

    /// Draws `count` records from `first` on as quads
    /// ([`Topology::Quads`](super::pipeline::PrimitiveTopology::Quads)).
    pub fn draw_quads(&mut self, first: u32, count: u32) {
        self.draw_records(6, first, count);
    }

    /// Draws `count` records from `first` on as fans ([`Topology::Fans`](super::pipeline::PrimitiveTopology::Fans)).
    pub fn draw_fans(&mut self, first: u32, count: u32) {
        self.draw_records(18, first, count);
    }

    fn draw_records(&mut self, vertices: u32, first: u32, count: u32) {
        if self.site.has_failed.get() {
            return;
        }
        // SAFETY: as in `draw`; the records are bound per instance.
        unsafe {
            self.site
                .gpu
                .device
                .cmd_draw(self.site.commands, vertices, count, 0, first)
        };
    }

    /// Draws `count` indices from `first` on; `vertex_offset` is added to each.
    pub fn draw_indexed(&mut self, first: u32, count: u32, vertex_offset: i32) {
        if self.site.has_failed.get() {
            return;
        }
        // SAFETY: as in `draw`, and every index plus offset names a vertex of the bound buffer.
        unsafe {
            self.site.gpu.device.cmd_draw_indexed(
                self.site.commands,
                count,
                1,
                first,
                vertex_offset,
                0,
            );
        }
    }
}
