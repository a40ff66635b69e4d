//! The chart of splats from vertices: error and time by the angle of their clusters or of the angle test.

use super::axis::{AxisText, PlotAxis, PlotField, points_text};
use super::{begun_svg, escaped, plain};
use std::fmt::Write;

/// A way of drawing: a point for each angle, or one that has none and is a level line.
#[derive(Debug, Clone, PartialEq)]
pub struct AngleLine {
    /// Name in the legend.
    pub name: String,
    /// Angle in degrees if it has one, mean FLIP, milliseconds.
    pub points: Vec<(Option<f64>, f64, f64)>,
}

/// Colors of Okabe and Ito, one a line, and how each is dashed.
const STROKES: [(&str, &str); 6] = [
    ("#000000", "none"),
    ("#d55e00", "2 3"),
    ("#e69f00", "none"),
    ("#0072b2", "none"),
    ("#56b4e9", "7 4"),
    ("#009e73", "2 3"),
];
const FIELD: [f64; 2] = [400.0, 300.0];
const LEFT: f64 = 74.0;
const TOP: f64 = 112.0;
const PANEL: f64 = FIELD[0] + LEFT + 18.0;

/// Two panels beside each other, error and time, both against the angle; all axes are logarithmic.
pub fn angles_svg(title: &str, lines: &[AngleLine]) -> String {
    let (width, height) = (2.0 * PANEL + 12.0, TOP + FIELD[1] + 58.0);
    let mut out = begun_svg([width, height], title);
    for (i, line) in lines.iter().enumerate() {
        let (x, y) = (20.0 + 200.0 * (i % 5) as f64, 56.0 + 22.0 * (i / 5) as f64);
        let (color, dash) = STROKES[i % STROKES.len()];
        let _ = writeln!(
            out,
            "<line x1=\"{x}\" y1=\"{y}\" x2=\"{:.1}\" y2=\"{y}\" stroke=\"{color}\" stroke-width=\"2\" \
             stroke-dasharray=\"{dash}\"/><text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            x + 28.0,
            x + 36.0,
            y + 4.5,
            escaped(&line.name)
        );
    }
    panel(&mut out, lines, 0, "mean FLIP", |point| point.1);
    panel(&mut out, lines, 1, "milliseconds a frame", |point| point.2);
    out.push_str("</svg>\n");
    out
}

fn panel(
    out: &mut String,
    lines: &[AngleLine],
    column: usize,
    name: &str,
    value: fn(&(Option<f64>, f64, f64)) -> f64,
) {
    let all = || lines.iter().flat_map(|line| &line.points);
    let field = PlotField {
        corner: [6.0 + PANEL * column as f64 + LEFT, TOP],
        size: FIELD,
        across: PlotAxis::around(all().filter_map(|point| point.0)),
        up: PlotAxis::around(all().map(value)),
    };
    let [across, up] = ["angle, degrees", name].map(|name| AxisText { name, show: plain });
    field.write_axes(out, across, up);
    let ends = [field.corner[0], field.corner[0] + field.size[0]];
    for (i, line) in lines.iter().enumerate() {
        let (color, dash) = STROKES[i % STROKES.len()];
        let mut places: Vec<[f64; 2]> = Vec::new();
        for point in line.points.iter().filter(|point| value(point).is_finite()) {
            let y = field.y(value(point));
            match point.0 {
                Some(degrees) => places.push([field.x(degrees), y]),
                None => places.extend(ends.map(|x| [x, y])),
            }
        }
        // Markers would hide dashes of what has no angle.
        let has_angles = line.points.iter().any(|point| point.0.is_some());
        for [x, y] in places.iter().filter(|_| has_angles) {
            let _ = writeln!(
                out,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" fill=\"{color}\"/>"
            );
        }
        let _ = writeln!(
            out,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" stroke-dasharray=\"{dash}\"/>",
            points_text(&places)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_go_through_their_points_and_those_without_an_angle_are_level() {
        let lines = [
            AngleLine {
                name: "level & more".into(),
                points: vec![(None, 0.1, 4.0)],
            },
            AngleLine {
                name: "cut".into(),
                points: vec![(Some(2.0), 0.1, 8.0), (Some(20.0), 0.4, 4.0)],
            },
        ];
        let text = angles_svg("title", &lines);
        assert!(text.contains("level &amp; more") && text.contains("angle, degrees"));
        let of = |color: &str| -> Vec<Vec<[f64; 2]>> {
            (text.lines())
                .filter(|l| l.contains("<polyline") && l.contains(color))
                .map(|l| {
                    let inner = l.split('"').nth(1).unwrap_or_default();
                    let pair = |p: &str| -> Option<[f64; 2]> {
                        let (x, y) = p.split_once(',')?;
                        Some([x.parse().ok()?, y.parse().ok()?])
                    };
                    inner.split(' ').filter_map(pair).collect()
                })
                .collect()
        };
        let (level, cut) = (of(STROKES[0].0), of(STROKES[1].0));
        assert_eq!((level.len(), cut.len()), (2, 2));
        // The first point of the cut has the error of the level line, the second is above.
        assert_eq!(level[0][0][1], level[0][1][1]);
        assert_eq!(cut[0][0][1], level[0][0][1]);
        assert!(cut[0][1][1] < cut[0][0][1] && cut[0][1][0] > cut[0][0][0]);
        // In time the second is as fast as the level line.
        assert_eq!(cut[1][1][1], level[1][0][1]);
    }
}
