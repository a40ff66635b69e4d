//! Binary PLY rows of a fixed size, in parallel: vertices without lists, and faces that are all triangles.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::super::Error;
use super::super::assemble::FileCoordinates;
use super::super::color::{ColorRange, ColorSink, unite};
use super::super::job::ReadJob;
use super::attributes::number_of;
use super::columns::{ColorColumns, ElementRole, KeptColumn, VertexColumns, attributes_of};
use super::header::{PlyElement, PlyProperty, ScalarType};
use super::numbers::{decode, is_opaque, of_harmonics, packed_bits, unpacked};
use super::{ReadParts, attributes};
use crate::mesh::attributes::{AttributeNumber, AttributeValues, NumberType};

/// Rows per parallel piece, about a megabyte; progress and cancelling go by pieces.
const PIECE: usize = 1 << 16;

/// Reads an element whose rows have one size from the start of `data`, which is as long as `check_size` wants.
/// Returns the bytes read, or `None` when the rows differ or anything is wrong with them: the general way then finds
/// the place.
pub(super) fn read<const BIG: bool>(
    job: &ReadJob<'_>,
    data: &[u8],
    element: &PlyElement,
    sink: &mut ReadParts,
) -> Result<Option<usize>, Error> {
    let count = element.count as usize;
    match (element.role, element.stride()) {
        (ElementRole::Vertices(columns), Some(stride)) => {
            // `check_size` allows a byte too many for the sake of text.
            let Some(data) = data.get(..count * stride) else {
                return Ok(None);
            };
            read_vertices::<BIG>(data, stride, element, &columns, sink);
            for column in attributes_of(element) {
                let at = offset_of(element, column.property);
                let values = attribute::<BIG>(data, stride, at, column.kind);
                (sink.attributes).push(attributes::column(element, column, values));
            }
            if job.progress.is_cancelled() {
                Err(Error::Cancelled)
            } else {
                Ok(Some(data.len()))
            }
        }
        (ElementRole::Other, Some(stride)) => {
            let bytes = (element.count as u128 * stride as u128).min(usize::MAX as u128) as usize;
            Ok(data.get(..bytes).map(<[u8]>::len))
        }
        (ElementRole::Faces(columns), _) => {
            let Some(layout) = TriangleLayout::of(element, columns.corners) else {
                return Ok(None);
            };
            if columns.texture.is_some() {
                return Ok(None);
            }
            let Some(data) = count
                .checked_mul(layout.stride)
                .and_then(|bytes| data.get(..bytes))
            else {
                return Ok(None);
            };
            let Some(triangles) = read_triangles::<BIG>(job, data, count, layout, sink.vertices)
            else {
                return if job.progress.is_cancelled() {
                    Err(Error::Cancelled)
                } else {
                    Ok(None)
                };
            };
            if sink.list.triangles.is_empty() {
                sink.list.triangles = triangles;
            } else {
                sink.list.triangles.extend(triangles);
            }
            sink.list.faces += element.count;
            if let Some(color) = columns.color {
                let offsets =
                    color.map(|column| (offset_of(element, column.property), column.kind));
                sink.face_colors = colors::<BIG>(data, layout.stride, offsets, None).0;
            }
            Ok(Some(data.len()))
        }
        _ => Ok(None),
    }
}

/// Reads whole rows of vertices.
pub(super) fn read_vertices<const BIG: bool>(
    data: &[u8],
    stride: usize,
    element: &PlyElement,
    columns: &VertexColumns,
    sink: &mut ReadParts,
) {
    let offset = |column: KeptColumn| (offset_of(element, column.property), column.kind);
    let offsets = |columns: [KeptColumn; 3]| columns.map(offset);
    let single = |columns: [(usize, ScalarType); 3]| {
        columns.iter().all(|&(_, kind)| kind == ScalarType::F32)
    };

    let position = offsets(columns.position);
    sink.coordinates = if single(position) {
        FileCoordinates::Single(rows(data, stride, |row| three_single::<BIG>(row, position)))
    } else {
        FileCoordinates::Double(rows(data, stride, |row| three_double::<BIG>(row, position)))
    };
    if let Some(normal) = columns.normal.map(offsets) {
        sink.normals = if single(normal) {
            rows(data, stride, |row| three_single::<BIG>(row, normal))
        } else {
            rows(data, stride, |row| {
                three_double::<BIG>(row, normal).as_vec3()
            })
        };
    }
    if let Some([u, v]) = columns.place.map(|place| place.map(offset)) {
        let number =
            |row: &[u8], (at, kind): (usize, ScalarType)| decode::<BIG>(&row[at..], kind) as f32;
        sink.places = rows(data, stride, |row| {
            Vec2::new(number(row, u), number(row, v))
        });
    }
    match columns.color {
        Some(ColorColumns::Channels { rgb, alpha }) => {
            let read = colors::<BIG>(data, stride, offsets(rgb), alpha.map(offset));
            (sink.colors, sink.is_transparent) = read;
        }
        Some(ColorColumns::Packed(column)) => {
            let (at, kind) = offset(column);
            sink.colors.colors = rows(data, stride, |row| {
                unpacked(packed_bits::<BIG>(&row[at..], kind))
            });
        }
        Some(ColorColumns::Harmonics(columns)) => {
            let columns = offsets(columns);
            sink.colors.colors = rows(data, stride, |row| {
                of_harmonics(columns.map(|(at, kind)| decode::<BIG>(&row[at..], kind)))
            });
        }
        // Rows with lists have no fixed size.
        Some(ColorColumns::Listed(_)) | None => {}
    }
}

