//! What a window asks of the renderer beyond pictures: frames that go to the screen without waiting for each
//! other, new sizes, and the depth under the cursor.

use crate::gpu::Error;
use crate::gpu::buffer::Readback;
use crate::gpu::frame::{Frame, Ticket};
use crate::gpu::image::Image as Target;
use crate::gpu::overlay::Overlay;
use crate::gpu::surface::Acquired;
use crate::image::Image;
use crate::math::camera::View;
use crate::pack::Lighting;
use crate::render::cost::choose;
use crate::render::cost::choose::Asked;
use crate::render::cost::choose::ComputeShare;
use crate::render::cut_key::CutKey;
use crate::render::frame_estimate::{FrameEstimate, counts_of_cut};
use crate::render::frame_plan::resolve_settings;
use crate::render::probe_area::MOST_PROBE_PIXELS;
use crate::render::stats::Stage;
use crate::render::technique::Technique;
use crate::render::vulkan::opaque::compute;
use crate::render::vulkan::renderer::{FrameTimes, Renderer, Submitted};
use crate::render::vulkan::scene::Scene;
use crate::render::vulkan::targets::{Context, Targets};
use crate::render::{Method, Path, Settings};
use crate::tree::Model;
use std::time::Instant;

/// Where a frame goes besides the renderer's own targets.
#[derive(Debug)]
pub struct Show<'a> {
    /// The image of a window; none leaves the frame where it is, to be read back.
    pub onto: Option<&'a Acquired>,
    /// What covers the picture.
    pub overlay: Option<&'a mut Overlay>,
    /// Columns at the left that the picture leaves to the overlay, pixels; 0 without one.
    pub inset: u32,
}

