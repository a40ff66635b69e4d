//! What is drawn for the points of a surface: splats, and triangles where splats will not do.

use crate::abi::OrientedPolygon;
use crate::oriented::angle_test::{self, FaceWeight};
use crate::oriented::clip::{ClipRule, ClipScratch, splats_of_point};
use crate::oriented::radius::{RadiusRule, of_point};
use crate::oriented::surface::WeldedSurface;
use crate::pack::polygons::PlaneFrame;
use rayon::prelude::*;

/// How points become splats.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SplatRules {
    /// Radius.
    pub radius: RadiusRule,
    /// What a face counts in the normal of a point.
    pub weight: FaceWeight,
    /// Points with a face this far from their normal draw triangles, radians; `None` without the test.
    pub angle_test: Option<f64>,
    /// Splats are cut at edges, faces within this angle of their mean share one, radians; `None` for whole discs.
    pub clip: Option<f64>,
}

/// Splats and triangles that stand for a surface.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SplatSet {
    /// Splats, point by point.
    pub splats: Vec<OrientedPolygon>,
    /// Triangles of the mesh that are drawn beside them, ascending.
    pub triangles: Vec<u32>,
    /// Where the splats of each point begin, and after the last where they end.
    pub first_splat: Vec<u32>,
    /// Points with splats.
    pub splat_points: usize,
    /// Points whose triangles are drawn instead.
    pub flagged_points: usize,
}

impl SplatSet {
    /// The splats of a point.
    pub fn splats_of_point(&self, point: u32) -> &[OrientedPolygon] {
        let [from, to] = [point, point + 1].map(|p| self.first_splat[p as usize] as usize);
        &self.splats[from..to]
    }
}

/// Points that one task takes.
const PIECE: usize = 512;

/// The splats of a surface; `color_of_point` has one color for each of its points. Points without faces have none.
///
/// # Panics
/// When there are fewer colors than points.
pub fn splats_of(
    surface: &WeldedSurface,
    color_of_point: &[[u8; 4]],
    rules: &SplatRules,
) -> SplatSet {
    let points: Vec<u32> = (0..surface.points.len() as u32).collect();
    let pieces: Vec<(Vec<OrientedPolygon>, Vec<u32>)> = points
        .par_chunks(PIECE)
        .map_init(ClipScratch::default, |scratch, points| {
            let mut splats = Vec::with_capacity(points.len());
            let mut counts = Vec::with_capacity(points.len());
            for &point in points {
                let before = splats.len();
                if !surface.incident(point).is_empty() {
                    let color = color_of_point[point as usize];
                    of_one(surface, point, color, rules, scratch, &mut splats);
                }
                counts.push((splats.len() - before) as u32);
            }
            (splats, counts)
        })
        .collect();
    let mut set = SplatSet::default();
    set.first_splat.push(0);
    let mut end = 0;
    for (mut splats, counts) in pieces {
        set.splats.append(&mut splats);
        for count in counts {
            end += count;
            set.first_splat.push(end);
        }
    }
    let flagged: Vec<bool> = (points.iter())
        .map(|&p| set.splats_of_point(p).is_empty() && !surface.incident(p).is_empty())
        .collect();
    set.flagged_points = flagged.iter().filter(|&&flag| flag).count();
    set.splat_points = (points.iter())
        .filter(|&&p| !set.splats_of_point(p).is_empty())
        .count();
    set.triangles = (angle_test::faces_of(surface, &flagged).into_iter())
        .map(|face| surface.triangle_of_face[face as usize])
        .collect();
    set
}

/// Appends the splats of a point; none where its triangles are drawn.
fn of_one(
    surface: &WeldedSurface,
    point: u32,
    color: [u8; 4],
    rules: &SplatRules,
    scratch: &mut ClipScratch,
    splats: &mut Vec<OrientedPolygon>,
) {
    let normal = angle_test::normal_of(surface, point, rules.weight);
    if let Some(threshold) = rules.angle_test
        && angle_test::least_cosine(surface, point, normal) < threshold.cos()
    {
        return;
    }
    if let Some(spread) = rules.clip {
        let rule = ClipRule {
            spread,
            radius: rules.radius,
        };
        splats_of_point(surface, point, color, &rule, scratch, splats);
        return;
    }
    let faces = surface.incident(point);
    // Faces that cancel leave no plane: a direction is as good as another.
    let normal = if normal.length_squared() > 0.0 {
        normal
    } else {
        surface.normals[faces[0] as usize]
    };
    let radius = of_point(surface, point, normal, faces, rules.radius);
    let frame = PlaneFrame::new(surface.points[point as usize], normal);
    splats.extend(frame.and_then(|frame| OrientedPolygon::disc(&frame, radius, &[], color)));
}
