//! Photographs of a scene on threads of their own: thumbnails with depth maps first, whole photographs as they are wanted.
//!
//! Some threads ready all photographs, those nearest to the eye first. Others decode whole ones: what is wanted is a list that
//! is replaced from view to view, so that nobody waits for what is wanted no more.

use crate::photos::error::PhotoError;
use crate::photos::formats::read_scene;
use crate::photos::gains::exposure_gains;
use crate::photos::library::{load_photo, load_thumbnail};
use crate::photos::prepared::PreparedPhoto;
use crate::photos::pyramid::PhotoPyramid;
use crate::photos::scene::PhotoScene;
use crate::photos::stage::{StageModel, StagedPhoto};
use crate::photos::surface::SurfaceDrawer;
use crate::render::engine::Backend;
use crate::tree::Model;
use glam::{DVec3, Vec3};
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Threads that decode whole photographs.
const DECODERS: usize = 2;

/// Threads that ready photographs.
const READIERS: usize = 2;

/// Something that was loaded.
#[derive(Debug)]
pub enum PhotoArrival {
    /// The scene, with what it is put on.
    Scene(Arc<PhotoScene>, StageModel),
    /// A photograph with a thumbnail.
    Ready(usize, StagedPhoto),
    /// All photographs have been looked at: gains of those that are there, by their index in the scene.
    AllReady(Vec<(usize, Vec3)>),
    /// The pixels of a whole photograph.
    Whole(usize, Arc<PhotoPyramid>),
    /// A photograph that cannot be used, with a sentence.
    Unusable(usize, String),
    /// Nothing of the scene can be used, with a sentence.
    Failed(String),
}

/// Whole photographs that are wanted.
#[derive(Debug, Default)]
struct WantedPhotos {
    queue: VecDeque<usize>,
    is_cancelled: bool,
}

/// Photographs that nobody readies yet.
#[derive(Debug, Default)]
struct UnreadyPhotos {
    indices: Vec<usize>,
    /// Eye of who looks, world space.
    eye: Option<DVec3>,
}

/// What the threads share.
#[derive(Debug, Default)]
struct LoaderShare {
    wanted: Mutex<WantedPhotos>,
    changed: Condvar,
    unready: Mutex<UnreadyPhotos>,
}

impl LoaderShare {
    fn lock(&self) -> MutexGuard<'_, WantedPhotos> {
        self.wanted.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_cancelled(&self) -> bool {
        self.lock().is_cancelled
    }

    fn lock_unready(&self) -> MutexGuard<'_, UnreadyPhotos> {
        self.unready.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The photograph to ready next: the nearest to the eye, else the first; `None` after the last.
    fn next_unready(&self, scene: &PhotoScene) -> Option<usize> {
        let mut unready = self.lock_unready();
        let eye = unready.eye;
        let away = |index: &usize| match eye {
            Some(eye) => scene.photos[*index].camera.center.distance_squared(eye),
            None => 0.0,
        };
        let all = unready.indices.iter().enumerate();
        let (at, _) = all.min_by(|a, b| away(a.1).total_cmp(&away(b.1)))?;
        Some(unready.indices.remove(at))
    }

