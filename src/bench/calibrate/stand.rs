//! What the calibration draws, and the lines that it puts through the times.

use super::{BenchError, split};
use crate::chart::run::orbit;
use crate::cut::{Cut, CutSelector};
use crate::generate::{self, GeneratedShape, ShapeSpec};
use crate::gpu::Gpu;
use crate::gpu::device::DeviceKind;
use crate::math::camera::View;
use crate::mesh::Mesh;
use crate::progress::SilentProgress;
use crate::render::PictureOutputs;
use crate::render::cost::model::{
    DrawCosts, MergeCosts, PRIMITIVE_SIZES_PX, PassCosts, PerRasterizer, PrimitiveCosts, SIZES_PX,
    SplatCosts, TriangleCosts, pixels_of,
};
use crate::render::cut_key::cut_settings;
use crate::render::vulkan::renderer::VulkanRenderer;
use crate::render::vulkan::scene::DeviceScene;
use crate::render::{Culling, CutOn, Method, Occlusion, Path, Settings, SplatKind};
use crate::tree::{self, BuildOptions, Model};
use glam::Vec3;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Frames of which the least counts; one more goes before, in which shaders are compiled.
const FRAMES: usize = 2;
/// At this fill no triangle of the statue is larger than a pixel, whatever the picture's size: their number goes with its
/// area. At three times this fill they are about as large, at seven times two to three pixels.
const FILL_OF_ONE: f64 = 0.14;
/// The largest fill at which points and quads are compared.
const LARGEST_FILL: f64 = 1.0;
/// At this fill the box around a model is next to nothing.
const FILL_OF_NOTHING: f64 = 0.01;

/// A model on the device.
struct StandStage {
    model: Model,
    scene: DeviceScene,
}

impl StandStage {
    fn new(gpu: &Arc<Gpu>, mesh: Mesh) -> Result<Self, BenchError> {
        let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress)?;
        let scene = DeviceScene::new(gpu, &model)?;
        Ok(Self { model, scene })
    }
}

/// One view drawn in one way.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct DrawnView {
    /// Nanoseconds of the passes over primitives: those over splats, or those over triangles; on a graphics card with the
    /// packing of their list.
    pub(super) primitives_ns: f64,
    /// Nanoseconds of the passes over the picture.
    pub(super) pixels_ns: f64,
    /// Primitives.
    pub(super) count: f64,
    pub(super) covered: f64,
    /// Pixels of the model's box.
    pub(super) of_box: f64,
}

impl DrawnView {
    fn all_ns(&self) -> f64 {
        self.primitives_ns + self.pixels_ns
    }
}

/// Next to nothing, drawn with a small box and with a large one.
#[derive(Debug, Clone, Copy)]
pub(super) struct EmptyFrames {
    pub(super) far: DrawnView,
    pub(super) wide: DrawnView,
}

impl EmptyFrames {
    /// What of `ns` grows with the box, for each of its pixels.
    fn box_ns(&self, ns: impl Fn(&DrawnView) -> f64) -> f64 {
        let more = ns(&self.wide) - ns(&self.far);
        (more / (self.wide.of_box - self.far.of_box).max(1.0)).max(0.0)
    }

    /// What `ns` of a view would be without primitives.
    fn of(&self, drawn: &DrawnView, ns: impl Fn(&DrawnView) -> f64) -> f64 {
        ns(&self.far) + self.box_ns(&ns) * drawn.of_box
    }

    /// The costs of pixels, in pictures of so many, and of a primitive of each view.
    pub(super) fn costs(&self, views: &[DrawnView], pixels: f64) -> (PassCosts, Vec<f64>) {
        let mut over = 0.0;
        let mut covered = 0.0;
        let mut primitives = Vec::new();
        for view in views {
            over += view.pixels_ns - self.of(view, |d| d.pixels_ns);
            covered += view.covered;
            let own = view.primitives_ns - self.of(view, |d| d.primitives_ns);
            primitives.push((own / view.count.max(1.0)).max(0.0));
        }
        let costs = PassCosts {
            frame_ns: self.far.primitives_ns,
            picture_ns: self.far.pixels_ns / pixels,
            box_ns: self.box_ns(DrawnView::all_ns),
            covered_ns: (over / f64::max(covered, 1.0)).max(0.0),
        };
        (costs, primitives)
    }
}

