//! PCD, the format of the Point Cloud Library (its documentation, "The PCD file format", version 0.7): text, binary, and
//! binary packed by LZF, field after field.

mod header;
mod lzf;

use std::borrow::Cow;

use glam::{DQuat, DVec3, Vec3};
use rayon::prelude::*;

use self::header::{PcdEncoding, PcdField, PcdHeader};
use self::lzf::unpack_lzf;
use super::super::assemble::RawMesh;
use super::super::color::ColorRange;
use super::super::job::{ReadJob, at_line};
use super::super::part::PartFate;
use super::super::text::{TextScanner, parse_f64, words};
use super::super::{Error, FilePlace, Format, ReadWarning};
use super::roles::{ColumnRole, kind_of, role_of_name};
use super::sink::{CloudSink, TableBlock};
use super::{bytes_at, check_unpacked};
use crate::mesh::attributes::{AttributeColumn, AttributeValues, NumberType};

/// Points of a parallel piece.
const PIECE: usize = 1 << 15;
const PIECES_A_BATCH: usize = 16;

/// Where a value of every point is.
#[derive(Debug, Clone, Copy)]
struct PcdSource {
    at: usize,
    word: usize,
    size: usize,
    letter: u8,
    /// Bytes between two points: of a row, or of a value where fields follow each other.
    stride: usize,
}

/// Where the parts of a point are.
#[derive(Debug)]
struct PcdPlan {
    position: [PcdSource; 3],
    normal: Option<[PcdSource; 3]>,
    color: Option<[PcdSource; 3]>,
    packed_color: Option<PcdSource>,
    attributes: Vec<PcdSource>,
    turn: DQuat,
    shift: DVec3,
}

/// The number of a field that stands in a binary row.
#[inline]
fn decode(data: &[u8], at: usize, size: usize, letter: u8) -> f64 {
    match (letter, size) {
        (b'F', 8) => f64::from_le_bytes(bytes_at(data, at)),
        (b'F', _) => f32::from_le_bytes(bytes_at(data, at)).into(),
        (b'I', 1) => i8::from_le_bytes(bytes_at(data, at)).into(),
        (b'I', 2) => i16::from_le_bytes(bytes_at(data, at)).into(),
        (b'I', 4) => i32::from_le_bytes(bytes_at(data, at)).into(),
        (b'I', _) => i64::from_le_bytes(bytes_at(data, at)) as f64,
        (_, 1) => u8::from_le_bytes(bytes_at(data, at)).into(),
        (_, 2) => u16::from_le_bytes(bytes_at(data, at)).into(),
        (_, 4) => u32::from_le_bytes(bytes_at(data, at)).into(),
        (_, _) => u64::from_le_bytes(bytes_at(data, at)) as f64,
    }
}

/// Reads a PCD file.
pub(in super::super) fn read(
    job: &mut ReadJob<'_>,
    data: &[u8],
) -> Result<(Format, RawMesh), Error> {
    let mut header = PcdHeader::parse(job, data)?;
    let mut found = header.points;
    let body: Cow<'_, [u8]> = match header.encoding {
        PcdEncoding::Text => Cow::Borrowed(&data[header.end..]),
        PcdEncoding::Binary => {
            let body = &data[header.end..];
            found = found.min((body.len() / header.row_bytes) as u64);
            Cow::Borrowed(body)
        }
        PcdEncoding::Packed => Cow::Owned(unpacked_body(job, data, &header)?),
    };
    if header.encoding == PcdEncoding::Packed {
        header.place_by_field();
    }
    let (plan, columns) = plan(job, &header)?;
    let mut sink = CloudSink::new(columns, ColorRange::EITHER);
    sink.scans = 1;
    if header.encoding == PcdEncoding::Text {
        found = read_text(job, data, &header, &plan, &mut sink)?;
    } else {
        if found == 0 {
            return Err(job.truncated(FilePlace::Byte(header.end as u64), "the points"));
        }
        let count = found as usize;
        job.check_vertices(found)?;
        for batch in (0..count).step_by(PIECE * PIECES_A_BATCH) {
            let end = count.min(batch + PIECE * PIECES_A_BATCH);
            let pieces: Vec<usize> = (batch..end).step_by(PIECE).collect();
            let blocks: Vec<TableBlock> = pieces
                .into_par_iter()
                .map(|start| plan.block(&body, start..end.min(start + PIECE)))
                .collect();
            blocks.into_iter().for_each(|block| sink.append(block));
            let done = (end as u64 * (data.len() - header.end) as u64 / found) as usize;
            job.report(header.end + done)?;
        }
    }
    if found != header.points {
        job.warn(ReadWarning::CountContradicts {
            what: "points",
            promised: header.points,
            found,
        });
    }
    sink.points = found;
    sink.holes = drop_holes(&mut sink);
    let scanner = plan.is_posed().then_some(plan.shift);
    sink.scanners.push(sink.positions.len(), scanner);
    for field in &header.fields {
        if !field.name.starts_with('_') {
            let name = format!("field {}", field.name);
            let kind = format!("{}{}", field.letter as char, field.size * 8);
            job.inventory
                .add(name, found * field.count as u64, PartFate::Used, kind);
        }
    }
    Ok((Format::Pcd, sink.finish(job)?))
}

