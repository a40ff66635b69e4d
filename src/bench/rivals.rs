//! What other programs do, in the same run: rays through a bounding volume hierarchy (crate obvhs), and a chain of
//! simplified meshes of which each view draws the coarsest whose error is at most a pixel (crate meshopt).
//!
//! Both need the feature `rivals`; without it there are none.

#[cfg(feature = "rivals")]
mod chain;
#[cfg(feature = "rivals")]
mod rays;

use super::BenchError;
use crate::image::Image;
use crate::math::camera::View;
use crate::progress::Progress;
use crate::tree::Model;

/// Whether this build has them.
pub const ARE_BUILT_IN: bool = cfg!(feature = "rivals");

/// Casts one ray through the center of each pixel, on two threads.
pub trait RayCaster: std::fmt::Debug {
    /// The picture of a perspective view: the default light, black background. Without depth and normals.
    fn draw(&self, view: &View) -> Image;
}

/// A mesh of the chain.
#[derive(Debug, Clone)]
pub struct RivalLevel {
    /// Corner indices into the vertices of the model.
    pub triangles: Vec<[u32; 3]>,
    /// How far its surface is from the model's at most, as the simplification says, in units of the model.
    pub error: f32,
}

/// What stands beside a model.
#[derive(Debug)]
pub struct RivalRenderers<'m> {
    /// Rays.
    pub caster: Option<Box<dyn RayCaster + 'm>>,
    /// Building the hierarchy took, milliseconds.
    pub caster_build_ms: f64,
    /// The chain, the whole mesh first; empty where there is none.
    pub chain: Vec<RivalLevel>,
    /// Building the chain took, milliseconds.
    pub chain_build_ms: f64,
}

impl<'m> RivalRenderers<'m> {
    /// Builds both. Seconds for a million triangles, and 120 bytes a triangle.
    ///
    /// # Errors
    /// When a crate fails, or `progress` is cancelled.
    #[cfg(feature = "rivals")]
    pub fn build(model: &'m Model, progress: &dyn Progress) -> Result<Self, BenchError> {
        use std::time::Instant;
        progress.stage("ray caster", 0);
        let start = Instant::now();
        let caster = rays::RayScene::new(model)?;
        let caster_build_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        let chain = chain::build(model, progress)?;
        Ok(Self {
            caster: Some(Box::new(caster)),
            caster_build_ms,
            chain,
            chain_build_ms: start.elapsed().as_secs_f64() * 1e3,
        })
    }

    /// None: this build is without them.
    ///
    /// # Errors
    /// None.
    #[cfg(not(feature = "rivals"))]
    pub fn build(_model: &'m Model, _progress: &dyn Progress) -> Result<Self, BenchError> {
        Ok(Self {
            caster: None,
            caster_build_ms: f64::NAN,
            chain: Vec::new(),
            chain_build_ms: f64::NAN,
        })
    }
}

/// A level as a model of its own, to draw its triangles.
///
/// # Errors
/// When its tree cannot be built; always in a build without the feature `rivals`.
pub fn model(of: &Model, level: &RivalLevel) -> Result<Model, BenchError> {
    #[cfg(feature = "rivals")]
    return chain::model(of, level);
    #[cfg(not(feature = "rivals"))]
    Err(BenchError::Rival {
        name: "simplified meshes",
        cause: format!(
            "{} of {} triangles: this build is without the feature rivals",
            level.triangles.len(),
            of.triangles.len()
        ),
    })
}

