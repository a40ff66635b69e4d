//! The chart as SVG, and that as pixels.
//!
//! A row of panels for each model, a panel for each distance; time to the right, error upward, both on logarithmic axes,
//! so that the best is at the bottom left. Colors are those of Okabe and Ito (*Color Universal Design*, 2008), which
//! people of all kinds of color vision tell apart; kinds of lines also differ in their markers.

pub mod angles;
mod axis;
mod labels;
pub mod walk;

use super::summary::{SummaryPanel, SummaryPoint};
use super::{ChartError, DrawConfiguration, RecordSource};
use crate::image::Image;
use crate::render::{Method, Path, SplatKind};
use axis::{AxisText, GRAY, INK, PlotAxis, PlotField, points_text};
use labels::{LabelPlacer, PlotLabel};
use std::fmt::Write;

/// An error that a chart can show.
#[derive(Debug, Clone, Copy)]
pub struct PlotMetric {
    /// Short name.
    pub key: &'static str,
    /// Name on the axis.
    pub label: &'static str,
    /// Value of a point; 0 is best.
    pub of: fn(&SummaryPoint) -> f64,
    /// How a value is written at the axis.
    pub show: fn(f64) -> String,
}

/// What charts show, the first of them by default.
pub const METRICS: [PlotMetric; 8] = [
    PlotMetric {
        key: "FLIP",
        label: "mean FLIP over the picture",
        of: |p| p.flip,
        show: plain,
    },
    PlotMetric {
        key: "PSNR",
        label: "PSNR over object pixels, dB",
        of: |p| p.rmse_object,
        show: |v| format!("{:.0}", -20.0 * v.log10()),
    },
    PlotMetric {
        key: "SSIM",
        label: "1 - SSIM",
        of: |p| p.dissimilarity,
        show: plain,
    },
    PlotMetric {
        key: "coverage",
        label: "missing and extra pixels",
        of: |p| p.wrong_pixels,
        show: plain,
    },
    PlotMetric {
        key: "holes",
        label: "pixels in holes",
        of: |p| p.hole_pixels,
        show: plain,
    },
    PlotMetric {
        key: "silhouette",
        label: "distance of the outlines, pixels",
        of: |p| p.silhouette_px,
        show: plain,
    },
    PlotMetric {
        key: "depth",
        label: "depth error, footprints of a pixel",
        of: |p| p.depth,
        show: plain,
    },
    PlotMetric {
        key: "normals",
        label: "normal error, degrees",
        of: |p| p.normal,
        show: plain,
    },
];

/// A number without needless digits.
fn plain(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let magnitude = value.abs().log10().floor();
    if magnitude < -5.0 {
        return format!("{value:.0e}");
    }
    let digits = (-magnitude).clamp(0.0, 6.0) as usize;
    format!("{value:.digits$}")
}

/// Size of a panel's field, pixels.
const FIELD: [f64; 2] = [400.0, 330.0];
/// Around a field: left, top, right, bottom.
const MARGIN: [f64; 4] = [74.0, 40.0, 18.0, 58.0];
const HEAD: f64 = 64.0;
const LEGEND_ROW: f64 = 22.0;
const LEGEND_COLUMN: f64 = 200.0;

fn color(choice: &DrawConfiguration) -> &'static str {
    if choice.method == Method::Triangles {
        return "#000000";
    }
    match choice.source {
        RecordSource::Patches => return "#5e3c99",
        RecordSource::Vertices => return "#6b3d0f",
        RecordSource::Tree => {}
    }
    match choice.splat {
        SplatKind::Square => "#0072b2",
        SplatKind::Disc => "#56b4e9",
        SplatKind::Ellipse => "#009e73",
        SplatKind::Gauss => "#e69f00",
        SplatKind::Visibility => "#cc79a7",
        SplatKind::Filtered => "#d55e00",
    }
}

