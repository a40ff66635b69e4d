//! Measures choices: each view a block of its own, whose times are taken in turn.

use super::choice::TRIANGLES;
use super::errors::{PictureErrors, ReferencePicture, TILE_PX};
use super::{AvailablePaths, ChartError, ChartRow, DrawConfiguration};
use crate::gpu;
use crate::image::{Image, PictureAccumulator, stratified};
use crate::math::camera::View;
use crate::measure::{ValueDistribution, frames};
use crate::progress::Progress;
use crate::projective::frame_photos::FramePhotos;
use crate::render::PictureOutputs;
use crate::render::cost::model::DrawCosts;
use crate::render::engine::{Backend, Engine};
use crate::render::stats::FrameTimes;
use crate::render::{Method, PhotoDisplay, Settings, SplatKind};
use crate::tree::Model;
use std::sync::Arc;

/// What is measured, the same for every model.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartPlan {
    /// Width and height of the pictures.
    pub size: (u32, u32),
    /// Views of the standard orbit.
    pub views: u32,
    /// Distances: projected diameter of the bounding sphere over the shorter side.
    pub fills: Vec<f64>,
    /// Samples a pixel of the reference, along one side of its grid.
    pub grid: u32,
    /// Timed frames of each choice and view.
    pub repeats: u32,
    /// Thresholds of a full chart; `None` for the few choices of a quick one.
    pub thresholds: Option<Vec<f32>>,
}

/// Most vertices of a model whose splats from vertices are measured.
const MOST_SPLAT_VERTICES: usize = 2_000_000;

impl ChartPlan {
    /// Four views at full, half and an eighth of the picture, everything at eleven thresholds.
    pub fn full() -> Self {
        Self {
            size: (500, 500),
            views: 4,
            fills: vec![1.0, 0.5, 0.125],
            grid: 8,
            repeats: 9,
            thresholds: Some(super::choice::THRESHOLDS.to_vec()),
        }
    }

    /// One view of each distance and few choices.
    pub fn quick() -> Self {
        Self {
            views: 1,
            repeats: 5,
            thresholds: None,
            ..Self::full()
        }
    }

    /// The choices for a model on a device; patches where the model has their records, splats from vertices where those are not
    /// millions: all are kept in memory.
    pub fn choices(&self, model: &Model, backend: &Backend) -> Vec<DrawConfiguration> {
        let patches = model.patches.is_some();
        let vertices = model.vertices.len() <= MOST_SPLAT_VERTICES;
        let ways = match backend.device() {
            Some(gpu) => AvailablePaths {
                compute: gpu.info().has_int64_atomics,
                host: gpu.info().is_cpu() && matches!(backend, Backend::Device(_)),
                patches,
                vertices,
            },
            None => AvailablePaths {
                patches,
                vertices,
                ..AvailablePaths::default()
            },
        };
        match &self.thresholds {
            Some(thresholds) => DrawConfiguration::all(thresholds, model.kind().is_points(), ways),
            None => DrawConfiguration::few(model.kind().is_points(), ways),
        }
    }

    /// Frames of one block, for a progress bar.
    pub fn block_frames(&self, choices: usize) -> u64 {
        u64::from(self.grid * self.grid) + choices as u64 * (u64::from(self.repeats) + 1)
    }
}

/// View `k` of `n` of the standard orbit around a model.
///
/// # Errors
/// When the model has no size that a camera can show.
pub fn orbit(
    model: &Model,
    size: (u32, u32),
    fill: f64,
    k: u32,
    n: u32,
) -> Result<View, crate::math::camera::CameraError> {
    model.orbit_step(size, fill, k, n).view(model.origin)
}

/// What draws the reference: all triangles; of a cloud the densest cut, every point as the disc that its spacing gives it.
pub fn reference_settings(is_cloud: bool) -> Settings {
    if is_cloud {
        Settings {
            method: Method::Splats,
            splat: SplatKind::Ellipse,
            threshold_px: 0.0,
            ..Settings::default()
        }
    } else {
        TRIANGLES.settings()
    }
}

/// Draws one model for measurements: with depth, and apart from that with normals, which would cost the timed frames.
#[derive(Debug)]
pub struct ChartBench<'m> {
    model: &'m Model,
    timed: Engine<'m>,
    surface: Option<Engine<'m>>,
    /// Pictures have photographs on the surface.
    photos: PhotoDisplay,
}

