//! Splats of a point cut at the sharp edges around it (methods 11.4).
//!
//! 1. The faces around the point are gathered, largest first, into clusters whose normals lie within an angle of their mean.
//! 2. Each cluster becomes a splat in the plane of that mean through the point. Its radius covers what the point answers
//!    for in the cluster ([`radius`](crate::oriented::radius)).
//! 3. From those faces on, a walk over shared edges within the ball of that radius takes in what is turned as they are. Where
//!    it stops, at a face of another direction or at a border, the surface leaves the plane: the splat is cut along that edge.
//!    The walk stays on the surface, so the far side of a thin wall is not met.
//! 4. A cut that would take away what the point answers for is moved outward until it does not. Where it would have to
//!    move far, where more cuts are needed than a splat has, or where clusters are too many, the point is flagged: its
//!    triangles are drawn.

use crate::abi::OrientedPolygon;
use crate::oriented::radius::{RadiusRule, of_point, own_part, turned_to};
use crate::oriented::surface::{NO_FACE, WeldedSurface};
use crate::pack::polygons::{HalfPlane, MOST_CUTS, PlaneFrame, clipped};
use glam::{DVec2, DVec3};

/// Most clusters that become splats.
const MOST_CLUSTERS: usize = 3;

/// Most faces that a walk takes in.
const MOST_FACES: usize = 96;

/// How far a splat may reach beyond an edge that it was not cut along, over its radius.
pub const EDGE_TOLERANCE: f64 = 0.05;

/// How splats of a point are cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClipRule {
    /// Largest angle of a face with its cluster's mean, radians.
    pub spread: f64,
    /// Radius of the splats.
    pub radius: RadiusRule,
}

/// Memory that points share one after the other.
#[derive(Debug, Default)]
pub struct ClipScratch {
    clusters: Vec<FaceCluster>,
    order: Vec<u32>,
    reached: Vec<u32>,
    edges: Vec<HalfPlane>,
    kept: Vec<DVec2>,
}

#[derive(Debug, Default, Clone)]
struct FaceCluster {
    faces: Vec<u32>,
    /// Of normals times areas.
    sum: DVec3,
}

/// Appends the splats of a point to `splats`; none where its triangles have to be drawn.
pub fn splats_of_point(
    surface: &WeldedSurface,
    point: u32,
    color: [u8; 4],
    rule: &ClipRule,
    scratch: &mut ClipScratch,
    splats: &mut Vec<OrientedPolygon>,
) {
    let count = gather(surface, point, rule.spread, scratch);
    if count > MOST_CLUSTERS {
        return;
    }
    let before = splats.len();
    for cluster in 0..count {
        match splat_of_cluster(surface, point, cluster, color, rule, scratch) {
            Some(splat) => splats.push(splat),
            None => {
                splats.truncate(before);
                return;
            }
        }
    }
}

/// Gathers the faces around a point into clusters; returns how many there are.
fn gather(surface: &WeldedSurface, point: u32, spread: f64, scratch: &mut ClipScratch) -> usize {
    let ClipScratch {
        clusters, order, ..
    } = scratch;
    order.clear();
    order.extend_from_slice(surface.incident(point));
    order.sort_by(|&a, &b| {
        surface.areas[b as usize]
            .total_cmp(&surface.areas[a as usize])
            .then(a.cmp(&b))
    });
    let least = spread.cos();
    let mut count = 0;
    for &face in order.iter() {
        let (normal, area) = (surface.normals[face as usize], surface.areas[face as usize]);
        let cosine = |cluster: &FaceCluster| normal.dot(cluster.sum) / cluster.sum.length();
        let nearest = (clusters[..count].iter_mut())
            .map(|cluster| (cosine(cluster), cluster))
            .filter(|(cosine, _)| *cosine >= least)
            .max_by(|a, b| a.0.total_cmp(&b.0));
        let cluster = match nearest {
            Some((_, cluster)) => cluster,
            None => {
                if count == clusters.len() {
                    clusters.push(FaceCluster::default());
                }
                count += 1;
                let cluster = &mut clusters[count - 1];
                cluster.faces.clear();
                cluster.sum = DVec3::ZERO;
                cluster
            }
        };
        cluster.faces.push(face);
        cluster.sum += normal * area;
    }
    count
}

