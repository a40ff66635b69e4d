//! Measures of splats from vertices that the thesis lacks: how far they stand out, what they leave bare, how far
//! their pictures are from exact ones, and what they cost.

use super::{PublishedCell, PublishedSubject, Table, count, measure, ratio};
use crate::abi::OrientedPolygon;
use crate::chart::Error;
use crate::chart::plot::angles::AngleLine;
use crate::chart::run::orbit;
use crate::image::Image;
use crate::math::camera::View;
use crate::measure::{PIXELS_PER_DEGREE, flip};
use crate::oriented::cones::{CULL_EYES, ConeRule, count_culls};
use crate::oriented::look::VertexLook;
use crate::oriented::quality::{overhang, uncovered_share};
use crate::oriented::radius::RadiusRule;
use crate::oriented::resample::{SampleChoice, SamplePattern};
use crate::oriented::splats::{SplatRules, SplatSet, splats_of};
use crate::oriented::surface::WeldedSurface;
use crate::pack::polygons::PlaneFrame;
use crate::pack::{DrawList, Style};
use crate::progress::Progress;
use crate::render::engine::{Backend, Engine};
use crate::render::reference::{PolygonList, render_with_polygons};
use crate::render::vertex_splats::looks_of;
use crate::render::{Method, PictureOutputs, Settings};
use crate::tree::Model;
use glam::DVec3;
use std::time::Instant;

/// Views of a picture's error.
const VIEWS: u32 = 4;
/// Views in which holes are looked for.
const HOLE_VIEWS: u32 = 12;
/// Samples of a face that are looked for bare.
const SAMPLES: usize = 64;
/// Angles of the test and of clusters, degrees.
const ANGLES: [f64; 4] = [20.0, 10.0, 5.0, 2.0];
/// By how much normals are off in the second table, degrees.
const OFF_DEGREES: f64 = 10.0;
/// Part of the model's radius by which a pixel is farther than the surface beside it where it shows what a hole lets through.
const HOLE_DEPTH: f32 = 0.01;

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
    for (name, pattern, line) in [
        ("lattice", SamplePattern::Lattice, 5),
        ("Poisson disc", SamplePattern::Poisson, usize::MAX),
        ("rays", SamplePattern::Rays, usize::MAX),
    ] {
        ways.push(EdgeWay {
            name: format!("{name}, usual spacing"),
            rules: SplatRules {
                clip: Some(5f64.to_radians()),
                samples: Some(SampleChoice {
                    pattern,
                    spacing: None,
                }),
                ..usual
            },
            angle: None,
            line,
        });
    }
    ways
}

/// Angle of a way in the chart, degrees; none for those that have no angle.
fn angle_of(way: &EdgeWay) -> Option<f64> {
    match way.line {
        2 => way.rules.angle_test.map(f64::to_degrees),
        3 | 4 => way.rules.clip.map(f64::to_degrees),
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
    let far = overhang(surface, &set);
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
) -> Result<(Vec<Table>, Vec<AngleLine>), Error> {
    let model = subject.model;
    let positions: Vec<_> = model.vertices.iter().map(|v| v.position).collect();
    let surface = WeldedSurface::new(&positions, &model.triangles);
    let (edges, lines) = edge_table(backend, subject, &surface, repeats, progress)?;
    let mut tables = vec![edges, hole_table(subject, &surface, progress)?];
    // Eyes times faces times levels: minutes for millions.
    if surface.faces.len() <= MOST_CONE_FACES {
        tables.push(cone_table(subject, &surface));
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
) -> Result<(Table, Vec<AngleLine>), Error> {
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
    let mut table = Table::new(
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
        let way = i.checked_sub(1).map(|i| &ways[i]);
        let figures = way.map(|way| surface_figures(surface, &looks, model, way));
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
) -> Result<Vec<WayError>, Error> {
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
                return Err(Error::Cancelled);
            }
            let picture = engine.render(&view, &cell.settings)?;
            error.flip += flip(&reference, &picture, PIXELS_PER_DEGREE)?.mean / f64::from(VIEWS);
            error.bare += bare_pixels(&exact, &picture, model.orbit_radius);
            progress.advance(1);
        }
    }
    Ok(errors)
}

