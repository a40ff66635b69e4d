//! The header of a PLY file: encoding, elements, properties.

use super::super::color::ColorRange;
use super::super::job::{ReadJob, at_line};
use super::super::text::{TextScanner, shown, words};
use super::super::{Error, FilePlace};
use super::columns::{self, ElementRole};

/// How the numbers are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PlyEncoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ScalarType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl ScalarType {
    fn parse(word: &[u8]) -> Option<ScalarType> {
        Some(match word {
            b"char" | b"int8" => ScalarType::I8,
            b"uchar" | b"uint8" => ScalarType::U8,
            b"short" | b"int16" => ScalarType::I16,
            b"ushort" | b"uint16" => ScalarType::U16,
            b"int" | b"int32" => ScalarType::I32,
            b"uint" | b"uint32" => ScalarType::U32,
            b"int64" | b"long" => ScalarType::I64,
            b"uint64" | b"ulong" => ScalarType::U64,
            b"float" | b"float32" => ScalarType::F32,
            b"double" | b"float64" => ScalarType::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary file.
    pub(super) fn size(self) -> usize {
        match self {
            ScalarType::I8 | ScalarType::U8 => 1,
            ScalarType::I16 | ScalarType::U16 => 2,
            ScalarType::I32 | ScalarType::U32 | ScalarType::F32 => 4,
            ScalarType::I64 | ScalarType::U64 | ScalarType::F64 => 8,
        }
    }

    pub(super) fn is_float(self) -> bool {
        matches!(self, ScalarType::F32 | ScalarType::F64)
    }

    /// The range of a color channel before its values are known.
    pub(super) fn color_range(self) -> ColorRange {
        match self {
            ScalarType::F32 | ScalarType::F64 => ColorRange::FLOAT,
            ScalarType::I8 | ScalarType::U8 => ColorRange::BYTE,
            ScalarType::I16 | ScalarType::U16 => ColorRange::WORD,
            _ => ColorRange::INTEGER,
        }
    }

    /// A color channel: bytes that were written with a sign have none.
    #[inline]
    pub(super) fn color_value(self, value: f64) -> f64 {
        if self == ScalarType::I8 && value < 0.0 {
            value + 256.0
        } else {
            value
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PlyProperty {
    Scalar(ScalarType),
    List { count: ScalarType, item: ScalarType },
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct PlyElement {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<PlyProperty>,
    /// Names of the properties.
    pub(super) names: Vec<String>,
    pub(super) role: ElementRole,
}

impl PlyElement {
    /// Bytes of a binary row when no property is a list.
    pub(super) fn stride(&self) -> Option<usize> {
        self.properties
            .iter()
            .try_fold(0, |sum, property| match property {
                PlyProperty::Scalar(kind) => Some(sum + kind.size()),
                PlyProperty::List { .. } => None,
            })
    }
}

#[derive(Debug)]
pub(super) struct PlyHeader {
    pub(super) encoding: PlyEncoding,
    pub(super) elements: Vec<PlyElement>,
    /// Rows of the vertex element.
    pub(super) vertices: u64,
    /// Names of textures in comments.
    pub(super) textures: Vec<String>,
    /// Offset of the first byte after the header.
    pub(super) end: usize,
}

/// A header longer than this is none.
const LONGEST_HEADER: usize = 1 << 20;

/// A property list while the header is read.
pub(super) type Named = Vec<(String, PlyProperty)>;

impl PlyHeader {
    pub(super) fn parse(job: &mut ReadJob<'_>, data: &[u8]) -> Result<PlyHeader, Error> {
        let head = &data[..data.len().min(LONGEST_HEADER)];
        let mut scanner = TextScanner::new(head, 0);
        let mut encoding = None;
        let mut raw: Vec<(String, u64, Named)> = Vec::new();
        let mut textures = Vec::new();
        // Some writers end the line of `ply` with a lone carriage return; then all lines do, and the byte after
        // `end_header` belongs to the data even if it looks like a line feed.
        let lone_returns = data.get(3) == Some(&b'\r') && data.get(4) != Some(&b'\n');
        loop {
            let Some((line, start)) = scanner.line() else {
                return Err(job.truncated(
                    at_line(data, head.len()),
                    "the header has no `end_header` line",
                ));
            };
            let place = || at_line(data, start);
            let mut line_words = words(line);
            let Some(keyword) = line_words.next() else {
                continue;
            };
            let rest: Vec<&[u8]> = line_words.collect();
            match keyword {
                b"ply" | b"obj_info" => {}
                b"comment" => {
                    if let [keyword, name @ ..] = &rest[..]
                        && keyword.eq_ignore_ascii_case(b"texturefile")
                        && !name.is_empty()
                    {
                        // Names may hold spaces.
                        textures.push(String::from_utf8_lossy(&name.join(&b' ')).into_owned());
                    }
                }
                b"format" => {
                    encoding = Some(match rest.first() {
                        Some(&b"ascii") => PlyEncoding::Ascii,
                        Some(&b"binary_little_endian") => PlyEncoding::LittleEndian,
                        Some(&b"binary_big_endian") => PlyEncoding::BigEndian,
                        other => {
                            let found = shown(other.unwrap_or(&&b""[..]));
                            return Err(
                                job.syntax(place(), format!("unknown PLY format `{found}`"))
                            );
                        }
                    });
                }
                b"element" => raw.push(parse_element(job, place, &rest)?),
                b"property" => {
                    let property = parse_property(job, place, &rest)?;
                    match raw.last_mut() {
                        Some((_, _, properties)) => properties.push(property),
                        None => {
                            return Err(
                                job.syntax(place(), "a property stands before the first element")
                            );
                        }
                    }
                }
                b"end_header" => {
                    let ended = scanner.at > start + line.len();
                    if lone_returns && ended {
                        scanner.at = start + line.len() + 1;
                    }
                    break;
                }
                other => {
                    return Err(job.syntax(
                        place(),
                        format!("unknown keyword `{}` in the header", shown(other)),
                    ));
                }
            }
        }
        let Some(encoding) = encoding else {
            return Err(job.syntax(at_line(data, scanner.at), "the header has no `format` line"));
        };
        let place = at_line(data, scanner.at.saturating_sub(1));
        let mut elements = Vec::with_capacity(raw.len());
        for (name, count, properties) in raw {
            // Only the first of two elements of one name is read.
            let again = elements
                .iter()
                .any(|element: &PlyElement| element.name == name);
            let role = if again {
                ElementRole::Other
            } else {
                columns::role_of(job, place, &name, count, &properties)?
            };
            let (names, properties) = properties.into_iter().unzip();
            elements.push(PlyElement {
                name,
                count,
                properties,
                names,
                role,
            });
        }
        let has_textures = !textures.is_empty() && job.options.textures;
        columns::settle(job, &mut elements, has_textures);
        let vertices = elements
            .iter()
            .find(|element| matches!(element.role, ElementRole::Vertices(_)))
            .map(|element| element.count)
            .ok_or_else(|| job.syntax(place, "the header has no element `vertex`"))?;
        Ok(PlyHeader {
            encoding,
            elements,
            vertices,
            textures,
            end: scanner.at,
        })
    }
}

fn parse_element(
    job: &ReadJob<'_>,
    place: impl Fn() -> FilePlace,
    rest: &[&[u8]],
) -> Result<(String, u64, Named), Error> {
    let [name, count, ..] = rest else {
        return Err(job.syntax(place(), "an element line needs a name and a count"));
    };
    let count = std::str::from_utf8(count)
        .ok()
        .and_then(|text| text.parse().ok())
        .ok_or_else(|| job.number(place(), count, "a count of rows"))?;
    Ok((shown(name), count, Vec::new()))
}

fn parse_property(
    job: &ReadJob<'_>,
    place: impl Fn() -> FilePlace,
    rest: &[&[u8]],
) -> Result<(String, PlyProperty), Error> {
    let kind = |word: &[u8]| {
        ScalarType::parse(word)
            .ok_or_else(|| job.syntax(place(), format!("unknown property type `{}`", shown(word))))
    };
    match *rest {
        [b"list", count, item, name, ..] => {
            let property = PlyProperty::List {
                count: kind(count)?,
                item: kind(item)?,
            };
            if kind(count)?.is_float() {
                return Err(job.syntax(place(), "the length of a list cannot be a float"));
            }
            Ok((shown(name), property))
        }
        [b"list", ..] => Err(job.syntax(place(), "a list property needs two types and a name")),
        [type_name, name, ..] => Ok((shown(name), PlyProperty::Scalar(kind(type_name)?))),
        _ => Err(job.syntax(place(), "a property line needs a type and a name")),
    }
}
