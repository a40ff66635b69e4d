//! What keys and buttons ask for.

use super::draw::camera_of;
use super::{CameraFlight, FLY_SPEED, FileAsk, ViewerApp};
use crate::math::camera::Camera;
use crate::math::up_axis::UpAxis;
use crate::oriented::splats::SplatRules;
use crate::pack::SurfaceLighting;
use crate::render::PictureOutputs;
use crate::render::supported;
use crate::render::{Culling, Method, Settings, Shading};
use crate::viewer::camera::OrbitCamera;
use crate::viewer::choices::{self, NamedChoice, others};
use crate::viewer::control::FrameBudget;
use crate::viewer::input::KeyCommand;
use crate::viewer::lamp::same_cost;
use crate::viewer::recovery::{RecoveryWay, way_after};
use crate::viewer::{ViewerError, text};
use std::f64::consts::TAU;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Largest threshold that the keys set, pixels.
const LARGEST_THRESHOLD_PX: f32 = 4096.0;
/// Largest depth offset that the keys set, and smallest above 0.
const DEPTH_OFFSETS: (f32, f32) = (0.01, 1000.0);
/// Pixels of a photo for one of the window, in each direction.
const PHOTO: u32 = 2;
/// Pictures of a turntable that a key asks for.
const TURNTABLE: u32 = 36;

/// Pictures from all around, one a frame.
#[derive(Debug)]
pub(super) struct TurntableRun {
    folder: PathBuf,
    next: u32,
    count: u32,
}

