//! The section of the window: a box in the coordinates of the file that what is drawn is cut by.

use super::ViewerApp;
use crate::math::section_box::SectionBox;
use crate::render::Settings;
use crate::tree::Model;
use glam::DVec3;

impl ViewerApp {
    /// Cuts away the half of the model that is nearer to the eye, along the axis that the view is closest to; or nothing again.
    pub(super) fn switch_section(&mut self) {
        let section = match (self.settings.section, &self.facts, self.camera()) {
            (None, Some(facts), Some(camera)) => {
                let to_eye = camera.view.row(2).truncate();
                let ends = farther_half(facts.bounds, to_eye);
                Some(SectionBox::of_file(ends, facts.origin))
            }
            (None, ..) => return,
            (Some(_), ..) => None,
        };
        self.wish(Settings {
            section,
            ..self.settings
        });
    }
}

/// Half of a box that lies away from an eye in this direction, along the direction's greatest coordinate.
fn farther_half([mut low, mut high]: [DVec3; 2], to_eye: DVec3) -> [DVec3; 2] {
    let axis = to_eye.abs().max_position();
    let middle = 0.5 * (low[axis] + high[axis]);
    match to_eye[axis] > 0.0 {
        true => high[axis] = middle,
        false => low[axis] = middle,
    }
    [low, high]
}

/// Least and greatest coordinates of models in those of the file of the first, whose origin all have.
pub(super) fn bounds_of(models: &[&Model]) -> [DVec3; 2] {
    let ends = models
        .iter()
        .map(|model| [model.min, model.max].map(|end| end.as_dvec3() + model.origin));
    let both = |[a, b]: [DVec3; 2], [c, d]: [DVec3; 2]| [a.min(c), b.max(d)];
    ends.reduce(both).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearer_half_is_cut_away() {
        let whole = [DVec3::ZERO, DVec3::new(2.0, 4.0, 6.0)];
        let from = |x, y, z| farther_half(whole, DVec3::new(x, y, z));
        assert_eq!(
            from(0.1, 0.2, 0.9),
            [DVec3::ZERO, DVec3::new(2.0, 4.0, 3.0)]
        );
        assert_eq!(from(0.1, -0.9, 0.2), [DVec3::new(0.0, 2.0, 0.0), whole[1]]);
    }
}
