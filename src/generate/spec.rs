//! Which model to generate and how finely.

use super::GenerateError;
use std::{fmt, str::FromStr};

/// A generated surface. All are in single precision, counter-clockwise from outside, y up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum GeneratedShape {
    /// The unit square in z = 0, centered, normals +z.
    Square,
    /// The unit sphere on a longitude-latitude grid.
    Sphere,
    /// The torus around the y axis with radii 1 and 0.4.
    Torus,
    /// A displaced cube-sphere with detail at eight scales: closed, every vertex shared.
    Statue,
}

impl GeneratedShape {
    /// Every shape.
    pub const ALL: [GeneratedShape; 4] = [
        GeneratedShape::Square,
        GeneratedShape::Sphere,
        GeneratedShape::Torus,
        GeneratedShape::Statue,
    ];

    /// The name in lower case, as [`FromStr`] reads it.
    pub fn name(self) -> &'static str {
        match self {
            GeneratedShape::Square => "square",
            GeneratedShape::Sphere => "sphere",
            GeneratedShape::Torus => "torus",
            GeneratedShape::Statue => "statue",
        }
    }
}

impl fmt::Display for GeneratedShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for GeneratedShape {
    type Err = GenerateError;

    fn from_str(name: &str) -> Result<GeneratedShape, GenerateError> {
        GeneratedShape::ALL
            .into_iter()
            .find(|shape| shape.name() == name)
            .ok_or_else(|| GenerateError::UnknownShape(name.to_owned()))
    }
}

/// A shape and its grid: two triangles in each cell. Its counts always fit 32-bit indices.
///
/// ```
/// use surfel::generate::{GeneratedShape, ShapeSpec};
/// let spec = ShapeSpec::with_triangles(GeneratedShape::Sphere, 1_000_000)?;
/// assert_eq!(spec.grid(), (1000, 500));
/// assert_eq!(spec.counts(), (501_501, 1_000_000));
/// # Ok::<(), surfel::generate::GenerateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShapeSpec {
    shape: GeneratedShape,
    columns: u32,
    rows: u32,
}

impl FromStr for ShapeSpec {
    type Err = GenerateError;

    /// `SHAPE[:TRIANGLES]`, a million triangles without a number; `_` may part its digits.
    fn from_str(text: &str) -> Result<ShapeSpec, GenerateError> {
        let (shape, triangles) = match text.split_once(':') {
            Some((shape, triangles)) => (shape, Some(triangles)),
            None => (text, None),
        };
        let shape: GeneratedShape = shape.parse()?;
        let triangles = triangles.map_or(Ok(1_000_000), |text| {
            let digits = text.replace('_', "");
            digits
                .parse()
                .map_err(|_| GenerateError::BadCount(text.to_owned()))
        })?;
        ShapeSpec::with_triangles(shape, triangles)
    }
}

/// Vertices have 32-bit indices; one value stays free, so that the number of vertices fits as well.
const MOST_VERTICES: u64 = u32::MAX as u64;

impl ShapeSpec {
    /// The model whose triangle count is nearest to `triangles` under the rule of its shape; never fewer
    /// than the smallest grid of [`ShapeSpec::with_grid`] has. [`ShapeSpec::counts`] tells what came out.
    ///
    /// * Square: half of `triangles` cells (rounded down), on the most nearly square grid of exactly that
    ///   many: `b` rows with `b` the largest divisor not above the square root. A prime gives one row.
    /// * Sphere: twice as many cells around as from pole to pole, 4 b^2 triangles: 1000 x 500 for 1,000,000.
    /// * Torus: needles, as in the only grid that has the vertex count of Benda's thesis: `b` around the
    ///   tube for 400 b^2 nearest to `triangles`, and as many around the axis as come nearest:
    ///   20000 x 100 for 4,000,000. For well-shaped triangles give the grid.
    /// * Statue: `n` cells along each cube edge, 12 n^2 triangles.
    ///
    /// # Errors
    ///
    /// [`GenerateError::TooFewTriangles`] for 0, [`GenerateError::TooLarge`] above what 32-bit indices can name.
    pub fn with_triangles(
        shape: GeneratedShape,
        triangles: u64,
    ) -> Result<ShapeSpec, GenerateError> {
        if triangles == 0 {
            return Err(GenerateError::TooFewTriangles);
        }
        // Refused here already, so that nothing below can overflow: no shape has more than two triangles a
        // vertex by more than a handful.
        if triangles > 2 * MOST_VERTICES + 2 {
            return Err(GenerateError::TooLarge {
                shape,
                limit: MOST_VERTICES,
            });
        }
        let (columns, rows) = match shape {
            GeneratedShape::Square => {
                let cells = (triangles / 2).max(1);
                let rows = (1..=cells.isqrt())
                    .rev()
                    .find(|b| cells.is_multiple_of(*b))
                    .unwrap_or(1);
                (cells / rows, rows)
            }
            GeneratedShape::Sphere => {
                let rows = nearest_root(triangles, 4).max(2);
                (2 * rows, rows)
            }
            GeneratedShape::Torus => {
                let rows = nearest_root(triangles, 400).max(3);
                let columns = (triangles + rows) / (2 * rows);
                (columns.max(3), rows)
            }
            GeneratedShape::Statue => {
                let n = nearest_root(triangles, 12).max(1);
                (n, n)
            }
        };
        ShapeSpec::checked(shape, columns, rows)
    }

