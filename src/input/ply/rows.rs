//! The general way through a PLY body, number by number: any types, any lists, text or binary.

use glam::{DVec2, DVec3, Vec3};

use super::super::color::ColorSink;
use super::super::job::{ReadJob, at_line};
use super::super::part::PartFault;
use super::super::text::{TextScanner, parse_f64};
use super::super::{Error, FilePlace};
use super::columns::{ColorColumns, ElementRole, FaceColumns, VertexColumns, attributes_of};
use super::header::{PlyElement, PlyProperty, ScalarType};
use super::numbers::{decode, is_opaque, of_harmonics, packed_bits, unpacked};
use super::{ReadParts, attributes, fixed, index_error};
use crate::mesh::attributes::AttributeValues;

/// Gives the numbers of a body in order. All types fit a double but 64-bit integers, which no index reaches.
pub(super) trait NumberSource {
    /// The next number.
    fn number(&mut self, job: &ReadJob<'_>, kind: ScalarType) -> Result<f64, Error>;
    /// The next number, where no shape depends on it: what is no number is 0, with a note of the fault.
    fn dispensable(
        &mut self,
        job: &mut ReadJob<'_>,
        kind: ScalarType,
        fault: PartFault,
    ) -> Result<f64, Error>;
    /// The next number of four bytes as bits that hold a packed color.
    fn packed(&mut self, job: &mut ReadJob<'_>, kind: ScalarType) -> Result<u32, Error>;
    /// Offset of the next byte.
    fn at(&self) -> usize;
    /// Bytes left.
    fn remaining(&self) -> usize;
    /// The place of an offset in the words of this encoding.
    fn place(&self, at: usize) -> FilePlace;
    /// Least number of bytes that one number takes.
    fn smallest_number(&self, kind: ScalarType) -> usize;
    /// Reads an element the fast way when its rows allow it; false, having moved nothing, when they do not.
    fn read_fixed(
        &mut self,
        job: &ReadJob<'_>,
        element: &PlyElement,
        sink: &mut ReadParts,
    ) -> Result<bool, Error>;

    /// Least number of bytes that a row takes: its lists are empty.
    fn smallest_row(&self, element: &PlyElement) -> u64 {
        let of = |property: &PlyProperty| match *property {
            PlyProperty::Scalar(kind) => self.smallest_number(kind) as u64,
            PlyProperty::List { count, .. } => self.smallest_number(count) as u64,
        };
        element.properties.iter().map(of).sum()
    }
}

/// A text body: words, wherever the lines end.
#[derive(Debug)]
pub(super) struct AsciiBody<'a> {
    scanner: TextScanner<'a>,
}

impl<'a> AsciiBody<'a> {
    pub(super) fn new(data: &'a [u8], at: usize) -> Self {
        Self {
            scanner: TextScanner::new(data, at),
        }
    }
}

impl NumberSource for AsciiBody<'_> {
    #[inline]
    fn number(&mut self, job: &ReadJob<'_>, _kind: ScalarType) -> Result<f64, Error> {
        let Some((word, at)) = self.scanner.word() else {
            return Err(job.truncated(self.place(self.scanner.data.len()), "a number is missing"));
        };
        parse_f64(word).ok_or_else(|| job.number(self.place(at), word, "a number"))
    }

    #[inline]
    fn dispensable(
        &mut self,
        job: &mut ReadJob<'_>,
        _: ScalarType,
        fault: PartFault,
    ) -> Result<f64, Error> {
        let Some((word, at)) = self.scanner.word() else {
            return Err(job.truncated(self.place(self.scanner.data.len()), "a number is missing"));
        };
        Ok(parse_f64(word).unwrap_or_else(|| {
            job.fault(fault, self.scanner.data, at);
            0.0
        }))
    }

    fn packed(&mut self, job: &mut ReadJob<'_>, kind: ScalarType) -> Result<u32, Error> {
        let value = self.dispensable(job, kind, PartFault::COLOR)?;
        Ok(if kind.is_float() && value.fract() != 0.0 {
            (value as f32).to_bits()
        } else {
            // The bits of an integer, whatever its sign.
            value as i64 as u32
        })
    }

    fn at(&self) -> usize {
        self.scanner.at
    }

    fn remaining(&self) -> usize {
        self.scanner.data.len() - self.scanner.at
    }

    fn place(&self, at: usize) -> FilePlace {
        at_line(self.scanner.data, at)
    }

    /// A digit and a space.
    fn smallest_number(&self, _kind: ScalarType) -> usize {
        2
    }

    fn read_fixed(
        &mut self,
        _: &ReadJob<'_>,
        _: &PlyElement,
        _: &mut ReadParts,
    ) -> Result<bool, Error> {
        Ok(false)
    }
}

