//! Colors by what points carry: intensity, class, height and any other attribute.
//!
//! Quantities take a color map that is even to the eye and safe for the color-blind (viridis, by the polynomials of M.
//! Zucker), over a range that leaves out two hundredths at each end unless it is given. Classes of the American Society for
//! Photogrammetry and Remote Sensing have fixed colors, other categories those of a palette of twelve.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use rayon::prelude::*;

use super::job::ReadJob;
use super::{Error, ReadWarning};
use crate::mesh::Mesh;
use crate::mesh::attributes::{AttributeColumn, AttributeKind, PointAttributes};
use crate::mesh::color_legend::{ColorLegend, LegendEntries};

/// What colors a cloud, and over which range.
#[derive(Debug, Clone, PartialEq)]
pub struct ColorSetting {
    /// The quantity or category.
    pub by: PointColoring,
    /// The values of the first and the last color; by percentiles when absent. Of no use to categories.
    pub range: Option<[f64; 2]>,
}

/// What colors a cloud.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PointColoring {
    /// Height: the z coordinate, of meshes too.
    Height,
    /// An attribute, by its name as `surfel info` lists it.
    Attribute(String),
}

impl fmt::Display for PointColoring {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Height => "height",
            Self::Attribute(name) => name,
        })
    }
}

impl FromStr for PointColoring {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match name.trim() {
            "" => {
                Err("a name is wanted, such as intensity, class, return, height or time".to_owned())
            }
            "height" => Ok(Self::Height),
            other => Ok(Self::Attribute(other.to_owned())),
        }
    }
}

/// Share of the points that is beyond each end of a range that is not given.
const TAIL: f64 = 0.02;

/// Most values that a range is chosen by.
const MOST_SAMPLES: usize = 1 << 20;

/// Most categories that are listed.
const MOST_LISTED: usize = 12;

/// Points per parallel piece.
const PIECE: usize = 1 << 16;

/// Color of points whose value is no number.
const UNKNOWN: [u8; 4] = [128, 128, 128, 255];

/// Colors of a palette, far apart for all eyes (P. Tol, "Colour Schemes", 2021: bright and muted).
const PALETTE: [[u8; 3]; 12] = [
    [68, 119, 170],
    [238, 102, 119],
    [34, 136, 51],
    [204, 187, 68],
    [102, 204, 238],
    [170, 51, 119],
    [221, 204, 119],
    [136, 34, 85],
    [68, 170, 153],
    [153, 153, 51],
    [51, 34, 136],
    [187, 187, 187],
];

/// Classes of LAS 1.4 (table 17) with their colors.
const CLASSES: [(&str, [u8; 3]); 19] = [
    ("never classified", [160, 160, 160]),
    ("unclassified", [190, 190, 190]),
    ("ground", [170, 120, 70]),
    ("low vegetation", [190, 220, 110]),
    ("medium vegetation", [110, 190, 80]),
    ("high vegetation", [30, 130, 50]),
    ("building", [220, 80, 60]),
    ("low point", [230, 60, 200]),
    ("model key point", [250, 220, 80]),
    ("water", [60, 120, 220]),
    ("rail", [120, 100, 160]),
    ("road", [100, 100, 100]),
    ("overlap", [240, 170, 60]),
    ("wire guard", [250, 240, 140]),
    ("wire conductor", [250, 210, 40]),
    ("tower", [90, 60, 140]),
    ("wire connector", [200, 160, 30]),
    ("bridge", [140, 190, 230]),
    ("high noise", [250, 50, 120]),
];

/// The class of a name, whatever the case, with spaces, hyphens or underscores between words.
pub(super) fn class_of_name(name: &str) -> Option<u8> {
    let name = name.trim().to_lowercase().replace(['-', '_'], " ");
    let at = CLASSES.iter().position(|(known, _)| *known == name)?;
    u8::try_from(at).ok()
}

/// The name of a class of LAS; `None` where there is none.
pub fn name_of_class(class: usize) -> Option<&'static str> {
    CLASSES.get(class).map(|(name, _)| *name)
}

