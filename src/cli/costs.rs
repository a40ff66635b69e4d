//! Costs of drawing, for commands that draw.

use surfel::bench::calibrate;
use surfel::render::Settings;
use surfel::render::cost::model::DrawCosts;
use surfel::render::engine::Backend;

/// Costs of drawing on the device that is to draw with these settings, measured now if they never were: the engine's to
/// decide by. `None` of the reference.
pub(crate) fn costs_of(backend: &Backend, settings: &[Settings]) -> Option<DrawCosts> {
    let decided: Vec<Settings> = (settings.iter())
        .filter(|settings| !backend.draws_by_cpu(settings))
        .copied()
        .collect();
    match decided.is_empty() {
        true => None,
        false => calibrate::for_use(backend.device()?, &decided),
    }
}
