//! Binary PLY piece by piece. Rows of vertices have one size; rows of faces are read one after the other.

use super::columns::{ColorColumns, ElementRole, VertexColumns, attributes_of};
use super::header::{PlyElement, PlyEncoding, PlyHeader, PlyProperty, ScalarType};
use super::numbers;
use super::rows::{self, BinaryBody, NumberSource};
use super::{ReadParts, fixed};
use crate::input::assemble::{FileCoordinates, normalize};
use crate::input::color::{ColorRange, ColorSink};
use crate::input::job::ReadJob;
use crate::input::part::grouped;
use crate::input::polygon::FaceList;
use crate::input::stream::{RowFile, StreamedModel, boxed};
use crate::input::{Error, Format, ReadOptions, ReadWarning};
use crate::mesh::stream::{MeshStream, PIECE, StreamError, StreamFacts, TakePiece, VertexPiece};
use crate::progress::SilentProgress;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes of rows of faces that are read at once.
const FACE_BYTES: u64 = 8 << 20;

/// Vertices between two wanted ones that are read along rather than skipped, and bytes that one range has at most.
const GAP_BYTES: u64 = 16 << 10;
const RANGE_BYTES: u64 = 8 << 20;

/// An open file, and where its rows are.
#[derive(Debug)]
struct PlyRows {
    file: RowFile,
    options: ReadOptions,
    vertex: PlyElement,
    columns: VertexColumns,
    /// Bytes of a vertex.
    stride: u64,
    /// Offset of the first vertex.
    vertices_at: u64,
    faces: Option<FaceRows>,
}

/// A file that is read piece by piece, most significant byte first when `BIG`.
#[derive(Debug)]
struct PlyStream<const BIG: bool> {
    rows: PlyRows,
    /// Faces that the last reading has left out, and those whose first corner it has found again at the end.
    left_out: AtomicU64,
    repeated: AtomicU64,
}

/// The rows of faces.
#[derive(Debug)]
struct FaceRows {
    element: PlyElement,
    /// Offset of the first.
    at: u64,
}

/// Opens a PLY file as a stream; `None` where it must be read whole.
///
/// # Errors
/// The header is damaged.
pub(in crate::input) fn open_stream(
    job: &mut ReadJob<'_>,
    file: RowFile,
    head: &[u8],
) -> Result<Option<StreamedModel>, Error> {
    let header = PlyHeader::parse(job, head)?;
    let Some(plan) = plan(&header) else {
        return Ok(None);
    };
    let (element, columns, vertices_at) = plan.vertices;
    job.check_vertices(header.vertices)?;
    let stride = element.stride().unwrap_or(0) as u64;
    let end = vertices_at.saturating_add(header.vertices.saturating_mul(stride));
    // The usual way says best what is wrong.
    if header.vertices == 0 || stride == 0 || end > file.length {
        return Ok(None);
    }
    let attributes = attributes_of(&element);
    if !attributes.is_empty() {
        let names = attributes
            .iter()
            .map(|column| &element.names[column.property][..]);
        let names = grouped(names).join(", ");
        let parts = vec![format!("{names} of {}", element.name)];
        job.warn(ReadWarning::LeftOut { parts });
    }
    let file_bytes = file.length;
    let rows = PlyRows {
        options: job.options.clone(),
        file,
        vertex: element,
        columns,
        stride,
        vertices_at,
        faces: plan.faces.map(|(element, at)| FaceRows { element, at }),
    };
    let is_big = header.encoding == PlyEncoding::BigEndian;
    let stream: Box<dyn MeshStream> = match is_big {
        true => Box::new(PlyStream::<true>::new(rows)),
        false => Box::new(PlyStream::<false>::new(rows)),
    };
    Ok(Some(StreamedModel {
        stream,
        format: match is_big {
            true => Format::PlyBinaryBigEndian,
            false => Format::PlyBinaryLittleEndian,
        },
        file_bytes,
        warnings: std::mem::take(&mut job.warnings),
    }))
}