/// The marker of a point: its shape tells the method, hollow ones are compute twins, those with a dark rim are left to the program.
fn marker(choice: &DrawConfiguration, x: f64, y: f64, r: f64) -> String {
    let (fill, stroke, width) = match choice.path {
        Path::Raster => (color(choice), "#ffffff", 0.8),
        Path::Compute => ("#ffffff", color(choice), 1.8),
        Path::Auto => (color(choice), INK, 1.4),
    };
    let style = format!("fill=\"{fill}\" stroke=\"{stroke}\" stroke-width=\"{width}\"");
    match choice.method {
        Method::Pop => format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r}\" {style}/>"),
        Method::Points => {
            let s = r * 0.9;
            let side = 2.0 * s;
            format!(
                "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{side:.1}\" height=\"{side:.1}\" {style}/>",
                x - s,
                y - s
            )
        }
        Method::Splats | Method::Triangles => {
            let corners: Vec<[f64; 2]> = if choice.method == Method::Splats {
                vec![[0.0, -1.2], [1.1, 0.8], [-1.1, 0.8]]
            } else {
                vec![[0.0, -1.5], [1.5, 0.0], [0.0, 1.5], [-1.5, 0.0]]
            };
            let corners: Vec<[f64; 2]> = corners
                .iter()
                .map(|[dx, dy]| [x + dx * r, y + dy * r])
                .collect();
            format!("<polygon points=\"{}\" {style}/>", points_text(&corners))
        }
    }
}

/// Begins a chart of this width and height: its white ground, and its title.
fn begun_svg([width, height]: [f64; 2], title: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
         height=\"{height:.0}\" font-family=\"Ubuntu, 'Segoe UI', 'Helvetica Neue', sans-serif\" font-size=\"13\" \
         fill=\"{INK}\">\n<rect width=\"{width:.0}\" height=\"{height:.0}\" fill=\"#ffffff\"/>\n\
         <text x=\"20\" y=\"30\" font-size=\"20\">{}</text>\n",
        escaped(title)
    )
}

pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// A short name for a label: what is usual is left out.
fn short(choice: &DrawConfiguration) -> String {
    if choice.method == Method::Triangles {
        return choice.line();
    }
    let line = choice.line();
    let line = line.strip_prefix("pop ").unwrap_or(&line);
    format!(
        "{} {}",
        line.replace(", compute", " (c)").replace(", auto", " (a)"),
        choice.threshold_px
    )
}

/// What the picture says, as text for a hint.
fn hint(panel: &SummaryPanel, p: &SummaryPoint) -> String {
    let speed = panel.speed(p);
    let faster = if speed.is_finite() {
        format!(", {speed:.2} times as fast as triangles")
    } else {
        String::new()
    };
    format!(
        "{}: {:.2} ms ({:.2} to {:.2}){faster}; FLIP {:.5}, object PSNR {:.1} dB, outline {:.2} px",
        p.choice.name(),
        p.frame.median,
        p.frame.p5,
        p.frame.p95,
        p.flip,
        -20.0 * p.rmse_object.log10(),
        p.silhouette_px
    )
}

/// Lines of the legend: name and a choice that shows how they look.
fn legend(panels: &[SummaryPanel]) -> Vec<(String, DrawConfiguration)> {
    let mut lines: Vec<(String, DrawConfiguration)> = Vec::new();
    for point in panels.iter().flat_map(|p| &p.points) {
        let name = point.choice.line();
        if !lines.iter().any(|l| l.0 == name) {
            lines.push((name, point.choice));
        }
    }
    lines
}

