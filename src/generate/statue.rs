//! The statue: a cube-sphere displaced by 24 waves, closed, with area-weighted normals.
//!
//! The vertices are the integer points (x, y, z) on the surface of the cube `0..=n` cubed, in layers of z:
//! the bottom face row by row, then the rings of layers 1 to n - 1, then the top face. Every point has one
//! row and one column in that order ([`StatueLattice::locate`]), so an index is found from the coordinates by a
//! few comparisons, and vertices are shared across cube edges without a table.
//!
//! A normal needs the positions around its vertex. A block of rows therefore computes one more row at both
//! ends; the few neighbors that lie elsewhere still (the first and last ring against the rims of the faces)
//! are computed again where they are needed. A position is a function of (x, y, z) alone, so it is
//! bit-identical wherever it is computed, and a block needs nothing from other blocks: that is what makes
//! the model streamable and independent of the number of threads.

use super::{ShapeSurface, trig::sin};
use glam::{DVec3, Vec3};
use std::{f64::consts::FRAC_PI_4, ops::Range, sync::LazyLock};

/// The 24 rows that define the surface (source: this project's conventions).
const TABLE: &str = include_str!("../../assets/statue-waves.json");
/// Number of waves, a multiple of [`LANES`].
const WAVES: usize = 24;
/// Waves summed side by side; the sum has this fixed shape, so it is the same on every machine.
const LANES: usize = 8;
/// Scale per axis after the displacement.
const SCALE: [f64; 3] = [0.8, 1.35, 0.7];
/// About this many vertices in a block: one more row at both ends should cost little.
const BLOCK: usize = 1 << 16;

/// The waves as columns, so that the compiler can take several at a time.
struct SurfaceWaves {
    qx: [f64; WAVES],
    qy: [f64; WAVES],
    qz: [f64; WAVES],
    phase: [f64; WAVES],
    /// The displacement of a row is `constant + linear s + crease |s|`.
    constant: [f64; WAVES],
    linear: [f64; WAVES],
    crease: [f64; WAVES],
}

#[derive(serde::Deserialize)]
struct LatticeRow {
    kind: StatuePart,
    q: [f64; 3],
    phase: f64,
    amplitude: f64,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "lowercase")]
enum StatuePart {
    Wave,
    Crease,
}

static TABLE_WAVES: LazyLock<SurfaceWaves> = LazyLock::new(|| {
    let rows: [LatticeRow; WAVES] =
        serde_json::from_str(TABLE).expect("the table in assets has 24 well-formed rows");
    let mut waves = SurfaceWaves {
        qx: [0.0; WAVES],
        qy: [0.0; WAVES],
        qz: [0.0; WAVES],
        phase: [0.0; WAVES],
        constant: [0.0; WAVES],
        linear: [0.0; WAVES],
        crease: [0.0; WAVES],
    };
    for (k, row) in rows.into_iter().enumerate() {
        [waves.qx[k], waves.qy[k], waves.qz[k]] = row.q;
        waves.phase[k] = row.phase;
        match row.kind {
            StatuePart::Wave => waves.linear[k] = row.amplitude,
            StatuePart::Crease => {
                waves.constant[k] = 0.6 * row.amplitude;
                waves.crease[k] = -1.6 * row.amplitude;
            }
        }
    }
    waves
});

impl SurfaceWaves {
    /// The displacement d at the unit vector `p`.
    #[inline]
    fn displacement(&self, p: DVec3) -> f64 {
        let mut sums = [0.0; LANES];
        for start in (0..WAVES).step_by(LANES) {
            for (lane, sum) in sums.iter_mut().enumerate() {
                let k = start + lane;
                let s = sin(self.qx[k] * p.x + self.qy[k] * p.y + self.qz[k] * p.z + self.phase[k]);
                *sum += self.constant[k] + self.linear[k] * s + self.crease[k] * s.abs();
            }
        }
        sums.iter().sum()
    }
}

/// An integer point on the surface of the cube.
type LatticePoint = [u32; 3];

