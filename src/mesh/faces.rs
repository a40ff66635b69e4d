//! Faces that lie on others, and faces that are turned round among their neighbors.
//!
//! A sheet that an exporter made two-sided has every face twice, the second time turned round: the normals of its vertices
//! cancel, and its edges pair as those of a closed surface do. One face of each such pair is enough: an open surface is
//! drawn from both sides. Scans have such pairs by accident, here and there; those stay. Faces that wind against their
//! neighbors are turned where that is possible: along edges of two faces, part by part, and a part that cannot be oriented
//! (a Möbius strip) stays.
//!
//! Sorting all edges takes longer than reading a large model. From `SMALL` triangles on the faces around some thousand
//! vertices are looked at first, and the rest only when some of them are at fault.

use glam::DVec3;
use rayon::prelude::*;

use super::Mesh;

/// Up to this many triangles all are looked at.
const SMALL: usize = 1 << 16;

/// Pairs of opposed triangles stay unless they leave more than one vertex in so many without a normal.
const VERTICES_A_CANCELLED: usize = 50;

/// Triangles stay as they wind unless more than one in so many winds against its neighbors.
const TRIANGLES_A_TURNED: u64 = 1000;

/// Most triangles that are repaired: the edges of more would fill the memory.
const MOST: usize = 1 << 26;

/// About how many vertices are looked at of a large mesh.
const SAMPLES: usize = 1 << 13;

/// What was repaired.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FaceRepairs {
    /// Triangles that were left out because another has the same corners and winds the other way.
    pub opposed: u64,
    /// Triangles that were turned round to wind as their neighbors do.
    pub turned: u64,
}

/// Leaves out one of each two triangles that have the same corners and wind against each other, where they are a sheet made
/// two-sided, and turns triangles that wind against their neighbors, where they are not just a few. Of a part that had such, the
/// orientation that stays encloses a positive volume when the part is closed, else it agrees with the normals of the mesh,
/// or with most triangles. Parts that are consistent stay as they are. Triangles keep their order; corners are the same
/// when they name the same vertex.
pub fn repair(mesh: &mut Mesh) -> FaceRepairs {
    let mut repairs = FaceRepairs::default();
    if mesh.triangles.len() < 2 || mesh.triangles.len() > MOST {
        return repairs;
    }
    let faults = if mesh.triangles.len() <= SMALL {
        SampledFaults::ALL
    } else {
        SampledFaults::of(mesh)
    };
    if faults.are_opposed {
        repairs.opposed = drop_opposed(mesh);
    }
    if faults.are_turned {
        repairs.turned = turn(mesh);
    }
    repairs
}

/// What a look at some vertices says about the mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct SampledFaults {
    are_opposed: bool,
    are_turned: bool,
}

/// An edge at a sampled vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct VertexEdge {
    vertex: u32,
    other: u32,
    is_outward: bool,
}

/// A triangle at a sampled vertex: the edge opposite of it, lower end first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct OppositeEdge {
    vertex: u32,
    low: u32,
    high: u32,
}

impl SampledFaults {
    const ALL: Self = Self {
        are_opposed: true,
        are_turned: true,
    };

    fn of(mesh: &Mesh) -> Self {
        let vertices = mesh.positions.len().max(1);
        // Every 2^bits-th vertex, scattered by the multiplication.
        let bits = (vertices / SAMPLES).max(1).ilog2();
        let is_sampled =
            |vertex: u32| bits == 0 || vertex.wrapping_mul(0x9e37_79b1) >> (32 - bits) == 0;
        let corners: Vec<[u32; 3]> = mesh
            .triangles
            .par_iter()
            .with_min_len(1 << 14)
            .flat_map_iter(|&[a, b, c]| {
                let turns = [[a, b, c], [b, c, a], [c, a, b]];
                turns.into_iter().filter(|turn| is_sampled(turn[0]))
            })
            .filter(|&[a, b, c]| a != b && b != c && c != a)
            .collect();
        let mut opposites: Vec<OppositeEdge> = corners
            .iter()
            .map(|&[vertex, a, b]| OppositeEdge {
                vertex,
                low: a.min(b),
                high: a.max(b),
            })
            .collect();
        opposites.par_sort_unstable();
        let pairs = opposites.windows(2).filter(|two| two[0] == two[1]).count();
        let mut spokes: Vec<VertexEdge> = corners
            .iter()
            .flat_map(|&[vertex, a, b]| {
                [(a, true), (b, false)].map(|(other, is_outward)| VertexEdge {
                    vertex,
                    other,
                    is_outward,
                })
            })
            .collect();
        spokes.par_sort_unstable();
        let turned = spokes
            .chunk_by(|a, b| (a.vertex, a.other) == (b.vertex, b.other))
            .filter(|edge| edge.len() == 2 && edge[0] == edge[1])
            .count();
        Self {
            are_opposed: pairs * 100 > corners.len(),
            are_turned: turned * 1000 > corners.len(),
        }
    }
}

