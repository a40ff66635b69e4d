//! Photographs on the model of the window: what of their scene is there, which of them are chosen for a view, and what the
//! user does with them.

use super::ViewerApp;
use crate::math::camera::{Camera, View};
use crate::math::up_axis::UpAxis;
use crate::open::photo_scene::{has_photographs, without_photographs};
use crate::photos::look::LookSettings;
use crate::photos::photo_loader::{PhotoArrival, PhotoLoader, PhotoRequest};
use crate::photos::scene::{CalibratedCamera, PhotoScene};
use crate::photos::stage::PhotoStage;
use crate::photos::surface::renderer_camera;
use crate::projective::frame_photos::{ComparedPhoto, FramePhotos};
use crate::render::vulkan::photos::pool::PhotoPool;
use crate::render::{PhotoDisplay, Settings};
use crate::viewer::panel::{PhotographRow, PhotographState, PhotographWish};
use crate::viewer::{ViewerError, text};
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Longest side of photographs in memory, pixels.
const LONGEST_SIDE: u32 = 4096;

/// Bytes of whole photographs in memory.
const MEMORY_BYTES: u64 = 2 << 30;

/// Photographs of the window.
#[derive(Debug, Default)]
pub(super) struct ModelPhotographs {
    loader: Option<PhotoLoader>,
    pub(super) scene: Option<Arc<PhotoScene>>,
    pub(super) stage: Option<PhotoStage>,
    /// Which may be used.
    allowed: Vec<bool>,
    /// Photographs of the last frame, and what they were chosen for.
    pub(super) frame: Option<Arc<FramePhotos>>,
    chosen_for: Option<View>,
    /// What is there changed since they were.
    is_stale: bool,
    /// Not all have been looked at.
    is_readying: bool,
    /// Poses of the photographs are drawn in the picture.
    pub(super) has_frusta: bool,
    /// A map of them is shown.
    pub(super) has_radar: bool,
    /// The photograph in whose pose the camera is, and that camera.
    pub(super) pose: Option<(usize, Camera)>,
    /// Part of the picture that shows that photograph as it is.
    compared: f32,
    /// Moment at which the scene was asked for, until a picture shows any of its photographs.
    opened: Option<Instant>,
    /// Moment since which a photograph of the view is a thumbnail.
    blurred: Option<Instant>,
}

impl ModelPhotographs {
    /// Tells whether something of them is painted over the picture.
    pub(super) fn has_marks(&self) -> bool {
        self.has_frusta || self.has_radar
    }

    /// Tells whether threads will send something.
    fn is_loading(&self) -> bool {
        let Some(stage) = &self.stage else {
            return self.loader.is_some();
        };
        let frame = self.frame.as_ref();
        let mut chosen = frame.iter().flat_map(|frame| &frame.photos);
        self.loader.is_some()
            && (self.is_readying || chosen.any(|own| !stage.is_whole(own.photo.index as usize)))
    }

    /// Says in the log how long the first photographs took to be shown, and how long the view had to wait for whole ones.
    fn log_progress(&mut self) {
        let (Some(frame), Some(stage)) = (&self.frame, &self.stage) else {
            return;
        };
        if frame.photos.is_empty() {
            return;
        }
        let photographs = frame.photos.len();
        if let Some(opened) = self.opened.take() {
            let ms = opened.elapsed().as_millis();
            tracing::info!(ms, photographs, "the first photographs are shown");
        }
        let mut chosen = frame.photos.iter().map(|own| own.photo.index as usize);
        match chosen.all(|index| stage.is_whole(index)) {
            false => {
                self.blurred.get_or_insert_with(Instant::now);
            }
            true => {
                if let Some(blurred) = self.blurred.take() {
                    let ms = blurred.elapsed().as_millis();
                    tracing::info!(ms, photographs, "all photographs of the view are whole");
                }
            }
        }
    }