/// Removes points without a place, which organised clouds have where nothing was seen; returns how many.
fn drop_holes(sink: &mut CloudSink) -> u64 {
    let keeps: Vec<bool> = sink
        .positions
        .iter()
        .map(|point| point.is_finite())
        .collect();
    let holes = keeps.iter().filter(|keep| !**keep).count();
    if holes == 0 || holes == keeps.len() {
        return 0;
    }
    fn retain<T>(items: &mut Vec<T>, keeps: &[bool]) {
        let mut at = keeps.iter();
        items.retain(|_| at.next().copied().unwrap_or(true));
    }
    retain(&mut sink.positions, &keeps);
    retain(&mut sink.normals, &keeps);
    retain(&mut sink.colors.colors, &keeps);
    for column in &mut sink.columns {
        column.values.retain(|index| keeps[index]);
    }
    holes as u64
}

/// The fields as roles, and the columns that are kept.
fn plan(job: &ReadJob<'_>, header: &PcdHeader) -> Result<(PcdPlan, Vec<AttributeColumn>), Error> {
    let mut position = [None; 3];
    let mut normal = [None; 3];
    let mut color = [None; 3];
    let mut packed_color = None;
    let mut attributes = Vec::new();
    let mut columns = Vec::new();
    let stride = |field: &PcdField| match header.encoding {
        PcdEncoding::Packed => field.size * field.count,
        _ => header.row_bytes,
    };
    for field in &header.fields {
        for member in 0..field.count {
            let source = PcdSource {
                at: field.at + member * field.size,
                word: field.word + member,
                size: field.size,
                letter: field.letter,
                stride: stride(field),
            };
            let name = field.name.as_str();
            // An underscore is padding.
            if name.starts_with('_') {
                continue;
            }
            if matches!(name, "rgb" | "rgba") && field.size == 4 {
                packed_color = Some(source);
                continue;
            }
            match role_of_name(name) {
                ColumnRole::Position(axis) if matches!(name, "x" | "y" | "z") => {
                    position[axis] = Some(source)
                }
                ColumnRole::Normal(axis) => normal[axis] = Some(source),
                ColumnRole::Color(channel) => color[channel] = Some(source),
                role => {
                    let name = match role {
                        ColumnRole::Attribute(name) => name,
                        _ => name.to_owned(),
                    };
                    let name = if field.count > 1 {
                        format!("{name}_{member}")
                    } else {
                        name
                    };
                    let kind = kind_of(&name);
                    columns.push(AttributeColumn::new(name, kind, NumberType::F64));
                    attributes.push(source);
                }
            }
        }
    }
    let all = |[a, b, c]: [Option<PcdSource>; 3]| Some([a?, b?, c?]);
    let Some(position) = all(position) else {
        return Err(job.syntax(FilePlace::Line(1), "the header has no fields x, y and z"));
    };
    let plan = PcdPlan {
        position,
        normal: all(normal),
        color: all(color),
        packed_color,
        attributes,
        turn: header.turn,
        shift: header.shift,
    };
    Ok((plan, columns))
}

impl PcdPlan {
    /// Tells whether the file says where the scanner stood.
    fn is_posed(&self) -> bool {
        self.turn != DQuat::IDENTITY || self.shift != DVec3::ZERO
    }

    /// The points of a run of binary rows.
    fn block(&self, body: &[u8], rows: std::ops::Range<usize>) -> TableBlock {
        let value = |source: &PcdSource, row: usize| {
            decode(
                body,
                source.at + row * source.stride,
                source.size,
                source.letter,
            )
        };
        self.collect(rows, value, |source, row| {
            u32::from_le_bytes(bytes_at(body, source.at + row * source.stride))
        })
    }