/// The numbers of a property of all rows.
fn attribute<const BIG: bool>(
    data: &[u8],
    stride: usize,
    at: usize,
    kind: ScalarType,
) -> AttributeValues {
    fn of<const BIG: bool, T: AttributeNumber + Default + Send>(
        data: &[u8],
        stride: usize,
        at: usize,
        kind: ScalarType,
    ) -> AttributeValues {
        let value = |row: &[u8]| T::of_double(decode::<BIG>(&row[at..], kind));
        T::column(rows(data, stride, value))
    }
    match number_of(kind) {
        NumberType::U8 => of::<BIG, u8>(data, stride, at, kind),
        NumberType::I8 => of::<BIG, i8>(data, stride, at, kind),
        NumberType::U16 => of::<BIG, u16>(data, stride, at, kind),
        NumberType::I16 => of::<BIG, i16>(data, stride, at, kind),
        NumberType::U32 => of::<BIG, u32>(data, stride, at, kind),
        NumberType::I32 => of::<BIG, i32>(data, stride, at, kind),
        NumberType::F32 => of::<BIG, f32>(data, stride, at, kind),
        NumberType::F64 => of::<BIG, f64>(data, stride, at, kind),
    }
}

/// Offset of a property in a row whose lists have three items.
fn offset_of(element: &PlyElement, property: usize) -> usize {
    let size = |property: &PlyProperty| match property {
        PlyProperty::Scalar(kind) => kind.size(),
        PlyProperty::List { count, item } => count.size() + 3 * item.size(),
    };
    element.properties[..property].iter().map(size).sum()
}

/// The colors of all rows, and whether an alpha is not opaque. Two passes where the range has to be found: most files
/// have bytes.
fn colors<const BIG: bool>(
    data: &[u8],
    stride: usize,
    columns: [(usize, ScalarType); 3],
    alpha: Option<(usize, ScalarType)>,
) -> (ColorSink, bool) {
    let mut sink = ColorSink::new(columns.map(|(_, kind)| kind.color_range()));
    let before = sink.ranges;
    let value = |row: &[u8], (at, kind): (usize, ScalarType)| {
        kind.color_value(decode::<BIG>(&row[at..], kind))
    };
    if before != [ColorRange::BYTE; 3] {
        for (range, &column) in sink.ranges.iter_mut().zip(&columns) {
            let seen = data
                .par_chunks(PIECE * stride)
                .map(|piece| {
                    let mut seen = ChannelRange::default();
                    let rows = piece.chunks_exact(stride);
                    rows.for_each(|row| seen.add(value(row, column)));
                    seen
                })
                .reduce(ChannelRange::default, ChannelRange::join);
            range.see_all(seen.largest, seen.has_fraction);
        }
        unite(&mut sink.ranges, before);
    }
    let ranges = sink.ranges;
    let is_transparent = AtomicBool::new(false);
    sink.colors = rows(data, stride, |row| {
        if let Some(alpha) = alpha
            && !is_opaque(value(row, alpha))
            && !is_transparent.load(Relaxed)
        {
            is_transparent.store(true, Relaxed);
        }
        let [r, g, b] = [0, 1, 2].map(|channel: usize| match columns[channel] {
            (at, ScalarType::U8) => row[at],
            column => ranges[channel].byte(value(row, column)),
        });
        [r, g, b, 255]
    });
    (sink, is_transparent.into_inner())
}

/// What the values of a channel say about its range.
#[derive(Debug, Clone, Copy, Default)]
struct ChannelRange {
    /// The largest that is finite, at least 0.
    largest: f64,
    has_fraction: bool,
}

impl ChannelRange {
    #[inline]
    fn add(&mut self, value: f64) {
        if value > self.largest && value.is_finite() {
            self.largest = value;
        }
        self.has_fraction |= value > 0.0 && value < 1.0;
    }

    fn join(self, other: Self) -> Self {
        Self {
            largest: self.largest.max(other.largest),
            has_fraction: self.has_fraction || other.has_fraction,
        }
    }
}

/// One item per row of `stride` bytes.
fn rows<T: Copy + Default + Send>(
    data: &[u8],
    stride: usize,
    item: impl Fn(&[u8]) -> T + Sync,
) -> Vec<T> {
    let mut out = vec![T::default(); data.len() / stride];
    out.par_chunks_mut(PIECE)
        .zip(data.par_chunks(PIECE * stride))
        .for_each(|(out, data)| {
            for (out, row) in out.iter_mut().zip(data.chunks_exact(stride)) {
                *out = item(row);
            }
        });
    out
}