/// Where the elements are that are read.
struct StreamPlan {
    vertices: (PlyElement, VertexColumns, u64),
    faces: Option<(PlyElement, u64)>,
}

/// Finds the elements; `None` where something must be read that is no piece of a stream.
fn plan(header: &PlyHeader) -> Option<StreamPlan> {
    if header.encoding == PlyEncoding::Ascii {
        return None;
    }
    let (mut at, mut vertices) = (header.end as u64, None);
    for element in &header.elements {
        match element.role {
            ElementRole::Vertices(columns) => {
                if !can_stream(&columns) {
                    return None;
                }
                vertices = Some((element.clone(), columns, at));
            }
            ElementRole::Faces(columns) => {
                let has_more = columns.color.is_some()
                    || columns.places.is_some()
                    || columns.texture.is_some();
                if has_more {
                    return None;
                }
                if element.count > 0 {
                    // Vertices must come first: the end of the faces is not known.
                    let faces = Some((element.clone(), at));
                    let vertices = vertices?;
                    return Some(StreamPlan { vertices, faces });
                }
            }
            ElementRole::Strips(_) => return None,
            ElementRole::Other => {}
        }
        if element.count > 0 {
            let Some(stride) = element.stride() else {
                // A list in what follows the vertices of a cloud is of no use.
                break;
            };
            at = at.checked_add(element.count.checked_mul(stride as u64)?)?;
        }
    }
    let after = header
        .elements
        .iter()
        .skip_while(|e| !matches!(e.role, ElementRole::Vertices(_)));
    let has_more = after
        .filter(|e| e.count > 0)
        .any(|e| matches!(e.role, ElementRole::Faces(_) | ElementRole::Strips(_)));
    if has_more {
        return None;
    }
    Some(StreamPlan {
        vertices: vertices?,
        faces: None,
    })
}

/// Tells whether vertices can be read in pieces: the range of their colors must not depend on values.
fn can_stream(columns: &VertexColumns) -> bool {
    let are_bytes = match columns.color {
        None | Some(ColorColumns::Packed(_)) => true,
        Some(ColorColumns::Channels { rgb, .. }) => rgb
            .iter()
            .all(|column| matches!(column.kind, ScalarType::U8 | ScalarType::I8)),
        Some(ColorColumns::Harmonics(_) | ColorColumns::Listed(_)) => false,
    };
    are_bytes && !columns.are_splats && columns.place.is_none()
}

impl<const BIG: bool> PlyStream<BIG> {
    fn new(rows: PlyRows) -> Self {
        Self {
            rows,
            left_out: AtomicU64::new(0),
            repeated: AtomicU64::new(0),
        }
    }

    fn sink(&self) -> ReadParts {
        ReadParts {
            coordinates: FileCoordinates::Double(Vec::new()),
            normals: Vec::new(),
            colors: ColorSink::new([ColorRange::BYTE; 3]),
            is_transparent: false,
            face_colors: ColorSink::new([ColorRange::BYTE; 3]),
            list: FaceList::default(),
            places: Vec::new(),
            face_places: super::FacePlaces::default(),
            attributes: Vec::new(),
            vertices: self.rows.vertex.count,
        }
    }

    /// The vertices in whole rows.
    fn piece(&self, rows: &[u8]) -> VertexPiece {
        let mut sink = self.sink();
        let stride = self.rows.stride as usize;
        fixed::read_vertices::<BIG>(
            rows,
            stride,
            &self.rows.vertex,
            &self.rows.columns,
            &mut sink,
        );
        normalize(&mut sink.normals);
        VertexPiece {
            positions: match sink.coordinates {
                FileCoordinates::Single(points) => {
                    points.par_iter().map(|p| p.as_dvec3()).collect()
                }
                FileCoordinates::Double(points) => points,
                FileCoordinates::Steps(_) => Vec::new(),
            },
            normals: sink.normals,
            colors: sink.colors.colors,
        }
    }