    /// Words that the photographs of any frame take at most.
    fn words(&self) -> u64 {
        let (Some(stage), Some(scene)) = (&self.stage, &self.scene) else {
            return 0;
        };
        // A depth map has at most a Mi of texels; levels take a third more than the largest.
        let of = |own: &crate::photos::scene::ScenePhoto| {
            let [w, h] = [own.camera.width, own.camera.height].map(u64::from);
            let mut texels = w * h;
            let mut side = w.max(h);
            while side > u64::from(LONGEST_SIDE) {
                (side, texels) = (side / 2, texels / 4);
            }
            texels * 4 / 3 + (1 << 20)
        };
        let mut words: Vec<u64> = scene.photos.iter().map(of).collect();
        words.sort_unstable_by(|a, b| b.cmp(a));
        // What comes lies beside what it replaces.
        words.iter().take(stage.most + 2).sum()
    }
}

impl ViewerApp {
    /// Puts the photographs of a scene on the model from now on, as they come.
    pub(super) fn open_photographs(&mut self, path: PathBuf) {
        let Some(model) = self.screen.shared_model().filter(|_| !self.is_preview) else {
            // Once the model is there.
            self.options.photos.scene = Some(path);
            return;
        };
        if self.screen.is_paged() {
            self.options.photos.scene = Some(path);
            self.reload_whole("photographs are put on the whole model");
            return;
        }
        let folder = self.options.photos.folder.clone();
        let request = PhotoRequest {
            path: path.clone(),
            folder,
            model,
            longest_side: LONGEST_SIDE,
            eye: self.eye_in_world(),
        };
        self.photographs = ModelPhotographs {
            has_frusta: self.photographs.has_frusta,
            has_radar: self.photographs.has_radar,
            is_readying: true,
            opened: Some(Instant::now()),
            ..ModelPhotographs::default()
        };
        match PhotoLoader::start(request) {
            Ok(loader) => {
                self.photographs.loader = Some(loader);
                self.set_status(format!("{}: photographs", text::name(&path)));
            }
            Err(error) => self.warn(&format!("cannot start to load photographs: {error}")),
        }
        if self.settings.photos == PhotoDisplay::Off {
            self.settings.photos = PhotoDisplay::Color;
        }
        self.is_dirty = true;
    }

    /// Puts the photographs of a scene on the model that somebody opened; where nobody did, the scene is opened itself.
    pub(super) fn scene_dropped(&mut self, path: PathBuf) {
        let options = &self.options;
        let is_first = self.path.as_os_str().is_empty() || self.path == options.model;
        let is_empty = self.screen.model().is_none() && self.status.is_none();
        match is_empty || (options.model_is_usual && is_first) {
            true => self.open(path, Vec::new()),
            false => self.open_photographs(path),
        }
    }

    /// Has the photographs of a scene that is opened put on its points.
    pub(super) fn take_own_photographs(&mut self, path: &Path) {
        match has_photographs(path, self.options.photos.folder.as_deref()) {
            None => {}
            Some(true) => self.options.photos.scene = Some(path.to_owned()),
            Some(false) => self.warn(&without_photographs(path)),
        }
    }

    /// Has the photographs that are there put on the model that is opened again.
    pub(super) fn keep_photographs(&mut self) {
        if let Some(scene) = &self.photographs.scene {
            self.options.photos.scene = Some(scene.path.clone());
        }
    }

    /// Another model is shown: photographs are put on the first that has come, and on no other.
    pub(super) fn photographs_of_new_model(&mut self) -> Result<(), ViewerError> {
        self.photographs = ModelPhotographs::default();
        self.screen.set_photos(None, 0)?;
        if let Some(path) = self.options.photos.scene.take() {
            self.open_photographs(path);
        }
        Ok(())
    }

    /// Takes what has come of photographs; waits for all where pictures are to be the same each time.
    pub(in crate::viewer) fn take_photographs(&mut self) {
        let waits = self.waits_for_pages();
        loop {
            let waits_now = waits && self.photographs.is_loading();
            let Some(loader) = &mut self.photographs.loader else {
                return;
            };
            let Some(arrival) = loader.poll(waits_now) else {
                return;
            };
            self.photograph_arrived(arrival);
        }
    }

