//! What the window does, without the window: events in, frames out. Given the same events in the same steps, the
//! same pictures.

mod awaited_picture;
mod commands;
mod draw;
mod events;
mod kept;
mod light;
mod measuring;
mod photographs;
mod poses;
mod section;
mod show;

use super::camera::OrbitCamera;
use super::choices::SurfaceNormals;
use super::control::{FrameBudget, FrameGoal};
use super::event::KeyboardKey;
use super::graph::TimeHistory;
use super::input::MouseState;
use super::kept_models::WholeModel;
use super::loaded_model::{LoadError, LoadedModel};
use super::measuring::MeasureTool;
use super::notice::{NoticeList, NoticeWeight};
use super::pace::PacedFrame;
use super::panel::PanelFacts;
use super::recent::RecentFiles;
use super::screen::WindowScreen;
use super::ui::PanelInterface;
use super::{RunFigures, ViewerError, ViewerOptions, text};
use crate::gpu::messages::LayerMessages;
use crate::image::MarkChoice;
use crate::input::legend_of;
use crate::math::camera::{Camera, HeadlightSource};
use crate::math::section_box::SectionBox;
use crate::math::up_axis::UpAxis;
use crate::mesh::attributes::PointAttributes;
use crate::mesh::color_legend::ColorLegend;
use crate::pack::{Phong, SurfaceLighting};
use crate::render::{Settings, SplatKind};
use crate::tree::{Model, OrbitSphere};
use awaited_picture::AwaitedPicture;
use commands::TurntableRun;
use glam::{DVec2, DVec3};
use kept::KeptParts;
use photographs::ModelPhotographs;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What the app asks of the window around it.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum FileAsk {
    /// Load a model, and more that are shown with it.
    Open {
        /// The first.
        path: PathBuf,
        /// The others.
        more: Vec<PathBuf>,
    },
    /// Put a text into the clipboard.
    Copy(String),
    /// Make the parts of the models that are kept.
    Keep,
    /// Read the clipboard, and hand it over as [`super::event::ViewerEvent::Paste`].
    Paste,
    /// Switch full screen.
    FullScreen,
    /// Keep the cursor inside, invisible, or let it go.
    HoldCursor(bool),
}

/// After how long without motion the camera rests, seconds.
const REST_S: f64 = 0.15;
/// Radii of the model flown in a second at first.
const FLY_SPEED: f64 = 0.5;
/// How often in a row the device may be lost without a frame between.
const MOST_LOSSES: u32 = 3;
/// Longest time that one step flies, seconds: after a pause nobody is thrown out of the model.
const LONGEST_TICK_S: f64 = 0.2;

/// Flying: how fast, in radii of the model a second.
#[derive(Debug, Clone, Copy)]
struct CameraFlight {
    speed: f64,
    last_at: Option<DVec2>,
}

