//! The last step of every reader: from the numbers of the file to a [`Mesh`] that keeps its promises.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::job::ReadJob;
use super::polygon::PolygonRuns;
use super::textures::RawTextures;
use super::{Error, FileCounts, ReadWarning};
use crate::mesh::attributes::{CoordinateGrid, PointAttributes};
use crate::mesh::{self, Mesh};

/// Items per parallel piece: large enough to hide the scheduling, small enough for two threads to share.
const PIECE: usize = 1 << 16;

/// Positions in the precision of the file: single stays single and whole steps stay whole (half the memory), all else is
/// double.
#[derive(Debug, Clone)]
pub(super) enum FileCoordinates {
    Single(Vec<Vec3>),
    Double(Vec<DVec3>),
    /// Whole numbers of a file's own step: `offset + scale * step`, in double precision.
    Steps(StepGrid),
}

/// Positions as whole numbers of steps.
#[derive(Debug, Clone)]
pub(super) struct StepGrid {
    pub(super) steps: Vec<[i32; 3]>,
    pub(super) scale: DVec3,
    pub(super) offset: DVec3,
}

impl StepGrid {
    /// The position of steps.
    #[inline]
    pub(super) fn place(&self, [x, y, z]: [i32; 3]) -> DVec3 {
        self.offset + self.scale * DVec3::new(x.into(), y.into(), z.into())
    }
}

impl FileCoordinates {
    pub(super) fn len(&self) -> usize {
        match self {
            FileCoordinates::Single(positions) => positions.len(),
            FileCoordinates::Double(positions) => positions.len(),
            FileCoordinates::Steps(grid) => grid.steps.len(),
        }
    }
}

/// Extents that are kept as they are; beyond, squares of lengths leave single precision.
const LARGEST: f64 = 1e17;
const SMALLEST: f64 = 1e-17;

/// Vertices further off than this many sizes of the model are left out where the extent is over the largest.
pub(super) const ABSURD: f64 = 1e12;

impl FileCoordinates {
    fn at(&self, index: usize) -> DVec3 {
        match self {
            FileCoordinates::Single(positions) => positions[index].as_dvec3(),
            FileCoordinates::Double(positions) => positions[index],
            FileCoordinates::Steps(grid) => grid.place(grid.steps[index]),
        }
    }

    /// The grid on which the file has them.
    fn grid(&self) -> Option<CoordinateGrid> {
        match self {
            FileCoordinates::Steps(grid) => Some(CoordinateGrid {
                step: grid.scale,
                offset: grid.offset,
            })
            .filter(|grid| grid.step.cmpgt(DVec3::ZERO).all() && grid.offset.is_finite()),
            _ => None,
        }
    }

    /// Makes a position one that is dropped.
    fn forget(&mut self, index: usize) {
        match self {
            FileCoordinates::Single(positions) => positions[index] = Vec3::NAN,
            FileCoordinates::Double(positions) => positions[index] = DVec3::NAN,
            FileCoordinates::Steps(grid) => {
                let mut positions: Vec<DVec3> =
                    grid.steps.iter().map(|&steps| grid.place(steps)).collect();
                positions[index] = DVec3::NAN;
                *self = FileCoordinates::Double(positions);
            }
        }
    }

    /// Multiplies all positions.
    fn scale(&mut self, factor: f64) {
        match self {
            FileCoordinates::Single(positions) => positions
                .par_iter_mut()
                .for_each(|point| *point = (point.as_dvec3() * factor).as_vec3()),
            FileCoordinates::Double(positions) => {
                positions.par_iter_mut().for_each(|point| *point *= factor);
            }
            FileCoordinates::Steps(grid) => {
                grid.scale *= factor;
                grid.offset *= factor;
            }
        }
    }
}

