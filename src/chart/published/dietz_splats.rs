//! Dietz's angle test beside ours, and what his splats and splats that are cut at edges make of a picture.

use super::{PublishedCell, PublishedSubject, PublishedTable, count, measure};
use crate::chart::ChartError;
use crate::math::camera::View;
use crate::math::octahedral;
use crate::measure::{PIXELS_PER_DEGREE, coverage, flip};
use crate::oriented::angle_test::{self, FaceWeight};
use crate::oriented::radius::RadiusRule;
use crate::oriented::splats::SplatRules;
use crate::oriented::surface::WeldedSurface;
use crate::progress::Progress;
use crate::render::engine::{Backend, Engine};
use crate::render::{Method, PictureOutputs, Settings};
use crate::tree::Model;
use glam::DVec3;

/// Threshold of the angle in degrees, splats, triangles.
const PORSCHE: [(u32, u64, u64); 4] = [
    (20, 2269, 5229),
    (10, 1804, 6448),
    (5, 1142, 6875),
    (2, 520, 7102),
];

/// Points that keep their splat and triangles that are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct AngleTestCounts {
    splats: u64,
    triangles: u64,
}

/// Makes a table of Dietz's counts for the Porsche beside those that his test finds here, by each rule that he may have
/// had for the normals of points. `model` is the Porsche.
pub(super) fn angle_test_table(model: &Model) -> PublishedTable {
    let mut table = PublishedTable::new(
        "Dietz: Porsche, angle test, splats and triangles by threshold",
        &[
            "threshold",
            "Dietz",
            "mean of faces",
            "by area",
            "by angle",
            "normals of the file",
            "triangles of the best over his",
            "remark",
        ],
    );
    let positions: Vec<_> = model.vertices.iter().map(|v| v.position).collect();
    let surface = WeldedSurface::new(&positions, &model.triangles);
    let of_file = normals_of_file(model, &surface);
    for (degrees, splats, triangles) in PORSCHE {
        let threshold = f64::from(degrees).to_radians();
        let weights = [FaceWeight::Equal, FaceWeight::Area, FaceWeight::Angle];
        let mut ours: Vec<AngleTestCounts> = (weights.iter())
            .map(|&weight| {
                let flagged = angle_test::flagged(&surface, threshold, weight);
                counts_of(&surface, &flagged)
            })
            .collect();
        let is_flagged = |point: usize| {
            angle_test::least_cosine(&surface, point as u32, of_file[point]) < threshold.cos()
        };
        let flagged: Vec<bool> = (0..surface.points.len()).map(is_flagged).collect();
        ours.push(counts_of(&surface, &flagged));
        let off = |counts: &AngleTestCounts| counts.triangles.abs_diff(triangles);
        let best = ours.iter().min_by_key(|counts| off(counts)).copied();
        let text = |splats, triangles| format!("{} / {}", count(splats), count(triangles));
        let mut row = vec![format!("{degrees}\u{b0}"), text(splats, triangles)];
        row.extend(ours.iter().map(|c| text(c.splats, c.triangles)));
        row.push(best.map_or("-".into(), |c| {
            super::ratio(c.triangles as f64, triangles as f64)
        }));
        row.push("he does not say how the normals of points are found".into());
        table.row(row);
    }
    table
}

/// Distinct positions of vertices: a file that gives normals to corners repeats them.
pub(super) fn point_count(model: &Model) -> u64 {
    let positions: Vec<_> = model.vertices.iter().map(|v| v.position).collect();
    WeldedSurface::new(&positions, &[]).points.len() as u64
}

/// The sum of the normals that vertices at each point have, of unit length.
fn normals_of_file(model: &Model, surface: &WeldedSurface) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; surface.points.len()];
    for (&point, vertex) in surface.point_of_vertex.iter().zip(&model.vertices) {
        normals[point as usize] += octahedral::decode(vertex.normal).as_dvec3();
    }
    normals.into_iter().map(DVec3::normalize_or_zero).collect()
}