    /// Tells whether photographs are still to come.
    pub(in crate::viewer) fn waits_for_photographs(&self) -> bool {
        self.photographs.is_loading()
    }

    fn photograph_arrived(&mut self, arrival: PhotoArrival) {
        self.is_cover_dirty = true;
        let own = &mut self.photographs;
        match arrival {
            PhotoArrival::Scene(scene, model) => {
                let count = scene.photos.len();
                let most = self.options.photos.most;
                own.stage = Some(PhotoStage::new(model, count, most));
                own.allowed = vec![true; count];
                let remarks = scene.remarks.clone();
                let up = scene.up();
                own.scene = Some(scene);
                remarks.iter().for_each(|remark| self.warn(remark));
                self.take_up_of_photographs(up);
            }
            PhotoArrival::Ready(index, photo) => {
                if let Some(stage) = &mut own.stage {
                    stage.set(index, photo);
                    own.is_stale = true;
                    self.is_dirty = true;
                }
            }
            PhotoArrival::AllReady(gains) => {
                own.is_readying = false;
                own.is_stale = true;
                self.status = None;
                self.is_dirty = true;
                if let (Some(stage), Some(scene)) = (&mut own.stage, &own.scene) {
                    stage.set_gains(&gains);
                    if let Err(error) = stage.check(scene) {
                        self.warn(&error.to_string());
                    }
                }
            }
            PhotoArrival::Whole(index, pixels) => {
                if let Some(stage) = &mut own.stage {
                    stage.set_pixels(index, pixels);
                    own.is_stale = true;
                    self.is_dirty = true;
                }
            }
            PhotoArrival::Unusable(index, sentence) => {
                // Asked for once.
                if let Some(stage) = &mut own.stage {
                    stage.keep_thumbnail(index);
                }
                self.warn(&sentence);
            }
            PhotoArrival::Failed(sentence) => {
                (own.loader, own.is_readying) = (None, false);
                self.status = None;
                self.warn(&sentence);
            }
        }
    }

    /// Makes what is up in the photographs up in the window, unless a person said what is.
    fn take_up_of_photographs(&mut self, up: Option<UpAxis>) {
        let Some(up) = up.filter(|_| self.options.up.is_none()) else {
            return;
        };
        self.up = up;
        let Some(orbit) = &mut self.orbit else {
            return;
        };
        orbit.take_up(up);
        if let Some(camera) = &self.fixed {
            orbit.look_as(camera);
        }
        self.is_dirty = true;
    }

    /// Direction that is up in the photographs of the model, where they have one.
    pub(super) fn up_of_photographs(&self) -> Option<UpAxis> {
        self.photographs.scene.as_ref()?.up()
    }

