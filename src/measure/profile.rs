//! The frame profiler: draws views, and says what each pass and each stage cost, what was counted, what measuring
//! itself cost, and whether the figures can be believed.
//!
//! Every view is drawn twice, with timestamps and without, one first and then the other in turn, so that a machine
//! that becomes slower meanwhile does so for both. Counters come last, in frames of their own that nobody times.

use super::frames::pass_names;
use crate::gpu::Gpu;
use crate::gpu::clock::ClockAnchor;
use crate::gpu::device::DeviceInfo;
use crate::gpu::frame::{FrameMeasure, PassCounters};
use crate::gpu::profile::{CounterTest, SelfTest, counter_test, self_test};
use crate::math::camera::View;
use crate::progress::Progress;
use crate::projective::frame_photos::FramePhotos;
use crate::render::Settings;
use crate::render::engine::{Backend, Engine};
use crate::render::stats::FrameTimes;
use std::sync::Arc;

/// Why there is no profile.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProfileError {
    /// A frame could not be drawn.
    #[error(transparent)]
    Gpu(#[from] crate::gpu::Error),
    /// Somebody cancelled.
    #[error("cancelled after {0} frames")]
    Cancelled(usize),
}

/// What is to be measured.
#[derive(Debug, Clone, Copy)]
pub struct ProfilePlan<'a> {
    /// The views, all of the size that the engine was made for.
    pub views: &'a [View],
    /// How they are drawn.
    pub settings: &'a Settings,
    /// Photographs of each view, where settings show any; else empty.
    pub photos: &'a [Arc<FramePhotos>],
    /// Frames of the first view that go before, of each kind, and do not count.
    pub warm_up: u32,
}

impl ProfilePlan<'_> {
    /// Puts the photographs of a view on the surface, where there are any.
    fn show_photos(&self, engine: &mut Engine<'_>, view: usize) -> Result<(), crate::gpu::Error> {
        match self.photos.get(view) {
            Some(photos) => engine.set_photos(Some(photos.clone())),
            None => Ok(()),
        }
    }
}

/// One view, measured.
#[derive(Debug, Clone)]
pub struct ProfileSample {
    /// The frame with timestamps.
    pub times: FrameTimes,
    /// The same frame without any, milliseconds; `None` where there are none to leave out.
    pub plain_ms: Option<f64>,
    /// Both clocks, read right after the frame; `None` where the device cannot.
    pub anchor: Option<ClockAnchor>,
    /// What each pass counted in a third frame; counters that the device does not count exactly may be in it.
    pub counters: Vec<PassCounters>,
    /// Pixels that something was drawn to.
    pub covered_pixels: u64,
}

/// What of a device's figures can be believed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ProfileProof {
    /// Whether pass times can be; `None` without timestamps.
    pub self_test: Option<SelfTest>,
    /// Which counters can be; `None` for the mirror.
    pub counter_test: Option<CounterTest>,
}

/// Times that the self-test is run until it agrees: other work on the machine can make it fail.
const SELF_TESTS: usize = 3;

impl ProfileProof {
    /// Tests what draws on `backend`. Takes a second or a few on a software device.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn of(backend: &Backend) -> Result<Self, crate::gpu::Error> {
        let Some(gpu) = backend.device() else {
            return Ok(Self::default());
        };
        let mut proof = Self {
            self_test: None,
            counter_test: Some(counter_test(gpu)?),
        };
        if gpu.info().timestamp_period_ns > 0.0 {
            for _ in 0..SELF_TESTS {
                let report = self_test(gpu)?;
                let agrees = report.agrees;
                proof.self_test = Some(report);
                if agrees {
                    break;
                }
            }
        }
        Ok(proof)
    }
}

/// A run of the profiler.
#[derive(Debug, Clone)]
pub struct FrameProfile {
    /// The views, in order.
    pub samples: Vec<ProfileSample>,
    /// The device; `None` for the mirror.
    pub device: Option<DeviceInfo>,
    /// What of it can be believed.
    pub proof: ProfileProof,
    /// Live allocations of the device while it drew, largest first: name and bytes.
    pub memory: Vec<(String, u64)>,
    /// Pixels of the picture.
    pub picture_pixels: u64,
}

