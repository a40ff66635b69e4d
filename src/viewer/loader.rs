//! Loads models on a thread of its own, and copies them to the device there, so that the window answers meanwhile.
//! Of a large one a coarse preview comes first, as soon as its mesh is known.

use super::kept_models::{PartWish, WholeModel, make};
use super::load_progress::SharedProgress;
use super::loaded_model::{LoadError, LoadedModel, ModelRequest, system_of};
use super::preview;
use super::text::unopened;
use crate::gpu::{self, Gpu, lock};
use crate::input::ColorSetting;
use crate::mesh::Mesh;
use crate::mesh::placement::MeshPlacement;
use crate::open::{OpenOptions, PageReading, open_with_preview};
use crate::progress::Progress;
use crate::render::model_facts::{DrawnParts, facted};
use crate::render::paged_model::{PagedModel, PagedModelOptions};
use crate::render::vulkan::scene::DeviceScene;
use crate::tree::Model;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Opens what a path names, [`open_with_preview`] but for tests; may hand over a coarse model of the same sphere before.
type OpenFunction = dyn Fn(&ModelRequest, &dyn Progress, &mut dyn FnMut(Model)) -> Result<LoadedModel, LoadError>
    + Send
    + Sync;

/// Where models are copied to, and with the indices of all triangles or without; none before a device is open.
type LoaderDevice = Arc<Mutex<Option<(Arc<Gpu>, bool)>>>;

/// Takes what a job has found.
type JobSender = Sender<Result<LoadedModel, LoadError>>;

struct LoadJob {
    path: PathBuf,
    shared: Arc<SharedProgress>,
    results: Receiver<Result<LoadedModel, LoadError>>,
    thread: JoinHandle<()>,
}

impl Drop for LoadJob {
    fn drop(&mut self) {
        self.shared.cancel();
    }
}

/// Loads one model at a time.
pub struct ModelLoader {
    open: Arc<OpenFunction>,
    device: LoaderDevice,
    /// Models that stand elsewhere or have another color, by their place in the list.
    placed: Vec<(PathBuf, MeshPlacement)>,
    crease_degrees: Option<f32>,
    /// Quantity that colors points.
    color: Option<ColorSetting>,
    /// A sample of the points may be shown while they are read: it looks as they will.
    is_sampled: bool,
    page_reading: PageReading,
    job: Option<LoadJob>,
}

impl std::fmt::Debug for ModelLoader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Loader")
            .field("path", &self.job.as_ref().map(|j| &j.path))
            .finish_non_exhaustive()
    }
}

/// How long closing the window waits for a cancelled job to clean up.
const FAREWELL: Duration = Duration::from_secs(2);

impl ModelLoader {
    /// A loader without a job. `placed` are the models, in their order, that do not stand where their files say, or have
    /// another color.
    pub fn new(
        options: OpenOptions,
        paged: PagedModelOptions,
        placed: Vec<(PathBuf, MeshPlacement)>,
    ) -> Self {
        let crease_degrees = options.tree.crease_degrees;
        let color = options.input.color.clone();
        let is_sampled = options.keep.is_empty() && options.input.color.is_none();
        let open = move |request: &ModelRequest,
                         progress: &dyn Progress,
                         on_preview: &mut dyn FnMut(Model)| {
            let mut options = options.clone();
            options.placement = request.placement;
            options.page_reading = request.page_reading;
            options.tree.crease_degrees = request.crease_degrees;
            options.input.color = options.input.color.filter(|_| request.is_first);
            let mut on_mesh = |mesh: &Mesh| {
                // It would show what is not kept.
                if options.keep.is_empty()
                    && let Some(model) = preview::model(mesh, progress)
                {
                    on_preview(model);
                }
            };
            let opened = open_with_preview(&request.path, &options, progress, &mut on_mesh)?;
            let pages = opened.paged.map(|file| PagedModel::open(file, paged));
            let pages = pages.transpose().map_err(crate::tree::Error::from);
            Ok(LoadedModel {
                model: Arc::new(opened.model),
                pages: pages.map_err(crate::Error::from)?,
                up: opened.up.axis,
                warnings: opened.warnings,
                coordinate_system: system_of(&opened.parts),
                attributes: Arc::new(opened.attributes),
                ..LoadedModel::default()
            })
        };
        Self {
            placed,
            crease_degrees,
            color,
            is_sampled,
            ..Self::of_function(Arc::new(open))
        }
    }

