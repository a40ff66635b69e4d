//! The part of the panel on photographs.

use super::{PanelWish, heading};
use crate::render::{PhotoDisplay, Settings};
use crate::viewer::choices;
use egui::{RichText, ScrollArea, Slider, Ui};

/// What the panel shows of photographs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PhotographState {
    /// Of each its name, whether it may be used, whether it is there, and whether the picture uses it.
    pub photos: Vec<(String, bool, bool, bool)>,
    /// Their poses are drawn in the picture.
    pub has_frusta: bool,
    /// The one in whose pose the camera is.
    pub pose: Option<usize>,
    /// Part of the picture that shows it as it is.
    pub compared: f32,
}

/// What the user asks of photographs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PhotographWish {
    /// Use one, or do not.
    Allow(usize, bool),
    /// Use all, or none.
    AllowAll(bool),
    /// Look from where it was taken.
    FlyTo(usize),
    /// Show it as it is in this part of the picture.
    Compare(f32),
    /// Draw the poses of all, or do not.
    Frusta(bool),
}

/// Height of the list, points.
const LIST_HEIGHT: f32 = 150.0;

/// Shows them.
pub(super) fn show(
    ui: &mut Ui,
    settings: &mut Settings,
    state: &PhotographState,
    wishes: &mut Vec<PanelWish>,
) {
    heading(ui, "Photographs");
    ui.horizontal(|ui| {
        for (shown, name, tip) in choices::PHOTOGRAPHS {
            ui.selectable_value(&mut settings.photos, *shown, *name)
                .on_hover_text(*tip);
        }
    });
    let is_on = settings.photos != PhotoDisplay::Off;
    let mut wish = |wish: PhotographWish| wishes.push(PanelWish::Photograph(wish));
    ui.horizontal(|ui| {
        ui.add_enabled_ui(is_on, |ui| {
            ui.checkbox(&mut settings.marks_uncovered, "mark uncovered")
                .on_hover_text(
                    "Mark surface that no photograph shows; else it keeps its shaded color",
                );
        });
        let mut has_frusta = state.has_frusta;
        ui.checkbox(&mut has_frusta, "poses")
            .on_hover_text("Draw where the photographs were taken");
        if has_frusta != state.has_frusta {
            wish(PhotographWish::Frusta(has_frusta));
        }
    });
    ui.horizontal(|ui| {
        let mut part = state.compared;
        let tip = "At the pose of a photograph: how much of the picture shows it as it is";
        ui.label("compare").on_hover_text(tip);
        ui.add_enabled(
            is_on && state.pose.is_some(),
            Slider::new(&mut part, 0.0..=1.0).show_value(false),
        )
        .on_hover_text(tip)
        .on_disabled_hover_text(tip);
        if part != state.compared {
            wish(PhotographWish::Compare(part));
        }
    });
    ui.horizontal(|ui| {
        if ui
            .button("all")
            .on_hover_text("Use all photographs")
            .clicked()
        {
            wish(PhotographWish::AllowAll(true));
        }
        if ui
            .button("none")
            .on_hover_text("Use no photograph")
            .clicked()
        {
            wish(PhotographWish::AllowAll(false));
        }
        let used = state.photos.iter().filter(|(.., is_used)| *is_used).count();
        ui.label(format!("{used} of {} used", state.photos.len()));
    });
    ScrollArea::vertical()
        .id_salt("photographs")
        .max_height(LIST_HEIGHT)
        .show(ui, |ui| {
            for (index, (name, is_allowed, is_there, is_used)) in state.photos.iter().enumerate() {
                ui.horizontal(|ui| {
                    let mut is_on = *is_allowed;
                    ui.add_enabled(*is_there, egui::Checkbox::without_text(&mut is_on))
                        .on_hover_text("Use this photograph")
                        .on_disabled_hover_text("It is not there");
                    if is_on != *is_allowed {
                        wish(PhotographWish::Allow(index, is_on));
                    }
                    let text = RichText::new(name);
                    let text = if *is_used { text.strong() } else { text };
                    let is_pose = state.pose == Some(index);
                    if ui
                        .selectable_label(is_pose, text)
                        .on_hover_text("Look from where it was taken")
                        .clicked()
                    {
                        wish(PhotographWish::FlyTo(index));
                    }
                });
            }
        });
}
