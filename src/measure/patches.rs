//! The cut by error beside the cut by size: the work and the error of both.
//!
//! The reference is every triangle, several samples a pixel. Beside patches stand one exact sample of it and what the program
//! draws without patches, triangles and splats by size on screen. All is drawn by the processor, so no device decides.

use super::profile::ProfileError;
use super::{PIXELS_PER_DEGREE, flip};
use crate::image::{Image, compare};
use crate::math::camera::View;
use crate::patches::{
    NodePatches, PatchConditions, PatchCut, PatchCutSettings, PatchRefusals, PatchSelector,
    PatchStyle, draw,
};
use crate::progress::Progress;
use crate::render::PictureOutputs;
use crate::render::engine::{Backend, Engine};
use crate::render::{Method, Settings};
use crate::tree::Model;
use std::time::Instant;

/// Levels of 255 beyond which a pixel counts as wrong.
const WRONG_LEVEL: f64 = 16.0;

/// What is measured.
#[derive(Debug, Clone)]
pub struct PatchPlan {
    /// The views, of one size, and a name of each.
    pub views: Vec<(String, View)>,
    /// Samples of the reference along each side of a pixel.
    pub samples: u32,
    /// The cuts by error, and a name of each.
    pub cuts: Vec<(String, PatchCutSettings)>,
    /// Bound the shade at every corner.
    pub is_strict: bool,
    /// Cuts of each kind that are timed; the median counts.
    pub repeats: u32,
}

/// One picture: what it took and how far it is from the reference.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct PatchRow {
    /// Name of the view.
    pub view: String,
    /// What drew it.
    pub way: String,
    /// Nodes and leaves that the cut looked at.
    pub visited: u64,
    /// Everything drawn.
    pub primitives: u64,
    /// Patches, and nodes below a pixel that were drawn as their polygon.
    pub patches: u64,
    /// See `patches`.
    pub tiny: u64,
    /// Splats, those of rows and leaves among them.
    pub squares: u64,
    /// Triangles.
    pub triangles: u64,
    /// Samples of polygons, hidden ones too.
    pub polygon_samples: u64,
    /// Time of the cut, milliseconds.
    pub cut_ms: f64,
    /// Mean FLIP over the picture.
    pub flip: f64,
    /// Peak signal to noise ratio over object pixels, decibels.
    pub psnr_db: f64,
    /// Pixels that one exact sample covers and the picture does not.
    pub missing: u64,
    /// Pixels that the picture covers and no sample of the reference does.
    pub extra: u64,
    /// Pixels off by more than 16 levels.
    pub wrong: u64,
    /// Why nodes were no patches.
    pub refused: PatchRefusals,
    /// Patches by size on screen: up to 2, 4, 8, 16 and 32 pixels, and more.
    pub sizes: [u64; 6],
}

/// Rows and pictures of a plan.
#[derive(Debug, Clone, Default)]
pub struct PatchFindings {
    /// In the order of the views; of each the exact sample, the cut by size, those by error.
    pub rows: Vec<PatchRow>,
    /// The pictures of the rows.
    pub pictures: Vec<Image>,
}