    /// The model on a grid of `columns` x `rows` cells.
    ///
    /// Square: along x and along y, at least 1 x 1. Sphere: around the axis and from pole to pole, at least
    /// 3 x 2. Torus: around the axis and around the tube, at least 3 x 3. Statue: cells along a cube edge,
    /// twice the same number, at least 1.
    ///
    /// # Errors
    ///
    /// [`GenerateError::BadGrid`] below these limits, [`GenerateError::TooLarge`] above what 32-bit indices can name.
    pub fn with_grid(
        shape: GeneratedShape,
        columns: u32,
        rows: u32,
    ) -> Result<ShapeSpec, GenerateError> {
        let (fits, wanted) = match shape {
            GeneratedShape::Square => (columns >= 1 && rows >= 1, "at least 1x1"),
            GeneratedShape::Sphere => (columns >= 3 && rows >= 2, "at least 3x2"),
            GeneratedShape::Torus => (columns >= 3 && rows >= 3, "at least 3x3"),
            GeneratedShape::Statue => (columns >= 1 && columns == rows, "NxN with N at least 1"),
        };
        if !fits {
            return Err(GenerateError::BadGrid {
                shape,
                columns,
                rows,
                wanted,
            });
        }
        ShapeSpec::checked(shape, u64::from(columns), u64::from(rows))
    }

    fn checked(shape: GeneratedShape, columns: u64, rows: u64) -> Result<ShapeSpec, GenerateError> {
        let too_large = GenerateError::TooLarge {
            shape,
            limit: MOST_VERTICES,
        };
        match (u32::try_from(columns), u32::try_from(rows)) {
            (Ok(columns), Ok(rows)) if vertices(shape, columns, rows) <= MOST_VERTICES.into() => {
                Ok(ShapeSpec {
                    shape,
                    columns,
                    rows,
                })
            }
            _ => Err(too_large),
        }
    }

    /// The shape.
    pub fn shape(&self) -> GeneratedShape {
        self.shape
    }

    /// Cells of the grid, columns then rows; for the statue the cells along a cube edge, twice.
    pub fn grid(&self) -> (u32, u32) {
        (self.columns, self.rows)
    }

    /// The exact numbers of vertices and triangles. The vertices fit a `u32`.
    pub fn counts(&self) -> (u64, u64) {
        let cells = u64::from(self.columns) * u64::from(self.rows);
        let triangles = match self.shape {
            GeneratedShape::Statue => 12 * cells,
            _ => 2 * cells,
        };
        // `checked` has made sure that the vertices fit.
        (
            vertices(self.shape, self.columns, self.rows) as u64,
            triangles,
        )
    }
}

/// Vertices of a grid: seams are doubled, but the statue shares all.
fn vertices(shape: GeneratedShape, columns: u32, rows: u32) -> u128 {
    let (columns, rows) = (u128::from(columns), u128::from(rows));
    match shape {
        GeneratedShape::Statue => 6 * columns * columns + 2,
        _ => (columns + 1) * (rows + 1),
    }
}

/// The `b` for which `factor * b^2` is nearest to `count`; the smaller one of two as near.
fn nearest_root(count: u64, factor: u64) -> u64 {
    let below = (count / factor).isqrt();
    let above = below + 1;
    // below^2 factor <= count < above^2 factor.
    if count - factor * below * below <= factor * above * above - count {
        below
    } else {
        above
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_root_is_nearest() {
        for factor in [1, 4, 12, 400] {
            for count in 1..5000_u64 {
                let found = nearest_root(count, factor);
                let best = (0..80)
                    .min_by_key(|b| (factor * b * b).abs_diff(count))
                    .expect("not empty");
                assert_eq!(found, best, "{factor} b^2 near {count}");
            }
        }
    }

    #[test]
    fn limits_are_errors() {
        assert!(matches!(
            ShapeSpec::with_triangles(GeneratedShape::Sphere, 0),
            Err(GenerateError::TooFewTriangles)
        ));
        for shape in GeneratedShape::ALL {
            for triangles in [u64::MAX, 8_700_000_000, 17_179_869_184] {
                assert!(
                    matches!(
                        ShapeSpec::with_triangles(shape, triangles),
                        Err(GenerateError::TooLarge { .. })
                    ),
                    "{shape} {triangles}"
                );
            }
            // The largest models have indices that just fit.
            let (vertices, _) = ShapeSpec::with_triangles(shape, 8_000_000_000)
                .expect("fits")
                .counts();
            assert!(vertices > 3_900_000_000 && vertices <= u64::from(u32::MAX));
        }
        assert!(matches!(
            ShapeSpec::with_grid(GeneratedShape::Square, u32::MAX, 1),
            Err(GenerateError::TooLarge { .. })
        ));
        for (shape, columns, rows) in [
            (GeneratedShape::Square, 0, 1),
            (GeneratedShape::Sphere, 2, 9),
            (GeneratedShape::Sphere, 3, 1),
            (GeneratedShape::Torus, 3, 2),
            (GeneratedShape::Statue, 3, 4),
            (GeneratedShape::Statue, 0, 0),
        ] {
            assert!(matches!(
                ShapeSpec::with_grid(shape, columns, rows),
                Err(GenerateError::BadGrid { .. })
            ));
        }
        assert!(matches!(
            "cube".parse::<GeneratedShape>(),
            Err(GenerateError::UnknownShape(_))
        ));
    }
}