/// Points that take colors by what they carry.
pub(crate) struct AttributedPoints<'a> {
    /// The file, for messages.
    pub(crate) path: &'a Path,
    /// Number of points.
    pub(crate) count: usize,
    /// The height of each, world space.
    pub(crate) height: &'a (dyn Fn(usize) -> f64 + Sync),
    /// Attributes of the points.
    pub(crate) attributes: &'a PointAttributes,
}

/// Colors and what they mean.
#[derive(Debug)]
pub(crate) struct AttributeColors {
    /// A color a point.
    pub(crate) colors: Vec<[u8; 4]>,
    /// Colors and values.
    pub(crate) legend: ColorLegend,
    /// The legend in words.
    pub(crate) meaning: String,
}

impl AttributedPoints<'_> {
    /// The column of an attribute.
    fn column(&self, name: &str) -> Result<&AttributeColumn, Error> {
        let column = self.attributes.find(name);
        let column = column.filter(|column| column.values.len() == self.count);
        column.ok_or_else(|| {
            let columns = self.attributes.columns.iter();
            let names: Vec<&str> = columns.map(|column| column.name.as_str()).collect();
            Error::UnknownAttribute {
                path: self.path.to_owned(),
                name: name.to_owned(),
                known: match names.is_empty() {
                    true => "height only".to_owned(),
                    false => format!("height, {}", names.join(", ")),
                },
            }
        })
    }

    /// The values of the first and the last color where none are given; `None` for categories.
    ///
    /// # Errors
    /// [`Error::UnknownAttribute`].
    pub(crate) fn usual_range(&self, by: &PointColoring) -> Result<Option<[f64; 2]>, Error> {
        let PointColoring::Attribute(name) = by else {
            return Ok(Some(percentiles(self.count, &self.height)));
        };
        let column = self.column(name)?;
        let value = |at: usize| column.value(at).unwrap_or(f64::NAN);
        let is_quantity = column.kind == AttributeKind::Quantity;
        Ok(is_quantity.then(|| percentiles(self.count, &value)))
    }

    /// The colors that a setting gives.
    ///
    /// # Errors
    /// [`Error::UnknownAttribute`].
    pub(crate) fn colors(&self, setting: &ColorSetting) -> Result<AttributeColors, Error> {
        let name = match &setting.by {
            PointColoring::Height => {
                return Ok(by_quantity(
                    "height",
                    self.count,
                    self.height,
                    setting.range,
                ));
            }
            PointColoring::Attribute(name) => name,
        };
        let column = self.column(name)?;
        Ok(match column.kind {
            AttributeKind::Category => by_category(column, self.count),
            AttributeKind::Quantity => {
                let value = |at: usize| column.value(at).unwrap_or(f64::NAN);
                by_quantity(&column.name, self.count, value, setting.range)
            }
        })
    }
}

/// Colors the mesh as the options ask for; says what the colors mean.
pub(super) fn apply(
    job: &mut ReadJob<'_>,
    mesh: &mut Mesh,
    setting: &ColorSetting,
) -> Result<(), Error> {
    let points = AttributedPoints {
        path: job.path,
        count: mesh.positions.len(),
        height: &|at| mesh.origin.z + f64::from(mesh.positions[at].z),
        attributes: &job.attributes,
    };
    let AttributeColors {
        colors,
        legend,
        meaning,
    } = points.colors(setting)?;
    mesh.colors = colors;
    job.warn(ReadWarning::ColoredBy {
        name: legend.title.clone(),
        meaning,
        legend,
    });
    Ok(())
}

fn by_quantity(
    name: &str,
    count: usize,
    value: impl Fn(usize) -> f64 + Sync,
    range: Option<[f64; 2]>,
) -> AttributeColors {
    let [low, high] = range.unwrap_or_else(|| percentiles(count, &value));
    let color = |at: usize| {
        let value = value(at);
        if value.is_nan() {
            return UNKNOWN;
        }
        viridis(if high > low {
            (value - low) / (high - low)
        } else {
            0.5
        })
    };
    AttributeColors {
        colors: (0..count)
            .into_par_iter()
            .with_min_len(PIECE)
            .map(color)
            .collect(),
        meaning: format!("dark blue {} to yellow {}", rounded(low), rounded(high)),
        legend: ColorLegend {
            title: name.to_owned(),
            entries: scale_of([low, high]),
        },
    }
}

