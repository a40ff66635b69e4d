//! Catalog of the golden cases: every technique, and for every executor whether it draws it or refuses it.

use surfel::oriented::splats::SplatRules;
use surfel::pack::lit_sphere::LitSphere;
use surfel::pack::{ColorBy, Lamp, Phong, SurfaceLighting};
use surfel::patches::{ErrorTolerances, PatchRules};
use surfel::render::{
    AmbientOcclusion, Blend, EyeDome, Method, Occlusion, Path, Reconstruction, Settings, Shading,
    SplatKind,
};

/// What draws a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PictureExecutor {
    /// The device's rasterizer. Blesses the goldens.
    Hardware,
    /// Compute shaders of the device.
    Compute,
    /// The processor's fast renderer, without a device.
    Host,
    /// The reference renderer.
    Reference,
}

impl PictureExecutor {
    /// All of them; the first that does not refuse a case blesses its golden.
    pub(crate) const ALL: [Self; 4] = [Self::Hardware, Self::Compute, Self::Host, Self::Reference];

    /// `settings` that leave an engine no choice.
    pub(crate) fn insist(self, settings: &Settings) -> Settings {
        Settings {
            path: match self {
                Self::Hardware => Path::Raster,
                Self::Compute => Path::Compute,
                Self::Host | Self::Reference => Path::Auto,
            },
            ..*settings
        }
    }
}

/// A case that an executor does not draw.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GoldenRefusal {
    pub(crate) executor: PictureExecutor,
    /// Words of the reason in the error.
    pub(crate) words: &'static str,
}

/// A picture that is kept of each golden model.
#[derive(Debug, Clone)]
pub(crate) struct GoldenCase {
    /// Part of the file's name.
    pub(crate) name: &'static str,
    pub(crate) settings: Settings,
    /// Azimuth and elevation in degrees, fill of the picture by the bounding sphere.
    pub(crate) orbit: [f64; 3],
    pub(crate) refused: Vec<GoldenRefusal>,
}

/// Cases that are kept of the scan as well, which has colors, an open surface, needles and triangles without area.
const OF_SCAN: [&str; 16] = [
    "triangles",
    "pop-1",
    "pop-4",
    "disc",
    "ellipse",
    "gauss",
    "disc-blended",
    "patches",
    "splats",
    "filtered-1",
    "filtered-3",
    "visibility-gaussian",
    "lamp",
    "studio",
    "occlusion",
    "normal",
];

impl GoldenCase {
    /// Whether a picture of this model is kept.
    pub(crate) fn is_kept_of(&self, model: &str) -> bool {
        model != "scan" || OF_SCAN.contains(&self.name)
    }

    /// Why an executor does not draw it, if it does not.
    pub(crate) fn refusal(&self, executor: PictureExecutor) -> Option<GoldenRefusal> {
        self.refused
            .iter()
            .copied()
            .find(|r| r.executor == executor)
    }

    /// The executor whose picture is kept.
    pub(crate) fn blessed_by(&self) -> Option<PictureExecutor> {
        let mut all = PictureExecutor::ALL.into_iter();
        all.find(|&executor| self.refusal(executor).is_none())
    }

    fn by_orbit(self, orbit: [f64; 3]) -> Self {
        Self { orbit, ..self }
    }

    fn without(mut self, executor: PictureExecutor, words: &'static str) -> Self {
        self.refused.push(GoldenRefusal { executor, words });
        self
    }

    /// Not by compute, for this reason.
    fn no_compute(self, words: &'static str) -> Self {
        self.without(PictureExecutor::Compute, words)
    }

    /// Not by the host.
    fn no_host(self, words: &'static str) -> Self {
        self.without(PictureExecutor::Host, words)
    }
}

const WHOLE: [f64; 3] = [30.0, 20.0, 1.0];
const FAR: [f64; 3] = [30.0, 20.0, 0.4];
const NEAR: [f64; 3] = [30.0, 20.0, 6.0];

// Reasons of compute.
const OF_A_TREE: &str = "it draws blended, filtered and visibility splats of a tree";
const TOO_LARGE: &str = "squares and discs of this size are cheaper to rasterize";
const SUMS_COLORS: &str = "it sums colors, not normals";
const NO_COUNTS: &str = "footprints are counted by the rasterizer";
const ONE_PASS: &str = "it needs ordered access to a pixel";

