//! The page that shows a chart with its pictures: one file, without anything from a network.

use super::ChartError;
use super::errors::{TILE_PX, object_box};
use super::plot::{METRICS, escaped, svg};
use super::summary::{SummaryPanel, SummaryPoint};
use crate::image::{FloatImage, Image, difference_picture};
use crate::measure::{PictureTile, crop, worst_tile};
use base64::Engine;
use serde_json::{Value, json};
use std::fmt::Write;

/// The picture of a point, from the first view.
#[derive(Debug, Clone)]
pub struct PointShot {
    /// Index of its panel.
    pub panel: usize,
    /// Index of its point in the panel.
    pub point: usize,
    /// The picture.
    pub picture: Image,
}

/// The difference picture is this much brighter than the difference.
const GAIN: f64 = 4.0;

const TEMPLATE: &str = include_str!("page/page.html");

/// A finite number; `null` for others, which JSON does not have.
fn number(value: f64) -> Value {
    serde_json::Number::from_f64(value).map_or(Value::Null, Value::Number)
}

/// What is known of a point, for the page and for `--json`.
pub fn point_facts(panel: &SummaryPanel, point: &SummaryPoint, is_on_frontier: bool) -> Value {
    let [method, splat, path] = point.choice.words();
    json!({
        "name": point.choice.name(),
        "method": method,
        "splat": splat,
        "path": path,
        "threshold_px": point.choice.threshold_px,
        "options": point.choice.options(),
        "is_on_frontier": is_on_frontier,
        "views": point.views,
        "frame_ms": number(point.frame.median),
        "frame_p5_ms": number(point.frame.p5),
        "frame_p95_ms": number(point.frame.p95),
        "cpu_ms": number(point.cpu_ms),
        "times_faster_than_triangles": number(panel.speed(point)),
        "flip": number(point.flip),
        "worst_flip": number(point.worst_flip),
        "flip_object": number(point.flip_object),
        "psnr_object_db": number(-20.0 * point.rmse_object.log10()),
        "ssim": number(1.0 - point.dissimilarity),
        "wrong_pixels": number(point.wrong_pixels),
        "hole_pixels": number(point.hole_pixels),
        "silhouette_px": number(point.silhouette_px),
        "silhouette_p99_px": number(point.silhouette_p99_px),
        "depth_footprints": number(point.depth),
        "normal_degrees": number(point.normal),
        "primitives": number(point.primitives),
    })
}

/// What is known of a panel.
pub fn panel_facts(panel: &SummaryPanel) -> Value {
    let points: Vec<Value> = panel
        .points
        .iter()
        .enumerate()
        .map(|(i, p)| point_facts(panel, p, panel.frontier.contains(&i)))
        .collect();
    let refused: Vec<Value> = panel
        .refused
        .iter()
        .map(|(name, why)| json!({ "name": name, "why": why }))
        .collect();
    json!({
        "model": panel.model,
        "triangles": panel.triangles,
        "vertices": panel.vertices,
        "fill": panel.fill,
        "frontier": panel.frontier,
        "points": points,
        "refused": refused,
    })
}

/// The color as an opaque RGB PNG in memory, as small as the format makes it.
fn png_bytes(picture: &Image) -> Result<Vec<u8>, ChartError> {
    use ::image::codecs::png::{CompressionType, FilterType, PngEncoder};
    use ::image::{ExtendedColorType, ImageEncoder};
    let rgb: Vec<u8> = picture
        .color
        .iter()
        .flat_map(|&[r, g, b, _]| [r, g, b])
        .collect();
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive)
        .write_image(&rgb, picture.width, picture.height, ExtendedColorType::Rgb8)
        // Memory takes whatever is written; only a picture without pixels is refused.
        .map_err(|_| crate::image::Error::Missing { what: "pixels" })?;
    Ok(bytes)
}

fn data_url(image: &Image) -> Result<String, ChartError> {
    let bytes = png_bytes(image)?;
    Ok(format!(
        "data:image/png;base64,{}",
        base64::engine::general_purpose::STANDARD.encode(bytes)
    ))
}

