//! `--photos` and what goes with it.

use super::progress::JobBar;
use super::{CommandFailure, say, usage};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use surfel::OpenedModel;
use surfel::math::camera::{Camera, View};
use surfel::open::UpGuess;
use surfel::open::photo_scene::{has_photographs, without_photographs};
use surfel::photos::formats::read_scene;
use surfel::photos::look::LookSettings;
use surfel::photos::scene::PhotoScene;
use surfel::photos::stage::PhotoStage;
use surfel::photos::surface::{SurfaceDrawer, renderer_camera};
use surfel::projective::frame_photos::FramePhotos;
use surfel::render::engine::Backend;
use surfel::render::{AmbientOcclusion, EyeDome, PhotoDisplay, Settings};

/// Longest side of a picture from the pose of a photograph, pixels.
const POSE_SIDE: f64 = 1000.0;

/// Longest side of photographs in memory, pixels.
const LONGEST_SIDE: u32 = 4096;

/// Photographs on the model.
#[derive(Debug, Clone, Default, clap::Args)]
pub(crate) struct PhotoArgs {
    /// Put the photographs of a scene on the model, chosen for the view (formats: see surfel photos)
    #[arg(long, value_name = "SCENE")]
    pub(crate) photos: Option<PathBuf>,
    /// Folder of the photographs, where they are not beside the scene
    #[arg(long, value_name = "FOLDER", requires = "photos")]
    pub(crate) photo_folder: Option<PathBuf>,
    /// Photographs that a picture uses at most [default: 16]
    #[arg(long, value_name = "N", requires = "photos", value_parser = clap::value_parser!(u32).range(1..=64))]
    pub(crate) most_photos: Option<u32>,
    /// Show which photograph is the best at each pixel, as a color
    #[arg(long, requires = "photos")]
    pub(crate) color_by_photo: bool,
    /// Mark surface that no photograph shows; else it keeps its shaded color
    #[arg(long, requires = "photos")]
    pub(crate) mark_uncovered: bool,
}

impl PhotoArgs {
    /// Photographs that a picture uses at most.
    pub(crate) fn most(&self) -> usize {
        self.most_photos.unwrap_or(16) as usize
    }

    /// Puts the photographs of a scene on its own points, where the model is one, unless others are named.
    pub(crate) fn take_own_of(&mut self, model: &Path) {
        if self.photos.is_some() {
            return;
        }
        match has_photographs(model, self.photo_folder.as_deref()) {
            None => {}
            Some(true) => self.photos = Some(model.to_owned()),
            Some(false) => say(&format!(
                "surfel: {} (--photos {} --photo-folder FOLDER)",
                without_photographs(model),
                model.display()
            )),
        }
    }

    /// Settings that show what is asked for on a model; where it is drawn alone and is a scene, its own photographs.
    pub(crate) fn shown_on(&mut self, model: &Path, alone: bool, settings: Settings) -> Settings {
        if alone && may_show_photos(&settings) {
            self.take_own_of(model);
        }
        self.shown(settings)
    }

    /// Settings that show what is asked for.
    pub(crate) fn shown(&self, settings: Settings) -> Settings {
        Settings {
            photos: match (&self.photos, self.color_by_photo) {
                (None, _) => PhotoDisplay::Off,
                (Some(_), false) => PhotoDisplay::Color,
                (Some(_), true) => PhotoDisplay::Source,
            },
            marks_uncovered: self.mark_uncovered,
            ..settings
        }
    }

    /// Reads the scene that is asked for.
    pub(crate) fn read(&self) -> Result<Option<PhotoScene>, CommandFailure> {
        let Some(path) = &self.photos else {
            return Ok(None);
        };
        let scene = read_scene(path, self.photo_folder.as_deref())?;
        for remark in &scene.remarks {
            say(&format!("surfel: {}: {remark}", path.display()));
        }
        Ok(Some(scene))
    }
}

/// Tells whether settings leave room for photographs that nobody named: data, lights and backgrounds of two colors do not.
fn may_show_photos(settings: &Settings) -> bool {
    !settings.color_by.is_data()
        && settings.eye_dome != EyeDome::On
        && settings.ambient_occlusion != AmbientOcclusion::On
        && settings.background_bottom.is_none()
}

/// Guess of what is up: that of the photographs, where there are any and they have it in common, else the model's.
pub(crate) fn up_guess(scene: Option<&PhotoScene>, of_model: UpGuess) -> UpGuess {
    let reason = "the photographs have it so";
    let up = scene.and_then(PhotoScene::up);
    up.map_or(of_model, |axis| UpGuess { axis, reason })
}

/// The camera of a photograph, by its name or number, with near and far planes around a model; as long as a size that is asked
/// for, else at most [`POSE_SIDE`] pixels.
pub(crate) fn camera_of(
    scene: &PhotoScene,
    wanted: &str,
    opened: &OpenedModel,
    size: Option<(u32, u32)>,
) -> Result<Camera, CommandFailure> {
    let Some(index) = scene.find(wanted) else {
        return Err(usage(format!(
            "{}: there is no photograph {wanted}; surfel info lists {} of them, numbered from 0",
            scene.path.display(),
            scene.photos.len()
        )));
    };
    let camera = scene.photos[index].camera.pinhole();
    let longest = f64::from(camera.width.max(camera.height).max(1));
    let scale = match size {
        Some((width, height)) => f64::from(width.max(height)) / longest,
        None => (POSE_SIDE / longest).min(1.0),
    };
    let side = |pixels: u32| (f64::from(pixels) * scale).round().max(1.0) as u32;
    let scaled = camera.scaled(side(camera.width), side(camera.height));
    renderer_camera(&scaled, &opened.model).ok_or_else(|| {
        usage(format!(
            "{}: all of the model is behind this photograph",
            scene.photos[index].name
        ))
    })
}

/// The photographs of a scene on a model, for any view.
pub(crate) struct StagedScene {
    scene: PhotoScene,
    stage: PhotoStage,
    last: Vec<usize>,
}

impl StagedScene {
    /// Readies the photographs of a scene for a model.
    pub(crate) fn new(
        scene: PhotoScene,
        opened: &OpenedModel,
        backend: &Backend,
        most: usize,
        quiet: bool,
    ) -> Result<Self, CommandFailure> {
        let drawer = SurfaceDrawer::new(backend, &opened.model);
        let bar = JobBar::new(quiet);
        let (stage, remarks) = PhotoStage::load(&scene, &drawer, most, LONGEST_SIDE, &bar)?;
        for remark in remarks {
            say(&format!("surfel: warning: {remark}"));
        }
        Ok(Self {
            scene,
            stage,
            last: Vec::new(),
        })
    }

    /// Photographs that are chosen for a view, decoded whole.
    pub(crate) fn frame(&mut self, view: &View) -> Arc<FramePhotos> {
        self.timed_frame(view).0
    }

    /// Photographs as [`frame`](Self::frame) gives them, and how long choosing them took, milliseconds.
    pub(crate) fn timed_frame(&mut self, view: &View) -> (Arc<FramePhotos>, f64) {
        let settings = LookSettings::default();
        let chosen = self.stage.frame(view, &settings, &|_| true, &self.last);
        for remark in (self.stage).load_whole(&self.scene, &chosen, LONGEST_SIDE) {
            say(&format!("surfel: warning: {remark}"));
        }
        let start = Instant::now();
        let frame = self.stage.frame(view, &settings, &|_| true, &self.last);
        let ms = start.elapsed().as_secs_f64() * 1e3;
        self.last = (frame.photos.iter())
            .map(|own| own.photo.index as usize)
            .collect();
        (Arc::new(frame), ms)
    }
}
