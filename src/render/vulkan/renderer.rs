//! Draws frames of one size: targets, draw lists in mapped memory, passes, read-back.
//!
//! A frame goes: cut (CPU) -> pack into the mapped buffers of a free slot -> passes -> wait. Reading the
//! picture back is a submission of its own, so that its cost is not part of the frame's.

mod cut_frame;
mod device_cut_frame;
#[cfg(feature = "viewer")]
pub mod present;
mod readback;
mod whole_model_frame;

use crate::cut::{self, Cut};
use crate::gpu::buffer::Readback;
use crate::gpu::frame::{Frame, Frames, Measure, Ticket};
use crate::gpu::image::Image as Target;
use crate::gpu::pipeline::Pipeline;
use crate::gpu::{Error, Gpu};
use crate::math::camera::View;
use crate::pack;
use crate::pack::ColorBy;
pub use crate::render::PictureOutputs;
use crate::render::cost::choose::Asked;
use crate::render::cost::model::Costs;
use crate::render::cut_key::CutKey;
use crate::render::frame_constants::frame_flags;
pub(crate) use crate::render::frame_constants::margin_px;
use crate::render::frame_estimate::CutAhead;
use crate::render::frame_plan::resolve_settings;
use crate::render::pack_params::splat_plan;
pub use crate::render::stats::FrameTimes;
use crate::render::stats::OverdrawSummary;
use crate::render::stats::{FrameCounts, Kept, Stage};
use crate::render::supported::check;
use crate::render::technique::Technique;
use crate::render::vulkan::blended::filtered;
use crate::render::vulkan::blended::filtered::Filtered;
use crate::render::vulkan::blended::fuzzy;
use crate::render::vulkan::blended::fuzzy::Fuzzy;
use crate::render::vulkan::device_cut::DeviceCut;
use crate::render::vulkan::device_tree::DeviceTree;
use crate::render::vulkan::draw_lists::Lists;
use crate::render::vulkan::expand_ids::ById;
use crate::render::vulkan::opaque::compute;
use crate::render::vulkan::opaque::compute::Small;
use crate::render::vulkan::opaque::hardware::{Source, Splats};
use crate::render::vulkan::overdraw;
use crate::render::vulkan::scene::Scene;
use crate::render::vulkan::targets::{Context, Targets};
use crate::render::vulkan::triangles;
use crate::render::vulkan::triangles::Variant;
use crate::render::vulkan::visibility::hardware::Visibility;
use crate::render::vulkan::{COLOR, SAMPLES};
use crate::render::{Method, Settings};
use crate::tree::Model;
use std::sync::Arc;
use std::time::Instant;

/// A frame on its way through the device.
#[derive(Debug)]
#[must_use = "a frame is finished only once it was waited for"]
pub struct Submitted {
    ticket: Ticket,
    times: FrameTimes,
    start: Instant,
    /// The device chose its cut and knows its counts.
    on_device: bool,
    /// Slot of the ring in which overdraw was counted.
    counted: Option<usize>,
}

impl Submitted {
    /// A frame that shows what was there before, from `start` on.
    #[cfg(feature = "viewer")]
    fn without_cut(ticket: Ticket, times: FrameTimes, start: Instant) -> Self {
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
    pub(crate) fn ticket(&self) -> Ticket {
        self.ticket
    }
}

/// Ends a frame: submits it, after passes of its own that may read the color target.
type End<'e> = dyn FnMut(Frame<'_>, &Target) -> Result<Ticket, Error> + 'e;

