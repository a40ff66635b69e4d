//! A scene made ready, and what is measured of its pictures.

use super::FailuresError;
use super::colors::{self, ColorRange, moire, strays};
use crate::cut::{Cut, CutSelector};
use crate::image::{FloatImage, Image, PictureAccumulator, compare, jittered};
use crate::math::camera::View;
use crate::measure::{self, squared_distances};
use crate::progress::SilentProgress;
use crate::render::PictureOutputs;
use crate::render::cut_key::cut_settings;
use crate::render::engine::{Backend, Engine};
use crate::render::frame_plan::resolve_settings;
use crate::render::{Culling, Method, Settings};
use crate::scenes::{BuiltScene, ExpectedFigures, SceneEntry};
use crate::tree::{self, BuildOptions, Model};

/// A figure of a picture. Colors are in levels of 255; a pixel is covered that is so at least by half.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FailureFigure {
    /// Covered pixels.
    Covered,
    /// Sum of the covered fractions, pixels.
    Area,
    /// Pixels covered in the truth only.
    Missing,
    /// Pixels covered in the picture only.
    Extra,
    /// Holes inside of the truth's silhouette, with a pixel at least of which the surface leaves nothing open: every
    /// sample of the truth meets it, and so does its center.
    Holes,
    /// Pixels in holes of both kinds, with such a pixel and without.
    HolePixels,
    /// Pixels of which the truth covers at least a quarter, with nothing in the picture within a pixel around.
    Lost,
    /// Largest distance of a pixel that something is shown in from one that the surface touches, pixels.
    Reach,
    /// Mean over covered pixels of how far a color lies outside of the range of the surface's colors within
    /// [`super::reach_px`]: those of the truth's samples, and of the pixel's center.
    Stray,
    /// Percentage of covered pixels that lie more than 32 levels outside of that range.
    Astray,
    /// By how much the picture would come nearer to the truth if it were blurred over the window of a node, root of the
    /// mean squared difference of colors: patterns that are not there.
    Moire,
    /// Mean difference of a color over object pixels.
    Level,
    /// Root of the mean squared difference over object pixels.
    Rmse,
    /// Mean distance of the outlines of picture and truth, pixels.
    Silhouette,
    /// Mean FLIP difference, 0 to 1; measured on request ([`FailureCase::flip`]).
    Flip,
    /// Red, green or blue of the surface (without the black background) right of and above the center.
    Center(usize),
}

impl FailureFigure {
    /// The figures of tables, in their order.
    pub const ALL: [Self; 18] = [
        Self::Covered,
        Self::Area,
        Self::Missing,
        Self::Extra,
        Self::Holes,
        Self::HolePixels,
        Self::Lost,
        Self::Reach,
        Self::Stray,
        Self::Astray,
        Self::Moire,
        Self::Level,
        Self::Rmse,
        Self::Silhouette,
        Self::Flip,
        Self::Center(0),
        Self::Center(1),
        Self::Center(2),
    ];

    /// Name in tables, with the unit where it is not pixels or levels.
    pub fn name(self) -> &'static str {
        match self {
            Self::Covered => "covered_px",
            Self::Area => "area_px",
            Self::Missing => "missing_px",
            Self::Extra => "extra_px",
            Self::Holes => "holes",
            Self::HolePixels => "hole_px",
            Self::Lost => "lost_px",
            Self::Reach => "reach_px",
            Self::Stray => "stray_levels",
            Self::Astray => "astray_percent",
            Self::Moire => "moire_levels",
            Self::Level => "mean_levels",
            Self::Rmse => "rmse_levels",
            Self::Silhouette => "silhouette_px",
            Self::Flip => "flip",
            Self::Center(0) => "center_red",
            Self::Center(1) => "center_green",
            Self::Center(_) => "center_blue",
        }
    }
}

/// A scene made ready, with the truth.
#[derive(Debug)]
pub struct FailureCase {
    /// The scene.
    pub entry: &'static SceneEntry,
    /// Threshold of the scene, pixels.
    pub threshold_px: f32,
    /// Tree of the scene.
    pub model: Model,
    /// Camera of the scene.
    pub view: View,
    /// Closed forms of the scene.
    pub expected: ExpectedFigures,
    /// The truth: triangles, nothing culled, 16 samples a pixel; none for clouds.
    pub truth: Option<FloatImage>,
    /// Pixels that an outline of the truth cuts.
    pub(super) cut_px: f64,
    /// Pixels that the truth covers and that have a neighbor at a side that it does not.
    pub(super) outline_px: f64,
    /// Pixels that the truth covers.
    pub(super) covered_px: f64,
    /// Whether the truth covers the pixel right of and above the center, or there is none.
    pub(super) has_center: bool,
    /// Whether a triangle in view is larger than the threshold.
    pub(super) has_large_leaves: bool,
    /// Diameter of the largest leaf on the picture, pixels; infinite where one reaches the near plane.
    pub(super) largest_px: f64,
    /// Distance of each pixel from the nearest that the surface touches, pixels.
    distance_px: Vec<f64>,
    /// What colors the surface has in each pixel, and whether it leaves the center open.
    ranges: Vec<ColorRange>,
    is_center_open: Vec<bool>,
}

