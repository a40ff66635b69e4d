//! Pictures as `surfel render` writes them by default, beside one exact sample a pixel: mean FLIP to 64 samples of every
//! triangle, and the time.
//!
//! The reference's samples are even in the pixel, not a grid, which gives edges along an axis only 8 levels. Where the default
//! takes 64 samples itself, they lie where those of the reference do: what is left is then the error of its splats alone. A model is seen from three distances, where the default may have a third of that sample's error. The
//! scenes of the stability table are seen from their own cameras, and a blade thinner than a pixel from its edge: there it may
//! have all of it.

use super::cases::{self, SIZE, views};
use super::verdict::BenchTarget;
use super::{BenchCase, BenchError, BenchFigure, BenchPlace, BenchPlan, BenchSession};
use crate::chart::errors::object_flip;
use crate::math::camera::{Camera, View};
use crate::mesh::Mesh;
use crate::progress::Progress;
use crate::render::Settings;
use crate::render::engine::{Engine, smooth_threshold};
use crate::tree::{self, BuildOptions, Model};
use glam::{DVec3, Vec3};
use std::f64::consts::FRAC_PI_8;
use std::time::Instant;

const PART: &str = "pictures";
const LINE: &str = "default picture";

/// Largest part of the error of one exact sample that the default may have.
const ERROR_PART: f64 = 1.0 / 3.0;

/// Mean FLIP of one exact sample below which a picture cannot be told from the reference by eye: a part of it says nothing.
const UNSEEN_FLIP: f64 = 1e-4;

/// Largest part of it in scenes that are hard on purpose.
const SCENE_PART: f64 = 1.0;

/// Settings by which a model is drawn and judged.
#[derive(Debug)]
struct JudgedSettings {
    /// Settings of the default picture of `surfel render`.
    smooth: Settings,
    /// All that is there: every triangle, or every point of a cloud.
    plain: Settings,
}

impl JudgedSettings {
    fn of(model: &Model) -> Self {
        let is_surface = model.kind().is_surface();
        let mut smooth = Settings::default();
        smooth.threshold_px = smooth_threshold(&smooth, is_surface).unwrap_or(smooth.threshold_px);
        let plain = match is_surface {
            true => cases::triangles().settings,
            false => Settings {
                threshold_px: 0.0,
                ..smooth
            },
        };
        Self { smooth, plain }
    }
}

/// Errors and times of one distance.
#[derive(Debug, Default)]
struct FoundPictures {
    smooth_flip: Vec<f64>,
    exact_flip: Vec<f64>,
    smooth_ms: Vec<f64>,
}

impl FoundPictures {
    /// Draws a view as the default does, once, and exactly.
    fn add(
        &mut self,
        engine: &mut Engine<'_>,
        view: &View,
        settings: &JudgedSettings,
    ) -> Result<(), BenchError> {
        let JudgedSettings { smooth, plain } = settings;
        // As a file holds it: bytes, like the pictures that are compared with it.
        let reference = engine.mean_of_even(view, plain)?.to_image();
        let exact = engine.render(view, plain)?;
        // Shaders are compiled at the first draw.
        engine.draw(view, smooth)?;
        let start = Instant::now();
        let picture = engine.smooth(view, smooth)?.to_image();
        self.smooth_ms.push(start.elapsed().as_secs_f64() * 1e3);
        self.smooth_flip.push(object_flip(&reference, &picture)?[0]);
        self.exact_flip.push(object_flip(&reference, &exact)?[0]);
        Ok(())
    }

    fn figures(&self, place: &BenchPlace, line: &str, most: f64) -> Vec<BenchFigure> {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let [smooth, exact] = [&self.smooth_flip, &self.exact_flip].map(|values| mean(values));
        let name = "mean FLIP over that of one exact sample";
        let errors = format!("mean FLIP {smooth:.5}, of one exact sample {exact:.5}");
        let target = Some(BenchTarget::AtMost(most));
        let part = match exact.max(smooth) < UNSEEN_FLIP {
            true => BenchFigure::absent(PART, place, line, name, "x", errors),
            false => BenchFigure::new(PART, place, line, name, smooth / exact, "x")
                .note(errors)
                .target(target),
        };
        let time = BenchFigure::median(PART, place, line, "picture", &self.smooth_ms, "ms");
        vec![part, time]
    }
}

