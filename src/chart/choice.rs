//! What is measured: a method with its splat, its path and its threshold.

use crate::oriented::splats::{LevelLeaf, SplatRules};
use crate::patches::{ErrorTolerances, PatchRules};
use crate::render::{Method, Path, Settings, SplatKind};

/// Records that splats are made from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordSource {
    /// Nodes and leaves of the tree.
    Tree,
    /// Error patches of nodes, whatever their size, once their error is small; then the threshold is their tolerance elsewhere
    /// than at silhouettes ([`ErrorTolerances::within`]), and what is no patch is drawn at a pixel.
    Patches,
    /// Vertices, cut at sharp edges, with levels by the threshold.
    Vertices,
}

/// One way to draw a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawConfiguration {
    /// The method.
    pub method: Method,
    /// What its splats look like; of no account for triangles.
    pub splat: SplatKind,
    /// Origin of its splats.
    pub source: RecordSource,
    /// By rasterizer or by compute, which are two lines of the chart. Left to the program is a third one where it then draws by neither:
    /// on software devices by the host ([`SplatKind::host_draws`]).
    pub path: Path,
    /// Threshold, pixels. 0 for triangles, which have none.
    pub threshold_px: f32,
}

/// Every triangle, by the rasterizer: what the others are compared with.
pub const TRIANGLES: DrawConfiguration = DrawConfiguration {
    method: Method::Triangles,
    splat: SplatKind::Square,
    source: RecordSource::Tree,
    path: Path::Raster,
    threshold_px: 0.0,
};

/// The thresholds of a full chart, pixels.
pub const THRESHOLDS: [f32; 11] = [0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0];

/// The tolerances of patches in a full chart, pixels.
pub const TOLERANCES: [f32; 6] = [0.0625, 0.125, 0.25, 0.5, 1.0, 2.0];

/// All kinds of splats, in the order of the legend.
pub const KINDS: [SplatKind; 6] = [
    SplatKind::Square,
    SplatKind::Disc,
    SplatKind::Ellipse,
    SplatKind::Gauss,
    SplatKind::Visibility,
    SplatKind::Filtered,
];

/// Ways to draw besides splats by the rasterizer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AvailablePaths {
    /// Compute shaders.
    pub compute: bool,
    /// The host.
    pub host: bool,
    /// Records of error patches of the model.
    pub patches: bool,
    /// Splats from the vertices of the model.
    pub vertices: bool,
}

#[cfg(test)]
impl AvailablePaths {
    pub(super) const NONE: Self = Self {
        compute: false,
        host: false,
        patches: false,
        vertices: false,
    };
    pub(super) const ALL: Self = Self {
        compute: true,
        host: true,
        patches: true,
        vertices: true,
    };
}

/// The name of error patches in files.
const PATCH: &str = "patch";
/// The name of splats from vertices in files.
const VERTICES: &str = "vertices";

/// The name that a value has in files.
fn word(value: &impl serde::Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(word)) => word,
        _ => String::new(),
    }
}

impl DrawConfiguration {
    fn new(method: Method, splat: SplatKind, threshold_px: f32) -> Self {
        Self {
            method,
            splat,
            source: RecordSource::Tree,
            path: Path::Raster,
            threshold_px,
        }
    }

    fn of_patches(tolerance_px: f32) -> Self {
        Self {
            source: RecordSource::Patches,
            ..Self::new(Method::Pop, SplatKind::Square, tolerance_px)
        }
    }

    fn of_vertices(threshold_px: f32) -> Self {
        Self {
            source: RecordSource::Vertices,
            ..Self::new(Method::Splats, SplatKind::Square, threshold_px)
        }
    }

