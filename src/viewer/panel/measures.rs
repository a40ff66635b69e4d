//! Measures in the panel and over the picture, and the point under the cursor.

use super::overlay::OverlayPainter;
use super::{PanelWish, heading};
use crate::image::MarkedLines;
use crate::viewer::input::{KeyCommand, MeasureChange};
use crate::viewer::measuring::SeenPoint;
use egui::{Align2, Area, Color32, Context, FontId, Frame, Grid, RichText, Stroke, Ui, vec2};

/// What the panel shows of measures.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeasureState {
    /// A line of words for each.
    pub words: Vec<String>,
}

/// What is drawn over the picture, pixels of it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeasureMarks {
    /// Lines and places.
    pub lines: MarkedLines,
    /// Texts, and where.
    pub labels: Vec<([f32; 2], String)>,
}

const LINE: Color32 = Color32::from_rgb(255, 217, 26);

/// Lists them, where there are any.
pub(super) fn show(ui: &mut Ui, state: &MeasureState, wishes: &mut Vec<PanelWish>) {
    if state.words.is_empty() {
        return;
    }
    heading(ui, "Measures");
    for (index, words) in state.words.iter().enumerate() {
        ui.horizontal_top(|ui| {
            if ui
                .small_button("✖")
                .on_hover_text("Take this measure away")
                .clicked()
            {
                wishes.push(PanelWish::RemoveMeasure(index));
            }
            ui.add(egui::Label::new(words).wrap());
        });
    }
    ui.horizontal(|ui| {
        for (name, change, tip) in [
            (
                "new line",
                MeasureChange::End,
                "The next point begins another line (Ctrl N)",
            ),
            (
                "area",
                MeasureChange::Close,
                "Join the last point to the first, or not (Ctrl J)",
            ),
            (
                "undo",
                MeasureChange::Undo,
                "Take the last point away (Ctrl Z)",
            ),
            (
                "save",
                MeasureChange::Save,
                "Write all to surfel-measures-NNN.json (Ctrl S)",
            ),
        ] {
            if ui.button(name).on_hover_text(tip).clicked() {
                wishes.push(PanelWish::Command(KeyCommand::Measure(change)));
            }
        }
    });
}

/// Paints measures over the picture, which begins `inset` pixels from the left.
pub(in crate::viewer) fn paint(
    context: &Context,
    marks: &MeasureMarks,
    inset: f32,
    size: egui::Vec2,
) {
    if marks.lines.places.is_empty() {
        return;
    }
    let overlay = OverlayPainter::new(context, inset, size);
    let at = |place: [f32; 2]| overlay.at(place);
    let painter = &overlay.painter;
    for (color, more) in [(Color32::BLACK, 1.0), (LINE, 0.0)] {
        for line in &marks.lines.lines {
            painter.line_segment(line.map(at), Stroke::new(2.0 + 2.0 * more, color));
        }
        for &place in &marks.lines.places {
            painter.circle_filled(at(place), 3.5 + more, color);
        }
    }
    for (place, text) in &marks.labels {
        let font = FontId::proportional(14.0);
        let shadow = at(*place) + vec2(9.0, -7.0);
        painter.text(
            shadow,
            Align2::LEFT_BOTTOM,
            text,
            font.clone(),
            Color32::BLACK,
        );
        painter.text(
            shadow - vec2(1.0, 1.0),
            Align2::LEFT_BOTTOM,
            text,
            font,
            LINE,
        );
    }
}

/// Shows the point under the cursor at the upper right.
pub(in crate::viewer) fn point_info(context: &Context, seen: Option<&SeenPoint>) {
    let Some(seen) = seen else { return };
    Area::new("point".into())
        .anchor(Align2::RIGHT_TOP, vec2(-12.0, 12.0))
        .interactable(false)
        .show(context, |ui| {
            Frame::window(ui.style()).show(ui, |ui| {
                Grid::new("point").num_columns(2).show(ui, |ui| {
                    let places = ["x", "y", "z"].into_iter().zip(&seen.place);
                    let fields = seen
                        .fields
                        .iter()
                        .map(|(name, value)| (name.as_str(), value));
                    for (name, value) in places.chain(fields) {
                        ui.label(name);
                        ui.label(RichText::new(value).monospace());
                        ui.end_row();
                    }
                });
            });
        });
}
