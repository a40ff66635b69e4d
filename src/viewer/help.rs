//! The list of keys and the messages, as egui shows them.

use super::input::KEYS;
use super::notice::{NoticeList, NoticeWeight};
use egui::{Align2, Area, Color32, Context, Frame, RichText, ScrollArea, vec2};

/// Shows every key. Returns whether it is to be closed.
pub fn keys(context: &Context, size: egui::Vec2) -> bool {
    let mut is_closed = false;
    Area::new("keys".into())
        .anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0))
        .order(egui::Order::Foreground)
        .show(context, |ui| {
            Frame::window(ui.style()).inner_margin(14).show(ui, |ui| {
                ui.set_max_width((size.x - 60.0).clamp(200.0, 900.0));
                ui.horizontal(|ui| {
                    ui.heading("Keys and mouse");
                    is_closed = ui
                        .button("Close")
                        .on_hover_text("Close this list (?, F1 or Esc)")
                        .clicked();
                });
                ui.add_space(6.0);
                let columns = if size.x > 820.0 { 2 } else { 1 };
                ScrollArea::vertical()
                    .max_height((size.y - 120.0).max(80.0))
                    .show(ui, |ui| {
                        ui.columns(columns, |ui| {
                            for (index, (heading, keys)) in KEYS.iter().enumerate() {
                                // Drawing is the longest; it has a column of its own with the mouse.
                                let column =
                                    usize::from(columns == 2 && [1, 3, 5].contains(&index));
                                group(&mut ui[column], heading, keys);
                            }
                        });
                    });
            });
        });
    is_closed
}

fn group(ui: &mut egui::Ui, heading: &str, keys: &[(&str, &str)]) {
    ui.label(RichText::new(heading).strong().color(ACCENT));
    egui::Grid::new(heading)
        .num_columns(2)
        .spacing([12.0, 3.0])
        .show(ui, |ui| {
            for (key, what) in keys {
                ui.add_sized(
                    [104.0, 0.0],
                    egui::Label::new(RichText::new(*key).strong()).wrap(),
                );
                ui.add(egui::Label::new(*what).wrap());
                ui.end_row();
            }
        });
    ui.add_space(10.0);
}

/// The color of headings.
pub const ACCENT: Color32 = Color32::from_rgb(130, 190, 255);
const WARNING: Color32 = Color32::from_rgb(255, 170, 90);

/// Shows the messages at the lower edge, `left` and `right` points of which are taken. Returns which one was dismissed.
pub fn notices(
    context: &Context,
    notices: &NoticeList,
    size: egui::Vec2,
    (left, right): (f32, f32),
) -> Option<usize> {
    if notices.list().is_empty() {
        return None;
    }
    let mut dismissed = None;
    Area::new("messages".into())
        .anchor(Align2::LEFT_BOTTOM, vec2(left + 12.0, -12.0))
        .order(egui::Order::Foreground)
        .show(context, |ui| {
            let width = (size.x - left - right - 24.0).clamp(120.0, 560.0);
            for (index, notice) in notices.list().iter().enumerate() {
                let (color, fill) = match notice.weight {
                    NoticeWeight::Warning => {
                        (WARNING, Color32::from_rgba_unmultiplied(52, 28, 8, 240))
                    }
                    NoticeWeight::Info => {
                        (ACCENT, Color32::from_rgba_unmultiplied(14, 26, 42, 240))
                    }
                };
                Frame::new()
                    .fill(fill)
                    .stroke(egui::Stroke::new(1.0, color))
                    .corner_radius(4)
                    .inner_margin(8)
                    .show(ui, |ui| {
                        ui.set_width(width);
                        ui.horizontal_top(|ui| {
                            let close = ui
                                .small_button("✖")
                                .on_hover_text("Dismiss (Backspace or Esc)");
                            if close.clicked() {
                                dismissed = Some(index);
                            }
                            ui.add(egui::Label::new(&notice.text).wrap());
                        });
                    });
                ui.add_space(4.0);
            }
        });
    dismissed
}
