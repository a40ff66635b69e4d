//! Calibration: what a splat, a triangle, a pixel and a node cost on one device, measured once and kept.
//!
//! A generated statue is drawn from distances at which its parts are 1, 3 and 6 pixels large, by each path, and the passes
//! of the frame are told apart: what goes over the picture (clearing, resolving, normalizing) and what goes over the
//! primitives. What the passes cost when there is next to nothing in them comes off before: it is that of two triangles,
//! once far away and once at opposite corners of the picture. Points are compared with quads at sizes of 1 to 64 pixels.
//! Of several frames the least counts: other work on the machine only ever adds. Where they differ much, that is not enough,
//! and at first use nothing is kept.
//!
//! Costs are measured in [`CalibrationPart`]s, at first use of what each decides, so that no shader is compiled that is not drawn with
//! anyway; kept in the user's cache folder ([`crate::measure::store`]); and it decides nothing but times: all paths and
//! primitives draw the same picture.

mod stand;

use super::BenchError;
use crate::gpu::Gpu;
use crate::measure::store;
use crate::render::cost::model::DrawCosts;
use crate::render::stats::FrameTimes;
use crate::render::{Blend, CutOn, Method, Path, Settings, SplatKind};
use stand::CalibrationStand;
use std::path::{Path as File, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A variable of the environment that keeps the program from calibrating, and from reading what was measured before, when
/// it is `off`: then rules of thumb decide, and a picture has the same last bits on every run. Tests set it. With `always`
/// it calibrates beside other work as well.
pub const VARIABLE: &str = "SURFEL_CALIBRATE";

/// What is measured together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CalibrationPart {
    /// Opaque squares and triangles of a pixel or two by both paths.
    Opaque,
    /// Opaque ellipses by both paths.
    Ellipses,
    /// Splats that are blended in two passes, by both paths.
    Blended,
    /// Filtered splats by both paths.
    Filtered,
    /// Visibility splats by both paths.
    Visibility,
    /// Opaque splats as points and as quads.
    Primitives,
    /// What the cut visits, on the processor and on the device.
    Nodes,
}

impl CalibrationPart {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Opaque,
        Self::Ellipses,
        Self::Blended,
        Self::Filtered,
        Self::Visibility,
        Self::Primitives,
        Self::Nodes,
    ];

    /// Parts that decide how `settings` are drawn where nobody insists on a path; none where nothing is left to decide.
    pub fn of(settings: &Settings) -> &'static [Self] {
        let is_opaque = settings.blend() == Blend::Opaque;
        match settings.splat {
            _ if !settings.draws_splats() => &[],
            SplatKind::Visibility if settings.has_cut() => &[Self::Visibility],
            SplatKind::Visibility => &[],
            SplatKind::Filtered => &[Self::Filtered],
            SplatKind::Square if is_opaque && settings.method == Method::Pop => {
                &[Self::Opaque, Self::Primitives]
            }
            SplatKind::Ellipse if is_opaque && settings.method == Method::Pop => {
                &[Self::Opaque, Self::Ellipses, Self::Primitives]
            }
            _ if is_opaque || !settings.has_cut() => &[Self::Primitives],
            _ => &[Self::Blended, Self::Primitives],
        }
    }
}

impl CalibrationPart {
    /// Tells whether it is open what chooses the cut of these settings.
    fn asks_nodes(settings: &Settings) -> bool {
        settings.cut_on == CutOn::Auto
            && settings.method == Method::Pop
            && settings.path == Path::Auto
            && matches!(settings.splat, SplatKind::Square | SplatKind::Disc)
    }
}

/// What a calibration holds for.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceKey {
    version: String,
    commit: String,
    device: String,
    driver: String,
    /// Threads that the machine runs at once: a software device draws with them.
    threads: usize,
}

impl DeviceKey {
    /// Key of a device and this program.
    pub fn of(gpu: &Gpu) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: crate::measure::COMMIT.into(),
            device: gpu.info().name.clone(),
            driver: gpu.info().driver.clone(),
            threads: super::threads(),
        }
    }

    /// The file of its calibration in a folder.
    pub fn path(&self, folder: &File) -> PathBuf {
        store::path(folder, "costs", self)
    }
}

/// The costs of one device, and what they hold for.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceCalibration {
    key: DeviceKey,
    /// What was measured, or given up twice: that is not tried again.
    pub parts: Vec<CalibrationPart>,
    /// What was given up once. A driver may have compiled its shaders for the first time then, and be quick the next time.
    pub given_up: Vec<CalibrationPart>,
    /// What was measured.
    pub costs: DrawCosts,
    /// How long measuring took, all parts together, milliseconds.
    pub took_ms: f64,
}

/// A calibration and where it comes from.
#[derive(Debug)]
pub struct FoundCalibration {
    /// The calibration.
    pub calibration: DeviceCalibration,
    /// File it is kept in; `None` where the system has no cache folder.
    pub file: Option<PathBuf>,
    /// Some of it was measured just now.
    pub is_new: bool,
    /// Why it could not be kept.
    pub not_kept: Option<crate::image::Error>,
}

