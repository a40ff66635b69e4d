//! Accessors: typed views of buffers, strided, normalised, sparse. Every number is held against the buffer first.

use super::super::job::ReadJob;
use super::super::{Error, FilePlace};
use super::document::{GltfAccessor, GltfBufferView, GltfDocument};

/// Type of a component.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ComponentType {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl ComponentType {
    fn of(code: u32) -> Option<Self> {
        match code {
            5120 => Some(Self::I8),
            5121 => Some(Self::U8),
            5122 => Some(Self::I16),
            5123 => Some(Self::U16),
            5125 => Some(Self::U32),
            5126 => Some(Self::F32),
            _ => None,
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The value at the start of `bytes`, which has at least the bytes of one; normalised to -1..1 or 0..1 if asked for.
    #[inline]
    fn value(self, bytes: &[u8], is_normalized: bool) -> f64 {
        let (value, largest) = match self {
            Self::I8 => (f64::from(bytes[0] as i8), 127.0),
            Self::U8 => (f64::from(bytes[0]), 255.0),
            Self::I16 => (f64::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
            Self::U16 => (f64::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
            Self::U32 => (f64::from(self.word(bytes)), 4_294_967_295.0),
            Self::F32 => (f64::from(f32::from_bits(self.word(bytes))), 1.0),
        };
        if is_normalized && self != Self::F32 {
            (value / largest).max(-1.0)
        } else {
            value
        }
    }

    #[inline]
    fn word(self, bytes: &[u8]) -> u32 {
        bytes
            .first_chunk()
            .map_or(0, |&word| u32::from_le_bytes(word))
    }

    /// The unsigned integer at the start of `bytes`.
    #[inline]
    fn index(self, bytes: &[u8]) -> u32 {
        match self {
            Self::U8 | Self::I8 => bytes[0].into(),
            Self::U16 | Self::I16 => u16::from_le_bytes([bytes[0], bytes[1]]).into(),
            Self::U32 | Self::F32 => self.word(bytes),
        }
    }
}

/// The buffers of a file and the description of their parts.
pub(super) struct GltfStore<'a> {
    pub(super) document: &'a GltfDocument,
    /// The bytes of each buffer, empty where nothing uses it.
    pub(super) buffers: Vec<std::borrow::Cow<'a, [u8]>>,
    /// Bytes of the file: what has no bytes of its own may not be larger than a few of it.
    pub(super) file_bytes: u64,
}

/// Rows of values.
struct AccessorRows<'a> {
    /// Empty where the accessor has no bytes: zeros.
    bytes: &'a [u8],
    stride: usize,
    count: usize,
    component: ComponentType,
}

impl<'a> AccessorRows<'a> {
    /// The bytes of a row, all its components.
    fn row(&self, index: usize) -> Option<&'a [u8]> {
        self.bytes.get(index * self.stride..)
    }
}

