//! Measures of splats from vertices that the thesis lacks: how far they stand out, what they leave bare, how far
//! their pictures are from exact ones, and what they cost.

use super::dietz_holes::{bare_pixels, hole_table};
use super::{PublishedCell, PublishedSubject, PublishedTable, count, measure, ratio};
use crate::chart::ChartError;
use crate::chart::plot::angles::AngleLine;
use crate::chart::run::orbit;
use crate::measure::{PIXELS_PER_DEGREE, flip};
use crate::oriented::cones::{CULL_EYES, ConeRule, ConeTree};
use crate::oriented::look::VertexLook;
use crate::oriented::quality::{overhang, uncovered_share};
use crate::oriented::radius::RadiusRule;
use crate::oriented::resample::{SampleChoice, SamplePattern};
use crate::oriented::splats::{SplatRules, SplatSet, splats_of};
use crate::oriented::surface::WeldedSurface;
use crate::progress::Progress;
use crate::render::engine::{Backend, Engine};
use crate::render::vertex_looks::looks_of;
use crate::render::{Method, PictureOutputs, Settings};
use crate::tree::Model;
use std::time::Instant;

/// Views of a picture's error.
const VIEWS: u32 = 4;
/// Samples of a face that are looked for bare.
const SAMPLES: usize = 64;
/// Angles of the test and of clusters, degrees.
const ANGLES: [f64; 4] = [20.0, 10.0, 5.0, 2.0];

/// A way of drawing beside triangles.
struct EdgeWay {
    name: String,
    rules: SplatRules,
    /// The least angle that bounds how far it stands out, radians.
    angle: Option<f64>,
    /// Line of the chart, and the angle there.
    line: usize,
}

/// Lines of the chart of angles, in the order of their numbers.
const LINES: [&str; 6] = [
    "triangles, one sample",
    "whole splats, 0.65 d",
    "angle test",
    "cut at edges",
    "cut, the same uncut",
    "resampled, lattice",
];

/// Ways with angles, and those without.
fn ways() -> Vec<EdgeWay> {
    let usual = SplatRules::default();
    let dietz = SplatRules {
        radius: RadiusRule::Dietz,
        ..usual
    };
    let mut ways = vec![
        EdgeWay {
            name: "whole, 0.65 d".into(),
            rules: dietz,
            angle: None,
            line: 1,
        },
        EdgeWay {
            name: "whole, covering".into(),
            rules: usual,
            angle: None,
            line: usize::MAX,
        },
    ];
    for degrees in ANGLES {
        ways.push(EdgeWay {
            name: format!("angle test {degrees}\u{b0}"),
            rules: SplatRules {
                angle_test: Some(degrees.to_radians()),
                ..dietz
            },
            angle: None,
            line: 2,
        });
    }
    for degrees in ANGLES {
        let angle = degrees.to_radians();
        let clip = SplatRules {
            clip: Some(angle),
            ..usual
        };
        ways.push(EdgeWay {
            name: format!("cut {degrees}\u{b0}"),
            rules: clip,
            angle: Some(angle),
            line: 3,
        });
        ways.push(EdgeWay {
            name: format!("the same, uncut {degrees}\u{b0}"),
            rules: SplatRules {
                is_uncut: true,
                ..clip
            },
            angle: None,
            line: 4,
        });
    }
    let even = |pattern, degrees: f64| SplatRules {
        clip: Some(degrees.to_radians()),
        samples: Some(SampleChoice {
            pattern,
            spacing: None,
        }),
        ..usual
    };
    for degrees in ANGLES {
        ways.push(EdgeWay {
            name: format!("lattice {degrees}\u{b0}"),
            rules: even(SamplePattern::Lattice, degrees),
            angle: None,
            line: 5,
        });
    }
    for (name, pattern) in [
        ("Poisson disc", SamplePattern::Poisson),
        ("rays", SamplePattern::Rays),
    ] {
        ways.push(EdgeWay {
            name: format!("{name} 5\u{b0}"),
            rules: even(pattern, 5.0),
            angle: None,
            line: usize::MAX,
        });
    }
    ways
}

/// Angle of a way in the chart, degrees; none for those that have no angle.
fn angle_of(way: &EdgeWay) -> Option<f64> {
    match way.line {
        2 => way.rules.angle_test.map(f64::to_degrees),
        3..=5 => way.rules.clip.map(f64::to_degrees),
        _ => None,
    }
}

/// Figures of splats that need no picture: cost, overhang and bare area.
struct SurfaceFigures {
    us_a_vertex: f64,
    overhang: String,
    overhang_of_bound: String,
    bare: String,
}