    /// The faces of a piece that are triangles all, or `None`.
    fn triangle_rows(
        &self,
        faces: &FaceRows,
        at: u64,
        count: u64,
        sink: &mut ReadParts,
    ) -> Result<Option<u64>, Error> {
        let ElementRole::Faces(columns) = faces.element.role else {
            return Ok(None);
        };
        let Some(stride) = fixed::triangle_stride(&faces.element, columns.corners) else {
            return Ok(None);
        };
        let bytes = count * stride as u64;
        if at + bytes > self.rows.file.length {
            return Ok(None);
        }
        let data = self.rows.file.read(at, bytes)?;
        let element = PlyElement {
            count,
            ..faces.element.clone()
        };
        let job = ReadJob::new(
            &self.rows.file.path,
            None,
            &self.rows.options,
            &SilentProgress,
        );
        let read = fixed::read::<BIG>(&job, &data, &element, sink)?;
        Ok(read.map(|read| at + read as u64))
    }

    /// Faces of any size, as many as lie in some bytes; the offset after them, and their number.
    fn any_rows(
        &self,
        faces: &FaceRows,
        at: u64,
        left: u64,
        sink: &mut ReadParts,
    ) -> Result<FaceProgress, Error> {
        let mut wanted = FACE_BYTES;
        loop {
            let length = wanted.min(self.rows.file.length.saturating_sub(at));
            let data = self.rows.file.read(at, length)?;
            let count = whole_rows::<BIG>(&data, &faces.element).min(left);
            let is_all = length < wanted;
            if count == 0 && !is_all {
                wanted *= 4;
                continue;
            }
            // What is cut short is read, too: the reader says where.
            let element = PlyElement {
                count: if is_all {
                    left.min(count.max(1))
                } else {
                    count
                },
                ..faces.element.clone()
            };
            let mut job = ReadJob::new(
                &self.rows.file.path,
                None,
                &self.rows.options,
                &SilentProgress,
            );
            let mut source = BinaryBody::<BIG>::new(&data, 0).behind(at);
            rows::read(&mut job, &mut source, &element, sink)?;
            let sink_list = std::mem::take(&mut sink.list);
            sink.list = self.cut(&mut job, sink_list)?;
            return Ok(FaceProgress {
                at: at + source.at() as u64,
                count: element.count,
            });
        }
    }

    /// Cuts the polygons of a piece.
    fn cut(&self, job: &mut ReadJob<'_>, mut list: FaceList) -> Result<FaceList, Error> {
        if list.polygons.faces().next().is_none() {
            return Ok(list);
        }
        let mut numbers: Vec<u32> = list.triangles.as_flattened().to_vec();
        numbers.par_sort_unstable();
        numbers.dedup();
        let places = self.positions_at(&numbers)?;
        let place = |corner: u32| places[numbers.partition_point(|&own| own < corner)];
        list.polygons.cut(job, &mut list.triangles, place)?;
        Ok(list)
    }

    fn positions_at(&self, numbers: &[u32]) -> Result<Vec<DVec3>, Error> {
        Ok(self.picked(numbers)?.positions)
    }

    fn picked(&self, numbers: &[u32]) -> Result<VertexPiece, Error> {
        let stride = self.rows.stride;
        let mut rows = Vec::with_capacity(numbers.len() * stride as usize);
        let mut rest = numbers;
        while let Some(&first) = rest.first() {
            // Ranges with small gaps are read at once.
            let start = u64::from(first) * stride;
            let ends = rest.windows(2).position(|pair| {
                let gap = u64::from(pair[1] - pair[0]) * stride;
                gap > GAP_BYTES || u64::from(pair[1]) * stride - start > RANGE_BYTES
            });
            let (own, later) = rest.split_at(ends.map_or(rest.len(), |end| end + 1));
            let last = u64::from(own[own.len() - 1]);
            let data = self
                .rows
                .file
                .read(self.rows.vertices_at + start, (last + 1) * stride - start)?;
            for &number in own {
                let at = (u64::from(number) * stride - start) as usize;
                rows.extend_from_slice(&data[at..at + stride as usize]);
            }
            rest = later;
        }
        Ok(self.piece(&rows))
    }
}

