//! A walk along the poses of the photographs, measured: how much the picture changes from frame to frame, beside a texture
//! that is the same from everywhere.
//!
//! Motion changes both alike. What a view-dependent picture changes more is the change of photographs, which is seen as
//! popping where it comes at a step. Changes are the mean FLIP between frames that follow each other.

use crate::image::Image;
use crate::math::camera::View;
use crate::measure::{PIXELS_PER_DEGREE, flip};
use crate::photos::error::PhotoError;
use crate::photos::look::{LookSettings, WeightForm};
use crate::photos::scene::{CalibratedCamera, PhotoScene};
use crate::photos::stage::PhotoStage;
use crate::photos::surface::renderer_camera;
use crate::progress::Progress;
use crate::projective::frame_photos::{FramePhotos, MOST_PHOTOS};
use crate::render::engine::{Backend, Engine};
use crate::render::{Method, PhotoDisplay, PictureOutputs, Settings};
use crate::tree::Model;
use glam::{DMat3, DQuat};
use std::sync::Arc;

/// Change from a frame to the next.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct WalkStep {
    /// Mean FLIP between the frames, photographs chosen and weighed for each view.
    pub by_view: f64,
    /// Mean FLIP between the same frames with the fixed texture: of all photographs the sharpest at each place.
    pub fixed: f64,
    /// Photographs that were chosen for one of the two frames and not for the other.
    pub exchanged: usize,
}

/// Figures of a walk.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct WalkFigures {
    /// Largest step by view.
    pub largest_by_view: f64,
    /// Largest step of the fixed texture.
    pub largest_fixed: f64,
    /// The first over the second.
    pub ratio: f64,
    /// Largest ratio of the two in one step.
    pub step_ratio: f64,
    /// Number of the frame, from 0, that the largest step by view starts at.
    pub worst_frame: usize,
}

impl WalkFigures {
    /// Figures of steps; zeros of none.
    pub fn of(steps: &[WalkStep]) -> Self {
        let mut found = Self::default();
        for (frame, step) in steps.iter().enumerate() {
            if step.by_view > found.largest_by_view {
                (found.largest_by_view, found.worst_frame) = (step.by_view, frame);
            }
            found.largest_fixed = found.largest_fixed.max(step.fixed);
            if step.fixed > 0.0 {
                found.step_ratio = found.step_ratio.max(step.by_view / step.fixed);
            }
        }
        if found.largest_fixed > 0.0 {
            found.ratio = found.largest_by_view / found.largest_fixed;
        }
        found
    }
}

/// Indices of cameras in the order of a walk: from the one farthest from the middle of all to the nearest that was not yet
/// passed, and so on.
fn order_of(cameras: &[CalibratedCamera]) -> Vec<usize> {
    let count = cameras.len().max(1) as f64;
    let middle = cameras.iter().map(|own| own.center).sum::<glam::DVec3>() / count;
    let mut left: Vec<usize> = (0..cameras.len()).collect();
    let mut order = Vec::with_capacity(left.len());
    let farthest = |a: &usize, b: &usize| {
        let away = |i: &usize| cameras[*i].center.distance_squared(middle);
        away(b).total_cmp(&away(a))
    };
    left.sort_by(farthest);
    while !left.is_empty() {
        let nearest = match order.last() {
            None => 0,
            Some(last) => {
                let last: &usize = last;
                let away = |at: &usize| {
                    cameras[left[*at]]
                        .center
                        .distance_squared(cameras[*last].center)
                };
                let order = |a: &usize, b: &usize| away(a).total_cmp(&away(b));
                (0..left.len()).min_by(order).unwrap_or_default()
            }
        };
        order.push(left.remove(nearest));
    }
    order
}