/// The coarsest of the levels (ascending in their errors) whose error covers at most a pixel where the model comes nearest
/// to the eye; the first where none does.
pub fn level_for(errors: &[f32], model: &Model, view: &View) -> usize {
    let center = view.view_from_model.transform_point3(model.orbit_center);
    let nearest = if view.is_perspective {
        (center.length() - model.orbit_radius * view.model_scale).max(view.near)
    } else {
        1.0
    };
    let px = view.focal_px() * view.model_scale / nearest;
    errors.iter().rposition(|e| e * px <= 1.0).unwrap_or(0)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::chart::run::orbit;
    use crate::generate::{self, GeneratedShape, ShapeSpec};
    use crate::progress::SilentProgress;
    use crate::tree::{self, BuildOptions};

    fn statue() -> Model {
        let spec = ShapeSpec::with_triangles(GeneratedShape::Statue, 20_000).unwrap();
        tree::build(
            generate::mesh(&spec),
            &BuildOptions::default(),
            &SilentProgress,
        )
        .unwrap()
    }

    #[test]
    fn a_level_errs_by_a_pixel_at_most() {
        let model = statue();
        let view = orbit(&model, (500, 500), 0.5, 0, 9).unwrap();
        let center = view.view_from_model.transform_point3(model.orbit_center);
        let nearest = center.length() - model.orbit_radius;
        // So large is a pixel there.
        let pixel = nearest / view.focal_px();
        let errors = [0.0, 0.5 * pixel, 0.99 * pixel, 1.01 * pixel];
        assert_eq!(level_for(&errors, &model, &view), 2);
        let far = orbit(&model, (500, 500), 0.25, 0, 9).unwrap();
        assert_eq!(level_for(&errors, &model, &far), 3);
        assert_eq!(level_for(&[9.0], &model, &view), 0);
    }

    #[cfg(feature = "rivals")]
    #[test]
    fn both_draw_what_the_triangles_show() {
        use crate::image::compare;
        use crate::render::PictureOutputs;
        use crate::render::Settings;
        use crate::render::engine::{Backend, Engine};
        let model = statue();
        let size = (200, 150);
        let view = orbit(&model, size, 0.9, 1, 9).unwrap();
        let settings = crate::bench::cases::triangles().settings;
        let draw = |model: &Model, settings: &Settings| {
            let mut engine =
                Engine::new(&Backend::Reference, model, size, PictureOutputs::default()).unwrap();
            engine.render(&view, settings).unwrap()
        };
        let picture = draw(&model, &settings);
        let rivals = RivalRenderers::build(&model, &SilentProgress).unwrap();
        let rays = rivals.caster.as_ref().unwrap().draw(&view);
        let off = compare(&picture, &rays, 8.0).unwrap();
        // Corners are snapped to 1/256 pixel by one and not by the other: single pixels on edges.
        assert!(
            off.missing + off.extra <= 12 && off.object.past_level * 100 <= off.object.pixels,
            "{off:?}"
        );
        // Shifted by a part of a pixel, as samples of a reference are.
        let shifted = crate::image::jittered(&view, 1, 4);
        let mut engine =
            Engine::new(&Backend::Reference, &model, size, PictureOutputs::default()).unwrap();
        let moved = engine.render(&shifted, &settings).unwrap();
        let rays = rivals.caster.as_ref().unwrap().draw(&shifted);
        let [own, other] = [&moved, &picture].map(|p| compare(p, &rays, 8.0).unwrap());
        assert!(
            own.missing + own.extra <= 12 && other.object.past_level > 4 * own.object.past_level,
            "{own:?} {other:?}"
        );
        // Ever fewer triangles, ever larger errors, and what is within a pixel looks alike.
        assert!(rivals.chain.len() > 3, "{} levels", rivals.chain.len());
        for pair in rivals.chain.windows(2) {
            assert!(pair[1].triangles.len() < pair[0].triangles.len());
            assert!(pair[1].error >= pair[0].error);
        }
        let errors: Vec<f32> = rivals.chain.iter().map(|l| l.error).collect();
        let level = level_for(&errors, &model, &view);
        assert!(level > 0, "{errors:?}");
        let coarse = super::model(&model, &rivals.chain[level]).unwrap();
        assert_eq!(coarse.triangles.len(), rivals.chain[level].triangles.len());
        let off = compare(&picture, &draw(&coarse, &settings), 8.0).unwrap();
        // The outline of 500 pixels may move by one.
        assert!(
            off.missing + off.extra < 500 && off.hole_pixels == 0,
            "{off:?}"
        );
    }
}
