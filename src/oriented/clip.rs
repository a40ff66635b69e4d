//! Splats of a point cut at the sharp edges around it (methods 11.4).
//!
//! 1. The faces around the point are gathered, largest first, into clusters whose normals lie within an angle of their mean.
//! 2. Each cluster becomes a splat in the plane of that mean through the point. Its radius covers what the point answers
//!    for in the cluster ([`radius`](crate::oriented::radius)).
//! 3. From those faces on, a walk over shared edges within the ball of that radius takes in what is turned as they are. Where
//!    it stops, at a face of another direction or at a border, the surface leaves the plane: the splat is cut along that edge.
//!    The walk stays on the surface, so the far side of a thin wall is not met.
//! 4. A cut that would take away what the point answers for is moved outward until it does not. Where it would have to
//!    move far, where more cuts are needed than a splat has, where clusters are too many, or where color or normals for light
//!    vary more than a splat can show, the triangles of the cluster are drawn.
//! 5. Across a long and narrow part a disc would reach far beyond it. Nothing is drawn outside of the least rectangle around
//!    what the point answers for, a little wider.

use crate::abi::OrientedPolygon;
use crate::oriented::look::{VertexLook, misfit, take_look};
use crate::oriented::radius::{OwnPart, RadiusRule, of_point, part_of_face};
use crate::oriented::surface::{NO_FACE, WeldedSurface};
use crate::pack::polygons::{CUT_SLACK, HalfPlane, PlaneFrame, clipped};
use glam::{DVec2, DVec3};

/// Most clusters that become splats.
const MOST_CLUSTERS: usize = 3;

/// Most faces that a walk takes in.
const MOST_FACES: usize = 96;

/// How far a splat may reach beyond an edge that no cut follows, over its own extent across the edge.
const EDGE_TOLERANCE: f64 = 0.05;

/// Reach beyond an edge that asks for no cut, likewise.
const EDGE_SLACK: f64 = 1e-3;

/// How far the color of a splat may be from that of a neighbor in its cluster, of 255 levels.
const MOST_LEVELS: f64 = 16.0;

/// Largest distance of the unit normal of a splat from that which triangles interpolate, where it has to cover: about two and a half
/// levels of the headlight. The angle of clusters bounds where splats lie, not what they look like: without this, those of
/// 5 degrees have 1.5 times the error of one exact sample (Porsche, mean FLIP of four views), with it 1.0.
const MOST_SHADE_TURN: f64 = 0.012;

/// Reach beyond what a splat has to cover, in distances of that from the plane: seen from aside it lies that far beside the
/// splat, up to a slope of this.
const LIFT_MARGIN: f64 = 2.0;

/// By how much of it a radius is larger than it has to be.
const RADIUS_MARGIN: f64 = 0.02;

/// By how much of its sides the rectangle around a part is wider on each side: splats in planes of their own overlap.
const RECTANGLE_MARGIN: f64 = 0.08;

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
    parts: Vec<OwnPart>,
    reached: ReachedFaces,
    edges: Vec<HalfPlane>,
    kept: Vec<DVec2>,
    crossed: Vec<CrossedEdge>,
}

/// Faces that a walk has taken in, in their order.
#[derive(Debug, Default)]
pub(crate) struct ReachedFaces {
    faces: Vec<u32>,
    /// Number of those that it began with.
    own: usize,
    /// Bits of the others, by the lowest ten bits of their numbers: a face whose bit is not set is none of them.
    bits: [u64; 16],
}

impl ReachedFaces {
    fn start(&mut self, faces: &[u32]) {
        self.faces.clear();
        self.faces.extend_from_slice(faces);
        self.own = faces.len();
        self.bits = [0; 16];
    }

    fn push(&mut self, face: u32) {
        self.faces.push(face);
        self.bits[face as usize / 64 % 16] |= 1 << (face % 64);
    }

    /// Tells whether the walk itself has taken a face in.
    fn has_walked(&self, face: u32) -> bool {
        self.bits[face as usize / 64 % 16] & (1 << (face % 64)) != 0
            && self.faces[self.own..].contains(&face)
    }
}

#[derive(Debug, Default, Clone)]
struct FaceCluster {
    faces: Vec<u32>,
    /// Of normals times areas.
    sum: DVec3,
}

/// Splats before it is known which of them are needed, and faces that are drawn as triangles.
#[derive(Debug, Default)]
pub struct SplatDrafts {
    /// The splats.
    pub splats: Vec<OrientedPolygon>,
    /// The faces that each stands for, one after the other.
    pub faces: Vec<u32>,
    /// Where those of each splat end.
    pub face_ends: Vec<u32>,
    /// Faces that are drawn as triangles, in any order and number.
    pub triangles: Vec<u32>,
}

