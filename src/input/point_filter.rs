//! Which points are kept: ranges of coordinates and of what points carry.
//!
//! A point is kept where every condition holds. A triangle is kept by the middle of its corners, so triangles at a border
//! are kept whole or not at all.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::Error;
use super::color_by::class_of_name;
use crate::mesh::attributes::{AttributeColumn, NumberType, PointAttributes};

/// Conditions that all hold for what is kept. Without any, everything is kept.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointFilter {
    /// The conditions.
    pub conditions: Vec<FieldCondition>,
}

/// A field of points and the ranges in which its value must be, ends included.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldCondition {
    /// The field.
    pub field: FilterField,
    /// Smallest and largest values; infinite where a range is open. The value is within one of them.
    pub ranges: Vec<[f64; 2]>,
}

/// What is looked at.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FilterField {
    /// A coordinate as the file has it: 0 to 2 for x, y and z.
    Axis(usize),
    /// Height, which is z.
    Height,
    /// An attribute, by its name as `surfel info` lists it.
    Attribute(String),
}

impl fmt::Display for FilterField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Axis(0) => "x",
            Self::Axis(1) => "y",
            Self::Axis(_) => "z",
            Self::Height => "height",
            Self::Attribute(name) => name,
        })
    }
}

impl FromStr for FieldCondition {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some((name, values)) = text.split_once('=') else {
            return Err("expected FIELD=VALUES, such as class=2,6 or height=10..80".to_owned());
        };
        let name = name.trim();
        let field = match name.to_ascii_lowercase().as_str() {
            "" => return Err("a field is wanted before the =, such as class or height".to_owned()),
            "x" => FilterField::Axis(0),
            "y" => FilterField::Axis(1),
            "z" => FilterField::Axis(2),
            "height" => FilterField::Height,
            _ => FilterField::Attribute(name.to_owned()),
        };
        let ranges: Result<Vec<[f64; 2]>, String> =
            values.split(',').map(|part| range(&field, part)).collect();
        Ok(Self {
            field,
            ranges: ranges?,
        })
    }
}

/// A value, or two with `..` between, of which either may be missing.
fn range(field: &FilterField, text: &str) -> Result<[f64; 2], String> {
    let text = text.trim();
    let number = |text: &str, open: f64| match text.trim() {
        "" => Ok(open),
        text => match text.parse::<f64>() {
            Ok(value) if !value.is_nan() => Ok(value),
            _ => Err(format!(
                "`{text}` is neither a number nor a range such as 10..80, ..80 or 10.."
            )),
        },
    };
    if text.is_empty() {
        return Err(
            "a value is missing: expected numbers and ranges with commas between".to_owned(),
        );
    }
    if let Some((low, high)) = text.split_once("..") {
        let ends = [
            number(low, f64::NEG_INFINITY)?,
            number(high, f64::INFINITY)?,
        ];
        return match ends {
            [low, high] if low > high => Err(format!("{low}..{high}: the smaller end comes first")),
            ends => Ok(ends),
        };
    }
    let is_class =
        matches!(field, FilterField::Attribute(name) if name.eq_ignore_ascii_case("class"));
    if let Some(class) = class_of_name(text).filter(|_| is_class) {
        return Ok([f64::from(class); 2]);
    }
    Ok([number(text, 0.0)?; 2])
}

impl fmt::Display for FieldCondition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}=", self.field)?;
        for (index, &[low, high]) in self.ranges.iter().enumerate() {
            if index > 0 {
                f.write_str(",")?;
            }
            if low == high {
                write!(f, "{low}")?;
                continue;
            }
            if low.is_finite() {
                write!(f, "{low}")?;
            }
            f.write_str("..")?;
            if high.is_finite() {
                write!(f, "{high}")?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for PointFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all: Vec<String> = self.conditions.iter().map(ToString::to_string).collect();
        f.write_str(&all.join(" "))
    }
}

/// What a filter looks at.
pub struct FilteredPoints<'a> {
    /// The file, for messages.
    pub path: &'a Path,
    /// How many points or triangles.
    pub count: usize,
    /// The place of each, relative to the origin.
    pub place: &'a (dyn Fn(usize) -> Vec3 + Sync),
    /// World position of the origin.
    pub origin: DVec3,
    /// What points carry, in the same order.
    pub attributes: &'a PointAttributes,
}

/// A condition with its bounds as the numbers are stored.
enum StoredCondition<'a> {
    Axis(usize, Vec<[f32; 2]>),
    Column(&'a AttributeColumn, Vec<[f64; 2]>),
}

impl PointFilter {
    /// Tells whether everything is kept.
    pub fn is_empty(&self) -> bool {
        self.conditions.is_empty()
    }