/// One side of the cube, seen from outside: `right` x `up` is the outward direction. Steps go along the
/// axis of that number, up (+1) or down (-1).
struct StatueFace {
    /// The axis that the face is perpendicular to, and whether it is the far one (coordinate n).
    axis: usize,
    far: bool,
    right: (usize, i32),
    up: (usize, i32),
}

/// Bottom, the four sides (rows along the rings), top.
const FACES: [StatueFace; 6] = [
    face(2, false, [(0, -1), (1, 1)]),
    face(1, false, [(0, 1), (2, 1)]),
    face(0, true, [(1, 1), (2, 1)]),
    face(1, true, [(0, -1), (2, 1)]),
    face(0, false, [(1, -1), (2, 1)]),
    face(2, true, [(0, 1), (1, 1)]),
];

/// Face with axes to the right and up, each a number and a direction.
const fn face(axis: usize, far: bool, axes: [(usize, i32); 2]) -> StatueFace {
    let [right, up] = axes;
    StatueFace {
        axis,
        far,
        right,
        up,
    }
}

/// The fan around a vertex, counter-clockwise, in steps to the right and up. The cell diagonal goes from
/// lower left to upper right. The triangle after each spoke exists where its cell does.
const FAN: [(i32, i32); 6] = [(1, 0), (1, 1), (0, 1), (-1, 0), (-1, -1), (0, -1)];

/// The order of the surface points of the cube.
#[derive(Clone, Copy)]
struct StatueLattice {
    /// Cells along an edge.
    n: u32,
}

impl StatueLattice {
    /// Rows: n + 1 of the bottom, n - 1 rings, n + 1 of the top.
    fn rows(self) -> usize {
        3 * self.n as usize + 1
    }

    /// Index of the first vertex of a row, `row <= rows()`.
    fn row_start(self, row: usize) -> usize {
        let n = self.n as usize;
        let rim = n + 1;
        if row <= rim {
            row * rim
        } else if row <= 2 * n {
            rim * rim + (row - rim) * 4 * n
        } else {
            rim * rim + (n - 1) * 4 * n + (row - 2 * n) * rim
        }
    }

    /// Row and column of a surface point.
    #[inline]
    fn locate(self, [x, y, z]: LatticePoint) -> (usize, usize) {
        let n = self.n;
        let (row, column) = if z == 0 {
            (y, x)
        } else if z == n {
            (2 * n + y, x)
        } else if y == 0 && x < n {
            (n + z, x)
        } else if x == n && y < n {
            (n + z, n + y)
        } else if y == n && x > 0 {
            (n + z, 3 * n - x)
        } else {
            (n + z, 4 * n - y)
        };
        (row as usize, column as usize)
    }

    /// Index of a surface point.
    #[inline]
    fn index(self, point: LatticePoint) -> u32 {
        let (row, column) = self.locate(point);
        (self.row_start(row) + column) as u32
    }

    /// The point in a row and column; the inverse of [`StatueLattice::locate`].
    fn point(self, row: usize, column: usize) -> LatticePoint {
        let n = self.n;
        let (row, column) = (row as u32, column as u32);
        if row <= n {
            return [column, row, 0];
        }
        if row >= 2 * n {
            return [column, row - 2 * n, n];
        }
        let along = column % n;
        let [x, y] = match column / n {
            0 => [along, 0],
            1 => [n, along],
            2 => [n - along, n],
            _ => [0, n - along],
        };
        [x, y, row - n]
    }

    /// Vertices in a row.
    fn row_len(self, row: usize) -> usize {
        self.row_start(row + 1) - self.row_start(row)
    }
}

/// The statue with `n` cells along each cube edge.
pub(super) struct StatueShape {
    lattice: StatueLattice,
    /// tan((2 k/n - 1) pi/4) for k from 0 to n; exactly symmetric, with exact ends.
    tangents: Vec<f64>,
    waves: &'static SurfaceWaves,
}

impl StatueShape {
    pub(super) fn new(n: u32) -> StatueShape {
        let tangents = (0..=n).map(|k| tangent(k, n)).collect();
        StatueShape {
            lattice: StatueLattice { n },
            tangents,
            waves: &TABLE_WAVES,
        }
    }

