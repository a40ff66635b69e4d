//! Calibration: what a splat, a triangle, a pixel and a node cost on one device, measured once and kept.
//!
//! A generated statue is drawn from distances at which its parts are 1, 3 and 6 pixels large, by each path, and the passes
//! of the frame are told apart: what goes over the picture (clearing, resolving, normalizing) and what goes over the
//! primitives. What the passes cost when there is next to nothing in them comes off before: it is that of two triangles,
//! once far away and once at opposite corners of the picture. Points are compared with quads at sizes of 1 to 64 pixels.
//! Of several frames the least counts: other work on the machine only ever adds.
//!
//! It is measured in [`Part`]s, at first use of what each decides, so that no shader is compiled that is not drawn with
//! anyway; kept in the user's cache folder ([`crate::measure::store`]); and it decides nothing but times: all paths and
//! primitives draw the same picture.

mod stand;

use super::Error;
use crate::gpu::Gpu;
use crate::measure::store;
use crate::method::costs::Costs;
use crate::method::times::FrameTimes;
use crate::method::{Blend, Method, Path, Settings, SplatKind};
use stand::Stand;
use std::path::{Path as File, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A variable of the environment that keeps the program from calibrating, and from reading what was measured before, when
/// it is `off`: then rules of thumb decide, and a picture has the same last bits on every run. Tests set it.
pub const VARIABLE: &str = "SURFEL_CALIBRATE";

/// What is measured together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// Opaque squares and triangles of a pixel or two by both paths.
    Opaque,
    /// Splats that are blended in two passes, by both paths.
    Blended,
    /// Filtered splats by both paths.
    Filtered,
    /// Opaque splats as points and as quads.
    Primitives,
    /// What the cut visits, on the processor. It decides nothing.
    Nodes,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Opaque,
        Self::Blended,
        Self::Filtered,
        Self::Primitives,
        Self::Nodes,
    ];

    /// Those that decide how `settings` are drawn where nobody insists on a path; none where nothing is left to decide.
    pub fn of(settings: &Settings) -> &'static [Self] {
        let is_opaque = settings.blend() == Blend::Opaque;
        match settings.splat {
            _ if !settings.draws_splats() => &[],
            SplatKind::Visibility => &[],
            SplatKind::Filtered => &[Self::Filtered],
            SplatKind::Square if is_opaque && settings.method == Method::Pop => {
                &[Self::Opaque, Self::Primitives]
            }
            _ if is_opaque || !settings.has_cut() => &[Self::Primitives],
            _ => &[Self::Blended, Self::Primitives],
        }
    }
}

/// What a calibration holds for.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Key {
    version: String,
    commit: String,
    device: String,
    driver: String,
    /// Threads that the machine runs at once: a software device draws with them.
    threads: usize,
}

impl Key {
    /// That of a device and this program.
    pub fn of(gpu: &Gpu) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: option_env!("SURFEL_COMMIT").unwrap_or_default().into(),
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
pub struct Calibration {
    key: Key,
    /// What was measured, or given up twice: that is not tried again.
    pub parts: Vec<Part>,
    /// What was given up once. A driver may have compiled its shaders for the first time then, and be quick the next time.
    pub given_up: Vec<Part>,
    /// What was measured.
    pub costs: Costs,
    /// How long measuring took, all parts together, milliseconds.
    pub took_ms: f64,
}

/// A calibration and where it comes from.
#[derive(Debug)]
pub struct Found {
    /// The calibration.
    pub calibration: Calibration,
    /// Its file; `None` where the system has no cache folder.
    pub file: Option<PathBuf>,
    /// Some of it was measured just now.
    pub is_new: bool,
    /// Why it could not be kept.
    pub not_kept: Option<crate::image::Error>,
}

/// What is not measured by then is given up: on such a device, or beside so much other work, rules of thumb have to do.
const PATIENCE: Duration = Duration::from_secs(3);

/// Milliseconds of a frame's passes by what they go over.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Split {
    /// Splats, and where they are blended triangles with them.
    pub splats_ms: f64,
    /// Triangles alone.
    pub triangles_ms: f64,
    /// The whole picture: clear, resolve, normalize and the like, and passes of triangles that have none and only clear.
    pub pixels_ms: f64,
}

