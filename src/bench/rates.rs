//! What the device makes of primitives, bytes and empty frames: the figures that bound all others.

use super::calibrate::split;
use super::cases::{self, SIZE, empty_view, views};
use super::verdict::BenchTarget;
use super::{BenchCase, BenchError, BenchFigure, BenchPlace, BenchPlan, BenchSession};
use crate::gpu::Gpu;
use crate::gpu::buffer::{BufferUsage, DeviceBuffer};
use crate::gpu::frame::FrameRing;
use crate::gpu::profile::self_test;
use crate::progress::Progress;
use crate::render::cost::model::{
    DrawCosts, MergeCosts, PRIMITIVE_SIZES_PX, PassCosts, PerRasterizer, SIZES_PX, SplatCosts,
    TriangleCosts,
};
use crate::render::engine::Engine;
use crate::render::stats::FrameTimes;
use crate::render::{Occlusion, Path, SplatKind};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

const PART: &str = "rates";

/// Bytes that are moved to measure how fast they move: more than caches hold.
const MOVED: usize = 64 << 20;

/// How fast bytes move, bytes a nanosecond (GB/s), reads and writes together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MemoryBandwidth {
    /// Copies on the processor, all threads together.
    pub host: f64,
    /// The device fills a buffer.
    pub device: f64,
}

impl MemoryBandwidth {
    /// The best of several copies and fills.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn measure(gpu: &Arc<Gpu>) -> Result<Self, BenchError> {
        let source = vec![1u8; MOVED];
        let mut target = vec![0u8; MOVED];
        let mut host = f64::INFINITY;
        for _ in 0..4 {
            let start = Instant::now();
            let chunk = MOVED.div_ceil(rayon::current_num_threads());
            target
                .par_chunks_mut(chunk)
                .zip(source.par_chunks(chunk))
                .for_each(|(to, from)| to.copy_from_slice(from));
            host = host.min(start.elapsed().as_nanos() as f64);
        }
        std::hint::black_box(&target);
        let buffer = DeviceBuffer::new(gpu, "bytes to fill", BufferUsage::Storage, MOVED as u64)?;
        let mut frames = FrameRing::new(gpu, 1, true)?;
        let mut device = f64::INFINITY;
        for _ in 0..4 {
            let mut frame = frames.begin()?;
            frame.pass("bench.fill").fill(&[(&buffer, MOVED as u64)], 1);
            let ticket = frame.submit()?;
            let finished = frames.finish(ticket)?;
            let ns = match finished.passes.first() {
                Some(pass) => pass.ms * 1e6,
                None => finished.host.as_nanos() as f64,
            };
            device = device.min(ns.max(1.0));
        }
        Ok(Self {
            host: 2.0 * MOVED as f64 / host.max(1.0),
            device: MOVED as f64 / device,
        })
    }
}

/// The calibration and the bandwidths as figures.
pub fn calibration(session: &BenchSession) -> Vec<BenchFigure> {
    let costs = &session.found.calibration.costs;
    let place = BenchPlace::default();
    let figure = |line: &str, name: &str, value: f64, unit| {
        BenchFigure::new("calibration", &place, line, name, value, unit)
    };
    let mut figures = vec![
        figure(
            "host",
            "bytes copied, reads and writes",
            session.bandwidth.host,
            "GB/s",
        ),
        figure("device", "bytes filled", session.bandwidth.device, "GB/s"),
    ];
    if let Some(ns) = costs.node_ns {
        figures.push(figure("host", "a visited node of a small model", ns, "ns"));
    }
    if let Some(ns) = costs.device_node_ns {
        let name = "a visited node of a small model, cut on the device";
        figures.push(figure("device", name, ns, "ns"));
    }
    for (name, ways) in kinds(costs) {
        for (by, way) in [("raster", &ways.raster), ("compute", &ways.compute)] {
            let line = format!("{name} by {by}");
            let Some(way) = way else {
                let why = "the device or the program cannot";
                figures.push(BenchFigure::absent(
                    "calibration",
                    &place,
                    &line,
                    "a splat",
                    "ns",
                    why,
                ));
                continue;
            };
            for (size, ns) in SIZES_PX.iter().zip(way.splat_ns) {
                figures.push(figure(&line, &format!("a splat of {size} px"), ns, "ns"));
            }
            figures.extend(of_passes(&place, &line, &way.passes));
        }
    }
    for (name, merge) in merges(costs) {
        let line = format!("{name} by compute, beside the rasterizer");
        figures.push(figure(&line, "a splat on top", merge.splat_ns, "ns"));
        figures.extend(of_passes(&place, &line, &merge.passes));
    }
    for (by, way) in triangles(costs) {
        let line = format!("triangles by {by}");
        let name = "a triangle of 1 to 3 px";
        figures.push(figure(&line, name, way.triangle_ns, "ns"));
        figures.extend(of_passes(&place, &line, &way.passes));
    }
    if let Some(both) = &costs.primitives {
        for (by, all) in [("points", both.point_ns), ("quads", both.quad_ns)] {
            let line = format!("squares as {by}");
            for (size, ns) in PRIMITIVE_SIZES_PX.iter().zip(all) {
                figures.push(figure(&line, &format!("a splat of {size} px"), ns, "ns"));
            }
        }
    }
    figures
}