    /// Tells whether compute shaders can draw it on a device that has what they need.
    fn has_twin(&self) -> bool {
        match (self.method, self.splat) {
            _ if self.source != RecordSource::Tree => false,
            (Method::Pop, SplatKind::Square | SplatKind::Disc) => {
                self.threshold_px <= crate::render::LARGEST_COMPUTE_SQUARE_PX
            }
            (Method::Pop, SplatKind::Ellipse) => {
                self.threshold_px <= crate::render::LARGEST_COMPUTE_ELLIPSE_PX
            }
            (
                Method::Pop | Method::Splats,
                SplatKind::Gauss | SplatKind::Visibility | SplatKind::Filtered,
            ) => self.threshold_px <= crate::render::LARGEST_COMPUTE_BLENDED_PX,
            _ => false,
        }
    }

    /// The same by all ways there are, this one first.
    fn by(self, ways: AvailablePaths) -> impl Iterator<Item = Self> {
        let compute = (ways.compute && self.has_twin()).then_some(Path::Compute);
        let host = (ways.host && self.splat.host_draws()).then_some(Path::Auto);
        let paths = [Some(self.path), compute, host];
        paths
            .into_iter()
            .flatten()
            .map(move |path| Self { path, ..self })
    }

    /// Everything at the given thresholds that makes sense for a mesh, or for a cloud: triangles, points (up to 3 pixels),
    /// splats and pop with every kind of splat, by all ways there are.
    pub fn all(thresholds: &[f32], is_cloud: bool, ways: AvailablePaths) -> Vec<Self> {
        let has_patches = ways.patches && !is_cloud;
        let mut all = Vec::new();
        if !is_cloud {
            all.push(TRIANGLES);
        }
        for splat in KINDS {
            // A size below a pixel is drawn as one.
            let sizes = thresholds.iter().filter(|t| (1.0..=3.0).contains(*t));
            if splat != SplatKind::Filtered {
                all.extend(sizes.map(|t| Self::new(Method::Points, splat, *t)));
            }
        }
        for method in [Method::Splats, Method::Pop] {
            // Without triangles both draw the same.
            if is_cloud && method == Method::Pop {
                continue;
            }
            for splat in KINDS {
                for &threshold in thresholds {
                    all.extend(Self::new(method, splat, threshold).by(ways));
                }
            }
        }
        for tolerance in TOLERANCES.into_iter().filter(|_| has_patches) {
            all.extend(Self::of_patches(tolerance).by(ways));
        }
        if ways.vertices && !is_cloud {
            all.extend(thresholds.iter().map(|&t| Self::of_vertices(t)));
        }
        all
    }

    /// Some dozens of them, for a first look.
    pub fn few(is_cloud: bool, ways: AvailablePaths) -> Vec<Self> {
        use SplatKind::{Disc, Ellipse, Filtered, Gauss, Square, Visibility};
        let method = if is_cloud {
            Method::Splats
        } else {
            Method::Pop
        };
        let has_patches = ways.patches && !is_cloud;
        let mut few = Vec::new();
        if !is_cloud {
            few.push(TRIANGLES);
        }
        few.push(Self::new(Method::Points, Square, 1.0));
        for (splat, thresholds) in [
            (Square, &[0.25, 0.5, 1.0, 2.0, 4.0][..]),
            (Disc, &[2.0]),
            (Ellipse, &[1.0, 2.0]),
            (Gauss, &[2.0]),
            (Visibility, &[2.0]),
            (Filtered, &[0.5, 1.0, 2.0, 4.0]),
        ] {
            for &threshold in thresholds {
                let raster = Self::new(method, splat, threshold);
                // The slowest of all; its twin has the same picture.
                let is_left_out = ways.compute && raster.has_twin() && threshold < 1.0;
                few.extend(raster.by(ways).skip(usize::from(is_left_out)));
            }
        }
        for tolerance in [0.125, 0.25, 0.5, 1.0].into_iter().filter(|_| has_patches) {
            few.extend(Self::of_patches(tolerance).by(ways));
        }
        if ways.vertices && !is_cloud {
            few.extend([0.5, 1.0, 2.0, 4.0].map(Self::of_vertices));
        }
        few
    }

