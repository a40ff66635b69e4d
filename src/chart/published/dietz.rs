//! Dietz, *Point Rendering* (thesis, 2009).
//!
//! No machine, no camera and no frame rate are printed, only counts and shares. His split of the Porsche by the angle test
//! is met to 3 percent of the triangles; how he found the normals of points is not said, and decides the splats.

use super::{
    PublishedCell, PublishedSubject, PublishedTable, count, dietz_edges, dietz_splats, measure,
};
use crate::chart::ChartError;
use crate::chart::plot::angles::AngleLine;
use crate::chart::run::orbit;
use crate::progress::Progress;
use crate::render::engine::Backend;
use crate::render::{Method, Path, Settings};

/// Name, points and triangles of his models.
const MODELS: [(&str, u64, u64); 2] = [("Porsche", 4_099, 7_322), ("bunny", 34_835, 69_666)];
/// Splats a frame with levels of detail, and how much faster that was; the first is without.
const LEVELS: [(u64, &str); 4] = [
    (172_974, "1"),
    (164_131, "1.10"),
    (110_947, "1.50"),
    (58_052, "2.15"),
];

/// His tables beside a model of ours, in a window of 500 x 500 pixels, and the lines of a chart of angles.
///
/// # Errors
/// When a frame cannot be drawn, or `progress` is cancelled.
pub fn tables(
    backend: &Backend,
    subject: &PublishedSubject<'_>,
    repeats: u32,
    progress: &dyn Progress,
) -> Result<(Vec<PublishedTable>, Vec<AngleLine>), ChartError> {
    let model = subject.model;
    let view = orbit(model, (500, 500), 1.0, 0, 4)?;
    let (points, triangles) = (
        dietz_splats::point_count(model),
        model.triangles.len() as u64,
    );
    let his = MODELS.iter().find(|m| m.2.abs_diff(triangles) * 100 <= m.2);
    let cell = |method, threshold_px| PublishedCell {
        view,
        settings: Settings {
            method,
            threshold_px,
            path: Path::Raster,
            ..Settings::default()
        },
    };
    let thresholds = [0.0, 1.0, 2.0, 4.0, 8.0];
    let mut cells = vec![cell(Method::Triangles, 0.0)];
    cells.extend(thresholds.map(|t| cell(Method::Pop, t)));
    cells.extend(thresholds.map(|t| cell(Method::Splats, t)));
    let measured = measure(backend, model, &cells, repeats, progress)?;
    let mut tables = Vec::new();

    let mut sizes = PublishedTable::new(
        format!("Dietz: {}, counts", subject.name),
        &["", "Dietz", "surfel", "remark"],
    );
    for (what, theirs, ours) in [
        ("points", his.map(|h| h.1), points),
        ("triangles", his.map(|h| h.2), triangles),
    ] {
        let remark = match (his, theirs == Some(ours)) {
            (None, _) => "not one of his models".to_owned(),
            (Some(_), true) => "equal".to_owned(),
            (Some((name, ..)), false) => format!("another version of the {name}, or other welding"),
        };
        let theirs = theirs.map_or("-".into(), count);
        sizes.row(vec![what.into(), theirs, count(ours), remark]);
    }
    tables.push(sizes);

    if his.is_some_and(|h| h.0 == "Porsche") {
        tables.push(dietz_splats::angle_test_table(model));
    }
    let mut angle_test = None;
    let mut lines = Vec::new();
    if !model.triangles.is_empty() {
        let (table, slower) = dietz_splats::pictures(backend, subject, view, repeats, progress)?;
        tables.push(table);
        angle_test = Some(slower);
        let edges = dietz_edges::tables(backend, subject, repeats, progress)?;
        tables.extend(edges.0);
        lines = edges.1;
    }

    let mut levels = PublishedTable::new(
        format!(
            "Dietz, figure 22: levels of detail, splats a frame and speed; ours: {}",
            subject.name
        ),
        &[
            "his splats",
            "times as fast",
            "our threshold, px",
            "splats",
            "times as fast",
            "remark",
        ],
    );
    let (whole_ms, whole) = measured[6];
    for (i, (splats, faster)) in LEVELS.into_iter().enumerate() {
        let (ms, counts) = measured[6 + i];
        let remark = if i == 0 {
            "his model is not named (172,974 is the number of vertices of Stanford's Armadillo); no camera".to_owned()
        } else {
            format!(
                "his share of splats {:.2}, ours {:.2}",
                splats as f64 / LEVELS[0].0 as f64,
                counts.splats as f64 / whole.splats.max(1) as f64
            )
        };
        levels.row(vec![
            count(splats),
            faster.into(),
            format!("{}", thresholds[i]),
            count(counts.splats),
            format!("{:.2}", whole_ms / ms),
            remark,
        ]);
    }
    tables.push(levels);

    let mut speed = PublishedTable::new(
        format!(
            "Dietz: frame rate against triangles; ours: {}",
            subject.name
        ),
        &["", "Dietz", "surfel", "remark"],
    );
    let triangles_ms = measured[0].0;
    for (i, threshold) in thresholds.into_iter().enumerate().skip(1) {
        speed.row(vec![
            format!("splats, threshold {threshold} px"),
            "up to 1.5".into(),
            format!("{:.2}", triangles_ms / measured[6 + i].0),
            "his on dense smooth models, without machine or camera".into(),
        ]);
    }
    speed.row(vec![
        "hybrid with angle test".into(),
        "down to 0.3".into(),
        angle_test.map_or("-".into(), |slower| format!("{:.2}", 1.0 / slower)),
        "threshold 20 degrees; both modes draw the same region".into(),
    ]);
    tables.push(speed);
    Ok((tables, lines))
}