impl ViewerApp {
    /// Does what a key asks for.
    pub(super) fn command(&mut self, command: KeyCommand) -> Result<(), ViewerError> {
        let old = self.settings;
        let is_closed = self.screen.model().is_some_and(|model| model.is_closed);
        match command {
            KeyCommand::Quit => self.is_closing = true,
            KeyCommand::Escape => self.escape(),
            KeyCommand::Method(method) => self.wish(Settings { method, ..old }),
            KeyCommand::Threshold(threshold_px) => self.wish(Settings {
                threshold_px,
                ..old
            }),
            KeyCommand::ThresholdBy(px) => self.wish(Settings {
                threshold_px: (old.threshold_px + px).clamp(0.0, LARGEST_THRESHOLD_PX),
                ..old
            }),
            KeyCommand::Splat(step) => {
                self.step(choices::SPLATS, old.splat, step < 0, |splat| Settings {
                    splat,
                    ..old
                });
            }
            KeyCommand::Blend => self.step(choices::BLENDS, old.blend, false, |blend| Settings {
                blend,
                ..old
            }),
            KeyCommand::Reconstruction => {
                let list = choices::RECONSTRUCTIONS;
                self.step(list, old.reconstruction, false, |reconstruction| Settings {
                    reconstruction,
                    ..old
                });
            }
            KeyCommand::Shading => self.wish(Settings {
                shading: match old.shading {
                    Shading::PerSplat => Shading::Deferred,
                    Shading::Deferred => Shading::PerSplat,
                },
                ..old
            }),
            KeyCommand::DepthOffsetBy(factor) => {
                let (least, most) = DEPTH_OFFSETS;
                let offset = (old.depth_offset().max(least) * factor).clamp(least, most);
                self.wish(Settings {
                    depth_offset: Some(offset),
                    ..old
                });
            }
            KeyCommand::UsualDepthOffset => self.wish(Settings {
                depth_offset: None,
                ..old
            }),
            KeyCommand::Light => self.next_light(),
            KeyCommand::Lamp(change) => self.change_lamp(change),
            KeyCommand::FrameTime(step) => self.next_frame_time(step),
            KeyCommand::Normals => {
                if let Some(next) = others(choices::NORMALS, self.normals, false).first() {
                    self.set_normals(*next);
                }
            }
            KeyCommand::TwoSided => self.wish(Settings {
                two_sided: !old.two_sided,
                ..old
            }),
            KeyCommand::Colors => self.wish(Settings {
                use_colors: !old.use_colors,
                ..old
            }),
            KeyCommand::Background => {
                let list = choices::BACKGROUNDS;
                let now = (old.background, old.background_bottom);
                self.step(list, now, false, |(background, background_bottom)| {
                    Settings {
                        background,
                        background_bottom,
                        ..old
                    }
                });
            }
            KeyCommand::SizeMetric => self.step(choices::METRICS, old.size, false, |size| {
                Settings { size, ..old }
            }),
            KeyCommand::VertexSplats => self.wish(match old.drawn_vertex_splats() {
                Some(_) => Settings {
                    vertex_splats: None,
                    ..old
                },
                None => Settings {
                    method: Method::Splats,
                    vertex_splats: Some(SplatRules::usual()),
                    ..old
                },
            }),
            KeyCommand::EyeDome => self.step(choices::EYE_DOMES, old.eye_dome, false, |eye_dome| {
                Settings { eye_dome, ..old }
            }),
            KeyCommand::AmbientOcclusion => {
                let list = choices::AMBIENT_OCCLUSIONS;
                self.step(list, old.ambient_occlusion, false, |ambient_occlusion| {
                    Settings {
                        ambient_occlusion,
                        ..old
                    }
                });
            }
            KeyCommand::ScaleBar => self.marks.scale_bar = !self.marks.scale_bar,
            KeyCommand::Axes => self.marks.axes = !self.marks.axes,
            KeyCommand::Culling => self.wish(Settings {
                culling: if old.culls_back(is_closed) {
                    Culling::Off
                } else {
                    Culling::On
                },
                ..old
            }),
            KeyCommand::ColorBy(step) => {
                // Those that cannot be drawn now are no news.
                let next = others(choices::COLORS_BY, old.color_by, step < 0)
                    .into_iter()
                    .map(|color_by| Settings { color_by, ..old })
                    .find(|settings| self.refusal(settings).is_none());
                if let Some(settings) = next {
                    self.wish(settings);
                }
            }
            KeyCommand::Photographs => self.switch_photographs(),
            KeyCommand::PhotographBy(step) => self.step_photograph(step),
            KeyCommand::Measure(change) => self.change_measures(change),
            KeyCommand::HoldCut => self.hold_cut(),
            KeyCommand::Section => self.switch_section(),
            KeyCommand::Keep => self.switch_kept(),
            KeyCommand::PointColors => self.next_point_colors(),
            KeyCommand::Statistics => self.has_statistics = !self.has_statistics,
            KeyCommand::Print => self.print_statistics()?,
            KeyCommand::Screenshot => self.ask_for_screenshot()?,
            KeyCommand::Photo => self.photo()?,
            KeyCommand::Turntable => match (&self.turntable, free_path("surfel-turn-", "")) {
                (Some(_), _) => self.end_turntable("stopped; "),
                (None, Some(folder)) if self.orbit.is_some() => self.start_turntable(folder)?,
                (None, Some(_)) => {}
                (None, None) => {
                    self.warn("surfel-turn-000 to surfel-turn-999 are all there; move some away");
                }
            },
            KeyCommand::Frame => self.change(OrbitCamera::frame_model),
            KeyCommand::Reset => self.change(OrbitCamera::reset),
            KeyCommand::Reload => {
                self.reload();
            }
            KeyCommand::LookFrom(azimuth, elevation) => {
                self.change(|orbit| orbit.look_from(azimuth, elevation));
            }
            KeyCommand::Up => {
                // What is up in the photographs comes after x.
                let photographs = self.up_of_photographs().filter(|_| self.up == UpAxis::X);
                let up = photographs.unwrap_or(self.up.next());
                self.up = up;
                self.change(|orbit| orbit.set_up(up));
                self.inform(&format!("{} is up", up.name()));
            }
            KeyCommand::Fly => self.set_flying(self.fly.is_none()),
            KeyCommand::CopyCamera => {
                if let Some(camera) = self.camera()
                    && let Ok(text) = serde_json::to_string(&camera)
                {
                    self.asks.push(FileAsk::Copy(text));
                    self.inform("copied the camera");
                }
            }
            KeyCommand::Paste => self.asks.push(FileAsk::Paste),
            KeyCommand::Panel => {
                self.has_panel = !self.has_panel;
                self.lay_out();
            }
            KeyCommand::Help => self.has_help = !self.has_help,
            KeyCommand::Graph => self.has_graph = !self.has_graph,
            KeyCommand::Freeze => self.history.toggle_frozen(),
            KeyCommand::FullScreen => self.asks.push(FileAsk::FullScreen),
            KeyCommand::Dismiss => {
                self.notices.clear();
            }
        }
        self.is_cover_dirty = true;
        Ok(())
    }

    fn escape(&mut self) {
        if self.has_help {
            self.has_help = false;
        } else if self.turntable.is_some() {
            self.end_turntable("stopped; ");
        } else if self.fly.is_some() {
            self.set_flying(false);
        } else if !self.notices.clear() {
            self.is_closing = true;
        }
    }

    fn set_flying(&mut self, is_flying: bool) {
        if is_flying && self.orbit.is_none() {
            return;
        }
        self.fly = is_flying.then_some(CameraFlight {
            speed: FLY_SPEED,
            last_at: None,
        });
        self.held_keys.clear();
        self.mouse.release();
        self.asks.push(FileAsk::HoldCursor(is_flying));
    }

