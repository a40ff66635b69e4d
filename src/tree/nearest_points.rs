//! Nearest neighbors of all points of a cloud, found through the tree's own order.
//!
//! Points of one small node are looked at together: they find most of their neighbors among themselves, and what may be nearer
//! around them is gathered once for all.

use super::shape::TreeShape;
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// Neighbors by which it is told whether there is a surface, and how it lies: of six any few can be in a plane by chance.
pub(super) const LOOKED_AT: usize = 12;

/// Levels of nodes above the points that are looked at together: up to 64 points.
const GROUP_LEVELS: usize = 3;

/// Groups that one thread takes at once.
const BLOCK_GROUPS: usize = 64;

/// A point whose farthest neighbor in its group is more than this many times as far as that of most, squared, is looked at alone:
/// what is around it would be gathered for all.
const APART_SQUARED: f32 = 16.0;

/// Most points that are gathered for a group; where there are more each of its points is looked at alone.
const MOST_GATHERED: usize = 2048;

/// Points whose distances are computed together.
const LANES: usize = 8;

/// An axis-aligned box.
#[derive(Debug, Clone, Copy)]
pub(super) struct NeighborBounds {
    min: Vec3,
    max: Vec3,
}

impl NeighborBounds {
    const NOTHING: Self = Self {
        min: Vec3::INFINITY,
        max: Vec3::NEG_INFINITY,
    };

    fn distance_squared(&self, other: &Self) -> f32 {
        (self.min - other.max)
            .max(other.min - self.max)
            .max(Vec3::ZERO)
            .length_squared()
    }

    fn is_point(&self) -> bool {
        self.min == self.max
    }

    fn joined(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }
}

/// Boxes of all nodes, by level.
pub(super) fn boxes(shape: &TreeShape, points: &[Vec3]) -> Vec<Vec<NeighborBounds>> {
    let mut levels: Vec<Vec<NeighborBounds>> = Vec::new();
    for level in shape.levels.iter().rev() {
        let below = levels.last();
        let of_children = |pair: &[u32]| {
            let children = pair[0] as usize..pair[1] as usize;
            let bounds = children.map(|child| match below {
                Some(below) => below[child],
                None => NeighborBounds {
                    min: points[child],
                    max: points[child],
                },
            });
            bounds.fold(NeighborBounds::NOTHING, NeighborBounds::joined)
        };
        levels.push(
            level
                .child_starts
                .par_windows(2)
                .with_min_len(1024)
                .map(of_children)
                .collect(),
        );
    }
    levels.reverse();
    levels
}

/// The nearest neighbors of a point at other places than its own, at most [`LOOKED_AT`], the nearest first. Points in one place
/// count once, as the first of them; of points equally far the first counts first.
#[derive(Debug, Clone)]
pub(super) struct NearestPoints {
    /// Place of the point.
    pub(super) at: Vec3,
    /// Squared distance in the upper half, whose bits order as the numbers do, and the point's number in the lower.
    keys: [u64; LOOKED_AT],
    count: usize,
}

fn key_of(squared: f32, index: u32) -> u64 {
    u64::from(squared.to_bits()) << 32 | u64::from(index)
}

fn squared_of(key: u64) -> f32 {
    f32::from_bits((key >> 32) as u32)
}

impl NearestPoints {
    fn new(at: Vec3) -> Self {
        Self {
            at,
            keys: [0; LOOKED_AT],
            count: 0,
        }
    }

    /// Number of neighbors.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Numbers of the neighbors.
    pub(super) fn indices(&self) -> impl Iterator<Item = u32> + Clone {
        self.keys[..self.count].iter().map(|&key| key as u32)
    }

    /// Squared distances of the neighbors.
    pub(super) fn distances_squared(&self) -> impl Iterator<Item = f32> {
        self.keys[..self.count].iter().map(|&key| squared_of(key))
    }

    /// Squared distance beyond which no point counts.
    fn worst(&self) -> f32 {
        match self.count < LOOKED_AT {
            true => f32::INFINITY,
            false => squared_of(self.keys[LOOKED_AT - 1]),
        }
    }

    fn offer(&mut self, points: &[Vec3], index: u32) {
        let squared = points[index as usize].distance_squared(self.at);
        self.offer_key(points, key_of(squared, index));
    }

    #[inline]
    fn offer_key(&mut self, points: &[Vec3], key: u64) {
        if self.count < LOOKED_AT || key < self.keys[LOOKED_AT - 1] {
            self.insert(points, key);
        }
    }