/// Measures a model from every distance.
///
/// # Errors
/// When a picture cannot be drawn, or `progress` is cancelled.
pub fn figures(
    session: &BenchSession,
    case: &BenchCase<'_>,
    plan: &BenchPlan,
    progress: &dyn Progress,
) -> Result<Vec<BenchFigure>, BenchError> {
    let mut engine = session.engine(case.model, SIZE)?;
    let settings = JudgedSettings::of(case.model);
    let all = plan.fills.len() as u64 * u64::from(plan.error_views);
    progress.stage(&format!("pictures of {}", case.name), all);
    let mut figures = Vec::new();
    for &fill in &plan.fills {
        let mut found = FoundPictures::default();
        for view in &views(case.model, SIZE, fill, plan.error_views.max(1))? {
            if progress.is_cancelled() {
                return Err(BenchError::Cancelled);
            }
            found.add(&mut engine, view, &settings)?;
            progress.advance(1);
        }
        figures.extend(found.figures(&case.place(SIZE, fill), LINE, ERROR_PART));
    }
    Ok(figures)
}

/// Measures what is hard on purpose, as this camera sees it.
///
/// # Errors
/// When a picture cannot be drawn.
pub fn figures_of_scene(
    session: &BenchSession,
    case: &BenchCase<'_>,
    camera: &Camera,
) -> Result<Vec<BenchFigure>, BenchError> {
    let size = (camera.width, camera.height);
    let mut engine = session.engine(case.model, size)?;
    let mut found = FoundPictures::default();
    let view = camera.view(case.model.origin)?;
    found.add(&mut engine, &view, &JudgedSettings::of(case.model))?;
    let line = format!("{LINE} of {}", case.name);
    Ok(found.figures(&case.place(size, 0.0), &line, SCENE_PART))
}

/// Height and width of the blade, and its thickness.
const BLADE: (f32, f32) = (129.0, 0.6);

/// A plate of 0.6 x 129 x 129 units, and the camera that sees it from its edge, its bounding sphere an eighth of the picture: the
/// edge is a fifth of a pixel wide. Standing and turned a little, so that it passes between the centers of pixels.
///
/// # Errors
/// Errors of building the tree.
pub fn blade(progress: &dyn Progress) -> Result<(Model, Camera), BenchError> {
    let (side, thickness) = BLADE;
    let half = Vec3::new(thickness, side, side) / 2.0;
    let corner = |i: u32| {
        half * Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 1.0 } else { -1.0 }))
    };
    // Two triangles a face, counter-clockwise from outside, corners of their own for each face.
    let faces = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let mut mesh = Mesh::default();
    for face in faces {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(face.map(corner));
        mesh.triangles
            .extend([[0, 1, 2], [0, 2, 3]].map(|triangle| triangle.map(|own| first + own)));
    }
    let model = tree::build(mesh, &BuildOptions::default(), progress)?;
    let radius = f64::from(half.length());
    let field = 2.0 * FRAC_PI_8;
    let distance = radius / ((field / 2.0).tan() / 8.0).atan().sin();
    // Up leans by seven degrees.
    let up = DVec3::new(0.12, 1.0, 0.0);
    let depths = [distance - 1.05 * radius, distance + 1.05 * radius];
    let camera = Camera::look_at(SIZE, DVec3::Z * distance, DVec3::ZERO, up, field, depths);
    Ok((model, camera))
}

#[cfg(test)]
mod tests {
    use super::super::verdict::BenchVerdict;
    use super::*;

    #[test]
    fn a_third_of_the_error_is_kept_and_half_is_missed() {
        let verdict = |smooth: f64, exact: f64| {
            let found = FoundPictures {
                smooth_flip: vec![smooth],
                exact_flip: vec![exact],
                smooth_ms: vec![1.0],
            };
            let found = |most: f64| found.figures(&BenchPlace::default(), LINE, most)[0].verdict();
            [found(ERROR_PART), found(SCENE_PART)]
        };
        use BenchVerdict::{Absent, Miss, Pass};
        assert_eq!(verdict(0.001, 0.0031), [Pass; 2]);
        assert_eq!(verdict(0.001, 0.002), [Miss, Pass]);
        assert_eq!(verdict(0.003, 0.002), [Miss; 2]);
        // Equal but for what nobody sees.
        assert_eq!(verdict(0.00005, 0.00005), [Absent; 2]);
        // What one sample shows without error, the default spoils.
        assert_eq!(verdict(0.001, 0.0), [Miss; 2]);
    }
}