fn surface_figures(
    surface: &WeldedSurface,
    looks: &[VertexLook],
    model: &Model,
    way: &EdgeWay,
    progress: &dyn Progress,
) -> SurfaceFigures {
    if way.rules.samples.is_some() {
        return SurfaceFigures {
            us_a_vertex: f64::NAN,
            overhang: "-".into(),
            overhang_of_bound: "-".into(),
            bare: "-".into(),
        };
    }
    let positions: Vec<_> = model.vertices.iter().map(|v| v.position).collect();
    // The fastest of three, since others use the machine as well.
    let us = (0..3).map(|_| {
        let start = Instant::now();
        let surface = WeldedSurface::new(&positions, &model.triangles);
        let made = splats_of(&surface, looks, &way.rules);
        let spent = start.elapsed().as_secs_f64() * 1e6;
        (spent, made)
    });
    let mut fastest = f64::INFINITY;
    let mut set = SplatSet::default();
    for (spent, made) in us {
        fastest = fastest.min(spent);
        set = made;
    }
    let far = overhang(surface, &set, progress);
    SurfaceFigures {
        us_a_vertex: fastest / surface.points.len().max(1) as f64,
        overhang: format!("{:.4}", 100.0 * far.most / surface.diagonal()),
        overhang_of_bound: match way.angle {
            Some(angle) => format!("{:.2}", far.most_of_radius / angle.tan()),
            None => "-".into(),
        },
        bare: format!(
            "{:.4}",
            100.0 * uncovered_share(surface, &set, SAMPLES, 1.0)
        ),
    }
}

/// Tables of a model, and the lines of its chart of angles.
///
/// # Errors
/// When a frame cannot be drawn, or `progress` is cancelled.
pub(super) fn tables(
    backend: &Backend,
    subject: &PublishedSubject<'_>,
    repeats: u32,
    progress: &dyn Progress,
) -> Result<(Vec<PublishedTable>, Vec<AngleLine>), ChartError> {
    let model = subject.model;
    let positions: Vec<_> = model.vertices.iter().map(|v| v.position).collect();
    let surface = WeldedSurface::new(&positions, &model.triangles);
    let (edges, lines) = edge_table(backend, subject, &surface, repeats, progress)?;
    let mut tables = vec![edges, hole_table(subject, &surface, progress)?];
    // Eyes times faces times levels: minutes for millions.
    if surface.faces.len() <= MOST_CONE_FACES {
        tables.push(cone_table(subject, &surface, progress)?);
    }
    Ok((tables, lines))
}

/// Most faces of a surface whose cones are counted.
const MOST_CONE_FACES: usize = 100_000;

fn edge_table(
    backend: &Backend,
    subject: &PublishedSubject<'_>,
    surface: &WeldedSurface,
    repeats: u32,
    progress: &dyn Progress,
) -> Result<(PublishedTable, Vec<AngleLine>), ChartError> {
    let model = subject.model;
    let looks = looks_of(model);
    let ways = ways();
    let view = orbit(model, (500, 500), 1.0, 0, VIEWS)?;
    let settings_of = |rules| Settings {
        method: Method::Splats,
        vertex_splats: Some(rules),
        ..Settings::default()
    };
    let triangles = Settings {
        method: Method::Triangles,
        ..Settings::default()
    };
    let mut cells = vec![PublishedCell {
        view,
        settings: triangles,
    }];
    cells.extend(ways.iter().map(|way| PublishedCell {
        view,
        settings: settings_of(way.rules),
    }));
    let measured = measure(backend, model, &cells, repeats, progress)?;
    let errors = picture_errors(backend, model, &cells, progress)?;
    let mut table = PublishedTable::new(
        format!(
            "Dietz: {}, splats from vertices at edges, 500 x 500, mean of {VIEWS} views against 16 samples of triangles; {}",
            subject.name,
            backend.name()
        ),
        &[
            "",
            "splats",
            "triangles",
            "\u{b5}s a vertex",
            "overhang, % of diagonal",
            "over r tan \u{3b2}",
            "bare, % of area",
            "bare px",
            "FLIP",
            "over whole",
            "over one sample",
            "ms",
            "over uncut",
        ],
    );
    let text = |value: f64| match value.is_finite() {
        true => format!("{value:.2}"),
        false => "-".into(),
    };
    let whole = errors[1].flip;
    for (i, ((ms, counts), error)) in measured.iter().zip(&errors).enumerate() {
        if progress.is_cancelled() {
            return Err(ChartError::Cancelled);
        }
        let way = i.checked_sub(1).map(|i| &ways[i]);
        let figures = way.map(|way| surface_figures(surface, &looks, model, way, progress));
        let of = |pick: fn(&SurfaceFigures) -> String| figures.as_ref().map_or("-".into(), pick);
        let next = ways.get(i).filter(|next| next.rules.is_uncut);
        let is_cut = way.is_some_and(|way| way.line == 3);
        table.row(vec![
            way.map_or("triangles, one sample".into(), |way| way.name.clone()),
            count(counts.splats),
            count(counts.triangles),
            figures.as_ref().map_or("-".into(), |f| text(f.us_a_vertex)),
            of(|f| f.overhang.clone()),
            of(|f| f.overhang_of_bound.clone()),
            of(|f| f.bare.clone()),
            count(error.bare),
            format!("{:.4}", error.flip),
            ratio(error.flip, whole),
            ratio(error.flip, errors[0].flip),
            format!("{ms:.2}"),
            match (is_cut, next) {
                (true, Some(_)) => ratio(*ms, measured[i + 1].0),
                _ => "-".into(),
            },
        ]);
    }
    let lines = chart_lines(
        &ways,
        &measured.iter().map(|m| m.0).collect::<Vec<_>>(),
        &errors,
    );
    Ok((table, lines))
}