impl Show<'_> {
    /// Covers the picture, presents and submits.
    fn end(&mut self, mut frame: Frame<'_>, color: &Target) -> Result<Ticket, Error> {
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

impl Renderer {
    /// Width and height of its pictures, pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.targets.color.width, self.targets.color.height]
    }

    /// How many frames can be on their way at once.
    pub fn in_flight(&self) -> usize {
        self.frames.in_flight()
    }

    /// Waits until the next frame can be recorded and tells its slot of the ring, for
    /// [`Surface::acquire`](crate::gpu::surface::Surface::acquire).
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
            self.targets = Targets::new(
                &self.gpu,
                width,
                height,
                (self.targets.color.format, self.outputs.normal),
            )?;
            self.readback = None;
            self.small = None;
            (self.filtered, self.spare_filtered) = (None, Vec::new());
            self.visibility = None;
            (self.fuzzy, self.spare_fuzzy) = (None, Vec::new());
            (self.overdraw, self.counted) = (None, None);
        }
        Ok(())
    }

    /// Counts what a frame of these settings would draw, without drawing it: its cut is chosen, and used by the next
    /// frame if that has the same view and settings. The time is booked as that frame's. Nothing without a cut.
    pub fn predict(
        &mut self,
        model: &Model,
        scene: &Scene,
        view: &View,
        settings: &Settings,
    ) -> FrameEstimate {
        if !settings.has_cut() {
            return FrameEstimate::default();
        }
        let start = Instant::now();
        let settings = &resolve_settings(settings, model, view);
        let choice = CutKey::of(settings, model, view);
        let is_new = self.select(model, scene, (scene.id(), choice));
        let counts = counts_of_cut(settings, model, view, &self.cut);
        let ahead = self.ahead.get_or_insert_default();
        ahead.ms += crate::render::vulkan::renderer::ms(start);
        ahead.is_new |= is_new;
        let by_compute = self.wants_compute(settings).unwrap_or(false);
        let rect = crate::render::screen_bounds::rect_px(model, view, settings.threshold_px + 3.0);
        let triangles = counts.triangles as usize;
        let asked = Asked {
            settings,
            costs: self.costs,
            splats: (counts.splats + self.cut.stats.hidden) as usize,
            size_px: choose::size_px(settings, (model, view), &self.cut),
            triangles,
            rect_px: rect,
            size: (self.targets.color.width, self.targets.color.height),
        };
        let has_large = settings.method == Method::Splats || !model.kind().is_surface();
        let is_blended = matches!(
            Technique::of(settings),
            Technique::Fuzzy | Technique::Filtered
        );
        let pays = match Technique::of(settings) {
            Technique::Opaque => asked.opaque().splats == Path::Compute,
            Technique::Visibility => asked.visible() == Path::Compute,
            // As the frame will be: with the triangles, where compute takes those.
            _ if triangles > 0
                && compute::Small::takes_triangles(&self.gpu, scene)
                && asked.all_blended(has_large) != ComputeShare::Nothing =>
            {
                true
            }
            _ => asked.blended(triangles, has_large) != ComputeShare::Nothing,
        };
        FrameEstimate {
            counts,
            pixels: crate::render::screen_bounds::pixels(rect),
            is_blended,
            by_compute: by_compute && pays,
            is_free: by_compute && settings.path == Path::Auto,
            largest_by_compute_px: crate::render::compute_limits::largest_threshold_px(settings),
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
    /// As [`Renderer::draw`]; an acquired image must be abandoned then.
    pub fn submit_shown(
        &mut self,
        model: &Model,
        scene: &mut Scene,
        view: &View,
        settings: &Settings,
        mut shown: Show<'_>,
    ) -> Result<Submitted, Error> {
        self.prepare_overlay(&mut shown)?;
        self.submit(model, scene, view, settings, &mut |frame, color| {
            shown.end(frame, color)
        })
    }

    /// Submits a frame that shows the picture of the last frame again, under a new overlay.
    ///
    /// # Errors
    /// When memory runs out or the device is lost; an acquired image must be abandoned then.
    pub fn submit_again(&mut self, mut shown: Show<'_>) -> Result<Submitted, Error> {
        let start = Instant::now();
        self.prepare_overlay(&mut shown)?;
        let frame = self.frames.begin()?;
        let ticket = shown.end(frame, &self.targets.color)?;
        Ok(Submitted::without_cut(ticket, FrameTimes::default(), start))
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
        mut shown: Show<'_>,
    ) -> Result<Submitted, Error> {
        let submit = Stage::Submit.begin();
        self.prepare_overlay(&mut shown)?;
        let frame = self.frames.begin()?;
        let ticket = shown.end(frame, picture)?;
        submit.end(&mut times);
        Ok(Submitted::without_cut(ticket, times, start))
    }

    /// Waits until a frame no longer reads what it shows.
    ///
    /// # Errors
    /// When the device is lost.
    pub(crate) fn wait_for(&self, submitted: Ticket) -> Result<(), Error> {
        self.frames.wait_for(submitted)
    }

    /// Waits for the slot of the next frame and readies its overlay, if it has one.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    fn prepare_overlay(&mut self, shown: &mut Show<'_>) -> Result<(), Error> {
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
        mut shown: Show<'_>,
    ) -> Result<Submitted, Error> {
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
            light: Lighting::Headlight,
            depth_range: [0.0, 1.0],
        };
        let mut frame = self.frames.begin()?;
        self.targets
            .attach(frame.pass("background"), &context)
            .draw(context.viewport(), |_| {});
        let ticket = shown.end(frame, &self.targets.color)?;
        Ok(Submitted::without_cut(ticket, FrameTimes::default(), start))
    }

    /// Reads what the last frame showed, overlay and all; `picture` is what lay under it, where that was drawn elsewhere.
    /// Waits for the device; not for every frame.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn read_shown(
        &mut self,
        overlay: Option<&Overlay>,
        picture: Option<&Target>,
    ) -> Result<Image, Error> {
        let shown = overlay.and_then(Overlay::shown).or(picture);
        let shown = shown.unwrap_or(&self.targets.color);
        let mut pixels = Readback::new(&self.gpu, "readback of the window", shown.bytes())?;
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
            None => Readback::new(
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