fn of_passes(place: &BenchPlace, line: &str, passes: &PassCosts) -> [BenchFigure; 4] {
    [
        ("a frame", passes.frame_ns),
        ("a pixel of the picture on top", passes.picture_ns),
        ("a pixel of the model's box on top", passes.box_ns),
        ("a covered pixel on top", passes.covered_ns),
    ]
    .map(|(name, ns)| BenchFigure::new("calibration", place, line, name, ns, "ns"))
}

/// The kinds of splats that were calibrated, with their names.
pub fn kinds(costs: &DrawCosts) -> Vec<(&'static str, &PerRasterizer<SplatCosts>)> {
    [
        ("square", &costs.square),
        ("ellipse", &costs.ellipse),
        ("gauss", &costs.gauss),
        ("filtered", &costs.filtered),
        ("visibility", &costs.visibility),
    ]
    .into_iter()
    .filter_map(|(name, ways)| Some((name, ways.as_ref()?)))
    .collect()
}

/// What blended kinds cost on top by compute beside the rasterizer, with their names.
pub fn merges(costs: &DrawCosts) -> Vec<(&'static str, &MergeCosts)> {
    [
        ("gauss", &costs.gauss_merge),
        ("filtered", &costs.filtered_merge),
    ]
    .into_iter()
    .filter_map(|(name, merge)| Some((name, merge.as_ref()?)))
    .collect()
}

/// The paths of small triangles that were calibrated, with their names.
pub fn triangles(costs: &DrawCosts) -> Vec<(&'static str, &TriangleCosts)> {
    let Some(ways) = &costs.triangle else {
        return Vec::new();
    };
    [("raster", &ways.raster), ("compute", &ways.compute)]
        .into_iter()
        .filter_map(|(by, way)| Some((by, way.as_ref()?)))
        .collect()
}

/// Splats a second by compute, as they have to be drawn, and what an empty frame costs. The largest model of a run is the
/// one to ask: its parts are all splats.
///
/// # Errors
/// When a frame cannot be drawn, or `progress` is cancelled.
pub fn figures(
    session: &BenchSession,
    case: &BenchCase<'_>,
    plan: &BenchPlan,
    progress: &dyn Progress,
) -> Result<Vec<BenchFigure>, BenchError> {
    use crate::gpu::Error as E;
    let view = views(case.model, SIZE, 1.0, plan.views.max(1))?[0];
    let place = case.place(SIZE, 1.0);
    let mut engine = session.engine(case.model, SIZE)?;
    // A rate is about splats that are given: a list without those that are hidden is so short that what a pass costs by
    // itself is a tenth of it.
    let (all, seen) = (Occlusion::Off, Occlusion::Auto);
    let wanted = [
        ("1-pixel squares", SplatKind::Square, 1.0, all, Some(100.0)),
        (
            "1-pixel squares without hidden ones",
            SplatKind::Square,
            1.0,
            seen,
            None,
        ),
        ("3-pixel discs", SplatKind::Disc, 3.0, all, Some(30.0)),
        (
            "normalized fuzzy 3-pixel splats",
            SplatKind::Gauss,
            3.0,
            all,
            Some(10.0),
        ),
        (
            "filtered splats of a pixel",
            SplatKind::Filtered,
            1.0,
            all,
            None,
        ),
    ];
    // Where the processor's renderer draws in the place of a software device, both are measured, and the faster one has to be
    // fast.
    let has_cpu = |kind| {
        let by_cpu = [SplatKind::Square, SplatKind::Disc, SplatKind::Filtered].contains(&kind);
        by_cpu && session.is_software()
    };
    let lines: Vec<_> = wanted
        .iter()
        .flat_map(|&(name, kind, threshold, occlusion, target)| {
            let ways = match has_cpu(kind) {
                true => vec![
                    (Path::Auto, target),
                    (Path::Compute, target),
                    (Path::Raster, None),
                ],
                false => vec![(Path::Compute, target), (Path::Raster, None)],
            };
            ways.into_iter().map(move |(path, target)| {
                let mut line = cases::pop(kind, path, threshold);
                line.settings.occlusion = occlusion;
                if path == Path::Auto {
                    line.name.push_str(", by the processor");
                }
                (name, line, target)
            })
        })
        .collect();
    let mut frames: Vec<Result<Vec<FrameTimes>, String>> = vec![Ok(Vec::new()); lines.len()];
    progress.stage("rates", plan.rounds as u64 + 1);
    for round in 0..=plan.rounds {
        for ((_, line, _), found) in lines.iter().zip(&mut frames) {
            if progress.is_cancelled() {
                return Err(BenchError::Cancelled);
            }
            let Ok(list) = found else { continue };
            match engine.draw(&view, &line.settings) {
                Ok(times) if round > 0 => list.push(times),
                Ok(_) => {}
                Err(why @ (E::Unsupported { .. } | E::Limit { .. })) => {
                    *found = Err(why.to_string());
                }
                Err(error) => return Err(error.into()),
            }
        }
        progress.advance(1);
    }
    let mut figures = Vec::new();
    let mut of_target: Option<(&str, f64)> = None;
    for ((name, line, target), found) in lines.iter().zip(frames) {
        let target = target.filter(|_| case.standard().is_some());
        let figure = match found {
            Ok(list) => rate(&place, &line.name, name, &list),
            Err(why) => BenchFigure::absent(PART, &place, &line.name, name, "M/s", why),
        };
        // What is absent is slower than anything.
        let value = figure.value.max(f64::NEG_INFINITY);
        figures.push(figure.target(target.map(BenchTarget::AtLeast)));
        if target.is_none() {
            continue;
        }
        // Of two ways the slower one is not asked.
        let index = figures.len() - 1;
        let slower = match of_target.replace((name, value)) {
            Some((before, _)) if before != *name => None,
            Some((_, before)) if before >= value => Some(index),
            Some(_) => Some(index - 1),
            None => None,
        };
        if let Some(slower) = slower {
            figures[slower].target = None;
        }
    }
    floor(session, case, &mut engine, plan, &mut figures, progress)?;
    Ok(figures)
}