    /// The settings that draw it; all others are the usual ones.
    pub fn settings(&self) -> Settings {
        Settings {
            method: self.method,
            splat: self.splat,
            path: self.path,
            threshold_px: self.splat_px(),
            patches: self.rules(),
            vertex_splats: (self.source == RecordSource::Vertices).then(|| SplatRules {
                levels: Some(LevelLeaf::Splats),
                ..SplatRules::usual()
            }),
            ..Settings::default()
        }
    }

    /// Size from which on nodes are gone into, pixels.
    fn splat_px(&self) -> f32 {
        match self.source {
            RecordSource::Patches => 1.0,
            RecordSource::Tree | RecordSource::Vertices => self.threshold_px,
        }
    }

    /// Rules for nodes that are patches; `None` where none is.
    fn rules(&self) -> Option<PatchRules> {
        (self.source == RecordSource::Patches).then(|| PatchRules {
            tolerances: ErrorTolerances::within(self.threshold_px),
            ..PatchRules::default()
        })
    }

    /// The word for what nodes are drawn as.
    fn shape(&self) -> String {
        match self.source {
            RecordSource::Patches => PATCH.into(),
            RecordSource::Vertices => VERTICES.into(),
            RecordSource::Tree => word(&self.splat),
        }
    }

    /// Name of the line in the chart: everything but the threshold, such as `pop square, compute`.
    pub fn line(&self) -> String {
        let method = word(&self.method);
        if self.method == Method::Triangles {
            return method;
        }
        let path = match self.path {
            Path::Raster => "",
            Path::Compute => ", compute",
            Path::Auto => ", auto",
        };
        format!("{method} {}{path}", self.shape())
    }

    /// Name of the point, such as `pop square, compute, 2 px`.
    pub fn name(&self) -> String {
        if self.method == Method::Triangles {
            return self.line();
        }
        format!("{}, {} px", self.line(), self.threshold_px)
    }

    /// Method, splat (or what stands for it: patch, vertices) and path as they stand in files.
    pub fn words(&self) -> [String; 3] {
        [word(&self.method), self.shape(), word(&self.path)]
    }

    /// The choice of these words; `None` when one of them is none.
    pub fn of_words(method: &str, splat: &str, path: &str, threshold_px: f32) -> Option<Self> {
        let method = [
            Method::Triangles,
            Method::Points,
            Method::Splats,
            Method::Pop,
        ]
        .into_iter()
        .find(|m| word(m) == method)?;
        let source = match splat {
            PATCH => RecordSource::Patches,
            VERTICES => RecordSource::Vertices,
            _ => RecordSource::Tree,
        };
        let splat = match source {
            RecordSource::Tree => KINDS.into_iter().find(|s| word(s) == splat)?,
            RecordSource::Patches | RecordSource::Vertices => SplatKind::Square,
        };
        let path = [Path::Raster, Path::Compute, Path::Auto]
            .into_iter()
            .find(|p| word(p) == path)?;
        // Written so that NaN is refused.
        (threshold_px >= 0.0).then_some(Self {
            method,
            splat,
            source,
            path,
            threshold_px,
        })
    }

