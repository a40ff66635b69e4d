//! The part of the panel for splats that are made from the vertices of the mesh.

use crate::oriented::choices::{LEVELS, PATTERNS, RADII, WordedChoice};
use crate::oriented::resample::SampleChoice;
use crate::oriented::splats::SplatRules;
use crate::render::{Method, Settings};
use egui::{DragValue, Ui};

/// A box to tick, and their rules while it is.
pub(super) fn show(ui: &mut Ui, settings: &mut Settings) {
    let mut is_on = settings.vertex_splats.is_some();
    // What is on can be put off.
    let is_used = is_on || settings.method == Method::Splats;
    ui.add_enabled_ui(is_used, |ui| {
        let tip = "Draw splats at the vertices of the mesh, cut at sharp edges, instead of those of the tree (Shift D)";
        let change = ui
            .checkbox(&mut is_on, "splats from vertices")
            .on_hover_text(tip)
            .on_disabled_hover_text(tip);
        if change.changed() {
            settings.vertex_splats = is_on.then(SplatRules::usual);
        }
    });
    let Some(rules) = &mut settings.vertex_splats else {
        return;
    };
    ui.horizontal(|ui| {
        let tip =
            "Of vertices: faces within this angle of their mean share a splat, which is cut where others begin";
        angle(ui, &mut rules.clip, "cut", tip);
        if rules.samples.is_none() {
            let tip =
                "Of vertices: vertices with a face this far from their normal are drawn as their triangles";
            angle(ui, &mut rules.angle_test, "angle test", tip);
        }
    });
    if rules.samples.is_none() {
        values(ui, &mut rules.radius, &RADII.map(offered));
        values(ui, &mut rules.levels, &LEVELS.map(offered));
    }
    let at_vertices = OfferedValue {
        value: None,
        label: "at vertices",
        tip: "splats lie at the vertices",
    };
    let even = PATTERNS.map(|choice| {
        let OfferedValue { value, label, tip } = offered(choice);
        OfferedValue {
            value: Some(SampleChoice {
                pattern: value,
                spacing: None,
            }),
            label,
            tip,
        }
    });
    let samples = [[at_vertices].as_slice(), &even].concat();
    let before = rules.samples;
    values(ui, &mut rules.samples, &samples);
    if rules.samples.is_some() && before != rules.samples {
        // What even splats do not have.
        (rules.angle_test, rules.levels) = (None, None);
    }
}

/// A value with its words.
#[derive(Debug, Clone, Copy)]
struct OfferedValue<T> {
    value: T,
    label: &'static str,
    tip: &'static str,
}

fn offered<T>(choice: WordedChoice<T>) -> OfferedValue<T> {
    let WordedChoice {
        value, label, tip, ..
    } = choice;
    OfferedValue { value, label, tip }
}

/// Values beside each other, one of which is chosen.
fn values<T: PartialEq + Copy>(ui: &mut Ui, value: &mut T, all: &[OfferedValue<T>]) {
    ui.horizontal(|ui| {
        for one in all {
            ui.selectable_value(value, one.value, one.label)
                .on_hover_text(format!("Of vertices: {}", one.tip));
        }
    });
}

/// A box to tick, and an angle while it is.
fn angle(ui: &mut Ui, radians: &mut Option<f64>, name: &str, tip: &str) {
    let mut is_on = radians.is_some();
    if ui.checkbox(&mut is_on, name).on_hover_text(tip).changed() {
        *radians = is_on.then(|| SplatRules::USUAL_DEGREES.to_radians());
    }
    if let Some(radians) = radians {
        let mut degrees = radians.to_degrees();
        let drag = DragValue::new(&mut degrees)
            .range(0.0..=180.0)
            .speed(0.1)
            .max_decimals(1)
            .suffix("\u{b0}");
        if ui.add(drag).on_hover_text(tip).changed() {
            *radians = degrees.to_radians();
        }
    }
}
