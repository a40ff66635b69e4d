//! Drives a model along a path of the camera or of the threshold, and measures how steady each way to draw it is.

use super::profile::ProfileError;
use super::temporal::{PictureSequence, TemporalRules, churn};
use crate::cut::{Cut, CutSelector};
use crate::image::FloatImage;
use crate::math::camera::{self, Camera, View};
use crate::progress::Progress;
use crate::render::engine::Engine;
use crate::render::{Blend, Method, Settings, Shading, SplatKind, cut_key, frame_plan};
use crate::tree::{Model, OrbitSphere};
use glam::{DMat4, DVec3};
use std::sync::Arc;

/// How things move from frame to frame.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CameraPath {
    /// The camera turns about the vertical axis through the model's middle.
    Orbit,
    /// The camera goes straight ahead.
    Dolly,
    /// The camera rests and the threshold falls.
    Refine,
}

/// One frame of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionFrame {
    /// What is seen.
    pub view: View,
    /// The threshold over the one asked for: 1 but for [`CameraPath::Refine`].
    pub threshold_factor: f32,
}

/// What is looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionTarget {
    /// World position of the model-space zero.
    pub origin: DVec3,
    /// Middle, world space.
    pub center: DVec3,
    /// Largest distance of a vertex from it, above 0.
    pub radius: f64,
}

/// A path in even steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionSteps {
    /// Which.
    pub path: CameraPath,
    /// Number of steps; frames are one more.
    pub count: u32,
    /// Orbit: radians a step. Dolly: the share of its distance from the target that the camera advances, so that it
    /// moves as far as an orbit does in a step.
    pub angle: f64,
    /// Refine: the first threshold over the last.
    pub coarsest: f32,
}

impl MotionTarget {
    /// The model's middle and radius, those of the standard orbit.
    pub fn of(model: &Model) -> Self {
        let OrbitSphere { center, radius } = model.orbit_sphere();
        Self {
            origin: model.origin,
            center,
            radius: radius.max(f64::MIN_POSITIVE),
        }
    }
}

/// The frames of a path that begins at `start`, one more than there are steps.
///
/// Orbits keep the distance and so the near and far planes. Going ahead moves the planes with the camera where
/// `fits_planes`, so that they enclose the target's sphere as those of [`Camera::orbit`] do; else they stay. An
/// orthographic camera that goes ahead sees the same. Thresholds fall by the same factor in each step.
///
/// # Errors
/// As [`Camera::view`].
pub fn frames(
    start: &Camera,
    target: &MotionTarget,
    steps: &MotionSteps,
    fits_planes: bool,
) -> Result<Vec<MotionFrame>, camera::CameraError> {
    let MotionTarget { center, radius, .. } = *target;
    let mut distance = -start.view.transform_point3(center).z;
    let mut camera = start.clone();
    let mut frames = Vec::with_capacity(steps.count as usize + 1);
    for step in 0..=steps.count {
        let mut threshold_factor = 1.0;
        match steps.path {
            CameraPath::Orbit => {
                let turn = DMat4::from_translation(center)
                    * DMat4::from_rotation_y(-f64::from(step) * steps.angle)
                    * DMat4::from_translation(-center);
                camera.view = start.view * turn;
            }
            CameraPath::Dolly if step > 0 => {
                let ahead = distance * steps.angle;
                distance -= ahead;
                camera.view = DMat4::from_translation(DVec3::Z * ahead) * camera.view;
                if fits_planes {
                    let near = (distance - 1.05 * radius).max(0.01 * radius);
                    let far = distance + 1.05 * radius;
                    camera.proj.z_axis.z = far / (near - far);
                    camera.proj.w_axis.z = near * far / (near - far);
                }
            }
            CameraPath::Dolly => {}
            CameraPath::Refine => {
                let left = 1.0 - step as f32 / steps.count.max(1) as f32;
                threshold_factor = steps.coarsest.powf(left);
            }
        }
        frames.push(MotionFrame {
            view: camera.view(target.origin)?,
            threshold_factor,
        });
    }
    Ok(frames)
}

/// One way to draw.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionSubject {
    /// Name for people.
    pub label: String,
    /// How it is drawn; on a path that refines the threshold is the last one.
    pub settings: Settings,
}

/// What is to be measured.
#[derive(Debug, Clone, Copy)]
pub struct MotionPlan<'a> {
    /// The frames in order, all of the size that the engine was made for.
    pub frames: &'a [MotionFrame],
    /// What is compared.
    pub subjects: &'a [MotionSubject],
    /// The reference has this many samples a pixel, squared; 0 counts as 1.
    pub samples_side: u32,
    /// What counts as a pop.
    pub rules: TemporalRules,
}

/// What stands for the truth where a model is drawn with `settings`: its triangles in the same light, or of a point cloud
/// all points as splats of their own size.
pub fn reference_settings(model: &Model, settings: &Settings) -> Settings {
    let is_cloud = !model.kind().is_surface();
    Settings {
        method: if is_cloud {
            Method::Splats
        } else {
            Method::Triangles
        },
        splat: SplatKind::Square,
        blend: Some(Blend::Opaque),
        shading: Shading::PerSplat,
        low_pass_px: None,
        threshold_px: 0.0,
        depth_offset: None,
        ..*settings
    }
}