    /// Why these settings cannot be drawn with, if so.
    fn refusal(&self, settings: &Settings) -> Option<String> {
        self.screen.model()?;
        let max_size_px = self.screen.gpu().info().max_point_size_px;
        let mut settings = *settings;
        if settings.method == Method::Points {
            // As they are drawn.
            settings.threshold_px = settings.threshold_px.min(max_size_px);
        }
        let outputs = PictureOutputs {
            depth: false,
            normal: false,
            values: false,
        };
        let refuses = |settings: &Settings| {
            let outcome = supported::check(settings, outputs, max_size_px);
            outcome.err().map(|error| error.to_string())
        };
        let old = &self.settings;
        let changes_splats = (settings.splat, settings.blend, settings.shading)
            != (old.splat, old.blend, old.shading);
        // Without splats any kind is accepted; it would be refused when splats are to be drawn, and seem to be the
        // fault of the method.
        let with_splats = Settings {
            method: Method::Pop,
            ..settings
        };
        refuses(&settings).or_else(|| {
            let is_later = changes_splats && !settings.has_cut();
            is_later.then(|| refuses(&with_splats)).flatten()
        })
    }

    /// Draws in another way from now on, unless that is refused: then the window says why and nothing changes.
    pub(super) fn wish(&mut self, settings: Settings) {
        if settings == self.settings {
            return;
        }
        if let Some(why) = self.refusal(&settings) {
            self.warn(&why);
            return;
        }
        if let Some(control) = &mut self.control {
            control.set_finest(settings.threshold_px);
        }
        if settings.threshold_px != self.settings.threshold_px {
            self.held_px = settings.threshold_px;
        }
        if let SurfaceLighting::Phong(lamp) = settings.light {
            self.lamp = lamp;
        }
        let looks_other = Settings {
            threshold_px: self.settings.threshold_px,
            ..settings
        };
        if same_cost(&looks_other) != same_cost(&self.settings) {
            // Other passes: their times are not to be mixed.
            self.history.clear();
            if let Some(control) = &mut self.control {
                control.forget();
            }
        }
        if let Some(model) = self.screen.model() {
            self.section = (settings.section).map(|own| own.in_file(model.origin));
        }
        self.settings = settings;
        self.is_dirty = true;
    }

    /// The next choice that is not refused; tells of those that were passed over.
    fn step<T: Copy + PartialEq>(
        &mut self,
        list: &[NamedChoice<T>],
        now: T,
        backward: bool,
        with: impl Fn(T) -> Settings,
    ) {
        let mut passed: Vec<String> = Vec::new();
        for value in others(list, now, backward) {
            let settings = with(value);
            match self.refusal(&settings) {
                None => {
                    self.wish(settings);
                    break;
                }
                Some(why) => passed.push(format!("{}: {why}", choices::name_of(list, value))),
            }
        }
        if !passed.is_empty() {
            self.warn(&format!("passed over {}", passed.join("; ")));
        }
    }

    /// What the options ask for after a frame of the model, and the next picture of a turntable.
    pub(super) fn after_frame(&mut self) -> Result<(), ViewerError> {
        if self.turntable.is_some() {
            self.next_of_turntable()?;
        }
        if let Some(path) = self.options.screenshot.clone() {
            if self.options.with_panel {
                // The panel tells of the frames before.
                if self.frames < 4 {
                    self.is_dirty = true;
                    return Ok(());
                }
                self.save_shown(&path)?;
            } else {
                self.save(&path)?;
            }
            self.is_closing = true;
        }
        if let Some(frames) = self.options.exit_after_frames {
            self.is_closing |= self.frames >= frames;
            self.is_dirty = true;
        }
        Ok(())
    }

    /// Writes the picture, without what covers it.
    pub(in crate::viewer) fn save(&mut self, path: &Path) -> Result<(), ViewerError> {
        if let Some(mut image) = self.screen.read()? {
            self.picture_marks().draw_over_bytes(&mut image);
            image.save_png(path)?;
        }
        Ok(())
    }

    /// Writes what the window shows, panel and all.
    pub(in crate::viewer) fn save_shown(&mut self, path: &Path) -> Result<(), ViewerError> {
        if let Some(image) = self.screen.read_shown()? {
            image.save_png(path)?;
        }
        Ok(())
    }

