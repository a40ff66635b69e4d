//! Panel, graph, list of keys and messages over the picture.
//!
//! While the panel is shown, the picture is as wide as the panel leaves, and the model is framed in what is seen; camera,
//! screenshots and photos are those of a window of that width. So no picture on file has a panel on it.

use super::ViewerApp;
use super::poses::{paint_map, paint_poses};
use crate::image::PictureMarks;
use crate::math::camera::Camera;
use crate::pack::ColorBy;
use crate::viewer::panel::overlay::OverlayPainter;
use crate::viewer::panel::{self, PanelState, PanelWish, measures, section};
use crate::viewer::{ViewerError, help};
use egui::{Align2, Area, Frame, vec2};
use glam::{DVec2, Vec3};

/// Width of the graph, points.
const GRAPH_WIDTH: f32 = 380.0;

impl ViewerApp {
    /// Columns at the left of the window that belong to the panel alone, pixels: the picture is drawn beside it. Where that
    /// would be narrower than half of the panel, the panel covers the picture instead.
    pub(super) fn inset(&self) -> u32 {
        let panel = if self.has_panel {
            self.interface.pixels(panel::WIDTH)
        } else {
            0
        };
        let is_beside = self.size.0 >= panel + panel / 2;
        if is_beside { panel } else { 0 }
    }

    /// Width and height of the picture in the window, pixels; at least 1.
    pub(super) fn picture_size(&self) -> (u32, u32) {
        ((self.size.0 - self.inset()).max(1), self.size.1.max(1))
    }

    /// Where a place in the window lies in the picture.
    pub(super) fn in_picture(&self, [x, y]: [f64; 2]) -> DVec2 {
        DVec2::new(x - f64::from(self.inset()), y)
    }

    /// Fits picture and camera into what the panel leaves of the window.
    pub(in crate::viewer) fn lay_out(&mut self) {
        let (inset, size) = (self.inset(), self.picture_size());
        if inset != self.laid_inset {
            // The cursor has not moved, but the picture below it.
            let by = f64::from(self.laid_inset) - f64::from(inset);
            let _ = self
                .mouse
                .moved(self.mouse.position() + DVec2::new(by, 0.0));
            self.laid_inset = inset;
            self.is_dirty = true;
        }
        if let Some(orbit) = &mut self.orbit {
            orbit.resize(size);
        }
    }

    /// Marks over the present picture; none without a model.
    pub(super) fn picture_marks(&self) -> PictureMarks {
        let camera = self.camera();
        camera.map_or_else(PictureMarks::default, |camera| self.marks_of(&camera))
    }

    /// Marks over the picture of a camera.
    pub(super) fn marks_of(&self, camera: &Camera) -> PictureMarks {
        let marks = self.screen.orbit_sphere().and_then(|sphere| {
            // Relative to the middle of the model, which is where the bar has its length.
            let view = camera.view(sphere.center).ok()?;
            let mut marks = PictureMarks::new(&view, self.marks, Vec3::ZERO, None);
            let shows_colors =
                self.settings.use_colors && self.settings.color_by == ColorBy::Shading;
            if let Some(legend) = self.legend.as_ref().filter(|_| shows_colors) {
                marks.add_legend(legend, 0.0);
            }
            Some(marks)
        });
        marks.unwrap_or_default()
    }

