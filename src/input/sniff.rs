//! Decides the format: by content first, by the ending of the name when the content leaves it open.

use super::job::ReadJob;
use super::text::{TextScanner, parse_f64, words};
use super::{Error, ReadWarning};

/// A format with a reader; PLY tells its encoding itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SniffedKind {
    Obj,
    Ply,
    StlAscii,
    StlBinary,
    Off,
    Tri,
    Gltf,
    Las,
    E57,
    Pcd,
    /// Points as text.
    Text,
}

impl SniffedKind {
    fn name(self) -> &'static str {
        match self {
            SniffedKind::Obj => "OBJ",
            SniffedKind::Ply => "PLY",
            SniffedKind::StlAscii | SniffedKind::StlBinary => "STL",
            SniffedKind::Off => "OFF",
            SniffedKind::Tri => "TRI",
            SniffedKind::Gltf => "glTF",
            SniffedKind::Las => "LAS",
            SniffedKind::E57 => "E57",
            SniffedKind::Pcd => "PCD",
            SniffedKind::Text => "XYZ text",
        }
    }
}

/// What the first bytes say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SniffedContent {
    Known(SniffedKind),
    /// A format without a reader, by name.
    Unread(&'static str),
    /// Lines that begin with a number: OFF without its keyword, TRI, XYZ.
    Numbers,
    Unclear,
}

/// Lines and bytes looked at for the first word of a text format; comments before it can be long.
const SNIFF_LINES: usize = 2000;
const SNIFF_BYTES: usize = 1 << 18;

/// Size of a binary STL file's header with the triangle count, and of a triangle.
pub(super) const STL_HEADER: usize = 84;
pub(super) const STL_TRIANGLE: usize = 50;

/// Chooses the reader. Warns when the ending says something else.
pub(super) fn decide(job: &mut ReadJob<'_>, data: &[u8]) -> Result<SniffedKind, Error> {
    let ending = ending_of(job);
    let by_ending = match ending.as_str() {
        "obj" => Some(SniffedKind::Obj),
        "ply" => Some(SniffedKind::Ply),
        "stl" => Some(if is_text(data) {
            SniffedKind::StlAscii
        } else {
            SniffedKind::StlBinary
        }),
        "off" | "coff" | "noff" | "cnoff" => Some(SniffedKind::Off),
        "tri" => Some(SniffedKind::Tri),
        "las" | "laz" => Some(SniffedKind::Las),
        "gltf" | "glb" => Some(SniffedKind::Gltf),
        "pcd" => Some(SniffedKind::Pcd),
        "e57" => Some(SniffedKind::E57),
        "xyz" | "xyzn" | "xyzrgb" | "pts" | "ptx" | "asc" | "txt" | "csv" => {
            Some(SniffedKind::Text)
        }
        _ => None,
    };
    let unread_by_ending = match ending.as_str() {
        "qs" => Some("a QSplat tree"),
        "fbx" => Some("FBX"),
        "3mf" => Some("3MF"),
        "dae" => Some("COLLADA"),
        _ => None,
    };
    let unknown = || Error::UnknownFormat {
        path: job.path.to_owned(),
    };
    match content_of(data) {
        SniffedContent::Known(kind) => {
            if by_ending.map_or(unread_by_ending.is_some(), |ending| {
                ending.name() != kind.name()
            }) {
                job.warn(ReadWarning::EndingDisagrees {
                    ending,
                    format: kind.name(),
                });
            }
            Ok(kind)
        }
        SniffedContent::Unread(format) => Err(job.unread(format)),
        SniffedContent::Numbers => match by_ending {
            Some(kind @ (SniffedKind::Off | SniffedKind::Tri | SniffedKind::Text)) => Ok(kind),
            other => {
                if other.is_some() || unread_by_ending.is_some() {
                    job.warn(ReadWarning::EndingDisagrees {
                        ending,
                        format: SniffedKind::Text.name(),
                    });
                }
                Ok(SniffedKind::Text)
            }
        },
        SniffedContent::Unclear => match (by_ending, unread_by_ending) {
            (Some(kind), _) => Ok(kind),
            (None, Some(format)) => Err(job.unread(format)),
            (None, None) => Err(unknown()),
        },
    }
}

/// The ending of the name in lower case, without `.gz`.
fn ending_of(job: &ReadJob<'_>) -> String {
    let name = job
        .path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .to_ascii_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    name.rsplit_once('.')
        .map_or(String::new(), |(_, ending)| ending.to_owned())
}

/// Tells whether the beginning has no control bytes but white space: text in ASCII, Latin-1 or UTF-8.
fn is_text(data: &[u8]) -> bool {
    data.iter()
        .take(1024)
        .all(|&byte| byte >= b' ' || byte.is_ascii_whitespace() || byte == 0x0b)
}