/// How far the faces are.
struct FaceProgress {
    at: u64,
    count: u64,
}

/// Number of whole rows at the beginning of some bytes.
fn whole_rows<const BIG: bool>(data: &[u8], element: &PlyElement) -> u64 {
    let (mut at, mut count) = (0usize, 0u64);
    loop {
        for property in &element.properties {
            match *property {
                PlyProperty::Scalar(kind) => at = at.saturating_add(kind.size()),
                PlyProperty::List { count, item } => {
                    let Some(bytes) = data.get(at..at.saturating_add(count.size())) else {
                        at = usize::MAX;
                        break;
                    };
                    // A length that is none is left to the reader. The cast saturates.
                    let length = numbers::decode::<BIG>(bytes, count).max(0.0) as usize;
                    at = at
                        .saturating_add(count.size())
                        .saturating_add(length.saturating_mul(item.size()));
                }
            }
        }
        if at > data.len() {
            return count;
        }
        count += 1;
    }
}

impl<const BIG: bool> MeshStream for PlyStream<BIG> {
    fn facts(&self) -> StreamFacts {
        StreamFacts {
            vertices: self.rows.vertex.count,
            faces: self
                .rows
                .faces
                .as_ref()
                .map_or(0, |faces| faces.element.count),
            has_normals: self.rows.columns.normal.is_some(),
            has_colors: self.rows.columns.color.is_some(),
        }
    }

    fn vertices(&self, take: &mut TakePiece<'_, VertexPiece>) -> Result<(), StreamError> {
        let count = self.rows.vertex.count;
        for first in (0..count).step_by(PIECE) {
            let rows = (count - first).min(PIECE as u64);
            let at = self.rows.vertices_at + first * self.rows.stride;
            let data = self
                .rows
                .file
                .read(at, rows * self.rows.stride)
                .map_err(boxed)?;
            take(&self.piece(&data))?;
        }
        Ok(())
    }

    fn vertices_at(&self, numbers: &[u32]) -> Result<VertexPiece, StreamError> {
        match numbers.last() {
            Some(&last) if u64::from(last) >= self.rows.vertex.count => {
                Err(format!("vertex {last} of {}", self.rows.vertex.count).into())
            }
            _ => self.picked(numbers).map_err(boxed),
        }
    }

    fn triangles(&self, take: &mut TakePiece<'_, [[u32; 3]]>) -> Result<(), StreamError> {
        let Some(faces) = &self.rows.faces else {
            return Ok(());
        };
        let (mut at, mut left) = (faces.at, faces.element.count);
        let mut are_triangles = true;
        self.left_out.store(0, Ordering::Relaxed);
        self.repeated.store(0, Ordering::Relaxed);
        while left > 0 {
            let mut sink = self.sink();
            let count = left.min(PIECE as u64);
            let end = match are_triangles {
                true => self
                    .triangle_rows(faces, at, count, &mut sink)
                    .map_err(boxed)?,
                false => None,
            };
            let progress = match end {
                Some(at) => FaceProgress { at, count },
                None => {
                    are_triangles = false;
                    sink = self.sink();
                    self.any_rows(faces, at, left, &mut sink).map_err(boxed)?
                }
            };
            self.left_out.fetch_add(sink.list.small, Ordering::Relaxed);
            self.repeated.fetch_add(sink.list.closed, Ordering::Relaxed);
            take(&sink.list.triangles)?;
            at = progress.at;
            left -= progress.count.min(left);
        }
        Ok(())
    }
    fn remarks(&self) -> Vec<String> {
        let small = self.left_out.load(Ordering::Relaxed);
        let repeated = self.repeated.load(Ordering::Relaxed);
        let warnings = [
            (small > 0).then_some(ReadWarning::FacesTooSmall { count: small }),
            (repeated > 0).then_some(ReadWarning::FirstCornerRepeated { count: repeated }),
        ];
        let warnings = warnings.into_iter().flatten();
        warnings.map(|warning| warning.to_string()).collect()
    }
}