/// The state of the viewer.
pub(super) struct ViewerApp {
    pub(super) screen: WindowScreen,
    pub(super) options: ViewerOptions,
    interface: PanelInterface,
    orbit: Option<OrbitCamera>,
    /// A camera as it was given, until it is moved.
    fixed: Option<Camera>,
    /// The headlight of the camera.
    light: HeadlightSource,
    /// The lamp as it was left, on or off.
    lamp: Phong,
    pub(super) settings: Settings,
    /// Splat that the program chose last; another one was chosen by a person.
    splat_of_model: SplatKind,
    /// Settings that a frame was drawn with.
    good: Option<Settings>,
    control: Option<FrameBudget>,
    /// Frames of a moving camera, where a time is wanted.
    paced: Vec<PacedFrame>,
    mouse: MouseState,
    /// Distance of what the drag that goes on has hold of.
    drag_distance: f64,
    /// Where the drag began.
    drag_at: DVec2,
    /// Steps of the wheel since the last frame.
    wheel: f64,
    fly: Option<CameraFlight>,
    held_keys: BTreeSet<KeyboardKey>,
    is_fast: bool,
    notices: NoticeList,
    history: TimeHistory,
    facts: Option<PanelFacts>,
    /// Ends of the section in the coordinates of the file.
    section: Option<[DVec3; 2]>,
    /// Names of the models, the first one first.
    part_names: Vec<String>,
    /// What could not be opened of those that were to be shown together.
    failures: Vec<String>,
    /// Where the model came from.
    path: PathBuf,
    /// What is shown is a coarse preview of it.
    is_preview: bool,
    /// The files that are shown were asked for again.
    is_reloading: bool,
    /// Paged files are read whole: something was asked for that needs all of the model.
    reads_whole: bool,
    /// What the window does besides, such as `scan.ply - building nodes 43%`.
    pub(super) status: Option<String>,
    /// How the last frame was drawn, and when.
    drawn_with: Option<(Settings, Instant)>,
    /// The axis that is up in the model.
    up: UpAxis,
    /// Which normals surfaces have.
    normals: SurfaceNormals,
    /// Files that were shown.
    pub(super) recent: RecentFiles,
    /// What of paged files is still to come, shown in its place.
    page_status: Option<String>,
    pub(super) name: String,
    pub(super) has_panel: bool,
    has_help: bool,
    pub(super) has_graph: bool,
    pub(super) has_statistics: bool,
    /// Marks over the picture.
    pub(super) marks: MarkChoice,
    /// The picture of the model is to be drawn anew.
    is_dirty: bool,
    /// What covers it is.
    is_cover_dirty: bool,
    pub(super) is_closing: bool,
    /// Seconds, of the last event or tick.
    time: f64,
    /// When egui wants to be shown again.
    again_at: Option<f64>,
    /// When the camera moved last.
    moved_at: f64,
    turntable: Option<TurntableRun>,
    /// The threshold of a cut that is held, pixels.
    held_px: f32,
    /// A picture that is to be written.
    awaited_picture: Option<AwaitedPicture>,
    /// How often the device was lost since the last frame.
    losses: u32,
    /// Number and time of the frame whose figures are shown.
    shown_figures: (u64, u64),
    /// What the validation layer says of each device that was opened.
    pub(super) messages: Vec<LayerMessages>,
    /// Of the window, pixels.
    pub(super) size: (u32, u32),
    /// Columns of it that belonged to the panel when it was laid out.
    laid_inset: u32,
    /// Frames of a model so far.
    pub(super) frames: u64,
    /// Longest time that a replay took for one.
    pub(super) longest_draw: Duration,
    pub(super) asks: Vec<FileAsk>,
    photographs: ModelPhotographs,
    measuring: MeasureTool,
    section_tool: section::SectionTool,
    /// What the points of each model carry.
    attributes: Vec<Arc<PointAttributes>>,
    kept: KeptParts,
    /// A sample of a few points is shown, until the model is there.
    is_sample: bool,
    /// Time at which a sample came. The model's own view takes the place of its view, unless that was moved.
    sampled_at: Option<f64>,
    coordinate_system: Option<String>,
    /// Meaning of the colors of points.
    legend: Option<ColorLegend>,
}

/// Writes a message to standard error, which may be gone; the window is there.
fn tell(message: &str) {
    let line = format!("surfel: {message}\n");
    let _ = std::io::Write::write_all(&mut std::io::stderr(), line.as_bytes());
}

