//! The part of the panel for patches: nodes that are drawn as one polygon once their error is small.

use crate::render::{Blend, Method, Settings, SplatKind};
use egui::{DragValue, Ui};

/// A box to tick, and the tolerances while it is.
pub(super) fn show(ui: &mut Ui, settings: &mut Settings) {
    let is_opaque = settings.blend() == Blend::Opaque
        && matches!(
            settings.splat,
            SplatKind::Square | SplatKind::Disc | SplatKind::Ellipse
        );
    // What is on can be put off.
    let is_used = settings.patches.is_some() || (settings.method == Method::Pop && is_opaque);
    let mut is_on = settings.patches.is_some();
    ui.add_enabled_ui(is_used, |ui| {
        let tip = "Draw a node as one polygon, whatever its size, once it is wrong by less than the tolerances.\nThe first \
                   picture makes their records: seconds for each million triangles.";
        let change = ui
            .checkbox(&mut is_on, "error patches")
            .on_hover_text(tip)
            .on_disabled_hover_text(tip);
        if change.changed() {
            settings.patches = is_on.then(Default::default);
        }
    });
    let Some(rules) = &mut settings.patches else {
        return;
    };
    let tolerances = &mut rules.tolerances;
    ui.horizontal(|ui| {
        for (value, suffix, most, tip) in [
            (
                &mut tolerances.rim_px,
                " px",
                8.0,
                "Error of places at silhouettes",
            ),
            (
                &mut tolerances.inside_px,
                " px",
                8.0,
                "Error of places elsewhere",
            ),
            (
                &mut tolerances.shade_levels,
                " levels",
                64.0,
                "Error of the shade, grey levels of 255",
            ),
        ] {
            let drag = DragValue::new(value)
                .range(0.0..=most)
                .speed(most / 800.0)
                .max_decimals(2)
                .suffix(suffix);
            ui.add(drag).on_hover_text(tip);
        }
    });
    ui.checkbox(&mut rules.is_strict, "at every vertex")
        .on_hover_text("Hold the shade to its tolerance at every vertex, not on average");
    ui.checkbox(&mut rules.covers_rims, "covered rims")
        .on_hover_text(
            "Pixels at outlines show how much of them is covered, not what is at their centers",
        );
}
