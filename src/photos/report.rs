//! Reports of a score: a table for people, JSON, and a page with the pictures beside the photographs that were left out.

use crate::measure::ValueDistribution;
use crate::photos::score::{LadderRung, PhotoScore, RungScore};
use serde_json::{Value, json};
use std::fmt::Write;

/// Mean over photographs of one figure of a rung.
fn mean(scores: &[PhotoScore], rung: usize, figure: impl Fn(&RungScore) -> f64) -> f64 {
    let values = scores
        .iter()
        .filter_map(|score| score.rungs.get(rung))
        .map(figure);
    values.sum::<f64>() / scores.len().max(1) as f64
}

/// Headings and figures of the table's columns: of pixels that another photograph sees, as they are and (`gain`) after one
/// gain a channel, and of all pixels of the mesh.
type ScoreColumn = (&'static str, fn(&RungScore) -> f64);

const COLUMNS: [ScoreColumn; 11] = [
    ("PSNR", |r| r.seen.psnr_db),
    ("SSIM", |r| r.seen.ssim),
    ("FLIP", |r| r.seen.flip),
    ("1-NCC", |r| r.seen.one_minus_ncc),
    ("gain PSNR", |r| r.seen_gain.psnr_db),
    ("gain SSIM", |r| r.seen_gain.ssim),
    ("gain FLIP", |r| r.seen_gain.flip),
    ("mesh PSNR", |r| r.mesh.psnr_db),
    ("mesh FLIP", |r| r.mesh.flip),
    ("seams", |r| r.seams),
    ("coverage", |r| r.coverage),
];

/// The table: a row a rung with the means over all photographs, then the PSNR of every photograph.
pub fn score_text(rungs: &[LadderRung], scores: &[PhotoScore]) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = write!(out, "{:<9}", "");
    for (name, _) in COLUMNS {
        let _ = write!(out, " {name:>9}");
    }
    out.push('\n');
    for (index, rung) in rungs.iter().enumerate() {
        if rung.is_beside && !rungs[index.saturating_sub(1)].is_beside {
            out.push_str("beside:\n");
        }
        let _ = write!(out, "{:<9}", rung.name);
        for (_, figure) in COLUMNS {
            let _ = write!(out, " {:>9.3}", mean(scores, index, figure));
        }
        out.push('\n');
    }
    out.push('\n');
    for rung in rungs {
        let _ = writeln!(out, "{:<9} {}", rung.name, rung.text);
    }
    let _ = write!(
        out,
        "\nMeans over {} photographs, each predicted from the others, over pixels that another one sees; gain: after one\ngain a channel; mesh: over all pixels of the mesh. PSNR in dB of each:\n\n{:<24}",
        scores.len(),
        ""
    );
    for rung in rungs {
        let _ = write!(out, " {:>8}", rung.name);
    }
    let _ = writeln!(out, " {:>8} {:>8}", "self", "shifted");
    for score in scores {
        let _ = write!(out, "{:<24}", score.name);
        for rung in &score.rungs {
            let _ = write!(out, " {:>8.2}", rung.seen.psnr_db);
        }
        let _ = writeln!(
            out,
            " {:>8.2} {:>8.2}",
            score.self_psnr_db, score.shifted_self_psnr_db
        );
    }
    let of_self: Vec<f64> = scores.iter().map(|score| score.self_psnr_db).collect();
    let of_shifted: Vec<f64> = scores
        .iter()
        .map(|score| score.shifted_self_psnr_db)
        .collect();
    let _ = writeln!(
        out,
        "\nself: with the photograph itself among the others, median {:.2} dB; shifted: the same with its principal point half a\npixel off, median {:.2} dB",
        ValueDistribution::of(&of_self).median,
        ValueDistribution::of(&of_shifted).median
    );
    out
}

/// Everything as JSON.
pub fn score_json(rungs: &[LadderRung], scores: &[PhotoScore]) -> Value {
    let means = rungs.iter().enumerate().map(|(index, rung)| {
        let figures: serde_json::Map<String, Value> = (COLUMNS.iter())
            .map(|(name, figure)| (name.replace(' ', "_"), json!(mean(scores, index, figure))))
            .collect();
        json!({"name": rung.name, "text": rung.text, "mean": figures})
    });
    json!({"rungs": means.collect::<Vec<_>>(), "photos": scores})
}

/// Text that may stand in HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// The name of the file of a photograph's picture: its number and the rung, "photo" or "mask".
pub fn picture_file(photo: usize, what: &str) -> String {
    format!("{photo:03}_{what}.png")
}

/// A page with the table and, for each photograph, itself and the picture of every rung.
pub fn score_page(rungs: &[LadderRung], scores: &[PhotoScore]) -> String {
    let mut out = String::from(
        "<!doctype html><meta charset=\"utf-8\"><title>surfel photos score</title>\n<style>body{background:#16181d;color:#d6dbe3;font:14px sans-serif;margin:16px}pre{font:12px monospace}figure{display:inline-block;margin:4px;width:31%}img{width:100%}</style>\n",
    );
    let _ = writeln!(
        out,
        "<h1>Photographs predicted from the others</h1>\n<pre>{}</pre>",
        escaped(&score_text(rungs, scores))
    );
    for (photo, score) in scores.iter().enumerate() {
        let _ = writeln!(out, "<h2>{}</h2>", escaped(&score.name));
        let mut figure = |what: &str, text: &str| {
            let file = picture_file(photo, what);
            let _ = writeln!(
                out,
                "<figure><a href=\"{file}\"><img loading=\"lazy\" src=\"{file}\"></a><figcaption>{}</figcaption></figure>",
                escaped(text)
            );
        };
        figure("photo", "the photograph, left out");
        for (rung, of) in rungs.iter().zip(&score.rungs) {
            let text = format!("{}: {} ({:.2} dB)", rung.name, rung.text, of.seen.psnr_db);
            figure(rung.name, &text);
        }
        figure("mask", "white: seen by another photograph");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photos::score::ladder;

    #[test]
    fn every_form_has_every_rung_and_photograph() {
        let rungs = ladder();
        let score = |name: &str, psnr_db: f64| {
            let mut score = PhotoScore {
                name: name.into(),
                rungs: vec![RungScore::default(); rungs.len()],
                ..PhotoScore::default()
            };
            score.rungs[2].seen.psnr_db = psnr_db;
            score
        };
        let scores = [score("a<b>.jpg", 20.0), score("c.jpg", 24.0)];
        let text = score_text(&rungs, &scores);
        let row = text
            .lines()
            .find(|line| line.starts_with(rungs[2].name))
            .unwrap();
        assert!(row.contains("22.000"), "{row}");
        assert!(text.contains("c.jpg"));
        let json = score_json(&rungs, &scores);
        assert_eq!(json["rungs"][2]["mean"]["PSNR"], 22.0);
        assert_eq!(json["photos"][1]["rungs"][2]["seen"]["psnr_db"], 24.0);
        let page = score_page(&rungs, &scores);
        assert_eq!(page.matches("<figure>").count(), 2 * (rungs.len() + 2));
        assert!(page.contains("a&lt;b&gt;.jpg") && page.contains(&picture_file(1, "blend")));
    }
}