/// One way to draw while it is measured.
struct MotionRun {
    settings: Settings,
    reference: Settings,
    sequence: PictureSequence,
    cut: Cut,
}

/// The references of one frame, those of equal settings once.
type MotionReferences = Vec<(Settings, Arc<FloatImage>)>;

/// Draws the frames with every subject and measures each; the sequences are in the order of the subjects. `engine` draws
/// `model`.
///
/// # Errors
/// When a frame cannot be drawn, or `progress` is cancelled.
pub fn measure(
    engine: &mut Engine<'_>,
    model: &Model,
    plan: &MotionPlan<'_>,
    progress: &dyn Progress,
) -> Result<Vec<PictureSequence>, ProfileError> {
    let side = plan.samples_side.max(1);
    let mut runs: Vec<MotionRun> = plan
        .subjects
        .iter()
        .map(|subject| MotionRun {
            settings: subject.settings,
            reference: reference_settings(model, &subject.settings),
            sequence: PictureSequence::new(plan.rules),
            cut: Cut::default(),
        })
        .collect();
    let (mut selector, mut spare) = (CutSelector::default(), Cut::default());
    let mut references: MotionReferences = Vec::new();
    let mut last: Option<View> = None;
    progress.stage("draw", plan.frames.len() as u64);
    for (index, frame) in plan.frames.iter().enumerate() {
        let view = frame.view;
        // A camera at rest sees the same reference.
        if last != Some(view) {
            references.clear();
            last = Some(view);
        }
        for run in &mut runs {
            if progress.is_cancelled() {
                return Err(ProfileError::Cancelled(index));
            }
            let reference = match references.iter().find(|(s, _)| *s == run.reference) {
                Some((_, reference)) => reference.clone(),
                None => {
                    let mean = Arc::new(engine.supersample(&view, &run.reference, side)?);
                    references.push((run.reference, mean.clone()));
                    mean
                }
            };
            let mut settings = run.settings;
            settings.threshold_px *= frame.threshold_factor;
            let picture = engine.render(&view, &settings)?.to_float();
            let mut share = None;
            if settings.has_cut() {
                // The frame's own cut is not kept by all that draws.
                let settings = frame_plan::resolve_settings(&settings, model, &view);
                let cut_settings = cut_key::cut_settings(&settings, model);
                selector.select(model, &view, &cut_settings, &mut spare);
                share = (index > 0).then(|| churn(drawn(&run.cut), drawn(&spare)));
                std::mem::swap(&mut run.cut, &mut spare);
            }
            // All pictures have the size of the engine, which is all that can go wrong.
            if let Err(error) = run.sequence.push(reference, Arc::new(picture), share) {
                unreachable!("pictures of one size: {error}");
            }
        }
        progress.advance(1);
    }
    Ok(runs.into_iter().map(|run| run.sequence).collect())
}