/// What a reader found. `normals` and `colors` have the length of `coordinates` or are empty; the indices of
/// `triangles` are in range.
#[derive(Debug, Clone)]
pub(super) struct RawMesh {
    pub(super) coordinates: FileCoordinates,
    pub(super) normals: Vec<Vec3>,
    /// How many of `normals` are zero because the file gives that vertex none, which is no reason to warn.
    pub(super) absent_normals: u64,
    pub(super) colors: Vec<[u8; 4]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Which triangles are faces of more than three corners.
    pub(super) polygons: PolygonRuns,
    pub(super) counts: FileCounts,
    /// Which images triangles have, and where.
    pub(super) textures: Option<RawTextures>,
}

impl RawMesh {
    /// Gives every triangle its color: vertices between two colors are doubled, the further ones follow at the end.
    /// Triangles of one color only give none: white is what they would be.
    pub(super) fn color_faces(&mut self, colors: &[[u8; 4]]) {
        const WHITE: [u8; 4] = [255; 4];
        if colors.iter().all(|&color| color == WHITE) {
            return;
        }
        let mut of_vertex: Vec<Option<[u8; 4]>> = vec![None; self.coordinates.len()];
        let mut further: HashMap<(u32, [u8; 4]), u32> = HashMap::new();
        let mut sources: Vec<u32> = Vec::new();
        for (triangle, &color) in self.triangles.iter_mut().zip(colors) {
            for corner in triangle {
                if *of_vertex[*corner as usize].get_or_insert(color) == color {
                    continue;
                }
                let next = of_vertex.len() as u32;
                let vertex = *further.entry((*corner, color)).or_insert(next);
                if vertex == next {
                    of_vertex.push(Some(color));
                    sources.push(*corner);
                }
                *corner = vertex;
            }
        }
        fn repeat<T: Copy>(items: &mut Vec<T>, sources: &[u32]) {
            if items.is_empty() {
                return;
            }
            for &source in sources {
                items.push(items[source as usize]);
            }
        }
        match &mut self.coordinates {
            FileCoordinates::Single(positions) => repeat(positions, &sources),
            FileCoordinates::Double(positions) => repeat(positions, &sources),
            FileCoordinates::Steps(grid) => repeat(&mut grid.steps, &sources),
        }
        repeat(&mut self.normals, &sources);
        self.colors = of_vertex
            .into_iter()
            .map(|color| color.unwrap_or(WHITE))
            .collect();
    }
}

/// The box of all points that single precision can hold, and how far single precision would move them.
#[derive(Debug, Clone, Copy)]
struct PointBounds {
    min: DVec3,
    max: DVec3,
    /// Largest difference of a coordinate to its nearest single-precision value.
    rounding: f64,
}

impl PointBounds {
    const EMPTY: PointBounds = PointBounds {
        min: DVec3::splat(f64::INFINITY),
        max: DVec3::splat(f64::NEG_INFINITY),
        rounding: 0.0,
    };

    fn with(mut self, point: DVec3) -> PointBounds {
        if point.abs().cmple(DVec3::splat(f64::from(f32::MAX))).all() {
            self.min = self.min.min(point);
            self.max = self.max.max(point);
            self.rounding = self
                .rounding
                .max((point - point.as_vec3().as_dvec3()).abs().max_element());
        }
        self
    }

    fn merge(self, other: PointBounds) -> PointBounds {
        PointBounds {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
            rounding: self.rounding.max(other.rounding),
        }
    }

    fn of<T: Copy + Sync>(points: &[T], double: impl Fn(T) -> DVec3 + Sync) -> PointBounds {
        // Minimum and maximum are exact, so the result does not depend on how the pieces are joined.
        points
            .par_chunks(PIECE)
            .map(|piece| {
                piece.iter().fold(PointBounds::EMPTY, |bounds, &point| {
                    bounds.with(double(point))
                })
            })
            .reduce(|| PointBounds::EMPTY, PointBounds::merge)
    }

