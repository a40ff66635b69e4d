//! The panel: what decides the picture, and what it shows. It changes nothing itself; what the user asks for comes
//! back as wishes, the same that keys make.

use super::choices::{self, NamedChoice, SurfaceNormals, name_of};
use super::control::BudgetReport;
use super::help::ACCENT;
use super::input::{KeyCommand, MeasureChange};
use super::lamp::LightKind;
use super::text::count;
use crate::image::MarkChoice;
use crate::pack::{ColorBy, SurfaceLighting};
use crate::render::stats::FrameCounts;
use crate::render::stats::OverdrawSummary;
use crate::render::vulkan::overdraw;
use crate::render::{Blend, Method, Settings, Shading, SplatKind};
use egui::{
    Area, Color32, ComboBox, DragValue, Frame, Grid, RichText, ScrollArea, Slider, Ui, pos2,
};

use glam::DVec3;
use std::path::PathBuf;

/// Width of the panel, points.
pub const WIDTH: f32 = 276.0;

/// What the model is.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PanelFacts {
    /// Name of the file.
    pub name: String,
    /// Triangles.
    pub triangles: u64,
    /// Vertices.
    pub vertices: u64,
    /// Nodes of the tree, leaves included.
    pub nodes: u64,
    /// Bytes of model and tree in memory.
    pub bytes: u64,
    /// Whether the surface is closed.
    pub is_closed: bool,
    /// Origin of model space in the coordinates of the file.
    pub origin: DVec3,
    /// Least and greatest coordinates in those of the file.
    pub bounds: [DVec3; 2],
    /// Text of the coordinate system that the file names.
    pub coordinate_system: Option<String>,
}

/// Everything the panel shows.
#[derive(Debug)]
pub struct PanelState<'a> {
    /// How the model is drawn.
    pub settings: &'a Settings,
    /// What lights the model.
    pub light: LightKind,
    /// Which normals its surfaces have.
    pub normals: SurfaceNormals,
    /// Radius of the model: steps of a lamp in the world follow it.
    pub radius: f64,
    /// The model, once there is one.
    pub facts: Option<&'a PanelFacts>,
    /// What is being done, such as `building nodes 43%`.
    pub status: Option<&'a str>,
    /// Median time of the last frames, milliseconds.
    pub frame_ms: f64,
    /// What the last frame drew.
    pub counts: FrameCounts,
    /// What covers its pixels, where that decides the color.
    pub overdraw: Option<OverdrawSummary>,
    /// The threshold of the last frame, and what is known about the time of frames, where that is controlled.
    pub control: Option<(f32, f64, BudgetReport)>,
    /// Marks over the picture.
    pub marks: MarkChoice,
    /// The user flies.
    pub is_flying: bool,
    /// Names of the models, and whether each is drawn.
    pub parts: Vec<(&'a str, bool)>,
    /// Files that were shown before, the last one first.
    pub recent: &'a [PathBuf],
    /// Photographs of the model, where there are any.
    pub photographs: Option<PhotographState>,
    /// A line of text for each measure, and whether the last one goes on.
    pub measures: MeasureState,
    /// Conditions of what is kept; none where nothing can be left out.
    pub keep: Option<KeepState>,
}

/// What the user asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum PanelWish {
    /// As a key would.
    Command(KeyCommand),
    /// Draw in another way.
    Settings(Box<Settings>),
    /// Another light.
    Light(LightKind),
    /// Other normals: the files are opened again.
    Normals(SurfaceNormals),
    /// Open a model that was shown before.
    Open(PathBuf),
    /// Hold frames to this time, milliseconds, or to none.
    FrameTime(Option<f64>),
    /// Something of photographs.
    Photograph(PhotographWish),
    /// Keep what meets these conditions.
    Keep(String),
    /// Color points by this, or as they were opened.
    ColorPoints(Option<crate::input::ColorSetting>),
    /// Take a measure away.
    RemoveMeasure(usize),
    /// Draw a model, or leave it out.
    Show {
        /// Index of the model.
        part: usize,
        /// The model is drawn.
        is_shown: bool,
    },
}

