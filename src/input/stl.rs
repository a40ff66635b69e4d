//! STL, text and binary (3D Systems, "Stereolithography Interface Specification", 1989).
//!
//! Every triangle has corners of its own; the caller welds them by exact position. The normal of a facet is not
//! kept: it belongs to no vertex, is often zero, and follows from the corners.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::assemble::{Coordinates, Raw};
use super::job::{Job, at_line};
use super::sniff::{STL_HEADER, STL_TRIANGLE};
use super::text::{Scanner, parse_f64, shown};
use super::{Counts, Error, Place, Warning};

/// Triangles per parallel piece.
const PIECE: usize = 1 << 14;

fn raw(coordinates: Coordinates, triangles: Vec<[u32; 3]>, faces: u64) -> Raw {
    let counts = Counts {
        vertices: coordinates.len() as u64,
        faces,
    };
    Raw {
        coordinates,
        normals: Vec::new(),
        absent_normals: 0,
        colors: Vec::new(),
        triangles,
        counts,
    }
}

/// Reads the binary kind: 80 bytes of free text, a count, 50 bytes a triangle (normal, corners, 16 bits of color by
/// conventions that differ, ignored).
pub(super) fn read_binary(job: &mut Job<'_>, data: &[u8]) -> Result<Raw, Error> {
    let count = data
        .get(80..)
        .and_then(|rest| rest.first_chunk::<4>())
        .map(|bytes| u32::from_le_bytes(*bytes));
    let Some(count) = count else {
        return Err(job.truncated(
            Place::Byte(data.len() as u64),
            "a binary STL file begins with 84 bytes",
        ));
    };
    let needed = u64::from(count) * STL_TRIANGLE as u64;
    let body = &data[STL_HEADER..];
    if needed > body.len() as u64 {
        return Err(job.truncated(
            Place::Byte(data.len() as u64),
            format!(
                "{count} triangles need {needed} bytes after the header, there are {}",
                body.len()
            ),
        ));
    }
    job.check_vertices(u64::from(count) * 3)?;
    let (body, rest) = body.split_at(needed as usize);
    job.warn_count(rest.len() as u64, |bytes| Warning::TrailingBytes { bytes });

    let mut corners = vec![Vec3::ZERO; count as usize * 3];
    corners
        .par_chunks_mut(PIECE * 3)
        .zip(body.par_chunks(PIECE * STL_TRIANGLE))
        .for_each(|(out, body)| {
            for (out, triangle) in out.chunks_exact_mut(3).zip(body.chunks_exact(STL_TRIANGLE)) {
                for (out, bytes) in out.iter_mut().zip(triangle[12..48].chunks_exact(12)) {
                    *out = Vec3::from_array(std::array::from_fn(|axis| {
                        f32::from_le_bytes(std::array::from_fn(|byte| bytes[4 * axis + byte]))
                    }));
                }
            }
        });
    let triangles = (0..count)
        .map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner))
        .collect();
    Ok(raw(
        Coordinates::Single(corners),
        triangles,
        u64::from(count),
    ))
}

/// Reads the text kind. Several solids in one file are one mesh; a loop of more than three corners becomes a fan.
pub(super) fn read_ascii(job: &mut Job<'_>, data: &[u8]) -> Result<Raw, Error> {
    let mut scanner = Scanner::new(data, 0);
    let mut corners: Vec<DVec3> = Vec::new();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    let (mut faces, mut small) = (0, 0);
    // Where the open loop began, and how many solids are open.
    let mut loop_start = None;
    let mut in_solid = false;
    while let Some((word, at)) = scanner.word() {
        let place = || at_line(data, at);
        let is = |keyword: &[u8]| word.eq_ignore_ascii_case(keyword);
        if is(b"vertex") {
            if loop_start.is_none() {
                return Err(job.syntax(place(), "a vertex stands outside of `outer loop`"));
            }
            corners.push(three_numbers(job, &mut scanner)?);
        } else if is(b"facet") {
            expect(job, &mut scanner, b"normal")?;
            three_numbers(job, &mut scanner)?;
        } else if is(b"outer") {
            expect(job, &mut scanner, b"loop")?;
            loop_start = Some(corners.len());
        } else if is(b"endloop") {
            let Some(start) = loop_start.take() else {
                return Err(job.syntax(place(), "`endloop` without `outer loop`"));
            };
            job.check_vertices(corners.len() as u64)?;
            let (first, end) = (start as u32, corners.len() as u32);
            if end - first < 3 {
                small += 1;
                corners.truncate(start);
            }
            triangles.extend((first + 2..end).map(|last| [first, last - 1, last]));
            faces += 1;
        } else if is(b"solid") {
            // The name may hold anything, keywords too.
            skip_name(&mut scanner);
            in_solid = true;
        } else if is(b"endsolid") {
            skip_name(&mut scanner);
            in_solid = false;
        } else if !is(b"endfacet") {
            return Err(job.syntax(place(), format!("unknown keyword `{}`", shown(word))));
        }
        job.reach(scanner.at)?;
    }
    if loop_start.is_some() || in_solid {
        return Err(job.truncated(at_line(data, data.len()), "`endsolid` is missing"));
    }
    job.warn_count(small, |count| Warning::FacesTooSmall { count });
    Ok(raw(Coordinates::Double(corners), triangles, faces))
}

/// Skips the rest of the line, unless the line has ended with the word just read.
fn skip_name(scanner: &mut Scanner<'_>) {
    scanner.line();
}

fn expect(job: &Job<'_>, scanner: &mut Scanner<'_>, keyword: &'static [u8]) -> Result<(), Error> {
    let name = String::from_utf8_lossy(keyword);
    match scanner.word() {
        Some((word, _)) if word.eq_ignore_ascii_case(keyword) => Ok(()),
        Some((word, at)) => Err(job.syntax(
            at_line(scanner.data, at),
            format!("`{}` where `{name}` should stand", shown(word)),
        )),
        None => Err(job.truncated(
            at_line(scanner.data, scanner.data.len()),
            format!("`{name}` is missing"),
        )),
    }
}

fn three_numbers(job: &Job<'_>, scanner: &mut Scanner<'_>) -> Result<DVec3, Error> {
    let mut numbers = [0.0; 3];
    for number in &mut numbers {
        let Some((word, at)) = scanner.word() else {
            return Err(job.truncated(
                at_line(scanner.data, scanner.data.len()),
                "a number is missing",
            ));
        };
        *number = parse_f64(word)
            .ok_or_else(|| job.number(at_line(scanner.data, at), word, "a number"))?;
    }
    Ok(DVec3::from_array(numbers))
}
