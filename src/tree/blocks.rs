//! Spheres, cones, capsules and attributes of the nodes, from the leaves up.
//!
//! The lowest four levels are done in blocks: a block is a node with at most 256 leaves, whose triangles fit the first
//! cache, so that capsules are taken from the corners themselves. Blocks are independent and go to the threads in
//! contiguous runs. The levels above (one node in 64) are made from their children.

use super::block_part::{BlockPart, HEIGHT, split};
use super::closed::ClosedEvidence;
use super::shape::TreeShape;
use super::strip::{self, StripCorners};
use super::summary::{self, SubtreeSums};
use super::{Leaf, Node, NodeAttributes, NodeStrip, thickness};
use crate::abi::Vertex;
use crate::math::cone::DirectionCap;
use crate::math::sphere::{self, Sphere};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Least number of blocks that one task does.
const GRAIN: u32 = 32;
/// Most tasks, so that progress is told a few thousand times at most.
const TASKS: u32 = 2048;

/// What the nodes are made from.
pub(super) struct LeafSource<'a> {
    pub(super) shape: &'a TreeShape,
    /// Index of the first node of each level.
    pub(super) level_starts: &'a [u32],
    /// In order of use.
    pub(super) vertices: &'a [Vertex],
    /// Unpacked normal of each vertex, or empty where there are none.
    pub(super) normals: &'a [Vec3],
    /// Corner indices in tree order; empty for a cloud.
    pub(super) triangles: &'a [[u32; 3]],
    /// The mean of the texels of each triangle, with alpha 255 where it has some; may be empty.
    pub(super) leaf_colors: &'a [[u8; 4]],
    /// A point near the model.
    pub(super) origin: DVec3,
    pub(super) stop: &'a AtomicBool,
    /// Called with a number of leaves that are done.
    pub(super) done: &'a (dyn Fn(u64) + Sync),
}

/// What is learned on the way.
#[derive(Clone, Copy, Default)]
pub(super) struct BlockFindings {
    pub(super) evidence: ClosedEvidence,
    /// Some node has only triangles without a normal.
    pub(super) any_flat: bool,
}

impl BlockFindings {
    fn join(self, other: Self) -> Self {
        Self {
            evidence: self.evidence.join(other.evidence),
            any_flat: self.any_flat | other.any_flat,
        }
    }
}

/// Buffers of one task.
#[derive(Default)]
struct BlockScratch {
    corners: StripCorners,
    /// Unit normal of each leaf of the block, zero where it has none.
    normals: Vec<DVec3>,
    leaves: Vec<LeafSums>,
    sums: [Vec<SubtreeSums>; HEIGHT],
}

#[derive(Clone, Copy)]
struct LeafSums {
    area: f32,
    normal: Vec3,
    known: f32,
    color: Vec3,
}

impl LeafSums {
    /// The sums of this leaf alone, and its normal, zero where it has none.
    fn alone(&self) -> (SubtreeSums, Vec3) {
        let mut sums = SubtreeSums::default();
        sums.add_leaf(self.area, self.normal, self.known, self.color);
        (sums, self.normal.normalize_or_zero())
    }
}

