//! The part of the panel for the section: a box that cuts what is drawn, in the coordinates of the file.

use super::{PanelFacts, PanelWish};
use crate::math::section_box::SectionBox;
use crate::render::{Method, Settings};
use crate::viewer::input::KeyCommand;
use egui::{DragValue, Ui};

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
        let tip = "Cut away the nearer half, to look inside, or nothing again (Shift Y)";
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
fn decimals_of(step: f64) -> usize {
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
