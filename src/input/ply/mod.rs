//! PLY, the Stanford polygon format (G. Turk, "The PLY Polygon File Format", 1994): text and both binary orders,
//! any extra elements and properties.
//!
//! Known are element `vertex` (x y z, nx ny nz, and colors under many names, packed or as the spherical harmonics of
//! Gaussian splats; other numbers are attributes), element `face` with the list `vertex_indices` or `vertex_index` (of polygons) and colors, and
//! `tristrips` (-1 ends a strip, every other triangle is turned). All else is skipped, and said. Rows of a fixed size,
//! which are nearly all, are read in parallel.

mod attributes;
mod columns;
mod fixed;
mod header;
mod numbers;
mod rows;
mod stream;
mod texture;

pub(super) use stream::open_stream;

use glam::{DVec2, DVec3, Vec2, Vec3};

use self::columns::ElementRole;
use self::header::{PlyElement, PlyEncoding, PlyHeader};
use self::rows::{AsciiBody, BinaryBody, NumberSource};
use self::texture::FacePlaces;
use super::assemble::{FileCoordinates, RawMesh};
use super::color::{ColorRange, ColorSink};
use super::job::ReadJob;
use super::part::PartFate;
use super::polygon::FaceList;
use super::{Error, FileCounts, FilePlace, Format, ReadWarning};
use crate::mesh::attributes::AttributeColumn;

/// What has been read so far.
#[derive(Debug)]
struct ReadParts {
    coordinates: FileCoordinates,
    normals: Vec<Vec3>,
    colors: ColorSink,
    /// A color is not opaque.
    is_transparent: bool,
    /// Colors of the triangles, up to the last that has one.
    face_colors: ColorSink,
    list: FaceList,
    /// Texture coordinates of vertices, from the lower left.
    places: Vec<Vec2>,
    face_places: FacePlaces,
    /// Numbers of vertices that are read as nothing else.
    attributes: Vec<AttributeColumn>,
    /// Vertices by the header, for index checks: faces may come before the vertices.
    vertices: u64,
}

/// Reads a PLY file.
pub(super) fn read(job: &mut ReadJob<'_>, data: &[u8]) -> Result<(Format, RawMesh), Error> {
    let header = PlyHeader::parse(job, data)?;
    let format = match header.encoding {
        PlyEncoding::Ascii => Format::PlyAscii,
        PlyEncoding::LittleEndian => Format::PlyBinaryLittleEndian,
        PlyEncoding::BigEndian => Format::PlyBinaryBigEndian,
    };
    job.check_vertices(header.vertices)?;
    if header.vertices == 0 {
        return Err(job.empty("the file has no vertices"));
    }
    let mut sink = ReadParts {
        coordinates: FileCoordinates::Double(Vec::new()),
        normals: Vec::new(),
        colors: ColorSink::new([ColorRange::BYTE; 3]),
        is_transparent: false,
        face_colors: ColorSink::new([ColorRange::BYTE; 3]),
        list: FaceList::default(),
        places: Vec::new(),
        face_places: FacePlaces::default(),
        attributes: Vec::new(),
        vertices: header.vertices,
    };
    // What follows the last known element is of no use; it may be anything.
    let wanted = header
        .elements
        .iter()
        .rposition(|element| element.role != ElementRole::Other)
        .map_or(0, |last| last + 1);
    let elements = &header.elements[..wanted];
    let end = match header.encoding {
        PlyEncoding::Ascii => read_elements(
            job,
            &mut AsciiBody::new(data, header.end),
            elements,
            &mut sink,
        )?,
        PlyEncoding::LittleEndian => read_elements(
            job,
            &mut BinaryBody::<false>::new(data, header.end),
            elements,
            &mut sink,
        )?,
        PlyEncoding::BigEndian => read_elements(
            job,
            &mut BinaryBody::<true>::new(data, header.end),
            elements,
            &mut sink,
        )?,
    };
    let rest = data[end..].trim_ascii_end().len() as u64;
    if wanted == header.elements.len() {
        job.warn_count(rest, |bytes| ReadWarning::TrailingBytes { bytes });
    }
    sink.list.warn(job);
    sink.remark(job, &header);
    let counts = FileCounts {
        vertices: header.vertices,
        faces: sink.list.faces,
    };
    let mut raw = RawMesh {
        coordinates: sink.coordinates,
        normals: sink.normals,
        absent_normals: 0,
        colors: sink.colors.colors,
        triangles: sink.list.triangles,
        polygons: sink.list.polygons,
        counts,
        textures: None,
    };
    raw.textures = texture::textures_of(job, &header, (sink.places, sink.face_places), &raw);
    if !sink.face_colors.colors.is_empty() {
        let mut colors = sink.face_colors.colors;
        colors.resize(raw.triangles.len(), [255; 4]);
        raw.color_faces(&colors);
    }
    attributes::keep(job, sink.attributes, raw.coordinates.len());
    Ok((format, raw))
}

