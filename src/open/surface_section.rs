//! The lines in which an upright plane cuts a surface.

use crate::math::section_line::{SectionLine, SectionPlace};
use crate::tree::Model;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// An edge of a triangle by its ends, bit by bit, so that triangles beside each other agree on it.
type EdgeBits = [[u32; 3]; 2];

/// The place where the plane crosses an edge.
#[derive(Debug, Clone, Copy)]
struct EdgeCrossing {
    edge: EdgeBits,
    world: DVec3,
    place: SectionPlace,
}

/// Part that the slab has of a triangle.
struct TriangleCut {
    may_touch: bool,
    /// Heights of corners in the slab.
    heights: Option<[f64; 2]>,
    crossing: Option<[EdgeCrossing; 2]>,
}

/// Part that a section has of a surface.
#[derive(Debug, Default)]
pub(super) struct SurfaceSection {
    /// Triangles that may touch the slab.
    pub(super) mask: Vec<bool>,
    /// Least and greatest height of corners in the slab.
    pub(super) heights: Option<[f64; 2]>,
    /// Places of each line in which the plane cuts the surface, world space.
    pub(super) polylines: Vec<Vec<DVec3>>,
}

impl SurfaceSection {
    /// Cuts a surface. O(n).
    pub(super) fn of(model: &Model, line: &SectionLine) -> Self {
        let cut = |triangle: &[u32; 3]| cut_of(model, line, *triangle);
        let triangles = model.triangles.par_iter().with_min_len(1 << 12);
        let cuts: Vec<TriangleCut> = triangles.map(cut).collect();
        let heights = cuts.iter().filter_map(|cut| cut.heights);
        let heights = heights.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        let pieces: Vec<[EdgeCrossing; 2]> = cuts.iter().filter_map(|cut| cut.crossing).collect();
        let mask = cuts.into_iter().map(|cut| cut.may_touch).collect();
        let chains = chains(&pieces);
        let mut polylines: Vec<Vec<DVec3>> = (chains.iter())
            .flat_map(|chain| within(chain, line))
            .collect();
        let start = |polyline: &Vec<DVec3>| {
            let distances = polyline.iter().map(|&world| line.place_of(world).distance);
            distances.fold(f64::INFINITY, f64::min)
        };
        // Stable: of those that begin alike the first in the order of triangles.
        polylines.sort_by(|a, b| start(a).total_cmp(&start(b)));
        Self {
            mask,
            heights,
            polylines,
        }
    }
}

fn cut_of(model: &Model, line: &SectionLine, triangle: [u32; 3]) -> TriangleCut {
    let corners = triangle.map(|corner| model.vertices[corner as usize].position);
    let worlds = corners.map(|corner| model.origin + corner.as_dvec3());
    let places = worlds.map(|world| line.place_of(world));
    let range = |of: fn(&SectionPlace) -> f64| {
        let values = places.iter().map(of);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), high.max(value)]
        })
    };
    let (along, across) = (range(|place| place.distance), range(|place| place.offset));
    let half = 0.5 * line.width();
    let reaches = along[0] <= line.length() && along[1] >= 0.0;
    let inside = places.iter().filter(|&&place| line.contains(place));
    let heights = inside.fold(None, |range: Option<[f64; 2]>, place| {
        let [low, high] = range.unwrap_or([place.height; 2]);
        Some([low.min(place.height), high.max(place.height)])
    });
    // A corner on the plane counts as left of it, so that each triangle has two crossings or none.
    let sides = places.map(|place| place.offset >= 0.0);
    let crosses = reaches && (sides[0] != sides[1] || sides[1] != sides[2]);
    TriangleCut {
        may_touch: reaches && across[0] <= half && across[1] >= -half,
        heights,
        crossing: crosses.then(|| {
            let mut found = [0, 1, 2].into_iter().filter_map(|first| {
                let second = (first + 1) % 3;
                (sides[first] != sides[second]).then(|| {
                    let bits = |corner: usize| {
                        // Zero is written in two ways.
                        corners[corner].to_array().map(|v| (v + 0.0).to_bits())
                    };
                    let [a, b] = match bits(first) <= bits(second) {
                        true => [first, second],
                        false => [second, first],
                    };
                    let share = places[a].offset / (places[a].offset - places[b].offset);
                    let world = worlds[a].lerp(worlds[b], share.clamp(0.0, 1.0));
                    EdgeCrossing {
                        edge: [bits(a), bits(b)],
                        world,
                        place: line.place_of(world),
                    }
                })
            });
            // Two of three sides differ from one another in exactly two edges.
            let [a, b] = [found.next(), found.next()];
            [a, b].map(|crossing| {
                crossing.unwrap_or(EdgeCrossing {
                    edge: EdgeBits::default(),
                    world: worlds[0],
                    place: places[0],
                })
            })
        }),
    }
}

