//! Lines over measured places: their lengths, heights and areas, and the files that keep them.

use super::up_axis::UpAxis;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Largest file of measures that is read, bytes.
const MOST_BYTES: u64 = 64 << 20;

/// Why measures could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeasureError {
    /// The file could not be read.
    #[error("cannot read the measures {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is not the JSON that is expected.
    #[error(
        "{path}: {source}; expected {{\"up\": \"z\", \"measures\": [{{\"points\": [[x, y, z], ...], \"closed\": false}}, ...]}}"
    )]
    Json {
        /// The file.
        path: PathBuf,
        /// Line, column and cause.
        source: serde_json::Error,
    },
    /// A value is outside of what a measure can be.
    #[error("{path}: measure {measure} {cause}; save the measures again")]
    Value {
        /// The file.
        path: PathBuf,
        /// Index of the measure, from 0.
        measure: usize,
        /// What is wrong.
        cause: &'static str,
    },
}

/// A line over places in world space, in the order in which they were taken.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredLine {
    /// The places.
    pub points: Vec<[f64; 3]>,
    /// The last place is joined to the first: the line is around an area.
    #[serde(default)]
    pub closed: bool,
}

/// What is known of a line; units are those of the coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LineFigures {
    /// Length of all parts together, of a closed line the one back to the first place too.
    pub length: f64,
    /// The same as seen from above.
    pub horizontal_length: f64,
    /// Height of the last place over the first.
    pub height_difference: f64,
    /// Of a closed line, the area on the plane on which it is largest (half the length of the sum of the cross products of
    /// neighbors): the area itself where all places lie in a plane.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area: Option<f64>,
    /// Of a closed line, the area as seen from above.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub horizontal_area: Option<f64>,
}

impl MeasuredLine {
    /// The parts of the line, from place to place.
    pub fn parts(&self) -> impl Iterator<Item = [DVec3; 2]> + '_ {
        let count = self.points.len();
        let is_around = self.closed && count > 2;
        let ends = (1..count).chain(is_around.then_some(0));
        ends.enumerate()
            .map(|(from, to)| [from, to].map(|index| DVec3::from_array(self.points[index])))
    }

    /// Lengths, height and areas.
    pub fn figures(&self, up: UpAxis) -> LineFigures {
        let up = up.direction();
        let flat = |v: DVec3| v - up * v.dot(up);
        let place = |index: usize| DVec3::from_array(self.points[index]);
        let mut figures = LineFigures {
            length: self.parts().map(|[a, b]| a.distance(b)).sum(),
            horizontal_length: self.parts().map(|[a, b]| flat(b - a).length()).sum(),
            height_difference: 0.0,
            area: None,
            horizontal_area: None,
        };
        if self.points.is_empty() {
            return figures;
        }
        let (first, last) = (place(0), place(self.points.len() - 1));
        figures.height_difference = (last - first).dot(up);
        if self.closed && self.points.len() > 2 {
            // Relative to the first place: coordinates of maps are large.
            let sum: DVec3 = self
                .parts()
                .map(|[a, b]| (a - first).cross(b - first))
                .sum();
            figures.area = Some(0.5 * sum.length());
            figures.horizontal_area = Some(0.5 * sum.dot(up).abs());
        }
        figures
    }
}

/// Measures as their file has them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeasureList {
    /// The axis along which heights are.
    pub up: UpAxis,
    /// The lines.
    pub lines: Vec<MeasuredLine>,
}

/// The file: measures with their figures, which are not read.
#[derive(Serialize)]
struct WrittenList<'a> {
    up: FileUp,
    measures: Vec<WrittenLine<'a>>,
}

#[derive(Serialize)]
struct WrittenLine<'a> {
    #[serde(flatten)]
    line: &'a MeasuredLine,
    #[serde(flatten)]
    figures: LineFigures,
}

#[derive(Deserialize)]
struct ReadList {
    #[serde(default)]
    up: FileUp,
    measures: Vec<MeasuredLine>,
}

/// Direction up as the file has it: the name of an axis, or a vector.
#[derive(Serialize, Deserialize)]
#[serde(untagged, try_from = "serde_json::Value")]
enum FileUp {
    Axis(AxisName),
    Vector([f64; 3]),
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum AxisName {
    X,
    Y,
    Z,
}

impl Default for FileUp {
    fn default() -> Self {
        Self::Axis(AxisName::Y)
    }
}

impl TryFrom<serde_json::Value> for FileUp {
    type Error = serde_json::Error;