impl ViewerApp {
    pub(super) fn new(screen: WindowScreen, options: ViewerOptions) -> Self {
        let is_slow = screen.is_drawn_by_processor();
        let target_ms = options.frame_goal.target_ms(is_slow);
        let control = target_ms.map(|ms| FrameBudget::new(ms, options.settings.threshold_px));
        let messages = vec![screen.gpu().messages().clone()];
        Self {
            screen,
            interface: PanelInterface::default(),
            orbit: None,
            fixed: options.camera.clone(),
            light: match &options.camera {
                Some(camera) => camera.light,
                None if options.window.parallel_light => HeadlightSource::Directional,
                None => HeadlightSource::Point,
            },
            lamp: match options.settings.light {
                SurfaceLighting::Phong(phong) => phong,
                SurfaceLighting::Headlight | SurfaceLighting::Sphere(_) => Phong::default(),
            },
            splat_of_model: options.settings.splat,
            settings: options.settings,
            section: options.section,
            good: None,
            control,
            paced: Vec::new(),
            mouse: MouseState::default(),
            drag_distance: 0.0,
            drag_at: DVec2::ZERO,
            wheel: 0.0,
            fly: None,
            held_keys: BTreeSet::new(),
            is_fast: false,
            notices: NoticeList::default(),
            history: TimeHistory::default(),
            facts: None,
            part_names: Vec::new(),
            failures: Vec::new(),
            path: PathBuf::new(),
            is_preview: false,
            is_reloading: false,
            reads_whole: false,
            status: None,
            page_status: None,
            drawn_with: None,
            up: UpAxis::Y,
            normals: match options.opening.tree.crease_degrees {
                None => SurfaceNormals::File,
                Some(0.0) => SurfaceNormals::Flat,
                Some(_) => SurfaceNormals::Smooth,
            },
            recent: RecentFiles::new(&options.window.recent),
            name: text::name(&options.model),
            has_panel: options.window.panel,
            has_help: false,
            has_graph: options.window.graph,
            has_statistics: options.window.statistics,
            marks: MarkChoice {
                scale_bar: options.window.scale_bar,
                axes: options.window.axes,
            },
            is_dirty: true,
            is_cover_dirty: true,
            is_closing: false,
            time: 0.0,
            again_at: None,
            moved_at: f64::NEG_INFINITY,
            turntable: None,
            held_px: 0.0,
            awaited_picture: None,
            losses: 0,
            shown_figures: (0, 0),
            messages,
            size: (1, 1),
            laid_inset: 0,
            frames: 0,
            longest_draw: Duration::ZERO,
            asks: Vec::new(),
            photographs: ModelPhotographs::default(),
            measuring: MeasureTool::default(),
            section_tool: section::SectionTool::default(),
            attributes: Vec::new(),
            kept: KeptParts::default(),
            is_sample: false,
            sampled_at: None,
            coordinate_system: None,
            legend: None,
            options,
        }
    }

    /// Figures of the run so far.
    pub(super) fn figures(&self) -> RunFigures {
        RunFigures {
            frames: self.frames,
            longest_ms: self.longest_draw.as_secs_f64() * 1e3,
            pace: self.pace().filter(|_| self.options.replay.is_some()),
        }
    }

    /// Tells whether nobody is there to read a message and go on.
    pub(super) fn is_unattended(&self) -> bool {
        self.options.screenshot.is_some()
            || self.options.exit_after_frames.is_some()
            || self.options.turntable.is_some()
    }

    /// The time that frames are held to, milliseconds.
    pub(super) fn frame_goal(&self) -> FrameGoal {
        let now = self.control.as_ref().map(FrameBudget::target_ms);
        FrameGoal::of_ms(now, self.screen.is_drawn_by_processor())
    }

    /// Tells whether the headlight is parallel.
    pub(super) fn has_parallel_light(&self) -> bool {
        self.light == HeadlightSource::Directional
    }

    /// Tells whether something is to be drawn.
    pub(super) fn is_dirty(&self) -> bool {
        self.is_dirty || self.is_cover_dirty
    }

    /// Draws again although nothing has changed: the window lost what it showed.
    pub(super) fn expose(&mut self) {
        self.is_cover_dirty = true;
    }

    /// Tells whether anything covers the picture.
    pub(super) fn has_cover(&self) -> bool {
        let has_notices = !self.notices.list().is_empty();
        let has_window = self.has_panel || self.has_help || self.has_graph;
        let has_marks = self.marks != MarkChoice::default() || self.legend.is_some();
        let has_lines = self.photographs.has_marks()
            || self.measuring.is_shown()
            || self.settings.section.is_some();
        has_window || has_notices || has_marks || has_lines
    }

    pub(super) fn warn(&mut self, message: &str) {
        tell(message);
        self.notices.add(message, NoticeWeight::Warning, self.time);
        self.is_cover_dirty = true;
    }

    fn inform(&mut self, message: &str) {
        tell(message);
        self.notices.add(message, NoticeWeight::Info, self.time);
        self.is_cover_dirty = true;
    }

    /// The message that the title tells.
    pub(super) fn failure(&self) -> Option<&str> {
        let last = self.notices.list().last()?;
        (last.weight == NoticeWeight::Warning).then_some(last.text.as_str())
    }