/// A binary body, most significant byte first when `BIG`.
#[derive(Debug)]
pub(super) struct BinaryBody<'a, const BIG: bool> {
    data: &'a [u8],
    at: usize,
    /// Bytes of the file before `data`.
    before: u64,
}

impl<'a, const BIG: bool> BinaryBody<'a, BIG> {
    pub(super) fn new(data: &'a [u8], at: usize) -> Self {
        Self {
            data,
            at,
            before: 0,
        }
    }

    /// For errors: the data lie behind as many bytes of the file.
    pub(super) fn behind(self, before: u64) -> Self {
        Self { before, ..self }
    }
}

impl<const BIG: bool> NumberSource for BinaryBody<'_, BIG> {
    #[inline]
    fn number(&mut self, job: &ReadJob<'_>, kind: ScalarType) -> Result<f64, Error> {
        match self.data.get(self.at..self.at + kind.size()) {
            Some(bytes) => {
                self.at += kind.size();
                Ok(decode::<BIG>(bytes, kind))
            }
            None => Err(job.truncated(self.place(self.at), "a number is missing")),
        }
    }

    #[inline]
    fn dispensable(
        &mut self,
        job: &mut ReadJob<'_>,
        kind: ScalarType,
        _: PartFault,
    ) -> Result<f64, Error> {
        self.number(job, kind)
    }

    fn packed(&mut self, job: &mut ReadJob<'_>, kind: ScalarType) -> Result<u32, Error> {
        let start = self.at;
        self.number(job, kind)?;
        Ok(packed_bits::<BIG>(&self.data[start..], kind))
    }

    fn at(&self) -> usize {
        self.at
    }

    fn remaining(&self) -> usize {
        self.data.len() - self.at
    }

    fn place(&self, at: usize) -> FilePlace {
        FilePlace::Byte(self.before + at as u64)
    }

    fn smallest_number(&self, kind: ScalarType) -> usize {
        kind.size()
    }

    fn read_fixed(
        &mut self,
        job: &ReadJob<'_>,
        element: &PlyElement,
        sink: &mut ReadParts,
    ) -> Result<bool, Error> {
        let read = fixed::read::<BIG>(job, &self.data[self.at..], element, sink)?;
        self.at += read.unwrap_or(0);
        Ok(read.is_some())
    }
}

/// Reads all rows of an element.
pub(super) fn read<S: NumberSource>(
    job: &mut ReadJob<'_>,
    source: &mut S,
    element: &PlyElement,
    sink: &mut ReadParts,
) -> Result<(), Error> {
    if element.properties.is_empty() {
        return Ok(());
    }
    match element.role {
        ElementRole::Vertices(columns) => read_vertices(job, source, element, &columns, sink),
        ElementRole::Faces(columns) => read_faces(job, source, element, &columns, sink),
        ElementRole::Strips(list) => {
            for _ in 0..element.count {
                for (index, property) in element.properties.iter().enumerate() {
                    match *property {
                        PlyProperty::List { count, item } if index == list => {
                            let length = read_length(job, source, count, item)?;
                            read_strips(job, source, length, item, sink)?;
                        }
                        property => skip(job, source, property)?,
                    }
                }
                job.reach(source.at())?;
            }
            Ok(())
        }
        ElementRole::Other => {
            for _ in 0..element.count {
                for &property in &element.properties {
                    skip(job, source, property)?;
                }
                job.reach(source.at())?;
            }
            Ok(())
        }
    }
}

/// Passes a property that is not read.
#[inline]
fn skip<S: NumberSource>(
    job: &mut ReadJob<'_>,
    source: &mut S,
    property: PlyProperty,
) -> Result<(), Error> {
    match property {
        PlyProperty::Scalar(kind) => {
            source.dispensable(job, kind, PartFault::EXTRA)?;
        }
        PlyProperty::List { count, item } => {
            for _ in 0..read_length(job, source, count, item)? {
                source.dispensable(job, item, PartFault::EXTRA)?;
            }
        }
    }
    Ok(())
}

