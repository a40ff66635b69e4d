//! Whole frames of every way to draw, beside plain triangles.

use super::cases::{BenchLine, SIZE, views};
use super::verdict::BenchTarget;
use super::{BenchCase, BenchError, BenchFigure, BenchPlace, BenchPlan, BenchSession};
use crate::math::camera::View;
use crate::measure::ValueDistribution;
use crate::measure::frames::{pass_ms, pass_names};
use crate::progress::Progress;
use crate::render::cost::model::PicturePixels;
use crate::render::engine::Engine;
use crate::render::stats::{FrameStage, FrameTimes};
use crate::render::{Method, Settings};
use crate::tree::Model;

const PART: &str = "frames";

/// Views between two of a line that is rarely drawn.
const RARE: usize = 3;

/// Frames of one line: view and times.
type BenchFrames = Vec<(usize, FrameTimes)>;

/// What a frame can cost at least, milliseconds: its bytes over the measured bandwidth of the host, and its primitives at
/// the calibrated rate of the cheaper path, with the picture's own passes and the cut.
///
/// Bytes are those that have to move whatever the program does: a node visited, a record of a draw list written and read,
/// of plain triangles vertices and indices, and color and depth of the picture once written. The rates are those of some
/// ten thousand primitives: what they say of plain triangles, millions of which lie behind others or face away, is nothing.
pub fn roofs(
    session: &BenchSession,
    model: &Model,
    settings: &Settings,
    times: &FrameTimes,
    (width, height): (u32, u32),
) -> [f64; 2] {
    let pixels = u64::from(width) * u64::from(height);
    let c = &times.counts;
    let mesh = if settings.method == Method::Triangles {
        20 * model.vertices.len() as u64 + 12 * model.triangles.len() as u64
    } else {
        0
    };
    let bytes = 32 * c.nodes_visited + 2 * c.draw_list_bytes + mesh + 8 * pixels;
    let costs = &session.found.calibration.costs;
    // The model's box counts as the whole picture.
    let of_pixels = PicturePixels {
        picture: pixels,
        of_box: pixels,
    };
    let least = |ways: [Option<f64>; 2]| match ways {
        [Some(a), Some(b)] => a.min(b),
        [a, b] => a.or(b).unwrap_or(f64::NAN),
    };
    let splats = costs.of(settings.splat).map_or([None; 2], |ways| {
        [&ways.raster, &ways.compute].map(|way| {
            way.as_ref()
                .map(|way| way.frame_ns(c.splats, settings.threshold_px, of_pixels))
        })
    });
    let triangles = costs.triangle.as_ref().map_or([None; 2], |ways| {
        [&ways.raster, &ways.compute]
            .map(|way| way.as_ref().map(|way| way.frame_ns(c.triangles, of_pixels)))
    });
    let visited = costs.node_ns.unwrap_or(f64::NAN) * c.nodes_visited as f64;
    let ns = least(splats) + least(triangles) + visited;
    let primitives = if settings.method == Method::Triangles {
        f64::NAN
    } else {
        ns / 1e6
    };
    [bytes as f64 / session.bandwidth.host / 1e6, primitives]
}