/// Puts pieces of triangles together at the edges that they share. O(n).
fn chains(pieces: &[[EdgeCrossing; 2]]) -> Vec<Vec<EdgeCrossing>> {
    let mut ids: HashMap<EdgeBits, u32> = HashMap::new();
    let mut ends: Vec<[u32; 2]> = Vec::with_capacity(pieces.len());
    for piece in pieces {
        ends.push(piece.map(|crossing| {
            let next = ids.len() as u32;
            match ids.entry(crossing.edge) {
                Entry::Occupied(known) => *known.get(),
                Entry::Vacant(new) => *new.insert(next),
            }
        }));
    }
    // Pieces at each edge, those of one after those of another.
    let mut at_edge: Vec<(u32, u32)> = (ends.iter().zip(0..))
        .flat_map(|(ends, piece)| ends.map(|edge| (edge, piece)))
        .collect();
    at_edge.sort_unstable();
    let mut starts: Vec<u32> = vec![0; ids.len() + 1];
    for &(edge, _) in &at_edge {
        starts[edge as usize + 1] += 1;
    }
    for index in 1..starts.len() {
        starts[index] += starts[index - 1];
    }
    let mut next_at = starts.clone();
    let mut is_used = vec![false; pieces.len()];
    let mut walk = |from: u32| {
        let mut chain = Vec::new();
        let mut edge = from;
        loop {
            let rest = &mut next_at[edge as usize];
            let end = starts[edge as usize + 1];
            while *rest < end && is_used[at_edge[*rest as usize].1 as usize] {
                *rest += 1;
            }
            if *rest == end {
                return chain;
            }
            let piece = at_edge[*rest as usize].1 as usize;
            is_used[piece] = true;
            let first = usize::from(ends[piece][0] != edge);
            if chain.is_empty() {
                chain.push(pieces[piece][first]);
            }
            chain.push(pieces[piece][1 - first]);
            edge = ends[piece][1 - first];
        }
    };
    let count = ids.len() as u32;
    let degree = |edge: &u32| starts[*edge as usize + 1] - starts[*edge as usize];
    // Open lines begin at an end; what is left then is closed.
    let open = (0..count).filter(|edge| degree(edge) % 2 == 1);
    let mut found: Vec<Vec<EdgeCrossing>> = open.map(&mut walk).collect();
    // Closed ones may meet at an edge, where several begin.
    for edge in 0..count {
        loop {
            let chain = walk(edge);
            if chain.is_empty() {
                break;
            }
            found.push(chain);
        }
    }
    found.retain(|chain| chain.len() > 1);
    found
}

/// The parts of a chain between the ends of the line.
fn within(chain: &[EdgeCrossing], line: &SectionLine) -> Vec<Vec<DVec3>> {
    let mut parts: Vec<Vec<DVec3>> = Vec::new();
    let mut part: Vec<DVec3> = Vec::new();
    for pair in chain.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let way = b.place.distance - a.place.distance;
        // Shares of the piece at which it enters and leaves.
        let share = |distance: f64| (distance - a.place.distance) / way;
        let (mut from, mut to) = (0.0f64, 1.0f64);
        if way == 0.0 {
            if !(0.0..=line.length()).contains(&a.place.distance) {
                (from, to) = (1.0, 0.0);
            }
        } else {
            let (s, t) = (share(0.0), share(line.length()));
            (from, to) = (from.max(s.min(t)), to.min(s.max(t)));
        }
        if from > to {
            if part.len() > 1 {
                parts.push(std::mem::take(&mut part));
            }
            part.clear();
            continue;
        }
        if from > 0.0 {
            part.clear();
        }
        if part.is_empty() {
            part.push(a.world.lerp(b.world, from));
        }
        part.push(a.world.lerp(b.world, to));
        if to < 1.0 {
            parts.push(std::mem::take(&mut part));
        }
    }
    if part.len() > 1 {
        parts.push(part);
    }
    join_ends(&mut parts, chain);
    // A triangle of which the plane touches a corner has a piece without length.
    for part in &mut parts {
        part.dedup();
    }
    parts.retain(|part| part.len() > 1);
    parts
}

/// Joins the last and the first part of a closed chain that was cut elsewhere.
fn join_ends(parts: &mut Vec<Vec<DVec3>>, chain: &[EdgeCrossing]) {
    let (Some(start), Some(end)) = (chain.first(), chain.last()) else {
        return;
    };
    let begins = (parts.first()).is_some_and(|part| part.first() == Some(&start.world));
    let ends = (parts.last()).is_some_and(|part| part.last() == Some(&end.world));
    if start.edge == end.edge && parts.len() > 1 && begins && ends {
        let first = parts.remove(0);
        if let Some(last) = parts.last_mut() {
            last.extend(first);
        }
    }
}
