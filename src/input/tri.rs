//! TRI: the text format of L. Benda's renderer (his section 4.1), and the public format of the same ending.
//!
//! Benda names three mandatory parts, Vertices, Vertices' Normals and Triangles, but his page with keywords and
//! index base is lost. **This is our reading**: a line that begins with a letter opens a part, known by its letters
//! alone (`Vertices`, `VerticesNormals`, `Triangles`, in any case and punctuation), its count may follow on the same
//! or the next line, then come rows of three numbers. Unknown parts are skipped. Indices begin at 0, unless one
//! equals the number of vertices and none is 0. Missing normals are a warning, not an error as with him: they can
//! be computed.
//!
//! The public kind begins with a line `vertices triangles`, then vertices of 3, 6 or 9 numbers (position, normal,
//! color), then triangles from 0.

use glam::{DVec3, Vec3};

use super::assemble::{FileCoordinates, RawMesh};
use super::color::{ColorRange, ColorSink};
use super::job::{ReadJob, at_line};
use super::part::{PartFate, PartFault};
use super::polygon::PolygonRuns;
use super::text::{TextScanner, parse_f64, parse_i64, shown, words};
use super::{Error, FileCounts, ReadWarning};

/// Reads a TRI file of either kind, told apart by the first line.
pub(super) fn read(job: &mut ReadJob<'_>, data: &[u8]) -> Result<RawMesh, Error> {
    let mut scanner = TextScanner::new(data, 0);
    let Some((line, at)) = scanner.meaningful_line() else {
        return Err(job.empty("the file has no vertices"));
    };
    let numbers: Vec<Option<i64>> = words(line).map(parse_i64).collect();
    match numbers[..] {
        [Some(vertices), Some(triangles)] if vertices >= 0 && triangles >= 0 => {
            read_public(job, scanner, at, vertices as u64, triangles as u64)
        }
        _ if line[0].is_ascii_alphabetic() => read_parts(job, data),
        _ => Err(job.syntax(
            at_line(data, at),
            "a TRI file begins with the name of a part or with two counts",
        )),
    }
}

fn read_public(
    job: &mut ReadJob<'_>,
    mut scanner: TextScanner<'_>,
    header: usize,
    vertices: u64,
    triangles: u64,
) -> Result<RawMesh, Error> {
    let data = scanner.data;
    job.check_vertices(vertices)?;
    let left = (data.len() - scanner.at) as u64 + 1;
    let needed = vertices.saturating_add(triangles).saturating_mul(6);
    if needed > left {
        let text =
            format!("{vertices} vertices and {triangles} triangles need at least {needed} bytes");
        return Err(job.truncated(at_line(data, header), text));
    }
    let missing = |job: &ReadJob<'_>, what: &str| {
        job.truncated(at_line(data, data.len()), format!("{what} are missing"))
    };
    let mut positions = Vec::with_capacity(vertices as usize);
    let (mut normals, mut colors) = (Vec::new(), ColorSink::new([ColorRange::EITHER; 3]));
    let mut width = None;
    for _ in 0..vertices {
        let (line, at) = scanner
            .meaningful_line()
            .ok_or_else(|| missing(job, "vertices"))?;
        let (row, found) = numbers_of(job, data, line, at, 3)?;
        let width = *width.get_or_insert(found);
        if found != width || !matches!(width, 3 | 6 | 9) {
            return Err(job.syntax(
                at_line(data, at),
                format!("a vertex of {found} numbers, where 3, 6 or 9 are known and the first has {width}"),
            ));
        }
        positions.push(DVec3::new(row[0], row[1], row[2]));
        if width >= 6 {
            normals.push(Vec3::new(row[3] as f32, row[4] as f32, row[5] as f32));
        }
        if width == 9 {
            colors.push([row[6], row[7], row[8]]);
        }
        job.reach(scanner.at)?;
    }
    let mut indices = Vec::with_capacity(triangles as usize);
    for _ in 0..triangles {
        let (line, at) = scanner
            .meaningful_line()
            .ok_or_else(|| missing(job, "triangles"))?;
        indices.push((triangle_of(job, data, line, at)?, at));
        job.reach(scanner.at)?;
    }
    let indices = check_indices(job, data, indices, vertices, 0)?;
    if let Some(remark) = colors.remark() {
        job.warn(remark);
    }
    let inventory = &mut job.inventory;
    inventory.add("vertices", vertices, PartFate::Used, "");
    inventory.add_some("normals", normals.len() as u64, PartFate::Used, "");
    inventory.add_some("colors", colors.colors.len() as u64, PartFate::Used, "");
    inventory.add("triangles", triangles, PartFate::Used, "");
    Ok(RawMesh {
        coordinates: FileCoordinates::Double(positions),
        normals,
        absent_normals: 0,
        colors: colors.colors,
        triangles: indices,
        polygons: PolygonRuns::default(),
        counts: FileCounts {
            vertices,
            faces: triangles,
        },
        textures: None,
    })
}