fn content_of(data: &[u8]) -> SniffedContent {
    // A binary STL file has no mark: its header is free text, often beginning with `solid`. Its length is the only
    // proof, and a strong one: four bytes anywhere must agree with it.
    if data.len() > STL_HEADER
        && let Some(count) = data[80..].first_chunk::<4>()
        && data.len() as u64
            == STL_HEADER as u64 + u64::from(u32::from_le_bytes(*count)) * STL_TRIANGLE as u64
    {
        return SniffedContent::Known(SniffedKind::StlBinary);
    }
    let magics: [(&[u8], &'static str); 9] = [
        (b"QSplat", "a QSplat tree"),
        (b"Kaydara FBX", "FBX"),
        (b"PK\x03\x04", "a ZIP archive"),
        (b"#VRML", "VRML"),
        (b"#X3D", "X3D"),
        (b"<?xml", "XML (COLLADA or X3D)"),
        (b"DRACO", "Draco"),
        (b"MVSI", "an OpenMVS scene"),
        (b"\x1f\x8b", "a gzip file inside a gzip file"),
    ];
    if data.starts_with(b"glTF") {
        return SniffedContent::Known(SniffedKind::Gltf);
    }
    if data.starts_with(b"ASTM-E57") {
        return SniffedContent::Known(SniffedKind::E57);
    }
    if data.starts_with(b"# .PCD") {
        return SniffedContent::Known(SniffedKind::Pcd);
    }
    if data.starts_with(b"LASF") {
        return SniffedContent::Known(SniffedKind::Las);
    }
    if let Some((_, format)) = magics.iter().find(|(magic, _)| data.starts_with(magic)) {
        return SniffedContent::Unread(format);
    }
    if data.starts_with(b"ply") && data.get(3).is_none_or(u8::is_ascii_whitespace) {
        return SniffedContent::Known(SniffedKind::Ply);
    }
    if !is_text(data) {
        // Binary OFF has a text keyword; everything else binary is known by now, or by its ending.
        return SniffedContent::Unclear;
    }
    content_of_text(&data[..data.len().min(SNIFF_BYTES)])
}

fn content_of_text(data: &[u8]) -> SniffedContent {
    let mut scanner = TextScanner::new(data, 0);
    for _ in 0..SNIFF_LINES {
        let Some((line, _)) = scanner.meaningful_line() else {
            break;
        };
        let mut line_words = words(line);
        let Some(word) = line_words.next() else {
            continue;
        };
        if is_off_keyword(word) {
            return SniffedContent::Known(SniffedKind::Off);
        }
        let mut fields = word.split(|byte| b",;".contains(byte));
        if fields.next().and_then(parse_f64).is_some() {
            return SniffedContent::Numbers;
        }
        return match word {
            b"v" | b"vn" | b"vt" | b"vp" | b"f" | b"o" | b"g" | b"s" | b"l" | b"p" | b"mtllib"
            | b"usemtl" | b"usemap" | b"maplib" => SniffedContent::Known(SniffedKind::Obj),
            b"VERSION" | b"FIELDS" if line_words.next().is_some() => {
                SniffedContent::Known(SniffedKind::Pcd)
            }
            _ if word.eq_ignore_ascii_case(b"solid") => {
                SniffedContent::Known(SniffedKind::StlAscii)
            }
            _ if word.starts_with(b"{") && contains(data, b"\"asset\"") => {
                SniffedContent::Known(SniffedKind::Gltf)
            }
            _ => SniffedContent::Unclear,
        };
    }
    SniffedContent::Unclear
}

/// `OFF` with the prefixes of Geomview: `ST`, `C`, `N`, `4`, `n`, in this order.
pub(super) fn is_off_keyword(word: &[u8]) -> bool {
    let mut rest = word;
    for prefix in [&b"ST"[..], b"C", b"N", b"4", b"n"] {
        rest = rest.strip_prefix(prefix).unwrap_or(rest);
    }
    rest == b"OFF"
}

fn contains(data: &[u8], wanted: &[u8]) -> bool {
    data.windows(wanted.len()).any(|window| window == wanted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_names_the_format() {
        let cases: [(&[u8], SniffedContent); 14] = [
            (
                b"ply\nformat ascii 1.0\n",
                SniffedContent::Known(SniffedKind::Ply),
            ),
            (
                b"# c\r\n\r\nmtllib a.mtl\r\n",
                SniffedContent::Known(SniffedKind::Obj),
            ),
            (b"v 1 2 3", SniffedContent::Known(SniffedKind::Obj)),
            (
                b"# c\n STCN4nOFF # x\n",
                SniffedContent::Known(SniffedKind::Off),
            ),
            (
                b"solid a\nfacet normal",
                SniffedContent::Known(SniffedKind::StlAscii),
            ),
            (b"1 2 3\n", SniffedContent::Numbers),
            (
                b"{\"scene\":0,\"asset\":{}}",
                SniffedContent::Known(SniffedKind::Gltf),
            ),
            (b"VERSION .7\n", SniffedContent::Known(SniffedKind::Pcd)),
            (b"QSplat11....", SniffedContent::Unread("a QSplat tree")),
            (b"LASF", SniffedContent::Known(SniffedKind::Las)),
            (b"plywood\n", SniffedContent::Unclear),
            (b"hello\n", SniffedContent::Unclear),
            (b"\x00\x01\x02", SniffedContent::Unclear),
            (b"", SniffedContent::Unclear),
        ];
        for (data, wanted) in cases {
            assert_eq!(content_of(data), wanted, "{}", data.escape_ascii());
        }
    }

    #[test]
    fn a_binary_stl_that_says_solid_is_binary() {
        let mut data = b"solid made of steel".to_vec();
        data.resize(80, b' ');
        data.extend(2_u32.to_le_bytes());
        data.resize(84 + 100, 0);
        assert_eq!(
            content_of(&data),
            SniffedContent::Known(SniffedKind::StlBinary)
        );
        // Cut short it is not proven any more, but its zero bytes say that it is no text.
        data.pop();
        assert_eq!(content_of(&data), SniffedContent::Unclear);
        assert!(!is_text(&data));
    }
}
