//! The figures of a run: one row each, as a table for people and as CSV.

use super::verdict::{BenchTarget, BenchVerdict, VerdictTally};
use crate::measure::ValueDistribution;
use std::fmt::Write;

/// Where a figure was measured.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BenchPlace {
    /// The model; empty for what concerns the device alone.
    pub model: String,
    /// Number of triangles of the model.
    pub triangles: u64,
    /// Width and height of the picture, pixels; 0 where there is none.
    pub size: (u32, u32),
    /// Projected diameter of the bounding sphere over the shorter side; 0 where there is no view.
    pub fill: f64,
}

/// One figure.
#[derive(Debug, Clone, PartialEq)]
pub struct BenchFigure {
    /// Part of the run.
    pub part: &'static str,
    /// Where.
    pub place: BenchPlace,
    /// What drew, such as `pop, 1 px`.
    pub line: String,
    /// What was measured.
    pub name: String,
    /// The value; NaN where there is none.
    pub value: f64,
    /// 5th and 95th percentile of the frames or rounds behind it; NaN where it is one value.
    pub spread: [f64; 2],
    /// Unit of the figure.
    pub unit: &'static str,
    /// How many frames or rounds are behind it.
    pub samples: usize,
    /// What the measured bandwidth allows, in the same unit; NaN where it bounds nothing.
    pub bytes_roof: f64,
    /// What the calibrated rates allow, in the same unit; NaN where they bound nothing.
    pub primitives_roof: f64,
    /// What it has to reach.
    pub target: Option<BenchTarget>,
    /// Cause, condition, or why it is absent.
    pub note: String,
    /// In the file only, not in the table.
    pub is_detail: bool,
}

impl BenchFigure {
    /// One value.
    pub fn new(
        part: &'static str,
        place: &BenchPlace,
        line: &str,
        name: &str,
        value: f64,
        unit: &'static str,
    ) -> Self {
        Self {
            part,
            place: place.clone(),
            line: line.to_owned(),
            name: name.to_owned(),
            value,
            spread: [f64::NAN; 2],
            unit,
            samples: 1,
            bytes_roof: f64::NAN,
            primitives_roof: f64::NAN,
            target: None,
            note: String::new(),
            is_detail: false,
        }
    }

    /// The median of several.
    pub fn median(
        part: &'static str,
        place: &BenchPlace,
        line: &str,
        name: &str,
        values: &[f64],
        unit: &'static str,
    ) -> Self {
        let d = ValueDistribution::of(values);
        let is_empty = values.is_empty();
        let or_none = |v: f64| if is_empty { f64::NAN } else { v };
        Self {
            spread: [d.p5, d.p95].map(or_none),
            samples: values.len(),
            ..Self::new(part, place, line, name, or_none(d.median), unit)
        }
    }

    /// What could not be measured, and why.
    pub fn absent(
        part: &'static str,
        place: &BenchPlace,
        line: &str,
        name: &str,
        unit: &'static str,
        why: impl Into<String>,
    ) -> Self {
        Self {
            samples: 0,
            note: why.into(),
            ..Self::new(part, place, line, name, f64::NAN, unit)
        }
    }

    /// With a bound.
    #[must_use]
    pub fn target(mut self, target: Option<BenchTarget>) -> Self {
        self.target = target;
        self
    }

    /// With what bounds it: bytes over bandwidth, and primitives over the calibrated rate.
    #[must_use]
    pub fn roofs(mut self, [bytes, primitives]: [f64; 2]) -> Self {
        (self.bytes_roof, self.primitives_roof) = (bytes, primitives);
        self
    }

    /// For the file only.
    #[must_use]
    pub fn detail(mut self) -> Self {
        self.is_detail = true;
        self
    }

    /// With a remark.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Tells whether it reaches its target.
    pub fn verdict(&self) -> BenchVerdict {
        BenchVerdict::of(self.value, self.target)
    }
}

/// What measured: repeated in every row.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RunFacts {
    /// The program's version.
    pub version: String,
    /// The commit it was built from ([`crate::measure::COMMIT`]).
    pub commit: String,
    /// The device.
    pub device: String,
    /// Driver of the device.
    pub driver: String,
    /// Threads that the machine runs at once.
    pub threads: usize,
    /// Effort and options of the run.
    pub settings: String,
}