/// The chart of all panels for one error. `title` and `subtitle` stand above it.
pub fn svg(title: &str, subtitle: &str, panels: &[SummaryPanel], metric: &PlotMetric) -> String {
    let mut rows: Vec<Vec<usize>> = Vec::new();
    for (i, panel) in panels.iter().enumerate() {
        match rows.last_mut() {
            Some(row) if panels[row[0]].model == panel.model => row.push(i),
            _ => rows.push(vec![i]),
        }
    }
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0).max(1);
    let cell = [
        FIELD[0] + MARGIN[0] + MARGIN[2],
        FIELD[1] + MARGIN[1] + MARGIN[3],
    ];
    let width = cell[0] * columns as f64 + 12.0;
    let lines = legend(panels);
    let per_row = ((width - 40.0) / LEGEND_COLUMN).floor().max(1.0) as usize;
    let legend_height = LEGEND_ROW * (lines.len() + 1).div_ceil(per_row) as f64 + 12.0;
    // Without a title there is no room for one.
    let head = if title.is_empty() { 4.0 } else { HEAD };
    let height = head + legend_height + cell[1] * rows.len() as f64 + 8.0;
    let mut out = begun_svg([width, height], title);
    // Writing to a string does not fail.
    let _ = writeln!(
        out,
        "<text x=\"20\" y=\"52\" fill=\"{GRAY}\">{}</text>",
        escaped(subtitle)
    );
    for (i, (name, choice)) in lines.iter().enumerate() {
        let x = 20.0 + LEGEND_COLUMN * (i % per_row) as f64;
        let y = head + 14.0 + LEGEND_ROW * (i / per_row) as f64;
        let _ = writeln!(
            out,
            "{}{}<text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            stroke(choice, &[[x, y], [x + 28.0, y]]),
            marker(choice, x + 14.0, y, 4.5),
            x + 36.0,
            y + 4.5,
            escaped(name)
        );
    }
    let i = lines.len();
    let x = 20.0 + LEGEND_COLUMN * (i % per_row) as f64;
    let y = head + 14.0 + LEGEND_ROW * (i / per_row) as f64;
    let meaning = if metric.key == METRICS[0].key {
        "frontier: none is faster and better"
    } else {
        "named: on the frontier of FLIP"
    };
    let _ = writeln!(
        out,
        "<line x1=\"{x}\" y1=\"{y}\" x2=\"{:.1}\" y2=\"{y}\" {FRONTIER}/><text x=\"{:.1}\" y=\"{:.1}\">{meaning}</text>",
        x + 28.0,
        x + 36.0,
        y + 4.5
    );
    for (r, row) in rows.iter().enumerate() {
        let times = row
            .iter()
            .flat_map(|&i| &panels[i].points)
            .map(|p| p.frame.median);
        let time = PlotAxis::around(times);
        for (c, &i) in row.iter().enumerate() {
            let corner = [
                6.0 + cell[0] * c as f64 + MARGIN[0],
                head + legend_height + cell[1] * r as f64 + MARGIN[1],
            ];
            panel_svg(&mut out, &panels[i], i, metric, &time, corner);
        }
    }
    out.push_str("</svg>\n");
    out
}

const FRONTIER: &str = "fill=\"none\" stroke=\"#f0e442\" stroke-width=\"9\" stroke-linecap=\"round\" \
                        stroke-linejoin=\"round\" stroke-opacity=\"0.75\"";

/// A line of a choice's color; dashed for compute, thick for what is left to the program, dotted for splats.
fn stroke(choice: &DrawConfiguration, points: &[[f64; 2]]) -> String {
    let dash = match (choice.path, choice.method) {
        (Path::Compute, _) => " stroke-dasharray=\"7 4\"",
        (_, Method::Splats) => " stroke-dasharray=\"2 3\"",
        _ => "",
    };
    let width = if choice.path == Path::Auto { 2.6 } else { 1.5 };
    format!(
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\"{dash}/>",
        points_text(points),
        color(choice)
    )
}