/// Measures a model. `patches` are its records.
///
/// # Errors
/// When a picture cannot be drawn, or `progress` is cancelled.
pub fn measure(
    model: &Model,
    patches: &NodePatches,
    plan: &PatchPlan,
    progress: &dyn Progress,
) -> Result<PatchFindings, ProfileError> {
    let mut findings = PatchFindings::default();
    let Some((_, first)) = plan.views.first() else {
        return Ok(findings);
    };
    let size = (first.width, first.height);
    let outputs = PictureOutputs::default();
    let mut engine = Engine::new(&Backend::Cpu, model, size, outputs)?;
    let by_size = Settings::default();
    let triangles = Settings {
        method: Method::Triangles,
        ..by_size
    };
    let mut drawn = DrawnPatches {
        model,
        patches,
        conditions: PatchConditions::new(model, patches, plan.is_strict),
        selector: PatchSelector::default(),
    };
    let each = 2 + plan.cuts.len();
    progress.stage("comparing", (plan.views.len() * each) as u64);
    for (name, view) in &plan.views {
        let reference = engine.supersample(view, &triangles, plan.samples.max(1))?;
        let exact = engine.render(view, &triangles)?;
        let mut judge = |mut row: PatchRow, image: Image| -> Result<(), ProfileError> {
            let pixels = || reference.color.iter().zip(&exact.color).zip(&image.color);
            row.view.clone_from(name);
            row.flip = of_one_size(flip(&reference, &image, PIXELS_PER_DEGREE)).mean;
            let difference = of_one_size(compare(&reference, &image, WRONG_LEVEL));
            row.psnr_db = difference.object.psnr_db;
            row.wrong = difference.object.past_level;
            let missing = pixels().filter(|((_, exact), own)| exact[3] > 0 && own[3] == 0);
            row.missing = missing.count() as u64;
            let extra = pixels().filter(|((of, _), own)| of[3] == 0.0 && own[3] > 0);
            row.extra = extra.count() as u64;
            findings.rows.push(row);
            findings.pictures.push(image);
            progress.advance(1);
            if progress.is_cancelled() {
                return Err(ProfileError::Cancelled(findings.rows.len()));
            }
            Ok(())
        };
        let all = model.triangles.len() as u64;
        let row = PatchRow {
            way: "exact sample".into(),
            primitives: all,
            triangles: all,
            ..PatchRow::default()
        };
        judge(row, exact.clone())?;
        let mut times = Vec::new();
        let mut row = PatchRow {
            way: "by size".into(),
            ..PatchRow::default()
        };
        for _ in 0..plan.repeats.max(1) {
            let frame = engine.draw(view, &by_size)?;
            let counts = frame.counts;
            times.push(frame.cut_ms);
            row.visited = counts.nodes_visited;
            (row.squares, row.triangles) = (counts.splats, counts.triangles);
            row.primitives = counts.splats + counts.triangles;
        }
        row.cut_ms = super::ValueDistribution::of(&times).median;
        let image = engine.read(view)?;
        judge(row, image)?;
        for (way, settings) in &plan.cuts {
            let (row, image) = drawn.by_error(view, settings, plan.repeats);
            let way = way.clone();
            judge(PatchRow { way, ..row }, image)?;
        }
    }
    Ok(findings)
}

/// What a comparison found. Every picture has the size of the view, which is all that can go wrong.
fn of_one_size<T>(found: Result<T, crate::image::Error>) -> T {
    match found {
        Ok(found) => found,
        Err(error) => unreachable!("pictures of one view: {error}"),
    }
}

/// A model with all that its cuts by error need.
struct DrawnPatches<'a> {
    model: &'a Model,
    patches: &'a NodePatches,
    conditions: PatchConditions,
    selector: PatchSelector,
}

impl DrawnPatches<'_> {
    /// A cut by error, timed and drawn.
    fn by_error(
        &mut self,
        view: &View,
        settings: &PatchCutSettings,
        repeats: u32,
    ) -> (PatchRow, Image) {
        let mut cut = PatchCut::default();
        let mut times = Vec::new();
        for _ in 0..repeats.max(1) {
            let start = Instant::now();
            (self.selector).select(self.model, &self.conditions, view, settings, &mut cut);
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
        let style = PatchStyle {
            background: Settings::default().background,
            square_px: settings.cut.threshold_px.max(1.0),
            ..PatchStyle::default()
        };
        let picture = draw(self.model, self.patches, &cut, view, &style);
        let [drawn, tiny] = [&cut.patches, &cut.tiny].map(|ids| ids.len() as u64);
        let triangles = cut.rest.triangles.len() as u64;
        let primitives = cut.primitives() as u64;
        let row = PatchRow {
            visited: cut.rest.stats.visited,
            primitives,
            patches: drawn,
            tiny,
            squares: primitives - drawn - tiny - triangles,
            triangles,
            polygon_samples: picture.polygon_samples,
            cut_ms: super::ValueDistribution::of(&times).median,
            refused: cut.refused,
            sizes: cut.sizes,
            ..PatchRow::default()
        };
        (row, picture.image)
    }
}
