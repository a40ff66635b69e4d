//! The table of failures for people and programs: text, CSV, one HTML file that needs no other.

use super::{FailureCell, FailureFigure, FailureVerdict, FailuresError, GROUPS};
use crate::image::{Image, contact_sheet};
use crate::scenes::SceneEntry;
use ::image::ImageEncoder;
use std::fmt::Write;

/// A cell with its picture, made small.
#[derive(Debug, Clone)]
pub struct CellShot {
    /// What was measured and said.
    pub cell: FailureCell,
    /// The picture, at most [`THUMB_PX`] wide.
    pub thumb: Image,
}

/// A scene with all of its pictures.
#[derive(Debug)]
pub struct SceneRow {
    /// The scene.
    pub entry: &'static SceneEntry,
    /// Threshold of the scene, pixels.
    pub threshold_px: f32,
    /// The truth, made small; none for clouds.
    pub truth: Option<Image>,
    /// By look.
    pub shots: Vec<CellShot>,
}

/// Scenes by looks.
#[derive(Debug, Default)]
pub struct SceneTable {
    /// What drew.
    pub device: String,
    /// The looks, in the order of columns.
    pub looks: Vec<&'static str>,
    /// The scenes, in the order of rows.
    pub scenes: Vec<SceneRow>,
}

/// Width of small pictures, pixels.
pub const THUMB_PX: u32 = 120;

/// A picture made small by a whole factor.
pub fn thumb(picture: &Image) -> Image {
    picture.downscaled(picture.width.div_ceil(THUMB_PX).max(1))
}

/// The figures that a cell of the page shows, with words for them.
const SHOWN: [(FailureFigure, &str); 6] = [
    (FailureFigure::Missing, "missing"),
    (FailureFigure::Extra, "extra"),
    (FailureFigure::Holes, "holes"),
    (FailureFigure::Silhouette, "outline off, px"),
    (FailureFigure::Rmse, "RMSE, levels"),
    (FailureFigure::Flip, "FLIP"),
];

impl SceneTable {
    fn cells(&self) -> impl Iterator<Item = &FailureCell> {
        let shots = self.scenes.iter().flat_map(|row| &row.shots);
        shots.map(|shot| &shot.cell)
    }

    /// How many cells have a verdict.
    pub fn count(&self, verdict: FailureVerdict) -> usize {
        self.cells().filter(|c| c.verdict == verdict).count()
    }

    /// One line: the counts of verdicts, and those of the default look.
    pub fn summary(&self) -> String {
        let all = self.cells().count();
        let [passes, limits, fails] = [
            FailureVerdict::Pass,
            FailureVerdict::Limit,
            FailureVerdict::Fail,
        ]
        .map(|v| self.count(v));
        let of_default = |v| {
            let cells = self.cells().filter(|c| c.look == "pop");
            cells.filter(|c| c.verdict == v).count()
        };
        format!(
            "{all} cells: {passes} pass, {limits} known limits ({:.1} %), {fails} fail; of the default look (pop, squares): {} known limits, {} fail",
            100.0 * limits as f64 / all.max(1) as f64,
            of_default(FailureVerdict::Limit),
            of_default(FailureVerdict::Fail)
        )
    }

