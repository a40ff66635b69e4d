//! Benda, *Point Based Rendering* (thesis), tables 5.1 to 5.6 and figure 5.8.
//!
//! Printed: a window of 500 x 500 pixels, splat size and threshold 3, culling on, distances z = 1 to 7. Not printed: field
//! of view, what z is measured from, the models' scale and orientation, the number of runs. Here: what fits his counts of
//! the sphere best, a vertical field of view of 60 degrees, the eye at z + 0.9 from the center of a model of bounding
//! radius 1, the sphere's poles 30 degrees off the view axis, and the diameter over the center's depth as size.

use super::{PublishedCell, PublishedSubject, PublishedTable, count, measure, ratio};
use crate::chart::ChartError;
use crate::cut::SizeMetric;
use crate::math::camera::{Camera, View};
use crate::progress::Progress;
use crate::render::engine::Backend;
use crate::render::{Culling, Method, Path, Settings};
use crate::tree::{Model, OrbitSphere};
use glam::DVec3;

/// FPS, triangles and points of a frame.
type BendaFrame = (f64, u64, u64);

/// One of his models.
#[derive(Debug)]
pub struct BendaTable {
    /// Name in the thesis.
    pub name: &'static str,
    /// Vertices, table 5.1.
    pub vertices: u64,
    /// Triangles, table 5.1.
    pub triangles: u64,
    /// Nodes and leaves, table 5.6.
    pub nodes: u64,
    /// Building the tree, seconds, table 5.2.
    build_s: f64,
    /// Frames a second of all triangles, table 5.4.
    classic_fps: f64,
    /// Threshold 3, distances 1 to 7, table 5.3.
    by_distance: [BendaFrame; 7],
    /// Thresholds 1 to 5, table 5.5.
    by_threshold: [BendaFrame; 5],
    /// The distance of table 5.5, which is not printed: where its column of threshold 3 equals table 5.3.
    distance: u32,
    /// Elevation of the eye that is used here, degrees.
    elevation: f64,
    /// What is not known of it.
    remark: &'static str,
}

/// His five models.
pub const MODELS: [BendaTable; 5] = [
    BendaTable {
        name: "horse",
        vertices: 48_485,
        triangles: 96_966,
        nodes: 140_657,
        build_s: 1.05,
        classic_fps: 70.0,
        by_distance: [
            (46.0, 29_014, 9_507),
            (46.0, 2_229, 36_644),
            (63.0, 146, 28_447),
            (105.0, 76, 17_670),
            (117.0, 55, 16_061),
            (135.0, 47, 13_580),
            (196.0, 37, 8_476),
        ],
        by_threshold: [
            (41.58, 41_959, 476),
            (42.16, 3_564, 38_383),
            (63.0, 146, 28_447),
            (111.0, 64, 16_735),
            (131.0, 44, 13_967),
        ],
        distance: 3,
        elevation: 0.0,
        remark: "scale and orientation unknown",
    },
    BendaTable {
        name: "hand",
        vertices: 327_323,
        triangles: 654_666,
        nodes: 1_003_497,
        build_s: 11.71,
        classic_fps: 10.9,
        by_distance: [
            (7.27, 43_118, 223_709),
            (15.84, 0, 129_706),
            (36.63, 0, 49_826),
            (47.0, 0, 38_095),
            (74.0, 0, 22_243),
            (108.0, 0, 14_339),
            (121.0, 0, 13_108),
        ],
        by_threshold: [
            (6.09, 229_706, 84_268),
            (8.65, 32, 225_187),
            (15.84, 0, 129_706),
            (27.18, 0, 71_514),
            (43.56, 0, 41_560),
        ],
        distance: 2,
        elevation: 0.0,
        remark: "scale and orientation unknown",
    },
    BendaTable {
        name: "dragon",
        vertices: 437_645,
        triangles: 871_414,
        nodes: 1_220_939,
        build_s: 16.37,
        classic_fps: 8.25,
        by_distance: [
            (8.33, 17_822, 215_049),
            (15.53, 882, 127_486),
            (26.21, 58, 74_497),
            (39.0, 3, 48_007),
            (52.48, 0, 34_533),
            (66.0, 0, 26_762),
            (85.0, 0, 20_382),
        ],
        by_threshold: [
            (5.04, 150_355, 238_495),
            (8.41, 14_382, 219_683),
            (15.53, 882, 127_486),
            (25.74, 64, 75_285),
            (38.24, 7, 48_586),
        ],
        distance: 2,
        elevation: 0.0,
        remark: "scale and orientation unknown",
    },
    BendaTable {
        name: "sphere",
        vertices: 501_501,
        triangles: 1_000_000,
        nodes: 1_349_525,
        build_s: 16.58,
        classic_fps: 7.1,
        by_distance: [
            (8.82, 98_001, 169_007),
            (14.85, 0, 147_646),
            (27.72, 0, 80_378),
            (38.24, 0, 56_204),
            (68.0, 0, 30_542),
            (88.0, 0, 23_865),
            (95.0, 0, 21_669),
        ],
        by_threshold: [
            (7.08, 332_996, 49),
            (8.26, 0, 280_443),
            (14.85, 0, 147_646),
            (29.0, 0, 76_935),
            (36.63, 0, 58_697),
        ],
        distance: 2,
        elevation: 60.0,
        remark: "camera fitted to these counts; our spheres are tighter, so a splat is drawn earlier",
    },
    BendaTable {
        name: "torus",
        vertices: 2_020_101,
        triangles: 4_000_000,
        nodes: 5_398_101,
        build_s: 104.8,
        classic_fps: 1.8,
        by_distance: [
            (2.24, 0, 907_676),
            (4.17, 0, 434_868),
            (7.84, 0, 207_231),
            (10.0, 0, 161_845),
            (13.0, 0, 125_540),
            (18.27, 0, 87_903),
            (23.53, 0, 67_515),
        ],
        by_threshold: [
            (1.2, 0, 1_879_977),
            (3.54, 0, 520_579),
            (7.84, 0, 207_231),
            (10.78, 0, 150_517),
            (15.84, 0, 101_069),
        ],
        distance: 3,
        elevation: 60.0,
        remark: "his radii are unknown (ours 1 and 0.4), so his counts cannot be met",
    },
];