    /// The points of rows whose numbers `value` gives, and whose packed colors `bits` gives.
    fn collect(
        &self,
        rows: std::ops::Range<usize>,
        value: impl Fn(&PcdSource, usize) -> f64,
        bits: impl Fn(&PcdSource, usize) -> u32,
    ) -> TableBlock {
        let three = |sources: &[PcdSource; 3], row: usize| {
            DVec3::new(
                value(&sources[0], row),
                value(&sources[1], row),
                value(&sources[2], row),
            )
        };
        let is_posed = self.is_posed();
        let place = |row| {
            let place = three(&self.position, row);
            if is_posed {
                self.turn * place + self.shift
            } else {
                place
            }
        };
        let normal =
            |sources: &[PcdSource; 3], row| -> Vec3 { (self.turn * three(sources, row)).as_vec3() };
        let colors = match (&self.packed_color, &self.color) {
            (Some(source), _) => rows
                .clone()
                .map(|row| {
                    let [blue, green, red, _] = bits(source, row).to_le_bytes();
                    [red, green, blue].map(f32::from)
                })
                .collect(),
            (None, Some(sources)) => rows
                .clone()
                .map(|row| three(sources, row).as_vec3().to_array())
                .collect(),
            (None, None) => Vec::new(),
        };
        TableBlock {
            positions: rows.clone().map(place).collect(),
            normals: match &self.normal {
                Some(sources) => rows.clone().map(|row| normal(sources, row)).collect(),
                None => Vec::new(),
            },
            colors,
            values: self
                .attributes
                .iter()
                .map(|source| {
                    AttributeValues::of(rows.clone().map(|row| value(source, row)).collect())
                })
                .collect(),
        }
    }
}

/// Reads rows of text until the promised number or the end; returns how many there are.
fn read_text(
    job: &mut ReadJob<'_>,
    data: &[u8],
    header: &PcdHeader,
    plan: &PcdPlan,
    sink: &mut CloudSink,
) -> Result<u64, Error> {
    let mut scanner = TextScanner::new(data, header.end);
    let mut found = 0;
    let mut numbers = Vec::new();
    let mut row_words: Vec<&[u8]> = Vec::new();
    let mut rows = 0;
    while found < header.points {
        let Some((line, start)) = scanner.line() else {
            break;
        };
        row_words.clear();
        row_words.extend(words(line));
        if row_words.is_empty() {
            continue;
        }
        if row_words.len() < header.row_words {
            // The last line of a file that was cut short.
            if scanner.line().is_none() {
                break;
            }
            let reason = format!(
                "a point has {} numbers instead of {}",
                row_words.len(),
                header.row_words
            );
            return Err(job.syntax(at_line(data, start), reason));
        }
        for word in &row_words[..header.row_words] {
            match parse_f64(word) {
                Some(number) => numbers.push(number),
                None => return Err(job.number(at_line(data, start), word, "a number")),
            }
        }
        found += 1;
        rows += 1;
        if rows == PIECE {
            sink.append(plan.text_block(&numbers, header.row_words));
            numbers.clear();
            rows = 0;
        }
        job.reach(scanner.at)?;
    }
    sink.append(plan.text_block(&numbers, header.row_words));
    Ok(found)
}

impl PcdPlan {
    fn text_block(&self, numbers: &[f64], row_words: usize) -> TableBlock {
        let value = |source: &PcdSource, row: usize| numbers[row * row_words + source.word];
        // A packed color is written as its integer, or as the float of the same bits.
        let bits = |source: &PcdSource, row| {
            let number = value(source, row);
            if source.letter == b'F' && (number.fract() != 0.0 || number.abs() < 1.0) {
                (number as f32).to_bits()
            } else {
                number as i64 as u32
            }
        };
        self.collect(0..numbers.len() / row_words.max(1), value, bits)
    }
}

/// The unpacked points of `binary_compressed`: two lengths, then LZF.
fn unpacked_body(job: &ReadJob<'_>, data: &[u8], header: &PcdHeader) -> Result<Vec<u8>, Error> {
    let place = FilePlace::Byte(header.end as u64);
    let body = &data[header.end..];
    let packed = u32::from_le_bytes(bytes_at(body, 0)) as usize;
    let stated = u64::from(u32::from_le_bytes(bytes_at(body, 4)));
    let Some(packed) = body.get(8..).and_then(|rest| rest.get(..packed)) else {
        return Err(job.truncated(place, format!("{packed} packed bytes")));
    };
    let wanted = header.points.saturating_mul(header.row_bytes as u64);
    if stated != wanted {
        let reason = format!("the points are said to unpack to {stated} bytes, they have {wanted}");
        return Err(job.syntax(place, reason));
    }
    check_unpacked(
        job,
        header.points,
        header.row_bytes as u64,
        packed.len() as u64,
    )?;
    // The check allows no more than memory can hold.
    unpack_lzf(packed, wanted as usize)
        .ok_or_else(|| job.syntax(place, "the packed points are damaged"))
}