/// Every line at every size and distance, in turn; the ratios to triangles of the same views.
///
/// # Errors
/// When a frame cannot be drawn, or `progress` is cancelled.
pub fn figures(
    session: &BenchSession,
    case: &BenchCase<'_>,
    plan: &BenchPlan,
    progress: &dyn Progress,
) -> Result<Vec<BenchFigure>, BenchError> {
    let lines = plan.lines();
    let mut figures = Vec::new();
    let mut slowest: Option<(f64, String)> = None;
    let per_fill = |size: &(u32, u32)| {
        let views = plan.views.max(1) as usize;
        let rare = views.div_ceil(rarity(views));
        lines
            .iter()
            .map(|l| if l.is_rare || *size != SIZE { rare } else { views } + 1)
            .sum::<usize>() as u64
    };
    let all: u64 = plan.sizes.iter().map(per_fill).sum();
    progress.stage(
        &format!("frames of {}", case.name),
        all * plan.fills.len() as u64,
    );
    for &size in &plan.sizes {
        let mut engine = session.engine(case.model, size)?;
        for &fill in &plan.fills {
            let place = case.place(size, fill);
            let views = views(case.model, size, fill, plan.views.max(1))?;
            let (drawn, refused) = draw(&mut engine, &lines, &views, size == SIZE, progress)?;
            for (line, why) in &refused {
                let name = &lines[*line].name;
                figures.push(BenchFigure::absent(PART, &place, name, "frame", "ms", why).detail());
            }
            for (line, frames) in lines.iter().zip(&drawn) {
                let roofs = frames
                    .last()
                    .map(|(_, times)| roofs(session, case.model, &line.settings, times, size));
                describe(&place, line, frames, roofs, &mut figures);
            }
            for (line, frames) in lines.iter().zip(&drawn).skip(1) {
                let Some(times) = faster(&drawn[0], frames) else {
                    continue;
                };
                let is_default = line.name == "default, 1 px";
                let target = if is_default {
                    case.speed_target(size, fill)
                } else {
                    None
                };
                let name = "times faster than triangles";
                let figure = BenchFigure::new(PART, &place, &line.name, name, times, "x");
                let figure = figure.target(target);
                figures.push(if is_default { figure } else { figure.detail() });
                if line.name.starts_with("default") && slowest.as_ref().is_none_or(|s| times < s.0)
                {
                    let at = format!("{} at {}x{}, fill {fill}", line.name, size.0, size.1);
                    slowest = Some((times, at));
                }
            }
        }
    }
    if let Some((times, at)) = slowest
        && case.model.triangles.len() > 100_000
    {
        let name = "times faster than triangles, the least of all thresholds and distances";
        let place = case.place((0, 0), 0.0);
        let figure = BenchFigure::new(PART, &place, "default", name, times, "x");
        figures.push(figure.target(Some(BenchTarget::AtLeast(1.0))).note(at));
    }
    Ok(figures)
}

/// Draws the views by all lines in turn, every second view in the opposite order. Of what is refused: which line and why.
#[allow(
    clippy::type_complexity,
    reason = "frames of each line, and what was refused"
)]
fn draw(
    engine: &mut Engine<'_>,
    lines: &[BenchLine],
    views: &[View],
    is_full: bool,
    progress: &dyn Progress,
) -> Result<(Vec<BenchFrames>, Vec<(usize, String)>), BenchError> {
    use crate::gpu::Error as E;
    let mut drawn: Vec<BenchFrames> = vec![Vec::new(); lines.len()];
    let mut refused: Vec<(usize, String)> = Vec::new();
    let mut order: Vec<usize> = (0..lines.len()).collect();
    // The first view goes before once and does not count: shaders are compiled and lists grow.
    for (round, view) in std::iter::once(&views[0]).chain(views).enumerate() {
        for &i in &order {
            if progress.is_cancelled() {
                return Err(BenchError::Cancelled);
            }
            let is_skipped = round > 0 && !(round - 1).is_multiple_of(rarity(views.len()));
            if (lines[i].is_rare || !is_full) && is_skipped || refused.iter().any(|r| r.0 == i) {
                continue;
            }
            match engine.draw(view, &lines[i].settings) {
                Ok(times) if round > 0 => drawn[i].push((round - 1, times)),
                Ok(_) => {}
                Err(why @ (E::Unsupported { .. } | E::Limit { .. })) => {
                    refused.push((i, why.to_string()));
                }
                Err(error) => return Err(error.into()),
            }
            progress.advance(1);
        }
        order.reverse();
    }
    Ok((drawn, refused))
}

/// What is rare is drawn from one in so many views; where there are few, from each: one ratio alone would be that of a moment.
fn rarity(views: usize) -> usize {
    match views {
        ..9 => 1,
        _ => RARE,
    }
}

/// The median of the ratios of two lines in the views that both have; `None` where there is none.
fn faster(slow: &BenchFrames, fast: &BenchFrames) -> Option<f64> {
    let ratios: Vec<f64> = fast
        .iter()
        .filter_map(|(view, times)| {
            let same = slow.iter().find(|(other, _)| other == view)?;
            (times.frame_ms > 0.0).then(|| same.1.frame_ms / times.frame_ms)
        })
        .collect();
    (!ratios.is_empty()).then(|| ValueDistribution::of(&ratios).median)
}

