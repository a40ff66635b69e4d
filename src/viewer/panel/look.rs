//! The rows of the panel that say how surfaces look.

use super::{PanelWish, choose};
use crate::image::MarkChoice;
use crate::render::Settings;
use crate::viewer::choices::{self, SurfaceNormals, name_of};
use crate::viewer::input::KeyCommand;
use crate::viewer::lamp::{KINDS, LightKind};
use egui::{Grid, Ui};

/// Lets the user change how surfaces look.
pub(super) fn show(
    ui: &mut Ui,
    settings: &mut Settings,
    light: &mut LightKind,
    normals: &mut SurfaceNormals,
) {
    Grid::new("look").num_columns(2).show(ui, |ui| {
        choose(ui, "light", KINDS, light, "What lights the model (L)");
        choose(
            ui,
            "normals",
            choices::NORMALS,
            normals,
            "Normals of surfaces; another choice opens the files again (Shift S)",
        );
        choose(
            ui,
            "culling",
            choices::CULLINGS,
            &mut settings.culling,
            "Whether what faces away is dropped (B)",
        );
        choose(
            ui,
            "depth cue",
            choices::EYE_DOMES,
            &mut settings.eye_dome,
            "What is darkened where it lies behind its surroundings: eye-dome lighting (Shift B)",
        );
        choose(
            ui,
            "occlusion",
            choices::AMBIENT_OCCLUSIONS,
            &mut settings.ambient_occlusion,
            "What is darkened where its surroundings hide its sky: ambient occlusion (Shift A)",
        );
        choose(
            ui,
            "color by",
            choices::COLORS_BY,
            &mut settings.color_by,
            "What decides the color (C, Shift C)",
        );
        let tip = "Color behind the model (I: black, gray, white, gradient)";
        ui.label("background").on_hover_text(tip);
        ui.horizontal(|ui| {
            color(ui, &mut settings.background, tip);
            if let Some(bottom) = &mut settings.background_bottom {
                color(ui, bottom, "Color at the lower edge (I)");
            }
            let colors = (settings.background, settings.background_bottom);
            ui.label(name_of(choices::BACKGROUNDS, colors));
        });
        ui.end_row();
    });
    ui.horizontal(|ui| {
        ui.checkbox(&mut settings.two_sided, "light both sides")
            .on_hover_text("Light both sides of a surface, or fronts only (U)");
        ui.checkbox(&mut settings.use_colors, "vertex colors")
            .on_hover_text("Multiply by the colors of the vertices (V)");
    });
}

fn color(ui: &mut Ui, color: &mut [f32; 3], tip: &str) {
    let mut bytes = color.map(|c| (c * 255.0).round() as u8);
    let button = ui.color_edit_button_srgb(&mut bytes).on_hover_text(tip);
    if button.changed() {
        *color = bytes.map(|c| f32::from(c) / 255.0);
    }
}

/// Lets the user switch marks over the picture.
pub(super) fn marks(ui: &mut Ui, shown: MarkChoice, wishes: &mut Vec<PanelWish>) {
    ui.horizontal(|ui| {
        for (is_on, name, command, tip) in [
            (
                shown.scale_bar,
                "scale bar",
                KeyCommand::ScaleBar,
                "A bar of a round length, as long as that is at the middle of the model (Shift Z)",
            ),
            (
                shown.axes,
                "axes",
                KeyCommand::Axes,
                "The directions of x, y and z (Shift X)",
            ),
        ] {
            let mut is_on = is_on;
            if ui.checkbox(&mut is_on, name).on_hover_text(tip).changed() {
                wishes.push(PanelWish::Command(command));
            }
        }
    });
}