/// His model of as many triangles, to a part in a hundred.
pub fn published(model: &Model) -> Option<&'static BendaTable> {
    let triangles = model.triangles.len() as f64;
    MODELS
        .iter()
        .find(|m| (triangles / m.triangles as f64 - 1.0).abs() < 0.01)
}

/// His window, in the eye that fits.
fn view(model: &Model, z: u32, elevation: f64) -> Result<View, ChartError> {
    let OrbitSphere { center, radius } = model.orbit_sphere();
    let radius = if radius > 0.0 { radius } else { 1.0 };
    let distance = f64::from(z) + 0.9;
    let (sin, cos) = elevation.to_radians().sin_cos();
    let eye = center + DVec3::new(0.0, sin, cos) * distance * radius;
    let camera = Camera::look_at(
        (500, 500),
        eye,
        center,
        DVec3::Y,
        60f64.to_radians(),
        [0.01 * radius, (distance + 1.1) * radius],
    );
    Ok(camera.view(model.origin)?)
}

/// His hybrid at a threshold.
fn pop(threshold_px: f32) -> Settings {
    Settings {
        method: Method::Pop,
        threshold_px,
        culling: Culling::On,
        size: SizeMetric::Center,
        ..Settings::default()
    }
}

/// His tables for one of his models; an empty list for another.
///
/// # Errors
/// When a frame cannot be drawn, or `progress` is cancelled.
pub fn tables(
    backend: &Backend,
    subject: &PublishedSubject<'_>,
    repeats: u32,
    progress: &dyn Progress,
) -> Result<Vec<PublishedTable>, ChartError> {
    let model = subject.model;
    let Some(published) = published(model) else {
        return Ok(Vec::new());
    };
    let classic = Settings {
        method: Method::Triangles,
        path: Path::Raster,
        culling: Culling::On,
        ..Settings::default()
    };
    let mut cells = Vec::new();
    for z in 1..=7 {
        let view = view(model, z, published.elevation)?;
        for settings in [classic, pop(3.0)] {
            cells.push(PublishedCell { view, settings });
        }
    }
    let at = view(model, published.distance, published.elevation)?;
    for threshold in 1..=5u8 {
        cells.push(PublishedCell {
            view: at,
            settings: pop(f32::from(threshold)),
        });
    }
    let measured = measure(backend, model, &cells, repeats, progress)?;
    let classic_ms: Vec<f64> = (0..7).map(|z| measured[2 * z].0).collect();
    let mean_classic = classic_ms.iter().sum::<f64>() / 7.0;
    Ok(vec![
        sizes(published, subject, mean_classic),
        frames(
            format!("table 5.3: {}, threshold 3, by distance z", published.name),
            "z",
            &published.by_distance,
            published,
            &|z| (classic_ms[z], measured[2 * z + 1]),
        ),
        frames(
            format!(
                "table 5.5: {}, by threshold, at z = {} (not printed; where its threshold 3 equals table 5.3)",
                published.name, published.distance
            ),
            "threshold",
            &published.by_threshold,
            published,
            &|t| {
                (
                    classic_ms[published.distance as usize - 1],
                    measured[14 + t],
                )
            },
        ),
    ])
}

