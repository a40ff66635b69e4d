//! Cross sections: the points of scans in an upright slab along a line, and the lines in which meshes are cut; as rows of text.

use super::OpenedModel;
use super::file_place::in_file;
use super::surface_section::SurfaceSection;
use crate::generate;
use crate::input::ReadWarning;
use crate::math::section_line::{SectionLine, SectionPlace};
use crate::tree::Model;
use glam::DVec3;
use rayon::prelude::*;
use std::borrow::Cow;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// A place of a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionPoint {
    /// Point of the model's cloud; of no meaning on a polyline.
    pub leaf: u32,
    /// The place along the line.
    pub place: SectionPlace,
    /// The place in the coordinates of the file, to its step.
    pub world: DVec3,
}

/// Part that a section has of one model.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ModelSection {
    /// Points of a cloud in the slab, by distance along the line, then offset, then height.
    pub points: Vec<SectionPoint>,
    /// Lines in which the upright plane through the line cuts a surface, between the ends of the line. A closed one ends with the
    /// place that it begins with.
    pub polylines: Vec<Vec<SectionPoint>>,
    /// Leaves of the model the slab holds, of triangles those that may touch it, are marked.
    pub mask: Vec<bool>,
    /// Least and greatest height of points, polylines and corners of triangles in the slab; `None` without any.
    pub heights: Option<[f64; 2]>,
    /// Digits behind the point of x, y and z.
    pub digits: [usize; 3],
}

impl ModelSection {
    /// Cuts a model whose leaves are all in memory. O(n).
    pub fn of(opened: &OpenedModel, line: &SectionLine) -> Self {
        let (_, digits) = in_file(&opened.model, &opened.attributes, DVec3::ZERO);
        let mut section = if opened.model.kind().is_points() {
            of_points(opened, line)
        } else {
            of_surface(&opened.model, line)
        };
        section.digits = digits;
        section
    }

    /// Tells whether there are neither points nor polylines.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty() && self.polylines.is_empty()
    }

    /// Widens the range of heights.
    fn add_height(&mut self, height: f64) {
        let [low, high] = self.heights.unwrap_or([height; 2]);
        self.heights = Some([low.min(height), high.max(height)]);
    }
}

fn of_surface(model: &Model, line: &SectionLine) -> ModelSection {
    let cut = SurfaceSection::of(model, line);
    let point = |world: DVec3| SectionPoint {
        leaf: 0,
        place: line.place_of(world),
        world,
    };
    let polylines = cut.polylines.into_iter();
    let polylines: Vec<Vec<SectionPoint>> = polylines
        .map(|places| places.into_iter().map(point).collect())
        .collect();
    let mut section = ModelSection {
        mask: cut.mask,
        heights: cut.heights,
        ..ModelSection::default()
    };
    for point in polylines.iter().flatten() {
        section.add_height(point.place.height);
    }
    section.polylines = polylines;
    section
}

fn of_points(opened: &OpenedModel, line: &SectionLine) -> ModelSection {
    let (model, attributes) = (&opened.model, &opened.attributes);
    // A first look without the digits of the file, with room for what these change.
    let slack = 1e-6 * (line.length() + line.width());
    let comes_near = |place: SectionPlace| {
        (-slack..=line.length() + slack).contains(&place.distance)
            && place.offset.abs() <= 0.5 * line.width() + slack
    };
    let found = |leaf: usize| {
        let own = model.tree.leaves[leaf].center.as_dvec3();
        let world = model.origin + own;
        let world = attributes.grid.map_or(world, |grid| grid.nearest(world));
        if !comes_near(line.place_of(world)) {
            return None;
        }
        let (world, _) = in_file(model, attributes, own);
        let place = line.place_of(world);
        line.contains(place).then_some(SectionPoint {
            leaf: leaf as u32,
            place,
            world,
        })
    };
    let leaves = (0..model.tree.leaves.len()).into_par_iter();
    let mut points: Vec<SectionPoint> = leaves.with_min_len(1 << 12).filter_map(found).collect();
    let mut section = ModelSection {
        mask: vec![false; model.tree.leaves.len()],
        ..ModelSection::default()
    };
    for point in &points {
        section.mask[point.leaf as usize] = true;
        section.add_height(point.place.height);
    }
    let key = |point: &SectionPoint| {
        let place = point.place;
        [place.distance, place.offset, place.height]
    };
    points.par_sort_by(|a, b| {
        let pairs = key(a).into_iter().zip(key(b));
        let order = pairs.map(|(a, b)| a.total_cmp(&b));
        let order = order.reduce(std::cmp::Ordering::then);
        order
            .unwrap_or(std::cmp::Ordering::Equal)
            .then(a.leaf.cmp(&b.leaf))
    });
    section.points = points;
    section
}

/// A column of rows: what points carry under one name.
struct RowColumn<'a> {
    name: &'a str,
    /// The column of each model's attributes that has this name.
    of_models: Vec<Option<usize>>,
}

/// A model, and what a section has of it.
pub type SectionedModel<'a> = (&'a OpenedModel, &'a ModelSection);