/// A part that is not measured by then at first use is given up: on such a device, or beside so much other work, rules of
/// thumb have to do.
const PATIENCE: Duration = Duration::from_secs(5);
/// The same where somebody asked for nothing else.
const MORE_PATIENCE: Duration = Duration::from_secs(60);
/// At first use a part is given up too where the frames of a view differ by this factor in the mean: the machine does other
/// work, and what was measured beside it would decide for as long as it is kept.
const LEAST_UNSTEADY: f64 = 1.3;

/// When a part is given up.
#[derive(Debug, Clone, Copy)]
struct PartLimits {
    patience: Duration,
    /// [`LEAST_UNSTEADY`]; infinite where somebody asked for it.
    unsteady: f64,
}

/// Where somebody asked for nothing else.
const ASKED_FOR: PartLimits = PartLimits {
    patience: MORE_PATIENCE,
    unsteady: f64::INFINITY,
};

/// Milliseconds of a frame's passes by what they go over.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PassSplit {
    /// Splats, and where they are blended triangles with them.
    pub splats_ms: f64,
    /// Triangles alone.
    pub triangles_ms: f64,
    /// The whole picture: clear, resolve, normalize and the like, and passes of triangles that have none and only clear.
    pub pixels_ms: f64,
}

/// Divides the passes of a frame by their names. Without timestamps all counts as splats, or where there are none as
/// triangles.
pub fn split(times: &FrameTimes) -> PassSplit {
    let mut split = PassSplit::default();
    if times.passes.is_empty() {
        let all = times.submit_ms + times.wait_ms;
        if times.counts.splats > 0 {
            split.splats_ms = all;
        } else {
            split.triangles_ms = all;
        }
    }
    split.splats_ms += times.host.drawing_ms;
    for pass in &times.passes {
        *match pass.name.rsplit('.').next().unwrap_or_default() {
            "triangles" if times.counts.triangles > 0 => &mut split.triangles_ms,
            "triangles" | "clear" | "copy" | "resolve" | "normalize" | "pull" | "push" | "fill"
            | "gaussian" | "density" => &mut split.pixels_ms,
            _ => &mut split.splats_ms,
        } += pass.ms;
    }
    split
}

impl DeviceCalibration {
    /// Reads one; `None` where there is none, or it is damaged, or of another key.
    pub fn read(folder: &File, key: &DeviceKey) -> Option<Self> {
        let found: Self = store::read(&key.path(folder))?;
        (found.key == *key && found.costs.is_whole()).then_some(found)
    }

    /// Writes it beside its place and renames it.
    ///
    /// # Errors
    /// When the folder cannot be made or the file not be written.
    pub fn write(&self, folder: &File) -> Result<(), crate::image::Error> {
        store::write(&self.key.path(folder), self)
    }

    /// The one that is kept for a device in a folder, with these parts: what is not in it (or with `again` all of them) is
    /// measured and kept as well. A folder that cannot be written to is no failure: it is measured again next time.
    ///
    /// # Errors
    /// As [`DeviceCalibration::measure`].
    pub fn kept(
        gpu: &Arc<Gpu>,
        folder: Option<&File>,
        parts: &[CalibrationPart],
        again: bool,
    ) -> Result<FoundCalibration, BenchError> {
        Self::kept_within(gpu, folder, parts, again, ASKED_FOR)
    }

    fn kept_within(
        gpu: &Arc<Gpu>,
        folder: Option<&File>,
        parts: &[CalibrationPart],
        again: bool,
        limits: PartLimits,
    ) -> Result<FoundCalibration, BenchError> {
        let key = DeviceKey::of(gpu);
        let file = folder.map(|f| key.path(f));
        let old = folder.and_then(|f| Self::read(f, &key));
        let missing: Vec<CalibrationPart> = match &old {
            Some(old) if !again => parts
                .iter()
                .copied()
                .filter(|part| !old.parts.contains(part))
                .collect(),
            _ => parts.to_vec(),
        };
        let calibration = match old {
            Some(old) if missing.is_empty() => {
                return Ok(FoundCalibration {
                    calibration: old,
                    file,
                    is_new: false,
                    not_kept: None,
                });
            }
            old => Self::measure_within(gpu, &missing, limits)?.and(old),
        };
        let not_kept = folder.and_then(|f| calibration.write(f).err());
        Ok(FoundCalibration {
            calibration,
            file,
            is_new: true,
            not_kept,
        })
    }

    /// Joins the parts of an older calibration that this one does not have.
    fn and(mut self, old: Option<Self>) -> Self {
        let Some(old) = old else { return self };
        let kept = old.parts.iter().filter(|part| !self.parts.contains(part));
        if kept.clone().next().is_some() {
            self.took_ms += old.took_ms;
        }
        self.parts.extend(kept.copied().collect::<Vec<_>>());
        self.costs = self.costs.or(old.costs);
        let (again, once): (Vec<CalibrationPart>, Vec<CalibrationPart>) = self
            .given_up
            .iter()
            .partition(|part| old.given_up.contains(part));
        self.parts.extend(again);
        self.given_up = once;
        let rest = old.given_up.into_iter();
        self.given_up
            .extend(rest.filter(|part| !self.parts.contains(part)));
        self
    }