/// Frame, stages, passes and counts of a line.
fn describe(
    place: &BenchPlace,
    line: &BenchLine,
    frames: &BenchFrames,
    roofs: Option<[f64; 2]>,
    figures: &mut Vec<BenchFigure>,
) {
    let Some(roofs) = roofs else { return };
    let values = |of: &dyn Fn(&FrameTimes) -> f64| -> Vec<f64> {
        frames.iter().map(|(_, times)| of(times)).collect()
    };
    let figure = |name: &str, values: &[f64], unit| {
        BenchFigure::median(PART, place, &line.name, name, values, unit)
    };
    let frame = figure("frame", &values(&|t| t.frame_ms), "ms").roofs(roofs);
    figures.push(frame);
    for stage in FrameStage::ALL {
        figures.push(figure(stage.name(), &values(&|t| t.of(stage)), "ms").detail());
    }
    for name in pass_names(frames.iter().map(|(_, times)| times)) {
        let ms = values(&|t| pass_ms(t, name).unwrap_or_default());
        figures.push(figure(&format!("pass {name}"), &ms, "ms").detail());
    }
    for (name, of) in [
        (
            "nodes visited",
            &(|t: &FrameTimes| t.counts.nodes_visited) as &dyn Fn(&FrameTimes) -> u64,
        ),
        ("splats", &|t| t.counts.splats),
        ("triangles drawn", &|t| t.counts.triangles),
        ("bytes of draw lists", &|t| t.counts.draw_list_bytes),
    ] {
        let counts = values(&|t| of(t) as f64);
        figures.push(figure(name, &counts, "").detail());
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failing test panics")]

    use super::*;
    use crate::generate::{self, GeneratedShape, ShapeSpec};
    use crate::progress::SilentProgress;
    use crate::render::PictureOutputs;
    use crate::render::engine::Backend;
    use crate::tree::{self, BuildOptions};

    #[test]
    fn ratios_are_those_of_the_same_views() {
        let frame = |view, frame_ms| {
            let times = FrameTimes {
                frame_ms,
                ..FrameTimes::default()
            };
            (view, times)
        };
        let slow = vec![frame(0, 100.0), frame(3, 300.0), frame(6, 50.0)];
        let fast = vec![
            frame(0, 10.0),
            frame(1, 1.0),
            frame(3, 10.0),
            frame(6, 10.0),
        ];
        // 10, 30 and 5; view 1 has no partner.
        assert_eq!(faster(&slow, &fast), Some(10.0));
        assert_eq!(faster(&slow, &vec![frame(1, 1.0)]), None);
    }

    #[test]
    fn what_is_rare_is_drawn_from_each_of_few_views() {
        let spec = ShapeSpec::with_triangles(GeneratedShape::Sphere, 1000).unwrap();
        let options = BuildOptions::default();
        let model = tree::build(generate::mesh(&spec), &options, &SilentProgress).unwrap();
        let size = (20, 20);
        let mut engine =
            Engine::new(&Backend::Reference, &model, size, PictureOutputs::default()).unwrap();
        let line = |is_rare| BenchLine {
            name: String::new(),
            settings: Settings::default(),
            is_rare,
        };
        let lines = [line(true), line(false)];
        let mut seen = |count, is_full| {
            let views = views(&model, size, 1.0, count).unwrap();
            let (drawn, _) = draw(&mut engine, &lines, &views, is_full, &SilentProgress).unwrap();
            let of = |frames: &BenchFrames| frames.iter().map(|frame| frame.0).collect::<Vec<_>>();
            [of(&drawn[0]), of(&drawn[1])]
        };
        let all = |count| (0..count).collect::<Vec<usize>>();
        assert_eq!(seen(3, true), [all(3), all(3)]);
        assert_eq!(seen(10, true), [vec![0, 3, 6, 9], all(10)]);
        // Of other sizes everything is rare.
        assert_eq!(seen(10, false), [vec![0, 3, 6, 9], vec![0, 3, 6, 9]]);
    }
}