fn read_faces<S: NumberSource>(
    job: &mut ReadJob<'_>,
    source: &mut S,
    element: &PlyElement,
    columns: &FaceColumns,
    sink: &mut ReadParts,
) -> Result<(), Error> {
    // The smallest row has been checked to fit, so this is in proportion to the file.
    sink.list.triangles.reserve(element.count as usize);
    if let Some(color) = columns.color {
        sink.face_colors = ColorSink::new(color.map(|column| column.kind.color_range()));
    }
    let mut corners = Vec::new();
    let mut color = [0.0; 3];
    let mut places: Vec<f32> = Vec::new();
    for _ in 0..element.count {
        let mut texture = 0.0;
        places.clear();
        let before = sink.list.triangles.len();
        for (index, &property) in element.properties.iter().enumerate() {
            match property {
                PlyProperty::List { count, item } if index == columns.corners => {
                    let length = read_length(job, source, count, item)?;
                    read_polygon(job, source, length, item, sink, &mut corners)?;
                }
                PlyProperty::List { count, item } if columns.places == Some(index) => {
                    for _ in 0..read_length(job, source, count, item)? {
                        places.push(source.dispensable(job, item, PartFault::TEXTURE)? as f32);
                    }
                }
                PlyProperty::Scalar(kind) => {
                    let value = source.dispensable(job, kind, PartFault::EXTRA)?;
                    if columns
                        .texture
                        .is_some_and(|column| column.property == index)
                    {
                        texture = value;
                    }
                    let channels = columns.color.iter().flatten().zip(&mut color);
                    for (column, channel) in channels {
                        if column.property == index {
                            *channel = kind.color_value(value);
                        }
                    }
                }
                property => skip(job, source, property)?,
            }
        }
        if columns.places.is_some() || columns.texture.is_some() {
            let own = [before, sink.list.triangles.len()];
            let places = columns.places.is_some().then_some(&places[..]);
            sink.face_places.push(own, places, texture);
        }
        if columns.color.is_some() {
            let color = sink.face_colors.convert(color);
            sink.face_colors.colors.resize(before, [255; 4]);
            let length = sink.list.triangles.len();
            sink.face_colors.colors.resize(length, color);
        }
        job.reach(source.at())?;
    }
    Ok(())
}

/// Reads the length of a list and checks that so many items can follow.
#[inline]
fn read_length<S: NumberSource>(
    job: &ReadJob<'_>,
    source: &mut S,
    count: ScalarType,
    item: ScalarType,
) -> Result<u64, Error> {
    let start = source.at();
    let length = source.number(job, count)?;
    if !(length >= 0.0 && length.fract() == 0.0) {
        return Err(job.syntax(
            source.place(source.at()),
            format!("a list cannot have {length} items"),
        ));
    }
    // The cast saturates.
    let needed = (length as u64).saturating_mul(source.smallest_number(item) as u64);
    if needed > source.remaining() as u64 + 1 {
        return Err(job.truncated(
            source.place(start),
            format!(
                "a list of {length} items needs at least {needed} bytes, {} are left",
                source.remaining()
            ),
        ));
    }
    Ok(length as u64)
}

#[inline]
fn read_index<S: NumberSource>(
    job: &ReadJob<'_>,
    source: &mut S,
    kind: ScalarType,
    vertices: u64,
) -> Result<u32, Error> {
    let value = source.number(job, kind)?;
    let index = value as u32;
    if f64::from(index) == value && u64::from(index) < vertices {
        Ok(index)
    } else {
        // The place of the number itself: at the end of it, which is still on its line.
        Err(index_error(
            job,
            source.place(source.at() - 1),
            value,
            vertices,
        ))
    }
}

/// Reads a polygon; `corners` is memory to use.
#[inline]
fn read_polygon<S: NumberSource>(
    job: &ReadJob<'_>,
    source: &mut S,
    length: u64,
    kind: ScalarType,
    sink: &mut ReadParts,
    corners: &mut Vec<u32>,
) -> Result<(), Error> {
    if length < 3 {
        sink.list.faces += 1;
        sink.list.small += 1;
        for _ in 0..length {
            source.number(job, kind)?;
        }
        return Ok(());
    }
    corners.clear();
    for _ in 0..length {
        corners.push(read_index(job, source, kind, sink.vertices)?);
    }
    sink.list.push(corners);
    Ok(())
}

/// Reads strips that negative numbers end. Triangles that name a vertex twice only turn a strip and are dropped.
fn read_strips<S: NumberSource>(
    job: &ReadJob<'_>,
    source: &mut S,
    length: u64,
    kind: ScalarType,
    sink: &mut ReadParts,
) -> Result<(), Error> {
    let (mut a, mut b, mut in_strip) = (0, 0, 0_u64);
    for _ in 0..length {
        let value = source.number(job, kind)?;
        if value < 0.0 {
            in_strip = 0;
            continue;
        }
        let c = value as u32;
        if f64::from(c) != value || u64::from(c) >= sink.vertices {
            return Err(index_error(
                job,
                source.place(source.at() - 1),
                value,
                sink.vertices,
            ));
        }
        if in_strip >= 2 && a != b && b != c && c != a {
            sink.list.triangles.push(if in_strip.is_multiple_of(2) {
                [a, b, c]
            } else {
                [b, a, c]
            });
            sink.list.faces += 1;
        }
        (a, b, in_strip) = (b, c, in_strip + 1);
    }
    Ok(())
}

