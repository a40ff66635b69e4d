//! The rows of the panel that move the lamp.

use super::PanelWish;
use crate::pack::{Lamp, Phong};
use crate::viewer::input::KeyCommand;
use crate::viewer::lamp::{FARTHEST, LampChange, SHININESS, degrees, from_camera};
use egui::{ComboBox, DragValue, Grid, Slider, Ui};
use glam::DVec3;
use std::ops::RangeInclusive;

/// Lets the user change the lamp, of a model of this radius.
pub(super) fn show(ui: &mut Ui, phong: &mut Phong, radius: f64, wishes: &mut Vec<PanelWish>) {
    Grid::new("lamp").num_columns(2).show(ui, |ui| {
        let is_in_world = matches!(phong.lamp, Lamp::At(_));
        let tip = "Whether the lamp goes along when the view turns (Shift L)";
        ui.label("lamp").on_hover_text(tip);
        let names = ["goes with the viewer", "stays in the world"];
        let mut wanted = is_in_world;
        ComboBox::from_id_salt("lamp")
            .selected_text(names[usize::from(is_in_world)])
            .width(160.0)
            .show_ui(ui, |ui| {
                for (choice, name) in [(false, names[0]), (true, names[1])] {
                    ui.selectable_value(&mut wanted, choice, name);
                }
            })
            .response
            .on_hover_text(tip);
        ui.end_row();
        if wanted != is_in_world {
            wishes.push(PanelWish::Command(KeyCommand::Lamp(LampChange::Anchor)));
        }
        match phong.lamp {
            Lamp::FromCamera { azimuth, elevation } => {
                let (mut azimuth, mut elevation) = (degrees(azimuth), degrees(elevation));
                let old = (azimuth, elevation);
                ui.label("from")
                    .on_hover_text("Where the light comes from, as the camera sees it (Arrows)");
                ui.horizontal(|ui| {
                    for (value, range, tip) in [
                        (
                            &mut azimuth,
                            -180.0..=180.0,
                            "From the right, degrees; below 0 from the left (Arrows, Ctrl + left drag)",
                        ),
                        (
                            &mut elevation,
                            -90.0..=90.0,
                            "From above, degrees; below 0 from below (Arrows, Ctrl + left drag)",
                        ),
                    ] {
                        let value = DragValue::new(value)
                            .range(range)
                            .speed(0.5)
                            .max_decimals(1)
                            .suffix("°");
                        ui.add(value).on_hover_text(tip);
                    }
                });
                ui.end_row();
                // Only what was changed: other angles keep their last bits.
                if (azimuth, elevation) != old {
                    phong.lamp = from_camera(azimuth, elevation);
                }
            }
            Lamp::At(position) => {
                let mut place = position.to_array();
                ui.label("at")
                    .on_hover_text("Place of the lamp in the world (Arrows, Page Up, Page Down)");
                ui.horizontal(|ui| {
                    ui.spacing_mut().item_spacing.x = 3.0;
                    for (value, axis) in place.iter_mut().zip(["x", "y", "z"]) {
                        let field = DragValue::new(value)
                            .range(-FARTHEST..=FARTHEST)
                            .speed(0.02 * radius.max(1e-9))
                            .custom_formatter(|value, _| short(value));
                        ui.add(field).on_hover_text(format!(
                            "The lamp's {axis} in the world (Arrows, Page Up, Page Down)"
                        ));
                    }
                });
                ui.end_row();
                phong.lamp = Lamp::At(DVec3::from(place));
            }
        }
        let part = 0.0..=1.0;
        amount(
            ui,
            "ambient",
            &mut phong.ambient,
            part.clone(),
            "Part of the lamp's light that comes from everywhere (Ctrl Home, Ctrl End)",
        );
        amount(
            ui,
            "specular",
            &mut phong.specular,
            part,
            "Strength of the highlight (Home, End)",
        );
        amount(
            ui,
            "shininess",
            &mut phong.shininess,
            SHININESS,
            "Exponent of the highlight: larger is smaller (Shift Home, Shift End)",
        );
    });
}

/// A number with five digits, as there is room for.
fn short(value: f64) -> String {
    match value.abs() {
        size if size < 1e-3 && size > 0.0 || size >= 1e5 => format!("{value:.2e}"),
        size => {
            let decimals = match size {
                s if s < 10.0 => 3,
                s if s < 100.0 => 2,
                s if s < 1000.0 => 1,
                _ => 0,
            };
            format!("{value:.decimals$}")
        }
    }
}

fn amount(ui: &mut Ui, what: &str, value: &mut f32, range: RangeInclusive<f32>, tip: &str) {
    ui.label(what).on_hover_text(tip);
    ui.horizontal(|ui| {
        ui.spacing_mut().slider_width = 90.0;
        let is_wide = *range.end() > 10.0;
        let slider = Slider::new(value, range.clone())
            .logarithmic(is_wide)
            .show_value(false);
        ui.add(slider).on_hover_text(tip);
        let field = DragValue::new(value)
            .range(range)
            .speed(if is_wide { 0.5 } else { 0.005 })
            .max_decimals(2);
        ui.add(field).on_hover_text(tip);
    });
    ui.end_row();
}
