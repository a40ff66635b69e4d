//! What is measured: the standard models, how they are drawn, from where, and how often.

use super::report::BenchPlace;
use super::verdict::BenchTarget;
use crate::chart::run::orbit;
use crate::math::camera::{Camera, View};
use crate::patches::{ErrorTolerances, PatchRules};
use crate::render::{CutOn, ListOf, Method, Path, Settings, SplatKind};
use crate::tree::{Model, OrbitSphere};
use glam::DVec3;

/// A model of the run.
#[derive(Debug, Clone, Copy)]
pub struct BenchCase<'m> {
    /// Name of the case.
    pub name: &'m str,
    /// The model.
    pub model: &'m Model,
}

/// The models that targets are stated for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CaseStandard {
    /// A sphere of a million triangles.
    Sphere,
    /// A torus of four million needles.
    Torus,
    /// The statue of eight million triangles.
    Statue,
    /// The scanned dragon of 871,414 triangles.
    Dragon,
}

impl CaseStandard {
    /// All of them, in the order of a run.
    pub const ALL: [Self; 4] = [Self::Sphere, Self::Torus, Self::Statue, Self::Dragon];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Torus => "torus",
            Self::Statue => "statue",
            Self::Dragon => "dragon",
        }
    }

    /// Number of triangles of the model.
    pub fn triangles(self) -> u64 {
        match self {
            Self::Sphere => 1_000_000,
            Self::Torus => 4_000_000,
            Self::Statue => 7_990_272,
            Self::Dragon => 871_414,
        }
    }

    /// The one of a name and a number of triangles; `None` of any other size: targets hold for the full size only.
    pub fn of(name: &str, triangles: u64) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|s| s.name() == name && s.triangles() == triangles)
    }
}

/// The picture size that targets are stated for.
pub const SIZE: (u32, u32) = (500, 500);

impl BenchCase<'_> {
    /// The standard model that it is.
    pub fn standard(&self) -> Option<CaseStandard> {
        CaseStandard::of(self.name, self.model.triangles.len() as u64)
    }

    /// Place of the case in pictures of a size at a distance.
    pub fn place(&self, size: (u32, u32), fill: f64) -> BenchPlace {
        BenchPlace {
            model: self.name.to_owned(),
            triangles: self.model.triangles.len() as u64,
            size,
            fill,
        }
    }

    /// How much faster than triangles the default method has to be at threshold 1.
    pub fn speed_target(&self, size: (u32, u32), fill: f64) -> Option<BenchTarget> {
        let standard = self.standard()?;
        if size != SIZE {
            return None;
        }
        let times = match (standard, fill) {
            (CaseStandard::Statue, 1.0) => 40.0,
            (CaseStandard::Torus, 1.0) => 8.0,
            (CaseStandard::Statue | CaseStandard::Torus, 0.125) => 100.0,
            _ => return None,
        };
        Some(BenchTarget::AtLeast(times))
    }

    /// The accuracy that filtered splats have to have at a distance, decibels, and the milliseconds in which.
    pub fn filtered_target(&self, fill: f64) -> Option<(f64, BenchTarget)> {
        let (db, ms) = match (self.standard()?, fill) {
            (CaseStandard::Statue, 1.0) => (30.0, 15.0),
            (CaseStandard::Statue, 0.5) => (28.0, 6.0),
            (CaseStandard::Statue, 0.125) => (27.0, 2.0),
            _ => return None,
        };
        Some((db, BenchTarget::AtMost(ms)))
    }
}

/// One way to draw.
#[derive(Debug, Clone, PartialEq)]
pub struct BenchLine {
    /// Name of the line in tables.
    pub name: String,
    /// How.
    pub settings: Settings,
    /// Slow and always the same: drawn from every third view only, where there are many.
    pub is_rare: bool,
}

/// Plain triangles.
pub fn triangles() -> BenchLine {
    BenchLine {
        name: "triangles".into(),
        settings: Settings {
            method: Method::Triangles,
            path: Path::Raster,
            ..Settings::default()
        },
        is_rare: true,
    }
}