/// Cameras of so many frames on the way from photograph to photograph, evenly by distance, each with the lens of the first as
/// a pinhole and pictures of at most `side` pixels. Empty without cameras.
pub fn walk_cameras(
    cameras: &[CalibratedCamera],
    frames: usize,
    side: u32,
) -> Vec<CalibratedCamera> {
    let way: Vec<CalibratedCamera> = (order_of(cameras).into_iter())
        .map(|index| cameras[index])
        .collect();
    let Some(first) = way.first() else {
        return Vec::new();
    };
    let longest = f64::from(first.width.max(first.height).max(1));
    let scale = (f64::from(side) / longest).min(1.0);
    let scaled = |pixels: u32| (f64::from(pixels) * scale).round().max(1.0) as u32;
    let shown = first
        .pinhole()
        .scaled(scaled(first.width), scaled(first.height));
    let lengths: Vec<f64> = (way.windows(2))
        .map(|pair| pair[0].center.distance(pair[1].center))
        .collect();
    let whole: f64 = lengths.iter().sum();
    let at = |frame: usize| {
        let mut left = whole * frame as f64 / frames.saturating_sub(1).max(1) as f64;
        let mut leg = 0;
        while leg + 1 < lengths.len() && left > lengths[leg] {
            left -= lengths[leg];
            leg += 1;
        }
        let (from, to) = (&way[leg], &way[(leg + 1).min(way.len() - 1)]);
        let part = match lengths.get(leg) {
            Some(length) if *length > 0.0 => (left / length).clamp(0.0, 1.0),
            _ => 0.0,
        };
        let turn = |own: &CalibratedCamera| DQuat::from_mat3(&own.rotation);
        CalibratedCamera {
            center: from.center.lerp(to.center, part),
            rotation: DMat3::from_quat(turn(from).slerp(turn(to), part)),
            ..shown
        }
    };
    (0..frames).map(at).collect()
}

/// A model with its photographs, to be walked along.
#[derive(Debug)]
pub struct PhotoWalk<'a> {
    /// The photographs.
    pub scene: &'a PhotoScene,
    /// The model.
    pub model: &'a Model,
    /// Photographs on the model.
    pub stage: &'a mut PhotoStage,
    /// Who draws.
    pub backend: &'a Backend,
    /// Longest side of photographs in memory, pixels.
    pub longest_side: u32,
    /// Rules by which photographs are weighed by view.
    pub settings: LookSettings,
}

impl PhotoWalk<'_> {
    /// Cameras of the photographs that show the model.
    pub fn poses(&self) -> Vec<CalibratedCamera> {
        let photos = self.scene.photos.iter().zip(self.stage.photos());
        let showing =
            photos.filter(|(_, own)| (own.as_ref()).is_some_and(|own| own.prepared.shows_model()));
        showing.map(|(photo, _)| photo.camera).collect()
    }

    /// Walks along cameras of one size, and tells the change of each step. What cannot be decoded stays a thumbnail.
    ///
    /// # Errors
    /// When the backend cannot draw, the model is behind a camera, or `progress` is cancelled.
    pub fn measure(
        &mut self,
        cameras: &[CalibratedCamera],
        progress: &dyn Progress,
    ) -> Result<Vec<WalkStep>, PhotoError> {
        let Some(first) = cameras.first() else {
            return Ok(Vec::new());
        };
        let settings = Settings {
            method: match self.model.kind().is_surface() {
                true => Method::Triangles,
                false => Method::Splats,
            },
            photos: PhotoDisplay::Color,
            ..Settings::default()
        };
        let size = (first.width, first.height);
        let mut engine = Engine::new(self.backend, self.model, size, PictureOutputs::default())?;
        let fixed = Arc::new(self.fixed_texture(&self.view(first)?));
        let mut last_pictures: Option<[Image; 2]> = None;
        let (mut last, mut steps) = (Vec::new(), Vec::new());
        progress.stage("walk", cameras.len() as u64);
        for camera in cameras {
            if progress.is_cancelled() {
                return Err(PhotoError::Cancelled);
            }
            let view = self.view(camera)?;
            let photos = self.chosen(&view, &last);
            let chosen: Vec<usize> = indices(&photos).collect();
            engine.set_photos(Some(Arc::new(photos)))?;
            let by_view = engine.render(&view, &settings)?;
            engine.set_photos(Some(fixed.clone()))?;
            let pictures = [by_view, engine.render(&view, &settings)?];
            if let Some(before) = &last_pictures {
                let change = |i: usize| flip(&before[i], &pictures[i], PIXELS_PER_DEGREE);
                let differs =
                    |a: &[usize], b: &[usize]| a.iter().filter(|i| !b.contains(i)).count();
                steps.push(WalkStep {
                    by_view: change(0)?.mean,
                    fixed: change(1)?.mean,
                    exchanged: differs(&last, &chosen) + differs(&chosen, &last),
                });
            }
            (last_pictures, last) = (Some(pictures), chosen);
            progress.advance(1);
        }
        Ok(steps)
    }

    fn view(&self, camera: &CalibratedCamera) -> Result<View, PhotoError> {
        let of_renderer = renderer_camera(camera, self.model).ok_or_else(|| {
            let path = self.scene.path.display();
            PhotoError::Usage(format!(
                "{path}: all of the model is behind a camera of the walk"
            ))
        })?;
        Ok(of_renderer.view(self.model.origin)?)
    }

    /// Photographs for a view, decoded whole.
    fn chosen(&mut self, view: &View, last: &[usize]) -> FramePhotos {
        let settings = self.settings;
        let chosen = self.stage.frame(view, &settings, &|_| true, last);
        self.stage
            .load_whole(self.scene, &chosen, self.longest_side);
        self.stage.frame(view, &settings, &|_| true, last)
    }

    /// Photographs that give the same colors from everywhere.
    fn fixed_texture(&mut self, view: &View) -> FramePhotos {
        let settings = LookSettings {
            form: WeightForm::Baked,
            blend: 1,
            ..LookSettings::default()
        };
        let most = std::mem::replace(&mut self.stage.most, MOST_PHOTOS);
        let all = self.stage.frame(view, &settings, &|_| true, &[]);
        self.stage.load_whole(self.scene, &all, self.longest_side);
        let all = self.stage.frame(view, &settings, &|_| true, &[]);
        self.stage.most = most;
        all
    }
}