    /// The position of a surface point of the cube; a function of the point alone.
    fn position(&self, [x, y, z]: LatticePoint) -> Vec3 {
        let cube = DVec3::new(
            self.tangents[x as usize],
            self.tangents[y as usize],
            self.tangents[z as usize],
        );
        // At least one coordinate is 1 or -1, so the length is at least 1.
        let p = cube / cube.length();
        let mut v = p * (1.0 + self.waves.displacement(p)) * DVec3::from(SCALE);
        v.x += 0.12 * sin(2.2 * v.y);
        v.as_vec3()
    }

    /// The area-weighted normal at `point`: the unit vector of the sum of the cross products of the final,
    /// rounded triangles around it. Zero should all of them have no area.
    fn normal(
        &self,
        point: LatticePoint,
        center: Vec3,
        position: &impl Fn(LatticePoint) -> Vec3,
    ) -> Vec3 {
        let n = self.lattice.n;
        let center = center.as_dvec3();
        let mut sum = DVec3::ZERO;
        for face in &FACES {
            if point[face.axis] != if face.far { n } else { 0 } {
                continue;
            }
            // Differences of nearby single-precision numbers and their products are exact in double, so
            // the order of the sum hardly matters; it is fixed all the same.
            let mut spokes = [None; 6];
            for (spoke, (right, up)) in spokes.iter_mut().zip(FAN) {
                *spoke = step(point, face, right, up, n).map(|at| position(at).as_dvec3() - center);
            }
            for k in 0..6 {
                if let (Some(a), Some(b)) = (spokes[k], spokes[(k + 1) % 6]) {
                    sum += a.cross(b);
                }
            }
        }
        sum.normalize_or_zero().as_vec3()
    }
}

/// `point` moved by some cells to the right and up on a face, or `None` past its border.
#[inline]
fn step(
    mut point: LatticePoint,
    face: &StatueFace,
    right: i32,
    up: i32,
    n: u32,
) -> Option<LatticePoint> {
    for ((axis, sign), steps) in [(face.right, right), (face.up, up)] {
        let moved = point[axis].wrapping_add_signed(sign * steps);
        if moved > n {
            return None;
        }
        point[axis] = moved;
    }
    Some(point)
}

/// tan((2 k/n - 1) pi/4), odd about the middle to the bit, 1 at the ends.
fn tangent(k: u32, n: u32) -> f64 {
    let numerator = 2 * i64::from(k) - i64::from(n);
    if numerator.unsigned_abs() == u64::from(n) {
        return numerator.signum() as f64;
    }
    let angle = numerator as f64 / f64::from(n) * FRAC_PI_4;
    // cos a = 1 - 2 sin^2(a/2), without cancellation up to pi/4.
    let half = sin(0.5 * angle);
    sin(angle) / (1.0 - 2.0 * half * half)
}

impl ShapeSurface for StatueShape {
    fn vertex_blocks(&self) -> Vec<Range<usize>> {
        let mut blocks = Vec::new();
        let mut start = 0;
        for row in 1..=self.lattice.rows() {
            let end = self.lattice.row_start(row);
            if end - start >= BLOCK || row == self.lattice.rows() {
                blocks.push(start..end);
                start = end;
            }
        }
        blocks
    }

    fn vertices(&self, block: Range<usize>, positions: &mut [Vec3], normals: &mut [Vec3]) {
        let lattice = self.lattice;
        // Blocks begin and end with a row.
        let row_of = |vertex: usize| {
            let (mut low, mut high) = (0, lattice.rows());
            while low < high {
                let middle = (low + high) / 2;
                if lattice.row_start(middle) < vertex {
                    low = middle + 1;
                } else {
                    high = middle;
                }
            }
            low
        };
        let rows = row_of(block.start)..row_of(block.end);
        let with_rim = rows.start.saturating_sub(1)..(rows.end + 1).min(lattice.rows());
        let first = lattice.row_start(with_rim.start);
        let mut known = Vec::with_capacity(lattice.row_start(with_rim.end) - first);
        for row in with_rim.clone() {
            known.extend(
                (0..lattice.row_len(row)).map(|column| self.position(lattice.point(row, column))),
            );
        }
        let position = |point: LatticePoint| {
            let (row, column) = lattice.locate(point);
            if with_rim.contains(&row) {
                known[lattice.row_start(row) - first + column]
            } else {
                self.position(point)
            }
        };

        positions.copy_from_slice(&known[block.start - first..block.end - first]);
        let mut vertex = 0;
        for row in rows {
            for column in 0..lattice.row_len(row) {
                let point = lattice.point(row, column);
                normals[vertex] = self.normal(point, positions[vertex], &position);
                vertex += 1;
            }
        }
    }

