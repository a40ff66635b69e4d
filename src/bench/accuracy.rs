//! Time against error: the default method, filtered splats and patches, beside rays and simplified meshes at equal footing.
//!
//! The reference is triangles, 16 samples a pixel (in a quick run rays, where they are built in: the same surface, and the
//! same picture but for single pixels on edges). Everything is drawn in turn from the same views.

use super::cases::{self, BenchLine, SIZE, views};
use super::rivals::{self, RayCaster, RivalRenderers};
use super::verdict::{
    BenchTarget, EQUAL_FLIP, ThresholdOffer, at_equal_flip, at_psnr, most_accurate,
};
use super::{BenchCase, BenchError, BenchFigure, BenchPlace, BenchPlan, BenchSession};
use crate::chart::errors::object_flip;
use crate::image::{FloatImage, Image, PictureAccumulator, compare, jittered};
use crate::math::camera::View;
use crate::measure::ValueDistribution;
use crate::progress::Progress;
use crate::render::engine::Engine;
use crate::render::stats::FrameTimes;
use crate::render::{Path, PictureOutputs, Settings};
use crate::tree::Model;
use std::time::Instant;

const PART: &str = "accuracy";
const RAYS: &str = "rays, one a pixel";
/// Note beside times of rays, which docs/PERFORMANCE.md compares with Embree's.
const RAYS_BY: &str = "; by the crate obvhs, which takes about three times as long as Embree";
const CHAIN: &str = "simplified meshes, 1 px";
const CHAIN_BY_COMPUTE: &str = "simplified meshes by compute, 1 px";
const DEFAULT: &str = "default";
/// Ways that are measured beside rivals, in the order of [`BenchPlan::accurate_lines`] without filtered splats: name and rivals.
const BESIDE: [(&str, &[&str]); 4] = [
    (DEFAULT, &[RAYS, CHAIN]),
    ("patches", &[RAYS, CHAIN]),
    ("patches by raster", &[CHAIN]),
    ("patches by compute", &[CHAIN, CHAIN_BY_COMPUTE]),
];

/// One way to draw, measured.
#[derive(Debug, Default)]
struct FoundThreshold {
    name: String,
    ms: Vec<f64>,
    flip: Vec<f64>,
    psnr_db: Vec<f64>,
    /// Of the last frame, where the device drew it.
    times: Option<FrameTimes>,
}