/// What decides for points or quads at every size.
fn only(points: bool) -> DrawCosts {
    let (cheap, dear) = (
        [1.0; PRIMITIVE_SIZES_PX.len()],
        [9.0; PRIMITIVE_SIZES_PX.len()],
    );
    let (point_ns, quad_ns) = if points { (cheap, dear) } else { (dear, cheap) };
    DrawCosts {
        primitives: Some(PrimitiveCosts { point_ns, quad_ns }),
        ..DrawCosts::default()
    }
}

/// A renderer and two models for it.
pub(super) struct CalibrationStand {
    renderer: VulkanRenderer,
    statue: StandStage,
    /// Two tiny triangles at opposite corners of a cube, each of them from both sides.
    corners: StandStage,
    side: u32,
    is_software: bool,
    until: Instant,
    gave_up: bool,
    /// Of every view how many times as long as its shortest frame its longest took: their logarithms' sum, and how many.
    unsteady: (f64, f64),
}

impl CalibrationStand {
    pub(super) fn new(gpu: &Arc<Gpu>) -> Result<Self, BenchError> {
        // A graphics card needs more to do before its clock can tell.
        let (side, triangles) = match gpu.info().kind {
            DeviceKind::Cpu => (300, 60_000),
            _ => (600, 240_000),
        };
        let statue = generate::mesh(&ShapeSpec::with_triangles(
            GeneratedShape::Statue,
            triangles,
        )?);
        let corner = |at: Vec3| [at, at + 1e-3 * Vec3::X, at + 1e-3 * Vec3::Y];
        let corners = Mesh {
            positions: [corner(-Vec3::ONE), corner(Vec3::ONE)].concat(),
            triangles: vec![[0, 1, 2], [0, 2, 1], [3, 4, 5], [3, 5, 4]],
            ..Mesh::default()
        };
        Ok(Self {
            renderer: VulkanRenderer::new(gpu, side, side, PictureOutputs::default(), true)?,
            statue: StandStage::new(gpu, statue)?,
            corners: StandStage::new(gpu, corners)?,
            side,
            is_software: gpu.info().is_cpu(),
            until: Instant::now(),
            gave_up: false,
            unsteady: (0.0, 0.0),
        })
    }

    /// Measures for so long from now on.
    pub(super) fn begin(&mut self, patience: Duration) {
        self.until = Instant::now() + patience;
        self.gave_up = false;
        self.unsteady = (0.0, 0.0);
    }

    /// How many times as long as the shortest the longest frame of a view took since, in the mean; 1 where nothing else
    /// runs on the machine.
    pub(super) fn unsteadiness(&self) -> f64 {
        let (sum, count) = self.unsteady;
        (sum / count.max(1.0)).exp()
    }

    /// Tells whether something was not measured since, because time was up.
    pub(super) fn gave_up(&self) -> bool {
        self.gave_up
    }

    fn pixels(&self) -> f64 {
        f64::from(self.side) * f64::from(self.side)
    }

    /// Draws one of the models; `None` where the device or the program cannot draw so, and where time is up.
    fn draw(
        &mut self,
        is_statue: bool,
        fill: f64,
        settings: &Settings,
    ) -> Result<Option<DrawnView>, BenchError> {
        use crate::gpu::Error as E;
        let StandStage { model, scene } = if is_statue {
            &mut self.statue
        } else {
            &mut self.corners
        };
        let view = orbit(model, (self.side, self.side), fill, 0, 9)?;
        let mut drawn = DrawnView {
            primitives_ns: f64::INFINITY,
            pixels_ns: f64::INFINITY,
            of_box: pixels_of(&*model, &view, settings.threshold_px).of_box as f64,
            ..DrawnView::default()
        };
        let (mut least_ms, mut most_ms) = (f64::INFINITY, 0.0f64);
        for frame in 0..=FRAMES {
            if Instant::now() > self.until {
                self.gave_up = true;
                return Ok(None);
            }
            let times = match self.renderer.draw(model, scene, &view, settings) {
                Ok(times) => times,
                Err(E::Unsupported { .. } | E::Limit { .. }) => return Ok(None),
                Err(error) => return Err(error.into()),
            };
            let is_of_triangles = settings.threshold_px == 0.0;
            if frame > 0 {
                let of = split(&times);
                let mut own = of.splats_ms + of.triangles_ms;
                if !self.is_software {
                    // What the host does for a list may be far more than what such a device does with it.
                    own += times.pack_ms;
                }
                least_ms = least_ms.min(own + of.pixels_ms);
                most_ms = most_ms.max(own + of.pixels_ms);
                drawn.primitives_ns = drawn.primitives_ns.min(own * 1e6);
                drawn.pixels_ns = drawn.pixels_ns.min(of.pixels_ms * 1e6);
            }
            let counts = times.counts;
            drawn.count = if is_of_triangles {
                counts.triangles as f64
            } else {
                counts.splats as f64
            };
        }
        if least_ms > 0.0 {
            self.unsteady.0 += (most_ms / least_ms).ln();
            self.unsteady.1 += 1.0;
        }
        if is_statue {
            drawn.covered = self.renderer.read(&view)?.covered_pixels() as f64;
        }
        Ok(Some(drawn))
    }