#[inline]
fn three_single<const BIG: bool>(row: &[u8], columns: [(usize, ScalarType); 3]) -> Vec3 {
    Vec3::from_array(columns.map(|(offset, _)| {
        let bytes = [
            row[offset],
            row[offset + 1],
            row[offset + 2],
            row[offset + 3],
        ];
        if BIG {
            f32::from_be_bytes(bytes)
        } else {
            f32::from_le_bytes(bytes)
        }
    }))
}

#[inline]
fn three_double<const BIG: bool>(row: &[u8], columns: [(usize, ScalarType); 3]) -> DVec3 {
    DVec3::from_array(columns.map(|(offset, kind)| decode::<BIG>(&row[offset..], kind)))
}

/// Where the corners are in rows that are all triangles.
#[derive(Debug, Clone, Copy)]
struct TriangleLayout {
    stride: usize,
    count: usize,
    count_type: ScalarType,
    corners: usize,
    index_type: ScalarType,
}

impl TriangleLayout {
    /// `None` when another list could change the size of a row, or the types are rare.
    fn of(element: &PlyElement, list: usize) -> Option<Self> {
        let (mut stride, mut found) = (0, None);
        for (index, property) in element.properties.iter().enumerate() {
            match *property {
                PlyProperty::Scalar(kind) => stride += kind.size(),
                PlyProperty::List { count, item }
                    if index == list && !item.is_float() && item.size() <= 4 =>
                {
                    found = Some((stride, count, stride + count.size(), item));
                    stride += count.size() + 3 * item.size();
                }
                PlyProperty::List { .. } => return None,
            }
        }
        let (count, count_type, corners, index_type) = found?;
        Some(Self {
            stride,
            count,
            count_type,
            corners,
            index_type,
        })
    }
}

/// Bytes of a row of a triangle; `None` where rows are read the general way.
pub(super) fn triangle_stride(element: &PlyElement, list: usize) -> Option<usize> {
    TriangleLayout::of(element, list).map(|layout| layout.stride)
}

fn read_triangles<const BIG: bool>(
    job: &ReadJob<'_>,
    data: &[u8],
    count: usize,
    layout: TriangleLayout,
    vertices: u64,
) -> Option<Vec<[u32; 3]>> {
    let mut triangles = vec![[0; 3]; count];
    let common = layout.count_type.size() == 1
        && matches!(layout.index_type, ScalarType::I32 | ScalarType::U32);
    triangles
        .par_chunks_mut(PIECE)
        .zip(data.par_chunks(PIECE * layout.stride))
        .try_for_each(|(out, data)| {
            if job.progress.is_cancelled() {
                return None;
            }
            let rows = out.iter_mut().zip(data.chunks_exact(layout.stride));
            let good = if common {
                common_rows::<BIG>(rows, layout, vertices)
            } else {
                rare_rows::<BIG>(rows, layout, vertices)
            };
            good.then_some(())
        })
        .is_some()
        .then_some(triangles)
}

/// A byte and three 32-bit indices: nearly every file. One verdict per piece keeps the loop free of branches. A
/// negative index is over 2^31 when read without sign; so are the last two thousand million indices of a file that
/// has over 2^31 vertices and means them, which only costs the general way when the type is signed.
fn common_rows<'a, const BIG: bool>(
    rows: impl Iterator<Item = (&'a mut [u32; 3], &'a [u8])>,
    layout: TriangleLayout,
    vertices: u64,
) -> bool {
    let largest = if layout.index_type == ScalarType::I32 {
        vertices.min(1 << 31)
    } else {
        vertices
    };
    let mut good = true;
    for (out, row) in rows {
        let Some(corners) = row[layout.corners..].first_chunk::<12>() else {
            return false;
        };
        *out = std::array::from_fn(|corner| {
            let bytes: [u8; 4] = std::array::from_fn(|byte| corners[4 * corner + byte]);
            if BIG {
                u32::from_be_bytes(bytes)
            } else {
                u32::from_le_bytes(bytes)
            }
        });
        let highest = out[0].max(out[1]).max(out[2]);
        good &= row[layout.count] == 3 && u64::from(highest) < largest;
    }
    good
}

fn rare_rows<'a, const BIG: bool>(
    rows: impl Iterator<Item = (&'a mut [u32; 3], &'a [u8])>,
    layout: TriangleLayout,
    vertices: u64,
) -> bool {
    for (out, row) in rows {
        if decode::<BIG>(&row[layout.count..], layout.count_type) != 3.0 {
            return false;
        }
        for (corner, out) in out.iter_mut().enumerate() {
            let offset = layout.corners + corner * layout.index_type.size();
            let value = decode::<BIG>(&row[offset..], layout.index_type);
            if !(value >= 0.0 && value < vertices as f64) {
                return false;
            }
            *out = value as u32;
        }
    }
    true
}