    /// Lets egui lay out and paint, does what the user asked for, and hands the triangles to the screen.
    pub(super) fn paint_cover(&mut self) -> Result<(), ViewerError> {
        if !self.is_cover_dirty && !self.is_dirty {
            return Ok(());
        }
        self.is_cover_dirty = false;
        let mut wishes: Vec<PanelWish> = Vec::new();
        let mut dismissed = None;
        let mut closes_help = false;
        let size = self.interface.size_in_points();
        let control = self
            .control
            .as_ref()
            .map(|c| (c.threshold_px(), c.target_ms(), c.report()));
        let state = PanelState {
            settings: &self.settings,
            light: self.light_kind(),
            normals: self.normals,
            recent: self.recent.files(),
            radius: self.around().map_or(1.0, |(_, radius)| radius),
            facts: self.facts.as_ref(),
            status: self.status.as_deref().or(self.page_status.as_deref()),
            frame_ms: self.screen.frame_ms(),
            counts: self.screen.times().counts,
            overdraw: self.screen.times().overdraw,
            control,
            marks: self.marks,
            is_flying: self.fly.is_some(),
            parts: (self.part_names.iter().map(String::as_str))
                .zip(self.screen.shown().iter().copied())
                .collect(),
            photographs: self.photograph_state(),
            measures: self.measure_state(),
            keep: self.keep_state(),
        };
        let poses = self.poses();
        let pose_map = self.pose_map();
        let measure_marks = self.measure_marks();
        let section_marks = self.section_marks();
        let marks = self.picture_marks();
        let inset = self.inset() as f32;
        let left = if self.has_panel { panel::WIDTH } else { 0.0 };
        let budget = control.map_or(1000.0 / 60.0, |(_, ms, _)| ms);
        let painted = self.interface.run(self.time, |ui| {
            let context = ui.ctx();
            paint_poses(context, &poses, inset, size);
            if let Some(map) = &pose_map {
                paint_map(context, map, inset, size);
            }
            section::paint(context, &section_marks, inset, size);
            measures::paint(context, &measure_marks, inset, size);
            measures::point_info(context, self.measuring.seen());
            paint_marks(context, &marks, inset, size);
            if self.has_panel {
                wishes = panel::show(context, &state, size.y);
            }
            if self.has_graph {
                Area::new("graph".into())
                    .anchor(Align2::RIGHT_BOTTOM, vec2(-12.0, -12.0))
                    .show(context, |ui| {
                        Frame::window(ui.style()).show(ui, |ui| {
                            ui.set_width(GRAPH_WIDTH.min(size.x - 40.0).max(100.0));
                            self.history.show(ui, budget);
                        });
                    });
            }
            // Beside the graph, which has the other corner.
            let right = if self.has_graph {
                GRAPH_WIDTH + 40.0
            } else {
                0.0
            };
            dismissed = help::notices(context, &self.notices, size, (left, right));
            if self.has_help {
                closes_help = help::keys(context, size);
            }
        });
        self.again_at = painted.again_in.map(|seconds| self.time + seconds);
        if painted.again_in == Some(0.0) {
            self.again_at = None;
            self.is_cover_dirty = true;
        }
        if let Some(text) = &painted.copied {
            self.asks.push(super::FileAsk::Copy(text.clone()));
        }
        self.screen.cover(painted)?;
        if closes_help {
            self.has_help = false;
            self.is_cover_dirty = true;
        }
        if let Some(index) = dismissed {
            self.notices.dismiss(index);
            self.is_cover_dirty = true;
        }
        for wish in wishes {
            self.is_cover_dirty = true;
            match wish {
                PanelWish::Command(command) => self.command(command)?,
                PanelWish::Settings(settings) => self.wish(*settings),
                PanelWish::Light(light) => self.set_light(light),
                PanelWish::Normals(normals) => self.set_normals(normals),
                PanelWish::Open(path) => self.open(path, Vec::new()),
                PanelWish::RemoveMeasure(index) => self.measuring.remove(index),
                PanelWish::Keep(text) => self.keep(&text),
                PanelWish::ColorPoints(setting) => self.color_points(setting),
                PanelWish::FrameTime(ms) => self.set_frame_time(ms),
                PanelWish::Photograph(wish) => self.photograph_wish(wish),
                PanelWish::Show { part, is_shown } => {
                    self.screen.show(part, is_shown);
                    self.is_dirty = true;
                }
            }
        }
        Ok(())
    }
}

/// Paints marks over the picture, which begins `inset` pixels from the left.
fn paint_marks(context: &egui::Context, marks: &PictureMarks, inset: f32, size: egui::Vec2) {
    if marks.lines.is_empty() && marks.texts.is_empty() {
        return;
    }
    let overlay = OverlayPainter::new(context, inset, size);
    let (place, scale) = (|place: [f32; 2]| overlay.at(place), overlay.scale);
    let painter = &overlay.painter;
    let outline = egui::Color32::from_rgb(20, 20, 20);
    for is_outline in [true, false] {
        for line in &marks.lines {
            let [r, g, b] = line.color;
            let stroke = match is_outline {
                true => egui::Stroke::new(4.0, outline),
                false => egui::Stroke::new(1.8, egui::Color32::from_rgb(r, g, b)),
            };
            painter.line_segment(line.ends.map(place), stroke);
        }
    }
    for text in &marks.texts {
        let [r, g, b] = text.color;
        let font = egui::FontId::monospace(13.0 * marks.size as f32 / scale.max(1.0));
        let middle = place(text.middle);
        let around = (-1..=1).flat_map(|y| (-1..=1).map(move |x| (x, y)));
        for (x, y) in around.filter(|&at| at != (0, 0)) {
            let at = middle + vec2(x as f32, y as f32);
            painter.text(at, Align2::CENTER_CENTER, &text.text, font.clone(), outline);
        }
        let color = egui::Color32::from_rgb(r, g, b);
        painter.text(middle, Align2::CENTER_CENTER, &text.text, font, color);
    }
}