    fn nothing(&mut self, settings: &Settings) -> Result<Option<EmptyFrames>, BenchError> {
        let Some(far) = self.draw(false, FILL_OF_NOTHING, settings)? else {
            return Ok(None);
        };
        let wide = self.draw(false, 1.0, settings)?;
        Ok(wide.map(|wide| EmptyFrames { far, wide }))
    }

    /// The statue with parts of a size.
    fn parts(&mut self, size_px: f32, base: &Settings) -> Result<Option<DrawnView>, BenchError> {
        let settings = Settings {
            threshold_px: size_px,
            ..*base
        };
        let fill = (FILL_OF_ONE * f64::from(size_px)).min(LARGEST_FILL);
        self.draw(true, fill, &settings)
    }

    /// One path of one kind of splat, and for what it costs beside the rasterizer nothing and parts of the middle size.
    fn way(&mut self, base: &Settings) -> Result<Option<(SplatCosts, [DrawnView; 3])>, BenchError> {
        let Some(nothing) = self.nothing(base)? else {
            return Ok(None);
        };
        let mut views = Vec::new();
        for size in SIZES_PX {
            match self.parts(size, base)? {
                Some(drawn) => views.push(drawn),
                None => return Ok(None),
            }
        }
        let (passes, splat_ns) = nothing.costs(&views, self.pixels());
        let costs = SplatCosts {
            splat_ns: std::array::from_fn(|i| splat_ns[i]),
            passes,
        };
        Ok(Some((costs, [nothing.far, nothing.wide, views[1]])))
    }

    /// Both paths of a kind of splat, and what it costs that both draw.
    pub(super) fn splats(
        &mut self,
        kind: SplatKind,
    ) -> Result<(Option<PerRasterizer<SplatCosts>>, Option<MergeCosts>), BenchError> {
        self.renderer.set_costs(Some(only(true)));
        let base = |path| Settings {
            splat: kind,
            path,
            occlusion: Occlusion::Off,
            // Of both models, so that drivers that compile a shader for its uniforms do so once.
            culling: Culling::On,
            ..Settings::default()
        };
        let raster = self.way(&base(Path::Raster))?;
        let compute = self.way(&base(Path::Compute))?;
        let merge = match (&compute, kind) {
            (None, _) | (_, SplatKind::Square | SplatKind::Ellipse | SplatKind::Visibility) => None,
            (Some((_, alone)), _) => {
                // Every leaf might be large.
                let settings = Settings {
                    method: Method::Splats,
                    ..base(Path::Compute)
                };
                let nothing = self.nothing(&settings)?;
                let drawn = self.parts(SIZES_PX[1], &settings)?;
                match (nothing, drawn) {
                    (Some(EmptyFrames { far, wide }), Some(drawn)) => {
                        Some(merge([far, wide, drawn], *alone, self.pixels()))
                    }
                    _ => None,
                }
            }
        };
        if raster.is_none() && compute.is_none() {
            return Ok((None, None));
        }
        let [raster, compute] = [raster, compute].map(|way| way.map(|w| w.0));
        Ok((Some(PerRasterizer { raster, compute }), merge))
    }

    /// Points and quads.
    pub(super) fn primitives(&mut self) -> Result<Option<PrimitiveCosts>, BenchError> {
        let base = Settings {
            path: Path::Raster,
            occlusion: Occlusion::Off,
            culling: Culling::On,
            ..Settings::default()
        };
        let mut ns = [[0.0; PRIMITIVE_SIZES_PX.len()]; 2];
        for (points, ns) in [true, false].into_iter().zip(&mut ns) {
            self.renderer.set_costs(Some(only(points)));
            let Some(nothing) = self.nothing(&base)? else {
                return Ok(None);
            };
            for (ns, size) in ns.iter_mut().zip(PRIMITIVE_SIZES_PX) {
                let Some(drawn) = self.parts(size, &base)? else {
                    return Ok(None);
                };
                *ns = nothing.costs(&[drawn], self.pixels()).1[0];
            }
        }
        let [point_ns, quad_ns] = ns;
        Ok(Some(PrimitiveCosts { point_ns, quad_ns }))
    }