/// Shows the panel at the left edge, `height` points high.
pub fn show(context: &egui::Context, state: &PanelState<'_>, height: f32) -> Vec<PanelWish> {
    let mut wishes = Vec::new();
    // A window may be lower than the margins.
    let inside = (height - 20.0).max(0.0);
    Area::new("panel".into())
        .fixed_pos(pos2(0.0, 0.0))
        .movable(false)
        .show(context, |ui| {
            Frame::new()
                .fill(ui.visuals().panel_fill)
                .inner_margin(10)
                .show(ui, |ui| {
                    ui.set_width(WIDTH - 20.0);
                    ui.set_min_height(inside);
                    ScrollArea::vertical()
                        .max_height(inside)
                        .auto_shrink([false, true])
                        .show(ui, |ui| contents(ui, state, &mut wishes));
                });
        });
    wishes
}

fn heading(ui: &mut Ui, text: &str) {
    ui.add_space(8.0);
    ui.label(RichText::new(text).strong().color(ACCENT));
}

/// A line of two columns: what, and a value that may be long.
fn fact(ui: &mut Ui, what: &str, value: String) {
    ui.label(what);
    ui.label(RichText::new(value).monospace());
    ui.end_row();
}

fn contents(ui: &mut Ui, state: &PanelState<'_>, wishes: &mut Vec<PanelWish>) {
    model(ui, state, wishes);
    recent(ui, state.recent, wishes);
    let mut settings = *state.settings;
    heading(ui, "Drawing");
    drawing(ui, &mut settings, state, wishes);
    heading(ui, "Look");
    let (mut light, mut normals) = (state.light, state.normals);
    look::show(ui, &mut settings, &mut light, &mut normals);
    look::marks(ui, state.marks, wishes);
    if settings.color_by == ColorBy::Overdraw {
        legend(ui, state.overdraw);
    }
    if let SurfaceLighting::Phong(phong) = &mut settings.light {
        lamp::show(ui, phong, state.radius, wishes);
    }
    if let Some(of_photos) = &state.photographs {
        photographs::show(ui, &mut settings, of_photos, wishes);
    }
    measures::show(ui, &state.measures, wishes);
    if settings != *state.settings {
        wishes.push(PanelWish::Settings(Box::new(settings)));
    }
    if light != state.light {
        wishes.push(PanelWish::Light(light));
    }
    if normals != state.normals {
        wishes.push(PanelWish::Normals(normals));
    }
    heading(ui, "Frame");
    frame(ui, state, wishes);
    ui.add_space(10.0);
    ui.horizontal_wrapped(|ui| {
        for (name, command, tip) in [
            ("Keys", KeyCommand::Help, "Show every key (? or F1)"),
            (
                "Frame model",
                KeyCommand::Frame,
                "Bring the model into the picture (F)",
            ),
            ("Reset", KeyCommand::Reset, "Back to the first view (R)"),
            (
                "Fly",
                KeyCommand::Fly,
                "Walk through the model with W A S D and the mouse (G)",
            ),
            (
                "Picture",
                KeyCommand::Screenshot,
                "Write the picture to surfel-NNN.png (P)",
            ),
            (
                "Photo",
                KeyCommand::Photo,
                "Write a picture twice as wide and high, 16 samples a pixel, to surfel-photo-NNN.png (Shift P)",
            ),
            (
                "Point",
                KeyCommand::Measure(MeasureChange::PointInfo),
                "Show the point under the cursor, place and attributes (Ctrl I)",
            ),
            (
                "Turntable",
                KeyCommand::Turntable,
                "Write 36 pictures from all around to surfel-turn-NNN (T)",
            ),
            (
                "Copy camera",
                KeyCommand::CopyCamera,
                "Copy the camera as JSON (Ctrl C); Ctrl V pastes one",
            ),
            (
                "Full screen",
                KeyCommand::FullScreen,
                "Fill the screen, or back (F11)",
            ),
            (
                "Graph",
                KeyCommand::Graph,
                "Show what the last frames cost (H)",
            ),
            ("Hide", KeyCommand::Panel, "Hide this panel (Tab)"),
        ] {
            if ui.button(name).on_hover_text(tip).clicked() {
                wishes.push(PanelWish::Command(command));
            }
        }
    });
}