/// The colors from one value to another.
fn scale_of([low, high]: [f64; 2]) -> LegendEntries {
    let color = |step: u8| {
        let [r, g, b, _] = viridis(f64::from(step) / 255.0);
        [r, g, b]
    };
    LegendEntries::Scale {
        colors: (0..=255).map(color).collect(),
        values: [low, 0.5 * (low + high), high].map(|value| rounded(value).to_string()),
        range: [low, high],
    }
}

/// A number in seven digits.
fn rounded(value: f64) -> f64 {
    // The text of a number in scientific form is a number.
    format!("{value:.6e}").parse().unwrap_or(value)
}

/// The values that two hundredths of all are below and above; 0 and 1 where none is finite.
fn percentiles(count: usize, value: &(impl Fn(usize) -> f64 + Sync)) -> [f64; 2] {
    let step = count.div_ceil(MOST_SAMPLES).max(1);
    let mut sample: Vec<f64> = (0..count)
        .step_by(step)
        .map(value)
        .filter(|value| value.is_finite())
        .collect();
    if sample.is_empty() {
        return [0.0, 1.0];
    }
    let tail = (sample.len() as f64 * TAIL) as usize;
    let last = sample.len() - 1;
    let low = *sample.select_nth_unstable_by(tail, f64::total_cmp).1;
    let high = *sample.select_nth_unstable_by(last - tail, f64::total_cmp).1;
    [low, high]
}

fn by_category(column: &AttributeColumn, count: usize) -> AttributeColors {
    let are_classes = column.name == "class";
    let color = |value: f64| -> [u8; 4] {
        if value.is_nan() {
            return UNKNOWN;
        }
        // The cast saturates; categories are small numbers.
        let index = value.max(0.0) as usize;
        let [red, green, blue] = match CLASSES.get(index).filter(|_| are_classes) {
            Some(&(_, color)) => color,
            None => PALETTE[index % PALETTE.len()],
        };
        [red, green, blue, 255]
    };
    let value = |at: usize| column.value(at).unwrap_or(f64::NAN);
    let mut is_there = vec![false; 1 << 16];
    for at in 0..count {
        let value = value(at);
        if (0.0..65536.0).contains(&value) {
            is_there[value as usize] = true;
        }
    }
    let entry = |index: usize| match CLASSES.get(index).filter(|_| are_classes) {
        Some(&(name, color)) => (color, format!("{index} {name}")),
        None => (PALETTE[index % PALETTE.len()], index.to_string()),
    };
    let there: Vec<usize> = (0..is_there.len())
        .filter(|&index| is_there[index])
        .collect();
    let entries = there.iter().take(MOST_LISTED);
    let mut entries: Vec<([u8; 3], String)> = entries.map(|&index| entry(index)).collect();
    let words = |([r, g, b], name): &([u8; 3], String)| format!("{name} #{r:02x}{g:02x}{b:02x}");
    let mut meaning: Vec<String> = entries.iter().map(words).collect();
    if there.len() > MOST_LISTED {
        let more = format!("and {} more", there.len() - MOST_LISTED);
        meaning.push(more.clone());
        entries.push(([0; 3], more));
    }
    AttributeColors {
        colors: (0..count)
            .into_par_iter()
            .with_min_len(PIECE)
            .map(|at| color(value(at)))
            .collect(),
        meaning: meaning.join(", "),
        legend: ColorLegend {
            title: column.name.clone(),
            entries: LegendEntries::List(entries),
        },
    }
}

