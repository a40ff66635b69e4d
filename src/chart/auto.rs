//! Chooses method, splat, path and threshold by a bound: the cheapest that was good enough, or the best that was fast
//! enough, where this device drew models of this class.
//!
//! A [`ChartCalibration`] measures the choices of a quick chart from a few views at three distances, and their errors from
//! other views that the choice does not look at (held views). It is kept in the user's cache folder under a name made of
//! program, device, driver, class of model and size of the picture; what is damaged or of another is ignored and made
//! again.

use super::run::{ChartBench, orbit};
use super::{ChartError, ChartPlan, DrawConfiguration};
use crate::math::camera::View;
use crate::measure::{ValueDistribution, store};
use crate::progress::Progress;
use crate::render::cost::model::DrawCosts;
use crate::render::engine::Backend;
use crate::tree::Model;
use std::path::{Path, PathBuf};

/// What is asked for. With neither, the most accurate is chosen.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ChoiceBounds {
    /// Largest mean FLIP over the picture.
    pub max_error: Option<f64>,
    /// Longest frame, milliseconds.
    pub frame_ms: Option<f64>,
}

/// What a calibration holds for: models of the same kind and of about as many primitives.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CalibrationKey {
    version: String,
    commit: String,
    device: String,
    driver: String,
    /// Power of four of triangles (points of a cloud), rounded down.
    size_class: u32,
    is_closed: bool,
    is_cloud: bool,
    /// Records of error patches are there.
    has_patches: bool,
    width: u32,
    height: u32,
}

/// Errors and time of one choice at one distance.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct CalibrationEntry {
    method: String,
    splat: String,
    path: String,
    threshold_px: f32,
    fill: f64,
    frame_ms: f64,
    /// Mean FLIP of each view.
    flip: Vec<f64>,
    /// Mean FLIP of each held view.
    held: Vec<f64>,
}

impl CalibrationEntry {
    fn choice(&self) -> Option<DrawConfiguration> {
        DrawConfiguration::of_words(&self.method, &self.splat, &self.path, self.threshold_px)
    }

    fn worst(&self) -> f64 {
        self.flip.iter().copied().fold(0.0, f64::max)
    }
}

/// What a device made of the choices for a class of models.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChartCalibration {
    key: CalibrationKey,
    /// The model that was measured.
    model: String,
    entries: Vec<CalibrationEntry>,
}

/// What was chosen, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct ChosenConfiguration {
    /// The choice.
    pub choice: DrawConfiguration,
    /// Whether it met the bounds where it was calibrated.
    pub is_met: bool,
    /// Largest mean FLIP of the calibrated views.
    pub flip: f64,
    /// Time of its frame there, milliseconds.
    pub frame_ms: f64,
    /// Held views above the bound, and all of them; `None` without a bound on the error.
    pub misses: Option<[usize; 2]>,
    /// The distances it was judged at.
    pub fills: Vec<f64>,
}

/// Views that choose, and held views that check.
const VIEWS: u32 = 2;
const HELD: u32 = 2;
/// A choice has to keep this much of the error's bound free: views differ.
const SLACK: f64 = 0.9;

impl CalibrationKey {
    /// Key of a model on a device, in pictures of one size.
    pub fn of(backend: &Backend, model: &Model, (width, height): (u32, u32)) -> Self {
        let primitives = model.tree.leaves.len().max(1);
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: crate::measure::COMMIT.into(),
            device: backend.name().into(),
            driver: backend
                .device()
                .map_or_else(String::new, |gpu| gpu.info().driver.clone()),
            size_class: primitives.ilog2() / 2,
            is_closed: model.is_closed,
            is_cloud: model.kind().is_points(),
            has_patches: model.patches.is_some(),
            width,
            height,
        }
    }

    /// The file of its calibration in a folder.
    pub fn path(&self, folder: &Path) -> PathBuf {
        store::path(folder, "calibration", self)
    }
}

impl ChartCalibration {
    /// Reads one; `None` where there is none, or it is damaged, or of another key.
    pub fn read(folder: &Path, key: &CalibrationKey) -> Option<Self> {
        let found: Self = store::read(&key.path(folder))?;
        let is_whole = |e: &CalibrationEntry| {
            let is_error = |v: &f64| (0.0..=1.0).contains(v);
            e.choice().is_some()
                && e.frame_ms > 0.0
                && e.fill > 0.0
                && e.flip.len() == VIEWS as usize
                && e.held.len() == HELD as usize
                && e.flip.iter().chain(&e.held).all(is_error)
        };
        (found.key == *key && !found.entries.is_empty() && found.entries.iter().all(is_whole))
            .then_some(found)
    }