/// Pixels within the surface, by a pixel all around, that show nothing or what lies behind all that is near them there.
fn bare_pixels(exact: &Image, picture: &Image, radius: f32) -> u64 {
    let (width, height) = (exact.width as usize, exact.height as usize);
    let is_bare = |(x, y): (usize, usize)| {
        let around = (0..9).map(|k| exact.depth[(y + k / 3 - 1) * width + x + k % 3 - 1]);
        let farthest = around.fold(0.0, f32::max);
        let own = picture.depth[y * width + x];
        farthest.is_finite() && own > farthest + HOLE_DEPTH * radius
    };
    let inside = (1..height.saturating_sub(1))
        .flat_map(|y| (1..width.saturating_sub(1)).map(move |x| (x, y)));
    inside.filter(|&at| is_bare(at)).count() as u64
}

/// Bare pixels where planes follow faces, and where their normals are off.
fn hole_table(
    subject: &PublishedSubject<'_>,
    surface: &WeldedSurface,
    progress: &dyn Progress,
) -> Result<Table, Error> {
    let model = subject.model;
    let usual = SplatRules::default();
    let cut = SplatRules {
        clip: Some(5f64.to_radians()),
        ..usual
    };
    let with = |radius| SplatRules { radius, ..usual };
    let exact_looks = looks_of(model);
    let off_looks: Vec<VertexLook> = (exact_looks.iter().enumerate())
        .map(|(k, look)| VertexLook {
            normal: tilted(look.normal, k),
            ..*look
        })
        .collect();
    let rows = [
        ("whole, 0.5 d", with(RadiusRule::Dietz50)),
        ("whole, 0.65 d", with(RadiusRule::Dietz)),
        ("whole, covering", usual),
        ("cut 5\u{b0}", cut),
    ];
    let mut table = Table::new(
        format!(
            "Dietz: {}, bare pixels of {HOLE_VIEWS} views of 300 x 300, with normals as they are and off by {OFF_DEGREES} degrees",
            subject.name
        ),
        &["", "exact normals", "normals off", "remark"],
    );
    progress.stage("holes", 2 * rows.len() as u64);
    for (name, rules) in rows {
        let mut cells = vec![name.to_owned()];
        for is_off in [false, true] {
            if progress.is_cancelled() {
                return Err(Error::Cancelled);
            }
            let looks = if is_off { &off_looks } else { &exact_looks };
            let mut set = splats_of(surface, looks, &rules);
            if is_off && rules.clip.is_none() {
                for (k, splat) in set.splats.iter_mut().enumerate() {
                    tilt(splat, k);
                }
            }
            cells.push(count(bare_in_views(model, &set)?));
            progress.advance(1);
        }
        cells.push(match rules.clip {
            Some(_) => "planes are those of faces; normals decide light alone".into(),
            None => "the plane has the normal".into(),
        });
        table.row(cells);
    }
    Ok(table)
}

fn bare_in_views(model: &Model, set: &SplatSet) -> Result<u64, Error> {
    let outputs = PictureOutputs {
        depth: true,
        ..PictureOutputs::default()
    };
    let beside: Vec<[u32; 3]> = (set.triangles.iter())
        .map(|&id| model.triangles[id as usize])
        .collect();
    let style = Style::default();
    let mut bare = 0;
    for k in 0..HOLE_VIEWS {
        let view: View = orbit(model, (300, 300), 1.0, k, HOLE_VIEWS)?;
        let draw = |triangles: &[[u32; 3]], polygons| {
            let list = DrawList {
                vertices: &model.vertices,
                triangles,
                splats: &[],
                points: &[],
                textures: None,
            };
            let polygons = PolygonList {
                polygons,
                are_patches: false,
            };
            render_with_polygons(&view, &list, polygons, &style, outputs)
        };
        let exact = draw(&model.triangles, &[]);
        let picture = draw(&beside, &set.splats);
        bare += bare_pixels(&exact, &picture, model.orbit_radius);
    }
    Ok(bare)
}

