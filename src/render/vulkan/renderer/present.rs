//! What a window asks of the renderer beyond pictures: frames that go to the screen without waiting for each
//! other, new sizes, and the depth under the cursor.

use crate::gpu::Error;
use crate::gpu::buffer::ReadbackBuffer;
use crate::gpu::frame::{FrameRecorder, FrameTicket};
use crate::gpu::image::DeviceImage as Target;
use crate::gpu::overlay::WindowOverlay;
use crate::gpu::surface::AcquiredImage;
use crate::image::Image;
use crate::math::camera::View;
use crate::pack::SurfaceLighting;
use crate::render::compute_limits::largest_threshold_px;
use crate::render::cost::choose::{ComputeShare, FrameWorkload};
use crate::render::cost::select_passes::PassSelection;
use crate::render::frame_estimate::{FrameEstimate, counts_of_cuts};
use crate::render::model_facts::{DrawnParts, facted};
use crate::render::probe_area::MOST_PROBE_PIXELS;
use crate::render::stats::FrameStage;
use crate::render::technique::Technique;
use crate::render::vulkan::renderer::{FrameTimes, SubmittedFrame, VulkanRenderer};
use crate::render::vulkan::scene::DeviceScene;
use crate::render::vulkan::targets::Context;
use crate::render::{Path, Settings, screen_bounds};
use crate::tree::Model;
use std::time::Instant;

/// Where a frame goes besides the renderer's own targets.
#[derive(Debug)]
pub struct ShownFrame<'a> {
    /// The image of a window; none leaves the frame where it is, to be read back.
    pub onto: Option<&'a AcquiredImage>,
    /// What covers the picture.
    pub overlay: Option<&'a mut WindowOverlay>,
    /// Columns at the left that the picture leaves to the overlay, pixels; 0 without one.
    pub inset: u32,
}

impl ShownFrame<'_> {
    /// Covers the picture, presents and submits.
    fn end(&mut self, mut frame: FrameRecorder<'_>, color: &Target) -> Result<FrameTicket, Error> {
        let shown = match &mut self.overlay {
            Some(overlay) => overlay.record(&mut frame, color),
            None => color,
        };
        match self.onto {
            Some(onto) => {
                frame.present(shown, onto);
                frame.submit_onto(onto)
            }
            None => frame.submit(),
        }
    }
}