    /// Writes it beside its place and renames it.
    ///
    /// # Errors
    /// When the folder cannot be made or the file not be written.
    pub fn write(&self, folder: &Path) -> Result<(), ChartError> {
        Ok(store::write(&self.key.path(folder), self)?)
    }

    /// Measures the choices for a model: minutes on a software device for a million triangles. With the `costs` of the
    /// device its choices of [`Path::Auto`](crate::render::Path::Auto) are drawn as they will be.
    ///
    /// # Errors
    /// When a picture cannot be drawn, or `progress` is cancelled.
    pub fn measure(
        backend: &Backend,
        model: &Model,
        name: &str,
        (size, costs): ((u32, u32), Option<DrawCosts>),
        progress: &dyn Progress,
    ) -> Result<Self, ChartError> {
        let plan = ChartPlan {
            size,
            views: VIEWS,
            repeats: 3,
            ..ChartPlan::quick()
        };
        let choices = plan.choices(model, backend);
        let mut bench = ChartBench::new(backend, model, size)?;
        bench.set_costs(costs);
        let samples = u64::from(plan.grid * plan.grid);
        let per_view = samples + choices.len() as u64;
        let timed = (choices.len() * plan.repeats as usize) as u64;
        let fills = plan.fills.len() as u64;
        progress.stage(
            "calibrate",
            fills * (u64::from(VIEWS + HELD) * per_view + u64::from(VIEWS) * timed),
        );
        let mut entries = Vec::new();
        for &fill in &plan.fills {
            let mut found: Vec<Option<CalibrationEntry>> = choices
                .iter()
                .map(|choice| {
                    let [method, splat, path] = choice.words();
                    Some(CalibrationEntry {
                        method,
                        splat,
                        path,
                        threshold_px: choice.threshold_px,
                        fill,
                        frame_ms: 0.0,
                        flip: Vec::new(),
                        held: Vec::new(),
                    })
                })
                .collect();
            let mut times = vec![Vec::new(); choices.len()];
            // Every other view of the orbit is held.
            for k in 0..VIEWS + HELD {
                let view = orbit(model, size, fill, k, VIEWS + HELD)?;
                let reference = bench.reference(&view, plan.grid, progress)?;
                for (entry, choice) in found.iter_mut().zip(&choices) {
                    if progress.is_cancelled() {
                        return Err(ChartError::Cancelled);
                    }
                    progress.advance(1);
                    let Some(some) = entry else { continue };
                    match bench.errors(&view, choice, &reference)? {
                        Ok(errors) if k % 2 == 0 => some.flip.push(errors.flip),
                        Ok(errors) => some.held.push(errors.flip),
                        // What is refused once cannot be chosen.
                        Err(_) => *entry = None,
                    }
                }
                if k % 2 == 0 {
                    let kept: Vec<usize> =
                        (0..choices.len()).filter(|i| found[*i].is_some()).collect();
                    let of_kept: Vec<DrawConfiguration> =
                        kept.iter().map(|&i| choices[i]).collect();
                    let measured = bench.times(&view, &of_kept, plan.repeats, progress)?;
                    for (i, frames) in kept.into_iter().zip(measured) {
                        times[i].extend(frames.iter().map(|f| f.frame_ms));
                    }
                }
            }
            for (entry, times) in found.into_iter().zip(times) {
                if let Some(mut entry) = entry {
                    entry.frame_ms = ValueDistribution::of(&times).median;
                    entries.push(entry);
                }
            }
        }
        Ok(Self {
            key: CalibrationKey::of(backend, model, size),
            model: name.to_owned(),
            entries,
        })
    }

    /// Name of the model that was measured.
    pub fn model(&self) -> &str {
        &self.model
    }

    /// The calibrated distances to judge a fill by: the two around it, or the nearest where it lies beyond them all.
    fn fills_around(&self, fill: f64) -> Vec<f64> {
        let mut fills: Vec<f64> = self.entries.iter().map(|e| e.fill).collect();
        fills.sort_by(f64::total_cmp);
        fills.dedup();
        // What is within a hundredth of one is that one.
        if let Some(same) = fills.iter().find(|f| (fill / **f - 1.0).abs() < 0.01) {
            return vec![*same];
        }
        let below = fills.iter().copied().rfind(|f| *f <= fill);
        let above = fills.iter().copied().find(|f| *f >= fill);
        let mut around: Vec<f64> = below.into_iter().chain(above).collect();
        around.dedup();
        around
    }