fn panel_svg(
    out: &mut String,
    panel: &SummaryPanel,
    index: usize,
    metric: &PlotMetric,
    time: &PlotAxis,
    [left, top]: [f64; 2],
) {
    let [width, height] = FIELD;
    let field = PlotField {
        corner: [left, top],
        size: FIELD,
        across: time.clone(),
        up: PlotAxis::around(panel.points.iter().map(metric.of)),
    };
    let at = |p: &SummaryPoint| {
        let v = (metric.of)(p);
        v.is_finite().then(|| [field.x(p.frame.median), field.y(v)])
    };
    let distance = match panel.fill {
        1.0 => "filling the picture".to_owned(),
        f if f < 1.0 => format!("1/{} of the picture", plain(1.0 / f)),
        f => format!("{} times the picture", plain(f)),
    };
    let _ = writeln!(
        out,
        "<g><text x=\"{left:.1}\" y=\"{:.1}\" font-size=\"15\">{}</text>\
         <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"{GRAY}\">{distance}</text>",
        top - 12.0,
        escaped(&shortened(&panel.model, 34)),
        left + width,
        top - 12.0
    );
    let across = AxisText {
        name: "frame, milliseconds",
        show: plain,
    };
    let up = AxisText {
        name: metric.label,
        show: metric.show,
    };
    field.write_axes(out, across, up);
    let on_frontier = |i: usize| panel.frontier.contains(&i);
    let frontier: Vec<[f64; 2]> = panel
        .frontier
        .iter()
        .filter_map(|&i| at(&panel.points[i]))
        .collect();
    if metric.key == METRICS[0].key && frontier.len() > 1 {
        let _ = writeln!(
            out,
            "<polyline points=\"{}\" {FRONTIER}/>",
            points_text(&frontier)
        );
    }
    let mut placer = LabelPlacer::new([left, top, left + width, top + height]);
    let mut drawn: Vec<String> = Vec::new();
    for point in &panel.points {
        let name = point.choice.line();
        if drawn.contains(&name) {
            continue;
        }
        let of_line = panel.points.iter().filter(|p| p.choice.line() == name);
        let places: Vec<[f64; 2]> = of_line.filter_map(&at).collect();
        if places.len() > 1 {
            placer.avoid_line(&places);
            let _ = writeln!(out, "{}", stroke(&point.choice, &places));
        }
        drawn.push(name);
    }
    // What is on the frontier lies on top.
    let others = (0..panel.points.len()).filter(|i| !on_frontier(*i));
    for i in others.chain(panel.frontier.iter().copied()) {
        let point = &panel.points[i];
        let Some([x, y]) = at(point) else { continue };
        let [from, to] = [point.frame.p5, point.frame.p95].map(|ms| field.x(ms));
        placer.avoid([x, y], if on_frontier(i) { 8.0 } else { 3.5 });
        let _ = writeln!(
            out,
            "<g data-point=\"{index},{i}\"><title>{}</title><line x1=\"{from:.1}\" y1=\"{y:.1}\" x2=\"{to:.1}\" \
             y2=\"{y:.1}\" stroke=\"{}\" stroke-opacity=\"0.45\" stroke-width=\"1.2\"/>{}</g>",
            escaped(&hint(panel, point)),
            color(&point.choice),
            marker(&point.choice, x, y, if on_frontier(i) { 5.5 } else { 3.6 })
        );
    }
    for &i in &panel.frontier {
        let point = &panel.points[i];
        let Some(place) = at(point) else { continue };
        if let Some(PlotLabel { text, at, anchor }) = placer.place(place, &short(&point.choice)) {
            let _ = writeln!(
                out,
                "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"{GRAY}\" stroke-width=\"0.7\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" font-size=\"12\" paint-order=\"stroke\" stroke=\"#ffffff\" \
                 stroke-width=\"3\">{}</text>",
                place[0],
                place[1],
                anchor[0],
                anchor[1],
                at[0],
                at[1],
                escaped(&text)
            );
        }
    }
    out.push_str("</g>\n");
}

/// The end of a name that is too long: what tells files apart stands there.
fn shortened(name: &str, most: usize) -> String {
    let count = name.chars().count();
    if count <= most {
        return name.to_owned();
    }
    let end: String = name.chars().skip(count + 1 - most).collect();
    format!("\u{2026}{end}")
}