impl VulkanRenderer {
    /// Width and height of its pictures, pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.targets.color.width, self.targets.color.height]
    }

    /// How many frames can be on their way at once.
    pub fn in_flight(&self) -> usize {
        self.frames.in_flight()
    }

    /// Waits until the next frame can be recorded and tells its slot of the ring, for
    /// [`Surface::acquire`](crate::gpu::surface::WindowSurface::acquire).
    ///
    /// # Errors
    /// When the device is lost.
    pub fn wait_for_next(&mut self) -> Result<usize, Error> {
        self.frames.wait_for_next()?;
        Ok(self.frames.next_slot())
    }

    /// Makes the targets anew for pictures of `width` x `height` pixels; does nothing when they have that size.
    ///
    /// # Errors
    /// When a side is 0 or above the device's limit, or memory runs out.
    pub fn resize(&mut self, width: u32, height: u32) -> Result<(), Error> {
        if (self.targets.color.width, self.targets.color.height) != (width, height) {
            self.remake_targets((width, height), self.targets.normal.is_some())?;
        }
        Ok(())
    }

    /// Counts what a frame of these settings would draw, without drawing it: its cut is chosen, and used by the next
    /// frame if that has the same view and settings. The time is booked as that frame's. Nothing without a cut.
    pub fn predict(
        &mut self,
        models: &[&Model],
        scene: &DeviceScene,
        view: &View,
        settings: &Settings,
    ) -> FrameEstimate {
        let shown = scene.shown(models);
        let parts = facted(&shown);
        self.predict_parts(DrawnParts::new(&parts), scene, view, settings)
    }

    /// As [`VulkanRenderer::predict`], of parts of the scene.
    pub(crate) fn predict_parts(
        &mut self,
        parts: DrawnParts<'_>,
        scene: &DeviceScene,
        view: &View,
        settings: &Settings,
    ) -> FrameEstimate {
        if !settings.has_cut() {
            return FrameEstimate::default();
        }
        let start = Instant::now();
        let Ok(plan) = self.plan(parts, scene, view, settings) else {
            return FrameEstimate::default();
        };
        let is_new = self.choose_cut(&plan, parts);
        let counts = counts_of_cuts(&plan, parts, &self.cuts);
        let ahead = self.ahead.get_or_insert_default();
        ahead.ms += crate::render::vulkan::renderer::ms(start);
        ahead.is_new |= is_new;
        let triangles = counts.triangles as usize;
        let workload = FrameWorkload {
            splats: (counts.splats + self.cuts.stats().hidden) as usize,
            triangles,
            ..self.workload(&plan, parts)
        };
        let selection = PassSelection::of(&plan, &workload);
        let is_blended = matches!(plan.technique, Technique::Fuzzy | Technique::Filtered);
        let has_large = plan.primitives.has_large_splats;
        let share = match selection.share {
            Some(share) => share,
            None => workload.blended(triangles, has_large),
        };
        FrameEstimate {
            counts,
            pixels: screen_bounds::pixels(plan.context.rect_px),
            is_blended,
            by_compute: selection.has_splats_by_compute || share != ComputeShare::Nothing,
            is_free: plan.may_use_compute && settings.path == Path::Auto,
            largest_by_compute_px: largest_threshold_px(&plan.settings),
        }
    }

    /// Forgets the cut that was chosen for a frame that is not drawn; to be called when the model changes.
    pub fn forget_prediction(&mut self) {
        self.ahead = None;
    }

    /// Submits one frame that is drawn, covered by the overlay (if any) and put where `shown` says, and does not
    /// wait for it.
    ///
    /// # Errors
    /// As [`VulkanRenderer::draw`]; an acquired image must be abandoned then.
    pub(crate) fn submit_shown(
        &mut self,
        parts: DrawnParts<'_>,
        scene: &mut DeviceScene,
        view: &View,
        settings: &Settings,
        mut shown: ShownFrame<'_>,
    ) -> Result<SubmittedFrame, Error> {
        self.prepare_overlay(&mut shown)?;
        self.submit(parts, scene, view, settings, &mut |frame, color| {
            shown.end(frame, color)
        })
    }

    /// Submits a frame that shows the picture of the last frame again, under a new overlay.
    ///
    /// # Errors
    /// When memory runs out or the device is lost; an acquired image must be abandoned then.
    pub fn submit_again(&mut self, mut shown: ShownFrame<'_>) -> Result<SubmittedFrame, Error> {
        let start = Instant::now();
        self.prepare_overlay(&mut shown)?;
        let picture = self.looks.picture(&self.targets);
        let frame = self.frames.begin()?;
        let ticket = shown.end(frame, picture)?;
        Ok(SubmittedFrame::without_cut(
            ticket,
            FrameTimes::default(),
            start,
        ))
    }

    /// Submits a frame that shows a picture that was drawn elsewhere, as its `times` say, from `start` on.
    ///
    /// # Errors
    /// When memory runs out or the device is lost; an acquired image must be abandoned then.
    pub fn submit_picture(
        &mut self,
        picture: &Target,
        mut times: FrameTimes,
        start: Instant,
        mut shown: ShownFrame<'_>,
    ) -> Result<SubmittedFrame, Error> {
        let submit = FrameStage::Submit.begin();
        self.prepare_overlay(&mut shown)?;
        let frame = self.frames.begin()?;
        let ticket = shown.end(frame, picture)?;
        submit.end(&mut times);
        Ok(SubmittedFrame::without_cut(ticket, times, start))
    }

    /// Waits until a frame no longer reads what it shows.
    ///
    /// # Errors
    /// When the device is lost.
    pub(crate) fn wait_for(&self, submitted: FrameTicket) -> Result<(), Error> {
        self.frames.wait_for(submitted)
    }

    /// Waits for the slot of the next frame and readies its overlay, if it has one.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    fn prepare_overlay(&mut self, shown: &mut ShownFrame<'_>) -> Result<(), Error> {
        let Some(overlay) = &mut shown.overlay else {
            return Ok(());
        };
        self.frames.wait_for_next()?;
        let (width, height) = (self.targets.color.width, self.targets.color.height);
        let inset = shown.inset;
        overlay.prepare(self.frames.next_slot(), (width + inset, height), inset)
    }

    /// Submits a frame that shows nothing but the background, for a window without a model.
    ///
    /// # Errors
    /// When the device is lost; the image must be abandoned then.
    pub fn submit_background(
        &mut self,
        background: [f32; 3],
        mut shown: ShownFrame<'_>,
    ) -> Result<SubmittedFrame, Error> {
        let start = Instant::now();
        self.prepare_overlay(&mut shown)?;
        let context = Context {
            rect_px: [0, 0, self.targets.color.width, self.targets.color.height],
            width: self.targets.color.width,
            height: self.targets.color.height,
            guard_px: 0,
            background,
            cull_back: false,
            is_mirrored: false,
            light: SurfaceLighting::Headlight,
            depth_range: [0.0, 1.0],
            reads_depth: false,
            occlusion_slack: 0.0,
        };
        self.looks.forget();
        let mut frame = self.frames.begin()?;
        self.targets
            .attach(frame.pass("background"), &context)
            .draw(context.viewport(), |_| {});
        let ticket = shown.end(frame, &self.targets.color)?;
        Ok(SubmittedFrame::without_cut(
            ticket,
            FrameTimes::default(),
            start,
        ))
    }

    /// Reads what the last frame showed, overlay and all; `picture` is what lay under it, where that was drawn elsewhere.
    /// Waits for the device; not for every frame.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn read_shown(
        &mut self,
        overlay: Option<&WindowOverlay>,
        picture: Option<&Target>,
    ) -> Result<Image, Error> {
        let shown = overlay.and_then(WindowOverlay::shown).or(picture);
        let shown = shown.unwrap_or_else(|| self.looks.picture(&self.targets));
        let mut pixels = ReadbackBuffer::new(&self.gpu, "readback of the window", shown.bytes())?;
        let mut frame = self.frames.begin()?;
        frame.read_back("readback.window", shown, &pixels);
        let ticket = frame.submit()?;
        self.frames.finish(ticket)?;
        Ok(Image {
            width: shown.width,
            height: shown.height,
            color: bytemuck::pod_collect_to_vec(pixels.bytes()),
            ..Image::default()
        })
    }

    /// Reads reversed depths of a part of the picture of the last frame: left, top, width and height, pixels. Waits for the
    /// device; not for every frame.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub(crate) fn read_depths(&mut self, part: [u32; 4]) -> Result<Vec<f32>, Error> {
        let mut probe = match self.probe.take() {
            Some(probe) => probe,
            None => ReadbackBuffer::new(
                &self.gpu,
                "depth under the cursor",
                MOST_PROBE_PIXELS * self.targets.depth.format.pixel_bytes(),
            )?,
        };
        let mut frame = self.frames.begin()?;
        frame.read_back_part("probe.depth", &self.targets.depth, part, &probe);
        let ticket = frame.submit()?;
        self.frames.finish(ticket)?;
        let depth = bytemuck::pod_collect_to_vec(probe.bytes());
        self.probe = Some(probe);
        Ok(depth)
    }
}