    fn of_function(open: Arc<OpenFunction>) -> Self {
        Self {
            open,
            device: LoaderDevice::default(),
            placed: Vec::new(),
            crease_degrees: None,
            color: None,
            is_sampled: false,
            page_reading: PageReading::ByPage,
            job: None,
        }
    }

    /// Reads so much of paged files from now on.
    pub fn read_pages(&mut self, page_reading: PageReading) {
        self.page_reading = page_reading;
    }

    /// Where models are copied to from now on, and whether with the indices of all triangles.
    pub fn copy_to(&mut self, gpu: &Arc<Gpu>, with_indices: bool) {
        *lock(&self.device) = Some((gpu.clone(), with_indices));
    }

    /// Opens models with another crease angle from now on; none keeps the normals of their files.
    pub fn set_crease(&mut self, degrees: Option<f32>) {
        self.crease_degrees = degrees;
    }

    /// How a model is opened: the first has index 0, those that are drawn with it have the next ones.
    fn request(&self, index: usize, path: &Path) -> ModelRequest {
        let placed = self.placed.get(index).filter(|(own, _)| own == path);
        ModelRequest {
            path: path.to_owned(),
            placement: placed.map_or_else(MeshPlacement::default, |(_, placement)| *placement),
            crease_degrees: self.crease_degrees,
            is_first: index == 0,
            page_reading: self.page_reading,
        }
    }

    /// Starts to load `path`; a job that still runs is cancelled and forgotten.
    ///
    /// # Errors
    /// When the system has no thread left.
    pub fn start(&mut self, path: &Path) -> std::io::Result<()> {
        self.start_all(path, &[])
    }

    /// Starts to load `path` and more models to be drawn with it; a job that still runs is cancelled and forgotten. Those of
    /// `more` that cannot be opened are told in [`LoadedModel::failures`].
    ///
    /// # Errors
    /// When the system has no thread left.
    pub fn start_all(&mut self, path: &Path, more: &[PathBuf]) -> std::io::Result<()> {
        let (open, target) = (self.open.clone(), self.request(0, path));
        let more = more.iter().enumerate();
        let more: Vec<ModelRequest> = more.map(|(i, path)| self.request(i + 1, path)).collect();
        let (device, color) = (self.device.clone(), self.color.clone());
        let is_sampled = self.is_sampled && target.placement.is_identity();
        self.begin(path, move |progress, sender| {
            let mut on_preview = |model| send_preview(&device, &sender, model, false);
            if is_sampled {
                let (device, sender) = (device.clone(), sender.clone());
                progress.give_sample_to(Some(Box::new(move |mesh| {
                    if let Some(model) = preview::of_sample(mesh) {
                        send_preview(&device, &sender, model, true);
                    }
                })));
            }
            let opened = open(&target, progress.as_ref(), &mut on_preview);
            progress.give_sample_to(None);
            let result = opened.and_then(|mut loaded| {
                let mut others = Vec::with_capacity(more.len());
                for request in more {
                    match open(&request, progress.as_ref(), &mut |_| ()) {
                        Ok(other) => others.push((request, other)),
                        Err(error) => {
                            (loaded.failures).push(unopened(&request.path, &error.to_string()))
                        }
                    }
                }
                if let Some(setting) = color.filter(|_| !others.is_empty()) {
                    loaded.share_colors((&target, &mut others), &setting);
                }
                for (request, other) in others {
                    loaded.add(request.path, other, progress.as_ref());
                }
                progress.stage("copying to the device", 0);
                Ok(copied(&device, loaded)?)
            });
            let _ = sender.send(result);
        })
    }

    /// Starts to make the parts of models that a wish names, as [`make`] does; a job that still runs is forgotten.
    ///
    /// # Errors
    /// When the system has no thread left.
    pub fn start_keeping(
        &mut self,
        path: &Path,
        wholes: Vec<WholeModel>,
        wish: PartWish,
    ) -> std::io::Result<()> {
        let device = self.device.clone();
        self.begin(path, move |progress, sender| {
            let parts = make(&wholes, &wish, progress.as_ref()).map_err(LoadError::from);
            let _ = sender.send(parts.and_then(|parts| {
                progress.stage("copying to the device", 0);
                Ok(copied(&device, LoadedModel::of_parts(parts))?)
            }));
        })
    }

