//! The general way through a PLY body, number by number: any types, any lists, text or binary.

use glam::{DVec3, Vec3};

use super::super::job::{Job, at_line};
use super::super::text::{Scanner, parse_f64};
use super::super::{Error, Place};
use super::header::{Element, Property, Role, Type, VertexColumns};
use super::{Sink, fixed, index_error};

/// Gives the numbers of a body in order. All types fit a double but 64-bit integers, which no index reaches.
pub(super) trait Source {
    /// The next number.
    fn number(&mut self, job: &Job<'_>, kind: Type) -> Result<f64, Error>;
    /// Offset of the next byte.
    fn at(&self) -> usize;
    /// Bytes left.
    fn remaining(&self) -> usize;
    /// The place of an offset in the words of this encoding.
    fn place(&self, at: usize) -> Place;
    /// Least number of bytes that one number takes.
    fn smallest_number(&self, kind: Type) -> usize;
    /// Reads an element the fast way when its rows allow it; false, having moved nothing, when they do not.
    fn read_fixed(
        &mut self,
        job: &Job<'_>,
        element: &Element,
        sink: &mut Sink,
    ) -> Result<bool, Error>;

    /// Least number of bytes that a row takes: its lists are empty.
    fn smallest_row(&self, element: &Element) -> u64 {
        let of = |property: &Property| match *property {
            Property::Scalar(kind) => self.smallest_number(kind) as u64,
            Property::List { count, .. } => self.smallest_number(count) as u64,
        };
        element.properties.iter().map(of).sum()
    }
}

/// A text body: words, wherever the lines end.
#[derive(Debug)]
pub(super) struct Ascii<'a> {
    scanner: Scanner<'a>,
}

impl<'a> Ascii<'a> {
    pub(super) fn new(data: &'a [u8], at: usize) -> Self {
        Self {
            scanner: Scanner::new(data, at),
        }
    }
}

impl Source for Ascii<'_> {
    #[inline]
    fn number(&mut self, job: &Job<'_>, _kind: Type) -> Result<f64, Error> {
        let Some((word, at)) = self.scanner.word() else {
            return Err(job.truncated(self.place(self.scanner.data.len()), "a number is missing"));
        };
        parse_f64(word).ok_or_else(|| job.number(self.place(at), word, "a number"))
    }

    fn at(&self) -> usize {
        self.scanner.at
    }

    fn remaining(&self) -> usize {
        self.scanner.data.len() - self.scanner.at
    }

    fn place(&self, at: usize) -> Place {
        at_line(self.scanner.data, at)
    }

    /// A digit and a space.
    fn smallest_number(&self, _kind: Type) -> usize {
        2
    }

    fn read_fixed(&mut self, _: &Job<'_>, _: &Element, _: &mut Sink) -> Result<bool, Error> {
        Ok(false)
    }
}

/// A binary body, most significant byte first when `BIG`.
#[derive(Debug)]
pub(super) struct Binary<'a, const BIG: bool> {
    data: &'a [u8],
    at: usize,
}

impl<'a, const BIG: bool> Binary<'a, BIG> {
    pub(super) fn new(data: &'a [u8], at: usize) -> Self {
        Self { data, at }
    }
}

/// The number at the start of `bytes`; zero when they are too few, which callers have excluded.
#[inline]
pub(super) fn decode<const BIG: bool>(bytes: &[u8], kind: Type) -> f64 {
    macro_rules! number {
        ($type:ty) => {
            match bytes.first_chunk() {
                Some(&chunk) if BIG => <$type>::from_be_bytes(chunk) as f64,
                Some(&chunk) => <$type>::from_le_bytes(chunk) as f64,
                None => 0.0,
            }
        };
    }
    match kind {
        Type::I8 => number!(i8),
        Type::U8 => number!(u8),
        Type::I16 => number!(i16),
        Type::U16 => number!(u16),
        Type::I32 => number!(i32),
        Type::U32 => number!(u32),
        Type::I64 => number!(i64),
        Type::U64 => number!(u64),
        Type::F32 => number!(f32),
        Type::F64 => number!(f64),
    }
}

impl<const BIG: bool> Source for Binary<'_, BIG> {
    #[inline]
    fn number(&mut self, job: &Job<'_>, kind: Type) -> Result<f64, Error> {
        match self.data.get(self.at..self.at + kind.size()) {
            Some(bytes) => {
                self.at += kind.size();
                Ok(decode::<BIG>(bytes, kind))
            }
            None => Err(job.truncated(Place::Byte(self.at as u64), "a number is missing")),
        }
    }

    fn at(&self) -> usize {
        self.at
    }

    fn remaining(&self) -> usize {
        self.data.len() - self.at
    }

    fn place(&self, at: usize) -> Place {
        Place::Byte(at as u64)
    }

    fn smallest_number(&self, kind: Type) -> usize {
        kind.size()
    }

    fn read_fixed(
        &mut self,
        job: &Job<'_>,
        element: &Element,
        sink: &mut Sink,
    ) -> Result<bool, Error> {
        let read = fixed::read::<BIG>(job, &self.data[self.at..], element, sink)?;
        self.at += read.unwrap_or(0);
        Ok(read.is_some())
    }
}