/// Time of a choice in a round, milliseconds, as far as frames fit in it, and how many at most; one in any case.
const SHORT_MS: f64 = 40.0;
const MOST_SHORT: usize = 6;
/// The same of triangles, by whose time all others are divided: an error of theirs is one of every ratio.
const UNIT_MS: f64 = 200.0;
/// Models above this many triangles are not kept on the device twice, so their normals are not compared.
const MOST_WITH_NORMALS: usize = 20_000_000;

impl<'m> ChartBench<'m> {
    /// Readies a model.
    ///
    /// # Errors
    /// As [`Engine::new`].
    pub fn new(backend: &Backend, model: &'m Model, size: (u32, u32)) -> Result<Self, gpu::Error> {
        let outputs = |normal| PictureOutputs {
            depth: true,
            normal,
            values: false,
        };
        let surface = (model.triangles.len() <= MOST_WITH_NORMALS)
            .then(|| Engine::new(backend, model, size, outputs(true)))
            .transpose()?;
        Ok(Self {
            model,
            timed: Engine::new(backend, model, size, outputs(false))?,
            surface,
            photos: PhotoDisplay::Off,
        })
    }

    /// Puts these photographs on the surface, of pictures to be measured and of the reference, from now on.
    ///
    /// # Errors
    /// When device memory runs out.
    pub fn set_photos(&mut self, photos: Arc<FramePhotos>) -> Result<(), gpu::Error> {
        self.photos = PhotoDisplay::Color;
        self.timed.set_photos(Some(photos))
    }

    /// Settings with what pictures show of photographs.
    fn shown(&self, settings: Settings) -> Settings {
        Settings {
            photos: self.photos,
            ..settings
        }
    }

    /// What drawing costs on the device, by which choices of [`Path::Auto`](crate::render::Path::Auto) are drawn as the program draws them: as
    /// [`Engine::set_costs`]. Without it rules of thumb decide.
    pub fn set_costs(&mut self, costs: Option<DrawCosts>) {
        self.timed.set_costs(costs);
        if let Some(engine) = &mut self.surface {
            engine.set_costs(costs);
        }
    }

    /// The supersampled reference: the mean of `grid` x `grid` jittered pictures, with depth and normals of the pixel
    /// centers.
    ///
    /// # Errors
    /// When a picture cannot be drawn, or `progress` is cancelled.
    pub fn reference(
        &mut self,
        view: &View,
        grid: u32,
        progress: &dyn Progress,
    ) -> Result<ReferencePicture, ChartError> {
        let plain = reference_settings(self.model.kind().is_points());
        let settings = self.shown(plain);
        let mut mean = PictureAccumulator::new();
        for i in 0..grid * grid {
            if progress.is_cancelled() {
                return Err(ChartError::Cancelled);
            }
            mean.add(&self.timed.sample(&stratified(view, i, grid), &settings)?)?;
            progress.advance(1);
        }
        let mut picture = mean.mean();
        picture.depth = self.timed.render(view, &settings)?.depth;
        let normal = match &mut self.surface {
            Some(engine) => engine.render(view, &plain)?.normal,
            None => Vec::new(),
        };
        Ok(ReferencePicture { picture, normal })
    }

    /// The picture of a choice, with depth.
    ///
    /// # Errors
    /// As [`Engine::render`].
    pub fn picture(
        &mut self,
        view: &View,
        choice: &DrawConfiguration,
    ) -> Result<Image, gpu::Error> {
        let settings = self.shown(choice.settings());
        self.timed.render(view, &settings)
    }