/// Draws frames of one size on one device.
#[derive(Debug)]
pub struct Renderer {
    gpu: Arc<Gpu>,
    frames: Frames,
    targets: Targets,
    outputs: PictureOutputs,
    lists: Vec<Lists>,
    cut: Cut,
    selector: cut::Selector,
    costs: Option<Costs>,
    device_tree: Option<DeviceTree>,
    /// What makes records of numbers, once lists have held some.
    by_id: Option<ById>,
    device_cut: Option<DeviceCut>,
    /// What its lists are of.
    held_on_device: Option<(u64, CutKey)>,
    /// The scene whose cuts do not fit the device, and the one whose tree does not.
    too_large: [Option<u64>; 2],
    triangles: Option<(Variant, Pipeline)>,
    spare_triangles: Vec<(Variant, Pipeline)>,
    /// One for each variant that was drawn, those drawn last.
    splats: Vec<Splats>,
    small: Option<Small>,
    filtered: Option<Filtered>,
    spare_filtered: Vec<Filtered>,
    visibility: Option<Visibility>,
    fuzzy: Option<Fuzzy>,
    spare_fuzzy: Vec<Fuzzy>,
    /// Once overdraw was counted.
    overdraw: Option<overdraw::Counter>,
    /// Slot of the frame that was last waited for, where it was counted there.
    counted: Option<usize>,
    readback: Option<[Option<Readback>; 3]>,
    /// Depth around one pixel, read for the viewer.
    #[cfg(feature = "viewer")]
    probe: Option<Readback>,
    keeps_lists: bool,
    /// What the present cut was chosen for, and in which scene; none where packing changed it.
    chosen: Option<(u64, CutKey)>,
    /// Nodes and leaves that all cuts looked at.
    visited: u64,
    /// The cut that was chosen for the next frame before it is drawn; none: not yet.
    ahead: Option<CutAhead>,
}