// Reasons of the processor's renderer.
const NO_POINTS: &str = "it draws no vertices as points";
const NOT_BLENDED: &str = "it blends filtered splats only";
const NOT_VISIBILITY: &str = "it draws no visibility splats";
const NO_CLASSES: &str = "only visibility splats have a classification";
const NOT_COUNTED: &str = "it counts no overdraw";

/// Every golden case. Thresholds and distances are those at which triangles and splats stand side by side.
pub(crate) fn cases() -> Vec<GoldenCase> {
    let case = |name, method, splat, threshold_px| GoldenCase {
        name,
        settings: Settings {
            method,
            splat,
            threshold_px,
            ..Settings::default()
        },
        orbit: WHOLE,
        refused: Vec::new(),
    };
    let with = |case: GoldenCase, change: &dyn Fn(&mut Settings)| {
        let mut changed = case;
        change(&mut changed.settings);
        changed
    };
    // Beside the eye, so that shades and highlights differ from the headlight's.
    let lamp = SurfaceLighting::Phong(Phong {
        lamp: Lamp::FromCamera {
            azimuth: 0.9,
            elevation: 0.4,
        },
        ..Phong::default()
    });
    use Method::{Points, Pop, Splats, Triangles};
    use SplatKind::{Disc, Ellipse, Filtered, Gauss, Square, Visibility};
    vec![
        case("triangles", Triangles, Square, 1.0).no_compute(OF_A_TREE),
        case("points-2", Points, Square, 2.0)
            .no_compute(OF_A_TREE)
            .no_host(NO_POINTS),
        case("points-gauss", Points, Gauss, 4.0)
            .no_compute(OF_A_TREE)
            .no_host(NO_POINTS),
        case("pop-1", Pop, Square, 1.0).by_orbit(FAR),
        case("pop-4", Pop, Square, 4.0),
        case("pop-near", Pop, Square, 9.0)
            .by_orbit(NEAR)
            .no_compute(TOO_LARGE),
        case("disc", Pop, Disc, 4.0),
        case("ellipse", Pop, Ellipse, 4.0),
        case("gauss", Pop, Gauss, 4.0).no_host(NOT_BLENDED),
        with(case("gauss-deferred", Pop, Gauss, 4.0), &|s| {
            s.shading = Shading::Deferred;
        })
        .no_compute(SUMS_COLORS)
        .no_host(NOT_BLENDED),
        with(case("disc-blended", Pop, Disc, 4.0), &|s| {
            s.blend = Some(Blend::TwoPass);
        })
        .no_host(NOT_BLENDED),
        with(case("disc-threshold", Pop, Disc, 4.0), &|s| {
            s.blend = Some(Blend::DepthThreshold);
        })
        .without(PictureExecutor::Hardware, ONE_PASS)
        .no_compute(ONE_PASS)
        .no_host(NOT_BLENDED),
        with(case("disc-range", Pop, Disc, 4.0), &|s| {
            s.blend = Some(Blend::DepthRange);
        })
        .without(PictureExecutor::Hardware, ONE_PASS)
        .no_compute(ONE_PASS)
        .no_host(NOT_BLENDED),
        with(case("patches", Pop, Square, 1.0), &|s| {
            s.patches = Some(PatchRules::default());
        }),
        with(case("patches-coarse", Pop, Square, 1.0), &|s| {
            let tolerances = ErrorTolerances {
                rim_px: 1.0,
                inside_px: 2.0,
                shade_levels: 64.0,
            };
            s.patches = Some(PatchRules {
                tolerances,
                is_strict: true,
                ..PatchRules::default()
            });
            s.light = lamp;
        })
        .by_orbit(NEAR),
        with(case("from-vertices", Splats, Square, 1.0), &|s| {
            s.vertex_splats = Some(SplatRules::default());
        }),
        with(case("from-vertices-gauss", Splats, Gauss, 1.0), &|s| {
            s.vertex_splats = Some(SplatRules::default());
        }),
        with(
            case("from-vertices-visibility", Splats, Visibility, 1.0),
            &|s| {
                s.vertex_splats = Some(SplatRules::default());
            },
        ),
        case("splats", Splats, Square, 2.0).no_compute(OF_A_TREE),
        case("splats-gauss", Splats, Gauss, 2.0).no_host(NOT_BLENDED),
        with(case("primitive", Pop, Square, 2.5), &|s| {
            s.color_by = ColorBy::Primitive;
        }),
        with(case("background", Pop, Square, 2.0), &|s| {
            s.background = [0.2, 0.4, 0.8];
        })
        .by_orbit([200.0, -30.0, 0.7]),
        case("filtered-1", Pop, Filtered, 1.0).by_orbit(FAR),
        case("filtered-3", Pop, Filtered, 3.0),
        case("visibility-gaussian", Pop, Visibility, 4.0).no_host(NOT_VISIBILITY),
        with(case("visibility-density", Points, Visibility, 4.0), &|s| {
            s.reconstruction = Reconstruction::Density;
        })
        .no_compute(OF_A_TREE)
        .no_host(NO_POINTS),
        with(case("visibility-pull-push", Pop, Visibility, 4.0), &|s| {
            s.reconstruction = Reconstruction::PullPush;
        })
        .by_orbit(NEAR)
        .no_host(NOT_VISIBILITY),
        with(case("visibility-holes", Pop, Visibility, 6.0), &|s| {
            s.reconstruction = Reconstruction::PullPush;
        })
        .no_host(NOT_VISIBILITY),
        with(case("visibility-class", Pop, Visibility, 4.0), &|s| {
            s.color_by = ColorBy::Classification;
        })
        .no_host(NO_CLASSES),
        with(case("lamp-triangles", Triangles, Square, 1.0), &|s| {
            s.light = lamp;
        })
        .no_compute(OF_A_TREE),
        with(case("lamp", Pop, Square, 3.0), &|s| s.light = lamp),
        with(case("lamp-gauss", Pop, Gauss, 3.0), &|s| s.light = lamp).no_host(NOT_BLENDED),
        with(case("lamp-filtered", Pop, Filtered, 6.0), &|s| {
            s.light = lamp;
        }),
        with(case("studio", Pop, Square, 3.0), &|s| {
            s.light = SurfaceLighting::Sphere(LitSphere::Studio);
        }),
        with(case("clay", Pop, Disc, 3.0), &|s| {
            s.light = SurfaceLighting::Sphere(LitSphere::Clay);
        }),
        with(case("porcelain-filtered", Pop, Filtered, 6.0), &|s| {
            s.light = SurfaceLighting::Sphere(LitSphere::Porcelain);
        }),
        with(case("metal-triangles", Triangles, Square, 1.0), &|s| {
            s.light = SurfaceLighting::Sphere(LitSphere::Metal);
        })
        .no_compute(OF_A_TREE),
        with(case("metal-gauss", Pop, Gauss, 3.0), &|s| {
            s.light = SurfaceLighting::Sphere(LitSphere::Metal);
        })
        .no_host(NOT_BLENDED),
        with(case("occlusion", Pop, Square, 2.0), &|s| {
            s.ambient_occlusion = AmbientOcclusion::On;
        }),
        with(case("eye-dome", Pop, Square, 2.0), &|s| {
            s.eye_dome = EyeDome::On;
        }),
        with(case("gradient", Pop, Square, 2.0), &|s| {
            (s.background, s.background_bottom) = ([0.8, 0.6, 0.2], Some([0.0, 0.1, 0.3]));
        }),
        with(case("overdraw", Pop, Square, 3.0), &|s| {
            s.color_by = ColorBy::Overdraw;
            // Which path would draw decides what is left out, and so what is counted.
            s.occlusion = Occlusion::Off;
        })
        .no_compute(NO_COUNTS)
        .no_host(NOT_COUNTED),
        with(case("level", Pop, Square, 3.0), &|s| {
            s.color_by = ColorBy::Level;
        }),
        with(case("normal", Pop, Square, 3.0), &|s| {
            s.color_by = ColorBy::Normal;
        }),
        with(case("depth", Pop, Square, 3.0), &|s| {
            s.color_by = ColorBy::Depth;
        }),
    ]
}