    fn triangle_blocks(&self) -> Vec<Range<usize>> {
        let n = self.lattice.n as usize;
        super::blocks(6 * n * n, BLOCK)
            .into_iter()
            .map(|cells| 2 * cells.start..2 * cells.end)
            .collect()
    }

    /// Face by face, row by row: cell (i, j) gives (a, b, c) and (a, c, d), with a its lower left corner.
    fn triangles(&self, block: Range<usize>, triangles: &mut [[u32; 3]]) {
        let n = self.lattice.n;
        let cells = n as usize;
        let corner = |face: &StatueFace, i: u32, j: u32| {
            let mut point = [0; 3];
            point[face.axis] = if face.far { n } else { 0 };
            for ((axis, sign), steps) in [(face.right, i), (face.up, j)] {
                point[axis] = if sign > 0 { steps } else { n - steps };
            }
            self.lattice.index(point)
        };
        let mut cell = block.start / 2;
        let mut pairs = triangles.chunks_exact_mut(2);
        while cell < block.end / 2 {
            // One row of a face, or what the block has of it.
            let face = &FACES[cell / (cells * cells)];
            let j = (cell / cells % cells) as u32;
            let first = (cell % cells) as u32;
            let last = n.min(first + (block.end / 2 - cell) as u32);
            let (mut a, mut d) = (corner(face, first, j), corner(face, first, j + 1));
            for (i, pair) in (first..last).zip(&mut pairs) {
                let (b, c) = (corner(face, i + 1, j), corner(face, i + 1, j + 1));
                pair[0] = [a, b, c];
                pair[1] = [a, c, d];
                (a, d) = (b, c);
            }
            cell += (last - first) as usize;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_index_has_one_point_and_back() {
        for n in [1, 2, 3, 7] {
            let lattice = StatueLattice { n };
            let mut index = 0;
            for row in 0..lattice.rows() {
                for column in 0..lattice.row_len(row) {
                    let point = lattice.point(row, column);
                    assert!(
                        point.iter().all(|c| *c <= n) && point.iter().any(|c| *c == 0 || *c == n)
                    );
                    assert_eq!(lattice.locate(point), (row, column));
                    assert_eq!(lattice.index(point), index);
                    index += 1;
                }
            }
            assert_eq!(index, 6 * n * n + 2);
        }
    }

    #[test]
    fn tangents_are_odd_with_exact_ends() {
        for n in [1, 2, 3, 8, 289] {
            assert_eq!((tangent(0, n), tangent(n, n)), (-1.0, 1.0));
            for k in 0..=n {
                assert_eq!(tangent(k, n), -tangent(n - k, n));
                let exact = ((2.0 * f64::from(k) / f64::from(n) - 1.0) * FRAC_PI_4).tan();
                assert!((tangent(k, n) - exact).abs() < 1e-15);
            }
        }
    }

    /// The fan relies on the cell diagonals; this ties it to the triangles that are really written.
    #[test]
    fn normals_are_those_of_the_triangles() {
        for n in [1, 2, 5] {
            let spec =
                super::super::ShapeSpec::with_grid(super::super::GeneratedShape::Statue, n, n)
                    .expect("a valid grid");
            let mesh = super::super::mesh(&spec);
            let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
            for corners in &mesh.triangles {
                let [a, b, c] = corners.map(|k| mesh.positions[k as usize].as_dvec3());
                for k in corners {
                    sums[*k as usize] += (b - a).cross(c - a);
                }
            }
            for (sum, normal) in sums.iter().zip(&mesh.normals) {
                let wanted = sum.normalize();
                assert!((wanted - normal.as_dvec3()).length() < 1e-6, "n = {n}");
            }
        }
    }
}