    /// Chooses photographs for the view of the next frame and hands them to the screen; the settings that it is drawn with.
    ///
    /// # Errors
    /// When device memory runs out.
    pub(super) fn choose_photographs(
        &mut self,
        settings: Settings,
    ) -> Result<Settings, ViewerError> {
        if !settings.shows_photos() {
            return Ok(settings);
        }
        let without = Settings {
            photos: PhotoDisplay::Off,
            ..settings
        };
        if self.waits_for_pages() {
            self.take_photographs();
        }
        let view = self.view_of_picture();
        let origin = self
            .screen
            .model()
            .map_or(DVec3::ZERO, |model| model.origin);
        let own = &mut self.photographs;
        let (Some(view), Some(stage)) = (view, &mut own.stage) else {
            return Ok(without);
        };
        if own.is_stale || own.chosen_for != Some(view) || own.frame.is_none() {
            let last: Vec<usize> = (own.frame.iter().flat_map(|frame| &frame.photos))
                .map(|own| own.photo.index as usize)
                .collect();
            let allowed = &own.allowed;
            let is_allowed = |index: usize| allowed.get(index).is_some_and(|own| *own);
            let mut frame = stage.frame(&view, &LookSettings::default(), &is_allowed, &last);
            if let Some((pose, _)) = &own.pose {
                let at = frame
                    .photos
                    .iter()
                    .position(|own| own.photo.index as usize == *pose);
                frame.compared = at.filter(|_| own.compared > 0.0).map(|at| ComparedPhoto {
                    list_index: at as u32,
                    part: own.compared,
                });
            }
            stage.drop_unused(&frame, MEMORY_BYTES);
            if let Some(loader) = &own.loader {
                if view.is_perspective {
                    loader.look_from(view.eye.as_dvec3() + origin);
                }
                let chosen = frame.photos.iter().map(|own| own.photo.index as usize);
                loader.want(chosen.filter(|index| !stage.is_whole(*index)));
            }
            (own.chosen_for, own.is_stale) = (Some(view), false);
            own.frame = Some(Arc::new(frame));
            if self.waits_for_pages() && self.photographs.is_loading() {
                // Whole ones, for a picture that is the same each time.
                self.take_photographs();
                return self.choose_photographs(settings);
            }
        }
        let words = self.photographs.words();
        self.photographs.log_progress();
        match &self.photographs.frame {
            Some(frame) if !frame.photos.is_empty() => {
                debug_assert!(PhotoPool::words_of(frame) > 0);
                self.screen.set_photos(Some(frame.clone()), words)?;
                Ok(settings)
            }
            _ => Ok(without),
        }
    }

    /// The view of the picture in the window.
    pub(super) fn view_of_picture(&self) -> Option<View> {
        let camera = self.camera()?;
        camera.view(self.screen.model()?.origin).ok()
    }

    /// The eye of the picture in the window, world space.
    fn eye_in_world(&self) -> Option<DVec3> {
        let origin = self.screen.model()?.origin;
        let view = self.view_of_picture().filter(|view| view.is_perspective)?;
        Some(view.eye.as_dvec3() + origin)
    }

    /// Draws again where the next frame would be sharper.
    pub(super) fn sharpen_photographs(&mut self) {
        if self.settings.shows_photos() && self.screen.are_photos_behind() {
            self.is_dirty = true;
        }
    }

    /// What the panel shows of them.
    pub(super) fn photograph_state(&self) -> Option<PhotographState> {
        let own = &self.photographs;
        let (scene, stage) = (own.scene.as_ref()?, own.stage.as_ref()?);
        let chosen = |index: usize| {
            let mut all = own.frame.iter().flat_map(|frame| &frame.photos);
            all.any(|own| own.photo.index as usize == index)
        };
        let photos = (scene.photos.iter().enumerate()).map(|(index, photo)| PhotographRow {
            name: text::name(std::path::Path::new(&photo.name)),
            is_allowed: own.allowed[index],
            is_used: chosen(index) && self.settings.shows_photos(),
            thumbnail: (stage.photos()[index].as_ref()).map(|own| own.thumbnail.clone()),
        });
        Some(PhotographState {
            photos: photos.collect(),
            has_frusta: own.has_frusta,
            has_radar: own.has_radar,
            pose: own.pose.as_ref().map(|(index, _)| *index),
            compared: own.compared,
        })
    }

    /// Does what the panel asks for.
    pub(super) fn photograph_wish(&mut self, wish: PhotographWish) {
        match wish {
            PhotographWish::Allow(index, is_allowed) => {
                if let Some(own) = self.photographs.allowed.get_mut(index) {
                    *own = is_allowed;
                }
            }
            PhotographWish::AllowAll(is_allowed) => self.photographs.allowed.fill(is_allowed),
            PhotographWish::FlyTo(index) => self.fly_to_photograph(index),
            PhotographWish::Compare(part) => self.photographs.compared = part.clamp(0.0, 1.0),
            PhotographWish::Frusta(has_frusta) => self.photographs.has_frusta = has_frusta,
            PhotographWish::Radar(has_radar) => self.photographs.has_radar = has_radar,
        }
        self.photographs.is_stale = true;
        (self.is_dirty, self.is_cover_dirty) = (true, true);
    }