    /// The power of two that brings the extent to about 1, as an exponent; 0 when it is within what squares of single
    /// precision hold, with room for products of a few of them.
    fn exponent(&self) -> i32 {
        let extent = (self.max - self.min).max_element();
        if !(extent > 0.0 && extent.is_finite()) || (SMALLEST..=LARGEST).contains(&extent) {
            return 0;
        }
        // The cast keeps the integer: exponents are within 2000.
        -(extent.log2().floor() as i32)
    }

    fn scaled(self, factor: f64) -> PointBounds {
        PointBounds {
            min: self.min * factor,
            max: self.max * factor,
            rounding: self.rounding * factor,
        }
    }

    /// Where a few vertices make the extent absurd, the bounds of the others; the few become not finite, `far` of them.
    fn without_strays(
        &self,
        coordinates: &mut FileCoordinates,
        far: &mut u64,
    ) -> Option<PointBounds> {
        if (self.max - self.min).max_element() <= LARGEST {
            return None;
        }
        let step = (coordinates.len() / 4096).max(1);
        let mut sample: Vec<DVec3> = (0..coordinates.len())
            .step_by(step)
            .map(|index| coordinates.at(index))
            .filter(|point| point.is_finite())
            .collect();
        let rank = sample.len() / 20;
        if rank == 0 {
            return None;
        }
        let (mut low, mut high) = (DVec3::ZERO, DVec3::ZERO);
        for axis in 0..3 {
            sample.sort_unstable_by(|a, b| a[axis].total_cmp(&b[axis]));
            low[axis] = sample[rank][axis];
            high[axis] = sample[sample.len() - 1 - rank][axis];
        }
        let size = (high - low).length();
        let middle = 0.5 * (low + high);
        if !(size > 0.0 && size * ABSURD < (self.max - self.min).max_element()) {
            return None;
        }
        let is_far = |point: DVec3| point.distance(middle) > 0.5 * ABSURD * size;
        let mut near = PointBounds::EMPTY;
        for index in 0..coordinates.len() {
            let point = coordinates.at(index);
            if point.is_finite() && is_far(point) {
                *far += 1;
                coordinates.forget(index);
            } else {
                near = near.with(point);
            }
        }
        Some(near)
    }

    /// Where the model-space zero should lie.
    fn origin(&self) -> DVec3 {
        mesh::origin_of(self.min, self.max, self.rounding)
    }
}

