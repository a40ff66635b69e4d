//! What is drawn for the points of a surface: splats, and triangles where splats will not do.

use crate::abi::OrientedPolygon;
use crate::oriented::angle_test::{self, FaceWeight};
use crate::oriented::clip::{ClipRule, ClipScratch, SplatDrafts, splats_of_point};
use crate::oriented::look::{VertexLook, take_look};
use crate::oriented::radius::{OwnPart, RadiusRule, of_point, part_of_face};
use crate::oriented::resample::SampleChoice;
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
    /// The splats of [`SplatRules::clip`] stay whole: for measuring what their cuts cost.
    pub is_uncut: bool,
    /// Splats lie evenly on the surface instead of at its vertices.
    pub samples: Option<SampleChoice>,
    /// Levels of detail: what is small on the picture is one disc for many points, and what leaves are; `None` draws all.
    pub levels: Option<LevelLeaf>,
}

impl SplatRules {
    /// Angle of clusters where nothing else is asked for, degrees.
    pub const USUAL_DEGREES: f64 = 5.0;

    /// Splats of vertices that cover, cut at edges.
    pub fn usual() -> Self {
        Self {
            clip: Some(Self::USUAL_DEGREES.to_radians()),
            ..Self::default()
        }
    }

    /// Faces that differ by more than this have an edge between them at which even splats are cut, radians.
    pub fn crease(&self) -> f64 {
        self.clip.unwrap_or(std::f64::consts::PI)
    }
}

/// Primitive that a leaf of a tree over points is drawn as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LevelLeaf {
    /// The leaf's splats.
    Splats,
    /// The triangles around it.
    Triangles,
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
    /// Points with triangles alone.
    pub flagged_points: usize,
}

impl SplatSet {
    /// The splats of a point.
    pub fn splats_of_point(&self, point: u32) -> &[OrientedPolygon] {
        let [from, to] = [point, point + 1].map(|p| self.first_splat[p as usize] as usize);
        &self.splats[from..to]
    }
}

/// Points that one task takes: small models have a few hundred, and all threads shall have some.
const PIECE: usize = 64;

/// The splats of a surface; `looks` has one for each vertex of its mesh, or none. Points without faces have no splats.
pub fn splats_of(surface: &WeldedSurface, looks: &[VertexLook], rules: &SplatRules) -> SplatSet {
    let points: Vec<u32> = (0..surface.points.len() as u32).collect();
    let pieces: Vec<(SplatDrafts, Vec<u32>)> = points
        .par_chunks(PIECE)
        .map_init(ClipScratch::default, |scratch, points| {
            let mut drafts = SplatDrafts::default();
            let mut ends = Vec::with_capacity(points.len());
            for &point in points {
                if !surface.incident(point).is_empty() {
                    of_one(surface, point, looks, rules, scratch, &mut drafts);
                }
                ends.push(drafts.splats.len());
            }
            (drafts, ends.into_iter().map(|end| end as u32).collect())
        })
        .collect();
    let mut is_drawn = vec![false; surface.faces.len()];
    for &face in pieces.iter().flat_map(|(drafts, _)| &drafts.triangles) {
        is_drawn[face as usize] = true;
    }
    let mut set = SplatSet::default();
    set.first_splat.push(0);
    let mut point = 0;
    for (drafts, ends) in &pieces {
        let mut at = 0;
        for &end in ends {
            for splat in at..end as usize {
                let first = splat
                    .checked_sub(1)
                    .map_or(0, |before| drafts.face_ends[before]);
                let faces = &drafts.faces[first as usize..drafts.face_ends[splat] as usize];
                // A splat whose faces are all drawn adds nothing. Those of the angle test are kept as the thesis has them.
                if rules.clip.is_none() || faces.iter().any(|&face| !is_drawn[face as usize]) {
                    set.splats.push(drafts.splats[splat]);
                }
            }
            at = end as usize;
            let has_splat = set.first_splat.last() != Some(&(set.splats.len() as u32));
            set.splat_points += usize::from(has_splat);
            set.flagged_points += usize::from(!has_splat && !surface.incident(point).is_empty());
            set.first_splat.push(set.splats.len() as u32);
            point += 1;
        }
    }
    set.triangles = (surface.triangle_of_face.iter().zip(&is_drawn))
        .filter(|(_, is_drawn)| **is_drawn)
        .map(|(&triangle, _)| triangle)
        .collect();
    set
}

/// Appends the splats of a point, and the faces that are drawn as triangles.
fn of_one(
    surface: &WeldedSurface,
    point: u32,
    looks: &[VertexLook],
    rules: &SplatRules,
    scratch: &mut ClipScratch,
    drafts: &mut SplatDrafts,
) {
    if rules.levels == Some(LevelLeaf::Triangles) {
        drafts.triangles.extend_from_slice(surface.incident(point));
        return;
    }
    let normal = angle_test::normal_of(surface, point, rules.weight);
    if let Some(threshold) = rules.angle_test
        && angle_test::least_cosine(surface, point, normal) < threshold.cos()
    {
        drafts.triangles.extend_from_slice(surface.incident(point));
        return;
    }
    if let Some(spread) = rules.clip {
        let rule = ClipRule {
            spread,
            radius: rules.radius,
        };
        let first = drafts.splats.len();
        splats_of_point(surface, point, looks, &rule, scratch, drafts);
        if rules.is_uncut {
            drafts.splats[first..]
                .iter_mut()
                .for_each(OrientedPolygon::make_whole);
        }
        return;
    }
    let faces = surface.incident(point);
    // Faces that cancel leave no plane: a direction is as good as another.
    let normal = if normal.length_squared() > 0.0 {
        normal
    } else {
        surface.normals[faces[0] as usize]
    };
    let parts: Vec<OwnPart> = (faces.iter())
        .map(|&face| part_of_face(surface, face, point))
        .collect();
    let radius = of_point(surface, point, normal, (faces, &parts), rules.radius);
    let frame = PlaneFrame::new(surface.points[point as usize], normal);
    if let Some(frame) = frame
        && let Some(mut splat) = OrientedPolygon::disc(&frame, radius, &[], [255; 4])
    {
        take_look(&mut splat, surface, point, faces, looks);
        drafts.push(splat, faces);
    }
}