/// The picture of an SVG, made `scale` times as large, with a font of its own, so that it looks alike on every machine.
///
/// # Errors
/// [`ChartError::Draw`] for what is no SVG, or larger than memory can hold.
pub fn pixels(svg: &str, scale: f32) -> Result<Image, ChartError> {
    use resvg::{tiny_skia, usvg};
    let mut options = usvg::Options::default();
    options
        .fontdb_mut()
        .load_font_data(epaint_default_fonts::UBUNTU_LIGHT.to_vec());
    let family = options
        .fontdb
        .faces()
        .next()
        .and_then(|face| face.families.first().map(|f| f.0.clone()))
        .unwrap_or_default();
    options.fontdb_mut().set_sans_serif_family(&family);
    options.font_family = family;
    let tree = usvg::Tree::from_str(svg, &options).map_err(|e| ChartError::Draw(e.to_string()))?;
    let size = tree.size();
    let (width, height) = (
        (size.width() * scale).ceil() as u32,
        (size.height() * scale).ceil() as u32,
    );
    let mut map = tiny_skia::Pixmap::new(width, height)
        .ok_or_else(|| ChartError::Draw(format!("{width} x {height} pixels are too many")))?;
    resvg::render(
        &tree,
        tiny_skia::Transform::from_scale(scale, scale),
        &mut map.as_mut(),
    );
    Ok(Image {
        width,
        height,
        color: map
            .pixels()
            .iter()
            .map(|p| [p.red(), p.green(), p.blue(), p.alpha()])
            .collect(),
        ..Image::default()
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::super::AvailablePaths;
    use super::super::row::tests::row;
    use super::super::summary::summarize;
    use super::*;

    fn panels() -> Vec<SummaryPanel> {
        let mut rows = Vec::new();
        for (i, choice) in DrawConfiguration::all(&[1.0, 2.0, 4.0], false, AvailablePaths::ALL)
            .into_iter()
            .enumerate()
        {
            for fill in [1.0, 0.5] {
                let mut r = row("a <model> & \"more\"", choice, fill, 0);
                r.frame_ms = 2.0 + i as f64;
                r.frame_p5_ms = r.frame_ms * 0.9;
                r.frame_p95_ms = r.frame_ms * 1.2;
                r.flip = 0.1 / (1.0 + i as f64);
                r.holes = i as u64 % 3;
                rows.push(r);
            }
        }
        summarize(&rows)
    }

    #[test]
    fn every_chart_is_drawn_and_has_every_point() {
        let panels = panels();
        for metric in &METRICS {
            let svg = svg("title & <text>", "below", &panels, metric);
            assert_eq!(
                svg.matches("data-point=").count(),
                panels[0].points.len() * 2,
                "{}",
                metric.key
            );
            let image = pixels(&svg, 0.5).unwrap();
            assert!(image.color.contains(&[255, 255, 255, 255]));
        }
        // Text leaves ink: the font is found.
        let head = |title: &str| {
            let image = pixels(&svg(title, "", &panels, &METRICS[0]), 1.0).unwrap();
            let rows = &image.color[..image.width as usize * 40];
            rows.iter().filter(|c| c[0] < 128).count().saturating_sub(8)
        };
        assert_eq!(head("."), 0);
        assert!(head("A long title") > 100);
        // Nothing measured is no reason to fail.
        assert!(pixels(&svg("", "", &[], &METRICS[0]), 1.0).is_ok());
        assert!(pixels("no picture", 1.0).is_err());
    }

    #[test]
    fn lines_differ_in_color_or_marker_and_colors_are_far_apart() {
        let all = DrawConfiguration::all(&[1.0], false, AvailablePaths::ALL);
        let look =
            |c: &DrawConfiguration| format!("{} {}", marker(c, 0.0, 0.0, 1.0), stroke(c, &[]));
        for (i, a) in all.iter().enumerate() {
            for b in &all[..i] {
                assert_eq!(look(a) == look(b), a.line() == b.line(), "{a:?} {b:?}");
            }
        }
        let mut colors: Vec<&str> = all.iter().map(color).collect();
        colors.sort_unstable();
        colors.dedup();
        // Triangles, six kinds of splats, patches, vertices.
        assert_eq!(colors.len(), 9);
        let levels = |color: &str, k: usize| i32::from_str_radix(&color[2 * k + 1..2 * k + 3], 16);
        for (i, a) in colors.iter().enumerate() {
            for b in &colors[..i] {
                let off = |k| (levels(a, k).unwrap() - levels(b, k).unwrap()).pow(2);
                assert!(off(0) + off(1) + off(2) > 50 * 50, "{a} {b}");
            }
        }
    }

    #[test]
    fn numbers_have_no_needless_digits() {
        let shown: Vec<String> = [0.0001, 0.02, 0.5, 1.0, 20.0, 3000.0, 1e-9, 0.0]
            .map(plain)
            .to_vec();
        assert_eq!(
            shown,
            ["0.0001", "0.02", "0.5", "1", "20", "3000", "1e-9", "0"]
        );
        assert_eq!(shortened("/a/b/c/model.ply", 10), "\u{2026}model.ply");
        assert_eq!(shortened("model.ply", 10), "model.ply");
    }
}
