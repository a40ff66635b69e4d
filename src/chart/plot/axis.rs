//! Logarithmic axes, and the field between two of them.

use std::fmt::Write;

/// Color of words.
pub(super) const INK: &str = "#1b1e24";
/// Color of what is less important.
pub(super) const GRAY: &str = "#5b6370";
const FAINT: &str = "#e4e7ec";

/// A logarithmic axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlotAxis {
    /// Logarithms to base 10 of both ends.
    log: [f64; 2],
    /// Values of 0 are there; they lie at the lower end.
    pub(super) has_zero: bool,
}

impl PlotAxis {
    /// An axis that has room for all positive values, and at least a factor of 2; 0 counts as below them, the others
    /// not at all.
    pub(super) fn around(values: impl Iterator<Item = f64>) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut has_zero = false;
        for value in values.filter(|v| v.is_finite()) {
            if value > 0.0 {
                low = low.min(value.log10());
                high = high.max(value.log10());
            } else {
                has_zero = true;
            }
        }
        if low > high {
            (low, high) = (-1.0, 0.0);
        }
        let least = 2f64.log10();
        let missing = (least - (high - low)).max(0.0);
        let margin = (high - low) * 0.06 + missing / 2.0;
        // Zeros lie apart from the smallest value.
        let below = if has_zero { margin + 0.15 } else { margin };
        Self {
            log: [low - below, high + margin],
            has_zero,
        }
    }

    /// Where a value lies: 0 at the lower end, 1 at the upper; values beyond them at the ends.
    pub(super) fn place(&self, value: f64) -> f64 {
        if value > 0.0 {
            ((value.log10() - self.log[0]) / (self.log[1] - self.log[0])).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }

    /// Values with a line each, and whether they have a label too.
    pub(super) fn ticks(&self) -> Vec<(f64, bool)> {
        let span = self.log[1] - self.log[0];
        let labeled: &[u32] = if span > 2.6 {
            &[1]
        } else if span > 1.2 {
            &[1, 3]
        } else if span > 0.7 {
            &[1, 2, 5]
        } else {
            &[1, 2, 3, 4, 5, 6, 8]
        };
        let mut ticks = Vec::new();
        for decade in self.log[0].floor() as i32..=self.log[1].floor() as i32 {
            for step in 1..10u32 {
                let value = f64::from(step) * 10f64.powi(decade);
                if (self.log[0]..=self.log[1]).contains(&value.log10()) {
                    ticks.push((value, labeled.contains(&step)));
                }
            }
        }
        ticks
    }
}

/// A field of a chart: an axis to the right and one upward.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlotField {
    /// Left and top, pixels.
    pub(super) corner: [f64; 2],
    /// Width and height, pixels.
    pub(super) size: [f64; 2],
    pub(super) across: PlotAxis,
    pub(super) up: PlotAxis,
}

/// Words at an axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct AxisText<'t> {
    /// Name of the axis.
    pub(super) name: &'t str,
    /// How a value is written.
    pub(super) show: fn(f64) -> String,
}

impl PlotField {
    /// Place of a value to the right, pixels.
    pub(super) fn x(&self, value: f64) -> f64 {
        self.corner[0] + self.size[0] * self.across.place(value)
    }

    /// Place of a value upward, pixels.
    pub(super) fn y(&self, value: f64) -> f64 {
        self.corner[1] + self.size[1] * (1.0 - self.up.place(value))
    }