impl FrameProfile {
    /// Draws the views and measures them. `engine` draws on `backend`, of which `proof` says what can be believed;
    /// counters without proof are not reported.
    ///
    /// # Errors
    /// When a frame cannot be drawn, or `progress` is cancelled.
    pub fn run(
        backend: &Backend,
        engine: &mut Engine<'_>,
        plan: &ProfilePlan<'_>,
        proof: ProfileProof,
        progress: &dyn Progress,
    ) -> Result<Self, ProfileError> {
        let gpu = backend.device();
        let has_timestamps = gpu.is_some_and(|g| g.info().timestamp_period_ns > 0.0);
        let mut profile = Self {
            samples: Vec::with_capacity(plan.views.len()),
            device: gpu.map(|g| g.info().clone()),
            proof,
            memory: Vec::new(),
            picture_pixels: plan
                .views
                .first()
                .map_or(0, |v| u64::from(v.width) * u64::from(v.height)),
        };
        profile.time(engine, plan, gpu.filter(|_| has_timestamps), progress)?;
        if let Some(gpu) = gpu {
            profile.memory = gpu.memory_report();
        }
        profile.count(engine, plan, progress)?;
        engine.measure(FrameMeasure::default())?;
        Ok(profile)
    }

    /// With `gpu`, a device with timestamps, each view is drawn with them and without.
    fn time(
        &mut self,
        engine: &mut Engine<'_>,
        plan: &ProfilePlan<'_>,
        gpu: Option<&Arc<Gpu>>,
        progress: &dyn Progress,
    ) -> Result<(), ProfileError> {
        let ProfilePlan {
            views,
            settings,
            warm_up,
            ..
        } = *plan;
        let timed = FrameMeasure {
            passes: true,
            frame: true,
            counters: false,
        };
        let plain = FrameMeasure::default();
        progress.stage("time", views.len() as u64);
        if let Some(view) = views.first() {
            plan.show_photos(engine, 0)?;
            for measure in [timed, plain] {
                engine.measure(measure)?;
                for _ in 0..warm_up {
                    if progress.is_cancelled() {
                        return Err(ProfileError::Cancelled(0));
                    }
                    engine.draw(view, settings)?;
                }
            }
        }
        for (index, view) in views.iter().enumerate() {
            if progress.is_cancelled() {
                return Err(ProfileError::Cancelled(index));
            }
            let mut sample = ProfileSample {
                times: FrameTimes::default(),
                plain_ms: None,
                anchor: None,
                counters: Vec::new(),
                covered_pixels: 0,
            };
            plan.show_photos(engine, index)?;
            let mut order = [timed, plain];
            // Whoever goes second finds the caches warm.
            if index % 2 == 1 {
                order.reverse();
            }
            for measure in order {
                if measure == timed {
                    engine.measure(measure)?;
                    sample.times = engine.draw(view, settings)?;
                    sample.anchor = gpu.map(|g| g.anchor()).transpose()?.flatten();
                } else if gpu.is_some() {
                    engine.measure(measure)?;
                    sample.plain_ms = Some(engine.draw(view, settings)?.frame_ms);
                }
            }
            self.samples.push(sample);
            progress.advance(1);
        }
        Ok(())
    }

    fn count(
        &mut self,
        engine: &mut Engine<'_>,
        plan: &ProfilePlan<'_>,
        progress: &dyn Progress,
    ) -> Result<(), ProfileError> {
        let ProfilePlan {
            views, settings, ..
        } = *plan;
        progress.stage("count", views.len() as u64);
        engine.measure(FrameMeasure {
            counters: true,
            ..FrameMeasure::default()
        })?;
        for (index, (view, sample)) in views.iter().zip(&mut self.samples).enumerate() {
            if progress.is_cancelled() {
                return Err(ProfileError::Cancelled(index));
            }
            plan.show_photos(engine, index)?;
            sample.counters = engine.draw(view, settings)?.counters;
            let image = engine.read(view)?;
            let covered = image.color.iter().filter(|c| c[3] > 0).count();
            sample.covered_pixels = covered as u64;
            progress.advance(1);
        }
        Ok(())
    }