fn read_elements<S: NumberSource>(
    job: &mut ReadJob<'_>,
    source: &mut S,
    elements: &[PlyElement],
    sink: &mut ReadParts,
) -> Result<usize, Error> {
    for element in elements {
        check_size(job, source, element)?;
        let done = source.read_fixed(job, element, sink)?;
        if !done {
            rows::read(job, source, element, sink)?;
        }
        job.report(source.at())?;
    }
    Ok(source.at())
}

/// Refuses an element whose shortest possible rows do not fit in what is left of the file, so that a header that
/// lies cannot ask for memory.
fn check_size<S: NumberSource>(
    job: &ReadJob<'_>,
    source: &S,
    element: &PlyElement,
) -> Result<(), Error> {
    let needed = u128::from(element.count) * u128::from(source.smallest_row(element));
    // The last word of a text needs no space after it.
    let left = source.remaining() as u128 + 1;
    if needed <= left {
        return Ok(());
    }
    Err(job.truncated(
        source.place(source.at()),
        format!(
            "{} {} rows need at least {needed} bytes, {} are left",
            element.count,
            element.name,
            source.remaining()
        ),
    ))
}

impl ReadParts {
    /// Makes room for the vertices; the count has been checked against the bytes left.
    fn reserve_vertices(&mut self, count: usize, has_normals: bool, has_colors: bool) {
        self.coordinates = FileCoordinates::Double(Vec::with_capacity(count));
        self.normals = Vec::with_capacity(if has_normals { count } else { 0 });
        self.colors
            .colors
            .reserve_exact(if has_colors { count } else { 0 });
    }

    fn push_place(&mut self, place: DVec2) {
        self.places.push(place.as_vec2());
    }

    fn push_position(&mut self, position: DVec3) {
        if let FileCoordinates::Double(positions) = &mut self.coordinates {
            positions.push(position);
        }
    }
}

impl ReadParts {
    /// Says what the colors were read as.
    fn remark(&self, job: &mut ReadJob<'_>, header: &PlyHeader) {
        let remarks = [&self.colors, &self.face_colors].map(ColorSink::remark);
        job.warnings.extend(remarks.into_iter().flatten());
        for element in &header.elements {
            let ElementRole::Vertices(columns) = element.role else {
                continue;
            };
            if columns.are_splats {
                let count = element.count;
                job.warn(ReadWarning::GaussianSplats { count });
            }
            if let Some(alpha) = columns::alpha_of(&columns) {
                let part = format!("property {} of {}", element.names[alpha], element.name);
                let (fate, note) = if self.is_transparent {
                    job.inventory
                        .leave_out(format!("{} of {}", element.names[alpha], element.name));
                    (PartFate::LeftOut, "drawn opaque")
                } else {
                    (PartFate::Unneeded, "opaque everywhere")
                };
                job.inventory.add(part, element.count, fate, note);
            }
        }
    }
}

/// The error for an index that is no vertex.
fn index_error(job: &ReadJob<'_>, place: FilePlace, index: f64, vertices: u64) -> Error {
    // The cast saturates; it only serves the message.
    job.index(place, "vertex", index as i64, vertices, 0)
}