/// The corners of a triangle in order, and whether the order is an odd permutation.
fn sorted([a, b, c]: [u32; 3]) -> ([u32; 3], bool) {
    let mut corners = [a, b, c];
    corners.sort_unstable();
    let is_odd = !(corners == [a, b, c] || corners == [b, c, a] || corners == [c, a, b]);
    (corners, is_odd)
}

/// Leaves out all but one of the triangles with the same corners that wind against each other, or none; returns how many.
fn drop_opposed(mesh: &mut Mesh) -> u64 {
    let mut keys: Vec<([u32; 3], u32)> = mesh
        .triangles
        .par_iter()
        .enumerate()
        .map(|(index, &triangle)| (sorted(triangle).0, index as u32))
        .collect();
    keys.par_sort_unstable();
    let is_odd = |index: u32| sorted(mesh.triangles[index as usize]).1;
    let are_opposed = |set: &&[([u32; 3], u32)]| {
        let [a, b, c] = set[0].0;
        let first = is_odd(set[0].1);
        a != b && b != c && set[1..].iter().any(|&(_, index)| is_odd(index) != first)
    };
    let sets: Vec<&[([u32; 3], u32)]> = keys
        .chunk_by(|a, b| a.0 == b.0)
        .filter(are_opposed)
        .collect();
    if sets.is_empty() {
        return 0;
    }
    // How many triangles each vertex has, and how many of them are opposed.
    let mut counts = vec![[0_u32; 2]; mesh.positions.len()];
    for &corner in mesh.triangles.iter().flatten() {
        counts[corner as usize][0] += 1;
    }
    for &(corners, _) in sets.iter().copied().flatten() {
        for corner in corners {
            counts[corner as usize][1] += 1;
        }
    }
    let used = counts.iter().filter(|count| count[0] > 0).count();
    let cancelled = counts
        .iter()
        .filter(|count| count[0] > 0 && count[0] == count[1])
        .count();
    if cancelled * VERTICES_A_CANCELLED <= used {
        return 0;
    }
    let mut is_gone = vec![false; mesh.triangles.len()];
    for &(_, index) in sets.iter().flat_map(|set| &set[1..]) {
        is_gone[index as usize] = true;
    }
    let before = mesh.triangles.len();
    let mut index = 0;
    mesh.triangles.retain(|_| {
        index += 1;
        !is_gone[index - 1]
    });
    if let Some(textures) = &mut mesh.textures {
        textures.retain(|index| !is_gone[index]);
    }
    (before - mesh.triangles.len()) as u64
}

/// A side of a triangle: the edge, lower vertex first, then twice the triangle and whether it runs from high to low.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct TriangleSide {
    edge: u64,
    triangle_and_direction: u32,
}

impl TriangleSide {
    fn triangle(self) -> u32 {
        self.triangle_and_direction >> 1
    }

    fn is_downward(self) -> bool {
        self.triangle_and_direction & 1 == 1
    }
}

/// Tells whether two sides of an edge run the same way, which those of one surface do not.
fn are_against(pair: &[TriangleSide]) -> bool {
    pair[0].is_downward() == pair[1].is_downward()
}

/// Turns what winds against its neighbors; returns how many triangles.
fn turn(mesh: &mut Mesh) -> u64 {
    let mut sides: Vec<TriangleSide> = mesh
        .triangles
        .par_iter()
        .enumerate()
        .filter(|(_, [a, b, c])| a != b && b != c && c != a)
        .flat_map_iter(|(index, &[a, b, c])| {
            [(a, b), (b, c), (c, a)].map(|(from, to)| TriangleSide {
                edge: u64::from(from.min(to)) << 32 | u64::from(from.max(to)),
                triangle_and_direction: (index as u32) << 1 | u32::from(from > to),
            })
        })
        .collect();
    sides.par_sort_unstable();
    let edges = || sides.chunk_by(|a, b| a.edge == b.edge);
    let corners = |side: TriangleSide| sorted(mesh.triangles[side.triangle() as usize]).0;
    // A triangle that is there twice is no neighbor of itself.
    let pairs = || edges().filter(|edge| edge.len() == 2 && corners(edge[0]) != corners(edge[1]));
    if !pairs().any(are_against) {
        return 0;
    }
    let mut parts = PartsOfSurface::new(mesh.triangles.len());
    for pair in pairs() {
        parts.join(pair[0].triangle(), pair[1].triangle(), are_against(pair));
    }
    let mut facts = vec![PartFacts::default(); mesh.triangles.len()];
    for edge in edges().filter(|edge| edge.len() != 2) {
        for side in edge {
            facts[parts.find(side.triangle()).0 as usize].is_open = true;
        }
    }
    for (index, &triangle) in mesh.triangles.iter().enumerate() {
        let (root, is_turned) = parts.find(index as u32);
        facts[root as usize].add(mesh, triangle, is_turned);
    }
    let wrong: Vec<usize> = (0..mesh.triangles.len())
        .filter(|&index| {
            let (root, is_turned) = parts.find(index as u32);
            let facts = facts[root as usize];
            parts.can_be_oriented[root as usize]
                && facts.is_mixed
                && is_turned != facts.is_root_wrong()
        })
        .collect();
    let turned = wrong.len() as u64;
    if turned * TRIANGLES_A_TURNED <= mesh.triangles.len() as u64 {
        return 0;
    }
    for index in wrong {
        mesh.triangles[index].swap(1, 2);
        if let Some(textures) = &mut mesh.textures {
            textures.corners[index].swap(1, 2);
        }
    }
    turned
}

