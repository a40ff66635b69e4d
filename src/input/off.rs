//! OFF, the object file format of Geomview (its manual, section "OFF Files"): `[C][N]OFF`, comments, polygons.
//!
//! The keyword may be missing when the name ends in `.off`. Vertices and faces stand on lines of their own, which is
//! how everyone writes them; what follows the corners of a face (its color) is ignored.

use glam::{DVec3, Vec3};

use super::assemble::{Coordinates, Raw, colors_by_range};
use super::job::{Job, at_line};
use super::sniff::is_off_keyword;
use super::text::{Scanner, parse_f64, parse_i64, words};
use super::{Counts, Error, Warning};

/// Reads an OFF file.
pub(super) fn read(job: &mut Job<'_>, data: &[u8]) -> Result<Raw, Error> {
    let mut scanner = Scanner::new(data, 0);
    let missing = |job: &Job<'_>, what: &str| {
        job.truncated(at_line(data, data.len()), format!("{what} missing"))
    };

    let Some((mut line, mut at)) = scanner.meaningful_line() else {
        return Err(missing(job, "the counts of vertices and faces are"));
    };
    let mut keyword: &[u8] = b"OFF";
    if let Some(word) = words(line).next()
        && is_off_keyword(word)
    {
        keyword = word;
        if [b'4', b'n'].iter().any(|letter| keyword.contains(letter)) {
            return Err(job.unread("OFF with coordinates that are not three"));
        }
        // The counts may follow on the same line.
        line = line[word.len()..].trim_ascii();
        if line.is_empty() {
            (line, at) = scanner
                .meaningful_line()
                .ok_or_else(|| missing(job, "the counts of vertices and faces are"))?;
        }
    }
    if line.starts_with(b"BINARY") {
        return Err(job.unread("binary OFF"));
    }
    let (has_colors, has_normals) = (keyword.contains(&b'C'), keyword.contains(&b'N'));

    let mut counts = [0_u64; 2];
    let mut header = words(line);
    for count in &mut counts {
        let word = header.next().unwrap_or_default();
        let parsed = std::str::from_utf8(word)
            .ok()
            .and_then(|text| text.parse().ok());
        *count = parsed.ok_or_else(|| job.number(at_line(data, at), word, "a count"))?;
    }
    let [vertices, faces] = counts;
    job.check_vertices(vertices)?;
    // The shortest vertex is `0 0 0` with a line end, the shortest face `0` with one.
    let left = (data.len() - scanner.at) as u64 + 1;
    let needed = vertices
        .saturating_mul(6)
        .saturating_add(faces.saturating_mul(2));
    if needed > left {
        let text = format!(
            "{vertices} vertices and {faces} faces need at least {needed} bytes, {left} are left"
        );
        return Err(job.truncated(at_line(data, at), text));
    }

    let mut positions = Vec::with_capacity(vertices as usize);
    let mut normals = Vec::with_capacity(if has_normals { vertices as usize } else { 0 });
    let mut colors = Vec::with_capacity(if has_colors { vertices as usize } else { 0 });
    for _ in 0..vertices {
        let (line, at) = scanner
            .meaningful_line()
            .ok_or_else(|| missing(job, "vertices are"))?;
        let mut line_words = words(line);
        let mut number = || -> Result<f64, Error> {
            let word = line_words.next().unwrap_or_default();
            parse_f64(word)
                .ok_or_else(|| job.number(at_line(data, at), word, "a number of a vertex"))
        };
        positions.push(DVec3::new(number()?, number()?, number()?));
        if has_normals {
            normals.push(Vec3::new(
                number()? as f32,
                number()? as f32,
                number()? as f32,
            ));
        }
        if has_colors {
            colors.push([number()?, number()?, number()?]);
        }
        job.reach(scanner.at)?;
    }

    let mut triangles = Vec::with_capacity(faces as usize);
    let mut small = 0;
    for _ in 0..faces {
        let (line, at) = scanner
            .meaningful_line()
            .ok_or_else(|| missing(job, "faces are"))?;
        let mut line_words = words(line);
        let word = line_words.next().unwrap_or_default();
        let length = parse_i64(word)
            .filter(|&length| length >= 0)
            .ok_or_else(|| job.number(at_line(data, at), word, "a count of corners"))?;
        let mut corner = || -> Result<u32, Error> {
            let word = line_words.next().unwrap_or_default();
            let index = parse_i64(word)
                .ok_or_else(|| job.number(at_line(data, at), word, "the index of a vertex"))?;
            match u32::try_from(index) {
                Ok(small) if u64::from(small) < vertices => Ok(small),
                _ => Err(job.index(at_line(data, at), "vertex", index, vertices, 0)),
            }
        };
        if length < 3 {
            small += 1;
            continue;
        }
        let (first, mut previous) = (corner()?, corner()?);
        for _ in 2..length {
            let next = corner()?;
            triangles.push([first, previous, next]);
            previous = next;
        }
        job.reach(scanner.at)?;
    }
    job.warn_count(small, |count| Warning::FacesTooSmall { count });
    if scanner.meaningful_line().is_some() {
        let bytes = (data.len() - scanner.at) as u64;
        job.warn_count(bytes, |bytes| Warning::TrailingBytes { bytes });
    }
    Ok(Raw {
        coordinates: Coordinates::Double(positions),
        normals,
        absent_normals: 0,
        colors: colors_by_range(&colors),
        triangles,
        counts: Counts { vertices, faces },
    })
}