/// Lines of the chart: error and time by angle; ways without one are level.
fn chart_lines(ways: &[EdgeWay], times: &[f64], errors: &[WayError]) -> Vec<AngleLine> {
    let mut lines: Vec<AngleLine> = LINES
        .map(|name| AngleLine {
            name: name.to_owned(),
            points: Vec::new(),
        })
        .into();
    for (i, (&ms, error)) in times.iter().zip(errors).enumerate() {
        let way = i.checked_sub(1).map(|i| &ways[i]);
        let line = way.map_or(0, |way| way.line);
        if let Some(line) = lines.get_mut(line) {
            line.points.push((way.and_then(angle_of), error.flip, ms));
        }
    }
    lines
}

/// Errors of the pictures of one way to draw.
#[derive(Debug, Clone, Copy, Default)]
struct WayError {
    /// Mean over views.
    flip: f64,
    /// Of all views together.
    bare: u64,
}

fn picture_errors(
    backend: &Backend,
    model: &Model,
    cells: &[PublishedCell],
    progress: &dyn Progress,
) -> Result<Vec<WayError>, ChartError> {
    let outputs = PictureOutputs {
        depth: true,
        ..PictureOutputs::default()
    };
    let mut errors = vec![WayError::default(); cells.len()];
    let mut engine = Engine::new(backend, model, (500, 500), outputs)?;
    progress.stage("pictures", u64::from(VIEWS) * cells.len() as u64);
    for k in 0..VIEWS {
        let view = orbit(model, (500, 500), 1.0, k, VIEWS)?;
        let reference = engine.supersample(&view, &cells[0].settings, 4)?;
        let exact = engine.render(&view, &cells[0].settings)?;
        for (cell, error) in cells.iter().zip(&mut errors) {
            if progress.is_cancelled() {
                return Err(ChartError::Cancelled);
            }
            let picture = engine.render(&view, &cell.settings)?;
            error.flip += flip(&reference, &picture, PIXELS_PER_DEGREE)?.mean / f64::from(VIEWS);
            error.bare += bare_pixels(&exact, &picture, model.orbit_radius);
            progress.advance(1);
        }
    }
    Ok(errors)
}

/// Faces that turn to the eye and are culled by the cones of the thesis, and by ours.
fn cone_table(
    subject: &PublishedSubject<'_>,
    surface: &WeldedSurface,
    progress: &dyn Progress,
) -> Result<PublishedTable, ChartError> {
    let mut table = PublishedTable::new(
        format!(
            "Dietz: {}, anchored cones of a tree over faces, {CULL_EYES} eyes",
            subject.name
        ),
        &["", "faces culled", "of them seen", "remark"],
    );
    let by_faces = |rule| ConeTree::of_faces(surface, rule);
    for (name, tree, remark) in [
        (
            "as printed",
            by_faces(ConeRule::Printed),
            "tells who is outside and takes it for inside",
        ),
        (
            "turned round",
            by_faces(ConeRule::Turned),
            "wrong above 45 degrees",
        ),
        ("ours", by_faces(ConeRule::Corrected), ""),
        (
            "ours of a vertex, its mean normal",
            ConeTree::of_vertices(surface),
            "nodes of one vertex as he has them; a face counts once a vertex",
        ),
    ] {
        if progress.is_cancelled() {
            return Err(ChartError::Cancelled);
        }
        let found = tree.count(progress);
        table.row(vec![
            name.into(),
            count(found.culled as u64),
            count(found.wrong as u64),
            remark.into(),
        ]);
    }
    if progress.is_cancelled() {
        return Err(ChartError::Cancelled);
    }
    Ok(table)
}