    pub(super) fn triangles(&mut self) -> Result<Option<PerRasterizer<TriangleCosts>>, BenchError> {
        let way = |stand: &mut Self, path| -> Result<Option<TriangleCosts>, BenchError> {
            let settings = Settings {
                path,
                threshold_px: 0.0,
                culling: Culling::On,
                ..Settings::default()
            };
            let Some(nothing) = stand.nothing(&settings)? else {
                return Ok(None);
            };
            let mut views = Vec::new();
            for fill in [3.0 * FILL_OF_ONE, 7.0 * FILL_OF_ONE] {
                match stand.draw(true, fill, &settings)? {
                    Some(drawn) => views.push(drawn),
                    None => return Ok(None),
                }
            }
            // The mean of both distances: triangles of one and of two and a half pixels.
            let (passes, each) = nothing.costs(&views, stand.pixels());
            let triangle_ns = each.iter().sum::<f64>() / each.len() as f64;
            Ok(Some(TriangleCosts {
                triangle_ns,
                passes,
            }))
        };
        let raster = way(self, Path::Raster)?;
        let compute = way(self, Path::Compute)?;
        let any = raster.is_some() || compute.is_some();
        Ok(any.then_some(PerRasterizer { raster, compute }))
    }

    pub(super) fn node_ns(&mut self) -> Result<f64, BenchError> {
        let model = &self.statue.model;
        let view: View = orbit(model, (self.side, self.side), 1.0, 0, 9)?;
        let settings = cut_settings(&Settings::default(), model);
        let (mut selector, mut cut) = (CutSelector::default(), Cut::default());
        let mut least = f64::INFINITY;
        for _ in 0..=8 {
            let start = Instant::now();
            selector.select(model, &view, &settings, &mut cut);
            let ns = start.elapsed().as_nanos() as f64;
            least = least.min(ns / cut.stats.visited.max(1) as f64);
        }
        Ok(least)
    }

    /// The same by the device, of its passes `cut`; `None` where it cannot.
    pub(super) fn device_node_ns(&mut self) -> Result<Option<f64>, BenchError> {
        let settings = Settings {
            cut_on: CutOn::Device,
            path: Path::Raster,
            ..Settings::default()
        };
        let model = &self.statue.model;
        let view: View = orbit(model, (self.side, self.side), 1.0, 0, 9)?;
        let mut least = f64::INFINITY;
        for _ in 0..=FRAMES {
            let drawn = self
                .renderer
                .draw(model, &mut self.statue.scene, &view, &settings);
            let times = match drawn {
                Ok(times) => times,
                Err(crate::gpu::Error::Unsupported { .. }) => return Ok(None),
                Err(error) => return Err(error.into()),
            };
            let passes = times.passes.iter();
            let own = passes.filter(|pass| pass.name.starts_with("cut."));
            let ms: f64 = own.map(|pass| pass.ms).sum();
            least = least.min(ms * 1e6 / times.counts.nodes_visited.max(1) as f64);
        }
        // Without timestamps nothing was measured.
        Ok((least > 0.0 && least.is_finite()).then_some(least))
    }
}

/// What the passes cost with the rasterizer beside over what they cost without: next to nothing far and wide, and parts of
/// one size.
pub(super) fn merge(with: [DrawnView; 3], without: [DrawnView; 3], pixels: f64) -> MergeCosts {
    let more = |i: usize, ns: fn(&DrawnView) -> f64| ns(&with[i]) - ns(&without[i]);
    let [far, wide, parts] = with;
    let all = |i| more(i, DrawnView::all_ns);
    let box_ns = ((all(1) - all(0)) / (wide.of_box - far.of_box).max(1.0)).max(0.0);
    let own = all(2) - all(0) - box_ns * parts.of_box;
    MergeCosts {
        splat_ns: (own / parts.count.max(1.0)).max(0.0),
        passes: PassCosts {
            frame_ns: more(0, |d| d.primitives_ns).max(0.0),
            picture_ns: (more(0, |d| d.pixels_ns) / pixels).max(0.0),
            box_ns,
            covered_ns: 0.0,
        },
    }
}