/// Writes sections as rows of comma-separated values, a row of names first: distance, offset and height, x, y and z to the step of
/// the file, red, green and blue where a model has colors, and what points carry under its name in `surfel info`. Of several
/// models the first column is the name of the model; with surfaces a column has the number of the polyline, counted from one.
///
/// # Errors
/// The errors of `out`.
pub fn write_csv(
    models: &[SectionedModel<'_>],
    line: &SectionLine,
    out: &mut dyn Write,
) -> io::Result<()> {
    let rows = SectionRows::new(models, line);
    rows.write_head(out)?;
    let mut polyline_number = 0;
    let mut row = String::new();
    for (index, (opened, section)) in models.iter().enumerate() {
        for point in &section.points {
            rows.fill(&mut row, (index, opened, section), None, point);
            out.write_all(row.as_bytes())?;
        }
        for polyline in &section.polylines {
            polyline_number += 1;
            for point in polyline {
                rows.fill(
                    &mut row,
                    (index, opened, section),
                    Some(polyline_number),
                    point,
                );
                out.write_all(row.as_bytes())?;
            }
        }
    }
    Ok(())
}

/// Writes what [`write_csv`] writes to a file, which appears when it is complete.
///
/// # Errors
/// The file cannot be written.
pub fn write_csv_file(
    models: &[SectionedModel<'_>],
    line: &SectionLine,
    path: &Path,
) -> Result<(), crate::Error> {
    generate::write_atomically(path, |file| {
        let mut out = BufWriter::with_capacity(1 << 20, file);
        write_csv(models, line, &mut out)?;
        Ok(out.flush()?)
    })?;
    Ok(())
}

/// The columns of all rows.
struct SectionRows<'a> {
    has_models: bool,
    has_polylines: bool,
    has_colors: bool,
    columns: Vec<RowColumn<'a>>,
    /// Axis of the coordinates that is up, and digits of distances: one more than coordinates have.
    up: usize,
    digits: usize,
}

impl<'a> SectionRows<'a> {
    fn new(models: &[SectionedModel<'a>], line: &SectionLine) -> Self {
        let mut columns: Vec<RowColumn<'a>> = Vec::new();
        let clouds = models.iter().enumerate();
        for (index, (opened, _)) in clouds.filter(|(_, own)| own.0.model.kind().is_points()) {
            for (at, column) in opened.attributes.columns.iter().enumerate() {
                let known = columns.iter().position(|known| known.name == column.name);
                let known = known.unwrap_or_else(|| {
                    columns.push(RowColumn {
                        name: &column.name,
                        of_models: vec![None; models.len()],
                    });
                    columns.len() - 1
                });
                columns[known].of_models[index].get_or_insert(at);
            }
        }
        let digits = models.iter().flat_map(|(_, section)| section.digits).max();
        Self {
            has_models: models.len() > 1,
            has_polylines: (models.iter()).any(|(_, section)| !section.polylines.is_empty()),
            has_colors: (models.iter())
                .any(|(opened, section)| has_own_colors(opened) && !section.points.is_empty()),
            columns,
            up: line.up_axis(),
            digits: digits.unwrap_or(0) + 1,
        }
    }

    fn write_head(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut names: Vec<Cow<'_, str>> = Vec::new();
        let optional = [(self.has_models, "model"), (self.has_polylines, "polyline")];
        names.extend(optional.iter().filter(|own| own.0).map(|own| own.1.into()));
        names.extend(["distance", "offset", "height", "x", "y", "z"].map(Cow::from));
        if self.has_colors {
            names.extend(["red", "green", "blue"].map(Cow::from));
        }
        names.extend(self.columns.iter().map(|column| quoted(column.name)));
        writeln!(out, "{}", names.join(","))
    }

    /// Puts the row of a point in the place of `row`.
    fn fill(
        &self,
        row: &mut String,
        (index, opened, section): (usize, &OpenedModel, &ModelSection),
        polyline: Option<u64>,
        point: &SectionPoint,
    ) {
        row.clear();
        if self.has_models {
            *row += &format!("{},", quoted(&opened.name));
        }
        match polyline {
            Some(number) => *row += &format!("{number},"),
            None if self.has_polylines => row.push(','),
            None => {}
        }
        let (place, world, digits) = (point.place, point.world.to_array(), section.digits);
        let own = self.digits;
        // Rounding makes a negative zero of little on the right side.
        let plain = |value: f64| format!("{value:.own$}");
        let offset = plain(place.offset);
        let offset = match offset.strip_prefix('-') {
            Some(rest) if rest.bytes().all(|byte| b"0.".contains(&byte)) => rest.to_owned(),
            _ => offset,
        };
        let coordinate = |axis: usize| format!("{:.*}", digits[axis], world[axis]);
        let [x, y, z] = [0, 1, 2].map(coordinate);
        let height = [&x, &y, &z][self.up];
        *row += &format!("{},{offset},{height},{x},{y},{z}", plain(place.distance));
        let is_point = polyline.is_none();
        if self.has_colors {
            let vertex = opened.model.vertices.get(point.leaf as usize);
            match vertex.filter(|_| is_point && has_own_colors(opened)) {
                Some(vertex) => {
                    let [r, g, b, _] = vertex.color;
                    *row += &format!(",{r},{g},{b}");
                }
                None => *row += ",,,",
            }
        }
        for column in &self.columns {
            row.push(',');
            let Some(own) = column.of_models[index].filter(|_| is_point) else {
                continue;
            };
            let own = &opened.attributes.columns[own];
            // What is no number stays empty.
            if let Some(value) = own.value(point.leaf as usize).filter(|v| !v.is_nan()) {
                *row += &own.written(value);
            }
        }
        row.push('\n');
    }
}

/// Tells whether points have colors, and not those that stand for what they carry.
fn has_own_colors(opened: &OpenedModel) -> bool {
    let mut warnings = opened.warnings.iter();
    let stands_for = |warning: &ReadWarning| matches!(warning, ReadWarning::ColoredBy { .. });
    opened.model.has_colors && !warnings.any(stands_for)
}

/// A text as a cell: in quotes where it has commas, quotes or ends of lines.
fn quoted(text: &str) -> Cow<'_, str> {
    let text = crate::printable::printable(text, crate::printable::MOST_CHARS);
    if text.contains([',', '"']) {
        format!("\"{}\"", text.replace('"', "\"\"")).into()
    } else {
        text.into()
    }
}