/// A direction turned by [`OFF_DEGREES`] to a side that follows from a number.
fn tilted(normal: DVec3, k: usize) -> DVec3 {
    let Some(normal) = normal.try_normalize() else {
        return normal;
    };
    let turn = k as f64 * 2.399_963_229_728_653;
    let (u, v) = normal.any_orthonormal_pair();
    let (sine, cosine) = OFF_DEGREES.to_radians().sin_cos();
    cosine * normal + sine * (turn.cos() * u + turn.sin() * v)
}

/// Turns the plane of a whole disc so.
fn tilt(splat: &mut OrientedPolygon, k: usize) {
    let normal = tilted(splat.normal.as_dvec3(), k);
    if let Some(frame) = PlaneFrame::new(splat.center.as_dvec3(), normal) {
        splat.normal = frame.normal.as_vec3();
        splat.axis = frame.axis.as_vec3();
    }
}

/// Faces that turn to the eye and are culled by the cones of the thesis, and by ours.
fn cone_table(subject: &PublishedSubject<'_>, surface: &WeldedSurface) -> Table {
    let mut table = Table::new(
        format!("Dietz: {}, anchored cones, {CULL_EYES} eyes", subject.name),
        &["", "nodes culled", "faces culled that are seen", "remark"],
    );
    for (name, rule, remark) in [
        (
            "as printed",
            ConeRule::Printed,
            "tells who is outside and takes it for inside",
        ),
        ("turned round", ConeRule::Turned, "wrong above 45 degrees"),
        ("ours", ConeRule::Corrected, ""),
    ] {
        let found = count_culls(surface, rule);
        table.row(vec![
            name.into(),
            count(found.culled as u64),
            count(found.wrong as u64),
            remark.into(),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, Vec3};

    #[test]
    fn what_lies_behind_a_surface_is_bare_and_an_outline_is_not() {
        let at = |depth: f32| Image {
            width: 5,
            height: 5,
            color: vec![[0; 4]; 25],
            depth: vec![depth; 25],
            ..Image::default()
        };
        let mut exact = at(1.0);
        let mut picture = at(1.001);
        assert_eq!(bare_pixels(&exact, &picture, 1.0), 0);
        picture.depth[12] = f32::INFINITY;
        picture.depth[13] = 1.5;
        assert_eq!(bare_pixels(&exact, &picture, 1.0), 2);
        // Beside what is bare in the exact picture too there is an outline.
        exact.depth[11] = f32::INFINITY;
        assert_eq!(bare_pixels(&exact, &picture, 1.0), 1);
    }

    #[test]
    fn tilted_normals_are_off_by_the_angle_whatever_they_are() {
        for (k, normal) in [DVec3::X, DVec3::NEG_Z, DVec3::ONE].into_iter().enumerate() {
            let off = tilted(normal, k).angle_between(normal).to_degrees();
            assert!((off - OFF_DEGREES).abs() < 1e-9, "{off}");
        }
        assert_eq!(tilted(DVec3::ZERO, 3), DVec3::ZERO);
        let disc = PlaneFrame::new(DVec3::ZERO, DVec3::Y)
            .and_then(|frame| OrientedPolygon::disc(&frame, 1.0, &[], [255; 4]));
        let mut disc = disc.unwrap_or_else(|| unreachable!("a disc"));
        tilt(&mut disc, 1);
        assert!((disc.normal.dot(disc.axis)).abs() < 1e-6);
        assert!((disc.normal.dot(Vec3::Y) - 10f32.to_radians().cos()).abs() < 1e-6);
        let axes = DMat3::from_cols(
            disc.axis.as_dvec3(),
            disc.second_axis().as_dvec3(),
            disc.normal.as_dvec3(),
        );
        assert!((axes.determinant() - 1.0).abs() < 1e-5);
    }
}
