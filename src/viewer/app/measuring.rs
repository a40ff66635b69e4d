//! Measures and the point under the cursor.

use super::ViewerApp;
use super::commands::free_path;
use crate::image::MarkedLines;
use crate::mesh::attributes::PointAttributes;
use crate::open::file_place::in_file;
use crate::viewer::ViewerError;
use crate::viewer::input::MeasureChange;
use crate::viewer::measuring::described;
use crate::viewer::panel::measures::{MeasureMarks, MeasureState};
use crate::viewer::pick::PickedPlace;
use crate::viewer::recovery::{RecoveryWay, way_after};
use glam::{DVec2, DVec3};

impl ViewerApp {
    /// What is seen at a place in the picture; a device that was lost knows nothing, and is noticed by the next frame.
    fn picked(&mut self, at: DVec2) -> Result<Option<PickedPlace>, ViewerError> {
        if self.is_preview {
            return Ok(None);
        }
        match self.screen.pick(at) {
            Err(error) if way_after(&error) != RecoveryWay::End => Ok(None),
            other => Ok(other?),
        }
    }

    /// A picked place in the coordinates of the file, its digits, and what its point carries.
    fn in_file_of(&self, picked: &PickedPlace) -> Option<(DVec3, [usize; 3], &PointAttributes)> {
        static NOTHING: PointAttributes = PointAttributes {
            columns: Vec::new(),
            grid: None,
            are_colors_categories: false,
        };
        let models = self.screen.models();
        let part = picked.part.unwrap_or(0);
        let model = models.get(part)?;
        let attributes = self.attributes.get(part).map(AsRef::as_ref);
        // Places on surfaces, and of the picture alone, are on no grid.
        let attributes = attributes.filter(|_| picked.part.is_some() && model.kind().is_points());
        let attributes = attributes.unwrap_or(&NOTHING);
        let (place, digits) = in_file(model, attributes, picked.place);
        Some((place, digits, attributes))
    }

    /// The visible point at a place in the picture becomes the next of the line.
    pub(super) fn measure_at(&mut self, at: DVec2) -> Result<(), ViewerError> {
        let Some(picked) = self.picked(at)? else {
            self.inform("nothing is seen there that could be measured");
            return Ok(());
        };
        if let Some((place, digits, _)) = self.in_file_of(&picked) {
            let digits = digits.into_iter().max().unwrap_or(0);
            self.measuring.add(place, digits);
        }
        self.is_cover_dirty = true;
        Ok(())
    }

    /// Looks what is under the cursor, where that is shown and the cursor has moved.
    pub(super) fn look_at_cursor(&mut self) -> Result<(), ViewerError> {
        if !self.measuring.take_cursor() {
            return Ok(());
        }
        let picked = self.picked(self.mouse.position())?;
        let seen = picked.and_then(|picked| {
            let (place, digits, attributes) = self.in_file_of(&picked)?;
            let leaf = picked.part.map(|_| picked.leaf);
            Some(described(place, digits, attributes, leaf))
        });
        self.measuring.see(seen);
        self.is_cover_dirty = true;
        Ok(())
    }

    /// Does what a key asks for.
    pub(super) fn change_measures(&mut self, change: MeasureChange) {
        match change {
            MeasureChange::PointInfo => {
                self.measuring.switch_point_info();
            }
            MeasureChange::End => self.measuring.end(),
            MeasureChange::Close => {
                if !self.measuring.close() {
                    self.inform("an area takes three points (Ctrl + Shift + left click)");
                }
            }
            MeasureChange::Undo => self.measuring.undo(),
            MeasureChange::Save => self.save_measures(),
        }
    }

    /// Writes all measures to the first `surfel-measures-NNN.json` that is not there yet.
    fn save_measures(&mut self) {
        if self.measuring.lines().is_empty() {
            self.inform("nothing is measured yet (Ctrl + Shift + left click)");
            return;
        }
        let Some(path) = free_path("surfel-measures-", ".json") else {
            self.warn("surfel-measures-000.json to surfel-measures-999.json are all there; move some away");
            return;
        };
        let text = self.measuring.list(self.up).to_json();
        let written = crate::image::write(&path, |file| {
            std::io::Write::write_all(file, text.as_bytes())
        });
        match written {
            Ok(()) => self.inform(&format!("wrote {}", path.display())),
            Err(error) => self.warn(&error.to_string()),
        }
    }

    /// What the panel shows of measures.
    pub(super) fn measure_state(&self) -> MeasureState {
        MeasureState {
            words: self.measuring.words(self.up),
        }
    }

    /// What is drawn over the picture.
    pub(super) fn measure_marks(&self) -> MeasureMarks {
        let lines = self.measuring.lines();
        let (Some(view), Some(model), false) = (
            self.view_of_picture(),
            self.screen.model(),
            lines.is_empty(),
        ) else {
            return MeasureMarks::default();
        };
        let label = |line| {
            let text = self.measuring.label(line, self.up)?;
            let own = MarkedLines::of(std::slice::from_ref(line), &view, model.origin);
            Some((*own.places.last()?, text))
        };
        MeasureMarks {
            lines: MarkedLines::of(lines, &view, model.origin),
            labels: lines.iter().filter_map(label).collect(),
        }
    }
}
