//! The header of a PLY file: encoding, elements, properties, and which of them we know.

use super::super::job::{Job, at_line};
use super::super::text::{Scanner, shown, words};
use super::super::{Error, Place};

/// How the numbers are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Type {
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

impl Type {
    fn parse(word: &[u8]) -> Option<Type> {
        Some(match word {
            b"char" | b"int8" => Type::I8,
            b"uchar" | b"uint8" => Type::U8,
            b"short" | b"int16" => Type::I16,
            b"ushort" | b"uint16" => Type::U16,
            b"int" | b"int32" => Type::I32,
            b"uint" | b"uint32" => Type::U32,
            b"int64" | b"long" => Type::I64,
            b"uint64" | b"ulong" => Type::U64,
            b"float" | b"float32" => Type::F32,
            b"double" | b"float64" => Type::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary file.
    pub(super) fn size(self) -> usize {
        match self {
            Type::I8 | Type::U8 => 1,
            Type::I16 | Type::U16 => 2,
            Type::I32 | Type::U32 | Type::F32 => 4,
            Type::I64 | Type::U64 | Type::F64 => 8,
        }
    }

    pub(super) fn is_float(self) -> bool {
        matches!(self, Type::F32 | Type::F64)
    }

    /// A color channel as a byte: floats run from 0 to 1, 16-bit integers over their range, all other integers are
    /// bytes already.
    pub(super) fn color(self, value: f64) -> u8 {
        let unit = match self {
            Type::F32 | Type::F64 => value,
            Type::U16 => value / 65535.0,
            _ => value / 255.0,
        };
        super::super::assemble::color_from_unit(unit)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Property {
    Scalar(Type),
    List { count: Type, item: Type },
}

/// A number of every row that is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Column {
    /// Which property.
    pub(super) property: usize,
    pub(super) kind: Type,
}

/// Where the parts of a vertex are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct VertexColumns {
    pub(super) position: [Column; 3],
    pub(super) normal: Option<[Column; 3]>,
    pub(super) color: Option<[Column; 3]>,
}

/// What an element is to us.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Vertices(VertexColumns),
    /// Faces, with the number of the list property that holds the corners.
    Faces(usize),
    /// Triangle strips, likewise.
    Strips(usize),
    Other,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    pub(super) role: Role,
}

impl Element {
    /// Bytes of a binary row when no property is a list.
    pub(super) fn stride(&self) -> Option<usize> {
        self.properties
            .iter()
            .try_fold(0, |sum, property| match property {
                Property::Scalar(kind) => Some(sum + kind.size()),
                Property::List { .. } => None,
            })
    }
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
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
type Named = Vec<(String, Property)>;

impl Header {
    pub(super) fn parse(job: &Job<'_>, data: &[u8]) -> Result<Header, Error> {
        let head = &data[..data.len().min(LONGEST_HEADER)];
        let mut scanner = Scanner::new(head, 0);
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
                    if let [keyword, name, ..] = rest[..]
                        && keyword.eq_ignore_ascii_case(b"texturefile")
                    {
                        textures.push(shown(name));
                    }
                }
                b"format" => {
                    encoding = Some(match rest.first() {
                        Some(&b"ascii") => Encoding::Ascii,
                        Some(&b"binary_little_endian") => Encoding::LittleEndian,
                        Some(&b"binary_big_endian") => Encoding::BigEndian,
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
                .any(|element: &Element| element.name == name);
            let role = if again {
                Role::Other
            } else {
                role_of(job, place, &name, count, &properties)?
            };
            let properties = properties
                .into_iter()
                .map(|(_, property)| property)
                .collect();
            elements.push(Element {
                name,
                count,
                properties,
                role,
            });
        }
        let vertices = elements
            .iter()
            .find(|element| matches!(element.role, Role::Vertices(_)))
            .map(|element| element.count)
            .ok_or_else(|| job.syntax(place, "the header has no element `vertex`"))?;
        Ok(Header {
            encoding,
            elements,
            vertices,
            textures,
            end: scanner.at,
        })
    }
}

fn parse_element(
    job: &Job<'_>,
    place: impl Fn() -> Place,
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
    job: &Job<'_>,
    place: impl Fn() -> Place,
    rest: &[&[u8]],
) -> Result<(String, Property), Error> {
    let kind = |word: &[u8]| {
        Type::parse(word)
            .ok_or_else(|| job.syntax(place(), format!("unknown property type `{}`", shown(word))))
    };
    match *rest {
        [b"list", count, item, name, ..] => {
            let property = Property::List {
                count: kind(count)?,
                item: kind(item)?,
            };
            if kind(count)?.is_float() {
                return Err(job.syntax(place(), "the length of a list cannot be a float"));
            }
            Ok((shown(name), property))
        }
        [b"list", ..] => Err(job.syntax(place(), "a list property needs two types and a name")),
        [type_name, name, ..] => Ok((shown(name), Property::Scalar(kind(type_name)?))),
        _ => Err(job.syntax(place(), "a property line needs a type and a name")),
    }
}

fn role_of(
    job: &Job<'_>,
    place: Place,
    name: &str,
    count: u64,
    properties: &[(String, Property)],
) -> Result<Role, Error> {
    let column = |wanted: &str| {
        properties
            .iter()
            .enumerate()
            .find_map(|(index, (name, property))| match property {
                Property::Scalar(kind) if name == wanted => Some(Column {
                    property: index,
                    kind: *kind,
                }),
                _ => None,
            })
    };
    let three = |[a, b, c]: [&str; 3]| Some([column(a)?, column(b)?, column(c)?]);
    let corners = || {
        let is_list = |property: &Property| matches!(property, Property::List { .. });
        let known = ["vertex_indices", "vertex_index", "vertex_indexes"];
        known.iter().find_map(|wanted| {
            properties
                .iter()
                .position(|(name, property)| name == wanted && is_list(property))
        })
    };
    match name {
        "vertex" => {
            let Some(position) = three(["x", "y", "z"]) else {
                return Err(job.syntax(place, "element `vertex` has no properties x, y, z"));
            };
            let normal = three(["nx", "ny", "nz"]);
            let color = three(["red", "green", "blue"])
                .or_else(|| three(["r", "g", "b"]))
                .or_else(|| three(["diffuse_red", "diffuse_green", "diffuse_blue"]));
            Ok(Role::Vertices(VertexColumns {
                position,
                normal,
                color,
            }))
        }
        "face" | "tristrips" => match corners() {
            Some(list) if name == "face" => Ok(Role::Faces(list)),
            Some(list) => Ok(Role::Strips(list)),
            None if count == 0 => Ok(Role::Other),
            None => Err(job.syntax(
                place,
                format!("element `{name}` has no list `vertex_indices`"),
            )),
        },
        _ => Ok(Role::Other),
    }
}
