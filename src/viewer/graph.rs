//! What the last frames cost, part by part, and a picture of it.

use super::control::TimeTaken;
use crate::gpu::frame::PassTime;
use crate::render::vulkan::renderer::FrameTimes;
use egui::{Align2, Color32, FontId, Rect, Stroke, Ui, pos2, vec2};
use std::collections::VecDeque;

/// How many frames are kept.
pub const FRAMES: usize = 240;
/// Most parts that have a color of their own.
const MOST_PARTS: usize = 12;
/// For how many frames the highest one is marked.
const HELD: u64 = FRAMES as u64;

/// A part of a frame: its name and milliseconds.
pub type GraphPart = (&'static str, f64);

/// The parts of a frame in the order in which they happen: the cut, writing draw lists, recording, the passes on
/// the device, and the rest of the waiting.
pub fn parts(times: &FrameTimes) -> Vec<GraphPart> {
    let mut parts = vec![
        ("cut", times.cut_ms),
        ("pack", times.pack_ms),
        ("submit", times.submit_ms),
    ];
    if times.host.look_ms > 0.0 {
        parts.push(("look", times.host.look_ms));
    }
    let mut passes = 0.0;
    for PassTime { name, ms } in &times.passes {
        passes += ms;
        match parts.iter_mut().find(|(known, _)| known == name) {
            Some((_, sum)) => *sum += ms,
            None => parts.push((name, *ms)),
        }
    }
    // The passes are done while the processor waits.
    parts.push(("wait", (times.wait_ms - passes).max(0.0)));
    parts
}

/// Passes that draw primitives, by the last part of their name; all others go over the picture.
const DRAWING: [&str; 6] = ["depth", "centers", "blend", "draw", "splats", "triangles"];

/// Work of a frame: on the processor before it was submitted, and on the device. Where it `overlaps` with that of the frames
/// before and after, the longer of the two counts. What a device takes that does not time its passes is that of drawing.
pub fn work(times: &FrameTimes, overlaps: bool) -> TimeTaken {
    let mut took = TimeTaken {
        cut_ms: times.cut_ms,
        pack_ms: times.pack_ms + times.upload_ms + times.submit_ms,
        picture_ms: times.host.look_ms,
        overlaps,
        ..TimeTaken::default()
    };
    if times.passes.is_empty() {
        took.draw_ms = times.wait_ms;
    }
    for PassTime { name, ms } in &times.passes {
        let last = name.rsplit('.').next().unwrap_or(name);
        if DRAWING.contains(&last) {
            took.draw_ms += ms;
        } else {
            took.picture_ms += ms;
        }
    }
    took
}

/// The last frames.
#[derive(Debug, Clone, Default)]
pub struct TimeHistory {
    frames: VecDeque<Vec<GraphPart>>,
    /// Names in the order in which they first came: each keeps its color.
    names: Vec<&'static str>,
    count: u64,
    /// The highest frame of late: its time and number.
    spike: Option<(f64, u64)>,
    is_frozen: bool,
}

fn sum(parts: &[GraphPart]) -> f64 {
    parts.iter().map(|(_, ms)| ms).sum()
}

impl TimeHistory {
    /// Adds a frame, unless frozen.
    pub fn add(&mut self, times: &FrameTimes) {
        if self.is_frozen {
            return;
        }
        let parts = parts(times);
        for (name, _) in &parts {
            if !self.names.contains(name) {
                self.names.push(name);
            }
        }
        let total = sum(&parts);
        self.count += 1;
        if self
            .spike
            .is_none_or(|(ms, at)| total >= ms || self.count - at > HELD)
        {
            self.spike = Some((total, self.count));
        }
        if self.frames.len() == FRAMES {
            self.frames.pop_front();
        }
        self.frames.push_back(parts);
    }

    /// Forgets everything, for another model or another way of drawing.
    pub fn clear(&mut self) {
        let is_frozen = self.is_frozen;
        *self = Self {
            is_frozen,
            ..Self::default()
        };
    }

    /// Stops, or goes on.
    pub fn toggle_frozen(&mut self) {
        self.is_frozen = !self.is_frozen;
    }

    /// Tells whether no frame is added.
    pub fn is_frozen(&self) -> bool {
        self.is_frozen
    }

    /// The highest frame of late, milliseconds.
    pub fn spike_ms(&self) -> Option<f64> {
        self.spike.map(|(ms, _)| ms)
    }

    /// Parts that were ever above zero, with the median over the frames, milliseconds.
    pub fn medians(&self) -> Vec<GraphPart> {
        let of = |name: &str, frame: &Vec<GraphPart>| {
            frame
                .iter()
                .find(|(n, _)| *n == name)
                .map_or(0.0, |(_, ms)| *ms)
        };
        self.names
            .iter()
            .map(|&name| {
                let times = self.frames.iter().map(|frame| of(name, frame));
                (name, super::text::median(times))
            })
            .filter(|(name, _)| self.frames.iter().any(|frame| of(name, frame) > 0.0))
            .collect()
    }

    fn color(&self, name: &str) -> Color32 {
        let index = self.names.iter().position(|n| *n == name).unwrap_or(0);
        COLORS[index % MOST_PARTS]
    }

    /// Draws the graph into the width that is left: frames from left to right, parts stacked, a line at
    /// `budget_ms`.
    pub fn show(&self, ui: &mut Ui, budget_ms: f64) {
        let text = ui.visuals().text_color();
        let faint = text.gamma_multiply(0.5);
        let font = FontId::proportional(12.0);
        let width = ui.available_width();
        let (rect, _) = ui.allocate_exact_size(vec2(width, 120.0), egui::Sense::hover());
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 2.0, Color32::from_black_alpha(120));
        let spike = self.spike_ms().unwrap_or(0.0);
        // The budget and the highest frame are both to be seen.
        let top = (1.15 * spike.max(budget_ms)).max(1.0);
        let y = |ms: f64| rect.bottom() - (ms / top) as f32 * rect.height();
        let bar = rect.width() / FRAMES as f32;
        let first = FRAMES - self.frames.len();
        for (index, frame) in self.frames.iter().enumerate() {
            let left = rect.left() + (first + index) as f32 * bar;
            let mut from = 0.0;
            for (name, ms) in frame {
                let to = from + ms;
                if *ms > 0.0 {
                    let part = Rect::from_min_max(pos2(left, y(to)), pos2(left + bar, y(from)));
                    painter.rect_filled(part, 0.0, self.color(name));
                }
                from = to;
            }
        }
        let line = |ms: f64, color: Color32, label: String, align: Align2| {
            let (left, right) = (rect.left(), rect.right());
            painter.hline(left..=right, y(ms), Stroke::new(1.0, color));
            let x = if align == Align2::LEFT_BOTTOM {
                left + 4.0
            } else {
                right - 4.0
            };
            painter.text(pos2(x, y(ms) - 1.0), align, label, font.clone(), color);
        };
        let amber = Color32::from_rgb(255, 210, 90);
        line(
            budget_ms,
            amber,
            format!("budget {budget_ms:.1} ms"),
            Align2::LEFT_BOTTOM,
        );
        if spike > 0.0 {
            line(
                spike,
                faint,
                format!("highest {spike:.1} ms"),
                Align2::RIGHT_BOTTOM,
            );
        }
        if self.is_frozen {
            let at = rect.center_top() + vec2(0.0, 4.0);
            painter.text(at, Align2::CENTER_TOP, "frozen (Z)", font.clone(), text);
        }
        ui.add_space(4.0);
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 6.0;
            for (name, ms) in self.medians() {
                // One unbroken label each, so that no line ends between color and name.
                let mut job = egui::text::LayoutJob::default();
                let format = |color| egui::TextFormat::simple(font.clone(), color);
                job.append("■ ", 0.0, format(self.color(name)));
                job.append(&format!("{name} {ms:.2} ms"), 0.0, format(text));
                ui.add(egui::Label::new(job).extend());
            }
        });
    }
}

