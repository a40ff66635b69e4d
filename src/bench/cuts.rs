//! The cut on the processor: visited nodes a second, and what a camera costs that rests or moves.

use super::cases::{self, SIZE, views};
use super::verdict::BenchTarget;
use super::{BenchCase, BenchError, BenchFigure, BenchPlan, BenchSession};
use crate::cut::{Cut, CutSelector};
use crate::progress::Progress;
use crate::render::Settings;
use crate::render::cut_key::cut_settings;
use crate::render::frame_plan::resolve_settings;
use crate::render::stats::KeptWork;
use std::time::Instant;

const PART: &str = "cut";

fn ms(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64() * 1e3
}

/// Visited nodes a second on one thread and on two, in turn, and the frame of a camera that does not move.
///
/// # Errors
/// When a frame cannot be drawn, or `progress` is cancelled.
pub fn figures(
    session: &BenchSession,
    case: &BenchCase<'_>,
    plan: &BenchPlan,
    progress: &dyn Progress,
) -> Result<Vec<BenchFigure>, BenchError> {
    let model = case.model;
    let views = views(model, SIZE, 1.0, plan.views.clamp(1, 12))?;
    let place = case.place(SIZE, 1.0);
    let is_standard = case.standard().is_some();
    let target = |target| is_standard.then_some(target);
    let mut figures = Vec::new();
    progress.stage("cut", 2);
    for threshold_px in [1.0, 3.0] {
        let settings = Settings {
            threshold_px,
            ..Settings::default()
        };
        let mut selectors = [1, 2].map(CutSelector::with_threads);
        let mut cut = Cut::default();
        let mut rates = [vec![], vec![]];
        for round in 0..=2 {
            for view in &views {
                if progress.is_cancelled() {
                    return Err(BenchError::Cancelled);
                }
                let settings = cut_settings(&resolve_settings(&settings, model, view), model);
                for (selector, rates) in selectors.iter_mut().zip(&mut rates) {
                    let time = ms(|| selector.select(model, view, &settings, &mut cut));
                    if round > 0 {
                        rates.push(cut.stats.visited as f64 / time / 1e3);
                    }
                }
            }
        }
        let [one, two] = &rates;
        let visits = format!("{} visits in the last view", cut.stats.visited);
        for (name, rates, bound) in [
            ("visited nodes a second, one thread", one, None),
            (
                "visited nodes a second, two threads",
                two,
                target(BenchTarget::AtLeast(150.0)),
            ),
        ] {
            let line = format!("threshold {threshold_px}");
            let figure = BenchFigure::median(PART, &place, &line, name, rates, "M/s");
            figures.push(figure.target(bound).note(visits.clone()));
        }
        progress.advance(1);
    }
    still(session, case, plan, &mut figures, progress)?;
    moving(case, plan, &mut figures, progress)?;
    Ok(figures)
}

/// The same view again and again, as a viewer at rest asks for it.
fn still(
    session: &BenchSession,
    case: &BenchCase<'_>,
    plan: &BenchPlan,
    figures: &mut Vec<BenchFigure>,
    progress: &dyn Progress,
) -> Result<(), BenchError> {
    let (model, line) = (case.model, cases::default(1.0));
    let place = case.place(SIZE, 1.0);
    let view = views(model, SIZE, 1.0, plan.views.max(1))?[0];
    let mut engine = session.engine(model, SIZE)?;
    // Kept lists, and those of frames that are measured: cut and packing, and all of it.
    let mut found = [(vec![], vec![]), (vec![], vec![])];
    let mut last = KeptWork::Nothing;
    // Each of the ring's draw lists is written once before one can be kept.
    for round in 0..2 * plan.rounds + 2 {
        for (keeps, (lists_ms, frame_ms)) in [true, false].into_iter().zip(&mut found) {
            if progress.is_cancelled() {
                return Err(BenchError::Cancelled);
            }
            engine.keep_lists(keeps);
            let times = engine.draw(&view, &line.settings)?;
            if keeps {
                last = times.kept;
            }
            if round > 1 {
                lists_ms.push(times.cut_ms + times.pack_ms);
                frame_ms.push(times.frame_ms);
            }
        }
    }
    let bound = case.standard().map(|_| BenchTarget::AtMost(0.2));
    let figure = |name, values| BenchFigure::median(PART, &place, &line.name, name, values, "ms");
    let [kept, anew] = &found;
    let kept_lists = figure("still camera, cut and packing", &kept.0).target(bound);
    figures.push(match last {
        KeptWork::Lists => kept_lists,
        _ => kept_lists.note("no list was kept"),
    });
    figures.push(figure("still camera, frame", &kept.1));
    figures.push(figure("the same anew, cut and packing", &anew.0));
    figures.push(figure("the same anew, frame", &anew.1));
    Ok(())
}

/// A camera that goes around the model: its cut from the root, and from the front of the last frame
/// ([`CutTraversal::Coherent`](crate::render::CutTraversal::Coherent)), without what the search for hidden splats takes.
fn moving(
    case: &BenchCase<'_>,
    plan: &BenchPlan,
    figures: &mut Vec<BenchFigure>,
    progress: &dyn Progress,
) -> Result<(), BenchError> {
    let (model, line) = (case.model, cases::default(1.0));
    let place = case.place(SIZE, 1.0);
    for degrees in [0.02, 0.1, 0.5] {
        let mut selectors = [false, true].map(|is_coherent| {
            let mut selector = CutSelector::default();
            selector.set_coherent(is_coherent);
            selector
        });
        let mut cut = Cut::default();
        let mut times = [vec![], vec![]];
        let mut visited = [0; 2];
        // The first frames find the front.
        for frame in 0..=plan.rounds + 3 {
            if progress.is_cancelled() {
                return Err(BenchError::Cancelled);
            }
            let azimuth = f64::to_radians(20.0 + degrees * frame as f64);
            let camera = model.orbit_camera(SIZE, azimuth, f64::to_radians(20.0), 1.0);
            let view = camera.view(model.origin)?;
            let settings = cut_settings(&resolve_settings(&line.settings, model, &view), model);
            let each = selectors.iter_mut().zip(&mut times).zip(&mut visited);
            for ((selector, times), visited) in each {
                let time = ms(|| selector.select(model, &view, &settings, &mut cut));
                *visited = cut.stats.visited;
                if frame > 3 {
                    times.push(time);
                }
            }
        }
        let names = ["cut from the root", "coherent cut"];
        for ((what, times), visited) in names.into_iter().zip(&times).zip(visited) {
            let name = format!("camera moving by {degrees} degrees, {what}");
            let figure = BenchFigure::median(PART, &place, &line.name, &name, times, "ms");
            figures.push(figure.note(format!("{visited} visits in the last view")));
        }
    }
    Ok(())
}