    /// Reads conditions with blanks between.
    ///
    /// # Errors
    /// Says what is wrong with the first that is none.
    pub fn of_words(text: &str) -> Result<Self, String> {
        let conditions = text.split_whitespace().map(str::parse);
        let conditions: Result<Vec<FieldCondition>, String> = conditions.collect();
        Ok(Self {
            conditions: conditions?,
        })
    }

    /// The conditions on coordinates, and on attributes that these points have.
    #[must_use]
    pub fn known_to(&self, attributes: &PointAttributes) -> Self {
        let is_known = |condition: &&FieldCondition| match &condition.field {
            FilterField::Axis(_) | FilterField::Height => true,
            FilterField::Attribute(name) => attributes.find(name).is_some(),
        };
        Self {
            conditions: self.conditions.iter().filter(is_known).cloned().collect(),
        }
    }

    /// Keeps only what is within a box between two opposite corners, faces included; world space.
    pub fn clip(&mut self, corners: [DVec3; 2]) {
        let (low, high) = (corners[0].min(corners[1]), corners[0].max(corners[1]));
        self.conditions.extend((0..3).map(|axis| FieldCondition {
            field: FilterField::Axis(axis),
            ranges: vec![[low[axis], high[axis]]],
        }));
    }

    /// Which points are kept. Values that are no numbers are in no range. Bounds are rounded as the values they are
    /// compared with, so that a point on a bound is kept.
    ///
    /// # Errors
    /// [`Error::UnknownField`] for an attribute that the points do not have.
    pub fn mask(&self, points: &FilteredPoints<'_>) -> Result<Vec<bool>, Error> {
        let conditions: Vec<StoredCondition<'_>> = self
            .conditions
            .iter()
            .map(|condition| stored(condition, points))
            .collect::<Result<_, Error>>()?;
        let is_kept = |index: usize| {
            conditions.iter().all(|condition| match condition {
                StoredCondition::Axis(axis, ranges) => {
                    let value = (points.place)(index)[*axis];
                    ranges
                        .iter()
                        .any(|&[low, high]| low <= value && value <= high)
                }
                StoredCondition::Column(column, ranges) => {
                    let value = column.value(index).unwrap_or(f64::NAN);
                    ranges
                        .iter()
                        .any(|&[low, high]| low <= value && value <= high)
                }
            })
        };
        let all = (0..points.count).into_par_iter().with_min_len(1 << 14);
        Ok(all.map(is_kept).collect())
    }
}

fn stored<'a>(
    condition: &FieldCondition,
    points: &FilteredPoints<'a>,
) -> Result<StoredCondition<'a>, Error> {
    let axis = match &condition.field {
        &FilterField::Axis(axis) => axis,
        FilterField::Height => 2,
        FilterField::Attribute(name) => {
            let column = points.attributes.find(name);
            let column = column.filter(|column| column.values.len() == points.count);
            return match column {
                Some(column) => Ok(StoredCondition::Column(
                    column,
                    condition
                        .ranges
                        .iter()
                        .map(|&ends| of_column(column, ends))
                        .collect(),
                )),
                None => Err(Error::UnknownField {
                    path: points.path.to_owned(),
                    name: name.clone(),
                    known: known(points),
                }),
            };
        }
    };
    let origin = points.origin[axis];
    let ranges = condition.ranges.iter();
    Ok(StoredCondition::Axis(
        axis,
        ranges
            .map(|ends| ends.map(|end| (end - origin) as f32))
            .collect(),
    ))
}

/// The fields that there are, as a list for messages.
fn known(points: &FilteredPoints<'_>) -> String {
    let columns = points.attributes.columns.iter();
    let columns = columns.filter(|column| column.values.len() == points.count);
    let names: Vec<&str> = columns.map(|column| column.name.as_str()).collect();
    if names.is_empty() {
        "x, y, z and height only".to_owned()
    } else {
        format!("x, y, z, height, {}", names.join(", "))
    }
}