    /// Writes lines at the ticks, their values, a frame and the names of both axes.
    pub(super) fn write_axes(&self, out: &mut String, across: AxisText<'_>, up: AxisText<'_>) {
        let ([left, top], [width, height]) = (self.corner, self.size);
        let (right, bottom) = (left + width, top + height);
        let weight = |is_major| if is_major { 1.2 } else { 0.5 };
        // Writing to a string does not fail.
        for (value, is_major) in self.across.ticks() {
            let x = self.x(value);
            let _ = writeln!(
                out,
                "<line x1=\"{x:.1}\" y1=\"{top:.1}\" x2=\"{x:.1}\" y2=\"{bottom:.1}\" stroke=\"{FAINT}\" \
                 stroke-width=\"{}\"/>",
                weight(is_major)
            );
            if is_major {
                let _ = writeln!(
                    out,
                    "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                    bottom + 18.0,
                    (across.show)(value)
                );
            }
        }
        let label = |y: f64, text: &str| {
            let (x, y) = (left - 7.0, y + 4.5);
            format!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"end\">{text}</text>\n")
        };
        for (value, is_major) in self.up.ticks() {
            let y = self.y(value);
            let _ = writeln!(
                out,
                "<line x1=\"{left:.1}\" y1=\"{y:.1}\" x2=\"{right:.1}\" y2=\"{y:.1}\" stroke=\"{FAINT}\" \
                 stroke-width=\"{}\"/>",
                weight(is_major)
            );
            if is_major {
                *out += &label(y, &(up.show)(value));
            }
        }
        if self.up.has_zero {
            *out += &label(bottom, "0");
        }
        let _ = writeln!(
            out,
            "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width}\" height=\"{height}\" fill=\"none\" \
             stroke=\"#aab1bd\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"{GRAY}\">{}</text>\
             <text transform=\"translate({:.1} {:.1}) rotate(-90)\" text-anchor=\"middle\" fill=\"{GRAY}\">{}</text>",
            left + width / 2.0,
            bottom + 40.0,
            across.name,
            left - 56.0,
            top + height / 2.0,
            up.name
        );
    }
}

/// Places as the attribute `points` has them.
pub(super) fn points_text(places: &[[f64; 2]]) -> String {
    let each: Vec<String> = places
        .iter()
        .map(|[x, y]| format!("{x:.1},{y:.1}"))
        .collect();
    each.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_has_its_values_in_its_corners_and_a_label_at_zero() {
        let field = |least: f64| PlotField {
            corner: [10.0, 20.0],
            size: [100.0, 200.0],
            across: PlotAxis::around([1.0, 100.0].into_iter()),
            up: PlotAxis::around([least, 4.0].into_iter()),
        };
        let one = field(1.0);
        assert!(10.0 < one.x(1.0) && one.x(1.0) < one.x(100.0) && one.x(100.0) < 110.0);
        assert!(20.0 < one.y(4.0) && one.y(4.0) < one.y(1.0) && one.y(1.0) < 220.0);
        assert_eq!(one.y(0.0), 220.0);
        let text = |field: &PlotField| {
            let mut out = String::new();
            let [across, up] = ["to the right", "upward"].map(|name| AxisText {
                name,
                show: |v| format!("<{v}>"),
            });
            field.write_axes(&mut out, across, up);
            out
        };
        assert!(text(&one).contains("to the right") && text(&one).contains("upward"));
        assert!(text(&one).contains("<10>") && !text(&one).contains(">0</text>"));
        assert!(text(&field(0.0)).contains(">0</text>"));
        assert_eq!(points_text(&[[1.0, 2.0], [3.04, 4.0]]), "1.0,2.0 3.0,4.0");
    }

    #[test]
    fn values_lie_in_order_within_the_axis_and_some_ticks_are_labeled() {
        for values in [
            vec![3.0],
            vec![1.0, 1.1],
            vec![0.02, 0.5, 900.0],
            vec![0.0, 4.0, 5.0],
            vec![0.0],
            vec![],
            vec![f64::NAN, f64::INFINITY, 2.0],
        ] {
            let axis = PlotAxis::around(values.iter().copied());
            let places: Vec<f64> = values
                .iter()
                .filter(|v| v.is_finite())
                .map(|v| axis.place(*v))
                .collect();
            assert!(places.iter().all(|p| (0.0..=1.0).contains(p)));
            assert!(places.windows(2).all(|p| p[0] < p[1]), "{places:?}");
            let labels = axis.ticks().iter().filter(|t| t.1).count();
            assert!((1..=9).contains(&labels), "{values:?}: {labels}");
        }
        let axis = PlotAxis::around([1.0, 100.0].into_iter());
        assert!((axis.place(10.0) - 0.5).abs() < 1e-12);
    }
}