    /// Switches between no photographs and their colors.
    pub(super) fn switch_photographs(&mut self) {
        if self.photographs.scene.is_none() {
            self.warn("there are no photographs; drop a scene of them on the window, or start with --photos");
            return;
        }
        let photos = match self.settings.photos {
            PhotoDisplay::Off => PhotoDisplay::Color,
            _ => PhotoDisplay::Off,
        };
        self.wish(Settings {
            photos,
            ..self.settings
        });
    }

    /// Looks from the pose of the next photograph (1) or the one before (-1).
    pub(super) fn step_photograph(&mut self, step: i64) {
        let count = self.photographs.allowed.len() as i64;
        if count == 0 {
            self.switch_photographs();
            return;
        }
        let next = match (&self.photographs.pose, step > 0) {
            (Some((index, _)), _) => *index as i64 + step,
            (None, true) => 0,
            (None, false) => -1,
        };
        self.photograph_wish(PhotographWish::FlyTo(next.rem_euclid(count) as usize));
    }

    fn fly_to_photograph(&mut self, index: usize) {
        let (Some(scene), Some(model)) = (&self.photographs.scene, self.screen.model()) else {
            return;
        };
        let Some(photo) = scene.photos.get(index) else {
            return;
        };
        let fitted = fitted_pose(&photo.camera, self.picture_size());
        match renderer_camera(&fitted, model) {
            Some(camera) => {
                self.set_camera(camera.clone());
                self.photographs.pose = Some((index, camera));
            }
            None => {
                let message = format!("{}: all of the model is behind this photograph", photo.name);
                self.warn(&message);
            }
        }
    }

    /// Forgets the pose of a photograph once the camera has left it.
    pub(super) fn leave_pose(&mut self) {
        let has_left = |(_, camera): &(usize, Camera)| {
            (self.fixed.as_ref()).is_none_or(|fixed| fixed.view != camera.view)
        };
        if self.photographs.pose.as_ref().is_some_and(has_left) {
            self.photographs.pose = None;
            self.photographs.is_stale = true;
        }
    }

    /// Everything on the device is gone.
    pub(super) fn photographs_lost_device(&mut self) {
        self.photographs.is_stale = true;
    }
}

/// The camera of a photograph for a picture of this size: all of the photograph is seen, in the middle.
fn fitted_pose(camera: &CalibratedCamera, (width, height): (u32, u32)) -> CalibratedCamera {
    let [w, h] = [camera.width.max(1), camera.height.max(1)].map(f64::from);
    let scale = (f64::from(width) / w).min(f64::from(height) / h);
    let margin = [
        (f64::from(width) - scale * w) / 2.0,
        (f64::from(height) - scale * h) / 2.0,
    ];
    CalibratedCamera {
        width,
        height,
        focal: camera.focal.map(|f| f * scale),
        principal: [0, 1].map(|i| camera.principal[i] * scale + margin[i]),
        ..camera.pinhole()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::projective::lens::CameraLens;
    use glam::{DMat3, DVec2};

    #[test]
    fn a_pose_shows_the_whole_photograph_in_the_middle() {
        let camera = CalibratedCamera {
            width: 400,
            height: 200,
            focal: [300.0, 310.0],
            principal: [190.0, 105.0],
            lens: CameraLens::default(),
            rotation: DMat3::from_rotation_y(0.3),
            center: DVec3::new(1.0, 2.0, 3.0),
        };
        let fitted = fitted_pose(&camera, (100, 100));
        let corner = camera.center
            + 5.0
                * camera
                    .direction(DVec2::new(400.0, 200.0))
                    .unwrap_or_default();
        let Some(pixel) = fitted.project(corner) else {
            panic!("it lies ahead");
        };
        // 100 x 50 pixels in the middle of 100 x 100.
        assert!((pixel - DVec2::new(100.0, 75.0)).length() < 1e-9, "{pixel}");
    }
}
