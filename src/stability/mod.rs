//! Where the methods fail: every scene of [`crate::scenes`] by every way of drawing, measured and held to stated bounds.
//!
//! [`looks`] are the ways of drawing, [`FailureCase`] is a scene made ready with its truth (16 samples of triangles a pixel),
//! [`FailureCase::judge`] measures a picture and gives the verdict. The same bounds are behind `surfel stability` and behind
//! the tests. A picture is right by the rules of [`rules`], which are the same for all scenes and follow from what a
//! method promises:
//!
//! * everything that is shown lies within [`reach_px`] pixels of where the surface is, and has a color that the
//!   truth has within as many pixels;
//! * nothing is missing but pixels that an outline cuts, and nothing is lost that covers a quarter of a pixel;
//! * there are no holes, and the color at the center is the closed form where there is one.
//!
//! What breaks a rule is a known limit if a row of [`rows::ROWS`] says how far and why, else a failure. Rows may also
//! be narrower than the rules, or state figures that have none.

mod colors;
mod figures;
pub mod page;

pub mod rows;
mod rules;

pub use figures::{FailureCase, FailureFigure};
pub use rules::{FailureBound, FailureCell, FailureVerdict, reach_px, rules};

use crate::image::Image;
use crate::oriented::splats::SplatRules;
use crate::patches::PatchRules;
use crate::progress::Progress;
use crate::render::PictureOutputs;
use crate::render::engine::{Backend, Engine};
use crate::render::{Culling, Method, Settings, SplatKind};
use crate::scenes::SceneEntry;