/// The first three numbers of a list of color values; a short one has zeros.
fn listed_color<S: NumberSource>(
    job: &mut ReadJob<'_>,
    source: &mut S,
    count: ScalarType,
    item: ScalarType,
) -> Result<[f64; 3], Error> {
    let mut color = [0.0; 3];
    for index in 0..read_length(job, source, count, item)? as usize {
        let value = item.color_value(source.dispensable(job, item, PartFault::COLOR)?);
        (color.iter_mut().skip(index).take(1)).for_each(|channel| *channel = value);
    }
    Ok(color)
}

fn read_vertices<S: NumberSource>(
    job: &mut ReadJob<'_>,
    source: &mut S,
    element: &PlyElement,
    columns: &VertexColumns,
    sink: &mut ReadParts,
) -> Result<(), Error> {
    sink.reserve_vertices(
        element.count as usize,
        columns.normal.is_some(),
        columns.color.is_some(),
    );
    // Every property writes its number to a slot: position, normal, color, alpha, texture coordinate, or the one
    // that nobody reads.
    const ALPHA: usize = 9;
    const PLACE: usize = 10;
    const IGNORED: usize = 12;
    let mut slot_of = vec![IGNORED; element.properties.len()];
    let (mut color, mut packed, mut listed) = (None, None, None);
    match columns.color {
        Some(ColorColumns::Channels { rgb, alpha }) => {
            sink.colors.ranges = rgb.map(|column| column.kind.color_range());
            color = Some(rgb);
            if let Some(column) = alpha {
                slot_of[column.property] = ALPHA;
            }
        }
        Some(ColorColumns::Harmonics(harmonics)) => color = Some(harmonics),
        Some(ColorColumns::Packed(column)) => packed = Some(column.property),
        Some(ColorColumns::Listed(column)) => {
            sink.colors.ranges = [column.kind.color_range(); 3];
            listed = Some(column.property);
        }
        None => {}
    }
    let groups = [Some(columns.position), columns.normal, color];
    for (group, columns) in groups.into_iter().enumerate() {
        for (channel, column) in columns.into_iter().flatten().enumerate() {
            slot_of[column.property] = group * 3 + channel;
        }
    }
    for (slot, column) in (PLACE..).zip(columns.place.into_iter().flatten()) {
        slot_of[column.property] = slot;
    }
    let kept = attributes_of(element);
    let mut of_kept = vec![Vec::with_capacity(element.count as usize); kept.len()];
    let mut values = [0.0; IGNORED + 1];
    values[ALPHA] = 1.0;
    for _ in 0..element.count {
        for (index, (&property, &slot)) in element.properties.iter().zip(&slot_of).enumerate() {
            match property {
                PlyProperty::Scalar(kind) if slot < 3 => values[slot] = source.number(job, kind)?,
                PlyProperty::Scalar(kind) if Some(index) == packed => {
                    let color = unpacked(source.packed(job, kind)?);
                    sink.colors.colors.push(color);
                }
                PlyProperty::Scalar(kind) => {
                    let fault = match slot {
                        3..=5 => PartFault::NORMAL,
                        6..=8 => PartFault::COLOR,
                        ALPHA | IGNORED => PartFault::EXTRA,
                        _ => PartFault::TEXTURE,
                    };
                    let value = source.dispensable(job, kind, fault)?;
                    if slot == IGNORED
                        && let Some(at) = kept.iter().position(|column| column.property == index)
                    {
                        of_kept[at].push(value);
                    }
                    values[slot] = if fault == PartFault::COLOR {
                        kind.color_value(value)
                    } else {
                        value
                    };
                }
                PlyProperty::List { count, item } if Some(index) == listed => {
                    values[6..9].copy_from_slice(&listed_color(job, source, count, item)?);
                }
                PlyProperty::List { .. } => skip(job, source, property)?,
            }
        }
        sink.push_position(DVec3::new(values[0], values[1], values[2]));
        if columns.normal.is_some() {
            sink.normals.push(Vec3::new(
                values[3] as f32,
                values[4] as f32,
                values[5] as f32,
            ));
        }
        if columns.place.is_some() {
            sink.push_place(DVec2::new(values[PLACE], values[PLACE + 1]));
        }
        let rgb = [values[6], values[7], values[8]];
        match columns.color {
            Some(ColorColumns::Channels { .. } | ColorColumns::Listed(_)) => {
                sink.colors.push(rgb);
                sink.is_transparent |= !is_opaque(values[ALPHA]);
            }
            Some(ColorColumns::Harmonics(_)) => sink.colors.colors.push(of_harmonics(rgb)),
            _ => {}
        }
        job.reach(source.at())?;
    }
    let found = kept.into_iter().zip(of_kept);
    let columns = found.map(|(column, values)| {
        let values = AttributeValues::F64(values).converted(attributes::number_of(column.kind));
        attributes::column(element, column, values)
    });
    sink.attributes.extend(columns);
    Ok(())
}