/// Samples of the truth along a side of a pixel.
const GRID: u32 = 4;
/// Around the picture, pixels: how far outside of it a surface is looked for.
const MARGIN: usize = 96;

impl FailureCase {
    /// Builds the scene's tree and draws its truth on `backend`.
    ///
    /// # Errors
    /// When the device cannot draw.
    pub fn new(entry: &'static SceneEntry, backend: &Backend) -> Result<Self, FailuresError> {
        let BuiltScene {
            mesh,
            camera,
            threshold_px,
            expected,
        } = entry.make();
        let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress)?;
        let view = camera.view(model.origin)?;
        let (mut ranges, mut is_center_open) = (Vec::new(), Vec::new());
        let truth = if model.kind().is_points() {
            None
        } else {
            let settings = Settings {
                method: Method::Triangles,
                culling: Culling::Off,
                ..Settings::default()
            };
            let size = (view.width, view.height);
            let mut engine = Engine::new(backend, &model, size, PictureOutputs::default())?;
            let mut mean = PictureAccumulator::new();
            let center = engine.render(&view, &settings)?;
            is_center_open = center.color.iter().map(|c| c[3] == 0).collect();
            ranges = colors::ranges(&center);
            for i in 0..GRID * GRID {
                let samples = engine.sample(&jittered(&view, i, GRID), &settings)?;
                colors::widen(&mut ranges, &samples);
                mean.add(&samples)?;
            }
            Some(mean.mean())
        };
        let cut = |truth: &FloatImage| {
            let is_cut = |c: &&[f32; 4]| c[3] > 0.0 && c[3] < 1.0;
            truth.color.iter().filter(is_cut).count() as f64
        };
        Ok(Self {
            entry,
            threshold_px,
            expected,
            cut_px: truth.as_ref().map_or(0.0, cut),
            covered_px: truth
                .as_ref()
                .map_or(0.0, |t| measure::CoverageMask::of(t).count() as f64),
            outline_px: truth.as_ref().map_or(0.0, outline_px),
            has_center: truth
                .as_ref()
                .is_none_or(|t| t.color[center_of(&view)][3] >= 0.25),
            has_large_leaves: has_large_leaves(&model, &view, threshold_px),
            largest_px: largest_leaf_px(&model, &view),
            distance_px: distances(&model, &view, truth.as_ref()),
            ranges,
            is_center_open,
            model,
            view,
            truth,
        })
    }

    /// Every figure that a picture has, but for FLIP. `reach_px` is how far colors may come from.
    pub(super) fn measure(
        &self,
        picture: &Image,
        reach_px: f64,
    ) -> Result<Vec<(FailureFigure, f64)>, FailuresError> {
        let center = picture.color[center_of(&self.view)];
        let alpha = f64::from(center[3].max(1)) / 255.0;
        let area: f64 = picture.color.iter().map(|c| f64::from(c[3]) / 255.0).sum();
        let covered = picture.color.iter().filter(|c| c[3] >= 128).count();
        let reach = picture
            .color
            .iter()
            .zip(&self.distance_px)
            .filter(|(c, d)| c[3] >= 128 && d.is_finite())
            .map(|(_, d)| *d)
            .fold(0.0, f64::max);
        let mut found = vec![
            (FailureFigure::Covered, covered as f64),
            (FailureFigure::Area, area),
            (FailureFigure::Reach, reach),
        ];
        found.extend((0..3).map(|c| (FailureFigure::Center(c), f64::from(center[c]) / alpha)));
        if let Some(truth) = &self.truth {
            let shape = measure::coverage(truth, picture)?;
            let difference = compare(truth, picture, 8.0)?;
            let (stray, astray) = strays(&self.ranges, picture, reach_px);
            let holes = whole_holes(truth, &self.is_center_open, picture);
            found.extend([
                (FailureFigure::Missing, shape.missing as f64),
                (FailureFigure::Extra, shape.extra as f64),
                (FailureFigure::Holes, holes as f64),
                (FailureFigure::HolePixels, shape.hole_pixels as f64),
                (FailureFigure::Lost, lost(truth, picture) as f64),
                (FailureFigure::Stray, stray),
                (FailureFigure::Astray, astray),
                (
                    FailureFigure::Moire,
                    moire(truth, picture, node_reach_px(self.threshold_px)),
                ),
                (FailureFigure::Level, 255.0 * difference.object.mean_abs),
                (FailureFigure::Rmse, 255.0 * difference.object.rmse),
                (
                    FailureFigure::Silhouette,
                    measure::silhouette(truth, picture)?.mean,
                ),
            ]);
        }
        Ok(found)
    }

    /// Mean FLIP difference of a picture from the truth; none for clouds.
    ///
    /// # Errors
    /// When the picture has another size.
    pub fn flip(&self, picture: &Image) -> Result<Option<f64>, FailuresError> {
        let Some(truth) = &self.truth else {
            return Ok(None);
        };
        let map = measure::flip(truth, picture, measure::PIXELS_PER_DEGREE)?;
        Ok(Some(map.mean))
    }
}