    /// A model was loaded, or could not be, or a preview of it has come. Comes with [`super::event::ViewerEvent::Loaded`] or
    /// [`super::event::ViewerEvent::Preview`].
    pub(super) fn loaded(
        &mut self,
        path: &Path,
        result: Result<LoadedModel, LoadError>,
    ) -> Result<(), ViewerError> {
        self.is_cover_dirty = true;
        let result = match result {
            // Who asked for pictures wants them of the whole model.
            Ok(loaded) if loaded.is_preview && self.is_unattended() => return Ok(()),
            other => other,
        };
        let is_preview = matches!(&result, Ok(loaded) if loaded.is_preview);
        let is_part = matches!(&result, Ok(loaded) if loaded.is_part);
        if !is_preview {
            self.status = None;
        }
        let outcome = match result {
            Ok(loaded) => {
                for warning in &loaded.warnings {
                    tell(&format!("{}: warning: {warning}", path.display()));
                }
                for part in &loaded.more {
                    for warning in &part.warnings {
                        tell(&format!("{}: warning: {warning}", part.path.display()));
                    }
                }
                self.show_loaded(path, loaded)
            }
            Err(error) => Err(error),
        };
        let is_reloading = std::mem::take(&mut self.is_reloading);
        match outcome {
            Ok(()) => {
                if !is_preview && !is_part {
                    self.recent.add(path);
                }
                let is_same = is_reloading || is_part;
                self.take_model(path, (is_preview, is_part), is_same)?;
                self.is_reloading = is_reloading && is_preview;
                for failure in std::mem::take(&mut self.failures) {
                    self.warn(&failure);
                }
                Ok(())
            }
            Err(error) if self.is_unattended() => Err(ViewerError::Open(error)),
            Err(error) => {
                self.part_came(false);
                self.stay_with_pages();
                self.warn(&text::unopened(path, &error.to_string()));
                Ok(())
            }
        }
    }

    /// Puts models that were loaded on the screen.
    fn show_loaded(&mut self, path: &Path, loaded: LoadedModel) -> Result<(), LoadError> {
        let (is_preview, is_part) = (loaded.is_preview, loaded.is_part);
        let is_sample = loaded.is_sample;
        self.failures = loaded.failures;
        // The view of a preview stays, and so does that of parts.
        if !is_preview && !is_part {
            self.up = self.options.up.unwrap_or(loaded.up);
        }
        let hidden = match is_part {
            true => self.screen.shown().to_vec(),
            false => Vec::new(),
        };
        if !is_part {
            let remarks = loaded.more.iter().map(|part| &part.warnings);
            let mut remarks = [&loaded.warnings].into_iter().chain(remarks);
            self.kept.opened_legend = remarks.find_map(|own| legend_of(own)).cloned();
            self.coordinate_system = loaded.coordinate_system;
        }
        self.legend = loaded.legend.or_else(|| self.kept.opened_legend.clone());
        let mut wholes = vec![WholeModel {
            path: path.to_owned(),
            model: loaded.model.clone(),
            attributes: loaded.attributes.clone(),
        }];
        let (mut more, mut pages) = (Vec::new(), vec![loaded.pages]);
        let mut attributes = vec![loaded.attributes];
        for part in loaded.more {
            wholes.push(WholeModel {
                path: part.path,
                model: part.model.clone(),
                attributes: part.attributes.clone(),
            });
            more.push(part.model);
            attributes.push(part.attributes);
            pages.push(part.pages);
        }
        self.part_names = wholes.iter().map(|own| text::name(&own.path)).collect();
        self.screen.set_model(loaded.model, more, loaded.scene)?;
        self.attributes = attributes;
        self.is_sample = is_sample;
        if is_sample {
            self.sampled_at = Some(self.time);
        }
        let is_in_memory = pages.iter().all(Option::is_none);
        self.screen.set_pages(pages, self.waits_for_pages());
        for (index, is_shown) in hidden.into_iter().enumerate() {
            self.screen.show(index, is_shown);
        }
        if is_part {
            self.part_came(true);
        } else if !is_preview {
            let wholes = if is_in_memory { wholes } else { Vec::new() };
            self.take_wholes(wholes, self.is_reloading);
        }
        Ok(())
    }

