//! The header of PCD files: lines of keywords up to `DATA`.

use glam::{DQuat, DVec3};

use super::super::super::job::{ReadJob, at_line};
use super::super::super::text::{TextScanner, parse_f64, parse_i64, shown, words};
use super::super::super::{Error, FilePlace};

/// A header longer than this is none.
const LONGEST_HEADER: usize = 1 << 16;

/// Most numbers of a point.
const MOST_VALUES: usize = 4096;

/// How numbers are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PcdEncoding {
    Text,
    Binary,
    Packed,
}

/// A field of every point.
#[derive(Debug, Clone)]
pub(super) struct PcdField {
    pub(super) name: String,
    /// Bytes of a value: 1, 2, 4 or 8.
    pub(super) size: usize,
    /// `F`, `U` or `I`.
    pub(super) letter: u8,
    /// Values of a point.
    pub(super) count: usize,
    /// Offset of the first value in a binary row, and its number in a text row.
    pub(super) at: usize,
    pub(super) word: usize,
}

/// What the header says.
#[derive(Debug)]
pub(super) struct PcdHeader {
    pub(super) fields: Vec<PcdField>,
    pub(super) points: u64,
    /// Bytes and numbers of a row.
    pub(super) row_bytes: usize,
    pub(super) row_words: usize,
    pub(super) turn: DQuat,
    pub(super) shift: DVec3,
    pub(super) encoding: PcdEncoding,
    /// Offset of the points.
    pub(super) end: usize,
}

impl PcdHeader {
    pub(super) fn parse(job: &ReadJob<'_>, data: &[u8]) -> Result<PcdHeader, Error> {
        let head = &data[..data.len().min(LONGEST_HEADER)];
        let mut scanner = TextScanner::new(head, 0);
        let mut header = PcdHeader {
            fields: Vec::new(),
            points: 0,
            row_bytes: 0,
            row_words: 0,
            turn: DQuat::IDENTITY,
            shift: DVec3::ZERO,
            encoding: PcdEncoding::Text,
            end: 0,
        };
        let (mut width, mut height, mut points) = (None, None, None);
        loop {
            let Some((line, start)) = scanner.line() else {
                return Err(job.truncated(at_line(data, head.len()), "the header has no line DATA"));
            };
            let place = || at_line(data, start);
            let mut line_words = words(line);
            let Some(keyword) = line_words.next().filter(|word| !word.starts_with(b"#")) else {
                continue;
            };
            let rest: Vec<&[u8]> = line_words.collect();
            let number = |word: &[u8]| {
                let number = parse_i64(word).and_then(|number| u64::try_from(number).ok());
                number.ok_or_else(|| job.number(place(), word, "a count"))
            };
            let first = || rest.first().copied().unwrap_or(b"");
            match keyword {
                b"FIELDS" | b"COLUMNS" => {
                    header.fields = rest
                        .iter()
                        .take(MOST_VALUES)
                        .map(|name| PcdField {
                            name: shown(name).to_lowercase(),
                            size: 4,
                            letter: b'F',
                            count: 1,
                            at: 0,
                            word: 0,
                        })
                        .collect();
                }
                b"SIZE" => {
                    for (field, word) in header.fields.iter_mut().zip(&rest) {
                        field.size = match number(word)? {
                            size @ (1 | 2 | 4 | 8) => size as usize,
                            _ => {
                                return Err(job.number(
                                    place(),
                                    word,
                                    "a size of 1, 2, 4 or 8 bytes",
                                ));
                            }
                        };
                    }
                }
                b"TYPE" => {
                    for (field, word) in header.fields.iter_mut().zip(&rest) {
                        field.letter = match word {
                            [letter @ (b'F' | b'U' | b'I')] => *letter,
                            _ => return Err(job.number(place(), word, "a type F, U or I")),
                        };
                    }
                }
                b"COUNT" => {
                    for (field, word) in header.fields.iter_mut().zip(&rest) {
                        field.count = usize::try_from(number(word)?)
                            .ok()
                            .filter(|&count| count <= MOST_VALUES)
                            .ok_or_else(|| {
                                job.number(place(), word, "a count of values up to 4096")
                            })?;
                    }
                }
                b"WIDTH" => width = Some(number(first())?),
                b"HEIGHT" => height = Some(number(first())?),
                b"POINTS" => points = Some(number(first())?),
                b"VIEWPOINT" => {
                    let values: Option<Vec<f64>> =
                        rest.iter().map(|word| parse_f64(word)).collect();
                    let Some([x, y, z, w, i, j, k]) = values.as_deref() else {
                        return Err(job.syntax(place(), "VIEWPOINT needs seven numbers"));
                    };
                    header.shift = DVec3::new(*x, *y, *z);
                    header.turn = DQuat::from_xyzw(*i, *j, *k, *w);
                    let length = header.turn.length();
                    if !(header.shift.is_finite() && length.is_finite() && length > 0.0) {
                        return Err(job.syntax(place(), "VIEWPOINT is no place and turn"));
                    }
                    header.turn /= length;
                }
                b"DATA" => {
                    header.encoding = match first() {
                        b"ascii" => PcdEncoding::Text,
                        b"binary" => PcdEncoding::Binary,
                        b"binary_compressed" => PcdEncoding::Packed,
                        other => {
                            let reason = format!("DATA `{}` is not known", shown(other));
                            return Err(job.syntax(place(), reason));
                        }
                    };
                    break;
                }
                b"VERSION" => {}
                other => {
                    let reason = format!("unknown keyword `{}` in the header", shown(other));
                    return Err(job.syntax(place(), reason));
                }
            }
        }
        header.end = scanner.at;
        let by_size = width.and_then(|width| width.checked_mul(height.unwrap_or(1)));
        header.points = points.or(by_size).unwrap_or(0);
        for field in &mut header.fields {
            field.at = header.row_bytes;
            field.word = header.row_words;
            header.row_bytes += field.size * field.count;
            header.row_words += field.count;
        }
        if header.points == 0 || header.row_bytes == 0 {
            return Err(job.empty("the header names no points"));
        }
        if header.row_words > MOST_VALUES {
            let reason = format!("a point has {} numbers", header.row_words);
            return Err(job.syntax(FilePlace::Line(1), reason));
        }
        Ok(header)
    }

    /// Places the fields where one follows the other, each for all points.
    pub(super) fn place_by_field(&mut self) {
        let mut at = 0;
        for field in &mut self.fields {
            field.at = at;
            // The body has the size of all fields, which was held against the limits.
            at += field.size * field.count * self.points as usize;
        }
    }
}
