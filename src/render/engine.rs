//! One way to draw a model for everything that does not care how: on a Vulkan device, or by the mirrors on
//! the CPU where there is none.

use crate::abi::{FilteredSplat, Splat, WeightedSplat};
use crate::cut::{Cut, Selector, Undrawn};
use crate::gpu::frame::Measure;
use crate::gpu::{Error, Gpu, Options};
use crate::image::{Accumulator, FloatImage, Image, jittered};
use crate::math::camera::View;
use crate::pack;
use crate::pack::{ColorBy, DrawList, FilteredList, FuzzyList, Style, triangles};
use crate::render::cost::model::Costs;
use crate::render::frame_plan::{
    Choice, Drawing, check, filtered_shade, for_view, largest_splat_px, splat_plan,
};
use crate::render::reference::{Drawn, count_overdraw};
use crate::render::stats::Stage;
use crate::render::vulkan::overdraw::Overdraw;
use crate::render::vulkan::renderer::{Counts, FrameTimes, Outputs, Renderer};
use crate::render::vulkan::scene::Scene;
use crate::render::{Blend, Method, Settings, Shading, SplatKind, reference};
use crate::tree::Model;
use bytemuck::Zeroable;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// Where pictures are made.
#[derive(Debug, Clone)]
pub enum Backend {
    /// A Vulkan device.
    Device(Arc<Gpu>),
    /// The mirrors, on the CPU. Exact and slow; needs no driver.
    Mirror,
}

impl Backend {
    /// The name that stands for the mirror where a device is asked for.
    pub const MIRROR: &'static str = "mirror";

    /// Opens what `options.device` names: `mirror`, a device's index or a part of its name, or the best device.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn open(options: &Options) -> Result<Self, Error> {
        if options.device.as_deref() == Some(Self::MIRROR) {
            Ok(Self::Mirror)
        } else {
            Ok(Self::Device(Gpu::open(options)?))
        }
    }

    /// Name of the device.
    pub fn name(&self) -> &str {
        match self {
            Self::Device(gpu) => &gpu.info().name,
            Self::Mirror => Self::MIRROR,
        }
    }
}

/// Draws one model in one picture size.
#[derive(Debug)]
pub struct Engine<'m> {
    model: &'m Model,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Device {
        renderer: Box<Renderer>,
        /// Draws what is averaged, once anything was.
        samples: Option<Box<Renderer>>,
        scene: Scene,
    },
    Mirror(Box<MirrorEngine>),
}

#[derive(Debug, Default)]
struct MirrorEngine {
    outputs: Outputs,
    selector: Selector,
    cut: Cut,
    /// Of the engine's model.
    undrawn: OnceLock<Undrawn>,
    image: Image,
    /// Of the last frame, where overdraw was counted.
    counts: Option<Vec<u32>>,
}

impl<'m> Engine<'m> {
    /// Readies a model for pictures of `width` x `height` pixels.
    ///
    /// # Errors
    /// When the device has not enough memory or a side is above its limit.
    pub fn new(
        backend: &Backend,
        model: &'m Model,
        (width, height): (u32, u32),
        outputs: Outputs,
    ) -> Result<Self, Error> {
        let kind = match backend {
            Backend::Device(gpu) => Kind::Device {
                renderer: Box::new(Renderer::new(gpu, width, height, outputs, true)?),
                samples: None,
                scene: Scene::new(gpu, model)?,
            },
            Backend::Mirror => Kind::Mirror(Box::new(MirrorEngine {
                outputs,
                selector: Selector::default().with_subpixel_bits(reference::SUBPIXEL_BITS),
                ..MirrorEngine::default()
            })),
        };
        Ok(Self { model, kind })
    }

    /// Draws a frame and waits until it is finished.
    ///
    /// # Errors
    /// As [`Renderer::draw`].
    pub fn draw(&mut self, view: &View, settings: &Settings) -> Result<FrameTimes, Error> {
        match &mut self.kind {
            Kind::Device {
                renderer, scene, ..
            } => renderer.draw(self.model, scene, view, settings),
            Kind::Mirror(mirror) => {
                check(self.model, settings, mirror.outputs, f32::INFINITY)?;
                let settings = for_view(settings, self.model, view);
                Ok(mirror.draw(self.model, view, &settings))
            }
        }
    }

    /// As [`Renderer::keep_lists`]; off at first. The mirror never does.
    pub fn keep_lists(&mut self, keep: bool) {
        if let Kind::Device { renderer, .. } = &mut self.kind {
            renderer.keep_lists(keep);
        }
    }

    /// As [`Renderer::let_host_draw`]. The mirror is the host.
    pub fn let_host_draw(&mut self, may: bool) {
        if let Kind::Device { renderer, .. } = &mut self.kind {
            renderer.let_host_draw(may);
        }
    }

    /// What drawing costs on the device: [`Renderer::set_costs`]. The mirror has one way to draw.
    pub fn set_costs(&mut self, costs: Option<Costs>) {
        if let Kind::Device { renderer, .. } = &mut self.kind {
            renderer.set_costs(costs);
        }
    }