impl SplatDrafts {
    /// Adds a splat that stands for these faces.
    pub fn push(&mut self, splat: OrientedPolygon, faces: &[u32]) {
        self.splats.push(splat);
        self.faces.extend_from_slice(faces);
        self.face_ends.push(self.faces.len() as u32);
    }
}

/// Appends the splats of a point to `drafts`, and the faces that have to be drawn as triangles.
pub fn splats_of_point(
    surface: &WeldedSurface,
    point: u32,
    looks: &[VertexLook],
    rule: &ClipRule,
    scratch: &mut ClipScratch,
    drafts: &mut SplatDrafts,
) {
    let count = gather(surface, point, rule.spread, scratch);
    if count > MOST_CLUSTERS {
        drafts.triangles.extend_from_slice(surface.incident(point));
        return;
    }
    for cluster in 0..count {
        let splat = splat_of_cluster(surface, point, cluster, looks, rule, scratch);
        let faces = &scratch.clusters[cluster].faces;
        match splat {
            Some(splat) => drafts.push(splat, faces),
            None => drafts.triangles.extend_from_slice(faces),
        }
    }
}

/// Gathers the faces around a point into clusters; returns how many there are, or one more than the most.
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
            None if count == MOST_CLUSTERS => return count + 1,
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
    looks: &[VertexLook],
    rule: &ClipRule,
    scratch: &mut ClipScratch,
) -> Option<OrientedPolygon> {
    let ClipScratch {
        clusters,
        parts,
        reached,
        edges,
        kept,
        crossed,
        ..
    } = scratch;
    let FaceCluster { faces, sum } = &clusters[cluster];
    let frame = PlaneFrame::new(surface.points[point as usize], *sum)?;
    parts.clear();
    parts.extend((faces.iter()).map(|&face| part_of_face(surface, face, point)));
    let radius = of_point(surface, point, frame.normal, (faces, parts), rule.radius);
    kept.clear();
    kept.push(DVec2::ZERO);
    // How far the part lies from the plane.
    let mut lift = 0.0_f64;
    for part in parts.iter() {
        // Each begins with the point; neighbors share the middles of their edges.
        for &corner in &part.corners()[1..] {
            lift = lift.max(frame.normal.dot(corner - frame.center).abs());
            let place = frame.coordinates(corner);
            if !kept.contains(&place) {
                kept.push(place);
            }
        }
    }
    // The corners that decide the radius lie on the circle, where rounding would leave gaps.
    let beside = LIFT_MARGIN * lift;
    let radius = radius * (1.0 + RADIUS_MARGIN) + beside;
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
    let mut corners = rectangle_around(surface, &frame, faces, kept, beside);
    let slack = CUT_SLACK * radius + lift;
    cut(&mut corners, radius, slack, edges, kept, crossed)?;
    let mut splat = OrientedPolygon::within_circle(&frame, radius, &corners, [255; 4])?;
    let least = (faces
        .iter()
        .map(|&face| frame.normal.dot(surface.normals[face as usize])))
    .fold(1.0, f64::min);
    splat.spread = (1.0 - least * least).max(0.0).sqrt() as f32;
    take_look(&mut splat, surface, point, faces, looks);
    let misfit = misfit(&splat, surface, point, (faces, parts), looks);
    let is_alike = misfit.turn <= rule.spread.sin().min(MOST_SHADE_TURN) + 1e-6
        && misfit.levels <= MOST_LEVELS;
    is_alike.then_some(splat)
}

