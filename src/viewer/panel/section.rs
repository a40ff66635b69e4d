//! The part of the panel for the section: a box that cuts what is drawn, in the coordinates of the file.

use super::overlay::OverlayPainter;
use super::{PanelFacts, PanelWish};
use crate::image::AXIS_COLORS;
use crate::math::section_box::SectionBox;
use crate::render::{Method, Settings};
use crate::viewer::input::KeyCommand;
use egui::{Color32, Context, DragValue, Stroke, Ui};

/// The box of a section and its handles, over the picture.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SectionMarks {
    /// Ends of the edges, pixels of the picture.
    pub edges: Vec<[[f32; 2]; 2]>,
    /// The handles.
    pub handles: Vec<HandleMark>,
}

/// A handle of a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandleMark {
    /// Middle of the handle, pixels of the picture.
    pub place: [f32; 2],
    /// The axis along which it moves: 0 to 2.
    pub axis: usize,
    /// State of being held, or under the cursor.
    pub is_lit: bool,
}

/// Paints the box and its handles over the picture, which begins `inset` pixels from the left.
pub(in crate::viewer) fn paint(
    context: &Context,
    marks: &SectionMarks,
    inset: f32,
    size: egui::Vec2,
) {
    let overlay = OverlayPainter::new(context, inset, size);
    let at = |place: [f32; 2]| overlay.at(place);
    let painter = &overlay.painter;
    for (color, width) in [
        (Color32::from_black_alpha(120), 3.0),
        (Color32::from_white_alpha(200), 1.0),
    ] {
        for &edge in &marks.edges {
            painter.line_segment(edge.map(at), Stroke::new(width, color));
        }
    }
    for mark in &marks.handles {
        let [r, g, b] = AXIS_COLORS[mark.axis];
        let radius = if mark.is_lit { 8.0 } else { 6.0 };
        painter.circle(
            at(mark.place),
            radius,
            Color32::from_rgb(r, g, b),
            Stroke::new(if mark.is_lit { 2.0 } else { 1.0 }, Color32::WHITE),
        );
    }
}

/// Steps from one side of the model to the other that dragging makes in a pixel each.
const STEPS: f64 = 300.0;

/// A box to tick, and the ends of the section while it is.
pub(super) fn show(
    ui: &mut Ui,
    settings: &mut Settings,
    facts: Option<&PanelFacts>,
    wishes: &mut Vec<PanelWish>,
) {
    let Some(facts) = facts else {
        return;
    };
    let bounds = facts.bounds;
    // What is on can be put off.
    let is_used =
        settings.section.is_some() || settings.has_cut() || settings.method == Method::Triangles;
    let mut is_on = settings.section.is_some();
    ui.add_enabled_ui(is_used, |ui| {
        let tip = "Cut away the nearer half, to look inside, or nothing again; drag the handles in the picture (Shift Y)";
        let change = ui
            .checkbox(&mut is_on, "section")
            .on_hover_text(tip)
            .on_disabled_hover_text(tip);
        if change.changed() {
            wishes.push(PanelWish::Command(KeyCommand::Section));
        }
    });
    let Some(own) = &mut settings.section else {
        return;
    };
    let shown = own.in_file(facts.origin);
    let mut ends = shown;
    egui::Grid::new("section").num_columns(3).show(ui, |ui| {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let (least, most) = (bounds[0][axis], bounds[1][axis]);
            let step = (most - least) / STEPS;
            ui.label(name);
            let [low, high] = ends.map(|end| end[axis]);
            for (end, range, tip) in [
                (
                    0,
                    least..=high.min(most),
                    "End of the section: nothing is drawn below",
                ),
                (
                    1,
                    low.max(least)..=most,
                    "End of the section: nothing is drawn above",
                ),
            ] {
                let value = &mut ends[end][axis];
                let drag = DragValue::new(value).range(range).speed(step);
                ui.add(drag.max_decimals(decimals_of(step)))
                    .on_hover_text(tip);
            }
            ui.end_row();
        }
    });
    if ends != shown {
        *own = SectionBox::of_file(ends, facts.origin);
    }
}

/// Decimals that show a step of dragging.
pub(super) fn decimals_of(step: f64) -> usize {
    let wanted = 1.0 - step.max(f64::MIN_POSITIVE).log10().floor();
    wanted.clamp(0.0, 9.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_show_each_step() {
        assert_eq!(decimals_of(0.5), 2);
        assert_eq!(decimals_of(40.0), 0);
        assert_eq!(decimals_of(0.0), 9);
    }
}