/// A list of files that were shown before, folded up.
fn recent(ui: &mut Ui, files: &[PathBuf], wishes: &mut Vec<PanelWish>) {
    if files.is_empty() {
        return;
    }
    egui::CollapsingHeader::new("Recent files").show(ui, |ui| {
        for path in files {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let button = egui::Button::new(name).truncate();
            let tip = format!("Open {}", path.display());
            if ui.add(button).on_hover_text(tip).clicked() {
                wishes.push(PanelWish::Open(path.clone()));
            }
        }
    });
}

fn model(ui: &mut Ui, state: &PanelState<'_>, wishes: &mut Vec<PanelWish>) {
    if let Some(status) = state.status {
        ui.horizontal(|ui| {
            ui.label("⏳");
            ui.add(egui::Label::new(status).truncate());
        });
    }
    let Some(facts) = state.facts else {
        if state.status.is_none() {
            ui.label("Drop a model here.")
                .on_hover_text("OBJ, PLY, STL, OFF, TRI, glTF, LAS, LAZ, E57, PCD or XYZ text");
        }
        return;
    };
    ui.add(egui::Label::new(RichText::new(&facts.name).heading()).truncate())
        .on_hover_text(&facts.name);
    Grid::new("model").num_columns(2).show(ui, |ui| {
        fact(ui, "triangles", count(facts.triangles));
        fact(ui, "vertices", count(facts.vertices));
        fact(ui, "nodes", count(facts.nodes));
        let mebibytes = facts.bytes as f64 / f64::from(1 << 20);
        fact(ui, "in memory", format!("{mebibytes:.1} MiB"));
        let surface = match (facts.is_closed, facts.triangles) {
            (_, 0) => "points",
            (true, _) => "closed",
            (false, _) => "open",
        };
        fact(ui, "surface", surface.into());
    });
    if let Some(text) = &facts.coordinate_system {
        ui.add(egui::Label::new(text).truncate())
            .on_hover_text(format!("Coordinate system, as the file names it: {text}"));
    }
    if let Some(own) = &state.keep {
        keep::show(ui, own, wishes);
    }
    if state.parts.len() > 1 {
        for (part, &(name, is_shown)) in state.parts.iter().enumerate() {
            let mut is_on = is_shown;
            ui.checkbox(&mut is_on, name)
                .on_hover_text("Draw this model");
            if is_on != is_shown {
                wishes.push(PanelWish::Show {
                    part,
                    is_shown: is_on,
                });
            }
        }
    }
}

/// A drop-down list of choices.
pub(super) fn choose<T: Copy + PartialEq>(
    ui: &mut Ui,
    what: &str,
    list: &[(T, &str, &str)],
    value: &mut T,
    tip: &str,
) {
    let current = list.iter().find(|c| c.0 == *value);
    let (name, meaning) = current.map_or(("other", ""), |c| (c.1, c.2));
    ui.label(what).on_hover_text(tip);
    ComboBox::from_id_salt(what)
        .selected_text(name)
        .width(130.0)
        .show_ui(ui, |ui| {
            for (choice, name, meaning) in list {
                ui.selectable_value(value, *choice, *name)
                    .on_hover_text(*meaning);
            }
        })
        .response
        .on_hover_text(format!("{tip}\n{name}: {meaning}"))
        .on_disabled_hover_text(format!("{tip}\nNot used by what is drawn now."));
    ui.end_row();
}