fn sizes(
    published: &BendaTable,
    subject: &PublishedSubject<'_>,
    classic_ms: f64,
) -> PublishedTable {
    let mut table = PublishedTable::new(
        format!(
            "Benda, tables 5.1, 5.2, 5.4, 5.6: {} ({})",
            published.name, subject.name
        ),
        &["", "Benda", "surfel", "remark"],
    );
    let model = subject.model;
    let exact = |a: u64, b: u64, why: &str| {
        if a == b {
            "equal".into()
        } else {
            why.to_owned()
        }
    };
    let (vertices, triangles) = (model.vertices.len() as u64, model.triangles.len() as u64);
    let nodes = subject.nodes() as u64;
    let other_file = "another version of the model";
    table.row(vec![
        "vertices".into(),
        count(published.vertices),
        count(vertices),
        exact(
            published.vertices,
            vertices,
            "his grids double vertices at seams, or another version of the model",
        ),
    ]);
    table.row(vec![
        "triangles".into(),
        count(published.triangles),
        count(triangles),
        exact(published.triangles, triangles, other_file),
    ]);
    table.row(vec![
        "nodes and leaves".into(),
        count(published.nodes),
        count(nodes),
        exact(
            published.nodes,
            nodes,
            "of another number of triangles, or another shape of the tree",
        ),
    ]);
    let per_triangle = |seconds: f64, n: u64| format!("{:.3}", 1e6 * seconds / n.max(1) as f64);
    table.row(vec![
        "build, s".into(),
        format!("{}", published.build_s),
        if subject.build_s > 0.0 {
            format!("{:.3}", subject.build_s)
        } else {
            "-".into()
        },
        if subject.build_s > 0.0 {
            "his on one Athlon XP 1800+".into()
        } else {
            "ours was read from a tree file".into()
        },
    ]);
    table.row(vec![
        "build, \u{b5}s a triangle".into(),
        per_triangle(published.build_s, published.triangles),
        per_triangle(subject.build_s, triangles),
        String::new(),
    ]);
    table.row(vec![
        "all triangles, ms".into(),
        format!("{:.1}", 1000.0 / published.classic_fps),
        format!("{classic_ms:.1}"),
        "his on a GeForce4 Ti 4200; ours the mean of seven distances".into(),
    ]);
    table.row(vec![
        "million triangles a second".into(),
        format!(
            "{:.2}",
            published.classic_fps * published.triangles as f64 / 1e6
        ),
        format!("{:.2}", triangles as f64 / classic_ms / 1e3),
        String::new(),
    ]);
    table.row(vec![
        "memory, bytes a triangle".into(),
        "-".into(),
        format!("{:.1}", subject.bytes() as f64 / triangles.max(1) as f64),
        "he prints none; vertices, triangles and tree".into(),
    ]);
    table
}

fn frames(
    title: String,
    name: &str,
    theirs: &[BendaFrame],
    published: &BendaTable,
    ours: &dyn Fn(usize) -> (f64, (f64, crate::render::stats::FrameCounts)),
) -> PublishedTable {
    let mut table = PublishedTable::new(
        format!("Benda, {title}"),
        &[
            name,
            "triangles",
            "ours",
            "points",
            "ours",
            "points ratio",
            "faster than all triangles",
            "ours",
            "primitives/s, M",
            "ours",
            "remark",
        ],
    );
    for (i, &(fps, triangles, points)) in theirs.iter().enumerate() {
        let (classic_ms, (ms, counts)) = ours(i);
        let mut remark = published.remark.to_owned();
        if published.name == "sphere" && name == "threshold" && i == 0 {
            remark += "; his 49 points are not explained";
        }
        table.row(vec![
            (i + 1).to_string(),
            count(triangles),
            count(counts.triangles),
            count(points),
            count(counts.splats),
            ratio(counts.splats as f64, points as f64),
            format!("{:.2}", fps / published.classic_fps),
            format!("{:.2}", classic_ms / ms),
            format!("{:.2}", fps * (triangles + points) as f64 / 1e6),
            format!(
                "{:.2}",
                (counts.triangles + counts.splats) as f64 / ms / 1e3
            ),
            remark,
        ]);
    }
    table
}

/// Figure 5.8: nodes and leaves of unit squares, which he does not print. `squares` has triangles and nodes of ours.
pub fn squares(squares: &[(u64, u64)]) -> PublishedTable {
    let mut table = PublishedTable::new(
        "Benda, figure 5.8: unit square, nodes and leaves",
        &["triangles", "Benda", "surfel", "remark"],
    );
    for &(triangles, nodes) in squares {
        table.row(vec![
            count(triangles),
            "-".into(),
            count(nodes),
            "a graph without numbers; our shape of the tree is the one that gives table 5.6".into(),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_tables_agree_with_each_other() {
        for m in &MODELS {
            // Table 5.5 at threshold 3 is table 5.3 at its distance.
            assert_eq!(
                m.by_threshold[2],
                m.by_distance[m.distance as usize - 1],
                "{}",
                m.name
            );
            assert!(m.nodes > m.triangles && m.nodes < 2 * m.triangles);
            // Fewer points the farther away.
            assert!(m.by_distance[1..].windows(2).all(|p| p[0].2 > p[1].2));
        }
    }
}
