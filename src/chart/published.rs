//! Published tables beside ours: the same window, thresholds and distances, as far as the sources say them.
//!
//! FrameCounts can be compared, times only as ratios: the machines are of 2000 to 2009. Where a number of a source is missing
//! or cannot be met, the row says why.

pub mod benda;
pub mod dietz;
mod dietz_edges;
pub mod dietz_failures;
mod dietz_holes;
mod dietz_splats;
pub mod qsplat;
mod qsplat_codes;

use super::ChartError;
use crate::math::camera::View;
use crate::measure::ValueDistribution;
use crate::progress::Progress;
use crate::render::PictureOutputs;
use crate::render::Settings;
use crate::render::engine::{Backend, Engine};
use crate::render::stats::FrameCounts;
use crate::tree::Model;

/// A model with what is known of it.
#[derive(Debug, Clone, Copy)]
pub struct PublishedSubject<'m> {
    /// Name for people.
    pub name: &'m str,
    /// The model.
    pub model: &'m Model,
    /// How long its tree took to build, seconds; 0 where it was read ready-made.
    pub build_s: f64,
}

impl PublishedSubject<'_> {
    /// Interior nodes and leaves, as the sources count.
    pub fn nodes(&self) -> usize {
        self.model.tree.nodes.len() + self.model.tree.leaves.len()
    }

    /// Memory of vertices, triangles and tree, bytes.
    pub fn bytes(&self) -> u64 {
        self.model.memory_bytes().total()
    }
}

/// A table: what a source printed beside what is measured here.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct PublishedTable {
    /// Source, number and conditions.
    pub title: String,
    /// Names of the columns; the last is for remarks.
    pub columns: Vec<String>,
    /// As many cells as columns each.
    pub rows: Vec<Vec<String>>,
}

impl PublishedTable {
    fn new(title: impl Into<String>, columns: &[&str]) -> Self {
        Self {
            title: title.into(),
            columns: columns.iter().map(|c| (*c).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    fn row(&mut self, cells: Vec<String>) {
        assert_eq!(
            cells.len(),
            self.columns.len(),
            "a row of the table's width"
        );
        self.rows.push(cells);
    }

    /// The table in aligned columns.
    pub fn text(&self) -> String {
        let width = |c: usize| {
            let cells = self.rows.iter().map(|r| &r[c]);
            cells
                .chain([&self.columns[c]])
                .map(|s| s.chars().count())
                .max()
                .unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let line = |cells: &[String]| {
            let mut line = String::from(" ");
            for (c, cell) in cells.iter().enumerate() {
                let pad = " ".repeat(widths[c] - cell.chars().count());
                // Names and remarks to the left, numbers to the right.
                if c == 0 || c + 1 == cells.len() {
                    line += &format!(" {cell}{pad} ");
                } else {
                    line += &format!(" {pad}{cell} ");
                }
            }
            line.trim_end().to_owned() + "\n"
        };
        let mut text = format!("{}\n{}", self.title, line(&self.columns));
        for row in &self.rows {
            text += &line(row);
        }
        text
    }

    /// The table as comma-separated values, the title as the first cell of every row.
    ///
    /// # Errors
    /// None in memory; those of the writer.
    pub fn csv(&self) -> Result<String, std::io::Error> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let mut write = |first: &str, cells: &[String]| {
            writer.write_record([first].into_iter().chain(cells.iter().map(String::as_str)))
        };
        write("table", &self.columns).map_err(std::io::Error::other)?;
        for row in &self.rows {
            write(&self.title, row).map_err(std::io::Error::other)?;
        }
        let bytes = writer.into_inner().map_err(|e| e.into_error())?;
        String::from_utf8(bytes).map_err(std::io::Error::other)
    }
}

/// One frame to measure.
#[derive(Debug, Clone, Copy)]
pub(super) struct PublishedCell {
    pub(super) view: View,
    pub(super) settings: Settings,
}

/// Median frame in milliseconds and counts of every cell, their frames drawn in turn; one before each does not count.
pub(super) fn measure(
    backend: &Backend,
    model: &Model,
    cells: &[PublishedCell],
    repeats: u32,
    progress: &dyn Progress,
) -> Result<Vec<(f64, FrameCounts)>, ChartError> {
    let Some(first) = cells.first() else {
        return Ok(Vec::new());
    };
    let size = (first.view.width, first.view.height);
    let mut engine = Engine::new(backend, model, size, PictureOutputs::default())?;
    progress.stage("frames", u64::from(repeats + 1) * cells.len() as u64);
    let mut times = vec![Vec::new(); cells.len()];
    let mut counts = vec![FrameCounts::default(); cells.len()];
    for round in 0..=repeats {
        for (i, cell) in cells.iter().enumerate() {
            if progress.is_cancelled() {
                return Err(ChartError::Cancelled);
            }
            let frame = engine.draw(&cell.view, &cell.settings)?;
            counts[i] = frame.counts;
            if round > 0 {
                times[i].push(frame.frame_ms);
            }
            progress.advance(1);
        }
    }
    Ok(times
        .iter()
        .zip(counts)
        .map(|(t, c)| (ValueDistribution::of(t).median, c))
        .collect())
}

/// A count with thousands separated.
fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Ours over theirs.
fn ratio(ours: f64, theirs: f64) -> String {
    if theirs > 0.0 {
        format!("{:.2}", ours / theirs)
    } else {
        "-".into()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    #[test]
    fn tables_are_aligned_and_quoted() {
        let mut table = PublishedTable::new("Title, \"quoted\"", &["what", "ours", "remark"]);
        table.row(vec!["nodes".into(), count(1_349_525), "equal".into()]);
        table.row(vec!["n".into(), count(999), String::new()]);
        assert_eq!(
            table.text(),
            "Title, \"quoted\"\n  what        ours  remark\n  nodes  1,349,525  equal\n  n            999\n"
        );
        let csv = table.csv().unwrap();
        assert!(csv.starts_with(
            "table,what,ours,remark\n\"Title, \"\"quoted\"\"\",nodes,\"1,349,525\",equal\n"
        ));
        assert_eq!(ratio(3.0, 2.0), "1.50");
        assert_eq!(ratio(3.0, 0.0), "-");
    }
}
