//! The part of the panel on photographs.

use super::{PanelWish, heading};
use crate::projective::pyramid::{PhotoPixels, PhotoPyramid};
use crate::render::{PhotoDisplay, Settings};
use crate::viewer::choices;
use egui::{RichText, ScrollArea, Slider, Ui, Vec2};
use std::sync::Arc;

/// A photograph of the list.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PhotographRow {
    /// Name of its file.
    pub name: String,
    /// The photograph may be used.
    pub is_allowed: bool,
    /// The picture uses it.
    pub is_used: bool,
    /// A small picture of it; `None` where it is not there.
    pub thumbnail: Option<Arc<PhotoPyramid>>,
}

/// What the panel shows of photographs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PhotographState {
    /// All of the scene.
    pub photos: Vec<PhotographRow>,
    /// Poses of the photographs are drawn in the picture.
    pub has_frusta: bool,
    /// A map of their poses is shown.
    pub has_radar: bool,
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
    /// Show a map of them, or do not.
    Radar(bool),
}

/// Height of the list, points.
const LIST_HEIGHT: f32 = 190.0;

/// Longest side of a small picture in the list, points.
const THUMBNAIL_SIDE: f32 = 44.0;

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
        ui.checkbox(&mut has_frusta, "poses").on_hover_text(
            "Draw where the photographs were taken; a click on one looks from there",
        );
        if has_frusta != state.has_frusta {
            wish(PhotographWish::Frusta(has_frusta));
        }
        let mut has_radar = state.has_radar;
        ui.checkbox(&mut has_radar, "map")
            .on_hover_text("Show from above where the photographs and the camera are");
        if has_radar != state.has_radar {
            wish(PhotographWish::Radar(has_radar));
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
        let used = state.photos.iter().filter(|row| row.is_used).count();
        ui.label(format!("{used} of {} used", state.photos.len()));
    });
    ScrollArea::vertical()
        .id_salt("photographs")
        .max_height(LIST_HEIGHT)
        .show(ui, |ui| {
            for (index, row) in state.photos.iter().enumerate() {
                let is_pose = state.pose == Some(index);
                ui.horizontal(|ui| show_row(ui, (index, row), is_pose, &mut wish));
            }
        });
}

/// Shows a photograph of the list.
fn show_row(
    ui: &mut Ui,
    (index, row): (usize, &PhotographRow),
    is_pose: bool,
    wish: &mut impl FnMut(PhotographWish),
) {
    let mut is_on = row.is_allowed;
    ui.add_enabled(
        row.thumbnail.is_some(),
        egui::Checkbox::without_text(&mut is_on),
    )
    .on_hover_text("Use this photograph")
    .on_disabled_hover_text("It is not there");
    if is_on != row.is_allowed {
        wish(PhotographWish::Allow(index, is_on));
    }
    let tip = "Look from where it was taken";
    if let Some(texture) = row
        .thumbnail
        .as_ref()
        .and_then(|own| texture_of(ui, index, own))
    {
        let size = Vec2::splat(THUMBNAIL_SIDE);
        let image = egui::Image::new(&texture)
            .fit_to_exact_size(size)
            .sense(egui::Sense::click());
        if ui.add(image).on_hover_text(tip).clicked() {
            wish(PhotographWish::FlyTo(index));
        }
    }
    let text = RichText::new(&row.name);
    let text = if row.is_used { text.strong() } else { text };
    let label = ui.selectable_label(is_pose, text).on_hover_text(tip);
    if label.clicked() {
        wish(PhotographWish::FlyTo(index));
    }
}

/// The small picture of a photograph as a texture, made once.
fn texture_of(ui: &Ui, index: usize, photo: &Arc<PhotoPyramid>) -> Option<egui::TextureHandle> {
    let id = egui::Id::new(("photograph", index));
    type Kept = (Arc<PhotoPyramid>, egui::TextureHandle);
    let kept: Option<Kept> = ui.data(|data| data.get_temp(id));
    if let Some((_, texture)) = kept.filter(|(own, _)| Arc::ptr_eq(own, photo)) {
        return Some(texture);
    }
    // The first level that is no larger than its place at twice the scale.
    let is_small =
        |level: &&PhotoPixels| level.width.max(level.height) as f32 <= 2.0 * THUMBNAIL_SIDE;
    let level = (photo.levels.iter().find(is_small)).or(photo.levels.last())?;
    let pixels = level
        .rgb
        .iter()
        .map(|[r, g, b]| egui::Color32::from_rgb(*r, *g, *b));
    let image = egui::ColorImage::new(
        [level.width as usize, level.height as usize],
        pixels.collect(),
    );
    let texture = (ui.ctx()).load_texture(
        format!("photograph {index}"),
        image,
        egui::TextureOptions::LINEAR,
    );
    ui.data_mut(|data| data.insert_temp(id, (photo.clone(), texture.clone())));
    Some(texture)
}
