//! The part of the panel for the colors of points: what they stand for, and from which value to which.

use super::PanelWish;
use super::section::decimals_of;
use crate::input::{ColorSetting, PointColoring};
use egui::{ComboBox, DragValue, Ui};

/// State of it that the panel shows.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointColorState {
    /// Quantities that colors can stand for.
    pub choices: Vec<PointColoring>,
    /// Quantity that colors stand for; `None` for those that the models were opened with.
    pub by: Option<PointColoring>,
    /// Name of what they stand for as they were opened.
    pub opened_by: Option<String>,
    /// Values of the first and the last color, where they stand for a quantity.
    pub range: Option<[f64; 2]>,
}

/// Steps from one end of a range to the other that dragging makes in a pixel each.
const STEPS: f64 = 300.0;

/// A list of attributes, and the ends of the range.
pub(super) fn show(ui: &mut Ui, state: &PointColorState, wishes: &mut Vec<PanelWish>) {
    if state.choices.is_empty() {
        return;
    }
    let tip = "What the colors of points stand for: those of the file, the height, or anything that points carry (Ctrl A: the next)";
    let as_opened = match &state.opened_by {
        Some(name) => format!("{name}, as opened"),
        None => "own colors".to_owned(),
    };
    let name = |by: Option<&PointColoring>| by.map_or(as_opened.clone(), ToString::to_string);
    let mut by = state.by.clone();
    ui.horizontal(|ui| {
        ui.label("points by").on_hover_text(tip);
        ComboBox::from_id_salt("points by")
            .selected_text(name(by.as_ref()))
            .width(130.0)
            .show_ui(ui, |ui| {
                let all = [None].into_iter().chain(state.choices.iter().map(Some));
                for choice in all {
                    ui.selectable_value(&mut by, choice.cloned(), name(choice));
                }
            })
            .response
            .on_hover_text(tip);
    });
    if by != state.by {
        let setting = by.map(|by| ColorSetting { by, range: None });
        wishes.push(PanelWish::ColorPoints(setting));
        return;
    }
    if let (Some(by), Some(range)) = (&state.by, state.range) {
        range_of(ui, by, range, wishes);
    }
}

/// The ends of the range, which take effect once they are no more dragged or written.
fn range_of(ui: &mut Ui, by: &PointColoring, shown: [f64; 2], wishes: &mut Vec<PanelWish>) {
    let id = ui.id().with("color range");
    let (mut now, of) = ui
        .data(|data| data.get_temp::<([f64; 2], [f64; 2])>(id))
        .filter(|(_, of)| *of == shown)
        .unwrap_or((shown, shown));
    let mut is_done = false;
    let step = (shown[1] - shown[0]).abs().max(f64::MIN_POSITIVE) / STEPS;
    ui.horizontal(|ui| {
        for (end, tip) in [
            (0, "Values of points up to here have the first color"),
            (1, "Values of points from here on have the last color"),
        ] {
            let drag = DragValue::new(&mut now[end]).speed(step);
            let drag = drag.max_decimals(decimals_of(step));
            let response = ui.add(drag).on_hover_text(tip);
            is_done |= response.drag_stopped() || response.lost_focus();
        }
    });
    ui.data_mut(|data| data.insert_temp(id, (now, of)));
    if is_done && now != shown {
        let [a, b] = now;
        wishes.push(PanelWish::ColorPoints(Some(ColorSetting {
            by: by.clone(),
            range: Some([a.min(b), a.max(b)]),
        })));
    }
}