/// Makes the mesh: cuts its faces into triangles, chooses the origin, drops what is not finite, normalizes the normals.
pub(super) fn finish(job: &mut ReadJob<'_>, mut raw: RawMesh) -> Result<Mesh, Error> {
    let vertices = raw.coordinates.len() as u64;
    if vertices == 0 {
        return Err(job.empty("the file has no vertices"));
    }
    job.check_vertices(vertices)?;
    debug_assert!(raw.normals.is_empty() || raw.normals.len() as u64 == vertices);
    debug_assert!(raw.colors.is_empty() || raw.colors.len() as u64 == vertices);

    if let Some(textures) = &mut raw.textures {
        textures.resize(raw.triangles.len());
    }
    let before = raw.textures.as_ref().map(|_| raw.triangles.clone());
    let triangles = &mut raw.triangles;
    match &raw.coordinates {
        FileCoordinates::Single(points) => raw
            .polygons
            .cut(job, triangles, |corner| points[corner as usize].as_dvec3()),
        FileCoordinates::Double(points) => raw
            .polygons
            .cut(job, triangles, |corner| points[corner as usize]),
        FileCoordinates::Steps(grid) => raw.polygons.cut(job, triangles, |corner| {
            grid.place(grid.steps[corner as usize])
        }),
    }?;
    if let (Some(textures), Some(before)) = (&mut raw.textures, before) {
        textures.follow(&before, &raw.triangles, raw.polygons.faces());
    }

    let bounds = match &raw.coordinates {
        FileCoordinates::Single(positions) => PointBounds::of(positions, |point| point.as_dvec3()),
        FileCoordinates::Double(positions) => PointBounds::of(positions, |point| point),
        FileCoordinates::Steps(grid) => PointBounds::of(&grid.steps, |steps| grid.place(steps)),
    };
    let mut far = 0;
    let bounds = match bounds.without_strays(&mut raw.coordinates, &mut far) {
        Some(near) => {
            job.warn_count(far, |vertices| ReadWarning::FarOffDropped { vertices });
            near
        }
        None => bounds,
    };
    let exponent = bounds.exponent();
    if exponent != 0 {
        raw.coordinates.scale(f64::from(exponent).exp2());
        let factor = f64::from(exponent).exp2();
        job.scanners.transform(|place| place * factor);
        job.warn(ReadWarning::Scaled { exponent });
    }
    let bounds = bounds.scaled(f64::from(exponent).exp2());
    let origin = bounds.origin();
    job.attributes.grid = raw.coordinates.grid();
    let positions = match raw.coordinates {
        FileCoordinates::Single(mut positions) => {
            if origin != DVec3::ZERO {
                positions
                    .par_iter_mut()
                    .for_each(|point| *point = (point.as_dvec3() - origin).as_vec3());
            }
            positions
        }
        FileCoordinates::Double(positions) => positions
            .par_iter()
            .with_min_len(PIECE)
            .map(|&point| (point - origin).as_vec3())
            .collect(),
        FileCoordinates::Steps(grid) => grid
            .steps
            .par_iter()
            .with_min_len(PIECE)
            .map(|&steps| (grid.place(steps) - origin).as_vec3())
            .collect(),
    };
    if origin != DVec3::ZERO {
        job.warn(ReadWarning::OriginMoved { origin });
    }

    let mut mesh = Mesh {
        positions,
        normals: raw.normals,
        colors: raw.colors,
        triangles: raw.triangles,
        origin,
        textures: None,
        scanners: std::mem::take(&mut job.scanners),
    };
    let before = mesh.triangles.len();
    let dropped = drop_not_finite(&mut mesh, &mut job.attributes, &mut raw.textures);
    if dropped == vertices {
        return Err(Error::NotFinite {
            path: job.path.to_owned(),
            vertices,
        });
    }
    let triangles = (before - mesh.triangles.len()) as u64;
    job.warn_count(dropped.saturating_sub(far), |vertices| {
        ReadWarning::NotFiniteDropped {
            vertices,
            triangles,
        }
    });

    let unknown = normalize(&mut mesh.normals);
    if unknown == mesh.normals.len() as u64 {
        // Not one usable normal: the same as none, so that they are computed.
        mesh.normals = Vec::new();
    }
    job.warn_count(unknown.saturating_sub(raw.absent_normals), |count| {
        ReadWarning::NormalsUnknown { count }
    });
    if let Some(textures) = raw.textures {
        textures.join(job, &mut mesh)?;
    }
    Ok(mesh)
}

/// Removes vertices that are not finite, and the triangles that name them; returns how many vertices.
fn drop_not_finite(
    mesh: &mut Mesh,
    attributes: &mut PointAttributes,
    textures: &mut Option<RawTextures>,
) -> u64 {
    if mesh
        .positions
        .par_iter()
        .with_min_len(PIECE)
        .all(|point| point.is_finite())
    {
        return 0;
    }
    const GONE: u32 = u32::MAX;
    let mut next = 0;
    let new_index: Vec<u32> = mesh
        .positions
        .iter()
        .map(|point| {
            if !point.is_finite() {
                return GONE;
            }
            next += 1;
            next - 1
        })
        .collect();
    let keep = |index: usize| new_index[index] != GONE;
    retain_indexed(&mut mesh.positions, keep);
    retain_indexed(&mut mesh.normals, keep);
    retain_indexed(&mut mesh.colors, keep);
    mesh.scanners.retain(keep);
    for column in &mut attributes.columns {
        column.values.retain(keep);
    }
    if let Some(textures) = textures {
        let is_kept = |corner: &u32| keep(*corner as usize);
        textures.retain(|index| mesh.triangles[index].iter().all(is_kept));
    }
    mesh.triangles.retain_mut(|triangle| {
        *triangle = triangle.map(|corner| new_index[corner as usize]);
        !triangle.contains(&GONE)
    });
    (new_index.len() - mesh.positions.len()) as u64
}

