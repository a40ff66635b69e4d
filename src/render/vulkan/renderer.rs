//! Draws frames of one size: targets, draw lists in mapped memory, passes, read-back.
//!
//! A frame goes: cut (CPU) -> pack into the mapped buffers of a free slot -> passes -> wait. Reading the
//! picture back is a submission of its own, so that its cost is not part of the frame's.

mod cut_frame;
mod device_cut_frame;
mod frame_targets;
mod prepare;
#[cfg(feature = "viewer")]
pub mod present;
mod readback;
mod whole_model_frame;

use crate::cut;
use crate::gpu::buffer::{AnyBuffer, ReadbackBuffer};
use crate::gpu::frame::{FrameMeasure, FrameRecorder, FrameRing, FrameTicket, UniformBlock};
use crate::gpu::image::DeviceImage as Target;
use crate::gpu::pipeline::ShaderPipeline;
use crate::gpu::{Error, Gpu};
use crate::math::camera::View;
use crate::pack::ColorBy;
pub use crate::render::PictureOutputs;
use crate::render::capabilities::RendererCapabilities;
use crate::render::cost::choose;
use crate::render::cost::choose::FrameWorkload;
use crate::render::cost::model::DrawCosts;
use crate::render::cut_key::CutKey;
pub(crate) use crate::render::frame_constants::margin_px;
use crate::render::frame_plan::{CutPlace, FramePlan, PlanInput};
use crate::render::model_facts::{DrawnParts, facted};
use crate::render::pack_params::splat_plan;
use crate::render::part_cuts::PartCuts;
pub use crate::render::stats::FrameTimes;
use crate::render::stats::OverdrawSummary;
use crate::render::stats::{CutAhead, FrameCounts, FrameStage, KeptWork};
use crate::render::vulkan::blended::filtered::FilteredPasses;
use crate::render::vulkan::blended::fuzzy::FuzzyPasses;
use crate::render::vulkan::device_cut::{ChosenKey, DeviceCut};
use crate::render::vulkan::device_tree::DeviceTree;
use crate::render::vulkan::draw_lists::DrawLists;
use crate::render::vulkan::expand_ids::IdExpansion;
use crate::render::vulkan::look::PictureLooks;
use crate::render::vulkan::opaque::compute::ComputeRasterizer;
use crate::render::vulkan::opaque::hardware::OpaqueSplats;
use crate::render::vulkan::opaque::polygons::PolygonPasses;
use crate::render::vulkan::opaque::rims::NumberedPatches;
use crate::render::vulkan::overdraw;
use crate::render::vulkan::photos::DevicePhotos;
use crate::render::vulkan::scene::DeviceScene;
use crate::render::vulkan::targets::FrameTargets;
use crate::render::vulkan::triangles::TriangleVariant;
use crate::render::vulkan::visibility::hardware::VisibilityPasses;
use crate::render::vulkan::{COLOR, SAMPLES};
use crate::render::{Method, Settings};
use crate::tree::Model;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A frame on its way through the device.
#[derive(Debug)]
#[must_use = "a frame is finished only once it was waited for"]
pub struct SubmittedFrame {
    ticket: FrameTicket,
    times: FrameTimes,
    start: Instant,
    /// The device chose its cut and knows its counts.
    on_device: bool,
    /// Slot of the ring in which overdraw was counted.
    counted: Option<usize>,
}

impl SubmittedFrame {
    /// A frame that shows what was there before, from `start` on.
    #[cfg(feature = "viewer")]
    fn without_cut(ticket: FrameTicket, times: FrameTimes, start: Instant) -> Self {
        Self {
            ticket,
            times,
            start,
            on_device: false,
            counted: None,
        }
    }

    /// The submission.
    #[cfg(feature = "viewer")]
    pub(crate) fn ticket(&self) -> FrameTicket {
        self.ticket
    }
}

/// A frame to be drawn: its plan, and the models in memory and on the device.
#[derive(Debug, Clone, Copy)]
struct PlannedFrame<'a> {
    plan: &'a FramePlan,
    parts: DrawnParts<'a>,
    scene: &'a DeviceScene,
}