fn drawing(
    ui: &mut Ui,
    settings: &mut Settings,
    state: &PanelState<'_>,
    wishes: &mut Vec<PanelWish>,
) {
    ui.horizontal(|ui| {
        for (method, name, tip) in choices::METHODS {
            ui.selectable_value(&mut settings.method, *method, *name)
                .on_hover_text(*tip);
        }
    });
    let has_splats = settings.has_cut() || settings.drawn_vertex_splats().is_some();
    let blends = matches!(
        settings.splat,
        SplatKind::Square | SplatKind::Disc | SplatKind::Ellipse | SplatKind::Gauss
    );
    Grid::new("drawing").num_columns(2).show(ui, |ui| {
        choose_if(
            ui,
            has_splats,
            "splat",
            choices::SPLATS,
            &mut settings.splat,
            "What a splat looks like (N, Shift N)",
        );
        choose_if(
            ui,
            has_splats && blends,
            "blend",
            choices::BLENDS,
            &mut settings.blend,
            "How splats that overlap become one surface (M)",
        );
        choose_if(
            ui,
            has_splats && blends && settings.blend() != Blend::Opaque
                || settings.shading != Shading::PerSplat,
            "shading",
            choices::SHADINGS,
            &mut settings.shading,
            "When blended splats are lit (J)",
        );
        choose_if(
            ui,
            has_splats && settings.splat == SplatKind::Visibility,
            "reconstruct",
            choices::RECONSTRUCTIONS,
            &mut settings.reconstruction,
            "How the picture between visible centers is filled in (K)",
        );
        let tip = "Draw a node as a splat once it is this small on screen; pixels (1 to 9, + and -)";
        ui.label("threshold").on_hover_text(tip);
        ui.add_enabled_ui(settings.method != Method::Triangles, |ui| {
            ui.horizontal(|ui| {
                let slider = Slider::new(&mut settings.threshold_px, 0.0..=64.0)
                    .logarithmic(true)
                    .smallest_positive(0.25)
                    .show_value(false);
                ui.spacing_mut().slider_width = 78.0;
                ui.add(slider)
                    .on_hover_text(tip)
                    .on_disabled_hover_text(tip);
                let value = DragValue::new(&mut settings.threshold_px)
                    .range(0.0..=4096.0)
                    .speed(0.02)
                    .max_decimals(2)
                    .suffix(" px");
                ui.add(value)
                    .on_hover_text(tip)
                    .on_disabled_hover_text(tip);
            });
        });
        ui.end_row();
        let tip = "How far behind the front a surface still counts as one with it, in radii of a splat (, and .)";
        ui.label("depth offset").on_hover_text(tip);
        let is_used = has_splats
            && (settings.blend() != Blend::Opaque || settings.splat == SplatKind::Filtered);
        ui.add_enabled_ui(is_used, |ui| {
            ui.horizontal(|ui| {
                let mut offset = settings.depth_offset();
                let value = DragValue::new(&mut offset)
                    .range(0.0..=1000.0)
                    .speed(0.02)
                    .max_decimals(2);
                if ui
                    .add(value)
                    .on_hover_text(tip)
                    .on_disabled_hover_text(tip)
                    .changed()
                {
                    settings.depth_offset = Some(offset);
                }
                if settings.depth_offset.is_some()
                    && ui
                        .small_button("usual")
                        .on_hover_text("Back to the usual one of the kind of splat (O)")
                        .on_disabled_hover_text("Back to the usual one of the kind of splat (O)")
                        .clicked()
                {
                    settings.depth_offset = None;
                }
            });
        });
        ui.end_row();
        choose_if(
            ui,
            has_splats,
            "size metric",
            choices::METRICS,
            &mut settings.size,
            "What the size of a node on screen is (E)",
        );
    });
    patches::show(ui, settings);
    vertices::show(ui, settings);
    section::show(ui, settings, state.facts, wishes);
    let mut holds_cut = settings.cut_view.is_some();
    ui.add_enabled_ui(settings.has_cut(), |ui| {
        let tip = "Keep drawing what this view asks for, to look at it from elsewhere (Y)";
        let change = ui
            .checkbox(&mut holds_cut, "hold the cut")
            .on_hover_text(tip)
            .on_disabled_hover_text(tip);
        if change.changed() {
            wishes.push(PanelWish::Command(KeyCommand::HoldCut));
        }
    });
    if let Some((px, ..)) = state.control
        && px > settings.threshold_px
    {
        ui.label(format!("now {px:.2} px, to keep the time of frames"));
    }
}