    /// What the frames from now on report: [`Renderer::measure`]. The mirror has stages and counts only.
    ///
    /// # Errors
    /// As [`Renderer::measure`].
    pub fn measure(&mut self, measure: Measure) -> Result<(), Error> {
        match &mut self.kind {
            Kind::Device { renderer, .. } => renderer.measure(measure),
            Kind::Mirror(_) => Ok(()),
        }
    }

    /// The picture of the last frame.
    ///
    /// # Errors
    /// As [`Renderer::read`].
    pub fn read(&mut self, view: &View) -> Result<Image, Error> {
        match &mut self.kind {
            Kind::Device { renderer, .. } => renderer.read(view),
            Kind::Mirror(mirror) => Ok(mirror.image.clone()),
        }
    }

    /// As [`Renderer::overdraw`].
    pub fn overdraw(&mut self) -> Option<Vec<u32>> {
        match &mut self.kind {
            Kind::Device { renderer, .. } => renderer.overdraw(),
            Kind::Mirror(mirror) => mirror.counts.clone(),
        }
    }

    /// Draws and reads one picture.
    ///
    /// # Errors
    /// As [`Engine::draw`] and [`Engine::read`].
    pub fn render(&mut self, view: &View, settings: &Settings) -> Result<Image, Error> {
        self.draw(view, settings)?;
        self.read(view)
    }

    /// Draws and reads one picture to be averaged with others: with [`Image::values`], so that only the mean is rounded,
    /// and without depth and normals. (Visibility splats are put together from pixels of eight bits, and have none.) On a
    /// device it goes to targets of its own, which stay.
    ///
    /// # Errors
    /// As [`Engine::draw`] and [`Engine::read`].
    pub fn sample(&mut self, view: &View, settings: &Settings) -> Result<Image, Error> {
        if settings.draws_visibility() {
            return self.render(view, settings);
        }
        match &mut self.kind {
            Kind::Device {
                renderer,
                samples,
                scene,
            } => {
                let samples = match samples {
                    Some(made) => made,
                    none => none.insert(Box::new(renderer.of_values()?)),
                };
                if samples.costs() != renderer.costs() {
                    samples.set_costs(renderer.costs());
                }
                samples.draw(self.model, scene, view, settings)?;
                samples.read(view)
            }
            Kind::Mirror(mirror) => {
                let values = Outputs {
                    values: true,
                    ..Outputs::default()
                };
                let outputs = std::mem::replace(&mut mirror.outputs, values);
                let image = self.render(view, settings);
                if let Kind::Mirror(mirror) = &mut self.kind {
                    mirror.outputs = outputs;
                }
                image
            }
        }
    }

    /// The box-filtered mean of `k` x `k` pictures, each shifted by a part of a pixel: `k * k` regular samples a
    /// pixel, each as [`Engine::sample`] draws it; of one it is the picture that [`Engine::render`] draws. Color and
    /// coverage only: a mean of depths or normals is neither.
    ///
    /// # Errors
    /// As [`Engine::render`].
    pub fn supersample(
        &mut self,
        view: &View,
        settings: &Settings,
        k: u32,
    ) -> Result<FloatImage, Error> {
        let mut mean = Accumulator::new();
        for i in 0..k * k {
            let view = jittered(view, i, k);
            let image = if k > 1 {
                self.sample(&view, settings)?
            } else {
                self.render(&view, settings)?
            };
            // Every picture has the size of the view, which is all that can go wrong.
            if let Err(error) = mean.add(&image) {
                unreachable!("pictures of one view: {error}");
            }
        }
        Ok(mean.mean())
    }
}