    fn insert(&mut self, points: &[Vec3], key: u64) {
        if squared_of(key) == 0.0 && points[key as u32 as usize] == self.at {
            return;
        }
        let mut place = self.count;
        while place > 0 && self.keys[place - 1] > key {
            place -= 1;
        }
        // Points in one place are equally far.
        let around = &self.keys[place.saturating_sub(1)..(place + 1).min(self.count)];
        let is_tied = around.iter().any(|other| other >> 32 == key >> 32);
        let end = match is_tied {
            true => match self.same_place(points, key, place) {
                Some(same) if same < place => return,
                same => same,
            },
            false => None,
        };
        let end = end.unwrap_or_else(|| {
            self.count = (self.count + 1).min(LOOKED_AT);
            self.count - 1
        });
        for at in (place..end).rev() {
            self.keys[at + 1] = self.keys[at];
        }
        self.keys[place] = key;
    }

    /// Finds the neighbor that is in the place of a new one among those that are equally far.
    fn same_place(&self, points: &[Vec3], key: u64, place: usize) -> Option<usize> {
        let p = points[key as u32 as usize];
        let is_as_far = |at: &usize| self.keys[*at] >> 32 == key >> 32;
        let is_there = |at: &usize| points[self.keys[*at] as u32 as usize] == p;
        let mut before = (0..place).rev().take_while(is_as_far);
        let mut after = (place..self.count).take_while(is_as_far);
        before.find(is_there).or_else(|| after.find(is_there))
    }
}

/// Groups of points that one thread takes at once.
#[derive(Debug, Clone)]
pub(super) struct NeighborBlock {
    /// Points of the block, in tree order.
    pub(super) points: Range<u32>,
    /// Nodes of the level of groups.
    groups: Range<u32>,
}

/// Points that may be near to those of a group, by coordinate.
#[derive(Debug, Default)]
struct GatheredPoints {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    indices: Vec<u32>,
    /// Squared distances to the point that is looked at.
    squared: Vec<f32>,
}

impl GatheredPoints {
    fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.indices.clear();
    }

    fn push(&mut self, p: Vec3, index: u32) {
        self.x.push(p.x);
        self.y.push(p.y);
        self.z.push(p.z);
        self.indices.push(index);
    }

    /// Computes the distances to a place as [`Vec3::distance_squared`] does.
    fn measure(&mut self, at: Vec3) {
        self.squared.clear();
        let places = self.x.iter().zip(&self.y).zip(&self.z);
        self.squared.extend(places.map(|((x, y), z)| {
            let (x, y, z) = (x - at.x, y - at.y, z - at.z);
            x * x + y * y + z * z
        }));
    }

    /// Offers those of a range, as they are measured.
    fn offer(&self, range: Range<usize>, points: &[Vec3], nearest: &mut NearestPoints) {
        let (squared, indices) = (&self.squared[range.clone()], &self.indices[range]);
        for (squared, indices) in squared.chunks(LANES).zip(indices.chunks(LANES)) {
            let worst = nearest.worst();
            if !squared.iter().fold(false, |any, &own| any | (own <= worst)) {
                continue;
            }
            for (&squared, &index) in squared.iter().zip(indices) {
                nearest.offer_key(points, key_of(squared, index));
            }
        }
    }
}

/// Search for the nearest neighbors of the points of a cloud.
pub(super) struct NeighborSearch<'a> {
    /// Shape of the tree over the points.
    pub(super) shape: &'a TreeShape,
    /// The points, in tree order.
    pub(super) points: &'a [Vec3],
    /// [`boxes`] of all nodes.
    pub(super) boxes: &'a [Vec<NeighborBounds>],
}