/// Scenes, by [`DeviceScene::id`], of which something was tried that does not fit the device.
#[derive(Debug, Clone, Copy, Default)]
struct TooLargeScenes {
    cut: Option<u64>,
    filtered_cut: Option<u64>,
    tree: Option<u64>,
}

/// Ends a frame: submits it, after passes of its own that may read the color target.
type FrameEnding<'e> = dyn FnMut(FrameRecorder<'_>, &Target) -> Result<FrameTicket, Error> + 'e;

/// Draws frames of one size on one device.
#[derive(Debug)]
pub struct VulkanRenderer {
    gpu: Arc<Gpu>,
    frames: FrameRing,
    targets: FrameTargets,
    outputs: PictureOutputs,
    lists: Vec<DrawLists>,
    cuts: PartCuts,
    selector: cut::CutSelector,
    costs: Option<DrawCosts>,
    device_tree: Option<DeviceTree>,
    /// What makes records of numbers, once lists have held some.
    by_id: Option<IdExpansion>,
    device_cut: Option<DeviceCut>,
    /// What its lists are of.
    held_on_device: Option<ChosenKey>,
    too_large: TooLargeScenes,
    triangles: Option<(TriangleVariant, ShaderPipeline)>,
    spare_triangles: Vec<(TriangleVariant, ShaderPipeline)>,
    /// One for each variant that was drawn, those drawn last.
    splats: Vec<OpaqueSplats>,
    polygons: Option<PolygonPasses>,
    spare_polygons: Vec<PolygonPasses>,
    small: Option<ComputeRasterizer>,
    filtered: Option<FilteredPasses>,
    spare_filtered: Vec<FilteredPasses>,
    visibility: Option<VisibilityPasses>,
    fuzzy: Option<FuzzyPasses>,
    spare_fuzzy: Vec<FuzzyPasses>,
    looks: PictureLooks,
    /// What frames with photographs show.
    photos: Option<DevicePhotos>,
    /// Once overdraw was counted.
    overdraw: Option<overdraw::OverdrawCounter>,
    /// Slot of the frame that was last waited for, where it was counted there.
    counted: Option<usize>,
    readback: Option<[Option<ReadbackBuffer>; 3]>,
    /// Depth around one pixel, read for the viewer.
    #[cfg(feature = "viewer")]
    probe: Option<ReadbackBuffer>,
    keeps_lists: bool,
    /// What the present cut was chosen for, and in which scene; none where packing changed it.
    chosen: Option<(u64, CutKey)>,
    /// Nodes and leaves that all cuts looked at.
    visited: u64,
    /// The cut that was chosen for the next frame before it is drawn; none: not yet.
    ahead: Option<CutAhead>,
}

/// What ends a frame once its technique is recorded: the looks that go over the picture, and who shows it.
struct FrameEnd<'a> {
    targets: &'a FrameTargets,
    looks: &'a PictureLooks,
    plan: &'a FramePlan,
    /// Patches that it shows, if any.
    patches: Option<NumberedPatches<'a>>,
}

impl FrameEnd<'_> {
    /// Records the looks and ends the frame.
    ///
    /// # Errors
    /// As `end`.
    fn end(
        &self,
        mut frame: FrameRecorder<'_>,
        constants: UniformBlock,
        end: &mut FrameEnding<'_>,
    ) -> Result<FrameTicket, Error> {
        let drawn = (self.plan, self.patches);
        (self.looks).record(&mut frame, self.targets, drawn, constants)?;
        end(frame, self.looks.picture(self.targets))
    }
}