fn counts_of(surface: &WeldedSurface, flagged: &[bool]) -> AngleTestCounts {
    let splats = flagged.iter().filter(|&&flag| !flag).count();
    AngleTestCounts {
        splats: splats as u64,
        triangles: angle_test::faces_of(surface, flagged).len() as u64,
    }
}

/// Pictures of a model by his splats and by ours: what they draw, how far they are from 16 samples of the triangles, and how
/// long a frame takes. The second is the frame of his angle test over that of triangles.
///
/// # Errors
/// Those of [`measure`].
pub(super) fn pictures(
    backend: &Backend,
    subject: &PublishedSubject<'_>,
    view: View,
    repeats: u32,
    progress: &dyn Progress,
) -> Result<(PublishedTable, f64), ChartError> {
    let (names, cells): (Vec<_>, Vec<_>) = looks(view).into_iter().unzip();
    let measured = measure(backend, subject.model, &cells, repeats, progress)?;
    let size = (view.width, view.height);
    let mut engine = Engine::new(backend, subject.model, size, PictureOutputs::default())?;
    let reference = engine.supersample(&view, &cells[0].settings, 4)?;
    let mut table = PublishedTable::new(
        format!(
            "Dietz: splats from vertices, {}, {} x {} pixels, one sample each, against 16 samples of the triangles; {}",
            subject.name,
            view.width,
            view.height,
            backend.name()
        ),
        &[
            "",
            "splats",
            "triangles",
            "FLIP",
            "missing px",
            "extra px",
            "ms",
            "remark",
        ],
    );
    for ((name, cell), (ms, counts)) in names.iter().zip(&cells).zip(&measured) {
        let picture = engine.render(&cell.view, &cell.settings)?;
        let flip = flip(&reference, &picture, PIXELS_PER_DEGREE)?;
        let covered = coverage(&reference, &picture)?;
        table.row(vec![
            (*name).to_owned(),
            count(counts.splats),
            count(counts.triangles),
            format!("{:.4}", flip.mean),
            count(covered.missing),
            count(covered.extra),
            format!("{ms:.2}"),
            match cell.settings.vertex_splats.and_then(|rules| rules.clip) {
                Some(_) => "ours".to_owned(),
                None => String::new(),
            },
        ]);
    }
    let angle_test = measured[ANGLE_TEST].0 / measured[0].0;
    Ok((table, angle_test))
}

/// Where the angle test of 20 degrees is among [`looks`].
const ANGLE_TEST: usize = 3;

/// Names and cells: triangles, whole splats, his angle test, and splats that are cut.
fn looks(view: View) -> Vec<(&'static str, PublishedCell)> {
    let cell = |method, vertex_splats| PublishedCell {
        view,
        settings: Settings {
            method,
            vertex_splats,
            ..Settings::default()
        },
    };
    let whole = |radius, degrees: Option<f64>| {
        let rules = SplatRules {
            radius,
            angle_test: degrees.map(f64::to_radians),
            ..SplatRules::default()
        };
        cell(Method::Splats, Some(rules))
    };
    let cut = |degrees: f64| {
        let rules = SplatRules {
            clip: Some(degrees.to_radians()),
            ..SplatRules::default()
        };
        cell(Method::Splats, Some(rules))
    };
    vec![
        ("triangles", cell(Method::Triangles, None)),
        ("whole splats, 0.65 d", whole(RadiusRule::Dietz, None)),
        ("whole splats that cover", whole(RadiusRule::Cover, None)),
        ("angle test 20\u{b0}", whole(RadiusRule::Dietz, Some(20.0))),
        ("angle test 10\u{b0}", whole(RadiusRule::Dietz, Some(10.0))),
        ("angle test 5\u{b0}", whole(RadiusRule::Dietz, Some(5.0))),
        ("angle test 2\u{b0}", whole(RadiusRule::Dietz, Some(2.0))),
        ("cut at edges 20\u{b0}", cut(20.0)),
        ("cut at edges 10\u{b0}", cut(10.0)),
        ("cut at edges 5\u{b0}", cut(5.0)),
        ("cut at edges 2\u{b0}", cut(2.0)),
    ]
}