/// Splats a second in the passes over splats, and with those over the picture in the remark.
fn rate(place: &BenchPlace, line: &str, name: &str, frames: &[FrameTimes]) -> BenchFigure {
    let splats = frames.last().map_or(0, |t| t.counts.splats);
    let triangles = frames.last().map_or(0, |t| t.counts.triangles);
    if splats == 0 {
        let why =
            format!("{triangles} triangles and no splat: the model is too small for this view");
        return BenchFigure::absent(PART, place, line, name, "M/s", why);
    }
    let rates = |is_all: bool| -> Vec<f64> {
        let ms = frames.iter().map(|t| {
            let of = split(t);
            of.splats_ms + if is_all { of.pixels_ms } else { 0.0 }
        });
        ms.map(|ms| splats as f64 / ms.max(1e-9) / 1e3).collect()
    };
    let [own, all] = [false, true]
        .map(|is_all| BenchFigure::median(PART, place, line, name, &rates(is_all), "M/s"));
    let others = match triangles {
        0 => String::new(),
        n => format!(", beside {n} triangles"),
    };
    let note = format!(
        "{splats} splats{others}; {:.1} M/s with the passes over the picture",
        all.value
    );
    own.note(note)
}

/// What a frame costs in which nothing is drawn.
fn floor(
    session: &BenchSession,
    case: &BenchCase<'_>,
    engine: &mut Engine<'_>,
    plan: &BenchPlan,
    figures: &mut Vec<BenchFigure>,
    progress: &dyn Progress,
) -> Result<(), BenchError> {
    let place = case.place(SIZE, 0.0);
    let mut take = |line: &str, settings, view| -> Result<(), BenchError> {
        let mut frames = Vec::new();
        for round in 0..=plan.rounds {
            if progress.is_cancelled() {
                return Err(BenchError::Cancelled);
            }
            match engine.draw(view, settings) {
                Ok(times) if round > 0 => frames.push(times),
                Ok(_) => {}
                Err(crate::gpu::Error::Unsupported { .. }) => return Ok(()),
                Err(error) => return Err(error.into()),
            }
        }
        let mut add = |name: &str, of: &dyn Fn(&FrameTimes) -> f64| {
            let values: Vec<f64> = frames.iter().map(of).collect();
            figures.push(BenchFigure::median(
                "floor", &place, line, name, &values, "ms",
            ));
        };
        add("frame", &|t| t.frame_ms);
        add("submit", &|t| t.submit_ms);
        let names: Vec<&'static str> = crate::measure::frames::pass_names(&frames);
        for name in names {
            add(name, &|t| {
                crate::measure::frames::pass_ms(t, name).unwrap_or_default()
            });
        }
        Ok(())
    };
    let (empty, pop) = (empty_view(case.model, SIZE)?, cases::default(1.0).settings);
    take("nothing in view", &pop, &empty)?;
    let tiny = crate::chart::run::orbit(case.model, SIZE, 0.01, 0, 9)?;
    let by_compute = cases::pop(SplatKind::Square, Path::Compute, 1.0).settings;
    take(
        "five pixels by compute: clear and resolve",
        &by_compute,
        &tiny,
    )?;
    if let Some(gpu) = session.backend.device() {
        let test = self_test(gpu)?;
        let name = "submission with nothing in it";
        figures.push(BenchFigure::new(
            "floor",
            &BenchPlace::default(),
            "",
            name,
            test.empty_ms,
            "ms",
        ));
    }
    Ok(())
}