    /// The normals of a choice; `None` where it has none.
    fn normals(
        &mut self,
        view: &View,
        choice: &DrawConfiguration,
    ) -> Result<Option<Vec<[f32; 3]>>, gpu::Error> {
        let Some(engine) = &mut self.surface else {
            return Ok(None);
        };
        match engine.render(view, &choice.settings()) {
            Ok(image) => Ok(Some(image.normal)),
            Err(gpu::Error::Unsupported { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The errors of a choice; the reason where device or method refuse it.
    ///
    /// # Errors
    /// When a picture cannot be drawn for any other reason.
    pub fn errors(
        &mut self,
        view: &View,
        choice: &DrawConfiguration,
        reference: &ReferencePicture,
    ) -> Result<Result<PictureErrors, String>, ChartError> {
        let picture = match self.picture(view, choice) {
            Ok(picture) => picture,
            Err(error @ (gpu::Error::Unsupported { .. } | gpu::Error::Limit { .. })) => {
                return Ok(Err(error.to_string()));
            }
            Err(error) => return Err(error.into()),
        };
        let normals = self.normals(view, choice)?;
        Ok(Ok(PictureErrors::of(
            reference,
            &picture,
            normals.as_deref(),
            view,
        )?))
    }

    /// Times frames of each choice in `repeats` rounds: all of them once, then again in the opposite order, and so on, so
    /// that what slows the machine down for a while slows them all. Short frames, which a moment's other work doubles,
    /// are drawn up to six times a round, as often as 40 ms allow, and triangles as often as 200 ms do; the first of several
    /// does not count, because it finds in the caches what another choice has left there. One frame of each goes before
    /// the first round that does not count either.
    ///
    /// # Errors
    /// When a frame cannot be drawn, or `progress` is cancelled.
    pub fn times(
        &mut self,
        view: &View,
        choices: &[DrawConfiguration],
        repeats: u32,
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<FrameTimes>>, ChartError> {
        let mut times = vec![Vec::with_capacity(repeats as usize); choices.len()];
        let mut order: Vec<usize> = (0..choices.len()).collect();
        for round in 0..=repeats {
            for &i in &order {
                if progress.is_cancelled() {
                    return Err(ChartError::Cancelled);
                }
                let settings = self.shown(choices[i].settings());
                let mut left_ms = if choices[i] == TRIANGLES {
                    UNIT_MS
                } else {
                    SHORT_MS
                };
                let mut frames = Vec::new();
                while frames.len() < MOST_SHORT {
                    let frame = self.timed.draw(view, &settings)?;
                    left_ms -= frame.frame_ms;
                    let is_last = round == 0 || left_ms < frame.frame_ms;
                    frames.push(frame);
                    if is_last {
                        break;
                    }
                }
                if round > 0 {
                    let cold = usize::from(frames.len() > 1);
                    times[i].extend(frames.drain(cold..));
                    progress.advance(1);
                }
            }
            order.reverse();
        }
        Ok(times)
    }
}

/// Where a block is measured, for its rows.
#[derive(Debug, Clone, Copy)]
pub struct ChartPlace<'a> {
    /// Name of the model.
    pub model: &'a str,
    /// Index into [`ChartPlan::fills`].
    pub fill: usize,
    /// View of [`ChartPlan::views`].
    pub view: u32,
}

/// Measures every choice from one view: errors first, then times. The rows come in the order of [`ChartPlan::choices`]; what
/// is refused has a row that says why.
///
/// # Errors
/// When a picture cannot be drawn, or `progress` is cancelled; nothing is kept of the block then.
pub fn block(
    backend: &Backend,
    bench: &mut ChartBench<'_>,
    plan: &ChartPlan,
    place: ChartPlace<'_>,
    progress: &dyn Progress,
) -> Result<(Vec<ChartRow>, ReferencePicture), ChartError> {
    let model = bench.model;
    let view = orbit(
        model,
        plan.size,
        plan.fills[place.fill],
        place.view,
        plan.views,
    )?;
    let choices = plan.choices(model, backend);
    let reference = bench.reference(&view, plan.grid, progress)?;
    let mut rows = Vec::with_capacity(choices.len());
    let mut timed = Vec::new();
    for choice in &choices {
        if progress.is_cancelled() {
            return Err(ChartError::Cancelled);
        }
        let mut row = empty_row(backend, model, plan, place, choice);
        match bench.errors(&view, choice, &reference)? {
            Ok(errors) => {
                put_errors(&mut row, &errors);
                timed.push((rows.len(), *choice));
            }
            Err(why) => row.refused = why,
        }
        rows.push(row);
        progress.advance(1);
    }
    let candidates: Vec<DrawConfiguration> = timed.iter().map(|t| t.1).collect();
    let times = bench.times(&view, &candidates, plan.repeats, progress)?;
    for ((row, _), times) in timed.into_iter().zip(times) {
        put_times(&mut rows[row], &times);
    }
    Ok((rows, reference))
}

/// The row of a choice before anything is measured: what resumed rows are compared with.
pub fn empty_row(
    backend: &Backend,
    model: &Model,
    plan: &ChartPlan,
    place: ChartPlace<'_>,
    choice: &DrawConfiguration,
) -> ChartRow {
    let [method, splat, path] = choice.words();
    let none = f64::NAN;
    ChartRow {
        version: env!("CARGO_PKG_VERSION").into(),
        commit: crate::measure::COMMIT.into(),
        device: backend.name().into(),
        driver: backend
            .device()
            .map_or_else(String::new, |gpu| gpu.info().driver.clone()),
        model: place.model.into(),
        model_triangles: model.triangles.len() as u64,
        model_vertices: model.vertices.len() as u64,
        width: plan.size.0,
        height: plan.size.1,
        fill: plan.fills[place.fill],
        view: place.view,
        views: plan.views,
        method,
        splat,
        path,
        threshold_px: choice.threshold_px,
        samples: plan.grid * plan.grid,
        repeats: plan.repeats,
        refused: String::new(),
        frame_ms: none,
        frame_p5_ms: none,
        frame_p95_ms: none,
        cpu_ms: none,
        cpu_p5_ms: none,
        cpu_p95_ms: none,
        cut_ms: none,
        pack_ms: none,
        upload_ms: none,
        submit_ms: none,
        wait_ms: none,
        passes_ms: String::new(),
        nodes_visited: 0,
        splats: 0,
        triangles: 0,
        points: 0,
        draw_list_bytes: 0,
        flip: none,
        flip_object: none,
        psnr_db: none,
        psnr_object_db: none,
        ssim: none,
        object_pixels: 0,
        missing: 0,
        extra: 0,
        holes: 0,
        hole_pixels: 0,
        silhouette_mean_px: none,
        silhouette_p99_px: none,
        depth_mean_footprints: none,
        depth_p99_footprints: none,
        normal_mean_degrees: none,
        normal_p99_degrees: none,
        worst_x: 0,
        worst_y: 0,
        worst_side: 0,
        worst_levels: none,
    }
}

fn put_errors(row: &mut ChartRow, errors: &PictureErrors) {
    row.flip = errors.flip;
    row.flip_object = errors.flip_object;
    row.psnr_db = errors.psnr_db;
    row.psnr_object_db = errors.psnr_object_db;
    row.ssim = errors.ssim;
    row.object_pixels = errors.object_pixels;
    row.missing = errors.coverage.missing;
    row.extra = errors.coverage.extra;
    row.holes = errors.coverage.holes;
    row.hole_pixels = errors.coverage.hole_pixels;
    row.silhouette_mean_px = errors.silhouette.mean;
    row.silhouette_p99_px = errors.silhouette.p99;
    if errors.depth.count > 0 {
        row.depth_mean_footprints = errors.depth.mean;
        row.depth_p99_footprints = errors.depth.p99;
    }
    if let Some(normal) = errors.normal.filter(|n| n.count > 0) {
        row.normal_mean_degrees = normal.mean;
        row.normal_p99_degrees = normal.p99;
    }
    row.worst_x = errors.worst.x;
    row.worst_y = errors.worst.y;
    row.worst_side = TILE_PX;
    row.worst_levels = 255.0 * errors.worst.rmse;
}

/// Time of a frame that the processor worked on it: all of it but the wait for the device. The mirror has no device.
fn cpu_ms(times: &FrameTimes) -> f64 {
    times.cut_ms + times.pack_ms + times.upload_ms + times.submit_ms + times.host.look_ms
}

fn put_times(row: &mut ChartRow, times: &[FrameTimes]) {
    let spread = |of: &dyn Fn(&FrameTimes) -> f64| {
        ValueDistribution::of(&times.iter().map(of).collect::<Vec<_>>())
    };
    let frame = spread(&|t| t.frame_ms);
    (row.frame_ms, row.frame_p5_ms, row.frame_p95_ms) = (frame.median, frame.p5, frame.p95);
    let cpu = spread(&cpu_ms);
    (row.cpu_ms, row.cpu_p5_ms, row.cpu_p95_ms) = (cpu.median, cpu.p5, cpu.p95);
    row.cut_ms = spread(&|t| t.cut_ms).median;
    row.pack_ms = spread(&|t| t.pack_ms).median;
    row.upload_ms = spread(&|t| t.upload_ms).median;
    row.submit_ms = spread(&|t| t.submit_ms).median;
    row.wait_ms = spread(&|t| t.wait_ms).median;
    row.passes_ms = frames::passes(times)
        .iter()
        .map(|p| {
            format!(
                "{}={:.4}/{:.4}/{:.4}",
                p.name, p.ms.median, p.ms.p5, p.ms.p95
            )
        })
        .collect::<Vec<_>>()
        .join("; ");
    if let Some(last) = times.last() {
        row.nodes_visited = last.counts.nodes_visited;
        row.splats = last.counts.splats;
        row.triangles = last.counts.triangles;
        row.points = last.counts.points;
        row.draw_list_bytes = last.counts.draw_list_bytes;
    }
}
