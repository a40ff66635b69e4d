//! The section of the window: a box in the coordinates of the file that what is drawn is cut by.

use super::ViewerApp;
use crate::math::camera::View;
use crate::math::section_box::SectionBox;
use crate::render::Settings;
use crate::tree::Model;
use crate::viewer::panel::section::{HandleMark, SectionMarks};
use crate::viewer::section_handles::{SectionDrag, SectionFace, SectionHandles};
use glam::{DVec2, DVec3};

/// Handles of the section in the window.
#[derive(Debug, Default)]
pub(super) struct SectionTool {
    /// The one that is dragged.
    drag: Option<SectionDrag>,
    /// The one under the cursor.
    near: Option<SectionFace>,
}

impl ViewerApp {
    /// Handles of the section in the picture; none without a section or a model.
    fn section_handles(&self) -> Option<(SectionHandles, View)> {
        let (section, facts) = (self.settings.section?, self.facts.as_ref()?);
        let whole = SectionBox::of_file(facts.bounds, facts.origin);
        Some((
            SectionHandles::new(&section, whole),
            self.view_of_picture()?,
        ))
    }

    /// Takes hold of the handle at a place in the picture. Tells whether there is one: a drag moves it then.
    pub(super) fn grab_section(&mut self, at: DVec2) -> bool {
        let handles = self.section_handles();
        self.section_tool.drag = handles.and_then(|(own, view)| own.grab(&view, at));
        self.section_tool.drag.is_some()
    }

    /// Lets go of the handle that is held.
    pub(super) fn release_section(&mut self) {
        self.is_cover_dirty |= self.section_tool.drag.take().is_some();
    }

    /// Tells whether a handle is held.
    pub(super) fn holds_section(&self) -> bool {
        self.section_tool.drag.is_some()
    }

    /// Moves the face that is held to where the cursor is.
    pub(super) fn drag_section(&mut self) {
        let at = self.mouse.position();
        if let (Some((own, view)), Some(drag)) = (self.section_handles(), self.section_tool.drag)
            && let Some(section) = own.dragged(&view, drag, at)
        {
            self.wish(Settings {
                section: Some(section),
                ..self.settings
            });
            self.is_cover_dirty = true;
        }
    }

    /// Lights the handle under the cursor.
    pub(super) fn look_for_section(&mut self) {
        let at = self.mouse.position();
        let near = (self.section_handles()).and_then(|(own, view)| own.at(&view, at));
        self.is_cover_dirty |= near != self.section_tool.near;
        self.section_tool.near = near;
    }

    /// Box and handles as they are painted over the picture.
    pub(super) fn section_marks(&self) -> SectionMarks {
        let Some((own, view)) = self.section_handles() else {
            return SectionMarks::default();
        };
        let held = self.section_tool.drag.map(|drag| drag.face);
        let lit = held.or(self.section_tool.near);
        let handle = |face| {
            let (place, _) = own.seen(&view, face)?;
            Some(HandleMark {
                place,
                axis: face.axis,
                is_lit: lit == Some(face),
            })
        };
        SectionMarks {
            edges: (own.edges())
                .filter_map(|ends| view.visible_line(ends))
                .collect(),
            handles: SectionFace::all().filter_map(handle).collect(),
        }
    }

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