/// A part of Benda's kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum TrianglePart {
    Vertices,
    Normals,
    Triangles,
    Other,
}

impl TrianglePart {
    fn of(title: &[u8]) -> TrianglePart {
        let letters: Vec<u8> = title
            .iter()
            .filter(|byte| byte.is_ascii_alphabetic())
            .map(u8::to_ascii_lowercase)
            .collect();
        match &letters[..] {
            b"vertices" | b"vertex" => TrianglePart::Vertices,
            b"verticesnormals" | b"vertexnormals" | b"verticesnormal" | b"normals" => {
                TrianglePart::Normals
            }
            b"triangles" | b"triangle" | b"faces" => TrianglePart::Triangles,
            _ => TrianglePart::Other,
        }
    }
}

fn read_parts(job: &mut ReadJob<'_>, data: &[u8]) -> Result<RawMesh, Error> {
    let mut scanner = TextScanner::new(data, 0);
    let mut part = TrianglePart::Other;
    let mut positions: Vec<DVec3> = Vec::new();
    let mut normals: Vec<Vec3> = Vec::new();
    let mut indices: Vec<([i64; 3], usize)> = Vec::new();
    let mut has_triangles = false;
    // The count stated for each part.
    let mut stated: [Option<u64>; 3] = [None; 3];
    let mut at_start = false;
    while let Some((line, at)) = scanner.meaningful_line() {
        job.reach(scanner.at)?;
        if line[0].is_ascii_alphabetic()
            && parse_f64(words(line).next().unwrap_or_default()).is_none()
        {
            part = TrianglePart::of(line);
            if part == TrianglePart::Other {
                job.inventory.add(
                    format!("part `{}`", shown(line)),
                    1,
                    PartFate::LeftOut,
                    "not known",
                );
                job.inventory.leave_out(format!("part `{}`", shown(line)));
            }
            has_triangles |= part == TrianglePart::Triangles;
            at_start = true;
            // A count on the same line is its only word of digits.
            if part != TrianglePart::Other
                && let Some(count) = words(line).find_map(|word| parse_i64(word.trim_ascii()))
            {
                stated[part as usize] = Some(count.max(0) as u64);
                at_start = false;
            }
            continue;
        }
        if part == TrianglePart::Other {
            continue;
        }
        let mut line_words = words(line);
        if std::mem::take(&mut at_start)
            && let (Some(word), None) = (line_words.next(), line_words.next())
        {
            let count = parse_i64(word).filter(|&count| count >= 0);
            let count =
                count.ok_or_else(|| job.number(at_line(data, at), word, "a count of rows"))?;
            stated[part as usize] = Some(count as u64);
            continue;
        }
        if part == TrianglePart::Triangles {
            indices.push((triangle_of(job, data, line, at)?, at));
            continue;
        }
        if part == TrianglePart::Normals {
            let (row, found) = numbers_of(job, data, line, at, 0)?;
            if found != 3 {
                job.fault(PartFault::NORMAL, data, at);
            }
            normals.push(DVec3::new(row[0], row[1], row[2]).as_vec3());
            continue;
        }
        let (row, found) = numbers_of(job, data, line, at, 3)?;
        if found != 3 {
            return Err(job.syntax(
                at_line(data, at),
                format!("a row of {found} numbers where three belong"),
            ));
        }
        positions.push(DVec3::new(row[0], row[1], row[2]));
    }

    let vertices = positions.len() as u64;
    let found = [vertices, normals.len() as u64, indices.len() as u64];
    let names = ["vertices", "normals", "triangles"];
    for ((stated, found), what) in stated.into_iter().zip(found).zip(names) {
        if let Some(promised) = stated
            && promised != found
        {
            job.warn(ReadWarning::CountContradicts {
                what,
                promised,
                found,
            });
        }
        job.inventory.add_some(what, found, PartFate::Used, "");
    }
    if vertices == 0 {
        return Err(job.empty("the file has no vertices"));
    }
    job.check_vertices(vertices)?;
    if !has_triangles {
        return Err(job.syntax(at_line(data, data.len()), "the part `Triangles` is missing"));
    }
    if normals.is_empty() {
        job.warn(ReadWarning::PartMissing {
            what: "the part `Vertices' Normals` is",
        });
    } else if normals.len() as u64 != vertices {
        job.warn(ReadWarning::CountContradicts {
            what: "vertices with a normal",
            promised: vertices,
            found: normals.len() as u64,
        });
        normals.resize(positions.len(), Vec3::ZERO);
    }
    let corners = || indices.iter().flat_map(|(triangle, _)| triangle);
    let one_based =
        corners().any(|&corner| corner == vertices as i64) && !corners().any(|&corner| corner == 0);
    let faces = indices.len() as u64;
    let triangles = check_indices(job, data, indices, vertices, u32::from(one_based))?;
    Ok(RawMesh {
        coordinates: FileCoordinates::Double(positions),
        normals,
        absent_normals: 0,
        colors: Vec::new(),
        triangles,
        polygons: PolygonRuns::default(),
        counts: FileCounts { vertices, faces },
        textures: None,
    })
}