/// Places of chosen photographs in their scene.
fn indices(photos: &FramePhotos) -> impl Iterator<Item = usize> + '_ {
    photos.photos.iter().map(|own| own.photo.index as usize)
}

/// Rows of comma-separated values, a row a step.
pub fn walk_csv(steps: &[WalkStep]) -> String {
    let rows = steps.iter().enumerate().map(|(frame, step)| {
        let WalkStep {
            by_view,
            fixed,
            exchanged,
        } = step;
        format!("{frame},{by_view},{fixed},{exchanged}\n")
    });
    "frame,flip_by_view,flip_fixed,exchanged\n".to_owned() + &rows.collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::projective::lens::CameraLens;
    use glam::DVec3;

    fn camera(x: f64) -> CalibratedCamera {
        CalibratedCamera {
            width: 400,
            height: 300,
            focal: [300.0; 2],
            principal: [200.0, 150.0],
            lens: CameraLens::default(),
            rotation: DMat3::from_rotation_y(0.1 * x),
            center: DVec3::new(x, 0.0, 0.0),
        }
    }

    #[test]
    fn a_walk_goes_from_end_to_end_at_one_speed() {
        let poses = [3.0, 0.0, 7.0, 1.0].map(camera);
        let walk = walk_cameras(&poses, 15, 100);
        let x: Vec<f64> = walk.iter().map(|own| own.center.x).collect();
        // From the end that is farther from the middle.
        for (frame, x) in x.iter().enumerate() {
            assert!(
                (x - (7.0 - 0.5 * frame as f64)).abs() < 1e-9,
                "{frame}: {x}"
            );
        }
        let turned = walk[4]
            .rotation
            .x_axis
            .angle_between(poses[0].rotation.x_axis);
        assert!((turned - 0.2).abs() < 1e-6, "{turned}");
        assert_eq!((walk[3].width, walk[3].height), (100, 75));
        assert!(walk_cameras(&[], 5, 100).is_empty());
        assert_eq!(walk_cameras(&poses[..1], 3, 100).len(), 3);
    }

    #[test]
    fn figures_are_those_of_the_largest_steps() {
        let step = |by_view: f64, fixed: f64| WalkStep {
            by_view,
            fixed,
            exchanged: 1,
        };
        let steps = [step(0.1, 0.2), step(0.3, 0.1), step(0.2, 0.1)];
        let found = WalkFigures::of(&steps);
        assert_eq!((found.worst_frame, found.largest_fixed), (1, 0.2));
        assert!((found.ratio - 1.5).abs() < 1e-12 && (found.step_ratio - 3.0).abs() < 1e-12);
        assert_eq!(WalkFigures::of(&[]), WalkFigures::default());
        assert_eq!(walk_csv(&steps).lines().nth(2), Some("1,0.3,0.1,1"));
    }
}