/// The default method, splat and path at a threshold.
pub fn default(threshold_px: f32) -> BenchLine {
    BenchLine {
        name: format!("default, {threshold_px} px"),
        settings: Settings {
            threshold_px,
            ..Settings::default()
        },
        is_rare: false,
    }
}

/// `pop` with a kind of splat, by one path.
pub fn pop(splat: SplatKind, path: Path, threshold_px: f32) -> BenchLine {
    let word = |value: &dyn Fn() -> serde_json::Result<serde_json::Value>| match value() {
        Ok(serde_json::Value::String(word)) => word,
        _ => String::new(),
    };
    let kind = word(&|| serde_json::to_value(splat));
    let by = by_path(path);
    BenchLine {
        name: format!("pop {kind}{by}, {threshold_px} px"),
        settings: Settings {
            splat,
            path,
            threshold_px,
            ..Settings::default()
        },
        is_rare: false,
    }
}

/// Words for a path in the name of a line; none for the one that is chosen.
fn by_path(path: Path) -> &'static str {
    match path {
        Path::Auto => "",
        Path::Raster => " by raster",
        Path::Compute => " by compute",
    }
}

/// Patches within the usual tolerances, and squares and triangles of what is none.
pub fn patches(path: Path) -> BenchLine {
    let by = by_path(path);
    BenchLine {
        name: format!("patches{by}, usual tolerances"),
        settings: Settings {
            patches: Some(PatchRules::default()),
            path,
            ..Settings::default()
        },
        is_rare: false,
    }
}

/// Patches by given rules, drawn by one path. A path that is asked for draws on the device and is [rare](BenchLine::is_rare):
/// on a software device it is many times slower than the processor.
pub fn patches_by(rules: PatchRules, path: Path) -> BenchLine {
    let ErrorTolerances {
        rim_px,
        inside_px,
        shade_levels,
    } = rules.tolerances;
    let how = match (rules.tiny_polygons, rules.covers_rims) {
        (true, _) => " and below a pixel",
        (_, true) => " with covered rims",
        _ => "",
    };
    BenchLine {
        name: format!(
            "patches{}, {rim_px},{inside_px},{shade_levels}{how}",
            by_path(path)
        ),
        settings: Settings {
            patches: Some(rules),
            path,
            ..Settings::default()
        },
        is_rare: path != Path::Auto,
    }
}

/// `pop` with squares whose cut the device chooses and the rasterizer draws.
pub fn cut_on_device(threshold_px: f32) -> BenchLine {
    BenchLine {
        name: format!("pop square, cut on the device, {threshold_px} px"),
        settings: Settings {
            path: Path::Raster,
            cut_on: CutOn::Device,
            threshold_px,
            ..Settings::default()
        },
        is_rare: true,
    }
}

/// `pop` with squares that the rasterizer draws, from draw lists of ids and of records.
pub fn lists(threshold_px: f32) -> [BenchLine; 2] {
    [("ids", ListOf::Ids), ("records", ListOf::Records)].map(|(word, list_of)| BenchLine {
        name: format!("pop square by raster, lists of {word}, {threshold_px} px"),
        settings: Settings {
            path: Path::Raster,
            list_of,
            threshold_px,
            ..Settings::default()
        },
        is_rare: true,
    })
}

/// Plain triangles by a path. Compute draws them as `pop` does, from a tree that is cut down to its leaves.
pub fn triangles_by(path: Path) -> Settings {
    match path {
        Path::Compute => Settings {
            threshold_px: 0.0,
            path,
            ..Settings::default()
        },
        _ => triangles().settings,
    }
}