    /// Chooses for a picture in which the bounding sphere fills `fill`: of what keeps all bounds at the calibrated
    /// distances around it the cheapest (by frame alone: the most accurate). Where nothing keeps them, the most accurate
    /// that is fast enough, or else the fastest. `None` of an empty calibration.
    pub fn choose(&self, bounds: &ChoiceBounds, fill: f64) -> Option<ChosenConfiguration> {
        let fills = self.fills_around(fill);
        let mut candidates: Vec<ChosenConfiguration> = Vec::new();
        for entry in self.entries.iter().filter(|e| fills.contains(&e.fill)) {
            let choice = entry.choice()?;
            let held = bounds.max_error.map(|bound| {
                [
                    entry.held.iter().filter(|e| **e > bound).count(),
                    entry.held.len(),
                ]
            });
            match candidates.iter_mut().find(|c| c.choice == choice) {
                // Of two distances the worse counts.
                Some(c) => {
                    c.flip = c.flip.max(entry.worst());
                    c.frame_ms = c.frame_ms.max(entry.frame_ms);
                    c.misses = match (c.misses, held) {
                        (Some([a, n]), Some([b, m])) => Some([a + b, n + m]),
                        _ => None,
                    };
                    c.fills.push(entry.fill);
                }
                None => candidates.push(ChosenConfiguration {
                    choice,
                    is_met: false,
                    flip: entry.worst(),
                    frame_ms: entry.frame_ms,
                    misses: held,
                    fills: vec![entry.fill],
                }),
            }
        }
        // A choice that one of the distances refused is none.
        candidates.retain(|c| c.fills.len() == fills.len());
        let is_accurate =
            |c: &ChosenConfiguration| bounds.max_error.is_none_or(|e| c.flip <= SLACK * e);
        let is_fast = |c: &ChosenConfiguration| bounds.frame_ms.is_none_or(|ms| c.frame_ms <= ms);
        let by_time = |a: &&ChosenConfiguration, b: &&ChosenConfiguration| {
            a.frame_ms
                .total_cmp(&b.frame_ms)
                .then(a.flip.total_cmp(&b.flip))
        };
        let by_error = |a: &&ChosenConfiguration, b: &&ChosenConfiguration| {
            a.flip
                .total_cmp(&b.flip)
                .then(a.frame_ms.total_cmp(&b.frame_ms))
        };
        let good = candidates.iter().filter(|c| is_accurate(c) && is_fast(c));
        let best = if bounds.max_error.is_some() {
            good.min_by(by_time)
        } else {
            good.min_by(by_error)
        };
        if let Some(best) = best {
            return Some(ChosenConfiguration {
                is_met: true,
                ..best.clone()
            });
        }
        candidates
            .iter()
            .filter(|c| is_fast(c))
            .min_by(by_error)
            .or_else(|| candidates.iter().min_by(by_time))
            .cloned()
    }
}

/// Projected diameter of a model's bounding sphere over the shorter side of the picture; infinite from within.
pub fn fill_of(model: &Model, view: &View) -> f64 {
    let center = view
        .view_from_model
        .transform_point3(model.orbit_center)
        .as_dvec3();
    let radius = f64::from(model.orbit_radius) * f64::from(view.model_scale);
    // Half the shorter side of the picture at distance 1.
    let side = f64::from(view.width.min(view.height)) / 2.0 / f64::from(view.focal_px());
    let distance = center.length();
    if !view.is_perspective {
        return radius / side;
    }
    if distance <= radius {
        return f64::INFINITY;
    }
    (radius / distance).asin().tan() / side
}

#[allow(clippy::unwrap_used, reason = "a failing test panics")]
#[cfg(test)]
mod tests {
    use super::super::AvailablePaths;
    use super::*;
    use crate::generate::{GeneratedShape, ShapeSpec};
    use crate::progress::SilentProgress;
    use crate::tree;

    fn model() -> Model {
        let spec = ShapeSpec::with_triangles(GeneratedShape::Statue, 2000).unwrap();
        tree::build(
            crate::generate::mesh(&spec),
            &tree::BuildOptions::default(),
            &SilentProgress,
        )
        .unwrap()
    }

    /// Three choices at two distances.
    fn calibration() -> ChartCalibration {
        let few = DrawConfiguration::few(false, AvailablePaths::NONE);
        let entry = |i: usize, fill: f64, frame_ms: f64, flip: f64, held: [f64; 2]| {
            let [method, splat, path] = few[i].words();
            CalibrationEntry {
                method,
                splat,
                path,
                threshold_px: few[i].threshold_px,
                fill,
                frame_ms,
                flip: vec![flip / 2.0, flip],
                held: held.to_vec(),
            }
        };
        ChartCalibration {
            key: CalibrationKey::of(&Backend::Reference, &model(), (500, 500)),
            model: "m".into(),
            entries: vec![
                entry(0, 1.0, 100.0, 0.001, [0.001, 0.001]),
                entry(0, 0.5, 90.0, 0.0005, [0.001, 0.001]),
                entry(2, 1.0, 20.0, 0.008, [0.007, 0.012]),
                entry(2, 0.5, 10.0, 0.004, [0.003, 0.02]),
                entry(3, 1.0, 5.0, 0.03, [0.03, 0.03]),
                entry(3, 0.5, 2.0, 0.008, [0.004, 0.004]),
            ],
        }
    }