/// The ends of a range as values of a column are rounded.
fn of_column(column: &AttributeColumn, [low, high]: [f64; 2]) -> [f64; 2] {
    if (column.scale, column.offset) != (1.0, 0.0) {
        // Whole numbers times a step: a millionth of the step is rounding.
        let slack = column.scale.abs() * 1e-6;
        return [low - slack, high + slack];
    }
    if column.values.number() == NumberType::F32 {
        return [low, high].map(|end| f64::from(end as f32));
    }
    [low, high]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;
    use crate::mesh::attributes::{AttributeKind, AttributeValues};

    fn condition(text: &str) -> FieldCondition {
        text.parse().unwrap()
    }

    #[test]
    fn conditions_are_read_and_written() {
        for text in [
            "class=2,6",
            "height=10..80",
            "intensity=..200",
            "return=1",
            "x=-5.5..,7",
            "Zeit=0..1,3..4",
        ] {
            assert_eq!(condition(text).to_string(), text);
        }
        assert_eq!(
            condition(" class = ground , high-vegetation ").to_string(),
            "class=2,5"
        );
        assert_eq!(
            condition("height=..").ranges,
            [[f64::NEG_INFINITY, f64::INFINITY]]
        );
        for (text, part) in [
            ("class", "FIELD=VALUES"),
            ("=3", "a field is wanted"),
            ("class=", "a value is missing"),
            ("class=2,,6", "a value is missing"),
            ("height=9..3", "smaller end comes first"),
            ("height=low", "neither a number nor a range"),
            ("intensity=ground", "neither a number nor a range"),
            ("height=nan", "neither a number nor a range"),
            ("height=1..2..3", "neither a number nor a range"),
        ] {
            let error = text.parse::<FieldCondition>().unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn filters_are_read_from_words_and_know_what_points_have() {
        let filter = PointFilter::of_words("  class=2,6  height=..80 ").unwrap();
        assert_eq!(filter.to_string(), "class=2,6 height=..80");
        assert!(PointFilter::of_words(" ").unwrap().is_empty());
        let error = PointFilter::of_words("class=2 height").unwrap_err();
        assert!(error.contains("FIELD=VALUES"), "{error}");
        let none = PointAttributes::default();
        assert_eq!(filter.known_to(&none).to_string(), "height=..80");
        let column = AttributeColumn::new("Class", AttributeKind::Category, NumberType::U8);
        let columns = vec![column];
        let some = PointAttributes {
            columns,
            grid: None,
            are_colors_categories: false,
        };
        assert_eq!(filter.known_to(&some), filter);
    }

    /// Four points at the corners of a square at z = 1 to 4, far from zero.
    #[test]
    fn points_are_kept_where_all_conditions_hold() {
        let column = |name: &str, values: AttributeValues| AttributeColumn {
            values,
            ..AttributeColumn::new(name, AttributeKind::Quantity, NumberType::F32)
        };
        let mut angle = column("angle", AttributeValues::of(vec![100_i16, -50, 0, 7]));
        angle.scale = 0.006;
        let attributes = PointAttributes {
            columns: vec![
                column("class", AttributeValues::of(vec![2_u8, 6, 2, 9])),
                column(
                    "gain",
                    AttributeValues::of(vec![0.1_f32, 0.2, f32::NAN, 0.3]),
                ),
                angle,
            ],
            grid: None,
            are_colors_categories: false,
        };
        let origin = DVec3::new(600_000.0, -4e6, 0.1);
        let places = [
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 2.0],
            [0.0, 1.0, 3.0],
            [1.0, 1.0, 4.0],
        ];
        let place = |index: usize| Vec3::from_array(places[index]);
        let points = FilteredPoints {
            path: Path::new("a.las"),
            count: 4,
            place: &place,
            origin,
            attributes: &attributes,
        };
        let kept = |texts: &[&str]| {
            let conditions = texts.iter().map(|text| condition(text)).collect();
            let mask = PointFilter { conditions }.mask(&points).unwrap();
            (0..4).filter(|&index| mask[index]).collect::<Vec<_>>()
        };
        assert_eq!(kept(&[]), [0, 1, 2, 3]);
        assert_eq!(kept(&["class=2"]), [0, 2]);
        assert_eq!(kept(&["CLASS=2", "height=3.1.."]), [2]);
        assert_eq!(kept(&["class=2,9"]), [0, 2, 3]);
        // On the bound, whatever single precision makes of it.
        assert_eq!(kept(&["height=1.1..2.1"]), [0, 1]);
        assert_eq!(kept(&["gain=0.1..0.2"]), [0, 1]);
        assert_eq!(kept(&["gain=.."]), [0, 1, 3]);
        assert_eq!(kept(&["angle=0.6", "x=600000"]), [0]);
        assert_eq!(kept(&["angle=-0.3..0.042"]), [1, 2, 3]);
        let mut filter = PointFilter::default();
        filter.clip([
            DVec3::new(600_001.0, -3_999_999.0, 9.0),
            DVec3::new(600_000.5, -4e6, 0.0),
        ]);
        assert_eq!(filter.mask(&points).unwrap(), [false, true, false, true]);
        assert_eq!(
            filter.to_string(),
            "x=600000.5..600001 y=-4000000..-3999999 z=0..9"
        );
        let unknown = PointFilter {
            conditions: vec![condition("label=3")],
        };
        let error = unknown.mask(&points).unwrap_err().to_string();
        assert_eq!(
            error,
            "a.las: no field `label` to keep by; there is x, y, z, height, class, gain, angle"
        );
    }
}