/// Fills the leaves' radii (of triangles: points bring theirs), all nodes and all attributes. On entry the leaves have
/// their centers.
pub(super) fn fill(
    source: &LeafSource,
    leaves: &mut [Leaf],
    nodes: &mut [Node],
    attributes: &mut [NodeAttributes],
) -> BlockFindings {
    let depth = source.shape.levels.len();
    if depth == 0 {
        // A leaf or none: no node.
        return source.read_leaves(0, leaves, &mut BlockScratch::default());
    }
    // The level whose nodes are the blocks.
    let top = depth.saturating_sub(HEIGHT);
    let block_count = source.shape.levels[top].len();
    let mut sums = vec![SubtreeSums::default(); block_count];
    let mut findings = {
        let mut lower_nodes = &mut nodes[source.level_starts[top] as usize..];
        let mut lower_attributes = &mut attributes[source.level_starts[top] as usize..];
        let mut part = BlockPart {
            nodes: Default::default(),
            attributes: Default::default(),
            leaves,
            sums: &mut sums,
        };
        for level in top..depth {
            let height = depth - 1 - level;
            let len = source.shape.levels[level].len();
            (part.nodes[height], lower_nodes) = lower_nodes.split_at_mut(len);
            (part.attributes[height], lower_attributes) = lower_attributes.split_at_mut(len);
        }
        source.run(top, 0, block_count as u32, part)
    };
    for level in (0..top).rev() {
        if source.stop.load(Ordering::Relaxed) {
            break;
        }
        let (start, end) = (
            source.level_starts[level] as usize,
            source.level_starts[level + 1] as usize,
        );
        let (own_nodes, children) = nodes[start..].split_at_mut(end - start);
        let (own_attributes, child_attributes) = attributes[start..].split_at_mut(end - start);
        let below = SubtreeBelow {
            nodes: children,
            attributes: child_attributes,
            sums: &sums,
            first: 0,
        };
        let child_starts = &source.shape.levels[level].child_starts;
        let own: Vec<SubtreeSums> = own_nodes
            .par_iter_mut()
            .zip(own_attributes.par_iter_mut())
            .enumerate()
            .with_min_len(64)
            .map(|(index, (node, attributes))| {
                let range = child_starts[index] as usize..child_starts[index + 1] as usize;
                source.merge(level, range, &below, node, attributes, None)
            })
            .collect();
        findings.any_flat |= own_nodes.iter().any(|node| node.flags & Node::FLAT != 0);
        sums = own;
    }
    findings
}

/// A finished level, or the piece of it that a block has.
struct SubtreeBelow<'a> {
    nodes: &'a [Node],
    attributes: &'a [NodeAttributes],
    sums: &'a [SubtreeSums],
    /// Index, within the level, of the first of these.
    first: usize,
}