    fn try_from(value: serde_json::Value) -> Result<Self, Self::Error> {
        match value.is_array() {
            true => serde_json::from_value(value).map(Self::Vector),
            false => serde_json::from_value(value).map(Self::Axis),
        }
    }
}

impl From<UpAxis> for FileUp {
    fn from(up: UpAxis) -> Self {
        match up {
            UpAxis::X => Self::Axis(AxisName::X),
            UpAxis::Y => Self::Axis(AxisName::Y),
            UpAxis::Z => Self::Axis(AxisName::Z),
            UpAxis::Along(up) => Self::Vector(up.to_array()),
        }
    }
}

impl FileUp {
    /// The axis; y of a vector without a direction.
    fn axis(&self) -> UpAxis {
        match self {
            Self::Axis(AxisName::X) => UpAxis::X,
            Self::Axis(AxisName::Y) => UpAxis::Y,
            Self::Axis(AxisName::Z) => UpAxis::Z,
            Self::Vector(up) => UpAxis::along(DVec3::from_array(*up)).unwrap_or_default(),
        }
    }
}

impl MeasureList {
    /// The text of the file.
    pub fn to_json(&self) -> String {
        let measures = self.lines.iter().map(|line| WrittenLine {
            line,
            figures: line.figures(self.up),
        });
        let list = WrittenList {
            up: self.up.into(),
            measures: measures.collect(),
        };
        // Numbers and fixed keys: nothing that JSON cannot say.
        serde_json::to_string_pretty(&list).unwrap_or_default() + "\n"
    }

    /// Reads a file that [`MeasureList::to_json`] wrote; figures and unknown keys are ignored.
    ///
    /// # Errors
    /// When the file cannot be read or is no list of measures; a measure without places or with one that is not finite.
    pub fn read(path: &Path) -> Result<Self, MeasureError> {
        let failed = |source| MeasureError::Read {
            path: path.to_owned(),
            source,
        };
        let mut text = String::new();
        let file = std::fs::File::open(path).map_err(failed)?;
        let mut limited = std::io::Read::take(file, MOST_BYTES);
        std::io::Read::read_to_string(&mut limited, &mut text).map_err(failed)?;
        let read: ReadList = serde_json::from_str(&text).map_err(|source| MeasureError::Json {
            path: path.to_owned(),
            source,
        })?;
        for (measure, line) in read.measures.iter().enumerate() {
            let fault = |cause| {
                Err(MeasureError::Value {
                    path: path.to_owned(),
                    measure,
                    cause,
                })
            };
            if line.points.is_empty() {
                return fault("has no points");
            }
            if !line.points.iter().flatten().all(|value| value.is_finite()) {
                return fault("has a point that is not finite");
            }
        }
        Ok(Self {
            up: read.up.axis(),
            lines: read.measures,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may panic")]
    use super::*;

    fn line(points: &[[f64; 3]], closed: bool) -> MeasuredLine {
        MeasuredLine {
            points: points.to_vec(),
            closed,
        }
    }

    #[test]
    fn figures_are_those_of_closed_forms() {
        // Far from zero, as maps are.
        let (x, y) = (636_000.0, 4_849_000.0);
        let slope = line(&[[x, y, 400.0], [x + 3.0, y + 4.0, 412.0]], false);
        let figures = slope.figures(UpAxis::Z);
        assert_eq!(figures.length, 13.0);
        assert_eq!(figures.horizontal_length, 5.0);
        assert_eq!((figures.height_difference, figures.area), (12.0, None));
        assert_eq!(slope.figures(UpAxis::Y).height_difference, 4.0);
        // A roof of 3 by 5, tilted 3 up in 4: seen from above 2.4 by 5.
        let roof = [
            [x, y, 1.0],
            [x + 2.4, y, 2.8],
            [x + 2.4, y + 5.0, 2.8],
            [x, y + 5.0, 1.0],
        ];
        let around = line(&roof, true).figures(UpAxis::Z);
        let is_near = |a: Option<f64>, b: f64| (a.unwrap() - b).abs() < 1e-6;
        assert!((around.length - 16.0).abs() < 1e-6);
        assert!(is_near(around.area, 15.0) && is_near(around.horizontal_area, 12.0));
        assert_eq!(around.height_difference, 0.0);
        // Two places are around nothing, one is a place.
        let two = line(&roof[..2], true).figures(UpAxis::Z);
        assert!((two.length - 3.0).abs() < 1e-6 && two.area.is_none());
        assert_eq!(line(&roof[..1], false).figures(UpAxis::Z).length, 0.0);
    }

    #[test]
    fn files_are_read_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        let list = MeasureList {
            up: UpAxis::Z,
            lines: vec![
                line(&[[0.1, -2.0, 1e6], [3.0, 0.25, 7.0]], false),
                line(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], true),
            ],
        };
        let text = list.to_json();
        assert!(text.contains("\"horizontal_area\": 0.5"), "{text}");
        std::fs::write(&path, &text).unwrap();
        assert_eq!(MeasureList::read(&path).unwrap(), list);
        let slanted = MeasureList {
            up: UpAxis::Along(DVec3::new(0.6, 0.0, -0.8)),
            ..list
        };
        std::fs::write(&path, slanted.to_json()).unwrap();
        assert_eq!(MeasureList::read(&path).unwrap(), slanted);
        for (text, part) in [
            ("[]", "expected {\"up\""),
            (
                "{\"measures\": [{\"points\": []}]}",
                "measure 0 has no points",
            ),
            (
                "{\"measures\": [{\"points\": [[1, 2]]}]}",
                "invalid length 2",
            ),
            ("{\"measures\": [], \"up\": \"w\"}", "unknown variant"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = MeasureList::read(&path).unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
        assert!(MeasureList::read(&folder.path().join("none")).is_err());
    }
}