fn choose_if<T: Copy + PartialEq>(
    ui: &mut Ui,
    is_used: bool,
    what: &str,
    list: &[NamedChoice<T>],
    value: &mut T,
    tip: &str,
) {
    if is_used {
        choose(ui, what, list, value, tip);
        return;
    }
    ui.add_enabled_ui(false, |ui| ui.label(what));
    ui.add_enabled_ui(false, |ui| {
        ComboBox::from_id_salt(what)
            .selected_text(name_of(list, *value))
            .width(130.0)
            .show_ui(ui, |_| {})
            .response
            .on_disabled_hover_text(format!("{tip}\nNot used by what is drawn now."));
    });
    ui.end_row();
}

/// What the colors of overdraw mean, and the figures of the last frame.
fn legend(ui: &mut Ui, found: Option<OverdrawSummary>) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 0.0;
        let steps: Vec<(u32, [f32; 3], &str)> = overdraw::legend().collect();
        for (index, (count, color, name)) in steps.iter().enumerate() {
            let [r, g, b] = color.map(|c| (c * 255.0).round() as u8);
            let is_last = index + 1 == steps.len();
            let text = format!(" {count}{} ", if is_last { "+" } else { "" });
            let on_bright = 2 * index >= steps.len();
            let text = RichText::new(text)
                .monospace()
                .background_color(Color32::from_rgb(r, g, b))
                .color(if on_bright {
                    Color32::BLACK
                } else {
                    Color32::WHITE
                });
            let more = if is_last { " and more" } else { "" };
            ui.label(text).on_hover_text(format!(
                "{name}: {count}{more} splats and triangles in a pixel"
            ));
        }
    });
    if let Some(found) = found {
        let tip = "How many splats and triangles cover a pixel, over the pixels that any covers: the mean, and the most";
        ui.label(format!(
            "mean {:.2} a pixel, most {}",
            found.mean(),
            count(u64::from(found.most))
        ))
        .on_hover_text(tip);
    }
}

fn frame(ui: &mut Ui, state: &PanelState<'_>, wishes: &mut Vec<PanelWish>) {
    let counts = &state.counts;
    let now = state.control.map(|(_, target, _)| target);
    Grid::new("budget").num_columns(2).show(ui, |ui| {
        // One that the command line gave is in no list; its name is the time.
        let own = now.map(|ms| format!("{ms} ms")).unwrap_or_default();
        let mut list = choices::FRAME_TIMES.to_vec();
        if list.iter().all(|c| c.0 != now) {
            list.push((now, &own, "As it was asked for"));
        }
        let mut wanted = now;
        choose(
            ui,
            "hold frames to",
            &list,
            &mut wanted,
            "While the view moves, draw as coarsely as it takes to keep frames within this time (W, Shift W)",
        );
        if wanted != now {
            wishes.push(PanelWish::FrameTime(wanted));
        }
    });
    Grid::new("frame").num_columns(2).show(ui, |ui| {
        let ms = state.frame_ms;
        let rate = if ms > 0.0 { 1e3 / ms } else { 0.0 };
        fact(ui, "time", format!("{ms:.1} ms, {rate:.0} a second"));
        fact(ui, "splats", count(counts.splats));
        fact(ui, "triangles", count(counts.triangles));
        if counts.points > 0 {
            fact(ui, "points", count(counts.points));
        }
        fact(ui, "visited", count(counts.nodes_visited));
    });
    if let Some((_, target, report)) = state.control {
        let text = match report {
            BudgetReport::Adapting => format!("budget {target:.1} ms: adapting"),
            BudgetReport::Held => format!("budget {target:.1} ms: held"),
            BudgetReport::Unreachable(least) => {
                format!(
                    "budget {target:.1} ms cannot be reached: {least:.1} ms remain at any threshold"
                )
            }
        };
        ui.add(egui::Label::new(text).wrap());
    }
    if state.is_flying {
        ui.label("flying: W A S D, E up, Q down, G ends");
    }
}

pub mod keep;
mod lamp;
mod look;
pub mod measures;
pub mod overlay;
mod patches;
mod photographs;
pub mod point_colors;
pub mod section;
mod vertices;

pub use keep::KeepState;
pub use measures::MeasureState;
pub use photographs::{PhotographRow, PhotographState, PhotographWish};

#[cfg(test)]
mod tests;