/// The pixel right of and above the center.
fn center_of(view: &View) -> usize {
    ((view.height / 2 - 1) * view.width + view.width / 2) as usize
}

fn outline_px(truth: &FloatImage) -> f64 {
    let width = truth.width as usize;
    let is_covered = |i: usize| truth.color.get(i).is_none_or(|c| c[3] >= 0.5);
    let is_outline = |i: &usize| {
        is_covered(*i)
            && !(is_covered(i + 1)
                && is_covered(i.wrapping_sub(1))
                && is_covered(i + width)
                && is_covered(i.wrapping_sub(width)))
    };
    (0..truth.color.len()).filter(is_outline).count() as f64
}

fn has_large_leaves(model: &Model, view: &View, threshold_px: f32) -> bool {
    let settings = Settings {
        threshold_px,
        ..Settings::default()
    };
    let settings = cut_settings(&resolve_settings(&settings, model, view), model);
    let mut cut = Cut::default();
    CutSelector::default().select(model, view, &settings, &mut cut);
    !cut.triangles.is_empty()
}

fn has_area(model: &Model, corners: &[u32; 3]) -> bool {
    let [a, b, c] = corners.map(|i| model.vertices[i as usize].position.as_dvec3());
    (b - a).cross(c - a).length_squared() > 0.0
}

/// Twice the radius of the largest leaf over its distance, in pixels of the picture; 0 for none.
fn largest_leaf_px(model: &Model, view: &View) -> f64 {
    let mut largest: f64 = 0.0;
    for (id, leaf) in model.tree.leaves.iter().enumerate() {
        // What has no area is not drawn.
        if model.triangles.get(id).is_some_and(|t| !has_area(model, t)) {
            continue;
        }
        let radius = f64::from(leaf.radius * view.model_scale);
        let z = f64::from(view.distance(leaf.center));
        if z < -radius {
            continue;
        }
        let nearest = z - radius;
        largest = largest.max(if nearest > f64::from(view.near) {
            2.0 * f64::from(view.focal_px()) * radius / nearest
        } else {
            f64::INFINITY
        });
    }
    largest
}

/// Distance of each pixel of the picture from the nearest pixel that the truth touches, or that a corner of a triangle
/// with an area (of a cloud: a point) projects to, be it in the picture or beside it.
fn distances(model: &Model, view: &View, truth: Option<&FloatImage>) -> Vec<f64> {
    let (width, height) = (view.width as usize, view.height as usize);
    let wide = width + 2 * MARGIN;
    let mut is_touched = vec![false; wide * (height + 2 * MARGIN)];
    for (i, color) in truth.iter().flat_map(|t| t.color.iter().enumerate()) {
        is_touched[(i / width + MARGIN) * wide + i % width + MARGIN] |= color[3] > 0.0;
    }
    let mut touch = |corner: u32| {
        let (x, y, z) = view.project(model.vertices[corner as usize].position);
        let (x, y) = (
            f64::from(x).floor() + MARGIN as f64,
            f64::from(y).floor() + MARGIN as f64,
        );
        let is_inside = (0.0..wide as f64).contains(&x)
            && (0.0..(height + 2 * MARGIN) as f64).contains(&y)
            && z > 0.0;
        if is_inside {
            is_touched[y as usize * wide + x as usize] = true;
        }
    };
    for corners in &model.triangles {
        if has_area(model, corners) {
            corners.iter().for_each(|i| touch(*i));
        }
    }
    if model.kind().is_points() {
        (0..model.tree.leaf_count()).for_each(&mut touch);
    }
    let squared = squared_distances(&is_touched, wide, height + 2 * MARGIN);
    (0..width * height)
        .map(|i| squared[(i / width + MARGIN) * wide + i % width + MARGIN].sqrt())
        .collect()
}