/// Takes in what lies within the radius and is turned as the plane, from `faces` on, and notes the edges where it stops;
/// `None` where there is too much of it.
#[expect(clippy::too_many_arguments, reason = "two of them are memory")]
pub(crate) fn walk(
    surface: &WeldedSurface,
    point: u32,
    frame: &PlaneFrame,
    radius: f64,
    least_cosine: f64,
    faces: &[u32],
    reached: &mut ReachedFaces,
    edges: &mut Vec<HalfPlane>,
) -> Option<()> {
    reached.start(faces);
    edges.clear();
    let mut next = 0;
    while next < reached.faces.len() {
        let face = reached.faces[next];
        next += 1;
        let corners = surface.corners(face);
        for k in 0..3 {
            let other = surface.beyond[face as usize][k];
            if reached.has_walked(other) {
                continue;
            }
            let [from, to] = [corners[k], corners[(k + 1) % 3]];
            if squared_distance_to_segment(frame.center, from, to) >= radius * radius {
                continue;
            }
            let goes_on = other != NO_FACE
                && frame.normal.dot(surface.normals[other as usize]) >= least_cosine
                // What the point itself has in another cluster has a splat there.
                && (faces.contains(&other) || !surface.faces[other as usize].contains(&point));
            if !goes_on {
                edges.extend(outside_of_edge(frame, from, to));
            } else if !faces.contains(&other) {
                if reached.faces.len() == MOST_FACES {
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

/// The least rectangle around `kept` with a side along an edge of the faces, widened by its margin.
fn rectangle_around(
    surface: &WeldedSurface,
    frame: &PlaneFrame,
    faces: &[u32],
    kept: &[DVec2],
    beside: f64,
) -> Vec<DVec2> {
    let extent = |direction: DVec2| {
        (kept.iter().map(|&c| direction.dot(c)))
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                [low.min(x), high.max(x)]
            })
    };
    let mut best = (f64::INFINITY, DVec2::X, [[0.0; 2]; 2]);
    for &face in faces {
        let corners = surface.corners(face).map(|c| frame.coordinates(c));
        for k in 0..3 {
            // Of two faces that share an edge the first has looked at it.
            let other = surface.beyond[face as usize][k];
            if other < face && faces.contains(&other) {
                continue;
            }
            let Some(direction) = (corners[(k + 1) % 3] - corners[k]).try_normalize() else {
                continue;
            };
            let sides = [direction, direction.perp()].map(extent);
            let area = (sides[0][1] - sides[0][0]) * (sides[1][1] - sides[1][0]);
            if area < best.0 {
                best = (area, direction, sides);
            }
        }
    }
    let (_, direction, sides) = best;
    let [[left, right], [low, high]] = sides.map(|[low, high]| {
        let margin = RECTANGLE_MARGIN * (high - low) + beside;
        [low - margin, high + margin]
    });
    [[left, low], [right, low], [right, high], [left, high]]
        .map(|[along, across]| along * direction + across * direction.perp())
        .to_vec()
}

/// Cuts away what lies more than `slack` beyond edges and not within `kept`; `None` where no few cuts do.
fn cut(
    corners: &mut Vec<DVec2>,
    radius: f64,
    slack: f64,
    edges: &mut [HalfPlane],
    kept: &[DVec2],
    crossed: &mut Vec<CrossedEdge>,
) -> Option<()> {
    let beyond = |corners: &[DVec2], edge: &HalfPlane| {
        let most = (corners.iter().map(|&c| edge.direction.dot(c))).fold(f64::MIN, f64::max);
        most.min(radius) - edge.limit
    };
    crossed.clear();
    crossed.extend(edges.iter().filter_map(|&edge| {
        if beyond(corners, &edge) <= 0.0 {
            return None;
        }
        let [low, high] = (kept.iter().map(|&c| edge.direction.dot(c)))
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                [low.min(x), high.max(x)]
            });
        Some(CrossedEdge {
            edge,
            extent: high - low,
            needed: high.max(edge.limit),
        })
    }));
    // The edge that most of the splat lies beyond is next.
    loop {
        let of = |crossed: &CrossedEdge| beyond(corners, &crossed.edge) / crossed.extent;
        let worst = (crossed.iter().map(of).enumerate()).max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((index, most)) = worst.filter(|(_, most)| *most > EDGE_SLACK) else {
            return Some(());
        };
        let CrossedEdge {
            edge,
            extent,
            needed,
        } = crossed.swap_remove(index);
        let limit = needed + slack;
        let rest = clipped(corners, HalfPlane { limit, ..edge });
        if rest.len() <= OrientedPolygon::MOST_CORNERS {
            *corners = rest;
        } else if most > EDGE_TOLERANCE {
            return None;
        }
        if needed - edge.limit > EDGE_TOLERANCE * extent {
            return None;
        }
    }
}

/// An edge beyond which a splat reaches.
#[derive(Debug, Clone, Copy)]
struct CrossedEdge {
    edge: HalfPlane,
    /// Of what the splat has to cover, across the edge.
    extent: f64,
    /// Limit that keeps all of that.
    needed: f64,
}

fn squared_distance_to_segment(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    let side = to - from;
    let along = side.dot(point - from) / side.length_squared();
    let nearest = from + side * if along > 0.0 { along.min(1.0) } else { 0.0 };
    point.distance_squared(nearest)
}

#[cfg(test)]
mod tests;