impl MirrorEngine {
    fn draw(&mut self, model: &Model, view: &View, settings: &Settings) -> FrameTimes {
        let start = Instant::now();
        let mut times = FrameTimes::default();
        times.starts.frame = Some(start);
        let style = Style {
            depth_range: pack::falsecolor::depth_range(model, view),
            ..style(settings, model)
        };
        let used = &model.vertices[..model.used_vertices as usize];
        let mut splats = Vec::new();
        let mut filtered = Vec::new();
        let mut weighted = Vec::new();
        let mut triangles = Vec::new();
        let mut list = DrawList {
            vertices: used,
            ..DrawList::default()
        };
        match settings.method {
            Method::Triangles => list.triangles = &model.triangles,
            Method::Points => list.points = used,
            Method::Splats | Method::Pop => {
                let cut = Stage::Cut.begin();
                let undrawn = || self.undrawn.get_or_init(|| Undrawn::new(model));
                let (selector, chosen) = (&mut self.selector, &mut self.cut);
                Choice::of(settings, model, view).select(selector, model, undrawn, chosen);
                cut.end(&mut times);
                let packing = Stage::Pack.begin();
                let is_whole = settings.method == Method::Splats;
                let cut = &mut self.cut;
                match Drawing::of(settings) {
                    Drawing::Opaque | Drawing::Visibility => {
                        let plan = splat_plan(settings, f32::INFINITY);
                        splats.resize(pack::splats::count(cut, &plan), Splat::zeroed());
                        let packed = pack::splats::pack(model, cut, view, &plan, &mut splats);
                        splats.truncate(packed.points);
                    }
                    Drawing::Fuzzy => {
                        let plan = splat_plan(settings, f32::INFINITY);
                        let count = pack::splats::count(cut, &plan);
                        weighted.resize(count, WeightedSplat::zeroed());
                        let packed = pack::splats::pack(model, cut, view, &plan, &mut weighted);
                        weighted.truncate(packed.points);
                    }
                    Drawing::Filtered => {
                        let shade = filtered_shade(settings, model, f32::INFINITY);
                        let large = pack::filtered::take_triangles(model, view, &shade, cut);
                        let most = pack::filtered::splat_count(cut, large);
                        filtered.resize(most, FilteredSplat::zeroed());
                        let out = &mut filtered;
                        let count = pack::filtered::splats(model, cut, large, view, shade, out);
                        filtered.truncate(count);
                    }
                    Drawing::Nothing => {}
                }
                let ids: &[u32] = if is_whole { &[] } else { &cut.triangles };
                triangles.resize(ids.len(), [0; 3]);
                triangles::triangles(ids, |id| model.triangles[id as usize], &mut triangles);
                packing.end(&mut times);
                list.splats = &splats;
                list.triangles = &triangles;
            }
        }
        times.counts = Counts {
            nodes_visited: if settings.has_cut() {
                self.cut.stats.visited
            } else {
                0
            },
            hidden: if settings.has_cut() {
                self.cut.stats.hidden
            } else {
                0
            },
            between: if settings.has_cut() {
                self.cut.stats.between
            } else {
                0
            },
            splats: (list.splats.len() + filtered.len() + weighted.len()) as u64,
            triangles: list.triangles.len() as u64,
            points: list.points.len() as u64,
            draw_list_bytes: (size_of_val(list.splats)
                + size_of_val(filtered.as_slice())
                + size_of_val(weighted.as_slice())
                + size_of_val(triangles.as_slice())) as u64,
        };
        let is_counted = settings.color_by == ColorBy::Overdraw;
        let count = |drawn: Drawn<'_>| is_counted.then(|| count_overdraw(view, drawn, &style));
        self.image = if settings.draws_filtered() {
            let list = FilteredList {
                vertices: list.vertices,
                triangles: list.triangles,
                splats: &filtered,
            };
            self.counts = count(Drawn::Filtered(&list));
            reference::render_filtered(view, &list, &style, self.outputs).image
        } else if settings.draws_visibility() {
            let how = reference::Filling {
                reconstruction: settings.reconstruction,
                largest_px: largest_splat_px(model, settings),
            };
            self.counts = count(Drawn::Opaque(&list));
            reference::render_visibility(view, &list, &style, how, self.outputs).image
        } else if Drawing::of(settings) == Drawing::Fuzzy {
            let list = FuzzyList {
                vertices: list.vertices,
                triangles: list.triangles,
                splats: &weighted,
                points: list.points,
                has_coverage: settings.sums_coverage(!model.triangles.is_empty()),
            };
            let passes = match settings.blend() {
                Blend::DepthThreshold => reference::Passes::DepthThreshold,
                Blend::DepthRange => reference::Passes::DepthRange,
                Blend::TwoPass | Blend::Opaque => reference::Passes::Two,
            };
            self.counts = count(Drawn::Fuzzy(&list));
            reference::render_fuzzy(view, &list, &style, passes, self.outputs).image
        } else {
            self.counts = count(Drawn::Opaque(&list));
            reference::render(view, &list, &style, self.outputs)
        };
        if let Some(counts) = &self.counts {
            times.overdraw = Some(Overdraw::of(counts.iter().copied()));
            self.image.color = reference::show_overdraw(counts, &style);
        }
        times.frame_ms = start.elapsed().as_secs_f64() * 1e3;
        times
    }
}

/// How primitives look under `settings`, but for [`Style::depth_range`].
pub fn style(settings: &Settings, model: &Model) -> Style {
    Style {
        splat_size_px: settings.threshold_px.max(1.0),
        footprint: settings.footprint(),
        is_gauss: settings.splat == SplatKind::Gauss,
        low_pass_px: settings.low_pass_px(),
        is_deferred: settings.shading == Shading::Deferred,
        background: settings.background,
        color_by: settings.color_by,
        // Of the frame, whose camera is not known here.
        depth_range: Style::default().depth_range,
        cull_back_faces: settings.draws_fronts_only(model.is_closed),
        light: settings.light.in_model(model.origin),
        two_sided: settings.two_sided,
        use_colors: settings.use_colors,
        depth_offset: settings.depth_offset(),
    }
}