/// The color of a value from 0 to 1; beyond it is that of the end.
fn viridis(value: f64) -> [u8; 4] {
    const TERMS: [[f64; 3]; 7] = [
        [
            0.277_727_327_223_417_7,
            0.005_407_344_544_966_578,
            0.334_099_805_335_306_1,
        ],
        [
            0.105_093_043_108_577_4,
            1.404_613_529_898_575,
            1.384_590_162_594_685,
        ],
        [
            -0.330_861_828_725_556_3,
            0.214_847_559_468_213,
            0.095_095_163_028_236_59,
        ],
        [
            -4.634_230_498_983_486,
            -5.799_100_973_351_585,
            -19.332_440_956_279_87,
        ],
        [
            6.228_269_936_347_081,
            14.179_933_366_805_09,
            56.690_552_600_681_05,
        ],
        [
            4.776_384_997_670_288,
            -13.745_145_377_746_01,
            -65.353_032_633_372_34,
        ],
        [
            -5.435_455_855_934_631,
            4.645_852_612_178_535,
            26.312_435_249_583_2,
        ],
    ];
    let t = value.clamp(0.0, 1.0);
    let channel = |channel: usize| {
        let sum = TERMS
            .iter()
            .rev()
            .fold(0.0, |sum, term| sum * t + term[channel]);
        (sum.clamp(0.0, 1.0) * 255.0).round() as u8
    };
    [channel(0), channel(1), channel(2), 255]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::attributes::{AttributeValues, NumberType};

    #[test]
    fn the_map_grows_lighter_from_end_to_end() {
        let light = |value: f64| {
            let [r, g, b, _] = viridis(value).map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        for step in 0..100 {
            let at = f64::from(step) / 100.0;
            assert!(light(at + 0.01) > light(at), "{at}");
        }
        // The ends of the published table, and its middle.
        for (value, wanted) in [
            (-1.0, [68, 1, 84]),
            (0.5, [33, 145, 140]),
            (2.0, [253, 231, 37]),
        ] {
            for (got, wanted) in viridis(value).into_iter().zip(wanted) {
                assert!(got.abs_diff(wanted) <= 6, "{value}: {got} {wanted}");
            }
        }
    }

    #[test]
    fn legends_have_the_colors_of_the_points() {
        let value = |at: usize| at as f64;
        let found = by_quantity("height", 101, value, Some([0.0, 100.0]));
        let legend = &found.legend;
        let LegendEntries::Scale { colors, values, .. } = &legend.entries else {
            panic!("{legend:?}")
        };
        assert_eq!(legend.range(), Some([0.0, 100.0]));
        assert_eq!(*values, ["0", "50", "100"].map(str::to_owned));
        for (at, step) in [(0, 0), (20, 51), (100, 255)] {
            assert_eq!(found.colors[at][..3], colors[step]);
        }
        let column = AttributeColumn {
            values: AttributeValues::of((0..40_u8).collect()),
            ..AttributeColumn::new("class", AttributeKind::Category, NumberType::U8)
        };
        // Numbers of two bytes too, such as flight lines.
        let lines = AttributeColumn {
            values: AttributeValues::of(vec![7326_u16; 3]),
            ..AttributeColumn::new("point_source", AttributeKind::Category, NumberType::U16)
        };
        let meaning = by_category(&lines, 3).meaning;
        assert!(meaning.starts_with("7326 #"), "{meaning}");
        let found = by_category(&column, 40);
        let legend = &found.legend;
        let LegendEntries::List(entries) = &legend.entries else {
            panic!("{legend:?}")
        };
        assert_eq!(entries.len(), 13);
        assert_eq!(entries[6], (CLASSES[6].1, "6 building".to_owned()));
        assert_eq!(found.colors[6][..3], entries[6].0);
        assert_eq!(entries[12].1, "and 28 more");
    }

    #[test]
    fn ranges_leave_out_the_tails() {
        let value = |at: usize| if at == 7 { f64::NAN } else { at as f64 };
        assert_eq!(percentiles(1000, &value), [20.0, 980.0]);
        assert_eq!(percentiles(1, &|_| 5.0), [5.0, 5.0]);
        assert_eq!(percentiles(3, &|_| f64::NAN), [0.0, 1.0]);
        assert_eq!(rounded(408.729_999_542_236_3).to_string(), "408.73");
        assert_eq!(rounded(-30.0).to_string(), "-30");
    }
}