impl LeafSource<'_> {
    /// Does blocks `first..end` of level `top`, in parallel.
    fn run(&self, top: usize, first: u32, end: u32, part: BlockPart) -> BlockFindings {
        let block_count = self.shape.levels[top].len() as u32;
        if end - first <= GRAIN.max(block_count / TASKS) {
            return self.run_serial(top, first, end, part);
        }
        let middle = first + (end - first) / 2;
        let (one, two) = split(self.shape, top, first, middle, part);
        let (one, two) = rayon::join(
            || self.run(top, first, middle, one),
            || self.run(top, middle, end, two),
        );
        one.join(two)
    }

    fn run_serial(&self, top: usize, first: u32, end: u32, mut part: BlockPart) -> BlockFindings {
        let mut findings = BlockFindings::default();
        if self.stop.load(Ordering::Relaxed) {
            return findings;
        }
        let mut scratch = BlockScratch::default();
        let leaf_count = part.leaves.len();
        for block in first..end {
            let rest = if block + 1 < end {
                let (own, rest) = split(self.shape, top, block, block + 1, part);
                part = own;
                Some(rest)
            } else {
                None
            };
            findings = findings.join(self.block(top, block, &mut part, &mut scratch));
            match rest {
                Some(rest) => part = rest,
                None => break,
            }
        }
        (self.done)(leaf_count as u64);
        findings
    }

    /// One block: its leaves, then its levels upward.
    fn block(
        &self,
        top: usize,
        block: u32,
        part: &mut BlockPart,
        scratch: &mut BlockScratch,
    ) -> BlockFindings {
        let depth = self.shape.levels.len();
        let first_leaf = self.shape.leaf_start(top, block) as usize;
        let mut findings = self.read_leaves(first_leaf, part.leaves, scratch);
        // First node of the block in each level.
        let mut firsts = [0usize; HEIGHT];
        let mut first = block as usize;
        for level in top..depth {
            firsts[depth - 1 - level] = first;
            first = self.shape.levels[level].child_starts[first] as usize;
        }
        let BlockScratch {
            corners,
            normals,
            leaves: leaf_sums,
            sums,
        } = scratch;
        for height in 0..depth - top {
            let level = depth - 1 - height;
            let shape = &self.shape.levels[level];
            let (finished, own) = part.nodes.split_at_mut(height);
            let (finished_attributes, own_attributes) = part.attributes.split_at_mut(height);
            let (finished_sums, own_sums) = sums.split_at_mut(height);
            own_sums[0].clear();
            for (index, (node, attributes)) in own[0]
                .iter_mut()
                .zip(own_attributes[0].iter_mut())
                .enumerate()
            {
                let id = firsts[height] + index;
                let children = shape.child_starts[id] as usize..shape.child_starts[id + 1] as usize;
                let result = if height == 0 {
                    let range = children.start - first_leaf..children.end - first_leaf;
                    let low = LowLevels {
                        leaves: part.leaves,
                        normals,
                        sums: leaf_sums,
                    };
                    self.gather(range, children.start, &low, corners, node, attributes)
                } else {
                    let below = SubtreeBelow {
                        nodes: finished[height - 1],
                        attributes: finished_attributes[height - 1],
                        sums: &finished_sums[height - 1],
                        first: firsts[height - 1],
                    };
                    let leaf_range = shape.leaf_starts[id] as usize - first_leaf
                        ..shape.leaf_starts[id + 1] as usize - first_leaf;
                    self.merge(
                        level,
                        children,
                        &below,
                        node,
                        attributes,
                        Some((&mut *corners, leaf_range)),
                    )
                };
                findings.any_flat |= node.flags & Node::FLAT != 0;
                own_sums[0].push(result);
            }
        }
        if let (Some(slot), Some(sums)) = (part.sums.first_mut(), sums[depth - 1 - top].first()) {
            *slot = *sums;
        }
        findings
    }

    /// Reads the triangles (or points) from `first` on: radii, normals, areas, colors, corners, closedness.
    fn read_leaves(
        &self,
        first: usize,
        leaves: &mut [Leaf],
        scratch: &mut BlockScratch,
    ) -> BlockFindings {
        let mut findings = BlockFindings::default();
        scratch.corners.clear();
        scratch.normals.clear();
        scratch.leaves.clear();
        if self.triangles.is_empty() {
            for (vertex, leaf) in self.vertices[first..].iter().zip(leaves.iter()) {
                let normal = self
                    .normals
                    .get(first + scratch.leaves.len())
                    .copied()
                    .unwrap_or(Vec3::ZERO);
                scratch.leaves.push(LeafSums {
                    // The disc of the radius holds about this many points beside its own.
                    area: std::f32::consts::PI / super::spacing::NEIGHBORS as f32
                        * leaf.radius
                        * leaf.radius,
                    normal,
                    known: f32::from(normal != Vec3::ZERO),
                    color: rgb(vertex),
                });
            }
            return findings;
        }
        for (index, (triangle, leaf)) in (first..).zip(self.triangles[first..].iter().zip(leaves)) {
            let vertices = triangle.map(|index| self.vertices[index as usize]);
            let corners = vertices.map(|vertex| vertex.position);
            let center = leaf.center.as_dvec3();
            let square = corners
                .iter()
                .map(|p| center.distance_squared(p.as_dvec3()))
                .fold(0.0, f64::max);
            // Around the center as stored; a hair more, as the root is rounded.
            leaf.radius = sphere::round_up(square.sqrt() * (1.0 + 1e-15));
            for corner in corners {
                scratch.corners.push(corner);
            }
            let (geometric, area) = summary::geometric_normal(corners);
            scratch.normals.push(geometric);
            let shading = triangle.map(|index| self.normals[index as usize]);
            scratch.leaves.push(LeafSums {
                area,
                normal: shading[0] + shading[1] + shading[2],
                known: shading
                    .iter()
                    .map(|&normal| f32::from(normal != Vec3::ZERO))
                    .sum(),
                color: match self.leaf_colors.get(index) {
                    Some(&[r, g, b, 255]) => Vec3::new(r.into(), g.into(), b.into()),
                    _ => (rgb(&vertices[0]) + rgb(&vertices[1]) + rgb(&vertices[2])) * (1.0 / 3.0),
                },
            });
            findings.evidence.add(corners, self.origin);
        }
        findings
    }

    /// A node over leaves `range` of the block.
    fn gather(
        &self,
        range: std::ops::Range<usize>,
        first_child: usize,
        low: &LowLevels,
        corners: &mut StripCorners,
        node: &mut Node,
        attributes: &mut NodeAttributes,
    ) -> SubtreeSums {
        let mut balls = [Sphere::default(); 4];
        let count = range.len();
        for (ball, leaf) in balls.iter_mut().zip(&low.leaves[range.clone()]) {
            *ball = Sphere {
                center: leaf.center.as_dvec3(),
                radius: f64::from(leaf.radius),
            };
        }
        self.bound(&balls[..count], first_child as u32, node);
        node.flags = Node::LEAF_CHILDREN;
        let mut sums = SubtreeSums::default();
        for leaf in &low.sums[range.clone()] {
            sums.add_leaf(leaf.area, leaf.normal, leaf.known, leaf.color);
        }
        let mut splat_radius = node.radius;
        if !self.triangles.is_empty() {
            let mut caps = [DirectionCap::point(DVec3::Z); 4];
            let mut usable = 0;
            for &normal in &low.normals[range.clone()] {
                if normal != DVec3::ZERO {
                    caps[usable] = DirectionCap::point(normal);
                    usable += 1;
                }
            }
            if usable == 0 {
                node.flags |= Node::FLAT;
            } else {
                node.cone = summary::pack_cone(&caps[..usable]);
            }
            let corner_range = range.start * 3..range.end * 3;
            corners.each(corner_range.clone(), |corner| {
                sums.add_corner(corner - node.center)
            });
            let direction = sums.principal_direction();
            (node.strip, splat_radius) =
                corners.fit(corner_range.start, corner_range.end, node, direction);
        }
        self.close(&sums, node);
        *attributes = sums.attributes(splat_radius.min(node.radius), || {
            self.some_normal(first_child, count)
        });
        let leaves = low.sums[range.clone()].iter().map(LeafSums::alone);
        if sums.is_all_around(leaves) {
            attributes.forget_normal(summary::OF_A_BALL);
        }
        if attributes.has_normal() {
            let normal = attributes.normal();
            attributes.set_half_thickness(if self.triangles.is_empty() {
                let own = &self.vertices[first_child..first_child + count];
                thickness::of_points(own, &low.leaves[range], node, normal)
            } else {
                corners.half_thickness(range.start * 3, range.end * 3, node.center, normal)
            });
        }
        sums
    }

    /// A node over nodes `children` of the next level; with the corners below it where they are at hand.
    fn merge(
        &self,
        level: usize,
        children: std::ops::Range<usize>,
        below: &SubtreeBelow,
        node: &mut Node,
        attributes: &mut NodeAttributes,
        mut corners: Option<(&mut StripCorners, std::ops::Range<usize>)>,
    ) -> SubtreeSums {
        let local = children.start - below.first..children.end - below.first;
        let local_children = local.clone();
        let nodes = &below.nodes[local.clone()];
        let mut balls = [Sphere::default(); 4];
        for (ball, child) in balls.iter_mut().zip(nodes) {
            *ball = Sphere {
                center: child.center.as_dvec3(),
                radius: f64::from(child.radius),
            };
        }
        self.bound(
            &balls[..nodes.len()],
            self.level_starts[level + 1] + children.start as u32,
            node,
        );
        let mut sums = SubtreeSums::default();
        for (child, own) in nodes.iter().zip(&below.sums[local.clone()]) {
            sums.add_child(own, child.center - node.center);
        }
        let mut splat_radius = node.radius;
        if !self.triangles.is_empty() {
            let mut caps = [DirectionCap::point(DVec3::Z); 4];
            let (mut usable, mut is_open) = (0, false);
            for child in nodes.iter().filter(|child| child.flags & Node::FLAT == 0) {
                match summary::unpack_cone(&child.cone) {
                    Some(cap) => {
                        caps[usable] = cap;
                        usable += 1;
                    }
                    None => is_open = true,
                }
            }
            if usable == 0 && !is_open {
                node.flags |= Node::FLAT;
            } else if !is_open {
                node.cone = summary::pack_cone(&caps[..usable]);
            }
            let direction = sums.principal_direction();
            if let Some((corners, leaves)) = &mut corners {
                (node.strip, splat_radius) =
                    corners.fit(leaves.start * 3, leaves.end * 3, node, direction);
            } else {
                let descent = strip::StripDescent {
                    nodes: below.nodes,
                    base: self.level_starts[level + 1] as usize,
                };
                node.strip = strip::around(nodes, descent, node, direction);
                // A ball around the node's center that holds the children's splats.
                let reach = |(child, attributes): (&Node, &NodeAttributes)| {
                    (node.center.distance(child.center) + attributes.splat_radius) * (1.0 + 1e-6)
                };
                splat_radius = nodes
                    .iter()
                    .zip(&below.attributes[local.clone()])
                    .map(reach)
                    .fold(0.0, f32::max);
            }
        }
        self.close(&sums, node);
        *attributes = sums.attributes(splat_radius.min(node.radius), || {
            let children = &below.attributes[local];
            children
                .iter()
                .find(|child| child.color[3] != 0)
                .map_or([0, 0], |child| child.normal)
        });
        let children = below.sums[local_children.clone()]
            .iter()
            .zip(&below.attributes[local_children.clone()]);
        if sums.is_all_around(children.map(|(sums, a)| (*sums, a.normal_or_zero()))) {
            attributes.forget_normal(summary::OF_A_BALL);
        }
        if attributes.has_normal() {
            let normal = attributes.normal();
            attributes.set_half_thickness(match corners {
                Some((corners, leaves)) if !self.triangles.is_empty() => {
                    corners.half_thickness(leaves.start * 3, leaves.end * 3, node.center, normal)
                }
                _ => thickness::of_children(nodes, &below.attributes[local_children], node, normal),
            });
        }
        sums
    }

    /// Sphere and children; the rest as for a node that is never culled.
    fn bound(&self, balls: &[Sphere], first_child: u32, node: &mut Node) {
        let center = sphere::enclosing(balls).center.as_vec3();
        // Around the center as stored, so that the children are inside exactly.
        let radius = sphere::radius_around(center.as_dvec3(), balls);
        *node = Node {
            center,
            radius: sphere::round_up(radius * (1.0 + 1e-15)),
            first_child,
            cone: super::NormalCone::ALL,
            strip: NodeStrip::SPHERE,
            child_count: balls.len() as u8,
            flags: 0,
        };
    }

    /// Normals that cancel say nothing about the node's front: it is drawn from everywhere.
    fn close(&self, sums: &SubtreeSums, node: &mut Node) {
        let is_flat = node.flags & Node::FLAT != 0;
        if !self.triangles.is_empty() && !is_flat && sums.normals_cancel() {
            node.cone = super::NormalCone::ALL;
            node.flags |= Node::UNCULLED;
        }
    }

    /// The first known vertex normal of leaves `first..first + count`.
    fn some_normal(&self, first: usize, count: usize) -> [i16; 2] {
        (first..first + count)
            .flat_map(|leaf| match self.triangles.get(leaf) {
                Some(&corners) => corners,
                None => [leaf as u32; 3],
            })
            .map(|index| &self.vertices[index as usize])
            .find(|vertex| vertex.color[3] != 0)
            .map_or([0, 0], |vertex| vertex.normal)
    }
}

/// The leaves of a block.
struct LowLevels<'a> {
    leaves: &'a [Leaf],
    normals: &'a [DVec3],
    sums: &'a [LeafSums],
}

#[inline]
fn rgb(vertex: &Vertex) -> Vec3 {
    let [r, g, b, _] = vertex.color;
    Vec3::new(f32::from(r), f32::from(g), f32::from(b))
}