/// The parts of a surface that hang together: union-find over triangles, with the turn against the root of the part
/// (R. Tarjan, "Efficiency of a Good But Not Linear Set Union Algorithm", 1975).
struct PartsOfSurface {
    parents: Vec<u32>,
    /// Whether a triangle winds against its parent.
    against: Vec<bool>,
    sizes: Vec<u32>,
    /// Of roots.
    can_be_oriented: Vec<bool>,
}

impl PartsOfSurface {
    fn new(count: usize) -> Self {
        Self {
            parents: (0..count as u32).collect(),
            against: vec![false; count],
            sizes: vec![1; count],
            can_be_oriented: vec![true; count],
        }
    }

    /// The root of a triangle's part, and whether the triangle winds against it.
    fn find(&mut self, triangle: u32) -> (u32, bool) {
        let (mut at, mut is_against) = (triangle, false);
        while self.parents[at as usize] != at {
            let parent = self.parents[at as usize];
            // Halves the path for the next time.
            let grandparent = self.parents[parent as usize];
            let turned = self.against[at as usize] ^ self.against[parent as usize];
            if grandparent != parent {
                self.parents[at as usize] = grandparent;
                self.against[at as usize] = turned;
                is_against ^= turned;
                at = grandparent;
            } else {
                is_against ^= self.against[at as usize];
                at = parent;
            }
        }
        (at, is_against)
    }

    fn join(&mut self, first: u32, second: u32, are_against: bool) {
        let (a, a_turned) = self.find(first);
        let (b, b_turned) = self.find(second);
        let turn = a_turned ^ b_turned ^ are_against;
        if a == b {
            self.can_be_oriented[a as usize] &= !turn;
            return;
        }
        let (root, child) = if self.sizes[a as usize] >= self.sizes[b as usize] {
            (a as usize, b as usize)
        } else {
            (b as usize, a as usize)
        };
        self.parents[child] = root as u32;
        self.against[child] = turn;
        self.sizes[root] += self.sizes[child];
        self.can_be_oriented[root] &= self.can_be_oriented[child];
    }
}

/// What decides the side of a part, if all triangles wound as its root does.
#[derive(Debug, Clone, Copy, Default)]
struct PartFacts {
    /// Triangles of both windings.
    is_mixed: bool,
    has_straight: bool,
    has_turned: bool,
    is_open: bool,
    /// Six times the volume.
    volume: f64,
    /// Triangles that the normals of the mesh (or else their own winding) agree with, less those they do not.
    votes: i64,
}