impl FoundThreshold {
    fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            ..Self::default()
        }
    }

    fn judge(&mut self, reference: &FloatImage, picture: &Image) -> Result<(), BenchError> {
        self.flip.push(object_flip(reference, picture)?[0]);
        let difference = compare(reference, picture, 8.0)?;
        self.psnr_db.push(difference.object.psnr_db);
        Ok(())
    }

    /// Draws a frame and judges it; `false` where the device cannot draw it so.
    fn judge_frame(
        &mut self,
        engine: &mut Engine<'_>,
        view: &View,
        settings: &Settings,
        reference: &FloatImage,
    ) -> Result<bool, BenchError> {
        use crate::gpu::Error as E;
        match engine.render(view, settings) {
            Ok(picture) => self.judge(reference, &picture).map(|()| true),
            Err(E::Unsupported { .. } | E::Limit { .. }) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    fn offer(&self) -> ThresholdOffer {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        ThresholdOffer {
            name: self.name.clone(),
            frame_ms: ValueDistribution::of(&self.ms).median,
            flip: mean(&self.flip),
            psnr_db: mean(&self.psnr_db),
        }
    }

    /// What its frame was made of.
    fn cause(&self) -> String {
        self.times.as_ref().map_or_else(String::new, |t| {
            format!(
                "cut {:.1}, packing {:.1}, device {:.1} ms for {} splats and {} triangles",
                t.cut_ms, t.pack_ms, t.wait_ms, t.counts.splats, t.counts.triangles
            )
        })
    }
}

/// Measures a model from every distance.
///
/// # Errors
/// When a picture cannot be drawn, or `progress` is cancelled.
pub fn figures(
    session: &BenchSession,
    case: &BenchCase<'_>,
    plan: &BenchPlan,
    progress: &dyn Progress,
) -> Result<Vec<BenchFigure>, BenchError> {
    let model = case.model;
    let rivals = RivalRenderers::build(model, progress)?;
    let mut figures = Vec::new();
    let place = case.place((0, 0), 0.0);
    for (line, name, ms) in [
        (RAYS, "building the hierarchy", rivals.caster_build_ms),
        (CHAIN, "building the chain", rivals.chain_build_ms),
    ] {
        if rivals::ARE_BUILT_IN {
            figures.push(BenchFigure::new(PART, &place, line, name, ms / 1e3, "s"));
        }
    }
    let mut engine = session.engine(model, SIZE)?;
    let [default, filtered, patches, raster, compute] = plan.accurate_lines();
    let mut lines = vec![cases::triangles()];
    for of in [&default, &filtered, &patches, &raster, &compute] {
        lines.extend(of.iter().cloned());
    }
    let frames = u64::from(plan.grid * plan.grid) + plan.rounds as u64;
    let all = plan.fills.len() as u64 * u64::from(plan.error_views) * frames;
    progress.stage(&format!("errors of {}", case.name), all);
    for &fill in &plan.fills {
        let place = case.place(SIZE, fill);
        let views = views(model, SIZE, fill, plan.error_views.max(1))?;
        let coarse = coarse_model(model, &rivals, &views[0])?;
        let mut found = at_distance(
            (&mut engine, &coarse, session),
            &lines,
            &rivals,
            plan,
            &views,
            progress,
        )?;
        found.retain(|f| !f.ms.is_empty());
        describe(&place, &found, &mut figures);
        let of = |lines: &[BenchLine]| -> Vec<&FoundThreshold> {
            let is_of = |f: &&FoundThreshold| lines.iter().any(|l| l.name == f.name);
            found.iter().filter(is_of).collect()
        };
        for ((line, names), own) in BESIDE.iter().zip([&default, &patches, &raster, &compute]) {
            for name in *names {
                let rival = found.iter().find(|f| f.name == *name);
                figures.push(beside(case, &place, (line, &of(own)), rival, name));
            }
        }
        if let Some((db, target)) = case.filtered_target(fill) {
            let offers: Vec<ThresholdOffer> = of(&filtered).iter().map(|f| f.offer()).collect();
            figures.push(in_time(&place, &offers, db).target(Some(target)));
        }
    }
    Ok(figures)
}

/// The level of the chain for a view, as a model; `None` where there is no chain.
fn coarse_model(
    model: &Model,
    rivals: &RivalRenderers<'_>,
    view: &View,
) -> Result<Option<Model>, BenchError> {
    let errors: Vec<f32> = rivals.chain.iter().map(|l| l.error).collect();
    let level = rivals.chain.get(rivals::level_for(&errors, model, view));
    level.map(|level| rivals::model(model, level)).transpose()
}

/// Errors and times of everything from one distance.
fn at_distance(
    (engine, coarse, session): (&mut Engine<'_>, &Option<Model>, &BenchSession),
    lines: &[BenchLine],
    rivals: &RivalRenderers<'_>,
    plan: &BenchPlan,
    views: &[View],
    progress: &dyn Progress,
) -> Result<Vec<FoundThreshold>, BenchError> {
    let plain = cases::triangles().settings;
    let mut coarse = match coarse {
        Some(model) => Some(Engine::new(
            &session.backend,
            model,
            SIZE,
            PictureOutputs::default(),
        )?),
        None => None,
    };
    let mut found: Vec<FoundThreshold> =
        lines.iter().map(|l| FoundThreshold::new(&l.name)).collect();
    let mut rays = FoundThreshold::new(RAYS);
    let mut chain = [(CHAIN, Path::Raster), (CHAIN_BY_COMPUTE, Path::Compute)]
        .map(|(name, path)| (FoundThreshold::new(name), cases::triangles_by(path), true));
    let mut refused = vec![false; lines.len()];
    for view in views {
        if progress.is_cancelled() {
            return Err(BenchError::Cancelled);
        }
        let reference = match &rivals.caster {
            Some(caster) if plan.has_ray_reference => by_rays(caster.as_ref(), view, plan.grid)?,
            _ => engine.supersample(view, &plain, plan.grid)?,
        };
        progress.advance(u64::from(plan.grid * plan.grid));
        for ((line, found), refused) in lines.iter().zip(&mut found).zip(&mut refused) {
            *refused |= !found.judge_frame(engine, view, &line.settings, &reference)?;
        }
        if let Some(caster) = &rivals.caster {
            rays.judge(&reference, &caster.draw(view))?;
        }
        if let Some(engine) = &mut coarse {
            for (found, settings, is_drawn) in &mut chain {
                *is_drawn &= found.judge_frame(engine, view, settings, &reference)?;
            }
        }
        for round in 0..plan.rounds {
            if progress.is_cancelled() {
                return Err(BenchError::Cancelled);
            }
            for ((line, found), refused) in lines.iter().zip(&mut found).zip(&refused) {
                // Every frame of plain triangles is alike, and slow.
                if *refused || (line.is_rare && round > 1) {
                    continue;
                }
                let times = engine.draw(view, &line.settings)?;
                found.ms.push(times.frame_ms);
                found.times = Some(times);
            }
            if let Some(caster) = &rivals.caster {
                let start = Instant::now();
                std::hint::black_box(caster.draw(view));
                rays.ms.push(start.elapsed().as_secs_f64() * 1e3);
            }
            if let Some(engine) = &mut coarse {
                for (found, settings, _) in chain.iter_mut().filter(|(.., is_drawn)| *is_drawn) {
                    let times = engine.draw(view, settings)?;
                    found.ms.push(times.frame_ms);
                    found.times = Some(times);
                }
            }
            progress.advance(1);
        }
    }
    found.push(rays);
    found.extend(chain.map(|(found, ..)| found));
    Ok(found)
}

/// The mean of `grid` x `grid` rays a pixel, at the places where [`Engine::supersample`] has its samples.
fn by_rays(caster: &dyn RayCaster, view: &View, grid: u32) -> Result<FloatImage, BenchError> {
    let mut mean = PictureAccumulator::new();
    for i in 0..grid * grid {
        mean.add(&caster.draw(&jittered(view, i, grid)))?;
    }
    Ok(mean.mean())
}

fn describe(place: &BenchPlace, found: &[FoundThreshold], figures: &mut Vec<BenchFigure>) {
    for found in found {
        let offer = found.offer();
        let line = &found.name;
        let by = if *line == RAYS { RAYS_BY } else { "" };
        let note = format!(
            "mean FLIP {:.5}, PSNR over object pixels {:.1} dB{by}",
            offer.flip, offer.psnr_db
        );
        figures.push(BenchFigure::median(PART, place, line, "frame", &found.ms, "ms").note(note));
        figures.push(BenchFigure::new(PART, place, line, "mean FLIP", offer.flip, "").detail());
        let psnr = BenchFigure::new(
            PART,
            place,
            line,
            "PSNR over object pixels",
            offer.psnr_db,
            "dB",
        );
        figures.push(psnr.detail());
    }
}

/// Factor by which a way to draw is faster than a rival, with a threshold or tolerances at which it is as close to the reference.
fn beside(
    case: &BenchCase<'_>,
    place: &BenchPlace,
    (line, own): (&str, &[&FoundThreshold]),
    rival: Option<&FoundThreshold>,
    name: &str,
) -> BenchFigure {
    let is_rays = name == RAYS;
    // From a million triangles up the default method has to be ahead of rays.
    let has_target = is_rays && line == DEFAULT && case.model.triangles.len() >= 1_000_000;
    let target = has_target.then_some(BenchTarget::AtLeast(1.0));
    let figure_name = format!("times faster than {name} at equal FLIP");
    if own.is_empty() {
        let why = "the device cannot draw it so";
        return BenchFigure::absent(PART, place, line, &figure_name, "x", why).target(target);
    }
    let Some(rival) = rival else {
        let why = if rivals::ARE_BUILT_IN {
            "it drew nothing"
        } else {
            "this build is without the feature rivals"
        };
        return BenchFigure::absent(PART, place, line, &figure_name, "x", why).target(target);
    };
    let offers: Vec<ThresholdOffer> = own.iter().map(|f| f.offer()).collect();
    let against = rival.offer();
    let Some(best) = at_equal_flip(&offers, &against) else {
        let nearest = most_accurate(&offers).map_or_else(String::new, |o| {
            format!(
                "; the closest, {}, has {:.5} in {:.1} ms",
                o.name, o.flip, o.frame_ms
            )
        });
        let note = format!(
            "nothing of it comes to its mean FLIP of {:.5} in {:.1} ms{nearest}",
            against.flip, against.frame_ms
        );
        return BenchFigure::new(PART, place, line, &figure_name, 0.0, "x")
            .target(target)
            .note(note);
    };
    let times = against.frame_ms / best.frame_ms;
    let cause = own
        .iter()
        .find(|f| f.name == best.name)
        .map_or_else(String::new, |f| f.cause());
    let mut note = format!(
        "{}: {:.1} ms, FLIP {:.5}; {name}: {:.1} ms, FLIP {:.5}; equal within {:.0} %",
        best.name,
        best.frame_ms,
        best.flip,
        against.frame_ms,
        against.flip,
        100.0 * EQUAL_FLIP
    );
    if times < 1.0 {
        note += &format!("; ahead because here {cause}");
        if !is_rays {
            note += &format!(", there {}", rival.cause());
        }
    }
    BenchFigure::new(PART, place, line, &figure_name, times, "x")
        .target(target)
        .note(note)
}

/// The time of the fastest filtered splats that are as accurate as asked.
fn in_time(place: &BenchPlace, offers: &[ThresholdOffer], least_db: f64) -> BenchFigure {
    let name = format!("frame of at least {least_db} dB over object pixels");
    match at_psnr(offers, least_db) {
        Some(best) => BenchFigure::new(PART, place, "pop filtered", &name, best.frame_ms, "ms")
            .note(format!("{}: {:.1} dB", best.name, best.psnr_db)),
        None => {
            let best = offers
                .iter()
                .map(|o| o.psnr_db)
                .fold(f64::NEG_INFINITY, f64::max);
            let why = format!("no threshold comes to it: at most {best:.1} dB");
            // An infinite time misses every bound.
            BenchFigure::new(PART, place, "pop filtered", &name, f64::INFINITY, "ms").note(why)
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::super::verdict::BenchVerdict;
    use super::*;
    use crate::generate::{self, GeneratedShape, ShapeSpec};
    use crate::progress::SilentProgress;
    use crate::tree::{self, BuildOptions};

    fn found(name: &str, ms: f64, flip: f64, psnr_db: f64) -> FoundThreshold {
        FoundThreshold {
            name: name.into(),
            ms: vec![ms],
            flip: vec![flip],
            psnr_db: vec![psnr_db],
            times: Some(FrameTimes::default()),
        }
    }

    #[test]
    fn ahead_behind_and_out_of_reach() {
        let spec = ShapeSpec::with_triangles(GeneratedShape::Square, 2).unwrap();
        let model = tree::build(
            generate::mesh(&spec),
            &BuildOptions::default(),
            &SilentProgress,
        )
        .unwrap();
        let case = BenchCase {
            name: "square",
            model: &model,
        };
        let place = case.place(SIZE, 1.0);
        let fine = found("default, 1 px", 20.0, 0.0101, 30.0);
        let coarse = found("default, 3 px", 5.0, 0.05, 20.0);
        let default = [&fine, &coarse];
        let beside = |ms, flip, name| {
            let rival = found(name, ms, flip, 26.0);
            super::beside(&case, &place, (DEFAULT, &default), Some(&rival), name)
        };
        let ahead = beside(40.0, 0.01, RAYS);
        assert_eq!(ahead.value, 2.0);
        assert!(
            ahead.note.contains("default, 1 px: 20.0 ms") && !ahead.note.contains("ahead because")
        );
        let behind = beside(10.0, 0.01, CHAIN);
        assert_eq!(behind.value, 0.5);
        assert!(
            behind.note.contains("ahead because here cut 0.0"),
            "{}",
            behind.note
        );
        let out_of_reach = beside(10.0, 0.001, CHAIN);
        assert_eq!(out_of_reach.value, 0.0);
        assert!(
            out_of_reach
                .note
                .contains("the closest, default, 1 px, has 0.01010")
        );
        // No target: the model is small.
        assert_eq!(ahead.verdict(), BenchVerdict::None);
        let none = super::beside(&case, &place, (DEFAULT, &default), None, RAYS);
        assert_eq!(none.verdict(), BenchVerdict::Absent);
        let rival = found(CHAIN, 1.0, 0.01, 26.0);
        let refused = super::beside(&case, &place, (DEFAULT, &[]), Some(&rival), CHAIN);
        assert_eq!(refused.verdict(), BenchVerdict::Absent);
    }

    #[test]
    fn accuracy_that_is_not_reached_is_a_miss() {
        let offers = [
            found("a", 20.0, 0.01, 31.0).offer(),
            found("b", 9.0, 0.02, 29.0).offer(),
        ];
        let target = Some(BenchTarget::AtMost(15.0));
        let verdict = |db| {
            in_time(&BenchPlace::default(), &offers, db)
                .target(target)
                .verdict()
        };
        assert_eq!(verdict(28.0), BenchVerdict::Pass);
        assert_eq!(verdict(30.0), BenchVerdict::Miss);
        assert_eq!(verdict(40.0), BenchVerdict::Miss);
    }
}