impl NeighborSearch<'_> {
    fn group_level(&self) -> usize {
        self.shape.levels.len().saturating_sub(GROUP_LEVELS)
    }

    /// All points, in blocks that follow one another.
    pub(super) fn blocks(&self) -> Vec<NeighborBlock> {
        let level = self.group_level();
        let Some(groups) = self.boxes.get(level).map(Vec::len) else {
            let points = 0..self.points.len() as u32;
            return vec![NeighborBlock {
                points,
                groups: 0..0,
            }];
        };
        let starts = (0..groups as u32).step_by(BLOCK_GROUPS);
        let block = |start: u32| {
            let end = (start + BLOCK_GROUPS as u32).min(groups as u32);
            NeighborBlock {
                points: self.points_of(level, start).start..self.points_of(level, end - 1).end,
                groups: start..end,
            }
        };
        starts.map(block).collect()
    }

    /// Points below a node.
    fn points_of(&self, level: usize, node: u32) -> Range<u32> {
        let starts = &self.shape.levels[level].leaf_starts;
        starts[node as usize]..starts[node as usize + 1]
    }

    /// Finds the neighbors of all points of a block, and hands them over in any order.
    pub(super) fn of_block(
        &self,
        block: &NeighborBlock,
        take: &mut impl FnMut(u32, &NearestPoints),
    ) {
        let mut gathered = GatheredPoints::default();
        if block.groups.is_empty() {
            block
                .points
                .clone()
                .for_each(|index| take(index, &self.of_point(index)));
        }
        for group in block.groups.clone() {
            self.of_group(group, &mut gathered, take);
        }
    }

    fn of_group(
        &self,
        group: u32,
        gathered: &mut GatheredPoints,
        take: &mut impl FnMut(u32, &NearestPoints),
    ) {
        let level = self.group_level();
        let own = self.points_of(level, group);
        gathered.clear();
        for index in own.clone() {
            gathered.push(self.points[index as usize], index);
        }
        let count = own.len();
        let mut found: Vec<NearestPoints> = Vec::with_capacity(count);
        for offset in 0..count {
            let mut nearest = NearestPoints::new(self.points[own.start as usize + offset]);
            gathered.measure(nearest.at);
            // What is near in the order is near: the rest is then mostly dropped unseen.
            let (chunk, chunks) = (offset / LANES, count.div_ceil(LANES));
            for away in 0..chunks {
                let before = chunk.checked_sub(away).filter(|_| away > 0);
                let after = Some(chunk + away).filter(|&chunk| chunk < chunks);
                for chunk in [before, after].into_iter().flatten() {
                    let start = chunk * LANES;
                    let range = start..(start + LANES).min(count);
                    gathered.offer(range, self.points, &mut nearest);
                }
            }
            found.push(nearest);
        }
        let mut worst: Vec<f32> = found.iter().map(NearestPoints::worst).collect();
        let middle = worst.len() / 2;
        let most = APART_SQUARED * *worst.select_nth_unstable_by(middle, f32::total_cmp).1;
        let reaches = found
            .iter()
            .map(NearestPoints::worst)
            .filter(|reach| *reach <= most);
        let reach = reaches.fold(0.0, f32::max);
        gathered.clear();
        let is_gathered = reach.is_finite() && self.gather_around(group, reach, gathered);
        for (index, mut nearest) in own.zip(found) {
            if !is_gathered || nearest.worst() > reach {
                take(index, &self.of_point(index));
                continue;
            }
            gathered.measure(nearest.at);
            gathered.offer(0..gathered.indices.len(), self.points, &mut nearest);
            take(index, &nearest);
        }
    }

    /// Gathers what lies no farther than this from a group's box, but for its own points. Gives up where it is too much.
    fn gather_around(&self, group: u32, reach: f32, gathered: &mut GatheredPoints) -> bool {
        let level = self.group_level();
        let bounds = self.boxes[level][group as usize];
        let mut child = group;
        for level in (0..level).rev() {
            let starts = &self.shape.levels[level].child_starts;
            let parent = starts.partition_point(|&start| start <= child) - 1;
            for sibling in starts[parent]..starts[parent + 1] {
                if sibling != child && !self.gather(level + 1, sibling, (bounds, reach), gathered) {
                    return false;
                }
            }
            child = parent as u32;
        }
        true
    }

    fn gather(
        &self,
        level: usize,
        index: u32,
        (bounds, reach): (NeighborBounds, f32),
        gathered: &mut GatheredPoints,
    ) -> bool {
        let own = &self.boxes[level][index as usize];
        if own.distance_squared(&bounds) > reach {
            return true;
        }
        if own.is_point() {
            // However many points: one place.
            gathered.push(own.min, self.shape.leaf_start(level, index));
            return gathered.indices.len() <= MOST_GATHERED;
        }
        let starts = &self.shape.levels[level].child_starts;
        let children = starts[index as usize]..starts[index as usize + 1];
        if level + 1 == self.boxes.len() {
            for child in children {
                gathered.push(self.points[child as usize], child);
            }
            return gathered.indices.len() <= MOST_GATHERED;
        }
        children
            .into_iter()
            .all(|child| self.gather(level + 1, child, (bounds, reach), gathered))
    }

    /// Finds the neighbors of one point alone.
    pub(super) fn of_point(&self, index: u32) -> NearestPoints {
        let mut nearest = NearestPoints::new(self.points[index as usize]);
        // Upward from the point: at each ancestor, whatever lies beside the path. The first few find close neighbors, and
        // almost all that comes later is dropped by its box.
        let mut child = index;
        for level in (0..self.shape.levels.len()).rev() {
            let starts = &self.shape.levels[level].child_starts;
            let parent = starts.partition_point(|&start| start <= child) - 1;
            for sibling in starts[parent]..starts[parent + 1] {
                if sibling != child {
                    self.visit(level + 1, sibling, &mut nearest);
                }
            }
            child = parent as u32;
        }
        nearest
    }

    fn visit(&self, level: usize, index: u32, nearest: &mut NearestPoints) {
        let Some(boxes) = self.boxes.get(level) else {
            nearest.offer(self.points, index);
            return;
        };
        let bounds = &boxes[index as usize];
        if bounds.is_point() {
            // However many points: one place.
            nearest.offer(self.points, self.shape.leaf_start(level, index));
            return;
        }
        let at = NeighborBounds {
            min: nearest.at,
            max: nearest.at,
        };
        if bounds.distance_squared(&at) > nearest.worst() {
            return;
        }
        let starts = &self.shape.levels[level].child_starts;
        for child in starts[index as usize]..starts[index as usize + 1] {
            self.visit(level + 1, child, nearest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Neighbors by looking at all points.
    fn brute_force(points: &[Vec3], index: u32) -> Vec<u32> {
        let at = points[index as usize];
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        order.retain(|&i| points[i as usize] != at);
        let squared = |i: u32| points[i as usize].distance_squared(at);
        order.sort_by(|&a, &b| squared(a).total_cmp(&squared(b)).then(a.cmp(&b)));
        let mut places: Vec<Vec3> = Vec::new();
        order.retain(|&i| {
            let p = points[i as usize];
            let is_new = !places.contains(&p);
            if is_new {
                places.push(p);
            }
            is_new
        });
        order.truncate(LOOKED_AT);
        order
    }

    /// A place as the n-th of a curve that fills a cube, and noise.
    fn clouds() -> Vec<(&'static str, Vec<Vec3>)> {
        let mut state = 9u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        let curve = |i: u32| {
            let bit = |k: u32, at: u32| ((i >> (2 * k + at)) & 1) << k;
            let at = |from: u32| (0..8).map(|k| bit(k, from)).sum::<u32>() as f32;
            Vec3::new(at(0), at(1), 0.0)
        };
        let lattice: Vec<Vec3> = (0..900).map(curve).collect();
        let sheet = lattice.iter().map(|p| {
            let off = Vec3::new(random(), random(), random()) - 0.5;
            *p + 0.8 * off
        });
        let sheet: Vec<Vec3> = sheet.collect();
        let mut strays = sheet.clone();
        strays[100] = Vec3::new(500.0, 3.0, 80.0);
        strays[101] = Vec3::new(-40.0, 900.0, 8.0);
        let twice = sheet.iter().flat_map(|&p| [p; 2]).take(700).collect();
        let few = (0..500)
            .map(|i| Vec3::splat((i * 5 / 500) as f32))
            .collect();
        let mut any = |n: usize| {
            let mut points: Vec<Vec3> = Vec::new();
            points.resize_with(n, || Vec3::new(random(), random(), random()));
            points
        };
        vec![
            ("volume", any(400)),
            ("small", any(7)),
            ("one", any(1)),
            ("lattice", lattice),
            ("sheet", sheet),
            ("strays", strays),
            ("twice", twice),
            ("few places", few),
        ]
    }

    #[test]
    fn neighbors_of_groups_are_those_of_a_search_of_all_pairs() {
        for (name, points) in clouds() {
            let shape = TreeShape::new(points.len() as u32);
            let boxes = boxes(&shape, &points);
            let search = NeighborSearch {
                shape: &shape,
                points: &points,
                boxes: &boxes,
            };
            let mut seen = 0;
            for block in search.blocks() {
                search.of_block(&block, &mut |index, nearest| {
                    let wanted = brute_force(&points, index);
                    let own: Vec<u32> = nearest.indices().collect();
                    assert_eq!(own, wanted, "{name}: point {index} in a group");
                    let own: Vec<u32> = search.of_point(index).indices().collect();
                    assert_eq!(own, wanted, "{name}: point {index} alone");
                    seen += 1;
                });
            }
            assert_eq!(seen, points.len(), "{name}");
        }
    }
}