    /// Options of `surfel render` that draw it.
    pub fn options(&self) -> String {
        let [method, splat, path] = self.words();
        if self.method == Method::Triangles {
            return format!("--method {method} --path {path}");
        }
        if let Some(PatchRules { tolerances, .. }) = self.rules() {
            let ErrorTolerances {
                rim_px,
                inside_px,
                shade_levels,
            } = tolerances;
            return format!(
                "--method {method} --error {rim_px},{inside_px},{shade_levels} --path {path}"
            );
        }
        if self.source == RecordSource::Vertices {
            return format!(
                "--method {method} --from vertices --levels splats --threshold {} --path {path}",
                self.threshold_px
            );
        }
        format!(
            "--method {method} --splat {splat} --threshold {} --path {path}",
            self.threshold_px
        )
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_words_lead_back() {
        for choices in [
            DrawConfiguration::all(&THRESHOLDS, false, AvailablePaths::ALL),
            DrawConfiguration::all(&THRESHOLDS, true, AvailablePaths::NONE),
            DrawConfiguration::few(false, AvailablePaths::ALL),
            DrawConfiguration::few(true, AvailablePaths::NONE),
        ] {
            let mut names: Vec<String> = choices.iter().map(DrawConfiguration::name).collect();
            names.sort();
            names.dedup();
            assert_eq!(names.len(), choices.len());
            for choice in choices {
                let [m, s, p] = choice.words();
                assert_eq!(
                    DrawConfiguration::of_words(&m, &s, &p, choice.threshold_px).unwrap(),
                    choice
                );
            }
        }
        assert!(DrawConfiguration::of_words("pop", "square", "host", 1.0).is_none());
        assert!(DrawConfiguration::of_words("pop", "square", "raster", f32::NAN).is_none());
    }

    #[test]
    fn clouds_have_no_triangles_and_twins_need_what_draws_them() {
        let cloud = DrawConfiguration::all(&THRESHOLDS, true, AvailablePaths::NONE);
        assert!(
            cloud
                .iter()
                .all(|c| matches!(c.method, Method::Points | Method::Splats)
                    && c.path == Path::Raster)
        );
        let count = |ways: AvailablePaths, path: Path| {
            let all = DrawConfiguration::all(&THRESHOLDS, false, ways).into_iter();
            all.filter(|c| c.path == path).count()
        };
        for path in [Path::Compute, Path::Auto] {
            assert_eq!(count(AvailablePaths::NONE, path), 0);
        }
        // Squares and discs up to 6 pixels, ellipses up to 10; Gaussians, visibility and filtered splats of all eleven sizes, in
        // splats and in pop.
        assert_eq!(
            count(AvailablePaths::ALL, Path::Compute),
            2 * 8 + 9 + 6 * 11
        );
        // Squares, discs and filtered splats; patches.
        assert_eq!(
            count(AvailablePaths::ALL, Path::Auto),
            2 * 3 * 11 + TOLERANCES.len()
        );
        let lines = |is_cloud, path| {
            let few = DrawConfiguration::few(is_cloud, AvailablePaths::ALL).into_iter();
            let mut lines: Vec<String> = few.filter(|c| c.path == path).map(|c| c.line()).collect();
            lines.dedup();
            lines
        };
        let of_pop = [
            "pop square, compute",
            "pop disc, compute",
            "pop ellipse, compute",
            "pop gauss, compute",
            "pop visibility, compute",
            "pop filtered, compute",
        ];
        assert_eq!(lines(false, Path::Compute), of_pop);
        let by_host = ["pop square, auto", "pop disc, auto", "pop filtered, auto"];
        let found = lines(false, Path::Auto);
        assert_eq!(found[..3], by_host);
        assert_eq!(found[3..], ["pop patch, auto"]);
        let of_vertices = |few: Vec<DrawConfiguration>| {
            let of = few.into_iter().filter(|c| c.line() == "splats vertices");
            of.map(|c| c.options()).collect::<Vec<_>>()
        };
        let few = of_vertices(DrawConfiguration::few(false, AvailablePaths::ALL));
        assert_eq!(few.len(), 4);
        assert_eq!(
            few[1],
            "--method splats --from vertices --levels splats --threshold 1 --path raster"
        );
        let none = AvailablePaths {
            vertices: false,
            ..AvailablePaths::ALL
        };
        for without in [
            DrawConfiguration::few(false, none),
            DrawConfiguration::all(&THRESHOLDS, false, none),
            DrawConfiguration::all(&THRESHOLDS, true, AvailablePaths::ALL),
        ] {
            assert!(of_vertices(without).is_empty());
        }
        let all = DrawConfiguration::all(&THRESHOLDS, false, AvailablePaths::ALL);
        assert_eq!(of_vertices(all).len(), THRESHOLDS.len());
        let of_cloud = [
            "splats gauss, compute",
            "splats visibility, compute",
            "splats filtered, compute",
        ];
        assert_eq!(lines(true, Path::Compute), of_cloud);
        let by_host = by_host.map(|line| line.replace("pop", "splats"));
        assert_eq!(lines(true, Path::Auto), by_host);
    }
}