/// What a cut draws, in ascending order: its list, its id, and of a row how many splats it has.
fn drawn(cut: &Cut) -> impl Iterator<Item = (u8, u32, u32)> + '_ {
    let nodes = cut.nodes.iter().map(|&id| (0, id, 1));
    let strips = cut.strips.iter().map(|row| (1, row.node, row.count));
    let leaves = cut.leaves.iter().map(|&id| (2, id, 1));
    let triangles = cut.triangles.iter().map(|&id| (3, id, 1));
    nodes.chain(strips).chain(leaves).chain(triangles)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failing test panics")]

    use super::*;
    use glam::Vec3;

    const TARGET: MotionTarget = MotionTarget {
        origin: DVec3::new(100.0, 0.0, 0.0),
        center: DVec3::new(101.0, 2.0, 3.0),
        radius: 2.0,
    };

    fn start() -> Camera {
        Camera::orbit((200, 100), TARGET.center, TARGET.radius, 0.4, 0.3, 0.8)
    }

    fn path(path: CameraPath, fits_planes: bool) -> Vec<MotionFrame> {
        let steps = MotionSteps {
            path,
            count: 8,
            angle: 0.01,
            coarsest: 16.0,
        };
        frames(&start(), &TARGET, &steps, fits_planes).unwrap()
    }

    #[test]
    fn an_orbit_is_the_standard_one() {
        for (i, frame) in path(CameraPath::Orbit, true).iter().enumerate() {
            let azimuth = 0.4 + 0.01 * i as f64;
            let camera = Camera::orbit((200, 100), TARGET.center, TARGET.radius, azimuth, 0.3, 0.8);
            let expected = camera.view(TARGET.origin).unwrap();
            assert!(frame.view.eye.distance(expected.eye) < 1e-5);
            assert!(frame.view.backward.distance(expected.backward) < 1e-6);
            assert_eq!(
                (frame.view.near, frame.threshold_factor),
                (expected.near, 1.0)
            );
        }
    }

    #[test]
    fn going_ahead_shortens_the_distance_by_a_share() {
        let center = (TARGET.center - TARGET.origin).as_vec3();
        let far = path(CameraPath::Dolly, true)[0].view.distance(center);
        for (i, frame) in path(CameraPath::Dolly, true).iter().enumerate() {
            let distance = frame.view.distance(center);
            assert!((distance - far * 0.99f32.powi(i as i32)).abs() < 1e-4 * far);
            assert!((frame.view.near - (distance - 2.1)).abs() < 1e-4);
            assert!((frame.view.far - (distance + 2.1)).abs() < 1e-4);
            // Straight ahead: what is in the middle stays there.
            let (x, y, _) = frame.view.project(center);
            assert!((x - 100.0).abs() < 1e-2 && (y - 50.0).abs() < 1e-2);
        }
        let fixed = path(CameraPath::Dolly, false);
        assert_eq!(fixed[0].view.near, fixed[8].view.near);
    }

    #[test]
    fn refining_ends_at_the_threshold_asked_for() {
        let frames = path(CameraPath::Refine, true);
        assert!(frames.iter().all(|f| f.view == frames[0].view));
        let factors: Vec<f32> = frames.iter().map(|f| f.threshold_factor).collect();
        assert_eq!((factors[0], factors[4], factors[8]), (16.0, 4.0, 1.0));
        assert!(factors.windows(2).all(|w| w[1] < w[0]));
    }

    /// The mirror draws a triangle; against one sample a pixel its own picture does not flicker, and no cut changes.
    #[test]
    fn one_exact_sample_does_not_flicker_against_itself() {
        use crate::mesh::Mesh;
        use crate::progress::SilentProgress;
        use crate::render::PictureOutputs;
        use crate::render::engine::Backend;
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        let model =
            crate::tree::build(mesh, &crate::tree::BuildOptions::default(), &SilentProgress)
                .unwrap();
        let target = MotionTarget::of(&model);
        let camera = Camera::orbit((40, 40), target.center, target.radius, 0.2, 0.1, 1.0);
        let steps = MotionSteps {
            path: CameraPath::Orbit,
            count: 3,
            angle: 0.05,
            coarsest: 1.0,
        };
        let frames = frames(&camera, &target, &steps, true).unwrap();
        let subjects = [Method::Triangles, Method::Pop].map(|method| MotionSubject {
            label: String::new(),
            settings: Settings {
                method,
                ..Settings::default()
            },
        });
        let mut engine = Engine::new(
            &Backend::Reference,
            &model,
            (40, 40),
            PictureOutputs::default(),
        )
        .unwrap();
        let mut plan = MotionPlan {
            frames: &frames,
            subjects: &subjects,
            samples_side: 1,
            rules: TemporalRules::default(),
        };
        let found = measure(&mut engine, &model, &plan, &SilentProgress).unwrap();
        for sequence in &found {
            let figures = sequence.figures();
            assert!(figures.reference_level > 1.0, "{figures:?}");
            assert_eq!((figures.mean_level, figures.max_level), (0.0, 0.0));
        }
        assert_eq!(found[0].figures().mean_churn, None);
        assert_eq!(found[1].figures().mean_churn, Some(0.0));
        // Against more samples its rim does.
        plan.samples_side = 4;
        let found = measure(&mut engine, &model, &plan, &SilentProgress).unwrap();
        assert!(found[0].figures().mean_level > 0.1);
    }

    /// A threshold of little more than a pixel is drawn as a pixel, and the change of its cuts is of those that are drawn.
    #[test]
    fn cuts_are_those_that_views_draw() {
        use crate::generate::{self, GeneratedShape, ShapeSpec};
        use crate::progress::SilentProgress;
        use crate::render::PictureOutputs;
        use crate::render::engine::Backend;
        let mesh =
            generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Statue, 60_000).unwrap());
        let model =
            crate::tree::build(mesh, &crate::tree::BuildOptions::default(), &SilentProgress)
                .unwrap();
        let target = MotionTarget::of(&model);
        let camera = Camera::orbit((40, 40), target.center, target.radius, 0.2, 0.1, 1.0);
        let steps = MotionSteps {
            path: CameraPath::Orbit,
            count: 2,
            angle: 0.05,
            coarsest: 1.0,
        };
        let frames = frames(&camera, &target, &steps, true).unwrap();
        let subjects = [1.0, 1.4, 1.6].map(|threshold_px| MotionSubject {
            label: String::new(),
            settings: Settings {
                threshold_px,
                ..Settings::default()
            },
        });
        let mut engine = Engine::new(
            &Backend::Reference,
            &model,
            (40, 40),
            PictureOutputs::default(),
        )
        .unwrap();
        let plan = MotionPlan {
            frames: &frames,
            subjects: &subjects,
            samples_side: 1,
            rules: TemporalRules::default(),
        };
        let found = measure(&mut engine, &model, &plan, &SilentProgress).unwrap();
        let [one, near, larger] = [0, 1, 2].map(|i| found[i].figures().mean_churn.unwrap());
        assert!(
            one > 0.0 && near == one && larger != one,
            "{one} {near} {larger}"
        );
    }
}