/// [`FailureFigure::Holes`].
fn whole_holes(truth: &FloatImage, is_center_open: &[bool], picture: &Image) -> usize {
    let (right, shown) = (
        measure::CoverageMask::of(truth),
        measure::CoverageMask::of(picture),
    );
    let (width, count) = (right.width, right.is_covered.len());
    let mut is_missing: Vec<bool> = (right.is_covered.iter().zip(&shown.is_covered))
        .map(|(right, shown)| *right && !*shown)
        .collect();
    let (mut holes, mut stack) = (0, Vec::new());
    for start in 0..count {
        if !std::mem::take(&mut is_missing[start]) {
            continue;
        }
        stack.push(start);
        let (mut is_inside, mut is_whole) = (true, false);
        while let Some(i) = stack.pop() {
            is_whole |= truth.color[i][3] >= 1.0 && !is_center_open[i];
            let x = i % width;
            let beside = [
                (x > 0).then(|| i - 1),
                (x + 1 < width).then(|| i + 1),
                i.checked_sub(width),
                (i + width < count).then_some(i + width),
            ];
            for n in beside.into_iter().flatten() {
                is_inside &= right.is_covered[n];
                if std::mem::take(&mut is_missing[n]) {
                    stack.push(n);
                }
            }
        }
        holes += usize::from(is_inside && is_whole);
    }
    holes
}

/// Half the side of the windows of [`FailureFigure::Moire`], pixels: the reach of squares of the threshold's size.
fn node_reach_px(threshold_px: f32) -> usize {
    let t = f64::from(threshold_px.max(1.0));
    (t * (0.5 + 0.5f64.sqrt()) + 1.0).ceil() as usize
}

/// Pixels of which the truth covers a quarter while nothing is shown within a pixel around.
fn lost(truth: &FloatImage, picture: &Image) -> usize {
    let (width, height) = (truth.width as usize, truth.height as usize);
    let is_shown = |i: usize| {
        let (x, y) = (i % width, i / width);
        (y.saturating_sub(1)..(y + 2).min(height)).any(|v| {
            (x.saturating_sub(1)..(x + 2).min(width)).any(|u| picture.color[v * width + u][3] >= 16)
        })
    };
    let colors = truth.color.iter().enumerate();
    colors
        .filter(|(i, c)| c[3] >= 0.25 && !is_shown(*i))
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(width: u32, height: u32, color: impl Fn(u32, u32) -> [f32; 4]) -> FloatImage {
        FloatImage {
            width,
            height,
            color: (0..width * height)
                .map(|i| color(i % width, i / width))
                .collect(),
            ..FloatImage::default()
        }
    }

    #[test]
    fn a_hole_counts_where_the_surface_is_whole() {
        // Two empty pixels apart: at the left one some samples of the truth are open, at the right one none.
        let truth = truth(9, 3, |x, y| [if (x, y) == (2, 1) { 0.9 } else { 1.0 }; 4]);
        let mut picture = Image::filled(9, 3, [255; 4]);
        picture.color[9 + 2] = [0; 4];
        let mut is_open = vec![false; 27];
        assert_eq!(whole_holes(&truth, &is_open, &picture), 0);
        picture.color[9 + 6] = [0; 4];
        assert_eq!(whole_holes(&truth, &is_open, &picture), 1);
        is_open[9 + 6] = true;
        assert_eq!(whole_holes(&truth, &is_open, &picture), 0);
        is_open[9 + 6] = false;
        // Together they are one hole, which holds a whole pixel.
        (3..6).for_each(|x| picture.color[9 + x] = [0; 4]);
        assert_eq!(whole_holes(&truth, &is_open, &picture), 1);
    }

    #[test]
    fn what_shows_nowhere_is_lost() {
        let truth = truth(9, 3, |x, _| if x == 4 { [0.3; 4] } else { [0.0; 4] });
        let empty = Image::filled(9, 3, [0; 4]);
        assert_eq!(lost(&truth, &empty), 3);
        let mut shown = empty;
        shown.color[9 + 5] = [20; 4];
        assert_eq!(lost(&truth, &shown), 0);
        shown.color[9 + 5] = [0; 4];
        shown.color[9 + 6] = [255; 4];
        assert_eq!(lost(&truth, &shown), 3);
    }
}