    /// The next that is wanted, waited for; `None` once cancelled.
    fn next(&self) -> Option<usize> {
        let mut wanted = self.lock();
        loop {
            if wanted.is_cancelled {
                return None;
            }
            if let Some(index) = wanted.queue.pop_front() {
                return Some(index);
            }
            wanted = (self.changed.wait(wanted)).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// A scene to load.
#[derive(Debug, Clone)]
pub struct PhotoRequest {
    /// File or folder of the scene.
    pub path: PathBuf,
    /// Folder of the photographs, where they are not beside it.
    pub folder: Option<PathBuf>,
    /// The model that they are put on.
    pub model: Arc<Model>,
    /// Longest side of photographs in memory, pixels.
    pub longest_side: u32,
    /// Eye at first, world space.
    pub eye: Option<DVec3>,
}

/// Loads the photographs of one scene. Dropping it ends its threads once they have finished what they do.
#[derive(Debug)]
pub struct PhotoLoader {
    share: Arc<LoaderShare>,
    arrivals: Receiver<PhotoArrival>,
    is_over: bool,
}

impl PhotoLoader {
    /// Starts to load.
    ///
    /// # Errors
    /// When the system has no thread left.
    pub fn start(request: PhotoRequest) -> std::io::Result<Self> {
        let share = Arc::new(LoaderShare::default());
        share.lock_unready().eye = request.eye;
        let (sender, arrivals) = channel();
        let of_thread = share.clone();
        std::thread::Builder::new()
            .name("photographs".into())
            .spawn(move || load(&request, &of_thread, &sender))?;
        Ok(Self {
            share,
            arrivals,
            is_over: false,
        })
    }

    /// Asks for whole photographs, the most wanted first; those that were asked for before and are not in the list are
    /// forgotten, unless they are being decoded.
    pub fn want(&self, indices: impl IntoIterator<Item = usize>) {
        let mut wanted = self.share.lock();
        wanted.queue = indices.into_iter().collect();
        drop(wanted);
        self.share.changed.notify_all();
    }

    /// Notes where somebody looks from, world space: photographs nearby come first.
    pub fn look_from(&self, eye: DVec3) {
        self.share.lock_unready().eye = Some(eye);
    }

    /// What has come next; waits for it where `waits`. `None` where nothing has, or nothing will any more.
    pub fn poll(&mut self, waits: bool) -> Option<PhotoArrival> {
        if self.is_over {
            return None;
        }
        let arrival = match waits {
            true => self.arrivals.recv().map_err(|_| TryRecvError::Disconnected),
            false => self.arrivals.try_recv(),
        };
        match arrival {
            Ok(arrival) => Some(arrival),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                self.is_over = true;
                Some(PhotoArrival::Failed(
                    "loading photographs stopped unexpectedly".into(),
                ))
            }
        }
    }
}

impl Drop for PhotoLoader {
    fn drop(&mut self) {
        self.share.lock().is_cancelled = true;
        self.share.changed.notify_all();
    }
}

/// Readies the photographs of a scene, and then decodes what is wanted. Nobody may be listening any more.
fn load(request: &PhotoRequest, share: &Arc<LoaderShare>, sender: &Sender<PhotoArrival>) {
    let scene = match read_scene(&request.path, request.folder.as_deref()) {
        Ok(scene) => Arc::new(scene),
        Err(error) => {
            let _ = sender.send(PhotoArrival::Failed(error.to_string()));
            return;
        }
    };
    let model = StageModel::of(&request.model);
    let _ = sender.send(PhotoArrival::Scene(scene.clone(), model));
    for _ in 0..DECODERS {
        let (share, sender, scene) = (share.clone(), sender.clone(), scene.clone());
        let longest_side = request.longest_side;
        let decode = move || decode_wanted(&scene, longest_side, &share, &sender);
        if let Err(error) = std::thread::Builder::new()
            .name("decoder".into())
            .spawn(decode)
        {
            tracing::warn!("photographs stay small: {error}");
        }
    }
    share.lock_unready().indices = (0..scene.photos.len()).collect();
    let all = || ready_all(&scene, request, share, sender);
    let mut there = std::thread::scope(|scope| {
        let others: Vec<_> = (1..READIERS)
            .filter_map(|_| {
                let builder = std::thread::Builder::new().name("photographs".into());
                builder.spawn_scoped(scope, all).ok()
            })
            .collect();
        let mut there = all();
        // One that panicked leaves out what it had.
        there.extend(
            others
                .into_iter()
                .filter_map(|own| own.join().ok())
                .flatten(),
        );
        there
    });
    if share.is_cancelled() {
        return;
    }
    there.sort_unstable_by_key(|(index, _)| *index);
    let colors: Vec<&[_]> = there.iter().map(|(_, own)| own.colors.as_slice()).collect();
    let gains = exposure_gains(&colors);
    let indices = there.iter().map(|(index, _)| *index);
    let _ = sender.send(PhotoArrival::AllReady(indices.zip(gains).collect()));
}

/// Readies photographs as long as there are any, and gives those that can be used.
fn ready_all(
    scene: &PhotoScene,
    request: &PhotoRequest,
    share: &LoaderShare,
    sender: &Sender<PhotoArrival>,
) -> Vec<(usize, Arc<PreparedPhoto>)> {
    let drawer = SurfaceDrawer::new(&Backend::Cpu, &request.model);
    let mut there = Vec::new();
    while let (false, Some(index)) = (share.is_cancelled(), share.next_unready(scene)) {
        let arrival = match ready(scene, index, &drawer, request.longest_side) {
            Ok(Some(photo)) => {
                there.push((index, photo.prepared.clone()));
                PhotoArrival::Ready(index, photo)
            }
            Ok(None) => continue,
            Err(error) => PhotoArrival::Unusable(index, error.to_string()),
        };
        let _ = sender.send(arrival);
    }
    there
}

fn ready(
    scene: &PhotoScene,
    index: usize,
    drawer: &SurfaceDrawer<'_>,
    longest_side: u32,
) -> Result<Option<StagedPhoto>, PhotoError> {
    let photo = &scene.photos[index];
    if photo.file.is_none() {
        return Ok(None);
    }
    let pixels = Arc::new(load_thumbnail(photo)?);
    let prepared = PreparedPhoto::new(index, photo, drawer, &pixels, longest_side)?;
    Ok(Some(StagedPhoto::of_thumbnail(prepared, pixels)))
}

fn decode_wanted(
    scene: &PhotoScene,
    longest_side: u32,
    share: &LoaderShare,
    sender: &Sender<PhotoArrival>,
) {
    while let Some(index) = share.next() {
        let Some(photo) = scene.photos.get(index) else {
            continue;
        };
        let arrival = match load_photo(photo, longest_side) {
            Ok(pixels) => PhotoArrival::Whole(index, Arc::new(pixels)),
            Err(error) => PhotoArrival::Unusable(index, error.to_string()),
        };
        if sender.send(arrival).is_err() {
            return;
        }
    }
}
