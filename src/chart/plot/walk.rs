//! The chart of a walk: how much the picture changes from frame to frame, in two ways of drawing.

use super::axis::{GRAY, points_text};
use super::{begun_svg, escaped};
use std::fmt::Write;

/// A line of the chart: a value at each step.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkLine {
    /// Name in the legend.
    pub name: String,
    /// Values, the first of the first step.
    pub values: Vec<f64>,
}

const STROKES: [(&str, &str); 3] = [("#0072b2", "none"), ("#d55e00", "4 3"), ("#009e73", "2 3")];
const FIELD: [f64; 2] = [760.0, 300.0];
const CORNER: [f64; 2] = [74.0, 84.0];

/// A round step such that some four fit below a value.
fn tick_of(most: f64) -> f64 {
    let rough = most / 4.0;
    let decade = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|step| step * decade >= rough);
    step.unwrap_or(10.0) * decade
}

/// The field of a chart: steps to the right, values upward, both from 0 on.
struct WalkField {
    steps: usize,
    most: f64,
}

impl WalkField {
    fn of(lines: &[WalkLine]) -> Self {
        let values = lines.iter().flat_map(|line| line.values.iter().copied());
        let most = values.filter(|v| v.is_finite()).fold(0.0, f64::max);
        Self {
            steps: lines
                .iter()
                .map(|line| line.values.len())
                .max()
                .unwrap_or(0),
            most: if most > 0.0 { 1.06 * most } else { 1.0 },
        }
    }

    /// Number of the last step; at least 1.
    fn last(&self) -> f64 {
        self.steps.saturating_sub(1).max(1) as f64
    }

    fn x(&self, step: f64) -> f64 {
        CORNER[0] + FIELD[0] * step / self.last()
    }

    fn y(&self, value: f64) -> f64 {
        CORNER[1] + FIELD[1] * (1.0 - value / self.most)
    }

    /// Writes lines at round values, numbers and the names of both axes.
    fn write_axes(&self, out: &mut String, up: &str) {
        let [left, right] = [CORNER[0], CORNER[0] + FIELD[0]];
        let decimals = (-tick_of(self.most).log10().floor()).max(0.0) as usize;
        let (up_tick, across) = (tick_of(self.most), tick_of(self.last()).max(1.0));
        // Writing to a string does not fail.
        for tick in 0..=(self.most / up_tick) as usize {
            let value = tick as f64 * up_tick;
            let _ = writeln!(
                out,
                "<line x1=\"{left}\" x2=\"{right}\" y1=\"{0:.1}\" y2=\"{0:.1}\" stroke=\"#e4e7ec\"/><text x=\"{1:.1}\" \
                 y=\"{2:.1}\" text-anchor=\"end\">{3}</text>",
                self.y(value),
                left - 8.0,
                self.y(value) + 4.5,
                format_args!("{value:.decimals$}")
            );
        }
        for tick in 0..=(self.last() / across) as usize {
            let step = tick as f64 * across;
            let _ = writeln!(
                out,
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{step}</text>",
                self.x(step),
                CORNER[1] + FIELD[1] + 20.0
            );
        }
        let _ = writeln!(
            out,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">step</text><text x=\"20\" y=\"{2:.1}\" \
             transform=\"rotate(-90 20 {2:.1})\" text-anchor=\"middle\">{3}</text>",
            left + FIELD[0] / 2.0,
            CORNER[1] + FIELD[1] + 42.0,
            CORNER[1] + FIELD[1] / 2.0,
            escaped(up)
        );
    }
}

/// Lines over the steps of a walk, on linear axes that start at 0; steps of `marks` have a tick above.
pub fn walk_svg(title: &str, up: &str, lines: &[WalkLine], marks: &[usize]) -> String {
    let (width, height) = (CORNER[0] + FIELD[0] + 24.0, CORNER[1] + FIELD[1] + 56.0);
    let field = WalkField::of(lines);
    let mut out = begun_svg([width, height], title);
    field.write_axes(&mut out, up);
    for mark in marks {
        let _ = writeln!(
            out,
            "<line x1=\"{0:.1}\" x2=\"{0:.1}\" y1=\"{1:.1}\" y2=\"{2:.1}\" stroke=\"{GRAY}\"/>",
            field.x(*mark as f64),
            CORNER[1] - 10.0,
            CORNER[1]
        );
    }
    for (i, line) in lines.iter().enumerate() {
        let (color, dash) = STROKES[i % STROKES.len()];
        let at = 20.0 + 300.0 * i as f64;
        let places: Vec<[f64; 2]> = (line.values.iter().enumerate())
            .filter(|(_, value)| value.is_finite())
            .map(|(step, value)| [field.x(step as f64), field.y(*value)])
            .collect();
        let _ = writeln!(
            out,
            "<line x1=\"{at}\" y1=\"54\" x2=\"{:.1}\" y2=\"54\" stroke=\"{color}\" stroke-width=\"2\" \
             stroke-dasharray=\"{dash}\"/><text x=\"{:.1}\" y=\"58.5\">{}</text>\n<polyline points=\"{}\" fill=\"none\" \
             stroke=\"{color}\" stroke-width=\"2\" stroke-dasharray=\"{dash}\"/>",
            at + 28.0,
            at + 36.0,
            escaped(&line.name),
            points_text(&places)
        );
    }
    out.push_str("</svg>\n");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_goes_through_its_values() {
        let lines = [
            WalkLine {
                name: "a & b".into(),
                values: vec![0.0, 0.5, 1.0],
            },
            WalkLine {
                name: "c".into(),
                values: vec![0.5, 0.5, f64::NAN],
            },
        ];
        let text = walk_svg("title", "change", &lines, &[1]);
        assert!(text.contains("a &amp; b"));
        let of = |color: &str| -> Vec<[f64; 2]> {
            let line = text
                .lines()
                .find(|l| l.starts_with("<polyline") && l.contains(color));
            let inner = line.and_then(|l| l.split('"').nth(1)).unwrap_or_default();
            let pair = |p: &str| -> Option<[f64; 2]> {
                let (x, y) = p.split_once(',')?;
                Some([x.parse().ok()?, y.parse().ok()?])
            };
            inner.split(' ').filter_map(pair).collect()
        };
        let (rising, level) = (of(STROKES[0].0), of(STROKES[1].0));
        assert_eq!((rising.len(), level.len()), (3, 2));
        assert!(rising[0][1] > rising[1][1] && rising[1][1] > rising[2][1]);
        assert_eq!(rising[1], level[1]);
        assert_eq!(
            (tick_of(1.0), tick_of(0.03), tick_of(119.0)),
            (0.5, 0.01, 50.0)
        );
    }
}
