//! Calibration: what a splat, a triangle, a pixel and a node cost on one device, measured once and kept.
//!
//! A generated statue is drawn from distances at which its parts are 1, 3 and 6 pixels large, by each path, and the passes
//! of the frame are told apart: what goes over the whole picture (clearing, resolving, normalizing) and what goes over the
//! primitives. Of several frames the least counts: other work on the machine only ever adds. It takes well under a second,
//! is kept in the user's cache folder ([`crate::measure::store`]), and decides nothing but times: both paths draw the same
//! picture.

use super::Error;
use crate::chart::run::orbit;
use crate::cut::{Cut, Selector};
use crate::generate::{self, Shape, Spec};
use crate::gpu::Gpu;
use crate::gpu::device::Kind;
use crate::math::camera::View;
use crate::measure::store;
use crate::method::costs::{Costs, PixelCosts, SIZES_PX, SplatCosts, TriangleCosts, Ways};
use crate::method::engine::{Backend, Engine};
use crate::method::plan::cut_settings;
use crate::method::renderer::Outputs;
use crate::method::times::FrameTimes;
use crate::method::{Path, Settings, SplatKind};
use crate::progress::Silent;
use crate::tree::{self, BuildOptions, Model};
use std::path::{Path as File, PathBuf};
use std::sync::Arc;
use std::time::Instant;

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
    /// What was measured.
    pub costs: Costs,
    /// How long measuring took, milliseconds.
    pub took_ms: f64,
}

/// A calibration and where it comes from.
#[derive(Debug)]
pub struct Found {
    /// The calibration.
    pub calibration: Calibration,
    /// Its file; `None` where the system has no cache folder.
    pub file: Option<PathBuf>,
    /// It was measured just now.
    pub is_new: bool,
    /// Why it could not be kept.
    pub not_kept: Option<crate::image::Error>,
}

/// Frames of which the least counts; one more goes before, in which shaders are compiled.
const FRAMES: usize = 2;
/// At this fill no triangle of the statue is larger than a pixel, whatever the picture's size: their number goes with its
/// area. At twice this fill they are about as large, at five times two to three pixels.
const FILL_OF_ONE: f64 = 0.2;

/// One view drawn in one way.
struct Drawn {
    /// Nanoseconds of the passes over splats.
    splats_ns: f64,
    /// Nanoseconds of the passes over triangles.
    triangles_ns: f64,
    /// Nanoseconds of the passes over the picture.
    pixels_ns: f64,
    splats: f64,
    triangles: f64,
    covered: f64,
}

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

    /// The one that is kept for a device in a folder; where there is none that can be used (or with `again`) it is measured
    /// and kept. A folder that cannot be written to is no failure: it is measured again next time.
    ///
    /// # Errors
    /// As [`Calibration::measure`].
    pub fn kept(gpu: &Arc<Gpu>, folder: Option<&File>, again: bool) -> Result<Found, Error> {
        let key = Key::of(gpu);
        let file = folder.map(|f| key.path(f));
        if !again && let Some(calibration) = folder.and_then(|f| Self::read(f, &key)) {
            return Ok(Found {
                calibration,
                file,
                is_new: false,
                not_kept: None,
            });
        }
        let calibration = Self::measure(gpu)?;
        let not_kept = folder.and_then(|f| calibration.write(f).err());
        Ok(Found {
            calibration,
            file,
            is_new: true,
            not_kept,
        })
    }

    /// Measures a device.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn measure(gpu: &Arc<Gpu>) -> Result<Self, Error> {
        let start = Instant::now();
        // A graphics card needs more to do before its clock can tell.
        let (side, triangles) = match gpu.info().kind {
            Kind::Cpu => (300, 60_000),
            _ => (1000, 660_000),
        };
        let spec = Spec::with_triangles(Shape::Statue, triangles)?;
        let model = tree::build(generate::mesh(&spec), &BuildOptions::default(), &Silent)?;
        let backend = Backend::Device(gpu.clone());
        let engine = Engine::new(&backend, &model, (side, side), Outputs::default())?;
        let mut stand = Stand {
            model: &model,
            engine,
            side,
        };
        let costs = Costs {
            square: stand.splats(SplatKind::Square)?,
            gauss: stand.splats(SplatKind::Gauss)?,
            filtered: stand.splats(SplatKind::Filtered)?,
            triangle: stand.triangles()?,
            node_ns: stand.node_ns()?,
        };
        Ok(Self {
            key: Key::of(gpu),
            costs,
            took_ms: start.elapsed().as_secs_f64() * 1e3,
        })
    }
}

struct Stand<'m> {
    model: &'m Model,
    engine: Engine<'m>,
    side: u32,
}

