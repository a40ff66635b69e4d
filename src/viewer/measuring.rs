//! Measures that are being taken, and the point under the cursor, in numbers and words. Pure logic.

use crate::input::name_of_class;
use crate::math::measured_line::{MeasureList, MeasuredLine};
use crate::math::up_axis::UpAxis;
use crate::mesh::attributes::{AttributeColumn, AttributeKind, PointAttributes};
use glam::DVec3;

/// The point or place under the cursor.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SeenPoint {
    /// x, y and z in the coordinates of the file, to its step.
    pub place: [String; 3],
    /// Names and values of what the point carries.
    pub fields: Vec<(String, String)>,
}

/// Lines that are measured, and whether the point under the cursor is shown.
#[derive(Debug, Default)]
pub struct MeasureTool {
    lines: Vec<MeasuredLine>,
    /// The next point belongs to the last line.
    is_open: bool,
    has_point_info: bool,
    seen: Option<SeenPoint>,
    is_cursor_new: bool,
    /// Digits behind the point of lengths.
    decimals: usize,
}

impl MeasureTool {
    /// Another model: measures and points of this one are gone.
    pub fn forget(&mut self) {
        *self = Self {
            has_point_info: self.has_point_info,
            ..Self::default()
        };
    }

    /// Tells whether anything of it is to be drawn.
    pub fn is_shown(&self) -> bool {
        self.has_point_info || !self.lines.is_empty()
    }

    /// The lines so far.
    pub fn lines(&self) -> &[MeasuredLine] {
        &self.lines
    }

    /// The point under the cursor, where it is shown.
    pub fn seen(&self) -> Option<&SeenPoint> {
        self.seen.as_ref().filter(|_| self.has_point_info)
    }

    /// Another point is under the cursor, or none.
    pub fn see(&mut self, seen: Option<SeenPoint>) {
        self.seen = seen;
    }

    /// Shows the point under the cursor, or not; returns which.
    pub fn switch_point_info(&mut self) -> bool {
        self.has_point_info = !self.has_point_info;
        self.is_cursor_new = true;
        self.has_point_info
    }

    /// The cursor is somewhere else.
    pub fn cursor_moved(&mut self) {
        self.is_cursor_new = true;
    }

    /// Tells whether it is to be looked what is under the cursor; once after each move.
    pub fn take_cursor(&mut self) -> bool {
        std::mem::take(&mut self.is_cursor_new) && self.has_point_info
    }

    /// The next point of the line, in coordinates of which so many digits count.
    pub fn add(&mut self, place: DVec3, decimals: usize) {
        self.decimals = decimals;
        match self.lines.last_mut().filter(|_| self.is_open) {
            Some(line) => line.points.push(place.to_array()),
            None => self.lines.push(MeasuredLine {
                points: vec![place.to_array()],
                closed: false,
            }),
        }
        self.is_open = true;
    }

    /// The next point begins another line.
    pub fn end(&mut self) {
        self.is_open = false;
    }

    /// Joins the last point of the last line to its first, which ends it; or opens it again. Returns whether there are
    /// enough points.
    pub fn close(&mut self) -> bool {
        match self.lines.last_mut().filter(|line| line.points.len() > 2) {
            Some(line) => {
                line.closed = !line.closed;
                self.is_open = !line.closed;
                true
            }
            None => false,
        }
    }

    /// Opens a closed line, or takes the last point away; a line without points goes.
    pub fn undo(&mut self) {
        let Some(line) = self.lines.last_mut() else {
            return;
        };
        if line.closed {
            line.closed = false;
        } else {
            line.points.pop();
        }
        self.is_open = !line.points.is_empty();
        if line.points.is_empty() {
            self.lines.pop();
        }
    }

    /// Takes a line away.
    pub fn remove(&mut self, index: usize) {
        if index < self.lines.len() {
            self.is_open &= index + 1 < self.lines.len();
            self.lines.remove(index);
        }
    }

    /// A line of words about each measure.
    pub fn words(&self, up: UpAxis) -> Vec<String> {
        self.lines
            .iter()
            .map(|line| self.words_of(line, up))
            .collect()
    }

    fn words_of(&self, line: &MeasuredLine, up: UpAxis) -> String {
        let figures = line.figures(up);
        let digits = self.decimals;
        let number = |value: f64| format!("{value:.digits$}");
        match (line.points.len(), figures.area) {
            (1, _) => "a point".to_owned(),
            (_, Some(area)) => format!(
                "area {}, from above {}; around {}",
                number(area),
                number(figures.horizontal_area.unwrap_or(0.0)),
                number(figures.length)
            ),
            (points, None) => {
                let of = match points {
                    2 => String::new(),
                    points => format!(" over {points} points"),
                };
                format!(
                    "{}{of}; level {}, height {:+.digits$}",
                    number(figures.length),
                    number(figures.horizontal_length),
                    figures.height_difference
                )
            }
        }
    }

    /// The text beside a line in the picture: its length, or its area.
    pub fn label(&self, line: &MeasuredLine, up: UpAxis) -> Option<String> {
        let (figures, digits) = (line.figures(up), self.decimals);
        match figures.area {
            Some(area) => Some(format!("{area:.digits$}²")),
            None if line.points.len() > 1 => Some(format!("{:.digits$}", figures.length)),
            None => None,
        }
    }

    /// All lines, as their file has them.
    pub fn list(&self, up: UpAxis) -> MeasureList {
        MeasureList {
            up,
            lines: self.lines.clone(),
        }
    }
}