fn ms(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

impl Renderer {
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
        let frames = Frames::new(gpu, 2, timestamps)?;
        let lists = (0..frames.in_flight())
            .map(|slot| Lists::new(gpu, slot))
            .collect::<Result<_, Error>>()?;
        let color = if outputs.values { SAMPLES } else { COLOR };
        Ok(Self {
            gpu: gpu.clone(),
            frames,
            targets: Targets::new(gpu, width, height, (color, outputs.normal))?,
            outputs,
            lists,
            cut: Cut::default(),
            selector: cut::Selector::default().with_subpixel_bits(gpu.info().subpixel_bits),
            costs: None,
            device_tree: None,
            by_id: None,
            device_cut: None,
            held_on_device: None,
            too_large: [None; 2],
            triangles: None,
            spare_triangles: Vec::new(),
            splats: Vec::new(),
            small: None,
            filtered: None,
            spare_filtered: Vec::new(),
            visibility: None,
            fuzzy: None,
            spare_fuzzy: Vec::new(),
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
    /// As [`Renderer::new`].
    pub(crate) fn of_values(&self) -> Result<Self, Error> {
        let outputs = PictureOutputs {
            values: true,
            ..PictureOutputs::default()
        };
        let color = &self.targets.color;
        Self::new(&self.gpu, color.width, color.height, outputs, false)
    }

    /// What the frames from now on report; pass times at first, if the renderer was made with them.
    ///
    /// # Errors
    /// When the device cannot make the queries.
    pub fn measure(&mut self, measure: Measure) -> Result<(), Error> {
        self.frames.measure(measure)
    }

    /// Whether a frame takes over what is there of one before it where that is the same: the draw lists of the last frame
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
    pub fn set_costs(&mut self, costs: Option<Costs>) {
        if self.costs != costs {
            // What was packed by others may be of other primitives.
            self.lists.iter_mut().for_each(|lists| lists.held = None);
            self.costs = costs;
        }
    }

    /// The costs that decide.
    pub fn costs(&self) -> Option<Costs> {
        self.costs
    }

    /// What the cut asks for in a picture.
    fn asked<'a>(&self, settings: &'a Settings, context: &Context) -> Asked<'a> {
        let cut = &self.cut;
        // Which plan does not matter to how many there are but for large leaves.
        let splats = pack::splats::count(cut, &splat_plan(settings, f32::INFINITY));
        let is_whole = settings.method == Method::Splats;
        Asked {
            settings,
            costs: self.costs,
            splats: splats + cut.stats.hidden as usize,
            size_px: settings.threshold_px.max(1.0),
            triangles: if is_whole { 0 } else { cut.triangles.len() },
            rect_px: context.rect_px,
            size: (context.width, context.height),
        }
    }

    /// The largest point that its device draws, pixels.
    pub(crate) fn max_point_px(&self) -> f32 {
        self.gpu.info().max_point_size_px
    }

    /// The cut that was chosen last.
    pub fn cut(&self) -> &Cut {
        &self.cut
    }

    fn context(&self, view: &View, settings: &Settings, model: &Model, largest_px: f32) -> Context {
        let guard_px = match largest_px > 0.0 {
            true => (largest_px / 2.0).ceil() as u32 + 1,
            false => 0,
        };
        Context::new(model, view, settings, largest_px, guard_px)
    }

    /// Draws one frame and waits until it is finished on the device.
    ///
    /// # Errors
    /// When the view's size is not the renderer's, points are larger than the device draws, memory runs out
    /// or the device is lost.
    pub fn draw(
        &mut self,
        model: &Model,
        scene: &mut Scene,
        view: &View,
        settings: &Settings,
    ) -> Result<FrameTimes, Error> {
        let submitted =
            self.submit(model, scene, view, settings, &mut |frame, _| frame.submit())?;
        self.finish(submitted)
    }

    /// Waits until a frame is finished on the device and tells what it cost.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn finish(&mut self, submitted: Submitted) -> Result<FrameTimes, Error> {
        let Submitted {
            ticket,
            mut times,
            start,
            on_device,
            counted,
        } = submitted;
        let wait = Stage::Wait.begin();
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
                splats: u64::from(counts.splats[0]),
                triangles: u64::from(counts.triangles[0] / 3),
                ..FrameCounts::default()
            };
            if times.kept != Kept::Lists {
                self.visited += times.counts.nodes_visited;
            }
        }
        times.uploaded_bytes = finished.uniform_bytes;
        if times.kept != Kept::Lists {
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
        model: &Model,
        scene: &mut Scene,
        view: &View,
        settings: &Settings,
        end: &mut End<'_>,
    ) -> Result<Submitted, Error> {
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
        let max_point = self.gpu.info().max_point_size_px;
        check(model, settings, self.outputs, max_point)?;
        let settings = &resolve_settings(settings, model, view);
        self.prepare((model, scene), view, settings)?;
        let on_device = self.prepare_cut(model, scene, settings)?;
        let by_id = !on_device && self.prepare_lists(model, scene, settings)?;
        let start = Instant::now();
        let is_counted = settings.color_by == ColorBy::Overdraw;
        let counted = is_counted.then(|| self.frames.next_slot());
        let (ticket, times) = match settings.method {
            Method::Triangles => self.draw_triangles(model, scene, view, settings, end)?,
            Method::Points => self.draw_points(model, scene, view, settings, end)?,
            Method::Pop if on_device => self.draw_on_device(model, scene, view, settings, end)?,
            Method::Splats | Method::Pop => {
                self.draw_pop((model, scene), view, (settings, by_id), end)?
            }
        };
        Ok(Submitted {
            ticket,
            times,
            start,
            on_device,
            counted,
        })
    }

    /// Makes the pipelines and buffers that `settings` need, outside of the frame.
    fn prepare(
        &mut self,
        (model, scene): (&Model, &mut Scene),
        view: &View,
        settings: &Settings,
    ) -> Result<(), Error> {
        let normals = self.outputs.normal;
        let lamp = !settings.has_headlight();
        let flags = frame_flags(view, settings, settings.draws_fronts_only(model.is_closed));
        if settings.method == Method::Triangles {
            scene.ensure_indices(model)?;
        }
        if settings.method != Method::Points {
            let variant = Variant {
                color: self.targets.color.format,
                normals,
                colors: scene.facts().has_colors(),
                lamp,
                flags,
            };
            let spare = &mut self.spare_triangles;
            exchange(&mut self.triangles, spare, |t| t.0 == variant);
            if self.triangles.as_ref().is_none_or(|t| t.0 != variant) {
                self.triangles = Some((variant, triangles::pipeline(&self.gpu, variant)?));
            }
        }
        let by_compute = self.wants_compute(settings)?;
        let is_opaque = Technique::of(settings) == Technique::Opaque;
        let is_gray = settings.color_by == ColorBy::Shading
            && !(settings.use_colors && scene.facts().has_colors());
        if by_compute && is_opaque {
            let small = match &mut self.small {
                Some(made) => made,
                none => none.insert(Small::new(&self.gpu, &self.targets)?),
            };
            small.ensure(cut_frame::compute_variant(settings, model, flags))?;
            small.ensure(compute::Variant::SAMPLES)?;
        }
        let asks = || CutKey::of(settings, model, view).needs_undrawn();
        if settings.has_cut() && asks() {
            // Looks at the whole model, once.
            scene.undrawn(model);
        }
        let source = if settings.method == Method::Points {
            Source::Vertices
        } else {
            Source::List
        };
        match Technique::of(settings) {
            Technique::Nothing => {}
            Technique::Visibility => {
                let (width, height) = (self.targets.color.width, self.targets.color.height);
                let visibility = match &mut self.visibility {
                    Some(made) => made,
                    none => none.insert(Visibility::new(&self.gpu, width, height, normals)?),
                };
                let how = (flags, by_compute);
                visibility.ensure(source, settings.reconstruction, how)?;
            }
            Technique::Opaque => {
                let variant = Splats::variant_of(settings, flags);
                if self.splats.iter().all(|s| s.variant != variant) {
                    if self.splats.len() == MOST_SPLATS {
                        self.splats.remove(0);
                    }
                    self.splats
                        .push(Splats::new(&self.gpu, variant, &self.targets)?);
                }
            }
            Technique::Fuzzy => {
                let has_triangles = model.kind().is_surface();
                let variant = fuzzy::Variant::new(
                    &self.gpu,
                    settings,
                    has_triangles,
                    &self.targets,
                    (flags, by_compute.then_some(is_gray)),
                )?;
                exchange(&mut self.fuzzy, &mut self.spare_fuzzy, |f| {
                    f.variant == variant
                });
                if self.fuzzy.as_ref().is_none_or(|f| f.variant != variant) {
                    let (width, height) = (self.targets.color.width, self.targets.color.height);
                    self.fuzzy = Some(Fuzzy::new(&self.gpu, variant, width, height)?);
                }
            }
            Technique::Filtered => {
                let variant = filtered::Variant {
                    has_lamp: lamp,
                    color: self.targets.color.format,
                    by_compute: by_compute.then_some(is_gray),
                };
                let spare = &mut self.spare_filtered;
                exchange(&mut self.filtered, spare, |f| f.variant == variant);
                if self.filtered.as_ref().is_none_or(|f| f.variant != variant) {
                    let size = (self.targets.color.width, self.targets.color.height);
                    self.filtered = Some(Filtered::new(&self.gpu, size, variant)?);
                }
            }
        }
        if settings.color_by == ColorBy::Overdraw {
            let size = (self.targets.color.width, self.targets.color.height);
            let counter = match &mut self.overdraw {
                Some(made) => made,
                none => none.insert(overdraw::Counter::new(
                    &self.gpu,
                    size,
                    self.frames.in_flight(),
                )?),
            };
            let fuzzy = self.fuzzy.as_ref().map(|fuzzy| fuzzy.variant);
            counter.ensure(settings, &self.targets, (flags, fuzzy))?;
        }
        Ok(())
    }
}

/// Variants of opaque splats that are kept; pipelines alone take little.
const MOST_SPLATS: usize = 16;

/// Variants that are kept besides the present one.
const MOST_SPARE: usize = 2;

/// Puts the one that `is_it` into `place`, if it is there or among the spare ones, and else none; what was there is spare
/// then. Variants that are drawn in turn, as charts do, are so made once.
fn exchange<T>(place: &mut Option<T>, spare: &mut Vec<T>, is_it: impl Fn(&T) -> bool) {
    if place.as_ref().is_some_and(&is_it) {
        return;
    }
    let found = spare.iter().position(is_it).map(|i| spare.remove(i));
    spare.extend(std::mem::replace(place, found));
    if spare.len() > MOST_SPARE {
        // The one that was last drawn longest ago.
        spare.remove(0);
    }
}