/// Reads all rows of an element.
pub(super) fn read<S: Source>(
    job: &mut Job<'_>,
    source: &mut S,
    element: &Element,
    sink: &mut Sink,
) -> Result<(), Error> {
    if element.properties.is_empty() {
        return Ok(());
    }
    match element.role {
        Role::Vertices(columns) => read_vertices(job, source, element, &columns, sink),
        Role::Faces(list) => {
            // The smallest row has been checked to fit, so this is in proportion to the file.
            sink.triangles.reserve(element.count as usize);
            for _ in 0..element.count {
                read_row(
                    job,
                    source,
                    element,
                    Some(list),
                    |job, source, length, kind| {
                        sink.faces += 1;
                        read_polygon(job, source, length, kind, sink)
                    },
                )?;
            }
            Ok(())
        }
        Role::Strips(list) => {
            for _ in 0..element.count {
                read_row(
                    job,
                    source,
                    element,
                    Some(list),
                    |job, source, length, kind| read_strips(job, source, length, kind, sink),
                )?;
            }
            Ok(())
        }
        Role::Other => {
            for _ in 0..element.count {
                read_row(job, source, element, None, |_, _, _, _| Ok(()))?;
            }
            Ok(())
        }
    }
}

/// Reads a row; the property `list` goes to `take` with its length and item type, all else is skipped.
#[inline]
fn read_row<S: Source>(
    job: &mut Job<'_>,
    source: &mut S,
    element: &Element,
    list: Option<usize>,
    mut take: impl FnMut(&Job<'_>, &mut S, u64, Type) -> Result<(), Error>,
) -> Result<(), Error> {
    for (index, property) in element.properties.iter().enumerate() {
        match *property {
            Property::Scalar(kind) => {
                source.number(job, kind)?;
            }
            Property::List { count, item } => {
                let length = read_length(job, source, count, item)?;
                if Some(index) == list {
                    take(job, source, length, item)?;
                } else {
                    for _ in 0..length {
                        source.number(job, item)?;
                    }
                }
            }
        }
    }
    job.reach(source.at())
}

/// Reads the length of a list and checks that so many items can follow.
#[inline]
fn read_length<S: Source>(
    job: &Job<'_>,
    source: &mut S,
    count: Type,
    item: Type,
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
fn read_index<S: Source>(
    job: &Job<'_>,
    source: &mut S,
    kind: Type,
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

/// Reads a polygon as a fan about its first corner.
#[inline]
fn read_polygon<S: Source>(
    job: &Job<'_>,
    source: &mut S,
    length: u64,
    kind: Type,
    sink: &mut Sink,
) -> Result<(), Error> {
    if length < 3 {
        sink.small_faces += 1;
        for _ in 0..length {
            source.number(job, kind)?;
        }
        return Ok(());
    }
    let first = read_index(job, source, kind, sink.vertices)?;
    let mut previous = read_index(job, source, kind, sink.vertices)?;
    for _ in 2..length {
        let next = read_index(job, source, kind, sink.vertices)?;
        sink.triangles.push([first, previous, next]);
        previous = next;
    }
    Ok(())
}

/// Reads strips that negative numbers end. Triangles that name a vertex twice only turn a strip and are dropped.
fn read_strips<S: Source>(
    job: &Job<'_>,
    source: &mut S,
    length: u64,
    kind: Type,
    sink: &mut Sink,
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
            sink.triangles.push(if in_strip.is_multiple_of(2) {
                [a, b, c]
            } else {
                [b, a, c]
            });
            sink.faces += 1;
        }
        (a, b, in_strip) = (b, c, in_strip + 1);
    }
    Ok(())
}

fn read_vertices<S: Source>(
    job: &mut Job<'_>,
    source: &mut S,
    element: &Element,
    columns: &VertexColumns,
    sink: &mut Sink,
) -> Result<(), Error> {
    sink.reserve_vertices(
        element.count as usize,
        columns.normal.is_some(),
        columns.color.is_some(),
    );
    // Every property writes its number to a slot: position, normal, color, or the one that nobody reads.
    const IGNORED: usize = 9;
    let mut slot_of = vec![IGNORED; element.properties.len()];
    let groups = [Some(columns.position), columns.normal, columns.color];
    for (group, columns) in groups.into_iter().enumerate() {
        for (channel, column) in columns.into_iter().flatten().enumerate() {
            slot_of[column.property] = group * 3 + channel;
        }
    }
    let mut values = [0.0; IGNORED + 1];
    for _ in 0..element.count {
        for (property, &slot) in element.properties.iter().zip(&slot_of) {
            match *property {
                Property::Scalar(kind) => values[slot] = source.number(job, kind)?,
                Property::List { count, item } => {
                    for _ in 0..read_length(job, source, count, item)? {
                        source.number(job, item)?;
                    }
                }
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
        if let Some([red, green, blue]) = columns.color {
            let [r, g, b] = [(red, values[6]), (green, values[7]), (blue, values[8])];
            sink.colors.push([
                r.0.kind.color(r.1),
                g.0.kind.color(g.1),
                b.0.kind.color(b.1),
                255,
            ]);
        }
        job.reach(source.at())?;
    }
    Ok(())
}