impl Stand<'_> {
    fn view(&self, fill: f64) -> Result<View, Error> {
        Ok(orbit(self.model, (self.side, self.side), fill, 0, 9)?)
    }

    fn pixels(&self) -> f64 {
        f64::from(self.side) * f64::from(self.side)
    }

    /// Draws a view; `None` where the device or the program cannot draw so.
    fn draw(&mut self, fill: f64, settings: &Settings) -> Result<Option<Drawn>, Error> {
        use crate::gpu::Error as E;
        let view = self.view(fill)?;
        let mut least = [f64::INFINITY; 3];
        let mut counts = Default::default();
        for frame in 0..=FRAMES {
            let times = match self.engine.draw(&view, settings) {
                Ok(times) => times,
                Err(E::Unsupported { .. } | E::Limit { .. }) => return Ok(None),
                Err(error) => return Err(error.into()),
            };
            if frame > 0 {
                let of = split(&times);
                let parts = [of.splats_ms, of.triangles_ms, of.pixels_ms];
                for (least, ms) in least.iter_mut().zip(parts) {
                    *least = least.min(ms);
                }
            }
            counts = times.counts;
        }
        let covered = self.engine.read(&view)?.covered_pixels();
        Ok(Some(Drawn {
            splats_ns: least[0] * 1e6,
            triangles_ns: least[1] * 1e6,
            pixels_ns: least[2] * 1e6,
            splats: counts.splats as f64,
            triangles: counts.triangles as f64,
            covered: covered as f64,
        }))
    }

    fn splats(&mut self, kind: SplatKind) -> Result<Ways<SplatCosts>, Error> {
        let mut way = |path| -> Result<Option<SplatCosts>, Error> {
            let mut splat_ns = [0.0; SIZES_PX.len()];
            let mut drawn = Vec::new();
            for (ns, size) in splat_ns.iter_mut().zip(SIZES_PX) {
                let settings = Settings {
                    splat: kind,
                    path,
                    threshold_px: size,
                    ..Settings::default()
                };
                let Some(found) = self.draw(FILL_OF_ONE * f64::from(size), &settings)? else {
                    return Ok(None);
                };
                *ns = found.splats_ns / found.splats.max(1.0);
                drawn.push(found);
            }
            Ok(Some(SplatCosts {
                splat_ns,
                pixels: over_pixels(&drawn, self.pixels()),
            }))
        };
        Ok(Ways {
            raster: way(Path::Raster)?,
            compute: way(Path::Compute)?,
        })
    }

    fn triangles(&mut self) -> Result<Ways<TriangleCosts>, Error> {
        let mut way = |path| -> Result<Option<TriangleCosts>, Error> {
            let settings = Settings {
                path,
                threshold_px: 0.0,
                ..Settings::default()
            };
            let mut drawn = Vec::new();
            for fill in [2.0 * FILL_OF_ONE, 5.0 * FILL_OF_ONE] {
                match self.draw(fill, &settings)? {
                    Some(found) => drawn.push(found),
                    None => return Ok(None),
                }
            }
            // From both distances together: triangles of one and of two and a half pixels.
            let (ns, count) = drawn.iter().fold((0.0, 0.0), |(ns, count), d| {
                (ns + d.triangles_ns, count + d.triangles)
            });
            Ok(Some(TriangleCosts {
                triangle_ns: ns / f64::max(count, 1.0),
                pixels: over_pixels(&drawn, self.pixels()),
            }))
        };
        Ok(Ways {
            raster: way(Path::Raster)?,
            compute: way(Path::Compute)?,
        })
    }

    fn node_ns(&mut self) -> Result<f64, Error> {
        let view = self.view(1.0)?;
        let settings = cut_settings(&Settings::default(), self.model);
        let (mut selector, mut cut) = (Selector::default(), Cut::default());
        let mut least = f64::INFINITY;
        for _ in 0..=8 {
            let start = Instant::now();
            selector.select(self.model, &view, &settings, &mut cut);
            let ns = start.elapsed().as_nanos() as f64;
            least = least.min(ns / cut.stats.visited.max(1) as f64);
        }
        Ok(least)
    }
}

/// The line through the times of the passes over the picture by covered pixels; neither part is below 0.
fn over_pixels(drawn: &[Drawn], pixels: f64) -> PixelCosts {
    let n = drawn.len().max(1) as f64;
    let mean = |of: &dyn Fn(&Drawn) -> f64| drawn.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(&|d| d.covered), mean(&|d| d.pixels_ns));
    let xx = mean(&|d| (d.covered - x).powi(2));
    let xy = mean(&|d| (d.covered - x) * (d.pixels_ns - y));
    let covered_ns = if xx > 0.0 { (xy / xx).max(0.0) } else { 0.0 };
    PixelCosts {
        any_ns: ((y - covered_ns * x) / pixels.max(1.0)).max(0.0),
        covered_ns,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::gpu::profile::PassTime;
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

    #[test]
    fn pixels_and_covered_pixels_are_a_line() {
        let at = |covered, pixels_ns| Drawn {
            splats_ns: 0.0,
            triangles_ns: 0.0,
            pixels_ns,
            splats: 0.0,
            triangles: 0.0,
            covered,
        };
        // 2 ns for each of 1000 pixels and 30 for a covered one.
        let found = over_pixels(&[at(100.0, 5000.0), at(500.0, 17_000.0)], 1000.0);
        assert!((found.any_ns - 2.0).abs() < 1e-9 && (found.covered_ns - 30.0).abs() < 1e-9);
        // Noise: less time with more pixels.
        let found = over_pixels(&[at(100.0, 3000.0), at(500.0, 1000.0)], 1000.0);
        assert_eq!((found.any_ns, found.covered_ns), (2.0, 0.0));
        let found = over_pixels(&[at(100.0, 1000.0)], 1000.0);
        assert_eq!((found.any_ns, found.covered_ns), (1.0, 0.0));
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
        let pixels = PixelCosts {
            any_ns: 1.5,
            covered_ns: 20.25,
        };
        let splat = Ways {
            raster: Some(SplatCosts {
                splat_ns: [100.0, 110.0, 130.5],
                pixels,
            }),
            compute: None,
        };
        Calibration {
            key: key(version),
            costs: Costs {
                square: splat,
                gauss: splat,
                filtered: splat,
                triangle: Ways {
                    raster: Some(TriangleCosts {
                        triangle_ns: 70.0,
                        pixels,
                    }),
                    compute: None,
                },
                node_ns: 4.0,
            },
            took_ms: 300.0,
        }
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
        ] {
            assert_ne!(damaged, text);
            std::fs::write(&file, damaged).unwrap();
            assert_eq!(Calibration::read(folder, &key("1")), None);
        }
    }
}