    /// The frames with timestamps.
    pub fn frames(&self) -> impl Iterator<Item = &FrameTimes> + Clone {
        self.samples.iter().map(|s| &s.times)
    }

    /// Tells whether a counter of this name is exact on the device; only then it is reported.
    pub fn counts(&self, counter: &str) -> bool {
        self.proof
            .counter_test
            .as_ref()
            .is_some_and(|t| t.is_exact(counter))
    }

    /// Samples that passed the depth test in a view, in all passes or in those of one name; `None` where the device
    /// does not count them exactly.
    pub fn samples_of(&self, sample: &ProfileSample, pass: Option<&str>) -> Option<u64> {
        if !self.counts("samples") {
            return None;
        }
        let passes = sample.counters.iter();
        passes
            .filter(|c| pass.is_none_or(|name| name == c.name))
            .map(|c| c.samples)
            .sum()
    }

    /// Samples drawn a covered pixel; `None` where the device does not count them, or nothing is covered.
    pub fn overdraw_of(&self, sample: &ProfileSample) -> Option<f64> {
        let samples = self.samples_of(sample, None)?;
        (sample.covered_pixels > 0).then(|| samples as f64 / sample.covered_pixels as f64)
    }

    /// Largest error of the two clocks against each other, milliseconds; `None` where frames are anchored by their
    /// submission.
    pub fn clock_error_ms(&self) -> Option<f64> {
        let anchors = self.samples.iter().filter_map(|s| s.anchor);
        anchors
            .map(|a| a.within.as_secs_f64() * 1e3)
            .max_by(f64::total_cmp)
    }

    /// One row a view, with a row of names first: comma-separated, empty where nothing is known.
    pub fn csv(&self) -> String {
        use crate::render::stats::FrameStage;
        let mut names: Vec<&str> = pass_names(self.frames());
        for counters in self.samples.iter().flat_map(|s| &s.counters) {
            if !names.contains(&counters.name) {
                names.push(counters.name);
            }
        }
        let mut header: Vec<String> = [
            "frame",
            "wall_ms",
            "wall_without_timestamps_ms",
            "device_ms",
        ]
        .map(str::to_owned)
        .to_vec();
        header.extend(FrameStage::ALL.map(|s| format!("{}_ms", s.name())));
        header.extend(names.iter().map(|n| format!("{n}_ms")));
        header.extend(
            [
                "nodes_visited",
                "splats",
                "triangles",
                "points",
                "draw_list_bytes",
                "uploaded_bytes",
                "loaded_bytes",
                "stored_bytes",
                "covered_pixels",
                "samples",
                "overdraw",
            ]
            .map(str::to_owned),
        );
        header.extend(names.iter().map(|n| format!("{n}_samples")));
        let mut out = header.join(",") + "\n";
        let cell = |value: Option<f64>| value.map(|v| v.to_string()).unwrap_or_default();
        for (index, sample) in self.samples.iter().enumerate() {
            let t = &sample.times;
            let mut row = vec![
                index.to_string(),
                t.frame_ms.to_string(),
                cell(sample.plain_ms),
                cell(t.device.frame_ms),
            ];
            row.extend(FrameStage::ALL.map(|s| t.of(s).to_string()));
            row.extend(names.iter().map(|n| cell(super::frames::pass_ms(t, n))));
            let moved =
                |of: fn(&PassCounters) -> u64| -> u64 { sample.counters.iter().map(of).sum() };
            row.extend(
                [
                    t.counts.nodes_visited,
                    t.counts.splats,
                    t.counts.triangles,
                    t.counts.points,
                    t.counts.draw_list_bytes,
                    t.uploaded_bytes,
                    moved(|c| c.loaded_bytes),
                    moved(|c| c.stored_bytes),
                    sample.covered_pixels,
                ]
                .map(|v| v.to_string()),
            );
            let samples = |pass| self.samples_of(sample, pass).map(|v| v.to_string());
            row.push(samples(None).unwrap_or_default());
            row.push(cell(self.overdraw_of(sample)));
            row.extend(names.iter().map(|n| samples(Some(*n)).unwrap_or_default()));
            out += &row.join(",");
            out.push('\n');
        }
        out
    }
}