/// Divides the passes of a frame by their names. Without timestamps all counts as splats, or where there are none as
/// triangles.
pub fn split(times: &FrameTimes) -> Split {
    let mut split = Split::default();
    if times.passes.is_empty() {
        let all = times.submit_ms + times.wait_ms;
        if times.counts.splats > 0 {
            split.splats_ms = all;
        } else {
            split.triangles_ms = all;
        }
    }
    for pass in &times.passes {
        *match pass.name.rsplit('.').next().unwrap_or_default() {
            "triangles" if times.counts.triangles > 0 => &mut split.triangles_ms,
            "triangles" | "clear" | "resolve" | "normalize" | "pull" | "push" | "fill"
            | "gaussian" | "density" => &mut split.pixels_ms,
            _ => &mut split.splats_ms,
        } += pass.ms;
    }
    split
}

impl Calibration {
    /// Reads one; `None` where there is none, or it is damaged, or of another key.
    pub fn read(folder: &File, key: &Key) -> Option<Self> {
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
    /// As [`Calibration::measure`].
    pub fn kept(
        gpu: &Arc<Gpu>,
        folder: Option<&File>,
        parts: &[Part],
        again: bool,
    ) -> Result<Found, Error> {
        let key = Key::of(gpu);
        let file = folder.map(|f| key.path(f));
        let old = folder.and_then(|f| Self::read(f, &key));
        let missing: Vec<Part> = match &old {
            Some(old) if !again => parts
                .iter()
                .copied()
                .filter(|part| !old.parts.contains(part))
                .collect(),
            _ => parts.to_vec(),
        };
        let calibration = match old {
            Some(old) if missing.is_empty() => {
                return Ok(Found {
                    calibration: old,
                    file,
                    is_new: false,
                    not_kept: None,
                });
            }
            old => Self::measure(gpu, &missing)?.and(old),
        };
        let not_kept = folder.and_then(|f| calibration.write(f).err());
        Ok(Found {
            calibration,
            file,
            is_new: true,
            not_kept,
        })
    }

    /// It, and the parts of an older one that it does not have.
    fn and(mut self, old: Option<Self>) -> Self {
        let Some(old) = old else { return self };
        let kept = old.parts.iter().filter(|part| !self.parts.contains(part));
        if kept.clone().next().is_some() {
            self.took_ms += old.took_ms;
        }
        self.parts.extend(kept.copied().collect::<Vec<_>>());
        self.costs = self.costs.or(old.costs);
        let (again, once): (Vec<Part>, Vec<Part>) = self
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
    pub fn measure(gpu: &Arc<Gpu>, parts: &[Part]) -> Result<Self, Error> {
        Self::measure_within(gpu, parts, PATIENCE)
    }

    fn measure_within(gpu: &Arc<Gpu>, parts: &[Part], patience: Duration) -> Result<Self, Error> {
        let start = Instant::now();
        let mut stand = Stand::new(gpu, start + patience)?;
        let mut all = Costs::default();
        let (mut measured, mut given_up) = (Vec::new(), Vec::new());
        for part in parts {
            let mut costs = Costs::default();
            match part {
                Part::Opaque => {
                    costs.square = stand.splats(SplatKind::Square)?.0;
                    costs.triangle = stand.triangles()?;
                }
                Part::Blended => {
                    (costs.gauss, costs.gauss_merge) = stand.splats(SplatKind::Gauss)?;
                }
                Part::Filtered => {
                    (costs.filtered, costs.filtered_merge) = stand.splats(SplatKind::Filtered)?;
                }
                Part::Primitives => costs.primitives = stand.primitives()?,
                Part::Nodes => costs.node_ns = Some(stand.node_ns()?),
            }
            // Half a part would say that the device cannot do the other half.
            if stand.gave_up() {
                given_up.push(*part);
            } else {
                measured.push(*part);
                all = all.or(costs);
            }
        }
        if !given_up.is_empty() {
            tracing::warn!(
                "measuring what drawing costs on this device takes too long: {given_up:?} given up, rules of thumb decide"
            );
        }
        let took_ms = start.elapsed().as_secs_f64() * 1e3;
        tracing::debug!("calibrated {parts:?} in {took_ms:.0} ms: {all:?}");
        Ok(Self {
            key: Key::of(gpu),
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
pub fn for_use(gpu: &Arc<Gpu>, settings: &[Settings]) -> Option<Costs> {
    if std::env::var_os(VARIABLE).is_some_and(|v| v == "off") {
        tracing::debug!("{VARIABLE} is off: rules of thumb decide");
        return None;
    }
    let folder = store::folder();
    let mut parts: Vec<Part> = Vec::new();
    for settings in settings.iter().filter(|s| s.path == Path::Auto) {
        for part in Part::of(settings) {
            if !parts.contains(part) {
                parts.push(*part);
            }
        }
    }
    if parts.is_empty() {
        let kept = folder.and_then(|f| Calibration::read(&f, &Key::of(gpu)));
        return kept.map(|calibration| calibration.costs);
    }
    match Calibration::kept(gpu, folder.as_deref(), &parts, false) {
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
mod tests {
    use super::stand::{Drawn, Nothing};
    use super::*;
    use crate::gpu::profile::PassTime;
    use crate::method::costs::{PassCosts, SplatCosts, TriangleCosts, Ways};
    use crate::method::renderer::Counts;

    #[test]
    fn passes_over_the_picture_are_told_from_those_over_primitives() {
        let parts = |triangles, passes: &[(&'static str, f64)]| {
            let of = split(&FrameTimes {
                passes: passes
                    .iter()
                    .map(|&(name, ms)| PassTime { name, ms })
                    .collect(),
                counts: Counts {
                    triangles,
                    splats: 9,
                    ..Counts::default()
                },
                submit_ms: 1.0,
                wait_ms: 2.0,
                ..FrameTimes::default()
            });
            [of.splats_ms, of.triangles_ms, of.pixels_ms]
        };
        let passes = [
            ("hybrid.triangles", 1.0),
            ("small.clear", 2.0),
            ("small.triangles", 4.0),
            ("small.splats", 8.0),
            ("small.resolve", 16.0),
        ];
        assert_eq!(parts(7, &passes), [8.0, 5.0, 18.0]);
        assert_eq!(parts(0, &passes), [8.0, 0.0, 23.0]);
        let fuzzy = [("fuzzy.depth", 1.0), ("fuzzy.normalize", 2.0)];
        assert_eq!(parts(5, &fuzzy), [1.0, 0.0, 2.0]);
        assert_eq!(parts(0, &[]), [3.0, 0.0, 0.0]);
    }

    /// A view of so many pixels of a box, covered pixels and primitives.
    fn at(of_box: f64, covered: f64, count: f64, primitives_ns: f64, pixels_ns: f64) -> Drawn {
        Drawn {
            primitives_ns,
            pixels_ns,
            count,
            covered,
            of_box,
        }
    }

    #[test]
    fn what_passes_cost_without_primitives_comes_off() {
        // Passes over primitives: 1000 ns, 1 more for a pixel of the box, 50 a primitive. Passes over the picture: 4 ns for
        // each of its 10,000 pixels, 2 more in the box, 30 more for a covered one.
        let drawn = |of_box: f64, covered: f64, count: f64| {
            let primitives = 1000.0 + of_box + 50.0 * count;
            at(
                of_box,
                covered,
                count,
                primitives,
                40_000.0 + 2.0 * of_box + 30.0 * covered,
            )
        };
        let nothing = Nothing {
            far: drawn(0.0, 0.0, 0.0),
            wide: drawn(8000.0, 0.0, 0.0),
        };
        let views = [drawn(500.0, 100.0, 10.0), drawn(2000.0, 900.0, 300.0)];
        let (passes, each) = nothing.costs(&views, 10_000.0);
        let found = [
            passes.frame_ns,
            passes.picture_ns,
            passes.box_ns,
            passes.covered_ns,
        ];
        for (found, wanted) in found.into_iter().zip([1000.0, 4.0, 3.0, 30.0]) {
            assert!((found - wanted).abs() < 1e-6, "{passes:?}");
        }
        assert!(each.iter().all(|ns| (ns - 50.0).abs() < 1e-6), "{each:?}");
        // Noise makes no time negative, and what draws nothing divides by nothing.
        let less = at(9000.0, 500.0, 0.0, 500.0, 10.0);
        let nothing = Nothing {
            far: drawn(0.0, 0.0, 0.0),
            wide: less,
        };
        let (passes, each) = nothing.costs(&[less], 10_000.0);
        assert_eq!((passes.box_ns, passes.covered_ns), (0.0, 0.0));
        assert_eq!(each, [0.0]);
    }

    #[test]
    fn merging_is_what_both_cost_more_than_compute_alone() {
        let alone = [
            at(0.0, 0.0, 2.0, 100.0, 200.0),
            at(1000.0, 0.0, 2.0, 100.0, 300.0),
            at(500.0, 0.0, 50.0, 600.0, 400.0),
        ];
        // 7 more for a frame, 0.1 for each of 10,000 pixels, 3 for one of the box, 4 for a splat.
        let mut both = alone;
        for (view, splats) in both.iter_mut().zip([0.0, 0.0, 50.0]) {
            view.primitives_ns += 7.0 + 4.0 * splats;
            view.pixels_ns += 1000.0 + 3.0 * view.of_box;
        }
        let found = stand::merge(both, alone, 10_000.0);
        let passes = found.passes;
        assert_eq!(
            (passes.frame_ns, passes.picture_ns, passes.box_ns),
            (7.0, 0.1, 3.0)
        );
        assert!((found.splat_ns - 4.0).abs() < 1e-9, "{found:?}");
        // Cheaper than without is noise.
        let found = stand::merge(alone, both, 10_000.0);
        assert_eq!((found.splat_ns, found.passes), (0.0, PassCosts::default()));
    }

    #[test]
    fn only_what_decides_is_measured() {
        let of = |splat, method| {
            Part::of(&Settings {
                splat,
                method,
                ..Settings::default()
            })
        };
        use Part::{Blended, Filtered, Opaque, Primitives};
        assert_eq!(of(SplatKind::Square, Method::Pop), [Opaque, Primitives]);
        assert_eq!(of(SplatKind::Square, Method::Splats), [Primitives]);
        assert_eq!(of(SplatKind::Ellipse, Method::Pop), [Primitives]);
        assert_eq!(of(SplatKind::Gauss, Method::Splats), [Blended, Primitives]);
        assert_eq!(of(SplatKind::Gauss, Method::Points), [Primitives]);
        assert_eq!(of(SplatKind::Filtered, Method::Pop), [Filtered]);
        assert_eq!(of(SplatKind::Visibility, Method::Pop), []);
        assert_eq!(of(SplatKind::Square, Method::Triangles), []);
        let two_pass = Settings {
            blend: Some(Blend::TwoPass),
            ..Settings::default()
        };
        assert_eq!(Part::of(&two_pass), [Blended, Primitives]);
    }

    fn key(version: &str) -> Key {
        Key {
            version: version.into(),
            commit: String::new(),
            device: "a device / with a name".into(),
            driver: "a driver".into(),
            threads: 2,
        }
    }

    fn made(version: &str) -> Calibration {
        let passes = PassCosts {
            frame_ns: 3.5,
            picture_ns: 0.5,
            box_ns: 1.5,
            covered_ns: 20.25,
        };
        let splat = Some(Ways {
            raster: Some(SplatCosts {
                splat_ns: [100.0, 110.0, 130.5],
                passes,
            }),
            compute: None,
        });
        Calibration {
            key: key(version),
            parts: vec![Part::Opaque, Part::Nodes],
            given_up: vec![Part::Filtered, Part::Primitives],
            costs: Costs {
                square: splat,
                triangle: Some(Ways {
                    raster: Some(TriangleCosts {
                        triangle_ns: 70.0,
                        passes,
                    }),
                    compute: None,
                }),
                node_ns: Some(4.0),
                ..Costs::default()
            },
            took_ms: 300.0,
        }
    }

    #[test]
    fn what_takes_too_long_is_given_up_and_not_tried_again() {
        let gpu = match Gpu::open(&crate::gpu::Options::default()) {
            Ok(gpu) => gpu,
            Err(error) => {
                assert!(
                    std::env::var_os("SURFEL_REQUIRE_DEVICE").is_none(),
                    "a device is required here: {error}"
                );
                eprintln!("no device, nothing tested: {error}");
                return;
            }
        };
        let parts = [Part::Filtered, Part::Primitives];
        let found = Calibration::measure_within(&gpu, &parts, Duration::ZERO).unwrap();
        assert_eq!(found.costs, Costs::default());
        assert_eq!(
            (&found.parts[..], &found.given_up[..]),
            (&[][..], &parts[..])
        );
        // Once more, and then no more.
        let again = found.clone().and(Some(found));
        assert_eq!(
            (&again.parts[..], &again.given_up[..]),
            (&parts[..], &[][..])
        );
        let folder = tempfile::tempdir().unwrap();
        again.write(folder.path()).unwrap();
        let kept = Calibration::kept(&gpu, Some(folder.path()), &parts, false).unwrap();
        assert!(!kept.is_new && kept.calibration == again);
    }

    #[test]
    fn parts_that_were_not_measured_again_stay() {
        let old = made("1");
        let mut new = made("1");
        new.parts = vec![Part::Filtered, Part::Nodes];
        new.given_up = vec![Part::Blended];
        new.costs = Costs {
            filtered: old.costs.square,
            node_ns: Some(5.0),
            ..Costs::default()
        };
        let both = new.clone().and(Some(old.clone()));
        assert_eq!(both.parts, [Part::Filtered, Part::Nodes, Part::Opaque]);
        assert_eq!(both.costs.square, old.costs.square);
        assert_eq!(both.costs.node_ns, Some(5.0));
        assert_eq!(both.took_ms, 600.0);
        // What was given up before and is measured now is no longer given up.
        assert_eq!(both.given_up, [Part::Blended, Part::Primitives]);
        assert_eq!(new.clone().and(None), new);
    }

    #[test]
    fn a_file_that_is_damaged_or_of_another_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let calibration = made("1");
        let file = key("1").path(folder);
        assert_eq!(Calibration::read(folder, &key("1")), None);
        calibration.write(folder).unwrap();
        assert_eq!(
            Calibration::read(folder, &key("1")),
            Some(calibration.clone())
        );
        // Another version has another file, and does not believe this one in its place.
        assert_eq!(Calibration::read(folder, &key("2")), None);
        std::fs::copy(&file, key("2").path(folder)).unwrap();
        assert_eq!(Calibration::read(folder, &key("2")), None);
        let text = std::fs::read_to_string(&file).unwrap();
        for damaged in [
            text[..text.len() / 2].to_owned(),
            String::new(),
            text.replace("4.0", "-4.0"),
            text.replace("node_ns", "nodes"),
            text.replace("\"opaque\"", "\"oblique\""),
            text.replace("130.5", "1e999"),
        ] {
            assert_ne!(damaged, text);
            std::fs::write(&file, damaged).unwrap();
            assert_eq!(Calibration::read(folder, &key("1")), None);
        }
        // Nor bytes that are no text, nor a folder in its place.
        std::fs::write(&file, [0xff, 0xfe, 0x00]).unwrap();
        assert_eq!(Calibration::read(folder, &key("1")), None);
        std::fs::remove_file(&file).unwrap();
        std::fs::create_dir(&file).unwrap();
        assert_eq!(Calibration::read(folder, &key("1")), None);
    }
}