/// The columns of the file.
pub const COLUMNS: [&str; 25] = [
    "version",
    "commit",
    "device",
    "driver",
    "threads",
    "settings",
    "part",
    "model",
    "model_triangles",
    "width",
    "height",
    "fill",
    "line",
    "figure",
    "value",
    "p5",
    "p95",
    "unit",
    "samples",
    "bytes_roof",
    "primitives_roof",
    "target",
    "verdict",
    "margin",
    "note",
];

/// All figures as CSV with a row of names first; empty where there is no value.
///
/// # Errors
/// Those of the writer; into memory there are none.
pub fn csv(about: &RunFacts, figures: &[BenchFigure]) -> Result<String, csv::Error> {
    let mut out = csv::Writer::from_writer(Vec::new());
    out.write_record(COLUMNS)?;
    let number = |v: f64| {
        if v.is_nan() {
            String::new()
        } else {
            v.to_string()
        }
    };
    let whole = |v: u64| if v == 0 { String::new() } else { v.to_string() };
    for f in figures {
        out.write_record([
            about.version.clone(),
            about.commit.clone(),
            about.device.clone(),
            about.driver.clone(),
            about.threads.to_string(),
            about.settings.clone(),
            f.part.to_owned(),
            f.place.model.clone(),
            whole(f.place.triangles),
            whole(f.place.size.0.into()),
            whole(f.place.size.1.into()),
            if f.place.fill > 0.0 {
                f.place.fill.to_string()
            } else {
                String::new()
            },
            f.line.clone(),
            f.name.clone(),
            number(f.value),
            number(f.spread[0]),
            number(f.spread[1]),
            f.unit.to_owned(),
            f.samples.to_string(),
            number(f.bytes_roof),
            number(f.primitives_roof),
            f.target.map(|t| t.to_string()).unwrap_or_default(),
            f.verdict().word().to_lowercase(),
            f.target
                .map(|t| number(t.margin(f.value)))
                .unwrap_or_default(),
            f.note.clone(),
        ])?;
    }
    let bytes = out.into_inner().map_err(|e| e.into_error())?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// A number of four digits.
fn short(value: f64) -> String {
    match value.abs() {
        _ if value.is_nan() => "-".into(),
        v if v >= 1000.0 => format!("{value:.0}"),
        v if v >= 100.0 => format!("{value:.1}"),
        v if v >= 1.0 || v == 0.0 => format!("{value:.2}"),
        v if v >= 0.01 => format!("{value:.4}"),
        _ => format!("{value:.6}"),
    }
}

/// A figure with its verdict, as one line.
pub fn line(f: &BenchFigure) -> String {
    let mut name = String::new();
    if f.place.size.0 > 0 {
        let _ = write!(name, "{}x{} ", f.place.size.0, f.place.size.1);
    }
    if f.place.fill > 0.0 {
        let _ = write!(name, "fill {} ", f.place.fill);
    }
    if !f.line.is_empty() {
        let _ = write!(name, "{}: ", f.line);
    }
    name += &f.name;
    let spread = if f.spread[0].is_nan() || f.samples < 2 {
        String::new()
    } else {
        format!("{} to {}", short(f.spread[0]), short(f.spread[1]))
    };
    let mut text = format!(
        "  {name:<62}{:>9} {:<9}{spread:<18}",
        short(f.value),
        f.unit
    );
    if let Some(target) = f.target {
        let _ = write!(text, " {target}: {}", f.verdict().word());
        let margin = target.margin(f.value);
        match f.verdict() {
            BenchVerdict::Miss if margin > 0.0 => {
                let _ = write!(text, " by {} x", short(1.0 / margin));
            }
            BenchVerdict::Pass if margin > 1.005 => {
                let _ = write!(text, " by {} x", short(margin));
            }
            _ => {}
        }
    }
    let roofs: Vec<String> = [(f.bytes_roof, "bytes"), (f.primitives_roof, "primitives")]
        .iter()
        .filter(|(v, _)| !v.is_nan())
        .map(|(v, what)| format!("{what} {}", short(*v)))
        .collect();
    if !roofs.is_empty() {
        let _ = write!(text, " roofs: {}", roofs.join(", "));
    }
    if !f.note.is_empty() {
        let _ = write!(text, " ({})", f.note);
    }
    text.trim_end().to_owned()
}

/// What the figures with a target came to: those that reach it, then the absent ones, then those that miss it, so that these
/// are the last thing on the screen.
pub fn summary(figures: &[BenchFigure]) -> String {
    let mut out = String::new();
    for verdict in [BenchVerdict::Pass, BenchVerdict::Absent, BenchVerdict::Miss] {
        for f in figures {
            if f.target.is_some() && f.verdict() == verdict {
                let model = if f.place.model.is_empty() {
                    String::new()
                } else {
                    format!("{}, ", f.place.model)
                };
                let _ = writeln!(out, "{:<7}{model}{}", verdict.word(), line(f).trim_start());
            }
        }
    }
    let tally = VerdictTally::of(
        figures
            .iter()
            .filter(|f| f.target.is_some())
            .map(BenchFigure::verdict),
    );
    let _ = writeln!(
        out,
        "{} pass, {} MISS, {} absent",
        tally.passed, tally.missed, tally.absent
    );
    out
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    fn figures() -> Vec<BenchFigure> {
        let place = BenchPlace {
            model: "statue, \"large\"".into(),
            triangles: 7_990_272,
            size: (500, 500),
            fill: 0.5,
        };
        vec![
            BenchFigure::median(
                "frames",
                &place,
                "pop, 1 px",
                "frame",
                &[8.0, 10.0, 30.0],
                "ms",
            )
            .roofs([1.5, f64::NAN]),
            BenchFigure::new(
                "frames",
                &place,
                "pop, 1 px",
                "times faster than triangles",
                4.5,
                "x",
            )
            .target(Some(BenchTarget::AtLeast(40.0))),
            BenchFigure::new("cut", &BenchPlace::default(), "", "visits", 180.0, "M/s")
                .target(Some(BenchTarget::AtLeast(150.0))),
            BenchFigure::absent(
                "rates",
                &BenchPlace::default(),
                "",
                "discs",
                "M/s",
                "no such path",
            )
            .target(Some(BenchTarget::AtLeast(30.0))),
        ]
    }

    #[test]
    fn rows_come_back_as_they_were() {
        let about = RunFacts {
            device: "a device, with a comma".into(),
            ..RunFacts::default()
        };
        let text = csv(&about, &figures()).unwrap();
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        assert_eq!(reader.headers().unwrap(), COLUMNS.as_slice());
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!(rows.len(), 4);
        let cell = |row: usize, name: &str| {
            rows[row][COLUMNS.iter().position(|c| *c == name).unwrap()].to_owned()
        };
        assert_eq!(cell(0, "device"), "a device, with a comma");
        assert_eq!(cell(0, "model"), "statue, \"large\"");
        assert_eq!(cell(0, "value"), "10");
        assert_eq!((cell(0, "p5"), cell(0, "p95")), ("8".into(), "30".into()));
        assert_eq!(
            (cell(0, "bytes_roof"), cell(0, "primitives_roof")),
            ("1.5".into(), String::new())
        );
        assert_eq!(
            (cell(0, "verdict"), cell(0, "samples")),
            (String::new(), "3".into())
        );
        assert_eq!(cell(1, "target"), "at least 40");
        assert_eq!(
            (cell(1, "verdict"), cell(1, "margin")),
            ("miss".into(), "0.1125".into())
        );
        assert_eq!(
            (cell(2, "verdict"), cell(2, "width")),
            ("pass".into(), String::new())
        );
        assert_eq!(
            (cell(3, "verdict"), cell(3, "value")),
            ("absent".into(), String::new())
        );
        assert_eq!(cell(3, "note"), "no such path");
    }

    #[test]
    fn the_table_says_by_how_much() {
        let all = figures();
        let text = line(&all[0]);
        assert!(
            text.contains("500x500 fill 0.5 pop, 1 px: frame") && text.contains("8.00 to 30.00"),
            "{text}"
        );
        assert!(text.contains("roofs: bytes 1.50"), "{text}");
        assert!(
            line(&all[1]).contains("at least 40: MISS by 8.89 x"),
            "{}",
            line(&all[1])
        );
        assert!(
            line(&all[2]).contains("at least 150: pass by 1.20 x"),
            "{}",
            line(&all[2])
        );
        assert!(
            line(&all[3]).contains("absent (no such path)"),
            "{}",
            line(&all[3])
        );
        let text = summary(&all);
        assert!(text.ends_with("1 pass, 1 MISS, 1 absent\n"), "{text}");
        assert!(
            text.lines().next().unwrap().starts_with("pass   visits"),
            "{text}"
        );
    }

    #[test]
    fn the_median_of_nothing_is_absent() {
        let f = BenchFigure::median("cut", &BenchPlace::default(), "", "visits", &[], "M/s")
            .target(Some(BenchTarget::AtLeast(1.0)));
        assert_eq!(f.verdict(), BenchVerdict::Absent);
    }
}