/// Why the failures could not be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FailuresError {
    /// A scene has no tree.
    #[error(transparent)]
    Tree(#[from] crate::tree::Error),
    /// A scene has no camera.
    #[error(transparent)]
    Camera(#[from] crate::math::camera::CameraError),
    /// The device could not draw.
    #[error(transparent)]
    Gpu(#[from] crate::gpu::Error),
    /// Pictures could not be compared or written.
    #[error(transparent)]
    Image(#[from] crate::image::Error),
    /// The user asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// A way of drawing; the threshold is the scene's.
#[derive(Debug, Clone, Copy)]
pub struct FailureLook {
    /// Name, as rows and tables have it.
    pub name: &'static str,
    /// Everything but the threshold.
    pub settings: Settings,
    /// The scenes it is for; all if there are none.
    pub only: &'static [&'static str],
}

impl FailureLook {
    /// Tells whether a scene is drawn so. `splats` is `pop` where no leaf is larger than the threshold, and drawn only where
    /// one is; points of clouds have sizes of their own in both.
    pub fn is_for(&self, case: &FailureCase) -> bool {
        let is_own_picture = match (self.settings.method, self.settings.splat) {
            _ if self.settings.vertex_splats.is_some() => true,
            (Method::Splats, SplatKind::Filtered) if case.model.kind().is_points() => true,
            (Method::Splats, _) => case.has_large_leaves,
            // Clouds have none.
            _ if self.settings.patches.is_some() => case.model.kind().is_surface(),
            _ => true,
        };
        is_own_picture && (self.only.is_empty() || self.only.contains(&case.entry.name))
    }
}

/// The kinds of splats with the names of their looks in `pop` and in `splats`.
const KINDS: [(SplatKind, &str, &str); 6] = [
    (SplatKind::Square, "pop", "splats"),
    (SplatKind::Disc, "disc", "splats-disc"),
    (SplatKind::Ellipse, "ellipse", "splats-ellipse"),
    (SplatKind::Gauss, "gauss", "splats-gauss"),
    (SplatKind::Visibility, "visibility", "splats-visibility"),
    (SplatKind::Filtered, "filtered", "splats-filtered"),
];

/// Scenes with few vertices at sharp edges.
const SHARP: &[&str] = &["cube-edge", "cube-corner", "pedestal", "statue-on-plinth"];

/// Splats from vertices.
fn from_vertices(rules: SplatRules) -> Settings {
    Settings {
        method: Method::Splats,
        vertex_splats: Some(rules),
        ..Settings::default()
    }
}

/// Every way of drawing: `triangles`, `points`, `pop` with each kind of splat (named after the kind; `pop` is the default
/// of the program), `splats` with each; then some of these with an option changed, for the scenes where it matters.
pub fn looks() -> Vec<FailureLook> {
    let usual = Settings::default();
    let look = |name, settings| FailureLook {
        name,
        settings,
        only: &[],
    };
    let with = |method, splat| Settings {
        method,
        splat,
        ..usual
    };
    let culling = |culling, splat| Settings {
        culling,
        ..with(Method::Pop, splat)
    };
    let mut looks = vec![
        look("triangles", with(Method::Triangles, usual.splat)),
        look("points", with(Method::Points, usual.splat)),
    ];
    looks.extend(KINDS.map(|(kind, name, _)| look(name, with(Method::Pop, kind))));
    looks.extend(KINDS.map(|(kind, _, name)| look(name, with(Method::Splats, kind))));
    let patches = Settings {
        patches: Some(PatchRules::default()),
        ..usual
    };
    looks.push(look("patches", patches));
    looks.extend([
        FailureLook {
            only: SHARP,
            ..look("vertices, whole", from_vertices(SplatRules::default()))
        },
        FailureLook {
            only: SHARP,
            ..look("vertices, cut", from_vertices(SplatRules::usual()))
        },
        FailureLook {
            only: &["open-behind", "inside"],
            ..look("pop, culling on", culling(Culling::On, SplatKind::Square))
        },
        FailureLook {
            only: &["thin-plate", "inside", "sheets-1"],
            ..look("pop, culling off", culling(Culling::Off, SplatKind::Square))
        },
        FailureLook {
            only: &["thin-plate", "inside"],
            ..look(
                "filtered, culling off",
                culling(Culling::Off, SplatKind::Filtered),
            )
        },
        FailureLook {
            only: &["thin-plate"],
            ..look(
                "gauss, culling off",
                culling(Culling::Off, SplatKind::Gauss),
            )
        },
        FailureLook {
            only: &["sheets-0.5", "sheets-2", "sheets-4", "sheets-tilted"],
            ..look(
                "filtered, offset 1",
                Settings {
                    depth_offset: Some(1.0),
                    ..with(Method::Pop, SplatKind::Filtered)
                },
            )
        },
    ]);
    looks
}

/// Scenes that belong together, with a name for files and one for people.
pub static GROUPS: &[(&str, &str, &[&str])] = &[
    (
        "outline",
        "outlines, edges, horizons",
        &[
            "silhouette",
            "horizon",
            "cube-edge",
            "cube-corner",
            "pedestal",
            "statue-on-plinth",
            "open-behind",
            "edge-on",
        ],
    ),
    (
        "layers",
        "surfaces close behind one another",
        &[
            "thin-plate",
            "sheets-0.5",
            "sheets-1",
            "sheets-2",
            "sheets-4",
            "sheets-fine",
            "sheets-tilted",
            "overlap",
            "stack",
        ],
    ),
    (
        "detail",
        "colors, normals and detail below a pixel",
        &[
            "opposite-normals",
            "zero-normals",
            "checkerboard",
            "noise",
            "foliage",
            "fence",
            "under-pixel",
        ],
    ),
    (
        "openings",
        "holes, gaps and thin parts",
        &[
            "pierced-sheet",
            "strips",
            "pillars",
            "thin-foil",
            "crossing",
            "waves",
        ],
    ),
    (
        "triangles",
        "triangles that trees and splats do not like",
        &[
            "needles",
            "obtuse",
            "huge-triangle",
            "spikes",
            "degenerate",
            "coincident-vertices",
        ],
    ),
    (
        "limits",
        "limits of devices, views and numbers",
        &[
            "coincident-points",
            "duplicate-points",
            "near-points",
            "beside-view",
            "near-plane",
            "inside",
            "georeferenced",
            "microscopic",
            "one-triangle",
            "one-point",
            "empty",
        ],
    ),
];

/// What is heard of every cell: the case, the way of drawing, the verdict, the picture.
pub type Sink<'a> =
    dyn FnMut(&FailureCase, &FailureLook, FailureCell, Image) -> Result<(), FailuresError> + 'a;

/// Draws scenes by looks on `backend`, scene by scene, and judges each picture. The truth is drawn there too.
///
/// # Errors
/// When the device cannot draw, `sink` fails, or `progress` cancels.
pub fn run(
    backend: &Backend,
    entries: &[&'static SceneEntry],
    looks: &[FailureLook],
    progress: &dyn Progress,
    sink: &mut Sink<'_>,
) -> Result<(), FailuresError> {
    progress.stage("draw", entries.len() as u64);
    for entry in entries {
        let case = FailureCase::new(entry, backend)?;
        let mut engine = case.engine(backend)?;
        for look in looks.iter().filter(|look| look.is_for(&case)) {
            if progress.is_cancelled() {
                return Err(FailuresError::Cancelled);
            }
            let picture = case.draw(&mut engine, look)?;
            let cell = case.judge(look, &picture)?;
            sink(&case, look, cell, picture)?;
        }
        progress.advance(1);
    }
    Ok(())
}

impl FailureCase {
    /// The size up to which nodes are splats, pixels: the scene's threshold, which is there to show what splats do wrong. Beside
    /// patches, whose errors do not grow with it, at most a pixel.
    pub fn splat_px(&self, look: &FailureLook) -> f32 {
        match look.settings.patches {
            Some(_) => self.threshold_px.min(1.0),
            None => self.threshold_px,
        }
    }

    /// Makes what draws the scene by every look.
    ///
    /// # Errors
    /// When the device cannot hold the model.
    pub fn engine(&self, backend: &Backend) -> Result<Engine<'_>, FailuresError> {
        let size = (self.view.width, self.view.height);
        let outputs = PictureOutputs::default();
        Ok(Engine::new(backend, &self.model, size, outputs)?)
    }

    /// Draws the picture of a look with an engine [of the scene](Self::engine).
    ///
    /// # Errors
    /// When the device cannot draw.
    pub fn draw(
        &self,
        engine: &mut Engine<'_>,
        look: &FailureLook,
    ) -> Result<Image, FailuresError> {
        let settings = Settings {
            threshold_px: self.splat_px(look),
            ..look.settings
        };
        Ok(engine.render(&self.view, &settings)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes;

    #[test]
    fn every_scene_is_in_one_group_and_every_name_is_one() {
        let grouped: Vec<&str> = GROUPS.iter().flat_map(|g| g.2).copied().collect();
        let all: Vec<&str> = scenes::ALL.iter().map(|e| e.name).collect();
        assert_eq!(grouped, all, "in the order of the documents");
        let looks = looks();
        for (k, look) in looks.iter().enumerate() {
            assert!(looks[..k].iter().all(|l| l.name != look.name));
            assert!(look.only.iter().all(|name| scenes::find(name).is_some()));
        }
        assert_eq!(looks[2].settings, Settings::default());
    }
}