fn retain_indexed<T>(items: &mut Vec<T>, keep: impl Fn(usize) -> bool) {
    let mut index = 0;
    items.retain(|_| {
        index += 1;
        keep(index - 1)
    });
}

/// Makes every normal a unit vector, or zero when it has no direction; returns how many are zero.
pub(super) fn normalize(normals: &mut [Vec3]) -> u64 {
    let one = |normal: &mut Vec3| -> u64 {
        // Unit to rounding already: keep the bits of the file.
        if (normal.length_squared() - 1.0).abs() < 1e-6 {
            return 0;
        }
        // Double precision: the square of a small or large single would under- or overflow.
        *normal = normal
            .as_dvec3()
            .try_normalize()
            .map_or(Vec3::ZERO, |unit| unit.as_vec3());
        u64::from(*normal == Vec3::ZERO)
    };
    normals
        .par_chunks_mut(PIECE)
        .map(|piece| piece.iter_mut().map(one).sum::<u64>())
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bounds(points: &[DVec3]) -> PointBounds {
        PointBounds::of(points, |point| point)
    }

    #[test]
    fn origin_stays_zero_for_ordinary_models() {
        assert_eq!(bounds(&[DVec3::ZERO, DVec3::ONE]).origin(), DVec3::ZERO);
        assert_eq!(
            bounds(&[DVec3::splat(500.0), DVec3::splat(501.0)]).origin(),
            DVec3::ZERO
        );
        assert_eq!(
            bounds(&[DVec3::splat(5e6)]).origin(),
            DVec3::ZERO,
            "one point has no detail to lose"
        );
        assert_eq!(bounds(&[DVec3::NAN]).origin(), DVec3::ZERO);
        assert_eq!(bounds(&[]).origin(), DVec3::ZERO);
    }

    #[test]
    fn origin_moves_for_large_or_finely_placed_coordinates() {
        let far = bounds(&[
            DVec3::new(4e5, 6e6, 100.0),
            DVec3::new(4e5 + 11.0, 6e6 + 7.0, 102.0),
        ]);
        assert_eq!(far.origin(), DVec3::new(400_006.0, 6_000_004.0, 101.0));
        // 100.1 is no single-precision number: its rounding is over a millionth of the extent.
        let fine = bounds(&[DVec3::splat(100.1), DVec3::splat(101.1)]);
        assert_eq!(fine.origin(), DVec3::splat(101.0));
        let small = bounds(&[DVec3::splat(1.0), DVec3::splat(1.0 + 1e-5)]);
        assert!((small.origin() - DVec3::splat(1.0)).abs().max_element() < 2e-5);
    }

    #[test]
    fn absurd_values_do_not_move_the_origin() {
        let origin = bounds(&[
            DVec3::splat(1e300),
            DVec3::ZERO,
            DVec3::ONE,
            DVec3::splat(f64::INFINITY),
        ])
        .origin();
        assert_eq!(origin, DVec3::ZERO);
    }

    #[test]
    fn normals_become_unit_or_zero() {
        let mut normals = [
            Vec3::X,
            Vec3::new(0.0, 3.0, 4.0),
            Vec3::splat(1e-30),
            Vec3::splat(1e30),
            Vec3::ZERO,
            Vec3::NAN,
        ];
        assert_eq!(normalize(&mut normals), 2);
        assert_eq!(normals[1], Vec3::new(0.0, 0.6, 0.8));
        assert!(
            normals[..4]
                .iter()
                .all(|normal| (normal.length() - 1.0).abs() < 1e-6)
        );
        assert_eq!(normals[4..], [Vec3::ZERO; 2]);
        assert_eq!(normalize(&mut [Vec3::INFINITY]), 1);
    }
}