/// Colors that can be told apart side by side, also by those who see few colors (after Okabe and Ito, 2008).
const COLORS: [Color32; MOST_PARTS] = [
    Color32::from_rgb(86, 180, 233),
    Color32::from_rgb(230, 159, 0),
    Color32::from_rgb(240, 228, 66),
    Color32::from_rgb(0, 158, 115),
    Color32::from_rgb(213, 94, 0),
    Color32::from_rgb(204, 121, 167),
    Color32::from_rgb(0, 114, 178),
    Color32::from_rgb(150, 150, 150),
    Color32::from_rgb(170, 220, 160),
    Color32::from_rgb(255, 170, 150),
    Color32::from_rgb(150, 130, 220),
    Color32::from_rgb(120, 90, 60),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(cut: f64, passes: &[(&'static str, f64)], wait: f64) -> FrameTimes {
        FrameTimes {
            cut_ms: cut,
            pack_ms: 1.0,
            submit_ms: 0.5,
            wait_ms: wait,
            passes: passes
                .iter()
                .map(|&(name, ms)| PassTime { name, ms })
                .collect(),
            ..FrameTimes::default()
        }
    }

    #[test]
    fn the_parts_of_a_frame_add_up() {
        let times = frame(2.0, &[("a", 3.0), ("b", 4.0), ("a", 1.0)], 10.0);
        let expected = [
            ("cut", 2.0),
            ("pack", 1.0),
            ("submit", 0.5),
            ("a", 4.0),
            ("b", 4.0),
            ("wait", 2.0),
        ];
        assert_eq!(parts(&times), expected);
        let ms = |times: &FrameTimes, overlaps| work(times, overlaps).ms();
        assert_eq!(ms(&times, false), 11.5);
        assert_eq!(ms(&times, true), 8.0, "the device is the slower one");
        assert_eq!(ms(&frame(20.0, &[("a", 3.0)], 10.0), true), 21.5);
        let untimed = frame(2.0, &[], 10.0);
        assert_eq!(ms(&untimed, false), 13.5, "no timestamps");
        let busy = parts(&frame(2.0, &[("a", 30.0)], 10.0));
        assert_eq!(busy.last(), Some(&("wait", 0.0)), "never below zero");
    }

    #[test]
    fn passes_that_draw_and_those_over_the_picture_are_told_apart() {
        let passes = [
            ("filtered.clear", 1.0),
            ("filtered.depth", 10.0),
            ("fuzzy.merge", 2.0),
            ("opaque.splats", 20.0),
            ("overlay", 4.0),
        ];
        let took = work(&frame(2.0, &passes, 40.0), false);
        let expected = TimeTaken {
            cut_ms: 2.0,
            pack_ms: 1.5,
            picture_ms: 7.0,
            draw_ms: 30.0,
            overlaps: false,
        };
        assert_eq!(took, expected);
        let untimed = work(&frame(2.0, &[], 40.0), true);
        assert_eq!((untimed.picture_ms, untimed.draw_ms), (0.0, 40.0));
    }

    #[test]
    fn the_highest_frame_is_held_and_then_let_go() {
        let mut history = TimeHistory::default();
        history.add(&frame(100.0, &[], 0.0));
        for _ in 0..FRAMES - 1 {
            history.add(&frame(1.0, &[("a", 2.0)], 2.0));
        }
        assert_eq!(history.spike_ms(), Some(101.5));
        assert_eq!(history.frames.len(), FRAMES);
        let medians = history.medians();
        assert_eq!(medians[0], ("cut", 1.0));
        assert!(medians.contains(&("a", 2.0)));
        assert!(medians.iter().all(|m| m.0 != "wait"), "nothing to show");
        history.add(&frame(1.0, &[], 0.0));
        history.add(&frame(1.0, &[], 0.0));
        assert_eq!(history.frames.len(), FRAMES);
        assert!(history.spike_ms() < Some(10.0), "let go");
        history.toggle_frozen();
        history.add(&frame(500.0, &[], 0.0));
        assert!(history.spike_ms() < Some(10.0), "frozen");
        history.clear();
        assert!(history.is_frozen() && history.medians().is_empty());
    }
}
