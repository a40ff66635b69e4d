//! Square, sphere and torus: one rectangular grid of vertices, seams doubled.

use super::{GeneratedShape, ShapeSpec, ShapeSurface, trig::turn};
use glam::Vec3;
use std::ops::Range;

/// Radius of the circle that the tube follows.
const TORUS_MAJOR: f64 = 1.0;
/// Radius of the tube.
const TORUS_MINOR: f64 = 0.4;
/// Vertices a block, and half the cells: large enough to hide the hand-over, small enough for the caches.
const BLOCK: usize = 1 << 16;

/// The grid of a shape other than the statue. Vertex (i, j) has index `j (columns + 1) + i`.
pub(super) struct ShapeGrid {
    shape: GeneratedShape,
    columns: u64,
    rows: u64,
}

impl ShapeGrid {
    pub(super) fn new(spec: &ShapeSpec) -> ShapeGrid {
        let (columns, rows) = spec.grid();
        ShapeGrid {
            shape: spec.shape(),
            columns: columns.into(),
            rows: rows.into(),
        }
    }

    /// Sine and cosine of the angle w of row `j` (0, 1 for the square, which has none).
    ///
    /// The quarter turns are exact, so all vertices of a pole coincide.
    fn row(&self, j: u64) -> (f64, f64) {
        match self.shape {
            // w = -pi/2 + pi j/rows = (2 j - rows)/(4 rows) of a turn
            GeneratedShape::Sphere => {
                turn((2 * j + 3 * self.rows) % (4 * self.rows), 4 * self.rows)
            }
            // w = -pi + 2 pi j/rows = (2 j - rows)/(2 rows) of a turn
            GeneratedShape::Torus => turn((2 * j + self.rows) % (2 * self.rows), 2 * self.rows),
            _ => (0.0, 1.0),
        }
    }

    /// Position and normal of vertex (i, j), given `row(j)`.
    fn vertex(&self, i: u64, j: u64, (sin_w, cos_w): (f64, f64)) -> (Vec3, Vec3) {
        if self.shape == GeneratedShape::Square {
            return (
                single(centered(i, self.columns), centered(j, self.rows), 0.0),
                Vec3::Z,
            );
        }
        // The last column repeats the first to the bit, so the seam closes.
        let (sin_u, cos_u) = turn(i % self.columns, self.columns);
        let normal = single(cos_w * sin_u, sin_w, cos_w * cos_u);
        if self.shape == GeneratedShape::Sphere {
            return (normal, normal);
        }
        let ring = TORUS_MAJOR + TORUS_MINOR * cos_w;
        (
            single(ring * sin_u, TORUS_MINOR * sin_w, ring * cos_u),
            normal,
        )
    }
}

/// Node `i` of `n` cells across -1/2 to 1/2; exactly symmetric.
fn centered(i: u64, n: u64) -> f64 {
    // Below 2^33, hence exact.
    (2.0 * i as f64 - n as f64) / (2.0 * n as f64)
}

/// Rounds to single precision; adding zero makes a negative zero positive, so that equal positions have
/// equal bits.
fn single(x: f64, y: f64, z: f64) -> Vec3 {
    Vec3::new(
        (x + 0.0) as f32, //
        (y + 0.0) as f32,
        (z + 0.0) as f32,
    )
}

impl ShapeSurface for ShapeGrid {
    fn vertex_blocks(&self) -> Vec<Range<usize>> {
        super::blocks(((self.columns + 1) * (self.rows + 1)) as usize, BLOCK)
    }

    fn vertices(&self, block: Range<usize>, positions: &mut [Vec3], normals: &mut [Vec3]) {
        let width = self.columns + 1;
        let mut j = block.start as u64 / width;
        let mut i = block.start as u64 % width;
        let mut row = self.row(j);
        for (position, normal) in positions.iter_mut().zip(normals) {
            (*position, *normal) = self.vertex(i, j, row);
            i += 1;
            if i == width {
                i = 0;
                j += 1;
                row = self.row(j);
            }
        }
    }

    fn triangle_blocks(&self) -> Vec<Range<usize>> {
        super::blocks((self.columns * self.rows) as usize, BLOCK)
            .into_iter()
            .map(|cells| 2 * cells.start..2 * cells.end)
            .collect()
    }

    fn triangles(&self, block: Range<usize>, triangles: &mut [[u32; 3]]) {
        let cell = block.start as u64 / 2;
        let up = self.columns as u32 + 1;
        let mut i = cell % self.columns;
        let mut a = (cell / self.columns * u64::from(up) + i) as u32;
        for pair in triangles.chunks_exact_mut(2) {
            pair[0] = [a, a + 1, a + up + 1];
            pair[1] = [a, a + up + 1, a + up];
            a += 1;
            i += 1;
            if i == self.columns {
                i = 0;
                a += 1;
            }
        }
    }
}