    #[test]
    fn the_cheapest_that_is_good_enough_is_chosen() {
        let c = calibration();
        let few = DrawConfiguration::few(false, AvailablePaths::NONE);
        let choose = |max_error, frame_ms, fill| {
            c.choose(
                &ChoiceBounds {
                    max_error,
                    frame_ms,
                },
                fill,
            )
            .unwrap()
        };
        let found = choose(Some(0.01), None, 1.0);
        assert_eq!((found.choice, found.is_met), (few[2], true));
        // One of the two held views at this distance is above the bound.
        assert_eq!((found.frame_ms, found.misses), (20.0, Some([1, 2])));
        // Farther away less will do; beyond all distances the nearest counts.
        assert_eq!(choose(Some(0.01), None, 0.01).choice, few[3]);
        assert_eq!(choose(Some(0.01), None, f64::INFINITY).choice, few[2]);
        assert_eq!(choose(Some(0.01), None, 0.9999).fills, [1.0]);
        // Between two both count, the worse of each.
        let found = choose(Some(0.01), None, 0.7);
        assert_eq!((found.choice, found.misses), (few[2], Some([2, 4])));
        assert_eq!(found.fills, [1.0, 0.5]);
        // A tenth of the bound is kept free.
        assert_eq!(choose(Some(0.0085), None, 1.0).choice, few[0]);
        // The best that is fast enough.
        assert_eq!(choose(None, Some(30.0), 1.0).choice, few[2]);
        assert_eq!(choose(None, None, 1.0).choice, few[0]);
        // Both: nothing keeps both, so the best that is fast enough, and it is said.
        let found = choose(Some(0.002), Some(30.0), 1.0);
        assert_eq!((found.choice, found.is_met), (few[2], false));
        let found = choose(None, Some(1.0), 1.0);
        assert_eq!((found.choice, found.is_met), (few[3], false));
    }

    #[test]
    fn files_come_back_and_what_is_damaged_or_foreign_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let below = folder.path().join("a/b");
        let c = calibration();
        assert_eq!(ChartCalibration::read(&below, &c.key), None);
        c.write(&below).unwrap();
        assert_eq!(ChartCalibration::read(&below, &c.key).unwrap(), c);
        let path = c.key.path(&below);
        let text = std::fs::read_to_string(&path).unwrap();
        for damage in [
            text[..text.len() / 2].to_owned(),
            String::new(),
            text.replace("\"device\": \"reference\"", "\"device\": \"other\""),
            text.replace("\"pop\"", "\"pup\""),
            text.replace("\"frame_ms\": 100.0", "\"frame_ms\": -1.0"),
            text.replace("\"fill\": 0.5", "\"unknown\": 0.5"),
            text.replace("0.03,", "7.0,"),
        ] {
            assert_ne!(damage, text);
            std::fs::write(&path, &damage).unwrap();
            assert_eq!(ChartCalibration::read(&below, &c.key), None, "{damage}");
        }
        std::fs::write(&path, [0xff, 0x00, 0xfe]).unwrap();
        assert_eq!(ChartCalibration::read(&below, &c.key), None);
        // Another class of models has another file.
        let other = CalibrationKey::of(&Backend::Reference, &model(), (500, 400));
        assert_ne!(other.path(&below), path);
    }

    #[test]
    fn a_small_model_is_calibrated_and_the_fill_is_that_of_the_orbit() {
        let model = model();
        for fill in [1.0, 0.5, 3.0] {
            let camera = model.orbit_camera((300, 200), 0.3, 0.2, fill);
            let found = fill_of(&model, &camera.view(model.origin).unwrap());
            assert!((found - fill).abs() < 1e-4, "{found} {fill}");
        }
        let c = ChartCalibration::measure(
            &Backend::Reference,
            &model,
            "m",
            ((40, 40), None),
            &SilentProgress,
        )
        .unwrap();
        let found = c
            .choose(
                &ChoiceBounds {
                    max_error: Some(1.0),
                    frame_ms: None,
                },
                1.0,
            )
            .unwrap();
        assert!(found.is_met && found.misses == Some([0, 2]));
        let folder = tempfile::tempdir().unwrap();
        c.write(folder.path()).unwrap();
        assert_eq!(ChartCalibration::read(folder.path(), &c.key).unwrap(), c);
    }
}
