//! One view of the same surface, of ever more triangles: what does the frame of a fixed view cost as a model grows?

use super::cases::{self, SIZE, views};
use super::verdict::BenchTarget;
use super::{BenchCase, BenchError, BenchFigure, BenchSession};
use crate::measure::ValueDistribution;
use crate::progress::Progress;
use crate::render::stats::FrameTimes;

const PART: &str = "growth";

/// Triangles of the models of a large run: the same surface.
pub const TRIANGLES: [u64; 3] = [1_000_000, 8_000_000, 64_000_000];

/// The frames of each model in turn; the first is what the others are compared with. The target holds for a model of 64
/// million triangles over one of a million.
///
/// # Errors
/// When a frame cannot be drawn, or `progress` is cancelled.
pub fn figures(
    session: &BenchSession,
    models: &[BenchCase<'_>],
    rounds: usize,
    progress: &dyn Progress,
) -> Result<Vec<BenchFigure>, BenchError> {
    let line = cases::default(1.0);
    let mut stands = Vec::new();
    for case in models {
        let engine = session.engine(case.model, SIZE)?;
        let view = views(case.model, SIZE, 1.0, 9)?[0];
        stands.push((case, engine, view, Vec::<FrameTimes>::new()));
    }
    progress.stage("growth", rounds as u64 + 1);
    for round in 0..=rounds {
        for (_, engine, view, frames) in &mut stands {
            if progress.is_cancelled() {
                return Err(BenchError::Cancelled);
            }
            let times = engine.draw(view, &line.settings)?;
            if round > 0 {
                frames.push(times);
            }
        }
        progress.advance(1);
    }
    let mut figures = Vec::new();
    let median = |frames: &[FrameTimes]| {
        ValueDistribution::of(&frames.iter().map(|t| t.frame_ms).collect::<Vec<_>>()).median
    };
    let first = stands.first().map_or(f64::NAN, |s| median(&s.3));
    for (index, (case, _, _, frames)) in stands.iter().enumerate() {
        let place = case.place(SIZE, 1.0);
        let ms: Vec<f64> = frames.iter().map(|t| t.frame_ms).collect();
        let memory = case.model.memory_bytes();
        let last = frames.last().map(|t| t.counts).unwrap_or_default();
        figures.push(
            BenchFigure::median(PART, &place, &line.name, "frame", &ms, "ms").note(format!(
                "{} nodes visited, {} splats, {} triangles; {} MiB of model and tree",
                last.nodes_visited,
                last.splats,
                last.triangles,
                memory.total() >> 20
            )),
        );
        if index == 0 {
            continue;
        }
        let count = |case: &BenchCase<'_>| case.model.triangles.len() as f64;
        let is_whole = count(models.first().unwrap_or(case)) < 1.1e6 && count(case) > 6e7;
        let bound = is_whole.then_some(BenchTarget::AtMost(1.3));
        let name = "frame over that of the smallest";
        let growth = median(frames) / first;
        figures.push(BenchFigure::new(PART, &place, &line.name, name, growth, "x").target(bound));
    }
    Ok(figures)
}

/// What stands for the target where the large models were not asked for.
pub fn not_asked() -> BenchFigure {
    let place = super::BenchPlace {
        model: "statue".into(),
        triangles: TRIANGLES[2],
        size: SIZE,
        fill: 1.0,
    };
    BenchFigure::absent(
        PART,
        &place,
        &cases::default(1.0).name,
        "frame over that of the smallest",
        "x",
        format!(
            "give --large; it takes {} GB of memory",
            super::memory::needed(TRIANGLES.iter().sum()).div_ceil(1_000_000_000)
        ),
    )
    .target(Some(BenchTarget::AtMost(1.3)))
}