    /// Writes a photo of the present view to the first `surfel-photo-NNN.png` that is not there yet: as fine as the picture
    /// at rest, however coarse it is while the view moves.
    fn photo(&mut self) -> Result<(), ViewerError> {
        let Some(orbit) = &self.orbit else {
            return Ok(());
        };
        if self.is_preview {
            self.warn("a photo is of the whole model; it is not there yet");
            return Ok(());
        }
        let Some(path) = free_path("surfel-photo-", ".png") else {
            self.warn("surfel-photo-000.png to surfel-photo-999.png are all there; move some away");
            return Ok(());
        };
        let (width, height) = self.picture_size();
        let size = (PHOTO * width, PHOTO * height);
        let camera = camera_of(orbit, self.fixed.as_ref(), self.light, size);
        let mut settings = self.settings;
        if settings.holds_cut() {
            settings.threshold_px = self.held_px;
        }
        match self.screen.photo(&settings, &camera) {
            Ok(Some(mut image)) => {
                self.marks_of(&camera).draw_over_bytes(&mut image);
                match image.save_png(&path) {
                    Ok(()) => self.inform(&format!("wrote {}", path.display())),
                    Err(error) => self.warn(&error.to_string()),
                }
            }
            Ok(None) => {}
            // A device that was lost is noticed by the next frame.
            Err(error) if way_after(&error) == RecoveryWay::End => return Err(error.into()),
            Err(error) => self.warn(&format!("no photo: {error}")),
        }
        self.is_dirty = true;
        Ok(())
    }

    /// Draws the cut of the present view from now on, wherever the camera goes, or that of the camera again.
    fn hold_cut(&mut self) {
        let view = match (self.settings.cut_view, self.screen.model(), self.camera()) {
            (None, Some(model), Some(camera)) => camera.view(model.origin).ok(),
            _ => None,
        };
        if view.is_none() && self.settings.cut_view.is_none() {
            return;
        }
        if view.is_some() {
            if !self.settings.has_cut() {
                self.warn("there is no cut to hold: all of the model is drawn; D and X draw a cut");
                return;
            }
            let shown_px = self.control.as_ref().map_or(0.0, FrameBudget::threshold_px);
            self.held_px = shown_px.max(self.settings.threshold_px);
            self.inform("the cut is held; Y lets it go");
        } else {
            self.inform("the cut follows the camera again");
        }
        self.wish(Settings {
            cut_view: view,
            ..self.settings
        });
    }

    /// Writes pictures into `folder` from the next frame on, which is made if it is not there.
    pub(super) fn start_turntable(&mut self, folder: PathBuf) -> Result<(), ViewerError> {
        if let Err(source) = std::fs::create_dir_all(&folder) {
            let error = crate::image::Error::Write {
                path: folder,
                source,
            };
            if self.is_unattended() {
                return Err(error.into());
            }
            self.warn(&error.to_string());
            return Ok(());
        }
        let count = self.options.turntable_frames.unwrap_or(TURNTABLE).max(1);
        // A turntable turns; a camera that was given does not.
        self.change(|_| {});
        self.turntable = Some(TurntableRun {
            folder,
            next: 0,
            count,
        });
        self.is_dirty = true;
        Ok(())
    }

    fn end_turntable(&mut self, how: &str) {
        if let Some(turntable) = self.turntable.take() {
            self.inform(&format!(
                "{how}wrote {} pictures to {}",
                turntable.next,
                turntable.folder.display()
            ));
            self.is_dirty = true;
            self.is_closing |= self.options.turntable.is_some();
        }
    }

    fn next_of_turntable(&mut self) -> Result<(), ViewerError> {
        let Some(turntable) = &mut self.turntable else {
            return Ok(());
        };
        let (count, index) = (turntable.count, turntable.next);
        let path = turntable.folder.join(format!("turn-{index:03}.png"));
        match self.save(&path) {
            Err(ViewerError::Image(error)) if !self.is_unattended() => {
                self.warn(&error.to_string());
                self.turntable = None;
                return Ok(());
            }
            other => other?,
        }
        if let Some(turntable) = &mut self.turntable {
            turntable.next += 1;
        }
        if let Some(orbit) = &mut self.orbit {
            orbit.turn_table(TAU / f64::from(count));
        }
        self.is_dirty = true;
        if index + 1 == count {
            self.end_turntable("");
        }
        Ok(())
    }

    fn print_statistics(&mut self) -> Result<(), ViewerError> {
        self.screen.finish()?;
        let camera: Option<Camera> = self.camera();
        let (Some(model), Some(camera)) = (self.screen.model(), camera) else {
            return Ok(());
        };
        let facts = text::TitleFacts {
            name: &self.name,
            model,
            settings: &self.settings,
            headlight: self.light,
            device: &self.screen.gpu().info().name,
            present_mode: self.screen.present_mode(),
            size: self.picture_size(),
        };
        let mut out = text::statistics(&facts, self.screen.frame_ms(), self.screen.times());
        if let Ok(camera) = serde_json::to_string(&camera) {
            out += &format!("  camera {camera}\n");
        }
        // Nobody may be reading; the window goes on.
        let _ = std::io::stdout().write_all(out.as_bytes());
        Ok(())
    }
}

/// The first of `name000end` to `name999end` that is not there yet.
pub(super) fn free_path(name: &str, end: &str) -> Option<PathBuf> {
    (0..1000)
        .map(|n| PathBuf::from(format!("{name}{n:03}{end}")))
        .find(|path| !path.exists())
}