fn ms(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

impl VulkanRenderer {
    /// A renderer for pictures of `width` x `height` pixels. With `timestamps` every pass is timed.
    ///
    /// # Errors
    /// When a side is 0 or above the device's limit, or memory runs out.
    pub fn new(
        gpu: &Arc<Gpu>,
        width: u32,
        height: u32,
        outputs: PictureOutputs,
        timestamps: bool,
    ) -> Result<Self, Error> {
        let frames = FrameRing::new(gpu, 2, timestamps)?;
        let lists = (0..frames.in_flight())
            .map(|slot| DrawLists::new(gpu, slot))
            .collect::<Result<_, Error>>()?;
        let color = if outputs.values { SAMPLES } else { COLOR };
        Ok(Self {
            gpu: gpu.clone(),
            frames,
            targets: FrameTargets::new(gpu, width, height, (color, outputs.normal))?,
            outputs,
            lists,
            cuts: PartCuts::default(),
            selector: cut::CutSelector::default().with_subpixel_bits(gpu.info().subpixel_bits),
            costs: None,
            device_tree: None,
            by_id: None,
            device_cut: None,
            held_on_device: None,
            too_large: TooLargeScenes::default(),
            triangles: None,
            spare_triangles: Vec::new(),
            splats: Vec::new(),
            polygons: None,
            spare_polygons: Vec::new(),
            small: None,
            filtered: None,
            spare_filtered: Vec::new(),
            visibility: None,
            fuzzy: None,
            spare_fuzzy: Vec::new(),
            looks: PictureLooks::default(),
            photos: None,
            overdraw: None,
            counted: None,
            readback: None,
            #[cfg(feature = "viewer")]
            probe: None,
            keeps_lists: false,
            chosen: None,
            visited: 0,
            ahead: None,
        })
    }

    /// A renderer of the same size on the same device whose pictures have values and nothing else besides colors.
    ///
    /// # Errors
    /// As [`VulkanRenderer::new`].
    pub(crate) fn of_values(&self) -> Result<Self, Error> {
        let outputs = PictureOutputs {
            values: true,
            ..PictureOutputs::default()
        };
        let color = &self.targets.color;
        Self::new(&self.gpu, color.width, color.height, outputs, false)
    }

    /// The device.
    pub(crate) fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Puts these photographs on the surface in frames from the next one on whose settings show any.
    pub fn set_photos(&mut self, photos: Option<DevicePhotos>) {
        self.photos = photos;
    }

    /// The photographs of the next frames.
    pub fn photos(&self) -> Option<&DevicePhotos> {
        self.photos.as_ref()
    }

    /// What the frames from now on report; pass times at first, if the renderer was made with them.
    ///
    /// # Errors
    /// When the device cannot make the queries.
    pub fn measure(&mut self, measure: FrameMeasure) -> Result<(), Error> {
        self.frames.measure(measure)
    }

    /// Tells whether a frame takes over what is there of one before it where that is the same: the draw lists of the last frame
    /// in its slot of the ring, else the cut that was chosen last. A still camera then has no cut and no packing, and the
    /// same picture to the bit. Off at first, so that who draws a frame again and again to measure it measures whole
    /// frames; [`FrameTimes::kept`] says what was taken over.
    pub fn keep_lists(&mut self, keep: bool) {
        self.keeps_lists = keep;
    }

    /// Nodes and leaves that all cuts so far looked at.
    pub fn nodes_visited(&self) -> u64 {
        self.visited
    }

    /// What drawing costs on the renderer's device, as [`crate::bench::calibrate`] measures it: decides from the next frame
    /// on what is drawn by compute where [`Path::Auto`](crate::render::Path::Auto) leaves it open, and which splats are quads
    /// instead of points. Without, and for what was not measured, rules of thumb of a software device decide, and splats
    /// are points as far as the device has them. The picture is the same within one level.
    pub fn set_costs(&mut self, costs: Option<DrawCosts>) {
        if self.costs != costs {
            // What was packed by others may be of other primitives.
            self.lists.iter_mut().for_each(|lists| lists.held = None);
            self.costs = costs;
        }
    }

    /// The costs that decide.
    pub fn costs(&self) -> Option<DrawCosts> {
        self.costs
    }

    /// The cuts that were chosen last.
    pub fn cuts(&self) -> &PartCuts {
        &self.cuts
    }

    /// Draws one frame and waits until it is finished on the device.
    ///
    /// # Errors
    /// When the view's size is not the renderer's, points are larger than the device draws, memory runs out
    /// or the device is lost.
    pub fn draw(
        &mut self,
        model: &Model,
        scene: &mut DeviceScene,
        view: &View,
        settings: &Settings,
    ) -> Result<FrameTimes, Error> {
        self.draw_models(&[model], scene, view, settings)
    }

    /// Draws one frame of several models, all of the scene's, and waits until it is finished on the device. Those that the
    /// scene does not show are left out.
    ///
    /// # Errors
    /// As [`VulkanRenderer::draw`].
    pub fn draw_models(
        &mut self,
        models: &[&Model],
        scene: &mut DeviceScene,
        view: &View,
        settings: &Settings,
    ) -> Result<FrameTimes, Error> {
        let shown = scene.shown(models);
        let parts = facted(&shown);
        self.draw_parts(DrawnParts::new(&parts), scene, view, settings)
    }

    /// Draws one frame of parts of the scene, and waits until it is finished on the device.
    ///
    /// # Errors
    /// As [`VulkanRenderer::draw`].
    pub(crate) fn draw_parts(
        &mut self,
        parts: DrawnParts<'_>,
        scene: &mut DeviceScene,
        view: &View,
        settings: &Settings,
    ) -> Result<FrameTimes, Error> {
        let end: &mut FrameEnding<'_> = &mut |frame, _| frame.submit();
        let submitted = self.submit(parts, scene, view, settings, end)?;
        self.finish(submitted)
    }

    /// Waits until a frame is finished on the device and tells what it cost.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn finish(&mut self, submitted: SubmittedFrame) -> Result<FrameTimes, Error> {
        let SubmittedFrame {
            ticket,
            mut times,
            start,
            on_device,
            counted,
        } = submitted;
        let wait = FrameStage::Wait.begin();
        let finished = self.frames.finish(ticket)?;
        wait.end(&mut times);
        times.frame_ms = ms(start);
        times.starts.frame = Some(start);
        times.starts.submission = finished.submitted;
        times.passes = finished.passes;
        times.device = finished.device;
        times.counters = finished.counters;
        if let (true, Some(cut)) = (on_device, &mut self.device_cut) {
            let counts = cut.counts(ticket.slot);
            times.counts = FrameCounts {
                nodes_visited: u64::from(counts.visited),
                splats: u64::from(counts.splats[0]) + u64::from(counts.quads[1]),
                triangles: u64::from(counts.triangles[0] / 3 + counts.small),
                ..FrameCounts::default()
            };
            if times.kept != KeptWork::Lists {
                self.visited += times.counts.nodes_visited;
            }
        }
        times.uploaded_bytes = finished.uniform_bytes;
        if times.kept != KeptWork::Lists {
            times.uploaded_bytes += times.counts.draw_list_bytes;
        }
        self.counted = counted;
        times.overdraw = self.counted().map(OverdrawSummary::of);
        Ok(times)
    }

    fn counted(&mut self) -> Option<impl Iterator<Item = u32>> {
        let slot = self.counted?;
        Some(self.overdraw.as_mut()?.of_slot(slot))
    }

    /// How many splats and triangles cover each pixel of the frame that was last waited for, row by row from the top left,
    /// as [`ColorBy::Overdraw`] shows them; `None` of a frame that was drawn otherwise.
    pub fn overdraw(&mut self) -> Option<Vec<u32>> {
        Some(self.counted()?.collect())
    }

    /// Records and submits one frame that `end` ends.
    fn submit(
        &mut self,
        parts: DrawnParts<'_>,
        scene: &mut DeviceScene,
        view: &View,
        settings: &Settings,
        end: &mut FrameEnding<'_>,
    ) -> Result<SubmittedFrame, Error> {
        self.check_size(view)?;
        self.set_normals(settings.outputs_of_frame(self.outputs).normal)?;
        let (plan, planning) = self.prepared_plan((parts, scene), view, settings)?;
        let drawn = PlannedFrame {
            plan: &plan,
            parts,
            scene,
        };
        // To make what it needs is no part of it.
        let start = Instant::now();
        let start = start.checked_sub(planning).unwrap_or(start);
        let is_counted = plan.settings.color_by == ColorBy::Overdraw;
        let counted = is_counted.then(|| self.frames.next_slot());
        let on_device = plan.cut_place == CutPlace::Device;
        let (ticket, times) = match plan.settings.method {
            _ if on_device => self.draw_on_device(drawn, end)?,
            Method::Triangles => self.draw_triangles(drawn, end)?,
            Method::Points => self.draw_points(drawn, end)?,
            Method::Splats | Method::Pop => self.draw_cut(drawn, end)?,
        };
        Ok(SubmittedFrame {
            ticket,
            times,
            start,
            on_device,
            counted,
        })
    }

    /// # Errors
    /// When a view has not the size of the targets.
    fn check_size(&self, view: &View) -> Result<(), Error> {
        for (what, value, limit) in [
            (
                "the width of the view",
                view.width,
                self.targets.color.width,
            ),
            (
                "the height of the view",
                view.height,
                self.targets.color.height,
            ),
        ] {
            if value != limit {
                return Err(Error::Limit {
                    what: what.into(),
                    value: u64::from(value),
                    limit: u64::from(limit),
                });
            }
        }
        Ok(())
    }

    /// Plans a frame for this device.
    ///
    /// # Errors
    /// As [`FramePlan::new`].
    fn plan(
        &self,
        parts: DrawnParts<'_>,
        scene: &DeviceScene,
        view: &View,
        settings: &Settings,
    ) -> Result<FramePlan, Error> {
        let info = self.gpu.info();
        let fits = |too_large: Option<u64>| too_large != Some(scene.id());
        let capabilities = RendererCapabilities {
            max_point_px: info.max_point_size_px,
            largest_guarded_px: f32::INFINITY,
            largest_hidden_px: f32::INFINITY,
            is_software: info.is_cpu(),
            has_int64_atomics: info.has_int64_atomics,
            max_storage_range: info.max_storage_range,
            binds_vertices: (scene.vertex_buffers())
                .all(|vertices| AnyBuffer::bytes(vertices) <= info.max_storage_range),
            has_first_instance: info.has_first_instance,
            cuts_sooner: self.costs.is_some_and(|costs| costs.cuts_on_device()),
            fits_device_cut: fits(self.too_large.cut),
            fits_filtered_cut: fits(self.too_large.filtered_cut),
            fits_tree: fits(self.too_large.tree),
        };
        let input = PlanInput {
            parts,
            view,
            outputs: settings.outputs_of_frame(self.outputs),
            capabilities: &capabilities,
            costs: self.costs.as_ref(),
        };
        FramePlan::new(settings, &input)
    }

    /// How much the present cuts are in a planned frame.
    fn workload<'a>(&self, plan: &'a FramePlan, parts: DrawnParts<'_>) -> FrameWorkload<'a> {
        let (settings, cuts) = (&plan.settings, &self.cuts);
        // Which points there are does not matter to how many there are but for large leaves.
        let splats = cuts.splat_count(&splat_plan(settings, f32::INFINITY));
        let drawn = parts.iter().map(|part| part.model).zip(cuts.iter());
        FrameWorkload {
            settings,
            costs: self.costs,
            splats: splats + cuts.stats().hidden as usize,
            size_px: choose::size_px(settings, &plan.view, drawn),
            triangles: match plan.primitives.has_triangles {
                true => cuts.triangle_count(),
                false => 0,
            },
            rect_px: plan.context.rect_px,
            size: (plan.context.width, plan.context.height),
        }
    }

    /// Plans a frame, makes what it needs, and tells how long planning took. What does not fit the device, and is not insisted on, is planned without.
    ///
    /// # Errors
    /// As [`FramePlan::new`], and when memory runs out.
    fn prepared_plan(
        &mut self,
        (parts, scene): (DrawnParts<'_>, &mut DeviceScene),
        view: &View,
        settings: &Settings,
    ) -> Result<(FramePlan, Duration), Error> {
        loop {
            let start = Instant::now();
            let plan = self.plan(parts, scene, view, settings)?;
            let planning = start.elapsed();
            if self.prepare_tree(&plan, parts, scene)? {
                self.prepare(&plan, parts, scene)?;
                return Ok((plan, planning));
            }
        }
    }
}