/// Rules of patches whose errors are measured: the usual ones, finer and coarser, with nodes below a pixel, and with covered rims.
/// By each rasterizer of the device only the first [`ERRORS_BY_DEVICE`] are.
const ERRORS: [PatchRules; 7] = [
    within(0.15, 0.25, 24.0),
    within(0.1, 0.15, 8.0),
    within(0.25, 0.5, 24.0),
    within(0.5, 1.0, 48.0),
    PatchRules {
        tiny_polygons: true,
        ..within(0.5, 1.0, 48.0)
    },
    covered(within(0.15, 0.25, 24.0)),
    covered(within(0.25, 0.5, 24.0)),
];

/// Number of [`ERRORS`] that are measured by each rasterizer of the device.
const ERRORS_BY_DEVICE: usize = 4;

const fn covered(rules: PatchRules) -> PatchRules {
    PatchRules {
        covers_rims: true,
        ..rules
    }
}

const fn within(rim_px: f32, inside_px: f32, shade_levels: f32) -> PatchRules {
    PatchRules {
        tolerances: ErrorTolerances {
            rim_px,
            inside_px,
            shade_levels,
        },
        is_strict: false,
        tiny_polygons: false,
        covers_rims: false,
    }
}

/// How much is measured.
#[derive(Debug, Clone, PartialEq)]
pub struct BenchPlan {
    /// Views of the standard orbit at each distance.
    pub views: u32,
    /// Sizes of the pictures; [`SIZE`] first, the others get every third view.
    pub sizes: Vec<(u32, u32)>,
    /// Distances.
    pub fills: Vec<f64>,
    /// Thresholds of the default method; 1 is among them.
    pub thresholds: Vec<f32>,
    /// Whether blended splats are among the whole frames; the parts that ask for rates and errors have them anyway.
    pub has_blended: bool,
    /// Thresholds at which the errors of the default method are measured, and those of filtered splats.
    pub accurate: [Vec<f32>; 2],
    /// Views in which errors are measured.
    pub error_views: u32,
    /// Samples a pixel of the reference, along one side of its grid.
    pub grid: u32,
    /// The samples are rays where this build can cast them: the same surface in a tenth of the time, for large models.
    pub has_ray_reference: bool,
    /// Rounds of what is measured from one view.
    pub rounds: usize,
}

impl BenchPlan {
    /// 36 views, two sizes, three distances: less than ten minutes on two cores and a software device.
    pub fn full() -> Self {
        Self {
            views: 36,
            sizes: vec![SIZE, (1024, 768)],
            fills: vec![1.0, 0.5, 0.125],
            // Squares above 1.5 pixels are the first that are larger than one.
            thresholds: vec![1.0, 1.6, 2.0, 3.0, 6.0, 8.0, 16.0],
            has_blended: true,
            accurate: [
                vec![0.0, 0.125, 0.25, 0.35, 0.5, 1.0, 1.6, 2.0, 3.0],
                vec![1.0, 1.5, 2.0, 2.3, 2.5, 2.8, 3.0],
            ],
            error_views: 2,
            grid: 4,
            has_ray_reference: false,
            rounds: 7,
        }
    }

    /// Every figure from few views: less than two minutes there.
    pub fn quick() -> Self {
        Self {
            views: 3,
            sizes: vec![SIZE],
            thresholds: vec![1.0, 3.0, 8.0],
            has_blended: false,
            has_ray_reference: true,
            accurate: [
                vec![0.0, 0.125, 0.25, 0.35, 0.5, 1.0, 2.0],
                vec![1.0, 2.0, 2.3, 2.5, 2.8],
            ],
            error_views: 1,
            rounds: 3,
            ..Self::full()
        }
    }

    /// The ways that whole frames are measured in.
    pub fn lines(&self) -> Vec<BenchLine> {
        use SplatKind::{Filtered, Gauss, Square};
        let mut lines = vec![triangles()];
        lines.extend(self.thresholds.iter().map(|t| default(*t)));
        for path in [Path::Raster, Path::Compute] {
            lines.push(pop(Square, path, 1.0));
            if self.has_blended {
                lines.extend(
                    [(Filtered, 1.0), (Gauss, 3.0)].map(|(kind, threshold)| BenchLine {
                        is_rare: true,
                        ..pop(kind, path, threshold)
                    }),
                );
            }
        }
        lines.extend([Path::Auto, Path::Raster].map(patches));
        lines.push(cut_on_device(1.0));
        lines.extend(lists(1.0));
        lines
    }