    /// The table for people: a letter a cell, then every limit and failure with its cause.
    pub fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a string does not fail.
        for (k, look) in self.looks.iter().enumerate() {
            let _ = writeln!(text, "{:>24} {look}", letter(k));
        }
        let heads: String = (0..self.looks.len())
            .map(|k| format!(" {}", letter(k)))
            .collect();
        let _ = writeln!(text, "{:<20}{heads}", "");
        for row in &self.scenes {
            let marks: String = self
                .looks
                .iter()
                .map(|look| {
                    let shot = row.shots.iter().find(|s| s.cell.look == *look);
                    match shot.map(|s| s.cell.verdict) {
                        None => "  ",
                        Some(FailureVerdict::Pass) => " .",
                        Some(FailureVerdict::Limit) => " L",
                        Some(FailureVerdict::Fail) => " F",
                    }
                })
                .collect();
            let _ = writeln!(text, "{:<20}{marks}", row.entry.name);
        }
        for verdict in [FailureVerdict::Limit, FailureVerdict::Fail] {
            let cells: Vec<&FailureCell> = self.cells().filter(|c| c.verdict == verdict).collect();
            if !cells.is_empty() {
                let _ = writeln!(text, "\n{}", verdict.name());
            }
            for cell in cells {
                let cause = cell.cause().replace('\n', "; ");
                let _ = writeln!(text, "  {}, {}: {cause}", cell.scene, cell.look);
            }
        }
        let _ = writeln!(
            text,
            "\n. pass, L known limit, F fail; on {}\n{}",
            self.device,
            self.summary()
        );
        text
    }

    /// A line a cell: names, verdict, every figure, every bound, the cause. RFC 4180.
    pub fn csv(&self) -> String {
        let mut csv = String::from("scene,look,threshold_px,verdict");
        for figure in FailureFigure::ALL {
            csv.push(',');
            csv.push_str(figure.name());
        }
        csv.push_str(",bounds,cause\r\n");
        for row in &self.scenes {
            for CellShot { cell, .. } in &row.shots {
                let _ = write!(
                    csv,
                    "{},{},{},{}",
                    cell.scene,
                    quoted(cell.look),
                    row.threshold_px,
                    cell.verdict.name()
                );
                for figure in FailureFigure::ALL {
                    csv.push(',');
                    if let Some(value) = cell.figure(figure) {
                        let _ = write!(csv, "{value:.4}");
                    }
                }
                let bounds = bounds_of(cell, "; ");
                let _ = write!(csv, ",{},{}\r\n", quoted(&bounds), quoted(&cell.cause()));
            }
        }
        csv
    }

    /// One page with all small pictures in it.
    ///
    /// # Errors
    /// When a picture cannot be packed.
    pub fn html(&self) -> Result<String, FailuresError> {
        let mut page = String::from(HEAD);
        let _ = write!(
            page,
            "<p>{}. Drawn on {}; truth: triangles, 16 samples a pixel.</p>",
            escaped(&self.summary()),
            escaped(&self.device)
        );
        page.push_str("<table><tr><th>scene</th><th>truth</th>");
        for look in &self.looks {
            let _ = write!(page, "<th>{}</th>", escaped(look));
        }
        page.push_str("</tr>\n");
        for row in &self.scenes {
            let entry = row.entry;
            let _ = write!(
                page,
                "<tr><th class=s>{}<p>{}</p><p>fails: {}</p><p>threshold {} px</p></th><td>",
                entry.name,
                escaped(entry.shows),
                escaped(entry.fails),
                row.threshold_px
            );
            if let Some(truth) = &row.truth {
                image_tag(&mut page, truth, &format!("{}, truth", entry.name))?;
            }
            page.push_str("</td>");
            for look in &self.looks {
                match row.shots.iter().find(|s| s.cell.look == *look) {
                    None => page.push_str("<td></td>"),
                    Some(shot) => cell_html(&mut page, shot)?,
                }
            }
            page.push_str("</tr>\n");
        }
        page.push_str("</table></body></html>\n");
        Ok(page)
    }

    /// A contact sheet for each group of scenes that was drawn: a row a scene, the truth first, then the looks without a
    /// changed option; with the group's name. Labels of known limits end in an asterisk, of failures in an exclamation
    /// mark.
    pub fn sheets(&self) -> Vec<(&'static str, Image)> {
        let looks = self.looks.iter().filter(|look| !look.contains(','));
        let looks: Vec<&str> = looks.copied().collect();
        let mut sheets = Vec::new();
        for (group, _, names) in GROUPS {
            let mut pictures = Vec::new();
            for row in self.scenes.iter().filter(|r| names.contains(&r.entry.name)) {
                let empty = Image::filled(1, 1, [0; 4]);
                let truth = row.truth.clone().unwrap_or_else(|| empty.clone());
                pictures.push((row.entry.name.to_owned(), truth));
                for look in &looks {
                    let shot = row.shots.iter().find(|s| s.cell.look == *look);
                    pictures.push(match shot {
                        None => (String::new(), empty.clone()),
                        Some(shot) => {
                            let mark = match shot.cell.verdict {
                                FailureVerdict::Pass => "",
                                FailureVerdict::Limit => "*",
                                FailureVerdict::Fail => "!",
                            };
                            (format!("{look}{mark}"), shot.thumb.clone())
                        }
                    });
                }
            }
            if !pictures.is_empty() {
                sheets.push((*group, contact_sheet(&pictures, looks.len() + 1)));
            }
        }
        sheets
    }
}

const HEAD: &str = "<!DOCTYPE html>\n<html lang=en><head><meta charset=utf-8><title>Where the methods fail</title><style>\
body{font:13px sans-serif;background:#fff;color:#222;margin:1em}table{border-collapse:collapse}\
th,td{border:1px solid #bbb;padding:4px;vertical-align:top;text-align:left;font-size:11px}\
th{background:#eee;position:sticky;top:0}th.s{position:sticky;left:0;min-width:12em;z-index:1}th.s p{font-weight:normal}\
td{min-width:122px}td.pass{background:#e2f2e2}td.limit{background:#fff0c4}td.fail{background:#f7c6c6}\
p{margin:2px 0}img{display:block;background:#000;image-rendering:pixelated}</style></head><body>\n\
<h1>Where the methods fail</h1>\
<p>Green: within the rules. Yellow: a known limit, with its cause. Red: out of bounds. Point at a cell for its bounds.</p>";

fn cell_html(page: &mut String, shot: &CellShot) -> Result<(), FailuresError> {
    let cell = &shot.cell;
    let class = match cell.verdict {
        FailureVerdict::Pass => "pass",
        FailureVerdict::Limit => "limit",
        FailureVerdict::Fail => "fail",
    };
    let _ = write!(
        page,
        "<td class={class} title=\"{}\">",
        escaped(&bounds_of(cell, "\n"))
    );
    image_tag(page, &shot.thumb, &format!("{}, {}", cell.scene, cell.look))?;
    if cell.verdict != FailureVerdict::Pass {
        let cause = escaped(&cell.cause()).replace('\n', "<br>");
        let _ = write!(page, "<p><b>{}</b>: {cause}</p>", cell.verdict.name());
    }
    for (figure, words) in SHOWN {
        if let Some(value) = cell.figure(figure) {
            let digits = match figure {
                FailureFigure::Missing | FailureFigure::Extra | FailureFigure::Holes => 0,
                FailureFigure::Flip => 4,
                _ => 2,
            };
            let _ = write!(page, "<p>{words} {value:.digits$}</p>");
        }
    }
    page.push_str("</td>");
    Ok(())
}