/// The point `leaf` of a model, or a place on its surface, in words.
pub fn described(
    place: DVec3,
    digits: [usize; 3],
    attributes: &PointAttributes,
    leaf: Option<u32>,
) -> SeenPoint {
    let place = place.to_array();
    let coordinate = |axis: usize| {
        let decimals = digits[axis];
        format!("{:.decimals$}", place[axis])
    };
    let field = |column: &AttributeColumn| {
        let value = column.value(leaf? as usize)?;
        Some((column.name.clone(), words_of_value(column, value)))
    };
    SeenPoint {
        place: [0, 1, 2].map(coordinate),
        fields: attributes.columns.iter().filter_map(field).collect(),
    }
}

fn words_of_value(column: &AttributeColumn, value: f64) -> String {
    if column.kind == AttributeKind::Category && column.name == "class" && value >= 0.0 {
        // The cast saturates.
        return match name_of_class(value as usize) {
            Some(name) => format!("{value} {name}"),
            None => value.to_string(),
        };
    }
    column.written(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::attributes::{AttributeValues, CoordinateGrid, NumberType};
    use crate::open::file_place::in_file;
    use crate::tree::Model;
    use glam::Vec3;

    #[test]
    fn points_make_lines_and_areas() {
        let mut tool = MeasureTool::default();
        let place = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        tool.add(place(0.0, 0.0, 1.0), 2);
        assert_eq!(tool.words(UpAxis::Z), ["a point"]);
        tool.add(place(3.0, 4.0, 1.0), 2);
        assert_eq!(tool.words(UpAxis::Z), ["5.00; level 5.00, height +0.00"]);
        assert!(!tool.close(), "two points are around nothing");
        tool.add(place(0.0, 4.0, 1.0), 2);
        assert_eq!(
            tool.words(UpAxis::Z),
            ["8.00 over 3 points; level 8.00, height +0.00"]
        );
        assert!(tool.close());
        assert_eq!(
            tool.words(UpAxis::Z),
            ["area 6.00, from above 6.00; around 12.00"]
        );
        assert_eq!(
            tool.label(&tool.lines()[0], UpAxis::Z).as_deref(),
            Some("6.00²")
        );
        // Another line begins by itself, since an area is complete.
        tool.add(place(0.0, 0.0, 0.0), 2);
        tool.end();
        tool.add(place(1.0, 0.0, 0.0), 2);
        assert_eq!(tool.lines().len(), 3);
        tool.add(place(1.0, 0.0, -2.5), 2);
        assert_eq!(tool.words(UpAxis::Z)[2], "2.50; level 0.00, height -2.50");
        // The line of two points, then that of one.
        for left in [3, 2, 1] {
            tool.undo();
            assert_eq!(tool.lines().len(), left, "{:?}", tool.lines());
        }
        tool.undo();
        assert!(!tool.lines()[0].closed && tool.lines()[0].points.len() == 3);
        tool.add(place(0.0, 0.0, 1.0), 2);
        assert_eq!(tool.lines()[0].points.len(), 4, "it goes on");
        tool.remove(0);
        tool.remove(7);
        assert!(!tool.is_shown());
        tool.add(place(0.0, 0.0, 1.0), 2);
        assert_eq!(tool.lines().len(), 1);
        tool.forget();
        assert!(tool.lines().is_empty());
    }

    #[test]
    fn coordinates_are_those_of_the_file_to_its_step() {
        let model = Model {
            origin: DVec3::new(636_590.0, 849_217.0, 463.0),
            min: Vec3::splat(-600.0),
            max: Vec3::splat(600.0),
            ..Model::default()
        };
        let mut attributes = PointAttributes {
            columns: Vec::new(),
            grid: Some(CoordinateGrid {
                step: DVec3::new(0.01, 0.01, 0.001),
                offset: DVec3::ZERO,
            }),
            are_colors_categories: false,
        };
        let column = |name: &str, kind, values| AttributeColumn {
            values,
            ..AttributeColumn::new(name, kind, NumberType::U8)
        };
        let mut angle = column(
            "scan_angle",
            AttributeKind::Quantity,
            AttributeValues::of(vec![3_i16, -100]),
        );
        angle.scale = 0.006;
        attributes.columns = vec![
            column(
                "class",
                AttributeKind::Category,
                AttributeValues::of(vec![2_u8, 77]),
            ),
            angle,
        ];
        // As single precision has them.
        let place = Vec3::new(-588.24, 0.13, -56.741).as_dvec3();
        let (place, digits) = in_file(&model, &attributes, place);
        assert_eq!(place, DVec3::new(636_001.76, 849_217.13, 406.259));
        let seen = described(place, digits, &attributes, Some(0));
        assert_eq!(seen.place, ["636001.76", "849217.13", "406.259"]);
        let field = |name: &str, value: &str| (name.to_owned(), value.to_owned());
        assert_eq!(
            seen.fields,
            [field("class", "2 ground"), field("scan_angle", "0.018")]
        );
        let seen = described(place, digits, &attributes, Some(1));
        assert_eq!(
            seen.fields,
            [field("class", "77"), field("scan_angle", "-0.600")]
        );
        assert!(
            described(place, digits, &attributes, None)
                .fields
                .is_empty()
        );
        // Without a grid as many digits as single precision has.
        attributes.grid = None;
        assert_eq!(in_file(&model, &attributes, DVec3::ZERO).1, [4; 3]);
    }
}