/// The splat of a cluster; `None` where cuts cannot bound it.
fn splat_of_cluster(
    surface: &WeldedSurface,
    point: u32,
    cluster: usize,
    color: [u8; 4],
    rule: &ClipRule,
    scratch: &mut ClipScratch,
) -> Option<OrientedPolygon> {
    let ClipScratch {
        clusters,
        reached,
        edges,
        kept,
        ..
    } = scratch;
    let FaceCluster { faces, sum } = &clusters[cluster];
    let frame = PlaneFrame::new(surface.points[point as usize], *sum)?;
    let radius = of_point(surface, point, frame.normal, faces, rule.radius);
    kept.clear();
    for &face in faces {
        let part = own_part(turned_to(surface, face, point));
        kept.extend(part.corners().iter().map(|&x| frame.coordinates(x)));
    }
    walk(
        surface,
        point,
        &frame,
        radius,
        rule.spread.cos(),
        faces,
        reached,
        edges,
    )?;
    let cuts = cuts(radius, edges, kept)?;
    OrientedPolygon::disc(&frame, radius, &cuts, color)
}

/// Takes in what lies within the radius and is turned as the plane, from `faces` on, and notes the edges where it stops;
/// `None` where there is too much of it.
#[expect(clippy::too_many_arguments, reason = "two of them are memory")]
fn walk(
    surface: &WeldedSurface,
    point: u32,
    frame: &PlaneFrame,
    radius: f64,
    least_cosine: f64,
    faces: &[u32],
    reached: &mut Vec<u32>,
    edges: &mut Vec<HalfPlane>,
) -> Option<()> {
    reached.clear();
    reached.extend_from_slice(faces);
    edges.clear();
    let mut next = 0;
    while next < reached.len() {
        let face = reached[next];
        next += 1;
        let corners = surface.corners(face);
        for k in 0..3 {
            let [from, to] = [corners[k], corners[(k + 1) % 3]];
            if distance_to_segment(frame.center, from, to) >= radius {
                continue;
            }
            let other = surface.beyond[face as usize][k];
            let goes_on = other != NO_FACE
                && frame.normal.dot(surface.normals[other as usize]) >= least_cosine
                // What the point itself has in another cluster has a splat there.
                && (faces.contains(&other) || !surface.faces[other as usize].contains(&point));
            if !goes_on {
                edges.extend(outside_of_edge(frame, from, to));
            } else if !reached.contains(&other) {
                if reached.len() == MOST_FACES {
                    return None;
                }
                reached.push(other);
            }
        }
    }
    Some(())
}

/// The side of an edge on which its face lies, in the plane; `None` where the edge has no direction in it.
fn outside_of_edge(frame: &PlaneFrame, from: DVec3, to: DVec3) -> Option<HalfPlane> {
    let [from, to] = [from, to].map(|x| frame.coordinates(x));
    // Faces are counter-clockwise: inside is to the left.
    let direction = -(to - from).perp().try_normalize()?;
    Some(HalfPlane {
        direction,
        limit: direction.dot(from),
    })
}

/// Half planes that keep `kept` and leave out what lies beyond `edges`; `None` where no few do.
fn cuts(radius: f64, edges: &[HalfPlane], kept: &[DVec2]) -> Option<Vec<HalfPlane>> {
    let tolerance = EDGE_TOLERANCE * radius;
    let mut cuts: Vec<HalfPlane> = Vec::new();
    let mut corners: Vec<DVec2> = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
        .map(|c: [f64; 2]| radius * DVec2::from(c))
        .to_vec();
    loop {
        // The edge that most of the splat lies beyond.
        let beyond = |edge: &HalfPlane| {
            let most = corners
                .iter()
                .map(|&c| edge.direction.dot(c))
                .fold(f64::MIN, f64::max);
            most.min(radius) - edge.limit
        };
        let worst = edges
            .iter()
            .map(|edge| (beyond(edge), edge))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((most, edge)) = worst.filter(|(most, _)| *most > tolerance) else {
            return Some(cuts);
        };
        let needed = kept
            .iter()
            .map(|&c| edge.direction.dot(c))
            .fold(edge.limit, f64::max);
        if needed - edge.limit > tolerance || cuts.len() == MOST_CUTS || most.is_nan() {
            return None;
        }
        let cut = HalfPlane {
            limit: needed,
            ..*edge
        };
        cuts.push(cut);
        corners = clipped(&corners, cut);
    }
}

fn distance_to_segment(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    let side = to - from;
    let along = side.dot(point - from) / side.length_squared();
    let nearest = from + side * if along > 0.0 { along.min(1.0) } else { 0.0 };
    point.distance(nearest)
}

#[cfg(test)]
mod tests;