impl PartFacts {
    fn add(&mut self, mesh: &Mesh, triangle: [u32; 3], is_turned: bool) {
        self.has_straight |= !is_turned;
        self.has_turned |= is_turned;
        self.is_mixed = self.has_straight && self.has_turned;
        let sign = if is_turned { -1.0 } else { 1.0 };
        let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize].as_dvec3());
        self.volume += sign * a.dot(b.cross(c));
        let normal = |corner: u32| mesh.normals.get(corner as usize);
        let known: DVec3 = triangle
            .iter()
            .filter_map(|&corner| normal(corner))
            .map(|normal| normal.as_dvec3())
            .sum();
        let agreement = sign * (b - a).cross(c - a).dot(known);
        self.votes += match (known == DVec3::ZERO, agreement < 0.0, is_turned) {
            (true, _, false) | (false, false, _) => 1,
            (true, _, true) | (false, true, _) => -1,
        };
    }

    /// Tells whether the root's winding is the wrong one.
    fn is_root_wrong(&self) -> bool {
        if self.is_open || self.volume == 0.0 {
            self.votes < 0
        } else {
            self.volume < 0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A wavy sheet of `n` by `n` cells.
    fn sheet(n: u32) -> Mesh {
        let at = |i: u32| i as f32 / n as f32;
        let corner = |x: u32, y: u32| y * (n + 1) + x;
        Mesh {
            positions: (0..=n)
                .flat_map(|y| (0..=n).map(move |x| Vec3::new(at(x), at(y), (at(x) * 5.0).sin())))
                .collect(),
            triangles: (0..n * n)
                .flat_map(|i| {
                    let (x, y) = (i % n, i / n);
                    let [a, b] = [corner(x, y), corner(x + 1, y)];
                    let [c, d] = [corner(x + 1, y + 1), corner(x, y + 1)];
                    [[a, b, c], [a, c, d]]
                })
                .collect(),
            ..Mesh::default()
        }
    }

    fn tetrahedron() -> Mesh {
        Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
            ..Mesh::default()
        }
    }

    #[test]
    fn a_sheet_made_two_sided_is_one_sheet() {
        // Small, and so large that it is sampled.
        for n in [8, 250] {
            let once = sheet(n);
            let mut mesh = once.clone();
            let turned = once.triangles.iter().map(|&[a, b, c]| [c, b, a]);
            mesh.triangles.extend(turned);
            let count = once.triangles.len() as u64;
            let repairs = FaceRepairs {
                opposed: count,
                turned: 0,
            };
            assert_eq!(repair(&mut mesh), repairs);
            assert!(mesh == once, "{n}");
        }
        // The same way round they change nothing, and by accident they stay.
        let mut mesh = sheet(20);
        mesh.triangles.extend_from_within(5..90);
        let [a, b, c] = mesh.triangles[7];
        mesh.triangles.push([c, b, a]);
        let before = mesh.clone();
        assert_eq!(repair(&mut mesh), FaceRepairs::default());
        assert!(mesh == before);
    }

    #[test]
    fn faces_wind_as_most_of_their_neighbors() {
        for n in [8, 250] {
            let right = sheet(n);
            let mut mesh = right.clone();
            let mut turned = 0;
            for (index, triangle) in mesh.triangles.iter_mut().enumerate() {
                if index % 7 == 0 {
                    triangle.swap(1, 2);
                    turned += 1;
                }
            }
            assert_eq!(repair(&mut mesh).turned, turned);
            assert!(mesh == right);
            assert_eq!(repair(&mut mesh), FaceRepairs::default());
        }
    }

    #[test]
    fn normals_of_the_mesh_and_volume_decide_before_the_majority() {
        let right = sheet(8);
        let mut mesh = right.clone();
        mesh.normals = vec![Vec3::Z; mesh.positions.len()];
        let count = mesh.triangles.len();
        mesh.triangles[5..].iter_mut().for_each(|t| t.swap(1, 2));
        assert_eq!(repair(&mut mesh).turned, count as u64 - 5);
        assert_eq!(mesh.triangles, right.triangles);
        // Three of four faces of a closed part point inward.
        let right = tetrahedron();
        let mut mesh = right.clone();
        mesh.triangles[1..].iter_mut().for_each(|t| t.swap(1, 2));
        assert_eq!(repair(&mut mesh).turned, 3);
        assert!(mesh == right);
        // All of them do: that may be meant.
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        assert_eq!(repair(&mut mesh), FaceRepairs::default());
    }

    #[test]
    fn what_cannot_be_oriented_stays() {
        // A Möbius strip of five quads.
        let n = 5_u32;
        let positions: Vec<Vec3> = (0..2 * n)
            .map(|i| {
                let (sin, cos) = ((i / 2) as f32 * 1.2566).sin_cos();
                Vec3::new(cos, sin, (i % 2) as f32)
            })
            .collect();
        let triangles: Vec<[u32; 3]> = (0..n)
            .flat_map(|i| {
                let [a, b] = [2 * i, 2 * i + 1];
                let [c, d] = if i + 1 < n { [a + 2, b + 2] } else { [1, 0] };
                [[a, c, b], [b, c, d]]
            })
            .collect();
        let mut mesh = Mesh {
            positions,
            triangles,
            ..Mesh::default()
        };
        let before = mesh.clone();
        assert_eq!(repair(&mut mesh), FaceRepairs::default());
        assert_eq!(mesh, before);
        // Three sheets at one edge, and triangles without area.
        mesh.triangles = vec![[0, 1, 2], [0, 1, 3], [1, 0, 4], [5, 5, 6], [5, 5, 6]];
        let before = mesh.clone();
        assert_eq!(repair(&mut mesh), FaceRepairs::default());
        assert_eq!(mesh, before);
    }

    #[test]
    fn a_sound_mesh_is_not_touched() {
        for mesh in [sheet(8), sheet(250), tetrahedron(), Mesh::default()] {
            let mut repaired = mesh.clone();
            assert_eq!(repair(&mut repaired), FaceRepairs::default());
            assert!(repaired == mesh);
        }
    }
}