impl GltfStore<'_> {
    fn fault(&self, job: &ReadJob<'_>, accessor: usize, what: impl std::fmt::Display) -> Error {
        job.syntax(FilePlace::Byte(0), format!("accessor {accessor}: {what}"))
    }

    fn accessor(&self, job: &ReadJob<'_>, index: usize) -> Result<&GltfAccessor, Error> {
        let found = self.document.accessors.get(index);
        found.ok_or_else(|| self.fault(job, index, "does not exist"))
    }

    /// The bytes of a view.
    fn view(
        &self,
        job: &ReadJob<'_>,
        accessor: usize,
        index: usize,
    ) -> Result<(&[u8], &GltfBufferView), Error> {
        let Some(view) = self.document.buffer_views.get(index) else {
            return Err(self.fault(job, accessor, format!("buffer view {index} does not exist")));
        };
        let buffer = self.buffers.get(view.buffer).map_or(&[][..], |bytes| bytes);
        let bytes = usize::try_from(view.byte_offset).ok().and_then(|start| {
            let end = start.checked_add(usize::try_from(view.byte_length).ok()?)?;
            buffer.get(start..end)
        });
        match bytes {
            Some(bytes) => Ok((bytes, view)),
            None => Err(job.truncated(
                FilePlace::Byte(0),
                format!(
                    "buffer view {index} wants {} bytes at byte {} of buffer {}, which has {}",
                    view.byte_length,
                    view.byte_offset,
                    view.buffer,
                    buffer.len()
                ),
            )),
        }
    }

    /// Rows of `lanes` values at an offset of a view, held against its length.
    fn rows(
        &self,
        job: &ReadJob<'_>,
        accessor: usize,
        place: RowsPlace,
        lanes: usize,
    ) -> Result<AccessorRows<'_>, Error> {
        let RowsPlace {
            view,
            offset,
            count,
            code,
        } = place;
        let Some(component) = ComponentType::of(code) else {
            return Err(self.fault(job, accessor, format!("component type {code} is not known")));
        };
        let size = component.bytes() * lanes;
        let is_usable = |count: usize| {
            (count as u64).saturating_mul(size as u64)
                <= self.file_bytes.saturating_mul(4).saturating_add(16 << 20)
        };
        let too_many = || {
            self.fault(
                job,
                accessor,
                format!("{count} values are more than the file holds"),
            )
        };
        let count = usize::try_from(count)
            .ok()
            .filter(|&count| count > 0)
            .ok_or_else(too_many)?;
        let Some(view) = view else {
            return if is_usable(count) {
                Ok(AccessorRows {
                    bytes: &[],
                    stride: 0,
                    count,
                    component,
                })
            } else {
                Err(too_many())
            };
        };
        let (bytes, view) = self.view(job, accessor, view)?;
        let stride = match view.byte_stride {
            Some(stride) if stride > 0 => usize::try_from(stride).unwrap_or(usize::MAX),
            _ => size,
        };
        if stride < size {
            return Err(self.fault(
                job,
                accessor,
                format!("a stride of {stride} bytes for rows of {size}"),
            ));
        }
        let bytes = usize::try_from(offset)
            .ok()
            .and_then(|offset| bytes.get(offset..))
            .unwrap_or(&[]);
        let needed = (count - 1)
            .checked_mul(stride)
            .and_then(|sum| sum.checked_add(size));
        if needed.is_none_or(|needed| needed > bytes.len()) {
            return Err(self.fault(
                job,
                accessor,
                format!(
                    "{count} rows every {stride} bytes do not fit in {} bytes",
                    bytes.len()
                ),
            ));
        }
        Ok(AccessorRows {
            bytes,
            stride,
            count,
            component,
        })
    }

    /// The values of an accessor of `N` components; of one with fewer, `fill` for the missing. More are an error.
    pub(super) fn vectors<const N: usize>(
        &self,
        job: &ReadJob<'_>,
        index: usize,
        fill: f32,
    ) -> Result<Vec<[f32; N]>, Error> {
        let accessor = self.accessor(job, index)?;
        let lanes = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            other => {
                let other: String = other.chars().take(20).collect();
                return Err(self.fault(
                    job,
                    index,
                    format!("type `{other}` where a vector is wanted"),
                ));
            }
        };
        if lanes > N {
            return Err(self.fault(
                job,
                index,
                format!("{lanes} components where {N} are wanted"),
            ));
        }
        let place = RowsPlace {
            view: accessor.buffer_view,
            offset: accessor.byte_offset,
            count: accessor.count,
            code: accessor.component_type,
        };
        let rows = self.rows(job, index, place, lanes)?;
        let size = rows.component.bytes();
        let vector = |row: Option<&[u8]>| {
            let mut out = [fill; N];
            for (lane, out) in out[..lanes].iter_mut().enumerate() {
                let bytes = row.and_then(|row| row.get(lane * size..));
                // Doubles serve the normalisation only.
                *out = bytes.map_or(0.0, |bytes| {
                    rows.component.value(bytes, accessor.normalized)
                }) as f32;
            }
            out
        };
        let row = |at| {
            if rows.bytes.is_empty() {
                None
            } else {
                rows.row(at)
            }
        };
        let mut out: Vec<[f32; N]> = (0..rows.count).map(|at| vector(row(at))).collect();
        if let Some(sparse) = &accessor.sparse {
            let part = |part: &super::document::GltfSparsePart, code| RowsPlace {
                view: Some(part.buffer_view),
                offset: part.byte_offset,
                count: sparse.count,
                code,
            };
            let places = part(&sparse.indices, sparse.indices.component_type);
            let places = self.rows(job, index, places, 1)?;
            let values = part(&sparse.values, accessor.component_type);
            let values = self.rows(job, index, values, lanes)?;
            for at in 0..places.count {
                let place = places.row(at).map_or(0, |row| places.component.index(row));
                let count = out.len();
                let Some(out) = out.get_mut(place as usize) else {
                    let what = format!("sparse index {place} of {count}");
                    return Err(self.fault(job, index, what));
                };
                *out = vector(values.row(at));
            }
        }
        Ok(out)
    }

    /// The values of an accessor of indices.
    pub(super) fn indices(&self, job: &ReadJob<'_>, index: usize) -> Result<Vec<u32>, Error> {
        let accessor = self.accessor(job, index)?;
        if accessor.shape != "SCALAR" || accessor.sparse.is_some() {
            return Err(self.fault(job, index, "indices are no list of single numbers"));
        }
        let place = RowsPlace {
            view: accessor.buffer_view,
            offset: accessor.byte_offset,
            count: accessor.count,
            code: accessor.component_type,
        };
        let rows = self.rows(job, index, place, 1)?;
        let value = |at| rows.row(at).filter(|_| !rows.bytes.is_empty());
        let all = (0..rows.count).map(|at| value(at).map_or(0, |row| rows.component.index(row)));
        Ok(all.collect())
    }
}

/// Where rows are said to be.
#[derive(Debug, Clone, Copy)]
struct RowsPlace {
    view: Option<usize>,
    offset: u64,
    count: u64,
    code: u32,
}