    /// Measures parts of a device. A part that takes too long, or that the device cannot draw, has no costs.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn measure(gpu: &Arc<Gpu>, parts: &[CalibrationPart]) -> Result<Self, BenchError> {
        Self::measure_within(gpu, parts, ASKED_FOR)
    }

    fn measure_within(
        gpu: &Arc<Gpu>,
        parts: &[CalibrationPart],
        limits: PartLimits,
    ) -> Result<Self, BenchError> {
        let start = Instant::now();
        let mut stand = CalibrationStand::new(gpu)?;
        let mut all = DrawCosts::default();
        let (mut measured, mut given_up) = (Vec::new(), Vec::new());
        for part in parts {
            let mut costs = DrawCosts::default();
            stand.begin(limits.patience);
            match part {
                CalibrationPart::Opaque => {
                    costs.square = stand.splats(SplatKind::Square)?.0;
                    costs.triangle = stand.triangles()?;
                }
                CalibrationPart::Ellipses => costs.ellipse = stand.splats(SplatKind::Ellipse)?.0,
                CalibrationPart::Blended => {
                    (costs.gauss, costs.gauss_merge) = stand.splats(SplatKind::Gauss)?;
                }
                CalibrationPart::Filtered => {
                    (costs.filtered, costs.filtered_merge) = stand.splats(SplatKind::Filtered)?;
                }
                CalibrationPart::Visibility => {
                    costs.visibility = stand.splats(SplatKind::Visibility)?.0;
                }
                CalibrationPart::Primitives => costs.primitives = stand.primitives()?,
                CalibrationPart::Nodes => {
                    costs.node_ns = Some(stand.node_ns()?);
                    costs.device_node_ns = stand.device_node_ns()?;
                }
            }
            tracing::debug!(
                "{part:?}: frames of a view took up to {:.2} times as long",
                stand.unsteadiness()
            );
            // Half a part would say that the device cannot do the other half.
            if stand.gave_up() || stand.unsteadiness() >= limits.unsteady {
                given_up.push(*part);
            } else {
                measured.push(*part);
                all = all.or(costs);
            }
        }
        if !given_up.is_empty() {
            tracing::warn!(
                "measuring what drawing costs on this device takes too long, or the machine does other work: {given_up:?} given up, rules of thumb decide; surfel devices --calibrate measures it"
            );
        }
        let took_ms = start.elapsed().as_secs_f64() * 1e3;
        tracing::debug!("calibrated {parts:?} in {took_ms:.0} ms: {all:?}");
        Ok(Self {
            key: DeviceKey::of(gpu),
            parts: measured,
            given_up,
            costs: all,
            took_ms,
        })
    }
}

/// The costs that are to decide how `settings` are drawn on a device: those kept in the user's cache folder, measured now
/// where they are not there yet. Measured is nothing where a path is insisted on ([`Path::Raster`], [`Path::Compute`]); then
/// what is kept decides between points and quads. `None` where [`VARIABLE`] is `off`, and where measuring fails, which the
/// log says: it never fails a run.
pub fn for_use(gpu: &Arc<Gpu>, settings: &[Settings]) -> Option<DrawCosts> {
    if std::env::var_os(VARIABLE).is_some_and(|v| v == "off") {
        tracing::debug!("{VARIABLE} is off: rules of thumb decide");
        return None;
    }
    let folder = store::folder();
    let mut parts: Vec<CalibrationPart> = Vec::new();
    for settings in settings.iter().filter(|s| s.path == Path::Auto) {
        for part in CalibrationPart::of(settings) {
            if !parts.contains(part) {
                parts.push(*part);
            }
        }
    }
    // A software device would go down the tree on the same processor, by more instructions (docs/PERFORMANCE.md).
    if !gpu.info().is_cpu() && settings.iter().any(CalibrationPart::asks_nodes) {
        parts.push(CalibrationPart::Nodes);
    }
    if parts.is_empty() {
        let kept = folder.and_then(|f| DeviceCalibration::read(&f, &DeviceKey::of(gpu)));
        return kept.map(|calibration| calibration.costs);
    }
    let limits = PartLimits {
        patience: PATIENCE,
        unsteady: match std::env::var_os(VARIABLE) {
            Some(v) if v == "always" => f64::INFINITY,
            _ => LEAST_UNSTEADY,
        },
    };
    match DeviceCalibration::kept_within(gpu, folder.as_deref(), &parts, false, limits) {
        Ok(found) => {
            if let Some(error) = &found.not_kept {
                tracing::warn!("what drawing costs on this device is not kept: {error}");
            }
            Some(found.calibration.costs)
        }
        Err(error) => {
            tracing::warn!(
                "what drawing costs on this device could not be measured: {error}; rules of thumb decide"
            );
            None
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests;