    /// Starts a thread for a job.
    fn begin(
        &mut self,
        path: &Path,
        work: impl FnOnce(Arc<SharedProgress>, JobSender) + Send + 'static,
    ) -> std::io::Result<()> {
        self.job = None;
        let shared = Arc::new(SharedProgress::default());
        let (sender, results) = channel();
        let progress = shared.clone();
        let thread = std::thread::Builder::new()
            .name("loader".into())
            .spawn(move || work(progress, sender))?;
        self.job = Some(LoadJob {
            path: path.to_owned(),
            shared,
            results,
            thread,
        });
        Ok(())
    }

    /// The path that is being loaded.
    pub fn path(&self) -> Option<&Path> {
        self.job.as_ref().map(|job| job.path.as_path())
    }

    /// How far the job is, such as `building nodes 43%`.
    pub fn status(&self) -> Option<String> {
        Some(self.job.as_ref()?.shared.words())
    }

    /// What has come since the last call: a preview, or the result of a job that has ended.
    pub fn poll(&mut self) -> Option<(PathBuf, Result<LoadedModel, LoadError>)> {
        let job = self.job.as_ref()?;
        let result = match job.results.try_recv() {
            Err(TryRecvError::Empty) => return None,
            Ok(result) => result,
            Err(TryRecvError::Disconnected) => Err(LoadError::Stopped),
        };
        let path = job.path.clone();
        if !matches!(&result, Ok(loaded) if loaded.is_preview) {
            self.job = None;
        }
        Some((path, result))
    }