/// The page. `references` has the supersampled picture of every panel's first view, `shots` the pictures to compare with
/// it.
///
/// # Errors
/// When pictures of a panel differ in size.
pub fn html(
    title: &str,
    subtitle: &str,
    panels: &[SummaryPanel],
    references: &[FloatImage],
    shots: &[PointShot],
) -> Result<String, ChartError> {
    let mut charts = String::new();
    for metric in &METRICS {
        // Writing to a string does not fail.
        let _ = write!(
            charts,
            "<div class=\"chart\" data-metric=\"{}\" hidden>{}</div>",
            metric.key,
            svg("", "", panels, metric)
        );
    }
    let mut boxes = Vec::new();
    let mut right = Vec::new();
    for reference in references {
        let image = reference.to_image();
        let tile = object_box(&image, &image, 12).unwrap_or(PictureTile {
            width: image.width,
            height: image.height,
            ..PictureTile::default()
        });
        right.push(data_url(&crop(reference, &tile, 1))?);
        boxes.push(tile);
    }
    let mut pictures = Vec::new();
    for shot in shots {
        let (reference, tile) = (&references[shot.panel], &boxes[shot.panel]);
        let difference = difference_picture(reference, &shot.picture, GAIN)?;
        let worst = worst_tile(reference, &shot.picture, TILE_PX)?;
        pictures.push(json!({
            "panel": shot.panel,
            "point": shot.point,
            "picture": data_url(&crop(&shot.picture, tile, 1))?,
            "difference": data_url(&crop(&difference, tile, 1))?,
            "worst": [
                data_url(&crop(reference, &worst, 1))?,
                data_url(&crop(&shot.picture, &worst, 1))?,
            ],
            "worst_levels": number(255.0 * worst.rmse),
        }));
    }
    let data = json!({
        "gain": GAIN,
        "metrics": METRICS.map(|m| m.key),
        "panels": panels.iter().map(panel_facts).collect::<Vec<_>>(),
        "sizes": boxes.iter().map(|t| [t.width, t.height]).collect::<Vec<_>>(),
        "references": right,
        "shots": pictures,
    });
    // Inside of a script element only its end tag counts.
    let data = data.to_string().replace("</", "<\\/");
    Ok(TEMPLATE
        .replace("{{TITLE}}", &escaped(title))
        .replace("{{SUBTITLE}}", &escaped(subtitle))
        .replace("{{CHARTS}}", &charts)
        .replace("{{DATA}}", &data))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::super::row::tests::row;
    use super::super::summary::summarize;
    use super::super::{AvailablePaths, DrawConfiguration};
    use super::*;

    #[test]
    fn the_page_is_whole_and_alone() {
        let rows: Vec<_> = DrawConfiguration::few(false, AvailablePaths::NONE)
            .into_iter()
            .map(|c| row("</script><b>&", c, 1.0, 0))
            .collect();
        let panels = summarize(&rows);
        let reference = FloatImage {
            width: 40,
            height: 30,
            color: vec![[0.5, 0.5, 0.5, 1.0]; 1200],
            ..FloatImage::default()
        };
        let shot = PointShot {
            panel: 0,
            point: 0,
            picture: Image::filled(40, 30, [100, 100, 100, 255]),
        };
        let page = html("t <", "s", &panels, &[reference], &[shot]).unwrap();
        assert!(!page.contains("{{") && !page.contains("https://"));
        // The only address is the name of SVG's language.
        let named = page.matches("http://").count();
        assert_eq!(named, page.matches("http://www.w3.org/2000/svg").count());
        assert_eq!(page.matches("</script>").count(), 2);
        let start = page.find("id=\"data\">").unwrap() + "id=\"data\">".len();
        let end = start + page[start..].find("</script>").unwrap();
        let data: Value = serde_json::from_str(&page[start..end]).unwrap();
        assert_eq!(data["panels"][0]["model"], "</script><b>&");
        assert_eq!(data["shots"].as_array().unwrap().len(), 1);
        assert_eq!(data["sizes"][0], json!([40, 30]));
    }
}