/// What is stated, with what was measured and the reasons.
fn bounds_of(cell: &FailureCell, between: &str) -> String {
    let lines: Vec<String> = cell
        .bounds
        .iter()
        .map(|b| {
            let [least, most] = b.range;
            format!(
                "{} {:.2} in {least:.2} to {most:.2}: {}",
                b.figure.name(),
                b.value,
                b.why
            )
        })
        .collect();
    lines.join(between)
}

/// A, B, ... Z, a, b, ...
fn letter(k: usize) -> char {
    let letters = ('A'..='Z').chain('a'..='z');
    letters.clone().nth(k).unwrap_or('?')
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// A picture as part of the page.
fn image_tag(page: &mut String, picture: &Image, alt: &str) -> Result<(), FailuresError> {
    let rgb: Vec<u8> = picture
        .color
        .iter()
        .flat_map(|&[r, g, b, _]| [r, g, b])
        .collect();
    let mut png = Vec::new();
    ::image::codecs::png::PngEncoder::new(&mut png)
        .write_image(
            &rgb,
            picture.width,
            picture.height,
            ::image::ExtendedColorType::Rgb8,
        )
        .map_err(|source| crate::image::Error::Write {
            path: "index.html".into(),
            source: std::io::Error::other(source),
        })?;
    let _ = write!(
        page,
        "<img width={} height={} alt=\"{}\" src=\"data:image/png;base64,",
        picture.width,
        picture.height,
        escaped(alt)
    );
    push_base64(page, &png);
    page.push_str("\">");
    Ok(())
}

/// RFC 4648, section 4.
fn push_base64(text: &mut String, bytes: &[u8]) {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for part in bytes.chunks(3) {
        let byte = |i: usize| u32::from(part.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            text.push(if i <= part.len() {
                char::from(DIGITS[(bits >> (18 - 6 * i)) as usize & 63])
            } else {
                '='
            });
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failing test panics")]

    use super::*;
    use crate::scenes;
    use crate::stability::FailureBound;

    #[test]
    fn base64_is_that_of_the_standard() {
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            let mut text = String::new();
            push_base64(&mut text, plain.as_bytes());
            assert_eq!(text, coded);
        }
    }

    fn table() -> SceneTable {
        let bound = FailureBound {
            figure: FailureFigure::Holes,
            value: 3.0,
            range: [1.0, 5.0],
            why: "gaps, \"wide\" <ones>",
            verdict: FailureVerdict::Limit,
        };
        let cell = |look, verdict, bounds: Vec<FailureBound>| FailureCell {
            scene: "fence",
            look,
            figures: vec![(FailureFigure::Holes, 3.0), (FailureFigure::Flip, 0.25)],
            bounds,
            verdict,
        };
        let shot = |cell| CellShot {
            cell,
            thumb: Image::filled(4, 4, [255; 4]),
        };
        SceneTable {
            device: "a <device>".into(),
            looks: vec!["pop", "pop, culling off", "disc"],
            scenes: vec![SceneRow {
                entry: scenes::find("fence").unwrap(),
                threshold_px: 1.0,
                truth: Some(Image::filled(4, 4, [9; 4])),
                shots: vec![
                    shot(cell("pop", FailureVerdict::Limit, vec![bound.clone()])),
                    shot(cell("pop, culling off", FailureVerdict::Fail, Vec::new())),
                ],
            }],
        }
    }

    #[test]
    fn tables_say_what_was_measured_and_why() {
        let table = table();
        let csv = table.csv();
        let lines: Vec<&str> = csv.split("\r\n").collect();
        assert_eq!(lines.len(), 4, "{csv}");
        assert!(lines[0].starts_with("scene,look,threshold_px,verdict,covered_px,"));
        assert!(
            lines[1].starts_with("fence,pop,1,known limit,") && lines[1].contains("\"\"wide\"\"")
        );
        assert!(lines[2].starts_with("fence,\"pop, culling off\",1,FAIL,"));
        let text = table.text();
        assert!(text.contains("fence                L F  "), "{text}");
        assert!(text.contains("2 cells: 0 pass, 1 known limits (50.0 %), 1 fail"));
        assert!(text.contains("no bound is stated"));
        let page = table.html().unwrap();
        assert!(page.contains("gaps, &quot;wide&quot; &lt;ones&gt;") && !page.contains("<ones>"));
        assert_eq!(page.matches("data:image/png;base64,").count(), 3);
        let sheets = table.sheets();
        assert_eq!((sheets.len(), sheets[0].0), (1, "detail"));
    }
}