    /// Cancels the job and gives it a moment to clean up. Work that does not ask whether it was cancelled goes
    /// on until the process ends; it holds nothing but memory.
    pub fn stop(&mut self) {
        // Whoever copies still holds the device; nobody begins to.
        *lock(&self.device) = None;
        let Some(job) = self.job.take() else { return };
        job.shared.cancel();
        let start = Instant::now();
        while !job.thread.is_finished() && start.elapsed() < FAREWELL {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

/// Sends a coarse model ahead. Nobody listens any more when the job was cancelled.
fn send_preview(device: &LoaderDevice, sender: &JobSender, model: Model, is_sample: bool) {
    let preview = LoadedModel {
        model: Arc::new(model),
        is_preview: true,
        is_sample,
        ..LoadedModel::default()
    };
    if let Ok(preview) = copied(device, preview) {
        let _ = sender.send(Ok(preview));
    }
}

/// Copies what was loaded to the device that is open, if one is.
fn copied(device: &LoaderDevice, mut loaded: LoadedModel) -> Result<LoadedModel, gpu::Error> {
    let device = lock(device).clone();
    if let Some((gpu, with_indices)) = device {
        let mut models: Vec<&Model> = vec![&loaded.model];
        models.extend(loaded.more.iter().map(|part| &*part.model));
        let mut scene = DeviceScene::of_models(&gpu, &models)?;
        if with_indices && !loaded.is_preview {
            let shown = scene.shown(&models);
            scene.ensure_indices(DrawnParts::new(&facted(&shown)))?;
        }
        loaded.scene = Some(scene);
    }
    Ok(loaded)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use crate::input;

    fn of_model(model: Model) -> LoadedModel {
        LoadedModel {
            model: Arc::new(model),
            ..LoadedModel::default()
        }
    }

    fn wait(loader: &mut ModelLoader) -> (PathBuf, Result<LoadedModel, LoadError>) {
        loop {
            if let Some(result) = loader.poll() {
                return result;
            }
            std::thread::yield_now();
        }
    }

    #[test]
    fn a_job_tells_its_progress_and_its_result() {
        let (go, gate) = channel::<()>();
        let (told, at_stage) = channel::<()>();
        let (gate, told) = (Mutex::new(gate), Mutex::new(told));
        let mut loader = ModelLoader::of_function(Arc::new(move |request, progress, _| {
            assert_eq!(request.path, Path::new("scan.ply"));
            progress.stage("building nodes", 200);
            progress.advance(86);
            told.lock().unwrap().send(()).unwrap();
            gate.lock().unwrap().recv().unwrap();
            Ok(LoadedModel::default())
        }));
        assert!(loader.poll().is_none() && loader.status().is_none());
        loader.start(Path::new("scan.ply")).unwrap();
        at_stage.recv().unwrap();
        assert_eq!(loader.status().unwrap(), "building nodes 43%");
        assert_eq!(loader.path(), Some(Path::new("scan.ply")));
        assert!(loader.poll().is_none());
        go.send(()).unwrap();
        let (path, result) = wait(&mut loader);
        assert_eq!(path, Path::new("scan.ply"));
        assert!(result.is_ok() && loader.path().is_none());
    }

    #[test]
    fn a_new_job_cancels_the_old_one_and_errors_come_through() {
        let (saw, cancelled) = channel::<()>();
        let saw = Mutex::new(saw);
        let mut loader = ModelLoader::of_function(Arc::new(move |request, progress, _| {
            if request.path == Path::new("slow") {
                while !progress.is_cancelled() {
                    std::thread::yield_now();
                }
                saw.lock().unwrap().send(()).unwrap();
                return Err(crate::Error::from(input::Error::Cancelled).into());
            }
            let path = request.path.clone();
            Err(crate::Error::from(input::Error::UnknownFormat { path }).into())
        }));
        loader.start(Path::new("slow")).unwrap();
        loader.start(Path::new("broken")).unwrap();
        cancelled.recv().unwrap();
        let (path, result) = wait(&mut loader);
        assert_eq!(path, Path::new("broken"));
        assert!(matches!(
            result,
            Err(LoadError::Open(crate::Error::Input(input::Error::UnknownFormat { path })))
                if path == Path::new("broken")
        ));
        loader.start(Path::new("slow")).unwrap();
        loader.stop();
        cancelled.recv().unwrap();
    }

    #[test]
    fn a_preview_comes_before_the_model_and_the_job_goes_on() {
        let (go, gate) = channel::<()>();
        let gate = Mutex::new(gate);
        let mut loader = ModelLoader::of_function(Arc::new(move |_, _, preview| {
            preview(Model {
                used_vertices: 1,
                ..Model::default()
            });
            gate.lock().unwrap().recv().unwrap();
            Ok(of_model(Model {
                used_vertices: 2,
                ..Model::default()
            }))
        }));
        loader.start(Path::new("scan.ply")).unwrap();
        let first = wait(&mut loader).1.unwrap();
        assert!(first.is_preview && first.model.used_vertices == 1);
        assert!(first.scene.is_none(), "no device is open");
        assert!(loader.path().is_some() && loader.poll().is_none());
        go.send(()).unwrap();
        let second = wait(&mut loader).1.unwrap();
        assert!(!second.is_preview && second.model.used_vertices == 2);
        assert!(loader.path().is_none() && loader.poll().is_none());
    }

    #[test]
    fn placements_go_by_place_and_name_and_normals_are_those_of_now() {
        let moved = MeshPlacement {
            color: Some([1, 2, 3]),
            ..MeshPlacement::default()
        };
        let placed = ["a", "a", "b"].map(PathBuf::from).into_iter();
        let placed = placed
            .zip([MeshPlacement::default(), moved, moved])
            .collect();
        let seen = Arc::new(Mutex::new(Vec::new()));
        let noted = seen.clone();
        let open = move |request: &ModelRequest, _: &dyn Progress, _: &mut dyn FnMut(Model)| {
            noted.lock().unwrap().push(request.clone());
            Ok(LoadedModel::default())
        };
        let mut loader = ModelLoader {
            placed,
            ..ModelLoader::of_function(Arc::new(open))
        };
        loader.set_crease(Some(0.0));
        let more = ["a", "c"].map(PathBuf::from);
        loader.start_all(Path::new("a"), &more).unwrap();
        wait(&mut loader).1.unwrap();
        let seen = seen.lock().unwrap();
        let placements: Vec<bool> = seen.iter().map(|own| own.placement == moved).collect();
        assert_eq!(placements, [false, true, false]);
        assert!(seen.iter().all(|own| own.crease_degrees == Some(0.0)));
    }

    #[test]
    fn a_panic_while_loading_is_an_error_not_the_end() {
        let mut loader = ModelLoader::of_function(Arc::new(|_, _, _| panic!("on purpose")));
        loader.start(Path::new("bad")).unwrap();
        assert!(matches!(wait(&mut loader).1, Err(LoadError::Stopped)));
    }
}