/// The numbers of a line, at most nine, and how many there are; a word after the first `needed` that is no number is zero.
fn numbers_of(
    job: &mut ReadJob<'_>,
    data: &[u8],
    line: &[u8],
    at: usize,
    needed: usize,
) -> Result<([f64; 9], usize), Error> {
    let mut row = [0.0; 9];
    let mut found = 0;
    for word in words(line) {
        let number = match parse_f64(word) {
            Some(number) => number,
            None if found >= needed => {
                job.fault(PartFault::EXTRA, data, at);
                0.0
            }
            None => return Err(job.number(at_line(data, at), word, "a number")),
        };
        if let Some(slot) = row.get_mut(found) {
            *slot = number;
        }
        found += 1;
    }
    Ok((row, found))
}

fn triangle_of(job: &ReadJob<'_>, data: &[u8], line: &[u8], at: usize) -> Result<[i64; 3], Error> {
    let mut triangle = [0; 3];
    let mut line_words = words(line);
    for corner in &mut triangle {
        let word = line_words.next().unwrap_or_default();
        *corner = parse_i64(word)
            .ok_or_else(|| job.number(at_line(data, at), word, "the index of a vertex"))?;
    }
    Ok(triangle)
}

fn check_indices(
    job: &ReadJob<'_>,
    data: &[u8],
    indices: Vec<([i64; 3], usize)>,
    vertices: u64,
    base: u32,
) -> Result<Vec<[u32; 3]>, Error> {
    let mut triangles = Vec::with_capacity(indices.len());
    for (triangle, at) in indices {
        let mut out = [0; 3];
        for (corner, out) in triangle.into_iter().zip(&mut out) {
            *out = corner
                .checked_sub(i64::from(base))
                .and_then(|index| u32::try_from(index).ok())
                .filter(|&index| u64::from(index) < vertices)
                .ok_or_else(|| job.index(at_line(data, at), "vertex", corner, vertices, base))?;
        }
        triangles.push(out);
    }
    Ok(triangles)
}