    /// Tells whether frames wait until their pages are there: pictures that nobody watches, and recordings, are the same each
    /// time.
    fn waits_for_pages(&self) -> bool {
        self.is_unattended() || self.options.replay.is_some()
    }

    /// Tells whether the next frame would be finer, since pages came.
    pub(super) fn take_pages(&mut self) {
        for message in self.screen.take_page_messages() {
            self.warn(&message);
        }
        if self.screen.has_new_pages() {
            self.is_dirty = true;
        }
        let status = match self.screen.wanted_pages() {
            0 => None,
            count => Some(text::pages_to_come(count)),
        };
        if status != self.page_status {
            self.page_status = status;
            self.is_cover_dirty = true;
        }
    }

    /// Takes discs in the plane of the surface on points and squares on surfaces, where nobody has said which.
    fn take_splat(&mut self) {
        if !self.options.splat_by_model || self.settings.splat != self.splat_of_model {
            return;
        }
        self.splat_of_model = match self.screen.has_points() {
            true => SplatKind::Ellipse,
            false => SplatKind::Square,
        };
        self.settings.splat = self.splat_of_model;
    }

    /// Looks at the model that the screen has.
    fn take_model(
        &mut self,
        path: &Path,
        (is_preview, is_part): (bool, bool),
        is_same: bool,
    ) -> Result<(), ViewerError> {
        // The view of a preview stays: somebody may have turned it.
        let is_expected = (self.is_preview || is_same) && self.path == path;
        let is_another = self.orbit.is_some() && !is_expected;
        // A sample knew less of where the model ends; its view stays where it was moved.
        let reframes = match self.sampled_at {
            Some(at) if !self.is_sample => {
                self.sampled_at = None;
                self.moved_at < at
            }
            _ => false,
        };
        self.is_preview = is_preview;
        self.path = path.to_owned();
        self.name = text::name(path);
        self.history.clear();
        // A view of another model.
        self.settings.cut_view = None;
        if is_another {
            self.section = None;
        }
        if let Some(control) = &mut self.control {
            control.forget();
        }
        let orbit = self.options.orbit;
        if self.screen.model().is_none() {
            return Ok(());
        }
        self.take_splat();
        let models = self.screen.models();
        let sum = |of: &dyn Fn(&Model) -> u64| models.iter().map(|model| of(model)).sum();
        self.facts = (!is_preview).then(|| PanelFacts {
            name: self.name.clone(),
            triangles: sum(&|model| model.triangles.len() as u64),
            vertices: sum(&|model| model.vertices.len() as u64),
            nodes: sum(&|model| (model.tree.nodes.len() + model.tree.leaves.len()) as u64),
            bytes: sum(&|model| model.memory_bytes().total()),
            is_closed: models.iter().all(|model| model.is_closed),
            origin: models[0].origin,
            bounds: section::bounds_of(&models),
            coordinate_system: self.coordinate_system.clone(),
        });
        let origin = models[0].origin;
        self.settings.section = (self.section).map(|ends| SectionBox::of_file(ends, origin));
        self.is_dirty = true;
        let Some(OrbitSphere { center, radius }) = self.screen.orbit_sphere() else {
            return Ok(());
        };
        let up = self.up;
        if let Some(orbit) = self
            .orbit
            .as_mut()
            .filter(|orbit| is_expected && orbit.up() != up)
        {
            orbit.set_up(up);
        }
        if !is_expected || self.orbit.is_none() || reframes {
            let orbit = OrbitCamera::new(center, radius, self.picture_size(), orbit);
            self.orbit = Some(orbit.about(self.up));
            if is_another {
                self.fixed = None;
            }
            if let (Some(camera), Some(orbit)) = (&self.fixed, &mut self.orbit) {
                orbit.look_as(camera);
            }
        }
        if !is_preview && !is_part {
            self.photographs_of_new_model()?;
            self.measuring.forget();
        }
        match self.options.turntable.clone() {
            Some(folder) if !is_preview && !is_part => self.start_turntable(folder),
            _ => Ok(()),
        }
    }
}