    /// The ways whose errors are measured: the default method, filtered splats, patches, and patches by either rasterizer of the
    /// device.
    pub fn accurate_lines(&self) -> [Vec<BenchLine>; 5] {
        let [of_default, of_filtered] = &self.accurate;
        let filtered = |t: &f32| pop(SplatKind::Filtered, Path::Auto, *t);
        let by_device = |path| {
            let rules = ERRORS.iter().take(ERRORS_BY_DEVICE);
            rules.map(|r| patches_by(*r, path)).collect()
        };
        [
            of_default.iter().map(|t| default(*t)).collect(),
            of_filtered.iter().map(filtered).collect(),
            ERRORS.map(|r| patches_by(r, Path::Auto)).to_vec(),
            by_device(Path::Raster),
            by_device(Path::Compute),
        ]
    }
}

/// Views of the standard orbit.
///
/// # Errors
/// When the model has no size that a camera can show.
pub fn views(
    model: &Model,
    size: (u32, u32),
    fill: f64,
    count: u32,
) -> Result<Vec<View>, crate::math::camera::CameraError> {
    (0..count)
        .map(|k| orbit(model, size, fill, k, count))
        .collect()
}

/// A view from the standard orbit with the back to the model: nothing is in it.
///
/// # Errors
/// When the model has no size that a camera can show.
pub fn empty_view(
    model: &Model,
    size: (u32, u32),
) -> Result<View, crate::math::camera::CameraError> {
    let OrbitSphere { center, radius } = model.orbit_sphere();
    let radius = radius.max(f64::MIN_POSITIVE);
    let eye = center + 3.0 * radius * DVec3::Z;
    let away = eye + radius * DVec3::Z;
    Camera::look_at(
        size,
        eye,
        away,
        DVec3::Y,
        45f64.to_radians(),
        [radius, 4.0 * radius],
    )
    .view(model.origin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_those_of_the_standard_models_only() {
        assert_eq!(
            CaseStandard::of("statue", 7_990_272),
            Some(CaseStandard::Statue)
        );
        assert_eq!(CaseStandard::of("statue", 20_000), None);
        assert_eq!(CaseStandard::of("horse", 871_414), None);
        for standard in CaseStandard::ALL {
            assert_eq!(
                CaseStandard::of(standard.name(), standard.triangles()),
                Some(standard)
            );
        }
    }

    #[test]
    fn lines_have_names_of_their_own_and_begin_with_triangles() {
        for plan in [BenchPlan::full(), BenchPlan::quick()] {
            let mut names: Vec<String> = plan.lines().into_iter().map(|l| l.name).collect();
            assert_eq!(names[0], "triangles");
            assert!(names.contains(&"default, 1 px".to_owned()), "{names:?}");
            let count = names.len();
            names.sort();
            names.dedup();
            assert_eq!(names.len(), count);
            assert_eq!(plan.sizes[0], SIZE);
            let [default, filtered, patches, raster, compute] = plan.accurate_lines();
            assert!(raster.iter().all(|l| l.settings.path == Path::Raster));
            assert!(compute.iter().all(|l| l.settings.path == Path::Compute));
            assert_eq!([raster.len(), compute.len()], [ERRORS_BY_DEVICE; 2]);
            assert!(default.len() >= 4 && filtered.len() >= 3 && patches.len() >= 3);
            let usual = patches[0].settings.patches.unwrap_or_default();
            assert_eq!(usual, PatchRules::default());
            assert!(
                filtered[0].name.starts_with("pop filtered, 1 px"),
                "{}",
                filtered[0].name
            );
        }
    }
}
